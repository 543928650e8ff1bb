//! A solution that is ready to be written down.

use mmsmith_expr::{Function, Operation};
use mmsmith_spec::{DeriveError, Spec};
use mmsmith_stage::Staged;

/// A solution whose fields are derived and staged, ready to be written down in Rust or in C.
pub struct Code<'a> {
    pub(crate) spec: &'a Spec,
    pub(crate) staged: Staged,
}

impl<'a> Code<'a> {
    /// Derives and stages the fields of a specification.
    ///
    /// # Errors
    ///
    /// [`DeriveError`] where a field is nowhere defined.
    pub fn new(spec: &'a Spec) -> Result<Self, DeriveError> {
        Ok(Code { spec, staged: Staged::of(spec, spec.derive()?) })
    }

    /// Whether any operation calls such a function.
    pub(crate) fn calls(&self, such: impl Fn(Function) -> bool) -> bool {
        let mut operations = self.staged.program().operations().iter();
        operations.any(|operation| match operation {
            Operation::Call(function, _) => such(*function),
            Operation::LnOfBoth(..) => such(Function::LnOfBoth),
            _ => false,
        })
    }

    /// Whether any operation asks for what rounding takes from a sum or a product.
    pub(crate) fn forms_rounding_errors(&self) -> bool {
        let mut operations = self.staged.program().operations().iter();
        operations.any(|o| matches!(o, Operation::SumError(..) | Operation::ProductError(..)))
    }

    /// The displacement and the law, a line each.
    pub(crate) fn formulas(&self) -> Vec<String> {
        let spec = self.spec;
        let names = spec.coordinates.coordinate_names(spec.dimension);
        let mut lines: Vec<String> = names
            .iter()
            .zip(&spec.displacement)
            .map(|(name, component)| format!("u_{name} = {}", spec.graph.print(*component)))
            .collect();
        lines.extend(spec.rotation.map(|rotation| rotation.formula(&spec.graph)));
        lines.extend(spec.material.formulas(&spec.graph));
        lines
    }
}
