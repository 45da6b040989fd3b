//! `tsa-lab`: see the library.

use clap::CommandFactory;
use lab::cli::{Cli, GROUPS, run};
use rigctl::help::grouped;

fn main() -> std::process::ExitCode {
    rigctl::started(grouped(Cli::command(), &GROUPS), std::env::args_os(), |cli: &Cli| &cli.global, run)
}
