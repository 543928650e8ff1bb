//! How many threads a step keeps busy, counted from the schedule of its sums.

use mmsmith_particles::{Division, Grid};
use mmsmith_threads::held::Held;

use crate::grid::tiles::Tiles;
use crate::grid::{Layout, NODES_AT_ONCE};
use crate::shape::one_axis::EXTENDED;

/// Cost of clearing a node of a tile's buffer and adding it to the grid, or of clearing a node of the grid and updating it, as a part of the
/// cost of a particle in a step. Measured by `mms run axis-aligned-3d --shape ugimp --integrator usl
/// --profile` with one to four particles along an axis of a cell.
const NODE: f64 = 0.07;

/// Tiles that are counted within a second or two.
const MOST_TILES: usize = 1 << 19;

/// Division of a body that fills a grid, with so many particles along each axis of a cell. `None` for a grid that no machine holds, or with more
/// tiles than are soon counted.
pub fn division_of_lattice<const D: usize>(
    grid: &Grid<f64, D>,
    per_cell: usize,
) -> Option<Division> {
    let layout = Layout::new(grid, size_of::<[f64; 8]>()).ok()?;
    let tiles = Tiles::new(&layout, &grid.cells, EXTENDED);
    let count = tiles.count();
    if count > MOST_TILES {
        return None;
    }
    let along = tiles.along_axes(per_cell);
    let particles: Vec<usize> = (0..count)
        .map(|tile| {
            let mut rest = tile;
            along.iter().fold(1, |particles, pieces| {
                let own = pieces[rest % pieces.len()];
                rest /= pieces.len();
                particles * own
            })
        })
        .collect();
    Some(division(&tiles, &layout, &particles))
}

/// Division of so many particles in each tile of a grid that one process holds.
pub(crate) fn division<const D: usize>(
    tiles: &Tiles<D>,
    layout: &Layout<D>,
    particles: &[usize],
) -> Division {
    let row = layout.row() as f64;
    let lattice = tiles.lattice(Held::whole(tiles.pieces()));
    let fill = |tile: usize| particles[tile] as f64;
    let add = |tile: usize| {
        let sums = if particles[tile] > 0 { lattice.elements(tile) } else { 0 };
        NODE * sums as f64
    };
    // Some nodes at a time are cleared before their sums, and whole rows updated after them; ghost nodes beyond walls across the last axis at the end,
    // one row after the other.
    let complete = |rows: usize| {
        let nodes = rows as f64 * row;
        NODE * (nodes + nodes.min(NODES_AT_ONCE as f64))
    };
    let ghosts = layout.ghost_rows() as f64 * row.min(NODES_AT_ONCE as f64);
    let of_tiles: f64 = (0..particles.len()).map(|tile| fill(tile) + add(tile)).sum();
    let work = of_tiles + 2.0 * NODE * layout.dims[D - 1] as f64 * row;
    let longest = lattice.longest(&fill, &add, &complete) + 2.0 * NODE * ghosts;
    let with: Vec<usize> = particles.iter().copied().filter(|&count| count > 0).collect();
    let all: usize = with.iter().sum();
    let mean = all as f64 / with.len().max(1) as f64;
    let most = with.iter().max().copied().unwrap_or(0) as f64;
    let unevenness = if mean > 0.0 { most / mean } else { 1.0 };
    let cores = if longest > 0.0 { (work / longest).max(1.0) } else { 1.0 };
    Division { tiles: with.len(), unevenness, cores }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::SVector;

    fn of<const D: usize>(cells: usize) -> Division {
        let grid = Grid {
            lower: SVector::zeros(),
            spacing: 1.0,
            cells: [cells; D],
            walls: [[true; 2]; D],
        };
        division_of_lattice(&grid, 2).unwrap()
    }

    #[test]
    fn layers_of_the_plane_are_cut() {
        for (cells, least) in [(64, 6.0), (128, 20.0), (256, 64.0), (1000, 500.0)] {
            let division = of::<2>(cells);
            let is_between = division.cores >= least && division.cores <= division.tiles as f64;
            assert!(is_between, "{cells}: {division:?}");
            assert!(division.unevenness <= 1.3, "{cells}: {division:?}");
        }
        assert_eq!(of::<1>(100).cores, 1.0);
    }

    #[test]
    fn a_cube_keeps_many_threads_busy() {
        for (cells, least) in [(64, 64.0), (100, 128.0), (500, 10_000.0)] {
            let division = of::<3>(cells);
            let is_between = division.cores >= least && division.cores <= division.tiles as f64;
            assert!(is_between, "{cells}: {division:?}");
            assert!(division.unevenness <= 1.3, "{cells}: {division:?}");
        }
    }
}
