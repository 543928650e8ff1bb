//! Sums over a particle's nodes: to the grid, and from it.

use nalgebra::{RealField, SMatrix, SVector};

use crate::weights::{AxisWeights, Stencil, WIDE};

/// Quantities at a node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node<T, const D: usize> {
    pub(crate) mass: T,
    /// Momentum while particles add to it, velocity afterwards.
    pub(crate) velocity: SVector<T, D>,
    /// Force while particles add to it, acceleration afterwards.
    pub(crate) acceleration: SVector<T, D>,
}

impl<T: RealField + Copy, const D: usize> Node<T, D> {
    pub(crate) fn zero() -> Self {
        Self { mass: T::zero(), velocity: SVector::zeros(), acceleration: SVector::zeros() }
    }
}

/// One row of `W` nodes along axis 0: the weights of all other axes multiplied.
struct Row<T, const D: usize> {
    start: usize,
    /// Product of the weights along axes 1 and up.
    S: T,
    /// Its gradient; entry 0 is unused.
    G: [T; D],
}

impl<T: RealField + Copy, const D: usize, const W: usize> Stencil<T, D, W> {
    /// Index of the first node.
    #[inline(always)]
    pub(crate) fn first_node(&self, strides: &[usize; D]) -> usize {
        (0..D).map(|a| self.axes[a].base * strides[a]).sum()
    }

    /// Number of rows of nodes.
    #[inline(always)]
    fn rows() -> usize {
        let rows = W.pow(D as u32 - 1);
        // The wide stencil is rare: unrolling its rows would cost minutes of compile time for nothing.
        if W == WIDE { std::hint::black_box(rows) } else { rows }
    }

    #[inline(always)]
    fn row(&self, first: usize, strides: &[usize; D], index: usize) -> Row<T, D> {
        let mut row = Row { start: first, S: T::one(), G: [T::zero(); D] };
        let mut rest = index;
        for (a, (weights, stride)) in self.axes.iter().zip(strides).enumerate().skip(1) {
            let k = rest % W;
            rest /= W;
            row.start += k * stride;
            for b in 1..a {
                row.G[b] *= weights.S[k];
            }
            row.G[a] = row.S * weights.G[k];
            row.S *= weights.S[k];
        }
        row
    }

    /// Adds to every node of the piece of the grid that starts at node `first`.
    ///
    /// `per_row(S, G)` turns the product of the weights along axes 1 and up, and its gradient, into whatever is the same
    /// for a whole row; `add(node, S_0, G_0, row)` adds it with the weight and gradient along axis 0.
    #[inline(always)]
    pub(crate) fn scatter<N, A>(
        &self,
        strides: &[usize; D],
        piece: &mut [N],
        first: usize,
        per_row: impl Fn(T, &[T; D]) -> A,
        add: impl Fn(&mut N, T, T, &A),
    ) {
        let start = self.first_node(strides) - first;
        for index in 0..Self::rows() {
            let row = self.row(start, strides, index);
            let factors = per_row(row.S, &row.G);
            let Some(nodes) = piece.get_mut(row.start..).and_then(|n| n.first_chunk_mut::<W>())
            else {
                debug_assert!(false, "a stencil beyond its band");
                return;
            };
            let AxisWeights { S, G, .. } = &self.axes[0];
            for ((node, &S), &G) in nodes.iter_mut().zip(S).zip(G) {
                add(node, S, G, &factors);
            }
        }
    }

    /// Interpolates two vector fields of the nodes, `read(node) = (v, a)`: `(sum S v, sum v G^T, sum S a)`.
    #[inline(always)]
    pub(crate) fn gather<N>(
        &self,
        strides: &[usize; D],
        nodes: &[N],
        read: impl Fn(&N) -> (SVector<T, D>, SVector<T, D>),
    ) -> (SVector<T, D>, SMatrix<T, D, D>, SVector<T, D>) {
        let mut velocity = SVector::zeros();
        let mut gradient = SMatrix::zeros();
        let mut acceleration = SVector::zeros();
        let start = self.first_node(strides);
        for index in 0..Self::rows() {
            let row = self.row(start, strides, index);
            let Some(nodes) = nodes.get(row.start..).and_then(|n| n.first_chunk::<W>()) else {
                debug_assert!(false, "a stencil beyond the grid");
                break;
            };
            let mut row_velocity = SVector::<T, D>::zeros();
            let mut row_slope = SVector::<T, D>::zeros();
            let mut row_acceleration = SVector::<T, D>::zeros();
            let AxisWeights { S, G, .. } = &self.axes[0];
            for ((node, &S), &G) in nodes.iter().zip(S).zip(G) {
                let (v, a) = read(node);
                row_velocity += v * S;
                row_slope += v * G;
                row_acceleration += a * S;
            }
            velocity += row_velocity * row.S;
            acceleration += row_acceleration * row.S;
            for i in 0..D {
                gradient[(i, 0)] += row_slope[i] * row.S;
                for j in 1..D {
                    gradient[(i, j)] += row_velocity[i] * row.G[j];
                }
            }
        }
        (velocity, gradient, acceleration)
    }
}
