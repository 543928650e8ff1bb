//! Runs that survive being killed: everything that the next step needs, written down every so often.
//!
//! A checkpoint holds the solver's numbers and what was measured so far, in this machine's byte order, and ends with the
//! SHA-256 of all before. It is written beside the last one and takes its name once it is on the disk: a kill at any
//! moment leaves one that is whole. Its folder is locked for as long as the run lives.
//!
//! Where several processes run, each writes a file with its part of the solver's numbers. The first one's is the checkpoint: it takes
//! its name after all others are on the disk, and lists their checksums. Any number of processes goes on with it.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, BufReader, BufWriter, Read, Seek, Write};
use std::path::{Path, PathBuf};

use mmsmith_measure::norms::{PerField, PerNorm};
use mmsmith_mpm::{SavedState, SavedStateError};
use mmsmith_ranks::{Ranks, gather, share};
use sha2::{Digest, Sha256};
use thiserror::Error;

use crate::history::{Moment, Sums};
use crate::whole_file::WholeFile;

/// How every checkpoint begins.
const MAGIC: &[u8; 24] = b"mmsmith checkpoint 5\n\0\0\0";
const FILE: &str = "checkpoint";
const LOCK: &str = "lock";

/// A folder for checkpoints that no other process, and nobody else in this one, writes to.
///
/// The lock goes with the value, or with the process.
#[derive(Debug)]
pub struct CheckpointFolder {
    path: PathBuf,
    /// Closing it gives the lock back. The first of several processes has it.
    _lock: Option<File>,
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
        Ok(Self { path: folder.to_owned(), _lock: Some(file) })
    }

    /// The folder, for one of several processes that run together, of which the first locks it.
    #[must_use]
    pub fn of_first(folder: &Path) -> Self {
        Self { path: folder.to_owned(), _lock: None }
    }

    /// The step after which the last checkpoint of a folder was written, as far as its beginning tells; none without a checkpoint.
    ///
    /// # Errors
    ///
    /// Where there is one that cannot be read.
    pub fn reached(folder: &Path) -> Result<Option<u64>, CheckpointError> {
        let path = folder.join(FILE);
        // How it begins, what run it is of, two counts, and the step.
        let mut head = [0; MAGIC.len() + 32 + 3 * 8];
        match File::open(&path).and_then(|mut file| file.read_exact(&mut head)) {
            Ok(()) => Ok(head.last_chunk().map(|step| u64::from_le_bytes(*step))),
            Err(cause) => match cause.kind() {
                // Whoever goes on with a part of one is told then.
                io::ErrorKind::NotFound | io::ErrorKind::UnexpectedEof => Ok(None),
                _ => Err(CheckpointError::FileSystem { action: "read", path, cause }),
            },
        }
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
    /// Identity of this run: a checkpoint of another run is refused.
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
        /// The operation that was tried.
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
        /// The fault.
        what: &'static str,
    },
    /// The solver cannot go on from it.
    #[error("{path}: the checkpoint is not one of this run: {cause}", path = path.display())]
    State {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: SavedStateError,
    },
    /// Another process could not write or read its part.
    #[error("{message}")]
    Elsewhere {
        /// The error there.
        message: String,
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
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Reached {
    pub(crate) step: u64,
    pub(crate) wall_s: f64,
    pub(crate) cpu_s: f64,
    pub(crate) errors: PerField<PerNorm<f64>>,
    /// Errors of internal variables.
    pub(crate) internal: Vec<(String, PerNorm<f64>)>,
}

impl Reached {
    /// How many numbers it is: the step, two times, three norms of four fields, and how many internal variables there are.
    const NUMBERS: usize = 16;

    fn numbers(&self) -> Vec<u64> {
        let errors = self.errors.iter();
        let errors = errors.flat_map(|(_, norms)| norms.iter().map(|(_, e)| e.to_bits()));
        let times = [self.step, self.wall_s.to_bits(), self.cpu_s.to_bits()];
        let count = [self.internal.len() as u64];
        let internal = self.internal.iter().flat_map(|(name, norms)| {
            let letters = name.bytes().map(u64::from);
            let norms = norms.iter().map(|(_, e)| e.to_bits()).collect::<Vec<_>>();
            [name.len() as u64].into_iter().chain(letters).chain(norms)
        });
        times.into_iter().chain(errors).chain(count).chain(internal).collect()
    }

    /// From the first numbers, and what is left of them.
    fn from_numbers(numbers: &[u64]) -> Option<(Self, &[u64])> {
        let (numbers, mut left) = numbers.split_at_checked(Self::NUMBERS)?;
        let (&count, numbers) = numbers.split_last()?;
        let (&[step, wall_s, cpu_s], errors) = numbers.split_first_chunk()?;
        let (norms, rest) = errors.as_chunks::<3>();
        let norm = |[linf, l2, l1]: [u64; 3]| {
            let [linf, l2, l1] = [linf, l2, l1].map(f64::from_bits);
            PerNorm { linf, l2, l1 }
        };
        let (&[u, v, F, P], []) = (norms, rest) else { return None };
        let errors = PerField { u: norm(u), v: norm(v), F: norm(F), P: norm(P) };
        let [wall_s, cpu_s] = [wall_s, cpu_s].map(f64::from_bits);
        let mut internal = Vec::new();
        for _ in 0..count {
            let (&length, rest) = left.split_first()?;
            let (letters, rest) = rest.split_at_checked(usize::try_from(length).ok()?)?;
            let (&norms, rest) = rest.split_first_chunk()?;
            let letters = letters.iter().map(|&letter| u8::try_from(letter).ok());
            let name = String::from_utf8(letters.collect::<Option<_>>()?).ok()?;
            internal.push((name, norm(norms)));
            left = rest;
        }
        Some((Self { step, wall_s, cpu_s, errors, internal }, left))
    }
}

/// State of a run that goes on: how far it is, its history until then, and the parts of the solver's state that this process has read.
#[derive(Debug)]
pub(crate) struct TakenUp {
    pub(crate) reached: Reached,
    pub(crate) history: Vec<Moment>,
    pub(crate) parts: Vec<SavedState>,
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

/// The SHA-256 at the end of a file, as four numbers.
type Checksum = [u64; 4];

/// The content of one process's file.
struct Part {
    /// In the first one's, how far the run is, and its history. In the others', nothing.
    numbers: Vec<u64>,
    /// In the first one's, the checksums of the other processes' files.
    others: Vec<Checksum>,
    state: SavedState,
}

impl Checkpoints {
    fn path(&self) -> PathBuf {
        self.folder.path.join(FILE)
    }

    /// The file of another process than the first one, of the checkpoint after `step`.
    fn path_of(&self, step: u64, rank: usize) -> PathBuf {
        self.folder.path.join(format!("{FILE}-{step}-{rank}"))
    }

    /// The checkpoint could not be gone on from.
    pub(crate) fn refusal(&self, cause: SavedStateError) -> CheckpointError {
        CheckpointError::State { path: self.path(), cause }
    }

    /// Writes a checkpoint in place of the last one; a call of all processes.
    pub(crate) fn write(
        &self,
        ranks: Option<&dyn Ranks>,
        reached: &Reached,
        history: &[Moment],
        state: &[&[u8]],
    ) -> Result<(), CheckpointError> {
        let rank = ranks.map_or(0, Ranks::rank);
        let mut others = Vec::new();
        if let Some(ranks) = ranks {
            let own = match rank {
                0 => Ok(None),
                _ => self.write_part(&self.path_of(reached.step, rank), &[], &[], state).map(Some),
            };
            let own: Vec<Checksum> = agree(Some(ranks), own)?.into_iter().collect();
            others = gather(ranks, &own);
        }
        let written = match rank {
            0 => {
                let numbers = [reached.numbers(), numbers_of_history(history)].concat();
                self.write_part(&self.path(), &numbers, &others, state).map(drop)
            }
            _ => Ok(()),
        };
        agree(ranks, written)?;
        if rank == 0 {
            self.sweep(reached.step);
        }
        Ok(())
    }

    fn write_part(
        &self,
        path: &Path,
        numbers: &[u64],
        others: &[Checksum],
        state: &[&[u8]],
    ) -> Result<Checksum, CheckpointError> {
        let written = (|| {
            let file = WholeFile::create(path)?;
            let mut out = Hashing { inner: BufWriter::new(file), hash: Sha256::new() };
            out.write_all(MAGIC)?;
            out.write_all(&self.identity)?;
            let lengths = state.iter().map(|array| array.len() as u64);
            let counts = [numbers.len() as u64, state.len() as u64];
            let others =
                std::iter::once(others.len() as u64).chain(others.iter().copied().flatten());
            for number in
                counts.into_iter().chain(numbers.iter().copied()).chain(lengths).chain(others)
            {
                out.write_all(&number.to_le_bytes())?;
            }
            state.iter().try_for_each(|array| out.write_all(array))?;
            let Hashing { mut inner, hash } = out;
            let hash: [u8; 32] = hash.finalize().into();
            inner.write_all(&hash)?;
            inner.into_inner().map_err(io::IntoInnerError::into_error)?.finish()?;
            Ok(as_numbers(hash))
        })();
        let path = path.to_owned();
        written.map_err(|cause| CheckpointError::FileSystem { action: "write", path, cause })
    }

    /// Removes what is left of other checkpoints than that after `step`. What cannot be looked at or removed stays.
    fn sweep(&self, step: u64) {
        let (start, current) = (format!("{FILE}-"), format!("{FILE}-{step}-"));
        for entry in fs::read_dir(&self.folder.path).into_iter().flatten().flatten() {
            let name = entry.file_name();
            let Some(name) = name.to_str() else { continue };
            if name.starts_with(&start) && !name.starts_with(&current) {
                let _ = fs::remove_file(entry.path());
            }
        }
        let is_part = |name: &[u8]| name.starts_with(start.as_bytes());
        WholeFile::sweep_where(&self.folder.path, &is_part);
    }

    /// How far the run was, and the solver's state; nothing where there is no checkpoint. A call of all processes, each of which reads
    /// some of the parts.
    pub(crate) fn read(
        &self,
        ranks: Option<&dyn Ranks>,
    ) -> Result<Option<TakenUp>, CheckpointError> {
        let (rank, count) = ranks.map_or((0, 1), |ranks| (ranks.rank(), ranks.count()));
        let damaged = |path: PathBuf, what| CheckpointError::Damaged { path, what };
        let first = agree(ranks, if rank == 0 { self.read_part(&self.path()) } else { Ok(None) })?;
        // The first one tells the others how far the run is and of which files it consists.
        let (mut numbers, mut others, mut parts) = (Vec::new(), Vec::new(), Vec::new());
        let mut lengths = [0_u64; 2];
        if let Some((part, _)) = first {
            (numbers, others) = (part.numbers, part.others);
            lengths = [numbers.len() as u64, others.len() as u64];
            parts.push(part.state);
        }
        if let Some(ranks) = ranks {
            share(ranks, 0, &mut lengths);
            numbers.resize(lengths[0] as usize, 0);
            others.resize(lengths[1] as usize, Checksum::default());
            share(ranks, 0, &mut numbers);
            share(ranks, 0, &mut others);
        }
        if numbers.is_empty() {
            return Ok(None);
        }
        let reached = Reached::from_numbers(&numbers)
            .and_then(|(reached, history)| Some((reached, history_of_numbers(history)?)));
        let (reached, history) =
            reached.ok_or_else(|| damaged(self.path(), "errors or moments are missing"))?;
        let own = (1..=others.len()).filter(|part| part % count == rank).try_for_each(|part| {
            let path = self.path_of(reached.step, part);
            match self.read_part(&path)? {
                Some((found, checksum)) if checksum == others[part - 1] => {
                    parts.push(found.state);
                    Ok(())
                }
                Some(_) => Err(damaged(path, "it is of another moment than the first one")),
                None => Err(damaged(path, "it is missing")),
            }
        });
        agree(ranks, own)?;
        Ok(Some(TakenUp { reached, history, parts }))
    }

    /// The content of one process's file, if it is there, and its checksum.
    fn read_part(&self, path: &Path) -> Result<Option<(Part, Checksum)>, CheckpointError> {
        let fail =
            |cause| CheckpointError::FileSystem { action: "read", path: path.to_owned(), cause };
        let damaged = |what| CheckpointError::Damaged { path: path.to_owned(), what };
        // Whole before anything is taken from it.
        let (mut file, checksum) = match whole(path) {
            Ok(Some((file, checksum))) => (BufReader::new(file), checksum),
            Ok(None) => return Err(damaged("its checksum does not match")),
            Err(cause) if cause.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(cause) => return Err(fail(cause)),
        };
        let mut take = |bytes: &mut [u8]| file.read_exact(bytes).map_err(fail);
        let mut magic = [0; MAGIC.len()];
        take(&mut magic)?;
        let mut identity = [0; 32];
        take(&mut identity)?;
        if magic != *MAGIC || identity != self.identity {
            return Err(CheckpointError::OtherRun { path: path.to_owned() });
        }
        let mut number = || {
            let mut bytes = [0; 8];
            take(&mut bytes).map(|()| u64::from_le_bytes(bytes))
        };
        let (numbers, arrays) = (number()?, number()?);
        let mut some = |count: u64| (0..count).map(|_| number()).collect::<Result<Vec<_>, _>>();
        let (numbers, lengths) = (some(numbers)?, some(arrays)?);
        let others = some(1)?[0];
        let others = some(4 * others)?;
        let others = others.as_chunks().0.to_vec();
        let state = lengths.into_iter().map(|length| {
            let mut array = vec![0; length as usize];
            take(&mut array).map(|()| array)
        });
        let state = state.collect::<Result<_, _>>()?;
        Ok(Some((Part { numbers, others, state }, checksum)))
    }
}

/// The result of this process where all others have one as well, and otherwise the error of one of them; a call of all.
fn agree<R>(
    ranks: Option<&dyn Ranks>,
    own: Result<R, CheckpointError>,
) -> Result<R, CheckpointError> {
    let Some(ranks) = ranks else { return own };
    let failed = ranks.largest(if own.is_err() { 1 + ranks.rank() as u64 } else { 0 });
    let Some(failed) = failed.checked_sub(1) else { return own };
    let mut message = own.err().map(|error| error.to_string()).unwrap_or_default().into_bytes();
    let mut length = [message.len() as u64];
    share(ranks, failed as usize, &mut length);
    message.resize(length[0] as usize, 0);
    share(ranks, failed as usize, &mut message);
    Err(CheckpointError::Elsewhere { message: String::from_utf8_lossy(&message).into_owned() })
}

fn as_numbers(checksum: [u8; 32]) -> Checksum {
    let (numbers, _) = checksum.as_chunks();
    std::array::from_fn(|n| u64::from_le_bytes(numbers[n]))
}

/// The file at its beginning, and the SHA-256 at its end; nothing where that is not the one of all before.
fn whole(path: &Path) -> io::Result<Option<(File, Checksum)>> {
    let mut file = File::open(path)?;
    let Some(length) = file.metadata()?.len().checked_sub(32) else { return Ok(None) };
    let mut hash = Sha256::new();
    let mut body = Read::by_ref(&mut file).take(length);
    io::copy(&mut body, &mut hash)?;
    let mut expected = [0; 32];
    file.read_exact(&mut expected)?;
    if hash.finalize()[..] != expected {
        return Ok(None);
    }
    file.rewind()?;
    Ok(Some((file, as_numbers(expected))))
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
    use crate::whole_file::tests::names;
    use mmsmith_ranks::in_process;

    fn checkpoints(folder: &Path) -> Checkpoints {
        let folder = CheckpointFolder::lock(folder).unwrap();
        Checkpoints { folder, every: 1, identity: [7; 32], resume: true }
    }

    fn reached() -> Reached {
        let norm = |x: f64| PerNorm { linf: x, l2: 0.1 * x, l1: -0.0 };
        let errors = PerField { u: norm(1.0), v: norm(2.0), F: norm(f64::NAN), P: norm(1e-300) };
        let internal = vec![("alpha".to_owned(), norm(3.0)), ("q".to_owned(), norm(-0.5))];
        Reached { step: 12, wall_s: 0.3, cpu_s: 0.4, errors, internal }
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
        assert!(checkpoints.read(None).unwrap().is_none());
        assert_eq!(CheckpointFolder::reached(folder.path()).unwrap(), None);
        for history in [vec![], history(1), history(3)] {
            checkpoints.write(None, &reached(), &history, &[&[1, 2, 3], &[]]).unwrap();
            let found = checkpoints.read(None).unwrap().unwrap();
            assert_eq!(found.reached.numbers(), reached().numbers());
            assert_eq!(numbers_of_history(&found.history), numbers_of_history(&history));
            assert_eq!(found.parts, [[vec![1, 2, 3], vec![]]]);
            assert_eq!(CheckpointFolder::reached(folder.path()).unwrap(), Some(12));
        }
    }

    #[test]
    fn any_damage_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let mut checkpoints = checkpoints(folder.path());
        checkpoints.write(None, &reached(), &history(2), &[&[9; 40]]).unwrap();
        let whole = fs::read(checkpoints.path()).unwrap();
        for at in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[at] ^= 1;
            fs::write(checkpoints.path(), &bytes).unwrap();
            assert!(checkpoints.read(None).is_err(), "byte {at}");
            fs::write(checkpoints.path(), &whole[..at]).unwrap();
            assert!(checkpoints.read(None).is_err(), "cut at {at}");
        }
        fs::write(checkpoints.path(), &whole).unwrap();
        checkpoints.identity = [8; 32];
        let error = checkpoints.read(None).unwrap_err();
        assert!(matches!(error, CheckpointError::OtherRun { .. }));
    }

    /// Writes the checkpoint of a step by some processes, each of whose part has its number.
    fn write_together(folder: &Path, count: usize, step: u64) {
        in_process(count, |ranks| {
            let reached = Reached { step, ..reached() };
            let state = [vec![ranks.rank() as u8; 3], vec![count as u8]];
            let state = state.each_ref().map(|array| array.as_slice());
            checkpoints_of(folder, &*ranks).write(Some(&*ranks), &reached, &history(2), &state)
        })
        .into_iter()
        .for_each(|written| written.unwrap());
    }

    fn checkpoints_of(folder: &Path, ranks: &dyn Ranks) -> Checkpoints {
        match ranks.rank() {
            0 => checkpoints(folder),
            _ => {
                let folder = CheckpointFolder::of_first(folder);
                Checkpoints { folder, every: 1, identity: [7; 32], resume: true }
            }
        }
    }

    fn read_together(folder: &Path, count: usize) -> Vec<Result<Option<TakenUp>, CheckpointError>> {
        in_process(count, |ranks| checkpoints_of(folder, &*ranks).read(Some(&*ranks)))
    }

    #[test]
    fn what_several_processes_wrote_any_number_reads() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        assert!(read_together(folder, 2).into_iter().all(|found| found.unwrap().is_none()));
        for (step, writers) in [(3, 4), (5, 1), (9, 3)] {
            write_together(folder, writers, step);
            let left = (1..writers).map(|rank| format!("checkpoint-{step}-{rank}"));
            let expected: Vec<String> =
                ["checkpoint".to_owned()].into_iter().chain(left).chain(["lock".into()]).collect();
            assert_eq!(names(folder), expected);
            for readers in 1..=5 {
                let mut seen = Vec::new();
                for found in read_together(folder, readers) {
                    let found = found.unwrap().unwrap();
                    assert_eq!(found.reached.step, step);
                    assert_eq!(numbers_of_history(&found.history), numbers_of_history(&history(2)));
                    assert!(found.parts.iter().all(|part| part[1] == [writers as u8]));
                    seen.extend(found.parts.into_iter().map(|part| part[0].clone()));
                }
                seen.sort();
                let all: Vec<_> = (0..writers).map(|rank| vec![rank as u8; 3]).collect();
                assert_eq!(seen, all);
            }
        }
    }

    #[test]
    fn a_part_that_is_damaged_missing_or_of_another_moment_is_named_at_all_processes() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let part = folder.join("checkpoint-3-2");
        let refused = |said: &str| {
            for readers in 1..=4 {
                for found in read_together(folder, readers) {
                    let error = found.unwrap_err().to_string();
                    assert!(error.contains("checkpoint-3-2") && error.contains(said), "{error}");
                }
            }
        };
        write_together(folder, 3, 3);
        let earlier = fs::read(&part).unwrap();
        write_together(folder, 4, 3);
        fs::write(&part, &earlier).unwrap();
        refused("of another moment");
        fs::write(&part, &earlier[1..]).unwrap();
        refused("checksum does not match");
        fs::remove_file(&part).unwrap();
        refused("it is missing");
    }

    #[test]
    fn what_a_killed_process_left_goes_with_the_next_checkpoint() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        write_together(folder, 3, 3);
        // Killed after one of two had written its part of the next, and while the other did.
        fs::write(folder.join("checkpoint-6-1"), "whole").unwrap();
        fs::write(folder.join(".checkpoint-6-2.mms-0123456789.tmp"), "part").unwrap();
        assert_eq!(read_together(folder, 1)[0].as_ref().unwrap().as_ref().unwrap().reached.step, 3);
        write_together(folder, 2, 4);
        assert_eq!(names(folder), ["checkpoint", "checkpoint-4-1", "lock"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_process_that_cannot_write_its_part_fails_all_with_its_message() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        write_together(folder, 2, 3);
        fs::create_dir(folder.join("checkpoint-5-1")).unwrap();
        let errors = in_process(2, |ranks| {
            let checkpoints = checkpoints_of(folder, &*ranks);
            let reached = Reached { step: 5, ..reached() };
            checkpoints.write(Some(&*ranks), &reached, &[], &[&[1]]).unwrap_err().to_string()
        });
        assert_eq!(errors[0], errors[1]);
        assert!(errors[0].contains("checkpoint-5-1: cannot write the checkpoint"), "{}", errors[0]);
        assert!(read_together(folder, 2).into_iter().all(|found| found.is_ok()));
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
        checkpoints(folder.path()).write(None, &reached(), &[], &[]).unwrap();
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
