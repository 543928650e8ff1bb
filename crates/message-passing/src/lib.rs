//! The processes of a run that MPI started together, as [`Ranks`](mmsmith_ranks::Ranks).
//!
//! All calls of MPI are here. Without the feature `mpi` the crate is empty, and nothing of an MPI is needed to build it.

#[cfg(feature = "mpi")]
mod ranks;

#[cfg(feature = "mpi")]
pub use ranks::{abort, start};
