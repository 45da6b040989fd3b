//! Drawing: a [`Figure`] as SVG.

use super::{Block, Figure, Item, Panel, Pen, Sample, Shape};
use anyhow::{Result, anyhow};
use plotters::coord::Shift;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

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

/// Width of a text, as wide as any common font sets it: the reader's font is not known here.
pub(super) fn width_of(text: &str) -> i32 {
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
                Some(Sample::Fill(colour)) => {
                    let half = LINE / 3;
                    draw_fill(area, (left, middle - half), (left + SAMPLE, middle + half), colour)?;
                }
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

fn draw_fill(area: &Area<'_>, from: (i32, i32), to: (i32, i32), colour: RGBColor) -> Drawn {
    // A little over its upper edge: between neighbours that only touch a seam shows.
    area.draw(&Rectangle::new([from, (to.0, to.1 - PX / 4)], colour.filled())).map_err(words)
}

fn draw_mark(area: &Area<'_>, (x, y): (i32, i32), shape: Shape, colour: RGBColor) -> Drawn {
    let style = colour.stroke_width(2 * PX as u32);
    match shape {
        Shape::Dot => area.draw(&Circle::new((x, y), 5 * PX, colour.filled())).map_err(words),
        Shape::Square => {
            let corners = [(x - 5 * PX, y - 5 * PX), (x + 5 * PX, y + 5 * PX)];
            area.draw(&Rectangle::new(corners, WHITE.filled())).map_err(words)?;
            let [(l, t), (r, b)] = corners;
            area.draw(&PathElement::new([(l, t), (r, t), (r, b), (l, b), (l, t), (r, t)], style)).map_err(words)
        }
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
                Item::Fill { from, to, colour } => draw_fill(&rest, local(*from), local(*to), *colour)?,
                Item::Label { at, text, colour } => {
                    let style = (FONT, TEXT - 2 * PX).into_text_style(&rest).color(colour);
                    // Beside a mark at the same place.
                    let (x, y) = local(*at);
                    let text = Text::new(text.clone(), (x + 9 * PX, y), style.pos(Pos::new(HPos::Left, VPos::Center)));
                    rest.draw(&text).map_err(words)?;
                }
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
    pub fn svg(&self) -> Result<String> {
        // Panels above each other start at the same place, so that their axes can be compared; all planes are equally
        // wide, and a column whose axes name nothing is narrower by that.
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(1);
        let axes = |k: usize| self.rows.iter().filter_map(|row| row.get(k)).map(Panel::left).max().unwrap_or(0);
        let axes: Vec<i32> = (0..columns).map(axes).collect();
        let widest = axes.iter().copied().max().unwrap_or(0);
        let panel_height = self.panel_size.1 as i32 * PX;
        let widths: Vec<i32> = axes.iter().map(|left| self.panel_size.0 as i32 * PX - (widest - left)).collect();
        let width = widths.iter().sum::<i32>() + 2 * MARGIN;
        let grid_top = 44 * PX;
        let grid_height = panel_height * self.rows.len() as i32;
        let (blocks, blocks_end) = self.place_blocks(width, grid_top + grid_height + MARGIN);
        let notes: Vec<String> = self.notes.iter().flat_map(|note| wrapped(note, width - 2 * MARGIN)).collect();
        let height = blocks_end + LINE * notes.len() as i32 + MARGIN;
        let mut text = String::new();
        {
            let area = SVGBackend::with_string(&mut text, (width as u32, height as u32)).into_drawing_area();
            let draw = || -> Drawn {
                area.fill(&WHITE).map_err(words)?;
                write(&area, &self.heading, (MARGIN, grid_top / 2), HPos::Left, TEXT + 4 * PX)?;
                for (row, top) in self.rows.iter().zip((grid_top..).step_by(panel_height as usize)) {
                    let mut left = MARGIN;
                    for (panel, (axis, width)) in row.iter().zip(axes.iter().zip(&widths)) {
                        panel.draw(&area.clone().shrink((left, top), (*width as u32, panel_height as u32)), *axis)?;
                        left += width;
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
    fn long_notes_are_broken_between_words() {
        let lines = wrapped("one two three four", width_of("one two") + 1);
        assert_eq!(lines, ["one two", "three", "four"]);
    }
}
