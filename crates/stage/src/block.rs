//! Straight-line code of one stage: the operations that some outputs need, given what earlier stages keep.

use mmsmith_expr::{Operation, Program, Rational, Slot};
use std::collections::BTreeMap;

/// When a kept value is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Once for given parameters.
    Fixed,
    /// Once a time.
    Time,
    /// Once a point.
    Point,
    /// Once a time for each layer of a lattice along this axis.
    Layer(usize),
}

/// Where an operation finds a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Operand<'a> {
    /// Computed in the same block, by the operation of this index.
    Temporary(usize),
    /// A constant.
    Number(&'a Rational),
    /// The circle number.
    Pi,
    /// Coordinate number `i`.
    Coordinate(usize),
    /// The time.
    Time,
    /// Parameter number `i`.
    Parameter(usize),
    /// Kept by an earlier stage, as its value number `i`.
    Kept(Stage, usize),
}

/// Straight-line code: the operations that some outputs need, in order, given what earlier stages keep.
pub struct Block<'a> {
    program: &'a Program,
    dimension: usize,
    kept: BTreeMap<Slot, (Stage, usize)>,
    steps: Vec<Slot>,
    outputs: Vec<Slot>,
}

impl<'a> Block<'a> {
    /// `outputs` of a program with `dimension` coordinates among its inputs, where `kept` says what earlier stages keep.
    pub(crate) fn new(
        program: &'a Program,
        dimension: usize,
        kept: BTreeMap<Slot, (Stage, usize)>,
        outputs: Vec<Slot>,
    ) -> Self {
        let needed = needed(program, &kept, &outputs);
        let steps = program
            .slots()
            .filter(|slot| needed[slot.index()] && is_computed(program, *slot))
            .collect();
        Block { program, dimension, kept, steps, outputs }
    }

    /// The operations, with the index that names the result of each.
    pub fn steps(&self) -> impl Iterator<Item = (usize, &'a Operation)> {
        self.steps.iter().map(|slot| (slot.index(), &self.program.operations()[slot.index()]))
    }

    /// Where the results are, in the order in which they were asked for.
    pub fn outputs(&self) -> impl Iterator<Item = Operand<'a>> {
        self.outputs.iter().map(|slot| self.operand(*slot))
    }

    /// Where an operation of the block finds the value of a slot.
    #[must_use]
    pub fn operand(&self, slot: Slot) -> Operand<'a> {
        if let Some(&(stage, index)) = self.kept.get(&slot) {
            return Operand::Kept(stage, index);
        }
        match &self.program.operations()[slot.index()] {
            Operation::Number(value) => Operand::Number(value),
            Operation::Pi => Operand::Pi,
            // The inputs are the coordinates, the time and the parameters, in this order.
            Operation::Input(index) if *index < self.dimension => Operand::Coordinate(*index),
            Operation::Input(index) if *index == self.dimension => Operand::Time,
            Operation::Input(index) => Operand::Parameter(index - self.dimension - 1),
            _ => Operand::Temporary(slot.index()),
        }
    }

    /// Whether any operation or output reads such an operand.
    pub fn reads(&self, such: impl Fn(Operand<'a>) -> bool) -> bool {
        self.steps().flat_map(|(_, step)| step.operands()).any(|slot| such(self.operand(slot)))
            || self.outputs().any(such)
    }
}

/// The values of one stage by number.
pub(crate) fn numbered(
    stage: Stage,
    slots: &[Slot],
) -> impl Iterator<Item = (Slot, (Stage, usize))> {
    slots.iter().enumerate().map(move |(index, &slot)| (slot, (stage, index)))
}

/// Whether the value in `slot` takes an operation.
pub(crate) fn is_computed(program: &Program, slot: Slot) -> bool {
    let operation = &program.operations()[slot.index()];
    !matches!(operation, Operation::Number(_) | Operation::Pi | Operation::Input(_))
}

/// Which operations `outputs` need, where kept values need none.
pub(crate) fn needed<K>(
    program: &Program,
    kept: &BTreeMap<Slot, K>,
    outputs: &[Slot],
) -> Vec<bool> {
    let mut needed = vec![false; program.operations().len()];
    let mut stack = outputs.to_vec();
    while let Some(slot) = stack.pop() {
        if !kept.contains_key(&slot) && !needed[slot.index()] {
            needed[slot.index()] = true;
            stack.extend(program.operations()[slot.index()].operands());
        }
    }
    needed
}
