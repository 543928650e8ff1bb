//! Laws that remember, or depend on more than the deformation: given fields, flow, Maxwell elements, internal variables.

use crate::coordinates::Coordinates;
use crate::document::{Document, FlowTable, Text};
use crate::law::energy::rate_names;
use crate::law::prestress;
use crate::spec::{Law, Reader};
use crate::{Diagnostic, Spec};
use mmsmith_expr::{Derivatives, Expr, Graph, Node, Rational};
use mmsmith_vocabulary::{Element, Flow, Material, Memory, Overstress};
use std::collections::BTreeMap;
use toml::Spanned;

/// A field of position and time that a law may use.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Given {
    /// Its name.
    pub name: String,
    /// Its symbol in the law.
    pub symbol: Expr,
    /// The field; it may use the symbols of fields before it.
    pub value: Expr,
}

/// An internal variable of a law that the specification states.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InternalVariable {
    /// Its name, which is a symbol in the law.
    pub name: String,
    /// Its rate, in what the response may use.
    pub rate: Expr,
    /// Its value at time zero.
    pub initial: Expr,
}

/// Kinds of flow.
#[derive(Clone, Copy, PartialEq, Eq)]
enum FlowKind {
    J2,
    Perzyna,
    PowerLaw,
}

impl FlowKind {
    const NAMES: [(&'static str, Self); 3] =
        [("j2", Self::J2), ("perzyna", Self::Perzyna), ("power-law", Self::PowerLaw)];
}

/// The names of the internal variables, in the order of the file.
fn internal_names(document: &Document) -> impl Iterator<Item = String> {
    document.internal.0.iter().map(|(name, _)| name.get_ref().clone())
}

impl Reader<'_> {
    /// Reads `[given]`.
    pub(crate) fn given(&mut self, document: &Document) -> Result<Vec<Given>, Diagnostic> {
        let mut given = Vec::new();
        for (name, text) in &document.given.0 {
            let (symbol, value) = self.scope.declare_given(name.get_ref(), name.span(), text)?;
            given.push(Given { name: name.get_ref().clone(), symbol, value });
        }
        Ok(given)
    }

    /// Reads `[internal]`.
    pub(crate) fn internal(
        &mut self,
        document: &Document,
        law: &Law,
    ) -> Result<Vec<InternalVariable>, Diagnostic> {
        let mut internal = Vec::new();
        let mut names = self.stress_names(document);
        names.sort();
        for (name, table) in &document.internal.0 {
            if matches!(law, Law::Library(_)) {
                let message = format!(
                    "the law '{}' of the library does not use the internal variable '{}'",
                    law.name(),
                    name.get_ref()
                );
                let help = "state the stress in [material] with law = 'stress' and P = { 11 = '...' }, where internal variables are names";
                return Err(self.scope.source.error(message, name.span(), Some(help.into())));
            }
            self.scope.check_new_name(name.get_ref(), name.span())?;
            let rate = self.scope.response(&table.rate, "a rate", &names)?;
            let initial = match &table.initial {
                Some(text) => self.scope.constant_of_law(text, "an initial value")?,
                None => Graph::ZERO,
            };
            internal.push(InternalVariable { name: name.get_ref().clone(), rate, initial });
        }
        Ok(internal)
    }

    /// The names that an energy may use: no rates.
    pub(crate) fn energy_names(&self, document: &Document) -> Vec<String> {
        self.response_names().into_iter().chain(internal_names(document)).collect()
    }

    /// The names that a stress, or the rate of an internal variable, may use.
    pub(crate) fn stress_names(&self, document: &Document) -> Vec<String> {
        self.response_names()
            .into_iter()
            .chain(rate_names(self.dimension))
            .chain(internal_names(document))
            .collect()
    }

    /// Reads `[material.flow]`, `[[material.maxwell]]` and `[start]`.
    pub(crate) fn memory(
        &mut self,
        document: &Document,
        law: &Law,
    ) -> Result<Option<Memory<Expr>>, Diagnostic> {
        let table = document.material.get_ref();
        let is_on_yield = document.start.as_ref().is_some_and(|start| start.get_ref().on_yield);
        if let Some(start) = document.start.as_ref().filter(|_| is_on_yield)
            && self.coordinates == Coordinates::Axisymmetric
        {
            let message = "the start on the yield surface is a stretch along X, which is not the same all around the axis";
            let help = "leave [start] out: with yield = 'sy + K*alpha^(1/3)' the body force is smooth where particles begin to flow; or write \
                        coordinates = 'cylindrical' and dimension = 3";
            return Err(self.scope.source.error(message, start.span(), Some(help.into())));
        }
        let refuse = |reader: &Self, message: String, span, help: &str| {
            Err(reader.scope.source.error(message, span, Some(help.into())))
        };
        if let (Some(start), None) = (&document.start, &table.flow) {
            let message = "only a body that flows has a yield surface to start on".to_owned();
            return refuse(
                self,
                message,
                start.span(),
                "leave [start] out, or give [material.flow]",
            );
        }
        let graded = law.constants().into_iter().find(|(_, value)| self.scope.is_field(*value));
        if let Some((constant, _)) = graded
            && let Some(span) = table
                .flow
                .as_ref()
                .map(Spanned::span)
                .or_else(|| table.maxwell.first().map(Spanned::span))
        {
            let message = format!(
                "the constants of a law with flow or Maxwell elements are the same everywhere, and '{}' depends on the place or the time",
                constant.name
            );
            let help = "write it in parameters alone; a law whose constants differ from place to place is a stated law with [internal] variables";
            return refuse(self, message, span, help);
        }
        match (&table.flow, table.maxwell.first()) {
            (None, None) => Ok(None),
            (Some(flow), Some(_)) => {
                let message = "a material flows or has Maxwell elements, not both".to_owned();
                refuse(
                    self,
                    message,
                    flow.span(),
                    "leave one of [material.flow] and [[material.maxwell]] out",
                )
            }
            (Some(flow), None) => {
                if !matches!(law, Law::Library(Material::Hencky { .. })) {
                    let message = format!("the law '{}' has no flow", law.name());
                    let help = "the elastic part of a material that flows is law = 'hencky'; a flow of your own is a stated law with \
                                [internal] variables";
                    return refuse(self, message, flow.span(), help);
                }
                Ok(Some(Memory::Flow(self.flow(flow, is_on_yield)?)))
            }
            (None, Some(first)) => {
                let is_known = match law {
                    Law::Library(Material::LinearElastic { .. }) => true,
                    Law::Library(material) => {
                        material.row().chooses_volumetric
                            && material.row().is_isotropic
                            && !matches!(material, Material::Ogden { .. })
                    }
                    Law::Energy { .. } | Law::Stress { .. } => false,
                };
                if !is_known {
                    let message = format!("the law '{}' has no Maxwell elements", law.name());
                    let help = "elements stand beside law = 'yeoh', 'gent' or 'arruda-boyce' (with c2 = 0 'yeoh' is the isochoric \
                                neo-Hookean law), or 'linear-elastic'; other laws are stated with [internal] variables";
                    return refuse(self, message, first.span(), help);
                }
                let mut elements = Vec::new();
                for element in &table.maxwell.0 {
                    let element = element.get_ref();
                    let share = self.scope.constant(&element.share, "share")?;
                    let time = self.scope.constant(&element.time, "time")?;
                    elements.push(Element { share, time });
                }
                Ok(Some(Memory::Maxwell(elements)))
            }
        }
    }

    /// Refuses tables that need the stress as a formula.
    pub(crate) fn refuse_beside_history(&self, document: &Document) -> Result<(), Diagnostic> {
        let tables = [
            ("[solve]", document.solve.as_ref().map(Spanned::span)),
            ("[with-rotation]", document.with_rotation.as_ref().map(Spanned::span)),
            ("[[cross-check]]", document.cross_check.first().map(Spanned::span)),
        ];
        for (table, span) in tables {
            if let Some(span) = span {
                let message = format!(
                    "{table} needs the stress as a formula, which a law with internal variables does not have"
                );
                let help = "leave it out; conditions on the displacement alone can be met by the expressions of [displacement]";
                return Err(self.scope.source.error(message, span, Some(help.into())));
            }
        }
        Ok(())
    }

    fn flow(
        &mut self,
        table: &Spanned<FlowTable>,
        is_on_yield: bool,
    ) -> Result<Flow<Expr>, Diagnostic> {
        let FlowTable { kind, r#yield, drag, exponent, time } = table.get_ref();
        let kind = self.choice(kind, "kind of flow", FlowKind::NAMES)?;
        let [yield_stress, modulus, hardening] = match (r#yield, kind) {
            (None, FlowKind::PowerLaw) => [Graph::ZERO, Graph::ZERO, Graph::ONE],
            (None, _) => {
                let message = "a flow beyond a yield stress needs 'yield'";
                let help = "for example yield = 'sy + K*alpha^(1/3)', with the equivalent plastic strain alpha";
                return Err(self.scope.source.error(message, table.span(), Some(help.into())));
            }
            (Some(text), FlowKind::PowerLaw) => {
                let message = "a power law flows at every stress and has no 'yield'";
                let help = "leave it out, or write kind = 'perzyna'";
                return Err(self.scope.source.error(message, text.span.clone(), Some(help.into())));
            }
            (Some(text), _) => self.hardening(text)?,
        };
        let overstress = if kind == FlowKind::J2 {
            let of_rates = [drag, exponent, time];
            if let Some(text) = of_rates.into_iter().flatten().next() {
                let message =
                    "the flow 'j2' does not depend on its rate: it has no drag, exponent or time";
                let help = "leave them out, or write kind = 'perzyna'";
                return Err(self.scope.source.error(message, text.span.clone(), Some(help.into())));
            }
            None
        } else {
            let mut constant = |key: &str, text: &Option<Text>| match text {
                Some(text) => self.scope.constant(text, key),
                None => {
                    let message = format!("this kind of flow needs '{key}'");
                    let help = "gamma' = (f/drag)^exponent/time, with f the stress beyond the yield stress: give drag, exponent and time";
                    Err(self.scope.source.error(message, table.span(), Some(help.into())))
                }
            };
            Some(Overstress {
                drag: constant("drag", drag)?,
                exponent: constant("exponent", exponent)?,
                time: constant("time", time)?,
            })
        };
        Ok(Flow { yield_stress, modulus, exponent: hardening, overstress, is_on_yield })
    }

    /// Reads the yield stress `sy + K alpha^m` as `[sy, K, m]`.
    fn hardening(&mut self, text: &Text) -> Result<[Expr; 3], Diagnostic> {
        let alpha = self.scope.graph.symbol("alpha");
        let expr = self
            .scope
            .with_names(&[("alpha".to_owned(), alpha)], |scope| scope.constant(text, "yield"))?;
        let parts = hardening(&mut self.scope.graph, expr, alpha);
        let Some(parts) = parts else {
            let message = "the yield stress is not of the form sy + K*alpha^m";
            let help = "a constant, and one power of the equivalent plastic strain alpha with an exponent from 0 to 1, as in \
                        'sy + K*alpha^(1/3)'; other hardening is a stated law with [internal] variables";
            return Err(self.scope.source.error(message, text.span.clone(), Some(help.into())));
        };
        Ok(parts)
    }
}

/// `sy`, `K` and `m` of an expression that is `sy + K alpha^m`.
fn hardening(graph: &mut Graph, expr: Expr, alpha: Expr) -> Option<[Expr; 3]> {
    let at = |graph: &mut Graph, expr: Expr, value: Expr| {
        graph.replace(expr, &BTreeMap::from([(alpha, value)]))
    };
    let yield_stress = at(graph, expr, Graph::ZERO);
    let after_one = at(graph, expr, Graph::ONE);
    let modulus = graph.sub(after_one, yield_stress);
    if graph.vanishes(modulus) {
        return (yield_stress == expr).then_some([yield_stress, Graph::ZERO, Graph::ONE]);
    }
    // The slope at alpha = 1 is m K.
    let slope = Derivatives::limited().of(graph, expr, alpha);
    let slope = at(graph, slope, Graph::ONE);
    let exponent = graph.div(slope, modulus);
    let Node::Number(number) = graph.node(exponent).clone() else { return None };
    if number <= Rational::from(0) || number > Rational::from(1) {
        return None;
    }
    let power = graph.product([(alpha, number)]);
    let again = graph.mul(modulus, power);
    let again = graph.add(yield_stress, again);
    let difference = graph.sub(again, expr);
    graph.vanishes(difference).then_some([yield_stress, modulus, exponent])
}

impl Spec {
    /// The name of the law that specifications use.
    #[must_use]
    pub fn law_name(&self) -> &'static str {
        self.variation.as_ref().map_or_else(|| self.material.name(), |variation| variation.law)
    }

    /// The law, what it remembers, and the fields that it uses, in lines for people.
    #[must_use]
    pub fn law_formulas(&self) -> Vec<String> {
        let print = |expr: Expr| self.graph.print(expr);
        let mut lines = match &self.variation {
            Some(variation) => variation.formulas(&self.graph),
            None => self.material.formulas(&self.graph),
        };
        if let Some(S) = &self.prestress {
            let constants = prestress::constants(S).into_iter();
            let entries: Vec<String> = constants
                .map(|(name, value)| {
                    format!("{} = {}", name.replace("prestress_", "S"), print(value))
                })
                .collect();
            lines.push(format!(
                "stress at the start: P = F S + P of the law, W = S : E + W of the law; {}",
                entries.join(", ")
            ));
        }
        match &self.memory {
            None => {}
            Some(Memory::Flow(flow)) => {
                let Flow { yield_stress, modulus, exponent, overstress, is_on_yield } = flow;
                let hardening = match *modulus == Graph::ZERO {
                    true => String::new(),
                    false => format!(" + {} alpha^({})", print(*modulus), print(*exponent)),
                };
                lines.push("flow: F = F^e F^p, the law of F^e; G = (F^p^T F^p)^-1, n = s/|s| with s = dev tau, G' = -2 gamma' F^-1 n F G, \
                            alpha' = sqrt(2/3) gamma'".into());
                lines.push(format!(
                    "f = |s| - sqrt(2/3) k, k = {}{hardening}",
                    print(*yield_stress)
                ));
                lines.push(match overstress {
                    None => "gamma' >= 0, f <= 0, gamma' f = 0".into(),
                    Some(Overstress { drag, exponent, time }) => format!(
                        "gamma' = <f/drag>^m / time, drag = {}, m = {}, time = {}",
                        print(*drag),
                        print(*exponent),
                        print(*time)
                    ),
                });
                lines.push(match (is_on_yield, self.dimension) {
                    (false, _) => "start: F^p = I, alpha = 0".into(),
                    (true, 1) => "start on the yield surface: F^p = diag(1/l, sqrt(l), sqrt(l)) along X, Y, Z, ln l = k/(3 mu), alpha = 0".into(),
                    (true, _) => "start on the yield surface: F^p = diag(1/l, l, 1) along X, Y, Z, ln l = k/(2 sqrt(3) mu), alpha = 0".into(),
                });
            }
            Some(Memory::Maxwell(elements)) => {
                let is_linear =
                    matches!(self.material, Law::Library(Material::LinearElastic { .. }));
                lines.push(match is_linear {
                    true => "Maxwell elements: s = dev sigma, sigma = vol sigma + (1 - sum g) s + sum Q, Q' + Q/tau = g s'".into(),
                    false => "Maxwell elements: S = S_vol + (1 - sum g) S_iso + sum Q, Q' + Q/tau = g S_iso'".into(),
                });
                for (k, Element { share, time }) in elements.iter().enumerate() {
                    let (g, tau) = (print(*share), print(*time));
                    lines.push(format!(
                        "element {}: g = {g}, tau = {tau}, Q = 0 at the start",
                        k + 1
                    ));
                }
            }
        }
        for InternalVariable { name, rate, initial } in &self.internal {
            lines.push(format!(
                "{name}' = {}, {name} = {} at the start",
                print(*rate),
                print(*initial)
            ));
        }
        for Given { name, value, .. } in &self.given {
            lines.push(format!("given: {name} = {}", print(*value)));
        }
        lines
    }
}
