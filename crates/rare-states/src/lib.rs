//! States of a program that tests have to have met: a suite that never joins a sliver says nothing of joined slivers.
//!
//! The code where such a state arises calls [`met`]. In builds without debug assertions, as releases are, that is nothing. In others the
//! first call for a state in a process appends a line to a file with the state's name, in the folder that the variable
//! [`FOLDER`] of the environment names, if it names one. The example `missed` then tells which states no test has met.

use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// The variable of the environment that names the folder.
pub const FOLDER: &str = "MMSMITH_RARE_STATES";

/// A state that a run seldom comes to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RareState {
    /// A clipped box with next to no volume was joined to its neighbour.
    SliverJoined,
    /// A node of a clipped body with next to no mass took the values of inner nodes.
    LightNode,
    /// A particle went to another process within a step.
    ParticleMigrated,
    /// The cut between the bins of two processes was moved.
    CutMoved,
    /// A shard of a study went on with a case that it had finished when it was started before.
    ShardResumed,
}

impl RareState {
    /// All states.
    pub const ALL: [Self; 5] = [
        Self::SliverJoined,
        Self::LightNode,
        Self::ParticleMigrated,
        Self::CutMoved,
        Self::ShardResumed,
    ];

    /// The name of its file.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::SliverJoined => "sliver-joined",
            Self::LightNode => "light-node",
            Self::ParticleMigrated => "particle-migrated",
            Self::CutMoved => "cut-moved",
            Self::ShardResumed => "shard-resumed",
        }
    }
}

/// Takes note of a state. Nothing in builds without debug assertions.
#[inline(always)]
pub fn met(state: RareState) {
    met_if(state, || true);
}

/// As [`met`], if `is_met`, which builds without debug assertions do not ask.
#[inline(always)]
pub fn met_if(state: RareState, is_met: impl FnOnce() -> bool) {
    static KNOWN: [AtomicBool; RareState::ALL.len()] =
        [const { AtomicBool::new(false) }; RareState::ALL.len()];
    let known = &KNOWN[state as usize];
    if cfg!(debug_assertions)
        && !known.load(Ordering::Relaxed)
        && is_met()
        && !known.swap(true, Ordering::Relaxed)
    {
        tell(state);
    }
}

/// Appends a line to the state's file, if there is a folder for it. Tests that count find a line less where that fails.
#[cold]
fn tell(state: RareState) {
    if let Some(folder) = std::env::var_os(FOLDER) {
        let _ = write_down(Path::new(&folder), state);
    }
}

fn write_down(folder: &Path, state: RareState) -> io::Result<()> {
    let line = format!("{}\n", std::process::id());
    let path = folder.join(state.name());
    OpenOptions::new().append(true).create(true).open(path)?.write_all(line.as_bytes())
}

/// How many processes have met each state, by the files of a folder.
///
/// # Errors
///
/// Where a file cannot be read; one that is missing tells of none.
pub fn counts(folder: &Path) -> io::Result<Vec<(RareState, usize)>> {
    let count = |state: RareState| match std::fs::read_to_string(folder.join(state.name())) {
        Ok(text) => Ok((state, text.lines().count())),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok((state, 0)),
        Err(error) => Err(error),
    };
    RareState::ALL.into_iter().map(count).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn states_are_counted_by_processes_and_those_that_none_has_met_have_none() {
        let folder = tempfile::tempdir().unwrap();
        for _ in 0..3 {
            write_down(folder.path(), RareState::LightNode).unwrap();
        }
        write_down(folder.path(), RareState::ShardResumed).unwrap();
        let found: Vec<usize> =
            counts(folder.path()).unwrap().into_iter().map(|(_, count)| count).collect();
        assert_eq!(found, [0, 3, 0, 0, 1]);
    }

    #[test]
    fn a_state_is_asked_for_until_it_is_met() {
        let mut asked = 0;
        for _ in 0..3 {
            met_if(RareState::SliverJoined, || {
                asked += 1;
                asked == 2
            });
        }
        assert_eq!(asked, if cfg!(debug_assertions) { 2 } else { 0 });
        let places: Vec<usize> = RareState::ALL.iter().map(|state| *state as usize).collect();
        assert_eq!(places, [0, 1, 2, 3, 4]);
    }
}
