//! Expressions put in for others.

use crate::graph::NumberMap;
use crate::{Expr, Graph};
use std::collections::BTreeMap;

/// Expressions and their replacements. Parts that several expressions share are rebuilt once.
#[derive(Clone, Debug)]
pub struct Replacement {
    /// Given, and found since.
    known: NumberMap<Expr, Expr>,
}

impl Replacement {
    /// The second of each pair for the first.
    pub fn new(pairs: impl IntoIterator<Item = (Expr, Expr)>) -> Self {
        Replacement { known: pairs.into_iter().collect() }
    }

    /// `expr` with what is known replaced, from the root downwards.
    pub fn of(&mut self, graph: &mut Graph, expr: Expr) -> Expr {
        if self.known.is_empty() {
            return expr;
        }
        if let Some(&known) = self.known.get(&expr) {
            return known;
        }
        let result = graph.map_children(expr, &mut |graph, child| self.of(graph, child));
        self.known.insert(expr, result);
        result
    }
}

impl Graph {
    /// `expr` with each expression that `replacement` knows replaced, from the root downwards.
    pub fn replace(&mut self, expr: Expr, replacement: &BTreeMap<Expr, Expr>) -> Expr {
        Replacement::new(replacement.iter().map(|(&of, &by)| (of, by))).of(self, expr)
    }
}
