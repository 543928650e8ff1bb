//! Both sides of the acceptance rule over a box.
//!
//! # What is bounded
//!
//! A program computes `v_i = op_i(...)(1 + d_i)` with `|d_i| <= c_i u`, `u = 2^-53`. Its result is a function `G` of all `d`,
//! exact where they are zero. By the mean value theorem, and to every order,
//!
//! ```text
//! |G(d) - G(0)| <= u sum_i c_i |v_i dG/dv_i|   at some point between 0 and d.
//! ```
//!
//! So values and derivatives are enclosed over the box and all `d` together: each enclosure is widened by `1 + c_i u`, and what
//! holds for all of them holds at that point. There is no rest of second order.
//!
//! The other side is `s + |g|`, `s = sum_q |q dg/dq|`, at `d = 0`, which the same enclosures contain. The circle number is one of
//! the `q`, wherever a program has it: by itself, and in `sin(pi x)` and `cos(pi x)`.
//!
//! # Factors
//!
//! Both sides vanish where a sine, a coordinate or the amplitude does. Inputs, sines and cosines are therefore factors of
//! their own (see `monomial`): both sides become sums of absolute monomials with coefficients, which are
//! compared one by one ([`Sides::covered`]). An input is the same number on both sides. A sine is not: the error side has it
//! at a perturbed argument. Since `|sin(x + e)| <= |sin(x)| + |e|`, each such factor leaves a term without it, `|e|` times
//! smaller.

use crate::interval::Interval;
use crate::monomial::{MOST_FACTORS, Monomial, Polynomial, Scaled};
use crate::rounding::UNIT;
use crate::{CertifyError, Roundings};
use mmsmith_expr::{Function, Operation, Program, Slot, nearest_f64};

/// Remainder that may be left of the error side, in units of `2^-53` and of the field where all scales are one: a product of two
/// rounding errors, such as that of two sines next to their zeros, which no sensitivity accounts for.
pub const REMAINDER: f64 = 1e-10;

/// Up to this argument a sine whose argument passes zero is written as the argument times a ratio, so that its zero is that of the
/// argument's own factors.
const LARGEST_ANGLE_AT_ZERO: f64 = 1.2;

/// A margin for the roundings of the comparison itself, which are fewer than a thousand.
const SLACK: f64 = 1e-12;

/// A program with one output, ready to be judged over boxes.
#[derive(Clone, Debug)]
pub struct Judgement {
    operations: Vec<Operation>,
    output: usize,
    /// The error of each operation, in units of `2^-53`.
    rounding: Vec<f64>,
    /// Bounds of the relative error of each value for all inputs, in units of `2^-53`; infinite where none is known.
    relative: Vec<f64>,
    /// The inputs that the program reads.
    inputs: Vec<usize>,
}

impl Judgement {
    /// The judgement of `slot`.
    ///
    /// # Errors
    ///
    /// [`CertifyError::Unsupported`] where an operation has no enclosure here.
    pub fn new(program: &Program, slot: Slot, roundings: &Roundings) -> Result<Self, CertifyError> {
        let program = program.part(&[slot]);
        let rounding = roundings.of(&program)?;
        Ok(Self::with_roundings(&program, rounding))
    }

    /// As [`Judgement::new`], with the error of each operation, for a program with one output and without unused operations.
    #[must_use]
    pub fn with_roundings(program: &Program, rounding: Vec<f64>) -> Self {
        let operations = program.operations().to_vec();
        let mut relative: Vec<f64> = Vec::new();
        for (operation, own) in operations.iter().zip(&rounding) {
            let of = |slot: &Slot| relative[slot.index()];
            let carried = match operation {
                Operation::Number(_) | Operation::Pi | Operation::Input(_) => 0.0,
                Operation::Neg(a) => of(a),
                Operation::Mul(a, b) | Operation::Div(a, b) => of(a) + of(b),
                Operation::Sqrt(a) => 0.5 * of(a),
                Operation::Add(a, b) | Operation::Sub(a, b) if of(a) + of(b) == 0.0 => 0.0,
                _ => f64::INFINITY,
            };
            relative.push(carried + own);
        }
        let mut inputs: Vec<usize> = operations
            .iter()
            .filter_map(|o| if let Operation::Input(index) = o { Some(*index) } else { None })
            .collect();
        inputs.sort_unstable();
        let output = program.outputs().first().map_or(0, |slot| slot.index());
        Self { operations, output, rounding, relative, inputs }
    }

    /// The inputs that the output depends on.
    #[must_use]
    pub fn inputs(&self) -> &[usize] {
        &self.inputs
    }

    /// Both sides over the box that has `bounds` for each input; `None` where a value or a derivative has no enclosure.
    #[must_use]
    pub fn over(&self, bounds: &[Interval]) -> Option<Sides> {
        let mut factors = Factors::default();
        let values = self.values(bounds, &mut factors)?;
        self.sides(&values, &factors)
    }

    /// All values that the output has over the box; `None` where one has no enclosure.
    #[must_use]
    pub fn range(&self, bounds: &[Interval]) -> Option<Interval> {
        let mut factors = Factors::default();
        let values = self.values(bounds, &mut factors)?;
        Some(values.get(self.output)?.range(&factors.ranges))
    }

    fn values(&self, bounds: &[Interval], factors: &mut Factors) -> Option<Vec<Scaled>> {
        let mut values: Vec<Scaled> = Vec::with_capacity(self.operations.len());
        for (index, operation) in self.operations.iter().enumerate() {
            let of = |slot: &Slot| values[slot.index()];
            let own = Interval::ONE.widened(self.rounding[index] * UNIT);
            let value = match operation {
                Operation::Number(number) => {
                    let near = nearest_f64(number);
                    Scaled::plain(if self.rounding[index] == 0.0 {
                        Interval::point(near)
                    } else {
                        Interval::new(near.next_down(), near.next_up())
                    })
                }
                Operation::Pi => Scaled::plain(Interval::PI),
                Operation::Input(input) => {
                    let bounds = *bounds.get(*input)?;
                    let varies = bounds.low < bounds.high;
                    match varies.then(|| factors.add(bounds, None)).flatten() {
                        Some(monomial) => Scaled { monomial, rest: Interval::ONE },
                        None => Scaled::plain(bounds),
                    }
                }
                Operation::Neg(a) => Scaled { rest: -of(a).rest, ..of(a) },
                Operation::Add(a, b) => of(a).plus(of(b), &factors.ranges),
                Operation::Sub(a, b) => {
                    let b = of(b);
                    of(a).plus(Scaled { rest: -b.rest, ..b }, &factors.ranges)
                }
                Operation::Mul(a, b) => of(a).times(of(b)),
                Operation::Div(a, b) => {
                    let (a, b) = (of(a), of(b));
                    a.times(factors.inverse(b))
                }
                Operation::Sqrt(a) => Scaled::plain(of(a).range(&factors.ranges).sqrt()),
                Operation::SinPi(a)
                | Operation::CosPi(a)
                | Operation::Call(Function::Sin | Function::Cos, a) => {
                    let wave = Wave::of(operation)?;
                    let argument = of(a);
                    if let Some(ratio) = wave.ratio(argument.range(&factors.ranges)) {
                        values.push(argument.by(ratio).by(own));
                        continue;
                    }
                    factors.add_waves(wave, *a, argument, self.relative[a.index()]);
                    factors.wave(wave, *a, argument)
                }
                Operation::Call(Function::Ln1p, a) => {
                    let x = of(a).range(&factors.ranges);
                    if of(a).monomial != Monomial::default() {
                        of(a).by(x.ln_1p_ratio())
                    } else {
                        Scaled::plain(x.ln_1p())
                    }
                }
                _ => return None,
            };
            let value = value.by(own);
            if !value.rest.is_finite() {
                return None;
            }
            values.push(value);
        }
        Some(values)
    }

    fn sides(&self, values: &[Scaled], factors: &Factors) -> Option<Sides> {
        let ranges = &factors.ranges;
        let mut slopes: Vec<Polynomial> = vec![Polynomial::default(); self.operations.len()];
        slopes[self.output] = Polynomial::one();
        let mut sides = Sides { error: Vec::new(), allowed: Vec::new(), ranges: ranges.clone() };
        sides.allow(values[self.output].monomial, values[self.output].rest.mignitude());
        let mut of_pi = Polynomial::default();
        for index in (0..self.operations.len()).rev() {
            let slope = std::mem::take(&mut slopes[index]);
            if slope.is_zero() {
                continue;
            }
            let operation = &self.operations[index];
            let value = values[index];
            let own = self.rounding[index];
            if own > 0.0 {
                for term in slope.times(value) {
                    sides.err(term.monomial, own * term.rest.magnitude(), factors);
                }
            }
            // Past this operation the derivative has the factor 1 + d.
            let passed = Scaled::plain(Interval::ONE.widened(own * UNIT));
            let range = |slot: &Slot| values[slot.index()].range(ranges);
            let mut pass = |slot: &Slot, factor: Scaled| {
                let factor = factor.times(passed);
                for term in slope.times(factor) {
                    slopes[slot.index()].add(term, ranges);
                }
            };
            let plain = Scaled::plain;
            match operation {
                Operation::Number(_) => {}
                Operation::Pi => slope.times(value).for_each(|term| of_pi.add(term, ranges)),
                Operation::Input(_) => {
                    let mut weight = Polynomial::default();
                    slope.times(value).for_each(|term| weight.add(term, ranges));
                    if let Some((monomial, least)) = weight.least(ranges) {
                        sides.allow(monomial, least);
                    }
                }
                Operation::Neg(a) => pass(a, plain(-Interval::ONE)),
                Operation::Add(a, b) => {
                    pass(a, plain(Interval::ONE));
                    pass(b, plain(Interval::ONE));
                }
                Operation::Sub(a, b) => {
                    pass(a, plain(Interval::ONE));
                    pass(b, plain(-Interval::ONE));
                }
                Operation::Mul(a, b) => {
                    pass(a, values[b.index()]);
                    pass(b, values[a.index()]);
                }
                Operation::Div(a, b) => {
                    let inverse = factors.inverse(values[b.index()]);
                    pass(a, inverse);
                    let square = inverse.times(inverse).times(values[a.index()]);
                    pass(b, Scaled { rest: -square.rest, ..square });
                }
                Operation::Sqrt(a) => {
                    let root = range(a).sqrt();
                    pass(a, plain(Interval::point(0.5).over(root)));
                }
                Operation::SinPi(a)
                | Operation::CosPi(a)
                | Operation::Call(Function::Sin | Function::Cos, a) => {
                    let wave = Wave::of(operation)?;
                    let derivative = wave.slope(factors, *a, values[a.index()]);
                    pass(a, derivative);
                    if wave.times_pi {
                        let weight = derivative.times(passed).times(values[a.index()]);
                        slope.times(weight).for_each(|term| of_pi.add(term, ranges));
                    }
                }
                Operation::Call(Function::Ln1p, a) => {
                    pass(a, plain(Interval::ONE.over(Interval::ONE + range(a))));
                }
                _ => return None,
            }
        }
        if let Some((monomial, least)) = of_pi.least(ranges) {
            sides.allow(monomial, least);
        }
        sides.is_finite().then_some(sides)
    }
}

/// A sine or a cosine of the argument, or of pi times it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Wave {
    cosine: bool,
    times_pi: bool,
}

impl Wave {
    fn of(operation: &Operation) -> Option<Self> {
        let (cosine, times_pi) = match operation {
            Operation::SinPi(_) => (false, true),
            Operation::CosPi(_) => (true, true),
            Operation::Call(Function::Sin, _) => (false, false),
            Operation::Call(Function::Cos, _) => (true, false),
            _ => return None,
        };
        Some(Self { cosine, times_pi })
    }

    fn other(self) -> Self {
        Self { cosine: !self.cosine, ..self }
    }

    /// The sine divided by its argument, where that passes zero and the sine does so nowhere else.
    fn ratio(self, x: Interval) -> Option<Interval> {
        let factor = if self.times_pi { Interval::PI } else { Interval::ONE };
        let angle = factor * x;
        let near = !self.cosine && x.has_zero() && angle.magnitude() < LARGEST_ANGLE_AT_ZERO;
        near.then(|| factor * angle.sine_ratio())
    }

    fn over(self, x: Interval) -> Interval {
        match (self.cosine, self.times_pi) {
            (false, true) => x.sin_pi(),
            (true, true) => x.cos_pi(),
            (false, false) => x.sin(),
            (true, false) => x.cos(),
        }
    }

    /// The derivative.
    fn slope(self, factors: &Factors, slot: Slot, argument: Scaled) -> Scaled {
        let other = factors.wave(self.other(), slot, argument);
        let factor = if self.times_pi { Interval::PI } else { Interval::ONE };
        other.by(if self.cosine { -factor } else { factor })
    }
}

/// Factors that are kept apart on a box.
#[derive(Default)]
struct Factors {
    /// The range of each factor.
    ranges: Vec<Interval>,
    /// The largest distance of each factor from its value without rounding errors, as a monomial with a coefficient.
    errors: Vec<Option<(Monomial, f64)>>,
    /// The sines and cosines among them.
    waves: Vec<(Wave, Slot, Monomial)>,
}

impl Factors {
    fn add(&mut self, range: Interval, error: Option<(Monomial, f64)>) -> Option<Monomial> {
        if self.ranges.len() == MOST_FACTORS {
            return None;
        }
        self.ranges.push(range);
        self.errors.push(error);
        Some(Monomial::factor(self.ranges.len() - 1))
    }

    /// Keeps the sine and the cosine of an argument apart; `relative` is the relative error of the argument.
    fn add_waves(&mut self, wave: Wave, slot: Slot, argument: Scaled, relative: f64) {
        if !relative.is_finite() {
            return;
        }
        let x = argument.range(&self.ranges);
        let slope = if wave.times_pi { Interval::PI } else { Interval::ONE };
        // To first order, with a margin for higher orders.
        let error = (argument.rest * slope).magnitude() * relative * UNIT * (1.0 + 1e-9);
        for wave in [wave, wave.other()] {
            if self.waves.iter().all(|(known, at, _)| (*known, *at) != (wave, slot))
                && let Some(monomial) = self.add(wave.over(x), Some((argument.monomial, error)))
            {
                self.waves.push((wave, slot, monomial));
            }
        }
    }

    fn wave(&self, wave: Wave, slot: Slot, argument: Scaled) -> Scaled {
        match self.waves.iter().find(|(known, at, _)| (*known, *at) == (wave, slot)) {
            Some((.., monomial)) => Scaled { monomial: *monomial, rest: Interval::ONE },
            None => Scaled::plain(wave.over(argument.range(&self.ranges))),
        }
    }
}

impl Factors {
    /// One divided by a value. Its factors stay apart where they are exact and not zero.
    fn inverse(&self, value: Scaled) -> Scaled {
        let exact = |factor: usize| {
            value.monomial.exponent(factor) == 0
                || (self.errors[factor].is_none() && !self.ranges[factor].has_zero())
        };
        if (0..self.ranges.len()).all(exact) {
            let rest = Interval::ONE.over(value.rest);
            return Scaled { monomial: value.monomial.inverse(), rest };
        }
        Scaled::plain(Interval::ONE.over(value.range(&self.ranges)))
    }
}

/// Both sides of the acceptance rule over a box, as sums of absolute monomials with coefficients.
#[derive(Clone, Debug)]
pub struct Sides {
    /// Upper bound of the error, in units of `2^-53`.
    error: Vec<(Monomial, f64)>,
    /// Lower bound of `s + |g|`.
    allowed: Vec<(Monomial, f64)>,
    ranges: Vec<Interval>,
}

fn insert(sum: &mut Vec<(Monomial, f64)>, monomial: Monomial, coefficient: f64) {
    match sum.iter_mut().find(|(known, _)| *known == monomial) {
        Some((_, known)) => *known += coefficient,
        None => sum.push((monomial, coefficient)),
    }
}

impl Sides {
    fn allow(&mut self, monomial: Monomial, coefficient: f64) {
        if coefficient > 0.0 {
            insert(&mut self.allowed, monomial, coefficient);
        }
    }

    /// Adds a term of the error, whose factors may be perturbed.
    fn err(&mut self, monomial: Monomial, coefficient: f64, factors: &Factors) {
        let mut terms = vec![(monomial, coefficient)];
        for (factor, error) in factors.errors.iter().enumerate() {
            let exponent = f64::from(monomial.exponent(factor));
            if let Some((beside, error)) = error
                && exponent > 0.0
            {
                // |sin|^k of the perturbed argument is at most |sin|^k + k e: neither is above one.
                let without = |(monomial, coefficient): &(Monomial, f64)| {
                    let monomial = monomial.without(factor).times(*beside);
                    (monomial, coefficient * exponent * error * (1.0 + SLACK))
                };
                terms.extend(terms.iter().map(without).collect::<Vec<_>>());
            }
        }
        for (monomial, coefficient) in terms {
            insert(&mut self.error, monomial, coefficient);
        }
    }

    /// A bound of the error, in units of `2^-53`, anywhere in the box.
    #[must_use]
    pub fn largest_error(&self) -> f64 {
        let size = |(m, c): &(Monomial, f64)| c * m.range(&self.ranges).magnitude();
        self.error.iter().map(size).sum::<f64>() * (1.0 + SLACK)
    }

    /// A lower bound of `s + |g|`, anywhere in the box.
    #[must_use]
    pub fn least_allowed(&self) -> f64 {
        let size = |(m, c): &(Monomial, f64)| c * m.range(&self.ranges).mignitude();
        self.allowed.iter().map(size).sum::<f64>() * (1.0 - SLACK)
    }

    fn is_finite(&self) -> bool {
        self.error.iter().all(|(_, coefficient)| coefficient.is_finite())
            && self.allowed.iter().all(|(_, coefficient)| coefficient.is_finite())
    }

    /// Whether the error is at most `factor` times what the rule counts, all over the box, but for [`REMAINDER`].
    ///
    /// Each monomial `m` of the error is covered by the same monomial, and by others `m'` for which `m/m'` is bounded, since
    /// `|m| <= |m'| sup |m/m'|`: any way of doing so is a proof.
    #[must_use]
    pub fn covered(&self, factor: f64) -> bool {
        let mut supply: Vec<(Monomial, f64)> =
            self.allowed.iter().map(|(m, c)| (*m, c * factor * (1.0 - SLACK))).collect();
        let mut demand = self.error.clone();
        demand.sort_by_key(|(monomial, _)| std::cmp::Reverse((monomial.degree(), *monomial)));
        let mut left = 0.0;
        for (monomial, coefficient) in demand {
            let mut needed = coefficient * (1.0 + SLACK);
            let ratio = |source: Monomial| monomial.beside(source).range(&self.ranges).magnitude();
            let mut sources: Vec<(Monomial, f64, &mut f64)> = supply
                .iter_mut()
                .map(|(source, amount)| (*source, ratio(*source), amount))
                .filter(|(_, ratio, _)| ratio.is_finite())
                .collect();
            // First the same monomial, which covers without loss.
            sources.sort_by(|a, b| {
                (a.0 != monomial).cmp(&(b.0 != monomial)).then(a.1.total_cmp(&b.1))
            });
            for (_, ratio, amount) in sources {
                let taken = amount.min(needed * ratio);
                *amount -= taken;
                needed = if taken < needed * ratio { needed - taken / ratio } else { 0.0 };
                if needed <= 0.0 {
                    break;
                }
            }
            left += needed.max(0.0) * monomial.range(&self.ranges).magnitude();
        }
        left <= REMAINDER
    }

    /// The least multiple of `1/steps` up to `most` that covers the error; `None` where no multiple does.
    #[must_use]
    pub fn factor(&self, most: f64, steps: f64) -> Option<f64> {
        let (mut low, mut high) = (0, (most * steps).ceil() as u32);
        if !self.covered(f64::from(high) / steps) {
            return None;
        }
        while low + 1 < high {
            let middle = low + (high - low) / 2;
            if self.covered(f64::from(middle) / steps) { high = middle } else { low = middle }
        }
        Some(f64::from(high) / steps)
    }
}
