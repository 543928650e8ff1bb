//! Error bounds: those of few operations are known in closed form, and no error is beyond them.

use super::{Program, Row, SIDE, Slot};
use crate::{Ast, Dependence, Graph, Operation, Rational, nearest_f64};
use num_traits::{Signed, Zero};
use proptest::prelude::*;
use std::array;

/// The programs for texts of x, y and z.
fn program(texts: &[&str]) -> Program {
    let mut graph = Graph::new();
    let inputs = ["x", "y", "z"].map(|name| (graph.symbol(name), Dependence::default()));
    let mut build = |text: &&str| {
        let ast = Ast::parse(text).unwrap();
        graph.build(&ast, &mut |g, name| Ok(g.symbol(name))).unwrap()
    };
    let outputs: Vec<_> = texts.iter().map(&mut build).collect();
    Program::lower(&mut graph, &inputs, &[], &outputs)
}

#[test]
fn bounds_of_few_operations() {
    type Bound = fn(f64, f64, f64) -> f64;
    let cases: [(&str, Bound); 15] = [
        ("x", |_, _, _| 0.0),
        ("-x", |_, _, _| 0.0),
        ("1/3", |_, _, _| 0.0),
        ("x + y", |x, y, _| (x + y).abs()),
        ("x - y", |x, y, _| (x - y).abs()),
        ("y*z", |_, y, z| (y * z).abs()),
        ("x/y", |x, y, _| (x / y).abs()),
        // What operands carry goes on as the operation says.
        ("x + y*z", |x, y, z| (y * z).abs() + (x + y * z).abs()),
        ("x - y*z", |x, y, z| (y * z).abs() + (x - y * z).abs()),
        ("(x + y)*(x - z)", |x, y, z| 3.0 * ((x + y) * (x - z)).abs()),
        ("(x + y)/(x - z)", |x, y, z| 3.0 * ((x + y) / (x - z)).abs()),
        ("sqrt(x^2 + y^2)", |x, y, _| {
            let square = x * x + y * y;
            2.0 * square / (2.0 * square.sqrt()) + square.sqrt()
        }),
        ("tan(y*z)", |_, y, z| (y * z).abs() / (y * z).cos().powi(2) + (y * z).tan().abs()),
        ("exp(x*y)", |x, y, _| ((x * y).abs() + 1.0) * (x * y).exp()),
        ("arctan(x + y)", |x, y, _| (x + y).abs() / (1.0 + (x + y).powi(2)) + (x + y).atan().abs()),
    ];
    let places = [[0.3, 0.7, -1.1], [2.0, -0.5, 0.25], [-1.5, -0.75, 3.0], [1e-8, 0.6, 1.3]];
    // All in one program, so that outputs and places have to be told apart.
    let texts = cases.map(|(text, _)| text);
    let inputs: [Row; 3] = array::from_fn(|input| array::from_fn(|k| places[k % 4][input]));
    let bounds = program(&texts).error_bounds(&inputs);
    assert_eq!(bounds.len(), cases.len());
    for ((text, bound), found) in cases.iter().zip(&bounds) {
        for (place, found) in places.iter().cycle().zip(found) {
            let expected = bound(place[0], place[1], place[2]);
            let allowed = 1e-5 * expected.abs();
            assert!(
                (found - expected).abs() <= allowed,
                "{text} at {place:?}: {found:e}, not {expected:e}"
            );
        }
    }
}

/// The exact outputs of a program without roots and function values.
fn exact(program: &Program, inputs: &[f64]) -> Option<Vec<Rational>> {
    let mut values: Vec<Rational> = Vec::new();
    for operation in program.operations() {
        let at = |slot: Slot| &values[slot.index()];
        let value = match operation {
            // Numbers count as exact, rounded as they are.
            Operation::Number(number) => Rational::from_float(nearest_f64(number))?,
            Operation::Input(index) => Rational::from_float(inputs[*index])?,
            Operation::Add(a, b) => at(*a) + at(*b),
            Operation::Sub(a, b) => at(*a) - at(*b),
            Operation::Mul(a, b) => at(*a) * at(*b),
            Operation::Div(_, b) if at(*b).is_zero() => return None,
            Operation::Div(a, b) => at(*a) / at(*b),
            Operation::Neg(a) => -at(*a),
            _ => return None,
        };
        values.push(value);
    }
    Some(program.outputs().iter().map(|slot| values[slot.index()].clone()).collect())
}

/// Sums, products and quotients.
fn expression() -> impl Strategy<Value = String> {
    let leaf = prop::sample::select(&["x", "y", "z", "2", "3/4"][..]).prop_map(str::to_owned);
    leaf.prop_recursive(4, 24, 3, |inner| {
        let pair = (inner.clone(), inner.clone());
        prop_oneof![
            pair.clone().prop_map(|(a, b)| format!("({a}) + ({b})")),
            pair.clone().prop_map(|(a, b)| format!("({a}) - ({b})")),
            pair.clone().prop_map(|(a, b)| format!("({a})*({b})")),
            pair.prop_map(|(a, b)| format!("({a})/(1 + ({b})^2)")),
        ]
    })
}

proptest! {
    #[test]
    fn no_error_is_beyond_its_bound(text in expression(), x in 0.1..2.0, y in -1.5..1.5, z in -2.0..2.0) {
        let program = program(&[&text]);
        let place = [x, y, z];
        if let Some(exact) = exact(&program, &place) {
            let found = program.evaluate(&place)[0];
            let [bound] = program.error_bounds(&place.map(|input| [input; SIDE]))[..] else { panic!() };
            let bound = bound[0] * f64::EPSILON / 2.0;
            let error = (Rational::from_float(found).unwrap() - &exact[0]).abs();
            // To first order: there are at most some dozens of operations.
            let allowed = Rational::from_float(bound * (1.0 + 1e-12)).unwrap();
            prop_assert!(error <= allowed, "{}: {} is off by more than {:e}", text, found, bound);
        }
    }
}
