//! Bodies that cannot run as they are stated, and the lines that make them run: each refusal says them, and they hold.

use crate::command::{mms, read_json, refuses};
use std::fs;
use std::path::Path;

const MATERIAL: &str = "\
[parameters]
A = { default = 0.02 }
E = { default = 1000 }
nu = { default = 0.3 }
rho0 = { default = 2 }
L = { default = 1 }

[let]
c = 'sqrt(E/rho0)'

[material]
law = 'neo-hookean'

[time]
period = '2*L/c'
";

/// A specification with the material of all, in one file.
fn specify(place: &Path, name: &str, head: &str, tail: &str) {
    let text = format!("name = '{name}'\ntitle = '{name}'\n{head}\n{MATERIAL}\n{tail}");
    fs::write(place.join(format!("{name}.toml")), text).expect("a specification");
}

fn changed(place: &Path, name: &str, pairs: &[(&str, &str)]) {
    let file = place.join(format!("{name}.toml"));
    let mut text = fs::read_to_string(&file).expect("a specification");
    for (old, new) in pairs {
        assert!(text.contains(old), "{old} is missing in {text}");
        text = text.replace(old, new);
    }
    fs::write(file, text).expect("a specification");
}

#[test]
fn a_body_with_its_centre_or_axis_is_refused_with_the_lines_that_run() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let round = |name: &str, coordinates: &str, shape: &str, dimension: usize| {
        let head = format!(
            "coordinates = '{coordinates}'\ndimension = {dimension}\n[displacement]\nR = 'A*R*sin(c*Pi*t)'\n"
        );
        let tail = format!(
            "[domain]\nshape = '{shape}'\ninner = 0\nouter = 1\n[[boundary]]\nsurface = 'outer'\ncondition = 'prescribed-traction'\n"
        );
        specify(place, name, &head, &tail);
    };
    round("disc", "polar", "annulus", 2);
    round("ball", "spherical", "shell", 3);
    for name in ["disc", "ball"] {
        for command in ["check", "run"] {
            let call = format!("{command} {name}.toml");
            refuses(place, &call, &["contains its centre", "inner = '1/100'"]);
        }
    }
    refuses(place, "check disc.toml", &["'axisymmetric'", "'solid-cylinder'"]);
    changed(place, "disc", &[("inner = 0", "inner = '1/100'")]);
    let sides = "[[boundary]]\nsurface = 'outer'";
    let inner = "[[boundary]]\nsurface = 'inner'\ncondition = 'prescribed-motion'\n";
    changed(place, "disc", &[(sides, &format!("{inner}{sides}"))]);
    let called = mms(place, "check disc.toml");
    assert_eq!(called.status, 0, "{}{}", called.stdout, called.stderr);
    // The radius may be a parameter that is set to zero.
    let head = "coordinates = 'polar'\ndimension = 2\n[displacement]\nR = 'A*R*sin(c*Pi*t)'\n";
    let ring = "[domain]\nshape = 'annulus'\ninner = 'L - 1/2'\nouter = 1\n";
    specify(place, "ring", head, &format!("{ring}{inner}{sides}\ncondition = 'traction-free'\n"));
    refuses(place, "run ring.toml --cells 4 --set L=0.5", &["contains its centre"]);

    let head = "coordinates = 'cylindrical'\ndimension = 3\n[displacement]\nR = 'A*R*(1 + Z)*sin(c*Pi*t)'\n";
    let tail = "[domain]\nshape = 'solid-cylinder'\nouter = 1\nlower = 0\nupper = 1\n\
                [[boundary]]\nsurface = 'R-upper'\ncondition = 'prescribed-traction'\n\
                [[boundary]]\nsurface = 'Z-lower'\ncondition = 'prescribed-motion'\n\
                [[boundary]]\nsurface = 'Z-upper'\ncondition = 'prescribed-traction'\n";
    specify(place, "solid", head, tail);
    refuses(
        place,
        "run solid.toml --cells 4",
        &["contains its axis", "coordinates = 'axisymmetric'"],
    );
    refuses(place, "converge solid.toml --cells 4,8", &["contains its axis"]);
    let lines = [("'cylindrical'", "'axisymmetric'"), ("dimension = 3", "dimension = 2")];
    changed(place, "solid", &lines);
    let called = mms(place, "run solid.toml --cells 4 --periods 0.05");
    assert_eq!(called.status, 0, "{}{}", called.stdout, called.stderr);
}

#[test]
fn a_forgotten_cell_length_is_named_and_makes_the_body_run() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let head = "coordinates = 'cartesian'\ndimension = 2\n[displacement]\nX = 'A*L*sin(Pi*X/L)*sin(c*Pi*t/L)'\n";
    let side =
        |name: &str| format!("[[boundary]]\nsurface = '{name}'\ncondition = 'prescribed-motion'\n");
    let sides: String = ["X-lower", "X-upper", "Y-lower", "Y-upper"].map(side).concat();
    let tail = format!("[domain]\nshape = 'box'\nlower = [0, 0]\nupper = ['L', 'L']\n{sides}");
    specify(place, "square", head, &tail);
    for (length, named) in [("1e-6", "cell-length = 1e-6"), ("1e9", "cell-length = 1000000000.0")] {
        let call = format!("run square.toml --cells 4 --periods 0.1 --set L={length}");
        refuses(place, &call, &[named, "cell-length = 'L'"]);
    }
    changed(place, "square", &[("shape = 'box'", "shape = 'box'\ncell-length = 'L'")]);
    for length in ["1e-6", "1e9"] {
        let call = format!("run square.toml --cells 4 --periods 0.1 --set L={length}");
        let called = mms(place, &call);
        assert_eq!(called.status, 0, "{}{}", called.stdout, called.stderr);
    }
}

#[test]
fn the_conditions_that_a_shell_lacks_are_named_at_once_and_run() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let head = "coordinates = 'spherical'\ndimension = 3\n[displacement]\nR = 'A*R*sin(c*Pi*t)'\n";
    let domain = "[domain]\nshape = 'shell'\ninner = '1/2'\nouter = 1\n";
    specify(place, "shell", head, domain);
    let call = "run shell.toml --cells 3 --periods 0.05";
    let called = mms(place, call);
    assert_eq!(called.status, 2, "{}", called.stdout);
    let (_, lines) = called.stderr.split_once("in its specification:\n").expect("the lines");
    specify(place, "shell", head, &format!("{domain}{lines}"));
    let called = mms(place, call);
    assert_eq!(called.status, 0, "{lines}{}", called.stderr);
    // The eighth between them is what there is.
    refuses(place, &format!("{call} --extent full"), &["leave --extent out"]);
}

/// A pressure of two shear moduli at most is what the advice for an unstable motion says of its amplitude.
#[test]
fn the_amplitude_that_is_advised_has_the_pressure_that_is_said() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let head = "coordinates = 'cartesian'\ndimension = 2\n[displacement]\nX = 'A*sin(Pi*X)*sin(c*Pi*t)'\nY = 'A*X*Y*sin(c*Pi*t)'\n";
    let side =
        |name: &str| format!("[[boundary]]\nsurface = '{name}'\ncondition = 'prescribed-motion'\n");
    let sides: String = ["X-lower", "X-upper", "Y-lower", "Y-upper"].map(side).concat();
    specify(
        place,
        "strong",
        head,
        &format!("[domain]\nshape = 'box'\nlower = [0, 0]\nupper = [1, 1]\n{sides}"),
    );
    let call = "run strong.toml --set A=0.33 --cells 8 --periods 0.5";
    let told = mms(place, call).stdout;
    let (_, rest) = told.split_once("--set A=").expect("an amplitude");
    let (amplitude, claim) = rest.split_once(' ').expect("a claim");
    assert!(claim.starts_with("(a pressure of two shear moduli at most)"), "{told}");
    let call =
        format!("stability strong.toml --exact --periods 0.5 --set A={amplitude} --json g.json");
    assert_eq!(mms(place, &call).status, 0);
    let found = read_json(&place.join("g.json"));
    let pressure = found["rows"][0]["extremes"]["pressure_over_mu"].as_f64().expect("a number");
    assert!(pressure <= 2.0, "{pressure}");
}
