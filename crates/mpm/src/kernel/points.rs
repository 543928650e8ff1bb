//! P2G and G2P of corners as points, by hat functions: values alone pass, and affine momenta.

use nalgebra::SVector;

use crate::corner_values::AlongAxes;
use crate::geometry::Constants;
use crate::node::Node;
use crate::shape_function::{index, node_below};
use crate::shared_corners::SharedCorners;
use crate::simd::{Lane8, Lanes, Loop, Vectors, dispatch};

/// The nodes around a point.
struct Around<T, const D: usize> {
    /// Index of the first one.
    first: usize,
    /// From it to the point, in cells.
    r: [T; D],
}

impl<T: Lanes, const D: usize> Around<T, D> {
    #[inline(always)]
    fn new(c: &Constants<T, D>, x: &SVector<T, D>) -> Self {
        let (mut first, mut r) = (0, [T::zero(); D]);
        for a in 0..D {
            let xi = (x[a] - c.lower[a]) * c.inverse_spacing;
            let (base, node) = node_below(xi);
            first += index(base) * c.strides[a];
            r[a] = xi - node;
        }
        Self { first: first.wrapping_sub(c.nodes_before as usize), r }
    }

    /// Whether a row of two nodes is the upper one along an axis.
    #[inline(always)]
    fn is_upper(row: usize, axis: usize) -> bool {
        row >> (axis - 1) & 1 == 1
    }

    /// Where a row begins, and its weight, with 1 in place of that of one axis.
    #[inline(always)]
    fn row(&self, c: &Constants<T, D>, row: usize, without: usize) -> (usize, T) {
        let (mut start, mut w) = (self.first, T::one());
        for a in 1..D {
            let is_upper = Self::is_upper(row, a);
            start += if is_upper { c.strides[a] } else { 0 };
            if a != without {
                w *= if is_upper { self.r[a] } else { T::one() - self.r[a] };
            }
        }
        (start, w)
    }
}

/// P2G of the sums at corners, to the band of nodes that starts at node `first`.
pub(crate) struct ToGrid<'a, T, const D: usize> {
    pub(crate) c: &'a Constants<T, D>,
    pub(crate) corners: &'a SharedCorners<T, D>,
    pub(crate) sums: &'a [Node<T, D>],
    /// Empty where there are no affine momenta.
    pub(crate) affine_sums: &'a [AlongAxes<T, D>],
    pub(crate) band: &'a mut [Node<T, D>],
    pub(crate) first: usize,
    pub(crate) ids: &'a [u32],
}

impl<T: Lanes, const D: usize> ToGrid<'_, T, D> {
    pub(crate) fn add(self) {
        dispatch(self);
    }
}

impl<T: Lanes, const D: usize> Loop for ToGrid<'_, T, D> {
    const WIDE: bool = D > 1;

    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let Self { c, corners, sums, affine_sums, band, first, ids } = self;
        let is_affine = !affine_sums.is_empty();
        // Successive corners mostly have the same nodes. Their sums stay in registers: they would wait for them to pass through memory.
        let mut kept = [[Lane8::zero(); 2]; MOST_ROWS];
        let mut kept_at = None;
        for &corner in ids {
            let Around { first: of_point, r } = Around::new(c, &corners.at(corner as usize));
            let around = Around { first: of_point.wrapping_sub(first), r };
            if kept_at != Some(around.first) {
                if let Some(at) = kept_at {
                    put(vectors, c, (band, at), &kept);
                }
                kept = [[Lane8::zero(); 2]; MOST_ROWS];
                kept_at = Some(around.first);
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
                let (_, w) = around.row(c, row, 0);
                let mut of_row = value;
                if is_affine {
                    for a in 1..D {
                        let arm =
                            if Around::<T, D>::is_upper(row, a) { T::one() - r[a] } else { -r[a] };
                        of_row = vectors.mul_add8(affine[a], vectors.splat8(arm), of_row);
                    }
                }
                for (i, sum) in kept[row].iter_mut().enumerate() {
                    let mut of_node = of_row;
                    if is_affine {
                        let arm = if i == 1 { T::one() - r[0] } else { -r[0] };
                        of_node = vectors.mul_add8(affine[0], vectors.splat8(arm), of_node);
                    }
                    let S = w * if i == 1 { r[0] } else { T::one() - r[0] };
                    *sum = vectors.mul_add8(of_node, vectors.splat8(S), *sum);
                }
            }
        }
        if let Some(at) = kept_at {
            put(vectors, c, (band, at), &kept);
        }
    }
}

/// Most rows of nodes around a point.
const MOST_ROWS: usize = 4;

/// Adds the sums of the nodes from place `first` of a band on.
#[inline(always)]
fn put<T: Lanes, V: Vectors, const D: usize>(
    vectors: V,
    c: &Constants<T, D>,
    (band, first): (&mut [Node<T, D>], usize),
    sums: &[[Lane8<T>; 2]; MOST_ROWS],
) {
    let corner = Around { first, r: [T::zero(); D] };
    for (row, sums) in sums.iter().enumerate().take(1 << (D - 1)) {
        let (start, _) = corner.row(c, row, 0);
        let nodes = band.get_mut(start..).and_then(|nodes| nodes.first_chunk_mut::<2>());
        let Some(nodes) = nodes else {
            debug_assert!(false, "a corner beyond its band");
            return;
        };
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

impl<T: Lanes, const D: usize> FromGrid<'_, T, D> {
    pub(crate) fn interpolate(self) {
        dispatch(self);
    }
}

impl<T: Lanes, const D: usize> Loop for FromGrid<'_, T, D> {
    const WIDE: bool = D > 1;

    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let Self { c, corners, nodes, first, values, moments } = self;
        for (k, own) in values.iter_mut().enumerate() {
            let around = Around::new(c, &corners.at(first + k));
            let (far, near) = (around.r[0], T::one() - around.r[0]);
            let mut value = Lane8::zero();
            let mut slopes = [Lane8::zero(); D];
            for row in 0..1 << (D - 1) {
                let (start, w) = around.row(c, row, 0);
                let Some([low, high]) =
                    nodes.get(start..).and_then(|nodes| nodes.first_chunk::<2>())
                else {
                    debug_assert!(false, "a corner beyond the grid");
                    return;
                };
                let (low, high) = (vectors.load8(&low.values), vectors.load8(&high.values));
                // Rounded before they are added: those of a node and of its mirror image cancel.
                let of_low = vectors.mul8(low, vectors.splat8(near));
                let of_row = vectors.add8(of_low, vectors.mul8(high, vectors.splat8(far)));
                value = vectors.add8(value, vectors.mul8(of_row, vectors.splat8(w)));
                if !moments.is_empty() {
                    let along = vectors.sub8(high, low);
                    slopes[0] = vectors.mul_add8(along, vectors.splat8(w), slopes[0]);
                    for a in 1..D {
                        let (_, w) = around.row(c, row, a);
                        let w = if Around::<T, D>::is_upper(row, a) { w } else { -w };
                        slopes[a] = vectors.mul_add8(of_row, vectors.splat8(w), slopes[a]);
                    }
                }
            }
            own.values = value.0;
            if let Some(moments) = moments.get_mut(k) {
                for a in 0..D {
                    let variance = around.r[a] * (T::one() - around.r[a]);
                    for i in 0..D {
                        moments[a].0[i] = slopes[a].0[i] * variance;
                    }
                }
            }
        }
    }
}
