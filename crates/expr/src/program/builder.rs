//! A program in the making.

use super::{Dependence, Operation, Program, Slot};
use crate::Rational;
use crate::graph::NumberMap;
use num_traits::One;

/// The operations of a program that grows, each with what it depends on; equal operations are one.
#[derive(Debug, Default)]
pub(crate) struct Builder {
    operations: Vec<Operation>,
    dependence: Vec<Dependence>,
    known: NumberMap<Operation, Slot>,
}

impl Builder {
    /// All operations of `program`, in their places.
    pub(crate) fn of(program: &Program) -> Self {
        let mut known = NumberMap::default();
        for slot in program.slots() {
            known.entry(program.operations()[slot.index()].clone()).or_insert(slot);
        }
        Builder {
            operations: program.operations().to_vec(),
            dependence: program.slots().map(|slot| program.dependence(slot)).collect(),
            known,
        }
    }

    /// Where an operation is, which is put after the others unless it is there already. It depends on what its operands do.
    pub(crate) fn push(&mut self, operation: Operation) -> Slot {
        self.push_input(operation, Dependence::default())
    }

    /// As [`push`](Self::push), for an input, which has no operands and depends on `own`.
    pub(crate) fn push_input(&mut self, operation: Operation, own: Dependence) -> Slot {
        if let Some(&slot) = self.known.get(&operation) {
            return slot;
        }
        let operands = operation.operands().map(|slot| self.dependence[slot.index()]);
        let dependence = operands.fold(own, Dependence::join);
        let slot = Slot::at(self.operations.len());
        self.operations.push(operation.clone());
        self.dependence.push(dependence);
        self.known.insert(operation, slot);
        slot
    }

    /// Where an operation is, if it is there.
    pub(crate) fn find(&self, operation: &Operation) -> Option<Slot> {
        self.known.get(operation).copied()
    }

    pub(crate) fn operation(&self, slot: Slot) -> &Operation {
        &self.operations[slot.index()]
    }

    pub(crate) fn dependence(&self, slot: Slot) -> Dependence {
        self.dependence[slot.index()]
    }

    pub(crate) fn one(&mut self) -> Slot {
        self.push(Operation::Number(Rational::one()))
    }

    pub(crate) fn times(&mut self, a: Slot, b: Slot) -> Slot {
        self.push(Operation::Mul(a, b))
    }

    /// `base ^ exponent` by squaring; the base itself for exponents below two.
    pub(crate) fn power(&mut self, base: Slot, exponent: u32) -> Slot {
        power(base, exponent, &mut |a, b| self.times(a, b))
    }

    pub(crate) fn with_sign(&mut self, negative: bool, slot: Slot) -> Slot {
        if negative { self.push(Operation::Neg(slot)) } else { slot }
    }

    /// The program of `outputs`, with operations that none of them needs.
    pub(crate) fn program(self, outputs: Vec<Slot>) -> Program {
        Program::from_parts(self.operations, self.dependence, outputs)
    }
}

/// `base ^ exponent` by squaring, where `times` multiplies; the base itself for exponents below two.
pub(crate) fn power<T: Copy>(base: T, exponent: u32, times: &mut impl FnMut(T, T) -> T) -> T {
    if exponent <= 1 {
        return base;
    }
    let half = power(base, exponent / 2, times);
    let square = times(half, half);
    if exponent.is_multiple_of(2) { square } else { times(square, base) }
}
