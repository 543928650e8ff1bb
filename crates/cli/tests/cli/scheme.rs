//! Schemes that are chosen where nothing is said, as a user meets them.

#![allow(non_snake_case)]

use crate::command::{mms, read_json, refuses};
use mmsmith_solutions::CATALOGUE;
use std::fs;

/// Solutions that the updated frame models, whose scheme stays the usual one.
const UPDATED: [&str; 6] =
    ["axis-aligned-1d", "axis-aligned", "axis-aligned-3d", "bar", "ring", "swirl"];

/// A box whose faces move as the solution says.
const SHEAR: &str = "
name = 'my-shear'
title = 'Shear and stretch together'
coordinates = 'cartesian'
dimension = 2

[parameters]
A = { default = 0.1, range = '> -1/4, < 1/4', unit = 'm', description = 'amplitude' }
E = { default = 1000, range = '> 0', unit = 'Pa', description = \"Young's modulus\" }
nu = { default = 0.25, range = '> -1, < 1/2', description = \"Poisson's ratio\" }
rho0 = { default = 2, range = '> 0', unit = 'kg/m^3', description = 'reference density' }

[let]
c = 'sqrt(E/rho0)'

[displacement]
X = 'A*sin(Pi*X)*cos(Pi*Y/2)*cos(c*Pi*t)'
Y = 'A*X^2*Y*sin(c*Pi*t)'

[material]
law = 'neo-hookean'

[domain]
shape = 'box'
lower = [0, 0]
upper = [1, 1]

[time]
period = '2/c'
";

#[test]
fn every_solution_runs_to_its_end_where_nothing_is_said() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    for solution in CATALOGUE {
        let name = solution.name;
        // Three dimensions are dear; a part of a period has steps enough to blow up in.
        let cells = if solution.dimension == 3 { "4 --periods 0.3" } else { "8" };
        let called = mms(place, &format!("run {name} --cells {cells} --json row.json"));
        assert_eq!(called.status, 0, "{name}: {}", called.stderr);
        let row = read_json(&place.join("row.json"));
        assert_eq!(row["result"]["status"], "ok", "{name}: {}", called.stdout);
        let first = called.stdout.lines().next().unwrap();
        let settings = &row["settings"];
        if UPDATED.contains(&name) {
            assert!(first.starts_with(name), "{first}");
            assert_eq!([&settings["frame"], &settings["shape"]], ["updated", "gimp"], "{name}");
            assert_eq!([&settings["cfl_speed"], &settings["integrator"]], ["bar", "cd"], "{name}");
            assert_eq!(settings["cfl"], 0.4, "{name}");
        } else {
            assert!(first.starts_with("total Lagrangian, cubic splines on a "), "{first}");
            assert!(first.contains(": it imposes prescribed-"), "{first}");
            assert_eq!([&settings["frame"], &settings["shape"]], ["total", "bspline3"], "{name}");
            // The options of the second line give the same result.
            let (_, options) =
                called.stdout.lines().nth(1).unwrap().split_once("as with ").unwrap();
            let call = format!("run {name} --cells {cells} {options} --json same.json");
            assert_eq!(mms(place, &call).status, 0, "{call}");
            let same = read_json(&place.join("same.json"));
            assert_eq!(same["settings"], row["settings"], "{name}");
            assert_eq!(same["result"]["errors"], row["result"]["errors"], "{name}");
        }
    }
}

#[test]
fn every_solution_converges_where_nothing_but_cells_is_said() {
    let place = tempfile::tempdir().unwrap();
    for solution in CATALOGUE.iter().filter(|solution| solution.dimension < 3) {
        let name = solution.name;
        let call = format!("converge {name} --cells 8,16 --periods 0.2 --json study.json");
        let called = mms(place.path(), &call);
        let study = read_json(&place.path().join("study.json"));
        for row in study["rows"].as_array().unwrap() {
            assert_eq!(row["status"], "ok", "{name}: {}", called.stdout);
        }
        // A verdict that is printed is one that is returned: a fifth of a period on such grids need not have the order yet.
        let failed = called.stdout.contains("FAILED");
        assert_eq!(called.status, i32::from(failed), "{name}: {}", called.stdout);
    }
}

#[test]
fn a_specification_without_boundaries_is_met_with_the_lines_to_add_and_runs_with_them() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let file = place.join("my-shear.toml");
    fs::write(&file, SHEAR).unwrap();
    let called = mms(place, "run my-shear.toml --cells 4");
    assert_eq!(called.status, 2, "{}", called.stdout);
    assert!(called.stderr.contains("X-lower, X-upper, Y-lower, Y-upper"), "{}", called.stderr);
    let start = called.stderr.find("[[boundary]]").unwrap();
    let lines: Vec<&str> = called.stderr[start..].lines().collect();
    fs::write(&file, format!("{SHEAR}\n{}\n", lines.join("\n"))).unwrap();
    let called = mms(place, "converge my-shear.toml --cells 8,16 --json study.json");
    assert_eq!(called.status, 0, "{}{}", called.stdout, called.stderr);
    assert!(called.stdout.starts_with("total Lagrangian, cubic splines on a Cartesian grid"));
    let study = read_json(&place.join("study.json"));
    assert_eq!(study["verdicts"]["u"]["l2"]["expected"], 4.0);
}

#[test]
fn what_is_said_holds() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let settings = |call: &str| {
        let called = mms(place, &format!("{call} --json row.json"));
        assert_eq!(called.status, 0, "{call}: {}", called.stderr);
        read_json(&place.join("row.json"))["settings"].clone()
    };
    let run = "run vortex --cells 8 --periods 0.1";
    assert_eq!(settings(&format!("{run} --shape bspline2"))["shape"], "bspline2");
    assert_eq!(settings(&format!("{run} --layout lattice --ppc 3"))["layout"], "lattice");
    let said = settings(&format!("{run} --cfl 0.1"));
    assert_eq!((said["cfl"].as_f64(), said["cfl_speed"].as_str()), (Some(0.1), Some("bar")));
    // A number for the speed that was asked for.
    let said = settings(&format!("{run} --cfl-speed bar"));
    assert!(said["cfl"].as_f64().unwrap() < 0.15, "{said}");
    assert_eq!(said["cfl_speed"], "bar");
    // The frame alone was asked for: the splines follow.
    assert_eq!(settings("run ring --cells 8 --periods 0.1 --frame total")["shape"], "bspline3");
    // A fitted layout has no boxes.
    let fitted = "run ring --cells 8 --periods 0.1 --layout body-fitted";
    assert_eq!(settings(fitted)["shape"], "cpdi2");
    let model = [
        "prescribed-motion on inner",
        "--formulation total-lagrangian --shape bspline3 --grid polar",
    ];
    refuses(place, "run vortex --frame updated", &model);
    refuses(place, "run vortex --shape gimp", &model);
    refuses(place, "run vortex --integrator usl", &model);
}

#[test]
fn one_command_has_one_cfl_number_for_one_time_step() {
    let place = tempfile::tempdir().unwrap();
    let call = "converge axis-aligned --cells 8 --cfls 0.25,0.125 --cfl-speed p-wave --periods 0.5 --json s.json";
    mms(place.path(), call);
    let study = read_json(&place.path().join("s.json"));
    let per_dt =
        |row: &serde_json::Value| row["cfl"].as_f64().unwrap() / row["dt"].as_f64().unwrap();
    let rows = |value: &serde_json::Value| value.as_array().unwrap().clone();
    let all = [rows(&study["rows"]), rows(&study["temporal"]["rows"])].concat();
    assert_eq!(all.len(), 4);
    for row in &all {
        assert!((per_dt(row) / per_dt(&all[0]) - 1.0).abs() < 1e-12, "{row}");
    }
}

#[test]
fn one_time_step_has_the_same_cfl_number_in_all_rows() {
    let place = tempfile::tempdir().unwrap();
    let call = "converge axis-aligned --cells 8 --cfls 0.4,0.2 --cfl-speed p-wave --periods 0.1 --json s.json";
    mms(place.path(), call);
    let study = read_json(&place.path().join("s.json"));
    let told = |rows: &serde_json::Value| -> Vec<[f64; 2]> {
        let number = |value: &serde_json::Value| value.as_f64().unwrap();
        let rows = rows.as_array().unwrap().iter();
        rows.map(|row| [number(&row["dt"]), number(&row["cfl"])]).collect()
    };
    let rows = told(&study["rows"]);
    assert_eq!(rows.len(), 2);
    assert_eq!(rows, told(&study["temporal"]["rows"]));
}

#[test]
fn the_steps_of_every_scheme_are_shared_among_threads() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    for scheme in [
        "",
        "--shape bspline3",
        "--shape cpdi2 --integrator usavg",
        "--transfer xpic2",
        "--frame total --shape bspline3 --cfl 0.2",
    ] {
        let call = format!("run axis-aligned-1d --cells 8 {scheme} --threads 2 --json row.json");
        let called = mms(place, &call);
        assert_eq!(called.status, 0, "{}", called.stderr);
        assert!(called.stdout.contains(", 2 threads\n"), "{scheme}: {}", called.stdout);
        assert_eq!(read_json(&place.join("row.json"))["settings"]["threads"], 2, "{scheme}");
    }
}

#[test]
fn errors_at_rounding_judge_nothing() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let study = "converge axis-aligned-1d --frame total --shape bspline5 --cfl 0.2";
    let called = mms(place, &format!("{study} --cells 128,256 --expect u.linf=1 --tolerance 0.1"));
    assert_eq!(called.status, 1, "{}", called.stdout);
    let expected = "FAILED, too few errors above rounding";
    assert!(called.stdout.contains(expected), "{}", called.stdout);
    assert!(called.stdout.contains("at rounding"), "{}", called.stdout);
    // Finer grids than that do not hide the order of the others.
    let called = mms(place, &format!("{study} --cells 16,32,256 --json study.json"));
    assert_eq!(called.status, 0, "{}", called.stdout);
    let study = read_json(&place.join("study.json"));
    let verdict = &study["verdicts"]["u"]["l2"];
    assert_eq!(verdict["rounding_rows"], serde_json::json!([2]));
    assert_eq!((&verdict["passed"], verdict["expected"].as_f64()), (&true.into(), Some(6.0)));
    assert!(study["orders"]["u"]["l2"]["local"][1].is_null());
}

#[test]
fn errors_that_say_nothing_are_no_success() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let status = |call: &str| {
        let called = mms(place, &format!("{call} --json row.json"));
        assert_eq!(called.status, 0, "{}", called.stderr);
        let row = read_json(&place.join("row.json"))["result"].clone();
        (row["status"].as_str().unwrap().to_owned(), row["errors"].clone())
    };
    let (tiny, errors) = status("run axis-aligned --cells 8 --set A=1e-200");
    assert!(tiny.contains("not judged") && tiny.contains("below the rounding"), "{tiny}");
    // All of the displacement is missing.
    let u = errors["u"]["linf"].as_f64().unwrap();
    assert!((0.9e-200..1.1e-200).contains(&u), "{u:e}");
    assert!(errors["u"]["l2"].as_f64().unwrap() > 1e-201, "{errors}");
    // In single precision positions are rounded at more.
    let (single, _) = status("run axis-aligned --cells 8 --set A=1e-9 --precision f32");
    assert!(single.contains("not judged"), "{single}");
    assert_eq!(status("run axis-aligned --cells 8 --set A=1e-9").0, "ok");
    // A body at rest is at rest.
    assert_eq!(status("run axis-aligned --cells 8 --set A=0").0, "ok");
    let (stiff, errors) = status("run axis-aligned --cells 8 --set E=1e160");
    assert_eq!(stiff, "ok");
    let P = [&errors["P"]["linf"], &errors["P"]["l2"], &errors["P"]["l1"]];
    assert!(P.iter().all(|norm| norm.as_f64().is_some_and(|norm| norm > 1e157)), "{errors}");
    let study = "converge axis-aligned --cells 8,16";
    let called = mms(place, &format!("{study} --set A=1e-200"));
    assert_eq!(called.status, 1, "{}", called.stdout);
    assert!(called.stdout.contains("FAILED, the finest run is not judged"));
    assert!(!called.stdout.contains("STOPPED"), "{}", called.stdout);
    let called = mms(place, &format!("{study} --set E=1e160"));
    assert_eq!(called.status, 0, "{}", called.stdout);
}
