//! Fields on the axis, or the centre, of curvilinear coordinates and next to it, where their formulas divide by the radius.

use crate::error::SceneError;
use crate::field_row::{FieldRow, evaluate_in};
use crate::points::{outside, size};
use mmsmith_runtime::{Domain, Real, Solution};
use nalgebra::SVector;
use serde::Serialize;

/// The number of distances at which fields are taken, on either side of the axis.
const DISTANCES: i32 = 6;
/// The nearest distance as a share of the body's size: small beside the body, large beside what rounding loses in quotients by the distance.
const SHARE: f64 = 0.005;
/// The distance from the axis, as a share of the body's size, within which formulas lose digits.
const NEAR: f64 = 0.001;
/// The difference of limits from two sets of distances up to which there is a limit, as a share of the field's largest value.
const SAME: f64 = 1e-7;

/// The state of the fields on an axis of coordinates within the body, where the formulas give no finite numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OnAxis {
    /// A place on the axis.
    pub X: Vec<f64>,
    /// A time.
    pub t: f64,
    /// Whether all fields have limits there.
    pub has_limit: bool,
    /// The fields that have no finite value by their formulas.
    pub fields: Vec<String>,
}

/// The fields at a place, as limits where the place lies on an axis of coordinates or next to it and the formulas have none.
///
/// Along a line through the axis every Cartesian entry of a smooth field is smooth, so that values at six distances on either side have a
/// polynomial. A field whose polynomial depends on the distances has no limit: its `row` stays as it is.
pub(crate) fn beside_axis<const D: usize>(
    solution: &dyn Solution<f64, D>,
    X: &SVector<f64, D>,
    t: f64,
    row: FieldRow,
) -> FieldRow {
    let Some(foot) = foot(&solution.domain(), X) else { return row };
    let on_axis = evaluate_in(solution, &foot, t);
    if on_axis.not_finite.is_empty() || on_axis.why.is_some() {
        return row;
    }
    match limit(solution, X, t) {
        Some(limit) => FieldRow { outside: row.outside, ..limit },
        None if row.not_finite.is_empty() => row,
        None => FieldRow {
            why: Some("the fields have no limit on the axis: the motion, or the stress, is not smooth there".into()),
            ..row
        },
    }
}

/// The fields on an axis of coordinates within the body, where the formulas give no finite numbers; `None` where they do, and where the body
/// contains none.
pub(crate) fn on_axis<const D: usize>(solution: &dyn Solution<f64, D>) -> Option<OnAxis> {
    let domain = solution.domain();
    let heights: Vec<f64> = match &domain {
        _ if D < 3 => vec![0.0],
        Domain::Tube { lower, upper, .. } => vec![lower + 0.37 * (upper - lower)],
        Domain::Box { lower, upper } => vec![lower[2] + 0.37 * (upper[2] - lower[2])],
        Domain::Annulus { inner, outer } => vec![inner + 0.37 * (outer - inner)],
        _ => Vec::new(),
    };
    let size = size(&domain)?;
    let period = solution.period();
    let t = if period.is_finite() { 0.31 * period } else { 0.0 };
    heights.into_iter().find_map(|height| {
        let X = SVector::from_fn(|i, _| if i == 2 { height } else { 0.0 });
        outside(&domain, &X).filter(|share| *share <= 0.0)?;
        let row = evaluate_in(solution, &X, t);
        // Where there are no fields beside it either, the axis is not the cause.
        let beside = X + SVector::from_fn(|i, _| if i == 0 { SHARE * size } else { 0.0 });
        if !evaluate_in(solution, &beside, t).not_finite.is_empty() {
            return None;
        }
        (!row.not_finite.is_empty() && row.why.is_none()).then(|| OnAxis {
            X: X.iter().copied().collect(),
            t,
            has_limit: limit(solution, &X, t).is_some(),
            fields: row.not_finite,
        })
    })
}

/// Refuses points of a solver on an axis of coordinates, or so near that rounding takes all digits, where formulas divide by the radius.
pub(crate) fn refuse_on_axis<T: Real, const D: usize>(
    exact: &dyn Solution<f64, D>,
    points: &[SVector<T, D>],
) -> Result<(), SceneError> {
    let Some(near) = size(&exact.domain()).map(|size| 1e-9 * size) else { return Ok(()) };
    let is_near = |X: &&SVector<T, D>| D > 1 && X[0].to_f64().hypot(X[1 % D].to_f64()) <= near;
    let Some(X) = points.iter().find(is_near) else { return Ok(()) };
    let foot = SVector::from_fn(|i, _| if i < 2 { 0.0 } else { X[i].to_f64() });
    if exact.is_half_plane() || evaluate_in(exact, &foot, 0.0).not_finite.is_empty() {
        return Ok(());
    }
    Err(SceneError::PointOnAxis { X: foot.iter().copied().collect() })
}

/// The place on the axis `Z`, or in the plane the origin, next to a place; `None` of places that are not near.
fn foot<const D: usize>(domain: &Domain<f64, D>, X: &SVector<f64, D>) -> Option<SVector<f64, D>> {
    let is_near = D > 1 && X[0].hypot(X[1 % D]) <= NEAR * size(domain)?;
    is_near.then(|| SVector::from_fn(|i, _| if i < 2 { 0.0 } else { X[i] }))
}

/// All fields at a place next to the axis from places farther away; `None` where these tell different values.
fn limit<const D: usize>(
    solution: &dyn Solution<f64, D>,
    X: &SVector<f64, D>,
    t: f64,
) -> Option<FieldRow> {
    let size = size(&solution.domain())?;
    let [(near, largest), (far, _)] =
        [1.0, 2.0].map(|times| interpolated(solution, X, t, times * SHARE * size));
    let (near, far) = (near?, far?);
    // Components of one variable are measured by the largest of them: others of it may be nothing but rounding.
    let stem = |name: &str| name.trim_end_matches(|c: char| c.is_ascii_digit()).to_owned();
    let is_same = near.named().iter().zip(far.named()).all(|((name, _, near), (_, _, far))| {
        let own = largest.iter().filter(|(known, _)| stem(known) == stem(name));
        let largest = own.fold(0.0, |most: f64, (_, own)| most.max(*own));
        near.iter().zip(far).all(|(near, far)| (near - far).abs() <= SAME * largest)
    });
    is_same.then_some(far)
}

/// The polynomial of the fields along the line through a place and the axis, and the largest value of each field at its nodes.
fn interpolated<const D: usize>(
    solution: &dyn Solution<f64, D>,
    X: &SVector<f64, D>,
    t: f64,
    step: f64,
) -> (Option<FieldRow>, Vec<(String, f64)>) {
    let distance = X[0].hypot(X[1 % D]);
    let direction: SVector<f64, D> = SVector::from_fn(|i, _| match i {
        0 | 1 if distance > 0.0 => X[i] / distance,
        0 => 1.0,
        _ => 0.0,
    });
    let nodes: Vec<f64> =
        (1..=DISTANCES).flat_map(|k| [1, -1].map(|side| f64::from(side * k) * step)).collect();
    let (mut sum, mut largest): (Option<FieldRow>, Vec<(String, f64)>) = (None, Vec::new());
    for own in &nodes {
        // Lagrange's weight.
        let others = nodes.iter().filter(|other| *other != own);
        let weight: f64 = others.map(|other| (distance - other) / (own - other)).product();
        let mut row = evaluate_in(solution, &(X + direction * (own - distance)), t);
        if !row.not_finite.is_empty() {
            return (None, largest);
        }
        for (name, _, values) in row.named() {
            let most = values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
            match largest.iter_mut().find(|(known, _)| known == name) {
                Some((_, known)) => *known = known.max(most),
                None => largest.push((name.to_owned(), most)),
            }
        }
        row.values().for_each(|value| *value *= weight);
        match &mut sum {
            None => sum = Some(row),
            Some(sum) => sum.values().zip(row.values()).for_each(|(sum, own)| *sum += *own),
        }
    }
    // A body force that is nothing has the rounding of the acceleration and of the stress.
    let of = |name: &str| largest.iter().find(|(known, _)| known == name).map_or(0.0, |own| own.1);
    let rounding = of("a").max(of("P") / (solution.density() * step * f64::from(DISTANCES)));
    if let Some((_, of_b)) = largest.iter_mut().find(|(known, _)| known == "b") {
        *of_b = of_b.max(1e-3 * rounding);
    }
    (sum, largest)
}
