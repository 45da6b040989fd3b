//! Pictures: a grid of panels over one key, as SVG.
//!
//! A [`Figure`] is described, then drawn by [`Figure::svg`]; what is drawn twice looks the same everywhere.

use crate::failure::Failure;
use anyhow::anyhow;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Okabe–Ito without yellow, which is too faint on white: told apart by colour-blind readers and in grey.
const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(230, 159, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(213, 94, 0),
    RGBColor(86, 180, 233),
];
/// Colour of what stands for no curve of its own.
pub const INK: RGBColor = BLACK;
const FONT: &str = "sans-serif";
/// Units of the drawing in a pixel of the picture: the library draws on whole units, which alone would be steps in
/// every flat curve. All lengths below are in units.
const PX: i32 = 8;
/// Height of the letters in axes and keys.
const TEXT: i32 = 18 * PX;
/// From one line of text to the next.
const LINE: i32 = 26 * PX;
const MARGIN: i32 = 14 * PX;
/// Length of a line's sample in the key.
const SAMPLE: i32 = 30 * PX;
/// Between columns of a key.
const GAP: i32 = 16 * PX;

/// Colour of the `k`th of `count` things: told apart while there are few, a ramp where there are many.
pub fn colour(k: usize, count: usize) -> RGBColor {
    if count <= COLOURS.len() {
        return COLOURS[k % COLOURS.len()];
    }
    let (from, to) = (COLOURS[0], COLOURS[1]);
    let part = k as f64 / (count - 1) as f64;
    let mix = |a: u8, b: u8| (f64::from(a) + part * (f64::from(b) - f64::from(a))).round() as u8;
    RGBColor(mix(from.0, to.0), mix(from.1, to.1), mix(from.2, to.2))
}

/// A picture.
#[derive(Debug, Clone)]
pub struct Figure {
    /// Its title.
    pub heading: String,
    /// Rows of panels.
    pub rows: Vec<Vec<Panel>>,
    /// Width and height of one panel (px).
    pub panel_size: (u32, u32),
    /// Keys and tables below the panels, side by side as far as there is room.
    pub blocks: Vec<Block>,
    /// Text below all, broken into lines where need be.
    pub notes: Vec<String>,
}

/// Two axes and what is drawn in them.
#[derive(Debug, Clone)]
pub struct Panel {
    /// Its title.
    pub title: String,
    /// Across.
    pub x: Axis,
    /// Up.
    pub y: Axis,
    /// In the order in which they cover each other.
    pub items: Vec<Item>,
}

/// One axis.
#[derive(Debug, Clone)]
pub struct Axis {
    label: String,
    low: f64,
    high: f64,
    log: bool,
    ticks: Vec<(f64, String)>,
}

/// Something in a panel.
#[derive(Debug, Clone)]
pub enum Item {
    /// A line through points.
    Line {
        /// The points.
        points: Vec<(f64, f64)>,
        /// How it is drawn.
        pen: Pen,
    },
    /// A single point.
    Mark {
        /// Where.
        at: (f64, f64),
        /// Its form.
        shape: Shape,
        /// Its colour.
        colour: RGBColor,
    },
}

/// How a line is drawn.
#[derive(Debug, Clone, Copy)]
pub struct Pen {
    /// Colour.
    pub colour: RGBColor,
    /// Width (px).
    pub width: u32,
    /// Dashes instead of a whole line.
    pub dashed: bool,
}

/// Form of a single point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// Open circle.
    Circle,
    /// Open diamond.
    Diamond,
    /// Cross.
    Cross,
}

/// A key or a small table.
#[derive(Debug, Clone, Default)]
pub struct Block {
    /// Its lines.
    pub rows: Vec<KeyRow>,
}

/// One line of a key.
#[derive(Debug, Clone)]
pub struct KeyRow {
    /// A sample of what the line names.
    pub sample: Option<Sample>,
    /// Columns: the first from the left, others to the right.
    pub cells: Vec<String>,
}

/// A sample in a key.
#[derive(Debug, Clone, Copy)]
pub enum Sample {
    /// Of a line.
    Line(Pen),
    /// Of a point.
    Mark(Shape, RGBColor),
}

impl Pen {
    /// A curve's usual pen.
    pub fn solid(colour: RGBColor) -> Self {
        Self { colour, width: 2, dashed: false }
    }

    /// The same, dashed.
    pub fn dashed(colour: RGBColor) -> Self {
        Self { dashed: true, ..Self::solid(colour) }
    }
}

impl KeyRow {
    /// Columns without a sample.
    pub fn text<T: Into<String>>(cells: impl IntoIterator<Item = T>) -> Self {
        Self { sample: None, cells: cells.into_iter().map(Into::into).collect() }
    }

    /// A sample and what it stands for.
    pub fn sample(sample: Sample, label: impl Into<String>) -> Self {
        Self { sample: Some(sample), cells: vec![label.into()] }
    }
}

/// Least and greatest of the values, which need not be in any order; 0 and 1 where there is none.
pub fn extent(values: impl IntoIterator<Item = f64>) -> [f64; 2] {
    let finite = values.into_iter().filter(|v| v.is_finite());
    let [low, high] = finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| [l.min(v), h.max(v)]);
    if low <= high { [low, high] } else { [0.0, 1.0] }
}

impl Axis {
    /// Equal steps, with a little room at both ends so that marks there stay whole.
    pub fn linear(label: impl Into<String>, [low, high]: [f64; 2]) -> Self {
        // One value alone gets room around it.
        let width = if high - low > 1e-9 * low.abs() { high - low } else { low.abs().max(1e-3) };
        let (low, high) = (low - 0.04 * width, high + 0.04 * width);
        let decade = 10f64.powf(width.log10().floor());
        let inside = |step: f64| (low / step).ceil() as i64..=(high / step).floor() as i64;
        let steps = [5.0, 2.5, 2.0, 1.0, 0.5, 0.25, 0.2, 0.1].map(|m| m * decade);
        let step = steps.into_iter().find(|step| inside(*step).count() >= 4).unwrap_or(width);
        let places = (2.0 - step.log10()).clamp(0.0, 12.0) as usize;
        let ticks = inside(step).map(|k| k as f64 * step).map(|v| (v, plain(v, places))).collect();
        Self { label: label.into(), low, high, log: false, ticks }
    }

    /// Equal ratios; both limits above 0.
    pub fn log(label: impl Into<String>, [low, high]: [f64; 2]) -> Self {
        let low = low.max(f64::MIN_POSITIVE);
        let room = (high.max(low) / low).powf(0.05).max(1.05);
        let (low, high) = (low / room, high.max(low) * room);
        let decades = (high / low).log10();
        let steps: &[f64] = if decades < 2.2 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let ticks = (low.log10().floor() as i32..=high.log10().ceil() as i32)
            .flat_map(|k| steps.iter().map(move |s| s * 10f64.powi(k)))
            .filter(|v| (low..=high).contains(v))
            .map(|v| (v, plain(v, 12)));
        Self { label: label.into(), low, high, log: true, ticks: ticks.collect() }
    }

    /// Equal ratios between these limits, with ticks that are named.
    pub fn log_named(label: impl Into<String>, [low, high]: [f64; 2], ticks: Vec<(f64, String)>) -> Self {
        let ticks = ticks.into_iter().filter(|(v, _)| (low..=high).contains(v)).collect();
        Self { label: label.into(), low, high, log: true, ticks }
    }

    /// Names from top to bottom, the `k`th at −k.
    pub fn names(names: impl IntoIterator<Item = String>) -> Self {
        let ticks: Vec<(f64, String)> = names.into_iter().enumerate().map(|(k, n)| (-(k as f64), n)).collect();
        Self { label: String::new(), low: 0.4 - ticks.len() as f64, high: 0.6, log: false, ticks }
    }

    /// Where a value stands on a straight scale.
    fn place(&self, value: f64) -> f64 {
        if self.log { value.max(f64::MIN_POSITIVE).ln() } else { value }
    }

    fn widest_tick(&self) -> i32 {
        self.ticks.iter().map(|(_, name)| width_of(name)).max().unwrap_or(0)
    }
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (from, to): (i32, i32)) -> i32 {
        let [low, high, place] = [self.low, self.high, *value].map(|v| self.place(v));
        from + (f64::from(to - from) * (place - low) / (high - low)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        // There are no lines between the ticks.
        if hint.weight().allow_light_points() { Vec::new() } else { self.ticks.iter().map(|(v, _)| *v).collect() }
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.low..self.high
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, value: &f64) -> String {
        self.ticks.iter().find(|(v, _)| v == value).map(|(_, name)| name.clone()).unwrap_or_default()
    }
}

/// A number with at most so many decimal places and none that are zero.
fn plain(value: f64, places: usize) -> String {
    let text = format!("{value:.places$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".into() } else { text.replace('-', "−") }
}

/// Width of a text, as wide as any common font sets it: the reader's font is not known here.
fn width_of(text: &str) -> i32 {
    let narrow = |c: char| " .,:;|!'()[]ijlt/".contains(c);
    text.chars().map(|c| if narrow(c) { 7 * PX } else { 12 * PX }).sum()
}

fn wrapped(text: &str, width: i32) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.is_empty() => line.push_str(word),
            Some(line) if width_of(line) + width_of(" ") + width_of(word) <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.into()),
        }
    }
    lines
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// What the drawing library says, in words: its errors borrow the picture.
type Drawn = Result<(), String>;

fn words(error: impl std::fmt::Display) -> String {
    error.to_string()
}

impl Block {
    fn columns(&self) -> Vec<i32> {
        let count = self.rows.iter().map(|r| r.cells.len()).max().unwrap_or(0);
        (0..count)
            .map(|k| self.rows.iter().filter_map(|r| r.cells.get(k)).map(|cell| width_of(cell)).max().unwrap_or(0))
            .collect()
    }

    /// Room for samples, if any line has one.
    fn indent(&self) -> i32 {
        if self.rows.iter().any(|r| r.sample.is_some()) { SAMPLE + GAP / 2 } else { 0 }
    }

    fn size(&self) -> (i32, i32) {
        let columns = self.columns();
        (self.indent() + columns.iter().sum::<i32>() + GAP * columns.len() as i32, LINE * self.rows.len() as i32)
    }

    fn draw(&self, area: &Area<'_>, (left, top): (i32, i32)) -> Drawn {
        let columns = self.columns();
        for (row, y) in self.rows.iter().zip((top..).step_by(LINE as usize)) {
            let middle = y + LINE / 2;
            match row.sample {
                Some(Sample::Line(pen)) => draw_line(area, vec![(left, middle), (left + SAMPLE, middle)], pen)?,
                Some(Sample::Mark(shape, colour)) => draw_mark(area, (left + SAMPLE / 2, middle), shape, colour)?,
                None => (),
            }
            let mut x = left + self.indent();
            for (k, (cell, width)) in row.cells.iter().zip(&columns).enumerate() {
                let at = if k == 0 { x } else { x + width };
                write(area, cell, (at, middle), if k == 0 { HPos::Left } else { HPos::Right }, TEXT)?;
                x += width + GAP;
            }
        }
        Ok(())
    }
}

fn write(area: &Area<'_>, text: &str, at: (i32, i32), side: HPos, size: i32) -> Drawn {
    let style = (FONT, size).into_text_style(area).pos(Pos::new(side, VPos::Center));
    area.draw(&Text::new(text.to_owned(), at, style)).map_err(words)
}

fn draw_line(area: &Area<'_>, points: Vec<(i32, i32)>, pen: Pen) -> Drawn {
    let style = pen.colour.stroke_width(pen.width * PX as u32);
    if pen.dashed {
        area.draw(&DashedPathElement::new(points, 7 * PX, 5 * PX, style)).map_err(words)
    } else {
        area.draw(&PathElement::new(points, style)).map_err(words)
    }
}

fn draw_mark(area: &Area<'_>, (x, y): (i32, i32), shape: Shape, colour: RGBColor) -> Drawn {
    let style = colour.stroke_width(2 * PX as u32);
    match shape {
        Shape::Circle => {
            area.draw(&Circle::new((x, y), 5 * PX, WHITE.filled())).map_err(words)?;
            area.draw(&Circle::new((x, y), 5 * PX, style)).map_err(words)
        }
        Shape::Diamond => {
            let r = 8 * PX;
            let corners = vec![(x, y - r), (x + r, y), (x, y + r), (x - r, y)];
            area.draw(&Polygon::new(corners.clone(), WHITE.filled())).map_err(words)?;
            let around = corners.iter().chain(&corners[..2]).copied().collect::<Vec<_>>();
            area.draw(&PathElement::new(around, style)).map_err(words)
        }
        Shape::Cross => {
            let (r, style) = (6 * PX, colour.stroke_width(3 * PX as u32));
            area.draw(&PathElement::new([(x - r, y - r), (x + r, y + r)], style)).map_err(words)?;
            area.draw(&PathElement::new([(x - r, y + r), (x + r, y - r)], style)).map_err(words)
        }
    }
}

impl Panel {
    /// Room for the ticks and the name of the axis up.
    fn left(&self) -> i32 {
        self.y.widest_tick() + if self.y.label.is_empty() { 14 * PX } else { 46 * PX }
    }

    fn draw(&self, area: &Area<'_>, left: i32) -> Drawn {
        let title_height = if self.title.is_empty() { 10 * PX } else { 34 * PX };
        let below = if self.x.label.is_empty() { 30 * PX } else { 52 * PX };
        let (title, rest) = area.split_vertically(title_height);
        write(&title, &self.title, (left, title_height / 2), HPos::Left, TEXT + PX)?;
        let mut chart = ChartBuilder::on(&rest)
            .margin(0)
            .margin_right(MARGIN)
            .margin_bottom(8 * PX)
            .x_label_area_size(below)
            .y_label_area_size(left)
            .build_cartesian_2d(self.x.clone(), self.y.clone())
            .map_err(words)?;
        chart
            .configure_mesh()
            .x_desc(&self.x.label)
            .y_desc(&self.y.label)
            .label_style((FONT, TEXT - PX))
            .axis_desc_style((FONT, TEXT))
            .axis_style(BLACK.stroke_width(PX as u32))
            .set_all_tick_mark_size(5 * PX)
            .bold_line_style(BLACK.mix(0.10).stroke_width(PX as u32))
            .draw()
            .map_err(words)?;
        // The plane answers in pixels of the whole picture.
        let (left, top) = rest.get_base_pixel();
        let local = |p: (f64, f64)| {
            let (x, y) = chart.plotting_area().map_coordinate(&p);
            (x - left, y - top)
        };
        for item in &self.items {
            match item {
                Item::Line { points, pen } => {
                    let drawable = |p: &&(f64, f64)| p.0.is_finite() && p.1.is_finite();
                    let points: Vec<_> = points.iter().filter(drawable).map(|p| local(*p)).collect();
                    draw_line(&rest, points, *pen)?;
                }
                Item::Mark { at, shape, colour } => draw_mark(&rest, local(*at), *shape, *colour)?,
            }
        }
        Ok(())
    }
}

impl Figure {
    /// The picture as SVG.
    ///
    /// # Errors
    /// If the drawing library fails.
    pub fn svg(&self) -> Result<String, Failure> {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(1) as i32;
        let panel_size = (self.panel_size.0 * PX as u32, self.panel_size.1 * PX as u32);
        let (panel_width, panel_height) = (panel_size.0 as i32, panel_size.1 as i32);
        let width = panel_width * columns + 2 * MARGIN;
        let grid_top = 44 * PX;
        let grid_height = panel_height * self.rows.len() as i32;
        let (blocks, blocks_end) = self.place_blocks(width, grid_top + grid_height + MARGIN);
        let notes: Vec<String> = self.notes.iter().flat_map(|note| wrapped(note, width - 2 * MARGIN)).collect();
        let height = blocks_end + LINE * notes.len() as i32 + MARGIN;
        // All panels start at the same place, so that axes above each other can be compared.
        let axes = self.rows.iter().flatten().map(Panel::left).max().unwrap_or(0);
        let mut text = String::new();
        {
            let area = SVGBackend::with_string(&mut text, (width as u32, height as u32)).into_drawing_area();
            let draw = || -> Drawn {
                area.fill(&WHITE).map_err(words)?;
                write(&area, &self.heading, (MARGIN, grid_top / 2), HPos::Left, TEXT + 4 * PX)?;
                for (row, top) in self.rows.iter().zip((grid_top..).step_by(panel_size.1 as usize)) {
                    for (panel, left) in row.iter().zip((MARGIN..).step_by(panel_size.0 as usize)) {
                        panel.draw(&area.clone().shrink((left, top), panel_size), axes)?;
                    }
                }
                for (block, at) in self.blocks.iter().zip(blocks) {
                    block.draw(&area, at)?;
                }
                for (note, y) in notes.iter().zip((blocks_end + LINE / 2..).step_by(LINE as usize)) {
                    write(&area, note, (MARGIN, y), HPos::Left, TEXT)?;
                }
                area.present().map_err(words)
            };
            draw().map_err(|e| anyhow!("drawing: {e}"))?;
        }
        let size = |per_px: i32| format!(r#"width="{}" height="{}""#, width / per_px, height / per_px);
        Ok(text.replacen(&size(1), &size(PX), 1))
    }

    /// Where each block goes, and where they end.
    fn place_blocks(&self, width: i32, top: i32) -> (Vec<(i32, i32)>, i32) {
        let (mut x, mut y, mut end) = (MARGIN, top, top);
        let mut places = Vec::new();
        for block in &self.blocks {
            let (w, h) = block.size();
            if x > MARGIN && x + w > width {
                (x, y) = (MARGIN, end + LINE / 2);
            }
            places.push((x, y));
            x += w + 2 * MARGIN;
            end = end.max(y + h);
        }
        (places, if self.blocks.is_empty() { end } else { end + LINE / 2 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let names = |axis: &Axis| axis.ticks.iter().map(|(_, name)| name.clone()).collect::<Vec<_>>();
        assert_eq!(names(&Axis::linear("", [0.0, 37.0])), ["0", "10", "20", "30"]);
        assert_eq!(names(&Axis::linear("", [-0.02, 0.02])), ["−0.02", "−0.01", "0", "0.01", "0.02"]);
        assert_eq!(names(&Axis::linear("", [0.0, 7.5])), ["0", "2.5", "5", "7.5"]);
        assert_eq!(names(&Axis::log("", [0.4, 8.0])), ["0.5", "1", "2", "5"]);
        assert_eq!(names(&Axis::log("", [0.4, 500.0])), ["1", "10", "100"]);
        assert!(names(&Axis::linear("", [3.0, 3.0])).contains(&"3".to_owned()));
        assert!(!names(&Axis::linear("", [0.0, 0.0])).is_empty());
    }

    #[test]
    fn long_notes_are_broken_between_words() {
        let lines = wrapped("one two three four", width_of("one two") + 1);
        assert_eq!(lines, ["one two", "three", "four"]);
    }

    #[test]
    fn every_mark_and_every_text_is_drawn() {
        let panel = Panel {
            title: "a < b & c".into(),
            x: Axis::linear("turns", [0.0, 1.0]),
            y: Axis::log("TR", [0.1, 10.0]),
            items: vec![
                Item::Line { points: vec![(0.0, 0.1), (1.0, f64::INFINITY)], pen: Pen::dashed(BLACK) },
                Item::Mark { at: (0.5, 1.0), shape: Shape::Circle, colour: BLACK },
                Item::Mark { at: (0.5, 1.0), shape: Shape::Diamond, colour: BLACK },
            ],
        };
        let figure = Figure {
            heading: "heading".into(),
            rows: vec![vec![panel]],
            panel_size: (400, 300),
            blocks: vec![Block { rows: vec![KeyRow::text(["key", "value"])] }],
            notes: vec!["note".into()],
        };
        let svg = figure.svg().unwrap();
        assert!(svg.starts_with(r#"<svg width="428" height="#), "{}", &svg[..60]);
        assert_eq!(svg.matches("<circle").count(), 2);
        assert_eq!(svg.matches("<polygon").count(), 1);
        for text in ["a &lt; b &amp; c", "heading", "key", "value", "note", "turns", "TR"] {
            assert!(svg.contains(text), "{text}");
        }
    }
}
