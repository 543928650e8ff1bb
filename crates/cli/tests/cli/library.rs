//! Where solutions are found: by path, by name in folders, and among those that were compiled in.

use std::fs;
use std::path::Path;

use crate::command::{mms, mms_with, read_json, refuses};
use serde_json::Value;

const RUN: &str = "--cells 4 --periods 0.25 --threads 1";
/// Message on a changed file.
const DIFFERS: &str = "differs from the built-in axis-aligned-1d: its fields are interpreted";

/// The text of a specification of the library.
fn library(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../mms-specs/{name}.toml"));
    fs::read_to_string(path).expect("a specification")
}

/// A folder with the specification `name` under another name, in `mms-specs`.
fn place_with(name: &str, text: &str) -> tempfile::TempDir {
    let place = tempfile::tempdir().expect("a folder");
    fs::create_dir(place.path().join("mms-specs")).expect("a folder");
    put(place.path(), name, text);
    place
}

fn put(place: &Path, name: &str, text: &str) {
    fs::write(place.join("mms-specs").join(format!("{name}.toml")), text).expect("written");
}

/// The specification of a solution that was not compiled in.
fn of_ones_own() -> String {
    library("axis-aligned-1d").replacen("'axis-aligned-1d'", "'of-ones-own'", 1)
}

#[test]
fn a_file_in_the_folder_is_usable_by_name_at_once() {
    let place = place_with("of-ones-own", &of_ones_own());
    let deep = place.path().join("a/b");
    fs::create_dir_all(&deep).expect("folders");
    for folder in [place.path(), &deep] {
        let called = mms(folder, &format!("run of-ones-own {RUN} --json -"));
        assert_eq!((called.status, called.stderr.as_str()), (0, ""));
        let document: Value = serde_json::from_str(&called.stdout).expect("JSON");
        assert_eq!(document["settings"]["solution"], "of-ones-own");
    }
    let called = mms(&deep, "check of-ones-own --points 20");
    assert_eq!(called.status, 0, "{}{}", called.stdout, called.stderr);
    let called = mms(&deep, "list");
    assert!(called.stdout.contains("of-ones-own: ../../mms-specs/of-ones-own.toml\n"));
    let called = mms(&deep, "list --long");
    assert!(called.stdout.contains("of-ones-own (1D, cartesian)"), "{}", called.stdout);
    assert!(called.stdout.contains("../../mms-specs/of-ones-own.toml"), "{}", called.stdout);
    // The nearest folder wins.
    fs::create_dir(deep.join("mms-specs")).expect("a folder");
    let nearer = of_ones_own().replacen("title = '", "title = 'Nearer: ", 1);
    put(&deep, "of-ones-own", &nearer);
    assert!(mms(&deep, "list --long").stdout.contains("cartesian): Nearer: "));
}

#[test]
fn a_changed_file_is_used_in_place_of_the_built_in_solution_and_the_user_told() {
    let original = library("axis-aligned-1d");
    let place = place_with("axis-aligned-1d", &original);
    let run = format!("run axis-aligned-1d {RUN} --json r.json");
    // The very text that the code was generated from, whatever its lines end with.
    for text in [original.clone(), original.replace('\n', "\r\n")] {
        put(place.path(), "axis-aligned-1d", &text);
        let called = mms(place.path(), &format!("{run} --verbose"));
        assert_eq!(called.status, 0, "{}", called.stderr);
        assert!(
            called.stderr.contains("axis-aligned-1d: built in, generated"),
            "{}",
            called.stderr
        );
        assert!(!called.stderr.contains(DIFFERS), "{}", called.stderr);
    }
    let before = read_json(&place.path().join("r.json"));
    put(place.path(), "axis-aligned-1d", &original.replacen("default = 0.1", "default = 0.05", 1));
    let called = mms(place.path(), &run);
    assert_eq!(called.status, 0, "{}", called.stderr);
    assert_eq!(called.stderr.matches(DIFFERS).count(), 1, "{}", called.stderr);
    assert!(called.stderr.contains("mms-specs/axis-aligned-1d.toml"), "{}", called.stderr);
    let after = read_json(&place.path().join("r.json"));
    assert_ne!(before["result"]["errors"], after["result"]["errors"]);
    let called = mms(place.path(), "--quiet list --json -");
    assert_eq!(called.stderr, "");
    let document: Value = serde_json::from_str(&called.stdout).expect("JSON");
    let sources: Vec<_> = document["rows"].as_array().expect("rows").iter().collect();
    let changed = sources.iter().find(|row| row["name"] == "axis-aligned-1d").expect("listed");
    assert_eq!(changed["source"], "file-differs-from-built-in");
    assert!(sources.iter().any(|row| row["name"] == "ring" && row["source"] == "built-in"));
}

#[test]
fn a_variable_names_folders_and_those_here_come_first() {
    let elsewhere = place_with("of-ones-own", &of_ones_own());
    let folder = elsewhere.path().join("mms-specs");
    let variable = [("MMSMITH_SPECS", folder.to_str().expect("Unicode"))];
    let place = tempfile::tempdir().expect("a folder");
    let run = format!("run of-ones-own {RUN}");
    let called = mms_with(place.path(), &run, &variable, "");
    assert_eq!(called.status, 0, "{}", called.stderr);
    fs::create_dir(place.path().join("mms-specs")).expect("a folder");
    put(place.path(), "of-ones-own", "name = ");
    let called = mms_with(place.path(), &run, &variable, "");
    assert_eq!(called.status, 2, "{}", called.stdout);
    assert!(called.stderr.contains("mms-specs/of-ones-own.toml:1"), "{}", called.stderr);
    // A path wins over all of them, with a separator or an extension.
    fs::write(place.path().join("of-ones-own.toml"), of_ones_own()).expect("written");
    for path in ["of-ones-own.toml", "./of-ones-own.toml"] {
        let called = mms_with(place.path(), &format!("run {path} {RUN}"), &variable, "");
        assert_eq!(called.status, 0, "{}", called.stderr);
    }
}

#[test]
fn a_name_that_leads_nowhere_is_met_with_all_there_are() {
    let place = place_with("of-ones-own", &of_ones_own());
    refuses(
        place.path(),
        "run rong",
        &[
            "there is no solution 'rong'; did you mean 'ring'?",
            "of-ones-own",
            "rong.toml was looked for in mms-specs",
        ],
    );
    fs::write(place.path().join("mine.toml"), of_ones_own()).expect("written");
    refuses(place.path(), "run mine", &["mine.toml is a file in this folder: write mine.toml"]);
    refuses(place.path(), "run no/file", &["cannot read no/file"]);
}

#[test]
fn a_file_runs_in_single_precision_as_generated_code_does() {
    for (name, run) in [("axis-aligned-1d", "--cells 8"), ("ring", "--cells 8 --grid cartesian")] {
        let place = place_with("axis-aligned-1d", &library("axis-aligned-1d"));
        fs::write(place.path().join("copy.toml"), library(name)).expect("written");
        let error = |name: &str, precision: &str| {
            let arguments = format!(
                "run {name} {run} --periods 0.25 --threads 1 --precision {precision} --json -"
            );
            let called = mms(place.path(), &arguments);
            assert_eq!(called.status, 0, "mms {arguments}: {}", called.stderr);
            let document: Value = serde_json::from_str(&called.stdout).expect("JSON");
            assert_eq!(document["settings"]["precision"], precision);
            document["result"]["errors"]["u"]["l2"].as_f64().expect("a number")
        };
        let [generated, interpreted] = ["copy.toml", name].map(|name| error(name, "f32"));
        let exact = error(name, "f64");
        assert!((interpreted / generated - 1.0).abs() < 1e-3, "{interpreted} and {generated}");
        assert!((interpreted / exact - 1.0).abs() < 1e-2, "{interpreted} and {exact}");
        assert_ne!(interpreted, exact, "single precision leaves traces");
    }
}
