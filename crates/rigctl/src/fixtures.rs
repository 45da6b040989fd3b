//! Messages of a board, for tests.

use rig_link::{Clock, Doubts, Faults, Identity, PROTOCOL_HASH, ResetCause, State, TableIdentity, Telemetry};

/// The identity of a board of this version, with an image of this git id.
pub fn identity(git: &str) -> Identity {
    Identity {
        version: env!("CARGO_PKG_VERSION").parse().expect("fits"),
        git: git.parse().expect("fits"),
        protocol_hash: PROTOCOL_HASH,
        scene_hash: 0,
        rig_hash: 0,
        table: TableIdentity {
            form: Default::default(),
            bytes: 0,
            contraction_error_m: 0.0,
            tr_relative_error: 0.0,
            load_min_n: 0.0,
            load_max_n: 0.0,
            turns_min: 0.0,
            turns_max: 0.0,
            crc: 0,
            sent: false,
        },
        reset_cause: ResetCause::PowerOn,
        clock: Clock::Hse,
        brown_out_level: 3,
        boot_count: 1,
        last_panic: None,
    }
}

/// Telemetry of a board that is ready, at this time (µs).
pub fn telemetry(t_us: u64) -> Telemetry {
    Telemetry {
        t_us,
        state: State::Ready,
        fault: None,
        faults: Faults::NONE,
        limit: None,
        doubts: Doubts::NONE,
        target_m: None,
        setpoint_m: None,
        position_m: None,
        twist_rad: None,
        load_n: None,
        load_error_n: None,
        position_error_m: None,
        tr_rad_per_m: None,
        drive_current_a: 0.0,
        drive_speed_rad_per_s: 0.0,
        time_left_s: None,
        twist_scale: None,
        gap_m: None,
        shaft_rad: 0.0,
        supply_v: None,
    }
}
