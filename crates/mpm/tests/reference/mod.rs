//! The scheme of the solver once more, as plainly as possible: every particle has a list of its nodes with weights and
//! gradients, and P2G and G2P are sums over these lists.
//!
//! It takes no more than data and material laws from the solver.

mod polygons;
#[cfg(test)]
mod tests;
mod weights;

use mmsmith_mpm::{
    Body, BodyForce, Grid, Integrator, Law, Material, Particles, Scalar, Settings, Shape, Transfer,
};
use nalgebra::{SMatrix, SVector};

use polygons::{corners, polygons};
use weights::{Entry, List, Nodes, determinant, domain, half_size, inverse, means};

/// The share of a cell's mass below which a node is light.
const LIGHT: f64 = 0.01;

/// A vector at every node.
type Field<const D: usize> = Vec<SVector<f64, D>>;

/// Largest half-size of a box or domain, in cells.
const HALF_SIZE_LIMIT: f64 = 2.0;

/// A running simulation.
#[derive(Clone, Debug)]
pub(crate) struct Reference<const D: usize> {
    grid: Grid<f64, D>,
    nodes: Nodes<D>,
    body: Body<f64, D>,
    material: Material<f64>,
    settings: Settings<f64>,
    /// The affine part of each particle's velocity; empty without APIC.
    affine: Vec<SMatrix<f64, D, D>>,
    steps_done: usize,
    /// The nodes of each particle and of each corner of the mesh in the step under way, and the nodes' masses.
    particles: Vec<List<D>>,
    corners: Vec<List<D>>,
    mass: Vec<f64>,
    /// Polygons with hat functions: the nodes that next to nothing reaches, and the inner ones whose values they continue.
    light: Vec<(usize, Vec<(usize, f64)>)>,
}

impl<const D: usize> Reference<D>
where
    f64: Scalar<D>,
{
    /// Sets up at time 0. The scene must be one that the solver admits.
    pub(crate) fn new(
        grid: Grid<f64, D>,
        mut body: Body<f64, D>,
        material: Material<f64>,
        settings: Settings<f64>,
    ) -> Self {
        if settings.shape != Shape::Cpdi2 && polygons(&body).is_none() {
            // Nothing would move it.
            body.mesh = None;
        }
        let mut this = Self {
            nodes: Nodes::new(&grid),
            grid,
            body,
            material,
            settings,
            affine: Vec::new(),
            steps_done: 0,
            particles: Vec::new(),
            corners: Vec::new(),
            mass: Vec::new(),
            light: Vec::new(),
        };
        if settings.transfer == Transfer::Apic {
            // At the start the affine parts are those of the particles' velocities on the grid.
            this.p2g_mass();
            let v = this.p2g_velocity(&this.body.particles.v, &[]);
            this.affine = this.affine_parts(&v);
        }
        this
    }

    /// Advances by a time step; the error says which particle is invalid, and why.
    pub(crate) fn step(&mut self, body_force: &dyn BodyForce<f64, D>) -> Result<(), String> {
        let dt = self.settings.time_step;
        // The share of the step by which F is updated before the forces.
        let early = match self.settings.integrator {
            Integrator::Usf => 1.0,
            Integrator::Usavg => 0.5,
            _ => 0.0,
        };
        self.p2g_mass();
        let mut v = self.p2g_velocity(&self.body.particles.v, &self.affine);
        if early > 0.0 {
            self.stretch(&v, early * dt);
            self.check()?;
        }
        let mut a = self.accelerations(body_force);
        if self.settings.halve_first_acceleration && self.steps_done == 0 {
            a.iter_mut().for_each(|a| *a *= 0.5);
        }
        let filtered = self.filtered(&v);
        for (v, a) in v.iter_mut().zip(&a) {
            *v += a * dt;
        }
        self.update_velocities(&v, &a, &filtered);
        self.update_positions(&v);
        if self.settings.integrator == Integrator::Musl {
            v = self.p2g_velocity(&self.body.particles.v, &self.affine);
        }
        if early < 1.0 {
            self.stretch(&v, (1.0 - early) * dt);
        }
        self.check()?;
        self.steps_done += 1;
        Ok(())
    }

    /// The body at the current time.
    pub(crate) fn body(&self) -> &Body<f64, D> {
        &self.body
    }

    /// The number of nodes that continue others, in the last step.
    pub(crate) fn light(&self) -> usize {
        self.light.len()
    }

    /// The particles at the current time; with centred differences their velocities lag by half a step.
    pub(crate) fn particles(&self) -> &Particles<f64, D> {
        &self.body.particles
    }

    /// Completed steps times the time step.
    pub(crate) fn time(&self) -> f64 {
        self.settings.time_step * self.steps_done as f64
    }

    /// The nodes of all particles and corners, and P2G of mass: zero at nodes that no particle reaches.
    fn p2g_mass(&mut self) {
        let (shape, body, places) = (self.settings.shape, &self.body, self.nodes.places());
        self.particles = (0..body.particles.len()).map(|p| self.nodes.of(shape, body, p)).collect();
        let corners = body.mesh.iter().flat_map(|mesh| {
            (0..mesh.x.len()).map(|corner| self.nodes.at_corner(shape, mesh, corner))
        });
        self.corners = corners.collect();
        let mass = &body.particles.mass;
        self.mass = vec![0.0; places.len()];
        for (list, m) in self.particles.iter().zip(mass) {
            for entry in list {
                self.mass[places[entry.node].node] += m * entry.S;
            }
        }
        // Less than this comes about by rounding alone.
        let least = mass.iter().copied().fold(f64::INFINITY, f64::min) * f64::EPSILON.powi(2);
        self.mass.iter_mut().filter(|mass| **mass <= least).for_each(|mass| *mass = 0.0);
        if polygons(body).is_some() && shape == Shape::Cpdi2 {
            assert!(self.grid.walls.iter().flatten().all(|wall| !wall), "mirror images have none");
            let densities = mass.iter().zip(&body.particles.volume).map(|(m, V)| m / V);
            let of_cell =
                densities.fold(f64::INFINITY, f64::min) * self.grid.spacing.powi(D as i32);
            self.light = self.nodes.light(&self.mass, LIGHT * of_cell);
            for (node, inner) in &self.light {
                let mass = self.mass[*node];
                inner.iter().for_each(|(node, share)| self.mass[*node] += mass * share);
            }
        }
    }

    /// P2G of what each particle gives to its nodes, divided by the nodes' masses.
    fn p2g(&self, give: impl Fn(usize, &Entry<D>) -> SVector<f64, D>) -> Field<D> {
        let places = self.nodes.places();
        let mut sums = vec![SVector::zeros(); places.len()];
        for (p, list) in self.particles.iter().enumerate() {
            for entry in list {
                let place = &places[entry.node];
                sums[place.node] += give(p, entry).component_mul(&place.signs);
            }
        }
        for (node, inner) in &self.light {
            let sum = sums[*node];
            inner.iter().for_each(|(node, share)| sums[*node] += sum * *share);
        }
        for (sum, &mass) in sums.iter_mut().zip(&self.mass) {
            *sum = if mass > 0.0 { *sum / mass } else { SVector::zeros() };
        }
        for (node, inner) in &self.light {
            sums[*node] = inner.iter().map(|(node, share)| sums[*node] * *share).sum();
        }
        self.nodes.mirrored(&sums)
    }

    /// The grid's velocities for particles with velocities `v` and affine parts `C` about their centres, or none.
    fn p2g_velocity(&self, v: &[SVector<f64, D>], C: &[SMatrix<f64, D, D>]) -> Field<D> {
        let centres: Vec<_> = self.particles.iter().map(centre).collect();
        self.p2g(|p, entry| {
            let here = C.get(p).map_or(v[p], |C| v[p] + C * (entry.x - centres[p]));
            here * (self.body.particles.mass[p] * entry.S)
        })
    }

    /// The grid's accelerations, by the stresses of the present F and the body force.
    fn accelerations(&self, body_force: &dyn BodyForce<f64, D>) -> Field<D> {
        let Particles { X, F, mass, volume, .. } = &self.body.particles;
        let mut b = vec![SVector::zeros(); X.len()];
        if !body_force.is_absent() {
            body_force.evaluate(0, X, self.time(), &mut b);
        }
        // The check admits deformations alone.
        let stress =
            |F| Law::<f64, D>::from(self.material).kirchhoff(F).unwrap_or_else(SMatrix::zeros);
        let stresses: Vec<_> = F.iter().map(stress).collect();
        self.p2g(|p, entry| b[p] * (mass[p] * entry.S) - stresses[p] * entry.G * volume[p])
    }

    /// The part of the grid's velocity that XPIC of order m interpolates at the particles:
    /// `sum_k (-1)^(k+1) binomial(m, k) (S^+ S)^(k-1) v`, with `S^+` from particles to the grid.
    fn filtered(&self, v: &Field<D>) -> Field<D> {
        let mut sum = vec![SVector::zeros(); v.len()];
        let Transfer::Xpic(m) = self.settings.transfer else { return sum };
        let (mut term, mut factor) = (v.clone(), f64::from(m));
        for k in 1..=m {
            for (sum, term) in sum.iter_mut().zip(&term) {
                *sum += term * factor;
            }
            let at_particles: Vec<_> = self.particles.iter().map(|list| g2p(list, &term)).collect();
            term = self.p2g_velocity(&at_particles, &[]);
            factor *= -f64::from(m - k) / f64::from(k + 1);
        }
        sum
    }

    /// G2P of velocity, by the transfer.
    fn update_velocities(&mut self, v: &Field<D>, a: &Field<D>, filtered: &Field<D>) {
        let dt = self.settings.time_step;
        for (particle, list) in self.body.particles.v.iter_mut().zip(&self.particles) {
            *particle = match self.settings.transfer {
                Transfer::Flip => *particle + g2p(list, a) * dt,
                Transfer::Pic | Transfer::Apic => g2p(list, v),
                Transfer::Xpic(_) => g2p(list, filtered) + g2p(list, a) * dt,
            };
        }
        if self.settings.transfer == Transfer::Apic {
            self.affine = self.affine_parts(v);
        }
    }

    fn affine_parts(&self, v: &Field<D>) -> Vec<SMatrix<f64, D, D>> {
        // That of a polygon is its gradient.
        let is_gradient = self.settings.shape == Shape::Linear || polygons(&self.body).is_some();
        self.particles.iter().map(|list| affine_part(is_gradient, list, v)).collect()
    }

    /// Particles and corners move with the grid.
    fn update_positions(&mut self, v: &Field<D>) {
        let corners = self.body.mesh.iter_mut().flat_map(|mesh| &mut mesh.x);
        let lists = self.particles.iter().chain(&self.corners);
        for (x, list) in self.body.particles.x.iter_mut().chain(corners).zip(lists) {
            *x += g2p(list, v) * self.settings.time_step;
        }
    }

    /// The particles stretch with the grid for a time.
    fn stretch(&mut self, v: &Field<D>, time: f64) {
        for (F, list) in self.body.particles.F.iter_mut().zip(&self.particles) {
            *F += gradient(list, v) * *F * time;
        }
    }

    /// The worst reason for which a particle is invalid, and the first particle with it.
    fn check(&self) -> Result<(), String> {
        let invalid = (0..self.body.particles.len()).filter_map(|p| Some((self.reason(p)?, p)));
        match invalid.min() {
            Some(((_, reason), p)) => Err(format!("particle {p} {reason}")),
            None => Ok(()),
        }
    }

    /// Why a particle is invalid, if it is, with the rank of the reason.
    fn reason(&self, p: usize) -> Option<(usize, &'static str)> {
        let (x, F) = (&self.body.particles.x[p], &self.body.particles.F[p]);
        let shape = self.settings.shape;
        let mut volumes = vec![determinant(F)];
        if let (Shape::Cpdi2, Some(corners)) = (shape, domain(shape, &self.body, p)) {
            volumes.push(means(&corners).1);
        }
        if let Some(mesh) = polygons(&self.body) {
            volumes.push(corners(mesh, p).1);
        }
        let (lower, upper) = (self.grid.lower, self.grid.upper());
        let limit = HALF_SIZE_LIMIT * self.grid.spacing;
        // Corners of its own may be as far outside as there are nodes.
        let corners = if shape == Shape::Cpdi2 { domain(shape, &self.body, p) } else { None };
        let is_beyond = |a: usize| {
            let mut corners = corners.iter().flatten();
            corners.any(|x| x[a] < lower[a] - limit || x[a] > upper[a] + limit)
        };
        if volumes.iter().any(|volume| *volume <= 0.0) {
            Some((0, "is inverted"))
        } else if x.iter().chain(&volumes).any(|number| !number.is_finite()) {
            Some((1, "is not finite"))
        } else if (0..D).any(|a| x[a] < lower[a] || x[a] > upper[a] || is_beyond(a)) {
            Some((2, "has left the grid"))
        } else {
            let is_limited = shape != Shape::Cpdi2;
            // Splines reach half a cell further than hat functions.
            let beyond = if shape == Shape::GimpBspline2 { 0.5 * self.grid.spacing } else { 0.0 };
            let too_large = is_limited && half_size(shape, &self.body, p).max() > limit - beyond;
            too_large.then_some((3, "is too large"))
        }
    }
}

/// The mean position of a particle's nodes: its own, or its domain's centroid.
fn centre<const D: usize>(list: &List<D>) -> SVector<f64, D> {
    list.iter().map(|entry| entry.x * entry.S).sum()
}

/// G2P: a field at a particle.
fn g2p<const D: usize>(list: &List<D>, field: &Field<D>) -> SVector<f64, D> {
    list.iter().map(|entry| field[entry.node] * entry.S).sum()
}

/// G2P: the gradient `dv_i/dx_j` of a field at a particle.
fn gradient<const D: usize>(list: &List<D>, field: &Field<D>) -> SMatrix<f64, D, D> {
    list.iter().map(|entry| field[entry.node] * entry.G.transpose()).sum()
}

/// The affine part of a field around a particle, `B I^-1` with `B = sum S v r^T` and `I = sum S r r^T`, r from the centre to the
/// nodes. For hat functions at a point `I` may be singular; there it is the gradient.
fn affine_part<const D: usize>(
    is_gradient: bool,
    list: &List<D>,
    field: &Field<D>,
) -> SMatrix<f64, D, D> {
    if is_gradient {
        return gradient(list, field);
    }
    let centre = centre(list);
    let moment = |of: &dyn Fn(&Entry<D>) -> SVector<f64, D>| -> SMatrix<f64, D, D> {
        list.iter().map(|entry| of(entry) * (entry.x - centre).transpose() * entry.S).sum()
    };
    moment(&|entry| field[entry.node]) * inverse(&moment(&|entry| entry.x - centre))
}
