//! Panels of contraction and TR against turns, with published points on them and the limits that end them.

use crate::published::numbers::Kind;
use crate::trace::{Point, Trace};
use rigctl::identify::data::Quantity;
use rigctl::plot::{Axis, Block, GREY, Item, KeyRow, Panel, Pen, RGBColor, Shape, extent};

/// Steps of a drawn curve.
pub(crate) const STEPS: u32 = 150;

/// One curve.
pub(crate) struct Curve {
    pub label: String,
    pub colour: RGBColor,
    pub way: Trace,
}

/// A published point.
pub(crate) struct PublishedPoint {
    pub group: Quantity,
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

/// Where a point stands, in the units of the axes; none where it cannot be drawn.
fn place(group: Quantity, point: &Point) -> Option<(f64, f64)> {
    let value = match group {
        Quantity::Tr => point.tr_rad_per_m * 1e-3,
        _ => point.contraction_m * 1e3,
    };
    (value.is_finite() && (group != Quantity::Tr || value > 0.0)).then_some((point.turns, value))
}

/// A panel of this quantity for each column of curves, all on the same axes.
pub(crate) fn panels(
    group: Quantity,
    columns: &[Vec<Curve>],
    published: &[PublishedPoint],
    turns: [f64; 2],
) -> Vec<Panel> {
    let line = |points: &[Point], pen: Pen| Item::line(points.iter().filter_map(|p| place(group, p)), pen);
    let published = || published.iter().filter(|p| p.group == group);
    let points = columns.iter().flatten().flat_map(|c| c.way.reached.iter().chain(&c.way.formal));
    let drawn = points.filter_map(|p| place(group, p)).map(|(_, value)| value);
    let limits = extent(drawn.chain(published().map(|p| p.value)));
    let y = match group {
        Quantity::Tr => Axis::log("TR, rad/mm", limits),
        _ => Axis::linear("contraction, mm", limits),
    };
    let panel = |curves: &Vec<Curve>| {
        let lines = curves
            .iter()
            .flat_map(|c| [line(&c.way.formal, Pen::dashed(c.colour)), line(&c.way.reached, Pen::solid(c.colour))]);
        let ends = curves.iter().flat_map(|c| c.way.ends.iter().map(move |end| (c.colour, end)));
        let ends = ends.filter_map(|(colour, end)| Some(Item::mark(place(group, &end.at?)?, Shape::Cross, colour)));
        let marks = published().map(|p| Item::mark((p.turns, p.value), shape(p.kind), p.colour));
        let x = Axis::linear("turns of the strings past the pre-twist", turns);
        Panel::new("", x, y.clone(), lines.chain(ends).chain(marks))
    };
    columns.iter().map(panel).collect()
}

/// Rows of panels: a row for each quantity, but one row for all if there is one column only.
pub(crate) fn grid(quantities: Vec<Vec<Panel>>) -> Vec<Vec<Panel>> {
    if quantities.iter().all(|row| row.len() == 1) { vec![quantities.concat()] } else { quantities }
}

/// What the colours mean: the same in each column.
pub(crate) fn colour_key(heading: &str, curves: &[Curve]) -> Block {
    /// More lines than this tell a reader no more.
    const MAX: usize = 8;
    let step = curves.len().saturating_sub(1).div_ceil(MAX - 1).max(1);
    let last = curves.len().saturating_sub(1);
    // The last line always, and none that crowds it.
    let named = curves.iter().enumerate().filter(|(k, _)| *k == last || (k % step == 0 && last - k >= step));
    let lines = named.map(|(_, curve)| KeyRow::line(Pen::solid(curve.colour), &curve.label));
    Block::new([KeyRow::text([heading])].into_iter().chain(lines))
}

/// What the marks mean, and each limit that ends a curve.
pub(crate) fn limit_key(columns: &[Vec<Curve>]) -> Option<Block> {
    /// More are counted, not named.
    const MAX: usize = 10;
    let mut limits = Vec::new();
    for (number, curves) in (1..).zip(columns) {
        let set = if columns.len() > 1 { format!("set {number}, ") } else { String::new() };
        for (curve, end) in curves.iter().flat_map(|c| c.way.ends.iter().map(move |end| (c, end))) {
            let place = end.at.map_or("from the start".into(), |p| format!("after {:.2} turns", p.turns));
            let label = format!("{set}{}: {} {place}", curve.label, end.limit.kind);
            limits.push(KeyRow::mark(Shape::Cross, curve.colour, label));
        }
    }
    if limits.is_empty() {
        return None;
    }
    let more = limits.len().saturating_sub(MAX);
    limits.truncate(MAX);
    limits.extend((more > 0).then(|| KeyRow::text([format!("and {more} more")])));
    let formal = columns.iter().flatten().any(|c| !c.way.formal.is_empty());
    let formal = formal.then(|| KeyRow::line(Pen::dashed(GREY), "past overtwist: a root that no strings reach"));
    Some(Block::new([KeyRow::text(["limits of the model"])].into_iter().chain(limits).chain(formal)))
}
