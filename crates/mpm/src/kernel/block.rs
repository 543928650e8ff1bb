//! Blocks of 64 particles: their stresses, and what their weights are to P2G and G2P.

use std::any::Any;
use std::sync::Arc;

use mmsmith_lanes::simd::{Lanes, Loop, Vectors, dispatch, is_wide};
use mmsmith_lanes::tensor::product;
use mmsmith_laws::{
    BlockOfStresses, BlockWithMemory, ConstitutiveLaw, InternalVariable, LawWithMemory, LibraryLaw,
};
use nalgebra::{SMatrix, SVector};

use crate::grid::geometry::Constants;
use crate::grid::node::Node;
use crate::kernel::advance::AdvanceParticles;
use crate::kernel::any::{Contributions, Interpolated, Receive};
use crate::kernel::beyond;
use crate::kernel::copies::{BLOCK, Kinematics};

/// A law for blocks of particles.
pub(crate) trait BlockLaw<T: Lanes, const D: usize>: Send + Sync {
    /// Sets the stress fluxes of particles with deformation gradients `F` and these internal variables, for the reference volumes in
    /// `contributions.volume`; adds other forces of the stress to `contributions.value`, where there are such.
    fn stress(
        &self,
        c: &Constants<T, D>,
        F: &[SMatrix<T, D, D>; BLOCK],
        internal: &[T],
        contributions: &mut Contributions<T, D, BLOCK>,
    );

    /// How many internal variables a particle has; none for elastic laws.
    fn variables(&self) -> usize {
        0
    }

    /// The internal variables of a particle at time zero, from its reference position.
    fn initial(&self, _X: &SVector<T, D>) -> Vec<T> {
        Vec::new()
    }

    /// Whether internal variables follow the deformation gradient, so that increments need gradients.
    fn follows_deformation(&self) -> bool {
        true
    }

    /// Whether internal variables follow the position, so that increments need positions.
    fn follows_position(&self) -> bool {
        false
    }

    /// Whether the change of volume is projected: the solver sets the internal variables then, `theta` and `p`.
    fn is_projected(&self) -> bool {
        false
    }

    /// Where the change of volume follows the grid from now on: [`stress`](Self::stress) leaves the mean stress out of the fluxes, and sets
    /// the scalars of `contributions.value`. The first internal variable is the change of volume.
    fn follow_grid(&mut self) {}

    /// Where the change of volume is projected: sets the first component of momentum of each particle in `contributions.value` to its reference
    /// volume times its mean stress at the projected change of volume, and the others to zero.
    fn mean_stresses(
        &self,
        _c: &Constants<T, D>,
        _F: &[SMatrix<T, D, D>; BLOCK],
        _theta: &[T; BLOCK],
        _contributions: &mut Contributions<T, D, BLOCK>,
    ) {
    }

    /// Advances the internal variables of no more than a block of particles.
    fn evolve(&self, _increment: BlockIncrement<'_, T, D>, _internal: &mut [T]) {}

    /// [`evolve`](Self::evolve) and [`stress`](Self::stress) at the end, of a whole block.
    fn evolve_to_stress(
        &self,
        c: &Constants<T, D>,
        (start, end): (&[SMatrix<T, D, D>], &[SMatrix<T, D, D>; BLOCK]),
        x: &[SVector<T, D>; BLOCK],
        internal: &mut [T],
        contributions: &mut Contributions<T, D, BLOCK>,
    ) {
        self.evolve(BlockIncrement { time: c.time_step, start, end, x }, internal);
        self.stress(c, end, internal, contributions);
    }
}

/// An increment of the deformation of no more than a block of particles.
pub(crate) struct BlockIncrement<'a, T, const D: usize> {
    pub(crate) time: T,
    /// Deformation gradients at the start, where internal variables follow them.
    pub(crate) start: &'a [SMatrix<T, D, D>],
    /// Deformation gradients at the end.
    pub(crate) end: &'a [SMatrix<T, D, D>],
    /// Positions at the end, where [internal variables follow them](BlockLaw::follows_position).
    pub(crate) x: &'a [SVector<T, D>],
}

impl<T: Lanes, L: LibraryLaw<T>, const D: usize> BlockLaw<T, D> for L {
    fn stress(
        &self,
        c: &Constants<T, D>,
        F: &[SMatrix<T, D, D>; BLOCK],
        _: &[T],
        contributions: &mut Contributions<T, D, BLOCK>,
    ) {
        dispatch(Stress { F, c, law: *self, contributions });
    }
}

/// The weights of up to `BLOCK` particles at nodes, and the sums of P2G and G2P with them.
///
/// A loop over the block completes before another loop reads its results: vector loads wait for the narrower stores that
/// they overlap.
pub(crate) trait BlockWeights<T: Lanes, const D: usize>: Send {
    /// Computes the weights of the particles `ids`.
    fn compute(&mut self, c: &Constants<T, D>, ids: &[u32], kinematics: Kinematics<'_, T, D>);

    /// P2G of the first `count` particles, to the nodes of a window.
    fn p2g(
        &mut self,
        strides: &[usize; D],
        window: &mut [Node<T, D>],
        contributions: &Contributions<T, D, BLOCK>,
        count: usize,
    );

    /// G2P of the first particles, as many as `receiver` has places.
    fn g2p(
        &mut self,
        strides: &[usize; D],
        nodes: &[Node<T, D>],
        receiver: &mut [Interpolated<T, D>],
    );

    /// G2P of as many particles as `interpolated` has places, by which they advance. Default: the values are stored first.
    fn g2p_and_advance(
        &mut self,
        strides: &[usize; D],
        nodes: &[Node<T, D>],
        interpolated: &mut [Interpolated<T, D>],
        mut particles: AdvanceParticles<'_, T, D>,
    ) {
        self.g2p(strides, nodes, interpolated);
        for (k, interpolated) in interpolated.iter().enumerate() {
            particles.receive(k, interpolated);
        }
    }

    /// P2G of the scalars of the first `count` particles, where [`p2g`](Self::p2g) leaves them out. Default: none, since only shapes whose
    /// [domains exchange scalars](crate::domain::of_particles::Domain::exchanges_scalars) are asked.
    fn p2g_scalars(
        &mut self,
        _strides: &[usize; D],
        _window: &mut [Node<T, D>],
        _contributions: &Contributions<T, D, BLOCK>,
        _count: usize,
    ) {
        beyond("scalars of a shape that exchanges none");
    }

    /// G2P of the scalars of nodes to as many particles as `values` has places, as [`p2g_scalars`](Self::p2g_scalars).
    fn g2p_scalars(&mut self, _strides: &[usize; D], _nodes: &[Node<T, D>], _values: &mut [T]) {
        beyond("scalars of a shape that exchanges none");
    }

    /// A planted fault: particles in the last cell of an axis skip the last node they reach along it. Default: none does.
    fn skip_last_node(&mut self, _c: &Constants<T, D>, _x: &[SVector<T, D>; BLOCK]) {}
}

/// A law that the caller brings, for blocks of particles in the updated Lagrangian formulation.
pub(crate) struct OwnBlocks<T, const D: usize>(pub(crate) Arc<dyn ConstitutiveLaw<T, D>>);

impl<T: Lanes, const D: usize> BlockLaw<T, D> for OwnBlocks<T, D> {
    fn stress(
        &self,
        c: &Constants<T, D>,
        F: &[SMatrix<T, D, D>; BLOCK],
        _: &[T],
        contributions: &mut Contributions<T, D, BLOCK>,
    ) {
        let mut block = BlockOfStresses::at_rest();
        for (n, F) in F.iter().enumerate() {
            block.set(n, F);
        }
        block.evaluate(self.0.as_ref());
        set_fluxes(c, F, |n, F| product(&block.stress(n), &F.transpose()), contributions);
    }
}

/// Sets the stress fluxes of a block whose Kirchhoff stresses `tau` gives, particle by particle.
fn set_fluxes<T: Lanes, const D: usize>(
    c: &Constants<T, D>,
    F: &[SMatrix<T, D, D>; BLOCK],
    tau: impl Fn(usize, &SMatrix<T, D, D>) -> SMatrix<T, D, D>,
    contributions: &mut Contributions<T, D, BLOCK>,
) {
    for (n, F) in F.iter().enumerate() {
        let tau = c.planted.stress_in_forces(tau(n, F), F);
        contributions.stress_flux[n] = tau * -(contributions.volume[n] * c.inverse_spacing);
    }
}

/// A law with memory, for blocks of particles.
pub(crate) struct MemoryBlocks<T, const D: usize> {
    law: Arc<dyn LawWithMemory<T, D>>,
    variables: Vec<InternalVariable>,
}

impl<T: Lanes, const D: usize> MemoryBlocks<T, D> {
    pub(crate) fn new(law: Arc<dyn LawWithMemory<T, D>>) -> Self {
        let variables = law.variables();
        Self { law, variables }
    }
}

impl<T: Lanes, const D: usize> BlockLaw<T, D> for MemoryBlocks<T, D> {
    fn stress(
        &self,
        c: &Constants<T, D>,
        F: &[SMatrix<T, D, D>; BLOCK],
        internal: &[T],
        contributions: &mut Contributions<T, D, BLOCK>,
    ) {
        let mut block = BlockWithMemory::at_rest(&self.variables);
        block.kirchhoff(self.law.as_ref(), F, internal);
        set_fluxes(c, F, |n, _| block.stress(n), contributions);
    }

    fn variables(&self) -> usize {
        self.variables.len()
    }

    fn initial(&self, X: &SVector<T, D>) -> Vec<T> {
        self.law.initial(X)
    }

    fn evolve(&self, increment: BlockIncrement<'_, T, D>, internal: &mut [T]) {
        let BlockIncrement { time, start, end, .. } = increment;
        let mut block = BlockWithMemory::at_rest(&self.variables);
        block.evolve(self.law.as_ref(), start, end, time, internal);
    }

    fn evolve_to_stress(
        &self,
        c: &Constants<T, D>,
        (start, end): (&[SMatrix<T, D, D>], &[SMatrix<T, D, D>; BLOCK]),
        _: &[SVector<T, D>; BLOCK],
        internal: &mut [T],
        contributions: &mut Contributions<T, D, BLOCK>,
    ) {
        let mut block = BlockWithMemory::at_rest(&self.variables);
        block.evolve_to_kirchhoff(self.law.as_ref(), start, end, c.time_step, internal);
        set_fluxes(c, end, |n, _| block.stress(n), contributions);
    }
}

struct Stress<'a, T, L, const D: usize> {
    F: &'a [SMatrix<T, D, D>; BLOCK],
    c: &'a Constants<T, D>,
    law: L,
    contributions: &'a mut Contributions<T, D, BLOCK>,
}

impl<T: Lanes, L: LibraryLaw<T>, const D: usize> Loop for Stress<'_, T, L, D> {
    const IS_WIDE: bool = is_wide::<T, D>();

    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self { F, c, law, contributions } = self;
        if !L::HAS_SHORT || !stress_fluxes::<true, _, _, D>(c, law, F, contributions) {
            stress_fluxes::<false, _, _, D>(c, law, F, contributions);
        }
    }
}

/// Sets `-V0 tau / h` for all particles of a block, by the short form of the law or the full one; returns whether the short
/// form holds for all of them.
#[inline(always)]
fn stress_fluxes<const SHORT: bool, T: Lanes, L: LibraryLaw<T>, const D: usize>(
    c: &Constants<T, D>,
    law: L,
    F: &[SMatrix<T, D, D>; BLOCK],
    contributions: &mut Contributions<T, D, BLOCK>,
) -> bool {
    let mut short = true;
    for k in 0..BLOCK {
        let F = &F[k];
        short &= law.is_short(F);
        let tau = if SHORT { law.kirchhoff_short(F) } else { law.kirchhoff(F) };
        let tau = c.planted.stress_in_forces(tau, F);
        contributions.stress_flux[k] = tau * -(contributions.volume[k] * c.inverse_spacing);
    }
    short
}

/// A value for one number of dimensions as the same for another one, which has to be the same number. Kernels that have a meaning in one
/// alone are so compiled for no other.
pub(crate) fn in_same_dimension<Of: 'static, As: 'static>(of: Of) -> Option<As> {
    let mut of = Some(of);
    (&mut of as &mut dyn Any).downcast_mut::<Option<As>>()?.take()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use std::array;

    use crate::Grid;
    use crate::grid::Layout;
    use crate::grid::tiles::Tiles;
    use mmsmith_laws::NeoHookean;

    pub(in crate::kernel) fn constants<const D: usize>() -> (Constants<f64, D>, usize) {
        let grid =
            Grid { lower: SVector::zeros(), spacing: 0.5, cells: [8; D], walls: [[false; 2]; D] };
        let layout = Layout::new(&grid, 8).unwrap();
        let tiles = Tiles::new(&layout, &grid.cells, 6);
        (Constants::new(&grid, &layout, &tiles, 0.1, 1.0), layout.nodes)
    }

    pub(in crate::kernel) fn noise(seed: usize) -> f64 {
        (seed as f64 * 12.9898).sin()
    }

    /// The short form of the stress holds for some deformations alone.
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
                let mut contributions = Contributions::<f64, D, BLOCK>::zero();
                contributions.volume = array::from_fn(|k| 1.0 + 0.5 * noise(k));
                law.stress(&c, &F, &[], &mut contributions);
                for k in 0..BLOCK {
                    let expected =
                        -law.kirchhoff(&F[k]) * (contributions.volume[k] * c.inverse_spacing);
                    assert_eq!(contributions.stress_flux[k], expected, "{large:?} {k}");
                }
            }
        }
        check::<1>();
        check::<2>();
        check::<3>();
    }
}
