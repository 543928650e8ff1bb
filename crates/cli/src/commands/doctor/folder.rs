//! Whether a folder can hold studies: several processes lock files there, and files are put in place by renaming.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// A folder, and what it does not do.
pub(super) struct Folder {
    pub(super) path: PathBuf,
    pub(super) problems: Vec<String>,
}

/// A demand of studies on a folder: the purpose in words, and the trial in a folder of its own.
type Trial = (&'static str, fn(&Path) -> io::Result<()>);

const TRIALS: [Trial; 3] = [
    ("lock files: studies in one folder by several processes", lock),
    ("rename files over others: checkpoints and results", rename),
    ("force files onto the disk: checkpoints", force),
];

impl Folder {
    /// Tries all in a folder of its own, which is removed.
    pub(super) fn probe(path: &Path) -> Self {
        let mut problems = Vec::new();
        match tempfile::Builder::new().prefix(".mms-doctor-").tempdir_in(path) {
            Ok(own) => {
                for (purpose, trial) in TRIALS {
                    if let Err(cause) = trial(own.path()) {
                        problems.push(format!("cannot {purpose}: {cause}"));
                    }
                }
            }
            Err(cause) => problems.push(format!("cannot hold files: {cause}")),
        }
        Self { path: path.to_owned(), problems }
    }

    pub(super) fn text(&self) -> String {
        let shown = self.path.display();
        if self.problems.is_empty() {
            return format!(
                "folder {shown}: files can be locked, renamed and forced onto the disk\n"
            );
        }
        self.problems.iter().map(|problem| format!("folder {shown} {problem}\n")).collect()
    }
}

fn lock(folder: &Path) -> io::Result<()> {
    let path = folder.join("lock");
    let open = || OpenOptions::new().read(true).append(true).create(true).open(&path);
    let (first, second) = (open()?, open()?);
    first.lock()?;
    match second.try_lock() {
        Err(TryLockError::WouldBlock) => {}
        Err(TryLockError::Error(cause)) => return Err(cause),
        Ok(()) => return Err(io::Error::other("a locked file can be locked again")),
    }
    first.unlock()?;
    match second.try_lock() {
        Ok(()) => Ok(()),
        Err(TryLockError::WouldBlock) => Err(io::Error::other("a lock does not end")),
        Err(TryLockError::Error(cause)) => Err(cause),
    }
}

fn rename(folder: &Path) -> io::Result<()> {
    let (from, to) = (folder.join("new"), folder.join("old"));
    fs::write(&to, "old")?;
    fs::write(&from, "new")?;
    fs::rename(&from, &to)?;
    match fs::read(&to)?.as_slice() == b"new" && !from.exists() {
        true => Ok(()),
        false => Err(io::Error::other("the renamed file is not in place")),
    }
}

fn force(folder: &Path) -> io::Result<()> {
    let mut file = File::create(folder.join("forced"))?;
    file.write_all(b"forced")?;
    file.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_that_does_all_has_no_problems_and_keeps_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let found = Folder::probe(folder.path());
        assert_eq!(found.problems, Vec::<String>::new());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        let missing = Folder::probe(&folder.path().join("missing"));
        assert!(missing.text().contains("cannot hold files"), "{}", missing.text());
    }
}
