//! Particles sorted by tiles: P2G in parallel with sums in a fixed order.
//!
//! A row is all nodes that share an index along the last axis. Layers of [tiles](crate::grid::tiles) divide the rows. Each particle belongs
//! to one tile, and particles of a tile come in a fixed order. No sum depends on the number of threads.
//!
//! On a line and in the plane a layer is one tile, which adds to its band: its own rows and the rows of the next layer. Only the bands of
//! neighbours overlap, and a two-colour schedule keeps those apart in time ([`coloring`](mmsmith_threads::coloring)). The grid update of a row
//! follows its last contribution, while the row lies in the cache. In space a tile sums in a buffer of its own, which is added to the grid
//! in its turn ([`windows`](mmsmith_threads::windows)), so that many more threads find work; the rows are updated when all is added.
//!
//! Particles may drift for some steps before the next sort. The order of the last sort decides the order of all sums. It follows from the
//! tile that each particle was in then, which belongs to the state of a run: a run that continues to the same bits restores it.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use mmsmith_particles::Division;
use mmsmith_ranks::Ranks;
use mmsmith_threads::parallel::*;

use crate::every_scheme::{Beyond, beyond};
use crate::grid::division::division;
use crate::grid::tiles::Tiles;
use crate::grid::{Layout, NODES_AT_ONCE};
use mmsmith_threads::coloring::{ColoredBands, Held, Schedule, Shared};
use mmsmith_threads::disjoint::Partition;
use mmsmith_threads::windows::{AddLine, TileBuffers, TileLattice, TileSums};
use mmsmith_threads::{each_chunk, on_all_threads};

/// Particles sorted by tile, within each tile by id.
///
/// They are not sorted further: neighbours mostly have successive ids, their data then lie side by side in memory, and the
/// kernels use them in place.
pub(crate) struct Bins<N, const D: usize> {
    tiles: Tiles<D>,
    /// The layers of tiles that this process holds.
    held: Held,
    /// The windows of these tiles, where they sum in buffers.
    lattice: Option<TileLattice<D>>,
    /// These buffers, between passes.
    buffers: TileBuffers<N>,
    /// The processes that hold all of them, where those are several.
    ranks: Option<Beyond<Arc<dyn Ranks>>>,
    /// Particle numbers, tile after tile.
    order: Partition,
    /// Buffer of the two-colour schedule.
    schedule: Schedule,
    /// Buffer of the sort: particles in each tile, later the place of the next of them.
    counts: Vec<u32>,
    /// Tile of every particle at the last sort, among those of the whole grid.
    keys: Vec<u32>,
}

/// Nodes to which the particles of a tile add.
pub(crate) struct Band<'a, N, const D: usize> {
    pub(crate) nodes: &'a mut [N],
    /// The index of the first of these nodes.
    pub(crate) first: usize,
    /// The tile, among those of the whole grid.
    pub(crate) tile: u32,
    /// Distance between neighbouring nodes along each axis, and the nodes of the grid before the one of index zero, a whole number.
    pub(crate) strides: [usize; D],
    pub(crate) nodes_before: f64,
}

/// Adds the particles of a tile to nodes: `add(band, ids)`, with the particles in order.
pub(crate) type AddToBand<'a, N, const D: usize> = dyn Fn(Band<'_, N, D>, &[u32]) + Sync + 'a;

/// As [`AddToBand`] for kernels that change particles: `add(band, divided, part)`, with the particles divided among tiles, and the part that
/// is this tile's.
pub(crate) type UpdateAndAdd<'a, N, P, const D: usize> =
    dyn Fn(Band<'_, N, D>, &P, usize) + Sync + 'a;

/// Calls for each node, some rows at a time: before the first contribution to it and after the last one.
#[derive(Clone, Copy)]
pub(crate) struct NodeHooks<'a, N> {
    /// Before the first contribution.
    pub(crate) before: &'a (dyn Fn(&mut [N]) + Sync),
    /// After the last contribution; the second argument is the index of the first node.
    pub(crate) after: &'a (dyn Fn(&mut [N], usize) + Sync),
    /// A node without contributions, and the sum of nodes and others, which are cleared.
    pub(crate) zero: N,
    pub(crate) add: &'a AddLine<'a, N>,
    /// The exchange with processes that hold other tiles, where there are such.
    pub(crate) halo: Option<Halo<'a, N>>,
}

/// Messages with the processes of the layers below and above.
#[derive(Clone, Copy)]
pub(crate) struct Halo<'a, N> {
    /// Sends the nodes of a segment that is shared.
    pub(crate) send: &'a (dyn Fn(Shared, &[N]) + Sync),
    /// Receives them.
    pub(crate) receive: &'a (dyn Fn(Shared, &mut [N]) + Sync),
    /// Whether that would not wait.
    pub(crate) has_arrived: &'a (dyn Fn(Shared) -> bool + Sync),
    /// Whether these rows of the grid are updated right after their last contribution.
    pub(crate) is_updated: &'a (dyn Fn(Range<usize>) -> bool + Sync),
    /// Between the last contribution of all and the last messages.
    pub(crate) finish: &'a (dyn Fn(&mut [N]) + Sync),
}

impl<N: Copy + Send + Sync, const D: usize> Bins<N, D> {
    /// Allocates for `particles` particles on the grid; `sort_as` has to follow.
    pub(crate) fn new(tiles: Tiles<D>, particles: usize) -> Self {
        let mut own = Self {
            tiles,
            held: Held::default(),
            lattice: None,
            buffers: TileBuffers::default(),
            ranks: None,
            order: Partition::new(0, 0),
            schedule: Schedule::default(),
            counts: Vec::new(),
            keys: vec![0; particles],
        };
        own.hold(Held::whole(tiles.layers()), particles);
        own
    }

    /// The tiles of the whole grid.
    pub(crate) fn tiles(&self) -> &Tiles<D> {
        &self.tiles
    }

    /// Makes room for so many particles in the layers `held`; `sort_as` has to follow.
    pub(crate) fn hold(&mut self, held: Held, particles: usize) {
        let tiles = held.bands.len() * self.tiles.in_a_layer();
        self.counts.resize(tiles + 1, 0);
        self.order = Partition::new(particles, tiles);
        if held != self.held {
            self.lattice = self.tiles.lattice(&held);
        }
        self.held = held;
    }

    /// Shares the layers out among processes; [`hold`](Self::hold) has to follow.
    pub(crate) fn share_out(&mut self, ranks: Arc<dyn Ranks>) {
        self.ranks = beyond(ranks);
    }

    /// The processes that hold all layers, where those are several.
    pub(crate) fn ranks(&self) -> Option<Arc<dyn Ranks>> {
        self.ranks.as_deref().cloned()
    }

    /// The rows that other processes hold as well, at the lower and at the upper end of those here.
    pub(crate) fn shared_rows(&self) -> [Option<Range<usize>>; 2] {
        let segments = self.held.segments();
        let rows = |segment| self.tiles.first_row(segment)..self.tiles.first_row(segment + 1);
        [
            (segments.start > 0).then(|| rows(segments.start)),
            (segments.end < self.held.all).then(|| rows(segments.end - 1)),
        ]
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
        let tiles = self.tiles.layers() * self.tiles.in_a_layer();
        let of_tile = |tile| self.order.part(tile).map_or(0, <[u32]>::len);
        let particles: Vec<usize> = (0..tiles).map(of_tile).collect();
        self.ranks.is_none().then(|| division(&self.tiles, layout, &particles))
    }

    /// The number of the first tile here.
    fn first_tile(&self) -> usize {
        self.held.bands.start * self.tiles.in_a_layer()
    }

    /// Sorts all particles by their tiles, of layers that are held here.
    pub(crate) fn sort_as(&mut self, keys: Vec<u32>) {
        self.keys = keys;
        let first = self.first_tile();
        self.counts.fill(0);
        for &key in &self.keys {
            self.counts[key as usize - first + 1] += 1;
        }
        for tile in 1..self.counts.len() {
            self.counts[tile] += self.counts[tile - 1];
        }
        let (order, starts) = self.order.arrange();
        for (start, first) in starts.iter_mut().zip(&self.counts) {
            *start = *first as usize;
        }
        for (p, &key) in self.keys.iter().enumerate() {
            let place = &mut self.counts[key as usize - first];
            order[*place as usize] = p as u32;
            *place += 1;
        }
    }

    /// Calls `add` for every tile here, in parallel.
    pub(crate) fn for_each(
        &mut self,
        layout: &Layout<D>,
        nodes: &mut [N],
        hooks: NodeHooks<'_, N>,
        add: &AddToBand<'_, N, D>,
    ) {
        self.for_each_mut(
            layout,
            nodes,
            hooks,
            |order| &*order,
            &|band, order: &&Partition, part| {
                if let Some(particles) = order.part(part) {
                    add(band, particles);
                }
            },
        );
    }

    /// As [`for_each`](Self::for_each) for kernels that change the tile's particles: `divide(partition)` divides them among tiles, and
    /// `add(band, divided, part)` finds those of the tile there.
    pub(crate) fn for_each_mut<'a, P: Sync>(
        &'a mut self,
        layout: &Layout<D>,
        nodes: &mut [N],
        hooks: NodeHooks<'_, N>,
        divide: impl FnOnce(&'a mut Partition) -> P,
        add: &UpdateAndAdd<'_, N, P, D>,
    ) {
        let first_tile = self.first_tile();
        let Self { tiles, held, order, schedule, lattice, buffers, .. } = self;
        let grid = Sums { tiles, held, layout, hooks };
        let tiles_here = lattice.as_ref().map_or(0, TileLattice::count);
        let has_particles: Vec<bool> =
            (0..tiles_here).map(|part| order.part(part) != Some(&[])).collect();
        let divided = divide(order);
        let add = |band: Band<'_, N, D>, part: usize| add(band, &divided, part);
        match lattice {
            Some(lattice) => {
                grid.in_windows((lattice, buffers), first_tile, nodes, &has_particles, &add);
            }
            None => grid.in_bands(schedule, nodes, &add),
        }
    }
}

/// The nodes to which tiles add.
struct Sums<'a, N, const D: usize> {
    tiles: &'a Tiles<D>,
    held: &'a Held,
    layout: &'a Layout<D>,
    hooks: NodeHooks<'a, N>,
}

impl<N: Copy + Send + Sync, const D: usize> Sums<'_, N, D> {
    /// The nodes of a segment, the rows of a layer, by their indices here.
    fn of_segment(&self, segment: usize) -> Range<usize> {
        let index = |row: usize| (row - self.layout.first_row) * self.layout.row();
        index(self.tiles.first_row(segment))..index(self.tiles.first_row(segment + 1))
    }

    /// Calls `add(band, part)` for each tile here, which sums in a buffer, and the hooks around it.
    fn in_windows(
        &self,
        (lattice, buffers): (&TileLattice<D>, &TileBuffers<N>),
        first_tile: usize,
        nodes: &mut [N],
        has_particles: &[bool],
        add: &(dyn Fn(Band<'_, N, D>, usize) + Sync),
    ) {
        let Self { held, layout, hooks, .. } = self;
        let row = layout.row();
        let rows = layout.rows_at_once() * row;
        each_chunk(nodes, NODES_AT_ONCE, &|_, nodes| (hooks.before)(nodes));
        let place = (layout.strides, layout.first_row * row);
        let mut sums = TileSums::new(nodes, place, lattice, buffers);
        let fill = |tile: usize, nodes: &mut [N]| {
            let window = lattice.window(tile);
            let (mut strides, mut before) = ([1; D], 0);
            for a in 0..D {
                if a > 0 {
                    strides[a] = strides[a - 1] * window[a - 1].len();
                }
                before += window[a].start * strides[a];
            }
            let (number, nodes_before) = ((first_tile + tile) as u32, before as f64);
            add(Band { nodes, first: 0, tile: number, strides, nodes_before }, tile);
        };
        sums.fill_and_add(hooks.zero, has_particles, &fill, hooks.add);
        // A segment that two processes share is completed by the one whose turn comes last.
        let (lent, borrowed): (Vec<Shared>, Vec<Shared>) =
            held.shared().partition(|shared| shared.is_first_here);
        if let Some(Halo { send, receive, .. }) = hooks.halo {
            for &shared in &lent {
                send(shared, &sums.all()[self.of_segment(shared.segment)]);
            }
            for &shared in &borrowed {
                receive(shared, &mut sums.all()[self.of_segment(shared.segment)]);
            }
            sums.add_rest(hooks.add);
        }
        let mut segments = held.segments();
        for &shared in &lent {
            match shared.is_below {
                true => segments.start += 1,
                false => segments.end -= 1,
            }
        }
        let first = self.of_segment(segments.start).start;
        let end = self.of_segment(segments.end - 1).end;
        each_chunk(&mut nodes[first..end], rows, &|number, nodes| {
            (hooks.after)(nodes, first + number * rows);
        });
        if let Some(Halo { send, receive, finish, .. }) = hooks.halo {
            finish(nodes);
            for &shared in &borrowed {
                send(shared, &nodes[self.of_segment(shared.segment)]);
            }
            for &shared in &lent {
                receive(shared, &mut nodes[self.of_segment(shared.segment)]);
            }
        }
    }

    /// Calls `add(band, part)` for each layer here, which is one tile, and the hooks around it.
    ///
    /// A segment that two processes share belongs to the first band of one of them. That process sends its sums, which the other one adds to as soon as they
    /// have come, and gets the updated nodes back.
    fn in_bands(
        &self,
        schedule: &mut Schedule,
        nodes: &mut [N],
        add: &(dyn Fn(Band<'_, N, D>, usize) + Sync),
    ) {
        let Self { tiles, held, layout, hooks } = self;
        let segments = held.segments();
        let start = |segment: usize| self.of_segment(segment).start;
        let starts = segments.clone().map(start).chain([nodes.len()]).collect();
        let mut bands = ColoredBands::new(nodes, starts, (*held).clone(), schedule);
        let nodes_before = (layout.first_row * layout.row()) as f64;
        let (lent, borrowed): (Vec<Shared>, Vec<Shared>) =
            bands.shared().partition(|shared| shared.is_first_here);
        let returned: Vec<AtomicBool> = borrowed.iter().map(|_| AtomicBool::new(false)).collect();
        // What a band that is done sends at once.
        let send = |Halo { send, is_updated, .. }: &Halo<'_, N>, segment: usize, nodes: &[N]| {
            for shared in lent.iter().filter(|shared| shared.segment == segment) {
                send(*shared, nodes);
            }
            for (shared, is_returned) in borrowed.iter().zip(&returned) {
                let rows = tiles.first_row(segment)..tiles.first_row(segment + 1);
                if shared.segment == segment && is_updated(rows) {
                    send(*shared, nodes);
                    is_returned.store(true, Ordering::Relaxed);
                }
            }
        };
        let pass = |bands: &ColoredBands<'_, N>| {
            on_all_threads(&|thread| {
                loop {
                    for &shared in &borrowed {
                        if let Some(Halo { receive, has_arrived, .. }) = &hooks.halo
                            && bands.is_awaited(shared)
                            && has_arrived(shared)
                        {
                            bands.fill(shared, |nodes| receive(shared, nodes));
                        }
                    }
                    let Some(mut band) = bands.take(thread) else { break };
                    (hooks.before)(band.first_touched().0);
                    let (layer, strides) = (band.segment(), layout.strides);
                    let (nodes, first) = band.elements();
                    let tile = layer as u32;
                    add(
                        Band { nodes, first, tile, strides, nodes_before },
                        layer - held.bands.start,
                    );
                    let (completed, first) = band.completed();
                    if !completed.is_empty() {
                        (hooks.after)(completed, first);
                    }
                    if let Some(halo) = &hooks.halo {
                        band.segments().for_each(|(segment, nodes)| send(halo, segment, nodes));
                    }
                }
            });
        };
        pass(&bands);
        let Some(Halo { send, receive, finish, .. }) = &hooks.halo else { return };
        let filled =
            borrowed.iter().map(|&shared| bands.fill(shared, |nodes| receive(shared, nodes)));
        if filled.fold(false, |any, filled| any | filled) {
            pass(&bands);
        }
        finish(bands.all());
        for (&shared, is_returned) in borrowed.iter().zip(&returned) {
            if !is_returned.load(Ordering::Relaxed) {
                send(shared, bands.of_shared(shared));
            }
        }
        for &shared in &lent {
            receive(shared, bands.of_shared(shared));
        }
    }
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
            bins.sort_as(bins.keys_of(edges.len(), &|p| edges[p]));
            assert!(bins.order.is_whole());
            let mut met = vec![0; edges.len()];
            let count = bins.tiles.layers() * bins.tiles.in_a_layer();
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
            bins.sort_as(bins.keys_of(edges.len(), &|p| edges[p]));
            let row = layout.row();
            let hooks = NodeHooks {
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
            // The first node of each particle, by indices as they are in its band.
            let add = |band: Band<'_, i64, D>, ids: &[u32]| {
                for &p in ids {
                    let first: usize = (0..D)
                        .map(|a| {
                            let place = edges[p as usize][a].floor() as usize + PAD_BELOW;
                            place * band.strides[a]
                        })
                        .sum();
                    band.nodes[first - band.nodes_before as usize - band.first] += 1;
                }
            };
            let mut nodes = vec![9; layout.nodes];
            bins.for_each(&layout, &mut nodes, hooks, &add);
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
            bins.for_each_mut(&layout, &mut seen, hooks, divide, &|band, divided, part| {
                add(band, &divided[part]);
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
