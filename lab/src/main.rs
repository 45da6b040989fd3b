//! `tsa-lab`: see the library.

fn main() -> std::process::ExitCode {
    rigctl::started(std::env::args_os(), |cli: &lab::cli::Cli| &cli.global, lab::cli::run)
}
