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
pub(crate) use particles::{Particles, extremes};
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

/// Multiples of a power of ten, of its double or fivefold, from `low` to `high`, which divide that into at most `most` parts.
fn round_values(low: f64, high: f64, most: f64) -> Vec<f64> {
    let width = high - low;
    if !(width > 0.0 && width.is_finite()) {
        return Vec::new();
    }
    let power = width.log10().floor() as i32 - 1;
    let step = (power..power + 4)
        .flat_map(|power| [1, 2, 5].map(|multiple| (multiple, power)))
        .map(|(multiple, power)| (multiple, power, value(multiple, power)))
        .find(|(_, _, unit)| width / unit <= most);
    let Some((multiple, power, unit)) = step else { return Vec::new() };
    let (first, last) = ((low / unit).ceil() as i64, (high / unit).floor() as i64);
    (first..=last).map(|n| value(n.saturating_mul(multiple), power)).collect()
}

/// `count` times ten to `power`, by way of text, so that three times a tenth is 0.3.
fn value(count: i64, power: i32) -> f64 {
    format!("{count}e{power}").parse().unwrap_or(f64::NAN)
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

/// Pictures of the usual width side by side on one card, which is light on dark pages too; the first lines of their frames
/// are level.
pub(crate) fn beside(title: &str, description: &str, height: f64, pictures: &[String]) -> String {
    const ROOM: f64 = 14.0;
    let count = pictures.len() as f64;
    let (width, tall) = (count * plot::WIDTH + (count + 1.0) * ROOM, height + 2.0 * ROOM);
    let (title, description) = (escape(title), escape(description));
    let mut text = format!(
        r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {tall}" width="{width}" height="{tall}" role="img">
<title>{title}</title>
<desc>{description}</desc>
<rect x="0.5" y="0.5" width="{}" height="{}" rx="10" fill="#fff" stroke="#ccc"/>
"##,
        width - 1.0,
        tall - 1.0
    );
    for (index, picture) in pictures.iter().enumerate() {
        let x = ROOM + index as f64 * (plot::WIDTH + ROOM);
        // A picture keeps its own coordinates in a place of its own.
        text += &format!(
            "<svg x=\"{x}\" y=\"{ROOM}\" width=\"{}\" height=\"{height}\" preserveAspectRatio=\"xMidYMin\"{}",
            plot::WIDTH,
            picture.strip_prefix("<svg").unwrap_or(picture)
        );
    }
    text + "</svg>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_side_by_side_do_not_overlap() {
        let picture = open("plot", 480.0, 300.0, "a", "b") + "</svg>\n";
        let text = beside("t <", "d", 300.0, &[picture.clone(), picture]);
        assert!(
            text.contains("viewBox=\"0 0 1002 328\"") && text.contains("<title>t &lt;</title>")
        );
        assert!(text.contains("<svg x=\"14\" y=\"14\" width=\"480\" height=\"300\""), "{text}");
        assert!(text.contains("<svg x=\"508\" y=\"14\" width=\"480\" height=\"300\""), "{text}");
        assert_eq!((text.matches("<svg").count(), text.matches("</svg>").count()), (3, 3));
    }

    #[test]
    fn round_values_lie_within_their_ends() {
        assert_eq!(round_values(0.0, 10.0, 8.0), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
        assert_eq!(round_values(-0.11, 0.31, 8.0), [-0.1, 0.0, 0.1, 0.2, 0.3]);
        assert_eq!(round_values(-4e-6, 5e-7, 8.0), [-4e-6, -3e-6, -2e-6, -1e-6, 0.0]);
        assert_eq!(round_values(0.0, 1.0, 8.0), [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]);
        assert_eq!(round_values(-0.55, 1.05, 6.0), [-0.5, 0.0, 0.5, 1.0]);
        for (low, high) in [(1.0, 1.0), (0.0, f64::INFINITY), (f64::NAN, 1.0)] {
            assert!(round_values(low, high, 8.0).is_empty(), "{low} to {high}");
        }
        // Too far from zero for any step between them.
        assert!(round_values(1e18, 1e18 + 256.0, 8.0).iter().all(|tick| tick.is_finite()));
    }

    #[test]
    fn numbers_read_well_and_text_cannot_leave_its_place() {
        let told = [0.0, 0.25, 40.0, 1e-3, 2e-3, 5e-12, 1e7, -3.5e-4, -1e-3].map(number);
        let expected =
            ["0", "0.25", "40", "10⁻³", "2·10⁻³", "5·10⁻¹²", "10⁷", "-3.5·10⁻⁴", "-10⁻³"];
        assert_eq!(told, expected);
        assert_eq!(escape("a<b & \"c\">"), "a&lt;b &amp; &quot;c&quot;&gt;");
    }
}
