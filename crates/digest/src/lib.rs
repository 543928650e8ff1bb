//! Small runs of every kind, and the digest of their results: the same on every processor, with every vector instruction and on any
//! number of threads.
//!
//! A digest is over the bits of all errors, and of positions, velocities, deformation gradients, stresses and internal variables of all
//! particles at the end. The digests that this version has everywhere are in `kept.txt`; the example `digest` prints those of the machine
//! that it runs on in the same form. Where a change of arithmetic is meant, `UPDATE_EXPECT=1 cargo test kept_runs` writes the file anew.

mod bits;
mod runs;

use sha2::{Digest, Sha256};
use thiserror::Error;

pub use runs::{Run, runs};

/// Runs and their digests as they are published, a line each.
const KEPT: &str = include_str!("kept.txt");

/// Why a run has no digest.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("the run {run} cannot be done: {reason}")]
pub struct RunError {
    /// The name of the run.
    pub run: String,
    /// The cause.
    pub reason: String,
}

/// A run with the digest that it has here, and the one that it should have.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Compared {
    /// The name of the run.
    pub name: String,
    /// The digest found here.
    pub found: String,
    /// The digest of this version; none of a run that `kept.txt` lacks.
    pub expected: Option<String>,
}

impl Compared {
    /// Whether the run had the same bits.
    #[must_use]
    pub fn is_same(&self) -> bool {
        self.expected.as_ref() == Some(&self.found)
    }
}

/// Runs and their digests in the form of `kept.txt`.
#[must_use]
pub fn kept(compared: &[Compared]) -> String {
    compared.iter().map(|run| format!("{} {}\n", run.name, run.found)).collect()
}

/// The runs that are published, with their digests.
pub fn published() -> impl Iterator<Item = (&'static str, &'static str)> {
    KEPT.lines().filter_map(|line| line.split_once(' '))
}

/// One digest of all runs, in their order.
pub fn whole<'a>(digests: impl IntoIterator<Item = (&'a str, &'a str)>) -> String {
    let mut sum = Sha256::new();
    for (name, digest) in digests {
        sum.update(format!("{name} {digest}\n"));
    }
    bits::short(sum)
}

/// Does all runs, one after the other, and calls `seen` after each with its name and the share that is done.
///
/// # Errors
///
/// [`RunError`] for a run that cannot be done, as where memory is short.
pub fn repeat(seen: &mut dyn FnMut(&str, f64)) -> Result<Vec<Compared>, RunError> {
    let all = runs();
    let count = all.len() as f64;
    let mut compared = Vec::with_capacity(all.len());
    for (done, run) in all.iter().enumerate() {
        let found = run.digest()?;
        seen(run.name, (done + 1) as f64 / count);
        let expected = published().find(|(name, _)| *name == run.name);
        let expected = expected.map(|(_, digest)| digest.to_owned());
        compared.push(Compared { name: run.name.to_owned(), found, expected });
    }
    Ok(compared)
}
