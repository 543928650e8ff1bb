//! Isotropic tensors in space by principal stretches, for laws that are stated in these.
//!
//! Principal directions have no derivative where two stretches are equal, though an isotropic tensor has one: with slopes it is formed on
//! the axes of the values alone (R. W. Ogden, "Non-Linear Elastic Deformations" (1984), section 6.1.4).

use mmsmith_lanes::tensor::real;
use nalgebra::{Matrix3, RealField, SMatrix, Vector3};

use super::finger_minus_identity;
use super::slopes::{carries_slopes, without_slopes};

/// The isotropic tensor in space that is coaxial with b, whose principal values follow from the logarithms of the squared principal
/// stretches: `2 ln V` where they are these.
pub(super) fn coaxial_in_space<T: RealField + Copy, const D: usize>(
    F: &SMatrix<T, D, D>,
    principal: impl Fn([T; 3]) -> [T; 3],
) -> SMatrix<T, D, D> {
    if const { carries_slopes::<T>() } {
        return with_slopes(F, principal);
    }
    let (directions, logarithms) = principal_logarithms(F);
    let values = principal(logarithms.into());
    SMatrix::from_fn(|i, j| {
        (0..3).fold(T::zero(), |sum, k| sum + directions[(i, k)] * values[k] * directions[(j, k)])
    })
}

/// The principal directions of b, in columns, and the logarithms of the squared stretches along them, in three dimensions.
///
/// `NaN` where they cannot be found, which no finite deformation gradient has been seen to bring about.
pub(super) fn principal_logarithms<T: RealField + Copy, const D: usize>(
    F: &SMatrix<T, D, D>,
) -> (Matrix3<T>, Vector3<T>) {
    const MOST_ITERATIONS: usize = 1000;
    let B = finger_minus_identity(F);
    if B.norm() < real(0.5) {
        // The eigenvalues of b - I are small differences, which b itself would not keep.
        Matrix3::from_fn(|i, j| B[(i, j)])
            .try_symmetric_eigen(T::default_epsilon(), MOST_ITERATIONS)
            .map(|eigen| (eigen.eigenvectors, eigen.eigenvalues.map(|e| e.ln_1p())))
    } else {
        // The square in b would cost a very flat particle's smallest stretch its digits.
        Matrix3::from_fn(|i, j| F[(i, j)])
            .try_svd(true, false, T::default_epsilon(), MOST_ITERATIONS)
            .and_then(|svd| Some((svd.u?, svd.singular_values.map(|s| s.ln() * real(2.0)))))
    }
    .unwrap_or((Matrix3::identity(), Vector3::repeat(real(f64::NAN))))
}

/// The isotropic tensor in space that is coaxial with b, whose principal values follow from the logarithms of the squared principal
/// stretches, with slopes.
///
/// On the principal axes, a change `db` of b changes the tensor's diagonal by what its principal values change, and its component i, j by
/// `(s_i - s_j)/(b_i - b_j) db_ij`, whose limit for equal stretches is a derivative of principal values.
fn with_slopes<T: RealField + Copy, const D: usize>(
    F: &SMatrix<T, D, D>,
    principal: impl Fn([T; 3]) -> [T; 3],
) -> SMatrix<T, D, D> {
    /// Logarithms that differ by less are equal: to twelve digits of the limit.
    const EQUAL: f64 = 1e-5;
    let own: SMatrix<f64, D, D> = F.map(nalgebra::convert_unchecked::<T, f64>);
    let (axes, logarithms) = principal_logarithms(&own);
    let axes: Matrix3<T> = axes.map(nalgebra::convert);
    let B = finger_minus_identity(F);
    let B = axes.transpose() * Matrix3::from_fn(|i, j| B[(i, j)]) * axes;
    let slope_of_B = B.map(|entry| entry - without_slopes(entry));
    let squares: [f64; 3] = std::array::from_fn(|k| nalgebra::convert(logarithms[k].exp()));
    let number = |value: f64| nalgebra::convert::<f64, T>(value);
    let values = principal(std::array::from_fn(|k| {
        number(logarithms[k]) + slope_of_B[(k, k)] / number(squares[k])
    }));
    let on_axes = Matrix3::from_fn(|i, j| {
        if i == j {
            return values[i];
        }
        let apart = logarithms[i] - logarithms[j];
        if apart.abs() > EQUAL {
            let change = without_slopes(values[i]) - without_slopes(values[j]);
            return change / number(squares[i] - squares[j]) * slope_of_B[(i, j)];
        }
        let mean = 0.5 * (logarithms[i] + logarithms[j]);
        let half = slope_of_B[(i, j)] / number(2.0 * mean.exp());
        let mut close = [number(0.0); 3].map(|_: T| number(0.0));
        for k in 0..3 {
            close[k] = number(if k == i || k == j { mean } else { logarithms[k] });
        }
        close[i] += half;
        close[j] -= half;
        let close = principal(close);
        close[i] - close[j] - without_slopes(close[i] - close[j])
    });
    let turned = axes * on_axes * axes.transpose();
    SMatrix::from_fn(|i, j| turned[(i, j)])
}
