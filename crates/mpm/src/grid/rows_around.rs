//! Rows of other processes around those of this one, for updates in which a node depends on others than its particles reach.

use mmsmith_lanes::simd::Lanes;
use mmsmith_ranks::Ranks;

use crate::grid::Layout;
use crate::grid::bins::Bins;
use crate::grid::geometry::Constants;
use crate::grid::grid_update::{receive_nodes, send_nodes};
use crate::grid::node::Node;

/// Rows on either side; a layer of tiles has as many.
const ROWS: usize = 8;

/// A buffer for the nodes here between rows of the processes below and above; not used where there is one process.
pub(crate) struct RowsAround<T, const D: usize> {
    padded: Vec<Node<T, D>>,
}

impl<T, const D: usize> Default for RowsAround<T, D> {
    fn default() -> Self {
        Self { padded: Vec::new() }
    }
}

impl<T: Lanes, const D: usize> RowsAround<T, D> {
    /// Calls `work(first_row, nodes)` with the nodes here, whose sums are complete, and those around them; collective.
    pub(crate) fn with(
        &mut self,
        (c, layout): (&Constants<T, D>, &Layout<D>),
        bins: &Bins<Node<T, D>, D>,
        nodes: &mut [Node<T, D>],
        work: impl FnOnce(usize, &mut [Node<T, D>]),
    ) {
        let Some(ranks) = bins.ranks() else { return work(layout.first_row, nodes) };
        let row = layout.row();
        let shared = bins.shared_rows().map(|rows| rows.map(|rows| rows.len() * row));
        let first_row = layout.first_row - if shared[0].is_some() { ROWS } else { 0 };
        pad((&*ranks, shared), (ROWS * row, c.sent), nodes, &mut self.padded);
        work(first_row, &mut self.padded);
        let own = (layout.first_row - first_row) * row;
        nodes.copy_from_slice(&self.padded[own..own + nodes.len()]);
    }
}

/// Puts `nodes` between `count` nodes of the processes below and above, where there are such, with which so many of the first and of the
/// last nodes are `shared`; of these come the first `sent` numbers.
fn pad<T: Lanes, const D: usize>(
    (ranks, shared): (&dyn Ranks, [Option<usize>; 2]),
    (count, sent): (usize, usize),
    nodes: &[Node<T, D>],
    padded: &mut Vec<Node<T, D>>,
) {
    let [below, above] = shared;
    let [low, high] = shared.map(|shared| if shared.is_some() { count } else { 0 });
    padded.clear();
    padded.resize(low, Node::zero());
    padded.extend_from_slice(nodes);
    padded.resize(low + nodes.len() + high, Node::zero());
    // Neighbours have the shared rows, too, so that what they lack comes next. A process has the rows of two layers at least.
    let rank = ranks.rank();
    if let Some(shared) = below {
        send_nodes(ranks, rank - 1, sent, &nodes[shared..shared + count]);
    }
    if let Some(shared) = above {
        let end = nodes.len() - shared;
        send_nodes(ranks, rank + 1, sent, &nodes[end - count..end]);
    }
    if below.is_some() {
        receive_nodes(ranks, rank - 1, sent, &mut padded[..low]);
    }
    if above.is_some() {
        receive_nodes(ranks, rank + 1, sent, &mut padded[low + nodes.len()..]);
    }
}
