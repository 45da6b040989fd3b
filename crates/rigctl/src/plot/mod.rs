//! Pictures: a grid of panels over one key, as SVG.
//!
//! A [`Figure`] is described, then drawn by [`Figure::svg`]; what is drawn twice looks the same everywhere.
//! [`Axis`] chooses ticks.

mod axis;
mod draw;

pub use axis::Axis;
pub use plotters::style::RGBColor;

use plotters::style::BLACK;

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
/// Colour of samples in a key that stand for all curves or marks of a kind.
pub const GREY: RGBColor = RGBColor(90, 90, 90);

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
    /// A filled rectangle between two corners.
    Fill {
        /// One corner.
        from: (f64, f64),
        /// The opposite one.
        to: (f64, f64),
        /// Its colour.
        colour: RGBColor,
    },
    /// A few words just right of a point.
    Label {
        /// Where.
        at: (f64, f64),
        /// The words.
        text: String,
        /// Their colour.
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
    /// Filled circle.
    Dot,
    /// Open square.
    Square,
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
    /// Of a filled area.
    Fill(RGBColor),
}

impl Panel {
    /// Axes with a title, and what is drawn in them.
    pub fn new(title: impl Into<String>, x: Axis, y: Axis, items: impl IntoIterator<Item = Item>) -> Self {
        Self { title: title.into(), x, y, items: items.into_iter().collect() }
    }

    /// Panels side by side with the same axis up, which only the first names.
    pub fn side_by_side(panels: impl IntoIterator<Item = Self>) -> Vec<Self> {
        let unnamed = |(k, panel): (usize, Self)| if k == 0 { panel } else { Self { y: panel.y.unnamed(), ..panel } };
        panels.into_iter().enumerate().map(unnamed).collect()
    }
}

impl Item {
    /// A line through points.
    pub fn line(points: impl IntoIterator<Item = (f64, f64)>, pen: Pen) -> Self {
        Self::Line { points: points.into_iter().collect(), pen }
    }

    /// A single point.
    pub fn mark(at: (f64, f64), shape: Shape, colour: RGBColor) -> Self {
        Self::Mark { at, shape, colour }
    }

    /// A few words just right of a point.
    pub fn label(at: (f64, f64), text: impl Into<String>, colour: RGBColor) -> Self {
        Self::Label { at, text: text.into(), colour }
    }

    /// Every point that has to be inside the axes.
    pub fn points(&self) -> Vec<(f64, f64)> {
        match self {
            Self::Line { points, .. } => points.clone(),
            Self::Mark { at, .. } | Self::Label { at, .. } => vec![*at],
            Self::Fill { from, to, .. } => vec![*from, *to],
        }
    }
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

    /// The same, of another width (px).
    pub fn wide(self, width: u32) -> Self {
        Self { width, ..self }
    }
}

impl Block {
    /// Of these lines.
    pub fn new(rows: impl IntoIterator<Item = KeyRow>) -> Self {
        Self { rows: rows.into_iter().collect() }
    }

    /// The same lines in so many blocks of equal height.
    pub fn split(count: usize, rows: impl IntoIterator<Item = KeyRow>) -> Vec<Self> {
        let rows: Vec<KeyRow> = rows.into_iter().collect();
        rows.chunks(rows.len().div_ceil(count).max(1)).map(|rows| Self::new(rows.to_vec())).collect()
    }
}

impl KeyRow {
    /// What a line stands for.
    pub fn line(pen: Pen, label: impl Into<String>) -> Self {
        Self::sample(Sample::Line(pen), label)
    }

    /// What a mark stands for.
    pub fn mark(shape: Shape, colour: RGBColor, label: impl Into<String>) -> Self {
        Self::sample(Sample::Mark(shape, colour), label)
    }

    /// What a filled area stands for.
    pub fn fill(colour: RGBColor, label: impl Into<String>) -> Self {
        Self::sample(Sample::Fill(colour), label)
    }

    /// Columns without a sample.
    pub fn text<T: Into<String>>(cells: impl IntoIterator<Item = T>) -> Self {
        Self { sample: None, cells: cells.into_iter().map(Into::into).collect() }
    }

    /// A sample and what it stands for.
    pub fn sample(sample: Sample, label: impl Into<String>) -> Self {
        Self { sample: Some(sample), cells: vec![label.into()] }
    }
}

/// Minimum and maximum of the values, which need not be in any order; 0 and 1 where there is none.
pub fn extent(values: impl IntoIterator<Item = f64>) -> [f64; 2] {
    let finite = values.into_iter().filter(|v| v.is_finite());
    let [low, high] = finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| [l.min(v), h.max(v)]);
    if low <= high { [low, high] } else { [0.0, 1.0] }
}

#[cfg(test)]
mod tests {
    use super::*;

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
