//! Finished cases of a study, kept in a folder that several processes may share.
//!
//! A case has a key, which says everything that its result depends on, and a value, the result. Both are JSON. The
//! folder holds
//!
//! - `cases.jsonl`: one line for each finished case, `{"sha256":"...","key":...,"value":...}`, only ever appended to.
//!   The checksum is that of the rest of the line.
//! - `damaged.jsonl`: lines of `cases.jsonl` that could not be trusted. They are set aside when they are met: blanked
//!   where they stood, so that no other line moves, and their cases are free to be computed again.
//! - `claims/`: a lock file for each case under way, and `lock`, which orders the processes.
//! - `cases-I-of-N.jsonl`: the cases of a [`Shard`], in the same form. One process at a time appends to it, and takes no locks, so
//!   that the folder may lie on a file system of many machines. Its lines are read when a ledger or a shard is opened. Damaged lines
//!   are reported, and stay.
//!
//! A line of another form begins with `{"format":` and its number. No version writes one yet; a folder that has some is refused as one of a
//! later version, and nothing in it is changed.
//!
//! A process that is killed loses the cases that it had claimed and not finished, and no others: its locks vanish with
//! it, and a line that it had not written whole is set aside. Lines are handed to the system one by one and not forced
//! onto the disk, so a power failure may cost the last few.
//!
//! ```
//! use mmsmith_ledger::{Claim, Ledger};
//! use serde_json::json;
//!
//! # let folder = tempfile::tempdir()?;
//! let ledger = Ledger::open(folder.path(), &json!("this build"))?;
//! let key = json!({ "cells": 32, "cfl": 0.4 });
//! match ledger.claim(&key)? {
//!     Claim::Done(value) => println!("known already: {value}"),
//!     Claim::Taken => println!("another process is at it"),
//!     Claim::Mine(case) => case.finish(&json!({ "error": 1.6e-2 }))?,
//! }
//! assert!(matches!(ledger.claim(&key)?, Claim::Done(_)));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod line;
mod shard;

use std::collections::HashMap;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use serde_json::{Value, json};
use thiserror::Error;

pub use line::canonical;
pub use shard::{Shard, ShardName};

/// The finished cases of a study.
pub struct Ledger {
    folder: PathBuf,
    state: Mutex<State>,
}

/// Contents known of the case file, and the handles to the file.
struct State {
    /// Held while the case file is read or written.
    lock: File,
    cases: File,
    /// Where the next line to be read starts, and its number from 1.
    offset: u64,
    line: usize,
    /// Values by the text of their keys.
    values: HashMap<String, Value>,
    /// Values from the shards' files, by the text of their keys.
    shards: HashMap<String, Value>,
    damaged: Vec<Damage>,
}

/// A line that was set aside.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// The file it stood in.
    pub file: PathBuf,
    /// Its number, from 1.
    pub line: usize,
    /// The fault of the line.
    pub problem: &'static str,
    /// The file to which the line was moved; `None` where it stays, as in the file of a shard.
    pub moved_to: Option<PathBuf>,
}

/// State of a case for the process that asks for it.
#[derive(Debug)]
pub enum Claim<'a> {
    /// The case is finished, with this value.
    Done(Value),
    /// Another process, or another thread, is computing the case.
    Taken,
    /// The case is the caller's to compute.
    Mine(Case<'a>),
}

/// A case that the holder computes. A case that is dropped unfinished is free again.
pub struct Case<'a> {
    ledger: &'a Ledger,
    key: String,
    claim: File,
    path: PathBuf,
    /// Whether no other case was under way when this case was claimed, and how many cases were finished then.
    alone: bool,
    finished_before: usize,
}

/// Why a ledger could not be read or written.
#[derive(Debug, Error)]
pub enum LedgerError {
    /// The system refused a file or folder.
    // The message has the cause, which is therefore no `source`: whoever prints both would print it twice.
    #[error("cannot {action} {}: {cause}", path.display())]
    System {
        /// The operation that was tried.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// Why it failed.
        cause: io::Error,
    },
    /// A later version wrote lines in a form that this one does not know. Nothing is changed then.
    #[error(
        "{} was written by a later version of mmsmith, in a form that this one does not know: use that version, or another folder",
        path.display()
    )]
    LaterVersion {
        /// The file.
        path: PathBuf,
    },
    /// The cases of a shard have another origin, so that their results may differ.
    #[error("{} has cases of another origin: {found}, not {expected}", path.display())]
    OtherOrigin {
        /// The file.
        path: PathBuf,
        /// The origin that it states.
        found: Value,
        /// The origin that was asked for.
        expected: Value,
    },
}

const CASES: &str = "cases.jsonl";
const DAMAGED: &str = "damaged.jsonl";
const LOCK: &str = "lock";
const CLAIMS: &str = "claims";

impl Ledger {
    /// Opens the ledger in `folder`, which is created where it is missing, sets damaged lines aside, and reads the cases of its shards.
    /// The shards have to be of `origin`, which states everything that results depend on beside their keys.
    ///
    /// # Errors
    ///
    /// Where the folder or its files cannot be read or written, and where a shard is of another origin.
    pub fn open(folder: &Path, origin: &Value) -> Result<Self, LedgerError> {
        let claims = folder.join(CLAIMS);
        fs::create_dir_all(&claims).map_err(error("make the folder", &claims))?;
        let open = |name: &str| {
            let path = folder.join(name);
            let options = OpenOptions::new().read(true).append(true).create(true).open(&path);
            options.map_err(error("open", &path))
        };
        let state = State {
            lock: open(LOCK)?,
            cases: open(CASES)?,
            offset: 0,
            line: 1,
            values: HashMap::new(),
            shards: HashMap::new(),
            damaged: Vec::new(),
        };
        let ledger = Self { folder: folder.to_owned(), state: Mutex::new(state) };
        let shards = shard::read_all(folder, origin)?;
        ledger.with_lock(|state| {
            state.damaged.extend(shards.damaged);
            state.shards = shards.values;
            Ok(())
        })?;
        Ok(ledger)
    }

    /// The case of `key`: its value if it is finished, or else the right to compute it, unless another process has that right.
    ///
    /// A caller that meets [`Claim::Taken`] asks again later: the case will be done, or free if its holder was killed.
    ///
    /// # Errors
    ///
    /// Where the files cannot be read or written.
    pub fn claim(&self, key: &Value) -> Result<Claim<'_>, LedgerError> {
        let key = canonical(key);
        let path = self.folder.join(CLAIMS).join(format!("{}.lock", line::sum(key.as_bytes())));
        self.with_lock(|state| {
            if let Some(value) = state.values.get(&key).or_else(|| state.shards.get(&key)) {
                return Ok(Claim::Done(value.clone()));
            }
            let alone = self.nobody_at_work(None)?;
            let Some(claim) = try_lock(&path)? else { return Ok(Claim::Taken) };
            let finished_before = state.values.len();
            Ok(Claim::Mine(Case { ledger: self, key, claim, path, alone, finished_before }))
        })
    }

    /// The number of finished cases: cases of other processes count, cases of shards do not.
    ///
    /// # Errors
    ///
    /// Where the file cannot be read.
    pub fn finished(&self) -> Result<usize, LedgerError> {
        self.with_lock(|state| Ok(state.values.len()))
    }

    /// The lines that this ledger set aside since the last call, or since it was opened.
    #[must_use]
    pub fn take_damaged(&self) -> Vec<Damage> {
        std::mem::take(&mut self.state().damaged)
    }

    /// The file that damaged lines are moved to.
    fn damaged_file(&self) -> PathBuf {
        self.folder.join(DAMAGED)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Every change to the state is whole before anything can panic.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Calls `work` with the newest state while no other process and no other thread reads or writes the ledger.
    fn with_lock<R>(
        &self,
        work: impl FnOnce(&mut State) -> Result<R, LedgerError>,
    ) -> Result<R, LedgerError> {
        let mut state = self.state();
        let path = self.folder.join(LOCK);
        state.lock.lock().map_err(error("lock", &path))?;
        let outcome = self.read_on(&mut state).and_then(|()| work(&mut state));
        let unlocked = state.lock.unlock().map_err(error("unlock", &path));
        let result = outcome?;
        unlocked.map(|()| result)
    }

    /// Reads the lines that were added since the last call, and sets damaged lines aside.
    fn read_on(&self, state: &mut State) -> Result<(), LedgerError> {
        let path = self.folder.join(CASES);
        let length = state.cases.metadata().map_err(error("read", &path))?.len();
        if length < state.offset {
            // Somebody has cut the file; its present content holds.
            (state.offset, state.line) = (0, 1);
            state.values.clear();
        }
        if length == state.offset {
            return Ok(());
        }
        let mut bytes = Vec::new();
        let cases = &mut state.cases;
        cases.seek(SeekFrom::Start(state.offset)).map_err(error("read", &path))?;
        cases.read_to_end(&mut bytes).map_err(error("read", &path))?;

        let mut bad: Vec<(Damage, Range<usize>)> = Vec::new();
        let mut start = 0;
        let mut number = state.line;
        while start < bytes.len() {
            let length = bytes[start..].iter().position(|&byte| byte == b'\n');
            let end = length.map_or(bytes.len(), |length| start + length);
            let text = &bytes[start..end];
            let outcome = match length {
                None => Err(line::TORN),
                Some(_) if text.iter().all(u8::is_ascii_whitespace) => Ok(None),
                Some(_) => line::read(text).map(Some),
            };
            match outcome {
                Ok(None) => {}
                // Of two lines for one case every reader takes the first.
                Ok(Some((key, value))) => {
                    state.values.entry(key).or_insert(value);
                }
                Err(line::LATER) => return Err(LedgerError::LaterVersion { path }),
                Err(problem) => {
                    let moved_to = Some(self.damaged_file());
                    let damage = Damage { file: path.clone(), line: number, problem, moved_to };
                    bad.push((damage, start..end));
                }
            }
            start = end + 1;
            number += 1;
        }
        let first = state.offset;
        state.damaged.extend(bad.iter().map(|(damage, _)| damage.clone()));
        self.set_aside(first, &bytes, &bad)?;
        let torn = bad.last().filter(|(_, range)| range.end == bytes.len());
        let read = torn.map_or(bytes.len(), |(_, range)| range.start);
        (state.offset, state.line) = (first + read as u64, number - usize::from(torn.is_some()));
        Ok(())
    }

    /// Copies the damaged `ranges` of `bytes`, which start at `first`, to the file of damaged lines, and blanks them.
    fn set_aside(
        &self,
        first: u64,
        bytes: &[u8],
        bad: &[(Damage, Range<usize>)],
    ) -> Result<(), LedgerError> {
        if bad.is_empty() {
            return Ok(());
        }
        let aside = self.damaged_file();
        let mut text = String::new();
        for (damage, range) in bad {
            let found = String::from_utf8_lossy(&bytes[range.clone()]);
            let entry = json!({ "line": damage.line, "problem": damage.problem, "text": found });
            text.push_str(&format!("{entry}\n"));
        }
        let file = OpenOptions::new().append(true).create(true).open(&aside);
        let write = |mut file: File| file.write_all(text.as_bytes());
        file.and_then(write).map_err(error("write", &aside))?;
        let path = self.folder.join(CASES);
        let blank = || -> io::Result<()> {
            let mut file = OpenOptions::new().write(true).open(&path)?;
            for (_, range) in bad {
                if range.end == bytes.len() {
                    file.set_len(first + range.start as u64)?;
                } else {
                    file.seek(SeekFrom::Start(first + range.start as u64))?;
                    file.write_all(&vec![b' '; range.len()])?;
                }
            }
            Ok(())
        };
        blank().map_err(error("mend", &path))
    }

    /// Whether no case is under way except the case that `own` claims.
    fn nobody_at_work(&self, own: Option<&Path>) -> Result<bool, LedgerError> {
        let claims = self.folder.join(CLAIMS);
        for entry in fs::read_dir(&claims).map_err(error("read", &claims))? {
            let path = entry.map_err(error("read", &claims))?.path();
            if own == Some(path.as_path()) {
                continue;
            }
            let file = match File::open(&path) {
                Ok(file) => file,
                // The case was finished in the meantime.
                Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
                Err(source) => return Err(error("open", &path)(source)),
            };
            match file.try_lock_shared() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => return Ok(false),
                Err(TryLockError::Error(source)) => return Err(error("lock", &path)(source)),
            }
        }
        Ok(true)
    }
}

impl Case<'_> {
    /// Keeps `value` as the result of this case.
    ///
    /// # Errors
    ///
    /// Where the line cannot be written whole, as on a full disk; nothing of it is left in the file then.
    pub fn finish(self, value: &Value) -> Result<(), LedgerError> {
        let text = line::write(&self.key, value);
        let cases = self.ledger.folder.join(CASES);
        self.ledger.with_lock(|state| {
            // The lock on the ledger is held, and every line before ends where reading has ended.
            if let Err(source) = state.cases.write_all(text.as_bytes()) {
                // Should this fail too, the next reader sets the part aside.
                let _ = state.cases.set_len(state.offset);
                return Err(error("write", &cases)(source));
            }
            state.offset += text.len() as u64;
            state.line += 1;
            state.values.entry(self.key.clone()).or_insert_with(|| value.clone());
            Ok(())
        })?;
        // A process that locks the file in the meantime finds the case finished.
        let _ = fs::remove_file(&self.path);
        Ok(())
    }

    /// Whether no other case was under way at any time since this one was claimed, in this process or another.
    ///
    /// Times measured otherwise are times of a shared machine.
    ///
    /// # Errors
    ///
    /// Where the ledger cannot be read.
    pub fn alone(&self) -> Result<bool, LedgerError> {
        self.ledger.with_lock(|state| {
            let unchanged = state.values.len() == self.finished_before;
            Ok(self.alone && unchanged && self.ledger.nobody_at_work(Some(&self.path))?)
        })
    }
}

impl Drop for Case<'_> {
    fn drop(&mut self) {
        // Closing the file would do; where that fails, nobody can be told.
        let _ = self.claim.unlock();
    }
}

impl std::fmt::Debug for Case<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Case").field("key", &self.key).finish_non_exhaustive()
    }
}

impl std::fmt::Debug for Ledger {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Ledger").field("folder", &self.folder).finish_non_exhaustive()
    }
}

/// The file at `path`, locked; `None` where another process holds the lock.
fn try_lock(path: &Path) -> Result<Option<File>, LedgerError> {
    let options = OpenOptions::new().read(true).append(true).create(true).open(path);
    let file = options.map_err(error("open", path))?;
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(TryLockError::WouldBlock) => Ok(None),
        Err(TryLockError::Error(source)) => Err(error("lock", path)(source)),
    }
}

fn error<'a>(action: &'static str, path: &'a Path) -> impl FnOnce(io::Error) -> LedgerError + 'a {
    move |cause| LedgerError::System { action, path: path.to_owned(), cause }
}
