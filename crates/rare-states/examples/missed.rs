//! Says how many processes have met each rare state, by the files of a folder; ends with 1 where no process has met one.

#![allow(clippy::print_stdout)]

use std::path::PathBuf;
use std::process::ExitCode;

fn main() -> Result<ExitCode, std::io::Error> {
    let folder = PathBuf::from(std::env::args_os().nth(1).unwrap_or_default());
    let counts = mmsmith_rare_states::counts(&folder)?;
    for (state, count) in &counts {
        println!("{:>6} processes have met: {}", count, state.name());
    }
    Ok(ExitCode::from(u8::from(counts.iter().any(|(_, count)| *count == 0))))
}
