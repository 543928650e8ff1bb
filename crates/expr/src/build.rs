//! Syntax tree to graph.

use crate::{Ast, AstKind, Derivatives, Expr, Function, Graph, Rational};
use num_traits::{One, Signed};
use std::ops::Range;
use thiserror::Error;

/// The largest numerator and denominator of a constant exponent.
const LARGEST_EXPONENT: i64 = 1000;
/// The deepest graph that is accepted from text; the recursive algorithms stay far from the end of the stack.
const DEEPEST_GRAPH: u32 = 400;
/// The largest number of nodes that text may make.
const MOST_NODES: usize = 1 << 20;

/// Why a syntax tree has no meaning.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{message}")]
pub struct BuildError {
    /// What is wrong, and what would be right.
    pub message: String,
    /// Where, in bytes from the start of the text.
    pub span: Range<usize>,
}

/// Gives names their meaning: an expression, or a message that says why there is none.
type Names<'a> = &'a mut dyn FnMut(&mut Graph, &str) -> Result<Expr, String>;

impl Graph {
    /// The expression that `ast` stands for, with names resolved by `names`.
    ///
    /// `Pi`, the functions of [`Function::NAMES`], `sqrt(x)` and `diff(f, x, ...)` are built in.
    ///
    /// # Errors
    ///
    /// [`BuildError`] at unknown names, division by zero, wrong numbers of arguments, and exponents or depths
    /// beyond the limits.
    pub fn build(&mut self, ast: &Ast, names: Names<'_>) -> Result<Expr, BuildError> {
        let fail = |message: String| BuildError { message, span: ast.span.clone() };
        let expr = match &ast.kind {
            AstKind::Number(value) => self.number(value.clone()),
            AstKind::Name(name) if name == "Pi" => self.pi(),
            AstKind::Name(name) => names(self, name).map_err(fail)?,
            AstKind::Sum(terms) => {
                let mut parts = Vec::new();
                for (subtracted, term) in terms {
                    let sign = if *subtracted { -Rational::one() } else { Rational::one() };
                    parts.push((sign, self.build(term, names)?));
                }
                self.sum(parts)
            }
            AstKind::Product(factors) => {
                let mut parts = Vec::new();
                for (divided, factor) in factors {
                    let value = self.build(factor, names)?;
                    if *divided && value == Graph::ZERO {
                        let message = "division by zero".into();
                        return Err(BuildError { message, span: factor.span.clone() });
                    }
                    let exponent = if *divided { -Rational::one() } else { Rational::one() };
                    parts.push((value, exponent));
                }
                self.product(parts)
            }
            AstKind::Power(base, exponent) => {
                let base = self.build(base, names)?;
                let value = self.build(exponent, names)?;
                self.power(base, value)
                    .map_err(|message| BuildError { message, span: exponent.span.clone() })?
            }
            AstKind::Call(name, arguments) => self.build_call(ast, name, arguments, names)?,
        };
        if self.depth(expr) > DEEPEST_GRAPH {
            return Err(fail(format!("nested deeper than {DEEPEST_GRAPH} operations")));
        }
        if self.len() > MOST_NODES {
            return Err(fail(format!("more than {MOST_NODES} subexpressions")));
        }
        Ok(expr)
    }

    fn power(&mut self, base: Expr, exponent: Expr) -> Result<Expr, String> {
        let Some(number) = self.as_number(exponent).cloned() else {
            let logarithm = self.call(Function::Ln, &[base]);
            let product = self.mul(exponent, logarithm);
            return Ok(self.call(Function::Exp, &[product]));
        };
        let limit = LARGEST_EXPONENT.into();
        if number.numer().abs() > limit || *number.denom() > limit {
            return Err(format!("an exponent beyond {LARGEST_EXPONENT} is not supported"));
        }
        if base == Graph::ZERO && !number.is_positive() {
            return Err("zero to a power that is not positive".into());
        }
        if self.as_number(base).is_some_and(Signed::is_negative) && !number.is_integer() {
            return Err("a negative number to a power that is not an integer".into());
        }
        Ok(self.product([(base, number)]))
    }

    fn build_call(
        &mut self,
        ast: &Ast,
        name: &str,
        arguments: &[Ast],
        names: Names<'_>,
    ) -> Result<Expr, BuildError> {
        let fail = |message: String| Err(BuildError { message, span: ast.span.clone() });
        if name == "diff" {
            return self.build_diff(ast, arguments, names);
        }
        let function = Function::from_name(name);
        let Some(arity) = function.map(Function::arity).or((name == "sqrt").then_some(1)) else {
            let known: Vec<&str> = Function::NAMES.iter().map(|(n, _)| *n).collect();
            return fail(format!(
                "no function is called '{name}'; there are sqrt, diff, {}",
                known.join(", ")
            ));
        };
        if arguments.len() != arity {
            return fail(format!("{name} takes {arity} argument(s), not {}", arguments.len()));
        }
        let mut values = Vec::new();
        for argument in arguments {
            values.push(self.build(argument, names)?);
        }
        match function {
            Some(Function::Ln) if self.as_number(values[0]).is_some_and(|x| !x.is_positive()) => {
                fail("the logarithm of a number that is not positive".into())
            }
            Some(function) => Ok(self.call(function, &values)),
            None if self.as_number(values[0]).is_some_and(Signed::is_negative) => {
                fail("the square root of a negative number".into())
            }
            None => Ok(self.sqrt(values[0])),
        }
    }

    fn build_diff(
        &mut self,
        ast: &Ast,
        arguments: &[Ast],
        names: Names<'_>,
    ) -> Result<Expr, BuildError> {
        let Some((function, variables)) =
            arguments.split_first().filter(|(_, variables)| !variables.is_empty())
        else {
            let message = "diff takes an expression and at least one variable, as in diff(f, t)";
            return Err(BuildError { message: message.into(), span: ast.span.clone() });
        };
        let mut result = self.build(function, names)?;
        for variable in variables {
            let symbol = self.build(variable, names)?;
            if self.symbol_name(symbol).is_none() {
                let message =
                    "diff needs a coordinate, the time or a parameter here, not an expression";
                return Err(BuildError { message: message.into(), span: variable.span.clone() });
            }
            result = Derivatives::default().of(self, result, symbol);
        }
        Ok(result)
    }
}
