//! The command `mms`: arguments in, tables and JSON out. What is measured, and how, is the business of
//! `mmsmith-verify`; nothing here computes with fields.
//!
//! Exit status: 0 done, and whatever was checked passed; 1 a check failed; 2 bad input, or output that could not
//! be written.

mod arguments;
mod commands;
mod csv;
mod expect;
mod json;
mod keep;
mod library;
mod machine;
mod memory;
mod number;
mod progress;
mod svg;
mod table;
mod terminal;

use std::process::ExitCode;

use clap::Parser;

use arguments::{Arguments, Command};

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let outcome = match &arguments.command {
        Command::List(options) => commands::list(options),
        Command::Check(options) => commands::check(options),
        Command::Explain(options) => commands::explain(options),
        Command::Coverage(options) => commands::coverage(options),
        Command::Eval(options) => commands::eval(options),
        Command::Run(options) => commands::run(options),
        Command::Resume(options) => commands::resume(options),
        Command::Converge(options) => commands::converge(options),
        Command::Stability(options) => commands::stability(options),
        Command::Score(options) => commands::score(options),
        Command::Tradeoff(options) => commands::tradeoff(options),
        Command::Reproduce(options) => commands::reproduce(options),
    };
    match outcome {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(error) => {
            // A diagnostic is laid out as a whole already.
            match error.downcast_ref::<mmsmith_spec::Diagnostic>() {
                Some(diagnostic) => terminal::complain(&format!("{diagnostic}\n")),
                None => terminal::complain(&format!("error: {error:#}\n")),
            }
            ExitCode::from(2)
        }
    }
}
