//! Which array of a file is which field, and its numbers as vectors and matrices.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use mmsmith_vtk::foreign::{ArrayHead, Snapshot};
use nalgebra::{SMatrix, SVector};
use serde::Serialize;

use super::ScoreError;
use super::findings::Remarks;

/// Role of a file's array in a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Displacement `u`.
    Displacement,
    /// Velocity `v`.
    Velocity,
    /// Deformation gradient `F[i][J]`, row by row.
    DeformationGradient,
    /// Displacement gradient `H[i][J]`, row by row: `F` less one, where `F` is not there.
    DisplacementGradient,
    /// First Piola-Kirchhoff stress `P[i][J]`, row by row.
    FirstPiolaKirchhoff,
    /// Cauchy stress, row by row, or its six components XX, YY, ZZ, XY, YZ, XZ; in the plane also XX, YY, XY.
    Cauchy,
    /// Kirchhoff stress `J` times Cauchy stress, as that.
    Kirchhoff,
    /// `J = det F`.
    VolumeRatio,
    /// Mass per current volume.
    Density,
    /// Reference position `X`.
    ReferencePosition,
    /// Identity of the particle, a whole number.
    Id,
}

impl Role {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::Displacement,
        Self::Velocity,
        Self::DeformationGradient,
        Self::DisplacementGradient,
        Self::FirstPiolaKirchhoff,
        Self::Cauchy,
        Self::Kirchhoff,
        Self::VolumeRatio,
        Self::Density,
        Self::ReferencePosition,
        Self::Id,
    ];

    /// Its own name, which is the first one looked for.
    #[must_use]
    pub fn name(self) -> &'static str {
        let names = self.names();
        names.split_once(' ').map_or(names, |(first, _)| first)
    }

    /// The names under which programs write it, the likeliest first. Names of up to two letters are meant letter by letter; longer
    /// ones in any case, with and without underscores.
    pub fn usual_names(self) -> impl Iterator<Item = &'static str> {
        self.names().split(' ')
    }

    fn names(self) -> &'static str {
        match self {
            Self::Displacement => {
                "displacement displacements disp displ u U d D mp_displacement total_displacement displacement_vector \
                 nodal_displacement u_h uh f_displacement"
            }
            Self::Velocity => "velocity velocities vel v V mp_velocity velocity_vector v_h",
            Self::DeformationGradient => {
                "deformation_gradient defgrad def_grad F mp_deformation_gradient"
            }
            Self::DisplacementGradient => {
                "displacement_gradient H grad_u gradu grad_displacement gradient_of_displacement"
            }
            Self::FirstPiolaKirchhoff => {
                "first_piola_kirchhoff first_piola_kirchhoff_stress pk1 pk1_stress first_pk_stress P piola_stress"
            }
            Self::Cauchy => {
                "cauchy cauchy_stress stress stresses sigma S s mp_cauchy_stress_vector mp_cauchy_stress \
                 stress_tensor cauchy_stress_tensor"
            }
            Self::Kirchhoff => "kirchhoff kirchhoff_stress tau",
            Self::VolumeRatio => "J jacobian detF det_deformation_gradient volume_ratio",
            Self::Density => "density rho mp_density mass_density",
            Self::ReferencePosition => {
                "reference_position reference_positions initial_position initial_positions reference_coordinates \
                 initial_coordinates X X0 x0 original_position"
            }
            Self::Id => {
                "id ID ids particle_id global_node_id global_node_ids vtkOriginalPointIds vtkOriginalCellIds node_id \
                 node_ids point_id point_ids global_id global_ids element_id cell_id mp_id particle_index index tag \
                 pid nid gid label orig_id original_id material_point_id particle_label particle_number"
            }
        }
    }

    /// The likeliest of some arrays to be it, which has as many components as it can have.
    pub(super) fn find<const D: usize>(self, arrays: &[ArrayHead]) -> Option<&ArrayHead> {
        let usual = self.named(arrays).find(|array| self.admits::<D>(array.components));
        match (self, usual) {
            // OpenFOAM calls the velocity U, and solids in it their displacement D.
            (Self::Displacement, Some(array)) if array.name == "U" => {
                vector_of::<D>(arrays, "D").or(usual)
            }
            (Self::Velocity, None) => {
                vector_of::<D>(arrays, "D").and_then(|_| vector_of::<D>(arrays, "U"))
            }
            _ => usual,
        }
    }

    /// The arrays that have a usual name, the likeliest first: those that have it letter by letter before others.
    fn named(self, arrays: &[ArrayHead]) -> impl Iterator<Item = &ArrayHead> {
        let exact = |name: &'static str| arrays.iter().filter(move |array| array.name == name);
        let alike = |name: String| arrays.iter().filter(move |array| plain(&array.name) == name);
        let long = self.usual_names().map(plain).filter(|name| name.len() > 2);
        let (exact, alike) = (self.usual_names().flat_map(exact), long.flat_map(alike));
        exact.chain(alike)
    }

    /// Whether an array of so many components can be it in `D` dimensions.
    pub(super) fn admits<const D: usize>(self, components: usize) -> bool {
        match self {
            Self::Displacement | Self::Velocity | Self::ReferencePosition => {
                (D..=3).contains(&components)
            }
            Self::DeformationGradient | Self::DisplacementGradient | Self::FirstPiolaKirchhoff => {
                components == D * D || components == 9
            }
            Self::Cauchy | Self::Kirchhoff => {
                [D * D, 6, 9].contains(&components) || (D, components) == (2, 3)
            }
            Self::VolumeRatio | Self::Density | Self::Id => components == 1,
        }
    }

    pub(super) fn admissible<const D: usize>(self) -> String {
        match self {
            Self::VolumeRatio | Self::Density | Self::Id => "1".into(),
            Self::Cauchy | Self::Kirchhoff if D == 3 => "6 or 9".into(),
            Self::Cauchy | Self::Kirchhoff if D == 2 => "3, 4, 6 or 9".into(),
            Self::Cauchy | Self::Kirchhoff => "1, 6 or 9".into(),
            Self::DeformationGradient | Self::DisplacementGradient | Self::FirstPiolaKirchhoff => {
                match D {
                    3 => "9".into(),
                    _ => format!("{} or 9", D * D),
                }
            }
            _ if D == 3 => "3".into(),
            _ => format!("{D} to 3"),
        }
    }
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The vector of this very name.
fn vector_of<'a, const D: usize>(arrays: &'a [ArrayHead], name: &str) -> Option<&'a ArrayHead> {
    let is_vector = |array: &&ArrayHead| (D..=3).contains(&array.components) && D > 1;
    arrays.iter().filter(is_vector).find(|array| array.name == name)
}

/// A name in small letters without signs between its words.
fn plain(name: &str) -> String {
    let is_letter = |letter: &char| !['_', ' ', '-', '.'].contains(letter);
    name.chars().filter(is_letter).flat_map(char::to_lowercase).collect()
}

/// The array for each role that a recording has, by its first frame.
pub(super) struct Chosen {
    heads: BTreeMap<Role, ArrayHead>,
    /// Whether the array for `F` holds `F` less one.
    pub(super) is_less_one: bool,
}

impl Chosen {
    /// Looks for arrays by the names in `map`, else by usual names.
    pub(super) fn find<const D: usize>(
        snapshot: &Snapshot,
        map: &BTreeMap<Role, String>,
        remarks: &mut Remarks,
    ) -> Result<Self, ScoreError> {
        let mut chosen = BTreeMap::new();
        for role in Role::ALL {
            if let Some(name) = map.get(&role) {
                let array = snapshot.array(name).ok_or_else(|| ScoreError::NoArray {
                    path: snapshot.path().to_owned(),
                    role,
                    name: name.clone(),
                    there: there(snapshot),
                })?;
                if !role.admits::<D>(array.components) {
                    return Err(ScoreError::Components {
                        path: snapshot.path().to_owned(),
                        role,
                        name: name.clone(),
                        components: array.components,
                        admissible: role.admissible::<D>(),
                    });
                }
                chosen.insert(role, array.clone());
                continue;
            }
            let arrays = snapshot.arrays();
            match (role.find::<D>(arrays), role.named(arrays).next()) {
                (Some(array), _) => {
                    chosen.insert(role, array.clone());
                }
                (None, Some(array)) => remarks.note(
                    "array-left-out",
                    false,
                    format!(
                        "array `{}` has {} component(s) and is not taken for {role}, which has {}",
                        array.name,
                        array.components,
                        role.admissible::<D>()
                    ),
                ),
                (None, None) => (),
            }
        }
        for array in chosen.values().filter(|array| array.is_single) {
            remarks.note(
                "single-precision",
                false,
                format!(
                    "array `{}` holds 32-bit floats: errors below about 1e-7 of its values are rounding",
                    array.name
                ),
            );
        }
        // An identity has all its digits, however many these are.
        let measured = chosen.iter().filter(|(role, _)| **role != Role::Id);
        for (array, digits) in measured.filter_map(|(_, array)| Some((array, array.digits?))) {
            if digits < DIGITS_OF_A_DOUBLE {
                let what = format!(
                    "array `{}` is text of {digits} digits, where a double has 17: errors below about 1e-{digits} of its \
                     values are rounding",
                    array.name
                );
                remarks.note("few-digits", false, what);
            }
        }
        let gradient = chosen.remove(&Role::DisplacementGradient);
        let gradient = gradient.filter(|_| !chosen.contains_key(&Role::DeformationGradient));
        let is_less_one = gradient.is_some();
        if let Some(head) = gradient {
            let what = format!("F is one plus the displacement gradient, array `{}`", head.name);
            remarks.note("of-displacement-gradient", false, what);
            chosen.insert(Role::DeformationGradient, head);
        }
        remarks_on_absent::<D>(snapshot, &chosen, remarks);
        Ok(Self { heads: chosen, is_less_one })
    }

    pub(super) fn head(&self, role: Role) -> Option<&ArrayHead> {
        self.heads.get(&role)
    }

    pub(super) fn name(&self, role: Role) -> Option<&str> {
        self.head(role).map(|array| array.name.as_str())
    }
}

/// Tells of arrays that may be a field that is compared, and are not taken.
fn remarks_on_absent<const D: usize>(
    snapshot: &Snapshot,
    chosen: &BTreeMap<Role, ArrayHead>,
    remarks: &mut Remarks,
) {
    let has_stress = [Role::Cauchy, Role::Kirchhoff].iter().any(|role| chosen.contains_key(role));
    let taken: BTreeSet<_> = chosen.values().map(|array| array.name.as_str()).collect();
    let is_free = |array: &&ArrayHead| !taken.contains(array.name.as_str()) && array.name != POINTS;
    let left: Vec<_> = snapshot.arrays().iter().filter(is_free).collect();
    let mut pairs = vec![];
    for role in [Role::Velocity, Role::DeformationGradient, Role::FirstPiolaKirchhoff] {
        if chosen.contains_key(&role) || has_stress && role == Role::FirstPiolaKirchhoff {
            continue;
        }
        // In one dimension any number would do, its time and its identity too.
        let fits = |array: &&&ArrayHead| D > 1 && role.admits::<D>(array.components);
        pairs.extend(left.iter().find(fits).map(|array| (role, array.name.as_str())));
    }
    if let Some((role, name)) = pairs.first() {
        let roles: Vec<_> = pairs.iter().map(|(role, _)| role.name()).collect();
        let names: Vec<_> = left.iter().map(|array| array.name.as_str()).collect();
        let what = format!(
            "no array is known to be {}; arrays that are not taken: {}; --map {role}={name} would take one",
            roles.join(", "),
            shortened(&names)
        );
        remarks.note("not-compared", false, what);
    }
}

/// The name of the positions among the arrays of a table.
const POINTS: &str = "Points";
/// Text of so many digits gives a double in most cases; 17 always do.
pub(super) const DIGITS_OF_A_DOUBLE: usize = 15;

/// The names of a frame's arrays, for messages.
pub(super) fn there(snapshot: &Snapshot) -> String {
    let names: Vec<_> = snapshot.arrays().iter().map(|array| array.name.as_str()).collect();
    if names.is_empty() { "none".into() } else { shortened(&names) }
}

/// A list of names that fits a message.
fn shortened(names: &[&str]) -> String {
    const MOST: usize = 20;
    match names.len().checked_sub(MOST) {
        None | Some(0) => names.join(", "),
        Some(more) => format!("{} and {more} more", names[..MOST].join(", ")),
    }
}

/// One vector a particle, of the components along `axes`; particles with other components that do not vanish are counted.
pub(super) fn vectors<const D: usize>(
    flat: &[f64],
    components: usize,
    axes: [usize; D],
) -> (Vec<SVector<f64, D>>, Option<(usize, usize)>) {
    let mut beyond: Option<(usize, usize)> = None;
    let mut vectors = Vec::with_capacity(flat.len() / components.max(1));
    let others: Vec<usize> = (0..components).filter(|axis| !axes.contains(axis)).collect();
    for (index, row) in flat.chunks_exact(components).enumerate() {
        vectors.push(SVector::from_fn(|i, _| row[axes[i]]));
        if others.iter().any(|axis| row[*axis] != 0.0) {
            let (count, first) = beyond.unwrap_or((0, index));
            beyond = Some((count + 1, first));
        }
    }
    (vectors, beyond)
}

/// One matrix a particle from its rows, or from the different components of a symmetric one; the rows and columns of `axes`.
pub(super) fn matrices<const D: usize>(
    flat: &[f64],
    components: usize,
    axes: [usize; D],
) -> Vec<SMatrix<f64, D, D>> {
    let place = |i: usize, j: usize| match (components, i.min(j), i.max(j)) {
        (9, ..) => 3 * i + j,
        (3 | 6, i, j) if i == j => i,
        (3, ..) => 2,
        // XY, XZ and YZ, whose indices have the sums 1, 2 and 3.
        (6, i, j) => [3, 5, 4][i + j - 1],
        _ => D * i + j,
    };
    let matrix = |row: &[f64]| SMatrix::from_fn(|i, j| row[place(axes[i], axes[j])]);
    flat.chunks_exact(components).map(matrix).collect()
}

/// How many of the particles have a number that is none, and the first of them.
pub(super) fn not_finite(flat: &[f64], components: usize) -> (usize, usize) {
    let mut bad = flat
        .chunks_exact(components)
        .enumerate()
        .filter(|(_, row)| row.iter().any(|value| !value.is_finite()))
        .map(|(index, _)| index);
    let first = bad.next();
    (first.map_or(0, |_| 1 + bad.count()), first.unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{matrix, vector};

    #[test]
    fn components_beyond_the_dimension_are_counted_unless_zero() {
        let (vectors, beyond) = vectors::<2>(&[1.0, 2.0, 0.0, 3.0, 4.0, -0.5], 3, [0, 1]);
        assert_eq!(vectors, [vector![1.0, 2.0], vector![3.0, 4.0]]);
        assert_eq!(beyond, Some((1, 1)));
        let (of_xz, beyond) = super::vectors::<2>(&[1.0, 2.0, 0.0, 3.0, 0.0, -0.5], 3, [0, 2]);
        assert_eq!(of_xz, [vector![1.0, 0.0], vector![3.0, -0.5]]);
        assert_eq!(beyond, Some((1, 0)));
    }

    #[test]
    fn matrices_are_read_row_by_row_from_four_or_nine_components() {
        let expected = matrix![1.0, 2.0; 3.0, 4.0];
        assert_eq!(matrices::<2>(&[1.0, 2.0, 3.0, 4.0], 4, [0, 1]), [expected]);
        let nine = [1.0, 2.0, 0.0, 3.0, 4.0, 0.0, 0.0, 0.0, 1.0];
        assert_eq!(matrices::<2>(&nine, 9, [0, 1]), [expected]);
        assert_eq!(matrices::<1>(&nine, 9, [0]), [matrix![1.0]]);
    }

    #[test]
    fn symmetric_matrices_are_read_from_their_different_components() {
        assert_eq!(matrices::<2>(&[1.0, 2.0, 3.0], 3, [0, 1]), [matrix![1.0, 3.0; 3.0, 2.0]]);
        let six = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let full = matrix![1.0, 4.0, 6.0; 4.0, 2.0, 5.0; 6.0, 5.0, 3.0];
        assert_eq!(matrices::<3>(&six, 6, [0, 1, 2]), [full]);
        assert_eq!(matrices::<2>(&six, 6, [0, 1]), [matrix![1.0, 4.0; 4.0, 2.0]]);
        assert_eq!(matrices::<2>(&six, 6, [0, 2]), [matrix![1.0, 6.0; 6.0, 3.0]]);
        assert_eq!(matrices::<2>(&six, 6, [1, 0]), [matrix![2.0, 4.0; 4.0, 1.0]]);
    }

    #[test]
    fn particles_not_numbers_are_counted() {
        assert_eq!(not_finite(&[0.0, f64::NAN, f64::INFINITY, f64::NAN, 1.0, 2.0], 2), (2, 0));
        assert_eq!(not_finite(&[0.0, 1.0], 2), (0, 0));
    }
}
