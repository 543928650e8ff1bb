//! Measured times in prose, which only a command may write.

/// Units of time and of rates; words after them belong to the sentence.
const UNITS: [&str; 17] = [
    "s",
    "ms",
    "us",
    "µs",
    "ns",
    "min",
    "M/s",
    "GB/s",
    "MB/s",
    "GFLOP/s",
    "second",
    "seconds",
    "minute",
    "minutes",
    "hour",
    "hours",
    "particle-steps/s",
];

/// Numbers that are spelt out.
const WORDS: [&str; 12] = [
    "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "half a",
    "a few",
];

/// The first timing in a line of prose: a number followed by a unit of time or of a rate, a comparison of speeds, or a
/// number of particle-steps a second.
pub(crate) fn timing(prose: &str) -> Option<String> {
    let words: Vec<&str> = prose
        .split(|c: char| c.is_whitespace() || matches!(c, '|' | '(' | ')' | '*' | ';' | '~'))
        .map(|word| word.trim_matches([',', '.', ':', '?', '!', '"', '\'']))
        .filter(|word| !word.is_empty())
        .collect();
    for (i, word) in words.iter().enumerate() {
        let following = words.get(i + 1).copied().unwrap_or("");
        let rest = words[i..].iter().take(6).copied().collect::<Vec<_>>().join(" ");
        if let Some(unit) = after_number(word) {
            let is_rate = |text: &str| {
                text.contains("particle-step")
                    || text.contains("times as fast")
                    || text.contains("times faster")
            };
            if UNITS.contains(&unit)
                || (unit.is_empty() && (UNITS.contains(&following) || is_rate(&rest)))
            {
                return Some(words[i..].iter().take(2).copied().collect::<Vec<_>>().join(" "));
            }
            let percent = unit == "%" || (unit.is_empty() && following == "%");
            if percent
                && ["faster", "slower", "less time", "more time"]
                    .iter()
                    .any(|end| rest.contains(end))
            {
                return Some(rest);
            }
        }
        let spelt = WORDS.iter().any(|number| number.eq_ignore_ascii_case(word));
        if spelt && UNITS.iter().any(|unit| unit.len() > 5 && *unit == following) {
            return Some(format!("{word} {following}"));
        }
    }
    None
}

/// The rest of a word that begins with a number.
fn after_number(word: &str) -> Option<&str> {
    let is_number = |c: char| c.is_ascii_digit() || matches!(c, '.' | ',');
    let end = word.find(|c| !is_number(c)).unwrap_or(word.len());
    if !word.starts_with(|c: char| c.is_ascii_digit()) {
        return None;
    }
    let rest = &word[end..];
    // The exponent of 3.3e-2.
    let exponent = rest.strip_prefix(['e', 'E']).map(|rest| rest.trim_start_matches(['+', '-']));
    match exponent {
        Some(digits) if digits.starts_with(|c: char| c.is_ascii_digit()) => {
            Some(digits.trim_start_matches(|c: char| c.is_ascii_digit()))
        }
        _ => Some(rest),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measured_times_and_rates_are_found() {
        for line in [
            "It takes 0.09 s for all.",
            "each took 118s, twice",
            "| ring | 2.9 ms |",
            "30 to 36 million particle-steps a second",
            "3.2e7 particle-steps/s",
            "about 40 GB/s",
            "it is 2.4 times as fast",
            "7 % slower than before",
            "Add a solution in five minutes",
            "1e-8 takes 3.3e-2 s with degree 5",
        ] {
            assert!(timing(line).is_some(), "{line}");
        }
    }

    #[test]
    fn other_numbers_are_not() {
        for line in [
            "u is 0.1 m, v is 3 m/s",
            "order 2 so far",
            "16 cells, 2 particles",
            "at step 12 stress",
            "1e4 Pa and 1 kg/m^3",
            "the ring-16 case",
            "digits to 40",
            "a tenth of it: 10 % less error",
            "second order on 3 grids",
        ] {
            assert_eq!(timing(line), None, "{line}");
        }
    }
}
