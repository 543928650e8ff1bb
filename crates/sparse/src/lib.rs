//! Systems of linear equations with few entries in a row, solved directly.
//!
//! The factors are those of faer, on one thread: no sum depends on the number of threads. Nothing else in the workspace names that crate.
//!
//! - A symmetric matrix is tried by Cholesky's factors first, with an order of its unknowns that keeps them sparse.
//! - Where these do not exist, since the matrix is not positive, or where it is not symmetric, the factors are those of elimination with
//!   pivots.

use std::fmt;

use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::{Llt, Lu, SymbolicLlt, SymbolicLu};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{MatMut, Side};
use thiserror::Error;

/// Why a system has no solution here.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum SparseError {
    /// A pivot is zero, or no number.
    #[error("the matrix is singular")]
    Singular,
    /// The factors do not fit.
    #[error("the factors of the matrix do not fit into memory")]
    Memory,
    /// Rows of a column are not in ascending order, or beyond the matrix.
    #[error("the columns do not describe a square matrix")]
    Shape,
}

/// The places of a square matrix that may differ from zero, column by column, with what its factors look like.
pub struct Pattern {
    columns: SymbolicSparseColMat<usize>,
    cholesky: Option<SymbolicLlt<usize>>,
    elimination: Option<SymbolicLu<usize>>,
}

/// How a system was solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Factors {
    /// Cholesky's factors: the matrix is symmetric and positive.
    Cholesky,
    /// Elimination with pivots.
    Elimination,
}

impl fmt::Debug for Pattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Pattern")
            .field("unknowns", &self.unknowns())
            .field("entries", &self.entries())
            .finish()
    }
}

impl Pattern {
    /// The matrix whose column `j` has entries in the rows `rows[starts[j]..starts[j + 1]]`, in ascending order. Its places are symmetric
    /// where its values are to be.
    ///
    /// # Errors
    ///
    /// [`SparseError::Shape`] where there is no such matrix.
    pub fn new(starts: Vec<usize>, rows: Vec<usize>) -> Result<Self, SparseError> {
        let size = starts.len().checked_sub(1).ok_or(SparseError::Shape)?;
        let ascend = |pair: &[usize]| pair[0] <= pair[1];
        if starts[0] != 0 || starts[size] != rows.len() || !starts.windows(2).all(ascend) {
            return Err(SparseError::Shape);
        }
        let columns = starts.windows(2).map(|pair| &rows[pair[0]..pair[1]]);
        let fits = |column: &[usize]| {
            column.windows(2).all(|pair| pair[0] < pair[1])
                && column.last().is_none_or(|row| *row < size)
        };
        if !columns.into_iter().all(fits) {
            return Err(SparseError::Shape);
        }
        let columns = SymbolicSparseColMat::new_checked(size, size, starts, None, rows);
        Ok(Self { columns, cholesky: None, elimination: None })
    }

    /// The number of unknowns.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.columns.ncols()
    }

    /// The number of places.
    #[must_use]
    pub fn entries(&self) -> usize {
        self.columns.row_idx().len()
    }

    /// The number of the place in a row of a column.
    #[must_use]
    pub fn place(&self, row: usize, column: usize) -> Option<usize> {
        let starts = self.columns.col_ptr();
        let range = starts[column]..starts[column + 1];
        let found = self.columns.row_idx()[range.clone()].binary_search(&row).ok()?;
        Some(range.start + found)
    }

    /// The sums of magnitudes of the terms in the product of the matrix and a vector, row by row.
    #[must_use]
    pub fn magnitudes(&self, values: &[f64], x: &[f64]) -> Vec<f64> {
        let (starts, rows) = (self.columns.col_ptr(), self.columns.row_idx());
        let mut sums = vec![0.0; x.len()];
        for (column, x) in x.iter().enumerate() {
            for place in starts[column]..starts[column + 1] {
                sums[rows[place]] += (values[place] * x).abs();
            }
        }
        sums
    }

    /// Replaces the right-hand side `x` by the solution of the system with these values, by place; says how.
    ///
    /// # Errors
    ///
    /// Where the matrix is singular, or its factors do not fit into memory.
    pub fn solve(
        &mut self,
        values: &[f64],
        is_symmetric: bool,
        x: &mut [f64],
    ) -> Result<Factors, SparseError> {
        if self.unknowns() == 0 {
            return Ok(Factors::Cholesky);
        }
        // Cholesky's factors are roots, whose rounding changes with the unit of the entries by odd powers of two: the largest entry is
        // brought between one and two.
        let unit = power_of_two(values);
        let values: Vec<f64> = values.iter().map(|value| value / unit).collect();
        let factors = self.solve_in_unit(&values, is_symmetric, x)?;
        x.iter_mut().for_each(|value| *value /= unit);
        match x.iter().all(|value| value.is_finite()) {
            true => Ok(factors),
            false => Err(SparseError::Singular),
        }
    }

    fn solve_in_unit(
        &mut self,
        values: &[f64],
        is_symmetric: bool,
        x: &mut [f64],
    ) -> Result<Factors, SparseError> {
        if is_symmetric && self.by_cholesky(values, x)? {
            return Ok(Factors::Cholesky);
        }
        let Self { columns, elimination, .. } = self;
        let symbolic = match elimination {
            Some(known) => known.clone(),
            None => SymbolicLu::try_new(columns.as_ref()).map_err(|_| SparseError::Memory)?,
        };
        *elimination = Some(symbolic.clone());
        let matrix = SparseColMatRef::new(columns.as_ref(), values);
        let factors =
            Lu::try_new_with_symbolic(symbolic, matrix).map_err(|_| SparseError::Singular)?;
        factors.solve_in_place(MatMut::from_column_major_slice_mut(x, columns.ncols(), 1));
        Ok(Factors::Elimination)
    }

    /// Whether Cholesky's factors exist; the solution is in `x` then.
    fn by_cholesky(&mut self, values: &[f64], x: &mut [f64]) -> Result<bool, SparseError> {
        let Self { columns, cholesky, .. } = self;
        let symbolic = match cholesky {
            Some(known) => known.clone(),
            None => SymbolicLlt::try_new(columns.as_ref(), Side::Lower)
                .map_err(|_| SparseError::Memory)?,
        };
        *cholesky = Some(symbolic.clone());
        let matrix = SparseColMatRef::new(columns.as_ref(), values);
        let Ok(factors) = Llt::try_new_with_symbolic(symbolic, matrix, Side::Lower) else {
            return Ok(false);
        };
        let mut solution = x.to_vec();
        let size = columns.ncols();
        factors.solve_in_place(MatMut::from_column_major_slice_mut(&mut solution, size, 1));
        let is_solved = solution.iter().all(|value| value.is_finite());
        if is_solved {
            x.copy_from_slice(&solution);
        }
        Ok(is_solved)
    }
}

/// The power of two of the largest magnitude; one where there is none.
fn power_of_two(values: &[f64]) -> f64 {
    let largest = values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    // Its sign and exponent alone.
    let power = f64::from_bits(largest.to_bits() & f64::INFINITY.to_bits());
    if power.is_normal() { power } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solutions_scale_with_the_unit_of_the_matrix_to_the_bit() {
        let mut pattern = chain(30);
        let spring = |i: usize, j: usize| if i == j { 2.3 + i as f64 } else { -1.1 };
        let drift = |i: usize, j: usize| spring(i, j) + if i < j { 0.3 } else { 0.0 };
        for (entry, is_symmetric) in
            [(&spring as &dyn Fn(usize, usize) -> f64, true), (&drift, false)]
        {
            let mut solve = |power: i32| {
                let unit = 2.0_f64.powi(power);
                let values = values(&pattern, |i, j| unit * entry(i, j));
                let mut x: Vec<f64> = (0..30).map(|i| f64::from(i) * 0.7 - 5.1).collect();
                let factors = pattern.solve(&values, is_symmetric, &mut x).unwrap();
                (factors, x.iter().map(|x| (x * unit).to_bits()).collect::<Vec<_>>())
            };
            let usual = solve(0);
            for power in [-301, -7, 1, 4, 33] {
                assert_eq!(solve(power), usual, "2^{power}");
            }
        }
    }

    /// A chain of springs, each node with the next; the first held.
    fn chain(size: usize) -> Pattern {
        let (mut starts, mut rows) = (vec![0], Vec::new());
        for j in 0..size {
            rows.extend(j.saturating_sub(1)..(j + 2).min(size));
            starts.push(rows.len());
        }
        Pattern::new(starts, rows).unwrap()
    }

    fn values(pattern: &Pattern, entry: impl Fn(usize, usize) -> f64) -> Vec<f64> {
        let mut values = vec![0.0; pattern.entries()];
        for j in 0..pattern.unknowns() {
            for i in 0..pattern.unknowns() {
                if let Some(place) = pattern.place(i, j) {
                    values[place] = entry(i, j);
                }
            }
        }
        values
    }

    fn product(pattern: &Pattern, values: &[f64], x: &[f64]) -> Vec<f64> {
        let entry = |i, j| pattern.place(i, j).map_or(0.0, |place| values[place]);
        let row = |i| (0..x.len()).map(|j| entry(i, j) * x[j]).sum();
        (0..x.len()).map(row).collect()
    }

    #[test]
    fn positive_indefinite_and_unsymmetric_systems_are_solved() {
        let mut pattern = chain(40);
        let spring = |i: usize, j: usize| if i == j { 2.0 } else { -1.0 };
        let indefinite = |i: usize, j: usize| if i == j { 0.3 } else { -1.0 };
        let drift = |i: usize, j: usize| match i.cmp(&j) {
            std::cmp::Ordering::Less => -0.5,
            std::cmp::Ordering::Equal => 2.0,
            std::cmp::Ordering::Greater => -1.5,
        };
        type Entry = dyn Fn(usize, usize) -> f64;
        let all: [(&Entry, bool, Factors); 3] = [
            (&spring, true, Factors::Cholesky),
            (&indefinite, true, Factors::Elimination),
            (&drift, false, Factors::Elimination),
        ];
        for (entry, is_symmetric, expected) in all {
            let values = values(&pattern, entry);
            let right: Vec<f64> = (0..40).map(|i| (f64::from(i) * 0.7).sin()).collect();
            let mut x = right.clone();
            assert_eq!(pattern.solve(&values, is_symmetric, &mut x), Ok(expected));
            for (found, right) in product(&pattern, &values, &x).iter().zip(&right) {
                assert!((found - right).abs() < 1e-12, "{found} {right}");
            }
        }
    }

    #[test]
    fn a_singular_system_is_told() {
        let mut pattern = chain(3);
        let values = vec![0.0; pattern.entries()];
        let mut x = vec![1.0; 3];
        assert_eq!(pattern.solve(&values, true, &mut x), Err(SparseError::Singular));
    }

    #[test]
    fn what_is_no_matrix_is_refused() {
        for (starts, rows) in [
            (vec![], vec![]),
            (vec![0, 2, 1], vec![0, 1]),
            (vec![0, 1, 2], vec![0, 2]),
            (vec![0, 2, 3], vec![1, 0, 1]),
        ] {
            assert_eq!(Pattern::new(starts, rows).err(), Some(SparseError::Shape));
        }
    }
}
