//! Limits of the constants of laws with memory: stresses and times are positive, shares are parts of one.
//!
//! The defaults of the parameters are refused at the line; other values of parameters meet a [`Requirement`].

use crate::Diagnostic;
use crate::document::{Document, Text};
use crate::sense::{figure, given};
use crate::spec::{Parameter, Reader, Relation, Requirement};
use mmsmith_expr::{Expr, Graph, Program};
use mmsmith_vocabulary::{Element, Flow, Memory, Overstress};
use std::collections::BTreeSet;

/// A constant of a law, and what it is held against.
struct Limit<'a> {
    /// The constant in words.
    what: &'a str,
    text: &'a Text,
    value: Expr,
    relation: Relation,
    bound: i64,
    /// The limit in words, to follow "must be".
    admissible: &'static str,
}

impl<'a> Limit<'a> {
    fn positive(what: &'a str, text: &'a Text, value: Expr) -> Self {
        let (relation, admissible) = (Relation::Greater, "a positive number");
        Self { what, text, value, relation, bound: 0, admissible }
    }
}

impl Reader<'_> {
    /// Requirements on the constants of a law with memory.
    ///
    /// # Errors
    ///
    /// The constant that does not with the defaults of the parameters.
    pub(crate) fn limits_of_memory(
        &mut self,
        document: &Document,
        memory: Option<&Memory<Expr>>,
        parameters: &[Parameter],
    ) -> Result<Vec<Requirement>, Diagnostic> {
        let table = document.material.get_ref();
        let limits = match (memory, &table.flow) {
            (None, _) | (Some(Memory::Flow(_)), None) => return Ok(Vec::new()),
            (Some(Memory::Flow(flow)), Some(table)) => {
                let table = table.get_ref();
                limits_of_flow(flow, [&table.r#yield, &table.drag, &table.exponent, &table.time])
            }
            (Some(Memory::Maxwell(elements)), _) => {
                let tables: Vec<_> = table.maxwell.0.iter().map(|one| one.get_ref()).collect();
                let mut limits = Vec::new();
                for (Element { share, time }, texts) in elements.iter().zip(&tables) {
                    limits.push(Limit {
                        relation: Relation::GreaterOrEqual,
                        admissible: "a share of the stiffness, from 0 to 1",
                        ..Limit::positive("share", &texts.share, *share)
                    });
                    limits.push(Limit::positive("time", &texts.time, *time));
                }
                if let Some(last) = tables.last() {
                    let sum = elements
                        .iter()
                        .fold(Graph::ZERO, |sum, one| self.scope.graph.add(sum, one.share));
                    limits.push(Limit {
                        what: "the sum of the shares",
                        text: &last.share,
                        value: sum,
                        relation: Relation::LessOrEqual,
                        bound: 1,
                        admissible: "at most 1: what is left of 1 does not relax",
                    });
                }
                limits
            }
        };
        self.hold(&limits, parameters)
    }

    /// Refuses defaults beyond a limit; the requirements on other values.
    fn hold(
        &mut self,
        limits: &[Limit<'_>],
        parameters: &[Parameter],
    ) -> Result<Vec<Requirement>, Diagnostic> {
        let mut requirements = Vec::new();
        let symbols: BTreeSet<Expr> =
            parameters.iter().map(|p| self.scope.graph.symbol(&p.name)).collect();
        let inputs: Vec<_> = parameters
            .iter()
            .map(|p| (self.scope.graph.symbol(&p.name), Default::default()))
            .collect();
        let defaults: Vec<f64> = parameters.iter().map(|p| p.default).collect();
        for limit in limits {
            let Limit { what, text, value, relation, bound, admissible } = limit;
            // Lowering adds to a graph; what is generated does not depend on this check.
            let mut graph = self.scope.graph.clone();
            let found = Program::lower(&mut graph, &inputs, &[], &[*value]).evaluate(&defaults)[0];
            if !(relation.holds(found, *bound as f64) && found.is_finite()) {
                let message =
                    format!("{what} is {} with the default parameters", figure(found + 0.0));
                let help = format!("{what} must be {admissible}{}", given(parameters));
                return Err(self.scope.source.error(message, text.span.clone(), Some(help)));
            }
            if self.scope.graph.depends_on(*value, &symbols) {
                let printed = self.scope.graph.print(*value);
                requirements.push(Requirement {
                    text: format!("{printed} {} {bound} ({what} of the material)", relation.sign()),
                    left: *value,
                    relation: *relation,
                    right: self.scope.graph.integer(*bound),
                });
            }
        }
        Ok(requirements)
    }
}

/// Limits of a flow, whose yield stress, drag, exponent and time have these texts.
fn limits_of_flow<'a>(
    flow: &Flow<Expr>,
    [yields, drag, exponent, time]: [&'a Option<Text>; 4],
) -> Vec<Limit<'a>> {
    let mut limits = Vec::new();
    if let Some(text) = yields {
        let positive = Limit::positive("the yield stress at the start", text, flow.yield_stress);
        limits.push(match flow.overstress {
            None => positive,
            // Flow at every stress, as of a power law.
            Some(_) => Limit {
                relation: Relation::GreaterOrEqual,
                admissible: "zero or positive",
                ..positive
            },
        });
    }
    if let Some(Overstress { drag: of_drag, exponent: of_exponent, time: of_time }) =
        flow.overstress
    {
        if let Some(text) = drag {
            limits.push(Limit::positive("drag", text, of_drag));
        }
        if let Some(text) = exponent {
            limits.push(Limit {
                what: "exponent",
                text,
                value: of_exponent,
                relation: Relation::GreaterOrEqual,
                bound: 1,
                admissible: "at least 1: with a smaller one flow begins with an infinite slope",
            });
        }
        if let Some(text) = time {
            limits.push(Limit::positive("time", text, of_time));
        }
    }
    limits
}
