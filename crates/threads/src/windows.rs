//! Sums of tiles into one array, in an order that is fixed wherever the windows of tiles overlap.
//!
//! The array is a lattice of elements in some dimensions, axis 0 fastest. Tiles are pieces of it: along each axis there are some pieces, and
//! the window of a tile reaches beyond its piece. A thread fills a buffer of the size of a tile's window whenever it has time, which waits for no
//! other tile. The buffer is added to the array as soon as those tiles are added whose windows overlap with it and whose
//! turn comes before. Turns go by colours: pieces have colours along each axis, so that windows of tiles of one colour never overlap; the last
//! axis decides first. Elements are cleared right before the first tile is added to them, and rows completed right after the last one, while they lie in
//! the cache. The safety argument for the parts of the array that threads change is in this file.
//!
//! A process may hold some successive layers of tiles, pieces along the last axis, whose neighbours other processes hold
//! ([`held`](crate::held)). Of two processes that share a segment, the one whose layer comes first sends its sums as soon as they are there; the
//! other one begins with them, completes the segment and sends it back.

#![allow(unsafe_code, reason = "lines and rows of one array, changed by several threads")]

use std::marker::PhantomData;
use std::ops::Range;
use std::slice;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, Once, PoisonError};

use crate::held::Shared;
use crate::lattice::{Chunk, TileLattice};
use crate::on_all_threads;

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

/// The array of a pass, of which this process may hold some rows alone.
pub struct TiledArray<'a, N, const D: usize> {
    /// The elements here.
    pub elements: &'a mut [N],
    /// How far elements lie apart along each axis.
    pub strides: [usize; D],
    /// The first row here.
    pub first_row: usize,
}

/// Fills the buffer of a tile here, the elements of its window, which come in zero.
pub type FillTile<'a, N> = dyn Fn(usize, &mut [N]) + Sync + 'a;

/// Adds elements of a buffer to those of the array, and leaves zeros in the buffer.
pub type AddLine<'a, N> = dyn Fn(&mut [N], &mut [N]) + Sync + 'a;

/// Work on elements of the array in a pass.
#[derive(Clone, Copy)]
pub struct Hooks<'a, N> {
    /// Before the first sums of some rows.
    pub before: &'a (dyn Fn(&mut [N]) + Sync),
    /// After the last sums of some rows; the second argument is the index of the first element.
    pub after: &'a (dyn Fn(&mut [N], usize) + Sync),
    /// An element without sums.
    pub zero: N,
    /// The sum of elements and others, which are cleared.
    pub add: &'a AddLine<'a, N>,
    /// The exchange with processes that hold other layers, where there are such.
    pub halo: Option<Halo<'a, N>>,
}

/// Messages with the processes of the layers below and above.
#[derive(Clone, Copy)]
pub struct Halo<'a, N> {
    /// Sends the elements of a segment that is shared.
    pub send: &'a (dyn Fn(Shared, &[N]) + Sync),
    /// Receives them.
    pub receive: &'a (dyn Fn(Shared, &mut [N]) + Sync),
    /// Whether that would not wait.
    pub has_arrived: &'a (dyn Fn(Shared) -> bool + Sync),
    /// Whether these rows are complete after [`Hooks::after`].
    pub is_complete: &'a (dyn Fn(Range<usize>) -> bool + Sync),
    /// Between the last sums of all and the last messages.
    pub finish: &'a (dyn Fn(&mut [N]) + Sync),
}

/// Adds the tiles of an array, of which some have sums: [`FillTile`] for those, and the hooks around it.
///
/// # Panics
///
/// Where `array` does not have the rows of all segments here.
pub fn sum_tiles<N: Copy + Send + Sync, const D: usize>(
    array: TiledArray<'_, N, D>,
    lattice: &TileLattice<D>,
    buffers: &TileBuffers<N>,
    has_sums: &[bool],
    fill: &FillTile<'_, N>,
    hooks: Hooks<'_, N>,
) {
    let mut pass = Pass::new(array, lattice, buffers, hooks);
    pass.on_all_threads(has_sums, fill);
    let Some(Halo { send, receive, finish, .. }) = hooks.halo else { return };
    let shared: Vec<Shared> = lattice.held().shared().collect();
    let (lent, borrowed): (Vec<Shared>, Vec<Shared>) =
        shared.into_iter().partition(|shared| shared.is_first_here);
    let came = borrowed.iter().map(|&shared| pass.begin_with_sums(shared));
    if came.fold(false, |any, came| any | came) {
        pass.on_all_threads(has_sums, fill);
    }
    finish(pass.all());
    for shared in borrowed {
        if !*pass.is_returned[usize::from(shared.is_below)].get_mut() {
            send(shared, pass.of_segment(shared.segment));
        }
    }
    for shared in lent {
        receive(shared, pass.of_segment(shared.segment));
    }
}

/// How far the tiles of a pass are.
#[derive(Debug)]
struct Progress<N> {
    /// For each tile the tiles, its own buffer, and the processes that it waits for.
    pending: Vec<u16>,
    /// For each place in the order of work whether a thread has taken its tile to fill the buffer.
    taken: Vec<bool>,
    /// The filled buffers that wait for their turn; none for a tile without sums.
    filled: Vec<Option<Vec<N>>>,
    /// Tiles whose turn it is.
    ready: Vec<usize>,
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

/// A pass over the tiles of an array.
struct Pass<'a, N, const D: usize> {
    lattice: &'a TileLattice<D>,
    first: *mut N,
    length: usize,
    strides: [usize; D],
    /// Elements of the whole array before the first here.
    before: usize,
    buffers: &'a TileBuffers<N>,
    hooks: Hooks<'a, N>,
    progress: Mutex<Progress<N>>,
    /// For each strip of a chunk whether its elements are those that sums begin with.
    begun: Vec<Once>,
    /// For each chunk the number of tiles that are not added yet.
    left: Vec<AtomicUsize>,
    /// For each segment here the number of chunks that are not complete yet.
    left_of_segment: Vec<AtomicUsize>,
    /// Whether the sums of the shared segment above, and of that below, have come, or are being taken.
    has_come: [AtomicBool; 2],
    /// Whether these segments have been sent back.
    is_returned: [AtomicBool; 2],
    borrowed: PhantomData<&'a mut [N]>,
}

// SAFETY: threads reach the array through a shared reference, by lines and by chunks, and no two of these that are held overlap (see `elements`);
// they are exclusive slices, for which `Send` is the requirement.
unsafe impl<N: Send + Sync, const D: usize> Sync for Pass<'_, N, D> {}

impl<'a, N: Copy + Send + Sync, const D: usize> Pass<'a, N, D> {
    fn new(
        array: TiledArray<'a, N, D>,
        lattice: &'a TileLattice<D>,
        buffers: &'a TileBuffers<N>,
        hooks: Hooks<'a, N>,
    ) -> Self {
        let TiledArray { elements, strides, first_row } = array;
        let (row, segments) = (strides[D - 1], lattice.held().segments());
        // What the unsafe code relies on: lines lie in the array, elements of distinct places along an axis are distinct, and chunks cover it.
        assert_eq!(strides[0], 1);
        for a in 0..D - 1 {
            assert!(lattice.end(a) * strides[a] <= strides[a + 1]);
        }
        assert_eq!(row, lattice.row());
        let end = segments.clone().next_back().map_or(first_row, |last| lattice.segment(last).end);
        assert_eq!(first_row, lattice.segment(segments.start).start);
        assert_eq!((end - first_row) * row, elements.len());
        let count = lattice.count();
        let progress = Progress {
            pending: lattice.before().into_iter().map(|before| before + 1).collect(),
            taken: vec![false; count],
            filled: (0..count).map(|_| None).collect(),
            ready: Vec::new(),
        };
        let of_segment = |segment| lattice.chunks.iter().filter(|c| c.segment == segment).count();
        Self {
            lattice,
            first: elements.as_mut_ptr(),
            length: elements.len(),
            strides,
            before: first_row * row,
            buffers,
            hooks,
            progress: Mutex::new(progress),
            begun: (0..lattice.strips).map(|_| Once::new()).collect(),
            left: lattice.chunks.iter().map(|chunk| AtomicUsize::new(chunk.tiles)).collect(),
            left_of_segment: segments
                .map(|segment| AtomicUsize::new(of_segment(segment)))
                .collect(),
            has_come: Default::default(),
            is_returned: Default::default(),
            borrowed: PhantomData,
        }
    }

    fn progress(&self) -> MutexGuard<'_, Progress<N>> {
        self.progress.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Elements of the array.
    ///
    /// # Safety
    ///
    /// No other slice of these elements may be in use. Threads keep to that as follows.
    ///
    /// - *A line of a tile* (`add`) is part of the window of this tile, and of strips that have begun. A tile is added once, by the thread that
    ///   took it from `ready`, where it is put when all tiles before it with overlapping windows are added (`pending`). Tiles of
    ///   the same turn do not overlap: along some axis their pieces are a multiple of `reach + 1` apart. Of two tiles with overlapping
    ///   windows one comes before the other, as their pieces lie within `reach` along each axis (`neighbours`) and their turns differ.
    /// - *A strip of a chunk before its sums* is changed within its `Once`, which each tile passes before it adds to it (`add`), and the last one
    ///   before it completes the chunk. Where another process begins the sums, those tiles wait for it (`pending`), and none is added before
    ///   (`begin_with_sums`).
    /// - *A chunk after its sums* is changed by the thread that counts its last tile down (`left`), and no other tile has rows of it. The rows of
    ///   a segment are read by the thread that counts its last chunk down (`left_of_segment`).
    ///
    /// Writes of one thread are visible to the next: both pass through a mutex, a `Once`, or a counter that is changed with `AcqRel`.
    #[expect(clippy::mut_from_ref, reason = "the callers' claims are above")]
    unsafe fn elements(&self, range: Range<usize>) -> &mut [N] {
        assert!(range.start <= range.end && range.end <= self.length);
        // SAFETY: the elements lie in the array, which is borrowed for 'a, and the caller sees to it that they are in no other slice.
        unsafe { slice::from_raw_parts_mut(self.first.add(range.start), range.len()) }
    }

    /// The indices of the elements of rows.
    fn of_rows(&self, rows: Range<usize>) -> Range<usize> {
        let row = self.strides[D - 1];
        rows.start * row - self.before..rows.end * row - self.before
    }

    /// All elements here, while no thread works.
    fn all(&mut self) -> &mut [N] {
        // SAFETY: slices that threads hold borrow `self`, which is exclusive here.
        unsafe { self.elements(0..self.length) }
    }

    /// The elements of a segment, while no thread works.
    fn of_segment(&mut self, segment: usize) -> &mut [N] {
        // SAFETY: as in `all`.
        unsafe { self.elements(self.of_rows(self.lattice.segment(segment))) }
    }

    /// Fills the buffers of tiles that have sums, and adds those whose turn it is, until nothing is left that waits for no other process.
    fn on_all_threads(&self, has_sums: &[bool], fill: &FillTile<'_, N>) {
        on_all_threads(&|(part, parts)| {
            let TileLattice { order, awaited, .. } = self.lattice;
            let mut next = (order.len() - awaited) * part / parts.max(1);
            loop {
                self.receive_arrived();
                self.add_ready();
                let Some(tile) = self.take(&mut next) else { break };
                let filled = has_sums[tile].then(|| {
                    let elements = self.lattice.elements(tile);
                    let mut buffer = self.buffers.take(elements, self.hooks.zero);
                    fill(tile, &mut buffer[..elements]);
                    buffer
                });
                let mut progress = self.progress();
                progress.filled[tile] = filled;
                progress.count_down(tile);
            }
        });
    }

    /// The first tile that no thread has taken: of those that other processes wait for, then of the others from place `next` on.
    fn take(&self, next: &mut usize) -> Option<usize> {
        let TileLattice { order, awaited, .. } = self.lattice;
        let others = order.len() - awaited;
        let mut progress = self.progress();
        let mut places =
            (0..*awaited).chain((0..others).map(|step| awaited + (*next + step) % others));
        let place = places.find(|&place| !progress.taken[place])?;
        progress.taken[place] = true;
        if place >= *awaited {
            *next = place - awaited + 1;
        }
        Some(order[place])
    }

    /// Takes the sums of other processes that have arrived.
    fn receive_arrived(&self) {
        let Some(halo) = &self.hooks.halo else { return };
        for shared in self.lattice.held().shared().filter(|shared| !shared.is_first_here) {
            let has_come = &self.has_come[usize::from(shared.is_below)];
            if !has_come.load(Ordering::Relaxed) && (halo.has_arrived)(shared) {
                self.begin_with_sums(shared);
            }
        }
    }

    /// Receives the sums of another process whose layer comes first in a shared segment. Once; what follows does nothing. True where it did
    /// something.
    fn begin_with_sums(&self, shared: Shared) -> bool {
        let Some(halo) = &self.hooks.halo else { return false };
        if self.has_come[usize::from(shared.is_below)].swap(true, Ordering::Relaxed) {
            return false;
        }
        let rows = self.of_rows(self.lattice.segment(shared.segment));
        // SAFETY: strips before their sums (see `elements`); this is reached once (`has_come`), and `begun` is set below.
        (halo.receive)(shared, unsafe { self.elements(rows) });
        for chunk in self.lattice.chunks.iter().filter(|chunk| chunk.segment == shared.segment) {
            for (strip, _) in self.lattice.strips_of(chunk, &self.strides, None) {
                self.begun[strip].call_once(|| {});
            }
        }
        let mut progress = self.progress();
        self.lattice.adding_to(shared).for_each(|tile| progress.count_down(tile));
        true
    }

    /// Adds tiles as long as it is the turn of one.
    fn add_ready(&self) {
        loop {
            let mut progress = self.progress();
            let Some(tile) = progress.ready.pop() else { return };
            let filled = progress.filled[tile].take();
            drop(progress);
            if let Some(mut buffer) = filled {
                self.add(tile, &mut buffer);
                self.buffers.free().push(buffer);
            }
            let mut progress = self.progress();
            self.lattice.successors(tile).for_each(|other| progress.count_down(other));
            drop(progress);
            for chunk in self.lattice.chunks_of(tile) {
                if self.left[chunk].fetch_sub(1, Ordering::AcqRel) == 1 {
                    self.complete(chunk);
                }
            }
        }
    }

    /// Sees to it that a chunk has the elements that sums begin with: all, or those in the window of a tile.
    fn begin(&self, chunk: &Chunk, tile: Option<usize>) {
        let first = self.of_rows(chunk.rows.clone()).start;
        for (strip, range) in self.lattice.strips_of(chunk, &self.strides, tile) {
            self.begun[strip].call_once(|| {
                // SAFETY: a strip before its sums (see `elements`).
                (self.hooks.before)(unsafe {
                    self.elements(first + range.start..first + range.end)
                });
            });
        }
    }

    /// Adds the buffer of a tile to the array, line by line along axis 0.
    fn add(&self, tile: usize, buffer: &mut [N]) {
        let chunks = &self.lattice.chunks[self.lattice.chunks_of(tile)];
        chunks.iter().for_each(|chunk| self.begin(chunk, Some(tile)));
        let window = self.lattice.window(tile);
        let buffer = &mut buffer[..self.lattice.elements(tile)];
        for (line, values) in buffer.chunks_exact_mut(window[0].len()).enumerate() {
            let (mut rest, mut place) = (line, window[0].start);
            for a in 1..D {
                place += (window[a].start + rest % window[a].len()) * self.strides[a];
                rest /= window[a].len();
            }
            let place = place - self.before;
            // SAFETY: a line of a tile (see `elements`).
            (self.hooks.add)(unsafe { self.elements(place..place + values.len()) }, values);
        }
    }

    /// Completes a chunk whose last tile is added, or sends its segment to the process that completes it.
    fn complete(&self, number: usize) {
        let chunk = &self.lattice.chunks[number];
        self.begin(chunk, None);
        let shared = self.lattice.held().shared().find(|shared| shared.segment == chunk.segment);
        let is_lent = shared.is_some_and(|shared| shared.is_first_here);
        if !is_lent {
            let range = self.of_rows(chunk.rows.clone());
            let first = range.start;
            // SAFETY: a chunk after its sums (see `elements`).
            (self.hooks.after)(unsafe { self.elements(range) }, first);
        }
        let place = chunk.segment - self.lattice.held().segments().start;
        if self.left_of_segment[place].fetch_sub(1, Ordering::AcqRel) > 1 {
            return;
        }
        let (Some(shared), Some(halo)) = (shared, &self.hooks.halo) else { return };
        let rows = self.lattice.segment(shared.segment);
        if is_lent || (halo.is_complete)(rows.clone()) {
            // SAFETY: a segment after its sums (see `elements`).
            (halo.send)(shared, unsafe { self.elements(self.of_rows(rows)) });
            self.is_returned[usize::from(shared.is_below)].store(true, Ordering::Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::held::Held;
    use crate::lattice::Elements;
    use proptest::prelude::*;
    use std::collections::{BTreeSet, VecDeque};
    use std::sync::Condvar;

    /// Windows that reach by these numbers beyond pieces of a length.
    fn windows(pieces: usize, length: usize, below: usize, above: usize) -> Vec<Range<usize>> {
        (0..pieces)
            .map(|piece| {
                let first = piece * length;
                first..below + (piece + 1) * length + above
            })
            .collect()
    }

    /// The sums of the whole lattice: each tile takes an element from what it was, so that the order shows. Rows are completed by a factor.
    fn changed(lattice: &TileLattice<3>, dims: [usize; 3], threads: usize) -> Vec<u64> {
        let mut array = vec![0; dims.iter().product()];
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let buffers = TileBuffers::default();
        // Buffers are used a second time, and what the array has been does not matter.
        for before in [3, 5] {
            array.fill(before);
            pool.install(|| sum(lattice, (dims, 0), &mut array, &buffers, None));
        }
        array
    }

    fn sum(
        lattice: &TileLattice<3>,
        (dims, first_tile): ([usize; 3], usize),
        elements: &mut [u64],
        buffers: &TileBuffers<u64>,
        halo: Option<Halo<'_, u64>>,
    ) {
        let has_sums: Vec<bool> =
            (first_tile..first_tile + lattice.count()).map(has_sums).collect();
        let fill = |tile: usize, buffer: &mut [u64]| {
            assert!(buffer.iter().all(|&element| element == 0));
            buffer.fill((first_tile + tile) as u64 + 1);
        };
        let hooks = Hooks {
            before: &|elements: &mut [u64]| elements.fill(BEFORE),
            after: &|elements: &mut [u64], first| {
                assert_eq!(first % (dims[0] * dims[1]), 0);
                elements.iter_mut().for_each(|element| *element = after(*element));
            },
            zero: 0,
            add: &add,
            halo,
        };
        let strides = [1, dims[0], dims[0] * dims[1]];
        let first_row = lattice.segment(lattice.held().segments().start).start;
        let array = TiledArray { elements, strides, first_row };
        sum_tiles(array, lattice, buffers, &has_sums, &fill, hooks);
    }

    /// The number that sums begin with.
    const BEFORE: u64 = 7;

    fn after(element: u64) -> u64 {
        element.wrapping_mul(31)
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
        let mut array = vec![BEFORE; dims.iter().product()];
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
        array.into_iter().map(after).collect()
    }

    proptest! {
        /// Run under Miri too: `cargo +nightly miri test -p mmsmith-threads windows`.
        #[test]
        fn threads_add_tiles_in_the_order_of_their_turns(
            pieces in prop::array::uniform3(1..5_usize),
            length in prop::array::uniform2(1..4_usize),
            reach in prop::array::uniform2(0..3_usize),
            at_once in 1..400_usize,
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
                Elements { row: dims[0] * dims[1], at_once },
            );
            let expected = by_turns(&lattice, dims);
            for threads in [1, 2, 3] {
                prop_assert_eq!(&changed(&lattice, dims, threads), &expected);
            }
            prop_assert_eq!(lattice.count(), pieces.iter().product::<usize>());
            let turns: BTreeSet<_> = (0..lattice.count()).map(|tile| lattice.turn(tile)).collect();
            prop_assert!(lattice.longest(&|_| 0.0, &|_| 1.0, &|_| 0.0) <= turns.len() as f64);
            prop_assert_eq!(lattice.longest(&|_| 2.0, &|_| 0.0, &|_| 3.0), 5.0);
            let rows_at_once = at_once / (dims[0] * dims[1]);
            let of_rows = |rows: usize| rows as f64;
            prop_assert!(lattice.longest(&|_| 0.0, &|_| 0.0, &of_rows) <= rows_at_once.max(1) as f64);
        }
    }

    /// Messages on their way to a process.
    #[derive(Default)]
    struct Mailbox {
        messages: Mutex<VecDeque<Vec<u64>>>,
        arrived: Condvar,
    }

    impl Mailbox {
        fn send(&self, elements: &[u64]) {
            self.messages.lock().unwrap().push_back(elements.to_vec());
            self.arrived.notify_all();
        }

        fn has_arrived(&self) -> bool {
            !self.messages.lock().unwrap().is_empty()
        }

        fn receive(&self, elements: &mut [u64]) {
            let messages = self.messages.lock().unwrap();
            let mut messages = self.arrived.wait_while(messages, |all| all.is_empty()).unwrap();
            elements.copy_from_slice(&messages.pop_front().unwrap());
        }
    }

    /// Processes that hold a layer or more each have the elements of one process, whichever of them completes rows at once.
    #[test]
    fn layers_of_several_processes_give_the_sums_of_one() {
        let of_axes = || [windows(3, 2, 1, 1), windows(4, 2, 2, 2), windows(5, 4, 2, 2)];
        let dims = [8, 12, 24];
        let plane = dims[0] * dims[1];
        let elements = Elements { row: plane, at_once: 70 };
        let expected = by_turns(&TileLattice::new(of_axes(), Held::whole(5), elements), dims);
        for cuts in
            [vec![0, 1, 5], vec![0, 2, 5], vec![0, 3, 5], vec![0, 1, 2, 3, 4, 5], vec![0, 4, 5]]
        {
            for completes_at_once in [true, false] {
                let count = cuts.len() - 1;
                // To the process below and to that above.
                let boxes: Vec<[Mailbox; 2]> = (0..count).map(|_| Default::default()).collect();
                std::thread::scope(|scope| {
                    for rank in 0..count {
                        let (boxes, cuts, expected) = (&boxes, &cuts, &expected);
                        scope.spawn(move || {
                            let held = Held { layers: cuts[rank]..cuts[rank + 1], all: 5 };
                            let lattice = TileLattice::new(of_axes(), held, elements);
                            let segments = lattice.held().segments();
                            let rows = lattice.segment(segments.start).start
                                ..lattice.segment(segments.end - 1).end;
                            let mut array = vec![0; rows.len() * plane];
                            let out = |shared: Shared| match shared.is_below {
                                true => &boxes[rank - 1][0],
                                false => &boxes[rank + 1][1],
                            };
                            let own = |shared: Shared| &boxes[rank][usize::from(shared.is_below)];
                            let halo = Halo {
                                send: &|shared, elements: &[u64]| out(shared).send(elements),
                                receive: &|shared, elements: &mut [u64]| {
                                    own(shared).receive(elements)
                                },
                                has_arrived: &|shared| own(shared).has_arrived(),
                                is_complete: &|_| completes_at_once,
                                finish: &|_| {},
                            };
                            let place = (dims, cuts[rank] * 12);
                            sum(&lattice, place, &mut array, &TileBuffers::default(), Some(halo));
                            assert_eq!(array, expected[rows.start * plane..rows.end * plane]);
                        });
                    }
                });
            }
        }
    }
}
