//! Sums of tiles into one array, in an order that is fixed wherever the windows of tiles overlap.
//!
//! The array is a lattice of elements in some dimensions, axis 0 fastest. Tiles are pieces of it: along each axis there are some pieces, and
//! the window of a tile reaches beyond its piece. A thread fills a buffer of the size of a tile's window whenever it has time, which waits for no
//! other tile. The buffer is added to the array as soon as those tiles are added whose windows overlap with it and whose
//! turn comes before. Turns go by colours: pieces have colours along each axis, so that windows of tiles of one colour never overlap; the last
//! axis decides first. Elements are cleared right before the first tile is added to them, and rows completed right after the last one, while they lie in
//! the cache. The safety argument for the parts of the array that threads change is in this file.
//!
//! A process may hold a box of tiles, whose neighbours other processes hold ([`held`](crate::held)). Along the last axis two processes share a
//! segment: the one whose layer comes first sends its sums as soon as they are there; the other one begins with them, completes the segment and
//! sends it back. Along any other axis the upper one of two processes completes the elements that windows of both have. The lower one sends it the buffers
//! of the tiles that reach into these, which it adds in their turn, and gets complete elements back.

#![allow(unsafe_code, reason = "lines and rows of one array, changed by several threads")]

use std::marker::PhantomData;
use std::ops::Range;
use std::slice;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, Once, PoisonError};

use crate::held::Shared;
use crate::lattice::{Chunk, Coming, Lent, TileLattice};
use crate::on_all_threads;
use crate::region::Region;

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
    /// The exchange with other processes, where there are such.
    pub halo: Option<Halo<'a, N>>,
}

/// Messages with other processes: elements line by line.
#[derive(Clone, Copy)]
pub struct Halo<'a, N> {
    /// Sends elements to a process.
    pub send: &'a (dyn Fn(usize, &[&[N]]) + Sync),
    /// Receives elements of a process.
    pub receive: &'a (dyn Fn(usize, &mut [&mut [N]]) + Sync),
    /// Whether that would not wait.
    pub has_arrived: &'a (dyn Fn(usize) -> bool + Sync),
    /// Whether these rows are complete after [`Hooks::after`].
    pub is_complete: &'a (dyn Fn(Range<usize>) -> bool + Sync),
    /// Between the last sums of all and the last messages.
    pub finish: &'a (dyn Fn(&mut [N]) + Sync),
}

/// Adds the tiles of an array, of which some have sums: [`FillTile`] for those, and the hooks around it. `elements` has the lattice's region.
///
/// # Panics
///
/// Where `elements` has other elements.
pub fn sum_tiles<N: Copy + Send + Sync, const D: usize>(
    elements: &mut [N],
    lattice: &TileLattice<D>,
    buffers: &TileBuffers<N>,
    has_sums: &[bool],
    fill: &FillTile<'_, N>,
    hooks: Hooks<'_, N>,
) {
    let mut pass = Pass::new(elements, lattice, buffers, hooks);
    pass.on_all_threads(has_sums, fill);
    let Some(Halo { send, receive, finish, .. }) = hooks.halo else { return };
    let shared: Vec<Shared> = lattice.held().shared().collect();
    let (lent, borrowed): (Vec<Shared>, Vec<Shared>) =
        shared.into_iter().partition(|shared| shared.is_first_here);
    // Other processes send their tiles, and then the sums of their first layers, whatever they wait for.
    let came = (0..lattice.coming.len()).map(|number| pass.take_coming(number));
    if came.fold(false, |any, came| any | came) {
        pass.on_all_threads(has_sums, fill);
    }
    let came = borrowed.iter().map(|&shared| pass.begin_with_sums(shared));
    if came.fold(false, |any, came| any | came) {
        pass.on_all_threads(has_sums, fill);
    }
    finish(pass.all());
    for shared in borrowed {
        if !*pass.is_returned[usize::from(shared.is_below)].get_mut() {
            send(shared.process, &pass.lines(&pass.of_segment(shared.segment)));
        }
    }
    for shared in lent {
        receive(shared.process, &mut pass.lines_mut(&pass.of_segment(shared.segment)));
    }
    for axis in (0..D - 1).rev() {
        if let Some(process) = lattice.held().neighbour(axis, false) {
            send(process, &pass.lines(&lattice.returned(axis)));
        }
        if let Some(process) = lattice.held().neighbour(axis, true) {
            receive(process, &mut pass.lines_mut(&lattice.returning(axis)));
        }
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

/// The elements of tiles that go to a process.
#[derive(Debug)]
struct Loan<N> {
    elements: Mutex<Vec<N>>,
    /// How many of the tiles are not among them yet.
    left: AtomicUsize,
}

/// A pass over the tiles of an array.
struct Pass<'a, N, const D: usize> {
    lattice: &'a TileLattice<D>,
    first: *mut N,
    length: usize,
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
    /// Whether the tiles of each process whose tiles come here have, or are being taken.
    have_come: Vec<AtomicBool>,
    /// The message to each process to which tiles are lent.
    loans: Vec<Loan<N>>,
    /// Whether these segments have been sent back.
    is_returned: [AtomicBool; 2],
    borrowed: PhantomData<&'a mut [N]>,
}

// SAFETY: threads reach the array through a shared reference, by lines and by chunks, and no two of these that are held overlap (see `elements`);
// they are exclusive slices, for which `Send` is the requirement.
unsafe impl<N: Send + Sync, const D: usize> Sync for Pass<'_, N, D> {}

impl<'a, N: Copy + Send + Sync, const D: usize> Pass<'a, N, D> {
    fn new(
        elements: &'a mut [N],
        lattice: &'a TileLattice<D>,
        buffers: &'a TileBuffers<N>,
        hooks: Hooks<'a, N>,
    ) -> Self {
        // What the unsafe code relies on: the elements are those of the region, which lines of it have once (`Region::lines`).
        assert_eq!(elements.len(), lattice.region().len());
        let segments = lattice.held().segments();
        let loan = |Lent { parts, .. }: &Lent<D>| Loan {
            elements: Mutex::new(vec![hooks.zero; parts.iter().map(|(_, part)| part.len()).sum()]),
            left: AtomicUsize::new(parts.len()),
        };
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
            buffers,
            hooks,
            progress: Mutex::new(progress),
            begun: (0..lattice.strips).map(|_| Once::new()).collect(),
            left: lattice.chunks.iter().map(|chunk| AtomicUsize::new(chunk.tiles)).collect(),
            left_of_segment: segments
                .map(|segment| AtomicUsize::new(of_segment(segment)))
                .collect(),
            has_come: Default::default(),
            have_come: lattice.coming.iter().map(|_| AtomicBool::new(false)).collect(),
            loans: lattice.lent.iter().map(loan).collect(),
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
    /// - *A line of a tile* (`add`) is part of the window of this tile, of whichever process, and of strips that have begun. A tile is added once, by the thread that
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
        let Region(region) = self.lattice.region();
        let row = self.length / region[D - 1].len().max(1);
        (rows.start - region[D - 1].start) * row..(rows.end - region[D - 1].start) * row
    }

    /// All elements here, while no thread works.
    fn all(&mut self) -> &mut [N] {
        // SAFETY: slices that threads hold borrow `self`, which is exclusive here.
        unsafe { self.elements(0..self.length) }
    }

    /// The elements of a segment that this process completes, with those of the layers below and above.
    fn of_segment(&self, segment: usize) -> Region<D> {
        self.lattice.completed().along(D - 1, self.lattice.segment(segment))
    }

    /// The lines of a region, while no thread works.
    fn lines(&mut self, region: &Region<D>) -> Vec<&[N]> {
        // SAFETY: as in `all`.
        region.lines(self.lattice.region()).map(|line| &*unsafe { self.elements(line) }).collect()
    }

    /// As [`lines`](Self::lines), to be changed.
    fn lines_mut(&mut self, region: &Region<D>) -> Vec<&mut [N]> {
        // SAFETY: as in `all`; lines of a region are distinct.
        region.lines(self.lattice.region()).map(|line| unsafe { self.elements(line) }).collect()
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
                self.lend(tile, filled.as_deref());
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

    /// Sends the elements of a tile, if it has any, to the processes that complete them, with the last of the tiles that go there.
    fn lend(&self, tile: usize, filled: Option<&[N]>) {
        let Some(halo) = &self.hooks.halo else { return };
        for (Lent { process, parts }, loan) in self.lattice.lent.iter().zip(&self.loans) {
            let Ok(number) = parts.binary_search_by_key(&tile, |(lent, _)| *lent) else { continue };
            let Loan { elements, left } = loan;
            if let Some(filled) = filled {
                let mut place = parts[..number].iter().map(|(_, part)| part.len()).sum();
                let mut elements = elements.lock().unwrap_or_else(PoisonError::into_inner);
                for line in parts[number].1.lines(&self.lattice.buffered(tile)) {
                    elements[place..place + line.len()].copy_from_slice(&filled[line.clone()]);
                    place += line.len();
                }
            }
            if left.fetch_sub(1, Ordering::AcqRel) == 1 {
                let elements = elements.lock().unwrap_or_else(PoisonError::into_inner);
                (halo.send)(*process, &[&elements]);
            }
        }
    }

    /// Takes tiles and sums of other processes that have arrived.
    fn receive_arrived(&self) {
        let Some(halo) = &self.hooks.halo else { return };
        for (number, Coming { process, .. }) in self.lattice.coming.iter().enumerate() {
            if !self.have_come[number].load(Ordering::Relaxed) && (halo.has_arrived)(*process) {
                self.take_coming(number);
            }
        }
        for shared in self.lattice.held().shared().filter(|shared| !shared.is_first_here) {
            let has_come = &self.has_come[usize::from(shared.is_below)];
            if !has_come.load(Ordering::Relaxed) && (halo.has_arrived)(shared.process) {
                self.begin_with_sums(shared);
            }
        }
    }

    /// Receives the tiles of another process that reach into elements here. Once; what follows does nothing. True where it did something.
    fn take_coming(&self, number: usize) -> bool {
        let Some(halo) = &self.hooks.halo else { return false };
        if self.have_come[number].swap(true, Ordering::Relaxed) {
            return false;
        }
        let Coming { process, tiles } = &self.lattice.coming[number];
        let elements = |tile: usize| self.lattice.buffered(tile).len();
        let mut buffers: Vec<Vec<N>> =
            tiles.iter().map(|&tile| self.buffers.take(elements(tile), self.hooks.zero)).collect();
        let lines = buffers.iter_mut().zip(tiles);
        let mut lines: Vec<_> =
            lines.map(|(buffer, &tile)| &mut buffer[..elements(tile)]).collect();
        (halo.receive)(*process, &mut lines);
        let mut progress = self.progress();
        for (&tile, buffer) in tiles.iter().zip(buffers) {
            progress.filled[tile] = Some(buffer);
            progress.count_down(tile);
        }
        true
    }

    /// Receives the sums of another process whose layer comes first in a shared segment. Once; what follows does nothing. True where it did
    /// something.
    fn begin_with_sums(&self, shared: Shared) -> bool {
        let Some(halo) = &self.hooks.halo else { return false };
        if self.has_come[usize::from(shared.is_below)].swap(true, Ordering::Relaxed) {
            return false;
        }
        let lines = self.of_segment(shared.segment).lines(self.lattice.region());
        // SAFETY: strips before their sums (see `elements`), whose lines are distinct; this is reached once (`has_come`), and `begun` is set below.
        let mut lines: Vec<_> = lines.map(|line| unsafe { self.elements(line) }).collect();
        (halo.receive)(shared.process, &mut lines);
        for chunk in self.lattice.chunks.iter().filter(|chunk| chunk.segment == shared.segment) {
            for (strip, _) in self.lattice.strips_of(chunk, None) {
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
        for (strip, range) in self.lattice.strips_of(chunk, tile) {
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
        let (buffered, added) = (self.lattice.buffered(tile), self.lattice.added(tile));
        for (from, to) in added.lines(&buffered).zip(added.lines(self.lattice.region())) {
            // SAFETY: a line of a tile (see `elements`).
            (self.hooks.add)(unsafe { self.elements(to) }, &mut buffer[from]);
        }
        if added != buffered {
            buffer[..buffered.len()].fill(self.hooks.zero);
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
        if is_lent || (halo.is_complete)(self.lattice.segment(shared.segment)) {
            let lines = self.of_segment(shared.segment).lines(self.lattice.region());
            // SAFETY: a segment after its sums (see `elements`), whose lines are distinct.
            let lines: Vec<_> = lines.map(|line| &*unsafe { self.elements(line) }).collect();
            (halo.send)(shared.process, &lines);
            self.is_returned[usize::from(shared.is_below)].store(true, Ordering::Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::held::{Cuts, Held};
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
    fn changed(lattice: &TileLattice<3>, threads: usize) -> Vec<u64> {
        let mut array = vec![0; lattice.region().len()];
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let buffers = TileBuffers::default();
        // Buffers are used a second time, and what the array has been does not matter.
        for before in [3, 5] {
            array.fill(before);
            pool.install(|| sum(lattice, &mut array, &buffers, None));
        }
        array
    }

    /// The number of a tile among all.
    fn number(lattice: &TileLattice<3>, tile: usize) -> usize {
        let pieces = lattice.pieces(tile);
        (0..3).rev().fold(0, |number, a| number * lattice.held().cuts.pieces(a) + pieces[a])
    }

    fn sum(
        lattice: &TileLattice<3>,
        elements: &mut [u64],
        buffers: &TileBuffers<u64>,
        halo: Option<Halo<'_, u64>>,
    ) {
        let has_sums: Vec<bool> =
            (0..lattice.count()).map(|tile| has_sums(number(lattice, tile))).collect();
        let fill = |tile: usize, buffer: &mut [u64]| {
            assert!(buffer.iter().all(|&element| element == 0));
            buffer.fill(number(lattice, tile) as u64 + 1);
        };
        let row = lattice.region().strides()[2];
        let hooks = Hooks {
            before: &|elements: &mut [u64]| elements.fill(BEFORE),
            after: &|elements: &mut [u64], first| {
                assert_eq!(first % row, 0);
                elements.iter_mut().for_each(|element| *element = after(*element));
            },
            zero: 0,
            add: &add,
            halo,
        };
        sum_tiles(elements, lattice, buffers, &has_sums, &fill, hooks);
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
        assert_eq!(elements.len(), values.len());
        for (element, value) in elements.iter_mut().zip(values).filter(|(_, value)| **value > 0) {
            *element = element.wrapping_mul(1_000_003).wrapping_add(*value);
            *value = 0;
        }
    }

    /// Sums by hand: tile after tile in the order of turns.
    fn by_turns(lattice: &TileLattice<3>) -> Vec<u64> {
        let mut array = vec![BEFORE; lattice.region().len()];
        let mut order: Vec<usize> = (0..lattice.count()).collect();
        order.sort_by_key(|&tile| lattice.turn(tile));
        for tile in order.into_iter().filter(|&tile| has_sums(tile)) {
            for line in Region(lattice.window(tile)).lines(lattice.region()) {
                for element in &mut array[line] {
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
            let lattice = TileLattice::new(
                [
                    windows(pieces[0], length[0], reach[0], reach[1]),
                    windows(pieces[1], length[1], reach[1], reach[0]),
                    windows(pieces[2], 4, 2, 2),
                ],
                Held::whole(pieces),
                at_once,
            );
            let expected = by_turns(&lattice);
            for threads in [1, 2, 3] {
                prop_assert_eq!(&changed(&lattice, threads), &expected);
            }
            prop_assert_eq!(lattice.count(), pieces.iter().product::<usize>());
            let turns: BTreeSet<_> = (0..lattice.count()).map(|tile| lattice.turn(tile)).collect();
            prop_assert!(lattice.longest(&|_| 0.0, &|_| 1.0, &|_| 0.0) <= turns.len() as f64);
            prop_assert_eq!(lattice.longest(&|_| 2.0, &|_| 0.0, &|_| 3.0), 5.0);
            let rows_at_once = at_once / lattice.region().strides()[2];
            let of_rows = |rows: usize| rows as f64;
            prop_assert!(lattice.longest(&|_| 0.0, &|_| 0.0, &of_rows) <= rows_at_once.max(1) as f64);
        }
    }

    /// Messages on their way from a process to another.
    #[derive(Default)]
    struct Mailbox {
        messages: Mutex<VecDeque<Vec<u64>>>,
        arrived: Condvar,
    }

    impl Mailbox {
        fn send(&self, lines: &[&[u64]]) {
            self.messages.lock().unwrap().push_back(lines.concat());
            self.arrived.notify_all();
        }

        fn has_arrived(&self) -> bool {
            !self.messages.lock().unwrap().is_empty()
        }

        fn receive(&self, lines: &mut [&mut [u64]]) {
            let messages = self.messages.lock().unwrap();
            let mut messages = self.arrived.wait_while(messages, |all| all.is_empty()).unwrap();
            let message = messages.pop_front().unwrap();
            let mut rest = &message[..];
            for line in lines {
                let own = rest.split_off(..line.len()).unwrap();
                line.copy_from_slice(own);
            }
            assert!(rest.is_empty(), "{} more elements", rest.len());
        }
    }

    /// The arrays of all processes, each with several threads, against the same parts of the array of one process.
    fn check_processes(windows: &[Vec<Range<usize>>; 3], cuts: &Cuts<3>, is_complete: bool) {
        let pieces = windows.each_ref().map(Vec::len);
        let whole = TileLattice::new(windows.clone(), Held::whole(pieces), 70);
        let expected = by_turns(&whole);
        let count: usize = (0..3).map(|a| cuts.count(a)).product();
        let boxes: Vec<Vec<Mailbox>> =
            (0..count).map(|_| (0..count).map(|_| Mailbox::default()).collect()).collect();
        std::thread::scope(|scope| {
            for rank in 0..count {
                let (boxes, whole, expected) = (&boxes, &whole, &expected);
                let held = Held::of(cuts.clone(), rank);
                let lattice = TileLattice::new(windows.clone(), held, 70);
                scope.spawn(move || {
                    let halo = Halo {
                        send: &|to, lines: &[&[u64]]| boxes[rank][to].send(lines),
                        receive: &|from, lines: &mut [&mut [u64]]| boxes[from][rank].receive(lines),
                        has_arrived: &|from| boxes[from][rank].has_arrived(),
                        is_complete: &|_| is_complete,
                        finish: &|_| {},
                    };
                    let mut array = vec![9; lattice.region().len()];
                    let buffers = TileBuffers::default();
                    let pool = rayon::ThreadPoolBuilder::new().num_threads(1 + rank % 2);
                    let pool = pool.build().unwrap();
                    for _ in 0..2 {
                        pool.install(|| sum(&lattice, &mut array, &buffers, Some(halo)));
                    }
                    let of_one: Vec<u64> = lattice
                        .region()
                        .lines(whole.region())
                        .flat_map(|line| expected[line].to_vec())
                        .collect();
                    assert_eq!(array, of_one, "process {rank} of {cuts:?}");
                });
            }
        });
        let all = boxes.iter().flatten();
        assert!(all.into_iter().all(|mailbox| !mailbox.has_arrived()), "{cuts:?}");
    }

    /// Processes that hold a layer or more each have the elements of one process, whichever of them completes rows at once.
    #[test]
    fn layers_of_several_processes_give_the_sums_of_one() {
        let windows = [windows(3, 2, 1, 1), windows(4, 2, 2, 2), windows(5, 4, 2, 2)];
        for cuts in
            [vec![0, 1, 5], vec![0, 2, 5], vec![0, 3, 5], vec![0, 1, 2, 3, 4, 5], vec![0, 4, 5]]
        {
            for is_complete in [true, false] {
                let cuts = Cuts([vec![0, 3], vec![0, 4], cuts.clone()]);
                check_processes(&windows, &cuts, is_complete);
            }
        }
    }

    /// Cuts of so many pieces where each process has `least` of them or more, by numbers that choose.
    fn cut(pieces: usize, least: usize, chosen: &[usize]) -> Vec<usize> {
        let mut cuts = vec![0];
        for number in chosen {
            let last = cuts[cuts.len() - 1];
            let most = pieces.saturating_sub(last + least);
            if most >= least {
                cuts.push(last + least + number % (most - least + 1));
            }
        }
        cuts.push(pieces);
        cuts
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]

        #[test]
        fn boxes_of_several_processes_give_the_sums_of_one(
            pieces in prop::array::uniform3(1..7_usize),
            length in prop::array::uniform2(2..4_usize),
            reach in prop::array::uniform2(0..4_usize),
            chosen in prop::array::uniform3(prop::collection::vec(0..6_usize, 0..3)),
            is_complete in any::<bool>(),
        ) {
            let windows = [
                windows(pieces[0], length[0], reach[0], reach[1]),
                windows(pieces[1], length[1], reach[1], reach[0]),
                windows(pieces[2], 4, 2, 2),
            ];
            let overlaps = |a: usize| {
                let last = |windows: &[Range<usize>]| {
                    windows.iter().filter(|window| window.start < windows[0].end).count() - 1
                };
                (0..pieces[a]).map(|first| last(&windows[a][first..])).max().unwrap().max(1)
            };
            let cuts = Cuts([
                cut(pieces[0], overlaps(0), &chosen[0]),
                cut(pieces[1], overlaps(1), &chosen[1]),
                cut(pieces[2], 1, &chosen[2]),
            ]);
            check_processes(&windows, &cuts, is_complete);
        }
    }
}
