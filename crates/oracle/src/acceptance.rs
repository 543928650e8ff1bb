//! The acceptance rule for double-precision results.

use mmsmith_expr::{Rational, nearest_f64};
use num_bigint::BigInt;
use num_traits::{Signed, Zero};

/// The smallest `K` for which `|result - exact| <= K 2^-53 (sens + |exact|)`.
///
/// `sens` is the exact value's [`Sensitivity`](crate::Sensitivity) to its inputs: `2^-53 sens` is the change that an
/// error of one rounding in each input makes, and `2^-53 |exact|` that of one rounding of the result. The bound is
/// taken as no smaller than `2^-1075`, half the distance between the smallest doubles. The result is computed
/// exactly and rounded once; it is infinite where `result` is not finite, unless it is the infinity that `exact`, beyond the largest
/// double, rounds to.
#[must_use]
pub fn worst_factor(result: f64, exact: &Rational, sens: &Rational) -> f64 {
    units(result, exact, &(sens + exact.abs()))
}

/// The error of `result` in units of `2^-53` of `size`, which is taken as no smaller than `2^-1022`; as exact as [`worst_factor`].
#[must_use]
pub fn units(result: f64, exact: &Rational, size: &Rational) -> f64 {
    let Some(result) = crate::exact(result) else {
        return if result == nearest_f64(exact) { 0.0 } else { f64::INFINITY };
    };
    let error = (result - exact).abs();
    if error.is_zero() {
        return 0.0;
    }
    let power = |n: u32| Rational::new(1.into(), BigInt::from(1) << n);
    let bound = (size * power(53)).max(power(1075));
    nearest_f64(&(error / bound))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roundings_are_counted() {
        let one = Rational::from_integer(1.into());
        let zero = Rational::zero();
        assert_eq!(worst_factor(1.0, &one, &zero), 0.0);
        assert_eq!(worst_factor(1.0 + f64::EPSILON, &one, &zero), 2.0);
        assert_eq!(worst_factor(1.0 + f64::EPSILON, &one, &one), 1.0);
        assert_eq!(worst_factor(f64::NAN, &one, &one), f64::INFINITY);
        assert_eq!(worst_factor(f64::INFINITY, &one, &one), f64::INFINITY);
        let huge = Rational::from_integer(BigInt::from(10).pow(309));
        assert_eq!(worst_factor(f64::INFINITY, &huge, &one), 0.0);
        assert_eq!(worst_factor(f64::NEG_INFINITY, &huge, &one), f64::INFINITY);
        assert_eq!(worst_factor(f64::from_bits(1), &zero, &zero), 2.0);
    }
}
