//! Irrational constants as rational numbers, to more digits than a double and what rounding takes from it can have.

use crate::Rational;
use num_bigint::BigInt;
use num_traits::{One, Signed, Zero};
use std::sync::LazyLock;

/// The circle number to 70 decimals.
pub(crate) static CIRCLE_NUMBER: LazyLock<Rational> = LazyLock::new(|| {
    let digits = b"31415926535897932384626433832795028841971693993751058209749445923078164";
    let ten = BigInt::from(10);
    let number =
        digits.iter().fold(BigInt::zero(), |n, digit| n * &ten + BigInt::from(digit - b'0'));
    Rational::new(number, num_traits::pow(ten, digits.len() - 1))
});

/// Binary places of a square root.
const PLACES: usize = 256;
/// Roots of numbers of more bits are not taken.
const MOST_BITS: u64 = 256;

/// The square root, to a relative error of some `2^-250` where the number is neither tiny nor huge; `None` where it is
/// negative or has many digits.
pub(crate) fn square_root(number: &Rational) -> Option<Rational> {
    let (numerator, denominator) = number.bits();
    if number.is_negative() || numerator.max(denominator) > MOST_BITS {
        return None;
    }
    // sqrt(n/d) = sqrt(n d)/d.
    let scaled = (number.numer() * number.denom()) << (2 * PLACES);
    Some(Rational::new(scaled.sqrt(), number.denom() * (BigInt::one() << PLACES)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nearest_f64;

    #[test]
    fn constants_have_digits_beyond_those_of_doubles() {
        let rest = &*CIRCLE_NUMBER - Rational::from_float(std::f64::consts::PI).unwrap();
        // The second of two doubles whose sum is the circle number.
        assert_eq!(nearest_f64(&rest), 1.224_646_799_147_353_2e-16);
        for (n, d) in [(2, 1), (3, 7), (0, 1), (4, 9), (1_000_000_007, 3)] {
            let number = Rational::new(n.into(), d.into());
            let root = square_root(&number).unwrap();
            let error = (&root * &root - &number).abs();
            assert!(nearest_f64(&error) <= 1e-70 * nearest_f64(&number), "{n}/{d}");
        }
        assert_eq!(square_root(&Rational::from(-1)), None);
        assert_eq!(square_root(&num_traits::pow(Rational::from(10), 100)), None);
    }
}
