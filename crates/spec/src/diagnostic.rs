//! Error messages that show the text they speak of.

use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet};
use std::fmt;
use std::ops::Range;

/// A mistake in a specification: what is wrong, where, and what would be right.
///
/// Its display is several lines: the message, `file:line:column`, and the line with the place marked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// The mistake.
    pub message: String,
    /// The file, as the user called it.
    pub file: String,
    /// The whole text of the file.
    pub source: String,
    /// Where in the text, in bytes.
    pub span: Range<usize>,
    /// The correction, where it can be stated.
    pub help: Option<String>,
}

impl Diagnostic {
    /// Line and column of the place, both counted from one; columns count characters.
    #[must_use]
    pub fn line_and_column(&self) -> (usize, usize) {
        let before = self.source.get(..self.span.start).unwrap_or(&self.source);
        let line_start = before.rfind('\n').map_or(0, |at| at + 1);
        let line = before.matches('\n').count() + 1;
        (line, before[line_start..].chars().count() + 1)
    }

    /// The display for a terminal.
    #[must_use]
    pub fn rendered(&self, looks: Looks) -> String {
        // An empty span at the end of a text has nothing to mark: mark the last character.
        let end = self.span.end.clamp(self.span.start, self.source.len());
        let start = self.span.start.min(self.source.len().saturating_sub(1));
        let (start, end) =
            (self.source.floor_char_boundary(start), self.source.ceil_char_boundary(end));
        let snippet = Snippet::source(&self.source)
            .path(&self.file)
            .annotation(AnnotationKind::Primary.span(start..end.max(start)));
        let mut group = Level::ERROR.primary_title(&self.message).element(snippet);
        if let Some(help) = &self.help {
            group = group.element(Level::HELP.message(help));
        }
        let renderer = if looks.has_colors { Renderer::styled() } else { Renderer::plain() };
        let renderer = match looks.columns {
            Some(columns) => renderer.term_width(columns),
            None => renderer,
        };
        renderer.render(&[group])
    }
}

/// How a [`Diagnostic`] is displayed: plain by default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Looks {
    /// Whether there are colours.
    pub has_colors: bool,
    /// Columns of the terminal: of longer lines of the source the part with the mistake is shown.
    pub columns: Option<usize>,
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.rendered(Looks::default()))
    }
}

impl std::error::Error for Diagnostic {}

/// The name among `known` that `name` shortens, else the one that is closest to it, where one is close; for suggestions in
/// messages.
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let known: Vec<&str> = known.into_iter().collect();
    let near = known
        .iter()
        .map(|candidate| (distance(name, candidate), *candidate))
        .filter(|(distance, candidate)| *distance * 2 <= candidate.chars().count());
    shortened(name, &known).or_else(|| near.min().map(|(_, candidate)| candidate))
}

/// The fewest letters of a name that stand for the whole, as `dim` does.
const SHORTEST: usize = 3;

/// The one name among `known` that begins with `name`, letter case ignored.
fn shortened<'a>(name: &str, known: &[&'a str]) -> Option<&'a str> {
    let start = name.to_lowercase();
    let mut longer = known.iter().filter(|candidate| candidate.to_lowercase().starts_with(&start));
    match (name.chars().count() >= SHORTEST, longer.next(), longer.next()) {
        (true, Some(only), None) => Some(only),
        _ => None,
    }
}

/// The number of single-character edits between two names, letter case ignored.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.to_lowercase().chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.to_lowercase().chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &y) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_count_edits() {
        for (a, b, edits) in [
            ("", "", 0),
            ("lambda", "lambda", 0),
            ("Lambda", "lAMBDA", 0),
            ("", "abc", 3),
            ("abc", "", 3),
            ("a", "b", 1),
            ("lamda", "lambda", 1),
            ("lambda", "lamda", 1),
            ("abc", "xabc", 1),
            ("xyzabc", "abc", 3),
            ("ab", "ba", 2),
            ("kitten", "sitting", 3),
            ("saturday", "sunday", 3),
            ("\u{3bb}", "l", 1),
        ] {
            assert_eq!(distance(a, b), edits, "{a} {b}");
            assert_eq!(distance(b, a), edits, "{b} {a}");
        }
    }

    #[test]
    fn only_what_is_near_is_suggested() {
        let known = ["mu", "lambda", "rho0", "sigma_max"];
        for (name, expected) in [
            ("lamda", Some("lambda")),
            ("MU", Some("mu")),
            ("m", Some("mu")),
            ("rho", Some("rho0")),
            ("sigmax", Some("sigma_max")),
            ("temperature", None),
            ("xy", None),
            ("sig", Some("sigma_max")),
            ("s", None),
        ] {
            assert_eq!(nearest(name, known), expected, "{name}");
        }
    }
}
