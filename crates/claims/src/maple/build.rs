//! Assignments to expressions of a graph.

use crate::maple::Listing;
use mmsmith_expr::{Expr, Graph, Node, Rational};
use std::collections::BTreeMap;
use std::ops::Range;
use thiserror::Error;

/// The longest numerator or denominator of an exact number that an assignment may make; chains of squares would
/// double it with every line.
const MOST_BITS: u64 = 4096;

/// The reason why a listing has no meaning in a graph.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{message}")]
pub struct BuildError {
    /// The mistake, and its correction.
    pub message: String,
    /// The place, in bytes from the start of the listing.
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
            let bits = largest_number(graph, value);
            if bits > MOST_BITS {
                let target = &assignment.target;
                let message =
                    format!("{target} has numbers of {bits} bits; {MOST_BITS} are the limit");
                return Err(BuildError { message, span: assignment.span.clone() });
            }
            built.insert(assignment.target.clone(), value);
        }
        Ok(built)
    }
}

/// The bits of the longest number in the root of `expr` and right below it, where new numbers come up.
fn largest_number(graph: &Graph, expr: Expr) -> u64 {
    let bits = |number: &Rational| number.bits().0.max(number.bits().1);
    let in_node = |expr: Expr| match graph.node(expr) {
        Node::Number(value) => bits(value),
        Node::Sum { constant, terms } => {
            terms.iter().map(|(_, c)| bits(c)).max().unwrap_or(0).max(bits(constant))
        }
        Node::Product(factors) => factors.iter().map(|(_, e)| bits(e)).max().unwrap_or(0),
        Node::Pi | Node::Symbol(_) | Node::Call(..) | Node::Whole(_) => 0,
    };
    graph.children(expr).chain([expr]).map(in_node).max().unwrap_or(0)
}
