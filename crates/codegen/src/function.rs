//! Programs as Rust statements.

use mmsmith_expr::{Function, Operation, Program, Rational, Slot, nearest_f64};
use num_traits::{One, Zero};
use proc_macro2::{Ident, Literal, Span, TokenStream};
use quote::quote;
use std::collections::BTreeMap;

/// Translates one program, in which some values were computed beforehand and stored.
#[derive(Clone)]
pub(crate) struct Translator<'a> {
    program: &'a Program,
    /// How each input is written.
    inputs: Vec<TokenStream>,
    /// How each stored value is written.
    stored: BTreeMap<Slot, TokenStream>,
}

impl<'a> Translator<'a> {
    pub(crate) fn new(program: &'a Program, inputs: Vec<TokenStream>) -> Self {
        Translator { program, inputs, stored: BTreeMap::new() }
    }

    /// The values that are worth storing: they depend on parameters only, cost something, and are read by an
    /// operation that depends on more, or are results themselves.
    pub(crate) fn fixed_slots(&self) -> Vec<Slot> {
        let program = self.program;
        let costs = |slot: &Slot| {
            !matches!(
                program.operations()[slot.index()],
                Operation::Number(_) | Operation::Pi | Operation::Input(_)
            )
        };
        let read_later = program
            .slots()
            .filter(|&slot| !program.dependence(slot).is_fixed())
            .flat_map(|slot| program.operations()[slot.index()].operands());
        let mut slots: Vec<Slot> = read_later
            .chain(program.outputs().iter().copied())
            .filter(|&slot| program.dependence(slot).is_fixed())
            .filter(costs)
            .collect();
        slots.sort_unstable();
        slots.dedup();
        slots
    }

    pub(crate) fn store(&mut self, slot: Slot, place: TokenStream) {
        self.stored.insert(slot, place);
    }

    /// What `outputs` need of the time alone and of the position alone: the values that are read where both come
    /// together, or are results.
    pub(crate) fn staged_slots(&self, outputs: &[Slot]) -> (Vec<Slot>, Vec<Slot>) {
        let needed = self.needed(outputs);
        let both = |slot: &Slot| {
            let dependence = self.program.dependence(*slot);
            dependence.position && dependence.time
        };
        let mut slots: Vec<Slot> = self
            .program
            .slots()
            .filter(|slot| needed[slot.index()] && both(slot))
            .flat_map(|slot| self.program.operations()[slot.index()].operands())
            .chain(outputs.iter().copied())
            .filter(|slot| !both(slot) && !self.program.dependence(*slot).is_fixed())
            .collect();
        slots.sort_unstable();
        slots.dedup();
        slots.into_iter().partition(|&slot| self.program.dependence(slot).time)
    }

    /// The statements that compute `outputs`, and the outputs as expressions.
    pub(crate) fn statements(&self, outputs: &[Slot]) -> (TokenStream, Vec<TokenStream>) {
        let needed = self.needed(outputs);
        let mut statements = TokenStream::new();
        let mut names = BTreeMap::new();
        for slot in self.program.slots().filter(|slot| needed[slot.index()]) {
            let operation = &self.program.operations()[slot.index()];
            let value = self.operation(operation, &names);
            match operation {
                Operation::Number(_) | Operation::Pi | Operation::Input(_) => {
                    names.insert(slot, value);
                }
                _ => {
                    let name = Ident::new(&format!("t{}", slot.index()), Span::call_site());
                    statements.extend(quote!(let #name = #value;));
                    names.insert(slot, quote!(#name));
                }
            }
        }
        let outputs = outputs.iter().map(|slot| self.operand(*slot, &names)).collect();
        (statements, outputs)
    }

    /// Which operations `outputs` need, where stored values need none.
    fn needed(&self, outputs: &[Slot]) -> Vec<bool> {
        let mut needed = vec![false; self.program.operations().len()];
        let mut stack = outputs.to_vec();
        while let Some(slot) = stack.pop() {
            if !self.stored.contains_key(&slot) && !needed[slot.index()] {
                needed[slot.index()] = true;
                stack.extend(self.program.operations()[slot.index()].operands());
            }
        }
        needed
    }

    fn operand(&self, slot: Slot, names: &BTreeMap<Slot, TokenStream>) -> TokenStream {
        self.stored.get(&slot).or_else(|| names.get(&slot)).cloned().unwrap_or_default()
    }

    fn operation(&self, operation: &Operation, names: &BTreeMap<Slot, TokenStream>) -> TokenStream {
        let at = |slot: Slot| self.operand(slot, names);
        match operation {
            Operation::Number(value) => number(value),
            Operation::Pi => quote!(T::pi()),
            Operation::Input(index) => self.inputs.get(*index).cloned().unwrap_or_default(),
            Operation::Add(a, b) => binary(&at(*a), &quote!(+), &at(*b)),
            Operation::Sub(a, b) => binary(&at(*a), &quote!(-), &at(*b)),
            Operation::Mul(a, b) => binary(&at(*a), &quote!(*), &at(*b)),
            Operation::Div(a, b) => binary(&at(*a), &quote!(/), &at(*b)),
            Operation::Neg(a) => {
                let a = at(*a);
                quote!(-#a)
            }
            Operation::Sqrt(a) => method(&at(*a), "sqrt"),
            Operation::SinPi(a) => method(&at(*a), "sin_pi"),
            Operation::CosPi(a) => method(&at(*a), "cos_pi"),
            Operation::Call(function, a) => method(&at(*a), rust_name(*function)),
            Operation::Power(a, exponent) => {
                let (a, exponent) = (at(*a), number(exponent));
                quote!(#a.powf(#exponent))
            }
            Operation::Atan2(y, x) => {
                let (y, x) = (at(*y), at(*x));
                quote!(#y.atan2(#x))
            }
        }
    }
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
        Function::Ln1p => "ln_1p",
        Function::Expm1 => "exp_m1",
        Function::Atan2 => "atan2",
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
    // Rust's plain notation of very large and very small numbers has hundreds of digits.
    let text = if magnitude != 0.0 && !(1e-5..1e16).contains(&magnitude) {
        format!("{magnitude:e}")
    } else {
        format!("{magnitude:?}")
    };
    let text = if text.contains(['.', 'e']) { text } else { format!("{text}.0") };
    let literal = text.parse::<Literal>().unwrap_or_else(|_| Literal::f64_unsuffixed(magnitude));
    let sign = value.is_sign_negative().then(|| quote!(-));
    quote!(#sign #literal)
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
