//! Sums over the particles of several processes, to the bits of one.
//!
//! Sums go by groups of successive particle numbers. Each group has a home: the process that holds most of its particles, which adds it up,
//! and to which other processes send values of the rest. The sums of successive groups are joined by one process, whatever their homes are.

use std::ops::Range;
use std::sync::Arc;

use bytemuck::Pod;
use mmsmith_ranks::{Ranks, announce, exchange, total};

/// Number of particles in the largest group of any sum; the sizes of smaller groups divide it.
pub(crate) const GROUP: usize = 1024;

/// The homes of the particles that this process holds, and the holders of the particles whose home is here.
pub struct Homes {
    ranks: Arc<dyn Ranks>,
    /// Number of particles of all processes.
    count: usize,
    /// The groups whose home is here, ascending.
    groups: Vec<usize>,
    /// For each home its groups among those that this process joins, ascending.
    joined: Vec<Vec<usize>>,
    /// For each process, the places of the particles held here whose home it is; and the number of particles held there whose home is
    /// here.
    out: Vec<Vec<Range<usize>>>,
    counts: Vec<usize>,
    /// Number of particles held here.
    own: usize,
    /// For each particle whose home is here its place: among the particles held here, or behind them, among the particles received from
    /// other processes.
    order: Vec<u32>,
}

/// The process that holds a particle whose home is here.
pub enum Holder {
    /// This process, with the particle at this place among its particles.
    Here(usize),
    /// Another process. Its value for the particle has this place among all values [received](Homes::hear).
    Other(usize),
}

impl Homes {
    /// For a process that holds the particles `ids`, in ascending order. Collective.
    pub fn new(ranks: Arc<dyn Ranks>, ids: &[u64]) -> Self {
        let count = total(&*ranks, ids.len() as u64) as usize;
        // Each group with the places of its particles here.
        let group = |id: &u64| *id as usize / GROUP;
        let mut place = 0;
        let of_groups = ids.chunk_by(|a, b| group(a) == group(b)).map(|own| {
            place += own.len();
            (group(&own[0]), place - own.len()..place)
        });
        let of_groups: Vec<(usize, Range<usize>)> = of_groups.collect();
        let (homes, joined) = find_homes(&*ranks, count, &of_groups);
        let mut out: Vec<Vec<Range<usize>>> = vec![Vec::new(); ranks.count()];
        for ((_, places), &home) in of_groups.iter().zip(&homes) {
            match out[home].last_mut() {
                Some(run) if run.end == places.start => run.end = places.end,
                _ => out[home].push(places.clone()),
            }
        }
        let lengths: Vec<usize> =
            out.iter().map(|runs| runs.iter().map(ExactSizeIterator::len).sum()).collect();
        let counts = announce(&*ranks, &lengths);
        let rank = ranks.rank();
        let own_groups = of_groups.iter().zip(&homes).filter(|(_, home)| **home == rank);
        let groups: Vec<usize> = own_groups.map(|((group, _), _)| *group).collect();
        let here = groups.iter().map(|group| GROUP.min(count - group * GROUP)).sum();
        let own = ids.len();
        let mut all = Self { ranks, count, groups, joined, out, counts, own, order: Vec::new() };
        let others = all.hear(|places| ids[places].to_vec());
        let own = all.out[rank].iter().flat_map(|run| run.clone().map(|place| (place, ids[place])));
        let others = others.into_iter().enumerate().map(|(place, id)| (ids.len() + place, id));
        let mut of_group = 0;
        let mut order = vec![0; here];
        let mut put = |(place, id): (usize, u64)| {
            let group = id as usize / GROUP;
            // Mostly that of the particle before.
            if all.groups.get(of_group) != Some(&group) {
                of_group = all.groups.partition_point(|own| *own < group);
            }
            order[of_group * GROUP + id as usize % GROUP] = place as u32;
        };
        own.chain(others).for_each(&mut put);
        all.order = order;
        all
    }

    /// Number of particles of all processes.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Number of particles whose home is here; their places count them in the order of their numbers.
    pub fn here(&self) -> usize {
        self.order.len()
    }

    /// The groups whose home is here, and of those that this process joins the ones of each home, as groups of so many particles, ascending.
    pub(crate) fn groups_of(&self, particles: usize) -> (Vec<usize>, Vec<Vec<usize>>) {
        let (each, all) = (GROUP / particles, self.count.div_ceil(particles));
        let divided = |groups: &Vec<usize>| {
            let groups = groups.iter().flat_map(|group| group * each..(group + 1) * each);
            groups.filter(|group| *group < all).collect()
        };
        (divided(&self.groups), self.joined.iter().map(divided).collect())
    }

    /// The first group of so many particles that a process joins; the number of all groups for one process more than there are.
    pub(crate) fn first_group(&self, rank: usize, particles: usize) -> usize {
        let first = first_joined(self.count, rank, self.ranks.count());
        (first * GROUP / particles).min(self.count.div_ceil(particles))
    }

    /// The processes.
    pub fn ranks(&self) -> &dyn Ranks {
        &*self.ranks
    }

    /// The process that holds the particle at this place among the particles whose home is here.
    #[must_use]
    pub fn holder(&self, place: usize) -> Holder {
        let place = self.order[place] as usize;
        place.checked_sub(self.own).map_or(Holder::Here(place), Holder::Other)
    }

    /// Receives values for particles whose home is here from the processes that hold them. `say` computes the values that this process
    /// holds for other homes, from the places of successive particles. Collective.
    pub fn hear<E: Pod>(&self, say: impl Fn(Range<usize>) -> Vec<E>) -> Vec<E> {
        let rank = self.ranks.rank();
        let of = |to: usize| match to == rank {
            true => Vec::new(),
            false => self.out[to].iter().flat_map(|run| say(run.clone())).collect(),
        };
        let out: Vec<Vec<E>> = (0..self.out.len()).map(of).collect();
        let mut counts = self.counts.clone();
        counts[rank] = 0;
        exchange(&*self.ranks, &out, &counts)
    }

    /// Values of all particles whose home is here, in the order of the particles' numbers; `own` has the values of the particles held
    /// here. Collective.
    pub fn bring<E: Pod>(&self, own: &[E]) -> Vec<E> {
        let others = self.hear(|places| own[places].to_vec());
        let of = |place| match self.holder(place) {
            Holder::Here(place) => own[place],
            Holder::Other(place) => others[place],
        };
        (0..self.here()).map(of).collect()
    }
}

/// The homes of some groups, whose particles are at these places of this process; and of the groups that this process joins those of each
/// home. Collective.
fn find_homes(
    ranks: &dyn Ranks,
    count: usize,
    of_groups: &[(usize, Range<usize>)],
) -> (Vec<usize>, Vec<Vec<usize>>) {
    let first = |rank: usize| first_joined(count, rank, ranks.count());
    let range = |rank: usize| {
        let place = |group: usize| of_groups.partition_point(|(own, _)| *own < group);
        &of_groups[place(first(rank))..place(first(rank + 1))]
    };
    let number = |(group, places): &(usize, Range<usize>)| [*group as u64, places.len() as u64];
    let held: Vec<Vec<[u64; 2]>> =
        (0..ranks.count()).map(|rank| range(rank).iter().map(number).collect()).collect();
    let lengths: Vec<usize> = held.iter().map(Vec::len).collect();
    let counts = announce(ranks, &lengths);
    let told = exchange(ranks, &held, &counts);
    // Of each group that this process joins the most particles that a process has, and this process.
    let own = first(ranks.rank());
    let mut homes = vec![(0, 0); first(ranks.rank() + 1) - own];
    let mut rest = &told[..];
    let of_ranks: Vec<&[[u64; 2]]> =
        counts.iter().map(|&count| rest.split_off(..count).unwrap_or_default()).collect();
    for (rank, of_rank) in of_ranks.iter().enumerate() {
        for [group, particles] in of_rank.iter() {
            let home = &mut homes[*group as usize - own];
            if *particles > home.0 {
                *home = (*particles, rank);
            }
        }
    }
    let mut joined = vec![Vec::new(); ranks.count()];
    for (group, (_, home)) in (own..).zip(&homes) {
        joined[*home].push(group);
    }
    let home = |[group, _]: &[u64; 2]| homes[*group as usize - own].1 as u64;
    let answers: Vec<Vec<u64>> =
        of_ranks.iter().map(|of_rank| of_rank.iter().map(home).collect()).collect();
    let homes = exchange(ranks, &answers, &lengths);
    (homes.into_iter().map(|home| home as usize).collect(), joined)
}

/// The first group of `count` particles that the process `rank` of `ranks` joins.
fn first_joined(count: usize, rank: usize, ranks: usize) -> usize {
    count.div_ceil(GROUP) * rank / ranks
}

#[cfg(test)]
mod tests {
    use super::*;
    use mmsmith_ranks::in_process;

    #[test]
    fn every_particle_is_at_home_once_and_in_order() {
        for (count, all) in [(1, 10), (2, 5000), (3, 1024), (4, 9000), (5, 3), (4, 70_000)] {
            // Some here, some there; runs of particles; most of each group at one process.
            let rules: [fn(u64) -> u64; 3] = [|id| id * 7 / 5, |id| id / 300, |id| id / 1500];
            for holder in rules {
                let found = in_process(count, |ranks| {
                    let own = ranks.rank() as u64;
                    let ids: Vec<u64> =
                        (0..all).filter(|id| holder(*id) % count as u64 == own).collect();
                    let homes = Homes::new(ranks, &ids);
                    assert_eq!(homes.count(), all as usize);
                    let doubled: Vec<u64> = ids.iter().map(|id| 2 * id).collect();
                    let (groups, joined) = homes.groups_of(GROUP);
                    (groups, homes.bring(&doubled), joined, ids.len())
                });
                let mut numbers = Vec::new();
                for (groups, values, ..) in &found {
                    let of = |group: &usize| group * GROUP..(all as usize).min((group + 1) * GROUP);
                    let ids: Vec<u64> = groups.iter().flat_map(of).map(|id| id as u64).collect();
                    assert!(groups.is_sorted());
                    assert!(ids.iter().map(|id| 2 * id).eq(values.iter().copied()));
                    numbers.extend(ids);
                }
                numbers.sort_unstable();
                assert!(numbers.into_iter().eq(0..all));
                // A process joins successive groups.
                let joined: Vec<usize> = found
                    .iter()
                    .flat_map(|(_, _, joined, _)| {
                        let mut joined = joined.concat();
                        joined.sort_unstable();
                        joined
                    })
                    .collect();
                assert!(joined.into_iter().eq(0..(all as usize).div_ceil(GROUP)));
                for (rank, (groups, ..)) in found.iter().enumerate() {
                    let mut of_rank: Vec<usize> =
                        found.iter().flat_map(|(_, _, joined, _)| joined[rank].clone()).collect();
                    of_rank.sort_unstable();
                    assert_eq!(&of_rank, groups);
                }
            }
        }
    }

    /// Where each group is held by one process nothing is sent but sums.
    #[test]
    fn groups_are_at_home_where_they_are_held() {
        let found = in_process(3, |ranks| {
            let own = ranks.rank() as u64;
            let (ranks, traffic) = mmsmith_ranks::counted(ranks);
            let ids: Vec<u64> = (0..50_000).filter(|id| id / GROUP as u64 / 2 % 3 == own).collect();
            let homes = Homes::new(ranks, &ids);
            let before = traffic.sent();
            assert_eq!(homes.bring(&ids), ids);
            traffic.sent() - before
        });
        assert_eq!(found, [mmsmith_ranks::Sent::default(); 3]);
    }
}
