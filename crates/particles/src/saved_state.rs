//! The state of a run between two steps, as bytes.

use thiserror::Error;

/// The arrays that one process saved, in this machine's byte order.
pub type SavedState = Vec<Vec<u8>>;

/// A saved state that a simulation cannot go on from.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum SavedStateError {
    /// The solver is compiled for the usual scheme alone, whose runs go on from no saved state.
    #[error(
        "the solver is compiled without the feature every-scheme, and goes on from no saved state"
    )]
    LeftOut,
    /// Another number of arrays.
    #[error("it has {found} arrays where this run has {expected}")]
    Arrays {
        /// The number of arrays saved.
        found: usize,
        /// The number of this run's.
        expected: usize,
    },
    /// An array of another length.
    #[error("an array has {found} bytes where this run's has {expected}")]
    Length {
        /// Bytes saved.
        found: usize,
        /// Bytes of this run's.
        expected: usize,
    },
    /// Not each of the particles once.
    #[error("it has other particles than this run")]
    Particles,
    /// Numbers that do not belong together.
    #[error("it has a corner or a layer that this run does not have")]
    Place,
    /// Saved by several processes, for a scheme that one simulates.
    #[error("it is in {found} parts where this run has one")]
    Parts {
        /// The number of parts.
        found: usize,
    },
    /// Found by another process.
    #[error("another process has found it to be of another run")]
    Elsewhere,
}

/// Puts saved arrays in place of those of a state that one process has as a whole.
pub fn replace_whole(state: &mut [&mut [u8]], saved: &[SavedState]) -> Result<(), SavedStateError> {
    let [saved] = saved else { return Err(SavedStateError::Parts { found: saved.len() }) };
    let (found, expected) = (saved.len(), state.len());
    if found != expected {
        return Err(SavedStateError::Arrays { found, expected });
    }
    for (array, saved) in state.iter().zip(saved) {
        let (found, expected) = (saved.len(), array.len());
        if found != expected {
            return Err(SavedStateError::Length { found, expected });
        }
    }
    state.iter_mut().zip(saved).for_each(|(array, saved)| array.copy_from_slice(saved));
    Ok(())
}
