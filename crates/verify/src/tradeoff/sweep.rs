//! Execution of a sweep: runs, timings and the conclusions from them.

use std::collections::BTreeSet;

use super::effects::{Compared, differences};
use super::policy::{CHEAP, Family, Ladder, Next, Policy, SHORT_S, TIMINGS, UNCERTAINTY, weights};
use super::{
    Against, Cheapest, Chosen, Entry, Goal, LADDER, Machine, Repeat, Setting, Skip, TOLERANCES,
    Tradeoff, median, pareto,
};
use crate::case::Case;
use crate::cost::{Cost, CostModel};
use crate::on_grid::Plan;
use crate::run::Status;
use crate::scheme::{Formulation, Placement, Scheme};

/// A sweep under way.
pub(super) struct Sweep<'a, E> {
    machine: &'a Machine<'a, E>,
    goal: Goal<'a>,
    policy: Policy,
    families: Vec<Family>,
    ladders: Vec<Ladder>,
    cases: Cases,
    pub(super) found: Tradeoff,
}

/// Where cases come from.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Cases {
    /// One follows from another, as long as the budget lasts.
    Chosen,
    /// They are stated, and may have been run elsewhere.
    Listed,
}

impl<'a, E> Sweep<'a, E> {
    pub(super) fn new(
        families: &[Setting],
        goal: &Goal<'a>,
        machine: &'a Machine<'a, E>,
        cases: Cases,
    ) -> Self {
        let at =
            |setting: &Setting, cells| Setting { case: Case { cells, ..setting.case }, ..*setting };
        let known = |setting: &Setting| Family {
            setting: *setting,
            plans: LADDER.iter().map(|&cells| (machine.plan)(&at(setting, cells))).collect(),
            cost: CostModel::default(),
        };
        let ladder = |(family, setting): (usize, &Setting)| Ladder::new(family, setting.case.cfl);
        Self {
            machine,
            goal: *goal,
            policy: Policy {
                budget_s: goal.budget_s,
                against: goal.against,
                most_bytes: goal.most_bytes,
            },
            families: families.iter().map(known).collect(),
            ladders: families.iter().enumerate().map(ladder).collect(),
            cases,
            found: Tradeoff { families: families.len(), ..Tradeoff::default() },
        }
    }

    /// Conclusions from all that was run.
    pub(super) fn conclude(mut self, progress: &mut dyn FnMut(&Setting)) -> Result<Tradeoff, E> {
        self.found.for_tolerance = self.prove(self.cheapest_for_tolerance(), progress)?;
        self.found.for_time = self.prove(self.best_in_time(), progress)?;
        self.found.front = self.front();
        if let Some(family) = self.families.first() {
            let errors: Vec<f64> =
                (0..self.found.entries.len()).map(|entry| self.error(entry)).collect();
            let (entries, plain) = (&self.found.entries, family.setting);
            self.found.effects = Compared { entries, errors: &errors, plain }.effects();
        }
        Ok(self.found)
    }
}

impl<E> Sweep<'_, E> {
    /// Seconds until a phase ends.
    fn left(&self, phase: usize) -> f64 {
        self.policy.left(phase, (self.machine.clock)())
    }

    fn error(&self, entry: usize) -> f64 {
        let row = &self.found.entries[entry].row;
        if row.status == Status::Ok { (self.goal.error)(row) } else { f64::NAN }
    }

    fn cost(&self, entry: usize) -> f64 {
        let entry = &self.found.entries[entry];
        match self.goal.against {
            Against::Wall => entry.row.wall_s,
            Against::Cpu => entry.row.cpu_s,
            Against::Steps => entry.row.steps as f64,
            Against::Memory => entry.bytes,
        }
    }

    fn front(&self) -> Vec<usize> {
        pareto(&self.points(0..self.found.entries.len()))
    }

    /// The front among settings of the same weights.
    fn front_of(&self, of: Scheme) -> Vec<usize> {
        let entries = &self.found.entries;
        let own: Vec<usize> = (0..entries.len())
            .filter(|&index| weights(&entries[index].setting.case.scheme) == of)
            .collect();
        pareto(&self.points(own.iter().copied())).into_iter().map(|place| own[place]).collect()
    }

    fn points(&self, entries: impl IntoIterator<Item = usize>) -> Vec<(f64, f64)> {
        entries.into_iter().map(|index| (self.cost(index), self.error(index))).collect()
    }

    pub(super) fn skip(&mut self, reason: Skip, count: usize) {
        if count > 0 {
            *self.found.skipped.entry(reason).or_default() += count;
        }
    }

    /// Runs the ladders from cheap to dear.
    pub(super) fn climb(&mut self, progress: &mut dyn FnMut(&Setting)) -> Result<(), E> {
        loop {
            let front = self.points(self.front());
            let left = self.left(0);
            let mut own: Vec<(Scheme, Vec<(f64, f64)>)> = Vec::new();
            for family in &self.families {
                let weights = weights(&family.setting.case.scheme);
                if own.iter().all(|(known, _)| *known != weights) {
                    own.push((weights, self.points(self.front_of(weights))));
                }
            }
            let mut cheapest: Option<(f64, usize, Next)> = None;
            for index in 0..self.ladders.len() {
                if !self.ladders[index].open {
                    continue;
                }
                let family = &self.families[self.ladders[index].family];
                let weights = weights(&family.setting.case.scheme);
                let own = own.iter().find(|(known, _)| *known == weights);
                let own = own.map_or(&[][..], |(_, points)| points.as_slice());
                match self.policy.next((family, &self.ladders[index]), own, &front, left) {
                    Ok(next) => {
                        let time = next.expected.map_or(0.0, |cost| cost.total_s);
                        if cheapest.as_ref().is_none_or(|(least, ..)| time < *least) {
                            cheapest = Some((time, index, next));
                        }
                    }
                    Err((reason, count)) => {
                        self.ladders[index].open = false;
                        self.skip(reason, count);
                    }
                }
            }
            let Some((_, index, next)) = cheapest else { return Ok(()) };
            self.skip(Skip::Dominated, next.passed_over);
            self.ascend(index, next.rung, progress)?;
        }
    }

    /// Runs one rung of a ladder, and lets the ladder go on.
    fn ascend(
        &mut self,
        index: usize,
        rung: usize,
        progress: &mut dyn FnMut(&Setting),
    ) -> Result<(), E> {
        let Ladder { family, cfl, .. } = self.ladders[index];
        let setting = self.families[family].setting;
        let case = Case { cells: LADDER[rung], cfl, ..setting.case };
        self.ladders[index].next = rung + 1;
        let Some(entry) = self.run(family, &Setting { case, ..setting }, progress)? else {
            self.skip(Skip::Refused, 1);
            return Ok(());
        };
        // That of a run that stopped is none.
        let error = Some(self.error(entry)).filter(|error| error.is_finite());
        let (branches, skip) = self.ladders[index].climbed(rung, error);
        self.ladders.extend(branches);
        if let Some(reason) = skip {
            self.skip(reason, 1);
        }
        Ok(())
    }

    /// The entry of a setting, run now if it was not yet; none where the solver refuses it.
    pub(super) fn run(
        &mut self,
        family: usize,
        setting: &Setting,
        progress: &mut dyn FnMut(&Setting),
    ) -> Result<Option<usize>, E> {
        if let Some(known) = self.found.entries.iter().position(|e| e.setting == *setting) {
            return Ok(Some(known));
        }
        progress(setting);
        let started = (self.machine.clock)();
        let Some(row) = (self.machine.run)(setting, self.left(3))? else { return Ok(None) };
        let total_s = (self.machine.clock)() - started;
        if row.status == Status::Ok {
            let cost = Cost { steps_s: row.wall_s, total_s };
            // The plan's number of particles is an estimate; predictions start from such estimates as well.
            let particles = (self.machine.plan)(setting).map_or(0.0, |plan| plan.particles);
            self.families[family].cost.learn(particles, row.steps, cost);
        }
        let bytes = (self.machine.plan)(setting).map_or(0.0, |plan| plan.bytes);
        let (walls, cpus) = (vec![row.wall_s], vec![row.cpu_s]);
        // Another machine's times are no repeats.
        let is_short =
            row.status == Status::Ok && row.wall_s < SHORT_S && self.cases == Cases::Chosen;
        self.found.entries.push(Entry { setting: *setting, row, walls, cpus, total_s, bytes });
        let entry = self.found.entries.len() - 1;
        while is_short && self.found.entries[entry].walls.len() < TIMINGS && self.left(3) > 0.0 {
            if !self.time_again(entry)? {
                break;
            }
        }
        Ok(Some(entry))
    }

    /// Times a setting once more; whether it ended in time.
    fn time_again(&mut self, entry: usize) -> Result<bool, E> {
        let setting = self.found.entries[entry].setting;
        let Some(Repeat { wall_s, cpu_s }) = (self.machine.repeat)(&setting, self.left(3))? else {
            return Ok(false);
        };
        let Entry { row, walls, cpus, .. } = &mut self.found.entries[entry];
        walls.push(wall_s);
        cpus.push(cpu_s);
        let particle_steps = row.particles as f64 * row.steps as f64;
        row.wall_s = median(walls);
        row.cpu_s = median(cpus);
        row.particle_steps_per_s = if row.wall_s > 0.0 { particle_steps / row.wall_s } else { 0.0 };
        Ok(true)
    }

    /// Runs what is missing for comparisons in which one setting differs, on the finest grid that is cheap.
    pub(super) fn compare_settings(&mut self, progress: &mut dyn FnMut(&Setting)) -> Result<(), E> {
        let cheap = CHEAP * self.goal.budget_s;
        let first = |is_wanted: fn(&Scheme) -> bool| {
            self.families.iter().position(|family| is_wanted(&family.setting.case.scheme))
        };
        let references = [
            first(|scheme| scheme.updated().is_some()),
            first(|scheme| scheme.updated().is_some_and(|u| u.placement == Placement::BodyFitted)),
            first(|scheme| scheme.total().is_some()),
        ];
        for reference in references.into_iter().flatten() {
            let of = self.families[reference].setting;
            let affordable = |rung: &usize| {
                let family = &self.families[reference];
                let plan = family.plan(*rung, of.case.cfl);
                plan.and_then(|plan| family.cost.predict(&plan)).is_some_and(|c| c.total_s < cheap)
            };
            let Some(rung) = (0..LADDER.len()).rev().find(affordable) else { continue };
            let at = |family: &Setting, cfl: f64| {
                let case = Case { cells: LADDER[rung], cfl, ..family.case };
                Setting { case, ..*family }
            };
            let partners: Vec<(usize, Setting)> = (0..self.families.len())
                .filter(|&other| differences(&of, &self.families[other].setting).len() <= 1)
                .flat_map(|other| {
                    let setting = self.families[other].setting;
                    [at(&setting, setting.case.cfl), at(&setting, setting.case.cfl / 2.0)]
                        .map(|setting| (other, setting))
                })
                .collect();
            for (family, setting) in partners {
                let Some(plan) = (self.machine.plan)(&setting) else { continue };
                let expected = self.families[family].cost.predict(&plan);
                let is_cheap = expected.is_some_and(|cost| {
                    cost.total_s < 8.0 * cheap && UNCERTAINTY * cost.total_s < self.left(1)
                });
                if is_cheap && plan.bytes <= self.goal.most_bytes {
                    self.run(family, &setting, progress)?;
                }
            }
        }
        Ok(())
    }

    /// For each tolerance the cheapest setting that meets it, and whose neighbours do; where both formulations were run, of each of
    /// them too.
    pub(super) fn name_cheapest(&mut self, progress: &mut dyn FnMut(&Setting)) -> Result<(), E> {
        // Neighbours that are run here are not candidates themselves, or their neighbours would have to be run in turn.
        let candidates: Vec<Formulation> = self
            .found
            .entries
            .iter()
            .map(|entry| entry.setting.case.scheme.formulation())
            .collect();
        let all = Vec::from_iter(0..candidates.len());
        self.found.tolerances = self.cheapest_of(&all, progress)?;
        for formulation in [Formulation::Updated, Formulation::Total] {
            let own = all.iter().copied().filter(|&entry| candidates[entry] == formulation);
            let own = Vec::from_iter(own);
            if !own.is_empty() && own.len() < all.len() {
                let cheapest = self.cheapest_of(&own, progress)?;
                self.found.by_formulation.push((formulation, cheapest));
            }
        }
        Ok(())
    }

    /// For each tolerance the cheapest of some settings.
    fn cheapest_of(
        &mut self,
        candidates: &[usize],
        progress: &mut dyn FnMut(&Setting),
    ) -> Result<Vec<Cheapest>, E> {
        let mut wanted: Vec<f64> = TOLERANCES.into_iter().chain(self.goal.tolerance).collect();
        wanted.sort_by(|a, b| b.total_cmp(a));
        wanted.dedup();
        let mut all = Vec::with_capacity(wanted.len());
        for tolerance in wanted {
            let mut order: Vec<usize> =
                candidates.iter().copied().filter(|&i| self.error(i) <= tolerance).collect();
            order.sort_by(|&a, &b| self.cost(a).total_cmp(&self.cost(b)));
            let mut named = Cheapest { tolerance, entry: None, neighbours_hold: false };
            for entry in order {
                match self.neighbours_hold(entry, tolerance, progress)? {
                    Some(true) => {
                        named = Cheapest { tolerance, entry: Some(entry), neighbours_hold: true };
                        break;
                    }
                    Some(false) => {}
                    // No time: the first that is left is named, unproved.
                    None if named.entry.is_none() => named.entry = Some(entry),
                    None => {}
                }
            }
            all.push(named);
        }
        Ok(all)
    }

    /// Whether the next coarser and the next finer grid meet the tolerance as well; `None` if there was no time, or if they are
    /// not in the list.
    fn neighbours_hold(
        &mut self,
        entry: usize,
        tolerance: f64,
        progress: &mut dyn FnMut(&Setting),
    ) -> Result<Option<bool>, E> {
        let setting = self.found.entries[entry].setting;
        let Some(family) = self.families.iter().position(|family| {
            let at =
                Case { cells: setting.case.cells, cfl: setting.case.cfl, ..family.setting.case };
            Setting { case: at, ..family.setting } == setting
        }) else {
            return Ok(None);
        };
        let all = match self.cases {
            Cases::Chosen => neighbours(&setting, self.machine.plan),
            Cases::Listed => match self.listed_neighbours(&setting) {
                Some(both) => both.to_vec(),
                None => return Ok(None),
            },
        };
        for neighbour in all {
            let known = self.found.entries.iter().any(|e| e.setting == neighbour);
            if !known {
                let plan = (self.machine.plan)(&neighbour);
                let cost = plan.and_then(|plan| self.families[family].cost.predict(&plan));
                if cost.is_none_or(|cost| UNCERTAINTY * cost.total_s > self.left(2)) {
                    return Ok(None);
                }
            }
            let entry = self.run(family, &neighbour, progress)?;
            let error = entry.map_or(f64::NAN, |entry| self.error(entry));
            // A comparison that is not a number holds nothing.
            if error.is_nan() || error > tolerance {
                return Ok(Some(false));
            }
        }
        Ok(Some(true))
    }

    /// The setting on the next coarser and the next finer grid of the list; none where one is missing.
    fn listed_neighbours(&self, setting: &Setting) -> Option<[Setting; 2]> {
        let cells = setting.case.cells;
        let others = || {
            self.found.entries.iter().map(|entry| entry.setting).filter(|other| {
                Setting { case: Case { cells, ..other.case }, ..*other } == *setting
            })
        };
        let coarser = others().filter(|other| other.case.cells < cells);
        let finer = others().filter(|other| other.case.cells > cells);
        let by_cells = |other: &Setting| other.case.cells;
        Some([coarser.max_by_key(by_cells)?, finer.min_by_key(by_cells)?])
    }

    fn cheapest_for_tolerance(&self) -> Option<usize> {
        let wanted = self.goal.tolerance?;
        self.found.tolerances.iter().find(|named| named.tolerance == wanted)?.entry
    }

    /// The most accurate setting whose steps took no more than the time asked for, each time that they were timed.
    fn best_in_time(&self) -> Option<usize> {
        let most = self.goal.time_s?;
        let is_within = |entry: &usize| {
            self.found.entries[*entry].walls.iter().all(|wall| *wall <= most)
                && self.error(*entry).is_finite()
        };
        let entries = (0..self.found.entries.len()).filter(is_within);
        entries.min_by(|&a, &b| self.error(a).total_cmp(&self.error(b)))
    }

    /// Runs a setting once more, with as long as that takes.
    fn prove(
        &self,
        entry: Option<usize>,
        progress: &mut dyn FnMut(&Setting),
    ) -> Result<Option<Chosen>, E> {
        let Some(entry) = entry else { return Ok(None) };
        let setting = self.found.entries[entry].setting;
        progress(&setting);
        let proof = (self.machine.run)(&setting, f64::INFINITY)?;
        Ok(proof.map(|proof| Chosen { entry, proof }))
    }

    /// Time that the proofs will take.
    fn proofs_s(&self) -> f64 {
        let chosen = [self.cheapest_for_tolerance(), self.best_in_time()];
        chosen.into_iter().flatten().map(|entry| self.found.entries[entry].total_s).sum()
    }

    /// Spends what is left on timings of the front, those with the fewest first.
    pub(super) fn fill(&mut self, progress: &mut dyn FnMut(&Setting)) -> Result<(), E> {
        let of_each = self.found.by_formulation.iter().flat_map(|(_, cheapest)| cheapest);
        let all = self.found.tolerances.iter().chain(of_each);
        let named: BTreeSet<usize> = all.filter_map(|cheapest| cheapest.entry).collect();
        loop {
            let left = self.left(3) - self.proofs_s();
            let mut worth = self.front();
            worth.extend(&named);
            let fits = |&index: &usize| UNCERTAINTY * self.found.entries[index].row.wall_s < left;
            let fewest = worth
                .into_iter()
                .filter(fits)
                .min_by_key(|&index| self.found.entries[index].walls.len());
            let Some(entry) = fewest.filter(|_| left > 0.0) else { return Ok(()) };
            progress(&self.found.entries[entry].setting);
            if !self.time_again(entry)? {
                return Ok(());
            }
        }
    }
}

/// The setting on the next coarser and the next finer grid that fit.
pub(super) fn neighbours(
    setting: &Setting,
    plan: &dyn Fn(&Setting) -> Option<Plan>,
) -> Vec<Setting> {
    let cells = setting.case.cells;
    let at = |cells| Setting { case: Case { cells, ..setting.case }, ..*setting };
    let fits = |&cells: &usize| plan(&at(cells)).is_some();
    let coarser = (1..cells).rev().take(32).find(fits);
    let finer = (cells + 1..cells + 33).find(fits);
    coarser.into_iter().chain(finer).map(at).collect()
}
