//! Deterministic, evenly spread sample points in a body, on its boundary and in time.
//!
//! The sequence is the additive recurrence with the generalised golden ratio: coordinate `j` of point `n` is the
//! fractional part of `1/2 + n g^-(j+1)`, `g` the positive root of `g^(d+1) = g + 1`. M. Roberts, "The
//! unreasonable effectiveness of quasirandom sequences" (2018).

use mmsmith_runtime::{Around, Domain, Surface};
use nalgebra::SVector;

/// Share of the body's size, and of the time span, that samples keep away from the ends.
///
/// It leaves every sample room for difference stencils inside the body.
pub(crate) const MARGIN: f64 = 0.02;

/// Coordinate `j` of point `n` of the sequence in `[0, 1)^dimension`.
pub(crate) fn quasirandom(n: usize, j: usize, dimension: usize) -> f64 {
    let mut ratio = 2.0_f64;
    for _ in 0..64 {
        ratio = (1.0 + ratio).powf(1.0 / (dimension as f64 + 1.0));
    }
    // A whole power would be rounded otherwise where the compiler knows it.
    (0.5 + (n as f64 + 1.0) * ratio.powf(-(j as f64 + 1.0))).fract()
}

/// `q` in `[0, 1)` moved into `[MARGIN, 1 - MARGIN)`.
fn inside(q: f64) -> f64 {
    MARGIN + (1.0 - 2.0 * MARGIN) * q
}

/// Sample `n`: a point inside the body and a time inside `[0, span]`.
///
/// `None` for a shape that is not known here.
pub(crate) fn interior<const D: usize>(
    domain: &Domain<f64, D>,
    span: f64,
    n: usize,
) -> Option<(SVector<f64, D>, f64)> {
    let q = |j| quasirandom(n, j, D + 1);
    let t = span * inside(q(D));
    let X = match domain {
        Domain::Box { lower, upper } => {
            SVector::from_fn(|j, _| lower[j] + (upper[j] - lower[j]) * inside(q(j)))
        }
        Domain::Annulus { inner, outer } => {
            direction(q(1), q(D - 1)) * (inner + (outer - inner) * inside(q(0)))
        }
        Domain::Tube { inner, outer, lower, upper, around } => {
            let [from, to] = angles(around);
            let place = TubePlace {
                radius: inner + (outer - inner) * inside(q(0)),
                angle: from + (to - from) * inside(q(1)),
                height: lower + (upper - lower) * inside(q(2)),
            };
            place.cartesian()
        }
        _ => return None,
    };
    Some((X, t))
}

/// The angles between which a tube lies.
fn angles(around: &Around<f64>) -> [f64; 2] {
    match around {
        Around::Sector { from, to } => [*from, *to],
        _ => [0.0, std::f64::consts::TAU],
    }
}

/// A place in a tube, by its cylindrical coordinates.
struct TubePlace {
    radius: f64,
    angle: f64,
    height: f64,
}

impl TubePlace {
    fn cartesian<const D: usize>(&self) -> SVector<f64, D> {
        let (sin, cos) = self.angle.sin_cos();
        let X = [self.radius * cos, self.radius * sin, self.height];
        SVector::from_fn(|j, _| X.get(j).copied().unwrap_or(0.0))
    }
}

/// The distance from the axis of a tube.
fn from_axis<const D: usize>(X: &SVector<f64, D>) -> f64 {
    X[0].hypot(X[1 % D])
}

/// The angle of a place from the middle of a sector, at most half a turn.
fn from_middle<const D: usize>(X: &SVector<f64, D>, [from, to]: [f64; 2]) -> f64 {
    let (sin, cos) = (0.5 * (from + to)).sin_cos();
    (X[1 % D] * cos - X[0] * sin).atan2(X[0] * cos + X[1 % D] * sin).abs()
}

/// A unit vector: in the plane, `turn` of a full turn from the first axis; in space, with a last component that
/// `height` spreads evenly, so that directions cover the sphere evenly.
fn direction<const D: usize>(turn: f64, height: f64) -> SVector<f64, D> {
    let (sin, cos) = (std::f64::consts::TAU * turn).sin_cos();
    let z = if D == 3 { 2.0 * height - 1.0 } else { 0.0 };
    let across = (1.0 - z * z).sqrt();
    SVector::from_fn(|j, _| [across * cos, across * sin, z].get(j).copied().unwrap_or(0.0))
}

/// How far one may go from `X` along any axis, in both directions, without leaving the body.
pub(crate) fn reach<const D: usize>(
    domain: &Domain<f64, D>,
    X: &SVector<f64, D>,
    axis: usize,
) -> f64 {
    match domain {
        Domain::Box { lower, upper } => (X[axis] - lower[axis]).min(upper[axis] - X[axis]),
        Domain::Annulus { inner, outer } => (X.norm() - inner).min(outer - X.norm()),
        Domain::Tube { lower, upper, .. } if axis == 2 => (X[axis] - lower).min(upper - X[axis]),
        Domain::Tube { inner, outer, around, .. } => {
            let radius = from_axis(X);
            let across = (radius - inner).min(outer - radius);
            match around {
                Around::Sector { from, to } if to - from < std::f64::consts::PI => {
                    let rest = 0.5 * (to - from) - from_middle(X, [*from, *to]);
                    across.min(radius * rest.sin())
                }
                _ => across,
            }
        }
        _ => 0.0,
    }
}

/// By how much `X` lies outside of the body, in shares of the body's size; zero or less for places in it. `None` for a shape
/// that is not known here.
pub(crate) fn outside<const D: usize>(domain: &Domain<f64, D>, X: &SVector<f64, D>) -> Option<f64> {
    match domain {
        Domain::Box { lower, upper } => {
            let beyond = |i: usize| (lower[i] - X[i]).max(X[i] - upper[i]);
            let distance = (0..D).map(beyond).fold(f64::NEG_INFINITY, f64::max);
            Some(distance / (upper - lower).amax())
        }
        Domain::Annulus { inner, outer } => Some((inner - X.norm()).max(X.norm() - outer) / outer),
        Domain::Tube { inner, outer, lower, upper, around } => {
            let radius = from_axis(X);
            let across = (inner - radius).max(radius - outer);
            let along = (lower - X[2 % D]).max(X[2 % D] - upper);
            let turned = match around {
                Around::Sector { from, to } => {
                    radius * (from_middle(X, [*from, *to]) - 0.5 * (to - from))
                }
                _ => f64::NEG_INFINITY,
            };
            Some(across.max(along).max(turned) / outer.max(upper - lower))
        }
        _ => None,
    }
}

/// How far one may go from `X` along `direction`, which has unit length and in an annulus leads away from the origin, and
/// back, without leaving the body.
pub(crate) fn reach_along<const D: usize>(
    domain: &Domain<f64, D>,
    X: &SVector<f64, D>,
    direction: &SVector<f64, D>,
) -> f64 {
    let along = |axis: usize| match domain {
        Domain::Box { .. } => reach(domain, X, axis) / direction[axis].abs(),
        _ => reach(domain, X, axis),
    };
    (0..D).filter(|&axis| direction[axis] != 0.0).map(along).fold(f64::INFINITY, f64::min)
}

/// The largest extent of the body.
pub(crate) fn size<const D: usize>(domain: &Domain<f64, D>) -> Option<f64> {
    match domain {
        Domain::Box { lower, upper } => Some((upper - lower).norm()),
        Domain::Annulus { outer, .. } => Some(2.0 * outer),
        Domain::Tube { outer, lower, upper, .. } => Some((2.0 * outer).hypot(upper - lower)),
        _ => None,
    }
}

/// Sample `n` on a surface with its outward reference normal; `None` where the body has no such surface.
pub(crate) fn surface<const D: usize>(
    domain: &Domain<f64, D>,
    surface: Surface,
    n: usize,
) -> Option<(SVector<f64, D>, SVector<f64, D>)> {
    let q = |j| quasirandom(n, j, D + 1);
    match (domain, surface) {
        (Domain::Box { lower, upper }, Surface::Lower(axis) | Surface::Upper(axis)) if axis < D => {
            let mut X = SVector::from_fn(|j, _| lower[j] + (upper[j] - lower[j]) * q(j));
            let mut normal = SVector::zeros();
            let is_upper = matches!(surface, Surface::Upper(_));
            X[axis] = if is_upper { upper[axis] } else { lower[axis] };
            normal[axis] = if is_upper { 1.0 } else { -1.0 };
            Some((X, normal))
        }
        (Domain::Annulus { inner, outer }, Surface::Inner | Surface::Outer) => {
            let (R, sign) = if surface == Surface::Inner { (*inner, -1.0) } else { (*outer, 1.0) };
            let n = direction(q(0), q(1));
            Some((n * R, n * sign))
        }
        (Domain::Tube { inner, outer, lower, upper, around }, _) => {
            let [from, to] = angles(around);
            let normal = domain.normal(surface, &SVector::zeros());
            let mut place = TubePlace {
                radius: inner + (outer - inner) * q(0),
                angle: from + (to - from) * q(1),
                height: lower + (upper - lower) * q(2),
            };
            match surface {
                Surface::Inner if *inner > 0.0 => place.radius = *inner,
                Surface::Outer => place.radius = *outer,
                Surface::Lower(2) => place.height = *lower,
                Surface::Upper(2) => place.height = *upper,
                Surface::FirstAngle if normal.is_some() => place.angle = from,
                Surface::LastAngle if normal.is_some() => place.angle = to,
                _ => return None,
            }
            let X = place.cartesian();
            Some((X, domain.normal(surface, &X)?))
        }
        // The plane through the origin; the body lies on its positive side.
        (Domain::Annulus { inner, outer }, Surface::Lower(axis)) if D > 1 && axis < D => {
            let mut X: SVector<f64, D> = SVector::zeros();
            let mut normal = SVector::zeros();
            let (sin, cos) = (std::f64::consts::FRAC_PI_2 * q(1)).sin_cos();
            X[(axis + 1) % D] = if D == 2 { 1.0 } else { cos };
            if D == 3 {
                X[(axis + 2) % D] = sin;
            }
            normal[axis] = -1.0;
            Some((X * (inner + (outer - inner) * q(0)), normal))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::vector;

    #[test]
    fn samples_fill_the_unit_interval_evenly() {
        for j in 0..3 {
            let mut bins = [0; 10];
            (0..1000).for_each(|n| bins[(quasirandom(n, j, 3) * 10.0) as usize] += 1);
            assert!(bins.iter().all(|count| (95..=105).contains(count)), "{bins:?}");
        }
    }

    #[test]
    fn samples_and_their_stencils_stay_inside() {
        let ring = Domain::<f64, 2>::Annulus { inner: 0.5, outer: 1.0 };
        let square = Domain::Box { lower: vector![0.0, -1.0], upper: vector![1.0, 1.0] };
        for n in 0..200 {
            for domain in [&ring, &square] {
                let (X, t) = interior(domain, 3.0, n).unwrap();
                assert!(t > 0.05 && t < 2.95);
                for axis in 0..2 {
                    let reach = reach(domain, &X, axis);
                    assert!(reach >= 0.0099, "{reach}");
                }
            }
            let (X, N) = surface(&ring, Surface::Inner, n).unwrap();
            assert!((X.norm() - 0.5).abs() < 1e-15 && (N.norm() - 1.0).abs() < 1e-15);
            assert!(X.dot(&N) < 0.0, "the inner rim's normal points to the origin");
            let shell = Domain::<f64, 3>::Annulus { inner: 0.5, outer: 1.0 };
            let R = interior(&shell, 1.0, n).unwrap().0.norm();
            assert!((0.5..1.0).contains(&R));
            let (X, N) = surface(&shell, Surface::Lower(1), n).unwrap();
            assert!(X[1] == 0.0 && X.min() >= 0.0 && X.dot(&N) == 0.0);
            let (X, N) = surface(&square, Surface::Upper(1), n).unwrap();
            assert_eq!((X[1], N), (1.0, vector![0.0, 1.0]));
        }
        assert!(surface(&square, Surface::Inner, 0).is_none());
    }
}
