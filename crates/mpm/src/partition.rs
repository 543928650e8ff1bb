//! Particles in parts that do not overlap, so that every part may change its own on a thread of its own.
//!
//! The particles of a part lie scattered over their arrays, which borrowing alone cannot tell from parts that overlap.
//! The argument why they do not is here: a [`Partition`] lets nobody at the particles before it has seen that no number
//! occurs in it twice, and hands out each part once.

#![allow(unsafe_code, reason = "scattered elements of one array, changed by several threads")]

use std::marker::PhantomData;
use std::sync::atomic::{AtomicBool, Ordering};

/// The numbers 0 to n - 1, each in one of several parts, in an order that matters.
#[derive(Debug)]
pub(crate) struct Partition {
    /// The numbers, part after part.
    order: Vec<u32>,
    /// Where each part starts in `order`, and where the last one ends.
    starts: Vec<usize>,
    /// Whether no number has been found to occur twice since `order` and `starts` could last be changed.
    checked: bool,
    /// One bit for each number: whether it was seen in the check that is under way.
    seen: Vec<u64>,
    /// For each part whether it was handed out.
    taken: Vec<AtomicBool>,
}

impl Partition {
    /// Room for `count` numbers in `parts` parts; [`arrange`](Self::arrange) has to follow.
    pub(crate) fn new(count: usize, parts: usize) -> Self {
        Self {
            order: vec![0; count],
            starts: vec![0; parts + 1],
            checked: false,
            seen: vec![0; count.div_ceil(64)],
            taken: (0..parts).map(|_| AtomicBool::new(false)).collect(),
        }
    }

    /// The numbers of a part.
    pub(crate) fn part(&self, part: usize) -> Option<&[u32]> {
        let &[start, end] = self.starts.get(part..)?.first_chunk()?;
        self.order.get(start..end)
    }

    /// The numbers part after part, and where each part starts and the last one ends, to be changed.
    pub(crate) fn arrange(&mut self) -> (&mut [u32], &mut [usize]) {
        self.checked = false;
        (&mut self.order, &mut self.starts)
    }

    /// Whether every number occurs in exactly one part.
    pub(crate) fn is_whole(&mut self) -> bool {
        self.checked = self.checked || self.check();
        self.checked
    }

    fn check(&mut self) -> bool {
        let count = self.order.len();
        let ascending = self.starts.is_sorted();
        let whole = self.starts.first() == Some(&0) && self.starts.last() == Some(&count);
        self.seen.fill(0);
        let mut twice = false;
        for &number in &self.order {
            let (word, bit) = (number as usize / 64, 1 << (number % 64));
            match self.seen.get_mut(word) {
                Some(seen) if (number as usize) < count => {
                    twice |= *seen & bit != 0;
                    *seen |= bit;
                }
                _ => return false,
            }
        }
        ascending && whole && !twice
    }

    /// Lets each part change its own elements of three arrays; `None` where a number is in no part or in two, or where
    /// the arrays have another length than the numbers.
    pub(crate) fn shares<'a, A, B, C>(
        &'a mut self,
        arrays: (&'a mut [A], &'a mut [B], &'a mut [C]),
    ) -> Option<Shares<'a, A, B, C>> {
        let lengths = [arrays.0.len(), arrays.1.len(), arrays.2.len()];
        if !self.is_whole() || lengths.iter().any(|&length| length != self.order.len()) {
            return None;
        }
        self.taken.iter_mut().for_each(|taken| *taken.get_mut() = false);
        let firsts = (arrays.0.as_mut_ptr(), arrays.1.as_mut_ptr(), arrays.2.as_mut_ptr());
        Some(Shares { partition: self, firsts, borrowed: PhantomData })
    }
}

/// What the numbers of a partition index, borrowed until all parts are done.
type Borrowed<'a, A, B, C> = PhantomData<(&'a mut [A], &'a mut [B], &'a mut [C])>;

/// Three arrays whose elements belong to the parts of a partition.
pub(crate) struct Shares<'a, A, B, C> {
    partition: &'a Partition,
    firsts: (*mut A, *mut B, *mut C),
    borrowed: Borrowed<'a, A, B, C>,
}

// SAFETY: what threads reach through a shared reference are the shares, each taken by one of them; they hand out
// exclusive references to elements, for which `Send` is what is asked.
unsafe impl<A: Send, B: Send, C: Send> Sync for Shares<'_, A, B, C> {}

impl<'a, A, B, C> Shares<'a, A, B, C> {
    /// The elements of a part: once, then `None`, as for a part that there is not.
    pub(crate) fn take(&self, part: usize) -> Option<Share<'_, A, B, C>> {
        let numbers = self.partition.part(part)?;
        let first = !self.partition.taken.get(part)?.swap(true, Ordering::Relaxed);
        first.then_some(Share { numbers, firsts: self.firsts, borrowed: PhantomData })
    }
}

/// The elements of one part of three arrays.
pub(crate) struct Share<'a, A, B, C> {
    numbers: &'a [u32],
    firsts: (*mut A, *mut B, *mut C),
    borrowed: Borrowed<'a, A, B, C>,
}

impl<'a, A, B, C> Share<'a, A, B, C> {
    /// The numbers of its elements.
    pub(crate) fn numbers(&self) -> &'a [u32] {
        self.numbers
    }

    /// The elements from `place` on in all three arrays, where as many as `N` have successive numbers.
    #[inline(always)]
    pub(crate) fn successive<const N: usize>(
        &mut self,
        place: usize,
    ) -> Option<(&mut [A; N], &mut [B; N], &mut [C; N])> {
        let numbers = self.numbers.get(place..)?.first_chunk::<N>()?;
        let first = *numbers.first()?;
        let mut apart = 0;
        for (i, number) in numbers.iter().enumerate() {
            apart |= number ^ first.wrapping_add(i as u32);
        }
        if apart != 0 {
            return None;
        }
        let (a, b, c) = self.firsts;
        let first = first as usize;
        // SAFETY: the elements are those of `N` numbers of this part, for each of which what is said in `get` holds, and
        // lie one after the other.
        unsafe {
            Some((
                &mut *a.add(first).cast::<[A; N]>(),
                &mut *b.add(first).cast::<[B; N]>(),
                &mut *c.add(first).cast::<[C; N]>(),
            ))
        }
    }

    /// Element `place` of the part in all three arrays.
    ///
    /// # Panics
    ///
    /// Panics where the part has no such element.
    #[inline(always)]
    pub(crate) fn get(&mut self, place: usize) -> (&mut A, &mut B, &mut C) {
        let number = self.numbers[place] as usize;
        let (a, b, c) = self.firsts;
        // SAFETY: `Partition::shares` saw that every number is below the length of the three arrays, which stay
        // borrowed for 'a, and that none is in two parts; the partition is borrowed as well, so that nothing of this
        // changes. `take` hands a part out once, so that this share alone reaches its elements, and `&mut self` lets
        // one of them at a time be reached.
        unsafe { (&mut *a.add(number), &mut *b.add(number), &mut *c.add(number)) }
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

    /// Run under Miri too: `cargo +nightly miri test -p mmsmith-mpm partition`.
    #[test]
    fn parts_change_their_own_elements_side_by_side() {
        let mut partition = partition(&[4, 0, 2, 5, 1, 3], &[0, 2, 2, 6]);
        let (mut a, mut b, mut c) = (vec![0_u32; 6], vec![0.0_f64; 6], vec![String::new(); 6]);
        for round in 1..=2 {
            let shares = partition.shares((&mut a, &mut b, &mut c)).unwrap();
            std::thread::scope(|scope| {
                for part in 0..3 {
                    let shares = &shares;
                    scope.spawn(move || {
                        let mut share = shares.take(part).unwrap();
                        for place in 0..share.numbers().len() {
                            let number = share.numbers()[place];
                            let (a, b, c) = share.get(place);
                            *a += 10 * part as u32 + number;
                            *b += f64::from(number);
                            c.push_str(&number.to_string());
                        }
                    });
                }
            });
            assert!(shares.take(0).is_none(), "a part is handed out once");
            assert!(shares.take(3).is_none());
            assert_eq!(a, [0, 21, 22, 23, 4, 25].map(|value| value * round));
        }
        assert_eq!(c[3], "33");
    }

    /// Run under Miri too.
    #[test]
    fn successive_numbers_lie_side_by_side() {
        let mut partition = partition(&[3, 4, 5, 0, 1, 2, 6], &[0, 4, 7]);
        let (mut a, mut b, mut c) = ([0; 7], [0.0; 7], [false; 7]);
        let shares = partition.shares((&mut a, &mut b, &mut c)).unwrap();
        let (mut first, mut second) = (shares.take(0).unwrap(), shares.take(1).unwrap());
        let (x, y, z) = first.successive::<3>(0).unwrap();
        (*x, *y, *z) = ([1, 2, 3], [0.5, 1.5, 2.5], [true; 3]);
        let (x, ..) = second.successive::<2>(0).unwrap();
        *x = [4, 5];
        // 5 and 0, 2 and 6 are apart; the last run would leave the part.
        assert!(first.successive::<2>(2).is_none() && second.successive::<2>(1).is_none());
        assert!(first.successive::<2>(3).is_none() && first.successive::<1>(4).is_none());
        assert_eq!(a, [0, 4, 5, 1, 2, 3, 0]);
        assert_eq!(b[3..6], [0.5, 1.5, 2.5]);
        assert_eq!(c, [false, false, false, true, true, true, false]);
    }

    #[test]
    fn what_is_no_partition_gets_nothing() {
        let (mut a, mut b, mut c) = ([0; 3], [0; 3], [0; 3]);
        for (order, starts) in [
            (&[0, 1, 1], &[0, 2, 3][..]),
            (&[0, 1, 3], &[0, 2, 3]),
            (&[0, 1, u32::MAX], &[0, 2, 3]),
            (&[0, 1, 2], &[0, 2, 2]),
            (&[0, 1, 2], &[1, 2, 3]),
            (&[0, 1, 2], &[0, 3, 2, 3]),
        ] {
            let mut partition = partition(order, starts);
            assert!(partition.shares((&mut a, &mut b, &mut c)).is_none(), "{order:?} {starts:?}");
        }
        let mut partition = partition(&[2, 0, 1], &[0, 1, 3]);
        assert!(partition.shares((&mut a, &mut b, &mut c)).is_some());
        assert!(partition.shares((&mut a[..2], &mut b, &mut c)).is_none());
    }
}
