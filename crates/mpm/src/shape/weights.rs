//! Weights of one particle at its nodes, as products over the axes.

use mmsmith_lanes::simd::Lanes;
use mmsmith_lanes::tensor::real;
use nalgebra::SMatrix;

use crate::shape::one_axis::{AxisWeights, EXTENDED, OnAxis, extended_axes, moment};

/// The weights `S_ip` of one particle and their gradients `G_ip`, however they are stored.
///
/// The particle's nodes form a box of `W` nodes along each axis; `place` counts them from 0 to `W - 1`.
pub(crate) trait Weights<T: Lanes, const D: usize, const W: usize> {
    /// Whether there are affine velocities (APIC), and weights `Z` for them.
    const AFFINE: bool;
    /// Index of the first node.
    fn first_node(&self) -> usize;
    /// Factor of the weight along an axis.
    fn S(&self, axis: usize, place: usize) -> T;
    /// Derivative of that factor, per cell.
    fn G(&self, axis: usize, place: usize) -> T;
    /// That factor times the arm from the particle to the node, in cells.
    fn Z(&self, axis: usize, place: usize) -> T;
    /// The affine velocity per cell, `B D^-1`: from `B = sum v S arm`, by the inertia `D = sum S arm arm`, and the velocity
    /// gradient per cell.
    fn affine(&self, moment: SMatrix<T, D, D>, gradient: &SMatrix<T, D, D>) -> SMatrix<T, D, D>;
}

/// Whether `place` is the middle one of three nodes along an axis. Kernels compute its weight from the outer two, as weights
/// add up to one, gradients and first moments to zero.
#[inline(always)]
pub(crate) const fn is_middle<const W: usize>(place: usize) -> bool {
    W == 3 && place == 1
}

/// Weights of a box with extended support: more than three nodes along some axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ExtendedWeights<T, const D: usize, const AFFINE: bool> {
    axes: [AxisWeights<T, EXTENDED>; D],
    /// Positions in cells, from the first node.
    place: [T; D],
    first_node: usize,
}

impl<T: Lanes, const D: usize, const AFFINE: bool> ExtendedWeights<T, D, AFFINE> {
    #[inline(never)]
    pub(crate) fn new(
        on_axis: OnAxis,
        xi: &[T; D],
        l: &[T; D],
        (strides, nodes_before): (&[usize; D], usize),
    ) -> Self {
        let axes = extended_axes(on_axis, xi, l);
        let first_node: usize = (0..D).map(|a| axes[a].base as usize * strides[a]).sum();
        let first_node = first_node - nodes_before;
        Self { place: std::array::from_fn(|a| axes[a].after_first(xi[a])), axes, first_node }
    }
}

/// At the first `W` nodes along each axis; the others have to have no weight.
impl<T: Lanes, const D: usize, const W: usize, const AFFINE: bool> Weights<T, D, W>
    for ExtendedWeights<T, D, AFFINE>
{
    const AFFINE: bool = AFFINE;

    #[inline(always)]
    fn first_node(&self) -> usize {
        self.first_node
    }

    #[inline(always)]
    fn S(&self, axis: usize, place: usize) -> T {
        self.axes[axis].S[place]
    }

    #[inline(always)]
    fn G(&self, axis: usize, place: usize) -> T {
        self.axes[axis].G[place]
    }

    #[inline(always)]
    fn Z(&self, axis: usize, place: usize) -> T {
        self.axes[axis].S[place] * (real::<T>(place as f64) - self.place[axis])
    }

    fn affine(&self, mut moments: SMatrix<T, D, D>, _: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        for (a, mut column) in moments.column_iter_mut().enumerate() {
            column *= moment(&self.axes[a].S, self.place[a]).recip();
        }
        moments
    }
}
