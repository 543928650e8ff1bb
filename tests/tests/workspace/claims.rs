//! The claims of the original study, one test each: P. Wallstedt and J. Guilkey, Evaluation of Time Integration
//! Schemes for the Generalized Interpolation Material Point Method (slides).
//!
//! Where a claim holds only with a condition, the test says so. Those that simulate run in release mode:
//! `cargo test --release -p mmsmith-tests`.

#![allow(clippy::unwrap_used)]

use mmsmith_tests::{at, column, json, json_as_judged, mms, outcome};
use mmsmith_vtk::Values;
use serde_json::{Value, json};

/// L_inf of the displacement over cell counts; infinite where the case did not reach the end.
fn errors(name: &str, shape: &str, integrator: &str, cells: &str) -> Vec<f64> {
    let options = ["--shape", shape, "--integrator", integrator, "--cells", cells];
    finished(&json_as_judged(&[&["converge", name][..], &options].concat()))
}

/// [`errors`] over CFL numbers on one grid.
fn errors_over_time_steps(name: &str, shape: &str, integrator: &str, cfls: &str) -> Vec<f64> {
    let grid = ["--cells", "32", "--cfls", cfls];
    let options = ["--shape", shape, "--integrator", integrator];
    finished(&json_as_judged(&[&["converge", name][..], &grid, &options].concat()))
}

fn finished(result: &Value) -> Vec<f64> {
    let rows = result["rows"].as_array().unwrap();
    let errors = column(result, &["errors", "u", "linf"]);
    rows.iter()
        .zip(errors)
        .map(|(r, e)| if r["status"] == "ok" { e } else { f64::INFINITY })
        .collect()
}

/// The order between the last two of a sequence of halved spacings.
fn last_order(errors: &[f64]) -> f64 {
    (errors[errors.len() - 2] / errors[errors.len() - 1]).log2()
}

#[test]
fn the_printed_body_force_of_the_axis_aligned_problem_is_the_derived_one() {
    let (A, E, nu, rho0) = (0.17_f64, 250.0_f64, 0.31, 2.5_f64);
    let pi = std::f64::consts::PI;
    let points: Vec<Value> = (0..40)
        .map(|k| {
            let f = f64::from(k);
            let X = [(0.37 * f + 0.01).fract(), (0.73 * f + 0.2).fract()];
            json!({ "X": X, "t": 0.011 * f, "par": { "A": A, "E": E, "nu": nu, "rho0": rho0 } })
        })
        .collect();
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("points.json");
    std::fs::write(&input, Value::from(points.clone()).to_string()).unwrap();
    let result = json(&["eval", "axis-aligned", "--points", input.to_str().unwrap()]);
    for (row, point) in result["rows"].as_array().unwrap().iter().zip(&points) {
        let (X, t) = (&point["X"], point["t"].as_f64().unwrap());
        let c = (E / rho0).sqrt();
        let time = [(c * pi * t).cos(), (c * pi * t).sin()];
        let lambda = E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu));
        let mu = E / (2.0 * (1.0 + nu));
        let position = |i: usize| pi * X[i].as_f64().unwrap();
        let F = [0, 1].map(|i| 1.0 + A * pi * position(i).cos() * time[i]);
        for i in 0..2 {
            let u = A * position(i).sin() * time[i];
            let inverse = 1.0 / (F[i] * F[i]);
            let bracket = lambda * (1.0 - (F[0] * F[1]).ln()) * inverse + mu * (1.0 + inverse) - E;
            let expected = pi * pi / rho0 * u * bracket;
            let found = row["b"][i].as_f64().unwrap();
            assert!((found - expected).abs() < 1e-11 * E, "{found} is not {expected}");
        }
    }
}

#[test]
fn the_coefficients_of_the_ring_free_its_rims_of_traction() {
    let (status, out, errors) = outcome(mms().args(["check", "ring"]));
    assert_eq!(status, Some(0), "{out}{errors}");
    let rims: Vec<&str> = out.lines().filter(|line| line.trim().starts_with("P N on")).collect();
    assert_eq!(rims.len(), 2, "{out}");
    assert!(rims.iter().all(|line| line.contains("passed")), "{out}");
    assert!(
        out.contains("proved, zero in symbols for all parameters: P N on inner, P N on outer"),
        "{out}"
    );
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn cd_gimp_is_second_order_on_the_axis_aligned_problem() {
    let errors = errors("axis-aligned", "gimp", "cd", "16,32,64");
    let orders = [(errors[0] / errors[1]).log2(), (errors[1] / errors[2]).log2()];
    assert!(orders.iter().all(|order| (order - 2.0).abs() < 0.05), "{orders:?}");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn the_initialization_shortcut_works() {
    let error = |start: &str| {
        let result = json(&["run", "axis-aligned", "--cells", "32", "--start", start]);
        at(&result, &["result", "errors", "u", "linf"])
    };
    let (exact, data, halved) = (error("exact"), error("data"), error("halved"));
    for start in [data, halved] {
        assert!((start / exact - 1.0).abs() < 0.03, "{exact:e} {data:e} {halved:e}");
    }
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn without_the_half_step_usl_drops_towards_first_order_at_fixed_cfl() {
    let errors = errors("axis-aligned", "gimp", "usl", "16,32,64,128");
    let order = last_order(&errors);
    assert!((0.8..1.2).contains(&order), "{order} from {errors:?}");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn usl_loses_a_spatial_order_and_gains_a_temporal_one() {
    // On a grid fine enough the error of USL follows the time step, which that of CD does not.
    let result = json(&[
        "converge",
        "axis-aligned",
        "--integrator",
        "usl",
        "--cells",
        "64",
        "--cfls",
        "0.3,0.4,0.6",
    ]);
    let temporal = at(&result, &["orders", "u", "linf", "fit"]);
    assert!((temporal - 1.0).abs() < 0.15, "{temporal}");
    // With a small time step the spatial order is back: the lost order was one in time all along.
    let result = json(&[
        "converge",
        "axis-aligned",
        "--integrator",
        "usl",
        "--cells",
        "16,32,64",
        "--cfl",
        "0.05",
    ]);
    let spatial = at(&result, &["orders", "u", "linf", "fit"]);
    assert!(spatial > 1.7, "{spatial}");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn the_minor_change_to_ugimp_causes_an_error_that_grows_with_refinement() {
    let ugimp = errors("axis-aligned", "ugimp", "cd", "32,64,128");
    assert!(ugimp[0] < ugimp[1] && ugimp[1] < ugimp[2], "{ugimp:?}");
    let gimp = errors("axis-aligned", "gimp", "cd", "128");
    assert!(ugimp[2] > 50.0 * gimp[0], "{ugimp:?} against {gimp:?}");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn usf_and_plain_mpm_are_poor() {
    let good = errors("axis-aligned", "gimp", "cd", "16,32");
    let usf = errors("axis-aligned", "gimp", "usf", "16,32");
    assert!(usf[0] > 3.0 * good[0] && usf[1] > 6.0 * good[1], "{usf:?} against {good:?}");
    let mpm = errors("axis-aligned", "linear", "cd", "16,32");
    assert!(mpm[0] > 10.0 * good[0] && mpm[1] > 50.0 * good[1], "{mpm:?} against {good:?}");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn reduced_cfl_has_no_benefit_for_cd_gimp() {
    let errors = errors_over_time_steps("axis-aligned", "gimp", "cd", "0.1,0.2,0.4");
    let (smallest, largest) =
        errors.iter().fold((f64::MAX, 0.0_f64), |(s, l), &e| (s.min(e), l.max(e)));
    assert!(largest < 1.3 * smallest, "{errors:?}");
    // The smallest time step is not the most accurate: spatial and temporal errors have opposite signs.
    assert!(errors[0] > errors[2], "{errors:?}");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn stability_is_lost_below_cfl_one() {
    let errors = errors_over_time_steps("axis-aligned", "gimp", "cd", "0.7,1.0");
    assert!(errors[0] < 2e-3, "{errors:?}");
    assert!(errors[1] > 2e-3, "{errors:?}");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn rows_and_columns_stay_straight_only_with_the_right_answer() {
    // The spread of u_x along columns of particles that share X, largest over columns and frames.
    let spread = |shape: &str, expected: i32| {
        let folder = tempfile::tempdir().unwrap();
        let options = ["run", "axis-aligned", "--cells", "32", "--frames", "5", "--shape", shape];
        let (status, _, errors) = outcome(mms().args(options).arg("--vtk").arg(folder.path()));
        assert_eq!(status, Some(expected), "{errors}");
        let mut largest = 0.0_f64;
        let mut frames = 0;
        for entry in std::fs::read_dir(folder.path()).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_none_or(|extension| extension != "vtu") {
                continue;
            }
            frames += 1;
            let frame = mmsmith_vtk::read(&path).unwrap();
            let array = frame.arrays.iter().find(|array| array.name == "displacement").unwrap();
            let Values::Vector(u) = &array.values else { panic!("displacement is a vector") };
            let mut columns: std::collections::BTreeMap<i64, (f64, f64)> = Default::default();
            for (x, u) in frame.points.iter().zip(u) {
                let column = ((x[0] - u[0]) * 64.0).floor() as i64;
                let range = columns.entry(column).or_insert((u[0], u[0]));
                *range = (range.0.min(u[0]), range.1.max(u[0]));
            }
            assert_eq!(columns.len(), 64);
            largest = columns.values().fold(largest, |l, (low, high)| l.max(high - low));
        }
        assert!(frames >= 5);
        largest
    };
    // The errors of hat functions exceed the motion.
    let (gimp, linear) = (spread("gimp", 0), spread("linear", 1));
    let cell = 1.0 / 32.0;
    assert!(gimp < 0.05 * cell, "{gimp:e}");
    assert!(linear > 0.5 * cell, "{linear:e}");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn misaligned_particles_and_stair_steps_cost_the_ring_its_second_order() {
    let result = json(&["converge", "ring", "--cells", "16,32,64,128"]);
    let fit = at(&result, &["orders", "u", "linf", "fit"]);
    assert!((0.2..1.2).contains(&fit), "{fit}");
    let mean = at(&result, &["orders", "u", "l1", "fit"]);
    assert!((0.4..1.3).contains(&mean), "{mean}");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn the_deformation_gradient_does_not_converge_at_the_rims_of_the_ring() {
    let result = json(&["converge", "ring", "--cells", "16,32,64"]);
    let errors = column(&result, &["errors", "F", "linf"]);
    assert!(errors[2] > 0.5 * errors[0], "{errors:?}");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn on_the_ring_ugimp_is_nearly_as_accurate_as_gimp_until_the_highest_resolutions() {
    let mean = |shape: &str| {
        let result = json(&["converge", "ring", "--shape", shape, "--cells", "16,32,128"]);
        column(&result, &["errors", "u", "l1"])
    };
    let (gimp, ugimp) = (mean("gimp"), mean("ugimp"));
    assert!(ugimp[0] < 1.3 * gimp[0] && ugimp[1] < 1.5 * gimp[1], "{gimp:?} {ugimp:?}");
    assert!(ugimp[2] > 1.5 * gimp[2], "{gimp:?} {ugimp:?}");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn on_the_ring_a_smaller_time_step_gains_little() {
    let errors = errors_over_time_steps("ring", "gimp", "cd", "0.1,0.2,0.4");
    let (smallest, largest) =
        errors.iter().fold((f64::MAX, 0.0_f64), |(s, l), &e| (s.min(e), l.max(e)));
    assert!(largest < 1.5 * smallest, "{errors:?}");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn plain_mpm_stops_on_the_ring_with_an_inverted_surface_particle() {
    let result = json_as_judged(&["run", "ring", "--shape", "linear", "--cells", "16"]);
    let status = result["result"]["status"].as_str().unwrap();
    assert!(status.contains("J ") && status.contains("particle"), "{status}");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn cd_gimp_is_significantly_better_than_every_other_choice() {
    let best = errors("axis-aligned", "gimp", "cd", "64")[0];
    for (shape, integrator) in [("gimp", "usl"), ("gimp", "usf"), ("ugimp", "cd"), ("linear", "cd")]
    {
        let other = errors("axis-aligned", shape, integrator, "64")[0];
        assert!(other > 3.0 * best, "{shape} + {integrator}: {other:e} against {best:e}");
    }
}
