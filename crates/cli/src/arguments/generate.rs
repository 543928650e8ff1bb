//! Options of `mms gen`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use mmsmith_codegen::{Fault, HOSTS, Host};

use super::shared::ParameterOptions;
use super::values::positive_number;

#[derive(Args)]
pub(crate) struct GenerateOptions {
    /// Name of a solution (mms list), or a specification file
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) name: String,
    /// Language or host; the head of the file says how to use it
    #[arg(long, value_parser = hosts())]
    pub(crate) target: &'static Host,
    #[command(flatten)]
    pub(crate) parameters: ParameterOptions,
    /// Folder of the file; made if there is none
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// For laws with a history: the end of the table that is written beside the file, in periods of the solution [default: 1]
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) periods: Option<f64>,
    /// For laws with a history: positions (CSV with the columns X,Y,Z, or JSON as of mms eval) that the table has series of, instead of one
    /// over the body. Needed where particles begin or stop to flow on the way
    #[arg(long, value_name = "FILE")]
    pub(crate) points: Option<PathBuf>,
    /// With functions dPdF11, dPdF12, ... of place and time, the derivatives of P with respect to each component of F: for tests of the
    /// tangent of a material routine
    #[arg(long, conflicts_with_all = ["fault", "periods", "points"])]
    pub(crate) tangent: bool,
    /// Plant this mistake in the fields, to see whether your tests find it
    #[arg(long, value_name = "NAME", value_parser = faults())]
    pub(crate) fault: Option<Fault>,
}

/// Hosts, with a line about each.
pub(super) fn hosts() -> impl TypedValueParser<Value = &'static Host> {
    // As people call the language.
    let alias = |name: &str| (name == "cpp").then_some("c++");
    let values = HOSTS
        .iter()
        .map(|own| PossibleValue::new(own.name).help(own.about).aliases(alias(own.name)));
    PossibleValuesParser::new(values)
        .try_map(|name| Host::named(&name.to_lowercase().replace("c++", "cpp")).ok_or(name))
}

/// Faults, with a line about each.
fn faults() -> impl TypedValueParser<Value = Fault> {
    let values = Fault::ALL.map(|own| PossibleValue::new(own.name()).help(own.about()));
    PossibleValuesParser::new(values).try_map(|name| name.to_lowercase().parse::<Fault>())
}
