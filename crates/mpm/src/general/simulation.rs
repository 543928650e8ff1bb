//! The simulation: set up once, then stepped.

use bytemuck::{bytes_of_mut, cast_slice_mut};
use nalgebra::{SMatrix, SVector};

use super::body::{Body, Mesh};
use super::domain;
use super::nodes::{Field, Nodes, centre, g2p, g2p_gradient};
use super::settings::{Integrator, Settings, Shape, Transfer};
use super::stencil::{Entry, Raster, Stencils};
use crate::body_force::BodyForce;
use crate::error::{SetupError, StepError};
use crate::fault::{Fault, Planted};
use crate::grid::{Grid, Layout};
use crate::material::Material;
use crate::particles::Particles;
use crate::shape_function::HALF_SIZE_LIMIT;
use crate::tensor::{determinant, inverse_transpose, product};

/// A running simulation with any shape function, transfer and integrator.
///
/// Runs on the calling thread alone, so that its results do not depend on the number of threads.
#[derive(Clone, Debug)]
pub struct General<const D: usize> {
    grid: Grid<f64, D>,
    material: Material<f64>,
    settings: Settings,
    body: Body<D>,
    /// The affine part of each particle's velocity; empty without APIC.
    affine: Vec<SMatrix<f64, D, D>>,
    raster: Raster<D>,
    nodes: Nodes<D>,
    work: Work<D>,
    steps_done: usize,
    failed: Option<StepError>,
    planted: Planted,
}

/// Buffers of a step.
#[derive(Clone, Debug)]
struct Work<const D: usize> {
    /// Of the particles, and of the corners that they share.
    stencils: Stencils<D>,
    corner_stencils: Stencils<D>,
    b: Vec<SVector<f64, D>>,
    /// On the grid: velocities, accelerations, and the fields of the XPIC filter.
    v: Field<D>,
    a: Field<D>,
    filtered: Field<D>,
    term: Field<D>,
    /// Velocities at the particles.
    at_particles: Vec<SVector<f64, D>>,
}

/// Reasons why a particle is invalid, worst first: where one particle is inverted, others may follow in the same step.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
enum Invalid {
    Inverted { J: f64 },
    NotFinite,
    LeftGrid { axis: usize },
    TooLarge { axis: usize, half_size: f64 },
}

impl Invalid {
    fn rank(self) -> usize {
        match self {
            Self::Inverted { .. } => 0,
            Self::NotFinite => 1,
            Self::LeftGrid { .. } => 2,
            Self::TooLarge { .. } => 3,
        }
    }
}

impl<const D: usize> General<D> {
    /// Sets up a simulation at time 0.
    ///
    /// # Errors
    ///
    /// Where the scene makes no sense (see [`SetupError`]) or does not fit into memory.
    pub fn new(
        grid: Grid<f64, D>,
        mut body: Body<D>,
        material: Material<f64>,
        settings: Settings,
    ) -> Result<Self, SetupError> {
        const { assert!(1 <= D && D <= 3, "one, two or three dimensions") };
        check(&grid, &body, &settings)?;
        if settings.shape != Shape::Cpdi2 {
            // Nothing would move it.
            body.mesh = None;
        }
        let least = body.particles.mass.iter().copied().fold(f64::INFINITY, f64::min);
        let bytes_per_node = size_of::<f64>() + 4 * size_of::<SVector<f64, D>>();
        let layout = Layout::new(&grid, bytes_per_node)?;
        // Asking first turns a grid that is too large into an error instead of an abort.
        let bytes = layout.nodes * bytes_per_node;
        let refused =
            |_| SetupError::GridTooLarge { cells: grid.cells.to_vec(), bytes: bytes as u128 };
        Vec::<u8>::new().try_reserve_exact(bytes).map_err(refused)?;
        let raster = Raster::new(&grid, &layout);
        // Weights below the square of the rounding error only come about by rounding.
        let nodes = Nodes::new(layout, least * f64::EPSILON * f64::EPSILON);
        let field = || vec![SVector::zeros(); nodes.len()];
        let work = Work {
            stencils: Stencils::default(),
            corner_stencils: Stencils::default(),
            b: Vec::new(),
            v: field(),
            a: field(),
            filtered: field(),
            term: field(),
            at_particles: Vec::new(),
        };
        let mut simulation = Self {
            grid,
            material,
            settings,
            body,
            affine: Vec::new(),
            raster,
            nodes,
            work,
            steps_done: 0,
            failed: None,
            planted: Planted::here(),
        };
        if let Some(error) = simulation.worst_invalidity(0) {
            return Err(SetupError::InitialState(error));
        }
        simulation.start_affine();
        Ok(simulation)
    }

    /// Advances by one time step.
    ///
    /// # Errors
    ///
    /// Where a particle turns inside out, leaves the grid, grows too large or takes on values that are not finite. The
    /// particles then keep the state in which that was found, and every further call returns the same error.
    pub fn step(&mut self, body_force: &dyn BodyForce<f64, D>) -> Result<(), StepError> {
        if let Some(error) = &self.failed {
            return Err(error.clone());
        }
        let outcome = self.advance(body_force);
        if let Err(error) = &outcome {
            self.failed = Some(error.clone());
        }
        outcome
    }

    fn advance(&mut self, body_force: &dyn BodyForce<f64, D>) -> Result<(), StepError> {
        let dt = self.settings.time_step;
        // The share of the step by which F is updated before the forces.
        let early = match self.settings.integrator {
            Integrator::Usf => 1.0,
            Integrator::Usavg => 0.5,
            Integrator::Usl | Integrator::Musl | Integrator::Cd => 0.0,
        };
        let t = self.time();
        self.compute_weights();
        self.p2g_velocity();
        if early > 0.0 {
            self.g2p_stretch(early * dt);
            self.check_particles()?;
        }
        self.p2g_force(body_force, t);
        self.filter();
        let halved = self.settings.halve_first_acceleration && self.steps_done == 0;
        let scale = if halved { 0.5 } else { 1.0 };
        for (v, a) in self.work.v.iter_mut().zip(&mut self.work.a) {
            *a *= scale;
            *v += *a * dt;
        }
        self.g2p_velocity();
        self.g2p_position();
        if self.settings.integrator == Integrator::Musl {
            self.p2g_velocity();
        }
        if early < 1.0 {
            self.g2p_stretch((1.0 - early) * dt);
        }
        self.check_particles()?;
        self.steps_done += 1;
        Ok(())
    }

    /// The particles at the current time; their velocities lag by [`velocity_lag`](Self::velocity_lag).
    pub fn particles(&self) -> &Particles<f64, D> {
        &self.body.particles
    }

    /// The body: its particles and, for CPDI2, the corners of their domains.
    pub fn body(&self) -> &Body<D> {
        &self.body
    }

    /// Number of completed steps.
    pub fn steps_done(&self) -> usize {
        self.steps_done
    }

    /// Current time: completed steps times the time step.
    pub fn time(&self) -> f64 {
        self.settings.time_step * self.steps_done as f64
    }

    /// The material.
    pub fn material(&self) -> &Material<f64> {
        &self.material
    }

    /// The grid.
    pub fn grid(&self) -> &Grid<f64, D> {
        &self.grid
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// How far the particle velocities lag behind [`time`](Self::time): dt/2 for centred differences, else 0.
    ///
    /// With a halved first acceleration that holds from the first step on; the initial velocities are those at time 0.
    pub fn velocity_lag(&self) -> f64 {
        match self.settings.integrator {
            Integrator::Cd => self.settings.time_step * 0.5,
            _ => 0.0,
        }
    }

    /// The state between two steps, as slices of bytes in this machine's order; their number and lengths follow from the set-up.
    ///
    /// A copy of these bytes, written over the state of a simulation with the same set-up, continues the run to the same bits.
    pub fn state(&mut self) -> Vec<&mut [u8]> {
        let Particles { x, v, F, .. } = &mut self.body.particles;
        let mut state = vec![cast_slice_mut(x), cast_slice_mut(v), cast_slice_mut(F)];
        state.push(cast_slice_mut(&mut self.affine));
        state.extend(self.body.mesh.as_mut().map(|mesh| cast_slice_mut(&mut mesh.x)));
        state.push(bytes_of_mut(&mut self.steps_done));
        state
    }

    /// The weights of every particle, and P2G of mass.
    fn compute_weights(&mut self) {
        let Self { settings, body, raster, nodes, work, .. } = self;
        let Work { stencils, corner_stencils, .. } = work;
        list(settings.shape, raster, body, stencils, corner_stencils);
        nodes.p2g_mass(stencils, &body.particles.mass);
    }

    /// P2G of momentum: the particles' velocities on the grid.
    fn p2g_velocity(&mut self) {
        let Self { body, affine, raster, nodes, work, .. } = self;
        let Particles { v, mass, .. } = &body.particles;
        nodes.p2g_velocity(raster, &work.stencils, mass, v, affine, &mut work.v);
    }

    /// P2G of forces: accelerations on the grid, from the stresses of the present F.
    fn p2g_force(&mut self, body_force: &dyn BodyForce<f64, D>, t: f64) {
        let Self { body, material, nodes, work, .. } = self;
        let Particles { X, F, mass, volume, .. } = &body.particles;
        let forced = !body_force.is_absent();
        if forced {
            work.b.resize(X.len(), SVector::zeros());
            body_force.evaluate(0, X, t, &mut work.b);
        }
        let b = &work.b;
        nodes.p2g(&work.stencils, X.len(), &mut work.a, |p, entries, sums| {
            // The checks admitted deformations alone.
            let stress = material.kirchhoff(&F[p]).unwrap_or_else(SMatrix::zeros) * -volume[p];
            let weight = if forced { b[p] * mass[p] } else { SVector::zeros() };
            for entry in entries {
                sums[entry.node] += stress * entry.G + weight * entry.S;
            }
        });
    }

    /// The part of the grid's velocity that XPIC interpolates at the particles:
    /// `sum_k (-1)^(k+1) binomial(m, k) (S^+ S)^(k-1) v`, with `S^+` from particles to the grid.
    fn filter(&mut self) {
        let Transfer::Xpic(order) = self.settings.transfer else { return };
        let planted = self.planted;
        let Self { body, raster, nodes, work, .. } = self;
        let Work { stencils, v, filtered, term, at_particles, .. } = work;
        let mass = &body.particles.mass;
        let m = f64::from(order);
        let mut factor = m;
        term.clone_from(v);
        filtered.iter_mut().zip(&*term).for_each(|(sum, term)| *sum = term * factor);
        for k in 2..=order {
            at_particles.clear();
            at_particles.extend((0..mass.len()).map(|p| g2p(stencils.of(p), term)));
            nodes.p2g_velocity(raster, stencils, mass, at_particles, &[], term);
            let k = f64::from(k);
            let sign = if planted.is(Fault::XpicSign) { 1.0 } else { -1.0 };
            factor *= sign * (m - k + 1.0) / k;
            filtered.iter_mut().zip(&*term).for_each(|(sum, term)| *sum += term * factor);
        }
    }

    /// G2P of velocity, by the transfer.
    fn g2p_velocity(&mut self) {
        let (dt, planted) = (self.settings.time_step, self.planted);
        let Self { settings, body, affine, raster, work, .. } = self;
        let Work { stencils, v, a, filtered, .. } = work;
        for (p, particle_v) in body.particles.v.iter_mut().enumerate() {
            let entries = stencils.of(p);
            match settings.transfer {
                Transfer::Flip => *particle_v += g2p(entries, a) * dt,
                Transfer::Pic => *particle_v = g2p(entries, v),
                Transfer::Apic => {
                    *particle_v = g2p(entries, v);
                    if !planted.is(Fault::AffinePartDropped) {
                        affine[p] = affine_part(settings.shape, raster, entries, v);
                    }
                }
                Transfer::Xpic(_) => {
                    *particle_v = g2p(entries, filtered) + g2p(entries, a) * dt;
                }
            }
        }
    }

    /// G2P of position: particles and corners move with the grid.
    fn g2p_position(&mut self) {
        let (dt, planted) = (self.settings.time_step, self.planted);
        let Self { settings, body, work, .. } = self;
        for (p, x) in body.particles.x.iter_mut().enumerate() {
            *x += g2p(work.stencils.of(p), &work.v) * dt;
        }
        if let (Shape::Cpdi2, Some(mesh)) = (settings.shape, &mut body.mesh) {
            for (k, x) in mesh.x.iter_mut().enumerate() {
                if planted.is(Fault::CornersStay) {
                    break;
                }
                *x += g2p(work.corner_stencils.of(k), &work.v) * dt;
            }
        }
    }

    /// G2P of F: the particles stretch with the grid for a time.
    fn g2p_stretch(&mut self, time: f64) {
        let Self { body, work, .. } = self;
        for (p, F) in body.particles.F.iter_mut().enumerate() {
            let L = g2p_gradient(work.stencils.of(p), &work.v);
            *F += product(&(L * time), F);
        }
    }

    /// At the start the affine parts are those of the particles' velocities on the grid.
    fn start_affine(&mut self) {
        if self.settings.transfer != Transfer::Apic {
            return;
        }
        self.compute_weights();
        self.p2g_velocity();
        let Self { settings, raster, work, .. } = self;
        let part = |p| affine_part(settings.shape, raster, work.stencils.of(p), &work.v);
        self.affine = (0..self.body.particles.len()).map(part).collect();
    }

    /// An error if some particle is invalid.
    fn check_particles(&self) -> Result<(), StepError> {
        self.worst_invalidity(self.steps_done + 1).map_or(Ok(()), Err)
    }

    /// The worst reason for which a particle is invalid, if any, as an error of step `step`.
    fn worst_invalidity(&self, step: usize) -> Option<StepError> {
        let Particles { x, F, .. } = &self.body.particles;
        let (particle, invalid) = (0..x.len())
            .filter_map(|p| self.invalidity(p).map(|invalid| (p, invalid)))
            .min_by_key(|(p, invalid)| (invalid.rank(), *p))?;
        let time = self.settings.time_step * step as f64;
        let position = || x[particle].iter().copied().collect();
        Some(match invalid {
            Invalid::Inverted { J } => StepError::Inverted { step, time, particle, J },
            Invalid::NotFinite => {
                let J = determinant(&F[particle]);
                StepError::NotFinite { step, time, particle, position: position(), J }
            }
            Invalid::LeftGrid { axis } => {
                let (lower, upper) = (self.raster.lower[axis], self.raster.upper[axis]);
                let position = position();
                StepError::LeftGrid { step, time, particle, position, axis, lower, upper }
            }
            Invalid::TooLarge { axis, half_size } => {
                let limit = HALF_SIZE_LIMIT * self.raster.spacing;
                StepError::TooLarge { step, time, particle, axis, half_size, limit }
            }
        })
    }

    fn invalidity(&self, p: usize) -> Option<Invalid> {
        let Particles { x, F, .. } = &self.body.particles;
        let (x, F) = (&x[p], &F[p]);
        let J = determinant(F);
        if J <= 0.0 {
            return Some(Invalid::Inverted { J });
        }
        if !J.is_finite() || x.iter().any(|x| !x.is_finite()) {
            return Some(Invalid::NotFinite);
        }
        if let Some(axis) = self.raster.axis_outside(x) {
            return Some(Invalid::LeftGrid { axis });
        }
        let E = &self.body.half_edges[p];
        let half_size = match (self.settings.shape, &self.body.mesh) {
            (Shape::Linear | Shape::Bspline2 | Shape::Bspline3, _) => return None,
            (Shape::Ugimp, _) => E.diagonal(),
            (Shape::Gimp, _) => SVector::from_fn(|a, _| (E[(a, a)] * F[(a, a)]).abs()),
            (Shape::Cpdi, _) | (Shape::Cpdi2, None) => domain::extent(&product(F, E)),
            (Shape::Cpdi2, Some(mesh)) => {
                let corners = mesh.corners[p].map(|k| mesh.x[k]);
                let (_, volume) = domain::of_polygon(&corners);
                if volume <= 0.0 {
                    let J = volume / self.body.particles.volume[p];
                    return Some(Invalid::Inverted { J });
                }
                if !volume.is_finite() {
                    return Some(Invalid::NotFinite);
                }
                let furthest = |a: usize| {
                    corners[..1 << D].iter().map(|c| (c[a] - x[a]).abs()).fold(0.0, f64::max)
                };
                SVector::from_fn(|a, _| furthest(a))
            }
        };
        let limit = HALF_SIZE_LIMIT * self.raster.spacing;
        (0..D)
            .find(|&a| half_size[a] > limit)
            .map(|axis| Invalid::TooLarge { axis, half_size: half_size[axis] })
    }
}

/// Lists the nodes of every particle and, for CPDI2, of every corner.
pub(super) fn list<const D: usize>(
    shape: Shape,
    raster: &Raster<D>,
    body: &Body<D>,
    stencils: &mut Stencils<D>,
    corner_stencils: &mut Stencils<D>,
) {
    let Particles { x, F, .. } = &body.particles;
    stencils.clear();
    match (shape, &body.mesh) {
        (Shape::Cpdi2, Some(mesh)) => {
            corner_stencils.clear();
            for x in &mesh.x {
                raster.hats(x, |entry| corner_stencils.push(entry));
                corner_stencils.finish();
            }
            for indices in &mesh.corners {
                let (corners, _) = domain::of_polygon(&indices.map(|k| mesh.x[k]));
                for (corner, &index) in corners.iter().zip(&indices[..1 << D]) {
                    for hat in corner_stencils.of(index) {
                        stencils.push(corner.share(hat));
                    }
                }
                stencils.finish();
            }
        }
        (Shape::Cpdi, _) => {
            for ((x, F), E) in x.iter().zip(F).zip(&body.half_edges) {
                let E = product(F, E);
                for index in 0..1 << D {
                    let corner = domain::of_parallelogram(x, &E, index);
                    raster.hats(&corner.x, |hat| stencils.push(corner.share(&hat)));
                }
                stencils.finish();
            }
        }
        (shape, _) => {
            for ((x, F), E) in x.iter().zip(F).zip(&body.half_edges) {
                let (half_size, stretch) = (E.diagonal(), F.diagonal());
                raster.list(shape, x, &half_size, &stretch, |entry| stencils.push(entry));
                stencils.finish();
            }
        }
    }
}

impl<const D: usize> domain::Corner<D> {
    /// The contribution of a hat function at the corner to its mean over the domain.
    fn share(&self, hat: &Entry<D>) -> Entry<D> {
        Entry { node: hat.node, S: hat.S * self.w, G: self.g * hat.S }
    }
}

/// The affine part of a field around a particle, `B D^-1` with `B = sum S v r^T`, `D = sum S r r^T`, r from the particle to
/// its nodes.
pub(super) fn affine_part<const D: usize>(
    shape: Shape,
    raster: &Raster<D>,
    entries: &[Entry<D>],
    field: &Field<D>,
) -> SMatrix<f64, D, D> {
    if shape == Shape::Linear {
        return g2p_gradient(entries, field);
    }
    let centre = centre(raster, entries);
    let (mut B, mut inertia) = (SMatrix::<f64, D, D>::zeros(), SMatrix::<f64, D, D>::zeros());
    for entry in entries {
        let arm = raster.node(entry.node) - centre;
        B += field[entry.node] * (arm * entry.S).transpose();
        inertia += arm * (arm * entry.S).transpose();
    }
    B * inverse_transpose(&inertia, determinant(&inertia))
}

fn check<const D: usize>(
    grid: &Grid<f64, D>,
    body: &Body<D>,
    settings: &Settings,
) -> Result<(), SetupError> {
    let positive = |quantity: &dyn Fn() -> String, value: f64| {
        if value > 0.0 && value.is_finite() {
            return Ok(());
        }
        Err(SetupError::NotPositive { quantity: quantity(), value })
    };
    positive(&|| "the grid's spacing".into(), grid.spacing)?;
    positive(&|| "the time step".into(), settings.time_step)?;
    if settings.transfer == Transfer::Xpic(0) {
        let quantity = "the order of XPIC".into();
        return Err(SetupError::NotPositive { quantity, value: 0.0 });
    }
    if settings.halve_first_acceleration && settings.integrator != Integrator::Cd {
        let integrator = settings.integrator.to_string();
        return Err(SetupError::HalvedStart { integrator });
    }
    let Particles { X, x, v, F, mass, volume, .. } = &body.particles;
    let expected = X.len();
    for (array, found) in [
        ("x", x.len()),
        ("v", v.len()),
        ("F", F.len()),
        ("mass", mass.len()),
        ("volume", volume.len()),
        ("half_edges", body.half_edges.len()),
        ("corners", body.mesh.as_ref().map_or(expected, |mesh| mesh.corners.len())),
    ] {
        if found != expected {
            return Err(SetupError::LengthMismatch { array, found, expected });
        }
    }
    if expected == 0 {
        return Err(SetupError::NoParticles);
    }
    for p in 0..expected {
        positive(&|| format!("the mass of particle {p}"), mass[p])?;
        positive(&|| format!("the volume of particle {p}"), volume[p])?;
        let finite = [("reference position", &X[p]), ("velocity", &v[p])];
        if let Some((name, _)) = finite.iter().find(|(_, v)| v.iter().any(|v| !v.is_finite())) {
            return Err(SetupError::NotFinite { quantity: format!("the {name} of particle {p}") });
        }
        let E = &body.half_edges[p];
        match settings.shape {
            Shape::Ugimp | Shape::Gimp => {
                let aligned = (0..D).all(|i| (0..D).all(|k| i == k || E[(i, k)] == 0.0));
                if !aligned {
                    return Err(SetupError::NotABox { particle: p });
                }
                for a in 0..D {
                    let quantity = || format!("the half-size of particle {p} along axis {a}");
                    positive(&quantity, E[(a, a)])?;
                }
            }
            Shape::Cpdi => {
                positive(&|| format!("the domain of particle {p}"), determinant(E))?;
            }
            _ => {}
        }
    }
    match &body.mesh {
        _ if settings.shape != Shape::Cpdi2 => Ok(()),
        Some(mesh) if D <= 2 => check_corners(mesh),
        _ => Err(SetupError::NoCorners { dimension: D }),
    }
}

fn check_corners<const D: usize>(mesh: &Mesh<D>) -> Result<(), SetupError> {
    let (expected, found) = (mesh.X.len(), mesh.x.len());
    if found != expected {
        return Err(SetupError::LengthMismatch { array: "x of the corners", found, expected });
    }
    let mut idle = vec![true; expected];
    for &corner in mesh.corners.iter().flat_map(|corners| &corners[..1 << D]) {
        *idle.get_mut(corner).ok_or(SetupError::NoSuchCorner { corner, corners: expected })? =
            false;
    }
    match idle.iter().position(|&idle| idle) {
        Some(corner) => Err(SetupError::IdleCorner { corner }),
        None => Ok(()),
    }
}
