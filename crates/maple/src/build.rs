//! Assignments to expressions of a graph.

use crate::Listing;
use mmsmith_expr::{Expr, Graph};
use std::collections::BTreeMap;
use std::ops::Range;
use thiserror::Error;

/// Why a listing has no meaning in a graph.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{message}")]
pub struct BuildError {
    /// What is wrong, and what would be right.
    pub message: String,
    /// Where, in bytes from the start of the listing.
    pub span: Range<usize>,
}

impl Listing {
    /// The expressions that the targets stand for, by target. `names` gives the free names their meaning; `pi`,
    /// `Pi` and `M_PI` are the circle number where it does not.
    ///
    /// # Errors
    ///
    /// [`BuildError`] at names without meaning, division by zero, and exponents, depths or sizes beyond the limits
    /// of [`Graph::build`].
    pub fn build(
        &self,
        graph: &mut Graph,
        names: &BTreeMap<String, Expr>,
    ) -> Result<BTreeMap<String, Expr>, BuildError> {
        let mut built: BTreeMap<String, Expr> = BTreeMap::new();
        for assignment in &self.assignments {
            let value = graph.build(&assignment.value, &mut |graph, name| {
                if let Some(&known) = built.get(name).or_else(|| names.get(name)) {
                    return Ok(known);
                }
                if matches!(name, "pi" | "M_PI") {
                    return Ok(graph.pi());
                }
                let known: Vec<&str> = names.keys().map(String::as_str).collect();
                let known = known.join(", ");
                Err(format!("nothing says what '{name}' is; the names given are {known}"))
            });
            let value =
                value.map_err(|error| BuildError { message: error.message, span: error.span })?;
            built.insert(assignment.target.clone(), value);
        }
        Ok(built)
    }
}
