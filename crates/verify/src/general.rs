//! Runs that the fast step has no kernel for: other weights, transfers, integrators and layouts in the updated frame.

use bytemuck::Pod;
use mmsmith_mpm::general::{Annulus, Body, General, Settings, Shape, Transfer};
use mmsmith_mpm::{Integrator as FastIntegrator, Shape as FastShape};
use mmsmith_solutions::{Domain, Real, Solution};
use nalgebra::SVector;

use crate::case::{Case, CaseError, law, set_in_motion, starts_halved};
use crate::scene::{Extent, Scene, SceneError};
use crate::solver::Solver;
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

/// The weights and the integrator of the fast step that make up a case, if it has them.
pub(crate) fn fast_step(case: &Case) -> Option<(FastShape, FastIntegrator)> {
    let plain = case.frame == Frame::Updated
        && case.transfer == Transfer::Flip
        && case.placement == Placement::Lattice;
    plain.then_some(())?;
    case.shape.of_fast_step().zip(case.integrator.of_fast_step())
}

/// Whether the steps of a case use more than one thread, where there are more.
#[must_use]
pub fn uses_threads(case: &Case) -> bool {
    fast_step(case).is_some()
}

/// Refuses what makes no sense whatever the solution.
pub(crate) fn validate(case: &Case) -> Result<(), CaseError> {
    if case.offset != 0.0 && fast_step(case).is_none() {
        let value = format!("{:?}", case.offset);
        return refuse(
            "offset",
            &value,
            "0, but for the shapes linear, ugimp, gimp and bspline2 on a lattice with the transfer flip and the integrators cd, usl, usf \
             and musl",
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
    if case.shape == Shape::Cpdi2 && D == 3 {
        return refuse("shape", "cpdi2", "cpdi in three dimensions");
    }
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

/// About how many bytes a run keeps, where the exact fields keep `exact` bytes of each particle.
pub(crate) fn bytes_expected<const D: usize>(scene: &Scene<D>, case: &Case, exact: usize) -> f64 {
    let entries = match case.shape {
        Shape::Linear => 2_u32.pow(D as u32),
        Shape::Bspline3 | Shape::Cpdi | Shape::Cpdi2 => 4_u32.pow(D as u32),
        _ => 3_u32.pow(D as u32),
    };
    // Node, weight and gradient; vectors that grow have up to twice the room.
    let lists = 2.0 * f64::from(entries) * (2 + D) as f64;
    // Half edges, affine part, corners, and velocities of filters.
    let domains = (2 * D * D + 5 * D) as f64;
    let nodes: f64 = scene.cells.iter().map(|&cells| cells as f64 + 9.0).product();
    let particles = scene.particles_expected(case.per_cell);
    scene.bytes_expected(case.per_cell, size_of::<f64>(), exact)
        + 8.0 * (particles * (lists + domains) + nodes * (1 + 4 * D) as f64)
}

/// The precisions of the solver.
pub(crate) trait Precision: Real + Pod {
    /// What the fast step has no kernel for, at time zero: the general simulation, or that in the total frame.
    fn other<'a, const D: usize>(
        exact: &'a dyn Solution<f64, D>,
        case: &Case,
        scene: &Scene<D>,
        time_step: Self,
    ) -> Result<Box<dyn Solver<Self, D> + 'a>, CaseError>;
}

impl Precision for f32 {
    fn other<'a, const D: usize>(
        _exact: &'a dyn Solution<f64, D>,
        case: &Case,
        _scene: &Scene<D>,
        _time_step: f32,
    ) -> Result<Box<dyn Solver<f32, D> + 'a>, CaseError> {
        let admissible = match case.frame {
            Frame::Total(_) => "f64 in the total Lagrangian formulation",
            Frame::Updated => {
                "f64, but for the shapes linear, ugimp, gimp and bspline2 on a lattice with the transfer flip and the integrators \
                 cd, usl, usf and musl"
            }
        };
        refuse("precision", "f32", admissible)
    }
}

impl Precision for f64 {
    fn other<'a, const D: usize>(
        exact: &'a dyn Solution<f64, D>,
        case: &Case,
        scene: &Scene<D>,
        time_step: f64,
    ) -> Result<Box<dyn Solver<f64, D> + 'a>, CaseError> {
        match &case.frame {
            Frame::Total(scheme) => total::set_up(exact, scheme, case, scene, time_step),
            Frame::Updated => set_up(exact, case, scene, time_step),
        }
    }
}

/// The general simulation at time zero.
fn set_up<const D: usize>(
    exact: &dyn Solution<f64, D>,
    case: &Case,
    scene: &Scene<D>,
    time_step: f64,
) -> Result<Box<dyn Solver<f64, D>>, CaseError> {
    admit(scene, case)?;
    let grid = scene.grid();
    let (density, per_cell) = (exact.density(), case.per_cell);
    let mut body = match (case.placement, &scene.domain) {
        (Placement::BodyFitted, &Domain::Annulus { inner, outer }) => {
            let quarter = scene.extent() == Some(Extent::Quarter);
            let ring = Annulus { inner, outer, quarter };
            Body::annulus(&ring, scene.spacing, per_cell, density)?
        }
        _ => Body::lattice(&grid, per_cell, density, scene.inside(per_cell, case.offset)),
    };
    if body.particles.is_empty() {
        return Err(SceneError::Empty { cells: case.cells }.into());
    }
    set_in_motion(&mut body.particles, exact, case, time_step);
    if let Some(mesh) = &mut body.mesh {
        let moved = |X: &SVector<f64, D>| X + exact.displacement(X, 0.0);
        mesh.x = mesh.X.iter().map(moved).collect();
        // On a plane of symmetry there is no motion across it, not even by rounding.
        for (x, X) in mesh.x.iter_mut().zip(&mesh.X) {
            for (a, [lower, _]) in scene.walls.iter().enumerate() {
                if *lower && X[a] == scene.lower[a] {
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
    let law = law(exact.material())?;
    Ok(Box::new(General::new(grid, body, law, settings)?))
}
