//! The background grid as a user states it.

use mmsmith_lanes::tensor::real;
use nalgebra::{RealField, SVector};

/// Background grid: a box of cubic cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid<T, const D: usize> {
    /// The corner with the smallest coordinates, a length.
    pub lower: SVector<T, D>,
    /// Edge of a cell, a length.
    pub spacing: T,
    /// Number of cells along each axis.
    pub cells: [usize; D],
    /// `walls[axis][0]` for the lower and `walls[axis][1]` for the upper face across an axis: whether it is a frictionless sliding
    /// wall, which is also a plane of symmetry. All other faces are open: no particle's centre may pass them.
    pub walls: [[bool; 2]; D],
}

impl<T: RealField + Copy, const D: usize> Grid<T, D> {
    /// The corner with the largest coordinates, a length.
    pub fn upper(&self) -> SVector<T, D> {
        SVector::from_fn(|a, _| self.lower[a] + self.spacing * real(self.cells[a] as f64))
    }
}
