//! Options of `mms serve`.

use std::path::PathBuf;

use clap::Args;

#[derive(Args)]
pub(crate) struct ServeOptions {
    /// Speak the model context protocol: JSON-RPC 2.0, a message a line, on standard input and output alone
    #[arg(long, required = true)]
    pub(crate) mcp: bool,
    /// Folder whose files may be read and written; repeatable. Without any, specifications come as text, and files go back as text
    #[arg(long, value_name = "DIR")]
    pub(crate) folder: Vec<PathBuf>,
    /// Command that builds and runs your solver, as that of mms diagnose, which the client may start but not change. Without it there is no
    /// tool diagnose
    #[arg(long, value_name = "CMD")]
    pub(crate) run: Option<String>,
}
