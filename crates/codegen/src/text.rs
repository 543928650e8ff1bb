//! Text from specifications, made harmless, and pieces of code joined.

use mmsmith_expr::{Operation, Slot};
use std::fmt::Write;

/// One line without control characters, for string literals.
pub(crate) fn one_line(text: &str) -> String {
    let words: Vec<&str> = text.split_whitespace().collect();
    words.join(" ").chars().filter(|c| !c.is_control()).collect()
}

/// A string of Fortran in pieces that fit into lines.
pub(crate) fn fortran_string(text: &str) -> String {
    let safe = |c| if (' '..='~').contains(&c) && c != '\\' { c } else { '_' };
    let safe: Vec<char> = one_line(text).chars().take(500).map(safe).collect();
    if safe.is_empty() {
        return "\"\"".into();
    }
    let pieces = safe
        .chunks(50)
        .map(|piece| format!("\"{}\"", String::from_iter(piece).replace('"', "\"\"")));
    pieces.collect::<Vec<_>>().join(" // &\n            ")
}

/// A string of Julia literal; a dollar sign would interpolate.
pub(crate) fn julia_string(text: &str) -> String {
    let mut literal = String::from("\"");
    for c in one_line(text).chars() {
        match c {
            '"' | '\\' | '$' => literal.extend(['\\', c]),
            ' '..='~' => literal.push(c),
            _ => literal += &format!("\\U{:08x}", u32::from(c)),
        }
    }
    literal + "\""
}

/// Meaning and values of a parameter: the description or the name, the unit, the range.
pub(crate) fn meaning(name: &str, description: &str, unit: &str, range: &str) -> String {
    let mut text = one_line(if description.is_empty() { name } else { description });
    if !unit.is_empty() {
        text += &format!(", in {}", one_line(unit));
    }
    if !range.is_empty() {
        text += &format!("; must be {}", one_line(range));
    }
    text
}

/// Writes `template` with an operand of the operation in place of each `#`, in their order.
pub(crate) fn spell(
    text: &mut String,
    template: &str,
    operation: &Operation,
    mut operand: impl FnMut(&mut String, Slot),
) {
    let mut operands = operation.operands();
    for (index, piece) in template.split('#').enumerate() {
        if index > 0
            && let Some(slot) = operands.next()
        {
            operand(text, slot);
        }
        text.push_str(piece);
    }
}

/// `template` with a part in place of each `#`.
pub(crate) fn with(template: &str, parts: impl IntoIterator<Item = impl AsRef<str>>) -> String {
    let mut pieces = template.split('#');
    let mut text = pieces.next().unwrap_or_default().to_owned();
    for (piece, part) in pieces.zip(parts) {
        text.extend([part.as_ref(), piece]);
    }
    text
}

/// `template` with each name between two signs `@` replaced by `place(name)`.
pub(crate) fn filled(template: &str, place: impl Fn(&str) -> String) -> String {
    let pieces = template.split('@').enumerate();
    let text = |(index, piece): (usize, &str)| match index % 2 {
        0 => piece.to_owned(),
        _ => place(piece),
    };
    pieces.map(text).collect()
}

/// Writes an index in decimal digits.
pub(crate) fn push_index(text: &mut String, index: usize) {
    // Writing to a string does not fail.
    let _ = write!(text, "{index}");
}

/// The most characters of a text in C's comments.
const LONGEST: usize = 2_000;
/// The most characters of a text in C's messages: every compiler accepts as many, even when each is an escape of four characters.
const LONGEST_MESSAGE: usize = 500;

fn shortened(text: &str, longest: usize) -> String {
    let mut characters = text.chars();
    let kept: String = characters.by_ref().take(longest).collect();
    if characters.next().is_some() { kept + "..." } else { kept }
}

/// Text for a C block comment: one line that neither ends the comment nor opens another, nor joins lines.
pub(crate) fn comment(text: &str) -> String {
    let mut safe = String::new();
    for c in shortened(&one_line(text), LONGEST).chars() {
        let c = match c {
            // A backslash at the end of a line would join the next line.
            '\\' => '_',
            // Letters of any alphabet stay. Other characters, such as invisible marks and spaces, do not.
            c if !c.is_ascii() && !c.is_alphanumeric() => '_',
            c => c,
        };
        // The end of a comment, the start of one, and trigraphs.
        if matches!(
            (safe.chars().last(), c),
            (Some('*'), '/') | (Some('/'), '*') | (Some('?'), '?')
        ) {
            safe.push(' ');
        }
        safe.push(c);
    }
    safe
}

/// The shortest digits that read back as the same double, in a form that both Rust and C take for floating point.
pub(crate) fn digits(magnitude: f64) -> String {
    // The plain notation of very large and very small numbers has hundreds of digits.
    let text = if magnitude != 0.0 && !(1e-5..1e16).contains(&magnitude) {
        format!("{magnitude:e}")
    } else {
        format!("{magnitude:?}")
    };
    if text.contains(['.', 'e']) { text } else { format!("{text}.0") }
}

/// A double in C; negative numbers begin with a minus sign.
pub(crate) fn c_number(value: f64) -> String {
    let sign = if value.is_sign_negative() { "-" } else { "" };
    let size = if value.is_infinite() { "HUGE_VAL".into() } else { digits(value.abs()) };
    format!("{sign}{size}")
}

/// A C string literal.
pub(crate) fn c_string(text: &str) -> String {
    let mut literal = String::from("\"");
    for byte in shortened(&one_line(text), LONGEST_MESSAGE).bytes() {
        match byte {
            // A question mark may start a trigraph.
            b'"' | b'\\' | b'?' => literal.extend(['\\', char::from(byte)]),
            b' '..=b'~' => literal.push(char::from(byte)),
            // Always three digits, so that a digit behind them is not read as a part of the escape.
            _ => literal += &format!("\\{byte:03o}"),
        }
    }
    literal + "\""
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn comments_stay_open() {
        assert_eq!(comment("a*/b/*c"), "a* /b/ *c");
        assert_eq!(comment("**//**/"), "** // ** /");
        assert_eq!(comment("*??/\n/"), "*? ?/ /");
        assert_eq!(comment("*\\\n/ x\\"), "*_ / x_");
        assert_eq!(comment("https://example.org"), "https://example.org");
        // Letters stay; what nobody sees, and signs, do not.
        assert_eq!(
            comment("caf\u{e9} \u{3bb}0 e\u{301} \u{200b} \u{2264}"),
            "caf\u{e9} \u{3bb}0 e_ _ _"
        );
    }

    #[test]
    fn literals_stay_closed() {
        assert_eq!(c_string("a\"b\\"), r#""a\"b\\""#);
        assert_eq!(c_string("??/\" é7"), r#""\?\?/\" \303\2517""#);
    }

    proptest! {
        #[test]
        fn no_text_ends_a_comment_or_a_literal(text in r#"([*/?\\"\n\r =()<>%:]|\PC){0,40}"#) {
            let comment = comment(&text);
            for sign in ["*/", "/*", "??", "\\", "\n", "\r"] {
                prop_assert!(!comment.contains(sign), "{comment:?}");
            }
            let literal = c_string(&text);
            let inner = &literal[1..literal.len() - 1];
            prop_assert!(inner.is_ascii() && !inner.contains("??") && !inner.contains('\n'));
            // Every quotation mark is escaped, and the last backslash escapes something.
            let mut characters = inner.chars();
            while let Some(c) = characters.next() {
                prop_assert!(c != '"');
                if c == '\\' {
                    prop_assert!(characters.next().is_some());
                }
            }
        }
    }
}
