//! Materials with memory, from specification to orders, through `mms`.

#![allow(clippy::unwrap_used)]

use mmsmith_tests::{json_as_judged, mms, outcome};
use serde_json::Value;

/// A series of grids, and the least and the largest order of errors on its finest pair.
struct Series {
    call: &'static str,
    cells: &'static str,
    /// A field, or an internal variable.
    of: &'static str,
    order: [f64; 2],
}

const SERIES: &[Series] = &[
    Series {
        call: "bar-j2 --shape bspline2 --formulation total-lagrangian --periods 0.5",
        cells: "32,64,128",
        of: "P",
        order: [1.95, 2.05],
    },
    Series {
        call: "bar-j2 --shape bspline2 --formulation total-lagrangian --periods 0.5",
        cells: "32,64,128",
        of: "alpha",
        order: [1.95, 2.05],
    },
    Series {
        call: "bar-kelvin-voigt --shape gimp --cfl 0.05 --periods 0.5",
        cells: "8,16,32",
        of: "u",
        order: [1.9, 2.1],
    },
    // The usual step follows the viscosity, whose limit falls with the square of the cells.
    Series {
        call: "bar-kelvin-voigt --shape gimp --periods 0.2",
        cells: "128,256",
        of: "u",
        order: [1.9, 2.1],
    },
    Series {
        call: "bar-kelvin-voigt --formulation total-lagrangian --shape bspline4 --periods 0.2",
        cells: "128,256",
        of: "u",
        order: [3.0, 4.0],
    },
    Series {
        call: "block-graded --shape gimp --periods 0.5",
        cells: "16,32",
        of: "u",
        order: [1.9, 2.1],
    },
    Series {
        call: "block-warm --shape gimp --periods 0.5",
        cells: "16,32",
        of: "u",
        order: [1.9, 2.1],
    },
    Series {
        call: "bar-own-law --shape gimp --periods 0.5",
        cells: "16,32,64",
        of: "u",
        order: [1.9, 2.1],
    },
    Series {
        call: "block-maxwell --shape gimp --periods 0.25",
        cells: "16,32",
        of: "u",
        order: [1.85, 2.15],
    },
];

fn error(row: &Value, of: &str) -> f64 {
    let errors = &row["errors"];
    let norms = if of == "alpha" { &errors["internal"][of] } else { &errors[of] };
    norms["l2"].as_f64().unwrap()
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn orders_of_laws_with_memory_are_those_of_their_steps() {
    for Series { call, cells, of, order } in SERIES {
        let mut arguments: Vec<&str> = ["converge"].into_iter().chain(call.split(' ')).collect();
        arguments.extend(["--cells", cells]);
        let found = json_as_judged(&arguments);
        let rows = found["rows"].as_array().unwrap();
        let [.., coarse, fine] = rows.as_slice() else { panic!("{call}: too few rows") };
        let measured = (error(coarse, of) / error(fine, of)).log2();
        assert!((order[0]..=order[1]).contains(&measured), "{call}: {of} has order {measured:.3}");
    }
}

#[test]
#[cfg_attr(debug_assertions, ignore = "computes for long; runs with the release build of mms")]
fn checks_of_laws_with_memory_pass_and_tell_where_bodies_flow() {
    let told = [
        ("bar-j2", "all of 200 particles flow from the start to the end"),
        ("block-j2", "all of 200 particles flow from the start to the end"),
        ("ring-j2", "0 flow from the start, 200 begin later"),
        ("ring-simo", "tables within"),
        ("block-maxwell", "tables within"),
        ("bar-own-law", "tables within"),
        ("bar-kelvin-voigt", "passed"),
        ("block-graded", "passed"),
        ("block-warm", "passed"),
    ];
    for (name, expected) in told {
        let (status, out, errors) = outcome(mms().args(["check", name, "--points", "8"]));
        assert_eq!(status, Some(0), "{name}: {out}{errors}");
        assert!(out.contains(expected), "{name}: {out}");
    }
}

#[test]
fn a_front_with_linear_hardening_is_not_judged_and_the_reason_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("bar.toml");
    let text = std::fs::read_to_string(
        mmsmith_tests::workspace().join("mms-specs/with-memory/bar-j2.toml"),
    );
    // Without the start on the yield surface a front runs through the bar.
    let text = text.unwrap().replace("on-yield = true", "on-yield = false");
    let text = text.replace("(B*X + A*sin(Pi*X))*r", "A*sin(Pi*X)*r");
    std::fs::write(&file, text).unwrap();
    let file = file.to_str().unwrap();
    let found = json_as_judged(&[
        "converge",
        file,
        "--cells",
        "8,16",
        "--shape",
        "bspline2",
        "--formulation",
        "total-lagrangian",
        "--periods",
        "0.5",
        "--expect",
        "u=2",
    ]);
    assert!(found["passed"].is_null(), "{found}");
    assert!(found["not_judged"].as_str().unwrap().contains("jumps"), "{found}");
}

#[test]
fn fields_that_no_formula_has_are_refused_with_the_way_out() {
    let call = ["gen", "block-j2", "--target", "moose", "--out", "nowhere"];
    let (status, _, errors) = outcome(mms().args(call));
    assert_eq!(status, Some(2), "{errors}");
    assert!(errors.contains("history") && errors.contains("mms eval"), "{errors}");
}
