//! Solvers of any scheme behind one door, compiled with this crate.

use mmsmith_laws::Law;
use mmsmith_particles::{
    Arrangement, Body, BodyForce, Grid, Particles, Profile, SavedState, SavedStateError,
    SetupError, Solver, StepError,
};
use nalgebra::SVector;

use crate::processes::decomposition::Share;
use crate::scheme::Settings;
use crate::simulation::{Simulated, Simulation};

impl<T: Scalar<D>, const D: usize> Solver<T, D> for Simulation<T, D> {
    fn step(&mut self, body_force: &dyn BodyForce<T, D>) -> Result<(), StepError> {
        Simulation::step(self, body_force)
    }

    fn observe(&mut self) -> (&Particles<T, D>, &Law<T, D>) {
        self.observed()
    }

    fn arrangement(&self) -> Option<Arrangement<'_>> {
        Simulation::arrangement(self)
    }

    fn forced(&self) -> &[SVector<T, D>] {
        &self.particles().X
    }

    fn velocity_lag(&self) -> T {
        Simulation::velocity_lag(self)
    }

    fn take_times(&mut self) {
        Simulation::take_times(self);
    }

    fn profile(&self) -> Profile {
        Simulation::profile(self)
    }

    fn state(&self) -> Vec<&[u8]> {
        Simulation::state(self)
    }

    fn take_up(&mut self, parts: Vec<SavedState>) -> Result<(), SavedStateError> {
        Simulation::take_up(self, parts)
    }
}

impl<T: Scalar<D>, const D: usize> Simulation<T, D> {
    /// Goes on from a state that was saved, of a simulation with the same set-up on any number of processes, to the bits of that one. Each
    /// process gives the parts that it has read; a call of all.
    ///
    /// # Errors
    ///
    /// Where the state is not one of this set-up. The particles then may be those of any time, and only another state can be taken up.
    pub fn take_up(&mut self, parts: Vec<SavedState>) -> Result<(), SavedStateError> {
        T::take_up(self, parts)
    }
}

/// The precisions of the solver: `f64` and `f32`. The functions here are not generic, so that they are compiled with this crate, and not
/// again by whoever sets a solver up.
pub trait Scalar<const D: usize>: Simulated<D> {
    /// [`Simulation::new`], or [`Simulation::shared_out`] where there is a share.
    ///
    /// # Errors
    ///
    /// As these.
    fn updated_lagrangian(
        grid: Grid<Self, D>,
        body: Body<Self, D>,
        law: Law<Self, D>,
        settings: Settings<Self>,
        share: Option<Share>,
    ) -> Result<Box<dyn Solver<Self, D>>, SetupError>;

    /// [`Simulation::take_up`].
    #[doc(hidden)]
    fn take_up(
        simulation: &mut Simulation<Self, D>,
        parts: Vec<SavedState>,
    ) -> Result<(), SavedStateError>;
}

macro_rules! scalar {
    ($($T:tt: $($D:literal)*;)*) => {
        $($(
            impl Scalar<$D> for $T {
                fn updated_lagrangian(
                    grid: Grid<Self, $D>,
                    body: Body<Self, $D>,
                    law: Law<Self, $D>,
                    settings: Settings<Self>,
                    share: Option<Share>,
                ) -> Result<Box<dyn Solver<Self, $D>>, SetupError> {
                    Ok(Box::new(Simulation::set_up(grid, body, law, settings, share)?))
                }

                fn take_up(
                    simulation: &mut Simulation<Self, $D>,
                    parts: Vec<SavedState>,
                ) -> Result<(), SavedStateError> {
                    simulation.put(parts)
                }
            }
        )*)*
    };
}

scalar! {
    f64: 1 2 3;
    f32: 1 2 3;
}
