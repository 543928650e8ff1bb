//! Claims of boundary conditions about a solution: proved in symbols, verified in high precision, or refuted.

use crate::points::{PointsError, Values, points};
use mmsmith_expr::{Expr, Graph, Rational, nearest_f64};
use mmsmith_oracle::{Oracle, OracleError, Point};
use mmsmith_spec::{ClaimKind, Fields, Spec, Surface};
use num_traits::{Signed, Zero};
use thiserror::Error;

/// The number of points at which a claim is tested that is not proved in symbols.
const POINTS: usize = 20;
/// A quantity that is smaller than its scale by this many digits at every point is zero.
const VERIFIED_DIGITS: f64 = 40.0;

/// Finding on a claim about a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceFinding {
    /// The surface.
    pub surface: Surface,
    /// The quantity claimed to be zero there.
    pub claim: ClaimKind,
    /// The outcome.
    pub outcome: Outcome,
}

/// Whether a quantity is zero on a surface.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// It is zero in symbols, for all parameters.
    Proved,
    /// It is zero to `digits` digits of the field's size, at `points` points with random parameters.
    Verified {
        /// The number of digits, 40 or more.
        digits: f64,
        /// The number of points.
        points: usize,
    },
    /// It is not zero.
    Refuted {
        /// The largest value found.
        value: f64,
        /// The largest value of the field, stress or displacement, in the body.
        scale: f64,
        /// Where it was found: inputs by name.
        place: Vec<(String, f64)>,
    },
}

impl SurfaceFinding {
    /// Whether the claim holds.
    #[must_use]
    pub fn holds(&self) -> bool {
        !matches!(self.outcome, Outcome::Refuted { .. })
    }
}

/// The reason why a claim could be neither verified nor refuted.
// The message has the cause, which is therefore no `source`: whoever prints both would print it twice.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SurfaceError {
    /// There were no points to test.
    #[error("the condition on {surface}: {cause}")]
    Points {
        /// The surface.
        surface: Surface,
        /// The reason.
        cause: PointsError,
    },
    /// A quantity has no value.
    #[error("the condition on {surface}: {cause}")]
    Value {
        /// The surface.
        surface: Surface,
        /// The reason.
        cause: Box<OracleError>,
    },
}

/// Examines the boundary conditions of `spec`: each states that a quantity is zero. That is proved in symbols, or else tested in high
/// precision on the surface, at random points and parameters.
///
/// # Errors
///
/// [`SurfaceError`] where a quantity cannot be evaluated.
pub fn surfaces(spec: &Spec, fields: &Fields) -> Result<Vec<SurfaceFinding>, SurfaceError> {
    let mut findings = Vec::new();
    for on_surface in &fields.surfaces {
        let surface = on_surface.surface;
        for claim in &on_surface.claims {
            let open: Vec<Expr> =
                claim.quantities.iter().copied().filter(|&q| q != Graph::ZERO).collect();
            let outcome = if open.is_empty() {
                Outcome::Proved
            } else {
                let field = match claim.what {
                    ClaimKind::Traction
                    | ClaimKind::Shear
                    | ClaimKind::NormalTraction
                    | ClaimKind::TractionComponent(_) => fields.P.concat(),
                    ClaimKind::NormalDisplacement => fields.u.clone(),
                };
                numerical(spec, fields, surface, &open, &field)?
            };
            findings.push(SurfaceFinding { surface, claim: claim.what, outcome });
        }
    }
    Ok(findings)
}

fn numerical(
    spec: &Spec,
    fields: &Fields,
    surface: Surface,
    quantities: &[Expr],
    field: &[Expr],
) -> Result<Outcome, SurfaceError> {
    let no_points = |cause| SurfaceError::Points { surface, cause };
    let inside = points(spec, fields, field, None, POINTS).map_err(no_points)?;
    let (scale, _) = largest(fields, &inside, field, surface)?;
    let there = points(spec, fields, quantities, Some(surface), POINTS).map_err(no_points)?;
    let (value, worst) = largest(fields, &there, quantities, surface)?;
    // A field that is zero everywhere has no scale: then only an exact zero counts.
    let digits = if value.is_zero() {
        f64::INFINITY
    } else {
        (nearest_f64(&scale) / nearest_f64(&value)).log10()
    };
    if digits >= VERIFIED_DIGITS {
        return Ok(Outcome::Verified { digits: digits.min(60.0), points: there.len() });
    }
    let name = |input: &Expr| fields.graph.symbol_name(*input).unwrap_or_default().to_owned();
    let place = there[worst].iter().map(|(input, x)| (name(input), nearest_f64(x))).collect();
    Ok(Outcome::Refuted { value: nearest_f64(&value), scale: nearest_f64(&scale), place })
}

/// The largest magnitude of `expressions` at `points`, and the index of the point.
fn largest(
    fields: &Fields,
    points: &[Values],
    expressions: &[Expr],
    surface: Surface,
) -> Result<(Rational, usize), SurfaceError> {
    let failed = |error| SurfaceError::Value { surface, cause: Box::new(error) };
    let mut oracle = Oracle::new(Oracle::USUAL_BITS).map_err(failed)?;
    let mut found = (Rational::zero(), 0);
    for (index, values) in points.iter().enumerate() {
        let point = Point { graph: &fields.graph, definitions: &fields.definitions, values };
        for value in oracle.evaluate(&point, expressions).map_err(failed)? {
            if value.abs() > found.0 {
                found = (value.abs(), index);
            }
        }
    }
    Ok(found)
}
