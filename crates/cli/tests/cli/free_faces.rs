//! Bodies whose faces are free: the grid of the updated formulation reaches as far as they move.

#![allow(clippy::unwrap_used)]

use crate::command::{mms, read_json};
use std::path::Path;

/// Which ends of an axis are free.
#[derive(Clone, Copy)]
enum Free {
    Neither,
    Upper,
    Lower,
    Both,
}

/// A box from the origin: its length along each axis, and which of its ends are free there.
type Sides<'a> = &'a [(f64, Free)];

/// The specification of a motion `amplitude` times a standing wave along each axis whose ends have no traction where they are free.
/// The first axis starts at rest, the others at their largest displacement; with a `drift` the first one flies along as well.
fn specification(sides: Sides<'_>, amplitude: f64, drift: f64) -> String {
    let names = ["X", "Y", "Z"];
    let mut motion = String::new();
    let mut boundary = String::new();
    for (axis, (length, free)) in sides.iter().enumerate() {
        let name = names[axis];
        let (wave, ends) = match free {
            Free::Neither => (format!("sin(Pi*{name}/{length:?})"), ["sliding"; 2]),
            Free::Upper => (format!("sin(Pi*{name}/(2*{length:?}))"), ["sliding", "traction-free"]),
            Free::Lower => {
                (format!("-cos(Pi*{name}/(2*{length:?}))"), ["traction-free", "sliding"])
            }
            Free::Both => (format!("cos(Pi*{name}/{length:?})"), ["traction-free"; 2]),
        };
        let time = if axis == 0 { "sin(10*Pi*t)" } else { "cos(10*Pi*t)" };
        let flight = if axis == 0 { format!("{drift:?}*t + ") } else { String::new() };
        motion += &format!("{name} = '{flight}{amplitude:?}*{length:?}*({wave})*{time}'\n");
        for (end, condition) in ["lower", "upper"].into_iter().zip(ends) {
            boundary +=
                &format!("[[boundary]]\nsurface = '{name}-{end}'\ncondition = '{condition}'\n");
        }
    }
    let lengths: Vec<_> = sides.iter().map(|(length, _)| format!("{length:?}")).collect();
    format!(
        "name = 'free'\ntitle = 'free'\ncoordinates = 'cartesian'\ndimension = {}\n[parameters]\nE = {{ default = 100 }}\n\
         nu = {{ default = 0 }}\nrho0 = {{ default = 1 }}\n[displacement]\n{motion}[material]\nlaw = 'neo-hookean'\n\
         [domain]\nshape = 'box'\nlower = {:?}\nupper = [{}]\n{boundary}[time]\nperiod = '0.2'\n",
        sides.len(),
        vec![0; sides.len()],
        lengths.join(", ")
    )
}

/// The order of the mean error of `u` on the finest pair of grids.
fn order(place: &Path, call: &str) -> f64 {
    let called = mms(place, &format!("converge free.toml {call} --json study.json"));
    let study = read_json(&place.join("study.json"));
    let rows = study["rows"].as_array().unwrap();
    assert!(rows.iter().all(|row| row["status"] == "ok"), "{call}: {}", called.stdout);
    study["orders"]["u"]["l2"]["local"].as_array().unwrap().last().unwrap().as_f64().unwrap()
}

#[test]
fn bodies_with_free_faces_have_the_order_of_bodies_between_walls() {
    use Free::{Both, Lower, Neither, Upper};
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    for (sides, drift, grids) in [
        (&[(1.0, Upper)][..], 0.0, "16,32"),
        (&[(25.0, Upper)], 0.0, "4,8"),
        (&[(1.5, Lower)], 0.0, "16,32"),
        (&[(1.0, Both)], 3.0, "24,48"),
        (&[(1.0, Upper), (2.0, Lower)], 0.0, "8,16"),
        (&[(1.0, Neither), (1.0, Both)], 0.0, "12,24"),
        (&[(1.0, Lower), (1.0, Both), (0.5, Upper)], 0.0, "8,16"),
    ] {
        std::fs::write(place.join("free.toml"), specification(sides, 0.04, drift)).unwrap();
        // Weights of points see particles move through the cells, and a body that flies is all movement.
        let shapes = ["gimp", "cpdi", "bspline2"]
            .into_iter()
            .filter(|own| drift == 0.0 || *own != "bspline2");
        for shape in shapes {
            let found = order(place, &format!("--cells {grids} --shape {shape} --periods 0.5"));
            let told = specification(sides, 0.04, drift);
            assert!((1.7..2.5).contains(&found), "{shape}, {grids}: order {found}\n{told}");
        }
    }
}

/// Every shape function with every integrator, and lattices that are shifted.
#[test]
fn every_shape_and_integrator_follows_a_free_face() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let text = specification(&[(1.0, Free::Upper), (1.0, Free::Lower)], 0.05, 0.0);
    std::fs::write(place.join("free.toml"), text).unwrap();
    for shape in ["linear", "ugimp", "gimp", "bspline2", "bspline3", "cpdi", "cpdi2"] {
        for integrator in ["usf", "usavg", "usl", "musl", "cd"] {
            let call = format!(
                "run free.toml --cells 8 --shape {shape} --integrator {integrator} --periods 0.5 --offset 0.3 --json row.json"
            );
            let called = mms(place, &call);
            assert_eq!(called.status, 0, "{call}: {}{}", called.stdout, called.stderr);
            let error = read_json(&place.join("row.json"))["result"]["errors"]["u"]["l2"].clone();
            assert!(error.as_f64().unwrap() < 0.02, "{call}: {error}");
        }
    }
}

/// Particles that go further than the exact motion, here since the grid is coarse, stay on the grid.
#[test]
fn a_particle_that_overshoots_stays_on_the_grid() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let text = specification(&[(1.0, Free::Upper)], 0.3, 0.0);
    std::fs::write(place.join("free.toml"), text).unwrap();
    for cells in [2, 4, 16, 64] {
        let called = mms(place, &format!("run free.toml --cells {cells} --shape cpdi --periods 2"));
        assert!(!called.stdout.contains("left the grid"), "{cells}: {}", called.stdout);
    }
}
