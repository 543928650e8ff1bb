//! Runs the real binary.

use serde_json::Value;
use std::io::Write;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

/// Result of one call of `mms`.
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

/// A call of `mms` that is under way.
pub(crate) struct UnderWay(Child);

impl UnderWay {
    /// Calls `mms` with `arguments`, separated by spaces, in the folder `place`, and does not wait for it.
    pub(crate) fn start(place: &Path, arguments: &str) -> Self {
        let child = Command::new(env!("CARGO_BIN_EXE_mms"))
            .current_dir(place)
            .args(arguments.split_whitespace())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn();
        Self(child.expect("the binary starts"))
    }

    /// Waits until something has happened, as long as the call is under way.
    pub(crate) fn wait_for(&mut self, mut has_happened: impl FnMut() -> bool) {
        while !has_happened() {
            let ended = self.0.try_wait().expect("its status");
            assert!(ended.is_none(), "it has ended by itself: {ended:?}");
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Kills it; it must be under way still.
    pub(crate) fn kill(mut self) {
        assert!(self.0.try_wait().expect("its status").is_none(), "it has ended by itself");
        self.0.kill().expect("it can be killed");
        self.0.wait().expect("it has ended");
    }

    /// Interrupts it as Ctrl-C does; its exit status, and what it said.
    #[cfg(unix)]
    pub(crate) fn interrupt(self) -> (i32, String) {
        let id = self.0.id().to_string();
        let sent = Command::new("kill").args(["-INT", &id]).status().expect("kill starts");
        assert!(sent.success());
        let output = self.0.wait_with_output().expect("it has ended");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        (output.status.code().expect("it ends by itself"), said)
    }

    /// Its exit status, once it has ended.
    pub(crate) fn end(mut self) -> i32 {
        self.0.wait().expect("it has ended").code().expect("it ends by itself")
    }
}

/// A pipe that nobody reads: whoever is to write to it at the end of some work never ends.
#[cfg(unix)]
pub(crate) fn pipe(path: &Path) {
    let made = Command::new("mkfifo").arg(path).status().expect("mkfifo starts");
    assert!(made.success());
}
