//! Blocks of particles whose weights and stresses are computed side by side, one lane a particle.

use std::array;

use nalgebra::{RealField, SMatrix, SVector};

use crate::fault::{Fault, Planted};
use crate::material::Law;
use crate::simd::{Loop, dispatch};
use crate::step::Constants;
use crate::tensor::real;
use crate::transfer::{
    Deposit, Gathered, Node, Weights, gather, gather_runs, scatter, scatter_runs,
};
use crate::weights::{Rule, WideWeights, is_wide};

/// Particles in a block: as many as keep all of it in the first-level cache.
pub(crate) const BLOCK: usize = 64;

/// One number for every particle of a block.
type Row<T> = [T; BLOCK];

/// The weights and the stresses of up to `BLOCK` particles.
///
/// What comes out of one loop is used by another only after all of the block went through the first: vector loads wait
/// for the narrower stores that they overlap.
pub(crate) struct Block<T, const D: usize, const W: usize> {
    /// Positions.
    x: [Row<T>; D],
    /// Positions in cells, from the lower corner, once the weights have been asked for.
    xi: [Row<T>; D],
    /// F, and once it has been asked for the stress.
    tensors: [[Row<T>; D]; D],
    /// Half-sizes in cells.
    l: [Row<T>; D],
    /// Whether any particle's box takes more nodes than the rule's usual ones.
    any_wide: bool,
    planted: Planted,
    base: [Row<i32>; D],
    S: [[Row<T>; W]; D],
    G: [[Row<T>; W]; D],
}

impl<T: RealField + Copy, const D: usize, const W: usize> Block<T, D, W> {
    pub(crate) fn new(planted: Planted) -> Self {
        let zero = [T::zero(); BLOCK];
        Self {
            x: [zero; D],
            xi: [zero; D],
            // Identities, which have a stress.
            tensors: array::from_fn(|i| {
                array::from_fn(|j| [if i == j { T::one() } else { T::zero() }; BLOCK])
            }),
            l: [zero; D],
            any_wide: false,
            planted,
            base: [[0; BLOCK]; D],
            S: [[zero; W]; D],
            G: [[zero; W]; D],
        }
    }

    /// Takes the particles `ids` of the arrays.
    pub(crate) fn pick(&mut self, ids: &[u32], x: &[SVector<T, D>], F: &[SMatrix<T, D, D>]) {
        dispatch(Pick { block: self, ids, x: Some(x), F });
    }

    /// Replaces the deformation gradients by those of the particles `ids`.
    pub(crate) fn pick_F(&mut self, ids: &[u32], F: &[SMatrix<T, D, D>]) {
        dispatch(Pick { block: self, ids, x: None, F });
    }

    /// Takes a run of particles, and computes their weights.
    pub(crate) fn weigh_run<R: Rule<T, D, W>>(
        &mut self,
        rule: R,
        c: &Constants<T, D>,
        x: &[SVector<T, D>],
        F: &[SMatrix<T, D, D>],
    ) {
        dispatch(Weigh { block: self, c, rule, run: Some((x, F)) });
    }

    /// Computes the weights of the particles taken last.
    pub(crate) fn weigh<R: Rule<T, D, W>>(&mut self, c: &Constants<T, D>, rule: R) {
        dispatch(Weigh { block: self, c, rule, run: None });
    }

    /// Takes one particle, as number `k` of the block.
    #[inline(always)]
    pub(crate) fn put(&mut self, k: usize, x: &SVector<T, D>, F: &SMatrix<T, D, D>) {
        for i in 0..D {
            self.x[i][k] = x[i];
            for j in 0..D {
                self.tensors[i][j][k] = F[(i, j)];
            }
        }
    }

    /// The position of particle `k`.
    #[inline(always)]
    pub(crate) fn position(&self, k: usize) -> SVector<T, D> {
        SVector::from_fn(|a, _| self.x[a][k])
    }

    /// Turns deformation gradients into Kirchhoff stresses.
    pub(crate) fn stress<L: Law<T>>(&mut self, c: &Constants<T, D>, law: L) {
        dispatch(Stress { tensors: &mut self.tensors, law, planted: c.planted });
    }

    /// A planted fault: particles in the last cell of an axis forget the last node they reach along it.
    pub(crate) fn skip_last_node(&mut self, upper: &[T; D]) {
        for a in 0..D {
            for k in (0..BLOCK).filter(|&k| self.xi[a][k] >= upper[a] - T::one()) {
                (self.S[a][W - 1][k], self.G[a][W - 1][k]) = (T::zero(), T::zero());
            }
        }
    }

    /// The stress of particle `k`, or F until it has been asked for.
    #[inline(always)]
    pub(crate) fn tensor(&self, k: usize) -> SMatrix<T, D, D> {
        SMatrix::from_fn(|i, j| self.tensors[i][j][k])
    }

    /// `F_aa` of particle `k`, which tells the size of its box.
    #[inline(always)]
    fn stretch(&self, a: usize, k: usize) -> T {
        if self.planted.is(Fault::SizeFromJacobian) {
            let J = (0..D).fold(T::one(), |product, i| product * self.tensors[i][i][k]);
            return J.powf(real(1.0 / D as f64));
        }
        self.tensors[a][a][k]
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

struct Pick<'a, T, const D: usize, const W: usize> {
    block: &'a mut Block<T, D, W>,
    ids: &'a [u32],
    x: Option<&'a [SVector<T, D>]>,
    F: &'a [SMatrix<T, D, D>],
}

impl<T: RealField + Copy, const D: usize, const W: usize> Loop for Pick<'_, T, D, W> {
    #[inline(always)]
    fn run(self) {
        let Self { block, ids, x, F } = self;
        for (k, &p) in ids.iter().take(BLOCK).enumerate() {
            let x = x.map_or_else(|| block.position(k), |x| x[p as usize]);
            block.put(k, &x, &F[p as usize]);
        }
    }
}

/// A run of particles.
type Run<'a, T, const D: usize> = (&'a [SVector<T, D>], &'a [SMatrix<T, D, D>]);

struct Weigh<'a, T, R, const D: usize, const W: usize> {
    block: &'a mut Block<T, D, W>,
    c: &'a Constants<T, D>,
    rule: R,
    /// The particles to take first, if any.
    run: Option<Run<'a, T, D>>,
}

impl<T, R, const D: usize, const W: usize> Loop for Weigh<'_, T, R, D, W>
where
    T: RealField + Copy,
    R: Rule<T, D, W>,
{
    #[inline(always)]
    fn run(self) {
        let Self { block, c, rule, run } = self;
        if let Some((x, F)) = run {
            for a in 0..D {
                for (row, x) in block.x[a].iter_mut().zip(x) {
                    *row = x[a];
                }
                for (stretch, F) in block.tensors[a][a].iter_mut().zip(F) {
                    *stretch = F[(a, a)];
                }
            }
        }
        let mut any_wide = false;
        for a in 0..D {
            for k in 0..BLOCK {
                block.xi[a][k] = c.in_cells(&block.position(k))[a];
            }
            for k in 0..BLOCK {
                let l = rule.half_size(a, block.stretch(a, k));
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

impl<T: RealField + Copy, const D: usize, const W: usize> Loop for Scatter<'_, T, D, W> {
    #[inline(always)]
    fn run(self) {
        let Self { block, strides, piece, first, deposits } = self;
        if D <= 2 && W <= 3 && !block.any_wide {
            scatter_runs(|k| Lane { block, k }, strides, piece, first, deposits);
            return;
        }
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

impl<T: RealField + Copy, const D: usize, const W: usize> Loop for Gather<'_, T, D, W> {
    #[inline(always)]
    fn run(self) {
        let Self { block, strides, nodes, gathered } = self;
        if D <= 2 && W <= 3 && !block.any_wide {
            gather_runs(|k| Lane { block, k }, strides, nodes, gathered);
            return;
        }
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

struct Stress<'a, T, L, const D: usize> {
    tensors: &'a mut [[Row<T>; D]; D],
    law: L,
    planted: Planted,
}

impl<T: RealField + Copy, L: Law<T>, const D: usize> Loop for Stress<'_, T, L, D> {
    #[inline(always)]
    fn run(self) {
        let Self { tensors, law, planted } = self;
        for k in 0..BLOCK {
            let F = SMatrix::<T, D, D>::from_fn(|i, j| tensors[i][j][k]);
            let tau = planted.stress_in_forces(law.kirchhoff(&F), &F);
            for i in 0..D {
                for j in 0..D {
                    tensors[i][j][k] = tau[(i, j)];
                }
            }
        }
    }
}
