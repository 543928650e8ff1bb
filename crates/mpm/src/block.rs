//! Blocks of particles whose weights and stresses are computed side by side, one lane a particle.

use std::array;

use nalgebra::{RealField, SMatrix, SVector};

use crate::fault::{Fault, Planted};
use crate::material::Law;
use crate::octets::{gather_in_space, scatter_in_space};
use crate::quads::{gather_runs, scatter_runs};
use crate::simd::{Loop, Vectors, dispatch};
use crate::step::Constants;
use crate::tensor::real;
use crate::transfer::{Deposits, Gathered, Node, Receive, Weights, gather, is_middle, scatter};
use crate::weights::{Rule, WideWeights, index, is_wide};

/// Particles in a block: as many as keep all of it in the first-level cache.
pub(crate) const BLOCK: usize = 64;

/// One number for every particle of a block.
type Row<T> = [T; BLOCK];

/// The particles of a block, as they are at a time.
#[derive(Clone, Copy)]
pub(crate) struct Run<'a, T, const D: usize> {
    /// Positions.
    pub(crate) x: &'a [SVector<T, D>; BLOCK],
    /// Deformation gradients.
    pub(crate) F: &'a [SMatrix<T, D, D>; BLOCK],
}

impl<T: RealField + Copy, const D: usize> Run<'_, T, D> {
    /// States the forces of the particles' stresses, for the reference volumes in `deposits.volume`.
    pub(crate) fn stress<L: Law<T>>(
        self,
        c: &Constants<T, D>,
        law: L,
        deposits: &mut Deposits<T, D, BLOCK>,
    ) {
        dispatch(Stress { run: self, c, law, deposits });
    }
}

/// Copies of up to `BLOCK` particles that do not lie side by side.
pub(crate) struct Copies<T, const D: usize> {
    /// Positions.
    pub(crate) x: [SVector<T, D>; BLOCK],
    /// Velocities.
    pub(crate) v: [SVector<T, D>; BLOCK],
    /// Deformation gradients.
    pub(crate) F: [SMatrix<T, D, D>; BLOCK],
}

impl<T: RealField + Copy, const D: usize> Copies<T, D> {
    pub(crate) fn new() -> Self {
        // Identities, which have a stress.
        let zero = [SVector::zeros(); BLOCK];
        Self { x: zero, v: zero, F: [SMatrix::identity(); BLOCK] }
    }

    pub(crate) fn run(&self) -> Run<'_, T, D> {
        Run { x: &self.x, F: &self.F }
    }

    /// Takes positions and deformation gradients of the particles `ids`.
    pub(crate) fn pick(&mut self, ids: &[u32], x: &[SVector<T, D>], F: &[SMatrix<T, D, D>]) {
        for (own, &p) in self.x.iter_mut().zip(ids) {
            *own = x[p as usize];
        }
        self.pick_F(ids, F);
    }

    /// Replaces the deformation gradients by those of the particles `ids`.
    pub(crate) fn pick_F(&mut self, ids: &[u32], F: &[SMatrix<T, D, D>]) {
        for (own, &p) in self.F.iter_mut().zip(ids) {
            *own = F[p as usize];
        }
    }

    /// Takes whole arrays, no longer than a block.
    pub(crate) fn copy(&mut self, x: &[SVector<T, D>], F: &[SMatrix<T, D, D>]) {
        self.x[..x.len()].copy_from_slice(x);
        self.F[..F.len()].copy_from_slice(F);
    }
}

/// The weights of up to `BLOCK` particles.
///
/// What comes out of one loop is used by another only after all of the block went through the first: vector loads wait
/// for the narrower stores that they overlap.
pub(crate) struct Block<T, const D: usize, const W: usize> {
    /// Index of the first node of every particle.
    first_node: [usize; BLOCK],
    /// Weights, but for those of the [middle node](is_middle).
    S: [[Row<T>; W]; D],
    G: [[Row<T>; W]; D],
    /// Whether any particle's box takes more nodes than the rule's usual ones.
    any_wide: bool,
    /// Positions in cells, from the lower corner; kept up where boxes are wide.
    xi: [Row<T>; D],
    /// Half-sizes in cells; kept up where boxes are wide.
    l: [Row<T>; D],
}

impl<T: RealField + Copy, const D: usize, const W: usize> Block<T, D, W> {
    pub(crate) fn new() -> Self {
        let zero = [T::zero(); BLOCK];
        Self {
            first_node: [0; BLOCK],
            S: [[zero; W]; D],
            G: [[zero; W]; D],
            any_wide: false,
            xi: [zero; D],
            l: [zero; D],
        }
    }

    /// Computes the weights of particles.
    pub(crate) fn weigh<R: Rule<T, D, W>>(
        &mut self,
        c: &Constants<T, D>,
        rule: R,
        run: Run<'_, T, D>,
    ) {
        dispatch(Weigh { block: self, c, rule, run });
        if self.any_wide {
            for k in 0..BLOCK {
                let xi = c.in_cells(&run.x[k]);
                for a in 0..D {
                    self.xi[a][k] = xi[a];
                    self.l[a][k] = rule.half_size(a, stretch(c.planted, &run.F[k], a));
                }
            }
        }
    }

    /// A planted fault: particles in the last cell of an axis forget the last node they reach along it.
    pub(crate) fn skip_last_node(&mut self, c: &Constants<T, D>, x: &[SVector<T, D>; BLOCK]) {
        let upper = c.upper_in_cells();
        for (k, x) in x.iter().enumerate() {
            let xi = c.in_cells(x);
            for a in (0..D).filter(|&a| xi[a] >= upper[a] - T::one()) {
                (self.S[a][W - 1][k], self.G[a][W - 1][k]) = (T::zero(), T::zero());
            }
        }
    }

    /// Position and half-sizes of a particle whose box takes more than the usual nodes.
    #[inline(always)]
    fn wide(&self, k: usize) -> Option<([T; D], [T; D])> {
        let l = array::from_fn(|a| self.l[a][k]);
        (self.any_wide && l.iter().any(|&l| is_wide(l)))
            .then(|| (array::from_fn(|a| self.xi[a][k]), l))
    }

    /// Adds what the first `count` particles give to the piece of the grid that starts at node `first`.
    pub(crate) fn scatter(
        &self,
        strides: &[usize; D],
        piece: &mut [Node<T, D>],
        first: usize,
        deposits: &Deposits<T, D, BLOCK>,
        count: usize,
    ) {
        dispatch(Scatter { block: self, strides, piece, first, deposits, count });
    }

    /// Interpolates for the first `count` particles.
    pub(crate) fn gather(
        &self,
        strides: &[usize; D],
        nodes: &[Node<T, D>],
        count: usize,
        receiver: impl Receive<T, D>,
    ) {
        dispatch(Gather { block: self, strides, nodes, count, receiver });
    }
}

/// The weights of particle `k` of a block.
struct Lane<'a, T, const D: usize, const W: usize> {
    block: &'a Block<T, D, W>,
    k: usize,
}

impl<T: RealField + Copy, const D: usize, const W: usize> Weights<T, D, W> for Lane<'_, T, D, W> {
    #[inline(always)]
    fn first_node(&self) -> usize {
        self.block.first_node[self.k]
    }

    #[inline(always)]
    fn S(&self, axis: usize, place: usize) -> T {
        let S = &self.block.S[axis];
        if is_middle::<W>(place) {
            return T::one() - S[place - 1][self.k] - S[place + 1][self.k];
        }
        S[place][self.k]
    }

    #[inline(always)]
    fn G(&self, axis: usize, place: usize) -> T {
        let G = &self.block.G[axis];
        if is_middle::<W>(place) {
            return -G[place - 1][self.k] - G[place + 1][self.k];
        }
        G[place][self.k]
    }
}

/// `F_aa` of a particle, which tells the size of its box.
#[inline(always)]
fn stretch<T: RealField + Copy, const D: usize>(
    planted: Planted,
    F: &SMatrix<T, D, D>,
    a: usize,
) -> T {
    if planted.is(Fault::SizeFromJacobian) {
        let J = (0..D).fold(T::one(), |product, i| product * F[(i, i)]);
        return J.powf(real(1.0 / D as f64));
    }
    F[(a, a)]
}

struct Weigh<'a, T, R, const D: usize, const W: usize> {
    block: &'a mut Block<T, D, W>,
    c: &'a Constants<T, D>,
    rule: R,
    run: Run<'a, T, D>,
}

impl<T, R, const D: usize, const W: usize> Loop for Weigh<'_, T, R, D, W>
where
    T: RealField + Copy,
    R: Rule<T, D, W>,
{
    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self { block, c, rule, run: Run { x, F } } = self;
        let Block { first_node, S, G, .. } = block;
        block.any_wide = weigh(c, rule, x, F, first_node, S, G);
    }
}

/// Computes weights, and tells whether any box is wide. As a function of its own, which tells the compiler that the arrays
/// are in different places.
#[inline(always)]
fn weigh<T, R, const D: usize, const W: usize>(
    c: &Constants<T, D>,
    rule: R,
    x: &[SVector<T, D>; BLOCK],
    F: &[SMatrix<T, D, D>; BLOCK],
    first_node: &mut [usize; BLOCK],
    S: &mut [[Row<T>; W]; D],
    G: &mut [[Row<T>; W]; D],
) -> bool
where
    T: RealField + Copy,
    R: Rule<T, D, W>,
{
    let mut any_wide = false;
    for k in 0..BLOCK {
        let xi = c.in_cells(&x[k]);
        let mut first = 0.0;
        for a in 0..D {
            let l = rule.half_size(a, stretch(c.planted, &F[k], a));
            any_wide |= is_wide(l);
            let weights = R::along_axis(xi[a], l);
            first += weights.base * c.strides[a] as f64;
            for i in 0..W {
                if !is_middle::<W>(i) {
                    S[a][i][k] = weights.S[i];
                    G[a][i][k] = weights.G[i];
                }
            }
        }
        first_node[k] = index(first);
    }
    any_wide
}

struct Scatter<'a, T, const D: usize, const W: usize> {
    block: &'a Block<T, D, W>,
    strides: &'a [usize; D],
    piece: &'a mut [Node<T, D>],
    first: usize,
    deposits: &'a Deposits<T, D, BLOCK>,
    count: usize,
}

impl<T: RealField + Copy, const D: usize, const W: usize> Loop for Scatter<'_, T, D, W> {
    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let Self { block, strides, piece, first, deposits, count } = self;
        let count = count.min(BLOCK);
        if D <= 2 && W <= 3 && !block.any_wide {
            scatter_runs(vectors, |k| Lane { block, k }, strides, piece, first, deposits, count);
            return;
        }
        for k in 0..count {
            if let Some((xi, l)) = block.wide(k) {
                scatter_wide(&xi, &l, strides, piece, first, (deposits, k));
            } else if D == 3 {
                let given = (deposits, k);
                scatter_in_space(vectors, &Lane { block, k }, strides, piece, first, given);
            } else {
                scatter(&Lane { block, k }, strides, piece, first, (deposits, k));
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
    deposit: (&Deposits<T, D, BLOCK>, usize),
) {
    scatter(&WideWeights::new(xi, l, strides), strides, piece, first, deposit);
}

struct Gather<'a, T, A, const D: usize, const W: usize> {
    block: &'a Block<T, D, W>,
    strides: &'a [usize; D],
    nodes: &'a [Node<T, D>],
    count: usize,
    receiver: A,
}

impl<T: RealField + Copy, A: Receive<T, D>, const D: usize, const W: usize> Loop
    for Gather<'_, T, A, D, W>
{
    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let Self { block, strides, nodes, count, mut receiver } = self;
        let count = count.min(BLOCK);
        if D <= 2 && W <= 3 && !block.any_wide {
            gather_runs(vectors, |k| Lane { block, k }, strides, nodes, count, &mut receiver);
            return;
        }
        for k in 0..count {
            let gathered = match block.wide(k) {
                Some((xi, l)) => gather_wide(&xi, &l, strides, nodes),
                None if D == 3 => gather_in_space(vectors, &Lane { block, k }, strides, nodes),
                None => gather(&Lane { block, k }, strides, nodes),
            };
            receiver.receive(k, &gathered);
        }
    }
}

#[inline(never)]
fn gather_wide<T: RealField + Copy, const D: usize>(
    xi: &[T; D],
    l: &[T; D],
    strides: &[usize; D],
    nodes: &[Node<T, D>],
) -> Gathered<T, D> {
    gather(&WideWeights::new(xi, l, strides), strides, nodes)
}

struct Stress<'a, T, L, const D: usize> {
    run: Run<'a, T, D>,
    c: &'a Constants<T, D>,
    law: L,
    deposits: &'a mut Deposits<T, D, BLOCK>,
}

impl<T: RealField + Copy, L: Law<T>, const D: usize> Loop for Stress<'_, T, L, D> {
    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self { run: Run { F, .. }, c, law, deposits } = self;
        if !tractions::<true, _, _, D>(c, law, F, deposits) {
            tractions::<false, _, _, D>(c, law, F, deposits);
        }
    }
}

/// `-V0 tau / h` for all particles of a block, in the short way or not; whether that may be asked for all of them.
#[inline(always)]
fn tractions<const SHORT: bool, T: RealField + Copy, L: Law<T>, const D: usize>(
    c: &Constants<T, D>,
    law: L,
    F: &[SMatrix<T, D, D>; BLOCK],
    deposits: &mut Deposits<T, D, BLOCK>,
) -> bool {
    let mut short = true;
    for k in 0..BLOCK {
        let F = &F[k];
        short &= law.is_short(F);
        let tau = if SHORT { law.kirchhoff_short(F) } else { law.kirchhoff(F) };
        let tau = c.planted.stress_in_forces(tau, F);
        deposits.traction[k] = tau * -(deposits.volume[k] * c.inverse_spacing);
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Grid;
    use crate::bands::Bands;
    use crate::grid::Layout;
    use crate::material::NeoHookean;
    use crate::weights::StretchingBox;

    fn constants<const D: usize>() -> (Constants<f64, D>, usize) {
        let grid =
            Grid { lower: SVector::zeros(), spacing: 0.5, cells: [8; D], walls: [[false; 2]; D] };
        let layout = Layout::new(&grid, 8).unwrap();
        let bands = Bands::new(&layout, 1);
        (Constants::new(&grid, &layout, &bands, 0.1, 1.0), layout.nodes)
    }

    fn noise(seed: usize) -> f64 {
        (seed as f64 * 12.9898).sin()
    }

    /// Boxes may grow and shrink again from one time that a block is used to the next.
    #[test]
    fn particles_of_a_block_exchange_what_their_boxes_cover_however_many_of_those_are_wide() {
        fn check<const D: usize>() {
            let (c, nodes) = constants::<D>();
            let reference = SVector::repeat(0.25);
            let rule = StretchingBox(reference);
            let x: [_; BLOCK] =
                array::from_fn(|k| SVector::from_fn(|a, _| 2.0 + 1.2 * noise(5 * k + a)));
            let grid: Vec<Node<f64, D>> = (0..nodes)
                .map(|n| Node { values: array::from_fn(|q| noise(8 * n + q + 1000)) })
                .collect();
            let mut deposits = Deposits::<f64, D, BLOCK>::zero();
            for k in 0..BLOCK {
                let of = |from: usize| SVector::from_fn(|a, _| noise(3 * k + a + from));
                deposits.level[k] = Node::new(&of(50), &of(700), 1.0 + 0.5 * noise(k));
                deposits.traction[k] = SMatrix::from_fn(|i, j| noise(9 * k + 3 * i + j + 2000));
            }
            let mut block = Block::<f64, D, 3>::new();
            for wide in [vec![], vec![0], vec![5, BLOCK - 1], (0..BLOCK).collect(), vec![]] {
                let F: [SMatrix<f64, D, D>; BLOCK] = array::from_fn(|k| {
                    let mut F = SMatrix::identity();
                    if wide.contains(&k) {
                        F[(k % D, k % D)] = 3.0 + noise(k);
                    }
                    F
                });
                block.weigh(&c, rule, Run { x: &x, F: &F });
                let exact = |k: usize| {
                    let l = array::from_fn(|a| reference[a] * F[k][(a, a)]);
                    WideWeights::new(&c.in_cells(&x[k]), &l, &c.strides)
                };
                for count in [BLOCK, 41] {
                    let mut gathered = [Gathered::zero(); BLOCK];
                    block.gather(&c.strides, &grid, count, &mut gathered[..]);
                    for k in 0..count {
                        let alone = gather(&exact(k), &c.strides, &grid);
                        let off = (gathered[k].velocity - alone.velocity).amax();
                        assert!(off < 1e-13, "{wide:?} {k} {off:e}");
                        let off = (gathered[k].acceleration - alone.acceleration).amax();
                        assert!(off < 1e-13, "{wide:?} {k} {off:e}");
                        let off = (gathered[k].velocity_gradient - alone.velocity_gradient).amax();
                        assert!(off < 1e-13, "{wide:?} {k} {off:e}");
                    }
                    assert!(gathered[count..].iter().all(|own| own.velocity.amax() == 0.0));

                    let mut sums = vec![Node::zero(); nodes];
                    let mut one_by_one = sums.clone();
                    block.scatter(&c.strides, &mut sums, 0, &deposits, count);
                    for k in 0..count {
                        scatter(&exact(k), &c.strides, &mut one_by_one, 0, (&deposits, k));
                    }
                    for (a, b) in sums.iter().zip(&one_by_one) {
                        for (a, b) in a.values.iter().zip(&b.values) {
                            assert!((a - b).abs() < 1e-12, "{wide:?} {a} {b}");
                        }
                    }
                }
            }
        }
        check::<1>();
        check::<2>();
        check::<3>();
    }

    /// The short way to the stress is right for some deformations alone.
    #[test]
    fn tractions_are_those_of_each_particle_whatever_else_is_in_its_block() {
        fn check<const D: usize>() {
            let (c, _) = constants::<D>();
            let law = NeoHookean { lambda: 5.77, mu: 3.85, planted: c.planted };
            for large in [vec![], vec![0], vec![31], vec![BLOCK - 1], (0..BLOCK).collect()] {
                let F: [SMatrix<f64, D, D>; BLOCK] = array::from_fn(|k| {
                    let stretch = if large.contains(&k) { 2.5 } else { 1.1 };
                    SMatrix::from_fn(|i, j| match i == j {
                        true => stretch + 0.05 * noise(k + i),
                        false => 0.05 * noise(k + 2 * i + j),
                    })
                });
                let mut deposits = Deposits::<f64, D, BLOCK>::zero();
                deposits.volume = array::from_fn(|k| 1.0 + 0.5 * noise(k));
                let x = [SVector::zeros(); BLOCK];
                Run { x: &x, F: &F }.stress(&c, law, &mut deposits);
                for k in 0..BLOCK {
                    let expected = -law.kirchhoff(&F[k]) * (deposits.volume[k] * c.inverse_spacing);
                    assert_eq!(deposits.traction[k], expected, "{large:?} {k}");
                }
            }
        }
        check::<1>();
        check::<2>();
        check::<3>();
    }
}
