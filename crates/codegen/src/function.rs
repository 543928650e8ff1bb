//! Blocks of operations as Rust statements.

use crate::plan::{Block, Operand, Stage};
use mmsmith_expr::{Function, Operation, Rational, Slot, nearest_f64};
use num_traits::{One, Zero};
use proc_macro2::{Ident, Literal, Span, TokenStream};
use quote::quote;

/// Writes blocks in Rust, given how the parameters are called.
pub(crate) struct Translator {
    /// Where the parameters are: `parameters` itself, or `self.parameters`.
    parameters: TokenStream,
    names: Vec<Ident>,
}

impl Translator {
    pub(crate) fn new(parameters: TokenStream, names: Vec<Ident>) -> Self {
        Translator { parameters, names }
    }

    /// The statements of a block, and its outputs as expressions.
    pub(crate) fn statements(&self, block: &Block<'_>) -> (TokenStream, Vec<TokenStream>) {
        let statements = block
            .steps()
            .map(|(index, operation)| {
                let (name, value) = (temporary(index), self.operation(block, operation));
                quote!(let #name = #value;)
            })
            .collect();
        (statements, block.outputs().map(|operand| self.operand(operand)).collect())
    }

    fn operand(&self, operand: Operand<'_>) -> TokenStream {
        match operand {
            Operand::Temporary(index) => {
                let name = temporary(index);
                quote!(#name)
            }
            Operand::Number(value) => number(value),
            Operand::Pi => quote!(T::pi()),
            Operand::Coordinate(index) => {
                let index = Literal::usize_unsuffixed(index);
                quote!(X[#index])
            }
            Operand::Time => quote!(t),
            Operand::Parameter(index) => {
                let (parameters, name) = (&self.parameters, &self.names[index]);
                quote!(#parameters.#name)
            }
            Operand::Kept(stage, index) => {
                let index = Literal::usize_unsuffixed(index);
                match stage {
                    Stage::Fixed => quote!(self.fixed[#index]),
                    Stage::Time => quote!(time[#index]),
                    Stage::Point => quote!(point[#index]),
                }
            }
        }
    }

    fn operation(&self, block: &Block<'_>, operation: &Operation) -> TokenStream {
        let at = |slot: &Slot| self.operand(block.operand(*slot));
        match operation {
            // These are operands and no statements.
            Operation::Number(value) => number(value),
            Operation::Pi => quote!(T::pi()),
            Operation::Input(_) => TokenStream::new(),
            Operation::Add(a, b) => binary(&at(a), &quote!(+), &at(b)),
            Operation::Sub(a, b) => binary(&at(a), &quote!(-), &at(b)),
            Operation::Mul(a, b) => binary(&at(a), &quote!(*), &at(b)),
            Operation::Div(a, b) => binary(&at(a), &quote!(/), &at(b)),
            Operation::Neg(a) => {
                let a = at(a);
                quote!(-#a)
            }
            Operation::Sqrt(a) => method(&at(a), "sqrt"),
            Operation::SinPi(a) => method(&at(a), "sin_pi"),
            Operation::CosPi(a) => method(&at(a), "cos_pi"),
            Operation::Call(function, a) => method(&at(a), rust_name(*function)),
            Operation::Power(a, exponent) => {
                let (a, exponent) = (at(a), number(exponent));
                quote!(#a.powf(#exponent))
            }
            Operation::Atan2(y, x) => {
                let (y, x) = (at(y), at(x));
                quote!(#y.atan2(#x))
            }
            Operation::LnOfBoth(x, y) => {
                let (x, y) = (at(x), at(y));
                quote!(#x.ln_of_both(#y))
            }
        }
    }
}

fn temporary(index: usize) -> Ident {
    Ident::new(&format!("t{index}"), Span::call_site())
}

fn binary(a: &TokenStream, sign: &TokenStream, b: &TokenStream) -> TokenStream {
    quote!(#a #sign #b)
}

fn method(receiver: &TokenStream, name: &str) -> TokenStream {
    let name = Ident::new(name, Span::call_site());
    quote!(#receiver.#name())
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
fn number(value: &Rational) -> TokenStream {
    if value.is_one() {
        return quote!(T::one());
    }
    if value.is_zero() {
        return quote!(T::zero());
    }
    let literal = float(nearest_f64(value));
    quote!(T::nearest(#literal))
}

/// A literal for any double; negative ones with a minus sign before it.
pub(crate) fn float(value: f64) -> TokenStream {
    if value.is_infinite() {
        let sign = (value < 0.0).then(|| quote!(-));
        return quote!(#sign f64::INFINITY);
    }
    let magnitude = value.abs();
    let text = digits(magnitude);
    let literal = text.parse::<Literal>().unwrap_or_else(|_| Literal::f64_unsuffixed(magnitude));
    let sign = value.is_sign_negative().then(|| quote!(-));
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

    proptest! {
        #[test]
        fn literals_read_back(x in proptest::num::f64::ANY.prop_filter("finite", |x| x.is_finite())) {
            let text = float(x).to_string().replace(' ', "");
            prop_assert_eq!(text.parse::<f64>().unwrap().to_bits(), x.to_bits());
        }
    }
}
