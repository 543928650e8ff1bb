//! Orders of accuracy and the figures of an independent implementation, through `mms converge`.
//!
//! These simulate for seconds each and run in release mode: `cargo test --release -p mmsmith-tests`, or with
//! `MMSMITH_MMS=target/release/mms` and `-- --include-ignored`.

#![allow(clippy::unwrap_used)]

use mmsmith_tests::{at, column, json, json_as_judged};
use serde_json::Value;

fn local_orders(result: &Value, field: &str, norm: &str) -> Vec<f64> {
    let orders = result["orders"][field][norm]["local"].as_array().unwrap();
    orders.iter().map(|order| order.as_f64().unwrap_or(f64::NAN)).collect()
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn axis_aligned_gimp_with_centred_differences_has_the_reference_errors_and_order_two() {
    let result = json(&["converge", "axis-aligned", "--cells", "16,32,64,128"]);
    let errors = column(&result, &["errors", "u", "linf"]);
    for (found, expected) in errors.iter().zip([4.08e-3, 1.01e-3, 2.55e-4, 6.46e-5]) {
        assert!((found / expected - 1.0).abs() < 0.05, "{found:e} is not {expected:e}");
    }
    let orders = local_orders(&result, "u", "linf");
    assert_eq!(orders.len(), 3);
    assert!(orders.iter().all(|order| (order - 2.0).abs() < 0.05), "{orders:?}");
    let fit = at(&result, &["orders", "u", "linf", "fit"]);
    assert!((fit - 2.0).abs() < 0.05, "{fit}");
}

/// A plate in plane stress with a stress at the start, in both formulations.
#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn a_stretched_plate_has_the_orders_of_blocks() {
    for (formulation, shape, cells, cfl, order) in
        [("total", "bspline3", "8,16", "0.2", 4.0), ("updated", "gimp", "16,32", "0.4", 2.0)]
    {
        let file = "tests/data/specs/across/plate-sliding.toml";
        let scheme = ["--formulation", formulation, "--shape", shape, "--cfl", cfl];
        let result = json(&[&["converge", file, "--cells", cells][..], &scheme].concat());
        let orders = local_orders(&result, "u", "l2");
        assert!(orders.iter().all(|found| (found - order).abs() < 0.15), "{shape}: {orders:?}");
    }
}

/// The local orders in `dt` of the differences of `u` on one grid, in all norms.
fn orders_in_time(integrator: &str, amplitude: &str, cells: &str, cfls: &str) -> Vec<f64> {
    let grid = ["--set", amplitude, "--cells", cells, "--cfls", cfls];
    let scheme = ["converge", "axis-aligned", "--integrator", integrator];
    let result = json(&[&scheme[..], &grid].concat());
    let norms = ["linf", "l2", "l1"];
    norms.iter().flat_map(|norm| local_orders(&result["temporal"], "u", norm)).collect()
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn by_differences_on_one_grid_usl_is_first_order_in_time() {
    for (amplitude, cells, cfls) in
        [("A=0.001", "64", "0.6,0.4,0.2"), ("A=0.1", "32", "0.4,0.2,0.1,0.05")]
    {
        let orders = orders_in_time("usl", amplitude, cells, cfls);
        assert!(orders.len() >= 6 && orders.iter().all(|o| (o - 1.0).abs() < 0.05), "{orders:?}");
    }
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn by_differences_on_one_grid_centred_differences_are_second_order_in_time() {
    let orders = orders_in_time("cd", "A=0.001", "64", "0.6,0.4,0.2");
    assert!(orders.len() == 6 && orders.iter().all(|o| (o - 2.0).abs() < 0.05), "{orders:?}");
    // The term in dt h^2 that joins the one in dt^2 is more visible on a coarser grid.
    let coarse = orders_in_time("cd", "A=0.001", "32", "0.6,0.4,0.2");
    assert!(
        coarse.iter().zip(&orders).all(|(coarse, fine)| coarse < fine),
        "{coarse:?} {orders:?}"
    );
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn with_weights_that_stay_every_field_has_the_order_of_the_composition_in_time() {
    // At the full amplitude: in the updated frame it is the moving weights that hide the order there.
    for (solution, composition, order) in
        [("axis-aligned", "2", 2.0), ("skew-2d", "2", 2.0), ("ring", "4", 4.0)]
    {
        let scheme = ["converge", solution, "--frame", "total", "--shape", "bspline3"];
        let study = ["--composition", composition, "--cells", "16", "--cfls", "0.2,0.1,0.05"];
        let result = json(&[&scheme[..], &study].concat());
        for field in ["u", "v", "F", "P"] {
            for norm in ["linf", "l2", "l1"] {
                let orders = local_orders(&result["temporal"], field, norm);
                let all = orders.len() == 2 && orders.iter().all(|o| (o - order).abs() < 0.05);
                assert!(all, "{solution} {field} {norm}: {orders:?}");
            }
        }
    }
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn at_a_small_time_step_usl_is_second_order_in_space() {
    let cells = ["--cells", "16,32,64", "--cfl", "0.05"];
    let scheme = ["converge", "axis-aligned", "--integrator", "usl"];
    let result = json(&[&scheme[..], &cells].concat());
    let orders = local_orders(&result, "u", "linf");
    assert!(orders.len() == 2 && orders.iter().all(|o| (o - 2.0).abs() < 0.1), "{orders:?}");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn every_pair_of_shape_and_integrator_runs_on_both_problems_or_says_why_not() {
    for name in ["axis-aligned", "ring"] {
        for shape in ["linear", "ugimp", "gimp"] {
            for integrator in ["usf", "usl", "musl", "cd"] {
                let options = ["--shape", shape, "--integrator", integrator, "--cells", "8,16"];
                let result = json_as_judged(&[&["converge", name][..], &options].concat());
                let rows = result["rows"].as_array().unwrap();
                assert_eq!(rows.len(), 2);
                for row in rows {
                    let (status, error) =
                        (row["status"].as_str().unwrap(), at(row, &["errors", "u", "linf"]));
                    if status == "ok" {
                        assert!(error > 1e-4 && error < 0.5, "{name} {shape} {integrator} {row}");
                    } else {
                        // Only hat functions lose particles so early, and the row names step and particle, or exceed the motion.
                        assert_eq!(shape, "linear", "{name} {integrator}: {status}");
                        let is_lost = status.contains("step") && status.contains("particle");
                        assert!(is_lost || status.contains("exceeds the motion"), "{status}");
                    }
                }
            }
        }
    }
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn a_time_step_beyond_the_limit_is_a_row_with_its_status() {
    let result =
        json_as_judged(&["converge", "axis-aligned", "--cells", "16", "--cfls", "0.4,2.5"]);
    let rows = result["rows"].as_array().unwrap();
    assert_eq!(rows[0]["status"], "ok");
    let status = rows[1]["status"].as_str().unwrap();
    assert!(status != "ok" && status.contains("step"), "{status}");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn results_are_the_same_bits_for_any_number_of_threads() {
    let errors = |threads: &str| {
        let result = json(&["run", "axis-aligned", "--cells", "32", "--threads", threads]);
        result["result"]["errors"].clone()
    };
    let one = errors("1");
    assert_eq!(one, errors("2"));
    assert_eq!(one, errors("3"));
}
