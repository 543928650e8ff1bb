//! Sums over particles as they go with time: errors of `u`, energies and momentum, of a run and of the exact motion.
//!
//! The body force of a manufactured solution does work, so that the energy of the exact motion is not constant. What a scheme
//! gains or loses is the difference between the two.

use std::f64::consts::TAU;

use bytemuck::Pod;
use mmsmith_laws::{LawInSpace, with_hoop_stretch};
use mmsmith_measure::norms::PerNorm;
use mmsmith_measure::{Homes, each_group, joined, joined_over};
use mmsmith_mpm::{Law, Particles};
use mmsmith_runtime::{Real, Solution};
use nalgebra::{SMatrix, SVector};
use serde::Serialize;

use crate::precision::Precision;

/// Particles in a group that one thread works on; fixed, so that sums do not depend on the number of threads.
const GROUP: usize = 512;
/// The most moments that a history has.
pub const MOST_MOMENTS: u64 = 1000;

/// One step of a run's history.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Moment {
    /// The step; 0 is the start.
    pub step: u64,
    /// The time of positions and deformation gradients.
    pub time: f64,
    /// The time of velocities, which centred differences store half a step earlier.
    pub velocity_time: f64,
    /// The error of `u` at this step, a length.
    pub u: PerNorm<f64>,
    /// The solver's sums.
    pub computed: Sums,
    /// Sums of the exact solution, at the same particles and times.
    pub exact: Sums,
}

/// Sums over all particles, per unit of what the dimension leaves out: of length in a plane, of area on a line. Of a body of revolution they
/// are those of all of it, whichever formulation runs it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sums {
    /// `sum m_p |v_p|^2 / 2`.
    pub kinetic_energy: f64,
    /// `sum V0_p W(F_p)`; not a number where a particle is inside out, and of laws that have no strain energy, as those with memory.
    pub strain_energy: f64,
    /// `sum m_p v_p`, by axis; of a body of revolution the sums of the components along the radius, around the axis and along it, of which
    /// the last alone is a momentum of the body.
    pub momentum: Vec<f64>,
}

impl Sums {
    /// Kinetic and strain energy.
    pub fn energy(&self) -> f64 {
        self.kinetic_energy + self.strain_energy
    }
}

/// The energy that a run has gained against the exact motion at each moment, in units of the largest energy that the exact
/// motion has at any of them: time and gain. Where nothing moves the gain is zero.
pub fn energy_drift(history: &[Moment]) -> Vec<(f64, f64)> {
    let largest = history.iter().fold(0.0_f64, |most, moment| most.max(moment.exact.energy()));
    let drift = |moment: &Moment| match moment.computed.energy() - moment.exact.energy() {
        0.0 => 0.0,
        gain => gain / largest,
    };
    history.iter().map(|moment| (moment.time, drift(moment))).collect()
}

/// Sums over all particles at one instant, of the computed state and of the exact one.
pub(crate) struct Totals<const D: usize> {
    pub(crate) error: f64,
    /// The particle of largest error.
    pub(crate) worst: usize,
    pub(crate) computed: Motion<D>,
    pub(crate) exact: Motion<D>,
    /// The sum of the magnitudes of the exact momenta.
    pub(crate) exact_momenta: f64,
}

/// Energies and momentum of a motion.
#[derive(Clone, Copy)]
pub(crate) struct Motion<const D: usize> {
    kinetic: f64,
    strain: f64,
    pub(crate) momentum: [f64; D],
}

impl<const D: usize> Motion<D> {
    const NONE: Self = Self { kinetic: 0.0, strain: 0.0, momentum: [0.0; D] };

    pub(crate) fn energy(&self) -> f64 {
        self.kinetic + self.strain
    }

    fn add(&mut self, other: &Self) {
        self.kinetic += other.kinetic;
        self.strain += other.strain;
        for axis in 0..D {
            self.momentum[axis] += other.momentum[axis];
        }
    }
}

impl<const D: usize> From<Motion<D>> for Sums {
    fn from(motion: Motion<D>) -> Self {
        let Motion { kinetic, strain, momentum } = motion;
        let momentum = momentum.to_vec();
        Self { kinetic_energy: kinetic, strain_energy: strain, momentum }
    }
}

/// The strain energy per reference volume, of a body of revolution too.
struct StrainEnergy<'a, const D: usize> {
    law: &'a Law<f64, D>,
    /// The law of space, where the law is that of a half plane.
    in_space: Option<Law<f64, 3>>,
}

impl<'a, const D: usize> StrainEnergy<'a, D>
where
    f64: Precision<D>,
{
    fn new(law: &'a Law<f64, D>) -> Self {
        let in_space = match law {
            Law::WithMemory(own) => own.of_half_plane().map(|in_space| match in_space {
                LawInSpace::Library(material) => Law::Library(*material),
                LawInSpace::Own(own) => Law::Own(own.clone()),
                LawInSpace::WithMemory(own) => Law::WithMemory(own.clone()),
            }),
            Law::Library(_) | Law::Own(_) => None,
        };
        Self { law, in_space }
    }

    /// Strain energy density of a particle that was at `X` and is at `x`; not a number where it is inside out, or the law has no energy.
    fn at(&self, F: &SMatrix<f64, D, D>, X: &SVector<f64, D>, x: &SVector<f64, D>) -> f64 {
        let energy = match &self.in_space {
            Some(law) => law.strain_energy(&with_hoop_stretch(F, x[0] / X[0])),
            None => self.law.strain_energy(F),
        };
        energy.unwrap_or(f64::NAN)
    }
}

impl<const D: usize> Totals<D> {
    /// Totals of no particles yet, the first of which is to be `worst`.
    fn of_none(worst: usize) -> Self {
        let (computed, exact) = (Motion::NONE, Motion::NONE);
        Self { error: 0.0, worst, computed, exact, exact_momenta: 0.0 }
    }

    /// Totals of all particles at `time`, with velocities of `velocity_time`.
    pub(crate) fn of<T: Real>(
        particles: &Particles<T, D>,
        law: &Law<f64, D>,
        exact: &dyn Solution<f64, D>,
        time: f64,
        velocity_time: f64,
    ) -> Self
    where
        f64: Precision<D>,
    {
        let groups = Self::of_groups(particles, law, exact, time, velocity_time);
        joined(groups).unwrap_or_else(|| Self::of_none(0))
    }

    /// As [`of`](Self::of) for one of several processes, over the particles of all; a call of all.
    fn of_all<T: Real + Pod>(
        homes: &Homes,
        particles: &Particles<T, D>,
        law: &Law<f64, D>,
        exact: &dyn Solution<f64, D>,
        time: f64,
        velocity_time: f64,
    ) -> Self
    where
        f64: Precision<D>,
    {
        let Particles { X, x, v, F, mass, volume, half_size, .. } = particles;
        let here = Particles {
            X: homes.bring(X),
            x: homes.bring(x),
            v: homes.bring(v),
            F: homes.bring(F),
            mass: homes.bring(mass),
            volume: homes.bring(volume),
            half_size: *half_size,
            ..Particles::default()
        };
        let groups = Self::of_groups(&here, law, exact, time, velocity_time);
        joined_over(homes, GROUP, groups).unwrap_or_else(|| Self::of_none(0))
    }

    /// The sums of each group of particles.
    fn of_groups<T: Real>(
        particles: &Particles<T, D>,
        law: &Law<f64, D>,
        exact: &dyn Solution<f64, D>,
        time: f64,
        velocity_time: f64,
    ) -> Vec<Self>
    where
        f64: Precision<D>,
    {
        let energy = StrainEnergy::new(law);
        // Particles of a half plane have the volume and the mass of a radian.
        let radians = if exact.is_half_plane() { TAU } else { 1.0 };
        let group = |g: usize| {
            let mut totals = Self::of_none(g * GROUP);
            for p in g * GROUP..particles.len().min((g + 1) * GROUP) {
                let X = particles.X[p].map(Real::to_f64);
                let [mass, volume] =
                    [particles.mass[p], particles.volume[p]].map(|own| own.to_f64() * radians);
                let x = particles.x[p].map(Real::to_f64);
                let exact_u = exact.displacement(&X, time);
                let error = (x - X - exact_u).norm();
                if error > totals.error || error.is_nan() {
                    (totals.error, totals.worst) = (error, p);
                }
                let v = particles.v[p].map(Real::to_f64);
                let exact_v = exact.velocity(&X, velocity_time);
                let F = particles.F[p].map(Real::to_f64);
                let exact_F = exact.deformation_gradient(&X, time);
                for (motion, x, v, F) in [
                    (&mut totals.computed, x, v, F),
                    (&mut totals.exact, X + exact_u, exact_v, exact_F),
                ] {
                    // A particle that is inside out has no energy; the solver stops at its next step.
                    let strain = volume * energy.at(&F, &X, &x);
                    let kinetic = 0.5 * mass * v.norm_squared();
                    let momentum = std::array::from_fn(|axis| mass * v[axis]);
                    motion.add(&Motion { kinetic, strain, momentum });
                }
                totals.exact_momenta += mass * exact_v.norm();
            }
            totals
        };
        each_group(particles.len().div_ceil(GROUP), &group)
    }
}

impl<const D: usize> mmsmith_measure::Sums for Totals<D> {
    const NUMBERS: usize = 5 + 2 * D;

    fn join(&self, next: &Self) -> Self {
        let is_worse = next.error > self.error || next.error.is_nan();
        let Self { error, worst, .. } = *if is_worse { next } else { self };
        let (mut computed, mut exact) = (self.computed, self.exact);
        computed.add(&next.computed);
        exact.add(&next.exact);
        let exact_momenta = self.exact_momenta + next.exact_momenta;
        Self { error, worst, computed, exact, exact_momenta }
    }

    /// The sums alone: no process asks another one for the largest error.
    fn write(&self, numbers: &mut Vec<f64>) {
        numbers.push(self.exact_momenta);
        for motion in [&self.computed, &self.exact] {
            numbers.extend([motion.kinetic, motion.strain]);
            numbers.extend(motion.momentum);
        }
    }

    fn read(numbers: &[f64]) -> Self {
        let motion = |first: usize| Motion {
            kinetic: numbers[first],
            strain: numbers[first + 1],
            momentum: std::array::from_fn(|a| numbers[first + 2 + a]),
        };
        let (computed, exact) = (motion(1), motion(3 + D));
        Self { computed, exact, exact_momenta: numbers[0], ..Self::of_none(0) }
    }
}

/// Takes down the history of one run.
pub(crate) struct Recorder<'a, const D: usize> {
    moments: &'a mut Vec<Moment>,
    exact: &'a dyn Solution<f64, D>,
    law: Law<f64, D>,
    count: u64,
    steps: u64,
}

impl<'a, const D: usize> Recorder<'a, D> {
    pub(crate) fn new(
        moments: &'a mut Vec<Moment>,
        exact: &'a dyn Solution<f64, D>,
        law: Law<f64, D>,
        steps: u64,
    ) -> Self {
        moments.clear();
        let count = MOST_MOMENTS.min(steps + 1);
        Self { moments, exact, law, count, steps }
    }

    /// Puts down what was taken down before the run was stopped.
    pub(crate) fn take_up(&mut self, moments: Vec<Moment>) {
        *self.moments = moments;
    }

    /// Moments taken down so far.
    pub(crate) fn moments(&self) -> &[Moment] {
        self.moments
    }

    /// Takes the state after `step` down if its turn has come, or if it is the `last` one. `times` are those of positions and
    /// of velocities.
    ///
    /// Where several processes hold the particles, `homes` says where their sums are formed; a call of all.
    pub(crate) fn take<T: Real + Pod>(
        &mut self,
        (particles, homes): (&Particles<T, D>, Option<&Homes>),
        (step, is_last): (u64, bool),
        (time, velocity_time): (f64, f64),
        u: PerNorm<f64>,
    ) where
        f64: Precision<D>,
    {
        let next = crate::frames::step_of_frame(self.moments.len() as u64, self.count, self.steps);
        if step < next && !is_last {
            return;
        }
        let (law, exact) = (&self.law, self.exact);
        let totals = match homes {
            None => Totals::of(particles, law, exact, time, velocity_time),
            Some(homes) => Totals::of_all(homes, particles, law, exact, time, velocity_time),
        };
        let is_half_plane = exact.is_half_plane();
        let [computed, exact] = [totals.computed, totals.exact].map(|motion| {
            let mut sums = Sums::from(motion);
            if is_half_plane {
                // Nothing turns about the axis there.
                sums.momentum.insert(1, 0.0);
            }
            sums
        });
        self.moments.push(Moment { step, time, velocity_time, u, computed, exact });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moment(time: f64, computed: f64, exact: f64) -> Moment {
        let sums =
            |kinetic_energy: f64| Sums { kinetic_energy, strain_energy: 0.0, momentum: vec![0.0] };
        let (computed, exact) = (sums(computed), sums(exact));
        Moment { step: 0, time, velocity_time: time, u: PerNorm::default(), computed, exact }
    }

    #[test]
    fn drift_is_in_units_of_the_largest_exact_energy() {
        let history = [moment(0.0, 2.0, 2.0), moment(1.0, 5.0, 4.0), moment(2.0, 0.0, 1.0)];
        assert_eq!(energy_drift(&history), [(0.0, 0.0), (1.0, 0.25), (2.0, -0.25)]);
        assert_eq!(energy_drift(&[moment(0.0, 0.0, 0.0)]), [(0.0, 0.0)]);
        assert!(energy_drift(&[moment(0.0, f64::NAN, 1.0)])[0].1.is_nan());
    }
}
