//! Every solution of the library has a verdict: simulated in the total frame on a few grids, each of its fields converges at
//! the order that theory promises.
//!
//! With cubic splines and a composition of fourth order that is 4 for displacement and velocity and 3 for F and P. Where the
//! splines hold the motion itself, as a rigid one or the cubic profile of the ring, the error is that of time alone, and
//! all fields have order 4. Beside a given traction velocities have a layer of order 3, one cell wide, which L2 sees with order
//! 3.5; beside a side whose motion is given, where the exact motion meets one with the error of time, the largest errors of F and P
//! have an order below 4. Quadratic splines, for the vortex that needs fine grids for its own sake, have 3 and 2; quintic ones 6 and 5, but
//! for the largest errors of v and P, which the start leaves beside the sides: it is nearest in the mean of squares.
//!
//! These simulate for seconds each and run in release mode, as those in `orders.rs`.

#![allow(clippy::unwrap_used)]

use mmsmith_solutions::CATALOGUE;
use mmsmith_tests::{json, mms};

/// A solution, options beside the usual ones, and the orders that are expected in `mms converge --expect`'s words.
struct Series {
    name: &'static str,
    options: &'static str,
    expected: &'static str,
}

const SMOOTH: &str = "u=4,v=4,F=3,P=3";

const SERIES: &[Series] = &[
    Series { name: "axis-aligned", options: "--cells 8,16,32", expected: SMOOTH },
    Series { name: "axis-aligned-1d", options: "--cells 16,32,64", expected: SMOOTH },
    Series {
        name: "axis-aligned-3d",
        options: "--cells 8,12,16 --periods 0.25",
        expected: "u.linf=4,u.l2=4,v=4,F=3,P=3",
    },
    Series { name: "bar", options: "--cells 16,32,64", expected: SMOOTH },
    Series { name: "ring", options: "--cells 8,16,24 --cfl 0.2", expected: "u=4,v=4,F=4,P=4" },
    Series {
        name: "ring",
        options: "--cells 8,16,24 --cfl 0.2 --extent full",
        expected: "u=4,v=4,F=4,P=4",
    },
    Series {
        name: "ring-nu",
        options: "--cells 16,24,32 --cfl 0.2",
        expected: "u=4,v.linf=3,v.l2=3.5,F=4,P=4",
    },
    Series {
        name: "sphere-shell",
        options: "--cells 8,12,16 --cfl 0.291 --periods 0.5",
        expected: "u=4,v.linf=3,v.l2=3.5,F.l2=4,F.l1=4,P.l2=4,P.l1=4",
    },
    Series {
        name: "vortex",
        options: "--cells 16,24,32 --cfl 0.2 --set A=0.2 --periods 0.25 --shape bspline2",
        expected: "u=3,v=3,F=2,P=2",
    },
    Series {
        name: "shear-wave",
        options: "--cells 16,24,32 --cfl 0.3 --periods 0.25",
        expected: SMOOTH,
    },
    Series {
        name: "rigid-motion",
        options: "--cells 8,16,32 --cfl 0.3",
        expected: "u=4,v=4,F.l2=4,F.l1=4,P=4",
    },
    Series { name: "skew-2d", options: "--cells 8,16,24 --cfl 0.3", expected: SMOOTH },
    Series {
        name: "skew-2d",
        options: "--cells 16,24 --cfl 0.1 --periods 0.25 --shape bspline5",
        expected: "u=6,v.l1=6,F=5,P.l2=5,P.l1=5",
    },
    Series { name: "skew-2d-rotating", options: "--cells 8,16,24 --cfl 0.3", expected: SMOOTH },
    Series {
        name: "swirl",
        options: "--cells 16,24,32 --cfl 0.3 --periods 0.25",
        expected: SMOOTH,
    },
    Series {
        name: "torsion",
        options: "--cells 4,6,8 --cfl 0.1 --periods 0.25",
        expected: "u.linf=4,u.l2=4,v.linf=4,v.l2=4,F=3,P=3",
    },
    Series {
        name: "skew-3d",
        options: "--cells 6,8,12 --cfl 0.3 --periods 0.15",
        expected: "u=4,v.linf=4,v.l1=4,F=3,P.l2=3,P.l1=3",
    },
];

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn every_field_of_every_solution_has_its_order() {
    for solution in CATALOGUE {
        let has_series = SERIES.iter().any(|series| series.name == solution.name);
        assert!(has_series, "{}", solution.name);
    }
    for Series { name, options, expected } in SERIES {
        let shape = if options.contains("--shape") { "" } else { "--shape bspline3" };
        let call = format!(
            "converge {name} --frame total --cfl-speed p-wave {shape} {options} --expect {expected}"
        );
        // Another status than 0 says that an order is not the expected one, and is shown with the verdicts.
        let result = json(&call.split_whitespace().collect::<Vec<_>>());
        for field in ["u", "v", "F", "P"] {
            let verdicts = result["verdicts"][field].as_object().unwrap();
            let judged: Vec<_> = verdicts.values().map(|verdict| &verdict["passed"]).collect();
            assert!(judged.iter().any(|passed| **passed == true), "{name}, {field}: {judged:?}");
            assert!(judged.iter().all(|passed| **passed != false), "{name}, {field}: {judged:?}");
        }
    }
}

/// The motion of the shell in the library is radial, so that most terms of gradients and forces vanish there. In this one they do
/// not, and any that is wrong leaves an error that does not depend on the grid.
#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn a_shell_converges_under_a_motion_that_is_not_radial() {
    let call = "converge tests/data/specs/shell-triaxial.toml --frame total --shape bspline3 --cells 5,10 --cfl 0.2 \
                --cfl-speed p-wave --periods 0.1";
    let result = json(&call.split_whitespace().collect::<Vec<_>>());
    for (field, least) in [("u", 4.0), ("v", 4.0), ("F", 3.0), ("P", 3.0)] {
        for norm in ["linf", "l2", "l1"] {
            let order = result["orders"][field][norm]["local"][0].as_f64().unwrap();
            assert!(order > least, "{field} {norm}: {order}");
        }
    }
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn splines_in_the_total_frame_are_expected_to_have_their_order_without_asking() {
    let call = "converge axis-aligned-1d --frame total --cells 16,32,64 --shape";
    for (options, expected) in [
        ("bspline2 --layout gauss", 3.0),
        ("bspline3", 4.0),
        ("bspline4 --layout gauss --composition 6", 5.0),
        ("bspline5 --composition 6 --cfl 0.2", 6.0),
    ] {
        let call: Vec<_> = call.split(' ').chain(options.split(' ')).collect();
        let verdict = &json(&call)["verdicts"]["u"]["l2"];
        assert_eq!((&verdict["expected"], &verdict["passed"]), (&expected.into(), &true.into()));
    }
    // Neither a lattice with an even degree nor lumped masses let the splines have theirs.
    for options in ["bspline2", "bspline3 --mass lumped"] {
        let call: Vec<_> = call.split(' ').chain(options.split(' ')).collect();
        assert!(json(&call)["verdicts"]["u"]["l2"]["expected"].is_null(), "{options}");
    }
}

#[test]
fn the_updated_frame_names_the_frame_that_runs_a_solution() {
    for (name, part) in [
        (
            "skew-2d",
            "prescribed-motion on X-lower in the updated Lagrangian formulation; the total Lagrangian one does: --formulation total-lagrangian --shape bspline3",
        ),
        (
            "ring-nu",
            "prescribed-traction on inner in the updated Lagrangian formulation; the total Lagrangian one does: --formulation total-lagrangian --shape bspline3",
        ),
        (
            "sphere-shell",
            "prescribed-traction on inner in the updated Lagrangian formulation; the total Lagrangian one does: --formulation total-lagrangian --shape bspline3",
        ),
    ] {
        let updated = ["run", name, "--cells", "8", "--formulation", "updated-lagrangian"];
        let outcome = mms().args(updated).output().unwrap();
        let message = String::from_utf8(outcome.stderr).unwrap();
        assert_eq!(outcome.status.code(), Some(2), "{message}");
        assert!(message.contains(part), "{message}");
        // And what it names does run.
        let said = message.split("the total Lagrangian one does: ").nth(1).unwrap();
        let options = said.split_whitespace().chain(["--cells", "4", "--cfl", "0.1"]);
        let outcome = mms().args(["run", name]).args(options).output().unwrap();
        assert_eq!(outcome.status.code(), Some(0), "{}", String::from_utf8_lossy(&outcome.stderr));
    }
}
