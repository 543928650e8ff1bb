//! Warnings: what a solution cannot show, motions that are none, and orders that grids cannot tell.

#![allow(clippy::unwrap_used)]

use crate::command::{mms, read_json};
use serde_json::Value;
use std::fs;
use std::path::Path;

fn kinds(list: &Value) -> Vec<&str> {
    list.as_array().unwrap().iter().map(|spot| spot["kind"].as_str().unwrap()).collect()
}

/// The blind spots of a call, with the values that end them.
fn spots(place: &Path, call: &str) -> (Vec<String>, Vec<String>) {
    let called = mms(place, &format!("check {call} --points 3 --json check.json"));
    assert_eq!(called.status, 0, "{call}: {}{}", called.stdout, called.stderr);
    let document = read_json(&place.join("check.json"));
    let list = &document["results"][0]["blind_spots"];
    let told = called.stdout.lines().filter(|line| line.trim_start().starts_with("blind spot: "));
    assert_eq!(told.count(), list.as_array().unwrap().len(), "{}", called.stdout);
    let sets = list.as_array().unwrap().iter().filter_map(|spot| spot["set"].as_str());
    (kinds(list).into_iter().map(str::to_owned).collect(), sets.map(str::to_owned).collect())
}

#[test]
fn blind_spots_are_measured_and_end_with_the_value_that_is_told() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    for (call, kinds, sets) in [
        ("skew-2d", &[][..], &[][..]),
        ("skew-2d --set rho0=1", &["unit-density"], &["rho0=4"]),
        ("skew-2d --set rho0=1.01", &["unit-density"], &["rho0=4.04"]),
        ("skew-2d --set rho0=1.1", &[], &[]),
        ("skew-3d --set nu=0", &["no-lambda"], &["nu=0.3"]),
        ("skew-2d --set nu=0.25", &["equal-moduli"], &["nu=0.3"]),
        ("skew-2d --set nu=0 --set rho0=1", &["unit-density", "no-lambda"], &["rho0=4", "nu=0.3"]),
        ("axis-aligned", &["symmetric-gradient"], &[]),
        // Of one component there is no transpose.
        ("axis-aligned-1d", &[], &[]),
        ("bar", &["no-lambda"], &["nu=0.3"]),
        ("ring", &["no-lambda", "symmetric-gradient"], &[]),
        ("swirl", &[], &[]),
        ("shear-wave", &["constant-volume", "no-body-force"], &[]),
    ] {
        let (found, ends) = spots(place, call);
        assert_eq!(found, kinds, "{call}");
        assert_eq!(ends, sets, "{call}");
        for set in sets {
            let changed = format!("{} --set {set}", call.split(" --set").next().unwrap());
            let (left, _) = spots(place, &changed);
            assert!(left.len() < kinds.len(), "{changed}: {left:?}");
        }
    }
}

#[test]
fn explain_and_score_tell_the_blind_spots_that_check_tells() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let line = "blind spot: lambda = 0 (nu = 0, E = 2 mu)";
    let explained = mms(place, "explain bar --json explain.json");
    assert!(explained.stdout.contains(line), "{}", explained.stdout);
    assert_eq!(kinds(&read_json(&place.join("explain.json"))["blind_spots"]), ["no-lambda"]);
    fs::write(place.join("a.csv"), "t,X,ux\n0,0.25,0.01\n0,0.5,0\n0,0.75,-0.01\n").unwrap();
    let scored = mms(place, "score bar a.csv --json score.json");
    assert!(scored.stdout.contains(line), "{}{}", scored.stdout, scored.stderr);
    assert_eq!(kinds(&read_json(&place.join("score.json"))["blind_spots"]), ["no-lambda"]);
}

/// Prescribed motion on all sides of a square.
fn sides() -> String {
    ["X-lower", "X-upper", "Y-lower", "Y-upper"]
        .iter()
        .map(|side| format!("[[boundary]]\nsurface = '{side}'\ncondition = 'prescribed-motion'\n"))
        .collect()
}

/// A bar that folds where `2 Pi A/L cos(...)` is below -1.
fn folding(law: &str) -> String {
    format!(
        "name = 'folding'\ntitle = 'A bar that folds'\ncoordinates = 'cartesian'\ndimension = 2\n\
         [parameters]\nA = {{ default = 0.5 }}\nE = {{ default = 900 }}\nnu = {{ default = 0.3 }}\nrho0 = {{ default = 3 }}\n\
         [displacement]\nX = 'A*sin(2*Pi*X)*sin(Pi*t)'\nY = 'A/9*Y^2*sin(Pi*t)'\n[material]\nlaw = '{law}'\n\
         [domain]\nshape = 'box'\nlower = [0, 0]\nupper = [1, 1]\n{}[time]\nperiod = 2\nwave-speed = 'sqrt(E/rho0)'\n",
        sides()
    )
}

#[test]
fn a_motion_that_is_inverted_is_told_with_time_and_amplitude_and_small_strain_does_not_fail_by_it()
{
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    for (law, status) in [("linear-elastic", 0), ("neo-hookean", 1)] {
        fs::write(place.join("folding.toml"), folding(law)).unwrap();
        let called = mms(place, "check folding.toml --json check.json");
        assert_eq!(called.status, status, "{law}: {}", called.stdout);
        let told = "the exact motion turns the body inside out: J <= 0 at X = (";
        assert!(called.stdout.contains(told), "{law}: {}", called.stdout);
        let inverted = &read_json(&place.join("check.json"))["results"][0]["inverted"];
        // J = 1 - 2 Pi A sin(Pi t) where it is least; it begins where sin(Pi t) = 1/(2 Pi A), and never does below A = 1/(2 Pi).
        let exact = 1.0 / (2.0 * std::f64::consts::PI);
        let [t, least] = ["t", "least"].map(|key| inverted[key].as_f64().unwrap());
        assert!((0.1..0.2).contains(&t), "{inverted}");
        let lowest = (1.0 - std::f64::consts::PI) * (1.0 + 1.0 / 9.0);
        assert!((least / lowest - 1.0).abs() < 0.02, "{inverted}");
        assert_eq!(inverted["largest"][0], "A");
        let largest = inverted["largest"][1].as_f64().unwrap();
        assert!((largest / exact - 1.0).abs() < 0.02, "{inverted}");
        let calm = mms(place, &format!("check folding.toml --set A={}", 0.95 * exact));
        assert!(!calm.stdout.contains("inside out"), "{}", calm.stdout);
        assert_eq!(calm.status, 0, "{law}: {}", calm.stdout);
    }
    let run = mms(place, "run folding.toml --cells 8 --periods 0.3 --formulation total");
    assert_eq!(run.status, 1, "{}{}", run.stdout, run.stderr);
    assert!(run.stdout.contains("the exact motion turns the body inside out"), "{}", run.stdout);
}

/// A square under a displacement at rest, which is prescribed on all of it.
fn at_rest(law: &str, u: [&str; 2]) -> String {
    format!(
        "name = 'at-rest'\ntitle = 'A square at rest'\ncoordinates = 'cartesian'\ndimension = 2\n\
         [parameters]\nA = {{ default = 1e-4 }}\nE = {{ default = 2e9 }}\nnu = {{ default = 0.4 }}\nrho0 = {{ default = 900 }}\n\
         [displacement]\nX = '{}'\nY = '{}'\n[material]\nlaw = '{law}'\n\
         [domain]\nshape = 'box'\nlower = [0, 0]\nupper = [1, 1]\n{}",
        u[0],
        u[1],
        sides()
    )
}

#[test]
fn affine_displacements_are_at_rounding_on_every_grid() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    for (law, cells) in
        [("neo-hookean", "4,8,16"), ("linear-elastic", "4,8,16"), ("linear-elastic", "2,4,8")]
    {
        let u = ["3/10 - X/10 + 2*Y/5", "X/5 + 3*Y/10 - 7/10"];
        fs::write(place.join("affine.toml"), at_rest(law, u)).unwrap();
        let called = mms(place, &format!("converge affine.toml --cells {cells}"));
        assert_eq!(called.status, 0, "{law}: {}", called.stdout);
        assert!(!called.stdout.contains("DOES NOT CONVERGE"), "{law}: {}", called.stdout);
        assert!(called.stdout.contains("too few errors above rounding"), "{}", called.stdout);
    }
}

#[test]
fn coarse_grids_that_are_short_of_an_order_warn_and_a_wrong_order_fails() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let u = ["A*exp(X^2)*sin(Y)", "A*(ln(3 + Y)*cos(X) + sin(Y))"];
    fs::write(place.join("smooth.toml"), at_rest("linear-elastic", u)).unwrap();
    let coarse = mms(place, "converge smooth.toml --cells 4,8,16");
    assert_eq!(coarse.status, 0, "{}", coarse.stdout);
    assert!(!coarse.stdout.contains("FAILED"), "{}", coarse.stdout);
    assert!(coarse.stdout.contains("cannot tell: too coarse"), "{}", coarse.stdout);
    assert!(coarse.stdout.contains("--cells 8,16,32 would tell"), "{}", coarse.stdout);
    // What was asked for is met or is not.
    for (expected, status) in [("u.l2=4", 1), ("u.l2=5", 1), ("u.l2=3", 0)] {
        let call = format!("converge smooth.toml --cells 4,8,16 --expect {expected}");
        assert_eq!(mms(place, &call).status, status, "{expected}");
    }
}

#[test]
fn points_of_a_displacement_at_rest_need_no_time() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    fs::write(place.join("rest.toml"), at_rest("neo-hookean", ["A*X*Y", "A*X^2"])).unwrap();
    fs::write(place.join("with.json"), r#"[{ "X": [0.25, 0.5], "t": 3 }]"#).unwrap();
    fs::write(place.join("without.json"), r#"[{ "X": [0.25, 0.5] }]"#).unwrap();
    fs::write(place.join("without.csv"), "X,Y\n0.25,0.5\n").unwrap();
    let row = |points: &str| {
        let called = mms(place, &format!("eval rest.toml --points {points} --json row.json"));
        assert_eq!(called.status, 0, "{points}: {}", called.stderr);
        read_json(&place.join("row.json"))["rows"][0].clone()
    };
    let expected = row("with.json");
    for points in ["without.json", "without.csv"] {
        assert_eq!(row(points), expected, "{points}");
        let refused = mms(place, &format!("eval skew-2d --points {points}"));
        assert_eq!(refused.status, 2, "{}", refused.stdout);
        assert!(refused.stderr.contains("t is missing") || refused.stderr.contains("no column t"));
    }
}

/// Sums over the points of particles are no integrals, so that errors grow on finer grids; means over boxes are.
#[test]
fn errors_that_grow_under_refinement_are_warned_of() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let study = |scheme: &str| {
        let call = format!(
            "converge axis-aligned-1d --cells 32,64,128 --periods 0.5 --json study.json {scheme}"
        );
        let called = mms(place, &call);
        (called.stdout, read_json(&place.join("study.json")))
    };
    let (said, found) = study("--shape bspline2 --transfer apic");
    assert!(said.contains("warning: particle quadrature"), "{said}");
    assert_eq!(found["quadrature"]["instead"], "--shape gimp-bspline2");
    assert!(found["quadrature"]["order"].as_f64().unwrap() < 0.0);
    let (said, found) = study("--shape gimp-bspline2 --transfer apic");
    assert!(!said.contains("warning"), "{said}");
    assert!(found["quadrature"].is_null() && found["refinement"].is_null());
    let (said, found) = study("--integrator musl");
    assert!(said.contains("grows on the finest grids"), "{said}");
    assert!(found["quadrature"].is_null() && found["refinement"]["field"].is_string());
}

/// Splines that follow the motion exactly leave the error of the time steps alone: where these do not follow the cells, no order is missed.
#[test]
fn orders_of_runs_with_few_steps_are_not_judged() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let text = include_str!("../../../../tests/data/specs/told/few-steps.toml");
    std::fs::write(place.join("few-steps.toml"), text).unwrap();
    let judged = |periods: &str| {
        let call =
            format!("converge few-steps.toml --cells 4,6,8 --periods {periods} --json made.json");
        let called = mms(place, &call);
        assert_eq!(called.status, 0, "{}{}", called.stdout, called.stderr);
        read_json(&place.join("made.json"))
    };
    let whole = judged("0.08");
    assert_eq!((&whole["passed"], whole.get("not_judged")), (&true.into(), None));
    let few = judged("0.05");
    assert!(few["passed"].is_null(), "{}", few["passed"]);
    assert!(few["not_judged"].as_str().unwrap().contains("do not follow the cells"));
}
