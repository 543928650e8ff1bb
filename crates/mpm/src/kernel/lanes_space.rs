//! P2G and G2P in space: the values of a node in eight lanes.
//!
//! Loops, not closures: functions of the standard library that call one are compiled without the registers of the kernel.

use mmsmith_lanes::simd::{Lane8, Lanes, Vectors};

use crate::grid::node::{LANES, Node};
use crate::kernel::any::{Contributions, Interpolated};
use crate::kernel::{nodes_from, nodes_from_mut};
use crate::shape::weights::Weights;

/// The weights of a particle along an axis, each as a factor of eight numbers.
#[inline(always)]
fn weights_on_axis<T, V, L, const D: usize, const W: usize>(
    vectors: V,
    weights: &L,
    axis: usize,
) -> [Lane8<T>; W]
where
    T: Lanes,
    V: Vectors,
    L: Weights<T, D, W>,
{
    let mut factors = [Lane8::zero(); W];
    for (place, factor) in factors.iter_mut().enumerate() {
        *factor = vectors.splat8(weights.S(axis, place));
    }
    factors
}

/// The slopes of a particle along an axis: gradients, and where velocities are affine arms, for the first vector of a node or for
/// what follows it.
#[inline(always)]
fn slopes_on_axis<T, V, L, const D: usize, const W: usize>(
    vectors: V,
    weights: &L,
    axis: usize,
    arms_first: bool,
) -> [Lane8<T>; W]
where
    T: Lanes,
    V: Vectors,
    L: Weights<T, D, W>,
{
    let mut factors = [Lane8::zero(); W];
    for (place, factor) in factors.iter_mut().enumerate() {
        *factor = vectors.splat8(weights.G(axis, place));
        if L::AFFINE {
            let Z = weights.Z(axis, place);
            let arms = if arms_first { 0..D } else { D..LANES };
            for q in arms {
                factor.0[q] = Z;
            }
        }
    }
    factors
}

/// P2G of particle `k`, as [`p2g`](crate::kernel::any::p2g): plane by plane, row by row, node by node.
#[inline(always)]
pub(crate) fn p2g_in_space<T, L, V, const D: usize, const W: usize, const N: usize>(
    vectors: V,
    weights: &L,
    strides: &[usize; D],
    window: &mut [Node<T, D>],
    (contributions, k): (&Contributions<T, D, N>, usize),
) where
    T: Lanes,
    V: Vectors,
    L: Weights<T, D, W>,
{
    let start = weights.first_node();
    let value = vectors.load8(&contributions.value[k].values);
    let slope = |axis: usize| contributions.slope_lanes(k, axis, L::AFFINE);
    let (along, across, up) = (slope(0), slope(1), slope(D - 1));
    let (S, G) = (weights_on_axis(vectors, weights, 0), slopes_on_axis(vectors, weights, 0, true));
    let (S_across, G_across) =
        (weights_on_axis(vectors, weights, 1), slopes_on_axis(vectors, weights, 1, true));
    let (S_up, G_up) =
        (weights_on_axis(vectors, weights, D - 1), slopes_on_axis(vectors, weights, D - 1, true));
    for plane in 0..places::<W>() {
        let with_value = vectors.mul8(value, S_up[plane]);
        let to_value = vectors.mul_add8(up, G_up[plane], with_value);
        let to_along = vectors.mul8(along, S_up[plane]);
        let to_across = vectors.mul8(across, S_up[plane]);
        for row in 0..places::<W>() {
            let with_value = vectors.mul8(to_value, S_across[row]);
            let to_value = vectors.mul_add8(to_across, G_across[row], with_value);
            let to_along = vectors.mul8(to_along, S_across[row]);
            let place = start + row * strides[1] + plane * strides[D - 1];
            let nodes = nodes_from_mut::<_, W>(window, place, "a stencil beyond its window");
            for (i, Node { values }) in nodes.iter_mut().enumerate() {
                let with_slope = vectors.mul_add8(to_along, G[i], vectors.load8(values));
                *values = vectors.mul_add8(to_value, S[i], with_slope).0;
            }
        }
    }
}

/// Nodes along an axis. Loops over more than three are not to be unrolled: they would be long.
#[inline(always)]
fn places<const W: usize>() -> usize {
    if W > 3 { std::hint::black_box(W) } else { W }
}

/// Adds the sum over the places before this one; the first place has none.
#[inline(always)]
fn after<T: Lanes>(vectors: impl Vectors, sum: Lane8<T>, term: Lane8<T>, place: usize) -> Lane8<T> {
    if place == 0 { term } else { vectors.add8(sum, term) }
}

/// G2P, as [`g2p`](crate::kernel::any::g2p): nodes are summed to rows, rows to planes, planes to the result.
///
/// Products that make up a value are rounded before they are added, not fused: those of a node and of its mirror image
/// then cancel, and a particle on a wall stays there.
#[inline(always)]
pub(crate) fn g2p_in_space<T, L, V, const D: usize, const W: usize>(
    vectors: V,
    weights: &L,
    strides: &[usize; D],
    nodes: &[Node<T, D>],
) -> Interpolated<T, D>
where
    T: Lanes,
    V: Vectors,
    L: Weights<T, D, W>,
{
    let start = weights.first_node();
    let zero = Lane8::zero();
    let (S, G) = (weights_on_axis(vectors, weights, 0), slopes_on_axis(vectors, weights, 0, false));
    let (S_across, G_across) =
        (weights_on_axis(vectors, weights, 1), slopes_on_axis(vectors, weights, 1, false));
    let (S_up, G_up) =
        (weights_on_axis(vectors, weights, D - 1), slopes_on_axis(vectors, weights, D - 1, false));
    let (mut value, mut along, mut across, mut up) = (zero, zero, zero, zero);
    for plane in 0..places::<W>() {
        let (mut plane_value, mut plane_along, mut plane_across) = (zero, zero, zero);
        for row in 0..places::<W>() {
            let place = start + row * strides[1] + plane * strides[D - 1];
            let nodes = nodes_from::<_, W>(nodes, place, "a stencil beyond the grid");
            let (mut row_value, mut row_along) = (zero, zero);
            for (i, Node { values }) in nodes.iter().enumerate() {
                let nodal = vectors.load8(values);
                row_value = after(vectors, row_value, vectors.mul8(nodal, S[i]), i);
                row_along = vectors.mul_add8(nodal, G[i], row_along);
            }
            let weighted = vectors.mul8(row_value, S_across[row]);
            plane_value = after(vectors, plane_value, weighted, row);
            plane_along = vectors.mul_add8(row_along, S_across[row], plane_along);
            plane_across = vectors.mul_add8(row_value, G_across[row], plane_across);
        }
        value = after(vectors, value, vectors.mul8(plane_value, S_up[plane]), plane);
        along = vectors.mul_add8(plane_along, S_up[plane], along);
        across = vectors.mul_add8(plane_across, S_up[plane], across);
        up = vectors.mul_add8(plane_value, G_up[plane], up);
    }
    let mut slopes = [along.0; D];
    slopes[1] = across.0;
    slopes[D - 1] = up.0;
    Interpolated::new(weights, &value.0, &slopes)
}
