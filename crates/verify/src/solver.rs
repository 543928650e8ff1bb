//! What measuring and writing need of a solver, whatever its frame.

use bytemuck::Pod;
use mmsmith_mpm::general::General;
use mmsmith_mpm::{BodyForce, Material, Particles, Simulation, StepError};
use mmsmith_solutions::Real;

/// A solver that can be stepped and looked at.
pub(crate) trait Solver<T: Real, const D: usize> {
    /// Advances by one time step.
    fn step(&mut self, body_force: &dyn BodyForce<T, D>) -> Result<(), StepError>;
    /// The particles as they are now, and their law.
    fn observe(&mut self) -> (&Particles<T, D>, &Material<T>);
    /// How far velocities lag behind positions.
    fn velocity_lag(&self) -> f64;
    /// The numbers that the next step needs, of lengths that follow from the set-up.
    fn state(&mut self) -> Vec<&mut [u8]>;
}

impl<T: Real + Pod, const D: usize> Solver<T, D> for Simulation<T, D> {
    fn step(&mut self, body_force: &dyn BodyForce<T, D>) -> Result<(), StepError> {
        Simulation::step(self, body_force)
    }

    fn observe(&mut self) -> (&Particles<T, D>, &Material<T>) {
        (self.particles(), self.material())
    }

    fn velocity_lag(&self) -> f64 {
        Simulation::velocity_lag(self).to_f64()
    }

    fn state(&mut self) -> Vec<&mut [u8]> {
        Simulation::state(self)
    }
}

impl<const D: usize> Solver<f64, D> for General<D> {
    fn step(&mut self, body_force: &dyn BodyForce<f64, D>) -> Result<(), StepError> {
        General::step(self, body_force)
    }

    fn observe(&mut self) -> (&Particles<f64, D>, &Material<f64>) {
        (self.particles(), self.material())
    }

    fn velocity_lag(&self) -> f64 {
        General::velocity_lag(self)
    }

    fn state(&mut self) -> Vec<&mut [u8]> {
        General::state(self)
    }
}
