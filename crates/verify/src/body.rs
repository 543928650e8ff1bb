//! Bodies that no grid of the solver covers as they are stated, and what their specifications lack.

use mmsmith_runtime::{AnySolution, Around, Domain, Solution, Surface};
use nalgebra::SVector;

use crate::case::Case;
use crate::dimension::in_dimension;
use crate::error::SceneError;
use crate::points;

/// Sides of a box that are longer than so many cell lengths have a cell length that was forgotten.
const MOST_CELL_LENGTHS: f64 = 1000.0;

/// The least side of a box and its cell length, where that is so much shorter that it was hardly meant.
#[must_use]
pub fn forgotten_cell_length(exact: &AnySolution<f64>) -> Option<[f64; 2]> {
    in_dimension!(
        exact,
        |s| match s.domain() {
            Domain::Box { lower, upper } => {
                let both = [(upper - lower).min(), s.cell_length()];
                Some(both).filter(|[side, length]| side / length > MOST_CELL_LENGTHS)
            }
            _ => None,
        },
        else None
    )
}

/// Refuses a body with the centre or the axis of curvilinear coordinates in it, where cells have no width and the directions no meaning.
pub(crate) fn refuse_centre<const D: usize>(domain: &Domain<f64, D>) -> Result<(), SceneError> {
    let (what, instead) = match domain {
        Domain::Annulus { inner: 0.0, .. } => (
            "its centre",
            "give it a hole, as inner = '1/100', or where nothing depends on the angle state a disc as the solid cylinder that it is a \
             section of: coordinates = 'axisymmetric', shape = 'solid-cylinder'",
        ),
        Domain::Tube { inner: 0.0, around: Around::Whole | Around::Sector { .. }, .. } => (
            "its axis",
            "where nothing depends on the angle, write coordinates = 'axisymmetric' and dimension = 2 in place of coordinates = \
             'cylindrical' and dimension = 3; otherwise give it a hole, as shape = 'tube' and inner = '1/100'",
        ),
        _ => return Ok(()),
    };
    Err(SceneError::Centre { what, instead })
}

/// The planes of symmetry that the total formulation needs of a shell and that the solution does not declare, where its motion has them.
pub(crate) fn undeclared_planes<const D: usize>(
    exact: &dyn Solution<f64, D>,
    case: &Case,
) -> Vec<Surface> {
    /// Places that are looked at, and shares of the body that are rounding.
    const PLACES: usize = 32;
    const ROUNDING: f64 = 1e-9;
    let domain = exact.domain();
    let is_clipped = case.scheme.updated().is_some_and(|own| own.placement.is_clipped());
    if D < 3 || is_clipped || !matches!(domain, Domain::Annulus { .. }) {
        return Vec::new();
    }
    let size = points::size(&domain).unwrap_or(1.0);
    let mirrored = |X: &SVector<f64, D>, axis: usize| {
        SVector::<f64, D>::from_fn(|a, _| if a == axis { -X[a] } else { X[a] })
    };
    let is_symmetric = |axis: usize| {
        (0..PLACES).filter_map(|n| points::interior(&domain, exact.period(), n)).all(|(X, t)| {
            let there = exact.displacement(&mirrored(&X, axis), t);
            let here = mirrored(&exact.displacement(&X, t), axis);
            (there - here).norm() <= ROUNDING * size
        })
    };
    if !(0..D).all(is_symmetric) {
        return Vec::new();
    }
    let planes = (0..D).map(Surface::Lower);
    let declared = |s: &Surface| exact.boundaries().iter().any(|b| b.surface == *s);
    planes.filter(|plane| !declared(plane)).collect()
}
