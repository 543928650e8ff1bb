use std::cell::{Cell, RefCell};

use mmsmith_galerkin::Coordinates;
use mmsmith_measure::norms::{PerField, PerNorm};
use proptest::prelude::*;

use mmsmith_mpm::Shape;

use super::effects::{LEAST_TIMED_S, MOST_PAIRS};
use super::sweep::neighbours;
use super::*;
use crate::run::Status;

/// A machine whose errors and times are formulas; its clock goes on by the times.
struct Formula {
    now: Cell<f64>,
    runs: RefCell<Vec<Setting>>,
    /// By how much longer everything takes than it says of its steps.
    slow: f64,
}

impl Formula {
    fn order(setting: &Setting) -> f64 {
        setting.case.scheme.total().map_or(2.0, |total| total.degree as f64 + 1.0)
    }

    fn plan(setting: &Setting) -> Option<Plan> {
        let total = setting.case.scheme.total();
        let is_tube = total.is_some_and(|own| own.coordinates == Coordinates::Cylindrical);
        let cells = setting.case.cells;
        // Every third grid does not fit, and none about an axis.
        (!is_tube && (cells % 3 != 1 || cells == 4 || cells == 16)).then(|| {
            let cells = setting.case.cells as f64;
            let steps = (2.0 * cells / setting.case.cfl).ceil() as u64;
            let particles = (cells * setting.case.per_cell as f64).powi(2);
            let bytes = 300.0 * particles;
            Plan { steps, particles, bytes, extent: None, round_off: 0.0 }
        })
    }

    fn time(&self, setting: &Setting) -> f64 {
        let plan = Self::plan(setting).unwrap();
        let each = if setting.case.scheme.updated().is_some() { 1e-7 } else { 1e-6 };
        plan.steps as f64 * (1e-6 + plan.particles * each) / setting.threads as f64
    }

    fn run(&self, setting: &Setting) -> Row {
        let plan = Self::plan(setting).unwrap();
        let wall_s = self.time(setting);
        self.now.set(self.now.get() + self.slow * wall_s);
        self.runs.borrow_mut().push(*setting);
        let floor = if setting.single { 1e-4 } else { 1e-13 };
        let error = (setting.case.cells as f64).powf(-Self::order(setting)) + floor;
        let norms = PerNorm { linf: error, l2: error, l1: error };
        let is_unstable = setting.case.cfl > 0.7;
        let unstable = Status::Unstable { step: 1, time: 0.0, particle: 0, error: 2.0, size: 1.0 };
        Row {
            cells: setting.case.cells,
            h: 1.0,
            dt: 1.0,
            cfl: setting.case.cfl,
            steps: plan.steps,
            particles: plan.particles as usize,
            wall_s,
            cpu_s: wall_s,
            particle_steps_per_s: 1.0,
            timed_alone: true,
            status: if is_unstable { unstable } else { Status::Ok },
            errors: PerField { u: norms, v: norms, F: norms, P: norms },
            internal: Vec::new(),
        }
    }

    fn measure(&self, budget_s: f64) -> Tradeoff {
        let base = Setting { case: Case::default(), single: false, threads: 1 };
        let families = families(&base, Some(2), true, &Self::plan);
        let goal = Goal {
            budget_s,
            error: &|row| row.errors.u.linf,
            against: Against::Wall,
            tolerance: Some(3e-5),
            time_s: Some(0.01),
            most_bytes: 1e9,
        };
        let machine = Machine {
            plan: &Self::plan,
            run: &|setting, _| {
                // Some schemes are refused.
                let updated = setting.case.scheme.updated();
                let is_refused = updated.is_some_and(|u| u.shape == Shape::Bspline2);
                Ok::<_, std::convert::Infallible>((!is_refused).then(|| self.run(setting)))
            },
            repeat: &|setting, _| {
                let wall_s = self.time(setting);
                self.now.set(self.now.get() + wall_s);
                Ok(Some(Repeat { wall_s, cpu_s: wall_s }))
            },
            clock: &|| self.now.get(),
        };
        tradeoff(&families, &goal, &machine, &mut |_| ()).unwrap()
    }
}

fn formula(slow: f64) -> Formula {
    Formula { now: Cell::new(0.0), runs: RefCell::default(), slow }
}

#[test]
fn the_budget_is_filled_and_kept() {
    for (budget, slow) in [(3.0, 1.0), (120.0, 1.0), (120.0, 5.0)] {
        let machine = formula(slow);
        let found = machine.measure(budget);
        let used = machine.now.get() / budget;
        assert!((0.9..=1.0).contains(&used), "{used} of {budget} s");
        assert!(found.front.len() >= 8, "{budget} s: {}", found.front.len());
        assert!(found.skipped[&Skip::Refused] > 0);
        assert!(found.skipped[&Skip::Dominated] > 10, "{:?}", found.skipped);
        // All that ran at a CFL number beyond the limit stopped, and was not refined.
        let stopped = found.entries.iter().filter(|entry| entry.row.status != Status::Ok).count();
        assert_eq!(found.skipped[&Skip::Stopped], stopped);
    }
}

#[test]
fn no_setting_runs_twice_and_named_ones_hold_on_neighbours() {
    let machine = formula(2.0);
    let found = machine.measure(240.0);
    let runs = machine.runs.borrow().clone();
    // The last two are the proofs.
    let (runs, proofs) = runs.split_at(runs.len() - 2);
    let chosen = found.for_tolerance.as_ref().unwrap();
    assert_eq!(proofs[0], found.entries[chosen.entry].setting);
    assert!(chosen.proof.errors.u.linf <= 3e-5);
    assert!(found.for_time.as_ref().unwrap().proof.wall_s <= 0.01);
    for (index, one) in runs.iter().enumerate() {
        assert!(!runs[..index].contains(one), "{one:?}");
    }
    assert_eq!(found.tolerances.len(), TOLERANCES.len() + 1);
    for Cheapest { tolerance, entry, neighbours_hold } in found.tolerances.clone() {
        let setting = found.entries[entry.unwrap()].setting;
        assert!(neighbours_hold, "{tolerance:e}");
        for near in neighbours(&setting, &Formula::plan) {
            assert!(machine.run(&near).errors.u.linf <= tolerance, "{tolerance:e}: {near:?}");
        }
    }
}

#[test]
fn effects_are_those_of_the_formula() {
    // Long enough for runs that last on two threads as well.
    let found = formula(1.0).measure(240.0);
    let of = |name| found.effects.iter().filter(move |effect| effect.setting == name);
    let lasts = |entry: usize| found.entries[entry].row.wall_s >= LEAST_TIMED_S;
    for effect in &found.effects {
        assert!((1..=MOST_PAIRS).contains(&effect.pairs), "{effect:?}");
        if effect.time != TimeEffect::TooShort {
            assert!(lasts(effect.from) && lasts(effect.to), "{effect:?}");
        }
    }
    for effect in of(SettingName::Cfl) {
        let Range { least, most } = effect.error;
        assert!((least - 1.0).abs() < 1e-12 && (most - 1.0).abs() < 1e-12, "{effect:?}");
        if let Some(time) = effect.time.factor() {
            assert!((time.least - 2.0).abs() < 0.1 && (time.most - 2.0).abs() < 0.1, "{effect:?}");
        }
    }
    assert!(of(SettingName::Cfl).filter(|effect| effect.time.factor().is_some()).count() > 1);
    let threads = of(SettingName::Threads).next().unwrap().time.factor().unwrap();
    assert!((threads.most - 0.5).abs() < 1e-9 && (threads.least - 0.5).abs() < 1e-9);
    // The formula gives single precision no time of its own.
    let precision = of(SettingName::Precision).next().unwrap();
    assert!(matches!(precision.time, TimeEffect::WithinScatter(_)), "{precision:?}");
    let fine = found.entries[precision.from].setting.case.cells as f64;
    assert!((precision.error.most - (1.0 + 1e-4 * fine * fine)).abs() < 1e-6);
}

#[test]
fn times_are_told_of_runs_that_last_and_differ_by_more_than_they_scatter() {
    let factor = |pairs: &[(&[f64], &[f64])]| TimeEffect::of(pairs);
    let range = |least, most| Range { least, most };
    // Milliseconds say nothing, whatever they differ by; nor does a pair of which one is short.
    assert_eq!(factor(&[(&[0.01, 0.011], &[0.0015])]), TimeEffect::TooShort);
    assert_eq!(factor(&[(&[1.0], &[0.049])]), TimeEffect::TooShort);
    assert_eq!(factor(&[]), TimeEffect::TooShort);
    assert_eq!(factor(&[(&[0.5], &[1.0])]), TimeEffect::Factor(range(2.0, 2.0)));
    // Of several pairs and timings the range; short pairs are left out of it.
    let pairs: &[(&[f64], &[f64])] = &[(&[0.5, 1.0], &[2.0]), (&[0.1], &[0.8]), (&[0.01], &[1.0])];
    assert_eq!(factor(pairs), TimeEffect::Factor(range(2.0, 8.0)));
    // Twice as fast once and twice as slow once is no effect, and neither is a difference of a few percent.
    let pairs: &[(&[f64], &[f64])] = &[(&[1.0], &[2.0]), (&[2.0], &[1.0])];
    assert_eq!(factor(pairs), TimeEffect::WithinScatter(range(0.5, 2.0)));
    assert_eq!(factor(&[(&[1.0], &[0.97])]), TimeEffect::WithinScatter(range(0.97, 0.97)));
    assert_eq!(factor(pairs).factor(), None);
}

#[test]
fn the_effects_that_matter_most_come_from_all_settings() {
    let effect = |setting, time: f64, error: f64| Effect {
        setting,
        from: 0,
        to: 1,
        pairs: 1,
        time: TimeEffect::Factor(Range { least: time, most: time }),
        error: Range { least: error, most: error },
    };
    let mut effects: Vec<Effect> =
        (0..40).map(|n| effect(SettingName::Cells, 8.0, 0.1 + 0.001 * f64::from(n))).collect();
    effects.push(effect(SettingName::Threads, 0.6, 1.0));
    effects.push(effect(SettingName::Cfl, 1.2, 1.0));
    effects.push(effect(SettingName::Precision, 1.01, 1.02));
    let noise = TimeEffect::WithinScatter(Range { least: 0.1, most: 9.0 });
    effects.push(Effect { time: noise, ..effect(SettingName::Ppc, 1.0, 1.0) });
    let chosen: Vec<_> = leading(&effects, 10).iter().map(|e| (e.setting, e.error.most)).collect();
    assert_eq!(chosen.len(), 10);
    assert_eq!(chosen[0], (SettingName::Cells, 0.1));
    assert_eq!(chosen[7], (SettingName::Cells, 0.1 + 0.001 * 7.0));
    assert_eq!(chosen[8..], [(SettingName::Cfl, 1.0), (SettingName::Threads, 1.0)]);
    assert!(leading(&[], 10).is_empty());
}

#[test]
fn an_order_that_is_observed_carries_on_and_a_hint_helps_at_the_start() {
    let known = |order: i32| [4, 8, 16, 32].map(|n: usize| (n, 3.0 * (n as f64).powi(-order)));
    for order in [1, 2, 6] {
        let expected = 3.0 * 64.0_f64.powi(-order);
        let error = extrapolate(&known(order), 64, 9.0).unwrap();
        assert!((error / expected - 1.0).abs() < 1e-12);
    }
    assert_eq!(extrapolate(&[], 8, 2.0), None);
    assert_eq!(extrapolate(&[(4, 1.0)], 8, 2.0), Some(0.25));
    assert_eq!(extrapolate(&known(1)[..2], 16, 2.0), Some(3.0 / 8.0 / 4.0));
    // An error that grows is not believed to fall.
    assert_eq!(extrapolate(&[(4, 1.0), (8, 1.0), (16, 1.0), (32, 2.0)], 64, 2.0), Some(2.0));
}

#[test]
fn a_median_is_the_middle() {
    assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
    assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), 2.5);
    assert!(median(&[]).is_nan());
}

proptest! {
    #[test]
    fn the_front_is_what_nothing_dominates(
        points in prop::collection::vec((0_u8..12, 0_u8..12, prop::bool::weighted(0.1)), 0..40)
    ) {
        let points: Vec<(f64, f64)> = points
            .into_iter()
            .map(|(cost, error, is_nan)| {
                (f64::from(cost), if is_nan { f64::NAN } else { f64::from(error) })
            })
            .collect();
        let front = pareto(&points);
        for pair in front.windows(2) {
            prop_assert!(points[pair[0]].0 < points[pair[1]].0);
            prop_assert!(points[pair[0]].1 > points[pair[1]].1);
        }
        for (index, point) in points.iter().enumerate() {
            let dominates = |other: &(f64, f64)| {
                other.0 <= point.0 && other.1 <= point.1 && (other.0, other.1) != (point.0, point.1)
            };
            let is_dominated = points.iter().any(dominates);
            let is_equalled = front.iter().any(|&other| points[other] == *point);
            prop_assert_eq!(is_equalled, !is_dominated && point.1.is_finite(), "{}", index);
        }
    }
}
