//! Slow motion: how much of the time a load stands while its set-point moves, how uneven its speed is, and from which speed on it
//! slides evenly without any control.

use crate::load_changes::brought;
use crate::rigs::subject::Subject;
use crate::study::{Rigs, Sorted, Study, each, shown};
use crate::{ControlBench, table};
use rig_control::TICK_S;
use rig_link::messages::{LoadChoice, Request, State};
use rig_plant::rig::built_in::STRUCTURAL_DAMPING_S;
use rig_plant::rig::effects::stribeck::coulomb_n;
use rig_plant::units::STANDARD_GRAVITY;
use rig_plant::{PlantSettings, RigPreset};

/// Kinds of rigs, and how many of each.
const KINDS: [(RigPreset, u64); 3] = [(RigPreset::Ideal, 1), (RigPreset::Nominal, 6), (RigPreset::Hard, 6)];
/// Loads (kg), and speeds (m/s).
const LOADS_KG: [f64; 3] = [0.1, 0.5, 1.2];
const SPEEDS_M_PER_S: [f32; 4] = [0.5e-3, 1e-3, 2e-3, 4e-3];
/// Ends of the way (m): the load is moved up, and down again.
const ENDS_M: [f32; 2] = [0.003, 0.009];
/// Part of the way at either end that is left out (m): there the load sets out and comes to rest.
const LEFT_OUT_M: f64 = 0.5e-3;
/// Rest at either end before the way (s).
const REST_S: f64 = 1.0;
/// Fraction of the wanted speed below which the load stands.
const STANDS: f64 = 0.05;
/// Speeds that are tried for an even motion: so many, up to so many times the Stribeck speed, where friction no longer falls.
const STEPS: u32 = 2000;
const MAX_VS: f64 = 10.0;

const NOTE: &str = "In each cell: percentage of the time in which the load stands (below a twentieth of the wanted speed), then the \
    deviation (rms) of its speed from the mean, in percent of the mean; median (most) of both ways, 3 to 9 mm and back, their first \
    and last half millimetre left out. The last column is computed: from this speed on, friction falls less with speed than the \
    dampers take. Below it a load on strings that turn evenly sticks and slips, unless the control damps its oscillation. \
    Presliding is left out.";

/// One way.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Evenness {
    /// Fraction of the time in which the load stands.
    stands: f64,
    /// Deviation (rms) of its speed from the mean, over the mean.
    ripple: f64,
}

/// Of speeds (m/s) at even times along a way that is wanted at a speed (m/s).
fn evenness(speeds: &[f64], wanted: f64) -> Option<Evenness> {
    let count = speeds.len() as f64;
    let mean = speeds.iter().sum::<f64>() / count;
    let squares = speeds.iter().map(|speed| (speed - mean).powi(2)).sum::<f64>();
    let standing = speeds.iter().filter(|speed| speed.abs() < STANDS * wanted).count() as f64;
    (count > 0.0).then(|| Evenness { stands: standing / count, ripple: (squares / count).sqrt() / mean.abs() })
}

/// One way to an end (m) at a speed (m/s).
fn way(bench: &mut ControlBench, to_m: f32, speed_m_per_s: f32) -> Option<Evenness> {
    bench.run(REST_S);
    let request = Request::Move { target_m: to_m, speed_m_per_s, load: LoadChoice::Auto };
    bench.ask(request).ok()?;
    let inner_m = [f64::from(ENDS_M[0]) + LEFT_OUT_M, f64::from(ENDS_M[1]) - LEFT_OUT_M];
    let (mut speeds, mut before_m) = (Vec::new(), bench.true_position_m());
    bench.until(60.0, |bench| {
        let position_m = bench.true_position_m();
        let set_point_m = bench.last.as_ref().and_then(|last| last.telemetry.setpoint_m).map_or(0.0, f64::from);
        if (inner_m[0]..inner_m[1]).contains(&set_point_m) {
            speeds.push((position_m - before_m) / f64::from(TICK_S));
        }
        before_m = position_m;
        bench.control.state() != State::Moving
    });
    evenness(&speeds, speed_m_per_s.into())
}

/// Up and down at every speed under a load (kg): speed (m/s) and result.
fn ways(subject: &Subject, load_kg: f64) -> Vec<(f32, Option<Evenness>)> {
    let at_rest = brought(subject, load_kg, ENDS_M[0]);
    let both = |speed: f32| match &at_rest {
        Ok(at_rest) => {
            let mut bench = at_rest.clone();
            [ENDS_M[1], ENDS_M[0]].map(|to_m| (speed, way(&mut bench, to_m, speed)))
        }
        Err(_) => [(speed, None); 2],
    };
    SPEEDS_M_PER_S.iter().flat_map(|speed| both(*speed)).collect()
}

/// The fastest speed (m/s) at which a load does not slide evenly on strings that turn evenly. Above it the dampers take more than friction
/// gives, which falls with speed by `(Fs − Fc) 2 v/vs² exp(−(v/vs)²)`. Below it, the load sticks and slips unless a control damps it.
fn slides_from(rig: &PlantSettings, stiffness_n_per_m: f64) -> f64 {
    let damper = rig.damping_n_s_per_m + STRUCTURAL_DAMPING_S * stiffness_n_per_m;
    let (vs, more_n) = (rig.stribeck_speed_m_per_s, (rig.stiction_ratio - 1.0) * coulomb_n(rig));
    let gives = |v: f64| 2.0 * more_n * v / (vs * vs) * (-(v / vs).powi(2)).exp();
    let mut speeds = (1..=STEPS).rev().map(|k| MAX_VS * vs * f64::from(k) / f64::from(STEPS));
    speeds.find(|v| gives(*v) > damper).unwrap_or(0.0)
}

/// The same of a rig under a load (kg), in the middle of the way.
fn slides_evenly_from(subject: &Subject, load_kg: f64) -> f64 {
    let load_n = load_kg * STANDARD_GRAVITY;
    let rig = PlantSettings { load_n, ..subject.settings() };
    let metadata = &table().metadata;
    let twist_rad = 0.5 * (metadata.twist_min_rad + metadata.twist_max_rad);
    slides_from(&rig, 1.0 / f64::from(table().point_inside(load_n as f32, twist_rad).dgap_dload_m_per_n))
}

/// Median and maximum of percentages.
fn percent(values: &Sorted) -> String {
    format!("{} ({})", shown(values.median(), 0), shown(values.max(), 0))
}

/// Measures it.
pub fn study(rigs: &Rigs) -> Study {
    let speeds = SPEEDS_M_PER_S.map(|speed| format!("{:.1} mm/s", 1e3 * speed));
    let head = [vec!["rigs, load".into()], speeds.to_vec(), vec!["slides evenly by itself from".into()]];
    let mut study = Study::new(head.concat());
    for (kind, count) in KINDS.into_iter().filter(|(kind, _)| rigs.wants(*kind)) {
        let subjects: Vec<Subject> = rigs.seeds(count).map(|seed| Subject::new(kind, seed)).collect();
        for load_kg in LOADS_KG {
            let found = each(rigs.jobs, &subjects, |subject| ways(subject, load_kg)).concat();
            let mut cells = vec![format!("{} {kind}, {load_kg} kg", subjects.len())];
            for speed in SPEEDS_M_PER_S {
                let here: Vec<_> = found.iter().filter(|(at, _)| *at == speed).map(|(_, found)| *found).collect();
                let of = |value: fn(&Evenness) -> f64| {
                    Sorted::new(here.iter().flatten().map(|evenness| 100.0 * value(evenness)))
                };
                let (stands, ripple) = (of(|e| e.stands), of(|e| e.ripple));
                let failed = here.iter().filter(|found| found.is_none()).count();
                let failed = if failed > 0 { format!("; {failed} of {} failed", here.len()) } else { String::new() };
                cells.push(format!("{}; {}{failed}", percent(&stands), percent(&ripple)));
                let name = format!("{kind}_{load_kg}kg_{:.1}mm_per_s", 1e3 * speed);
                study.value(format!("{name}_stands_percent_median"), stands.median());
                study.value(format!("{name}_ripple_percent_median"), ripple.median());
            }
            let evenly = Sorted::new(subjects.iter().map(|subject| 1e3 * slides_evenly_from(subject, load_kg)));
            cells.push(format!("{} ({}) mm/s", shown(evenly.median(), 1), shown(evenly.max(), 1)));
            study.row(cells);
        }
    }
    study.notes.push(NOTE.into());
    study
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_load_that_moves_half_of_the_time_stands_for_the_other_half() {
        let found = evenness(&[0.0, 4e-3, 0.0, 4e-3], 2e-3).unwrap();
        assert!((found.stands - 0.5).abs() < 1e-9 && (found.ripple - 1.0).abs() < 1e-9, "{found:?}");
        assert_eq!(evenness(&[-2e-3; 9], 2e-3), Some(Evenness { stands: 0.0, ripple: 0.0 }));
        assert_eq!(evenness(&[], 2e-3), None);
    }

    /// With vs = 2 mm/s friction falls most at √½ vs: by 0.43 times 2 (Fs − Fc)/vs.
    #[test]
    fn a_rail_whose_friction_falls_less_than_its_damper_takes_lets_the_load_slide_at_every_speed() {
        let rig = |stiction_ratio| PlantSettings {
            friction_n: 0.2,
            stiction_ratio,
            stribeck_speed_m_per_s: 2e-3,
            damping_n_s_per_m: 1.0,
            ..PlantSettings::default()
        };
        // 0.43 · 2 · 0.2 (ratio − 1)/2 mm/s is the damper's 1 N s/m at a ratio of 1.0117.
        assert_eq!(slides_from(&rig(1.011), 0.0), 0.0);
        assert!((1.2e-3..1.7e-3).contains(&slides_from(&rig(1.012), 0.0)), "{}", slides_from(&rig(1.012), 0.0));
        let much = slides_from(&rig(1.3), 0.0);
        let gives = 2.0 * 0.06 * much / 4e-6 * (-(much / 2e-3f64).powi(2)).exp();
        assert!((gives - 1.0).abs() < 0.02, "{much}: {gives}");
        assert_eq!(slides_from(&PlantSettings { stribeck_speed_m_per_s: 0.0, ..rig(1.3) }, 0.0), 0.0);
    }
}
