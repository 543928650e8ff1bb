//! Reproducible points in the body, for random admissible parameters.

use mmsmith_expr::{Dependence, Expr, Graph, Program, Rational, nearest_f64};
use mmsmith_maple::sample;
use mmsmith_oracle::exact;
use mmsmith_spec::{Domain, Fields, Parameter, Spec};
use std::f64::consts::PI;
use thiserror::Error;

/// Parameters vary by this share of their defaults; those that are zero by default, by this number.
const VARIATION: f64 = 0.1;
/// Draws for each point that is wanted.
const DRAWS: usize = 50;

/// Why there are no points.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error(
    "found {found} of {wanted} points in the body where the parameters are admissible, J > 0 and every field has a \
     value, with parameters within {:.0} % of their defaults",
    100.0 * VARIATION
)]
pub(crate) struct PointsError {
    /// How many points were found.
    pub found: usize,
    /// How many points were wanted.
    pub wanted: usize,
}

/// `count` points: a value for every input of `fields`. Positions are in the body, times within a period, parameters
/// near their defaults, and the values of `expressions` are finite and `J > 0`.
pub(crate) fn points(
    spec: &Spec,
    fields: &Fields,
    expressions: &[Expr],
    count: usize,
    seed: u64,
) -> Result<Vec<Vec<(Expr, Rational)>>, PointsError> {
    let n = spec.dimension;
    let inputs: Vec<Expr> = fields.inputs.iter().map(|(input, _)| *input).collect();
    let mut graph = fields.graph.clone();
    let constants = constants(spec, &mut graph, &inputs);
    let mut watched = vec![fields.J];
    watched.extend(expressions);
    let everything = Program::lower(&mut graph, &fields.inputs, &fields.definitions, &watched);
    // Coordinates and time as shares, parameters as they are.
    let bounds: Vec<(Expr, [f64; 2])> = inputs
        .iter()
        .enumerate()
        .map(|(index, &input)| match index.checked_sub(n + 1) {
            None => (input, [0.0, 1.0]),
            Some(parameter) => (input, range(&spec.parameters[parameter])),
        })
        .collect();
    let mut found = Vec::new();
    for draw in sample(&bounds, DRAWS * count, seed) {
        let drawn: Vec<f64> = draw.iter().map(|(_, value)| nearest_f64(value)).collect();
        let parameters = &drawn[n + 1..];
        if !spec
            .parameters
            .iter()
            .zip(parameters)
            .all(|(p, v)| p.bounds.iter().all(|b| b.admits(*v)))
        {
            continue;
        }
        let constants = constants.evaluate(parameters);
        let (sides, measures) = constants.split_at(2 * spec.requirements.len());
        if !spec.requirements.iter().zip(sides.chunks(2)).all(|(r, s)| r.relation.holds(s[0], s[1]))
        {
            continue;
        }
        let (period, measures) = (measures[0], &measures[1..]);
        let mut values = place(&spec.domain, measures, &drawn[..n]);
        values.push(period * drawn[n]);
        values.extend(parameters);
        let fine = everything.evaluate(&values);
        if !(fine[0] > 0.0) || !fine.iter().all(|value| value.is_finite()) {
            continue;
        }
        let Some(values) = values.into_iter().map(exact).collect::<Option<Vec<Rational>>>() else {
            continue;
        };
        found.push(inputs.iter().copied().zip(values).collect());
        if found.len() == count {
            return Ok(found);
        }
    }
    Err(PointsError { found: found.len(), wanted: count })
}

/// The program for the sides of the requirements, the period and the measures of the body, from the parameters.
fn constants(spec: &Spec, graph: &mut Graph, inputs: &[Expr]) -> Program {
    let mut outputs: Vec<Expr> = spec.requirements.iter().flat_map(|r| [r.left, r.right]).collect();
    outputs.push(spec.period);
    match &spec.domain {
        Domain::Box { lower, upper } => outputs.extend(lower.iter().chain(upper)),
        Domain::Annulus { inner, outer } => outputs.extend([inner, outer]),
    }
    let parameters: Vec<(Expr, Dependence)> =
        inputs[spec.dimension + 1..].iter().map(|&p| (p, Dependence::default())).collect();
    Program::lower(graph, &parameters, &[], &outputs)
}

/// Where a parameter is drawn from.
fn range(parameter: &Parameter) -> [f64; 2] {
    let middle = parameter.default;
    let half = if middle == 0.0 { VARIATION } else { VARIATION * middle.abs() };
    [middle - half, middle + half]
}

/// The point of the body that `shares` of its extents point to.
fn place(domain: &Domain, measures: &[f64], shares: &[f64]) -> Vec<f64> {
    let between = |low: f64, high: f64, share: f64| low + (high - low) * share;
    match domain {
        Domain::Box { .. } => {
            let (lower, upper) = measures.split_at(shares.len());
            (0..shares.len()).map(|i| between(lower[i], upper[i], shares[i])).collect()
        }
        Domain::Annulus { .. } => {
            let radius = between(measures[0], measures[1], shares[0]);
            direction(&shares[1..]).iter().map(|e| radius * e).collect()
        }
    }
}

/// A unit vector, in the plane for one share and in space for two.
fn direction(shares: &[f64]) -> Vec<f64> {
    let (sine, cosine) = (2.0 * PI * shares[0]).sin_cos();
    match shares.get(1) {
        None => vec![cosine, sine],
        Some(share) => {
            let height = 2.0 * share - 1.0;
            let across = (1.0 - height * height).sqrt();
            vec![across * cosine, across * sine, height]
        }
    }
}
