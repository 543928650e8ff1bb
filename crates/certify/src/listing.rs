//! Programs as text: one operation a line, its operands by their line numbers from 0.

use mmsmith_expr::{Operation, Program};

/// The word for an operation.
pub(crate) fn name(operation: &Operation) -> &'static str {
    match operation {
        Operation::Number(_) => "number",
        Operation::Pi => "pi",
        Operation::Input(_) => "input",
        Operation::Add(..) => "add",
        Operation::Sub(..) => "sub",
        Operation::Mul(..) => "mul",
        Operation::Div(..) => "div",
        Operation::Neg(_) => "neg",
        Operation::Sqrt(_) => "sqrt",
        Operation::Power(..) => "power",
        Operation::SinPi(_) => "sin_pi",
        Operation::CosPi(_) => "cos_pi",
        Operation::Atan2(..) => "atan2",
        Operation::LnOfBoth(..) => "ln_of_both",
        Operation::SumError(..) => "sum_error",
        Operation::ProductError(..) => "product_error",
        Operation::Call(function, _) => function.name(),
    }
}

/// The lines of a program: a word, then a number, the index of an input, or the lines of the operands.
pub(crate) fn lines(program: &Program) -> Vec<String> {
    let line = |operation: &Operation| {
        let mut line = name(operation).to_owned();
        match operation {
            Operation::Number(number) => line += &format!(" {number}"),
            Operation::Input(index) => line += &format!(" {index}"),
            _ => {}
        }
        for operand in operation.operands() {
            line += &format!(" {}", operand.index());
        }
        if let Operation::Power(_, exponent) = operation {
            line += &format!(" {exponent}");
        }
        line
    };
    program.operations().iter().map(line).collect()
}
