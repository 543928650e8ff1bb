//! The tiles of an array, whose windows overlap: which of them wait for which others, and which elements are complete with them.

use std::ops::Range;

use crate::held::{Held, Shared};
use crate::region::Region;

/// The tiles of an array: pieces along each axis, whose windows are ranges of elements. Layers are the pieces along the last axis, and a row has all
/// elements here with one index along it.
///
/// Beside the tiles of this process it has those of other processes, of the same layers, whose windows reach into the elements that this process
/// completes: these *come* from there. Tiles here that reach into elements of other processes are *lent* to them.
#[derive(Clone, Debug)]
pub struct TileLattice<const D: usize> {
    /// The windows of the pieces along each axis, whoever holds them.
    windows: [Vec<Range<usize>>; D],
    /// How far along each axis pieces lie apart whose windows may overlap.
    reach: [usize; D],
    held: Held<D>,
    /// The pieces along each axis of the tiles here and of those that come.
    around: Region<D>,
    /// The elements that the windows of the tiles here cover.
    region: Region<D>,
    /// Elements of these that no process completes but this one and those of the layers below and above.
    own: Region<D>,
    /// The tiles that come from each other process, and those that go there.
    pub(crate) coming: Vec<Coming<D>>,
    pub(crate) lent: Vec<Lent<D>>,
    /// For each tile the number of tiles whose turn comes before and that it overlaps with.
    predecessors: Vec<u16>,
    /// The tiles of this process in the order of work, and how many of them other processes wait for.
    pub(crate) order: Vec<usize>,
    pub(crate) awaited: usize,
    pub(crate) chunks: Vec<Chunk>,
    /// How many elements are cleared together, and completed together but for longer rows.
    at_once: usize,
    /// How many strips all chunks have.
    pub(crate) strips: usize,
}

/// Tiles of another process whose windows reach into the elements that this process completes.
#[derive(Clone, Debug)]
pub(crate) struct Coming<const D: usize> {
    pub(crate) process: usize,
    pub(crate) tiles: Vec<usize>,
}

/// Tiles here whose windows reach into the elements that another process completes.
#[derive(Clone, Debug)]
pub(crate) struct Lent<const D: usize> {
    pub(crate) process: usize,
    /// The tiles, ascending, each with the elements that go there.
    pub(crate) parts: Vec<(usize, Region<D>)>,
}

/// Some successive rows of a segment, which are completed together.
#[derive(Clone, Debug)]
pub(crate) struct Chunk {
    pub(crate) segment: usize,
    pub(crate) rows: Range<usize>,
    /// How many tiles have windows that reach into the segment.
    pub(crate) tiles: usize,
    /// The number of its first strip, among those of all chunks.
    first_strip: usize,
    /// How many strips it has, which are cleared one by one: more than one where it is one long row.
    strips: usize,
}

impl<const D: usize> TileLattice<D> {
    /// The lattice of these windows along each axis, of which this process has the tiles `held`. So many elements are cleared together.
    ///
    /// # Panics
    ///
    /// Where windows along an axis do not ascend, or those along the last axis overlap with more than their neighbours, or leave rows out; where a
    /// process along another axis has fewer pieces than overlap.
    pub fn new(windows: [Vec<Range<usize>>; D], held: Held<D>, at_once: usize) -> Self {
        // What the unsafe code relies on.
        assert!(at_once > 0);
        let reach = windows.each_ref().map(|windows| {
            assert!(windows.windows(2).all(|w| w[0].start <= w[1].start && w[0].end <= w[1].end));
            let apart = |by: usize| {
                windows.iter().zip(windows.iter().skip(by)).all(|(a, b)| a.end <= b.start)
            };
            (1..=windows.len()).find(|&by| apart(by)).unwrap_or(1).max(1) - 1
        });
        for a in 0..D {
            assert_eq!(held.cuts.pieces(a), windows[a].len());
            let least = if a == D - 1 || held.cuts.count(a) == 1 { 1 } else { reach[a].max(1) };
            assert!(held.cuts.0[a].windows(2).all(|cut| cut[0] + least <= cut[1]));
        }
        assert!(reach[D - 1] <= 1);
        assert!(windows[D - 1].windows(2).all(|w| w[1].start <= w[0].end));
        let none = Region(std::array::from_fn(|_| 0..0));
        let mut own = Self {
            windows,
            reach,
            around: none.clone(),
            region: none.clone(),
            own: none,
            held,
            coming: Vec::new(),
            lent: Vec::new(),
            predecessors: Vec::new(),
            order: Vec::new(),
            awaited: 0,
            chunks: Vec::new(),
            at_once,
            strips: 0,
        };
        let at = own.held.at;
        own.around = own.around_of(&at);
        own.region = Region(std::array::from_fn(|a| own.extent(a, at[a])));
        own.own = own.completed_by(&at);
        own.exchange_tiles();
        own.predecessors = (0..own.count())
            .map(|tile| {
                own.neighbours(tile).filter(|&other| own.precedes(other, tile)).count() as u16
            })
            .collect();
        own.order_work();
        own.cut_rows();
        own
    }

    /// Finds the tiles that come from other processes, and those that go there.
    fn exchange_tiles(&mut self) {
        let cuts = &self.held.cuts;
        let in_a_layer: usize = (0..D - 1).map(|a| cuts.count(a)).product();
        let first = self.held.at[D - 1] * in_a_layer;
        let others = (first..first + in_a_layer).filter(|rank| *rank != cuts.rank(&self.held.at));
        let (mut coming, mut lent) = (Vec::new(), Vec::new());
        for process in others {
            let at = cuts.place(process);
            let holds = |tile: &usize| cuts.holder(&self.pieces(*tile)) == process;
            let tiles: Vec<usize> = (0..self.count()).filter(holds).collect();
            if !tiles.is_empty() {
                coming.push(Coming { process, tiles });
            }
            let (around, completed) = (self.around_of(&at), self.completed_by(&at));
            let own = (0..self.count()).filter(|tile| {
                let pieces = self.pieces(*tile);
                self.is_own(*tile) && (0..D).all(|a| around.0[a].contains(&pieces[a]))
            });
            let parts: Vec<_> = own
                .map(|tile| (tile, Region(self.window(tile)).intersection(&completed)))
                .collect();
            if !parts.is_empty() {
                lent.push(Lent { process, parts });
            }
        }
        (self.coming, self.lent) = (coming, lent);
    }

    /// Puts the tiles in order of work: first those that go to other processes, then layer by layer.
    fn order_work(&mut self) {
        let (layers, awaited) = self.held.order();
        let in_a_layer = self.in_a_layer();
        let of_layers = |layers: &[usize]| -> Vec<usize> {
            let first = |layer: &usize| (layer - self.held.layers().start) * in_a_layer;
            let tiles = layers.iter().flat_map(|layer| first(layer)..first(layer) + in_a_layer);
            tiles.filter(|tile| self.is_own(*tile)).collect()
        };
        let mut is_taken = vec![false; self.count()];
        for (tile, _) in self.lent.iter().flat_map(|lent| &lent.parts) {
            is_taken[*tile] = true;
        }
        let (lent, others): (Vec<usize>, Vec<usize>) =
            of_layers(&layers).into_iter().partition(|tile| is_taken[*tile]);
        let of_awaited = of_layers(&layers[..awaited]);
        let awaited = lent.len() + of_awaited.iter().filter(|tile| !is_taken[**tile]).count();
        self.order = [lent, others].concat();
        self.awaited = awaited;
    }

    /// Cuts the rows here into chunks.
    fn cut_rows(&mut self) {
        let row = self.region.strides()[D - 1];
        let at_once = (self.at_once / row.max(1)).max(1);
        for segment in self.held.segments() {
            let all = self.segment(segment);
            for first in all.clone().step_by(at_once) {
                let rows = first..all.end.min(first + at_once);
                let strips = (rows.len() * row).div_ceil(self.at_once);
                let first_strip = self.strips;
                self.chunks.push(Chunk { segment, rows, tiles: 0, first_strip, strips });
                self.strips += strips;
            }
        }
        for tile in 0..self.count() {
            let range = self.chunks_of(tile);
            self.chunks[range].iter_mut().for_each(|chunk| chunk.tiles += 1);
        }
    }

    /// The tiles of this process.
    pub fn held(&self) -> &Held<D> {
        &self.held
    }

    /// The elements here.
    pub fn region(&self) -> &Region<D> {
        &self.region
    }

    /// The elements along an axis of the process at a place along it.
    pub fn extent(&self, axis: usize, at: usize) -> Range<usize> {
        let pieces = self.held.pieces_at(axis, at);
        if axis == D - 1 {
            return self.segment(pieces.start).start..self.segment(pieces.end).end;
        }
        let windows = &self.windows[axis];
        windows[pieces.start].start..windows[pieces.end - 1].end
    }

    /// The elements that the processes at a place complete: along the last axis all there, along others those before the next process.
    fn completed_by(&self, at: &[usize; D]) -> Region<D> {
        Region(std::array::from_fn(|a| {
            let extent = self.extent(a, at[a]);
            match self.windows[a].get(self.held.pieces_at(a, at[a]).end) {
                Some(next) if a < D - 1 => extent.start..next.start,
                _ => extent,
            }
        }))
    }

    /// The elements that this process completes, with those of the layers below and above.
    pub(crate) fn completed(&self) -> &Region<D> {
        &self.own
    }

    /// The elements that go to the process below along an axis once they are complete, axes above this one first.
    pub(crate) fn returned(&self, axis: usize) -> Region<D> {
        let below = self.extent(axis, self.held.at[axis].saturating_sub(1));
        self.up_to(axis).along(axis, self.own.0[axis].start..below.end)
    }

    /// Elements that come so from the process above.
    pub(crate) fn returning(&self, axis: usize) -> Region<D> {
        self.up_to(axis).along(axis, self.own.0[axis].end..self.region.0[axis].end)
    }

    /// The elements here along axes above `axis`, and those that this process completes along the others.
    fn up_to(&self, axis: usize) -> Region<D> {
        Region(std::array::from_fn(|a| {
            if a > axis { self.region.0[a].clone() } else { self.own.0[a].clone() }
        }))
    }

    /// The pieces along each axis of the tiles of a process and of those that come to it.
    fn around_of(&self, at: &[usize; D]) -> Region<D> {
        Region(std::array::from_fn(|a| {
            let Range { start, end } = self.held.pieces_at(a, at[a]);
            if a == D - 1 { start..end } else { start.saturating_sub(self.reach[a])..end }
        }))
    }

    /// Whether this process holds a tile.
    fn is_own(&self, tile: usize) -> bool {
        let pieces = self.pieces(tile);
        (0..D).all(|a| self.held.pieces(a).contains(&pieces[a]))
    }

    /// The elements that the buffer of a tile has: those of its window, or of a tile that comes the ones that this process completes.
    pub(crate) fn buffered(&self, tile: usize) -> Region<D> {
        if self.is_own(tile) { Region(self.window(tile)) } else { self.added(tile) }
    }

    /// The elements to which a tile adds here.
    pub(crate) fn added(&self, tile: usize) -> Region<D> {
        Region(self.window(tile)).intersection(&self.own)
    }

    /// The rows of a segment: those from the first of a layer's window to the first of the next one's.
    pub fn segment(&self, segment: usize) -> Range<usize> {
        let layers = &self.windows[D - 1];
        let start = |layer: usize| match layers.get(layer) {
            Some(window) => window.start,
            None => layers.last().map_or(0, |window| window.end),
        };
        start(segment)..start(segment + 1)
    }

    /// The chunks of the two segments into which the window of a tile here reaches.
    pub(crate) fn chunks_of(&self, tile: usize) -> Range<usize> {
        let layer = self.pieces(tile)[D - 1];
        let start = self.chunks.partition_point(|chunk| chunk.segment < layer);
        start..self.chunks.partition_point(|chunk| chunk.segment <= layer + 1)
    }

    /// The strips of a chunk, each with its number and its elements from the beginning of the chunk on; of a tile those alone where it has
    /// elements of the chunk.
    pub(crate) fn strips_of(
        &self,
        chunk: &Chunk,
        tile: Option<usize>,
    ) -> impl Iterator<Item = (usize, Range<usize>)> + use<D> {
        let (at_once, first, strides) = (self.at_once, chunk.first_strip, self.region.strides());
        let end = chunk.rows.len() * strides[D - 1];
        // A chunk of several rows is one strip.
        let range = match tile.map(|tile| self.added(tile)) {
            Some(added) if D > 1 && chunk.strips > 1 => {
                let (along, before) = (&added.0[D - 2], self.region.0[D - 2].start);
                (along.start - before) * strides[D - 2]..(along.end - before) * strides[D - 2]
            }
            _ => 0..end,
        };
        (range.start / at_once..range.end.div_ceil(at_once).min(chunk.strips))
            .map(move |strip| (first + strip, strip * at_once..end.min((strip + 1) * at_once)))
    }

    /// Number of tiles here, with those that come.
    pub fn count(&self) -> usize {
        self.around.len()
    }

    /// Number of them in a layer.
    fn in_a_layer(&self) -> usize {
        self.around.0[..D - 1].iter().map(ExactSizeIterator::len).product()
    }

    /// The pieces of a tile along each axis.
    pub fn pieces(&self, tile: usize) -> [usize; D] {
        self.around.place(tile)
    }

    /// The window of a tile along each axis.
    pub fn window(&self, tile: usize) -> [Range<usize>; D] {
        let pieces = self.pieces(tile);
        std::array::from_fn(|a| self.windows[a][pieces[a]].clone())
    }

    /// Number of elements in the window of a tile.
    pub fn elements(&self, tile: usize) -> usize {
        self.window(tile).into_iter().map(|window| window.len()).product()
    }

    /// Where a tile stands in the order of turns, the last axis first.
    pub(crate) fn turn(&self, tile: usize) -> [usize; D] {
        let pieces = self.pieces(tile);
        std::array::from_fn(|place| {
            let a = D - 1 - place;
            match place {
                0 => usize::from(self.held.is_second(pieces[a])),
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
        let near = Region(std::array::from_fn(|a| {
            let (first, end) =
                (pieces[a].saturating_sub(self.reach[a]), pieces[a] + self.reach[a] + 1);
            first.max(self.around.0[a].start)..end.min(self.around.0[a].end)
        }));
        let found = (0..near.len()).map(move |number| self.around.index(&near.place(number)));
        found.filter(move |&other| other != tile)
    }

    /// The tiles here that overlap with a tile and come after it.
    pub(crate) fn successors(&self, tile: usize) -> impl Iterator<Item = usize> + '_ {
        self.neighbours(tile).filter(move |&other| self.precedes(tile, other))
    }

    /// The tiles here of the layer that adds to a shared segment.
    pub(crate) fn adding_to(&self, shared: Shared) -> Range<usize> {
        let layer = if shared.is_below { shared.segment } else { shared.segment - 1 };
        let first = (layer - self.held.layers().start) * self.in_a_layer();
        first..first + self.in_a_layer()
    }

    /// For each tile here the number of tiles here, and of other processes, whose sums come before its own.
    pub(crate) fn before(&self) -> Vec<u16> {
        let mut before = self.predecessors.clone();
        for shared in self.held.shared().filter(|shared| !shared.is_first_here) {
            before[self.adding_to(shared)].iter_mut().for_each(|count| *count += 1);
        }
        before
    }

    /// The time of the longest chain of tasks each of which waits for the one before, if it takes the time `fill(tile)` to fill the buffer of
    /// a tile here, `add(tile)` to add it, and `complete(rows)` to clear rows and complete them: what a pass takes at least, on any number of threads.
    pub fn longest(
        &self,
        fill: &dyn Fn(usize) -> f64,
        add: &dyn Fn(usize) -> f64,
        complete: &dyn Fn(usize) -> f64,
    ) -> f64 {
        let mut ends = vec![0.0_f64; self.count()];
        let mut completed = vec![0.0_f64; self.chunks.len()];
        let mut order: Vec<usize> = (0..self.count()).collect();
        order.sort_by_cached_key(|&tile| self.turn(tile));
        for tile in order {
            let before = self.neighbours(tile).filter(|&other| self.precedes(other, tile));
            ends[tile] = before.map(|other| ends[other]).fold(fill(tile), f64::max) + add(tile);
            let chunks = self.chunks_of(tile);
            completed[chunks].iter_mut().for_each(|end| *end = end.max(ends[tile]));
        }
        let ends = completed.into_iter().zip(&self.chunks);
        ends.map(|(end, chunk)| end + complete(chunk.rows.len())).fold(0.0, f64::max)
    }
}
