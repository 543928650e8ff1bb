//! Equilibrium from rest: what is said and written, and what is refused.

use std::path::Path;

use crate::command::{mms, read_json, refuses};

#[test]
fn a_motion_is_held_at_a_moment_and_newton_converges_quadratically() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let called = mms(at, "run skew-2d --static --cells 8 --shape bspline2 --json made.json");
    assert_eq!(called.status, 0, "{}", called.stderr);
    for expected in ["at 0.25 periods with b - a", "status: ok", "converged quadratically"] {
        assert!(called.stdout.contains(expected), "{}", called.stdout);
    }
    let made = read_json(&at.join("made.json"));
    assert_eq!(made["settings"]["moment"], 0.25);
    let step = &made["result"]["load_steps"][0];
    assert_eq!((&step["factor"], &step["factors"]), (&1.0.into(), &"cholesky".into()));
    assert!(step["exponent"].as_f64().unwrap() >= 1.8, "{step}");
    assert!(step["residuals"].as_array().unwrap().len() >= 4, "{step}");
}

#[test]
fn orders_are_judged_by_theory_and_by_what_is_asked_for() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let series = "converge skew-2d --static --shape linear --cells 8,16,32 --csv made.csv";
    let called = mms(at, series);
    assert_eq!(called.status, 0, "{}{}", called.stdout, called.stderr);
    assert!(called.stdout.contains("passed, asymptotic"), "{}", called.stdout);
    let sheet = std::fs::read_to_string(at.join("made.csv")).unwrap();
    assert_eq!(sheet.lines().count(), 4, "{sheet}");
    let called = mms(at, "converge skew-2d --static --shape linear --cells 8,16 --expect u=3");
    assert_eq!(called.status, 1, "{}", called.stdout);
    assert!(called.stdout.contains("FAILED"), "{}", called.stdout);
}

#[test]
fn the_equilibrium_is_written_for_viewers_and_scored_like_that_of_another_solver() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let called = mms(at, "run skew-2d --static --cells 8 --vtk frames --json made.json");
    assert_eq!(called.status, 0, "{}", called.stderr);
    assert!(called.stdout.contains("skew-2d.pvd"), "{}", called.stdout);
    let called = mms(at, "score skew-2d frames --cells 8 --json scored.json");
    let scored = read_json(&at.join("scored.json"));
    let made = read_json(&at.join("made.json"));
    for field in ["u", "F", "P"] {
        let own = made["result"]["errors"][field]["linf"].as_f64().unwrap();
        let found = scored["rows"][0]["errors"][field]["linf"].as_f64();
        let is_same = found.is_some_and(|found| (found / own - 1.0).abs() < 1e-6);
        assert!(is_same, "{field}: {found:?} {own} {}{}", called.stdout, called.stderr);
    }
}

#[test]
fn kept_equilibria_are_read_and_not_solved_again() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let rows = |cells: &str, more: &str| {
        let options = format!("--static --shape linear --cells {cells} {more} --json made.json");
        let called = mms(at, &format!("converge skew-2d {options}"));
        assert_eq!(called.status, 0, "{}", called.stderr);
        read_json(&at.join("made.json"))["rows"].as_array().unwrap().clone()
    };
    let first = rows("8,16", "--out kept");
    let second = rows("8,16,32", "--out kept");
    // With the time that they took at first.
    assert_eq!(first[..], second[..2]);
    let lasting = |row: &serde_json::Value| {
        let mut row = row.clone();
        row.as_object_mut().unwrap().remove("wall_s").unwrap();
        row
    };
    let whole = rows("8,16,32", "--threads 1");
    assert!(whole.iter().map(lasting).eq(second.iter().map(lasting)), "{whole:?}");
}

#[test]
fn what_does_not_move_is_solved_from_rest_unless_a_run_through_time_is_asked_for() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../spec/tests/data/ok/static-bend.toml");
    let run = |options: &str| {
        let called = mms(at, &format!("run {} --cells 4 {options}", file.display()));
        assert_eq!(called.status, 0, "{options}: {}", called.stderr);
        called.stdout
    };
    for options in ["", "--static", "--load-steps 3"] {
        assert!(run(options).contains("equilibrium from rest by Newton's method, bspline3"));
    }
    for options in ["--dynamic", "--cfl 0.2", "--composition 4"] {
        assert!(run(options).contains("steps of dt"), "{options}");
    }
}

#[test]
fn a_load_that_is_not_reached_says_where_and_what_to_write() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    // A bar that is nearly folded on one half, and beyond that on cells that cannot follow it.
    let text = "name = 'folded'\ntitle = 'Folded'\ncoordinates = 'cartesian'\ndimension = 1\n\
        boundary = [{ surface = 'X-lower', condition = 'prescribed-motion' }, { surface = 'X-upper', condition = 'prescribed-motion' }]\n\
        [parameters]\nA = { default = 0.001, range = '> 0', unit = '1', description = 'amplitude' }\n\
        mu = { default = 1000, range = '> 0', unit = 'Pa', description = 'shear modulus' }\n\
        lambda = { default = 1000, range = '> 0', unit = 'Pa', description = 'first Lame constant' }\n\
        rho0 = { default = 2, range = '> 0', unit = 'kg/m^3', description = 'reference density' }\n\
        [displacement]\nX = 'A*X + log(cosh(40*X - 20))/40'\n[material]\nlaw = 'linear-elastic'\nlambda = 'lambda'\nmu = 'mu'\n\
        [domain]\nshape = 'box'\nlower = [0]\nupper = [1]\n";
    std::fs::write(at.join("folded.toml"), text).unwrap();
    let called = mms(at, "run folded.toml --static --cells 4 --json made.json");
    assert_eq!(called.status, 1, "{}{}", called.stdout, called.stderr);
    for expected in ["NOT REACHED: load factor", "J = ", "mms run folded.toml --static --cells 4"] {
        assert!(called.stdout.contains(expected), "{}", called.stdout);
    }
    let made = read_json(&at.join("made.json"));
    assert!(made["passed"] == false && made["result"]["errors"].is_null(), "{made}");
}

#[test]
fn options_without_a_meaning_are_refused_by_their_names() {
    let place = tempfile::tempdir().unwrap();
    for (call, expected) in [
        ("run skew-2d --static --cfl 0.2", "--cfl: an equilibrium from rest has no steps in time"),
        ("run skew-2d --static --integrator usl", "leave --integrator out"),
        ("run skew-2d --static --shape gimp", "--shape: an equilibrium"),
        ("run skew-2d --static --checkpoint kept", "leave --checkpoint out"),
        ("converge skew-2d --static --cells 8 --cfls 0.1,0.2", "leave --cfls out"),
        (
            "run skew-2d --load-steps 4",
            "--load-steps: only an equilibrium from rest has it; add --static",
        ),
        ("run skew-2d --moment 0.5", "add --static"),
        ("run skew-2d --static --dynamic", "cannot be used with"),
    ] {
        refuses(place.path(), call, &[expected]);
    }
}

/// A static solution between these sides: its coordinates, displacement, domain, and conditions by surface.
fn stated(
    coordinates: (&str, usize),
    displacement: &[&str],
    law: &str,
    domain: &str,
    sides: &[(&str, &str)],
) -> String {
    let (coordinates, dimension) = coordinates;
    let mut text = format!(
        "name = 'made'\ntitle = 'made'\ncoordinates = '{coordinates}'\ndimension = {dimension}\n[parameters]\nA = {{ default = 0.1 }}\n\
         E = {{ default = 1000 }}\nnu = {{ default = 0.3 }}\nrho0 = {{ default = 2 }}\n[displacement]\n{}\n[material]\nlaw = '{law}'\n\
         [domain]\n{domain}\n",
        displacement.join("\n")
    );
    for (surface, conditions) in sides {
        text += &format!("[[boundary]]\nsurface = '{surface}'\n{conditions}\n");
    }
    text
}

/// The strain of a body at rest is zero but for rounding, which is no other equilibrium.
#[test]
fn a_body_at_rest_under_its_initial_stress_is_reached() {
    let place = tempfile::tempdir().unwrap();
    let file = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../tests/data/specs/told/prestress-at-rest.toml");
    let called = mms(place.path(), &format!("converge {} --cells 4,8", file.display()));
    assert_eq!(called.status, 0, "{}{}", called.stdout, called.stderr);
    assert!(!called.stdout.contains("NOT REACHED"), "{}", called.stdout);
    let moving = "converge swirl --static --cells 4,8 --expect v=2";
    refuses(place.path(), moving, &["no velocity v", "u, F and P"]);
}

#[test]
fn bodies_that_nothing_holds_have_the_orders_of_held_ones() {
    const TRACTION: &str = "condition = 'prescribed-traction'";
    const ROLLER: &str = "normal = 'prescribed-motion'\ntangential = 'prescribed-traction'";
    let square = ["X = 'A*sin(2*X)*Y'", "Y = 'A*X*Y^2'"];
    let sides = ["X-lower", "X-upper", "Y-lower", "Y-upper"];
    let all = sides.map(|side| (side, TRACTION));
    let mut on_roller = all;
    on_roller[2].1 = ROLLER;
    let unit = "shape = 'box'\nlower = [0, 0]\nupper = [1, 1]";
    let rims = [("inner", TRACTION), ("outer", TRACTION)];
    let cases: [(String, usize); 4] = [
        (stated(("cartesian", 2), &square, "neo-hookean", unit, &all), 3),
        (stated(("cartesian", 2), &square, "neo-hookean", unit, &on_roller), 1),
        (
            stated(
                ("cartesian", 1),
                &["X = '-A*X + A/5*sin(3*X)'"],
                "neo-hookean",
                "shape = 'box'\nlower = [0]\nupper = [1]",
                &all[..2],
            ),
            1,
        ),
        (
            stated(
                ("polar", 2),
                &["R = 'A/R'"],
                "neo-hookean",
                "shape = 'annulus'\ninner = 1\nouter = 2",
                &rims,
            ),
            3,
        ),
    ];
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    for (text, held) in cases {
        std::fs::write(at.join("made.toml"), &text).unwrap();
        let called =
            mms(at, "converge made.toml --static --cells 8,16 --shape bspline2 --json made.json");
        assert_eq!(called.status, 0, "{text}{}{}", called.stdout, called.stderr);
        assert!(called.stdout.contains("free to move as a whole"), "{}", called.stdout);
        let made = read_json(&at.join("made.json"));
        assert_eq!(made["rows"][0]["held"].as_array().unwrap().len(), held, "{text}");
        let order = made["orders"]["u"]["l2"]["fit"].as_f64().unwrap();
        assert!((2.7..3.3).contains(&order), "{order}\n{text}");
    }
}

#[test]
fn a_state_that_is_not_the_exact_one_is_not_ok() {
    let bar = "shape = 'box'\nlower = [0]\nupper = [1]";
    let sides = [
        ("X-lower", "condition = 'prescribed-motion'"),
        ("X-upper", "condition = 'prescribed-traction'"),
    ];
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    for (law, motion, said) in [
        // Under pressure the stress of this law falls again, so that two strains have the same.
        ("st-venant-kirchhoff", "X = '-0.58*X - 0.02*X^2'", "another equilibrium"),
        ("neo-hookean", "X = '-1.2*X - 0.02*X^2'", "the exact state is turned inside out"),
    ] {
        let text = stated(("cartesian", 1), &[motion], law, bar, &sides);
        std::fs::write(at.join("made.toml"), &text).unwrap();
        let called = mms(at, "run made.toml --static --cells 8");
        assert_eq!(called.status, 1, "{text}{}{}", called.stdout, called.stderr);
        let is_said = called.stdout.contains("NOT REACHED") && called.stdout.contains(said);
        assert!(is_said && !called.stdout.contains("status: ok"), "{}", called.stdout);
        assert!(!called.stdout.contains("--load-steps"), "{}", called.stdout);
    }
}

/// Each level begins at the equilibrium of the one before, and ends where a run from rest does.
#[test]
fn load_levels_follow_each_other_to_the_states_of_single_runs() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let l2 = |row: &serde_json::Value, field: &str| row["errors"][field]["l2"].as_f64().unwrap();
    for (line, name, single, values) in [
        ("skew-2d --cells 6", "A", "--set A=", ["0.02", "0.06", "0.1"]),
        ("thick-cylinder --cells 4", "moment", "--moment ", ["0.3", "0.35", "0.4"]),
    ] {
        let along = format!("--along {name}={}", values.join(","));
        let called = mms(at, &format!("run {line} --static {along} --json path.json"));
        assert_eq!(called.status, 0, "{}{}", called.stdout, called.stderr);
        let path = read_json(&at.join("path.json"));
        let rows = path["rows"].as_array().unwrap();
        assert_eq!(rows.len(), values.len());
        for (row, value) in rows.iter().zip(values) {
            let call = format!("run {line} --static {single}{value} --json alone.json");
            assert_eq!(mms(at, &call).status, 0);
            let alone = read_json(&at.join("alone.json"))["result"].clone();
            for field in ["u", "F", "P"] {
                let quotient = l2(row, field) / l2(&alone, field);
                assert!((quotient - 1.0).abs() < 1e-6, "{name} = {value}, {field}: {quotient}");
            }
        }
        // Nearer to the equilibrium than the undeformed body is.
        let first =
            |row: &serde_json::Value| row["load_steps"][0]["residuals"][1].as_f64().unwrap();
        let alone = read_json(&at.join("alone.json"))["result"].clone();
        assert!(first(&rows[2]) < first(&alone), "{rows:?}");
    }
    // The body is at rest in the second one.
    let called = mms(at, "run thick-cylinder --cells 4 --static --along moment=0.05,0.25");
    assert_eq!(called.status, 0, "{}{}", called.stdout, called.stderr);
    // The level that is not reached ends the path.
    let bar = "shape = 'box'\nlower = [0]\nupper = [1]";
    let sides = [
        ("X-lower", "condition = 'prescribed-motion'"),
        ("X-upper", "condition = 'prescribed-traction'"),
    ];
    let motion = ["X = '-A*X - 0.02*X^2'"];
    let text = stated(("cartesian", 1), &motion, "neo-hookean", bar, &sides);
    std::fs::write(at.join("made.toml"), text).unwrap();
    let called = mms(at, "run made.toml --static --cells 6 --along A=0.1,1.2,0.2 --json path.json");
    assert_eq!(called.status, 1, "{}", called.stdout);
    assert!(called.stdout.contains("NOT REACHED"), "{}", called.stdout);
    assert_eq!(read_json(&at.join("path.json"))["rows"].as_array().unwrap().len(), 2);
    for (call, words) in [
        ("thick-cylinder --static --cells 4 --along Ri=0.5,0.6", &["Ri = 0.6", "one body"][..]),
        ("skew-2d --static --along B=1,2", &["--along B=1"]),
        ("skew-2d --static --along A=0.1,x", &["'x' is not a number"]),
        ("skew-2d --along A=0.1,0.2", &["--along", "add --static"]),
        ("skew-2d --static --moment 0.1 --along moment=0.1,0.2", &["leave --moment out"]),
    ] {
        refuses(at, &format!("run {call}"), words);
    }
}
