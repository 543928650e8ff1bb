//! Options of `mms stability`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use mmsmith_verify as verify;

use super::scheme::SchemeOptions;
use super::shared::{KeepOptions, parsed};
use super::values::{positive_count, positive_number, sample_count, variation};

#[derive(Args)]
pub(crate) struct StabilityOptions {
    /// Name of a solution (mms list), or a specification file
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) name: String,
    /// Measure how much small disturbances of the exact motion grow until the end time, whatever the scheme: by the balance of
    /// momentum linearised about it, in waves and for the worst of all disturbances. Of the scheme's options it takes --periods,
    /// and --shape for the splines' degree; growth for programs has a schema of its own
    #[arg(long, conflicts_with_all = ["at", "search", "plot", "shard", "width", "lower", "upper"])]
    pub(crate) exact: bool,
    /// Number of cells along the solution's cell length. Default: 32; with --exact 24 in one dimension, 12 in the plane, 5 in
    /// space
    #[arg(long, value_name = "N", value_parser = positive_count)]
    pub(crate) cells: Option<usize>,
    /// Setting to vary, as NAME=VALUE,VALUE,...; at most two. Names: amplitude; units (mass, length if the solution has a
    /// length L, and time change by powers of two); a parameter of the solution; cells, ppc, offset, periods, precision,
    /// shape, integrator, start
    #[arg(long, value_name = "NAME=VALUE,...", value_parser = variation, conflicts_with_all = ["at", "search"])]
    pub(crate) over: Vec<(String, Vec<String>)>,
    /// Largest distance between the stable and the unstable CFL number, on the speed of P-waves
    #[arg(long, value_name = "X", default_value_t = 0.01, allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) width: f64,
    /// CFL number to start from; halved until a run is stable. Default: 1/8 of the number at which a P-wave crosses one cell
    /// in one step
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) lower: Option<f64>,
    /// CFL number that is expected to be unstable; raised until a run is. Default: the number at which a P-wave crosses one
    /// cell in one step
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) upper: Option<f64>,
    /// A run is unstable if its error of u exceeds this multiple of the error of the reference run, at CFL 0.125 on P-waves. The
    /// part of that error which its steps cause grows with the order of the integrator first: accuracy lost in time is no
    /// instability
    #[arg(long, value_name = "X", default_value_t = verify::Criteria::default().error_multiple, allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) error_multiple: f64,
    /// A run is unstable if its energy, in excess of the exact energy and of the reference run's excess, grows faster than this
    /// multiple of the largest exact energy per period. Laws without a strain energy, as those with memory, have no such limit
    #[arg(long, value_name = "X", default_value_t = verify::Criteria::default().energy_rate, allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) energy_rate: f64,
    /// Run at this CFL number only; exit status 1 if the run is unstable
    #[arg(long, value_name = "CFL", allow_negative_numbers = true, value_parser = positive_number, conflicts_with = "search")]
    pub(crate) at: Option<f64>,
    /// Look for unstable runs among random settings with CFL numbers up to --cfl on P-waves, which should be stable; exit
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
    /// Cells of runs.
    pub(crate) fn grid_cells(&self) -> usize {
        self.cells.unwrap_or(32)
    }

    /// A map over two settings, told as `NAME=VALUE,...`, with defaults for the rest.
    pub(crate) fn map(name: &str, cells: usize, over: [&str; 2]) -> Self {
        Self { cells: Some(cells), ..parsed(&[name, "--over", over[0], "--over", over[1]]) }
    }
}
