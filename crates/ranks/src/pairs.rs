//! A tree of ranks, in which no rank hears of many others.

use std::ops::Range;

use crate::Ranks;

/// The place of a rank in a binary tree of all ranks. What has to come from all to the first one goes up the tree, and what it has to
/// tell all goes down, in rounds: in the first one each odd rank tells the even one before it, in the next one the odd ones of those
/// that are left, and so on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pairs {
    /// The ranks whose news the first of each range tells this one, in the order in which they follow this rank.
    pub heard: Vec<Range<usize>>,
    /// The rank that this one tells afterwards; none for the first one.
    pub told: Option<usize>,
}

impl Pairs {
    /// The place of the rank `rank` of `count`.
    #[must_use]
    pub fn new(rank: usize, count: usize) -> Self {
        let mut heard = Vec::new();
        let mut step = 1;
        while step < count {
            if rank & step != 0 {
                return Self { heard, told: Some(rank - step) };
            }
            let first = rank + step;
            if first < count {
                heard.push(first..count.min(first + step));
            }
            step *= 2;
        }
        Self { heard, told: None }
    }

    /// The place of this rank.
    #[must_use]
    pub fn of(ranks: &dyn Ranks) -> Self {
        Self::new(ranks.rank(), ranks.count())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rank_is_heard_once_and_in_order() {
        for count in 1..70_usize {
            for rank in 0..count {
                let Pairs { heard, told } = Pairs::new(rank, count);
                assert!(heard.len() <= count.next_power_of_two().ilog2() as usize);
                let mut next = rank + 1;
                for part in heard {
                    assert_eq!(part.start, next);
                    assert_eq!(Pairs::new(part.start, count).told, Some(rank));
                    next = part.end;
                }
                // All that its own pair has told it, it tells.
                let whole = told.map_or(0..count, |to| {
                    let heard = Pairs::new(to, count).heard;
                    heard.into_iter().find(|part| part.start == rank).expect("it is heard")
                });
                assert_eq!(rank..next, whole, "{rank} of {count}");
            }
        }
    }
}
