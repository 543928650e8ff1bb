//! The exact fields at one point by their formulas, in a form that can be written.

use crate::across::has_stretch_across;
use crate::points::outside;
use mmsmith_runtime::{Fields, Solution};
use nalgebra::{SMatrix, SVector};
use serde::Serialize;
use std::collections::BTreeMap;

/// All fields at a point; vectors as lists, matrices as lists of rows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FieldRow {
    /// Displacement.
    pub u: Vec<f64>,
    /// Velocity.
    pub v: Vec<f64>,
    /// Acceleration.
    pub a: Vec<f64>,
    /// Displacement gradient `H[i][J]`.
    pub H: Vec<Vec<f64>>,
    /// Deformation gradient `F[i][J]`.
    pub F: Vec<Vec<f64>>,
    /// `det F`.
    pub J: f64,
    /// The stretch across the plane, or the line, in plane or uniaxial stress. Written where the solution assumes that there is no stress
    /// across.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub F_zz: Option<f64>,
    /// First Piola-Kirchhoff stress `P[i][J]`.
    pub P: Vec<Vec<f64>>,
    /// Body force per unit mass.
    pub b: Vec<f64>,
    /// The tangent of the solver's law, `dPdF[i][J][k][L] = dP_iJ/dF_kL`. Written where it is asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub dPdF: Vec<Vec<Vec<Vec<f64>>>>,
    /// Internal variables of the law by their names, in Cartesian components. Written where there are any.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub internal: BTreeMap<String, f64>,
    /// Whether `X` lies outside the body, where the fields are those of the same formulas. Written where it is true.
    #[serde(skip_serializing_if = "is_false")]
    pub outside: bool,
    /// The fields that have entries which are no finite numbers, and are written as null; `W` where the strain energy has no value, while
    /// formulas have numbers. Written where there are any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub not_finite: Vec<String>,
    /// Why they have: the history of the internal variables could not be followed, or fields have no limit on an axis of coordinates,
    /// or the deformation lies beyond the limit of the law. Written where that is the reason.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
}

fn is_false(value: &bool) -> bool {
    !value
}

/// Share of the body's size by which a point may lie outside before it is told: rounding of points on the surface.
const OUTSIDE: f64 = 1e-12;

impl FieldRow {
    /// Every value but those of the tangent.
    pub(crate) fn values(&mut self) -> impl Iterator<Item = &mut f64> {
        let vectors = [&mut self.u, &mut self.v, &mut self.a, &mut self.b].into_iter().flatten();
        let matrices = [&mut self.H, &mut self.F, &mut self.P].into_iter().flatten().flatten();
        let others = self.F_zz.iter_mut().chain(self.internal.values_mut());
        vectors.chain(matrices).chain([&mut self.J]).chain(others)
    }

    /// Each field's letter, the shape of its value at a point, and its entries row by row.
    #[must_use]
    pub fn named(&self) -> Vec<(&str, Vec<usize>, Vec<f64>)> {
        let vector = |list: &[f64]| (vec![list.len()], list.to_vec());
        let matrix = |rows: &[Vec<f64>]| (vec![rows.len(); 2], rows.concat());
        let named = |name, (shape, values)| (name, shape, values);
        let mut all = vec![
            named("u", vector(&self.u)),
            named("v", vector(&self.v)),
            named("a", vector(&self.a)),
            named("H", matrix(&self.H)),
            named("F", matrix(&self.F)),
            named("J", (Vec::new(), vec![self.J])),
            named("P", matrix(&self.P)),
            named("b", vector(&self.b)),
        ];
        if !self.dPdF.is_empty() {
            let entries = self.dPdF.iter().flatten().flatten().flatten().copied().collect();
            all.push(named("dPdF", (vec![self.dPdF.len(); 4], entries)));
        }
        all.extend(self.F_zz.map(|F_zz| named("F_zz", (Vec::new(), vec![F_zz]))));
        let internal = self.internal.iter();
        all.extend(internal.map(|(name, value)| (name.as_str(), Vec::new(), vec![*value])));
        all
    }
}

/// Every field by its formula.
pub(crate) fn evaluate_in<const D: usize>(
    solution: &dyn Solution<f64, D>,
    X: &SVector<f64, D>,
    t: f64,
) -> FieldRow {
    let Fields { u, v, a, H, F, J, P, b } = solution.fields(X, t);
    let F_zz = has_stretch_across(&solution.law()).then(|| solution.stretch_across(X, t));
    let names = solution.internal_variables();
    let values = if names.is_empty() { Vec::new() } else { solution.internal(X, t) };
    let mut row = FieldRow {
        internal: names.into_iter().zip(values).collect(),
        u: list(&u),
        v: list(&v),
        a: list(&a),
        H: rows(&H),
        F: rows(&F),
        J,
        F_zz,
        P: rows(&P),
        b: list(&b),
        dPdF: Vec::new(),
        outside: outside(&solution.domain(), X).is_some_and(|share| share > OUTSIDE),
        not_finite: Vec::new(),
        why: None,
    };
    let bad = |values: &[f64]| !values.iter().all(|value| value.is_finite());
    let fields = row.named();
    let not_finite = fields.iter().filter(|(.., values)| bad(values));
    row.not_finite = not_finite.map(|(name, ..)| (*name).to_owned()).collect();
    if !row.not_finite.is_empty() && !row.internal.is_empty() {
        row.why = solution.history(&[*X], t).err();
    }
    row
}

fn list<const D: usize>(vector: &SVector<f64, D>) -> Vec<f64> {
    vector.iter().copied().collect()
}

fn rows<const D: usize>(matrix: &SMatrix<f64, D, D>) -> Vec<Vec<f64>> {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}
