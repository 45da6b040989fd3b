//! The command line of `tsa-lab`. Each command carries its own arguments and its own `run`; options of every command are those of
//! `rigctl`.

use crate::{bench, budget, chart, closed_loop, page, published, solve, study, table_report};
use clap::{Parser, Subcommand};
use rigctl::commands::identify::Identify;
use rigctl::commands::solve::Solve;
use rigctl::failure::Failure;
use rigctl::help::Group;
use rigctl::options::{Global, no_effect};
use rigctl::output::Output;

/// The commands, grouped by what one wants to do.
pub const GROUPS: [Group; 4] = [
    ("Paper", &["published", "identify", "study"]),
    ("Model and table", &["solve", "table"]),
    ("Accuracy and speed", &["budget", "chart", "loop"]),
    ("Page", &["report"]),
];

/// The laboratory of a twisted-string actuator: methods, tables and models compared, the paper's numbers, error budget, figures.
///
/// Lengths, speeds and loads take units (12mm, 2mm/s, 0.5kg, 4.9N); a bare number is SI.
#[derive(Debug, Parser)]
#[command(name = "tsa-lab", version)]
pub struct Cli {
    /// Options of every command.
    #[command(flatten)]
    pub global: Global,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Print the paper's numbers beside the same numbers computed for the scene
    Published(published::Arguments),
    /// Vary one value of the scene and print contraction and TR for each
    ///
    /// Example: `tsa-lab study --vary D0=8mm..32mm:5 --out out`
    Study(study::Arguments),
    /// Draw speed against accuracy of every method, tier and table, and where they fail
    Chart(chart::Arguments),
    /// Move the emulated board with tables of cheaper models and of other accuracies
    ///
    /// Writes loop.csv.
    Loop(closed_loop::Arguments),
    /// Write one interactive HTML page: mechanism, solver, table, charts, a recorded move
    ///
    /// The page has the solver inside and needs no network; any browser shows it. What cannot be made (a chart that another
    /// command measures, a move without firmware) is named on standard error and in the page.
    /// Example: `tsa-lab report --out out/report.html`
    Report(page::Arguments),
    /// Print what limits the accuracy of position and load, and the table that is enough
    ///
    /// Computed from the scene, the model's sensitivities and the sizes of --rig (docs/explanation/accuracy.md);
    /// nothing is emulated. 90 % uncertainties over actuators of the kind and states of the scene's envelope. With --json one
    /// object a part: part, position_m, load_relative.
    /// Example: `tsa-lab budget --rig hard`
    Budget(budget::report::Arguments),
    /// Fit the scene's table, print its error bounds and why this one was chosen
    Table(table_report::Arguments),
    /// Solve one equilibrium by any method or tier, or one for each row of a file
    ///
    /// Example: `tsa-lab solve --load 0.5kg --turns 3 --method paper`
    Solve(Solve),
    /// What an equilibrium costs, for `cargo xtask bench`
    #[command(hide = true, subcommand)]
    Bench(bench::Task),
    /// Fit the scene's constants to the paper's numbers, or to recorded sweeps as `rigctl` does
    Identify(Identify),
}

/// Runs the command.
///
/// # Errors
/// [`Failure`], with the exit code in its kind.
pub fn run(cli: &Cli, output: &mut Output) -> Result<(), Failure> {
    let global = &cli.global;
    rig_options(global, &cli.command)?;
    match &cli.command {
        Command::Published(arguments) => arguments.run(global, output),
        Command::Study(arguments) => arguments.run(global, output),
        Command::Loop(arguments) => arguments.run(global, output),
        Command::Chart(arguments) => arguments.run(global, output),
        Command::Report(arguments) => arguments.run(global, output),
        Command::Budget(arguments) => arguments.run(global, output),
        Command::Table(arguments) => arguments.run(global, output),
        Command::Solve(options) => solve::run(global, options, output),
        Command::Bench(task) => task.run(output),
        Command::Identify(options) => published::identify::run(global, options, output),
    }
}

/// Prints which options of a rig have no effect; the page is always made on the emulated board.
fn rig_options(global: &Global, command: &Command) -> Result<(), Failure> {
    let port = global.given_device().is_some();
    let given = || [(port, "--port")].into_iter().chain(global.of_emulated_board());
    match command {
        Command::Report(_) if port => {
            return Err(Failure::Usage(format!(
                "--port {}: this command is always on the emulated board; `rigctl play` takes a script to a rig",
                global.port()
            )));
        }
        Command::Report(_) | Command::Bench(_) => {}
        Command::Budget(arguments) if !arguments.all => {
            no_effect(given().filter(|(_, name)| *name != "--rig"), "the budget is computed, and asks for --rig alone");
        }
        Command::Budget(_) => no_effect(given(), "the budgets of all kinds of rigs are computed"),
        _ => no_effect(given(), "this command uses no rig"),
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::{Cli, GROUPS};
    use clap::CommandFactory;

    #[test]
    fn the_page_about_commands_has_their_table() {
        let tool = Cli::command();
        let listed = GROUPS.iter().map(|(_, names)| names.len()).sum::<usize>();
        assert_eq!(listed, tool.get_subcommands().filter(|command| !command.is_hide_set()).count());
        let table = rigctl::help::table(&tool, &GROUPS);
        assert!(include_str!("../../docs/reference/cli.md").contains(&table), "docs/reference/cli.md lacks:\n{table}");
    }
}
