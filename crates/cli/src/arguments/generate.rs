//! Options of `mms gen`.

use std::path::PathBuf;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use mmsmith_codegen::Fault;

#[derive(Args)]
pub(crate) struct GenerateOptions {
    /// The solution, by name, or a specification file (SPEC.toml); mms --help says where names are looked for
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) name: String,
    /// The language: a C99 header that needs nothing else, or a Rust module for a crate that depends on mmsmith-runtime
    #[arg(long, value_enum)]
    pub(crate) target: Target,
    /// Write the file into this folder, which is made where there is none
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Plant this mistake in the fields, so that you can see whether your tests find it
    #[arg(long, value_name = "NAME", value_parser = faults())]
    pub(crate) fault: Option<Fault>,
}

/// A language that code is written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Target {
    /// A module
    Rust,
    /// A C99 header, for C, C++ and CUDA
    C,
}

/// Faults, with a line about each.
fn faults() -> impl TypedValueParser<Value = Fault> {
    let values = Fault::ALL.map(|own| PossibleValue::new(own.name()).help(own.about()));
    PossibleValuesParser::new(values).try_map(|name| name.parse::<Fault>())
}
