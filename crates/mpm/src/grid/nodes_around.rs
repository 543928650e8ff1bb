//! Nodes of other processes around those of this one, for updates in which a node depends on others than its particles reach.

use mmsmith_lanes::simd::Lanes;
use mmsmith_threads::region::Region;

use crate::grid::Layout;
use crate::grid::bins::Bins;
use crate::grid::geometry::Constants;
use crate::grid::grid_update::{receive_nodes, send_nodes};
use crate::grid::node::Node;

/// Layers of nodes on each side; a process has as many cells at least.
const LAYERS: usize = 8;

/// A buffer for the nodes here between those of other processes; not used where there is one process.
pub(crate) struct NodesAround<T, const D: usize> {
    padded: Vec<Node<T, D>>,
}

impl<T, const D: usize> Default for NodesAround<T, D> {
    fn default() -> Self {
        Self { padded: Vec::new() }
    }
}

impl<T: Lanes, const D: usize> NodesAround<T, D> {
    /// Calls `work(layout, nodes)` with the nodes here, whose sums are complete, and those around them; collective.
    pub(crate) fn with(
        &mut self,
        (c, layout): (&Constants<T, D>, &Layout<D>),
        bins: &Bins<Node<T, D>, D>,
        nodes: &mut [Node<T, D>],
        work: impl FnOnce(&Layout<D>, &mut [Node<T, D>]),
    ) {
        let Some(ranks) = bins.ranks() else { return work(layout, nodes) };
        let (lattice, held) = (bins.lattice(), bins.lattice().held());
        // The layers of a process along an axis, with those around them.
        let around_of = |axis: usize, at: usize| {
            let own = lattice.extent(axis, at);
            let below = if at > 0 { LAYERS } else { 0 };
            let above = if at + 1 < held.cuts.count(axis) { LAYERS } else { 0 };
            own.start.saturating_sub(below)..(own.end + above).min(layout.dims[axis])
        };
        let whole = Region(std::array::from_fn(|a| around_of(a, held.at[a])));
        let own = &layout.held;
        let Self { padded } = self;
        padded.clear();
        padded.resize(whole.len(), Node::zero());
        let (from, to) = (own.slices(own, nodes), own.slices_mut(&whole, padded));
        from.into_iter().zip(to).for_each(|(from, to)| to.copy_from_slice(from));
        // Axis by axis: what is there along the axes before goes on.
        let mut here = own.clone();
        for axis in (0..D).rev() {
            let (at, own) = (held.at[axis], &own.0[axis]);
            let neighbours = || {
                let sides = [false, true].into_iter();
                sides.filter_map(|is_above| Some((is_above, held.neighbour(axis, is_above)?)))
            };
            for (is_above, process) in neighbours() {
                let at = if is_above { at + 1 } else { at - 1 };
                let (extent, around) = (lattice.extent(axis, at), around_of(axis, at));
                let lacks = match is_above {
                    false => extent.end..around.end,
                    true => around.start..extent.start,
                };
                let lines = here.along(axis, lacks).slices(&whole, padded);
                send_nodes(&*ranks, process, c.sent, &lines);
            }
            for (is_above, process) in neighbours() {
                let comes = match is_above {
                    false => whole.0[axis].start..own.start,
                    true => own.end..whole.0[axis].end,
                };
                let mut lines = here.along(axis, comes).slices_mut(&whole, padded);
                receive_nodes(&*ranks, process, c.sent, &mut lines);
            }
            here = here.along(axis, whole.0[axis].clone());
        }
        let mut around = layout.clone();
        around.hold(whole.clone());
        work(&around, padded);
        let (from, to) = (own.slices(&whole, padded), own.slices_mut(own, nodes));
        from.into_iter().zip(to).for_each(|(from, to)| to.copy_from_slice(from));
    }
}
