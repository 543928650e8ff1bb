//! A simulation: set up once, then stepped.

use std::fmt;

use bytemuck::{Pod, bytes_of_mut, cast_slice_mut};
use nalgebra::{RealField, SMatrix, SVector};

use crate::body_force::BodyForce;
use crate::error::{SetupError, StepError};
use crate::fault::Fault;
use crate::geometry::Constants;
use crate::grid::{Grid, Layout};
use crate::health::{Invalid, axis_too_large, invalidity};
use crate::material::{AnyLaw, Law, Material, NeoHookean, NeoHookeanNoLog};
use crate::node::Node;
use crate::parallel::bins::Bins;
use crate::particles::Particles;
use crate::shape_function::{
    FixedBox, HALF_SIZE_LIMIT, Hat, QuadraticSpline, ShapeChoice, StretchingBox, ThreeNodes,
};
use crate::state::State;
use crate::step::{Kernel, StepTimes, step_musl, step_usf, step_usl};
use crate::tensor::{determinant, real};

/// Shape functions, whose values at particles are the weights of P2G and G2P.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Shape {
    /// Hat functions at the particle's centre.
    Linear,
    /// GIMP weights with boxes of fixed half-size l0.
    Ugimp,
    /// GIMP weights with boxes of half-size `l0 F_aa` along axis a (contiguous particles).
    Gimp,
    /// Quadratic B-splines at the particle's centre.
    Bspline2,
}

/// Time integration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Integrator {
    /// Update stress first: F is updated before forces are computed.
    Usf,
    /// Update stress last: F is updated with the grid velocity at the end of the step.
    Usl,
    /// Modified update stress last: as `Usl`, with velocities projected anew from the updated particles.
    Musl,
    /// Centred differences: the arithmetic of `Usl`, with particle velocities half a step behind positions.
    Cd,
}

/// The name that the field has for it.
impl fmt::Display for Integrator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Usf => "usf",
            Self::Usl => "usl",
            Self::Musl => "musl",
            Self::Cd => "cd",
        })
    }
}

/// The scheme of a simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings<T> {
    /// Shape function.
    pub shape: Shape,
    /// Time integration.
    pub integrator: Integrator,
    /// Time step dt.
    pub time_step: T,
    /// Centred differences from velocities at time 0: halves the accelerations of the first step, so that they carry
    /// the velocities to dt/2 only. Without it the initial velocities are those at -dt/2.
    pub halve_first_acceleration: bool,
}

/// A running simulation.
pub struct Simulation<T, const D: usize> {
    grid: Grid<T, D>,
    material: Material<T>,
    settings: Settings<T>,
    state: State<T, D>,
    kernel: Kernel<T, D>,
    steps_done: usize,
    failed: Option<StepError>,
}

impl<T: RealField + Copy, const D: usize> Simulation<T, D> {
    /// Sets up a simulation at time 0.
    ///
    /// # Errors
    ///
    /// Where the scene makes no sense (see [`SetupError`]) or does not fit into memory.
    pub fn new(
        grid: Grid<T, D>,
        particles: Particles<T, D>,
        material: Material<T>,
        settings: Settings<T>,
    ) -> Result<Self, SetupError> {
        const { assert!(1 <= D && D <= 3, "one, two or three dimensions") };
        check(&grid, &particles, &settings)?;
        let state = allocate(&grid, particles, &settings)?;
        let cells = state.particles.half_size / grid.spacing;
        let (state, kernel) = match settings.shape {
            Shape::Linear => with_shape(state, Hat, &material, &settings),
            Shape::Ugimp => {
                let shape = ThreeNodes::FixedBox(FixedBox(cells));
                with_shape(state, shape, &material, &settings)
            }
            Shape::Gimp => {
                let shape = ThreeNodes::StretchingBox(StretchingBox(cells));
                with_shape(state, shape, &material, &settings)
            }
            Shape::Bspline2 => {
                let shape = ThreeNodes::Quadratic(QuadraticSpline);
                with_shape(state, shape, &material, &settings)
            }
        }?;
        Ok(Self { grid, material, settings, state, kernel, steps_done: 0, failed: None })
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
        if let Some(error) = &self.failed {
            return Err(error.clone());
        }
        let planted = self.state.constants.planted;
        let halved = self.settings.halve_first_acceleration
            && self.steps_done == 0
            && !planted.is(Fault::NoHalfStep);
        let scale = if halved { real(0.5) } else { T::one() };
        let end = self.settings.time_step * real((self.steps_done + 1) as f64);
        let times = StepTimes { start: self.time(), end, scale };
        let outcome = (self.kernel)(&mut self.state, body_force, times);
        if let Some((invalid, particle)) = outcome.failure {
            let step = self.steps_done + 1;
            let time = self.settings.time_step * real(step as f64);
            let error = describe(&self.state, &self.settings, invalid, particle, step, time);
            self.failed = Some(error.clone());
            return Err(error);
        }
        self.steps_done += 1;
        Ok(())
    }

    /// The particles at the current time; their velocities lag by [`velocity_lag`](Self::velocity_lag).
    pub fn particles(&self) -> &Particles<T, D> {
        &self.state.particles
    }

    /// Number of completed steps.
    pub fn steps_done(&self) -> usize {
        self.steps_done
    }

    /// Current time: completed steps times the time step.
    pub fn time(&self) -> T {
        self.settings.time_step * real(self.steps_done as f64)
    }

    /// The material.
    pub fn material(&self) -> &Material<T> {
        &self.material
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
        match self.settings.integrator {
            Integrator::Cd => self.settings.time_step * real(0.5),
            Integrator::Usf | Integrator::Usl | Integrator::Musl => T::zero(),
        }
    }
}

impl<T: RealField + Pod, const D: usize> Simulation<T, D> {
    /// The state between two steps, as slices of bytes in this machine's order; their number and lengths follow from the set-up.
    ///
    /// A copy of these bytes, written over the state of a simulation with the same set-up, continues the run to the same bits.
    pub fn state(&mut self) -> Vec<&mut [u8]> {
        // The caller may overwrite the particles, and the grid no longer belongs to them.
        self.state.is_ahead = false;
        let Particles { x, v, F, .. } = &mut self.state.particles;
        let mut state = vec![cast_slice_mut(x), cast_slice_mut(v), cast_slice_mut(F)];
        // The order of the last sort decides the order of sums over particles.
        state.extend(self.state.bins.state());
        state.push(bytes_of_mut(&mut self.steps_done));
        state
    }
}

impl<T: RealField, const D: usize> fmt::Debug for Simulation<T, D> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Simulation")
            .field("grid", &self.grid)
            .field("material", &self.material)
            .field("settings", &self.settings)
            .field("particles", &self.state.particles.X.len())
            .field("steps_done", &self.steps_done)
            .field("failed", &self.failed)
            .finish_non_exhaustive()
    }
}

/// A value for error messages, of any scalar type.
fn figure<T: RealField>(value: T) -> f64 {
    nalgebra::try_convert(value).unwrap_or(f64::NAN)
}

fn check<T: RealField + Copy, const D: usize>(
    grid: &Grid<T, D>,
    particles: &Particles<T, D>,
    settings: &Settings<T>,
) -> Result<(), SetupError> {
    let positive = |quantity: &dyn Fn() -> String, value: T| {
        if value > T::zero() && value.is_finite() {
            return Ok(());
        }
        Err(SetupError::NotPositive { quantity: quantity(), value: figure(value) })
    };
    positive(&|| "the time step".into(), settings.time_step)?;
    positive(&|| "the grid spacing".into(), grid.spacing)?;
    if grid.lower.iter().any(|x| !x.is_finite()) {
        return Err(SetupError::NotFinite { quantity: "the lower corner of the grid".into() });
    }
    if settings.halve_first_acceleration && settings.integrator != Integrator::Cd {
        return Err(SetupError::HalvedStart { integrator: settings.integrator.to_string() });
    }
    let Particles { X, x, v, F, mass, volume, half_size } = particles;
    let expected = X.len();
    for (array, found) in [
        ("x", x.len()),
        ("v", v.len()),
        ("F", F.len()),
        ("mass", mass.len()),
        ("volume", volume.len()),
    ] {
        if found != expected {
            return Err(SetupError::LengthMismatch { array, found, expected });
        }
    }
    if expected == 0 {
        return Err(SetupError::NoParticles);
    }
    let limit = u32::MAX as usize;
    if expected > limit {
        return Err(SetupError::TooManyParticles { particles: expected, limit });
    }
    if matches!(settings.shape, Shape::Ugimp | Shape::Gimp) {
        for (axis, &l) in half_size.iter().enumerate() {
            positive(&|| format!("the half-size of particles along axis {axis}"), l)?;
        }
    }
    for p in 0..expected {
        positive(&|| format!("the mass of particle {p}"), mass[p])?;
        positive(&|| format!("the volume of particle {p}"), volume[p])?;
        for (name, values) in [("reference position", &X[p]), ("velocity", &v[p])] {
            if values.iter().any(|value| !value.is_finite()) {
                return Err(SetupError::NotFinite {
                    quantity: format!("the {name} of particle {p}"),
                });
            }
        }
    }
    Ok(())
}

/// Reserves all memory of a run.
fn allocate<T: RealField + Copy, const D: usize>(
    grid: &Grid<T, D>,
    particles: Particles<T, D>,
    settings: &Settings<T>,
) -> Result<State<T, D>, SetupError> {
    let usf = settings.integrator == Integrator::Usf;
    let musl = settings.integrator == Integrator::Musl;
    let ahead = !usf && !musl;
    let grids = if musl || ahead { 2 } else { 1 };
    let bytes_per_node = grids * size_of::<Node<T, D>>();
    let layout = Layout::new(grid, bytes_per_node)?;
    // Asking first turns a grid that is too large into an error instead of an abort.
    let nodes = |is_needed: bool| {
        let mut nodes = Vec::new();
        let count = if is_needed { layout.nodes } else { 0 };
        nodes.try_reserve_exact(count).map_err(|_| SetupError::GridTooLarge {
            cells: grid.cells.to_vec(),
            bytes: layout.nodes as u128 * bytes_per_node as u128,
        })?;
        nodes.resize(count, Node::zero());
        Ok::<_, SetupError>(nodes)
    };
    let (now, reprojected, next) = (nodes(true)?, nodes(musl)?, nodes(ahead)?);
    let bins = Bins::new(&layout, particles.len());
    let least = particles.mass.iter().fold(particles.mass[0], |least, &m| least.min(m));
    let Particles { mass, volume, .. } = &particles;
    let (m, V) = (mass[0], volume[0]);
    let uniform = mass.iter().all(|&mass| mass == m) && volume.iter().all(|&volume| volume == V);
    Ok(State {
        uniform: uniform.then_some((m, V)),
        constants: Constants::new(grid, &layout, &bins, settings.time_step, least),
        nodes: now,
        F_next: if usf { vec![SMatrix::identity(); particles.len()] } else { Vec::new() },
        reprojected,
        next,
        is_ahead: false,
        of_time: Vec::new(),
        particles,
        layout,
        bins,
    })
}

type Prepared<T, const D: usize> = Result<(State<T, D>, Kernel<T, D>), SetupError>;

/// Checks the initial state, sorts the particles, and picks the kernel for this shape function.
fn with_shape<T, R, const D: usize, const W: usize>(
    mut state: State<T, D>,
    shape: R,
    material: &Material<T>,
    settings: &Settings<T>,
) -> Prepared<T, D>
where
    T: RealField + Copy,
    R: ShapeChoice<T, D, W>,
{
    let Particles { x, F, .. } = &state.particles;
    for p in 0..x.len() {
        if let Some(invalid) = invalidity(&shape, &state.constants, &x[p], &F[p]) {
            let error = describe(&state, settings, invalid, p, 0, T::zero());
            return Err(SetupError::InitialState(error));
        }
    }
    state.sort(shape);
    let kernel = match *material {
        Material::NeoHookean { lambda, mu } if lambda == T::zero() => {
            with_law(shape, NeoHookeanNoLog { mu }, settings.integrator)
        }
        Material::NeoHookean { lambda, mu } => {
            let planted = state.constants.planted;
            with_law(shape, NeoHookean { lambda, mu, planted }, settings.integrator)
        }
        other => with_law(shape, AnyLaw(other), settings.integrator),
    };
    Ok((state, kernel))
}

/// The kernel for this shape function and law.
fn with_law<T, R, L, const D: usize, const W: usize>(
    shape: R,
    law: L,
    integrator: Integrator,
) -> Kernel<T, D>
where
    T: RealField + Copy,
    R: ShapeChoice<T, D, W>,
    L: Law<T>,
{
    match integrator {
        Integrator::Usl | Integrator::Cd => {
            Box::new(move |s, b, times| step_usl(s, (shape, law), b, times))
        }
        Integrator::Musl => Box::new(move |s, b, times| step_musl(s, (shape, law), b, times)),
        Integrator::Usf => Box::new(move |s, b, times| step_usf(s, (shape, law), b, times)),
    }
}

/// The error for an invalid particle, with the figures of its present state.
fn describe<T: RealField + Copy, const D: usize>(
    state: &State<T, D>,
    settings: &Settings<T>,
    invalid: Invalid,
    particle: usize,
    step: usize,
    time: T,
) -> StepError {
    let (x, F) = (&state.particles.x[particle], &state.particles.F[particle]);
    let position = x.iter().map(|&x| figure(x)).collect();
    let (time, J) = (figure(time), figure(determinant(F)));
    match invalid {
        Invalid::Inverted => StepError::Inverted { step, time, particle, J },
        Invalid::NotFinite => StepError::NotFinite { step, time, particle, position, J },
        Invalid::LeftGrid => {
            let axis = state.constants.axis_outside(x).unwrap_or(0);
            let (lower, upper) = state.constants.range(axis);
            let (lower, upper) = (figure(lower), figure(upper));
            StepError::LeftGrid { step, time, particle, position, axis, lower, upper }
        }
        Invalid::TooLarge => {
            let l0 = &state.particles.half_size;
            let l = match settings.shape {
                Shape::Gimp => SVector::from_fn(|a, _| (l0[a] * F[(a, a)]).abs()),
                Shape::Linear | Shape::Ugimp | Shape::Bspline2 => *l0,
            };
            let spacing = state.constants.spacing();
            let axis = axis_too_large(&(l / spacing)).unwrap_or(0);
            let limit = figure(spacing) * HALF_SIZE_LIMIT;
            StepError::TooLarge { step, time, particle, axis, half_size: figure(l[axis]), limit }
        }
    }
}
