//! Differentiation.

use crate::graph::NumberMap;
use crate::{Expr, Function, Graph, Node, Rational};
use num_traits::{One, Signed};

/// Partial derivatives of the expressions of one graph, each found once.
///
/// A derivative that is known in a better form than the rules would give, such as that of the logarithm of a
/// determinant, can be stated with [`Derivatives::define`].
#[derive(Clone, Debug, Default)]
pub struct Derivatives {
    known: NumberMap<(Expr, Expr), Expr>,
    limited: bool,
}

impl Derivatives {
    /// Derivatives that come to an early end, with no meaning, as soon as [`Graph::is_overgrown`]: for text from
    /// anywhere. The caller asks the graph afterwards.
    #[must_use]
    pub fn limited() -> Self {
        Derivatives { limited: true, ..Self::default() }
    }

    /// States that the derivative of `expr` with respect to `variable` is `derivative`.
    pub fn define(&mut self, expr: Expr, variable: Expr, derivative: Expr) {
        self.known.insert((expr, variable), derivative);
    }

    /// The derivative of `expr` with respect to the symbol `variable`, other symbols held fixed.
    pub fn of(&mut self, graph: &mut Graph, expr: Expr, variable: Expr) -> Expr {
        if self.limited && graph.is_overgrown() {
            return Graph::ZERO;
        }
        if expr == variable {
            return Graph::ONE;
        }
        if let Some(&known) = self.known.get(&(expr, variable)) {
            return known;
        }
        let derivative = match graph.node(expr).clone() {
            Node::Number(_) | Node::Pi | Node::Symbol(_) => Graph::ZERO,
            Node::Sum { terms, .. } => {
                let parts: Vec<(Rational, Expr)> = terms
                    .iter()
                    .map(|(term, coefficient)| {
                        (coefficient.clone(), self.of(graph, *term, variable))
                    })
                    .collect();
                graph.sum(parts)
            }
            Node::Product(factors) => {
                let mut parts = Vec::new();
                for (base, exponent) in &factors {
                    let inner = self.of(graph, *base, variable);
                    if inner != Graph::ZERO {
                        let others = factors.iter().filter(|(b, _)| b != base).cloned();
                        let slope = match hyperbolic_cosine(graph, *base) {
                            // `cosh' = tanh cosh`: where both sinh and cosh overflow, their quotient is none any more.
                            Some(x) if exponent.is_negative() => {
                                let tangent = graph.call(Function::Tanh, &[x]);
                                let rate = self.of(graph, x, variable);
                                [
                                    (*base, exponent.clone()),
                                    (graph.mul(tangent, rate), Rational::one()),
                                ]
                            }
                            _ => [(*base, exponent - Rational::one()), (inner, Rational::one())],
                        };
                        let part: Vec<_> = others.chain(slope).collect();
                        parts.push((exponent.clone(), graph.product(part)));
                    }
                }
                graph.sum(parts)
            }
            Node::Call(Function::Atan2, arguments) => self.atan2(graph, &arguments, variable),
            Node::Call(Function::LnOfBoth, arguments) => {
                let change = self.of(graph, arguments[0], variable);
                graph.div(change, arguments[1])
            }
            Node::Call(function, arguments) => {
                let inner = self.of(graph, arguments[0], variable);
                if inner == Graph::ZERO {
                    Graph::ZERO
                } else {
                    let outer = outer_derivative(graph, function, arguments[0]);
                    graph.mul(outer, inner)
                }
            }
            Node::Whole(inner) => {
                let derivative = self.of(graph, inner, variable);
                graph.whole(derivative)
            }
        };
        self.known.insert((expr, variable), derivative);
        derivative
    }

    /// `d atan2(y, x) = (x dy - y dx) / (x^2 + y^2)`.
    fn atan2(&mut self, graph: &mut Graph, arguments: &[Expr], variable: Expr) -> Expr {
        let (y, x) = (arguments[0], arguments[1]);
        let (dy, dx) = (self.of(graph, y, variable), self.of(graph, x, variable));
        let (x_dy, y_dx) = (graph.mul(x, dy), graph.mul(y, dx));
        let numerator = graph.sub(x_dy, y_dx);
        let (xx, yy) = (graph.powi(x, 2), graph.powi(y, 2));
        let denominator = graph.add(xx, yy);
        graph.div(numerator, denominator)
    }
}

/// The argument of a hyperbolic cosine.
fn hyperbolic_cosine(graph: &Graph, expr: Expr) -> Option<Expr> {
    match graph.node(expr) {
        Node::Call(Function::Cosh, arguments) => Some(arguments[0]),
        _ => None,
    }
}

/// The derivative of a function of one argument, at `x`.
fn outer_derivative(graph: &mut Graph, function: Function, x: Expr) -> Expr {
    let one = Graph::ONE;
    let square = graph.powi(x, 2);
    let half = Rational::new((-1).into(), 2.into());
    match function {
        Function::Sin => graph.call(Function::Cos, &[x]),
        Function::Cos => {
            let sine = graph.call(Function::Sin, &[x]);
            graph.neg(sine)
        }
        Function::Tan => {
            let tangent = graph.call(Function::Tan, &[x]);
            let squared = graph.powi(tangent, 2);
            graph.add(one, squared)
        }
        Function::Asin | Function::Acos => {
            // The factors of `1 - x^2` are exact next to one.
            let (below, above) = (graph.sub(one, x), graph.add(one, x));
            let derivative = graph.product([(below, half.clone()), (above, half)]);
            if function == Function::Asin { derivative } else { graph.neg(derivative) }
        }
        Function::Atan => {
            let denominator = graph.add(one, square);
            graph.powi(denominator, -1)
        }
        Function::Sinh => graph.call(Function::Cosh, &[x]),
        Function::Cosh => graph.call(Function::Sinh, &[x]),
        Function::Tanh => {
            // `1 - tanh^2` has no digits left where the tangent is next to one.
            let cosine = graph.call(Function::Cosh, &[x]);
            graph.powi(cosine, -2)
        }
        Function::Exp | Function::Expm1 => graph.call(Function::Exp, &[x]),
        Function::Ln => graph.powi(x, -1),
        Function::Ln1p => {
            let denominator = graph.add(one, x);
            graph.powi(denominator, -1)
        }
        Function::LogRatioSquared => {
            let slope = graph.call(Function::LogRatioSlope, &[x]);
            let shifted = graph.add(one, slope);
            graph.sum([(Rational::from(2), shifted)])
        }
        Function::LogRatioSlope => graph.call(Function::LogRatioCurvature, &[x]),
        Function::LogRatioCurvature => {
            // From z (z + 2) s' = 1 - (1 + z)(1 + s), differentiated once more.
            let slope = graph.call(Function::LogRatioSlope, &[x]);
            let curvature = graph.call(Function::LogRatioCurvature, &[x]);
            let (shifted, two) = (graph.add(one, x), graph.integer(2));
            let product = graph.mul(shifted, curvature);
            let three = Rational::from(3);
            let plain = Rational::one();
            let numerator = graph.sum([(plain.clone(), one), (plain, slope), (three, product)]);
            let denominator = graph.add(x, two);
            let denominator = graph.mul(x, denominator);
            let quotient = graph.div(numerator, denominator);
            graph.neg(quotient)
        }
        // Two arguments: handled by the caller.
        Function::Atan2 | Function::LnOfBoth => Graph::ZERO,
    }
}
