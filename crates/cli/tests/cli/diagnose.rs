//! `mms diagnose` as a user meets it: a solver in C, with mistakes that a script plants.

#![allow(clippy::unwrap_used)]

use crate::command::{mms, read_json, refuses};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

/// Writes the script that builds and runs the solver with a change of its text, a command of sed.
fn script(place: &Path, solver: &str, change: &str) {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/c").join(solver);
    let text = format!(
        "set -e\ncd \"$MMS_FIELDS\"\nmkdir -p mmsmith\ncp *.h mmsmith\nsed '{change}' {} > own.c\n\
         ${{CC:-cc}} -O1 -I . own.c -o own -lm\n./own \"$MMS_CELLS\" *.table > \"$MMS_OUT/bar.csv\"\n",
        source.display()
    );
    let path = place.join("run.sh");
    fs::write(&path, text).unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
}

fn diagnosed(place: &Path, solution: &str, solver: &str, change: &str) -> (i32, String) {
    script(place, solver, change);
    let line = format!("diagnose {solution} --target c --jobs 2 --json found.json --run");
    // Without arguments: the command is one word, and the environment has the places.
    let called = mms(place, &format!("{line} {}/run.sh", place.display()));
    (called.status, called.stdout + &called.stderr)
}

/// The right solver, and then one with each of the changes, which has to be named.
fn names_mistakes(solution: &str, solver: &str, mistakes: &[(&str, &str)]) {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let (status, said) = diagnosed(place, solution, solver, "");
    assert_eq!(status, 0, "{said}");
    assert!(said.contains("nothing is wrong"), "{said}");
    for (change, name) in mistakes {
        let (status, said) = diagnosed(place, solution, solver, change);
        assert_eq!(status, 1, "{change}: {said}");
        let found = read_json(&place.join("found.json"));
        assert_eq!(found["causes"][0]["name"], *name, "{said}");
        assert!(said.contains(found["causes"][0]["look"].as_str().unwrap()), "{said}");
        assert_eq!(found["passed"], false);
    }
}

#[test]
fn a_right_solver_is_told_that_nothing_is_wrong_and_a_wrong_one_what_is() {
    let mistakes = [
        ("s/ + b);/ - b);/", "force-sign"),
        ("s/ + b);/ + axis_aligned_1d_density(\\&bar)*b);/", "force-per-volume"),
        ("s/step \\* dt, &b)/0.0, \\&b)/", "force-frozen"),
    ];
    names_mistakes("axis-aligned-1d", "bar.c", &mistakes);
}

/// Every norm that is asked for is judged, and a search that was cut short says so.
#[test]
fn a_wrong_solver_passes_by_no_norm() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    script(place, "bar.c", "s/+ b);/ - b);/");
    let line =
        format!("diagnose axis-aligned-1d --target c --jobs 2 --run {}/run.sh", place.display());
    for norm in ["u.l2=2", "u.l1=2", "u=2"] {
        let called = mms(place, &format!("{line} --seconds 0.001s --expect {norm}"));
        assert_eq!(called.status, 1, "{norm}: {}{}", called.stdout, called.stderr);
        assert!(!called.stdout.contains("nothing is wrong"), "{}", called.stdout);
        assert!(called.stdout.contains("the time was up"), "{norm}: {}", called.stdout);
    }
    refuses(place, &format!("{line} --expect P=1"), &["the recordings have no P", "they have"]);
    refuses(place, &format!("{line} --expect u.l2=2,u.linf=1"), &["one norm of u"]);
}

/// The largest error is that of the first frame, which no field of later times changes: results are compared, not it alone.
#[test]
fn a_field_that_is_used_later_is_not_called_unused() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let change = "s/axis_aligned_1d_u(&bar, &X.i., 0.0, &u.i.)/u[i] = 0.0/;s/step % n == 0/step == 0 || step == n/";
    let (status, said) = diagnosed(place, "axis-aligned-1d", "bar.c", change);
    assert_eq!(status, 1, "{said}");
    let found = read_json(&place.join("found.json"));
    assert_eq!(found["causes"][0]["name"], "initial-displacement-unused", "{said}");
}

/// A finer grid mends no mistake: the right fields are run on each grid on which a mistake is tried.
#[test]
fn a_right_solver_on_coarse_grids_has_no_mistake() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    script(place, "bar.c", "");
    let line =
        format!("diagnose axis-aligned-1d --target c --jobs 2 --run {}/run.sh", place.display());
    let called = mms(place, &format!("{line} --cells 2,4 --expect u=2.1 --json found.json"));
    let found = read_json(&place.join("found.json"));
    assert!(found["causes"].as_array().unwrap().is_empty(), "{}", called.stdout);
    assert_eq!((called.status, &found["passed"]), (0, &true.into()), "{}", called.stdout);
}

#[test]
fn mistakes_in_the_memory_of_a_material_are_named() {
    // One of three that differ in a factor: each takes a table for each of them.
    let mistakes = [("s/-dt \\/ own.tau/-dt \\/ (2 * own.tau)/", "memory-rates-halved")];
    names_mistakes("bar-own-law", "bar_own_law.c", &mistakes);
}

#[test]
fn what_makes_no_sense_is_refused() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let line = "diagnose bar --target c --run true";
    refuses(place, &format!("{line} --cells 8"), &["--cells", "--cells 8,16"]);
    refuses(place, &format!("{line} --dt 0.1"), &["--dt has 1 value(s) for 2 grids"]);
    refuses(place, line, &["no run left a result"]);
    refuses(
        place,
        "diagnose bar --target c --run false",
        &["no run left a result", "exit status: 1"],
    );
    refuses(place, "diagnose bar --target c", &["--run"]);
    refuses(place, &format!("{line} --build false"), &["--build failed"]);
}

#[test]
fn the_mistakes_are_listed() {
    let place = tempfile::tempdir().unwrap();
    let called = mms(place.path(), "diagnose --list --json causes.json");
    assert_eq!(called.status, 0, "{}", called.stderr);
    let causes = read_json(&place.path().join("causes.json"));
    for cause in causes["causes"].as_array().unwrap() {
        assert!(called.stdout.contains(cause["name"].as_str().unwrap()));
    }
}
