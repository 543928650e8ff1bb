//! Options of `mms gen`.

use std::path::PathBuf;

use clap::builder::PossibleValue;
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
    #[arg(long, value_enum, value_name = "NAME")]
    pub(crate) fault: Option<FaultName>,
}

/// A language that code is written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Target {
    /// A module
    Rust,
    /// A C99 header, for C, C++ and CUDA
    C,
}

/// A fault as the command line names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FaultName(pub(crate) Fault);

impl ValueEnum for FaultName {
    fn value_variants<'a>() -> &'a [Self] {
        const NAMES: [FaultName; Fault::ALL.len()] = {
            let mut names = [FaultName(Fault::ALL[0]); Fault::ALL.len()];
            let mut n = 0;
            while n < names.len() {
                names[n] = FaultName(Fault::ALL[n]);
                n += 1;
            }
            names
        };
        &NAMES
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.0.name()).help(self.0.about()))
    }
}
