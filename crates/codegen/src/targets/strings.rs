//! Expressions for hosts that read them from an input file: no functions, and the parameters are numbers.

use crate::code::Code;
use crate::function::digits;
use crate::listing::{Given, Item};
use crate::target::{Called, Unwritable, arithmetic};
use crate::text::spell;
use mmsmith_expr::{Function, Operation, nearest_f64};
use mmsmith_stage::{Operand, Shape};
use std::collections::BTreeMap;

/// What the remarks of all such hosts say.
pub(crate) const ACCURACY: &str = "\
The parameters are numbers in the expressions: write the file anew with --set for others. sin(pi x) is formed as it stands, and ln(1 + x) as \
ln(y) x/(y - 1) with y = 1 + x, which keeps the digits of a small x.";

/// How a host writes expressions.
pub(crate) struct Strings {
    /// What `--target` calls it.
    pub(crate) host: &'static str,
    /// What it calls the coordinates.
    pub(crate) coordinates: [&'static str; 3],
    /// Functions of `math.h` that it has, with its names for them.
    pub(crate) functions: &'static [(&'static str, &'static str)],
    /// Whether an expression can name values before it: `t5 := x*y; ...`.
    pub(crate) names_values: bool,
}

/// A field as expressions.
pub(crate) struct Field {
    pub(crate) name: String,
    /// What it is, in words.
    pub(crate) about: String,
    /// Row by row.
    pub(crate) entries: Vec<Entry>,
}

/// An entry of a field.
pub(crate) struct Entry {
    /// The field's letter and the indices, as `P_01`.
    pub(crate) name: String,
    pub(crate) text: String,
}

impl Strings {
    /// The fields, the tractions and `rho0_b`, with a word about each.
    pub(crate) fn fields(&self, code: &Code<'_>) -> Result<Vec<Field>, Unwritable> {
        let mut all = Vec::new();
        let density = self.constant(code, "density");
        for item in code.functions().iter().filter(|item| item.given == Given::PositionAndTime) {
            let entries = self.entries(code, item)?;
            if item.name == "b" {
                let scaled = entries.iter().map(|entry| Entry {
                    name: format!("rho0_{}", entry.name),
                    text: self.scaled(&entry.text, density),
                });
                all.push(Field {
                    name: "rho0_b".to_owned(),
                    about: "body force per unit reference volume".to_owned(),
                    entries: scaled.collect(),
                });
            }
            all.push(Field { name: item.name.clone(), about: item.about.clone(), entries });
        }
        Ok(all)
    }

    /// The value of a scalar that depends on the parameters only.
    pub(crate) fn constant(&self, code: &Code<'_>, name: &str) -> f64 {
        let items = code.functions();
        let values = items.iter().find(|item| item.name == name).map(|item| item.values(code));
        values.and_then(|values| values.first().copied()).unwrap_or(f64::NAN)
    }

    /// The last expression times a number.
    pub(crate) fn scaled(&self, text: &str, factor: f64) -> String {
        let (before, last) =
            text.rsplit_once("; ").map_or(("", text), |(before, last)| (before, last));
        let joint = if before.is_empty() { "" } else { "; " };
        format!("{before}{joint}{}*({last})", number(factor))
    }

    fn entries(&self, code: &Code<'_>, item: &Item) -> Result<Vec<Entry>, Unwritable> {
        let d = code.spec.dimension;
        (0..item.outputs().len())
            .map(|index| {
                let place = match item.shape {
                    Shape::Scalar => Vec::new(),
                    Shape::Vector => vec![index],
                    Shape::Matrix => vec![index / d, index % d],
                };
                let places: String = place.iter().map(usize::to_string).collect();
                let joint = if places.is_empty() { "" } else { "_" };
                let text = self.expression(code, item, index)?;
                Ok(Entry { name: format!("{}{joint}{places}", item.name), text })
            })
            .collect()
    }

    /// One output of a function.
    fn expression(
        &self,
        code: &Code<'_>,
        item: &Item,
        output: usize,
    ) -> Result<String, Unwritable> {
        let block = code.staged.after_parameters(&item.outputs()[output..=output]);
        let fixed = code.fixed_values();
        let mut texts: BTreeMap<usize, String> = BTreeMap::new();
        let mut statements = String::new();
        let value = |texts: &BTreeMap<usize, String>, operand: Operand<'_>| match operand {
            Operand::Temporary(index) => texts.get(&index).cloned().unwrap_or_default(),
            Operand::Number(value) => number(nearest_f64(value)),
            Operand::Pi => number(std::f64::consts::PI),
            Operand::Time => "t".to_owned(),
            Operand::Coordinate(index) => self.coordinates[index.min(2)].to_owned(),
            Operand::Parameter(index) => number(code.spec.parameters[index].default),
            Operand::Kept(_, index) => number(fixed[index]),
        };
        for (index, operation) in block.steps() {
            let operands: Vec<String> =
                operation.operands().map(|slot| value(&texts, block.operand(slot))).collect();
            let text = self.operation(code, operation, &operands)?;
            let text = if self.names_values {
                statements += &format!("t{index} := {text}; ");
                format!("t{index}")
            } else {
                text
            };
            texts.insert(index, text);
        }
        let result: String = block.outputs().map(|operand| value(&texts, operand)).collect();
        Ok(statements + &result)
    }

    /// An operation with its operands, in parentheses.
    fn operation(
        &self,
        code: &Code<'_>,
        operation: &Operation,
        operands: &[String],
    ) -> Result<String, Unwritable> {
        let one = || operands.first().map_or("", String::as_str);
        let other = || operands.get(1).map_or("", String::as_str);
        Ok(match operation {
            Operation::Power(_, exponent) => {
                format!("({}^{})", one(), number(nearest_f64(exponent)))
            }
            Operation::Sqrt(_) => {
                self.call(code, Called::Library("sqrt"), Function::Exp, operands)?
            }
            Operation::SinPi(_) => format!("sin({}*{})", number(std::f64::consts::PI), one()),
            Operation::CosPi(_) => format!("cos({}*{})", number(std::f64::consts::PI), one()),
            Operation::Atan2(..) => {
                self.call(code, Called::Library("atan2"), Function::Atan2, operands)?
            }
            Operation::LnOfBoth(..) => self.logarithm(code, one())?,
            // What rounding takes is less than what these expressions lose.
            Operation::SumError(..) | Operation::ProductError(..) => "0.0".to_owned(),
            Operation::Call(Function::Ln1p, _) => self.logarithm(code, one())?,
            Operation::Call(Function::PositivePart, _) => format!("(0.5*({0} + abs({0})))", one()),
            Operation::Call(Function::PositivePartSlope, _) => {
                format!("(0.5 + 0.5*{0}/(abs({0}) + 1e-300))", one())
            }
            Operation::Call(Function::Expm1, _) => {
                format!("(2.0*sinh(0.5*{0})*exp(0.5*{0}))", one())
            }
            Operation::Call(function, _) => {
                self.call(code, Called::of(*function), *function, operands)?
            }
            other_operation => {
                let mut operands = [one(), other()].into_iter();
                let mut text = String::from("(");
                spell(&mut text, arithmetic(other_operation), other_operation, |text, _| {
                    text.push_str(operands.next().unwrap_or_default());
                });
                text + ")"
            }
        })
    }

    /// `ln(1 + x)`.
    fn logarithm(&self, code: &Code<'_>, x: &str) -> Result<String, Unwritable> {
        let y = format!("(1.0 + {x})");
        let ln =
            self.call(code, Called::Library("log"), Function::Ln1p, std::slice::from_ref(&y))?;
        Ok(format!("({ln}*(({x} + 1e-300)/(({y} - 1.0) + 1e-300)))"))
    }

    fn call(
        &self,
        code: &Code<'_>,
        called: Called,
        function: Function,
        operands: &[String],
    ) -> Result<String, Unwritable> {
        let name = match called {
            Called::Library(name) => self.functions.iter().find(|(own, _)| *own == name),
            Called::Support(_) => None,
        };
        match name {
            Some((_, name)) => Ok(format!("{name}({})", operands.join(", "))),
            None => Err(Unwritable::Function {
                target: self.host,
                function: function.name().to_owned(),
                solution: code.spec.name.clone(),
            }),
        }
    }
}

/// A number that can stand after any sign.
pub(crate) fn number(value: f64) -> String {
    let text = digits(value.abs());
    if value.is_sign_negative() { format!("(-{text})") } else { text }
}

/// A remark and the head of a file, in lines.
pub(crate) fn head(code: &Code<'_>, remarks: &str) -> Vec<String> {
    let values =
        code.spec.parameters.iter().map(|p| format!("{} = {}", p.name, digits_of(p.default)));
    let mut lines = code.head_for_host(&format!("{remarks}\n{ACCURACY}"));
    lines.push(format!("Parameters: {}.", values.collect::<Vec<_>>().join(", ")));
    lines
}

fn digits_of(value: f64) -> String {
    let sign = if value.is_sign_negative() { "-" } else { "" };
    format!("{sign}{}", digits(value.abs()))
}
