//! `response`: the frequency response of the loop and of the mechanism, from a set-point that is a sum of cosines.

mod figure;

use super::motion::home_first;
use crate::csv_text;
use crate::failure::Failure;
use crate::options::Global;
use crate::options::values::of;
use crate::out_file::{OutFile, distinct};
use crate::output::Output;
use crate::plan::Plan;
use crate::session::row::Row;
use crate::session::{Wanted, stream};
use crate::trajectory::{EVERY_S, Trajectory};
use crate::units::{HZ, MM, Quantity};
use clap::Args;
use rig_control::homing::NINETY_PERCENT;
use rig_link::{LoadChoice, State};
use serde::Serialize;
use std::f64::consts::{PI, TAU};
use std::path::PathBuf;

/// Periods of the lowest frequency in one period of the set-point.
const LOWEST_PERIODS: f64 = 4.0;
/// Frequencies that are asked for, evenly in their logarithm.
const LINES: u32 = 16;
/// Frequencies (Hz): the lowest takes half an hour, the highest has ten set-points in a period, of 50 a second.
const RANGE_HZ: [f64; 2] = [0.01, 5.0];

/// Measure the frequency response of loop and mechanism
///
/// Leads the load about a place by a sum of cosines of equal size, period after period, and compares the periods after the
/// first one. Writes CSV, a row for each frequency: gain and phase from the set-point to the measured position (`loop_…`)
/// and from the twist of the strings to the position (`mechanism_…`, m/rad), the 90 % error of each gain, and the coherence,
/// which is below 1 where noise, not the input, moves the load. Friction and backlash repeat in each period: they change the
/// response with the amplitude, not the coherence. On an emulated board it homes first.
/// Example: `rigctl response --out response.csv`
#[derive(Debug, Args)]
pub struct Response {
    /// Place about which the load is led (m, mm)
    #[arg(long, value_name = "P", default_value = "8mm", allow_hyphen_values = true, value_parser = of("at", Quantity::Length))]
    at: f64,
    /// Largest distance of the set-point from there (m, mm, µm)
    #[arg(long, value_name = "A", default_value = "1mm", allow_hyphen_values = true, value_parser = of("amplitude", Quantity::Length))]
    amplitude: f64,
    /// Lowest frequency (Hz)
    #[arg(long, value_name = "F", default_value = "0.2Hz", value_parser = of("from", Quantity::Frequency))]
    from: f64,
    /// Highest frequency (Hz), at most 5 Hz
    #[arg(long, value_name = "F", default_value = "2Hz", value_parser = of("to", Quantity::Frequency))]
    to: f64,
    /// Periods that are compared; each is four of the lowest frequency
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u8).range(2..=100))]
    periods: u8,
    /// File to write
    #[arg(long, value_name = "FILE.csv")]
    out: PathBuf,
    /// Picture to write: gain, phase and coherence over frequency
    #[arg(long, value_name = "FILE.svg")]
    figure: Option<PathBuf>,
}

/// From an input to an output, at one frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Transfer {
    gain: f64,
    gain_error: f64,
    phase_deg: f64,
    coherence: f64,
}

/// A row of the file.
#[derive(Clone, Copy, Debug, Serialize)]
struct Line {
    frequency_hz: f64,
    loop_gain: f64,
    loop_gain_error: f64,
    loop_phase_deg: f64,
    loop_coherence: f64,
    mechanism_gain_m_per_rad: f64,
    mechanism_gain_error_m_per_rad: f64,
    mechanism_phase_deg: f64,
    mechanism_coherence: f64,
}

/// What is printed as JSON.
#[derive(Serialize)]
struct Measured<'a> {
    file: String,
    bandwidth_hz: Option<f64>,
    peak_gain: f64,
    held_back_share: f64,
    lines: &'a [Line],
}

impl Response {
    /// Runs the command.
    ///
    /// # Errors
    /// If a parameter is out of range, the load cannot be led so, the file cannot be written, or the board refuses or stops.
    pub fn run(&self, global: &Global, output: &mut Output) -> Result<(), Failure> {
        let [min, max] = RANGE_HZ;
        if !(min <= self.from && self.from < self.to && self.to <= max) {
            let [from, to] = [self.from, self.to].map(|frequency| HZ.exact(frequency));
            let allowed = HZ.range(RANGE_HZ);
            return Err(Failure::Usage(format!("--from {from}, --to {to}: allowed are {allowed}, in this order")));
        }
        if self.amplitude <= 0.0 {
            return Err(Failure::Usage(format!("--amplitude {}: must be above 0", MM.exact(self.amplitude))));
        }
        let (trajectory, places) = self.trajectory().map_err(|why| Failure::Usage(format!("--amplitude: {why}")))?;
        let scene = global.scene()?;
        distinct("--figure", self.figure.as_deref(), "--out", Some(&self.out))?;
        let (out, picture) = (OutFile::new(&self.out)?, self.figure.as_deref().map(OutFile::new).transpose()?);
        let target = global.target()?;
        let mut session = target.connect(Wanted::OfScene)?;
        let values = session.settings()?.values;
        let possible = |load_n| {
            let checked = Plan::new(&scene, values, load_n)?.check_trajectory(&trajectory);
            // It has no rows that the operator has written.
            checked.map_err(|(_, why)| Failure::failed(format!("--at, --amplitude, --to: {why}")))
        };
        if global.is_emulated() {
            possible(None)?;
            home_first(&mut session, LoadChoice::Auto, output)?;
        }
        possible(session.newest_row()?.and_then(|row| row.load_n))?;
        let mut rows = Vec::new();
        let streamed = stream::track(&mut session, &trajectory, |row| {
            // The load has come to where the trajectory begins, and holds.
            if row.state == State::Moving { rows.push(row.clone()) } else { rows.clear() }
        })?;
        let lines = lines(&rows, self.period_s(), &places)?;
        out.write(csv_text::named(&lines)?)?;
        if let Some(picture) = picture {
            let [at, amplitude] = [self.at, self.amplitude].map(|length| MM.exact(length));
            let board = target.emulated().map_or_else(|| format!("board at {}", target.port()), ToString::to_string);
            picture.write(figure::figure(&lines, format!("Frequency response at {at} ± {amplitude}"), board)?)?;
        }
        let peak = lines.iter().map(|line| line.loop_gain).fold(0.0, f64::max);
        let bandwidth_hz = bandwidth_hz(&lines);
        output.object(&Measured {
            file: self.out.display().to_string(),
            bandwidth_hz,
            peak_gain: peak,
            held_back_share: streamed.held_back_share,
            lines: &lines,
        })?;
        let bandwidth = bandwidth_hz.map_or_else(|| format!("above {}", HZ.exact(self.to)), |hz| HZ.show(hz));
        let files = std::iter::once(&self.out).chain(&self.figure);
        output.named([
            ("frequencies", format!("{} from {} to {}", lines.len(), HZ.exact(self.from), HZ.exact(self.to))),
            ("bandwidth", bandwidth + " (-3 dB, set-point to position)"),
            ("peak gain", format!("{peak:.3}")),
            ("limit", streamed.limit_text()),
            ("written", files.map(|file| file.display().to_string()).collect::<Vec<_>>().join(", ")),
        ])?;
        Ok(())
    }

    /// Period of the set-point (s), a multiple of the time between two set-points.
    fn period_s(&self) -> f64 {
        (LOWEST_PERIODS / self.from / EVERY_S).round() * EVERY_S
    }

    /// The set-point, one period more than are compared, and how many periods of each of its frequencies fit into one of it.
    fn trajectory(&self) -> Result<(Trajectory, Vec<u32>), String> {
        let (period_s, ratio) = (self.period_s(), self.to / self.from);
        let mut places: Vec<u32> = (0..LINES)
            .map(|k| (self.from * ratio.powf(f64::from(k) / f64::from(LINES - 1)) * period_s).round() as u32)
            .collect();
        places.dedup();
        // With phases that grow with the square of the number the cosines hardly ever add up (Schroeder 1970).
        let waves: Vec<(f64, f64)> = (0u32..)
            .zip(&places)
            .map(|(k, place)| (TAU * f64::from(*place) / period_s, PI * f64::from(k * k) / places.len() as f64))
            .collect();
        let ticks = (period_s / EVERY_S).round() as u32;
        let times: Vec<f64> = (0..=ticks * u32::from(self.periods + 1)).map(|k| EVERY_S * f64::from(k)).collect();
        let sum = |t_s: f64, part: fn(f64, f64) -> f64| -> f64 {
            waves.iter().map(|(speed, phase)| part(*speed, speed * t_s - phase)).sum()
        };
        let shape: Vec<f64> = times.iter().map(|t_s| sum(*t_s, |_, angle| angle.cos())).collect();
        let size_m = self.amplitude / shape.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
        let positions: Vec<f64> = shape.iter().map(|value| self.at + size_m * value).collect();
        let speeds: Vec<f64> =
            times.iter().map(|t_s| -size_m * sum(*t_s, |speed, angle| speed * angle.sin())).collect();
        Trajectory::new(&times, &positions, Some(&speeds)).map(|trajectory| (trajectory, places))
    }
}

/// The lowest frequency (Hz) from which the gain of the loop is below 1/√2, if there is one.
fn bandwidth_hz(lines: &[Line]) -> Option<f64> {
    let first = lines.iter().rposition(|line| line.loop_gain >= 0.5f64.sqrt()).map_or(0, |k| k + 1);
    lines.get(first).map(|line| line.frequency_hz)
}

/// The responses at the frequencies of which so many periods fit into a period (s), from the rows of the whole stream.
fn lines(rows: &[Row], period_s: f64, places: &[u32]) -> Result<Vec<Line>, Failure> {
    let shown = |row: &Row| {
        let values = [row.target_m?, row.position_m?, row.twist_rad?].map(f64::from);
        Some((row.t_s, values))
    };
    let all: Vec<(f64, [f64; 3])> = rows.iter().filter_map(shown).collect();
    let start_s = all.first().map_or(0.0, |(t_s, _)| *t_s);
    // Rows of the second period and of each later one that is whole.
    let count = all.last().map_or(0.0, |(t_s, _)| (t_s - start_s) / period_s).floor() as usize;
    let mut periods = vec![Vec::new(); count.saturating_sub(1)];
    for (t_s, values) in all {
        let place = ((t_s - start_s) / period_s).floor() as usize;
        if let Some(period) = place.checked_sub(1).and_then(|place| periods.get_mut(place)) {
            period.push((t_s - start_s, values));
        }
    }
    if periods.len() < 2 {
        return Err(Failure::failed("the stream has ended before two periods were recorded"));
    }
    let line = |place: &u32| {
        let frequency_hz = f64::from(*place) / period_s;
        let seen: Vec<[[f64; 2]; 3]> = periods.iter().map(|rows| amplitudes(rows, frequency_hz)).collect();
        let [of_loop, mechanism] = [0, 2].map(|input| transfer(seen.iter().map(|seen| [seen[input], seen[1]])));
        Line {
            frequency_hz,
            loop_gain: of_loop.gain,
            loop_gain_error: of_loop.gain_error,
            loop_phase_deg: of_loop.phase_deg,
            loop_coherence: of_loop.coherence,
            mechanism_gain_m_per_rad: mechanism.gain,
            mechanism_gain_error_m_per_rad: mechanism.gain_error,
            mechanism_phase_deg: mechanism.phase_deg,
            mechanism_coherence: mechanism.coherence,
        }
    };
    Ok(places.iter().map(line).collect())
}

/// Complex amplitudes (real, imaginary) of three signals over one period, at a frequency (Hz).
fn amplitudes(rows: &[(f64, [f64; 3])], frequency_hz: f64) -> [[f64; 2]; 3] {
    let count = rows.len().max(1) as f64;
    [0, 1, 2].map(|k| {
        let mean = rows.iter().map(|(_, values)| values[k]).sum::<f64>() / count;
        let sum = rows.iter().fold([0.0, 0.0], |[re, im], (t_s, values)| {
            let (sin, cos) = (TAU * frequency_hz * t_s).sin_cos();
            let value = values[k] - mean;
            [re + value * cos, im - value * sin]
        });
        sum.map(|part| 2.0 * part / count)
    })
}

/// Gain, phase and coherence from pairs of the input's and the output's amplitude, one pair for each period (Bendat and Piersol,
/// Random Data, 4th ed., section 6.1: H = Sxy/Sxx; variance of the gain by (1 − γ²)/(2 n γ²), section 9.1).
fn transfer(periods: impl Iterator<Item = [[f64; 2]; 2]>) -> Transfer {
    let (mut count, mut sums) = (0.0, [0.0; 4]);
    for [[a, b], [c, d]] in periods {
        count += 1.0;
        // |x|², |y|², and y times the conjugate of x.
        for (sum, part) in sums.iter_mut().zip([a * a + b * b, c * c + d * d, c * a + d * b, d * a - c * b]) {
            *sum += part;
        }
    }
    let [inputs, outputs, re, im] = sums;
    let gain = re.hypot(im) / inputs;
    let coherence = (re * re + im * im) / (inputs * outputs);
    let variance = ((1.0 - coherence) / (2.0 * count * coherence)).max(0.0);
    Transfer {
        gain,
        gain_error: f64::from(NINETY_PERCENT) * gain * variance.sqrt(),
        phase_deg: im.atan2(re).to_degrees(),
        coherence,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn response(from: f64, to: f64) -> Response {
        Response { at: 8e-3, amplitude: 1e-3, from, to, periods: 4, out: PathBuf::new(), figure: None }
    }

    #[test]
    fn the_set_point_repeats_stays_within_its_amplitude_and_has_its_frequencies_alone() {
        for [from, to] in [[0.2, 2.0], [0.05, 5.0], [1.0, 2.0]] {
            let asked = response(from, to);
            let (trajectory, places) = asked.trajectory().expect("a trajectory");
            let period_s = asked.period_s();
            assert!((trajectory.duration_s() - 5.0 * period_s).abs() < 1e-9);
            let (mut most_m, mut rows) = (0.0f64, Vec::new());
            for k in 0..(period_s / EVERY_S).round() as u32 {
                let t_s = EVERY_S * f64::from(k);
                let (now, later) = (trajectory.at(t_s), trajectory.at(t_s + period_s));
                assert!((now.0 - later.0).abs() < 1e-12 && (now.1 - later.1).abs() < 1e-11, "{t_s}");
                most_m = most_m.max((now.0 - 8e-3).abs());
                rows.push((t_s, [now.0, now.1, 0.0]));
            }
            assert!((most_m - 1e-3).abs() < 1e-9, "{most_m}");
            assert!((f64::from(places[0]) / period_s - from).abs() < 1e-9, "{places:?}");
            assert!((f64::from(places[places.len() - 1]) / period_s / to - 1.0).abs() < 0.06, "{places:?}");
            let sizes = |place: u32| {
                let [[re, im], ..] = amplitudes(&rows, f64::from(place) / period_s);
                re.hypot(im)
            };
            let size_m = sizes(places[0]);
            // Equal cosines that hardly add up.
            assert!(
                size_m > 1e-3 / places.len() as f64
                    && places.iter().all(|place| (sizes(*place) / size_m - 1.0).abs() < 1e-6)
            );
            assert!((1..50).filter(|place| !places.contains(place)).all(|place| sizes(place) < 1e-9));
        }
    }

    /// A first-order lag (s) behind each period's own amplitude, with noise that is another one in each period.
    #[test]
    fn gain_phase_and_coherence_are_those_of_what_lies_between() {
        let (lag_s, frequency) = (0.2, 0.8);
        let w = TAU * frequency * lag_s;
        let noise = [[1.0, 0.5], [-0.7, 0.9], [0.4, -1.0], [-0.7, -0.4]];
        let pairs = |size: f64| {
            noise.map(|[re, im]| {
                [[3.0, 4.0], [(3.0 + 4.0 * w) / (1.0 + w * w) + size * re, (4.0 - 3.0 * w) / (1.0 + w * w) + size * im]]
            })
        };
        let exact = transfer(pairs(0.0).into_iter());
        assert!((exact.gain - 1.0 / (1.0 + w * w).sqrt()).abs() < 1e-12 && exact.gain_error < 1e-7);
        assert!((exact.phase_deg + w.atan().to_degrees()).abs() < 1e-9 && (exact.coherence - 1.0).abs() < 1e-12);
        let noisy = transfer(pairs(0.5).into_iter());
        assert!((0.9..0.99).contains(&noisy.coherence), "{noisy:?}");
        assert!((noisy.gain - exact.gain).abs() < noisy.gain_error, "{noisy:?}");
    }

    #[test]
    fn a_recorded_lag_is_found_at_each_frequency() {
        let asked = response(0.2, 2.0);
        let (trajectory, places) = asked.trajectory().expect("a trajectory");
        let row = |k: u32| {
            let t_s = 0.01 * f64::from(k);
            let (target_m, _) = trajectory.at(t_s);
            // Half a tenth of a second late, and 0.3 mm for each radian.
            let (position_m, _) = trajectory.at((t_s - 0.05).max(0.0));
            Row {
                t_s: 3.0 + t_s,
                state: State::Moving,
                target_m: Some(target_m as f32),
                position_m: Some(position_m as f32),
                twist_rad: Some((position_m / 3e-4) as f32),
                ..Row::new(0.0, &crate::fixtures::telemetry(0), None, None)
            }
        };
        let rows: Vec<Row> = (0..(trajectory.duration_s() / 0.01) as u32 + 20).map(row).collect();
        let lines = lines(&rows, asked.period_s(), &places).expect("lines");
        assert!(lines.len() > 12 && bandwidth_hz(&lines).is_none(), "{}", lines.len());
        for line in lines {
            let late_deg = -360.0 * 0.05 * line.frequency_hz;
            assert!((line.loop_gain - 1.0).abs() < 0.02 && (line.loop_phase_deg - late_deg).abs() < 1.0, "{line:?}");
            assert!(
                (line.mechanism_gain_m_per_rad / 3e-4 - 1.0).abs() < 1e-3 && line.loop_coherence > 0.999,
                "{line:?}"
            );
        }
    }

    #[test]
    fn the_bandwidth_is_where_the_gain_falls_for_good() {
        let line = |frequency_hz: f64, loop_gain: f64| Line {
            frequency_hz,
            loop_gain,
            loop_gain_error: 0.0,
            loop_phase_deg: 0.0,
            loop_coherence: 1.0,
            mechanism_gain_m_per_rad: 0.0,
            mechanism_gain_error_m_per_rad: 0.0,
            mechanism_phase_deg: 0.0,
            mechanism_coherence: 1.0,
        };
        let gains = [line(0.5, 0.6), line(1.0, 1.0), line(2.0, 0.8), line(3.0, 0.5)];
        assert_eq!(bandwidth_hz(&gains), Some(3.0));
        assert_eq!(bandwidth_hz(&gains[..3]), None);
        assert_eq!(bandwidth_hz(&gains[..1]), Some(0.5));
    }
}
