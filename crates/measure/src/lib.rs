//! Norms of the errors of a solver's particles against an exact solution.
//!
//! A run compares all its particles with the exact solution after every step, which is a fifth of its time. That loop is compiled here,
//! for each precision and dimension. Code that a run needs only now and then lies in other crates, and is compiled with less effort.

mod comparison;
mod homes;
pub mod norms;
mod tree;

pub use comparison::{Compared, Comparison, RUNS, Row, each_group, norms_of, over_particles};
pub use homes::{Holder, Homes};
pub use tree::{Sums, joined, joined_over};
