//! Runs in the updated Lagrangian formulation: from a solution to a grid, particles with their domains, and their motion.

use std::cell::Cell;
use std::ops::Range;
use std::sync::Arc;

use mmsmith_mpm::{
    Annulus, Body, Clip, Facet, Load, Particles, Settings, SetupError, Shape, Share, Side,
    Simulation, Solver,
};
use mmsmith_ranks::Ranks;
use mmsmith_runtime::{Domain, Real, Solution};
use nalgebra::SVector;

use crate::case::{Case, Extent, law};
use crate::error::{CaseError, SceneError};
use crate::precision::Precision;
use crate::scene::Scene;
use crate::scheme::{Placement, Start, Stepping, Updated};

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
    let nodes: f64 = scene.cells.iter().map(|&cells| cells as f64 + 9.0).product();
    let particles = scene.particles_expected(per_cell);
    scene.bytes_expected(per_cell, scalar, exact)
        + scalar as f64 * (particles * (of_shape + of_transfer) as f64 + nodes * of_node as f64)
}

/// A body that a lattice clipped with its boundary makes, at rest, and the reference positions where a traction acts on it.
fn clipped<T: Real, const D: usize>(
    scene: &Scene<D>,
    placement: Placement,
    per_cell: usize,
    density: f64,
) -> Result<(Body<T, D>, Vec<SVector<T, D>>), CaseError> {
    let clip = Clip {
        sides: scene.boundary.iter().map(|part| part.side).collect(),
        turn: scene.turn,
        offset: placement.offset(),
    };
    let (mut body, facets) = Body::<T, D>::clipped(&scene.grid(), per_cell, density, &clip)?;
    let mut points = Vec::new();
    if let Some(polygons) = &mut body.polygons {
        let (grid, near) = (scene.grid::<T>(), T::nearest(1e-9 * scene.spacing));
        for (a, walls) in scene.walls.iter().enumerate() {
            for (is_wall, wall) in walls.iter().zip([grid.lower[a], grid.upper()[a]]) {
                for X in polygons.X.iter_mut().filter(|_| *is_wall) {
                    if (X[a] - wall).abs() <= near {
                        X[a] = wall;
                    }
                }
            }
        }
        for Facet { side, corners } in facets {
            let part = &scene.boundary[side];
            if !part.is_loaded {
                continue;
            }
            let ends = corners.map(|corner| polygons.X[corner as usize].map(Real::to_f64));
            for (X, shares) in load_points(part.side, ends) {
                polygons.loads.push(Load { corners, shares: shares.map(Real::nearest) });
                points.push(X.map(Real::nearest));
            }
        }
        polygons.x.clone_from(&polygons.X);
    }
    Ok((body, points))
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

/// The particles of a body, in the order of their numbers, that a process begins with: as many as each other one does.
fn born_here<const D: usize>(
    scene: &Scene<D>,
    updated: &Updated,
    case: &Case,
    ranks: &Arc<dyn Ranks>,
) -> Result<Share, CaseError> {
    let count = match (updated.placement, &scene.domain) {
        (Placement::Clipped { .. }, _) => {
            return Err(SetupError::PolygonsOfOneProcess.into());
        }
        (Placement::BodyFitted, &Domain::Annulus { inner, outer }) => {
            let quarter = scene.extent() == Some(Extent::Quarter);
            let ring = Annulus { inner, outer, quarter };
            Body::<f64, D>::annulus(&ring, scene.spacing, case.per_cell, 1.0)?.particles.len()
        }
        (placement, _) => {
            let inside = scene.inside(case.per_cell, placement.offset());
            let count = Cell::new(0);
            let none = Particles::<f64, D>::lattice(&scene.grid(), case.per_cell, 1.0, |X| {
                count.set(count.get() + usize::from(inside(X)));
                false
            });
            count.get() + none.len()
        }
    };
    if count == 0 {
        return Err(SceneError::Empty { cells: case.cells }.into());
    }
    let first = |rank: usize| (count * rank / ranks.count()) as u64;
    let ids = (first(ranks.rank())..first(ranks.rank() + 1)).collect();
    Ok(Share { ranks: ranks.clone(), ids })
}

/// The numbers of the particles of a share, which follow each other.
fn numbers(share: &Share) -> Range<usize> {
    let first = share.ids.first().map_or(0, |id| *id as usize);
    first..first + share.ids.len()
}

/// The body of a case at rest in the reference configuration, or the share of it that a process begins with.
fn body<T: Real, const D: usize>(
    scene: &Scene<D>,
    updated: &Updated,
    per_cell: usize,
    density: f64,
    share: Option<&Share>,
) -> Result<Body<T, D>, CaseError> {
    let (grid, density) = (scene.grid::<T>(), T::nearest(density));
    let offset = match (updated.placement, &scene.domain) {
        (Placement::BodyFitted, &Domain::Annulus { inner, outer }) => {
            let quarter = scene.extent() == Some(Extent::Quarter);
            let ring = Annulus { inner: T::nearest(inner), outer: T::nearest(outer), quarter };
            let whole = Body::annulus(&ring, grid.spacing, per_cell, density)?;
            return Ok(match share {
                None => whole,
                Some(share) => whole.part(&numbers(share)),
            });
        }
        (placement, _) => placement.offset(),
    };
    let inside = scene.inside(per_cell, offset);
    let next = Cell::new(0);
    let own = share.map(numbers);
    let inside = |X: &SVector<T, D>| {
        let is_inside = inside(X);
        let number = next.replace(next.get() + usize::from(is_inside));
        is_inside && own.as_ref().is_none_or(|own| own.contains(&number))
    };
    let mut body = match updated.shape {
        Shape::Cpdi2 => Body::lattice(&grid, per_cell, density, inside),
        _ => Particles::lattice(&grid, per_cell, density, inside).into(),
    };
    if offset != 0.0 {
        let distance = scene.spacing / per_cell as f64;
        let shift: SVector<T, D> = SVector::repeat(T::nearest(offset * distance));
        let Particles { X, x, .. } = &mut body.particles;
        X.iter_mut().chain(x).for_each(|place| *place += shift);
        if let Some(mesh) = &mut body.mesh {
            mesh.X.iter_mut().chain(&mut mesh.x).for_each(|place| *place += shift);
        }
    }
    Ok(body)
}

/// A simulation at time zero.
pub(crate) struct SetUp<T, const D: usize> {
    pub(crate) solver: Box<dyn Solver<T, D>>,
    /// The reference positions of the points of the boundary where a traction acts.
    pub(crate) loaded: Vec<SVector<T, D>>,
}

/// The simulation at time zero.
pub(crate) fn set_up<T: Precision<D>, const D: usize>(
    exact: &dyn Solution<f64, D>,
    model: &dyn Solution<T, D>,
    updated: &Updated,
    case: &Case,
    scene: &Scene<D>,
    (time_step, ranks): (T, Option<&Arc<dyn Ranks>>),
) -> Result<SetUp<T, D>, CaseError> {
    let share = match ranks {
        Some(ranks) => Some(born_here(scene, updated, case, ranks)?),
        None => None,
    };
    let (mut body, loaded) = if updated.placement.is_clipped() {
        clipped(scene, updated.placement, case.per_cell, exact.density())?
    } else {
        (body::<T, D>(scene, updated, case.per_cell, exact.density(), share.as_ref())?, Vec::new())
    };
    if body.particles.is_empty() && share.is_none() {
        return Err(SceneError::Empty { cells: case.cells }.into());
    }
    set_in_motion(&mut body.particles, exact, updated.stepping, time_step.to_f64());
    let corners = match (&mut body.mesh, &mut body.polygons) {
        (Some(mesh), _) => Some((&mesh.X, &mut mesh.x)),
        (None, Some(polygons)) => Some((&polygons.X, &mut polygons.x)),
        (None, None) => None,
    };
    if let Some((X, x)) = corners {
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
        integrator: updated.stepping.into(),
        transfer: updated.transfer,
        time_step,
        halve_first_acceleration: updated.stepping == Stepping::Cd(Start::Halved),
    };
    let (grid, law) = (scene.grid(), law(model.law())?);
    let simulation = match share {
        None => Simulation::new(grid, body, law, settings)?,
        Some(share) => Simulation::shared_out(grid, body, share, law, settings)?,
    };
    Ok(SetUp { solver: Box::new(simulation), loaded })
}

/// Gives particles at rest the exact state at time zero, with the velocity that the integrator starts from.
fn set_in_motion<T: Real, const D: usize>(
    particles: &mut Particles<T, D>,
    exact: &dyn Solution<f64, D>,
    stepping: Stepping,
    dt: f64,
) {
    for p in 0..particles.len() {
        let X = particles.X[p].map(Real::to_f64);
        let v = match stepping {
            Stepping::Cd(Start::Exact) => exact.velocity(&X, -dt / 2.0),
            Stepping::Cd(Start::Data) => {
                exact.velocity(&X, 0.0) - exact.acceleration(&X, 0.0) * (dt / 2.0)
            }
            _ => exact.velocity(&X, 0.0),
        };
        particles.x[p] = (X + exact.displacement(&X, 0.0)).map(Real::nearest);
        particles.v[p] = v.map(Real::nearest);
        particles.F[p] = exact.deformation_gradient(&X, 0.0).map(Real::nearest);
    }
}
