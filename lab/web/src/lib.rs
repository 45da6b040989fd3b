//! The solver for the page that `tsa-lab report` writes: [`tsa_model`] behind plain WebAssembly exports.
//!
//! The page writes numbers into [`numbers`], calls a function, and reads numbers and text back. No function panics on
//! any number: what the model refuses comes back as `false` with `kind: message` in [`text`]. The build script of
//! `rigctl` compiles this crate for `wasm32-unknown-unknown`; the other half is `page/solver.js`.

#![cfg_attr(target_arch = "wasm32", no_std)]

mod page;

use core::cell::UnsafeCell;
use page::Page;

/// The one page. A page of a browser has one thread, and no export calls another.
struct Shared(UnsafeCell<Page>);

// SAFETY: WebAssembly without threads has one thread. On the desktop nothing but this crate's tests uses the crate, and
// they use `Page` itself.
unsafe impl Sync for Shared {}

static PAGE: Shared = Shared(UnsafeCell::new(Page::new()));

fn page() -> &'static mut Page {
    // SAFETY: each export takes the reference once and lets it go before it returns.
    unsafe { &mut *PAGE.0.get() }
}

/// Where constants and points are written, and results are read: an array of `page::NUMBERS` numbers.
#[unsafe(no_mangle)]
pub extern "C" fn numbers() -> *mut f64 {
    page().numbers.as_mut_ptr()
}

/// The text of the last call in UTF-8: the error, or the names of the warnings with commas between them.
#[unsafe(no_mangle)]
pub extern "C" fn text() -> *const u8 {
    page().text.as_ptr()
}

/// Bytes of [`text`].
#[unsafe(no_mangle)]
pub extern "C" fn text_length() -> usize {
    page().text.len()
}

/// Takes the mechanism's constants from [`numbers`]; the order is that of `page::Page::set_constants`.
#[unsafe(no_mangle)]
pub extern "C" fn set_constants() -> bool {
    page().set_constants()
}

/// Solves at a load (N) and turns past the half-turn pre-twist by a tier: 0 is the cheapest, 5 the full model. The
/// result is in [`numbers`], in the order of `page::Page::solve`.
#[unsafe(no_mangle)]
pub extern "C" fn solve(load_n: f64, turns: f64, tier: u32) -> bool {
    page().solve(load_n, turns, tier)
}

/// The torque on the strings that conserves energy (N m), at a load (N) and turns past the half-turn pre-twist; NaN where
/// it is not known.
#[unsafe(no_mangle)]
pub extern "C" fn torque(load_n: f64, turns: f64) -> f64 {
    page().torque(load_n, turns)
}

/// The cheapest tier whose own estimate of its error is within these (m, and relative); −1 where there is no
/// equilibrium.
#[unsafe(no_mangle)]
pub extern "C" fn cheapest(load_n: f64, turns: f64, contraction_m: f64, tr_relative: f64) -> i32 {
    page().cheapest(load_n, turns, contraction_m, tr_relative)
}

/// The bent half of a rod in the state of the last solve, from the clamp to the tip. Returns how many points are in
/// [`numbers`], each as its place along the clamp and its deflection (m); 0 where there is none.
#[unsafe(no_mangle)]
pub extern "C" fn rod_path() -> usize {
    page().rod_path()
}

/// Nothing here panics on purpose; the browser reports this as a `RuntimeError`, which the page shows as an error.
#[cfg(target_arch = "wasm32")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    core::arch::wasm32::unreachable()
}
