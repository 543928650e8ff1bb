//! A simulation: set up once, then stepped.

use std::fmt;

use mmsmith_lanes::simd::Lanes;
use mmsmith_lanes::tensor::{determinant, real};
use mmsmith_laws::fault::Fault;
use mmsmith_laws::{Law, Stressed};
use mmsmith_particles::mesh::Mesh;
use mmsmith_particles::{
    Arrangement, Body, BodyForce, Grid, Particles, Profile, SetupError, StepError,
};
use mmsmith_rare_states::{RareState, met_if};
use nalgebra::RealField;

use crate::domain::corner_exchange::invalidity_of_corner;
use crate::domain::corners::Corners;
use crate::domain::of_particles::axis_too_large;
use crate::every_scheme::EVERY_SCHEME;
use crate::grid::state::GridState;
use crate::processes::decomposition::{LocalBody, Share};
use crate::scheme::Settings;
use crate::set_up::{allocate, check, figure, of_blocks};
use crate::shape::one_axis::HALF_SIZE_LIMIT;
use crate::step::StepTimes;
use crate::step::health::{Invalid, Outcome};
use crate::step::state::State;

/// A running simulation.
pub struct Simulation<T, const D: usize> {
    grid: Grid<T, D>,
    law: Law<T, D>,
    settings: Settings<T>,
    pub(crate) state: State<T, D>,
    pub(crate) steps_done: usize,
    pub(crate) failed: Option<StepError>,
    /// Buffer for the particles that this process holds, where others are here as well.
    own: Option<Particles<T, D>>,
}

/// Numbers whose steps are compiled with this crate: `f64` and `f32`.
///
/// Steps are generic over precision and dimension. The functions here are not, so that whoever uses them does not compile kernels.
pub trait Simulated<const D: usize>: Stressed<D> {
    /// [`Simulation::new`].
    #[doc(hidden)]
    fn set_up(
        grid: Grid<Self, D>,
        body: Body<Self, D>,
        law: Law<Self, D>,
        settings: Settings<Self>,
        share: Option<Share>,
    ) -> Result<Simulation<Self, D>, SetupError>;

    /// [`Simulation::step`].
    #[doc(hidden)]
    fn step(
        simulation: &mut Simulation<Self, D>,
        body_force: &dyn BodyForce<Self, D>,
    ) -> Result<(), StepError>;
}

macro_rules! simulated {
    ($($T:ty: $($D:literal)*;)*) => {
        $($(impl Simulated<$D> for $T {
            fn set_up(
                grid: Grid<Self, $D>,
                body: Body<Self, $D>,
                law: Law<Self, $D>,
                settings: Settings<Self>,
                share: Option<Share>,
            ) -> Result<Simulation<Self, $D>, SetupError> {
                Simulation::set_up(grid, body, law, settings, share)
            }

            fn step(
                simulation: &mut Simulation<Self, $D>,
                body_force: &dyn BodyForce<Self, $D>,
            ) -> Result<(), StepError> {
                simulation.advance(body_force)
            }
        })*)*
    };
}

simulated! {
    f64: 1 2 3;
    f32: 1 2 3;
}

impl<T: Simulated<D>, const D: usize> Simulation<T, D> {
    /// Sets up a simulation at time 0, of a [`Body`] or of [`Particles`] with boxes.
    ///
    /// # Errors
    ///
    /// Where the scene makes no sense (see [`SetupError`]) or does not fit into memory.
    pub fn new(
        grid: Grid<T, D>,
        body: impl Into<Body<T, D>>,
        law: impl Into<Law<T, D>>,
        settings: Settings<T>,
    ) -> Result<Self, SetupError> {
        T::set_up(grid, body.into(), law.into(), settings, None)
    }

    /// As [`new`](Self::new), by one of several processes, of which each has a share of the body; all of them make the same calls from
    /// now on. Particles move to the process whose part of the grid they are in.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new), at all processes alike where a particle's state is the reason; [`SetupError::TooManyRanks`], and
    /// [`SetupError::NoNumbers`].
    pub fn shared_out(
        grid: Grid<T, D>,
        body: impl Into<Body<T, D>>,
        share: Share,
        law: impl Into<Law<T, D>>,
        settings: Settings<T>,
    ) -> Result<Self, SetupError> {
        T::set_up(grid, body.into(), law.into(), settings, Some(share))
    }

    /// Advances by one time step.
    ///
    /// All steps of a simulation are to be given the same body force: a step may evaluate it for the next one as well.
    ///
    /// # Errors
    ///
    /// Where a particle turns inside out, leaves the grid, grows too large or takes on values that are not finite. The
    /// particles then keep the state in which that was found, and every further call returns the same error.
    pub fn step(&mut self, body_force: &dyn BodyForce<T, D>) -> Result<(), StepError> {
        T::step(self, body_force)
    }
}

impl<T: Lanes, const D: usize> Simulation<T, D> {
    /// See [`new`](Self::new).
    pub(crate) fn set_up(
        grid: Grid<T, D>,
        body: Body<T, D>,
        law: Law<T, D>,
        settings: Settings<T>,
        share: Option<Share>,
    ) -> Result<Self, SetupError> {
        const { assert!(1 <= D && D <= 3, "one, two or three dimensions") };
        check(&grid, &body, &settings, share.as_ref())?;
        let mut state = allocate(&grid, body, of_blocks(&law), &settings, share)?;
        let of_particles =
            (0..state.particles.x.len()).filter_map(|p| Some((state.invalidity(p)?, p)));
        let corners = state.corners.as_deref().map(|Corners { shared, .. }| shared);
        let of_corners = corners.into_iter().flat_map(|corners| {
            let all = 0..corners.count();
            all.filter_map(|corner| invalidity_of_corner(&state.grid.constants, corners, corner))
        });
        let worst = of_particles.chain(of_corners).min();
        let outcome = state.reduce_outcome(Outcome { failure: worst, resort: false });
        if let Some((invalid, particle)) = outcome.failure {
            return Err(SetupError::InitialState(error_on_all_ranks(
                &state,
                invalid,
                particle,
                0,
                T::zero(),
            )));
        }
        state.sort();
        state.start_affine();
        if EVERY_SCHEME && state.law.is_projected() && state.grid.rates.is_none() {
            state.project_volume(false);
        }
        Ok(Self { grid, law, settings, state, steps_done: 0, failed: None, own: None })
    }

    /// See [`step`](Self::step).
    pub(crate) fn advance(&mut self, body_force: &dyn BodyForce<T, D>) -> Result<(), StepError> {
        self.own = None;
        if let Some(error) = &self.failed {
            return Err(error.clone());
        }
        let planted = self.state.grid.constants.planted;
        let halved = self.settings.halve_first_acceleration
            && self.steps_done == 0
            && !planted.is(Fault::NoHalfStep);
        let scale = if halved { real(0.5) } else { T::one() };
        let end = self.settings.time_step * real((self.steps_done + 1) as f64);
        let times = StepTimes { start: self.time(), end, scale };
        let before = self.state.part.as_ref().map(|part| part.ids.clone());
        let outcome = self.state.step(self.settings.integrator, body_force, times);
        met_if(RareState::ParticleMigrated, || {
            self.state.part.as_ref().map(|part| &part.ids) != before.as_ref()
        });
        if let Some((invalid, particle)) = outcome.failure {
            let step = self.steps_done + 1;
            let time = self.settings.time_step * real(step as f64);
            let error = error_on_all_ranks(&self.state, invalid, particle, step, time);
            self.failed = Some(error.clone());
            return Err(error);
        }
        self.steps_done += 1;
        Ok(())
    }

    /// Takes the times of passes from now on.
    pub(crate) fn take_times(&mut self) {
        self.state.passes.begin();
    }

    /// Where the time of steps went, and how many threads they keep busy.
    pub(crate) fn profile(&self) -> Profile {
        let GridState { bins, layout, .. } = &self.state.grid;
        Profile { passes: self.state.passes.times(), division: bins.division(layout) }
    }

    /// The particles at the current time; their velocities lag by [`velocity_lag`](Self::velocity_lag). With shared corners and several
    /// processes these are also the particles of others that share corners with this one's; see [`own_particles`](Self::own_particles).
    pub fn particles(&self) -> &Particles<T, D> {
        &self.state.particles
    }

    /// The particles that this process alone holds, those of its [`arrangement`](Self::arrangement): all
    /// [`particles`](Self::particles), but for those that share corners with particles of others.
    pub fn own_particles(&mut self) -> &Particles<T, D> {
        self.observed().0
    }

    /// These, and their law.
    pub(crate) fn observed(&mut self) -> (&Particles<T, D>, &Law<T, D>) {
        if self.state.grid.rates.is_some() {
            self.state.tell_mean_stress();
        }
        let Self { state: State { particles, part, .. }, own: buffer, law, .. } = self;
        // Those of before make room.
        *buffer = None;
        let own = match part.as_ref().and_then(|part| part.own.as_ref()) {
            Some(own) => buffer.insert(particles.some(&own.places)),
            None => particles,
        };
        (own, law)
    }

    /// Which particles this process holds, where there are several.
    pub fn arrangement(&self) -> Option<Arrangement<'_>> {
        self.state.part.as_deref().map(LocalBody::arrangement)
    }

    /// The domains of the particles at the current time, where they share corners.
    pub fn mesh(&self) -> Option<&Mesh<T, D>> {
        self.state.corners.as_ref().map(|corners| &corners.shared.mesh)
    }

    /// Number of completed steps.
    pub fn steps_done(&self) -> usize {
        self.steps_done
    }

    /// Current time: completed steps times the time step.
    pub fn time(&self) -> T {
        self.settings.time_step * real(self.steps_done as f64)
    }

    /// The law.
    pub fn law(&self) -> &Law<T, D> {
        &self.law
    }

    /// The grid.
    pub fn grid(&self) -> &Grid<T, D> {
        &self.grid
    }

    /// The settings.
    pub fn settings(&self) -> &Settings<T> {
        &self.settings
    }

    /// How far the particle velocities lag behind [`time`](Self::time): dt/2 for centred differences, else 0.
    ///
    /// With a halved first acceleration that holds from the first step on; the initial velocities are those at time 0.
    pub fn velocity_lag(&self) -> T {
        if self.settings.integrator.is_staggered() {
            self.settings.time_step * real(0.5)
        } else {
            T::zero()
        }
    }
}

impl<T: RealField, const D: usize> fmt::Debug for Simulation<T, D> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Simulation")
            .field("grid", &self.grid)
            .field("law", &self.law)
            .field("settings", &self.settings)
            .field("particles", &self.state.particles.X.len())
            .field("steps_done", &self.steps_done)
            .field("failed", &self.failed)
            .finish_non_exhaustive()
    }
}

/// The error for an invalid particle, at all processes; `particle` is its number in the whole body.
fn error_on_all_ranks<T: Lanes, const D: usize>(
    state: &State<T, D>,
    invalid: Invalid,
    particle: usize,
    step: usize,
    time: T,
) -> StepError {
    match &state.part {
        None => error_of(state, invalid, particle, step, time),
        Some(part) => {
            part.error_on_all_ranks(particle, |own| error_of(state, invalid, own, step, time))
        }
    }
}

/// The error for an invalid particle, with the figures of its present state.
fn error_of<T: Lanes, const D: usize>(
    state: &State<T, D>,
    invalid: Invalid,
    particle: usize,
    step: usize,
    time: T,
) -> StepError {
    let State { grid, domain, particles, .. } = state;
    let GridState { constants: c, .. } = grid;
    let corners = state.corners.as_deref().map(|Corners { shared, .. }| shared);
    let (x, F) = (&particles.x[particle], &particles.F[particle]);
    let position = x.iter().map(|&x| figure(x)).collect();
    let (time, J) = (figure(time), figure(determinant(F)));
    match invalid {
        // It may be the domain between the corners that is inverted.
        Invalid::Inverted if J > 0.0 => {
            let volume = corners.map_or(J, |corners| figure(corners.volume(particle)));
            let J = volume / figure(particles.volume[particle]);
            StepError::Inverted { step, time, particle, J }
        }
        Invalid::Inverted => StepError::Inverted { step, time, particle, J },
        Invalid::NotFinite => StepError::NotFinite { step, time, particle, position, J },
        Invalid::LeftGrid => {
            // It may be a corner of its domain that is beyond the grid.
            let corner = corners.filter(|_| c.axis_outside(x).is_none()).and_then(|corners| {
                let own = corners.mesh.of_particle(particle).iter();
                own.map(|&corner| corners.at(corner as usize)).find(|x| c.axis_beyond(x).is_some())
            });
            let x = corner.as_ref().unwrap_or(x);
            let position = x.iter().map(|&x| figure(x)).collect();
            let axis = c.axis_outside(&domain.on_grid(c, x)).unwrap_or(0);
            let (lower, upper) = c.range(axis);
            let (lower, upper) = (figure(lower), figure(upper));
            StepError::LeftGrid { step, time, particle, position, axis, lower, upper }
        }
        Invalid::TooLarge => {
            let l = domain.half_size(c, particle, F);
            let axis = axis_too_large(&l).unwrap_or(0);
            let spacing = figure(c.spacing());
            let beyond = domain.beyond_box();
            let half_size = (figure(l[axis]) - beyond) * spacing;
            let limit = spacing * (HALF_SIZE_LIMIT - beyond);
            StepError::TooLarge { step, time, particle, axis, half_size, limit }
        }
    }
}
