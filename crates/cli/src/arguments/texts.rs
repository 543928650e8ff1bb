//! Options of the commands that tell of the command line itself.

use std::path::PathBuf;

use clap::Args;
use clap_complete::Shell;

#[derive(Args)]
pub(crate) struct CompletionsOptions {
    /// Shell that completes the commands
    #[arg(value_enum, value_name = "SHELL")]
    pub(crate) shell: Shell,
}

#[derive(Args)]
pub(crate) struct ManOptions {
    /// Folder of mms.1 and a page for each command
    #[arg(value_name = "DIR")]
    pub(crate) folder: PathBuf,
}

#[derive(Args)]
pub(crate) struct ReferenceOptions {
    /// As functions of the Python package
    #[arg(long)]
    pub(crate) python: bool,
    /// As schemas of the JSON of all commands, a file each, into this folder
    #[arg(long, value_name = "DIR", conflicts_with = "python")]
    pub(crate) schemas: Option<PathBuf>,
}
