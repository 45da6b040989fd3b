//! The paper's Figs 6 to 11 and 13 redrawn: curves from the solver, the published points on them, and how far apart.

use super::comparison::{Comparison, Set, per_cent, relative_error, remark};
use super::numbers::{self, Kind, Ratio, RatioQuantity, Row, TURNS, changed_mechanism};
use crate::curves::{self, Curve, PublishedPoint};
use crate::scene_key;
use crate::trace::{End, Trace, trace};
use anyhow::Result;
use rig_config::Scene;
use rig_plant::units::STANDARD_GRAVITY as STANDARD_GRAVITY_M_PER_S2;
use rigctl::identify::data::Quantity;
use rigctl::plot::{Axis, Block, Figure, GREY, Item, KeyRow, Panel, Pen, RGBColor, Sample, Shape, colour, extent};
use std::f64::consts::TAU;
use tsa_model::{Mechanism, twist_from_turns};

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

impl Comparison {
    /// All figures with their file names.
    pub fn figures(&self) -> Result<Vec<(String, Figure)>> {
        let mut figures = vec![("published.svg".to_owned(), self.overview()), ("fig06.svg".to_owned(), self.loads())];
        for (number, symbol, others) in SWEEPS {
            figures.push((format!("fig{number:02}.svg"), self.sweep(number, symbol, others)));
        }
        figures.push(("fig13.svg".to_owned(), self.experiment()?));
        Ok(figures)
    }

    /// Fig. 6: contraction and TR for loads from 1 N to 17 N.
    fn loads(&self) -> Figure {
        let place = "section 4.2";
        let changes = self.own_geometry(place);
        let members = LOADS.map(|load_n| Member { label: format!("{load_n} N"), load_n, changes: changes.into() });
        let title = titled_with("Fig. 6: loads from 1 N to 17 N", changes);
        let mut figure = self.against_turns(&title, "load", place, &members);
        figure.blocks.insert(2, self.ratio_block(place));
        figure
    }

    /// One of Figs 7 to 11: one parameter varied.
    fn sweep(&self, number: u32, symbol: &str, others: &[f64]) -> Figure {
        let place = format!("Fig. {number}");
        let changes = self.own_geometry(&place);
        let key = scene_key::full_name(symbol);
        let member = |row: &Row| Member { label: varied(row), load_n: row.load_n, changes: row.changes.clone() };
        let mut members: Vec<Member> = self.rows.iter().filter(|r| r.place == place).map(member).collect();
        let load_n = members.first().map_or(0.0, |m| m.load_n);
        members.extend(others.iter().map(|v| Member {
            label: scene_key::shown(key, *v),
            load_n,
            changes: numbers::changed(changes, &format!("{key}={v:?}")),
        }));
        let title = titled_with(&format!("{place}: {symbol} varied, {load_n} N"), changes);
        self.against_turns(&title, symbol, &place, &members)
    }

    /// What differs from Table 1 at a place, where the geometry is inferred.
    fn own_geometry(&self, place: &str) -> &'static str {
        if self.inferred { numbers::inferred(place) } else { "" }
    }

    /// Contraction and TR of some members, the points of this place of the paper on them.
    fn against_turns(&self, title: &str, what: &str, place: &str, members: &[Member]) -> Figure {
        let curve = |set: &Set, (k, member): (usize, &Member)| Curve {
            label: member.label.clone(),
            colour: colour(k, members.len()),
            way: member.way(&set.scene),
        };
        let column = |set: &Set| members.iter().enumerate().map(|m| curve(set, m)).collect();
        let columns: Vec<Vec<Curve>> = self.sets.iter().map(column).collect();
        // Each point in the colour of its curve.
        let marks = self.rows.iter().filter(|row| row.place == place).filter_map(|row| {
            let k = members.iter().position(|m| m.prints(row))?;
            let (group, turns) = (row.group(), row.turns());
            Some(PublishedPoint { group, kind: row.kind, turns, value: row.value, colour: colour(k, members.len()) })
        });
        let marks: Vec<PublishedPoint> = marks.collect();
        let panels = |group| curves::panels(group, &columns, &marks, [0.0, TURNS]);
        let mut blocks: Vec<Block> =
            columns.first().map(|curves| curves::colour_key(what, curves)).into_iter().collect();
        blocks.push(self.numbers_block(place));
        blocks.extend(curves::limit_key(&columns));
        Figure {
            // One set is named in the heading, several above their columns.
            heading: match &self.sets[..] {
                [set] => format!("{title}, scene {}", set.name),
                _ => title.into(),
            },
            rows: curves::grid(vec![
                self.titled('a', "contraction", panels(Quantity::Contraction)),
                self.titled('b', "transmission ratio", panels(Quantity::Tr)),
            ]),
            panel_size: if self.sets.len() > 1 { (430, 370) } else { (590, 430) },
            blocks,
            notes: Vec::new(),
        }
    }

    fn titled(&self, letter: char, what: &str, mut panels: Vec<Panel>) -> Vec<Panel> {
        let many = self.sets.len() > 1;
        for ((panel, set), number) in panels.iter_mut().zip(&self.sets).zip(1..) {
            panel.title =
                if many { format!("({letter}) {number}: {}", set.name) } else { format!("({letter}) {what}") };
        }
        panels
    }

    /// The head of a table with a column for each set, under this name where there is one only.
    fn head(&self, what: &str, alone: &str, several: &str) -> KeyRow {
        let columns = match self.sets.len() {
            1 => vec![alone.to_owned()],
            count => (1..=count).map(|number| format!("{several} {number}")).collect(),
        };
        KeyRow::text([what.to_owned(), "paper".into()].into_iter().chain(columns))
    }

    /// The published numbers of a place with their errors.
    fn numbers_block(&self, place: &str) -> Block {
        let rows = self.rows.iter().enumerate().filter(|(_, row)| row.place == place).map(|(k, row)| {
            let cell = |set: &Set| {
                let mark = if remark(&set.numbers[k]).is_some() { " !" } else { "" };
                format!("{}{mark}", per_cent(relative_error(row.value, &set.numbers[k])))
            };
            let first = [in_words(row), format!("{:.2} {}", row.value, row.unit)];
            let cells = first.into_iter().chain(self.sets.iter().map(cell)).collect();
            KeyRow { sample: Some(Sample::Mark(curves::shape(row.kind), GREY)), cells }
        });
        Block::new([self.head("published", "error", "error")].into_iter().chain(rows))
    }

    /// The ratios that the text quotes at a place, and what is computed in their place.
    fn ratio_block(&self, place: &str) -> Block {
        let rows = self.ratios.iter().enumerate().filter(|(_, ratio)| ratio.place == place).map(|(k, ratio)| {
            let cell = |set: &Set| set.ratios[k].as_ref().map_or_else(|e| e.kind.to_owned(), |v| format!("{v:.3}"));
            let Ratio { quantity, load_n, to_load_n, turns, value, .. } = ratio;
            let quantity = match quantity {
                RatioQuantity::Contraction => "contraction",
                RatioQuantity::Tr => "TR",
                RatioQuantity::AverageSpeed => "average speed",
                RatioQuantity::AverageTr => "average TR",
            };
            let first = [format!("{quantity}, {load_n} to {to_load_n} N, {turns} turns"), value.to_string()];
            KeyRow::text(first.into_iter().chain(self.sets.iter().map(cell)))
        });
        Block::new([self.head("quoted ratio", "computed", "set")].into_iter().chain(rows))
    }

    /// Fig. 13: the experiment's three loads, average speed and average TR.
    fn experiment(&self) -> Result<Figure> {
        let place = "Fig. 13";
        let printed: Vec<&Row> = self.rows.iter().filter(|r| r.place == place).collect();
        let members = printed.iter().map(|r| Member { label: varied(r), load_n: r.load_n, changes: r.changes.clone() });
        let members: Vec<Member> = members.collect();
        let loads = extent(members.iter().map(|m| m.load_n));
        let mut curves = Vec::new();
        for set in &self.sets {
            let mechanism = set.scene.mechanism()?;
            curves.push(AVERAGED.map(|(turns, _)| against_load(&mechanism, loads, turns)));
        }
        let mut key = vec![
            KeyRow::text(["averages at 12.5 rpm"]),
            KeyRow::mark(Shape::Diamond, AVERAGED[1].1, "from the experiment's contraction"),
        ];
        let computed = |(turns, colour)| KeyRow::line(Pen::solid(colour), format!("computed, over {turns} turns"));
        key.extend(AVERAGED.map(computed));
        if curves.iter().flatten().flatten().any(|(_, contraction)| contraction.is_none()) {
            key.push(KeyRow::mark(Shape::Cross, GREY, "limit of the model"));
        }
        let mut figure = self.against_turns("Fig. 13: the experiment's loads", "load", place, &members);
        figure.blocks.insert(1, Block { rows: key });
        figure.blocks.insert(3, self.ratio_block(place));
        // Averages stand in the place of TR.
        let contraction = figure.rows.iter().flatten().take(self.sets.len()).cloned().collect();
        let speed = |contraction_mm: f64, turns: f64| contraction_mm * TURNS_PER_S / turns;
        let tr = |contraction_mm: f64, turns: f64| TAU * turns / contraction_mm;
        figure.rows = curves::grid(vec![
            contraction,
            self.titled('b', "average speed", averages("average speed, mm/s", speed, &curves, &printed)),
            self.titled('c', "average TR", averages("average TR, rad/mm", tr, &curves, &printed)),
        ]);
        if self.sets.len() == 1 {
            figure.panel_size = (430, 400);
        }
        Ok(figure)
    }

    /// The error of every row, a colour for each set.
    fn overview(&self) -> Figure {
        let (rows, sets) = (&self.rows, &self.sets);
        let mut marks = Vec::new();
        for (k, row) in rows.iter().enumerate() {
            for (s, set) in sets.iter().enumerate() {
                let Some(error) = relative_error(row.value, &set.numbers[k]) else { continue };
                let at = (100.0 * error, Axis::row(k, s, sets.len()));
                marks.push(Item::mark(at, curves::shape(row.kind), colour(s, sets.len())));
            }
        }
        let errors = extent(marks.iter().flat_map(Item::points).map(|p| p.0).chain([-5.0, 5.0]));
        let name = |row: &Row| format!("{} ({})", in_words(row), row.place);
        let marked = |(k, row): (usize, &Row)| match () {
            () if sets.iter().any(|set| set.numbers[k].is_err()) => name(row) + " refused",
            () if sets.iter().any(|set| remark(&set.numbers[k]).is_some()) => name(row) + " !",
            () => name(row),
        };
        let zero = Item::line([(0.0, 0.6), (0.0, 0.4 - rows.len() as f64)], Pen::solid(GREY).wide(1));
        let scene = |(s, set): (usize, &Set)| KeyRow::line(Pen::solid(colour(s, sets.len())).wide(6), &set.name);
        let note = |(k, row): (usize, &Row)| {
            let of_set = |set: &Set| Some(format!("! {} with {}: {}", name(row), set.name, remark(&set.numbers[k])?));
            sets.iter().filter_map(of_set).collect::<Vec<_>>()
        };
        let x = Axis::linear("computed less published, % of the published", errors);
        let names = Axis::names(rows.iter().enumerate().map(marked));
        Figure {
            heading: "Every number that the paper prints: error of the computed one".into(),
            rows: vec![vec![Panel::new("", x, names, [zero].into_iter().chain(marks))]],
            panel_size: (900, 130 + (20 + 4 * sets.len() as u32) * rows.len() as u32),
            blocks: vec![
                Block::new(sets.iter().enumerate().map(scene)),
                Block::new([
                    KeyRow::mark(curves::shape(Kind::Theory), GREY, "the paper's theory"),
                    KeyRow::mark(curves::shape(Kind::Experiment), GREY, "the paper's experiment"),
                ]),
            ],
            notes: rows.iter().enumerate().flat_map(note).collect(),
        }
    }
}

/// The parameter that is varied at a number's place, if any.
fn swept(row: &Row) -> Option<&'static str> {
    SWEEPS.iter().find(|(number, ..)| row.place == format!("Fig. {number}")).map(|(_, symbol, _)| *symbol)
}

/// What differs between the numbers of a place: the varied parameter, or the load, which is a mass in the experiments.
fn varied(row: &Row) -> String {
    let value = swept(row).and_then(|symbol| {
        let value = row.changes.rsplit_once('=')?.1.trim().parse().ok()?;
        Some(scene_key::shown(scene_key::full_name(symbol), value))
    });
    value.unwrap_or_else(|| match row.kind {
        Kind::Theory => format!("{} N", row.load_n),
        Kind::Experiment => format!("{:.1} kg", row.load_n / STANDARD_GRAVITY_M_PER_S2),
    })
}

/// A number's quantity, its turns where it has several, and what differs at its place.
fn in_words(row: &Row) -> String {
    let quantity = match row.group() {
        Quantity::Tr => format!("TR at {} turns", row.turns()),
        Quantity::Span => format!("span of the rods at {} turns", row.turns()),
        Quantity::Contraction | Quantity::Gap => "contraction".into(),
    };
    let of = swept(row).map_or(String::new(), |symbol| format!("{symbol} = "));
    format!("{quantity}, {of}{}", varied(row))
}

fn titled_with(title: &str, changes: &str) -> String {
    if changes.is_empty() { title.to_owned() } else { format!("{title}, with {changes} m (inferred)") }
}

/// Contraction (mm) over so many turns against load (N), where the model allows it.
type AgainstLoad = Vec<(f64, Option<f64>)>;

fn against_load(mechanism: &Mechanism, [low, high]: [f64; 2], turns: f64) -> AgainstLoad {
    const STEPS: u32 = 60;
    let loads = (0..=STEPS).map(|k| low + (high - low) * f64::from(k) / f64::from(STEPS));
    let gap_m = |load_n, turns| Some(mechanism.solve(load_n, twist_from_turns(turns)).ok()?.gap_m);
    loads.map(|load_n| (load_n, gap_m(load_n, 0.0).zip(gap_m(load_n, turns)).map(|(a, b)| 1e3 * (a - b)))).collect()
}

/// Panels of a mean over the first turns, of the contraction (mm) over them, against load, one for each set.
fn averages(label: &str, mean: fn(f64, f64) -> f64, curves: &[[AgainstLoad; 2]], printed: &[&Row]) -> Vec<Panel> {
    let measured = printed.iter().map(|r| (r.load_n, mean(r.value, r.turns())));
    let measured: Vec<(f64, f64)> = measured.collect();
    let panel_items = |curves: &[AgainstLoad; 2]| {
        let mut items = Vec::new();
        for (curve, (turns, colour)) in curves.iter().zip(AVERAGED) {
            let at = |(load_n, contraction_mm): &(f64, Option<f64>)| Some((*load_n, mean((*contraction_mm)?, turns)));
            let pieces = curve.chunk_by(|a, b| a.1.is_some() == b.1.is_some());
            items.extend(pieces.map(|piece| Item::line(piece.iter().filter_map(at), Pen::solid(colour))));
            let ends = curve.windows(2).filter(|pair| pair[0].1.is_some() != pair[1].1.is_some());
            items.extend(ends.flatten().filter_map(at).map(|end| Item::mark(end, Shape::Cross, colour)));
        }
        items.extend(measured.iter().map(|at| Item::mark(*at, Shape::Diamond, AVERAGED[1].1)));
        items
    };
    let items: Vec<Vec<Item>> = curves.iter().map(panel_items).collect();
    let heights = items.iter().flatten().flat_map(Item::points).map(|p| p.1);
    let y = Axis::linear(label, extent(heights.chain([0.0])));
    let x = Axis::linear("load, N", extent(measured.iter().map(|p| p.0)));
    items.into_iter().map(|items| Panel::new("", x.clone(), y.clone(), items)).collect()
}
