//! The history of one particle along an exact motion.

use std::cell::Cell;
use std::sync::atomic::{AtomicU64, Ordering};

use mmsmith_vocabulary::Smoothness;
use thiserror::Error;

use crate::dormand_prince::{Errors, Step, factor};
use crate::law::{Branch, Kinematics, LawWithHistory, Residuals};
use crate::motion::Motion;
use crate::number::{Dual, Number};
use crate::sampled::Sampled;
use crate::tensor::{Tensor, tensor};

/// Histories that this process has followed.
static FOLLOWED: AtomicU64 = AtomicU64::new(0);

/// How many histories of particles this process has followed, for those who wait for a table of them.
#[must_use]
pub fn followed() -> u64 {
    FOLLOWED.load(Ordering::Relaxed)
}

/// Why a history could not be followed.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum HistoryError {
    /// Times must not go back.
    #[error("times of a history must ascend: {after} comes after {before}")]
    Order {
        /// A time.
        before: f64,
        /// The time that follows it.
        after: f64,
    },
    /// The integrator gave up.
    #[error(
        "the rates of the internal variables are too large or too rough to go on from the time {time}"
    )]
    Rough {
        /// The time.
        time: f64,
    },
    /// Steps were so short that their end did not come.
    #[error(
        "the internal variables follow the motion so fast that {evaluations} evaluations of their rates led no further than the time \
         {time}: make the times of the law longer, or the motion shorter"
    )]
    Stiff {
        /// The time.
        time: f64,
        /// The evaluations.
        evaluations: usize,
    },
    /// A value that is not finite.
    #[error("an internal variable is not finite at the time {time}")]
    NotFinite {
        /// The time.
        time: f64,
    },
    /// Elastic strains are lost in the rounding of stretches.
    #[error(
        "the elastic strain of flow is {strain:.1e}, so that the rounding of stretches takes its digits: a yield stress, or a drag, of 1e-7 of the \
         shear modulus and more keeps them"
    )]
    TooSoft {
        /// The strain.
        strain: f64,
    },
    /// The body begins beyond its yield surface.
    #[error(
        "at the time 0 the stress is beyond the yield stress, by {excess:e} of it: let the motion begin with F = I, or closer to it"
    )]
    BeyondYield {
        /// The share of the yield stress.
        excess: f64,
    },
}

/// A particle begins to flow, or ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// The time at which.
    pub time: f64,
    /// The branch that follows.
    pub branch: Branch,
    /// How smooth the body force is there.
    pub smoothness: Smoothness,
}

/// The internal variables of a particle at some times, with their slopes in `K` directions.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory<const K: usize> {
    /// For each time the variables.
    pub states: Vec<Vec<Dual<f64, K>>>,
    /// Where the set of rate equations changed.
    pub changes: Vec<Change>,
    /// The least margin of the flow at the times: how fast the stress would grow, as a share of the rate of deformation, or where flow
    /// depends on its rate the least stress beyond the yield stress while it flows; infinite where the particle never flows.
    pub least_margin: f64,
    /// By how much variables miss conditions that exact ones keep, at most at the times.
    pub residuals: Residuals,
    /// How often rates were evaluated.
    pub evaluations: usize,
}

/// The kinematics without slopes.
fn values<const K: usize>(at: &Kinematics<Dual<f64, K>>) -> Kinematics<f64> {
    let of = |A: &Tensor<Dual<f64, K>>| A.map(|row| row.map(|entry| entry.value));
    Kinematics { F: of(&at.F), rate: of(&at.rate) }
}

fn values_of<const K: usize>(numbers: &[Dual<f64, K>]) -> Vec<f64> {
    numbers.iter().map(|number| number.value).collect()
}

/// Margins this small count as none.
const NOTHING: f64 = 1e-13;
/// A start this far beyond the yield surface is on it.
const ON_SURFACE: f64 = 1e-9;
/// Errors of the divergence of stresses are at most such a part of what the estimates of steps tell (measured; see the crate's tests).
const LENIENCE: f64 = 30.0;
/// The least share of elastic strains in the variables whose stresses keep the digits of a table, and the least one of which tolerances are a part.
const LEAST_RESOLUTION: f64 = 1e-8;
const FULL_RESOLUTION: f64 = 1e-6;
/// So many steps are shortened before their errors are compared with the rounding of rates, and so many roundings are left to a step.
const MOST_REJECTIONS: usize = 3;
const ROUNDINGS: f64 = 64.0;
/// From one step to the next the estimate of an error falls by its length to the eighth power and by such a share, at most.
const LEAST_SHARE: f64 = 0.1;
/// The share of all time that steps over a zero of the stress have.
const SHORTEST: f64 = 1e-6;
/// Evaluations of rates, at most: a second or so.
const MOST_EVALUATIONS: usize = 1_000_000;
/// Intervals in which a time without flow is searched for its end, at least.
const INTERVALS: f64 = 64.0;

/// A law along a motion.
struct Along<'a, L, M, const K: usize> {
    law: &'a L,
    motion: &'a M,
    /// The constants, for those that do not change.
    steady: Vec<Dual<f64, K>>,
    steady_values: Vec<f64>,
}

impl<'a, L: LawWithHistory, M: Motion<K>, const K: usize> Along<'a, L, M, K> {
    fn new(law: &'a L, motion: &'a M) -> Self {
        let mut steady = Vec::new();
        motion.constants(0.0, &mut steady);
        let steady_values = values_of(&steady);
        Self { law, motion, steady, steady_values }
    }

    fn constants(&self, time: f64) -> Vec<Dual<f64, K>> {
        if !self.law.constants_change() {
            return self.steady.clone();
        }
        let mut constants = Vec::with_capacity(self.steady.len());
        self.motion.constants(time, &mut constants);
        constants
    }

    fn margin(&self, time: f64, z: &[f64], branch: Branch) -> f64 {
        let at = values(&self.motion.at(time));
        if self.law.constants_change() {
            return self.law.margin(&at, &values_of(&self.constants(time)), z, branch);
        }
        self.law.margin(&at, &self.steady_values, z, branch)
    }

    /// The length of a step in which the stress on which flow depends halves or doubles.
    fn longest_step(&self, time: f64, z: &[Dual<f64, K>], rates: &[Dual<f64, K>]) -> f64 {
        let at = values(&self.motion.at(time));
        let constants = values_of(&self.constants(time));
        self.law.halving_time(&at, &constants, &values_of(z), &values_of(rates))
    }

    /// By how much the rate of each variable moves where the entries of `F` and its rate are off by a unit of their last place, as they are: no
    /// step tells values apart that differ by less than this times its length.
    fn rounding(&self, time: f64, z: &[Dual<f64, K>], branch: Branch) -> Vec<f64> {
        let (at, z) = (values(&self.motion.at(time)), values_of(z));
        let constants = values_of(&self.constants(time));
        let off = |A: &Tensor<f64>| {
            let largest = A.iter().flatten().fold(0.0_f64, |most, entry| most.max(entry.abs()));
            // Not by one factor, to which a law may be blind.
            tensor(|i, j| A[i][j] + f64::EPSILON * largest * ((i + 2 * j) % 3 + 1) as f64)
        };
        let moved = Kinematics { F: off(&at.F), rate: off(&at.rate) };
        let [rates, moved] = [&at, &moved].map(|at| {
            let mut rates = vec![0.0; z.len()];
            self.law.rate(at, &constants, &z, branch, &mut rates);
            rates
        });
        rates.iter().zip(moved).map(|(one, other)| (one - other).abs()).collect()
    }

    /// The slopes right after the onset of the flow: particles next to this one begin at another time,
    /// `t_y,J = -f_,J / f'`, so that `z_,J` jumps by `-z' t_y,J`.
    fn onset(&self, time: f64, z: &mut [Dual<f64, K>]) {
        let (at, constants) = (self.motion.at(time), self.constants(time));
        let margin = self.law.margin(&at, &constants, z, Branch::Elastic);
        // The rate of the margin along the motion while the variables stay; it depends on F alone.
        let along = Kinematics {
            F: tensor(|i, j| Dual { value: at.F[i][j].value, slopes: [at.rate[i][j].value] }),
            rate: tensor(|i, j| Dual::constant(at.rate[i][j].value)),
        };
        let at_rest = |numbers: &[Dual<f64, K>]| -> Vec<Dual<f64, 1>> {
            numbers.iter().map(|z| Dual::constant(z.value)).collect()
        };
        let [rate] =
            self.law.margin(&along, &at_rest(&constants), &at_rest(z), Branch::Elastic).slopes;
        let mut rates = vec![Dual::<f64, K>::constant(0.0); z.len()];
        self.law.rate(&at, &constants, z, Branch::Flowing, &mut rates);
        for (z, rate_of_z) in z.iter_mut().zip(rates) {
            for k in 0..K {
                z.slopes[k] += rate_of_z.value * margin.slopes[k] / rate;
            }
        }
    }
}

/// The root of a function that is positive at `low` and not at `high`, next to the last digit of the times: regula falsi with halved ends
/// (Illinois), and halves now and then, since the function may have a kink or a jump.
fn root(function: impl Fn(f64) -> f64, low: (f64, f64), high: (f64, f64)) -> f64 {
    let ((mut low, mut at_low), (mut high, mut at_high)) = (low, high);
    let mut side = 0;
    for count in 0..200 {
        if high - low <= 2.0 * f64::EPSILON * high.abs() || at_high == 0.0 {
            break;
        }
        let mut next = (low * at_high - high * at_low) / (at_high - at_low);
        if count % 3 == 2 || next.is_nan() || next <= low || next >= high {
            next = 0.5 * (low + high);
        }
        if next <= low || next >= high {
            break;
        }
        let value = function(next);
        if value > 0.0 {
            (low, at_low) = (next, value);
            at_high *= if side == 1 { 0.5 } else { 1.0 };
            side = 1;
        } else {
            (high, at_high) = (next, value);
            at_low *= if side == -1 { 0.5 } else { 1.0 };
            side = -1;
        }
    }
    high
}

/// A particle on its way, and what it leaves behind.
struct Way<'a, L, M, const K: usize> {
    along: Along<'a, L, M, K>,
    tolerance: f64,
    times: &'a [f64],
    time: f64,
    branch: Branch,
    z: Vec<Dual<f64, K>>,
    /// The last step of the integrator, with which the next one begins.
    step: f64,
    found: Trajectory<K>,
}

impl<L: LawWithHistory, M: Motion<K>, const K: usize> Way<'_, L, M, K> {
    fn end(&self) -> f64 {
        self.times.last().copied().unwrap_or(0.0)
    }

    /// The next time that has no state yet.
    fn next_time(&self) -> Option<f64> {
        self.times.get(self.found.states.len()).copied()
    }

    /// Keeps a state, and what there is to tell of it. Gives the margin.
    fn keep(&mut self, time: f64, z: Vec<Dual<f64, K>>) -> f64 {
        let law = self.along.law;
        let mut margin = 1.0;
        if law.has_branches() {
            let at = values(&self.along.motion.at(time));
            let changing;
            let constants = if law.constants_change() {
                changing = values_of(&self.along.constants(time));
                &changing
            } else {
                &self.along.steady_values
            };
            let own = values_of(&z);
            margin = law.margin(&at, constants, &own, self.branch);
            if self.branch == Branch::Flowing {
                self.found.least_margin = self.found.least_margin.min(margin);
            }
            let residuals = law.residuals(&at, constants, &own, self.branch);
            self.found.residuals = self.found.residuals.max(residuals);
        }
        self.found.states.push(z);
        margin
    }

    /// Goes through a time without flow. Gives whether flow begins, and whether from a point where the stress reaches the yield stress.
    fn rest(&mut self) -> Option<bool> {
        let z = values_of(&self.z);
        let margin = |time: f64| self.along.margin(time, &z, Branch::Elastic);
        let end = self.end();
        let widest = (end / INTERVALS).max(f64::MIN_POSITIVE);
        let mut next = self.found.states.len();
        let mut before: Option<(f64, f64)> = None;
        let mut last = (self.time, margin(self.time));
        let mut begins = None;
        while last.0 < end {
            while next < self.times.len() && self.times[next] <= last.0 {
                next += 1;
            }
            let to = self.times.get(next).copied().unwrap_or(end);
            let parts = ((to - last.0) / widest).ceil().max(1.0);
            let time = if parts <= 1.0 { to } else { last.0 + (to - last.0) / parts };
            let mut now = (time, margin(time));
            // The least value in between, if there is one.
            if let Some(first) = before
                && now.1 > 0.0
                && last.1 <= first.1
                && last.1 <= now.1
                && let Some(lowest) = vertex(first, last, now)
            {
                let at_lowest = margin(lowest);
                if at_lowest < -NOTHING {
                    let low = if lowest > last.0 { last } else { first };
                    begins = Some((root(margin, low, (lowest, at_lowest)), true));
                    break;
                }
            }
            if now.1 < -NOTHING {
                // A point in between at which there is something left.
                let mut low = last;
                for halves in 1..=30 {
                    if low.1 > NOTHING {
                        break;
                    }
                    let middle = last.0 + (now.0 - last.0) * 0.5_f64.powi(halves);
                    let at_middle = margin(middle);
                    if at_middle > NOTHING {
                        low = (middle, at_middle);
                    } else if at_middle < -NOTHING {
                        now = (middle, at_middle);
                    }
                }
                begins = Some(if low.1 > NOTHING {
                    (root(margin, low, now), true)
                } else {
                    (last.0, false)
                });
                break;
            }
            (before, last) = (Some(last), now);
        }
        let until = begins.map_or(end, |(time, _)| time);
        while let Some(time) = self.next_time().filter(|time| *time <= until) {
            self.keep(time, self.z.clone());
        }
        self.time = until;
        begins.map(|(_, is_root)| is_root)
    }

    /// Goes through a time of flow. Gives whether it ends.
    fn flow(&mut self) -> Result<bool, HistoryError> {
        let end = self.end();
        let Along { law, motion, .. } = self.along;
        let branch = self.branch;
        let steady = self.along.steady.clone();
        let mut changing: Vec<Dual<f64, K>> = Vec::new();
        let evaluations = Cell::new(self.found.evaluations);
        let mut rate = |time: f64, z: &[Dual<f64, K>], rates: &mut [Dual<f64, K>]| {
            evaluations.set(evaluations.get() + 1);
            let at = motion.at(time);
            if law.constants_change() {
                changing.clear();
                motion.constants(time, &mut changing);
                law.rate(&at, &changing, z, branch, rates);
            } else {
                law.rate(&at, &steady, z, branch, rates);
            }
        };
        let groups = law.groups();
        let mut step = Step::new(self.z.clone(), groups.clone());
        let count = groups.iter().max().map_or(0, |last| last + 1);
        let mut scales = step.scales(&vec![[0.0; 2]; count]);
        // Slopes may be nothing but rounding; then no step is short enough for them.
        let mut counts_slopes = true;
        let mut rejected: Option<f64> = None;
        let mut trials = 0;
        let mut rejections = 0;
        let mut last_step: Option<(f64, f64)> = None;
        step.begin(&mut rate, self.time);
        if self.step <= 0.0 {
            self.step = (end - self.time) / 32.0;
        }
        while self.time < end {
            if evaluations.get() > MOST_EVALUATIONS {
                let evaluations = evaluations.get();
                return Err(HistoryError::Stiff { time: self.time, evaluations });
            }
            let rest = end - self.time;
            let mut usual = self.step;
            // The stress may begin from zero.
            if law.has_branches() && self.time > 0.0 {
                let longest = self.along.longest_step(self.time, &step.from, step.rates());
                usual = usual.min(longest.max(SHORTEST * end));
            }
            // The last two steps share the rest, so that none of them is tiny.
            let length = if rest <= usual {
                rest
            } else if rest < 2.0 * usual {
                0.5 * rest
            } else {
                usual
            };
            let Errors { of_values, of_slopes } =
                step.go(&mut rate, length, self.tolerance, &scales);
            let mut error = if counts_slopes { of_values.max(of_slopes) } else { of_values };
            // The estimate of a lone variable may pass through zero: it is no less than a share of that of the step before, at this length.
            if let Some((before, its_length)) = last_step {
                error = error.max(LEAST_SHARE * before * (length / its_length).powi(8));
            }
            if error > 1.0 || error.is_nan() {
                if let Some(before) = rejected
                    && of_values <= 1.0
                    && of_slopes.is_finite()
                    && of_slopes > 0.25 * before
                {
                    trials += 1;
                    if trials >= 3 {
                        counts_slopes = false;
                    }
                }
                rejected = Some(of_slopes);
                // Next to the start variables may be so small that their tolerance is less than the rounding of their rates.
                rejections += 1;
                if rejections >= MOST_REJECTIONS {
                    let roundings = self.along.rounding(self.time, &step.from, branch);
                    for (rounding, &group) in roundings.into_iter().zip(&groups) {
                        let of_values = &mut scales[group][0];
                        *of_values = of_values.max(ROUNDINGS * length * rounding / self.tolerance);
                    }
                }
                error = if error.is_finite() { error } else { f64::INFINITY };
                self.step = length * factor(error).min(0.7);
                if self.time + self.step <= self.time {
                    return Err(if error.is_finite() {
                        HistoryError::Rough { time: self.time }
                    } else {
                        HistoryError::NotFinite { time: self.time }
                    });
                }
                continue;
            }
            let growth = if rejected.is_some() { 1.0 } else { 6.0 };
            (rejected, trials, rejections) = (None, 0, 0);
            last_step = Some((error, length));
            scales = step.scales(&scales);
            let stop = if length == rest { end } else { self.time + length };
            step.finish(&mut rate);
            // States within the step, and the margin there.
            let mut last = (self.time, 1.0);
            let mut ends: Option<((f64, f64), (f64, f64))> = None;
            let mut is_sampled = !law.has_branches();
            while let Some(time) = self.next_time().filter(|time| *time <= stop) {
                let z = if time == self.time {
                    step.from.clone()
                } else if time == stop {
                    step.to.clone()
                } else {
                    step.prepare(&mut rate);
                    step.at(time)
                };
                let told = (self.found.least_margin, self.found.residuals);
                let margin = self.keep(time, z);
                is_sampled |= time < stop && time > self.time;
                if margin <= 0.0 && time > self.time {
                    // It was on another branch by then.
                    self.found.states.pop();
                    (self.found.least_margin, self.found.residuals) = told;
                    ends = Some((last, (time, margin)));
                    break;
                }
                last = (time, if time > self.time { margin } else { 1.0 });
            }
            if law.has_branches() && ends.is_none() {
                let middle = 0.5 * (self.time + stop);
                let mut samples = vec![stop];
                if !is_sampled {
                    samples.insert(0, middle);
                    step.prepare(&mut rate);
                }
                for time in samples {
                    let z = if time == stop { step.to.clone() } else { step.at(time) };
                    let margin = self.along.margin(time, &values_of(&z), branch);
                    if margin <= 0.0 {
                        ends = Some((last, (time, margin)));
                        break;
                    }
                    last = (time, margin);
                }
            }
            if let Some((low, high)) = ends {
                step.prepare(&mut rate);
                let margin =
                    |time: f64| self.along.margin(time, &values_of(&step.at(time)), branch);
                let time = root(margin, low, high);
                while let Some(next) = self.next_time().filter(|next| *next < time) {
                    let z = step.at(next);
                    self.keep(next, z);
                }
                // States at the root come by a step to it.
                step.go(&mut rate, time - self.time, self.tolerance, &scales);
                self.z = step.to.clone();
                self.time = time;
                self.step = length;
                self.found.evaluations = evaluations.get();
                return Ok(true);
            }
            self.step = length * factor(error).min(growth);
            self.time = stop;
            step.advance(stop);
        }
        self.z = step.from.clone();
        self.found.evaluations = evaluations.get();
        Ok(false)
    }

    fn change(&mut self, branch: Branch) {
        self.branch = branch;
        let constants = values_of(&self.along.constants(self.time));
        let smoothness = self.along.law.smoothness(&constants, &values_of(&self.z), branch);
        self.found.changes.push(Change { time: self.time, branch, smoothness });
    }

    fn run(mut self) -> Result<Trajectory<K>, HistoryError> {
        while let Some(next) = self.next_time() {
            if next <= self.time {
                self.keep(next, self.z.clone());
                continue;
            }
            match self.branch {
                Branch::Elastic => {
                    if let Some(is_root) = self.rest() {
                        let is_start = self.time == 0.0;
                        if is_start && !is_root {
                            // It was about to flow from the start.
                            self.branch = Branch::Flowing;
                            continue;
                        }
                        self.change(Branch::Flowing);
                        if is_root {
                            self.along.onset(self.time, &mut self.z);
                        }
                    }
                }
                Branch::Flowing => {
                    if self.flow()? {
                        self.change(Branch::Elastic);
                    }
                }
            }
        }
        Ok(self.found)
    }
}

impl<const K: usize> Trajectory<K> {
    fn empty() -> Self {
        Self {
            states: Vec::new(),
            changes: Vec::new(),
            least_margin: f64::INFINITY,
            residuals: Residuals::default(),
            evaluations: 0,
        }
    }

    /// Follows a particle from the time 0 through ascending `times`, where its variables begin as the law has them. The tolerance is
    /// relative to what stresses [depend on](LawWithHistory::resolution): 1e-13 gives them, and their divergence, to about 1e-13 of their
    /// largest values.
    ///
    /// # Errors
    ///
    /// [`HistoryError`] where times do not ascend, the body begins beyond its yield surface, or the rates cannot be integrated.
    pub fn new<L: LawWithHistory>(
        law: &L,
        motion: &impl Motion<K>,
        times: &[f64],
        tolerance: f64,
    ) -> Result<Self, HistoryError> {
        let mut before = 0.0;
        for &after in times {
            if after.is_nan() || after < before {
                return Err(HistoryError::Order { before, after });
            }
            before = after;
        }
        if law.variables().is_empty() && !law.has_branches() {
            return Ok(Self { states: vec![Vec::new(); times.len()], ..Self::empty() });
        }
        FOLLOWED.fetch_add(1, Ordering::Relaxed);
        let sampled = Sampled::new(motion, before);
        let along = Along::new(law, &sampled);
        let z = law.initial(&along.steady, &motion.frame());
        let (first, start) = (values_of(&z), values(&motion.at(0.0)));
        if first.iter().any(|value| !value.is_finite()) {
            return Err(HistoryError::NotFinite { time: 0.0 });
        }
        let resolution = law.resolution(&along.steady_values);
        if resolution < LEAST_RESOLUTION {
            return Err(HistoryError::TooSoft { strain: resolution });
        }
        let excess = law.excess(&start, &along.steady_values, &first);
        if excess > ON_SURFACE {
            return Err(HistoryError::BeyondYield { excess });
        }
        let branch = law.first_branch(&start, &along.steady_values, &first);
        let found = Self { states: Vec::with_capacity(times.len()), ..Self::empty() };
        let tolerance = LENIENCE * tolerance * resolution.clamp(FULL_RESOLUTION, 1.0);
        let way = Way { along, tolerance, times, time: 0.0, branch, z, step: 0.0, found };
        way.run()
    }

    /// How smooth the body force is at the worst of the changes.
    #[must_use]
    pub fn smoothness(&self) -> Smoothness {
        let all = self.changes.iter().map(|change| change.smoothness);
        all.min().unwrap_or(Smoothness::Smooth)
    }
}

/// Where a parabola through three points is lowest, if that is well between them and not much above zero.
fn vertex(a: (f64, f64), b: (f64, f64), c: (f64, f64)) -> Option<f64> {
    let (left, right) = ((b.1 - a.1) / (b.0 - a.0), (c.1 - b.1) / (c.0 - b.0));
    let curvature = (right - left) / (c.0 - a.0);
    if curvature.is_nan() || curvature <= 0.0 {
        return None;
    }
    // The slope at the middle of the first interval is `left`.
    let lowest = 0.5 * (a.0 + b.0) - 0.5 * left / curvature;
    let is_inside = lowest > a.0 && lowest < c.0;
    let height = b.1 - 0.25 * curvature * (c.0 - a.0).powi(2);
    (is_inside && height <= 0.0).then_some(lowest)
}

/// The divergence of the first Piola-Kirchhoff stress of a particle, and the stress itself, from variables with slopes along the
/// coordinates.
pub fn divergence<L: LawWithHistory, const K: usize>(
    law: &L,
    at: &Kinematics<Dual<f64, K>>,
    constants: &[Dual<f64, K>],
    z: &[Dual<f64, K>],
) -> ([f64; K], Tensor<f64>) {
    let P = law.first_piola_kirchhoff(at, constants, z);
    let divergence =
        std::array::from_fn(|i| (0..K).map(|axis| P[i][axis].slopes[axis]).sum::<f64>());
    (divergence, P.map(|row| row.map(|entry| entry.value)))
}
