//! The command `mms` as a library: arguments in, tables and JSON out. What is measured, and how, is the business of
//! `mmsmith-verify`; nothing here computes with fields.
//!
//! Exit status: 0 done, and whatever was checked passed; 1 a check failed; 2 bad input, or output that could not
//! be written; 130 interrupted.
//!
//! The libraries under it, in the order in which a specification meets them: [`mmsmith_spec`] reads and derives it,
//! [`mmsmith_expr`] holds its expressions, [`mmsmith_stage`] decides what is computed when, [`mmsmith_codegen`] writes code, [`mmsmith_solutions`] holds that code,
//! [`mmsmith_interpret`] does without it, [`mmsmith_prove`] and [`mmsmith_oracle`] judge both, `mmsmith-mpm` simulates,
//! [`mmsmith_verify`] measures, [`mmsmith_vtk`] and [`mmsmith_ledger`] read and write files. The book in `docs/` has a guide, a
//! reference and a map of the code.

mod arguments;
mod commands;
mod csv;
mod expect;
mod html;
mod input;
mod interruption;
mod json;
mod keep;
mod library;
mod machine;
mod memory;
mod npy;
mod number;
mod progress;
mod svg;
mod table;
mod terminal;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::FromArgMatches;

use arguments::{Arguments, Command, color_of, line};
use interruption::{INTERRUPTED, is_interrupted};

pub use interruption::end_on_signals;

/// Does what a command line asks for; its first word is the program's name.
///
/// Results go to standard output, messages to standard error. A command line that makes no sense, and one that asks for help, ends
/// the process.
#[must_use]
pub fn run(given: impl IntoIterator<Item = OsString>) -> ExitCode {
    let given: Vec<_> = given.into_iter().collect();
    let arguments = line()
        .color(color_of(&given).into())
        .try_get_matches_from(given.clone())
        .and_then(|matches| Arguments::from_arg_matches(&matches))
        .unwrap_or_else(|refusal| refusal.exit());
    terminal::settle(arguments.talk.verbosity(), arguments.talk.color);
    terminal::detail(format_args!("mms {}", env!("CARGO_PKG_VERSION")));
    let outcome = match &arguments.command {
        Command::List(options) => commands::list(options),
        Command::Check(options) => commands::check(options),
        Command::Certify(options) => commands::certify(options),
        Command::Explain(options) => commands::explain(options),
        Command::Coverage(options) => commands::coverage(options),
        Command::Gen(options) => commands::generate(options),
        Command::Eval(options) => commands::eval(options),
        Command::Run(options) => commands::run(options, &given),
        Command::Resume(options) => commands::resume(options),
        Command::Converge(options) => commands::converge(options),
        Command::Stability(options) => commands::stability(options),
        Command::Score(options) => commands::score(options),
        Command::Tradeoff(options) => commands::tradeoff(options),
        Command::Reproduce(options) => commands::reproduce(options),
        Command::Completions(options) => commands::completions(options),
        Command::Man(options) => commands::man(options),
        Command::Reference => commands::reference(),
    };
    match outcome {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(error) => {
            // A diagnostic is laid out as a whole already.
            match error.downcast_ref::<mmsmith_spec::Diagnostic>() {
                Some(diagnostic) => terminal::complain(&format!("{diagnostic}\n")),
                None => terminal::error(format_args!("{error:#}")),
            }
            ExitCode::from(if is_interrupted(&error) { INTERRUPTED } else { 2 })
        }
    }
}
