//! How much small disturbances of an exact motion grow until its end: what every scheme loses in digits, however good it is.
//!
//! A manufactured solution is a motion under a dead body force. Next to incompressibility its pressure may be many times the shear modulus,
//! and where that pressure has a maximum, a particle that is displaced carries its force to a place that needs less of it: the disturbance
//! grows. In a field without divergence the linearised balance of momentum is
//!
//! ```text
//! rho w'' = mu Div grad w - (grad grad p) w - grad q,  Div w = 0
//! ```
//!
//! about a state of pressure p, q being the change of pressure. A gradient of p that is the same everywhere is taken up by q. What remains is the
//! second gradient: waves of wave number k grow at a rate of up to `sqrt(-e/rho - (mu/rho) k^2)`, e its least eigenvalue.

mod disturbance;
#[cfg(test)]
mod tests;

use std::f64::consts::TAU;
use std::sync::OnceLock;

use mmsmith_galerkin::{Coordinates, Disturbed, Grid, Layout, Magnitude};
use mmsmith_runtime::nalgebra::{SMatrix, SVector};
use mmsmith_runtime::{AnySolution, BLOCK, Domain, Solution, StateAtPoints, StateRun};
use serde::Serialize;

use self::disturbance::{disturbance, mixed};
use crate::case::{Case, law_of_body};
use crate::dimension::in_dimension;
use crate::error::{CaseError, SceneError};
use crate::flow::has_memory;
use crate::precision::Precision;
use crate::scene::Scene;
use crate::scheme::{Scheme, Total};
use crate::state_of_stress::{Extremes, Rates, extremes, is_harmless, moduli};

/// A factor by which no digit of double precision is left: growth is not followed beyond it.
pub const MOST_GROWTH: f64 = 1e16;

/// A factor of growth that costs a digit.
pub const A_DIGIT: f64 = 10.0;

/// Disturbances to follow, and the grid to follow them on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GrowthSettings {
    /// The end time in periods of the solution.
    pub periods: f64,
    /// Cells along the cell length; none for the usual number.
    pub cells: Option<usize>,
    /// The splines' degree; none for the usual one.
    pub degree: Option<usize>,
    /// Waves of one, a half, a third ... of the body's length, so many of them.
    pub waves: usize,
    /// How often the disturbance that grows most is improved; zero leaves it out.
    pub iterations: usize,
    /// The most points times steps of one run; none for any number.
    pub most_work: Option<f64>,
}

/// Growth until the end, by a disturbance that starts as a velocity.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Grown {
    /// The largest displacement over the way that the largest first velocity makes in `l/(4 c)`, l the cell length and c the wave speed:
    /// up to about one in a body at rest.
    pub factor: f64,
    /// The factor by roots of mean squares over the body in place of largest magnitudes.
    pub factor_l2: f64,
    /// The factor at the end.
    pub at_end: f64,
    /// When the factor reaches ten.
    pub tenfold_at: Option<f64>,
    /// When it exceeds [`MOST_GROWTH`]: it is not followed from there on.
    pub all_lost_at: Option<f64>,
    /// Times and factors on the way.
    pub course: Vec<[f64; 2]>,
}

/// Growth of one wave.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WaveGrowth {
    /// Waves along the body's length.
    pub waves: usize,
    /// The factor that the estimate by the pressure's second gradient allows.
    pub estimate: f64,
    /// The measured growth.
    #[serde(flatten)]
    pub grown: Grown,
}

/// How much disturbances of an exact motion grow.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Growth {
    /// The end time.
    pub end: f64,
    /// Cells along the cell length.
    pub cells: usize,
    /// The splines' degree.
    pub degree: usize,
    /// Quadrature points.
    pub points: usize,
    /// Time steps.
    pub steps: usize,
    /// The largest factor of all.
    pub factor: f64,
    /// Its decimal logarithm: digits that every scheme loses.
    pub digits: f64,
    /// Disturbances in waves.
    pub waves: Vec<WaveGrowth>,
    /// The disturbance that grows most in the mean of squares; none where it was not looked for.
    pub largest: Option<Grown>,
    /// Whether another iteration changed that by less than 2 %.
    pub is_settled: bool,
    /// Pressure, shear and what follows from them.
    pub extremes: Extremes,
}

/// Why growth is not measured.
#[derive(Debug, thiserror::Error)]
pub enum GrowthError {
    /// The stress depends on more than the deformation.
    #[error(
        "the stress depends on more than the deformation gradient, on its history, its rate or the place, and the growth is told of elastic laws alone \
         whose constants are the same everywhere"
    )]
    Memory,
    /// The density differs from place to place.
    #[error(
        "the density differs from place to place, and the growth is told of bodies with one density"
    )]
    Density,
    /// More work than is allowed.
    #[error("it takes {steps} steps of {points} points")]
    Work {
        /// Steps of a run.
        steps: usize,
        /// Points of the grid.
        points: usize,
    },
    /// The motion has no grid.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// The disturbance is no number.
    #[error("the disturbance is no finite number after step {step} of {steps}")]
    NotFinite {
        /// The step.
        step: usize,
        /// Steps of the run.
        steps: usize,
    },
}

/// Measures how much small disturbances of an exact motion grow.
///
/// # Errors
///
/// Why they cannot be told.
pub fn growth(exact: &AnySolution<f64>, settings: &GrowthSettings) -> Result<Growth, GrowthError> {
    if has_memory(exact) {
        return Err(GrowthError::Memory);
    }
    in_dimension!(exact, |s| measure(s, settings), else Err(CaseError::Dimension.into()))
}

/// Growth that costs a digit or more.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Harm {
    /// The factor by which errors grow.
    pub factor: f64,
    /// Whether it was measured; else it is the estimate, beyond which growth does not go.
    pub measured: bool,
    /// Pressure and shear of the motion.
    pub extremes: Extremes,
}

/// The growth of errors in a motion until so many periods where it costs a digit or more, or where waves lose their stiffness: an ordinary motion, which is
/// [harmless](Extremes::are_harmless) or has rates that add up to less than a digit, takes some evaluations of the law alone. None where the law has
/// memory.
#[must_use]
pub fn harmful_growth(exact: &AnySolution<f64>, periods: f64) -> Option<Harm> {
    // One to two seconds a run.
    const MOST_WORK: f64 = 1e7;
    if has_memory(exact) {
        return None;
    }
    let (extremes, estimate) = in_dimension!(exact, |s| may_grow(s, periods), else None)?;
    let settings = GrowthSettings {
        periods,
        cells: None,
        degree: None,
        waves: 1,
        iterations: 1,
        most_work: Some(MOST_WORK),
    };
    // Coarse cells are stiffer against disturbances than the body is, but not by much.
    let found = [None, Some(8), Some(6)].into_iter().find_map(|cells| {
        match growth(exact, &GrowthSettings { cells, ..settings }) {
            Err(GrowthError::Work { .. } | GrowthError::Case(_)) => None,
            other => Some(other),
        }
    });
    let (factor, measured) = match found {
        Some(Ok(found)) => (found.factor, true),
        _ => (estimate.min(2.0 * MOST_GROWTH), false),
    };
    // Where waves are not stiff, those that are shorter than the measured ones grow more.
    let is_harm = factor >= A_DIGIT || extremes.wave_stiffness <= 0.0;
    is_harm.then_some(Harm { factor, measured, extremes })
}

/// The extremes of a motion and the estimate of its growth, where disturbances may grow by a digit.
fn may_grow<const D: usize>(exact: &dyn Solution<f64, D>, periods: f64) -> Option<(Extremes, f64)>
where
    f64: Precision<D>,
{
    let law = law_of_body::<f64, D>(exact).ok()?;
    if is_harmless(exact, &law, periods) {
        return None;
    }
    let (extremes, rates) = extremes(exact, &law, periods)?;
    // The rates are those of pressures; where plane waves are not stiff the shortest grow without bound.
    let estimate = match extremes.wave_stiffness > 0.0 {
        true => estimate(&rates, exact, 1),
        false => 2.0 * MOST_GROWTH,
    };
    (estimate >= A_DIGIT).then_some((extremes, estimate))
}

/// Lame's constants' quotient lambda/mu at rest; none where the law has memory.
#[must_use]
pub fn lambda_over_mu(exact: &AnySolution<f64>) -> Option<f64> {
    if has_memory(exact) {
        return None;
    }
    in_dimension!(
        exact,
        |s| quotient_of_moduli(s),
        else None
    )
}

fn quotient_of_moduli<const D: usize>(exact: &dyn Solution<f64, D>) -> Option<f64>
where
    f64: Precision<D>,
{
    let (lambda, mu) = moduli(&law_of_body::<f64, D>(exact).ok()?);
    Some(lambda / mu)
}

/// Largest pressure and shear of a motion until so many periods; none where the law has memory.
#[must_use]
pub fn extremes_of(exact: &AnySolution<f64>, periods: f64) -> Option<Extremes> {
    if has_memory(exact) {
        return None;
    }
    in_dimension!(exact, |s| Some(extremes(s, &law_of_body(s).ok()?, periods)?.0), else None)
}

/// The usual degree and number of cells by dimension: waves of a third of the body's length have four cells each of degree 4 in the plane.
fn usual(dimension: usize) -> (usize, usize) {
    match dimension {
        1 => (4, 24),
        2 => (4, 12),
        _ => (3, 5),
    }
}

fn measure<const D: usize>(
    exact: &dyn Solution<f64, D>,
    settings: &GrowthSettings,
) -> Result<Growth, GrowthError>
where
    f64: Precision<D>,
{
    let law = law_of_body::<f64, D>(exact).map_err(CaseError::from)?;
    let (degree, cells) = usual(D);
    let (degree, cells) = (settings.degree.unwrap_or(degree), settings.cells.unwrap_or(cells));
    let end = settings.periods * exact.period();
    let (grid, cells) = grid(exact, degree, cells, settings)?;
    let middle = exact.density();
    let mut start = f64::undisturbed(&grid, degree, law.clone(), middle)
        .map_err(|error| GrowthError::Case(error.into()))?;
    if start.positions().iter().any(|X| exact.density_at(X) != middle) {
        return Err(GrowthError::Density);
    }
    let steps = steps(exact, start.as_mut(), settings.periods)?;
    let points = start.positions().len();
    if settings.most_work.is_some_and(|most| points as f64 * steps as f64 > most) {
        return Err(GrowthError::Work { steps, points });
    }
    let motion = Motion::new(exact, start.positions(), end, steps);
    let unit = exact.cell_length() / (4.0 * exact.wave_speed());
    let (extremes, rates) = extremes(exact, &law, settings.periods).ok_or(CaseError::Dimension)?;
    let mut run = Run { motion: &motion, unit };
    let mut waves = Vec::new();
    for count in 1..=settings.waves {
        start.start(&disturbance(exact, &grid, start.positions(), count));
        let grown = run.forwards(start.as_mut())?;
        waves.push(WaveGrowth { waves: count, estimate: estimate(&rates, exact, count), grown });
    }
    let (largest, is_settled) = run.largest(start.as_mut(), settings.iterations)?;
    let all = waves.iter().map(|wave| &wave.grown).chain(&largest).map(|grown| grown.factor);
    let factor = all.fold(0.0, f64::max);
    Ok(Growth {
        end,
        cells,
        degree,
        points,
        steps,
        factor,
        digits: factor.log10().max(0.0),
        waves,
        largest,
        is_settled,
        extremes,
    })
}

/// The grid of a body, with Gauss points, and the number of cells that it has along the cell length.
fn grid<const D: usize>(
    exact: &dyn Solution<f64, D>,
    degree: usize,
    cells: usize,
    settings: &GrowthSettings,
) -> Result<(Grid<D>, usize), CaseError> {
    let total = Total {
        layout: Layout::Gauss,
        coordinates: match exact.domain() {
            Domain::Annulus { .. } if D == 2 => Coordinates::Polar,
            Domain::Annulus { .. } => Coordinates::Spherical,
            Domain::Tube { .. } => Coordinates::Cylindrical,
            _ => Coordinates::Cartesian,
        },
        ..Total::of_degree(degree)
    };
    let case = |cells: usize| Case {
        scheme: Scheme::Total(total),
        cells,
        per_cell: degree + 1,
        periods: settings.periods,
        ..Case::default()
    };
    let end = settings.periods * exact.period();
    let scene = |cells: usize| Scene::new(exact, &case(cells), end);
    let (scene, cells) = match scene(cells) {
        // Nobody has asked for just these cells.
        Err(SceneError::Misfit { fitting, .. })
            if settings.cells.is_none() && !fitting.is_empty() =>
        {
            let nearest = fitting.iter().copied().min_by_key(|fits| fits.abs_diff(cells));
            let nearest = nearest.unwrap_or(cells);
            (scene(nearest)?, nearest)
        }
        found => (found?, cells),
    };
    Ok((total.grid(&scene, degree + 1)?, cells))
}

/// Steps of leapfrog that are stable, from the fastest waves on the grid at some times of the motion.
fn steps<const D: usize>(
    exact: &dyn Solution<f64, D>,
    places: &mut dyn Disturbed<D>,
    periods: f64,
) -> Result<usize, CaseError> {
    // Powers find frequencies from below, and between the times the body may be stiffer.
    const SHARE_OF_STABLE: f64 = 0.8;
    const POWERS: usize = 24;
    const TIMES: usize = 8;
    // In slow solids steps have to follow the motion.
    const FEWEST_IN_A_PERIOD: f64 = 200.0;
    let end = periods * exact.period();
    let span = end.min(exact.period());
    let motion = Motion::new(exact, places.positions(), span, TIMES);
    let mut F = Vec::new();
    let mut fastest = 0.0_f64;
    for time in 0..=TIMES {
        motion.gradients(time, &mut F);
        fastest = fastest.max(places.largest_frequency(&F, POWERS));
    }
    let longest = SHARE_OF_STABLE * 2.0 / fastest;
    let steps = (end / longest).max(FEWEST_IN_A_PERIOD * periods).ceil();
    if steps.is_nan() || steps > 1e7 {
        return Err(CaseError::TooManySteps { end, dt: longest, steps });
    }
    Ok(steps as usize)
}

/// The exact deformation gradients at the points at the ends of all steps.
struct Motion<'a, const D: usize> {
    state: Box<dyn StateAtPoints<f64, D> + 'a>,
    points: usize,
    end: f64,
    steps: usize,
    /// Kept where they fit.
    kept: Option<Vec<OnceLock<Vec<SMatrix<f64, D, D>>>>>,
}

impl<'a, const D: usize> Motion<'a, D> {
    fn new(
        exact: &'a dyn Solution<f64, D>,
        positions: &[SVector<f64, D>],
        end: f64,
        steps: usize,
    ) -> Self {
        const MOST_BYTES: usize = 256 << 20;
        let points = positions.len();
        let bytes = (steps + 1) * points * size_of::<SMatrix<f64, D, D>>();
        let kept = (bytes <= MOST_BYTES).then(|| vec![OnceLock::new(); steps + 1]);
        Self { state: exact.state_at(positions), points, end, steps, kept }
    }

    fn gradients(&self, step: usize, F: &mut Vec<SMatrix<f64, D, D>>) {
        match &self.kept {
            Some(kept) => F.clone_from(kept[step].get_or_init(|| self.evaluate(step))),
            None => *F = self.evaluate(step),
        }
    }

    fn evaluate(&self, step: usize) -> Vec<SMatrix<f64, D, D>> {
        let t = self.end * (step as f64 / self.steps as f64);
        let mut runs = vec![StateRun::zero(); self.points.div_ceil(BLOCK)];
        self.state.evaluate(t, t, 0, &mut runs);
        let of = |p: usize| {
            let run = &runs[p / BLOCK].F;
            SMatrix::from_fn(|i, j| run[i][j][p % BLOCK])
        };
        (0..self.points).map(of).collect()
    }
}

/// Runs of disturbances of one motion.
struct Run<'a, const D: usize> {
    motion: &'a Motion<'a, D>,
    /// The time by which velocities are made lengths.
    unit: f64,
}

impl<const D: usize> Run<'_, D>
where
    f64: Precision<D>,
{
    /// Follows a disturbance to the end.
    fn forwards(&mut self, disturbance: &mut dyn Disturbed<D>) -> Result<Grown, GrowthError> {
        const MOMENTS: usize = 128;
        let &mut Self { motion, unit } = self;
        let Motion { end, steps, .. } = *motion;
        let first = disturbance.velocity();
        let of = |found: Magnitude| Magnitude {
            largest: found.largest / (first.largest * unit),
            mean: found.mean / (first.mean * unit),
        };
        let mut grown = Grown {
            factor: 0.0,
            factor_l2: 0.0,
            at_end: 0.0,
            tenfold_at: None,
            all_lost_at: None,
            course: Vec::new(),
        };
        let mut lost = None;
        let every = steps.div_ceil(MOMENTS);
        let mut seen = |step: usize, disturbance: &mut dyn Disturbed<D>| {
            if !step.is_multiple_of(every) && step != steps {
                return true;
            }
            let found = of(disturbance.displacement());
            if !found.largest.is_finite() {
                lost = Some(step);
                return false;
            }
            let time = end * (step as f64 / steps as f64);
            grown.factor = grown.factor.max(found.largest);
            grown.factor_l2 = grown.factor_l2.max(found.mean);
            grown.at_end = found.largest;
            if found.largest >= A_DIGIT {
                grown.tenfold_at.get_or_insert(time);
            }
            if found.largest > MOST_GROWTH {
                grown.all_lost_at = Some(time);
            }
            grown.course.push([time, found.largest]);
            grown.all_lost_at.is_none()
        };
        let dt = end / steps as f64;
        disturbance.advance(dt, steps, &mut |step, F| motion.gradients(step, F), &mut seen);
        match lost {
            Some(step) => Err(GrowthError::NotFinite { step, steps }),
            None => Ok(grown),
        }
    }

    /// The disturbance that grows most in the mean of squares until the end, by powers of a run and its adjoint, which is the run
    /// backwards; and whether it has settled.
    fn largest(
        &mut self,
        disturbance: &mut dyn Disturbed<D>,
        iterations: usize,
    ) -> Result<(Option<Grown>, bool), GrowthError> {
        const CHANGE: f64 = 0.02;
        if iterations == 0 {
            return Ok((None, false));
        }
        let Motion { end, steps, .. } = *self.motion;
        disturbance.start(&mixed(disturbance.positions()));
        let mut best = self.forwards(disturbance)?;
        for _ in 0..iterations {
            if best.all_lost_at.is_some() {
                return Ok((Some(best), true));
            }
            let reached = disturbance.displacement().mean;
            disturbance.start_from_displacement(reached.recip());
            let dt = end / steps as f64;
            let motion = self.motion;
            let mut backwards = |step: usize, F: &mut Vec<_>| motion.gradients(steps - step, F);
            disturbance.advance(dt, steps, &mut backwards, &mut |_, _| true);
            let reached = disturbance.displacement().mean;
            disturbance.start_from_displacement(reached.recip());
            let before = best.factor_l2;
            best = self.forwards(disturbance)?;
            if (best.factor_l2 / before - 1.0).abs() < CHANGE {
                return Ok((Some(best), true));
            }
        }
        Ok((Some(best), false))
    }
}

/// The growth of a wave by the estimate: e to the integral of the largest rate at each time.
fn estimate<const D: usize>(rates: &Rates, exact: &dyn Solution<f64, D>, count: usize) -> f64 {
    rates.growth(TAU * count as f64 / exact.cell_length())
}
