//! Particles that change their order from frame to frame without an identity.

use mmsmith_runtime::Solution;
use mmsmith_vtk::foreign::{ArrayHead, Snapshot};
use nalgebra::SVector;
use std::collections::BTreeSet;

use super::data::FrameData;
use super::error::ScoreError;
use super::found::Found;
use super::times::open;

/// The largest share of the error that is left when both sets of positions are put in order.
const LEFT: f64 = 0.1;
/// The share of the error by which neighbours' errors differ at least, where it is not smooth.
const ROUGH: f64 = 0.5;
/// Particles whose neighbours are looked for.
const LOOKED_AT: usize = 64;

/// Whether positions are the exact ones in another order: as sets they are far closer than one by one, and the errors of neighbours
/// have nothing to do with each other.
pub(super) fn is_shuffled<const D: usize>(
    exact: &dyn Solution<f64, D>,
    data: &FrameData<D>,
    time: f64,
) -> bool {
    let pairs: Vec<(SVector<f64, D>, SVector<f64, D>)> = data
        .X
        .iter()
        .zip(&data.u)
        .map(|(X, u)| (X + u, X + exact.displacement(X, time)))
        .filter(|(found, right)| found.iter().chain(right.iter()).all(|value| value.is_finite()))
        .collect();
    let error = |pair: &(SVector<f64, D>, SVector<f64, D>)| pair.0 - pair.1;
    let one_by_one: f64 = pairs.iter().map(|pair| error(pair).norm_squared()).sum();
    let in_order: f64 = (0..D).map(|axis| apart_in_order(&pairs, axis)).sum();
    if pairs.len() < 2 || in_order.sqrt() > LEFT * one_by_one.sqrt() {
        return false;
    }
    let (mut difference, mut size) = (0.0, 0.0);
    for n in (0..pairs.len()).step_by(pairs.len().div_ceil(LOOKED_AT)) {
        let distance = |m: &usize| (pairs[*m].1 - pairs[n].1).norm_squared();
        let others = (0..pairs.len()).filter(|m| *m != n);
        let nearest = others.min_by(|one, other| distance(one).total_cmp(&distance(other)));
        if let Some(nearest) = nearest {
            difference += (error(&pairs[n]) - error(&pairs[nearest])).norm_squared();
            size += error(&pairs[n]).norm_squared();
        }
    }
    difference.sqrt() > ROUGH * size.sqrt()
}

/// The sum of squares of what is between the coordinates along an axis, each of both sets in order.
fn apart_in_order<const D: usize>(
    pairs: &[(SVector<f64, D>, SVector<f64, D>)],
    axis: usize,
) -> f64 {
    let mut found: Vec<f64> = pairs.iter().map(|(found, _)| found[axis]).collect();
    let mut right: Vec<f64> = pairs.iter().map(|(_, right)| right[axis]).collect();
    found.sort_unstable_by(f64::total_cmp);
    right.sort_unstable_by(f64::total_cmp);
    found.iter().zip(&right).map(|(one, other)| (one - other).powi(2)).sum()
}

/// Message on a recording whose particles are in another order in some frame.
pub(super) fn told(found: &Found) -> Result<String, ScoreError> {
    let remedy = match identity(found)? {
        Some(name) => format!("--map id={name} takes its array `{name}` for their identities"),
        None => "write an array id with a number for each particle that it keeps, or the particles of all frames in one order"
            .into(),
    };
    Ok(format!(
        "the particles have another order than in the first frame, and nothing tells which is which: {remedy}"
    ))
}

/// An array of whole numbers, each at one particle, that are the same in the first and the last frame.
fn identity(found: &Found) -> Result<Option<String>, ScoreError> {
    let last = open(&found.timed[found.timed.len() - 1].file)?;
    let numbers = |snapshot: &Snapshot, head: &ArrayHead| -> Option<BTreeSet<i64>> {
        let all = snapshot.integers(&head.name).ok()??;
        let numbers: BTreeSet<i64> = all.iter().copied().collect();
        (numbers.len() == all.len()).then_some(numbers)
    };
    let scalars = found.first.arrays().iter().filter(|head| head.components == 1);
    let is_identity = |head: &&ArrayHead| {
        let first = numbers(&found.first, head);
        first.is_some() && first == numbers(&last, head)
    };
    Ok(scalars.into_iter().find(is_identity).map(|head| head.name.clone()))
}
