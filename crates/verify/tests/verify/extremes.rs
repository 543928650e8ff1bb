//! Promises of the schemes at the extremes.

use mmsmith_solutions::{AnySolution, CATALOGUE, Precision, build};
use mmsmith_verify::{
    Arithmetic, Case, Coordinates, Criteria, Discretized, Integrator, Layout, Outputs, PerField,
    PerNorm, Placement, Row, Scheme, Search, Shape, Status, Total, Transfer, Updated, is_stable,
    run, stability,
};

const SHAPES: [Shape; 3] = [Shape::Linear, Shape::Ugimp, Shape::Gimp];
const INTEGRATORS: [Integrator; 4] =
    [Integrator::Cd, Integrator::Usf, Integrator::Usl, Integrator::Musl];

fn solution<T: Precision>(name: &str, set: &[(&str, f64)]) -> AnySolution<T> {
    let description = CATALOGUE.iter().find(|known| known.name == name).expect("a solution");
    let values = description.resolve(set.iter().copied()).expect("its parameters");
    build(name, &values).expect("a solution").expect("admissible values")
}

fn prepared<'a>(exact: &'a AnySolution<f64>, case: &Case) -> Discretized<'a> {
    Discretized::new(exact, Arithmetic::Double, case).expect("a case that can be run")
}

fn row(exact: &AnySolution<f64>, case: &Case) -> Row {
    let mut outputs = Outputs {
        progress: &mut |_| (),
        frames: None,
        snapshot: None,
        checkpoints: None,
        history: None,
        ranks: None,
        traffic: None,
        profile: None,
        until: None,
    };
    run(exact, Arithmetic::Double, case, &mut outputs).expect("a case that can be run")
}

fn row_in_single(exact: &AnySolution<f64>, single: &AnySolution<f32>, case: &Case) -> Row {
    let mut outputs = Outputs {
        progress: &mut |_| (),
        frames: None,
        snapshot: None,
        checkpoints: None,
        history: None,
        ranks: None,
        traffic: None,
        profile: None,
        until: None,
    };
    run(exact, Arithmetic::Single(single), case, &mut outputs).expect("a case that can be run")
}

/// Every scheme of the updated frame on a few cells, and one of the total frame that suits a box.
fn schemes() -> Vec<Case> {
    let usual = Updated::default();
    let updated = SHAPES.into_iter().flat_map(|shape| {
        INTEGRATORS.into_iter().map(move |integrator| Updated { shape, integrator, ..usual })
    });
    let updated = updated.chain(further(usual)).map(Scheme::Updated);
    let all = updated.chain([Scheme::Total(Total::of_degree(3))]);
    all.map(|scheme| Case { scheme, cells: 6, ..Case::default() }).collect()
}

/// Further weights, transfers and integrators.
fn further(usual: Updated) -> impl Iterator<Item = Updated> {
    let shapes = [Shape::Cpdi, Shape::Cpdi2, Shape::Bspline2, Shape::Bspline3];
    let transfers = [Transfer::Pic, Transfer::Apic, Transfer::Xpic(2)];
    let shapes = shapes.into_iter().map(move |shape| Updated { shape, ..usual });
    let transfers = transfers.into_iter().map(move |transfer| Updated { transfer, ..usual });
    shapes.chain(transfers).chain([Updated { integrator: Integrator::Usavg, ..usual }])
}

fn total_on(coordinates: Coordinates, case: Case) -> Case {
    let scheme = Total { layout: Layout::Gauss, coordinates, ..Total::of_degree(3) };
    Case { scheme: Scheme::Total(scheme), per_cell: 4, cfl: 0.1, ..case }
}

/// The schemes of the updated frame, each with a case.
fn updated_schemes() -> impl Iterator<Item = (Updated, Case)> {
    schemes().into_iter().filter_map(|case| Some((*case.scheme.updated()?, case)))
}

fn on_shifted_lattice(offset: f64, updated: Updated) -> Scheme {
    Scheme::Updated(Updated { placement: Placement::Lattice { offset }, ..updated })
}

/// Whether particles that cross cell edges spoil the weights.
fn is_linear(case: &Case) -> bool {
    case.scheme.updated().is_some_and(|updated| updated.shape == Shape::Linear)
}

/// Every scheme of [`schemes`] that a solution can be run with, fitted to its body.
fn schemes_for(name: &str) -> Vec<Case> {
    let mut schemes = schemes();
    if name == "sphere-shell" {
        schemes.retain(|case| case.scheme.total().is_some());
    }
    for case in schemes.iter_mut().filter(|case| case.scheme.total().is_some()) {
        match name {
            "ring" => *case = total_on(Coordinates::Polar, *case),
            "sphere-shell" => *case = total_on(Coordinates::Spherical, *case),
            _ => {}
        }
    }
    schemes
}

#[test]
fn zero_amplitude_stays_exactly_at_rest() {
    for name in ["axis-aligned", "axis-aligned-1d", "ring", "sphere-shell"] {
        let (exact, single) = (solution(name, &[("A", 0.0)]), solution(name, &[("A", 0.0)]));
        for case in schemes_for(name) {
            let mut rows = vec![row(&exact, &case)];
            if case.scheme.updated().is_some() {
                rows.push(row_in_single(&exact, &single, &case));
            }
            for row in rows {
                assert_eq!(row.status, Status::Ok, "{name} {case:?}");
                assert_eq!(row.errors, PerField::default(), "{name} {case:?}");
            }
        }
    }
}

/// The errors of a scaled problem over those of the first, which must be one and the same power of two in all norms.
fn assert_scaled(case: &Case, a: &Row, b: &Row, factors: [f64; 4]) {
    assert_eq!((a.steps, a.particles, a.cfl), (b.steps, b.particles, b.cfl), "{case:?}");
    for (((name, a), (_, b)), factor) in a.errors.iter().zip(b.errors.iter()).zip(factors) {
        let scaled = PerNorm { linf: a.linf * factor, l2: a.l2 * factor, l1: a.l1 * factor };
        assert_eq!(scaled, *b, "{name}: {case:?}");
    }
}

#[test]
fn units_that_differ_by_powers_of_two_give_the_same_bits() {
    // Masses, lengths and times as powers of two; where the length that cells divide is fixed, so is that of the body.
    for (name, [mass, length, time]) in [
        ("axis-aligned", [37, 0, -12]),
        ("axis-aligned", [-60, 0, 31]),
        ("ring", [5, 0, -7]),
        ("ring", [-11, 0, 3]),
        ("bar", [8, -5, 6]),
        ("sphere-shell", [5, 0, -7]),
    ] {
        let power = |exponent: i32| 2.0_f64.powi(exponent);
        let description = CATALOGUE.iter().find(|known| known.name == name).unwrap();
        let values: Vec<(&str, f64)> = description
            .parameters
            .iter()
            .map(|parameter| {
                let exponent = match parameter.unit {
                    "m" => length,
                    "Pa" => mass - length - 2 * time,
                    "kg/m^3" => mass - 3 * length,
                    _ => 0,
                };
                (parameter.name, parameter.default * power(exponent))
            })
            .collect();
        let (plain, scaled) = (solution(name, &[]), solution(name, &values));
        let factors = [length, length - time, 0, mass - length - 2 * time].map(power);
        for case in schemes_for(name) {
            assert_scaled(&case, &row(&plain, &case), &row(&scaled, &case), factors);
        }
        if (mass - length - 2 * time).abs() > 64 || name == "sphere-shell" {
            // Forces of a solid this soft are among the smallest numbers of single precision, which have fewer digits; and the
            // total frame, which alone has shells, has no single precision.
            continue;
        }
        let (small_plain, small_scaled) = (solution(name, &[]), solution(name, &values));
        for (_, case) in updated_schemes() {
            let a = row_in_single(&plain, &small_plain, &case);
            assert_scaled(&case, &a, &row_in_single(&scaled, &small_scaled, &case), factors);
        }
    }
}

#[test]
fn small_amplitudes_keep_their_relative_accuracy_until_positions_round() {
    for mut case in schemes() {
        if is_linear(&case) {
            // Particles that cross cell edges make hat functions as wrong as the motion is large.
            continue;
        }
        case.cells = 8;
        let relative = |amplitude: f64| {
            let exact = solution("axis-aligned", &[("A", amplitude)]);
            let row = row(&exact, &case);
            assert_eq!(row.status, Status::Ok, "{case:?}");
            (row.errors.u.linf / amplitude, row.errors.F.l2 / amplitude)
        };
        let reference = relative(1e-6);
        let small = relative(1e-10);
        let exact = solution("axis-aligned", &[("A", 1e-14)]);
        let round_off = prepared(&exact, &case).plan().round_off;
        let allowed = 1e-3 * reference.0 + 3.0 * round_off / 1e-10;
        assert!((small.0 - reference.0).abs() < allowed, "{case:?}: {small:?} {reference:?}");
        assert!((small.1 / reference.1 - 1.0).abs() < 1e-3, "{case:?}: {small:?} {reference:?}");
        // A position has no digits for 1e-14 beyond the second: the error is what rounding makes it, and no more.
        let tiny = row(&exact, &case).errors.u.linf;
        assert!(tiny < reference.0 * 1e-14 + 3.0 * round_off, "{case:?}: {tiny:e} {round_off:e}");
    }
}

#[test]
fn particles_may_lie_on_cell_edges_and_on_walls() {
    let exact = solution("axis-aligned", &[("A", 0.05)]);
    let still = solution("axis-aligned", &[("A", 0.0)]);
    for (updated, case) in updated_schemes() {
        for offset in [-0.5, 0.5] {
            let scheme = on_shifted_lattice(offset, updated);
            let case = Case { scheme, cfl: 0.2, ..case };
            let at_rest = row(&still, &case);
            assert_eq!(at_rest.status, Status::Ok, "{case:?}");
            assert_eq!(at_rest.errors, PerField::default(), "{case:?}");
            let moving = row(&exact, &case);
            assert!(moving.errors.u.linf.is_finite(), "{case:?}: {}", moving.status);
            if updated.shape == Shape::Gimp && updated.integrator == Integrator::Cd {
                assert_eq!(moving.status, Status::Ok);
            }
        }
    }
}

#[test]
fn one_cell_and_one_particle_are_enough_for_a_run() {
    let exact = solution("axis-aligned-1d", &[("A", 0.01)]);
    for (_, case) in updated_schemes() {
        for per_cell in [1, 2] {
            let case = Case { cells: 1, per_cell, ..case };
            let row = row(&exact, &case);
            // On one cell the error may exceed the motion, which is told; the run comes to its end.
            assert!(
                row.status == Status::Ok || row.status.is_not_judged(),
                "{case:?}: {}",
                row.status
            );
            assert_eq!(row.particles, per_cell, "{case:?}");
            assert!(row.errors.u.linf < 0.05, "{case:?}: {:?}", row.errors.u);
        }
    }
}

#[test]
fn an_almost_incompressible_solid_runs_with_the_time_step_of_its_p_waves() {
    let exact = solution("axis-aligned", &[("nu", 0.4999), ("A", 0.01)]);
    let search = Search { lower: None, upper: None, width: 0.05, criteria: Criteria::default() };
    let case = Case { cells: 6, ..Case::default() };
    let row = stability(&prepared(&exact, &case), &search, &mut |_| ()).unwrap();
    // c/c_p = sqrt((1 + nu) (1 - 2 nu)/(1 - nu))
    assert!((row.p_wave_limit - 0.024_49).abs() < 1e-4, "{row:?}");
    let share = row.p_wave_cfl.unwrap();
    assert!((0.5..1.3).contains(&share), "{row:?}");
    assert!(row.unstable_below.is_empty(), "{row:?}");
    let at = |cfl| is_stable(&prepared(&exact, &Case { cfl, ..case }), &search.criteria);
    assert_eq!(at(row.bracket[0].unwrap()).unwrap().failure, None);
    assert_eq!(at(row.bracket[1].unwrap()).unwrap().failure, row.failure);
}

#[test]
fn nearly_empty_cells_at_the_rim_of_a_ring_stay_stable() {
    // Shifts that leave slivers of the body in some cells; the error stays that of the grid.
    let exact = solution("ring", &[]);
    let error = |offset: f64| {
        let scheme = on_shifted_lattice(offset, Updated::default());
        let case = Case { scheme, cells: 12, cfl: 0.2, ..Case::default() };
        let row = row(&exact, &case);
        assert_eq!(row.status, Status::Ok, "{offset}");
        row.errors.u.linf
    };
    let usual = error(0.0);
    for offset in [0.01, 0.2, 0.37, 0.5] {
        let error = error(offset);
        assert!(error < 5.0 * usual, "{offset}: {error:e} {usual:e}");
    }
}

#[test]
fn limits_do_not_depend_on_the_start_of_the_search_or_on_threads() {
    let exact = solution("axis-aligned", &[]);
    let case = Case { cells: 8, ..Case::default() };
    let limit = |lower, upper, threads: usize| {
        let search = Search { lower, upper, width: 0.01, criteria: Criteria::default() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let find = || stability(&prepared(&exact, &case), &search, &mut |_| ());
        pool.install(find).unwrap()
    };
    let first = limit(None, None, 1);
    assert_eq!(first, limit(None, None, 2));
    let second = limit(Some(0.3), Some(1.7), 2);
    let difference = first.cfl_max.unwrap() - second.cfl_max.unwrap();
    assert!(difference.abs() <= 0.01, "{first:?} {second:?}");
    assert!(first.bracket[1].unwrap() - first.bracket[0].unwrap() <= 0.01, "{first:?}");
}

#[test]
fn stiffness_and_density_over_24_decades_change_nothing_but_rounding() {
    // Powers of ten, which round; those of two are seen to scale to the bit above.
    let decades = [1e-12, 1e-5, 1.0, 1e7, 1e12];
    let reference = solution("axis-aligned", &[]);
    for mut case in schemes() {
        // In this time hat functions part runs that differ by rounding.
        case.cells = 8;
        case.periods = if is_linear(&case) { 0.25 } else { 1.0 };
        let expected = row(&reference, &case);
        for E in decades {
            for rho0 in decades {
                let found = row(&solution("axis-aligned", &[("E", E), ("rho0", rho0)]), &case);
                let told = format!("E = {E:e}, rho0 = {rho0:e}: {case:?}");
                assert_eq!(
                    (found.steps, &found.status),
                    (expected.steps, &expected.status),
                    "{told}"
                );
                for (of, reference) in [
                    (found.errors.u.linf, expected.errors.u.linf),
                    (found.errors.F.linf, expected.errors.F.linf),
                ] {
                    assert!((of / reference - 1.0).abs() < 1e-9, "{of:e} {reference:e}: {told}");
                }
            }
        }
    }
}

#[test]
fn a_million_steps_on_one_cell_end_with_the_error_of_the_first_ones() {
    let exact = solution("axis-aligned-1d", &[]);
    let few = Case { cells: 1, ..Case::default() };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let of = |periods: f64| pool.install(|| row(&exact, &Case { periods, ..few }));
    let (long, short) = (of(200_000.0), of(20.0));
    // On one cell the error exceeds the motion, which is told; the run comes to its end.
    assert!(long.status == Status::Ok || long.status.is_not_judged(), "{}", long.status);
    assert_eq!(long.steps, 1_000_000);
    let ratio = long.errors.u.linf / short.errors.u.linf;
    assert!((1.0..1.01).contains(&ratio), "{ratio}: {long:?}");
}
