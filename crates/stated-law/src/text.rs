//! Text to operations.

use crate::StatedLawError;
use crate::function::Function;
use crate::tape::{Argument, Tape, Value};
use mmsmith_expr::{Ast, AstKind, nearest_f64};
use std::collections::BTreeMap;

/// The functions by their names; `expm1`, `log1p` and those of two numbers are made of others.
const FUNCTIONS: [(&str, Function); 22] = [
    ("sin", Function::Sin),
    ("cos", Function::Cos),
    ("tan", Function::Tan),
    ("arcsin", Function::Asin),
    ("asin", Function::Asin),
    ("arccos", Function::Acos),
    ("acos", Function::Acos),
    ("arctan", Function::Atan),
    ("atan", Function::Atan),
    ("sinh", Function::Sinh),
    ("cosh", Function::Cosh),
    ("tanh", Function::Tanh),
    ("exp", Function::Exp),
    ("ln", Function::Ln),
    ("log", Function::Ln),
    ("sqrt", Function::Sqrt),
    ("erf", Function::Erf),
    ("lnratio2", Function::LogRatioSquared),
    ("lnratio2_slope", Function::LogRatioSlope),
    ("lnratio2_curvature", Function::LogRatioCurvature),
    ("positive_part", Function::PositivePart),
    ("positive_part_slope", Function::PositivePartSlope),
];

/// Meanings of names in a text.
#[derive(Clone, Debug, Default)]
pub(crate) struct Names {
    pub(crate) arguments: BTreeMap<String, (Argument, Value)>,
    pub(crate) constants: BTreeMap<String, Value>,
}

impl Names {
    /// Adds a constant.
    pub(crate) fn add(&mut self, name: &str, value: f64) -> Result<(), StatedLawError> {
        if !value.is_finite() {
            return Err(StatedLawError::NotFinite { part: name.to_owned() });
        }
        self.add_value(name, Value::constant(value))
    }

    /// Adds a number that is neither a measure of the deformation nor an argument of derivatives.
    pub(crate) fn add_value(&mut self, name: &str, value: Value) -> Result<(), StatedLawError> {
        let is_taken = name == "Pi" || self.arguments.contains_key(name);
        if is_taken || self.constants.contains_key(name) {
            return Err(StatedLawError::TakenName { name: name.to_owned() });
        }
        self.constants.insert(name.to_owned(), value);
        Ok(())
    }

    /// The number that `text` states.
    pub(crate) fn read(&self, tape: &mut Tape, text: &str) -> Result<Value, StatedLawError> {
        let value = self.value(tape, text, &Ast::parse(text)?)?;
        Ok(value)
    }

    fn value(&self, tape: &mut Tape, text: &str, ast: &Ast) -> Result<Value, StatedLawError> {
        let value = match &ast.kind {
            AstKind::Number(number) => Value::constant(nearest_f64(number)),
            AstKind::Name(name) => self.named(name)?,
            AstKind::Sum(terms) => {
                let mut parts = Vec::with_capacity(terms.len());
                for (subtracted, term) in terms {
                    let sign = if *subtracted { -1.0 } else { 1.0 };
                    parts.push((sign, self.value(tape, text, term)?));
                }
                tape.sum(&parts)
            }
            AstKind::Product(factors) => {
                let mut product = Value::ONE;
                for (divided, factor) in factors {
                    let mut factor = self.value(tape, text, factor)?;
                    if *divided {
                        factor = tape.reciprocal(factor);
                    }
                    product = tape.product(product, factor);
                }
                product
            }
            AstKind::Power(base, exponent) => {
                let base = self.value(tape, text, base)?;
                let exponent = self.value(tape, text, exponent)?;
                tape.power(base, exponent)
            }
            AstKind::Call(name, arguments) if name == "diff" => {
                self.derivative(tape, text, arguments)?
            }
            AstKind::Call(name, arguments) => {
                let values = arguments.iter().map(|argument| self.value(tape, text, argument));
                let values: Vec<Value> = values.collect::<Result<_, _>>()?;
                call(tape, name, &values)?
            }
        };
        match value {
            Value::Constant(rest) if !rest.value.is_finite() => {
                let part = text.get(ast.span.clone()).unwrap_or(text);
                Err(StatedLawError::NotFinite { part: part.to_owned() })
            }
            value => Ok(value),
        }
    }

    fn named(&self, name: &str) -> Result<Value, StatedLawError> {
        let argument = self.arguments.get(name).map(|&(_, value)| value);
        let value = argument.or_else(|| self.constants.get(name).copied());
        if name == "Pi" {
            return Ok(Value::constant(std::f64::consts::PI));
        }
        value.ok_or_else(|| {
            let known = self.arguments.keys().chain(self.constants.keys()).cloned();
            let known: Vec<String> = known.chain(["Pi".to_owned()]).collect();
            StatedLawError::UnknownName { name: name.to_owned(), known: known.join(", ") }
        })
    }

    /// `diff(f, x, ...)`.
    fn derivative(
        &self,
        tape: &mut Tape,
        text: &str,
        arguments: &[Ast],
    ) -> Result<Value, StatedLawError> {
        let Some((function, variables)) = arguments.split_first().filter(|(_, v)| !v.is_empty())
        else {
            return Err(StatedLawError::Arguments {
                function: "diff".to_owned(),
                expected: 2,
                found: arguments.len(),
            });
        };
        let mut value = self.value(tape, text, function)?;
        for variable in variables {
            let argument = match &variable.kind {
                AstKind::Name(name) => self.arguments.get(name),
                _ => None,
            };
            let Some(&(argument, _)) = argument else {
                let part = text.get(variable.span.clone()).unwrap_or(text);
                return Err(StatedLawError::Variable { part: part.to_owned() });
            };
            value = tape.derivative(value, argument);
        }
        Ok(value)
    }
}

fn call(tape: &mut Tape, name: &str, values: &[Value]) -> Result<Value, StatedLawError> {
    let function = FUNCTIONS.iter().find(|(known, _)| *known == name);
    match (name, function, values) {
        (_, Some(&(_, function)), &[x]) => Ok(tape.call(function, x)),
        ("expm1", _, &[x]) => {
            let exponential = tape.call(Function::Exp, x);
            Ok(tape.sum(&[(1.0, exponential), (-1.0, Value::ONE)]))
        }
        ("log1p", _, &[x]) => {
            let sum = tape.add(Value::ONE, x);
            Ok(tape.call(Function::Ln, sum))
        }
        ("lnboth", _, &[x, y]) => {
            let sum = tape.one_plus(x, y);
            Ok(tape.call(Function::Ln, sum))
        }
        ("atan2", _, &[y, x]) => Ok(tape.angle(y, x)),
        _ => {
            let expected = match name {
                "lnboth" | "atan2" => Some(2),
                "expm1" | "log1p" => Some(1),
                _ => function.map(|_| 1),
            };
            let name = name.to_owned();
            Err(match expected {
                Some(expected) => {
                    StatedLawError::Arguments { function: name, expected, found: values.len() }
                }
                None => StatedLawError::UnknownFunction { name },
            })
        }
    }
}
