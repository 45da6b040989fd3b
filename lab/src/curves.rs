//! Panels of contraction and TR against turns, with published points on them and the limits that end them.

use crate::published::numbers::{Group, Kind};
use crate::trace::{Point, Trace};
use rigctl::plot::{Axis, Block, GREY, Item, KeyRow, Panel, Pen, RGBColor, Sample, Shape, extent};

/// Steps of a drawn curve.
pub(crate) const STEPS: u32 = 150;

const TURNS_AXIS: &str = "motor turns past the half-turn pre-twist";
const CONTRACTION_AXIS: &str = "contraction, mm";
const TR_AXIS: &str = "TR, rad/mm";

/// The curves of one parameter set.
pub(crate) struct Column {
    /// One curve for each value.
    pub curves: Vec<Curve>,
}

/// One curve.
pub(crate) struct Curve {
    pub label: String,
    pub colour: RGBColor,
    pub way: Trace,
}

/// A published point.
pub(crate) struct PublishedPoint {
    pub group: Group,
    pub kind: Kind,
    pub turns: f64,
    /// In mm or rad/mm.
    pub value: f64,
    pub colour: RGBColor,
}

/// Open circles are the authors' solver, diamonds their rig.
pub(crate) fn shape(kind: Kind) -> Shape {
    match kind {
        Kind::Theory => Shape::Circle,
        Kind::Experiment => Shape::Diamond,
    }
}

/// A coordinate of a point, in the unit of its axis.
fn value(group: Group, point: &Point) -> f64 {
    match group {
        Group::Tr => point.tr_rad_per_m * 1e-3,
        Group::Contraction | Group::Span => point.contraction_m * 1e3,
    }
}

/// A panel of this quantity for each column, all on the same axes.
pub(crate) fn panels(group: Group, columns: &[Column], published: &[PublishedPoint], turns: [f64; 2]) -> Vec<Panel> {
    let drawn = |p: &Point| value(group, p).is_finite() && (group != Group::Tr || p.tr_rad_per_m > 0.0);
    let line = |points: &[Point], pen: Pen| Item::Line {
        points: points.iter().filter(|p| drawn(p)).map(|p| (p.turns, value(group, p))).collect(),
        pen,
    };
    let published = || published.iter().filter(|p| p.group == group);
    let points = columns.iter().flat_map(|c| &c.curves).flat_map(|c| c.way.reached.iter().chain(&c.way.formal));
    let limits = extent(points.filter(|p| drawn(p)).map(|p| value(group, p)).chain(published().map(|p| p.value)));
    let y = match group {
        Group::Tr => Axis::log(TR_AXIS, limits),
        Group::Contraction | Group::Span => Axis::linear(CONTRACTION_AXIS, limits),
    };
    let panel = |column: &Column| {
        let curves = || column.curves.iter();
        let lines = curves()
            .flat_map(|c| [line(&c.way.formal, Pen::dashed(c.colour)), line(&c.way.reached, Pen::solid(c.colour))]);
        let ends = curves().flat_map(|c| c.way.ends.iter().filter_map(|e| e.at).map(|p| (p, c.colour)));
        let ends = ends.filter(|(p, _)| drawn(p)).map(|(p, colour)| Item::Mark {
            at: (p.turns, value(group, &p)),
            shape: Shape::Cross,
            colour,
        });
        let marks = published().map(|p| Item::Mark { at: (p.turns, p.value), shape: shape(p.kind), colour: p.colour });
        Panel {
            title: String::new(),
            x: Axis::linear(TURNS_AXIS, turns),
            y: y.clone(),
            items: lines.chain(ends).chain(marks).collect(),
        }
    };
    columns.iter().map(panel).collect()
}

/// Rows of panels: a row for each quantity, but one row for all if there is one column only.
pub(crate) fn grid(quantities: Vec<Vec<Panel>>) -> Vec<Vec<Panel>> {
    if quantities.iter().all(|row| row.len() == 1) {
        vec![quantities.into_iter().flatten().collect()]
    } else {
        quantities
    }
}

/// What the colours mean: the same in each column.
pub(crate) fn colour_key(heading: &str, curves: &[Curve]) -> Block {
    /// More lines than this tell a reader no more.
    const MOST: usize = 8;
    let mut rows = vec![KeyRow::text([heading])];
    let step = curves.len().saturating_sub(1).div_ceil(MOST - 1).max(1);
    let last = curves.len().saturating_sub(1);
    for (k, curve) in curves.iter().enumerate() {
        // The last line always, and none that crowds it.
        if k == last || (k % step == 0 && last - k >= step) {
            rows.push(KeyRow::sample(Sample::Line(Pen::solid(curve.colour)), &curve.label));
        }
    }
    Block { rows }
}

/// What the marks mean, and each limit that ends a curve.
pub(crate) fn limit_key(columns: &[Column]) -> Vec<Block> {
    /// More are counted, not named.
    const MOST: usize = 10;
    let many = columns.len() > 1;
    let mut rows = Vec::new();
    for (number, column) in (1..).zip(columns) {
        for curve in &column.curves {
            for end in &curve.way.ends {
                let set = if many { format!("set {number}, ") } else { String::new() };
                let place = end.at.map_or("from the start".into(), |p| format!("after {:.2} turns", p.turns));
                let label = format!("{set}{}: {} {place}", curve.label, end.limit.kind);
                rows.push(KeyRow::sample(Sample::Mark(Shape::Cross, curve.colour), label));
            }
        }
    }
    if rows.is_empty() {
        return Vec::new();
    }
    let more = rows.len().saturating_sub(MOST);
    rows.truncate(MOST);
    if more > 0 {
        rows.push(KeyRow::text([format!("and {more} more")]));
    }
    rows.insert(0, KeyRow::text(["limits of the model"]));
    if columns.iter().flat_map(|c| &c.curves).any(|c| !c.way.formal.is_empty()) {
        let label = "past overtwist: a root that no strings reach";
        rows.push(KeyRow::sample(Sample::Line(Pen::dashed(GREY)), label));
    }
    vec![Block { rows }]
}
