//! Conditions by component: orders in every formulation, components that are not free, and files for hosts.

#![allow(clippy::unwrap_used)]

use crate::command::{mms, read_json};
use std::fs;
use std::path::{Path, PathBuf};

fn specification(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/specs/conditions");
    folder.join(name).with_extension("toml")
}

/// The order of the error of `u` in the mean of squares on the finest pair of grids.
fn order(place: &Path, call: &str) -> f64 {
    let called = mms(place, &format!("converge {call} --json study.json"));
    let study = read_json(&place.join("study.json"));
    let order = study["orders"]["u"]["l2"]["local"].as_array().and_then(|all| all.last()?.as_f64());
    order.unwrap_or_else(|| panic!("{call}: {}{}", called.stdout, called.stderr))
}

/// Orders of splines are one more than their degree, those of moving particles 2.
#[test]
fn each_component_has_the_order_of_its_scheme() {
    const REST: &str = "--static --moment 0.125";
    const TOTAL: &str = "--formulation total-lagrangian --periods 0.1 --cfl 0.1 --cfl-speed p-wave";
    const CLIPPED: &str = "--layout clipped --periods 0.5";
    const UPDATED: &str = "--formulation updated-lagrangian --periods 0.5";
    let place = tempfile::tempdir().unwrap();
    for (name, scheme, grids, expected) in [
        ("moving-rollers", format!("{REST} --shape linear"), "8,16", 2.0),
        ("moving-rollers", format!("{REST} --shape bspline2"), "8,16", 3.0),
        ("moving-rollers", format!("{REST} --shape bspline3"), "8,16", 4.0),
        ("moving-rollers", format!("{TOTAL} --shape bspline2"), "8,16", 3.0),
        ("moving-rollers", format!("{TOTAL} --shape bspline3"), "8,16", 4.0),
        ("moving-rollers", CLIPPED.into(), "16,32", 2.0),
        ("sticking", format!("{REST} --shape linear"), "8,16", 2.0),
        ("sticking", format!("{REST} --shape bspline2"), "8,16", 3.0),
        ("sticking", format!("{REST} --shape bspline3"), "8,16", 4.0),
        ("sticking", format!("{TOTAL} --shape bspline2"), "8,16", 3.0),
        ("sticking", format!("{TOTAL} --shape bspline3"), "8,16", 4.0),
        ("sticking", CLIPPED.into(), "16,32", 2.0),
        ("turned-ring", format!("{REST} --shape linear"), "8,16", 2.0),
        ("turned-ring", format!("{REST} --shape bspline2"), "8,16", 3.0),
        ("turned-ring", format!("{REST} --shape bspline3"), "16,32", 4.0),
        ("turned-ring", format!("{TOTAL} --shape bspline2"), "8,16", 3.0),
        ("turned-ring", format!("{TOTAL} --shape bspline3"), "10,20", 4.0),
        ("turned-ring", CLIPPED.into(), "16,32", 2.0),
        ("three-on-a-face", format!("{REST} --shape linear"), "3,6", 2.0),
        ("three-on-a-face", format!("{REST} --shape bspline2"), "6,12", 3.0),
        ("three-on-a-face", format!("{TOTAL} --shape bspline3"), "6,12", 4.0),
        ("pressed-tube", format!("{REST} --shape linear"), "8,16", 2.0),
        ("pressed-tube", format!("{REST} --shape bspline2"), "8,16", 3.0),
        ("pressed-tube", format!("{TOTAL} --shape bspline3"), "8,16", 4.0),
        ("pressed-tube", CLIPPED.into(), "16,32", 2.0),
        // Walls, but no mirrors.
        ("sliding-without-image", format!("{REST} --shape bspline2"), "8,16", 3.0),
        ("sliding-without-image", format!("{REST} --shape bspline3"), "8,16", 4.0),
        ("sliding-without-image", format!("{TOTAL} --shape bspline3"), "8,16", 4.0),
        // Rollers that do not move are walls of the updated formulation, and conditions by component of the total one.
        // Faces that stand still are held, and a traction of nothing is none.
        ("held", format!("{UPDATED} --shape gimp"), "16,32", 2.0),
        ("held", format!("{UPDATED} --shape cpdi"), "16,32", 2.0),
        ("held", format!("{UPDATED} --shape gimp-bspline2"), "16,32", 2.0),
        ("rollers-at-rest", "--shape gimp".into(), "8,16", 2.0),
        ("rollers-at-rest", CLIPPED.into(), "16,32", 2.0),
        ("rollers-at-rest", format!("{REST} --shape bspline2"), "8,16", 3.0),
        ("rollers-at-rest", format!("{TOTAL} --shape bspline3"), "8,16", 4.0),
    ] {
        let call = format!("{} {scheme} --cells {grids}", specification(name).display());
        let found = order(place.path(), &call);
        assert!((found - expected).abs() <= 0.1, "{call}: order {found}, not {expected}");
    }
}

#[test]
fn a_component_that_is_not_free_is_named() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    for (name, right, wrong, named) in [
        (
            "moving-rollers",
            "normal = 'prescribed-traction', tangential = 'traction-free'",
            "normal = 'traction-free', tangential = 'prescribed-traction'",
            "N.P N on X-upper",
        ),
        (
            "sticking",
            "normal = 'prescribed-motion', tangential = 'prescribed-traction'",
            "normal = 'prescribed-motion', tangential = 'traction-free'",
            "shear on Y-lower",
        ),
        (
            "three-on-a-face",
            "X = 'prescribed-traction', Y = 'prescribed-motion', Z = 'traction-free'",
            "X = 'traction-free', Y = 'prescribed-motion', Z = 'prescribed-traction'",
            "P N along X on X-upper",
        ),
        (
            "turned-ring",
            "normal = 'prescribed-traction', tangential = 'prescribed-motion'",
            "normal = 'prescribed-motion', tangential = 'traction-free'",
            "shear on outer",
        ),
    ] {
        let text = fs::read_to_string(specification(name)).unwrap();
        assert!(text.contains(right), "{name}: {right}");
        for (text, verdict) in [(text.clone(), 0), (text.replace(right, wrong), 1)] {
            fs::write(place.join(format!("{name}.toml")), text).unwrap();
            let called = mms(place, &format!("check {name}.toml --points 20 --json check.json"));
            assert_eq!(called.status, verdict, "{}{}", called.stdout, called.stderr);
            let result = read_json(&place.join("check.json"))["results"][0].clone();
            let failed = |list: &str, verdict: &str| -> Vec<String> {
                let all = result[list].as_array().unwrap().iter();
                let failed = all.filter(|one| one["verdict"] == verdict);
                failed.map(|one| one["what"].as_str().unwrap().to_owned()).collect()
            };
            let expected = if verdict == 0 { vec![] } else { vec![named.to_owned()] };
            assert_eq!(failed("findings", "failed"), expected, "{name}: {}", called.stdout);
            assert_eq!(failed("surfaces", "refuted"), expected, "{name}: {}", called.stdout);
        }
    }
}

#[test]
fn files_for_hosts_state_the_conditions_of_components() {
    let place = tempfile::tempdir().unwrap();
    let file = specification("three-on-a-face");
    for target in ["c", "fortran", "numpy", "julia", "moose", "ufl"] {
        let out = place.path().join(target);
        let call = format!("gen {} --target {target} --out {}", file.display(), out.display());
        let called = mms(place.path(), &call);
        assert_eq!(called.status, 0, "{call}: {}", called.stderr);
        let texts = fs::read_dir(&out).unwrap().map(|own| fs::read_to_string(own.unwrap().path()));
        let text: String = texts.map(Result::unwrap).collect();
        // Lines of comments are broken between words.
        let signs = |c: char| matches!(c, '!' | '#' | '/' | '*');
        let words =
            text.split(|c: char| c.is_whitespace() || signs(c)).filter(|own| !own.is_empty());
        let text = words.collect::<Vec<_>>().join(" ");
        for expected in [
            "surface X-upper: X prescribed traction, Y prescribed motion, Z traction-free",
            "surface Z-upper: normal prescribed motion, tangential traction-free",
        ] {
            assert!(text.contains(expected), "{target}: {expected}");
        }
    }
}

#[test]
fn what_one_formulation_does_not_model_is_told_with_the_one_that_does() {
    let place = tempfile::tempdir().unwrap();
    let file = specification("sticking");
    let called = mms(place.path(), &format!("run {} --shape gimp", file.display()));
    assert_eq!(called.status, 2, "{}", called.stdout);
    for expected in [
        "normal prescribed-traction, tangential prescribed-motion on X-lower",
        "--formulation total-lagrangian --shape bspline3",
    ] {
        assert!(called.stderr.contains(expected), "{}", called.stderr);
    }
    let called = mms(
        place.path(),
        &format!("run {} --layout clipped --cells 8 --periods 0.1", file.display()),
    );
    // The roller below does not move: it is a wall.
    let expected = "the traction of the exact motion acts on X-lower (normal prescribed-traction, tangential prescribed-motion), \
                    X-upper (normal prescribed-motion, tangential prescribed-traction) in place of that";
    assert!(called.stdout.contains(expected), "{}", called.stdout);
}
