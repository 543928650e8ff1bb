//! A run on a simulated cluster, a process of which is killed: its last checkpoint is whole, and any number of processes goes on with it.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::hand_coded;
use crate::ranks::timeless;

use hand_coded::{AxisAligned, Coded, Ring};
use mmsmith_ranks::{Failed, Ranks, Schedule, simulated};
use mmsmith_solutions::AnySolution;
use mmsmith_verify::{
    Arithmetic, Case, CheckpointFolder, Checkpoints, Integrator, Moment, Outputs, Row, Scheme,
    Shape, Transfer, Updated, run,
};
use rayon::prelude::*;

/// A row and a history as text, in which what is not a number equals itself.
type Told = (Row, String);

struct Problem {
    exact: AnySolution<f64>,
    case: Case,
    expected: Told,
}

/// One thread, so that a schedule has one course.
fn on_one_thread<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    pool.expect("a thread").install(work)
}

fn told(
    exact: &AnySolution<f64>,
    case: &Case,
    ranks: Option<Arc<dyn Ranks>>,
    checkpoints: Option<&Checkpoints>,
) -> Told {
    let mut history: Vec<Moment> = Vec::new();
    let progress = &mut |_| ();
    let mut outputs =
        Outputs { history: Some(&mut history), ranks, checkpoints, ..Outputs::new(progress) };
    let row = run(exact, Arithmetic::Double, case, &mut outputs);
    let row = row.unwrap_or_else(|error| panic!("{error}"));
    (timeless(row), format!("{history:?}"))
}

impl Problem {
    fn new(exact: AnySolution<f64>, case: Case) -> Self {
        let expected = told(&exact, &case, None, None);
        assert!(expected.0.steps > 8, "{:?}", expected.0);
        Self { exact, case, expected }
    }

    /// One of several processes, from the folder's checkpoint on where there is one.
    fn part(&self, folder: &Path, ranks: Arc<dyn Ranks>) -> Told {
        on_one_thread(|| {
            let folder = match ranks.rank() {
                0 => CheckpointFolder::lock(folder).expect("nobody else has it"),
                _ => CheckpointFolder::of_first(folder),
            };
            let checkpoints = Checkpoints { folder, every: 2, identity: [7; 32], resume: true };
            told(&self.exact, &self.case, Some(ranks), Some(&checkpoints))
        })
    }
}

fn problems() -> Vec<Problem> {
    let scheme = |shape, integrator, transfer| {
        let placement = Updated::default().placement;
        Scheme::Updated(Updated { shape, integrator, transfer, placement, ..Updated::default() })
    };
    let case = |scheme, periods| Case { scheme, cells: 40, periods, ..Case::default() };
    vec![
        Problem::new(
            AnySolution::Two(Box::new(Coded(AxisAligned::default()))),
            case(scheme(Shape::Gimp, Integrator::Cd, Transfer::Flip), 0.1),
        ),
        Problem::new(
            AnySolution::Two(Box::new(Coded(Ring::default()))),
            case(scheme(Shape::Cpdi2, Integrator::Musl, Transfer::Apic), 0.1),
        ),
    ]
}

#[test]
fn a_killed_run_goes_on_from_a_whole_checkpoint_under_every_schedule() {
    let seeds = std::env::var("MMSMITH_SCHEDULES");
    // Each is several runs.
    let seeds = seeds.map_or(9, |text| text.parse::<u64>().expect("a number") / 4);
    let (killed, resumed) = (AtomicU64::new(0), AtomicU64::new(0));
    for (n, problem) in problems().iter().enumerate() {
        let calls = [2, 3, 4].map(|count| {
            let folder = tempfile::tempdir().expect("a folder");
            let schedule = Schedule { seed: 1, kill: None };
            let found = simulated(count, schedule, |ranks| problem.part(folder.path(), ranks));
            assert_eq!(found.failed, None);
            found.calls
        });
        let one = |seed: u64| {
            let mut random = (seed + 1000 * n as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let mut below = |end: u64| {
                random =
                    random.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
                (random >> 33) % end
            };
            let folder = tempfile::tempdir().expect("a folder");
            for attempt in 0.. {
                let count = 2 + below(3) as usize;
                let rank = below(count as u64) as usize;
                let call = 1 + below(calls[count - 2][rank]);
                let kill = (attempt < 2).then_some((rank, call));
                let schedule = Schedule { seed: below(1 << 30), kill };
                let begun = CheckpointFolder::reached(folder.path()).expect("it can be read");
                let found = simulated(count, schedule, |ranks| problem.part(folder.path(), ranks));
                let what =
                    format!("seed {seed}, attempt {attempt}, {count} processes, {schedule:?}");
                resumed.fetch_add(u64::from(begun.is_some()), Ordering::Relaxed);
                match found.failed {
                    None => {}
                    Some(Failed::Killed { rank }) if Some(rank) == kill.map(|kill| kill.0) => {
                        killed.fetch_add(1, Ordering::Relaxed);
                    }
                    Some(failed) => panic!("{what}: {failed}"),
                }
                let is_done = found.failed.is_none();
                for told in found.results.into_iter().flatten() {
                    assert_eq!(told, problem.expected, "{what}, from {begun:?}");
                }
                if is_done {
                    break;
                }
            }
        };
        (0..seeds).into_par_iter().for_each(one);
    }
    let (killed, resumed) = (killed.into_inner(), resumed.into_inner());
    assert!(killed > seeds && resumed > seeds, "{killed} killed, {resumed} resumed");
}
