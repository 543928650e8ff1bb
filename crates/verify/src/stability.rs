//! The largest stable time step of a scheme.
//!
//! A run is unstable from the first step at which one of these holds:
//!
//! - the solver gives up: a particle is turned inside out (`J <= 0`), is not finite, has left the grid, or has grown
//!   beyond what its weights support;
//! - the largest error of `u` is more than `error_multiple` times that of a reference run, which has the same grid and an
//!   eighth of the time step that P-waves in the undeformed solid would allow, or not a number. The part of that error which the
//!   reference run's steps cause grows with the order of the integrator before the two are compared: on a grid that contains
//!   the motion it is all of it, and ten times as much is no instability. A run of twice its step tells it. Errors below the
//!   floor of rounding do not count;
//! - the energy, kinetic and strain, is larger than that of the exact motion at the same time by more than `energy_rate`
//!   times the exact motion's largest energy, for each period, and by more than the reference run's energy ever differs
//!   beyond that. (The body force does work, so the energy of the exact motion is not constant, and a coarse grid whose
//!   waves have another speed gains and loses energy at any time step.) Energy lost is inaccuracy and not instability. Where
//!   the law has no strain energy, as with memory, this one is left out.
//!
//! Steps are not shortened to end at the end time, as those of other studies are, or on coarse grids few CFL numbers would
//! be left. A run has the length of its periods, and at least that of 64 cells at the speed that the CFL number refers to,
//! so that an instability has steps to grow in.

use serde::{Deserialize, Serialize};

use crate::case::Arithmetic;
use crate::discretized::Discretized;
use crate::error::CaseError;
use crate::observe::{Failure, Limits, Observed, Scales};

/// When a run counts as unstable.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Criteria {
    /// Errors of `u` beyond this multiple of the reference run's, as far as the order of the integrator does not explain them.
    pub error_multiple: f64,
    /// Energy gained per period, in units of the exact motion's largest energy.
    pub energy_rate: f64,
}

impl Default for Criteria {
    /// Ten: below the limit of centred differences the error changes by less than a factor of 2 with the time step beside what
    /// the order of the integrator explains; beyond it errors grow by factors from step to step. One: as much energy again as
    /// there is.
    fn default() -> Self {
        Self { error_multiple: 10.0, energy_rate: 1.0 }
    }
}

/// How to look for the limit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Search {
    /// A CFL number to start from, hopefully stable; an eighth of P-waves' where nothing is said.
    pub lower: Option<f64>,
    /// One that is hopefully unstable; P-waves' own where nothing is said.
    pub upper: Option<f64>,
    /// How close the stable and the unstable end come, as a CFL number of P-waves, which is never smaller than that of
    /// bar waves.
    pub width: f64,
    /// When a run counts as unstable.
    pub criteria: Criteria,
}

impl Search {
    /// Refuses what no search could come to.
    ///
    /// # Errors
    ///
    /// [`CaseError::Setting`] for a width that the solver's precision cannot resolve.
    pub fn validate(&self, arithmetic: Arithmetic<'_>) -> Result<(), CaseError> {
        let (least, admissible) = match arithmetic {
            Arithmetic::Double => (
                1e-15,
                "at least 1e-15: in f64 CFL numbers closer than that give the same time step",
            ),
            Arithmetic::Single(_) => {
                (1e-6, "at least 1e-6: in f32 CFL numbers closer than that give the same time step")
            }
        };
        if self.width >= least {
            return Ok(());
        }
        Err(CaseError::setting("width", format!("{:e}", self.width), admissible))
    }

    /// Whether the search goes on between a stable and an unstable CFL number, where `unit` is that of P-waves.
    fn goes_on(&self, arithmetic: Arithmetic<'_>, stable: f64, unstable: f64, unit: f64) -> bool {
        let resolution = match arithmetic {
            Arithmetic::Double => f64::EPSILON,
            Arithmetic::Single(_) => f64::from(f32::EPSILON),
        };
        let gap = unstable - stable;
        // Closer together than that, the middle is one of the ends.
        gap > self.width * unit && gap > resolution * unstable
    }

    /// How many times a bracket of this width is halved.
    fn halvings(&self, gap: f64, unit: f64) -> usize {
        (gap / (self.width * unit)).log2().ceil().max(0.0) as usize
    }
}

/// How far a search is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchProgress {
    /// The number of the run under way, from 1.
    pub run: usize,
    /// The share of the runs that are done, by how many the search will take as far as that is known; it never falls.
    pub share: f64,
}

/// The limit of one case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StabilityRow {
    /// The largest CFL number that was found stable; none where every one tried was unstable, or every one stable.
    pub cfl_max: Option<f64>,
    /// The ends that the search came to: stable, unstable.
    pub bracket: [Option<f64>; 2],
    /// `cfl_max` as a CFL number of P-waves in the undeformed solid.
    pub p_wave_cfl: Option<f64>,
    /// The CFL number at which that of P-waves is one: what linear analysis of a grid would allow.
    pub p_wave_limit: f64,
    /// How the run at the unstable end failed.
    pub failure: Option<Failure>,
    /// The reference run.
    pub reference: Observed,
    /// The run at the stable end.
    pub at_limit: Option<Observed>,
    /// Runs below the limit that were unstable all the same.
    pub unstable_below: Vec<Observed>,
    /// Number of runs.
    pub runs: usize,
}

/// The reference run's CFL number for P-waves.
const REFERENCE: f64 = 0.125;
/// How often the bracket is widened at either end, and by what factor.
const MOST_WIDENINGS: usize = 6;
const WIDENING: f64 = 1.5;
/// Where below the limit runs are tried again: bisection takes for granted that they are stable.
const PROBES: [f64; 4] = [0.95, 0.85, 0.7, 0.5];
/// Looks for the largest stable CFL number of a case by bisection; its own CFL number does not matter.
///
/// `progress` is told of each run before it begins.
///
/// # Errors
///
/// [`CaseError`] for settings that cannot be run.
pub fn stability(
    case: &Discretized<'_>,
    search: &Search,
    progress: &mut dyn FnMut(SearchProgress),
) -> Result<StabilityRow, CaseError> {
    let arithmetic = case.arithmetic();
    search.validate(arithmetic)?;
    let bench = Bench::new(case)?;
    let mut runs = 0;
    let reference = bench.reference()?;
    let unit = bench.scales.p_wave_limit;
    let start = search.lower.unwrap_or(REFERENCE * unit);
    let expected = search.halvings(search.upper.unwrap_or(unit) - start, unit) + PROBES.len() + 1;
    let mut share = 0.0_f64;
    // With the number of runs that are left, this one included.
    let mut count = |left: usize| {
        // The reference run is one of them.
        let done = runs as f64 + 1.0;
        share = share.max(done / (done + left as f64));
        runs += 1;
        progress(SearchProgress { run: runs, share });
    };
    count(expected + 1);
    let standard = bench.standard(&search.criteria, &reference)?;
    let mut attempt = |cfl: f64, left: usize| -> Result<Observed, CaseError> {
        // That is the reference run again, which no multiple of its own error refuses.
        let is_reference = cfl == reference.cfl && search.criteria.error_multiple >= 1.0;
        if is_reference && reference.failure.is_none() {
            return Ok(reference.clone());
        }
        count(left);
        bench.run(cfl, Some(&standard.at(cfl)))
    };
    let mut stable: Option<Observed> = None;
    let mut unstable: Option<Observed> = None;
    let mut cfl = start;
    for _ in 0..=MOST_WIDENINGS {
        let found = attempt(cfl, expected + 1)?;
        if found.failure.is_none() {
            stable = Some(found);
            break;
        }
        unstable = Some(found);
        cfl /= 2.0;
    }
    if stable.is_some() && unstable.is_none() {
        let mut cfl = search.upper.unwrap_or(unit).max(start * WIDENING);
        for _ in 0..=MOST_WIDENINGS {
            let found = attempt(cfl, expected)?;
            if found.failure.is_some() {
                unstable = Some(found);
                break;
            }
            stable = Some(found);
            cfl *= WIDENING;
        }
    }
    while let (Some(low), Some(high)) = (&stable, &unstable)
        && search.goes_on(arithmetic, low.cfl, high.cfl, unit)
    {
        let left = search.halvings(high.cfl - low.cfl, unit) + PROBES.len();
        let found = attempt(0.5 * (low.cfl + high.cfl), left)?;
        let end = if found.failure.is_none() { &mut stable } else { &mut unstable };
        *end = Some(found);
    }
    let mut unstable_below = Vec::new();
    if let (Some(limit), Some(_)) = (&stable, &unstable) {
        let limit = limit.cfl;
        for (index, share) in PROBES.into_iter().enumerate() {
            let found = attempt(share * limit, PROBES.len() - index)?;
            if found.failure.is_some() {
                unstable_below.push(found);
            }
        }
    }
    let cfl_max = stable.as_ref().filter(|_| unstable.is_some()).map(|stable| stable.cfl);
    Ok(StabilityRow {
        cfl_max,
        bracket: [&stable, &unstable].map(|end| end.as_ref().map(|end| end.cfl)),
        p_wave_cfl: cfl_max.map(|cfl| cfl / unit),
        p_wave_limit: unit,
        failure: unstable.and_then(|unstable| unstable.failure),
        reference,
        at_limit: stable,
        unstable_below,
        runs: runs + 1,
    })
}

/// One run of a case at its own CFL number, held against the reference run.
///
/// # Errors
///
/// [`CaseError`] for settings that cannot be run.
pub fn is_stable(case: &Discretized<'_>, criteria: &Criteria) -> Result<Observed, CaseError> {
    let bench = Bench::new(case)?;
    let standard = bench.standard(criteria, &bench.reference()?)?;
    let cfl = case.case().cfl;
    bench.run(cfl, Some(&standard.at(cfl)))
}

/// The CFL number at which P-waves in the undeformed solid cross one cell in one step.
///
/// # Errors
///
/// [`CaseError`] for settings that cannot be run.
pub fn p_wave_limit(case: &Discretized<'_>) -> Result<f64, CaseError> {
    Ok(Bench::new(case)?.scales.p_wave_limit)
}

/// A case without its CFL number.
struct Bench<'a> {
    case: &'a Discretized<'a>,
    scales: Scales,
}

impl<'a> Bench<'a> {
    fn new(case: &'a Discretized<'a>) -> Result<Self, CaseError> {
        Ok(Self { case, scales: case.scales()? })
    }

    /// The run that errors are compared with; its time step is halved until it is through.
    fn reference(&self) -> Result<Observed, CaseError> {
        let mut cfl = REFERENCE * self.scales.p_wave_limit;
        loop {
            let found = self.run(cfl, None)?;
            if found.failure.is_none() || cfl < REFERENCE / 8.0 * self.scales.p_wave_limit {
                return Ok(found);
            }
            cfl /= 2.0;
        }
    }

    /// The standard of runs, by a reference run and by one of twice its step.
    fn standard(&self, criteria: &Criteria, reference: &Observed) -> Result<Standard, CaseError> {
        let order = self.case.case().scheme.order_in_time();
        let error = match reference {
            Observed { error: Some(error), failure: None, .. } => *error,
            // Without a reference no error is too large.
            _ => f64::INFINITY,
        };
        let mut of_steps = 0.0;
        if error.is_finite() && error > 0.0 {
            let longer = self.run(2.0 * reference.cfl, None)?;
            if let Observed { error: Some(longer), failure: None, .. } = longer {
                let part = (longer - error) / (2.0_f64.powi(order) - 1.0);
                of_steps = part.clamp(0.0, error);
            }
        }
        let (criteria, scales, cfl) = (*criteria, self.scales, reference.cfl);
        let energy_drift = reference.energy_drift.unwrap_or(f64::INFINITY);
        Ok(Standard { criteria, scales, cfl, error, of_steps, order, energy_drift })
    }

    fn run(&self, cfl: f64, limits: Option<&Limits>) -> Result<Observed, CaseError> {
        self.case.observe(cfl, self.scales.end, limits)
    }
}

/// The standard that runs of a case are held against.
struct Standard {
    criteria: Criteria,
    scales: Scales,
    /// The reference run's CFL number.
    cfl: f64,
    /// Its error.
    error: f64,
    /// The part of that which its steps cause.
    of_steps: f64,
    /// The order with which that part grows.
    order: i32,
    energy_drift: f64,
}

impl Standard {
    /// The limits of a run at a CFL number.
    fn at(&self, cfl: f64) -> Limits {
        let Self { criteria, scales, error, of_steps, .. } = self;
        let growth = (cfl / self.cfl).max(1.0).powi(self.order) - 1.0;
        Limits {
            error: (criteria.error_multiple * (error + of_steps * growth)).max(scales.floor),
            energy_rate: criteria.energy_rate,
            energy_drift: self.energy_drift,
            period: scales.period,
            strain_floor: scales.floor,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::Case;

    fn search(width: f64) -> Search {
        Search { lower: None, upper: None, width, criteria: Criteria::default() }
    }

    /// Wherever the limit is: no width keeps a search between two numbers that have none between them.
    #[test]
    fn bisection_ends_whatever_the_width() {
        for width in [1e-2, 1e-15, 1e-16, 1e-300] {
            for limit in [0.3, 0.500_000_1, 1.0 - 1e-16, 2.0, 7.3] {
                let search = search(width);
                let (mut stable, mut unstable) = (0.125, 8.0);
                let mut halvings = 0;
                while search.goes_on(Arithmetic::Double, stable, unstable, 1.0) {
                    let middle = 0.5 * (stable + unstable);
                    assert!(stable < middle && middle < unstable, "{width:e} at {limit}");
                    *(if middle < limit { &mut stable } else { &mut unstable }) = middle;
                    halvings += 1;
                }
                assert!(halvings <= 64, "{halvings} for {width:e} at {limit}");
                assert!(unstable - stable <= width.max(2e-15), "{width:e} at {limit}");
            }
        }
    }

    #[test]
    fn a_width_that_no_time_step_can_have_is_refused_with_one_that_can() {
        let exact = mmsmith_solutions::build::<f32>("bar", &[]).unwrap().unwrap();
        let single = Arithmetic::Single(&exact);
        search(1e-15).validate(Arithmetic::Double).unwrap();
        search(1e-6).validate(single).unwrap();
        let message = search(1e-16).validate(Arithmetic::Double).unwrap_err().to_string();
        assert!(message.contains("width = 1e-16: it must be at least 1e-15"), "{message}");
        let message = search(1e-15).validate(single).unwrap_err().to_string();
        assert!(message.contains("at least 1e-6"), "{message}");
        search(f64::NAN).validate(single).unwrap_err();
    }

    #[test]
    fn the_share_of_a_search_grows_to_its_end() {
        let exact = mmsmith_solutions::build::<f64>("bar", &[]).unwrap().unwrap();
        let case = Case { cells: 4, ..Case::default() };
        let mut told: Vec<SearchProgress> = Vec::new();
        let show = &mut |progress| told.push(progress);
        let case = Discretized::new(&exact, Arithmetic::Double, &case).unwrap();
        let found = stability(&case, &search(0.05), show).unwrap();
        assert!(told.windows(2).all(|pair| pair[0].share <= pair[1].share), "{told:?}");
        assert!(told.iter().zip(1..).all(|(progress, run)| progress.run == run));
        assert!(told.iter().all(|progress| (0.0..1.0).contains(&progress.share)));
        // The reference run is not told of.
        assert_eq!(told.len() + 1, found.runs);
        let last = told.last().unwrap().share;
        assert!((last - (1.0 - 1.0 / found.runs as f64)).abs() < 1e-12, "{told:?}");
    }
}
