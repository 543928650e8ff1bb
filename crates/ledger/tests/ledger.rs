//! Ledgers as studies use them: killed, damaged, shared, and on a full disk.
// Helpers may unwrap and print as tests do.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::fs::{self, File, OpenOptions};
use std::io::{BufRead, BufReader, Lines, Write};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};

use mmsmith_ledger::{Claim, Ledger};
use serde_json::{Value, json};

const FOLDER: &str = "MMSMITH_LEDGER_FOLDER";
/// While this file is there, children wait, each after the first case that it finished itself.
const GATE: &str = "gate";
/// Where this is set, a child that has done its work waits to be killed.
const KILLED: &str = "MMSMITH_LEDGER_KILLED";
/// Message of such a child before it waits.
const IDLE: &str = "nothing is left";
/// Cases of the children's study.
const CASES: u64 = 400;

fn key(case: u64) -> Value {
    json!({ "case": case, "cfl": 0.1 * case as f64 })
}

fn value(case: u64) -> Value {
    json!({ "error": 1.0 / (case as f64 + 3.0), "text": "x".repeat((case % 7) as usize * 300) })
}

/// Finishes all free cases of the study, and calls `then` with each.
fn work(folder: &Path, mut then: impl FnMut(u64)) {
    let ledger = Ledger::open(folder, &Value::Null).unwrap();
    for case in 0..CASES {
        if let Claim::Mine(mine) = ledger.claim(&key(case)).unwrap() {
            mine.finish(&value(case)).unwrap();
            then(case);
        }
    }
}

/// Runs in children only.
#[test]
#[ignore = "is started by other tests, in processes of its own"]
fn child() {
    let Some(folder) = std::env::var_os(FOLDER) else { return };
    let folder = Path::new(&folder);
    work(folder, |case| {
        println!("finished {case}");
        while folder.join(GATE).exists() {
            std::thread::yield_now();
        }
    });
    if std::env::var_os(KILLED).is_some() {
        println!("{IDLE}");
        loop {
            std::thread::park();
        }
    }
}

/// A child process and its messages.
struct Working {
    child: Child,
    said: Lines<BufReader<ChildStdout>>,
    /// Whether the child has said that nothing is left; it then waits, and says no more.
    is_idle: bool,
}

impl Working {
    fn start(folder: &Path, is_killed: bool) -> Self {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command
            .args(["--exact", "child", "--ignored", "--nocapture"])
            .env(FOLDER, folder)
            .stdout(Stdio::piped())
            .stderr(Stdio::null());
        if is_killed {
            command.env(KILLED, "");
        }
        let mut child = command.spawn().unwrap();
        let said = BufReader::new(child.stdout.take().unwrap()).lines();
        Self { child, said, is_idle: false }
    }

    /// The next case that the child finished; `None` where nothing is left, or where it has ended.
    fn next(&mut self) -> Option<u64> {
        // The test harness writes its own words between, and one killed in the middle of a line leaves a part.
        while !self.is_idle {
            let line = self.said.next()?.ok()?;
            self.is_idle = line.contains(IDLE);
            let case = line.split("finished ").nth(1).and_then(|case| case.parse().ok());
            if case.is_some() {
                return case;
            }
        }
        None
    }

    /// All further cases of the child.
    fn rest(&mut self) -> Vec<u64> {
        std::iter::from_fn(|| self.next()).collect()
    }
}

/// The keys of all lines, which must be whole.
fn lines(folder: &Path) -> Vec<Value> {
    let text = fs::read_to_string(folder.join("cases.jsonl")).unwrap();
    let whole = text.lines().filter(|line| !line.trim().is_empty());
    whole.map(|line| serde_json::from_str::<Value>(line).unwrap()["key"].take()).collect()
}

fn assert_complete(folder: &Path) {
    let ledger = Ledger::open(folder, &Value::Null).unwrap();
    assert_eq!(ledger.take_damaged(), []);
    for case in 0..CASES {
        assert!(matches!(ledger.claim(&key(case)).unwrap(), Claim::Done(v) if v == value(case)));
    }
    let mut found: Vec<_> = lines(folder).iter().map(|key| key["case"].as_u64().unwrap()).collect();
    found.sort_unstable();
    assert_eq!(found, (0..CASES).collect::<Vec<_>>(), "each case once");
}

#[test]
fn killed_at_thirty_moments_it_loses_no_finished_case_and_doubles_none() {
    let place = tempfile::tempdir().unwrap();
    let mut finished = Vec::new();
    for round in 0..30_usize {
        if finished.len() as u64 == CASES {
            fs::remove_dir_all(place.path()).unwrap();
            finished.clear();
        }
        // It cannot end before it is killed: with nothing left to do it waits for that.
        let mut working = Working::start(place.path(), true);
        for _ in 0..1 + round * 7 % 20 {
            finished.extend(working.next());
        }
        working.child.kill().unwrap();
        working.child.wait().unwrap();
        finished.extend(working.rest());
        let ledger = Ledger::open(place.path(), &Value::Null).unwrap();
        for &case in &finished {
            let claim = ledger.claim(&key(case)).unwrap();
            assert!(matches!(claim, Claim::Done(v) if v == value(case)), "case {case} is lost");
        }
        // A case may be finished and not named yet; no other one is.
        assert!(ledger.finished().unwrap() >= finished.len());
        let mut keys: Vec<_> = lines(place.path()).iter().map(Value::to_string).collect();
        let count = keys.len();
        keys.sort();
        keys.dedup();
        assert_eq!(keys.len(), count, "a case is there twice");
        finished = keys
            .iter()
            .map(|key| serde_json::from_str::<Value>(key).unwrap()["case"].as_u64().unwrap())
            .collect();
    }
    work(place.path(), |_| {});
    assert_complete(place.path());
}

#[test]
fn processes_side_by_side_share_the_cases() {
    let place = tempfile::tempdir().unwrap();
    let gate = place.path().join(GATE);
    fs::write(&gate, "").unwrap();
    let mut children = [(); 3].map(|()| Working::start(place.path(), false));
    // Each has a case of its own before any goes on.
    let first = children.each_mut().map(|child| child.next().unwrap());
    fs::remove_file(gate).unwrap();
    let mut all = first.to_vec();
    for working in &mut children {
        all.extend(working.rest());
        assert!(working.child.wait().unwrap().success());
    }
    all.sort_unstable();
    assert_eq!(all, (0..CASES).collect::<Vec<_>>(), "each case by one of them");
    assert_complete(place.path());
}

#[test]
fn a_case_is_taken_while_another_is_at_it_and_free_when_that_one_is_gone() {
    let place = tempfile::tempdir().unwrap();
    let [one, other] = [(); 2].map(|()| Ledger::open(place.path(), &Value::Null).unwrap());
    let Claim::Mine(mine) = one.claim(&key(1)).unwrap() else { panic!("it is free") };
    assert!(matches!(other.claim(&key(1)).unwrap(), Claim::Taken));
    assert!(matches!(one.claim(&key(1)).unwrap(), Claim::Taken), "nor twice in one process");
    drop(mine);
    let Claim::Mine(mine) = other.claim(&key(1)).unwrap() else { panic!("it is free again") };
    mine.finish(&value(1)).unwrap();
    assert!(matches!(one.claim(&key(1)).unwrap(), Claim::Done(v) if v == value(1)));
    // The order of a key's members says nothing.
    let turned: Value = serde_json::from_str(r#"{ "cfl": 0.1, "case": 1 }"#).unwrap();
    assert!(matches!(one.claim(&turned).unwrap(), Claim::Done(_)));
}

#[test]
fn a_case_is_alone_unless_another_was_under_way() {
    let place = tempfile::tempdir().unwrap();
    let [one, other] = [(); 2].map(|()| Ledger::open(place.path(), &Value::Null).unwrap());
    let mine = |ledger: &'static str, claim| match claim {
        Claim::Mine(case) => case,
        _ => panic!("{ledger}: not free"),
    };
    let first = mine("one", one.claim(&key(1)).unwrap());
    assert!(first.alone().unwrap());
    let second = mine("other", other.claim(&key(2)).unwrap());
    assert!(!first.alone().unwrap() && !second.alone().unwrap());
    second.finish(&value(2)).unwrap();
    assert!(!first.alone().unwrap(), "another was finished in the meantime");
    first.finish(&value(1)).unwrap();
    let third = mine("one", one.claim(&key(3)).unwrap());
    assert!(third.alone().unwrap());
}

#[test]
fn damaged_lines_are_named_set_aside_and_free_again() {
    let place = tempfile::tempdir().unwrap();
    work(place.path(), |_| {});
    let file = place.path().join("cases.jsonl");
    let whole = fs::read_to_string(&file).unwrap();
    let mut lines: Vec<Vec<u8>> = whole.lines().map(|line| line.as_bytes().to_vec()).collect();
    let digit = lines[10].len() - 4;
    lines[10][digit] ^= 1;
    lines[20] = b"{\"key\":{\"case\":20},\"value\":1}".to_vec();
    lines[30].truncate(40);
    lines[40] = vec![0, 159, 146, 150, 0];
    let mut both = lines[51].clone();
    both.extend_from_slice(&lines[50]);
    lines[50] = both;
    lines.push(lines[60].clone());
    let mut bytes = lines.join(&b'\n');
    bytes.extend_from_slice(b"\n{\"sha256\":\"0011");
    fs::write(&file, bytes).unwrap();

    let ledger = Ledger::open(place.path(), &Value::Null).unwrap();
    let damaged = ledger.take_damaged();
    let numbers: Vec<_> = damaged.iter().map(|damage| damage.line).collect();
    assert_eq!(numbers, [11, 21, 31, 41, 51, 402]);
    assert!(damaged.iter().all(|damage| damage.file == file));
    assert!(damaged[0].problem.contains("checksum does not fit"), "{damaged:?}");
    assert!(damaged[1].problem.contains("does not start with a checksum"), "{damaged:?}");
    assert!(damaged[5].problem.contains("cut short"), "{damaged:?}");
    let aside = fs::read_to_string(place.path().join("damaged.jsonl")).unwrap();
    assert_eq!(aside.lines().count(), 6);
    let kept: Value = serde_json::from_str(aside.lines().nth(1).unwrap()).unwrap();
    assert_eq!(kept["line"], 21);
    assert_eq!(kept["text"], "{\"key\":{\"case\":20},\"value\":1}");

    for case in 0..CASES {
        let free = matches!(ledger.claim(&key(case)).unwrap(), Claim::Mine(_));
        // The line of 51 stands behind the one that swallowed its copy.
        assert_eq!(free, [10, 20, 30, 40, 50].contains(&case), "case {case}");
    }
    // Each is set aside once, and what is computed anew is kept.
    assert_eq!(Ledger::open(place.path(), &Value::Null).unwrap().take_damaged(), []);
    work(place.path(), |_| {});
    fs::write(&file, fs::read_to_string(&file).unwrap().replacen(&"x".repeat(300), "y", 1))
        .unwrap();
    assert_eq!(Ledger::open(place.path(), &Value::Null).unwrap().take_damaged().len(), 1);
}

#[test]
fn a_line_cut_short_by_another_process_is_met_before_the_next_is_written() {
    let place = tempfile::tempdir().unwrap();
    let ledger = Ledger::open(place.path(), &Value::Null).unwrap();
    let Claim::Mine(mine) = ledger.claim(&key(0)).unwrap() else { panic!("it is free") };
    let file = place.path().join("cases.jsonl");
    let append = |text: &[u8]| {
        let mut file: File = OpenOptions::new().append(true).open(&file).unwrap();
        file.write_all(text).unwrap();
    };
    append(b"{\"sha256\":\"00");
    mine.finish(&value(0)).unwrap();
    let damaged = ledger.take_damaged();
    assert_eq!(damaged.len(), 1);
    assert_eq!(damaged[0].line, 1);
    assert_eq!(lines(place.path()), [key(0)]);
    let again = Ledger::open(place.path(), &Value::Null).unwrap();
    assert!(again.take_damaged().is_empty() && again.finished().unwrap() == 1);
}

/// Runs in a child whose files may not grow beyond some kilobytes.
#[test]
#[ignore = "is started by the other test, in a process of its own"]
fn child_on_a_full_disk() {
    let Some(folder) = std::env::var_os(FOLDER) else { return };
    let ledger = Ledger::open(Path::new(&folder), &Value::Null).unwrap();
    let finish = |case: u64, value: &Value| {
        let Claim::Mine(mine) = ledger.claim(&key(case)).unwrap() else { panic!("it is free") };
        mine.finish(value)
    };
    finish(0, &value(0)).unwrap();
    let message = finish(1, &json!("x".repeat(100_000))).unwrap_err().to_string();
    assert!(message.contains("cannot write") && message.contains("cases.jsonl"), "{message}");
    // Less fits still, and the case is free.
    finish(1, &value(1)).unwrap();
}

#[cfg(unix)]
#[test]
fn a_full_disk_costs_the_case_that_met_it_and_no_other() {
    let place = tempfile::tempdir().unwrap();
    // The signal would end the process; ignored, the limit becomes an error of the write, as a full disk is.
    let output = Command::new("sh")
        .args([
            "-c",
            r#"trap '' XFSZ; ulimit -f 8; exec "$0" --exact child_on_a_full_disk --ignored"#,
        ])
        .arg(std::env::current_exe().unwrap())
        .env(FOLDER, place.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && said.contains("1 passed"), "{said}");
    let ledger = Ledger::open(place.path(), &Value::Null).unwrap();
    assert_eq!(ledger.take_damaged(), []);
    assert_eq!(lines(place.path()), [key(0), key(1)]);
}

#[test]
fn a_folder_that_cannot_be_is_named() {
    let place = tempfile::tempdir().unwrap();
    let file = place.path().join("file");
    fs::write(&file, "mine").unwrap();
    let message = Ledger::open(&file, &Value::Null).unwrap_err().to_string();
    assert!(message.contains("cannot make the folder") && message.contains("file"), "{message}");
}
