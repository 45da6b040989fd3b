//! The demo's picture: position, motor speed and TR over one time axis.

use crate::failure::Failure;
use anyhow::anyhow;
use plotters::prelude::*;

/// One load's curves; time in seconds from the start of the move.
pub(super) struct Curve {
    pub label: String,
    pub position_mm: Vec<(f64, f64)>,
    pub set_point_mm: Vec<(f64, f64)>,
    pub motor_rpm: Vec<(f64, f64)>,
    pub tr_rad_per_mm: Vec<(f64, f64)>,
}

/// Okabe–Ito: told apart by colour-blind readers and in grey.
const COLOURS: [RGBColor; 3] = [RGBColor(0, 114, 178), RGBColor(230, 159, 0), RGBColor(0, 158, 115)];
const SIZE: (u32, u32) = (1000, 980);

struct Panel<'a> {
    title: &'a str,
    axis: &'a str,
    data: fn(&Curve) -> &Vec<(f64, f64)>,
    set_point: bool,
    time_axis: bool,
}

/// The picture as SVG.
pub(super) fn draw(curves: &[Curve]) -> Result<String, Failure> {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        let wrong = |e: &dyn std::fmt::Display| Failure::from(anyhow!("drawing: {e}"));
        area.fill(&WHITE).map_err(|e| wrong(&e))?;
        let (heading, rest) = area.split_vertically(40);
        heading
            .draw(&Text::new(
                "One firmware, three loads it was not told of: 12 mm at 2 mm/s (emulated board and rig)",
                (20, 12),
                ("sans-serif", 21),
            ))
            .map_err(|e| wrong(&e))?;
        let panels = [
            Panel {
                title: "Position of the load (dashed: set-point)",
                axis: "mm",
                data: |c| &c.position_mm,
                set_point: true,
                time_axis: false,
            },
            Panel { title: "Motor speed", axis: "rpm", data: |c| &c.motor_rpm, set_point: false, time_axis: false },
            Panel {
                title: "Transmission ratio at the estimated load",
                axis: "rad/mm",
                data: |c| &c.tr_rad_per_mm,
                set_point: false,
                time_axis: true,
            },
        ];
        for (area, panel) in rest.split_evenly((3, 1)).iter().zip(&panels) {
            draw_panel(area, panel, curves).map_err(|e| wrong(&e))?;
        }
        area.present().map_err(|e| wrong(&e))?;
    }
    Ok(text)
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

fn draw_panel(area: &Area<'_>, panel: &Panel<'_>, curves: &[Curve]) -> Result<(), String> {
    let points = || curves.iter().flat_map(|c| (panel.data)(c).iter());
    let end_s = points().map(|p| p.0).fold(1.0, f64::max);
    let (low, high) = points().map(|p| p.1).fold((0.0, 0.0), |(l, h): (f64, f64), v| (l.min(v), h.max(v)));
    let margin = 0.06 * (high - low).max(1e-9);
    let text = |e: &dyn std::fmt::Display| e.to_string();
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .margin_right(110)
        .caption(panel.title, ("sans-serif", 19))
        .x_label_area_size(if panel.time_axis { 48 } else { 28 })
        .y_label_area_size(80)
        .build_cartesian_2d(0.0..end_s, low - margin..high + margin)
        .map_err(|e| text(&e))?;
    let mut mesh = chart.configure_mesh();
    mesh.y_desc(panel.axis).label_style(("sans-serif", 17)).axis_desc_style(("sans-serif", 18)).light_line_style(WHITE);
    if panel.time_axis {
        mesh.x_desc("time from the start of the move, s");
    }
    mesh.draw().map_err(|e| text(&e))?;
    if panel.set_point
        && let Some(curve) = curves.first()
    {
        let line = curve.set_point_mm.iter().copied();
        chart.draw_series(DashedLineSeries::new(line, 6, 5, BLACK.mix(0.7).stroke_width(1))).map_err(|e| text(&e))?;
    }
    for (curve, colour) in curves.iter().zip(COLOURS.iter().cycle()) {
        let line = (panel.data)(curve).iter().copied();
        chart.draw_series(LineSeries::new(line, colour.stroke_width(2))).map_err(|e| text(&e))?;
    }
    // In the margin at the right, where no curve can be.
    let (width, _) = area.dim_in_pixel();
    let at = i32::try_from(width).unwrap_or(i32::MAX) - 100;
    for (k, (curve, colour)) in curves.iter().zip(COLOURS.iter().cycle()).enumerate() {
        let y = 48 + 24 * i32::try_from(k).unwrap_or(0);
        area.draw(&PathElement::new([(at, y), (at + 24, y)], colour.stroke_width(3))).map_err(|e| text(&e))?;
        area.draw(&Text::new(curve.label.clone(), (at + 32, y - 9), ("sans-serif", 18))).map_err(|e| text(&e))?;
    }
    Ok(())
}
