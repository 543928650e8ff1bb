//! P2G and G2P in space: the values of a node fill two registers of four lanes.

use nalgebra::RealField;

use crate::kernel::any::{Contributions, Interpolated};
use crate::node::{LANES, Node};
use crate::simd::{Lane4, Vectors};
use crate::weights::Weights;

/// All values of a node, in two registers.
#[derive(Clone, Copy)]
struct Lane8<T> {
    /// The velocity and the first component of the acceleration.
    low: Lane4<T>,
    high: Lane4<T>,
}

impl<T: RealField + Copy> Lane8<T> {
    #[inline(always)]
    fn zero() -> Self {
        let zero = Lane4([T::zero(); 4]);
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

    /// Adds the sum over the places before this one; the first place has none.
    #[inline(always)]
    fn after(self, vectors: impl Vectors, sum: Self, place: usize) -> Self {
        if place == 0 {
            return self;
        }
        Self { low: vectors.add(sum.low, self.low), high: vectors.add(sum.high, self.high) }
    }

    #[inline(always)]
    fn mul(self, vectors: impl Vectors, factor: Lane4<T>) -> Self {
        Self { low: vectors.mul(self.low, factor), high: vectors.mul(self.high, factor) }
    }

    /// `self factor + sum`, rounded once.
    #[inline(always)]
    fn mul_add(self, vectors: impl Vectors, factor: Lane4<T>, sum: Self) -> Self {
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
) -> [[Lane4<T>; W]; 2]
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

/// P2G of particle `k`, as [`p2g`](crate::kernel::any::p2g): plane by plane, row by row, node by node.
#[inline(always)]
pub(crate) fn p2g_in_space<T, L, V, const D: usize, const W: usize, const N: usize>(
    vectors: V,
    weights: &L,
    strides: &[usize; D],
    band: &mut [Node<T, D>],
    first: usize,
    (contributions, k): (&Contributions<T, D, N>, usize),
) where
    T: RealField + Copy,
    V: Vectors,
    L: Weights<T, D, W>,
{
    let start = weights.first_node() - first;
    let value = Lane8::load(vectors, &contributions.value[k].values);
    let zero = T::zero();
    let gradient = |axis: usize| {
        let column = contributions.stress_flux[k].column(axis);
        Lane8 {
            low: Lane4([zero, zero, zero, column[0]]),
            high: Lane4([column[1], column[D - 1], zero, zero]),
        }
    };
    let (along, across, up) = (gradient(0), gradient(1), gradient(D - 1));
    let [S, G] = factors(vectors, weights, 0);
    let [S_across, G_across] = factors(vectors, weights, 1);
    let [S_up, G_up] = factors(vectors, weights, D - 1);
    for plane in 0..W {
        let to_value = up.mul_add(vectors, G_up[plane], value.mul(vectors, S_up[plane]));
        let to_along = along.mul(vectors, S_up[plane]);
        let to_across = across.mul(vectors, S_up[plane]);
        for row in 0..W {
            let with_value = to_value.mul(vectors, S_across[row]);
            let to_value = to_across.mul_add(vectors, G_across[row], with_value);
            let to_along = to_along.mul(vectors, S_across[row]);
            let place = start + row * strides[1] + plane * strides[D - 1];
            let Some(nodes) = band.get_mut(place..).and_then(|n| n.first_chunk_mut::<W>()) else {
                debug_assert!(false, "a stencil beyond its band");
                return;
            };
            for (i, Node { values }) in nodes.iter_mut().enumerate() {
                let with_gradient = to_along.mul_add(vectors, G[i], Lane8::load(vectors, values));
                to_value.mul_add(vectors, S[i], with_gradient).store(values);
            }
        }
    }
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
    T: RealField + Copy,
    V: Vectors,
    L: Weights<T, D, W>,
{
    let start = weights.first_node();
    let zero = Lane4([T::zero(); 4]);
    let [S, G] = factors(vectors, weights, 0);
    let [S_across, G_across] = factors(vectors, weights, 1);
    let [S_up, G_up] = factors(vectors, weights, D - 1);
    let (mut value, mut along, mut across, mut up) = (Lane8::zero(), zero, zero, zero);
    for plane in 0..W {
        let (mut plane_value, mut plane_along, mut plane_across) = (Lane8::zero(), zero, zero);
        for row in 0..W {
            let place = start + row * strides[1] + plane * strides[D - 1];
            let Some(nodes) = nodes.get(place..).and_then(|n| n.first_chunk::<W>()) else {
                debug_assert!(false, "a stencil beyond the grid");
                return Interpolated::zero();
            };
            let (mut row_value, mut row_along) = (Lane8::zero(), zero);
            for (i, Node { values }) in nodes.iter().enumerate() {
                let nodal = Lane8::load(vectors, values);
                row_value = nodal.mul(vectors, S[i]).after(vectors, row_value, i);
                row_along = vectors.mul_add(nodal.low, G[i], row_along);
            }
            plane_value = row_value.mul(vectors, S_across[row]).after(vectors, plane_value, row);
            plane_along = vectors.mul_add(row_along, S_across[row], plane_along);
            plane_across = vectors.mul_add(row_value.low, G_across[row], plane_across);
        }
        value = plane_value.mul(vectors, S_up[plane]).after(vectors, value, plane);
        along = vectors.mul_add(plane_along, S_up[plane], along);
        across = vectors.mul_add(plane_across, S_up[plane], across);
        up = vectors.mul_add(plane_value.low, G_up[plane], up);
    }
    let mut values = [T::zero(); LANES];
    value.store(&mut values);
    let gradients = std::array::from_fn(|axis| [along, across, up][axis].0);
    Interpolated::new(&values, &gradients)
}
