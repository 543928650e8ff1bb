//! Options of `mms check`.

use std::path::PathBuf;

use clap::Args;

use super::shared::ParameterOptions;
use super::values::{sample_count, seconds};

#[derive(Args)]
pub(crate) struct CheckOptions {
    /// Names of solutions, or specification files. Default: all solutions
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) solutions: Vec<String>,
    /// Number of sample points in the body and on each surface; with --thorough of points drawn in each class of inputs
    /// before the search. Default: 300; 30 with --seconds
    #[arg(long, value_name = "N", value_parser = sample_count)]
    pub(crate) points: Option<usize>,
    /// Compare every field with arbitrary precision at points that are drawn, which decide, and search for the largest rounding errors,
    /// which are told: among ordinary inputs, tiny amplitudes, late times, at the boundary, near inversion and near the origin
    #[arg(long, conflicts_with = "set")]
    pub(crate) thorough: bool,
    /// Time of the search in each solution. Default: 128 evaluations for each point drawn
    #[arg(long, value_name = "TIME", value_parser = seconds, requires = "thorough")]
    pub(crate) seconds: Option<f64>,
    /// Keep the state of each search in this folder, and continue from the state there
    #[arg(long, value_name = "DIR", requires = "thorough")]
    pub(crate) state: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) parameters: ParameterOptions,
    /// Write the findings to this JSON file; - is standard output, which then has nothing else
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}
