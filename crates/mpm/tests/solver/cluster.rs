//! A simulated cluster: whatever comes late, the bits are those of one process; whoever is killed, the others are told.

#![allow(clippy::unwrap_used)]

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use mmsmith_mpm::{
    Body, Grid, Integrator, Settings, Shape, Share, Simulation, StepError, Transfer,
};
use mmsmith_ranks::{Failed, Ranks, Schedule, arranged, simulated};
use rayon::prelude::*;

use crate::ranks::{
    Of, body, fly, flying, grid, law, polygon_settings, polygons, share, wide, widened,
};
use crate::schemes;

/// A simulation, and its end with one process.
struct Problem {
    grid: Grid<f64, 2>,
    body: Body<f64, 2>,
    settings: Settings<f64>,
    steps: usize,
    /// Whether the grid can be cut into three parts along axis 0.
    is_wide: bool,
    expected: Vec<Of<2>>,
    error: Option<StepError>,
}

impl Problem {
    fn new(
        (grid, body): (Grid<f64, 2>, Body<f64, 2>),
        settings: Settings<f64>,
        steps: usize,
    ) -> Self {
        let mut alone = Simulation::new(grid.clone(), body.clone(), law(), settings).unwrap();
        let (expected, error, _) = fly(&mut alone, steps);
        let is_wide = grid.cells[0] >= 3 * 64;
        Self { grid, body, settings, steps, is_wide, expected, error }
    }

    /// The processes, along both axes where the grid is wide.
    fn arranged(&self, ranks: Arc<dyn Ranks>) -> Arc<dyn Ranks> {
        match ranks.count() {
            3 if self.is_wide => arranged(ranks, vec![3, 1]),
            count if self.is_wide && count % 2 == 0 => arranged(ranks, vec![2, count / 2]),
            _ => ranks,
        }
    }

    /// The particles and the error of one of several processes.
    fn part(&self, ranks: Arc<dyn Ranks>) -> (Vec<Of<2>>, Option<StepError>) {
        // One thread, so that a schedule has one course.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        pool.install(|| {
            let (body, ids) = share(&self.body, &*ranks);
            let share = Share { ranks: self.arranged(ranks), ids };
            let mut part =
                Simulation::shared_out(self.grid.clone(), body, share, law(), self.settings)
                    .unwrap();
            let (particles, error, _) = fly(&mut part, self.steps);
            (particles, error)
        })
    }
}

/// Schemes of every kind that fly from process to process, bodies with light nodes and shared corners, and one that turns inside out.
fn problems() -> Vec<Problem> {
    let schemes = schemes::schemes().map(flying).step_by(7).map(|settings| {
        let body = body::<2>(30.0, settings.transfer == Transfer::Flip);
        Problem::new((grid(), body), settings, 9)
    });
    let flying_polygons = polygon_settings()
        .step_by(4)
        .map(|settings| Problem::new(polygons::<2>(50.0), settings, 8));
    let fails = Settings {
        time_step: 1.0 / 16.0,
        halve_first_acceleration: false,
        ..schemes::settings(Shape::Gimp, Integrator::Usf, Transfer::Flip)
    };
    let fails = Problem::new((grid(), body::<2>(2.0, true)), fails, 40);
    assert!(fails.error.is_some());
    let side_by_side = schemes::schemes()
        .map(flying)
        .step_by(23)
        .map(|settings| Problem::new(wide(settings.transfer == Transfer::Flip), settings, 9));
    let around = polygon_settings()
        .step_by(13)
        .map(|settings| Problem::new(widened(polygons::<2>(50.0), &[84]), settings, 8));
    schemes.chain(flying_polygons).chain([fails]).chain(side_by_side).chain(around).collect()
}

/// As many numbers as the variable of the environment says, in `.ci/long`, or else `few`.
fn seeds(few: u64) -> u64 {
    std::env::var("MMSMITH_SCHEDULES").map_or(few, |text| text.parse().unwrap())
}

#[test]
fn every_schedule_has_the_bits_of_one_process_or_names_who_was_killed() {
    let problems = problems();
    let (killed, late) = (AtomicU64::new(0), AtomicU64::new(0));
    let one = |seed: u64| {
        let problem = &problems[seed as usize % problems.len()];
        let count = 2 + seed as usize / problems.len() % 4;
        // Any other number: half of them come to their end before.
        let call = seed.wrapping_mul(0x9e37_79b9) % 251;
        let kill = (seed % 4 == 1 && call > 0).then_some((seed as usize / 4 % count, call));
        let found = simulated(count, Schedule { seed, kill }, |ranks| problem.part(ranks));
        let what = format!("seed {seed}, {count} processes, {kill:?}, {:?}", problem.settings);
        match &found.failed {
            None => {}
            Some(Failed::Killed { rank }) if Some(*rank) == kill.map(|kill| kill.0) => {
                killed.fetch_add(1, Ordering::Relaxed);
            }
            Some(failed) => panic!("{what}: {failed}"),
        }
        assert!(found.failed.is_some() || found.results.iter().all(Option::is_some), "{what}");
        late.fetch_add(found.results.iter().flatten().count() as u64, Ordering::Relaxed);
        let is_whole = found.failed.is_none();
        let (particles, errors): (Vec<_>, Vec<_>) = found.results.into_iter().flatten().unzip();
        assert!(errors.iter().all(|error| *error == problem.error), "{what}: {errors:?}");
        let mut all: Vec<Of<2>> = particles.concat();
        all.sort_by_key(|of| of.0);
        assert!(!is_whole || all.len() == problem.expected.len(), "{what}");
        // As text: what is not a number equals itself.
        let differs =
            |of: &&Of<2>| format!("{of:?}") != format!("{:?}", problem.expected[of.0 as usize]);
        assert_eq!(all.iter().find(differs), None, "{what}");
    };
    let seeds = seeds(240);
    (0..seeds).into_par_iter().for_each(one);
    let (killed, late) = (killed.into_inner(), late.into_inner());
    assert!(killed > seeds / 20 && late > seeds, "{killed} killed, {late} results");
}
