//! Parallel loops whose results do not depend on the number of threads.
//!
//! - [`each`], [`each_chunk`]: loops over pieces of work, and over chunks of arrays.
//! - [`coloring`]: the two-colour schedule of overlapping bands.
//! - [`disjoint`]: mutable access to the elements of each part of a partition.
//! - [`parallel`]: iterators that share their work out.
//! - [`windows`]: sums of tiles with overlapping windows, in a fixed order.

mod chunks;
pub mod coloring;
pub mod disjoint;
pub mod parallel;
pub mod windows;

pub use chunks::{each, each_chunk, on_all_threads};
