//! Sums of tiles into one array, in an order that is fixed wherever the windows of tiles overlap.
//!
//! The array is a lattice of elements in some dimensions, axis 0 fastest. Tiles are pieces of it: along each axis there are some pieces, and
//! the window of a tile reaches beyond its piece. A thread fills a buffer of the size of a tile's window whenever it has time, which waits for no
//! other tile. The buffer is added to the array as soon as those tiles are added whose windows overlap with it and whose
//! turn comes before. Turns go by colours: pieces have colours along each axis, so that windows of tiles of one colour never overlap; the last
//! axis decides first. The safety argument for the lines of the array that threads change is in this file.
//!
//! A process may hold some successive layers of tiles, pieces along the last axis, whose neighbours other processes hold. The sums of a
//! neighbour whose turn comes first are put in place between [`TileSums::fill_and_add`] and [`TileSums::add_rest`].

#![allow(unsafe_code, reason = "lines of one array, changed by several threads")]

use std::marker::PhantomData;
use std::ops::Range;
use std::slice;
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::coloring::Held;
use crate::on_all_threads;

/// The tiles of an array: pieces along each axis, whose windows are ranges of elements.
#[derive(Clone, Debug)]
pub struct TileLattice<const D: usize> {
    /// The windows of the pieces along each axis; of the last axis all, whoever holds them.
    windows: [Vec<Range<usize>>; D],
    /// How far along each axis pieces lie apart whose windows may overlap.
    reach: [usize; D],
    /// The layers of tiles here.
    held: Held,
    /// For each tile here the number of tiles here whose turn comes before and that it overlaps with.
    predecessors: Vec<u16>,
}

impl<const D: usize> TileLattice<D> {
    /// The lattice of these windows along each axis, and the layers `held` here along the last axis.
    ///
    /// # Panics
    ///
    /// Where windows along an axis do not ascend, or those along the last axis overlap with more than their neighbours.
    pub fn new(windows: [Vec<Range<usize>>; D], held: Held) -> Self {
        // What the unsafe code relies on.
        let reach = windows.each_ref().map(|windows| {
            assert!(windows.windows(2).all(|w| w[0].start <= w[1].start && w[0].end <= w[1].end));
            let apart = |by: usize| {
                windows.iter().zip(windows.iter().skip(by)).all(|(a, b)| a.end <= b.start)
            };
            (1..=windows.len()).find(|&by| apart(by)).unwrap_or(1).max(1) - 1
        });
        assert!(reach[D - 1] <= 1 && held.all == windows[D - 1].len());
        let mut own = Self { windows, reach, held, predecessors: Vec::new() };
        own.predecessors = (0..own.count())
            .map(|tile| {
                own.neighbours(tile).filter(|&other| own.precedes(other, tile)).count() as u16
            })
            .collect();
        own
    }

    /// Number of tiles here.
    pub fn count(&self) -> usize {
        self.held.bands.len() * self.in_a_layer()
    }

    /// Number of tiles in a layer.
    fn in_a_layer(&self) -> usize {
        self.windows[..D - 1].iter().map(Vec::len).product()
    }

    /// The pieces of a tile along each axis; layers count from the first of all.
    fn pieces(&self, tile: usize) -> [usize; D] {
        let mut rest = tile + self.held.bands.start * self.in_a_layer();
        std::array::from_fn(|a| {
            let count = self.windows[a].len();
            let piece = rest % count;
            rest /= count;
            piece
        })
    }

    /// The window of a tile here along each axis.
    pub fn window(&self, tile: usize) -> [Range<usize>; D] {
        let pieces = self.pieces(tile);
        std::array::from_fn(|a| self.windows[a][pieces[a]].clone())
    }

    /// Number of elements in the window of a tile here.
    pub fn elements(&self, tile: usize) -> usize {
        self.window(tile).into_iter().map(|window| window.len()).product()
    }

    /// Where a tile stands in the order of turns, the last axis first.
    fn turn(&self, tile: usize) -> [usize; D] {
        let pieces = self.pieces(tile);
        std::array::from_fn(|place| {
            let a = D - 1 - place;
            match place {
                // As bands take turns, so that processes agree.
                0 => usize::from((self.held.all + pieces[a]).is_multiple_of(2)),
                _ => pieces[a] % (self.reach[a] + 1),
            }
        })
    }

    fn precedes(&self, tile: usize, other: usize) -> bool {
        self.turn(tile) < self.turn(other)
    }

    /// The other tiles here whose windows may overlap with that of a tile.
    fn neighbours(&self, tile: usize) -> impl Iterator<Item = usize> + '_ {
        let pieces = self.pieces(tile);
        let around: [Range<usize>; D] = std::array::from_fn(|a| {
            let all = if a == D - 1 { self.held.bands.clone() } else { 0..self.windows[a].len() };
            let (first, end) =
                (pieces[a].saturating_sub(self.reach[a]), pieces[a] + self.reach[a] + 1);
            first.max(all.start)..end.min(all.end)
        });
        let count: usize = around.iter().map(ExactSizeIterator::len).product();
        let found = (0..count).map(move |number| {
            let (mut rest, mut other, mut stride) = (number, 0, 1);
            for a in 0..D {
                let first = if a == D - 1 { self.held.bands.start } else { 0 };
                other += (around[a].start - first + rest % around[a].len()) * stride;
                rest /= around[a].len();
                stride *= self.windows[a].len();
            }
            other
        });
        found.filter(move |&other| other != tile)
    }

    /// Whether a tile lies in a layer that adds to the sums of a neighbouring process.
    fn waits_for_process(&self, tile: usize) -> bool {
        let layer = self.pieces(tile)[D - 1];
        self.held.shared().any(|shared| {
            let own = if shared.is_below { shared.segment } else { shared.segment - 1 };
            !shared.is_first_here && layer == own
        })
    }

    /// The time of the longest chain of tasks each of which waits for the one before, if it takes the time `fill(tile)` to fill the buffer of
    /// a tile here, and `add(tile)` to add it: what a pass takes at least, on any number of threads.
    pub fn longest(&self, fill: &dyn Fn(usize) -> f64, add: &dyn Fn(usize) -> f64) -> f64 {
        let mut ends = vec![0.0_f64; self.count()];
        let mut order: Vec<usize> = (0..self.count()).collect();
        order.sort_by_cached_key(|&tile| self.turn(tile));
        for tile in order {
            let before = self.neighbours(tile).filter(|&other| self.precedes(other, tile));
            ends[tile] = before.map(|other| ends[other]).fold(fill(tile), f64::max) + add(tile);
        }
        ends.into_iter().fold(0.0, f64::max)
    }
}

/// How far the tiles of a pass are.
#[derive(Debug)]
struct Progress<N> {
    /// For each tile the tiles, its own buffer, and the process that it waits for.
    pending: Vec<u16>,
    /// Whether a thread has taken a tile to fill its buffer.
    taken: Vec<bool>,
    /// The filled buffers that wait for their turn; none for a tile without sums.
    filled: Vec<Option<Vec<N>>>,
    /// Tiles whose turn it is.
    ready: Vec<usize>,
}

/// Buffers that no tile uses at present, which outlive a pass; all their elements are zero.
#[derive(Debug)]
pub struct TileBuffers<N>(Mutex<Vec<Vec<N>>>);

impl<N> Default for TileBuffers<N> {
    fn default() -> Self {
        Self(Mutex::new(Vec::new()))
    }
}

impl<N: Copy> TileBuffers<N> {
    fn free(&self) -> MutexGuard<'_, Vec<Vec<N>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A buffer of `elements` elements or more.
    fn take(&self, elements: usize, zero: N) -> Vec<N> {
        let mut buffer = self.free().pop().unwrap_or_default();
        if buffer.len() < elements {
            buffer.resize(elements, zero);
        }
        buffer
    }
}

/// A pass over the tiles of an array.
pub struct TileSums<'a, N, const D: usize> {
    lattice: &'a TileLattice<D>,
    /// The array, of which this process may hold some layers of elements alone.
    first: *mut N,
    length: usize,
    strides: [usize; D],
    /// Elements of the whole array before the first here.
    before: usize,
    buffers: &'a TileBuffers<N>,
    progress: Mutex<Progress<N>>,
    borrowed: PhantomData<&'a mut [N]>,
}

// SAFETY: threads reach the array through a shared reference, line by line, and no two lines that are held overlap (see `add`); lines are
// exclusive slices, for which `Send` is the requirement.
unsafe impl<N: Send, const D: usize> Sync for TileSums<'_, N, D> {}

/// Fills the buffer of a tile here, the elements of its window, which come in zero.
pub type FillTile<'a, N> = dyn Fn(usize, &mut [N]) + Sync + 'a;

/// Adds elements of a buffer to those of the array, and leaves zeros in the buffer.
pub type AddLine<'a, N> = dyn Fn(&mut [N], &mut [N]) + Sync + 'a;

impl<'a, N: Copy + Send, const D: usize> TileSums<'a, N, D> {
    /// A pass over an array with these strides, of which `array` are the elements from element `before` on.
    ///
    /// # Panics
    ///
    /// Where `array` does not have the elements of all windows here.
    pub fn new(
        array: &'a mut [N],
        (strides, before): ([usize; D], usize),
        lattice: &'a TileLattice<D>,
        buffers: &'a TileBuffers<N>,
    ) -> Self {
        // What the unsafe code relies on: lines lie in the array, and elements of distinct places along an axis are distinct.
        assert_eq!(strides[0], 1);
        for a in 0..D {
            let end = lattice.windows[a].last().map_or(0, |window| window.end);
            assert!(a + 1 == D || end * strides[a] <= strides[a + 1]);
        }
        let layers = lattice.held.bands.clone();
        let of_layer = |layer: usize| &lattice.windows[D - 1][layer];
        if let Some(last) = layers.clone().next_back() {
            assert!(before <= of_layer(layers.start).start * strides[D - 1]);
            assert!(of_layer(last).end * strides[D - 1] <= before + array.len());
        }
        let count = lattice.count();
        let pending = (0..count)
            .map(|tile| lattice.predecessors[tile] + 1 + u16::from(lattice.waits_for_process(tile)))
            .collect();
        let progress = Progress {
            pending,
            taken: vec![false; count],
            filled: (0..count).map(|_| None).collect(),
            ready: Vec::new(),
        };
        Self {
            lattice,
            first: array.as_mut_ptr(),
            length: array.len(),
            strides,
            before,
            buffers,
            progress: Mutex::new(progress),
            borrowed: PhantomData,
        }
    }

    /// All elements here, between passes.
    pub fn all(&mut self) -> &mut [N] {
        // SAFETY: the array is borrowed for 'a, and lines that threads hold borrow `self`, which is exclusive here.
        unsafe { slice::from_raw_parts_mut(self.first, self.length) }
    }

    fn progress(&self) -> MutexGuard<'_, Progress<N>> {
        self.progress.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Fills the buffers of the tiles that have sums, and adds those that wait for no other process.
    pub fn fill_and_add(
        &mut self,
        zero: N,
        has_sums: &[bool],
        fill: &FillTile<'_, N>,
        add: &AddLine<'_, N>,
    ) where
        N: Sync,
    {
        let own = &*self;
        on_all_threads(&|(part, parts)| {
            let mut next = own.lattice.count() * part / parts.max(1);
            loop {
                own.add_ready(add);
                let Some(tile) = own.take(&mut next) else { break };
                let filled = has_sums[tile].then(|| {
                    let elements = own.lattice.elements(tile);
                    let mut buffer = own.buffers.take(elements, zero);
                    fill(tile, &mut buffer[..elements]);
                    buffer
                });
                let mut progress = own.progress();
                progress.filled[tile] = filled;
                progress.count_down(tile);
            }
        });
    }

    /// Adds the tiles that wait for other processes, whose sums are in place.
    pub fn add_rest(&mut self, add: &AddLine<'_, N>)
    where
        N: Sync,
    {
        let own = &*self;
        let mut progress = own.progress();
        for tile in (0..own.lattice.count()).filter(|&tile| own.lattice.waits_for_process(tile)) {
            progress.count_down(tile);
        }
        drop(progress);
        on_all_threads(&|_| own.add_ready(add));
    }

    /// The first tile from `next` on that no thread has taken.
    fn take(&self, next: &mut usize) -> Option<usize> {
        let mut progress = self.progress();
        let count = progress.taken.len();
        for step in 0..count {
            let tile = (*next + step) % count;
            if !progress.taken[tile] {
                progress.taken[tile] = true;
                *next = tile + 1;
                return Some(tile);
            }
        }
        None
    }

    /// Adds tiles as long as it is the turn of one.
    fn add_ready(&self, add: &AddLine<'_, N>) {
        loop {
            let mut progress = self.progress();
            let Some(tile) = progress.ready.pop() else { return };
            let filled = progress.filled[tile].take();
            drop(progress);
            if let Some(mut buffer) = filled {
                self.add(tile, &mut buffer, add);
                self.buffers.free().push(buffer);
            }
            let neighbours = self.lattice.neighbours(tile);
            let after: Vec<usize> =
                neighbours.filter(|&other| self.lattice.precedes(tile, other)).collect();
            let mut progress = self.progress();
            after.into_iter().for_each(|other| progress.count_down(other));
        }
    }

    /// Adds the buffer of a tile to the array, line by line along axis 0.
    fn add(&self, tile: usize, buffer: &mut [N], add: &AddLine<'_, N>) {
        let window = self.lattice.window(tile);
        let buffer = &mut buffer[..self.lattice.elements(tile)];
        for (line, values) in buffer.chunks_exact_mut(window[0].len()).enumerate() {
            let (mut rest, mut place) = (line, window[0].start);
            for a in 1..D {
                place += (window[a].start + rest % window[a].len()) * self.strides[a];
                rest /= window[a].len();
            }
            let place = place - self.before;
            // What the unsafe code relies on.
            assert!(place + values.len() <= self.length);
            // SAFETY: the line lies in the array, which is borrowed for 'a. It is part of the window of this tile. A tile is added once, by
            // the thread that took it from `ready`, where it is put when all tiles before it with overlapping windows are added
            // (`pending`). Tiles of the same turn do not overlap: along some axis their pieces are a multiple of `reach + 1` apart.
            // Of two tiles with overlapping windows one comes before the other, as their pieces lie within `reach` along each axis
            // (`neighbours`) and their turns differ. So no two lines that threads hold at the same time overlap. Writes of one
            // thread are visible to the next: both pass through the mutex.
            let elements =
                unsafe { slice::from_raw_parts_mut(self.first.add(place), values.len()) };
            add(elements, values);
        }
    }
}

impl<N> Progress<N> {
    /// A tile has one thing less to wait for.
    fn count_down(&mut self, tile: usize) {
        self.pending[tile] -= 1;
        if self.pending[tile] == 0 {
            self.ready.push(tile);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Windows that reach by these numbers beyond pieces of a length.
    fn windows(pieces: usize, length: usize, below: usize, above: usize) -> Vec<Range<usize>> {
        (0..pieces)
            .map(|piece| {
                let first = piece * length;
                first..below + (piece + 1) * length + above
            })
            .collect()
    }

    /// The sums of the whole lattice: each tile takes an element from what it was, so that the order shows.
    fn changed(lattice: &TileLattice<3>, dims: [usize; 3], threads: usize) -> Vec<u64> {
        let strides = [1, dims[0], dims[0] * dims[1]];
        let mut array = vec![7; dims.iter().product()];
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let buffers = TileBuffers::default();
        let has_sums: Vec<bool> = (0..lattice.count()).map(has_sums).collect();
        let fill = |tile: usize, buffer: &mut [u64]| {
            assert!(buffer.iter().all(|&element| element == 0));
            buffer.fill(tile as u64 + 1);
        };
        // Buffers are used a second time.
        for before in [3, 7] {
            array.fill(before);
            pool.install(|| {
                let mut sums = TileSums::new(&mut array, (strides, 0), lattice, &buffers);
                sums.fill_and_add(0, &has_sums, &fill, &add);
                sums.add_rest(&add);
                assert!(sums.progress().filled.iter().all(Option::is_none));
                assert!(sums.progress().pending.iter().all(|&pending| pending == 0));
            });
        }
        array
    }

    /// Some tiles have no sums.
    fn has_sums(tile: usize) -> bool {
        tile % 5 != 3
    }

    fn add(elements: &mut [u64], values: &mut [u64]) {
        for (element, value) in elements.iter_mut().zip(values) {
            *element = element.wrapping_mul(1_000_003).wrapping_add(*value);
            *value = 0;
        }
    }

    /// Sums by hand: tile after tile in the order of turns.
    fn by_turns(lattice: &TileLattice<3>, dims: [usize; 3]) -> Vec<u64> {
        let mut array = vec![7_u64; dims.iter().product()];
        let mut order: Vec<usize> = (0..lattice.count()).collect();
        order.sort_by_key(|&tile| lattice.turn(tile));
        for tile in order.into_iter().filter(|&tile| has_sums(tile)) {
            let [x, y, z] = lattice.window(tile);
            for (z, y) in z.flat_map(|z| y.clone().map(move |y| (z, y))) {
                for x in x.clone() {
                    let element = &mut array[x + dims[0] * (y + dims[1] * z)];
                    *element = element.wrapping_mul(1_000_003).wrapping_add(tile as u64 + 1);
                }
            }
        }
        array
    }

    proptest! {
        /// Run under Miri too: `cargo +nightly miri test -p mmsmith-threads windows`.
        #[test]
        fn threads_add_tiles_in_the_order_of_their_turns(
            pieces in prop::array::uniform3(1..5_usize),
            length in prop::array::uniform2(1..4_usize),
            reach in prop::array::uniform2(0..3_usize),
        ) {
            let dims: [usize; 3] = [
                reach[0] + pieces[0] * length[0] + reach[1],
                reach[1] + pieces[1] * length[1] + reach[0],
                2 + 4 * pieces[2] + 2,
            ];
            let lattice = TileLattice::new(
                [
                    windows(pieces[0], length[0], reach[0], reach[1]),
                    windows(pieces[1], length[1], reach[1], reach[0]),
                    windows(pieces[2], 4, 2, 2),
                ],
                Held::whole(pieces[2]),
            );
            let expected = by_turns(&lattice, dims);
            for threads in [1, 2, 3] {
                prop_assert_eq!(&changed(&lattice, dims, threads), &expected);
            }
            prop_assert_eq!(lattice.count(), pieces.iter().product::<usize>());
            let colours = (0..3).map(|a| pieces[a].min(lattice.reach[a] + 1)).product::<usize>();
            prop_assert!(lattice.longest(&|_| 0.0, &|_| 1.0) <= colours as f64);
            prop_assert_eq!(lattice.longest(&|_| 2.0, &|_| 0.0), 2.0);
        }
    }

    /// Two processes, of which one has the sums of the other put in place.
    #[test]
    fn layers_of_two_processes_give_the_sums_of_one() {
        let of_axes = || [windows(3, 2, 1, 1), windows(4, 2, 2, 2), windows(5, 4, 2, 2)];
        let dims = [8, 12, 24];
        let (plane, strides) = (96, [1, 8, 96]);
        let whole = TileLattice::new(of_axes(), Held::whole(5));
        let expected = by_turns(&whole, dims);
        for cut in 1..5 {
            let part = |bands| TileLattice::new(of_axes(), Held { bands, all: 5 });
            let parts = [part(0..cut), part(cut..5)];
            let shared = 4 * cut..4 * cut + 4;
            let first = usize::from(parts[1].held.shared().all(|shared| shared.is_first_here));
            let mut sums = vec![7; expected.len()];
            for own in [first, 1 - first] {
                // The layers of the other one that do not overlap are left out below.
                let before = if own == 0 { 0 } else { shared.start * plane };
                let end = if own == 0 { shared.end * plane } else { expected.len() };
                let offset = if own == 0 { 0 } else { cut * 12 };
                let fill =
                    |tile: usize, buffer: &mut [u64]| buffer.fill((tile + offset) as u64 + 1);
                let tiles = offset..offset + parts[own].count();
                let has_sums: Vec<bool> = tiles.map(has_sums).collect();
                let mut array = vec![7; end - before];
                let (buffers, place) = (TileBuffers::default(), (strides, before));
                let mut pass = TileSums::new(&mut array, place, &parts[own], &buffers);
                pass.fill_and_add(0, &has_sums, &fill, &add);
                if own != first {
                    let place = shared.start * plane - before;
                    pass.all()[place..place + 4 * plane]
                        .copy_from_slice(&sums[shared.start * plane..shared.end * plane]);
                    pass.add_rest(&add);
                }
                sums[before..end].copy_from_slice(&array);
            }
            assert_eq!(sums, expected, "{cut}");
        }
    }
}
