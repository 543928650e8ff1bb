//! The state of a running simulation: particles, grid and bins.

use nalgebra::{RealField, SMatrix};

use crate::geometry::Constants;
use crate::grid::Layout;
use crate::health::Outcome;
use crate::node::Node;
use crate::parallel::bins::Bins;
use crate::particles::Particles;
use crate::shape_function::{ShapeChoice, first_layer};

/// Everything that a step reads and changes.
#[derive(Debug)]
pub(crate) struct State<T, const D: usize> {
    pub(crate) particles: Particles<T, D>,
    /// Mass and volume of every particle, where they are uniform.
    pub(crate) uniform: Option<(T, T)>,
    pub(crate) constants: Constants<T, D>,
    pub(crate) layout: Layout<D>,
    pub(crate) bins: Bins,
    pub(crate) nodes: Vec<Node<T, D>>,
    /// USF: F at the end of the step, while the weights still need F at its start.
    pub(crate) F_next: Vec<SMatrix<T, D, D>>,
    /// MUSL: velocities projected from the updated particles, one per node.
    pub(crate) reprojected: Vec<Node<T, D>>,
    /// USL: the grid of the next step while particles add to it.
    pub(crate) next: Vec<Node<T, D>>,
    /// USL: whether `nodes` has the velocities and accelerations of the next step, with no factor on the latter.
    pub(crate) is_ahead: bool,
    /// Buffer for the part of the body force that depends on time alone.
    pub(crate) of_time: Vec<T>,
}

impl<T: RealField + Copy, const D: usize> State<T, D> {
    /// Sorts the particles into bins, if one of them left its bin in the last pass.
    pub(crate) fn resort_if<R, const W: usize>(&mut self, outcome: Outcome, shape: R) -> Outcome
    where
        R: ShapeChoice<T, D, W>,
    {
        if outcome.resort && outcome.failure.is_none() {
            self.sort(shape);
        }
        outcome
    }

    /// Sorts the particles into bins.
    #[inline(never)]
    pub(crate) fn sort<R, const W: usize>(&mut self, shape: R)
    where
        R: ShapeChoice<T, D, W>,
    {
        let (c, Particles { x, F, .. }) = (self.constants, &self.particles);
        self.bins.sort(&self.layout, &|p| {
            let xi = c.in_cells(&x[p]);
            let layer = |a| first_layer(xi[a], shape.half_size(a, F[p][(a, a)]));
            (0..D).map(|a| layer(a) * c.strides[a]).sum()
        });
    }
}
