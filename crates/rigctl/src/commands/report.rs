//! `report`: one page with everything about a scene: model, table certificate, charts, stability map, a recorded move.

use crate::failure::Failure;
use crate::figure;
use crate::options::Global;
use crate::out_file::OutFile;
use crate::output::Output;
use crate::recorded_move;
use lab::move_figure::draw;
use lab::report::{Picture, Section, page};
use lab::table_report::TableReport;
use std::path::Path;

/// Load of the recorded move (kg) and twist of the strings when the board starts (rad).
const MOVE: (f64, f64) = (0.5, 8.0);

/// Runs the command.
///
/// # Errors
/// If the scene allows no table, or the page cannot be written. What needs another program's results and does not find
/// them is named in the page instead.
pub fn run(global: &Global, out: &Path, output: &mut Output) -> Result<(), Failure> {
    let file = OutFile::new(out)?;
    let folder = match out.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let scene = global.scene()?;
    let table = TableReport::new(&scene, &scene.fit_table()?)?;
    let mut charts = Vec::new();
    for name in lab::chart::NAMES {
        output.line(format!("{name} …"))?;
        output.flush()?;
        let made = figure::make(name, &scene, &global.scene, folder);
        charts.push(section(name, made.map(|made| Picture { svg: made.svg, findings: made.findings })));
    }
    output.line("a move on the emulated board …")?;
    output.flush()?;
    let moved = section("move", recorded(global, scene.rig.gear()));
    file.write(&page(&global.scene.display().to_string(), &scene, &table, &charts, &moved)?)?;
    let missing = charts.iter().chain([&moved]).filter(|section| section.content.is_err()).map(|section| section.name);
    output.object(&serde_json::json!({ "report": out, "missing": missing.collect::<Vec<_>>() }))?;
    output.line(format!("written: {}", out.display()))?;
    Ok(())
}

/// A move on the emulated board as a picture, with its figures.
fn recorded(global: &Global, gear: f64) -> Result<Picture, Failure> {
    let (load_kg, twist_rad) = MOVE;
    let options = global.emulated()?;
    let m = recorded_move::record(&options, load_kg, twist_rad, gear)?;
    let findings = vec![
        format!("EMULATED: the firmware's ELF on an {options}, {load_kg} kg, unknown to it"),
        format!(
            "load estimated {:.3} N, true {:.3} N; homed in {:.1} s",
            m.travel.load_n, m.load_true_n, m.home.duration_s
        ),
        format!("error at rest {:+.1} um; core busy {:.2} %", m.true_error_at_rest_m * 1e6, 100.0 * m.core_busy),
    ];
    Ok(Picture { svg: Some(draw(&[m.curve()])?), findings })
}

/// A section of the page; why it is missing is printed at once.
fn section(name: &'static str, made: Result<Picture, Failure>) -> Section {
    let content = made.map_err(|failure| failure.message().unwrap_or_default());
    if let Err(why) = &content {
        eprintln!("left out: {name}: {why}");
    }
    Section { name, content }
}
