//! Sums over a particle's nodes in one or two dimensions, where half of a node's values are all that is used of it: to the
//! grid, and from it.

use nalgebra::RealField;

use crate::simd::{Quad, Vectors};
use crate::transfer::{Deposits, LANES, Node, Weights, first_node, row};

/// The first half of a node's values: in one or two dimensions momentum and force, and for one dimension the mass.
#[inline(always)]
fn half<T: RealField + Copy>(values: &[T; LANES]) -> Quad<T> {
    const { assert!(LANES >= 4) };
    // Four numbers at once, even in a build that is hardly optimised.
    values.first_chunk().map_or(Quad([T::zero(); 4]), |half| Quad(*half))
}

/// As [`scatter`](crate::transfer::scatter) for the first `count` particles, particle `k` with the weights `weights(k)`: the
/// nodes stay in registers for as long as particle after particle reaches the same ones. The sums are the same.
#[inline(always)]
pub(crate) fn scatter_runs<T, L, V, const D: usize, const W: usize, const N: usize>(
    vectors: V,
    weights: impl Fn(usize) -> L,
    strides: &[usize; D],
    piece: &mut [Node<T, D>],
    first: usize,
    given: &Deposits<T, D, N>,
    count: usize,
) where
    T: RealField + Copy,
    V: Vectors,
    L: Weights<T, D, W>,
{
    const { assert!(W <= 3, "more nodes than registers") };
    let rows = if D == 1 { 1 } else { W };
    let mass_apart = D == 2;
    let mut k = 0;
    while k < count {
        let start = first_node(&weights(k), strides);
        let mut sums = [[Quad([T::zero(); 4]); W]; W];
        let mut masses = [[T::zero(); W]; W];
        for index in 0..rows {
            let place = row_start(start - first, strides, index);
            let Some(nodes) = piece.get(place..).and_then(|n| n.first_chunk::<W>()) else {
                debug_assert!(false, "a stencil beyond its band");
                return;
            };
            for i in 0..W {
                sums[index][i] = half(&nodes[i].values);
                masses[index][i] = nodes[i].mass();
            }
        }
        loop {
            let w = weights(k);
            let level = half(&given.level[k].values);
            let slope = slopes(vectors, given, k);
            for index in 0..rows {
                let row = row(&w, start, strides, index);
                let S = vectors.splat(row.S);
                let mut to_level = vectors.mul(level, S);
                let to_slope = vectors.mul(slope[0], S);
                for a in 1..D {
                    to_level = vectors.mul_add(slope[a], vectors.splat(row.G[a]), to_level);
                }
                let mass = given.level[k].mass() * row.S;
                for i in 0..W {
                    let sum = &mut sums[index][i];
                    let with_slope = vectors.mul_add(to_slope, vectors.splat(w.G(0, i)), *sum);
                    *sum = vectors.mul_add(to_level, vectors.splat(w.S(0, i)), with_slope);
                    if mass_apart {
                        masses[index][i] = mass.mul_add(w.S(0, i), masses[index][i]);
                    }
                }
            }
            k += 1;
            if k >= count || first_node(&weights(k), strides) != start {
                break;
            }
        }
        for index in 0..rows {
            let place = row_start(start - first, strides, index);
            let Some(nodes) = piece.get_mut(place..).and_then(|n| n.first_chunk_mut::<W>()) else {
                return;
            };
            for i in 0..W {
                nodes[i].values[..4].copy_from_slice(&sums[index][i].0);
                if mass_apart {
                    nodes[i].values[2 * D] = masses[index][i];
                }
            }
        }
    }
}

/// Where a row of nodes starts, in one and two dimensions.
#[inline(always)]
fn row_start<const D: usize>(start: usize, strides: &[usize; D], index: usize) -> usize {
    if D == 1 { start } else { start + index * strides[1] }
}

/// What goes with the gradients along all axes, in the order of a node's values.
#[inline(always)]
fn slopes<T: RealField + Copy, V: Vectors, const D: usize, const N: usize>(
    vectors: V,
    given: &Deposits<T, D, N>,
    k: usize,
) -> [Quad<T>; D] {
    let zero = T::zero();
    let traction = given.traction[k].as_slice();
    let Some(&traction) = traction.first_chunk::<4>() else {
        return [Quad([zero, traction[0], zero, zero]); D];
    };
    let along = vectors.low_to_high(Quad(traction));
    let across = vectors.high_alone(Quad(traction));
    std::array::from_fn(|a| if a == 0 { along } else { across })
}

/// As [`gather`](crate::transfer::gather): velocity and acceleration one after the other, and their gradients. `None` where a
/// stencil reaches beyond the grid.
#[inline(always)]
pub(crate) fn gather_quads<T, V, const D: usize, const W: usize>(
    vectors: V,
    weights: &impl Weights<T, D, W>,
    strides: &[usize; D],
    nodes: &[Node<T, D>],
) -> Option<(Quad<T>, [Quad<T>; D])>
where
    T: RealField + Copy,
    V: Vectors,
{
    let zero = Quad([T::zero(); 4]);
    let rows = if D == 1 { 1 } else { W };
    let (mut levels, mut slopes) = ([zero; W], [zero; W]);
    let mut rest = nodes.get(first_node(weights, strides)..)?;
    for index in 0..rows {
        let row = rest.first_chunk::<W>()?;
        let values = row.each_ref().map(|node| half(&node.values));
        (levels[index], slopes[index]) = interpolate(vectors, &values, weights, 0);
        if index + 1 < rows {
            rest = rest.get(strides[D - 1]..)?;
        }
    }
    if D == 1 {
        return Some((levels[0], [slopes[0]; D]));
    }
    let (level, across) = interpolate(vectors, &levels, weights, 1);
    let (along, _) = interpolate(vectors, &slopes, weights, 1);
    Some((level, std::array::from_fn(|a| if a == 0 { along } else { across })))
}

/// What values at successive nodes of an axis come to, and their gradient.
///
/// Products that make up a level are rounded before they are added, not fused: those of a node and of its mirror image
/// then cancel, and a particle on a wall stays there.
#[inline(always)]
fn interpolate<T: RealField + Copy, V: Vectors, const D: usize, const W: usize>(
    vectors: V,
    values: &[Quad<T>; W],
    weights: &impl Weights<T, D, W>,
    axis: usize,
) -> (Quad<T>, Quad<T>) {
    let S = |i| vectors.splat(weights.S(axis, i));
    let G = |i| vectors.splat(weights.G(axis, i));
    let below = vectors.sub(values[1], values[0]);
    if W == 2 {
        let level = vectors.add(values[0], vectors.mul(below, S(1)));
        return (level, vectors.mul(below, G(1)));
    }
    let above = vectors.sub(values[W - 1], values[1]);
    let change = vectors.sub(vectors.mul(above, S(W - 1)), vectors.mul(below, S(0)));
    let slope = vectors.mul_sub(above, G(W - 1), vectors.mul(below, G(0)));
    // The weights of all nodes add up to one, and their gradients to zero.
    (vectors.add(values[1], change), slope)
}
