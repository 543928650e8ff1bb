//! Exact rationals to binary floating point of any precision, and back.

use astro_float_num::{BigFloat, RoundingMode, Sign, Word};
use mmsmith_expr::Rational;
use num_bigint::{BigInt, BigUint};
use num_traits::Zero;

/// Numbers beyond `2^LARGEST_EXPONENT`, or below its inverse, are out of range: as rationals they would be huge.
pub(crate) const LARGEST_EXPONENT: i32 = 1 << 16;

/// The exact value of a finite double; `None` for infinities and not-a-number.
#[must_use]
pub fn exact(value: f64) -> Option<Rational> {
    Rational::from_float(value)
}

/// `value`, rounded to `bits`.
pub(crate) fn to_float(value: &Rational, bits: usize) -> BigFloat {
    let numerator = integer(&value.numer());
    let denominator = integer(&value.denom());
    numerator.div(&denominator, bits, RoundingMode::ToEven)
}

/// An integer in as many bits as it needs.
fn integer(value: &BigInt) -> BigFloat {
    let digits_a_word = Word::BITS as usize / 32;
    let digits = value.magnitude().to_u32_digits();
    let words: Vec<Word> = digits
        .chunks(digits_a_word)
        .map(|chunk| {
            chunk
                .iter()
                .enumerate()
                .fold(0, |word: Word, (i, &digit)| word | Word::from(digit) << (32 * i))
        })
        .collect();
    if words.is_empty() {
        return BigFloat::new(Word::BITS as usize);
    }
    let sign = if value.sign() == num_bigint::Sign::Minus { Sign::Neg } else { Sign::Pos };
    // A mantissa is a fraction: the binary point stands before its first bit.
    BigFloat::from_words(&words, sign, (words.len() * Word::BITS as usize) as i32)
}

/// The exact value; `None` where it is not a number, infinite or out of range.
pub(crate) fn to_rational(value: &BigFloat) -> Option<Rational> {
    if value.is_zero() {
        return Some(Rational::zero());
    }
    let (words, _, sign, exponent, _) = value.as_raw_parts()?;
    if exponent.unsigned_abs() > LARGEST_EXPONENT.unsigned_abs() {
        return None;
    }
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let magnitude = BigUint::from_bytes_le(&bytes);
    let sign = if sign == Sign::Neg { num_bigint::Sign::Minus } else { num_bigint::Sign::Plus };
    let mantissa = BigInt::from_biguint(sign, magnitude);
    let shift = i64::from(exponent) - (bytes.len() * 8) as i64;
    let power = BigInt::from(1) << shift.unsigned_abs();
    Some(if shift >= 0 {
        Rational::from_integer(mantissa * power)
    } else {
        Rational::new(mantissa, power)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn extremes() {
        for value in [0.0, f64::from_bits(1), -f64::MAX, 1.0, -0.1] {
            let rational = exact(value).unwrap();
            assert_eq!(to_rational(&to_float(&rational, 128)), Some(rational));
        }
        assert_eq!(exact(f64::NAN), None);
        let third = Rational::new(1.into(), 3.into());
        let near = to_rational(&to_float(&third, 128)).unwrap();
        let error = Rational::new(1.into(), BigInt::from(1) << 129_u32);
        assert!(near != third && (&near - &third) < error && (third - near) < error);
    }

    proptest! {
        #[test]
        fn doubles_return(x in proptest::num::f64::NORMAL | proptest::num::f64::SUBNORMAL) {
            let rational = exact(x).unwrap();
            prop_assert_eq!(to_rational(&to_float(&rational, 64)), Some(rational));
        }
    }
}
