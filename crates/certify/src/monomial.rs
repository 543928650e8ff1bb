//! Intervals times factors that are known exactly.
//!
//! Both sides of the acceptance rule vanish where a sine, a coordinate or the amplitude does. Such factors are kept apart, so that they
//! cancel: a value is a [`Monomial`] of factors times an interval, and a sum of such values is a [`Polynomial`].

use crate::interval::Interval;

/// The number of factors that are kept apart on a box; further factors stay within intervals.
pub(crate) const MOST_FACTORS: usize = 16;

/// The exponents of the factors in a product.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Monomial([i8; MOST_FACTORS]);

impl Monomial {
    pub(crate) fn factor(index: usize) -> Self {
        let mut monomial = Self::default();
        monomial.0[index] = 1;
        monomial
    }

    pub(crate) fn exponent(self, factor: usize) -> i8 {
        self.0[factor]
    }

    pub(crate) fn without(mut self, factor: usize) -> Self {
        self.0[factor] = 0;
        self
    }

    pub(crate) fn degree(self) -> i32 {
        self.0.iter().map(|&e| i32::from(e)).sum()
    }

    fn each(self, other: Self, with: impl Fn(i8, i8) -> i8) -> Self {
        Self(std::array::from_fn(|n| with(self.0[n], other.0[n])))
    }

    /// The product. An exponent of 127 is beyond every program.
    pub(crate) fn times(self, other: Self) -> Self {
        self.each(other, i8::saturating_add)
    }

    pub(crate) fn inverse(self) -> Self {
        Self::default().beside(self)
    }

    pub(crate) fn common(self, other: Self) -> Self {
        self.each(other, i8::min)
    }

    pub(crate) fn divides(self, other: Self) -> bool {
        self.common(other) == self
    }

    /// The quotient by a divisor.
    pub(crate) fn beside(self, divisor: Self) -> Self {
        self.each(divisor, |own, divisor| own - divisor)
    }

    /// The range of the product.
    pub(crate) fn range(self, factors: &[Interval]) -> Interval {
        let mut range = Interval::ONE;
        for (&exponent, &factor) in self.0.iter().zip(factors) {
            if exponent == 0 {
                continue;
            }
            let size = Interval::new(factor.mignitude(), factor.magnitude());
            let mut power = if exponent % 2 == 0 { Interval::ONE } else { factor };
            for _ in 0..exponent.unsigned_abs() / 2 {
                power = power * (size * size);
            }
            range = range * if exponent > 0 { power } else { Interval::ONE.over(power) };
        }
        range
    }
}

/// A monomial times an interval.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scaled {
    pub(crate) monomial: Monomial,
    pub(crate) rest: Interval,
}

impl Scaled {
    pub(crate) fn plain(rest: Interval) -> Self {
        Self { monomial: Monomial::default(), rest }
    }

    pub(crate) fn times(self, other: Self) -> Self {
        Self { monomial: self.monomial.times(other.monomial), rest: self.rest * other.rest }
    }

    pub(crate) fn by(self, factor: Interval) -> Self {
        Self { monomial: self.monomial, rest: self.rest * factor }
    }

    pub(crate) fn range(self, factors: &[Interval]) -> Interval {
        self.monomial.range(factors) * self.rest
    }

    /// The sum, in which the factors that both have stay apart.
    pub(crate) fn plus(self, other: Self, factors: &[Interval]) -> Self {
        if self.rest == Interval::ZERO {
            return other;
        }
        if other.rest == Interval::ZERO {
            return self;
        }
        let monomial = self.monomial.common(other.monomial);
        let part = |term: Self| term.monomial.beside(monomial).range(factors) * term.rest;
        Self { monomial, rest: part(self) + part(other) }
    }
}

/// A sum of terms of which no monomial divides another.
#[derive(Clone, Debug, Default)]
pub(crate) struct Polynomial(Vec<Scaled>);

impl Polynomial {
    pub(crate) fn one() -> Self {
        Self(vec![Scaled::plain(Interval::ONE)])
    }

    pub(crate) fn is_zero(&self) -> bool {
        self.0.is_empty()
    }

    /// Adds a term. A term whose monomial is a multiple of another term's monomial is added to that term's interval.
    pub(crate) fn add(&mut self, term: Scaled, factors: &[Interval]) {
        if term.rest == Interval::ZERO {
            return;
        }
        if let Some(known) = self.0.iter_mut().find(|known| known.monomial.divides(term.monomial)) {
            let ratio = term.monomial.beside(known.monomial).range(factors);
            known.rest = known.rest + ratio * term.rest;
            return;
        }
        let mut sum = term;
        self.0.retain(|known| {
            let below = term.monomial.divides(known.monomial);
            if below {
                let ratio = known.monomial.beside(term.monomial).range(factors);
                sum.rest = sum.rest + ratio * known.rest;
            }
            !below
        });
        self.0.push(sum);
    }

    /// Every term times a factor.
    pub(crate) fn times(&self, factor: Scaled) -> impl Iterator<Item = Scaled> + use<'_> {
        self.0.iter().map(move |term| term.times(factor))
    }

    /// A monomial and a number whose product is nowhere greater than the absolute value of the polynomial.
    pub(crate) fn least(&self, factors: &[Interval]) -> Option<(Monomial, f64)> {
        let mut terms = self.0.iter();
        let first = *terms.next()?;
        let sum = terms.fold(first, |sum, term| sum.plus(*term, factors));
        Some((sum.monomial, sum.rest.mignitude()))
    }
}
