//! How far results move when their inputs move.

use crate::{Oracle, OracleError, Point};
use mmsmith_expr::{Dependence, Derivatives, Expr, Graph, Program, Rational};
use num_traits::{Signed, Zero};
use std::collections::{BTreeMap, BTreeSet};

/// The digits of each term of the sum that are made sure of.
const DIGITS: usize = 8;

/// Symbolic derivatives of expressions with respect to every input, the circle number among them.
#[derive(Clone, Debug)]
pub struct Sensitivity {
    graph: Graph,
    /// For each expression `y`, the products `q dy/dq` that are not zero.
    products: Vec<Vec<Expr>>,
}

impl Sensitivity {
    /// Differentiates `expressions` with respect to each of `inputs` and to pi.
    ///
    /// `definitions` say what further symbols mean; they may refer to one another.
    #[must_use]
    pub fn new(
        graph: &Graph,
        definitions: &[(Expr, Expr)],
        inputs: &[Expr],
        expressions: &[Expr],
    ) -> Self {
        let mut graph = graph.clone();
        // The oracle takes a symbol of this name, which no specification can declare, for the number itself.
        let pi = graph.symbol("Pi");
        let mut replacement: BTreeMap<Expr, Expr> = definitions.iter().copied().collect();
        let number = graph.pi();
        replacement.insert(number, pi);
        let defined: BTreeSet<Expr> = definitions.iter().map(|&(symbol, _)| symbol).collect();
        let mut products = Vec::new();
        let mut derivatives = Derivatives::default();
        for &expression in expressions {
            let mut open = graph.replace(expression, &replacement);
            // One turn for each link of a chain of definitions; circles end here and fail in the evaluation.
            for _ in definitions {
                if !graph.depends_on(open, &defined) && !graph.depends_on(open, &[number].into()) {
                    break;
                }
                open = graph.replace(open, &replacement);
            }
            let mut parts = Vec::new();
            for &input in inputs.iter().chain([&pi]) {
                let derivative = derivatives.of(&mut graph, open, input);
                if derivative != Graph::ZERO {
                    parts.push(graph.mul(input, derivative));
                }
            }
            products.push(parts);
        }
        Sensitivity { graph, products }
    }

    /// `sum over inputs q of |q dy/dq|` for each expression `y`, at the given values of the inputs.
    ///
    /// # Errors
    ///
    /// [`OracleError`] where a derivative does not exist.
    pub fn evaluate(
        &self,
        oracle: &mut Oracle,
        values: &[(Expr, Rational)],
    ) -> Result<Vec<Rational>, OracleError> {
        let point = Point { graph: &self.graph, definitions: &[], values };
        let mut parts = oracle.settle(&point, &self.products.concat(), DIGITS)?.into_iter();
        Ok(self
            .products
            .iter()
            .map(|products| {
                let parts = parts.by_ref().take(products.len());
                parts.fold(Rational::zero(), |sum, part| sum + part.abs())
            })
            .collect())
    }

    /// The sum for expression number `index` alone.
    ///
    /// # Errors
    ///
    /// As [`Sensitivity::evaluate`].
    pub fn evaluate_one(
        &self,
        oracle: &mut Oracle,
        values: &[(Expr, Rational)],
        index: usize,
    ) -> Result<Rational, OracleError> {
        let point = Point { graph: &self.graph, definitions: &[], values };
        let Some(products) = self.products.get(index) else { return Ok(Rational::zero()) };
        let parts = oracle.settle(&point, products, DIGITS)?;
        Ok(parts.into_iter().fold(Rational::zero(), |sum, part| sum + part.abs()))
    }

    /// The program that computes the products `q dy/dq` of all expressions from `inputs`, in double precision, and how many
    /// there are for each expression.
    #[must_use]
    pub(crate) fn in_doubles(&self, inputs: &[Expr]) -> (Program, Vec<usize>) {
        let mut graph = self.graph.clone();
        let pi = graph.symbol("Pi");
        let number = graph.pi();
        let inputs: Vec<(Expr, Dependence)> =
            inputs.iter().map(|&input| (input, Dependence::default())).collect();
        let program = Program::lower(&mut graph, &inputs, &[(pi, number)], &self.products.concat());
        (program, self.products.iter().map(Vec::len).collect())
    }
}
