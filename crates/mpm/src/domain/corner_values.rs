//! Values of the grid at the corners that domains share.

use mmsmith_lanes::simd::{Lane4, Lanes};

use crate::grid::node::Node;

/// Vectors at a corner, one for each axis: of momenta that go by the arm to a node, or of moments of velocities. The last number of four is
/// zero.
pub(crate) type AlongAxes<T, const D: usize> = [Lane4<T>; D];

/// Values of the grid at all corners.
pub(crate) struct CornerValues<T, const D: usize> {
    /// Interpolated values of nodes.
    pub(crate) nodes: Vec<Node<T, D>>,
    /// APIC of cells: the moments `sum v N_i arm` about each corner, in cells; else empty.
    pub(crate) moments: Vec<AlongAxes<T, D>>,
}

impl<T: Lanes, const D: usize> CornerValues<T, D> {
    /// Values without corners.
    pub(crate) fn none() -> Self {
        Self { nodes: Vec::new(), moments: Vec::new() }
    }

    /// Makes room for so many corners.
    pub(crate) fn fit(&mut self, count: usize, has_moments: bool) {
        self.nodes.resize(count, Node::zero());
        self.moments.resize(if has_moments { count } else { 0 }, [Lane4::zero(); D]);
    }
}
