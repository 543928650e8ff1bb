//! The tangents that `mms eval --tangent` gives, and what `mms score --newton` says of the logs of other solvers.

#![allow(clippy::unwrap_used)]

use mmsmith_tests::{mms, outcome, workspace};
use serde_json::{Value, json};

/// The entries of a field, row by row.
fn entries(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(all) => all.iter().flat_map(entries).collect(),
        other => vec![other.as_f64().unwrap_or(f64::NAN)],
    }
}

/// The chain rule: `dP/dX = A : dF/dX`, with derivatives along each axis by differences of the exact fields, of fourth order.
fn chain_rule(file: &str) -> Result<f64, String> {
    const STEP: f64 = 1e-3;
    let places = [[0.31, 0.62, 0.17], [0.73, 0.28, 0.55]];
    let dimension = std::fs::read_to_string(workspace().join(file)).unwrap();
    let dimension = (1..=3).find(|d| dimension.contains(&format!("dimension = {d}"))).unwrap();
    let shifts = [-2.0, -1.0, 1.0, 2.0].map(|shift| shift * STEP);
    let mut points = Vec::new();
    for place in places {
        let X = &place[..dimension];
        points.push(json!({ "X": X, "t": 0.37 }));
        for axis in 0..dimension {
            for shift in shifts {
                let mut moved = X.to_vec();
                moved[axis] += shift;
                points.push(json!({ "X": moved, "t": 0.37 }));
            }
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let list = folder.path().join("points.json");
    std::fs::write(&list, Value::Array(points).to_string()).unwrap();
    let (status, out, errors) =
        outcome(mms().args(["eval", file, "--tangent", "--points"]).arg(&list));
    if status != Some(0) {
        return Err(errors);
    }
    let result: Value = serde_json::from_str(&out).unwrap();
    let mut worst: f64 = 0.0;
    for of_place in result["rows"].as_array().unwrap().chunks(1 + 4 * dimension) {
        let square = dimension * dimension;
        let A = entries(&of_place[0]["dPdF"]);
        assert_eq!(A.len(), square * square);
        for beside in of_place[1..].chunks(4) {
            let slope = |field: &str| -> Vec<f64> {
                let at: Vec<Vec<f64>> = beside.iter().map(|row| entries(&row[field])).collect();
                let by = |k: usize| {
                    (8.0 * (at[2][k] - at[1][k]) - (at[3][k] - at[0][k])) / (12.0 * STEP)
                };
                (0..square).map(by).collect()
            };
            let (of_P, of_F) = (slope("P"), slope("F"));
            let (mut scale, mut difference) = (0.0_f64, 0.0_f64);
            for (row, of_P) in of_P.iter().enumerate() {
                let terms: Vec<f64> =
                    (0..square).map(|column| A[row * square + column] * of_F[column]).collect();
                scale = terms.iter().fold(scale, |scale, term| scale.max(term.abs()));
                difference = difference.max((of_P - terms.iter().sum::<f64>()).abs());
            }
            worst = worst.max(difference / scale);
        }
    }
    Ok(worst)
}

#[test]
fn tangents_are_the_derivatives_of_the_stresses_of_every_law() {
    let mut judged = 0;
    for folder in ["tests/data/specs/materials", "tests/data/specs/across"] {
        for entry in std::fs::read_dir(workspace().join(folder)).unwrap() {
            let file = entry.unwrap().file_name().into_string().unwrap();
            let file = format!("{folder}/{file}");
            let text = std::fs::read_to_string(workspace().join(&file)).unwrap();
            // Components that turn from place to place have derivatives of their own.
            if !text.contains("coordinates = 'cartesian'") {
                continue;
            }
            let worst = chain_rule(&file).unwrap_or_else(|errors| panic!("{file}: {errors}"));
            assert!(worst < 1e-7, "{file}: {worst:e}");
            judged += 1;
        }
    }
    assert!(judged > 30, "{judged}");
}

/// The status and the output for a log.
fn judged(log: &str) -> (Option<i32>, String, String) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("log.csv");
    std::fs::write(&file, log).unwrap();
    outcome(mms().args(["score", "--newton"]).arg(&file))
}

#[test]
fn logs_of_newtons_method_tell_of_the_tangent() {
    let quadratic = "step,iteration,residual\n1,0,7\n1,1,1e-1\n1,2,1e-3\n1,3,1e-7\n1,4,3e-15\n\
                     2,0,7\n2,1,3e-1\n2,2,9e-3\n2,3,8e-6\n2,4,6e-12\n";
    let linear = "iteration, Residual_Norm\n0, 7\n1, 1e-1\n2, 2e-2\n3, 4e-3\n4, 8e-4\n5, 1.6e-4\n0, 7\n1, 1\n2, 1e-1\n3, 1e-2\n";
    // A secant method, whose exponent is the golden ratio.
    let secant = "7 1e-1 3.16e-2 4.97e-3 2.48e-4 1.93e-6";
    for (log, status, words) in [
        (quadratic, 0, "the tangent is the derivative"),
        (linear, 1, "NOT QUADRATIC: exponent 1.00 in step 1"),
        (secant, 1, "superlinear"),
        ("residual\n1\n1e-9\n", 1, "NOT TOLD"),
        ("residual\n1\n2\n3\n4\n5\n", 1, "do not fall"),
        ("iteration,norm_of_u\n1,2\n", 2, "there is no column residual among iteration,norm_of_u"),
        ("residual\nsmall\n", 2, "row 1: 'small' in column residual is no number"),
        ("residual\n1\n-1\n", 2, "residuals are norms"),
        ("residual\n", 2, "it has no row"),
        ("", 2, "residual"),
    ] {
        let (found, out, errors) = judged(log);
        assert_eq!(found, Some(status), "{log}\n{out}{errors}");
        assert!(format!("{out}{errors}").contains(words), "{words} is not in\n{out}{errors}");
    }
}

/// The status and the output for a tangent that `change` made of the right one.
fn diagnosed(change: impl Fn(String) -> String) -> (Option<i32>, String, String) {
    let folder = tempfile::tempdir().unwrap();
    let [points, file] = ["points.csv", "tangent.csv"].map(|name| folder.path().join(name));
    std::fs::write(&points, "X,Y,t\n0.3,0.6,0.01\n0.7,0.2,0.02\n").unwrap();
    let mut call = mms();
    call.args(["eval", "skew-2d", "--tangent", "--points"]).arg(&points).arg("--csv").arg(&file);
    let (status, out, errors) = outcome(&mut call);
    assert_eq!(status, Some(0), "{out}{errors}");
    std::fs::write(&file, change(std::fs::read_to_string(&file).unwrap())).unwrap();
    outcome(mms().args(["diagnose", "skew-2d", "--tangent"]).arg(&file))
}

#[test]
fn mistakes_in_tangents_are_named_from_the_file_of_their_values() {
    let (status, out, errors) = diagnosed(|text| text);
    assert_eq!(status, Some(0), "{out}{errors}");
    assert!(out.contains("The tangent is right at 2 points"), "{out}");
    // The names of F's components in the order of columns.
    let turned = |text: String| {
        let text = text.replacen("dF12", "dF!", 4).replacen("dF21", "dF12", 4);
        text.replacen("dF!", "dF21", 4)
    };
    let (status, out, errors) = diagnosed(turned);
    assert_eq!(status, Some(1), "{out}{errors}");
    for expected in ["WRONG", "columns-transposed", "dP12dF21"] {
        assert!(out.contains(expected), "{expected} is not in\n{out}");
    }
    let (status, _, errors) = diagnosed(|text| text.replace("dP22dF11", "dPyydFxx"));
    assert_eq!(status, Some(2), "{errors}");
    assert!(errors.contains("there is no column dP22dF11"), "{errors}");
    assert!(errors.contains("mms eval skew-2d --points POINTS --tangent --csv FILE"), "{errors}");
    let (status, _, errors) = diagnosed(|text| text.replace("F22,J", "Fyy,J"));
    assert_eq!(status, Some(2), "{errors}");
    assert!(
        errors.contains("there is no column F22, and other columns of F are there"),
        "{errors}"
    );
}
