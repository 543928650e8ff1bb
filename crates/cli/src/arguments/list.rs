//! Options of `mms list`.

use std::path::PathBuf;

use clap::Args;

#[derive(Args)]
pub(crate) struct ListOptions {
    /// Show parameters, source and reference of each solution
    #[arg(long)]
    pub(crate) long: bool,
    /// Write the list to this JSON file too; - is standard output, which then has nothing else
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}
