//! Values that the oracle computes where care is needed, and inputs that it refuses.
#![allow(clippy::unwrap_used)]

use mmsmith_expr::{Ast, Expr, Function, Graph, Rational};
use mmsmith_oracle::{Oracle, OracleError, Point, Sensitivity, exact, scientific};

fn parsed(graph: &mut Graph, text: &str) -> Expr {
    graph.build(&Ast::parse(text).unwrap(), &mut |graph, name| Ok(graph.symbol(name))).unwrap()
}

/// The settled value of `text` at `x`, to 15 digits, or the message.
fn value(text: &str, x: &str) -> String {
    let mut graph = Graph::new();
    let expr = parsed(&mut graph, text);
    let number = parsed(&mut graph, x);
    let x = graph.symbol("x");
    let values = [(x, graph.as_number(number).unwrap().clone())];
    let point = Point { graph: &graph, definitions: &[], values: &values };
    match Oracle::new(Oracle::USUAL_BITS).unwrap().settle(&point, &[expr], 30) {
        Ok(values) => scientific(&values[0], 15),
        Err(error) => error.to_string(),
    }
}

#[test]
fn digits_survive() {
    assert_eq!(value("log1p(x)", "1e-200"), "1.00000000000000e-200");
    assert_eq!(value("log1p(x) - x", "1e-200"), "-5.00000000000000e-401");
    assert_eq!(value("expm1(x)/x - 1", "1e-150"), "5.00000000000000e-151");
    assert_eq!(value("(1 + x) - 1", "1e-250"), "1.00000000000000e-250");
    assert_eq!(value("1 - cos(x)", "1e-100"), "5.00000000000000e-201");
    assert_eq!(value("sin(Pi*x)", "1e30"), "0");
    assert_eq!(value("cos(-2*Pi*x/3)", "3e20 + 1"), "-5.00000000000000e-1");
    assert_eq!(value("tan(Pi*x)", "1e15 + 1/4"), "1.00000000000000");
    assert_eq!(value("x^(-2/3)", "8"), "2.50000000000000e-1");
    // Less than the last bit of one in 640 bits.
    assert_eq!(value("1 - tanh(x)", "400"), "7.33574916835537e-348");
    assert_eq!(value("atan2(x, -1)", "0"), "3.14159265358979");
    assert_eq!(value("atan2(x, -1)", "-1"), "-2.35619449019234");
}

#[test]
fn what_only_approaches_zero_is_zero() {
    assert_eq!(value("sin(x)^2 + cos(x)^2 - 1", "1/3"), "0");
    assert_eq!(value("sqrt(2)*sqrt(x) - 2", "2"), "0");
}

#[test]
fn what_has_no_value_is_an_error() {
    assert_eq!(value("ln(x)", "-1/2"), "ln is not defined at -5.0000000000000000e-1, in ln(x)");
    assert_eq!(value("log1p(x)", "-1"), "log1p is not defined at -1.0000000000000000, in log1p(x)");
    assert_eq!(value("1/(x - 2)", "2"), "division by zero in 1/(2 - x)");
    assert_eq!(value("tan(Pi*x)", "1/2"), "division by zero in tan(Pi*x)");
    assert_eq!(value("sqrt(x)", "-4"), "power is not defined at -4.0000000000000000, in sqrt(x)");
    assert_eq!(
        value("arcsin(x)", "2"),
        "arcsin is not defined at 2.0000000000000000, in arcsin(x)"
    );
    assert_eq!(value("atan2(x, x)", "0"), "atan2 is not defined at 0, in atan2(x, x)");
    let range = "has a magnitude beyond 2^65536 or below 2^-65536";
    assert_eq!(value("exp(x)", "1e9"), format!("exp(x) {range}"));
    assert_eq!(value("x^1000", "1e200"), format!("x^1000 {range}"));
    assert_eq!(value("x*y", "1"), "nothing says what 'y' is");
}

#[test]
fn definitions_may_follow_each_other_but_not_in_a_circle() {
    let mut graph = Graph::new();
    let [x, y, z] = ["x", "y", "z"].map(|name| graph.symbol(name));
    let y_means = parsed(&mut graph, "x + z");
    let z_means = parsed(&mut graph, "2*x");
    let circle = parsed(&mut graph, "1 + y");
    let values = [(x, exact(0.5).unwrap())];
    let mut oracle = Oracle::new(Oracle::USUAL_BITS).unwrap();
    let definitions = [(y, y_means), (z, z_means)];
    let point = Point { graph: &graph, definitions: &definitions, values: &values };
    assert_eq!(oracle.evaluate(&point, &[y]).unwrap(), [exact(1.5).unwrap()]);
    let sensitivity = Sensitivity::new(&graph, &definitions, &[x], &[y]);
    assert_eq!(sensitivity.evaluate(&mut oracle, &values).unwrap(), [exact(1.5).unwrap()]);
    let definitions = [(y, y_means), (z, circle)];
    let point = Point { graph: &graph, definitions: &definitions, values: &values };
    assert!(matches!(oracle.evaluate(&point, &[y]), Err(OracleError::Circular { .. })));
}

#[test]
fn deep_graphs_and_large_exponents_are_no_trouble() {
    let mut graph = Graph::new();
    let x = graph.symbol("x");
    let mut deep = x;
    for _ in 0..20_000 {
        deep = graph.call(Function::Tanh, &[deep]);
        deep = graph.add(deep, x);
    }
    let power = graph.product([(x, Rational::from_integer(10_000_000.into()))]);
    let values = [(x, exact(0.0).unwrap())];
    let mut oracle = Oracle::new(Oracle::LEAST_BITS).unwrap();
    let point = Point { graph: &graph, definitions: &[], values: &values };
    assert_eq!(oracle.evaluate(&point, &[deep]).unwrap(), [exact(0.0).unwrap()]);
    let error = oracle.evaluate(&point, &[power]).unwrap_err();
    assert_eq!(error.to_string(), "an exponent of 1.0000e7; 1000000 is the limit");
}

#[test]
fn precision_has_limits() {
    assert_eq!(
        Oracle::new(1 << 20).unwrap_err().to_string(),
        "a precision of 1048576 bits; 64 to 2048 are offered"
    );
}
