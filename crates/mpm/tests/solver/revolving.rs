//! Bodies of revolution that turn about their axis, on the grid of radius and height.

#![allow(clippy::unwrap_used)]

use mmsmith_laws::HalfPlane;
use mmsmith_mpm::{
    Body, Grid, Integrator, Law, Material, NoBodyForce, Particles, Settings, SetupError, Shape,
    Simulation, Transfer,
};
use nalgebra::{Matrix3, Rotation3, SVector, Vector2, Vector3, vector};

use crate::schemes::{noise, settings, some_schemes};

const SOFT: Material<f64> = Material::NeoHookean { lambda: 60.0, mu: 40.0 };
/// The grid of radius and height: from the axis on, or beside it.
pub(crate) fn grid(inner: f64) -> Grid<f64, 3> {
    let walls = [[false; 2], [false; 2], [true, false]];
    Grid { lower: vector![inner, 0.0, 0.0], spacing: 0.125, cells: [8, 1, 64], walls }
}

/// A deformed body in motion, the particles of its half plane; `turn` is the share of all that goes around the axis.
pub(crate) fn body(grid: &Grid<f64, 3>, turn: f64) -> Body<f64, 3> {
    let first = grid.lower[0];
    let begin = if first == 0.0 { 0.0 } else { first + 0.25 };
    let inside =
        |X: &Vector3<f64>| X[1] < 0.0625 && begin < X[0] && X[0] < first + 0.75 && X[2] < 2.5;
    let mut p = Particles::lattice(grid, 2, 2.0, inside);
    for k in 0..p.len() {
        let thickness = 2.0 * p.half_size[1];
        p.X[k][1] = 0.0;
        let R = p.X[k][0];
        let around = std::f64::consts::TAU * R / thickness;
        (p.volume[k], p.mass[k]) = (p.volume[k] * around, p.mass[k] * around);
        // Smooth motions vanish at the axis, across it.
        let radius = R * (1.0 + 0.05 * noise(5 * k));
        p.x[k] = vector![radius, 0.0, p.X[k][2] + 0.01 * noise(3 * k)];
        p.v[k] = vector![0.4 * R * noise(k), turn * R * noise(k + 9), 0.5 * noise(k + 17)];
        let own = |i: usize, j: usize| 0.1 * noise(11 * k + 3 * i + j);
        p.F[k] = Matrix3::new(
            1.0 + own(0, 0),
            0.0,
            own(0, 2),
            turn * own(1, 0),
            radius / R,
            turn * own(1, 2),
            own(2, 0),
            0.0,
            1.0 + own(2, 2),
        );
    }
    Body { revolves: true, ..p.into() }
}

fn after(grid: &Grid<f64, 3>, body: &Body<f64, 3>, settings: Settings<f64>) -> Particles<f64, 3> {
    let mut run = Simulation::new(grid.clone(), body.clone(), SOFT, settings).unwrap();
    for _ in 0..3 {
        run.step(&NoBodyForce).unwrap();
    }
    run.particles().clone()
}

/// Every shape that serves such a body, with every integrator and each transfer in turn.
pub(crate) fn schemes() -> impl Iterator<Item = Settings<f64>> {
    some_schemes().filter(|of| !matches!(of.shape, Shape::Cpdi | Shape::Cpdi2))
}

/// Nothing depends on where around the axis a particle is.
#[test]
fn particles_at_other_angles_have_the_same_motion_turned() {
    for grid in [grid(0.0), grid(0.5)] {
        let body = body(&grid, 1.0);
        let turns: Vec<Matrix3<f64>> = (0..body.particles.len())
            .map(|k| Rotation3::from_axis_angle(&Vector3::z_axis(), 7.0 * noise(k)).into_inner())
            .collect();
        let mut turned = body.clone();
        let p = &mut turned.particles;
        for (k, Q) in turns.iter().enumerate() {
            (p.x[k], p.v[k], p.F[k]) = (Q * p.x[k], Q * p.v[k], Q * p.F[k]);
        }
        for settings in schemes() {
            let (one, two) = (after(&grid, &body, settings), after(&grid, &turned, settings));
            for (k, Q) in turns.iter().enumerate() {
                assert!((Q * one.x[k] - two.x[k]).norm() < 1e-13, "{settings:?}");
                assert!((Q * one.v[k] - two.v[k]).norm() < 1e-10, "{settings:?}");
                assert!((Q * one.F[k] - two.F[k]).norm() < 1e-12, "{settings:?}");
            }
        }
    }
}

/// Without a turn this is the half plane of two components, whose axis is a wall.
#[test]
fn a_body_that_does_not_turn_moves_as_in_the_half_plane_of_two_components() {
    for inner in [0.0, 0.5] {
        let grid = grid(inner);
        let body = body(&grid, 0.0);
        let p = &body.particles;
        let pick = |x: &Vector3<f64>| vector![x[0], x[2]];
        let plane = Particles::<f64, 2> {
            X: p.X.iter().map(pick).collect(),
            x: p.x.iter().map(pick).collect(),
            v: p.v.iter().map(pick).collect(),
            F: p.F.iter().map(|F| F.remove_row(1).remove_column(1)).collect(),
            mass: p.mass.clone(),
            volume: p.volume.clone(),
            half_size: pick(&p.half_size),
            internal: p.X.iter().zip(&p.x).flat_map(|(X, x)| [x[0] / X[0], X[0]]).collect(),
            ..Particles::default()
        };
        let walls = [[inner == 0.0, false], [true, false]];
        let cells = [grid.cells[0], grid.cells[2]];
        let half = Grid { lower: pick(&grid.lower), spacing: grid.spacing, cells, walls };
        let law = Law::with_memory(HalfPlane::new(Law::from(SOFT)).unwrap());
        for settings in schemes() {
            // The stretch around the axis follows a particle's place there, and here the velocity that F follows.
            if settings.integrator != Integrator::Usl {
                continue;
            }
            let mut run =
                Simulation::new(half.clone(), plane.clone(), law.clone(), settings).unwrap();
            for _ in 0..3 {
                run.step(&NoBodyForce).unwrap();
            }
            let (two, three) = (run.particles(), after(&grid, &body, settings));
            for k in 0..two.len() {
                let context = format!("{settings:?}, particle {k}");
                assert!((two.x[k] - pick(&three.x[k])).norm() < 1e-13, "{context}");
                assert!((two.v[k] - pick(&three.v[k])).norm() < 1e-10, "{context}");
                let F = three.F[k].remove_row(1).remove_column(1);
                assert!((two.F[k] - F).norm() < 1e-12, "{context}");
                assert!((two.internal[2 * k] - three.F[k][(1, 1)]).abs() < 1e-12, "{context}");
                assert!(three.v[k][1] == 0.0 && three.F[k][(1, 0)] == 0.0, "{context}");
            }
        }
    }
}

#[test]
fn what_does_not_revolve_is_refused() {
    let usual = settings(Shape::Gimp, Integrator::Usl, Transfer::Flip);
    let grid = grid(0.0);
    let whole = body(&grid, 1.0);
    let is_refused = |grid: &Grid<f64, 3>, settings| {
        let found = Simulation::new(grid.clone(), whole.clone(), SOFT, settings);
        matches!(found, Err(SetupError::Revolving { .. }))
    };
    assert!(is_refused(&Grid { cells: [8, 2, 64], ..grid.clone() }, usual));
    for shape in [Shape::Cpdi, Shape::Cpdi2] {
        assert!(is_refused(&grid, Settings { shape, ..usual }), "{shape}");
    }
    let plane =
        Grid { lower: Vector2::zeros(), spacing: 0.125, cells: [8, 1], walls: [[false; 2]; 2] };
    let all = Particles::lattice(&plane, 2, 1.0, |_: &SVector<f64, 2>| true);
    let flat = Body { revolves: true, ..all.into() };
    let found = Simulation::new(plane, flat, SOFT, usual);
    assert!(matches!(found, Err(SetupError::Revolving { .. })));
}
