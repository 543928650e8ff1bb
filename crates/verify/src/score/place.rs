//! From where and in which units the files have a body to where and how the solution has it.

use nalgebra::SVector;

use super::error::ScoreError;
use super::options::Placing;

/// How positions, displacements and tensors of the files become those of the solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place<const D: usize> {
    pub(super) origin: SVector<f64, D>,
    /// Which components of the files are along the solution's axes.
    pub(super) axes: [usize; D],
    pub(super) length: f64,
    pub(super) velocity: f64,
    /// Whether points of fewer components have the first ones along the solution's axes: radius and height of a half plane.
    is_of_half_plane: bool,
}

impl<const D: usize> Place<D> {
    /// Checks that there is a number for each axis, and that units are units.
    pub(super) fn new(placing: &Placing, is_of_half_plane: bool) -> Result<Self, ScoreError> {
        let Placing { origin, axes, length_unit, time_unit, velocity_unit, .. } = placing;
        for (what, found) in [("--origin", origin.len()), ("--axes", axes.len())] {
            if found != 0 && found != D {
                return Err(ScoreError::Entries { what, found, expected: D });
            }
        }
        if axes.iter().enumerate().any(|(n, axis)| axes[..n].contains(axis)) {
            return Err(ScoreError::RepeatedAxis);
        }
        let velocity = velocity_unit.unwrap_or(length_unit / time_unit);
        let units =
            [("length unit", *length_unit), ("time unit", *time_unit), ("velocity unit", velocity)];
        for (what, value) in units {
            if !(value > 0.0 && value.is_finite()) {
                return Err(ScoreError::Setting { what, value, admissible: "a positive number" });
            }
        }
        Ok(Self {
            origin: SVector::from_fn(|i, _| origin.get(i).copied().unwrap_or(0.0)),
            axes: std::array::from_fn(|i| axes.get(i).copied().unwrap_or(i)),
            length: *length_unit,
            velocity,
            is_of_half_plane,
        })
    }

    /// The axes of arrays that have so many dimensions; the first ones where the files leave the others out.
    pub(super) fn axes_of(&self, dimensions: usize) -> [usize; D] {
        if self.axes.iter().all(|axis| *axis < dimensions) {
            self.axes
        } else {
            std::array::from_fn(|i| i)
        }
    }

    /// The axes of points that have so many components.
    pub(super) fn axes_of_points(&self, components: usize) -> [usize; D] {
        if self.is_of_half_plane { self.axes_of(components) } else { self.axes }
    }

    /// A position of the solution.
    pub(super) fn position(&self, position: SVector<f64, D>) -> SVector<f64, D> {
        // Nothing changes a bit where nothing is to be changed.
        position * self.length - self.origin
    }
}
