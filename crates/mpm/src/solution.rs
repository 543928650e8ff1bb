//! On the grid: from the mass, momentum and force that particles gave to nodes to velocities and accelerations.
//!
//! A row is solved when no particle is to give to it any more, while it lies in the cache. What is beyond walls belongs to
//! mirror images in the same row, but for walls across the last axis: the rows near those are solved together.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::RealField;

use crate::bands::{Around, Bands, Scatter, Sweep};
use crate::grid::Layout;
use crate::step::Constants;
use crate::transfer::Node;

/// What comes of what particles gave to nodes.
pub(crate) trait Solve<T: RealField + Copy, const D: usize>: Copy + Sync {
    /// Prepares some nodes for what particles are to give to them.
    fn clear(self, nodes: &mut [Node<T, D>]) {
        nodes.fill(Node::zero());
    }

    /// Adds to a node what particles gave to its mirror image beyond a wall, mirrored.
    #[inline(always)]
    fn add(self, node: &mut Node<T, D>, mirrored: &Node<T, D>) {
        node.add(mirrored);
    }

    /// Solves for some nodes, of which the first has the index `first`.
    fn solve(self, c: &Constants<T, D>, nodes: &mut [Node<T, D>], first: usize);

    /// What a wall across `axis` does to a node on it.
    #[inline(always)]
    fn on_wall(self, c: &Constants<T, D>, node: &mut Node<T, D>, axis: usize) {
        c.clear(node, axis);
    }
}

/// Momentum and force to the velocity at the end of the step and the acceleration.
#[derive(Clone, Copy)]
pub(crate) struct VelocityAndAcceleration<T> {
    /// Factor on the acceleration.
    pub(crate) scale: T,
}

impl<T: RealField + Copy, const D: usize> Solve<T, D> for VelocityAndAcceleration<T> {
    #[inline(always)]
    fn solve(self, c: &Constants<T, D>, nodes: &mut [Node<T, D>], _: usize) {
        for node in nodes {
            let inverse = c.inverse_mass(node);
            for a in 0..D {
                let acceleration = node.values[D + a] * (inverse * self.scale);
                node.values[a] = node.values[a] * inverse + acceleration * c.time_step;
                node.values[D + a] = acceleration;
            }
        }
    }
}

/// Momentum to the velocity at the start of the step.
#[derive(Clone, Copy)]
pub(crate) struct Velocity;

impl<T: RealField + Copy, const D: usize> Solve<T, D> for Velocity {
    #[inline(always)]
    fn solve(self, c: &Constants<T, D>, nodes: &mut [Node<T, D>], _: usize) {
        for node in nodes {
            let inverse = c.inverse_mass(node);
            (0..D).for_each(|a| node.values[a] *= inverse);
        }
    }
}

/// Force to the acceleration, and the velocity from that at the start of the step to that at its end.
#[derive(Clone, Copy)]
pub(crate) struct Acceleration<T> {
    /// Factor on the acceleration.
    pub(crate) scale: T,
}

impl<T: RealField + Copy, const D: usize> Solve<T, D> for Acceleration<T> {
    /// What gave its momentum to the nodes gave no force.
    fn clear(self, _: &mut [Node<T, D>]) {}

    #[inline(always)]
    fn add(self, node: &mut Node<T, D>, mirrored: &Node<T, D>) {
        node.add_acceleration(mirrored);
    }

    #[inline(always)]
    fn solve(self, c: &Constants<T, D>, nodes: &mut [Node<T, D>], _: usize) {
        for node in nodes {
            let inverse = c.inverse_mass(node) * self.scale;
            for a in 0..D {
                node.values[D + a] *= inverse;
                node.values[a] += node.values[D + a] * c.time_step;
            }
        }
    }
}

/// Momentum of the updated particles to their velocity, by the masses that `nodes` have.
#[derive(Clone, Copy)]
pub(crate) struct Reprojection<'a, T, const D: usize> {
    pub(crate) nodes: &'a [Node<T, D>],
}

impl<T: RealField + Copy, const D: usize> Solve<T, D> for Reprojection<'_, T, D> {
    #[inline(always)]
    fn solve(self, c: &Constants<T, D>, nodes: &mut [Node<T, D>], first: usize) {
        for (new, node) in nodes.iter_mut().zip(self.nodes.get(first..).unwrap_or_default()) {
            let inverse = c.inverse_mass(node);
            new.values.iter_mut().for_each(|value| *value *= inverse);
        }
    }

    #[inline(always)]
    fn on_wall(self, _: &Constants<T, D>, node: &mut Node<T, D>, axis: usize) {
        node.clear(axis);
    }
}

/// The solution on a grid, rows by rows.
pub(crate) struct Solution<'a, T, S, const D: usize> {
    layout: &'a Layout<D>,
    c: &'a Constants<T, D>,
    solve: S,
    edges: [Edge; 2],
}

/// Rows that are to be solved together, since what is beyond a wall across the last axis is mirrored from row to row.
struct Edge {
    rows: Range<usize>,
    is_solved: AtomicBool,
}

impl Edge {
    /// Whether there is something to be solved, all of it in some rows.
    fn is_within(&self, rows: &Range<usize>) -> bool {
        !self.rows.is_empty() && rows.start <= self.rows.start && self.rows.end <= rows.end
    }
}

impl<'a, T, S, const D: usize> Solution<'a, T, S, D>
where
    T: RealField + Copy,
    S: Solve<T, D>,
{
    pub(crate) fn new(layout: &'a Layout<D>, c: &'a Constants<T, D>, solve: S) -> Self {
        let edges = layout.edges().map(|rows| Edge { rows, is_solved: AtomicBool::new(false) });
        Self { layout, c, solve, edges }
    }

    /// Lets every band add to the nodes, as [`Bands::scatter`], and solves.
    pub(crate) fn scatter(
        &self,
        bands: &mut Bands,
        nodes: &mut [Node<T, D>],
        add: &Scatter<'_, Node<T, D>>,
    ) {
        self.around(nodes, |nodes, around| bands.scatter(self.layout, nodes, around, add));
    }

    /// Lets every band add to the nodes and change its own elements of three arrays, as [`Bands::sweep`], and solves.
    pub(crate) fn sweep<A: Send, B: Send, C: Send>(
        &self,
        bands: &mut Bands,
        nodes: &mut [Node<T, D>],
        arrays: (&mut [A], &mut [B], &mut [C]),
        add: &Sweep<'_, Node<T, D>, A, B, C>,
    ) {
        self.around(nodes, |nodes, around| bands.sweep(self.layout, nodes, around, arrays, add));
    }

    /// Solves for what `give` lets the bands add to the nodes.
    fn around(
        &self,
        nodes: &mut [Node<T, D>],
        give: impl FnOnce(&mut [Node<T, D>], Around<'_, Node<T, D>>),
    ) {
        let (before, after) = (
            |nodes: &mut [_]| self.solve.clear(nodes),
            |nodes: &mut [_], first| self.rows(nodes, first),
        );
        give(nodes, Around { before: &before, after: &after });
        self.finish(nodes);
    }

    /// Solves whole rows, from the node of index `first` on, to which all particles gave; those of an edge only where all of
    /// it is there.
    fn rows(&self, nodes: &mut [Node<T, D>], first: usize) {
        let Self { layout, edges, .. } = self;
        layout.fold_rows(nodes, &|image, ghost, flip| self.fold(image, ghost, flip));
        let rows = first / layout.row()..(first + nodes.len()) / layout.row();
        let [low, high] = edges;
        let mut to_solve = rows.clone();
        if !low.is_within(&rows) {
            to_solve.start = low.rows.end.clamp(rows.start, rows.end);
        }
        if !high.is_within(&rows) {
            to_solve.end = high.rows.start.clamp(to_solve.start, rows.end);
        }
        for edge in edges.iter().filter(|edge| edge.is_within(&rows)) {
            self.fold_edge(edge, nodes, rows.start);
        }
        let skipped = (to_solve.start - rows.start) * layout.row();
        self.complete(&mut nodes[skipped..][..to_solve.len() * layout.row()], to_solve.start);
        for edge in edges.iter().filter(|edge| edge.is_within(&rows)) {
            layout.unfold_edge(&edge.rows, rows.start, nodes, &Node::flipped);
            edge.is_solved.store(true, Ordering::Relaxed);
        }
    }

    /// Solves what [`rows`](Self::rows) left, after it was called for all rows.
    fn finish(&self, nodes: &mut [Node<T, D>]) {
        let row = self.layout.row();
        for edge in self.edges.iter().filter(|edge| !edge.is_solved.load(Ordering::Relaxed)) {
            self.fold_edge(edge, nodes, 0);
            let Range { start, end } = edge.rows;
            self.complete(&mut nodes[start * row..end * row], start);
            self.layout.unfold_edge(&edge.rows, 0, nodes, &Node::flipped);
        }
    }

    /// Adds what particles gave to a node beyond a wall to its mirror image. The component along the axis `flip` changes
    /// its sign.
    #[inline(always)]
    fn fold(&self, image: &mut Node<T, D>, ghost: Node<T, D>, flip: Option<usize>) {
        self.solve.add(image, &self.c.ghost(ghost).flipped(flip));
    }

    /// The same for one of the edges, among the rows from row `first` on.
    fn fold_edge(&self, edge: &Edge, nodes: &mut [Node<T, D>], first: usize) {
        self.layout.fold_edge(&edge.rows, first, nodes, &|image, ghost, flip| {
            self.fold(image, ghost, flip);
        });
    }

    /// Solves the rows from row `first` on, to which nothing is to be added any more.
    fn complete(&self, nodes: &mut [Node<T, D>], first: usize) {
        let &Self { layout, c, solve, .. } = self;
        solve.solve(c, nodes, first * layout.row());
        layout.on_walls(first, nodes, |node, axis| solve.on_wall(c, node, axis));
        layout.unfold_rows(nodes, &Node::flipped);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Grid;
    use nalgebra::SVector;

    /// Nodes with values that no two have in common, and some without mass.
    fn given<const D: usize>(count: usize) -> Vec<Node<f64, D>> {
        let value = |index: usize, q: usize| ((index * 8 + q) as f64 * 0.7).sin();
        let node = |index| {
            let mut node = Node { values: std::array::from_fn(|q| value(index, q)) };
            node.values[2 * D] = if index % 5 == 3 { 0.0 } else { 2.0 + node.values[2 * D] };
            node
        };
        (0..count).map(node).collect()
    }

    /// Whatever rows are solved together and in which order, it comes out as for the whole grid at once.
    fn check<S: Solve<f64, D>, const D: usize>(
        layout: &Layout<D>,
        c: &Constants<f64, D>,
        solve: S,
    ) {
        let mut expected = given(layout.nodes);
        let whole = Solution::new(layout, c, solve);
        layout.fold(&mut expected, |image, ghost, flip| whole.fold(image, ghost, flip));
        solve.solve(c, &mut expected, 0);
        layout.on_walls(0, &mut expected, |node, axis| solve.on_wall(c, node, axis));
        layout.unfold(&mut expected, Node::flipped);
        for rows_at_once in [1, 7, 8, 16, layout.dims[D - 1]] {
            let mut nodes = given(layout.nodes);
            let solution = Solution::new(layout, c, solve);
            let size = rows_at_once * layout.row();
            let chunks: Vec<_> = nodes.chunks_mut(size).enumerate().collect();
            for (chunk, nodes) in chunks.into_iter().rev() {
                solution.rows(nodes, chunk * size);
            }
            solution.finish(&mut nodes);
            for (index, (node, expected)) in nodes.iter().zip(&expected).enumerate() {
                assert_eq!(node.values, expected.values, "{rows_at_once} rows: node {index}");
            }
        }
    }

    fn check_all<const D: usize>(cells: [usize; D], walls: [[bool; 2]; D]) {
        let grid = Grid { lower: SVector::zeros(), spacing: 0.5, cells, walls };
        let layout = Layout::new(&grid, 8).unwrap();
        let bands = Bands::new(&layout, 1);
        let c = &Constants::new(&grid, &layout, &bands, 0.1, 1.0);
        check(&layout, c, Velocity);
        check(&layout, c, VelocityAndAcceleration { scale: 0.5 });
        check(&layout, c, Acceleration { scale: 0.5 });
        check(&layout, c, Reprojection { nodes: &given(layout.nodes) });
    }

    #[test]
    fn rows_are_solved_in_whatever_order_as_the_whole_grid() {
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
