//! What a specification claims about its own fields, proved or refuted in high precision.
//!
//! - [`Published`]: the listings of `[[cross-check]]`, which the derived fields should equal.

mod listings;
mod points;

pub use listings::Published;
/// The outcome of a comparison, component by component, and for each whether the two sides are equal.
pub use mmsmith_maple::{Component, Report, Verdict as Equality};
