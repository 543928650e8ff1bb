//! Positions and other vectors of a frame's particles, and what is to be said about them.

use mmsmith_vtk::foreign::Snapshot;
use nalgebra::SVector;

use super::ScoreError;
use super::arrays::{not_finite, vectors};
use super::findings::Remarks;

/// The points of a frame in `D` dimensions.
pub(super) fn positions<const D: usize>(
    snapshot: &Snapshot,
    remarks: &mut Remarks,
) -> Result<Vec<SVector<f64, D>>, ScoreError> {
    let path = || snapshot.path().to_owned();
    let head = snapshot.points().ok_or_else(|| ScoreError::NoPositions { path: path() })?;
    if head.components < D || head.components > 3 {
        let found = head.components;
        return Err(ScoreError::Coordinates { path: path(), found, expected: D });
    }
    if head.is_single {
        let what =
            "points are 32-bit floats: errors below about 1e-7 of their coordinates are rounding";
        remarks.note("single-precision", false, what);
    }
    let flat = snapshot.positions()?;
    Ok(judged(&flat, head.components, "position", snapshot, remarks))
}

/// Vectors from numbers, and what is to be said about them.
pub(super) fn judged<const D: usize>(
    flat: &[f64],
    components: usize,
    what: &str,
    snapshot: &Snapshot,
    remarks: &mut Remarks,
) -> Vec<SVector<f64, D>> {
    count_not_finite(flat, components, what, snapshot, remarks);
    let (vectors, beyond) = vectors(flat, components);
    if let Some((count, first)) = beyond {
        let kind = "out-of-plane";
        let what =
            format!("particle(s) whose {what} has a part beyond the solution's {D} dimension(s)");
        remarks.met(kind, true, count, what, || place(first, snapshot));
    }
    vectors
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
    remarks.met("not-finite", true, count, what, || place(first, snapshot));
}

/// A particle, for messages.
pub(super) fn place(particle: usize, snapshot: &Snapshot) -> String {
    format!("particle {particle} of {}", snapshot.path().display())
}
