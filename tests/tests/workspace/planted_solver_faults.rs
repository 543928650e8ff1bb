//! Faults planted in the solver and in what drives it, one at a time: each must be caught by the checks that are named
//! beside it in `tests/data/planted-solver-faults.toml`, and without a fault all checks pass. Each is a mistake of the kind that
//! published codes carry.
//!
//! The checks are those that users have (`mms converge`, `mms check`) on small grids, whose studies are in that file too, and laws
//! that every scheme has to keep.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use mmsmith_mpm::fault::{self, Fault};
use mmsmith_solutions::{AnySolution, CATALOGUE, build};
use mmsmith_tests::workspace;
use mmsmith_verify::{
    Arithmetic, Case, CflSpeed, Composition, Coordinates, Discretized, Layout, ORDER_TOLERANCE,
    OrderVerdict, PerField, PerNorm, Placement, Scheme, Status, Study, Sweep, Total, Updated,
    converge, expected_in_space, expected_in_time, verdicts,
};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fmt::Debug;
use std::str::FromStr;
use std::sync::LazyLock;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

mod computed;

/// The faults outside of laws with their names; those in laws, after them, are in `planted_law_faults.rs`.
macro_rules! faults {
    ($($name:ident)+) => { [$((stringify!($name), Fault::$name)),+] };
}

const FAULTS: [(&str, Fault); Fault::XpicSign as usize + 1] = faults! {
    CauchyStress NormalStressSign ShearStressSign NominalStress LinearLogarithm TransposedLaw
    LambdaForMu StiffnessOff NoBodyForce LateBodyForce BodyForceAtCurrentPosition
    BodyForcePerVolume OwnVelocity PositionOff WallsKeepAcceleration WallsKeepVelocity
    GhostMassLost NoHalfStep AdditiveStretch GradientTransposed SizeFromJacobian
    WeightsOfNewPosition LastNodeSkipped SinglePrecision PicForFlip NoReprojection
    StressOfOldStretch MassBandDropped WeightOff StageOff StagesAtOneTime MirrorSign
    HoopStressDropped HoopShearDropped CotangentDropped TractionSign BoundaryInertiaDropped
    LateBoundary GeometricStiffnessDropped CornersStay AffinePartDropped XpicSign
};

/// The problems that a check finds, with this fault in the solver.
type Check = fn(Option<Fault>) -> Vec<String>;

/// Checks that are no study.
const COMPUTED: [(&str, Check); 5] = [
    ("agreement", computed::agreement_of_two_solvers),
    ("momentum", computed::momentum_and_free_flight),
    ("energy", computed::energy_of_a_free_body),
    ("fields", computed::fields_against_the_law),
    ("newton", computed::newton_on_the_way_to_equilibrium),
];

/// The file.
#[derive(Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
struct Data {
    /// By the name of a fault the names of the checks, in their order.
    caught_by: BTreeMap<String, Vec<String>>,
    study: Vec<Stated>,
}

/// A study with its expectations.
#[derive(Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
struct Stated {
    /// The check that it is a part of.
    check: String,
    solution: String,
    #[serde(default)]
    set: BTreeMap<String, f64>,
    updated: Option<StatedUpdated>,
    total: Option<StatedTotal>,
    per_cell: Option<usize>,
    cfl: Option<f64>,
    periods: Option<f64>,
    cells: Vec<usize>,
    /// Time steps on one grid instead of several grids.
    #[serde(default)]
    cfls: Vec<f64>,
    #[serde(default)]
    orders: Orders,
    error: Option<f64>,
    reached: Option<Reached>,
    order_in_time: Option<f64>,
}

#[derive(Deserialize, Default, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum Orders {
    Expected,
    #[default]
    Any,
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
struct StatedUpdated {
    shape: Option<String>,
    integrator: Option<String>,
    transfer: Option<String>,
    placement: Option<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
struct StatedTotal {
    degree: usize,
    composition: usize,
    layout: Option<String>,
    coordinates: Option<String>,
}

/// Errors of u over the amplitude, and the least order, as an independent implementation reaches them.
#[derive(Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
struct Reached {
    amplitude: f64,
    errors: Vec<f64>,
    order: f64,
}

static DATA: LazyLock<Data> = LazyLock::new(|| {
    let file = workspace().join("tests/data/planted-solver-faults.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    toml::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}", file.display()))
});

/// The names of all checks, in their order.
fn checks() -> Vec<&'static str> {
    let mut names = COMPUTED.map(|(name, _)| name).to_vec();
    names.extend(DATA.study.iter().map(|study| study.check.as_str()));
    names.dedup();
    names
}

/// The problems that the check of that name finds.
fn run(name: &str, fault: Option<Fault>) -> Vec<String> {
    match COMPUTED.iter().find(|(known, _)| *known == name) {
        Some((_, check)) => check(fault),
        None => {
            let studies = DATA.study.iter().filter(|study| study.check == name);
            studies.flat_map(|study| study.problems(fault)).collect()
        }
    }
}

/// The value of a name, or the usual value.
fn named<T: FromStr<Err: Debug>>(name: Option<&String>, usual: T) -> T {
    name.map_or(usual, |name| name.parse().unwrap_or_else(|error| panic!("{name}: {error:?}")))
}

impl Stated {
    fn case(&self) -> Case {
        let usual = Case::default();
        let (scheme, cfl_speed) = match (&self.updated, &self.total) {
            (None, None) => (usual.scheme, usual.cfl_speed),
            (Some(stated), None) => (Scheme::Updated(stated.scheme()), usual.cfl_speed),
            (None, Some(stated)) => (Scheme::Total(stated.scheme()), CflSpeed::PWave),
            (Some(_), Some(_)) => panic!("a study of {} has two schemes", self.solution),
        };
        Case {
            scheme,
            cells: self.cells[0],
            per_cell: self.per_cell.unwrap_or(usual.per_cell),
            cfl: self.cfl.unwrap_or(usual.cfl),
            cfl_speed,
            periods: self.periods.unwrap_or(usual.periods),
            ..usual
        }
    }

    /// The differences from what is expected, with this fault in the solver.
    fn problems(&self, fault: Option<Fault>) -> Vec<String> {
        let overrides: Vec<_> =
            self.set.iter().map(|(name, value)| (name.as_str(), *value)).collect();
        let (exact, case) = (solution(&self.solution, &overrides), self.case());
        if !self.cfls.is_empty() && self.order_in_time.is_none() {
            assert!(self.orders == Orders::Expected, "a study in time expects something");
            return by_differences(fault, &exact, &case, &self.cfls);
        }
        let sweep = match self.cfls.as_slice() {
            [] => Sweep::Cells(self.cells.clone()),
            cfls => Sweep::Cfls(cfls.to_vec()),
        };
        let study = study(fault, &exact, &case, &sweep);
        let mut problems = Vec::new();
        let mut expectations = 0;
        if self.orders == Orders::Expected {
            expectations += 1;
            problems.extend(promised(&study, &exact, &case));
        }
        if let Some(known) = self.error {
            expectations += 1;
            problems.extend(beside(&study, known));
        }
        if let Some(reached) = &self.reached {
            expectations += 1;
            assert_eq!(reached.errors.len(), self.cells.len(), "{}", self.check);
            problems.extend(reached.problems(&study));
        }
        if let Some(expected) = self.order_in_time {
            expectations += 1;
            let order = study.orders.u.linf.local[0];
            let off = order.is_none_or(|order| (order - expected).abs() > 0.2);
            problems.extend(off.then(|| format!("order {order:.2?}")));
        }
        assert!(expectations > 0, "a study of the check {} expects something", self.check);
        problems
    }
}

impl StatedUpdated {
    fn scheme(&self) -> Updated {
        let usual = Updated::default();
        let placement = match self.placement.as_deref() {
            None => usual.placement,
            Some("body-fitted") => Placement::BodyFitted,
            Some(other) => panic!("no placement is called {other}"),
        };
        Updated {
            shape: named(self.shape.as_ref(), usual.shape),
            integrator: named(self.integrator.as_ref(), usual.integrator),
            transfer: named(self.transfer.as_ref(), usual.transfer),
            placement,
            ..usual
        }
    }
}

impl StatedTotal {
    fn scheme(&self) -> Total {
        let usual = Total::of_degree(self.degree);
        Total {
            composition: match self.composition {
                4 => Composition::Order4,
                6 => Composition::Order6,
                other => panic!("no study has a composition of order {other}"),
            },
            layout: match self.layout.as_deref() {
                None => usual.layout,
                Some("gauss") => Layout::Gauss,
                Some(other) => panic!("no study has the layout {other}"),
            },
            coordinates: match self.coordinates.as_deref() {
                None => usual.coordinates,
                Some("cartesian") => Coordinates::Cartesian,
                Some("polar") => Coordinates::Polar,
                Some("spherical") => Coordinates::Spherical,
                Some(other) => panic!("no coordinates are called {other}"),
            },
            ..usual
        }
    }
}

impl Reached {
    fn problems(&self, study: &Study) -> Vec<String> {
        let mut problems = Vec::new();
        for (row, reference) in study.rows.iter().zip(&self.errors) {
            let relative = row.errors.u.linf / self.amplitude;
            if row.status != Status::Ok || relative.is_nan() || relative > 2.0 * reference {
                problems.push(format!("{} cells: {relative:.1e}, {}", row.cells, row.status));
            }
        }
        for found in &study.orders.u.linf.local {
            if found.is_none_or(|found| found < self.order) {
                problems.push(format!("order {found:.2?}"));
            }
        }
        problems
    }
}

/// Result of `build` with the fault, if there is one.
fn with<R>(fault: Option<Fault>, build: impl FnOnce() -> R) -> R {
    match fault {
        Some(fault) => fault::with(fault, build),
        None => build(),
    }
}

/// A density other than one: that hides what is divided by it.
fn solution(name: &str, overrides: &[(&str, f64)]) -> AnySolution<f64> {
    let description = CATALOGUE.iter().find(|d| d.name == name).unwrap();
    let values = [("rho0", 2.0)].into_iter().chain(overrides.iter().copied());
    build(name, &description.resolve(values).unwrap()).unwrap().unwrap()
}

/// `mms converge`.
fn study(fault: Option<Fault>, exact: &AnySolution<f64>, case: &Case, sweep: &Sweep) -> Study {
    with(fault, || converge(exact, Arithmetic::Double, case, sweep, &mut |_| ())).unwrap()
}

/// The orders that `mms converge` promises, by its own verdict.
fn promised(study: &Study, exact: &AnySolution<f64>, case: &Case) -> Vec<String> {
    let steps: Vec<f64> = study.rows.iter().map(|row| row.h).collect();
    let values: Vec<_> =
        study.rows.iter().map(|row| (row.status == Status::Ok).then_some(&row.errors)).collect();
    let expected = expected_in_space(exact, case);
    judged(&verdicts(&steps, &values, &expected, ORDER_TOLERANCE))
}

/// Orders that are not the known ones of the scheme: an order beyond them is no fault in a user's solver, and a change in this one.
fn judged(verdicts: &PerField<PerNorm<OrderVerdict>>) -> Vec<String> {
    let norms = verdicts.iter().flat_map(|(field, verdicts)| {
        verdicts.iter().map(move |(norm, verdict)| (format!("{field} {norm}"), verdict.clone()))
    });
    let is_beyond = |verdict: &OrderVerdict| {
        verdict.finest.zip(verdict.expected).is_some_and(|(o, e)| o > e + ORDER_TOLERANCE)
    };
    let other = norms.filter(|(_, verdict)| verdict.passed == Some(false) || is_beyond(verdict));
    other.map(|(what, v)| format!("{what}: {:?} {:.2?}", v.behaviour, v.finest)).collect()
}

/// The largest error of u on the finest grid beside what was measured.
fn beside(study: &Study, known: f64) -> Vec<String> {
    let row = study.rows.last().unwrap();
    let error = row.errors.u.linf;
    let off = row.status != Status::Ok || error.is_nan() || (error / known - 1.0).abs() > 0.02;
    off.then(|| format!("{error:.4e} instead of {known:.4e}, {}", row.status)).into_iter().collect()
}

/// Orders by differences between time steps on one grid that are not the expected ones.
fn by_differences(
    fault: Option<Fault>,
    exact: &AnySolution<f64>,
    case: &Case,
    cfls: &[f64],
) -> Vec<String> {
    let measure = || {
        let case = Discretized::new(exact, Arithmetic::Double, case)?;
        case.differences(cfls, &mut |_| ()).map_err(|error| error.cause)
    };
    let study = with(fault, measure).unwrap();
    let steps: Vec<f64> = study.rows.iter().map(|row| row.dt).collect();
    let ok = study.rows.iter().map(|row| (row.status == Status::Ok).then_some(&row.differences));
    judged(&verdicts(
        &steps,
        &ok.collect::<Vec<_>>(),
        &expected_in_time(exact, case),
        ORDER_TOLERANCE,
    ))
}

/// The checks among `names` that catch a fault, in their order, with the first problem that each found.
fn caught(fault: Fault, names: &[&'static str]) -> Vec<(&'static str, String)> {
    let found = |name: &'static str| Some((name, run(name, Some(fault)).into_iter().next()?));
    names.iter().filter_map(|name| found(name)).collect()
}

/// The faults that are not caught by exactly the checks that they should be, where these may use those of `names_of`.
fn wrongly_caught(names_of: fn(&'static [String]) -> Vec<&'static str>) -> Vec<String> {
    // Threads of their own: a fault is planted on the thread that sets a simulation up.
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        while let Some((name, fault)) = FAULTS.get(next.fetch_add(1, Ordering::Relaxed)) {
            let expected = &DATA.caught_by[*name];
            let caught = caught(*fault, &names_of(expected));
            let mut told = format!("{name}\n");
            for (check, problem) in &caught {
                told += &format!("    {check}: {problem}\n");
            }
            print!("{told}");
            let names: Vec<_> = caught.iter().map(|(check, _)| *check).collect();
            if names.is_empty() || names != *expected {
                done.push(format!("{name} is caught by {names:?}, not by {expected:?}"));
            }
        }
        done
    };
    thread::scope(|scope| {
        let threads: Vec<_> = (0..2).map(|_| scope.spawn(work)).collect();
        threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect()
    })
}

#[test]
fn every_fault_in_the_solver_is_caught_by_the_checks_named() {
    let wrong = wrongly_caught(|named| named.iter().map(String::as_str).collect());
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
#[ignore = "takes a minute; run by .ci/long"]
fn every_fault_in_the_solver_is_caught_by_no_other_checks() {
    let wrong = wrongly_caught(|_| checks());
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn without_a_fault_every_check_passes() {
    for name in checks() {
        assert_eq!(run(name, None), Vec::<String>::new(), "{name}");
    }
}

#[test]
fn faults_are_planted_in_the_simulations_meant_and_in_no_others() {
    let exact = solution("axis-aligned-1d", &[]);
    let run = || study(None, &exact, &Case::default(), &Sweep::Cells(vec![8])).rows[0].errors;
    let (sound, faulty) = (run(), fault::with(Fault::NoBodyForce, run));
    assert_ne!(sound, faulty);
    assert_eq!(
        fault::with(Fault::NoBodyForce, || thread::scope(|s| s.spawn(run).join().unwrap())),
        sound
    );
    let panicking = || fault::with(Fault::NoBodyForce, || panic!("on purpose"));
    assert!(std::panic::catch_unwind(panicking).is_err());
    assert_eq!(run(), sound);
}

#[test]
fn every_fault_and_every_check_is_listed_once() {
    for (k, (name, fault)) in FAULTS.iter().enumerate() {
        assert_eq!(*fault as usize, k, "{name}: the faults outside of laws, in their order");
    }
    let mut names = FAULTS.map(|(name, _)| name);
    names.sort_unstable();
    assert_eq!(DATA.caught_by.keys().collect::<Vec<_>>(), names);
    let checks = checks();
    for (k, check) in checks.iter().enumerate() {
        assert!(!checks[..k].contains(check), "the studies of {check} are in one place");
        let is_used = DATA.caught_by.values().flatten().any(|name| name == check);
        assert!(is_used, "{check} catches no fault");
    }
    // Without this a misspelt check would never run.
    for name in DATA.caught_by.values().flatten() {
        assert!(checks.contains(&name.as_str()), "no check is called {name}");
    }
}
