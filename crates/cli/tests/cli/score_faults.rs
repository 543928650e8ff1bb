//! `mms score` of recordings with one fault that means, or the components in the plane, do not show; and of the same recordings without it.
//!
//! Recordings are what `mms eval` writes, with an error of the order 2.

#![allow(clippy::unwrap_used)]

use crate::command::{Called, mms, refuses};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

const CELLS: [usize; 3] = [4, 8, 16];

/// The columns of a line, with the number of cells among them.
type Line = BTreeMap<String, f64>;

fn data(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(file)
}

/// A body: its specification, the columns of its points, the corners of a box in it, and times.
struct Body {
    spec: &'static str,
    columns: [&'static str; 2],
    lower: [f64; 2],
    upper: [f64; 2],
    times: [f64; 2],
}

const TUBE: Body = Body {
    spec: "mms-specs/revolution/thick-cylinder.toml",
    columns: ["R", "Z"],
    lower: [0.5, 0.0],
    upper: [1.0, 1.0],
    times: [0.002, 0.007],
};
const PLATE: Body = Body {
    spec: "tests/data/specs/across/plate-neo-hookean-quadratic.toml",
    columns: ["X", "Y"],
    lower: [0.0, 0.0],
    upper: [1.0, 1.0],
    times: [0.003, 0.007],
};
const BLOCK: Body = Body {
    spec: "mms-specs/skew-2d.toml",
    columns: ["X", "Y"],
    lower: [0.0, 0.0],
    upper: [1.0, 1.0],
    times: [0.003, 0.007],
};

/// Fields that `mms eval` gives at the centres of cells.
fn evaluated(place: &Path, body: &Body, cells: usize) -> Vec<Line> {
    let at = |axis: usize, k: usize| {
        let share = (k as f64 + 0.5) / cells as f64;
        body.lower[axis] + share * (body.upper[axis] - body.lower[axis])
    };
    let [first, second] = body.columns;
    let mut points = format!("{first},{second},t\n");
    for t in body.times {
        for n in 0..cells * cells {
            points += &format!("{:?},{:?},{t:?}\n", at(0, n % cells), at(1, n / cells));
        }
    }
    fs::write(place.join("points.csv"), points).unwrap();
    let call = format!("eval {} --points points.csv --csv exact.csv", data(body.spec).display());
    assert_eq!(mms(place, &call).status, 0, "{call}");
    let text = fs::read_to_string(place.join("exact.csv")).unwrap();
    let mut lines = text.lines();
    let names: Vec<_> = lines.next().unwrap().split(',').collect();
    let line = |line: &str| {
        let values = line.split(',').map(|value| value.parse().unwrap());
        names.iter().map(|name| (*name).to_owned()).zip(values).collect()
    };
    lines.map(line).collect()
}

/// The score of recordings of all grids with these columns, each `name` or `name=source`, changed by `fault`.
fn scored(body: &Body, columns: &str, options: &str, fault: fn(&mut Line, usize, usize)) -> Called {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let mut files = String::new();
    for cells in CELLS {
        let mut lines = evaluated(place, body, cells);
        let error = 0.1 * (cells as f64).powi(-2);
        for (number, line) in lines.iter_mut().enumerate() {
            for (name, value) in line.iter_mut() {
                if ["u", "v", "F", "P"].iter().any(|field| name.starts_with(field)) {
                    *value *= 1.0 + error;
                }
            }
            fault(line, number % (cells * cells), cells);
        }
        let parts: Vec<(&str, &str)> =
            columns.split(' ').map(|one| one.split_once('=').unwrap_or((one, one))).collect();
        let header: Vec<_> = parts.iter().map(|(name, _)| *name).collect();
        let mut text = header.join(",") + "\n";
        for line in &lines {
            let value = |source: &str| line.get(source).copied().unwrap_or_default();
            let values: Vec<_> =
                parts.iter().map(|(_, source)| format!("{:?}", value(source))).collect();
            text += &(values.join(",") + "\n");
        }
        let file = format!("n{cells}.csv");
        fs::write(place.join(&file), text).unwrap();
        files += &format!(" {file}");
    }
    let spec = data(body.spec);
    mms(place, &format!("score {}{files} --cells 4,8,16 {options}", spec.display()))
}

/// Nine components in the order of the fields, and with the direction around the axis last.
const NINE: &str = "F11 F12 F13 F21 F22 F23 F31 F32 F33 P11 P12 P13 P21 P22 P23 P31 P32 P33";
const HOOP_LAST: &str = "F11 F12=F13 F13=F12 F21=F31 F22=F33 F23=F32 F31=F21 F32=F23 F33=F22 \
                         P11 P12=P13 P13=P12 P21=P31 P22=P33 P23=P32 P31=P21 P32=P23 P33=P22";
const IN_PLANE: &str = "F11 F12=F13 F21=F31 F22=F33 P11 P12=P13 P21=P31 P22=P33";

fn none(_: &mut Line, _: usize, _: usize) {}

/// Changes a component.
fn set(line: &mut Line, name: &str, change: impl Fn(f64) -> f64) {
    let value = line.get_mut(name).unwrap();
    *value = change(*value);
}

#[test]
fn bodies_of_revolution_are_read_in_both_orders_and_compared_around_the_axis() {
    let plane = "R Z t u1 u2=u3";
    let space = "R theta Z t u1 u2 u3 v1 v2 v3";
    let order = "components of tensors are taken in the order";
    type Fault = fn(&mut Line, usize, usize);
    let cases: [(&str, &str, Fault, i32, &[&str]); 10] = [
        // As `mms eval` writes them.
        (space, NINE, none, 0, &[&format!("{order} R, theta, Z")]),
        (plane, NINE, none, 0, &[&format!("{order} R, theta, Z")]),
        (plane, HOOP_LAST, none, 0, &[&format!("{order} R, Z, theta")]),
        ("X=R Y=Z t ux=u1 uy=u3", HOOP_LAST, none, 0, &[&format!("{order} R, Z, theta")]),
        (
            plane,
            HOOP_LAST,
            |line, _, _| set(line, "P22", |P| -3.0 * P),
            1,
            &["P around the axis has order", "wrong is the stress"],
        ),
        (
            plane,
            NINE,
            |line, _, _| set(line, "F22", |F| 2.0 - F),
            1,
            &["F around the axis has order"],
        ),
        (space, NINE, |line, _, _| set(line, "P22", |P| 1.5 * P), 1, &["P around the axis"]),
        (
            plane,
            HOOP_LAST,
            |line, _, _| set(line, "P22", |_| 0.0),
            0,
            &["`P` has zeros around the axis, where the solution has a stress: it is not compared"],
        ),
        (
            plane,
            IN_PLANE,
            none,
            0,
            &["`P` has no component around the axis", "`F` has no component around the axis"],
        ),
        ("R theta Z t u1 u2 u3", "J", none, 0, &["passed: converges with order 2.00"]),
    ];
    for (points, tensors, fault, status, told) in cases {
        let called = scored(&TUBE, &format!("{points} {tensors}"), "", fault);
        assert_eq!(called.status, status, "{points} {tensors}: {}{}", called.stdout, called.stderr);
        for part in told {
            assert!(called.stdout.contains(part), "{points} {tensors}: {part}\n{}", called.stdout);
        }
    }
    let place = tempfile::tempdir().unwrap();
    fs::write(place.path().join("height.csv"), "Z,t,u1,u2\n0.5,0,0,0\n").unwrap();
    let call = format!("score {} height.csv", data(TUBE.spec).display());
    refuses(place.path(), &call, &["the 1 column(s) Z are no complete", "R, Z or R, theta, Z"]);
}

/// Lame constants of the block: E = 1e4, nu = 0.3.
const LAMBDA: f64 = 1e4 * 0.3 / (1.3 * 0.4);

#[test]
fn stresses_and_stretches_across_a_plane_are_compared() {
    let plane_strain = "X Y t u1 u2 P11 P12 P21 P22 P33";
    fn with(line: &mut Line, cells: usize, factor: f64) {
        let error = 1.0 + 0.1 * (cells as f64).powi(-2);
        line.insert("P33".into(), factor * LAMBDA * line["J"].ln() * error);
    }
    type Fault = fn(&mut Line, usize, usize);
    let cases: [(&Body, &str, Fault, i32, &str); 6] = [
        (&BLOCK, plane_strain, |line, _, cells| with(line, cells, 1.0), 0, "passed"),
        (
            &BLOCK,
            plane_strain,
            |line, _, cells| with(line, cells, 2.5),
            1,
            "P across the plane has order",
        ),
        (
            &BLOCK,
            plane_strain,
            |line, _, cells| with(line, cells, 0.0),
            0,
            "`P` has zeros across the plane",
        ),
        (&BLOCK, "X Y t u1 u2 P11 P12 P21 P22", none, 0, "`P` has no component across the plane"),
        (
            &PLATE,
            "X Y t u1 u2 F11 F12 F21 F22 F33=F_zz",
            |line, _, cells| set(line, "F_zz", |F| F * (1.0 + 0.1 * (cells as f64).powi(-2))),
            0,
            "passed",
        ),
        (
            &PLATE,
            "X Y t u1 u2 F11 F12 F21 F22 F33=F_zz",
            |line, _, _| set(line, "F_zz", |_| 1.0),
            1,
            "F across the plane has order",
        ),
    ];
    for (body, columns, fault, status, told) in cases {
        let called = scored(body, columns, "", fault);
        assert_eq!(called.status, status, "{columns}: {}{}", called.stdout, called.stderr);
        assert!(called.stdout.contains(told), "{columns}: {told}\n{}", called.stdout);
    }
}

#[test]
fn one_wrong_particle_does_not_pass_and_expected_orders_are_no_laxer() {
    let columns = "X Y t u1 u2 v1 v2 P11 P12 P21 P22";
    /// Changes a component of the first particle.
    fn of_first(line: &mut Line, number: usize, name: &str, by: f64) {
        if number == 0 {
            set(line, name, |value| value + by);
        }
    }
    type Fault = fn(&mut Line, usize, usize);
    let spike: Fault = |line, number, _| of_first(line, number, "u1", 0.02);
    let late: Fault = |line, _, _| set(line, "v1", |v| 1.02 * v);
    let cases: [(&str, Fault, i32, &str); 9] = [
        ("", none, 0, "passed: converges with order 2.00"),
        ("", spike, 1, "but its largest error does not fall"),
        ("", spike, 1, "(particle 0 of"),
        // One particle has wrong stresses: nothing passes, and no motion is called wrong.
        (
            "",
            |line, number, _| of_first(line, number, "P12", 2e3),
            0,
            "verdict: cannot tell: u converges with order 2.00 (L2, finest pair), but the largest error of P does not fall",
        ),
        // Where more is wrong, the verdict is of that.
        (
            "",
            |line, number, _| {
                of_first(line, number, "u1", 0.02);
                set(line, "v1", |v| 1.02 * v);
            },
            1,
            "v has order 0.08 (L2, finest pair)\n",
        ),
        // Of first order at a boundary.
        (
            "",
            |line, number, cells| {
                if number % cells == 0 {
                    set(line, "u1", |u| u + 0.01 * (cells as f64).recip());
                }
            },
            0,
            "largest errors fall with lower orders than means: u",
        ),
        ("", late, 1, "FAILED: u converges with order 2.00, but not all fields do: v has order"),
        (
            "--expect u=2",
            late,
            1,
            "FAILED: u converges with order 2.00, but not all fields do: v has order",
        ),
        ("--expect u=2,v=0 --tolerance 0.3", late, 0, "passed: u converges with order 2.00"),
    ];
    for (options, fault, status, told) in cases {
        let called = scored(&BLOCK, columns, options, fault);
        assert_eq!(called.status, status, "{told}: {}{}", called.stdout, called.stderr);
        assert!(called.stdout.contains(told), "{told}\n{}", called.stdout);
    }
}
