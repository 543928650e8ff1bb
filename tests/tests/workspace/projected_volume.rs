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

/// In the updated formulation the projection goes by the transfers of the scheme.
#[test]
fn transfers_project_volumes_in_the_updated_formulation() {
    let [far, near] = [0.3, NEAR].map(|nu| solution("swirl", &[("nu", nu), ("A", 0.01)]));
    for shape in ["gimp", "bspline2", "gimp-bspline2", "cpdi"] {
        let scheme =
            Scheme::Updated(Updated { shape: shape.parse().unwrap(), ..Updated::default() });
        let pointwise = Case {
            scheme,
            cells: 16,
            periods: 0.05,
            cfl_speed: CflSpeed::PWave,
            ..Case::default()
        };
        let projected = Case { volume: Volume::Projected, ..pointwise };
        let [u, _] = errors(&far, &pointwise);
        let [near_u, near_P] = errors(&near, &projected);
        let [_, locked_P] = errors(&near, &pointwise);
        assert!(near_u < 1.5 * u, "{shape}: {u:e}, {near_u:e}");
        assert!(locked_P > 3.0 * near_P, "{shape}: {locked_P:e} without, {near_P:e} with");
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
