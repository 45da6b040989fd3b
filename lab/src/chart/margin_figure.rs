//! Stability in time as a picture.

use super::grid::Grid;
use super::margin::{LinearLoop, MAX, OFF, OperatingPoint, with_constants_off};
use super::{Inputs, Made};
use anyhow::{Context, Result};
use rigctl::csv_text::below;
use rigctl::parallel::{Progress, parallel};
use rigctl::plot::{Axis, Block, Figure, INK, Item, KeyRow, Panel, Pen, RGBColor, colour, extent};
use tsa_model::{Mechanism, twist_from_turns};

/// Loads and twists of a map.
const CELLS: (usize, usize) = (24, 24);
/// Fixed ratio (rad/m), gain (1/s) and corner (rad/s) with the least tracking error, as `cargo xtask compare` found them.
const SEARCHED: (f64, f64, f64) = (2757.0, 7.5, 21.8);
/// Longest delay and control period that are drawn (s).
const LONGEST_S: f64 = 1.0;
/// Range of the gain margins that are drawn.
const DRAWN: [f64; 2] = [0.1, MAX];

/// Bands of the gain margin: from below the first it is unstable.
const BANDS: [(f64, &str, RGBColor); 5] = [
    (1.0, "unstable", RGBColor(213, 94, 0)),
    (1.5, "1 to 1.5", RGBColor(253, 219, 150)),
    (2.0, "1.5 to 2", RGBColor(199, 233, 180)),
    (4.0, "2 to 4", RGBColor(65, 182, 196)),
    (f64::INFINITY, "4 and more", RGBColor(37, 52, 148)),
];
const NO_EQUILIBRIUM: RGBColor = RGBColor(222, 222, 222);

/// A load (N), a number of turns, and the rig there.
type State = (f64, f64, OperatingPoint);
/// A loop, where it is weakest, and its gain margin there.
type Weakest = (f64, State, LinearLoop);

/// The rig at each state of a grid.
fn hung(mechanism: &Mechanism, grid: &Grid, progress: &Progress<'_>) -> Vec<Option<State>> {
    let states = grid.states();
    parallel(progress, states.len(), |k| {
        let (load, turns) = states[k];
        Some((load, turns, OperatingPoint::at(mechanism, load, twist_from_turns(turns)).ok()?))
    })
}

/// Draws the margins over load and twist, delay, sampling time and constants.
///
/// # Errors
/// If the scene cannot be solved, or the drawing fails.
pub fn make(inputs: &Inputs<'_>) -> Result<Made> {
    let (scene, progress) = (inputs.scene, inputs.progress);
    let envelope = scene.table_requirement()?.0;
    let grid = Grid::new(envelope.load_n, CELLS.0, envelope.turns, CELLS.1);
    let nominal = hung(&scene.mechanism()?, &grid, progress);
    let (ratio, gain_per_s, corner_rad_per_s) = SEARCHED;
    let searched = LinearLoop { gain_per_s, corner_rad_per_s, ..LinearLoop::fixed(ratio) };
    let number = |x: f64| Some(format!("{x:.4e}"));
    let (mut loops, mut maps, mut rows, mut findings) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (name, controller) in [
        ("this firmware: damped", LinearLoop::damped()),
        ("fixed TR, below the resonance", LinearLoop::fixed(ratio)),
        ("fixed TR, tuned for least error", searched),
    ] {
        let margins = parallel(progress, nominal.len(), |k| Some(nominal[k]?.2.gain_margin(&controller)));
        let states =
            nominal.iter().zip(&margins).filter_map(|(state, margin)| Some(((*margin)?, (*state)?, controller)));
        let weakest = min(states).context("no state has an equilibrium")?;
        maps.push(grid.panel(name, |k| margins[k].map_or(NO_EQUILIBRIUM, band)));
        rows.extend(grid.states().iter().zip(&margins).map(|((load_n, turns), margin)| {
            (name.to_owned(), "map", [number(*load_n), number(*turns), None, None, margin.and_then(number)])
        }));
        let solved = || margins.iter().flatten().copied();
        let [min, max] = extent(solved());
        let (unstable, count) = (solved().filter(|m| *m < 1.0).count(), solved().count());
        findings.push(format!("{name:<32} gain margin {min:.2} to {max:.1}; unstable at {unstable} of {count} states"));
        loops.push((name.to_owned(), weakest));
    }
    let off = weakest_off(&with_constants_off(scene)?, &grid, &nominal, progress)?;
    let name = format!("this firmware, constants {:.0} % off", OFF * 100.0);
    findings.push(format!("{name}: at least {:.2}, at {:.1} N and {:.1} turns", off.0, off.1.0, off.1.1));
    loops.insert(1, (name, off));
    findings.extend(loops.iter().map(|(name, (_, (.., hung), controller))| {
        let delay_ms = 1e3 * hung.delay_margin(controller, LONGEST_S);
        let resonance = hung.resonance_rad_per_s();
        let peak = hung.peak_sensitivity(controller);
        format!("{name:<32} weakest state: {delay_ms:.0} ms more delay; peak sensitivity {peak:.2}; resonance {resonance:.0} rad/s")
    }));

    let along = |change: fn(&LinearLoop, f64) -> LinearLoop, time: fn(f64) -> f64| {
        parallel(progress, loops.len(), |k| {
            let (_, (.., hung), controller) = &loops[k].1;
            let at = |t: f64| (t, hung.gain_margin(&change(controller, t)));
            (0..=40).map(|step| at(time(f64::from(step)))).collect::<Vec<_>>()
        })
    };
    let by_delay = along(|c, delay_s| LinearLoop { delay_s, ..*c }, |step| 0.4 * step / 40.0);
    let by_period =
        along(|c, period_s| LinearLoop { period_s, ..*c }, |step| 0.002 * (LONGEST_S / 0.002).powf(step / 40.0));
    for (k, (name, _)) in loops.iter().enumerate() {
        for (kind, line) in [("delay", &by_delay[k]), ("period", &by_period[k])] {
            rows.extend(line.iter().map(|(t, margin)| {
                let [delay_s, period_s] = if kind == "delay" { [number(*t), None] } else { [None, number(*t)] };
                (name.clone(), kind, [None, None, delay_s, period_s, number(*margin)])
            }));
        }
    }
    let figure = Figure {
        heading: "By how much the position loop's gain may grow before it is unstable".into(),
        rows: vec![
            Panel::side_by_side(maps),
            Panel::side_by_side([
                line_panel("further delay", Axis::linear("delay, s", [0.0, 0.4]), &by_delay),
                line_panel("sampling", Axis::log("control period, s", [0.002, LONGEST_S]), &by_period),
            ]),
        ],
        panel_size: (420, 340),
        blocks: vec![
            Block::new(BANDS.map(|(_, name, colour)| KeyRow::fill(colour, name))),
            Block::new(loops.iter().enumerate().map(|(k, (name, _))| KeyRow::line(pen(k), name))),
        ],
        notes: vec![
            "Linear analysis of the loop as it is run every 10 ms (lags of the drive and damping of the rail as in the emulator, assumed), \
             without friction. The curves show each loop at its weakest state; below the dashed line it is \
             unstable as it stands. With a fixed TR a longer control period first helps, because the smoothing becomes slower with it."
                .into(),
        ],
    };
    let header = "loop,kind,load_n,turns,delay_s,period_s,gain_margin";
    Made::new(&figure, below(header, rows)?, findings)
}

/// Where the firmware's loop, which stands on the table's ratio, is weakest on mechanisms that are not the table's.
fn weakest_off(
    mechanisms: &[Mechanism],
    grid: &Grid,
    nominal: &[Option<State>],
    progress: &Progress<'_>,
) -> Result<Weakest> {
    let mut worst: Option<Weakest> = None;
    for mechanism in mechanisms {
        let states = hung(mechanism, grid, progress);
        let found = parallel(progress, states.len(), |k| {
            let (state, (.., table)) = (states[k]?, nominal[k]?);
            let c = LinearLoop::damped_for(&table);
            Some((state.2.gain_margin(&c), state, c))
        });
        worst = min(worst.into_iter().chain(found.into_iter().flatten()));
    }
    worst.context("no state has an equilibrium")
}

fn min(margins: impl Iterator<Item = Weakest>) -> Option<Weakest> {
    margins.min_by(|a, b| a.0.total_cmp(&b.0))
}

fn band(margin: f64) -> RGBColor {
    BANDS.iter().find(|(end, ..)| margin < *end).unwrap_or(&BANDS[BANDS.len() - 1]).2
}

fn pen(k: usize) -> Pen {
    Pen { dashed: k == 1, ..Pen::solid(colour(k, 4)) }
}

fn line_panel(title: &str, x: Axis, lines: &[Vec<(f64, f64)>]) -> Panel {
    let line = |(k, line): (usize, &Vec<(f64, f64)>)| {
        Item::line(line.iter().map(|(t, m)| (*t, m.clamp(DRAWN[0], DRAWN[1]))), pen(k))
    };
    let [min, max] = extent(lines[0].iter().map(|(t, _)| *t));
    let unstable = Item::line([(min, 1.0), (max, 1.0)], Pen::dashed(INK).wide(1));
    let items = lines.iter().enumerate().map(line).chain([unstable]);
    Panel::new(title, x, Axis::log("gain margin", DRAWN), items)
}
