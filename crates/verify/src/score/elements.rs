//! Elements of meshes by the numbers that VTK has for them: nodes, shape functions and points of quadrature.

use nalgebra::{SMatrix, SVector};

/// Polynomials of an element.
#[derive(Clone, Copy)]
enum Polynomials {
    /// Polynomials of this total degree.
    Simplex(u8),
    /// Polynomials of this degree in each variable.
    Tensor(u8),
    /// Quadratic in one variable at most.
    Serendipity,
    /// Linear in the plane of a triangle, and along the axis.
    Wedge,
}

/// An element of a number in VTK's files.
struct Row {
    number: u8,
    dimension: usize,
    corners: &'static [[f64; 3]],
    /// Pairs of corners with a node between them.
    middles: &'static [[usize; 2]],
    /// Further nodes.
    others: &'static [[f64; 3]],
    polynomials: Polynomials,
}

const LINE: &[[f64; 3]] = &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]];
const TRIANGLE: &[[f64; 3]] = &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
const SQUARE: &[[f64; 3]] = &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
const PIXEL: &[[f64; 3]] = &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
const TETRAHEDRON: &[[f64; 3]] =
    &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
const CUBE: &[[f64; 3]] = &[
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [1.0, 1.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 0.0, 1.0],
    [1.0, 1.0, 1.0],
    [0.0, 1.0, 1.0],
];
const VOXEL: &[[f64; 3]] = &[
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [1.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 0.0, 1.0],
    [0.0, 1.0, 1.0],
    [1.0, 1.0, 1.0],
];
const WEDGE: &[[f64; 3]] = &[
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 0.0, 1.0],
    [0.0, 1.0, 1.0],
];
const EDGES_OF_TRIANGLE: &[[usize; 2]] = &[[0, 1], [1, 2], [2, 0]];
const EDGES_OF_SQUARE: &[[usize; 2]] = &[[0, 1], [1, 2], [2, 3], [3, 0]];
const EDGES_OF_TETRAHEDRON: &[[usize; 2]] = &[[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];
const EDGES_OF_CUBE: &[[usize; 2]] = &[
    [0, 1],
    [1, 2],
    [2, 3],
    [3, 0],
    [4, 5],
    [5, 6],
    [6, 7],
    [7, 4],
    [0, 4],
    [1, 5],
    [2, 6],
    [3, 7],
];
const CENTRE_OF_SQUARE: &[[f64; 3]] = &[[0.5, 0.5, 0.0]];
const CENTRES_OF_CUBE: &[[f64; 3]] = &[
    [0.0, 0.5, 0.5],
    [1.0, 0.5, 0.5],
    [0.5, 0.0, 0.5],
    [0.5, 1.0, 0.5],
    [0.5, 0.5, 0.0],
    [0.5, 0.5, 1.0],
    [0.5, 0.5, 0.5],
];

const fn row(
    number: u8,
    dimension: usize,
    corners: &'static [[f64; 3]],
    middles: &'static [[usize; 2]],
    others: &'static [[f64; 3]],
    polynomials: Polynomials,
) -> Row {
    Row { number, dimension, corners, middles, others, polynomials }
}

/// Source of numbers and orders of nodes: Schroeder, Martin & Lorensen, "The Visualization Toolkit", 4th ed. (2006), and
/// `vtkCellType.h`.
const ROWS: &[Row] = &[
    row(3, 1, LINE, &[], &[], Polynomials::Tensor(1)),
    row(21, 1, LINE, &[[0, 1]], &[], Polynomials::Tensor(2)),
    row(5, 2, TRIANGLE, &[], &[], Polynomials::Simplex(1)),
    row(22, 2, TRIANGLE, EDGES_OF_TRIANGLE, &[], Polynomials::Simplex(2)),
    row(8, 2, PIXEL, &[], &[], Polynomials::Tensor(1)),
    row(9, 2, SQUARE, &[], &[], Polynomials::Tensor(1)),
    row(23, 2, SQUARE, EDGES_OF_SQUARE, &[], Polynomials::Serendipity),
    row(28, 2, SQUARE, EDGES_OF_SQUARE, CENTRE_OF_SQUARE, Polynomials::Tensor(2)),
    row(10, 3, TETRAHEDRON, &[], &[], Polynomials::Simplex(1)),
    row(24, 3, TETRAHEDRON, EDGES_OF_TETRAHEDRON, &[], Polynomials::Simplex(2)),
    row(11, 3, VOXEL, &[], &[], Polynomials::Tensor(1)),
    row(12, 3, CUBE, &[], &[], Polynomials::Tensor(1)),
    row(25, 3, CUBE, EDGES_OF_CUBE, &[], Polynomials::Serendipity),
    row(29, 3, CUBE, EDGES_OF_CUBE, CENTRES_OF_CUBE, Polynomials::Tensor(2)),
    row(13, 3, WEDGE, &[], &[], Polynomials::Wedge),
];

impl Row {
    fn nodes(&self) -> Vec<[f64; 3]> {
        let middle = |[one, other]: &[usize; 2]| {
            let (one, other) = (self.corners[*one], self.corners[*other]);
            std::array::from_fn(|axis| 0.5 * (one[axis] + other[axis]))
        };
        let middles = self.middles.iter().map(middle);
        self.corners.iter().copied().chain(middles).chain(self.others.iter().copied()).collect()
    }

    /// The exponents of the monomials.
    fn monomials(&self) -> Vec<[u8; 3]> {
        let highest = match self.polynomials {
            Polynomials::Simplex(degree) | Polynomials::Tensor(degree) => degree,
            Polynomials::Serendipity => 2,
            Polynomials::Wedge => 1,
        };
        let range = |axis: usize| 0..=if axis < self.dimension { highest } else { 0 };
        let all =
            range(0).flat_map(|i| range(1).flat_map(move |j| range(2).map(move |k| [i, j, k])));
        let is_in = |powers: &[u8; 3]| match self.polynomials {
            Polynomials::Simplex(degree) => powers.iter().sum::<u8>() <= degree,
            Polynomials::Tensor(_) => true,
            Polynomials::Serendipity => powers.iter().filter(|power| **power == 2).count() <= 1,
            Polynomials::Wedge => powers[0] + powers[1] <= 1,
        };
        all.filter(is_in).collect()
    }

    /// Points and weights of a rule that is exact for what the squares of its polynomials and their products with smooth functions need.
    fn quadrature(&self) -> Vec<([f64; 3], f64)> {
        let rule: &[[f64; 2]] =
            if self.nodes().len() > 1 << self.dimension { &GAUSS_4 } else { &GAUSS_3 };
        let of = |axis: usize| if axis < self.dimension { rule } else { &[[0.0, 1.0]][..] };
        let mut points = vec![];
        for [a, of_a] in of(0) {
            for [b, of_b] in of(1) {
                for [c, of_c] in of(2) {
                    let weight = of_a * of_b * of_c;
                    points.push(match (self.polynomials, self.dimension) {
                        // A square or a cube with an edge drawn together.
                        (Polynomials::Simplex(_), 2) | (Polynomials::Wedge, _) => {
                            ([*a, b * (1.0 - a), *c], weight * (1.0 - a))
                        }
                        (Polynomials::Simplex(_), 3) => {
                            let left = (1.0 - a) * (1.0 - b);
                            ([*a, b * (1.0 - a), c * left], weight * left * (1.0 - a))
                        }
                        _ => ([*a, *b, *c], weight),
                    });
                }
            }
        }
        points
    }
}

/// Places and weights on the interval from zero to one.
const GAUSS_3: [[f64; 2]; 3] = [
    [0.112_701_665_379_258_31, 5.0 / 18.0],
    [0.5, 8.0 / 18.0],
    [0.887_298_334_620_741_7, 5.0 / 18.0],
];
const GAUSS_4: [[f64; 2]; 4] = [
    [0.069_431_844_202_973_71, 0.173_927_422_568_726_93],
    [0.330_009_478_207_571_9, 0.326_072_577_431_273_07],
    [0.669_990_521_792_428_1, 0.326_072_577_431_273_07],
    [0.930_568_155_797_026_3, 0.173_927_422_568_726_93],
];

/// The shape functions of an element at a point of it.
#[derive(Clone, Debug)]
pub(super) struct Shapes<const D: usize> {
    pub(super) weight: f64,
    pub(super) values: Vec<f64>,
    /// With respect to the element's own coordinates.
    pub(super) slopes: Vec<SVector<f64, D>>,
}

/// A kind of element.
#[derive(Clone, Debug)]
pub(super) struct Element<const D: usize> {
    /// Its number in VTK's files.
    pub(super) number: u8,
    pub(super) nodes: usize,
    pub(super) quadrature: Vec<Shapes<D>>,
}

impl<const D: usize> Element<D> {
    /// The element of a number; nothing for those of another dimension and those that are not known.
    pub(super) fn of(number: u8) -> Option<Self> {
        let row = ROWS.iter().find(|row| row.number == number && row.dimension == D)?;
        let (nodes, monomials) = (row.nodes(), row.monomials());
        let rows =
            nodes.iter().map(|at| monomials.iter().map(|m| power(m, at)).collect()).collect();
        let coefficients = inverse(rows)?;
        let shapes = |(at, weight): ([f64; 3], f64)| {
            let sum = |node: usize, of: &dyn Fn(&[u8; 3]) -> f64| -> f64 {
                monomials.iter().zip(&coefficients).map(|(m, row)| row[node] * of(m)).sum()
            };
            let count = 0..nodes.len();
            Shapes {
                weight,
                values: count.clone().map(|node| sum(node, &|m| power(m, &at))).collect(),
                slopes: count
                    .map(|node| SVector::from_fn(|axis, _| sum(node, &|m| slope(m, &at, axis))))
                    .collect(),
            }
        };
        Some(Self {
            number,
            nodes: nodes.len(),
            quadrature: row.quadrature().into_iter().map(shapes).collect(),
        })
    }
}

/// The places of an element's nodes in its own coordinates.
#[cfg(test)]
pub(super) fn nodes_of(number: u8) -> Vec<[f64; 3]> {
    ROWS.iter().filter(|row| row.number == number).flat_map(Row::nodes).collect()
}

/// The value of a monomial.
fn power(powers: &[u8; 3], at: &[f64; 3]) -> f64 {
    powers.iter().zip(at).map(|(power, x)| x.powi(i32::from(*power))).product()
}

/// The derivative of a monomial along an axis.
fn slope(powers: &[u8; 3], at: &[f64; 3], axis: usize) -> f64 {
    let mut less = *powers;
    if less[axis] == 0 {
        return 0.0;
    }
    less[axis] -= 1;
    f64::from(powers[axis]) * power(&less, at)
}

/// The inverse of a matrix by rows, with pivots; nothing for one that has none.
fn inverse(mut rows: Vec<Vec<f64>>) -> Option<Vec<Vec<f64>>> {
    let n = rows.len();
    let mut inverse: Vec<Vec<f64>> =
        (0..n).map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect()).collect();
    for column in 0..n {
        let pivot =
            (column..n).max_by(|i, j| rows[*i][column].abs().total_cmp(&rows[*j][column].abs()))?;
        if rows[pivot].len() != n || rows[pivot][column] == 0.0 {
            return None;
        }
        rows.swap(column, pivot);
        inverse.swap(column, pivot);
        let scale = 1.0 / rows[column][column];
        rows[column].iter_mut().chain(&mut inverse[column]).for_each(|value| *value *= scale);
        let (of_rows, of_inverse) = (rows[column].clone(), inverse[column].clone());
        for other in (0..n).filter(|other| *other != column) {
            let factor = rows[other][column];
            for (values, pivots) in [(&mut rows, &of_rows), (&mut inverse, &of_inverse)] {
                for (value, pivot) in values[other].iter_mut().zip(pivots) {
                    *value -= factor * pivot;
                }
            }
        }
    }
    Some(inverse)
}

impl<const D: usize> Shapes<D> {
    /// The place of the point and the gradients of the shape functions with respect to places, from the nodes' places, and the ratio of
    /// volumes; nothing for an element without volume.
    pub(super) fn mapped(
        &self,
        X: &[SVector<f64, D>],
    ) -> Option<(SVector<f64, D>, Vec<SVector<f64, D>>, f64)> {
        let mut place = SVector::zeros();
        let mut jacobian = SMatrix::<f64, D, D>::zeros();
        for ((value, slope), X) in self.values.iter().zip(&self.slopes).zip(X) {
            place += X * *value;
            jacobian += X * slope.transpose();
        }
        let volume = crate::inverse::determinant(&jacobian).abs();
        let turned = crate::inverse::inverse(&jacobian)?.transpose();
        Some((place, self.slopes.iter().map(|slope| turned * slope).collect(), volume))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The integral of a monomial over the reference element.
    fn exact(row: &Row, [i, j, k]: [u8; 3]) -> f64 {
        let factorial = |n: u8| (1..=n).map(f64::from).product::<f64>();
        let of_axis =
            |n: u8, axis: usize| if axis < row.dimension { 1.0 / f64::from(n + 1) } else { 1.0 };
        match row.polynomials {
            Polynomials::Simplex(_) => {
                factorial(i) * factorial(j) * factorial(k)
                    / factorial(i + j + k + u8::try_from(row.dimension).unwrap())
            }
            Polynomials::Wedge => {
                factorial(i) * factorial(j) / factorial(i + j + 2) * of_axis(k, 2)
            }
            _ => of_axis(i, 0) * of_axis(j, 1) * of_axis(k, 2),
        }
    }

    fn check<const D: usize>() {
        for row in ROWS.iter().filter(|row| row.dimension == D) {
            let element = Element::<D>::of(row.number).unwrap();
            let nodes = row.nodes();
            for monomial in row.monomials() {
                for shapes in &element.quadrature {
                    // Each monomial of the element is interpolated as it is, with its slopes.
                    let sum = |of: &dyn Fn(usize) -> f64| -> f64 {
                        (0..nodes.len()).map(|n| of(n) * power(&monomial, &nodes[n])).sum()
                    };
                    let coordinate = |axis: usize| {
                        (0..nodes.len()).map(|n| shapes.values[n] * nodes[n][axis]).sum()
                    };
                    let at: [f64; 3] = std::array::from_fn(coordinate);
                    let value = sum(&|n| shapes.values[n]);
                    assert!((value - power(&monomial, &at)).abs() < 1e-13, "{}", row.number);
                    for axis in 0..D {
                        let found = sum(&|n| shapes.slopes[n][axis]);
                        assert!(
                            (found - slope(&monomial, &at, axis)).abs() < 1e-12,
                            "{}",
                            row.number
                        );
                    }
                }
                let integral = |square: bool| -> f64 {
                    let points = row.quadrature().into_iter();
                    let power = |at| power(&monomial, &at).powi(if square { 2 } else { 1 });
                    points.map(|(at, weight)| weight * power(at)).sum()
                };
                let twice = monomial.map(|power| 2 * power);
                assert!((integral(false) - exact(row, monomial)).abs() < 1e-14, "{}", row.number);
                assert!((integral(true) - exact(row, twice)).abs() < 1e-14, "{}", row.number);
            }
        }
    }

    #[test]
    fn every_element_interpolates_its_polynomials_and_integrates_their_squares() {
        check::<1>();
        check::<2>();
        check::<3>();
    }
}
