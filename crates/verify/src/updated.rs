//! Runs in the updated Lagrangian formulation: from a solution to a grid, particles with their domains, and their motion.

use std::cell::Cell;
use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::Arc;

use mmsmith_clip::{Clip, Facet, Side};
use mmsmith_laws::Hoop;
use mmsmith_mpm::{
    Annulus, Body, EVERY_SCHEME, Integrator, Law, Load, Mesh, Particles, Settings, Shape, Share,
    Solver,
};
use mmsmith_ranks::{Ranks, total};
use mmsmith_runtime::{Domain, Real, Solution};
use nalgebra::SVector;

use crate::case::{Case, Extent, law_of};
use crate::error::{CaseError, SceneError};
use crate::precision::Precision;
use crate::scene::Scene;
use crate::scheme::{Placement, Start, Updated};

/// Refuses what makes no sense on this scene.
pub(crate) fn admit<const D: usize>(scene: &Scene<D>, updated: &Updated) -> Result<(), CaseError> {
    let instead = match (updated.placement, &scene.domain) {
        (Placement::Lattice { .. }, _) => return Ok(()),
        (Placement::BodyFitted, Domain::Annulus { .. }) if D == 2 => return Ok(()),
        (Placement::Clipped { .. }, Domain::Annulus { .. } | Domain::Box { .. }) if D > 1 => {
            return Ok(());
        }
        (Placement::Clipped { .. }, _) => "lattice for a body on a line",
        (Placement::BodyFitted, Domain::Annulus { .. }) => "lattice for a shell",
        (Placement::BodyFitted, _) => "lattice for a box, which that fits",
    };
    Err(CaseError::setting("layout", updated.placement.name(), instead))
}

/// About how many bytes a run keeps, for values of `scalar` bytes, where the exact fields keep `exact` bytes of each particle.
pub(crate) fn bytes_expected<const D: usize>(
    scene: &Scene<D>,
    updated: &Updated,
    per_cell: usize,
    scalar: usize,
    exact: usize,
) -> f64 {
    // Numbers of a particle, and of a node, that other schemes than those of one pass with boxes keep beside those.
    let of_shape = match updated.shape {
        Shape::Cpdi => D * D,
        // Corners, in three configurations, are as many as particles; a domain has eight indices.
        Shape::Cpdi2 => 3 * D + D * D + size_of::<[u32; 8]>() / scalar,
        _ => 0,
    };
    // Corners and what they pass on, four or eight or more shares of a particle, and the corners and ends of six or more faces.
    let (shares, of_faces) = if D == 3 { (8, 6 * 5) } else { (4, 0) };
    let of_polygons = 3 * D + 3 * 8 + D * D + shares * (D + 5) + of_faces;
    let of_shape = if updated.placement.is_clipped() { of_polygons } else { of_shape };
    let of_transfer = if updated.transfer.is_affine() { D * D } else { 0 };
    let of_node = if updated.transfer.is_filtered() { D + 8 } else { 0 };
    let particles = scene.particles_expected(per_cell);
    scene.bytes_expected(per_cell, scalar, exact)
        + scalar as f64
            * (particles * (of_shape + of_transfer) as f64 + scene.nodes() * of_node as f64)
}

/// The particles `own(count)` of a body that a lattice clipped with its boundary makes, at rest.
fn clipped<T: Precision<D>, const D: usize>(
    scene: &Scene<D>,
    placement: Placement,
    per_cell: usize,
    density: f64,
    own: &dyn Fn(usize) -> Range<usize>,
) -> Result<Body<T, D>, CaseError> {
    let clip = Clip {
        sides: scene.boundary.iter().map(|part| part.side).collect(),
        turn: scene.turn,
        offset: placement.offset(),
    };
    let (mut body, facets) =
        mmsmith_clip::part::<T, D>(&scene.grid(), per_cell, density, &clip, own)?;
    if let Some(mesh) = &mut body.mesh {
        let (grid, near) = (scene.grid::<T>(), T::nearest(1e-9 * scene.spacing));
        for (a, walls) in scene.walls.iter().enumerate() {
            for (is_wall, wall) in walls.iter().zip([grid.lower[a], grid.upper()[a]]) {
                for X in mesh.X.iter_mut().filter(|_| *is_wall) {
                    if (X[a] - wall).abs() <= near {
                        X[a] = wall;
                    }
                }
            }
        }
        for Facet { side, corners, number } in facets {
            let part = &scene.boundary[side];
            if !part.is_loaded {
                continue;
            }
            let ends = corners.map(|corner| mesh.X[corner as usize].map(Real::to_f64));
            for ((X, shares), point) in load_points(part.side, ends).into_iter().zip(0..) {
                let (X, shares) = (X.map(Real::nearest), shares.map(Real::nearest));
                mesh.loads.push(Load { corners, shares, X });
                // A facet has three of these points at most.
                mesh.numbers.iter_mut().for_each(|own| own.loads.push(4 * number + point));
            }
        }
        mesh.x.clone_from(&mesh.X);
    }
    Ok(body)
}

/// The points of an edge or a triangle between corners of a side at which loads act, with the shares that they give to each corner: two
/// Gauss points, or the middles of three edges.
fn load_points<const D: usize>(
    side: Side<D>,
    corners: [SVector<f64, D>; D],
) -> Vec<(SVector<f64, D>, [f64; D])> {
    let away = 0.5 / 3.0_f64.sqrt();
    let weights: Vec<[f64; D]> = match D {
        2 => [0.5 - away, 0.5 + away]
            .map(|s| std::array::from_fn(|k| if k == 0 { 1.0 - s } else { s }))
            .into(),
        _ => (0..D).map(|k| std::array::from_fn(|n| if n == k { 0.0 } else { 0.5 })).collect(),
    };
    let count = weights.len() as f64;
    let of_point = |weights: [f64; D]| {
        let flat: SVector<f64, D> = corners.iter().zip(weights).map(|(X, weight)| X * weight).sum();
        let X = match side {
            Side::Straight { .. } => flat,
            Side::Outer { radius } | Side::Inner { radius } => flat.normalize() * radius,
        };
        (X, weights.map(|weight| weight / count))
    };
    weights.into_iter().map(of_point).collect()
}

/// The share of a body of `count` particles that a process begins with: as many as each other one does, in the order of their numbers.
fn share_of(count: usize, ranks: &Arc<dyn Ranks>) -> Share {
    let first = |rank: usize| (count * rank / ranks.count()) as u64;
    let ids = (first(ranks.rank())..first(ranks.rank() + 1)).collect();
    Share { ranks: ranks.clone(), ids }
}

/// The number of particles of a lattice in a body.
fn count_lattice<const D: usize>(scene: &Scene<D>, per_cell: usize, offset: f64) -> usize {
    let inside = scene.inside(per_cell, offset);
    let count = Cell::new(0);
    // None is kept.
    let _ = Particles::<f64, D>::lattice(&scene.grid(), per_cell, 1.0, |X| {
        count.set(count.get() + usize::from(inside(X)));
        false
    });
    count.get()
}

/// The numbers of the particles of a share, which follow each other.
fn numbers(share: &Share) -> Range<usize> {
    let first = share.ids.first().map_or(0, |id| *id as usize);
    first..first + share.ids.len()
}

/// The body of a case at rest in the reference configuration; where there are several processes, the share of it that this one begins
/// with.
fn body<T: Precision<D>, const D: usize>(
    scene: &Scene<D>,
    updated: &Updated,
    per_cell: usize,
    density: f64,
    ranks: Option<&Arc<dyn Ranks>>,
) -> Result<(Body<T, D>, Option<Share>), CaseError> {
    let counted = Cell::new(0);
    let own = |count: usize| {
        counted.set(count);
        ranks.map_or(0..count, |ranks| numbers(&share_of(count, ranks)))
    };
    let with_share = |mut body: Body<T, D>| {
        let share = ranks.map(|ranks| share_of(counted.get(), ranks));
        if share.is_none()
            && let Some(mesh) = &mut body.mesh
        {
            mesh.numbers = None;
        }
        (body, share)
    };
    let (grid, exact_density, density) = (scene.grid::<T>(), density, T::nearest(density));
    let offset = match (updated.placement, &scene.domain) {
        (Placement::BodyFitted, &Domain::Annulus { inner, outer }) if EVERY_SCHEME => {
            let quarter = scene.extent() == Some(Extent::Quarter);
            let ring = Annulus { inner: T::nearest(inner), outer: T::nearest(outer), quarter };
            let body = Body::annulus_part(&ring, grid.spacing, per_cell, density, &own)?;
            return Ok(with_share(body));
        }
        (placement @ Placement::Clipped { .. }, _) if EVERY_SCHEME => {
            return Ok(with_share(clipped(scene, placement, per_cell, exact_density, &own)?));
        }
        (placement, _) => placement.offset(),
    };
    let share = ranks.map(|ranks| share_of(count_lattice(scene, per_cell, offset), ranks));
    let inside = scene.inside(per_cell, offset);
    let next = Cell::new(0);
    let own = share.as_ref().map(numbers);
    let inside = |X: &SVector<T, D>| {
        let is_inside = inside(X);
        let number = next.replace(next.get() + usize::from(is_inside));
        is_inside && own.as_ref().is_none_or(|own| own.contains(&number))
    };
    let mut body = match updated.shape {
        Shape::Cpdi2 if EVERY_SCHEME => Body::lattice(&grid, per_cell, density, inside),
        _ => Particles::lattice(&grid, per_cell, density, inside).into(),
    };
    if offset != 0.0 {
        let distance = scene.spacing / per_cell as f64;
        let shift: SVector<T, D> = SVector::repeat(T::nearest(offset * distance));
        let Particles { X, x, .. } = &mut body.particles;
        X.iter_mut().chain(x).for_each(|place| *place += shift);
        if let Some(cells) = &mut body.mesh {
            cells.X.iter_mut().chain(&mut cells.x).for_each(|place| *place += shift);
        }
    }
    Ok((body, share))
}

/// The simulation at time zero.
pub(crate) fn set_up<T: Precision<D>, const D: usize>(
    exact: &dyn Solution<f64, D>,
    model: &dyn Solution<T, D>,
    updated: &Updated,
    case: &Case,
    scene: &Scene<D>,
    (time_step, ranks): (T, Option<&Arc<dyn Ranks>>),
) -> Result<Box<dyn Solver<T, D>>, CaseError> {
    let (mut body, share) = body::<T, D>(scene, updated, case.per_cell, exact.density(), ranks)?;
    let here = body.particles.len() as u64;
    let particles = share.as_ref().map_or(here, |share| total(&*share.ranks, here));
    if particles == 0 {
        return Err(SceneError::Empty { cells: case.cells }.into());
    }
    set_density(&mut body.particles, exact);
    if exact.is_half_plane() {
        set_volumes_of_a_radian(&mut body.particles);
    }
    if scene.revolves {
        set_in_half_plane(&mut body.particles);
        body.revolves = true;
    }
    body.sticks = scene.sticks;
    let law = law_of::<T, D>(model, case)?;
    set_in_motion(&mut body.particles, exact, updated.start, time_step.to_f64());
    set_memory(&mut body.particles, exact, &law, time_step.to_f64());
    if EVERY_SCHEME && let Some(Mesh { X, x, .. }) = &mut body.mesh {
        let grid = scene.grid::<T>();
        for (x, X) in x.iter_mut().zip(X) {
            let place = X.map(Real::to_f64);
            *x = (place + exact.displacement(&place, 0.0)).map(Real::nearest);
            // On a plane of symmetry there is no motion across it, not even by rounding.
            for (a, walls) in scene.walls.iter().enumerate() {
                let ends = [grid.lower[a], grid.upper()[a]];
                if walls.iter().zip(ends).any(|(is_wall, wall)| *is_wall && X[a] == wall) {
                    x[a] = X[a];
                }
            }
        }
    }
    let settings = Settings {
        shape: updated.shape,
        integrator: updated.integrator,
        transfer: updated.transfer,
        time_step,
        halve_first_acceleration: updated.integrator == Integrator::Cd
            && updated.start == Start::Halved,
    };
    Ok(T::updated_lagrangian(scene.grid(), body, law, settings, share)?)
}

/// Gives particles of a half plane the volumes and masses of a radian about the axis. The radius of the centre integrates it exactly.
fn set_volumes_of_a_radian<T: Real, const D: usize>(particles: &mut Particles<T, D>) {
    scale_by_radius(particles, |radius| radius);
}

/// Scales the volumes and masses of particles by a factor for their reference radius.
fn scale_by_radius<T: Real, const D: usize>(
    particles: &mut Particles<T, D>,
    factor: impl Fn(T) -> T,
) {
    let Particles { X, volume, mass, .. } = particles;
    for ((X, volume), mass) in X.iter().zip(volume).zip(mass) {
        let factor = factor(X[0]);
        *volume *= factor;
        *mass *= factor;
    }
}

/// Moves the particles of one layer to the half plane at the angle zero, and gives them the volumes and masses of all around the axis.
fn set_in_half_plane<T: Real, const D: usize>(particles: &mut Particles<T, D>) {
    let Particles { X, x, half_size, .. } = particles;
    X.iter_mut().chain(x).for_each(|place| place[1 % D] = T::zero());
    let thickness = half_size[1 % D] * T::nearest(2.0);
    scale_by_radius(particles, |radius| T::nearest(TAU) * radius / thickness);
}

/// Gives particles of a body whose density differs from place to place their masses.
fn set_density<T: Real, const D: usize>(
    particles: &mut Particles<T, D>,
    exact: &dyn Solution<f64, D>,
) {
    let uniform = exact.density();
    let Particles { X, volume, mass, .. } = particles;
    for ((X, volume), mass) in X.iter().zip(volume).zip(mass) {
        let density = exact.density_at(&X.map(Real::to_f64));
        if density != uniform {
            *mass = *volume * T::nearest(density);
        }
    }
}

/// Gives particles the internal variables of time zero, with the rate of the deformation gradient then, by differences of second order.
fn set_memory<T: Real, const D: usize>(
    particles: &mut Particles<T, D>,
    exact: &dyn Solution<f64, D>,
    law: &Law<T, D>,
    dt: f64,
) {
    let Law::WithMemory(law) = law else { return };
    particles.internal = Vec::new();
    if law.is_projected() {
        // The solver takes the change of volume of each particle.
        return;
    }
    for (X, x) in particles.X.iter().zip(&particles.x) {
        let place = X.map(Real::to_f64);
        let F = |t: f64| exact.deformation_gradient(&place, t);
        let rate = (F(dt) * 4.0 - F(2.0 * dt) - F(0.0) * 3.0) / (2.0 * dt);
        let mut q = law.initial(X);
        law.start_at_rate(&rate.map(Real::nearest), &mut q);
        if law.of_half_plane().is_some() {
            let around = |t: f64| exact.internal(&place, t).first().copied().unwrap_or(1.0);
            let around = (around(dt) * 4.0 - around(2.0 * dt) - around(0.0) * 3.0) / (2.0 * dt);
            law.start_at_rate_around(&rate.map(Real::nearest), T::nearest(around), &mut q);
            Hoop::follow(x, &mut q);
        }
        particles.internal.extend(q);
    }
}

/// Gives particles at rest the exact state at time zero, with the velocity that the integrator starts from.
fn set_in_motion<T: Real, const D: usize>(
    particles: &mut Particles<T, D>,
    exact: &dyn Solution<f64, D>,
    start: Start,
    dt: f64,
) {
    for p in 0..particles.len() {
        let X = particles.X[p].map(Real::to_f64);
        let v = match start {
            Start::Exact => exact.velocity(&X, -dt / 2.0),
            Start::Data => exact.velocity(&X, 0.0) - exact.acceleration(&X, 0.0) * (dt / 2.0),
            Start::Halved => exact.velocity(&X, 0.0),
        };
        particles.x[p] = (X + exact.displacement(&X, 0.0)).map(Real::nearest);
        particles.v[p] = v.map(Real::nearest);
        particles.F[p] = exact.deformation_gradient(&X, 0.0).map(Real::nearest);
    }
}
