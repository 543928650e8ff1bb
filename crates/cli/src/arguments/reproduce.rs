//! Options of `mms reproduce`.

use std::path::PathBuf;

use clap::Args;

use super::values::{seconds, thread_count};

#[derive(Args)]
pub(crate) struct ReproduceOptions {
    /// Folder of all files
    #[arg(long, value_name = "DIR", default_value = "target/reproduce")]
    pub(crate) out: PathBuf,
    /// Time for the comparison of schemes by error and cost, for each problem, such as 8s or 2m
    #[arg(long, value_name = "TIME", default_value = "8s", value_parser = seconds)]
    pub(crate) budget: f64,
    /// Draw nothing but the picture of the README to this SVG file: the ring's stress beside its orders
    #[arg(long, value_name = "FILE", hide = true)]
    pub(crate) hero: Option<PathBuf>,
    /// Number of threads. Default: all cores
    #[arg(long, value_name = "N", value_parser = thread_count)]
    pub(crate) threads: Option<usize>,
}
