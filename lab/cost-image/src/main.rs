//! The cost on the board of every way to evaluate the mechanism: each function below is called once for each state, and
//! the emulated board counts its instructions by its symbol (`cargo xtask cost`). The image uses no pins and no tasks.

#![no_std]
#![no_main]

use core::hint::black_box;
use defmt_rtt as _;
use panic_probe as _;
use rival_methods::Method;
use tsa_model::{Mechanism, Tier};
use tsa_table::Point;

#[allow(missing_docs, reason = "generated")]
mod tables {
    include!(concat!(env!("OUT_DIR"), "/tables.rs"));
}

/// Loads (N) and twists (rad) of the table's range, off every grid.
const LOADS_N: [f32; 6] = [0.91, 1.3, 2.9, 5.3, 9.7, 16.9];
const TWISTS_RAD: [f32; 5] = [3.9, 11.3, 20.7, 33.1, 47.9];

#[unsafe(no_mangle)]
#[inline(never)]
fn cost_lookup(load_n: f32, twist_rad: f32) -> Point {
    tables::TABLE.point_inside(load_n, twist_rad)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn cost_inverse_twist(load_n: f32, gap_m: f32) -> f32 {
    tables::TABLE.twist_from_gap(load_n, gap_m).unwrap_or(0.0)
}

macro_rules! table {
    ($name:ident, $table:ident) => {
        #[unsafe(no_mangle)]
        #[inline(never)]
        fn $name(load_n: f32, twist_rad: f32) -> Point {
            tables::$table.point_inside(load_n, twist_rad)
        }
    };
}

table!(cost_arc_few, ARC_FEW);
table!(cost_arc_many, ARC_MANY);
table!(cost_series, SERIES);
table!(cost_series_log, SERIES_LOG);
table!(cost_series_ratio, SERIES_RATIO);
table!(cost_hermite, HERMITE);
table!(cost_bilinear, BILINEAR);

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

#[unsafe(no_mangle)]
#[inline(never)]
fn cost_full(mechanism: &Mechanism, load_n: f64, twist_rad: f64) -> f64 {
    mechanism.formal(load_n, twist_rad).map_or(0.0, |e| e.gap_m)
}

macro_rules! tier {
    ($name:ident, $tier:ident) => {
        #[unsafe(no_mangle)]
        #[inline(never)]
        fn $name(mechanism: &Mechanism, load_n: f64, twist_rad: f64) -> f64 {
            mechanism.formal_tier(Tier::$tier, load_n, twist_rad).map_or(0.0, |e| e.gap_m)
        }
    };
}

tier!(cost_rigid, Rigid);
tier!(cost_beam_column, BeamColumn);
tier!(cost_pseudo_rigid, PseudoRigid);
tier!(cost_elastica, Elastica);
tier!(cost_inextensible, Inextensible);

#[unsafe(no_mangle)]
#[inline(never)]
fn cost_collocation(mechanism: &Mechanism, load_n: f64, twist_rad: f64) -> f64 {
    let method = Method::Collocation { intervals: 16, tolerance: 1e-6 };
    method.solve(mechanism, load_n, twist_rad).map_or(0.0, |e| e.gap_m)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn cost_continuation(mechanism: &Mechanism, load_n: f64, twist_rad: f64) -> f64 {
    Method::Continuation { steps: 1 }.solve(mechanism, load_n, twist_rad).map_or(0.0, |e| e.gap_m)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn cost_paper(mechanism: &Mechanism, load_n: f64, twist_rad: f64) -> f64 {
    let method = Method::Paper { steps: 8, relaxation: 1.0, tolerance: 1e-5 };
    method.solve(mechanism, load_n, twist_rad).map_or(0.0, |e| e.gap_m)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn cost_sqrt_micromath(x: f32) -> f32 {
    micromath::F32Ext::sqrt(x)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn cost_sqrt_libm(x: f32) -> f32 {
    libm::sqrtf(x)
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
