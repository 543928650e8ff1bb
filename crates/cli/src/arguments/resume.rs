//! Options of `mms resume`.

use std::path::PathBuf;

use clap::Args;

use super::values::thread_count;

#[derive(Args)]
pub(crate) struct ResumeOptions {
    /// The folder that the run was given with --checkpoint
    #[arg(value_name = "DIR")]
    pub(crate) folder: PathBuf,
    /// Number of threads; as the run was started with when left out
    #[arg(long, value_name = "N", value_parser = thread_count)]
    pub(crate) threads: Option<usize>,
}
