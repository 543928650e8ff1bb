//! Two-colour schedule of overlapping bands of one array: threads change it in an order that is fixed wherever bands overlap.
//!
//! The array is cut into segments. A band is a segment and the next one, so it overlaps with the bands of its neighbours. Bands
//! alternate between two colours. A band of the second colour waits for its neighbours of the first colour; bands of one
//! colour never overlap. The safety argument for the mutable slices is in this file.
//!
//! A process may hold some successive bands of an array whose others are held by other processes. It holds the segments that its bands
//! cover. Of these it shares the first with the band below, and the last with the band above: such a band counts as any other,
//! and [`ColoredBands::fill`] puts its sums in place.

#![allow(unsafe_code, reason = "overlapping bands of one array, changed by several threads")]

use std::marker::PhantomData;
use std::ops::Range;
use std::slice;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The bands that a process holds.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Held {
    /// Their numbers, each that of its first segment.
    pub bands: Range<usize>,
    /// The number of segments of the whole array, and so of bands.
    pub all: usize,
}

/// A segment that a band here and one of another process cover.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shared {
    /// Whether the other band is the one below.
    pub is_below: bool,
    /// Which of all segments it is.
    pub segment: usize,
    /// Whether the band here comes first: the other one then completes the segment.
    pub is_first_here: bool,
}

impl Held {
    /// All bands of an array of so many segments.
    pub fn whole(segments: usize) -> Self {
        Self { bands: 0..segments, all: segments }
    }

    /// The segments that the bands cover.
    pub fn segments(&self) -> Range<usize> {
        self.bands.start..self.all.min(self.bands.end + 1)
    }

    /// The segments that other processes' bands cover as well.
    pub fn shared(&self) -> impl Iterator<Item = Shared> + use<> {
        let Self { bands: Range { start, end }, all } = *self;
        let below = (start > 0).then_some((true, start, start));
        let above = (end < all).then_some((false, end, end - 1));
        below.into_iter().chain(above).map(move |(is_below, segment, own)| Shared {
            is_below,
            segment,
            is_first_here: !is_second_color(all, own),
        })
    }
}

/// Progress of the bands: taken or not, and released segments.
#[derive(Debug, Default)]
pub struct Schedule {
    of: Held,
    /// For each segment here the number of bands that have released it.
    released: Vec<usize>,
    /// For each band here whether a thread has taken it.
    taken: Vec<bool>,
    /// Number of bands that threads hold at present.
    held: usize,
    /// Whether the sums of the shared segment below and of that above have come, or are being taken.
    has_come: [bool; 2],
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

/// Whether a band comes after its neighbours. The band of the last segment has the first colour, so that the band before it
/// completes both.
fn is_second_color(segments: usize, segment: usize) -> bool {
    (segments + segment).is_multiple_of(2)
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
    /// Resets to untaken bands.
    fn start(&mut self, of: &Held) {
        self.of.clone_from(of);
        self.released.clear();
        self.released.resize(of.segments().len(), 0);
        self.taken.clear();
        self.taken.resize(of.bands.len(), false);
        self.held = 0;
        self.has_come = [false; 2];
    }

    fn is_taken(&self, band: usize) -> bool {
        self.taken[band - self.of.bands.start]
    }

    /// The order of taking: each band of the second colour soon after its neighbours, whose elements still lie in the cache.
    /// The `part`-th of `parts` threads begins at a place of its own, so that each stays among neighbours for long.
    ///
    /// Bands shared with other processes are taken first, since those processes wait for them.
    fn order(&self, (part, parts): (usize, usize)) -> impl Iterator<Item = usize> + use<> {
        let Held { bands, all } = self.of.clone();
        // A band of the second colour has the place two after its number, next after that of its upper neighbour.
        let places = bands.len() + 2;
        let first = places * part / parts.max(1);
        let mut awaited = [None; 4];
        for (own, shared) in awaited.chunks_exact_mut(2).zip(self.of.shared()) {
            let (band, neighbour) = match shared.is_below {
                true => (shared.segment, Some(shared.segment + 1)),
                false => (shared.segment - 1, shared.segment.checked_sub(2)),
            };
            // A band of the second colour waits for its neighbour here, too.
            let neighbour = neighbour.filter(|own| !shared.is_first_here && bands.contains(own));
            own.copy_from_slice(&[neighbour, Some(band)]);
        }
        let band = move |place: usize| {
            let band = bands.start + place;
            let is_second = is_second_color(all, band);
            let band = if is_second { band.checked_sub(2) } else { Some(band) };
            band.filter(|band| bands.contains(band))
        };
        awaited.into_iter().flatten().chain((first..places).chain(0..first).filter_map(band))
    }

    /// Whether all earlier bands have released the segments of a band.
    fn is_ready(&self, segment: usize) -> bool {
        let Held { bands, all } = &self.of;
        covered(*all, segment)
            .all(|of| self.released[of - bands.start] == visit(*all, segment, of).before)
    }

    /// The first band in order that is ready, for one of some threads.
    fn take(&mut self, thread: (usize, usize)) -> Next {
        let mut left = self.order(thread).filter(|&segment| !self.is_taken(segment));
        if let Some(segment) = left.find(|&segment| self.is_ready(segment)) {
            self.taken[segment - self.of.bands.start] = true;
            self.held += 1;
            return Next::Band(segment);
        }
        if self.held > 0 { Next::Wait } else { Next::Done }
    }

    /// Releases a band.
    fn release(&mut self, segment: usize) {
        let Held { bands, all } = &self.of;
        covered(*all, segment).for_each(|of| self.released[of - bands.start] += 1);
        self.held -= 1;
    }
}

/// Times a thread asks again for a ready band before it leaves the rest to the threads that hold bands.
///
/// A sleeping thread would take long to wake up. Waiting without end could deadlock: the holder of a band may be the same
/// thread, which came here from its own work on that band by a loop on the pool.
const ATTEMPTS: usize = 1 << 14;

/// The bands of an array.
pub struct ColoredBands<'a, N> {
    schedule: Mutex<&'a mut Schedule>,
    of: Held,
    first: *mut N,
    /// The index of the first element of each segment here, and the number of elements.
    starts: Vec<usize>,
    borrowed: PhantomData<&'a mut [N]>,
}

// SAFETY: threads reach bands through a shared reference, and no two bands that are held overlap; bands are exclusive slices,
// for which `Send` is the requirement.
unsafe impl<N: Send> Sync for ColoredBands<'_, N> {}

impl<'a, N> ColoredBands<'a, N> {
    /// The bands `of` of an array, for segments of any lengths. `array` are the segments that they cover, and `starts` the index of the
    /// first element of each of these, with the number of elements at the end. `schedule` is a buffer; its contents do not matter.
    ///
    /// # Panics
    ///
    /// Where `array` does not have the elements of those segments.
    pub fn new(
        array: &'a mut [N],
        starts: Vec<usize>,
        of: Held,
        schedule: &'a mut Schedule,
    ) -> Self {
        // What the unsafe code relies on.
        assert!(starts.is_sorted() && starts.len() == of.segments().len() + 1);
        assert!(starts.first() == Some(&0) && starts.last() == Some(&array.len()));
        schedule.start(&of);
        let (first, schedule) = (array.as_mut_ptr(), Mutex::new(schedule));
        Self { schedule, of, first, starts, borrowed: PhantomData }
    }

    /// The segments that bands of other processes cover as well.
    pub fn shared(&self) -> impl Iterator<Item = Shared> + use<N> {
        self.of.shared()
    }

    /// All elements, while no thread holds a band.
    pub fn all(&mut self) -> &mut [N] {
        // SAFETY: the array is borrowed for 'a, and bands that are held borrow `self`, which is exclusive here.
        unsafe { slice::from_raw_parts_mut(self.first, self.range(self.of.segments()).len()) }
    }

    /// Lets `fill` put the sums of another process in place, whose band comes first in a shared segment; that band has released the
    /// segment then. Once; what follows does nothing. True where it did something.
    pub fn fill(&self, shared: Shared, fill: impl FnOnce(&mut [N])) -> bool {
        // What the unsafe code relies on.
        assert!(!shared.is_first_here && self.of.shared().any(|known| known == shared));
        let has_come = |schedule: &mut Schedule| {
            std::mem::replace(&mut schedule.has_come[usize::from(shared.is_below)], true)
        };
        if has_come(&mut self.schedule()) {
            return false;
        }
        let range = self.range(shared.segment..shared.segment + 1);
        // SAFETY: as in `Band::elements` the range lies in the array. Of the bands here one alone covers the segment, which is not handed
        // out before the segment is released below (`is_ready`); this is reached once (`has_come`); and `&mut self` of other
        // functions excludes this one.
        fill(unsafe { slice::from_raw_parts_mut(self.first.add(range.start), range.len()) });
        self.schedule().released[shared.segment - self.of.bands.start] += 1;
        true
    }

    /// Whether the sums of a shared segment have not come yet.
    pub fn is_awaited(&self, shared: Shared) -> bool {
        !self.schedule().has_come[usize::from(shared.is_below)]
    }

    /// The elements of a segment that is shared, while no thread holds a band.
    pub fn of_shared(&mut self, shared: Shared) -> &mut [N] {
        let range = self.range(shared.segment..shared.segment + 1);
        // SAFETY: as in `Band::elements` the range lies in the array; bands that are held borrow `self`, which is exclusive here.
        unsafe { slice::from_raw_parts_mut(self.first.add(range.start), range.len()) }
    }

    fn schedule(&self) -> MutexGuard<'_, &'a mut Schedule> {
        self.schedule.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The next band for the `part`-th of `parts` threads. `None` where all bands are released, or where the bands left wait for
    /// longer than is worth waiting: the thread that holds their neighbour takes them next.
    pub fn take(&self, (part, parts): (usize, usize)) -> Option<Band<'_, 'a, N>> {
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

    /// The indices of the elements in some segments, of those here.
    fn range(&self, segments: Range<usize>) -> Range<usize> {
        let first = self.of.segments().start;
        self.starts[segments.start - first]..self.starts[segments.end - first]
    }
}

/// A segment of an array and the next one, for one thread alone until it is dropped.
pub struct Band<'p, 'a, N> {
    bands: &'p ColoredBands<'a, N>,
    segment: usize,
}

impl<N> Band<'_, '_, N> {
    /// Number of the band's first segment, in the whole array.
    pub fn segment(&self) -> usize {
        self.segment
    }

    /// The elements, and the index of the first of them in the array.
    pub fn elements(&mut self) -> (&mut [N], usize) {
        let Self { bands, segment } = *self;
        let range = bands.range(covered(bands.of.all, segment));
        // SAFETY: the range lies in the array, which is borrowed for 'a: `starts` ascends from 0 to the
        // length of the array, which `ColoredBands::new` has checked. A band is handed out once (`taken`), and a segment is covered
        // by two bands at most, neighbours, of which one has the first colour and one the second. The second is handed out
        // after the first has released all that both cover (`is_ready`), which it does when it is dropped. So no two bands
        // that are held overlap. Writes of one are visible to the next: both pass through the mutex. `&mut self` lets one
        // slice at a time be reached.
        let elements =
            unsafe { slice::from_raw_parts_mut(bands.first.add(range.start), range.len()) };
        (elements, range.start)
    }

    /// The segments of the band, and the elements of each.
    pub fn segments(&mut self) -> impl Iterator<Item = (usize, &[N])> {
        let Self { bands, segment } = *self;
        let (elements, first) = self.elements();
        let elements = &*elements;
        covered(bands.of.all, segment).map(move |of| {
            let range = bands.range(of..of + 1);
            (of, &elements[range.start - first..range.end - first])
        })
    }

    /// The elements in the leading segments of the band for whose visit `choose` is true.
    fn leading(&mut self, choose: impl Fn(Visit) -> bool) -> (&mut [N], usize) {
        let Self { bands, segment } = *self;
        let all = bands.of.all;
        let segments = covered(all, segment).take_while(|&of| choose(visit(all, segment, of)));
        let length = bands.range(segment..segment + segments.count()).len();
        let (elements, first) = self.elements();
        (&mut elements[..length], first)
    }

    /// The elements that no band covered before this one, and the index of the first of them in the array.
    pub fn first_touched(&mut self) -> (&mut [N], usize) {
        self.leading(|visit| visit.before == 0)
    }

    /// The elements that no band covers after this one, and the index of the first of them in the array.
    pub fn completed(&mut self) -> (&mut [N], usize) {
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

    /// Where segments of a length start, of which the last one has the remainder as well.
    fn starts(segment_length: usize, length: usize) -> Vec<usize> {
        let count = (length / segment_length).max(1);
        let starts = (0..count).map(|segment| segment * segment_length);
        starts.chain([length]).collect()
    }

    /// The bands as one of some threads takes them, alone.
    fn alone(segments: usize, thread: (usize, usize)) -> Vec<usize> {
        let mut schedule = Schedule::default();
        schedule.start(&Held::whole(segments));
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
    fn sums_of_other_processes_come_once_and_before_the_band_that_adds_to_them() {
        let mut array = vec![0; 8];
        let mut schedule = Schedule::default();
        // Bands 1 and 3 are of the second colour.
        let held = Held { bands: 1..4, all: 7 };
        let mut bands = ColoredBands::new(&mut array, starts(2, 8), held, &mut schedule);
        let shared: Vec<Shared> = bands.shared().collect();
        assert_eq!(shared.iter().map(|shared| shared.segment).collect::<Vec<_>>(), [1, 4]);
        let next = |bands: &ColoredBands<'_, i32>| {
            let mut band = bands.take((0, 1))?;
            band.elements().0.iter_mut().for_each(|element| *element += 1);
            Some(band.segment())
        };
        assert_eq!((next(&bands), next(&bands)), (Some(2), None));
        for (shared, band) in shared.into_iter().zip([1, 3]) {
            assert!(bands.is_awaited(shared));
            assert!(bands.fill(shared, |elements| elements.fill(10)));
            assert!(!bands.is_awaited(shared));
            assert_eq!((next(&bands), next(&bands)), (Some(band), None));
            assert!(!bands.fill(shared, |_| panic!("a second time")));
        }
        assert_eq!(bands.all(), [11, 11, 2, 2, 2, 2, 11, 11]);
    }

    #[test]
    fn bands_that_overlap_are_never_held_together() {
        for segments in 1..=7 {
            let mut schedule = Schedule::default();
            schedule.start(&Held::whole(segments));
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
                let starts = starts(segment_length, length);
                let held = Held::whole(starts.len() - 1);
                let bands = ColoredBands::new(&mut array, starts, held, &mut schedule);
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
        let bands = ColoredBands::new(&mut array, starts(2, 6), Held::whole(3), &mut schedule);
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
        let bands = ColoredBands::new(&mut array, starts(2, 4), Held::whole(2), &mut schedule);
        let panicked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            let band = bands.take((0, 1)).unwrap();
            panic!("{}", band.segment());
        }));
        assert!(panicked.is_err());
        assert_eq!(bands.take((0, 1)).unwrap().segment(), 0);
    }
}
