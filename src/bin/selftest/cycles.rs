//! Measures a lookup and a control tick with the core's cycle counter. The emulated board can only count instructions.

use crate::scene::{RIG, TABLE};
use crate::table::{Table, Verdict};
use crate::{chip, registers};
use core::hint::black_box;
use cortex_m::peripheral::DWT;
use rig_control::{Controller, DriveCommand, DriveReading, Inputs, LvdtBlock, SupplyReading, TICK_US};
use rig_link::messages::{Request, State};

/// Where the loads and the twists lie in the table's range, 0 to 1.
const LOADS: [f32; 6] = [0.01, 0.05, 0.13, 0.28, 0.53, 0.94];
const TWISTS: [f32; 5] = [0.02, 0.18, 0.37, 0.64, 0.95];
/// Control ticks: half a second at rest, then half a second of a jog at this speed (rad/s).
const TICKS: u64 = 300;
const JOG_RAD_PER_S: f32 = 2.0;

/// Smallest and largest number of cycles.
#[derive(Clone, Copy)]
struct Spread {
    min: u32,
    max: u32,
}

impl Spread {
    const NONE: Self = Self { min: u32::MAX, max: 0 };

    /// Runs a function with interrupts off and counts its cycles.
    fn count<T>(&mut self, run: impl FnOnce() -> T) -> T {
        cortex_m::interrupt::free(|_| {
            let began = DWT::cycle_count();
            let done = black_box(run());
            let took = DWT::cycle_count().wrapping_sub(began);
            self.min = self.min.min(took);
            self.max = self.max.max(took);
            done
        })
    }
}

/// Rows of all measurements, with caches on and off. `hclk_hz` is the core's frequency (Hz).
pub fn rows(table: &mut Table, hclk_hz: u32) {
    // SAFETY: nothing else uses the core's trace unit.
    let mut core = unsafe { cortex_m::Peripherals::steal() };
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();
    for (on, rows) in [(true, ["lookup cached", "tick cached"]), (false, ["lookup uncached", "tick uncached"])] {
        chip::speed_up_flash(on);
        let unit = if registers::emulated() { "cycles (emulated: timing table)" } else { "cycles" };
        let lookup = lookup();
        let (tick, state) = tick();
        // The cycles of one control period.
        let limit = hclk_hz / 1_000_000 * TICK_US as u32;
        let seen = format_args!("{} to {} {unit}", lookup.min, lookup.max);
        table.row(rows[0], format_args!("less than a tick, {limit}"), seen, Verdict::of(lookup.max < limit));
        table.row(
            rows[1],
            format_args!("{}, less than {limit}", State::Moving),
            format_args!("{state}, {} to {} {unit}", tick.min, tick.max),
            Verdict::of(state == State::Moving && tick.max < limit),
        );
    }
    chip::speed_up_flash(true);
}

/// Cycles of lookups.
fn lookup() -> Spread {
    let mut lookup = Spread::NONE;
    let m = &TABLE.metadata;
    let within = |min: f32, max: f32, place: f32| min + place * (max - min);
    for load_n in LOADS.map(|place| within(m.load_min_n, m.load_max_n, place)) {
        for twist_rad in TWISTS.map(|place| within(m.twist_min_rad, m.twist_max_rad, place)) {
            let (load_n, twist_rad) = (black_box(load_n), black_box(twist_rad));
            lookup.count(|| TABLE.point_inside(load_n, twist_rad));
        }
    }
    lookup
}

/// Counts in a tick for each 1/5000 of the supply on the motor: about those of the default rig's motor without load.
const COUNTS_PER_PWM: i32 = 1;

/// Cycles of the control ticks of a healthy rig that is at rest and is then jogged, and its last state. The drive starts at
/// once and reaches each commanded position at once, and the encoder with it.
fn tick() -> (Spread, State) {
    let mut rig = Controller::new(black_box(&TABLE), RIG, None);
    let (mut spread, mut at_qc, mut starts) = (Spread::NONE, 0, false);
    for tick in 1..=TICKS {
        let now_us = tick * TICK_US;
        let jog = Request::Jog { twist_speed_rad_per_s: JOG_RAD_PER_S };
        let inputs = Inputs {
            now_us,
            encoder_counts: i64::from(at_qc),
            // Real codes vary; constant ones would be a fault.
            lvdt: Some(LvdtBlock { t_us: now_us, mean_code: 2048.0 + (tick % 3) as f32 * 0.1, variance: 4.0 }),
            drive: if starts {
                DriveReading::Starting
            } else {
                DriveReading::Reports { t_us: now_us, position_qc: at_qc, speed_rpm: 0, current_ma: 0 }
            },
            drive_stalled: false,
            bus_off: false,
            supply: Some(SupplyReading { t_us: now_us, volts: Some(24.0), on_motor: 0.0 }),
            upper_limit_open: false,
            lower_limit_open: false,
            estop_open: false,
            host_heard_us: Some(now_us),
            request: (tick == TICKS / 2).then_some(jog),
        };
        let outputs = spread.count(|| rig.step(&inputs));
        starts = matches!(outputs.drive, DriveCommand::Restart | DriveCommand::RestartOpenLoop);
        match outputs.drive {
            DriveCommand::Follow { position_qc, .. } => at_qc = position_qc,
            DriveCommand::Voltage { pwm } => at_qc += COUNTS_PER_PWM * i32::from(pwm),
            _ => {}
        }
    }
    (spread, rig.state())
}
