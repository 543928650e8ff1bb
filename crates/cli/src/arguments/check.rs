//! Options of `mms check`.

use std::path::PathBuf;

use clap::Args;

use super::shared::ParameterOptions;
use super::values::{sample_count, seconds};

#[derive(Args)]
pub(crate) struct CheckOptions {
    /// Solutions to check, by name, or specification files (SPEC.toml)
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) solutions: Vec<String>,
    /// Number of sample points in the body and on each surface [default: 300], or with --thorough of points that are drawn in
    /// each class of inputs before the search [default: 300, or 30 with --seconds]
    #[arg(long, value_name = "N", value_parser = sample_count)]
    pub(crate) points: Option<usize>,
    /// Search for the largest rounding error of every field against arbitrary precision instead: among ordinary inputs, tiny
    /// amplitudes, late times, at the boundary, near inversion, near and far from the origin
    #[arg(long, conflicts_with = "set")]
    pub(crate) thorough: bool,
    /// Search for so long in each solution [default: 128 evaluations for each point drawn]
    #[arg(long, value_name = "TIME", value_parser = seconds, requires = "thorough")]
    pub(crate) seconds: Option<f64>,
    /// Keep the state of each search in this folder, and go on where it was
    #[arg(long, value_name = "DIR", requires = "thorough")]
    pub(crate) state: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) parameters: ParameterOptions,
    /// Write the findings to this JSON file; - is standard output, which then has nothing else
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}
