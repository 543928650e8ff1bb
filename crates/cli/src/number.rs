//! Numbers as people read them.

/// Magnitudes that are written out; smaller and larger ones have an exponent.
const WRITTEN_OUT: std::ops::Range<f64> = 1e-4..1e7;

/// As many digits as tell the number from its neighbours: `0.4`, `10000`, `1e-300`.
pub(crate) fn exact(value: f64) -> String {
    if value == 0.0 || WRITTEN_OUT.contains(&value.abs()) || !value.is_finite() {
        format!("{value}")
    } else {
        format!("{value:e}")
    }
}

/// At most `digits` significant digits, without zeros at the end: `0.333`, `1.2e-7`.
pub(crate) fn rounded(value: f64, digits: usize) -> String {
    // By way of text, which rounds the decimal number and not its multiple.
    let text = format!("{value:.*e}", digits.saturating_sub(1));
    text.parse().map_or(text, exact)
}

/// A count and what is counted: `1 thread`, `2 threads`.
pub(crate) fn counted(count: usize, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}

/// A number of periods: `1 period`, `0.5 periods`.
pub(crate) fn of_periods(count: f64) -> String {
    if count == 1.0 { "1 period".into() } else { format!("{} periods", exact(count)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_far_from_one_have_an_exponent() {
        let told = [0.0, 0.4, 1e4, -2.5, 1e-4, 123456.7].map(exact);
        assert_eq!(told, ["0", "0.4", "10000", "-2.5", "0.0001", "123456.7"]);
        let told = [1e-300, -9.9e-5, 1e7, 1.5e160, f64::MAX, 5e-324].map(exact);
        let expected = ["1e-300", "-9.9e-5", "1e7", "1.5e160", "1.7976931348623157e308", "5e-324"];
        assert_eq!(told, expected);
        assert_eq!([f64::NAN, f64::INFINITY].map(exact), ["NaN", "inf"]);
    }

    #[test]
    fn rounding_keeps_significant_digits() {
        let told = [1.0 / 3.0, 0.1 + 0.2, 1234.56, 9.999e-5, -0.0].map(|x| rounded(x, 3));
        assert_eq!(told, ["0.333", "0.3", "1230", "0.0001", "-0"]);
        assert_eq!([1.25e-7, 4.0, f64::NAN].map(|x| rounded(x, 2)), ["1.2e-7", "4", "NaN"]);
    }
}
