//! Parallel loops whose results do not depend on the number of threads.
//!
//! - [`each`], [`each_chunk`]: loops over pieces of work, and over chunks of arrays.
//! - [`disjoint`]: mutable access to the elements of each part of a partition.
//! - [`region`]: boxes of elements of an array.
//! - [`held`]: the tiles that each process holds, and [`lattice`]: which tiles wait for which others.
//! - [`parallel`]: iterators that share their work out.
//! - [`windows`]: sums of tiles with overlapping windows, in a fixed order.

mod chunks;
pub mod disjoint;
pub mod held;
pub mod lattice;
pub mod parallel;
pub mod region;
pub mod windows;

pub use chunks::{each, each_chunk, on_all_threads};
