//! A recording's frames, and which of their arrays is which field.

use mmsmith_runtime::Solution;
use mmsmith_vtk::foreign::{Snapshot, frames};

use super::arrays::Chosen;
use super::error::ScoreError;
use super::findings::Remarks;
use super::options::{Input, ScoreOptions};
use super::times::{Timed, open, times};

/// The frames of a recording, and its arrays.
pub(super) struct Found {
    /// At least one.
    pub(super) timed: Vec<Timed>,
    pub(super) first: Snapshot,
    pub(super) chosen: Chosen,
}

impl Found {
    pub(super) fn new<const D: usize>(
        exact: &dyn Solution<f64, D>,
        input: &Input,
        options: &ScoreOptions,
        remarks: &mut Remarks,
    ) -> Result<Self, ScoreError> {
        let mut files = vec![];
        for path in &input.paths {
            files.extend(frames(path)?);
        }
        let timed = times(exact, files, input.path(), options, remarks)?;
        let first = open(&timed[0].file)?;
        let chosen = Chosen::find::<D>(&first, &options.map, remarks)?;
        Ok(Self { timed, first, chosen })
    }
}
