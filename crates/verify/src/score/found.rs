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
    /// Whether the particles are the centres of a mesh's cells.
    pub(super) is_of_cells: bool,
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
        let of_cells = of_cells::<D>(&first, options);
        let is_of_cells = of_cells.is_some();
        if let Some(name) = of_cells {
            let what = format!(
                "the displacement `{name}` is given for cells: fields are taken at the cells' centres, the means of their nodes"
            );
            remarks.note("cell-data", false, what);
            for frame in &mut timed {
                frame.file = frame.file.clone().at_cell_centres();
            }
            first = open(&timed[0].file)?;
        } else {
            tell_left_out::<D>(&first, remarks);
        }
        let chosen = Chosen::find::<D>(&first, &options.map, remarks)?;
        Ok(Self { timed, first, chosen, is_of_cells })
    }
}

/// Tells of stresses and gradients of cells, where the displacement is that of points.
fn tell_left_out<const D: usize>(first: &Snapshot, remarks: &mut Remarks) {
    let roles = [
        Role::DeformationGradient,
        Role::DisplacementGradient,
        Role::FirstPiolaKirchhoff,
        Role::Cauchy,
        Role::Kirchhoff,
    ];
    let of_cells = first.cell_arrays();
    let is_left_out = |role: &Role| role.find::<D>(first.arrays()).is_none();
    let found = roles.into_iter().filter(is_left_out);
    let names: Vec<_> = found.filter_map(|role| role.find::<D>(&of_cells)).collect();
    if !names.is_empty() {
        let names: Vec<_> = names.iter().map(|array| format!("`{}`", array.name)).collect();
        let what = format!(
            "arrays of cells are not compared, since displacements are at the points: {}; written at the points, or with \
             displacements of cells beside them, they are",
            names.join(", ")
        );
        remarks.note("cell-arrays", false, what);
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
