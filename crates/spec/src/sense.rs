//! Is there a body, and a motion that lasts? Measures, density, speed and period at the defaults of the parameters.

use crate::document::{Document, List, Measure, Text};
use crate::scope::Scope;
use crate::{Around, Diagnostic, Domain, Parameter, Spec};
use mmsmith_expr::{Dependence, Expr, Program};
use std::ops::Range;
use toml::Spanned;

/// Refuses a body without volume or mass, and a period or wave speed that is not positive.
pub(crate) fn check(scope: &Scope<'_>, document: &Document, spec: &Spec) -> Result<(), Diagnostic> {
    let measures = match &spec.domain {
        Domain::Box { lower, upper } => [lower.as_slice(), upper].concat(),
        Domain::Annulus { inner, outer } => vec![*inner, *outer],
        Domain::Tube { inner, outer, lower, upper, around } => match around {
            Around::Axisymmetric | Around::Whole => vec![*inner, *lower, *outer, *upper],
            Around::Sector { from, to } => vec![*inner, *lower, *from, *outer, *upper, *to],
        },
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
    // The box of a half plane is written as a box.
    let is_box = domain.inner.is_none() && domain.outer.is_none();
    for (axis, (&low, &high)) in low.iter().zip(high).enumerate() {
        let [below, above] = match axis {
            _ if is_box => ["lower", "upper"],
            0 => ["inner", "outer"],
            1 => ["lower", "upper"],
            _ => ["from", "to"],
        };
        let along = match &spec.domain {
            Domain::Tube { .. } if is_box => format!(" along {}", ["R", "Z"][axis.min(1)]),
            Domain::Box { .. } => format!(" along {}", crate::coordinates::CARTESIAN[axis]),
            Domain::Annulus { .. } | Domain::Tube { .. } => String::new(),
        };
        let entry = |corner: &Option<Spanned<List<Measure>>>| {
            let texts = corner.as_ref().map(List::texts)?;
            texts.get(if is_box { axis } else { 0 }).cloned()
        };
        let (text_below, text_above) = match below {
            "lower" => (entry(&domain.lower), entry(&domain.upper)),
            "inner" => (domain.inner.clone(), domain.outer.clone()),
            _ => (domain.from.clone(), domain.to.clone()),
        };
        let (text_below, text_above) = (text_below.as_ref(), text_above.as_ref());
        if !(low < high && low.is_finite() && high.is_finite()) {
            let (low, high) = (figure(low), figure(high));
            let message = format!(
                "the body has no volume: {above} is {high}{along}, {below} is {low}, with the default parameters"
            );
            let span = place(text_above, document.domain.span());
            let help = format!("{above} must be greater than {below}{}", given(&spec.parameters));
            return Err(scope.source.error(message, span, Some(help)));
        }
        let is_radius = !matches!(spec.domain, Domain::Box { .. }) && axis == 0;
        if is_radius && low < 0.0 {
            let message = format!("{below} is {}{along} with the default parameters", figure(low));
            let span = place(text_below, document.domain.span());
            let help = "a radius is not negative".to_owned();
            return Err(scope.source.error(message, span, Some(help)));
        }
        if low == 0.0 && matches!(spec.domain, Domain::Annulus { .. }) {
            let message = "the body contains its centre, where the directions of its coordinates have no meaning";
            let span = place(text_below, document.domain.span());
            let help = match spec.dimension {
                2 => {
                    "give it a hole, as inner = '1/100'; or, where nothing depends on the angle, state it as the solid cylinder that it is a \
                     section of: coordinates = 'axisymmetric' and, under [domain], shape = 'solid-cylinder', lower = 0 and upper = 1, with \
                     condition = 'sliding' on Z-lower and Z-upper"
                }
                _ => "give it a hole, as inner = '1/100'",
            };
            return Err(scope.source.error(message, span, Some(help.into())));
        }
        // A rounding more than a turn is one.
        if below == "from" && high - low > std::f64::consts::TAU * (1.0 + 1e-12) {
            let message = format!("the sector reaches around by {} radians", figure(high - low));
            let span = place(text_above, document.domain.span());
            let help = "a turn is 2*Pi; shape = 'tube' goes all the way around".to_owned();
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

pub(crate) fn figure(value: f64) -> String {
    if value.is_nan() { "not a number".into() } else { format!("{value}") }
}

/// The defaults in words, where there are few.
pub(crate) fn given(parameters: &[Parameter]) -> String {
    if parameters.is_empty() || parameters.len() > 8 {
        return String::new();
    }
    let values: Vec<String> =
        parameters.iter().map(|p| format!("{} = {:?}", p.name, p.default)).collect();
    format!("; the defaults are {}", values.join(", "))
}
