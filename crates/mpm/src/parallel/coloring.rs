//! Two-colour schedule of overlapping bands of one array: threads change it in an order that is fixed wherever bands overlap.
//!
//! The array is cut into segments. A band is a segment and the next one, so it overlaps with the bands of its neighbours. Bands
//! alternate between two colours. A band of the second colour waits for its neighbours of the first colour; bands of one
//! colour never overlap. The safety argument for the mutable slices is in this file.

#![allow(unsafe_code, reason = "overlapping bands of one array, changed by several threads")]

use std::marker::PhantomData;
use std::ops::Range;
use std::slice;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Progress of the bands: taken or not, and released segments.
#[derive(Debug, Default)]
pub(crate) struct Schedule {
    /// For each segment the number of bands that have released it.
    released: Vec<usize>,
    /// For each band whether a thread has taken it.
    taken: Vec<bool>,
    /// Number of bands that threads hold at present.
    held: usize,
}

/// Position of a band among the bands that cover one segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Visit {
    /// Bands that come before it.
    before: usize,
    /// All bands that cover the segment.
    all: usize,
}

/// The answer to a thread that asks for a band.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Next {
    /// The band that starts with this segment.
    Band(usize),
    /// No band is ready until another thread releases one.
    Wait,
    /// All bands are taken and released.
    Done,
}

/// The number of segments of `segment_length` in `length`, and so of bands; the last segment has the remainder as well.
pub(crate) fn count(length: usize, segment_length: usize) -> usize {
    (length / segment_length.max(1)).max(1)
}

/// Whether a band comes after its neighbours. The band of the last segment has the first colour, so that the band before it
/// completes both.
fn is_second_color(segments: usize, segment: usize) -> bool {
    (segments - segment).is_multiple_of(2)
}

/// The segments that a band covers.
fn covered(segments: usize, segment: usize) -> Range<usize> {
    segment..segments.min(segment + 2)
}

/// The position of a band among those that cover segment `of`.
fn visit(segments: usize, segment: usize, of: usize) -> Visit {
    // The lowest segment of the array is covered by its own band alone.
    let all = if of == 0 { 1 } else { 2 };
    Visit { before: if is_second_color(segments, segment) { all - 1 } else { 0 }, all }
}

impl Schedule {
    /// Resets to as many untaken bands as segments.
    fn start(&mut self, segments: usize) {
        self.released.clear();
        self.released.resize(segments, 0);
        self.taken.clear();
        self.taken.resize(segments, false);
        self.held = 0;
    }

    /// The order of taking: each band of the second colour soon after its neighbours, whose elements still lie in the cache.
    /// The `part`-th of `parts` threads begins at a place of its own, so that each stays among neighbours for long.
    fn order(&self, (part, parts): (usize, usize)) -> impl Iterator<Item = usize> + use<> {
        let segments = self.taken.len();
        // A band of the second colour has the place two after its number, next after that of its upper neighbour.
        let places = segments + 2;
        let first = places * part / parts.max(1);
        let segment = move |place: usize| {
            let is_second = is_second_color(places, place);
            let segment = if is_second { place.checked_sub(2) } else { Some(place) };
            segment.filter(|&segment| segment < segments)
        };
        (first..places).chain(0..first).filter_map(segment)
    }

    /// Whether all earlier bands have released the segments of a band.
    fn is_ready(&self, segment: usize) -> bool {
        let segments = self.taken.len();
        covered(segments, segment)
            .all(|of| self.released[of] == visit(segments, segment, of).before)
    }

    /// The first band in order that is ready, for one of some threads.
    fn take(&mut self, thread: (usize, usize)) -> Next {
        let mut left = self.order(thread).filter(|&segment| !self.taken[segment]);
        if let Some(segment) = left.find(|&segment| self.is_ready(segment)) {
            self.taken[segment] = true;
            self.held += 1;
            return Next::Band(segment);
        }
        if self.held > 0 { Next::Wait } else { Next::Done }
    }

    /// Releases a band.
    fn release(&mut self, segment: usize) {
        let segments = self.taken.len();
        covered(segments, segment).for_each(|of| self.released[of] += 1);
        self.held -= 1;
    }
}

/// Times a thread asks again for a ready band before it leaves the rest to the threads that hold bands.
///
/// A sleeping thread would take long to wake up. Waiting without end could deadlock: the holder of a band may be the same
/// thread, which came here from its own work on that band by a loop on the pool.
const ATTEMPTS: usize = 1 << 14;

/// The bands of an array.
pub(crate) struct ColoredBands<'a, N> {
    schedule: Mutex<&'a mut Schedule>,
    segments: usize,
    first: *mut N,
    length: usize,
    segment_length: usize,
    borrowed: PhantomData<&'a mut [N]>,
}

// SAFETY: threads reach bands through a shared reference, and no two bands that are held overlap; bands are exclusive slices,
// for which `Send` is the requirement.
unsafe impl<N: Send> Sync for ColoredBands<'_, N> {}

impl<'a, N> ColoredBands<'a, N> {
    /// The bands of `array`, for segments of `segment_length` elements; the last one has the remainder as well. `schedule` is
    /// a buffer; its contents do not matter.
    pub(crate) fn new(
        array: &'a mut [N],
        segment_length: usize,
        schedule: &'a mut Schedule,
    ) -> Self {
        let segments = count(array.len(), segment_length);
        schedule.start(segments);
        let (first, length) = (array.as_mut_ptr(), array.len());
        let schedule = Mutex::new(schedule);
        Self { schedule, segments, first, length, segment_length, borrowed: PhantomData }
    }

    fn schedule(&self) -> MutexGuard<'_, &'a mut Schedule> {
        self.schedule.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The next band for the `part`-th of `parts` threads. `None` where all bands are released, or where the bands left wait for
    /// longer than is worth waiting: the thread that holds their neighbour takes them next.
    pub(crate) fn take(&self, (part, parts): (usize, usize)) -> Option<Band<'_, 'a, N>> {
        for _ in 0..ATTEMPTS {
            let next = self.schedule().take((part, parts));
            match next {
                Next::Band(segment) => return Some(Band { bands: self, segment }),
                Next::Done => return None,
                Next::Wait => std::thread::yield_now(),
            }
        }
        None
    }

    /// The indices of the elements in some segments.
    fn range(&self, segments: Range<usize>) -> Range<usize> {
        let index = |segment| {
            if segment < self.segments { segment * self.segment_length } else { self.length }
        };
        index(segments.start)..index(segments.end)
    }
}

/// A segment of an array and the next one, for one thread alone until it is dropped.
pub(crate) struct Band<'p, 'a, N> {
    bands: &'p ColoredBands<'a, N>,
    segment: usize,
}

impl<N> Band<'_, '_, N> {
    /// Number of the band's first segment.
    pub(crate) fn segment(&self) -> usize {
        self.segment
    }

    /// The elements, and the index of the first of them in the array.
    pub(crate) fn elements(&mut self) -> (&mut [N], usize) {
        let Self { bands, segment } = *self;
        let range = bands.range(covered(bands.segments, segment));
        // SAFETY: the range lies in the array, which is borrowed for 'a: segments ascend to at most the last one, and with them
        // `ColoredBands::range` to the length of the array. A band is handed out once (`taken`), and a segment is covered
        // by two bands at most, neighbours, of which one has the first colour and one the second. The second is handed out
        // after the first has released all that both cover (`is_ready`), which it does when it is dropped. So no two bands
        // that are held overlap. Writes of one are visible to the next: both pass through the mutex. `&mut self` lets one
        // slice at a time be reached.
        let elements =
            unsafe { slice::from_raw_parts_mut(bands.first.add(range.start), range.len()) };
        (elements, range.start)
    }

    /// The elements in the leading segments of the band for whose visit `choose` is true.
    fn leading(&mut self, choose: impl Fn(Visit) -> bool) -> (&mut [N], usize) {
        let Self { bands, segment } = *self;
        let segments = covered(bands.segments, segment)
            .take_while(|&of| choose(visit(bands.segments, segment, of)));
        let length = bands.range(segment..segment + segments.count()).len();
        let (elements, first) = self.elements();
        (&mut elements[..length], first)
    }

    /// The elements that no band covered before this one, and the index of the first of them in the array.
    pub(crate) fn first_touched(&mut self) -> (&mut [N], usize) {
        self.leading(|visit| visit.before == 0)
    }

    /// The elements that no band covers after this one, and the index of the first of them in the array.
    pub(crate) fn completed(&mut self) -> (&mut [N], usize) {
        self.leading(|visit| visit.before + 1 == visit.all)
    }
}

impl<N> Drop for Band<'_, '_, N> {
    fn drop(&mut self) {
        self.bands.schedule().release(self.segment);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    /// Lengths of segments and of arrays: one segment, a last one with more than the others, an even and an odd number.
    const ARRAYS: [(usize, usize); 6] = [(3, 1), (3, 3), (3, 8), (3, 9), (2, 11), (4, 22)];

    /// The bands as one of some threads takes them, alone.
    fn alone(segments: usize, thread: (usize, usize)) -> Vec<usize> {
        let mut schedule = Schedule::default();
        schedule.start(segments);
        let take = |_| match schedule.take(thread) {
            Next::Band(segment) => {
                schedule.release(segment);
                Some(segment)
            }
            Next::Wait | Next::Done => None,
        };
        std::iter::repeat(()).map_while(take).collect()
    }

    #[test]
    fn a_thread_alone_takes_each_band_once_and_second_ones_soon_after_their_neighbours() {
        assert_eq!(alone(1, (0, 1)), [0]);
        assert_eq!(alone(2, (0, 1)), [1, 0]);
        assert_eq!(alone(7, (0, 1)), [0, 2, 1, 4, 3, 6, 5]);
        assert_eq!(alone(6, (0, 1)), [1, 0, 3, 2, 5, 4]);
        // From the middle on; bands that wait for others further down come last, the nearest to the middle first.
        assert_eq!(alone(7, (1, 2)), [4, 6, 5, 0, 2, 3, 1]);
        for (segments, thread) in [(1, (3, 4)), (2, (1, 3)), (9, (2, 3)), (40, (6, 7)), (3, (0, 0))]
        {
            let taken = alone(segments, thread);
            assert_eq!(taken.len(), segments);
            assert_eq!(taken.into_iter().collect::<HashSet<_>>().len(), segments);
        }
    }

    #[test]
    fn bands_that_overlap_are_never_held_together() {
        for segments in 1..=7 {
            let mut schedule = Schedule::default();
            schedule.start(segments);
            assert_eq!(schedule.released.len(), segments);
            let mut over = vec![vec![]; segments];
            // All that are ready at once, released before the next are asked for.
            let mut rounds = 0;
            while schedule.taken.contains(&false) {
                let mut out = vec![];
                while let Next::Band(segment) = schedule.take((0, 1)) {
                    out.push(segment);
                }
                let ends = covered(segments, segments - 1);
                assert_eq!(ends, segments - 1..segments);
                for (i, &a) in out.iter().enumerate() {
                    assert!(out[..i].iter().all(|&b| a.abs_diff(b) >= 2), "{out:?}");
                    covered(segments, a).for_each(|of| over[of].push(a));
                }
                assert_eq!(schedule.take((0, 1)), Next::Wait);
                out.into_iter().for_each(|segment| schedule.release(segment));
                rounds += 1;
            }
            assert_eq!((schedule.take((0, 1)), rounds), (Next::Done, segments.min(2)));
            for (of, by) in over.iter().enumerate() {
                let expected = if of == 0 { vec![0] } else { vec![of - 1, of] };
                assert_eq!(
                    by.iter().copied().collect::<HashSet<_>>(),
                    expected.into_iter().collect()
                );
                for (place, &segment) in by.iter().enumerate() {
                    assert_eq!(
                        visit(segments, segment, of),
                        Visit { before: place, all: by.len() }
                    );
                }
            }
        }
    }

    /// The sums of a band depend on its elements, so that any other order would change them.
    fn add(elements: &mut [u64], segment: usize) {
        elements.iter_mut().for_each(|element| *element = 10 * *element + segment as u64 + 1);
    }

    /// Run under Miri too: `cargo +nightly miri test -p mmsmith-mpm coloring`.
    #[test]
    fn threads_change_an_array_as_one_does() {
        for (segment_length, length) in ARRAYS {
            let mut schedule = Schedule::default();
            let mut arrays = vec![];
            for threads in [1, 2, 3] {
                // Contents left over from an earlier run do not matter.
                let mut array: Vec<_> = (7..7 + length as u64).collect();
                let completed = Mutex::new(vec![0; length]);
                let bands = ColoredBands::new(&mut array, segment_length, &mut schedule);
                std::thread::scope(|scope| {
                    for thread in 0..threads {
                        let (bands, completed) = (&bands, &completed);
                        scope.spawn(move || {
                            while let Some(mut band) = bands.take((thread, threads)) {
                                band.first_touched().0.fill(0);
                                let (segment, (elements, first)) =
                                    (band.segment(), band.elements());
                                assert_eq!(first, segment * segment_length);
                                add(elements, segment);
                                let (elements, first) = band.completed();
                                let mut completed = completed.lock().unwrap();
                                for (n, element) in elements.iter_mut().enumerate() {
                                    *element += 1000;
                                    completed[first + n] += 1;
                                }
                            }
                        });
                    }
                });
                assert!(bands.take((0, 1)).is_none());
                assert_eq!(completed.into_inner().unwrap(), vec![1; length]);
                arrays.push(array);
            }
            assert!(arrays.iter().all(|array| *array == arrays[0]), "{arrays:?}");
            let segments = (length / segment_length).max(1);
            for (n, &element) in arrays[0].iter().enumerate() {
                let of = (n / segment_length).min(segments - 1);
                let (own, below) = (of as u64 + 1, of as u64);
                let expected = match (of, is_second_color(segments, of)) {
                    (0, _) => own,
                    (_, true) => 10 * below + own,
                    (_, false) => 10 * own + below,
                };
                assert_eq!(element, 1000 + expected, "{n} of {length}");
            }
        }
    }

    #[test]
    fn a_thread_that_holds_a_band_itself_is_not_kept_waiting_for_ever() {
        let (mut array, mut schedule) = ([0; 6], Schedule::default());
        let bands = ColoredBands::new(&mut array, 2, &mut schedule);
        let first = bands.take((0, 1)).unwrap();
        let third = bands.take((0, 1)).unwrap();
        assert_eq!((first.segment(), third.segment()), (0, 2));
        assert!(bands.take((0, 1)).is_none());
        drop((first, third));
        assert_eq!(bands.take((0, 1)).unwrap().segment(), 1);
        assert!(bands.take((0, 1)).is_none());
    }

    #[test]
    fn a_panic_releases_a_band() {
        let (mut array, mut schedule) = ([0; 4], Schedule::default());
        let bands = ColoredBands::new(&mut array, 2, &mut schedule);
        let panicked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            let band = bands.take((0, 1)).unwrap();
            panic!("{}", band.segment());
        }));
        assert!(panicked.is_err());
        assert_eq!(bands.take((0, 1)).unwrap().segment(), 0);
    }
}
