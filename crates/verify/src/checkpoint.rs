//! Runs that survive being killed: everything that the next step needs, written down every so often.
//!
//! A checkpoint holds the solver's numbers and what was measured so far, in this machine's byte order, and ends with the
//! SHA-256 of all before. It is written beside the last one and takes its name once it is on the disk: a kill at any
//! moment leaves one that is whole. Its folder is locked for as long as the run lives.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use mmsmith_measure::norms::{PerField, PerNorm};
use sha2::{Digest, Sha256};
use thiserror::Error;

use crate::history::{Moment, Sums};
use crate::whole_file::WholeFile;

/// How every checkpoint begins.
const MAGIC: &[u8; 24] = b"mmsmith checkpoint 3\n\0\0\0";
const FILE: &str = "checkpoint";
const LOCK: &str = "lock";

/// A folder for checkpoints that no other process, and nobody else in this one, writes to.
///
/// The lock goes with the value, or with the process.
#[derive(Debug)]
pub struct CheckpointFolder {
    path: PathBuf,
    /// Closing it gives the lock back.
    _lock: File,
}

impl CheckpointFolder {
    /// Locks `folder`, which must exist, and removes what a killed run has left of a checkpoint that it was writing.
    ///
    /// # Errors
    ///
    /// [`CheckpointError::Busy`] while a run lives that keeps its state there; where the folder cannot be written to.
    pub fn lock(folder: &Path) -> Result<Self, CheckpointError> {
        let path = folder.join(LOCK);
        let fail =
            |cause| CheckpointError::FileSystem { action: "lock", path: path.clone(), cause };
        // Its content does not matter, and is left as it is.
        let file = OpenOptions::new().read(true).append(true).create(true).open(&path);
        let file = file.map_err(fail)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(CheckpointError::Busy { folder: folder.to_owned() });
            }
            // Then the user takes care of it, as ever.
            Err(TryLockError::Error(cause)) if cause.kind() == io::ErrorKind::Unsupported => {}
            Err(TryLockError::Error(cause)) => return Err(fail(cause)),
        }
        WholeFile::sweep(&folder.join(FILE));
        Ok(Self { path: folder.to_owned(), _lock: file })
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// Where and how often a run writes down its state, and whether it goes on from there.
#[derive(Debug)]
pub struct Checkpoints {
    /// The folder.
    pub folder: CheckpointFolder,
    /// After how many steps a checkpoint is written, each time.
    pub every: u64,
    /// What tells this run from others: a checkpoint of another one is refused.
    pub identity: [u8; 32],
    /// Whether to go on from the folder's checkpoint; without one the run starts from its beginning.
    pub resume: bool,
}

/// A checkpoint could not be written or read.
#[derive(Debug, Error)]
pub enum CheckpointError {
    /// The file system refuses.
    // The message has the cause, which is therefore no `source`: whoever prints both would print it twice.
    #[error("{path}: cannot {action} the checkpoint: {cause}", path = path.display())]
    FileSystem {
        /// What was tried.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// Why.
        cause: io::Error,
    },
    /// Another run keeps its state in the folder.
    #[error(
        "{folder}: a process is at work on the run of this folder; wait for its end, or stop it first",
        folder = folder.display()
    )]
    Busy {
        /// The folder.
        folder: PathBuf,
    },
    /// The file is not what was written.
    #[error(
        "{path}: the checkpoint is damaged ({what}); delete it to start this run from its beginning",
        path = path.display()
    )]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: &'static str,
    },
    /// It belongs to another run.
    #[error(
        "{path}: the checkpoint belongs to another run: resume with the version of mmsmith, the specification and the \
         settings that wrote it, or choose another folder",
        path = path.display()
    )]
    OtherRun {
        /// The file.
        path: PathBuf,
    },
}

/// How far a run is, beside the solver's own state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reached {
    pub(crate) step: u64,
    pub(crate) wall_s: f64,
    pub(crate) cpu_s: f64,
    pub(crate) errors: PerField<PerNorm<f64>>,
}

impl Reached {
    /// How many numbers it is: the step, two times, and three norms of four fields.
    const NUMBERS: usize = 15;

    fn numbers(&self) -> Vec<u64> {
        let errors = self.errors.iter();
        let errors = errors.flat_map(|(_, norms)| norms.iter().map(|(_, e)| e.to_bits()));
        [self.step, self.wall_s.to_bits(), self.cpu_s.to_bits()].into_iter().chain(errors).collect()
    }

    fn from_numbers(numbers: &[u64]) -> Option<Self> {
        let (&[step, wall_s, cpu_s], errors) = numbers.split_first_chunk()?;
        let (norms, rest) = errors.as_chunks::<3>();
        let norm = |[linf, l2, l1]: [u64; 3]| {
            let [linf, l2, l1] = [linf, l2, l1].map(f64::from_bits);
            PerNorm { linf, l2, l1 }
        };
        let (&[u, v, F, P], []) = (norms, rest) else { return None };
        let errors = PerField { u: norm(u), v: norm(v), F: norm(F), P: norm(P) };
        let [wall_s, cpu_s] = [wall_s, cpu_s].map(f64::from_bits);
        Some(Self { step, wall_s, cpu_s, errors })
    }
}

/// What a run has come to: how far it is, and its history until then.
#[derive(Debug)]
pub(crate) struct TakenUp {
    pub(crate) reached: Reached,
    pub(crate) history: Vec<Moment>,
}

/// A history as numbers: how many axes there are, and what each moment has.
fn numbers_of_history(history: &[Moment]) -> Vec<u64> {
    let axes = history.first().map_or(0, |moment| moment.computed.momentum.len());
    let mut numbers = vec![axes as u64];
    for Moment { step, time, velocity_time, u, computed, exact } in history {
        numbers.push(*step);
        let mut add = |value: f64| numbers.push(value.to_bits());
        [*time, *velocity_time, u.linf, u.l2, u.l1].into_iter().for_each(&mut add);
        for Sums { kinetic_energy, strain_energy, momentum } in [computed, exact] {
            [*kinetic_energy, *strain_energy].iter().chain(momentum).copied().for_each(&mut add);
        }
    }
    numbers
}

fn history_of_numbers(numbers: &[u64]) -> Option<Vec<Moment>> {
    let (&axes, moments) = numbers.split_first()?;
    let axes = usize::try_from(axes).ok().filter(|axes| *axes <= 3)?;
    let moments = moments.chunks(10 + 2 * axes).map(|numbers| {
        let (&[step], rest) = numbers.split_first_chunk()?;
        let rest: Vec<f64> = rest.iter().copied().map(f64::from_bits).collect();
        let (&[time, velocity_time, linf, l2, l1], rest) = rest.split_first_chunk()?;
        let sums = |numbers: &[f64]| {
            let (&[kinetic_energy, strain_energy], momentum) = numbers.split_first_chunk()?;
            Some(Sums { kinetic_energy, strain_energy, momentum: momentum.to_vec() })
        };
        let (computed, exact) = rest.split_at_checked(2 + axes)?;
        let (computed, exact) = (sums(computed)?, sums(exact)?);
        let u = PerNorm { linf, l2, l1 };
        let is_whole = exact.momentum.len() == axes;
        is_whole.then_some(Moment { step, time, velocity_time, u, computed, exact })
    });
    moments.collect()
}

impl Checkpoints {
    fn path(&self) -> PathBuf {
        self.folder.path.join(FILE)
    }

    /// Writes a checkpoint in place of the last one.
    pub(crate) fn write(
        &self,
        reached: &Reached,
        history: &[Moment],
        state: &[&mut [u8]],
    ) -> Result<(), CheckpointError> {
        let path = self.path();
        let written = (|| {
            let file = WholeFile::create(&path)?;
            let mut out = Hashing { inner: BufWriter::new(file), hash: Sha256::new() };
            out.write_all(MAGIC)?;
            out.write_all(&self.identity)?;
            let numbers = [reached.numbers(), numbers_of_history(history)].concat();
            let lengths = state.iter().map(|array| array.len() as u64);
            let counts = [numbers.len() as u64, state.len() as u64];
            for number in counts.into_iter().chain(numbers).chain(lengths) {
                out.write_all(&number.to_le_bytes())?;
            }
            state.iter().try_for_each(|array| out.write_all(array))?;
            let Hashing { mut inner, hash } = out;
            inner.write_all(&hash.finalize())?;
            inner.into_inner().map_err(io::IntoInnerError::into_error)?.finish()
        })();
        written.map_err(|cause| CheckpointError::FileSystem { action: "write", path, cause })
    }

    /// Puts the checkpoint's numbers in place of `state`, and tells how far the run was; nothing where there is no checkpoint.
    pub(crate) fn read(&self, state: &mut [&mut [u8]]) -> Result<Option<TakenUp>, CheckpointError> {
        let path = self.path();
        let fail =
            |cause| CheckpointError::FileSystem { action: "read", path: path.clone(), cause };
        let damaged = |what| CheckpointError::Damaged { path: path.clone(), what };
        // Whole before anything is taken from it.
        match is_whole(&path) {
            Ok(true) => {}
            Ok(false) => return Err(damaged("its checksum does not match")),
            Err(cause) if cause.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(cause) => return Err(fail(cause)),
        }
        let mut file = BufReader::new(File::open(&path).map_err(fail)?);
        let mut take = |bytes: &mut [u8]| file.read_exact(bytes).map_err(fail);
        let mut magic = [0; MAGIC.len()];
        take(&mut magic)?;
        let mut identity = [0; 32];
        take(&mut identity)?;
        if magic != *MAGIC || identity != self.identity {
            return Err(CheckpointError::OtherRun { path: path.clone() });
        }
        let mut number = || {
            let mut bytes = [0; 8];
            take(&mut bytes).map(|()| u64::from_le_bytes(bytes))
        };
        let (numbers, arrays) = (number()?, number()?);
        if arrays != state.len() as u64 {
            return Err(damaged("it holds another number of arrays than this run has"));
        }
        let numbers = (0..numbers).map(|_| number()).collect::<Result<Vec<_>, _>>()?;
        for array in &*state {
            if number()? != array.len() as u64 {
                return Err(damaged("an array is not as long as this run's"));
            }
        }
        let taken_up = numbers.split_at_checked(Reached::NUMBERS).and_then(|(reached, history)| {
            let (reached, history) =
                (Reached::from_numbers(reached)?, history_of_numbers(history)?);
            Some(TakenUp { reached, history })
        });
        let taken_up = taken_up.ok_or_else(|| damaged("errors or moments are missing"))?;
        state.iter_mut().try_for_each(|array| take(array))?;
        Ok(Some(taken_up))
    }
}

/// Whether a file ends with the SHA-256 of all before.
fn is_whole(path: &Path) -> io::Result<bool> {
    let mut file = File::open(path)?;
    let Some(length) = file.metadata()?.len().checked_sub(32) else { return Ok(false) };
    let mut hash = Sha256::new();
    let mut body = Read::by_ref(&mut file).take(length);
    io::copy(&mut body, &mut hash)?;
    let mut expected = [0; 32];
    file.read_exact(&mut expected)?;
    Ok(hash.finalize()[..] == expected)
}

/// A writer that hashes what passes through.
struct Hashing<W> {
    inner: W,
    hash: Sha256,
}

impl<W: Write> Write for Hashing<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.inner.write(bytes)?;
        self.hash.update(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn checkpoints(folder: &Path) -> Checkpoints {
        let folder = CheckpointFolder::lock(folder).unwrap();
        Checkpoints { folder, every: 1, identity: [7; 32], resume: true }
    }

    fn reached() -> Reached {
        let norm = |x: f64| PerNorm { linf: x, l2: 0.1 * x, l1: -0.0 };
        let errors = PerField { u: norm(1.0), v: norm(2.0), F: norm(f64::NAN), P: norm(1e-300) };
        Reached { step: 12, wall_s: 0.3, cpu_s: 0.4, errors }
    }

    fn history(axes: usize) -> Vec<Moment> {
        let sums = |x: f64| Sums {
            kinetic_energy: x,
            strain_energy: -0.0,
            momentum: (0..axes).map(|axis| x + axis as f64).collect(),
        };
        let moment = |step: u64| Moment {
            step,
            time: 0.1 * step as f64,
            velocity_time: -0.05,
            u: PerNorm { linf: 1e-3, l2: 1e-4, l1: 0.0 },
            computed: sums(0.7),
            exact: sums(1e-300),
        };
        (0..3).map(moment).collect()
    }

    #[test]
    fn what_was_written_is_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let checkpoints = checkpoints(folder.path());
        let (mut a, mut b) = ([1, 2, 3], []);
        assert!(checkpoints.read(&mut [&mut a[..]]).unwrap().is_none());
        for history in [vec![], history(1), history(3)] {
            checkpoints.write(&reached(), &history, &[&mut a[..], &mut b[..]]).unwrap();
            let mut c = [0; 3];
            let found = checkpoints.read(&mut [&mut c[..], &mut b[..]]).unwrap().unwrap();
            assert_eq!((c, found.reached.numbers()), (a, reached().numbers()));
            assert_eq!(numbers_of_history(&found.history), numbers_of_history(&history));
        }
    }

    #[test]
    fn any_damage_is_noticed_before_the_state_is_touched() {
        let folder = tempfile::tempdir().unwrap();
        let mut checkpoints = checkpoints(folder.path());
        let mut a = [9; 40];
        checkpoints.write(&reached(), &history(2), &[&mut a[..]]).unwrap();
        let whole = fs::read(checkpoints.path()).unwrap();
        for at in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[at] ^= 1;
            fs::write(checkpoints.path(), &bytes).unwrap();
            let mut b = [0; 40];
            assert!(checkpoints.read(&mut [&mut b[..]]).is_err(), "byte {at}");
            fs::write(checkpoints.path(), &whole[..at]).unwrap();
            assert!(checkpoints.read(&mut [&mut b[..]]).is_err(), "cut at {at}");
            assert_eq!(b, [0; 40]);
        }
        fs::write(checkpoints.path(), &whole).unwrap();
        let mut short = [0; 39];
        let error = checkpoints.read(&mut [&mut short[..]]).unwrap_err();
        assert!(error.to_string().contains("not as long"), "{error}");
        checkpoints.identity = [8; 32];
        let error = checkpoints.read(&mut [&mut a[..]]).unwrap_err();
        assert!(matches!(error, CheckpointError::OtherRun { .. }));
    }

    #[test]
    fn a_folder_has_one_run_at_a_time_and_is_swept_when_it_is_taken() {
        let folder = tempfile::tempdir().unwrap();
        let left = folder.path().join(".checkpoint.mms-0123456789.tmp");
        fs::write(&left, "part").unwrap();
        let first = CheckpointFolder::lock(folder.path()).unwrap();
        assert!(!left.exists());
        let error = CheckpointFolder::lock(folder.path()).unwrap_err();
        assert!(matches!(&error, CheckpointError::Busy { folder: busy } if busy == folder.path()));
        drop(first);
        CheckpointFolder::lock(folder.path()).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn no_link_is_followed() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("target");
        fs::write(&target, "mine").unwrap();
        for name in ["checkpoint.tmp", "checkpoint"] {
            std::os::unix::fs::symlink(&target, folder.path().join(name)).unwrap();
        }
        checkpoints(folder.path()).write(&reached(), &[], &[]).unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"mine");
    }

    #[test]
    fn a_cause_is_told_once() {
        let folder = tempfile::tempdir().unwrap();
        let error = CheckpointFolder::lock(&folder.path().join("none")).unwrap_err();
        assert!(std::error::Error::source(&error).is_none());
        assert_eq!(error.to_string().matches("os error").count(), 1, "{error}");
    }
}
