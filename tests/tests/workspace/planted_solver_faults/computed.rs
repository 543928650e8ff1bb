//! Laws that every scheme has to keep, and agreement with a plain implementation: checks of the solver that are no study.

use mmsmith_galerkin::{
    Axis, End, Grid as SplineGrid, MassMatrix, Scheme as SplineScheme, TotalLagrangian,
};
use mmsmith_mpm::fault::Fault;
use mmsmith_mpm::{Body, Grid, Material, NoBodyForce, Particles, Settings, Simulation};
use mmsmith_verify::{
    Case, Composition, Coordinates, Integrator, Layout, Shape, StaticCase, StaticProblem, Total,
    Transfer, Verdict, check,
};
use nalgebra::{Const, DimMin, SMatrix, SVector};
use std::sync::LazyLock;

use super::{solution, with};
use crate::reference::Reference;

/// Different for every particle and component, and far from any regularity.
fn noise(seed: usize) -> f64 {
    (seed as f64 * 12.9898).sin() * 0.5
}

const SOFT: Material<f64> = Material::NeoHookean { lambda: 60.0, mu: 40.0 };

fn force(X: &[SVector<f64, 2>], t: f64, b: &mut [SVector<f64, 2>]) {
    b.iter_mut().zip(X).for_each(|(b, X)| *b = X.map(|x| (3.0 * x + 5.0 * t).sin()));
}

/// Steps after which the two solvers are compared.
const STEPS: usize = 10;

/// A distorted body between walls, and the plain implementation after those steps, in each scheme.
struct Plain {
    grid: Grid<f64, 2>,
    body: Body<f64, 2>,
    schemes: Vec<(Settings<f64>, Reference<2>)>,
}

/// Without a fault, and thus once for all faults.
static PLAIN: LazyLock<Plain> = LazyLock::new(|| {
    let grid = Grid {
        lower: SVector::zeros(),
        spacing: 0.25,
        cells: [4, 4],
        walls: [[true, true], [true, false]],
    };
    let mut body = Body::lattice(&grid, 2, 2.0, |X: &SVector<f64, 2>| X[1] < 0.7);
    disturb(&mut body.particles, grid.spacing);
    let integrators =
        [Integrator::Usf, Integrator::Usl, Integrator::Musl, Integrator::Usavg, Integrator::Cd];
    let by_flip = [Shape::Linear, Shape::Gimp, Shape::Cpdi, Shape::Cpdi2]
        .into_iter()
        .flat_map(|shape| integrators.map(|integrator| (shape, integrator, Transfer::Flip)));
    let others = [Transfer::Pic, Transfer::Apic, Transfer::Xpic(2)]
        .map(|transfer| (Shape::Gimp, Integrator::Usl, transfer));
    let schemes = by_flip.chain(others).map(|(shape, integrator, transfer)| {
        let settings = Settings {
            shape,
            integrator,
            transfer,
            time_step: 2e-3,
            halve_first_acceleration: integrator == Integrator::Cd,
        };
        let mut plain = Reference::new(grid.clone(), body.clone(), SOFT, settings);
        (0..STEPS).for_each(|_| plain.step(&force).unwrap());
        (settings, plain)
    });
    let schemes = schemes.collect();
    Plain { grid, body, schemes }
});

/// The solver and the plain implementation, which share no loop, on a distorted body between walls.
pub(super) fn agreement_of_two_solvers(fault: Option<Fault>) -> Vec<String> {
    let Plain { grid, body, schemes } = &*PLAIN;
    let mut problems = Vec::new();
    for (settings, sound) in schemes {
        let mut solver =
            with(fault, || Simulation::new(grid.clone(), body.clone(), SOFT, *settings)).unwrap();
        let Settings { shape, integrator, transfer, .. } = settings;
        let name = format!("{shape:?} {integrator:?} {transfer}");
        if let Some(error) = (0..STEPS).find_map(|_| solver.step(&force).err()) {
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
pub(super) fn momentum_and_free_flight(fault: Option<Fault>) -> Vec<String> {
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
pub(super) fn energy_of_a_free_body(fault: Option<Fault>) -> Vec<String> {
    let ends = [End::FREE; 2];
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
pub(super) fn fields_against_the_law(fault: Option<Fault>) -> Vec<String> {
    let report = with(fault, || check(&solution("skew-2d", &[]), 40)).unwrap();
    let failed = report.findings.iter().filter(|f| f.verdict != Verdict::Passed);
    failed.map(|f| format!("{} against {}", f.what, f.against)).collect()
}

/// Newton's method that does not get to equilibrium, or not by the squares of its residuals.
pub(super) fn newton_on_the_way_to_equilibrium(fault: Option<Fault>) -> Vec<String> {
    const QUADRATIC: f64 = 1.8;
    let exact = solution("skew-2d", &[]);
    let total = Total { layout: Layout::Gauss, ..Total::of_degree(2) };
    let case = Case { cells: 6, per_cell: 3, ..Case::default() };
    let case = StaticCase { case, total, load_steps: 1, moment: 0.25 };
    let solve = || StaticProblem::new(&exact, &case)?.solve(&mut |_, _| {});
    let row = with(fault, solve).unwrap();
    let exponent = row.exponent();
    let is_slow = exponent.is_none_or(|exponent| exponent < QUADRATIC);
    let slow = is_slow.then(|| format!("exponent {exponent:.2?}"));
    row.stopped.into_iter().chain(slow).collect()
}
