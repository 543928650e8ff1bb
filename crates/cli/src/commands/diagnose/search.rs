//! Which mistake restores the order of a solver.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::sync::Mutex;

use anyhow::Result;
use mmsmith_codegen::{CAUSES, Cause, Counter, Timed, Unused};
use mmsmith_spec::ComponentCondition;
use mmsmith_verify::{Norm, Quantity};
use rayon::prelude::*;

use super::runs::{Errors, Run, Solver, Trial};

/// How many mistakes are run on the second grid, and on a third one.
const SECOND: usize = 8;
const THIRD: usize = 3;
/// So many mistakes are tried at a time: where one of them explains the errors, less likely ones are left out.
const BATCH: usize = 24;
/// A solver whose order is lower than expected by no more is run on a third grid before it is judged.
const NEAR: f64 = 0.7;
/// From this order on errors are rather those of a shift in time or place.
const FIRST_ORDER: f64 = 0.5;
/// Errors that fall with a lower order are not those of a mistake that vanishes with the cells.
const VANISHING: f64 = 0.4;
/// Errors of this share are alike.
const ALIKE: f64 = 0.02;
/// The shift that a fit begins with, in lengths of a cell over the wave speed.
const FIRST_SHIFT: f64 = 0.2;
/// A solver that has a time step this small beside a cell is not at fault by it.
const SMALLEST_SHIFT: f64 = 1e-4;

/// Orders that are expected of a solver, and their tolerance.
pub(super) struct Expected {
    pub(super) orders: BTreeMap<Quantity, f64>,
    /// The norm of each of them.
    pub(super) norms: BTreeMap<Quantity, Norm>,
    pub(super) tolerance: f64,
}

/// The errors of one trial on the grids that were run.
pub(super) struct Tried {
    pub(super) trial: Trial,
    pub(super) errors: BTreeMap<usize, Errors>,
}

impl Expected {
    /// The order of a field on the two finest grids.
    pub(super) fn order(errors: &BTreeMap<usize, Errors>, field: Quantity) -> f64 {
        let mut finest = errors.iter().rev();
        let (Some((fine, of_fine)), Some((coarse, of_coarse))) = (finest.next(), finest.next())
        else {
            return f64::NAN;
        };
        let error = |errors: &Errors| errors.get(&field).copied().unwrap_or(f64::INFINITY);
        let order = (error(of_coarse) / error(of_fine)).ln() / (*fine as f64 / *coarse as f64).ln();
        if order.is_finite() { order } else { f64::NAN }
    }

    /// Whether the errors fall with the expected orders, but for so much.
    pub(super) fn is_met(&self, errors: &BTreeMap<usize, Errors>, slack: f64) -> bool {
        self.orders
            .iter()
            .all(|(&field, order)| Self::order(errors, field) >= order - self.tolerance - slack)
    }

    fn size(&self, errors: &Errors) -> f64 {
        let squares = self
            .orders
            .keys()
            .map(|field| errors.get(field).map_or(f64::INFINITY, |error| error * error));
        let size = squares.sum::<f64>().sqrt();
        if size.is_finite() { size } else { f64::INFINITY }
    }
}

impl Tried {
    fn finest(&self) -> &Errors {
        static NONE: Errors = Errors::new();
        self.errors.values().next_back().unwrap_or(&NONE)
    }
}

/// The search with one solver.
pub(super) struct Search<'a> {
    pub(super) solver: &'a Solver<'a>,
    pub(super) expected: &'a Expected,
    pub(super) cells: &'a [usize],
    /// The order with the right fields.
    pub(super) order: f64,
    /// The errors with the right fields, on all grids that mistakes are tried on.
    pub(super) right: Mutex<BTreeMap<usize, Errors>>,
    /// Why a mistake was not looked for.
    pub(super) not_tried: Mutex<BTreeMap<&'static str, String>>,
}

/// The reason where the time was up.
pub(super) const NO_TIME: &str = "there was no time for it; give more with --seconds";
/// The reason where a solver that ran with the right fields fails with others.
pub(super) const NO_RESULT: &str = "no result with the fields that counter it";

impl Search<'_> {
    fn leave_out(&self, cause: &Cause, why: &str) {
        if let Ok(mut left_out) = self.not_tried.lock() {
            left_out.insert(cause.name, why.to_owned());
        }
    }

    fn knows_steps(&self) -> bool {
        !self.solver.dt.is_empty()
    }

    /// Whether some component on some surface has this condition.
    fn surfaces(&self, condition: ComponentCondition) -> bool {
        self.solver.spec.boundaries.iter().any(|boundary| boundary.condition.gives(condition))
    }

    /// Trials that need no fit.
    fn trials(&self) -> Vec<Trial> {
        let loaded = self.surfaces(ComponentCondition::PrescribedTraction);
        let admit = |cause: &&'static Cause| {
            if matches!(cause.counter, Counter::Unused(_)) {
                return false;
            }
            let is_timed = matches!(cause.counter, Counter::Time { .. } | Counter::Impulse { .. });
            if cause.name.starts_with("traction-") && !loaded {
                self.leave_out(cause, "the solution prescribes no traction");
                return false;
            }
            if is_timed && !self.knows_steps() {
                if matches!(cause.counter, Counter::Impulse { .. }) {
                    self.leave_out(
                        cause,
                        "the time step is not known; give it with --dt, or let the solver write it into the file {out}/dt",
                    );
                }
                return false;
            }
            true
        };
        let trial = |cause| Trial { cause, fitted: None };
        let blind = |trial: &Trial| {
            let shows = self.solver.shows(trial, self.cells[0]);
            if !shows {
                let why = match self.solver.spec.has_history() {
                    _ if trial.cause.is_of_memory() => "the material has no such memory",
                    true => {
                        "the fields follow from histories, in which it is not planted: an elastic solution shows it"
                    }
                    false => "with this solution it changes no field",
                };
                self.leave_out(trial.cause, why);
            }
            shows
        };
        CAUSES.iter().filter(admit).map(trial).filter(blind).collect()
    }

    fn run(&self, trial: Trial, cells: usize) -> Result<Option<Tried>> {
        if !self.solver.has_time() {
            self.leave_out(trial.cause, NO_TIME);
            return Ok(None);
        }
        let run = self.solver.errors(Some(&trial), cells)?;
        if let Some(failure) = &run.failure {
            self.leave_out(trial.cause, &format!("{NO_RESULT}: {failure}"));
            return Ok(None);
        }
        Ok(Some(Tried { trial, errors: BTreeMap::from([(cells, run.errors)]) }))
    }

    fn run_all(&self, trials: Vec<Trial>, cells: usize) -> Result<Vec<Tried>> {
        let tried: Result<Vec<Option<Tried>>> =
            trials.into_par_iter().map(|trial| self.run(trial, cells)).collect();
        Ok(tried?.into_iter().flatten().collect())
    }

    fn run_finer(&self, tried: &mut [Tried], cells: usize) -> Result<()> {
        tried.par_iter_mut().try_for_each(|one| {
            if self.solver.has_time() && !one.errors.contains_key(&cells) {
                let run = self.solver.errors(Some(&one.trial), cells)?;
                one.errors.insert(cells, run.errors);
            }
            Ok(())
        })
    }

    /// Whether the order is restored by a mistake that can be one of these errors: what vanishes with the cells, as a shift by a time step, leaves
    /// no error that stays. There it cancels a part of another error on one grid and none on the next. A mistake that leaves the errors as they
    /// are with the right fields is not made.
    pub(super) fn explains(&self, tried: &Tried) -> bool {
        let finest = tried.errors.keys().next_back();
        let with_right = self.right.lock().ok().and_then(|right| right.get(finest?).cloned());
        let whole = with_right.map_or(f64::INFINITY, |errors| self.expected.size(&errors));
        if self.expected.size(tried.finest()) > (1.0 - ALIKE) * whole {
            return false;
        }
        let vanishes =
            matches!(tried.trial.cause.counter, Counter::Time { .. } | Counter::Cell { .. });
        self.expected.is_met(&tried.errors, 0.0) && !(vanishes && self.order < VANISHING)
    }

    fn by_size(&self, one: &Tried, other: &Tried) -> Ordering {
        let [one, other] = [one, other].map(|tried| self.expected.size(tried.finest()));
        one.total_cmp(&other)
    }

    /// Runs those next to the order on one more grid.
    fn run_near(&self, tried: &mut [Tried]) -> Result<()> {
        let last = self.cells[self.cells.len() - 1];
        let mut near: Vec<&mut Tried> =
            tried.iter_mut().filter(|one| self.expected.is_met(&one.errors, NEAR)).collect();
        if near.is_empty() {
            return Ok(());
        }
        // The right fields as well: what the third grid mends was no mistake.
        let is_known = |right: &BTreeMap<usize, Errors>| right.contains_key(&(2 * last));
        if self.solver.has_time() && !self.right.lock().is_ok_and(|right| is_known(&right)) {
            let run = self.solver.errors(None, 2 * last)?;
            if let Ok(mut right) = self.right.lock() {
                right.insert(2 * last, run.errors);
            }
        }
        near.sort_by(|one, other| self.by_size(one, other));
        near.into_par_iter()
            .take(THIRD)
            .try_for_each(|one| self.run_finer(std::slice::from_mut(one), 2 * last))
    }

    /// The mistakes by what is left of the errors once they are countered, first those that restore the orders.
    pub(super) fn single(&self, right: &Run) -> Result<Vec<Tried>> {
        let coarse = self.cells[0];
        let mut trials = self.trials();
        if !self.knows_steps() && !self.solver.spec.has_history() {
            trials.extend(self.fitted(right)?);
        }
        if self.order > FIRST_ORDER {
            trials.sort_by_key(|trial| {
                matches!(trial.cause.counter, Counter::Fields(_) | Counter::Memory(_))
            });
        }
        let whole = self.expected.size(&right.errors);
        let mut tried: Vec<Tried> = vec![];
        while !trials.is_empty() {
            let rest = trials.split_off(BATCH.min(trials.len()));
            let mut batch = self.run_all(trials, coarse)?;
            trials = rest;
            batch.sort_by(|one, other| self.by_size(one, other));
            // An error that is left whole is left by a mistake that is not made.
            let is_less = |one: &Tried| self.expected.size(one.finest()) < whole;
            let second = SECOND.min(batch.iter().take_while(|one| is_less(one)).count());
            for &cells in &self.cells[1..] {
                self.run_finer(&mut batch[..second], cells)?;
            }
            // What restores the order on two grids may lose it on a third one.
            self.run_near(&mut batch)?;
            let is_found = batch.iter().any(|one| self.explains(one));
            tried.extend(batch);
            if is_found {
                for trial in &trials {
                    self.leave_out(
                        trial.cause,
                        "a mistake that is more likely explains the errors",
                    );
                }
                break;
            }
        }
        tried.sort_by_key(|one| (!self.explains(one), std::cmp::Reverse(one.errors.len())));
        let restoring = tried.iter().take_while(|one| self.explains(one)).count();
        tried[..restoring].sort_by(|one, other| {
            let finest = |tried: &Tried| tried.errors.keys().next_back().copied();
            let place = |tried: &Tried| {
                CAUSES.iter().position(|cause| cause.name == tried.trial.cause.name)
            };
            // Mistakes that are not told apart, in the order of the table.
            let size = |tried: &Tried| (self.expected.size(tried.finest()).ln() / ALIKE).round();
            finest(other)
                .cmp(&finest(one))
                .then_with(|| size(one).total_cmp(&size(other)))
                .then_with(|| place(one).cmp(&place(other)))
        });
        Ok(tried)
    }

    /// Shifts in time that leave the least of the error: the square of the error is of second degree in a small shift.
    fn fitted(&self, right: &Run) -> Result<Vec<Trial>> {
        let kinds = [
            Timed::Force,
            Timed::Inertia,
            Timed::Boundary,
            Timed::BoundaryVelocity,
            Timed::InitialVelocity,
            Timed::Traction,
            Timed::Everything,
        ];
        let loaded = self.surfaces(ComponentCondition::PrescribedTraction);
        let of = |kind: Timed, steps: f64| {
            CAUSES.iter().find(|cause| {
                matches!(cause.counter, Counter::Time { of, steps: own } if of == kind && own == steps)
            })
        };
        let finest = self.cells[self.cells.len() - 1];
        let fit = |kind: &Timed| -> Result<Option<Trial>> {
            if *kind == Timed::Traction && !loaded {
                return Ok(None);
            }
            let [Some(back), Some(forth)] = [of(*kind, -1.0), of(*kind, 1.0)] else {
                return Ok(None);
            };
            let Some(coarse) = self.least([back, forth], self.cells[0], right)? else {
                return Ok(None);
            };
            let again = self.solver.errors(None, finest)?;
            let fine = self.least([back, forth], finest, &again)?.unwrap_or(coarse);
            // The error of the method itself draws the fit away, by half as much on half the cells.
            let share = self.cells[0] as f64 / finest as f64;
            let dt_over_h = (fine - share * coarse) / (1.0 - share);
            let cause = if dt_over_h < 0.0 { back } else { forth };
            Ok(Some(Trial { cause, fitted: Some(dt_over_h.abs()) }))
        };
        let fitted: Result<Vec<Option<Trial>>> = kinds.par_iter().map(fit).collect();
        Ok(fitted?.into_iter().flatten().collect())
    }

    /// The shift over the length of a cell that leaves the least of the error on a grid.
    fn least(&self, causes: [&'static Cause; 2], cells: usize, right: &Run) -> Result<Option<f64>> {
        let first = FIRST_SHIFT / self.solver.wave_speed();
        let mut squares = [0.0; 2];
        for (square, cause) in squares.iter_mut().zip(causes) {
            let trial = Trial { cause, fitted: Some(first) };
            if !self.solver.has_time() || !self.solver.shows(&trial, cells) {
                return Ok(None);
            }
            *square = self.solver.errors(Some(&trial), cells)?.root_mean_square.powi(2);
        }
        let [before, after] = squares;
        let curvature = before - 2.0 * right.root_mean_square.powi(2) + after;
        let shift = first / 2.0 * (before - after) / curvature;
        Ok((curvature > 0.0 && shift.abs() > SMALLEST_SHIFT * first).then_some(shift))
    }

    /// Whether a program without the body force, as found, does without the state at the start too.
    pub(super) fn takes_no_field(&self, right: &Run, ignored: &[&'static Cause]) -> Result<bool> {
        let is = |of: Unused| move |cause: &&'static Cause| matches!(cause.counter, Counter::Unused(own) if own == of);
        if !ignored.iter().any(is(Unused::Force)) {
            return Ok(false);
        }
        let at_start = [Unused::InitialDisplacement, Unused::InitialVelocity];
        let unused = self.unused(right, |of| at_start.contains(&of))?;
        let is_at_rest = self.solver.spec.starts_undisplaced();
        Ok(unused.iter().any(is(Unused::InitialVelocity))
            && (is_at_rest || unused.iter().any(is(Unused::InitialDisplacement))))
    }

    /// The mistakes that leave a field without effect on the result, of those that are asked for.
    pub(super) fn unused(
        &self,
        right: &Run,
        asked: impl Fn(Unused) -> bool,
    ) -> Result<Vec<&'static Cause>> {
        let [loaded, moved] =
            [ComponentCondition::PrescribedTraction, ComponentCondition::PrescribedMotion]
                .map(|condition| self.surfaces(condition));
        let can_be = |cause: &&'static Cause| match cause.counter {
            Counter::Unused(unused) => {
                asked(unused)
                    && match unused {
                        // There is no later time.
                        Unused::ForceLater | Unused::TractionLater
                            if self.solver.spec.is_static() =>
                        {
                            false
                        }
                        // Nothing shows whether a displacement of nothing is used.
                        Unused::InitialDisplacement => !self.solver.spec.starts_undisplaced(),
                        Unused::Traction | Unused::TractionLater => loaded,
                        Unused::Boundary => moved,
                        _ => true,
                    }
            }
            _ => false,
        };
        let causes: Vec<&'static Cause> = CAUSES.iter().filter(can_be).collect();
        let is_unused = |cause: &&'static Cause| -> Result<Option<&'static Cause>> {
            let guess = 0.1 * FIRST_SHIFT / self.solver.wave_speed();
            let trial = Trial { cause, fitted: (!self.knows_steps()).then_some(guess) };
            if !self.solver.has_time() || !self.solver.shows(&trial, self.cells[0]) {
                return Ok(None);
            }
            let run = self.solver.errors(Some(&trial), self.cells[0])?;
            Ok(self.solver.is_same(&run, right, self.cells[0]).then_some(*cause))
        };
        let found: Result<Vec<Option<&'static Cause>>> = causes.par_iter().map(is_unused).collect();
        let found: Vec<&'static Cause> = found?.into_iter().flatten().collect();
        // What has no effect at all has none later either.
        let whole = |whole: Unused| {
            found.iter().any(|cause| matches!(cause.counter, Counter::Unused(own) if own == whole))
        };
        let [force, traction] = [Unused::Force, Unused::Traction].map(whole);
        let is_told = |cause: &&'static Cause| match cause.counter {
            Counter::Unused(Unused::ForceComponent | Unused::ForceLater) => !force,
            Counter::Unused(Unused::TractionLater) => !traction,
            _ => true,
        };
        Ok(found.iter().copied().filter(is_told).collect())
    }
}
