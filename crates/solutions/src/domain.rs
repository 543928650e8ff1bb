//! The body in its reference configuration: shape and boundary conditions.

use crate::Real;
use nalgebra::SVector;

/// The shape of the body, in its reference configuration, with lengths in the solution's unit.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Domain<T: Real, const D: usize> {
    /// The axis-aligned box between two corners.
    Box {
        /// The corner with the smallest coordinates.
        lower: SVector<T, D>,
        /// The corner with the largest coordinates.
        upper: SVector<T, D>,
    },
    /// The points with `inner <= R <= outer`, `R` the distance from the origin: an annulus in two dimensions, a
    /// spherical shell in three.
    Annulus {
        /// Inner radius.
        inner: T,
        /// Outer radius.
        outer: T,
    },
}

/// A part of the body's boundary, or a plane that cuts the body in halves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Surface {
    /// The face of smallest coordinate along an axis; for an annulus, the plane through the origin normal to it.
    Lower(usize),
    /// The face of largest coordinate along an axis.
    Upper(usize),
    /// The inner rim.
    Inner,
    /// The outer rim.
    Outer,
}

/// What holds on a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Condition {
    /// No displacement along the normal, no shear traction.
    Sliding,
    /// The body is cut along a plane of symmetry: half of it is modelled, and the cut behaves as a sliding wall.
    Symmetry,
    /// No traction.
    TractionFree,
    /// The traction `P N` of the solution.
    PrescribedTraction,
    /// The displacement of the solution.
    PrescribedMotion,
}

/// A boundary condition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Boundary {
    /// Where.
    pub surface: Surface,
    /// What.
    pub condition: Condition,
}
