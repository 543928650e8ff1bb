//! Options of `mms explain`.

use std::path::PathBuf;

use clap::Args;

#[derive(Args)]
pub(crate) struct ExplainOptions {
    /// The solution, by name, or a specification file (SPEC.toml); mms --help says where names are looked for
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) name: String,
    /// Write it to this JSON file too; - is standard output, which then has nothing else
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}
