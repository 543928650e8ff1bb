//! The exact fields at one point, in a form that can be written.

use crate::across::has_stretch_across;
use crate::dimension::in_dimension;
use crate::points::outside;
use crate::tangent::{TangentError, WrongLength, exact_tangent};
use mmsmith_runtime::{AnySolution, Around, Domain, Fields, Solution};
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
    /// The fields that have entries which are no finite numbers, and are written as null. Written where there are any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub not_finite: Vec<String>,
    /// Why they have: the history of the internal variables could not be followed. Written where that is the reason.
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
    fn values(&mut self) -> impl Iterator<Item = &mut f64> {
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

/// [`evaluate`] with the tangent of the solver's law at the exact deformation.
///
/// # Errors
///
/// [`TangentError`] where the law has none, or the position does not fit.
pub fn evaluate_with_tangent(
    solution: &AnySolution<f64>,
    X: &[f64],
    t: f64,
) -> Result<FieldRow, TangentError> {
    let mut row = evaluate(solution, X, t)?;
    row.dPdF = in_dimension!(solution, |s| exact_tangent(s, X, t)?, else Vec::new());
    if row.dPdF.iter().flatten().flatten().flatten().any(|entry| !entry.is_finite()) {
        row.not_finite.push("dPdF".to_owned());
    }
    Ok(row)
}

/// Every field of `solution` at the reference position `X` and time `t`.
///
/// # Errors
///
/// [`WrongLength`] when `X` does not have one coordinate for each dimension.
pub fn evaluate(solution: &AnySolution<f64>, X: &[f64], t: f64) -> Result<FieldRow, WrongLength> {
    let unknown = || Err(WrongLength { given: X.len(), dimension: 0 });
    let row = in_dimension!(solution, |s| evaluate_in(s, X, t), else unknown())?;
    match (solution, X) {
        (AnySolution::Three(space), [0.0, 0.0, Z]) if !row.not_finite.is_empty() => {
            Ok(limit_at_axis(space.as_ref(), *Z, t).unwrap_or(row))
        }
        _ => Ok(row),
    }
}

/// The limits of all fields on the axis of a solid body that is axisymmetric; `None` for other bodies.
///
/// Along a line through the axis every Cartesian entry is smooth, so that means over both sides are even functions of the distance. They are
/// extrapolated from six distances by the polynomial of the squares.
fn limit_at_axis(space: &dyn Solution<f64, 3>, Z: f64, t: f64) -> Option<FieldRow> {
    const DISTANCES: usize = 6;
    // Small beside the body, large beside what rounding loses in quotients by the distance.
    const SHARE: f64 = 0.01;
    let Domain::Tube { inner: 0.0, outer, around: Around::Axisymmetric, .. } = space.domain()
    else {
        return None;
    };
    let mut limit: Option<FieldRow> = None;
    for k in 1..=DISTANCES {
        // Lagrange's weight at zero of the square of the distance.
        let square = |k: usize| (k * k) as f64;
        let weight: f64 = (1..=DISTANCES)
            .filter(|other| *other != k)
            .map(|other| square(other) / (square(other) - square(k)))
            .product();
        for side in [1.0, -1.0] {
            let X = side * SHARE * outer * k as f64;
            let mut row = evaluate_in(space, &[X, 0.0, Z], t).ok()?;
            row.values().for_each(|value| *value *= 0.5 * weight);
            match &mut limit {
                None => limit = Some(row),
                Some(sum) => sum.values().zip(row.values()).for_each(|(sum, own)| *sum += *own),
            }
        }
    }
    let limit = limit?;
    let is_finite =
        |(.., values): &(&str, Vec<usize>, Vec<f64>)| values.iter().all(|v| v.is_finite());
    limit.named().iter().all(is_finite).then(|| {
        let outside = outside(&space.domain(), &SVector::from([0.0, 0.0, Z]));
        FieldRow { outside: outside.is_some_and(|share| share > OUTSIDE), ..limit }
    })
}

fn evaluate_in<const D: usize>(
    solution: &dyn Solution<f64, D>,
    X: &[f64],
    t: f64,
) -> Result<FieldRow, WrongLength> {
    let position: [f64; D] =
        X.try_into().map_err(|_| WrongLength { given: X.len(), dimension: D })?;
    let X = SVector::from(position);
    let Fields { u, v, a, H, F, J, P, b } = solution.fields(&X, t);
    let F_zz = has_stretch_across(&solution.law()).then(|| solution.stretch_across(&X, t));
    let names = solution.internal_variables();
    let values = if names.is_empty() { Vec::new() } else { solution.internal(&X, t) };
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
        outside: outside(&solution.domain(), &X).is_some_and(|share| share > OUTSIDE),
        not_finite: Vec::new(),
        why: None,
    };
    let bad = |values: &[f64]| !values.iter().all(|value| value.is_finite());
    let fields = row.named();
    let not_finite = fields.iter().filter(|(.., values)| bad(values));
    row.not_finite = not_finite.map(|(name, ..)| (*name).to_owned()).collect();
    if !row.not_finite.is_empty() && !row.internal.is_empty() {
        row.why = solution.history(&[X], t).err();
    }
    Ok(row)
}

fn list<const D: usize>(vector: &SVector<f64, D>) -> Vec<f64> {
    vector.iter().copied().collect()
}

fn rows<const D: usize>(matrix: &SMatrix<f64, D, D>) -> Vec<Vec<f64>> {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}
