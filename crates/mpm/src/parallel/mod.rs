//! Parallel loops whose results do not depend on the number of threads; this folder knows nothing of mechanics.
//!
//! - [`bins`]: particles sorted by rows of the grid.
//! - [`coloring`]: the two-colour schedule of overlapping rows.
//! - [`disjoint`]: mutable access to the particles of each bin.
//! - [`chunks`]: plain loops over chunks of arrays.

pub(crate) mod bins;
pub(crate) mod chunks;
pub(crate) mod coloring;
pub(crate) mod disjoint;
