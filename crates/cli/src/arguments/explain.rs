//! Options of `mms explain`.

use std::path::PathBuf;

use clap::Args;

#[derive(Args)]
pub(crate) struct ExplainOptions {
    /// The solution, by name, or a specification file (SPEC.toml); mms --help says where names are looked for
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) name: String,
    /// Run five schemes on 64, 128 and 256 cells for a part of a period too, and tell what they take beside what is predicted
    #[arg(long)]
    pub(crate) compare: bool,
    /// Write it to this JSON file too; - is standard output, which then has nothing else
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}
