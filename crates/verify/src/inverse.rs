//! Inverses and determinants of matrices of up to three rows. The library's are for any number, and are long: one of four rows alone has six thousand
//! lines of the compiler's code.

use nalgebra::SMatrix;

/// The inverse of a matrix of one, two or three rows; `None` where its determinant is zero.
pub(crate) fn inverse<const D: usize>(F: &SMatrix<f64, D, D>) -> Option<SMatrix<f64, D, D>> {
    const { assert!(1 <= D && D <= 3, "one, two or three rows") };
    // Of rows and columns, the products of the diagonal less those of the other one.
    let minor =
        |[i, j]: [usize; 2], [k, l]: [usize; 2]| F[(i, k)] * F[(j, l)] - F[(j, k)] * F[(i, l)];
    let others = |i: usize| [usize::from(i == 0), if i == 2 { 1 } else { 2 }];
    let determinant = match D {
        1 => F[(0, 0)],
        2 => minor([0, 1], [0, 1]),
        _ => {
            let of_column = |j: usize| F[(0, j)] * minor([1, 2], others(j));
            of_column(0) - of_column(1) + of_column(2)
        }
    };
    if determinant == 0.0 {
        return None;
    }
    Some(SMatrix::from_fn(|i, j| {
        let cofactor = match D {
            1 => 1.0,
            2 if i == j => F[(1 - i, 1 - j)],
            2 => -F[(i, j)],
            // Backwards, the sign is the other one.
            _ if (i + j) % 2 == 0 => minor(others(j), others(i)),
            _ => {
                let [a, b] = others(j);
                minor([b, a], others(i))
            }
        };
        cofactor / determinant
    }))
}

/// The determinant of a matrix of at most three rows.
pub(crate) fn determinant<const D: usize>(m: &SMatrix<f64, D, D>) -> f64 {
    match D {
        1 => m[(0, 0)],
        2 => m[(0, 0)] * m[(1, 1)] - m[(0, 1)] * m[(1, 0)],
        _ => (0..3)
            .map(|j| {
                let (k, l) = ((j + 1) % 3, (j + 2) % 3);
                m[(0, j)] * (m[(1, k)] * m[(2, l)] - m[(1, l)] * m[(2, k)])
            })
            .sum(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix1, Matrix2, Matrix3, matrix};

    #[test]
    fn determinants() {
        assert_eq!(determinant(&matrix![3.0]), 3.0);
        assert_eq!(determinant(&matrix![1.0, 2.0; 3.0, 4.0]), -2.0);
        let m = matrix![2.0, 0.0, 1.0; 1.0, 3.0, 2.0; 1.0, 1.0, 4.0];
        assert!((determinant(&m) - m.determinant()).abs() < 1e-14);
    }

    #[test]
    fn inverses_are_those_of_the_library_to_the_last_digit() {
        let numbers = |n: usize| ((n * n + 3 * n + 1) as f64 * 0.731).sin();
        for n in 0..200 {
            let F = Matrix1::from_fn(|_, _| numbers(n));
            assert_eq!(inverse(&F), F.try_inverse());
            let F = Matrix2::from_fn(|i, j| numbers(n + 2 * i + j));
            assert_eq!(inverse(&F), F.try_inverse());
            let F = Matrix3::from_fn(|i, j| numbers(n + 3 * i + j));
            assert_eq!(inverse(&F), F.try_inverse());
        }
        assert_eq!(inverse(&Matrix1::new(0.0)), None);
        assert_eq!(inverse(&Matrix2::repeat(2.0)), None);
        assert_eq!(inverse(&Matrix3::repeat(3.0)), None);
    }
}
