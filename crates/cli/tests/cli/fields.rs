//! `mms list`, `mms check` and `mms eval` as a user meets them.

use crate::command::{keys, mms, mms_with, read_json, refuses};
use std::fs;

#[test]
fn list_names_every_solution_and_its_parameters() {
    let place = tempfile::tempdir().unwrap();
    let called = mms(place.path(), "list --long --json list.json");
    assert_eq!(called.status, 0, "{}", called.stderr);
    for word in ["axis-aligned", "ring", "rho0", "Young"] {
        assert!(called.stdout.contains(word), "{}", called.stdout);
    }
    let list = read_json(&place.path().join("list.json"));
    assert_eq!(list["schema"], "mmsmith.list/1");
    assert!(list["rows"].as_array().unwrap().iter().any(|row| row["name"] == "ring"));
}

#[test]
fn check_passes_every_solution_of_the_library() {
    let place = tempfile::tempdir().unwrap();
    let called = mms(place.path(), "check --json check.json");
    assert_eq!(called.status, 0, "{}{}", called.stdout, called.stderr);
    let check = read_json(&place.path().join("check.json"));
    assert_eq!(check["schema"], "mmsmith.check/1");
    assert_eq!(check["passed"], true);
    let results = check["results"].as_array().unwrap();
    let specifications = concat!(env!("CARGO_MANIFEST_DIR"), "/../../mms-specs");
    let files = fs::read_dir(specifications).unwrap().flatten().map(|entry| entry.path());
    assert_eq!(results.len(), files.filter(|path| path.is_file()).count());
    assert_eq!(called.stdout.matches(": passed at").count(), results.len(), "{}", called.stdout);
    for result in results {
        let findings = result["findings"].as_array().unwrap();
        for field in ["v", "a", "H", "F", "J", "P", "b"] {
            let finding = findings.iter().find(|finding| finding["what"] == field).unwrap();
            assert_eq!(finding["verdict"], "passed");
            let own_error = finding["own_error"].as_f64().unwrap();
            assert!(own_error < 1e-9 * finding["scale"].as_f64().unwrap(), "{finding}");
        }
    }
}

#[test]
fn check_takes_names_and_parameters() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let called = mms(place, "check ring --set A=1e-6 --points 50");
    assert_eq!(called.status, 0, "{}{}", called.stdout, called.stderr);
    assert!(!called.stdout.contains("axis-aligned"));
    refuses(place, "check rings", &["did you mean 'ring'?"]);
    refuses(place, "check ring --points 0", &["--points", "from 1"]);
    refuses(place, "check none.toml", &["none.toml"]);
}

#[test]
fn thorough_check_states_the_worst_factor_of_each_field_in_each_class() {
    let place = tempfile::tempdir().unwrap();
    let called = mms(place.path(), "check --thorough torsion bar --points 3 --json thorough.json");
    assert_eq!(called.status, 0, "{}{}", called.stdout, called.stderr);
    let check = read_json(&place.path().join("thorough.json"));
    assert_eq!(check["schema"], "mmsmith.check/1");
    assert_eq!(check["passed"], true);
    let results = check["results"].as_array().unwrap();
    assert_eq!(results.len(), 2);
    for result in results {
        assert_eq!(result["code"], "generated");
        let rows = result["accuracy"].as_array().unwrap();
        let staged = ["b staged", "b lattice", "u staged", "v staged", "F staged", "P staged"];
        for field in ["u", "v", "a", "H", "F", "J", "P", "b"].into_iter().chain(staged) {
            let row = rows.iter().find(|row| row["field"] == field && row["class"] == "ordinary");
            assert!(row.unwrap()["K"].as_f64().unwrap() <= 8.0, "{field}");
        }
    }
}

#[test]
fn the_search_for_rounding_errors_goes_on_from_its_state() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let command = "check --thorough bar --points 3 --state kept --json out.json";
    let called = mms(place, command);
    assert_eq!(called.status, 0, "{}{}", called.stdout, called.stderr);
    assert!(called.stdout.contains("searched"), "{}", called.stdout);
    let worst: Vec<&str> =
        called.stdout.lines().skip_while(|line| *line != "The worst of all:").collect();
    // Four lines, each with every input, what is allowed, and the file.
    assert_eq!(worst.len(), 7, "{}", called.stdout);
    assert!(worst[1..5].iter().all(|line| line.contains("found by ") && line.contains(" rho0 = ")));
    let read = |name: &str| read_json(&place.join(name));
    let rows = read("out.json")["results"][0]["accuracy"].as_array().unwrap().clone();
    assert!(rows.iter().all(|row| row["drawn"] == 3 && row["searched"].as_u64().unwrap() > 300));
    assert!(rows.iter().all(|row| row["found"] == "draw" || row["found"] == "search"));
    assert!(rows.iter().any(|row| row["found"] == "search"));
    for row in &rows {
        let outside = row["outside"] == true;
        assert!(!outside || row["class"] == "far" || row["class"] == "near origin", "{row}");
    }
    // No digits far from the body, where the specification does not ask for them.
    assert!(rows.iter().all(|row| row["class"] != "far"));
    let first = read("kept/bar.json");
    assert_eq!(
        (&first["schema"], &first["search"]["rounds"]),
        (&"mmsmith.search/1".into(), &1.into())
    );
    let called = mms(place, command);
    assert_eq!(called.status, 0, "{}{}", called.stdout, called.stderr);
    assert_eq!(read("kept/bar.json")["search"]["rounds"], 2);

    // Of another text, and of something else altogether.
    let spec = include_str!("../../../../mms-specs/bar.toml");
    fs::create_dir(place.join("mms-specs")).unwrap();
    fs::write(place.join("mms-specs/bar.toml"), spec.replace("0.01", "0.02")).unwrap();
    refuses(place, command, &["kept", "bar.json", "another text", "remove the file"]);
    fs::remove_dir_all(place.join("mms-specs")).unwrap();
    fs::write(place.join("kept/bar.json"), "{}").unwrap();
    refuses(place, command, &["kept", "bar.json", "no state of a search", "remove the file"]);
    refuses(place, "check bar --seconds 20", &["--thorough"]);
    refuses(place, "check bar --state kept", &["--thorough"]);
    refuses(place, "check --thorough bar --seconds 0", &["--seconds"]);
}

/// A displacement written as a difference of numbers near one has no digits where it is small.
#[test]
fn thorough_check_fails_what_loses_digits() {
    let place = tempfile::tempdir().unwrap();
    let spec = include_str!("../../../../mms-specs/bar.toml");
    let from = spec.lines().find(|line| line.starts_with("X = ")).unwrap();
    // No parameter makes the difference vanish, so that nothing shows it to be small.
    let careless = "X = 'A*((1 + sin(Pi*X/L)/10^9)^3 - 1)*cos(Pi*t*sqrt(E/rho0)/L)'";
    fs::write(place.path().join("careless.toml"), spec.replace(from, careless)).unwrap();
    let called = mms(place.path(), "check --thorough careless.toml --points 20 --json out.json");
    assert_eq!(called.status, 1, "{}{}", called.stdout, called.stderr);
    assert!(called.stdout.contains("FAILED"), "{}", called.stdout);
    assert_eq!(read_json(&place.path().join("out.json"))["passed"], false);
}

#[test]
fn eval_gives_all_fields_at_each_point() {
    let place = tempfile::tempdir().unwrap();
    let points = r#"[ { "X": [0.25, 0.75], "t": 0.013 },
                      { "X": [0.5, 0], "t": 0, "par": { "A": 0.05, "nu": 0 } } ]"#;
    fs::write(place.path().join("in.json"), points).unwrap();
    let called = mms(place.path(), "eval axis-aligned --points in.json");
    assert_eq!(called.status, 0, "{}", called.stderr);
    let fields: serde_json::Value = serde_json::from_str(&called.stdout).unwrap();
    assert_eq!(keys(&fields), "fields rows schema settings");
    assert_eq!(fields["fields"], "generated");
    assert_eq!(fields["schema"], "mmsmith.eval/1");
    let rows = fields["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 2);
    assert_eq!(keys(&rows[0]), "F H J P a b u v");
    assert_eq!(rows[1]["u"][0], 0.05);
    assert_eq!(rows[0]["P"][1].as_array().unwrap().len(), 2);
    let written = mms(place.path(), "eval axis-aligned --points in.json --json out.json");
    assert_eq!((written.status, written.stdout.as_str()), (0, "wrote out.json\n"));
    assert_eq!(read_json(&place.path().join("out.json")), fields);
}

#[test]
fn eval_tells_of_points_outside_and_of_values_that_are_no_numbers() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let points = r#"[ { "X": [0.6, 0.3], "t": 0.01 }, { "X": [0.1, 0.1], "t": 0.01 }, { "X": [0, 1], "t": 0.01 } ]"#;
    let called = mms_with(place, "eval ring --points -", &[], points);
    assert_eq!(called.status, 0, "{}", called.stderr);
    assert!(called.stderr.contains("1 of 3 points lie outside the body"), "{}", called.stderr);
    let fields: serde_json::Value = serde_json::from_str(&called.stdout).unwrap();
    assert_eq!(fields["rows"][1]["outside"], true);
    assert_eq!(keys(&fields["rows"][2]), "F H J P a b u v");

    let points = r#"[ { "X": [0.6, 0.3], "t": 0.01 }, { "X": [0, 0], "t": 0.004 } ]"#;
    let called = mms_with(place, "eval ring --points -", &[], points);
    assert_eq!(called.status, 1, "{}", called.stderr);
    assert!(called.stderr.contains("entry 1: "), "{}", called.stderr);
    let fields: serde_json::Value = serde_json::from_str(&called.stdout).unwrap();
    assert!(!fields["rows"][1]["not_finite"].as_array().unwrap().is_empty());
}

#[test]
fn eval_writes_tables_and_arrays() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let points = r#"[ { "X": [0.6, 0.3], "t": 0.01 }, { "X": [0.5, 0.1], "t": 0.01 } ]"#;
    let called = mms_with(
        place,
        "eval ring --points - --csv out.csv --npy arrays --json out.json",
        &[],
        points,
    );
    let wrote = "wrote out.csv\nwrote arrays\nwrote out.json\n";
    assert_eq!((called.status, called.stdout.as_str()), (0, wrote), "{}", called.stderr);
    let rows = read_json(&place.join("out.json"))["rows"].clone();
    let table = fs::read_to_string(place.join("out.csv")).unwrap();
    let lines: Vec<_> = table.lines().collect();
    assert_eq!(lines.len(), 3);
    assert_eq!(
        lines[0],
        "X,Y,t,u1,u2,v1,v2,a1,a2,H11,H12,H21,H22,F11,F12,F21,F22,J,P11,P12,P21,P22,b1,b2"
    );
    let second: Vec<f64> = lines[2].split(',').map(|number| number.parse().unwrap()).collect();
    assert_eq!(rows[1]["P"][0][1], second[19]);
    let P = fs::read(place.join("arrays/P.npy")).unwrap();
    let numbers: Vec<f64> =
        P[128..].chunks(8).map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap())).collect();
    assert_eq!(numbers[4..], second[18..22]);
    assert!(place.join("arrays/J.npy").is_file());
}

#[test]
fn eval_reads_tables_as_it_writes_them() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    fs::write(place.join("in.csv"), "id, x, y, T\n7, 0.6, 0.3, 0.01\n8, 5e-1, 0.1, 0.02\n")
        .unwrap();
    assert_eq!(mms(place, "eval ring --points in.csv --csv one.csv").status, 0);
    assert_eq!(mms(place, "eval ring --points one.csv --csv two.csv").status, 0);
    let read = |name: &str| fs::read_to_string(place.join(name)).unwrap();
    assert!(read("one.csv").lines().nth(2).unwrap().starts_with("0.5,0.1,0.02,"));
    assert_eq!(read("one.csv"), read("two.csv"));
    // The same numbers as from JSON, and from standard input.
    let points = r#"[ { "X": [0.6, 0.3], "t": 0.01 }, { "X": [0.5, 0.1], "t": 0.02 } ]"#;
    let called = mms_with(place, "eval ring --points - --csv -", &[], points);
    assert_eq!(called.stdout, read("one.csv"), "{}", called.stderr);
    for (text, expected) in [
        ("X,t\n0.6,0\n", &["columns X,Y,t", "no column Y among X,t"][..]),
        ("X,Y\n0.6,0\n", &["no column t"]),
        ("X,Y,t\n0.6,0.3,0\n0.6,three,0\n", &["row 2", "'three' in column Y"]),
        ("X,Y,t\n0.6,0.3,nan\n", &["row 1", "no finite number"]),
        ("X,Y,t\n0.6,0.3\n", &["row 1"]),
    ] {
        fs::write(place.join("in.csv"), text).unwrap();
        refuses(place, "eval ring --points in.csv", &[&["in.csv"], expected].concat());
    }
}

#[test]
fn numbers_of_eval_survive_a_round_trip() {
    let place = tempfile::tempdir().unwrap();
    let point = r#"[ { "X": [0.8650037822783405, 0.3346566410149667], "t": 0.5176979721900696,
                       "par": { "E": 1, "nu": 0.49, "rho0": 1, "A": 0.14646623957057986 } } ]"#;
    fs::write(place.path().join("in.json"), point).unwrap();
    let called = mms(place.path(), "eval axis-aligned --points in.json");
    let fields: serde_json::Value = serde_json::from_str(&called.stdout).unwrap();
    // The first point of an independent high-precision computation.
    let b = fields["rows"][0]["b"][0].as_f64().unwrap();
    assert!((b / -3.891108510107518e-1 - 1.0).abs() < 1e-13, "{b:?}");
    assert_eq!(serde_json::from_str::<f64>(&b.to_string()).unwrap(), b);
}

#[test]
fn eval_names_the_entry_that_is_wrong() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let good = r#"{ "X": [0.6, 0.3], "t": 0.01 }"#;
    for (bad, expected) in [
        (r#"{ "X": [0.6], "t": 0.01 }"#, &["X has 1 coordinates", "2-dimensional"][..]),
        (r#"{ "X": [0.6, "a"], "t": 0.01 }"#, &["a coordinate in X", "\"a\"", "number"]),
        (r#"{ "X": 0.6, "t": 0.01 }"#, &["X is 0.6", "list of numbers"]),
        (r#"{ "t": 0.01 }"#, &["X is missing"]),
        (r#"{ "X": [0.6, 0.3] }"#, &["t is missing"]),
        (r#"{ "X": [0.6, 0.3], "t": null }"#, &["t is null", "number"]),
        (r#"{ "X": [0.6, 0.3], "t": 0, "par": { "B": 1 } }"#, &["no parameter 'B'", "rho0"]),
        (r#"{ "X": [0.6, 0.3], "t": 0, "par": { "A": "1" } }"#, &["parameter A", "number"]),
        (r#"{ "X": [0.6, 0.3], "t": 0, "par": { "E": -1 } }"#, &["E = -1", "must be"]),
        (r#"{ "X": [0.6, 0.3], "t": 0, "par": [] }"#, &["par is []", "object"]),
        (r#"{ "X": [0.6, 0.3], "t": 0, "pars": {} }"#, &["unknown key 'pars'"]),
        ("7", &["expected {"]),
    ] {
        fs::write(place.join("in.json"), format!("[ {good}, {bad} ]")).unwrap();
        let mut all = vec!["in.json", "entry 1"];
        all.extend(expected);
        refuses(place, "eval ring --points in.json --json out.json", &all);
    }
    fs::write(place.join("in.json"), "[ { \"X\": [0.6,, ] } ]").unwrap();
    refuses(place, "eval ring --points in.json", &["in.json is not valid JSON", "line 1"]);
    fs::write(place.join("in.json"), "{}").unwrap();
    refuses(place, "eval ring --points in.json", &["expected a list of points"]);
    refuses(place, "eval ring --points nowhere.json", &["nowhere.json"]);
}

/// A proof, its certificate, one altered by hand, and a field that no proof closes for.
#[test]
fn certificates_are_written_and_checked() {
    let place = tempfile::tempdir().unwrap();
    let box_of = "--range nu=0:0.45 --range A=-1:1";
    let called = mms(place.path(), &format!("certify shear-wave {box_of} --out wave.json"));
    assert_eq!(called.status, 0, "{}{}", called.stdout, called.stderr);
    assert!(called.stdout.contains("t E^0.5 rho0^-0.5 L^-1 in [0, "), "{}", called.stdout);
    assert!(called.stdout.contains("b[1]"), "{}", called.stdout);
    let called = mms(place.path(), "certify shear-wave --check wave.json");
    assert_eq!(called.status, 0, "{}{}", called.stdout, called.stderr);
    assert!(called.stdout.contains("holds on all"), "{}", called.stdout);
    let called = mms(place.path(), "certify bar --check wave.json");
    assert_eq!(called.status, 1, "{}{}", called.stdout, called.stderr);
    assert!(called.stdout.contains("is refused: it is about shear-wave"), "{}", called.stdout);
    let mut altered = read_json(&place.path().join("wave.json"));
    altered["fields"][0]["factor"] = 1.0.into();
    fs::write(place.path().join("altered.json"), altered.to_string()).unwrap();
    let called = mms(place.path(), "certify shear-wave --check altered.json");
    assert_eq!(called.status, 1, "{}{}", called.stdout, called.stderr);
    assert!(called.stdout.contains("is refused"), "{}", called.stdout);
    let called = mms(
        place.path(),
        &format!("certify shear-wave {box_of} --factor 2 --boxes 5 --out no.json"),
    );
    assert_eq!(called.status, 1, "{}{}", called.stdout, called.stderr);
    assert!(called.stdout.contains("u[0] is open: the bound of K is"), "{}", called.stdout);
    assert!(!place.path().join("no.json").exists());
    let called = mms(place.path(), "certify shear-wave --range B=0:1");
    assert_eq!(called.status, 2, "{}", called.stderr);
    assert!(called.stderr.contains("there is no input B"), "{}", called.stderr);
}
