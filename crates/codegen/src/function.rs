//! Blocks of operations as Rust statements.

use crate::plan::{Block, Operand, Stage};
use mmsmith_expr::{Function, Operation, Rational, Slot, nearest_f64};
use num_traits::{One, Zero};
use proc_macro2::{Ident, Literal, TokenStream};
use quote::quote;
use std::cell::RefCell;

/// Stands for the statements of a block, by its number, until the rest is formatted.
const PLACEHOLDER: &str = "let statements_of_block = ";

/// Writes blocks in Rust, given how the parameters are called.
///
/// Blocks are by far the largest part of a solution, and simple; formatting them as tokens would take longer than
/// to derive them. So they are written as lines, of checked names and numbers alone.
pub(crate) struct Translator<'a> {
    /// Where the parameters are: `parameters` itself, or `self.parameters`.
    parameters: &'static str,
    names: Vec<Ident>,
    /// The blocks that placeholders stand for; `None` where tokens are wanted.
    blocks: Option<&'a RefCell<Vec<Vec<String>>>>,
}

impl<'a> Translator<'a> {
    pub(crate) fn new(
        parameters: &'static str,
        names: Vec<Ident>,
        blocks: Option<&'a RefCell<Vec<Vec<String>>>>,
    ) -> Self {
        Translator { parameters, names, blocks }
    }

    /// The statements of a block, and its outputs as expressions.
    pub(crate) fn statements(&self, block: &Block<'_>) -> (TokenStream, Vec<TokenStream>) {
        let lines: Vec<String> = block
            .steps()
            .map(|(index, operation)| {
                format!("let t{index} = {};", self.operation(block, operation))
            })
            .collect();
        let statements = match self.blocks {
            _ if lines.is_empty() => TokenStream::new(),
            Some(blocks) => {
                let mut blocks = blocks.borrow_mut();
                blocks.push(lines);
                tokens(&format!("{PLACEHOLDER}{};", blocks.len() - 1))
            }
            None => tokens(&lines.concat()),
        };
        (statements, block.outputs().map(|operand| tokens(&self.operand(operand))).collect())
    }

    fn operand(&self, operand: Operand<'_>) -> String {
        match operand {
            Operand::Temporary(index) => format!("t{index}"),
            Operand::Number(value) => number(value),
            Operand::Pi => "T::pi()".into(),
            Operand::Coordinate(index) => format!("X[{index}]"),
            Operand::Time => "t".into(),
            Operand::Parameter(index) => format!("{}.{}", self.parameters, self.names[index]),
            Operand::Kept(Stage::Fixed, index) => format!("self.fixed[{index}]"),
            Operand::Kept(Stage::Time, index) => format!("time[{index}]"),
            Operand::Kept(Stage::Point, index) => format!("point[{index}]"),
        }
    }

    fn operation(&self, block: &Block<'_>, operation: &Operation) -> String {
        let at = |slot: &Slot| self.operand(block.operand(*slot));
        match operation {
            // These are operands and no statements.
            Operation::Number(value) => number(value),
            Operation::Pi => "T::pi()".into(),
            Operation::Input(_) => String::new(),
            Operation::Add(a, b) => format!("{} + {}", at(a), at(b)),
            Operation::Sub(a, b) => format!("{} - {}", at(a), at(b)),
            Operation::Mul(a, b) => format!("{} * {}", at(a), at(b)),
            Operation::Div(a, b) => format!("{} / {}", at(a), at(b)),
            Operation::Neg(a) => format!("-{}", at(a)),
            Operation::Sqrt(a) => format!("{}.sqrt()", at(a)),
            Operation::SinPi(a) => format!("{}.sin_pi()", at(a)),
            Operation::CosPi(a) => format!("{}.cos_pi()", at(a)),
            Operation::Call(function, a) => format!("{}.{}()", at(a), rust_name(*function)),
            Operation::Power(a, exponent) => format!("{}.powf({})", at(a), number(exponent)),
            Operation::Atan2(y, x) => format!("{}.atan2({})", at(y), at(x)),
            Operation::LnOfBoth(x, y) => format!("{}.ln_of_both({})", at(x), at(y)),
            Operation::SumError(a, b) => format!("{}.sum_error({})", at(a), at(b)),
            Operation::ProductError(a, b) => format!("{}.product_error({})", at(a), at(b)),
        }
    }
}

/// `text` with the lines of `blocks` in the places of their placeholders, as far to the right as these.
///
/// Text from a specification is always within a comment or a literal, so that no line of it starts as a placeholder.
pub(crate) fn fill(text: &str, blocks: &[Vec<String>]) -> String {
    let mut filled = String::new();
    for line in text.lines() {
        let statement = line.trim_start();
        let number = statement.strip_prefix(PLACEHOLDER).and_then(|n| n.strip_suffix(';'));
        let block = number.and_then(|n| blocks.get(n.parse::<usize>().ok()?));
        let margin = &line[..line.len() - statement.len()];
        match block {
            Some(lines) => {
                for line in lines {
                    filled.extend([margin, line, "\n"]);
                }
            }
            None => filled.extend([line, "\n"]),
        }
    }
    filled
}

/// Names and numbers with what joins them always are tokens.
fn tokens(text: &str) -> TokenStream {
    text.parse().unwrap_or_default()
}

fn rust_name(function: Function) -> &'static str {
    match function {
        Function::Sin => "sin",
        Function::Cos => "cos",
        Function::Tan => "tan",
        Function::Asin => "asin",
        Function::Acos => "acos",
        Function::Atan => "atan",
        Function::Sinh => "sinh",
        Function::Cosh => "cosh",
        Function::Tanh => "tanh",
        Function::Exp => "exp",
        Function::Ln => "ln",
        Function::Ln1p => "log_1p",
        Function::Expm1 => "exp_m1",
        Function::Atan2 => "atan2",
        Function::LnOfBoth => "ln_of_both",
        Function::LogRatioSquared => "log_ratio_squared",
        Function::LogRatioSlope => "log_ratio_slope",
        Function::LogRatioCurvature => "log_ratio_curvature",
    }
}

/// A non-negative number as a value of the scalar type `T`.
fn number(value: &Rational) -> String {
    if value.is_one() {
        return "T::one()".into();
    }
    if value.is_zero() {
        return "T::zero()".into();
    }
    let value = nearest_f64(value);
    if value.is_infinite() {
        return "T::nearest(f64::INFINITY)".into();
    }
    format!("T::nearest({})", digits(value))
}

/// A literal for any double; negative ones with a minus sign before it.
pub(crate) fn float(value: f64) -> TokenStream {
    let sign = value.is_sign_negative().then(|| quote!(-));
    if value.is_infinite() {
        return quote!(#sign f64::INFINITY);
    }
    let magnitude = value.abs();
    let text = digits(magnitude);
    let literal = text.parse::<Literal>().unwrap_or_else(|_| Literal::f64_unsuffixed(magnitude));
    quote!(#sign #literal)
}

/// The shortest digits that read back as the same double, in a form that both Rust and C take for floating point.
pub(crate) fn digits(magnitude: f64) -> String {
    // The plain notation of very large and very small numbers has hundreds of digits.
    let text = if magnitude != 0.0 && !(1e-5..1e16).contains(&magnitude) {
        format!("{magnitude:e}")
    } else {
        format!("{magnitude:?}")
    };
    if text.contains(['.', 'e']) { text } else { format!("{text}.0") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn infinite_literals_keep_their_sign() {
        for (value, expected) in
            [(f64::INFINITY, "f64::INFINITY"), (-f64::INFINITY, "-f64::INFINITY")]
        {
            assert_eq!(float(value).to_string().replace(' ', ""), expected);
        }
    }

    proptest! {
        #[test]
        fn literals_read_back(x in proptest::num::f64::ANY.prop_filter("finite", |x| x.is_finite())) {
            let text = float(x).to_string().replace(' ', "");
            prop_assert_eq!(text.parse::<f64>().unwrap().to_bits(), x.to_bits());
        }
    }
}
