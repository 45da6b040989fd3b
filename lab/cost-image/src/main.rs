//! The cost on the board of every way to evaluate the mechanism: each function below is called once for each state, and
//! the emulated board counts its instructions by its symbol (`cargo xtask cost`). The image uses no pins and no tasks.

#![no_std]
#![no_main]

use baseline_methods::Method;
use core::hint::black_box;
use defmt_rtt as _;
use panic_probe as _;
use tsa_model::{Mechanism, Tier};
use tsa_table::Point;

#[allow(missing_docs, clippy::approx_constant, reason = "generated")]
mod tables {
    use table_forms::{Axis, Form, LoadMap, Table};
    include!(concat!(env!("OUT_DIR"), "/tables.rs"));
}

/// Loads (N) and twists (rad) of the table's range, off every grid.
const LOADS_N: [f32; 6] = [0.91, 1.3, 2.9, 5.3, 9.7, 16.9];
const TWISTS_RAD: [f32; 5] = [3.9, 11.3, 20.7, 33.1, 47.9];

/// Functions that are counted by their symbols.
macro_rules! counted {
    ($(fn $name:ident($($argument:ident: $type:ty),*) -> $answer:ty { $answered:expr })*) => {$(
        #[unsafe(no_mangle)]
        #[inline(never)]
        fn $name($($argument: $type),*) -> $answer {
            $answered
        }
    )*};
}

/// Lookups in tables, by their names.
macro_rules! lookups {
    ($($name:ident $table:ident;)*) => {
        counted! { $(fn $name(load_n: f32, twist_rad: f32) -> Point { tables::$table.point_inside(load_n, twist_rad) })* }
    };
}

/// Solvers: the gap (m), 0 where there is none.
macro_rules! solvers {
    ($($name:ident |$m:ident, $load_n:ident, $twist_rad:ident| $solved:expr;)*) => {
        counted! {
            $(fn $name($m: &Mechanism, $load_n: f64, $twist_rad: f64) -> f64 { $solved.map_or(0.0, |e| e.gap_m) })*
        }
    };
}

lookups! {
    cost_lookup TABLE;
    cost_arc_few ARC_FEW;
    cost_arc_many ARC_MANY;
    cost_series SERIES;
    cost_series_log SERIES_LOG;
    cost_series_ratio SERIES_RATIO;
    cost_hermite HERMITE;
    cost_bilinear BILINEAR;
}

solvers! {
    cost_full |m, load_n, twist_rad| m.formal(load_n, twist_rad);
    cost_rigid |m, load_n, twist_rad| m.formal_tier(Tier::Rigid, load_n, twist_rad);
    cost_beam_column |m, load_n, twist_rad| m.formal_tier(Tier::BeamColumn, load_n, twist_rad);
    cost_pseudo_rigid |m, load_n, twist_rad| m.formal_tier(Tier::PseudoRigid, load_n, twist_rad);
    cost_elastica |m, load_n, twist_rad| m.formal_tier(Tier::Elastica, load_n, twist_rad);
    cost_inextensible |m, load_n, twist_rad| m.formal_tier(Tier::Inextensible, load_n, twist_rad);
    cost_collocation |m, load_n, twist_rad|
        Method::Collocation { intervals: 16, tolerance: 1e-6 }.solve(m, load_n, twist_rad);
    cost_continuation |m, load_n, twist_rad| Method::Continuation { steps: 1 }.solve(m, load_n, twist_rad);
    cost_paper |m, load_n, twist_rad|
        Method::Paper { steps: 8, relaxation: 1.0, tolerance: 1e-5 }.solve(m, load_n, twist_rad);
}

counted! {
    fn cost_inverse_twist(load_n: f32, gap_m: f32) -> f32 { tables::TABLE.twist_from_gap(load_n, gap_m).unwrap_or(0.0) }
    fn cost_sqrt_micromath(x: f32) -> f32 { micromath::F32Ext::sqrt(x) }
    fn cost_sqrt_libm(x: f32) -> f32 { libm::sqrtf(x) }
}

/// `interpn`'s cubic interpolation on the smallest grid that gives the same contraction, without a gradient.
#[cfg(feature = "interpn")]
#[unsafe(no_mangle)]
#[inline(never)]
fn cost_interpn(load_n: f32, twist_rad: f32) -> f32 {
    use tables::{INTERPN, INTERPN_DIMS, INTERPN_STARTS, INTERPN_STEPS};
    let grid = interpn::MulticubicRegular::<f32, 2>::new(INTERPN_DIMS, INTERPN_STARTS, INTERPN_STEPS, &INTERPN, false);
    grid.and_then(|grid| grid.interp_one([1.0 / libm::sqrtf(load_n), twist_rad])).unwrap_or(0.0)
}

/// Not measured in this image.
#[cfg(not(feature = "interpn"))]
fn cost_interpn(_: f32, _: f32) -> f32 {
    f32::NAN
}

// One instruction of the FPU, for which stable Rust without `std` has no function.
core::arch::global_asm!(
    ".fpu fpv4-sp-d16",
    ".section .text.cost_sqrt_fpu,\"ax\",%progbits",
    ".global cost_sqrt_fpu",
    ".type cost_sqrt_fpu,%function",
    ".thumb_func",
    "cost_sqrt_fpu:",
    "vsqrt.f32 s0, s0",
    "bx lr",
    ".size cost_sqrt_fpu, . - cost_sqrt_fpu",
);

// SAFETY: the function above, in the target's calling convention: f32 in and out in s0.
unsafe extern "C" {
    safe fn cost_sqrt_fpu(x: f32) -> f32;
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let mechanism = Mechanism::of(tables::PARAMETERS);
    for load in LOADS_N {
        for twist in TWISTS_RAD {
            let (load, twist) = (black_box(load), black_box(twist));
            let (f, t) = (f64::from(load), f64::from(twist));
            let point = cost_lookup(load, twist);
            // In the host's order (m, N, rad). The results are sent to the host, so that nothing is optimised away.
            let singles = [
                point.gap_m,
                cost_inverse_twist(load, point.gap_m),
                cost_arc_few(load, twist).gap_m,
                cost_arc_many(load, twist).gap_m,
                cost_series(load, twist).gap_m,
                cost_series_log(load, twist).gap_m,
                cost_series_ratio(load, twist).gap_m,
                cost_hermite(load, twist).gap_m,
                cost_bilinear(load, twist).gap_m,
                cost_interpn(load, twist),
                cost_sqrt_micromath(load),
                cost_sqrt_libm(load),
                cost_sqrt_fpu(load),
            ];
            // These two take ten and a thousand times as long as the others.
            let few = twist == TWISTS_RAD[2] && load < 3.0;
            let paper = if few { cost_paper(&mechanism, f, t) } else { f64::NAN };
            let collocation = if few { cost_collocation(&mechanism, f, t) } else { f64::NAN };
            let doubles = [
                cost_rigid(&mechanism, f, t),
                cost_beam_column(&mechanism, f, t),
                cost_pseudo_rigid(&mechanism, f, t),
                cost_elastica(&mechanism, f, t),
                cost_inextensible(&mechanism, f, t),
                cost_full(&mechanism, f, t),
                cost_continuation(&mechanism, f, t),
                collocation,
                paper,
            ];
            defmt::println!("{} {} {} {}", load, twist, singles, doubles);
        }
    }
    #[cfg(feature = "interpn")]
    let interpn_bytes = size_of_val(&tables::INTERPN);
    #[cfg(not(feature = "interpn"))]
    let interpn_bytes = 0;
    defmt::println!("done {}", interpn_bytes);
    loop {
        cortex_m::asm::wfi();
    }
}
