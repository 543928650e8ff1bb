//! `mms tradeoff`, and what runs are predicted to take, as a user meets them.

use crate::command::{keys, mms, names, read_json, refuses};
use serde_json::Value;

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

/// A sweep writes its results, however far it comes in its time; how far it must come is tested with a clock that counts work.
#[test]
fn a_short_sweep_writes_what_it_measured() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let called = mms(
        place,
        "tradeoff axis-aligned --budget 1s --tolerance 1e-2 --json found.json --csv found.csv --plot found.svg --advice \
         found.md",
    );
    // Whether an error of 1e-2 is met within a second is a matter of the machine.
    assert!([0, 1].contains(&called.status), "{}{}", called.stdout, called.stderr);
    assert_eq!(names(place), ["found.csv", "found.json", "found.md", "found.svg"]);
    let found = read_json(&place.join("found.json"));
    assert_eq!(
        keys(&found),
        "chosen definition effects families front knobs rows schema settings skipped tolerances tolerances_by_formulation used_s"
    );
    assert_eq!(found["schema"], "mmsmith.tradeoff/1");
    assert!(found["definition"].as_str().expect("text").contains("L_inf of u over A = 0.1"));

    let rows = found["rows"].as_array().expect("rows");
    for row in rows {
        for key in ["cells", "h", "dt", "cfl", "steps", "particles", "wall_s", "cpu_s", "bytes"] {
            assert!(number(&row[key]) > 0.0, "{key}: {row}");
        }
        let (updated, total) = (["integrator", "transfer"], ["mass", "grid"]);
        let is_total = row["formulation"] == "total-lagrangian";
        let (own, others) = if is_total { (total, updated) } else { (updated, total) };
        for key in ["shape", "frame", "layout", "precision"].into_iter().chain(own) {
            assert!(row[key].is_string(), "{key}: {row}");
        }
        assert!(others.iter().all(|key| row.get(key).is_none()), "{row}");
        if row["status"] == "ok" {
            let error = number(&row["errors"]["u"]["linf"]) / 0.1;
            assert_eq!(number(&row["error"]), error);
        }
    }
    // The front is what no other row betters.
    let front: Vec<usize> = found["front"]
        .as_array()
        .expect("a front")
        .iter()
        .map(|index| index.as_u64().expect("an index") as usize)
        .collect();
    let (cost, error) = (|row: &Value| number(&row["wall_s"]), |row: &Value| number(&row["error"]));
    let ok = || rows.iter().filter(|row| row["status"] == "ok");
    for &index in &front {
        let one = &rows[index];
        assert!(!ok().any(|row| cost(row) < cost(one) && error(row) < error(one)), "{one}");
    }
    assert!(ok().all(|row| front.iter().any(|&i| error(&rows[i]) <= error(row))));

    // Users compare settings of one formulation.
    for (formulation, cheapest) in found["tolerances_by_formulation"].as_object().expect("groups") {
        for index in
            cheapest.as_array().expect("a list").iter().filter_map(|own| own["index"].as_u64())
        {
            assert_eq!(rows[index as usize]["formulation"], **formulation);
        }
    }

    // The command that is given runs the same setting.
    for named in found["tolerances"].as_array().expect("tolerances") {
        let Some(index) = named["index"].as_u64() else { continue };
        let row = &rows[index as usize];
        assert!(error(row) <= number(&named["tolerance"]));
        let command = named["command"].as_str().and_then(|text| text.strip_prefix("mms "));
        let again = mms(place, &format!("{} --json again.json", command.expect("a command")));
        assert_eq!(again.status, 0, "{}", again.stderr);
        assert_eq!(read_json(&place.join("again.json"))["result"]["errors"], row["errors"]);
        break;
    }
    let chosen = &found["chosen"][0];
    assert_eq!(chosen["for"], "tolerance");
    assert_eq!(chosen["holds"], called.status == 0);
    let sheet = std::fs::read_to_string(place.join("found.csv")).expect("a table");
    assert_eq!(sheet.lines().count(), rows.len() + 1);
    let picture = std::fs::read_to_string(place.join("found.svg")).expect("a picture");
    assert!(picture.ends_with("</svg>\n"));
    let advice = std::fs::read_to_string(place.join("found.md")).expect("a page");
    assert!(advice.contains("## What accuracy costs"));
}

#[test]
fn what_cannot_be_swept_is_refused() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let turning = std::fs::read_to_string(format!(
        "{root}/tests/data/specs/materials/anisotropic-polar.toml"
    ));
    let moved = ["inner", "outer"].map(|surface| {
        format!("[[boundary]]\nsurface = '{surface}'\ncondition = 'prescribed-motion'\n")
    });
    let turning = turning.expect("a specification") + &moved.concat();
    std::fs::write(place.join("turning.toml"), turning).expect("a file");
    let call = "tradeoff turning.toml --budget 1s --json a.json";
    refuses(place, call, &["directions along curvilinear coordinates", "in J, I1 and I2"]);
    refuses(place, "tradeoff ring --budget 2x", &["--budget", "90s, 2m or 1h"]);
    refuses(place, "tradeoff ring --budget=-1s", &["--budget", "90s, 2m or 1h"]);
    refuses(place, "tradeoff rings --budget 1s", &["did you mean 'ring'"]);
}

/// Elements that hold the displacement show no order.
#[test]
fn explain_warns_of_displacements_that_elements_represent_exactly() {
    let place = tempfile::tempdir().unwrap();
    let called = mms(place.path(), "explain rigid-motion --json told.json");
    assert_eq!(called.status, 0, "{}", called.stderr);
    assert!(called.stdout.contains("u is a polynomial of degree 1"), "{}", called.stdout);
    let told = std::fs::read_to_string(place.path().join("told.json")).unwrap();
    assert!(told.contains("\"polynomial_degree\": 1"), "{told}");
    assert!(!mms(place.path(), "explain ring").stdout.contains("polynomial"));
}

#[test]
fn explain_predicts_runs_of_every_grid() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let called = mms(place, "explain ring --json told.json");
    assert_eq!(called.status, 0, "{}", called.stderr);
    let runs = read_json(&place.join("told.json"))["runs"].clone();
    let runs = runs.as_array().expect("rows");
    assert_eq!(
        runs.iter().map(|run| number(&run["cells"])).collect::<Vec<_>>(),
        [32.0, 64.0, 128.0, 256.0]
    );
    for pair in runs.windows(2) {
        // Twice the cells are more work on any machine; how much time that takes is tested as arithmetic.
        assert!(number(&pair[1]["steps"]) > number(&pair[0]["steps"]), "{pair:?}");
        assert!(number(&pair[0]["total_s"]) >= number(&pair[0]["steps_s"]));
    }
    let called = mms(place, "explain shear-wave");
    assert!(called.stdout.contains("total Lagrangian, cubic splines"), "{}", called.stdout);
}

#[test]
fn long_runs_are_announced_and_those_that_do_not_fit_are_refused() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    refuses(place, "run axis-aligned --cells 1000000", &["GiB of memory", "are available"]);
    // Not a quiet minute: it is announced before the first step, and stopped here.
    use std::io::Read;
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_mms"))
        .args(["run", "axis-aligned", "--cells", "512", "--periods", "100", "--threads", "1"])
        .stderr(std::process::Stdio::piped())
        .stdout(std::process::Stdio::null())
        .spawn()
        .expect("it starts");
    let mut said = [0; 10];
    let told = child.stderr.take().expect("a pipe").read_exact(&mut said);
    child.kill().expect("it runs");
    child.wait().expect("it ends");
    told.expect("a prediction");
    assert_eq!(&said, b"predicted:");
}
