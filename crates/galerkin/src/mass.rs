//! Mass matrices along one axis, and their solution along any axis of an array.
//!
//! With particle masses that are products over the axes, the consistent mass matrix is the Kronecker product of one
//! banded matrix for each axis, so that its inverse is applied axis after axis.

use mmsmith_laws::fault::{Fault, Planted};
use mmsmith_threads::{each, each_chunk};

use super::axis::{Axis, End};
use super::basis::{Basis, ValueOrSlope};
use super::piece;

/// The mass matrix along one axis, which can be solved for.
#[derive(Clone, Debug)]
pub(crate) struct Mass {
    inverse: Inverse,
    /// Coefficients that are copies of the first ones: the degree, along a periodic axis.
    copies: usize,
}

/// How a system is solved.
#[derive(Clone, Debug)]
enum Inverse {
    /// Lumped: the reciprocal of each entry.
    Diagonal(Vec<f64>),
    /// Consistent: its factors.
    Banded(Ldl),
    /// Consistent, periodic.
    Bordered(Bordered),
}

/// A symmetric banded matrix: `band + 1` entries a row, `A[i][i - d]` at `band - d`.
#[derive(Clone, Debug)]
pub(crate) struct Band {
    size: usize,
    band: usize,
    lower: Vec<f64>,
}

/// The factors of a symmetric positive definite banded matrix `L D L^T`, the diagonal of L being one.
///
/// Without square roots, so that masses in other units, a power of two apart, give the same bits.
#[derive(Clone, Debug)]
struct Ldl {
    size: usize,
    /// Entries beside the diagonal in each row.
    band: usize,
    /// `band` entries a row, `L[i][i - band + k]` at k; those before the first column are zero, as are `band` more rows.
    below: Vec<f64>,
    /// Reciprocals of the entries of D.
    reciprocal: Vec<f64>,
}

/// A cyclic banded matrix `[[B, C], [C^T, E]]`: all but the last `border` unknowns are coupled by the band matrix B.
#[derive(Clone, Debug)]
struct Bordered {
    size: usize,
    border: usize,
    inner: Ldl,
    /// C, `border` entries a row, and `B^-1 C`.
    coupling: Vec<f64>,
    solved: Vec<f64>,
    /// `E - C^T B^-1 C`.
    schur: Ldl,
}

impl Band {
    /// The consistent mass matrix `sum_q w_q N_i N_j`.
    pub(crate) fn consistent(basis: &Basis, weights: &[f64]) -> Self {
        let (size, band) = (basis.functions, basis.width - 1);
        let mut lower = vec![0.0; size * (band + 1)];
        for (q, w) in weights.iter().enumerate() {
            let (first, row) = basis.row(q, ValueOrSlope::Value);
            for (k, a) in row.iter().enumerate() {
                for (l, b) in row[..=k].iter().enumerate() {
                    if k - l == band && Planted::here().is(Fault::MassBandDropped) {
                        continue;
                    }
                    lower[(first + k) * (band + 1) + band + l - k] += w * a * b;
                }
            }
        }
        Self { size, band, lower }
    }

    /// `A[i][j]` with `j <= i`, both inside the band.
    fn at(&mut self, i: usize, j: usize) -> &mut f64 {
        &mut self.lower[i * (self.band + 1) + self.band + j - i]
    }

    /// Multiplies along one axis of an array: `output[o][i][k] = sum_j A_ij input[o][j][k]`, `k < inner`.
    pub(crate) fn multiply(&self, inner: usize, input: &[f64], output: &mut [f64]) {
        let blocks = input.chunks_exact(self.size * inner);
        for (input, output) in blocks.zip(output.chunks_exact_mut(self.size * inner)) {
            output.fill(0.0);
            let line = |i: usize| i * inner..(i + 1) * inner;
            for (i, row) in self.lower.chunks_exact(self.band + 1).enumerate() {
                for d in 0..=self.band.min(i) {
                    let factor = row[self.band - d];
                    let add = |x: &mut f64, y: &f64| *x += factor * y;
                    let (to, from) = (&mut output[line(i)], &input[line(i - d)]);
                    to.iter_mut().zip(from).for_each(|(x, y)| add(x, y));
                    if d > 0 {
                        let (to, from) = (&mut output[line(i - d)], &input[line(i)]);
                        to.iter_mut().zip(from).for_each(|(x, y)| add(x, y));
                    }
                }
            }
        }
    }

    /// The matrix without the couplings of an end's coefficient, which keeps a one on the diagonal.
    fn without(mut self, fixed: [bool; 2]) -> Self {
        let ends = [0, self.size - 1];
        let is_fixed = |i: usize| (0..2).any(|end| fixed[end] && i == ends[end]);
        for i in 0..self.size {
            for j in i.saturating_sub(self.band)..=i {
                if is_fixed(i) || is_fixed(j) {
                    *self.at(i, j) = f64::from(i == j);
                }
            }
        }
        self
    }
}

impl Mass {
    /// Factors a consistent matrix, the coefficients of ends where the component's motion is given left out; `None` where the particles do not
    /// determine all coefficients.
    pub(crate) fn consistent(axis: &Axis, component: usize, matrix: &Band) -> Option<Self> {
        if axis.ends[0] == End::Periodic {
            let copies = matrix.band;
            let bordered = Bordered::new(matrix, copies)?;
            return Some(Self { inverse: Inverse::Bordered(bordered), copies });
        }
        let factors = Ldl::new(&matrix.clone().without(axis.moved(component)))?;
        Some(Self { inverse: Inverse::Banded(factors), copies: 0 })
    }

    /// The row sums `sum_q w_q N_i`. `even` are the functions continued with equal sign at walls, whose sum is one;
    /// those with the opposite sign have the same masses, but for the ones on a wall that are left out: `skipped` at the
    /// lower end.
    pub(crate) fn lumped(
        axis: &Axis,
        even: &Basis,
        weights: &[f64],
        skipped: usize,
        count: usize,
    ) -> Self {
        let mut sums = vec![0.0; even.functions];
        even.integrate(ValueOrSlope::Value, 1, weights, &mut sums);
        let copies = if axis.ends[0] == End::Periodic { even.functions - axis.cells } else { 0 };
        let (own, copied) = sums.split_at_mut(even.functions - copies);
        own.iter_mut().zip(copied).for_each(|(own, copy)| *own += *copy);
        let kept = skipped..skipped + count - copies;
        let reciprocal = sums[kept].iter().map(|m| m.recip()).collect();
        Self { inverse: Inverse::Diagonal(reciprocal), copies }
    }

    /// Solves in place along one axis of an array, `values[o][j][i]` with `i < inner`.
    ///
    /// Along a periodic axis the last `copies` coefficients are the first ones once more: what was integrated against both is
    /// added up, and both get the solution.
    pub(crate) fn solve(&self, inner: usize, values: &mut [f64]) {
        if self.copies == 0 {
            return self.inverse.solve(inner, values);
        }
        let own = self.inverse.size() * inner;
        for block in values.chunks_exact_mut(own + self.copies * inner) {
            let (own, copies) = block.split_at_mut(own);
            own.iter_mut().zip(&*copies).for_each(|(own, copy)| *own += copy);
            self.inverse.solve(inner, own);
            copies.copy_from_slice(&own[..copies.len()]);
        }
    }
}

impl Inverse {
    fn size(&self) -> usize {
        match self {
            Self::Diagonal(reciprocal) => reciprocal.len(),
            Self::Banded(factor) => factor.size,
            Self::Bordered(bordered) => bordered.size,
        }
    }

    fn solve(&self, inner: usize, values: &mut [f64]) {
        match self {
            Self::Diagonal(reciprocal) => {
                for block in values.chunks_exact_mut(reciprocal.len() * inner) {
                    for (line, factor) in block.chunks_exact_mut(inner).zip(reciprocal) {
                        line.iter_mut().for_each(|value| *value *= factor);
                    }
                }
            }
            Self::Banded(factor) => factor.solve(inner, values),
            Self::Bordered(bordered) => bordered.solve(inner, values),
        }
    }
}

impl Bordered {
    /// Folds the matrix of a periodic axis, whose last `border` functions are copies of the first ones; `None` where it is
    /// not positive definite to within rounding. There have to be more functions of their own than copies.
    fn new(unfolded: &Band, border: usize) -> Option<Self> {
        let size = unfolded.size - border;
        let head = size - border;
        let band =
            |size: usize, band: usize| Band { size, band, lower: vec![0.0; size * (band + 1)] };
        let mut inner = band(head, unfolded.band);
        let mut corner = band(border, border - 1);
        let mut coupling = vec![0.0; head * border];
        for (i, row) in unfolded.lower.chunks_exact(unfolded.band + 1).enumerate() {
            for d in 0..=unfolded.band.min(i) {
                let value = row[unfolded.band - d];
                let (one, other) = (i % size, (i - d) % size);
                let (low, high) = (one.min(other), one.max(other));
                if high < head {
                    *inner.at(high, low) += value;
                } else if low < head {
                    coupling[low * border + high - head] += value;
                } else {
                    *corner.at(high - head, low - head) += value;
                }
            }
        }
        let inner = Ldl::new(&inner)?;
        let mut solved = coupling.clone();
        inner.solve(border, &mut solved);
        for (c, z) in coupling.chunks_exact(border).zip(solved.chunks_exact(border)) {
            for i in 0..border {
                for j in 0..=i {
                    *corner.at(i, j) -= c[i] * z[j];
                }
            }
        }
        Some(Self { size, border, schur: Ldl::new(&corner)?, inner, coupling, solved })
    }

    fn solve(&self, inner: usize, values: &mut [f64]) {
        for block in values.chunks_exact_mut(self.size * inner) {
            let (head, border) = block.split_at_mut((self.size - self.border) * inner);
            self.inner.solve(inner, head);
            let lines = head.chunks_exact(inner).zip(self.coupling.chunks_exact(self.border));
            for (line, row) in lines {
                for (target, factor) in border.chunks_exact_mut(inner).zip(row) {
                    target.iter_mut().zip(line).for_each(|(x, y)| *x -= factor * y);
                }
            }
            self.schur.solve(inner, border);
            let lines = head.chunks_exact_mut(inner).zip(self.solved.chunks_exact(self.border));
            for (line, row) in lines {
                for (source, factor) in border.chunks_exact(inner).zip(row) {
                    line.iter_mut().zip(source).for_each(|(x, y)| *x -= factor * y);
                }
            }
        }
    }
}

impl Ldl {
    /// Factors a matrix; `None` where it is not positive definite to within rounding.
    fn new(matrix: &Band) -> Option<Self> {
        let Band { size, band, ref lower } = *matrix;
        let width = band + 1;
        // L beside the diagonal, D on it.
        let mut factor = lower.clone();
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

    fn solve(&self, inner: usize, values: &mut [f64]) {
        match self.band {
            0 => self.solve_of::<0>(inner, values),
            1 => self.solve_of::<1>(inner, values),
            2 => self.solve_of::<2>(inner, values),
            3 => self.solve_of::<3>(inner, values),
            4 => self.solve_of::<4>(inner, values),
            _ => self.solve_of::<5>(inner, values),
        }
    }

    fn solve_of<const B: usize>(&self, inner: usize, values: &mut [f64]) {
        let most = piece(values.len());
        if inner == 1 {
            let groups = most.div_ceil(LINES * self.size);
            each_chunk(values, groups * LINES * self.size, &|_, values| {
                let mut groups = values.chunks_exact_mut(LINES * self.size);
                groups.by_ref().for_each(|lines| self.solve_lines::<B, LINES>(lines));
                let rest = groups.into_remainder().chunks_exact_mut(self.size);
                rest.for_each(|line| self.solve_lines::<B, 1>(line));
            });
            return;
        }
        let size = self.size * inner;
        if size <= most {
            each_chunk(values, most / size * size, &|_, values| {
                for block in values.chunks_exact_mut(size) {
                    let mut lines: Vec<_> = block.chunks_exact_mut(inner).collect();
                    self.solve_columns::<B>(&mut lines);
                }
            });
            return;
        }
        // The lines of a block, each cut into columns that depend on no others.
        let columns = (most / self.size).max(LEAST_COLUMNS);
        let mut pieces = Vec::new();
        for block in values.chunks_exact_mut(size) {
            let mut of_block: Vec<Vec<&mut [f64]>> = Vec::new();
            of_block.resize_with(inner.div_ceil(columns), || Vec::with_capacity(self.size));
            for line in block.chunks_exact_mut(inner) {
                for (piece, columns) in of_block.iter_mut().zip(line.chunks_mut(columns)) {
                    piece.push(columns);
                }
            }
            pieces.append(&mut of_block);
        }
        each(pieces, &|mut lines| self.solve_columns::<B>(&mut lines));
    }

    /// Solves for values side by side: line i has those of place i along the axis.
    fn solve_columns<const B: usize>(&self, lines: &mut [&mut [f64]]) {
        for i in 0..self.size {
            let (before, rest) = lines.split_at_mut(i);
            for d in (1..=B.min(i)).rev() {
                let factor = self.below[i * B + B - d];
                rest[0].iter_mut().zip(&*before[i - d]).for_each(|(x, y)| *x -= factor * y);
            }
        }
        for i in (0..self.size).rev() {
            let (upto, after) = lines.split_at_mut(i + 1);
            let line = &mut upto[i];
            line.iter_mut().for_each(|x| *x *= self.reciprocal[i]);
            for d in (1..=B.min(self.size - 1 - i)).rev() {
                let factor = self.below[(i + d) * B + B - d];
                line.iter_mut().zip(&*after[d - 1]).for_each(|(x, y)| *x -= factor * y);
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

/// Values side by side that are worth a piece of their own.
const LEAST_COLUMNS: usize = 64;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Layout;
    use nalgebra::{DMatrix, DVector};

    const ENDS: [[End; 2]; 6] = [
        [End::FREE; 2],
        [End::Wall; 2],
        [End::Wall, End::FREE],
        [End::MOVED; 2],
        [End::MOVED, End::Wall],
        [End::Periodic; 2],
    ];

    /// A cell between walls has one function of second degree, which is coupled with no other.
    #[test]
    fn a_function_by_itself_is_divided_by_its_mass() {
        let axis = Axis { lower: 0.0, upper: 1.0, cells: 1, ends: [End::Wall; 2] };
        let (points, weights) = axis.points(3, Layout::Gauss);
        for normal in [false, true] {
            let basis = Basis::new(&axis, 2, normal, &points).unwrap();
            assert_eq!((basis.functions, basis.width), (1, 1));
            let of_point = |q: usize| weights[q] * basis.row(q, ValueOrSlope::Value).1[0].powi(2);
            let expected: f64 = (0..3).map(of_point).sum();
            let mass = Mass::consistent(&axis, 0, &Band::consistent(&basis, &weights)).unwrap();
            for inner in [1, 3] {
                let mut values: Vec<f64> = (1..=21).map(f64::from).collect();
                mass.solve(inner, &mut values);
                for (k, value) in values.iter().enumerate() {
                    assert!(
                        (value * expected / (k as f64 + 1.0) - 1.0).abs() < 1e-14,
                        "{inner} {k}"
                    );
                }
            }
        }
    }

    /// The matrix between the coefficients that are not given and not copies, and where these lie.
    fn dense(axis: &Axis, basis: &Basis, weights: &[f64]) -> (DMatrix<f64>, Vec<usize>) {
        let [lower, upper] = axis.moved(0).map(usize::from);
        let periodic = axis.ends[0] == End::Periodic;
        let own = if periodic { axis.cells } else { basis.functions };
        let mut dense = DMatrix::<f64>::zeros(own, own);
        for (q, w) in weights.iter().enumerate() {
            let (first, row) = basis.row(q, ValueOrSlope::Value);
            for (k, a) in row.iter().enumerate() {
                for (l, b) in row.iter().enumerate() {
                    dense[((first + k) % own, (first + l) % own)] += w * a * b;
                }
            }
        }
        let kept: Vec<usize> = (lower..own - upper).collect();
        (dense.select_rows(&kept).select_columns(&kept), kept)
    }

    #[test]
    fn the_banded_solution_is_that_of_the_dense_matrix() {
        for p in 2..=5 {
            for (ends, cells) in ENDS.map(|ends| (ends, 6)).into_iter().chain([
                (ENDS[5], p + 1),
                (ENDS[5], 2 * p),
                (ENDS[5], 2 * p + 1),
                (ENDS[5], 20),
            ]) {
                for normal in [false, true] {
                    let axis = Axis { lower: 0.0, upper: 1.0, cells, ends };
                    let (points, weights) = axis.points(p + 1, Layout::Gauss);
                    let basis = Basis::new(&axis, p, normal, &points).unwrap();
                    let m = basis.functions;
                    let (dense, kept) = dense(&axis, &basis, &weights);
                    let mass =
                        Mass::consistent(&axis, 0, &Band::consistent(&basis, &weights)).unwrap();
                    for (outer, inner) in [(2, 3), (LINES + 2, 1)] {
                        let wave = |i: usize| (i as f64 * 0.37).sin();
                        let given: Vec<f64> = (0..outer * m * inner).map(wave).collect();
                        let mut solved = given.clone();
                        mass.solve(inner, &mut solved);
                        for line in 0..outer * inner {
                            let at = |k: usize| (line / inner * m + k) * inner + line % inner;
                            let column = DVector::from_fn(kept.len(), |k, _| solved[at(kept[k])]);
                            let mut expected =
                                DVector::from_fn(kept.len(), |k, _| given[at(kept[k])]);
                            if ends[0] == End::Periodic {
                                for k in 0..p {
                                    expected[k] += given[at(cells + k)];
                                    assert_eq!(solved[at(cells + k)], solved[at(k)]);
                                }
                            }
                            let off = (&dense * column - expected).norm();
                            assert!(off < 1e-12, "{p} {ends:?} {cells}: {off:e}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn the_product_is_that_of_the_dense_matrix() {
        let axis = Axis { lower: 0.0, upper: 1.0, cells: 5, ends: [End::FREE; 2] };
        let (points, weights) = axis.points(4, Layout::Gauss);
        let basis = Basis::new(&axis, 3, false, &points).unwrap();
        let (dense, _) = dense(&axis, &basis, &weights);
        let (m, inner) = (basis.functions, 2);
        let given: Vec<f64> = (0..3 * m * inner).map(|i| (i as f64 * 0.37).sin()).collect();
        let mut product = vec![f64::NAN; given.len()];
        Band::consistent(&basis, &weights).multiply(inner, &given, &mut product);
        for line in 0..3 * inner {
            let at = |k: usize| (line / inner * m + k) * inner + line % inner;
            let expected = &dense * DVector::from_fn(m, |k, _| given[at(k)]);
            for k in 0..m {
                assert!((product[at(k)] - expected[k]).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn too_few_points_are_seen() {
        for ends in [End::FREE, End::MOVED, End::Periodic] {
            let axis = Axis { lower: 0.0, upper: 1.0, cells: 6, ends: [ends; 2] };
            let (points, mut weights) = axis.points(1, Layout::Lattice);
            if ends != End::FREE {
                // One a cell is enough for these.
                weights[2..].fill(0.0);
            }
            let basis = Basis::new(&axis, 3, false, &points).unwrap();
            assert!(Mass::consistent(&axis, 0, &Band::consistent(&basis, &weights)).is_none());
        }
    }

    #[test]
    fn lumped_masses_add_up_to_the_whole() {
        for ends in [End::Wall, End::Periodic] {
            let axis = Axis { lower: 0.0, upper: 2.0, cells: 6, ends: [ends; 2] };
            let (points, weights) = axis.points(2, Layout::Lattice);
            let basis = Basis::new(&axis, 3, false, &points).unwrap();
            let mass = Mass::lumped(&axis, &basis, &weights, 0, basis.functions);
            let Inverse::Diagonal(reciprocal) = mass.inverse else {
                panic!("not lumped");
            };
            let whole: f64 = reciprocal.iter().map(|m| m.recip()).sum();
            assert!((whole - 2.0).abs() < 1e-14);
        }
    }
}
