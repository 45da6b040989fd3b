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

counted! {
    fn cost_lookup(load_n: f32, twist_rad: f32) -> Point { tables::TABLE.point_inside(load_n, twist_rad) }
    fn cost_inverse_twist(load_n: f32, gap_m: f32) -> f32 { tables::TABLE.twist_from_gap(load_n, gap_m).unwrap_or(0.0) }
    fn cost_arc_few(load_n: f32, twist_rad: f32) -> Point { tables::ARC_FEW.point_inside(load_n, twist_rad) }
    fn cost_arc_many(load_n: f32, twist_rad: f32) -> Point { tables::ARC_MANY.point_inside(load_n, twist_rad) }
    fn cost_series(load_n: f32, twist_rad: f32) -> Point { tables::SERIES.point_inside(load_n, twist_rad) }
    fn cost_series_log(load_n: f32, twist_rad: f32) -> Point { tables::SERIES_LOG.point_inside(load_n, twist_rad) }
    fn cost_series_ratio(load_n: f32, twist_rad: f32) -> Point { tables::SERIES_RATIO.point_inside(load_n, twist_rad) }
    fn cost_hermite(load_n: f32, twist_rad: f32) -> Point { tables::HERMITE.point_inside(load_n, twist_rad) }
    fn cost_bilinear(load_n: f32, twist_rad: f32) -> Point { tables::BILINEAR.point_inside(load_n, twist_rad) }
    fn cost_full(mechanism: &Mechanism, load_n: f64, twist_rad: f64) -> f64 {
        mechanism.formal(load_n, twist_rad).map_or(0.0, |e| e.gap_m)
    }
    fn cost_rigid(mechanism: &Mechanism, load_n: f64, twist_rad: f64) -> f64 {
        tier(mechanism, Tier::Rigid, load_n, twist_rad)
    }
    fn cost_beam_column(mechanism: &Mechanism, load_n: f64, twist_rad: f64) -> f64 {
        tier(mechanism, Tier::BeamColumn, load_n, twist_rad)
    }
    fn cost_pseudo_rigid(mechanism: &Mechanism, load_n: f64, twist_rad: f64) -> f64 {
        tier(mechanism, Tier::PseudoRigid, load_n, twist_rad)
    }
    fn cost_elastica(mechanism: &Mechanism, load_n: f64, twist_rad: f64) -> f64 {
        tier(mechanism, Tier::Elastica, load_n, twist_rad)
    }
    fn cost_inextensible(mechanism: &Mechanism, load_n: f64, twist_rad: f64) -> f64 {
        tier(mechanism, Tier::Inextensible, load_n, twist_rad)
    }
    fn cost_collocation(mechanism: &Mechanism, load_n: f64, twist_rad: f64) -> f64 {
        by(mechanism, Method::Collocation { intervals: 16, tolerance: 1e-6 }, load_n, twist_rad)
    }
    fn cost_continuation(mechanism: &Mechanism, load_n: f64, twist_rad: f64) -> f64 {
        by(mechanism, Method::Continuation { steps: 1 }, load_n, twist_rad)
    }
    fn cost_paper(mechanism: &Mechanism, load_n: f64, twist_rad: f64) -> f64 {
        by(mechanism, Method::Paper { steps: 8, relaxation: 1.0, tolerance: 1e-5 }, load_n, twist_rad)
    }
    fn cost_sqrt_micromath(x: f32) -> f32 { micromath::F32Ext::sqrt(x) }
    fn cost_sqrt_libm(x: f32) -> f32 { libm::sqrtf(x) }
}

// Inlined, so that a tier and a method are known where they are called.
#[inline(always)]
fn tier(mechanism: &Mechanism, tier: Tier, load_n: f64, twist_rad: f64) -> f64 {
    mechanism.formal_tier(tier, load_n, twist_rad).map_or(0.0, |e| e.gap_m)
}

#[inline(always)]
fn by(mechanism: &Mechanism, method: Method, load_n: f64, twist_rad: f64) -> f64 {
    method.solve(mechanism, load_n, twist_rad).map_or(0.0, |e| e.gap_m)
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
