//! Sums over groups of particles by a binary tree, whose shape follows from the number of groups alone.
//!
//! A node of height `h` joins the groups from a multiple of `2^h` on, `2^h` of them or what is left at the end, by joining the sums of its two halves.
//! The home of groups joins what lies whole within them, and tells it to the processes that join these groups. A process that joins successive groups
//! has at most `2 log2(groups)` nodes then, and tells these to the process before it. The bits therefore depend neither on processes nor on threads, no process
//! hears of more than `log2(processes)` others beside homes, and each message has the nodes of some successive processes.

use std::ops::Range;

use mmsmith_ranks::{Pairs, Ranks, exchange, share};

use crate::homes::Homes;

/// Sums over some particles, which can be joined and be sent as numbers.
pub trait Sums: Sized {
    /// How many numbers they are.
    const NUMBERS: usize;

    /// With the sums over the particles that follow.
    #[must_use]
    fn join(&self, next: &Self) -> Self;

    /// Appends the numbers.
    fn write(&self, numbers: &mut Vec<f64>);

    /// The sums of these [numbers](Self::write).
    fn read(numbers: &[f64]) -> Self;
}

/// The groups of a node: from a multiple of `2^height` on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Place {
    first: usize,
    height: u32,
}

impl Place {
    fn next(self) -> usize {
        self.first + (1 << self.height)
    }

    /// Whether this and the node that follows are the halves of one.
    fn is_first_half(self) -> bool {
        self.first >> self.height & 1 == 0
    }

    /// The largest nodes that lie within some groups, in order.
    fn within(groups: Range<usize>) -> impl Iterator<Item = Self> {
        let mut first = groups.start;
        std::iter::from_fn(move || {
            let most = groups.end.checked_sub(first)?.checked_ilog2()?;
            let height = if first == 0 { most } else { most.min(first.trailing_zeros()) };
            let place = Self { first, height };
            first = place.next();
            Some(place)
        })
    }
}

/// The largest nodes that lie within some groups, which ascend.
struct Nodes<S>(Vec<(Place, S)>);

impl<S: Sums> Nodes<S> {
    /// The nodes of groups with their numbers.
    fn of_groups(groups: impl IntoIterator<Item = (usize, S)>) -> Self {
        let mut nodes = Self(Vec::new());
        for (first, sums) in groups {
            nodes.push(Place { first, height: 0 }, sums);
        }
        nodes
    }

    /// Appends a node of groups that come later.
    fn push(&mut self, mut place: Place, mut sums: S) {
        while let Some((before, _)) = self.0.last()
            && before.height == place.height
            && before.is_first_half()
            && before.next() == place.first
        {
            let Some((first_half, of_first_half)) = self.0.pop() else { break };
            place = Place { first: first_half.first, height: place.height + 1 };
            sums = of_first_half.join(&sums);
        }
        self.0.push((place, sums));
    }

    /// The sums over all groups, where these nodes have them all. Second halves that are not whole are joined from the last one on.
    fn root(self) -> Option<S> {
        let sums = self.0.into_iter().map(|(_, sums)| sums);
        sums.rev().reduce(|after, before| before.join(&after))
    }
}

/// The sums over all groups, which are given in their order; none without groups.
pub fn joined<S: Sums>(groups: impl IntoIterator<Item = S>) -> Option<S> {
    Nodes::of_groups(groups.into_iter().enumerate()).root()
}

/// The sums over the groups of all processes, each of so many particles, at all of them; `groups` has those of the particles whose home
/// is here. Collective.
pub fn joined_over<S: Sums>(homes: &Homes, particles: usize, groups: Vec<S>) -> Option<S> {
    let ranks = homes.ranks();
    let of = |part: &Range<usize>| {
        let first = |rank| homes.first_group(rank, particles);
        first(part.start)..first(part.end)
    };
    let mut nodes = at_joiners(homes, particles, groups);
    let Pairs { heard, told } = Pairs::of(ranks);
    for part in heard {
        let places: Vec<Place> = Place::within(of(&part)).collect();
        let mut numbers = vec![0.0; places.len() * S::NUMBERS];
        receive(ranks, part.start, &mut numbers);
        for (place, numbers) in places.into_iter().zip(numbers.chunks_exact(S::NUMBERS)) {
            nodes.push(place, S::read(numbers));
        }
    }
    if let Some(to) = told {
        let mut numbers = Vec::with_capacity(nodes.0.len() * S::NUMBERS);
        nodes.0.iter().for_each(|(_, sums)| sums.write(&mut numbers));
        if !numbers.is_empty() {
            ranks.send(to, bytemuck::cast_slice(&numbers));
        }
    }
    if homes.count() == 0 {
        return None;
    }
    let mut numbers = Vec::with_capacity(S::NUMBERS);
    if ranks.rank() == 0 {
        nodes.root()?.write(&mut numbers);
    }
    numbers.resize(S::NUMBERS, 0.0);
    share(ranks, 0, &mut numbers);
    Some(S::read(&numbers))
}

/// The nodes of the groups that this process joins, of whichever homes; `groups` has the sums of those whose home is here. Collective.
fn at_joiners<S: Sums>(homes: &Homes, particles: usize, groups: Vec<S>) -> Nodes<S> {
    let ranks = homes.ranks();
    let (own, of_homes) = homes.groups_of(particles);
    let mut own = own.into_iter().zip(groups).peekable();
    let to_joiner = |rank: usize| {
        let end = homes.first_group(rank + 1, particles);
        let groups = std::iter::from_fn(|| own.next_if(|(group, _)| *group < end));
        let Nodes(nodes) = Nodes::of_groups(groups);
        let mut numbers = Vec::with_capacity(nodes.len() * S::NUMBERS);
        nodes.iter().for_each(|(_, sums)| sums.write(&mut numbers));
        numbers
    };
    let out: Vec<Vec<f64>> = (0..ranks.count()).map(to_joiner).collect();
    let places_of = |groups: &Vec<usize>| {
        let successive = groups.chunk_by(|a, b| a + 1 == *b);
        let ranges = successive.map(|groups| groups[0]..groups[0] + groups.len());
        ranges.flat_map(Place::within).collect::<Vec<Place>>()
    };
    let places: Vec<Vec<Place>> = of_homes.iter().map(places_of).collect();
    let counts: Vec<usize> = places.iter().map(|places| places.len() * S::NUMBERS).collect();
    let numbers = exchange(ranks, &out, &counts);
    let sums = numbers.chunks_exact(S::NUMBERS).map(S::read);
    let mut found: Vec<(Place, S)> = places.into_iter().flatten().zip(sums).collect();
    found.sort_by_key(|(place, _)| place.first);
    let mut nodes = Nodes(Vec::new());
    found.into_iter().for_each(|(place, sums)| nodes.push(place, sums));
    nodes
}

fn receive(ranks: &dyn Ranks, from: usize, numbers: &mut [f64]) {
    if !numbers.is_empty() {
        ranks.receive(from, bytemuck::cast_slice_mut(numbers));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::homes::GROUP;
    use mmsmith_ranks::{Sent, counted, in_process};

    /// How sums were joined, as a number whose digits tell: no two trees have the same one.
    #[derive(Clone, Copy, Debug, PartialEq)]
    struct Sum(f64);

    impl Sums for Sum {
        const NUMBERS: usize = 1;

        fn join(&self, next: &Self) -> Self {
            Self((self.0 * 1.1 + next.0 * 0.7).sin())
        }

        fn write(&self, numbers: &mut Vec<f64>) {
            numbers.push(self.0);
        }

        fn read(numbers: &[f64]) -> Self {
            Self(numbers[0])
        }
    }

    fn group(number: usize) -> Sum {
        Sum(number as f64 + 0.3)
    }

    /// The tree as it is defined.
    fn expected(groups: Range<usize>) -> Sum {
        if groups.len() == 1 {
            return group(groups.start);
        }
        let half = groups.start + groups.len().next_power_of_two() / 2;
        expected(groups.start..half).join(&expected(half..groups.end))
    }

    /// Processes that hold successive particles, or every second run of two groups, or some here, some there.
    #[test]
    fn sums_have_one_shape_and_the_messages_that_their_formula_says() {
        let rules: [fn(usize, usize, usize) -> usize; 3] = [
            |id, count, all| id * count / all,
            |id, count, _| id / (2 * GROUP) % count,
            |id, count, _| id % count,
        ];
        for (rule, holder) in rules.into_iter().enumerate() {
            let mut most_bytes = 0;
            for all in [1, 5, 8, 37, 1000] {
                let particles = all * GROUP - 3;
                assert_eq!(joined((0..all).map(group)), Some(expected(0..all)));
                for count in [1, 2, 3, 4, 7, 8, 16, 33] {
                    let found = in_process(count, |ranks| {
                        let (ranks, traffic) = counted(ranks);
                        let own = ranks.rank();
                        let is_own = |id: &u64| holder(*id as usize, count, particles) == own;
                        let ids: Vec<u64> = (0..particles as u64).filter(is_own).collect();
                        let homes = Homes::new(ranks, &ids);
                        let (groups, _) = homes.groups_of(GROUP);
                        let before = traffic.sent();
                        let sums = groups.iter().map(|&number| group(number)).collect();
                        let sum = joined_over(&homes, GROUP, sums);
                        (sum, traffic.sent() - before, homes.first_group(own, GROUP), groups)
                    });
                    assert!(found.iter().all(|(sum, ..)| *sum == Some(expected(0..all))));
                    let first = |rank: usize| found.get(rank).map_or(all, |of| of.2);
                    for (rank, (_, sent, _, groups)) in found.iter().enumerate() {
                        let Pairs { heard, told } = Pairs::new(rank, count);
                        let end = heard.last().map_or(rank + 1, |part| part.end);
                        let nodes =
                            told.map_or(0, |_| Place::within(first(rank)..first(end)).count());
                        // To those that join the groups here.
                        let (mut messages, mut bytes) = (0, 0);
                        for other in (0..count).filter(|other| *other != rank) {
                            let range = first(other)..first(other + 1);
                            let of_other = groups.iter().filter(|group| range.contains(group));
                            let sums = of_other.map(|&number| (number, group(number)));
                            let Nodes(lent) = Nodes::of_groups(sums);
                            messages += usize::from(!lent.is_empty());
                            bytes += 8 * lent.len() as u64;
                        }
                        // What it tells, and the root, which it hands on.
                        messages += usize::from(nodes > 0) + heard.len();
                        bytes += 8 * (nodes + heard.len()) as u64;
                        assert_eq!(
                            *sent,
                            Sent { messages: messages as u64, bytes },
                            "{rank} of {count}"
                        );
                        assert!(nodes as u32 <= 2 * (all.ilog2() + 1), "{nodes}");
                        assert!(heard.len() as u32 <= count.next_power_of_two().ilog2());
                        most_bytes = most_bytes.max(bytes);
                    }
                }
            }
            // Not the 8 bytes of each group, where processes hold successive particles.
            assert!(rule > 0 || most_bytes < 250, "{most_bytes}");
        }
    }

    #[test]
    fn nothing_is_joined_without_groups() {
        assert_eq!(joined(Vec::<Sum>::new()), None);
        let found =
            in_process(3, |ranks| joined_over(&Homes::new(ranks, &[]), GROUP, Vec::<Sum>::new()));
        assert_eq!(found, [None; 3]);
    }
}
