//! Domains of particles: their corners, and the means over them of functions that are interpolated between the corners.
//!
//! Where a hat function is replaced by its interpolation between the corners `x_c`, its mean over the domain is
//! `sum_c w_c phi_i(x_c)` and that of its gradient `sum_c g_c phi_i(x_c)`. Formulas are for one particle or for eight at once.

use mmsmith_lanes::simd::Number;
use nalgebra::{RealField, SMatrix};

// Loops are written out, as a closure would hide from the compiler that it may use vector instructions.

/// Corners of a domain in three dimensions; those in fewer use the first of as many places.
pub(crate) const MOST_CORNERS: usize = 8;

/// Nodes that a domain within two cells reaches along an axis.
pub(crate) const REACHED: usize = 3;

/// The half-edges of the parallelograms of all particles in the reference configuration: columns of matrices, lengths.
#[derive(Debug)]
pub(crate) enum HalfEdges<T, const D: usize> {
    /// As those of a lattice.
    Same(SMatrix<T, D, D>),
    Each(Vec<SMatrix<T, D, D>>),
}

impl<T: RealField + Copy, const D: usize> HalfEdges<T, D> {
    pub(crate) fn new(each: Vec<SMatrix<T, D, D>>) -> Self {
        match each.first() {
            Some(first) if each.iter().all(|own| own == first) => Self::Same(*first),
            _ => Self::Each(each),
        }
    }

    /// The half-edges of a particle.
    pub(crate) fn of(&self, p: usize) -> &SMatrix<T, D, D> {
        match self {
            Self::Same(half_edges) => half_edges,
            Self::Each(half_edges) => &half_edges[p],
        }
    }
}

/// The corners of a cell in pairs, the one that a row of cells reaches first and the one that the next cell of the row has as well.
pub(crate) const PAIRS: [[usize; 2]; MOST_CORNERS / 2] = [[0, 1], [3, 2], [4, 5], [7, 6]];

/// The shares `w` of a mean and `g` of a mean gradient that the corners have.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shares<N, const D: usize> {
    pub(crate) w: [N; MOST_CORNERS],
    pub(crate) g: [[N; D]; MOST_CORNERS],
}

/// On which side of the centre corner `index` of a parallelogram lies along an axis.
#[inline(always)]
pub(crate) fn is_upper(index: usize, axis: usize) -> bool {
    index >> axis & 1 == 1
}

/// The half-edges `E[axis][edge]` of the parallelogram that F makes of one with the half-edges `own[axis][edge]`, in the units that
/// `scale` gives.
#[inline(always)]
pub(crate) fn deformed<N: Number, const D: usize>(
    F: &[[N; D]; D],
    own: &[[N; D]; D],
    scale: N,
) -> [[N; D]; D] {
    let mut E = *own;
    for i in 0..D {
        for j in 0..D {
            let mut sum = F[i][0] * scale * own[0][j];
            for l in 1..D {
                sum = sum + F[i][l] * scale * own[l][j];
            }
            E[i][j] = sum;
        }
    }
    E
}

/// Corner `index` of the parallelogram about `x` with the half-edges `E[axis][edge]`: `x + E s`, `s_a` of -1 and 1.
///
/// With [slopes](slopes_of_parallelogram) in place of the half-edges, and zero in that of `x`, the corner's share of a mean gradient.
#[inline(always)]
pub(crate) fn corner_of_parallelogram<N: Number, const D: usize>(
    x: &[N; D],
    E: &[[N; D]; D],
    index: usize,
) -> [N; D] {
    let mut corner = *x;
    for a in 0..D {
        for i in 0..D {
            corner[i] = if is_upper(index, a) { corner[i] + E[i][a] } else { corner[i] - E[i][a] };
        }
    }
    corner
}

/// The share `w` of a mean that each corner of a parallelogram has, and `w E^-T`, from which [`corner_of_parallelogram`] makes its share
/// of a mean gradient. The parallelogram must have a volume.
///
/// The mean of `d/ds_a` of `prod (1 + s_a s)/2` is `w s_a`, and `d/dx = E^-T d/ds`.
#[inline(always)]
pub(crate) fn slopes_of_parallelogram<N: Number, const D: usize>(
    E: &[[N; D]; D],
) -> (N, [[N; D]; D]) {
    let w = E[0][0].constant(1.0 / f64::from(1 << D));
    let (mut slopes, determinant) = cofactors(E);
    let scale = w.divided_by(determinant);
    for row in &mut slopes {
        for slope in row {
            *slope = *slope * scale;
        }
    }
    (w, slopes)
}

#[inline(always)]
pub(crate) fn determinant<N: Number, const D: usize>(A: &[[N; D]; D]) -> N {
    cofactors(A).1
}

/// The cofactors of a matrix, and its determinant.
#[inline(always)]
fn cofactors<N: Number, const D: usize>(E: &[[N; D]; D]) -> ([[N; D]; D], N) {
    let one = E[0][0].constant(1.0);
    let mut cofactors = [[one; D]; D];
    for i in 0..D {
        for j in 0..D {
            cofactors[i][j] = match D {
                1 => one,
                2 if i == j => E[1 - i][1 - j],
                2 => one.constant(0.0) - E[1 - i][1 - j],
                _ => {
                    let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
                    E[a][c] * E[b][d] - E[a][d] * E[b][c]
                }
            };
        }
    }
    let mut determinant = E[0][0] * cofactors[0][0];
    for j in 1..D {
        determinant = determinant + E[0][j] * cofactors[0][j];
    }
    (cofactors, determinant)
}

/// The inverse of a symmetric matrix.
#[inline(always)]
pub(crate) fn inverse<N: Number, const D: usize>(A: &[[N; D]; D]) -> [[N; D]; D] {
    let (mut inverse, determinant) = cofactors(A);
    for row in &mut inverse {
        for entry in row {
            *entry = entry.divided_by(determinant);
        }
    }
    inverse
}

/// Sets the shares of the corners of a segment, of a quadrilateral or of a hexahedron, and gives its volume (length, area), which must not be
/// zero for the shares to have a meaning.
///
/// Corners of a quadrilateral go counter-clockwise; those of a hexahedron are those of its lower face, counter-clockwise as seen
/// from above, and then those above them. All means are exact for the map `x = sum_c N_c x_c` from the cube.
#[inline(always)]
pub(crate) fn shares_of_cell<N: Number, const D: usize>(
    x: &[[N; D]; MOST_CORNERS],
    shares: &mut Shares<N, D>,
) -> N {
    match D {
        1 => segment(x, shares),
        2 => quadrilateral(x, shares),
        _ => hexahedron(x, shares),
    }
}

/// The volume of a cell, as [`shares_of_cell`].
#[inline(always)]
pub(crate) fn volume_of_cell<N: Number, const D: usize>(x: &[[N; D]; MOST_CORNERS]) -> N {
    match D {
        1 => x[1][0] - x[0][0],
        2 => area(x),
        _ => hexahedron_volume(x),
    }
}

#[inline(always)]
fn segment<N: Number, const D: usize>(x: &[[N; D]; MOST_CORNERS], shares: &mut Shares<N, D>) -> N {
    let length = x[1][0] - x[0][0];
    let slope = length.constant(1.0).divided_by(length);
    for corner in 0..2 {
        shares.w[corner] = length.constant(0.5);
        let signed = if corner == 1 { slope } else { length.constant(0.0) - slope };
        shares.g[corner] = [signed; D];
    }
    length
}

/// `a x b` in the plane.
#[inline(always)]
fn cross<N: Number, const D: usize>(a: [N; D], b: [N; D]) -> N {
    a[0] * b[D - 1] - a[D - 1] * b[0]
}

#[inline(always)]
fn minus<N: Number, const D: usize>(mut a: [N; D], b: [N; D]) -> [N; D] {
    for i in 0..D {
        a[i] = a[i] - b[i];
    }
    a
}

#[inline(always)]
fn area<N: Number, const D: usize>(x: &[[N; D]; MOST_CORNERS]) -> N {
    x[0][0].constant(0.5) * cross(minus(x[2], x[0]), minus(x[3], x[1]))
}

/// The map's determinant is linear. With `T_c` the area of the triangle at corner c between its neighbours and A the area of all,
/// `w_c = 1/6 + T_c / (6 A)`.
#[inline(always)]
fn quadrilateral<N: Number, const D: usize>(
    x: &[[N; D]; MOST_CORNERS],
    shares: &mut Shares<N, D>,
) -> N {
    let area = area(x);
    let (half, sixth) = (area.constant(0.5), area.constant(1.0 / 6.0));
    let half_inverse = half.divided_by(area);
    for corner in 0..4 {
        let (own, next, last) = (x[corner], x[(corner + 1) % 4], x[(corner + 3) % 4]);
        // Twice the triangle.
        let triangle = cross(minus(next, own), minus(last, own));
        shares.w[corner] = sixth + sixth * (triangle * half_inverse);
        // The normals of the two sides at the corner, each with half of its length.
        let across = minus(next, last);
        shares.g[corner][0] = across[D - 1] * half_inverse;
        shares.g[corner][D - 1] = area.constant(0.0) - across[0] * half_inverse;
    }
    area
}

/// The place of each corner of a hexahedron where bit `a` says on which side of axis `a` it is.
const BITS: [usize; MOST_CORNERS] = [0, 1, 3, 2, 4, 5, 7, 6];

/// From values at the corners of the cube, by their [bits](BITS), to eight times the coefficients of
/// `1, s_0, s_1, s_0 s_1, s_2, s_0 s_2, s_1 s_2, s_0 s_1 s_2` in the trilinear function with those values.
#[inline(always)]
fn to_coefficients<N: Number>(values: &mut [N; MOST_CORNERS]) {
    for bit in [1, 2, 4] {
        for lower in 0..MOST_CORNERS {
            if lower & bit == 0 {
                let (a, b) = (values[lower], values[lower | bit]);
                (values[lower], values[lower | bit]) = (a + b, b - a);
            }
        }
    }
}

/// From coefficients, in the order of [`to_coefficients`], to values at the corners.
#[inline(always)]
fn to_corners<N: Number>(coefficients: &mut [N; MOST_CORNERS]) {
    for bit in [1, 2, 4] {
        for lower in 0..MOST_CORNERS {
            if lower & bit == 0 {
                let (a, b) = (coefficients[lower], coefficients[lower | bit]);
                (coefficients[lower], coefficients[lower | bit]) = (a - b, a + b);
            }
        }
    }
}

/// `a x b` in space.
#[inline(always)]
fn normal<N: Number, const D: usize>(a: [N; D], b: [N; D]) -> [N; D] {
    let mut normal = a;
    for i in 0..D {
        let (j, k) = ((i + 1) % D, (i + 2) % D);
        normal[i] = a[j] * b[k] - a[k] * b[j];
    }
    normal
}

#[inline(always)]
fn dot<N: Number, const D: usize>(a: [N; D], b: [N; D]) -> N {
    let mut sum = a[0] * b[0];
    for i in 1..D {
        sum = sum + a[i] * b[i];
    }
    sum
}

#[inline(always)]
fn plus<N: Number, const D: usize>(mut a: [N; D], b: [N; D]) -> [N; D] {
    for i in 0..D {
        a[i] = a[i] + b[i];
    }
    a
}

#[inline(always)]
fn times<N: Number, const D: usize>(mut a: [N; D], factor: N) -> [N; D] {
    for number in &mut a {
        *number = *number * factor;
    }
    a
}

/// Eight times the coefficients of the map from the cube, see [`to_coefficients`].
#[inline(always)]
fn coefficients_of_map<N: Number, const D: usize>(
    x: &[[N; D]; MOST_CORNERS],
) -> [[N; D]; MOST_CORNERS] {
    let mut m = *x;
    for i in 0..D {
        let mut values = [x[0][i]; MOST_CORNERS];
        for corner in 0..MOST_CORNERS {
            values[BITS[corner]] = x[corner][i];
        }
        to_coefficients(&mut values);
        for k in 0..MOST_CORNERS {
            m[k][i] = values[k];
        }
    }
    m
}

/// The volume of a [hexahedron].
#[inline(always)]
fn hexahedron_volume<N: Number, const D: usize>(x: &[[N; D]; MOST_CORNERS]) -> N {
    let [_, m1, m2, m3, m4, m5, m6, _] = coefficients_of_map(x);
    let third = m1[0].constant(1.0 / 3.0);
    let first = plus(normal(m2, m4), times(normal(m3, m5), third));
    let whole = dot(m1, first) + dot(m6, times(plus(normal(m3, m2), normal(m4, m5)), third));
    whole * third.constant(1.0 / 64.0)
}

/// The map's determinant is `(m_1 + m_3 s_1 + m_5 s_2 + m_7 s_1 s_2) . (m_2 + m_3 s_0 + m_6 s_2 + m_7 s_0 s_2) x (m_4 + m_5 s_0 +
/// m_6 s_1 + m_7 s_0 s_1)`, where `m_k` belongs to the product of those `s_a` whose bit is in k. Integrated over the cube,
///
/// ```text
/// V/8 = m_1 . (m_2 x m_4) + (m_1 . (m_3 x m_5) + m_6 . (m_3 x m_2 + m_4 x m_5)) / 3
/// ```
///
/// The share of a mean gradient is `g_c = dV/dx_c / V`, and `w_c` a sum of the moments of the determinant, since `N_c` is one of the
/// products.
#[inline(always)]
fn hexahedron<N: Number, const D: usize>(
    x: &[[N; D]; MOST_CORNERS],
    shares: &mut Shares<N, D>,
) -> N {
    let [_, m1, m2, m3, m4, m5, m6, m7] = coefficients_of_map(x);
    let one = m1[0].constant(1.0);
    let third = one.constant(1.0 / 3.0);
    let (n24, n41, n12) = (normal(m2, m4), normal(m4, m1), normal(m1, m2));
    let (n35, n63, n56) = (normal(m3, m5), normal(m6, m3), normal(m5, m6));
    let (n51, n26) = (normal(m5, m1), normal(m2, m6));
    let (n13, n64) = (normal(m1, m3), normal(m6, m4));
    let (n32, n45) = (normal(m3, m2), normal(m4, m5));
    // The derivatives of 64 V with respect to each coefficient.
    let zero = one.constant(0.0);
    let slopes = [
        [zero; D],
        plus(n24, times(n35, third)),
        plus(n41, times(n63, third)),
        times(plus(n51, n26), third),
        plus(n12, times(n56, third)),
        times(plus(n13, n64), third),
        times(plus(n32, n45), third),
        [zero; D],
    ];
    let whole = dot(m1, slopes[1]) + dot(m6, slopes[6]);
    let inverse = one.divided_by(whole);
    let (first, second) = (inverse * one.constant(1.0 / 24.0), inverse * one.constant(1.0 / 72.0));
    let mut w = [
        one.constant(0.125),
        (dot(m3, n41) + dot(m5, n12) + dot(m7, slopes[6])) * first,
        (dot(m3, n24) + dot(m6, n12) + dot(m7, slopes[5])) * first,
        (dot(m5, n32) + dot(m6, n13) + dot(m7, minus(n12, times(n56, third)))) * second,
        (dot(m5, n24) + dot(m6, n41) + dot(m7, slopes[3])) * first,
        (dot(m3, n45) + dot(m6, n51) + dot(m7, minus(n41, times(n63, third)))) * second,
        (dot(m3, n64) + dot(m5, n26) + dot(m7, minus(n24, times(n35, third)))) * second,
        dot(m5, n63) * (inverse * one.constant(-1.0 / 108.0)),
    ];
    to_corners(&mut w);
    for corner in 0..MOST_CORNERS {
        shares.w[corner] = w[BITS[corner]];
    }
    for i in 0..D {
        let mut values = [zero; MOST_CORNERS];
        for k in 1..MOST_CORNERS - 1 {
            values[k] = slopes[k][i] * inverse;
        }
        to_corners(&mut values);
        for corner in 0..MOST_CORNERS {
            shares.g[corner][i] = values[BITS[corner]];
        }
    }
    whole * one.constant(1.0 / 64.0)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, SMatrix, SVector, Vector2, vector};
    use proptest::prelude::*;

    use std::array;

    use super::*;
    use mmsmith_lanes::simd::One;
    use mmsmith_lanes::tensor::{determinant, inverse_transpose};

    /// Signs of `s` at the corners of the cube `|s_a| <= 1`.
    const SIGNS: [[f64; 3]; MOST_CORNERS] = [
        [-1.0, -1.0, -1.0],
        [1.0, -1.0, -1.0],
        [1.0, 1.0, -1.0],
        [-1.0, 1.0, -1.0],
        [-1.0, -1.0, 1.0],
        [1.0, -1.0, 1.0],
        [1.0, 1.0, 1.0],
        [-1.0, 1.0, 1.0],
    ];

    fn ones<const D: usize>(x: &SVector<f64, D>) -> [One<f64>; D] {
        array::from_fn(|i| One(x[i]))
    }

    /// The corners of a cell with their shares, and its volume.
    fn cell<const D: usize>(x: &[SVector<f64, D>]) -> (Vec<(f64, SVector<f64, D>)>, f64) {
        let corners = array::from_fn(|c| ones(&x[c % x.len()]));
        let none = ones(&SVector::<f64, D>::zeros());
        let mut shares = Shares { w: [One(0.0); MOST_CORNERS], g: [none; MOST_CORNERS] };
        let volume = shares_of_cell(&corners, &mut shares);
        assert!((volume_of_cell(&corners).0 - volume.0).abs() < 1e-14);
        let share = |c: usize| (shares.w[c].0, SVector::from_fn(|i, _| shares.g[c][i].0));
        ((0..x.len()).map(share).collect(), volume.0)
    }

    fn parallelogram<const D: usize>(
        x: &SVector<f64, D>,
        E: &SMatrix<f64, D, D>,
    ) -> Vec<(SVector<f64, D>, f64, SVector<f64, D>)> {
        let E: [[One<f64>; D]; D] = array::from_fn(|i| array::from_fn(|a| One(E[(i, a)])));
        let (w, slopes) = slopes_of_parallelogram(&E);
        let vector = |v: [One<f64>; D]| SVector::from_fn(|i, _| v[i].0);
        let x = |c: usize| vector(corner_of_parallelogram(&ones(x), &E, c));
        let g = |c: usize| vector(corner_of_parallelogram(&[One(0.0); D], &slopes, c));
        (0..1 << D).map(|c| (x(c), w.0, g(c))).collect()
    }

    fn point() -> impl Strategy<Value = Vector2<f64>> {
        (-0.2..0.2_f64, -0.2..0.2_f64).prop_map(|(x, y)| vector![x, y])
    }

    /// A convex quadrilateral near the unit square.
    fn quadrilateral() -> impl Strategy<Value = [Vector2<f64>; 4]> {
        (point(), point(), point(), point()).prop_map(|(a, b, c, d)| {
            [a, b + vector![1.0, 0.0], c + vector![1.0, 1.0], d + vector![0.0, 1.0]]
        })
    }

    proptest! {
        /// Against Gauss points on the bilinear map, which are exact for these integrands.
        #[test]
        fn means_over_quadrilaterals_are_exact(x in quadrilateral()) {
            let (corners, area) = cell(&x);
            let s = 1.0 / 3.0_f64.sqrt();
            let (mut total, mut w, mut g) = (0.0, [0.0; 4], [Vector2::zeros(); 4]);
            for (xi, eta) in [(-s, -s), (s, -s), (s, s), (-s, s)] {
                let signs = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
                let N = signs.map(|(a, b)| 0.25 * (1.0 + a * xi) * (1.0 + b * eta));
                let dN = signs.map(|(a, b)| vector![0.25 * a * (1.0 + b * eta), 0.25 * b * (1.0 + a * xi)]);
                let map: Matrix2<f64> = (0..4).map(|c| x[c] * dN[c].transpose()).sum();
                let J = map.determinant();
                let inverse_transpose = map.try_inverse().unwrap().transpose();
                total += J;
                for c in 0..4 {
                    w[c] += N[c] * J;
                    g[c] += inverse_transpose * dN[c] * J;
                }
            }
            prop_assert!((total - area).abs() < 1e-14);
            for c in 0..4 {
                prop_assert!((corners[c].0 - w[c] / total).abs() < 1e-14);
                prop_assert!((corners[c].1 - g[c] / total).norm() < 1e-13);
            }
        }

        /// Shares of means do not change when the domain turns, and shares of gradients turn with it.
        #[test]
        fn domains_turn_rigidly(x in quadrilateral(), angle in -3.2..3.2_f64) {
            let Q = Matrix2::new(angle.cos(), -angle.sin(), angle.sin(), angle.cos());
            let (still, _) = cell(&x);
            let (turned, _) = cell(&x.map(|x| Q * x));
            let E = Matrix2::from_columns(&[x[1] - x[0], x[3] - x[0]]);
            let of_box = parallelogram(&x[0], &E);
            let of_turned = parallelogram(&(Q * x[0]), &(Q * E));
            for c in 0..4 {
                prop_assert!((turned[c].0 - still[c].0).abs() < 1e-14);
                prop_assert!((turned[c].1 - Q * still[c].1).norm() < 1e-13);
                prop_assert!((of_turned[c].0 - Q * of_box[c].0).norm() < 1e-14);
                prop_assert!((of_turned[c].2 - Q * of_box[c].2).norm() < 1e-13);
            }
        }

        /// A parallelepiped is a hexahedron, whose corners come in another order.
        #[test]
        fn straight_hexahedra_have_the_shares_of_parallelepipeds(
            numbers in prop::array::uniform9(-0.4..0.4_f64),
        ) {
            let E = SMatrix::<f64, 3, 3>::from_fn(|i, j| numbers[3 * i + j] + if i == j { 1.0 } else { 0.0 });
            prop_assume!(determinant(&E) > 0.1);
            let of_box = parallelogram(&vector![0.3, -0.2, 0.7], &E);
            const ORDER: [usize; 8] = [0, 1, 3, 2, 4, 5, 7, 6];
            let (shares, volume) = cell(&ORDER.map(|c| of_box[c].0));
            prop_assert!((volume - 8.0 * determinant(&E)).abs() < 1e-13);
            for (c, (w, g)) in shares.iter().enumerate() {
                let (_, w1, g1) = of_box[ORDER[c]];
                prop_assert!((w - w1).abs() < 1e-13 && (g - g1).norm() < 1e-12);
            }
        }

        /// A linear field has its gradient in any hexahedron; shares against Gauss points of higher order on the trilinear map.
        #[test]
        fn means_over_hexahedra_are_exact(numbers in prop::array::uniform24(-0.2..0.2_f64)) {
            let x: [SVector<f64, 3>; 8] =
                array::from_fn(|c| SVector::from_fn(|a, _| SIGNS[c][a] + numbers[3 * c + a]));
            let (shares, volume) = cell(&x);
            prop_assert!((shares.iter().map(|s| s.0).sum::<f64>() - 1.0).abs() < 1e-14);
            let gradient: SMatrix<f64, 3, 3> =
                shares.iter().zip(&x).map(|((_, g), x)| x * g.transpose()).sum();
            prop_assert!((gradient - SMatrix::identity()).norm() < 1e-13);
            let nodes = [(-0.774_596_669_241_483_4, 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.774_596_669_241_483_4, 5.0 / 9.0)];
            let (mut whole, mut w, mut g) = (0.0, [0.0; 8], [SVector::<f64, 3>::zeros(); 8]);
            for (r, wr) in nodes {
                for (s, ws) in nodes {
                    for (t, wt) in nodes {
                        let N: [f64; 8] = array::from_fn(|c| {
                            [r, s, t].iter().zip(SIGNS[c]).map(|(s, sign)| 0.5 * (1.0 + sign * s)).product()
                        });
                        let slope = |c: usize, a: usize| -> f64 {
                            let each = |b: usize| if a == b { 0.5 * SIGNS[c][b] } else { 0.5 * (1.0 + SIGNS[c][b] * [r, s, t][b]) };
                            (0..3).map(each).product()
                        };
                        let map = SMatrix::<f64, 3, 3>::from_fn(|i, a| (0..8).map(|c| x[c][i] * slope(c, a)).sum());
                        let J = wr * ws * wt * determinant(&map);
                        let to_space = inverse_transpose(&map, determinant(&map));
                        whole += J;
                        for c in 0..8 {
                            w[c] += N[c] * J;
                            g[c] += to_space * SVector::from_fn(|a, _| slope(c, a)) * J;
                        }
                    }
                }
            }
            prop_assert!((whole - volume).abs() < 1e-13 * whole);
            for c in 0..8 {
                prop_assert!((shares[c].0 - w[c] / whole).abs() < 1e-13);
                prop_assert!((shares[c].1 - g[c] / whole).norm() < 1e-12);
            }
        }
    }
}
