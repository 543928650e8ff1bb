//! The exact fields at one point, in a form that can be written.

use crate::dimension::in_dimension;
use mmsmith_solutions::{AnySolution, Fields, Solution};
use nalgebra::{SMatrix, SVector};
use serde::Serialize;
use thiserror::Error;

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
    /// First Piola-Kirchhoff stress `P[i][J]`.
    pub P: Vec<Vec<f64>>,
    /// Body force per unit mass.
    pub b: Vec<f64>,
}

/// A position with the wrong number of coordinates.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("X has {given} coordinates, but the solution is {dimension}-dimensional")]
pub struct WrongLength {
    /// The number of coordinates given.
    pub given: usize,
    /// The number needed.
    pub dimension: usize,
}

/// Every field of `solution` at the reference position `X` and time `t`.
///
/// # Errors
///
/// [`WrongLength`] when `X` does not have one coordinate for each dimension.
pub fn evaluate(solution: &AnySolution<f64>, X: &[f64], t: f64) -> Result<FieldRow, WrongLength> {
    let unknown = || Err(WrongLength { given: X.len(), dimension: 0 });
    in_dimension!(solution, |s| evaluate_in(s, X, t), else unknown())
}

fn evaluate_in<const D: usize>(
    solution: &dyn Solution<f64, D>,
    X: &[f64],
    t: f64,
) -> Result<FieldRow, WrongLength> {
    let position: [f64; D] =
        X.try_into().map_err(|_| WrongLength { given: X.len(), dimension: D })?;
    let Fields { u, v, a, H, F, J, P, b } = solution.fields(&SVector::from(position), t);
    Ok(FieldRow {
        u: list(&u),
        v: list(&v),
        a: list(&a),
        H: rows(&H),
        F: rows(&F),
        J,
        P: rows(&P),
        b: list(&b),
    })
}

fn list<const D: usize>(vector: &SVector<f64, D>) -> Vec<f64> {
    vector.iter().copied().collect()
}

fn rows<const D: usize>(matrix: &SMatrix<f64, D, D>) -> Vec<Vec<f64>> {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}
