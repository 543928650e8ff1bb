//! Properties that every scheme keeps: free flight, symmetry at walls, the same motion in one dimension and in three, bits on any
//! number of threads; and how runs and set-ups fail.

use mmsmith_mpm::{
    Body, Grid, Integrator, Material, Mesh, NoBodyForce, Particles, Scalar, Settings, SetupError,
    Shape, Simulation, StepError, Transfer,
};
use nalgebra::{Matrix2, SMatrix, SVector, Vector1, Vector2, Vector3, vector};

use crate::schemes::{INTEGRATORS, SHAPES, block, noise, open_grid, schemes, some_schemes};

const SOFT: Material<f64> = Material::NeoHookean { lambda: 60.0, mu: 40.0 };

/// Every shape with every integrator, by FLIP.
fn flip_schemes() -> impl Iterator<Item = Settings<f64>> {
    SHAPES
        .into_iter()
        .flat_map(|shape| INTEGRATORS.map(|integrator| settings(shape, integrator, 1e-3)))
}

fn settings(shape: Shape, integrator: Integrator, time_step: f64) -> Settings<f64> {
    let transfer = Transfer::Flip;
    Settings { shape, integrator, transfer, time_step, halve_first_acceleration: false }
}

#[test]
fn a_free_body_flies_straight() {
    fn check<const D: usize>()
    where
        f64: Scalar<D>,
    {
        for settings in flip_schemes() {
            let grid = open_grid::<D>(10);
            let mut body =
                Body::lattice(&grid, 2, 2.0, |X| X.iter().all(|&x| (0.1..0.3).contains(&x)));
            let v = SVector::<f64, D>::from_fn(|a, _| 1.0 - 0.3 * a as f64);
            body.particles.v.fill(v);
            let settings = Settings { time_step: 2e-3, ..settings };
            let mut simulation = Simulation::new(grid, body, SOFT, settings).unwrap();
            for _ in 0..250 {
                simulation.step(&NoBodyForce).unwrap();
            }
            let p = simulation.particles();
            for k in 0..p.len() {
                let off = (p.x[k] - p.X[k] - v * 0.5).norm();
                assert!(off < 1e-10, "{settings:?}: {off:e}");
                assert!((p.v[k] - v).norm() < 1e-10);
                assert!((p.F[k] - SMatrix::identity()).norm() < 1e-9);
            }
        }
    }
    check::<1>();
    check::<2>();
    check::<3>();
}

/// Particles near a wall, and the same with their mirror images on a grid without that wall.
#[test]
fn a_wall_is_a_mirror() {
    let h = 0.1;
    let points = [vector![0.012, 0.213], vector![0.031, 0.344], vector![0.117, 0.262]];
    for per_cell_size in [0.25, 0.45, 1.3] {
        for settings in schemes() {
            let body = |mirrored: bool| {
                let mut p = Particles {
                    X: vec![],
                    x: vec![],
                    v: vec![],
                    F: vec![],
                    mass: vec![],
                    volume: vec![],
                    half_size: Vector2::repeat(per_cell_size * h),
                    ..Particles::default()
                };
                let (mut places, mut moved, mut cells) = (vec![], vec![], vec![]);
                for side in if mirrored { vec![1.0, -1.0] } else { vec![1.0] } {
                    for (k, X) in points.iter().enumerate() {
                        let reflect = Matrix2::new(side, 0.0, 0.0, 1.0);
                        p.X.push(reflect * X);
                        p.x.push(reflect * X);
                        p.v.push(reflect * vector![noise(k), noise(k + 9)]);
                        let F = Matrix2::new(1.0 + 0.1 * noise(k + 1), 0.1, -0.05, 1.1);
                        p.F.push(reflect * F * reflect);
                        p.mass.push(1.0 + 0.1 * k as f64);
                        p.volume.push(h * h / 4.0);
                        let first = places.len() as u32;
                        for (k, sign) in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
                            .map(Vector2::from)
                            .into_iter()
                            .enumerate()
                        {
                            let corner = X + sign.component_mul(&p.half_size);
                            places.push(reflect * corner);
                            let away = vector![noise(k + 5), noise(k + 17)] * (0.1 * h);
                            moved.push(reflect * (corner + away));
                        }
                        // Counter-clockwise in the image, too.
                        let mut corners = [0, 1, 2, 3].map(|k| first + k);
                        if side < 0.0 {
                            corners.reverse();
                        }
                        cells.extend(corners);
                    }
                }
                let mesh = Mesh { x: moved, ..Mesh::cells(places, cells) };
                Body { mesh: Some(mesh), ..p.into() }
            };
            let wall = Grid {
                lower: vector![0.0, 0.0],
                spacing: h,
                cells: [6, 6],
                walls: [[true, false], [false; 2]],
            };
            let open = Grid {
                lower: vector![-0.6, 0.0],
                cells: [12, 6],
                walls: [[false; 2]; 2],
                ..wall.clone()
            };
            let b = |X: &[Vector2<f64>], t: f64, b: &mut [Vector2<f64>]| {
                for (X, b) in X.iter().zip(b) {
                    *b = vector![3.0 * X[0], X[1] + t];
                }
            };
            let mut one = Simulation::new(wall, body(false), SOFT, settings).unwrap();
            let mut two = Simulation::new(open, body(true), SOFT, settings).unwrap();
            for _ in 0..20 {
                one.step(&b).unwrap();
                two.step(&b).unwrap();
            }
            let (one, two) = (one.particles(), two.particles());
            for k in 0..one.len() {
                let what = format!("{settings:?} {per_cell_size} {k}");
                assert!((one.x[k] - two.x[k]).norm() < 1e-12, "{what}");
                assert!((one.v[k] - two.v[k]).norm() < 1e-11, "{what}");
                assert!((one.F[k] - two.F[k]).norm() < 1e-11, "{what}");
            }
        }
    }
}

#[test]
fn bits_do_not_depend_on_the_number_of_threads() {
    fn run<T: mmsmith_mpm::Scalar<D>, const D: usize>(
        cells: usize,
        scheme: Settings<f64>,
        threads: usize,
    ) -> (Particles<T, D>, Option<Mesh<T, D>>) {
        fn real<T: nalgebra::RealField>(x: f64) -> T {
            nalgebra::convert(x)
        }
        let grid = Grid {
            lower: SVector::zeros(),
            spacing: real(1.0 / cells as f64),
            cells: [cells; D],
            walls: [[true, false]; D],
        };
        // Along the wall across axis 0, and through many rows along the last axis.
        let mut body = Body::lattice(&grid, 2, real(2.0), |X| {
            X.iter().all(|&x| x < real(0.5)) && X[D - 1] > real(0.2)
        });
        let p = &mut body.particles;
        for k in 0..p.len() {
            p.v[k] =
                SVector::from_fn(|a, _| real::<T>(0.01 * noise(k + a)) + p.X[k][a] * real(0.1));
            p.v[k][D - 1] += real(4.0);
        }
        let material = Material::NeoHookean { lambda: real(60.0), mu: real(40.0) };
        let settings = Settings {
            shape: scheme.shape,
            integrator: scheme.integrator,
            transfer: scheme.transfer,
            time_step: real([5e-5, 7e-4, 1.5e-3][D - 1]),
            halve_first_acceleration: false,
        };
        let b = |X: &[SVector<T, D>], t: T, b: &mut [SVector<T, D>]| {
            for (X, b) in X.iter().zip(b) {
                *b = X * t;
            }
        };
        let mut simulation = Simulation::new(grid, body, material, settings).unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        // Long enough for particles to be sorted anew.
        pool.install(|| (0..60).try_for_each(|_| simulation.step(&b))).unwrap();
        let p = simulation.particles();
        assert!(p.x[0][D - 1] - p.X[0][D - 1] > simulation.grid().spacing * real(4.0));
        (p.clone(), simulation.mesh().cloned())
    }
    fn check<T: mmsmith_mpm::Scalar<D>, const D: usize>(cells: usize) {
        // Those of a single pass as well.
        let fused = |of: &Settings<f64>| matches!(of.integrator, Integrator::Usl | Integrator::Cd);
        let all = some_schemes().chain(flip_schemes().filter(fused));
        for (scheme, threads) in all.zip([2, 3].into_iter().cycle()) {
            let one = run::<T, D>(cells, scheme, 1);
            let several = run::<T, D>(cells, scheme, threads);
            assert_eq!(one, several, "{scheme:?} {threads} threads");
        }
    }
    check::<f64, 1>(600);
    check::<f64, 2>(40);
    check::<f32, 2>(40);
    check::<f64, 3>(12);
}

/// Two bodies of as many particles as are handed out at a time: one at rest, and one that flies past it. What is known of the
/// bands of the one must not be taken for those of the other.
#[test]
fn a_body_flies_straight_past_another_through_the_bands() {
    // The waves of any stiffer solid would be too fast for these steps.
    let softest = Material::NeoHookean { lambda: 0.06, mu: 0.04 };
    for settings in flip_schemes() {
        let h = 0.25;
        let grid =
            Grid { lower: Vector2::zeros(), spacing: h, cells: [134, 40], walls: [[false; 2]; 2] };
        let part = |columns: std::ops::Range<f64>, rows: std::ops::Range<f64>| {
            let within =
                move |X: &Vector2<f64>| columns.contains(&(X[0] / h)) && rows.contains(&(X[1] / h));
            Body::lattice(&grid, 2, 2.0, within)
        };
        let (mut body, flying) = (part(0.0..64.0, 18.0..22.0), part(70.0..134.0, 6.0..10.0));
        let (mut one, other) = (body.mesh.unwrap(), flying.mesh.unwrap());
        let first = one.X.len() as u32;
        one.corners.extend(other.corners.iter().map(|corner| first + corner));
        one.X.extend(other.X);
        body.mesh = Some(Mesh::cells(one.X, one.corners));
        body.half_edges.extend(flying.half_edges);
        let (p, flying) = (&mut body.particles, flying.particles);
        assert_eq!((p.len(), flying.len()), (1024, 1024));
        let v = vector![0.0, 1.0];
        p.v.resize(2048, v);
        p.F.extend(flying.F);
        p.x.extend(flying.x);
        p.X.extend(flying.X);
        p.mass.extend(flying.mass);
        p.volume.extend(flying.volume);
        let settings = Settings { time_step: 0.125, ..settings };
        let mut run = Simulation::new(grid, body, softest, settings).unwrap();
        (0..50).for_each(|_| run.step(&NoBodyForce).unwrap());
        let p = run.particles();
        for k in 0..p.len() {
            let moved = if k < 1024 { Vector2::zeros() } else { v * 6.25 };
            let off = (p.x[k] - p.X[k] - moved).norm();
            assert!(off < 1e-10, "{settings:?} {k}: {off:e}");
        }
    }
}

#[test]
fn one_stretched_cell_layer_in_3d_is_the_1d_bar() {
    let bar = |X: f64| 0.3 * (X * std::f64::consts::PI).sin();
    for settings in schemes() {
        let n = 8;
        let line = Grid { walls: [[true; 2]], ..open_grid::<1>(n) };
        let column = Grid {
            lower: Vector3::zeros(),
            spacing: line.spacing,
            cells: [1, n, 1],
            walls: [[true; 2]; 3],
        };
        let mut b1 = Body::lattice(&line, 2, 1.0, |_| true);
        let mut b3 = Body::lattice(&column, 2, 1.0, |_| true);
        let (p1, p3) = (&mut b1.particles, &mut b3.particles);
        for (v, X) in p1.v.iter_mut().zip(&p1.X) {
            *v = Vector1::new(bar(X[0]));
        }
        for (v, X) in p3.v.iter_mut().zip(&p3.X) {
            v[1] = bar(X[1]);
        }
        let mut s1 = Simulation::new(line, b1, SOFT, settings).unwrap();
        let mut s3 = Simulation::new(column, b3, SOFT, settings).unwrap();
        for _ in 0..30 {
            s1.step(&NoBodyForce).unwrap();
            s3.step(&NoBodyForce).unwrap();
        }
        let (p1, p3) = (s1.particles(), s3.particles());
        for k in 0..p3.len() {
            let j = (p3.X[k][1] * 2.0 * n as f64) as usize;
            assert!((p3.x[k][1] - p1.x[j][0]).abs() < 1e-13, "{settings:?}");
            assert!((p3.F[k][(1, 1)] - p1.F[j][0]).abs() < 1e-12);
            assert!((p3.x[k][0] - p3.X[k][0]).abs() < 1e-13);
        }
    }
}

#[test]
fn a_step_that_fails_says_where_and_keeps_saying_it() {
    let fly = |walls: [[bool; 2]; 2], v: Vector2<f64>, spread: f64, dt: f64, shape: Shape| {
        let grid = Grid { walls, ..open_grid::<2>(8) };
        let mut p = Particles::lattice(&grid, 2, 1.0, |X| X.iter().all(|&x| x > 0.5));
        for (velocity, X) in p.v.iter_mut().zip(&p.X) {
            *velocity = v + (X - Vector2::repeat(0.75)) * spread;
        }
        let mut s = Simulation::new(grid, p, SOFT, settings(shape, Integrator::Cd, dt)).unwrap();
        let error = (0..1000).find_map(|_| s.step(&NoBodyForce).err()).unwrap();
        assert_eq!(s.step(&NoBodyForce), Err(error.clone()));
        assert!(error.to_string().contains("particle"));
        error
    };
    let left = fly([[false; 2]; 2], vector![0.0, 1.0], 0.0, 1e-2, Shape::Gimp);
    assert!(matches!(left, StepError::LeftGrid { axis: 1, step: 4, .. }), "{left}");
    let inverted = fly([[false; 2]; 2], Vector2::zeros(), -150.0, 1e-2, Shape::Linear);
    assert!(matches!(inverted, StepError::Inverted { step: 1, J, .. } if J <= 0.0), "{inverted}");

    let grid = open_grid::<2>(8);
    let mut wide = Particles::lattice(&grid, 2, 1.0, |X| (X[0] - 0.3).abs() < 0.05);
    for (v, X) in wide.v.iter_mut().zip(&wide.X) {
        v[0] = (X[0] - 0.3) * 100.0;
    }
    wide.half_size = Vector2::repeat(0.24);
    let mut s =
        Simulation::new(grid.clone(), wide, SOFT, settings(Shape::Gimp, Integrator::Cd, 1e-2))
            .unwrap();
    let error = (0..3).find_map(|_| s.step(&NoBodyForce).err());
    assert!(matches!(error, Some(StepError::TooLarge { axis: 0, .. })), "{error:?}");

    let p = block(&grid).particles;
    let mut s =
        Simulation::new(grid, p, SOFT, settings(Shape::Gimp, Integrator::Cd, 1e-3)).unwrap();
    let b = |X: &[Vector2<f64>], _: f64, b: &mut [Vector2<f64>]| {
        for (X, b) in X.iter().zip(b) {
            *b = Vector2::repeat((0.6 - X[0]).sqrt());
        }
    };
    let error = s.step(&b).unwrap_err();
    assert!(matches!(error, StepError::NotFinite { step: 1, .. }), "{error}");
    assert_eq!(s.steps_done(), 0);
}

type Change<'a> = &'a dyn Fn(&mut Grid<f64, 2>, &mut Particles<f64, 2>, &mut Settings<f64>);

#[test]
fn scenes_that_make_no_sense_are_refused() {
    let refuse = |change: Change| {
        let mut grid = open_grid::<2>(8);
        let mut p = block(&grid).particles;
        let mut settings = settings(Shape::Gimp, Integrator::Usl, 1e-3);
        change(&mut grid, &mut p, &mut settings);
        Simulation::new(grid, p, SOFT, settings).unwrap_err()
    };
    use SetupError as E;
    assert!(matches!(
        refuse(&|_, p, _| p.v.truncate(3)),
        E::LengthMismatch { array: "v", found: 3, .. }
    ));
    assert!(matches!(
        refuse(&|g, p, _| *p = Particles::lattice(g, 2, 1.0, |_| false)),
        E::NoParticles
    ));
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(refuse(&|_, _, s| s.time_step = bad), E::NotPositive { .. }));
        assert!(matches!(refuse(&|g, _, _| g.spacing = bad), E::NotPositive { .. }));
        assert!(matches!(refuse(&|_, p, _| p.mass[5] = bad), E::NotPositive { .. }));
        assert!(matches!(refuse(&|_, p, _| p.volume[5] = bad), E::NotPositive { .. }));
        assert!(matches!(refuse(&|_, p, _| p.half_size[1] = bad), E::NotPositive { .. }));
    }
    assert!(matches!(refuse(&|_, p, _| p.v[2][0] = f64::NAN), E::NotFinite { .. }));
    assert!(matches!(refuse(&|g, _, _| g.lower[0] = f64::NAN), E::NotFinite { .. }));
    assert!(matches!(refuse(&|g, _, _| g.cells[1] = 0), E::NoCells { axis: 1 }));
    assert!(matches!(refuse(&|_, _, s| s.halve_first_acceleration = true), E::HalvedStart { .. }));
    assert!(matches!(
        refuse(&|g, _, _| g.cells = [1 << 31, 1 << 20]),
        E::GridTooLarge { bytes, .. } if bytes > 1 << 50
    ));
    assert!(matches!(
        refuse(&|_, p, _| p.x[4][1] = -0.1),
        E::InitialState(StepError::LeftGrid { particle: 4, axis: 1, step: 0, .. })
    ));
    assert!(matches!(
        refuse(&|_, p, _| p.F[4] = -Matrix2::identity() + Matrix2::new(2.0, 0.0, 0.0, 0.0)),
        E::InitialState(StepError::Inverted { particle: 4, .. })
    ));
    assert!(matches!(
        refuse(&|_, p, _| p.x[4][1] = f64::NAN),
        E::InitialState(StepError::NotFinite { particle: 4, .. })
    ));
    assert!(matches!(
        refuse(&|_, p, _| p.half_size[0] = 1.0),
        E::InitialState(StepError::TooLarge { axis: 0, .. })
    ));
}

#[test]
fn at_small_strain_every_law_moves_a_body_alike() {
    let run = |material: Material<f64>| {
        let grid = Grid { walls: [[true; 2]; 2], ..open_grid::<2>(6) };
        let mut particles = Particles::lattice(&grid, 2, 2.0, |_| true);
        for (v, X) in particles.v.iter_mut().zip(&particles.X) {
            *v = X.map(|x| 1e-6 * (std::f64::consts::PI * x).sin());
        }
        let settings = settings(Shape::Gimp, Integrator::Usl, 2e-3);
        let mut simulation = Simulation::new(grid, particles, material, settings).unwrap();
        (0..100).for_each(|_| simulation.step(&NoBodyForce).unwrap());
        simulation.particles().clone()
    };
    let expected = run(SOFT);
    let moved = |p: &Particles<f64, 2>| -> Vec<Vector2<f64>> {
        p.x.iter().zip(&p.X).map(|(x, X)| x - X).collect()
    };
    let largest = moved(&expected).iter().map(|u| u.amax()).fold(0.0, f64::max);
    assert!(largest > 1e-8, "{largest:e}");
    for material in [
        Material::StVenantKirchhoff { lambda: 60.0, mu: 40.0 },
        Material::Hencky { lambda: 60.0, mu: 40.0 },
        Material::MooneyRivlin { c1: 13.0, c2: 7.0, lambda: 32.0 },
        Material::LinearElastic { lambda: 60.0, mu: 40.0 },
    ] {
        for (u, expected) in moved(&run(material)).iter().zip(moved(&expected)) {
            assert!((u - expected).amax() < 1e-4 * largest, "{material:?}: {u} {expected}");
        }
    }
}
