//! Runs the real binary.
#![allow(dead_code)] // Each test file uses some of it.

use serde_json::Value;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// What one call of `mms` gave.
pub(crate) struct Called {
    pub(crate) status: i32,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

/// Calls `mms` with `arguments`, separated by spaces, in the folder `place`.
pub(crate) fn mms(place: &Path, arguments: &str) -> Called {
    mms_with(place, arguments, &[], "")
}

/// As [`mms`], with variables of the environment and with text on standard input.
pub(crate) fn mms_with(
    place: &Path,
    arguments: &str,
    variables: &[(&str, &str)],
    input: &str,
) -> Called {
    let mut child = Command::new(env!("CARGO_BIN_EXE_mms"))
        .current_dir(place)
        .args(arguments.split_whitespace())
        .envs(variables.iter().copied())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary starts");
    // What is not read is lost, which is right.
    let _ = child.stdin.take().expect("a pipe").write_all(input.as_bytes());
    let Output { status, stdout, stderr } = child.wait_with_output().expect("it ends");
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
