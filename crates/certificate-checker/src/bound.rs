//! Both sides of the rule over one box: `sum_i c_i |v_i dg/dv_i|` and `|g| + sum_q |q dg/dq|`.
//!
//! Quantities are products of powers of the inputs, the sines and the cosines, times a range. Values and derivatives are those of
//! the program with any errors `|d_i| <= c_i 2^-53` in its operations, so that by the mean value theorem nothing is left out.

use crate::number::Range;
use std::collections::BTreeMap;

/// The number of inputs, sines and cosines that are kept apart in a box.
const MOST: usize = 16;
const UNIT: f64 = 1.0 / (1_u64 << 53) as f64;
/// A margin for the roundings of this comparison.
const SPARE: f64 = 1e-13;
/// The largest argument for which a sine whose argument passes zero is written as the argument times a ratio.
const SMALL_ANGLE: f64 = 1.2;

type Powers = [i8; MOST];

/// An operation on the values of earlier lines.
#[derive(Clone, Copy)]
pub(crate) enum Line {
    /// A number, its nearest double, and whether it is that double.
    Number(f64, bool),
    Pi,
    Input(usize),
    Sum(usize, usize, f64),
    Product(usize, usize),
    Quotient(usize, usize),
    Minus(usize),
    Root(usize),
    Wave {
        cosine: bool,
        times_pi: bool,
        of: usize,
    },
    Logarithm(usize),
}

impl Line {
    /// Reads line number `own`.
    pub(crate) fn read(text: &str, own: usize, inputs: usize) -> Option<Self> {
        let words: Vec<&str> = text.split(' ').collect();
        let line = |n: usize| words.get(n)?.parse().ok().filter(|line: &usize| *line < own);
        let wave = |cosine, times_pi| Some(Self::Wave { cosine, times_pi, of: line(1)? });
        let (read, count) = match words[0] {
            "number" => (Self::number(words.get(1)?)?, 2),
            "pi" => (Self::Pi, 1),
            "input" => (Self::Input(words.get(1)?.parse().ok().filter(|n| *n < inputs)?), 2),
            "add" => (Self::Sum(line(1)?, line(2)?, 1.0), 3),
            "sub" => (Self::Sum(line(1)?, line(2)?, -1.0), 3),
            "mul" => (Self::Product(line(1)?, line(2)?), 3),
            "div" => (Self::Quotient(line(1)?, line(2)?), 3),
            "neg" => (Self::Minus(line(1)?), 2),
            "sqrt" => (Self::Root(line(1)?), 2),
            "sin_pi" => (wave(false, true)?, 2),
            "cos_pi" => (wave(true, true)?, 2),
            "sin" => (wave(false, false)?, 2),
            "cos" => (wave(true, false)?, 2),
            "log1p" => (Self::Logarithm(line(1)?), 2),
            _ => return None,
        };
        (words.len() == count).then_some(read)
    }

    /// A whole number or a quotient of two, whose digits fit a double each.
    fn number(text: &str) -> Option<Self> {
        let (above, below) = text.split_once('/').unwrap_or((text, "1"));
        let whole =
            |text: &str| text.parse::<u64>().ok().filter(|n| *n < 1 << 53).map(|n| n as f64);
        let (above, below) = (whole(above)?, whole(below)?);
        let exact = below > 0.0 && below.to_bits().trailing_zeros() >= 52;
        (below > 0.0).then_some(Self::Number(above / below, exact))
    }

    fn operands(self) -> Vec<usize> {
        match self {
            Self::Number(..) | Self::Pi | Self::Input(_) => vec![],
            Self::Sum(a, b, _) | Self::Product(a, b) | Self::Quotient(a, b) => vec![a, b],
            Self::Minus(a) | Self::Root(a) | Self::Wave { of: a, .. } | Self::Logarithm(a) => {
                vec![a]
            }
        }
    }

    /// The exponent of its unit; `None` where its operands do not agree.
    pub(crate) fn unit(self, of: &[f64], inputs: &[f64]) -> Option<f64> {
        match self {
            Self::Number(..) | Self::Pi => Some(0.0),
            Self::Input(input) => inputs.get(input).copied(),
            Self::Sum(a, b, _) => (of[a] == of[b]).then_some(of[a]),
            Self::Product(a, b) => Some(of[a] + of[b]),
            Self::Quotient(a, b) => Some(of[a] - of[b]),
            Self::Minus(a) => Some(of[a]),
            Self::Root(a) => Some(0.5 * of[a]),
            Self::Wave { of: a, .. } | Self::Logarithm(a) => (of[a] == 0.0).then_some(0.0),
        }
    }
}

/// Powers of factors times a range.
#[derive(Clone, Copy)]
struct Term {
    powers: Powers,
    range: Range,
}

impl Term {
    fn of(range: Range) -> Self {
        Self { powers: [0; MOST], range }
    }

    fn times(self, other: Self) -> Self {
        Self {
            powers: joined(self.powers, other.powers, i8::saturating_add),
            range: self.range.times(other.range),
        }
    }

    fn scaled(self, by: Range) -> Self {
        Self { range: self.range.times(by), ..self }
    }
}

fn joined(a: Powers, b: Powers, with: impl Fn(i8, i8) -> i8) -> Powers {
    std::array::from_fn(|n| with(a[n], b[n]))
}

fn divides(a: Powers, b: Powers) -> bool {
    a.iter().zip(&b).all(|(a, b)| a <= b)
}

/// A factor: its range, and for a sine or cosine the largest distance from its exact value, as powers times a number.
struct Factor {
    range: Range,
    error: Option<(Powers, f64)>,
    wave: Option<(bool, bool, usize)>,
}

/// The lines that one output needs.
pub(crate) struct Program<'a> {
    lines: &'a [Line],
    output: usize,
    needed: Vec<bool>,
    /// Errors of each line, in units of 2^-53: the error of its operation, and the error of its value where it is known beforehand.
    own: Vec<f64>,
    all: Vec<f64>,
}

/// One box: its factors, and the value of each line.
struct BoxValues<'a> {
    program: &'a Program<'a>,
    factors: Vec<Factor>,
    values: Vec<Term>,
}

impl<'a> Program<'a> {
    pub(crate) fn new(lines: &'a [Line], output: usize, losses: &BTreeMap<String, f64>) -> Self {
        let mut needed = vec![false; lines.len()];
        needed[output] = true;
        for n in (0..=output).rev() {
            if needed[n] {
                lines[n].operands().into_iter().for_each(|operand| needed[operand] = true);
            }
        }
        let loss = |name: &str| losses.get(name).copied().unwrap_or(f64::INFINITY);
        let doubles = |n: usize| match lines[n] {
            Line::Number(value, true) => {
                value.is_normal() && value.to_bits().trailing_zeros() >= 52
            }
            _ => false,
        };
        let (mut own, mut all) = (Vec::new(), Vec::<f64>::new());
        for line in lines {
            let error = match *line {
                Line::Number(_, true) | Line::Input(_) | Line::Minus(_) => 0.0,
                Line::Product(a, b) if doubles(a) || doubles(b) => 0.0,
                Line::Quotient(_, b) if doubles(b) => 0.0,
                Line::Pi => loss("pi"),
                Line::Wave { times_pi: true, .. } => loss("trigonometric_pi"),
                Line::Wave { .. } => loss("trigonometric"),
                Line::Logarithm(_) => loss("logarithm"),
                _ => loss("arithmetic"),
            };
            let carried = match *line {
                Line::Number(..) | Line::Pi | Line::Input(_) => 0.0,
                Line::Minus(a) => all[a],
                Line::Product(a, b) | Line::Quotient(a, b) => all[a] + all[b],
                Line::Root(a) => 0.5 * all[a],
                Line::Sum(a, b, _) if all[a] == 0.0 && all[b] == 0.0 => 0.0,
                _ => f64::INFINITY,
            };
            own.push(error);
            all.push(error + carried);
        }
        Self { lines, output, needed, own, all }
    }

    /// Whether the factor is at most `claimed` in the box, except for the remainder.
    pub(crate) fn keeps(&self, inputs: &[(&str, Range)], claimed: f64, remainder: f64) -> bool {
        let mut part = BoxValues { program: self, factors: Vec::new(), values: Vec::new() };
        for n in 0..=self.output {
            let value = if self.needed[n] { part.value(n, inputs) } else { Term::of(Range::ONE) };
            let value = value.scaled(Range::ONE.blurred(self.own[n] * UNIT));
            if !value.range.is_known() {
                return false;
            }
            part.values.push(value);
        }
        part.compare(claimed, remainder).unwrap_or(false)
    }
}

impl BoxValues<'_> {
    fn range_of(&self, powers: Powers) -> Range {
        let mut range = Range::ONE;
        for (factor, power) in self.factors.iter().zip(powers) {
            let size = Range::new(factor.range.smallest(), factor.range.largest());
            let start = if power % 2 == 0 { Range::ONE } else { factor.range };
            let power_of =
                (0..power.unsigned_abs() / 2).fold(start, |r, _| r.times(size.times(size)));
            range = range.times(if power < 0 { power_of.inverse() } else { power_of });
        }
        range
    }

    fn whole(&self, term: Term) -> Range {
        self.range_of(term.powers).times(term.range)
    }

    fn factor(&mut self, factor: Factor) -> Option<Term> {
        let index = self.factors.len();
        if index == MOST {
            return None;
        }
        self.factors.push(factor);
        let mut powers = [0; MOST];
        powers[index] = 1;
        Some(Term { powers, range: Range::ONE })
    }

    /// The sum, with the common powers of both terms taken out.
    fn sum(&self, a: Term, b: Term) -> Term {
        if a.range.is_zero() {
            return b;
        }
        if b.range.is_zero() {
            return a;
        }
        let powers = joined(a.powers, b.powers, i8::min);
        let part = |t: Term| self.range_of(joined(t.powers, powers, |a, b| a - b)).times(t.range);
        Term { powers, range: part(a).plus(part(b)) }
    }

    fn value(&mut self, n: usize, inputs: &[(&str, Range)]) -> Term {
        let of = |n: usize| self.values[n];
        match self.program.lines[n] {
            Line::Number(value, true) => Term::of(Range::new(value, value)),
            Line::Number(value, false) => Term::of(Range::new(value.next_down(), value.next_up())),
            Line::Pi => Term::of(Range::pi()),
            Line::Input(input) => {
                let range = inputs[input].1;
                let varies = range.low < range.high;
                let own = if varies {
                    self.factor(Factor { range, error: None, wave: None })
                } else {
                    None
                };
                own.unwrap_or(Term::of(range))
            }
            Line::Minus(a) => Term { range: of(a).range.minus(), ..of(a) },
            Line::Sum(a, b, sign) => self.sum(of(a), of(b).scaled(Range::new(sign, sign))),
            Line::Product(a, b) => of(a).times(of(b)),
            Line::Quotient(a, b) => of(a).times(self.inverse(of(b))),
            Line::Root(a) => Term::of(self.whole(of(a)).root()),
            Line::Logarithm(a) => {
                let x = self.whole(of(a));
                if of(a).powers == [0; MOST] {
                    Term::of(x.logarithm(false))
                } else {
                    of(a).scaled(x.logarithm(true))
                }
            }
            Line::Wave { cosine, times_pi, of: a } => {
                let argument = of(a);
                let x = self.whole(argument);
                let slope = if times_pi { Range::pi() } else { Range::ONE };
                let angle = slope.times(x);
                if !cosine && x.touches_zero() && angle.largest() < SMALL_ANGLE {
                    return argument.scaled(slope.times(angle.sine_ratio()));
                }
                let relative = self.program.all[a] * UNIT * (1.0 + 1e-9);
                if relative.is_finite() {
                    let error = argument.range.times(slope).largest() * relative;
                    for cosine in [cosine, !cosine] {
                        let wave = Some((cosine, times_pi, a));
                        if self.factors.iter().all(|known| known.wave != wave) {
                            let range = x.wave(cosine, times_pi);
                            self.factor(Factor {
                                range,
                                error: Some((argument.powers, error)),
                                wave,
                            });
                        }
                    }
                }
                self.wave(cosine, times_pi, a)
            }
        }
    }

    fn wave(&self, cosine: bool, times_pi: bool, of: usize) -> Term {
        let wave = Some((cosine, times_pi, of));
        let Some(index) = self.factors.iter().position(|factor| factor.wave == wave) else {
            return Term::of(self.whole(self.values[of]).wave(cosine, times_pi));
        };
        let mut powers = [0; MOST];
        powers[index] = 1;
        Term { powers, range: Range::ONE }
    }

    fn inverse(&self, of: Term) -> Term {
        let factors = self.factors.iter().zip(of.powers);
        let exact = |f: &Factor| f.error.is_none() && !f.range.touches_zero();
        if factors.into_iter().all(|(factor, power)| power == 0 || exact(factor)) {
            return Term { powers: of.powers.map(|p| -p), range: of.range.inverse() };
        }
        Term::of(self.whole(of).inverse())
    }

    /// Adds a term to a sum in which the powers of no term divide those of another.
    fn add(&self, sum: &mut Vec<Term>, term: Term) {
        let beside = |a: Powers, b: Powers| self.range_of(joined(a, b, |a, b| a - b));
        if term.range.is_zero() {
            return;
        }
        if let Some(known) = sum.iter_mut().find(|known| divides(known.powers, term.powers)) {
            known.range = known.range.plus(beside(term.powers, known.powers).times(term.range));
            return;
        }
        let mut total = term;
        for multiple in sum.extract_if(.., |known| divides(term.powers, known.powers)) {
            let part = beside(multiple.powers, term.powers).times(multiple.range);
            total.range = total.range.plus(part);
        }
        sum.push(total);
    }

    /// Counts a quantity `q dg/dq` by a lower bound.
    fn count(&self, allowed: &mut BTreeMap<Powers, f64>, terms: &[Term]) {
        let all = terms.iter().copied().reduce(|a, b| self.sum(a, b));
        if let Some(all) = all.filter(|all| all.range.smallest() > 0.0) {
            *allowed.entry(all.powers).or_default() += all.range.smallest();
        }
    }

    fn compare(&self, claimed: f64, remainder: f64) -> Option<bool> {
        let program = self.program;
        let mut slopes: Vec<Vec<Term>> = vec![Vec::new(); program.output + 1];
        slopes[program.output].push(Term::of(Range::ONE));
        let (mut errors, mut allowed) = (BTreeMap::new(), BTreeMap::new());
        self.count(&mut allowed, &[self.values[program.output]]);
        let mut by_pi: Vec<Term> = Vec::new();
        for n in (0..=program.output).rev() {
            let slope = std::mem::take(&mut slopes[n]);
            let own = program.own[n];
            let blur = Term::of(Range::ONE.blurred(own * UNIT));
            let weights: Vec<Term> = slope.iter().map(|t| t.times(self.values[n])).collect();
            weights.iter().filter(|_| own > 0.0).for_each(|w| self.err(&mut errors, *w, own));
            let mut pass = |to: usize, by: Term| {
                slope.iter().for_each(|t| self.add(&mut slopes[to], t.times(by.times(blur))));
            };
            let (of, number) = (|n: usize| self.values[n], |x: f64| Term::of(Range::new(x, x)));
            match program.lines[n] {
                Line::Number(..) => {}
                Line::Pi => weights.iter().for_each(|w| self.add(&mut by_pi, *w)),
                Line::Input(_) => {
                    let mut all = Vec::new();
                    weights.iter().for_each(|w| self.add(&mut all, *w));
                    self.count(&mut allowed, &all);
                }
                Line::Minus(a) => pass(a, number(-1.0)),
                Line::Sum(a, b, sign) => {
                    pass(a, number(1.0));
                    pass(b, number(sign));
                }
                Line::Product(a, b) => {
                    pass(a, of(b));
                    pass(b, of(a));
                }
                Line::Quotient(a, b) => {
                    let inverse = self.inverse(of(b));
                    pass(a, inverse);
                    pass(b, inverse.times(inverse).times(of(a)).times(number(-1.0)));
                }
                Line::Root(a) => {
                    pass(
                        a,
                        Term::of(Range::new(0.5, 0.5).times(self.whole(of(a)).root().inverse())),
                    );
                }
                Line::Logarithm(a) => {
                    pass(a, Term::of(Range::ONE.plus(self.whole(of(a))).inverse()))
                }
                Line::Wave { cosine, times_pi, of: a } => {
                    let slope_of = if times_pi { Range::pi() } else { Range::ONE };
                    let sign = if cosine { slope_of.minus() } else { slope_of };
                    let derivative = self.wave(!cosine, times_pi, a).scaled(sign);
                    pass(a, derivative);
                    let weight = derivative.times(blur).times(of(a));
                    slope
                        .iter()
                        .filter(|_| times_pi)
                        .for_each(|t| self.add(&mut by_pi, t.times(weight)));
                }
            }
        }
        self.count(&mut allowed, &by_pi);
        let known = errors.values().chain(allowed.values()).all(|c: &f64| c.is_finite());
        known.then(|| self.left(errors, allowed, claimed) <= remainder)
    }

    /// Adds a term of the error. A sine at a perturbed argument is at most the sine at the exact argument plus the perturbation.
    fn err(&self, errors: &mut BTreeMap<Powers, f64>, weight: Term, own: f64) {
        let mut terms = vec![(weight.powers, own * weight.range.largest())];
        for (n, factor) in self.factors.iter().enumerate() {
            let power = weight.powers[n];
            let Some((beside, error)) = factor.error.filter(|_| power > 0) else { continue };
            for (mut powers, coefficient) in terms.clone() {
                powers[n] = 0;
                let powers = joined(powers, beside, i8::saturating_add);
                terms.push((powers, coefficient * f64::from(power) * error * (1.0 + SPARE)));
            }
        }
        terms.into_iter().for_each(|(powers, c)| *errors.entry(powers).or_default() += c);
    }

    /// The rest of the errors after the allowed terms have covered their part: first terms with the same powers, then terms that are
    /// not much smaller.
    fn left(
        &self,
        errors: BTreeMap<Powers, f64>,
        allowed: BTreeMap<Powers, f64>,
        claimed: f64,
    ) -> f64 {
        let stock = allowed.into_iter().map(|(powers, c)| (powers, c * claimed * (1.0 - SPARE)));
        let mut stock: Vec<(Powers, f64)> = stock.collect();
        let mut errors: Vec<(Powers, f64)> = errors.into_iter().collect();
        let degree = |powers: &Powers| powers.iter().map(|p| i32::from(*p)).sum::<i32>();
        errors.sort_by_key(|(powers, _)| std::cmp::Reverse((degree(powers), *powers)));
        let mut left = 0.0;
        for (powers, coefficient) in errors {
            let mut needed = coefficient * (1.0 + SPARE);
            let share =
                |other: Powers| self.range_of(joined(powers, other, |a, b| a - b)).largest();
            let mut sources: Vec<(bool, f64, usize)> = stock
                .iter()
                .enumerate()
                .map(|(n, (other, _))| (*other != powers, share(*other), n))
                .filter(|(_, share, _)| share.is_finite())
                .collect();
            sources.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
            for (_, share, n) in sources {
                let taken = stock[n].1.min(needed * share);
                stock[n].1 -= taken;
                needed = if taken < needed * share { needed - taken / share } else { 0.0 };
            }
            left += needed * self.range_of(powers).largest();
        }
        left
    }
}
