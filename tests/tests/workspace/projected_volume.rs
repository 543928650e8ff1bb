//! A projected change of volume (`--volume projected`): next to incompressibility motions have the errors that they have far from it, and
//! faults of the projection bring them back.

#![allow(clippy::unwrap_used)]

use mmsmith_mpm::fault::{self, Fault};
use mmsmith_solutions::{AnySolution, CATALOGUE, build};
use mmsmith_verify::{
    Arithmetic, Case, CflSpeed, Composition, Coordinates, Layout, Row, Scheme, Status, Sweep,
    Total, Updated, Volume, converge,
};

fn solution(name: &str, overrides: &[(&str, f64)]) -> AnySolution<f64> {
    let description = CATALOGUE.iter().find(|d| d.name == name).unwrap();
    build(name, &description.resolve(overrides.iter().copied()).unwrap()).unwrap().unwrap()
}

/// Its run, which has to reach the end.
fn run(exact: &AnySolution<f64>, case: &Case) -> Row {
    let sweep = Sweep::Cells(vec![case.cells]);
    let mut rows = converge(exact, Arithmetic::Double, case, &sweep, &mut |_| ()).unwrap().rows;
    let row = rows.remove(0);
    assert_eq!(row.status, Status::Ok, "{row:?}");
    row
}

/// Splines of the total formulation at Gauss points.
fn total(degree: usize, coordinates: Coordinates) -> Case {
    Case {
        scheme: Scheme::Total(Total {
            coordinates,
            composition: Composition::Order2,
            layout: Layout::Gauss,
            ..Total::of_degree(degree)
        }),
        per_cell: degree + 1,
        cfl: 0.3,
        cfl_speed: CflSpeed::PWave,
        cells: 12,
        periods: 0.02,
        ..Case::default()
    }
}

/// Errors of u and P in the mean of squares.
fn errors(exact: &AnySolution<f64>, case: &Case) -> [f64; 2] {
    let Row { errors, .. } = run(exact, case);
    [errors.u.l2, errors.P.l2]
}

const NEAR: f64 = 0.4999;

/// A vortex keeps the volume, so that its errors need not depend on Poisson's ratio.
#[test]
fn a_motion_that_keeps_the_volume_has_the_errors_of_a_compressible_body() {
    for degree in 2..=4 {
        let [far, near] = [0.3, NEAR].map(|nu| solution("vortex", &[("nu", nu)]));
        let pointwise = Case { cells: 16, ..total(degree, Coordinates::Polar) };
        let projected = Case { volume: Volume::Projected, ..pointwise };
        let [u, P] = errors(&far, &pointwise);
        let [near_u, near_P] = errors(&near, &projected);
        let [_, locked_P] = errors(&near, &pointwise);
        assert!(
            near_u < 2.0 * u && near_P < 3.0 * P,
            "{degree}: {u:e} {P:e}, {near_u:e} {near_P:e}"
        );
        assert!(locked_P > 20.0 * near_P, "{degree}: {locked_P:e} without, {near_P:e} with");
    }
}

/// In the updated formulation changes of volume follow the grid, or are projected by the transfers of the scheme.
#[test]
fn updated_schemes_follow_motions_next_to_incompressibility() {
    let [far, near] = [0.3, NEAR].map(|nu| solution("swirl", &[("nu", nu), ("A", 0.01)]));
    // With how much smaller errors of u than at each particle; means of splines hardly lock on as many cells.
    for (shape, gain) in [("gimp", 3.0), ("bspline2", 3.0), ("gimp-bspline2", 0.7), ("cpdi", 1.5)] {
        let scheme =
            Scheme::Updated(Updated { shape: shape.parse().unwrap(), ..Updated::default() });
        let pointwise = |cells: usize, periods: f64| Case {
            scheme,
            cells,
            periods,
            cfl_speed: CflSpeed::PWave,
            ..Case::default()
        };
        let projected = |case: Case| Case { volume: Volume::Projected, ..case };
        // Before the exact motion has become unstable.
        let short = pointwise(16, 0.05);
        let [u, _] = errors(&far, &short);
        let [near_u, _] = errors(&near, &projected(short));
        assert!(near_u < 1.5 * u, "{shape}: {u:e}, {near_u:e}");
        let long = pointwise(32, 0.25);
        let [near_u, near_P] = errors(&near, &projected(long));
        let [locked_u, locked_P] = errors(&near, &long);
        assert!(locked_P > 1.5 * near_P, "{shape}: {locked_P:e} without, {near_P:e} with");
        assert!(locked_u > gain * near_u, "{shape}: {locked_u:e} without, {near_u:e} with");
    }
}

/// Far from incompressibility a change of volume that follows the grid costs no digits, of fields that it has no part in either.
#[test]
fn changes_of_volume_that_follow_the_grid_cost_nothing_far_from_incompressibility() {
    for (name, periods) in [("axis-aligned", 0.1), ("swirl", 0.25), ("axis-aligned-3d", 0.05)] {
        for shape in ["gimp", "bspline2"] {
            let exact = solution(name, &[("A", 0.05)]);
            let scheme =
                Scheme::Updated(Updated { shape: shape.parse().unwrap(), ..Updated::default() });
            let pointwise = Case { scheme, cells: 16, periods, ..Case::default() };
            let [without, with] = [Volume::Pointwise, Volume::Projected].map(|volume| {
                let Row { errors, .. } = run(&exact, &Case { volume, ..pointwise });
                [errors.u.l2, errors.v.l2, errors.F.l2, errors.P.l2]
            });
            for ((without, with), field) in without.into_iter().zip(with).zip(["u", "v", "F", "P"])
            {
                assert!(with < 1.2 * without, "{name}, {shape}, {field}: {with:e} {without:e}");
            }
        }
    }
}

/// One, two and three dimensions, curved coordinates, several integrators: the same bits for any number of threads.
#[test]
fn bits_do_not_depend_on_threads() {
    let updated = |integrator: &str| {
        let integrator = integrator.parse().unwrap();
        let scheme = Scheme::Updated(Updated { integrator, ..Updated::default() });
        Case { scheme, periods: 0.02, ..Case::default() }
    };
    let cartesian = Coordinates::Cartesian;
    let cases = [
        ("axis-aligned-1d", Case { cells: 16, ..total(3, cartesian) }),
        ("ring-nu", Case { cells: 6, ..total(2, Coordinates::Polar) }),
        ("skew-3d", Case { cells: 3, ..total(2, cartesian) }),
        ("axis-aligned-1d", updated("cd")),
        ("swirl", updated("usavg")),
        ("swirl", updated("musl")),
        ("axis-aligned-3d", Case { cells: 6, ..updated("usf") }),
    ];
    for (name, case) in cases {
        let case = Case { volume: Volume::Projected, ..case };
        let exact = solution(name, &[]);
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| run(&exact, &case).errors)
        };
        assert_eq!(on(1), on(3), "{name}");
    }
}

#[test]
fn faults_of_the_projection_are_caught() {
    let near = solution("vortex", &[("nu", NEAR)]);
    let case = Case { volume: Volume::Projected, ..total(2, Coordinates::Polar) };
    let [_, sound] = errors(&near, &case);
    for fault in [Fault::JacobianForTheta, Fault::VolumesLeftOut, Fault::VolumeRoot] {
        let [_, found] = fault::with(fault, || errors(&near, &case));
        assert!(found > 2.0 * sound, "{fault:?} is not caught: {found:e} beside {sound:e}");
    }
}
