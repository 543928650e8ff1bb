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
    // With a turn about the axis, in three components: held ends, and sliding ones.
    Series {
        call: "twisting-cylinder --formulation updated-lagrangian --shape gimp --cells 8,16,32 --periods 0.5",
        order: 2.0,
    },
    Series { call: "turning-cylinder --cells 8,16,32 --periods 0.5", order: 2.0 },
    Series {
        call: "twisting-cylinder --formulation total-lagrangian --cfl 0.2 --cfl-speed p-wave --shape bspline2 --cells 8,16,32 --periods 0.5",
        order: 3.0,
    },
    // Laws with memory. Nothing is promised of them; measured orders are those of the elastic body, as far as the update is of them.
    Series {
        call: "tube-maxwell --shape cpdi2 --layout clipped --cells 8,16,32 --periods 0.25",
        order: 2.0,
    },
    Series {
        call: "tube-j2 --shape cpdi2 --layout clipped --cells 8,16 --periods 0.5",
        order: 2.0,
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

/// A motion of a body of revolution stated along Cartesian axes, in a box within the body.
fn in_cartesian_coordinates(text: &str) -> String {
    let part = |from: &str, to: &str| {
        let (_, rest) = text.split_once(from).unwrap();
        rest.split_once(to).unwrap().0.trim().to_owned()
    };
    let component = |name: &str| {
        part("[displacement]", "[material]")
            .lines()
            .find_map(|line| {
                line.strip_prefix(name).map(|rest| rest.trim_matches([' ', '=', '\'']).to_owned())
            })
            .unwrap()
    };
    // R is the name of a coordinate.
    let [radial, axial] = ["R", "Z"].map(|name| {
        let text = component(name);
        let is_word = |c: char| c.is_alphanumeric();
        let at_end =
            |k: usize| !text[k + 1..].starts_with(is_word) && !text[..k].ends_with(is_word);
        let places: Vec<usize> =
            text.match_indices('R').map(|(k, _)| k).filter(|k| at_end(*k)).collect();
        let mut renamed = text.clone();
        places.iter().rev().for_each(|k| renamed.replace_range(*k..=*k, "radius"));
        renamed
    });
    let (head, _) = text.split_once("[displacement]").unwrap();
    let head =
        head.replace("'axisymmetric'", "'cartesian'").replace("dimension = 2", "dimension = 3");
    let material = part("[material]", "[domain]");
    let (_, time) = text.split_once("[time]").unwrap();
    format!(
        "{head}radius = 'sqrt(X^2 + Y^2)'\nradial = '{radial}'\n[displacement]\nX = 'radial*X/radius'\nY = 'radial*Y/radius'\nZ = '{axial}'\n[material]\n{material}\n\
         [domain]\nshape = 'box'\nlower = ['Ri/10', 'Ri', '0']\nupper = ['Ri', 'Ro', '1']\n[time]{time}"
    )
}

/// Fields of laws with memory in axisymmetric and in cylindrical coordinates, beside those that follow along Cartesian axes.
#[test]
fn histories_in_cylindrical_components_are_those_of_cartesian_ones() {
    for name in ["tube-maxwell", "tube-j2"] {
        let text = std::fs::read_to_string(file(name)).unwrap();
        let cartesian = Spec::parse(&in_cartesian_coordinates(&text), name).unwrap();
        let [axisymmetric, cylindrical] = both(name);
        let exact =
            [&axisymmetric, &cylindrical, &cartesian].map(|spec| interpret(spec, []).unwrap());
        let [AnySolution::Three(plane), AnySolution::Three(tube), AnySolution::Three(along_axes)] =
            exact
        else {
            panic!("components are those of space")
        };
        let end = along_axes.period();
        for (X, share) in [([0.1, 0.7, 0.2], 0.3), ([0.4, 0.6, 0.7], 0.6), ([0.3, 0.8, 0.45], 0.9)]
        {
            let (X, t) = (X.into(), share * end);
            let (expected, state) = (along_axes.fields(&X, t), along_axes.internal(&X, t));
            for own in [&plane, &tube] {
                let found = own.fields(&X, t);
                assert!((found.b - expected.b).norm() <= 1e-11 * expected.b.norm(), "{name} {X}");
                assert!((found.P - expected.P).norm() <= 1e-12 * expected.P.norm(), "{name} {X}");
                let internal = own.internal(&X, t);
                assert_eq!(internal.len(), state.len());
                let largest = state.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
                for (found, expected) in internal.iter().zip(&state) {
                    assert!(
                        (found - expected).abs() <= 1e-12 * largest,
                        "{name} {X} {found} {expected}"
                    );
                }
            }
        }
    }
}

/// A body that contains the axis or the centre of its coordinates.
fn about_the_axis(coordinates: &str, displacement: &str, domain: &str) -> AnySolution<f64> {
    let dimension = if coordinates == "polar" { 2 } else { 3 };
    let text = format!(
        "name = 'about'\ntitle = 'About the axis'\ncoordinates = '{coordinates}'\ndimension = {dimension}\n\
         [parameters]\nE = {{ default = 1e4 }}\nnu = {{ default = 0.3 }}\nrho0 = {{ default = 3 }}\n[let]\nT = 'sin(20*t)/20'\n\
         [displacement]\n{displacement}\n[material]\nlaw = 'neo-hookean'\n[domain]\n{domain}\n[time]\nperiod = '1/10'\nwave-speed = '60'\n"
    );
    interpret(&Spec::parse(&text, "about").unwrap(), []).unwrap()
}

/// Smooth motions have their limits on the axis, and next to it the values of their surroundings, where formulas lose all digits.
#[test]
fn fields_next_to_the_axis_of_any_coordinates_are_those_of_cartesian_ones() {
    let square = "shape = 'box'\nlower = [-1, -1]\nupper = [1, 1]";
    let cylinder = "shape = 'solid-cylinder'\nouter = 1\nlower = 0\nupper = 1";
    let cases = [
        // u = T r^2 e_R r: in Cartesian components T (x^2 + y^2) x and so on.
        ("polar", "R = 'T*R^3'\ntheta = '0'", square, "'T*(X^2 + Y^2)*X'", "'T*(X^2 + Y^2)*Y'", ""),
        // A shear X = T y has the components T R (sin(2 theta)/2, -sin(theta)^2).
        (
            "polar",
            "R = 'T*R*sin(theta)*cos(theta)'\ntheta = '-T*R*sin(theta)^2'",
            square,
            "'T*Y'",
            "'0'",
            "",
        ),
        (
            "cylindrical",
            "R = 'T*R*Z'\ntheta = 'T*R^3'\nZ = 'T*cos(R)'",
            cylinder,
            "'T*(X*Z - Y*(X^2 + Y^2))'",
            "'T*(Y*Z + X*(X^2 + Y^2))'",
            "'T*cos(sqrt(X^2 + Y^2))'",
        ),
        (
            "spherical",
            "R = 'T*R^3'\ntheta = '0'\nphi = '0'",
            "shape = 'shell'\ninner = '1/5'\nouter = 1",
            "'T*(X^2 + Y^2 + Z^2)*X'",
            "'T*(X^2 + Y^2 + Z^2)*Y'",
            "'T*(X^2 + Y^2 + Z^2)*Z'",
        ),
    ];
    for (coordinates, displacement, domain, x, y, z) in cases {
        let curved = about_the_axis(coordinates, displacement, domain);
        let plane = coordinates == "polar";
        let along_axes = Spec::parse(
            &format!(
                "name = 'about'\ntitle = 'Along axes'\ncoordinates = 'cartesian'\ndimension = {}\n\
                 [parameters]\nE = {{ default = 1e4 }}\nnu = {{ default = 0.3 }}\nrho0 = {{ default = 3 }}\n[let]\nT = 'sin(20*t)/20'\n\
                 [displacement]\nX = {x}\nY = {y}\n{}[material]\nlaw = 'neo-hookean'\n[domain]\nshape = 'box'\nlower = {}\nupper = {}\n\
                 [time]\nperiod = '1/10'\nwave-speed = '60'\n",
                if plane { 2 } else { 3 },
                if plane { String::new() } else { format!("Z = {z}\n") },
                if plane { "[-1, -1]" } else { "[-1, -1, -1]" },
                if plane { "[1, 1]" } else { "[1, 1, 1]" },
            ),
            "along-axes",
        )
        .unwrap();
        let exact = interpret(&along_axes, []).unwrap();
        for place in [[0.0, 0.0, 0.4], [6e-17, -3e-17, 0.4], [1e-9, 2e-9, 0.3], [3e-4, -2e-4, 0.5]]
        {
            let X = if plane { &place[..2] } else { &place[..] };
            let row = |of: &AnySolution<f64>| mmsmith_verify::evaluate(of, X, 0.03).unwrap();
            let (found, expected) = (row(&curved), row(&exact));
            assert!(found.not_finite.is_empty(), "{coordinates} {X:?}: {:?}", found.not_finite);
            let (found, expected) = (found.named(), expected.named());
            for ((name, _, found), (_, _, expected)) in found.iter().zip(&expected) {
                let largest = expected.iter().fold(1e-2_f64, |most, value| most.max(value.abs()));
                for (found, expected) in found.iter().zip(expected) {
                    assert!(
                        (found - expected).abs() <= 1e-10 * largest,
                        "{coordinates} {displacement} {X:?} {name}: {found} is not {expected}"
                    );
                }
            }
        }
    }
}

/// A motion that tears the axis, or a stress with a kink there, has no limit.
#[test]
fn fields_without_a_limit_on_the_axis_are_not_finite_there() {
    let square = "shape = 'box'\nlower = [-1, -1]\nupper = [1, 1]";
    let cylinder = "shape = 'solid-cylinder'\nouter = 1\nlower = 0\nupper = 1";
    for (coordinates, displacement, domain) in [
        ("polar", "R = '0'\ntheta = 'T'", square),
        ("cylindrical", "R = '0'\ntheta = '0'\nZ = 'T*R'", cylinder),
        ("cylindrical", "R = 'T*R^2'\ntheta = '0'\nZ = '0'", cylinder),
    ] {
        let exact = about_the_axis(coordinates, displacement, domain);
        let X: &[f64] = if coordinates == "polar" { &[0.0, 0.0] } else { &[0.0, 0.0, 0.4] };
        let row = mmsmith_verify::evaluate(&exact, X, 0.03).unwrap();
        assert!(!row.not_finite.is_empty(), "{displacement}: {row:?}");
        assert!(row.why.unwrap().contains("no limit on the axis"));
        let report = mmsmith_verify::check(&exact, 4).unwrap();
        assert!(!report.on_axis.unwrap().has_limit, "{displacement}");
    }
}

/// Whole cells fill a wall: a series of grids whose cells do not follow their spacings has no order, and the counts that are named have one.
#[test]
fn curved_bodies_whose_cells_are_not_refined_alike_are_not_judged() {
    let place = tempfile::tempdir().unwrap();
    let file = place.path().join("thin.toml");
    let text = std::fs::read_to_string(file_of_ring())
        .unwrap()
        .replace("Ri = { default = 0.5", "Ri = { default = 0.7");
    std::fs::write(&file, text).unwrap();
    let converge = |cells: &str| {
        let call = [
            "converge",
            file.to_str().unwrap(),
            "--static",
            "--moment",
            "0.3",
            "--shape",
            "bspline2",
            "--cells",
            cells,
        ];
        json(&call)
    };
    let uneven = converge("4,5,6");
    assert!(uneven["passed"].is_null(), "{}", uneven["passed"]);
    let why = uneven["not_judged"].as_str().unwrap();
    let (_, advice) = why.split_once("--cells ").unwrap();
    let even = converge(advice.split_whitespace().next().unwrap());
    assert!(even.get("not_judged").is_none(), "{even}");
    assert_eq!(even["passed"], true, "{even}");
}

/// The ring of the library, whose wall is half of the cell length.
fn file_of_ring() -> PathBuf {
    workspace().join("mms-specs/ring.toml")
}

/// Forces of a homogeneous stress are in balance at loaded ends, up to the axis: the error of the stretch around it falls everywhere.
#[test]
fn loads_next_to_the_axis_balance_the_stress() {
    let file = file("solid-cylinder-under-load");
    let file = file.to_str().unwrap();
    for shape in ["cpdi2", "bspline2"] {
        let mut words =
            vec!["converge", file, "--formulation", "updated-lagrangian", "--shape", shape];
        words.extend(["--layout", "clipped", "--cells", "8,16", "--periods", "0.2"]);
        let found = json(&words);
        let error = |row: usize| {
            found["rows"][row]["errors"]["internal"]["hoop_stretch"]["linf"].as_f64().unwrap()
        };
        assert!(error(1) < 0.5 * error(0), "{shape}: {} {}", error(0), error(1));
    }
}

/// Particle files of the half plane have the stretch and the stress around the axis: a run scored by its files has its own errors.
#[test]
fn particle_files_of_the_half_plane_have_the_whole_tensors() {
    let place = tempfile::tempdir().unwrap();
    let file = file("solid-cylinder-under-load");
    let (file, mut folders) = (file.to_str().unwrap(), Vec::new());
    for cells in ["8", "16"] {
        let folder = place.path().join(cells).to_str().unwrap().to_owned();
        let mut words =
            vec!["run", file, "--formulation", "updated-lagrangian", "--shape", "cpdi2"];
        words.extend([
            "--layout",
            "clipped",
            "--cells",
            cells,
            "--periods",
            "0.1",
            "--frames",
            "3",
        ]);
        words.extend(["--vtk", folder.as_str()]);
        let _ = json(&words);
        folders.push(folder);
    }
    let score = json(&["score", file, &folders[0], &folders[1], "--cells", "8,16"]);
    assert_eq!(score["passed"], true, "{score}");
    for row in score["rows"].as_array().unwrap() {
        for field in ["F", "P", "cauchy"] {
            let [across, plane] =
                ["across", "errors"].map(|of| row[of][field]["l2"].as_f64().unwrap());
            assert!(
                across < plane.max(1e-3 * if field == "F" { 1.0 } else { 6e3 }),
                "{field}: {across} {plane}"
            );
        }
    }
}
