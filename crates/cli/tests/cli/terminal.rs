//! Output of `mms` on a terminal: lines that fit it, whole words and numbers, colours.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::Read;
use std::os::fd::OwnedFd;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use crate::command::mms;
use nix::pty::{OpenptyResult, Winsize, openpty};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

/// Starts `mms` with `arguments` in `place` on a terminal of so many columns; what it writes is read from the other end.
fn start(place: &Path, columns: u16, arguments: &str) -> (Child, File) {
    let size = Winsize { ws_row: 40, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 };
    let OpenptyResult { master, slave } = openpty(Some(&size), None).expect("a terminal");
    let end = |terminal: &OwnedFd| Stdio::from(terminal.try_clone().expect("another handle"));
    let child = Command::new(env!("CARGO_BIN_EXE_mms"))
        .current_dir(place)
        .args(arguments.split_whitespace())
        .env("TERM", "xterm-256color")
        .env_remove("NO_COLOR")
        .stdin(end(&slave))
        .stdout(end(&slave))
        .stderr(end(&slave))
        .spawn()
        .expect("the binary starts");
    (child, File::from(master))
}

/// Calls `mms` with `arguments` in `place` on a terminal of so many columns; what the terminal got, and the exit status.
fn on_terminal(place: &Path, columns: u16, arguments: &str) -> (String, i32) {
    let (mut child, mut terminal) = start(place, columns, arguments);
    let mut bytes = Vec::new();
    // The last reader of a terminal whose other end is closed gets an error on Linux.
    let _ = terminal.read_to_end(&mut bytes);
    let status = child.wait().expect("it ends").code().expect("it ends by itself");
    (String::from_utf8(bytes).expect("text"), status)
}

/// Text without the escape sequences of colours and cursors.
fn plain(text: &str) -> String {
    let mut parts = text.split('\u{1b}');
    let mut plain = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let rest = part.find(|c: char| c.is_ascii_alphabetic()).map_or("", |end| &part[end + 1..]);
        plain += rest;
    }
    plain
}

/// The words of a text with all digits and all units of time alike, since times differ from run to run; without the note on what is left out, which a wide
/// terminal does not have.
fn words(text: &str) -> BTreeSet<String> {
    let mut parts = text.split("Left out for lack of room");
    let first = parts.next().unwrap_or_default();
    let others = parts.map(|part| part.split_once("them.").map_or("", |(_, rest)| rest));
    let mut forms = BTreeSet::new();
    for word in std::iter::once(first).chain(others).flat_map(str::split_whitespace) {
        if ["ms", "s", "min", "h", "days"].contains(&word) {
            continue;
        }
        let mut form = String::new();
        for c in word.chars() {
            match c {
                '0'..='9' if form.ends_with('#') => {}
                '0'..='9' => form.push('#'),
                other => form.push(other),
            }
        }
        forms.insert(form);
    }
    forms
}

/// No line is longer than the terminal.
fn assert_lines_fit(shown: &str, columns: u16) {
    for line in shown.lines().flat_map(|line| line.split('\r')) {
        let length = line.chars().count();
        assert!(length <= usize::from(columns), "{length} in {columns}: {line}");
    }
}

/// No line is longer than the terminal, and every word is one of those that a wide terminal has.
fn fits(place: &Path, arguments: &str, widths: &[u16]) {
    let (wide, expected) = on_terminal(place, 1000, arguments);
    let wide = words(&plain(&wide));
    for &columns in widths {
        let (shown, status) = on_terminal(place, columns, arguments);
        assert_eq!(status, expected, "mms {arguments}");
        let shown = plain(&shown);
        assert_lines_fit(&shown, columns);
        let broken: Vec<_> = words(&shown).difference(&wide).cloned().collect();
        assert!(broken.is_empty(), "mms {arguments}, {columns} columns: {broken:?}");
    }
}

const WIDTHS: [u16; 3] = [60, 80, 100];

#[test]
fn help_fits_every_terminal() {
    let place = tempfile::tempdir().unwrap();
    let (help, _) = on_terminal(place.path(), 80, "--help");
    let help = plain(&help);
    let is_command = |line: &&str| line.starts_with("  ") && !line.starts_with("   ");
    let names: Vec<&str> = help
        .lines()
        .filter(is_command)
        .filter_map(|line| line.split_whitespace().next())
        .filter(|word| !word.starts_with('-') && *word != "help")
        .collect();
    assert!(names.contains(&"run") && names.contains(&"score") && names.len() > 15, "{names:?}");
    for name in names {
        for form in ["-h", "--help"] {
            fits(place.path(), &format!("{name} {form}"), &WIDTHS);
        }
    }
    for arguments in ["", "-h", "--help", "help", "help run"] {
        fits(place.path(), arguments, &WIDTHS);
    }
}

#[test]
fn tables_fit_every_terminal() {
    let place = tempfile::tempdir().unwrap();
    for cells in [4, 8] {
        let run = format!("run axis-aligned --cells {cells} --frames 2 --vtk run-{cells}");
        assert_eq!(mms(place.path(), &run).status, 0);
    }
    for arguments in [
        "list",
        "list --long",
        "explain ring",
        "check ring axis-aligned-1d",
        "check ring --thorough --points 4",
        "coverage",
        "run axis-aligned --cells 8",
        "converge axis-aligned --cells 4,8,16",
        "converge axis-aligned --cells 8 --cfls 0.1,0.2,0.4",
        "converge bar --cells 8,16 --formulation total-lagrangian",
        "stability axis-aligned-1d --cells 4 --over integrator=cd,usl",
        "stability axis-aligned-1d --cells 4 --at 2",
        "score axis-aligned run-4 run-8 --cells 4,8",
        "score axis-aligned run-8",
        "score axis-aligned run-8 --cells 8 --against mms:gimp,cd",
    ] {
        fits(place.path(), &format!("{arguments} --quiet"), &WIDTHS);
    }
}

/// Settings found to be cheap, and the words for them, differ from run to run.
#[test]
fn a_sweep_fits_every_terminal() {
    let place = tempfile::tempdir().unwrap();
    for columns in WIDTHS {
        let (shown, _) = on_terminal(place.path(), columns, "tradeoff axis-aligned-1d --cells 4,8");
        let shown = plain(&shown);
        assert_lines_fit(&shown, columns);
        let is_broken = |word: &&str| word.ends_with("e-") || word.starts_with("e-");
        assert_eq!(shown.split_whitespace().find(is_broken), None, "{columns} columns: {shown}");
    }
}

#[test]
fn refusals_fit_every_terminal() {
    let place = tempfile::tempdir().unwrap();
    for arguments in [
        "run rign",
        "run ring --shape gmp",
        "converge ring",
        "gen ring --target basic --out x",
        "score ring nowhere.csv",
        "tradeoff ring --shard 1/2 --out kept",
    ] {
        fits(place.path(), arguments, &WIDTHS);
    }
}

#[test]
fn progress_stays_in_its_line() {
    let place = tempfile::tempdir().unwrap();
    let (shown, _) = on_terminal(place.path(), 80, "tradeoff axis-aligned-1d --cells 4,8");
    assert!(shown.contains("total Lagrangian"), "{shown}");
    assert_lines_fit(&plain(&shown), 80);
}

#[test]
fn an_interruption_takes_the_bar_away_and_says_so() {
    let place = tempfile::tempdir().unwrap();
    let (mut child, mut terminal) = start(place.path(), 80, "check --thorough ring --seconds 1h");
    let mut shown = Vec::new();
    let mut more = [0; 4096];
    while !String::from_utf8_lossy(&shown).contains("] ") {
        let read = terminal.read(&mut more).expect("it is under way");
        shown.extend_from_slice(&more[..read]);
    }
    let id = Pid::from_raw(child.id().try_into().expect("an identifier"));
    kill(id, Signal::SIGINT).expect("it is under way");
    let _ = terminal.read_to_end(&mut shown);
    assert_eq!(child.wait().expect("it ends").code(), Some(130));
    let shown = String::from_utf8_lossy(&shown).into_owned();
    let (before, end) = shown.rsplit_once("\u{1b}[2K").expect("the bar was drawn");
    assert!(before.contains("] ") && !end.contains("] "), "{shown:?}");
    assert!(plain(end).ends_with("error: interrupted\r\n"), "{shown:?}");
}

#[test]
fn verdicts_have_colours_on_a_terminal_alone() {
    let place = tempfile::tempdir().unwrap();
    let check = "check axis-aligned-1d";
    let (shown, _) = on_terminal(place.path(), 80, check);
    assert!(shown.contains("\u{1b}[1;32mpassed\u{1b}[0m"), "{shown}");
    let (shown, _) = on_terminal(place.path(), 80, &format!("{check} --color never"));
    assert!(!shown.contains('\u{1b}'), "{shown}");
    assert!(!mms(place.path(), check).stdout.contains('\u{1b}'));
    std::fs::write(place.path().join("wrong.toml"), "name = 3\n").unwrap();
    let (shown, status) = on_terminal(place.path(), 80, "check wrong.toml");
    assert!(status == 2 && shown.contains("\u{1b}["), "{shown}");
}

#[test]
fn tables_have_one_width_where_there_is_no_terminal() {
    let place = tempfile::tempdir().unwrap();
    let study = mms(place.path(), "converge axis-aligned --cells 4,8");
    let tables = study.stdout.lines().filter(|line| line.starts_with("  "));
    let longest = tables.map(|line| line.chars().count()).max();
    assert!(longest.is_some_and(|longest| longest <= 80), "{}", study.stdout);
    assert!(study.stdout.contains("Left out for lack of room: l1. "), "{}", study.stdout);
}
