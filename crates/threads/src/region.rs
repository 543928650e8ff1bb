//! Boxes of elements of an array in some dimensions, whose axis 0 is the fastest.

use std::ops::Range;

/// The elements whose indices lie in a range along each axis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Region<const D: usize>(pub [Range<usize>; D]);

impl<const D: usize> Region<D> {
    /// Number of elements.
    pub fn len(&self) -> usize {
        self.0.iter().map(ExactSizeIterator::len).product()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// How far elements that follow each other along each axis lie apart in an array of this region alone.
    pub fn strides(&self) -> [usize; D] {
        let mut strides = [1; D];
        for a in 1..D {
            strides[a] = strides[a - 1] * self.0[a - 1].len();
        }
        strides
    }

    /// The place of the element of an index in an array of this region alone.
    #[inline]
    pub fn place(&self, index: usize) -> [usize; D] {
        let mut rest = index;
        self.0.each_ref().map(|range| {
            let place = range.start + rest % range.len();
            rest /= range.len();
            place
        })
    }

    /// The index of an element there.
    #[inline]
    pub fn index(&self, place: &[usize; D]) -> usize {
        let of = |index, a: usize| index * self.0[a].len() + place[a] - self.0[a].start;
        (0..D).rev().fold(0, of)
    }

    /// The elements of both.
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|a| {
            let (own, other) = (&self.0[a], &other.0[a]);
            let start = own.start.max(other.start);
            start..own.end.min(other.end).max(start)
        }))
    }

    /// This region with another range along an axis.
    #[must_use]
    pub fn along(&self, axis: usize, range: Range<usize>) -> Self {
        let mut ranges = self.0.clone();
        ranges[axis] = range;
        Self(ranges)
    }

    /// Whether all its elements are in another region.
    pub fn is_within(&self, whole: &Self) -> bool {
        self.is_empty()
            || (0..D)
                .all(|a| whole.0[a].start <= self.0[a].start && self.0[a].end <= whole.0[a].end)
    }

    /// Its elements in an array of the region `whole`, line after line along axis 0.
    ///
    /// # Panics
    ///
    /// As [`lines`](Self::lines).
    pub fn slices<'a, N>(&self, whole: &Self, elements: &'a [N]) -> Vec<&'a [N]> {
        self.lines(whole).map(|line| &elements[line]).collect()
    }

    /// As [`slices`](Self::slices), to be changed.
    ///
    /// # Panics
    ///
    /// As [`lines`](Self::lines).
    pub fn slices_mut<'a, N>(&self, whole: &Self, mut elements: &'a mut [N]) -> Vec<&'a mut [N]> {
        let mut before = 0;
        let mut slice = |line: Range<usize>| {
            let (skipped, count) = (line.start - before, line.len());
            before = line.end;
            let (own, rest) = std::mem::take(&mut elements)[skipped..].split_at_mut(count);
            elements = rest;
            own
        };
        self.lines(whole).map(&mut slice).collect()
    }

    /// The indices of its elements in an array of the region `whole`, line after line along axis 0.
    ///
    /// # Panics
    ///
    /// Where that array does not have them.
    pub fn lines(&self, whole: &Self) -> impl Iterator<Item = Range<usize>> + use<D> {
        assert!(self.is_within(whole), "{self:?} is not within {whole:?}");
        let (strides, length) = (whole.strides(), self.0[0].len());
        let counts: [usize; D] = std::array::from_fn(|a| self.0[a].len());
        let lines = if length == 0 { 0 } else { counts[1..].iter().product() };
        let first: usize = match lines {
            0 => 0,
            _ => (0..D).map(|a| (self.0[a].start - whole.0[a].start) * strides[a]).sum(),
        };
        (0..lines).map(move |line| {
            let (mut rest, mut place) = (line, first);
            for a in 1..D {
                place += rest % counts[a] * strides[a];
                rest /= counts[a];
            }
            place..place + length
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn lines_have_the_elements_of_the_region_in_order(
            starts in prop::array::uniform3(0..4_usize),
            lengths in prop::array::uniform3(0..4_usize),
            more in prop::array::uniform3(0..3_usize),
        ) {
            let own = Region([0, 1, 2].map(|a| starts[a]..starts[a] + lengths[a]));
            let whole = Region([0, 1, 2].map(|a| {
                starts[a].saturating_sub(more[a])..starts[a] + lengths[a] + more[2 - a]
            }));
            prop_assert!(own.is_within(&whole));
            prop_assert_eq!(&own.intersection(&whole), &own);
            let Region([x, y, z]) = &whole;
            let (mut index, mut expected) = (0, Vec::new());
            for (k, j) in z.clone().flat_map(|k| y.clone().map(move |j| (k, j))) {
                for i in x.clone() {
                    if own.0[0].contains(&i) && own.0[1].contains(&j) && own.0[2].contains(&k) {
                        expected.push(index);
                    }
                    index += 1;
                }
            }
            prop_assert_eq!(&own.lines(&whole).flatten().collect::<Vec<_>>(), &expected);
            prop_assert_eq!(own.lines(&own).flatten().count(), own.len());
            for (index, line) in (0..own.len()).zip(own.lines(&whole).flatten()) {
                prop_assert_eq!(own.index(&own.place(index)), index);
                prop_assert_eq!(whole.index(&own.place(index)), line);
            }
            let mut numbers: Vec<usize> = (0..whole.len()).collect();
            prop_assert_eq!(&own.slices(&whole, &numbers).concat(), &expected);
            let lines = own.slices_mut(&whole, &mut numbers);
            lines.into_iter().for_each(|line| line.fill(usize::MAX));
            let changed = (0..whole.len()).filter(|index| numbers[*index] == usize::MAX);
            prop_assert_eq!(changed.collect::<Vec<_>>(), expected);
        }
    }
}
