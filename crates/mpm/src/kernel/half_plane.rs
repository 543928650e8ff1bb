//! Blocks of particles in the half plane of a body of revolution: the stress around the axis acts on the radial momentum.
//!
//! ```text
//! f_i = -sum V0_p (tau_p G_ip + tau_hoop,p S_ip e_r/r_p);   hoop stretch r_p/R_p
//! ```
//!
//! Volumes and masses are those of a radian, `R_p` times the area. The radius of a particle is that of its position, so that the force is what
//! the power of the hoop stress asks for. Source: Nairn & Guilkey, IJNME 101 (2015) 127-147, with the weights at the particle in the place of
//! their averages over its domain.

use mmsmith_lanes::simd::{Lanes, Loop, Vectors, dispatch};
use mmsmith_lanes::tensor::product;
use mmsmith_laws::fault::{Fault, Planted};
use mmsmith_laws::{
    AnyLaw, BlockOfStresses, Hoop, Law, LibraryLaw, Material, NeoHookean, with_hoop_stretch,
};
use nalgebra::{Matrix3, SMatrix, SVector};

use crate::grid::geometry::Constants;
use crate::kernel::any::Contributions;
use crate::kernel::block::{BlockIncrement, BlockLaw};
use crate::kernel::copies::BLOCK;

/// The law of space for blocks of particles in a half plane.
pub(crate) fn of_law<T: Lanes, const D: usize>(
    law: &Law<T, 3>,
    planted: Planted,
) -> Box<dyn BlockLaw<T, D>> {
    match law {
        Law::Library(Material::NeoHookean { lambda, mu }) => {
            Box::new(HalfPlane(NeoHookean { lambda: *lambda, mu: *mu, planted }))
        }
        Law::Library(material) => Box::new(HalfPlane(AnyLaw(planted.law_in_stresses(*material)))),
        Law::Own(_) | Law::WithMemory(_) => Box::new(OwnHalfPlane(law.clone())),
    }
}

/// A law of the library.
struct HalfPlane<L>(L);

/// A law that the caller brings.
struct OwnHalfPlane<T>(Law<T, 3>);

/// Sets the hoop stretches of a block at new positions.
fn follow<T: Lanes, const D: usize>(x: &[SVector<T, D>], internal: &mut [T]) {
    for (x, q) in x.iter().zip(internal.chunks_exact_mut(Hoop::<T>::COUNT)) {
        q[0] = x[0] / Hoop::of(q).reference_radius;
    }
}

/// Sets the stress flux of a particle of a block; returns the force of the stress around the axis.
#[inline(always)]
fn set_flux<T: Lanes, const D: usize>(
    c: &Constants<T, D>,
    (n, F): (usize, &SMatrix<T, D, D>),
    (tau, around, hoop): (&SMatrix<T, D, D>, T, Hoop<T>),
    contributions: &mut Contributions<T, D, BLOCK>,
) -> T {
    let volume = contributions.volume[n];
    let in_plane = c.planted.stress_in_forces(*tau, F);
    contributions.stress_flux[n] = in_plane * -(volume * c.inverse_spacing);
    if c.planted.is(Fault::HoopStressDropped) {
        return T::zero();
    }
    -volume * around / hoop.radius()
}

/// Adds radial forces on the first particles.
fn add_radial<T: Lanes, const D: usize>(
    forces: &[T],
    contributions: &mut Contributions<T, D, BLOCK>,
) {
    for (force, value) in forces.iter().zip(&mut contributions.value) {
        value.values[D] += *force;
    }
}

impl<T: Lanes, L: LibraryLaw<T>, const D: usize> BlockLaw<T, D> for HalfPlane<L> {
    fn stress(
        &self,
        c: &Constants<T, D>,
        F: &[SMatrix<T, D, D>; BLOCK],
        internal: &[T],
        contributions: &mut Contributions<T, D, BLOCK>,
    ) {
        dispatch(Stress { F, c, law: self.0, internal, contributions });
    }

    fn variables(&self) -> usize {
        Hoop::<T>::COUNT
    }

    fn initial(&self, X: &SVector<T, D>) -> Vec<T> {
        vec![T::one(), X[0]]
    }

    fn needs_start(&self) -> bool {
        false
    }

    fn evolve(&self, increment: BlockIncrement<'_, T, D>, internal: &mut [T]) {
        follow(increment.x, internal);
    }
}

struct Stress<'a, T, L, const D: usize> {
    F: &'a [SMatrix<T, D, D>; BLOCK],
    c: &'a Constants<T, D>,
    law: L,
    internal: &'a [T],
    contributions: &'a mut Contributions<T, D, BLOCK>,
}

impl<T: Lanes, L: LibraryLaw<T>, const D: usize> Loop for Stress<'_, T, L, D> {
    #[inline(always)]
    fn run<V: Vectors>(mut self, _: V) {
        let mut radial = [T::zero(); BLOCK];
        let internal = self.internal;
        if !L::HAS_SHORT || !self.stresses::<true>(&mut radial) {
            self.stresses::<false>(&mut radial);
        }
        add_radial(&radial[..internal.len() / Hoop::<T>::COUNT], self.contributions);
    }
}

impl<T: Lanes, L: LibraryLaw<T>, const D: usize> Stress<'_, T, L, D> {
    /// Sets the stress fluxes of all particles of a block, and their radial forces, by the short form of the law or the full one; returns
    /// whether the short form holds for all of them.
    #[inline(always)]
    fn stresses<const SHORT: bool>(&mut self, radial: &mut [T; BLOCK]) -> bool {
        let Self { F, c, law, internal, contributions } = self;
        let mut short = true;
        let of_particles = F.iter().zip(internal.chunks_exact(Hoop::<T>::COUNT)).enumerate();
        for (n, (F, q)) in of_particles {
            let hoop = Hoop::of(q);
            let (tau, around, is_short) = law.kirchhoff_with_hoop::<SHORT, D>(F, hoop.stretch);
            short &= is_short;
            radial[n] = set_flux(c, (n, F), (&tau, around, hoop), contributions);
        }
        short
    }
}

impl<T: Lanes, const D: usize> BlockLaw<T, D> for OwnHalfPlane<T> {
    fn stress(
        &self,
        c: &Constants<T, D>,
        F: &[SMatrix<T, D, D>; BLOCK],
        internal: &[T],
        contributions: &mut Contributions<T, D, BLOCK>,
    ) {
        let Law::Own(law) = &self.0 else { return };
        let mut block = BlockOfStresses::at_rest();
        let hoop = |n: usize| Hoop::of(internal.get(n * Hoop::<T>::COUNT..).unwrap_or_default());
        let in_space: [Matrix3<T>; BLOCK] =
            std::array::from_fn(|n| with_hoop_stretch(&F[n], hoop(n).stretch));
        in_space.iter().enumerate().for_each(|(n, F)| block.set(n, F));
        block.evaluate(law.as_ref());
        let radial: [T; BLOCK] = std::array::from_fn(|n| {
            let tau = product(&block.stress(n), &in_space[n].transpose());
            let in_plane = SMatrix::from_fn(|i, j| tau[(i, j)]);
            set_flux(c, (n, &F[n]), (&in_plane, tau[(2, 2)], hoop(n)), contributions)
        });
        add_radial(&radial[..internal.len() / Hoop::<T>::COUNT], contributions);
    }

    fn variables(&self) -> usize {
        Hoop::<T>::COUNT
    }

    fn initial(&self, X: &SVector<T, D>) -> Vec<T> {
        vec![T::one(), X[0]]
    }

    fn needs_start(&self) -> bool {
        false
    }

    fn evolve(&self, increment: BlockIncrement<'_, T, D>, internal: &mut [T]) {
        follow(increment.x, internal);
    }
}
