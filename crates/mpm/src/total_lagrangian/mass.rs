//! Mass matrices along one axis, and their solution along any axis of an array.
//!
//! With particle masses that are products over the axes, the consistent mass matrix is the Kronecker product of one
//! banded matrix for each axis, so that its inverse is applied axis after axis.

use super::basis::{Basis, Part};
use crate::fault::{Fault, Planted};

/// A mass matrix that can be solved for.
#[derive(Clone, Debug)]
pub(crate) enum Mass {
    /// Lumped: the reciprocal of each entry.
    Diagonal(Vec<f64>),
    /// Consistent: its factors.
    Banded(Ldl),
}

/// The factors of a symmetric positive definite banded matrix `L D L^T`, the diagonal of L being one.
///
/// Without square roots, so that masses in other units, a power of two apart, give the same bits.
#[derive(Clone, Debug)]
pub(crate) struct Ldl {
    size: usize,
    /// Entries beside the diagonal in each row.
    band: usize,
    /// `band` entries a row, `L[i][i - band + k]` at k; those before the first column are zero, as are `band` more rows.
    below: Vec<f64>,
    /// Reciprocals of the entries of D.
    reciprocal: Vec<f64>,
}

impl Mass {
    /// The consistent mass matrix `sum_q w_q N_i N_j`; `None` where the points do not determine all coefficients.
    pub(crate) fn consistent(basis: &Basis, weights: &[f64]) -> Option<Self> {
        let (size, band) = (basis.functions, basis.width - 1);
        let mut lower = vec![0.0; size * (band + 1)];
        for (q, w) in weights.iter().enumerate() {
            let (first, row) = basis.row(q, Part::Value);
            for (k, a) in row.iter().enumerate() {
                for (l, b) in row[..=k].iter().enumerate() {
                    if k - l == band && Planted::here().is(Fault::MassBandDropped) {
                        continue;
                    }
                    lower[(first + k) * (band + 1) + band + l - k] += w * a * b;
                }
            }
        }
        Ldl::new(size, band, &lower).map(Self::Banded)
    }

    /// The row sums `sum_q w_q N_i`. `even` are the functions continued with equal sign at walls, whose sum is one;
    /// those with the opposite sign have the same masses, but for the ones on a wall that are left out: `skipped` at the
    /// lower end.
    pub(crate) fn lumped(even: &Basis, weights: &[f64], skipped: usize, count: usize) -> Self {
        let mut sums = vec![0.0; even.functions];
        even.integrate(Part::Value, 1, weights, &mut sums);
        Self::Diagonal(sums[skipped..skipped + count].iter().map(|m| m.recip()).collect())
    }

    /// Solves in place along one axis of an array, `values[o][j][i]` with `i < inner`.
    pub(crate) fn solve(&self, inner: usize, values: &mut [f64]) {
        match self {
            Self::Diagonal(reciprocal) => {
                for block in values.chunks_exact_mut(reciprocal.len() * inner) {
                    for (line, factor) in block.chunks_exact_mut(inner).zip(reciprocal) {
                        line.iter_mut().for_each(|value| *value *= factor);
                    }
                }
            }
            Self::Banded(factor) => match factor.band {
                0 => factor.solve::<0>(inner, values),
                1 => factor.solve::<1>(inner, values),
                2 => factor.solve::<2>(inner, values),
                3 => factor.solve::<3>(inner, values),
                4 => factor.solve::<4>(inner, values),
                _ => factor.solve::<5>(inner, values),
            },
        }
    }
}

impl Ldl {
    /// Factors the matrix with the lower rows `lower[i][band - d] = A[i][i - d]`; `None` where it is not positive
    /// definite to within rounding.
    fn new(size: usize, band: usize, lower: &[f64]) -> Option<Self> {
        let width = band + 1;
        // L beside the diagonal, D on it.
        let mut factor = lower.to_vec();
        for i in 0..size {
            let lowest = i.saturating_sub(band);
            // The row of L D first: entry k of it meets entry k of the rows above.
            for j in lowest..i {
                let mut sum = factor[i * width + band + j - i];
                for k in lowest.max(j.saturating_sub(band))..j {
                    sum -= factor[i * width + band + k - i] * factor[j * width + band + k - j];
                }
                factor[i * width + band + j - i] = sum;
            }
            let diagonal = lower[i * width + band];
            let mut sum = diagonal;
            for k in lowest..i {
                let with_D = factor[i * width + band + k - i];
                let below = with_D / factor[k * width + band];
                factor[i * width + band + k - i] = below;
                sum -= with_D * below;
            }
            if sum.is_nan() || sum <= 1e-13 * diagonal {
                return None;
            }
            factor[i * width + band] = sum;
        }
        let rows = factor.chunks_exact(width);
        Some(Self {
            size,
            band,
            below: {
                let below = rows.clone().flat_map(|row| row[..band].iter().copied());
                below.chain(std::iter::repeat_n(0.0, band * band)).collect()
            },
            reciprocal: rows.map(|row| row[band].recip()).collect(),
        })
    }

    fn solve<const B: usize>(&self, inner: usize, values: &mut [f64]) {
        if inner == 1 {
            let mut groups = values.chunks_exact_mut(LINES * self.size);
            groups.by_ref().for_each(|lines| self.solve_lines::<B, LINES>(lines));
            let rest = groups.into_remainder().chunks_exact_mut(self.size);
            rest.for_each(|line| self.solve_lines::<B, 1>(line));
            return;
        }
        for block in values.chunks_exact_mut(self.size * inner) {
            for i in 0..self.size {
                let (before, rest) = block.split_at_mut(i * inner);
                let line = &mut rest[..inner];
                for d in (1..=B.min(i)).rev() {
                    let factor = self.below[i * B + B - d];
                    let other = &before[(i - d) * inner..][..inner];
                    line.iter_mut().zip(other).for_each(|(x, y)| *x -= factor * y);
                }
            }
            for i in (0..self.size).rev() {
                let (upto, after) = block.split_at_mut((i + 1) * inner);
                let line = &mut upto[i * inner..];
                line.iter_mut().for_each(|x| *x *= self.reciprocal[i]);
                for d in (1..=B.min(self.size - 1 - i)).rev() {
                    let factor = self.below[(i + d) * B + B - d];
                    let other = &after[(d - 1) * inner..][..inner];
                    line.iter_mut().zip(other).for_each(|(x, y)| *x -= factor * y);
                }
            }
        }
    }

    /// Solves for `L` contiguous lines at once.
    fn solve_lines<const B: usize, const L: usize>(&self, lines: &mut [f64]) {
        let size = self.size;
        let mut pass = |order: &mut dyn Iterator<Item = usize>, backwards: bool| {
            // The last B values of each line, the latest first. Those that do not exist are zero, as are their factors.
            let mut latest = [[0.0; L]; B];
            for i in order {
                let scale = if backwards { self.reciprocal[i] } else { 1.0 };
                let mut now: [f64; L] = std::array::from_fn(|l| lines[l * size + i] * scale);
                for d in (1..=B).rev() {
                    let factor = self.below[(i + usize::from(backwards) * d) * B + B - d];
                    for l in 0..L {
                        now[l] -= factor * latest[d - 1][l];
                    }
                }
                for l in 0..L {
                    lines[l * size + i] = now[l];
                }
                latest.rotate_right(usize::from(B > 0));
                if let Some(first) = latest.first_mut() {
                    *first = now;
                }
            }
        };
        pass(&mut (0..size), false);
        pass(&mut (0..size).rev(), true);
    }
}

/// Lines that are solved side by side: each value of a line has to wait for the one before it.
const LINES: usize = 8;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::total_lagrangian::{Axis, End, Layout};
    use nalgebra::{DMatrix, DVector};

    #[test]
    fn the_banded_solution_is_that_of_the_dense_matrix() {
        for p in 2..=5 {
            for ends in [[End::Free; 2], [End::Wall; 2], [End::Wall, End::Free]] {
                for normal in [false, true] {
                    let axis = Axis { lower: 0.0, upper: 1.0, cells: 6, ends };
                    let (points, weights) = axis.points(p + 1, Layout::Gauss);
                    let basis = Basis::new(&axis, p, normal, &points).unwrap();
                    let m = basis.functions;
                    let mut dense = DMatrix::<f64>::zeros(m, m);
                    for (q, w) in weights.iter().enumerate() {
                        let (first, row) = basis.row(q, Part::Value);
                        for (k, a) in row.iter().enumerate() {
                            for (l, b) in row.iter().enumerate() {
                                dense[(first + k, first + l)] += w * a * b;
                            }
                        }
                    }
                    let mass = Mass::consistent(&basis, &weights).unwrap();
                    for (outer, inner) in [(2, 3), (LINES + 2, 1)] {
                        let wave = |i: usize| (i as f64 * 0.37).sin();
                        let given: Vec<f64> = (0..outer * m * inner).map(wave).collect();
                        let mut solved = given.clone();
                        mass.solve(inner, &mut solved);
                        for line in 0..outer * inner {
                            let at = |k: usize| (line / inner * m + k) * inner + line % inner;
                            let column = DVector::from_fn(m, |k, _| solved[at(k)]);
                            let expected = DVector::from_fn(m, |k, _| given[at(k)]);
                            assert!((&dense * column - expected).norm() < 1e-12, "{p} {ends:?}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn too_few_points_are_seen() {
        let axis = Axis { lower: 0.0, upper: 1.0, cells: 6, ends: [End::Free; 2] };
        let (points, weights) = axis.points(1, Layout::Lattice);
        let basis = Basis::new(&axis, 3, false, &points).unwrap();
        assert!(Mass::consistent(&basis, &weights).is_none());
    }

    #[test]
    fn lumped_masses_add_up_to_the_whole() {
        let axis = Axis { lower: 0.0, upper: 2.0, cells: 6, ends: [End::Wall; 2] };
        let (points, weights) = axis.points(2, Layout::Lattice);
        let basis = Basis::new(&axis, 3, false, &points).unwrap();
        let Mass::Diagonal(reciprocal) = Mass::lumped(&basis, &weights, 0, basis.functions) else {
            panic!("not lumped");
        };
        let whole: f64 = reciprocal.iter().map(|m| m.recip()).sum();
        assert!((whole - 2.0).abs() < 1e-14);
    }
}
