//! `loop`: what a cheaper model, or a less accurate table, does in the closed loop. The emulated board is sent each table under the
//! scene's own name; then it homes and moves two loads.

use rig_link::{Fault, State};
use rigctl::csv_text::named;
use rigctl::failure::Failure;
use rigctl::options::Global;
use rigctl::out_file::write_file;
use rigctl::output::Output;
use rigctl::play::play;
use rigctl::script::Script;
use rigctl::session::row::Row;
use rigctl::session::{Place, Target, Wanted};
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;
use std::path::PathBuf;
use tsa_model::Tier;
use tsa_table::{Accuracy, TableSpec};

/// Name, tier, and accuracy of the table's fit to that tier: contraction (m) and TR.
const VARIANTS: [(&str, Tier, [f64; 2]); 10] = [
    ("rigid", Tier::Rigid, [5e-6, 2e-3]),
    ("beam-column", Tier::BeamColumn, [5e-6, 2e-3]),
    ("pseudo-rigid", Tier::PseudoRigid, [5e-6, 2e-3]),
    ("elastica", Tier::Elastica, [5e-6, 2e-3]),
    ("inextensible", Tier::Inextensible, [5e-6, 2e-3]),
    ("full", Tier::Full, [5e-6, 2e-3]),
    ("full, 24 µm", Tier::Full, [24e-6, 5e-3]),
    ("full, 100 µm", Tier::Full, [100e-6, 2e-2]),
    ("full, 1 mm", Tier::Full, [1e-3, 0.2]),
    ("full, 2 µm", Tier::Full, [2e-6, 1e-3]),
];
const LOADS: [&str; 2] = ["0.5kg", "1.5kg"];
const SCRIPT: &str = "2.5 home\n47 move 12mm speed=2mm/s\n55.5 move 2mm speed=2mm/s\n63 move 9mm speed=2mm/s\n69 end\n";
/// When homing has ended at the latest (s).
const HOMED_S: f64 = 46.0;

/// `tsa-lab loop`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folder for loop.csv
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
}

/// Result of one run, a line of `loop.csv`; `None` where nothing was moved or estimated.
#[derive(Debug, Default, Deserialize, Serialize)]
pub struct Outcome {
    /// Name of the table.
    pub variant: String,
    /// Load, with its unit.
    pub load: String,
    /// Error while moving, rms and most (m).
    pub rms_m: Option<f64>,
    /// See above.
    pub max_m: Option<f64>,
    /// Error at rest (m).
    pub rest_m: Option<f64>,
    /// Error of the load that was found.
    pub load_relative_error: Option<f64>,
    /// Instructions of a tick.
    pub instructions_mean: f64,
    /// See above.
    pub instructions_max: f64,
    /// The first fault.
    pub fault: Option<String>,
}

impl Outcome {
    /// One row more; `squares` sums the squared errors under way, and counts them.
    fn take(&mut self, row: &Row, squares: &mut (f64, u32)) {
        let refused = row.state == State::Unhomed && row.t_s > HOMED_S;
        let fault = row.fault.map(Fault::name).or(refused.then_some("homing refused"));
        self.fault = self.fault.take().or(fault.map(str::to_owned));
        if let (Some(set_m), Some(position_m)) = (row.setpoint_m, row.true_position_m) {
            let error_m = position_m - f64::from(set_m);
            if row.state == State::Moving {
                *squares = (squares.0 + error_m * error_m, squares.1 + 1);
                self.max_m = Some(self.max_m.unwrap_or(0.0).max(error_m.abs()));
            }
            self.rest_m = Some(error_m);
        }
        if let (Some(found_n), Some(truth_n)) = (row.load_n, row.true_load_n) {
            self.load_relative_error = Some(f64::from(found_n) / truth_n - 1.0);
        }
    }

    /// For people.
    pub fn text(&self) -> String {
        let shown = |value: Option<f64>, unit: f64| value.map_or("-".into(), |value| format!("{:.1}", value * unit));
        format!(
            "{:<14} {}: tracking {} µm rms, {} µm at most; at rest {} µm; load {} %; {:.0} instructions a tick, {:.0} at most{}",
            self.variant,
            self.load,
            shown(self.rms_m, 1e6),
            shown(self.max_m, 1e6),
            shown(self.rest_m, 1e6),
            shown(self.load_relative_error, 1e2),
            self.instructions_mean,
            self.instructions_max,
            self.fault.as_ref().map_or(String::new(), |fault| format!("; {fault}"))
        )
    }
}

impl Arguments {
    /// Runs the command.
    ///
    /// # Errors
    /// If a variant has no table, the emulated board does not start, or the folder cannot be written.
    pub fn run(&self, global: &Global, output: &mut Output) -> Result<(), Failure> {
        let scene = global.scene()?;
        let script = Script::parse(SCRIPT).map_err(Failure::failed)?;
        let (mechanism, table_spec) = (scene.mechanism()?, scene.table_spec()?);
        let mut outcomes = Vec::new();
        for (variant, tier, [contraction_m, tr_relative]) in VARIANTS {
            let accuracy = Accuracy { contraction_m, tr_relative };
            let fit = tsa_table::fit::fit_tier(&mechanism, &TableSpec { accuracy, ..table_spec }, tier)?;
            for load in LOADS {
                let mut target = global.target()?;
                let Place::Emulated(options) = &mut target.place else {
                    return Err(Failure::Usage("loop: only on an emulated board, --port sim".into()));
                };
                // What a table does is told best by a rig that has nothing else.
                options.rig = Some(rig_plant::RigPreset::Ideal);
                options.plant.push(format!("load={load}").parse()?);
                let (target, _flash) = target.with_table(&fit.table.table())?;
                let outcome = measure(&target, &script, variant, load)?;
                output.object(&outcome)?;
                output.line(outcome.text())?;
                outcomes.push(outcome);
            }
        }
        write_file(&self.out, "loop.csv", &named(outcomes)?)?;
        output.line(format!("written: loop.csv in {}", self.out.display()))?;
        Ok(())
    }
}

fn measure(target: &Target, script: &Script, variant: &str, load: &str) -> Result<Outcome, Failure> {
    let mut session = target.connect(Wanted::FromItsStart)?;
    let (mut outcome, mut squares) =
        (Outcome { variant: variant.into(), load: load.into(), ..Outcome::default() }, (0.0, 0));
    play(&mut session, script, 1, |session, _| {
        session.take_rows().iter().for_each(|row| outcome.take(row, &mut squares));
        Ok(ControlFlow::Continue(()))
    })?;
    outcome.rms_m = (squares.1 > 0).then(|| (squares.0 / f64::from(squares.1)).sqrt());
    if let Some(emulated) = session.emulated() {
        let stats = emulated.stats()?;
        outcome.instructions_mean = stats.instructions_per_tick_mean;
        outcome.instructions_max = stats.instructions_per_tick_max;
    }
    Ok(outcome)
}
