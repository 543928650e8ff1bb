//! The layers of tiles that a process holds, and the segments of the array that it shares with other processes.
//!
//! The window of a layer covers its own segment of the array and reaches into the next one. A process holds some successive layers, and the
//! segments that they cover. Of these it shares the first with the layer below, and the last with the layer above, where other processes hold
//! those. Layers take turns by two colours, so that all processes agree which sums come first.

use std::ops::Range;

/// The layers that a process holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Held {
    /// Their numbers, each that of its first segment.
    pub layers: Range<usize>,
    /// The number of segments of the whole array, and so of layers.
    pub all: usize,
}

/// A segment that a layer here and a layer of another process cover.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shared {
    /// Whether the other layer is the one below.
    pub is_below: bool,
    /// Which of all segments it is.
    pub segment: usize,
    /// Whether the layer here comes first: the other one then completes the segment.
    pub is_first_here: bool,
}

impl Held {
    /// All layers of an array of so many segments.
    pub fn whole(segments: usize) -> Self {
        Self { layers: 0..segments, all: segments }
    }

    /// The segments that the layers cover.
    pub fn segments(&self) -> Range<usize> {
        self.layers.start..self.all.min(self.layers.end + 1)
    }

    /// The segments that other processes' layers cover as well.
    pub fn shared(&self) -> impl Iterator<Item = Shared> + use<> {
        let Self { layers: Range { start, end }, all } = *self;
        let below = (start > 0).then_some((true, start, start));
        let above = (end < all).then_some((false, end, end - 1));
        below.into_iter().chain(above).map(move |(is_below, segment, own)| Shared {
            is_below,
            segment,
            is_first_here: !is_second(all, own),
        })
    }

    /// Whether a layer comes after its neighbours.
    pub(crate) fn is_second(&self, layer: usize) -> bool {
        is_second(self.all, layer)
    }

    /// The order of work on the layers here: each second one soon after its neighbours, which it waits for. The first so many of them
    /// are those that other processes wait for, with the neighbours here that these wait for.
    pub(crate) fn order(&self) -> (Vec<usize>, usize) {
        let Range { start, end } = self.layers;
        let mut order = Vec::new();
        let mut push = |layer: usize| {
            if self.layers.contains(&layer) && !order.contains(&layer) {
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
        let mut places: Vec<usize> = self.layers.clone().collect();
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

    #[test]
    fn second_layers_come_soon_after_their_neighbours() {
        let order = |layers, all| Held { layers, all }.order();
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
                let [below, above] = [0..cut, cut..all].map(|layers| Held { layers, all });
                let (low, high): (Vec<_>, Vec<_>) =
                    (below.shared().collect(), above.shared().collect());
                let ([low], [high]) = (&low[..], &high[..]) else { panic!("{low:?} {high:?}") };
                assert_eq!((low.segment, high.segment), (cut, cut));
                assert!(high.is_below && !low.is_below);
                assert_ne!(low.is_first_here, high.is_first_here);
                assert_eq!(below.segments(), 0..cut + 1);
                assert_eq!(above.segments(), cut..all);
            }
        }
    }
}
