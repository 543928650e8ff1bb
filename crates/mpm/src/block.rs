//! Blocks of particles whose weights and stresses are computed side by side, one lane a particle.

use std::array;

use nalgebra::{RealField, SMatrix};

use crate::material::Law;
use crate::simd::{Kernel, dispatch};
use crate::transfer::{Deposit, Gathered, Node, Weights, gather, scatter};
use crate::weights::{Rule, WideWeights, is_wide};

/// Particles in a block: as many as keep all of it in the first-level cache.
pub(crate) const BLOCK: usize = 32;

/// One number for every particle of a block.
type Row<T> = [T; BLOCK];

/// The weights of up to `BLOCK` particles.
pub(crate) struct Block<T, const D: usize, const W: usize> {
    /// Positions in cells, from the lower corner.
    xi: [Row<T>; D],
    /// The diagonal of F.
    stretch: [Row<T>; D],
    /// Half-sizes in cells.
    l: [Row<T>; D],
    /// Whether any particle's box takes more nodes than the rule's usual ones.
    any_wide: bool,
    base: [Row<i32>; D],
    S: [[Row<T>; W]; D],
    G: [[Row<T>; W]; D],
}

impl<T: RealField + Copy, const D: usize, const W: usize> Block<T, D, W> {
    pub(crate) fn new() -> Self {
        let zero = [T::zero(); BLOCK];
        Self {
            xi: [zero; D],
            stretch: [[T::one(); BLOCK]; D],
            l: [zero; D],
            any_wide: false,
            base: [[0; BLOCK]; D],
            S: [[zero; W]; D],
            G: [[zero; W]; D],
        }
    }

    /// Takes a particle into lane `k`.
    #[inline(always)]
    pub(crate) fn place(&mut self, k: usize, xi: &[T; D], F: &SMatrix<T, D, D>) {
        for a in 0..D {
            self.xi[a][k] = xi[a];
            self.stretch[a][k] = F[(a, a)];
        }
    }

    /// Computes the weights of all lanes.
    pub(crate) fn weigh<R: Rule<T, D, W>>(&mut self, rule: R) {
        dispatch(Weigh { block: self, rule });
    }

    /// Position and half-sizes of a particle whose box takes more than the usual nodes.
    #[inline(always)]
    fn wide(&self, k: usize) -> Option<([T; D], [T; D])> {
        let l = array::from_fn(|a| self.l[a][k]);
        (self.any_wide && l.iter().any(|&l| is_wide(l)))
            .then(|| (array::from_fn(|a| self.xi[a][k]), l))
    }

    /// Adds what the first `deposits.len()` particles give to the piece of the grid that starts at node `first`.
    pub(crate) fn scatter(
        &self,
        strides: &[usize; D],
        piece: &mut [Node<T, D>],
        first: usize,
        deposits: &[Deposit<T, D>],
    ) {
        dispatch(Scatter { block: self, strides, piece, first, deposits });
    }

    /// Interpolates for the first `gathered.len()` particles.
    pub(crate) fn gather(
        &self,
        strides: &[usize; D],
        nodes: &[Node<T, D>],
        gathered: &mut [Gathered<T, D>],
    ) {
        dispatch(Gather { block: self, strides, nodes, gathered });
    }
}

/// The weights of particle `k` of a block.
struct Lane<'a, T, const D: usize, const W: usize> {
    block: &'a Block<T, D, W>,
    k: usize,
}

impl<T: RealField + Copy, const D: usize, const W: usize> Weights<T, D, W> for Lane<'_, T, D, W> {
    #[inline(always)]
    fn base(&self, axis: usize) -> usize {
        self.block.base[axis][self.k] as usize
    }

    #[inline(always)]
    fn S(&self, axis: usize, place: usize) -> T {
        self.block.S[axis][place][self.k]
    }

    #[inline(always)]
    fn G(&self, axis: usize, place: usize) -> T {
        self.block.G[axis][place][self.k]
    }
}

struct Weigh<'a, T, R, const D: usize, const W: usize> {
    block: &'a mut Block<T, D, W>,
    rule: R,
}

impl<T, R, const D: usize, const W: usize> Kernel for Weigh<'_, T, R, D, W>
where
    T: RealField + Copy,
    R: Rule<T, D, W>,
{
    #[inline(always)]
    fn run(self) {
        let Self { block, rule } = self;
        let mut any_wide = false;
        for a in 0..D {
            for k in 0..BLOCK {
                let l = rule.half_size(a, block.stretch[a][k]);
                any_wide |= is_wide(l);
                block.l[a][k] = l;
                let weights = R::along_axis(block.xi[a][k], l);
                block.base[a][k] = weights.base;
                for i in 0..W {
                    block.S[a][i][k] = weights.S[i];
                    block.G[a][i][k] = weights.G[i];
                }
            }
        }
        block.any_wide = any_wide;
    }
}

struct Scatter<'a, T, const D: usize, const W: usize> {
    block: &'a Block<T, D, W>,
    strides: &'a [usize; D],
    piece: &'a mut [Node<T, D>],
    first: usize,
    deposits: &'a [Deposit<T, D>],
}

impl<T: RealField + Copy, const D: usize, const W: usize> Kernel for Scatter<'_, T, D, W> {
    #[inline(always)]
    fn run(self) {
        let Self { block, strides, piece, first, deposits } = self;
        for (k, deposit) in deposits.iter().enumerate().take(BLOCK) {
            if let Some((xi, l)) = block.wide(k) {
                scatter_wide(&xi, &l, strides, piece, first, deposit);
            } else {
                scatter(&Lane { block, k }, strides, piece, first, deposit);
            }
        }
    }
}

#[inline(never)]
fn scatter_wide<T: RealField + Copy, const D: usize>(
    xi: &[T; D],
    l: &[T; D],
    strides: &[usize; D],
    piece: &mut [Node<T, D>],
    first: usize,
    deposit: &Deposit<T, D>,
) {
    scatter(&WideWeights::new(xi, l), strides, piece, first, deposit);
}

struct Gather<'a, T, const D: usize, const W: usize> {
    block: &'a Block<T, D, W>,
    strides: &'a [usize; D],
    nodes: &'a [Node<T, D>],
    gathered: &'a mut [Gathered<T, D>],
}

impl<T: RealField + Copy, const D: usize, const W: usize> Kernel for Gather<'_, T, D, W> {
    #[inline(always)]
    fn run(self) {
        let Self { block, strides, nodes, gathered } = self;
        for (k, gathered) in gathered.iter_mut().enumerate().take(BLOCK) {
            if let Some((xi, l)) = block.wide(k) {
                gather_wide(&xi, &l, strides, nodes, gathered);
            } else {
                gather(&Lane { block, k }, strides, nodes, gathered);
            }
        }
    }
}

#[inline(never)]
fn gather_wide<T: RealField + Copy, const D: usize>(
    xi: &[T; D],
    l: &[T; D],
    strides: &[usize; D],
    nodes: &[Node<T, D>],
    gathered: &mut Gathered<T, D>,
) {
    gather(&WideWeights::new(xi, l), strides, nodes, gathered);
}

/// Tensors of up to `BLOCK` particles.
pub(crate) struct Tensors<T, const D: usize> {
    entries: [[Row<T>; D]; D],
}

impl<T: RealField + Copy, const D: usize> Tensors<T, D> {
    /// Identities.
    pub(crate) fn new() -> Self {
        Self {
            entries: array::from_fn(|i| {
                array::from_fn(|j| [if i == j { T::one() } else { T::zero() }; BLOCK])
            }),
        }
    }

    #[inline(always)]
    pub(crate) fn get(&self, k: usize) -> SMatrix<T, D, D> {
        SMatrix::from_fn(|i, j| self.entries[i][j][k])
    }

    #[inline(always)]
    pub(crate) fn set(&mut self, k: usize, value: &SMatrix<T, D, D>) {
        for i in 0..D {
            for j in 0..D {
                self.entries[i][j][k] = value[(i, j)];
            }
        }
    }

    /// Turns deformation gradients into Kirchhoff stresses.
    pub(crate) fn stress<L: Law<T>>(&mut self, law: L) {
        dispatch(Stress { tensors: self, law });
    }
}

struct Stress<'a, T, L, const D: usize> {
    tensors: &'a mut Tensors<T, D>,
    law: L,
}

impl<T: RealField + Copy, L: Law<T>, const D: usize> Kernel for Stress<'_, T, L, D> {
    #[inline(always)]
    fn run(self) {
        for k in 0..BLOCK {
            let tau = self.law.kirchhoff(&self.tensors.get(k));
            self.tensors.set(k, &tau);
        }
    }
}
