//! Polynomials in several variables with rational coefficients, and fractions of them in lowest terms.

use mmsmith_expr::Rational;
use num_traits::{One, Zero};
use std::collections::BTreeMap;

/// Polynomials with more terms than this are given up.
const MOST_TERMS: usize = 1 << 10;
/// Coefficients of more bits than this are given up.
const MOST_BITS: u64 = 1 << 11;

/// A sum of `coefficient * product of x_i ^ exponent_i`, by default zero; all monomials have the same number of exponents.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub(super) struct Polynomial(BTreeMap<Vec<u32>, Rational>);

impl Polynomial {
    pub(super) fn constant(value: Rational, variables: usize) -> Self {
        Self::of([(vec![0; variables], value)])
    }

    pub(super) fn of(terms: impl IntoIterator<Item = (Vec<u32>, Rational)>) -> Self {
        let mut sum = Self::default();
        terms.into_iter().for_each(|(monomial, coefficient)| sum.add_term(monomial, &coefficient));
        sum
    }

    pub(super) fn terms(&self) -> impl Iterator<Item = (&[u32], &Rational)> {
        self.0.iter().map(|(monomial, coefficient)| (monomial.as_slice(), coefficient))
    }

    pub(super) fn is_zero(&self) -> bool {
        self.0.is_empty()
    }

    pub(super) fn is_constant(&self) -> bool {
        self.0.keys().all(|monomial| monomial.iter().all(|n| *n == 0))
    }

    fn add_term(&mut self, monomial: Vec<u32>, coefficient: &Rational) {
        let total = self.0.remove(&monomial).unwrap_or_default() + coefficient;
        if !total.is_zero() {
            self.0.insert(monomial, total);
        }
    }

    pub(super) fn minus(&self, other: &Self) -> Self {
        let mut difference = self.clone();
        for (monomial, coefficient) in &other.0 {
            difference.add_term(monomial.clone(), &-coefficient);
        }
        difference
    }

    pub(super) fn plus(&self, other: &Self) -> Self {
        let mut sum = self.clone();
        for (monomial, coefficient) in &other.0 {
            sum.add_term(monomial.clone(), coefficient);
        }
        sum
    }

    /// With the sum of variable `v` and `shift` in the place of `v`.
    pub(super) fn with_sum(&self, v: usize, shift: &Self) -> Option<Self> {
        // Horner's rule.
        let mut total = Self::default();
        for n in (0..=self.degree(v)).rev() {
            let (shifted, raised) = (total.times(shift)?, total.shifted(v, 1));
            total = shifted.plus(&raised).plus(&self.coefficient(v, n));
        }
        total.of_reasonable_size()
    }

    /// Quotient by variable `v` less `place`, in which it does not occur, and rest, by Horner's rule.
    pub(super) fn divided_by_distance(&self, v: usize, place: &Self) -> Option<(Self, Self)> {
        let mut quotient = Self::default();
        let mut rest = Self::default();
        for n in (0..=self.degree(v)).rev() {
            quotient = quotient.plus(&rest.shifted(v, n));
            rest = rest.times(place)?.plus(&self.coefficient(v, n));
        }
        Some((quotient.of_reasonable_size()?, rest.of_reasonable_size()?))
    }

    /// The product; `None` where it grows too large.
    pub(super) fn times(&self, other: &Self) -> Option<Self> {
        let mut product = Self::default();
        for (m, c) in &self.0 {
            for (n, d) in &other.0 {
                let monomial = m.iter().zip(n).map(|(a, b)| a + b).collect();
                product.add_term(monomial, &(c * d));
            }
        }
        product.of_reasonable_size()
    }

    fn of_reasonable_size(self) -> Option<Self> {
        let bits = |c: &Rational| c.bits().0.max(c.bits().1);
        (self.0.len() <= MOST_TERMS && self.0.values().all(|c| bits(c) <= MOST_BITS))
            .then_some(self)
    }

    fn scaled(&self, factor: &Rational) -> Self {
        Self::of(self.0.iter().map(|(m, c)| (m.clone(), c * factor)))
    }

    /// Times the power `n` of variable `v`.
    pub(super) fn shifted(&self, v: usize, n: u32) -> Self {
        Self::of(self.0.iter().map(|(monomial, c)| {
            let mut monomial = monomial.clone();
            monomial[v] += n;
            (monomial, c.clone())
        }))
    }

    /// The leading coefficient made one.
    pub(super) fn monic(&self) -> Self {
        match self.0.last_key_value() {
            Some((_, leading)) => self.scaled(&(Rational::one() / leading)),
            None => Self::default(),
        }
    }

    pub(super) fn degree(&self, v: usize) -> u32 {
        self.0.keys().map(|monomial| monomial[v]).max().unwrap_or(0)
    }

    /// The coefficient of the power `n` of variable `v`.
    pub(super) fn coefficient(&self, v: usize, n: u32) -> Self {
        let of_degree = self.0.iter().filter(|(monomial, _)| monomial[v] == n);
        Self::of(of_degree.map(|(monomial, c)| {
            let mut monomial = monomial.clone();
            monomial[v] = 0;
            (monomial, c.clone())
        }))
    }

    /// The quotient, where `divisor` divides without rest; `None` elsewhere.
    pub(super) fn divided_by(&self, divisor: &Self) -> Option<Self> {
        let (leading, coefficient) = divisor.0.last_key_value()?;
        let mut rest = self.clone();
        let mut quotient = Self::default();
        while let Some((monomial, c)) = rest.0.last_key_value() {
            let difference: Option<Vec<u32>> =
                monomial.iter().zip(leading).map(|(a, b)| a.checked_sub(*b)).collect();
            let (monomial, c) = (difference?, c / coefficient);
            let step = Self::of([(monomial.clone(), c.clone())]).times(divisor)?;
            quotient.add_term(monomial, &c);
            rest = rest.minus(&step).of_reasonable_size()?;
        }
        Some(quotient)
    }

    /// The polynomial with `factor` divided out as often as it goes, and how often that is; of zero, zero.
    pub(super) fn divided_out(mut self, factor: &Self) -> (Self, u32) {
        let mut power = 0;
        while !self.is_zero()
            && let Some(quotient) = self.divided_by(factor)
        {
            (self, power) = (quotient, power + 1);
        }
        (self, power)
    }

    /// The greatest common divisor of the coefficients with respect to variable `v`.
    fn content(&self, v: usize) -> Option<Self> {
        let mut content = Self::default();
        for n in 0..=self.degree(v) {
            content = content.gcd(&self.coefficient(v, n))?;
        }
        Some(content)
    }

    /// The greatest common divisor, with leading coefficient one, by Euclid's algorithm on primitive remainders in one
    /// variable after the other (W. S. Brown, "On Euclid's algorithm and the computation of polynomial greatest common
    /// divisors", 1971); `None` where it grows too large.
    pub(super) fn gcd(&self, other: &Self) -> Option<Self> {
        if self.is_zero() || other.is_zero() {
            return Some(if self.is_zero() { other.monic() } else { self.monic() });
        }
        let variables = self.0.keys().chain(other.0.keys()).flat_map(|monomial| {
            monomial.iter().enumerate().filter(|(_, n)| **n > 0).map(|(v, _)| v)
        });
        let Some(v) = variables.max() else {
            let length = self.0.keys().next().map_or(0, Vec::len);
            return Some(Self::constant(Rational::one(), length));
        };
        let (self_content, other_content) = (self.content(v)?, other.content(v)?);
        let content = self_content.gcd(&other_content)?;
        let mut p = self.divided_by(&self_content)?;
        let mut q = other.divided_by(&other_content)?;
        // Where q has the larger degree, the first remainder is p itself, and the two change places.
        while !q.is_zero() {
            if q.degree(v) == 0 {
                return Some(content);
            }
            let rest = p.pseudo_remainder(&q, v)?;
            let rest =
                if rest.is_zero() { rest } else { rest.divided_by(&rest.content(v)?)?.monic() };
            (p, q) = (q, rest);
        }
        Some(content.times(&p.monic())?.monic())
    }

    /// A multiple of `self` less a multiple of `divisor`, of smaller degree in `v` than `divisor`.
    fn pseudo_remainder(&self, divisor: &Self, v: usize) -> Option<Self> {
        let degree = divisor.degree(v);
        let leading = divisor.coefficient(v, degree);
        let mut rest = self.clone();
        while !rest.is_zero() && rest.degree(v) >= degree {
            let n = rest.degree(v);
            let step = rest.coefficient(v, n).times(divisor)?.shifted(v, n - degree);
            rest = rest.times(&leading)?.minus(&step).of_reasonable_size()?;
        }
        Some(rest)
    }
}

/// A fraction of polynomials in lowest terms.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Fraction {
    pub(super) numerator: Polynomial,
    pub(super) denominator: Polynomial,
}

impl Fraction {
    pub(super) fn of(numerator: Polynomial, variables: usize) -> Self {
        Fraction { numerator, denominator: Polynomial::constant(Rational::one(), variables) }
    }

    pub(super) fn reduced(numerator: Polynomial, denominator: Polynomial) -> Option<Self> {
        let common = numerator.gcd(&denominator)?;
        let (numerator, denominator) =
            (numerator.divided_by(&common)?, denominator.divided_by(&common)?);
        Some(Fraction { numerator, denominator })
    }

    pub(super) fn is_zero(&self) -> bool {
        self.numerator.is_zero()
    }

    /// This fraction with the leading coefficient of the denominator one.
    pub(super) fn with_monic_denominator(self) -> Self {
        let leading = self.denominator.terms().last().map(|(_, leading)| Rational::one() / leading);
        let Some(factor) = leading else { return self };
        let [numerator, denominator] =
            [self.numerator, self.denominator].map(|polynomial| polynomial.scaled(&factor));
        Fraction { numerator, denominator }
    }

    pub(super) fn negated(mut self) -> Self {
        self.numerator = Polynomial::default().minus(&self.numerator);
        self
    }

    pub(super) fn minus(&self, other: &Self) -> Option<Self> {
        let left = self.numerator.times(&other.denominator)?;
        let right = other.numerator.times(&self.denominator)?;
        Self::reduced(left.minus(&right), self.denominator.times(&other.denominator)?)
    }

    pub(super) fn times(&self, other: &Self) -> Option<Self> {
        let numerator = self.numerator.times(&other.numerator)?;
        Self::reduced(numerator, self.denominator.times(&other.denominator)?)
    }

    /// The quotient by a fraction that is not zero.
    pub(super) fn divided_by(&self, other: &Self) -> Option<Self> {
        let Fraction { numerator, denominator } = other.clone();
        self.times(&Fraction { numerator: denominator, denominator: numerator })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Small polynomials in two variables.
    fn polynomial() -> impl Strategy<Value = Polynomial> {
        let term = (0..3_u32, 0..3_u32, -3..=3_i64)
            .prop_map(|(m, n, c)| (vec![m, n], Rational::from_integer(c.into())));
        prop::collection::vec(term, 1..4).prop_map(Polynomial::of)
    }

    #[test]
    fn products_of_too_many_terms_or_bits_are_given_up() {
        let powers = |v: usize, count: u32| {
            Polynomial::of((0..count).map(|n| {
                let mut exponents = vec![0; 2];
                exponents[v] = n;
                (exponents, Rational::one())
            }))
        };
        assert!(powers(0, 32).times(&powers(1, 32)).is_some());
        assert!(powers(0, 32).times(&powers(1, 33)).is_none());
        let of_bits = |bits: u32| {
            let power = num_traits::pow(Rational::from_integer(2.into()), bits as usize - 1);
            Polynomial::constant(power, 2)
        };
        assert!(of_bits(1024).times(&of_bits(1025)).is_some());
        assert!(of_bits(1025).times(&of_bits(1025)).is_none());
    }

    proptest! {
        #[test]
        fn a_common_factor_is_found(a in polynomial(), b in polynomial(), common in polynomial()) {
            let left = a.times(&common).unwrap();
            let right = b.times(&common).unwrap();
            let gcd = left.gcd(&right).unwrap();
            if !left.is_zero() && !right.is_zero() {
                prop_assert!(gcd.divided_by(&common).is_some());
                prop_assert_eq!(left.divided_by(&gcd).unwrap().times(&gcd).unwrap(), left);
                prop_assert_eq!(right.divided_by(&gcd).unwrap().times(&gcd).unwrap(), right);
            }
        }

        #[test]
        fn fractions_cancel(a in polynomial(), b in polynomial()) {
            prop_assume!(!a.is_zero() && !b.is_zero());
            let fraction = |p: &Polynomial| Fraction::of(p.clone(), 2);
            let quotient = fraction(&a).divided_by(&fraction(&b)).unwrap();
            let back = quotient.times(&fraction(&b)).unwrap();
            prop_assert_eq!(back.numerator.times(&fraction(&a).denominator).unwrap().minus(
                &a.times(&back.denominator).unwrap()), Polynomial::default());
            prop_assert!(quotient.minus(&quotient).unwrap().is_zero());
        }
    }
}
