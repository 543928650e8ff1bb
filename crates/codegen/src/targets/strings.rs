//! Expressions for hosts that read them from an input file: no functions, and the parameters are numbers.

use crate::code::Code;
use crate::listing::Given;
use crate::target::{Called, Unwritable, arithmetic};
use crate::text::{digits, spell};
use mmsmith_expr::{Function, Operation, Slot, nearest_f64};
use mmsmith_stage::{Operand, Shape};
use std::collections::BTreeMap;

/// Remarks that all such hosts share.
pub(crate) const ACCURACY: &str = "\
The parameters are numbers in the expressions: write the file anew with --set for others. sin(pi x) is formed as it stands, and ln(1 + x) as \
ln(y) x/(y - 1) with y = 1 + x, which keeps the digits of a small x.";

/// How a host writes expressions.
pub(crate) struct Strings {
    /// The name for `--target`.
    pub(crate) host: &'static str,
    /// The host's names of the coordinates.
    pub(crate) coordinates: [&'static str; 3],
    /// Functions of `math.h` that the host has, with the host's names.
    pub(crate) functions: &'static [(&'static str, &'static str)],
    /// Whether an expression can name values before it: `t5 := x*y; ...`.
    pub(crate) names_values: bool,
}

/// A field as expressions.
pub(crate) struct Field {
    pub(crate) name: String,
    /// The field in words.
    pub(crate) about: String,
    /// The entries, row by row.
    pub(crate) entries: Vec<Entry>,
}

/// An entry of a field.
pub(crate) struct Entry {
    /// The field's letter and the indices, as `P_01`.
    pub(crate) name: String,
    pub(crate) text: String,
}

/// The value of an operation in an expression.
#[derive(Clone)]
enum Value {
    /// Exactly zero, which shortens products and sums.
    Zero,
    Text(String),
}

impl Value {
    fn number(value: f64) -> Self {
        if value.to_bits() == 0 { Value::Zero } else { Value::Text(number(value)) }
    }

    fn text(self) -> String {
        match self {
            Value::Zero => number(0.0),
            Value::Text(text) => text,
        }
    }
}

impl Strings {
    /// The fields, further quantities formed from them, and the tractions, each with a description.
    pub(crate) fn fields(&self, code: &Code<'_>) -> Result<Vec<Field>, Unwritable> {
        let mut all = Vec::new();
        let density = number(self.constant(code, "density"));
        let functions = code.functions();
        let outputs = |name: &str| -> Vec<Slot> {
            functions
                .iter()
                .find(|item| item.name == name)
                .map_or(Vec::new(), |item| item.outputs().to_vec())
        };
        let (a, b) = (outputs("a"), outputs("b"));
        // The density at the place, where it depends on it.
        let graded = code.staged.density_here;
        let with_density =
            |slots: &[Slot]| -> Vec<Slot> { slots.iter().copied().chain(graded).collect() };
        for item in functions.iter().filter(|item| item.given != Given::Nothing) {
            if item.name == "b" {
                let rho0 = |of: Option<&String>| of.cloned().unwrap_or_else(|| density.clone());
                let scaled = |of: &[String]| format!("{}*({})", rho0(of.get(1)), of[0]);
                let of = |i: usize| self.joined(code, &with_density(&[b[i]]), scaled);
                all.push(field("rho0_b", "body force per unit reference volume", 1, b.len(), of)?);
                let scaled = |of: &[String]| format!("{}*({} - {})", rho0(of.get(2)), of[0], of[1]);
                let of = |i: usize| self.joined(code, &with_density(&[b[i], a[i]]), scaled);
                let about = "-Div P, the force per unit reference volume that holds the deformation of a time still";
                all.push(field("static_force", about, 1, b.len(), of)?);
            }
            let rank = match item.shape {
                Shape::Scalar => 0,
                Shape::Vector => 1,
                Shape::Matrix => 2,
            };
            let outputs = item.outputs();
            let of = |k: usize| self.joined(code, &outputs[k..=k], |of| of[0].clone());
            all.push(field(&item.name, &item.about, rank, outputs.len(), of)?);
        }
        all.extend(self.stresses(code, ["F", "J", "P", "F_zz"].map(outputs))?);
        Ok(all)
    }

    /// The Cauchy stress `P F^T / J` and the second Piola-Kirchhoff stress `F^-1 P`, both symmetric.
    fn stresses(
        &self,
        code: &Code<'_>,
        [F, J, P, across]: [Vec<Slot>; 4],
    ) -> Result<[Field; 2], Unwritable> {
        let d = code.spec.dimension;
        let all: Vec<Slot> = [F, J, P, across].concat();
        let entry = |of: &[String], tensor: usize, i: usize, j: usize| {
            of[tensor * (d * d + 1) + i * d + j].clone()
        };
        let (deformation, stress) = (0, 1);
        let sum = |factors: Vec<[String; 2]>| {
            let terms: Vec<String> = factors.iter().map(|[a, b]| format!("{a}*{b}")).collect();
            format!("({})", terms.join(" + "))
        };
        let area = |of: &[String]| of[d * d].clone();
        let volume = |of: &[String]| match of.get(2 * d * d + 1) {
            None => area(of),
            Some(across) => format!("({}{})", area(of), format!("*{across}").repeat(3 - d)),
        };
        let sigma = |k: usize| {
            self.joined(code, &all, |of| {
                let factors = |m| [entry(of, stress, k / d, m), entry(of, deformation, k % d, m)];
                format!("{}/{}", sum((0..d).map(factors).collect()), volume(of))
            })
        };
        let S = |k: usize| {
            self.joined(code, &all, |of| {
                let F = |i: usize, j: usize| entry(of, deformation, i % d, j % d);
                // J F^-1
                let adjugate = |i: usize, j: usize| match d {
                    1 => "1.0".to_owned(),
                    2 if i == j => F(1 - i, 1 - j),
                    2 => format!("(0.0 - {})", F(i, j)),
                    _ => format!(
                        "({}*{} - {}*{})",
                        F(j + 1, i + 1),
                        F(j + 2, i + 2),
                        F(j + 1, i + 2),
                        F(j + 2, i + 1)
                    ),
                };
                let factors = |m| [adjugate(k / d, m), entry(of, stress, m, k % d)];
                format!("{}/{}", sum((0..d).map(factors).collect()), area(of))
            })
        };
        Ok([
            field("sigma", "Cauchy stress", 2, d * d, sigma)?,
            field("S", "second Piola-Kirchhoff stress", 2, d * d, S)?,
        ])
    }

    /// The value of a scalar that depends on the parameters only.
    pub(crate) fn constant(&self, code: &Code<'_>, name: &str) -> f64 {
        let items = code.functions();
        let values = items.iter().find(|item| item.name == name).map(|item| item.values(code));
        values.and_then(|values| values.first().copied()).unwrap_or(f64::NAN)
    }

    /// An expression of some outputs: `join` receives the expression of each.
    fn joined(
        &self,
        code: &Code<'_>,
        outputs: &[Slot],
        join: impl FnOnce(&[String]) -> String,
    ) -> Result<String, Unwritable> {
        let block = code.staged.after_parameters(outputs);
        let fixed = code.fixed_values();
        let mut known: BTreeMap<usize, Value> = BTreeMap::new();
        let mut statements = String::new();
        let value = |known: &BTreeMap<usize, Value>, operand: Operand<'_>| match operand {
            Operand::Temporary(index) => known.get(&index).cloned().unwrap_or(Value::Zero),
            Operand::Number(value) => Value::number(nearest_f64(value)),
            Operand::Pi => Value::number(std::f64::consts::PI),
            Operand::Time => Value::Text("t".to_owned()),
            Operand::Coordinate(index) => Value::Text(self.coordinates[index.min(2)].to_owned()),
            Operand::Parameter(index) => Value::number(code.spec.parameters[index].default),
            Operand::Kept(_, index) => Value::number(fixed[index]),
        };
        for (index, operation) in block.steps() {
            let operands: Vec<Value> =
                operation.operands().map(|slot| value(&known, block.operand(slot))).collect();
            let result = match (operation, operands.as_slice()) {
                // The rounding error of a sum or a product is smaller than the loss of these expressions.
                (Operation::SumError(..) | Operation::ProductError(..), _)
                | (Operation::Mul(..), [Value::Zero, _] | [_, Value::Zero]) => Value::Zero,
                (Operation::Add(..) | Operation::Sub(..), [value, Value::Zero])
                | (Operation::Add(..), [Value::Zero, value]) => value.clone(),
                _ => {
                    let texts: Vec<String> = operands.into_iter().map(Value::text).collect();
                    let text = self.operation(code, operation, &texts)?;
                    Value::Text(if self.names_values {
                        statements += &format!("t{index} := {text}; ");
                        format!("t{index}")
                    } else {
                        text
                    })
                }
            };
            known.insert(index, result);
        }
        let of: Vec<String> =
            block.outputs().map(|operand| value(&known, operand).text()).collect();
        Ok(statements + &join(&of))
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
            Operation::Call(Function::Ln1p, _) => self.logarithm(code, one())?,
            Operation::Call(Function::Ln1pMinusX, _) => {
                format!("({} - {})", self.logarithm(code, one())?, one())
            }
            Operation::Call(Function::PositivePart, _) => format!("(0.5*({0} + abs({0})))", one()),
            Operation::Call(Function::PositivePartSlope, _) => {
                format!("(0.5 + 0.5*{0}/(abs({0}) + 1e-300))", one())
            }
            Operation::Call(Function::Expm1, _) => {
                format!("(2.0*sinh(0.5*{0})*exp(0.5*{0}))", one())
            }
            Operation::Call(function, _) => {
                self.call(code, Called::of(*function).or_library(), *function, operands)?
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

/// A field of this rank with the entries `of(index)`, row by row.
fn field(
    name: &str,
    about: &str,
    rank: u32,
    entries: usize,
    of: impl Fn(usize) -> Result<String, Unwritable>,
) -> Result<Field, Unwritable> {
    let d = if rank == 2 { entries.isqrt() } else { entries };
    let entry = |index: usize| {
        let places = match rank {
            0 => String::new(),
            1 => format!("_{index}"),
            _ => format!("_{}{}", index / d, index % d),
        };
        Ok(Entry { name: format!("{name}{places}"), text: of(index)? })
    };
    let entries = (0..entries).map(entry).collect::<Result<_, Unwritable>>()?;
    Ok(Field { name: name.to_owned(), about: about.to_owned(), entries })
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
