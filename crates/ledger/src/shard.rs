//! Cases of a study that many machines share, each appending to a file of its own.

use std::collections::HashMap;
use std::fmt;
use std::fs::{self, File, OpenOptions};
use std::io::{ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use serde_json::{Value, json};

use crate::{CASES, Damage, LedgerError, canonical, error, line};

/// The number of a shard, from 1, and the number of all shards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShardName {
    index: usize,
    count: usize,
}

impl ShardName {
    /// Shard `index` of `count`; `None` unless 1 <= `index` <= `count`.
    #[must_use]
    pub fn new(index: usize, count: usize) -> Option<Self> {
        (1..=count).contains(&index).then_some(Self { index, count })
    }

    /// The number of shards.
    #[must_use]
    pub fn count(self) -> usize {
        self.count
    }

    /// Tells for each of the cases with these costs whether it belongs to this shard. Cases are dealt out from dear to cheap, each to
    /// the shard with the least cost so far.
    ///
    /// Every case belongs to exactly one shard.
    #[must_use]
    pub fn own(self, costs: &[f64]) -> Vec<bool> {
        let mut order: Vec<usize> = (0..costs.len()).collect();
        order.sort_by(|&a, &b| costs[b].total_cmp(&costs[a]));
        // Cost and number of cases, so that cases without cost are spread as well.
        let mut loads = vec![(0.0, 0_usize); self.count];
        let mut own = vec![false; costs.len()];
        for case in order {
            let least = (0..self.count).min_by(|&a, &b| {
                f64::total_cmp(&loads[a].0, &loads[b].0).then(loads[a].1.cmp(&loads[b].1))
            });
            let Some(shard) = least else { continue };
            loads[shard].0 += costs[case];
            loads[shard].1 += 1;
            own[case] = shard + 1 == self.index;
        }
        own
    }
}

impl fmt::Display for ShardName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

/// The finished cases of a folder, and the file to which one shard appends its cases.
///
/// ```
/// use mmsmith_ledger::{Shard, ShardName};
/// use serde_json::json;
///
/// # let folder = tempfile::tempdir()?;
/// let name = ShardName::new(1, 2).expect("the first of two");
/// let shard = Shard::open(folder.path(), name, &json!("this build"))?;
/// let key = json!({ "cells": 32, "cfl": 0.4 });
/// assert_eq!(shard.value(&key), None);
/// shard.finish(&key, &json!({ "error": 1.6e-2 }))?;
/// assert!(shard.value(&key).is_some());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Shard {
    path: PathBuf,
    state: Mutex<State>,
}

struct State {
    file: File,
    values: HashMap<String, Value>,
    damaged: Vec<Damage>,
}

impl Shard {
    /// Opens the file of the shard `name` in `folder`, creates both where they are missing, and reads the finished cases of all shards
    /// and of the folder's ledger.
    ///
    /// # Errors
    ///
    /// Where the folder or its files cannot be read or written, and where a shard has another origin than `origin`, which states
    /// everything that results depend on beside their keys.
    pub fn open(folder: &Path, name: ShardName, origin: &Value) -> Result<Self, LedgerError> {
        fs::create_dir_all(folder).map_err(error("make the folder", folder))?;
        let mut found = read_all(folder, origin)?;
        let cases = folder.join(CASES);
        match fs::read(&cases) {
            // The ledger itself reports its damaged lines.
            Ok(bytes) => {
                for (_, outcome) in lines(&bytes) {
                    match outcome {
                        Ok((key, value)) => {
                            found.values.entry(key).or_insert(value);
                        }
                        Err(line::LATER) => return Err(LedgerError::LaterVersion { path: cases }),
                        Err(_) => {}
                    }
                }
            }
            Err(cause) if cause.kind() == ErrorKind::NotFound => {}
            Err(cause) => return Err(error("read", &cases)(cause)),
        }
        let ShardName { index, count } = name;
        let path = folder.join(format!("cases-{index}-of-{count}.jsonl"));
        let file = OpenOptions::new().read(true).append(true).create(true).open(&path);
        let mut file = file.map_err(error("open", &path))?;
        // A line that was cut short gets its end, so that the next one is whole.
        if !ends_a_line(&mut file).map_err(error("read", &path))? {
            file.write_all(b"\n").map_err(error("write", &path))?;
        }
        let state = State { file, values: found.values, damaged: found.damaged };
        let shard = Self { path, state: Mutex::new(state) };
        shard.append(&canonical(&json!(ORIGIN)), origin)?;
        Ok(shard)
    }

    /// The value of the case of `key`, if the case is finished.
    #[must_use]
    pub fn value(&self, key: &Value) -> Option<Value> {
        self.state().values.get(&canonical(key)).cloned()
    }

    /// Keeps `value` as the result of the case of `key`.
    ///
    /// # Errors
    ///
    /// Where the line cannot be written whole, as on a full disk. A part of a line is ignored by readers.
    pub fn finish(&self, key: &Value, value: &Value) -> Result<(), LedgerError> {
        let key = canonical(key);
        self.append(&key, value)?;
        self.state().values.insert(key, value.clone());
        Ok(())
    }

    /// The damaged lines that were met since the last call, or since the shard was opened.
    #[must_use]
    pub fn take_damaged(&self) -> Vec<Damage> {
        std::mem::take(&mut self.state().damaged)
    }

    fn append(&self, key: &str, value: &Value) -> Result<(), LedgerError> {
        let text = line::write(key, value);
        self.state().file.write_all(text.as_bytes()).map_err(error("write", &self.path))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Every change to the state is whole before anything can panic.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Debug for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Shard").field("path", &self.path).finish_non_exhaustive()
    }
}

/// The key under which a shard's file states its origin.
const ORIGIN: &str = "origin";

/// Contents of the files of all shards.
#[derive(Default)]
pub(crate) struct Found {
    pub(crate) values: HashMap<String, Value>,
    pub(crate) damaged: Vec<Damage>,
}

/// Reads the files of all shards in `folder`, which have to be of `origin`.
///
/// # Errors
///
/// Where a file cannot be read, or has another origin.
pub(crate) fn read_all(folder: &Path, origin: &Value) -> Result<Found, LedgerError> {
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder).map_err(error("read", folder))? {
        let path = entry.map_err(error("read", folder))?.path();
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        if name.starts_with("cases-") && name.ends_with(".jsonl") {
            paths.push(path);
        }
    }
    // Of two lines for one case every reader takes the first.
    paths.sort();
    let stated = canonical(&json!(ORIGIN));
    let mut found = Found::default();
    for path in paths {
        let bytes = fs::read(&path).map_err(error("read", &path))?;
        for (number, outcome) in lines(&bytes) {
            match outcome {
                Ok((key, value)) if key == stated => {
                    if value != *origin {
                        let expected = origin.clone();
                        return Err(LedgerError::OtherOrigin { path, found: value, expected });
                    }
                }
                Ok((key, value)) => {
                    found.values.entry(key).or_insert(value);
                }
                // The shard may be writing this line now, or was killed while it wrote.
                Err(line::TORN) => {}
                Err(line::LATER) => return Err(LedgerError::LaterVersion { path }),
                Err(problem) => found.damaged.push(Damage {
                    file: path.clone(),
                    line: number,
                    problem,
                    moved_to: None,
                }),
            }
        }
    }
    Ok(found)
}

/// Number, from 1, and content of each line that is not blank.
fn lines(bytes: &[u8]) -> impl Iterator<Item = (usize, Result<(String, Value), &'static str>)> {
    bytes.split_inclusive(|&byte| byte == b'\n').enumerate().filter_map(|(index, text)| {
        let outcome = match text.strip_suffix(b"\n") {
            None => Err(line::TORN),
            Some(text) if text.iter().all(u8::is_ascii_whitespace) => return None,
            Some(text) => line::read(text),
        };
        Some((index + 1, outcome))
    })
}

/// Whether a file is empty or ends with the end of a line.
fn ends_a_line(file: &mut File) -> std::io::Result<bool> {
    if file.metadata()?.len() == 0 {
        return Ok(true);
    }
    file.seek(SeekFrom::End(-1))?;
    let mut last = [0];
    file.read_exact(&mut last)?;
    Ok(last == *b"\n")
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn shard(folder: &Path, index: usize) -> Shard {
        Shard::open(folder, ShardName::new(index, 2).unwrap(), &json!("one")).unwrap()
    }

    #[test]
    fn what_one_shard_has_finished_all_know() {
        let folder = tempfile::tempdir().unwrap();
        let first = shard(folder.path(), 1);
        first.finish(&json!(1), &json!(0.1)).unwrap();
        assert_eq!(shard(folder.path(), 2).value(&json!(1)), Some(json!(0.1)));
        let ledger = crate::Ledger::open(folder.path(), &json!("one")).unwrap();
        assert!(
            matches!(ledger.claim(&json!(1)).unwrap(), crate::Claim::Done(value) if value == 0.1)
        );
        let crate::Claim::Mine(case) = ledger.claim(&json!(2)).unwrap() else { panic!() };
        case.finish(&json!(0.2)).unwrap();
        assert_eq!(shard(folder.path(), 1).value(&json!(2)), Some(json!(0.2)));
    }

    #[test]
    fn a_shard_that_was_killed_at_any_byte_loses_one_case_at_most() {
        let folder = tempfile::tempdir().unwrap();
        let first = shard(folder.path(), 1);
        for case in 0..3 {
            first.finish(&json!(case), &json!(case)).unwrap();
        }
        let path = folder.path().join("cases-1-of-2.jsonl");
        let whole = fs::read(&path).unwrap();
        for length in 0..whole.len() {
            fs::write(&path, &whole[..length]).unwrap();
            let again = shard(folder.path(), 1);
            let ends = whole[..length].iter().filter(|&&byte| byte == b'\n').count();
            // The first line is no case.
            let known = (0..3).filter(|case| again.value(&json!(case)).is_some()).count();
            assert_eq!(known, ends.saturating_sub(1), "cut at {length}");
            again.finish(&json!("more"), &json!(length)).unwrap();
            let value = shard(folder.path(), 2).value(&json!("more"));
            assert_eq!(value, Some(json!(length)), "cut at {length}");
        }
    }

    #[test]
    fn a_damaged_line_is_told_and_stays() {
        let folder = tempfile::tempdir().unwrap();
        shard(folder.path(), 1).finish(&json!(1), &json!(0.1)).unwrap();
        let path = folder.path().join("cases-1-of-2.jsonl");
        let text = fs::read_to_string(&path).unwrap().replace("0.1", "0.2");
        fs::write(&path, &text).unwrap();
        let ledger = crate::Ledger::open(folder.path(), &json!("one")).unwrap();
        let damaged = ledger.take_damaged();
        assert_eq!(damaged.len(), 1);
        assert_eq!((&damaged[0].file, damaged[0].line, &damaged[0].moved_to), (&path, 2, &None));
        assert_eq!(fs::read_to_string(&path).unwrap(), text);
    }

    #[test]
    fn a_shard_of_another_origin_is_refused_with_its_file() {
        let folder = tempfile::tempdir().unwrap();
        drop(shard(folder.path(), 1));
        let name = ShardName::new(2, 2).unwrap();
        for error in [
            Shard::open(folder.path(), name, &json!("another")).unwrap_err(),
            crate::Ledger::open(folder.path(), &json!("another")).unwrap_err(),
        ] {
            let LedgerError::OtherOrigin { path, found, .. } = &error else { panic!("{error}") };
            assert_eq!(
                (path.file_name().unwrap(), found),
                ("cases-1-of-2.jsonl".as_ref(), &json!("one"))
            );
        }
    }

    #[test]
    fn lines_of_a_later_version_are_refused_and_stay() {
        let folder = tempfile::tempdir().unwrap();
        let later = "{\"format\":2,\"case\":[1,2]}\n";
        for name in [CASES, "cases-2-of-2.jsonl"] {
            let path = folder.path().join(name);
            fs::write(&path, later).unwrap();
            let name = ShardName::new(1, 2).unwrap();
            for error in [
                crate::Ledger::open(folder.path(), &json!("one")).unwrap_err(),
                Shard::open(folder.path(), name, &json!("one")).unwrap_err(),
            ] {
                assert!(error.to_string().contains("a later version of mmsmith"), "{error}");
            }
            assert_eq!(fs::read_to_string(&path).unwrap(), later);
            assert!(!folder.path().join("damaged.jsonl").exists());
            fs::remove_file(&path).unwrap();
        }
    }

    proptest! {
        #[test]
        fn each_case_is_of_one_shard_and_none_has_much_more_than_its_part(
            costs in proptest::collection::vec(0.0..100.0_f64, 0..60),
            count in 1..12_usize,
        ) {
            let own: Vec<Vec<bool>> = (1..=count)
                .map(|index| ShardName::new(index, count).unwrap().own(&costs))
                .collect();
            for case in 0..costs.len() {
                prop_assert_eq!(own.iter().filter(|own| own[case]).count(), 1);
            }
            let load = |own: &Vec<bool>| -> f64 {
                costs.iter().zip(own).filter(|(_, own)| **own).map(|(cost, _)| cost).sum()
            };
            // Graham's bound of this order: the mean and the dearest case.
            let part = costs.iter().sum::<f64>() / count as f64;
            let dearest = costs.iter().copied().fold(0.0, f64::max);
            for own in &own {
                prop_assert!(load(own) <= part + dearest + 1e-9);
            }
        }
    }

    #[test]
    fn shards_are_counted_from_one() {
        assert_eq!((ShardName::new(0, 2), ShardName::new(3, 2)), (None, None));
        assert_eq!(ShardName::new(2, 2).unwrap().to_string(), "2/2");
    }
}
