//! Formulas of the book, written in LaTeX between dollar signs or in blocks of the language `math`, set as MathML.
//!
//! A browser shows MathML by itself, so that the built book needs no script and no network.

use anyhow::Context;
use pulldown_latex::config::{DisplayMode, RenderConfig};
use pulldown_latex::{Parser, ParserError, Storage, push_mathml};
use serde_json::Value;
use std::io::{Read, Write};

/// A piece of a line.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Piece<'a> {
    /// Markdown, code spans included.
    Text(&'a str),
    /// LaTeX between two dollar signs.
    Formula(&'a str),
    /// A dollar sign that opens a formula which ends nowhere on the line.
    Open,
}

/// Cuts a line into Markdown and formulas. Dollar signs in code spans are text.
pub(crate) fn pieces(line: &str) -> Vec<Piece<'_>> {
    let mut found = Vec::new();
    let (mut from, mut at) = (0, 0);
    while let Some(next) = line[at..].find(['`', '$', '\\']) {
        let start = at + next;
        let rest = &line[start..];
        match rest.as_bytes()[0] {
            b'`' => {
                let ticks = rest.len() - rest.trim_start_matches('`').len();
                let after = start + ticks;
                at = line[after..]
                    .find(&rest[..ticks])
                    .map_or(line.len(), |end| after + end + ticks);
            }
            b'\\' => at = start + 1 + rest[1..].chars().next().map_or(0, char::len_utf8),
            _ => {
                let inner = start + 1;
                let opens = line[inner..].starts_with(|c: char| !c.is_whitespace() && c != '$')
                    && !is_variable(&line[inner..]);
                let Some(end) = closing(line, inner).filter(|_| opens) else {
                    if opens {
                        found.extend([Piece::Text(&line[from..start]), Piece::Open]);
                        from = inner;
                    }
                    at = inner;
                    continue;
                };
                found.extend([Piece::Text(&line[from..start]), Piece::Formula(&line[inner..end])]);
                (from, at) = (end + 1, end + 1);
            }
        }
    }
    found.push(Piece::Text(&line[from..]));
    found.retain(|piece| *piece != Piece::Text(""));
    found
}

/// Whether a name as the shell has it follows, such as `MMS_OUT`.
fn is_variable(text: &str) -> bool {
    text.chars().take_while(char::is_ascii_uppercase).count() > 2
}

/// The place of the dollar sign that ends a formula.
fn closing(line: &str, from: usize) -> Option<usize> {
    line[from..].match_indices('$').map(|(at, _)| from + at).find(|&at| {
        let ends = line[..at].ends_with(|c: char| !c.is_whitespace() && c != '\\');
        ends && !line[at + 1..].starts_with(|c: char| c.is_ascii_digit())
    })
}

/// LaTeX as MathML, on one line, in a form that Markdown leaves alone.
pub(crate) fn mathml(latex: &str, display: bool) -> Result<String, String> {
    let storage = Storage::new();
    let events: Result<Vec<_>, ParserError> = Parser::new(latex, &storage).collect();
    let events = events.map_err(|error| error.to_string())?;
    let display_mode = if display { DisplayMode::Block } else { DisplayMode::Inline };
    let config = RenderConfig { display_mode, ..RenderConfig::default() };
    let mut out = String::new();
    push_mathml(&mut out, events.into_iter().map(Ok::<_, ParserError>), config)
        .map_err(|error| error.to_string())?;
    // Version 0.8.0 forgets a blank before the sizes of \bigl, and takes the micro sign, which has no italic form, for mu. A slash of
    // a quotient and the strokes of a size stand closer than operators.
    let out = out
        .replace("\"minsize=", "\" minsize=")
        .replace('\u{b5}', "\u{3bc}")
        .replace("stretchy=\"false\">|", "stretchy=\"false\" lspace=\"0\" rspace=\"0\">|")
        .replace("&amp;nbsp;", "\u{a0}")
        .replace("&nbsp;", "\u{a0}")
        .replace("<mo>/</mo>", "<mo lspace=\"0\" rspace=\"0\">/</mo>");
    let mut safe = String::with_capacity(out.len());
    for c in out.chars() {
        match c {
            '*' | '_' | '[' | ']' | '`' | '|' | '~' | '\\' | '$' => {
                safe += &format!("&#{};", u32::from(c))
            }
            '\n' => safe.push(' '),
            c => safe.push(c),
        }
    }
    Ok(safe)
}

/// A page with its formulas set. A formula that cannot be read stays as it is, which `xtask docs --check` reports.
fn set(page: &str) -> String {
    let mut out = String::with_capacity(2 * page.len());
    let mut fence: Option<(&str, Option<String>)> = None;
    for line in page.lines() {
        let inner = line.trim_start();
        let ticks = &inner[..inner.len() - inner.trim_start_matches(['`', '~']).len()];
        if let Some((opened, formula)) = &mut fence {
            let closes = ticks.len() >= opened.len()
                && ticks.starts_with(*opened)
                && inner.trim_end() == ticks;
            match formula {
                Some(latex) if closes => match mathml(latex, true) {
                    Ok(set) => out += &format!("<div class=\"formula\">{set}</div>\n\n"),
                    Err(_) => out += &format!("```text\n{latex}```\n"),
                },
                Some(latex) => *latex += &format!("{line}\n"),
                None => out += &format!("{line}\n"),
            }
            if closes {
                fence = None;
            }
        } else if ticks.len() >= 3 {
            let is_math = inner[ticks.len()..].trim() == "math";
            fence = Some((ticks, is_math.then(String::new)));
            if !is_math {
                out += &format!("{line}\n");
            }
        } else {
            for piece in pieces(line) {
                match piece {
                    Piece::Text(text) => out += text,
                    Piece::Formula(latex) => match mathml(latex, false) {
                        Ok(set) => out += &set,
                        Err(_) => out += &format!("${latex}$"),
                    },
                    Piece::Open => out.push('$'),
                }
            }
            out.push('\n');
        }
    }
    out
}

/// Sets the formulas of all chapters, wherever mdBook keeps them.
fn set_all(value: &mut Value) {
    match value {
        Value::Object(map) => {
            if let Some(Value::String(content)) =
                map.get_mut("Chapter").and_then(|chapter| chapter.get_mut("content"))
            {
                *content = set(content);
            }
            map.values_mut().for_each(set_all);
        }
        Value::Array(values) => values.iter_mut().for_each(set_all),
        _ => {}
    }
}

/// Answers mdBook, which hands the book over on standard input and takes it back from standard output.
pub(crate) fn preprocess(mut input: impl Read, mut output: impl Write) -> anyhow::Result<()> {
    let mut text = String::new();
    input.read_to_string(&mut text).context("cannot read the book from mdBook")?;
    let mut both: Value = serde_json::from_str(&text).context(
        "standard input is no book of mdBook; the command is for docs/book.toml, and mdbook build docs calls it",
    )?;
    let mut book =
        both.get_mut(1).map(Value::take).context("mdBook sent no book beside its context")?;
    set_all(&mut book);
    serde_json::to_writer(&mut output, &book).context("cannot hand the book back to mdBook")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formulas_lie_between_dollar_signs_outside_of_code() {
        assert_eq!(
            pieces("a $x_i$ b `$HOME` $y$."),
            [
                Piece::Text("a "),
                Piece::Formula("x_i"),
                Piece::Text(" b `$HOME` "),
                Piece::Formula("y"),
                Piece::Text("."),
            ]
        );
        assert_eq!(pieces("5 $ and 6 $"), [Piece::Text("5 $ and 6 $")]);
        assert_eq!(pieces(r"\$x$ is"), [Piece::Text(r"\$x$ is")]);
        assert_eq!(pieces("in $MMS_A or $MMS_B"), [Piece::Text("in $MMS_A or $MMS_B")]);
        assert_eq!(pieces("$X_J$"), [Piece::Formula("X_J")]);
        assert_eq!(pieces("$x is"), [Piece::Open, Piece::Text("x is")]);
    }

    #[test]
    fn mathml_has_no_character_that_markdown_reads() {
        let set = mathml(r"\lvert a * b \rvert_{[i]} \le \tfrac12", false).unwrap();
        assert!(set.starts_with("<math") && set.ends_with("</math>"), "{set}");
        assert!(!set.contains(['*', '_', '[', '|', '\n']), "{set}");
        assert!(mathml(r"\bigl(a\bigr)", false).unwrap().contains("\" minsize"));
        assert_eq!(
            mathml(r"\mu", false).unwrap(),
            "<math display=\"inline\"><mi>\u{3bc}</mi></math>"
        );
        assert!(mathml(r"\nosuch", false).unwrap_err().contains(r"\nosuch"));
        assert!(mathml(r"{a", false).is_err());
    }

    #[test]
    fn blocks_of_formulas_are_set_and_other_blocks_stay() {
        let page = "```sh\necho $x$\n```\n```math\na &= b \\\\\nc\n```\nand $z$\n";
        let set = set(&page.replace("a &= b \\\\\nc", "a = b"));
        assert!(
            set.starts_with(
                "```sh\necho $x$\n```\n<div class=\"formula\"><math display=\"block\">"
            ),
            "{set}"
        );
        assert!(set.ends_with("<mi>z</mi></math>\n"), "{set}");
    }

    #[test]
    fn mdbook_gets_its_book_back() {
        let chapter = r#"{"Chapter": {"name": "a", "content": "$x$", "sub_items": [{"Chapter": {"content": "`$x$`"}}]}}"#;
        for items in ["items", "sections"] {
            let input = format!(r#"[{{"root": ""}}, {{"{items}": [{chapter}, "Separator"]}}]"#);
            let mut output = Vec::new();
            preprocess(input.as_bytes(), &mut output).unwrap();
            let book: Value = serde_json::from_slice(&output).unwrap();
            let first = &book[items][0]["Chapter"];
            assert!(first["content"].as_str().unwrap().starts_with("<math"), "{book}");
            assert_eq!(first["sub_items"][0]["Chapter"]["content"], "`$x$`\n");
        }
        assert!(
            preprocess("{".as_bytes(), Vec::new())
                .unwrap_err()
                .to_string()
                .contains("mdbook build docs")
        );
    }
}
