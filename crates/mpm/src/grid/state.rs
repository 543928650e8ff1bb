//! The grid of a running simulation: its nodes, and the particles above them sorted by tile.

use mmsmith_lanes::simd::Lanes;
use mmsmith_threads::held::Held;
use nalgebra::SVector;

use crate::every_scheme::Beyond;
use crate::grid::Layout;
use crate::grid::bins::Bins;
use crate::grid::geometry::Constants;
use crate::grid::node::Node;
use crate::grid::volume_rates::VolumeRates;

/// The grid: what all steps know of it, and its nodes.
pub(crate) struct GridState<T, const D: usize> {
    pub(crate) constants: Constants<T, D>,
    pub(crate) layout: Layout<D>,
    pub(crate) bins: Bins<Node<T, D>, D>,
    pub(crate) nodes: Vec<Node<T, D>>,
    /// MUSL: velocities projected from the updated particles; XPIC: a term of the filter. One per node.
    pub(crate) reprojected: Vec<Node<T, D>>,
    /// The fused pass: the grid of the next step while particles add to it; XPIC: the next term of the filter.
    pub(crate) next: Vec<Node<T, D>>,
    /// The fused pass: whether `nodes` has the velocities and accelerations of the next step, with no factor on the latter.
    pub(crate) is_ahead: bool,
    /// Where changes of volume follow the grid.
    pub(crate) rates: Option<Beyond<VolumeRates<T, D>>>,
    /// Means of scalars, where a change of volume is projected by means. One per node.
    pub(crate) means: Vec<Node<T, D>>,
    /// Means of scalars that follow from `means`. One per node.
    pub(crate) means_again: Vec<Node<T, D>>,
    /// XPIC: the filtered velocity at each node.
    pub(crate) filtered: Vec<SVector<T, D>>,
}

impl<T: Lanes, const D: usize> GridState<T, D> {
    /// Makes room for the tiles `held`, with so many particles or corners, and for the nodes that those reach.
    pub(crate) fn hold(&mut self, held: Held<D>, points: usize) {
        let Self { constants, layout, bins, .. } = self;
        bins.hold(held, points);
        let region = bins.lattice().region();
        if *region == layout.held {
            return;
        }
        layout.hold(region.clone());
        constants.strides = layout.strides;
        constants.nodes_before = layout.nodes_before() as f64;
        let resize = |nodes: &mut Vec<Node<T, D>>| {
            if !nodes.is_empty() {
                *nodes = vec![Node::zero(); layout.nodes];
            }
        };
        let Self { nodes, reprojected, next, means, means_again, .. } = self;
        [nodes, reprojected, next, means, means_again].into_iter().for_each(resize);
        if !self.filtered.is_empty() {
            self.filtered = vec![SVector::zeros(); layout.nodes];
        }
    }
}
