//! `report`: one page with the mechanism and its solver, the table's certificate, charts, stability map, a recorded move.
//!
//! - [`data`]: what the page's script computes with.
//! - [`fragments`]: the parts that need no script, as HTML.
//!
//! Layout, style and script are the files in `web/page`; the solver is compiled by this crate's build script.

pub mod data;
pub mod fragments;

use crate::chart;
use crate::table_report::TableReport;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use data::{Data, Move};
use fragments::{Figure, escaped};
use rig_config::Scene;
use rigctl::failure::Failure;
use rigctl::log::Log;
use rigctl::options::Global;
use rigctl::out_file::OutFile;
use rigctl::output::Output;
use rigctl::recorded_move::{self, draw};
use rigctl::units::{KG, N, S, UM};
use std::path::{Path, PathBuf};

/// The compiled solver, or why there is none.
const SOLVER: Result<&[u8], &str> = include!(concat!(env!("OUT_DIR"), "/solver.rs"));

const LAYOUT: &str = include_str!("../../web/page/page.html");
const STYLE: &str = include_str!("../../web/page/page.css");
/// The parts of the script, in the order in which they need each other.
const SCRIPT: [&str; 8] = [
    include_str!("../../web/page/solver.js"),
    include_str!("../../web/page/plot.js"),
    include_str!("../../web/page/drawing.js"),
    include_str!("../../web/page/curves.js"),
    include_str!("../../web/page/map.js"),
    include_str!("../../web/page/controls.js"),
    include_str!("../../web/page/playback.js"),
    include_str!("../../web/page/main.js"),
];

/// The solver, in the form in which it goes into a page.
///
/// # Errors
/// What was missing when this program was built.
fn solver() -> Result<String, Failure> {
    let bytes =
        SOLVER.map_err(|why| Failure::failed(format!("this tool was built without the page's solver: {why}")))?;
    Ok(STANDARD.encode(bytes))
}

/// The page as HTML, of what belongs in the places of the layout.
///
/// # Errors
/// As [`solver`].
fn html(parts: Vec<(&str, String)>) -> Result<String, Failure> {
    let own = [("style", STYLE.into()), ("solver", solver()?), ("script", SCRIPT.join("\n"))];
    Ok(filled(LAYOUT, &own.into_iter().chain(parts).collect::<Vec<_>>()))
}

/// A layout with each `{{name}}` replaced. What is put in is not searched again.
pub fn filled(layout: &str, parts: &[(&str, String)]) -> String {
    let mut text = String::new();
    let mut pieces = layout.split("{{");
    text += pieces.next().unwrap_or_default();
    for piece in pieces {
        let part = piece.split_once("}}").and_then(|(name, rest)| {
            let (_, part) = parts.iter().find(|(known, _)| *known == name)?;
            Some((part, rest))
        });
        match part {
            Some((part, rest)) => text = text + part + rest,
            None => text = text + "{{" + piece,
        }
    }
    text
}

/// Load of the recorded move (kg) and twist of the strings when the board starts (rad).
const MOVE: (f64, f64) = (0.5, 8.0);
const MOVED: &str = "Position, motor speed and transmission ratio of the move";

/// `tsa-lab report`: the file, and files of the operator that take the place of what the command would make.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// File to write
    #[arg(long, value_name = "FILE.html")]
    out: PathBuf,
    /// Recorded log to play back in the page [default: a move that is made for it on the emulated board]
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// Folder in which `tsa-lab chart` has left its figures [default: they are made, which takes minutes]
    #[arg(long, value_name = "DIR")]
    charts: Option<PathBuf>,
}

impl Arguments {
    /// Runs the command.
    ///
    /// # Errors
    /// If the scene describes no mechanism, this program was built without the page's solver, the log is none, or the page
    /// cannot be written. What needs another program's results and does not find them is named in the page instead.
    pub fn run(&self, global: &Global, output: &mut Output) -> Result<(), Failure> {
        solver()?;
        let file = OutFile::new(&self.out)?;
        let scene = global.scene()?;
        let mechanism = scene.mechanism()?;
        let log = self.log.as_deref().map(|path| Ok::<_, Failure>((path, load(path)?))).transpose()?;
        let fit = scene.fit_table().map_err(|e| Failure::from(e).message().unwrap_or_default());
        let report = |fit| TableReport::new(&scene, fit).map_err(|e| e.to_string());
        let table = fit.as_ref().map_err(String::clone).and_then(report);
        let figures = self.figures(global, &scene, output)?;
        let (recorded, moved) = match log {
            Some((path, log)) => of_log(path, &log, &scene),
            None => {
                output.line("a move on the emulated board …")?;
                output.flush()?;
                on_the_emulated_board(global, scene.rig.gear())
            }
        };
        let lookup = fit.as_ref().ok().map(|fit| fit.table.table());
        let data = Data::new(&scene, &mechanism, lookup.as_ref(), moved);
        let error_bounds = match &table {
            Ok(table) => fragments::error_bounds(table),
            Err(why) => format!("<p>There is no table: {}</p>", escaped(why)),
        };
        file.write(&html(vec![
            ("title", escaped(&global.scene.display().to_string())),
            ("constants", fragments::constants(&scene)),
            ("certificate", error_bounds),
            ("figures", figures.iter().map(fragments::figure).collect()),
            ("recorded", fragments::figure(&recorded)),
            // `<` starts a tag in a script of data, too.
            ("data", serde_json::to_string(&data)?.replace('<', "\\u003c")),
        ])?)?;
        let missing = figures.iter().chain([&recorded]).filter(|f| f.content.is_none()).map(|f| f.name);
        output.object(&serde_json::json!({ "report": self.out, "missing": missing.collect::<Vec<_>>() }))?;
        output.line(format!("written: {}", self.out.display()))?;
        Ok(())
    }

    /// The charts: from the folder where they are, or made.
    fn figures(&self, global: &Global, scene: &Scene, output: &mut Output) -> Result<Vec<Figure>, Failure> {
        let beside = self.out.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if let Some(folder) = self.charts.as_ref().filter(|folder| !folder.is_dir()) {
            return Err(Failure::failed(format!("--charts {}: there is no such folder", folder.display())));
        }
        if self.charts.is_none() {
            eprintln!(
                "the charts are computed first, which takes minutes; --charts DIR takes those of `tsa-lab chart`"
            );
        }
        let mut figures = Vec::new();
        for kind in chart::FIGURES {
            let (name, title, ..) = kind;
            let content = match &self.charts {
                Some(folder) => match rig_config::files::read_to_string(&folder.join(format!("{name}.svg"))) {
                    Ok(svg) => Some((Some(svg), Vec::new())),
                    // A table has no picture, and the folder may hold only some figures.
                    Err(_) => continue,
                },
                None => {
                    output.line(format!("{name} …"))?;
                    output.flush()?;
                    let made = chart::make(kind, scene, &global.scene, beside).map_err(Failure::from);
                    made.map(|made| (made.svg, made.findings)).map_err(|e| left_out(name, &e)).ok()
                }
            };
            figures.push(Figure { name, title, content });
        }
        Ok(figures)
    }
}

fn load(path: &Path) -> Result<Log, Failure> {
    let log = Log::load(path).map_err(|e| Failure::failed(format!("--log {}: {e}", path.display())))?;
    if log.rows.is_empty() {
        return Err(Failure::failed(format!("--log {}: holds no telemetry", path.display())));
    }
    Ok(log)
}

/// The log as data. The drawing is of this scene, whatever rig the log is of, so a difference is said in the page.
fn of_log(path: &Path, log: &Log, scene: &Scene) -> (Figure, Option<Move>) {
    let mut what = format!("Recorded in {}, {} rows.", path.display(), log.rows.len());
    if !log.complete {
        what += " The log was cut short.";
    }
    let hash = format!("{:08x}", scene.hash());
    if log.header.get("scene_hash").is_some_and(|recorded| recorded != hash) {
        what += " It was recorded with another scene than this page's: the drawing need not agree with the positions.";
    }
    let content = Some((None, vec![what.clone()]));
    (Figure { name: "move", title: MOVED, content }, Some(Move::new(what, &log.rows)))
}

/// A move on the emulated board as a picture with its figures, and as data.
fn on_the_emulated_board(global: &Global, gear: f64) -> (Figure, Option<Move>) {
    let (load_kg, twist_rad) = MOVE;
    let made = || -> Result<_, Failure> {
        let options = global.emulated()?;
        let m = recorded_move::record(&options, load_kg, twist_rad, gear)?;
        let findings = vec![
            format!(
                "Emulated: the firmware on an {options}; {} hangs on it, unknown to the firmware.",
                KG.exact(load_kg)
            ),
            format!(
                "Load: estimated {}, true {}. Homing took {}.",
                N.within(m.travel.load_n, m.travel.load_error_n),
                N.show(m.load_true_n),
                S.show(m.home.duration_s)
            ),
            format!("True error at rest: {}.", UM.show(m.true_error_at_rest_m)),
        ];
        let what = format!("A move of {} on the emulated board and actuator, not on hardware.", KG.exact(load_kg));
        Ok(((Some(draw(&[(m.load_kg, &m.rows)])?), findings), Move::new(what, &m.rows)))
    };
    let (content, moved) = match made() {
        Ok((picture, moved)) => (Some(picture), Some(moved)),
        Err(failure) => {
            left_out("move", &failure);
            (None, None)
        }
    };
    (Figure { name: "move", title: MOVED, content }, moved)
}

/// Says on standard error why a part is missing.
fn left_out(name: &str, failure: &Failure) {
    eprintln!("left out: {name}: {}", failure.message().unwrap_or_default());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_of_the_layout_is_filled_once() {
        let parts = [("a", "1 {{b}}".to_owned()), ("b", "2".to_owned())];
        assert_eq!(filled("x {{a}} y {{b}} {{c}}", &parts), "x 1 {{b}} y 2 {{c}}");
        for name in ["title", "style", "constants", "certificate", "figures", "recorded", "data", "solver", "script"] {
            assert!(LAYOUT.contains(&format!("{{{{{name}}}}}")), "{name}");
        }
    }

    #[test]
    fn no_part_of_the_script_ends_its_element() {
        for part in SCRIPT {
            assert!(!part.contains("</script"), "{part}");
        }
        assert!(!STYLE.contains("</style"));
    }
}
