//! The simulation: coefficients of displacement and velocity, and the forces on them.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::{array, mem};

use bytemuck::{bytes_of, bytes_of_mut, cast_slice, cast_slice_mut};
use mmsmith_lanes::tensor::determinant;
use mmsmith_laws::fault::{Fault, Planted};
use mmsmith_laws::{
    AnyLaw, InternalVariable, Law, LawWithMemory, Material, NeoHookean, NeoHookeanNoLog,
};
use mmsmith_particles::{
    BodyForce, Particles, SavedState, SavedStateError, SetupError, StepError, replace_whole,
};
use mmsmith_threads::{each, each_chunk};
use nalgebra::{SMatrix, SVector};

use super::boundary::{BoundaryData, Face, HeldBoundary, Quantity};
use super::component::{Component, Factors, Field, Operators, along, each_component, solve};
use super::composition::Composition;
use super::coordinates::RowGeometry;
use super::fit::Line;
use super::gradient::Gradients;
use super::piece;
use super::projection::Projection;
use super::set_up::{
    Grid, MassMatrix, Scheme, bases, check, faces, fits, line, masses, particles, reserve, rows,
};
use super::stress::{
    LawOfRows, MemoryRows, OwnRows, Places, ProjectedRows, Stress, is_deformation,
};

/// A running simulation in the reference configuration.
///
/// All loops over particles and coefficients are shared among the threads of the pool; no sum depends on their number.
#[derive(Clone, Debug)]
pub struct TotalLagrangian<const D: usize> {
    grid: Grid<D>,
    scheme: Scheme,
    law: Law<f64, D>,
    time_step: f64,
    operators: Operators<D>,
    /// Sides whose motion or traction is given.
    faces: Vec<Face<D>>,
    components: [Component<D>; D],
    /// The body force at the particles.
    b: Vec<SVector<f64, D>>,
    particles: Particles<f64, D>,
    /// Where the change of volume is projected, the projection and the law that takes it.
    projected: Option<ProjectedChange<D>>,
    /// With memory, the internal variables of the law, and the deformation gradients that those of the particles belong to.
    variables: Vec<InternalVariable>,
    remembered: Vec<SMatrix<f64, D, D>>,
    density: f64,
    /// Curvilinear coordinates: reciprocal radius by place along axis 0, and what a row of places along it has in common.
    reciprocal_radius: Vec<f64>,
    rows: Vec<RowGeometry<D>>,
    steps_done: usize,
    failed: Option<StepError>,
    planted: Planted,
}

impl<const D: usize> TotalLagrangian<D> {
    /// Sets up a body at rest and undeformed, of density `density` per reference volume, at time 0.
    ///
    /// Stages of compositions of higher order go back in time, where internal variables of a law with memory cannot follow: with such a
    /// law it is leapfrog, and [`scheme`](Self::scheme) says so.
    ///
    /// # Errors
    ///
    /// Where the scene makes no sense (see [`SetupError`]) or does not fit into memory.
    pub fn new(
        grid: Grid<D>,
        scheme: Scheme,
        law: impl Into<Law<f64, D>>,
        density: f64,
        time_step: f64,
    ) -> Result<Self, SetupError> {
        const { assert!(1 <= D && D <= 3, "one, two or three dimensions") };
        let law = law.into();
        let (variables, mut scheme) = (law.variables(), scheme);
        let of_projection = match &law {
            Law::WithMemory(law) if law.is_projected() => Some(law.clone()),
            Law::WithMemory(_) | Law::Library(_) | Law::Own(_) => None,
        };
        if !variables.is_empty() && of_projection.is_none() {
            scheme.composition = Composition::Order2;
        }
        check(&grid, &scheme, density, time_step)?;
        reserve(&grid, scheme.degree, variables.len())?;
        let mut lines: [Line; D] = array::from_fn(|k| line(&grid, k));
        let faces = faces(&grid, &lines);
        let bases = bases(&grid, scheme.degree, &lines)?;
        let singular = |axis: usize| SetupError::SingularMass { axis, per_cell: grid.per_cell };
        let fits = fits(&grid, &bases, &lines).map_err(singular);
        if let (Err(error), true) = (&fits, faces.iter().any(|face| face.moved)) {
            return Err(error.clone());
        }
        if Planted::here().is(Fault::WeightOff) {
            lines.iter_mut().for_each(|line| line.weights[0] *= 1.001);
        }
        let mass = masses(&grid, &scheme, &bases, &lines, density)?;
        let projected = match of_projection {
            Some(law) => {
                let count = lines.iter().map(|line| line.points.len()).product();
                let of = Projection::new(&grid, scheme.degree, &lines)?;
                let (theta, scaled) = (vec![1.0; count], vec![SMatrix::zeros(); count]);
                Some(ProjectedChange { law, of, theta, scaled })
            }
            None => None,
        };
        let mut particles = particles(&grid, &lines, density);
        particles.internal = initial(&law, &particles.X);
        let remembered = match variables.is_empty() {
            true => Vec::new(),
            false => vec![SMatrix::identity(); particles.len()],
        };
        Ok(Self {
            projected,
            variables,
            remembered,
            reciprocal_radius: match grid.coordinates.are_curvilinear() {
                true => lines[0].points.iter().map(|R| R.recip()).collect(),
                false => Vec::new(),
            },
            rows: rows(&grid, &lines),
            faces,
            components: array::from_fn(|index| Component::new(index, &bases)),
            b: vec![SVector::zeros(); particles.len()],
            grid,
            scheme,
            law,
            time_step,
            operators: Operators { bases, mass, fits },
            particles,
            density,
            steps_done: 0,
            failed: None,
            planted: Planted::here(),
        })
    }

    /// The particles' reference positions, Cartesian.
    pub fn positions(&self) -> &[SVector<f64, D>] {
        &self.particles.X
    }

    /// Starts anew at time 0 as [`start_with_boundary`](Self::start_with_boundary) does, with sides that are held.
    ///
    /// # Errors
    ///
    /// As [`start_with_boundary`](Self::start_with_boundary).
    pub fn start(
        &mut self,
        u: &[SVector<f64, D>],
        v: &[SVector<f64, D>],
    ) -> Result<(), SetupError> {
        self.start_with_boundary(u, v, &HeldBoundary)
    }

    /// Starts anew at time 0 from the displacements and velocities nearest to those given at the particles, in the
    /// mean of squares weighted with the particles' masses, among those that have the motion given on the sides.
    ///
    /// # Errors
    ///
    /// [`SetupError::SingularMass`] where lumped masses hide that the particles do not determine the coefficients, and
    /// [`SetupError::LengthMismatch`] for slices of another length than [`positions`](Self::positions).
    pub fn start_with_boundary(
        &mut self,
        u: &[SVector<f64, D>],
        v: &[SVector<f64, D>],
        boundary: &dyn BoundaryData<D>,
    ) -> Result<(), SetupError> {
        let expected = self.particles.len();
        for (array, found) in [("u", u.len()), ("v", v.len())] {
            if found != expected {
                return Err(SetupError::LengthMismatch { array, found, expected });
            }
        }
        if let Err(error) = &self.operators.fits {
            return Err(error.clone());
        }
        self.fit(u, boundary, Quantity::Displacement, |component| &mut component.u);
        self.fit(v, boundary, Quantity::Velocity, |component| &mut component.v);
        self.particles.internal = initial(&self.law, &self.particles.X);
        if let Law::WithMemory(law) = self.law.clone() {
            let rates = self.gradients(Field::Velocity);
            let all = self.particles.internal.chunks_exact_mut(self.variables.len());
            for (rate, q) in rates.iter().zip(all) {
                law.start_at_rate(rate, q);
            }
        }
        self.steps_done = 0;
        self.failed = None;
        let Self { components, operators, .. } = self;
        each_component(components, &|component| {
            component.evaluate(&operators.bases, Field::Displacement, true);
        });
        // Where there is no stress, the first step says so.
        self.project_volume();
        Ok(())
    }

    /// Turns coefficients into those of the field nearest to given values, which is `quantity` on the sides at time 0.
    fn fit(
        &mut self,
        values: &[SVector<f64, D>],
        boundary: &dyn BoundaryData<D>,
        quantity: Quantity,
        of: fn(&mut Component<D>) -> &mut Vec<f64>,
    ) {
        self.components.iter_mut().for_each(|component| of(component).fill(0.0));
        self.prescribe(boundary, quantity, 0.0, of);
        let row = self.row();
        for (p, value) in values.iter().enumerate() {
            let value = self.in_frame(p / row, value);
            for component in &mut self.components {
                component.values[p] = value[component.index] * self.particles.volume[p];
            }
        }
        let Self { operators: Operators { bases, fits, .. }, faces, components, .. } = self;
        let Ok(fits) = fits else { return };
        for component in components {
            let index = component.index;
            let functions = component.functions(bases);
            let given = mem::take(of(component));
            let mut sums = vec![0.0; given.len()];
            component.integrate(bases, Factors::Values, &mut sums);
            let matrix = |k: usize| &fits[k][index].matrix;
            component.subtract_product(&functions, matrix, 1.0, &given, &mut sums);
            solve(&functions, |k| &fits[k][index].mass, &mut sums);
            for face in faces.iter().filter(|face| face.moves(index)) {
                face.copy(&functions, &given, &mut sums);
            }
            *of(component) = sums;
        }
    }

    /// Advances by one time step as [`step_with_boundary`](Self::step_with_boundary) does, with sides that are held, and
    /// without traction.
    ///
    /// # Errors
    ///
    /// As [`step_with_boundary`](Self::step_with_boundary).
    pub fn step(&mut self, body_force: &dyn BodyForce<f64, D>) -> Result<(), StepError> {
        self.step_with_boundary(body_force, &HeldBoundary)
    }

    /// Advances by one time step.
    ///
    /// # Errors
    ///
    /// Where a particle turns inside out or takes on values that are not finite, at any stage of the step. Every
    /// further call returns the same error.
    pub fn step_with_boundary(
        &mut self,
        body_force: &dyn BodyForce<f64, D>,
        boundary: &dyn BoundaryData<D>,
    ) -> Result<(), StepError> {
        if let Some(error) = &self.failed {
            return Err(error.clone());
        }
        let outcome = self.advance(body_force, boundary);
        if let Err(error) = &outcome {
            self.failed = Some(error.clone());
        }
        outcome
    }

    fn advance(
        &mut self,
        body_force: &dyn BodyForce<f64, D>,
        boundary: &dyn BoundaryData<D>,
    ) -> Result<(), StepError> {
        let start = self.time();
        if self.steps_done == 0 {
            self.accelerate(body_force, boundary, start, None)?;
        }
        // The step's part that is done: time is a variable of the drift, or the composition would lose its order.
        let mut done = 0.0;
        let stages = self.scheme.composition.stages();
        for (stage, &gamma) in stages.iter().enumerate() {
            let part = self.planted.stage(gamma) * self.time_step;
            each_component(&mut self.components, &|component| {
                component.kick(0.5 * part);
                component.drift(part);
            });
            let before = start + done * self.time_step;
            done += if self.planted.is(Fault::StagesAtOneTime) { 0.0 } else { gamma };
            let now = start + done * self.time_step;
            let moved = if self.planted.is(Fault::LateBoundary) { before } else { now };
            // On the way the sides are integrated like all the rest: beside a motion without the errors of the stages they
            // would leave a layer of order two in the velocities.
            if stage + 1 == stages.len() {
                self.prescribe(boundary, Quantity::Displacement, moved, |of| &mut of.u);
            }
            self.accelerate(body_force, boundary, now, Some(part))?;
            each_component(&mut self.components, &|component| component.kick(0.5 * part));
        }
        let end = start + done * self.time_step;
        self.prescribe(boundary, Quantity::Velocity, end, |of| &mut of.v);
        self.steps_done += 1;
        Ok(())
    }

    /// Writes what is given on moved sides over coefficients.
    fn prescribe(
        &mut self,
        boundary: &dyn BoundaryData<D>,
        quantity: Quantity,
        time: f64,
        of: fn(&mut Component<D>) -> &mut Vec<f64>,
    ) {
        let Self { faces, operators: Operators { bases, fits, .. }, components, .. } = self;
        // Without fits there are no sides of that kind.
        let Ok(fits) = fits else { return };
        for face in faces.iter_mut().filter(|face| face.moved) {
            face.ask(boundary, quantity, time);
            for component in components.iter_mut().filter(|own| face.moves(own.index)) {
                let index = component.index;
                let axis = |k: usize| (&fits[k][index], along(bases, k, index));
                let of_side = face.fit(index, axis);
                face.set(&component.functions(bases), &of_side, of(component));
            }
        }
    }

    /// The particles as they are now, with velocities of the same time; computed at each call.
    pub fn observe(&mut self) -> &Particles<f64, D> {
        let row = self.row();
        let Self { components, operators, particles, rows, grid, reciprocal_radius, .. } = self;
        let rows = &rows[..];
        let evaluate = |components: &mut [Component<D>; D], field: Field| {
            each_component(components, &|component| {
                component.evaluate(&operators.bases, field, true);
            });
        };
        evaluate(components, Field::Velocity);
        let size = piece(particles.v.len());
        let at = &*components;
        each_chunk(&mut particles.v, size, &|piece, v| {
            for (v, p) in v.iter_mut().zip(piece * size..) {
                let local = SVector::from_fn(|i, _| at[i].values[p]);
                *v = cartesian(rows, p / row, &local);
            }
        });
        evaluate(components, Field::Displacement);
        let (components, coordinates) = (&*components, grid.coordinates);
        let at = Gradients { components, coordinates, row, rows, reciprocal_radius };
        let Particles { X, x, F, .. } = particles;
        let X = &X[..];
        let pieces = x.chunks_mut(size).zip(F.chunks_mut(size)).enumerate().collect();
        each(pieces, &|(piece, (x, F))| {
            for ((x, F), p) in x.iter_mut().zip(F).zip(piece * size..) {
                *F = SMatrix::identity() + at.at(p);
                *x = X[p] + cartesian(rows, p / row, &at.value(p));
            }
        });
        &self.particles
    }

    /// The gradients of a field at the particles, Cartesian.
    fn gradients(&mut self, field: Field) -> Vec<SMatrix<f64, D, D>> {
        let row = self.row();
        let Self { components, operators, particles, rows, grid, reciprocal_radius, .. } = self;
        each_component(components, &|component| {
            component.evaluate(&operators.bases, field, true);
        });
        let (components, coordinates) = (&*components, grid.coordinates);
        let at = Gradients { components, coordinates, row, rows, reciprocal_radius };
        (0..particles.len()).map(|p| at.at(p)).collect()
    }

    /// The particles as they were at the last call of [`observe`](Self::observe), or at rest.
    pub fn particles(&self) -> &Particles<f64, D> {
        &self.particles
    }

    /// The state between two steps: arrays as bytes in this machine's order.
    pub fn state(&self) -> Vec<&[u8]> {
        let Self { components, steps_done, remembered, particles, .. } = self;
        let coefficients = components.iter().flat_map(|Component { u, v, a, .. }| [u, v, a]);
        let mut state: Vec<&[u8]> = coefficients.map(|c| cast_slice(c)).collect();
        if !remembered.is_empty() {
            state.extend([cast_slice(remembered), cast_slice(&particles.internal)]);
        }
        state.push(bytes_of(steps_done));
        state
    }

    /// Goes on from a state that was saved, of a simulation with the same set-up, to the bits of that one.
    ///
    /// # Errors
    ///
    /// Where the state is not one of this set-up; nothing is changed then.
    pub fn take_up(&mut self, parts: &[SavedState]) -> Result<(), SavedStateError> {
        let Self { components, steps_done, remembered, particles, .. } = self;
        let coefficients = components.iter_mut().flat_map(|Component { u, v, a, .. }| [u, v, a]);
        let mut state: Vec<&mut [u8]> = coefficients.map(|c| cast_slice_mut(c)).collect();
        if !remembered.is_empty() {
            state.extend([cast_slice_mut(remembered), cast_slice_mut(&mut particles.internal)]);
        }
        state.push(bytes_of_mut(steps_done));
        replace_whole(&mut state, parts)
    }

    /// Number of completed steps.
    pub fn steps_done(&self) -> usize {
        self.steps_done
    }

    /// Current time: completed steps times the time step.
    pub fn time(&self) -> f64 {
        self.time_step * self.steps_done as f64
    }

    /// The law.
    pub fn law(&self) -> &Law<f64, D> {
        &self.law
    }

    /// The grid.
    pub fn grid(&self) -> &Grid<D> {
        &self.grid
    }

    /// The discretisation.
    pub fn scheme(&self) -> Scheme {
        self.scheme
    }

    /// Particles along axis 0.
    fn row(&self) -> usize {
        self.operators.bases[0][0].points
    }

    /// A vector's components that the unknowns stand for, in row `row` of particles.
    fn in_frame(&self, row: usize, vector: &SVector<f64, D>) -> SVector<f64, D> {
        self.rows.get(row).map_or(*vector, |row| row.frame.tr_mul(vector))
    }

    /// The accelerations at the current displacement and at `time`, after an increment of a time that internal variables follow.
    fn accelerate(
        &mut self,
        body_force: &dyn BodyForce<f64, D>,
        boundary: &dyn BoundaryData<D>,
        time: f64,
        increment: Option<f64>,
    ) -> Result<(), StepError> {
        let curvilinear = self.grid.coordinates.are_curvilinear();
        let Self { components, operators, .. } = self;
        each_component(components, &|component| {
            component.evaluate(&operators.bases, Field::Displacement, curvilinear);
        });
        if !self.project_volume() {
            return Err(self.describe());
        }
        let forced = !body_force.is_absent() && !self.planted.is(Fault::NoBodyForce);
        let force = forced.then_some((body_force, time));
        let planted = self.planted;
        let bad = match self.law.clone() {
            // One law has kernels of its own; those of `AnyLaw` serve every law.
            Law::Library(material) => {
                if let Material::NeoHookean { lambda, mu } = material {
                    if lambda == 0.0 {
                        self.stress(NeoHookeanNoLog { mu }, force)
                    } else {
                        self.stress(NeoHookean { lambda, mu, planted }, force)
                    }
                } else {
                    self.stress(AnyLaw(planted.law_in_stresses(material)), force)
                }
            }
            Law::Own(law) => self.stress(OwnRows(law), force),
            Law::WithMemory(law) => match self.projected.take() {
                Some(mut projected) => {
                    let bad = {
                        let ProjectedChange { scaled, of, .. } = &mut projected;
                        self.stress(ProjectedRows { scaled, p: of.values() }, force)
                    };
                    self.projected = Some(projected);
                    bad
                }
                None => {
                    let variables = self.variables.clone();
                    let rows = MemoryRows { law: &*law, variables: &variables, time: increment };
                    self.stress(rows, force)
                }
            },
        };
        if bad {
            return Err(self.describe());
        }
        let factors = if curvilinear || forced { Factors::Both } else { Factors::Slopes };
        for face in self.faces.iter_mut().filter(|face| !face.moved) {
            face.ask(boundary, Quantity::Traction, time);
            if self.planted.is(Fault::TractionSign) {
                face.values.iter_mut().for_each(|traction| *traction = -*traction);
            }
        }
        self.prescribe(boundary, Quantity::Acceleration, time, |of| &mut of.given);
        let moves = self.faces.iter().any(|face| face.moved);
        let couples = moves
            && self.scheme.mass == MassMatrix::Consistent
            && !self.planted.is(Fault::BoundaryInertiaDropped);
        let coupling = couples.then_some(self.density);
        let Self { components, operators, faces, .. } = self;
        let faces = &faces[..];
        each_component(components, &|component| {
            component.accelerate(operators, factors, faces, coupling);
        });
        Ok(())
    }

    /// Projects the change of volume of the displacements and slopes at the particles, and the mean stress that follows, if the scheme asks
    /// for it. False where a particle has no stress.
    fn project_volume(&mut self) -> bool {
        let row = self.row();
        let Self { projected, components, particles, remembered, rows, grid, .. } = self;
        let Some(ProjectedChange { law, of, theta, scaled }) = projected else { return true };
        let (reciprocal_radius, planted) = (&self.reciprocal_radius, self.planted);
        let size = piece(particles.len());
        let (components, coordinates) = (&*components, grid.coordinates);
        let at = Gradients { components, coordinates, row, rows, reciprocal_radius };
        each_chunk(remembered, size, &|piece, F| {
            for (F, p) in F.iter_mut().zip(piece * size..) {
                *F = SMatrix::identity() + at.at(p);
            }
        });
        let remembered = &remembered[..];
        each_chunk(of.values(), size, &|piece, values| {
            for (J, F) in values.iter_mut().zip(&remembered[piece * size..]) {
                *J = determinant(F);
            }
        });
        if of.values().iter().any(|J| !(*J > 0.0 && *J < f64::INFINITY)) {
            return false;
        }
        if !planted.is(Fault::JacobianForTheta) {
            of.project(&particles.volume);
        }
        theta.copy_from_slice(of.values());
        if !theta.iter().all(|theta| *theta > 0.0) {
            let variables = particles.internal.chunks_exact_mut(2);
            variables.zip(&*theta).for_each(|(q, &theta)| q[0] = theta);
            return false;
        }
        let found = scaled.chunks_mut(size).zip(of.values().chunks_mut(size));
        let states = remembered.chunks(size).zip(theta.chunks(size));
        each(states.zip(found).collect(), &|((F, theta), (scaled, mean))| {
            law.evaluate_projected(F, theta, scaled, mean);
        });
        // The stress of a particle is that of the law: its own mean stress is nearer to the exact one than the projected one, which the
        // forces need.
        let own = theta.iter().zip(of.values());
        for (q, (&theta, &mut p)) in particles.internal.chunks_exact_mut(2).zip(own) {
            q.copy_from_slice(&[theta, p]);
        }
        of.project(&particles.volume);
        true
    }

    /// Turns displacements and their slopes at the particles into the factors of the functions' values and slopes in the
    /// forces, with the body force at a time if there is one. True where a particle has no stress.
    fn stress<L: LawOfRows<D>>(
        &mut self,
        law: L,
        force: Option<(&dyn BodyForce<f64, D>, f64)>,
    ) -> bool {
        let row = self.row();
        let count = self.variables.len();
        // What it changes of the particles.
        let mut internal = mem::take(&mut self.particles.internal);
        let Self { components, b, particles, remembered, .. } = self;
        let size = piece(b.len()).div_ceil(row) * row;
        let mut of_memory =
            (remembered.chunks_mut(size), internal.chunks_mut((size * count).max(1)));
        let mut arrays = components.each_mut().map(|Component { values, slopes, .. }| {
            (values.chunks_mut(size), slopes.each_mut().map(|array| array.chunks_mut(size)))
        });
        let pieces: Vec<_> = b
            .chunks_mut(size)
            .enumerate()
            .map(|(piece, b)| Places {
                first: piece * size,
                values: arrays.each_mut().map(|(values, _)| values.next().unwrap_or_default()),
                slopes: arrays.each_mut().map(|(_, slopes)| {
                    slopes.each_mut().map(|chunks| chunks.next().unwrap_or_default())
                }),
                b,
                F: of_memory.0.next().unwrap_or_default(),
                internal: of_memory.1.next().unwrap_or_default(),
            })
            .collect();
        let stress = Stress {
            law,
            force,
            row,
            particles,
            density: self.density,
            coordinates: self.grid.coordinates,
            rows: &self.rows,
            reciprocal_radius: &self.reciprocal_radius,
            planted: self.planted,
        };
        let bad = AtomicBool::new(false);
        each(pieces, &|places| {
            if stress.at(places) {
                bad.store(true, Ordering::Relaxed);
            }
        });
        self.particles.internal = internal;
        bad.into_inner()
    }

    /// The error of an invalid displacement.
    #[cold]
    fn describe(&mut self) -> StepError {
        let step = self.steps_done + 1;
        let time = self.time_step * step as f64;
        let theta = self.projected.is_some().then(|| self.particles.internal.clone());
        let particles = self.observe();
        let is_bad = |F: &SMatrix<f64, D, D>| !is_deformation(F);
        if let Some(theta) = theta
            && !particles.F.iter().any(is_bad)
        {
            let mut all = theta.iter().step_by(2).enumerate();
            let (particle, &theta) =
                all.find(|(_, theta)| theta.is_nan() || **theta <= 0.0).unwrap_or((0, &0.0));
            return StepError::Inverted { step, time, particle, J: theta };
        }
        let particle = particles.F.iter().position(is_bad).unwrap_or(0);
        let J = determinant(&particles.F[particle]);
        let position = &particles.x[particle];
        if J.is_finite() && position.iter().all(|x| x.is_finite()) {
            StepError::Inverted { step, time, particle, J }
        } else {
            let position = position.iter().copied().collect();
            StepError::NotFinite { step, time, particle, position, J }
        }
    }
}

/// The projection of the change of volume, and the law that takes it.
#[derive(Clone, Debug)]
struct ProjectedChange<const D: usize> {
    law: Arc<dyn LawWithMemory<f64, D>>,
    of: Projection<D>,
    /// The projected change of volume of each particle.
    theta: Vec<f64>,
    /// The law's stress at the deformation gradient with this change.
    scaled: Vec<SMatrix<f64, D, D>>,
}

/// The internal variables of particles at time zero, those of a particle one after the other.
fn initial<const D: usize>(law: &Law<f64, D>, X: &[SVector<f64, D>]) -> Vec<f64> {
    match law {
        Law::WithMemory(law) => X.iter().flat_map(|X| law.initial(X)).collect(),
        Law::Library(_) | Law::Own(_) => Vec::new(),
    }
}

/// The Cartesian vector with these components in row `row` of particles.
fn cartesian<const D: usize>(
    rows: &[RowGeometry<D>],
    row: usize,
    components: &SVector<f64, D>,
) -> SVector<f64, D> {
    rows.get(row).map_or(*components, |row| row.frame * components)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::{Axis, End, Layout};
    use crate::basis::Basis;
    use crate::composition::Composition;
    use crate::coordinates::Coordinates;
    use crate::set_up::doubles;
    use mmsmith_vocabulary::ComponentCondition;

    /// The numbers that a simulation holds, counted.
    fn held<const D: usize>(body: &TotalLagrangian<D>) -> usize {
        let TotalLagrangian { particles, components, b, faces, .. } = body;
        let Particles { X, x, v, F, mass, volume, .. } = particles;
        let of_vectors = X.len() + x.len() + v.len() + b.len();
        let of_particles = D * of_vectors + D * D * F.len() + mass.len() + volume.len();
        let of_component = |component: &Component<D>| -> usize {
            let Component { u, v, a, given, values, slopes, partial, product, .. } = component;
            let arrays = [u, v, a, given, values].into_iter().chain(slopes);
            arrays.chain(partial.iter().flatten()).chain(product).map(Vec::len).sum()
        };
        let of_components: usize = components.iter().map(of_component).sum();
        let of_sides = |face: &Face<D>| {
            let vectors = face.X.len() + face.values.len() + D * face.frames.len();
            D * vectors + face.areas.len()
        };
        let rows = body.rows.len() * (D * D + 2) + body.reciprocal_radius.len();
        // A basis has values and slopes and the first function of each particle, a fit its weight and the matrix, and both the
        // fit and the mass the matrix's factors.
        let along = |basis: &Basis| 2 * basis.points * (2 * basis.width + 1);
        let of_component = |basis: &Basis| D * (basis.points + 3 * basis.functions * basis.width);
        let along = |[basis, _]: &[Basis; 2]| along(basis) + of_component(basis);
        let along: usize = body.operators.bases.iter().map(along).sum();
        let of_sides: usize = faces.iter().map(of_sides).sum();
        of_particles + of_components + of_sides + rows + along
    }

    #[test]
    fn a_grid_beyond_memory_is_refused_with_the_bytes_it_needs() {
        let axis = Axis { lower: 0.0, upper: 1.0, cells: 1 << 22, ends: [End::FREE; 2] };
        let mut grid = Grid {
            axes: [axis; 2],
            coordinates: Coordinates::Cartesian,
            per_cell: 3,
            layout: Layout::Lattice,
        };
        for cells in [1 << 22, 1 << 40] {
            grid.axes[1].cells = cells;
            let bytes = (8.0 * doubles(&grid, 2)) as u128;
            // A position alone takes sixteen.
            assert!(bytes > (16 * 9 * (cells as u128)) << 22);
            let cells = vec![1 << 22, cells];
            assert_eq!(reserve(&grid, 2, 0), Err(SetupError::GridTooLarge { cells, bytes }));
        }
        grid.axes = [Axis { cells: 4, ..axis }; 2];
        assert_eq!(reserve(&grid, 2, 0), Ok(()));
    }

    #[test]
    fn the_memory_asked_for_is_what_a_run_holds() {
        fn check<const D: usize>(
            coordinates: Coordinates,
            cells: [usize; D],
            ends: [[End; 2]; D],
            per_cell: usize,
            degree: usize,
        ) {
            let axes: [Axis; D] = array::from_fn(|k| {
                let (lower, upper) = (0.5, 1.0 + 0.5 * k as f64);
                Axis { lower, upper, cells: cells[k], ends: ends[k] }
            });
            let grid: Grid<D> = Grid { axes, coordinates, per_cell, layout: Layout::Gauss };
            let composition = Composition::Order2;
            let scheme = Scheme { degree, mass: MassMatrix::Consistent, composition };
            let expected = doubles(&grid, degree);
            let law = Material::NeoHookean { lambda: 6.0, mu: 4.0 };
            let mut body = TotalLagrangian::new(grid, scheme, law, 1.0, 1e-6).unwrap();
            let still = vec![SVector::zeros(); body.positions().len()];
            body.start(&still, &still).unwrap();
            assert_eq!(expected, held(&body) as f64, "{coordinates:?} {cells:?}");
        }
        const FREE: [End; 2] = [End::FREE; 2];
        const MOVED: [End; 2] = [End::MOVED; 2];
        const LOADED: [End; 2] = [End::LOADED; 2];
        let mixed = End::Open([
            ComponentCondition::PrescribedMotion,
            ComponentCondition::PrescribedTraction,
            ComponentCondition::TractionFree,
        ]);
        let cartesian = Coordinates::Cartesian;
        for degree in [2, 5] {
            check(cartesian, [400], [FREE], degree + 1, degree);
            check(cartesian, [50, 60], [FREE; 2], degree + 1, degree);
            check(cartesian, [14, 12, 10], [FREE; 3], degree + 1, degree);
            // Many coefficients between few particles, and long sides.
            check(cartesian, [1, 300], [LOADED, FREE], degree + 1, degree);
            check(cartesian, [300, 1], [FREE, MOVED], degree + 1, degree);
            check(cartesian, [7], [[End::MOVED, End::LOADED]], degree + 1, degree);
            check(cartesian, [1, 1, 200], [FREE, LOADED, FREE], degree + 1, degree);
            check(cartesian, [200, 1, 1], [FREE, FREE, LOADED], degree + 1, degree);
            check(cartesian, [1, 300], [FREE, [mixed; 2]], degree + 1, degree);
            check(Coordinates::Polar, [1, 300], [LOADED, FREE], degree + 1, degree);
            check(Coordinates::Polar, [300, 1], [FREE, LOADED], degree + 1, degree);
            check(Coordinates::Spherical, [1, 20, 20], [LOADED, FREE, FREE], degree + 1, degree);
        }
    }
}
