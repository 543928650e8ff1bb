//! Files that earlier versions wrote: kept in `tests/data/kept`, a folder for each version, and read by this one.
//!
//! A version that is published adds a folder: the commands are in its `README.md`.

#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};

use mmsmith_ledger::{Claim, Ledger, Shard, ShardName};
use mmsmith_tests::{json_as_judged, mms, outcome, workspace};
use serde_json::Value;

/// The folders of the versions.
fn versions() -> Vec<PathBuf> {
    let all = fs::read_dir(workspace().join("tests/data/kept")).unwrap();
    let folders: Vec<_> = all.map(|entry| entry.unwrap().path()).collect();
    assert!(!folders.is_empty());
    folders
}

/// The files of a folder in another one, where they may be written to.
fn copied(from: &Path) -> tempfile::TempDir {
    let place = tempfile::tempdir().unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        fs::copy(&path, place.path().join(path.file_name().unwrap())).unwrap();
    }
    place
}

/// Keys and values of the lines of a file, by the form of a line alone.
fn lines(path: &Path) -> Vec<(Value, Value)> {
    let text = fs::read_to_string(path).unwrap();
    let pair = |line: &str| {
        let mut case: Value = serde_json::from_str(line).unwrap();
        (case["key"].take(), case["value"].take())
    };
    text.lines().map(pair).collect()
}

#[test]
fn studies_and_their_shards_are_read() {
    for version in versions() {
        let study = copied(&version.join("study"));
        let ledger = Ledger::open(study.path(), &Value::Null).unwrap();
        let cases = lines(&version.join("study/cases.jsonl"));
        assert!(cases.len() > 1);
        for (key, value) in cases {
            let found = ledger.claim(&key).unwrap();
            assert!(matches!(&found, Claim::Done(kept) if *kept == value), "{key}: {found:?}");
        }
        assert_eq!(ledger.take_damaged(), []);

        let shards = copied(&version.join("shards"));
        let cases = |index: usize| lines(&version.join(format!("shards/cases-{index}-of-2.jsonl")));
        let origin = cases(1)[0].1.clone();
        let shard = Shard::open(shards.path(), ShardName::new(1, 2).unwrap(), &origin).unwrap();
        for (key, value) in [1, 2].into_iter().flat_map(|index| cases(index).into_iter().skip(1)) {
            assert_eq!(shard.value(&key), Some(value), "{key}");
        }
        assert_eq!(shard.take_damaged(), []);
    }
}

#[test]
fn a_study_goes_on_where_another_version_began_it() {
    for version in versions() {
        let study = copied(&version.join("study"));
        let folder = study.path().to_str().unwrap();
        let call = ["converge", "axis-aligned-1d", "--cells", "4,8", "--out", folder];
        let (status, _, errors) = outcome(mms().args(call));
        assert_eq!(status, Some(0), "{errors}");
        // Cases of another build are computed anew, and those that were there stay.
        assert!(!study.path().join("damaged.jsonl").exists(), "{errors}");
        let kept = fs::read_to_string(version.join("study/cases.jsonl")).unwrap();
        let found = fs::read_to_string(study.path().join("cases.jsonl")).unwrap();
        assert!(found.starts_with(&kept), "{found}");

        let shards = copied(&version.join("shards"));
        let folder = shards.path().to_str().unwrap();
        let call =
            ["converge", "axis-aligned-1d", "--cells", "4,8", "--out", folder, "--shard", "1/2"];
        let (status, _, errors) = outcome(mms().args(call));
        assert_eq!(status, Some(2), "{errors}");
        assert!(errors.contains("by another build of mms"), "{errors}");
    }
}

#[test]
fn particle_files_have_the_score_that_they_had() {
    for version in versions() {
        let frames = version.join("frames");
        let found = json_as_judged(&["score", "axis-aligned-1d", frames.to_str().unwrap()]);
        let kept = fs::read_to_string(version.join("documents/score.json")).unwrap();
        let kept: Value = serde_json::from_str(&kept).unwrap();
        let mut compared = 0;
        for field in ["u", "v", "F", "P"] {
            for norm in ["linf", "l2", "l1"] {
                let [a, b] =
                    [&kept, &found].map(|of| of["rows"][0]["errors"][field][norm].as_f64());
                let (Some(a), Some(b)) = (a, b) else {
                    assert_eq!(a, b, "{field} {norm}");
                    continue;
                };
                // Fields may round otherwise.
                assert!((a - b).abs() <= 1e-9 * a.abs(), "{field} {norm}: {a:e} {b:e}");
                compared += 1;
            }
        }
        assert!(compared >= 6, "{compared}");
    }
}

#[test]
fn a_run_that_was_begun_by_another_version_is_begun_anew_or_refused_by_name() {
    for version in versions() {
        let place = copied(&version.join("checkpoint"));
        let (status, _, errors) = outcome(mms().arg("resume").arg(place.path()));
        // What its checkpoint holds is of another build.
        let is_named = errors.contains("resume with the version of mmsmith");
        assert!(status == Some(0) || (status == Some(2) && is_named), "{status:?}: {errors}");
    }
}
