//! Sums over the particles of several processes, to the bits of one.
//!
//! Sums go by groups of successive particle numbers. Each group has a home: the process that adds it up, and to which other processes
//! send values of its particles. Particles of a group mostly lie together in space, so that most particles are held by their home.

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
    /// The numbers of the particles whose home is here.
    here: Range<usize>,
    /// For each process, the places of the particles held here whose home it is; and the number of particles held there whose home is
    /// here.
    out: Vec<Range<usize>>,
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
        let first = |rank: usize| first_home(count, rank, ranks.count());
        let range = |rank: usize| first(rank)..first(rank + 1);
        let place = |number: usize| ids.partition_point(|&id| id < number as u64);
        let out: Vec<Range<usize>> = (0..ranks.count())
            .map(|rank| place(range(rank).start)..place(range(rank).end))
            .collect();
        let lengths: Vec<usize> = out.iter().map(Range::len).collect();
        let counts = announce(&*ranks, &lengths);
        let here = range(ranks.rank());
        let own = ids.len();
        let mut homes = Self { ranks, count, here, out, counts, own, order: Vec::new() };
        let others = homes.hear(|places| ids[places].to_vec());
        homes.order = vec![0; homes.here.len()];
        let own = homes.out[homes.ranks.rank()].clone().map(|place| (place, ids[place]));
        let others = others.into_iter().enumerate().map(|(place, id)| (ids.len() + place, id));
        for (place, id) in own.chain(others) {
            homes.order[id as usize - homes.here.start] = place as u32;
        }
        homes
    }

    /// Number of particles of all processes.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The number of the first particle whose home is a process, at the beginning of a group; the number of all particles for one process
    /// more than there are.
    pub(crate) fn first(&self, rank: usize) -> usize {
        first_home(self.count, rank, self.ranks.count())
    }

    /// The numbers of the particles whose home is here.
    pub fn here(&self) -> Range<usize> {
        self.here.clone()
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
    /// holds for other homes, from the places of the particles. Collective.
    pub fn hear<E: Pod>(&self, say: impl Fn(Range<usize>) -> Vec<E>) -> Vec<E> {
        let rank = self.ranks.rank();
        let of = |to: usize| if to == rank { Vec::new() } else { say(self.out[to].clone()) };
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
        (0..self.here.len()).map(of).collect()
    }
}

/// The first of `count` particles whose home is the process `rank` of `ranks`.
fn first_home(count: usize, rank: usize, ranks: usize) -> usize {
    (count.div_ceil(GROUP) * rank / ranks * GROUP).min(count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use mmsmith_ranks::in_process;

    #[test]
    fn every_particle_is_at_home_once_and_in_order() {
        for (count, all) in [(1, 10), (2, 5000), (3, 1024), (4, 9000), (5, 3)] {
            let found = in_process(count, |ranks| {
                let own = ranks.rank() as u64;
                // Some here, some there.
                let ids: Vec<u64> =
                    (0..all).filter(|id| id * 7 / 5 % count as u64 == own).collect();
                let homes = Homes::new(ranks, &ids);
                assert_eq!(homes.count(), all as usize);
                let doubled: Vec<u64> = ids.iter().map(|id| 2 * id).collect();
                (homes.here(), homes.bring(&doubled))
            });
            let mut next = 0;
            for (here, values) in found {
                assert_eq!((here.start, here.len()), (next, values.len()));
                assert!(here.start % GROUP == 0 || here.is_empty());
                next = here.end;
                assert!(here.zip(values).all(|(id, value)| value == 2 * id as u64));
            }
            assert_eq!(next, all as usize);
        }
    }
}
