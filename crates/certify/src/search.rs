//! Branch and bound: a box is halved until the bound holds on every part.

use crate::CertifyError;
use crate::interval::Interval;
use crate::propagate::Judgement;
use std::fmt::Write;

/// Bounds of factors are multiples of one part in as many.
pub const STEPS_OF_FACTOR: f64 = 4.0;

/// Largest factors beyond this are told as such.
const MOST_TOLD: f64 = 1e5;
/// Halvings are compared by factors of this fineness.
const FINE_STEPS: f64 = 1024.0;

/// How a box was halved, and again its parts, until the bound held on each.
#[derive(Clone, Debug, PartialEq)]
pub struct Proof {
    /// In pre-order: a digit is the input along which a box is halved, and the lower half follows, then the upper one; a
    /// letter is a box on which the factor is at most as many quarters as its place in the alphabet of [`letter`].
    pub tree: String,
    /// The number of boxes that were not halved.
    pub leaves: usize,
    /// The largest of their factors.
    pub factor: f64,
}

/// Where a proof did not close.
#[derive(Clone, Debug, PartialEq)]
pub struct Open {
    /// The range of each input.
    pub bounds: Vec<Interval>,
    /// The bound of the factor there; infinite where there is none.
    pub factor: f64,
}

/// The letter for a factor of so many quarters: A is one, Z is 26, a is 27, f is 32.
#[must_use]
pub fn letter(quarters: u32) -> Option<char> {
    let place = u8::try_from(quarters.checked_sub(1)?).ok()?;
    match place {
        0..26 => Some(char::from(b'A' + place)),
        26..52 => Some(char::from(b'a' + (place - 26))),
        _ => None,
    }
}

/// A smaller decrease of the logarithms of both halves' factors is none.
const LEAST_GAIN: f64 = 1e-6;
/// No input is halved whose range is a smaller share of the whole than one part in as many of the largest share. Each is tried
/// in turn: some fields need halvings of several inputs together before anything is gained, others of one alone.
const SLENDER: [f64; 2] = [1.5, 8.0];
/// So few boxes need not be fewer.
const FEW: usize = 50;

/// When a search ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// The factor that is to hold.
    pub factor: f64,
    /// The most boxes.
    pub boxes: usize,
}

/// Proves that the factor of `judgement` is at most that of `limits` over `bounds`. `step` is told the share of the volume
/// that is done.
///
/// # Errors
///
/// [`CertifyError::Open`] with the box of the largest bound, where so many boxes do not do.
pub fn prove(
    judgement: &Judgement,
    bounds: &[Interval],
    limits: Limits,
    step: &mut dyn FnMut(f64),
) -> Result<Proof, CertifyError> {
    let inputs = effective(judgement, bounds);
    let mut found: Result<Proof, CertifyError> = Err(CertifyError::Unsupported(String::new()));
    for slender in SLENDER {
        let boxes = found.as_ref().map_or(limits.boxes, |proof| proof.leaves);
        let mut search = Search {
            judgement,
            root: bounds,
            inputs: &inputs,
            limits: Limits { boxes, ..limits },
            slender,
            tree: String::new(),
            leaves: 0,
            worst: 0.0,
            done: 0.0,
            step: &mut *step,
        };
        let outcome = search.part(bounds.to_vec(), 1.0);
        let proof = Proof { tree: search.tree, leaves: search.leaves, factor: search.worst };
        match (outcome, &found) {
            (Ok(()), Ok(known)) if known.leaves <= proof.leaves => {}
            (Ok(()), _) => found = Ok(proof),
            (Err(_), Ok(_)) => {}
            (Err(error), Err(_)) => found = Err(error),
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
    tree: String,
    leaves: usize,
    worst: f64,
    done: f64,
    step: &'a mut dyn FnMut(f64),
}

/// The inputs whose ranges matter to the bound; such as an amplitude that multiplies all has none. Told from bounds on small
/// boxes: a wrong guess makes a search longer or end without a proof, and no proof wrong.
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
    let matter: Vec<usize> = judgement.inputs().iter().copied().filter(matters).collect();
    if matter.is_empty() { judgement.inputs().to_vec() } else { matter }
}

/// How far a box is from its bound: none has it, or by which factor.
fn bound_over(judgement: &Judgement, bounds: &[Interval]) -> f64 {
    judgement
        .over(bounds)
        .and_then(|sides| sides.factor(MOST_TOLD, FINE_STEPS))
        .unwrap_or(f64::INFINITY)
}

impl Search<'_> {
    fn part(&mut self, bounds: Vec<Interval>, share: f64) -> Result<(), CertifyError> {
        let sides = self.judgement.over(&bounds);
        if let Some(factor) =
            sides.and_then(|sides| sides.factor(self.limits.factor, STEPS_OF_FACTOR))
        {
            let quarters = (factor * STEPS_OF_FACTOR) as u32;
            self.tree.extend(letter(quarters));
            self.leaves += 1;
            self.worst = self.worst.max(factor);
            self.done += share;
            (self.step)(self.done);
            return Ok(());
        }
        let open = |bounds: Vec<Interval>| {
            let factor = bound_over(self.judgement, &bounds);
            CertifyError::Open(Open { bounds, factor })
        };
        if self.tree.len() >= 2 * self.limits.boxes {
            return Err(open(bounds));
        }
        let Some(Halving { input, halves, .. }) = self.best_halves(&bounds) else {
            return Err(open(bounds));
        };
        let _ = write!(self.tree, "{input}");
        for half in halves {
            self.part(half, 0.5 * share)?;
        }
        Ok(())
    }

    /// The halving that helps most: after which least is missing on both halves together. An input that changes nothing comes
    /// last, and of equal ones that whose range is the largest share of the whole comes first.
    fn best_halves(&self, bounds: &[Interval]) -> Option<Halving> {
        let parent = bound_over(self.judgement, bounds).min(MOST_TOLD);
        let width = |b: Interval| b.high - b.low;
        let share_of = |input: usize| width(bounds[input]) / width(self.root[input]);
        let widest = self.inputs.iter().map(|&n| share_of(n)).fold(0.0, f64::max);
        let mut best: Option<Halving> = None;
        for &input in self.inputs {
            let share = share_of(input);
            // Parts that are long beside their width say little of how far they are from their bound. An input of one value
            // has no share.
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
    /// By how much the logarithms of both factors are nearer to what is to hold.
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
