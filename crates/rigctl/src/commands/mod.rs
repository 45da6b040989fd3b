//! What each command does: [`solve`], [`lookup`] and [`table`] on the desktop alone, [`published`] against the paper and
//! [`study`] beyond it, [`chart`] on methods against each other, [`demo`] on the emulated board, [`report`] on all of it,
//! [`simulate`] and [`operate`] on it or on a real one, [`config`] and [`calibrate`] what it keeps, [`dry_run`] on paper.
//! [`record`] and [`sweep`] keep what is seen, [`replay`] looks at it again; [`doctor`] judges a board and its sensors,
//! [`monitor`] shows it live; [`selftest`] looks at a board without a rig.

pub mod calibrate;
pub mod chart;
pub mod config;
pub mod demo;
pub mod doctor;
pub mod dry_run;
pub mod identify;
pub mod lookup;
pub mod monitor;
pub mod operate;
pub mod published;
pub mod rebuild;
pub mod record;
pub mod replay;
pub mod report;
pub mod selftest;
pub mod simulate;
pub mod solve;
pub mod status;
pub mod study;
pub mod sweep;
pub mod table;

use crate::cli::{Cli, Command, Global};
use crate::failure::Failure;
use crate::output::Output;
use clap::CommandFactory;
use rig_link::Request;
use rig_scene::{Scene, files};
use std::path::Path;

/// Runs the command.
///
/// # Errors
/// [`Failure`], with the exit code in its kind.
pub fn run(cli: &Cli, output: &mut Output) -> Result<(), Failure> {
    let global = &cli.global;
    rig_options(global, &cli.command)?;
    match &cli.command {
        Command::Solve { at, how } => solve::run(global, at, how, output),
        Command::Identify(options) => identify::run(global, options, output),
        Command::Lookup { at } => lookup::run(global, at, output),
        Command::Table { board: true, .. } => rebuild::run(global, output),
        Command::Table { out, board: false } => table::run(global, out.as_deref(), output),
        Command::Published { all, out } => published::run(global, *all, out.as_deref(), output),
        Command::Study { vary, load, turns, out } => study::run(global, vary, *load, *turns, out.as_deref(), output),
        Command::Sim { script, seconds } => simulate::run(global, script.as_deref(), *seconds, output),
        Command::Play { script } => simulate::play(global, script, output),
        Command::Move { to, speed, load, dry_run: true, settings } => {
            dry_run::run(global, *to, *speed, *load, settings.as_deref(), output)
        }
        Command::Move { to, speed, load, .. } => operate::travel(global, *to, *speed, *load, output),
        Command::Home => operate::home(global, output),
        Command::Jog { speed, seconds } => operate::jog(global, *speed, *seconds, output),
        Command::Stop => operate::simple(global, &Request::Stop, output),
        Command::Hold => operate::simple(global, &Request::Hold, output),
        Command::Clear => operate::simple(global, &Request::Clear, output),
        Command::Config { what } => config::run(global, what, output),
        Command::Calibrate { what } => calibrate::run(global, what, output),
        Command::Status => status::run(global, output),
        Command::Sensors { seconds } => status::sensors(global, *seconds, output),
        Command::Chart { out, only } => chart::run(global, out, only, output),
        Command::ChartKernel => Ok(lab::chart::work::kernel(&scene(global)?)?),
        Command::Report { out } => report::run(global, out, output),
        Command::Record(options) => record::run(global, options, output),
        Command::Sweep(options) => sweep::run(global, options, output),
        Command::Replay(options) => replay::run(global, options, output),
        Command::Doctor { home } => doctor::run(global, *home, output),
        Command::Selftest => selftest::run(global, output),
        Command::Monitor { script } => monitor::run(global, script.as_deref(), output),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut Cli::command(), "rigctl", &mut script);
            let script = String::from_utf8_lossy(&script);
            output.object(&serde_json::json!({"shell": shell.to_string(), "script": script}))?;
            Ok(output.line(script.trim_end())?)
        }
        Command::Demo { out } => demo::run(global, out, output),
    }
}

/// Options of a rig where there is none have no effect, which is said; a port where only the emulated board can be is refused.
fn rig_options(global: &Global, command: &Command) -> Result<(), Failure> {
    let port = global.port != "sim";
    let given = [
        (port, "--port"),
        (!global.plant.is_empty(), "--plant"),
        (global.plant_scene.is_some(), "--plant-scene"),
        (global.flash.is_some(), "--flash"),
        (global.firmware.is_some(), "--firmware"),
        (global.gdb.is_some(), "--gdb"),
    ];
    match command {
        Command::Sim { .. } | Command::Demo { .. } | Command::Report { .. } if port => Err(Failure::Usage(format!(
            "--port {}: this command is always on the emulated board; `play` takes a script to a rig",
            global.port
        ))),
        Command::Solve { .. }
        | Command::Identify(_)
        | Command::Lookup { .. }
        | Command::Table { board: false, .. }
        | Command::Published { .. }
        | Command::Study { .. }
        | Command::Move { dry_run: true, .. }
        | Command::Chart { .. }
        | Command::Replay(_)
        | Command::Completions { .. } => {
            no_effect(&given, "this command has to do with no rig");
            Ok(())
        }
        Command::Selftest => {
            no_effect(&given[1..4], "this board has no rig, and is a new one each time");
            Ok(())
        }
        _ => Ok(()),
    }
}

fn no_effect(given: &[(bool, &str)], why: &str) {
    for (_, name) in given.iter().filter(|(given, _)| *given) {
        eprintln!("{name} has no effect: {why}");
    }
}

/// The scene that the operator named.
pub(crate) fn scene(global: &Global) -> Result<Scene, Failure> {
    scene_file(&global.scene)?;
    Ok(Scene::load(&global.scene)?)
}

/// Whether a scene file is there at all.
fn scene_file(path: &Path) -> Result<(), Failure> {
    files::check_regular(path).map_err(|e| {
        // The default is in the project's folder only.
        let hint = if path.is_relative() && e.kind() == std::io::ErrorKind::NotFound {
            "; run rigctl in the project's folder, or name a scene with --scene FILE"
        } else {
            ""
        };
        Failure::failed(format!("scene {}: {e}{hint}", path.display()))
    })
}

/// The same where a rig is meant: it is one that can work. What is unusual about it is said.
pub(crate) fn rig_scene(global: &Global) -> Result<Scene, Failure> {
    let scene = scene(global)?;
    check_rig(global, &scene)?;
    Ok(scene)
}

fn check_rig(global: &Global, scene: &Scene) -> Result<(), Failure> {
    for unusual in scene.check_rig().map_err(|error| error.in_file(&global.scene))? {
        eprintln!("warning: scene file {}: {unusual}", global.scene.display());
    }
    Ok(())
}
