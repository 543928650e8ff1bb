//! Derivatives of every function against differences, those that are stated, and the end of those that grow too much.

#![allow(clippy::unwrap_used)]

use mmsmith_expr::{Dependence, Derivatives, Expr, Function, Graph, Program, Rational};

fn value(graph: &mut Graph, expr: Expr, x: f64) -> f64 {
    let inputs = [(graph.symbol("x"), Dependence::default())];
    Program::lower(graph, &inputs, &[], &[expr]).evaluate(&[x])[0]
}

#[test]
fn every_function_has_the_slope_of_its_values() {
    for (name, function) in Function::names() {
        for point in [0.3, 0.6, 0.9] {
            let mut graph = Graph::new();
            let x = graph.symbol("x");
            // Both arguments change, each in its own way.
            let square = graph.powi(x, 2);
            let shifted = graph.add(x, Graph::ONE);
            let arguments = match function {
                Function::Atan2 => vec![x, square],
                Function::LnOfBoth => vec![x, shifted],
                _ => vec![x],
            };
            let expr = graph.call(function, &arguments);
            let derivative = Derivatives::default().of(&mut graph, expr, x);
            let found = value(&mut graph, derivative, point);
            let mut difference = |h: f64| {
                (value(&mut graph, expr, point + h) - value(&mut graph, expr, point - h))
                    / (2.0 * h)
            };
            // Extrapolated, so that the error is of the fourth order.
            let expected = (4.0 * difference(5e-4) - difference(1e-3)) / 3.0;
            let allowed = 1e-8 * (1.0 + expected.abs());
            assert!(
                (found - expected).abs() < allowed,
                "{name} at {point}: {found}, not {expected}"
            );
        }
    }
}

#[test]
fn a_stated_derivative_is_used_wherever_its_expression_appears() {
    let mut graph = Graph::new();
    let (x, y, g) = (graph.symbol("x"), graph.symbol("y"), graph.symbol("g"));
    let expr = graph.call(Function::Exp, &[x]);
    let mut derivatives = Derivatives::default();
    derivatives.define(expr, x, g);
    assert_eq!(derivatives.of(&mut graph, expr, x), g);
    let product = graph.mul(expr, y);
    let expected = graph.mul(g, y);
    assert_eq!(derivatives.of(&mut graph, product, x), expected);
    assert_eq!(derivatives.of(&mut graph, product, y), expr);
}

#[test]
fn limited_derivatives_end_once_the_graph_has_grown_too_much() {
    let mut graph = Graph::new();
    let x = graph.symbol("x");
    let square = graph.powi(x, 2);
    let double = graph.sum([(Rational::from_integer(2.into()), x)]);
    assert_eq!(Derivatives::limited().of(&mut graph, square, x), double);
    graph.number(Rational::from_integer(num_traits::pow(2.into(), 20_000)));
    assert!(graph.is_overgrown());
    assert_eq!(Derivatives::limited().of(&mut graph, square, x), Graph::ZERO);
    assert_eq!(Derivatives::default().of(&mut graph, square, x), double);
}
