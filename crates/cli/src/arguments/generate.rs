//! Options of `mms gen`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use mmsmith_codegen::{Fault, HOSTS, Host};

use super::shared::ParameterOptions;

#[derive(Args)]
pub(crate) struct GenerateOptions {
    /// The solution, by name, or a specification file (SPEC.toml); mms --help says where names are looked for
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) name: String,
    /// The language or the host; the file's head says how it is used
    #[arg(long, value_parser = hosts())]
    pub(crate) target: &'static Host,
    #[command(flatten)]
    pub(crate) parameters: ParameterOptions,
    /// Write the file into this folder, which is made where there is none
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Plant this mistake in the fields, so that you can see whether your tests find it
    #[arg(long, value_name = "NAME", value_parser = faults())]
    pub(crate) fault: Option<Fault>,
}

/// Hosts, with a line about each.
fn hosts() -> impl TypedValueParser<Value = &'static Host> {
    let values = HOSTS.iter().map(|own| PossibleValue::new(own.name).help(own.about));
    PossibleValuesParser::new(values).try_map(|name| Host::named(&name).ok_or(name))
}

/// Faults, with a line about each.
fn faults() -> impl TypedValueParser<Value = Fault> {
    let values = Fault::ALL.map(|own| PossibleValue::new(own.name()).help(own.about()));
    PossibleValuesParser::new(values).try_map(|name| name.parse::<Fault>())
}
