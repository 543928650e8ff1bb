//! Options that several commands have.

use std::path::PathBuf;

use clap::{Args, Parser};
use mmsmith_ledger::ShardName;

use super::values::{assignment, shard};

/// Where finished cases are kept.
#[derive(Args)]
pub(crate) struct KeepOptions {
    /// Keep every finished case in this folder, and read finished cases from it: a study that was killed continues where it
    /// stopped, and several processes may share the folder
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Compute only the cases of shard I of N, of about equal predicted cost, and write no table. The shards of a study run
    /// on as many machines, in any order; the same command without this option prints the table. mms batch writes the script
    #[arg(long, value_name = "I/N", requires = "out", value_parser = shard)]
    pub(crate) shard: Option<ShardName>,
}

/// Values for parameters of a solution.
#[derive(Args, Clone)]
pub(crate) struct ParameterOptions {
    /// Value of a parameter, in place of its default; repeatable
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment)]
    pub(crate) set: Vec<(String, f64)>,
}

/// Lets the parser fill in its own defaults, so that they stand in one place.
pub(super) fn parsed<O: Args>(arguments: &[&str]) -> O {
    #[derive(Parser)]
    struct Usual<O: Args> {
        #[command(flatten)]
        options: O,
    }
    Usual::<O>::parse_from(["mms"].iter().chain(arguments)).options
}
