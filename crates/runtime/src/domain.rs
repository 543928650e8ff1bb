//! The body in its reference configuration: shape, and normals on its boundary.

use crate::Real;
use mmsmith_vocabulary::Surface;
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
    /// In three dimensions, the points between two radii about the axis `Z` and between two heights.
    Tube {
        /// Inner radius; zero for a solid cylinder.
        inner: T,
        /// Outer radius.
        outer: T,
        /// The smallest `Z`.
        lower: T,
        /// The largest `Z`.
        upper: T,
        /// How far the body reaches around the axis.
        around: Around<T>,
    },
}

/// How far a [tube](Domain::Tube) reaches around its axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Around<T> {
    /// All the way, and nothing depends on the angle: the half plane `Y = 0`, `X >= 0`, stands for the body.
    Axisymmetric,
    /// All the way.
    Whole,
    /// From an angle to another, in radians, `X = R cos(theta)`, `Y = R sin(theta)`.
    Sector {
        /// The smallest angle.
        from: T,
        /// The largest angle.
        to: T,
    },
}

impl<T> Around<T> {
    /// This with `change` applied to each angle.
    #[must_use]
    pub fn map<U>(self, change: impl Fn(T) -> U) -> Around<U> {
        match self {
            Self::Axisymmetric => Around::Axisymmetric,
            Self::Whole => Around::Whole,
            Self::Sector { from, to } => Around::Sector { from: change(from), to: change(to) },
        }
    }
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
            Self::Tube { inner, outer, lower, upper, around } => Domain::Tube {
                inner: change(*inner),
                outer: change(*outer),
                lower: change(*lower),
                upper: change(*upper),
                around: around.map(&change),
            },
        }
    }

    /// The outward reference normal at a point `X` of a surface; `None` where the body has no such surface.
    #[must_use]
    pub fn normal(&self, surface: Surface, X: &SVector<T, D>) -> Option<SVector<T, D>> {
        let axis = |axis: usize, sign: T| {
            (axis < D).then(|| SVector::from_fn(|i, _| if i == axis { sign } else { T::zero() }))
        };
        match (self, surface) {
            (Domain::Tube { .. }, Surface::Lower(index)) if index != 2 => None,
            (Domain::Box { .. } | Domain::Tube { .. }, Surface::Upper(index)) => {
                axis(index, T::one())
            }
            (_, Surface::Lower(index)) => axis(index, -T::one()),
            (Domain::Annulus { inner, .. }, Surface::Inner) => Some(X.map(|x| -x / *inner)),
            (Domain::Annulus { outer, .. }, Surface::Outer) => Some(X.map(|x| x / *outer)),
            (Domain::Tube { inner, .. }, Surface::Inner) => Some(radial(X, -*inner)),
            (Domain::Tube { outer, .. }, Surface::Outer) => Some(radial(X, *outer)),
            (Domain::Tube { around: Around::Sector { from, .. }, .. }, Surface::FirstAngle) => {
                Some(across(*from, -T::one()))
            }
            (Domain::Tube { around: Around::Sector { to, .. }, .. }, Surface::LastAngle) => {
                Some(across(*to, T::one()))
            }
            _ => None,
        }
    }
}

/// `X/radius` without the component along the third axis.
fn radial<T: Real, const D: usize>(X: &SVector<T, D>, radius: T) -> SVector<T, D> {
    SVector::from_fn(|i, _| if i < 2 { X[i] / radius } else { T::zero() })
}

/// The direction of growing angle at an angle, times a sign.
fn across<T: Real, const D: usize>(angle: T, sign: T) -> SVector<T, D> {
    let (sin, cos) = (angle.sine(), angle.cosine());
    SVector::from_fn(|i, _| match i {
        0 => -sin * sign,
        1 => cos * sign,
        _ => T::zero(),
    })
}
