//! `play` and `record`: a script and its telemetry, on the emulated board or on a real one, printed or written down with
//! everything that is needed to run the experiment again.

use crate::board_settings;
use crate::failure::Failure;
use crate::log::write::event;
use crate::log::{Ended, Header, Recorder};
use crate::options::Global;
use crate::options::values::of;
use crate::out_file::OutFile;
use crate::output::{Output, at, stdout};
use crate::play::{check_refused, play};
use crate::script::Script;
use crate::session::row::Entry;
use crate::session::sim::SimOptions;
use crate::session::{Session, Wanted};
use crate::units::{NUMBER, PERCENT, Quantity, S};
use clap::Args;
use rig_link::SettingsReport;
use serde_json::{Map, Value, json};
use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Instant;

/// People get a line every this many seconds; `--json` prints every telemetry message.
const HUMAN_INTERVAL_S: f64 = 0.25;

/// Play a script at the port and print telemetry
///
/// On the emulated board the script's time is the time since the board's start; on a real rig it is the time since the
/// script's start, and changes of the plant and faults are announced, to be made by hand. Commands wait until the board
/// has started. Exit code 1 if a command was refused; the last line counts them.
/// Example: `rigctl play scenarios/example.script`
#[derive(Debug, Args)]
pub struct Play {
    /// Events, one a line: `<seconds> <event>`, the last `<seconds> end` [default: none, for --seconds]
    #[arg(value_name = "FILE")]
    file: Option<PathBuf>,
    /// The same file as an option
    #[arg(long, value_name = "FILE", conflicts_with = "file")]
    script: Option<PathBuf>,
    /// How long to run without a script (s)
    #[arg(long, value_name = "S", default_value = "5s", allow_hyphen_values = true, value_parser = of("seconds", Quantity::Time),
        conflicts_with_all = ["file", "script"])]
    seconds: f64,
}

impl Play {
    /// Plays the script, or lets `seconds` pass without one.
    ///
    /// # Errors
    /// If the script is wrong, nobody answers, the port fails, or a command of the script was refused.
    pub fn run(&self, global: &Global, output: &mut Output) -> Result<(), Failure> {
        let seconds = self.seconds;
        let script = match self.file.as_ref().or(self.script.as_ref()) {
            Some(path) => Script::load(path)?.0,
            None if seconds > 0.0 && seconds.is_finite() => Script::idle(seconds),
            None => return Err(Failure::Usage(format!("--seconds {seconds}: must be above 0"))),
        };
        let (target, _flash) = global.target()?.with_its_table()?;
        // On an emulated board the script's time is the time since its start.
        let wanted = if global.is_emulated() { Wanted::FromItsStart } else { Wanted::OfScene };
        let mut session = target.connect(wanted)?;
        let started = Instant::now();
        let mut printer = Printer { next_line_s: 0.0, settings: None };
        let refused = play(&mut session, &script, global.board.seed, |session, messages| {
            messages.iter().for_each(|line| crate::output::say!("{line}"));
            printer.print(session, output)?;
            Ok(ControlFlow::Continue(()))
        })?;
        if let Some(options) = target.emulated() {
            summary(&mut session, started.elapsed().as_secs_f64(), options, output)?;
        }
        check_refused(refused)
    }
}

/// Prints what has passed since the last step.
struct Printer {
    next_line_s: f64,
    settings: Option<SettingsReport>,
}

impl Printer {
    fn print(&mut self, session: &mut Session, output: &mut Output) -> Result<(), Failure> {
        for row in session.take_rows() {
            output.object(&row)?;
            if !output.json() && row.t_s >= self.next_line_s {
                output.line(row.text())?;
                self.next_line_s = row.t_s + HUMAN_INTERVAL_S;
            }
        }
        for (t_s, kind) in session.take_events() {
            output.line(format!("{}  event {}", at(t_s), event(&kind)))?;
        }
        // They are unknown between a start of the board and its first report.
        let known = session.known_settings().copied();
        if let (true, Some(report)) = (known != self.settings, known) {
            let values = board_settings::all(&report.values);
            output.line(format!("{}  settings {values} {}", at(session.now_s()), report.kept))?;
        }
        self.settings = known;
        for line in session.take_log() {
            output.line(format!("           log {line}"))?;
        }
        Ok(())
    }
}

/// What the run cost on the emulated board. The instructions of a real board are not counted.
fn summary(session: &mut Session, wall_s: f64, options: &SimOptions, output: &mut Output) -> Result<(), Failure> {
    let emulated_s = session.now_s();
    let settings = session.known_settings().map(|report| board_settings::all(&report.values));
    let Some(emulated) = session.emulated() else { return Ok(()) };
    let stats = emulated.stats()?;
    output.object(&json!({"summary": {
        "instructions_per_tick_mean": stats.instructions_per_tick_mean,
        "instructions_per_tick_max": stats.instructions_per_tick_max,
        "core_busy": stats.core_busy,
        "plant_tier": stats.plant_tier,
        "realtime_factor": emulated_s / wall_s,
        "rig": options.preset().name(),
        "seed": options.seed,
        "settings": settings,
        "stack_high_water_bytes": stats.stack_high_water_bytes,
    }}))?;
    output.line(format!(
        "{} emulated in {}; control tick {} instructions mean, {} at most; core busy {}; \
         stack {} bytes; {options}; the plant by the {} model, the cheapest that the scene needs",
        S.show(emulated_s),
        S.show(wall_s),
        NUMBER.exact(stats.instructions_per_tick_mean.round()),
        NUMBER.exact(stats.instructions_per_tick_max),
        PERCENT.show(stats.core_busy),
        stats.stack_high_water_bytes,
        stats.plant_tier,
    ))?;
    Ok(())
}

/// What to record, and the file.
#[derive(Debug, Clone, Args)]
pub struct Record {
    /// File to write [default: standard output]
    #[arg(long, value_name = "FILE.csv")]
    pub out: Option<PathBuf>,
    /// How long to record without a script (s)
    #[arg(long, value_name = "S", default_value = "10s", allow_hyphen_values = true, value_parser = of("seconds", Quantity::Time),
        conflicts_with = "script")]
    pub seconds: f64,
    /// Play this script meanwhile (format as for `play`); exit code 1 if a command of it was refused
    #[arg(long, value_name = "FILE")]
    pub script: Option<PathBuf>,
}

/// Plays a script, or lets time pass, and writes down everything that passes.
///
/// # Errors
/// If the script or the file is wrong, nobody answers, the port fails, or a command of the script was refused.
pub fn record(global: &Global, options: &Record, output: &mut Output) -> Result<(), Failure> {
    let seconds = options.seconds;
    if !(seconds > 0.0 && seconds.is_finite()) {
        return Err(Failure::Usage(format!("--seconds {seconds}: must be above 0")));
    }
    let (script, text) = options.script.as_deref().map(Script::load).transpose()?.unzip();
    let out = options.out.as_deref().map(OutFile::new).transpose()?;
    let target = global.target()?;
    let mut session = target.connect(Wanted::OfScene)?;
    let mut head = Header::new(&target, &session, "record")?;
    if let Some(path) = &options.script {
        head.add("script", path.display());
    }
    for (number, line) in (1..).zip(text.iter().flat_map(|text| text.lines())) {
        head.add(&format!("script.{number}"), line);
    }
    if output.json() && options.out.is_none() {
        let facts: Map<String, Value> = head.0.iter().map(|(k, v)| (k.clone(), Value::from(v.as_str()))).collect();
        output.object(&json!({"header": facts}))?;
    }
    let sink: Box<dyn Write> = match out {
        Some(file) => file.begin()?,
        None if output.json() => Box::new(io::sink()),
        None => stdout(),
    };
    let passed = session.watch();
    let mut recorder = Recorder::new(sink, &head, passed, &session)?;
    let script = script.unwrap_or_else(|| Script::idle(session.now_s() + seconds));
    let rows_out = output.json() && options.out.is_none();
    let result = play(&mut session, &script, global.board.seed, |session, messages| {
        messages.iter().for_each(|line| crate::output::say!("{line}"));
        for entry in recorder.take()? {
            if let (Entry::Row(row), true) = (entry, rows_out) {
                output.object(&row)?;
            }
        }
        // The recorder has them all; here they would only accumulate.
        session.take_rows();
        session.take_events();
        session.take_log();
        Ok(ControlFlow::Continue(()))
    });
    let (Ended { rows, lost_rows: lost, lost_frames }, refused) = recorder.end(&session, result)?;
    let summary = json!({"rows": rows, "lost_rows": lost, "lost_frames": lost_frames, "seconds": session.now_s(),
        "file": options.out.as_ref().map(|p| p.display().to_string())});
    output.object(&json!({"summary": summary}))?;
    if let Some(path) = &options.out {
        output.line(format!("{rows} rows, {lost} rows lost on the way; written: {}", path.display()))?;
    }
    check_refused(refused)
}
