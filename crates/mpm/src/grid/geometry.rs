//! The grid's geometry and the constants of a run, as kernels need them.

use std::array;

use mmsmith_lanes::tensor::{product, real};
use mmsmith_laws::fault::{Fault, Planted};
use mmsmith_particles::Grid;
use nalgebra::{RealField, SMatrix, SVector};

use crate::grid::Layout;
use crate::grid::bins::Window;
use crate::grid::node::{Components, Node};
use crate::grid::tiles::Tiles;
use crate::shape::one_axis::HALF_SIZE_LIMIT;

/// Constants of a run: the grid's geometry, its tiles, the time step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Constants<T, const D: usize> {
    pub(crate) lower: SVector<T, D>,
    pub(crate) upper: SVector<T, D>,
    /// Whether its lower and its upper face across each axis are walls.
    walls: [[bool; 2]; D],
    pub(crate) inverse_spacing: T,
    /// Distance in memory between neighbouring nodes along each axis.
    pub(crate) strides: [usize; D],
    /// The nodes of the grid before the first one that this process holds, a whole number.
    pub(crate) nodes_before: f64,
    pub(crate) tiles: Tiles<D>,
    pub(crate) time_step: T,
    /// The first numbers of a node, which other processes get.
    pub(crate) sent: usize,
    /// Nodes with less mass than this count as empty.
    least_mass: T,
    pub(crate) planted: Planted,
}

impl<T: RealField + Copy, const D: usize> Constants<T, D> {
    pub(crate) fn new(
        grid: &Grid<T, D>,
        layout: &Layout<D>,
        tiles: &Tiles<D>,
        time_step: T,
        least_particle_mass: T,
    ) -> Self {
        Self {
            lower: grid.lower,
            upper: grid.upper(),
            walls: grid.walls,
            inverse_spacing: grid.spacing.recip(),
            strides: layout.strides,
            nodes_before: layout.nodes_before() as f64,
            tiles: *tiles,
            time_step,
            sent: Node::<T, D>::SCALAR,
            // Weights below the square of the rounding error only come about by rounding.
            least_mass: least_particle_mass * T::default_epsilon() * T::default_epsilon(),
            planted: Planted::here(),
        }
    }

    /// These constants with the indices of nodes as they are in a window.
    pub(crate) fn in_window<N>(&self, window: &Window<'_, N, D>) -> Self {
        Self { strides: window.strides, nodes_before: window.nodes_before, ..*self }
    }

    /// These constants for the half plane of a body of revolution, of the first axis and the last.
    pub(crate) fn half_plane(&self) -> Constants<T, 2> {
        let axes = [0, D - 1];
        Constants {
            lower: axes.map(|a| self.lower[a]).into(),
            upper: axes.map(|a| self.upper[a]).into(),
            walls: axes.map(|a| self.walls[a]),
            inverse_spacing: self.inverse_spacing,
            strides: axes.map(|a| self.strides[a]),
            nodes_before: self.nodes_before,
            tiles: self.tiles.half_plane(),
            time_step: self.time_step,
            sent: self.sent,
            least_mass: self.least_mass,
            planted: self.planted,
        }
    }

    /// Position in cells, from the lower corner.
    #[inline(always)]
    pub(crate) fn in_cells(&self, x: &SVector<T, D>) -> [T; D] {
        array::from_fn(|a| (x[a] - self.lower[a]) * self.inverse_spacing)
    }

    /// `(I + dt L) F`, for a velocity gradient `L` per cell.
    #[inline(always)]
    pub(crate) fn stretch(&self, L: &SMatrix<T, D, D>, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        self.stretch_for(self.time_step, L, F)
    }

    /// `(I + time L) F`, as [`stretch`](Self::stretch) for any time.
    #[inline(always)]
    pub(crate) fn stretch_for(
        &self,
        time: T,
        L: &SMatrix<T, D, D>,
        F: &SMatrix<T, D, D>,
    ) -> SMatrix<T, D, D> {
        let change = L * (time * self.inverse_spacing);
        if self.planted.is(Fault::AdditiveStretch) {
            return F + change;
        }
        if self.planted.is(Fault::GradientTransposed) {
            return F + product(&change.transpose(), F);
        }
        F + product(&change, F)
    }

    /// The reciprocal of a node's mass, or zero for an empty node.
    #[inline(always)]
    pub(crate) fn inverse_mass(&self, node: &Node<T, D>) -> T {
        if node.mass() > self.least_mass { node.mass().recip() } else { T::zero() }
    }

    /// The contribution of a ghost node beyond a wall to its mirror image.
    #[inline(always)]
    pub(crate) fn ghost(&self, mut ghost: Node<T, D>) -> Node<T, D> {
        if self.planted.is(Fault::GhostMassLost) {
            ghost.values[Node::<T, D>::MASS] = T::zero();
        }
        ghost
    }

    /// Applies a wall that holds these components to a node on it.
    #[inline(always)]
    pub(crate) fn clear(&self, node: &mut Node<T, D>, held: Components) {
        let kept = *node;
        node.clear(held);
        for a in held.each::<D>() {
            if self.planted.is(Fault::WallsKeepVelocity) {
                node.values[a] = kept.values[a];
            }
            if self.planted.is(Fault::WallsKeepAcceleration) {
                node.second_mut()[a] = kept.second()[a];
            }
        }
    }

    /// Number of cells along each axis.
    pub(crate) fn upper_in_cells(&self) -> [T; D] {
        self.in_cells(&self.upper)
    }

    /// Edge of a cell.
    pub(crate) fn spacing(&self) -> T {
        self.inverse_spacing.recip()
    }

    /// Ends of the grid along an axis.
    pub(crate) fn range(&self, axis: usize) -> (T, T) {
        (self.lower[axis], self.upper[axis])
    }

    /// Whether `x` lies on a wall across an axis.
    pub(crate) fn is_on_wall(&self, x: &SVector<T, D>, axis: usize) -> bool {
        let [lower, upper] = self.walls[axis];
        (lower && x[axis] == self.lower[axis]) || (upper && x[axis] == self.upper[axis])
    }

    /// The first axis along which `x` lies so far outside the grid that there are no nodes for it.
    pub(crate) fn axis_beyond(&self, x: &SVector<T, D>) -> Option<usize> {
        let margin = self.spacing() * real(HALF_SIZE_LIMIT);
        (0..D).find(|&a| !(x[a] >= self.lower[a] - margin && x[a] <= self.upper[a] + margin))
    }

    /// The first axis along which `x` lies outside the grid.
    pub(crate) fn axis_outside(&self, x: &SVector<T, D>) -> Option<usize> {
        (0..D).find(|&a| !(x[a] >= self.lower[a] && x[a] <= self.upper[a]))
    }
}
