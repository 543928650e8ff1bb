//! How languages spell programs, and the hosts that files are written for.

use crate::code::Code;
use crate::text::{push_index, spell};
use mmsmith_expr::{Function, Operation, Rational, nearest_f64};
use mmsmith_stage::{Block, Operand};
use std::borrow::Cow;
use thiserror::Error;

/// A language that solutions are written in: how it spells each part of a program.
pub(crate) trait Target {
    /// The places of values that a function does not compute.
    type Places: Copy;

    /// Text before the index of a value in a statement that names the value, and text at the end of the statement.
    const STATEMENT: [&'static str; 2];

    /// A double; negative numbers in a form that can stand behind a sign.
    fn literal(&self, value: f64) -> String;

    /// A call of a function, with `#` for each argument.
    fn function(&self, function: Called) -> Cow<'static, str>;

    /// Writes the place of a value that is not computed in the same block.
    fn operand(&self, text: &mut String, operand: Operand<'_>, places: Self::Places);

    /// A number of the specification.
    fn number(&self, value: &Rational) -> String {
        self.literal(nearest_f64(value))
    }

    /// A power with a constant exponent, with `#` for the base.
    fn power(&self, exponent: &Rational) -> String {
        let call = self.function(Called::Library("pow"));
        let exponent = self.number(exponent);
        call.rsplit_once('#')
            .map_or_else(String::new, |(before, after)| before.to_owned() + &exponent + after)
    }

    /// An operation, with `#` for each operand. Numbers and inputs are operands and have no statement.
    fn operation(&self, operation: &Operation) -> Cow<'static, str> {
        let call = match operation {
            Operation::Number(value) => return self.number(value).into(),
            Operation::Pi => return self.literal(std::f64::consts::PI).into(),
            Operation::Power(_, exponent) => return self.power(exponent).into(),
            Operation::Call(function, _) => Called::of(*function),
            Operation::Sqrt(_) => Called::Library("sqrt"),
            Operation::Atan2(..) => Called::Library("atan2"),
            Operation::SinPi(_) => Called::Support("sin_pi"),
            Operation::CosPi(_) => Called::Support("cos_pi"),
            Operation::LnOfBoth(..) => Called::Support("ln_of_both"),
            Operation::SumError(..) => Called::Support("sum_error"),
            Operation::ProductError(..) => Called::Support("product_error"),
            other => return arithmetic(other).into(),
        };
        self.function(call)
    }

    /// The statements of a block, a line each, and its outputs as expressions.
    fn block(&self, block: &Block<'_>, margin: &str, places: Self::Places) -> Written {
        let [before, after] = Self::STATEMENT;
        let mut lines = String::new();
        for (index, operation) in block.steps() {
            lines.extend([margin, before, "t"]);
            push_index(&mut lines, index);
            lines.push_str(" = ");
            spell(&mut lines, &self.operation(operation), operation, |text, slot| {
                self.value(text, block.operand(slot), places);
            });
            lines.push_str(after);
        }
        let output = |operand| {
            let mut text = String::new();
            self.value(&mut text, operand, places);
            text
        };
        Written { lines, outputs: block.outputs().map(output).collect() }
    }

    /// A value of the same block, a number or [`Target::operand`].
    fn value(&self, text: &mut String, operand: Operand<'_>, places: Self::Places) {
        match operand {
            Operand::Temporary(index) => {
                text.push('t');
                push_index(text, index);
            }
            Operand::Number(value) => text.push_str(&self.number(value)),
            Operand::Pi => text.push_str(&self.operation(&Operation::Pi)),
            other => self.operand(text, other, places),
        }
    }
}

/// The spelling of sums, products and other operations that all languages share; empty for other operations.
pub(crate) fn arithmetic(operation: &Operation) -> &'static str {
    match operation {
        Operation::Add(..) => "# + #",
        Operation::Sub(..) => "# - #",
        Operation::Mul(..) => "# * #",
        Operation::Div(..) => "# / #",
        Operation::Neg(_) => "-#",
        _ => "",
    }
}

/// A block as a language spells it.
pub(crate) struct Written {
    /// The statements.
    pub(crate) lines: String,
    /// The outputs.
    pub(crate) outputs: Vec<String>,
}

/// A function that generated code calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Called {
    /// A function of `math.h`, by its name there.
    Library(&'static str),
    /// A function of the project, by its name in the file `runtime.txt`.
    Support(&'static str),
}

impl Called {
    pub(crate) fn of(function: Function) -> Self {
        match function.own() {
            Some(name) => Called::Support(name),
            None => Called::Library(function.math_h().unwrap_or_default()),
        }
    }

    /// The host's own sine, cosine, exponential and logarithm in place of the project's: for hosts that do not promise the bits of Rust, and
    /// whose functions are faster or have derivatives.
    pub(crate) fn or_library(self) -> Self {
        match self {
            Called::Support("sine") => Called::Library("sin"),
            Called::Support("cosine") => Called::Library("cos"),
            Called::Support("exponential") => Called::Library("exp"),
            Called::Support("logarithm") => Called::Library("log"),
            other => other,
        }
    }

    /// Whether it has two arguments.
    pub(crate) fn takes_two(self) -> bool {
        matches!(
            self,
            Called::Library("atan2" | "pow")
                | Called::Support(
                    "ln_of_both"
                        | "sum_error"
                        | "product_error"
                        | "far_logarithm"
                        | "angle_rest"
                        | "angle_tail"
                        | "rest_sine"
                        | "rest_cosine"
                )
        )
    }
}

/// A host that a solution can be written for.
#[derive(Debug)]
pub struct Host {
    /// The name for `--target`.
    pub name: &'static str,
    /// The files of the host, in a line.
    pub about: &'static str,
    /// The end of a file's name, after the name of the module.
    pub ending: &'static str,
    /// Whether its files have bodies of revolution in their half plane; else in Cartesian components in space.
    pub in_half_plane: bool,
    /// Whether its files read tables of fields that follow from histories.
    pub reads_tables: bool,
    /// The text of the file.
    pub(crate) write: fn(&Code<'_>) -> Result<String, Unwritable>,
}

impl Host {
    /// The name of the file of a solution.
    #[must_use]
    pub fn file_name(&self, module: &str) -> String {
        format!("{module}{}", self.ending)
    }

    /// The text of the file.
    ///
    /// # Errors
    ///
    /// [`Unwritable`] where the host cannot express a part of the solution.
    pub fn source(&self, code: &Code<'_>) -> Result<String, Unwritable> {
        if code.spec.has_history() && (code.table.is_none() || !self.reads_tables) {
            return Err(Unwritable::History {
                target: self.name,
                solution: code.spec.name.clone(),
            });
        }
        (self.write)(code)
    }
}

/// The reason why a host cannot express a solution.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum Unwritable {
    /// A function that the host's expressions lack.
    #[error(
        "--target {target}: the expressions of {target} have no form of {function}, which {solution} calls; choose a target \
         with functions of its own, such as cpp, fortran or numpy"
    )]
    Function {
        /// The host.
        target: &'static str,
        /// The function, as specifications call it.
        function: String,
        /// The solution.
        solution: String,
    },
    /// Stresses that no expression has.
    #[error(
        "--target {target}: the stress of {solution} follows from the history of each particle, for which {target} has no expression; \
         write a source with a table for a target with functions of its own, mms gen {solution} --target numpy --out DIR, or take the \
         fields at points of yours, mms eval {solution} --points points.csv --csv fields.csv"
    )]
    History {
        /// The host.
        target: &'static str,
        /// The solution.
        solution: String,
    },
}
