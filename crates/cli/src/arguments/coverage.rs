//! Options of `mms coverage`.

use std::path::PathBuf;

use clap::Args;

#[derive(Args)]
pub(crate) struct CoverageOptions {
    /// Names of solutions, or specification files. Default: all solutions
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) solutions: Vec<String>,
    /// Write the shares to this JSON file too; - is standard output, which then has nothing else
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}
