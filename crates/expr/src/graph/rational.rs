//! Exact rational numbers, and their rounding to floating point.

use num_bigint::{BigInt, BigUint};
use num_rational::BigRational;
use num_traits::{Num, One, Pow, Signed, ToPrimitive, Zero};
use std::cmp::Ordering;
use std::fmt;
use std::hash::{Hash, Hasher};
use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Rem, Sub, SubAssign};

/// An exact rational number of any size.
///
/// Nearly all numbers of a derivation are small; they are kept without memory of their own, and arithmetic with them
/// is that of the machine.
#[derive(Clone, PartialEq, Eq, Hash)]
pub struct Rational(Value);

/// Numerator and positive denominator, without a common factor. What fits is small, so that equal numbers look alike.
#[derive(Clone, PartialEq, Eq)]
enum Value {
    Small(i64, i64),
    Big(Box<BigRational>),
}
use Value::{Big, Small};

impl Hash for Value {
    /// One word for what is small: all nodes of a graph are found by their hashes.
    fn hash<H: Hasher>(&self, state: &mut H) {
        match self {
            Small(n, d) => state.write_i64(n ^ d.rotate_left(32)),
            Big(value) => value.hash(state),
        }
    }
}

impl Rational {
    /// `numerator / denominator`, reduced.
    ///
    /// # Panics
    ///
    /// Where the denominator is zero, as the division of numbers does.
    #[must_use]
    pub fn new(numerator: BigInt, denominator: BigInt) -> Self {
        match (numerator.to_i64(), denominator.to_i64()) {
            (Some(n), Some(d)) if d != 0 => Self::reduced(n.into(), d.into()),
            _ => Self::from_big(BigRational::new(numerator, denominator)),
        }
    }

    /// The integer `value`.
    #[must_use]
    pub fn from_integer(value: BigInt) -> Self {
        match value.to_i64() {
            Some(value) => Self::reduced(value.into(), 1),
            None => Self::from_big(BigRational::from_integer(value)),
        }
    }

    /// The exact value of a floating-point number; `None` where that is not finite.
    #[must_use]
    pub fn from_float(value: f64) -> Option<Self> {
        BigRational::from_float(value).map(Self::from_big)
    }

    /// The numerator, which has the sign.
    #[must_use]
    pub fn numer(&self) -> BigInt {
        match &self.0 {
            Small(n, _) => (*n).into(),
            Big(value) => value.numer().clone(),
        }
    }

    /// The denominator, positive.
    #[must_use]
    pub fn denom(&self) -> BigInt {
        match &self.0 {
            Small(_, d) => (*d).into(),
            Big(value) => value.denom().clone(),
        }
    }

    /// The number of bits of numerator and denominator.
    #[must_use]
    pub fn bits(&self) -> (u64, u64) {
        let bits = |n: i64| u64::from(i64::BITS - n.unsigned_abs().leading_zeros());
        match &self.0 {
            Small(n, d) => (bits(*n), bits(*d)),
            Big(value) => (value.numer().bits(), value.denom().bits()),
        }
    }

    /// Whether the denominator is one.
    #[must_use]
    pub fn is_integer(&self) -> bool {
        match &self.0 {
            Small(_, d) => *d == 1,
            Big(value) => value.is_integer(),
        }
    }

    /// The number without its fractional part.
    #[must_use]
    pub fn to_integer(&self) -> BigInt {
        match &self.0 {
            Small(n, d) => (n / d).into(),
            Big(value) => value.to_integer(),
        }
    }

    /// The number where it is an integer of this size.
    pub(crate) fn to_i64(&self) -> Option<i64> {
        self.small().and_then(|(n, d)| (d == 1).then_some(n))
    }

    /// The nearest integer, halves away from zero.
    #[must_use]
    pub fn round(&self) -> Self {
        Self::from_big(self.to_big().round())
    }

    /// Numerator and denominator where both are small.
    pub(crate) fn small(&self) -> Option<(i64, i64)> {
        match self.0 {
            Small(n, d) => Some((n, d)),
            Big(_) => None,
        }
    }

    fn to_big(&self) -> BigRational {
        match &self.0 {
            Small(n, d) => BigRational::new_raw((*n).into(), (*d).into()),
            Big(value) => (**value).clone(),
        }
    }

    fn from_big(value: BigRational) -> Self {
        match (value.numer().to_i64(), value.denom().to_i64()) {
            // The least number has no negative.
            (Some(n), Some(d)) if n != i64::MIN => Rational(Small(n, d)),
            _ => Rational(Big(Box::new(value))),
        }
    }

    /// `n / d` for `d` not zero and `|n|` and `|d|` below `2^127`.
    fn reduced(n: i128, d: i128) -> Self {
        let (n, d) = if d < 0 { (-n, -d) } else { (n, d) };
        let divisor = if d == 1 { 1 } else { gcd(n.unsigned_abs(), d.unsigned_abs()) };
        // Division of this width is slow, and seldom needed.
        let (n, d) = match i128::try_from(divisor) {
            Ok(divisor) if divisor != 1 => (n / divisor, d / divisor),
            _ => (n, d),
        };
        match (i64::try_from(n), i64::try_from(d)) {
            (Ok(small), Ok(d)) if small != i64::MIN => Rational(Small(small, d)),
            _ => Rational(Big(Box::new(BigRational::new_raw(n.into(), d.into())))),
        }
    }

    fn sum(&self, other: &Self) -> Self {
        match (&self.0, &other.0) {
            (&Small(a, b), &Small(c, d)) => {
                let [a, b, c, d] = [a, b, c, d].map(i128::from);
                if b == d { Self::reduced(a + c, b) } else { Self::reduced(a * d + c * b, b * d) }
            }
            _ => Self::from_big(self.to_big() + other.to_big()),
        }
    }

    fn product(&self, other: &Self) -> Self {
        match (&self.0, &other.0) {
            (&Small(a, b), &Small(c, d)) => {
                let [a, b, c, d] = [a, b, c, d].map(i128::from);
                Self::reduced(a * c, b * d)
            }
            _ => Self::from_big(self.to_big() * other.to_big()),
        }
    }

    fn quotient(&self, other: &Self) -> Self {
        match (&self.0, &other.0) {
            (_, Small(1, 1)) => self.clone(),
            (&Small(a, b), &Small(c, d)) if c != 0 => {
                let [a, b, c, d] = [a, b, c, d].map(i128::from);
                Self::reduced(a * d, b * c)
            }
            _ => Self::from_big(self.to_big() / other.to_big()),
        }
    }
}

/// The greatest common divisor; that of nothing and `b` is `b`.
fn gcd(mut a: u128, mut b: u128) -> u128 {
    while a != 0 {
        if let (Ok(x), Ok(y)) = (u64::try_from(a), u64::try_from(b)) {
            return num_integer::gcd(x, y).into();
        }
        (a, b) = (b % a, a);
    }
    b
}

impl From<i64> for Rational {
    fn from(value: i64) -> Self {
        Self::reduced(value.into(), 1)
    }
}

impl Default for Rational {
    fn default() -> Self {
        Self::zero()
    }
}

impl fmt::Debug for Rational {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, formatter)
    }
}

impl fmt::Display for Rational {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.to_big(), formatter)
    }
}

impl Ord for Rational {
    fn cmp(&self, other: &Self) -> Ordering {
        match (&self.0, &other.0) {
            (&Small(a, b), &Small(c, d)) => {
                (i128::from(a) * i128::from(d)).cmp(&(i128::from(c) * i128::from(b)))
            }
            _ => self.to_big().cmp(&other.to_big()),
        }
    }
}

impl PartialOrd for Rational {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Neg for &Rational {
    type Output = Rational;
    fn neg(self) -> Rational {
        match &self.0 {
            Small(n, d) => Rational(Small(-n, *d)),
            Big(value) => Rational::from_big(-(**value).clone()),
        }
    }
}

impl Neg for Rational {
    type Output = Rational;
    fn neg(self) -> Rational {
        -&self
    }
}

/// The operator for values and references alike.
macro_rules! operator {
    ($operator:ident $function:ident, $assign:ident $assigning:ident, $of:expr) => {
        impl $operator<&Rational> for &Rational {
            type Output = Rational;
            fn $function(self, other: &Rational) -> Rational {
                $of(self, other)
            }
        }
        impl $operator<Rational> for &Rational {
            type Output = Rational;
            fn $function(self, other: Rational) -> Rational {
                $of(self, &other)
            }
        }
        impl $operator<&Rational> for Rational {
            type Output = Rational;
            fn $function(self, other: &Rational) -> Rational {
                $of(&self, other)
            }
        }
        impl $operator for Rational {
            type Output = Rational;
            fn $function(self, other: Rational) -> Rational {
                $of(&self, &other)
            }
        }
        impl $assign<&Rational> for Rational {
            fn $assigning(&mut self, other: &Rational) {
                *self = $of(self, other);
            }
        }
        impl $assign for Rational {
            fn $assigning(&mut self, other: Rational) {
                *self = $of(self, &other);
            }
        }
    };
}

operator!(Add add, AddAssign add_assign, Rational::sum);
operator!(Sub sub, SubAssign sub_assign, |a: &Rational, b: &Rational| a.sum(&-b));
operator!(Mul mul, MulAssign mul_assign, Rational::product);
operator!(Div div, DivAssign div_assign, Rational::quotient);

impl Rem for Rational {
    type Output = Rational;
    fn rem(self, other: Rational) -> Rational {
        Self::from_big(self.to_big() % other.to_big())
    }
}

impl Zero for Rational {
    fn zero() -> Self {
        Rational(Small(0, 1))
    }
    fn is_zero(&self) -> bool {
        matches!(self.0, Small(0, _))
    }
}

impl One for Rational {
    fn one() -> Self {
        Rational(Small(1, 1))
    }
    fn is_one(&self) -> bool {
        self.0 == Small(1, 1)
    }
}

impl Num for Rational {
    type FromStrRadixErr = num_rational::ParseRatioError;
    fn from_str_radix(text: &str, radix: u32) -> Result<Self, Self::FromStrRadixErr> {
        BigRational::from_str_radix(text, radix).map(Self::from_big)
    }
}

impl Signed for Rational {
    fn abs(&self) -> Self {
        if self.is_negative() { -self } else { self.clone() }
    }
    fn abs_sub(&self, other: &Self) -> Self {
        if self <= other { Self::zero() } else { self - other }
    }
    fn signum(&self) -> Self {
        match self.cmp(&Self::zero()) {
            Ordering::Less => -Self::one(),
            Ordering::Equal => Self::zero(),
            Ordering::Greater => Self::one(),
        }
    }
    fn is_positive(&self) -> bool {
        match &self.0 {
            Small(n, _) => *n > 0,
            Big(value) => value.is_positive(),
        }
    }
    fn is_negative(&self) -> bool {
        match &self.0 {
            Small(n, _) => *n < 0,
            Big(value) => value.is_negative(),
        }
    }
}

impl Sum for Rational {
    fn sum<I: Iterator<Item = Rational>>(terms: I) -> Rational {
        terms.fold(Self::zero(), |sum, term| sum + term)
    }
}

/// Powers, by those of big numbers.
macro_rules! power {
    ($($exponent:ty)*) => {$(
        impl Pow<$exponent> for &Rational {
            type Output = Rational;
            fn pow(self, exponent: $exponent) -> Rational {
                if exponent == 1 {
                    return self.clone();
                }
                Rational::from_big(Pow::pow(&self.to_big(), exponent))
            }
        }
        impl Pow<$exponent> for Rational {
            type Output = Rational;
            fn pow(self, exponent: $exponent) -> Rational {
                Pow::pow(&self, exponent)
            }
        }
    )*};
}

power!(i32 u32 u64 usize);

/// The double nearest to `value`, ties to even; infinite beyond the range of doubles.
#[must_use]
pub fn nearest_f64(value: &Rational) -> f64 {
    if value.is_zero() {
        return 0.0;
    }
    // Of two numbers that are doubles the machine's quotient is the nearest.
    const EXACT: i64 = 1 << 53;
    if let Some((n, d)) = value.small().filter(|(n, d)| n.abs() <= EXACT && *d <= EXACT) {
        return n as f64 / d as f64;
    }
    let (numerator, denominator) = (value.numer(), value.denom());
    let (numerator, denominator) = (numerator.magnitude(), denominator.magnitude());
    // Scale so that the quotient has 64 or 65 bits, then round once; `sticky` keeps what the division drops.
    let shift = 64 - (numerator.bits() as i64 - denominator.bits() as i64);
    let (scaled, divisor) = if shift >= 0 {
        (numerator << shift as u64, denominator.clone())
    } else {
        (numerator.clone(), denominator << (-shift) as u64)
    };
    let quotient = &scaled / &divisor;
    let sticky = !(&scaled % &divisor).is_zero();
    let magnitude = round_scaled(&quotient, sticky, -shift);
    if value.is_negative() { -magnitude } else { magnitude }
}

/// `(quotient + something in (0, 1) if sticky) * 2^exponent`, rounded to nearest even.
fn round_scaled(quotient: &BigUint, sticky: bool, exponent: i64) -> f64 {
    let bits = quotient.bits() as i64;
    // The weight of the last kept bit: 53 bits, fewer for subnormal results.
    let drop = (bits - 53).max(-1074 - exponent);
    if drop > bits {
        return 0.0;
    }
    let kept = quotient >> drop as u64;
    let rest = quotient - (&kept << drop as u64);
    let half = BigUint::from(1_u8) << (drop - 1) as u64;
    let odd = kept.bit(0);
    let up = rest > half || (rest == half && (sticky || odd));
    let mantissa = kept + u8::from(up);
    let mut result = mantissa.to_f64().unwrap_or(f64::INFINITY);
    // Two steps, since 2^e itself may underflow where the product does not.
    let mut e = exponent + drop;
    while e != 0 {
        let step = e.clamp(-1000, 1000);
        result *= 2_f64.powi(step as i32);
        e -= step;
    }
    result
}

/// The exact root of degree `n` of a non-negative rational, where it is rational.
pub(crate) fn exact_root(value: &Rational, n: u32) -> Option<Rational> {
    if value.is_negative() || n == 0 {
        return None;
    }
    let root = |x: &BigInt| {
        let r = x.nth_root(n);
        (num_traits::pow(r.clone(), n as usize) == *x).then_some(r)
    };
    Some(Rational::new(root(&value.numer())?, root(&value.denom())?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn tenth_and_extremes() {
        let q = |a: i64, b: i64| Rational::new(a.into(), b.into());
        assert_eq!(nearest_f64(&q(1, 10)), 0.1);
        assert_eq!(nearest_f64(&q(-1, 3)), -1.0 / 3.0);
        let tiny = Rational::new(1.into(), num_traits::pow(BigInt::from(2), 1074));
        assert_eq!(nearest_f64(&tiny), f64::from_bits(1));
        assert_eq!(nearest_f64(&(&tiny / Rational::from_integer(2.into()))), 0.0);
        // More than half of the smallest double.
        assert_eq!(nearest_f64(&(&tiny * q(3, 4))), f64::from_bits(1));
        assert_eq!(nearest_f64(&(tiny * q(1, 4))), 0.0);
        assert_eq!(format!("{:?} {:?}", q(-1, 3), q(4, 2)), "-1/3 2");
        let huge = Rational::from_integer(num_traits::pow(BigInt::from(10), 400));
        assert_eq!(nearest_f64(&huge), f64::INFINITY);
        assert_eq!(exact_root(&q(4, 9), 2), Some(q(2, 3)));
        assert_eq!(exact_root(&q(2, 9), 2), None);
    }

    #[test]
    fn division_by_zero_panics() {
        let divided = |n: i64| std::panic::catch_unwind(|| Rational::new(n.into(), 0.into()));
        let quotient = |n: i64| {
            std::panic::catch_unwind(|| Rational::from_integer(n.into()) / Rational::zero())
        };
        for n in [0, 1, -7, i64::MIN] {
            assert!(divided(n).is_err() && quotient(n).is_err(), "{n}/0");
        }
    }

    /// Numerators and denominators on both sides of what is small.
    fn parts() -> impl Strategy<Value = (BigInt, BigInt)> {
        let any = prop_oneof![
            any::<i8>().prop_map(i128::from),
            any::<i64>().prop_map(i128::from),
            (-3_i128..4).prop_map(|n| i128::from(i64::MAX) + n),
            (-3_i128..4).prop_map(|n| i128::from(i64::MIN) + n),
            any::<i128>(),
        ]
        .prop_map(BigInt::from)
        .boxed();
        (any.clone(), any.prop_filter("a denominator", |d| !d.is_zero()))
    }

    /// A double over an integer that may be none, or the other way round.
    fn quotient() -> impl Strategy<Value = (BigInt, BigInt)> {
        (1..1_i64 << 53, 1..i64::MAX, any::<bool>()).prop_map(|(double, integer, turned)| {
            let (a, b) = if turned { (integer, double) } else { (double, integer) };
            (a.into(), b.into())
        })
    }

    proptest! {
        #[test]
        fn arithmetic_is_that_of_big_numbers(a in parts(), b in parts()) {
            let (p, q) = (Rational::new(a.0.clone(), a.1.clone()), Rational::new(b.0.clone(), b.1.clone()));
            let (r, s) = (BigRational::new(a.0, a.1), BigRational::new(b.0, b.1));
            // Equality of the handles: every number has one form.
            prop_assert_eq!(&p + &q, Rational::from_big(&r + &s));
            prop_assert_eq!(&p - &q, Rational::from_big(&r - &s));
            prop_assert_eq!(&p * &q, Rational::from_big(&r * &s));
            prop_assert_eq!(-&p, Rational::from_big(-&r));
            prop_assert_eq!(p.abs(), Rational::from_big(r.abs()));
            prop_assert_eq!(p.cmp(&q), r.cmp(&s));
            prop_assert_eq!(p.is_negative(), r.is_negative());
            prop_assert_eq!(p.is_positive(), r.is_positive());
            prop_assert_eq!(p.is_integer(), r.is_integer());
            prop_assert_eq!(p.to_integer(), r.to_integer());
            prop_assert_eq!(p.bits(), (r.numer().bits(), r.denom().bits()));
            prop_assert_eq!((p.numer(), p.denom()), (r.numer().clone(), r.denom().clone()));
            prop_assert_eq!(Pow::pow(&p, 3_u32), Rational::from_big(Pow::pow(&r, 3_u32)));
            prop_assert_eq!(p.signum(), Rational::from_big(r.signum()));
            prop_assert_eq!(p.abs_sub(&q), Rational::from_big(r.abs_sub(&s)));
            prop_assert_eq!(p.round(), Rational::from_big(r.round()));
            prop_assert_eq!([p.clone(), q.clone()].into_iter().sum::<Rational>(), &p + &q);
            prop_assert_eq!(p.to_string(), r.to_string());
            let text = format!("{}/{}", r.numer(), r.denom());
            prop_assert_eq!(Rational::from_str_radix(&text, 10).unwrap(), p.clone());
            if !q.is_zero() {
                prop_assert_eq!(&p / &q, Rational::from_big(&r / &s));
                prop_assert_eq!(p % q, Rational::from_big(r % s));
            }
        }

        #[test]
        fn every_double_returns_to_itself(x in proptest::num::f64::NORMAL | proptest::num::f64::SUBNORMAL) {
            let exact = Rational::from_float(x).unwrap();
            prop_assert_eq!(nearest_f64(&exact), x);
        }

        #[test]
        fn quotients_of_integers_round_as_division_does(a in -(1_i64 << 53)..(1_i64 << 53), b in 1_i64..(1_i64 << 53)) {
            prop_assert_eq!(nearest_f64(&Rational::new(a.into(), b.into())), a as f64 / b as f64);
        }

        /// Between two doubles the even one is the nearest, and a little to either side of the middle the one there.
        #[test]
        fn the_middle_of_two_doubles_divides_what_rounds_to_them(
            n in (1_i64 << 52)..(1 << 53) - 1, scale in -1000..900_i32, little in 1..400_u32,
        ) {
            let double = |n: i64| n as f64 * 2_f64.powi(scale / 2) * 2_f64.powi(scale - scale / 2);
            let exact = |x: f64| BigRational::from_float(x).unwrap();
            let two = BigRational::from_integer(2.into());
            let middle = (exact(double(n)) + exact(double(n + 1))) / &two;
            let apart = &middle / Pow::pow(two, 53 + little);
            let nearest = |x: BigRational| nearest_f64(&Rational::from_big(x));
            prop_assert_eq!(nearest(&middle - &apart), double(n));
            prop_assert_eq!(nearest(middle.clone()), double(n + n % 2));
            prop_assert_eq!(nearest(&middle + &apart), double(n + 1));
            prop_assert_eq!(nearest(-middle - apart), -double(n + 1));
        }

        /// Integers that are no doubles among them, of which the machine's quotient is rounded twice, and scales from
        /// below the smallest double on.
        #[test]
        fn no_double_is_nearer(parts in prop_oneof![parts(), quotient()], scale in prop_oneof![Just(0), -1150..850, -1100..-1000]) {
            let power: BigRational = Pow::pow(BigRational::from_integer(2.into()), scale);
            let value = BigRational::new(parts.0, parts.1) * power;
            let nearest = nearest_f64(&Rational::from_big(value.clone()));
            let distance = |x: f64| (BigRational::from_float(x).unwrap() - &value).abs();
            for other in [nearest.next_up(), nearest.next_down()] {
                match distance(nearest).cmp(&distance(other)) {
                    Ordering::Less => {}
                    Ordering::Equal => prop_assert!(nearest.to_bits().is_multiple_of(2), "{value} is a tie"),
                    Ordering::Greater => prop_assert!(false, "{value} is nearer to {other} than to {nearest}"),
                }
            }
        }
    }
}
