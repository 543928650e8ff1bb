//! How many threads a step keeps busy, counted from the schedule of its sums.

use mmsmith_particles::{Division, Grid};
use mmsmith_threads::coloring::Held;

use crate::grid::tiles::Tiles;
use crate::grid::{Layout, NODES_AT_ONCE};
use crate::shape::one_axis::EXTENDED;

/// Cost of clearing a node of a tile's buffer and adding it to the grid, or of clearing a node of the grid and updating it, as a part of the
/// cost of a particle in a step. Measured by `mms run axis-aligned-3d --shape ugimp --integrator usl
/// --profile` with one to four particles along an axis of a cell.
const NODE: f64 = 0.07;

/// Tiles that are counted within a moment.
const MOST_TILES: usize = 1 << 16;

/// Division of a body that fills a grid, with so many particles along each axis of a cell. `None` for a grid that no machine holds, or with more
/// tiles than are soon counted.
pub fn division_of_lattice<const D: usize>(
    grid: &Grid<f64, D>,
    per_cell: usize,
) -> Option<Division> {
    let layout = Layout::new(grid, size_of::<[f64; 8]>()).ok()?;
    let tiles = Tiles::new(&layout, &grid.cells, EXTENDED);
    let count = tiles.layers() * tiles.in_a_layer();
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
    let held = Held::whole(tiles.layers());
    let row = layout.row() as f64;
    let of_rows = 2.0 * NODE * layout.dims[D - 1] as f64 * row;
    let (work, longest) = match tiles.lattice(&held) {
        Some(lattice) => {
            let fill = |tile: usize| particles[tile] as f64;
            let add = |tile: usize| {
                let sums = if particles[tile] > 0 { lattice.elements(tile) } else { 0 };
                NODE * sums as f64
            };
            let of_tiles: f64 = (0..particles.len()).map(|tile| fill(tile) + add(tile)).sum();
            // Nodes are cleared some at a time and updated by rows; ghost nodes beyond walls across the last axis one row after the other.
            let at_once = NODES_AT_ONCE as f64;
            let ghosts = layout.ghost_rows() as f64 * row.min(at_once);
            let update = NODE * (at_once + row.max(at_once) + 2.0 * ghosts);
            (of_tiles + of_rows, lattice.longest(&fill, &add) + update)
        }
        None => {
            // A layer's rows are updated with it, and every second layer waits for its neighbours.
            let work = |layer: usize| {
                let rows = tiles.first_row(layer + 1) - tiles.first_row(layer);
                particles[layer] as f64 + 2.0 * NODE * rows as f64 * row
            };
            let waits = |layer: usize| (particles.len() + layer).is_multiple_of(2);
            let chain = |layer: usize| {
                let around = layer.saturating_sub(1)..particles.len().min(layer + 2);
                let before = around.filter(|&other| other != layer && waits(layer));
                work(layer) + before.map(work).fold(0.0, f64::max)
            };
            let all = (0..particles.len()).map(work).sum();
            (all, (0..particles.len()).map(chain).fold(0.0, f64::max))
        }
    };
    let with: Vec<usize> = particles.iter().copied().filter(|&count| count > 0).collect();
    let all: usize = with.iter().sum();
    let mean = all as f64 / with.len().max(1) as f64;
    let most = with.iter().max().copied().unwrap_or(0) as f64;
    let unevenness = if mean > 0.0 { most / mean } else { 1.0 };
    let cores = if longest > 0.0 { work / longest } else { 1.0 };
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
    fn bands_keep_half_as_many_threads_busy_as_there_are() {
        let plane = of::<2>(256);
        assert_eq!((plane.tiles, plane.unevenness), (32, 1.0));
        assert!((15.0..=16.5).contains(&plane.cores), "{plane:?}");
        assert_eq!(of::<1>(100).cores, 1.0);
    }

    #[test]
    fn a_cube_keeps_many_threads_busy() {
        for (cells, least) in [(64, 64.0), (100, 128.0), (500, 10_000.0)] {
            let division = of::<3>(cells);
            assert!(division.cores >= least && division.cores <= division.tiles as f64);
            assert!(division.unevenness <= 1.3, "{cells}: {division:?}");
        }
    }
}
