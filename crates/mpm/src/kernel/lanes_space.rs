//! P2G and G2P in space: the values of a node in eight lanes.
//!
//! Without affine velocities slopes belong to one vector of a node alone, forces in P2G and velocities in G2P: to one half of the lanes, which is one
//! of two registers where these have 256 bits.
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
            let arms = if arms_first { 0..LANES / 2 } else { LANES / 2..LANES };
            for q in arms {
                factor.0[q] = Z;
            }
        }
    }
    factors
}

/// A slope times a weight in P2G: in the upper lanes, and with affine velocities in all.
#[inline(always)]
fn p2g_weighted<T, L, const D: usize, const W: usize>(
    vectors: impl Vectors,
    slope: Lane8<T>,
    S: Lane8<T>,
) -> Lane8<T>
where
    T: Lanes,
    L: Weights<T, D, W>,
{
    if L::AFFINE { vectors.mul8(slope, S) } else { vectors.mul_high(slope, S) }
}

/// Adds a slope times a gradient in P2G, in the lanes of [`p2g_weighted`].
#[inline(always)]
fn p2g_slope<T, L, const D: usize, const W: usize>(
    vectors: impl Vectors,
    slope: Lane8<T>,
    G: Lane8<T>,
    sum: Lane8<T>,
) -> Lane8<T>
where
    T: Lanes,
    L: Weights<T, D, W>,
{
    if L::AFFINE { vectors.mul_add8(slope, G, sum) } else { vectors.mul_add_high(slope, G, sum) }
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
        let (S_up, G_up) = (S_up[plane], G_up[plane]);
        let to_value = p2g_slope::<T, L, D, W>(vectors, up, G_up, vectors.mul8(value, S_up));
        let to_along = p2g_weighted::<T, L, D, W>(vectors, along, S_up);
        let to_across = p2g_weighted::<T, L, D, W>(vectors, across, S_up);
        for row in 0..places::<W>() {
            let with_value = vectors.mul8(to_value, S_across[row]);
            let to_value = p2g_slope::<T, L, D, W>(vectors, to_across, G_across[row], with_value);
            let to_along = p2g_weighted::<T, L, D, W>(vectors, to_along, S_across[row]);
            let place = start + row * strides[1] + plane * strides[D - 1];
            let nodes = nodes_from_mut::<_, W>(window, place, "a stencil beyond its window");
            for (i, Node { values }) in nodes.iter_mut().enumerate() {
                let with_slope =
                    p2g_slope::<T, L, D, W>(vectors, to_along, G[i], vectors.load8(values));
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

/// Adds a value times a slope, or a slope times a weight, in G2P: in the lower lanes, and with affine velocities in all.
#[inline(always)]
fn g2p_slope<T, L, const D: usize, const W: usize>(
    vectors: impl Vectors,
    a: Lane8<T>,
    b: Lane8<T>,
    sum: Lane8<T>,
) -> Lane8<T>
where
    T: Lanes,
    L: Weights<T, D, W>,
{
    if L::AFFINE { vectors.mul_add8(a, b, sum) } else { vectors.mul_add_low(a, b, sum) }
}

/// The place that comes `n`-th in sums of G2P: of three, the middle one last.
#[inline(always)]
fn in_order<const W: usize>(n: usize) -> usize {
    match (W, n) {
        (3, 1) => 2,
        (3, 2) => 1,
        _ => n,
    }
}

/// Adds the `n`-th term of a value, the product of a value and its weight.
///
/// Products are rounded before they are added, not fused: those of a node and of its mirror image then cancel, and a particle on a wall stays there. The
/// middle one of three nodes is its own image, and comes last.
#[inline(always)]
fn add_term<T: Lanes, const W: usize>(
    vectors: impl Vectors,
    n: usize,
    sum: Lane8<T>,
    value: Lane8<T>,
    S: Lane8<T>,
) -> Lane8<T> {
    match n {
        0 => vectors.mul8(value, S),
        2 if W == 3 => vectors.mul_add8(value, S, sum),
        _ => vectors.add8(sum, vectors.mul8(value, S)),
    }
}

/// G2P, as [`g2p`](crate::kernel::any::g2p): nodes are summed to rows, rows to planes, planes to the result.
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
        for n in 0..places::<W>() {
            let row = in_order::<W>(n);
            let place = start + row * strides[1] + plane * strides[D - 1];
            let nodes = nodes_from::<_, W>(nodes, place, "a stencil beyond the grid");
            let (mut row_value, mut row_along) = (zero, zero);
            for n in 0..W {
                let i = in_order::<W>(n);
                let nodal = vectors.load8(&nodes[i].values);
                row_value = add_term::<T, W>(vectors, n, row_value, nodal, S[i]);
                row_along = g2p_slope::<T, L, D, W>(vectors, nodal, G[i], row_along);
            }
            plane_value = add_term::<T, W>(vectors, n, plane_value, row_value, S_across[row]);
            plane_along = g2p_slope::<T, L, D, W>(vectors, row_along, S_across[row], plane_along);
            plane_across = g2p_slope::<T, L, D, W>(vectors, row_value, G_across[row], plane_across);
        }
        let (S_up, G_up) = (S_up[plane], G_up[plane]);
        // Planes are a loop: the first adds to zeros, so that all are alike.
        value = vectors.add8(value, vectors.mul8(plane_value, S_up));
        along = g2p_slope::<T, L, D, W>(vectors, plane_along, S_up, along);
        across = g2p_slope::<T, L, D, W>(vectors, plane_across, S_up, across);
        up = g2p_slope::<T, L, D, W>(vectors, plane_value, G_up, up);
    }
    let mut slopes = [along.0; D];
    slopes[1] = across.0;
    slopes[D - 1] = up.0;
    Interpolated::new(weights, &value.0, &slopes)
}
