//! How a streamed sine is followed: ratio of the amplitudes and phase, over the frequency.

use crate::ControlBench;
use crate::load_changes::brought;
use crate::rigs::subject::Subject;
use crate::study::{Rigs, Study, draw, each};
use anyhow::Result;
use rig_control::TICK_S;
use rig_link::messages::{Request, State};
use rig_plant::RigPreset;
use rigctl::plot::{Axis, Block, Figure, INK, Item, KeyRow, Panel, Pen, colour};
use rigctl::trajectory::{EVERY_S, HOLDS_FOR_S};
use std::f64::consts::TAU;

/// Ticks of one period: a whole number of them, so that a sum over whole periods is a Fourier coefficient.
const PERIOD_TICKS: [usize; 8] = [1000, 500, 250, 125, 80, 50, 40, 25];
/// Loads (kg), and amplitudes (m).
const LOADS_KG: [f64; 2] = [0.5, 1.2];
const AMPLITUDES_M: [f64; 2] = [1e-3, 0.2e-3];
/// About which position (m).
const MIDDLE_M: f32 = 0.008;
/// Periods, but so many seconds at least, before the sine is measured and while it is.
const PERIODS: usize = 2;
const MIN_S: f64 = 4.0;

/// What is drawn: ratios from the first one on, and phases (degrees) from the first one to the second, a turn apart.
const DRAWN_RATIO: f64 = 0.01;
const DRAWN_DEGREES: [f64; 2] = [-330.0, 30.0];

/// Kinds of rigs, one of each.
const KINDS: [RigPreset; 2] = [RigPreset::Ideal, RigPreset::Nominal];

/// A rig, a load and an amplitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Series {
    /// Kind of rig, and its seed.
    pub rig: (RigPreset, u64),
    /// Load (kg).
    pub load_kg: f64,
    /// Amplitude (m).
    pub amplitude_m: f64,
}

/// A series and its answers.
type Played = (Series, Vec<Result<Response, String>>);

/// How the load answered a sine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response {
    /// Amplitude over that of the set-points.
    pub ratio: f64,
    /// Phase (rad), negative where the load is late.
    pub phase_rad: f64,
}

/// A period (ticks) as a frequency (Hz).
fn frequency_hz(period: usize) -> f64 {
    1.0 / (period as f64 * f64::from(TICK_S))
}

impl Series {
    /// The answer to a sine of each of `PERIOD_TICKS`, or how the stream ended early.
    pub fn play(&self) -> Vec<Result<Response, String>> {
        let (rig, seed) = self.rig;
        let mut at_rest = brought(&Subject::new(rig, seed), self.load_kg, MIDDLE_M);
        if let Ok(bench) = &mut at_rest {
            bench.run(1.0);
        }
        PERIOD_TICKS.iter().map(|period| self.sine(at_rest.clone()?, *period)).collect()
    }

    fn sine(&self, mut bench: ControlBench, period: usize) -> Result<Response, String> {
        let tick_s = f64::from(TICK_S);
        let every = (EVERY_S / tick_s).round() as usize;
        let phase = |ticks: usize| TAU * ticks as f64 / period as f64;
        let count = period * PERIODS.max((MIN_S / (tick_s * period as f64)).ceil() as usize);
        let mut positions_m = Vec::new();
        for k in 0..2 * count {
            let request = (k % every == 0).then(|| Request::Track {
                position_m: MIDDLE_M + (self.amplitude_m * phase(k).sin()) as f32,
                speed_m_per_s: (self.amplitude_m * TAU * frequency_hz(period) * phase(k).cos()) as f32,
                for_s: HOLDS_FOR_S,
            });
            if let Some(Err(refusal)) = bench.tick(request).reply {
                return Err(format!("refused: {refusal}"));
            }
            if bench.control.state() != State::Moving {
                return Err(format!("ends as {}: {:?}", bench.control.state(), bench.events.last()));
            }
            positions_m.push(bench.true_position_m());
        }
        // A tick ends one tick after the time of its set-point.
        let measured =
            positions_m[count..].iter().enumerate().map(|(k, position_m)| (phase(count + k + 1), *position_m));
        Ok(response(measured, self.amplitude_m))
    }
}

/// The first Fourier coefficient of positions (m) at phases (rad) over whole periods, over a sine's amplitude (m).
fn response(measured: impl Iterator<Item = (f64, f64)>, amplitude_m: f64) -> Response {
    let (mut sine, mut cosine, mut count) = (0.0, 0.0, 0.0);
    for (phase_rad, position_m) in measured {
        sine += position_m * phase_rad.sin();
        cosine += position_m * phase_rad.cos();
        count += 1.0;
    }
    Response { ratio: 2.0 * sine.hypot(cosine) / (count * amplitude_m), phase_rad: cosine.atan2(sine) }
}

/// Plays and draws every series.
///
/// # Errors
/// If the figure cannot be written.
pub fn study(rigs: &Rigs) -> Result<Study> {
    let seed = rigs.seeds(1).start;
    let kinds: Vec<RigPreset> = KINDS.into_iter().filter(|kind| rigs.wants(*kind)).collect();
    let mut all = Vec::new();
    for kind in &kinds {
        for load_kg in LOADS_KG {
            all.extend(AMPLITUDES_M.map(|amplitude_m| Series { rig: (*kind, seed), load_kg, amplitude_m }));
        }
    }
    let answers = each(rigs.jobs, &all, Series::play);
    let played: Vec<Played> = all.into_iter().zip(answers).collect();
    draw(&figure(&kinds, &played), "following")?;
    Ok(table(&played))
}

/// A row for each series, a column for each frequency.
fn table(played: &[Played]) -> Study {
    let frequencies = PERIOD_TICKS.map(|period| format!("{:.2} Hz", frequency_hz(period)));
    let mut study = Study::new(["rig, load, amplitude".to_owned()].into_iter().chain(frequencies));
    for (Series { rig: (rig, _), load_kg, amplitude_m }, answers) in played {
        let amplitude_mm = 1e3 * amplitude_m;
        let mut cells = vec![format!("{rig}, {load_kg} kg, {amplitude_mm} mm")];
        for (period, answer) in PERIOD_TICKS.iter().zip(answers) {
            let cell = |r: &Response| format!("{:.2}; {:.0}°", r.ratio, r.phase_rad.to_degrees());
            cells.push(answer.as_ref().map_or("ended".into(), cell));
            let name = format!("{rig}_{load_kg}kg_{amplitude_mm}mm_{:.2}hz_ratio", frequency_hz(*period));
            study.value(name, answer.as_ref().ok().map(|r| r.ratio));
        }
        study.row(cells);
    }
    study.notes.push(
        "Amplitude of the load's true position over that of the set-points; phase. \"ended\": the board has refused a \
         set-point of the stream, or has ended it, because the load was too far behind."
            .into(),
    );
    study
}

/// Ratio and phase over the frequency, for each kind of rig.
fn figure(kinds: &[RigPreset], played: &[Played]) -> Figure {
    let pens = |series: &Series| {
        let load = LOADS_KG.iter().position(|kg| *kg == series.load_kg).unwrap_or(0);
        Pen { dashed: series.amplitude_m != AMPLITUDES_M[0], ..Pen::solid(colour(load, LOADS_KG.len())) }
    };
    let panel = |kind: &RigPreset, title: &str, y: Axis, value: fn(&Response) -> f64| {
        let line = |(series, answers): &Played| {
            let at = PERIOD_TICKS.iter().zip(answers);
            let points = at.filter_map(|(period, answer)| Some((frequency_hz(*period), value(answer.as_ref().ok()?))));
            Item::line(points, pens(series))
        };
        let items = played.iter().filter(|(series, _)| series.rig.0 == *kind).map(line);
        Panel::new(format!("{title}, {kind} rig"), Axis::log("frequency, Hz", [0.1, 4.0]), y, items)
    };
    let ratio =
        |kind| panel(kind, "Amplitude ratio", Axis::log("ratio", [DRAWN_RATIO, 2.0]), |r| r.ratio.max(DRAWN_RATIO));
    let phase = |kind| {
        panel(kind, "Phase", Axis::linear("degrees", DRAWN_DEGREES), |r| {
            let degrees = r.phase_rad.to_degrees();
            if degrees > DRAWN_DEGREES[1] { degrees - 360.0 } else { degrees }
        })
    };
    let load = |(k, kg): (usize, &f64)| KeyRow::line(Pen::solid(colour(k, LOADS_KG.len())), format!("{kg} kg"));
    let amplitude = |pen, m: f64| KeyRow::line(pen, format!("{} mm", m * 1e3));
    Figure {
        heading: "Streamed sines about 8 mm, by the firmware's control code (emulated)".into(),
        rows: vec![Panel::side_by_side(kinds.iter().map(ratio)), Panel::side_by_side(kinds.iter().map(phase))],
        panel_size: (420, 260),
        blocks: vec![
            Block::new(LOADS_KG.iter().enumerate().map(load)),
            Block::new([amplitude(Pen::solid(INK), AMPLITUDES_M[0]), amplitude(Pen::dashed(INK), AMPLITUDES_M[1])]),
        ],
        notes: vec![
            "Where the motor's speed does not suffice for 1 mm, its limit makes the ratio fall before that of 0.2 mm."
                .into(),
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_that_is_smaller_and_late_is_found() {
        let measured = (0..200).map(|k| TAU * f64::from(k) / 50.0).map(|x| (x, 0.008 + 0.7e-3 * (x - 0.4).sin()));
        let found = response(measured, 1e-3);
        assert!((found.ratio - 0.7).abs() < 1e-9 && (found.phase_rad + 0.4).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn a_series_is_a_row_and_a_stream_that_ended_says_so() {
        let series = Series { rig: (RigPreset::Ideal, 1), load_kg: 0.5, amplitude_m: 1e-3 };
        let mut answers = vec![Err("too fast".to_owned()); PERIOD_TICKS.len()];
        answers[0] = Ok(Response { ratio: 0.99, phase_rad: -0.042 });
        let study = table(&[(series, answers)]);
        assert_eq!(study.table[0][..2], ["rig, load, amplitude", "0.10 Hz"]);
        assert_eq!(study.table[1][..3], ["ideal, 0.5 kg, 1 mm", "0.99; -2°", "ended"]);
        assert_eq!((study.values["ideal_0.5kg_1mm_0.10hz_ratio"], study.values.len()), (0.99, 1));
    }

    #[test]
    fn a_slow_sine_is_followed_and_one_beyond_the_motors_speed_is_not() {
        let series = Series { rig: (RigPreset::Ideal, 1), load_kg: 0.5, amplitude_m: 1e-3 };
        let answers = series.play();
        assert_eq!(answers.len(), PERIOD_TICKS.len());
        let slow = answers[1].clone().unwrap();
        assert!((slow.ratio - 1.0).abs() < 0.03 && slow.phase_rad.abs() < 0.1, "{slow:?}");
        // 25 mm/s: several times what the strings can do. The stream may also end.
        if let Ok(fast) = &answers[7] {
            assert!(fast.ratio < 0.5, "{fast:?}");
        }
    }
}
