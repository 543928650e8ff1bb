//! Options of `mms stability`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use mmsmith_verify as verify;

use super::scheme::SchemeOptions;
use super::shared::{KeepOptions, parsed};
use super::values::{positive_count, positive_number, sample_count, variation};

#[derive(Args)]
pub(crate) struct StabilityOptions {
    /// The solution, by name, or a specification file (SPEC.toml); mms --help says where names are looked for
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) name: String,
    /// Number of cells along the solution's cell length
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = positive_count)]
    pub(crate) cells: usize,
    /// What to vary, one or two of them: NAME=VALUE,VALUE,... with the name amplitude, units (mass, length where L is one,
    /// and time change by powers of two), a parameter of the solution, or cells, ppc, offset, periods, precision, shape,
    /// integrator, start
    #[arg(long, value_name = "NAME=VALUE,...", value_parser = variation, conflicts_with_all = ["at", "search"])]
    pub(crate) over: Vec<(String, Vec<String>)>,
    /// How close the stable and the unstable CFL number come, on P-waves, whose number is the larger one
    #[arg(long, value_name = "X", default_value_t = 0.01, allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) width: f64,
    /// CFL number to start from; an eighth of P-waves' when left out. It is halved until it is stable
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) lower: Option<f64>,
    /// CFL number that is thought unstable; P-waves' own when left out. It is raised until it is unstable
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) upper: Option<f64>,
    /// A run is unstable with an error of u above this multiple of a reference run's, at an eighth of P-waves' time step
    #[arg(long, value_name = "X", default_value_t = verify::Criteria::default().error_multiple, allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) error_multiple: f64,
    /// A run is unstable if it gains, in a period, more than this multiple of the exact motion's largest energy
    #[arg(long, value_name = "X", default_value_t = verify::Criteria::default().energy_rate, allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) energy_rate: f64,
    /// Judge the run at this CFL number alone; exit status 1 if it is unstable
    #[arg(long, value_name = "CFL", allow_negative_numbers = true, value_parser = positive_number, conflicts_with = "search")]
    pub(crate) at: Option<f64>,
    /// Look for failures among random settings with CFL numbers up to --cfl on P-waves, which are believed stable; exit
    /// status 1 if there are any
    #[arg(long, value_enum)]
    pub(crate) search: Option<SearchKind>,
    /// Number of random settings
    #[arg(long, value_name = "N", default_value_t = 100, requires = "search", value_parser = sample_count)]
    pub(crate) samples: usize,
    /// Seed of the random settings
    #[arg(long, value_name = "N", default_value_t = 1, requires = "search")]
    pub(crate) seed: u64,
    /// Draw the limits to this SVG file: a line over one setting, a map over two
    #[arg(long, value_name = "FILE", requires = "over")]
    pub(crate) plot: Option<PathBuf>,
    /// Write the table to this file as comma-separated values
    #[arg(long, value_name = "FILE")]
    pub(crate) csv: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) kept: KeepOptions,
    #[command(flatten)]
    pub(crate) scheme: SchemeOptions,
}

/// Ways to look for failures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SearchKind {
    /// Settings drawn from a seed
    Random,
}

impl StabilityOptions {
    /// A map over two settings, told as `NAME=VALUE,...`, with what holds where nothing is said.
    pub(crate) fn map(name: &str, cells: usize, over: [&str; 2]) -> Self {
        Self { cells, ..parsed(&[name, "--over", over[0], "--over", over[1]]) }
    }
}
