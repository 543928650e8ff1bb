//! The general simulation: the same results as the fast step where that has the scheme, what every other scheme has to
//! keep, and how runs and set-ups fail.

use mmsmith_mpm::general::{Annulus, Body, General, Integrator, Settings, Shape, Transfer};
use mmsmith_mpm::{Grid, Material, NoBodyForce, SetupError, Simulation, StepError};
use nalgebra::{Matrix2, SMatrix, SVector, Vector2, vector};

pub(crate) const SHAPES: [Shape; 7] = [
    Shape::Linear,
    Shape::Ugimp,
    Shape::Gimp,
    Shape::Bspline2,
    Shape::Bspline3,
    Shape::Cpdi,
    Shape::Cpdi2,
];
pub(crate) const INTEGRATORS: [Integrator; 5] =
    [Integrator::Usf, Integrator::Usl, Integrator::Musl, Integrator::Usavg, Integrator::Cd];
const TRANSFERS: [Transfer; 5] =
    [Transfer::Flip, Transfer::Pic, Transfer::Apic, Transfer::Xpic(2), Transfer::Xpic(5)];
const SOFT: Material<f64> = Material::NeoHookean { lambda: 60.0, mu: 40.0 };

/// Every scheme of a dimension.
fn schemes<const D: usize>() -> impl Iterator<Item = Settings> {
    let shapes = SHAPES.into_iter().filter(|&shape| D <= 2 || shape != Shape::Cpdi2);
    shapes.flat_map(|shape| {
        INTEGRATORS.into_iter().flat_map(move |integrator| {
            TRANSFERS.into_iter().map(move |transfer| Settings {
                shape,
                integrator,
                transfer,
                time_step: 1e-3,
                halve_first_acceleration: false,
            })
        })
    })
}

fn settings(shape: Shape, integrator: Integrator, transfer: Transfer) -> Settings {
    Settings { shape, integrator, transfer, time_step: 1e-3, halve_first_acceleration: false }
}

fn open_grid<const D: usize>(cells: usize) -> Grid<f64, D> {
    let spacing = 1.0 / cells as f64;
    Grid { lower: SVector::zeros(), spacing, cells: [cells; D], walls: [[false; 2]; D] }
}

/// Different for every particle and component, and far from any regularity.
fn noise(seed: usize) -> f64 {
    (seed as f64 * 12.9898).sin() * 0.5
}

/// Distorts a body and sets it in motion.
fn disturb<const D: usize>(mut body: Body<D>, spacing: f64) -> Body<D> {
    let p = &mut body.particles;
    for k in 0..p.len() {
        p.v[k] = SVector::from_fn(|a, _| 0.5 * noise(7 * k + a));
        p.F[k] += SMatrix::from_fn(|i, j| 0.1 * noise(11 * k + 3 * i + j));
        p.x[k] += SVector::from_fn(|a, _| 0.2 * spacing * noise(13 * k + a));
    }
    if let Some(mesh) = &mut body.mesh {
        for (k, x) in mesh.x.iter_mut().enumerate() {
            *x += SVector::from_fn(|a, _| 0.1 * spacing * noise(17 * k + a));
        }
    }
    body
}

/// A distorted, moving block in the middle of the grid.
fn block<const D: usize>(grid: &Grid<f64, D>) -> Body<D> {
    let inside = |X: &SVector<f64, D>| X.iter().all(|x| (0.25..0.75).contains(x));
    disturb(Body::lattice(grid, 2, 2.0, inside), grid.spacing)
}

fn momentum<const D: usize>(simulation: &General<D>) -> SVector<f64, D> {
    let p = simulation.particles();
    p.v.iter().zip(&p.mass).map(|(v, &m)| v * m).sum()
}

/// Two implementations that share no loop: weights of the whole stencil, walls, forces and updates have to agree.
#[test]
fn results_are_those_of_the_fast_step() {
    fn check<const D: usize>() {
        let grid = Grid { walls: [[true, false]; D], ..open_grid::<D>(6) };
        let inside = |X: &SVector<f64, D>| X.iter().all(|&x| x < 0.5);
        let mut body = Body::lattice(&grid, 2, 2.0, inside);
        for (k, v) in body.particles.v.iter_mut().enumerate() {
            *v = SVector::from_fn(|a, _| 0.5 * noise(7 * k + a));
        }
        let force = |X: &[SVector<f64, D>], t: f64, b: &mut [SVector<f64, D>]| {
            for (b, X) in b.iter_mut().zip(X) {
                *b = X.map(|x| (3.0 * x + 5.0 * t).sin());
            }
        };
        for shape in SHAPES {
            for integrator in INTEGRATORS {
                let (Some(fast_shape), Some(fast_integrator)) =
                    (shape.of_fast_step(), integrator.of_fast_step())
                else {
                    continue;
                };
                let halve_first_acceleration = integrator == Integrator::Cd;
                let time_step = 2e-3;
                let general = Settings {
                    halve_first_acceleration,
                    time_step,
                    ..settings(shape, integrator, Transfer::Flip)
                };
                let fast = mmsmith_mpm::Settings {
                    shape: fast_shape,
                    integrator: fast_integrator,
                    time_step,
                    halve_first_acceleration,
                };
                let mut general = General::new(grid.clone(), body.clone(), SOFT, general).unwrap();
                let mut fast =
                    Simulation::new(grid.clone(), body.particles.clone(), SOFT, fast).unwrap();
                for _ in 0..20 {
                    general.step(&force).unwrap();
                    fast.step(&force).unwrap();
                }
                assert_eq!(general.velocity_lag(), fast.velocity_lag());
                let (one, two) = (general.particles(), fast.particles());
                for p in 0..one.len() {
                    let moved = (one.x[p] - one.X[p]).norm();
                    assert!(moved > 1e-5);
                    let off = (one.x[p] - two.x[p]).norm();
                    assert!(off < 1e-13, "{shape:?} {integrator:?} {off:e}");
                    assert!((one.v[p] - two.v[p]).norm() < 1e-11, "{shape:?} {integrator:?}");
                    assert!((one.F[p] - two.F[p]).norm() < 1e-11, "{shape:?} {integrator:?}");
                }
            }
        }
    }
    check::<1>();
    check::<2>();
    check::<3>();
}

#[test]
fn momentum_changes_by_the_body_force_only() {
    fn check<const D: usize>(cells: usize) {
        for settings in schemes::<D>() {
            let grid = open_grid::<D>(cells);
            let body = block(&grid);
            let mass = body.particles.mass.iter().sum::<f64>();
            let force = SVector::<f64, D>::from_fn(|a, _| 1.0 + a as f64);
            let b = |_: &[SVector<f64, D>], _: f64, b: &mut [SVector<f64, D>]| b.fill(force);
            let mut simulation = General::new(grid, body, SOFT, settings).unwrap();
            let before = momentum(&simulation);
            for step in 1..=3 {
                simulation.step(&b).unwrap();
                let expected = before + force * (mass * settings.time_step * f64::from(step));
                assert!((momentum(&simulation) - expected).norm() < 1e-13, "{settings:?}");
            }
        }
    }
    check::<1>(8);
    check::<2>(8);
    check::<3>(4);
}

#[test]
fn a_body_at_rest_stays_exactly_at_rest() {
    fn check<const D: usize>() {
        for settings in schemes::<D>() {
            let grid = Grid { walls: [[true, false]; D], ..open_grid::<D>(4) };
            let body = Body::lattice(&grid, 2, 2.0, |X| X.iter().all(|&x| x < 0.5));
            let initial = body.particles.clone();
            let mut simulation = General::new(grid, body, SOFT, settings).unwrap();
            for _ in 0..2 {
                simulation.step(&NoBodyForce).unwrap();
            }
            assert_eq!(simulation.particles(), &initial, "{settings:?}");
            assert_eq!(simulation.steps_done(), 2);
        }
    }
    check::<1>();
    check::<2>();
    check::<3>();
}

#[test]
fn a_free_body_flies_straight_through_the_cells() {
    for settings in schemes::<2>() {
        let grid = open_grid::<2>(10);
        let inside = |X: &Vector2<f64>| X.iter().all(|&x| (0.1..0.3).contains(&x));
        let mut body = Body::lattice(&grid, 2, 2.0, inside);
        let v = vector![1.0, 0.7];
        body.particles.v.fill(v);
        let settings = Settings { time_step: 4e-3, ..settings };
        let mut simulation = General::new(grid, body, SOFT, settings).unwrap();
        for _ in 0..125 {
            simulation.step(&NoBodyForce).unwrap();
        }
        let p = simulation.particles();
        for k in 0..p.len() {
            assert!((p.x[k] - p.X[k] - v * 0.5).norm() < 1e-10, "{settings:?}");
            assert!((p.v[k] - v).norm() < 1e-10 && (p.F[k] - Matrix2::identity()).norm() < 1e-9);
        }
        if let Some(mesh) = &simulation.body().mesh {
            assert!(mesh.x.iter().zip(&mesh.X).all(|(x, X)| (x - X - v * 0.5).norm() < 1e-10));
        }
    }
}

/// A quarter turn maps the grid onto itself, so that it has to map the motion onto itself.
#[test]
fn a_turned_body_moves_as_the_body_does_turned() {
    let grid =
        Grid { lower: vector![-1.0, -1.0], spacing: 0.25, cells: [8, 8], walls: [[false; 2]; 2] };
    let Q = Matrix2::new(0.0, -1.0, 1.0, 0.0);
    let ring = Annulus { inner: 0.3, outer: 0.6, quarter: false };
    let body = disturb(Body::annulus(&ring, grid.spacing, 2, 2.0).unwrap(), grid.spacing);
    let mut turned = body.clone();
    let p = &mut turned.particles;
    for x in p.X.iter_mut().chain(&mut p.x).chain(&mut p.v) {
        *x = Q * *x;
    }
    p.F.iter_mut().for_each(|F| *F = Q * *F);
    // The deformation gradient refers to the edges, which stay as they are.
    for x in &mut turned.mesh.as_mut().unwrap().x {
        *x = Q * *x;
    }
    for shape in [Shape::Linear, Shape::Bspline2, Shape::Bspline3, Shape::Cpdi, Shape::Cpdi2] {
        for integrator in INTEGRATORS {
            for transfer in TRANSFERS {
                let settings = settings(shape, integrator, transfer);
                let run = |body: &Body<2>| {
                    let mut run = General::new(grid.clone(), body.clone(), SOFT, settings).unwrap();
                    for _ in 0..3 {
                        run.step(&NoBodyForce).unwrap();
                    }
                    run
                };
                let (one, two) = (run(&body), run(&turned));
                let (one, two) = (one.particles(), two.particles());
                for k in 0..one.len() {
                    assert!((Q * one.x[k] - two.x[k]).norm() < 1e-12, "{settings:?}");
                    assert!((Q * one.v[k] - two.v[k]).norm() < 1e-9, "{settings:?}");
                    assert!((Q * one.F[k] - two.F[k]).norm() < 1e-9, "{settings:?}");
                }
            }
        }
    }
}

/// With next to no stress the transfers are operators on the particles' velocities alone: `P = S S^+` for PIC and
/// `I - (I - P)^m` for XPIC(m).
#[test]
fn xpic_is_the_power_of_pic_that_it_is_named_after() {
    let grid = open_grid::<2>(6);
    let feather = Material::NeoHookean { lambda: 0.0, mu: 1e-200 };
    let body = block(&grid);
    let after = |v: &[Vector2<f64>], transfer: Transfer| {
        let mut body = body.clone();
        body.particles.v = v.to_vec();
        let settings = settings(Shape::Gimp, Integrator::Usl, transfer);
        let mut simulation = General::new(grid.clone(), body, feather, settings).unwrap();
        simulation.step(&NoBodyForce).unwrap();
        simulation.particles().v.clone()
    };
    let v = &body.particles.v;
    let mut rest = v.clone();
    for m in 1..=5 {
        // (I - P)^m v
        let filtered = after(&rest, Transfer::Pic);
        rest.iter_mut().zip(&filtered).for_each(|(rest, filtered)| *rest -= filtered);
        let found = after(v, Transfer::Xpic(m));
        for ((found, v), rest) in found.iter().zip(v).zip(&rest) {
            assert!((found - (v - rest)).norm() < 1e-13, "{m}");
        }
    }
    let kept = after(v, Transfer::Flip);
    assert!(kept.iter().zip(v).all(|(kept, v)| (kept - v).norm() < 1e-15));
}

#[test]
fn usavg_updates_stress_by_halves() {
    let grid = open_grid::<2>(6);
    let C = Matrix2::new(0.3, -0.8, 0.5, 0.2);
    let inside = |X: &Vector2<f64>| X.iter().all(|x| (0.16..0.84).contains(x));
    let mut body = Body::lattice(&grid, 2, 2.0, inside);
    body.particles.v = body.particles.X.iter().map(|X| C * X).collect();
    let feather = Material::NeoHookean { lambda: 0.0, mu: 1e-200 };
    let half = Matrix2::identity() + C * 0.5e-3;
    for (integrator, expected) in [
        (Integrator::Usavg, half * half),
        (Integrator::Usf, half * 2.0 - Matrix2::identity()),
        (Integrator::Usl, half * 2.0 - Matrix2::identity()),
    ] {
        // In the interior cells the lumped projection of a linear field on this lattice is exact.
        let settings = settings(Shape::Gimp, integrator, Transfer::Flip);
        let mut simulation = General::new(grid.clone(), body.clone(), feather, settings).unwrap();
        simulation.step(&NoBodyForce).unwrap();
        let p = simulation.particles();
        let inner = (0..p.len()).filter(|&k| (p.X[k] - vector![0.5, 0.5]).amax() < 0.1);
        for k in inner {
            assert!((p.F[k] - expected).norm() < 1e-15, "{integrator:?} {}", p.F[k] - expected);
        }
    }
}

/// Body-fitted quadrilaterals see both rims and the planes of symmetry as they are.
#[test]
fn corners_on_planes_of_symmetry_stay_there() {
    let grid =
        Grid { lower: vector![0.0, 0.0], spacing: 0.1, cells: [9, 9], walls: [[true, false]; 2] };
    let ring = Annulus { inner: 0.4, outer: 0.6, quarter: true };
    let mut body = Body::annulus(&ring, grid.spacing, 2, 2.0).unwrap();
    for (v, X) in body.particles.v.iter_mut().zip(&body.particles.X) {
        *v = X * 2.0;
    }
    let settings = settings(Shape::Cpdi2, Integrator::Cd, Transfer::Flip);
    let mut simulation = General::new(grid, body, SOFT, settings).unwrap();
    for _ in 0..50 {
        simulation.step(&NoBodyForce).unwrap();
    }
    let mesh = simulation.body().mesh.as_ref().unwrap();
    for (x, X) in mesh.x.iter().zip(&mesh.X) {
        assert!(x.norm() > X.norm() + 0.01);
        for a in 0..2 {
            assert_eq!(X[a] == 0.0, x[a] == 0.0);
        }
    }
}

#[test]
fn failures_name_the_step_the_particle_and_the_remedy() {
    let grid = open_grid::<2>(4);
    let body = || Body::lattice(&grid, 2, 2.0, |X| X.iter().all(|&x| (0.25..0.75).contains(&x)));
    for shape in SHAPES {
        let run = |body: Body<2>, dt: f64| {
            let settings =
                Settings { time_step: dt, ..settings(shape, Integrator::Usl, Transfer::Flip) };
            let mut simulation = General::new(grid.clone(), body, SOFT, settings).unwrap();
            let error = (0..200).find_map(|_| simulation.step(&NoBodyForce).err()).unwrap();
            assert_eq!(simulation.step(&NoBodyForce), Err(error.clone()), "{shape:?}");
            error
        };
        let mut flying = body();
        flying.particles.v.fill(vector![1.0, 0.0]);
        let error = run(flying, 1e-2);
        assert!(matches!(error, StepError::LeftGrid { axis: 0, .. }), "{shape:?} {error}");

        let mut falling_in = body();
        for (v, X) in falling_in.particles.v.iter_mut().zip(&falling_in.particles.X) {
            *v = (vector![0.5, 0.5] - X) * 200.0;
        }
        let error = run(falling_in, 1e-2);
        assert!(
            matches!(error, StepError::Inverted { step: 1, .. } | StepError::LeftGrid { .. }),
            "{shape:?} {error}"
        );
    }
    let nan = |_: &[Vector2<f64>], _: f64, b: &mut [Vector2<f64>]| b.fill(vector![f64::NAN, 0.0]);
    let settings = settings(Shape::Cpdi2, Integrator::Cd, Transfer::Flip);
    let mut simulation = General::new(grid.clone(), body(), SOFT, settings).unwrap();
    let error = simulation.step(&nan).unwrap_err();
    assert!(matches!(error, StepError::NotFinite { step: 1, particle: 0, .. }), "{error}");
}

#[test]
fn set_ups_that_make_no_sense_are_refused() {
    let grid = open_grid::<2>(4);
    let flat = settings(Shape::Cpdi2, Integrator::Cd, Transfer::Flip);
    let body = Body::lattice(&grid, 2, 2.0, |X| X.norm() < 0.5);
    let refused = |body: &Body<2>, settings| {
        General::new(grid.clone(), body.clone(), SOFT, settings).unwrap_err()
    };
    let without = Body { mesh: None, ..body.clone() };
    assert_eq!(refused(&without, flat), SetupError::NoCorners { dimension: 2 });
    let mut wrong = body.clone();
    wrong.mesh.as_mut().unwrap().corners[3][2] = 1000;
    assert!(matches!(refused(&wrong, flat), SetupError::NoSuchCorner { corner: 1000, .. }));
    let mut idle = body.clone();
    let mesh = idle.mesh.as_mut().unwrap();
    mesh.X.push(vector![7.0, 7.0]);
    let corner = mesh.x.len();
    assert!(matches!(refused(&idle, flat), SetupError::LengthMismatch { .. }));
    idle.mesh.as_mut().unwrap().x.push(vector![7.0, 7.0]);
    assert_eq!(refused(&idle, flat), SetupError::IdleCorner { corner });
    let ring = Body::annulus(&Annulus { inner: 0.4, outer: 0.6, quarter: true }, 0.25, 2, 1.0);
    let gimp = Settings { shape: Shape::Gimp, ..flat };
    assert_eq!(refused(&ring.unwrap(), gimp), SetupError::NotABox { particle: 0 });
    let filter = Settings { transfer: Transfer::Xpic(0), ..flat };
    assert!(matches!(refused(&body, filter), SetupError::NotPositive { .. }));
    let halved = Settings { integrator: Integrator::Usavg, halve_first_acceleration: true, ..flat };
    assert!(matches!(refused(&body, halved), SetupError::HalvedStart { .. }));
    let mut turned = body.clone();
    turned.mesh.as_mut().unwrap().corners[5].reverse();
    let error = refused(&turned, flat);
    let initial =
        SetupError::InitialState(StepError::Inverted { step: 0, time: 0.0, particle: 5, J: -1.0 });
    assert_eq!(error, initial);
    let solid = Grid { cells: [4; 3], ..open_grid::<3>(4) };
    let cube = Body::lattice(&solid, 2, 2.0, |_| true);
    let error = General::new(solid, cube, SOFT, flat).unwrap_err();
    assert_eq!(error, SetupError::NoCorners { dimension: 3 });
}

#[test]
fn a_domain_wider_than_the_grid_can_hold_is_refused() {
    let grid = open_grid::<2>(8);
    for shape in [Shape::Gimp, Shape::Cpdi, Shape::Cpdi2] {
        let mut body = Body::lattice(&grid, 1, 2.0, |X| X.norm() < 0.1);
        body.particles.F[0] = Matrix2::from_diagonal(&vector![5.0, 1.0]);
        let mesh = body.mesh.as_mut().unwrap();
        mesh.x.iter_mut().for_each(|x| x[0] += 4.0 * (x[0] - body.particles.X[0][0]));
        let settings = settings(shape, Integrator::Cd, Transfer::Flip);
        let error = General::new(grid.clone(), body, SOFT, settings).unwrap_err();
        let SetupError::InitialState(StepError::TooLarge {
            particle: 0, axis: 0, half_size, ..
        }) = error
        else {
            panic!("{shape:?}: {error}");
        };
        assert!((half_size - 2.5 * grid.spacing).abs() < 1e-15);
    }
}
