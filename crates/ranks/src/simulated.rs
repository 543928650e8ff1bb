//! Ranks of a simulated cluster: threads of one process, of which one runs at a time, as a schedule says.
//!
//! A schedule, which follows from a number, decides after each call of a rank who goes on and which message arrives next. It delays messages
//! and lets some overtake others, as far as MPI does: those from one rank to another arrive in the order in which they were sent. It may
//! kill a rank, and ends the others some time later, as the launchers of MPI do. Nothing depends on a clock: where no rank can go on, or all only
//! look whether something has arrived, the simulation ends with who waits for whom.
//!
//! A rank has to call its functions from one thread at a time. Results can be repeated where it does so always in the same order.

use std::any::Any;
use std::collections::VecDeque;
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use crate::Ranks;

/// Events after which a simulation is taken for one that never ends.
const MOST_EVENTS: u64 = 500_000;

/// The course of a simulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Schedule {
    /// Who goes on and what arrives, as a number.
    pub seed: u64,
    /// A rank to kill, in place of its call of this number, from 1.
    pub kill: Option<(usize, u64)>,
}

/// How a simulation ended.
#[derive(Debug)]
pub struct Simulated<R> {
    /// The results of the ranks that have come to their end.
    pub results: Vec<Option<R>>,
    /// The calls of each rank.
    pub calls: Vec<u64>,
    /// Why the others have not.
    pub failed: Option<Failed>,
}

/// Why ranks have not come to their end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Failed {
    /// The schedule has killed a rank, after which all are ended.
    Killed {
        /// The rank.
        rank: usize,
    },
    /// Each rank waits for another one.
    Deadlock {
        /// For each rank that has not ended the one from which it awaits a message; `None` for the largest number of all.
        waiting: Vec<(usize, Option<usize>)>,
    },
    /// Ranks look for messages that nobody sends, or call each other for ever.
    Endless {
        /// The events until then.
        events: u64,
    },
    /// A message has another length than its receiver expects.
    Length {
        /// The sender.
        from: usize,
        /// The receiver.
        to: usize,
        /// Its bytes.
        sent: usize,
        /// The bytes expected.
        expected: usize,
    },
    /// A rank has panicked.
    Panicked {
        /// The rank.
        rank: usize,
        /// Its message, if it is text.
        message: String,
    },
}

impl fmt::Display for Failed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Killed { rank } => write!(f, "rank {rank} was killed"),
            Self::Deadlock { waiting } => {
                f.write_str("no rank can go on:")?;
                waiting.iter().try_for_each(|(rank, from)| match from {
                    Some(from) => write!(f, " {rank} waits for {from}"),
                    None => write!(f, " {rank} waits for all"),
                })
            }
            Self::Endless { events } => write!(f, "no end after {events} events"),
            Self::Length { from, to, sent, expected } => {
                write!(f, "{sent} bytes from rank {from}, where rank {to} expects {expected}")
            }
            Self::Panicked { rank, message } => write!(f, "rank {rank} has panicked: {message}"),
        }
    }
}

impl std::error::Error for Failed {}

/// Calls `work` on `count` threads, a thread for each rank, one of which runs at a time as the schedule says.
pub fn simulated<R: Send>(
    count: usize,
    schedule: Schedule,
    work: impl Fn(Arc<dyn Ranks>) -> R + Sync,
) -> Simulated<R> {
    let state = Mutex::new(State::new(count, schedule));
    let cluster = Arc::new(Cluster { state, turns: (0..count).map(|_| Condvar::new()).collect() });
    let (work, shared) = (&work, &cluster);
    let results = std::thread::scope(|scope| {
        let rank = |rank: usize| {
            scope.spawn(move || {
                let ranks = Arc::new(OfCluster { cluster: shared.clone(), rank });
                let ended = catch_unwind(AssertUnwindSafe(|| {
                    drop(shared.await_turn(shared.state(), rank));
                    work(ranks)
                }));
                shared.leave(rank, ended.as_ref().err());
                ended.ok()
            })
        };
        let threads: Vec<_> = (0..count).map(rank).collect();
        threads.into_iter().map(|thread| thread.join().ok().flatten()).collect()
    });
    let state = cluster.state();
    let calls = state.ranks.iter().map(|rank| rank.calls).collect();
    let killed = state.killed.map(|rank| Failed::Killed { rank });
    Simulated { results, calls, failed: state.failed.clone().or(killed) }
}

/// Unwinds a rank that has been ended.
struct Ended;

/// The doings of a rank.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Doing {
    Work,
    /// It waits for a message.
    Receive(usize),
    /// It waits for the largest number of this call of all.
    Largest(usize),
    Nothing,
}

struct OneRank {
    doing: Doing,
    calls: u64,
    /// Calls of [`Ranks::largest`].
    largest: usize,
    /// The chance that it goes on when its turn may have come, in 256ths.
    speed: u64,
}

/// The messages of one rank to another.
struct Channel {
    under_way: VecDeque<Vec<u8>>,
    arrived: VecDeque<Vec<u8>>,
    speed: u64,
}

struct State {
    random: Random,
    ranks: Vec<OneRank>,
    /// By sender and receiver.
    channels: Vec<Channel>,
    /// Ranks that have told their number, and the largest of these, by calls.
    largest: Vec<(usize, u64)>,
    turn: Option<usize>,
    events: u64,
    /// The chance that a message arrives before a rank goes on, in 256ths.
    delivery: u64,
    /// The chance that the rank that has run goes on, in 256ths.
    stay: u64,
    kill: Option<(usize, u64)>,
    killed: Option<usize>,
    /// The event at which all are ended after one was killed.
    end: u64,
    failed: Option<Failed>,
}

impl State {
    fn new(count: usize, Schedule { seed, kill }: Schedule) -> Self {
        let mut random = Random(seed);
        let (delivery, stay) = (random.of(&[8, 64, 128, 248]), random.of(&[0, 128, 250]));
        // Some are slow.
        let mut speed = || random.of(&[256, 256, 64, 4]);
        let rank = |speed| OneRank { doing: Doing::Work, calls: 0, largest: 0, speed };
        let ranks = (0..count).map(|_| rank(speed())).collect();
        let channel =
            |speed| Channel { under_way: VecDeque::new(), arrived: VecDeque::new(), speed };
        let channels = (0..count * count).map(|_| channel(speed())).collect();
        let mut state = Self {
            random,
            ranks,
            channels,
            largest: Vec::new(),
            turn: None,
            events: 0,
            delivery,
            stay,
            kill,
            killed: None,
            end: u64::MAX,
            failed: None,
        };
        state.pass_on();
        state
    }

    fn channel(&mut self, from: usize, to: usize) -> &mut Channel {
        let count = self.ranks.len();
        &mut self.channels[from * count + to]
    }

    fn can_run(&self, rank: usize) -> bool {
        let count = self.ranks.len();
        match self.ranks[rank].doing {
            Doing::Work => true,
            Doing::Receive(from) => !self.channels[from * count + rank].arrived.is_empty(),
            Doing::Largest(call) => self.largest[call].0 == count,
            Doing::Nothing => false,
        }
    }

    /// Lets messages arrive, and chooses the rank that goes on.
    fn pass_on(&mut self) {
        let before = self.turn.take();
        while self.failed.is_none() {
            self.events += 1;
            if self.events >= self.end {
                self.failed = self.killed.map(|rank| Failed::Killed { rank });
                return;
            }
            if self.events > MOST_EVENTS {
                self.failed = Some(Failed::Endless { events: self.events });
                return;
            }
            let able: Vec<usize> = (0..self.ranks.len()).filter(|&r| self.can_run(r)).collect();
            let is_under_way = |n: &usize| !self.channels[*n].under_way.is_empty();
            let late: Vec<usize> = (0..self.channels.len()).filter(is_under_way).collect();
            if able.is_empty() && late.is_empty() {
                self.failed = self.stuck();
                return;
            }
            if able.is_empty() || (!late.is_empty() && self.random.chance(self.delivery)) {
                let (random, channels) = (&mut self.random, &self.channels);
                let chosen = random.one_of(&late, |n| channels[n].speed);
                let channel = &mut self.channels[chosen];
                channel.arrived.extend(channel.under_way.pop_front());
                continue;
            }
            let same = before.filter(|&rank| self.can_run(rank) && self.random.chance(self.stay));
            let (random, ranks) = (&mut self.random, &self.ranks);
            let other = || random.one_of(&able, |rank| ranks[rank].speed);
            self.turn = Some(same.unwrap_or_else(other));
            return;
        }
    }

    /// Why no rank can go on, if not all have come to their end.
    fn stuck(&self) -> Option<Failed> {
        let waiting = self.ranks.iter().enumerate().filter_map(|(rank, of)| match of.doing {
            Doing::Work | Doing::Nothing => None,
            Doing::Receive(from) => Some((rank, Some(from))),
            Doing::Largest(_) => Some((rank, None)),
        });
        let waiting: Vec<_> = waiting.collect();
        match self.killed {
            _ if waiting.is_empty() => None,
            Some(rank) => Some(Failed::Killed { rank }),
            None => Some(Failed::Deadlock { waiting }),
        }
    }

    /// Kills a rank: some of its messages still arrive, of each channel the first ones.
    fn kill(&mut self, rank: usize) {
        self.killed = Some(rank);
        self.ranks[rank].doing = Doing::Nothing;
        for to in 0..self.ranks.len() {
            let sent = self.channel(rank, to).under_way.len() as u64;
            let left = self.random.below(sent + 1);
            self.channel(rank, to).under_way.truncate(left as usize);
        }
        let grace = self.random.of(&[1, 10, 100, 1000]);
        self.end = self.events + grace;
    }
}

struct Cluster {
    state: Mutex<State>,
    /// Where each rank waits for its turn.
    turns: Vec<Condvar>,
}

impl Cluster {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Wakes the rank whose turn it is, or all where they are ended.
    fn wake(&self, state: &State) {
        match state.turn {
            Some(rank) => self.turns[rank].notify_one(),
            None => self.turns.iter().for_each(Condvar::notify_one),
        }
    }

    fn await_turn<'a>(
        &'a self,
        mut state: MutexGuard<'a, State>,
        rank: usize,
    ) -> MutexGuard<'a, State> {
        while state.turn != Some(rank) && state.failed.is_none() {
            state = self.turns[rank].wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        if state.failed.is_some() {
            drop(state);
            resume_unwind(Box::new(Ended));
        }
        state
    }

    /// Lets others go on, and returns when it is this rank's turn and what it waits for is there.
    fn call<'a>(
        &'a self,
        mut state: MutexGuard<'a, State>,
        rank: usize,
        doing: Doing,
    ) -> MutexGuard<'a, State> {
        state.ranks[rank].calls += 1;
        if state.kill == Some((rank, state.ranks[rank].calls)) {
            state.kill(rank);
            state.pass_on();
            self.wake(&state);
            drop(state);
            resume_unwind(Box::new(Ended));
        }
        state.ranks[rank].doing = doing;
        state.pass_on();
        self.wake(&state);
        let mut state = self.await_turn(state, rank);
        state.ranks[rank].doing = Doing::Work;
        state
    }

    /// A rank has come to its end, or has panicked.
    fn leave(&self, rank: usize, panic: Option<&Box<dyn Any + Send>>) {
        let mut state = self.state();
        state.ranks[rank].doing = Doing::Nothing;
        if let Some(panic) = panic.filter(|panic| !panic.is::<Ended>()) {
            let text = panic.downcast_ref::<String>().cloned();
            let text = text.or_else(|| panic.downcast_ref::<&str>().map(|text| (*text).to_owned()));
            let message = text.unwrap_or_default();
            state.failed.get_or_insert(Failed::Panicked { rank, message });
        }
        if state.turn == Some(rank) {
            state.pass_on();
        }
        self.wake(&state);
    }
}

struct OfCluster {
    cluster: Arc<Cluster>,
    rank: usize,
}

impl Ranks for OfCluster {
    fn rank(&self) -> usize {
        self.rank
    }

    fn count(&self) -> usize {
        self.cluster.turns.len()
    }

    fn send(&self, to: usize, bytes: &[u8]) {
        let mut state = self.cluster.call(self.cluster.state(), self.rank, Doing::Work);
        state.channel(self.rank, to).under_way.push_back(bytes.to_vec());
    }

    fn receive(&self, from: usize, bytes: &mut [u8]) {
        let doing = Doing::Receive(from);
        let mut state = self.cluster.call(self.cluster.state(), self.rank, doing);
        let message = state.channel(from, self.rank).arrived.pop_front().unwrap_or_default();
        if message.len() != bytes.len() {
            let (to, sent, expected) = (self.rank, message.len(), bytes.len());
            state.failed.get_or_insert(Failed::Length { from, to, sent, expected });
            state.turn = None;
            self.cluster.wake(&state);
            drop(state);
            resume_unwind(Box::new(Ended));
        }
        bytes.copy_from_slice(&message);
    }

    fn has_arrived(&self, from: usize) -> bool {
        let mut state = self.cluster.call(self.cluster.state(), self.rank, Doing::Work);
        !state.channel(from, self.rank).arrived.is_empty()
    }

    fn largest(&self, value: u64) -> u64 {
        let mut state = self.cluster.state();
        let own = &mut state.ranks[self.rank];
        let call = own.largest;
        own.largest += 1;
        if state.largest.len() == call {
            state.largest.push((0, 0));
        }
        let (told, largest) = &mut state.largest[call];
        (*told, *largest) = (*told + 1, (*largest).max(value));
        self.cluster.call(state, self.rank, Doing::Largest(call)).largest[call].1
    }
}

/// SplitMix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, end: u64) -> u64 {
        self.next() % end
    }

    fn of(&mut self, values: &[u64]) -> u64 {
        values[self.below(values.len() as u64) as usize]
    }

    /// True so many times in 256.
    fn chance(&mut self, chance: u64) -> bool {
        self.next() >> 56 < chance
    }

    /// One of the given, those of little speed less often.
    fn one_of(&mut self, given: &[usize], speed: impl Fn(usize) -> u64) -> usize {
        let mut one = given[self.below(given.len() as u64) as usize];
        for _ in 0..16 {
            if self.chance(speed(one)) {
                break;
            }
            one = given[self.below(given.len() as u64) as usize];
        }
        one
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{gather, share, total};

    fn run<R: Send>(
        count: usize,
        seed: u64,
        work: impl Fn(&dyn Ranks) -> R + Sync,
    ) -> Simulated<R> {
        simulated(count, Schedule { seed, kill: None }, |ranks| work(&*ranks))
    }

    fn told(ranks: &dyn Ranks, to: usize, value: u8) {
        ranks.send(to, &[value]);
    }

    fn heard(ranks: &dyn Ranks, from: usize) -> u8 {
        let mut value = [0];
        ranks.receive(from, &mut value);
        value[0]
    }

    #[test]
    fn what_is_collective_has_one_result_under_every_schedule() {
        for seed in 0..200 {
            let count = 1 + seed as usize % 7;
            let found = run(count, seed, |ranks| {
                let own = ranks.rank() as u64;
                let mut shared = [own];
                share(ranks, count / 2, &mut shared);
                (gather(ranks, &[own]).len(), shared[0], total(ranks, own), ranks.largest(own))
            });
            assert_eq!(found.failed, None, "{seed}");
            for (rank, result) in found.results.into_iter().enumerate() {
                let last = count as u64 - 1;
                let gathered = if rank == 0 { count } else { 0 };
                let expected = (gathered, count as u64 / 2, last * count as u64 / 2, last);
                assert_eq!(result, Some(expected), "{seed}");
            }
        }
    }

    /// Either of two messages comes first; those of one rank come in order; and a seed repeats its course.
    #[test]
    fn a_program_that_takes_what_comes_first_has_several_results() {
        let first = |seed: u64| {
            let found = run(3, seed, |ranks| {
                if ranks.rank() > 0 {
                    (0..4).for_each(|n| told(ranks, 0, 10 * ranks.rank() as u8 + n));
                    return Vec::new();
                }
                let mut order = Vec::new();
                while order.len() < 8 {
                    for from in [1, 2] {
                        if ranks.has_arrived(from) {
                            order.push(heard(ranks, from));
                        }
                    }
                }
                order
            });
            assert_eq!(found.failed, None);
            found.results.into_iter().next().flatten().unwrap_or_default()
        };
        let orders: Vec<Vec<u8>> = (0..60).map(first).collect();
        for order in &orders {
            let of = |rank: u8| order.iter().copied().filter(move |value| value / 10 == rank);
            assert!(of(1).is_sorted() && of(2).is_sorted() && order.len() == 8, "{order:?}");
        }
        let mut kinds = orders.clone();
        kinds.sort();
        kinds.dedup();
        assert!(kinds.len() > 10, "{} kinds", kinds.len());
        assert_eq!(orders, (0..60).map(first).collect::<Vec<_>>());
    }

    #[test]
    fn ranks_that_wait_for_each_other_are_named() {
        for seed in 0..20 {
            let found = run(3, seed, |ranks| {
                let (own, count) = (ranks.rank(), ranks.count());
                heard(ranks, (own + 1) % count);
                told(ranks, (own + 2) % count, 1);
            });
            let waiting = vec![(0, Some(1)), (1, Some(2)), (2, Some(0))];
            assert_eq!(found.failed, Some(Failed::Deadlock { waiting }));
            let found = run(2, seed, |ranks| (ranks.rank() == 0).then(|| ranks.largest(1)));
            let expected = Failed::Deadlock { waiting: vec![(0, None)] };
            assert_eq!((found.failed, found.results[1]), (Some(expected), Some(None)));
        }
    }

    #[test]
    fn ranks_that_look_for_what_nobody_sends_are_no_hang() {
        let found = run(2, 1, |ranks| while !ranks.has_arrived(1 - ranks.rank()) {});
        assert!(matches!(found.failed, Some(Failed::Endless { .. })), "{:?}", found.failed);
    }

    #[test]
    fn lengths_and_panics_are_told_with_their_ranks() {
        let found = run(2, 3, |ranks| match ranks.rank() {
            0 => ranks.send(1, &[1, 2]),
            _ => drop(heard(ranks, 0)),
        });
        let length = Failed::Length { from: 0, to: 1, sent: 2, expected: 1 };
        assert_eq!(found.failed, Some(length));
        let found = run(2, 3, |ranks| match ranks.rank() {
            0 => std::panic::resume_unwind(Box::new("too bad")),
            _ => heard(ranks, 0),
        });
        let panicked = Failed::Panicked { rank: 0, message: "too bad".into() };
        assert_eq!(found.failed, Some(panicked));
    }

    #[test]
    fn a_killed_rank_is_named_whatever_the_others_do() {
        let (mut ended, mut done) = (0, 0);
        for seed in 0..200 {
            let kill = Some((seed as usize % 3, 1 + seed / 3 % 12));
            let found = simulated(3, Schedule { seed, kill }, |ranks| {
                (0..4).map(|n| total(&*ranks, n)).sum::<u64>()
            });
            let killed =
                found.calls[kill.map_or(0, |kill| kill.0)] == kill.map_or(0, |kill| kill.1);
            let expected = killed.then_some(Failed::Killed { rank: seed as usize % 3 });
            assert_eq!(found.failed, expected, "{seed}");
            for result in found.results {
                match result {
                    Some(result) => (done, _) = (done + 1, assert_eq!(result, 3 * (1 + 2 + 3))),
                    None => ended += 1,
                }
            }
        }
        assert!(ended > 100 && done > 50, "{ended} {done}");
    }
}
