//! Branch and bound: a box is halved until the bound holds on every part.

use crate::CertifyError;
use crate::interval::Interval;
use crate::propagate::Judgement;
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::fmt::Write;

/// Bounds of factors are multiples of one over this number.
pub const STEPS_OF_FACTOR: f64 = 4.0;

/// Factors above this limit are not computed.
const MOST_TOLD: f64 = 1e5;
/// Factors of halvings are compared to one over this number.
const FINE_STEPS: f64 = 1024.0;

/// The halvings of a box and of its parts, until the bound held on each part.
#[derive(Clone, Debug, PartialEq)]
pub struct Proof {
    /// In pre-order: a digit is the input along which a box is halved, and the lower half follows, then the upper one; a
    /// letter is a box on which the factor is at most as many quarters as its place in the alphabet of [`letter`].
    pub tree: String,
    /// The number of boxes that were not halved.
    pub leaves: usize,
    /// The largest factor of the boxes.
    pub factor: f64,
}

/// The place where a proof did not close: the part with the largest bound among the remaining parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Open {
    /// The range of each input.
    pub bounds: Vec<Interval>,
    /// The bound of the factor there, which holds everywhere; infinite where there is none.
    pub factor: f64,
}

/// The letter for a factor in quarters: A is one quarter, Z is 26, a is 27, f is 32.
#[must_use]
pub fn letter(quarters: u32) -> Option<char> {
    let place = u8::try_from(quarters.checked_sub(1)?).ok()?;
    match place {
        0..26 => Some(char::from(b'A' + place)),
        26..52 => Some(char::from(b'a' + (place - 26))),
        _ => None,
    }
}

/// The factor of the last letter.
pub const LARGEST_WRITTEN: f64 = 13.0;
/// A tree names inputs by one digit.
const MOST_INPUTS: usize = 10;

/// A smaller decrease of the logarithms of both halves' factors counts as none.
const LEAST_GAIN: f64 = 1e-6;
/// An input is halved only if the share of its range in the whole range is at least the largest share divided by this number. Both
/// numbers are tried in turn: some fields need halvings of several inputs together before anything is gained, others of one input
/// alone.
const SLENDER: [f64; 2] = [1.5, 8.0];
/// A proof with so few boxes is short enough.
const FEW: usize = 50;

/// Limits of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// The factor to be proved; a tree cannot state more than [`LARGEST_WRITTEN`].
    pub factor: f64,
    /// The most boxes.
    pub boxes: usize,
}

/// Proves that the factor of `judgement` is at most that of `limits` over `bounds`. `step` receives the finished share of the volume.
///
/// # Errors
///
/// [`CertifyError::Open`] with the box of the largest bound, where the boxes of `limits` do not suffice.
pub fn prove(
    judgement: &Judgement,
    bounds: &[Interval],
    limits: Limits,
    step: &mut dyn FnMut(f64),
) -> Result<Proof, CertifyError> {
    let inputs = effective(judgement, bounds);
    let limits = Limits { factor: limits.factor.min(LARGEST_WRITTEN), ..limits };
    let mut found: Result<Proof, CertifyError> = Err(CertifyError::Unsupported(String::new()));
    for slender in SLENDER {
        let boxes = found.as_ref().map_or(limits.boxes, |proof| proof.leaves);
        let mut search = Search {
            judgement,
            root: bounds,
            inputs: &inputs,
            limits: Limits { boxes, ..limits },
            slender,
            parts: Vec::new(),
            step: &mut *step,
        };
        let outcome = search.whole();
        match (outcome, &found) {
            (Ok(proof), Ok(known)) if known.leaves <= proof.leaves => {}
            (Ok(proof), _) => found = Ok(proof),
            (Err(_), Ok(_)) => {}
            (Err(open), Err(CertifyError::Open(known))) if known.factor <= open.factor => {}
            (Err(open), Err(_)) => found = Err(CertifyError::Open(open)),
        }
        if found.as_ref().is_ok_and(|proof| proof.leaves <= FEW) {
            break;
        }
    }
    found
}

struct Search<'a> {
    judgement: &'a Judgement,
    root: &'a [Interval],
    /// The inputs along which halving helps.
    inputs: &'a [usize],
    limits: Limits,
    slender: f64,
    /// The box and its parts; a part is named by its place in this list.
    parts: Vec<Piece>,
    step: &'a mut dyn FnMut(f64),
}

/// The inputs whose ranges change the bound. An amplitude that multiplies all does not change it. The inputs are chosen by bounds on
/// small boxes: a wrong choice makes a search longer, or ends it without a proof, but makes no proof wrong.
fn effective(judgement: &Judgement, bounds: &[Interval]) -> Vec<usize> {
    const SAMPLES: usize = 7;
    let small = |sample: usize| -> Vec<Interval> {
        let part = |(input, range): (usize, &Interval)| {
            // Places that differ from input to input.
            let place = (0.37 + 0.618 * (sample * (input + 1)) as f64).fract();
            let low = range.low + 0.99 * place * (range.high - range.low);
            Interval::new(low, low + 0.01 * (range.high - range.low))
        };
        bounds.iter().enumerate().map(part).collect()
    };
    let matters = |input: &usize| {
        (0..SAMPLES).any(|sample| {
            let mut part = small(sample);
            let before = bound_over(judgement, &part);
            part[*input] = bounds[*input];
            bound_over(judgement, &part) != before
        })
    };
    let named: Vec<usize> =
        judgement.inputs().iter().copied().filter(|input| *input < MOST_INPUTS).collect();
    let matter: Vec<usize> = named.iter().copied().filter(matters).collect();
    if matter.is_empty() { named } else { matter }
}

/// The least factor that is proved on a box; infinite where none is.
fn bound_over(judgement: &Judgement, bounds: &[Interval]) -> f64 {
    judgement
        .over(bounds)
        .and_then(|sides| sides.factor(MOST_TOLD, FINE_STEPS))
        .unwrap_or(f64::INFINITY)
}

/// A part of the box.
enum Piece {
    /// The factor is at most this many quarters.
    Closed(u32),
    /// The part is halved along an input; the places of its halves.
    Halved(usize, [usize; 2]),
    /// The bound does not hold yet.
    Open,
}

/// A part whose bound does not hold yet; parts with the largest bound come first.
struct Pending {
    factor: f64,
    place: usize,
    bounds: Vec<Interval>,
    /// Its share of the volume.
    share: f64,
}

impl Ord for Pending {
    fn cmp(&self, other: &Self) -> Ordering {
        // Of equal bounds the larger part comes first, and then the earlier part, so that the order is definite.
        self.factor
            .total_cmp(&other.factor)
            .then(self.share.total_cmp(&other.share))
            .then(other.place.cmp(&self.place))
    }
}

impl PartialOrd for Pending {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Pending {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Pending {}

impl Search<'_> {
    /// Halves the part of the largest bound until none is left, or there are too many.
    fn whole(&mut self) -> Result<Proof, Open> {
        let mut pending = BinaryHeap::new();
        let (mut leaves, mut done) = (1, 0.0);
        pending.extend(self.judged(self.root.to_vec(), 1.0, &mut done));
        while let Some(part) = pending.pop() {
            let halving =
                (leaves < self.limits.boxes).then(|| self.best_halves(&part.bounds)).flatten();
            let Some(Halving { input, halves, .. }) = halving else {
                return Err(Open { bounds: part.bounds, factor: part.factor });
            };
            leaves += 1;
            let first = self.parts.len();
            self.parts[part.place] = Piece::Halved(input, [first, first + 1]);
            for half in halves {
                pending.extend(self.judged(half, 0.5 * part.share, &mut done));
            }
        }
        let quarters = |part: &Piece| if let Piece::Closed(n) = part { *n } else { 0 };
        let worst = self.parts.iter().map(quarters).max().unwrap_or(0);
        let mut tree = String::new();
        self.write(0, &mut tree);
        Ok(Proof { tree, leaves, factor: f64::from(worst) / STEPS_OF_FACTOR })
    }

    /// Adds a part. Where its bound holds the part is closed, else it is returned.
    fn judged(&mut self, bounds: Vec<Interval>, share: f64, done: &mut f64) -> Option<Pending> {
        let sides = self.judgement.over(&bounds);
        let place = self.parts.len();
        if let Some(factor) = sides.and_then(|s| s.factor(self.limits.factor, STEPS_OF_FACTOR)) {
            self.parts.push(Piece::Closed(((factor * STEPS_OF_FACTOR) as u32).max(1)));
            *done += share;
            (self.step)(*done);
            return None;
        }
        self.parts.push(Piece::Open);
        let factor = bound_over(self.judgement, &bounds);
        Some(Pending { factor, place, bounds, share })
    }

    /// Writes a part and the parts within it in pre-order.
    fn write(&self, place: usize, tree: &mut String) {
        match self.parts[place] {
            Piece::Closed(quarters) => tree.extend(letter(quarters)),
            Piece::Halved(input, halves) => {
                let _ = write!(tree, "{input}");
                halves.into_iter().for_each(|half| self.write(half, tree));
            }
            Piece::Open => {}
        }
    }

    /// The halving that helps most: both halves together miss least. An input without effect comes last. Of equal inputs the input
    /// whose range is the largest share of the whole comes first.
    fn best_halves(&self, bounds: &[Interval]) -> Option<Halving> {
        let parent = bound_over(self.judgement, bounds).min(MOST_TOLD);
        let width = |b: Interval| b.high - b.low;
        let share_of = |input: usize| width(bounds[input]) / width(self.root[input]);
        let widest = self.inputs.iter().map(|&n| share_of(n)).fold(0.0, f64::max);
        let mut best: Option<Halving> = None;
        for &input in self.inputs {
            let share = share_of(input);
            // Slender parts say little about their distance from the bound. An input with a single value has no share.
            if share.is_nan() || share * self.slender < widest {
                continue;
            }
            let Some(halves) = halves(bounds, input) else { continue };
            let [low, high] = [0, 1].map(|n| bound_over(self.judgement, &halves[n]).min(MOST_TOLD));
            let missing = |factor: f64| (factor / self.limits.factor).max(1.0).ln();
            let gain = 2.0 * missing(parent) - missing(low) - missing(high);
            let gain = if gain > LEAST_GAIN { gain } else { 0.0 };
            let better = best
                .as_ref()
                .is_none_or(|best| gain > best.gain || (gain == best.gain && share > best.share));
            if better {
                best = Some(Halving { input, gain, share, halves });
            }
        }
        best
    }
}

/// A box halved along an input.
struct Halving {
    input: usize,
    /// The decrease of the logarithms of both factors towards the factor to be proved.
    gain: f64,
    /// The range of the input as a share of the whole.
    share: f64,
    halves: [Vec<Interval>; 2],
}

/// Both halves of a box along an input; `None` where the middle is one of the ends.
#[must_use]
pub fn halves(bounds: &[Interval], input: usize) -> Option<[Vec<Interval>; 2]> {
    let range = bounds[input];
    let middle = range.middle();
    if !(range.low < middle && middle < range.high) {
        return None;
    }
    let mut halves = [bounds.to_vec(), bounds.to_vec()];
    halves[0][input].high = middle;
    halves[1][input].low = middle;
    Some(halves)
}
