//! Options of `mms coverage`.

use std::path::PathBuf;

use clap::Args;

#[derive(Args)]
pub(crate) struct CoverageOptions {
    /// Solutions, by name, or specification files (SPEC.toml); all of the library where none is given
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) solutions: Vec<String>,
    /// Write it to this JSON file too; - is standard output, which then has nothing else
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}
