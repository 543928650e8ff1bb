//! Outputs of a program in groups, so that none is found by counting those before it.

use mmsmith_expr::{Expr, Program, Slot};
use std::ops::Range;

/// The expressions that a program is to compute.
#[derive(Default)]
pub(crate) struct Outputs {
    expressions: Vec<Expr>,
}

/// One output.
#[derive(Clone, Copy)]
pub(crate) struct Single {
    place: usize,
}

/// Some successive outputs.
pub(crate) struct Group {
    places: Range<usize>,
}

impl Outputs {
    /// Asks for further outputs.
    pub(crate) fn add(&mut self, expressions: impl IntoIterator<Item = Expr>) -> Group {
        let first = self.expressions.len();
        self.expressions.extend(expressions);
        Group { places: first..self.expressions.len() }
    }

    /// Asks for one further output.
    pub(crate) fn add_one(&mut self, expression: Expr) -> Single {
        self.expressions.push(expression);
        Single { place: self.expressions.len() - 1 }
    }

    pub(crate) fn expressions(&self) -> &[Expr] {
        &self.expressions
    }
}

impl Single {
    /// Where the value is in the program of these outputs.
    pub(crate) fn slot(self, program: &Program) -> Slot {
        program.outputs()[self.place]
    }
}

impl Group {
    /// The places among the outputs.
    pub(crate) fn places(&self) -> Range<usize> {
        self.places.clone()
    }

    /// Where the values are in the program of these outputs.
    pub(crate) fn slots(&self, program: &Program) -> Vec<Slot> {
        program.outputs()[self.places()].to_vec()
    }
}
