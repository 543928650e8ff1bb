//! Exact rationals as decimal text.

use mmsmith_expr::Rational;
use num_bigint::BigInt;
use num_traits::{Pow, Signed, Zero};

/// `value` with `digits` significant digits, as in `-3.349e-3`; zero is `0`.
#[must_use]
pub fn scientific(value: &Rational, digits: usize) -> String {
    if value.is_zero() {
        return "0".into();
    }
    let digits = digits.max(1);
    let bits = value.bits().0 as f64 - value.bits().1 as f64;
    // One too small at worst by this estimate; the loop mends it.
    let mut exponent = (bits * std::f64::consts::LOG10_2).floor() as i64 - 1;
    let ten = Rational::from_integer(10.into());
    loop {
        let scale = digits as i64 - 1 - exponent;
        let power = Pow::pow(&ten, scale.unsigned_abs());
        let scaled = if scale >= 0 { value.abs() * power } else { value.abs() / power };
        let rounded: BigInt = scaled.round().to_integer();
        let text = rounded.to_string();
        if text.len() > digits {
            exponent += (text.len() - digits) as i64;
            continue;
        }
        let sign = if value.is_negative() { "-" } else { "" };
        let (first, rest) = text.split_at(1);
        let point = if rest.is_empty() { "" } else { "." };
        let power = if exponent == 0 { String::new() } else { format!("e{exponent}") };
        return format!("{sign}{first}{point}{rest}{power}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_and_carries() {
        let q = |a: i64, b: i64| Rational::new(a.into(), b.into());
        assert_eq!(scientific(&q(-1, 3), 4), "-3.333e-1");
        assert_eq!(scientific(&q(99_996, 10), 4), "1.000e4");
        assert_eq!(scientific(&q(2, 1), 1), "2");
        assert_eq!(scientific(&q(0, 1), 9), "0");
        assert_eq!(scientific(&Rational::from_float(5e-324).unwrap(), 3), "4.94e-324");
        assert_eq!(scientific(&q(123_456, 1), 3), "1.23e5");
    }
}
