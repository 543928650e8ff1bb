//! Orders of accuracy and the figures of an independent implementation, through `mms converge`.
//!
//! These simulate for seconds each and run in release mode: `cargo test --release -p mmsmith-tests`, or with
//! `MMSMITH_MMS=target/release/mms` and `-- --include-ignored`.

#![allow(clippy::unwrap_used)]

use mmsmith_tests::{at, column, json};
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

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn every_pair_of_shape_and_integrator_runs_on_both_problems_or_says_why_not() {
    for name in ["axis-aligned", "ring"] {
        for shape in ["linear", "ugimp", "gimp"] {
            for integrator in ["usf", "usl", "musl", "cd"] {
                let options = ["--shape", shape, "--integrator", integrator, "--cells", "8,16"];
                let result = json(&[&["converge", name][..], &options].concat());
                let rows = result["rows"].as_array().unwrap();
                assert_eq!(rows.len(), 2);
                for row in rows {
                    let (status, error) =
                        (row["status"].as_str().unwrap(), at(row, &["errors", "u", "linf"]));
                    if status == "ok" {
                        assert!(error > 1e-4 && error < 0.5, "{name} {shape} {integrator} {row}");
                    } else {
                        // Only hat functions lose particles so early, and the row names step and particle.
                        assert_eq!(shape, "linear", "{name} {integrator}: {status}");
                        assert!(status.contains("step") && status.contains("particle"), "{status}");
                    }
                }
            }
        }
    }
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn a_time_step_beyond_the_limit_is_a_row_with_its_status() {
    let result = json(&["converge", "axis-aligned", "--cells", "16", "--cfls", "0.4,2.5"]);
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
