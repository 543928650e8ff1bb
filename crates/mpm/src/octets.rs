//! Sums over a particle's nodes in three dimensions, where all of a node's values are used of it: to the grid, and from it.

use nalgebra::RealField;

use crate::simd::{Quad, Vectors};
use crate::transfer::{Deposits, Gathered, LANES, Node, Weights};

/// All values of a node, in two halves.
#[derive(Clone, Copy)]
struct Octet<T> {
    /// The velocity and the first component of the acceleration, or what becomes of them.
    low: Quad<T>,
    high: Quad<T>,
}

impl<T: RealField + Copy> Octet<T> {
    #[inline(always)]
    fn zero() -> Self {
        let zero = Quad([T::zero(); 4]);
        Self { low: zero, high: zero }
    }

    #[inline(always)]
    fn load(vectors: impl Vectors, values: &[T; LANES]) -> Self {
        match values.as_chunks::<4>().0 {
            [low, high] => Self { low: vectors.load(low), high: vectors.load(high) },
            _ => Self::zero(),
        }
    }

    #[inline(always)]
    fn store(self, values: &mut [T; LANES]) {
        if let [low, high] = values.as_chunks_mut::<4>().0 {
            (*low, *high) = (self.low.0, self.high.0);
        }
    }

    /// The sum with what came before; there is nothing before the first place.
    #[inline(always)]
    fn after(self, vectors: impl Vectors, sum: Self, place: usize) -> Self {
        if place == 0 {
            return self;
        }
        Self { low: vectors.add(sum.low, self.low), high: vectors.add(sum.high, self.high) }
    }

    #[inline(always)]
    fn mul(self, vectors: impl Vectors, factor: Quad<T>) -> Self {
        Self { low: vectors.mul(self.low, factor), high: vectors.mul(self.high, factor) }
    }

    /// `self factor + sum`, rounded once.
    #[inline(always)]
    fn mul_add(self, vectors: impl Vectors, factor: Quad<T>, sum: Self) -> Self {
        Self {
            low: vectors.mul_add(self.low, factor, sum.low),
            high: vectors.mul_add(self.high, factor, sum.high),
        }
    }
}

/// The weights of a particle along an axis and their gradients, each as a factor of four numbers.
#[inline(always)]
fn factors<T, V, L, const D: usize, const W: usize>(
    vectors: V,
    weights: &L,
    axis: usize,
) -> [[Quad<T>; W]; 2]
where
    T: RealField + Copy,
    V: Vectors,
    L: Weights<T, D, W>,
{
    [
        std::array::from_fn(|place| vectors.splat(weights.S(axis, place))),
        std::array::from_fn(|place| vectors.splat(weights.G(axis, place))),
    ]
}

/// As [`scatter`](crate::transfer::scatter) for particle `k`: plane by plane, in each row by row, in each node by node.
#[inline(always)]
pub(crate) fn scatter_in_space<T, L, V, const D: usize, const W: usize, const N: usize>(
    vectors: V,
    weights: &L,
    strides: &[usize; D],
    piece: &mut [Node<T, D>],
    first: usize,
    (given, k): (&Deposits<T, D, N>, usize),
) where
    T: RealField + Copy,
    V: Vectors,
    L: Weights<T, D, W>,
{
    let start = weights.first_node() - first;
    let level = Octet::load(vectors, &given.level[k].values);
    let zero = T::zero();
    let slope = |axis: usize| {
        let column = given.traction[k].column(axis);
        Octet {
            low: Quad([zero, zero, zero, column[0]]),
            high: Quad([column[1], column[D - 1], zero, zero]),
        }
    };
    let (along, across, up) = (slope(0), slope(1), slope(D - 1));
    let [S, G] = factors(vectors, weights, 0);
    let [S_across, G_across] = factors(vectors, weights, 1);
    let [S_up, G_up] = factors(vectors, weights, D - 1);
    for plane in 0..W {
        let to_level = up.mul_add(vectors, G_up[plane], level.mul(vectors, S_up[plane]));
        let to_along = along.mul(vectors, S_up[plane]);
        let to_across = across.mul(vectors, S_up[plane]);
        for row in 0..W {
            let with_level = to_level.mul(vectors, S_across[row]);
            let to_level = to_across.mul_add(vectors, G_across[row], with_level);
            let to_along = to_along.mul(vectors, S_across[row]);
            let place = start + row * strides[1] + plane * strides[D - 1];
            let Some(nodes) = piece.get_mut(place..).and_then(|n| n.first_chunk_mut::<W>()) else {
                debug_assert!(false, "a stencil beyond its band");
                return;
            };
            for (i, Node { values }) in nodes.iter_mut().enumerate() {
                let with_slope = to_along.mul_add(vectors, G[i], Octet::load(vectors, values));
                to_level.mul_add(vectors, S[i], with_slope).store(values);
            }
        }
    }
}

/// As [`gather`](crate::transfer::gather): node by node to rows, row by row to planes, plane by plane to the sums.
///
/// Products that make up a level are rounded before they are added, not fused: those of a node and of its mirror image
/// then cancel, and a particle on a wall stays there.
#[inline(always)]
pub(crate) fn gather_in_space<T, L, V, const D: usize, const W: usize>(
    vectors: V,
    weights: &L,
    strides: &[usize; D],
    nodes: &[Node<T, D>],
) -> Gathered<T, D>
where
    T: RealField + Copy,
    V: Vectors,
    L: Weights<T, D, W>,
{
    let start = weights.first_node();
    let zero = Quad([T::zero(); 4]);
    let [S, G] = factors(vectors, weights, 0);
    let [S_across, G_across] = factors(vectors, weights, 1);
    let [S_up, G_up] = factors(vectors, weights, D - 1);
    let (mut level, mut along, mut across, mut up) = (Octet::zero(), zero, zero, zero);
    for plane in 0..W {
        let (mut plane_level, mut plane_along, mut plane_across) = (Octet::zero(), zero, zero);
        for row in 0..W {
            let place = start + row * strides[1] + plane * strides[D - 1];
            let Some(nodes) = nodes.get(place..).and_then(|n| n.first_chunk::<W>()) else {
                debug_assert!(false, "a stencil beyond the grid");
                return Gathered::zero();
            };
            let (mut row_level, mut row_along) = (Octet::zero(), zero);
            for (i, Node { values }) in nodes.iter().enumerate() {
                let value = Octet::load(vectors, values);
                row_level = value.mul(vectors, S[i]).after(vectors, row_level, i);
                row_along = vectors.mul_add(value.low, G[i], row_along);
            }
            plane_level = row_level.mul(vectors, S_across[row]).after(vectors, plane_level, row);
            plane_along = vectors.mul_add(row_along, S_across[row], plane_along);
            plane_across = vectors.mul_add(row_level.low, G_across[row], plane_across);
        }
        level = plane_level.mul(vectors, S_up[plane]).after(vectors, level, plane);
        along = vectors.mul_add(plane_along, S_up[plane], along);
        across = vectors.mul_add(plane_across, S_up[plane], across);
        up = vectors.mul_add(plane_level.low, G_up[plane], up);
    }
    let mut values = [T::zero(); LANES];
    level.store(&mut values);
    let slopes = std::array::from_fn(|axis| [along, across, up][axis].0);
    Gathered::new(&values, &slopes)
}
