//! Options of `mms converge`.

use std::path::PathBuf;

use clap::Args;

use super::scheme::SchemeOptions;
use super::shared::KeepOptions;
use super::statics::StaticOptions;
use super::values::{positive_count, positive_number};

#[derive(Args)]
pub(crate) struct ConvergeOptions {
    /// Name of a solution (mms list), or a specification file
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) name: String,
    /// Numbers of cells, separated by commas: at least two for an order, three for a verdict on it; one with --cfls
    #[arg(long, value_name = "N,...", required = true, value_delimiter = ',', value_parser = positive_count)]
    pub(crate) cells: Vec<usize>,
    /// CFL numbers, separated by commas: orders in time on one grid
    #[arg(long, value_name = "X,...", value_delimiter = ',', allow_negative_numbers = true, value_parser = positive_number, conflicts_with = "cfl")]
    pub(crate) cfls: Vec<f64>,
    /// Expected orders: a number for u, or by field and norm, such as u=2,F=1,P.l1=1; with --cfls orders in time, of the
    /// differences on one grid. A missed order gives exit status 1. Default: the orders of theory
    #[arg(long, value_name = "ORDERS")]
    pub(crate) expect: Option<String>,
    /// Largest distance of the order on the finest pair of grids from the expected order. Default: 0.1
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) tolerance: Option<f64>,
    #[command(flatten)]
    pub(crate) kept: KeepOptions,
    /// Draw the displacement error to this SVG file
    #[arg(long, value_name = "FILE")]
    pub(crate) plot: Option<PathBuf>,
    /// Write the tables to this file as comma-separated values
    #[arg(long, value_name = "FILE")]
    pub(crate) csv: Option<PathBuf>,
    /// Write the tables to this Markdown file
    #[arg(long, value_name = "FILE")]
    pub(crate) markdown: Option<PathBuf>,
    /// Write the tables to this LaTeX file, for the package booktabs
    #[arg(long, value_name = "FILE")]
    pub(crate) latex: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) scheme: SchemeOptions,
    #[command(flatten)]
    pub(crate) statics: StaticOptions,
}
