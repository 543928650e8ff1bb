//! Tensors in three dimensions over any [`Number`].

use crate::number::Number;

/// A second-order tensor, `[row][column]`.
pub type Tensor<N> = [[N; 3]; 3];

/// The entries of a symmetric tensor, in the order of internal variables.
pub(crate) const ENTRIES: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];

/// A tensor with these entries.
pub(crate) fn tensor<N>(mut entry: impl FnMut(usize, usize) -> N) -> Tensor<N> {
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

/// The identity.
pub fn identity<N: Number>() -> Tensor<N> {
    tensor(|i, j| N::constant(if i == j { 1.0 } else { 0.0 }))
}

pub(crate) fn product<N: Number>(A: &Tensor<N>, B: &Tensor<N>) -> Tensor<N> {
    tensor(|i, j| A[i][0] * B[0][j] + A[i][1] * B[1][j] + A[i][2] * B[2][j])
}

pub(crate) fn transpose<N: Number>(A: &Tensor<N>) -> Tensor<N> {
    tensor(|i, j| A[j][i])
}

pub(crate) fn sum<N: Number>(A: &Tensor<N>, B: &Tensor<N>) -> Tensor<N> {
    tensor(|i, j| A[i][j] + B[i][j])
}

pub(crate) fn scaled<N: Number>(A: &Tensor<N>, factor: N) -> Tensor<N> {
    tensor(|i, j| A[i][j] * factor)
}

pub(crate) fn trace<N: Number>(A: &Tensor<N>) -> N {
    A[0][0] + A[1][1] + A[2][2]
}

/// `A : B`.
pub(crate) fn contraction<N: Number>(A: &Tensor<N>, B: &Tensor<N>) -> N {
    let of_row = |i: usize| A[i][0] * B[i][0] + A[i][1] * B[i][1] + A[i][2] * B[i][2];
    of_row(0) + of_row(1) + of_row(2)
}

pub(crate) fn deviator<N: Number>(A: &Tensor<N>) -> Tensor<N> {
    let mean = trace(A).times(1.0 / 3.0);
    tensor(|i, j| if i == j { A[i][j] - mean } else { A[i][j] })
}

pub(crate) fn symmetric<N: Number>(A: &Tensor<N>) -> Tensor<N> {
    tensor(|i, j| (A[i][j] + A[j][i]).times(0.5))
}

fn cofactor<N: Number>(A: &Tensor<N>, i: usize, j: usize) -> N {
    let at = |k: usize, l: usize| A[(i + k) % 3][(j + l) % 3];
    at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1)
}

/// The determinant.
pub fn determinant<N: Number>(A: &Tensor<N>) -> N {
    A[0][0] * cofactor(A, 0, 0) + A[0][1] * cofactor(A, 0, 1) + A[0][2] * cofactor(A, 0, 2)
}

pub(crate) fn inverse<N: Number>(A: &Tensor<N>) -> Tensor<N> {
    let reciprocal = N::constant(1.0) / determinant(A);
    tensor(|i, j| cofactor(A, j, i) * reciprocal)
}

/// The logarithm of a symmetric positive tensor, by inverse scaling and squaring: square roots until the tensor is next to the identity,
/// then `ln(A) = 2 artanh(Y)`, `Y = (A - I)(A + I)^-1`, by its series (N. J. Higham, "Functions of Matrices", SIAM (2008), chapter 11).
/// Equal principal values are no special case, for slopes neither.
pub(crate) fn logarithm<N: Number>(A: &Tensor<N>) -> Tensor<N> {
    /// Up to here the series is short.
    const NEAR: f64 = 0.25;
    let mut root = *A;
    let mut scale = 2.0;
    while distance_from_identity(&root) > NEAR && scale < 1e3 {
        root = square_root(&root);
        scale *= 2.0;
    }
    let one = identity::<N>();
    let X = tensor(|i, j| root[i][j] - one[i][j]);
    let Y = product(&X, &inverse(&sum(&root, &one)));
    let square = product(&Y, &Y);
    // The first power whose term is below rounding.
    let size = (0..9).map(|k| Y[k / 3][k % 3].value().powi(2)).sum::<f64>().sqrt();
    let mut terms = 1;
    while size.powi(2 * terms) > 1e-18 && terms < 16 {
        terms += 1;
    }
    let of = |term: i32| 1.0 / f64::from(2 * term + 1);
    let mut all = tensor(|i, j| one[i][j].times(of(terms)));
    for term in (0..terms).rev() {
        let next = product(&square, &all);
        all = tensor(|i, j| next[i][j] + one[i][j].times(of(term)));
    }
    let all = product(&Y, &all);
    tensor(|i, j| all[i][j].times(scale))
}

fn distance_from_identity<N: Number>(A: &Tensor<N>) -> f64 {
    let of = |i: usize, j: usize| (A[i][j].value() - if i == j { 1.0 } else { 0.0 }).powi(2);
    (0..9).map(|k| of(k / 3, k % 3)).sum::<f64>().sqrt()
}

/// The square root by the iteration of Denman and Beavers.
fn square_root<N: Number>(A: &Tensor<N>) -> Tensor<N> {
    let half_sum = |A: &Tensor<N>, B: &Tensor<N>| tensor(|i, j| (A[i][j] + B[i][j]).times(0.5));
    let (mut root, mut reciprocal) = (*A, identity::<N>());
    // Slopes converge a step later than values.
    let mut steps_left = 12;
    while steps_left > 0 {
        let next = half_sum(&root, &inverse(&reciprocal));
        reciprocal = half_sum(&reciprocal, &inverse(&root));
        let change =
            (0..9).map(|k| (next[k / 3][k % 3].value() - root[k / 3][k % 3].value()).abs());
        let is_close = change.fold(0.0, f64::max) < 1e-8;
        root = next;
        steps_left = if is_close { steps_left.min(2) - 1 } else { steps_left - 1 };
    }
    root
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::number::Dual;
    use nalgebra::Matrix3;

    #[test]
    fn logarithms_of_stretches_are_those_of_principal_values() {
        for (angle, values) in
            [(0.3, [1.0, 1.0, 1.0]), (0.7, [2.0, 2.0, 0.25]), (1.1, [3.0, 0.9, 1.1])]
        {
            let rotation = nalgebra::Rotation3::from_euler_angles(angle, 0.4, -0.2).into_inner();
            let of = |f: fn(f64) -> f64| {
                rotation * Matrix3::from_diagonal(&values.map(f).into()) * rotation.transpose()
            };
            let (B, expected) = (of(|x| x), of(f64::ln));
            let found = logarithm(&tensor(|i, j| B[(i, j)]));
            for k in 0..9 {
                let off = (found[k / 3][k % 3] - expected[(k / 3, k % 3)]).abs();
                assert!(off < 4e-15, "{values:?} {off:e}");
            }
        }
    }

    /// Also where principal values are equal, and do not stay so.
    #[test]
    fn slopes_of_logarithms_are_those_of_differences() {
        let B = [[1.4, 0.0, 0.0], [0.0, 1.4, 0.0], [0.0, 0.0, 0.8]];
        let along = [[0.3, 0.2, -0.1], [0.2, -0.4, 0.5], [-0.1, 0.5, 0.2]];
        let found = logarithm(&tensor(|i, j| Dual { value: B[i][j], slopes: [along[i][j]] }));
        let h = 1e-5;
        let at = |s: f64| logarithm(&tensor(|i, j| B[i][j] + s * along[i][j]));
        let (above, below) = (at(h), at(-h));
        for k in 0..9 {
            let (i, j) = (k / 3, k % 3);
            let difference = (above[i][j] - below[i][j]) / (2.0 * h);
            assert!((found[i][j].slopes[0] - difference).abs() < 1e-9, "{i} {j}");
        }
    }
}
