//! Runs that survive being killed: everything that the next step needs, written down every so often.
//!
//! A checkpoint holds the solver's numbers and what was measured so far, in this machine's byte order, and ends with the
//! SHA-256 of all before. It is written beside the last one and takes its name once it is on the disk: a kill at any
//! moment leaves one that is whole.

use std::fs::{self, File};
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};
use thiserror::Error;

use crate::norms::{PerField, PerNorm};

/// How every checkpoint begins.
const MAGIC: &[u8; 24] = b"mmsmith checkpoint 2\n\0\0\0";
const FILE: &str = "checkpoint";

/// Where and how often a run writes down its state, and whether it goes on from there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Checkpoints {
    /// The folder; it must exist.
    pub folder: PathBuf,
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
    #[error("{path}: cannot {action} the checkpoint: {cause}", path = path.display())]
    FileSystem {
        /// What was tried.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        cause: io::Error,
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
    const NUMBERS: u64 = 15;

    fn numbers(&self) -> Vec<u64> {
        let errors = self.errors.named();
        let errors = errors.iter().flat_map(|(_, norms)| norms.named().map(|(_, e)| e.to_bits()));
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

impl Checkpoints {
    fn path(&self) -> PathBuf {
        self.folder.join(FILE)
    }

    /// Writes a checkpoint in place of the last one.
    pub(crate) fn write(
        &self,
        reached: &Reached,
        state: &[&mut [u8]],
    ) -> Result<(), CheckpointError> {
        let path = self.path();
        let next = path.with_extension("tmp");
        let written = (|| {
            let mut out =
                Hashing { inner: BufWriter::new(File::create(&next)?), hash: Sha256::new() };
            out.write_all(MAGIC)?;
            out.write_all(&self.identity)?;
            let numbers = reached.numbers();
            let lengths = state.iter().map(|array| array.len() as u64);
            let counts = [numbers.len() as u64, state.len() as u64];
            for number in counts.into_iter().chain(numbers).chain(lengths) {
                out.write_all(&number.to_le_bytes())?;
            }
            state.iter().try_for_each(|array| out.write_all(array))?;
            let Hashing { mut inner, hash } = out;
            inner.write_all(&hash.finalize())?;
            inner.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()?;
            fs::rename(&next, &path)
        })();
        written.map_err(|cause| CheckpointError::FileSystem { action: "write", path, cause })
    }

    /// Puts the checkpoint's numbers in place of `state`, and tells how far the run was; nothing where there is no checkpoint.
    pub(crate) fn read(&self, state: &mut [&mut [u8]]) -> Result<Option<Reached>, CheckpointError> {
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
        if numbers != Reached::NUMBERS || arrays != state.len() as u64 {
            return Err(damaged("it holds another number of arrays than this run has"));
        }
        let numbers = (0..numbers).map(|_| number()).collect::<Result<Vec<_>, _>>()?;
        for array in &*state {
            if number()? != array.len() as u64 {
                return Err(damaged("an array is not as long as this run's"));
            }
        }
        state.iter_mut().try_for_each(|array| take(array))?;
        let reached = Reached::from_numbers(&numbers).ok_or_else(|| damaged("errors are missing"));
        reached.map(Some)
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

    fn checkpoints(folder: &Path) -> Checkpoints {
        Checkpoints { folder: folder.to_owned(), every: 1, identity: [7; 32], resume: true }
    }

    fn reached() -> Reached {
        let norm = |x: f64| PerNorm { linf: x, l2: 0.1 * x, l1: -0.0 };
        let errors = PerField { u: norm(1.0), v: norm(2.0), F: norm(f64::NAN), P: norm(1e-300) };
        Reached { step: 12, wall_s: 0.3, cpu_s: 0.4, errors }
    }

    #[test]
    fn what_was_written_is_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let checkpoints = checkpoints(folder.path());
        let (mut a, mut b) = ([1, 2, 3], []);
        assert!(checkpoints.read(&mut [&mut a[..]]).unwrap().is_none());
        checkpoints.write(&reached(), &[&mut a[..], &mut b[..]]).unwrap();
        let mut c = [0; 3];
        let found = checkpoints.read(&mut [&mut c[..], &mut b[..]]).unwrap().unwrap();
        assert_eq!((c, found.numbers()), (a, reached().numbers()));
    }

    #[test]
    fn any_damage_is_noticed_before_the_state_is_touched() {
        let folder = tempfile::tempdir().unwrap();
        let checkpoints = checkpoints(folder.path());
        let mut a = [9; 40];
        checkpoints.write(&reached(), &[&mut a[..]]).unwrap();
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
        let other = Checkpoints { identity: [8; 32], ..checkpoints.clone() };
        let error = other.read(&mut [&mut a[..]]).unwrap_err();
        assert!(matches!(error, CheckpointError::OtherRun { .. }));
        let mut short = [0; 39];
        let error = checkpoints.read(&mut [&mut short[..]]).unwrap_err();
        assert!(error.to_string().contains("not as long"), "{error}");
    }
}
