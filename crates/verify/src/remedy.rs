//! Settings that run where others stop: tried, not guessed.

use mmsmith_mpm::{Shape, Transfer};
use mmsmith_runtime::{AnySolution, Domain};

use crate::case::{Arithmetic, Case};
use crate::discretized::Discretized;
use crate::distortion::distortion;
use crate::error::CaseError;
use crate::run::{Outputs, Status};
use crate::scheme::{GridPose, Placement, Scheme, Total, Updated};
use crate::usual_step::{stable_cfl, stiffest, usual_step};

/// Particles times steps of one attempt, at most.
const MOST_WORK: f64 = 6e6;

/// A case that was tried.
#[derive(Clone, Debug, PartialEq)]
pub struct Attempt {
    /// The case.
    pub case: Case,
    /// How it ended.
    pub status: Status,
    /// The largest error of `u` until then, a length.
    pub error: f64,
}

/// Attempts to run a solution whose case stopped.
#[derive(Clone, Debug, PartialEq)]
pub struct Remedy {
    /// The number of cells that they were made on: that of the case, or fewer where that is much work.
    pub cells: usize,
    /// The attempts, in order; no more are made once one has run.
    pub attempts: Vec<Attempt>,
}

impl Remedy {
    /// The attempt that ran, if one did.
    #[must_use]
    pub fn found(&self) -> Option<&Attempt> {
        self.attempts.last().filter(|attempt| attempt.status == Status::Ok)
    }
}

/// Tries other settings for a case that stopped, or whose errors exceed the motion, one after the other until one runs: a shorter step,
/// another transfer, other weights, layouts that follow the body, and the total Lagrangian formulation; last a quarter of the step where it
/// was short already. On fewer cells the settings of
/// the case itself come first.
///
/// The attempts depend on the case alone, and their work is bounded.
///
/// # Errors
///
/// [`CaseError::Interrupted`]; settings that cannot be run are left out.
pub fn remedy(
    exact: &AnySolution<f64>,
    arithmetic: Arithmetic<'_>,
    stopped: &Case,
) -> Result<Remedy, CaseError> {
    let cells = affordable(exact, arithmetic, stopped);
    let itself = (cells != stopped.cells).then_some(*stopped);
    let mut remedy = Remedy { cells, attempts: Vec::new() };
    for case in itself.into_iter().chain(candidates(exact, stopped)) {
        let case = Case { cells, ..case };
        let is_known = case == *stopped || remedy.attempts.iter().any(|own| own.case == case);
        if is_known {
            continue;
        }
        // A shorter step than that of the case that stopped may take more than it.
        let is_cheap = |case: &Discretized<'_>| case.plan().work() <= 8.0 * MOST_WORK;
        let prepared = Discretized::new(exact, arithmetic, &case).ok();
        let Some(prepared) = prepared.filter(is_cheap) else { continue };
        let mut quiet = |_| {};
        let row = match prepared.run(&mut Outputs::new(&mut quiet)) {
            Ok(row) => row,
            Err(interrupted @ CaseError::Interrupted { .. }) => return Err(interrupted),
            Err(_) => continue,
        };
        remedy.attempts.push(Attempt { case, status: row.status, error: row.errors.u.linf });
        if remedy.found().is_some() {
            break;
        }
    }
    Ok(remedy)
}

/// The largest number of cells, at most that of the case, on which it is little work.
fn affordable(exact: &AnySolution<f64>, arithmetic: Arithmetic<'_>, case: &Case) -> usize {
    let mut cells = case.cells;
    loop {
        let work = Discretized::new(exact, arithmetic, &Case { cells, ..*case })
            .map(|case| case.plan().work());
        match work {
            Ok(work) if work > MOST_WORK && cells > 4 => cells = (cells / 2).max(4),
            // A count that fits the body, below one that does not.
            Err(_) if cells > 1 => cells -= 1,
            _ => return cells,
        }
    }
}

/// The settings to try, in order.
fn candidates(exact: &AnySolution<f64>, stopped: &Case) -> Vec<Case> {
    let mut all = Vec::new();
    let shortened = with_stable_step(exact, *stopped);
    all.extend(shortened);
    let (base, updated) = match &stopped.scheme {
        Scheme::Updated(updated) => (shortened.unwrap_or(*stopped), *updated),
        Scheme::Total(_) => {
            let updated = Updated::default();
            let usual = Case { scheme: Scheme::Updated(updated), per_cell: 2, ..*stopped };
            let base = with_usual_step(exact, usual).unwrap_or(usual);
            all.push(base);
            (base, updated)
        }
    };
    let scheme = |updated: Updated| Case { scheme: Scheme::Updated(updated), ..base };
    all.extend(updated_candidates(exact, &updated).into_iter().map(scheme));
    all.extend(sheared_candidate(exact, base));
    all.extend(smooth_candidate(exact, &updated).map(scheme));
    all.extend(total_candidate(exact, stopped));
    if shortened.is_none() {
        // Says whether the step has anything to do with it.
        all.push(Case { cfl: 0.25 * stopped.cfl, ..*stopped });
    }
    all
}

/// Schemes of the updated formulation, from those that change little.
fn updated_candidates(exact: &AnySolution<f64>, own: &Updated) -> Vec<Updated> {
    let apic = Transfer::Apic;
    let lattice = Placement::Lattice { offset: 0.0 };
    let clipped = Placement::Clipped { offset: 0.0, pose: GridPose::default() };
    let cpdi2 = |placement, transfer| Updated { shape: Shape::Cpdi2, placement, transfer, ..*own };
    let mut all = vec![Updated { transfer: apic, ..*own }];
    if matches!(own.placement, Placement::Lattice { .. }) {
        all.extend([cpdi2(lattice, own.transfer), cpdi2(lattice, apic)]);
    }
    if matches!(exact, AnySolution::Two(s) if matches!(s.domain(), Domain::Annulus { .. })) {
        all.push(cpdi2(Placement::BodyFitted, apic));
    }
    if !matches!(exact, AnySolution::One(_)) {
        all.push(cpdi2(clipped, apic));
    }
    all
}

/// Splines at the corners of polygons, and a transfer that filters short waves.
fn smooth_candidate(exact: &AnySolution<f64>, own: &Updated) -> Option<Updated> {
    let (shape, transfer) = (Shape::Bspline2, Transfer::Xpic(2));
    let placement = Placement::Clipped { offset: 0.0, pose: GridPose::default() };
    (!matches!(exact, AnySolution::One(_))).then_some(Updated {
        shape,
        transfer,
        placement,
        ..*own
    })
}

/// The shear from which on a motion draws particles between corners out over the grid.
const STRONG_SHEAR: f64 = 1.5;
/// Over how many cells particles between corners may be drawn out: longer ones do not see what the velocity does between their ends.
const LONGEST: f64 = 1.8;
/// The share of the usual step that suits thin particles.
const THIN: f64 = 0.6;

/// Short particles, smooth functions at their corners and a short step, for a motion that shears strongly.
fn sheared_candidate(exact: &AnySolution<f64>, base: Case) -> Option<Case> {
    let shear = distortion(exact)?.shear;
    if shear < STRONG_SHEAR || matches!(exact, AnySolution::One(_)) {
        return None;
    }
    let scheme = Scheme::Updated(Updated {
        shape: Shape::Bspline2,
        transfer: Transfer::Apic,
        placement: Placement::Clipped { offset: 0.0, pose: GridPose::default() },
        ..Updated::default()
    });
    let per_cell = base.per_cell.max((shear / LONGEST).ceil() as usize);
    Some(Case { scheme, per_cell, cfl: THIN * base.cfl, ..base })
}

/// The total formulation with cubic splines, as it is chosen for a solution.
fn total_candidate(exact: &AnySolution<f64>, stopped: &Case) -> Option<Case> {
    let layout = Total::layout_for(exact);
    let coordinates = Total::coordinates_for(exact);
    let total = Total { layout, coordinates, ..Total::of_degree(3) };
    let per_cell = match layout {
        mmsmith_galerkin::Layout::Gauss => total.degree + 1,
        mmsmith_galerkin::Layout::Lattice => 2,
    };
    let cfl_speed = stiffest(exact).ok()?;
    let cfl = total.usual_cfl(exact, cfl_speed).ok()?;
    Some(Case { scheme: Scheme::Total(total), per_cell, cfl, cfl_speed, ..*stopped })
}

/// The case with the step that a run has which is given none.
fn with_usual_step(exact: &AnySolution<f64>, case: Case) -> Option<Case> {
    let usual = usual_step(exact, &case.scheme, case.periods, None).ok()?;
    Some(Case { cfl: usual.cfl, cfl_speed: usual.speed, ..case })
}

/// The case with a step that the fastest waves of the motion allow, where its own is longer.
fn with_stable_step(exact: &AnySolution<f64>, case: Case) -> Option<Case> {
    let stable = |speed| stable_cfl(exact, &case.scheme, case.periods, speed).ok();
    let is_long = case.cfl > 1.01 * stable(case.cfl_speed)?;
    let cfl_speed = stiffest(exact).ok()?;
    let cfl = stable(cfl_speed)?;
    is_long.then_some(Case { cfl, cfl_speed, ..case })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn particles_are_short_and_steps_too_where_a_motion_shears_strongly() {
        let build = |name| mmsmith_solutions::build::<f64>(name, &[]).unwrap().unwrap();
        let base = Case::default();
        let found = sheared_candidate(&build("vortex"), base).unwrap();
        assert_eq!((found.per_cell, found.cfl), (4, THIN * base.cfl));
        let updated = found.scheme.updated().unwrap();
        assert_eq!((updated.shape, updated.transfer), (Shape::Bspline2, Transfer::Apic));
        assert!(updated.placement.is_clipped());
        // More than that stays.
        let many = Case { per_cell: 6, ..base };
        assert_eq!(sheared_candidate(&build("vortex"), many).map(|case| case.per_cell), Some(6));
        assert_eq!(sheared_candidate(&build("ring"), base), None);
    }
}
