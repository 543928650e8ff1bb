//! Verdict on a series of errors: its order on the finest grids, from where on that order holds, and whether it is
//! the expected one.

use mmsmith_galerkin::{Layout, MassMatrix};
use mmsmith_laws::ReturnMap;
use mmsmith_measure::norms::{PerField, PerNorm};
use mmsmith_mpm::{Integrator, Shape, Transfer};
use mmsmith_runtime::{AnySolution, Domain, Solution};
use serde::Serialize;

use crate::case::Case;
use crate::dimension::in_dimension;
use crate::flow::has_memory;
use crate::points;
use crate::scheme::{Placement, Scheme, Total, Updated};

/// How far an order on the finest pair of cases may be from the expected one where nothing else is said.
pub const ORDER_TOLERANCE: f64 = 0.1;

/// Points at which a motion is looked at to find out whether its axes stay aligned with the grid.
const SAMPLES: usize = 64;

/// Orders that theory promises, field by field and norm by norm; `None` where it promises nothing.
pub type Expected = PerField<PerNorm<Option<f64>>>;

/// Behaviour of the errors as the step becomes smaller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Behaviour {
    /// At least two successive pairs, the finest among them, have the same positive order within the tolerance.
    Asymptotic,
    /// The error falls, but its local orders still change by more than the tolerance, or there is one pair only.
    NotSettled,
    /// The error does not fall over the finest pair: its order there is not above the tolerance.
    DoesNotConverge,
    /// The finest case did not reach its end.
    Stopped,
    /// The finest case reached its end with errors that say nothing.
    NotJudged,
    /// The grids are too coarse to tell: see [`Verdict::sparing_coarse_grids`].
    TooCoarse,
    /// Errors are so small that rounding may have caused them, but for fewer than two cases.
    AtRounding,
    /// Fewer than two cases with an error and different steps.
    NoOrder,
}

/// Verdict on one error norm.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// The order that was expected, if any.
    pub expected: Option<f64>,
    /// How far from it the order on the finest pair may be.
    pub tolerance: f64,
    /// The order on the finest pair of cases.
    pub finest: Option<f64>,
    /// Behaviour of the errors.
    pub behaviour: Behaviour,
    /// The rows inside the asymptotic range, numbered from 0, in the order of the rows; empty where there is none.
    pub asymptotic_rows: Vec<usize>,
    /// The rows whose error is so small that rounding may have caused it, numbered from 0; they are left out of all judgement.
    pub rounding_rows: Vec<usize>,
    /// `C` of the leading term `C s^p` in the step `s`, from the finest case.
    pub coefficient: Option<f64>,
    /// The `p` of that term: the expected order if it was met, else that of the finest pair.
    pub exponent: Option<f64>,
    /// Whether the expectation was met; `None` where there is none.
    pub passed: Option<bool>,
    /// Successive pairs of cases.
    #[serde(skip)]
    pub pairs: usize,
}

impl Verdict {
    /// Judges errors (`None` where a case failed, not a number where it has none to judge) over `steps`, in any order.
    #[must_use]
    pub fn of(
        steps: &[f64],
        errors: &[Option<f64>],
        expected: Option<f64>,
        tolerance: f64,
    ) -> Self {
        Self::above(steps, errors, &[], expected, tolerance)
    }

    /// Judges errors as [`of`](Self::of), where those below `floors`, row by row, may be rounding and judge nothing.
    #[must_use]
    pub fn above(
        steps: &[f64],
        errors: &[Option<f64>],
        floors: &[f64],
        expected: Option<f64>,
        tolerance: f64,
    ) -> Self {
        let is_rounding = |row: usize| {
            let floor = floors.get(row).copied().unwrap_or(0.0);
            errors.get(row).copied().flatten().is_some_and(|error| error < floor)
        };
        let all = 0..steps.len().min(errors.len());
        let (rounding_rows, mut rows): (Vec<usize>, Vec<usize>) =
            all.partition(|row| is_rounding(*row));
        rows.sort_by(|&a, &b| steps[b].total_cmp(&steps[a]));
        rows.dedup_by(|a, b| steps[*a] == steps[*b]);
        let log = |row: usize| errors[row].filter(|e| e.is_finite() && *e > 0.0).map(f64::ln);
        let local = |pair: &[usize]| {
            let (coarse, fine) = (log(pair[0])?, log(pair[1])?);
            Some((fine - coarse) / (steps[pair[1]] / steps[pair[0]]).ln())
        };
        let orders: Vec<Option<f64>> = rows.windows(2).map(local).collect();
        let finest = orders.last().copied().flatten();
        // From the finest pair on for as long as the order stays the same.
        let settled = finest.map_or(0, |finest| {
            let same =
                |order: &&Option<f64>| order.is_some_and(|o| (o - finest).abs() <= tolerance);
            orders.iter().rev().take_while(same).count()
        });
        // Rounding grows with the steps and with finer grids, beyond what floors count of it.
        let is_near_rounding = |row: &usize| {
            let floor = floors.get(*row).copied().unwrap_or(0.0);
            errors[*row].is_some_and(|error| error < GROWN_ROUNDING * floor)
        };
        let grows = |order: f64| order <= tolerance && rows.last().is_some_and(is_near_rounding);
        let has_grown = finest.is_some_and(grows);
        let finest = finest.filter(|_| !has_grown);
        let last = rows.last().map(|&row| errors[row]);
        let behaviour = match finest {
            _ if rows.len() < 2 && !rounding_rows.is_empty() => Behaviour::AtRounding,
            _ if has_grown => Behaviour::AtRounding,
            _ if rows.len() < 2 => Behaviour::NoOrder,
            _ if last == Some(None) => Behaviour::Stopped,
            _ if last.flatten().is_some_and(|error| !error.is_finite()) => Behaviour::NotJudged,
            None => Behaviour::NoOrder,
            Some(order) if order <= tolerance => Behaviour::DoesNotConverge,
            Some(_) if settled >= 2 => Behaviour::Asymptotic,
            Some(_) => Behaviour::NotSettled,
        };
        let mut asymptotic_rows = match behaviour {
            Behaviour::Asymptotic => rows[rows.len() - settled - 1..].to_vec(),
            _ => Vec::new(),
        };
        asymptotic_rows.sort_unstable();
        // An order beyond the expected one is no fault of a scheme. Room for the rounding of a tolerance such as 0.1 itself.
        let met = |(order, expected): (f64, f64)| order >= expected - tolerance - 1e-12;
        let passed = expected.map(|expected| finest.is_some_and(|order| met((order, expected))));
        let is_near = |(order, expected): (f64, f64)| (order - expected).abs() <= tolerance + 1e-12;
        let exponent = if finest.zip(expected).is_some_and(is_near) { expected } else { finest };
        let last = rows.last().copied().filter(|_| exponent.is_some());
        let coefficient = last
            .and_then(|row| Some(errors[row]? / steps[row].powf(exponent?)))
            .filter(|value| value.is_finite());
        Self {
            expected,
            tolerance,
            finest,
            behaviour,
            asymptotic_rows,
            rounding_rows,
            coefficient,
            exponent,
            passed,
            pairs: orders.len(),
        }
    }
}

/// An error that does not fall, and is smaller than so many floors of rounding, is rounding.
const GROWN_ROUNDING: f64 = 64.0;

/// Cells of the coarsest grid from which on a series is expected to show the order of a scheme.
const FEWEST_CELLS: usize = 8;
/// The share of an expected order that coarse grids may hide. Faults cost half an order or more: an eighth is less, up to order 4,
/// and from there on less than the whole order that a wrong degree costs.
const HIDDEN: f64 = 0.125;

impl Verdict {
    /// This verdict, but open where an expectation that nobody has stated cannot be judged: of errors at rounding, and of an order that has
    /// not settled and is better than theory promises, which is no failure and no proof, or that a single pair of cases shows, short of the
    /// expected one by no more than an eighth of it; with the cells of the coarsest grid also as [`sparing_coarse_grids`](Self::sparing_coarse_grids) has it.
    #[must_use]
    pub fn of_theory_alone(self, coarsest: Option<usize>) -> Self {
        let above = self.finest.zip(self.expected).map(|(order, expected)| order - expected);
        let is_short = self.pairs < 2 && self.passed == Some(false) && self.is_almost_met();
        let is_unjudged = match self.behaviour {
            Behaviour::NoOrder | Behaviour::AtRounding => true,
            Behaviour::NotSettled => is_short || above.is_some_and(|above| above > self.tolerance),
            _ => false,
        };
        match coarsest {
            _ if is_unjudged => Self { passed: None, ..self },
            Some(cells) => self.sparing_coarse_grids(cells),
            None => self,
        }
    }

    /// This verdict, but without a failure where the coarsest grid has fewer than eight cells and the order is short of the expected
    /// one by no more than an eighth of it: such grids may lie before the asymptotic range.
    #[must_use]
    pub fn sparing_coarse_grids(self, coarsest: usize) -> Self {
        let is_spared = coarsest < FEWEST_CELLS
            && self.passed == Some(false)
            && matches!(self.behaviour, Behaviour::Asymptotic | Behaviour::NotSettled)
            && self.is_almost_met();
        if is_spared {
            return Self { behaviour: Behaviour::TooCoarse, passed: None, ..self };
        }
        self
    }

    /// Whether the order is short of the expected one by no more than an eighth of it.
    fn is_almost_met(&self) -> bool {
        let both = self.finest.zip(self.expected);
        both.is_some_and(|(order, expected)| order >= expected * (1.0 - HIDDEN))
    }
}

/// Errors over the steps of a series, to be judged.
#[derive(Clone, Copy, Debug)]
pub struct Values<'a> {
    /// The steps.
    pub steps: &'a [f64],
    /// The errors; `None` where a case failed, not numbers where it has none to judge.
    pub errors: &'a [Option<&'a PerField<PerNorm<f64>>>],
    /// Errors that rounding alone may cause, row by row ([`floors`](crate::Discretized::floors)); empty where rounding does not count.
    pub floors: &'a [PerField<f64>],
}

/// Judges every field and norm; `values` are `None` where a case failed.
#[must_use]
pub fn verdicts(
    steps: &[f64],
    values: &[Option<&PerField<PerNorm<f64>>>],
    expected: &Expected,
    tolerance: f64,
) -> PerField<PerNorm<Verdict>> {
    verdicts_above(&Values { steps, errors: values, floors: &[] }, expected, tolerance)
}

/// Judges every field and norm by the errors that are above those that rounding alone may cause.
#[must_use]
pub fn verdicts_above(
    values: &Values<'_>,
    expected: &Expected,
    tolerance: f64,
) -> PerField<PerNorm<Verdict>> {
    crate::order::each_norm(values.errors, |field, norm, errors| {
        let expected = expected[field][norm];
        let floors: Vec<f64> = values
            .floors
            .iter()
            .map(|floor| floor[field] * crate::order::above_mean(norm))
            .collect();
        Verdict::above(values.steps, errors, &floors, expected, tolerance)
    })
}

/// The orders in `h` at a fixed CFL number that theory promises for `case`: second order in the displacement for
/// centred differences with weights that integrate over contiguous domains of particles, where these meet the boundary
/// exactly. With GIMP, CPDI and CPDI2 that is a box whose motion has a diagonal deformation gradient, so that the
/// particles' edges stay aligned with the grid; with CPDI2 it is a ring too, if its layout is fitted to it. In the total frame
/// splines of degree `p` with their consistent mass have order `p + 1` in the mean of squares where the integration in time
/// is of no lower order, and the particles are Gauss points or `p` is odd: sums over a lattice leave even degrees one order
/// less. Largest errors may have a layer beside loaded sides. Nothing else is promised; nothing of laws with memory either, whose updates
/// have errors in time of their own.
///
/// Wallstedt and Guilkey, Evaluation of Time Integration Schemes for the Generalized Interpolation Material Point
/// Method; Sadeghirad, Brannon and Guilkey, Second-order convected particle domain interpolation.
#[must_use]
pub fn expected_in_space(exact: &AnySolution<f64>, case: &Case) -> Expected {
    if has_memory(exact) {
        return Expected::default();
    }
    let u = match case.scheme {
        Scheme::Updated(Updated {
            shape,
            integrator: Integrator::Cd,
            transfer: Transfer::Flip,
            placement,
            ..
        }) => {
            let contiguous = match (placement, shape) {
                (
                    Placement::Lattice { .. },
                    Shape::Gimp | Shape::GimpBspline2 | Shape::Cpdi | Shape::Cpdi2,
                ) => in_dimension!(exact, |s| stays_aligned(s), else false),
                (Placement::BodyFitted | Placement::Clipped { .. }, Shape::Cpdi2) => true,
                _ => false,
            };
            let order = contiguous.then_some(2.0);
            // Where the boundary is loaded, or cuts cells, the largest error has a logarithm: h^2 |ln h|, as of linear elements.
            let is_cut = matches!(placement, Placement::Clipped { .. });
            PerNorm { linf: order.filter(|_| !is_cut), l2: order, l1: order }
        }
        Scheme::Total(Total {
            degree, mass: MassMatrix::Consistent, composition, layout, ..
        }) => {
            let [space, time] = [degree + 1, composition.order()];
            let exact = layout == Layout::Gauss || degree % 2 == 1;
            let mean = (space <= time && exact).then_some(space as f64);
            PerNorm { l2: mean, ..PerNorm::default() }
        }
        Scheme::Updated(_) | Scheme::Total(_) => PerNorm::default(),
    };
    PerField { u, ..Expected::default() }
}

/// The orders in `dt` of the differences on one grid ([`differences`](crate::Discretized::differences)) that theory promises for the
/// displacement: 1 for the integrators that move particles with the velocity of one end of the step.
///
/// Nothing is promised for centred differences. They are formally of second order, but the measured order falls towards
/// 1 where `dt` is small against `h^2`. A likely reason: particles are moved with the nodal acceleration as it is, while
/// their velocities keep what its interpolation and projection with lumped masses leave of it, which would add a term in
/// `dt h^2`.
#[must_use]
pub fn expected_in_time(exact: &AnySolution<f64>, case: &Case) -> Expected {
    let order = match case.scheme {
        // The law's own update, beside leapfrog steps of order 2.
        Scheme::Total(_) if has_memory(exact) => Some(match case.return_map {
            Some(ReturnMap::Exponential) => 1.0,
            Some(ReturnMap::Midpoint) | None => 2.0,
        }),
        // Weights that stay let the composition of leapfrog show its order.
        Scheme::Total(total) => Some(total.composition.order() as f64),
        // The other transfers lose a part of the velocities in every step, however short.
        Scheme::Updated(Updated {
            integrator: Integrator::Usf | Integrator::Usl | Integrator::Musl | Integrator::Usavg,
            transfer: Transfer::Flip,
            ..
        }) => Some(1.0),
        Scheme::Updated(_) => None,
    };
    PerField { u: PerNorm { linf: order, l2: order, l1: order }, ..Expected::default() }
}

fn stays_aligned<const D: usize>(exact: &dyn Solution<f64, D>) -> bool {
    let domain = exact.domain();
    matches!(domain, Domain::Box { .. })
        && (0..SAMPLES).all(|n| {
            points::interior(&domain, exact.period(), n).is_some_and(|(X, t)| {
                let F = exact.deformation_gradient(&X, t);
                (0..D).all(|i| (0..D).all(|j| i == j || F[(i, j)] == 0.0))
            })
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judge(errors: &[f64], expected: Option<f64>) -> Verdict {
        let steps: Vec<f64> = (0..errors.len()).map(|k| 0.5_f64.powi(k as i32)).collect();
        let errors: Vec<_> = errors.iter().map(|e| e.is_finite().then_some(*e)).collect();
        Verdict::of(&steps, &errors, expected, 0.1)
    }

    #[test]
    fn the_asymptotic_range_starts_where_the_orders_have_settled() {
        // Orders 1, 2, 2, 2.
        let verdict = judge(&[8.0, 4.0, 1.0, 0.25, 0.0625], Some(2.0));
        assert_eq!(verdict.behaviour, Behaviour::Asymptotic);
        assert_eq!(verdict.asymptotic_rows, [1, 2, 3, 4]);
        assert_eq!((verdict.finest, verdict.passed), (Some(2.0), Some(true)));
        // 4 at h = 1/2.
        assert_eq!((verdict.coefficient, verdict.exponent), (Some(16.0), Some(2.0)));
    }

    #[test]
    fn rows_may_come_in_any_order_and_are_told_by_their_own_numbers() {
        let steps = [0.25, 1.0, 0.5];
        let verdict = Verdict::of(&steps, &[Some(0.0625), Some(1.0), Some(0.25)], None, 0.1);
        assert_eq!(verdict.asymptotic_rows, [0, 1, 2]);
        assert_eq!((verdict.finest, verdict.passed), (Some(2.0), None));
    }

    #[test]
    fn an_order_that_is_too_low_fails_and_one_beyond_the_expected_passes_as_it_is() {
        assert_eq!(judge(&[4.0, 2.0, 1.0], Some(2.0)).passed, Some(false));
        assert_eq!(judge(&[4.0, 2.0, 1.0], None).passed, None);
        let verdict = judge(&[64.0, 8.0, 1.0], Some(2.0));
        assert_eq!((verdict.passed, verdict.exponent), (Some(true), Some(3.0)));
    }

    #[test]
    fn coarse_grids_spare_what_is_almost_the_order_and_nothing_else() {
        let errors = |order: f64| [1.0, 0.5_f64.powf(order), 0.25_f64.powf(order)];
        for (order, expected, coarsest, passed) in [
            (3.83, 4.0, 4, None),
            (3.6, 4.0, 7, None),
            // Half an order is a fault, and so is a little less than that on finer grids.
            (3.4, 4.0, 4, Some(false)),
            (3.83, 4.0, 8, Some(false)),
            (1.8, 2.0, 4, None),
            (1.5, 2.0, 4, Some(false)),
            (5.0, 6.0, 4, Some(false)),
            (3.95, 4.0, 4, Some(true)),
            (5.0, 4.0, 4, Some(true)),
            (-1.0, 4.0, 4, Some(false)),
        ] {
            let verdict = judge(&errors(order), Some(expected)).sparing_coarse_grids(coarsest);
            assert_eq!(verdict.passed, passed, "{order} for {expected} from {coarsest} cells on");
            assert_eq!(verdict.behaviour == Behaviour::TooCoarse, passed.is_none());
        }
    }

    #[test]
    fn a_single_pair_of_grids_proves_no_small_shortfall() {
        for (order, passed) in [(3.77, None), (3.95, Some(true)), (3.4, Some(false)), (4.3, None)] {
            let errors = [1.0, 0.5_f64.powf(order)];
            let pair: Vec<_> = errors.into_iter().map(Some).collect();
            let verdict = Verdict::of(&[1.0, 0.5], &pair, Some(4.0), 0.1);
            assert_eq!(verdict.of_theory_alone(Some(8)).passed, passed, "{order}");
            let third = judge(&[1.0, errors[1], errors[1] * errors[1]], Some(4.0));
            let of_three = if order == 3.77 { Some(false) } else { third.passed };
            assert_eq!(third.of_theory_alone(Some(8)).passed, of_three, "{order}");
        }
    }

    #[test]
    fn a_plateau_and_a_growing_error_are_called_so() {
        for errors in [[4.0, 1.0, 0.98], [1.0, 1.0, 1.0], [1.0, 2.0, 4.0]] {
            let verdict = judge(&errors, Some(2.0));
            assert_eq!(verdict.behaviour, Behaviour::DoesNotConverge);
            assert_eq!(verdict.passed, Some(false));
            assert!(verdict.asymptotic_rows.is_empty());
        }
    }

    #[test]
    fn a_stopped_finest_case_fails_whatever_the_others_say() {
        let verdict = judge(&[4.0, 1.0, f64::NAN], Some(2.0));
        assert_eq!((verdict.behaviour, verdict.passed), (Behaviour::Stopped, Some(false)));
        assert_eq!(verdict.coefficient, None);
    }

    #[test]
    fn one_pair_is_no_range_and_one_case_is_no_order() {
        assert_eq!(judge(&[4.0, 1.0], None).behaviour, Behaviour::NotSettled);
        assert_eq!(judge(&[4.0], Some(2.0)).behaviour, Behaviour::NoOrder);
        assert_eq!(judge(&[4.0], Some(2.0)).passed, Some(false));
        assert_eq!(judge(&[], None).behaviour, Behaviour::NoOrder);
    }

    #[test]
    fn rows_at_rounding_judge_nothing() {
        let steps = [1.0, 0.5, 0.25, 0.125];
        let judge = |errors: [f64; 4], expected| {
            Verdict::above(&steps, &errors.map(Some), &[1e-3; 4], expected, 0.1)
        };
        // A little above the floor and growing: rounding, and no judgement.
        let grown = judge([2e-4, 4e-3, 8e-3, 2e-2], None);
        assert_eq!((grown.behaviour, grown.finest), (Behaviour::AtRounding, None));
        // Far above it an error that grows is one, and so is one that stays.
        for errors in [[2e-4, 0.1, 0.2, 0.4], [0.4, 0.4, 0.4, 0.4]] {
            assert_eq!(judge(errors, None).behaviour, Behaviour::DoesNotConverge);
        }
        // The order of the two rows above, whatever the others do.
        let verdict = judge([1.0, 0.25, 2e-4, 9e-4], Some(2.0));
        assert_eq!((verdict.finest, verdict.passed), (Some(2.0), Some(true)));
        assert_eq!(verdict.rounding_rows, [2, 3]);
        assert_eq!(verdict.behaviour, Behaviour::NotSettled);
        // Nothing can judge the expectation, so that it is not met.
        let verdict = judge([8e-4, 4e-4, 2e-4, 1e-4], Some(1.0));
        assert_eq!((verdict.behaviour, verdict.passed), (Behaviour::AtRounding, Some(false)));
        assert_eq!((verdict.finest, verdict.coefficient), (None, None));
        let verdict = judge([1.0, 4e-4, 2e-4, 0.0], None);
        assert_eq!((verdict.behaviour, verdict.passed), (Behaviour::AtRounding, None));
    }

    #[test]
    fn a_finest_case_without_a_number_did_not_stop() {
        let verdict = Verdict::of(&[1.0, 0.5], &[Some(1.0), Some(f64::NAN)], Some(2.0), 0.1);
        assert_eq!((verdict.behaviour, verdict.passed), (Behaviour::NotJudged, Some(false)));
    }

    #[test]
    fn errors_of_zero_have_no_order() {
        assert_eq!(judge(&[0.0, 0.0, 0.0], None).behaviour, Behaviour::NoOrder);
    }
}
