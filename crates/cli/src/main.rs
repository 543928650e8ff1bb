//! The program `mms`.

use std::process::ExitCode;

fn main() -> ExitCode {
    mmsmith_cli::end_on_signals();
    mmsmith_cli::run(std::env::args_os()).into()
}
