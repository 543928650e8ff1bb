//! Blocks of particles in the half plane of a body of revolution: the stress around the axis acts on the radial momentum.
//!
//! ```text
//! f_i = -sum V0_p (tau_p G_ip + tau_hoop,p S_ip e_r/r_p);   hoop stretch r_p/R_p
//! ```
//!
//! Volumes and masses are those of a radian, `R_p` times the area. The radius of a particle is that of its position, so that the force is what
//! the power of the hoop stress asks for. Source: Nairn & Guilkey, IJNME 101 (2015) 127-147, with the weights at the particle in the place of
//! their averages over its domain.

use std::sync::Arc;

use mmsmith_lanes::simd::{Lanes, Loop, Vectors, dispatch};
use mmsmith_lanes::tensor::product;
use mmsmith_laws::fault::{Fault, Planted};
use mmsmith_laws::{
    AnyLaw, BlockOfStresses, BlockWithMemory, ConstitutiveLaw, Hoop, InternalVariable, LawInSpace,
    LawWithMemory, LibraryLaw, Material, NeoHookean, of_half_plane, with_hoop_stretch,
};
use nalgebra::{Matrix2, Matrix3, Vector2};

use crate::grid::geometry::Constants;
use crate::kernel::any::Contributions;
use crate::kernel::block::{BlockIncrement, BlockLaw, in_same_dimension};
use crate::kernel::copies::BLOCK;

/// The law of space for blocks of particles in a half plane; none elsewhere than in two dimensions.
pub(crate) fn of_law<T: Lanes, const D: usize>(
    law: &LawInSpace<T>,
    planted: Planted,
) -> Option<Box<dyn BlockLaw<T, D>>> {
    let in_half_plane: Box<dyn BlockLaw<T, 2>> = match law {
        LawInSpace::Library(Material::NeoHookean { lambda, mu }) => {
            Box::new(HalfPlane(OfLibrary(NeoHookean { lambda: *lambda, mu: *mu, planted })))
        }
        LawInSpace::Library(material) => {
            Box::new(HalfPlane(OfLibrary(AnyLaw(planted.law_in_stresses(*material)))))
        }
        LawInSpace::Own(law) => Box::new(HalfPlane(OfCaller(law.clone()))),
        LawInSpace::WithMemory(law) => Box::new(WithMemory::new(law.clone())),
    };
    in_same_dimension::<_, Box<dyn BlockLaw<T, D>>>(in_half_plane)
}

/// Particles of a half plane, with the stresses of a law of space.
struct HalfPlane<S>(S);

/// A law of space as particles of a half plane ask for it.
trait StressesOfSpace<T>: Send + Sync {
    /// Sets the stress fluxes of particles with these deformation gradients and internal variables, and the radial forces on them.
    fn set(
        &self,
        c: &Constants<T, 2>,
        F: &[Matrix2<T>; BLOCK],
        internal: &[T],
        contributions: &mut Contributions<T, 2, BLOCK>,
        radial: &mut [T; BLOCK],
    );
}

/// A law of the library.
struct OfLibrary<L>(L);

/// A law that the caller brings.
struct OfCaller<T>(Arc<dyn ConstitutiveLaw<T, 3>>);

/// The internal variables of a block; at rest at radius one beyond its last particle. Loops over all of a block are vectorised.
#[inline(always)]
fn hoops<T: Lanes>(internal: &[T]) -> [Hoop<T>; BLOCK] {
    let mut hoops = [Hoop::of(&[]); BLOCK];
    for (hoop, q) in hoops.iter_mut().zip(internal.chunks_exact(Hoop::<T>::COUNT)) {
        *hoop = Hoop::of(q);
    }
    hoops
}

/// Sets the stress flux of a particle of a block; returns the force of the stress around the axis.
#[inline(always)]
fn set_flux<T: Lanes>(
    c: &Constants<T, 2>,
    (n, F): (usize, &Matrix2<T>),
    (tau, around, hoop): (&Matrix2<T>, T, Hoop<T>),
    contributions: &mut Contributions<T, 2, BLOCK>,
) -> T {
    let volume = contributions.volume[n];
    let in_plane = c.planted.stress_in_forces(*tau, F);
    contributions.stress_flux[n] = in_plane * -(volume * c.inverse_spacing);
    if c.planted.is(Fault::HoopStressDropped) {
        return T::zero();
    }
    -volume * around / hoop.radius()
}

impl<T: Lanes, S: StressesOfSpace<T>> BlockLaw<T, 2> for HalfPlane<S> {
    fn stress(
        &self,
        c: &Constants<T, 2>,
        F: &[Matrix2<T>; BLOCK],
        internal: &[T],
        contributions: &mut Contributions<T, 2, BLOCK>,
    ) {
        let mut radial = [T::zero(); BLOCK];
        self.0.set(c, F, internal, contributions, &mut radial);
        for (force, value) in radial.iter().zip(&mut contributions.value) {
            value.second_mut()[0] += *force;
        }
    }

    fn variables(&self) -> usize {
        Hoop::<T>::COUNT
    }

    fn initial(&self, X: &Vector2<T>) -> Vec<T> {
        Hoop::at_rest(X).to_vec()
    }

    fn follows_deformation(&self) -> bool {
        false
    }

    fn follows_position(&self) -> bool {
        true
    }

    fn evolve(&self, increment: BlockIncrement<'_, T, 2>, internal: &mut [T]) {
        for (x, q) in increment.x.iter().zip(internal.chunks_exact_mut(Hoop::<T>::COUNT)) {
            Hoop::follow(x, q);
        }
    }
}

impl<T: Lanes, L: LibraryLaw<T>> StressesOfSpace<T> for OfLibrary<L> {
    fn set(
        &self,
        c: &Constants<T, 2>,
        F: &[Matrix2<T>; BLOCK],
        internal: &[T],
        contributions: &mut Contributions<T, 2, BLOCK>,
        radial: &mut [T; BLOCK],
    ) {
        dispatch(Stress { F, c, law: self.0, internal, contributions, radial });
    }
}

struct Stress<'a, T, L> {
    F: &'a [Matrix2<T>; BLOCK],
    c: &'a Constants<T, 2>,
    law: L,
    internal: &'a [T],
    contributions: &'a mut Contributions<T, 2, BLOCK>,
    radial: &'a mut [T; BLOCK],
}

impl<T: Lanes, L: LibraryLaw<T>> Loop for Stress<'_, T, L> {
    #[inline(always)]
    fn run<V: Vectors>(mut self, _: V) {
        let hoops = hoops(self.internal);
        if !L::HAS_SHORT || !self.stresses::<true>(&hoops) {
            self.stresses::<false>(&hoops);
        }
    }
}

impl<T: Lanes, L: LibraryLaw<T>> Stress<'_, T, L> {
    /// Sets the stress fluxes of all particles of a block, and their radial forces, by the short form of the law or the full one; returns
    /// whether the short form holds for all of them.
    #[inline(always)]
    fn stresses<const SHORT: bool>(&mut self, hoops: &[Hoop<T>; BLOCK]) -> bool {
        let Self { F, c, law, contributions, radial, .. } = self;
        let mut short = true;
        for n in 0..BLOCK {
            let (F, hoop) = (&F[n], hoops[n]);
            let (tau, around, is_short) = law.kirchhoff_with_hoop::<SHORT, 2>(F, hoop.stretch);
            short &= is_short;
            radial[n] = set_flux(c, (n, F), (&tau, around, hoop), contributions);
        }
        short
    }
}

impl<T: Lanes> StressesOfSpace<T> for OfCaller<T> {
    fn set(
        &self,
        c: &Constants<T, 2>,
        F: &[Matrix2<T>; BLOCK],
        internal: &[T],
        contributions: &mut Contributions<T, 2, BLOCK>,
        radial: &mut [T; BLOCK],
    ) {
        let mut block = BlockOfStresses::at_rest();
        let hoops = hoops(internal);
        let in_space: [Matrix3<T>; BLOCK] =
            std::array::from_fn(|n| with_hoop_stretch(&F[n], hoops[n].stretch));
        in_space.iter().enumerate().for_each(|(n, F)| block.set(n, F));
        block.evaluate(self.0.as_ref());
        for (n, radial) in radial.iter_mut().enumerate() {
            let tau = product(&block.stress(n), &in_space[n].transpose());
            let in_plane = Matrix2::from_fn(|i, j| tau[(i, j)]);
            *radial = set_flux(c, (n, &F[n]), (&in_plane, tau[(2, 2)], hoops[n]), contributions);
        }
    }
}

/// Particles of a half plane whose law of space has internal variables of its own, after those of the [`Hoop`].
struct WithMemory<T> {
    law: Arc<dyn LawWithMemory<T, 3>>,
    variables: Vec<InternalVariable>,
}

impl<T: Lanes> WithMemory<T> {
    fn new(law: Arc<dyn LawWithMemory<T, 3>>) -> Self {
        let variables = law.variables();
        Self { law, variables }
    }

    /// How many variables a particle has.
    fn count(&self) -> usize {
        Hoop::<T>::COUNT + self.variables.len()
    }

    /// The variables of the law of space alone, those of a particle one after the other.
    fn own(&self, internal: &[T]) -> Vec<T> {
        internal.chunks_exact(self.count()).flat_map(|q| &q[Hoop::<T>::COUNT..]).copied().collect()
    }
}

impl<T: Lanes> BlockLaw<T, 2> for WithMemory<T> {
    fn stress(
        &self,
        c: &Constants<T, 2>,
        F: &[Matrix2<T>; BLOCK],
        internal: &[T],
        contributions: &mut Contributions<T, 2, BLOCK>,
    ) {
        let hoops: Vec<Hoop<T>> = internal.chunks_exact(self.count()).map(Hoop::of).collect();
        let in_space: Vec<Matrix3<T>> =
            F.iter().zip(&hoops).map(|(F, hoop)| of_half_plane(F, hoop.stretch)).collect();
        let mut block = BlockWithMemory::at_rest(&self.variables);
        block.kirchhoff(self.law.as_ref(), &in_space, &self.own(internal));
        for (n, hoop) in hoops.into_iter().enumerate() {
            let tau = block.stress(n);
            let in_plane = Matrix2::from_fn(|i, j| tau[((2 * i) % 3, (2 * j) % 3)]);
            let radial = set_flux(c, (n, &F[n]), (&in_plane, tau[(1, 1)], hoop), contributions);
            contributions.value[n].second_mut()[0] += radial;
        }
    }

    fn variables(&self) -> usize {
        self.count()
    }

    fn initial(&self, X: &Vector2<T>) -> Vec<T> {
        Hoop::at_rest_with(self.law.as_ref(), X)
    }

    fn follows_position(&self) -> bool {
        true
    }

    fn evolve(&self, increment: BlockIncrement<'_, T, 2>, internal: &mut [T]) {
        let BlockIncrement { time, start, end, x } = increment;
        let mut own = self.own(internal);
        let (mut from, mut to) = (Vec::with_capacity(BLOCK), Vec::with_capacity(BLOCK));
        for (n, q) in internal.chunks_exact_mut(self.count()).enumerate() {
            from.push(of_half_plane(&start[n], Hoop::of(q).stretch));
            Hoop::follow(&x[n], q);
            to.push(of_half_plane(&end[n], Hoop::of(q).stretch));
        }
        let mut block = BlockWithMemory::at_rest(&self.variables);
        block.evolve(self.law.as_ref(), &from, &to, time, &mut own);
        let own = own.chunks_exact(self.variables.len().max(1));
        for (q, own) in internal.chunks_exact_mut(self.count()).zip(own) {
            q[Hoop::<T>::COUNT..].copy_from_slice(own);
        }
    }
}
