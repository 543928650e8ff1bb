//! Options that several commands have.

use std::path::PathBuf;

use clap::{Args, Parser};
use mmsmith_ledger::ShardName;

use super::values::{assignment, shard};

/// Where finished cases are kept.
#[derive(Args)]
pub(crate) struct KeepOptions {
    /// Keep every finished case in this folder, and take from it what is there: a study that was killed goes on where it
    /// stopped, and several processes may share one
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Compute those cases alone that fall to shard I of N, by predicted cost, and write no table: the shards of a study run on as
    /// many machines, in any order, and the same command without this option prints the table. mms batch writes the script
    #[arg(long, value_name = "I/N", requires = "out", value_parser = shard)]
    pub(crate) shard: Option<ShardName>,
}

/// Values for parameters of a solution.
#[derive(Args, Clone)]
pub(crate) struct ParameterOptions {
    /// Give a parameter another value than its default; repeatable
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
