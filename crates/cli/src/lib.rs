//! The command `mms` as a library: arguments in, tables and JSON out. What is measured, and how, is the business of
//! `mmsmith-verify`; nothing here computes with fields.
//!
//! Exit status: 0 done, and whatever was checked passed; 1 a check failed; 2 bad input, or output that could not
//! be written; 130 interrupted.
//!
//! The libraries under it, in the order in which a specification meets them: [`mmsmith_spec`] reads and derives it,
//! [`mmsmith_expr`] holds its expressions, [`mmsmith_stage`] decides what is computed when, [`mmsmith_codegen`] writes code, [`mmsmith_solutions`] holds that code,
//! [`mmsmith_interpret`] does without it, [`mmsmith_claims`] and [`mmsmith_oracle`] judge both, `mmsmith-mpm` simulates,
//! [`mmsmith_verify`] measures, [`mmsmith_vtk`] and [`mmsmith_ledger`] read and write files. The book in `docs/` has a guide, a
//! reference and a map of the code.

mod arguments;
mod checksum;
mod commands;
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
mod processes;
mod progress;
mod report;
mod sheets;
mod svg;
mod table;
mod terminal;
mod units;

use std::ffi::OsString;
use std::sync::Arc;

use clap::FromArgMatches;

use arguments::{Arguments, Command, color_of, line};
use interruption::{INTERRUPTED, is_interrupted};

pub use interruption::end_on_signals;
pub use progress::{Report, Watch};

/// Does what a command line asks for; its first word is the program's name. Gives the exit status.
///
/// Results go to standard output, messages to standard error. A command line that makes no sense, and one that asks for help, ends
/// the process.
#[must_use]
pub fn run(given: impl IntoIterator<Item = OsString>) -> u8 {
    let given: Vec<_> = given.into_iter().collect();
    // Of several processes the first one speaks.
    let joined = processes::join();
    let arguments = read(&given).unwrap_or_else(|refusal| {
        if processes::is_first() {
            terminal::show_refusal(&refusal, color_of(&given));
        }
        processes::leave();
        std::process::exit(refusal.exit_code())
    });
    if processes::is_first() {
        terminal::settle(arguments.talk.verbosity(), arguments.talk.color);
    } else {
        terminal::silence();
    }
    terminal::detail(format_args!("mms {}", env!("MMS_VERSION")));
    let outcome = joined
        .and_then(|()| processes::admit(&arguments.command))
        .and_then(|()| perform(&arguments, &given));
    match outcome {
        Ok(passed) => {
            processes::leave();
            u8::from(!passed)
        }
        Err(error) => {
            // A diagnostic is laid out as a whole already.
            match error.downcast_ref::<mmsmith_spec::Diagnostic>() {
                _ if !processes::is_first() => {}
                Some(diagnostic) => terminal::show(diagnostic),
                None => terminal::error(format_args!("{error:#}")),
            }
            let status = if is_interrupted(&error) { INTERRUPTED } else { 2 };
            processes::fail(&message(&error), status);
            status
        }
    }
}

/// As [`run`], for programs that call it as a function: nothing is printed from then on, and the process goes on. Results are in
/// the files that the command line names, and how far the work is in `watch`. True unless a check failed.
///
/// # Errors
///
/// [`Refusal`] where [`run`] would end with the status 2 or 130.
pub fn call(
    given: impl IntoIterator<Item = OsString>,
    watch: &Arc<Watch>,
) -> Result<bool, Refusal> {
    terminal::silence();
    let given: Vec<_> = given.into_iter().collect();
    let arguments = read(&given).map_err(|refusal| {
        let text = refusal.render().to_string();
        Refusal::Failed(text.trim_start_matches("error: ").trim_end().to_owned())
    })?;
    watch.over(|| perform(&arguments, &given)).map_err(|error| match is_interrupted(&error) {
        true => Refusal::Interrupted,
        false => Refusal::Failed(message(&error)),
    })
}

/// Why [`call`] did not do what was asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The message that [`run`] prints.
    Failed(String),
    /// [`mmsmith_verify::interrupt`] was called.
    Interrupted,
}

/// The specification of the solution called `name`, or the one in the file `name`: looked for where all commands look.
///
/// # Errors
///
/// The message where there is none, or it cannot be read.
pub fn specification(name: &str) -> Result<mmsmith_spec::Spec, String> {
    library::specification(name).map_err(|error| message(&error))
}

/// The names of all solutions that can be found without a path.
#[must_use]
pub fn solutions() -> Vec<String> {
    library::names()
}

/// An error with its causes, or a diagnostic as it is laid out.
fn message(error: &anyhow::Error) -> String {
    format!("{error:#}").trim_start_matches("error: ").to_owned()
}

fn read(given: &[OsString]) -> Result<Arguments, clap::Error> {
    line()
        .color(color_of(given).into())
        .term_width(terminal::columns_of_help())
        .try_get_matches_from(given)
        .and_then(|matches| Arguments::from_arg_matches(&matches))
}

fn perform(arguments: &Arguments, given: &[OsString]) -> anyhow::Result<bool> {
    match &arguments.command {
        Command::List(options) => commands::list(options),
        Command::Check(options) => commands::check(options),
        Command::Certify(options) => commands::certify(options),
        Command::Explain(options) => commands::explain(options),
        Command::Coverage(options) => commands::coverage(options),
        Command::Gen(options) => commands::generate(options),
        Command::Eval(options) => commands::eval(options),
        Command::Run(options) => commands::run(options, given),
        Command::Resume(options) => commands::resume(options),
        Command::Converge(options) => commands::converge(options),
        Command::Stability(options) => commands::stability(options),
        Command::Batch(options) => commands::batch(options),
        Command::Score(options) => commands::score(options),
        Command::Diagnose(options) => commands::diagnose(options),
        Command::Tradeoff(options) => commands::tradeoff(options),
        Command::Reproduce(options) => commands::reproduce(options),
        Command::Doctor(options) => commands::doctor(options),
        Command::Serve(options) => commands::serve(options),
        Command::Completions(options) => commands::completions(options),
        Command::Man(options) => commands::man(options),
        Command::Reference(options) => commands::reference(options),
    }
}
