//! The command line.

mod batch;
mod certify;
mod check;
mod converge;
mod coverage;
mod diagnose;
mod doctor;
mod eval;
mod explain;
mod generate;
mod help;
mod list;
mod reproduce;
mod resume;
mod run;
mod scheme;
mod score;
mod serve;
mod shared;
mod stability;
mod statics;
mod texts;
mod tradeoff;
mod values;

use std::any::TypeId;
use std::ffi::OsString;
use std::path::PathBuf;

use clap::{Arg, Args, CommandFactory, Parser, Subcommand, ValueEnum};

use crate::terminal::{Color, Verbosity};

pub(crate) use batch::{BatchOptions, BatchSystem};
pub(crate) use certify::CertifyOptions;
pub(crate) use check::CheckOptions;
pub(crate) use converge::ConvergeOptions;
pub(crate) use coverage::CoverageOptions;
pub(crate) use diagnose::DiagnoseOptions;
pub(crate) use doctor::DoctorOptions;
pub(crate) use eval::EvalOptions;
pub(crate) use explain::ExplainOptions;
pub(crate) use generate::GenerateOptions;
pub(crate) use help::examples;
pub(crate) use list::ListOptions;
pub(crate) use reproduce::ReproduceOptions;
pub(crate) use resume::ResumeOptions;
pub(crate) use run::{PictureOptions, RunOptions, Stress};
pub(crate) use scheme::{HighDegree, Layout, Precision, SchemeOptions, Weights};
pub(crate) use score::ScoreOptions;
pub(crate) use serve::ServeOptions;
pub(crate) use shared::KeepOptions;
pub(crate) use stability::StabilityOptions;
pub(crate) use statics::StaticOptions;
pub(crate) use texts::{CompletionsOptions, ManOptions, ReferenceOptions};
pub(crate) use tradeoff::TradeoffOptions;
pub(crate) use values::ProcessGrid;

/// Manufactured solutions for solid mechanics: check fields, run a material point solver, measure its order.
#[derive(Parser)]
#[command(name = "mms", version = env!("MMS_VERSION"))]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub(crate) talk: TalkOptions,
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// How much is said, for every command.
#[derive(Args, Clone, Copy)]
#[command(next_help_heading = "Messages")]
pub(crate) struct TalkOptions {
    /// Results and errors only: no progress, no warnings, no notes
    #[arg(long, short, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Tell on standard error the version, the settings in full, and what was found where
    #[arg(long, short, global = true)]
    verbose: bool,
    /// Colours of messages
    #[arg(long, global = true, value_enum, default_value_t = Color::Auto, value_name = "WHEN")]
    pub(crate) color: Color,
}

impl TalkOptions {
    /// How much is said.
    pub(crate) fn verbosity(self) -> Verbosity {
        match (self.quiet, self.verbose) {
            (true, _) => Verbosity::Quiet,
            (false, true) => Verbosity::Verbose,
            (false, false) => Verbosity::Usual,
        }
    }
}

/// A value as the command line writes it.
pub(crate) fn word(value: impl ValueEnum) -> String {
    value.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

/// The colours that a command line asks for, before the whole of it is understood: messages on what is wrong with it
/// have them too.
pub(crate) fn color_of(arguments: &[OsString]) -> Color {
    let words = || arguments.iter().map(|word| word.to_string_lossy());
    let joined = words().filter_map(|word| word.strip_prefix("--color=").map(str::to_owned));
    let parted = words().zip(words().skip(1)).filter(|(option, _)| option == "--color");
    joined
        .chain(parted.map(|(_, value)| value.into_owned()))
        .find_map(|value| Color::from_str(&value, false).ok())
        .unwrap_or(Color::Auto)
}

#[derive(Subcommand)]
pub(crate) enum Command {
    /// List the solutions: dimension, law, boundary conditions
    List(ListOptions),
    /// Describe a solution: its formulas, the terms of the momentum balance that it tests, the cost of a run
    Explain(ExplainOptions),
    /// Tabulate the terms of the momentum balance that each solution tests, and name the fewest solutions that test all
    Coverage(CoverageOptions),
    /// Check every field by numerical differentiation: v against du/dt, F against du/dX, b against a - Div P/rho0
    Check(CheckOptions),
    /// Prove bounds of the rounding errors of every field over a range of inputs, or check such a certificate (--check FILE)
    Certify(CertifyOptions),
    /// Write the fields of a solution in the language of a host code
    Gen(GenerateOptions),
    /// Evaluate the exact fields at given points
    Eval(EvalOptions),
    /// Run one simulation and measure its errors
    Run(RunOptions),
    /// Continue a run that was stopped or killed from its last checkpoint, to the same bits
    Resume(ResumeOptions),
    /// Measure orders of accuracy over grids (--cells 16,32,64) or time steps (--cells 32 --cfls 0.1,0.2,0.4)
    Converge(ConvergeOptions),
    /// Find the largest stable CFL number by bisection, over one or two settings or parameters
    Stability(StabilityOptions),
    /// Measure error against cost over all schemes that fit, and name the cheapest setting for an error
    Tradeoff(TradeoffOptions),
    /// Measure errors and orders of another solver from its output files
    Score(ScoreOptions),
    /// Find the mistake in a solver whose errors do not fall, by fields that have the opposite mistake
    Diagnose(DiagnoseOptions),
    /// Write the script that runs a study in shards, or a run, on a cluster
    Batch(BatchOptions),
    /// Repeat the study of Wallstedt and Guilkey on both of its problems, with a report, tables, data and particle files
    Reproduce(ReproduceOptions),
    /// Look whether this machine gives the published bits of small runs, and what makes runs slow here
    Doctor(DoctorOptions),
    /// Serve programs that speak the model context protocol: list, explain, check, derive, gen, score and diagnose as tools
    Serve(ServeOptions),
    /// Write the script that completes commands, options and names of solutions in a shell
    Completions(CompletionsOptions),
    /// Write the manual pages
    Man(ManOptions),
    /// Write the whole command line as Markdown
    #[command(hide = true)]
    Reference(ReferenceOptions),
}

/// Where solutions are found, for the help and the book.
const WHERE: &str = "\
A solution is given by its name or by a path. A path ends in .toml or has a separator: the solution is the specification in this file. A \
name is looked for in this order: as NAME.toml in mms-specs of the working folder, then of each folder above it; in the folders of the \
variable MMSMITH_SPECS, which has the form of PATH; among the built-in solutions. A file with the text of a built-in solution uses the \
generated code. Any other file is interpreted, and mms says on standard error if it differs from the built-in solution of its name. mms \
list says where each solution comes from.";

/// The command line as it is read.
///
/// Values that begin with a hyphen reach the readers of numbers, times and lists, whose refusals say which values are right;
/// without that, clap takes them for options that do not exist.
pub(crate) fn line() -> clap::Command {
    let with_hyphens = |argument: Arg| {
        let takes_values = argument.get_action().takes_values();
        let argument = argument.ignore_case(takes_values);
        let is_option = argument.get_long().is_some() && argument.get_action().takes_values();
        let is_path = argument.get_value_parser().type_id() == TypeId::of::<PathBuf>();
        if !is_option || is_path {
            return argument;
        }
        let names = argument.get_value_names().unwrap_or_default();
        let is_time = names.iter().any(|name| *name == "TIME");
        if argument.get_value_delimiter().is_some() || is_time {
            argument.allow_hyphen_values(true)
        } else {
            argument.allow_negative_numbers(true)
        }
    };
    let line = Arguments::command()
        .after_long_help(WHERE)
        .mut_subcommands(|command| command.mut_args(with_hyphens))
        .mut_subcommands(help::with_examples);
    help::with_groups(line)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        line().debug_assert();
    }
}
