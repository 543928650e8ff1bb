//! Standard output and standard error, and how much is said on them.

use std::env;
use std::fmt::Display;
use std::io::{self, ErrorKind, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

use anyhow::{Context, Result, bail};
use clap::{ColorChoice, ValueEnum};
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

/// What the command line says of messages.
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

/// Writes tables and captions to standard output, unless it is [kept](reserve) for a document.
pub(crate) fn say(text: &str) -> Result<()> {
    if RESERVED.load(Ordering::Relaxed) { Ok(()) } else { print(text.as_bytes()) }
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

/// Writes to standard error; if even that fails there is nobody left to tell.
pub(crate) fn complain(text: &str) {
    let _ = io::stderr().lock().write_all(text.as_bytes());
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

/// A word in bold and in the colour of an SGR code, where standard error shows colours.
fn marked(word: &str, code: &str) -> String {
    if has_colors() { format!("\x1b[1;{code}m{word}\x1b[0m") } else { word.to_owned() }
}

/// Whether messages on standard error have colours; as clap decides it for its own.
fn has_colors() -> bool {
    let set = |name: &str| env::var_os(name).is_some_and(|value| !value.is_empty());
    let enabled = |name: &str| env::var_os(name).map(|value| value != "0");
    match manner().color {
        Color::Always => true,
        Color::Never => false,
        Color::Auto if set("NO_COLOR") => false,
        Color::Auto if enabled("CLICOLOR_FORCE") == Some(true) => true,
        Color::Auto if enabled("CLICOLOR") == Some(false) => false,
        Color::Auto => {
            io::stderr().is_terminal() && env::var_os("TERM").is_none_or(|term| term != "dumb")
        }
    }
}
