//! Bodies of revolution: orders in both formulations and from rest, and fields in the half plane that are those of space.
//!
//! The runs are of seconds each and in release mode, as those in `orders.rs`.

#![allow(clippy::unwrap_used)]

use std::path::PathBuf;

use mmsmith_interpret::{interpret, interpret_fields};
use mmsmith_solutions::AnySolution;
use mmsmith_spec::Spec;
use mmsmith_tests::{json, workspace};
use nalgebra::{SMatrix, vector};

/// A series of grids, and the order of u in L2.
struct Series {
    call: &'static str,
    order: f64,
}

const SERIES: &[Series] = &[
    Series { call: "ring-in-walls --cells 8,16,32 --periods 0.5", order: 2.0 },
    Series { call: "solid-cylinder-in-walls --cells 8,16,32 --periods 0.5", order: 2.0 },
    Series {
        call: "thick-cylinder --shape cpdi2 --layout clipped --cells 8,16,32 --periods 0.5",
        order: 2.0,
    },
    Series {
        call: "twisting-cylinder --formulation total-lagrangian --cfl 0.2 --cfl-speed p-wave --shape bspline2 --cells 8,16,32 --periods 0.5",
        order: 3.0,
    },
    Series { call: "twisted-cylinder --static --shape bspline2 --cells 8,16,32", order: 3.0 },
    Series { call: "twisted-cylinder --static --shape bspline3 --cells 8,16,32", order: 4.0 },
    Series {
        call: "sector --formulation total-lagrangian --cfl 0.2 --cfl-speed p-wave --shape bspline2 --cells 4,8 --periods 0.1",
        order: 3.0,
    },
];

/// The specification of a name: one of the library, or one for tests.
fn file(name: &str) -> PathBuf {
    let folders = ["mms-specs/revolution", "tests/data/specs/revolution"];
    let files = folders.map(|folder| workspace().join(folder).join(format!("{name}.toml")));
    files.into_iter().find(|file| file.is_file()).unwrap()
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn orders_are_those_of_the_weights() {
    for Series { call, order } in SERIES {
        let (name, options) = call.split_once(' ').unwrap();
        let file = file(name);
        let mut words = vec!["converge", file.to_str().unwrap()];
        words.extend(options.split(' '));
        let found = json(&words);
        let local = found["orders"]["u"]["l2"]["local"].as_array().unwrap();
        let last = local.last().unwrap().as_f64().unwrap();
        assert!((last - order).abs() <= 0.1, "{call}: {last}");
    }
}

/// The axisymmetric specification of a name, and the same body in cylindrical coordinates.
fn both(name: &str) -> [Spec; 2] {
    let file = file(name);
    let text = std::fs::read_to_string(file).unwrap();
    let in_space = text
        .replace("'axisymmetric'", "'cylindrical'")
        .replace("dimension = 2", "dimension = 3")
        .replace("shape = 'box'", "shape = 'tube'")
        .replace("lower = ['Ri', 0]", "inner = 'Ri'\nlower = 0")
        .replace("upper = ['Ro', 1]", "outer = 'Ro'\nupper = 1");
    [text, in_space].map(|text| Spec::parse(&text, name).unwrap())
}

#[test]
fn fields_of_the_half_plane_are_those_of_space_in_the_components_of_the_place() {
    let [axisymmetric, cylindrical] = both("thick-cylinder");
    let fields = axisymmetric.derive_for_hosts().unwrap();
    let half_plane = interpret_fields(&axisymmetric, fields, []).unwrap();
    let [of_body, of_space] =
        [&axisymmetric, &cylindrical].map(|spec| interpret(spec, []).unwrap());
    let (AnySolution::Three(plane), AnySolution::Three(body), AnySolution::Three(space)) =
        (half_plane, of_body, of_space)
    else {
        panic!("components are those of space")
    };
    for (R, angle, Z, t) in
        [(0.55, 0.0, 0.1, 0.001), (0.7, 0.8, 0.4, 0.003), (0.95, 2.5, 0.9, 0.005)]
    {
        let (sin, cos) = f64::sin_cos(angle);
        let Q = SMatrix::<f64, 3, 3>::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
        let X = vector![R * cos, R * sin, Z];
        // The angle means nothing in the half plane.
        let own = plane.fields(&vector![R, 7.0, Z], t);
        for exact in [body.fields(&X, t), space.fields(&X, t)] {
            let vectors = [(own.u, exact.u), (own.v, exact.v), (own.a, exact.a), (own.b, exact.b)];
            for (own, exact) in vectors {
                assert!((Q * own - exact).norm() <= 1e-13 * exact.norm(), "{own} {exact}");
            }
            for (own, exact) in [(own.H, exact.H), (own.F, exact.F), (own.P, exact.P)] {
                let turned = Q * own * Q.transpose();
                assert!((turned - exact).norm() <= 1e-13 * exact.norm(), "{own} {exact}");
            }
        }
    }
}

#[test]
fn fields_on_the_axis_are_their_limits() {
    let text = std::fs::read_to_string(file("solid-cylinder-in-walls")).unwrap();
    let spec = Spec::parse(&text, "solid-cylinder-in-walls").unwrap();
    let exact = interpret(&spec, []).unwrap();
    let (A, Z, t) = (0.02, 0.3_f64, 0.01_f64);
    let row = mmsmith_verify::evaluate(&exact, &[0.0, 0.0, Z], t).unwrap();
    let pi = std::f64::consts::PI;
    let slope = A * pi * (pi * Z).cos() * (pi * 500_f64.sqrt() * t).sin();
    assert!(row.not_finite.is_empty(), "{row:?}");
    for stretch in [row.H[0][0], row.H[1][1]] {
        assert!((stretch - slope).abs() < 1e-13, "{stretch} is not {slope}");
    }
    let off = [row.u[0], row.b[0], row.P[0][2], row.P[0][0] - row.P[1][1]];
    assert!(off.iter().all(|value| value.abs() < 1e-9), "{off:?}");
    // The body force is smooth there: from beside the axis it differs by the square of the distance.
    let beside = mmsmith_verify::evaluate(&exact, &[1e-3, 0.0, Z], t).unwrap();
    let difference = (row.b[2] - beside.b[2]).abs() / beside.b[2].abs();
    assert!(difference < 1e-4 && difference > 0.0, "{difference}");
}
