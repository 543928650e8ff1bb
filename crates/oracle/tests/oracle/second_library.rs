//! The oracle against a second library of arbitrary-precision arithmetic, on random expressions.
#![allow(clippy::unwrap_used)]

use dashu_float::FBig;
use dashu_float::round::mode::HalfEven;
use mmsmith_expr::{Expr, Function, Graph, Node, Rational};
use mmsmith_oracle::{Oracle, OracleError, Point};
use num_traits::{One, Signed, ToPrimitive, Zero};
use proptest::prelude::*;
use std::str::FromStr;

type Float = FBig<HalfEven, 2>;

const BITS: usize = 512;

fn float(value: &Rational) -> Float {
    let integer = |n: &num_bigint::BigInt| {
        dashu_float::DBig::from_str(&n.to_string())
            .unwrap()
            .with_base_and_precision::<2>(BITS)
            .value()
    };
    let numerator: FBig<_, 2> = integer(&value.numer());
    let denominator: FBig<_, 2> = integer(&value.denom());
    numerator.with_rounding::<HalfEven>().with_precision(BITS).value()
        / denominator.with_rounding::<HalfEven>().with_precision(BITS).value()
}

/// The functions that the second library has.
const FUNCTIONS: [Function; 14] = [
    Function::Sin,
    Function::Cos,
    Function::Tan,
    Function::Asin,
    Function::Acos,
    Function::Atan,
    Function::Sinh,
    Function::Cosh,
    Function::Tanh,
    Function::Exp,
    Function::Ln,
    Function::Ln1p,
    Function::Expm1,
    Function::Atan2,
];

/// The value by plain recursion; `None` outside of what the functions are defined for.
fn evaluate(graph: &Graph, expr: Expr, x: &Float) -> Option<Float> {
    let value = |e: Expr| evaluate(graph, e, x);
    let one = float(&Rational::from_integer(1.into()));
    Some(match graph.node(expr) {
        Node::Number(number) => float(number),
        Node::Pi => Float::pi(BITS),
        Node::Symbol(_) => x.clone(),
        Node::Whole(inner) => value(*inner)?,
        Node::Sum { constant, terms } => {
            let mut sum = float(constant);
            for (term, coefficient) in terms {
                sum += float(coefficient) * value(*term)?;
            }
            sum
        }
        Node::Product(factors) => {
            let mut product = one.clone();
            for (base, exponent) in factors {
                let base = value(*base)?;
                let zero = base.repr().significand().is_zero();
                if (zero && exponent.is_negative())
                    || (base < Float::ZERO && !exponent.is_integer())
                {
                    return None;
                }
                let root = match exponent.denom().to_u32()? {
                    1 => base,
                    2 => base.sqrt(),
                    _ if zero => return Some(base),
                    _ => {
                        product *= (base.ln() * float(exponent)).exp();
                        continue;
                    }
                };
                let power = root.powi(exponent.numer().abs().to_i32()?.into());
                if exponent.is_negative() { product /= power } else { product *= power }
            }
            product
        }
        Node::Call(function, arguments) => {
            let argument = value(arguments[0])?;
            match function {
                Function::Sin => argument.sin(),
                Function::Cos => argument.cos(),
                Function::Tan => argument.tan(),
                Function::Asin | Function::Acos
                    if argument.clone() > one || argument < -one.clone() =>
                {
                    return None;
                }
                Function::Asin => argument.asin(),
                Function::Acos => argument.acos(),
                Function::Atan => argument.atan(),
                Function::Sinh => argument.sinh(),
                Function::Cosh => argument.cosh(),
                Function::Tanh => argument.tanh(),
                Function::Exp => argument.exp(),
                Function::Ln if argument <= Float::ZERO => return None,
                Function::Ln => argument.ln(),
                Function::Ln1p if argument <= -one.clone() => return None,
                Function::Ln1p => argument.ln_1p(),
                Function::Expm1 => argument.exp_m1(),
                Function::Atan2 => argument.atan2(&value(arguments[1])?),
                Function::LogRatioSquared
                | Function::LogRatioSlope
                | Function::LogRatioCurvature => {
                    if argument < Float::ZERO {
                        return None;
                    }
                    let two = Float::from(2).with_precision(argument.precision()).value();
                    let root = (argument.clone() * (argument.clone() + two)).sqrt();
                    let theta = (argument.clone() + root.clone()).ln_1p();
                    let slope = || theta.clone() / root.clone() - one.clone();
                    match function {
                        Function::LogRatioSquared => theta.clone() * theta,
                        _ if argument == Float::ZERO => return None,
                        Function::LogRatioSlope => slope(),
                        _ => {
                            let product = (one.clone() + argument.clone()) * slope();
                            -(argument + product) / (root.clone() * root)
                        }
                    }
                }
                // Not among those that are drawn.
                other => panic!("the second library has no {}", other.name()),
            }
        }
    })
}

#[derive(Clone, Debug)]
enum Tree {
    X,
    Pi,
    Number(i32, i32),
    Sum(Box<Tree>, Box<Tree>),
    Product(Box<Tree>, Box<Tree>),
    Power(Box<Tree>, i32, i32),
    Call(usize, Box<Tree>, Box<Tree>),
}

fn trees() -> impl Strategy<Value = Tree> {
    let leaf = prop_oneof![
        3 => Just(Tree::X),
        1 => Just(Tree::Pi),
        2 => (-40..40, 1..30).prop_map(|(a, b)| Tree::Number(a, b)),
    ];
    leaf.prop_recursive(4, 16, 2, |inner| {
        let boxed = inner.prop_map(Box::new);
        prop_oneof![
            (boxed.clone(), boxed.clone()).prop_map(|(a, b)| Tree::Sum(a, b)),
            (boxed.clone(), boxed.clone()).prop_map(|(a, b)| Tree::Product(a, b)),
            (boxed.clone(), -4..5, 1..4).prop_map(|(a, n, d)| Tree::Power(a, n, d)),
            (0..FUNCTIONS.len(), boxed.clone(), boxed).prop_map(|(f, a, b)| Tree::Call(f, a, b)),
        ]
    })
}

fn build(graph: &mut Graph, tree: &Tree) -> Expr {
    match tree {
        Tree::X => graph.symbol("x"),
        Tree::Pi => graph.pi(),
        Tree::Number(a, b) => graph.number(Rational::new((*a).into(), (*b).into())),
        Tree::Sum(a, b) => {
            let (a, b) = (build(graph, a), build(graph, b));
            graph.add(a, b)
        }
        Tree::Product(a, b) => {
            let (a, b) = (build(graph, a), build(graph, b));
            graph.mul(a, b)
        }
        Tree::Power(a, n, d) => {
            let a = build(graph, a);
            graph.product([(a, Rational::new((*n).into(), (*d).into()))])
        }
        Tree::Call(f, a, b) => {
            let function = FUNCTIONS[*f];
            let mut arguments = vec![build(graph, a)];
            if function == Function::Atan2 {
                arguments.push(build(graph, b));
            }
            graph.call(function, &arguments)
        }
    }
}

/// Whether any part is zero.
fn vanishes(graph: &Graph, root: Expr, values: &[(Expr, Rational)], oracle: &mut Oracle) -> bool {
    let parts: Vec<Expr> = graph.reachable(&[root]).into_iter().collect();
    let point = Point { graph, definitions: &[], values };
    oracle.evaluate(&point, &parts).is_ok_and(|values| values.iter().any(Zero::is_zero))
}

/// Whether any part is so large that reduction by pi, or an exponential, takes its digits away.
fn tame(graph: &Graph, root: Expr, values: &[(Expr, Rational)], oracle: &mut Oracle) -> bool {
    let parts: Vec<Expr> = graph.reachable(&[root]).into_iter().collect();
    let point = Point { graph, definitions: &[], values };
    oracle.evaluate(&point, &parts).is_ok_and(|values| {
        let bound = Rational::from_integer(1_000_000.into());
        values
            .iter()
            .all(|v| v.abs() < bound && (v.is_zero() || v.abs() > Rational::one() / &bound))
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn random_expressions(tree in trees(), numerator in -3_000_i32..3_000, denominator in 1_000..2_000) {
        let mut graph = Graph::new();
        let x = graph.symbol("x");
        let expr = build(&mut graph, &tree);
        let exact = Rational::new(numerator.into(), num_bigint::BigInt::from(denominator));
        let values = [(x, exact.clone())];
        let mut oracle = Oracle::new(320).unwrap();
        let point = Point { graph: &graph, definitions: &[], values: &values };
        match oracle.settle(&point, &[expr], 60) {
            Ok(value) if tame(&graph, expr, &values, &mut oracle) => {
                let Some(second) = evaluate(&graph, expr, &float(&exact)) else {
                    // Where the oracle knows that tan(Pi) is zero, the other library has a rounding of
                    // it, which may be negative: a root of it is not defined there.
                    let at_an_edge = vanishes(&graph, expr, &values, &mut oracle);
                    prop_assert!(at_an_edge, "defined by the oracle only: {}", graph.print(expr));
                    return Ok(());
                };
                let difference = second - float(&value[0]);
                let tolerance = float(&Rational::new(1.into(), num_bigint::BigInt::from(10).pow(40)));
                // Zeros of tan(Pi x) are exact on one side only; other values are no smaller than this.
            let scale = float(&(value[0].abs() + Rational::new(1.into(), 1_000_000.into())));
                let small = difference.clone() <= tolerance.clone() * scale.clone()
                    && -difference.clone() <= tolerance * scale;
                prop_assert!(small, "{} at {exact}: off by {difference}", graph.print(expr));
            }
            Ok(_) | Err(OracleError::Range { .. } | OracleError::Unsettled { .. }) => {}
            Err(OracleError::Domain { .. } | OracleError::DivisionByZero { .. }) => {}
            Err(other) => prop_assert!(false, "{other}"),
        }
    }
}
