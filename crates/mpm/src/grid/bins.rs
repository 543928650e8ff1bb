//! Bins of particles: P2G in parallel with sums in a fixed order.
//!
//! A row is all nodes that share an index along the last axis. Bins divide the rows: each bin owns a fixed number of them,
//! which depends on the dimension alone. Each particle belongs to one bin. A bin writes to its band: its own rows and the rows
//! of the next bin. Only the bands of neighbours overlap, and a two-colour schedule keeps those apart in time
//! ([`coloring`](mmsmith_threads::coloring)). Particles of a bin come in a fixed order. No sum depends on the number of
//! threads. The grid update of a row follows its last contribution, while the row lies in the cache.
//!
//! A band has more rows than a bin and its stencils need. Particles may thus drift for some steps before the next sort. The
//! order of the last sort decides the order of all sums. It follows from the sub-bin that each particle was in then, which belongs
//! to the state of a run: a run that continues to the same bits restores it.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use mmsmith_ranks::Ranks;
use rayon::prelude::*;

use crate::grid::{BIN_ROWS, Layout, PAD_BELOW};
use mmsmith_threads::coloring::{ColoredBands, Held, Schedule, Shared, count};
use mmsmith_threads::disjoint::Partition;
use mmsmith_threads::on_all_threads;

/// Rows in a bin, in two and three dimensions.
const BIN_HEIGHT: usize = 8;

/// Rows by which a particle may sink below its bin before the next sort.
const SLACK: usize = 3;

/// In three dimensions a bin is divided into sub-bins of this many lines of nodes along axis 0: the nodes that a sub-bin
/// reaches stay in the cache. In fewer dimensions a bin is one sub-bin.
const SUB_BIN_LINES: usize = 8;

/// The rows of each bin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BinRows {
    /// Rows in a bin; the last one has the remainder as well.
    height: usize,
    /// Number of bins.
    bins: usize,
}

impl BinRows {
    pub(crate) fn new<const D: usize>(layout: &Layout<D>) -> Self {
        // A row is one node in 1D; bins below some hundred particles would cost more to hand out than to compute.
        let height = if D == 1 { BIN_ROWS } else { BIN_HEIGHT };
        Self { height, bins: count(layout.dims[D - 1], height) }
    }

    /// The bin of a particle at a sort, by the first row of its stencil.
    pub(crate) fn bin_of(self, row: usize) -> usize {
        (row.saturating_sub(SLACK) / self.height).min(self.bins - 1)
    }

    /// Number of bins.
    pub(crate) fn count(self) -> usize {
        self.bins
    }

    /// The first row of a bin's band.
    pub(crate) fn first_row(self, bin: usize) -> usize {
        bin * self.height
    }

    /// The rows of the bands of these bins, on a grid of so many.
    pub(crate) fn rows_of(self, held: &Held, all: usize) -> Range<usize> {
        let Range { start, end } = held.segments();
        start * self.height..if end < self.bins { end * self.height } else { all }
    }

    /// Range of the lower edge of a particle's box along the last axis within which the particle stays in `bin`, for a
    /// stencil of `width` rows: from the first value on and below the second, in cells from the lower corner of the grid.
    #[inline(always)]
    pub(crate) fn range(self, bin: u32, width: usize) -> (f64, f64) {
        let Self { height, bins } = self;
        let first = f64::from(bin) * height as f64 - PAD_BELOW as f64;
        // Bands that reach the end of the grid hold all stencils up to there.
        let end = if bin as usize + 2 < bins {
            first + (2 * height + 1 - width) as f64
        } else {
            f64::INFINITY
        };
        (first, end)
    }
}

/// Particles sorted by bin, within each bin by sub-bin, within each sub-bin by id.
///
/// They are not sorted further: neighbours mostly have successive ids, their data then lie side by side in memory, and the
/// kernels use them in place.
pub(crate) struct Bins {
    rows: BinRows,
    /// The bins that this process holds.
    held: Held,
    /// The processes that hold all of them, where those are several.
    ranks: Option<Arc<dyn Ranks>>,
    /// Bin of every particle, among those of the whole grid.
    bin_of: Vec<u32>,
    /// Particle numbers, bin after bin.
    order: Partition,
    /// Buffer of the two-colour schedule.
    schedule: Schedule,
    /// Sub-bins in a bin.
    sub_bins: usize,
    /// Buffer of the sort: particles in each sub-bin, later the place of the next of them.
    counts: Vec<u32>,
    /// Sub-bin of every particle at the last sort, among those of the whole grid.
    keys: Vec<u32>,
}

/// Adds the particles of one bin to the nodes: `add(band, first, ids)`, with the band of the node array, the index of its first
/// node, and the particles in order.
pub(crate) type AddToBand<'a, N> = dyn Fn(&mut [N], usize, &[u32]) + Sync + 'a;

/// As [`AddToBand`] for kernels that change particles: `add(band, first, bin, divided, part)`, with the bin's number, the particles divided
/// among bins, and the part that is this bin's.
pub(crate) type UpdateAndAdd<'a, N, P> = dyn Fn(&mut [N], usize, u32, &P, usize) + Sync + 'a;

/// Calls for each node, some rows at a time: before the first contribution to it and after the last one.
#[derive(Clone, Copy)]
pub(crate) struct NodeHooks<'a, N> {
    /// Before the first contribution.
    pub(crate) before: &'a (dyn Fn(&mut [N]) + Sync),
    /// After the last contribution; the second argument is the index of the first node.
    pub(crate) after: &'a (dyn Fn(&mut [N], usize) + Sync),
    /// The exchange with processes that hold other bins, where there are such.
    pub(crate) halo: Option<Halo<'a, N>>,
}

/// Messages with the processes of the bands below and above.
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

impl Bins {
    /// Allocates for `particles` particles on the grid; `sort_as` has to follow.
    pub(crate) fn new<const D: usize>(layout: &Layout<D>, particles: usize) -> Self {
        let rows = BinRows::new(layout);
        let bins = rows.bins;
        let sub_bins = if D == 3 { layout.dims[1].div_ceil(SUB_BIN_LINES) } else { 1 };
        Self {
            rows,
            held: Held::whole(bins),
            ranks: None,
            bin_of: vec![0; particles],
            order: Partition::new(particles, bins),
            schedule: Schedule::default(),
            sub_bins,
            counts: vec![0; bins * sub_bins + 1],
            keys: vec![0; particles],
        }
    }

    /// The rows of each bin.
    pub(crate) fn rows(&self) -> BinRows {
        self.rows
    }

    /// Makes room for so many particles in the bins `held`; `sort_as` has to follow.
    pub(crate) fn hold(&mut self, held: Held, particles: usize) {
        self.counts.resize(held.bands.len() * self.sub_bins + 1, 0);
        self.order = Partition::new(particles, held.bands.len());
        self.held = held;
    }

    /// Shares the bins out among processes; [`hold`](Self::hold) has to follow.
    pub(crate) fn share_out(&mut self, ranks: Arc<dyn Ranks>) {
        self.ranks = Some(ranks);
    }

    /// The processes that hold all bins, where those are several.
    pub(crate) fn ranks(&self) -> Option<Arc<dyn Ranks>> {
        self.ranks.clone()
    }

    /// Whether other processes hold rows below and above those that this one holds.
    pub(crate) fn are_others(&self) -> [bool; 2] {
        let segments = self.held.segments();
        [segments.start > 0, segments.end < self.held.all]
    }

    /// Bin of every particle.
    pub(crate) fn bin_of(&self) -> &[u32] {
        &self.bin_of
    }

    /// The result of the last sort: the sub-bin of every particle.
    pub(crate) fn keys(&self) -> &[u32] {
        &self.keys
    }

    /// Whether the grid has this sub-bin.
    pub(crate) fn has_key(&self, key: u32) -> bool {
        self.bin_of_key(key) < self.rows.bins
    }

    /// The bin of a sub-bin.
    pub(crate) fn bin_of_key(&self, key: u32) -> usize {
        key as usize / self.sub_bins
    }

    /// The sub-bin of each of `count` particles, by the first node of its stencil, in the numbers of the whole grid.
    pub(crate) fn keys_of<const D: usize>(
        &self,
        layout: &Layout<D>,
        count: usize,
        first_node: &(dyn Fn(usize) -> usize + Sync),
    ) -> Vec<u32> {
        let (rows, row, line) = (self.rows, layout.row(), layout.dims[0]);
        let key = |p: usize| {
            let node = first_node(p);
            let sub_bin = if D == 3 { node % row / line / SUB_BIN_LINES } else { 0 };
            (rows.bin_of(node / row) * self.sub_bins + sub_bin) as u32
        };
        (0..count).into_par_iter().map(key).collect()
    }

    /// Sorts all particles by their sub-bins, of bins that are held here.
    pub(crate) fn sort_as(&mut self, keys: Vec<u32>) {
        let per_bin = self.sub_bins as u32;
        self.bin_of.clear();
        self.bin_of.extend(keys.iter().map(|key| key / per_bin));
        self.keys = keys;
        self.arrange();
    }

    /// Brings the particles into the order of their sub-bins.
    fn arrange(&mut self) {
        let Self { sub_bins, ref held, .. } = *self;
        let first = held.bands.start * sub_bins;
        self.counts.fill(0);
        for &key in &self.keys {
            self.counts[key as usize - first + 1] += 1;
        }
        for sub_bin in 1..self.counts.len() {
            self.counts[sub_bin] += self.counts[sub_bin - 1];
        }
        let (order, starts) = self.order.arrange();
        for (start, first) in starts.iter_mut().zip(self.counts.iter().step_by(sub_bins)) {
            *start = *first as usize;
        }
        for (p, &key) in self.keys.iter().enumerate() {
            let place = &mut self.counts[key as usize - first];
            order[*place as usize] = p as u32;
            *place += 1;
        }
    }

    /// Calls `add` for every bin here, in parallel where bands do not overlap.
    pub(crate) fn for_each<N: Send, const D: usize>(
        &mut self,
        layout: &Layout<D>,
        nodes: &mut [N],
        hooks: NodeHooks<'_, N>,
        add: &AddToBand<'_, N>,
    ) {
        let Self { rows, held, order, schedule, .. } = self;
        let start = held.bands.start;
        let bands = ColoredBands::new(nodes, rows.height * layout.row(), held.clone(), schedule);
        for_each_band(*rows, bands, hooks, &|band, first, bin| {
            if let Some(particles) = order.part(bin - start) {
                add(band, first, particles);
            }
        });
    }

    /// As [`for_each`](Self::for_each) for kernels that change the bin's particles: `divide(partition)` divides them among bins, and
    /// `add(band, first, bin, divided, part)` finds those of the bin there.
    pub(crate) fn for_each_mut<'a, N: Send, P: Sync, const D: usize>(
        &'a mut self,
        layout: &Layout<D>,
        nodes: &mut [N],
        hooks: NodeHooks<'_, N>,
        divide: impl FnOnce(&'a mut Partition) -> P,
        add: &UpdateAndAdd<'_, N, P>,
    ) {
        let Self { rows, held, order, schedule, .. } = self;
        let start = held.bands.start;
        let divided = divide(order);
        let bands = ColoredBands::new(nodes, rows.height * layout.row(), held.clone(), schedule);
        for_each_band(*rows, bands, hooks, &|band, first, bin| {
            add(band, first, bin as u32, &divided, bin - start);
        });
    }
}

/// Calls `add(band, first, bin)` for each bin here, and the hooks around it.
///
/// A segment that two processes share belongs to the first band of one of them. That process sends its sums, which the other one adds to as soon as they
/// have come, and gets the updated nodes back.
fn for_each_band<N: Send>(
    rows: BinRows,
    mut bands: ColoredBands<'_, N>,
    hooks: NodeHooks<'_, N>,
    add: &(dyn Fn(&mut [N], usize, usize) + Sync),
) {
    let (lent, borrowed): (Vec<Shared>, Vec<Shared>) =
        bands.shared().partition(|shared| shared.is_first_here);
    let returned: Vec<AtomicBool> = borrowed.iter().map(|_| AtomicBool::new(false)).collect();
    // What a band that is done sends at once.
    let send = |Halo { send, is_updated, .. }: &Halo<'_, N>, segment: usize, nodes: &[N]| {
        for shared in lent.iter().filter(|shared| shared.segment == segment) {
            send(*shared, nodes);
        }
        for (shared, is_returned) in borrowed.iter().zip(&returned) {
            let rows = rows.first_row(segment)..rows.first_row(segment + 1);
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
                let bin = band.segment();
                let (elements, first) = band.elements();
                add(elements, first, bin);
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
    let filled = borrowed.iter().map(|&shared| bands.fill(shared, |nodes| receive(shared, nodes)));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Grid;
    use nalgebra::SVector;

    #[test]
    fn a_bin_keeps_particles_whose_stencils_lie_in_its_band_and_no_others() {
        for height in [8, BIN_ROWS] {
            let cut = BinRows { height, bins: 10 };
            for width in [2, 3, 6] {
                for bin in [0, 1, 2, 7] {
                    let (first, end) = cut.range(bin, width);
                    // Rows of the stencil from the bin's first row on; a band has those of two bins.
                    let rows = |edge: f64| {
                        let row = edge.floor() + PAD_BELOW as f64 - (bin as usize * height) as f64;
                        (row, row + width as f64)
                    };
                    let fits =
                        |edge: f64| rows(edge).0 >= 0.0 && rows(edge).1 <= 2.0 * height as f64;
                    for (edge, is_kept) in [
                        (first, true),
                        (first.next_down(), false),
                        (end, false),
                        (end.next_down(), true),
                        (f64::midpoint(first, end), true),
                    ] {
                        assert_eq!(fits(edge), is_kept, "{height} {width} {bin}");
                    }
                }
                // The last two bands reach to the end of the grid.
                for bin in [8, 9] {
                    let first = (bin as usize * height) as f64 - PAD_BELOW as f64;
                    assert_eq!(cut.range(bin, width), (first, f64::INFINITY));
                }
            }
        }
    }

    /// Nodes at which stencils may begin, by a lattice of particles and with some layers left out.
    fn first_nodes<const D: usize>(layout: &Layout<D>) -> Vec<usize> {
        let row = layout.row();
        let last = layout.dims[D - 1] - 6;
        // Numbered from the far end on, so that numbers and places differ in order.
        (0..last * row).rev().filter(|node| node % 3 != 1).collect()
    }

    #[test]
    fn particles_are_sorted_into_bins_with_room_to_drift_both_ways() {
        fn check<const D: usize>(cells: [usize; D]) {
            let grid =
                Grid { lower: SVector::zeros(), spacing: 1.0, cells, walls: [[false; 2]; D] };
            let layout = Layout::new(&grid, 8).unwrap();
            let nodes = first_nodes(&layout);
            let mut bins = Bins::new(&layout, nodes.len());
            assert!(!bins.order.is_whole());
            bins.sort_as(bins.keys_of(&layout, nodes.len(), &|p| nodes[p]));
            assert!(bins.order.is_whole());
            let mut met = vec![0; nodes.len()];
            let count = bins.rows.bins;
            for bin in 0..count {
                let particles = bins.order.part(bin).unwrap();
                let (first, end) = bins.rows.range(bin as u32, 3);
                let sub_bin = |p: u32| match D {
                    3 => nodes[p as usize] / layout.dims[0] % layout.dims[1] / SUB_BIN_LINES,
                    _ => 0,
                };
                let place = |&p: &u32| (sub_bin(p), p);
                assert!(particles.is_sorted_by_key(place), "by sub-bin, then by id");
                for &p in particles {
                    met[p as usize] += 1;
                    assert_eq!(bins.bin_of()[p as usize] as usize, bin);
                    let edge = (nodes[p as usize] / layout.row()) as f64 - PAD_BELOW as f64;
                    // At the lower end of the grid particles cannot drift further.
                    assert!(bin == 0 || edge - SLACK as f64 >= first, "{edge} {first}");
                    assert!(edge + SLACK as f64 + 1.0 <= end, "{edge} {end}");
                }
            }
            assert!(bins.order.part(count).is_none());
            assert!(met.iter().all(|&times| times == 1));
        }
        check([700]);
        check([5, 40]);
        check([4, 30, 25]);
    }

    /// Each bin adds to every node of its band, which is its own rows and as many above; the last one's, and the band of the
    /// one before, end with the grid.
    #[test]
    fn bands_are_the_rows_of_a_bin_and_of_the_next() {
        fn check<const D: usize>(cells: [usize; D]) {
            let grid =
                Grid { lower: SVector::zeros(), spacing: 1.0, cells, walls: [[false; 2]; D] };
            let layout = Layout::new(&grid, 8).unwrap();
            let mut bins = Bins::new(&layout, 0);
            bins.sort_as(Vec::new());
            let (BinRows { height, bins: count }, row) = (bins.rows, layout.row());
            assert_eq!(count, (layout.dims[D - 1] / height).max(1));
            let mut nodes = vec![9; layout.nodes];
            let hooks = NodeHooks {
                before: &|nodes: &mut [i32]| nodes.fill(0),
                after: &|nodes: &mut [i32], first| {
                    assert_eq!(first % row, 0);
                    nodes.iter_mut().for_each(|node| *node += 100);
                },
                halo: None,
            };
            bins.for_each(&layout, &mut nodes, hooks, &|band, first, _| {
                assert_eq!(first % (height * row), 0);
                assert!(band.len() == 2 * height * row || first + band.len() == layout.nodes);
                band.iter_mut().for_each(|node| *node += 1);
            });
            for (node, &sum) in nodes.iter().enumerate() {
                // The lowest bin's rows belong to no other one.
                let lowest = count == 1 || node < height * row;
                assert_eq!(sum, if lowest { 101 } else { 102 }, "{node}");
            }
            let mut seen = vec![0; layout.nodes];
            let add = |band: &mut [i32], first: usize, bin: u32, (): &(), _: usize| {
                assert_eq!(first, bin as usize * height * row);
                assert!((bin as usize) < count);
                band.iter_mut().for_each(|node| *node += 1);
            };
            bins.for_each_mut(&layout, &mut seen, hooks, |_| (), &add);
            assert_eq!(seen, nodes);
        }
        check([1100]);
        check([5]);
        check([5, 40]);
        check([5, 1]);
        check([4, 3, 25]);
    }
}
