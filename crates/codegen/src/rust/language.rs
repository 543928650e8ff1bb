//! Blocks of operations as Rust statements.

use crate::target::{Called, Target, Written, arithmetic};
use crate::text::{digits, push_index};
use mmsmith_expr::{Operation, Rational, RustCall, nearest_f64};
use mmsmith_stage::{Block, Operand, Stage};
use num_traits::{One, Zero};
use proc_macro2::{Ident, Literal, TokenStream};
use quote::quote;
use std::borrow::Cow;
use std::cell::RefCell;

/// A placeholder, with the number of a block, for the statements of the block until the rest is formatted.
const PLACEHOLDER: &str = "let statements_of_block = ";

/// Writes blocks in Rust, given the names of the parameters.
///
/// Blocks are by far the largest part of a solution, and have a simple form. Formatting them as tokens would take longer than deriving
/// them. They are therefore written as lines, of checked names and numbers alone.
#[derive(Clone)]
pub(crate) struct Translator<'a> {
    /// The place of the parameters: `parameters` itself, or `self.parameters`.
    parameters: &'static str,
    names: Vec<Ident>,
    /// The path to the crate `mmsmith_runtime`.
    runtime: String,
    /// The blocks behind placeholders; `None` where tokens are wanted.
    blocks: Option<&'a RefCell<Vec<String>>>,
    /// Whether a constant `NEAR` says that functions may take forms that are not for all numbers.
    tells_near: bool,
}

impl<'a> Translator<'a> {
    pub(crate) fn new(
        parameters: &'static str,
        names: Vec<Ident>,
        runtime: &TokenStream,
        blocks: Option<&'a RefCell<Vec<String>>>,
    ) -> Self {
        let runtime = runtime.to_string().replace(' ', "");
        Translator { parameters, names, runtime, blocks, tells_near: false }
    }

    /// The statements of a block, and its outputs as expressions.
    pub(crate) fn statements(&self, block: &Block<'_>) -> (TokenStream, Vec<TokenStream>) {
        let Written { lines, outputs } = self.block(block, "", ());
        let statements = match self.blocks {
            _ if lines.is_empty() => TokenStream::new(),
            Some(blocks) => {
                let mut blocks = blocks.borrow_mut();
                blocks.push(lines);
                tokens(&format!("{PLACEHOLDER}{};", blocks.len() - 1))
            }
            None => tokens(&lines),
        };
        (statements, outputs.iter().map(|output| tokens(output)).collect())
    }

    /// As [`statements`](Self::statements), with a constant `NEAR` that says whether functions may take forms that are not for all numbers.
    pub(crate) fn statements_if_near(&self, block: &Block<'_>) -> (TokenStream, Vec<TokenStream>) {
        Translator { tells_near: true, ..self.clone() }.statements(block)
    }
}

impl Target for Translator<'_> {
    type Places = ();

    const STATEMENT: [&'static str; 2] = ["let ", ";\n"];

    /// A non-negative number as a value of the scalar type `T`.
    fn literal(&self, value: f64) -> String {
        if value.is_infinite() {
            return "T::nearest(f64::INFINITY)".into();
        }
        format!("T::nearest({})", digits(value))
    }

    fn number(&self, value: &Rational) -> String {
        if value.is_one() {
            return "T::one()".into();
        }
        if value.is_zero() {
            return "T::zero()".into();
        }
        self.literal(nearest_f64(value))
    }

    fn function(&self, function: Called) -> Cow<'static, str> {
        let (Called::Library(name) | Called::Support(name)) = function;
        let name = match function {
            Called::Library("pow") => "powf",
            Called::Library("atan2") => "polar_angle",
            _ => name,
        };
        let other = if function.takes_two() { "#" } else { "" };
        format!("#.{name}({other})").into()
    }

    fn operation(&self, operation: &Operation) -> Cow<'static, str> {
        let fixed = match operation {
            Operation::Number(value) => return self.number(value).into(),
            Operation::Call(function, _) => {
                return match function.rust() {
                    RustCall::Method(name @ ("sine" | "cosine")) if self.tells_near => {
                        format!("#.{name}_if::<NEAR>()")
                    }
                    RustCall::Method(name) => format!("#.{name}()"),
                    RustCall::Library(name) => {
                        let libm = format!("{}::libm", self.runtime);
                        format!("#.apply({libm}::{name}, {libm}::{name}f)")
                    }
                }
                .into();
            }
            Operation::Power(_, exponent) => return self.power(exponent).into(),
            Operation::Pi => "T::pi()",
            Operation::Sqrt(_) => return self.function(Called::Library("sqrt")),
            Operation::SinPi(_) => return self.function(Called::Support("sin_pi")),
            Operation::CosPi(_) => return self.function(Called::Support("cos_pi")),
            Operation::Atan2(..) => return self.function(Called::Library("atan2")),
            Operation::LnOfBoth(..) if self.tells_near => "#.ln_of_both_if::<NEAR>(#)",
            Operation::LnOfBoth(..) => return self.function(Called::Support("ln_of_both")),
            Operation::SumError(..) => return self.function(Called::Support("sum_error")),
            Operation::ProductError(..) => return self.function(Called::Support("product_error")),
            other => arithmetic(other),
        };
        fixed.into()
    }

    fn operand(&self, text: &mut String, operand: Operand<'_>, (): ()) {
        let (name, index) = match operand {
            Operand::Temporary(_) | Operand::Number(_) | Operand::Pi => return,
            Operand::Time => return text.push('t'),
            Operand::Parameter(index) => {
                return text.extend([self.parameters, ".", &self.names[index].to_string()]);
            }
            Operand::Coordinate(index) => ("X", index),
            Operand::Kept(Stage::Fixed, index) => ("self.fixed", index),
            Operand::Kept(Stage::Time, index) => ("time", index),
            Operand::Kept(Stage::Point, index) => ("point", index),
            Operand::Kept(Stage::Layer(axis), index) => {
                text.push_str("layers[");
                push_index(text, axis);
                ("]", index)
            }
        };
        text.extend([name, "["]);
        push_index(text, index);
        text.push(']');
    }
}

/// `text` with each placeholder replaced by the lines of its block, with the same margin.
///
/// Text from a specification is always within a comment or a literal, so that no line of it starts as a placeholder.
pub(crate) fn fill(text: &str, blocks: &[String]) -> String {
    let mut filled = String::new();
    for line in text.lines() {
        let statement = line.trim_start();
        let number = statement.strip_prefix(PLACEHOLDER).and_then(|n| n.strip_suffix(';'));
        let block = number.and_then(|n| blocks.get(n.parse::<usize>().ok()?));
        let margin = &line[..line.len() - statement.len()];
        match block {
            Some(lines) => {
                for line in lines.lines() {
                    filled.extend([margin, line, "\n"]);
                }
            }
            None => filled.extend([line, "\n"]),
        }
    }
    filled
}

/// Names, numbers and the signs between them are always tokens.
fn tokens(text: &str) -> TokenStream {
    text.parse().unwrap_or_default()
}

/// A literal for any double; negative numbers begin with a minus sign.
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
