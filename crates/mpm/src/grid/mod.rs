//! The background grid: its cells and walls, and the layout of its nodes in memory with ghost nodes beyond walls.

pub(crate) mod bins;
pub(crate) mod division;
pub(crate) mod extension;
pub(crate) mod geometry;
pub(crate) mod grid_update;
pub(crate) mod node;
pub(crate) mod nodes_around;
pub(crate) mod state;
pub(crate) mod tiles;
pub(crate) mod volume_rates;

use std::ops::Range;

use mmsmith_particles::{Grid, SetupError};
use mmsmith_threads::each;
use mmsmith_threads::region::Region;

use crate::grid::node::Components;

/// Node layers below cell 0: a box of half-size 2 reaches two, and rounding may need one more.
pub(crate) const PAD_BELOW: usize = 3;
/// Node layers above the last cell, for the extended support of a particle on the upper face.
const PAD_ABOVE: usize = 5;

/// Nodes that a thread updates at a time, where there are many.
pub(crate) const NODES_AT_ONCE: usize = 4096;

/// Node indices along an axis are formed in 32 bits.
const MAX_LAYERS: usize = i32::MAX as usize;

/// A layer of nodes on a wall across an axis, and the components that it holds.
#[derive(Clone, Copy, Debug)]
struct WallLayer {
    axis: usize,
    layer: usize,
    held: Components,
}

/// Sides of the grid, as a body has them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sides<const D: usize> {
    /// The axis around which nothing changes, of a body that turns about another one: it has a single layer of nodes.
    pub(crate) around: Option<usize>,
    /// The walls to which the body sticks.
    pub(crate) sticks: [[bool; 2]; D],
}

impl<const D: usize> Default for Sides<D> {
    fn default() -> Self {
        Self { around: None, sticks: [[false; 2]; D] }
    }
}

/// A layer of ghost nodes beyond a wall, and the layer of its mirror image.
#[derive(Clone, Copy, Debug)]
struct Ghost {
    axis: usize,
    layer: usize,
    image: usize,
    /// The components that change their signs between the two, by an odd number of reflections.
    flip: Components,
}

/// Layout of the nodes in memory, axis 0 fastest, with padding on all sides: a process holds those of a region, in which node `(i, j, k)` from its first
/// one on is at `i strides[0] + j strides[1] + k strides[2]`.
///
/// Operations on ghost nodes come in two parts: within rows, and from row to row for walls across the last axis.
#[derive(Clone, Debug)]
pub(crate) struct Layout<const D: usize> {
    /// Layers of nodes of the whole grid along each axis.
    pub(crate) dims: [usize; D],
    /// The layers of nodes along each axis that this process holds: all, or some successive ones.
    pub(crate) held: Region<D>,
    pub(crate) strides: [usize; D],
    /// Number of nodes that it holds.
    pub(crate) nodes: usize,
    ghosts: Vec<Ghost>,
    walls: Vec<WallLayer>,
}

impl<const D: usize> Layout<D> {
    /// Lays out the nodes of `grid`, if `bytes_per_node` times their number can be addressed at all.
    pub(crate) fn new<T>(grid: &Grid<T, D>, bytes_per_node: usize) -> Result<Self, SetupError> {
        Self::with_sides(grid, &Sides::default(), bytes_per_node)
    }

    /// As [`new`](Self::new), with the sides that a body asks for.
    pub(crate) fn with_sides<T>(
        grid: &Grid<T, D>,
        sides: &Sides<D>,
        bytes_per_node: usize,
    ) -> Result<Self, SetupError> {
        let too_large = || {
            let nodes = grid.cells.iter().fold(1_u128, |n, &c| n.saturating_mul(c as u128 + 9));
            let bytes = nodes.saturating_mul(bytes_per_node as u128);
            SetupError::GridTooLarge { cells: grid.cells.to_vec(), bytes }
        };
        let mut layout = Self {
            dims: [0; D],
            held: Region(std::array::from_fn(|_| 0..0)),
            strides: [0; D],
            nodes: 1,
            ghosts: vec![],
            walls: vec![],
        };
        for (axis, &cells) in grid.cells.iter().enumerate() {
            if cells == 0 {
                return Err(SetupError::NoCells { axis });
            }
            let padding = 1 + PAD_BELOW + PAD_ABOVE;
            let dim = match sides.around == Some(axis) {
                true => 1,
                false => cells.checked_add(padding).ok_or_else(too_large)?,
            };
            if dim > MAX_LAYERS {
                return Err(too_large());
            }
            layout.dims[axis] = dim;
            layout.nodes = layout.nodes.checked_mul(dim).ok_or_else(too_large)?;
            let (first, last) = (PAD_BELOW, PAD_BELOW + cells);
            let [lower, upper] = grid.walls[axis];
            let [held_below, held_above] = sides.sticks[axis].map(|sticks| match sticks {
                true => Components::ALL,
                false => Components::along(axis),
            });
            let wall = |layer, held| WallLayer { axis, layer, held };
            layout.walls.extend(lower.then_some(wall(first, held_below)));
            layout.walls.extend(upper.then_some(wall(last, held_above)));
            for layer in (0..dim).filter(|&l| (lower && l < first) || (upper && l > last)) {
                // Between two walls on a coarse grid a far layer is mirrored more than once.
                let (low, high) = (first as isize, last as isize);
                let (mut image, mut flip) = (layer as isize, Components::NONE);
                while (lower && image < low) || (upper && image > high) {
                    let is_below = lower && image < low;
                    image = if is_below { 2 * low - image } else { 2 * high - image };
                    flip = flip.toggled(if is_below { held_below } else { held_above });
                }
                // Across from an open face the image may lie beyond all padding; no box reaches such a layer.
                if let Ok(image) = usize::try_from(image)
                    && image < dim
                {
                    layout.ghosts.push(Ghost { axis, layer, image, flip });
                }
            }
        }
        // Some layers of slack keep the arithmetic on rows from overflowing.
        let addressable =
            layout.nodes.checked_mul(bytes_per_node).map(|b| b <= isize::MAX as usize);
        if addressable != Some(true) || layout.nodes > usize::MAX / (2 * tiles::LAYER_OF_NODES) {
            return Err(too_large());
        }
        layout.hold(Region(layout.dims.map(|dim| 0..dim)));
        Ok(layout)
    }

    /// Holds the nodes of a region alone.
    pub(crate) fn hold(&mut self, held: Region<D>) {
        self.strides = held.strides();
        self.nodes = held.len();
        self.held = held;
    }

    /// The rows that this process holds.
    pub(crate) fn rows(&self) -> Range<usize> {
        self.held.0[D - 1].clone()
    }

    /// The first row that it holds.
    pub(crate) fn first_row(&self) -> usize {
        self.rows().start
    }

    /// Where the first node of the grid would be, counted backwards from the first one here.
    pub(crate) fn nodes_before(&self) -> usize {
        (0..D).map(|a| self.held.0[a].start * self.strides[a]).sum()
    }

    /// Nodes in a row: all here that share an index along the last axis.
    pub(crate) fn row(&self) -> usize {
        self.strides[D - 1]
    }

    /// Rows that are updated together, one at least.
    pub(crate) fn rows_at_once(&self) -> usize {
        (NODES_AT_ONCE / self.row()).max(1)
    }

    /// Rows of ghost nodes beyond walls across the last axis.
    pub(crate) fn ghost_rows(&self) -> usize {
        self.ghosts.iter().filter(|ghost| ghost.axis == D - 1).count()
    }

    /// Calls `visit` with the index of every node here in a layer across an axis, of `nodes` nodes from the beginning of a row on.
    fn for_layer(&self, nodes: usize, (axis, layer): (usize, usize), mut visit: impl FnMut(usize)) {
        let held = &self.held.0[axis];
        if !held.contains(&layer) {
            return;
        }
        let (stride, slab) = (self.strides[axis], self.strides[axis] * held.len());
        for start in ((layer - held.start) * stride..nodes).step_by(slab) {
            (start..start + stride).for_each(&mut visit);
        }
    }

    /// Folds the contributions to ghost nodes to their mirror images: `add(image, ghost, flip)`, where the components `flip`
    /// change their signs.
    #[cfg(test)]
    pub(crate) fn fold<N: Copy + Send>(
        &self,
        nodes: &mut [N],
        add: impl Fn(&mut N, N, Components) + Sync,
    ) {
        self.fold_rows(nodes, &add);
        self.fold_edge(&(0..self.dims[D - 1]), 0, nodes, &add);
    }

    /// Unfolds: sets ghost nodes to the mirrored values `mirror(image, flip)`, with `flip` as in `fold`.
    #[cfg(test)]
    pub(crate) fn unfold<N: Copy + Send>(
        &self,
        nodes: &mut [N],
        mirror: impl Fn(N, Components) -> N + Sync,
    ) {
        self.unfold_rows(nodes, &mirror);
        self.unfold_edge(&(0..self.dims[D - 1]), 0, nodes, &mirror);
    }

    /// The part of [`fold`](Self::fold) that stays within a row, for some rows.
    pub(crate) fn fold_rows<N: Copy>(&self, rows: &mut [N], add: &impl Fn(&mut N, N, Components)) {
        self.for_ghosts_in_rows(rows.len(), |ghost, image, flip| {
            let ghost = rows[ghost];
            add(&mut rows[image], ghost, flip);
        });
    }

    /// The part of [`unfold`](Self::unfold) that stays within a row, for some rows.
    pub(crate) fn unfold_rows<N: Copy>(
        &self,
        rows: &mut [N],
        mirror: &impl Fn(N, Components) -> N,
    ) {
        self.for_ghosts_in_rows(rows.len(), |ghost, image, flip| {
            rows[ghost] = mirror(rows[image], flip);
        });
    }

    /// The part of [`fold`](Self::fold) that goes from row to row, which comes after that within rows: for one of the
    /// [edges](Self::edges), among the rows from row `first` on.
    pub(crate) fn fold_edge<N: Copy + Send>(
        &self,
        edge: &Range<usize>,
        first: usize,
        rows: &mut [N],
        add: &(impl Fn(&mut N, N, Components) + Sync),
    ) {
        self.for_ghosts_of_edge(edge, first, rows, |ghost, image, flip| add(image, *ghost, flip));
    }

    /// The part of [`unfold`](Self::unfold) that goes from row to row, as [`fold_edge`](Self::fold_edge).
    pub(crate) fn unfold_edge<N: Copy + Send>(
        &self,
        edge: &Range<usize>,
        first: usize,
        rows: &mut [N],
        mirror: &(impl Fn(N, Components) -> N + Sync),
    ) {
        self.for_ghosts_of_edge(edge, first, rows, |ghost, image, flip| {
            *ghost = mirror(*image, flip);
        });
    }

    /// Calls `visit(ghost, image, flip)` for every ghost node with its mirror image in the same row, among `nodes` nodes from the
    /// beginning of a row on; the components `flip` change their signs.
    #[inline(always)]
    fn for_ghosts_in_rows(&self, nodes: usize, mut visit: impl FnMut(usize, usize, Components)) {
        // Images that are not here belong to ghosts that other processes complete.
        let are_in_rows = |g: &&Ghost| g.axis < D - 1 && self.held.0[g.axis].contains(&g.image);
        for g in self.ghosts.iter().filter(are_in_rows) {
            let (ghost, image) = (g.layer * self.strides[g.axis], g.image * self.strides[g.axis]);
            self.for_layer(nodes, (g.axis, g.layer), |index| {
                visit(index, index + image - ghost, g.flip);
            });
        }
    }

    /// Calls `visit(ghost, image, flip)` for ghost nodes with mirror images in other rows, both at one edge, among `rows` from row `first` on;
    /// in parallel, which pays in space.
    #[inline(always)]
    fn for_ghosts_of_edge<N: Send>(
        &self,
        edge: &Range<usize>,
        first: usize,
        rows: &mut [N],
        visit: impl Fn(&mut N, &mut N, Components) + Sync,
    ) {
        let row = self.row();
        for g in self.ghosts.iter().filter(|g| g.axis == D - 1 && edge.contains(&g.layer)) {
            let [lower, upper] =
                if g.layer < g.image { [g.layer, g.image] } else { [g.image, g.layer] };
            let (below, above) = rows.split_at_mut((upper - first) * row);
            let (lower, upper) = (&mut below[(lower - first) * row..][..row], &mut above[..row]);
            let (ghosts, images) = if g.layer < g.image { (lower, upper) } else { (upper, lower) };
            let visit_all = |ghosts: &mut [N], images: &mut [N]| {
                ghosts
                    .iter_mut()
                    .zip(images)
                    .for_each(|(ghost, image)| visit(ghost, image, g.flip));
            };
            if row <= NODES_AT_ONCE {
                visit_all(ghosts, images);
                continue;
            }
            let images = images.chunks_mut(NODES_AT_ONCE);
            let pairs = ghosts.chunks_mut(NODES_AT_ONCE).zip(images).collect();
            each(pairs, &|(ghosts, images)| visit_all(ghosts, images));
        }
    }

    /// The rows that are on walls across the last axis or beyond, and their mirror images: those at the lower end of the
    /// grid and those at its upper end. On a coarse grid all rows are at the lower end.
    pub(crate) fn edges(&self) -> [Range<usize>; 2] {
        let end = self.dims[D - 1];
        let (mut low, mut high) = (0, end);
        for g in self.ghosts.iter().filter(|g| g.axis == D - 1) {
            if g.layer < PAD_BELOW {
                low = low.max(g.image + 1);
            } else {
                high = high.min(g.image);
            }
        }
        if low < high { [0..low, high..end] } else { [0..end, end..end] }
    }

    /// Calls `clear(node, held)` for every node on a wall, with the components that it holds, in the rows from row `first` on.
    pub(crate) fn on_walls<N>(
        &self,
        first: usize,
        rows: &mut [N],
        clear: impl Fn(&mut N, Components),
    ) {
        for &WallLayer { axis, layer, held } in &self.walls {
            if axis < D - 1 {
                self.for_layer(rows.len(), (axis, layer), |index| clear(&mut rows[index], held));
            } else if let Some(layer) = layer.checked_sub(first) {
                let row = rows.chunks_mut(self.row()).nth(layer).unwrap_or_default();
                row.iter_mut().for_each(|node| clear(node, held));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::SVector;

    fn grid(cells: [usize; 2], walls: [[bool; 2]; 2]) -> Grid<f64, 2> {
        Grid { lower: SVector::zeros(), spacing: 1.0, cells, walls }
    }

    #[test]
    fn folding_conserves_the_sum_and_unfolding_mirrors() {
        for cells in [[1, 1], [2, 3], [5, 4]] {
            let layout = Layout::new(&grid(cells, [[true; 2]; 2]), 8).unwrap();
            // Unfolding restores weights that are symmetric about both walls of an axis.
            let mut nodes = vec![0.0; layout.nodes];
            layout.fold(&mut nodes, |_, _, _| {});
            for (index, node) in nodes.iter_mut().enumerate() {
                *node = (index % 7) as f64;
            }
            let (mut inside, total) = (0.0, nodes.iter().sum::<f64>());
            layout.fold(&mut nodes, |image, ghost, _| *image += ghost);
            for j in PAD_BELOW..=PAD_BELOW + cells[1] {
                for i in PAD_BELOW..=PAD_BELOW + cells[0] {
                    inside += nodes[i + layout.row() * j];
                }
            }
            assert_eq!(inside, total);

            // A field that is odd about the walls across axis 0 and even about those across axis 1.
            let wave = |i: usize, j: usize| {
                let angle = |k: usize, n: usize| {
                    std::f64::consts::PI * (k as f64 - PAD_BELOW as f64) / n as f64
                };
                angle(i, cells[0]).sin() * angle(j, cells[1]).cos()
            };
            let exact: Vec<f64> =
                (0..layout.nodes).map(|k| wave(k % layout.row(), k / layout.row())).collect();
            let mut field = exact.clone();
            for (k, value) in field.iter_mut().enumerate() {
                let (i, j) = (k % layout.row(), k / layout.row());
                let within = |k: usize, n: usize| (PAD_BELOW..=PAD_BELOW + n).contains(&k);
                if !within(i, cells[0]) || !within(j, cells[1]) {
                    *value = f64::NAN;
                }
            }
            layout.unfold(
                &mut field,
                |image, flip| {
                    if flip == Components::along(0) { -image } else { image }
                },
            );
            for (a, b) in field.iter().zip(&exact) {
                assert!((a - b).abs() < 1e-12, "{a} {b}");
            }
        }
    }

    #[test]
    fn grids_beyond_memory_are_refused() {
        let huge = grid([usize::MAX / 2, 16], [[false; 2]; 2]);
        assert!(matches!(Layout::new(&huge, 40), Err(SetupError::GridTooLarge { .. })));
        let long = grid([usize::MAX, 1], [[false; 2]; 2]);
        assert!(matches!(Layout::new(&long, 40), Err(SetupError::GridTooLarge { .. })));
        let empty = grid([3, 0], [[false; 2]; 2]);
        assert_eq!(Layout::new(&empty, 40).err(), Some(SetupError::NoCells { axis: 1 }));
    }
}
