//! Equilibria from rest through `mms`: orders of all degrees in the plane, on a ring and in space, and the exponents of Newton's method.
//!
//! These solve for seconds each and run in release mode, as those in `orders.rs`.

#![allow(clippy::unwrap_used)]

use mmsmith_tests::{at, json};

/// A series of grids for each degree, by the name of its weights.
struct Series {
    call: &'static str,
    cells: &'static [(&'static str, &'static str)],
}

const SERIES: &[Series] = &[
    Series {
        call: "skew-2d",
        cells: &[
            ("linear", "16,32"),
            ("bspline2", "16,32"),
            ("bspline3", "16,32"),
            ("bspline4", "8,16"),
            ("bspline5", "8,16"),
        ],
    },
    // Its motion is a polynomial of third degree along the radius, which splines of that degree have.
    Series { call: "ring-nu", cells: &[("linear", "16,32"), ("bspline2", "16,32")] },
    Series {
        call: "thick-cylinder",
        cells: &[
            ("linear", "16,32"),
            ("bspline2", "16,32"),
            ("bspline3", "16,32"),
            ("bspline4", "12,24"),
            ("bspline5", "12,24"),
        ],
    },
    // Solid, with a turn about the axis.
    Series {
        call: "twisting-cylinder",
        cells: &[
            ("linear", "16,32"),
            ("bspline2", "16,32"),
            ("bspline3", "16,32"),
            ("bspline4", "24,48"),
            ("bspline5", "20,40"),
        ],
    },
    // Clamped around, loaded on both faces.
    Series {
        call: "bulging-plate --load-steps 2",
        cells: &[
            ("linear", "32,64"),
            ("bspline2", "16,32"),
            ("bspline3", "16,32"),
            ("bspline4", "16,32"),
            ("bspline5", "16,32"),
        ],
    },
    // Its layers of twisted material take many cells.
    Series {
        call: "vortex --set A=0.2",
        cells: &[("linear", "32,64"), ("bspline2", "32,64"), ("bspline3", "32,64")],
    },
    Series {
        call: "skew-3d",
        cells: &[("linear", "6,12"), ("bspline2", "4,8"), ("bspline3", "4,8")],
    },
];

#[test]
#[cfg_attr(debug_assertions, ignore = "solves for long; runs in release mode")]
fn orders_are_those_of_the_splines_plus_one_and_newton_converges_quadratically() {
    for Series { call, cells } in SERIES {
        for (degree, (shape, cells)) in (1..).zip(*cells) {
            let options = ["--static", "--shape", shape, "--cells", cells];
            let call: Vec<_> = ["converge"].into_iter().chain(call.split(' ')).collect();
            let found = json(&[&call[..], &options].concat());
            let order = at(&found, &["verdicts", "u", "l2", "finest"]);
            let expected = f64::from(degree + 1);
            assert!((order - expected).abs() <= 0.1, "{call:?} {shape}: {order}");
            let rows = found["rows"].as_array().unwrap();
            let steps = rows.iter().flat_map(|row| row["load_steps"].as_array().unwrap());
            let exponents: Vec<f64> = steps.filter_map(|step| step["exponent"].as_f64()).collect();
            let is_quadratic = exponents.iter().all(|exponent| *exponent >= 1.8);
            assert!(is_quadratic && !exponents.is_empty(), "{call:?} {shape}: {exponents:?}");
        }
    }
}
