//! Solvers of any scheme behind one door, compiled with this crate.

use std::ops::Range;

use mmsmith_laws::Law;
use nalgebra::SVector;

use crate::error::{SetupError, StepError};
use crate::grid::Grid;
use crate::particles::Particles;
use crate::particles::body::{self, Annulus, Body};
use crate::processes::decomposition::{Arrangement, Share};
use crate::processes::saved_state::{SavedState, SavedStateError};
use crate::scheme::Settings;
use crate::simulation::{Simulated, Simulation};
use crate::step::body_force::BodyForce;
use crate::step::passes::Profile;

/// A solver that can be stepped and looked at.
pub trait Solver<T, const D: usize> {
    /// Advances by one time step.
    ///
    /// # Errors
    ///
    /// See [`Simulation::step`].
    fn step(&mut self, body_force: &dyn BodyForce<T, D>) -> Result<(), StepError>;

    /// The particles that this process holds as they are now, and their law.
    fn observe(&mut self) -> (&Particles<T, D>, &Law<T, D>);

    /// Which particles this process holds, where there are several.
    fn arrangement(&self) -> Option<Arrangement<'_>>;

    /// The reference positions at which a step evaluates the body force, in the order of the numbers by which it does.
    fn forced(&self) -> &[SVector<T, D>];

    /// How far velocities lag behind positions, a time.
    fn velocity_lag(&self) -> T;

    /// Takes the times of passes from now on, where the solver has such. Default: it has none.
    fn take_times(&mut self) {}

    /// Where the time of steps went since then. Default: nothing is known.
    fn profile(&self) -> Profile {
        Profile::default()
    }

    /// The state between two steps, see [`Simulation::state`].
    fn state(&self) -> Vec<&[u8]>;

    /// Goes on from such a state, see [`Simulation::take_up`].
    ///
    /// # Errors
    ///
    /// Where it is not one of this set-up.
    fn take_up(&mut self, parts: Vec<SavedState>) -> Result<(), SavedStateError>;
}

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

impl<T: Scalar<D>, const D: usize> Body<T, D> {
    /// Some successive particles alone, with their corners.
    #[must_use]
    pub fn part(&self, own: &Range<usize>) -> Self {
        T::body_part(self, own)
    }

    /// A ring at rest, fitted by polar cells of equal width and angle. Particles lie at the exact centroids of the cells
    /// and have their exact areas; their quadrilaterals share corners, which lie on the rims and on the planes of
    /// symmetry.
    ///
    /// With `per_cell` particles in a length `spacing` there are `round(per_cell (outer - inner) / spacing)` cells across
    /// (1 at least), and around as many in each quarter as make them square at the mean radius.
    ///
    /// # Errors
    ///
    /// [`SetupError::PolarDimension`] in other dimensions than two, and [`SetupError::NotPositive`] for radii or a density
    /// that are none.
    pub fn annulus(
        ring: &Annulus<T>,
        spacing: T,
        per_cell: usize,
        density: T,
    ) -> Result<Self, SetupError> {
        T::body_annulus(ring, spacing, per_cell, density)
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

    /// [`Body::annulus`].
    #[doc(hidden)]
    fn body_annulus(
        ring: &Annulus<Self>,
        spacing: Self,
        per_cell: usize,
        density: Self,
    ) -> Result<Body<Self, D>, SetupError>;

    /// [`Body::part`].
    #[doc(hidden)]
    fn body_part(body: &Body<Self, D>, own: &Range<usize>) -> Body<Self, D>;

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

                fn body_annulus(
                    ring: &Annulus<Self>,
                    spacing: Self,
                    per_cell: usize,
                    density: Self,
                ) -> Result<Body<Self, $D>, SetupError> {
                    body::annulus(ring, spacing, per_cell, density)
                }

                fn body_part(body: &Body<Self, $D>, own: &Range<usize>) -> Body<Self, $D> {
                    body::part(body, own)
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
