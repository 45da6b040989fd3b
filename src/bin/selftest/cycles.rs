//! What lookup, control tick and one equilibrium cost, by the core's own cycle counter: what the emulated board cannot know.

use crate::chip;
use crate::scene::{RIG, TABLE};
use crate::table::{Table, Verdict};
use core::hint::black_box;
use cortex_m::peripheral::DWT;
use rig_control::{DriveCommand, DriveReading, Inputs, LvdtBlock, Rig, SupplyReading, TICK_US};
use rig_link::messages::{Counters, Request, State};
use tsa_model::scalar::Single;
use tsa_model::{Mechanism, Parameters};

include!(concat!(env!("OUT_DIR"), "/parameters.rs"));

/// Loads (N) and twists (rad) of the table's range, off every grid; as for `cargo xtask cost`.
const LOADS_N: [f32; 6] = [0.61, 1.3, 2.9, 5.3, 9.7, 16.9];
const TWISTS_RAD: [f32; 5] = [3.9, 11.3, 20.7, 33.1, 47.9];
/// How far table and solver may be apart (m), as host-tests/tests/cost.rs has it.
const GAP_M: f32 = 2e-5;
/// Control ticks: half a second at rest, and as long turning at a speed (rad/s).
const TICKS: u64 = 100;
const JOG_RAD_PER_S: f32 = 2.0;

/// Least and most cycles.
#[derive(Clone, Copy)]
struct Spread {
    least: u32,
    most: u32,
}

impl Spread {
    const NONE: Self = Self { least: u32::MAX, most: 0 };

    /// Runs this with interrupts off, and counts.
    fn count<T>(&mut self, run: impl FnOnce() -> T) -> T {
        cortex_m::interrupt::free(|_| {
            let began = DWT::cycle_count();
            let done = black_box(run());
            let took = DWT::cycle_count().wrapping_sub(began);
            self.least = self.least.min(took);
            self.most = self.most.max(took);
            done
        })
    }
}

/// At so many cycles a second (Hz).
pub fn rows(table: &mut Table, hclk_hz: u32) {
    // SAFETY: nothing else uses the core's trace unit.
    let mut core = unsafe { cortex_m::Peripherals::steal() };
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();
    for (on, rows) in [
        (true, ["lookup cached", "tick cached", "equilibrium cached"]),
        (false, ["lookup uncached", "tick uncached", "equilibrium uncached"]),
    ] {
        chip::speed_up_flash(on);
        let unit = if chip::emulated() { "(emulated: instructions, not cycles)" } else { "cycles" };
        let (lookup, solve, apart_m) = solver();
        let (tick, state) = tick();
        // As many cycles as the control period has.
        let limit = hclk_hz / 1_000_000 * TICK_US as u32;
        let seen = format_args!("{} to {} {unit}", lookup.least, lookup.most);
        table.row(rows[0], format_args!("less than a tick, {limit}"), seen, Verdict::of(lookup.most < limit));
        table.row(
            rows[1],
            format_args!("{}, less than {limit}", State::Moving),
            format_args!("{state}, {} to {} {unit}", tick.least, tick.most),
            Verdict::of(state == State::Moving && tick.most < limit),
        );
        table.row(
            rows[2],
            format_args!("the table's gap within {:.0} um", GAP_M * 1e6),
            format_args!("{:.1} um; {} to {} {unit}", apart_m * 1e6, solve.least, solve.most),
            Verdict::of(apart_m <= GAP_M),
        );
    }
    chip::speed_up_flash(true);
}

/// Lookups and equilibria as a table that is made anew solves them, and how far they are apart (m).
fn solver() -> (Spread, Spread, f32) {
    let single = Mechanism::of(Parameters::<Single>::constant(&PARAMETERS));
    let (mut lookup, mut solve, mut apart_m) = (Spread::NONE, Spread::NONE, 0f32);
    for load_n in LOADS_N {
        for twist_rad in TWISTS_RAD {
            let (load_n, twist_rad) = (black_box(load_n), black_box(twist_rad));
            let found_m = lookup.count(|| TABLE.point_inside(load_n, twist_rad)).gap_m;
            let solved = solve.count(|| single.gap_and_slope(f64::from(load_n), f64::from(twist_rad)));
            // An equilibrium that is not found is infinitely far away.
            let solved_m = solved.map_or(f32::INFINITY, |[gap_m, _]| gap_m as f32);
            apart_m = apart_m.max((found_m - solved_m).abs());
        }
    }
    (lookup, solve, apart_m)
}

/// Control ticks of a healthy rig that hangs still and is then jogged, and the state that they end in. The drive goes where
/// it is told at once, with the encoder.
fn tick() -> (Spread, State) {
    let mut rig = Rig::new(black_box(&TABLE), RIG, None);
    let (mut spread, mut at_qc) = (Spread::NONE, 0);
    for tick in 1..=TICKS {
        let now_us = tick * TICK_US;
        let jog = Request::Jog { twist_speed_rad_per_s: JOG_RAD_PER_S };
        let inputs = Inputs {
            now_us,
            encoder_counts: i64::from(at_qc),
            // Its codes are never all alike.
            lvdt: Some(LvdtBlock { t_us: now_us, mean_code: 2048.0 + (tick % 3) as f32 * 0.1, variance: 4.0 }),
            drive: DriveReading::Reports { t_us: now_us, position_qc: at_qc, speed_rpm: 0, current_ma: 0 },
            drive_stalled: false,
            bus_off: false,
            supply: Some(SupplyReading { t_us: now_us, volts: 24.0 }),
            upper_limit_open: false,
            lower_limit_open: false,
            estop_open: false,
            host_heard_us: Some(now_us),
            request: (tick == TICKS / 2).then_some(jog),
            counters: Counters::default(),
        };
        let outputs = spread.count(|| rig.step(&inputs));
        if let DriveCommand::Follow { position_qc, .. } = outputs.drive {
            at_qc = position_qc;
        }
    }
    (spread, rig.state())
}
