//! Elements that processes have read from files, found by their numbers: each is first brought to a process that follows from its number.

use std::slice;
use std::sync::Arc;

use bytemuck::Pod;

use crate::moves::Move;
use crate::{Ranks, announce, exchange};

/// Where elements are by their numbers.
pub struct Directory {
    ranks: Option<Arc<dyn Ranks>>,
    /// To the processes that answer for them.
    moved: Move,
    /// The numbers of those for which this process answers, ascending; one may occur several times, with equal elements.
    numbers: Vec<u64>,
}

/// The answers to the questions of all processes.
pub struct Answers {
    ranks: Option<Arc<dyn Ranks>>,
    moved: Move,
    /// The places of the elements that each process asks this one for.
    out: Vec<Vec<u32>>,
    /// How many this process asks each one for.
    counts: Vec<usize>,
    /// For each element that this process wants its place among those that come.
    order: Vec<u32>,
    /// Whether this process has all that it is asked for, and nothing else.
    pub is_whole: bool,
    /// Whether it has each only once.
    pub is_unique: bool,
}

impl Directory {
    /// A directory of the elements with these numbers, which this process has. Collective.
    pub fn new(ranks: Option<&Arc<dyn Ranks>>, numbers: &[u64]) -> Self {
        let processes = ranks.map_or(1, |ranks| ranks.count());
        let homes: Vec<usize> = numbers.iter().map(|&number| home(number, processes)).collect();
        let (moved, numbers) = Move::new(ranks, numbers, &|k| slice::from_ref(&homes[k]));
        Self { ranks: ranks.cloned(), moved, numbers }
    }

    /// Asks for the elements with the numbers `wanted`. Collective.
    pub fn ask(self, wanted: &[u64]) -> Answers {
        let Self { ranks, moved, numbers } = self;
        let processes = ranks.as_ref().map_or(1, |ranks| ranks.count());
        let mut questions = vec![Vec::new(); processes];
        let mut place = Vec::with_capacity(wanted.len());
        for &number in wanted {
            let questions = &mut questions[home(number, processes)];
            place.push(questions.len());
            questions.push(number);
        }
        let counts: Vec<usize> = questions.iter().map(Vec::len).collect();
        let before = |home: usize| counts[..home].iter().sum::<usize>();
        let starts: Vec<usize> = (0..processes).map(before).collect();
        let order = wanted.iter().zip(place);
        let order = order
            .map(|(&number, place)| (starts[home(number, processes)] + place) as u32)
            .collect();
        let (lengths, asked) = match &ranks {
            Some(ranks) => {
                let lengths = announce(&**ranks, &counts);
                let asked = exchange(&**ranks, &questions, &lengths);
                (lengths, asked)
            }
            None => (counts.clone(), questions.concat()),
        };
        let mut is_asked_for = vec![false; numbers.len()];
        let mut is_known = true;
        let places = asked.iter().map(|number| {
            let found = numbers.partition_point(|known| known < number);
            let equal = numbers[found..].iter().take_while(|known| *known == number).count();
            is_asked_for[found..found + equal].fill(true);
            is_known &= equal > 0;
            found as u32
        });
        let places: Vec<u32> = places.collect();
        let mut rest = places.into_iter();
        let out = lengths.iter().map(|&count| rest.by_ref().take(count).collect()).collect();
        let is_whole = is_known && is_asked_for.iter().all(|is_asked_for| *is_asked_for);
        let is_unique = numbers.windows(2).all(|pair| pair[0] != pair[1]);
        Answers { ranks, moved, out, counts, order, is_whole, is_unique }
    }
}

impl Answers {
    /// The elements that this process has asked for, in that order. Collective, where all processes' answers are whole.
    pub fn fetch<E: Pod>(&self, elements: &[E]) -> Vec<E> {
        self.fetch_shares(1, elements)
    }

    /// As [`fetch`](Self::fetch) of lists of `share` elements each.
    pub fn fetch_shares<E: Pod>(&self, share: usize, elements: &[E]) -> Vec<E> {
        let here = self.moved.all_shares(share, elements);
        fn pick<E: Copy>(all: &[E], share: usize, places: &[u32]) -> Vec<E> {
            let of = |&place: &u32| &all[place as usize * share..][..share];
            places.iter().flat_map(of).copied().collect()
        }
        let out: Vec<Vec<E>> = self.out.iter().map(|places| pick(&here, share, places)).collect();
        let counts: Vec<usize> = self.counts.iter().map(|count| count * share).collect();
        let come = match &self.ranks {
            Some(ranks) => exchange(&**ranks, &out, &counts),
            None => out.concat(),
        };
        pick(&come, share, &self.order)
    }
}

/// The process that answers for the element of a number.
fn home(number: u64, processes: usize) -> usize {
    (number % processes as u64) as usize
}
