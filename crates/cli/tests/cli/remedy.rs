//! Runs that are given no time step, and what is said after runs that stop.

#![allow(clippy::unwrap_used)]

use crate::command::{mms, read_json, refuses};
use serde_json::Value;
use std::path::Path;

fn row(place: &Path, call: &str) -> (i32, Value) {
    let called = mms(place, &format!("run {call} --json row.json"));
    (called.status, read_json(&place.join("row.json")))
}

/// A ring between free rims in which every circle turns by its own angle, as other codes set it up in a box, or as a ring.
fn vortex(domain: &str) -> String {
    format!(
        "name = 'turns'\ntitle = 'turns'\ncoordinates = 'polar'\ndimension = 2\n[parameters]\nA = {{ default = 1 }}\n\
         E = {{ default = 500 }}\nnu = {{ default = 0.25 }}\nrho0 = {{ default = 2 }}\n[let]\nc = 'sqrt(E/rho0)'\n\
         s = '16*(R - 1)^2'\nhalf = 'A*sin(c*Pi*t)*positive_part(1 - s)^2/2'\n[displacement]\nR = '-2*R*sin(half)^2'\n\
         theta = '2*R*sin(half)*cos(half)'\n[material]\nlaw = 'neo-hookean'\n{domain}[time]\nperiod = '2/c'\n\
         wave-speed = 'c'\n"
    )
}

const RING: &str = "[domain]\nshape = 'annulus'\ninner = '3/4'\nouter = '5/4'\n[[boundary]]\nsurface = 'inner'\n\
                    condition = 'traction-free'\n[[boundary]]\nsurface = 'outer'\ncondition = 'traction-free'\n";

#[test]
fn the_usual_step_is_stable_next_to_incompressibility() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    for (call, shapes) in [
        ("axis-aligned --cells 16 --set nu=0.47", "ugimp gimp bspline2 bspline3 cpdi cpdi2"),
        ("axis-aligned --cells 12 --set nu=0.492 --periods 0.5", "gimp cpdi2"),
        ("axis-aligned --cells 8 --set nu=0.48 --layout clipped", "cpdi2 bspline2 bspline3"),
        ("axis-aligned --cells 8 --set nu=-0.95", "gimp"),
        ("axis-aligned-3d --cells 4 --set nu=0.48 --periods 0.5", "gimp cpdi"),
        ("axis-aligned-1d --cells 32 --set nu=0.499 --set A=0.02", "gimp"),
        ("swirl --cells 8 --set nu=0.499 --periods 0.5", "gimp"),
        ("axis-aligned --cells 8 --set nu=0.49 --formulation total", "bspline3"),
    ] {
        for shape in shapes.split(' ') {
            let call = format!("{call} --shape {shape}");
            let (status, found) = row(place, &call);
            assert_eq!(status, 0, "{call}: {}", found["result"]["status"]);
            assert_eq!(found["passed"], true, "{call}");
            assert_eq!(found["settings"]["cfl_speed"], "p-wave", "{call}");
        }
    }
    // It is said, and the number that is given holds.
    let called = mms(place, "run axis-aligned --cells 8 --set nu=0.48");
    assert!(called.stdout.contains("--cfl-speed p-wave"), "{}", called.stdout);
    let (_, given) = row(place, "axis-aligned --cells 8 --set nu=0.48 --cfl 0.05");
    assert_eq!(
        (&given["settings"]["cfl"], &given["settings"]["cfl_speed"]),
        (&0.05.into(), &"bar".into())
    );
    let (_, usual) = row(place, "axis-aligned --cells 8");
    assert_eq!(
        (&usual["settings"]["cfl"], &usual["settings"]["cfl_speed"]),
        (&0.4.into(), &"bar".into())
    );
}

/// The command that is printed after a run that stopped does run: it is run here.
#[test]
fn what_is_said_to_run_runs() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    std::fs::write(place.join("ring.toml"), vortex(RING)).unwrap();
    let walls = ["X-lower", "X-upper", "Y-lower", "Y-upper"]
        .map(|side| format!("[[boundary]]\nsurface = '{side}'\ncondition = 'sliding'\n"));
    let square = "[domain]\nshape = 'box'\nlower = ['-3/2', '-3/2']\nupper = ['3/2', '3/2']\n";
    std::fs::write(place.join("box.toml"), vortex(&(square.to_owned() + &walls.concat()))).unwrap();
    for (stops, expected) in [
        ("axis-aligned --cells 16 --set nu=0.48 --cfl 0.4", &["--cfl-speed p-wave"][..]),
        (
            "axis-aligned --cells 8 --cfl 2 --precision f32",
            &["--cfl-speed p-wave", "--precision f32"],
        ),
        ("ring --cells 16 --shape linear", &["cpdi2"]),
        (
            "ring.toml --cells 24 --periods 0.5",
            &["--layout body-fitted", "--shape cpdi2", "--transfer apic"],
        ),
        ("box.toml --cells 12 --periods 0.5 --shape cpdi", &["--shape cpdi2"]),
    ] {
        let called = mms(place, &format!("run {stops} --json row.json"));
        assert_eq!(called.status, 1, "{stops}: {}", called.stdout);
        let stopped = read_json(&place.join("row.json"));
        assert_eq!(stopped["passed"], false, "{stops}");
        assert!(stopped["advice"]["p_wave_cfl"].as_f64().unwrap() > 0.0, "{stops}");
        let command = stopped["advice"]["runs"].as_str().unwrap();
        for part in expected {
            assert!(command.contains(part), "{stops}: {part} is missing in: {command}");
        }
        assert!(called.stdout.contains(command), "{stops}: {}", called.stdout);
        let tried = mms(place, command.strip_prefix("mms ").unwrap());
        assert_eq!(tried.status, 0, "{command}: {}{}", tried.stdout, tried.stderr);
        let error =
            stopped["advice"]["tried"].as_array().unwrap().last().unwrap()["u_linf"].clone();
        assert!(error.as_f64().unwrap() < 0.5, "{command}: {error}");
    }
    // A study leads there as well.
    let called = mms(place, "converge ring.toml --cells 24,32 --periods 0.5 --json study.json");
    assert_eq!(called.status, 1, "{}", called.stdout);
    let study = read_json(&place.join("study.json"));
    assert_eq!(study["passed"], false);
    assert!(study["advice"]["runs"].as_str().unwrap().contains("--layout body-fitted"), "{study}");
    // Splines come to the end with errors of two turns.
    let (status, found) = row(
        place,
        "box.toml --cells 16 --periods 0.5 --shape bspline2 --cfl 0.2 --cfl-speed p-wave",
    );
    let ended = found["result"]["status"].as_str().unwrap();
    assert!(status == 1 && ended != "ok", "{ended}");
}

#[test]
fn a_study_with_a_run_that_stopped_fails() {
    let place = tempfile::tempdir().unwrap();
    let called =
        mms(place.path(), "converge swirl --cells 8,16 --set nu=0.49 --cfl 0.4 --periods 0.3");
    assert!(called.status == 1 && called.stdout.contains("STOPPED"), "{}", called.stdout);
}

#[test]
fn explain_tells_how_strongly_cells_are_deformed() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    std::fs::write(place.join("ring.toml"), vortex(RING)).unwrap();
    let called = mms(place, "explain ring.toml --json told.json");
    assert_eq!(called.status, 0, "{}", called.stderr);
    let told = read_json(&place.join("told.json"))["deformation"].take();
    // The largest slope of A (1 - s)^2, 6.16 at radius 1.
    let shear = told["shear"].as_f64().unwrap();
    assert!((5.5..7.5).contains(&shear), "{told}");
    assert!(told["usual_scheme"]["status"] != "ok", "{told}");
    let calm = mms(place, "explain axis-aligned --json calm.json");
    assert!(calm.stdout.contains("principal stretches"), "{}", calm.stdout);
    assert!(read_json(&place.join("calm.json"))["deformation"]["usual_scheme"].is_null());
}

#[test]
fn starts_without_a_meaning_are_refused_with_the_line_to_write() {
    let place = tempfile::tempdir().unwrap();
    for start in ["exact", "data"] {
        for integrator in ["usf", "usl", "musl", "usavg"] {
            let call = format!("axis-aligned --cells 8 --start {start} --integrator {integrator}");
            let instead = format!("--integrator cd --start {start}");
            refuses(place.path(), &format!("run {call}"), &[integrator, &instead]);
        }
        let call = format!("run axis-aligned --cells 8 --formulation total --start {start}");
        refuses(place.path(), &call, &["total Lagrangian", "--formulation updated-lagrangian"]);
    }
}
