//! Runs the real binary.
#![allow(dead_code)] // Each test file uses some of it.

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

/// What one call of `mms` gave.
pub(crate) struct Called {
    pub(crate) status: i32,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

/// Calls `mms` with `arguments`, separated by spaces, in the folder `place`.
pub(crate) fn mms(place: &Path, arguments: &str) -> Called {
    let Output { status, stdout, stderr } = Command::new(env!("CARGO_BIN_EXE_mms"))
        .current_dir(place)
        .args(arguments.split_whitespace())
        .output()
        .expect("the binary starts");
    Called {
        status: status.code().expect("it ends by itself"),
        stdout: String::from_utf8(stdout).expect("text"),
        stderr: String::from_utf8(stderr).expect("text"),
    }
}

/// Calls `mms`, which must refuse with status 2, say all of `expected`, and leave `place` as empty as it was.
pub(crate) fn refuses(place: &Path, arguments: &str, expected: &[&str]) {
    let before = names(place);
    let called = mms(place, arguments);
    assert_eq!(called.status, 2, "mms {arguments}: {}", called.stderr);
    assert_eq!(called.stdout, "", "mms {arguments}");
    for part in expected {
        let said = &called.stderr;
        assert!(said.contains(part), "mms {arguments}: '{part}' is missing in: {said}");
    }
    assert_eq!(names(place), before, "mms {arguments} left something behind");
}

/// The names of what is in a folder.
pub(crate) fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    let mut names: Vec<_> = entries
        .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

pub(crate) fn read_json(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).expect("a file");
    serde_json::from_str(&text).expect("valid JSON")
}

/// The keys of a JSON object in alphabetical order, separated by spaces.
pub(crate) fn keys(value: &Value) -> String {
    let mut keys: Vec<_> = value.as_object().expect("an object").keys().cloned().collect();
    keys.sort();
    keys.join(" ")
}
