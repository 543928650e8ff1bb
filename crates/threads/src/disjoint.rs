//! Disjoint mutable access by index sets: each part of a partition changes its own elements of a column on a thread of its own.
//!
//! The elements of a part lie scattered over the column, so borrowing alone cannot tell that parts do not overlap. The
//! safety argument is in this file: a [`Partition`] grants access after it has checked that no index occurs twice, and each
//! column hands out each part once.

#![allow(unsafe_code, reason = "scattered elements of one array, changed by several threads")]

use std::marker::PhantomData;
use std::slice;
use std::sync::atomic::{AtomicBool, Ordering};

/// The indices 0 to n - 1, each in one of several parts, in an order that matters.
#[derive(Debug)]
pub struct Partition {
    /// The indices, part after part.
    order: Vec<u32>,
    /// Start of each part in `order`, and the end of the last one.
    starts: Vec<usize>,
    /// Whether the check has passed since the last change of `order` and `starts`.
    checked: bool,
    /// Buffer of the check: one bit for each index that was met.
    seen: Vec<u64>,
}

impl Partition {
    /// Allocates `count` indices in `parts` parts; [`arrange`](Self::arrange) has to follow.
    pub fn new(count: usize, parts: usize) -> Self {
        Self {
            order: vec![0; count],
            starts: vec![0; parts + 1],
            checked: false,
            seen: vec![0; count.div_ceil(64)],
        }
    }

    /// The indices of a part.
    pub fn part(&self, part: usize) -> Option<&[u32]> {
        let &[start, end] = self.starts.get(part..)?.first_chunk()?;
        self.order.get(start..end)
    }

    /// The indices part after part, and the start of each part with the end of the last one, to be changed.
    pub fn arrange(&mut self) -> (&mut [u32], &mut [usize]) {
        self.checked = false;
        (&mut self.order, &mut self.starts)
    }

    /// Whether every index occurs in exactly one part.
    pub fn is_whole(&mut self) -> bool {
        self.checked = self.checked || self.check();
        self.checked
    }

    fn check(&mut self) -> bool {
        let count = self.order.len();
        let ascending = self.starts.is_sorted();
        let whole = self.starts.first() == Some(&0) && self.starts.last() == Some(&count);
        self.seen.fill(0);
        let mut twice = false;
        for &index in &self.order {
            let (word, bit) = (index as usize / 64, 1 << (index % 64));
            match self.seen.get_mut(word) {
                Some(seen) if (index as usize) < count => {
                    twice |= *seen & bit != 0;
                    *seen |= bit;
                }
                _ => return false,
            }
        }
        ascending && whole && !twice
    }

    /// The partition as columns are divided by it; `None` where an index is in no part or in two.
    pub fn whole(&mut self) -> Option<WholePartition<'_>> {
        self.is_whole().then_some(WholePartition(self))
    }
}

/// A partition that has every index once, and stays as it is.
#[derive(Clone, Copy)]
pub struct WholePartition<'a>(&'a Partition);

impl<'a> WholePartition<'a> {
    /// The partition.
    pub fn partition(self) -> &'a Partition {
        self.0
    }

    /// Mutable access to a column, part by part. Each index has as many successive elements as the others, its share, which may be none;
    /// `None` where the length is no multiple of the number of indices.
    pub fn column<E>(self, elements: &'a mut [E]) -> Option<DisjointColumn<'a, E>> {
        let count = self.0.order.len();
        let share = elements.len().checked_div(count).unwrap_or(0);
        if share * count != elements.len() {
            return None;
        }
        let taken = (1..self.0.starts.len()).map(|_| AtomicBool::new(false)).collect();
        let first = elements.as_mut_ptr();
        Some(DisjointColumn { partition: self.0, share, first, taken, borrowed: PhantomData })
    }
}

/// A column whose elements belong to the parts of a partition.
pub struct DisjointColumn<'a, E> {
    partition: &'a Partition,
    /// How many elements each index has.
    share: usize,
    first: *mut E,
    /// For each part whether it was handed out.
    taken: Box<[AtomicBool]>,
    borrowed: PhantomData<&'a mut [E]>,
}

// SAFETY: threads reach parts through a shared reference, and each part is taken by one of them; parts give exclusive
// references to elements, for which `Send` is the requirement.
unsafe impl<E: Send> Sync for DisjointColumn<'_, E> {}

impl<E> DisjointColumn<'_, E> {
    /// The elements of a part: once, then `None`, as for a part that does not exist.
    pub fn take(&self, part: usize) -> Option<PartColumn<'_, E>> {
        let indices = self.partition.part(part)?;
        let is_first = !self.taken.get(part)?.swap(true, Ordering::Relaxed);
        let &Self { share, first, .. } = self;
        is_first.then_some(PartColumn { indices, share, first, borrowed: PhantomData })
    }
}

/// The elements of a column that belong to one part.
pub struct PartColumn<'a, E> {
    indices: &'a [u32],
    share: usize,
    first: *mut E,
    borrowed: PhantomData<&'a mut [E]>,
}

/// Successive indices, one after the other in a part.
#[derive(Clone, Copy)]
pub struct Run<'a> {
    /// All indices of the part.
    indices: &'a [u32],
    first: u32,
    count: usize,
}

impl<'a> Run<'a> {
    /// The `count` indices of a part from `place` on, if each is the one before it and one.
    #[inline(always)]
    pub fn find(indices: &'a [u32], place: usize, count: usize) -> Option<Self> {
        let run = indices.get(place..place.checked_add(count)?)?;
        let first = *run.first()?;
        let mut apart = 0;
        for (i, index) in run.iter().enumerate() {
            apart |= index ^ first.wrapping_add(i as u32);
        }
        (apart == 0).then_some(Self { indices, first, count })
    }
}

/// The runs of some indices of a part, in their order.
pub struct Runs<'a> {
    indices: &'a [u32],
    runs: Vec<Run<'a>>,
}

impl<'a> Runs<'a> {
    /// None yet, of a part with these indices.
    pub fn new(indices: &'a [u32]) -> Self {
        Self { indices, runs: Vec::new() }
    }

    /// Finds those of the `count` indices from `place` on.
    ///
    /// # Panics
    ///
    /// Panics where the part has fewer.
    #[inline(always)]
    pub fn find(&mut self, place: usize, count: usize) {
        let Self { indices, runs } = self;
        runs.clear();
        let mut run = Run { indices, first: 0, count: 0 };
        for &index in &indices[place..place + count] {
            if run.count > 0 && index == run.first.wrapping_add(run.count as u32) {
                run.count += 1;
            } else {
                runs.extend((run.count > 0).then_some(run));
                run = Run { first: index, count: 1, ..run };
            }
        }
        runs.extend((run.count > 0).then_some(run));
    }
}

impl<E> PartColumn<'_, E> {
    /// The elements of a run, which lie side by side: none where the run is one of another part.
    #[inline(always)]
    pub fn run(&mut self, run: Run<'_>) -> &mut [E] {
        if !std::ptr::eq(self.indices, run.indices) {
            return &mut [];
        }
        let Run { first, count, .. } = run;
        // SAFETY: a run has successive indices of this part. `Partition::whole` saw that every index is below the number of indices, of each of
        // which the column has `share` elements, which stay borrowed for 'a, and that none is in two parts; the partition is borrowed as well,
        // so that nothing of this changes. `take` hands a part out once, so that this value alone reaches its elements, and `&mut self` lets
        // those of one run at a time be reached.
        unsafe {
            let first = self.first.add(first as usize * self.share);
            slice::from_raw_parts_mut(first, count * self.share)
        }
    }
}

impl<E: Copy> PartColumn<'_, E> {
    /// Copies the elements of runs, one after the other, and gives how many they are.
    #[inline(always)]
    pub fn gather(&mut self, runs: &Runs<'_>, copies: &mut [E]) -> usize {
        let mut copied = 0;
        for run in &runs.runs {
            let own = self.run(*run);
            copy(&mut copies[copied..copied + own.len()], own);
            copied += own.len();
        }
        copied
    }

    /// Copies back what [`gather`](Self::gather) copied, changed.
    #[inline(always)]
    pub fn scatter(&mut self, runs: &Runs<'_>, copies: &[E]) {
        let mut copied = 0;
        for run in &runs.runs {
            let own = self.run(*run);
            let end = copied + own.len();
            copy(own, &copies[copied..end]);
            copied = end;
        }
    }
}

/// Copies elements; few of them in line, since a call would take longer.
#[inline(always)]
fn copy<E: Copy>(to: &mut [E], from: &[E]) {
    if from.len() > 3 {
        to.copy_from_slice(from);
        return;
    }
    for (to, from) in to.iter_mut().zip(from) {
        *to = *from;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn partition(order: &[u32], starts: &[usize]) -> Partition {
        let mut partition = Partition::new(order.len(), starts.len() - 1);
        let (o, s) = partition.arrange();
        o.copy_from_slice(order);
        s.copy_from_slice(starts);
        partition
    }

    /// Run under Miri too: `cargo +nightly miri test -p mmsmith-mpm disjoint`.
    #[test]
    fn parts_change_their_own_elements_side_by_side() {
        let mut partition = partition(&[4, 0, 2, 5, 1, 3], &[0, 2, 2, 6]);
        let (mut one, mut two, mut none) = (vec![0_u32; 6], vec![String::new(); 12], [0_u8; 0]);
        for round in 1..=2 {
            let whole = partition.whole().unwrap();
            let of_one = whole.column(&mut one).unwrap();
            let of_two = whole.column(&mut two).unwrap();
            let of_none = whole.column(&mut none).unwrap();
            std::thread::scope(|scope| {
                for number in 0..3 {
                    let (of_one, of_two, of_none) = (&of_one, &of_two, &of_none);
                    scope.spawn(move || {
                        let mut one = of_one.take(number).unwrap();
                        let mut two = of_two.take(number).unwrap();
                        assert!(of_none.take(number).unwrap().indices.iter().len() != 1);
                        for place in 0..one.indices.len() {
                            let index = one.indices[place];
                            let run = Run::find(one.indices, place, 1).unwrap();
                            one.run(run)[0] += 10 * number as u32 + index;
                            let [a, b] = two.run(run) else { panic!("two each") };
                            a.push_str(&index.to_string());
                            b.push('b');
                        }
                    });
                }
            });
            assert!(of_one.take(0).is_none(), "a part is handed out once");
            assert!(of_one.take(3).is_none());
            assert_eq!(one, [0, 21, 22, 23, 4, 25].map(|value| value * round));
        }
        assert_eq!((&*two[6], &*two[7]), ("33", "bb"));
    }

    /// Run under Miri too.
    #[test]
    fn contiguous_indices_lie_side_by_side() {
        let order = [3, 4, 5, 0, 1, 2, 6];
        let mut partition = partition(&order, &[0, 4, 7]);
        let (mut one, mut two) = ([0; 7], [0.0; 14]);
        let whole = partition.whole().unwrap();
        let (of_one, of_two) = (whole.column(&mut one).unwrap(), whole.column(&mut two).unwrap());
        let (mut first, mut second) = (of_one.take(0).unwrap(), of_one.take(1).unwrap());
        let run = Run::find(first.indices, 0, 3).unwrap();
        first.run(run).copy_from_slice(&[1, 2, 3]);
        of_two.take(0).unwrap().run(run).copy_from_slice(&[0.5, 1.0, 1.5, 2.0, 2.5, 3.0]);
        assert!(second.run(run).is_empty(), "a run of another part");
        let run = Run::find(second.indices, 0, 2).unwrap();
        second.run(run).copy_from_slice(&[4, 5]);
        // 5 and 0, 2 and 6 are apart; the last run would leave the part.
        assert!(Run::find(first.indices, 2, 2).is_none());
        assert!(Run::find(second.indices, 1, 2).is_none());
        assert!(Run::find(first.indices, 3, 2).is_none());
        assert!(Run::find(first.indices, 4, 1).is_none());
        let mut copies = [0; 3];
        let mut runs = Runs::new(second.indices);
        runs.find(1, 2);
        assert_eq!((runs.runs.len(), second.gather(&runs, &mut copies)), (2, 2));
        assert_eq!(copies, [5, 0, 0]);
        second.scatter(&runs, &[7, 8]);
        let mut runs = Runs::new(first.indices);
        runs.find(1, 3);
        assert_eq!((runs.runs.len(), first.gather(&runs, &mut copies)), (2, 3));
        assert_eq!(copies, [2, 3, 0]);
        assert_eq!(second.gather(&runs, &mut copies), 0, "runs of another part");
        first.scatter(&runs, &[2, 3, 9]);
        runs.find(4, 0);
        assert!(runs.runs.is_empty());
        assert_eq!(one, [9, 4, 7, 1, 2, 3, 8]);
        assert_eq!(two[6..12], [0.5, 1.0, 1.5, 2.0, 2.5, 3.0]);
    }

    #[test]
    fn an_invalid_partition_gives_no_access() {
        for (order, starts) in [
            (&[0, 1, 1], &[0, 2, 3][..]),
            (&[0, 1, 3], &[0, 2, 3]),
            (&[0, 1, u32::MAX], &[0, 2, 3]),
            (&[0, 1, 2], &[0, 2, 2]),
            (&[0, 1, 2], &[1, 2, 3]),
            (&[0, 1, 2], &[0, 3, 2, 3]),
        ] {
            let mut partition = partition(order, starts);
            assert!(partition.whole().is_none(), "{order:?} {starts:?}");
        }
        let mut partition = partition(&[2, 0, 1], &[0, 1, 3]);
        let whole = partition.whole().unwrap();
        assert!(whole.column(&mut [0; 3]).is_some() && whole.column(&mut [0; 6]).is_some());
        assert!(whole.column(&mut [0; 0]).is_some() && whole.column(&mut [0; 2]).is_none());
        assert!(whole.column(&mut [0; 4]).is_none());
    }
}
