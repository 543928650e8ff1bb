//! Weights of one particle at its nodes, as products over the axes.

use nalgebra::RealField;

use crate::shape_function::{AxisWeights, EXTENDED, extended_axes};

/// The weights `S_ip` of one particle and their gradients `G_ip`, however they are stored.
///
/// The particle's nodes form a box of `W` nodes along each axis; `place` counts them from 0 to `W - 1`.
pub(crate) trait Weights<T, const D: usize, const W: usize> {
    /// Index of the first node.
    fn first_node(&self) -> usize;
    /// Factor of the weight along an axis.
    fn S(&self, axis: usize, place: usize) -> T;
    /// Derivative of that factor, per cell.
    fn G(&self, axis: usize, place: usize) -> T;
}

/// Whether `place` is the middle one of three nodes along an axis. Kernels compute its weight from the outer two, as weights
/// add up to one and gradients to zero.
#[inline(always)]
pub(crate) const fn is_middle<const W: usize>(place: usize) -> bool {
    W == 3 && place == 1
}

/// Weights of a GIMP box with extended support: more than three nodes along some axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ExtendedWeights<T, const D: usize> {
    axes: [AxisWeights<T, EXTENDED>; D],
    first_node: usize,
}

impl<T: RealField + Copy, const D: usize> ExtendedWeights<T, D> {
    #[inline(never)]
    pub(crate) fn new(xi: &[T; D], l: &[T; D], strides: &[usize; D]) -> Self {
        let axes = extended_axes(xi, l);
        let first_node = (0..D).map(|a| axes[a].base as usize * strides[a]).sum();
        Self { axes, first_node }
    }
}

impl<T: RealField + Copy, const D: usize> Weights<T, D, EXTENDED> for ExtendedWeights<T, D> {
    fn first_node(&self) -> usize {
        self.first_node
    }

    fn S(&self, axis: usize, place: usize) -> T {
        self.axes[axis].S[place]
    }

    fn G(&self, axis: usize, place: usize) -> T {
        self.axes[axis].G[place]
    }
}
