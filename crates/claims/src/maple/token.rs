//! Text to tokens.

use crate::maple::error::{ListingError, Problem};
use std::ops::Range;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Token {
    Number,
    Name,
    /// One of `+ - * / ( ) [ ] , ; =`.
    Sign(char),
    End,
}

/// A token and its place in the text.
pub(crate) type Placed = (Token, Range<usize>);

/// The tokens of `text`, comments left out, the last one [`Token::End`].
pub(crate) fn tokens(text: &str) -> Result<Vec<Placed>, ListingError> {
    let bytes = text.as_bytes();
    let mut tokens = Vec::new();
    let mut at = 0;
    while let Some(c) = text[at..].chars().next() {
        let start = at;
        let run = |from: usize, inside: fn(&u8) -> bool| {
            bytes[from..].iter().position(|b| !inside(b)).map_or(bytes.len(), |n| from + n)
        };
        if c.is_whitespace() {
            at += c.len_utf8();
        } else if text[at..].starts_with("//") {
            at = text[at..].find('\n').map_or(text.len(), |n| at + n);
        } else if text[at..].starts_with("/*") {
            let Some(end) = text[at + 2..].find("*/") else {
                return Err(ListingError { problem: Problem::CommentOpen, span: start..start + 2 });
            };
            at += end + 4;
        } else if c.is_ascii_digit() || c == '.' {
            at = number_end(bytes, at);
            let runs_on = |b: &u8| b.is_ascii_alphabetic() || *b == b'_' || *b == b'.';
            if bytes.get(at).is_some_and(runs_on) {
                let number = text[start..at].to_owned();
                let span = start..at + 1;
                return Err(ListingError { problem: Problem::NumberRunsOn { number }, span });
            }
            tokens.push((Token::Number, start..at));
        } else if c.is_ascii_alphabetic() || c == '_' {
            at = run(at, |b| b.is_ascii_alphanumeric() || *b == b'_');
            tokens.push((Token::Name, start..at));
        } else if "+-*/()[],;=".contains(c) {
            at += 1;
            tokens.push((Token::Sign(c), start..at));
        } else {
            let span = start..start + c.len_utf8();
            let problem =
                if c == '^' { Problem::Caret } else { Problem::Character { character: c } };
            return Err(ListingError { problem, span });
        }
    }
    tokens.push((Token::End, text.len()..text.len()));
    Ok(tokens)
}

/// The end of the number at `start`: digits, a point, digits, and an exponent if digits follow it.
fn number_end(bytes: &[u8], start: usize) -> usize {
    let digits =
        |from: usize| from + bytes[from..].iter().take_while(|b| b.is_ascii_digit()).count();
    let mut end = digits(start);
    if bytes.get(end) == Some(&b'.') {
        end = digits(end + 1);
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let signed = matches!(bytes.get(end + 1), Some(b'+' | b'-'));
        let exponent = end + 1 + usize::from(signed);
        if exponent < bytes.len() && digits(exponent) > exponent {
            end = digits(exponent);
        }
    }
    end
}
