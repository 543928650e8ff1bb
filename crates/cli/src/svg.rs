//! Pictures as SVG: error against step size, particles coloured by a value, limits of stability, error against cost, and
//! drift over time.
//!
//! Written here and not with a plotting library: these pictures tell screen readers what they show, scale with the
//! page, mark every curve by shape and fill, draw reference slopes and are the same to the byte on every machine.

mod drift;
mod front;
mod limits;
mod particles;
mod plot;

pub(crate) use drift::{Course, Drift};
pub(crate) use front::{Front, Point};
pub(crate) use limits::{Limits, Map};
pub(crate) use particles::Particles;
pub(crate) use plot::{Curve, Plot};

/// `text` inside an element or a quoted attribute.
pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// A number for people: `0.25`, `40`, `10⁻³`, `2·10⁻³`. Twelve digits: more come from arithmetic, not from what is meant.
pub(crate) fn number(value: f64) -> String {
    if value == 0.0 || (1e-2..1e4).contains(&value.abs()) {
        return crate::number::rounded(value, 12);
    }
    scientific(&format!("{value:e}"))
}

/// A number of few significant digits for people: `0.25`, `2.5·10⁻³`.
pub(crate) fn rounded(value: f64, digits: usize) -> String {
    if value == 0.0 || (1e-2..1e4).contains(&value.abs()) {
        return crate::number::rounded(value, digits);
    }
    scientific(&format!("{value:.*e}", digits.saturating_sub(1)))
}

/// Text such as `2.50e-3` as `2.5·10⁻³`.
fn scientific(text: &str) -> String {
    let (mantissa, exponent) = text.split_once('e').unwrap_or((text, "0"));
    let mantissa = match mantissa.split_once('.') {
        Some(_) => mantissa.trim_end_matches('0').trim_end_matches('.'),
        None => mantissa,
    };
    let raised: String = exponent
        .chars()
        .map(|digit| match digit {
            '-' => '⁻',
            '0' => '⁰',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            other => other.to_digit(10).and_then(|d| char::from_u32(0x2070 + d)).unwrap_or(other),
        })
        .collect();
    match mantissa {
        "1" => format!("10{raised}"),
        "-1" => format!("-10{raised}"),
        _ => format!("{mantissa}·10{raised}"),
    }
}

/// The start of a picture `width` by `height`, with what it shows in words.
fn open(class: &str, width: f64, height: f64, title: &str, description: &str) -> String {
    let (title, description) = (escape(title), escape(description));
    format!(
        r##"<svg xmlns="http://www.w3.org/2000/svg" class="{class}" viewBox="0 0 {width} {height}" role="img" aria-label="{title}: {description}" font-family="sans-serif" font-size="14" fill="#111">
<title>{title}</title>
<desc>{description}</desc>
<rect width="{width}" height="{height}" fill="#fff"/>
"##
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well_and_text_cannot_leave_its_place() {
        let told = [0.0, 0.25, 40.0, 1e-3, 2e-3, 5e-12, 1e7, -3.5e-4, -1e-3].map(number);
        let expected =
            ["0", "0.25", "40", "10⁻³", "2·10⁻³", "5·10⁻¹²", "10⁷", "-3.5·10⁻⁴", "-10⁻³"];
        assert_eq!(told, expected);
        assert_eq!(escape("a<b & \"c\">"), "a&lt;b &amp; &quot;c&quot;&gt;");
    }
}
