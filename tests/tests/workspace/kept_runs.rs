//! Runs of every kind against the errors that they had when `data/runs.json` was written.
//!
//! A change of structure keeps them to the bit. Where a change of arithmetic is meant, `UPDATE_EXPECT=1` writes the file
//! anew, and the difference is there to be looked at.

#![allow(clippy::unwrap_used)]

use mmsmith_digest::{kept as lines, published, repeat};
use mmsmith_tests::{mms, outcome, workspace};
use mmsmith_verify::Registers;
use serde_json::{Value, json};
use std::fs;

/// Results of a run that do not depend on clocks and machines.
fn kept(command: &str) -> Value {
    let words: Vec<&str> = command.split(' ').collect();
    let (_, out, errors) = outcome(mms().arg("run").args(&words).args(["--json", "-"]));
    let document: Value =
        serde_json::from_str(&out).unwrap_or_else(|_| panic!("mms run {command}: {errors}"));
    let result = &document["result"];
    json!({
        "command": command,
        "status": result["status"],
        "steps": result["steps"],
        "particles": result["particles"],
        "errors": result["errors"],
    })
}

#[test]
fn runs_of_every_kind_keep_their_errors_to_the_bit() {
    let file = workspace().join("tests/data/runs.json");
    let expected: Vec<Value> = serde_json::from_str(&fs::read_to_string(&file).unwrap()).unwrap();
    let commands: Vec<&str> = expected.iter().map(|run| run["command"].as_str().unwrap()).collect();
    let found: Vec<Value> = commands.iter().map(|command| kept(command)).collect();
    if std::env::var_os("UPDATE_EXPECT").is_some() {
        fs::write(&file, serde_json::to_string_pretty(&found).unwrap() + "\n").unwrap();
        return;
    }
    let differing: Vec<String> = expected
        .iter()
        .zip(&found)
        .filter(|(expected, found)| expected != found)
        .map(|(expected, found)| format!("expected {expected}\n   found {found}"))
        .collect();
    assert!(differing.is_empty(), "{}", differing.join("\n"));
}

/// Every run that `mms doctor` repeats: with all kinds of registers on one thread, and with none on three.
#[test]
fn small_runs_have_the_published_bits_with_all_registers_and_threads() {
    let present = Registers::present().into_iter().rev();
    let ways = present.map(|registers| match registers {
        Registers::Scalar => (registers, 3),
        Registers::Avx2 | Registers::Avx512 => (registers, 1),
    });
    let repeated = |(registers, threads): (Registers, usize)| {
        registers.use_at_most();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let found = pool.install(|| repeat(&mut |_, _| ())).unwrap();
        Registers::WIDEST.use_at_most();
        found
    };
    let found: Vec<_> = ways.map(repeated).collect();
    for other in &found {
        assert_eq!(&found[0], other);
    }
    if std::env::var_os("UPDATE_EXPECT").is_some() {
        fs::write(workspace().join("crates/digest/src/kept.txt"), lines(&found[0])).unwrap();
        return;
    }
    let differing: Vec<_> = found[0].iter().filter(|run| !run.is_same()).collect();
    assert!(differing.is_empty(), "{differing:?}");
    assert_eq!(published().count(), found[0].len());
}
