//! Syntax tree to graph.

use crate::graph::{LARGEST_SIZE, MOST_BITS, MOST_WORK, bits, numbers};
use crate::{Ast, AstKind, Derivatives, Expr, Function, Graph, Node, Rational};
use num_bigint::BigInt;
use num_integer::Integer;
use num_traits::{One, Signed};
use std::ops::Range;
use thiserror::Error;

/// The largest numerator and denominator of a constant exponent.
const LARGEST_EXPONENT: i64 = 1000;
/// The deepest graph that is accepted from text; the recursive algorithms stay far from the end of the stack.
const DEEPEST_GRAPH: u32 = 400;

/// Why a syntax tree has no meaning.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{message}")]
pub struct BuildError {
    /// The mistake, and its correction.
    pub message: String,
    /// Where, in bytes from the start of the text.
    pub span: Range<usize>,
}

/// Gives names their meaning: an expression, or a message that says why there is none.
type Names<'a> = &'a mut dyn FnMut(&mut Graph, &str) -> Result<Expr, String>;

impl Graph {
    /// The expression that `ast` stands for, with names resolved by `names`.
    ///
    /// `Pi`, the functions of [`Function::names`], `sqrt(x)` and `diff(f, x, ...)` are built in.
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
                if self.common_denominator_is_large(&parts) {
                    return Err(fail(large_numbers()));
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
                let coefficients = parts.iter().filter_map(|(value, _)| self.coefficient(*value));
                if coefficients.map(|c| bits(c) - 2).sum::<u64>() > MOST_BITS {
                    return Err(fail(large_numbers()));
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
        self.check_size(expr).map_err(fail)?;
        Ok(expr)
    }

    fn check_size(&self, expr: Expr) -> Result<(), String> {
        if self.depth(expr) > DEEPEST_GRAPH {
            return Err(format!("nested deeper than {DEEPEST_GRAPH} operations"));
        }
        if self.size() > LARGEST_SIZE {
            return Err(format!("more than {LARGEST_SIZE} subexpressions"));
        }
        if self.work > MOST_WORK {
            return Err("takes too long; name parts in [let], or differentiate less often".into());
        }
        if self.is_overgrown() { Err(large_numbers()) } else { Ok(()) }
    }

    /// The number that a product with `expr` would multiply.
    fn coefficient(&self, expr: Expr) -> Option<&Rational> {
        match self.node(expr) {
            Node::Number(value) => Some(value),
            Node::Sum { terms, .. } if terms.len() == 1 => Some(&terms[0].1),
            _ => None,
        }
        .filter(|value| !num_traits::Zero::is_zero(*value))
    }

    fn common_denominator_is_large(&self, parts: &[(Rational, Expr)]) -> bool {
        let mut common = BigInt::one();
        let mut numbers = parts.iter().flat_map(|(_, part)| numbers(self.node(*part)));
        numbers.any(|number| {
            if !common.is_multiple_of(&number.denom()) {
                common = common.lcm(&number.denom());
            }
            common.bits() > MOST_BITS
        })
    }

    fn power(&mut self, base: Expr, exponent: Expr) -> Result<Expr, String> {
        let Some(number) = self.as_number(exponent).cloned() else {
            let logarithm = self.call(Function::Ln, &[base]);
            let product = self.mul(exponent, logarithm);
            return Ok(self.call(Function::Exp, &[product]));
        };
        let limit = LARGEST_EXPONENT.into();
        if number.numer().abs() > limit || number.denom() > limit {
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
            return fail(unknown_function(name));
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
            result = Derivatives::limited().of(self, result, symbol);
            self.check_size(result)
                .map_err(|message| BuildError { message, span: ast.span.clone() })?;
        }
        Ok(result)
    }
}

fn large_numbers() -> String {
    format!("numbers of more than {MOST_BITS} bits are not supported")
}

/// Functions of other languages, and what is written here.
const INSTEAD: [(&str, &str); 11] = [
    ("abs", "sqrt(x^2)"),
    ("cbrt", "x^(1/3)"),
    ("heaviside", "positive_part_slope(x)"),
    ("log10", "ln(x)/ln(10)"),
    ("log2", "ln(x)/ln(2)"),
    ("max", "y + positive_part(x - y)"),
    ("min", "x - positive_part(x - y)"),
    ("pow", "x^y"),
    ("sec", "1/cos(x)"),
    ("sqr", "x^2"),
    ("square", "x^2"),
];

fn unknown_function(name: &str) -> String {
    let small = name.to_lowercase();
    let known = Function::everyday();
    let hint = match INSTEAD.iter().find(|(own, _)| *own == small) {
        Some((_, instead)) => format!("write {instead}; "),
        None if small != name && (Function::from_name(&small).is_some() || small == "sqrt") => {
            format!("did you mean '{small}'? ")
        }
        None => String::new(),
    };
    format!("no function is called '{name}'; {hint}there are sqrt, diff, {}", known.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn built(text: &str) -> Result<(), String> {
        let mut graph = Graph::new();
        let ast = Ast::parse(text).unwrap();
        let built = graph.build(&ast, &mut |graph, name| match name {
            "half" => Ok(graph.number(power_of_two(MOST_BITS / 2))),
            "odd" => Ok(graph.number(power_of_two(MOST_BITS / 2) - Rational::one())),
            "fifth" => Ok(graph.number(power_of_two(MOST_BITS / 5))),
            _ => Ok(graph.symbol(name)),
        });
        built.map(|_| ()).map_err(|error| error.message)
    }

    fn power_of_two(exponent: u64) -> Rational {
        Rational::from_integer(BigInt::one() << exponent)
    }

    /// Limits on numbers may be reached and not be passed.
    #[test]
    fn limits_on_numbers() {
        let large = |text: &str| assert!(built(text).unwrap_err().contains("bits"), "{text}");
        let fine = |text: &str| assert_eq!(built(text), Ok(()), "{text}");
        // Numerators and denominators of factors, less the bits that they have in any case.
        fine("half/half");
        large("2*half/half");
        fine("x*half/half*1/1*y");
        large("x*half/(3*half)");
        large("half*half");
        // The coefficients of a sum of several terms stay where they are.
        let factor = "(fifth*x + y)";
        fine(&[factor; 6].join("*"));
        large(&["(fifth*x)"; 6].join("*"));
        // Denominators of terms, though they cancel.
        fine("x/half + y/odd - y/odd");
        large("x/half/2 + y/odd - y/odd");
        // Exponents.
        for text in ["x^1000", "x^-1000", "x^(1/1000)", "x^(-999/1000)", "x^0", "0^2"] {
            fine(text);
        }
        for text in ["x^1001", "x^-1001", "x^(1/1001)", "x^(1001/2)"] {
            assert!(built(text).unwrap_err().contains("beyond 1000"), "{text}");
        }
        fine("(-8)^3");
        fine("8^(1/3)");
        assert!(built("(-8)^(1/3)").unwrap_err().contains("negative"));
        assert!(built("0^(-1)").unwrap_err().contains("not positive"));
        assert!(built("0^0").unwrap_err().contains("not positive"));
    }
}
