//! Options of `mms doctor`.

use std::path::PathBuf;

use clap::Args;

#[derive(Args)]
pub(crate) struct DoctorOptions {
    /// Folder in which studies would be kept: files are locked, renamed and forced onto the disk there
    #[arg(long, value_name = "DIR", default_value = ".")]
    pub(crate) folder: PathBuf,
    /// Write the findings to this JSON file too; - is standard output, which then has nothing else
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}
