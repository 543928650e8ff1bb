//! Is there a body, and a motion that lasts? Measures, density, speed and period at the defaults of the parameters.

use crate::document::{Document, Text};
use crate::scope::Scope;
use crate::{Diagnostic, Domain, Parameter, Spec};
use mmsmith_expr::{Dependence, Expr, Program};
use std::ops::Range;

/// Refuses a body without volume or mass, and a period or wave speed that is not positive.
pub(crate) fn check(scope: &Scope<'_>, document: &Document, spec: &Spec) -> Result<(), Diagnostic> {
    let measures = match &spec.domain {
        Domain::Box { lower, upper } => [lower.as_slice(), upper].concat(),
        Domain::Annulus { inner, outer } => vec![*inner, *outer],
    };
    let mut graph = spec.graph.clone();
    let density = spec.in_the_middle(&mut graph, spec.density);
    let middle = Spec { graph, ..spec.clone() };
    let spec = &middle;
    let mut constants = vec![density, spec.period, spec.wave_speed, spec.cell_length];
    constants.extend(&measures);
    let values = at_defaults(spec, &constants);
    let (values, measures) = values.split_at(constants.len() - measures.len());
    let place = |text: Option<&Text>, table: Range<usize>| text.map_or(table, |t| t.span.clone());
    let (material, domain) = (document.material.get_ref(), document.domain.get_ref());
    let places = [
        ("density", place(material.density.as_ref(), document.material.span())),
        ("period", place(document.period(), document.time_span())),
        ("wave-speed", place(document.wave_speed(), document.time_span())),
        ("cell-length", place(domain.cell_length.as_ref(), document.domain.span())),
    ];
    for ((key, span), &value) in places.into_iter().zip(values) {
        // Written so that not-a-number is refused.
        if !(value > 0.0 && value.is_finite()) {
            let message = format!("{key} is {} with the default parameters", figure(value));
            let help = format!("{key} must be a positive number{}", given(&spec.parameters));
            return Err(scope.source.error(message, span, Some(help)));
        }
    }
    let (low, high) = measures.split_at(measures.len() / 2);
    let [below, above] = match &spec.domain {
        Domain::Box { .. } => ["lower", "upper"],
        Domain::Annulus { .. } => ["inner", "outer"],
    };
    for (axis, (&low, &high)) in low.iter().zip(high).enumerate() {
        let along = match &spec.domain {
            Domain::Box { .. } => format!(" along {}", crate::coordinates::CARTESIAN[axis]),
            Domain::Annulus { .. } => String::new(),
        };
        let (text_below, text_above) = match &spec.domain {
            Domain::Box { .. } => (
                domain.lower.as_ref().and_then(|corner| corner.get_ref().get(axis)),
                domain.upper.as_ref().and_then(|corner| corner.get_ref().get(axis)),
            ),
            Domain::Annulus { .. } => (domain.inner.as_ref(), domain.outer.as_ref()),
        };
        if !(low < high && low.is_finite() && high.is_finite()) {
            let (low, high) = (figure(low), figure(high));
            let message = format!(
                "the body has no volume: {above} is {high}{along}, {below} is {low}, with the default parameters"
            );
            let span = place(text_above, document.domain.span());
            let help = format!("{above} must be greater than {below}{}", given(&spec.parameters));
            return Err(scope.source.error(message, span, Some(help)));
        }
        if matches!(spec.domain, Domain::Annulus { .. }) && low < 0.0 {
            let message = format!("inner is {} with the default parameters", figure(low));
            let span = place(text_below, document.domain.span());
            let help = "a radius is not negative".to_owned();
            return Err(scope.source.error(message, span, Some(help)));
        }
    }
    Ok(())
}

/// The values of `constants` where every parameter has its default.
fn at_defaults(spec: &Spec, constants: &[Expr]) -> Vec<f64> {
    // Lowering adds to a graph; the code that is generated from the specification does not depend on this check.
    let mut graph = spec.graph.clone();
    let inputs: Vec<(Expr, Dependence)> =
        spec.parameters.iter().map(|p| (graph.symbol(&p.name), Dependence::default())).collect();
    let defaults: Vec<f64> = spec.parameters.iter().map(|p| p.default).collect();
    Program::lower(&mut graph, &inputs, &[], constants).evaluate(&defaults)
}

fn figure(value: f64) -> String {
    if value.is_nan() { "not a number".into() } else { format!("{value}") }
}

/// The defaults in words, where there are few.
fn given(parameters: &[Parameter]) -> String {
    if parameters.is_empty() || parameters.len() > 8 {
        return String::new();
    }
    let values: Vec<String> =
        parameters.iter().map(|p| format!("{} = {:?}", p.name, p.default)).collect();
    format!("; the defaults are {}", values.join(", "))
}
