//! Messages between the processes of one run: plain bytes, of lengths that both sides know.
//!
//! A [`Ranks`] is one process among several. The solver and the measurement need little of it: sending, receiving, and the largest of
//! some whole numbers. Floating-point numbers are never summed here, since such a sum would depend on the order of the processes.
//!
//! A function called *collective* is called by all processes, in the same order.
//!
//! [`in_process()`] gives ranks that are threads of one process, for tests, and [`simulated()`] those of a cluster whose messages come late
//! and whose processes are killed. [`arranged()`] asks for a grid of processes. The crate `mmsmith-message-passing` gives those of MPI.

mod arranged;
mod directory;
mod in_process;
mod moves;
mod pairs;
mod simulated;
mod traffic;

use bytemuck::{AnyBitPattern, NoUninit, bytes_of, bytes_of_mut, cast_slice, cast_slice_mut};

pub use arranged::arranged;
pub use directory::{Answers, Directory};
pub use in_process::in_process;
pub use moves::{Lists, Move, Source};
pub use pairs::Pairs;
pub use simulated::{Failed, Schedule, Simulated, simulated};
pub use traffic::{Sent, Traffic, counted};

/// One of the processes of a run.
///
/// Collective functions are called by all processes in the same order. Messages from one rank to another arrive in the order in which
/// they were sent.
pub trait Ranks: Send + Sync {
    /// The number of this process, from 0.
    fn rank(&self) -> usize;

    /// The number of processes.
    fn count(&self) -> usize;

    /// How many processes a grid of them has along each axis, where that is asked for. Default: whoever uses them chooses.
    fn along_axes(&self) -> Option<&[usize]> {
        None
    }

    /// Sends a message, and does not wait for it to arrive.
    fn send(&self, to: usize, bytes: &[u8]);

    /// Waits for the next message of another rank, whose length must be the length of `bytes`.
    fn receive(&self, from: usize, bytes: &mut [u8]);

    /// Whether a message of another rank has arrived, so that [`receive`](Self::receive) would not wait.
    fn has_arrived(&self, from: usize) -> bool;

    /// The largest number of all ranks. Collective.
    fn largest(&self, value: u64) -> u64;
}

/// Exchanges elements: `out` has the elements for each rank, and the result the elements from each rank, in the order of the ranks.
/// Collective.
///
/// Empty messages are not sent. `counts` has the number of elements that each rank sends here.
pub fn exchange<E: NoUninit + AnyBitPattern>(
    ranks: &dyn Ranks,
    out: &[Vec<E>],
    counts: &[usize],
) -> Vec<E> {
    for (to, elements) in out.iter().enumerate() {
        if to != ranks.rank() && !elements.is_empty() {
            ranks.send(to, cast_slice(elements));
        }
    }
    let mut all = Vec::with_capacity(counts.iter().sum());
    for (from, &count) in counts.iter().enumerate() {
        if from == ranks.rank() {
            all.extend_from_slice(&out[from]);
            continue;
        }
        let start = all.len();
        all.resize(start + count, E::zeroed());
        if count > 0 {
            ranks.receive(from, cast_slice_mut(&mut all[start..]));
        }
    }
    all
}

/// The number of elements that each rank will send here; `out` has the number that this rank sends to each. Collective.
pub fn announce(ranks: &dyn Ranks, out: &[usize]) -> Vec<usize> {
    let own = ranks.rank();
    for (to, &count) in out.iter().enumerate().filter(|(to, _)| *to != own) {
        ranks.send(to, bytes_of(&(count as u64)));
    }
    let receive = |from: usize| {
        if from == own {
            return out[own];
        }
        let mut count = 0_u64;
        ranks.receive(from, bytemuck::bytes_of_mut(&mut count));
        count as usize
    };
    (0..ranks.count()).map(receive).collect()
}

/// The elements of all ranks, one after the other, at rank 0; nothing at other ranks. Collective.
///
/// Each rank hears of at most log2(count) others.
pub fn gather<E: NoUninit + AnyBitPattern>(ranks: &dyn Ranks, own: &[E]) -> Vec<E> {
    gather_by(ranks, own.to_vec(), &|all, next| all.extend_from_slice(&next))
}

/// As [`gather`], where `join` makes one list of that of some ranks and that of the ranks that follow. Collective.
pub fn gather_by<E: NoUninit + AnyBitPattern>(
    ranks: &dyn Ranks,
    mut own: Vec<E>,
    join: &dyn Fn(&mut Vec<E>, Vec<E>),
) -> Vec<E> {
    let Pairs { heard, told } = Pairs::of(ranks);
    for from in heard {
        let mut count = 0_u64;
        ranks.receive(from.start, bytes_of_mut(&mut count));
        let mut next = vec![E::zeroed(); count as usize];
        if count > 0 {
            ranks.receive(from.start, cast_slice_mut(&mut next));
        }
        join(&mut own, next);
    }
    let Some(to) = told else { return own };
    ranks.send(to, bytes_of(&(own.len() as u64)));
    if !own.is_empty() {
        ranks.send(to, cast_slice(&own));
    }
    Vec::new()
}

/// Copies the elements of the rank `from` to all ranks, which have the same number of elements. Collective.
///
/// Each rank tells at most log2(count) others.
pub fn share<E: NoUninit + AnyBitPattern>(ranks: &dyn Ranks, from: usize, elements: &mut [E]) {
    let count = ranks.count();
    // As if `from` were the first.
    let Pairs { heard, told } = Pairs::new((ranks.rank() + count - from) % count, count);
    if let Some(told) = told {
        ranks.receive((told + from) % count, cast_slice_mut(elements));
    }
    // The largest part of the ranks first, which has the longest way.
    for part in heard.iter().rev() {
        ranks.send((part.start + from) % count, cast_slice(elements));
    }
}

/// Adds the numbers of all ranks, place by place, at rank 0; at other ranks the numbers are those of a part. Collective.
pub fn add_to_first(ranks: &dyn Ranks, numbers: &mut [u64]) {
    let Pairs { heard, told } = Pairs::of(ranks);
    let mut next = vec![0; numbers.len()];
    for from in heard {
        ranks.receive(from.start, cast_slice_mut(&mut next));
        numbers.iter_mut().zip(&next).for_each(|(number, next)| *number += next);
    }
    if let Some(to) = told {
        ranks.send(to, cast_slice(numbers));
    }
}

/// The sum of the whole numbers of all ranks. Collective.
pub fn total(ranks: &dyn Ranks, own: u64) -> u64 {
    let mut total = [own];
    add_to_first(ranks, &mut total);
    share(ranks, 0, &mut total);
    total[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_ranks_send_arrives_in_order() {
        for count in 1..=5 {
            let found = in_process(count, |ranks| {
                let ranks = &*ranks;
                let own = ranks.rank();
                let out: Vec<Vec<u64>> =
                    (0..count).map(|to| vec![(10 * own + to) as u64; to + own]).collect();
                let lengths: Vec<usize> = out.iter().map(Vec::len).collect();
                let counts = announce(ranks, &lengths);
                let all = exchange(ranks, &out, &counts);
                let gathered = gather(ranks, &all);
                // In its own time.
                ranks.send((own + 1) % count, &[own as u8]);
                let before = (own + count - 1) % count;
                while !ranks.has_arrived(before) {
                    std::thread::yield_now();
                }
                let mut sender = [0];
                ranks.receive(before, &mut sender);
                assert_eq!(sender[0] as usize, before);
                let mut shared = [all.len() as u64, own as u64];
                share(ranks, count - 1, &mut shared);
                assert_eq!(total(ranks, 1 + own as u64), (1..=count as u64).sum());
                let largest = |all: &mut Vec<u64>, next: Vec<u64>| all[0] = all[0].max(next[0]);
                let found = gather_by(ranks, vec![10 + own as u64], &largest);
                assert_eq!(found, if own == 0 { vec![9 + count as u64] } else { Vec::new() });
                (all, gathered, shared, ranks.largest(own as u64))
            });
            let expected = |own: usize| -> Vec<u64> {
                (0..count).flat_map(|from| vec![(10 * from + own) as u64; own + from]).collect()
            };
            let everything: Vec<u64> = (0..count).flat_map(expected).collect();
            let last = expected(count - 1).len() as u64;
            for (own, (all, gathered, shared, largest)) in found.into_iter().enumerate() {
                assert_eq!(all, expected(own));
                assert_eq!(gathered, if own == 0 { everything.clone() } else { Vec::new() });
                assert_eq!((shared, largest), ([last, count as u64 - 1], count as u64 - 1));
            }
        }
    }

    #[test]
    fn traffic_is_counted() {
        let found = in_process(2, |ranks| {
            let (ranks, traffic) = counted(ranks);
            if ranks.rank() == 0 {
                ranks.send(1, &[1, 2, 3]);
                ranks.send(1, &[4]);
            } else {
                let (mut first, mut second) = ([0; 3], [0; 1]);
                ranks.receive(0, &mut first);
                ranks.receive(0, &mut second);
                assert_eq!((first, second), ([1, 2, 3], [4]));
            }
            traffic.sent()
        });
        assert_eq!(found, [Sent { messages: 2, bytes: 4 }, Sent::default()]);
    }

    /// The first rank hears no more messages than log2(count), and of no list more than its length.
    #[test]
    fn nothing_but_what_is_asked_for_grows_with_the_number_of_ranks() {
        for count in [1, 2, 3, 6, 8, 13, 32] {
            let found = in_process(count, |ranks| {
                let (ranks, traffic) = counted(ranks);
                let sent = |work: &dyn Fn()| {
                    let before = traffic.sent();
                    work();
                    traffic.sent() - before
                };
                let added = sent(&|| add_to_first(&*ranks, &mut [1; 5]));
                let shared = sent(&|| share(&*ranks, count / 2, &mut [1_u64; 3]));
                let gathered = sent(&|| drop(gather(&*ranks, &[1_u64])));
                (added, shared, gathered, Pairs::of(&*ranks).heard.len() as u32)
            });
            let most = count.next_power_of_two().ilog2();
            let others = count as u64 - 1;
            let all = |of: &dyn Fn(usize) -> Sent| {
                let add = |a: Sent, b: Sent| Sent {
                    messages: a.messages + b.messages,
                    bytes: a.bytes + b.bytes,
                };
                (0..count).map(of).fold(Sent::default(), add)
            };
            assert_eq!(all(&|n| found[n].0), Sent { messages: others, bytes: 40 * others });
            assert_eq!(all(&|n| found[n].1), Sent { messages: others, bytes: 24 * others });
            assert_eq!(all(&|n| found[n].2).messages, 2 * others);
            for (added, shared, gathered, heard) in found {
                assert!(added.messages <= 1 && gathered.messages <= 2 && heard <= most);
                assert!(shared.messages <= most.into(), "{shared:?} of {count}");
            }
        }
    }
}
