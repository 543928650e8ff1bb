//! Positions and other vectors of a frame's particles, and what is to be said about them.

use mmsmith_vtk::foreign::Snapshot;
use nalgebra::SVector;

use super::ScoreError;
use super::arrays::{not_finite, vectors};
use super::findings::Remarks;
use super::place::Place;

/// The names of the components of positions.
const AXES: [&str; 3] = ["x", "y", "z"];

/// The points of a frame in `D` dimensions.
pub(super) struct Positions<const D: usize> {
    pub(super) all: Vec<SVector<f64, D>>,
    /// The coordinates across the solution's plane or line in rising order, where any is not zero.
    pub(super) across: Vec<f64>,
}

/// The points of a frame, where the solution has them.
pub(super) fn positions<const D: usize>(
    snapshot: &Snapshot,
    place: &Place<D>,
    remarks: &mut Remarks,
) -> Result<Positions<D>, ScoreError> {
    let path = || snapshot.path().to_owned();
    let head = snapshot.points().ok_or_else(|| ScoreError::NoPositions {
        path: path(),
        arrays: snapshot.arrays().iter().map(|head| head.name.clone()).collect(),
    })?;
    let axes = place.axes_of_points(head.components);
    let least = axes.iter().max().map_or(D, |axis| axis + 1);
    if head.components < least || head.components > 3 {
        let found = head.components;
        return Err(ScoreError::Coordinates { path: path(), found, expected: least });
    }
    if head.is_single {
        let what =
            "points are 32-bit floats: errors below about 1e-7 of their coordinates are rounding";
        remarks.note("single-precision", false, what);
    }
    let flat = snapshot.positions()?;
    count_not_finite(&flat, head.components, "position", snapshot, remarks);
    let (mut all, beyond) = vectors(&flat, head.components, axes);
    all.iter_mut().for_each(|x| *x = place.position(*x));
    let across = if beyond.is_some() { across(&flat, head.components, axes) } else { vec![] };
    Ok(Positions { all, across })
}

/// The coordinates that the solution does not have, in rising order.
fn across<const D: usize>(flat: &[f64], components: usize, axes: [usize; D]) -> Vec<f64> {
    let row = |row: &[f64]| {
        let others = row.iter().enumerate().filter(|(axis, _)| !axes.contains(axis));
        others.map(|(_, value)| *value).collect::<Vec<_>>()
    };
    let mut across: Vec<f64> = flat.chunks_exact(components).flat_map(row).collect();
    across.sort_by(f64::total_cmp);
    across
}

/// Where particles stand across the plane, in words.
pub(super) fn sheets(across: &[f64]) -> String {
    const MOST: usize = 4;
    let mut places = across.to_vec();
    places.dedup();
    let named: Vec<_> = places.iter().map(|place| format!("{place:?}")).collect();
    match named.len() {
        0..=MOST => named.join(", "),
        count => format!("{count} places from {} to {}", named[0], named[count - 1]),
    }
}

/// Vectors from numbers, and what is to be said about them.
pub(super) fn judged<const D: usize>(
    flat: &[f64],
    components: usize,
    what: &str,
    place: &Place<D>,
    snapshot: &Snapshot,
    remarks: &mut Remarks,
) -> Vec<SVector<f64, D>> {
    count_not_finite(flat, components, what, snapshot, remarks);
    let axes = place.axes_of(components);
    let (vectors, beyond) = vectors(flat, components, axes);
    if let Some((count, first)) = beyond {
        let hint = other_axes(flat, components, axes);
        let what = format!(
            "particle(s) whose {what} has a part beyond the solution's {D} dimension(s){hint}"
        );
        remarks.met("out-of-plane", true, count, what, || particle(first, snapshot));
    }
    vectors
}

/// The option that takes the plane in which vectors lie, where that is another one.
fn other_axes<const D: usize>(flat: &[f64], components: usize, axes: [usize; D]) -> String {
    let changes = |axis: &usize| flat.chunks_exact(components).any(|row| row[*axis] != 0.0);
    let changing: Vec<usize> = (0..components).filter(changes).collect();
    if changing.len() != D || changing == axes {
        return String::new();
    }
    let names: Vec<_> = changing.iter().map(|axis| AXES[*axis]).collect();
    format!("; they lie in the plane of --axes {}", names.join(","))
}

/// Remarks on numbers that are not finite.
pub(super) fn count_not_finite(
    flat: &[f64],
    components: usize,
    what: &str,
    snapshot: &Snapshot,
    remarks: &mut Remarks,
) {
    let (count, first) = not_finite(flat, components);
    let what = format!("particle(s) whose {what} is not finite");
    remarks.met("not-finite", true, count, what, || particle(first, snapshot));
}

/// Whether two lists hold the same points, in any order, to the bit.
pub(super) fn are_same_places(one: &[f64], other: &[f64], components: usize) -> bool {
    if one == other {
        return true;
    }
    let sorted = |flat: &[f64]| {
        let bits = |row: &[f64]| row.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        let mut rows: Vec<_> = flat.chunks_exact(components.max(1)).map(bits).collect();
        rows.sort_unstable();
        rows
    };
    one.len() == other.len() && sorted(one) == sorted(other)
}

/// A particle, for messages.
pub(super) fn particle(particle: usize, snapshot: &Snapshot) -> String {
    format!("particle {particle} of {}", snapshot.path().display())
}
