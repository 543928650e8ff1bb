//! The claims of a specification about its own fields: proved where they vanish in symbols, else verified or refuted in
//! high precision.
//!
//! - [`Published`]: the listings of `[[cross-check]]`, which the derived fields should equal.
//! - [`surfaces`]: what the boundary conditions say is zero, such as the traction on a free surface.

mod listings;
mod parameters;
mod points;
mod surfaces;

pub use listings::Published;
/// The outcome of a comparison, component by component, and for each whether the two sides are equal.
pub use mmsmith_maple::{Component, Report, Verdict as Equality};
pub use parameters::admissible_value;
pub use points::PointsError;
pub use surfaces::{Outcome, SurfaceError, SurfaceFinding, surfaces};
