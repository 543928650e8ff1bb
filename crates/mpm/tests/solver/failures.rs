//! Conditions on a state to be simulated, up to the limits, and which particle a failed step names, with which figures.

#![allow(clippy::unwrap_used)]

use mmsmith_mpm::{
    Annulus, Body, Grid, Integrator, Material, NoBodyForce, Particles, Scalar, Settings,
    SetupError, Shape, Simulation, StepError, Transfer,
};
use nalgebra::{SVector, Vector2};

use crate::schemes::{INTEGRATORS, SHAPES, single};

const SOFT: Material<f64> = Material::NeoHookean { lambda: 60.0, mu: 40.0 };

/// A grid of binary fractions whose axes differ.
fn grid<const D: usize>() -> Grid<f64, D> {
    Grid {
        lower: SVector::from_fn(|a, _| [-0.5, 0.25, 1.0][a]),
        spacing: 0.25,
        cells: std::array::from_fn(|a| 4 + a),
        walls: [[false; 2]; D],
    }
}

fn flip(shape: Shape, integrator: Integrator, time_step: f64) -> Settings<f64> {
    let transfer = Transfer::Flip;
    Settings { shape, integrator, transfer, time_step, halve_first_acceleration: false }
}

/// A body with the half-edges of its domains, and without: boxes then.
fn with_and_without_edges<const D: usize>(body: Body<f64, D>) -> [Body<f64, D>; 2] {
    [body.clone(), Body { half_edges: Vec::new(), ..body }]
}

/// The errors, if any, for the initial state of a body, whose domains are given in either way.
fn refusals<const D: usize>(
    body: &Body<f64, D>,
    shape: Shape,
) -> impl Iterator<Item = Option<StepError>>
where
    f64: Scalar<D>,
{
    let settings = flip(shape, Integrator::Cd, 1e-3);
    with_and_without_edges(body.clone()).into_iter().map(move |body| {
        Simulation::new(grid(), body, SOFT, settings).err().map(|error| match error {
            SetupError::InitialState(error) => error,
            other => panic!("{other}"),
        })
    })
}

/// The largest half-size of a box on these grids, which have a spacing of a quarter.
fn limit_of(shape: Shape) -> f64 {
    if shape == Shape::GimpBspline2 { 0.375 } else { 0.5 }
}

#[test]
fn initial_states_are_admitted_up_to_the_limits() {
    fn check<const D: usize>()
    where
        f64: Scalar<D>,
    {
        let grid = grid::<D>();
        let fine = Body::lattice(&grid, 1, 2.0, |_| true);
        let particle = fine.particles.len() / 2;
        let (step, time) = (0, 0.0);
        let of =
            |shape: Shape, change: &dyn Fn(&mut Body<f64, D>), expected: Option<&StepError>| {
                let mut body = fine.clone();
                change(&mut body);
                for found in refusals(&body, shape) {
                    assert_eq!(found.as_ref(), expected, "{D} {shape:?}");
                }
            };
        for axis in 0..D {
            let (lower, upper) = (grid.lower[axis], grid.upper()[axis]);
            // Domains between corners have limits of their own, see below.
            for shape in SHAPES.into_iter().filter(|&shape| shape != Shape::Cpdi2) {
                for (on, beyond) in
                    [(lower, lower.next_down()), (upper, upper.next_up()), (upper, upper + 9.0)]
                {
                    let put = |x: f64| {
                        move |body: &mut Body<f64, D>| body.particles.x[particle][axis] = x
                    };
                    of(shape, &put(on), None);
                    let mut position: Vec<f64> =
                        fine.particles.x[particle].iter().copied().collect();
                    position[axis] = beyond;
                    let error =
                        StepError::LeftGrid { step, time, particle, position, axis, lower, upper };
                    of(shape, &put(beyond), Some(&error));
                }
                let stretch = |by: f64| {
                    move |body: &mut Body<f64, D>| body.particles.F[particle][(axis, axis)] = by
                };
                for J in [0.0, -0.5] {
                    let error = StepError::Inverted { step, time, particle, J };
                    of(shape, &stretch(J), Some(&error));
                }
                of(shape, &stretch(1e-9), None);
                // Half of a box is half a cell; two cells are the limit, or what splines leave of them.
                let limit = limit_of(shape);
                let too_large = |half_size: f64| StepError::TooLarge {
                    step,
                    time,
                    particle,
                    axis,
                    half_size,
                    limit,
                };
                of(shape, &stretch(limit / 0.125), None);
                let stretches = matches!(shape, Shape::Gimp | Shape::Cpdi | Shape::GimpBspline2);
                let error = too_large(0.125 * 4.5);
                of(shape, &stretch(4.5), stretches.then_some(&error));
            }
            let size = |half: f64| {
                move |body: &mut Body<f64, D>| {
                    body.particles.half_size[axis] = half;
                    body.half_edges.iter_mut().for_each(|E| E[(axis, axis)] = half);
                }
            };
            for shape in [Shape::Ugimp, Shape::Gimp, Shape::Cpdi, Shape::GimpBspline2] {
                let limit = limit_of(shape);
                of(shape, &size(limit), None);
                let (half_size, particle) = (0.5625, 0);
                let error = StepError::TooLarge { step, time, particle, axis, half_size, limit };
                of(shape, &size(0.5625), Some(&error));
            }
        }
    }
    check::<1>();
    check::<2>();
    check::<3>();
}

#[test]
fn what_is_not_finite_is_refused_with_its_position() {
    let body = Body::lattice(&grid::<2>(), 1, 2.0, |_| true);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut moved = body.clone();
        moved.particles.x[3][1] = bad;
        let mut stretched = body.clone();
        stretched.particles.F[3][(0, 0)] = bad;
        for shape in [Shape::Gimp, Shape::Linear, Shape::Cpdi] {
            for error in refusals(&moved, shape) {
                let Some(StepError::NotFinite { step: 0, particle: 3, position, J, .. }) = error
                else {
                    panic!("{shape:?} {error:?}")
                };
                assert_eq!((position[0].to_bits(), J), (body.particles.x[3][0].to_bits(), 1.0));
                assert!(position[1].is_nan() == bad.is_nan() && !position[1].is_finite());
            }
            for error in refusals(&stretched, shape) {
                match error {
                    Some(StepError::NotFinite { particle: 3, J, .. }) if bad.is_nan() => {
                        assert!(J.is_nan());
                    }
                    Some(StepError::NotFinite { particle: 3, J, .. }) => assert_eq!(J, bad),
                    Some(StepError::Inverted { particle: 3, J, .. }) => {
                        assert!(J == bad && bad < 0.0, "{J} {bad}");
                    }
                    error => panic!("{shape:?} {bad} {error:?}"),
                }
            }
        }
    }
}

/// Where one particle is inverted others may follow, so that it is the one to name; of those alike the first.
#[test]
fn of_several_particles_the_one_in_the_worst_trouble_is_named() {
    let mut body = Body::lattice(&grid::<2>(), 1, 2.0, |_| true);
    let settings = flip(Shape::Gimp, Integrator::Cd, 1e-3);
    let mut expect = |change: &dyn Fn(&mut Particles<f64, 2>), is: &dyn Fn(&StepError) -> bool| {
        change(&mut body.particles);
        let error = Simulation::new(grid(), body.clone(), SOFT, settings).unwrap_err();
        let SetupError::InitialState(error) = error else { panic!("{error}") };
        assert!(is(&error), "{error}");
    };
    expect(&|p| p.F[11][(1, 1)] = 7.0, &|error| {
        matches!(error, StepError::TooLarge { particle: 11, axis: 1, .. })
    });
    expect(&|p| p.F[10][(0, 0)] = 7.0, &|error| {
        matches!(error, StepError::TooLarge { particle: 10, axis: 0, .. })
    });
    expect(&|p| p.x[12][0] = 9.0, &|error| {
        matches!(error, StepError::LeftGrid { particle: 12, axis: 0, .. })
    });
    expect(&|p| p.x[13][0] = f64::NAN, &|error| {
        matches!(error, StepError::NotFinite { particle: 13, .. })
    });
    expect(&|p| p.F[14][(0, 0)] = -1.0, &|error| {
        matches!(error, StepError::Inverted { particle: 14, J: -1.0, .. })
    });
    expect(&|p| p.F[9][(0, 0)] = -2.0, &|error| {
        matches!(error, StepError::Inverted { particle: 9, J: -2.0, .. })
    });
}

/// A body of so many particles that they are handed out in several portions, most of which no failure touches.
fn long<const D: usize>(
    shape: Shape,
    integrator: Integrator,
) -> (Grid<f64, D>, Particles<f64, D>, Settings<f64>) {
    let mut cells = [3; D];
    cells[D - 1] = [600, 150, 40][D - 1];
    let grid = Grid { lower: SVector::zeros(), spacing: 1.0, cells, walls: [[false; 2]; D] };
    let particles = Particles::lattice(&grid, 2, 2.0, |_| true);
    (grid, particles, flip(shape, integrator, 0.125))
}

#[test]
fn a_failed_step_names_the_first_particle_that_left_the_grid() {
    fn check<const D: usize>()
    where
        f64: Scalar<D>,
    {
        for shape in [Shape::Linear, Shape::Gimp, Shape::Bspline3, Shape::Cpdi] {
            for integrator in INTEGRATORS {
                for side in [1.0, -1.0] {
                    let (grid, mut particles, settings) = long::<D>(shape, integrator);
                    particles.v.iter_mut().for_each(|v| v[D - 1] = side);
                    let mut run = Simulation::new(grid.clone(), particles, SOFT, settings).unwrap();
                    let error = (0..10).find_map(|_| run.step(&NoBodyForce).err()).unwrap();
                    let p = run.particles();
                    let upper = grid.upper()[D - 1];
                    let is_out = |x: &SVector<f64, D>| !(0.0..=upper).contains(&x[D - 1]);
                    let particle = p.x.iter().position(is_out).unwrap();
                    let position = p.x[particle].iter().copied().collect();
                    let axis = D - 1;
                    // A quarter of a cell to go, of which a step takes an eighth.
                    let (step, time, lower) = (3, 0.375, 0.0);
                    let expected =
                        StepError::LeftGrid { step, time, particle, position, axis, lower, upper };
                    assert_eq!(error, expected, "{shape:?} {integrator:?}");
                    assert!(side < 0.0 || particle > 1100, "{particle}");
                    assert_eq!(run.steps_done(), 2);
                }
            }
        }
    }
    check::<1>();
    check::<2>();
    check::<3>();
}

#[test]
fn a_failed_step_names_the_first_particle_that_is_turned_inside_out() {
    fn check<const D: usize>()
    where
        f64: Scalar<D>,
    {
        for shape in [Shape::Linear, Shape::Gimp, Shape::Bspline3, Shape::Cpdi] {
            for integrator in INTEGRATORS {
                let (grid, mut particles, settings) = long::<D>(shape, integrator);
                let far = 0.95 * grid.upper()[D - 1];
                for (v, X) in particles.v.iter_mut().zip(&particles.X) {
                    v[D - 1] = (far - X[D - 1]).min(0.0) * 40.0;
                }
                let mut run = Simulation::new(grid, particles, SOFT, settings).unwrap();
                let error = run.step(&NoBodyForce).unwrap_err();
                let p = run.particles();
                let particle = p.F.iter().position(|F| F[(D - 1, D - 1)] <= 0.0).unwrap();
                // Nothing is stretched across.
                let J = p.F[particle][(D - 1, D - 1)];
                let StepError::Inverted { step: 1, time: 0.125, particle: named, J: found } = error
                else {
                    panic!("{shape:?} {integrator:?} {error}")
                };
                assert_eq!(named, particle, "{shape:?} {integrator:?}");
                assert!((found - J).abs() < 1e-15 * J.abs().max(1.0));
                assert!(p.X[particle][D - 1] > far - 2.0 && particle > 1100);
                // Where F comes first, a step that fails so has moved nothing.
                let early = matches!(integrator, Integrator::Usf | Integrator::Usavg);
                assert!(!early || p.x == p.X);
                assert!(p.x.iter().chain(&p.v).all(|x| x.iter().all(|x| x.is_finite())));
                assert_eq!(run.step(&NoBodyForce), Err(error));
            }
        }
    }
    check::<1>();
    check::<2>();
    check::<3>();
}

#[test]
fn what_is_not_finite_is_named_before_what_left_the_grid() {
    for integrator in INTEGRATORS {
        let (grid, mut particles, settings) = long::<2>(Shape::Gimp, integrator);
        particles.v.iter_mut().for_each(|v| v[0] = 1.0);
        let hit = particles.X.iter().position(|X| X[1] > 100.0).unwrap();
        let place = particles.X[hit];
        let force = |X: &[SVector<f64, 2>], t: f64, b: &mut [SVector<f64, 2>]| {
            for (X, b) in X.iter().zip(b) {
                *b = SVector::repeat(if *X == place && t >= 0.25 { f64::NAN } else { 0.0 });
            }
        };
        let mut run = Simulation::new(grid, particles, SOFT, settings).unwrap();
        let error = (0..10).find_map(|_| run.step(&force).err()).unwrap();
        // Particles that leave the grid in the same step come before.
        let p = run.particles();
        assert!((0..hit / 2).any(|k| p.x[k][0] > 3.0));
        let is_nan = |k: &usize| p.x[*k].sum().is_nan() || p.F[*k].sum().is_nan();
        let first = (0..p.len()).find(is_nan).unwrap();
        let StepError::NotFinite { step: 3, time: 0.375, particle, J, .. } = error else {
            panic!("{integrator:?} {error}")
        };
        assert_eq!(particle, first);
        assert!(J.is_nan() == p.F[first].determinant().is_nan(), "{integrator:?} {J}");
    }
}

#[test]
fn a_domain_that_grows_too_wide_is_named_with_its_size() {
    fn check<const D: usize>(shape: Shape, axis: usize)
    where
        f64: Scalar<D>,
    {
        for integrator in INTEGRATORS {
            let grid = Grid { cells: [36; D], ..grid::<D>() };
            let middle = (grid.lower + grid.upper()) * 0.5;
            let mut body = Body::lattice(&grid, 2, 2.0, |X| (X - middle).amax() < 0.5);
            let p = &mut body.particles;
            for (v, X) in p.v.iter_mut().zip(&p.X) {
                v[axis] = (X - middle)[axis] * 50.0;
            }
            let settings = flip(shape, integrator, 0.02);
            let softest = Material::NeoHookean { lambda: 0.06, mu: 0.04 };
            let mut run = Simulation::new(grid, body, softest, settings).unwrap();
            let error = (0..20).find_map(|_| run.step(&NoBodyForce).err()).unwrap();
            let p = run.particles();
            let of = |k: usize| match shape {
                Shape::Gimp => p.F[k][(axis, axis)] * 0.0625,
                _ => p.F[k].row(axis).iter().map(|F| F.abs()).sum::<f64>() * 0.0625,
            };
            let particle = (0..p.len()).position(|k| of(k) > 0.5).unwrap();
            let step = run.steps_done() + 1;
            let (time, half_size, limit) = (0.02 * step as f64, of(particle), 0.5);
            let expected = StepError::TooLarge { step, time, particle, axis, half_size, limit };
            assert_eq!(error, expected, "{D} {shape} {integrator:?}");
        }
    }
    for shape in [Shape::Gimp, Shape::Cpdi] {
        check::<1>(shape, 0);
        check::<2>(shape, 0);
        check::<2>(shape, 1);
        check::<3>(shape, 2);
    }
}

/// The figures of errors are those of the simulation, whatever its precision.
#[test]
fn single_precision_has_the_same_limits() {
    let body = Body::lattice(&grid::<2>(), 1, 2.0, |_| true);
    let grid = Grid {
        lower: Vector2::new(-0.5, 0.25),
        spacing: 0.25,
        cells: [4, 5],
        walls: [[false; 2]; 2],
    };
    let material = Material::NeoHookean { lambda: 60.0, mu: 40.0 };
    for shape in SHAPES.into_iter().filter(|&shape| shape != Shape::Cpdi2) {
        let of = |change: &dyn Fn(&mut Body<f32, 2>)| {
            let mut body = single(&body);
            change(&mut body);
            let settings = Settings {
                shape,
                integrator: Integrator::Usl,
                transfer: Transfer::Flip,
                time_step: 1e-3,
                halve_first_acceleration: false,
            };
            Simulation::new(grid.clone(), body, material, settings).err()
        };
        assert_eq!(of(&|body| body.particles.x[3][1] = 1.5), None);
        let beyond = 1.5_f32.next_up();
        let outside = StepError::LeftGrid {
            step: 0,
            time: 0.0,
            particle: 3,
            position: vec![0.375, f64::from(beyond)],
            axis: 1,
            lower: 0.25,
            upper: 1.5,
        };
        let error = of(&|body| body.particles.x[3][1] = beyond);
        assert_eq!(error, Some(SetupError::InitialState(outside)), "{shape}");
        let inverted = StepError::Inverted { step: 0, time: 0.0, particle: 3, J: -0.5 };
        let error = of(&|body| body.particles.F[3][(1, 1)] = -0.5);
        assert_eq!(error, Some(SetupError::InitialState(inverted)), "{shape}");
    }
}

type Change<'a> = &'a dyn Fn(&mut Grid<f64, 2>, &mut Body<f64, 2>, &mut f64);

/// The answer to a change of a sound scene, with the half-edges of domains and without.
fn answers(shape: Shape, change: Change) -> [Option<SetupError>; 2] {
    let (mut grid, mut time_step) = (grid::<2>(), 1e-3);
    let mut body = Body::lattice(&grid, 2, 2.0, |_| true);
    change(&mut grid, &mut body, &mut time_step);
    let transfer = Transfer::Apic;
    let settings = Settings { transfer, ..flip(shape, Integrator::Usl, time_step) };
    with_and_without_edges(body)
        .map(|body| Simulation::new(grid.clone(), body, SOFT, settings).err())
}

#[test]
fn what_has_to_be_positive_and_finite_is_named() {
    let names = |answer: &Option<SetupError>, parts: &[&str], value: f64| {
        let Some(SetupError::NotPositive { quantity, value: found }) = answer else {
            panic!("{parts:?} {value}: {answer:?}")
        };
        assert!(parts.iter().all(|part| quantity.contains(part)), "{quantity} {parts:?}");
        assert!(*found == value || found.is_nan() && value.is_nan());
    };
    let refused = |shape: Shape, change: Change, parts: &[&str], value: f64| {
        answers(shape, change).iter().for_each(|answer| names(answer, parts, value));
    };
    for bad in [0.0, -0.0, -1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for shape in [Shape::Linear, Shape::Gimp, Shape::Cpdi, Shape::Cpdi2] {
            refused(shape, &|_, _, time_step| *time_step = bad, &["the time step"], bad);
            refused(shape, &|grid, _, _| grid.spacing = bad, &["spacing"], bad);
            let mass: Change = &|_, body, _| body.particles.mass[5] = bad;
            refused(shape, mass, &["mass", "particle 5"], bad);
            let volume: Change = &|_, body, _| body.particles.volume[3] = bad;
            refused(shape, volume, &["volume", "particle 3"], bad);
        }
        let flat: Change = &|_, body, _| {
            body.particles.half_size[1] = bad;
            body.half_edges[0][(1, 1)] = bad;
        };
        for shape in [Shape::Ugimp, Shape::Gimp] {
            refused(shape, flat, &["half-size", "axis 1"], bad);
        }
        for shape in [Shape::Linear, Shape::Bspline2, Shape::Bspline3, Shape::Cpdi2] {
            assert!(answers(shape, flat).iter().all(Option::is_none), "a point has no size");
        }
        let [given, boxes] = answers(Shape::Cpdi, flat);
        names(&boxes, &["half-size", "axis 1"], bad);
        if bad.is_finite() {
            names(&given, &["domain", "particle 0"], bad * 0.0625);
        }
    }
    for small in [f64::MIN_POSITIVE, 1e-9] {
        let soft: Change = &|_, _, time_step| *time_step = small;
        assert!(answers(Shape::Gimp, soft).iter().all(Option::is_none));
    }
}

#[test]
fn what_has_to_be_finite_is_named() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for shape in [Shape::Linear, Shape::Gimp, Shape::Cpdi, Shape::Cpdi2] {
            let cases: [(&str, Change); 2] = [
                ("the velocity of particle 7", &|_, body, _| body.particles.v[7][1] = bad),
                ("the reference position of particle 2", &|_, body, _| {
                    body.particles.X[2][0] = bad;
                }),
            ];
            for (expected, change) in cases {
                for answer in answers(shape, change) {
                    let quantity = expected.to_string();
                    assert_eq!(answer, Some(SetupError::NotFinite { quantity }));
                }
            }
        }
    }
}

#[test]
fn arrays_of_another_length_are_named() {
    // Four by five cells.
    let expected = 80;
    let cases: [(&str, Change); 6] = [
        ("x", &|_, body, _| body.particles.x.truncate(79)),
        ("v", &|_, body, _| body.particles.v.truncate(79)),
        ("F", &|_, body, _| body.particles.F.truncate(79)),
        ("mass", &|_, body, _| body.particles.mass.truncate(79)),
        ("volume", &|_, body, _| body.particles.volume.truncate(79)),
        ("half_edges", &|_, body, _| body.half_edges.truncate(79)),
    ];
    for (array, change) in cases {
        for shape in [Shape::Cpdi2, Shape::Cpdi, Shape::Gimp, Shape::Linear] {
            let error = Some(SetupError::LengthMismatch { array, found: 79, expected });
            let [given, boxes] = answers(shape, change);
            assert_eq!(given, error, "{shape}");
            assert_eq!(boxes, if array == "half_edges" { None } else { error }, "{shape}");
        }
    }
}

/// No machine has so much; the figures are those of the nodes, nine more than cells along each axis.
#[test]
fn a_grid_beyond_memory_is_refused_with_the_bytes_it_needs() {
    fn check<const D: usize>(cells: [usize; D], of_node: u128)
    where
        f64: Scalar<D>,
    {
        let body = Body::lattice(&grid::<D>(), 1, 2.0, |_| true);
        let large = Grid { cells, ..grid::<D>() };
        let nodes: u128 = cells.iter().map(|&n| n as u128 + 9).product();
        for (shape, integrator, transfer, grids) in [
            (Shape::Gimp, Integrator::Usf, Transfer::Flip, 1),
            (Shape::Gimp, Integrator::Usavg, Transfer::Apic, 1),
            // Particles add to the grid of the next step.
            (Shape::Gimp, Integrator::Usl, Transfer::Flip, 2),
            (Shape::Bspline3, Integrator::Cd, Transfer::Flip, 2),
            (Shape::Gimp, Integrator::Cd, Transfer::Pic, 2),
            (Shape::Gimp, Integrator::Usl, Transfer::Xpic(1), 1),
            (Shape::Cpdi, Integrator::Cd, Transfer::Apic, 2),
            (Shape::Cpdi, Integrator::Usl, Transfer::Flip, 2),
            // Those that share corners add to these.
            (Shape::Cpdi2, Integrator::Usl, Transfer::Flip, 1),
            (Shape::Cpdi2, Integrator::Cd, Transfer::Apic, 1),
            // Velocities that are projected anew, and the terms of a filter.
            (Shape::Gimp, Integrator::Musl, Transfer::Flip, 2),
            (Shape::Cpdi, Integrator::Musl, Transfer::Apic, 2),
            (Shape::Gimp, Integrator::Usl, Transfer::Xpic(2), 3),
            (Shape::Cpdi2, Integrator::Musl, Transfer::Xpic(5), 3),
        ] {
            let settings = Settings { transfer, ..flip(shape, integrator, 1e-3) };
            let error = Simulation::new(large.clone(), body.clone(), SOFT, settings).unwrap_err();
            // The filter sums velocities.
            let filter = if matches!(transfer, Transfer::Xpic(2..)) { 8 * D } else { 0 };
            let bytes = nodes * (of_node * grids + filter as u128);
            assert_eq!(error, SetupError::GridTooLarge { cells: cells.to_vec(), bytes });
        }
    }
    check([1 << 22, 1 << 22], 64);
    check([1 << 17, 1 << 16, 1 << 17], 64);
    // Beyond what can be addressed, in bytes and in nodes, and beyond what can be numbered.
    check([1 << 20, 1 << 20, 1 << 20], 64);
    check([1 << 20, 1 << 22, 1 << 22], 64);
    check([4, 1 << 31], 64);
    check([usize::MAX >> 20], 64);
}

#[test]
fn a_failed_step_names_the_first_particle_that_left_the_grid_through_any_face() {
    fn check<const D: usize>(shape: Shape)
    where
        f64: Scalar<D>,
    {
        for axis in 0..D {
            for side in [1.0, -1.0] {
                let grid = grid::<D>();
                let mut body = Body::lattice(&grid, 2, 2.0, |_| true);
                body.particles.v.iter_mut().for_each(|v| v[axis] = side);
                let settings = flip(shape, Integrator::Usl, 1.0 / 32.0);
                let mut run = Simulation::new(grid.clone(), body, SOFT, settings).unwrap();
                let error = (0..10).find_map(|_| run.step(&NoBodyForce).err()).unwrap();
                let (lower, upper) = (grid.lower[axis], grid.upper()[axis]);
                let is_out = |x: &SVector<f64, D>| !(lower..=upper).contains(&x[axis]);
                let particle = run.particles().x.iter().position(is_out).unwrap();
                let position = run.particles().x[particle].iter().copied().collect();
                // A sixteenth to go, of which a step takes a half.
                let (step, time) = (3, 3.0 / 32.0);
                let expected =
                    StepError::LeftGrid { step, time, particle, position, axis, lower, upper };
                assert_eq!(error, expected, "{D} {shape:?}");
                assert_eq!((run.steps_done(), run.time()), (2, 2.0 / 32.0));
                assert_eq!(run.step(&NoBodyForce), Err(error));
            }
        }
    }
    for shape in SHAPES {
        check::<1>(shape);
        check::<2>(shape);
        check::<3>(shape);
    }
}

/// Domains between corners have a volume of their own, whatever F is.
#[test]
fn domains_between_corners_are_admitted_as_long_as_they_have_a_volume() {
    fn check<const D: usize>()
    where
        f64: Scalar<D>,
    {
        let grid = grid::<D>();
        let settings = flip(Shape::Cpdi2, Integrator::Usl, 1e-3);
        let particle = 2;
        let fine = Body::lattice(&grid, 1, 2.0, |_| true);
        let centre = fine.particles.X[particle];
        let of = |change: &dyn Fn(&mut [SVector<f64, D>])| {
            let mut body = fine.clone();
            let mesh = body.mesh.as_mut().unwrap();
            // A domain that shares no corner.
            let corners = &mut mesh.corners[particle << D..][..1 << D];
            let own: Vec<_> = corners.iter().map(|&k| mesh.X[k as usize]).collect();
            let first = mesh.X.len();
            corners.iter_mut().zip(first as u32..).for_each(|(corner, k)| *corner = k);
            mesh.X.extend(&own);
            mesh.x.extend(&own);
            mesh.numbers = None;
            change(&mut mesh.x[first..]);
            Simulation::new(grid.clone(), body, SOFT, settings).err()
        };
        assert_eq!(of(&|_| {}), None);
        let (step, time) = (0, 0.0);
        for axis in 0..D {
            // However wide, as far as the grid has nodes: two cells beyond its last one.
            let of_edge = |x: f64| {
                of(&|places| {
                    for place in places.iter_mut().filter(|place| place[axis] > centre[axis]) {
                        place[axis] = x;
                    }
                })
            };
            let last = grid.upper()[axis] + 2.0 * grid.spacing;
            assert_eq!(of_edge(last), None, "{D}");
            let error = of_edge(last + 1e-9);
            let Some(SetupError::InitialState(StepError::LeftGrid { axis: found, .. })) = error
            else {
                panic!("{D}: {error:?}")
            };
            assert_eq!(found, axis);
            // Its volume in its reference volume.
            for J in [0.0, -0.5, -3.0] {
                let error = of(&|x| {
                    for x in x.iter_mut().filter(|x| x[axis] > centre[axis]) {
                        x[axis] += 0.25 * (J - 1.0);
                    }
                });
                let inverted = StepError::Inverted { step, time, particle, J };
                assert_eq!(error, Some(SetupError::InitialState(inverted)), "{D}");
            }
        }
        for bad in [f64::NAN, f64::INFINITY] {
            let error = of(&|x| x[1][0] = bad);
            assert!(
                matches!(
                    error,
                    Some(SetupError::InitialState(StepError::NotFinite { particle: 2, .. }))
                ),
                "{D}: {error:?}"
            );
        }
    }
    check::<1>();
    check::<2>();
    check::<3>();
}

#[test]
fn rings_that_are_none_are_refused() {
    let of = |inner: f64, outer: f64, spacing: f64, density: f64| {
        let ring = Annulus { inner, outer, quarter: true };
        Body::<f64, 2>::annulus(&ring, spacing, 2, density).err()
    };
    assert_eq!(of(0.4, 0.6, 0.1, 2.0), None);
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let answers = [
            ("the inner radius", bad, of(bad, bad + 1.0, 0.1, 2.0)),
            ("the width of the ring", bad, of(0.5, 0.5 + bad, 0.1, 2.0)),
            ("the spacing", bad, of(0.4, 0.6, bad, 2.0)),
            ("the density", bad, of(0.4, 0.6, 0.1, bad)),
        ];
        for (expected, value, answer) in answers {
            let Some(SetupError::NotPositive { quantity, value: found }) = answer else {
                panic!("{expected} {value}: {answer:?}")
            };
            assert_eq!(quantity, expected);
            assert!(found == value || found.is_nan() && value.is_nan());
        }
    }
    let ring = Annulus { inner: 0.4, outer: 0.6, quarter: true };
    let error = Body::<f64, 3>::annulus(&ring, 0.1, 2, 1.0).err();
    assert_eq!(error, Some(SetupError::PolarDimension { dimension: 3 }));
}
