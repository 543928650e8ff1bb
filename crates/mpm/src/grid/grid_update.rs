//! The grid update: from mass, momentum and force at the nodes to velocities and accelerations, with walls.
//!
//! A row is updated right after its last contribution, while it lies in the cache. Ghost nodes beyond a wall are folded to
//! their mirror images before the update, and get the mirrored values after it. Image and ghost lie in the same row, except
//! for walls across the last axis: the rows near those are updated together.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use bytemuck::{Pod, cast_slice, cast_slice_mut};
use mmsmith_lanes::simd::{Lanes, Loop, Vectors, dispatch, is_wide};
use mmsmith_ranks::Ranks;
use nalgebra::RealField;

use crate::grid::Layout;
use crate::grid::bins::{AddToWindow, Bins, UpdateAndAdd};
use crate::grid::geometry::Constants;
use crate::grid::node::{Components, Node};
use crate::scheme::{Transfer, VelocityUpdate};
use mmsmith_threads::disjoint::Partition;
use mmsmith_threads::each_chunk;
use mmsmith_threads::windows::{Halo, Hooks};

/// How the grid is updated after P2G.
pub(crate) trait NodeUpdate<T: RealField + Copy, const D: usize>: Copy + Sync {
    /// Prepares nodes for P2G.
    fn clear(self, nodes: &mut [Node<T, D>]) {
        nodes.fill(Node::zero());
    }

    /// Adds the mirrored contributions of a ghost node to its image.
    #[inline(always)]
    fn add(self, node: &mut Node<T, D>, mirrored: &Node<T, D>) {
        node.add(mirrored);
    }

    /// Updates some nodes.
    fn update(self, c: &Constants<T, D>, nodes: &mut [Node<T, D>]);

    /// A node's mirror image, in which these components change their signs.
    #[inline(always)]
    fn flipped(self, node: Node<T, D>, components: Components) -> Node<T, D> {
        node.flipped(components)
    }

    /// Whether masses are among the sums.
    fn brings_mass(self) -> bool {
        true
    }

    /// Applies a wall that holds these components to a node on it.
    #[inline(always)]
    fn on_wall(self, c: &Constants<T, D>, node: &mut Node<T, D>, held: Components) {
        c.clear(node, held);
    }
}

/// The two vectors that a node has after the last P2G of forces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NodeVectors {
    /// The velocity at the end of the step and the acceleration: FLIP adds the latter.
    VelocityAndAcceleration,
    /// The velocity at the end of the step, twice: particles take it.
    VelocityTwice,
    /// The velocity at the start of the step and the acceleration, for the filter of XPIC.
    StartAndAcceleration,
}

impl NodeVectors {
    pub(crate) fn of(transfer: Transfer) -> Self {
        match transfer.velocity_update() {
            VelocityUpdate::Increment => Self::VelocityAndAcceleration,
            VelocityUpdate::Replace => Self::VelocityTwice,
            VelocityUpdate::FilteredReplace(_) => Self::StartAndAcceleration,
        }
    }

    /// From the velocity at the start of the step and the acceleration.
    #[inline(always)]
    fn set<T: RealField + Copy, const D: usize>(
        self,
        node: &mut Node<T, D>,
        a: usize,
        (velocity, acceleration): (T, T),
        time_step: T,
    ) {
        let end = velocity + acceleration * time_step;
        (node.values[a], node.values[Node::<T, D>::SECOND + a]) = match self {
            Self::VelocityAndAcceleration => (end, acceleration),
            Self::VelocityTwice => (end, end),
            Self::StartAndAcceleration => (velocity, acceleration),
        };
    }
}

/// Momentum and force to velocities and accelerations.
#[derive(Clone, Copy)]
pub(crate) struct VelocityAndAcceleration<T> {
    /// Factor on the acceleration.
    pub(crate) scale: T,
    pub(crate) vectors: NodeVectors,
}

impl<T: RealField + Copy, const D: usize> NodeUpdate<T, D> for VelocityAndAcceleration<T> {
    #[inline(always)]
    fn update(self, c: &Constants<T, D>, nodes: &mut [Node<T, D>]) {
        for node in nodes {
            let inverse = c.inverse_mass(node);
            for a in 0..D {
                let acceleration = node.values[Node::<T, D>::SECOND + a] * (inverse * self.scale);
                let velocity = node.values[a] * inverse;
                self.vectors.set(node, a, (velocity, acceleration), c.time_step);
            }
        }
    }
}

/// Momentum to the velocity at the start of the step; the second vector stays zero, for forces.
#[derive(Clone, Copy)]
pub(crate) struct Velocity;

impl<T: RealField + Copy, const D: usize> NodeUpdate<T, D> for Velocity {
    #[inline(always)]
    fn update(self, c: &Constants<T, D>, nodes: &mut [Node<T, D>]) {
        for node in nodes {
            let inverse = c.inverse_mass(node);
            (0..D).for_each(|a| node.values[a] *= inverse);
        }
    }
}

/// Force to the acceleration, with the velocity at the start of the step to those at its end.
#[derive(Clone, Copy)]
pub(crate) struct Acceleration<T> {
    /// Factor on the acceleration.
    pub(crate) scale: T,
    pub(crate) vectors: NodeVectors,
}

impl<T: RealField + Copy, const D: usize> NodeUpdate<T, D> for Acceleration<T> {
    /// P2G of momentum left no force.
    fn clear(self, _: &mut [Node<T, D>]) {}

    fn brings_mass(self) -> bool {
        false
    }

    #[inline(always)]
    fn add(self, node: &mut Node<T, D>, mirrored: &Node<T, D>) {
        node.add_acceleration(mirrored);
    }

    #[inline(always)]
    fn update(self, c: &Constants<T, D>, nodes: &mut [Node<T, D>]) {
        for node in nodes {
            let inverse = c.inverse_mass(node) * self.scale;
            for a in 0..D {
                let acceleration = node.values[Node::<T, D>::SECOND + a] * inverse;
                self.vectors.set(node, a, (node.values[a], acceleration), c.time_step);
            }
        }
    }
}

/// Momentum of particles to their velocity, once more in a step.
#[derive(Clone, Copy)]
pub(crate) struct Reprojection;

impl<T: RealField + Copy, const D: usize> NodeUpdate<T, D> for Reprojection {
    #[inline(always)]
    fn update(self, c: &Constants<T, D>, nodes: &mut [Node<T, D>]) {
        for node in nodes {
            let inverse = c.inverse_mass(node);
            node.values.iter_mut().for_each(|value| *value *= inverse);
        }
    }

    #[inline(always)]
    fn on_wall(self, _: &Constants<T, D>, node: &mut Node<T, D>, held: Components) {
        node.clear(held);
    }
}

/// A scalar in the place of the first component of a momentum, to its mean: the same on both sides of a wall.
#[derive(Clone, Copy)]
pub(crate) struct ScalarMean;

impl<T: RealField + Copy, const D: usize> NodeUpdate<T, D> for ScalarMean {
    #[inline(always)]
    fn update(self, c: &Constants<T, D>, nodes: &mut [Node<T, D>]) {
        for node in nodes {
            let inverse = c.inverse_mass(node);
            node.values[0] *= inverse;
        }
    }

    #[inline(always)]
    fn on_wall(self, _: &Constants<T, D>, _: &mut Node<T, D>, _: Components) {}

    #[inline(always)]
    fn flipped(self, node: Node<T, D>, _: Components) -> Node<T, D> {
        node
    }
}

/// The sums that another update begins with, of the body and its mirror images, and no update.
#[derive(Clone, Copy)]
pub(crate) struct Sums<S>(S);

impl<T: RealField + Copy, S: NodeUpdate<T, D>, const D: usize> NodeUpdate<T, D> for Sums<S> {
    fn clear(self, nodes: &mut [Node<T, D>]) {
        self.0.clear(nodes);
    }

    #[inline(always)]
    fn add(self, node: &mut Node<T, D>, mirrored: &Node<T, D>) {
        self.0.add(node, mirrored);
    }

    fn update(self, _: &Constants<T, D>, _: &mut [Node<T, D>]) {}

    /// Half of what reaches a node on a plane of symmetry comes from the mirror image.
    fn on_wall(self, _: &Constants<T, D>, node: &mut Node<T, D>, held: Components) {
        let mirrored = self.0.flipped(*node, held);
        self.0.add(node, &mirrored);
    }

    #[inline(always)]
    fn flipped(self, node: Node<T, D>, components: Components) -> Node<T, D> {
        self.0.flipped(node, components)
    }
}

/// The update of a grid, row by row.
pub(crate) struct GridUpdate<'a, T, S, const D: usize> {
    pub(crate) layout: &'a Layout<D>,
    pub(crate) c: &'a Constants<T, D>,
    pub(crate) update: S,
    edges: [Edge; 2],
}

/// Rows that are updated together: ghosts beyond a wall across the last axis are mirrored from row to row.
struct Edge {
    rows: Range<usize>,
    is_updated: AtomicBool,
}

impl Edge {
    /// Whether the edge has rows, all of them among `rows`.
    fn is_within(&self, rows: &Range<usize>) -> bool {
        !self.rows.is_empty() && rows.start <= self.rows.start && self.rows.end <= rows.end
    }
}

impl<'a, T, S, const D: usize> GridUpdate<'a, T, S, D>
where
    T: Lanes,
    S: NodeUpdate<T, D>,
{
    pub(crate) fn new(layout: &'a Layout<D>, c: &'a Constants<T, D>, update: S) -> Self {
        let edges = layout.edges().map(|rows| Edge { rows, is_updated: AtomicBool::new(false) });
        Self { layout, c, update, edges }
    }

    /// Without the update: nodes have the sums, ghost nodes the mirrored ones.
    pub(crate) fn sums(&self) -> GridUpdate<'a, T, Sums<S>, D> {
        GridUpdate::new(self.layout, self.c, Sums(self.update))
    }

    /// Calls `add` for every tile, as [`Bins::for_each`], and updates the nodes.
    pub(crate) fn p2g(
        &self,
        bins: &mut Bins<Node<T, D>, D>,
        nodes: &mut [Node<T, D>],
        add: &AddToWindow<'_, Node<T, D>, D>,
    ) {
        let ranks = bins.ranks();
        self.with_hooks(ranks.as_deref(), nodes, |nodes, hooks| {
            bins.for_each(nodes, hooks, add);
        });
    }

    /// Calls `add` for every tile, as [`Bins::for_each_mut`], and updates the nodes.
    pub(crate) fn g2p2g<'b, P: Sync>(
        &self,
        bins: &'b mut Bins<Node<T, D>, D>,
        nodes: &mut [Node<T, D>],
        divide: impl FnOnce(&'b mut Partition) -> P,
        add: &UpdateAndAdd<'_, Node<T, D>, P, D>,
    ) {
        let ranks = bins.ranks();
        self.with_hooks(ranks.as_deref(), nodes, |nodes, hooks| {
            bins.for_each_mut(nodes, hooks, divide, add);
        });
    }

    /// Calls `add` with the hooks that clear nodes before P2G and update them after it.
    fn with_hooks(
        &self,
        ranks: Option<&dyn Ranks>,
        nodes: &mut [Node<T, D>],
        add: impl FnOnce(&mut [Node<T, D>], Hooks<'_, Node<T, D>>),
    ) {
        let (before, after) = (
            |nodes: &mut [_]| self.update.clear(nodes),
            |nodes: &mut [_], first| self.rows(nodes, first),
        );
        let zero = Node::zero();
        let sum = |nodes: &mut [_], others: &mut [_]| dispatch(AddLine { nodes, others });
        let hooks = Hooks { before: &before, after: &after, zero, add: &sum, halo: None };
        let Some(ranks) = ranks else {
            add(nodes, hooks);
            self.finish(nodes);
            return;
        };
        let sent = self.c.sent;
        let send = |to, lines: &[&[_]]| send_nodes(ranks, to, sent, lines);
        let receive = |from, lines: &mut [&mut [_]]| receive_nodes(ranks, from, sent, lines);
        let finish = |nodes: &mut [_]| self.finish(nodes);
        let has_arrived = |from| ranks.has_arrived(from);
        // Rows of an edge are updated with all of it.
        let is_updated = |rows: Range<usize>| {
            let is_apart = |edge: &Edge| rows.end <= edge.rows.start || edge.rows.end <= rows.start;
            self.edges.iter().all(is_apart)
        };
        let halo = Some(Halo {
            send: &send,
            receive: &receive,
            has_arrived: &has_arrived,
            is_complete: &is_updated,
            finish: &finish,
        });
        add(nodes, Hooks { halo, ..hooks });
    }

    /// Updates whole rows, from the node of index `first` on, after their last contribution; rows of an edge only where all
    /// of the edge is among them.
    fn rows(&self, nodes: &mut [Node<T, D>], first: usize) {
        let Self { layout, edges, .. } = self;
        layout.fold_rows(nodes, &|image, ghost, flip| self.fold(image, ghost, flip));
        let rows = first / layout.row()..(first + nodes.len()) / layout.row();
        let rows = layout.first_row() + rows.start..layout.first_row() + rows.end;
        let [low, high] = edges;
        let mut to_update = rows.clone();
        if !low.is_within(&rows) {
            to_update.start = low.rows.end.clamp(rows.start, rows.end);
        }
        if !high.is_within(&rows) {
            to_update.end = high.rows.start.clamp(to_update.start, rows.end);
        }
        for edge in edges.iter().filter(|edge| edge.is_within(&rows)) {
            self.fold_edge(edge, nodes, rows.start);
        }
        let skipped = (to_update.start - rows.start) * layout.row();
        self.complete(&mut nodes[skipped..][..to_update.len() * layout.row()], to_update.start);
        for edge in edges.iter().filter(|edge| edge.is_within(&rows)) {
            layout.unfold_edge(&edge.rows, rows.start, nodes, &|n: Node<T, D>, a| {
                self.update.flipped(n, a)
            });
            edge.is_updated.store(true, Ordering::Relaxed);
        }
    }

    /// Updates the edges that [`rows`](Self::rows) left, after it was called for all rows.
    fn finish(&self, nodes: &mut [Node<T, D>]) {
        let (row, rows) = (self.layout.row(), self.layout.rows());
        // Other processes' edges are not all here.
        let here = self.edges.iter().filter(|edge| edge.is_within(&rows));
        for edge in here.filter(|edge| !edge.is_updated.load(Ordering::Relaxed)) {
            self.fold_edge(edge, nodes, rows.start);
            let (start, end) = (edge.rows.start - rows.start, edge.rows.end - rows.start);
            let at_once = self.layout.rows_at_once();
            each_chunk(&mut nodes[start * row..end * row], at_once * row, &|number, nodes| {
                self.complete(nodes, edge.rows.start + number * at_once);
            });
            self.layout.unfold_edge(&edge.rows, rows.start, nodes, &|n: Node<T, D>, a| {
                self.update.flipped(n, a)
            });
        }
    }

    /// Folds a ghost node beyond a wall to its mirror image. The components `flip` change their signs.
    #[inline(always)]
    fn fold(&self, image: &mut Node<T, D>, ghost: Node<T, D>, flip: Components) {
        let mirrored = self.update.flipped(self.c.ghost(ghost), flip);
        self.update.add(image, &mirrored);
    }

    /// Updates one of the edges, among the rows from row `first` on.
    fn fold_edge(&self, edge: &Edge, nodes: &mut [Node<T, D>], first: usize) {
        self.layout.fold_edge(&edge.rows, first, nodes, &|image, ghost, flip| {
            self.fold(image, ghost, flip);
        });
    }

    /// Updates the rows from row `first` of the grid on, after all contributions and folds.
    pub(crate) fn complete(&self, nodes: &mut [Node<T, D>], first: usize) {
        self.update.update(self.c, nodes);
        self.on_walls(nodes, first);
    }

    /// Applies walls to the rows from row `first` of the grid on, and sets the ghost nodes in these.
    pub(crate) fn on_walls(&self, nodes: &mut [Node<T, D>], first: usize) {
        let &Self { layout, c, update, .. } = self;
        layout.on_walls(first, nodes, |node, held| update.on_wall(c, node, held));
        layout.unfold_rows(nodes, &|node: Node<T, D>, flip| update.flipped(node, flip));
    }
}

/// Adds nodes of a window to those of the grid, and clears them.
struct AddLine<'a, T, const D: usize> {
    nodes: &'a mut [Node<T, D>],
    others: &'a mut [Node<T, D>],
}

impl<T: Lanes, const D: usize> Loop for AddLine<'_, T, D> {
    const IS_WIDE: bool = is_wide::<T, D>();

    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let Self { nodes, others } = self;
        // Particles reach half the lines of a window, or fewer.
        if others.iter().all(Node::is_zero) {
            return;
        }
        for (Node { values }, other) in nodes.iter_mut().zip(others) {
            *values = vectors.add8(vectors.load8(values), vectors.load8(&other.values)).0;
            *other = Node::zero();
        }
    }
}

/// Sends the first `sent` numbers of nodes to a process, line by line.
pub(crate) fn send_nodes<T: RealField + Pod, const D: usize>(
    ranks: &dyn Ranks,
    to: usize,
    sent: usize,
    lines: &[&[Node<T, D>]],
) {
    let count: usize = lines.iter().map(|line| line.len()).sum();
    let mut numbers = Vec::with_capacity(count * sent);
    for node in lines.iter().copied().flatten() {
        numbers.extend_from_slice(&node.values[..sent]);
    }
    ranks.send(to, cast_slice(&numbers));
}

/// Receives the first `sent` numbers of as many nodes from a process.
pub(crate) fn receive_nodes<T: RealField + Pod, const D: usize>(
    ranks: &dyn Ranks,
    from: usize,
    sent: usize,
    lines: &mut [&mut [Node<T, D>]],
) {
    let count: usize = lines.iter().map(|line| line.len()).sum();
    let mut numbers = vec![T::zero(); count * sent];
    ranks.receive(from, cast_slice_mut(&mut numbers));
    let nodes = lines.iter_mut().flat_map(|line| line.iter_mut());
    for (node, numbers) in nodes.zip(numbers.chunks(sent)) {
        *node = Node::zero();
        node.values[..sent].copy_from_slice(numbers);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::tiles::Tiles;
    use mmsmith_particles::Grid;
    use nalgebra::SVector;

    /// Nodes with distinct values, some without mass.
    fn given<const D: usize>(count: usize) -> Vec<Node<f64, D>> {
        let value = |index: usize, q: usize| ((index * 8 + q) as f64 * 0.7).sin();
        let node = |index| {
            let mut node = Node { values: std::array::from_fn(|q| value(index, q)) };
            let mass = &mut node.values[Node::<f64, D>::MASS];
            *mass = if index % 5 == 3 { 0.0 } else { 2.0 + *mass };
            node
        };
        (0..count).map(node).collect()
    }

    /// The result does not depend on the order of rows, nor on how many are updated together.
    fn check<S: NodeUpdate<f64, D>, const D: usize>(
        layout: &Layout<D>,
        c: &Constants<f64, D>,
        update: S,
    ) {
        let mut expected = given(layout.nodes);
        let whole = GridUpdate::new(layout, c, update);
        layout.fold(&mut expected, |image, ghost, flip| whole.fold(image, ghost, flip));
        update.update(c, &mut expected);
        layout.on_walls(0, &mut expected, |node, held| update.on_wall(c, node, held));
        layout.unfold(&mut expected, Node::flipped);
        for rows_at_once in [1, 7, 8, 16, layout.dims[D - 1]] {
            let mut nodes = given(layout.nodes);
            let parts = GridUpdate::new(layout, c, update);
            let size = rows_at_once * layout.row();
            let chunks: Vec<_> = nodes.chunks_mut(size).enumerate().collect();
            for (chunk, nodes) in chunks.into_iter().rev() {
                parts.rows(nodes, chunk * size);
            }
            parts.finish(&mut nodes);
            for (index, (node, expected)) in nodes.iter().zip(&expected).enumerate() {
                assert_eq!(node.values, expected.values, "{rows_at_once} rows: node {index}");
            }
        }
    }

    fn check_all<const D: usize>(cells: [usize; D], walls: [[bool; 2]; D]) {
        let grid = Grid { lower: SVector::zeros(), spacing: 0.5, cells, walls };
        let layout = Layout::new(&grid, 8).unwrap();
        let tiles = Tiles::new(&layout, &cells, 3);
        let c = &Constants::new(&grid, &layout, &tiles, 0.1, 1.0);
        check(&layout, c, Velocity);
        for vectors in [
            NodeVectors::VelocityAndAcceleration,
            NodeVectors::VelocityTwice,
            NodeVectors::StartAndAcceleration,
        ] {
            check(&layout, c, VelocityAndAcceleration { scale: 0.5, vectors });
            check(&layout, c, Acceleration { scale: 0.5, vectors });
        }
        check(&layout, c, Reprojection);
    }

    #[test]
    fn rows_are_updated_in_any_order_as_the_whole_grid() {
        for lower in [false, true] {
            for upper in [false, true] {
                let wall = [lower, upper];
                // Between walls on a grid of less than three cells layers are mirrored more than once.
                for cells in [1, 2, 4, 9, 30] {
                    check_all([cells], [wall]);
                    check_all([3, cells], [[true, false], wall]);
                    check_all([2, 3, cells], [[false, true], [true, true], wall]);
                }
            }
        }
    }
}
