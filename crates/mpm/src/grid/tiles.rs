//! Tiles: pieces of the grid, by which particles are sorted and sums go.
//!
//! Along the last axis the grid is cut into layers, each layer along the other axes. The cuts depend on the numbers
//! of cells alone, and all pieces of an axis have the same length, which need not be a whole number of cells. A particle belongs to the tile
//! of the lower corner of its box at the last sort. It reaches nodes of the tile's window, which leaves it some room to drift.

use std::ops::Range;

use mmsmith_threads::held::Held;
use mmsmith_threads::lattice::TileLattice;

use crate::grid::{Layout, NODES_AT_ONCE, PAD_BELOW};

/// Least length of a layer, in cells: in one dimension, where a row is one node, and in more. A stencil of six nodes with its lower edge in
/// a layer of eight cells ends within the next one.
pub(crate) const LAYER_OF_NODES: usize = 256;
const LAYER: usize = 8;

/// Least length of the pieces of a layer along an axis, in cells: in the plane, where a layer has few particles, and in space. Particles that follow
/// each other along axis 0 lie side by side in memory, hence the length.
const fn least_piece<const D: usize>(axis: usize) -> usize {
    match (D, axis) {
        (2, _) => 64,
        (_, 0) => 128,
        _ => 4,
    }
}

/// Nodes that a layer has below the lower edges of its particles, and cells by which these may sink or rise before the next sort.
const BELOW_LAYER: usize = 2;
/// Nodes that a piece of a layer has below the lower edges of its particles, and cells by which these may rise.
const AROUND_PIECE: usize = 1;

/// The pieces of the grid along an axis.
#[derive(Clone, Copy, Debug)]
struct Pieces {
    count: usize,
    cells: usize,
    /// Layers of nodes along the axis, padding included.
    nodes: usize,
    reach: Reach,
}

/// How far the window of a piece reaches above it.
#[derive(Clone, Copy, Debug)]
enum Reach {
    /// As far as that of the next piece, less the nodes that the one after it has, and no farther than stencils of so many nodes do whose lower edges
    /// rise two cells.
    NextPiece(usize),
    /// As far as stencils of so many nodes do whose lower edges rise a cell.
    Stencil(usize),
}

impl Pieces {
    /// The piece of a lower edge, in cells.
    fn of(self, edge: f64) -> usize {
        let piece = edge * self.count as f64 / self.cells as f64;
        (piece.max(0.0) as usize).min(self.count - 1)
    }

    /// The first node of a piece's window.
    fn first(self, piece: usize) -> usize {
        let below = match self.reach {
            Reach::NextPiece(_) => BELOW_LAYER,
            Reach::Stencil(_) => AROUND_PIECE,
        };
        if piece == 0 { 0 } else { piece * self.cells / self.count + PAD_BELOW - below }
    }

    /// The nodes of a piece's window.
    fn window(self, piece: usize) -> Range<usize> {
        // The first node of a stencil is the one at its lower edge or below.
        let of_stencils = |rise: usize, width: usize| match piece + 1 < self.count {
            true => {
                let last = ((piece + 1) * self.cells).div_ceil(self.count) + rise - 1;
                self.nodes.min(last + PAD_BELOW + width)
            }
            false => self.nodes,
        };
        let end = match self.reach {
            Reach::NextPiece(width) if piece + 2 < self.count => {
                self.first(piece + 2).min(of_stencils(BELOW_LAYER, width))
            }
            Reach::NextPiece(width) => of_stencils(BELOW_LAYER, width),
            Reach::Stencil(width) => of_stencils(AROUND_PIECE, width),
        };
        self.first(piece)..end
    }

    /// The lower edges, in cells from the lower corner of the grid, of stencils of `width` nodes that lie in the window of a piece: from the
    /// first value on and below the second. Windows that reach the end of the grid hold all stencils up to there.
    #[inline(always)]
    fn range(self, piece: usize, width: usize) -> (f64, f64) {
        let Range { start, end } = self.window(piece);
        let last = if end < self.nodes {
            (end + 1) as f64 - (PAD_BELOW + width) as f64
        } else {
            f64::INFINITY
        };
        (start as f64 - PAD_BELOW as f64, last)
    }
}

/// The tiles of a grid.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tiles<const D: usize> {
    axes: [Pieces; D],
}

impl<const D: usize> Tiles<D> {
    /// Tiles of a grid on which stencils have `width` nodes along an axis at most.
    pub(crate) fn new(layout: &Layout<D>, cells: &[usize; D], width: usize) -> Self {
        let axes = std::array::from_fn(|a| {
            let (least, reach) = match a + 1 < D {
                true => (least_piece::<D>(a), Reach::Stencil(width)),
                false => (if D == 1 { LAYER_OF_NODES } else { LAYER }, Reach::NextPiece(width)),
            };
            let count = (cells[a] / least).max(1);
            Pieces { count, cells: cells[a], nodes: layout.dims[a], reach }
        });
        Self { axes }
    }

    /// Their cuts along the first axis and the last.
    pub(crate) fn half_plane(&self) -> Tiles<2> {
        Tiles { axes: [self.axes[0], self.axes[D - 1]] }
    }

    /// How many of the particles of a lattice each piece of each axis has, with so many along an axis of a cell.
    pub(crate) fn along_axes(&self, per_cell: usize) -> [Vec<usize>; D] {
        self.axes.map(|pieces| {
            let all = (per_cell * pieces.cells) as u128;
            // The first particle whose lower edge lies in a piece.
            let first = |piece: usize| (piece as u128 * all).div_ceil(pieces.count as u128);
            (0..pieces.count).map(|piece| (first(piece + 1) - first(piece)) as usize).collect()
        })
    }

    /// Nodes that a process in the middle sends in a pass, about, where so many share each axis evenly.
    pub(crate) fn sent(&self, along_axes: &[usize; D]) -> f64 {
        let share = |a: usize| self.axes[a].nodes as f64 / along_axes[a] as f64;
        let across = |axis: usize| (0..D).filter(|a| *a != axis).map(share).product::<f64>();
        let deep = |axis: usize| match axis + 1 < D {
            false => 2.0 * LAYER as f64,
            // Windows of layers cover each row twice, and the nodes of the nearest tile go back.
            true => {
                let all: usize = self.overlaps(axis).sum();
                (2 * all + self.overlaps(axis).next().unwrap_or(0)) as f64
            }
        };
        let sides = |axis: usize| (along_axes[axis] - 1).min(2) as f64;
        (0..D).map(|a| sides(a) * deep(a) * across(a)).sum()
    }

    /// The tile of a particle at a sort, by the lower edges of its box along all axes, in cells.
    pub(crate) fn tile_of(&self, edges: &[f64; D]) -> u32 {
        self.number(&std::array::from_fn(|a| self.axes[a].of(edges[a])))
    }

    /// Number of tiles.
    pub(crate) fn count(&self) -> usize {
        self.axes.iter().map(|pieces| pieces.count).product()
    }

    /// Whether the grid has this tile.
    pub(crate) fn has(&self, tile: u32) -> bool {
        (tile as usize) < self.count()
    }

    /// Number of pieces along each axis.
    pub(crate) fn pieces(&self) -> [usize; D] {
        self.axes.map(|pieces| pieces.count)
    }

    /// The pieces of a tile along each axis.
    #[inline(always)]
    pub(crate) fn pieces_of(&self, tile: u32) -> [usize; D] {
        let mut rest = tile as usize;
        std::array::from_fn(|a| {
            let count = if a + 1 < D { self.axes[a].count } else { usize::MAX };
            let piece = rest % count;
            rest /= count;
            piece
        })
    }

    /// The tile of pieces along each axis.
    pub(crate) fn number(&self, pieces: &[usize; D]) -> u32 {
        (0..D).rev().fold(0, |tile, a| tile * self.axes[a].count + pieces[a]) as u32
    }

    /// The fewest pieces along an axis that a process holds among others: eight cells, so that it has all nodes that updates of its neighbours ask for.
    pub(crate) fn least_held(&self, axis: usize) -> usize {
        let Pieces { count, cells, .. } = self.axes[axis];
        let is_enough = |held: &usize| held * cells >= LAYER * count;
        if axis + 1 < D { (1..count).find(is_enough).unwrap_or(count) } else { 1 }
    }

    /// How many nodes the window of the first piece along an axis has in common with each of the next.
    fn overlaps(&self, axis: usize) -> impl Iterator<Item = usize> {
        let pieces = self.axes[axis];
        let end = pieces.window(0).end;
        (1..pieces.count).map_while(move |next| end.checked_sub(pieces.first(next)))
    }

    /// The first row of nodes of a layer, or their number for the one after the last.
    pub(crate) fn first_row(&self, layer: usize) -> usize {
        let layers = self.axes[D - 1];
        if layer < layers.count { layers.first(layer) } else { layers.nodes }
    }

    /// For each axis the lower edges of stencils of `width` nodes, in cells from the lower corner of the grid, that lie in the window of a
    /// tile: from the first value on and below the second.
    #[inline(always)]
    pub(crate) fn range(&self, tile: u32, width: usize) -> [(f64, f64); D] {
        let pieces = self.pieces_of(tile);
        std::array::from_fn(|a| self.axes[a].range(pieces[a], width))
    }

    /// The windows of the tiles `held`.
    pub(crate) fn lattice(&self, held: Held<D>) -> TileLattice<D> {
        let windows = |pieces: &Pieces| (0..pieces.count).map(|p| pieces.window(p)).collect();
        TileLattice::new(self.axes.each_ref().map(windows), held, NODES_AT_ONCE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::one_axis::EXTENDED;
    use mmsmith_particles::Grid;
    use nalgebra::SVector;
    use proptest::prelude::*;

    fn tiles<const D: usize>(cells: [usize; D], width: usize) -> (Layout<D>, Tiles<D>) {
        let grid = Grid { lower: SVector::zeros(), spacing: 1.0, cells, walls: [[false; 2]; D] };
        let layout = Layout::new(&grid, 8).unwrap();
        let tiles = Tiles::new(&layout, &cells, width);
        (layout, tiles)
    }

    /// A particle that was sorted may drift by a cell, if its stencil is not the widest one, and its stencil lies in the tile's window.
    fn check<const D: usize>(
        cells: [usize; D],
        width: usize,
        at: &[f64],
    ) -> Result<(), TestCaseError> {
        let (layout, tiles) = tiles(cells, EXTENDED);
        let lattice = tiles.lattice(Held::whole(tiles.pieces()));
        let edges: [f64; D] = std::array::from_fn(|a| at[a] * (cells[a] as f64 + 2.0) - 2.0);
        let tile = tiles.tile_of(&edges);
        prop_assert!(tiles.has(tile));
        let ranges = tiles.range(tile, width);
        for a in 0..D {
            let (first, end) = ranges[a];
            prop_assert!(first <= edges[a] && edges[a] < end, "{:?} {} {:?}", edges, a, ranges);
            if width < EXTENDED {
                prop_assert!(first <= (edges[a] - 1.0).max(-2.0) && edges[a] + 1.0 <= end);
            }
            let window = lattice.window(tile as usize)[a].clone();
            // The lowest and the highest stencil.
            prop_assert!(first.floor() + PAD_BELOW as f64 >= window.start as f64);
            let last =
                (end.next_down().floor() + (PAD_BELOW + width) as f64).min(layout.dims[a] as f64);
            prop_assert!(last <= window.end as f64);
        }
        Ok(())
    }

    proptest! {
        #[test]
        fn stencils_of_particles_lie_in_the_windows_of_their_tiles(
            cells in prop::array::uniform3(1..400_usize),
            width in 2..=EXTENDED,
            at in prop::array::uniform3(0.0..1.0),
        ) {
            check([cells[0] * 7], width, &at)?;
            check([cells[0], cells[1]], width, &at)?;
            check(cells, width, &at)?;
        }

        /// Two particles along each axis of a cell: tiles have much the same number of them.
        #[test]
        fn tiles_of_a_lattice_have_as_many_particles(cells in 12..700_usize) {
            let (_, tiles) = tiles([cells; 3], EXTENDED);
            let mut most = 1.0;
            for counts in tiles.along_axes(2) {
                let (least, largest) = (counts.iter().min().unwrap(), counts.iter().max().unwrap());
                most *= *largest as f64 / *least as f64;
            }
            prop_assert!(most <= 1.3, "{cells}: {most}");
        }
    }
}
