//! `mms` with MPI. A program of its own and small, since `.ci/run` builds it for each MPI.

#![allow(clippy::unwrap_used)]

use std::process::Command;

#[test]
fn a_command_that_nothing_launched_is_one_process() {
    let place = tempfile::tempdir().unwrap();
    let run = "run axis-aligned-1d --cells 4 --periods 0.1 --quiet --json row.json";
    let output = Command::new(env!("CARGO_BIN_EXE_mms"))
        .current_dir(place.path())
        .args(run.split(' '))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(place.path().join("row.json").is_file());
}
