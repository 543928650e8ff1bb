//! Energies and momentum of runs over time, against those of the exact motion.

use crate::hand_coded;

use hand_coded::{AxisAligned, Coded, Plane};
use mmsmith_solutions::{AnySolution, Boundary, Condition, Domain, Surface};
use mmsmith_verify::{
    Arithmetic, Case, Extent, Integrator, MOST_MOMENTS, Moment, Outputs, Row, Scheme, Start,
    Status, Total, Updated, energy_drift, run,
};
use nalgebra::{SMatrix, SVector, vector};
use std::f64::consts::PI;

const INTEGRATORS: [Integrator; 4] =
    [Integrator::Cd, Integrator::Usl, Integrator::Usf, Integrator::Musl];

fn scheme(integrator: Integrator) -> Scheme {
    Scheme::Updated(Updated { integrator, ..Updated::default() })
}

fn history<S: Plane>(solution: S, case: &Case) -> (Row, Vec<Moment>) {
    let exact = AnySolution::Two(Box::new(Coded(solution)));
    let mut moments = Vec::new();
    let mut outputs = Outputs {
        progress: &mut |_| (),
        frames: None,
        snapshot: None,
        checkpoints: None,
        history: Some(&mut moments),
        ranks: None,
        traffic: None,
        profile: None,
        until: None,
    };
    let row = run(&exact, Arithmetic::Double, case, &mut outputs).expect("a case that can be run");
    (row, moments)
}

/// The largest energy gained and lost.
fn extremes(history: &[Moment]) -> (f64, f64) {
    let drift = energy_drift(history);
    drift.iter().fold((0.0, 0.0), |(most, least), &(_, d)| (d.max(most), d.min(least)))
}

/// A free ring that flies at a constant acceleration.
#[derive(Clone)]
struct Flight;

impl Flight {
    const VELOCITY: SVector<f64, 2> = vector![12.0, -5.0];
    const ACCELERATION: SVector<f64, 2> = vector![-400.0, 700.0];
    const CONDITIONS: [Boundary; 2] = [
        Boundary { surface: Surface::Inner, condition: Condition::TractionFree },
        Boundary { surface: Surface::Outer, condition: Condition::TractionFree },
    ];
}

impl Plane for Flight {
    fn motion(&self, _: &SVector<f64, 2>, t: f64) -> [SVector<f64, 2>; 3] {
        let (v, a) = (Self::VELOCITY, Self::ACCELERATION);
        [v * t + a * (0.5 * t * t), v + a * t, a]
    }
    fn gradient(&self, _: &SVector<f64, 2>, _: f64) -> SMatrix<f64, 2, 2> {
        SMatrix::zeros()
    }
    fn stress(&self, _: &SVector<f64, 2>, _: f64) -> SMatrix<f64, 2, 2> {
        SMatrix::zeros()
    }
    fn force(&self, _: &SVector<f64, 2>, _: f64) -> SVector<f64, 2> {
        Self::ACCELERATION
    }
    fn shape(&self) -> Domain<f64, 2> {
        Domain::Annulus { inner: 0.5, outer: 1.0 }
    }
    fn conditions(&self) -> &'static [Boundary] {
        &Self::CONDITIONS
    }
    fn constants(&self) -> [f64; 3] {
        [1e4, 0.3, 1.0]
    }
}

#[test]
fn a_body_that_only_flies_gains_and_loses_nothing() {
    for integrator in INTEGRATORS {
        let extent = Some(Extent::Full);
        let case = Case { scheme: scheme(integrator), extent, cells: 8, ..Case::default() };
        let (row, history) = history(Flight, &case);
        assert_eq!(row.status, Status::Ok, "{integrator:?}");
        let mass = history[0].exact.energy() / (0.5 * Flight::VELOCITY.norm_squared());
        assert!((mass / (0.75 * PI) - 1.0).abs() < 0.1, "{mass}");
        // It flies through several cells, and slows down to a part of its energy.
        let last = &history[history.len() - 1].exact;
        assert!(last.energy() < 0.7 * history[0].exact.energy());
        let (gained, lost) = extremes(&history);
        assert!(gained.max(-lost) < 1e-10, "{integrator:?}: {gained:e} {lost:e}");
        for Moment { velocity_time, computed, exact, .. } in &history {
            let expected = (Flight::VELOCITY + Flight::ACCELERATION * *velocity_time) * mass;
            for axis in 0..2 {
                assert!((exact.momentum[axis] - expected[axis]).abs() < 1e-9);
                assert!((computed.momentum[axis] - expected[axis]).abs() < 1e-8, "{integrator:?}");
            }
        }
    }
}

#[test]
fn what_does_not_move_has_no_energy_and_no_drift() {
    let rest = AxisAligned { A: 0.0, ..AxisAligned::default() };
    for integrator in INTEGRATORS {
        let case = Case { scheme: scheme(integrator), cells: 6, ..Case::default() };
        let (_, history) = history(rest.clone(), &case);
        assert!(history.len() > 10);
        assert!(energy_drift(&history).iter().all(|&(_, drift)| drift == 0.0), "{integrator:?}");
        assert!(history.iter().all(|m| m.computed == m.exact && m.u.linf == 0.0), "{integrator:?}");
    }
}

#[test]
fn exact_sums_are_those_of_the_formulas_at_the_scheme_s_own_times() {
    let case = Case { cells: 16, ..Case::default() };
    let early = Scheme::Updated(Updated { start: Start::Exact, ..Updated::default() });
    for scheme in [case.scheme, early, Scheme::Total(Total::of_degree(3))] {
        let case = Case { scheme, ..case };
        let is_updated = scheme.updated().is_some();
        let (row, history) = history(AxisAligned::default(), &case);
        assert_eq!(history.len() as u64, row.steps + 1);
        let w = 100.0 * PI;
        for moment in &history {
            let lag = moment.time - moment.velocity_time;
            let lags = is_updated && (moment.step > 0 || scheme == early);
            let expected = if lags { 0.5 * row.dt } else { 0.0 };
            assert!((lag - expected).abs() < 1e-15, "{case:?}: {lag}");
            // `A w (-sin(pi X) sin(w t), sin(pi Y) cos(w t))` has the mean square `(A w)^2 / 2`, which the midpoint rule sums
            // exactly, and the means `2/pi` of the sines but for a term in h^2.
            let (sin, cos) = (w * moment.velocity_time).sin_cos();
            let kinetic = 0.25 * (0.1 * w).powi(2);
            assert!((moment.exact.kinetic_energy / kinetic - 1.0).abs() < 1e-12);
            for (found, phase) in moment.exact.momentum.iter().zip([-sin, cos]) {
                let expected = 0.1 * w * phase * 2.0 / PI;
                assert!((found - expected).abs() < 2e-3 * 0.1 * w, "{found} {expected}");
            }
        }
        // Both components' strains are those of `A pi cos(pi X)` at one phase each: where one is zero the other has all.
        let largest = history.iter().map(|m| m.exact.strain_energy).fold(0.0, f64::max);
        let small = 0.25 * (5769.23 + 2.0 * 3846.15) * (0.1 * PI).powi(2);
        assert!((0.9..1.5).contains(&(largest / small)), "{largest} {small}");
        let first = &history[0];
        let start = first.exact.strain_energy / first.computed.strain_energy;
        // Splines do not hold a sine exactly.
        let near = if is_updated { 1e-12 } else { 1e-5 };
        assert!((start - 1.0).abs() < near, "{start}");
    }
}

#[test]
fn moments_are_at_most_a_thousand_and_the_same_for_any_number_of_threads() {
    let case = Case { cells: 24, periods: 3.0, cfl: 0.1, ..Case::default() };
    let of = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| history(AxisAligned::default(), &case))
    };
    let (row, one) = of(1);
    assert!(
        row.steps > 2 * MOST_MOMENTS / 2 && one.len() as u64 == MOST_MOMENTS.min(row.steps + 1)
    );
    assert_eq!((one[0].step, one[one.len() - 1].step), (0, row.steps));
    assert!(one.windows(2).all(|w| (1..=3).contains(&(w[1].step - w[0].step))));
    // 2304 particles, in five groups.
    assert_eq!(one, of(3).1);
}

#[test]
fn a_run_that_breaks_down_has_its_history_until_then() {
    let (row, history) = history(AxisAligned::default(), &Case { cfl: 2.0, ..Case::default() });
    assert_ne!(row.status, Status::Ok);
    assert!(!history.is_empty() && (history[history.len() - 1].step) < row.steps);
}

/// The mean drift of energy in each of ten periods.
fn means(integrator: Integrator) -> Vec<f64> {
    let case = Case { scheme: scheme(integrator), cells: 12, periods: 10.0, ..Case::default() };
    let (row, history) = history(AxisAligned::default(), &case);
    // With so much energy the error exceeds the motion in the end.
    assert!(
        row.status == Status::Ok || row.status.is_not_judged(),
        "{integrator:?}: {}",
        row.status
    );
    let drift = energy_drift(&history);
    const PERIOD: f64 = 0.02;
    let of = |period: usize| {
        let range = period as f64 * PERIOD..(period + 1) as f64 * PERIOD;
        let own: Vec<f64> =
            drift.iter().filter(|point| range.contains(&point.0)).map(|point| point.1).collect();
        own.iter().sum::<f64>() / own.len() as f64
    };
    (0..10).map(of).collect()
}

#[test]
fn usf_gains_energy_in_every_period_and_centred_differences_and_usl_do_not() {
    let usf = means(Integrator::Usf);
    assert!(usf.windows(2).all(|pair| pair[1] > pair[0] + 0.1), "{usf:?}");
    assert!(usf[9] > 3.0, "{usf:?}");
    // They take up a share that belongs to the grid, not to the time step, and keep it: 16 % on 12 cells.
    for integrator in [Integrator::Cd, Integrator::Usl] {
        let means = means(integrator);
        assert!(means.iter().all(|mean| mean.abs() < 0.2), "{integrator:?} {means:?}");
        let late = (means[4] - means[9]).abs();
        assert!(late < 0.01, "{integrator:?} {means:?}");
    }
}
