//! The paper's Figs 6 to 11 and 13 redrawn: curves from the solver, the published points on them, and how far apart.

use super::comparison::{Set, per_cent, relative_error, remark};
use super::geometry;
use super::numbers::{Group, Kind, Ratio, Row, TURNS, changed_mechanism};
use crate::curves::{self, Column, Curve, PublishedPoint};
use crate::scene_key;
use crate::trace::{End, Trace, trace};
use anyhow::{Context, Result};
use rig_config::Scene;
use rig_plant::units::STANDARD_GRAVITY as STANDARD_GRAVITY_M_PER_S2;
use rigctl::plot::{Axis, Block, Figure, GREY, Item, KeyRow, Panel, Pen, RGBColor, Sample, Shape, colour, extent};
use std::f64::consts::TAU;
use tsa_model::{Mechanism, SolveError, twist_from_turns};

/// Loads of Fig. 6 (N): the text names the first and the last.
const LOADS: [f64; 5] = [1.0, 5.0, 9.0, 13.0, 17.0];
/// Figs 7 to 11: number, parameter, and values that the text compares without printing a number for them.
const SWEEPS: [(u32, &str, &[f64]); 5] =
    [(7, "D0", &[]), (8, "R", &[0.000_55, 0.0006]), (9, "L0", &[]), (10, "r0", &[]), (11, "K", &[100e3])];
/// Speed of the experiment, at the strings (turns per second): 12.5 rpm.
const TURNS_PER_S: f64 = 12.5 / 60.0;
/// Turns over which Fig. 13 averages, and the colours of the two.
const AVERAGED: [(f64, RGBColor); 2] = [(0.5 * TURNS, RGBColor(204, 121, 167)), (TURNS, RGBColor(90, 60, 160))];

/// One curve of each set: a load and what is changed in the scene.
struct Member {
    label: String,
    load_n: f64,
    changes: String,
}

impl Member {
    fn way(&self, scene: &Scene) -> Trace {
        match changed_mechanism(scene, &self.changes) {
            Ok(mechanism) => trace(&mechanism, self.load_n, [0.0, TURNS], curves::STEPS),
            Err(limit) => Trace { ends: vec![End { at: None, limit }], ..Trace::default() },
        }
    }

    fn prints(&self, row: &Row) -> bool {
        row.load_n == self.load_n && row.changes == self.changes
    }
}

/// All figures as file names and SVG.
pub(super) fn draw(rows: &[Row], ratios: &[Ratio], sets: &[Set], inferred: bool) -> Result<Vec<(String, String)>> {
    let mut files = vec![
        ("published.svg".to_owned(), overview(rows, sets).svg()?),
        ("fig06.svg".to_owned(), loads(rows, ratios, sets, inferred).svg()?),
    ];
    for (number, symbol, others) in SWEEPS {
        files.push((format!("fig{number:02}.svg"), sweep(number, symbol, others, rows, sets, inferred)?.svg()?));
    }
    files.push(("fig13.svg".to_owned(), experiment(rows, ratios, sets)?.svg()?));
    Ok(files)
}

/// Fig. 6: contraction and TR for loads from 1 N to 17 N.
fn loads(rows: &[Row], ratios: &[Ratio], sets: &[Set], inferred: bool) -> Figure {
    let place = "section 4.2";
    let changes = own_geometry(place, inferred);
    let members = LOADS.map(|load_n| Member { label: format!("{load_n} N"), load_n, changes: changes.into() });
    let title = titled_with("Fig. 6: loads from 1 N to 17 N", changes);
    let mut figure = against_turns(&title, "load", place, &members, rows, sets);
    figure.blocks.insert(2, ratio_block(place, ratios, sets));
    figure
}

/// One of Figs 7 to 11: one parameter varied.
fn sweep(number: u32, symbol: &str, others: &[f64], rows: &[Row], sets: &[Set], inferred: bool) -> Result<Figure> {
    let place = format!("Fig. {number}");
    let changes = own_geometry(&place, inferred);
    let key = scene_key::full_name(symbol);
    let mut members = Vec::new();
    for row in rows.iter().filter(|r| r.place == place) {
        let value = row.changes.rsplit_once('=').map_or("", |(_, value)| value);
        let number = value.trim().parse().with_context(|| format!("{}: {key} `{value}` is no number", row.id))?;
        let label = scene_key::shown(key, number);
        members.push(Member { label, load_n: row.load_n, changes: row.changes.clone() });
    }
    let load_n = members.first().map_or(0.0, |m| m.load_n);
    let other = |v: &f64| Member {
        label: scene_key::shown(key, *v),
        load_n,
        changes: geometry::with(changes, &format!("{key}={v:?}")),
    };
    members.extend(others.iter().map(other));
    let title = titled_with(&format!("{place}: {symbol} varied, {load_n} N"), changes);
    Ok(against_turns(&title, symbol, &place, &members, rows, sets))
}

/// What differs from Table 1 at a place, where the geometry is inferred.
fn own_geometry(place: &str, inferred: bool) -> &'static str {
    if inferred { geometry::inferred(place) } else { "" }
}

fn titled_with(title: &str, changes: &str) -> String {
    if changes.is_empty() { title.to_owned() } else { format!("{title}, with {changes} m (inferred)") }
}

/// Contraction and TR of some members, the points of this place of the paper on them.
fn against_turns(title: &str, what: &str, place: &str, members: &[Member], rows: &[Row], sets: &[Set]) -> Figure {
    let columns = columns(members, sets);
    let marks = marks(place, members, rows);
    let panels = |group| curves::panels(group, &columns, &marks, [0.0, TURNS]);
    Figure {
        heading: heading(title, sets),
        rows: curves::grid(vec![
            titled('a', "contraction", sets, panels(Group::Contraction)),
            titled('b', "transmission ratio", sets, panels(Group::Tr)),
        ]),
        panel_size: if sets.len() > 1 { (430, 370) } else { (590, 430) },
        blocks: blocks(what, place, &columns, rows, sets),
        notes: Vec::new(),
    }
}

/// Fig. 13: the experiment's three loads, average speed and average TR.
fn experiment(rows: &[Row], ratios: &[Ratio], sets: &[Set]) -> Result<Figure> {
    let place = "Fig. 13";
    let printed: Vec<&Row> = rows.iter().filter(|r| r.place == place).collect();
    let member = |r: &&Row| Member { label: kilograms(r.load_n), load_n: r.load_n, changes: r.changes.clone() };
    let members: Vec<Member> = printed.iter().map(member).collect();
    let loads = extent(members.iter().map(|m| m.load_n));
    let against_load = |set: &Set| -> Result<Vec<AgainstLoad>> {
        let mechanism = set.scene.mechanism()?;
        Ok(AVERAGED.map(|(turns, colour)| AgainstLoad::new(&mechanism, loads, turns, colour)).into())
    };
    let curves = sets.iter().map(against_load).collect::<Result<Vec<_>, _>>()?;
    let mut key = vec![
        KeyRow::text(["averages at 12.5 rpm"]),
        KeyRow::sample(Sample::Mark(Shape::Diamond, AVERAGED[1].1), "from the experiment's contraction"),
    ];
    key.extend(AVERAGED.iter().map(|(turns, colour)| {
        KeyRow::sample(Sample::Line(Pen::solid(*colour)), format!("computed, over {turns} turns"))
    }));
    for (number, curve) in (1..).zip(&curves).flat_map(|(number, curves)| curves.iter().map(move |c| (number, c))) {
        for (at, kind) in &curve.ends {
            let set = if sets.len() > 1 { format!("set {number}, ") } else { String::new() };
            let place = if at.0.is_finite() { format!("at {:.2} N", at.0) } else { "everywhere".into() };
            key.push(KeyRow::sample(Sample::Mark(Shape::Cross, curve.colour), format!("{set}{kind} {place}")));
        }
    }
    let mut figure = against_turns("Fig. 13: the experiment's loads", "load", place, &members, rows, sets);
    figure.blocks.insert(1, Block { rows: key });
    figure.blocks.insert(3, ratio_block(place, ratios, sets));
    // Averages stand in the place of TR.
    let contraction = figure.rows.iter().flatten().take(sets.len()).cloned().collect();
    figure.rows = curves::grid(vec![
        contraction,
        titled('b', "average speed", sets, averages(Average::Speed, &curves, &printed)),
        titled('c', "average TR", sets, averages(Average::Tr, &curves, &printed)),
    ]);
    if sets.len() == 1 {
        figure.panel_size = (430, 400);
    }
    Ok(figure)
}

/// A load as the experiment's mass.
fn kilograms(load_n: f64) -> String {
    format!("{:.1} kg", load_n / STANDARD_GRAVITY_M_PER_S2)
}

/// What is averaged over the first turns at 12.5 rpm.
#[derive(Clone, Copy)]
enum Average {
    Speed,
    Tr,
}

impl Average {
    fn label(self) -> &'static str {
        match self {
            Self::Speed => "average speed, mm/s",
            Self::Tr => "average TR, rad/mm",
        }
    }

    fn of(self, contraction_mm: f64, turns: f64) -> f64 {
        match self {
            Self::Speed => contraction_mm * TURNS_PER_S / turns,
            Self::Tr => TAU * turns / contraction_mm,
        }
    }
}

/// Contraction (mm) against load (N) over so many turns, in pieces where the model allows it, and its limits.
struct AgainstLoad {
    turns: f64,
    colour: RGBColor,
    pieces: Vec<Vec<(f64, f64)>>,
    ends: Vec<((f64, f64), &'static str)>,
}

impl AgainstLoad {
    fn new(mechanism: &Mechanism, [low, high]: [f64; 2], turns: f64, colour: RGBColor) -> Self {
        const STEPS: u32 = 60;
        let contraction_mm = |load_n| -> Result<f64, SolveError> {
            let gap = |turns| mechanism.solve(load_n, twist_from_turns(turns)).map(|e| e.gap_m);
            Ok(1e3 * (gap(0.0)? - gap(turns)?))
        };
        let mut curve = Self { turns, colour, pieces: vec![Vec::new()], ends: Vec::new() };
        let mut refused: Option<&'static str> = None;
        for k in 0..=STEPS {
            let load_n = low + (high - low) * f64::from(k) / f64::from(STEPS);
            let last = curve.pieces.last().and_then(|piece| piece.last()).copied();
            match contraction_mm(load_n) {
                Ok(value) => {
                    let point = (load_n, value);
                    curve.ends.extend(refused.take().map(|kind| (point, kind)));
                    if let Some(piece) = curve.pieces.last_mut() {
                        piece.push(point);
                    }
                }
                Err(error) => {
                    curve.ends.extend(last.map(|point| (point, error.kind())));
                    if last.is_some() {
                        curve.pieces.push(Vec::new());
                    }
                    refused = Some(error.kind());
                }
            }
        }
        // Refused from the first load to the last: a limit with no place to mark.
        if curve.pieces.iter().all(Vec::is_empty) {
            curve.ends.extend(refused.map(|kind| ((f64::NAN, f64::NAN), kind)));
        }
        curve
    }

    fn marks(&self) -> impl Iterator<Item = (f64, f64)> {
        self.ends.iter().map(|(at, _)| *at).filter(|at| at.0.is_finite())
    }
}

/// Panels of a mean over the first turns against load, one for each set.
fn averages(average: Average, curves: &[Vec<AgainstLoad>], printed: &[&Row]) -> Vec<Panel> {
    let mean = |turns: f64| move |at: (f64, f64)| (at.0, average.of(at.1, turns));
    let measured: Vec<(f64, f64)> =
        printed.iter().map(|r| (r.load_n, average.of(r.value, r.quantity.turns()))).collect();
    let panel_items = |curves: &Vec<AgainstLoad>| {
        let mut items = Vec::new();
        for c in curves {
            for piece in &c.pieces {
                let points = piece.iter().copied().map(mean(c.turns)).collect();
                items.push(Item::Line { points, pen: Pen::solid(c.colour) });
            }
            let ends = c.marks().map(mean(c.turns));
            items.extend(ends.map(|at| Item::Mark { at, shape: Shape::Cross, colour: c.colour }));
        }
        let marks = measured.iter().map(|at| Item::Mark { at: *at, shape: Shape::Diamond, colour: AVERAGED[1].1 });
        items.extend(marks);
        items
    };
    let items: Vec<Vec<Item>> = curves.iter().map(panel_items).collect();
    let heights = items.iter().flatten().flat_map(Item::points).map(|p| p.1);
    let y = Axis::linear(average.label(), extent(heights.chain([0.0])));
    let x = Axis::linear("load, N", extent(measured.iter().map(|p| p.0)));
    items.into_iter().map(|items| Panel { title: String::new(), x: x.clone(), y: y.clone(), items }).collect()
}

/// Every row as the ratio of computed to published, a colour for each set.
fn overview(rows: &[Row], sets: &[Set]) -> Figure {
    let ratio = |row: &Row, k: usize, set: &Set| Some(1.0 + relative_error(row.value, &set.numbers[k])?);
    let marks: Vec<Item> = rows
        .iter()
        .enumerate()
        .flat_map(|(k, row)| {
            let of_set = move |(s, set): (usize, &Set)| {
                // One above the other, where they would hide each other.
                let aside = 0.22 * (s as f64 - 0.5 * (sets.len() - 1) as f64);
                let at = (ratio(row, k, set)?, -(k as f64) - aside);
                Some(Item::Mark { at, shape: curves::shape(row.kind), colour: colour(s, sets.len()) })
            };
            sets.iter().enumerate().filter_map(of_set)
        })
        .collect();
    let across = marks.iter().flat_map(Item::points).map(|p| p.0);
    let [low, high] = extent(across.chain([0.85, 1.15]));
    let limits = [low / 1.06, high * 1.06];
    let steps: &[f64] = if high / low > 2.5 {
        &[-0.9, -0.75, -0.5, -0.25, 0.0, 0.5, 1.0, 2.0, 4.0, 9.0]
    } else {
        &[-0.5, -0.4, -0.3, -0.2, -0.1, -0.05, 0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.75]
    };
    let ticks = steps.iter().map(|e| (1.0 + e, format!("{:+.0} %", 100.0 * e).replace("+0", "0").replace('-', "−")));
    let refused = |k: usize| sets.iter().any(|set| set.numbers[k].is_err());
    let remarked = |k: usize| sets.iter().any(|set| remark(&set.numbers[k]).is_some());
    let name = |(k, row): (usize, &Row)| match () {
        () if refused(k) => format!("{} (refused)", row.id),
        () if remarked(k) => format!("{} !", row.id),
        () => row.id.clone(),
    };
    let zero = Item::Line {
        points: vec![(1.0, 0.6), (1.0, 0.4 - rows.len() as f64)],
        pen: Pen { width: 1, ..Pen::solid(GREY) },
    };
    let mut key: Vec<KeyRow> = sets
        .iter()
        .enumerate()
        .map(|(s, set)| KeyRow::sample(Sample::Line(Pen { width: 6, ..Pen::solid(colour(s, sets.len())) }), &set.name))
        .collect();
    key.insert(0, KeyRow::text(["scene"]));
    let kinds = [(Kind::Theory, "the paper's theory"), (Kind::Experiment, "the paper's experiment")];
    let kinds = kinds.map(|(kind, word)| KeyRow::sample(Sample::Mark(curves::shape(kind), GREY), word));
    let mut notes = Vec::new();
    for (k, row) in rows.iter().enumerate() {
        for set in sets {
            if let Some(remark) = remark(&set.numbers[k]) {
                notes.push(format!("! {} with {}: {remark}", row.id, set.name));
            }
        }
    }
    Figure {
        heading: "Every number that the paper prints: relative error of the computed one".into(),
        rows: vec![vec![Panel {
            title: String::new(),
            x: Axis::log_named("computed against published", limits, ticks.collect()),
            y: Axis::names(rows.iter().enumerate().map(name)),
            items: std::iter::once(zero).chain(marks).collect(),
        }]],
        panel_size: (1000, 130 + (20 + 4 * sets.len() as u32) * rows.len() as u32),
        blocks: vec![Block { rows: key }, Block { rows: kinds.into() }],
        notes,
    }
}

/// A column of curves for each set.
fn columns(members: &[Member], sets: &[Set]) -> Vec<Column> {
    let curve = |set: &Set, (k, member): (usize, &Member)| Curve {
        label: member.label.clone(),
        colour: colour(k, members.len()),
        way: member.way(&set.scene),
    };
    sets.iter().map(|set| Column { curves: members.iter().enumerate().map(|m| curve(set, m)).collect() }).collect()
}

/// The published points of a figure, each in the colour of its curve.
fn marks(place: &str, members: &[Member], rows: &[Row]) -> Vec<PublishedPoint> {
    let point = |row: &Row| {
        let k = members.iter().position(|m| m.prints(row))?;
        Some(PublishedPoint {
            group: row.quantity.group(),
            kind: row.kind,
            turns: row.quantity.turns(),
            value: row.value,
            colour: colour(k, members.len()),
        })
    };
    rows.iter().filter(|r| r.place == place).filter_map(point).collect()
}

/// One set is named in the heading, several above their columns.
fn heading(what: &str, sets: &[Set]) -> String {
    match sets {
        [set] => format!("{what}, scene {}", set.name),
        _ => what.into(),
    }
}

fn titled(letter: char, what: &str, sets: &[Set], mut panels: Vec<Panel>) -> Vec<Panel> {
    let many = sets.len() > 1;
    for ((panel, set), number) in panels.iter_mut().zip(sets).zip(1..) {
        panel.title = if many { format!("({letter}) {number}: {}", set.name) } else { format!("({letter}) {what}") };
    }
    panels
}

/// Key of the colours, published numbers with their errors, and the limits that were met.
fn blocks(what: &str, place: &str, columns: &[Column], rows: &[Row], sets: &[Set]) -> Vec<Block> {
    let mut blocks = Vec::new();
    if let Some(column) = columns.first() {
        blocks.push(curves::colour_key(what, &column.curves));
    }
    let mut table = vec![table_heading("published", sets)];
    for (k, row) in rows.iter().enumerate().filter(|(_, row)| row.place == place) {
        let mut cells = vec![row.id.clone(), format!("{:.2} {}", row.value, row.unit.name())];
        cells.extend(sets.iter().map(|set| {
            let outcome = &set.numbers[k];
            let mark = if remark(outcome).is_some() { " !" } else { "" };
            format!("{}{mark}", per_cent(relative_error(row.value, outcome)))
        }));
        let sample = Some(Sample::Mark(curves::shape(row.kind), GREY));
        table.push(KeyRow { sample, cells });
    }
    blocks.push(Block { rows: table });
    blocks.extend(curves::limit_key(columns));
    blocks
}

fn table_heading(what: &str, sets: &[Set]) -> KeyRow {
    let mut cells = vec![what.to_owned(), "paper".into()];
    if sets.len() > 1 {
        cells.extend((1..=sets.len()).map(|number| format!("error {number}")));
    } else {
        cells.push("error".into());
    }
    KeyRow::text(cells)
}

/// The ratios that the text quotes, and what is computed in their place.
fn ratio_block(place: &str, ratios: &[Ratio], sets: &[Set]) -> Block {
    let mut heading = table_heading("quoted ratio", sets);
    for (number, cell) in (1..).zip(heading.cells.iter_mut().skip(2)) {
        *cell = if sets.len() > 1 { format!("set {number}") } else { "computed".into() };
    }
    let mut rows = vec![heading];
    for (k, ratio) in ratios.iter().enumerate().filter(|(_, ratio)| ratio.place == place) {
        let mut cells = vec![ratio.id.clone(), ratio.value.to_string()];
        cells.extend(
            sets.iter().map(|set| set.ratios[k].as_ref().map_or_else(|e| e.kind.clone(), |v| format!("{v:.3}"))),
        );
        rows.push(KeyRow::text(cells));
    }
    Block { rows }
}
