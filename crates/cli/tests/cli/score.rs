//! `mms score` through the real binary: its own output to the bit, every variant of the formats, bad input, and what it
//! has to say. The files in `tests/data/score` were written by `tests/python/write_variants.py`, of a body with the density 1.

#![allow(clippy::unwrap_used)]

use crate::command::{keys, mms, read_json, refuses};
use serde_json::Value;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;

const FIELDS: [&str; 4] = ["u", "v", "F", "P"];
const NORMS: [&str; 3] = ["linf", "l2", "l1"];

fn data(kind: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/score").join(kind)
}

/// Entries of a folder of the data, which must not be empty.
fn entries(kind: &str) -> Vec<PathBuf> {
    let mut entries: Vec<_> =
        fs::read_dir(data(kind)).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    assert!(entries.len() > 5, "{kind}");
    entries
}

/// The arguments of a case and what must be said.
fn call(case: &Path) -> (String, Vec<String>) {
    let text = fs::read_to_string(case.join("call.txt")).unwrap();
    let mut lines = text.lines().map(str::to_owned);
    (lines.next().unwrap(), lines.collect())
}

fn score(place: &Path, arguments: &str) -> Value {
    let called = mms(place, &format!("score {arguments} --json score.json"));
    let score = read_json(&place.join("score.json"));
    let rows = score["rows"].as_array().unwrap();
    let has_problem = rows.iter().any(|row| row["status"] != "ok");
    let has_failed = score["passed"] == false;
    assert!(has_failed || !has_problem, "score {arguments}");
    assert_eq!(called.status, i32::from(has_failed), "score {arguments}: {}", called.stderr);
    score
}

#[test]
fn frames_of_every_step_have_the_errors_of_the_run_to_the_bit() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    for (index, call) in [
        "ring --cells 16 --periods 0.25",
        "ring --cells 8 --start data --precision f32 --extent full --periods 0.25",
        "ring --cells 8 --integrator usl --set A=0.02 --periods 0.25",
        "axis-aligned --cells 8 --start exact --periods 0.25",
        "axis-aligned-1d --cells 8 --integrator musl --periods 0.25",
        // Longer, so coarse a grid makes an error that another parameter may explain, which is looked for.
        "axis-aligned-3d --cells 4 --periods 0.1",
    ]
    .iter()
    .enumerate()
    {
        // More frames than there are steps means all of them.
        let run = format!("run {call} --vtk frames{index} --frames 1000000 --json run.json");
        let called = mms(place, &run);
        assert_eq!(called.status, 0, "{run}: {}", called.stderr);
        let run = read_json(&place.join("run.json"));
        let name = call.split_whitespace().next().unwrap();
        let set = if call.contains("--set") { "--set A=0.02" } else { "" };
        let scored = score(place, &format!("{name} frames{index} {set}"));
        let row = &scored["rows"][0];
        for field in FIELDS {
            for norm in NORMS {
                // Both are printed in the shortest form that reads back to the same bits.
                let (found, expected) =
                    (&row["errors"][field][norm], &run["result"]["errors"][field][norm]);
                assert!(expected.as_f64().unwrap() > 0.0, "{call}");
                assert_eq!(found, expected, "{call}: {norm} of {field}");
            }
        }
        assert_eq!(row["status"], "ok");
        assert_eq!(row["frames"], run["result"]["steps"].as_u64().unwrap() + 1);
        assert_eq!(row["particles"], run["result"]["particles"]);
    }
}

#[test]
fn several_recordings_have_the_orders_of_converge() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    for cells in [8, 16] {
        let run = format!("run axis-aligned --cells {cells} --vtk of{cells} --frames 1000000");
        assert_eq!(mms(place, &run).status, 0);
    }
    assert_eq!(mms(place, "converge axis-aligned --cells 8,16 --json study.json").status, 0);
    let study = read_json(&place.join("study.json"));
    let scored = score(place, "axis-aligned of8 of16 --cells 8,16");
    for field in FIELDS {
        assert_eq!(scored["orders"][field], study["orders"][field]);
    }
    assert_eq!(
        keys(&scored),
        "across_orders blind_spots findings orders passed rows schema settings verdict"
    );
    assert_eq!(scored["schema"], "mmsmith.score/1");
    for (row, expected) in
        scored["rows"].as_array().unwrap().iter().zip(study["rows"].as_array().unwrap())
    {
        assert_eq!(row["h"], expected["h"]);
        for field in FIELDS {
            assert_eq!(row["errors"][field], expected["errors"][field]);
        }
        // Particle files of mms hold Cauchy stress as well.
        assert_eq!(keys(&row["errors"]), "F P cauchy u v");
        assert_eq!(
            keys(row),
            "across cells displacements errors exact_displacement fields file first_time frames h last_time \
             law particles reference_positions status"
        );
    }
    // Only the ratio of h matters: an estimate from the particles gives nearly the same, and says so.
    let estimated = score(place, "axis-aligned of8 of16");
    let fit = |scored: &Value| scored["orders"]["u"]["linf"]["fit"].as_f64().unwrap();
    assert!((fit(&estimated) - fit(&scored)).abs() < 0.25);
    let findings = estimated["findings"].as_array().unwrap().iter();
    let agrees = |finding: &&Value| finding["kind"] == "law-agrees";
    assert_eq!(findings.clone().filter(agrees).count(), 2);
    assert_eq!(findings.count(), 6);
    assert!(estimated.to_string().contains("estimated-h"));
    let told = score(place, "axis-aligned of8 of16 --h 0.125,0.0625");
    assert_eq!(told["orders"], scored["orders"]);
}

#[test]
fn every_variant_of_the_formats_is_read() {
    let place = tempfile::tempdir().unwrap();
    for path in entries("ok") {
        let scored = score(place.path(), &format!("ring --set rho0=1 {}", path.display()));
        let row = &scored["rows"][0];
        assert_eq!(row["status"], "ok", "{}", path.display());
        assert_eq!(row["fields"].as_array().unwrap().len(), 4, "{}", path.display());
        assert_eq!((&row["particles"], &row["frames"]), (&6.into(), &2.into()));
        for (field, expected) in FIELDS.iter().zip([1e-3, 1e-2, 1e-4, 1.0]) {
            for norm in NORMS {
                let found = row["errors"][field][norm].as_f64().unwrap();
                // VTK's legacy text has eleven digits, and meshio's twelve: 5e-11 of an F of 1 are 5e-7 of its error.
                let is_text = path.to_string_lossy().contains("-ascii");
                let allowed = if is_text { 1e-6 } else { 1e-11 };
                let ratio = found / expected;
                assert!(
                    (ratio - 1.0).abs() < allowed,
                    "{}: {norm} of {field} {found:e}",
                    path.display()
                );
            }
        }
    }
}

#[test]
fn a_binary_variant_is_read_to_the_bit() {
    let place = tempfile::tempdir().unwrap();
    let errors = |name: &str| {
        let path = data("ok").join(name);
        score(place.path(), &format!("ring --set rho0=1 {}", path.display()))["rows"][0]["errors"]
            .clone()
    };
    let expected = errors("vtk-appended-raw-64");
    for path in entries("ok") {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        // Text has the digits that its writer gave it.
        if !name.contains("ascii") {
            assert_eq!(errors(&name), expected, "{name}");
        }
    }
}

#[test]
fn bad_input_ends_with_status_two_and_says_what_is_wrong() {
    let mut cases = 0;
    for case in entries("err") {
        let (arguments, expected) = call(&case);
        let expected: Vec<_> = expected.iter().map(String::as_str).collect();
        assert!(!expected.is_empty(), "{}", case.display());
        refuses(&case, &format!("score ring --set rho0=1 {arguments}"), &expected);
        cases += 1;
    }
    assert!(cases > 40);
}

#[test]
fn what_has_to_be_known_is_told_with_counts() {
    for case in entries("findings") {
        let (arguments, expected) = call(&case);
        let called = mms(&case, &format!("score ring --set rho0=1 {arguments}"));
        for part in &expected {
            assert!(called.stdout.contains(part), "{}: {part}\n{}", case.display(), called.stdout);
        }
        // A problem that is printed is a problem that is returned.
        let has_problem = called.stdout.contains("PROBLEM");
        let status = i32::from(has_problem);
        assert_eq!(called.status, status, "{}: {}", case.display(), called.stderr);
        assert_ne!(has_problem, called.stdout.contains("status: ok"), "{}", called.stdout);
    }
}

#[test]
fn findings_are_in_the_json_and_a_row_with_a_problem_has_no_part_in_orders() {
    let place = tempfile::tempdir().unwrap();
    let bad = data("findings").join("not-a-number");
    let good = data("ok").join("vtk-base64-64");
    let (bad, good) = (bad.display(), good.display());
    let scored =
        score(place.path(), &format!("ring --set rho0=1 {good} {bad} {good} --h 0.4,0.2,0.1"));
    let findings = scored["findings"].as_array().unwrap();
    let finding = findings.iter().find(|finding| finding["kind"] == "not-finite").unwrap();
    assert_eq!(keys(finding), "count file frames kind message problem row");
    assert_eq!(finding["count"], 2);
    assert_eq!((&finding["row"], &finding["problem"]), (&1.into(), &true.into()));
    let status = scored["rows"][1]["status"].as_str().unwrap();
    assert!(status.contains("2 particle(s)"), "{status}");
    // The number says nothing where a number is none; it is not taken over the rest in silence.
    assert!(scored["rows"][1]["errors"]["u"]["linf"].is_null());
    let orders = &scored["orders"]["u"]["l2"];
    assert_eq!(orders["local"], serde_json::json!([null, null]));
    assert_eq!(orders["fit"].as_f64().map(f64::abs), Some(0.0));
}

#[test]
fn a_specification_file_and_transposed_tensors() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let spec = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../mms-specs/skew-2d.toml");
    let points = r#"[{ "X": [0.3, 0.4], "t": 0.1 }]"#;
    fs::write(place.join("points.json"), points).unwrap();
    assert_eq!(mms(place, "eval skew-2d --points points.json --json exact.json").status, 0);
    let exact = &read_json(&place.join("exact.json"))["rows"][0];
    let number = |value: &Value| value.as_f64().unwrap();
    let (u, F) = (&exact["u"], &exact["F"]);
    let mut text = "t,X,Y,ux,uy,F11,F12,F21,F22\n0.1,0.3,0.4".to_owned();
    // The transpose: F12 and F21 change places.
    for value in [&u[0], &u[1], &F[0][0], &F[1][0], &F[0][1], &F[1][1]] {
        text += &format!(",{:?}", number(value));
    }
    fs::write(place.join("turned.csv"), text).unwrap();
    let scored = score(place, &format!("{} turned.csv --periods 1000", spec.display()));
    assert_eq!(scored["settings"]["solution"], "skew-2d");
    let row = &scored["rows"][0];
    assert!(number(&row["errors"]["u"]["linf"]) < 1e-14, "{row}");
    let skewness = (number(&F[0][1]) - number(&F[1][0])).abs() * 2.0_f64.sqrt();
    assert!((number(&row["errors"]["F"]["linf"]) - skewness).abs() < 1e-12, "{row}");
    assert!(scored["findings"].to_string().contains("transpose of F"), "{}", scored["findings"]);
    assert_eq!(row["fields"], serde_json::json!(["u", "F"]));
    assert!(row["errors"]["P"]["l2"].is_null());
}

#[test]
fn other_stresses_j_and_density_are_compared_with_what_f_and_p_say() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    fs::write(place.join("points.json"), r#"[{ "X": [0.3, 0.4], "t": 0.1 }]"#).unwrap();
    assert_eq!(mms(place, "eval skew-2d --points points.json --json exact.json").status, 0);
    let exact = &read_json(&place.join("exact.json"))["rows"][0];
    let matrix = |name: &str| {
        let at = |i: usize, j: usize| exact[name][i][j].as_f64().unwrap();
        [[at(0, 0), at(0, 1)], [at(1, 0), at(1, 1)]]
    };
    let (u, F, P) = (&exact["u"], matrix("F"), matrix("P"));
    const DENSITY: f64 = 4.0;
    let J = F[0][0] * F[1][1] - F[0][1] * F[1][0];
    let tau = |i: usize, j: usize| P[i][0] * F[j][0] + P[i][1] * F[j][1];
    // Kirchhoff stress by its three different components, Cauchy stress row by row.
    let head = "t,X,Y,ux,uy,J,rho,tau:0,tau:1,tau:2,cauchy_xx,cauchy_xy,cauchy_yx,cauchy_yy";
    let line = |off: f64| {
        let values = [
            J + off,
            DENSITY / J - off,
            tau(0, 0) + off,
            tau(1, 1),
            tau(0, 1),
            tau(0, 0) / J,
            tau(0, 1) / J,
            tau(1, 0) / J,
            tau(1, 1) / J + off,
        ];
        let values: String = values.iter().map(|value| format!(",{value:?}")).collect();
        format!("{head}\n0.1,0.3,0.4,{},{}{values}\n", u[0], u[1])
    };
    for off in [0.0, 0.25] {
        fs::write(place.join("others.csv"), line(off)).unwrap();
        let scored = score(place, "skew-2d others.csv --periods 1000");
        let row = &scored["rows"][0];
        assert_eq!(row["fields"], serde_json::json!(["u", "cauchy", "kirchhoff", "J", "density"]));
        for field in ["cauchy", "kirchhoff", "J", "density"] {
            let error = row["errors"][field]["linf"].as_f64().unwrap();
            assert!((error - off).abs() < 1e-9, "{field}: {error}");
        }
    }
    let text = line(0.0).replace(&format!(",{:?},", DENSITY / J), ",4,");
    fs::write(place.join("others.csv"), text).unwrap();
    let called = mms(place, "score skew-2d others.csv --periods 1000");
    assert!(called.stdout.contains("density is that of the undeformed body"), "{}", called.stdout);
    let text = line(0.0).replace("tau:2", "other");
    fs::write(place.join("others.csv"), text).unwrap();
    let called = mms(place, "score skew-2d others.csv --periods 1000");
    assert!(called.stdout.contains("kirchhoff, which has 3, 4, 6 or 9"), "{}", called.stdout);
}

#[test]
fn one_frame_for_a_whole_run_and_another_amplitude_are_told() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    for frames in [2, 3] {
        let run =
            format!("run axis-aligned --cells 8 --set A=0.05 --vtk f{frames} --frames {frames}");
        assert_eq!(mms(place, &run).status, 0);
        let called = mms(place, &format!("score axis-aligned f{frames} --cells 8 --set A=0.05"));
        assert_eq!(called.stdout.contains("one frame after t = 0"), frames == 2, "{frames}");
        assert!(!called.stdout.contains("explains the error"), "{}", called.stdout);
    }
    let called = mms(place, "score axis-aligned f3 --cells 8");
    // On so coarse a grid the nearest amplitude is not that of the run to more than a digit.
    for part in ["another value of a parameter explains the error", "--set A=0.05"] {
        assert!(called.stdout.contains(part), "{part}: {}", called.stdout);
    }
    // The files tell it themselves.
    for (call, told) in [
        ("axis-aligned f3 --cells 8", Some("its own are --set A=0.05")),
        ("axis-aligned f3 --cells 8 --set A=0.05", None),
        ("skew-2d f3 --cells 8", Some("it is of axis-aligned, and is compared with skew-2d")),
    ] {
        let called = mms(place, &format!("score {call}"));
        match told {
            Some(told) => assert!(called.stdout.contains(told), "{call}: {}", called.stdout),
            None => assert!(!called.stdout.contains("the file tells"), "{call}: {}", called.stdout),
        }
    }
    // No value of a parameter explains these displacements.
    let text =
        "t,X,Y,ux,uy\n0.004,0.2,0.3,0.1,-0.2\n0.004,0.7,0.6,-0.3,0.1\n0.004,0.4,0.9,0.2,0.2\n";
    fs::write(place.join("other.csv"), text).unwrap();
    let called = mms(place, "score axis-aligned other.csv");
    assert!(called.stdout.contains("one frame after t = 0"), "{}", called.stdout);
    assert!(!called.stdout.contains("explains the error"), "{}", called.stdout);
}

#[test]
fn recordings_compared_with_each_other_have_the_orders_in_time_of_converge() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let base = "axis-aligned-1d --cells 8 --integrator usl";
    for cfl in ["0.4", "0.2", "0.1"] {
        // At the start and the five times at which converge compares.
        let run = format!("run {base} --cfl {cfl} --vtk of{cfl} --frames 6");
        assert_eq!(mms(place, &run).status, 0);
    }
    assert_eq!(mms(place, &format!("converge {base} --cfls 0.4,0.2 --json study.json")).status, 0);
    let study = read_json(&place.join("study.json"))["temporal"].clone();
    let compared = "score axis-aligned-1d of0.4 of0.2 of0.1 --differences";
    let called = mms(place, &format!("{compared} 4e-4,2e-4,1e-4 --json score.json"));
    assert_eq!(called.status, 0, "{}", called.stderr);
    let scored = read_json(&place.join("score.json"));
    assert_eq!(scored["differences"].as_array().unwrap().len(), 2);
    for (row, expected) in [0, 1].map(|n| (&scored["differences"][n], &study["rows"][n])) {
        for (field, norm) in FIELDS.iter().flat_map(|field| NORMS.map(|norm| (field, norm))) {
            let number = |value: &Value| value[field][norm].as_f64().unwrap();
            let ratio = number(&row["differences"]) / number(&expected["differences"]);
            assert!((ratio - 1.0).abs() < 1e-9, "{field} {norm}: {ratio}");
        }
    }
    let order = |scored: &Value| scored["orders"]["u"]["l2"]["local"][0].as_f64().unwrap();
    assert!((order(&scored) - order(&study)).abs() < 1e-9);
    // Neither the other order of files nor a file twice has an order in time.
    for (files, said) in [
        ("of0.1 of0.2 of0.4", "stand in another order than the steps"),
        ("of0.4 of0.4 of0.2", "equal to the last bit"),
    ] {
        let called = mms(place, &format!("score axis-aligned-1d {files} --differences 4,2,1"));
        assert_eq!(called.status, 1, "{files}: {}", called.stdout);
        let is_told = called.stdout.contains("PROBLEM") && called.stdout.contains(said);
        assert!(is_told, "{files}: {}", called.stdout);
    }
    refuses(place, &format!("{compared} 4,2,1.5"), &["another ratio than 2.0"]);
    refuses(place, &format!("{compared} 4,2"), &["2 time step(s) for 3 recording(s)"]);
    refuses(place, "score axis-aligned-1d of0.4 f --differences 2,1", &["f"]);
}

#[test]
fn a_run_beside_a_recording_of_its_own_scheme_has_its_errors_to_the_last_digit() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let run = "run axis-aligned --shape linear --integrator usl --cells 8 --set A=0.001 --vtk own --frames 11";
    assert_eq!(mms(place, run).status, 0);
    let call = "axis-aligned own --cells 8 --set A=0.001 --against";
    let scored = score(place, &format!("{call} mms:linear,usl"));
    assert_eq!(scored["settings"]["against"]["integrator"], "usl");
    let digits = |scored: &Value, field: &str, norm: &str| {
        scored["against"][0]["digits"][field][norm].as_f64().unwrap()
    };
    for (field, norm) in FIELDS.iter().flat_map(|field| NORMS.map(|norm| (field, norm))) {
        assert_eq!(digits(&scored, field, norm), 16.0, "{field} {norm}");
    }
    let scored = score(place, &format!("{call} mms:linear,usf"));
    assert!(digits(&scored, "u", "l2") < 1.0, "{}", scored["against"]);
    refuses(
        place,
        &format!("score {call} mms:linear,usl --cfl 0.3"),
        &["own", "--cfl 0.3 should be the one"],
    );
    refuses(place, &format!("score {call} mms:linear"), &["such as mms:linear,usl"]);
    refuses(place, "score axis-aligned own --against mms:linear,usl", &["--cells"]);
}

#[test]
fn errors_too_large_for_a_double_and_displacements_apart_from_points_are_told() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let line =
        |v: &str, x: &str| format!("t,X,Y,x,y,ux,uy,vx,vy\n0,0.6,0.3,{x},0.3,0.05,0,{v},0\n");
    fs::write(place.join("fast.csv"), line("1e200", "0.65")).unwrap();
    let called = mms(place, "score ring fast.csv");
    assert_eq!(called.status, 1, "{}{}", called.stdout, called.stderr);
    assert!(called.stdout.contains("the errors of v are too large"), "{}", called.stdout);
    for (x, told) in [("0.65", false), ("0.6", false), ("0.7", true)] {
        fs::write(place.join("apart.csv"), line("0", x)).unwrap();
        let called = mms(place, "score ring apart.csv");
        let words = "displacement is not the difference";
        assert_eq!(called.stdout.contains(words), told, "{x}: {}", called.stdout);
        assert_eq!(called.status, 0, "{}", called.stderr);
    }
}

#[test]
fn arrays_that_are_not_taken_and_text_of_few_digits_are_told() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let rows = "0.6123;0.3123;0.05123;0.01234;1.5;0.5\n".repeat(8);
    fs::write(
        place.join("short.csv"),
        format!("X;Y;ux;uy;speed_x;speed_y\n{}", rows.replace('.', ",")),
    )
    .unwrap();
    let called = mms(place, "score ring short.csv --time 0");
    assert_eq!(called.status, 0, "{}{}", called.stdout, called.stderr);
    for words in ["text of 4 digits", "not taken: speed; --map velocity=speed"] {
        assert!(called.stdout.contains(words), "{words}: {}", called.stdout);
    }
}

#[test]
fn an_element_with_a_hundred_thousand_attributes_is_refused() {
    let place = tempfile::tempdir().unwrap();
    let attributes: String = (0..100_000).map(|n| format!(" a{n}='1'")).collect();
    let text = format!(
        "<VTKFile type='UnstructuredGrid'><UnstructuredGrid><Piece{attributes}/></UnstructuredGrid></VTKFile>"
    );
    fs::write(place.path().join("many.vtu"), text).unwrap();
    refuses(place.path(), "score ring many.vtu", &["many.vtu", "more than 1000 attributes"]);
}

#[test]
fn files_of_one_folder_are_one_recording_unless_each_is_told_to_be_one() {
    let place = tempfile::tempdir().unwrap();
    let folder = data("ok").join("vtk-base64-64");
    let (first, second) = (folder.join("a_0.vtu"), folder.join("a_1.vtu"));
    let (first, second) = (first.display(), second.display());
    let rows = |options: &str| {
        let scored = score(place.path(), &format!("ring --set rho0=1 {options}"));
        scored["rows"].as_array().unwrap().clone()
    };
    let series = rows(&format!("{first} {second}"));
    assert_eq!((series.len(), &series[0]["frames"]), (1, &2.into()));
    for options in ["--each", "--cells 8,16", "--h 0.2,0.1"] {
        let apart = rows(&format!("{first} {second} {options}"));
        assert_eq!(apart.len(), 2, "{options}");
        assert_eq!(apart[1]["errors"]["F"], series[0]["errors"]["F"]);
    }
    // The order of frames is that of their times.
    let turned = rows(&format!("{second} {first}"));
    assert_eq!(turned[0]["errors"], series[0]["errors"]);
    assert_eq!(turned[0]["first_time"], 0.0);
    let other = data("ok").join("vtk-ascii/a_1.vtu");
    let mixed = rows(&format!("{first} {second} {} {}", other.display(), folder.display()));
    let frames: Vec<_> = mixed.iter().map(|row| row["frames"].as_u64().unwrap()).collect();
    assert_eq!(frames, [2, 1, 2]);
}

#[test]
fn velocities_that_lag_are_compared_at_their_own_time() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    assert_eq!(mms(place, "run ring --cells 8 --vtk f --frames 3").status, 0);
    fs::write(
        place.join("points.json"),
        r#"[{ "X": [0.6, 0.3], "t": 0.004 }, { "X": [0.6, 0.3], "t": 0.003 }]"#,
    )
    .unwrap();
    assert_eq!(mms(place, "eval ring --points points.json --json exact.json").status, 0);
    let exact = read_json(&place.join("exact.json"));
    let (u, v) = (&exact["rows"][0]["u"], &exact["rows"][1]["v"]);
    let text = format!("t,X,Y,ux,uy,vx,vy\n0.004,0.6,0.3,{},{},{},{}\n", u[0], u[1], v[0], v[1]);
    fs::write(place.join("lagging.csv"), text).unwrap();
    let error = |options: &str| {
        let scored = score(place, &format!("ring lagging.csv {options}"));
        scored["rows"][0]["errors"]["v"]["linf"].as_f64().unwrap()
    };
    assert!(error("") > 1.0);
    assert!(error("--velocity-lag 0.001") < 1e-12);
}

/// Bytes of address space: less than any of the files below would take.
const MEMORY_KIB: u64 = 1_500_000;

#[test]
#[cfg(target_os = "linux")]
fn files_of_two_gigabytes_are_refused_in_bounded_memory() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    fs::create_dir(place.join("empty")).unwrap();
    refuses(place, "score ring empty", &["empty", "no frame"]);
    for kind in ["vtu", "vtp", "vtk", "csv", "pvd"] {
        let name = format!("large.{kind}");
        // Sparse: they take no room on the disk.
        for (bytes, head, expected) in [
            (2_u64 << 30, "", "at most"),
            (1 << 29, "", "large."),
            (1 << 29, "<?xml version=\"1.0\"?><VTKFile type=\"UnstructuredGrid\">", "large."),
            (1 << 29, "# vtk DataFile Version 4.2\ntitle\nASCII\n", "large."),
        ] {
            fs::write(place.join(&name), head).unwrap();
            File::options().write(true).open(place.join(&name)).unwrap().set_len(bytes).unwrap();
            let mms = env!("CARGO_BIN_EXE_mms");
            let limited = format!(
                "ulimit -v {MEMORY_KIB}; exec {mms} score ring {name} --time 0 --threads 1"
            );
            let output =
                Command::new("sh").args(["-c", &limited]).current_dir(place).output().unwrap();
            let stderr = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(2), "{name} with {bytes} bytes: {stderr}");
            assert!(stderr.contains(expected) && stderr.contains("large."), "{stderr}");
            fs::remove_file(place.join(&name)).unwrap();
        }
    }
}

#[test]
fn times_of_a_static_solution_have_no_bounds() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let specification =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../spec/tests/data/ok/static-bend.toml");
    let specification = specification.display();
    for t in ["0", "1", "250"] {
        fs::write(place.join("p.csv"), format!("X,Y,t\n0.3,0.2,{t}\n0.6,0.4,{t}\n")).unwrap();
        let called = mms(place, &format!("eval {specification} --points p.csv --csv e.csv"));
        assert_eq!(called.status, 0, "{}", called.stderr);
        let called = mms(place, &format!("score {specification} e.csv --cells 4"));
        assert!(called.stdout.contains("status: ok"), "{t}: {}{}", called.stdout, called.stderr);
    }
}

/// Recordings that end at other times, or whose points contradict what is told of their spacings, have no order.
#[test]
fn recordings_that_are_not_alike_are_not_judged() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    for (folder, call) in
        [("coarse", "--cells 8"), ("fine", "--cells 16"), ("short", "--cells 16 --periods 0.25")]
    {
        let called = mms(place, &format!("run axis-aligned --frames 5 --vtk {folder} {call}"));
        assert_eq!(called.status, 0, "{}", called.stderr);
    }
    assert_eq!(score(place, "axis-aligned coarse fine --cells 8,16")["passed"], true);
    for (call, why) in [
        ("coarse short --cells 8,16", "ends at t ="),
        ("coarse fine --cells 8,10", "points, and what is told of their spacings"),
        ("coarse fine --cells 16,8", "points, and what is told of their spacings"),
    ] {
        let found = score(place, &format!("axis-aligned {call} --expect u.l2=2"));
        assert_ne!(found["passed"], true, "{call}");
        let message = found["verdict"]["message"].as_str().unwrap();
        assert!(message.contains("cannot tell") && message.contains(why), "{call}: {message}");
    }
}
