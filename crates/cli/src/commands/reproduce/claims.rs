//! Claims of the original study, held against what was measured.

use super::{
    CELLS, CFLS, Differences, GENTLE, GENTLE_CFLS, GENTLE_GRID, GENTLE_RANGE, GRID, Results,
    SMALL_STEP, Series, name,
};
use crate::table::Table;

/// A claim, what was measured, and whether that bears it out.
pub(super) struct Claim {
    /// The study's words, or close to them.
    pub(super) text: &'static str,
    /// The criterion for a confirmed claim.
    pub(super) criterion: &'static str,
    /// Conditions that the verdict depends on.
    pub(super) depends: &'static str,
    /// The numbers.
    pub(super) measured: String,
    pub(super) confirmed: bool,
}

impl Claim {
    pub(super) fn verdict(&self) -> &'static str {
        if self.confirmed { "confirmed" } else { "NOT CONFIRMED" }
    }
}

/// Judges every claim by the studies of both problems.
pub(super) fn judge(axis_aligned: &Results, ring: &Results, gentle: &[Differences]) -> Vec<Claim> {
    vec![
        second_order(axis_aligned),
        shortcut(axis_aligned),
        usl_in_space(axis_aligned),
        ugimp(axis_aligned),
        poor(axis_aligned),
        no_temporal_order(axis_aligned),
        usl_in_time(axis_aligned),
        formal_order(gentle),
        usl_formal_order(axis_aligned, gentle),
        sum_of_two(axis_aligned),
        ring_order(ring),
        ring_ugimp(ring),
        ring_ugimp_in_time(ring),
        best(axis_aligned, ring),
    ]
}

/// The claims for the terminal, and as a section of the report.
pub(super) fn texts(claims: &[Claim]) -> (String, String) {
    let (mut brief, mut full) = (
        Table::new(3, ["verdict", "claim", "measured"]),
        Table::new(5, ["verdict", "claim", "measured", "confirmed if", "depends on"]),
    );
    for claim in claims {
        let verdict = claim.verdict();
        brief.row([verdict, claim.text, &claim.measured]);
        full.row([verdict, claim.text, &claim.measured, claim.criterion, claim.depends]);
    }
    (
        format!("\nThe claims of the study\n{}", brief.text()),
        format!("\n## The claims of the study\n\n{}", full.markdown()),
    )
}

const FINEST: usize = CELLS.len() - 1;

/// The series of a scheme; each one asked for here is measured by the parent module.
fn find<'a>(series: &'a [Series], name: &str) -> Option<&'a Series> {
    series.iter().find(|one| one.name() == name)
}

/// The error of a scheme in case `index`, if it got that far.
fn error(series: &[Series], name: &str, index: usize) -> Option<f64> {
    find(series, name)?.error(index)
}

/// The order of a scheme between the two finest grids.
fn finest_order(series: &[Series], name: &str) -> Option<f64> {
    find(series, name)?.study.orders.u.linf.local.last().copied().flatten()
}

/// `text` with the number in it, or that the run did not get there.
fn told(value: Option<f64>, text: impl Fn(f64) -> String) -> String {
    value.map_or_else(|| "a run stopped early".into(), text)
}

/// How many times larger the first error is.
fn ratio(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    Some(a? / b?)
}

fn second_order(results: &Results) -> Claim {
    let order = find(&results.space, "gimp+cd").and_then(|s| s.study.orders.u.linf.fit);
    Claim {
        text: "CD-GIMP is 2nd order",
        criterion: "fitted order in h within 2.0 +/- 0.1",
        depends: "smooth motion, aligned particles, CFL 0.4",
        measured: told(order, |order| format!("fitted order {order:.2}")),
        confirmed: order.is_some_and(|order| (order - 2.0).abs() <= 0.1),
    }
}

fn shortcut(results: &Results) -> Claim {
    let index = CELLS.iter().position(|cells| *cells == GRID);
    let halved = index.and_then(|index| error(&results.space, "gimp+cd", index));
    let exact = results.exact_start.errors.u.linf;
    let change = halved.map(|halved| halved / exact);
    Claim {
        text: "the initialization shortcut works (halved first acceleration)",
        criterion: "error within 20 % of that of the exact start",
        depends: "nothing found",
        measured: told(change, |change| {
            format!("{change:.3} times the error of the exact start ({exact:.3e})")
        }),
        confirmed: change.is_some_and(|change| (change - 1.0).abs() <= 0.2),
    }
}

fn usl_in_space(results: &Results) -> Claim {
    let order = finest_order(&results.space, "gimp+usl");
    Claim {
        text: "USL changes to 1st order",
        criterion: "order in h below 1.25 on the finest pair of grids",
        depends: "a CFL number that is kept while the grid is refined: with a small one USL is of second order",
        measured: told(order, |order| format!("order {order:.2} on the finest pair")),
        confirmed: order.is_some_and(|order| order < 1.25),
    }
}

fn ugimp(results: &Results) -> Claim {
    let gimp = error(&results.space, "gimp+cd", FINEST);
    let ugimp = ratio(error(&results.space, "ugimp+cd", FINEST), gimp);
    let order = finest_order(&results.space, "ugimp+cd");
    let order_text = told(order, |order| format!("its order there {order:.2}"));
    Claim {
        text: "minor change to UGIMP causes large error",
        criterion: "more than 10 times gimp's error on the finest grid, and growing",
        depends: "motion large enough to part or overlap particles of fixed size",
        measured: told(ugimp, |times| format!("{times:.1} times gimp's error, {order_text}")),
        confirmed: ugimp.is_some_and(|times| times > 10.0) && order.is_some_and(|o| o < 0.0),
    }
}

fn poor(results: &Results) -> Claim {
    // Hat functions do not reach the finest grids; the comparison is made where both do.
    let times = |name: &str| {
        (0..CELLS.len()).rev().find_map(|index| {
            let gimp = error(&results.space, "gimp+cd", index);
            Some((ratio(error(&results.space, name, index), gimp)?, CELLS[index]))
        })
    };
    let (usf, linear) = (times("gimp+usf"), times("linear+cd"));
    let tell = |name: &str, found: Option<(f64, usize)>| match found {
        Some((times, cells)) => format!("{name}: {times:.1} times on {cells} cells"),
        None => format!("{name}: all runs stopped early"),
    };
    Claim {
        text: "USF and MPM have poor accuracy",
        criterion: "more than 3 times the error of gimp+cd on the finest grid they reach",
        depends: "the grid: both get worse with refinement",
        measured: format!("{}; {}", tell("usf", usf), tell("linear", linear)),
        confirmed: [usf, linear].iter().all(|found| found.is_none_or(|(times, _)| times > 3.0)),
    }
}

/// The smallest and the largest error over the CFL numbers up to the largest stable one, and that one.
fn stable_range(series: &Series) -> Option<(f64, f64, f64)> {
    let stable = (0..CFLS.len()).map_while(|index| series.error(index)).collect::<Vec<_>>();
    let smallest = stable.iter().copied().reduce(f64::min)?;
    let largest = stable.iter().copied().reduce(f64::max)?;
    Some((smallest, largest, CFLS[stable.len() - 1]))
}

fn no_temporal_order(results: &Results) -> Claim {
    let range = find(&results.time, "gimp+cd").and_then(stable_range);
    let spread = range.map(|(smallest, largest, _)| largest / smallest);
    Claim {
        text: "no temporal convergence until stability is lost: spatial error dominates",
        criterion: "gimp+cd: errors at all stable CFL numbers within 30 %",
        depends: "the grid: total error, which the spatial one dominates",
        measured: match range {
            Some((smallest, largest, cfl)) => {
                format!("{smallest:.3e} to {largest:.3e} from CFL {} to {cfl}", CFLS[0])
            }
            None => "a run stopped early".into(),
        },
        confirmed: spread.is_some_and(|spread| spread <= 1.3),
    }
}

fn usl_in_time(results: &Results) -> Claim {
    // Local orders between CFL 0.4 and the last stable one, where the temporal error shows.
    let orders: Vec<f64> = find(&results.time, "gimp+usl")
        .map(|series| series.study.orders.u.linf.local.iter().skip(3).flatten().copied().collect())
        .unwrap_or_default();
    let mean = (!orders.is_empty()).then(|| orders.iter().sum::<f64>() / orders.len() as f64);
    Claim {
        text: "USL loses one spatial order, and gains one temporal",
        criterion: "mean order of gimp+usl in dt from CFL 0.4 on within 1.0 +/- 0.25",
        depends: "the CFL number: from 0.4 on the temporal error is the larger one",
        measured: told(mean, |order| format!("mean order {order:.2} in dt from CFL 0.4 on")),
        confirmed: mean.is_some_and(|order| (order - 1.0).abs() <= 0.25),
    }
}

/// The local orders of a scheme's largest difference of `u`, each with the CFL numbers of its pair.
pub(super) fn difference_orders(all: &[Differences], scheme: &str) -> Vec<(f64, f64, f64)> {
    let Some(one) = all.iter().find(|one| name(one.scheme) == scheme) else { return Vec::new() };
    let rows = one.found.rows.windows(2).zip(&one.found.orders.u.linf.local);
    rows.filter_map(|(pair, order)| Some((pair[0].cfl, pair[1].cfl, (*order)?))).collect()
}

/// Orders in words: `1.99 (CFL 0.60 to 0.40), ...`.
pub(super) fn told_orders(orders: &[(f64, f64, f64)]) -> String {
    let told = orders.iter().map(|(a, b, order)| format!("{order:.2} (CFL {a:.2} to {b:.2})"));
    told.collect::<Vec<_>>().join(", ")
}

fn formal_order(gentle: &[Differences]) -> Claim {
    let orders = difference_orders(gentle, "gimp+cd");
    let judged: Vec<_> = orders.iter().filter(|(_, fine, _)| *fine > GENTLE_RANGE).collect();
    Claim {
        text: "CD-GIMP is formally 2nd order in time",
        criterion: "by differences on one grid, orders in dt within 2.00 +/- 0.05 from CFL 0.6 to 0.2",
        depends: "amplitude, grid and time step: it shows at small amplitude on a fine grid, above CFL 0.2",
        measured: format!(
            "{} on {GENTLE_GRID} cells, A = {GENTLE}, down to CFL {}",
            told_orders(&orders),
            GENTLE_CFLS[GENTLE_CFLS.len() - 1]
        ),
        confirmed: judged.len() == 2
            && judged.iter().all(|(_, _, order)| (order - 2.0).abs() <= 0.05),
    }
}

fn usl_formal_order(results: &Results, gentle: &[Differences]) -> Claim {
    let mut orders = difference_orders(gentle, "gimp+usl");
    let small = told_orders(&orders);
    let usual = difference_orders(&results.differences, "gimp+usl");
    let large = told_orders(&usual);
    orders.extend(usual);
    Claim {
        text: "USL is 1st order in time",
        criterion: "by differences on one grid, all orders in dt within 1.00 +/- 0.05",
        depends: "nothing found",
        measured: format!(
            "{small} on {GENTLE_GRID} cells, A = {GENTLE}; {large} on {GRID} cells, A = 0.1"
        ),
        confirmed: orders.len() == 6
            && orders.iter().all(|(_, _, order)| (order - 1.0).abs() <= 0.05),
    }
}

fn sum_of_two(results: &Results) -> Claim {
    let order = results.small_step.study.orders.u.linf.local.last().copied().flatten();
    Claim {
        text: "USL: the orders in space and time sum to 2",
        criterion: "USL's order in h falls below 1.5 on the finest pair of grids at a small time step too",
        depends: "the CFL number: only where dt shrinks with h does the first order in time show as one in space",
        measured: told(order, |order| {
            format!(
                "order in h {order:.2} on the finest pair at CFL {SMALL_STEP}: 2 in space and 1 in time"
            )
        }),
        confirmed: order.is_some_and(|order| order < 1.5),
    }
}

fn ring_order(results: &Results) -> Claim {
    let orders = find(&results.space, "gimp+cd").map(|series| &series.study.orders.u);
    let fits = orders.and_then(|orders| Some((orders.linf.fit?, orders.l1.fit?)));
    Claim {
        text: "ring: mis-aligned particles and the stair-stepped surface reduce CD-GIMP to 1st order",
        criterion: "fitted order in h at most 1.1",
        depends: "the norm: stair steps weigh most in L_inf",
        measured: match fits {
            Some((linf, l1)) => format!("fitted order {linf:.2} in L_inf, {l1:.2} in L1"),
            None => "a run stopped early".into(),
        },
        confirmed: fits.is_some_and(|(linf, _)| linf <= 1.1),
    }
}

fn ring_ugimp(results: &Results) -> Claim {
    let times = |index| {
        let gimp = error(&results.space, "gimp+cd", index);
        ratio(error(&results.space, "ugimp+cd", index), gimp)
    };
    let mean = |name| find(&results.space, name).map(|one| one.study.rows[FINEST].errors.u.l1);
    let in_mean = told(ratio(mean("ugimp+cd"), mean("gimp+cd")), |times| format!("{times:.2}"));
    let coarser =
        (0..FINEST).map(times).try_fold(0.0_f64, |largest, next| Some(largest.max(next?)));
    let finest = times(FINEST);
    Claim {
        text: "ring: UGIMP gives up only for the highest resolutions",
        criterion: "within 25 % of gimp's error on all grids but the finest, more than 25 % above it there",
        depends: "the norm: in L1 the two part, in L_inf both have the rim's error",
        measured: match (coarser, finest) {
            (Some(coarser), Some(finest)) => format!(
                "at most {coarser:.2} times gimp's error up to {} cells, {finest:.2} times on {} (in L1 {in_mean})",
                CELLS[FINEST - 1],
                CELLS[FINEST]
            ),
            _ => "a run stopped early".into(),
        },
        confirmed: coarser.is_some_and(|times| times <= 1.25)
            && finest.is_some_and(|times| times > 1.25),
    }
}

fn ring_ugimp_in_time(results: &Results) -> Claim {
    let times = |index| {
        let gimp = error(&results.time, "gimp+cd", index);
        ratio(error(&results.time, "ugimp+cd", index), gimp)
    };
    let found: Vec<f64> = (0..CFLS.len()).filter_map(times).collect();
    let range = found.iter().copied().reduce(f64::min).zip(found.iter().copied().reduce(f64::max));
    Claim {
        text: "ring: UGIMP and GIMP have nearly the same accuracy at all CFL numbers",
        criterion: "errors within 50 % of each other wherever both are stable",
        depends: "the grid, as it is 32 cells here",
        measured: match range {
            Some((least, most)) => format!("{least:.2} to {most:.2} times gimp's error"),
            None => "all runs stopped early".into(),
        },
        confirmed: range.is_some_and(|(least, most)| least > 1.0 / 1.5 && most < 1.5),
    }
}

fn best(axis_aligned: &Results, ring: &Results) -> Claim {
    let rank = |results: &Results| {
        let own = error(&results.space, "gimp+cd", FINEST)?;
        let others = results.space.iter().filter(|one| one.name() != "gimp+cd");
        let next = others.filter_map(|one| one.error(FINEST)).reduce(f64::min)?;
        Some(next / own)
    };
    let lead = rank(axis_aligned).zip(rank(ring));
    Claim {
        text: "CD-GIMP is significantly better than UGIMP, MPM, USF and USL",
        criterion: "smallest error of all schemes on the finest grid of both problems",
        depends: "the problem: a lead on the square, hardly one on the ring",
        measured: match lead {
            Some((square, ring)) => format!(
                "the next best scheme has {square:.2} times its error on the square, {ring:.2} times on the ring"
            ),
            None => "a run stopped early".into(),
        },
        confirmed: lead.is_some_and(|(square, ring)| square > 1.0 && ring > 1.0),
    }
}
