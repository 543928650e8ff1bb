//! Differentiation.

use crate::graph::NumberMap;
use crate::{Expr, Function, Graph, Node, Rational};
use num_traits::{One, Signed, Zero};

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
                        if let Some(whole) = self.of_quotient(
                            graph,
                            (*base, exponent),
                            inner,
                            others.clone(),
                            variable,
                        ) {
                            self.known.insert((expr, variable), whole);
                            return whole;
                        }
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
            Node::Call(function, arguments) => self.of_call(graph, function, &arguments, variable),
            Node::Whole(inner) => {
                let derivative = self.of(graph, inner, variable);
                graph.whole(derivative)
            }
        };
        self.known.insert((expr, variable), derivative);
        derivative
    }

    /// By the rule of the function.
    fn of_call(
        &mut self,
        graph: &mut Graph,
        function: Function,
        arguments: &[Expr],
        variable: Expr,
    ) -> Expr {
        let rule = function.differential();
        let mut values = arguments.to_vec();
        for (index, &argument) in arguments.iter().enumerate() {
            let counts = rule.mentions(arguments.len() + index);
            values.push(if counts { self.of(graph, argument, variable) } else { Graph::ZERO });
        }
        if values[arguments.len()..].iter().all(|&change| change == Graph::ZERO) {
            return Graph::ZERO;
        }
        rule.with(graph, &values)
    }

    /// The derivative of `f S^p` for a sum `S` of a number and one term that is divided by, or one whose root is,
    /// as `S^(p - 1) (S f' + p S' f)` where the bracket is one term, as in `x/(1 + x)` and `x/sqrt(1 + x^2)`: far away the two parts of it
    /// nearly cancel. `None` where it is not.
    fn of_quotient(
        &mut self,
        graph: &mut Graph,
        (base, exponent): (Expr, &Rational),
        slope: Expr,
        others: impl Iterator<Item = (Expr, Rational)>,
        variable: Expr,
    ) -> Option<Expr> {
        let Node::Sum { constant, terms } = graph.node(base) else { return None };
        let saturates = !exponent.is_integer() || !constant.is_zero() && terms.len() == 1;
        if !exponent.is_negative() || !saturates {
            return None;
        }
        let others = graph.product(others);
        let slope_of_others = self.of(graph, others, variable);
        if slope_of_others == Graph::ZERO {
            return None;
        }
        let single = bracket(graph, (base, slope), (others, slope_of_others), exponent)?;
        let power = graph.product([(base, exponent - Rational::one())]);
        Some(graph.mul(power, single))
    }
}

/// `S f' + p S' f` as one term. The number in `S` stays apart: where `f` is such a power of the rest of `S` that the other two terms
/// cancel as they are, roots of parameters in them do not matter.
fn bracket(
    graph: &mut Graph,
    (sum, slope): (Expr, Expr),
    (others, slope_of_others): (Expr, Expr),
    exponent: &Rational,
) -> Option<Expr> {
    let Node::Sum { constant, .. } = graph.node(sum) else { return None };
    let constant = constant.clone();
    let number = graph.number(constant.clone());
    let rest = graph.sub(sum, number);
    let by_rest = graph.mul(rest, slope_of_others);
    let by_slope = graph.mul(slope, others);
    if graph.sum([(Rational::one(), by_rest), (exponent.clone(), by_slope)]) == Graph::ZERO {
        return Some(graph.sum([(constant, slope_of_others)]));
    }
    let by_sum = graph.mul(sum, slope_of_others);
    let bracket = graph.sum([(Rational::one(), by_sum), (exponent.clone(), by_slope)]);
    graph.single_term(bracket)
}

/// The argument of a hyperbolic cosine.
fn hyperbolic_cosine(graph: &Graph, expr: Expr) -> Option<Expr> {
    match graph.node(expr) {
        Node::Call(Function::Cosh, arguments) => Some(arguments[0]),
        _ => None,
    }
}
