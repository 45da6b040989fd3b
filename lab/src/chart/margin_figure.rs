//! Stability in time as a picture.

use super::grid::Grid;
use super::margin::{Controller, Hung, MOST};
use super::{Inputs, Made};
use anyhow::Result;
use plotters::style::RGBColor;
use rig_config::Scene;
use rigctl::csv_text::csv_text;
use rigctl::parallel::parallel;
use rigctl::plot::{Axis, Block, Figure, INK, Item, KeyRow, Panel, Pen, Sample, colour};
use tsa_model::twist_from_turns;

/// Loads and twists of a map.
const CELLS: (usize, usize) = (24, 24);
/// The constants of a plant that is not what the table was made for are off by so much, each either way.
const OFF: f64 = 0.1;
/// Fixed ratio (rad/m), gain (1/s) and corner (rad/s) with the least tracking error, as `cargo xtask compare` found them.
const SEARCHED: (f64, f64, f64) = (2757.0, 7.5, 21.8);
/// Longest delay and control period that are drawn (s).
const LONGEST_S: f64 = 1.0;

/// Bands of the gain margin: from below the first it is unstable.
const BANDS: [(f64, &str, RGBColor); 5] = [
    (1.0, "unstable", RGBColor(213, 94, 0)),
    (1.5, "1 to 1.5", RGBColor(253, 219, 150)),
    (2.0, "1.5 to 2", RGBColor(199, 233, 180)),
    (4.0, "2 to 4", RGBColor(65, 182, 196)),
    (f64::INFINITY, "4 and more", RGBColor(37, 52, 148)),
];

fn band(margin: f64) -> usize {
    BANDS.iter().position(|(end, ..)| margin < *end).unwrap_or(BANDS.len() - 1)
}

/// A loop and its name.
struct Loop {
    name: &'static str,
    controller: Controller,
}

/// A load (N), a number of turns, and the rig there.
type State = (f64, f64, Hung);

/// Draws the margins over load and twist, delay, sampling time and constants.
///
/// # Errors
/// If the scene cannot be solved, or the drawing fails.
pub fn make(inputs: &Inputs<'_>) -> Result<Made> {
    let (scene, progress) = (inputs.scene, inputs.progress);
    let envelope = scene.table_demand()?.0;
    let grid = Grid::new(envelope.load_n, CELLS.0, envelope.turns, CELLS.1);
    let mechanism = scene.mechanism()?;
    let hung = |mechanism: &tsa_model::Mechanism| -> Vec<Option<State>> {
        let at =
            |(load, turns): (f64, f64)| Some((load, turns, Hung::at(mechanism, load, twist_from_turns(turns)).ok()?));
        let states = grid.states();
        parallel(progress, states.len(), |k| at(states[k]))
    };
    let nominal = hung(&mechanism);
    let (ratio, gain_per_s, corner_rad_per_s) = SEARCHED;
    let searched = Controller { gain_per_s, corner_rad_per_s, ..Controller::fixed(ratio) };
    let loops = [
        Loop { name: "this firmware: it damps the swing", controller: Controller::damped() },
        Loop { name: "fixed TR, below the resonance", controller: Controller::fixed(ratio) },
        Loop { name: "fixed TR, tuned for least error", controller: searched },
    ];
    let margin = |state: &Option<State>, c: &Controller| state.as_ref().map(|(.., h)| h.gain_margin(c));
    let maps: Vec<Vec<Option<f64>>> =
        loops.iter().map(|l| parallel(progress, nominal.len(), |k| margin(&nominal[k], &l.controller))).collect();

    // Where the firmware's loop, which stands on the table's ratio, meets plants that are not the table's.
    let others = perturbed(scene)?;
    let mut worst: Option<(f64, State, Controller)> = None;
    for other in &others {
        let states = hung(other);
        let found = parallel(progress, states.len(), |k| {
            let ((load, turns, hung), (.., table)) = (states[k]?, nominal[k]?);
            let c = Controller {
                tr_rad_per_m: Some(table.tr_rad_per_m),
                stiffness_n_per_m: Some(table.stiffness_n_per_m),
                ..Controller::damped()
            };
            Some((hung.gain_margin(&c), (load, turns, hung), c))
        });
        let found = found.into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0));
        worst = [worst, found].into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0));
    }
    let weakest = |k: usize| {
        let states =
            nominal.iter().zip(&maps[k]).filter_map(|(state, margin)| Some((*margin.as_ref()?, state.as_ref()?)));
        states.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, state)| *state)
    };
    let mut curves: Vec<(String, Hung, Controller)> =
        loops.iter().enumerate().filter_map(|(k, l)| Some((l.name.to_owned(), weakest(k)?.2, l.controller))).collect();
    if let Some((_, (.., hung), off)) = worst {
        curves.insert(1, (format!("this firmware, constants {:.0} % off", OFF * 100.0), hung, off));
    }

    let mut rows =
        vec![loops.iter().zip(&maps).enumerate().map(|(k, (l, m))| map_panel(l.name, &grid, m, k == 0)).collect()];
    let along = |change: &(dyn Fn(&Controller, f64) -> Controller + Sync), times: &[f64]| -> Vec<Vec<(f64, f64)>> {
        parallel(progress, curves.len(), |k| {
            let (_, hung, c) = &curves[k];
            times.iter().map(|t| (*t, hung.gain_margin(&change(c, *t)))).collect()
        })
    };
    let delays: Vec<f64> = (0..=40).map(|k| 0.4 * f64::from(k) / 40.0).collect();
    let periods: Vec<f64> = (0..=40).map(|k| 0.002 * (LONGEST_S / 0.002).powf(f64::from(k) / 40.0)).collect();
    let by_delay = along(&|c, delay_s| Controller { delay_s, ..*c }, &delays);
    let by_period = along(&|c, period_s| Controller { period_s, ..*c }, &periods);
    rows.push(vec![
        line_panel("further delay", Axis::linear("delay, s", [0.0, 0.4]), &by_delay),
        line_panel("sampling", Axis::log("control period, s", [0.002, LONGEST_S]), &by_period),
        bandwidth_panel(&nominal, &loops),
    ]);
    let key = BANDS.iter().map(|(_, name, fill)| KeyRow::sample(Sample::Fill(*fill), *name)).collect();
    let lines = curves.iter().enumerate().map(|(k, (name, ..))| KeyRow::sample(Sample::Line(pen(k)), name.clone()));
    let findings = findings(&loops, &maps, worst, &curves);
    let figure = Figure {
        heading: "By how much the position loop's gain may grow before it is unstable".into(),
        rows,
        panel_size: (420, 340),
        blocks: vec![Block { rows: key }, Block { rows: lines.collect() }],
        notes: vec![
            "Linear analysis of the loop as it is run every 10 ms (drive's lags and rig's damping as in the emulator, assumed), \
             without friction. The curves show each loop at its weakest state; below the dashed line it is \
             unstable as it stands. With a fixed TR a longer control period first helps, because the smoothing becomes slower with it."
                .into(),
        ],
    };
    Ok(Made {
        name: "margin",
        svg: Some(figure.svg()?),
        csv: csv(&grid, &nominal, &loops, &maps, &curves, &by_delay, &by_period)?,
        findings,
        left_out: Vec::new(),
    })
}

/// Every combination of k2, k3, K and the modulus off by [`OFF`] either way.
fn perturbed(scene: &Scene) -> Result<Vec<tsa_model::Mechanism>> {
    (0..16u32)
        .map(|bits| {
            let factor = |bit: u32| if bits >> bit & 1 == 0 { 1.0 - OFF } else { 1.0 + OFF };
            let mut other = scene.clone();
            other.string.k2 *= factor(0);
            other.string.k3 *= factor(1);
            other.string.stiffness_n_per_m *= factor(2);
            other.material.stress_coefficients_pa.iter_mut().for_each(|a| *a *= factor(3));
            Ok(other.mechanism()?)
        })
        .collect()
}

fn pen(k: usize) -> Pen {
    let pen = Pen::solid(colour(k, 4));
    if k == 1 { Pen { dashed: true, ..pen } } else { pen }
}

fn map_panel(title: &str, grid: &Grid, margins: &[Option<f64>], first: bool) -> Panel {
    let of = |k: usize| margins[k].map(band);
    let fills = grid.strips(|a, b| of(a) == of(b)).into_iter().map(|s| {
        let colour = of(s.cell).map_or(RGBColor(222, 222, 222), |b| BANDS[b].2);
        Item::Fill { from: s.from, to: s.to, colour }
    });
    let ticks = [0.5, 1.0, 2.0, 5.0, 10.0].map(|load| (load, load.to_string()));
    let y = Axis::log_named("load, N", grid.load_range_n, ticks.to_vec());
    Panel {
        title: title.into(),
        x: Axis::linear("turns past the pre-twist", grid.turn_range).tight(grid.turn_range),
        y: if first { y } else { y.unnamed() },
        items: fills.collect(),
    }
}

fn line_panel(title: &str, x: Axis, lines: &[Vec<(f64, f64)>]) -> Panel {
    let range = [0.1, MOST];
    let mut items: Vec<Item> = lines
        .iter()
        .enumerate()
        .map(|(k, line)| {
            let points = line.iter().map(|(t, m)| (*t, m.clamp(range[0], range[1]))).collect();
            Item::Line { points, pen: pen(k) }
        })
        .collect();
    let ends = lines.first().map_or((0.0, 1.0), |l| (l[0].0, l[l.len() - 1].0));
    items.push(Item::Line { points: vec![(ends.0, 1.0), (ends.1, 1.0)], pen: Pen::dashed(INK).wide(1) });
    Panel { title: title.into(), x, y: Axis::log("gain margin", range), items }
}

/// How fast a loop is where: its slowest pole if it damps, else its gain times the ratio it stands on over the true one.
fn bandwidth_panel(states: &[Option<State>], loops: &[Loop]) -> Panel {
    let turns = states.iter().flatten().map(|s| s.1);
    let [least, most] = rigctl::plot::extent(turns);
    let mut items = Vec::new();
    // Colours as those of the curves beside, which have one line more.
    for (l, k) in loops.iter().zip([0, 2, 3]) {
        for (at, pen) in [(least, pen(k)), (most, pen(k).wide(4))] {
            let of_twist = states.iter().flatten().filter(|s| s.1 == at);
            let c = &l.controller;
            let real = |h: &Hung| match c.damps {
                true => -h.growth(c).ln() / c.period_s,
                false => c.gain_per_s * c.tr_rad_per_m.map_or(1.0, |tr| tr / h.tr_rad_per_m),
            };
            items.push(Item::Line { points: of_twist.map(|(load, _, h)| (*load, real(h))).collect(), pen });
        }
    }
    Panel {
        title: "bandwidth; thick: all turns, thin: none".into(),
        x: Axis::log("load, N", rigctl::plot::extent(states.iter().flatten().map(|s| s.0))),
        y: Axis::log("1/s", [0.5, 30.0]),
        items,
    }
}

fn findings(
    loops: &[Loop],
    maps: &[Vec<Option<f64>>],
    worst: Option<(f64, State, Controller)>,
    curves: &[(String, Hung, Controller)],
) -> Vec<String> {
    let mut findings: Vec<String> = loops
        .iter()
        .zip(maps)
        .map(|(l, map)| {
            let [least, most] = rigctl::plot::extent(map.iter().flatten().copied());
            let unstable = map.iter().flatten().filter(|m| **m < 1.0).count();
            format!(
                "{:<32} gain margin {least:.2} to {most:.1}; unstable at {unstable} of {} states",
                l.name,
                map.iter().flatten().count()
            )
        })
        .collect();
    if let Some((margin, (load, turns, _), _)) = worst {
        findings.push(format!(
            "constants {:.0} % off: at least {margin:.2}, at {load:.1} N and {turns:.1} turns",
            OFF * 100.0
        ));
    }
    for (name, hung, c) in curves {
        let delay = hung.delay_margin(c, LONGEST_S);
        let resonance = hung.resonance_rad_per_s();
        findings.push(format!(
            "{name:<32} weakest state: {:.0} ms more delay; the load swings at {resonance:.0} rad/s",
            delay * 1e3
        ));
    }
    findings
}

fn csv(
    grid: &Grid,
    nominal: &[Option<State>],
    loops: &[Loop],
    maps: &[Vec<Option<f64>>],
    curves: &[(String, Hung, Controller)],
    by_delay: &[Vec<(f64, f64)>],
    by_period: &[Vec<(f64, f64)>],
) -> Result<String> {
    let number = |x: f64| format!("{x:.4e}");
    let mut lines = Vec::new();
    for (l, map) in loops.iter().zip(maps) {
        for (((load, turns), state), margin) in grid.states().into_iter().zip(nominal).zip(map) {
            let hung = state.as_ref().map(|(.., h)| h);
            let of = |value: fn(&Hung) -> f64| hung.map_or(String::new(), |h| number(value(h)));
            lines.push(vec![
                l.name.to_owned(),
                "map".into(),
                number(load),
                number(turns),
                of(|h| h.tr_rad_per_m),
                of(|h| h.stiffness_n_per_m),
                String::new(),
                String::new(),
                margin.map_or(String::new(), number),
            ]);
        }
    }
    for (curve, (name, ..)) in curves.iter().enumerate() {
        for (kind, times) in [("delay", &by_delay[curve]), ("period", &by_period[curve])] {
            for (t, margin) in times {
                let mut line = vec![name.clone(), kind.into()];
                line.resize(6, String::new());
                line.extend(if kind == "delay" { [number(*t), String::new()] } else { [String::new(), number(*t)] });
                line.push(number(*margin));
                lines.push(line);
            }
        }
    }
    let header =
        ["loop", "kind", "load_n", "turns", "tr_rad_per_m", "stiffness_n_per_m", "delay_s", "period_s", "gain_margin"];
    csv_text(&header, lines)
}
