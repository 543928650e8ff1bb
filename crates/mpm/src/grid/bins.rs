//! Particles sorted by tiles: P2G in parallel with sums in a fixed order.
//!
//! A row is all nodes that share an index along the last axis. Layers of [tiles](crate::grid::tiles) divide the rows. Each particle belongs
//! to one tile, and particles of a tile come in a fixed order. No sum depends on the number of threads: a tile sums in a buffer of its own, which is
//! added to the grid in its turn ([`windows`](mmsmith_threads::windows)). The grid update of a row follows its last contribution, while
//! the row lies in the cache.
//!
//! Particles may drift for some steps before the next sort. The order of the last sort decides the order of all sums. It follows from the
//! tile that each particle was in then, which belongs to the state of a run: a run that continues to the same bits restores it.

use std::sync::Arc;

use mmsmith_particles::Division;
use mmsmith_ranks::Ranks;
use mmsmith_threads::parallel::*;

use crate::every_scheme::{Beyond, beyond};
use crate::grid::Layout;
use crate::grid::division::division;
use crate::grid::tiles::Tiles;
use crate::kernel::copies::BLOCK;
use mmsmith_threads::disjoint::Partition;
use mmsmith_threads::held::Held;
use mmsmith_threads::lattice::TileLattice;
use mmsmith_threads::windows::{Hooks, TileBuffers, sum_tiles};

/// Particles, or corners that they share, sorted by tile, within each tile by id, but for particles that follow no whole block.
///
/// They are not sorted further: neighbours mostly have successive ids, their data then lie side by side in memory, and the
/// kernels use whole blocks in place. Particles that are left between whole blocks come last in a tile.
pub(crate) struct Bins<N, const D: usize> {
    tiles: Tiles<D>,
    /// The tiles that this process holds.
    lattice: TileLattice<D>,
    /// For each tile of the whole grid its number here.
    here: Vec<u32>,
    /// Their buffers, between passes.
    buffers: TileBuffers<N>,
    /// The processes that hold all of them, where those are several.
    ranks: Option<Beyond<Arc<dyn Ranks>>>,
    /// Particle numbers, tile after tile.
    order: Partition,
    /// Buffer of the sort: particles in each tile, later the place of the next of them.
    counts: Vec<u32>,
    /// Tile of every particle at the last sort, among those of the whole grid.
    keys: Vec<u32>,
}

/// Nodes to which the particles of a tile add: those of its window.
pub(crate) struct Window<'a, N, const D: usize> {
    pub(crate) nodes: &'a mut [N],
    /// The tile, among those of the whole grid.
    pub(crate) tile: u32,
    /// Distance between neighbouring nodes along each axis, and the nodes of the grid before the one of index zero, a whole number.
    pub(crate) strides: [usize; D],
    pub(crate) nodes_before: f64,
}

/// Adds the particles of a tile to nodes: `add(window, ids)`, with the particles in order.
pub(crate) type AddToWindow<'a, N, const D: usize> = dyn Fn(Window<'_, N, D>, &[u32]) + Sync + 'a;

/// As [`AddToWindow`] for kernels that change particles: `add(window, divided, part)`, with the particles divided among tiles, and the part that
/// is this tile's.
pub(crate) type UpdateAndAdd<'a, N, P, const D: usize> =
    dyn Fn(Window<'_, N, D>, &P, usize) + Sync + 'a;

impl<N: Copy + Send + Sync, const D: usize> Bins<N, D> {
    /// Allocates for `particles` particles on the grid; `sort_as` has to follow.
    pub(crate) fn new(tiles: Tiles<D>, particles: usize) -> Self {
        let held = Held::whole(tiles.pieces());
        let mut own = Self {
            tiles,
            lattice: tiles.lattice(held.clone()),
            here: Vec::new(),
            buffers: TileBuffers::default(),
            ranks: None,
            order: Partition::new(0, 0),
            counts: Vec::new(),
            keys: vec![0; particles],
        };
        own.hold(held, particles);
        own
    }

    /// The tiles of the whole grid.
    pub(crate) fn tiles(&self) -> &Tiles<D> {
        &self.tiles
    }

    /// The tiles that this process holds.
    pub(crate) fn lattice(&self) -> &TileLattice<D> {
        &self.lattice
    }

    /// Makes room for so many particles in the tiles `held`; `sort_as` has to follow.
    pub(crate) fn hold(&mut self, held: Held<D>, particles: usize) {
        if self.here.is_empty() || held != *self.lattice.held() {
            self.lattice = self.tiles.lattice(held);
            self.here.clear();
            self.here.resize(self.tiles.count(), u32::MAX);
            for tile in 0..self.lattice.count() {
                let of_grid = self.tiles.number(&self.lattice.pieces(tile));
                self.here[of_grid as usize] = tile as u32;
            }
        }
        let tiles = self.lattice.count();
        self.counts.resize(tiles + 1, 0);
        self.order = Partition::new(particles, tiles);
    }

    /// Shares the tiles out among processes; [`hold`](Self::hold) has to follow.
    pub(crate) fn share_out(&mut self, ranks: Arc<dyn Ranks>) {
        self.ranks = beyond(ranks);
    }

    /// The processes that hold all tiles, where those are several.
    pub(crate) fn ranks(&self) -> Option<Arc<dyn Ranks>> {
        self.ranks.as_deref().cloned()
    }

    /// The result of the last sort: the tile of every particle.
    pub(crate) fn keys(&self) -> &[u32] {
        &self.keys
    }

    /// The tile of each of `count` particles, by the lower edges of their boxes in cells, in the numbers of the whole grid.
    pub(crate) fn keys_of(
        &self,
        count: usize,
        edges: &(dyn Fn(usize) -> [f64; D] + Sync),
    ) -> Vec<u32> {
        (0..count).into_par_iter().map(|p| self.tiles.tile_of(&edges(p))).collect()
    }

    /// How many threads the particles keep busy as they were at the last sort; none where other processes hold some of them.
    pub(crate) fn division(&self, layout: &Layout<D>) -> Option<Division> {
        let of_tile = |tile| self.order.part(tile).map_or(0, <[u32]>::len);
        let particles: Vec<usize> = (0..self.tiles.count()).map(of_tile).collect();
        self.ranks.is_none().then(|| division(&self.tiles, layout, &particles))
    }

    /// Sorts all particles by their tiles, which are held here. Those that come in whole blocks come first in a tile, where `id(p)` is told, the
    /// number of particle p in the whole body, so that the order is the same for any number of processes.
    pub(crate) fn sort_as(&mut self, keys: Vec<u32>, id: Option<&dyn Fn(usize) -> u64>) {
        let Self { here, counts, order, keys: known, .. } = self;
        *known = keys;
        let keys = &*known;
        let here = |key: u32| here[key as usize] as usize;
        counts.fill(0);
        for &key in keys {
            counts[here(key) + 1] += 1;
        }
        for tile in 1..counts.len() {
            counts[tile] += counts[tile - 1];
        }
        let (order, starts) = order.arrange();
        for (start, first) in starts.iter_mut().zip(&*counts) {
            *start = *first as usize;
        }
        for (p, &key) in keys.iter().enumerate() {
            let place = &mut counts[here(key)];
            order[*place as usize] = p as u32;
            *place += 1;
        }
        if let Some(id) = id {
            let mut others = Vec::new();
            for tile in starts.windows(2) {
                whole_blocks_first(&mut order[tile[0]..tile[1]], &mut others, id);
            }
        }
    }

    /// Calls `add` for every tile here, in parallel.
    pub(crate) fn for_each(
        &mut self,
        nodes: &mut [N],
        hooks: Hooks<'_, N>,
        add: &AddToWindow<'_, N, D>,
    ) {
        self.for_each_mut(nodes, hooks, |order| &*order, &|window, order: &&Partition, part| {
            if let Some(particles) = order.part(part) {
                add(window, particles);
            }
        });
    }

    /// As [`for_each`](Self::for_each) for kernels that change the tile's particles: `divide(partition)` divides them among tiles, and
    /// `add(window, divided, part)` finds those of the tile there.
    pub(crate) fn for_each_mut<'a, P: Sync>(
        &'a mut self,
        elements: &mut [N],
        hooks: Hooks<'_, N>,
        divide: impl FnOnce(&'a mut Partition) -> P,
        add: &UpdateAndAdd<'_, N, P, D>,
    ) {
        let Self { tiles, order, lattice, buffers, .. } = self;
        let has_particles: Vec<bool> =
            (0..lattice.count()).map(|part| order.part(part) != Some(&[])).collect();
        let divided = divide(order);
        let fill = |part: usize, nodes: &mut [N]| {
            let window = lattice.window(part);
            let (mut strides, mut before) = ([1; D], 0);
            for a in 0..D {
                if a > 0 {
                    strides[a] = strides[a - 1] * window[a - 1].len();
                }
                before += window[a].start * strides[a];
            }
            let (tile, nodes_before) = (tiles.number(&lattice.pieces(part)), before as f64);
            add(Window { nodes, tile, strides, nodes_before }, &divided, part);
        };
        sum_tiles(elements, lattice, buffers, &has_particles, &fill, hooks);
    }
}

/// Puts first the particles of a tile that come in whole blocks of successive ids. `others` is a buffer.
fn whole_blocks_first(particles: &mut [u32], others: &mut Vec<u32>, id: &dyn Fn(usize) -> u64) {
    others.clear();
    let (mut place, mut end) = (0, 0);
    while place < particles.len() {
        let run = &particles[place..];
        let is_next = |pair: &&[u32]| id(pair[1] as usize) == id(pair[0] as usize) + 1;
        let length = run.windows(2).take_while(is_next).count() + 1;
        let whole = length / BLOCK * BLOCK;
        others.extend_from_slice(&run[whole..length]);
        particles.copy_within(place..place + whole, end);
        (place, end) = (place + length, end + whole);
    }
    particles[end..].copy_from_slice(others);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::PAD_BELOW;
    use mmsmith_particles::Grid;
    use nalgebra::SVector;

    fn bins<const D: usize>(cells: [usize; D], particles: usize) -> (Layout<D>, Bins<i64, D>) {
        let grid = Grid { lower: SVector::zeros(), spacing: 1.0, cells, walls: [[false; 2]; D] };
        let layout = Layout::new(&grid, 8).unwrap();
        let tiles = Tiles::new(&layout, &cells, 6);
        (layout, Bins::new(tiles, particles))
    }

    /// Lower edges of boxes, numbered from the far end on, so that numbers and places differ in order.
    fn edges<const D: usize>(cells: [usize; D]) -> Vec<[f64; D]> {
        let count: usize = cells.iter().map(|cells| 2 * cells).product();
        let place = |p: usize| {
            let mut rest = count - 1 - p;
            std::array::from_fn(|a| {
                let place = rest % (2 * cells[a]);
                rest /= 2 * cells[a];
                place as f64 / 2.0
            })
        };
        (0..count).filter(|p| p % 3 != 1).map(place).collect()
    }

    #[test]
    fn particles_are_sorted_by_tile_and_then_by_id() {
        fn check<const D: usize>(cells: [usize; D]) {
            let edges = edges(cells);
            let (_, mut bins) = bins(cells, edges.len());
            assert!(edges.is_empty() || !bins.order.is_whole());
            bins.sort_as(bins.keys_of(edges.len(), &|p| edges[p]), Some(&|p| p as u64));
            assert!(bins.order.is_whole());
            let mut met = vec![0; edges.len()];
            let count = bins.tiles.count();
            for tile in 0..count {
                let particles = bins.order.part(tile).unwrap();
                assert!(particles.is_sorted());
                for &p in particles {
                    met[p as usize] += 1;
                    assert_eq!(bins.keys()[p as usize] as usize, tile);
                    assert_eq!(bins.tiles.tile_of(&edges[p as usize]) as usize, tile);
                }
            }
            assert!(bins.order.part(count).is_none());
            assert!(met.iter().all(|&times| times == 1));
        }
        check([700]);
        check([5, 40]);
        check([4, 30, 25]);
    }

    /// Each tile adds to every node of its window: the update comes after the last contribution to a node, and the nodes are zero before.
    #[test]
    fn every_node_is_cleared_summed_and_updated() {
        fn check<const D: usize>(cells: [usize; D]) {
            let edges = edges(cells);
            let (layout, mut bins) = bins(cells, edges.len());
            bins.sort_as(bins.keys_of(edges.len(), &|p| edges[p]), Some(&|p| p as u64));
            let row = layout.row();
            let hooks = Hooks {
                before: &|nodes: &mut [i64]| nodes.fill(0),
                after: &|nodes: &mut [i64], first| {
                    assert_eq!(first % row, 0);
                    nodes.iter_mut().for_each(|node| *node += 1_000_000);
                },
                zero: 0,
                add: &|nodes: &mut [i64], others: &mut [i64]| {
                    for (node, other) in nodes.iter_mut().zip(others) {
                        *node += std::mem::take(other);
                    }
                },
                halo: None,
            };
            // The first node of each particle, by indices as they are in its window.
            let add = |window: Window<'_, i64, D>, ids: &[u32]| {
                for &p in ids {
                    let first: usize = (0..D)
                        .map(|a| {
                            let place = edges[p as usize][a].floor() as usize + PAD_BELOW;
                            place * window.strides[a]
                        })
                        .sum();
                    window.nodes[first - window.nodes_before as usize] += 1;
                }
            };
            let mut nodes = vec![9; layout.nodes];
            bins.for_each(&mut nodes, hooks, &add);
            let mut expected = vec![1_000_000; layout.nodes];
            for edges in &edges {
                let at = |a: usize| (edges[a].floor() as usize + PAD_BELOW) * layout.strides[a];
                expected[(0..D).map(at).sum::<usize>()] += 1;
            }
            assert_eq!(nodes, expected);
            let mut seen = vec![9; layout.nodes];
            let divide = |order: &mut Partition| {
                (0..).map_while(|part| order.part(part).map(<[u32]>::to_vec)).collect::<Vec<_>>()
            };
            bins.for_each_mut(&mut seen, hooks, divide, &|window, divided, part| {
                add(window, &divided[part]);
            });
            assert_eq!(seen, nodes);
        }
        check([1100]);
        check([5]);
        check([5, 40]);
        check([5, 1]);
        check([4, 3, 25]);
        check([4, 13, 9]);
    }
}
