//! Motions that turn the body inside out: `J <= 0` at some place and time.

use mmsmith_runtime::{AnySolution, Solution, Surface};
use nalgebra::SVector;
use serde::Serialize;

use crate::dimension::in_dimension;
use crate::points;

/// Places in the body at which `J` is looked at, and as many on each surface, where stretches are extreme.
const PLACES: usize = 100;
/// Times within the period.
const TIMES: usize = 48;
/// Halvings of the time step in which the first inversion lies.
const HALVINGS: usize = 40;

/// Where and when a motion first turns the body inside out, as far as some hundred places show.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Inversion {
    /// The time from which on `J` is not positive at that place.
    pub t: f64,
    /// The reference position.
    pub X: Vec<f64>,
    /// The least `J` of all places and times, zero or negative, or not a number.
    pub least: f64,
}

/// Whether the motion of `solution` turns the body inside out within its period.
///
/// `None` where it does not, and for a shape or a dimension that is not known here.
#[must_use]
pub fn inversion(solution: &AnySolution<f64>) -> Option<Inversion> {
    in_dimension!(solution, |s| inversion_in(s), else None)
}

fn inversion_in<const D: usize>(solution: &dyn Solution<f64, D>) -> Option<Inversion> {
    let places = places(solution);
    let step = solution.period() / TIMES as f64;
    let is_inverted = |X: &SVector<f64, D>, t: f64| {
        let J = solution.jacobian(X, t);
        J <= 0.0 || J.is_nan()
    };
    let inverted = |n: &usize| places.iter().find(|X| is_inverted(X, *n as f64 * step));
    let (first, X) = (0..=TIMES).find_map(|n| Some((n, inverted(&n)?)))?;
    let (mut before, mut t) = ((first as f64 - 1.0).max(0.0) * step, first as f64 * step);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (before + t);
        if is_inverted(X, middle) { t = middle } else { before = middle }
    }
    let all = places.iter().flat_map(|X| (0..=TIMES).map(move |n| (X, n as f64 * step)));
    let least = all
        .map(|(X, t)| solution.jacobian(X, t))
        .fold(f64::INFINITY, |least, J| if J < least || J.is_nan() { J } else { least });
    Some(Inversion { t, X: X.iter().copied().collect(), least })
}

fn places<const D: usize>(solution: &dyn Solution<f64, D>) -> Vec<SVector<f64, D>> {
    let domain = &solution.domain();
    let on = Surface::all(D)
        .flat_map(|at| (0..PLACES).map_while(move |n| Some(points::surface(domain, at, n)?.0)));
    let within =
        (0..PLACES).filter_map(|n| Some(points::interior(domain, solution.period(), n)?.0));
    within.chain(on).collect()
}
