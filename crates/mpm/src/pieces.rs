//! Overlapping pieces of one array, changed by several threads in an order that is fixed wherever two overlap.
//!
//! The array is cut into bands. A piece is a band and the next one, so that it overlaps with the pieces of its neighbours.
//! Every other piece is early, those between are late: a late one is handed out when the early ones beside it are done.
//! The argument why no two threads have the same element is here.

#![allow(unsafe_code, reason = "overlapping pieces of one array, changed by several threads")]

use std::marker::PhantomData;
use std::ops::Range;
use std::slice;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Which pieces were taken, and how many of them are done with each band of the array.
#[derive(Debug, Default)]
pub(crate) struct Turns {
    /// For each band of the array how many pieces are done with it.
    done: Vec<usize>,
    /// For each piece whether it was handed out.
    taken: Vec<bool>,
    /// How many pieces are out.
    out: usize,
}

/// Where a piece stands among those that cover one band of the array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Turn {
    /// How many of them come before it.
    before: usize,
    /// How many of them there are.
    all: usize,
}

/// What there is to be taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Take {
    /// The piece that starts with this band.
    Band(usize),
    /// Nothing before somebody is done with a piece.
    Later,
    /// Nothing: all pieces were taken and are done.
    Nothing,
}

/// The number of bands of `band_length` in `length`, and so of pieces: the last band has what is left over as well.
pub(crate) fn count(length: usize, band_length: usize) -> usize {
    (length / band_length.max(1)).max(1)
}

/// Whether a piece comes after its neighbours. That of the last band is early, and so the late one before it completes both.
fn is_late(bands: usize, band: usize) -> bool {
    (bands - band).is_multiple_of(2)
}

/// The bands of the array that a piece covers.
fn covered(bands: usize, band: usize) -> Range<usize> {
    band..bands.min(band + 2)
}

/// The turn of a piece at a band of the array that it covers.
fn turn(bands: usize, band: usize, of: usize) -> Turn {
    // The lowest band of the array is covered by its own piece alone.
    let all = if of == 0 { 1 } else { 2 };
    Turn { before: if is_late(bands, band) { all - 1 } else { 0 }, all }
}

impl Turns {
    /// For nothing taken of as many pieces as bands.
    fn start(&mut self, bands: usize) {
        self.done.clear();
        self.done.resize(bands, 0);
        self.taken.clear();
        self.taken.resize(bands, false);
        self.out = 0;
    }

    /// The order of taking: each late piece soon after its neighbours, whose elements still lie in the cache. The `part`-th
    /// of `parts` threads begins at a place of its own, so that each stays among neighbours for long.
    fn order(&self, (part, parts): (usize, usize)) -> impl Iterator<Item = usize> + use<> {
        let bands = self.taken.len();
        // A late piece has the place two after its number, next after that of its upper neighbour, which is early.
        let places = bands + 2;
        let first = places * part / parts.max(1);
        let band = move |place: usize| {
            let is_late = is_late(places, place);
            let band = if is_late { place.checked_sub(2) } else { Some(place) };
            band.filter(|&band| band < bands)
        };
        (first..places).chain(0..first).filter_map(band)
    }

    /// Whether all pieces that come before are done with what a piece covers.
    fn is_free(&self, band: usize) -> bool {
        let bands = self.taken.len();
        covered(bands, band).all(|of| self.done[of] == turn(bands, band, of).before)
    }

    /// The first piece in order that is free, for one of some threads.
    fn take(&mut self, thread: (usize, usize)) -> Take {
        let mut left = self.order(thread).filter(|&band| !self.taken[band]);
        if let Some(band) = left.find(|&band| self.is_free(band)) {
            self.taken[band] = true;
            self.out += 1;
            return Take::Band(band);
        }
        if self.out > 0 { Take::Later } else { Take::Nothing }
    }

    /// Gives up a piece.
    fn give_up(&mut self, band: usize) {
        let bands = self.taken.len();
        covered(bands, band).for_each(|of| self.done[of] += 1);
        self.out -= 1;
    }
}

/// Times a thread that finds no free piece looks again before it leaves the rest to those who have pieces now.
///
/// A sleeping thread would take long to wake up. But it must not wait for ever: who has a piece may be the same thread, which
/// came here from its own work on it, by a loop on the pool there.
const LOOKS: usize = 1 << 14;

/// The pieces of an array that nobody has taken yet.
pub(crate) struct Pieces<'a, N> {
    turns: Mutex<&'a mut Turns>,
    bands: usize,
    first: *mut N,
    length: usize,
    band_length: usize,
    borrowed: PhantomData<&'a mut [N]>,
}

// SAFETY: what threads reach through a shared reference are the pieces, of which no two that are out overlap; they are
// exclusive slices, for which `Send` is what is asked.
unsafe impl<N: Send> Sync for Pieces<'_, N> {}

impl<'a, N> Pieces<'a, N> {
    /// The pieces of `array`, for bands of `band_length` elements; the last one has what is left over as well. What is in
    /// `turns` does not matter; it is room.
    pub(crate) fn new(array: &'a mut [N], band_length: usize, turns: &'a mut Turns) -> Self {
        let bands = count(array.len(), band_length);
        turns.start(bands);
        let (first, length) = (array.as_mut_ptr(), array.len());
        let turns = Mutex::new(turns);
        Self { turns, bands, first, length, band_length, borrowed: PhantomData }
    }

    fn turns(&self) -> MutexGuard<'_, &'a mut Turns> {
        self.turns.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The next piece for the `part`-th of `parts` threads. `None` where all pieces are done, or where those that are left
    /// wait for others for longer than is worth waiting: who has one has to ask again when it is done.
    pub(crate) fn take(&self, (part, parts): (usize, usize)) -> Option<Piece<'_, 'a, N>> {
        for _ in 0..LOOKS {
            let take = self.turns().take((part, parts));
            match take {
                Take::Band(band) => return Some(Piece { pieces: self, band }),
                Take::Nothing => return None,
                Take::Later => std::thread::yield_now(),
            }
        }
        None
    }

    /// The indices of the elements in some bands of the array.
    fn range(&self, bands: Range<usize>) -> Range<usize> {
        let index = |band| if band < self.bands { band * self.band_length } else { self.length };
        index(bands.start)..index(bands.end)
    }
}

/// A band of an array and the next one, for one thread alone until it is dropped.
pub(crate) struct Piece<'p, 'a, N> {
    pieces: &'p Pieces<'a, N>,
    band: usize,
}

impl<N> Piece<'_, '_, N> {
    /// Number of the band that the piece starts with.
    pub(crate) fn band(&self) -> usize {
        self.band
    }

    /// The elements, and the index of the first of them in the array.
    pub(crate) fn elements(&mut self) -> (&mut [N], usize) {
        let Self { pieces, band } = *self;
        let range = pieces.range(covered(pieces.bands, band));
        // SAFETY: the range lies in the array, which is borrowed for 'a: bands ascend to at most the last one, and with them
        // `Pieces::range` to the length of the array. A piece is handed out once (`taken`), and a band of the array is covered
        // by two pieces at most, neighbours, of which one is early and one is late. The late one is handed out where the early
        // one has given up all that both cover (`is_free`), which it does when it is dropped. So of all pieces that are out no
        // two overlap. What one wrote the next one sees: both pass through the mutex. `&mut self` lets one slice at a
        // time be reached.
        let elements =
            unsafe { slice::from_raw_parts_mut(pieces.first.add(range.start), range.len()) };
        (elements, range.start)
    }

    /// The elements in those bands of the array for which `choose` is true of the turn: the first ones of the piece.
    fn chosen(&mut self, choose: impl Fn(Turn) -> bool) -> (&mut [N], usize) {
        let Self { pieces, band } = *self;
        let bands =
            covered(pieces.bands, band).take_while(|&of| choose(turn(pieces.bands, band, of)));
        let length = pieces.range(band..band + bands.count()).len();
        let (elements, first) = self.elements();
        (&mut elements[..length], first)
    }

    /// The elements that no piece covered before this one, and the index of the first of them in the array.
    pub(crate) fn fresh(&mut self) -> (&mut [N], usize) {
        self.chosen(|turn| turn.before == 0)
    }

    /// The elements that no piece is to cover after this one, and the index of the first of them in the array.
    pub(crate) fn complete(&mut self) -> (&mut [N], usize) {
        self.chosen(|turn| turn.before + 1 == turn.all)
    }
}

impl<N> Drop for Piece<'_, '_, N> {
    fn drop(&mut self) {
        self.pieces.turns().give_up(self.band);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    /// Bands and lengths of arrays: one band, a last one with more than the others, an even and an odd number.
    const ARRAYS: [(usize, usize); 6] = [(3, 1), (3, 3), (3, 8), (3, 9), (2, 11), (4, 22)];

    /// The pieces as one of some threads takes them, alone.
    fn alone(bands: usize, thread: (usize, usize)) -> Vec<usize> {
        let mut turns = Turns::default();
        turns.start(bands);
        let take = |_| match turns.take(thread) {
            Take::Band(band) => {
                turns.give_up(band);
                Some(band)
            }
            Take::Later | Take::Nothing => None,
        };
        std::iter::repeat(()).map_while(take).collect()
    }

    #[test]
    fn a_thread_alone_takes_each_piece_once_and_late_ones_soon_after_their_neighbours() {
        assert_eq!(alone(1, (0, 1)), [0]);
        assert_eq!(alone(2, (0, 1)), [1, 0]);
        assert_eq!(alone(7, (0, 1)), [0, 2, 1, 4, 3, 6, 5]);
        assert_eq!(alone(6, (0, 1)), [1, 0, 3, 2, 5, 4]);
        // From the middle on; what waits for pieces further down comes last, and there again what is nearest to the middle.
        assert_eq!(alone(7, (1, 2)), [4, 6, 5, 0, 2, 3, 1]);
        for (bands, thread) in [(1, (3, 4)), (2, (1, 3)), (9, (2, 3)), (40, (6, 7)), (3, (0, 0))] {
            let taken = alone(bands, thread);
            assert_eq!(taken.len(), bands);
            assert_eq!(taken.into_iter().collect::<HashSet<_>>().len(), bands);
        }
    }

    #[test]
    fn pieces_that_overlap_are_never_out_together() {
        for bands in 1..=7 {
            let mut turns = Turns::default();
            turns.start(bands);
            assert_eq!(turns.done.len(), bands);
            let mut over = vec![vec![]; bands];
            // All that are free at once, given up before the next are asked for.
            let mut rounds = 0;
            while turns.taken.contains(&false) {
                let mut out = vec![];
                while let Take::Band(band) = turns.take((0, 1)) {
                    out.push(band);
                }
                let ends = covered(bands, bands - 1);
                assert_eq!(ends, bands - 1..bands);
                for (i, &a) in out.iter().enumerate() {
                    assert!(out[..i].iter().all(|&b| a.abs_diff(b) >= 2), "{out:?}");
                    covered(bands, a).for_each(|of| over[of].push(a));
                }
                assert_eq!(turns.take((0, 1)), Take::Later);
                out.into_iter().for_each(|band| turns.give_up(band));
                rounds += 1;
            }
            assert_eq!((turns.take((0, 1)), rounds), (Take::Nothing, bands.min(2)));
            for (of, by) in over.iter().enumerate() {
                let expected = if of == 0 { vec![0] } else { vec![of - 1, of] };
                assert_eq!(
                    by.iter().copied().collect::<HashSet<_>>(),
                    expected.into_iter().collect()
                );
                for (place, &band) in by.iter().enumerate() {
                    assert_eq!(turn(bands, band, of), Turn { before: place, all: by.len() });
                }
            }
        }
    }

    /// What a piece adds to its elements depends on what they are: sums that any other order would change.
    fn add(elements: &mut [u64], band: usize) {
        elements.iter_mut().for_each(|element| *element = 10 * *element + band as u64 + 1);
    }

    /// Run under Miri too: `cargo +nightly miri test -p mmsmith-mpm pieces`.
    #[test]
    fn threads_change_an_array_as_one_does() {
        for (band_length, length) in ARRAYS {
            let mut turns = Turns::default();
            let mut arrays = vec![];
            for threads in [1, 2, 3] {
                // What a run before left over is of no importance.
                let mut array: Vec<_> = (7..7 + length as u64).collect();
                let completed = Mutex::new(vec![0; length]);
                let pieces = Pieces::new(&mut array, band_length, &mut turns);
                std::thread::scope(|scope| {
                    for thread in 0..threads {
                        let (pieces, completed) = (&pieces, &completed);
                        scope.spawn(move || {
                            while let Some(mut piece) = pieces.take((thread, threads)) {
                                piece.fresh().0.fill(0);
                                let (band, (elements, first)) = (piece.band(), piece.elements());
                                assert_eq!(first, band * band_length);
                                add(elements, band);
                                let (complete, first) = piece.complete();
                                let mut completed = completed.lock().unwrap();
                                for (n, element) in complete.iter_mut().enumerate() {
                                    *element += 1000;
                                    completed[first + n] += 1;
                                }
                            }
                        });
                    }
                });
                assert!(pieces.take((0, 1)).is_none());
                assert_eq!(completed.into_inner().unwrap(), vec![1; length]);
                arrays.push(array);
            }
            assert!(arrays.iter().all(|array| *array == arrays[0]), "{arrays:?}");
            let bands = (length / band_length).max(1);
            for (n, &element) in arrays[0].iter().enumerate() {
                let of = (n / band_length).min(bands - 1);
                let (own, below) = (of as u64 + 1, of as u64);
                let expected = match (of, is_late(bands, of)) {
                    (0, _) => own,
                    (_, true) => 10 * below + own,
                    (_, false) => 10 * own + below,
                };
                assert_eq!(element, 1000 + expected, "{n} of {length}");
            }
        }
    }

    #[test]
    fn a_thread_that_has_a_piece_itself_is_not_kept_waiting_for_ever() {
        let (mut array, mut turns) = ([0; 6], Turns::default());
        let pieces = Pieces::new(&mut array, 2, &mut turns);
        let first = pieces.take((0, 1)).unwrap();
        let third = pieces.take((0, 1)).unwrap();
        assert_eq!((first.band(), third.band()), (0, 2));
        assert!(pieces.take((0, 1)).is_none());
        drop((first, third));
        assert_eq!(pieces.take((0, 1)).unwrap().band(), 1);
        assert!(pieces.take((0, 1)).is_none());
    }

    #[test]
    fn a_panic_gives_a_piece_up() {
        let (mut array, mut turns) = ([0; 4], Turns::default());
        let pieces = Pieces::new(&mut array, 2, &mut turns);
        let panicked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            let piece = pieces.take((0, 1)).unwrap();
            panic!("{}", piece.band());
        }));
        assert!(panicked.is_err());
        assert_eq!(pieces.take((0, 1)).unwrap().band(), 0);
    }
}
