//! Disjoint mutable access by index sets: each part of a partition changes its own elements on a thread of its own.
//!
//! The elements of a part lie scattered over their arrays, so borrowing alone cannot tell that parts do not overlap. The
//! safety argument is in this file: a [`Partition`] grants access after it has checked that no index occurs twice, and
//! hands out each part once.

#![allow(unsafe_code, reason = "scattered elements of one array, changed by several threads")]

use std::marker::PhantomData;
use std::sync::atomic::{AtomicBool, Ordering};

/// The indices 0 to n - 1, each in one of several parts, in an order that matters.
#[derive(Debug)]
pub(crate) struct Partition {
    /// The indices, part after part.
    order: Vec<u32>,
    /// Start of each part in `order`, and the end of the last one.
    starts: Vec<usize>,
    /// Whether the check has passed since the last change of `order` and `starts`.
    checked: bool,
    /// Buffer of the check: one bit for each index that was met.
    seen: Vec<u64>,
    /// For each part whether it was handed out.
    taken: Vec<AtomicBool>,
}

impl Partition {
    /// Allocates `count` indices in `parts` parts; [`arrange`](Self::arrange) has to follow.
    pub(crate) fn new(count: usize, parts: usize) -> Self {
        Self {
            order: vec![0; count],
            starts: vec![0; parts + 1],
            checked: false,
            seen: vec![0; count.div_ceil(64)],
            taken: (0..parts).map(|_| AtomicBool::new(false)).collect(),
        }
    }

    /// The indices of a part.
    pub(crate) fn part(&self, part: usize) -> Option<&[u32]> {
        let &[start, end] = self.starts.get(part..)?.first_chunk()?;
        self.order.get(start..end)
    }

    /// The indices part after part, and the start of each part with the end of the last one, to be changed.
    pub(crate) fn arrange(&mut self) -> (&mut [u32], &mut [usize]) {
        self.checked = false;
        (&mut self.order, &mut self.starts)
    }

    /// Whether every index occurs in exactly one part.
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

    /// Mutable access to four arrays, part by part; `None` where an index is in no part or in two, or where the arrays have
    /// another length than the partition. The fourth one may be empty.
    pub(crate) fn elements<'a, A, B, C, E>(
        &'a mut self,
        (a, b, c, e): Arrays<'a, A, B, C, E>,
    ) -> Option<DisjointElements<'a, A, B, C, E>> {
        let count = self.order.len();
        let lengths = [a.len(), b.len(), c.len()];
        let fits = lengths == [count; 3] && (e.is_empty() || e.len() == count);
        if !self.is_whole() || !fits {
            return None;
        }
        self.taken.iter_mut().for_each(|taken| *taken.get_mut() = false);
        let fourth = (!e.is_empty()).then_some(e.as_mut_ptr());
        let firsts = (a.as_mut_ptr(), b.as_mut_ptr(), c.as_mut_ptr(), fourth);
        Some(DisjointElements { partition: self, firsts, borrowed: PhantomData })
    }
}

/// Four arrays of one length; the last one may be empty.
pub(crate) type Arrays<'a, A, B, C, E> = (&'a mut [A], &'a mut [B], &'a mut [C], &'a mut [E]);

/// Where they begin.
type Firsts<A, B, C, E> = (*mut A, *mut B, *mut C, Option<*mut E>);

/// The arrays, borrowed until all parts are done.
type Borrowed<'a, A, B, C, E> = PhantomData<Arrays<'a, A, B, C, E>>;

/// Four arrays whose elements belong to the parts of a partition.
pub(crate) struct DisjointElements<'a, A, B, C, E> {
    partition: &'a Partition,
    firsts: Firsts<A, B, C, E>,
    borrowed: Borrowed<'a, A, B, C, E>,
}

// SAFETY: threads reach parts through a shared reference, and each part is taken by one of them; parts give exclusive
// references to elements, for which `Send` is the requirement.
unsafe impl<A: Send, B: Send, C: Send, E: Send> Sync for DisjointElements<'_, A, B, C, E> {}

impl<'a, A, B, C, E> DisjointElements<'a, A, B, C, E> {
    /// The elements of a part: once, then `None`, as for a part that does not exist.
    pub(crate) fn take(&self, part: usize) -> Option<PartElements<'_, A, B, C, E>> {
        let indices = self.partition.part(part)?;
        let first = !self.partition.taken.get(part)?.swap(true, Ordering::Relaxed);
        first.then_some(PartElements { indices, firsts: self.firsts, borrowed: PhantomData })
    }
}

/// The elements of one part in four arrays.
pub(crate) struct PartElements<'a, A, B, C, E> {
    indices: &'a [u32],
    firsts: Firsts<A, B, C, E>,
    borrowed: Borrowed<'a, A, B, C, E>,
}

/// An element of each array, or several that lie side by side; none of an array that is empty.
pub(crate) type Elements<'a, A, B, C, E> = (&'a mut A, &'a mut B, &'a mut C, Option<&'a mut E>);

/// As [`Elements`], `N` of each array.
pub(crate) type Contiguous<'a, A, B, C, E, const N: usize> =
    Elements<'a, [A; N], [B; N], [C; N], [E; N]>;

impl<'a, A, B, C, E> PartElements<'a, A, B, C, E> {
    /// The indices of its elements.
    pub(crate) fn indices(&self) -> &'a [u32] {
        self.indices
    }

    /// The `N` elements from `place` on in all arrays, if their indices are contiguous.
    #[inline(always)]
    pub(crate) fn contiguous<const N: usize>(
        &mut self,
        place: usize,
    ) -> Option<Contiguous<'_, A, B, C, E, N>> {
        let indices = self.indices.get(place..)?.first_chunk::<N>()?;
        let first = *indices.first()?;
        let mut apart = 0;
        for (i, index) in indices.iter().enumerate() {
            apart |= index ^ first.wrapping_add(i as u32);
        }
        if apart != 0 {
            return None;
        }
        let (a, b, c, e) = self.firsts;
        let first = first as usize;
        // SAFETY: the elements are those of `N` indices of this part, for each of which the argument in `get` holds, and
        // lie one after the other.
        unsafe {
            Some((
                &mut *a.add(first).cast::<[A; N]>(),
                &mut *b.add(first).cast::<[B; N]>(),
                &mut *c.add(first).cast::<[C; N]>(),
                e.map(|e| &mut *e.add(first).cast::<[E; N]>()),
            ))
        }
    }

    /// Element `place` of the part in all arrays.
    ///
    /// # Panics
    ///
    /// Panics where the part has no such element.
    #[inline(always)]
    pub(crate) fn get(&mut self, place: usize) -> Elements<'_, A, B, C, E> {
        let index = self.indices[place] as usize;
        let (a, b, c, e) = self.firsts;
        // SAFETY: `Partition::elements` saw that every index is below the length of all arrays that have a first element here,
        // which stay borrowed for 'a, and that none is in two parts; the partition is borrowed as well, so that nothing of
        // this changes. `take` hands a part out once, so that this value alone reaches its elements, and `&mut self` lets
        // one of them at a time be reached.
        unsafe {
            let e = e.map(|e| &mut *e.add(index));
            (&mut *a.add(index), &mut *b.add(index), &mut *c.add(index), e)
        }
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
        let (mut a, mut b, mut c) = (vec![0_u32; 6], vec![0.0_f64; 6], vec![String::new(); 6]);
        let mut e = [false; 6];
        for round in 1..=2 {
            // The fourth array is there in the second round only.
            let of_round = if round == 1 { &mut [][..] } else { &mut e[..] };
            let elements = partition.elements((&mut a, &mut b, &mut c, of_round)).unwrap();
            std::thread::scope(|scope| {
                for number in 0..3 {
                    let elements = &elements;
                    scope.spawn(move || {
                        let mut part = elements.take(number).unwrap();
                        for place in 0..part.indices().len() {
                            let index = part.indices()[place];
                            let (a, b, c, e) = part.get(place);
                            assert_eq!(e.is_some(), round == 2);
                            e.into_iter().for_each(|e| *e = !*e);
                            *a += 10 * number as u32 + index;
                            *b += f64::from(index);
                            c.push_str(&index.to_string());
                        }
                    });
                }
            });
            assert!(elements.take(0).is_none(), "a part is handed out once");
            assert!(elements.take(3).is_none());
            assert_eq!(a, [0, 21, 22, 23, 4, 25].map(|value| value * round));
        }
        assert_eq!(c[3], "33");
        assert_eq!(e, [true; 6]);
    }

    /// Run under Miri too.
    #[test]
    fn contiguous_indices_lie_side_by_side() {
        let mut partition = partition(&[3, 4, 5, 0, 1, 2, 6], &[0, 4, 7]);
        let (mut a, mut b, mut c) = ([0; 7], [0.0; 7], [false; 7]);
        let mut e = [0_u8; 7];
        let elements = partition.elements((&mut a, &mut b, &mut c, &mut e)).unwrap();
        let (mut first, mut second) = (elements.take(0).unwrap(), elements.take(1).unwrap());
        let (x, y, z, w) = first.contiguous::<3>(0).unwrap();
        (*x, *y, *z) = ([1, 2, 3], [0.5, 1.5, 2.5], [true; 3]);
        *w.unwrap() = [7, 8, 9];
        let (x, ..) = second.contiguous::<2>(0).unwrap();
        *x = [4, 5];
        // 5 and 0, 2 and 6 are apart; the last run would leave the part.
        assert!(first.contiguous::<2>(2).is_none() && second.contiguous::<2>(1).is_none());
        assert!(first.contiguous::<2>(3).is_none() && first.contiguous::<1>(4).is_none());
        assert_eq!(a, [0, 4, 5, 1, 2, 3, 0]);
        assert_eq!(b[3..6], [0.5, 1.5, 2.5]);
        assert_eq!(c, [false, false, false, true, true, true, false]);
        assert_eq!(e, [0, 0, 0, 7, 8, 9, 0]);
    }

    #[test]
    fn an_invalid_partition_gives_no_access() {
        let (mut a, mut b, mut c, mut e) = ([0; 3], [0; 3], [0; 3], [0; 3]);
        for (order, starts) in [
            (&[0, 1, 1], &[0, 2, 3][..]),
            (&[0, 1, 3], &[0, 2, 3]),
            (&[0, 1, u32::MAX], &[0, 2, 3]),
            (&[0, 1, 2], &[0, 2, 2]),
            (&[0, 1, 2], &[1, 2, 3]),
            (&[0, 1, 2], &[0, 3, 2, 3]),
        ] {
            let mut partition = partition(order, starts);
            let elements = partition.elements((&mut a, &mut b, &mut c, &mut e));
            assert!(elements.is_none(), "{order:?} {starts:?}");
        }
        let mut partition = partition(&[2, 0, 1], &[0, 1, 3]);
        assert!(partition.elements((&mut a, &mut b, &mut c, &mut e)).is_some());
        assert!(partition.elements((&mut a, &mut b, &mut c, &mut e[..0])).is_some());
        assert!(partition.elements((&mut a[..2], &mut b, &mut c, &mut e)).is_none());
        assert!(partition.elements((&mut a, &mut b, &mut c, &mut e[..2])).is_none());
    }
}
