//! The exact fields against values from an independent high-precision computation, through `mms eval`.
//!
//! `data/golden.json` holds 20 points for each of the two original problems, to 25 digits, with the sensitivity of
//! every entry to its inputs. The acceptance rule is `|r - g| <= K 2^-53 (sens + |g|)`, evaluated exactly here.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use mmsmith_tests::{json, workspace};
use num_rational::BigRational;
use num_traits::{Signed, ToPrimitive, Zero};
use serde_json::{Value, json};

/// The exact value of a decimal number.
fn exact(text: &str) -> BigRational {
    let (mantissa, exponent) = text.split_once('e').unwrap_or((text, "0"));
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let digits: num_rational::BigRational =
        BigRational::from_integer(format!("{whole}{fraction}").parse().unwrap());
    let scale = exponent.parse::<i32>().unwrap() - fraction.len() as i32;
    digits * num_traits::Pow::pow(BigRational::from_integer(10.into()), scale)
}

/// The entries of a nested list.
fn flat(value: &Value) -> Vec<&Value> {
    match value.as_array() {
        Some(entries) => entries.iter().flat_map(flat).collect(),
        None => vec![value],
    }
}

/// The transpose of a list of rows: the golden file's P is the nominal stress, ours the first Piola-Kirchhoff one.
fn transposed(matrix: &Value) -> Value {
    let rows = matrix.as_array().unwrap();
    json!(
        (0..rows.len())
            .map(|j| rows.iter().map(|row| &row[j]).collect::<Vec<_>>())
            .collect::<Vec<_>>()
    )
}

/// The K of the acceptance rule that this result needs.
fn factor(found: &Value, golden: &Value, sensitivity: &Value) -> f64 {
    let golden = exact(golden.as_str().unwrap());
    let found = BigRational::from_float(found.as_f64().unwrap()).unwrap();
    let unit = BigRational::new(1.into(), num_traits::pow(2.into(), 53));
    let allowed = unit * (exact(sensitivity.as_str().unwrap()) + golden.abs());
    let difference = (found - golden).abs();
    if difference.is_zero() {
        0.0
    } else {
        (difference / allowed).to_f64().unwrap_or(f64::INFINITY)
    }
}

fn check(solution: &str, problem: &str) {
    let text = std::fs::read_to_string(workspace().join("tests/data/golden.json")).unwrap();
    let golden: Value = serde_json::from_str(&text).unwrap();
    let points = golden["problems"][problem].as_array().unwrap();
    assert_eq!(points.len(), 20);
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("points.json");
    let asked: Vec<Value> =
        points.iter().map(|p| json!({ "X": p["X"], "t": p["t"], "par": p["par"] })).collect();
    std::fs::write(&input, serde_json::to_string(&asked).unwrap()).unwrap();
    let result = json(&["eval", solution, "--points", input.to_str().unwrap()]);
    let rows = result["rows"].as_array().unwrap();
    assert_eq!(rows.len(), points.len());

    let mut worst = 0.0_f64;
    for (row, point) in rows.iter().zip(points) {
        let keys: Vec<&str> = row.as_object().unwrap().keys().map(String::as_str).collect();
        assert_eq!(keys.len(), 8, "the keys of a row are {keys:?}");
        for key in ["u", "v", "a", "H", "F", "J", "P", "b"] {
            let (mut golden, mut sensitivity) =
                (point["out"][key].clone(), point["sens"][key].clone());
            if key == "P" {
                (golden, sensitivity) = (transposed(&golden), transposed(&sensitivity));
            }
            let (found, golden, sensitivity) = (flat(&row[key]), flat(&golden), flat(&sensitivity));
            assert_eq!(found.len(), golden.len());
            for ((r, g), s) in found.iter().zip(&golden).zip(&sensitivity) {
                let K = factor(r, g, s);
                assert!(K <= 8.0, "{key} at {point}: {r} needs K = {K}, not {g}");
                worst = worst.max(K);
            }
        }
    }
    println!("{problem}: K = {worst:.2} at most");
}

#[test]
fn axis_aligned_including_tiny_amplitude_and_no_lateral_contraction() {
    check("axis-aligned", "axis-aligned-2d");
}

#[test]
fn ring_including_tiny_amplitude() {
    check("ring", "ring-2d");
}
