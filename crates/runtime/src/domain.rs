//! The body in its reference configuration: shape and boundary conditions.

use std::fmt;

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

impl<T: Real, const D: usize> Domain<T, D> {
    /// This shape with `change` applied to each length.
    #[must_use]
    pub fn map<U: Real>(&self, change: impl Fn(T) -> U) -> Domain<U, D> {
        match self {
            Self::Box { lower, upper } => {
                Domain::Box { lower: lower.map(&change), upper: upper.map(&change) }
            }
            Self::Annulus { inner, outer } => {
                Domain::Annulus { inner: change(*inner), outer: change(*outer) }
            }
        }
    }

    /// The outward reference normal at a point `X` of a surface; `None` where the body has no such surface.
    #[must_use]
    pub fn normal(&self, surface: Surface, X: &SVector<T, D>) -> Option<SVector<T, D>> {
        let axis = |axis: usize, sign: T| {
            (axis < D).then(|| SVector::from_fn(|i, _| if i == axis { sign } else { T::zero() }))
        };
        match (self, surface) {
            (Domain::Box { .. }, Surface::Upper(index)) => axis(index, T::one()),
            (_, Surface::Lower(index)) => axis(index, -T::one()),
            (Domain::Annulus { inner, .. }, Surface::Inner) => Some(X.map(|x| -x / *inner)),
            (Domain::Annulus { outer, .. }, Surface::Outer) => Some(X.map(|x| x / *outer)),
            _ => None,
        }
    }
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

/// The name that specifications have for it, such as `X-lower`.
impl fmt::Display for Surface {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let axis = |axis: usize| ["X", "Y", "Z"].get(axis).copied().unwrap_or("?");
        match self {
            Self::Lower(index) => f.pad(&format!("{}-lower", axis(*index))),
            Self::Upper(index) => f.pad(&format!("{}-upper", axis(*index))),
            Self::Inner => f.pad("inner"),
            Self::Outer => f.pad("outer"),
        }
    }
}

/// Condition on a surface.
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

/// The name that specifications have for it, such as `sliding`.
impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Sliding => "sliding",
            Self::Symmetry => "symmetry",
            Self::TractionFree => "traction-free",
            Self::PrescribedTraction => "prescribed-traction",
            Self::PrescribedMotion => "prescribed-motion",
        })
    }
}

/// A boundary condition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Boundary {
    /// The surface.
    pub surface: Surface,
    /// The condition.
    pub condition: Condition,
}
