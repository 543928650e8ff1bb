//! The tiles of an array, whose windows overlap: which of them wait for which others, and which elements are complete with them.

use std::ops::Range;

use crate::held::{Held, Shared};

/// The tiles of an array: pieces along each axis, whose windows are ranges of elements. Layers are the pieces along the last axis, and a row has all
/// elements with one index along it.
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
    /// The tiles here in the order of work, and how many of them other processes wait for.
    pub(crate) order: Vec<usize>,
    pub(crate) awaited: usize,
    pub(crate) chunks: Vec<Chunk>,
    elements: Elements,
    /// How many strips all chunks have.
    pub(crate) strips: usize,
}

/// Some successive rows of a segment, which are completed together.
#[derive(Clone, Debug)]
pub(crate) struct Chunk {
    pub(crate) segment: usize,
    pub(crate) rows: Range<usize>,
    /// How many tiles here have windows that reach into the segment.
    pub(crate) tiles: usize,
    /// The number of its first strip, among those of all chunks.
    first_strip: usize,
    /// How many strips it has, which are cleared one by one: more than one where it is one long row.
    strips: usize,
}

/// How many elements there are to work on.
#[derive(Clone, Copy, Debug)]
pub struct Elements {
    /// In a row.
    pub row: usize,
    /// Cleared together, and completed together but for longer rows.
    pub at_once: usize,
}

impl Elements {
    /// How many rows are completed together.
    fn rows(self) -> usize {
        (self.at_once / self.row.max(1)).max(1)
    }
}

impl<const D: usize> TileLattice<D> {
    /// The lattice of these windows along each axis, and the layers `held` here along the last axis.
    ///
    /// # Panics
    ///
    /// Where windows along an axis do not ascend, or those along the last axis overlap with more than their neighbours, or leave rows out.
    pub fn new(windows: [Vec<Range<usize>>; D], held: Held, elements: Elements) -> Self {
        // What the unsafe code relies on.
        assert!(elements.at_once > 0);
        let reach = windows.each_ref().map(|windows| {
            assert!(windows.windows(2).all(|w| w[0].start <= w[1].start && w[0].end <= w[1].end));
            let apart = |by: usize| {
                windows.iter().zip(windows.iter().skip(by)).all(|(a, b)| a.end <= b.start)
            };
            (1..=windows.len()).find(|&by| apart(by)).unwrap_or(1).max(1) - 1
        });
        assert!(reach[D - 1] <= 1 && held.all == windows[D - 1].len());
        assert!(windows[D - 1].windows(2).all(|w| w[1].start <= w[0].end));
        let mut own = Self {
            windows,
            reach,
            held,
            predecessors: Vec::new(),
            order: Vec::new(),
            awaited: 0,
            chunks: Vec::new(),
            elements,
            strips: 0,
        };
        own.predecessors = (0..own.count())
            .map(|tile| {
                own.neighbours(tile).filter(|&other| own.precedes(other, tile)).count() as u16
            })
            .collect();
        let (layers, awaited) = own.held.order();
        let in_a_layer = own.in_a_layer();
        own.awaited = awaited * in_a_layer;
        own.order = layers
            .into_iter()
            .flat_map(|layer| {
                let first = (layer - own.held.layers.start) * in_a_layer;
                first..first + in_a_layer
            })
            .collect();
        for segment in own.held.segments() {
            let all = own.segment(segment);
            for first in all.clone().step_by(elements.rows()) {
                let rows = first..all.end.min(first + elements.rows());
                let strips = (rows.len() * elements.row).div_ceil(elements.at_once);
                let first_strip = own.strips;
                own.chunks.push(Chunk { segment, rows, tiles: 0, first_strip, strips });
                own.strips += strips;
            }
        }
        for tile in 0..own.count() {
            let range = own.chunks_of(tile);
            own.chunks[range].iter_mut().for_each(|chunk| chunk.tiles += 1);
        }
        own
    }

    /// The layers of tiles here.
    pub fn held(&self) -> &Held {
        &self.held
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

    /// The strips of a chunk, each with its number and its elements from the beginning of the chunk on; of a tile those alone where its window has
    /// elements of the chunk.
    pub(crate) fn strips_of(
        &self,
        chunk: &Chunk,
        strides: &[usize; D],
        tile: Option<usize>,
    ) -> impl Iterator<Item = (usize, Range<usize>)> + use<D> {
        let (at_once, first) = (self.elements.at_once, chunk.first_strip);
        let end = chunk.rows.len() * strides[D - 1];
        // A chunk of several rows is one strip.
        let window = match tile.map(|tile| self.window(tile)) {
            Some(window) if D > 1 && chunk.strips > 1 => {
                let along = &window[D - 2];
                along.start * strides[D - 2]..along.end * strides[D - 2]
            }
            _ => 0..end,
        };
        (window.start / at_once..window.end.div_ceil(at_once).min(chunk.strips))
            .map(move |strip| (first + strip, strip * at_once..end.min((strip + 1) * at_once)))
    }

    /// Number of tiles here.
    pub fn count(&self) -> usize {
        self.held.layers.len() * self.in_a_layer()
    }

    /// Number of tiles in a layer.
    fn in_a_layer(&self) -> usize {
        self.windows[..D - 1].iter().map(Vec::len).product()
    }

    /// The pieces of a tile along each axis; layers count from the first of all.
    fn pieces(&self, tile: usize) -> [usize; D] {
        let mut rest = tile + self.held.layers.start * self.in_a_layer();
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

    /// How many elements a row has.
    pub(crate) fn row(&self) -> usize {
        self.elements.row
    }

    /// The end of all windows along an axis.
    pub(crate) fn end(&self, axis: usize) -> usize {
        self.windows[axis].last().map_or(0, |window| window.end)
    }

    /// Number of elements in the window of a tile here.
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
        let around: [Range<usize>; D] = std::array::from_fn(|a| {
            let all = if a == D - 1 { self.held.layers.clone() } else { 0..self.windows[a].len() };
            let (first, end) =
                (pieces[a].saturating_sub(self.reach[a]), pieces[a] + self.reach[a] + 1);
            first.max(all.start)..end.min(all.end)
        });
        let count: usize = around.iter().map(ExactSizeIterator::len).product();
        let found = (0..count).map(move |number| {
            let (mut rest, mut other, mut stride) = (number, 0, 1);
            for a in 0..D {
                let first = if a == D - 1 { self.held.layers.start } else { 0 };
                other += (around[a].start - first + rest % around[a].len()) * stride;
                rest /= around[a].len();
                stride *= self.windows[a].len();
            }
            other
        });
        found.filter(move |&other| other != tile)
    }

    /// The tiles here that overlap with a tile and come after it.
    pub(crate) fn successors(&self, tile: usize) -> impl Iterator<Item = usize> + '_ {
        self.neighbours(tile).filter(move |&other| self.precedes(tile, other))
    }

    /// The tiles here of the layer that adds to a shared segment.
    pub(crate) fn adding_to(&self, shared: Shared) -> Range<usize> {
        let layer = if shared.is_below { shared.segment } else { shared.segment - 1 };
        let first = (layer - self.held.layers.start) * self.in_a_layer();
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
