//! `rigctl`: see the library.

fn main() -> std::process::ExitCode {
    rigctl::run(std::env::args_os())
}
