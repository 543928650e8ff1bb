//! A recording's frames, and which of their arrays is which field.

use mmsmith_runtime::Solution;
use mmsmith_vtk::foreign::{Snapshot, recording};

use super::arrays::{Chosen, Role};
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
        let files = recording(&input.paths)?;
        let mut timed = times(exact, files, input.path(), options, remarks)?;
        let mut first = open(&timed[0].file)?;
        if let Some(name) = of_cells::<D>(&first, options) {
            let what = format!(
                "the displacement `{name}` is given for cells: fields are taken at the cells' centres, the means of their nodes"
            );
            remarks.note("cell-data", false, what);
            for frame in &mut timed {
                frame.file = frame.file.clone().at_cell_centres();
            }
            first = open(&timed[0].file)?;
        }
        let chosen = Chosen::find::<D>(&first, &options.map, remarks)?;
        Ok(Self { timed, first, chosen })
    }
}

/// The displacement that the cells have, where the points have none.
fn of_cells<const D: usize>(first: &Snapshot, options: &ScoreOptions) -> Option<String> {
    let arrays = first.cell_arrays();
    match options.map.get(&Role::Displacement) {
        Some(name) if first.array(name).is_some() => None,
        Some(name) => arrays.into_iter().map(|array| array.name).find(|array| array == name),
        None if Role::Displacement.find::<D>(first.arrays()).is_some() => None,
        None => Role::Displacement.find::<D>(&arrays).map(|array| array.name.clone()),
    }
}
