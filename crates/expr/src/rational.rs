//! Exact rational numbers, and their rounding to floating point.

use num_bigint::{BigInt, BigUint};
use num_rational::BigRational;
use num_traits::{Signed, ToPrimitive, Zero};

/// An exact rational number of any size.
pub type Rational = BigRational;

/// The double nearest to `value`, ties to even; infinite beyond the range of doubles.
#[must_use]
pub fn nearest_f64(value: &Rational) -> f64 {
    if value.is_zero() {
        return 0.0;
    }
    let (numerator, denominator) = (value.numer().magnitude(), value.denom().magnitude());
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
        if result == 0.0 || result.is_infinite() {
            break;
        }
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
    Some(Rational::new(root(value.numer())?, root(value.denom())?))
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
        assert_eq!(nearest_f64(&(tiny / BigInt::from(2))), 0.0);
        let huge = Rational::from_integer(num_traits::pow(BigInt::from(10), 400));
        assert_eq!(nearest_f64(&huge), f64::INFINITY);
        assert_eq!(exact_root(&q(4, 9), 2), Some(q(2, 3)));
        assert_eq!(exact_root(&q(2, 9), 2), None);
    }

    proptest! {
        #[test]
        fn every_double_returns_to_itself(x in proptest::num::f64::NORMAL | proptest::num::f64::SUBNORMAL) {
            let exact = Rational::from_float(x).unwrap();
            prop_assert_eq!(nearest_f64(&exact), x);
        }

        #[test]
        fn quotients_of_integers_round_as_division_does(a in -(1_i64 << 53)..(1_i64 << 53), b in 1_i64..(1_i64 << 53)) {
            prop_assert_eq!(nearest_f64(&Rational::new(a.into(), b.into())), a as f64 / b as f64);
        }
    }
}
