//! Reproducible points in the body and on its surfaces, for random admissible parameters.

use crate::maple::sample;
use crate::parameters::{VARIATION, admissible_value, near};
use mmsmith_expr::{Dependence, Expr, Graph, Program, Rational, nearest_f64};
use mmsmith_oracle::{Oracle, Point, exact};
use mmsmith_spec::{Domain, Fields, Parameter, Spec, Surface};
use num_traits::One;
use thiserror::Error;

/// One draw of this many has its parameters near their defaults; the other draws take them from the whole admissible range.
const NEAR: usize = 4;
/// The number of draws for each wanted point.
const DRAWS: usize = 50;

/// Too few points were found.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error(
    "found {found} of {wanted} points in the body where the parameters are admissible, J > 0 and every field has a \
     value, with parameters within {:.0} % of their defaults or in the whole admissible range",
    100.0 * VARIATION
)]
pub struct PointsError {
    /// The number of points that were found.
    pub found: usize,
    /// The number of points that were wanted.
    pub wanted: usize,
}

/// A value for every input of the fields.
pub(crate) type Values = Vec<(Expr, Rational)>;

/// `count` points. Positions are in the body, or on `surface` to far more digits than doubles have; times are within a period,
/// parameters admissible, and some parameters near their defaults; the values of `expressions` are finite and `J > 0`.
pub(crate) fn points(
    spec: &Spec,
    fields: &Fields,
    expressions: &[Expr],
    surface: Option<Surface>,
    count: usize,
) -> Result<Vec<Values>, PointsError> {
    let n = spec.dimension;
    let inputs: Vec<Expr> = fields.inputs.iter().map(|(input, _)| *input).collect();
    let mut graph = fields.graph.clone();
    let mut watched = vec![fields.J];
    watched.extend(expressions);
    let everything = Program::lower(&mut graph, &fields.inputs, &fields.definitions, &watched);
    let sides: Vec<Expr> = spec.requirements.iter().flat_map(|r| [r.left, r.right]).collect();
    let parameters: Vec<(Expr, Dependence)> =
        inputs[n + 1..].iter().map(|&p| (p, Dependence::default())).collect();
    let sides = Program::lower(&mut graph, &parameters, &[], &sides);
    // Every input is drawn as a share of its range.
    let bounds: Vec<(Expr, [f64; 2])> = inputs.iter().map(|&input| (input, [0.0, 1.0])).collect();
    let mut found = Vec::new();
    for (number, draw) in sample(&bounds, DRAWS * count, 1).enumerate() {
        let (shares, of_parameters) = draw.split_at(n + 1);
        let value = if number % NEAR == 0 { near } else { admissible_value };
        let parameters = spec.parameters.iter().zip(of_parameters).map(|(parameter, drawn)| {
            Some((drawn.0, exact(value(parameter, nearest_f64(&drawn.1)))?))
        });
        let Some(parameters) = parameters.collect::<Option<Vec<_>>>() else { continue };
        if !admissible(spec, &sides, &parameters) {
            continue;
        }
        let Some(values) = place(spec, &graph, surface, shares, &parameters) else { continue };
        let rounded: Vec<f64> = values.iter().map(|(_, value)| nearest_f64(value)).collect();
        let fine = everything.evaluate(&rounded);
        if fine[0] > 0.0 && fine.iter().all(|value| value.is_finite()) {
            found.push(values);
        }
        if found.len() == count {
            return Ok(found);
        }
    }
    Err(PointsError { found: found.len(), wanted: count })
}

fn admissible(spec: &Spec, sides: &Program, parameters: &[(Expr, Rational)]) -> bool {
    let values: Vec<f64> = parameters.iter().map(|(_, value)| nearest_f64(value)).collect();
    let within = |(parameter, &value): (&Parameter, &f64)| {
        parameter.bounds.iter().all(|bound| bound.admits(value))
    };
    let sides = sides.evaluate(&values);
    spec.parameters.iter().zip(&values).all(within)
        && spec.requirements.iter().zip(sides.chunks(2)).all(|(r, s)| r.relation.holds(s[0], s[1]))
}

/// The point that `shares` of the body's extents and of the period point to; its position is rounded to doubles in
/// the body, and exact on a surface.
fn place(
    spec: &Spec,
    graph: &Graph,
    surface: Option<Surface>,
    shares: &[(Expr, Rational)],
    parameters: &[(Expr, Rational)],
) -> Option<Values> {
    let mut measures = vec![spec.period];
    match &spec.domain {
        Domain::Box { lower, upper } => measures.extend(lower.iter().chain(upper)),
        Domain::Annulus { inner, outer } => measures.extend([inner, outer]),
        Domain::Tube { inner, outer, lower, upper, .. } => {
            measures.extend([inner, outer, lower, upper]);
        }
    }
    let point = Point { graph, definitions: &[], values: parameters };
    let measures = Oracle::new(Oracle::USUAL_BITS).ok()?.evaluate(&point, &measures).ok()?;
    let (period, measures) = (&measures[0], &measures[1..]);
    let n = shares.len() - 1;
    let share = |i: usize| &shares[i].1;
    let between = |low: &Rational, high: &Rational, share: &Rational| low + (high - low) * share;
    let mut X: Vec<Rational> = match &spec.domain {
        Domain::Box { .. } => {
            (0..n).map(|i| between(&measures[i], &measures[n + i], share(i))).collect()
        }
        Domain::Annulus { .. } => {
            let radius = match surface {
                Some(Surface::Inner) => measures[0].clone(),
                Some(Surface::Outer) => measures[1].clone(),
                _ => between(&measures[0], &measures[1], share(0)),
            };
            let shares: Vec<&Rational> = (1..n).map(share).collect();
            direction(&shares).into_iter().map(|e| e * &radius).collect()
        }
        Domain::Tube { .. } => {
            let radius = match surface {
                Some(Surface::Inner) => measures[0].clone(),
                Some(Surface::Outer) => measures[1].clone(),
                _ => between(&measures[0], &measures[1], share(0)),
            };
            let height = match surface {
                Some(Surface::Lower(_)) => measures[2].clone(),
                Some(Surface::Upper(_)) => measures[3].clone(),
                _ => between(&measures[2], &measures[3], share(2)),
            };
            let across = direction(&[share(1)]).into_iter().map(|e| e * &radius);
            across.chain([height]).collect()
        }
    };
    match (surface, &spec.domain) {
        (Some(Surface::Lower(axis)), Domain::Box { .. }) => X[axis] = measures[axis].clone(),
        (Some(Surface::Upper(axis)), Domain::Box { .. }) => X[axis] = measures[n + axis].clone(),
        // The plane of symmetry may lie outside of the body's radii: the fields have the same formulas there.
        (Some(Surface::Lower(axis)), Domain::Annulus { .. }) => X[axis] = Rational::default(),
        _ => {}
    }
    let mut values = X;
    values.push(period * share(n));
    if surface.is_none() {
        values = values.iter().map(|x| exact(nearest_f64(x))).collect::<Option<_>>()?;
    }
    let inputs = shares.iter().map(|(input, _)| *input);
    Some(inputs.zip(values).chain(parameters.iter().cloned()).collect())
}

/// A unit vector with rational components, from one share in the plane and from two in space: the stereographic
/// projection of a point within a few radii of the origin.
fn direction(shares: &[&Rational]) -> Vec<Rational> {
    let wide = Rational::from_integer(5.into());
    let half = Rational::new(1.into(), 2.into());
    let q: Vec<Rational> = shares.iter().map(|&share| (share - &half) * &wide).collect();
    let square: Rational = q.iter().map(|q| q * q).sum();
    let total = Rational::one() + &square;
    let mut e: Vec<Rational> =
        q.iter().map(|q| q * Rational::from_integer(2.into()) / &total).collect();
    e.push((Rational::one() - square) / total);
    e
}
