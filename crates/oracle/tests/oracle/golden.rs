//! The oracle and the library's code against values and sensitivities from an independent computation in 70 digits.
//!
//! `tests/data/golden.json` holds 20 points for each of the two original problems, to 25 digits. The doubles of the code must be within
//! `K 2^-53 (sens + |g|)` of the values, by the sensitivities of that file: the one place where neither side is derived here.
#![allow(clippy::print_stdout, clippy::unwrap_used)]

use mmsmith_expr::{Ast, Expr, Graph, Rational};
use mmsmith_oracle::{Oracle, Point, Sensitivity, exact, scientific, worst_factor};
use mmsmith_solutions::build;
use mmsmith_spec::{Fields, Spec};
use num_traits::Signed;
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

#[derive(Deserialize)]
struct Golden {
    problems: BTreeMap<String, Vec<Case>>,
}

#[derive(Deserialize)]
struct Case {
    class: String,
    X: Vec<f64>,
    t: f64,
    par: BTreeMap<String, f64>,
    out: BTreeMap<String, Value>,
    sens: BTreeMap<String, Value>,
}

fn read(path: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)).unwrap()
}

fn decimal(value: &Value) -> Rational {
    let mut graph = Graph::new();
    let number =
        graph.build(&Ast::parse(value.as_str().unwrap()).unwrap(), &mut |_, _| Err("".into()));
    graph.as_number(number.unwrap()).unwrap().clone()
}

/// The entries of a scalar, a vector or a matrix; the golden stress is the nominal one, the transpose of ours.
fn entries(field: &str, value: &Value) -> Vec<Rational> {
    let rows = match value {
        Value::Array(rows) => rows.clone(),
        scalar => vec![scalar.clone()],
    };
    if field == "P" {
        let n = rows.len();
        return (0..n * n).map(|k| decimal(&rows[k % n][k / n])).collect();
    }
    let row = |value: &Value| match value {
        Value::Array(entries) => entries.iter().map(decimal).collect(),
        scalar => vec![decimal(scalar)],
    };
    rows.iter().flat_map(row).collect()
}

/// Whether `a` is `b` up to a relative `tolerance`; a zero is met exactly.
fn close(a: &Rational, b: &Rational, tolerance: f64) -> bool {
    (a - b).abs() <= b.abs() * exact(tolerance).unwrap()
}

/// The largest admissible factor `K`.
const LARGEST_FACTOR: f64 = 8.0;

/// The problems of the file, and their names in the library.
const PROBLEMS: [(&str, &str); 2] = [("axis-aligned-2d", "axis-aligned"), ("ring-2d", "ring")];

fn golden() -> Golden {
    let golden: Golden = serde_json::from_str(&read("tests/data/golden.json")).unwrap();
    assert!(PROBLEMS.iter().all(|(problem, _)| golden.problems[*problem].len() == 20));
    golden
}

fn of_library(name: &str) -> Spec {
    Spec::parse(&read(&format!("mms-specs/{name}.toml")), name).unwrap()
}

#[test]
fn doubles_of_the_library_including_tiny_amplitude_and_no_lateral_contraction() {
    let golden = golden();
    for (problem, name) in PROBLEMS {
        let spec = of_library(name);
        let mut worst = 0.0_f64;
        for (k, case) in golden.problems[problem].iter().enumerate() {
            let parameters: Vec<f64> = spec.parameters.iter().map(|p| case.par[&p.name]).collect();
            let solution = build::<f64>(name, &parameters).unwrap().unwrap();
            let found = solution.each_field(&case.X, case.t).unwrap();
            assert!(found.len() >= 8, "u, v, a, H, F, J, P, b, and some of them in stages");
            for (letter, found) in &found {
                let field = letter.split(' ').next().unwrap();
                let wanted = entries(field, &case.out[field]);
                let sens = entries(field, &case.sens[field]);
                assert_eq!([found.len(), sens.len()], [wanted.len(); 2], "{letter}");
                for (i, found) in found.iter().enumerate() {
                    let K = worst_factor(*found, &wanted[i], &sens[i]);
                    let stated = scientific(&wanted[i], 25);
                    let class = &case.class;
                    assert!(
                        K <= LARGEST_FACTOR,
                        "{problem}, point {k} ({class}), {letter}[{i}]: {found:?} needs K = {K}, not {stated}",
                    );
                    worst = worst.max(K);
                }
            }
        }
        println!("{problem}: K = {worst:.2} at most");
    }
}

#[test]
fn values_and_sensitivities() {
    let golden = golden();
    for (problem, name) in PROBLEMS {
        let spec = of_library(name);
        let fields = spec.derive().unwrap();
        let all = by_letter(&fields);
        let expressions: Vec<Expr> = all.iter().flat_map(|(_, e)| e.clone()).collect();
        let inputs: Vec<Expr> = fields.inputs.iter().map(|(e, _)| *e).collect();
        let sensitivity =
            Sensitivity::new(&fields.graph, &fields.definitions, &inputs, &expressions);
        let mut oracle = Oracle::new(Oracle::USUAL_BITS).unwrap();
        for (k, case) in golden.problems[problem].iter().enumerate() {
            let parameters = spec.parameters.iter().map(|p| case.par[&p.name]);
            let doubles = case.X.iter().copied().chain([case.t]).chain(parameters);
            let values: Vec<(Expr, Rational)> =
                inputs.iter().copied().zip(doubles.map(|x| exact(x).unwrap())).collect();
            let (graph, definitions) = (&fields.graph, fields.definitions.as_slice());
            let point = Point { graph, definitions, values: &values };
            let mut exact = oracle.settle(&point, &expressions, 40).unwrap().into_iter();
            let mut sens = sensitivity.evaluate(&mut oracle, &values).unwrap().into_iter();
            for (field, _) in &all {
                let wanted = entries(field, &case.out[*field]);
                for (i, (wanted, wanted_sens)) in
                    wanted.iter().zip(entries(field, &case.sens[*field])).enumerate()
                {
                    let (value, sens) = (exact.next().unwrap(), sens.next().unwrap());
                    let context = format!("{problem}, point {k} ({}), {field}[{i}]", case.class);
                    let (found, stated) = (scientific(&value, 25), scientific(wanted, 25));
                    assert!(close(&value, wanted, 1e-24), "{context}: {found} and {stated}");
                    let (found, stated) = (scientific(&sens, 4), scientific(&wanted_sens, 4));
                    assert!(
                        close(&sens, &wanted_sens, 6e-4),
                        "{context}, sensitivity: {found} and {stated}"
                    );
                }
            }
        }
    }
}

/// A point of `tests/data/golden-isochoric.json`, whose stress is the first Piola-Kirchhoff stress.
#[derive(Deserialize)]
struct Isochoric {
    X: Vec<f64>,
    t: f64,
    par: BTreeMap<String, f64>,
    out: BTreeMap<String, Value>,
}

/// Motions that keep the volume, whose values are differences of motions that another program writes out (`tests/python/golden.py`).
#[test]
fn isochoric_motions_have_the_values_of_another_program() {
    let file: Value = serde_json::from_str(&read("tests/data/golden-isochoric.json")).unwrap();
    let problems: BTreeMap<String, Vec<Isochoric>> =
        serde_json::from_value(file["problems"].clone()).unwrap();
    assert_eq!(problems.len(), 3);
    for (name, points) in problems {
        let spec = of_library(&format!("incompressible/{name}"));
        let fields = spec.derive().unwrap();
        let all: Vec<_> =
            by_letter(&fields).into_iter().filter(|(f, _)| !"HJ".contains(f)).collect();
        let expressions: Vec<Expr> = all.iter().flat_map(|(_, e)| e.clone()).collect();
        let mut oracle = Oracle::new(Oracle::USUAL_BITS).unwrap();
        for (k, point) in points.iter().enumerate() {
            let parameters = spec.parameters.iter().map(|p| point.par[&p.name]);
            let doubles = point.X.iter().copied().chain([point.t]).chain(parameters);
            let inputs = fields.inputs.iter().map(|(e, _)| *e);
            let values: Vec<(Expr, Rational)> =
                inputs.zip(doubles.map(|x| exact(x).unwrap())).collect();
            let (graph, definitions) = (&fields.graph, fields.definitions.as_slice());
            let at = Point { graph, definitions, values: &values };
            let mut found = oracle.settle(&at, &expressions, 40).unwrap().into_iter();
            for (field, _) in &all {
                let rows: Vec<Value> = point.out[*field].as_array().unwrap().clone();
                let flat = rows.iter().flat_map(|row| match row {
                    Value::Array(row) => row.clone(),
                    entry => vec![entry.clone()],
                });
                for (i, wanted) in flat.map(|entry| decimal(&entry)).enumerate() {
                    let value = found.next().unwrap();
                    let [own, stated] = [&value, &wanted].map(|number| scientific(number, 25));
                    assert!(
                        close(&value, &wanted, 1e-23),
                        "{name}, point {k}, {field}[{i}]: {own} and {stated}"
                    );
                }
            }
        }
    }
}

fn by_letter(fields: &Fields) -> Vec<(&'static str, Vec<Expr>)> {
    vec![
        ("u", fields.u.clone()),
        ("v", fields.v.clone()),
        ("a", fields.a.clone()),
        ("H", fields.H.concat()),
        ("F", fields.F.concat()),
        ("J", vec![fields.J]),
        ("P", fields.P.concat()),
        ("b", fields.b.clone()),
    ]
}
