//! Decisions of a sweep: which run is worth its time, from what is known so far. Nothing is run here.

use super::{Against, LADDER, MARGIN, Setting, Skip};
use crate::cost::{Cost, CostModel};
use crate::on_grid::Plan;
use crate::scheme::{Scheme, Total, Updated};

/// Shares of the budget at which the sweep, the comparisons of single settings, the proofs on neighbouring grids and the repeats
/// for timing end.
pub(super) const PHASES: [f64; 4] = [0.58, 0.68, 0.92, 0.98];
/// The largest share of the budget that one run may take, so that its neighbours can be run as well; and one that settings
/// with other weights dominate.
pub(super) const LARGEST_RUN: f64 = 0.1;
pub(super) const LARGEST_DOMINATED: f64 = 0.03;
/// Predictions are held within 30 %.
pub(super) const UNCERTAINTY: f64 = 1.3;
/// Runs shorter than this are timed three times at once.
pub(super) const SHORT_S: f64 = 0.2;
/// The fewest timings of a short run.
pub(super) const TIMINGS: usize = 3;
/// Share of the budget that a comparison of single settings may take.
pub(super) const CHEAP: f64 = 0.004;

/// The error on `cells`, from errors on coarser grids by their observed order; `hint` is the order believed while there
/// are fewer than four of them, if the observed one is lower.
///
/// `None` without an error to start from.
#[must_use]
pub fn extrapolate(known: &[(usize, f64)], cells: usize, hint: f64) -> Option<f64> {
    let &(last, error) = known.last()?;
    let observed = match known {
        [.., (a, e), (b, f)] if a != b && *e > 0.0 && *f > 0.0 => {
            Some((e / f).ln() / (*b as f64 / *a as f64).ln())
        }
        _ => None,
    };
    let order = match observed {
        Some(order) if known.len() >= 4 => order,
        Some(order) => order.max(hint),
        None => hint,
    };
    Some(error * (last as f64 / cells as f64).powf(order.clamp(0.0, 12.0)))
}

/// The order that a scheme may have.
fn hint(setting: &Setting) -> f64 {
    setting.case.scheme.total().map_or(2.0, |total| total.degree as f64 + 1.0)
}

/// A scheme's weights, and where its particles lie in the updated frame: all else as usual.
pub(super) fn weights(scheme: &Scheme) -> Scheme {
    match *scheme {
        Scheme::Updated(Updated { shape, placement, .. }) => {
            Scheme::Updated(Updated { shape, placement, ..Updated::default() })
        }
        Scheme::Total(total) => Scheme::Total(Total::of_degree(total.degree)),
    }
}

/// A scheme with everything but its grid and its time step.
pub(super) struct Family {
    pub(super) setting: Setting,
    /// Plan of each rung of the ladder at the setting's own CFL number.
    pub(super) plans: Vec<Option<Plan>>,
    pub(super) cost: CostModel,
}

impl Family {
    pub(super) fn plan(&self, rung: usize, cfl: f64) -> Option<Plan> {
        let plan = self.plans.get(rung).copied()??;
        let steps = (plan.steps as f64 * self.setting.case.cfl / cfl).ceil() as u64;
        Some(Plan { steps, ..plan })
    }
}

/// A run at another CFL number that this one is held against.
#[derive(Clone, Copy)]
pub(super) struct Parent {
    error: f64,
    /// The ladder's CFL number over the parent's.
    factor: f64,
}

/// A family at one CFL number.
pub(super) struct Ladder {
    pub(super) family: usize,
    pub(super) cfl: f64,
    pub(super) next: usize,
    /// Cells and errors of the runs that ended well.
    known: Vec<(usize, f64)>,
    parent: Option<Parent>,
    /// How often the CFL number was halved since a run stopped.
    halvings: usize,
    pub(super) open: bool,
}

/// The next run of a ladder.
pub(super) struct Next {
    pub(super) rung: usize,
    pub(super) passed_over: usize,
    pub(super) expected: Option<Cost>,
}

impl Ladder {
    /// The first one of a family.
    pub(super) fn new(family: usize, cfl: f64) -> Self {
        let (known, parent) = (Vec::new(), None);
        Self { family, cfl, next: 0, known, parent, halvings: 0, open: true }
    }

    /// Goes on after a run on a rung with this error, none where the run stopped: the ladders at other CFL numbers that it makes
    /// worth trying, and why it ends, if it does.
    pub(super) fn climbed(&mut self, rung: usize, error: Option<f64>) -> (Vec<Self>, Option<Skip>) {
        let (family, cfl, halvings) = (self.family, self.cfl, self.halvings);
        let branch = |factor: f64, parent: Option<Parent>, halvings| Self {
            next: rung,
            parent,
            halvings,
            ..Self::new(family, factor * cfl)
        };
        let Some(error) = error else {
            self.open = false;
            let again = self.parent.is_none() && halvings < 2;
            let slower = again.then(|| branch(0.5, None, halvings + 1));
            return (slower.into_iter().collect(), Some(Skip::Stopped));
        };
        self.known.push((LADDER[rung], error));
        match (self.parent, self.known.len()) {
            (Some(Parent { error: before, factor }), 1) => {
                let worth = if factor < 1.0 { error < 0.8 * before } else { error < 1.5 * before };
                if worth {
                    return (vec![branch(factor, Some(Parent { error, factor }), halvings)], None);
                }
                self.open = false;
                (Vec::new(), Some(Skip::Cfl))
            }
            (None, 3) => {
                let at = |factor| branch(factor, Some(Parent { error, factor }), halvings);
                let faster = (halvings == 0).then(|| at(2.0));
                ([at(0.5)].into_iter().chain(faster).collect(), None)
            }
            _ => (Vec::new(), None),
        }
    }
}

/// Bounds of a sweep, and what it compares.
#[derive(Clone, Copy)]
pub(super) struct Policy {
    pub(super) budget_s: f64,
    pub(super) against: Against,
    pub(super) most_bytes: f64,
}

impl Policy {
    /// Seconds until a phase ends, when so many have passed.
    pub(super) fn left(&self, phase: usize, passed_s: f64) -> f64 {
        PHASES[phase] * self.budget_s - passed_s
    }

    fn expected_cost(&self, plan: &Plan, cost: &Cost, threads: usize) -> f64 {
        match self.against {
            Against::Wall => cost.steps_s,
            Against::Cpu => cost.steps_s * threads as f64,
            Against::Steps => plan.steps as f64,
            Against::Memory => plan.bytes,
        }
    }

    /// The next run of a ladder that may be worth it, or why there is none, with the number of grids that this is said of.
    pub(super) fn next(
        &self,
        (family, ladder): (&Family, &Ladder),
        own: &[(f64, f64)],
        all: &[(f64, f64)],
        left: f64,
    ) -> Result<Next, (Skip, usize)> {
        if let [.., (_, a), (_, b)] = ladder.known.as_slice()
            && ladder.known.len() >= 4
            && b / a > 0.95
        {
            return Err((Skip::NoGain, 1));
        }
        let mut passed_over = 0;
        for rung in ladder.next..LADDER.len() {
            let Some(plan) = family.plan(rung, ladder.cfl) else { continue };
            if plan.bytes > self.most_bytes {
                return Err((Skip::Memory, 1 + passed_over));
            }
            let Some(cost) = family.cost.predict(&plan) else {
                return match left > 0.0 {
                    true => Ok(Next { rung, passed_over, expected: None }),
                    false => Err((Skip::Budget, 1)),
                };
            };
            let most = left.min(LARGEST_RUN * self.budget_s);
            if UNCERTAINTY * cost.total_s > most {
                // If all that can be paid for is dominated, that is why the ladder ends.
                let reason = if passed_over > 0 { Skip::Dominated } else { Skip::Budget };
                return Err((reason, 1.max(passed_over)));
            }
            let error = match (ladder.known.is_empty(), ladder.parent) {
                (true, Some(parent)) => Some(parent.error * parent.factor.powi(2).min(1.0)),
                _ => extrapolate(&ladder.known, LADDER[rung], hint(&family.setting)),
            };
            let price = self.expected_cost(&plan, &cost, family.setting.threads);
            let is_below = |points: &[(f64, f64)]| {
                error.is_some_and(|error| {
                    points.iter().any(|&(known, least)| known <= price && MARGIN * least <= error)
                })
            };
            let is_dear = cost.total_s > LARGEST_DOMINATED * self.budget_s;
            let is_dominated = is_below(own) || is_dear && is_below(all);
            if !is_dominated {
                return Ok(Next { rung, passed_over, expected: Some(cost) });
            }
            passed_over += 1;
        }
        Err((Skip::Dominated, passed_over))
    }
}
