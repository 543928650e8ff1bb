//! Equilibrium by Newton's method: a body from rest to the exact state of one moment.
//!
//! The body force is that of the balance without inertia, `b - a`, so that the state of a motion at any moment is an equilibrium; of a
//! solution that does not move it is `b` itself. Body force, tractions and the motion of sides grow with the load factor, and are those of
//! the exact solution where it is one.

use std::time::Instant;

use mmsmith_galerkin::{AtRest, Equilibrium, Factors, Loads, Reached, StaticsError};
use mmsmith_measure::Comparison;
use mmsmith_measure::norms::{PerField, PerNorm};
use mmsmith_runtime::{AnySolution, Domain, Law, Solution};
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

use crate::axis::refuse_on_axis;
use crate::case::{Case, CflSpeed, law_of};
use crate::dimension::in_dimension;
use crate::error::CaseError;
use crate::frames::{FrameOutput, write_at_rest};
use crate::inverse::determinant;
use crate::order::Order;
use crate::points;
use crate::precision::Precision;
use crate::scene::Scene;
use crate::scheme::{Scheme, Total};
use crate::score::is_static;
use crate::total::ExactBoundary;
use crate::verdict::Verdict;

/// A body that is taken from rest to one moment of its motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StaticCase {
    /// Cells, points in them, the part of the body, and how its volume enters the stress.
    pub case: Case,
    /// The splines, of which degree 1 is one here, and the grid.
    pub total: Total,
    /// Load steps of equal length.
    pub load_steps: usize,
    /// The moment, in periods of the solution; it does not matter where nothing moves.
    pub moment: f64,
}

/// Errors of an equilibrium.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StaticErrors<T> {
    /// The displacement's.
    pub u: T,
    /// The deformation gradient's.
    #[allow(non_snake_case)]
    pub F: T,
    /// The first Piola-Kirchhoff stress's.
    #[allow(non_snake_case)]
    pub P: T,
}

impl<T> StaticErrors<T> {
    /// The fields by name.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, &T)> {
        [("u", &self.u), ("F", &self.F), ("P", &self.P)].into_iter()
    }

    /// The field with a name.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&T> {
        self.iter().find(|(own, _)| *own == name).map(|(_, found)| found)
    }

    /// These errors with a change of each.
    pub fn map<U>(&self, mut change: impl FnMut(&T) -> U) -> StaticErrors<U> {
        StaticErrors { u: change(&self.u), F: change(&self.F), P: change(&self.P) }
    }
}

/// A load step, as it is written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StaticStep {
    /// The load factor at its end.
    pub factor: f64,
    /// The norms of the residual, a force per thickness or area in fewer dimensions than three: that of the first linear system, and that
    /// after each step of Newton's.
    pub residuals: Vec<f64>,
    /// The norm that rounding alone may leave.
    pub rounding: f64,
    /// `ln(r3/r2)/ln(r2/r1)` of the last three that are more than rounding; `None` of fewer.
    pub exponent: Option<f64>,
    /// How often a step of Newton's was halved.
    pub halvings: usize,
    /// The factors of the last matrix: "cholesky", or "elimination" where it is not positive or not symmetric.
    pub factors: String,
}

/// The result of one case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StaticRow {
    /// Cells along the solution's cell length.
    pub cells: usize,
    /// The spacing, a length.
    pub h: f64,
    /// Quadrature points.
    pub points: usize,
    /// Coefficients of the displacement that are not given.
    pub unknowns: usize,
    /// Entries of their matrix.
    pub entries: usize,
    /// The time that it took from rest to the end, in seconds.
    pub wall_s: f64,
    /// Why it did not get there; `None` where it did.
    pub stopped: Option<String>,
    /// Places next to coefficients of the displacement that have the exact value, so that the body cannot move as a whole; none where its
    /// sides hold it.
    #[serde(default)]
    pub held: Vec<Vec<f64>>,
    /// Load steps that were begun anew with half their length.
    pub cut_backs: usize,
    /// The load steps; of a case that did not get there the last one that failed.
    pub load_steps: Vec<StaticStep>,
    /// The errors at the whole load; `None` of a case that did not get there.
    pub errors: Option<StaticErrors<PerNorm<f64>>>,
}

impl StaticRow {
    /// The exponent of the last load step that has one.
    #[must_use]
    pub fn exponent(&self) -> Option<f64> {
        self.load_steps.iter().rev().find_map(|step| step.exponent)
    }
}

/// An equilibrium, from which a body goes on to that of other loads.
#[derive(Clone, Debug, PartialEq)]
pub struct StaticState {
    /// Coordinates of the points of the body, one point after the other.
    points: Vec<f64>,
    reached: Reached,
}

/// A case on its grid.
pub struct StaticProblem<'a> {
    exact: &'a AnySolution<f64>,
    case: StaticCase,
    plan: StaticPlan,
}

/// Sizes of a case, known without solving it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StaticPlan {
    /// Quadrature points.
    pub points: f64,
    /// Memory in bytes, estimated.
    pub bytes: f64,
    /// The errors that rounding alone may cause.
    pub floors: StaticErrors<f64>,
}

/// Whether nothing of a solution moves.
#[must_use]
pub fn is_at_rest(exact: &AnySolution<f64>) -> bool {
    in_dimension!(exact, |s| is_static(s), else false)
}

/// A moment at which the body of a solution is deformed, in periods: a quarter, unless it passes through rest there.
#[must_use]
pub fn usual_moment(exact: &AnySolution<f64>) -> f64 {
    in_dimension!(exact, |s| deformed(s), else USUAL_MOMENTS[0])
}

/// Moments in periods, of which the first one is taken at which the body is deformed.
const USUAL_MOMENTS: [f64; 4] = [0.25, 0.5, 0.125, 0.375];

fn deformed<const D: usize>(exact: &dyn Solution<f64, D>) -> f64 {
    const PLACES: usize = 32;
    let domain = exact.domain();
    let largest = USUAL_MOMENTS.map(|moment| {
        let places = (0..PLACES).filter_map(|n| points::interior(&domain, 1.0, n));
        let t = moment * exact.period();
        places.map(|(X, _)| exact.displacement(&X, t).norm()).fold(0.0, f64::max)
    });
    let most = largest.iter().copied().fold(0.0, f64::max);
    let both = USUAL_MOMENTS.iter().zip(largest);
    let found = both.filter(|(_, own)| *own > 0.01 * most).map(|(moment, _)| *moment).next();
    found.unwrap_or(USUAL_MOMENTS[0])
}

impl<'a> StaticProblem<'a> {
    /// Judges a case.
    ///
    /// # Errors
    ///
    /// [`CaseError`] for settings that cannot be solved.
    pub fn new(exact: &'a AnySolution<f64>, case: &StaticCase) -> Result<Self, CaseError> {
        let plan = in_dimension!(exact, |s| plan(s, case), else Err(CaseError::Dimension))?;
        Ok(Self { exact, case: *case, plan })
    }

    /// The settings.
    #[must_use]
    pub fn case(&self) -> &StaticCase {
        &self.case
    }

    /// Sizes.
    #[must_use]
    pub fn plan(&self) -> &StaticPlan {
        &self.plan
    }

    /// Goes from rest to the exact state of the moment; `seen` is called after each step of Newton's with the load factor and the norms of
    /// the residual.
    ///
    /// # Errors
    ///
    /// [`CaseError`] for settings that cannot be solved. A case whose load is not reached is a row that says so.
    pub fn solve(&self, seen: &mut dyn FnMut(f64, &[f64])) -> Result<StaticRow, CaseError> {
        self.solve_from(None, seen, None).map(|(row, _)| row)
    }

    /// [`solve`](Self::solve) from an equilibrium in the place of rest, with a particle file of the equilibrium; also the state that was
    /// reached, if the load was.
    ///
    /// # Errors
    ///
    /// Also where the body is not that of `from`, or the file cannot be written.
    pub fn solve_from(
        &self,
        from: Option<&StaticState>,
        seen: &mut dyn FnMut(f64, &[f64]),
        output: Option<&FrameOutput>,
    ) -> Result<(StaticRow, Option<StaticState>), CaseError> {
        in_dimension!(
            self.exact,
            |s| solve(s, &self.case, from, seen, output),
            else Err(CaseError::Dimension)
        )
    }
}

/// Refuses what has no equilibrium here.
fn admit<const D: usize>(
    exact: &dyn Solution<f64, D>,
    case: &StaticCase,
) -> Result<Scene<D>, CaseError>
where
    f64: Precision<D>,
{
    let of_case = Case { scheme: Scheme::Total(case.total), ..case.case };
    of_case.validate()?;
    if case.load_steps == 0 {
        return Err(CaseError::setting("load-steps", 0, "at least 1"));
    }
    if !case.moment.is_finite() {
        return Err(CaseError::setting("moment", case.moment, "a number of periods, such as 0.25"));
    }
    if case.case.volume != mmsmith_laws::Volume::Pointwise {
        return Err(CaseError::setting("volume", "projected", "pointwise with --static"));
    }
    let evolves = match exact.law() {
        Law::Library(_) => false,
        Law::WithMemory(_) => true,
        Law::Stated(stated) => !stated.internal.is_empty(),
    };
    if evolves {
        let instead = "left out: internal variables of this law follow the motion in time, which a load factor does not tell";
        return Err(CaseError::setting("static", true, instead));
    }
    Ok(Scene::new(exact, &of_case, 0.0)?)
}

fn plan<const D: usize>(
    exact: &dyn Solution<f64, D>,
    case: &StaticCase,
) -> Result<StaticPlan, CaseError>
where
    f64: Precision<D>,
{
    let scene = admit(exact, case)?;
    let per_cell = case.case.per_cell;
    let grid = case.total.grid(&scene, per_cell)?;
    let of_points = |axis: &mmsmith_galerkin::Axis| axis.count(per_cell) as f64;
    let points: f64 = grid.axes.iter().map(of_points).product();
    let functions = |axis: &mmsmith_galerkin::Axis| (axis.cells + case.total.degree) as f64;
    let unknowns = D as f64 * grid.axes.iter().map(functions).product::<f64>();
    let degree = case.total.degree as f64;
    let in_row = D as f64 * (2.0 * degree + 1.0).powi(D as i32);
    // Tangents, deformations and stresses of points; entries, their rows, and factors several times as large.
    let of_tangents = points * (D * D * D * D + 8 * D * D) as f64;
    let fill = if D == 3 { 12.0 } else { 6.0 };
    let bytes = 8.0 * (of_tangents + unknowns * in_row * (2.0 + fill));
    Ok(StaticPlan { points, bytes, floors: floors(exact, &scene, case.total.degree)? })
}

/// Errors that rounding alone may cause.
fn floors<const D: usize>(
    exact: &dyn Solution<f64, D>,
    scene: &Scene<D>,
    degree: usize,
) -> Result<StaticErrors<f64>, CaseError>
where
    f64: Precision<D>,
{
    // The condition of the matrix, about the square of the cells, takes some of the digits of the displacement.
    let u = 16.0 * f64::EPSILON * scene.reach();
    let strain = u / scene.spacing * degree as f64;
    let speed = CflSpeed::PWave.on_wide_cells(exact)?;
    Ok(StaticErrors { u, F: strain, P: exact.density() * speed * speed * strain })
}

fn solve<const D: usize>(
    exact: &dyn Solution<f64, D>,
    case: &StaticCase,
    from: Option<&StaticState>,
    seen: &mut dyn FnMut(f64, &[f64]),
    output: Option<&FrameOutput>,
) -> Result<(StaticRow, Option<StaticState>), CaseError>
where
    f64: Precision<D>,
{
    let scene = admit(exact, case)?;
    let grid = case.total.grid(&scene, case.case.per_cell)?;
    let law = law_of(exact, &case.case)?;
    let begun = Instant::now();
    let mut body = f64::at_rest(&grid, case.total.degree, law, exact.density())?;
    refuse_on_axis(exact, body.positions())?;
    let points: Vec<f64> = body.positions().iter().flatten().copied().collect();
    if from.is_some_and(|from| from.points != points) {
        return Err(StaticsError::OtherGrid.into());
    }
    let time = case.moment * exact.period();
    let [unknowns, entries] = body.size();
    let mut row = StaticRow {
        cells: case.case.cells,
        h: scene.spacing,
        points: body.positions().len(),
        unknowns,
        entries,
        wall_s: 0.0,
        stopped: None,
        held: body.held().iter().map(|X| rounded(X, scene.reach())).collect(),
        cut_backs: 0,
        load_steps: Vec::new(),
        errors: None,
    };
    let J = |X: &SVector<f64, D>| determinant(&exact.deformation_gradient(X, time));
    if let Some(X) = body.positions().iter().find(|X| J(X) <= 0.0) {
        let place: Vec<f64> = X.iter().copied().collect();
        row.stopped = Some(format!(
            "the exact state is turned inside out: J = {:.3e} at X = {place:.6?}, so that no load step gets there; another --moment or smaller \
             parameters may be a state of a body",
            J(X)
        ));
        return Ok((row, None));
    }
    let boundary = ExactBoundary::new(exact);
    let moves = !is_static(exact);
    let loads = Loads {
        body_force: &|X| {
            let b = exact.body_force(X, time);
            let b = if moves { b - exact.acceleration(X, time) } else { b };
            // The solver has one density, and forces are per volume.
            b * (exact.density_at(X) / exact.density())
        },
        boundary: &boundary,
        time,
    };
    let from = from.map(|from| &from.reached);
    let outcome = body.solve(&loads, from, case.load_steps, seen);
    row.wall_s = begun.elapsed().as_secs_f64();
    match outcome {
        Ok(found) => {
            let errors = errors(exact, body.as_mut(), time);
            let floors = floors(exact, &scene, case.total.degree)?;
            row.stopped = elsewhere(exact, body.positions(), time, &errors, &floors);
            row.errors = Some(errors);
            row.cut_backs = found.cut_backs;
            row.load_steps = steps(&found);
            if let Some(output) = output {
                write_at_rest(output, body.observe(), exact, time)?;
            }
        }
        Err(error) => {
            if let StaticsError::NotReached { factor, residuals, cut_backs, .. } = &error {
                row.cut_backs = *cut_backs;
                row.load_steps = vec![StaticStep {
                    factor: *factor,
                    residuals: residuals.clone(),
                    rounding: 0.0,
                    exponent: None,
                    halvings: 0,
                    factors: "none".into(),
                }];
            }
            row.stopped = Some(error.to_string());
        }
    }
    let is_reached = row.stopped.is_none();
    let state = is_reached.then(|| StaticState { points, reached: body.reached() });
    Ok((row, state))
}

fn steps(found: &Equilibrium) -> Vec<StaticStep> {
    let step = |step: &mmsmith_galerkin::LoadStep| StaticStep {
        factor: step.factor,
        residuals: step.residuals.clone(),
        rounding: step.rounding,
        exponent: step.exponent(),
        halvings: step.halvings,
        factors: match step.factors {
            Factors::Cholesky => "cholesky".into(),
            Factors::Elimination => "elimination".into(),
        },
    };
    found.steps.iter().map(step).collect()
}

fn errors<const D: usize>(
    exact: &dyn Solution<f64, D>,
    body: &mut dyn AtRest<D>,
    time: f64,
) -> StaticErrors<PerNorm<f64>>
where
    f64: Precision<D>,
{
    let comparison = Comparison::new(exact, body.positions());
    let PerField { u, F, P, .. } = comparison.measure(body.observe(), time, 0.0);
    StaticErrors { u, F, P }
}

/// A place in a body of this size, zero where rounding left something of a coordinate.
fn rounded<const D: usize>(X: &SVector<f64, D>, size: f64) -> Vec<f64> {
    X.iter().map(|x| if x.abs() > 1e-12 * size { *x } else { 0.0 }).collect()
}

/// Why the state that was reached is not the one that was sought, if it is not.
fn elsewhere<const D: usize>(
    exact: &dyn Solution<f64, D>,
    positions: &[SVector<f64, D>],
    time: f64,
    errors: &StaticErrors<PerNorm<f64>>,
    floors: &StaticErrors<f64>,
) -> Option<String> {
    /// A state of the same stress: the error of P is at most this part of that of F, both relative.
    const SAME_STRESS: f64 = 1e-4;
    /// Errors of F below this part of the strain are those of the discretisation.
    const OTHER: f64 = 0.02;
    let largest =
        |of: &dyn Fn(&SVector<f64, D>) -> f64| positions.iter().map(of).fold(0.0, f64::max);
    let motion = largest(&|X| exact.displacement(X, time).amax());
    let strain = largest(&|X| (exact.deformation_gradient(X, time) - SMatrix::identity()).amax());
    let stress = largest(&|X| exact.first_piola_kirchhoff(X, time).amax());
    let [u, F, P] = [errors.u.linf, errors.F.linf, errors.P.linf];
    if F > floors.F.max(OTHER * strain) && P * strain <= SAME_STRESS * F * stress {
        return Some(format!(
            "Newton's method reached another equilibrium under the same loads: the stress is the exact one to {P:.1e}, and F differs by {F:.3e}. \
             The law has both states; a smaller strain may have one alone"
        ));
    }
    // What a coarse grid leaves is less than the motion.
    (u > motion.max(floors.u) && F > strain.max(floors.F)).then(|| {
        format!(
            "the state that Newton's method reached is not the exact one: u differs by {u:.3e}, more than the motion, {motion:.3e}"
        )
    })
}

/// Orders of a series of grids, and verdicts on them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StaticStudy {
    /// One row for each grid.
    pub rows: Vec<StaticRow>,
    /// The observed orders.
    pub orders: StaticErrors<PerNorm<Order>>,
    /// Their verdicts: by theory `p + 1` for displacements and `p` for their gradients, by splines of degree p.
    pub verdicts: StaticErrors<PerNorm<Verdict>>,
}

impl StaticStudy {
    /// The rows with their orders, judged by what is expected; `floors` are the errors that rounding alone may cause, row by row.
    #[must_use]
    pub fn new(
        rows: Vec<StaticRow>,
        expected: &StaticErrors<PerNorm<Option<f64>>>,
        tolerance: f64,
        floors: &[StaticErrors<f64>],
    ) -> Self {
        let steps: Vec<f64> = rows.iter().map(|row| row.h).collect();
        let field = |of: fn(&StaticErrors<PerNorm<f64>>) -> PerNorm<f64>,
                     floor: fn(&StaticErrors<f64>) -> f64,
                     expected: PerNorm<Option<f64>>| {
            let floors: Vec<f64> = floors.iter().map(floor).collect();
            let found = |norm| -> (Order, Verdict) {
                let error = |row: &StaticRow| row.errors.as_ref().map(|errors| of(errors)[norm]);
                let errors: Vec<Option<f64>> = rows.iter().map(error).collect();
                let above: Vec<Option<f64>> = errors
                    .iter()
                    .enumerate()
                    .map(|(row, error)| {
                        let floor = floors.get(row).copied().unwrap_or(0.0);
                        error.filter(|error| *error >= floor)
                    })
                    .collect();
                let verdict = Verdict::above(&steps, &errors, &floors, expected[norm], tolerance);
                (Order::of(&steps, &above), verdict)
            };
            PerNorm::from_fn(found)
        };
        let all = StaticErrors {
            u: field(|errors| errors.u, |floors| floors.u, expected.u),
            F: field(|errors| errors.F, |floors| floors.F, expected.F),
            P: field(|errors| errors.P, |floors| floors.P, expected.P),
        };
        Self {
            orders: all.map(|norms| norms.map(|(order, _)| order.clone())),
            verdicts: all.map(|norms| norms.map(|(_, verdict)| verdict.clone())),
            rows,
        }
    }

    /// Leaves verdicts open that promises of theory alone do not allow: of errors at rounding, of orders that have not settled and are
    /// better, and of grids that are too coarse.
    pub fn spare_coarse_grids(&mut self) {
        let coarsest = self.rows.iter().map(|row| row.cells).min();
        let settle = |one: &Verdict| one.clone().of_theory_alone(coarsest);
        self.verdicts = self.verdicts.map(|norms| norms.map(settle));
    }

    /// Whether all orders that were expected were met and all loads reached; `None` where nothing was judged.
    #[must_use]
    pub fn passed(&self) -> Option<bool> {
        let judged: Vec<bool> = self
            .verdicts
            .iter()
            .flat_map(|(_, norms)| norms.iter().filter_map(|(_, one)| one.passed))
            .collect();
        let stopped = self.rows.iter().any(|row| row.stopped.is_some());
        match (stopped || judged.contains(&false), judged.is_empty()) {
            (true, _) => Some(false),
            (false, empty) => (!empty).then_some(true),
        }
    }
}

/// The orders that theory promises in the mean of squares, for splines of a degree; of other norms and of a lattice beside sides that are
/// no walls nothing is expected.
#[must_use]
pub fn expected_of_statics(
    exact: &AnySolution<f64>,
    total: &Total,
) -> StaticErrors<PerNorm<Option<f64>>> {
    let none = PerNorm { linf: None, l2: None, l1: None };
    let is_box = in_dimension!(exact, |s| matches!(s.domain(), Domain::Box { .. }), else false);
    let is_usual = total.layout == mmsmith_galerkin::Layout::Gauss
        || Total::layout_for(exact) == mmsmith_galerkin::Layout::Lattice && is_box;
    if !is_usual {
        return StaticErrors { u: none, F: none, P: none };
    }
    let of = |order: usize| PerNorm { l2: Some(order as f64), ..none };
    let p = total.degree;
    StaticErrors { u: of(p + 1), F: of(p), P: of(p) }
}

impl From<StaticsError> for CaseError {
    fn from(error: StaticsError) -> Self {
        match error {
            StaticsError::Setup(error) => Self::from(error),
            StaticsError::Degree { degree } => Self::setting("degree", degree, "from 1 to 5"),
            other => Self::Statics(other),
        }
    }
}

#[cfg(test)]
mod tests;
