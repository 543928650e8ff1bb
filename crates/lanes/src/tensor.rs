//! Determinants and inverses of the 1x1, 2x2 and 3x3 matrices of the solver, generic over the dimension.

use nalgebra::{RealField, SMatrix};

/// A constant of the scalar type.
#[inline(always)]
pub fn real<T: RealField>(value: f64) -> T {
    nalgebra::convert(value)
}

/// `det(I + H) - 1` without the cancellation that forming the determinant first would bring at small strain.
#[inline(always)]
pub fn det_minus_one<T: RealField + Copy, const D: usize>(H: &SMatrix<T, D, D>) -> T {
    const { assert!(1 <= D && D <= 3, "one, two or three dimensions") };
    match D {
        1 => H[(0, 0)],
        2 => H[(0, 0)] + H[(1, 1)] + (H[(0, 0)] * H[(1, 1)] - H[(0, 1)] * H[(1, 0)]),
        _ => {
            let minor = |i: usize, j: usize| H[(i, i)] * H[(j, j)] - H[(i, j)] * H[(j, i)];
            let det = H[(0, 0)] * minor(1, 2)
                - H[(0, 1)] * (H[(1, 0)] * H[(2, 2)] - H[(1, 2)] * H[(2, 0)])
                + H[(0, 2)] * (H[(1, 0)] * H[(2, 1)] - H[(1, 1)] * H[(2, 0)]);
            H[(0, 0)] + H[(1, 1)] + H[(2, 2)] + (minor(0, 1) + minor(1, 2) + minor(0, 2)) + det
        }
    }
}

/// `J = det F`.
#[inline(always)]
pub fn determinant<T: RealField + Copy, const D: usize>(F: &SMatrix<T, D, D>) -> T {
    const { assert!(1 <= D && D <= 3, "one, two or three dimensions") };
    match D {
        1 => F[(0, 0)],
        2 => F[(0, 0)] * F[(1, 1)] - F[(0, 1)] * F[(1, 0)],
        _ => {
            F[(0, 0)] * (F[(1, 1)] * F[(2, 2)] - F[(1, 2)] * F[(2, 1)])
                - F[(0, 1)] * (F[(1, 0)] * F[(2, 2)] - F[(1, 2)] * F[(2, 0)])
                + F[(0, 2)] * (F[(1, 0)] * F[(2, 1)] - F[(1, 1)] * F[(2, 0)])
        }
    }
}

/// `F^-T`, the cofactors over the determinant `J`, which must not be zero.
#[inline(always)]
pub fn inverse_transpose<T: RealField + Copy, const D: usize>(
    F: &SMatrix<T, D, D>,
    J: T,
) -> SMatrix<T, D, D> {
    const { assert!(1 <= D && D <= 3, "one, two or three dimensions") };
    SMatrix::from_fn(|i, j| {
        let cofactor = match D {
            1 => T::one(),
            2 if i == j => F[(1 - i, 1 - j)],
            2 => -F[(1 - i, 1 - j)],
            _ => cofactor(F, i, j),
        };
        cofactor / J
    })
}

/// `F^-T - I`, without cancellation at small strain; `det F` must not be zero.
#[inline(always)]
pub fn inverse_transpose_minus_identity<T: RealField + Copy, const D: usize>(
    F: &SMatrix<T, D, D>,
) -> SMatrix<T, D, D> {
    const { assert!(1 <= D && D <= 3, "one, two or three dimensions") };
    if det_minus_one(&(F - SMatrix::identity())) < real(-0.5) {
        // Near inversion it is J itself whose digits count.
        return inverse_transpose(F, determinant(F)) - SMatrix::identity();
    }
    inverse_transpose_minus_identity_short(F)
}

/// As [`inverse_transpose_minus_identity`], to the last bit, for `det F` of 1/2 or more, in half as many divisions.
#[inline(always)]
pub fn inverse_transpose_minus_identity_short<T: RealField + Copy, const D: usize>(
    F: &SMatrix<T, D, D>,
) -> SMatrix<T, D, D> {
    let H = F - SMatrix::identity();
    let trace = H.trace();
    let growth = det_minus_one(&H);
    let J = growth + T::one();
    // The cofactors of F = I + H are those of I, which is I itself, and in two dimensions tr(H) I - H^T, to which a third one
    // adds the cofactors of H.
    SMatrix::from_fn(|i, j| {
        let mut change = if D == 1 { T::zero() } else { -H[(j, i)] };
        if i == j {
            change += if D == 1 { T::zero() } else { trace } - growth;
        }
        if D == 3 {
            change += cofactor(&H, i, j);
        }
        change / J
    })
}

/// A cofactor of a 3x3 matrix.
#[inline(always)]
fn cofactor<T: RealField + Copy, const D: usize>(F: &SMatrix<T, D, D>, i: usize, j: usize) -> T {
    // Taking the rows and columns cyclically gives every one its sign.
    let (a, b) = ((i + 1) % 3, (i + 2) % 3);
    let (c, d) = ((j + 1) % 3, (j + 2) % 3);
    F[(a, c)] * F[(b, d)] - F[(a, d)] * F[(b, c)]
}

/// `A B`; the general product would branch on sizes first.
#[inline(always)]
pub fn product<T: RealField + Copy, const D: usize>(
    A: &SMatrix<T, D, D>,
    B: &SMatrix<T, D, D>,
) -> SMatrix<T, D, D> {
    SMatrix::from_fn(|i, j| {
        let mut sum = A[(i, 0)] * B[(0, j)];
        for k in 1..D {
            sum += A[(i, k)] * B[(k, j)];
        }
        sum
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix1, Matrix2, Matrix3};

    #[test]
    fn determinants_and_inverses_agree_with_the_library() {
        let f1 = Matrix1::new(0.7_f64);
        let f2 = Matrix2::new(1.2_f64, 0.3, -0.4, 0.9);
        let f3 = Matrix3::new(1.2_f64, 0.3, -0.1, -0.4, 0.9, 0.25, 0.15, -0.35, 1.1);
        assert!((determinant(&f1) - f1.determinant()).abs() < 1e-15);
        assert!((determinant(&f2) - f2.determinant()).abs() < 1e-15);
        assert!((determinant(&f3) - f3.determinant()).abs() < 1e-15);
        assert!((det_minus_one(&(f1 - Matrix1::identity())) + 1.0 - 0.7).abs() < 1e-15);
        assert!(
            (det_minus_one(&(f2 - Matrix2::identity())) + 1.0 - f2.determinant()).abs() < 1e-15
        );
        assert!(
            (det_minus_one(&(f3 - Matrix3::identity())) + 1.0 - f3.determinant()).abs() < 1e-15
        );
        let residual = inverse_transpose(&f2, determinant(&f2)).transpose() * f2;
        assert!((residual - Matrix2::identity()).norm() < 1e-15);
        let residual = inverse_transpose(&f3, determinant(&f3)).transpose() * f3;
        assert!((residual - Matrix3::identity()).norm() < 1e-15);
        check_small(&f1);
        check_small(&f2);
        check_small(&f3);
        assert!((product(&f3, &f3) - f3 * f3).norm() < 1e-15);
    }

    fn check_small<const D: usize>(F: &SMatrix<f64, D, D>) {
        let H = F - SMatrix::identity();
        let change = inverse_transpose_minus_identity(F);
        let expected = inverse_transpose(F, determinant(F)) - SMatrix::identity();
        assert!((change - expected).norm() < 1e-15);
        // To first order it is -H^T, to second order that plus the square.
        // Few bits, so that I + H is exact.
        let tiny = H.map(|h| (h * 64.0).round()) * 2f64.powi(-40);
        let series = (tiny * tiny - tiny).transpose();
        let change = inverse_transpose_minus_identity(&(SMatrix::identity() + tiny));
        assert!((change - series).norm() < 1e-15 * series.norm());
    }
}
