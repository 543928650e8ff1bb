//! The claims of a specification about its own fields: proved where they vanish in symbols, else verified or refuted in
//! high precision.
//!
//! - [`Published`]: the listings of `[[cross-check]]`, which the derived fields should equal.
//! - [`maple`]: Maple's C listings, read and compared.
//! - [`surfaces`]: what the boundary conditions say is zero, such as the traction on a free surface.

mod listings;
pub mod maple;
mod parameters;
mod points;
mod surfaces;

pub use listings::Published;
/// The outcome of a comparison, component by component, and for each whether the two sides are equal.
pub use maple::{Component, Report, Verdict as Equality};
pub use parameters::admissible_value;
pub use points::PointsError;
pub use surfaces::{Outcome, SurfaceError, SurfaceFinding, surfaces};
