//! Blind spots: mistakes in a solver that a solution cannot show with the values that its parameters have.

use mmsmith_runtime::{AnySolution, Solution};
use serde::Serialize;
use std::fmt;

use crate::case::law_of_body;
use crate::dimension::in_dimension;
use crate::points;
use crate::precision::Precision;

/// Points and times at which the fields are looked at.
const POINTS: usize = 64;
/// A share below which a quantity vanishes but for rounding.
const ROUND_OFF: f64 = 1e-9;
/// Two constants that differ by less than this share give errors that coarse grids hide.
const NEAR: f64 = 0.02;

/// A mistake in a solver that a solution does not show.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum BlindSpot {
    /// The density is 1.
    UnitDensity,
    /// `lambda = 0`, so that `E = 2 mu`.
    NoLambda,
    /// `lambda = mu`.
    EqualModuli,
    /// `F` and `P` are symmetric at all points.
    SymmetricGradient,
    /// `J = 1` at all points.
    ConstantVolume,
    /// `P = 0` at all points.
    NoStress,
    /// `b = 0` at all points.
    NoBodyForce,
}

/// The property of the solution, and the mistake that passes because of it.
impl fmt::Display for BlindSpot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::UnitDensity => {
                "the density is 1: a solver that takes the force per volume (rho0 b) for the force per mass (b) passes"
            }
            Self::NoLambda => {
                "lambda = 0 (nu = 0, E = 2 mu): a solver with a wrong lambda, or with E in place of 2 mu, passes"
            }
            Self::EqualModuli => {
                "lambda = mu (nu = 1/4): a solver that exchanges lambda and mu passes"
            }
            Self::SymmetricGradient => {
                "F and P are symmetric at all points: a solver that transposes P or F passes"
            }
            Self::ConstantVolume => {
                "J = 1 at all points: a solver that takes the Kirchhoff stress for the Cauchy stress passes"
            }
            Self::NoStress => {
                "P = 0 at all points: mistakes in the stress pass where it vanishes without motion"
            }
            Self::NoBodyForce => {
                "b = 0 at all points: a solver that ignores the body force, or reads it at another place or time, passes"
            }
        })
    }
}

/// The blind spots of `solution` with its parameters, measured at points of the body and times within a period.
///
/// Empty for a shape or a dimension that is not known here.
#[must_use]
pub fn blind_spots(solution: &AnySolution<f64>) -> Vec<BlindSpot> {
    in_dimension!(solution, |s| blind_spots_in(s), else Vec::new())
}

/// Largest magnitudes over the samples.
#[derive(Default)]
struct Largest {
    H: f64,
    skew_F: f64,
    P: f64,
    skew_P: f64,
    volume_change: f64,
    a: f64,
    b: f64,
}

fn blind_spots_in<const D: usize>(solution: &dyn Solution<f64, D>) -> Vec<BlindSpot>
where
    f64: Precision<D>,
{
    let domain = solution.domain();
    let Some(size) = points::size(&domain) else { return Vec::new() };
    let law = law_of_body::<f64, D>(solution).ok();
    let density = solution.density();
    let mut largest = Largest::default();
    for n in 0..POINTS {
        let Some((X, t)) = points::interior(&domain, solution.period(), n) else { continue };
        let fields = solution.fields(&X, t);
        let mut keep = |known: fn(&mut Largest) -> &mut f64, value: f64| {
            let known = known(&mut largest);
            *known = known.max(value.abs());
        };
        keep(|l| &mut l.H, fields.H.amax());
        keep(|l| &mut l.skew_F, (fields.F - fields.F.transpose()).amax());
        keep(|l| &mut l.P, fields.P.amax());
        keep(|l| &mut l.skew_P, (fields.P - fields.P.transpose()).amax());
        keep(|l| &mut l.volume_change, fields.J - 1.0);
        keep(|l| &mut l.a, fields.a.amax());
        keep(|l| &mut l.b, fields.b.amax());
    }
    let moduli = law.as_ref().and_then(mmsmith_mpm::Law::lame_constants);
    let stiffness = match moduli {
        Some((lambda, mu)) => lambda.abs() + 2.0 * mu.abs(),
        None => density * solution.wave_speed().powi(2),
    };
    let is_near = |one: f64, other: f64| (one - other).abs() <= NEAR * one.abs().max(other.abs());
    let stress = stiffness * largest.H;
    let moves = largest.H > 0.0;
    let found = [
        (BlindSpot::UnitDensity, is_near(density, 1.0)),
        (BlindSpot::NoLambda, moduli.is_some_and(|(lambda, mu)| lambda.abs() <= NEAR * mu.abs())),
        (BlindSpot::EqualModuli, moduli.is_some_and(|(lambda, mu)| is_near(lambda, mu))),
        (
            BlindSpot::SymmetricGradient,
            D > 1
                && largest.skew_F <= ROUND_OFF * largest.H
                && largest.skew_P <= ROUND_OFF * stress,
        ),
        (BlindSpot::ConstantVolume, moves && largest.volume_change <= ROUND_OFF * largest.H),
        (BlindSpot::NoStress, largest.P <= ROUND_OFF * stress),
        (BlindSpot::NoBodyForce, largest.b <= ROUND_OFF * largest.a.max(stress / (density * size))),
    ];
    found.into_iter().filter_map(|(spot, is_there)| is_there.then_some(spot)).collect()
}
