//! Options of `mms resume`.

use std::path::PathBuf;

use clap::Args;

use super::values::{ProcessGrid, process_grid, thread_count};

#[derive(Args)]
pub(crate) struct ResumeOptions {
    /// Folder that the run had as --checkpoint
    #[arg(value_name = "DIR")]
    pub(crate) folder: PathBuf,
    /// Number of threads. Default: that of the run
    #[arg(long, value_name = "N", value_parser = thread_count)]
    pub(crate) threads: Option<usize>,
    /// Processes along each axis, such as 2x4, where mpirun starts several. Default: those whose fullest has the least to do
    #[arg(long, value_name = "NxN", value_parser = process_grid)]
    pub(crate) process_grid: Option<ProcessGrid>,
}
