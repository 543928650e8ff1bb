//! P2G and G2P of CPDI, whose weights are means over parallelograms.
//!
//! With half-edges `E` the corners of a parallelogram are `x_c = x + E s_c`, `s_a` of -1 and 1, and a weight and its gradient
//!
//! ```text
//! S_i = H_0 / 2^D,  G_i = sum_a g_a H_a,  g = E^-T / 2^D;   H_0 = sum_c N_i(x_c),  H_a = sum_c s_a N_i(x_c)
//! ```
//!
//! P2G computes the sums `H` for eight particles at once. Most domains lie within two cells along each axis, and reach 3 nodes; the others
//! go from corner to corner, one particle at a time. G2P has the same sums over corners, `sum_i v_i H_a = sum_c s_a v(x_c)`, of the
//! values `v(x_c) = sum_i v_i N_i(x_c)` there.
//!
//! [`parallelograms`] has the geometry, [`p2g`] and [`g2p`] have the sums.

mod g2p;
mod p2g;
pub(crate) mod parallelograms;

use std::sync::Arc;

use mmsmith_lanes::simd::{Lanes, dispatch};

use crate::grid::geometry::Constants;
use crate::grid::node::Node;
use crate::kernel::any::{Contributions, Interpolated};
use crate::kernel::block::BlockWeights;
use crate::kernel::copies::{BLOCK, Kinematics};
use crate::kernel::cpdi::g2p::{G2p, G2pOfBlock};
use crate::kernel::cpdi::p2g::{GroupWeights, P2g, P2gOfBlock};
use crate::kernel::cpdi::parallelograms::{Compute, Parallelograms, padded};
use crate::shape::cells::HalfEdges;

/// The weights of a block of particles, and a buffer for those of a group.
pub(crate) struct ParallelogramWeights<T, const D: usize> {
    half_edges: Arc<HalfEdges<T, D>>,
    own: Parallelograms<T, D>,
    of_group: GroupWeights<T, D>,
}

impl<T: Lanes, const D: usize> ParallelogramWeights<T, D> {
    /// Weights of the parallelograms that F makes of the reference ones with these half-edges.
    pub(crate) fn new(half_edges: Arc<HalfEdges<T, D>>, is_affine: bool) -> Self {
        Self { half_edges, own: Parallelograms::new(is_affine), of_group: GroupWeights::zero() }
    }
}

impl<T: Lanes, const D: usize> BlockWeights<T, D> for ParallelogramWeights<T, D> {
    fn compute(&mut self, c: &Constants<T, D>, ids: &[u32], kinematics: Kinematics<'_, T, D>) {
        let Self { half_edges, own, .. } = self;
        dispatch(Compute { own, c, half_edges, ids: &padded(ids), kinematics });
    }

    fn p2g(
        &mut self,
        strides: &[usize; D],
        window: &mut [Node<T, D>],
        contributions: &Contributions<T, D, BLOCK>,
        count: usize,
    ) {
        let Self { own, of_group: weights, .. } = self;
        let of_block = P2gOfBlock { own, weights, strides, window, contributions, count };
        if of_block.own.is_affine {
            dispatch(P2g::<_, D, true>(of_block));
        } else {
            dispatch(P2g::<_, D, false>(of_block));
        }
    }

    fn g2p(
        &mut self,
        strides: &[usize; D],
        nodes: &[Node<T, D>],
        receiver: &mut [Interpolated<T, D>],
    ) {
        let of_block = G2pOfBlock { own: &self.own, strides, nodes, receiver };
        if of_block.own.is_affine {
            dispatch(G2p::<_, D, true>(of_block));
        } else {
            dispatch(G2p::<_, D, false>(of_block));
        }
    }
}
