//! `tsa-lab`: see the library.

use clap::CommandFactory;

fn main() -> std::process::ExitCode {
    rigctl::started(lab::cli::Cli::command(), std::env::args_os(), |cli: &lab::cli::Cli| &cli.global, lab::cli::run)
}
