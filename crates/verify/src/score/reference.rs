//! Where reference positions and displacements come from.

use std::collections::HashMap;

use mmsmith_runtime::Solution;
use mmsmith_vtk::foreign::Snapshot;
use nalgebra::SVector;

use crate::inverse::inverse;

use super::arrays::{Role, there};
use super::error::ScoreError;
use super::findings::Remarks;
use super::found::Found;
use super::place::Place;
use super::times::{Timed, open};
use super::vectors::{are_same_places, positions};

/// Steps of Newton's method from a position back to its reference position.
const MOST_ITERATIONS: usize = 50;

/// How reference positions and displacements come about.
pub(super) enum Scheme<const D: usize> {
    /// `X` is an array; displacements are another, or positions minus it.
    Given { displacement: bool },
    /// Points are `X`.
    PointsAtRest,
    /// `X` is position minus displacement.
    Recovered,
    /// `X` was found for each particle of the first frame.
    Traced(Traced<D>),
}

/// The reference positions of the first frame's particles.
pub(super) struct Traced<const D: usize> {
    pub(super) X: Vec<SVector<f64, D>>,
    /// The place in `X` of each identity; none where particles keep their order.
    pub(super) places: Option<HashMap<i64, usize>>,
}

/// Decides how reference positions and displacements come about; `is_at_rest` tells whether points are reference positions.
pub(super) fn scheme<const D: usize>(
    exact: &dyn Solution<f64, D>,
    found: &Found,
    is_at_rest: bool,
    place: &Place<D>,
    is_inside_only: bool,
    remarks: &mut Remarks,
) -> Result<Scheme<D>, ScoreError> {
    let Found { timed, first, chosen, .. } = found;
    let displacement = chosen.name(Role::Displacement);
    if chosen.name(Role::ReferencePosition).is_some() {
        return Ok(Scheme::Given { displacement: displacement.is_some() });
    }
    if displacement.is_some() {
        return Ok(if is_at_rest { Scheme::PointsAtRest } else { Scheme::Recovered });
    }
    if timed.len() < 2 || stay(timed, first)? {
        return Err(ScoreError::NoDisplacement {
            path: first.path().to_owned(),
            there: there(first),
        });
    }
    let x = positions(first, place, remarks)?.all;
    trace(exact, &x, found, is_inside_only, remarks)
}

/// Whether no point moves in any frame, to the bit: a mesh whose displacements have an unknown name.
fn stay(timed: &[Timed], first: &Snapshot) -> Result<bool, ScoreError> {
    let positions = first.positions()?;
    for frame in &timed[1..] {
        let components = first.points().map_or(3, |head| head.components);
        if !are_same_places(&open(&frame.file)?.positions()?, &positions, components) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Finds the reference positions behind the positions of the first frame.
fn trace<const D: usize>(
    exact: &dyn Solution<f64, D>,
    x: &[SVector<f64, D>],
    Found { timed, first, chosen, .. }: &Found,
    is_inside_only: bool,
    remarks: &mut Remarks,
) -> Result<Scheme<D>, ScoreError> {
    let time = timed[0].time;
    let mut lost = (0, 0);
    let X = x
        .iter()
        .enumerate()
        .map(|(p, x)| {
            reference_position(exact, x, time).unwrap_or_else(|| {
                lost = if lost.0 == 0 { (1, p) } else { (lost.0 + 1, lost.1) };
                SVector::repeat(f64::NAN)
            })
        })
        .collect();
    remarks.met(
        "not-traced",
        !is_inside_only,
        lost.0,
        "particle(s) of the first frame lie where the exact motion brings no material point",
        || format!("particle {} of {}", lost.1, first.path().display()),
    );
    let ids = match chosen.name(Role::Id) {
        Some(name) => first.integers(name)?,
        None => None,
    };
    let found_by = if ids.is_some() { "identity" } else { "order" };
    remarks.note(
        "first-frame",
        false,
        format!(
            "the first frame's positions are taken to be exact at t = {time:?}; particles are found again by {found_by}"
        ),
    );
    let places =
        ids.map(|ids| ids.into_iter().enumerate().map(|(place, id)| (id, place)).collect());
    Ok(Scheme::Traced(Traced { X, places }))
}

/// The reference position that the exact motion brings to `x`, by Newton's method.
fn reference_position<const D: usize>(
    exact: &dyn Solution<f64, D>,
    x: &SVector<f64, D>,
    time: f64,
) -> Option<SVector<f64, D>> {
    let mut X = x - exact.displacement(x, time);
    for _ in 0..MOST_ITERATIONS {
        let miss = X + exact.displacement(&X, time) - x;
        let step = inverse(&exact.deformation_gradient(&X, time))? * miss;
        X -= step;
        if step.norm() <= 4.0 * f64::EPSILON * X.norm().max(x.norm()) {
            return Some(X);
        }
    }
    None
}
