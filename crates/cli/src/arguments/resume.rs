//! Options of `mms resume`.

use std::path::PathBuf;

use clap::Args;

use super::values::thread_count;

#[derive(Args)]
pub(crate) struct ResumeOptions {
    /// Folder that the run had as --checkpoint
    #[arg(value_name = "DIR")]
    pub(crate) folder: PathBuf,
    /// Number of threads. Default: that of the run
    #[arg(long, value_name = "N", value_parser = thread_count)]
    pub(crate) threads: Option<usize>,
}
