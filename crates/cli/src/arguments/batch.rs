//! Options of `mms batch`.

use clap::{Args, ValueEnum};

use super::values::thread_count;

#[derive(Args)]
pub(crate) struct BatchOptions {
    /// Batch system of the cluster
    #[arg(value_enum, value_name = "SYSTEM")]
    pub(crate) system: BatchSystem,
    /// Number of shards of a study
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = thread_count)]
    pub(crate) shards: usize,
    /// Number of MPI processes of a run; more than one needs an mms built with --features mpi
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = thread_count)]
    pub(crate) ranks: usize,
    /// Cores of each shard, or of each process of a run
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = thread_count)]
    pub(crate) cores: usize,
    /// Command after --: a study with --out DIR, or a run
    #[arg(last = true, required = true, value_name = "COMMAND")]
    pub(crate) command: Vec<String>,
}

/// Batch systems.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum BatchSystem {
    /// Slurm, by sbatch
    Slurm,
}
