//! Conservation by splines in the reference configuration: momentum, energy to the order in time, the way back; and failures of runs
//! and set-ups.

#![allow(clippy::unwrap_used)]

use mmsmith_galerkin::{
    Axis, Composition, Coordinates, End, Grid, Layout, MassMatrix, Quantity, Scheme, Side,
    TotalLagrangian,
};
use mmsmith_laws::Material;
use mmsmith_particles::{NoBodyForce, SetupError, StepError};
use nalgebra::{SMatrix, SVector, Vector1, Vector2, vector};

const LAMBDA: f64 = 60.0;
const MU: f64 = 40.0;
const SOFT: Material<f64> = Material::StVenantKirchhoff { lambda: LAMBDA, mu: MU };
const DENSITY: f64 = 2.0;

fn scheme(degree: usize, composition: Composition) -> Scheme {
    Scheme { degree, mass: MassMatrix::Consistent, composition }
}

fn open_box<const D: usize>(cells: usize) -> Grid<D> {
    Grid {
        axes: [Axis { lower: 0.0, upper: 1.0, cells, ends: [End::FREE; 2] }; D],
        coordinates: Coordinates::Cartesian,
        per_cell: 4,
        layout: Layout::Gauss,
    }
}

/// A sector of a ring, free on all sides, in polar coordinates.
fn sector() -> Grid<2> {
    let ends = [End::FREE; 2];
    Grid {
        axes: [
            Axis { lower: 0.5, upper: 1.0, cells: 3, ends },
            Axis { lower: 0.2, upper: 1.4, cells: 4, ends },
        ],
        coordinates: Coordinates::Polar,
        per_cell: 4,
        layout: Layout::Gauss,
    }
}

/// A whole ring, in polar coordinates.
fn ring() -> Grid<2> {
    let mut ring = sector();
    ring.axes[1] =
        Axis { lower: 0.0, upper: std::f64::consts::TAU, cells: 16, ends: [End::Periodic; 2] };
    ring
}

/// A part of a spherical shell between two cones and two half planes, free on all sides.
fn shell() -> Grid<3> {
    let ends = [End::FREE; 2];
    Grid {
        axes: [
            Axis { lower: 0.5, upper: 1.0, cells: 2, ends },
            Axis { lower: 0.7, upper: 1.9, cells: 4, ends },
            Axis { lower: 0.2, upper: 1.1, cells: 3, ends },
        ],
        coordinates: Coordinates::Spherical,
        per_cell: 4,
        layout: Layout::Gauss,
    }
}

/// The outward normal of a side.
fn normal<const D: usize>(
    coordinates: Coordinates,
    side: Side,
    X: &SVector<f64, D>,
) -> SVector<f64, D> {
    let unit = |axis: usize| SVector::<f64, D>::from_fn(|i, _| f64::from(u8::from(i == axis)));
    let along = X.normalize();
    let axis = match (coordinates, side.axis) {
        (Coordinates::Cartesian, axis) | (Coordinates::Cylindrical, axis @ 2) => unit(axis),
        (Coordinates::Cylindrical, 0) => {
            SVector::<f64, D>::from_fn(|i, _| if i < 2 { X[i] } else { 0.0 }).normalize()
        }
        (_, 0) => along,
        (Coordinates::Polar | Coordinates::Cylindrical, _) | (_, 2) => {
            (unit(1) * X[0] - unit(0) * X[1]).normalize()
        }
        (Coordinates::Spherical, _) => (along * along[2] - unit(2)).normalize(),
    };
    if side.upper { axis } else { -axis }
}

/// A body set in motion without regularity.
fn moving<const D: usize>(grid: Grid<D>, scheme: Scheme, dt: f64) -> TotalLagrangian<D> {
    let mut body = TotalLagrangian::new(grid, scheme, SOFT, DENSITY, dt).unwrap();
    let field = |scale: f64, phase: f64| -> Vec<SVector<f64, D>> {
        let at = |X: &SVector<f64, D>| {
            SVector::from_fn(|a, _| {
                let arguments = X.iter().enumerate().map(|(k, x)| (1.5 + 0.7 * k as f64) * x);
                scale * (phase + a as f64 + arguments.sum::<f64>()).sin()
            })
        };
        body.positions().iter().map(at).collect()
    };
    let (u, v) = (field(0.05, 0.3), field(0.5, 1.1));
    body.start(&u, &v).unwrap();
    body
}

fn momentum<const D: usize>(body: &mut TotalLagrangian<D>) -> SVector<f64, D> {
    let particles = body.observe();
    particles.v.iter().zip(&particles.mass).map(|(v, &m)| v * m).sum()
}

/// Kinetic energy and the strain energy of St. Venant and Kirchhoff.
fn energy<const D: usize>(body: &mut TotalLagrangian<D>) -> f64 {
    let particles = body.observe();
    let of = |p: usize| {
        let F = particles.F[p];
        let E = (F.transpose() * F - SMatrix::identity()) * 0.5;
        let strain = 0.5 * LAMBDA * E.trace().powi(2) + MU * E.norm_squared();
        0.5 * particles.mass[p] * particles.v[p].norm_squared() + particles.volume[p] * strain
    };
    (0..particles.len()).map(of).sum()
}

#[test]
fn momentum_changes_by_the_body_force_only() {
    fn check<const D: usize>(grid: Grid<D>) {
        let mut body = moving(grid, scheme(3, Composition::Order4), 2e-3);
        let (before, mass) = (momentum(&mut body), body.observe().mass.iter().sum::<f64>());
        let force = SVector::<f64, D>::from_fn(|a, _| 1.0 + a as f64);
        let b = |_: &[SVector<f64, D>], _: f64, b: &mut [SVector<f64, D>]| b.fill(force);
        for _ in 0..10 {
            body.step(&b).unwrap();
        }
        let expected = before + force * (mass * body.time());
        assert!((momentum(&mut body) - expected).norm() < 1e-12 * expected.norm());
    }
    check(open_box::<1>(6));
    check(open_box::<2>(4));
    check(open_box::<3>(3));
}

#[test]
fn energy_is_kept_to_the_order_of_the_composition() {
    fn check<const D: usize>(grid: &Grid<D>, degree: usize, composition: Composition, dt: f64) {
        let drift = |parts: usize| {
            let mut body = moving(grid.clone(), scheme(degree, composition), dt / parts as f64);
            let before = energy(&mut body);
            for _ in 0..10 * parts {
                body.step(&NoBodyForce).unwrap();
            }
            (energy(&mut body) / before - 1.0).abs()
        };
        let (coarse, fine) = (drift(1), drift(2));
        let order = (coarse / fine).log2();
        let expected = composition.order() as f64;
        assert!((order - expected).abs() < 0.5, "{composition:?}: {coarse:e} {fine:e}, {order}");
    }
    check(&open_box::<1>(6), 2, Composition::Order2, 2e-3);
    check(&open_box::<2>(3), 3, Composition::Order4, 6e-3);
    check(&open_box::<2>(3), 3, Composition::Order6, 5e-3);
    // Tangential motion and its connection terms are in the energy, too.
    check(&sector(), 3, Composition::Order4, 1.5e-3);
    check(&ring(), 3, Composition::Order4, 1.5e-3);
    check(&shell(), 3, Composition::Order4, 1.5e-3);
}

#[test]
fn a_body_whose_velocities_are_reversed_returns() {
    for (degree, composition) in
        [(2, Composition::Order2), (3, Composition::Order4), (5, Composition::Order6)]
    {
        for mass in [MassMatrix::Consistent, MassMatrix::Lumped] {
            let scheme = Scheme { mass, ..scheme(degree, composition) };
            let mut body = moving(sector(), scheme, 1e-3);
            let start = body.observe().clone();
            (0..20).for_each(|_| body.step(&NoBodyForce).unwrap());
            let there = body.observe().clone();
            let u: Vec<_> = there.x.iter().zip(&there.X).map(|(x, X)| x - X).collect();
            let v: Vec<_> = there.v.iter().map(|v| -v).collect();
            body.start(&u, &v).unwrap();
            (0..20).for_each(|_| body.step(&NoBodyForce).unwrap());
            let back = body.observe();
            for p in 0..back.len() {
                assert!((there.x[p] - start.x[p]).norm() > 1e-4);
                assert!((back.x[p] - start.x[p]).norm() < 1e-11, "{degree} {mass:?}");
                assert!((back.v[p] + start.v[p]).norm() < 1e-9, "{degree} {mass:?}");
            }
        }
    }
}

#[test]
fn curvilinear_coordinates_give_the_cartesian_fields() {
    fn check<const D: usize>(grid: Grid<D>, content: f64) {
        let scheme = scheme(5, Composition::Order2);
        let mut body = TotalLagrangian::new(grid, scheme, SOFT, DENSITY, 1e-3).unwrap();
        let shear = affine::<D>();
        let spin = SMatrix::<f64, D, D>::from_fn(|i, k| (i as f64 - k as f64) * 2.0);
        let u: Vec<_> = body.positions().iter().map(|X| shear * X).collect();
        let v: Vec<_> = body.positions().iter().map(|X| spin * X + SVector::repeat(1.0)).collect();
        body.start(&u, &v).unwrap();
        let particles = body.observe();
        let volume: f64 = particles.volume.iter().sum();
        assert!((volume - content).abs() < 1e-13, "{volume} instead of {content}");
        let mass: f64 = particles.mass.iter().sum();
        assert!((mass - DENSITY * content).abs() < 1e-13);
        for p in 0..particles.len() {
            // Cosine and sine are no splines, but quintic ones are close.
            assert!((particles.F[p] - SMatrix::identity() - shear).norm() < 1e-5);
            assert!((particles.x[p] - particles.X[p] - u[p]).norm() < 1e-6);
            assert!((particles.v[p] - v[p]).norm() < 2e-6);
        }
    }
    let (mut sector, mut shell) = (sector(), shell());
    sector.axes[1].cells = 12;
    (shell.axes[1].cells, shell.axes[2].cells) = (12, 9);
    check(sector, 0.5 * 1.2 * (1.0 - 0.25));
    check(shell, 0.9 * (0.7_f64.cos() - 1.9_f64.cos()) * (1.0 - 0.125) / 3.0);
}

#[test]
fn a_uniform_body_force_moves_a_body_as_a_whole_in_any_coordinates() {
    fn check<const D: usize>(grid: Grid<D>) {
        let coordinates = grid.coordinates;
        let scheme = scheme(5, Composition::Order2);
        let mut body = TotalLagrangian::new(grid, scheme, SOFT, DENSITY, 1e-3).unwrap();
        let force = SVector::<f64, D>::from_fn(|a, _| 1.0 - 1.7 * a as f64);
        let b = |_: &[SVector<f64, D>], _: f64, b: &mut [SVector<f64, D>]| b.fill(force);
        (0..5).for_each(|_| body.step(&b).unwrap());
        let (t, particles) = (body.time(), body.observe());
        for p in 0..particles.len() {
            let u = particles.x[p] - particles.X[p];
            let off = [(particles.v[p] / t - force).norm(), (u / (0.5 * t * t) - force).norm()];
            assert!(off.iter().all(|&off| off < 1e-4), "{coordinates:?} {off:?}");
        }
    }
    let (mut sector, mut shell) = (sector(), shell());
    sector.axes[1].cells = 12;
    (shell.axes[1].cells, shell.axes[2].cells) = (12, 9);
    check(open_box::<1>(4));
    check(open_box::<2>(3));
    check(sector);
    check(shell);
}

/// A displacement gradient without any symmetry.
fn affine<const D: usize>() -> SMatrix<f64, D, D> {
    SMatrix::from_fn(|i, k| [[0.1, 0.3, -0.15], [-0.2, 0.05, 0.1], [0.07, -0.12, -0.08]][i][k])
}

/// A motion far from radial has all terms of gradients and forces; where one is wrong the body moves by an amount that does not depend on
/// the grid.
#[test]
fn a_homogeneous_deformation_is_in_equilibrium_with_its_tractions() {
    fn check<const D: usize>(grid: &Grid<D>, dt: f64) {
        let H = affine::<D>();
        let F = SMatrix::identity() + H;
        let E = (F.transpose() * F - SMatrix::identity()) * 0.5;
        let P = F * (SMatrix::identity() * (LAMBDA * E.trace()) + E * (2.0 * MU));
        let moved = |factor: usize| {
            let mut grid = grid.clone();
            for axis in &mut grid.axes {
                (axis.cells, axis.ends) = (axis.cells * factor, [End::LOADED; 2]);
            }
            let coordinates = grid.coordinates;
            let scheme = scheme(3, Composition::Order4);
            let mut body = TotalLagrangian::new(grid, scheme, SOFT, DENSITY, dt).unwrap();
            let u: Vec<_> = body.positions().iter().map(|X| H * X).collect();
            let traction = |of: Quantity,
                            side: Side,
                            X: &[SVector<f64, D>],
                            _: f64,
                            values: &mut [SVector<f64, D>]| {
                assert_eq!(of, Quantity::Traction);
                let on = |X| P * normal(coordinates, side, X);
                values.iter_mut().zip(X).for_each(|(value, X)| *value = on(X));
            };
            body.start(&u, &vec![SVector::zeros(); u.len()]).unwrap();
            (0..20).for_each(|_| body.step_with_boundary(&NoBodyForce, &traction).unwrap());
            let particles = body.observe();
            let off = (0..u.len()).map(|p| (particles.x[p] - particles.X[p] - u[p]).norm());
            off.fold(0.0, f64::max)
        };
        let (coarse, fine) = (moved(1), moved(2));
        if grid.coordinates == Coordinates::Cartesian {
            assert!(coarse < 1e-13 && fine < 1e-13, "{coarse:e} {fine:e}");
        } else {
            let order = (coarse / fine).log2();
            assert!(fine < 1e-4 && order > 3.8, "{coarse:e} {fine:e}, {order}");
        }
    }
    check(&open_box::<3>(2), 1e-3);
    check(&sector(), 1e-3);
    check(&shell(), 1e-3);
}

#[test]
fn lumped_mass_carries_a_uniform_acceleration_between_walls_along_them() {
    let wall = Axis { lower: 0.0, upper: 1.0, cells: 4, ends: [End::Wall; 2] };
    for degree in 2..=5 {
        for mass in [MassMatrix::Consistent, MassMatrix::Lumped] {
            let grid = Grid {
                axes: [wall, Axis { ends: [End::FREE; 2], ..wall }],
                coordinates: Coordinates::Cartesian,
                per_cell: 3,
                layout: Layout::Gauss,
            };
            let scheme = Scheme { mass, ..scheme(degree, Composition::Order2) };
            let mut body = TotalLagrangian::new(grid, scheme, SOFT, DENSITY, 1e-3).unwrap();
            let b = |_: &[Vector2<f64>], _: f64, b: &mut [Vector2<f64>]| b.fill(vector![0.0, 3.0]);
            (0..10).for_each(|_| body.step(&b).unwrap());
            for v in &body.observe().v {
                assert!((v - vector![0.0, 0.03]).norm() < 1e-12, "{degree} {mass:?} {v}");
            }
        }
    }
}

#[test]
fn failures_name_step_time_and_particle() {
    let line = || moving(open_box::<1>(4), scheme(3, Composition::Order2), 1e-3);
    let mut body = line();
    let squeeze = |X: &[Vector1<f64>], _: f64, b: &mut [Vector1<f64>]| {
        b.iter_mut().zip(X).for_each(|(b, X)| b[0] = if X[0] > 0.5 { -1e5 } else { 1e5 });
    };
    let error = (0..100).find_map(|_| body.step(&squeeze).err()).unwrap();
    let StepError::Inverted { step, time, particle, J } = &error else { panic!("{error}") };
    assert_eq!(*step, body.steps_done() + 1);
    assert!((time - *step as f64 * 1e-3).abs() < 1e-15 && *J <= 0.0);
    assert_eq!(body.particles().F[*particle][0], *J);
    assert_eq!(body.step(&NoBodyForce), Err(error));

    let mut body = line();
    let undefined = |_: &[Vector1<f64>], _: f64, b: &mut [Vector1<f64>]| b[5][0] = f64::NAN;
    let outcome = (0..3).find_map(|_| body.step(&undefined).err());
    assert!(matches!(outcome, Some(StepError::NotFinite { step: 1, .. })), "{outcome:?}");
}

#[test]
fn set_ups_that_make_no_sense_are_refused() {
    let fine = (open_box::<2>(6), scheme(3, Composition::Order4), 1e-3);
    let message = |change: &dyn Fn(&mut (Grid<2>, Scheme, f64))| {
        let mut given = fine.clone();
        change(&mut given);
        let (grid, scheme, dt) = given;
        TotalLagrangian::new(grid, scheme, SOFT, DENSITY, dt).map(|_| ()).unwrap_err()
    };
    let has = |error: SetupError, part: &str| {
        assert!(error.to_string().contains(part), "{error}");
    };
    has(message(&|(_, scheme, _)| scheme.degree = 6), "2 to 5");
    has(message(&|(_, scheme, _)| scheme.degree = 1), "2 to 5");
    has(message(&|(_, _, dt)| *dt = f64::NAN), "the time step");
    has(message(&|(grid, _, _)| grid.per_cell = 0), "particles per cell");
    has(message(&|(grid, _, _)| grid.per_cell = 1), "singular");
    has(message(&|(grid, _, _)| grid.axes[1].cells = 0), "axis 1");
    has(message(&|(grid, _, _)| grid.axes[0].upper = 0.0), "the length of axis 0");
    has(message(&|(grid, _, _)| grid.coordinates = Coordinates::Polar), "the inner radius");
    let mixed = |grid: &mut Grid<2>| {
        grid.axes[0].ends = [End::Wall, End::FREE];
        grid.axes[0].cells = 2;
    };
    has(message(&|(grid, _, _)| mixed(grid)), "at least 3");
    has(message(&|(grid, _, _)| grid.axes[0].cells = 1 << 40), "memory");
    has(
        message(&|(grid, _, _)| grid.axes[1].ends[0] = End::Periodic),
        "axis 1 is periodic at one end",
    );
    let short = |grid: &mut Grid<2>| {
        grid.axes[0].ends = [End::Periodic; 2];
        grid.axes[0].cells = 3;
    };
    has(message(&|(grid, _, _)| short(grid)), "at least 4");
    let polar = Grid { coordinates: Coordinates::Polar, ..open_box::<1>(4) };
    let error = TotalLagrangian::new(polar, fine.1, SOFT, DENSITY, 1e-3).unwrap_err();
    assert_eq!(error, SetupError::PolarDimension { dimension: 1 });
    has(
        message(&|(grid, _, _)| grid.coordinates = Coordinates::Spherical),
        "spherical and cylindrical grids are three-dimensional; this one has dimension 2",
    );
    for (axis, [lower, upper], part) in [
        (0, [0.0, 1.0], "the inner radius"),
        (1, [0.0, 1.5], "the least polar angle"),
        (1, [1.0, 3.2], "pi minus the largest polar angle"),
    ] {
        let mut grid = shell();
        (grid.axes[axis].lower, grid.axes[axis].upper) = (lower, upper);
        has(TotalLagrangian::new(grid, fine.1, SOFT, DENSITY, 1e-3).unwrap_err(), part);
    }
    let mut body = TotalLagrangian::new(fine.0, fine.1, SOFT, DENSITY, 1e-3).unwrap();
    assert!(matches!(body.start(&[], &[]), Err(SetupError::LengthMismatch { found: 0, .. })));
}

/// On grids that are large enough for every loop to be shared among threads.
#[test]
fn runs_have_the_same_bits_on_any_number_of_threads() {
    fn check<const D: usize>(grid: Grid<D>, scheme: Scheme) {
        let force = |X: &[SVector<f64, D>], t: f64, b: &mut [SVector<f64, D>]| {
            b.iter_mut().zip(X).for_each(|(b, X)| *b = X.map(|x| 3.0 * x + 5.0 * t));
        };
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut body = moving(grid.clone(), scheme, 1e-6);
                (0..2).for_each(|_| body.step(&force).unwrap());
                let state: Vec<Vec<u8>> = body.state().iter().map(|part| part.to_vec()).collect();
                let particles = body.observe();
                (state, particles.x.clone(), particles.v.clone(), particles.F.clone())
            })
        };
        let one = run(1);
        assert!(run(2) == one && run(3) == one, "{scheme:?} {:?}", grid.coordinates);
    }
    for mass in [MassMatrix::Consistent, MassMatrix::Lumped] {
        for degree in [3, 4] {
            let scheme = Scheme { degree, mass, composition: Composition::Order2 };
            check::<1>(open_box(5_000), scheme);
            check::<2>(open_box(48), scheme);
            check::<3>(open_box(9), scheme);
            let mut fine = ring();
            (fine.axes[0].cells, fine.axes[1].cells) = (32, 64);
            check(fine, scheme);
        }
    }
}
