//! Each use of a file fails once: what was there before is whole, the message names the file, the exit status says it, and the same command
//! does its work afterwards.
//!
//! A library that is loaded before the C library counts the calls on files below a folder, and lets one fail (`failing_files.c`).

#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used)]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use serde_json::Value;

/// A call on files, with what comes before and after it.
struct Scenario {
    /// Files that are there first, with their texts.
    files: &'static [(&'static str, &'static str)],
    /// Calls that come before; one that starts with a percentage ends at a use of a file, so far through all of its uses.
    before: &'static [&'static str],
    /// The call whose uses of files fail.
    call: &'static str,
    /// Its exit status.
    status: i32,
    /// The call that then does the work; `run` goes on with `resume` where it has begun.
    after: &'static str,
}

const SPECIFICATION: &str = include_str!("../../../../mms-specs/bar.toml");
const RUN: &str = "run bar --cells 8 --periods 0.1 --threads 1 --json a.json --history h.csv --plot p.svg --vtk frames --frames 3";
const CHECKPOINT: &str = "run bar --cells 8 --periods 0.2 --threads 1 --json a.json --vtk frames --frames 4 --history h.csv \
                          --checkpoint kept --every 3";
const CONVERGE: &str =
    "converge bar --cells 4,8,16 --periods 0.05 --threads 1 --out study --json t.json";
const SHARD: &str =
    "converge bar --cells 4,8,16 --periods 0.05 --threads 1 --out study --shard 1/1";
const SCORE: &str = "score bar frames --json s.json";
const FRAMES: &str = "run bar --cells 8 --periods 0.1 --threads 1 --vtk frames --frames 3";
const GEN: &str = "gen bar --target numpy --out generated";
const OWN: &str = "run bar --cells 8 --periods 0.05 --threads 1 --json a.json";

const SCENARIOS: &[(&str, Scenario)] = &[
    ("run", Scenario { files: &[], before: &[], call: RUN, status: 0, after: RUN }),
    (
        "run again",
        Scenario {
            files: &[],
            before: &[
                "run bar --cells 4 --periods 0.1 --json a.json --history h.csv --plot p.svg --vtk frames --frames 2",
            ],
            call: RUN,
            status: 0,
            after: RUN,
        },
    ),
    (
        "checkpoint",
        Scenario { files: &[], before: &[], call: CHECKPOINT, status: 0, after: CHECKPOINT },
    ),
    (
        "another run's folder",
        Scenario {
            files: &[],
            before: &["50% run bar --cells 8 --periods 0.3 --checkpoint kept --every 3"],
            call: "run bar --cells 4 --periods 0.1 --checkpoint kept",
            status: 2,
            after: "resume kept",
        },
    ),
    (
        "resume",
        Scenario {
            files: &[],
            before: &[
                "70% run bar --cells 8 --periods 0.2 --threads 1 --json a.json --vtk frames --frames 4 --history h.csv --checkpoint kept --every 3",
            ],
            call: "resume kept",
            status: 0,
            after: "resume kept",
        },
    ),
    ("study", Scenario { files: &[], before: &[], call: CONVERGE, status: 1, after: CONVERGE }),
    (
        "study again",
        Scenario {
            files: &[],
            before: &[
                "60% converge bar --cells 4,8,16 --periods 0.05 --threads 1 --out study --json t.json",
            ],
            call: CONVERGE,
            status: 1,
            after: CONVERGE,
        },
    ),
    ("shard", Scenario { files: &[], before: &[], call: SHARD, status: 0, after: CONVERGE }),
    (
        "shard again",
        Scenario {
            files: &[],
            before: &[
                "60% converge bar --cells 4,8,16 --periods 0.05 --threads 1 --out study --shard 1/1",
            ],
            call: SHARD,
            status: 0,
            after: CONVERGE,
        },
    ),
    ("score", Scenario { files: &[], before: &[FRAMES], call: SCORE, status: 0, after: SCORE }),
    (
        "score of frames without a list",
        Scenario {
            files: &[],
            before: &[FRAMES, "- rm frames/bar.pvd"],
            call: SCORE,
            status: 0,
            after: SCORE,
        },
    ),
    ("generated code", Scenario { files: &[], before: &[], call: GEN, status: 0, after: GEN }),
    (
        "a specification of a folder",
        Scenario {
            files: &[("mms-specs/bar.toml", SPECIFICATION)],
            before: &[],
            call: OWN,
            status: 0,
            after: OWN,
        },
    ),
];

/// The library, built once.
fn library() -> &'static Path {
    static LIBRARY: OnceLock<(tempfile::TempDir, PathBuf)> = OnceLock::new();
    let (_, path) = LIBRARY.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("failing_files.so");
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cli/failing_files.c");
        let compiler = std::env::var_os("CC").unwrap_or_else(|| "cc".into());
        let built = Command::new(compiler)
            .args(["-O1", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", "-o"])
            .arg(&path)
            .arg(&source)
            .arg("-ldl")
            .status();
        assert!(built.unwrap().success());
        (folder, path)
    });
    path
}

/// The exit status, what was said on standard error, and which call failed on which file: none where there are fewer calls than `at`.
fn failing(place: &Path, call: &str, at: usize) -> (i32, String, Option<(String, PathBuf)>) {
    let log = tempfile::tempdir().unwrap();
    let log = log.path().join("log");
    let output = Command::new(env!("CARGO_BIN_EXE_mms"))
        .current_dir(place)
        .args(call.split_whitespace())
        .env("LD_PRELOAD", library())
        .env("FAIL_UNDER", place)
        .env("FAIL_AT", at.to_string())
        .env("FAIL_LOG", &log)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let failed = fs::read_to_string(&log).ok().map(|line| {
        let (kind, path) = line.split_once(' ').unwrap();
        (kind.to_owned(), path.into())
    });
    (output.status.code().unwrap_or(-1), said, failed)
}

/// The status and the messages of a call none of whose uses of files fails.
fn whole(place: &Path, call: &str) -> (i32, String) {
    let (status, said, failed) = failing(place, call, 0);
    assert_eq!(failed, None, "{call}");
    (status, said)
}

/// Entries that another run of the same would have, too.
fn lasting(value: &Value) -> Value {
    const TIMES: [&str; 6] =
        ["wall_s", "cpu_s", "particle_steps_per_s", "timed_alone", "timings", "sha256"];
    match value {
        Value::Object(members) => {
            let kept = members.iter().filter(|(name, _)| !TIMES.contains(&name.as_str()));
            Value::Object(kept.map(|(name, value)| (name.clone(), lasting(value))).collect())
        }
        Value::Array(entries) => entries.iter().map(lasting).collect(),
        other => other.clone(),
    }
}

/// The content of a file but for times; none where it says nothing that lasts.
fn content(path: &Path) -> Option<String> {
    let name = path.file_name().unwrap().to_str().unwrap();
    let bytes = fs::read(path).unwrap();
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("json") => Some(lasting(&serde_json::from_slice(&bytes).unwrap()).to_string()),
        // The numbers of the step and of the steps before, but for the time that they took.
        _ if name == "checkpoint" => Some(format!("{:?}", bytes.get(72..80))),
        _ if name == "lock" || path.extension().is_some_and(|e| e == "lock") => None,
        _ => Some(String::from_utf8_lossy(&bytes).into_owned()),
    }
}

/// The name under which all finished cases of a folder stand, whichever file has them.
const CASES: &str = "all cases";

/// The finished cases in a file but for times; parts of lines are none.
fn cases(path: &Path) -> BTreeSet<String> {
    let bytes = fs::read(path).unwrap();
    let text = String::from_utf8_lossy(&bytes);
    let whole = text.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let found = whole.filter(|line| line["key"]["settings"].is_object());
    found.map(|line| lasting(&line).to_string()).collect()
}

/// All files below a folder by their names there; those of cases together.
fn files(place: &Path) -> Files {
    fn add(folder: &Path, place: &Path, found: &mut Files, all: &mut BTreeSet<String>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                add(&path, place, found, all);
            } else if path.extension().is_some_and(|extension| extension == "jsonl") {
                all.extend(cases(&path));
            } else {
                let name = path.strip_prefix(place).unwrap().to_str().unwrap().to_owned();
                found.insert(name, content(&path));
            }
        }
    }
    let (mut found, mut all) = (Files::new(), BTreeSet::new());
    add(place, place, &mut found, &mut all);
    found.insert(CASES.to_owned(), Some(all.into_iter().collect::<Vec<_>>().join("\n")));
    found
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let to = to.join(path.file_name().unwrap());
        if path.is_dir() {
            copy(&path, &to);
        } else {
            fs::copy(&path, &to).unwrap();
        }
    }
}

/// A folder with one path, which runs remember, and its content at the beginning.
struct Place {
    folder: tempfile::TempDir,
    kept: tempfile::TempDir,
}

impl Place {
    /// The state that a scenario begins with.
    fn begin(scenario: &Scenario) -> Self {
        let [folder, kept] = [(); 2].map(|()| tempfile::tempdir().unwrap());
        let place = Self { folder, kept };
        for (name, text) in scenario.files {
            let path = place.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            // Another one than the library has.
            fs::write(path, text.replace("default = 0.01", "default = 0.02")).unwrap();
        }
        place.keep();
        for call in scenario.before {
            if let Some(name) = call.strip_prefix("- rm ") {
                fs::remove_file(place.path().join(name)).unwrap();
            } else if let Some((share, call)) = call.split_once("% ") {
                place.end_within(call, share.parse().unwrap());
            } else {
                let (status, said) = whole(place.path(), call);
                assert!(status < 2, "{call}: {said}");
            }
            place.keep();
        }
        place
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Takes what is there for its content at the beginning, from now on.
    fn keep(&self) {
        clear(self.kept.path());
        copy(self.path(), self.kept.path());
    }

    /// As it began.
    fn anew(&self) -> &Path {
        clear(self.path());
        copy(self.kept.path(), self.path());
        self.path()
    }

    /// Does what a call does that ends at a use of a file, so many hundredths through all of its uses or at the next one without which it does
    /// not go on.
    fn end_within(&self, call: &str, share: usize) {
        let uses = (1..).map(|n| 16 * n).find(|at| failing(self.anew(), call, *at).2.is_none());
        let first = uses.unwrap() * share / 100;
        (first..).find(|at| failing(self.anew(), call, *at).0 == 2).unwrap();
    }
}

fn clear(folder: &Path) {
    fs::remove_dir_all(folder).unwrap();
    fs::create_dir(folder).unwrap();
}

/// Whether each line is one of the other text.
fn is_part(lines: &Option<String>, of: &Option<String>) -> bool {
    let of: BTreeSet<&str> = of.iter().flat_map(|text| text.lines()).collect();
    lines.iter().flat_map(|text| text.lines()).all(|line| of.contains(line))
}

/// The name of the file that is written in the end, whatever its temporary name.
fn name_of(path: &Path) -> String {
    let name = path.file_name().unwrap().to_str().unwrap();
    let name = name.strip_suffix(".tmp").unwrap_or(name);
    match name.split_once(".mms-") {
        Some((name, _)) => name.trim_start_matches('.').to_owned(),
        None => name.to_owned(),
    }
}

/// The files of a folder by their names, each with its content.
type Files = BTreeMap<String, Option<String>>;

/// The files of a scenario without failures.
struct Expected {
    before: Files,
    after: Files,
    /// After the call that then does the work, and the status of that.
    in_the_end: Files,
    status_in_the_end: i32,
}

impl Expected {
    fn of(place: &Place, scenario: &Scenario) -> Self {
        let before = files(place.anew());
        let (status, said) = whole(place.path(), scenario.call);
        assert_eq!(status, scenario.status, "{}: {said}", scenario.call);
        let after = files(place.path());
        let (status_in_the_end, _) = whole(place.path(), scenario.then(place.path()));
        Self { before, after, in_the_end: files(place.path()), status_in_the_end }
    }

    /// The fault of what a call has left, one of whose uses of files failed, if it has one.
    fn fault(
        &self,
        scenario: &Scenario,
        left: &Files,
        failed: &Path,
        (status, said): &(i32, String),
    ) -> Option<String> {
        let is_whole = |(name, content): &(&String, &Option<String>)| {
            let (now, after) = (left.get(*name), self.after.get(*name));
            // A list of frames begins anew and grows with each of them, as cases do from those that were there.
            let is_list = (name.ends_with(".pvd")
                || *name == CASES && is_part(content, &now.cloned().flatten()))
                && now.zip(after).is_some_and(|(now, after)| is_part(now, after));
            now == Some(*content) || now == after || is_list
        };
        if let Some((file, _)) = self.before.iter().find(|entry| !is_whole(entry)) {
            return Some(format!("{file} is neither what it was nor what it is to be"));
        }
        let is_named =
            [failed, failed.parent().unwrap()].map(name_of).iter().any(|name| said.contains(name));
        match *status {
            // Refused, as it would have been anyway.
            2 if scenario.status == 2 || is_named => None,
            2 => Some("the message does not name the file".to_owned()),
            status if status == scenario.status => {
                let other =
                    self.after.iter().find(|(name, content)| left.get(*name) != Some(content));
                other
                    .map(|(file, _)| format!("status {status}, and {file} is not what it is to be"))
            }
            status => Some(format!("status {status}")),
        }
    }

    /// The fault of what was made of that afterwards.
    fn fault_in_the_end(&self, left: &Files, status: i32) -> Option<String> {
        let names = |files: &Files| -> Vec<String> {
            // Locks that nobody holds change nothing.
            let is_extra = |name: &str| name.ends_with("lock");
            files.keys().filter(|name| !is_extra(name)).cloned().collect()
        };
        let other = self.in_the_end.iter().find(|(name, content)| left.get(*name) != Some(content));
        if status != self.status_in_the_end {
            Some(format!("status {status}"))
        } else if let Some((file, _)) = other {
            Some(format!("{file} is not what it is to be"))
        } else if names(left) != names(&self.in_the_end) {
            Some(format!("{:?} instead of {:?}", names(left), names(&self.in_the_end)))
        } else {
            None
        }
    }
}

impl Scenario {
    /// The call that does the work in the end: a run that has begun goes on.
    fn then(&self, place: &Path) -> &'static str {
        let has_begun = place.join("kept/run.json").exists() && self.call.contains("--checkpoint");
        if has_begun { "resume kept" } else { self.after }
    }

    /// Lets every use of a file fail that `is_tried`, by its number; gives how many did, or what went wrong.
    fn fails_well(&self, name: &str, is_tried: impl Fn(usize) -> bool) -> Result<usize, String> {
        let place = Place::begin(self);
        let expected = Expected::of(&place, self);
        let (mut wrong, mut tried) = (Vec::new(), 0);
        for at in (1..).filter(|at| is_tried(*at)) {
            let (status, said, failed) = failing(place.anew(), self.call, at);
            let Some((kind, path)) = failed else { break };
            tried += 1;
            let shown = path.strip_prefix(place.path()).unwrap().display();
            let found = (status, said);
            let left = files(place.path());
            if let Some(fault) = expected.fault(self, &left, &path, &found) {
                wrong.push(format!("{name}, {at}: {kind} {shown}: {fault}\n{}", found.1));
            }
            let after = self.then(place.path());
            let (status, said) = whole(place.path(), after);
            if let Some(fault) = expected.fault_in_the_end(&files(place.path()), status) {
                wrong.push(format!(
                    "{name}, {at}: {kind} {shown}: afterwards, mms {after}: {fault}\n{said}"
                ));
            }
        }
        if wrong.is_empty() {
            Ok(tried)
        } else {
            Err(format!("{} of {tried} failures:\n{}", wrong.len(), wrong.join("\n")))
        }
    }
}

/// The number of failures in all scenarios, of each those that `is_tried` says by the number of the use.
fn all(is_tried: impl Fn(usize) -> bool) -> usize {
    let found = SCENARIOS.iter().map(|(name, scenario)| {
        let found = scenario.fails_well(name, &is_tried);
        assert_ne!(found, Ok(0), "{name}");
        found
    });
    let (tried, wrong): (Vec<_>, Vec<_>) = found.partition(Result::is_ok);
    let wrong: Vec<String> = wrong.into_iter().filter_map(Result::err).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    tried.into_iter().flatten().sum()
}

#[test]
#[ignore = "minutes: .ci/long runs it"]
fn every_use_of_a_file_may_fail() {
    let tried = all(|_| true);
    println!("{tried} uses of files in {} scenarios", SCENARIOS.len());
    assert!(tried > 500, "{tried}");
}

/// A few of each scenario, always the same.
#[test]
fn some_uses_of_files_may_fail() {
    all(|at| at % 19 == 2);
}
