//! Standard output and standard error: how much is said on them, how wide, and in which colours.

use std::borrow::Cow;
use std::env;
use std::fmt::{Display, Write as _};
use std::io::{self, ErrorKind, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

use anyhow::{Context, Result, bail};
use clap::{ColorChoice, ValueEnum};
use mmsmith_spec::{Diagnostic, Looks};
use serde_json::Value;

/// How much is said beside results and errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Verbosity {
    /// Nothing.
    Quiet,
    /// Progress, and notes on what the user may not expect.
    Usual,
    /// Versions, settings, and what was found where, as well.
    Verbose,
}

/// Whether messages have colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Color {
    /// On a terminal, unless NO_COLOR is set; with CLICOLOR_FORCE elsewhere too
    Auto,
    /// Always
    Always,
    /// Never
    Never,
}

impl From<Color> for ColorChoice {
    fn from(color: Color) -> Self {
        match color {
            Color::Auto => Self::Auto,
            Color::Always => Self::Always,
            Color::Never => Self::Never,
        }
    }
}

/// Options of the command line on messages.
#[derive(Clone, Copy, Debug)]
struct Manner {
    verbosity: Verbosity,
    color: Color,
}

static MANNER: OnceLock<Manner> = OnceLock::new();
/// Whether standard output is kept for one document.
static RESERVED: AtomicBool = AtomicBool::new(false);

/// Settles, once a process, how much is said and whether in colours.
pub(crate) fn settle(verbosity: Verbosity, color: Color) {
    // A second call changes nothing.
    let _ = MANNER.set(Manner { verbosity, color });
}

/// Nothing is said from now on, by a process that has other uses for its terminal.
pub(crate) fn silence() {
    settle(Verbosity::Quiet, Color::Never);
    RESERVED.store(true, Ordering::Relaxed);
}

fn manner() -> Manner {
    *MANNER.get().unwrap_or(&Manner { verbosity: Verbosity::Usual, color: Color::Auto })
}

/// Whether progress and notes are unwanted.
pub(crate) fn is_quiet() -> bool {
    manner().verbosity == Verbosity::Quiet
}

/// Whether [`detail`] says anything.
pub(crate) fn is_verbose() -> bool {
    manner().verbosity == Verbosity::Verbose
}

/// Keeps standard output for one document, which [`print`] writes: [`say`] says nothing from now on.
pub(crate) fn reserve() -> Result<()> {
    if RESERVED.swap(true, Ordering::Relaxed) {
        bail!(
            "standard output takes one document: give '-' to one option only, and files to the others"
        );
    }
    Ok(())
}

/// Columns of a table where standard output is no terminal, so that files and pages have the same tables everywhere.
const USUAL_COLUMNS: usize = 80;
/// Narrower terminals get lines of this length.
const FEWEST_COLUMNS: usize = 40;
/// Longer lines of words are hard to read.
const MOST_COLUMNS_OF_WORDS: usize = 100;

/// The columns of the terminal that a stream is shown on, if it is one.
fn columns_of(size: Option<(terminal_size::Width, terminal_size::Height)>) -> Option<usize> {
    let (terminal_size::Width(columns), _) = size?;
    // Some terminals do not know their size and say 0.
    (columns > 0).then(|| usize::from(columns).max(FEWEST_COLUMNS))
}

/// The columns that a table on standard output has room for.
pub(crate) fn columns() -> usize {
    columns_of(terminal_size::terminal_size_of(io::stdout())).unwrap_or(USUAL_COLUMNS)
}

/// The columns of help and of errors in the command line.
pub(crate) fn columns_of_help() -> usize {
    columns().min(MOST_COLUMNS_OF_WORDS)
}

/// Words in lines of at most so many characters; a word that is longer has a line of its own.
pub(crate) fn wrapped(words: &str, most: usize) -> Vec<String> {
    let options = textwrap::Options::new(most)
        .break_words(false)
        .word_splitter(textwrap::WordSplitter::NoHyphenation);
    textwrap::wrap(words, options).into_iter().map(Cow::into_owned).collect()
}

/// Text whose lines of words fit a terminal: a line that is longer goes on in the next one, indented. Elsewhere lines stay whole, for
/// those who search them.
fn fitted(text: &str, columns: Option<usize>) -> Cow<'_, str> {
    let Some(columns) = columns else { return text.into() };
    let mut fitted = String::with_capacity(text.len());
    for line in text.split_inclusive('\n') {
        let (words, end) = line.strip_suffix('\n').map_or((line, ""), |words| (words, "\n"));
        if textwrap::core::display_width(words) <= columns {
            fitted += line;
            continue;
        }
        let indent = words.len() - words.trim_start_matches(' ').len();
        let lines = wrapped(
            &words[indent..],
            columns.min(MOST_COLUMNS_OF_WORDS).saturating_sub(indent + 2),
        );
        let lines = lines.iter().enumerate().map(|(index, line)| {
            let indent = if index == 0 { indent } else { indent + 2 };
            format!("{:indent$}{line}", "")
        });
        fitted += &lines.collect::<Vec<_>>().join("\n");
        fitted += end;
    }
    fitted.into()
}

/// Writes tables and captions to standard output, unless it is [kept](reserve) for a document.
pub(crate) fn say(text: &str) -> Result<()> {
    if RESERVED.load(Ordering::Relaxed) {
        return Ok(());
    }
    let columns = columns_of(terminal_size::terminal_size_of(io::stdout()));
    let text = fitted(text, columns);
    let text = if has_colors(&io::stdout()) { painted(&text).into() } else { text };
    print(text.as_bytes())
}

/// Says that a file is written, unless the user wants results alone.
pub(crate) fn say_written(file: &str) -> Result<()> {
    if is_quiet() { Ok(()) } else { say(&format!("wrote {file}\n")) }
}

/// Writes to standard output; a reader that went away, such as `head`, is no error.
pub(crate) fn print(bytes: &[u8]) -> Result<()> {
    let mut output = io::stdout().lock();
    match output.write_all(bytes).and_then(|()| output.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(error).context("cannot write to standard output")
        }
        _ => Ok(()),
    }
}

/// Writes to standard error as it is; if even that fails there is nobody left to tell.
fn write_error(text: &str) {
    let _ = io::stderr().lock().write_all(text.as_bytes());
}

/// Writes to standard error, in lines that fit its terminal.
pub(crate) fn complain(text: &str) {
    write_error(&fitted(text, columns_of(terminal_size::terminal_size_of(io::stderr()))));
}

/// Shows on standard error a mistake in a specification, whose layout stays.
pub(crate) fn show(diagnostic: &Diagnostic) {
    let columns = columns_of(terminal_size::terminal_size_of(io::stderr()));
    let looks = Looks { has_colors: has_colors(&io::stderr()), columns };
    write_error(&format!("{}\n", diagnostic.rendered(looks)));
}

/// Shows what clap says of a command line: help on standard output, refusals on standard error.
pub(crate) fn show_refusal(refusal: &clap::Error, color: Color) {
    let styled = refusal.render();
    let text = |has_colors| match has_colors {
        true => styled.ansi().to_string(),
        false => styled.to_string(),
    };
    if refusal.use_stderr() {
        complain(&text(colors_of(color, &io::stderr())));
    } else {
        let columns = columns_of(terminal_size::terminal_size_of(io::stdout()));
        // Nobody is left to tell that help cannot be shown.
        let _ = print(fitted(&text(colors_of(color, &io::stdout())), columns).as_bytes());
    }
}

/// Says on standard error why the work ends.
pub(crate) fn error(what: impl Display) {
    complain(&format!("{} {what}\n", marked("error:", "31")));
}

/// Says on standard error what may be wrong, unless the user wants it quiet.
pub(crate) fn warn(what: impl Display) {
    note(format!("{} {what}", marked("warning:", "33")));
}

/// Says on standard error what the user may not expect, unless the user wants it quiet.
pub(crate) fn note(what: impl Display) {
    if !is_quiet() {
        complain(&format!("{what}\n"));
    }
}

/// Says on standard error what was found where, for users who want to know.
pub(crate) fn detail(what: impl Display) {
    if is_verbose() {
        complain(&format!("{what}\n"));
    }
}

/// Says the settings of a result, one a line, for users who want to know; of the same settings once.
pub(crate) fn detail_once(settings: &Value) {
    static TOLD: Mutex<Option<Value>> = Mutex::new(None);
    if !is_verbose() {
        return;
    }
    let mut told = TOLD.lock().unwrap_or_else(PoisonError::into_inner);
    if told.as_ref() != Some(settings) {
        for (name, value) in settings.as_object().into_iter().flatten() {
            complain(&format!("  {name} = {value}\n"));
        }
        *told = Some(settings.clone());
    }
}

/// Words that verdicts are told with, and their SGR codes. Capitals are kept for failures in all output.
const VERDICTS: [(&str, &str); 9] = [
    ("passed", GREEN),
    ("ok", GREEN),
    ("FAILED", RED),
    ("STOPPED", RED),
    ("PROBLEM", RED),
    ("UNSTABLE", RED),
    ("DOES", RED),
    ("NOT", RED),
    ("warning", YELLOW),
];
const GREEN: &str = "32";
const RED: &str = "31";
const YELLOW: &str = "33";

/// Text with the words of verdicts in their colours.
fn painted(text: &str) -> String {
    let mut painted = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(from) = rest.find(|c: char| c.is_ascii_alphabetic()) {
        let is_part = |c: char| c.is_ascii_alphanumeric() || "_-./".contains(c);
        let to = rest[from..].find(|c| !is_part(c)).map_or(rest.len(), |length| from + length);
        let word = &rest[from..to];
        let ends = word.trim_end_matches('.').len();
        painted += &rest[..from];
        match VERDICTS.iter().find(|(verdict, _)| *verdict == &word[..ends]) {
            Some((verdict, code)) => {
                let _ = write!(painted, "\x1b[1;{code}m{verdict}\x1b[0m{}", &word[ends..]);
            }
            None => painted += word,
        }
        rest = &rest[to..];
    }
    painted + rest
}

/// A word in bold and in the colour of an SGR code, where standard error shows colours.
fn marked(word: &str, code: &str) -> String {
    if has_colors(&io::stderr()) { format!("\x1b[1;{code}m{word}\x1b[0m") } else { word.to_owned() }
}

/// Whether a stream has colours.
fn has_colors(stream: &impl IsTerminal) -> bool {
    colors_of(manner().color, stream)
}

/// Whether a stream has colours where the command line asks for `color`; as clap decides it for its own messages.
fn colors_of(color: Color, stream: &impl IsTerminal) -> bool {
    let set = |name: &str| env::var_os(name).is_some_and(|value| !value.is_empty());
    let enabled = |name: &str| env::var_os(name).map(|value| value != "0");
    match color {
        Color::Always => true,
        Color::Never => false,
        Color::Auto if set("NO_COLOR") => false,
        Color::Auto if enabled("CLICOLOR_FORCE") == Some(true) => true,
        Color::Auto if enabled("CLICOLOR") == Some(false) => false,
        Color::Auto => {
            stream.is_terminal() && env::var_os("TERM").is_none_or(|term| term != "dumb")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_that_are_too_long_go_on_indented_and_no_word_is_broken() {
        let text = "short\n  a note: --set rho0=1 mends it\n";
        assert_eq!(fitted(text, None), text);
        let expected = "short\n  a note:\n    --set\n    rho0=1\n    mends it\n";
        assert_eq!(fitted(text, Some(12)), expected);
        // A word that is longer than the line stays whole, and blank lines stay.
        assert_eq!(fitted("a\n\n0123456789 b", Some(6)), "a\n\n0123456789\n  b");
    }

    #[test]
    fn verdicts_have_colours_where_they_are_words_of_their_own() {
        let told = painted("u: passed, v: FAILED. oklahoma, not passed-on, run/ok");
        let expected = "u: \u{1b}[1;32mpassed\u{1b}[0m, v: \u{1b}[1;31mFAILED\u{1b}[0m. oklahoma, not passed-on, run/ok";
        assert_eq!(told, expected);
    }
}
