//! The tiles that each process holds, and the segments of the array that it shares with the processes below and above.
//!
//! Cuts along each axis divide the tiles among a grid of processes, each with a box of tiles. Along the last axis the pieces are layers. The
//! window of a layer covers its own segment of the array and reaches into the next one. A process has the segments that its layers cover. Of these it
//! shares the first with the layer below, and the last with the layer above, where other processes hold those. Layers take turns by two
//! colours, so that all processes agree which sums come first.

use std::ops::Range;

use crate::region::Region;

/// The cuts that divide tiles among processes: for each axis the first piece of each process, and the number of pieces. Processes are numbered along axis 0
/// first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cuts<const D: usize>(pub [Vec<usize>; D]);

impl<const D: usize> Cuts<D> {
    /// One process with so many pieces along each axis.
    pub fn none(pieces: [usize; D]) -> Self {
        Self(pieces.map(|pieces| vec![0, pieces]))
    }

    /// Number of processes along an axis.
    pub fn count(&self, axis: usize) -> usize {
        self.0[axis].len() - 1
    }

    /// Number of pieces along an axis.
    pub fn pieces(&self, axis: usize) -> usize {
        self.0[axis].last().copied().unwrap_or(0)
    }

    /// The places of the grid of processes.
    fn places(&self) -> Region<D> {
        Region(std::array::from_fn(|a| 0..self.count(a)))
    }

    /// The number of the process at a place of the grid of processes.
    pub fn rank(&self, at: &[usize; D]) -> usize {
        self.places().index(at)
    }

    /// The place of a process in the grid of processes.
    pub fn place(&self, rank: usize) -> [usize; D] {
        self.places().place(rank)
    }

    /// The process that holds the tile of these pieces.
    pub fn holder(&self, pieces: &[usize; D]) -> usize {
        let at = std::array::from_fn(|a| {
            self.0[a].partition_point(|&cut| cut <= pieces[a]).clamp(1, self.count(a)) - 1
        });
        self.rank(&at)
    }
}

/// The tiles that a process holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Held<const D: usize> {
    /// All processes.
    pub cuts: Cuts<D>,
    /// The place of this one.
    pub at: [usize; D],
}

/// A segment that a layer here and a layer of another process cover.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shared {
    /// The other process.
    pub process: usize,
    /// Whether the other layer is the one below.
    pub is_below: bool,
    /// Which of all segments it is.
    pub segment: usize,
    /// Whether the layer here comes first: the other one then completes the segment.
    pub is_first_here: bool,
}

impl<const D: usize> Held<D> {
    /// All tiles, of so many pieces along each axis.
    pub fn whole(pieces: [usize; D]) -> Self {
        Self { cuts: Cuts::none(pieces), at: [0; D] }
    }

    /// The tiles of a process.
    pub fn of(cuts: Cuts<D>, rank: usize) -> Self {
        let at = cuts.place(rank);
        Self { cuts, at }
    }

    /// The pieces along an axis of the process at a place along it.
    pub fn pieces_at(&self, axis: usize, at: usize) -> Range<usize> {
        let cuts = &self.cuts.0[axis];
        cuts[at]..cuts[at + 1]
    }

    /// The pieces here along an axis.
    pub fn pieces(&self, axis: usize) -> Range<usize> {
        self.pieces_at(axis, self.at[axis])
    }

    /// The process next to this one along an axis: the one above it, or the one below.
    pub fn neighbour(&self, axis: usize, is_above: bool) -> Option<usize> {
        let mut at = self.at;
        at[axis] = if is_above { at[axis] + 1 } else { at[axis].checked_sub(1)? };
        (at[axis] < self.cuts.count(axis)).then(|| self.cuts.rank(&at))
    }

    /// The layers here, each with the number of its first segment.
    pub fn layers(&self) -> Range<usize> {
        self.pieces(D - 1)
    }

    /// The number of layers, and so of segments, of the whole array.
    fn all(&self) -> usize {
        self.cuts.pieces(D - 1)
    }

    /// The segments that the layers cover.
    pub fn segments(&self) -> Range<usize> {
        let Range { start, end } = self.layers();
        start..self.all().min(end + 1)
    }

    /// The segments that other processes' layers cover as well.
    pub fn shared(&self) -> impl Iterator<Item = Shared> + use<D> {
        let (all, Range { start, end }) = (self.all(), self.layers());
        let below = self.neighbour(D - 1, false).map(|process| (process, true, start, start));
        let above = self.neighbour(D - 1, true).map(|process| (process, false, end, end - 1));
        below.into_iter().chain(above).map(move |(process, is_below, segment, own)| Shared {
            process,
            is_below,
            segment,
            is_first_here: !is_second(all, own),
        })
    }

    /// Whether a layer comes after its neighbours.
    pub(crate) fn is_second(&self, layer: usize) -> bool {
        is_second(self.all(), layer)
    }

    /// The order of work on the layers here: each second one soon after its neighbours, which it waits for. The first so many of them
    /// are those that other processes wait for, with the neighbours here that these wait for.
    pub(crate) fn order(&self) -> (Vec<usize>, usize) {
        let Range { start, end } = self.layers();
        let mut order = Vec::new();
        let mut push = |layer: usize| {
            if (start..end).contains(&layer) && !order.contains(&layer) {
                order.push(layer);
            }
        };
        for shared in self.shared() {
            let (own, neighbour) = match shared.is_below {
                true => (start, Some(start + 1)),
                false => (end - 1, (end - 1).checked_sub(1)),
            };
            if !shared.is_first_here {
                neighbour.into_iter().for_each(&mut push);
            }
            push(own);
        }
        let awaited = order.len();
        // A second layer has the place two after its number, next after that of its upper neighbour.
        let mut places: Vec<usize> = (start..end).collect();
        places.sort_by_key(|&layer| layer + if self.is_second(layer) { 2 } else { 0 });
        let known = order.clone();
        order.extend(places.into_iter().filter(|layer| !known.contains(layer)));
        (order, awaited)
    }
}

/// Whether one of `all` layers comes after its neighbours. The last layer comes first, so that the layer before it completes both.
fn is_second(all: usize, layer: usize) -> bool {
    (all + layer).is_multiple_of(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The layers of one process among others.
    fn held(layers: Range<usize>, all: usize) -> Held<1> {
        let mut cuts = vec![0, layers.start, layers.end, all];
        cuts.dedup();
        let at = cuts.iter().position(|&cut| cut == layers.start).unwrap();
        Held { cuts: Cuts([cuts]), at: [at] }
    }

    #[test]
    fn second_layers_come_soon_after_their_neighbours() {
        let order = |layers, all| held(layers, all).order();
        assert_eq!(order(0..1, 1), (vec![0], 0));
        assert_eq!(order(0..2, 2), (vec![1, 0], 0));
        assert_eq!(order(0..7, 7), (vec![0, 2, 1, 4, 3, 6, 5], 0));
        assert_eq!(order(0..6, 6), (vec![1, 0, 3, 2, 5, 4], 0));
        // Layer 4 comes first, and others wait for its sums; layer 1 waits for layer 2 and for the process below.
        assert_eq!(order(1..5, 7), (vec![2, 1, 4, 3], 3));
        assert_eq!(order(2..3, 7), (vec![2], 1));
    }

    #[test]
    fn of_two_processes_one_alone_comes_first_in_the_segment_that_they_share() {
        for all in 2..9 {
            for cut in 1..all {
                let [below, above] = [held(0..cut, all), held(cut..all, all)];
                let (low, high): (Vec<_>, Vec<_>) =
                    (below.shared().collect(), above.shared().collect());
                let ([low], [high]) = (&low[..], &high[..]) else { panic!("{low:?} {high:?}") };
                assert_eq!((low.segment, high.segment), (cut, cut));
                assert_eq!((low.process, high.process), (1, 0));
                assert!(high.is_below && !low.is_below);
                assert_ne!(low.is_first_here, high.is_first_here);
                assert_eq!(below.segments(), 0..cut + 1);
                assert_eq!(above.segments(), cut..all);
            }
        }
    }

    #[test]
    fn each_tile_has_one_holder() {
        let cuts = Cuts([vec![0, 2, 3], vec![0, 1, 4, 5], vec![0, 7]]);
        let mut found = vec![0; 6];
        for (x, y, z) in
            (0..3).flat_map(|x| (0..5).flat_map(move |y| (0..7).map(move |z| (x, y, z))))
        {
            let holder = cuts.holder(&[x, y, z]);
            let held = Held::of(cuts.clone(), holder);
            assert_eq!(cuts.rank(&held.at), holder);
            assert!([x, y, z].iter().enumerate().all(|(a, piece)| held.pieces(a).contains(piece)));
            found[holder] += 1;
        }
        assert_eq!(found, [14, 7, 42, 21, 14, 7]);
        let held = Held::of(cuts, 2);
        let of_axis = |axis| [false, true].map(|is_above| held.neighbour(axis, is_above));
        assert_eq!([0, 1, 2].map(of_axis), [[None, Some(3)], [Some(0), Some(4)], [None, None]]);
    }
}
