//! Faults planted in the solver and in what drives it, one at a time: each must be caught by the checks that are named
//! beside it, and without a fault all checks pass. Each is a mistake of the kind that published codes carry.
//!
//! The checks are those that users have (`mms converge`, `mms check`) on small grids, and what every scheme has to keep.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use mmsmith_galerkin::{
    Axis, End, Grid as SplineGrid, MassMatrix, Scheme as SplineScheme, TotalLagrangian,
};
use mmsmith_mpm::fault::{self, Fault};
use mmsmith_mpm::{Body, Grid, Material, NoBodyForce, Particles, Settings, Simulation};
use mmsmith_solutions::{AnySolution, CATALOGUE, build};
use mmsmith_verify::{
    Arithmetic, Case, CflSpeed, Composition, Coordinates, Discretized, Integrator, Layout,
    ORDER_TOLERANCE, Placement, Scheme, Shape, Status, Study, Sweep, Total, Transfer, Updated,
    check, converge, expected_in_space, expected_in_time, verdicts,
};
use nalgebra::{Const, DimMin, SMatrix, SVector};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use crate::reference::Reference;

/// The problems that a check finds, with this fault in the solver.
type Check = fn(Option<Fault>) -> Vec<String>;

/// Checks that there are to catch faults with.
const CHECKS: &[(&str, Check)] = &[
    ("agreement", agreement_of_two_solvers),
    ("momentum", momentum_and_free_flight),
    ("energy", energy_of_a_free_body),
    ("fields", fields_against_the_law),
    ("order, 1D", order_in_one_dimension),
    ("order, 2D", order_in_two_dimensions),
    ("known errors", known_errors_of_other_schemes),
    ("known errors, ring", known_errors_on_the_ring),
    ("order in time", order_in_time),
    ("high order, box", high_order_on_a_box),
    ("high order, ring", high_order_on_the_ring),
    ("high order in time", high_order_in_time),
    ("high order, moved sides", high_order_with_moved_sides),
    ("high order, loaded rims", high_order_with_loaded_rims),
    ("high order, vortex", high_order_in_the_vortex),
    ("high order, shell", high_order_on_the_shell),
    ("fitted ring", order_on_the_fitted_ring),
];

/// Faults, and the checks that must catch them.
const FAULTS: &[(Fault, &[&str])] = &[
    (
        Fault::CauchyStress,
        &[
            "agreement",
            "energy",
            "order, 1D",
            "order, 2D",
            "known errors",
            "known errors, ring",
            "order in time",
            "high order, box",
            "high order, ring",
            "high order in time",
            "high order, moved sides",
            "high order, loaded rims",
            "high order, shell",
            "fitted ring",
        ],
    ),
    (
        Fault::NormalStressSign,
        &[
            "agreement",
            "energy",
            "order, 1D",
            "order, 2D",
            "known errors",
            "known errors, ring",
            "order in time",
            "high order, box",
            "high order, ring",
            "high order in time",
            "high order, moved sides",
            "high order, loaded rims",
            "high order, vortex",
            "high order, shell",
            "fitted ring",
        ],
    ),
    (
        Fault::ShearStressSign,
        &[
            "agreement",
            "energy",
            "order, 2D",
            "known errors",
            "known errors, ring",
            "high order, box",
            "high order, ring",
            "high order, moved sides",
            "high order, loaded rims",
            "high order, vortex",
            "high order, shell",
            "fitted ring",
        ],
    ),
    (
        Fault::NominalStress,
        &["agreement", "energy", "known errors, ring", "high order, moved sides"],
    ),
    (
        Fault::LinearLogarithm,
        &[
            "agreement",
            "energy",
            "fields",
            "order, 1D",
            "order, 2D",
            "known errors",
            "high order, box",
            "high order in time",
            "high order, moved sides",
            "high order, loaded rims",
            "high order, shell",
        ],
    ),
    (Fault::TransposedLaw, &["energy", "fields", "high order, moved sides"]),
    (
        Fault::LambdaForMu,
        &[
            "fields",
            "order, 1D",
            "order, 2D",
            "known errors",
            "known errors, ring",
            "high order, box",
            "high order, ring",
            "high order in time",
            "high order, moved sides",
            "high order, loaded rims",
            "high order, vortex",
            "high order, shell",
            "fitted ring",
        ],
    ),
    (
        Fault::StiffnessOff,
        &[
            "fields",
            "high order, box",
            "high order, ring",
            "high order in time",
            "high order, loaded rims",
            "high order, shell",
        ],
    ),
    (
        Fault::NoBodyForce,
        &[
            "agreement",
            "momentum",
            "order, 1D",
            "order, 2D",
            "known errors",
            "known errors, ring",
            "high order, box",
            "high order, ring",
            "high order in time",
            "high order, moved sides",
            "high order, loaded rims",
            "high order, vortex",
            "high order, shell",
            "fitted ring",
        ],
    ),
    (
        Fault::LateBodyForce,
        &[
            "agreement",
            "order, 1D",
            "order, 2D",
            "known errors",
            "known errors, ring",
            "fitted ring",
        ],
    ),
    (
        Fault::BodyForceAtCurrentPosition,
        &[
            "agreement",
            "order, 1D",
            "order, 2D",
            "known errors",
            "known errors, ring",
            "fitted ring",
        ],
    ),
    (
        Fault::BodyForcePerVolume,
        &[
            "agreement",
            "momentum",
            "order, 1D",
            "order, 2D",
            "known errors",
            "known errors, ring",
            "fitted ring",
        ],
    ),
    (
        Fault::OwnVelocity,
        &[
            "agreement",
            "order, 1D",
            "order, 2D",
            "known errors",
            "known errors, ring",
            "order in time",
        ],
    ),
    (Fault::PositionOff, &["agreement", "momentum"]),
    (
        Fault::WallsKeepAcceleration,
        &[
            "agreement",
            "order, 1D",
            "order, 2D",
            "known errors",
            "known errors, ring",
            "order in time",
            "fitted ring",
        ],
    ),
    (
        Fault::WallsKeepVelocity,
        &[
            "agreement",
            "order, 1D",
            "order, 2D",
            "known errors",
            "known errors, ring",
            "order in time",
            "fitted ring",
        ],
    ),
    (Fault::GhostMassLost, &["agreement"]),
    (
        Fault::NoHalfStep,
        &[
            "agreement",
            "order, 1D",
            "order, 2D",
            "known errors",
            "known errors, ring",
            "fitted ring",
        ],
    ),
    (
        Fault::AdditiveStretch,
        &[
            "agreement",
            "order, 1D",
            "order, 2D",
            "known errors",
            "known errors, ring",
            "fitted ring",
        ],
    ),
    (Fault::GradientTransposed, &["agreement", "known errors, ring"]),
    (Fault::SizeFromJacobian, &["agreement", "order, 2D", "known errors"]),
    (
        Fault::WeightsOfNewPosition,
        &["agreement", "momentum", "order, 1D", "order, 2D", "known errors", "known errors, ring"],
    ),
    (
        Fault::LastNodeSkipped,
        &["agreement", "momentum", "order, 1D", "order, 2D", "known errors", "order in time"],
    ),
    (Fault::SinglePrecision, &["agreement", "momentum"]),
    (
        Fault::PicForFlip,
        &[
            "agreement",
            "order, 1D",
            "order, 2D",
            "known errors",
            "known errors, ring",
            "order in time",
        ],
    ),
    (Fault::NoReprojection, &["agreement", "known errors"]),
    (Fault::StressOfOldStretch, &["agreement", "known errors", "order in time"]),
    (
        Fault::MassBandDropped,
        &[
            "energy",
            "high order, box",
            "high order, ring",
            "high order in time",
            "high order, moved sides",
            "high order, loaded rims",
            "high order, vortex",
            "high order, shell",
        ],
    ),
    (
        Fault::WeightOff,
        &[
            "high order, box",
            "high order, ring",
            "high order in time",
            "high order, moved sides",
            "high order, loaded rims",
            "high order, shell",
        ],
    ),
    (
        Fault::StageOff,
        &[
            "energy",
            "high order, box",
            "high order, ring",
            "high order in time",
            "high order, loaded rims",
            "high order, shell",
        ],
    ),
    (
        Fault::StagesAtOneTime,
        &[
            "high order, box",
            "high order, ring",
            "high order in time",
            "high order, moved sides",
            "high order, loaded rims",
            "high order, vortex",
            "high order, shell",
        ],
    ),
    (
        Fault::MirrorSign,
        &[
            "high order, box",
            "high order, ring",
            "high order in time",
            "high order, loaded rims",
            "high order, shell",
        ],
    ),
    (
        Fault::HoopStressDropped,
        &[
            "energy",
            "high order, ring",
            "high order, loaded rims",
            "high order, vortex",
            "high order, shell",
        ],
    ),
    (Fault::HoopShearDropped, &["energy", "high order, vortex", "high order, shell"]),
    (Fault::CotangentDropped, &["energy", "high order, shell"]),
    (Fault::TractionSign, &["high order, loaded rims", "high order, shell"]),
    (Fault::BoundaryInertiaDropped, &["high order, moved sides", "high order, shell"]),
    (Fault::LateBoundary, &["high order, moved sides", "high order, shell"]),
    (Fault::CornersStay, &["agreement", "fitted ring"]),
    (Fault::AffinePartDropped, &["agreement", "known errors"]),
    (Fault::XpicSign, &["agreement", "known errors"]),
];

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

/// Different for every particle and component, and far from any regularity.
fn noise(seed: usize) -> f64 {
    (seed as f64 * 12.9898).sin() * 0.5
}

const SOFT: Material<f64> = Material::NeoHookean { lambda: 60.0, mu: 40.0 };

/// The solver and the plain implementation, which share no loop, on a distorted body between walls.
fn agreement_of_two_solvers(fault: Option<Fault>) -> Vec<String> {
    let grid = Grid {
        lower: SVector::zeros(),
        spacing: 0.25,
        cells: [4, 4],
        walls: [[true, true], [true, false]],
    };
    let mut body = Body::lattice(&grid, 2, 2.0, |X: &SVector<f64, 2>| X[1] < 0.7);
    disturb(&mut body.particles, grid.spacing);
    let force = |X: &[SVector<f64, 2>], t: f64, b: &mut [SVector<f64, 2>]| {
        b.iter_mut().zip(X).for_each(|(b, X)| *b = X.map(|x| (3.0 * x + 5.0 * t).sin()));
    };
    let integrators =
        [Integrator::Usf, Integrator::Usl, Integrator::Musl, Integrator::Usavg, Integrator::Cd];
    let by_flip = [Shape::Linear, Shape::Gimp, Shape::Cpdi, Shape::Cpdi2]
        .into_iter()
        .flat_map(|shape| integrators.map(|integrator| (shape, integrator, Transfer::Flip)));
    let others = [Transfer::Pic, Transfer::Apic, Transfer::Xpic(2)]
        .map(|transfer| (Shape::Gimp, Integrator::Usl, transfer));
    let mut problems = Vec::new();
    for (shape, integrator, transfer) in by_flip.chain(others) {
        let settings = Settings {
            shape,
            integrator,
            transfer,
            time_step: 2e-3,
            halve_first_acceleration: integrator == Integrator::Cd,
        };
        let mut sound = Reference::new(grid.clone(), body.clone(), SOFT, settings);
        let mut solver =
            with(fault, || Simulation::new(grid.clone(), body.clone(), SOFT, settings)).unwrap();
        let name = format!("{shape:?} {integrator:?} {transfer}");
        let stopped = (0..10).find_map(|_| {
            sound.step(&force).unwrap();
            solver.step(&force).err()
        });
        if let Some(error) = stopped {
            problems.push(format!("{name}: {error}"));
            continue;
        }
        let (one, two) = (sound.particles(), solver.particles());
        assert_eq!(sound.time(), solver.time());
        let off = |p: usize| {
            (one.x[p] - two.x[p])
                .norm()
                .max(0.01 * (one.v[p] - two.v[p]).norm())
                .max(0.01 * (one.F[p] - two.F[p]).norm())
        };
        let mut off = (0..one.len()).map(off).fold(0.0, f64::max);
        if let (Some(one), Some(two)) = (&sound.body().mesh, solver.mesh()) {
            off = one.x.iter().zip(&two.x).map(|(x, y)| (x - y).norm()).fold(off, f64::max);
        }
        if off.is_nan() || off > 1e-13 {
            problems.push(format!("{name}: {off:.1e}"));
        }
    }
    problems
}

/// Distorts a body and sets it in motion.
fn disturb<const D: usize>(p: &mut Particles<f64, D>, spacing: f64) {
    for k in 0..p.len() {
        p.v[k] = SVector::from_fn(|a, _| 0.5 * noise(7 * k + a));
        p.F[k] += SMatrix::from_fn(|i, j| 0.1 * noise(11 * k + 3 * i + j));
        p.x[k] += SVector::from_fn(|a, _| 0.2 * spacing * noise(13 * k + a));
    }
}

/// Momentum changes by the body force only, and a free body flies straight.
fn momentum_and_free_flight(fault: Option<Fault>) -> Vec<String> {
    let grid = Grid {
        lower: SVector::<f64, 2>::zeros(),
        spacing: 0.125,
        cells: [8, 8],
        walls: [[false; 2]; 2],
    };
    let mut problems = Vec::new();
    for integrator in [Integrator::Usf, Integrator::Usl, Integrator::Musl, Integrator::Cd] {
        let settings = Settings {
            shape: Shape::Gimp,
            integrator,
            transfer: Transfer::Flip,
            time_step: 1e-3,
            halve_first_acceleration: false,
        };
        let inside = |X: &SVector<f64, 2>| X.iter().all(|x| (0.25..0.75).contains(x));
        let body = Particles::lattice(&grid, 2, 2.0, inside);
        let mut thrown = body.clone();
        disturb(&mut thrown, grid.spacing);
        let momentum = |p: &Particles<f64, 2>| -> SVector<f64, 2> {
            p.v.iter().zip(&p.mass).map(|(v, &m)| v * m).sum()
        };
        let before = momentum(&thrown);
        let force = SVector::<f64, 2>::new(1.0, 2.0);
        let b = |_: &[SVector<f64, 2>], _: f64, b: &mut [SVector<f64, 2>]| b.fill(force);
        let mut run =
            with(fault, || Simulation::new(grid.clone(), thrown, SOFT, settings)).unwrap();
        let stopped = (0..5).find_map(|_| run.step(&b).err());
        let expected = before + force * (run.particles().mass.iter().sum::<f64>() * 5e-3);
        let off = (momentum(run.particles()) - expected).norm();
        if stopped.is_some() || off.is_nan() || off > 1e-13 {
            problems.push(format!("momentum, {integrator:?}: {off:.1e}"));
        }

        let mut flying = body;
        flying.v.fill(force);
        let mut run =
            with(fault, || Simulation::new(grid.clone(), flying, SOFT, settings)).unwrap();
        let stopped = (0..100).find_map(|_| run.step(&NoBodyForce).err());
        let p = run.particles();
        let off = (0..p.len()).map(|k| (p.x[k] - p.X[k] - force * 0.1).norm()).fold(0.0, f64::max);
        if stopped.is_some() || off.is_nan() || off > 1e-11 {
            problems.push(format!("free flight, {integrator:?}: {off:.1e}"));
        }
    }
    problems
}

/// Splines in the reference configuration keep the energy of a free body to their order in time.
fn energy_of_a_free_body(fault: Option<Fault>) -> Vec<String> {
    let ends = [End::Free; 2];
    let body = SplineGrid {
        axes: [Axis { lower: 0.0, upper: 1.0, cells: 3, ends }; 2],
        coordinates: Coordinates::Cartesian,
        per_cell: 4,
        layout: Layout::Gauss,
    };
    let radius = Axis { lower: 0.5, upper: 1.0, cells: 3, ends };
    let sector = SplineGrid {
        axes: [radius, Axis { lower: 0.2, upper: 1.4, cells: 4, ends }],
        coordinates: Coordinates::Polar,
        ..body.clone()
    };
    let polar_angle = Axis { lower: 0.7, upper: 1.9, cells: 3, ends };
    let azimuth = Axis { lower: 0.2, upper: 1.1, cells: 2, ends };
    let shell = SplineGrid {
        axes: [Axis { cells: 2, ..radius }, polar_angle, azimuth],
        coordinates: Coordinates::Spherical,
        per_cell: 4,
        layout: Layout::Gauss,
    };
    [
        drift_of_energy("box", fault, &body, 6e-3),
        drift_of_energy("sector", fault, &sector, 1.5e-3),
        drift_of_energy("shell", fault, &shell, 1.5e-3),
    ]
    .concat()
}

fn drift_of_energy<const D: usize>(
    name: &str,
    fault: Option<Fault>,
    grid: &SplineGrid<D>,
    dt: f64,
) -> Vec<String>
where
    Const<D>: DimMin<Const<D>, Output = Const<D>>,
{
    const LAMBDA: f64 = 60.0;
    const MU: f64 = 40.0;
    let energy = |body: &mut TotalLagrangian<D>| -> f64 {
        let p = body.observe();
        let of = |k: usize| {
            let F = p.F[k];
            let log_J = F.determinant().ln();
            let strain = 0.5 * MU * (F.norm_squared() - D as f64 - 2.0 * log_J)
                + 0.5 * LAMBDA * log_J * log_J;
            0.5 * p.mass[k] * p.v[k].norm_squared() + p.volume[k] * strain
        };
        (0..p.len()).map(of).sum()
    };
    let scheme =
        SplineScheme { degree: 3, mass: MassMatrix::Consistent, composition: Composition::Order4 };
    let material = Material::NeoHookean { lambda: LAMBDA, mu: MU };
    let drift = |parts: usize| {
        let step = dt / parts as f64;
        let mut run =
            with(fault, || TotalLagrangian::new(grid.clone(), scheme, material, 2.0, step))
                .unwrap();
        let field = |scale: f64, phase: f64| -> Vec<SVector<f64, D>> {
            let at = |X: &SVector<f64, D>| {
                SVector::from_fn(|a, _| {
                    let place = X.iter().zip([1.5, 2.2, 2.9]).map(|(x, k)| k * x);
                    scale * (phase + a as f64 + place.sum::<f64>()).sin()
                })
            };
            run.positions().iter().map(at).collect()
        };
        let (u, v) = (field(0.05, 0.3), field(0.5, 1.1));
        with(fault, || run.start(&u, &v)).unwrap();
        let before = energy(&mut run);
        for _ in 0..10 * parts {
            if run.step(&NoBodyForce).is_err() {
                return f64::NAN;
            }
        }
        (energy(&mut run) / before - 1.0).abs()
    };
    let (coarse, fine) = (drift(1), drift(2));
    let order = (coarse / fine).log2();
    if order.is_nan() || (order - 4.0).abs() > 0.5 {
        return vec![format!("{name}: drift {coarse:.1e}, {fine:.1e}, order {order:.2}")];
    }
    Vec::new()
}

/// `mms check`: the fields of a motion without symmetry, their stress against the solver's own law.
fn fields_against_the_law(fault: Option<Fault>) -> Vec<String> {
    let report = with(fault, || check(&solution("skew-2d", &[]), 40)).unwrap();
    let failed = report.findings.iter().filter(|f| f.verdict != mmsmith_verify::Verdict::Passed);
    failed.map(|f| format!("{} against {}", f.what, f.against)).collect()
}

/// `mms converge`.
fn study(fault: Option<Fault>, exact: &AnySolution<f64>, case: &Case, cells: &[usize]) -> Study {
    let sweep = Sweep::Cells(cells.to_vec());
    with(fault, || converge(exact, Arithmetic::Double, case, &sweep, &mut |_| ())).unwrap()
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
fn judged(
    verdicts: &mmsmith_verify::PerField<mmsmith_verify::PerNorm<mmsmith_verify::OrderVerdict>>,
) -> Vec<String> {
    let norms = verdicts.iter().flat_map(|(field, verdicts)| {
        verdicts.iter().map(move |(norm, verdict)| (format!("{field} {norm}"), verdict.clone()))
    });
    let is_beyond = |verdict: &mmsmith_verify::OrderVerdict| {
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

fn order_in_one_dimension(fault: Option<Fault>) -> Vec<String> {
    let (exact, case) = (solution("axis-aligned-1d", &[]), Case::default());
    promised(&study(fault, &exact, &case, &[16, 32, 64]), &exact, &case)
}

fn order_in_two_dimensions(fault: Option<Fault>) -> Vec<String> {
    let (exact, case) = (solution("axis-aligned", &[]), Case::default());
    let study = study(fault, &exact, &case, &[8, 16]);
    let mut problems = promised(&study, &exact, &case);
    problems.extend(beside(&study, 4.08e-3));
    problems
}

fn known_errors_of_other_schemes(fault: Option<Fault>) -> Vec<String> {
    let exact = solution("axis-aligned", &[]);
    let cd = Integrator::Cd;
    let scheme = |shape, integrator, transfer| {
        let scheme = Updated { shape, integrator, transfer, ..Updated::default() };
        Case { scheme: Scheme::Updated(scheme), ..Case::default() }
    };
    let mut problems = Vec::new();
    for (case, known) in [
        (scheme(Shape::Gimp, Integrator::Usl, Transfer::Flip), 1.534e-2),
        (scheme(Shape::Gimp, Integrator::Musl, Transfer::Flip), 1.692e-2),
        (scheme(Shape::Gimp, Integrator::Usf, Transfer::Flip), 2.746e-2),
        (scheme(Shape::Ugimp, cd, Transfer::Flip), 1.790e-2),
        (scheme(Shape::Gimp, cd, Transfer::Apic), 7.499e-3),
        (scheme(Shape::Gimp, cd, Transfer::Xpic(2)), 1.577e-2),
    ] {
        problems.extend(beside(&study(fault, &exact, &case, &[8]), known));
    }
    problems
}

fn known_errors_on_the_ring(fault: Option<Fault>) -> Vec<String> {
    beside(&study(fault, &solution("ring", &[]), &Case::default(), &[16]), 3.649e-3)
}

/// By differences between time steps on one grid.
fn order_in_time(fault: Option<Fault>) -> Vec<String> {
    let exact = solution("axis-aligned-1d", &[]);
    let mut problems = Vec::new();
    for integrator in [Integrator::Usl, Integrator::Musl, Integrator::Usf] {
        let scheme = Updated { integrator, ..Updated::default() };
        let case = Case { scheme: Scheme::Updated(scheme), cells: 16, ..Case::default() };
        let cfls = [0.4, 0.2, 0.1];
        let measure = || {
            let case = Discretized::new(&exact, Arithmetic::Double, &case)?;
            case.differences(&cfls, &mut |_| ()).map_err(|error| error.cause)
        };
        let study = with(fault, measure).unwrap();
        let steps: Vec<f64> = study.rows.iter().map(|row| row.dt).collect();
        let ok =
            study.rows.iter().map(|row| (row.status == Status::Ok).then_some(&row.differences));
        let verdicts =
            verdicts(&steps, &ok.collect::<Vec<_>>(), &expected_in_time(&case), ORDER_TOLERANCE);
        problems.extend(judged(&verdicts).into_iter().map(|p| format!("{integrator:?} {p}")));
    }
    problems
}

/// Splines between walls.
fn total(degree: usize, composition: Composition) -> Case {
    with_scheme(Total { composition, ..Total::of_degree(degree) })
}

/// Cubic splines with Gauss points, and what is usual with them.
fn cubic(coordinates: Coordinates) -> Case {
    let composition = Composition::Order4;
    let scheme = Total { composition, layout: Layout::Gauss, coordinates, ..Total::of_degree(3) };
    Case { per_cell: 4, cfl: 0.2, ..with_scheme(scheme) }
}

fn with_scheme(scheme: Total) -> Case {
    Case { scheme: Scheme::Total(scheme), cfl_speed: CflSpeed::PWave, ..Case::default() }
}

/// Errors and orders as reached by an independent implementation.
fn reached(study: &Study, amplitude: f64, reference: &[f64], order: f64) -> Vec<String> {
    let mut problems = Vec::new();
    for (row, reference) in study.rows.iter().zip(reference) {
        let relative = row.errors.u.linf / amplitude;
        if row.status != Status::Ok || relative.is_nan() || relative > 2.0 * reference {
            problems.push(format!("{} cells: {relative:.1e}, {}", row.cells, row.status));
        }
    }
    for found in &study.orders.u.linf.local {
        if found.is_none_or(|found| found < order) {
            problems.push(format!("order {found:.2?}"));
        }
    }
    problems
}

fn high_order_on_a_box(fault: Option<Fault>) -> Vec<String> {
    let line = solution("axis-aligned-1d", &[("A", 0.05)]);
    let square = solution("axis-aligned", &[("A", 0.05)]);
    let cubic = total(3, Composition::Order4);
    let mut problems =
        reached(&study(fault, &line, &cubic, &[8, 16, 32]), 0.05, &[4.4e-5, 2.6e-6, 1.6e-7], 3.8);
    let quintic = total(5, Composition::Order6);
    problems.extend(reached(
        &study(fault, &square, &quintic, &[8, 16]),
        0.05,
        &[2.5e-7, 3.4e-9],
        5.7,
    ));
    problems
}

fn high_order_on_the_ring(fault: Option<Fault>) -> Vec<String> {
    let ring = solution("ring", &[("Ri", 0.4), ("Ro", 0.6)]);
    let case = cubic(Coordinates::Polar);
    reached(&study(fault, &ring, &case, &[8, 16]), 0.1, &[1.2e-5, 5.4e-7], 3.8)
}

/// A square whose sides move as the solution prescribes, without any symmetry.
fn high_order_with_moved_sides(fault: Option<Fault>) -> Vec<String> {
    let skew = solution("skew-2d", &[]);
    let case = Case { cfl: 0.3, periods: 0.5, ..cubic(Coordinates::Cartesian) };
    reached(&study(fault, &skew, &case, &[4, 8]), 0.1, &[5.8e-4, 2.9e-5], 3.8)
}

/// The ring with lateral contraction, under the tractions that the solution prescribes.
fn high_order_with_loaded_rims(fault: Option<Fault>) -> Vec<String> {
    let ring = solution("ring-nu", &[("Ri", 0.4), ("Ro", 0.6)]);
    let case = cubic(Coordinates::Polar);
    reached(&study(fault, &ring, &case, &[8, 16]), 0.1, &[1.3e-7, 7.8e-9], 3.8)
}

/// A whole ring whose circles turn: shear in polar coordinates, and an axis without ends.
fn high_order_in_the_vortex(fault: Option<Fault>) -> Vec<String> {
    let vortex = solution("vortex", &[("A", 0.2)]);
    let case = Case { periods: 0.1, ..cubic(Coordinates::Polar) };
    reached(&study(fault, &vortex, &case, &[8, 16]), 0.2, &[1.6e-3, 1.4e-4], 3.4)
}

/// A spherical shell under the tractions that the solution prescribes.
fn high_order_on_the_shell(fault: Option<Fault>) -> Vec<String> {
    let shell = solution("sphere-shell", &[]);
    let case = Case { cfl: 0.291, periods: 0.5, ..cubic(Coordinates::Spherical) };
    reached(&study(fault, &shell, &case, &[4, 8]), 0.05, &[4.3e-6, 2.7e-7], 3.8)
}

/// On one grid whose error in space is far below that of time: the order of the composition.
fn high_order_in_time(fault: Option<Fault>) -> Vec<String> {
    let line = solution("axis-aligned-1d", &[("A", 0.05)]);
    let case = Case { cells: 32, ..total(5, Composition::Order4) };
    let sweep = Sweep::Cfls(vec![0.8, 0.4]);
    let study =
        with(fault, || converge(&line, Arithmetic::Double, &case, &sweep, &mut |_| ())).unwrap();
    let order = study.orders.u.linf.local[0];
    let off = order.is_none_or(|order| (order - 4.0).abs() > 0.2);
    off.then(|| format!("order {order:.2?}")).into_iter().collect()
}

fn order_on_the_fitted_ring(fault: Option<Fault>) -> Vec<String> {
    let exact = solution("ring", &[]);
    let (shape, placement) = (Shape::Cpdi2, Placement::BodyFitted);
    let scheme = Updated { shape, placement, ..Updated::default() };
    let case = Case { scheme: Scheme::Updated(scheme), periods: 0.5, ..Case::default() };
    promised(&study(fault, &exact, &case, &[8, 16]), &exact, &case)
}

/// The checks among `names` that catch a fault, in their order, with the first problem that each found.
fn caught(fault: Fault, names: &[&str]) -> Vec<(&'static str, String)> {
    let asked = CHECKS.iter().filter(|(name, _)| names.contains(name));
    asked.filter_map(|(name, check)| Some((*name, check(Some(fault)).first()?.clone()))).collect()
}

/// The faults that are not caught by exactly the checks that they should be, where these may use those of `names_of`.
fn wrongly_caught(names_of: fn(&'static [&'static str]) -> Vec<&'static str>) -> Vec<String> {
    // Threads of their own: a fault is planted on the thread that sets a simulation up.
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        while let Some((fault, names)) = FAULTS.get(next.fetch_add(1, Ordering::Relaxed)) {
            done.push((*fault, caught(*fault, &names_of(names))));
        }
        done
    };
    let mut outcomes: Vec<_> = thread::scope(|scope| {
        let threads: Vec<_> = (0..2).map(|_| scope.spawn(work)).collect();
        threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect()
    });
    let place = |fault| FAULTS.iter().position(|(known, _)| *known == fault);
    outcomes.sort_by_key(|(fault, _)| place(*fault));
    let mut wrong = Vec::new();
    for ((fault, caught), (_, expected)) in outcomes.into_iter().zip(FAULTS) {
        println!("{fault:?}");
        for (name, problem) in &caught {
            println!("    {name}: {problem}");
        }
        let names: Vec<_> = caught.iter().map(|(name, _)| *name).collect();
        if names.is_empty() || names != *expected {
            wrong.push(format!("{fault:?} is caught by {names:?}, not by {expected:?}"));
        }
    }
    wrong
}

#[test]
fn every_fault_in_the_solver_is_caught_by_the_checks_named() {
    let wrong = wrongly_caught(<[_]>::to_vec);
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
#[ignore = "takes a minute; run by .ci/long"]
fn every_fault_in_the_solver_is_caught_by_no_other_checks() {
    let wrong = wrongly_caught(|_| CHECKS.iter().map(|(name, _)| *name).collect());
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn without_a_fault_every_check_passes() {
    for (name, check) in CHECKS {
        assert_eq!(check(None), Vec::<String>::new(), "{name}");
    }
}

#[test]
fn faults_are_planted_in_the_simulations_meant_and_in_no_others() {
    let exact = solution("axis-aligned-1d", &[]);
    let run = || study(None, &exact, &Case::default(), &[8]).rows[0].errors;
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

/// Faults in laws, after these, are in `planted_law_faults.rs`.
#[test]
fn every_fault_is_listed_once() {
    assert_eq!(
        FAULTS.len(),
        Fault::XpicSign as usize + 1,
        "the last fault outside of laws is the last of the list"
    );
    for (k, (fault, _)) in FAULTS.iter().enumerate() {
        assert_eq!(*fault as usize, k, "{fault:?}");
    }
}
