//! Tensors in three dimensions over any [`Number`].

use crate::number::Number;

/// A second-order tensor, `[row][column]`.
pub type Tensor<N> = [[N; 3]; 3];

/// The entries of a symmetric tensor, in the order of internal variables. The first four are those of a plane.
pub const ENTRIES: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];

/// A tensor with these entries.
#[inline]
pub(crate) fn tensor<N>(mut entry: impl FnMut(usize, usize) -> N) -> Tensor<N> {
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

/// The identity.
#[inline]
pub fn identity<N: Number>() -> Tensor<N> {
    tensor(|i, j| N::constant(if i == j { 1.0 } else { 0.0 }))
}

#[inline]
pub(crate) fn trace<N: Number>(A: &Tensor<N>) -> N {
    A[0][0] + A[1][1] + A[2][2]
}

#[inline]
pub(crate) fn symmetric<N: Number>(A: &Tensor<N>) -> Tensor<N> {
    tensor(|i, j| (A[i][j] + A[j][i]).times(0.5))
}

#[inline]
fn cofactor<N: Number>(A: &Tensor<N>, i: usize, j: usize) -> N {
    let at = |k: usize, l: usize| A[(i + k) % 3][(j + l) % 3];
    at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1)
}

/// The determinant.
#[inline]
pub fn determinant<N: Number>(A: &Tensor<N>) -> N {
    A[0][0] * cofactor(A, 0, 0) + A[0][1] * cofactor(A, 0, 1) + A[0][2] * cofactor(A, 0, 2)
}

/// Which entries of tensors may differ from zero: all, or those of a plane and of its normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Space {
    Plane,
    Whole,
}

impl Space {
    /// The tensor of these entries; zero where there are none.
    #[inline]
    pub(crate) fn tensor<N: Number>(self, mut entry: impl FnMut(usize, usize) -> N) -> Tensor<N> {
        match self {
            Self::Whole => tensor(entry),
            Self::Plane => {
                let zero = N::constant(0.0);
                [
                    [entry(0, 0), entry(0, 1), zero],
                    [entry(1, 0), entry(1, 1), zero],
                    [zero, zero, entry(2, 2)],
                ]
            }
        }
    }

    #[inline]
    pub(crate) fn map<N: Number>(self, A: &Tensor<N>, change: impl Fn(N) -> N) -> Tensor<N> {
        self.tensor(|i, j| change(A[i][j]))
    }

    #[inline]
    pub(crate) fn transpose<N: Number>(self, A: &Tensor<N>) -> Tensor<N> {
        self.tensor(|i, j| A[j][i])
    }

    #[inline]
    pub(crate) fn product<N: Number>(self, A: &Tensor<N>, B: &Tensor<N>) -> Tensor<N> {
        match self {
            Self::Whole => tensor(|i, j| A[i][0] * B[0][j] + A[i][1] * B[1][j] + A[i][2] * B[2][j]),
            Self::Plane => self.tensor(|i, j| {
                if i == 2 { A[2][2] * B[2][2] } else { A[i][0] * B[0][j] + A[i][1] * B[1][j] }
            }),
        }
    }

    /// `tr(A B)`.
    #[inline]
    pub(crate) fn contraction_with_transpose<N: Number>(self, A: &Tensor<N>, B: &Tensor<N>) -> N {
        let plane = A[0][0] * B[0][0]
            + A[1][1] * B[1][1]
            + A[2][2] * B[2][2]
            + A[0][1] * B[1][0]
            + A[1][0] * B[0][1];
        match self {
            Self::Plane => plane,
            Self::Whole => {
                plane
                    + A[0][2] * B[2][0]
                    + A[2][0] * B[0][2]
                    + A[1][2] * B[2][1]
                    + A[2][1] * B[1][2]
            }
        }
    }

    #[inline]
    pub(crate) fn determinant<N: Number>(self, A: &Tensor<N>) -> N {
        match self {
            Self::Whole => determinant(A),
            Self::Plane => (A[0][0] * A[1][1] - A[0][1] * A[1][0]) * A[2][2],
        }
    }

    #[inline]
    pub(crate) fn inverse<N: Number>(self, A: &Tensor<N>) -> Tensor<N> {
        match self {
            Self::Whole => {
                let reciprocal = N::constant(1.0) / determinant(A);
                tensor(|i, j| cofactor(A, j, i) * reciprocal)
            }
            Self::Plane => {
                let zero = N::constant(0.0);
                let reciprocal = N::constant(1.0) / (A[0][0] * A[1][1] - A[0][1] * A[1][0]);
                [
                    [A[1][1] * reciprocal, -(A[0][1] * reciprocal), zero],
                    [-(A[1][0] * reciprocal), A[0][0] * reciprocal, zero],
                    [zero, zero, N::constant(1.0) / A[2][2]],
                ]
            }
        }
    }

    /// `A^-1 B`.
    #[inline]
    pub(crate) fn solved<N: Number>(self, A: &Tensor<N>, B: &Tensor<N>) -> Tensor<N> {
        self.product(&self.inverse(A), B)
    }
}

/// `A^T A`.
#[inline]
pub(crate) fn symmetric_product<N: Number>(space: Space, A: &Tensor<N>) -> Tensor<N> {
    let entry = |i: usize, j: usize| {
        let plane = A[0][i] * A[0][j] + A[1][i] * A[1][j];
        match space {
            Space::Plane => plane,
            Space::Whole => plane + A[2][i] * A[2][j],
        }
    };
    let zero = N::constant(0.0);
    let (shear, first, second) = match space {
        Space::Plane => (entry(0, 1), zero, zero),
        Space::Whole => (entry(0, 1), entry(0, 2), entry(1, 2)),
    };
    let normal = match space {
        Space::Plane => A[2][2] * A[2][2],
        Space::Whole => entry(2, 2),
    };
    [[entry(0, 0), shear, first], [shear, entry(1, 1), second], [first, second, normal]]
}

/// The logarithm of a tensor with positive principal values, such as the product of two symmetric positive tensors. It is a polynomial in
/// the tensor whose coefficients are functions of its invariants; equal principal values are no special case, for slopes neither.
///
/// In a plane `ln A = ln(det A)/2 I + artanh(q/m)/q (A - m I)` with `m = tr(A)/2` and `q^2 = m^2 - det A`. In space, with
/// `A = m (I + D)`, `m = tr(A)/3`, the series of `ln(I + D)` is summed up modulo the characteristic polynomial of `D`.
pub(crate) struct Logarithm<N> {
    /// The logarithm less a multiple of the identity, which [`deviator`](Self::deviator) takes off.
    part: Tensor<N>,
    /// The trace of the logarithm.
    pub(crate) trace: N,
}

impl<N: Number> Logarithm<N> {
    #[inline]
    pub(crate) fn of(space: Space, A: &Tensor<N>) -> Self {
        match space {
            Space::Plane => Self::in_plane(A),
            Space::Whole => Self::in_space(A),
        }
    }

    #[inline]
    fn in_plane(A: &Tensor<N>) -> Self {
        let zero = N::constant(0.0);
        let m = (A[0][0] + A[1][1]).times(0.5);
        let difference = (A[0][0] - A[1][1]).times(0.5);
        let square = difference * difference + A[0][1] * A[1][0];
        let determinant = A[0][0] * A[1][1] - A[0][1] * A[1][0];
        let reciprocal = N::constant(1.0) / m;
        let k = artanh_of_root(square * reciprocal * reciprocal) * reciprocal;
        let of_plane = determinant.ln();
        let across = A[2][2].ln();
        let half = of_plane.times(0.5);
        let normal = difference * k;
        let part = [
            [half + normal, A[0][1] * k, zero],
            [A[1][0] * k, half - normal, zero],
            [zero, zero, across],
        ];
        Self { part, trace: of_plane + across }
    }

    fn in_space(A: &Tensor<N>) -> Self {
        // Up to here the series is short.
        const NEAR: f64 = 0.4;
        let m = trace(A).times(1.0 / 3.0);
        let reciprocal = N::constant(1.0) / m;
        let D =
            tensor(|i, j| if i == j { (A[i][i] - m) * reciprocal } else { A[i][j] * reciprocal });
        let square = Space::Whole.product(&D, &D);
        // D^3 = second D + third I, since its trace is zero.
        let second = trace(&square).times(0.5);
        let third = Space::Whole.contraction_with_transpose(&square, &D).times(1.0 / 3.0);
        // The largest principal value is at most this.
        let size = (second.value().max(0.0) * (4.0 / 3.0)).sqrt();
        if size > NEAR {
            // ln A = 2 ln sqrt(A), with the root of the whole tensor.
            let root = square_root(A);
            let Self { part, trace } = Self::in_space(&root);
            return Self {
                part: part.map(|row| row.map(|entry| entry.times(2.0))),
                trace: trace.times(2.0),
            };
        }
        let terms = if size > 0.0 {
            (2..48).find(|&n| size.powi(n) < 1e-17 * f64::from(n)).unwrap_or(48)
        } else {
            2
        };
        // Horner's scheme for the sum of (-1)^(n+1) D^n/n over n, as c0 + c1 D + c2 D^2.
        let coefficient = |n: i32| if n % 2 == 0 { -1.0 } else { 1.0 } / f64::from(n);
        let zero = N::constant(0.0);
        let (mut c0, mut c1, mut c2) = (N::constant(coefficient(terms)), zero, zero);
        for n in (1..terms).rev() {
            let next = N::constant(coefficient(n));
            (c0, c1, c2) = (c2 * third + next, c0 + c2 * second, c1);
        }
        (c0, c1, c2) = (c2 * third, c0 + c2 * second, c1);
        let part = tensor(|i, j| {
            let own = D[i][j] * c1 + square[i][j] * c2;
            if i == j { own + c0 } else { own }
        });
        let of_m = m.ln();
        // tr(D) = 0 and tr(D^2) = 2 second.
        let trace = (of_m + c0).times(3.0) + (second * c2).times(2.0);
        Self { part, trace }
    }

    /// The deviator of the logarithm.
    #[inline]
    pub(crate) fn deviator(&self, space: Space) -> Tensor<N> {
        let part = &self.part;
        let mean = (part[0][0] + part[1][1] + part[2][2]).times(1.0 / 3.0);
        space.tensor(|i, j| if i == j { part[i][i] - mean } else { part[i][j] })
    }
}

/// `artanh(sqrt(x))/sqrt(x)` for `0 <= x < 1`, and a little below zero.
#[inline]
fn artanh_of_root<N: Number>(x: N) -> N {
    let size = x.value().abs();
    if size > 0.04 {
        let root = x.sqrt();
        let one = N::constant(1.0);
        return ((one + root) / (one - root)).ln().times(0.5) / root;
    }
    // The sum of x^n/(2 n + 1).
    let terms = match size {
        0.0..1e-8 => 3,
        1e-8..1e-4 => 5,
        1e-4..1e-2 => 9,
        _ => 13,
    };
    let mut sum = N::constant(1.0 / f64::from(2 * terms + 1));
    for n in (0..terms).rev() {
        sum = sum * x + N::constant(1.0 / f64::from(2 * n + 1));
    }
    sum
}

/// The square root by the iteration of Denman and Beavers (N. J. Higham, "Functions of Matrices", SIAM (2008), chapter 6).
fn square_root<N: Number>(A: &Tensor<N>) -> Tensor<N> {
    let half_sum = |A: &Tensor<N>, B: &Tensor<N>| tensor(|i, j| (A[i][j] + B[i][j]).times(0.5));
    let (mut root, mut reciprocal) = (*A, identity::<N>());
    // Slopes converge a step later than values.
    let mut steps_left = 14;
    while steps_left > 0 {
        let next = half_sum(&root, &Space::Whole.inverse(&reciprocal));
        reciprocal = half_sum(&reciprocal, &Space::Whole.inverse(&root));
        let change =
            (0..9).map(|k| (next[k / 3][k % 3].value() - root[k / 3][k % 3].value()).abs());
        let size = (0..9).map(|k| next[k / 3][k % 3].value().abs()).fold(0.0, f64::max);
        let is_close = change.fold(0.0, f64::max) < 1e-8 * size;
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

    fn logarithm<N: Number>(space: Space, A: &Tensor<N>) -> Tensor<N> {
        let found = Logarithm::of(space, A);
        let dev = found.deviator(space);
        let mean = found.trace.times(1.0 / 3.0);
        tensor(|i, j| if i == j { dev[i][i] + mean } else { dev[i][j] })
    }

    #[test]
    fn logarithms_of_stretches_are_those_of_principal_values() {
        for (angles, values) in [
            ([0.3, 0.4, -0.2], [1.0, 1.0, 1.0]),
            ([0.7, 0.4, -0.2], [2.0, 2.0, 0.25]),
            ([1.1, 0.4, -0.2], [3.0, 0.9, 1.1]),
            ([0.2, 0.4, -0.2], [1.02, 0.98, 1.01]),
            ([0.0, 0.0, 0.4], [1.1, 0.97, 1.2]),
            ([0.0, 0.0, 0.4], [2.5, 0.4, 1.2]),
            ([0.0, 0.0, -0.8], [1.7, 1.7, 0.6]),
        ] {
            let rotation = nalgebra::Rotation3::from_euler_angles(angles[0], angles[1], angles[2])
                .into_inner();
            let of = |f: fn(f64) -> f64| {
                rotation * Matrix3::from_diagonal(&values.map(f).into()) * rotation.transpose()
            };
            let (B, expected) = (of(|x| x), of(f64::ln));
            let spaces = if angles[0] == 0.0 {
                vec![Space::Whole, Space::Plane]
            } else {
                vec![Space::Whole]
            };
            for space in spaces {
                let found = logarithm(space, &tensor(|i, j| B[(i, j)]));
                for k in 0..9 {
                    let off = (found[k / 3][k % 3] - expected[(k / 3, k % 3)]).abs();
                    assert!(off < 4e-15, "{space:?} {values:?} {off:e}");
                }
            }
        }
    }

    /// Also where principal values are equal, and do not stay so.
    #[test]
    fn slopes_of_logarithms_are_those_of_differences() {
        let shear = [[0.3, 0.2, -0.1], [0.2, -0.4, 0.5], [-0.1, 0.5, 0.2]];
        let plane = [[0.3, 0.2, 0.0], [0.2, -0.4, 0.0], [0.0, 0.0, 0.2]];
        for (space, along, first) in [
            (Space::Whole, shear, [1.4, 1.4, 0.8]),
            (Space::Whole, shear, [1.0, 1.0, 1.0]),
            (Space::Whole, shear, [2.4, 1.4, 0.8]),
            (Space::Plane, plane, [1.4, 1.4, 0.8]),
            (Space::Plane, plane, [1.9, 0.7, 0.8]),
            (Space::Plane, plane, [1.02, 0.99, 0.8]),
        ] {
            let B = tensor(|i, j| if i == j { first[i] } else { 0.0 });
            let dual = tensor(|i, j| Dual { value: B[i][j], slopes: [along[i][j]] });
            let found = logarithm(space, &dual);
            let h = 1e-5;
            let at = |s: f64| logarithm(space, &tensor(|i, j| B[i][j] + s * along[i][j]));
            let (above, below) = (at(h), at(-h));
            for k in 0..9 {
                let (i, j) = (k / 3, k % 3);
                let difference = (above[i][j] - below[i][j]) / (2.0 * h);
                assert!((found[i][j].slopes[0] - difference).abs() < 1e-9, "{space:?} {i} {j}");
            }
        }
    }
}
