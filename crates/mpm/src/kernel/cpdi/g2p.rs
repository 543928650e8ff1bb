//! G2P of CPDI: sums over the corners of each particle of the values that the grid has there.

use mmsmith_lanes::simd::{Eight, Lane8, Lanes, Loop, Vectors, is_wide};
use mmsmith_lanes::tensor::real;

use crate::grid::node::Node;
use crate::kernel::any::Interpolated;
use crate::kernel::beyond;
use crate::kernel::copies::BLOCK;
use crate::kernel::cpdi::parallelograms::{GROUP, Parallelograms, fold};
use crate::kernel::points::start_of_row;
use crate::shape::cells::{MOST_CORNERS, inverse};
use crate::shape::one_axis::index;

pub(super) struct G2p<'a, T, const D: usize, const AFFINE: bool>(pub(super) G2pOfBlock<'a, T, D>);

pub(super) struct G2pOfBlock<'a, T, const D: usize> {
    pub(super) own: &'a Parallelograms<T, D>,
    pub(super) strides: &'a [usize; D],
    pub(super) nodes: &'a [Node<T, D>],
    pub(super) receiver: &'a mut [Interpolated<T, D>],
}

impl<T: Lanes, const D: usize, const AFFINE: bool> Loop for G2p<'_, T, D, AFFINE> {
    const IS_WIDE: bool = is_wide::<T, D>();

    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let G2pOfBlock { own, strides, nodes, receiver } = self.0;
        let count = receiver.len().min(BLOCK);
        let mut cells = CellsOfCorners::zero();
        for group in 0..count.div_ceil(GROUP) {
            cells.take(vectors, own, strides, group);
            for n in 0..GROUP.min(count - group * GROUP) {
                let k = group * GROUP + n;
                let mut at_corners = [Lane8::zero(); MOST_CORNERS];
                let mut moments = [Lane8::zero(); D];
                for corner in 0..1 << D {
                    let start = own.first_node[k] + cells.start[corner][n];
                    let Some(values) = corners_of_cell(vectors, strides, nodes, start) else {
                        beyond("a domain beyond the grid")
                    };
                    let mut r = [Lane8::zero(); D];
                    for a in 0..D {
                        r[a] = vectors.splat8(cells.r[corner][a].0[n]);
                    }
                    let Linear { value, slopes } = Linear::new::<V, AFFINE>(vectors, values, &r);
                    at_corners[corner] = value;
                    if AFFINE {
                        for a in 0..D {
                            let variance = vectors.splat8(cells.variance[corner][a].0[n]);
                            moments[a] = vectors.mul_add8(slopes[a], variance, moments[a]);
                        }
                    }
                }
                let mut slopes = [Lane8::zero(); D];
                for a in 0..D {
                    slopes[a] = fold(vectors, &mut at_corners, 1 << (D - 1 - a));
                }
                if AFFINE {
                    // The arms of corners are sums of half-edges.
                    for a in 0..D {
                        for edge in 0..D {
                            let E = vectors.splat8(own.E[a][edge][group].0[n]);
                            moments[a] = vectors.mul_add8(slopes[edge], E, moments[a]);
                        }
                    }
                }
                let sums = Sums { value: at_corners[0], slopes, moments };
                receiver[k] = sums.interpolated::<V, AFFINE>(vectors, own, &cells, k);
            }
        }
    }
}

/// The cells of the grid in which the corners of a group of parallelograms are; `.0[n]` is of the group's particle `n`.
struct CellsOfCorners<T, const D: usize> {
    /// The lowest node of the cell, from the particle's first node on.
    start: [[usize; GROUP]; MOST_CORNERS],
    /// Where in the cell the corner is.
    r: [[Lane8<T>; D]; MOST_CORNERS],
    /// `sum N_i arm^2` of the hat functions along each axis.
    variance: [[Lane8<T>; D]; MOST_CORNERS],
    /// The inverse of the inertia `sum S arm arm` about the centre; valid where there are affine velocities.
    inverse_inertia: [[Lane8<T>; D]; D],
}

impl<T: Lanes, const D: usize> CellsOfCorners<T, D> {
    #[inline(always)]
    fn zero() -> Self {
        let zero = [[Lane8::zero(); D]; MOST_CORNERS];
        let inverse_inertia = [[Lane8::zero(); D]; D];
        Self { start: [[0; GROUP]; MOST_CORNERS], r: zero, variance: zero, inverse_inertia }
    }

    #[inline(always)]
    fn take<V: Vectors>(
        &mut self,
        vectors: V,
        own: &Parallelograms<T, D>,
        strides: &[usize; D],
        group: usize,
    ) {
        let [none, half, one] = [0.0, 0.5, 1.0].map(|number| vectors.splat8(real(number)));
        // What is added to it is rounded to a whole number.
        let whole = vectors.splat8(real::<T>(1.5) / T::default_epsilon());
        for corner in 0..1 << D {
            let mut start = [0.0; GROUP];
            for a in 0..D {
                // The least corner may be below its node by rounding.
                let at = vectors.max8(own.at[corner][a][group], none);
                let below = vectors.sub8(vectors.add8(vectors.sub8(at, half), whole), whole);
                let r = vectors.sub8(at, below);
                self.r[corner][a] = r;
                self.variance[corner][a] = vectors.mul8(r, vectors.sub8(one, r));
                for n in 0..GROUP {
                    let below = nalgebra::convert_unchecked::<T, f64>(below.0[n]);
                    start[n] += below * strides[a] as f64;
                }
            }
            for n in 0..GROUP {
                self.start[corner][n] = index(start[n]);
            }
        }
        if own.is_affine {
            let inverse = inverse(&self.inertia(vectors, own, group));
            for a in 0..D {
                for b in 0..D {
                    self.inverse_inertia[a][b] = inverse[a][b].lanes;
                }
            }
        }
    }

    /// The inertia `sum S arm arm` about the centres, in cells: of the corners its own, `E E^T`, and that of the hat functions around
    /// each.
    #[inline(always)]
    fn inertia<V: Vectors>(
        &self,
        vectors: V,
        own: &Parallelograms<T, D>,
        group: usize,
    ) -> [[Eight<T, V>; D]; D] {
        let share = vectors.splat8(real(1.0 / f64::from(1 << D)));
        let mut inertia = [[Eight { lanes: Lane8::zero(), vectors }; D]; D];
        for a in 0..D {
            for corner in 0..1 << D {
                let of_hats = &mut inertia[a][a].lanes;
                *of_hats = vectors.mul_add8(share, self.variance[corner][a], *of_hats);
            }
            for b in 0..D {
                for edge in 0..D {
                    let (E_a, E_b) = (own.E[a][edge][group], own.E[b][edge][group]);
                    inertia[a][b].lanes = vectors.mul_add8(E_a, E_b, inertia[a][b].lanes);
                }
            }
        }
        inertia
    }
}

/// The values at the nodes of a cell, axis 0 fastest; `None` beyond the grid.
#[inline(always)]
fn corners_of_cell<T: Lanes, V: Vectors, const D: usize>(
    vectors: V,
    strides: &[usize; D],
    nodes: &[Node<T, D>],
    start: usize,
) -> Option<[Lane8<T>; MOST_CORNERS]> {
    let mut values = [Lane8::zero(); MOST_CORNERS];
    for row in 0..1 << (D - 1) {
        let start = start_of_row(strides, start, row);
        let [lower, upper] = nodes.get(start..)?.first_chunk::<2>()?;
        values[2 * row] = vectors.load8(&lower.values);
        values[2 * row + 1] = vectors.load8(&upper.values);
    }
    Some(values)
}

/// A value that is linear along each axis of a cell, and its slopes; those only where they are asked for.
struct Linear<T, const D: usize> {
    value: Lane8<T>,
    slopes: [Lane8<T>; D],
}

impl<T: Lanes, const D: usize> Linear<T, D> {
    /// At the place `r` in a cell with these values at its nodes.
    #[inline(always)]
    fn new<V: Vectors, const SLOPES: bool>(
        vectors: V,
        mut values: [Lane8<T>; MOST_CORNERS],
        r: &[Lane8<T>; D],
    ) -> Self {
        let mut slopes = [[Lane8::zero(); MOST_CORNERS / 2]; D];
        along_axis::<T, V, SLOPES, D, 0>(vectors, &mut values, &mut slopes, r);
        if D > 1 {
            along_axis::<T, V, SLOPES, D, 1>(vectors, &mut values, &mut slopes, r);
        }
        if D > 2 {
            along_axis::<T, V, SLOPES, D, 2>(vectors, &mut values, &mut slopes, r);
        }
        Self { value: values[0], slopes: slopes.map(|of_axis| of_axis[0]) }
    }
}

/// Interpolates along axis `A` between the two values of each pair, and likewise the slopes along axes before it. The axis is a constant, and with it the
/// number of pairs, so that all loops are unrolled and values stay in registers.
#[inline(always)]
fn along_axis<T: Lanes, V: Vectors, const SLOPES: bool, const D: usize, const A: usize>(
    vectors: V,
    values: &mut [Lane8<T>; MOST_CORNERS],
    slopes: &mut [[Lane8<T>; MOST_CORNERS / 2]; D],
    r: &[Lane8<T>; D],
) {
    for pair in 0..1 << (D - 1 - A) {
        let (lower, upper) = (values[2 * pair], values[2 * pair + 1]);
        let along = vectors.sub8(upper, lower);
        values[pair] = vectors.mul_add8(along, r[A], lower);
        if SLOPES {
            slopes[A][pair] = along;
            for of_axis in &mut slopes[..A] {
                let (lower, upper) = (of_axis[2 * pair], of_axis[2 * pair + 1]);
                let along = vectors.sub8(upper, lower);
                of_axis[pair] = vectors.mul_add8(along, r[A], lower);
            }
        }
    }
}

/// The sums of G2P over corners, with all numbers of a node.
struct Sums<T, const D: usize> {
    value: Lane8<T>,
    /// By `H_a`.
    slopes: [Lane8<T>; D],
    /// Sums of values times the arms along each axis.
    moments: [Lane8<T>; D],
}

impl<T: Lanes, const D: usize> Sums<T, D> {
    /// The result for particle `k`.
    #[inline(always)]
    fn interpolated<V: Vectors, const AFFINE: bool>(
        &self,
        vectors: V,
        own: &Parallelograms<T, D>,
        cells: &CellsOfCorners<T, D>,
        k: usize,
    ) -> Interpolated<T, D> {
        let (group, n) = (k / GROUP, k % GROUP);
        let share = real(1.0 / f64::from(1 << D));
        let value = vectors.mul8(self.value, vectors.splat8(share));
        let mut result = Interpolated::zero();
        for i in 0..D {
            (result.velocity[i], result.second[i]) =
                (value.0[i], value.0[Node::<T, D>::SECOND + i]);
        }
        for j in 0..D {
            let (mut slope, mut affine) = (Lane8::zero(), Lane8::zero());
            for a in 0..D {
                let g = vectors.splat8(own.g[j][a][group].0[n]);
                slope = vectors.mul_add8(self.slopes[a], g, slope);
                if AFFINE {
                    let inverse = vectors.splat8(cells.inverse_inertia[a][j].0[n] * share);
                    affine = vectors.mul_add8(self.moments[a], inverse, affine);
                }
            }
            for i in 0..D {
                result.velocity_gradient[(i, j)] = slope.0[i];
                if AFFINE {
                    result.affine[(i, j)] = affine.0[Node::<T, D>::SECOND + i];
                }
            }
        }
        result
    }
}
