//! Are the fields of a solution what they claim to be?
//!
//! Every field is compared with one that follows from the field below it, by a route that shares no formula with
//! it: `v` with the rate of `u`, `a` with the rate of `v`, `H` and `F` with the gradient of `u`, `J` with the
//! determinant of `F`, `P` and the strain energy with the solver's hand-written law, and `b` with `a - Div P / rho0`. `u` itself is the
//! definition; nothing lies below it. Derivatives are extrapolated finite differences that know their own error.

use mmsmith_mpm::{Law, Material};
use mmsmith_runtime::{
    AnySolution, Around, Boundary, ComponentCondition, Condition, Domain, Fields, Form, Solution,
    Surface,
};
use mmsmith_threads::parallel::*;
use nalgebra::{SMatrix, SVector};
use serde::Serialize;
use thiserror::Error;

use crate::across::Across;
use crate::axis::{OnAxis, on_axis};
use crate::case::law_of_body;
use crate::difference::{derivative, derivative_of_sum};
use crate::dimension::in_dimension;
use crate::error::SceneError;
use crate::flow::is_of_memory;
use crate::inverse::determinant;
use crate::points;
use crate::precision::Precision;

/// A difference up to this multiple of the check's own estimated error is no evidence against a field.
pub const OWN_ERROR_FACTOR: f64 = 8.0;
/// Difference, relative to the field's scale, that is allowed beyond the check's own error.
pub const TOLERANCE: f64 = 1e-10;
/// Above this own error, relative to the field's scale and with its factor, a comparison proves nothing.
pub const BLUNT: f64 = 1e-6;
/// Points at which a body is looked for.
const BODY_POINTS: usize = 300;
/// Points at which its stress has to be a number.
const MATERIAL_POINTS: usize = 4;
/// Longest difference step, as a share of the body's size and of the period.
const REACH: f64 = 0.1;

/// The outcome of a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// All differences are within what is allowed.
    Passed,
    /// A difference is too large, or not a number.
    Failed,
    /// The check's own error is too large to tell.
    Inconclusive,
}

/// One comparison over all points, told by its worst point.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// The subject that was judged: a field, or a boundary condition with its surface.
    pub what: String,
    /// The reference of the comparison.
    pub against: &'static str,
    /// The worst difference, in the field's unit.
    pub difference: f64,
    /// The check's own estimated error at that point, in the field's unit.
    pub own_error: f64,
    /// The largest magnitude of the terms compared, over all points: what tolerances are relative to.
    pub scale: f64,
    /// The difference allowed there: `OWN_ERROR_FACTOR own_error + TOLERANCE scale`.
    pub allowed: f64,
    /// The worst point's reference position.
    pub X: Vec<f64>,
    /// The worst point's time.
    pub t: f64,
    /// The outcome.
    pub verdict: Verdict,
    /// Number of the parameter set with this worst finding, from zero, where there are several sets.
    pub parameter_set: usize,
}

impl Finding {
    /// How bad it is, for comparison with the same finding elsewhere.
    fn excess(&self) -> (u8, f64) {
        let rank = match self.verdict {
            Verdict::Passed => 0,
            Verdict::Inconclusive => 1,
            Verdict::Failed => 2,
        };
        (rank, excess(self.difference, self.allowed))
    }
}

/// The difference over what is allowed; not-a-number counts as the largest there is.
fn excess(difference: f64, allowed: f64) -> f64 {
    let ratio = difference / allowed;
    if difference == 0.0 {
        0.0
    } else if ratio.is_nan() {
        f64::INFINITY
    } else {
        ratio
    }
}

/// The outcome of all comparisons of one solution.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CheckReport {
    /// The number of points sampled in the body; as many on each surface with a condition.
    pub points: usize,
    /// The comparisons of fields, then those of boundary conditions.
    pub findings: Vec<Finding>,
    /// Change of a motion that is not the same after its period. It is no failure, since a run may last any time.
    pub not_periodic: Option<Change>,
    /// The axis of coordinates within the body, where formulas divide by zero.
    pub on_axis: Option<OnAxis>,
}

/// How much a motion differs after its period from its beginning, over all points sampled.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Change {
    /// The period.
    pub period: f64,
    /// Change of the displacement, over its largest magnitude.
    pub u: f64,
    /// Change of the velocity, over its largest magnitude.
    pub v: f64,
}

impl CheckReport {
    /// The worst of each finding over reports of one solution with several sets of parameters.
    ///
    /// A mistake may hide at particular values, such as a density of one.
    #[must_use]
    pub fn worst_of(reports: Vec<CheckReport>) -> CheckReport {
        let mut worst =
            CheckReport { points: 0, findings: Vec::new(), not_periodic: None, on_axis: None };
        for (set, report) in reports.into_iter().enumerate() {
            worst.points += report.points;
            if set == 0 {
                worst.not_periodic = report.not_periodic;
                worst.on_axis = report.on_axis;
            }
            for (index, mut finding) in report.findings.into_iter().enumerate() {
                finding.parameter_set = set;
                match worst.findings.get_mut(index) {
                    None => worst.findings.push(finding),
                    // Differences may not be able to judge at parameters far off; there that says nothing.
                    Some(_) if finding.verdict == Verdict::Inconclusive => {}
                    Some(known) if finding.excess() > known.excess() => *known = finding,
                    Some(_) => {}
                }
            }
        }
        worst
    }

    /// Whether every comparison passed; one that could not judge did not.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.findings.iter().all(|finding| finding.verdict == Verdict::Passed)
    }
}

/// Why a solution could not be checked.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CheckError {
    /// No points to look at.
    #[error("a check needs at least one point")]
    NoPoints,
    /// The shape or the material is not known here.
    #[error(transparent)]
    Unknown(#[from] SceneError),
    /// A boundary condition on a surface that the body does not have.
    #[error("a boundary condition is declared on {0:?}, which the body does not have")]
    NoSuchSurface(Boundary),
    /// The solution's dimension is not known here.
    #[error("the solution is not in one, two or three dimensions")]
    Dimension,
}

/// Compares every field of `solution` with the field below it at `count` points of the body and times within one
/// period, and every declared boundary condition at as many points of its surface.
///
/// The points are always the same. Difference stencils stay inside the body and the period.
///
/// # Errors
///
/// [`CheckError`] where there is nothing to check or no way to; a field found wrong is a [`Finding`], no error.
pub fn check(solution: &AnySolution<f64>, count: usize) -> Result<CheckReport, CheckError> {
    in_dimension!(solution, |s| check_in(s, count), else Err(CheckError::Dimension))
}

/// A body without volume or mass, or a motion without a period.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum NoBody {
    /// A lower surface that is not below the upper one, or an inner one that is not within the outer one.
    #[error("the body has no volume: it reaches {0}")]
    Volume(String),
    /// A constant that has to be positive and finite.
    #[error("the {quantity} is {value:?}; it has to be positive and finite")]
    Constant {
        /// Which constant.
        quantity: &'static str,
        /// Its value.
        value: f64,
    },
}

/// Whether there is a body with volume and mass, and a motion with a period.
///
/// A specification may admit parameters for which there is none.
///
/// # Errors
///
/// [`NoBody`] says what is missing.
pub fn body_of(solution: &AnySolution<f64>) -> Result<(), NoBody> {
    in_dimension!(solution, |s| body_in(s), else Ok(()))
}

fn body_in<const D: usize>(solution: &dyn Solution<f64, D>) -> Result<(), NoBody> {
    let (is_solid, extent) = match solution.domain() {
        Domain::Box { lower, upper } => (
            (0..D).all(|axis| lower[axis] < upper[axis]),
            format!("from {:?} to {:?}", lower.as_slice(), upper.as_slice()),
        ),
        Domain::Annulus { inner, outer } => {
            (0.0 <= inner && inner < outer, format!("from radius {inner:?} to radius {outer:?}"))
        }
        Domain::Tube { inner, outer, lower, upper, around } => {
            let turns = match around {
                Around::Sector { from, to } => from < to,
                _ => true,
            };
            let is_solid = 0.0 <= inner && inner < outer && lower < upper && turns;
            (is_solid, format!("from radius {inner:?} to {outer:?}, from Z {lower:?} to {upper:?}"))
        }
        _ => (true, String::new()),
    };
    if !is_solid {
        return Err(NoBody::Volume(extent));
    }
    let constants = [
        ("density", solution.density()),
        ("period", solution.period()),
        ("wave speed", solution.wave_speed()),
    ];
    match constants.into_iter().find(|(_, value)| !(*value > 0.0 && value.is_finite())) {
        Some((quantity, value)) => Err(NoBody::Constant { quantity, value }),
        None => Ok(()),
    }
}

/// Whether there is [a body](body_of) that its motion never turns inside out, as far as a few points show.
///
/// A specification may admit parameters for which there is none: these are no use for a check.
#[must_use]
pub fn has_body(solution: &AnySolution<f64>) -> bool {
    in_dimension!(solution, |s| has_body_in(s), else false)
}

fn has_body_in<const D: usize>(solution: &dyn Solution<f64, D>) -> bool {
    let domain = solution.domain();
    let keeps_volume = |X: &SVector<f64, D>, t: f64| {
        let J = solution.jacobian(X, t);
        J >= LEAST_VOLUME && J.is_finite()
    };
    body_in(solution).is_ok()
        && (0..BODY_POINTS)
            .filter_map(|n| Some((n, points::interior(&domain, solution.period(), n)?)))
            .all(|(n, (X, t))| {
                // Stretches are extreme on surfaces.
                let mut on = Surface::all(D).filter_map(|at| points::surface(&domain, at, n));
                keeps_volume(&X, t) && on.all(|(X, _)| keeps_volume(&X, t))
            })
        // Constants without a stated range may make no material that flows, whose histories end in no number.
        && (!is_of_memory(&solution.law())
            || (0..MATERIAL_POINTS)
                .filter_map(|n| points::interior(&domain, solution.period(), n))
                .all(|(X, t)| solution.first_piola_kirchhoff(&X, t).iter().all(|P| P.is_finite())))
}

/// The least ratio of volumes of a body that is checked: below it, it may be turned inside
/// out between the points that are looked at.
const LEAST_VOLUME: f64 = 0.1;

fn check_in<const D: usize>(
    solution: &dyn Solution<f64, D>,
    count: usize,
) -> Result<CheckReport, CheckError>
where
    f64: Precision<D>,
{
    if count == 0 {
        return Err(CheckError::NoPoints);
    }
    let domain = solution.domain();
    let law = match law_of_body(solution) {
        Err(SceneError::CurvilinearComponents) => None,
        known => Some(known?),
    };
    let size = points::size(&domain)
        .ok_or_else(|| SceneError::Unknown { what: "shape", value: format!("{domain:?}") })?;
    let samples: Vec<_> =
        (0..count).filter_map(|n| points::interior(&domain, solution.period(), n)).collect();
    let mut findings = field_findings(solution, law.as_ref(), &samples, size);
    findings.extend(across_findings(solution, &samples));
    let places = |surface: Surface| -> Vec<_> {
        let place = |n| {
            let (X, N) = points::surface(&domain, surface, n)?;
            Some((X, N, solution.period() * points::quasirandom(n, D, D + 1)))
        };
        (0..count).map_while(place).collect()
    };
    for surface in Surface::all(D) {
        findings.extend(traction_finding(solution, surface, &places(surface), &samples));
    }
    for boundary in solution.boundaries() {
        let places = places(boundary.surface);
        if places.is_empty() {
            return Err(CheckError::NoSuchSurface(*boundary));
        }
        findings.extend(boundary_findings(solution, boundary, &places, &samples));
    }
    Ok(CheckReport {
        points: count,
        findings,
        not_periodic: change(solution, &samples),
        on_axis: on_axis(solution),
    })
}

/// A change of the motion from one period to the next that is more than rounding, as a share of its largest values.
const PERIODIC: f64 = 1e-6;

/// By how much the motion differs one period later, if it does.
fn change<const D: usize>(
    solution: &dyn Solution<f64, D>,
    samples: &[(SVector<f64, D>, f64)],
) -> Option<Change> {
    let period = solution.period();
    let share = |field: &dyn Fn(&SVector<f64, D>, f64) -> SVector<f64, D>| {
        let (mut change, mut largest) = (0.0_f64, 0.0_f64);
        for (X, t) in samples {
            let (now, later) = (field(X, *t), field(X, *t + period));
            change = change.max((later - now).amax());
            largest = largest.max(now.amax()).max(later.amax());
        }
        if largest > 0.0 { change / largest } else { 0.0 }
    };
    let u = share(&|X, t| solution.displacement(X, t));
    let v = share(&|X, t| solution.velocity(X, t));
    (u > PERIODIC || v > PERIODIC).then_some(Change { period, u, v })
}

/// Collects the differences of one comparison until its scale is known.
struct Comparison<const D: usize> {
    what: String,
    against: &'static str,
    scale: f64,
    /// Difference, own error and place of every point.
    points: Vec<(f64, f64, SVector<f64, D>, f64)>,
}

impl<const D: usize> Comparison<D> {
    fn new(what: impl Into<String>, against: &'static str) -> Self {
        Self { what: what.into(), against, scale: 0.0, points: Vec::new() }
    }

    /// Adds a point; `scale` is the magnitude of the terms that were compared there.
    fn add(&mut self, at: (&SVector<f64, D>, f64), difference: f64, own_error: f64, scale: f64) {
        self.scale = self.scale.max(scale);
        self.points.push((difference, own_error, *at.0, at.1));
    }

    /// Adds the points of later samples.
    fn join(&mut self, later: Self) {
        self.scale = self.scale.max(later.scale);
        self.points.extend(later.points);
    }

    fn finding(self) -> Finding {
        let Self { what, against, scale, points } = self;
        let allowed = |own_error: f64| OWN_ERROR_FACTOR * own_error + TOLERANCE * scale;
        // Where nothing differs, as in a body at rest, nothing was left open.
        let blunt = points.iter().any(|&(difference, own, ..)| {
            difference != 0.0 && OWN_ERROR_FACTOR * own > BLUNT * scale
        });
        let worst = points
            .into_iter()
            .max_by(|a, b| {
                let ratio = |point: &(f64, f64, _, _)| excess(point.0, allowed(point.1));
                ratio(a).total_cmp(&ratio(b))
            })
            .unwrap_or((f64::NAN, f64::NAN, SVector::zeros(), 0.0));
        let (difference, own_error, X, t) = worst;
        let allowed = allowed(own_error);
        // Written so that NaN fails.
        let verdict = if difference <= allowed {
            if blunt { Verdict::Inconclusive } else { Verdict::Passed }
        } else {
            Verdict::Failed
        };
        let X = X.iter().copied().collect();
        Finding {
            what,
            against,
            difference,
            own_error,
            scale,
            allowed,
            X,
            t,
            verdict,
            parameter_set: 0,
        }
    }
}

/// The gradient of a vector field with respect to `X`, and its estimated error.
fn gradient<const D: usize>(
    field: impl Fn(&SVector<f64, D>) -> SVector<f64, D>,
    X: &SVector<f64, D>,
    reach: impl Fn(usize) -> f64,
) -> (SMatrix<f64, D, D>, f64) {
    let (mut value, mut error) = (SMatrix::<f64, D, D>::zeros(), 0.0_f64);
    for axis in 0..D {
        let along = derivative(|s| field(&with(X, axis, s)), X[axis], reach(axis));
        value.set_column(axis, &along.value);
        error = error.max(along.error);
    }
    (value, error)
}

/// `X` with one coordinate replaced.
pub(crate) fn with<const D: usize>(
    X: &SVector<f64, D>,
    axis: usize,
    value: f64,
) -> SVector<f64, D> {
    let mut moved = *X;
    moved[axis] = value;
    moved
}

/// Samples that one thread compares: histories take milliseconds each, and all else microseconds.
const SAMPLES_AT_ONCE: usize = 4;

fn field_findings<const D: usize>(
    solution: &dyn Solution<f64, D>,
    law: Option<&Law<f64, D>>,
    samples: &[(SVector<f64, D>, f64)],
    size: f64,
) -> Vec<Finding>
where
    f64: Precision<D>,
{
    let planted = mmsmith_laws::fault::Planted::here();
    let compare = |samples| planted.carried(|| field_comparisons(solution, law, samples, size));
    let parts: Vec<Vec<Comparison<D>>> = samples.par_chunks(SAMPLES_AT_ONCE).map(compare).collect();
    let mut parts = parts.into_iter();
    let Some(mut all) = parts.next() else { return Vec::new() };
    for part in parts {
        all.iter_mut().zip(part).for_each(|(all, part)| all.join(part));
    }
    all.into_iter()
        .filter(|comparison| !comparison.points.is_empty())
        .map(Comparison::finding)
        .collect()
}

/// The comparisons of fields at some samples, each without points where nothing is compared.
fn field_comparisons<const D: usize>(
    solution: &dyn Solution<f64, D>,
    law: Option<&Law<f64, D>>,
    samples: &[(SVector<f64, D>, f64)],
    size: f64,
) -> Vec<Comparison<D>>
where
    f64: Precision<D>,
{
    let (domain, period, density) = (solution.domain(), solution.period(), solution.density());
    let stiffness = match law {
        Some(law) => match law.lame_constants() {
            Some((lambda, mu)) => lambda.abs() + 2.0 * mu.abs(),
            None => law.p_wave_modulus().abs(),
        },
        None => density * solution.wave_speed().powi(2),
    };
    let mut v = Comparison::new("v", "du/dt");
    let mut a = Comparison::new("a", "dv/dt");
    let mut H = Comparison::new("H", "du/dX");
    let mut F = Comparison::new("F", "I + du/dX");
    let mut J = Comparison::new("J", "det F");
    let mut P = Comparison::new("P", "solver's law of F");
    let mut W = Comparison::new("W", "solver's energy of F");
    let mut in_time = Comparison::new("P : dF/dt", "dW/dt");
    let mut in_space = Comparison::new("P : dF/dR", "dW/dR");
    let mut b = Comparison::new("b", "a - Div P / rho0");
    let mut together = Comparison::new("all at once", "each on its own");
    for (X, t) in samples {
        let at = (X, *t);
        let density = solution.density_at(X);
        let own = separately(solution, X, *t);
        let reach = |axis| points::reach(&domain, X, axis).min(REACH * size);
        let reach_t = t.min(period - t).min(REACH * period);

        let rate = derivative(|s| solution.displacement(X, s), *t, reach_t);
        v.add(at, (own.v - rate.value).amax(), rate.error, own.v.amax().max(own.u.amax() / period));
        let rate = derivative(|s| solution.velocity(X, s), *t, reach_t);
        a.add(at, (own.a - rate.value).amax(), rate.error, own.a.amax().max(own.v.amax() / period));

        let (slope, error) = gradient(|X| solution.displacement(X, *t), X, reach);
        let scale = own.H.amax().max(own.u.amax() / size);
        H.add(at, (own.H - slope).amax(), error, scale);
        let strain = own.F - SMatrix::identity();
        let rounding = f64::EPSILON * own.F.amax();
        F.add(at, (strain - slope).amax(), error + rounding, scale);

        let entries = own.F.norm().max(1.0).powi(D as i32);
        let rounding = f64::EPSILON * entries;
        J.add(at, (own.J - determinant(&own.F)).abs(), rounding, own.J.abs().max(1.0));

        // F^-1 is bounded by its cofactors; the law forms F - F^-T from a rounded F.
        let inverse = match law.is_some_and(is_of_small_strain) {
            true => 0.0,
            false => own.F.norm().powi(D as i32 - 1) / own.J.abs(),
        };
        let rounding = f64::EPSILON * stiffness * (own.F.norm() + inverse) * inverse.max(1.0);
        let strain = own.P.amax().max(stiffness * own.H.amax());
        let here = law.and_then(|law| at_point(law, solution, X, *t));
        if let Some(law) = &here {
            let expected = stress(law, &own.F);
            let difference = expected.map_or(f64::NAN, |expected| (own.P - expected).amax());
            P.add(at, difference, rounding, strain);
            if let (Some(energy), Some(expected)) =
                (solution.strain_energy(X, *t), law.strain_energy(&own.F))
            {
                // Energies of the library are formed from H; text may take a difference of large terms.
                let terms = match law {
                    Law::Library(_) => own.H.amax(),
                    Law::Own(_) | Law::WithMemory(_) => 1.0 + own.H.amax(),
                };
                let difference = (energy - expected).abs();
                W.add(at, difference, rounding * terms, strain * own.H.amax());
            }
        }
        // Where the energy is known: P does the work that it stores, in time and along the ray from the origin. A law in
        // components may differ from place to place, since unit vectors turn; they do not along these two.
        if solution.strain_energy(X, *t).is_some() {
            let of = |X: &SVector<f64, D>, t: f64| {
                let energy = solution.strain_energy(X, t).unwrap_or(f64::NAN);
                (solution.deformation_gradient(X, t), SVector::<f64, 1>::new(energy))
            };
            let ray = X.try_normalize(0.0).unwrap_or_else(|| with(&SVector::zeros(), 0, 1.0));
            let on_ray = |s: f64| X + ray * s;
            let reach = points::reach_along(&domain, X, &ray).min(REACH * size);
            let changes = [
                (
                    derivative(|s| of(X, s).0, *t, reach_t),
                    derivative_of_sum(|s| of(X, s).1, *t, reach_t, stiffness),
                ),
                (
                    derivative(|s| of(&on_ray(s), *t).0, 0.0, reach),
                    derivative_of_sum(|s| of(&on_ray(s), *t).1, 0.0, reach, stiffness),
                ),
            ];
            for ((dF, dW), (joined, unit)) in
                changes.into_iter().zip([(&mut in_time, period), (&mut in_space, size)])
            {
                let work = own.P.dot(&dF.value);
                let error = dW.error + own.P.norm() * dF.error;
                let change = dF.value.norm().max(own.H.norm() / unit);
                let scale = strain * change;
                joined.add(at, (work - dW.value[0]).abs(), error + rounding * change, scale);
            }
        }

        let (mut divergence, mut error) = (SVector::<f64, D>::zeros(), 0.0);
        let mut terms = own.b.amax().max(own.a.amax());
        for axis in 0..D {
            let column = |s| -> SVector<f64, D> {
                let X = with(X, axis, s);
                solution.first_piola_kirchhoff(&X, *t).column(axis).into_owned()
            };
            let along = derivative(column, X[axis], reach(axis));
            divergence += along.value;
            error += along.error;
            terms = terms.max(along.value.amax() / density);
        }
        let error = error / density + 4.0 * f64::EPSILON * terms;
        let expected = own.a - divergence / density;
        b.add(at, (own.b - expected).amax(), error, terms);

        let all = solution.fields(X, *t);
        together.add(at, disagreement(&all, &own, stiffness, terms), 0.0, 1.0);
    }
    vec![v, a, H, F, J, P, W, in_time, in_space, b, together]
}

/// Where there is no stress across: the law in space, at the stretch that is told, has none there, and in the plane the stress of the
/// solution. The formulas of the plane have no part in it.
fn across_findings<const D: usize>(
    solution: &dyn Solution<f64, D>,
    samples: &[(SVector<f64, D>, f64)],
) -> Vec<Finding> {
    let Some(law) = Across::<D>::of(solution.law()) else { return Vec::new() };
    let mut across = Comparison::new("F_zz", "P_zz = 0, law in space");
    let mut along = Comparison::new("P", "law in space at F_zz");
    let stiffness = law.stiffness();
    for (X, t) in samples {
        let at = (X, *t);
        let (F, P) = (solution.deformation_gradient(X, *t), solution.first_piola_kirchhoff(X, *t));
        let stretch = solution.stretch_across(X, *t);
        let expected = law.stress(&F, stretch);
        let difference = P - expected.fixed_view::<D, D>(0, 0);
        let H = F - SMatrix::identity();
        let scale = P.amax().max(stiffness * H.amax());
        let inverse = (F.norm().powi(D as i32 - 1) / determinant(&F).abs()).max(1.0 / stretch);
        let rounding = f64::EPSILON * stiffness * (F.norm() + inverse) * inverse.max(1.0);
        across.add(at, expected[(2, 2)].abs(), rounding, scale);
        along.add(at, difference.amax(), rounding, scale);
    }
    let findings = [Some(across), law.is_cartesian.then_some(along)];
    findings.into_iter().flatten().map(Comparison::finding).collect()
}

/// The stress of the solver's law. That of linear elasticity takes no determinant, and a displacement that is no motion of a body
/// has it all the same.
fn stress<const D: usize>(law: &Law<f64, D>, F: &SMatrix<f64, D, D>) -> Option<SMatrix<f64, D, D>>
where
    f64: Precision<D>,
{
    let at_small_strain = || law.stress_at_small_strain(&(F - SMatrix::identity()));
    law.first_piola_kirchhoff(F).or_else(|| is_of_small_strain(law).then(at_small_strain))
}

/// The law at a place and a time, with the exact internal variables there; `None` where they are not known.
pub(crate) fn at_point<const D: usize>(
    law: &Law<f64, D>,
    solution: &dyn Solution<f64, D>,
    X: &SVector<f64, D>,
    t: f64,
) -> Option<Law<f64, D>>
where
    f64: Precision<D>,
{
    let Law::WithMemory(own) = law else { return Some(law.clone()) };
    let mut q = own.initial(X);
    let exact = solution.internal(X, t);
    let names = solution.internal_variables();
    for (variable, q) in own.variables().iter().zip(&mut q) {
        let place = names.iter().position(|name| *name == variable.name);
        match (place, variable.name.as_str()) {
            (Some(place), _) => *q = *exact.get(place)?,
            (None, "(t)") => *q = t,
            (None, name) if name.starts_with("(X") => {}
            (None, _) => return None,
        }
    }
    Some(law.with_variables(&q))
}

fn is_of_small_strain<const D: usize>(law: &Law<f64, D>) -> bool {
    matches!(law, Law::Library(Material::LinearElastic { .. }))
}

/// The fields from the functions that give one each.
fn separately<const D: usize>(
    solution: &dyn Solution<f64, D>,
    X: &SVector<f64, D>,
    t: f64,
) -> Fields<f64, D> {
    Fields {
        u: solution.displacement(X, t),
        v: solution.velocity(X, t),
        a: solution.acceleration(X, t),
        H: solution.displacement_gradient(X, t),
        F: solution.deformation_gradient(X, t),
        J: solution.jacobian(X, t),
        P: solution.first_piola_kirchhoff(X, t),
        b: solution.body_force(X, t),
    }
}

/// The largest difference between two sets of fields, each relative to its own magnitude.
fn disagreement<const D: usize>(
    one: &Fields<f64, D>,
    other: &Fields<f64, D>,
    stiffness: f64,
    force: f64,
) -> f64 {
    // Rounding may differ where terms cancel, so each field is measured by the terms that it is made of.
    let relative = |difference: f64, scale: f64| {
        if difference == 0.0 { 0.0 } else { difference / scale }
    };
    let strain = other.H.amax();
    [
        relative((one.u - other.u).amax(), other.u.amax()),
        relative((one.v - other.v).amax(), other.v.amax()),
        relative((one.a - other.a).amax(), other.a.amax()),
        relative((one.H - other.H).amax(), strain),
        relative((one.F - other.F).amax(), 1.0),
        relative((one.J - other.J).abs(), 1.0),
        relative((one.P - other.P).amax(), stiffness * strain),
        relative((one.b - other.b).amax(), force),
    ]
    .into_iter()
    .fold(0.0, |largest, next| if next > largest || next.is_nan() { next } else { largest })
}

/// The traction on a surface against the stress there; nothing where the body has no such surface.
fn traction_finding<const D: usize>(
    solution: &dyn Solution<f64, D>,
    surface: Surface,
    places: &[(SVector<f64, D>, SVector<f64, D>, f64)],
    samples: &[(SVector<f64, D>, f64)],
) -> Option<Finding> {
    if places.is_empty() {
        return None;
    }
    let stress = largest(places, samples, &|X, t| solution.first_piola_kirchhoff(X, t).amax());
    let mut found = Comparison::new(format!("traction on {surface}"), "P N");
    for (X, N, t) in places {
        let expected = solution.first_piola_kirchhoff(X, *t) * N;
        let traction = solution.traction(surface, X, *t);
        let difference = traction.map_or(f64::NAN, |traction| (traction - expected).amax());
        found.add((X, *t), difference, 16.0 * f64::EPSILON * stress, stress);
    }
    Some(found.finding())
}

/// The largest value of a field in the body and on a surface, where it may be larger than at the samples within.
fn largest<const D: usize>(
    places: &[(SVector<f64, D>, SVector<f64, D>, f64)],
    samples: &[(SVector<f64, D>, f64)],
    field: &dyn Fn(&SVector<f64, D>, f64) -> f64,
) -> f64 {
    let within = samples.iter().map(|(X, t)| (X, *t));
    let all = within.chain(places.iter().map(|(X, _, t)| (X, *t)));
    all.map(|(X, t)| field(X, t)).fold(0.0, f64::max)
}

fn boundary_findings<const D: usize>(
    solution: &dyn Solution<f64, D>,
    boundary: &Boundary,
    places: &[(SVector<f64, D>, SVector<f64, D>, f64)],
    samples: &[(SVector<f64, D>, f64)],
) -> Vec<Finding> {
    let name = |what: &str| format!("{what} on {}", boundary.surface);
    // Scales are those of the whole body: on the boundary itself everything may vanish.
    let stress = largest(places, samples, &|X, t| solution.first_piola_kirchhoff(X, t).amax());
    let traction = |X, N: &SVector<f64, D>, t| solution.first_piola_kirchhoff(X, t) * N;
    match boundary.condition {
        Condition::Sliding | Condition::Symmetry => {
            let length = largest(places, samples, &|X, t| solution.displacement(X, t).amax());
            let mut normal = Comparison::new(name("u.N"), "0");
            let mut shear = Comparison::new(name("shear"), "0");
            for (X, N, t) in places {
                let u = solution.displacement(X, *t).dot(N);
                normal.add((X, *t), u.abs(), 4.0 * f64::EPSILON * length, length);
                let traction = traction(X, N, *t);
                let tangential = traction - N * traction.dot(N);
                shear.add((X, *t), tangential.amax(), 4.0 * f64::EPSILON * stress, stress);
            }
            vec![normal.finding(), shear.finding()]
        }
        Condition::TractionFree => {
            let mut free = Comparison::new(name("P N"), "0");
            for (X, N, t) in places {
                let own_error = 16.0 * f64::EPSILON * stress;
                free.add((X, *t), traction(X, N, *t).amax(), own_error, stress);
            }
            vec![free.finding()]
        }
        Condition::Mixed(mixed) => {
            let free = ComponentCondition::TractionFree;
            let finding = |what: &str, of: &dyn Fn(SVector<f64, D>, &SVector<f64, D>) -> f64| {
                let mut found = Comparison::new(name(what), "0");
                for (X, N, t) in places {
                    let own_error = 16.0 * f64::EPSILON * stress;
                    found.add((X, *t), of(traction(X, N, *t), N), own_error, stress);
                }
                found.finding()
            };
            match mixed.form() {
                Form::ByDirection { normal, .. } if normal == free => {
                    vec![finding("N.P N", &|traction, N| traction.dot(N).abs())]
                }
                Form::ByDirection { tangential, .. } if tangential == free => {
                    vec![finding("shear", &|traction, N| (traction - N * traction.dot(N)).amax())]
                }
                Form::ByDirection { .. } => Vec::new(),
                Form::ByComponent(of) => (0..D)
                    .filter(|&i| of[i % 3] == free)
                    .map(|i| {
                        let what = format!("P N along {}", ["X", "Y", "Z"][i % 3]);
                        finding(&what, &|traction, _| traction[i].abs())
                    })
                    .collect(),
            }
        }
        // The solution's own motion or traction is imposed: there is nothing to prove.
        Condition::PrescribedTraction | Condition::PrescribedMotion => Vec::new(),
    }
}
