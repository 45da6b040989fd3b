//! A controller through a scenario on a plant, and what was recorded of it.

use super::baseline::{self, Baseline, Law};
use super::program::Outside;
use crate::rigs::commission::Firmware;
use crate::rigs::subject::Subject;
use crate::scenario::{Move, Scenario};
use crate::{ControlBench, ControlLaw};
use rig_control::TICK_S;

/// Twist at power-up (rad), from which the firmware has to find zero.
const TWIST_AT_BOOT_RAD: f64 = 1.0;

/// What one move was like, tick by tick.
#[derive(Clone, Debug, Default)]
pub struct Record {
    /// The plant changed on the way.
    pub changed: bool,
    /// Where it began and where it was to end (m).
    pub ends_m: [f64; 2],
    /// Where the load should have been (m).
    pub set_points_m: Vec<f32>,
    /// Where it was (m).
    pub positions_m: Vec<f64>,
    /// Electrical energy that the motor took (J).
    pub energy_j: f64,
}

/// A scenario on one plant as a controller played it: its moves, up to where it failed, and how it failed, if it did.
pub type Played = (Vec<Record>, Option<String>);

/// Plays one move: before each tick `tick` moves the bench on and says where the load should be.
fn record<C: ControlLaw>(
    bench: &mut ControlBench<C>,
    m: &Move,
    mut tick: impl FnMut(&mut ControlBench<C>, usize) -> Result<f32, String>,
) -> Result<Record, String> {
    let mut record = Record {
        changed: !m.changes.is_empty(),
        ends_m: [bench.true_position_m(), m.target_m.into()],
        ..Record::default()
    };
    let energy_j = bench.truth().motor_energy_j;
    for k in 0..m.ticks {
        for (_, change) in m.changes.iter().filter(|(at, _)| *at == k) {
            bench.rig.change_plant(*change).map_err(|e| e.to_string())?;
        }
        record.set_points_m.push(tick(bench, k)?);
        record.positions_m.push(bench.true_position_m());
    }
    record.energy_j = bench.truth().motor_energy_j - energy_j;
    Ok(record)
}

/// The firmware's control: homes, then every move, the load weighed by itself.
pub fn firmware(scenario: &Scenario, plant: &Subject, firmware: &Firmware) -> Played {
    let mut records = Vec::new();
    let mut play = || -> Result<(), String> {
        let rig = plant.switched_on_at(scenario.load_n, TWIST_AT_BOOT_RAD).map_err(|e| e.to_string())?;
        let mut bench = ControlBench::on(rig, firmware.boot());
        bench.home().map_err(|e| format!("homing: {e}"))?;
        for (number, m) in scenario.moves.iter().enumerate() {
            let one = record(&mut bench, m, |bench, k| {
                let out = bench.tick((k == 0).then_some(m.request));
                if let Some(Err(refusal)) = out.reply {
                    return Err(format!("refused: {refusal}"));
                }
                out.telemetry.setpoint_m.ok_or_else(|| match out.telemetry.fault {
                    Some(fault) => format!("fault: {fault} after {:.2} s", k as f64 * f64::from(TICK_S)),
                    None => format!("no set-point in state {:?}", out.telemetry.state),
                })
            });
            records.push(one.map_err(|e| format!("move {}: {e}", number + 1))?);
        }
        Ok(())
    };
    let failure = play().err();
    (records, failure)
}

/// A baseline that stands at its reference, along the firmware's set-points, as far as it and the plant go on.
pub fn baseline(mut bench: ControlBench<Baseline>, law: Law, scenario: &Scenario, along: &[Record]) -> Played {
    let mut records = Vec::new();
    let mut play = || -> Result<(), String> {
        bench.control.law = law;
        if let Law::Program(command) = law {
            bench.control.program = Some(Outside::start(command)?);
        }
        for (m, along) in scenario.moves.iter().zip(along) {
            records.push(record(&mut bench, m, |bench, k| {
                let set_point_m = along.set_points_m[k];
                baseline::follow(bench, set_point_m, m.target_m, m.speed_m_per_s);
                let failure = bench.control.program.as_ref().and_then(|program| program.failure.clone());
                failure.map_or(Ok(set_point_m), Err)
            })?);
        }
        Ok(())
    };
    let failure = play().err();
    (records, failure)
}
