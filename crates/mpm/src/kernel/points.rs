//! P2G and G2P of corners as points, by hat functions: values alone pass, and affine momenta.

use mmsmith_lanes::simd::{Lane8, Lanes, Loop, Vectors, is_wide};
use nalgebra::SVector;

use crate::domain::corner_values::AlongAxes;
use crate::domain::shared_corners::SharedCorners;
use crate::grid::geometry::Constants;
use crate::grid::node::Node;
use crate::kernel::{nodes_from, nodes_from_mut};
use crate::shape::one_axis::{Hat, ShapeFunction, index};

/// The nodes around a point.
struct HatStencil<T, const D: usize> {
    /// Index of the first one.
    first: usize,
    /// The hat functions of both nodes along each axis.
    S: [[T; 2]; D],
}

impl<T: Lanes, const D: usize> HatStencil<T, D> {
    #[inline(always)]
    fn new(c: &Constants<T, D>, x: &SVector<T, D>) -> Self {
        let (mut first, mut S, xi) = (0, [[T::one(); 2]; D], c.in_cells(x));
        for a in 0..D {
            let axis = Hat::axis_weights(xi[a], T::zero());
            first += index(axis.base) * c.strides[a];
            S[a] = axis.S;
        }
        Self { first: first.wrapping_sub(c.nodes_before as usize), S }
    }

    /// The weight of a row, with 1 in place of that of one axis.
    #[inline(always)]
    fn of_row(&self, row: usize, without: usize) -> T {
        let mut w = T::one();
        for a in 1..D {
            if a != without {
                w *= self.S[a][usize::from(is_upper(row, a))];
            }
        }
        w
    }

    /// From the point to the lower or the upper node along an axis, in cells.
    #[inline(always)]
    fn arm(&self, axis: usize, is_upper: bool) -> T {
        if is_upper { self.S[axis][0] } else { -self.S[axis][1] }
    }
}

/// Whether a row of two nodes is the upper one along an axis.
#[inline(always)]
fn is_upper(row: usize, axis: usize) -> bool {
    row >> (axis - 1) & 1 == 1
}

/// Where a row begins of the nodes from `first` on.
#[inline(always)]
pub(crate) fn start_of_row<const D: usize>(
    strides: &[usize; D],
    first: usize,
    row: usize,
) -> usize {
    let mut start = first;
    for a in 1..D {
        start += if is_upper(row, a) { strides[a] } else { 0 };
    }
    start
}

/// P2G of the sums at corners, to the nodes of a window.
pub(crate) struct ToGrid<'a, T, const D: usize> {
    pub(crate) c: &'a Constants<T, D>,
    pub(crate) corners: &'a SharedCorners<T, D>,
    pub(crate) sums: &'a [Node<T, D>],
    /// Empty where there are no affine momenta.
    pub(crate) affine_sums: &'a [AlongAxes<T, D>],
    pub(crate) window: &'a mut [Node<T, D>],
    pub(crate) ids: &'a [u32],
}

impl<T: Lanes, const D: usize> Loop for ToGrid<'_, T, D> {
    const IS_WIDE: bool = is_wide::<T, D>();

    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let Self { c, corners, sums, affine_sums, window, ids } = self;
        let is_affine = !affine_sums.is_empty();
        // Successive corners mostly have the same nodes. Their sums stay in registers: they would wait for them to pass through memory.
        let mut kept = [[Lane8::zero(); 2]; MOST_ROWS];
        let mut kept_at = None;
        for &corner in ids {
            let around = HatStencil::new(c, &corners.at(corner as usize));
            let own_at = around.first;
            if kept_at != Some(own_at) {
                if let Some(at) = kept_at {
                    put(vectors, c, (window, at), &kept);
                }
                kept = [[Lane8::zero(); 2]; MOST_ROWS];
                kept_at = Some(own_at);
            }
            let [one, others @ ..] = corners.sums_of(corner as usize) else { continue };
            let mut value = vectors.load8(&sums[*one as usize].values);
            for &sum in others {
                value = vectors.add8(value, vectors.load8(&sums[sum as usize].values));
            }
            let mut affine = [Lane8::zero(); D];
            if is_affine {
                affine = affine_at(corners, affine_sums, corner as usize);
            }
            for row in 0..1 << (D - 1) {
                let w = around.of_row(row, 0);
                let mut of_row = value;
                if is_affine {
                    for a in 1..D {
                        let arm = around.arm(a, is_upper(row, a));
                        of_row = vectors.mul_add8(affine[a], vectors.splat8(arm), of_row);
                    }
                }
                for (i, sum) in kept[row].iter_mut().enumerate() {
                    let mut of_node = of_row;
                    if is_affine {
                        let arm = around.arm(0, i == 1);
                        of_node = vectors.mul_add8(affine[0], vectors.splat8(arm), of_node);
                    }
                    let S = vectors.splat8(w * around.S[0][i]);
                    *sum = vectors.mul_add8(of_node, S, *sum);
                }
            }
        }
        if let Some(at) = kept_at {
            put(vectors, c, (window, at), &kept);
        }
    }
}

/// Most rows of nodes around a point.
const MOST_ROWS: usize = 4;

/// Adds the sums of the nodes from place `first` of a window on.
#[inline(always)]
fn put<T: Lanes, V: Vectors, const D: usize>(
    vectors: V,
    c: &Constants<T, D>,
    (window, first): (&mut [Node<T, D>], usize),
    sums: &[[Lane8<T>; 2]; MOST_ROWS],
) {
    for (row, sums) in sums.iter().enumerate().take(1 << (D - 1)) {
        let start = start_of_row(&c.strides, first, row);
        let nodes = nodes_from_mut::<_, 2>(window, start, "a corner beyond its window");
        for (Node { values }, sum) in nodes.iter_mut().zip(sums) {
            *values = vectors.add8(vectors.load8(values), *sum).0;
        }
    }
}

/// The affine momentum at a corner, along the axes of the grid, in the order of a node's values.
#[inline(always)]
pub(crate) fn affine_at<T: Lanes, const D: usize>(
    corners: &SharedCorners<T, D>,
    affine_sums: &[AlongAxes<T, D>],
    corner: usize,
) -> [Lane8<T>; D] {
    let mut own = [Lane8::zero(); D];
    for &sum in corners.sums_of(corner) {
        for a in 0..D {
            for i in 0..D {
                own[a].0[i] += affine_sums[sum as usize][a].0[i];
            }
        }
    }
    let Some(turn) = &corners.mesh.turn else { return own };
    // Arms are along the axes of the grid.
    let mut turned = [Lane8::zero(); D];
    for a in 0..D {
        for b in 0..D {
            for i in 0..D {
                turned[a].0[i] += own[b].0[i] * turn[(a, b)];
            }
        }
    }
    turned
}

/// G2P at successive corners.
pub(crate) struct FromGrid<'a, T, const D: usize> {
    pub(crate) c: &'a Constants<T, D>,
    pub(crate) corners: &'a SharedCorners<T, D>,
    pub(crate) nodes: &'a [Node<T, D>],
    /// The first of the corners.
    pub(crate) first: usize,
    /// The values of each, but for its mass.
    pub(crate) values: &'a mut [Node<T, D>],
    /// The moments `sum v N_i arm` about each, in cells; empty where they are not needed.
    pub(crate) moments: &'a mut [AlongAxes<T, D>],
}

impl<T: Lanes, const D: usize> Loop for FromGrid<'_, T, D> {
    const IS_WIDE: bool = is_wide::<T, D>();

    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let Self { c, corners, nodes, first, values, moments } = self;
        for (k, own) in values.iter_mut().enumerate() {
            let around = HatStencil::new(c, &corners.at(first + k));
            let [near, far] = around.S[0];
            let mut value = Lane8::zero();
            let mut slopes = [Lane8::zero(); D];
            for row in 0..1 << (D - 1) {
                let (start, w) =
                    (start_of_row(&c.strides, around.first, row), around.of_row(row, 0));
                let [low, high] = nodes_from::<_, 2>(nodes, start, "a corner beyond the grid");
                let (low, high) = (vectors.load8(&low.values), vectors.load8(&high.values));
                // Rounded before they are added: those of a node and of its mirror image cancel.
                let of_low = vectors.mul8(low, vectors.splat8(near));
                let of_row = vectors.add8(of_low, vectors.mul8(high, vectors.splat8(far)));
                let weighted = vectors.mul8(of_row, vectors.splat8(w));
                value = if row == 0 { weighted } else { vectors.add8(value, weighted) };
                if !moments.is_empty() {
                    let along = vectors.sub8(high, low);
                    slopes[0] = vectors.mul_add8(along, vectors.splat8(w), slopes[0]);
                    for a in 1..D {
                        let w = around.of_row(row, a);
                        let w = if is_upper(row, a) { w } else { -w };
                        slopes[a] = vectors.mul_add8(of_row, vectors.splat8(w), slopes[a]);
                    }
                }
            }
            own.values = value.0;
            if let Some(moments) = moments.get_mut(k) {
                for a in 0..D {
                    let variance = around.S[a][1] * around.S[a][0];
                    for i in 0..D {
                        moments[a].0[i] = slopes[a].0[i] * variance;
                    }
                }
            }
        }
    }
}
