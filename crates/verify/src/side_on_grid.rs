//! Conditions as the updated formulation models them: by walls of its grid, on which a body slides or is held, and by tractions on clipped
//! particles.

use mmsmith_runtime::{Boundary, ComponentCondition, Condition, Solution, Surface};

use crate::points;

/// A condition as the grid of the updated formulation and particles that are clipped with the boundary model it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum SideOnGrid {
    /// No traction.
    Free,
    /// A wall, along which the traction of the solution acts or none.
    Wall { is_loaded: bool },
    /// The traction of the solution.
    Loaded,
}

impl SideOnGrid {
    /// A plane side with a prescribed motion across it is a wall where this motion is none, and where the tractions along it are known.
    pub(crate) fn of<const D: usize>(exact: &dyn Solution<f64, D>, boundary: &Boundary) -> Self {
        let &Boundary { surface, condition } = boundary;
        match condition {
            Condition::Sliding | Condition::Symmetry => Self::Wall { is_loaded: false },
            Condition::TractionFree => Self::Free,
            Condition::PrescribedTraction | Condition::PrescribedMotion => Self::Loaded,
            Condition::Mixed(_) => match surface.axis() {
                Some(axis) if stands_still(exact, surface, axis) => {
                    let along = |one| (0..D).any(|i| i != axis && condition.of(axis, i) == one);
                    let is_across =
                        condition.of(axis, axis) == ComponentCondition::PrescribedMotion;
                    match is_across && !along(ComponentCondition::PrescribedMotion) {
                        true => {
                            let is_loaded = along(ComponentCondition::PrescribedTraction);
                            Self::Wall { is_loaded }
                        }
                        false => Self::Loaded,
                    }
                }
                Some(_) | None => Self::Loaded,
            },
        }
    }

    pub(crate) fn is_wall(self) -> bool {
        matches!(self, Self::Wall { .. })
    }

    /// Whether the traction of the solution acts.
    pub(crate) fn is_loaded(self) -> bool {
        matches!(self, Self::Loaded | Self::Wall { is_loaded: true })
    }
}

/// The motion or the traction that is given on a side, as far as particles of a lattice can have it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Given {
    /// The side stands still: a wall holds it.
    Rest,
    /// The traction is none: the side is free.
    Nothing,
    /// Another one.
    Other,
}

impl Given {
    /// The given motion or traction of a side.
    pub(crate) fn of<const D: usize>(exact: &dyn Solution<f64, D>, boundary: &Boundary) -> Self {
        let &Boundary { surface, condition } = boundary;
        match condition {
            Condition::PrescribedMotion
                if (0..D).all(|axis| stands_still(exact, surface, axis)) =>
            {
                Self::Rest
            }
            Condition::PrescribedTraction if has_no_traction(exact, surface) => Self::Nothing,
            _ => Self::Other,
        }
    }
}

/// Places at which a side is looked at.
const PLACES: usize = 64;
/// Rounding of a traction, as a share of the largest stress.
const NO_TRACTION: f64 = 1e-12;

/// Whether a surface has no traction: none but for rounding, at sampled places and times.
fn has_no_traction<const D: usize>(exact: &dyn Solution<f64, D>, surface: Surface) -> bool {
    let domain = exact.domain();
    let (mut all_known, mut traction, mut largest) = (true, 0.0_f64, 0.0_f64);
    for n in 0..PLACES {
        let Some((X, _)) = points::surface(&domain, surface, n) else { return false };
        let t = exact.period() * points::quasirandom(n, D, D + 1);
        let here = exact.traction(surface, &X, t).map_or(f64::NAN, |here| here.amax());
        all_known &= !here.is_nan();
        traction = traction.max(here);
        if let Some((X, t)) = points::interior(&domain, exact.period(), n) {
            largest = largest.max(exact.first_piola_kirchhoff(&X, t).amax());
        }
    }
    all_known && traction <= NO_TRACTION * largest
}

/// Whether a surface has no motion along an axis: none but for rounding, at sampled places and times.
fn stands_still<const D: usize>(
    exact: &dyn Solution<f64, D>,
    surface: Surface,
    axis: usize,
) -> bool {
    let domain = exact.domain();
    let (mut across, mut largest) = (0.0_f64, 0.0_f64);
    for n in 0..PLACES {
        let Some((X, _)) = points::surface(&domain, surface, n) else { return false };
        let t = exact.period() * points::quasirandom(n, D, D + 1);
        across = across.max(exact.displacement(&X, t)[axis].abs());
        if let Some((X, t)) = points::interior(&domain, exact.period(), n) {
            largest = largest.max(exact.displacement(&X, t).amax());
        }
    }
    across <= 4.0 * f64::EPSILON * largest
}
