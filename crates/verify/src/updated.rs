//! Runs in the updated Lagrangian formulation: from a solution to a grid, particles with their domains, and their motion.

use mmsmith_mpm::{Annulus, Body, Particles, Scalar, Settings, Shape, Solver, Transfer};
use mmsmith_solutions::{Domain, Real, Solution};
use nalgebra::SVector;

use crate::case::{Case, CaseError, law, set_in_motion, starts_halved};
use crate::scene::{Extent, Scene, SceneError};
use crate::total::{self, Frame};

/// Where the particles of the updated frame lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Placement {
    /// At the centres of equal parts of the background cells.
    #[default]
    Lattice,
    /// For rings: at the centroids of polar cells, whose corners lie on the rims.
    BodyFitted,
}

impl Placement {
    fn name(self) -> &'static str {
        match self {
            Self::Lattice => "lattice",
            Self::BodyFitted => "body-fitted",
        }
    }
}

/// Refuses what makes no sense whatever the solution.
pub(crate) fn validate(case: &Case) -> Result<(), CaseError> {
    if case.placement == Placement::BodyFitted && case.offset != 0.0 {
        let value = format!("{:?}", case.offset);
        return refuse(
            "offset",
            &value,
            "0 with particles fitted to the body, or the layout lattice",
        );
    }
    let boxed = matches!(case.shape, Shape::Ugimp | Shape::Gimp);
    if boxed && case.placement == Placement::BodyFitted {
        return refuse(
            "layout",
            case.placement.name(),
            "lattice with gimp and ugimp, whose boxes lie along the axes, or the shape cpdi2, cpdi, linear, bspline2 or \
             bspline3",
        );
    }
    Ok(())
}

/// Refuses what makes no sense on this scene.
pub(crate) fn admit<const D: usize>(scene: &Scene<D>, case: &Case) -> Result<(), CaseError> {
    if case.placement == Placement::BodyFitted {
        let fitted = case.placement.name();
        match scene.domain {
            Domain::Annulus { .. } if D == 2 => {}
            Domain::Annulus { .. } => return refuse("layout", fitted, "lattice for a shell"),
            _ => return refuse("layout", fitted, "lattice for a box, which that fits"),
        }
    }
    Ok(())
}

fn refuse<T>(setting: &'static str, value: &str, admissible: &'static str) -> Result<T, CaseError> {
    Err(CaseError::Setting { setting, value: value.into(), admissible })
}

/// About how many bytes a run keeps, for values of `scalar` bytes, where the exact fields keep `exact` bytes of each particle.
pub(crate) fn bytes_expected<const D: usize>(
    scene: &Scene<D>,
    case: &Case,
    scalar: usize,
    exact: usize,
) -> f64 {
    // Numbers of a particle, and of a node, that other schemes than those of one pass with boxes keep beside those.
    let of_shape = match case.shape {
        Shape::Cpdi => D * D,
        // Corners, in three configurations, are as many as particles; a domain has eight indices.
        Shape::Cpdi2 => 3 * D + D * D + size_of::<[usize; 8]>() / scalar,
        _ => 0,
    };
    let (of_transfer, of_node) = match case.transfer {
        Transfer::Apic => (D * D, 0),
        Transfer::Xpic(order) if order > 1 => (0, D + 8),
        _ => (0, 0),
    };
    let nodes: f64 = scene.cells.iter().map(|&cells| cells as f64 + 9.0).product();
    let particles = scene.particles_expected(case.per_cell);
    scene.bytes_expected(case.per_cell, scalar, exact)
        + scalar as f64 * (particles * (of_shape + of_transfer) as f64 + nodes * of_node as f64)
}

/// The body of a case at rest in the reference configuration.
fn body<T: Real, const D: usize>(
    scene: &Scene<D>,
    case: &Case,
    density: f64,
) -> Result<Body<T, D>, CaseError> {
    let (grid, density) = (scene.grid::<T>(), T::nearest(density));
    if let (Placement::BodyFitted, &Domain::Annulus { inner, outer }) =
        (case.placement, &scene.domain)
    {
        let quarter = scene.extent() == Some(Extent::Quarter);
        let ring = Annulus { inner: T::nearest(inner), outer: T::nearest(outer), quarter };
        return Ok(Body::annulus(&ring, grid.spacing, case.per_cell, density)?);
    }
    let inside = scene.inside(case.per_cell, case.offset);
    let mut body = match case.shape {
        Shape::Cpdi2 => Body::lattice(&grid, case.per_cell, density, inside),
        _ => Particles::lattice(&grid, case.per_cell, density, inside).into(),
    };
    if case.offset != 0.0 {
        let distance = scene.spacing / case.per_cell as f64;
        let shift: SVector<T, D> = SVector::repeat(T::nearest(case.offset * distance));
        let Particles { X, x, .. } = &mut body.particles;
        X.iter_mut().chain(x).for_each(|place| *place += shift);
        if let Some(mesh) = &mut body.mesh {
            mesh.X.iter_mut().chain(&mut mesh.x).for_each(|place| *place += shift);
        }
    }
    Ok(body)
}

/// The simulation at time zero.
pub(crate) fn set_up<T: Real + Scalar<D>, const D: usize>(
    exact: &dyn Solution<f64, D>,
    model: &dyn Solution<T, D>,
    case: &Case,
    scene: &Scene<D>,
    time_step: T,
) -> Result<Box<dyn Solver<T, D>>, CaseError> {
    admit(scene, case)?;
    let mut body = body::<T, D>(scene, case, exact.density())?;
    if body.particles.is_empty() {
        return Err(SceneError::Empty { cells: case.cells }.into());
    }
    set_in_motion(&mut body.particles, exact, case, time_step.to_f64());
    if let Some(mesh) = &mut body.mesh {
        for (x, X) in mesh.x.iter_mut().zip(&mesh.X) {
            let place = X.map(Real::to_f64);
            *x = (place + exact.displacement(&place, 0.0)).map(Real::nearest);
            // On a plane of symmetry there is no motion across it, not even by rounding.
            for (a, [lower, _]) in scene.walls.iter().enumerate() {
                if *lower && place[a] == scene.lower[a] {
                    x[a] = X[a];
                }
            }
        }
    }
    let settings = Settings {
        shape: case.shape,
        integrator: case.integrator,
        transfer: case.transfer,
        time_step,
        halve_first_acceleration: starts_halved(case),
    };
    Ok(T::simulation(scene.grid(), body, law(model.material())?, settings)?)
}

/// The solver of a case at time zero with steps of `time_step`, whatever its formulation.
pub(crate) fn solver<'a, T: Real + Scalar<D>, const D: usize>(
    exact: &'a dyn Solution<f64, D>,
    model: &'a dyn Solution<T, D>,
    case: &Case,
    scene: &Scene<D>,
    time_step: T,
) -> Result<Box<dyn Solver<T, D> + 'a>, CaseError> {
    match &case.frame {
        Frame::Total(scheme) => total::set_up(exact, scheme, case, scene, time_step),
        Frame::Updated => set_up(exact, model, case, scene, time_step),
    }
}
