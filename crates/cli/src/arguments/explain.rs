//! Options of `mms explain`.

use std::path::PathBuf;

use clap::Args;

use super::values::cell_count;

#[derive(Args)]
pub(crate) struct ExplainOptions {
    /// Name of a solution (mms list), or a specification file
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) name: String,
    /// Numbers of cells, separated by commas, of more runs to predict: their particles, time, memory and threads of use
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', value_parser = cell_count)]
    pub(crate) cells: Vec<usize>,
    /// Compare predicted and measured times: five schemes on 64, 128 and 256 cells, for a part of a period
    #[arg(long)]
    pub(crate) compare: bool,
    /// Write the description to this JSON file too; - is standard output, which then has nothing else
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}
