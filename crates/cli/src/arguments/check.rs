//! Options of `mms check`.

use std::path::PathBuf;

use clap::Args;

use super::shared::ParameterOptions;
use super::values::sample_count;

#[derive(Args)]
pub(crate) struct CheckOptions {
    /// Solutions to check, by name, or specification files (SPEC.toml)
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) solutions: Vec<String>,
    /// Number of sample points in the body and on each surface [default: 300], or in each class of inputs with
    /// --thorough [default: 10000]
    #[arg(long, value_name = "N", value_parser = sample_count)]
    pub(crate) points: Option<usize>,
    /// Measure the rounding error of every field against arbitrary precision instead: ordinary inputs, tiny amplitudes, late
    /// times, the boundary, near inversion, near and far from the origin
    #[arg(long, conflicts_with = "set")]
    pub(crate) thorough: bool,
    #[command(flatten)]
    pub(crate) parameters: ParameterOptions,
    /// Write the findings to this JSON file; - is standard output, which then has nothing else
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}
