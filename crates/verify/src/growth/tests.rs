use mmsmith_galerkin::{Composition, MassMatrix, SetUp};
use mmsmith_mpm::{BodyForce, Particles, Solver};
use mmsmith_runtime::BodyForceAtPoints;

use super::*;
use crate::total::ExactBoundary;

/// Settings of small runs.
fn coarse(periods: f64, dimension: usize) -> GrowthSettings {
    let (degree, cells) = if dimension == 3 { (2, 4) } else { (3, 8) };
    let (degree, cells) = (Some(degree), Some(cells));
    GrowthSettings { periods, cells, degree, waves: 1, iterations: 0, most_work: None }
}

/// The largest factor, and the cells of its grid, by the difference of two runs of the solver of large deformations, whose first velocities differ by a small disturbance
/// in one wave.
fn by_runs<const D: usize>(exact: &dyn Solution<f64, D>, periods: f64) -> (f64, usize)
where
    f64: Precision<D>,
{
    const SIZE: f64 = 1e-6;
    let settings = coarse(periods, D);
    let (degree, cells) = (settings.degree.unwrap(), settings.cells.unwrap());
    let settings = GrowthSettings { cells: None, ..settings };
    let (grid, cells) = grid(exact, degree, cells, &settings).unwrap();
    let law = law_of_body::<f64, D>(exact).unwrap();
    let mut places = f64::undisturbed(&grid, degree, law.clone(), exact.density()).unwrap();
    let disturbance = disturbance(exact, &grid, places.positions(), 1);
    let largest = disturbance.iter().map(SVector::norm).fold(0.0, f64::max);
    let size = SIZE * exact.wave_speed() / largest;
    // The solver asks for the motion at these places in their order.
    let end = periods * exact.period();
    let steps = 2 * steps(exact, places.as_mut(), periods).unwrap();
    let solver = |size: f64| {
        let at = std::cell::Cell::new(0);
        let motion = |X: &SVector<f64, D>| {
            let place = at.replace(at.get() + 1);
            assert_eq!(places.positions()[place], *X);
            [exact.displacement(X, 0.0), exact.velocity(X, 0.0) + size * disturbance[place]]
        };
        let scheme = mmsmith_galerkin::Scheme {
            degree,
            mass: MassMatrix::Consistent,
            composition: Composition::Order2,
        };
        let set_up = SetUp {
            grid: grid.clone(),
            scheme,
            law: law.clone(),
            density: exact.density(),
            time_step: end / steps as f64,
            motion: &motion,
        };
        f64::total_lagrangian(set_up, Box::new(ExactBoundary::new(exact))).unwrap()
    };
    let mut pair = [solver(size), solver(-size)];
    // Of the velocities that the splines have.
    let first = apart(&mut pair, |particles| &particles.v);
    let force = exact.body_force_at(places.positions());
    let force = At(force);
    let mut most = 0.0_f64;
    for step in 1..=steps {
        pair.iter_mut().for_each(|solver| solver.step(&force).unwrap());
        if step % 8 == 0 || step == steps {
            most = most.max(apart(&mut pair, |particles| &particles.x));
        }
    }
    (most / (first * exact.cell_length() / (4.0 * exact.wave_speed())), cells)
}

/// The exact body force at the points.
struct At<'a, const D: usize>(Box<dyn BodyForceAtPoints<f64, D> + 'a>);

impl<const D: usize> BodyForce<f64, D> for At<'_, D> {
    fn evaluate(&self, first: usize, _: &[SVector<f64, D>], t: f64, b: &mut [SVector<f64, D>]) {
        self.0.evaluate(t, first, b);
    }
}

/// The largest distance of a field of two runs.
fn apart<const D: usize>(
    pair: &mut [Box<dyn Solver<f64, D> + '_>; 2],
    field: impl Fn(&Particles<f64, D>) -> &Vec<SVector<f64, D>>,
) -> f64 {
    let [one, other] = pair.each_mut().map(|solver| field(solver.observe().0).clone());
    one.iter().zip(&other).map(|(x, y)| (x - y).norm()).fold(0.0, f64::max)
}

fn agrees(name: &str, given: &[f64], periods: f64) -> [f64; 2] {
    let exact = mmsmith_solutions::build::<f64>(name, given).unwrap().unwrap();
    let (dimension, (runs, cells)) = match &exact {
        AnySolution::One(s) => (1, by_runs(s.as_ref(), periods)),
        AnySolution::Two(s) => (2, by_runs(s.as_ref(), periods)),
        AnySolution::Three(s) => (3, by_runs(s.as_ref(), periods)),
        _ => unreachable!(),
    };
    let settings = GrowthSettings { cells: Some(cells), ..coarse(periods, dimension) };
    let found = growth(&exact, &settings).unwrap();
    [found.factor, runs]
}

#[test]
fn linearised_growth_is_that_of_two_runs_for_every_solution() {
    for known in mmsmith_solutions::CATALOGUE {
        let exact = mmsmith_solutions::build::<f64>(known.name, &[]).unwrap().unwrap();
        if has_memory(&exact) {
            continue;
        }
        let [linear, runs] = agrees(known.name, &[], 0.25);
        assert!((linear / runs - 1.0).abs() < 0.3, "{}: {linear} {runs}", known.name);
    }
}

/// Where it grows, the two agree as well.
#[test]
fn growth_next_to_incompressibility_is_that_of_two_runs() {
    for (name, given, periods, least) in [
        ("swirl", [0.1, 1e4, 0.4999, 4.0], 0.25, 10.0),
        ("axis-aligned", [0.02, 1e4, 0.4999, 1.0], 0.1, 2.0),
    ] {
        let [linear, runs] = agrees(name, &given, periods);
        assert!(linear > least, "{name}: {linear}");
        assert!((linear / runs - 1.0).abs() < 0.3, "{name}: {linear} {runs}");
    }
}

/// Factors of an independent code: `grow.py`, splines of degree 4 on 12 cells with all components held at the walls.
#[test]
fn factors_are_those_of_another_code() {
    for (given, expected) in [([0.1, 1e4, 0.3, 4.0], 0.50), ([0.02, 1e4, 0.4999, 4.0], 1.4)] {
        let exact = mmsmith_solutions::build::<f64>("swirl", &given).unwrap().unwrap();
        let settings = GrowthSettings {
            periods: 0.25,
            cells: None,
            degree: None,
            waves: 1,
            iterations: 0,
            most_work: None,
        };
        let found = growth(&exact, &settings).unwrap().factor;
        assert!((found / expected - 1.0).abs() < 0.1, "{given:?}: {found}");
    }
}

/// The step backwards is the transpose of the step forwards, so that powers of both settle from below on the largest factor.
#[test]
fn the_worst_disturbance_grows_more_than_waves_do() {
    let exact = mmsmith_solutions::build::<f64>("swirl", &[0.1, 1e4, 0.4999, 4.0]);
    let exact = exact.unwrap().unwrap();
    let settings = GrowthSettings { waves: 2, iterations: 6, ..coarse(0.25, 2) };
    let found = growth(&exact, &settings).unwrap();
    let worst = found.largest.unwrap();
    assert!(found.is_settled);
    for wave in &found.waves {
        assert!(worst.factor_l2 >= wave.grown.factor_l2, "{wave:?}");
    }
    // No factor exceeds what the second gradient of the pressure allows.
    assert!(worst.factor_l2 < found.waves[0].estimate);
}

#[test]
fn motions_that_are_harmless_are_not_looked_at() {
    let swirl =
        |nu: f64| mmsmith_solutions::build::<f64>("swirl", &[0.1, 1e4, nu, 4.0]).unwrap().unwrap();
    assert_eq!(harmful_growth(&swirl(0.3), 1.0), None);
    assert!(harmful_growth(&swirl(0.4999), 0.25).is_some_and(|found| found.factor > 100.0));
}
