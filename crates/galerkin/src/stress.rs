//! From displacements to forces, at rows of particles.

use std::sync::Arc;

use mmsmith_lanes::tensor::determinant;
use mmsmith_laws::fault::{Fault, Planted};
use mmsmith_laws::{
    BLOCK, BlockOfStresses, BlockWithMemory, ConstitutiveLaw, InternalVariable, LawWithMemory,
    LibraryLaw, projected_stress,
};
use mmsmith_particles::{BodyForce, Particles};
use nalgebra::{SMatrix, SVector};

use super::coordinates::{Coordinates, RowGeometry};

/// Some rows of particles, with what stands there.
pub(super) struct Places<'a, const D: usize> {
    /// Index of the first particle.
    pub(super) first: usize,
    pub(super) values: [&'a mut [f64]; D],
    pub(super) slopes: [[&'a mut [f64]; D]; D],
    pub(super) b: &'a mut [SVector<f64, D>],
    /// With memory, the deformation gradients that the internal variables belong to, and these.
    pub(super) F: &'a mut [SMatrix<f64, D, D>],
    pub(super) internal: &'a mut [f64],
}

/// From displacements to forces, at the particles.
pub(super) struct Stress<'a, L, const D: usize> {
    pub(super) law: L,
    /// The body force, and its time.
    pub(super) force: Option<(&'a dyn BodyForce<f64, D>, f64)>,
    /// Particles in a row along axis 0.
    pub(super) row: usize,
    pub(super) particles: &'a Particles<f64, D>,
    pub(super) density: f64,
    pub(super) coordinates: Coordinates,
    pub(super) rows: &'a [RowGeometry<D>],
    pub(super) reciprocal_radius: &'a [f64],
    pub(super) planted: Planted,
}

impl<L: LawOfRows<D>, const D: usize> Stress<'_, L, D> {
    /// See [`TotalLagrangian::stress`].
    pub(super) fn at(&self, places: Places<'_, D>) -> bool {
        let Places { first, mut values, mut slopes, b, F, internal } = places;
        let Self { row, planted, coordinates, reciprocal_radius, .. } = *self;
        if let Some((body_force, time)) = self.force {
            body_force.evaluate(first, &self.particles.X[first..first + b.len()], time, b);
        }
        let volumes = &self.particles.volume[first..first + b.len()];
        let mut bad = false;
        for (index, volume) in volumes.chunks_exact(row).enumerate() {
            let start = index * row;
            let at = self.rows.get(first / row + index);
            let (values, slopes) = (&mut values, &mut slopes);
            let mut places = RowOfPlaces {
                first,
                start,
                volume,
                values,
                slopes,
                F: &mut *F,
                internal: &mut *internal,
                at,
                coordinates,
                reciprocal_radius,
                planted,
                is_bad: false,
            };
            self.law.stresses(&mut places);
            bad |= places.is_bad;
            if self.force.is_some() {
                for (i, b) in b[start..start + row].iter().enumerate() {
                    let mut b = b * (volume[i] * self.density);
                    if let Some(at) = at {
                        b = at.frame.tr_mul(&b);
                    }
                    for c in 0..D {
                        let value = &mut values[c][start + i];
                        *value = if at.is_some() { *value + b[c] } else { b[c] };
                    }
                }
            }
        }
        bad
    }
}

/// A row of particles along axis 0: displacements and their slopes, and then the factors of values and slopes in the forces.
pub(super) struct RowOfPlaces<'a, 'b, const D: usize> {
    /// Index of the first particle of all places, and of the row among them.
    first: usize,
    start: usize,
    volume: &'a [f64],
    values: &'a mut [&'b mut [f64]; D],
    slopes: &'a mut [[&'b mut [f64]; D]; D],
    F: &'a mut [SMatrix<f64, D, D>],
    internal: &'a mut [f64],
    at: Option<&'a RowGeometry<D>>,
    coordinates: Coordinates,
    reciprocal_radius: &'a [f64],
    planted: Planted,
    /// Whether any F is no deformation gradient.
    is_bad: bool,
}

impl<const D: usize> RowOfPlaces<'_, '_, D> {
    /// The deformation gradient of particle `i` of the row.
    #[inline(always)]
    fn deformation_gradient(&mut self, i: usize) -> SMatrix<f64, D, D> {
        let place = self.start + i;
        let mut H = SMatrix::<f64, D, D>::from_fn(|c, k| self.slopes[c][k][place]);
        if let Some(at) = self.at {
            let u = SVector::from_fn(|c, _| self.values[c][place]);
            H = self.coordinates.gradient(&u, &H, self.reciprocal_radius[i], at);
        }
        let F = SMatrix::identity() + H;
        self.is_bad |= !is_deformation(&F);
        F
    }

    /// Puts the factors of the forces in place of what they follow from.
    #[inline(always)]
    fn set_stress(&mut self, i: usize, F: &SMatrix<f64, D, D>, P: SMatrix<f64, D, D>) {
        let Self { planted, coordinates, reciprocal_radius, .. } = *self;
        let place = self.start + i;
        let mut force = planted.piola_in_forces(P, F) * -self.volume[i];
        if let Some(at) = self.at {
            let of_values;
            (of_values, force) = coordinates.transposed_gradient(&force, reciprocal_radius[i], at);
            for c in 0..D {
                self.values[c][place] = of_values[c];
            }
            if planted.is(Fault::HoopStressDropped) {
                self.values[0][place] = 0.0;
            }
            if planted.is(Fault::HoopShearDropped) {
                self.values[1][place] = 0.0;
            }
            if planted.is(Fault::CotangentDropped) && D == 3 {
                self.values[1][place] -= force[(2, 2)] * at.cotangent * reciprocal_radius[i];
            }
        }
        for c in 0..D {
            for k in 0..D {
                self.slopes[c][k][place] = force[(c, k)];
            }
        }
    }
}

/// A law for rows of particles.
pub(super) trait LawOfRows<const D: usize>: Sync {
    /// Replaces the displacements of a row by its stresses.
    fn stresses(&self, row: &mut RowOfPlaces<'_, '_, D>);
}

impl<L: LibraryLaw<f64>, const D: usize> LawOfRows<D> for L {
    #[inline(always)]
    fn stresses(&self, row: &mut RowOfPlaces<'_, '_, D>) {
        for i in 0..row.volume.len() {
            let F = row.deformation_gradient(i);
            row.set_stress(i, &F, self.first_piola_kirchhoff(&F));
        }
    }
}

/// A law that the caller brings.
pub(super) struct OwnRows<const D: usize>(pub(super) Arc<dyn ConstitutiveLaw<f64, D>>);

impl<const D: usize> LawOfRows<D> for OwnRows<D> {
    fn stresses(&self, row: &mut RowOfPlaces<'_, '_, D>) {
        let mut block = BlockOfStresses::at_rest();
        let count = row.volume.len();
        for first in (0..count).step_by(BLOCK) {
            let here = BLOCK.min(count - first);
            let mut F = [SMatrix::identity(); BLOCK];
            for (n, F) in F[..here].iter_mut().enumerate() {
                *F = row.deformation_gradient(first + n);
                block.set(n, F);
            }
            block.evaluate(self.0.as_ref());
            for (n, F) in F[..here].iter().enumerate() {
                row.set_stress(first + n, F, block.stress(n));
            }
        }
    }
}

/// A law with memory, and the time of the increment that ends here; none where the state is only looked at.
pub(super) struct MemoryRows<'a, const D: usize> {
    pub(super) law: &'a dyn LawWithMemory<f64, D>,
    pub(super) variables: &'a [InternalVariable],
    pub(super) time: Option<f64>,
}

impl<const D: usize> LawOfRows<D> for MemoryRows<'_, D> {
    fn stresses(&self, row: &mut RowOfPlaces<'_, '_, D>) {
        let &Self { law, variables, time } = self;
        let mut block = BlockWithMemory::at_rest(variables);
        let count = row.volume.len();
        // Internal variables are Cartesian, as they are in files.
        let frame = row.at.map(|at| at.frame);
        for first in (0..count).step_by(BLOCK) {
            let here = BLOCK.min(count - first);
            let mut own = [SMatrix::identity(); BLOCK];
            let mut F = own;
            for n in 0..here {
                own[n] = row.deformation_gradient(first + n);
                F[n] = frame.map_or(own[n], |Q| Q * own[n] * Q.transpose());
            }
            let place = row.start + first;
            let last = &mut row.F[place..place + here];
            let internal = &mut row.internal[place * variables.len()..][..here * variables.len()];
            if let Some(time) = time {
                block.evolve(law, last, &F[..here], time, internal);
            }
            last.copy_from_slice(&F[..here]);
            block.first_piola_kirchhoff(law, &F[..here], internal);
            for (n, F) in own[..here].iter().enumerate() {
                let P = block.stress(n);
                let P = frame.map_or(P, |Q| Q.transpose() * P * Q);
                row.set_stress(first + n, F, P);
            }
        }
    }
}

/// A law with a projected change of volume, evaluated before, see [`projected_stress`].
pub(super) struct ProjectedRows<'a, const D: usize> {
    /// The stress of each particle, as [`LawWithMemory::evaluate_projected`] gives it.
    pub(super) scaled: &'a [SMatrix<f64, D, D>],
    /// The projected mean stress of each particle.
    pub(super) p: &'a [f64],
}

impl<const D: usize> LawOfRows<D> for ProjectedRows<'_, D> {
    fn stresses(&self, row: &mut RowOfPlaces<'_, '_, D>) {
        let frame = row.at.map(|at| at.frame);
        for i in 0..row.volume.len() {
            let F = row.deformation_gradient(i);
            let place = row.first + row.start + i;
            let (scaled, p) = (&self.scaled[place], self.p[place]);
            let P = match frame {
                None => projected_stress(&F, scaled, p),
                Some(Q) => projected_stress(&F, &(Q.transpose() * scaled * Q), p),
            };
            row.set_stress(i, &F, P);
        }
    }
}

/// Whether F is a deformation gradient; false where it is not a number, too.
#[inline(always)]
pub(super) fn is_deformation<const D: usize>(F: &SMatrix<f64, D, D>) -> bool {
    let J = determinant(F);
    J > 0.0 && J < f64::INFINITY
}
