//! Error against cost: which setting is worth its time.
//!
//! A *family* is a scheme with everything but its grid and its time step; a *ladder* is a family at one CFL number, on
//! grids from coarse to fine. The next run is always the cheapest one, by the time that the family's earlier runs let
//! expect, so that settings from the whole field are compared before any of them becomes dear. A grid is passed over where
//! the error that the observed order lets expect is larger by [`MARGIN`] than that of a setting of the same weights already
//! known to cost no more; one that any other setting so betters may still be run, to tell what its weights cost, but only
//! while that is cheap. A ladder ends where that holds for all its grids that the budget can pay for, where its error no longer falls, or
//! where a run stops. From a ladder's third grid on, half and twice its CFL number are tried as well, as long as that gains.
//!
//! A stated list of settings is measured as it stands, with [`listed`].
//!
//! Nothing here knows a clock or a solver: both are given, so that tests can state them.

use mmsmith_galerkin::{Composition, Coordinates, Layout, MassMatrix};
use mmsmith_mpm::{Shape, Transfer};
use serde::Serialize;
use std::collections::BTreeMap;

use crate::case::Case;
use crate::cost::{Cost, CostModel};
use crate::discretized::Plan;
use crate::run::{Row, Status};
use crate::scheme::{Placement, Scheme, Stepping, Total, Updated};

/// Cell counts of a ladder.
pub const LADDER: [usize; 15] = [4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512];
/// An expected error this much larger than a measured one of no higher cost is not worth a run.
pub const MARGIN: f64 = 1.25;
/// Errors that the cheapest settings are named for.
pub const TOLERANCES: [f64; 7] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8];

/// Shares of the budget at which the sweep, the comparisons of single settings, the proofs on neighbouring grids and the repeats
/// for timing end.
const PHASES: [f64; 4] = [0.58, 0.68, 0.92, 0.98];
/// The largest share of the budget that one run may take, so that its neighbours can be run as well; and one that settings
/// with other weights dominate.
const LARGEST_RUN: f64 = 0.1;
const LARGEST_DOMINATED: f64 = 0.03;
/// Predictions are held within 30 %.
const UNCERTAINTY: f64 = 1.3;
/// Runs shorter than this are timed three times at once.
const SHORT_S: f64 = 0.2;
/// The fewest timings of a short run.
const TIMINGS: usize = 3;
/// Shorter runs are not compared by their time.
const LEAST_TIMED_S: f64 = 0.05;
/// Times that differ by no more than this share may do so by chance, however few timings there are.
const SCATTER: f64 = 0.05;
/// The most pairs of runs that an effect is told of, the finest ones.
const MOST_PAIRS: usize = 3;
/// Effects below this factor are not worth telling.
const LEAST_EFFECT: f64 = 1.1;

/// A setting to run: a case, its precision, and its threads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setting {
    /// Scheme, grid and time step.
    pub case: Case,
    /// Whether the solver computes in single precision.
    pub single: bool,
    /// Number of threads.
    pub threads: usize,
}

/// One measured setting.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// The setting that was run.
    pub setting: Setting,
    /// Its errors; the times are medians of the repeats.
    pub row: Row,
    /// Wall-clock time of the steps in each repeat, in seconds.
    pub walls: Vec<f64>,
    /// Processor time of the steps in each repeat, in seconds.
    pub cpus: Vec<f64>,
    /// Everything in its first run, from setting up to the last error, in seconds.
    pub total_s: f64,
    /// Memory in bytes, estimated.
    pub bytes: f64,
}

/// A cost of a setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Against {
    /// Wall-clock time of the steps.
    Wall,
    /// Processor time of the steps.
    Cpu,
    /// Number of steps.
    Steps,
    /// Memory.
    Memory,
}

/// Why something was not run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Skip {
    /// Its expected error is larger by [`MARGIN`] than one already measured with the same weights at no higher cost, or with
    /// any, and it would be dear.
    Dominated,
    /// The error of its ladder no longer falls.
    NoGain,
    /// Another CFL number on the same grid was no better, or was much worse.
    Cfl,
    /// A coarser grid of its ladder stopped.
    Stopped,
    /// It would take longer than there is time, or than one run may.
    Budget,
    /// It needs more memory than there is.
    Memory,
    /// The solver refuses it.
    Refused,
}

/// Goal of a search for settings.
#[derive(Clone, Copy)]
pub struct Goal<'a> {
    /// Seconds for everything.
    pub budget_s: f64,
    /// The error of a row that settings are compared by.
    pub error: &'a dyn Fn(&Row) -> f64,
    /// The cost that settings are compared by.
    pub against: Against,
    /// An error that must be met, beside [`TOLERANCES`].
    pub tolerance: Option<f64>,
    /// Seconds of stepping within which the most accurate setting is wanted.
    pub time_s: Option<f64>,
    /// Bytes that a run may need.
    pub most_bytes: f64,
}

/// Times of the steps of a run, in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Repeat {
    /// Wall-clock time.
    pub wall_s: f64,
    /// Processor time.
    pub cpu_s: f64,
}

/// A repeat, none where it did not end in time, or why it could not be run.
pub type RepeatOutcome<E> = Result<Option<Repeat>, E>;

/// A row, none where the solver refuses the setting, or why the study cannot go on.
pub type RunOutcome<E> = Result<Option<Row>, E>;

/// The machine that runs the settings.
pub struct Machine<'a, E> {
    /// Plan of a setting; none where the setting does not fit the solution.
    pub plan: &'a dyn Fn(&Setting) -> Option<Plan>,
    /// Runs a setting and measures its errors, for at most so many seconds; none where the solver refuses it.
    pub run: &'a (dyn Fn(&Setting, f64) -> RunOutcome<E> + 'a),
    /// Runs the steps alone, for at most so many seconds; none if it did not end.
    pub repeat: &'a (dyn Fn(&Setting, f64) -> RepeatOutcome<E> + 'a),
    /// Seconds since the start.
    pub clock: &'a dyn Fn() -> f64,
}

/// The cheapest setting for an error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cheapest {
    /// The error.
    pub tolerance: f64,
    /// The entry, if any meets it.
    pub entry: Option<usize>,
    /// Whether the neighbouring cell counts were run and meet it too; otherwise there was no time for that, or they are not in
    /// the list.
    pub neighbours_hold: bool,
}

/// The setting that was asked for, and the run that proves it.
#[derive(Clone, Debug, PartialEq)]
pub struct Chosen {
    /// The entry.
    pub entry: usize,
    /// Results of its setting when it was run once more.
    pub proof: Row,
}

/// The least and the largest of what several pairs of runs showed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Range {
    /// The least.
    pub least: f64,
    /// The largest.
    pub most: f64,
}

impl Range {
    /// The range of `values`; none where there is none.
    fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        values.into_iter().fold(None, |range: Option<Self>, value| {
            let Self { least, most } = range.unwrap_or(Self { least: value, most: value });
            Some(Self { least: least.min(value), most: most.max(value) })
        })
    }

    /// Its middle, as a factor.
    #[must_use]
    pub fn middle(&self) -> f64 {
        (self.least * self.most).sqrt()
    }

    /// How far the middle is from no change, as a factor of at least one.
    fn strength(&self) -> f64 {
        self.middle().max(1.0 / self.middle())
    }
}

/// Effect of a change on the time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum TimeEffect {
    /// The factor of the wall-clock time, over all timings of all pairs.
    Factor(Range),
    /// That factor, where the timings differ by as much as the settings do: it says nothing.
    WithinScatter(Range),
    /// No two runs lasted long enough to be compared.
    TooShort,
}

impl TimeEffect {
    /// From the timings, in seconds, of pairs of runs before and after a change.
    #[must_use]
    pub fn of(pairs: &[(&[f64], &[f64])]) -> Self {
        let factors = pairs.iter().filter(|pair| lasts(pair.0) && lasts(pair.1)).flat_map(
            |(before, after)| {
                after.iter().flat_map(|after| before.iter().map(move |before| after / before))
            },
        );
        match Range::of(factors) {
            None => Self::TooShort,
            Some(range) if range.least < 1.0 + SCATTER && range.most > 1.0 / (1.0 + SCATTER) => {
                Self::WithinScatter(range)
            }
            Some(range) => Self::Factor(range),
        }
    }

    /// The factor, where there is one that says something.
    #[must_use]
    pub fn factor(&self) -> Option<Range> {
        match self {
            Self::Factor(range) => Some(*range),
            Self::WithinScatter(_) | Self::TooShort => None,
        }
    }
}

/// Whether a run lasted long enough for its time to say something.
fn lasts(walls: &[f64]) -> bool {
    median(walls) >= LEAST_TIMED_S
}

/// Effect of the change of one setting, the others being equal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effect {
    /// Which.
    pub setting: SettingName,
    /// The entry before it was changed, of the finest pair of runs.
    pub from: usize,
    /// The entry after.
    pub to: usize,
    /// How many pairs of runs this is told of.
    pub pairs: usize,
    /// Effect of the change on the wall-clock time.
    pub time: TimeEffect,
    /// The factor of the error.
    pub error: Range,
}

impl Effect {
    /// By what factor time or error change, whichever does so more.
    fn strength(&self) -> f64 {
        self.time.factor().map_or(1.0, |range| range.strength()).max(self.error.strength())
    }
}

/// The effects that matter most, `count` of them at most: the strongest one of each setting, then the strongest of all;
/// sorted by setting and strength. What changes neither time nor error is not among them.
#[must_use]
pub fn leading(effects: &[Effect], count: usize) -> Vec<&Effect> {
    let mut all: Vec<&Effect> =
        effects.iter().filter(|effect| effect.strength() >= LEAST_EFFECT).collect();
    all.sort_by(|a, b| b.strength().total_cmp(&a.strength()));
    let mut firsts: Vec<&Effect> = Vec::new();
    let mut others = Vec::new();
    for effect in all {
        let is_first = firsts.iter().all(|first| first.setting != effect.setting);
        (if is_first { &mut firsts } else { &mut others }).push(effect);
    }
    let mut chosen: Vec<&Effect> = firsts.into_iter().chain(others).take(count).collect();
    chosen.sort_by(|a, b| a.setting.cmp(&b.setting).then(b.strength().total_cmp(&a.strength())));
    chosen
}

/// Name of a setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SettingName {
    /// Number of cells.
    Cells,
    /// Time step.
    Cfl,
    /// Particles per cell and direction.
    Ppc,
    /// Weights; in the total frame the splines' degree.
    Shape,
    /// Time integrator, or composition in the total frame.
    Integrator,
    /// Velocities from the grid.
    Transfer,
    /// Where the particles lie.
    Layout,
    /// The mass matrix of the total frame.
    Mass,
    /// Precision.
    Precision,
    /// Number of threads.
    Threads,
}

/// Everything that was measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tradeoff {
    /// All rows, in the order in which they were run.
    pub entries: Vec<Entry>,
    /// Indices of the Pareto-optimal ones, from cheap to dear.
    pub front: Vec<usize>,
    /// The cheapest setting for each tolerance.
    pub tolerances: Vec<Cheapest>,
    /// The cheapest setting for the tolerance asked for, if one meets it.
    pub for_tolerance: Option<Chosen>,
    /// The most accurate setting within the time asked for, if one is within it.
    pub for_time: Option<Chosen>,
    /// Effects of the change of each setting.
    pub effects: Vec<Effect>,
    /// Number of grids that were not run, by reason.
    pub skipped: BTreeMap<Skip, usize>,
    /// Families that were tried.
    pub families: usize,
}

/// The indices of pairs `(cost, error)` that no other one betters in one and equals in the other, from cheap to dear.
/// Pairs with a part that is not finite are never among them; of equal ones the first is.
#[must_use]
pub fn pareto(points: &[(f64, f64)]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len())
        .filter(|&index| points[index].0.is_finite() && points[index].1.is_finite())
        .collect();
    // Stable, so that equal ones stay in their order.
    order.sort_by(|&a, &b| {
        points[a].0.total_cmp(&points[b].0).then(points[a].1.total_cmp(&points[b].1))
    });
    let mut best = f64::INFINITY;
    order.retain(|&index| {
        let is_better = points[index].1 < best;
        best = best.min(points[index].1);
        is_better
    });
    order
}

/// The error on `cells`, from errors on coarser grids by their observed order; `hint` is the order believed while there
/// are fewer than four of them, if the observed one is lower.
///
/// `None` without an error to start from.
#[must_use]
pub fn extrapolate(known: &[(usize, f64)], cells: usize, hint: f64) -> Option<f64> {
    let &(last, error) = known.last()?;
    let observed = match known {
        [.., (a, e), (b, f)] if a != b && *e > 0.0 && *f > 0.0 => {
            Some((e / f).ln() / (*b as f64 / *a as f64).ln())
        }
        _ => None,
    };
    let order = match observed {
        Some(order) if known.len() >= 4 => order,
        Some(order) => order.max(hint),
        None => hint,
    };
    Some(error * (last as f64 / cells as f64).powf(order.clamp(0.0, 12.0)))
}

/// The families that may fit a solution, in the order in which they are tried; those that do not fit it are left out.
/// `base` says the periods, the extent and the speed of CFL numbers, and the CFL number to begin with.
#[must_use]
pub fn families(
    base: &Setting,
    more_threads: Option<usize>,
    has_single: bool,
    plan: &dyn Fn(&Setting) -> Option<Plan>,
) -> Vec<Setting> {
    let mut all = Vec::new();
    let with = |scheme: Scheme, per_cell: usize| Setting {
        case: Case { scheme, per_cell, ..base.case },
        ..*base
    };
    let square = Updated::default();
    let fitted =
        Updated { shape: Shape::Cpdi2, placement: Placement::BodyFitted, ..Updated::default() };
    for usual in [square, fitted] {
        let mut add = |scheme: Updated, per_cell| all.push(with(Scheme::Updated(scheme), per_cell));
        add(usual, 2);
        let shapes = [
            Shape::Linear,
            Shape::Ugimp,
            Shape::Gimp,
            Shape::Cpdi,
            Shape::Cpdi2,
            Shape::Bspline2,
            Shape::Bspline3,
        ];
        for shape in shapes.into_iter().filter(|shape| *shape != usual.shape) {
            add(Updated { shape, ..usual }, 2);
        }
        for stepping in [Stepping::Usl, Stepping::Usf, Stepping::Musl, Stepping::Usavg] {
            add(Updated { stepping, ..usual }, 2);
        }
        for per_cell in [1, 3, 4] {
            add(usual, per_cell);
        }
        add(Updated { shape: Shape::Bspline3, ..usual }, 4);
        for transfer in [Transfer::Pic, Transfer::Apic, Transfer::Xpic(2)] {
            add(Updated { transfer, ..usual }, 2);
        }
    }
    if let Some(threads) = more_threads {
        all.push(Setting { threads, ..with(Scheme::Updated(square), 2) });
    }
    if has_single {
        for shape in [Shape::Gimp, Shape::Ugimp] {
            let scheme = Scheme::Updated(Updated { shape, ..square });
            all.push(Setting { single: true, ..with(scheme, 2) });
        }
    }
    for coordinates in [Coordinates::Cartesian, Coordinates::Polar, Coordinates::Spherical] {
        for degree in 2..=5 {
            let lattice = Total { coordinates, ..Total::of_degree(degree) };
            let gauss = Total { layout: Layout::Gauss, ..lattice };
            let mut add = |scheme: Total, per_cell| all.push(with(Scheme::Total(scheme), per_cell));
            for per_cell in [2, 3, 4] {
                add(lattice, per_cell);
            }
            for per_cell in [degree - 1, degree, degree + 1] {
                add(gauss, per_cell);
            }
            for composition in [Composition::Order2, Composition::Order4, Composition::Order6] {
                if composition != gauss.composition {
                    add(Total { composition, ..gauss }, degree);
                }
            }
            let (mass, composition) = (MassMatrix::Lumped, Composition::Order2);
            add(Total { mass, composition, ..lattice }, 2);
        }
    }
    let fits = |setting: &Setting| {
        let at = |cells| Setting { case: Case { cells, ..setting.case }, ..*setting };
        LADDER.iter().any(|&cells| plan(&at(cells)).is_some())
    };
    all.retain(fits);
    all
}

/// The order that a scheme may have.
fn hint(setting: &Setting) -> f64 {
    setting.case.scheme.total().map_or(2.0, |total| total.degree as f64 + 1.0)
}

/// A scheme's weights, and where its particles lie in the updated frame: all else as usual.
fn weights(scheme: &Scheme) -> Scheme {
    match *scheme {
        Scheme::Updated(Updated { shape, placement, .. }) => {
            Scheme::Updated(Updated { shape, placement, ..Updated::default() })
        }
        Scheme::Total(total) => Scheme::Total(Total::of_degree(total.degree)),
    }
}

/// Which settings differ.
#[must_use]
pub fn differences(a: &Setting, b: &Setting) -> Vec<SettingName> {
    let (x, y) = (&a.case, &b.case);
    let [shape, integrator, transfer, layout, mass] = match (&x.scheme, &y.scheme) {
        (Scheme::Updated(x), Scheme::Updated(y)) => [
            x.shape != y.shape,
            x.stepping != y.stepping,
            x.transfer != y.transfer,
            x.placement != y.placement,
            false,
        ],
        (Scheme::Total(x), Scheme::Total(y)) => [
            x.degree != y.degree,
            x.composition != y.composition,
            false,
            (x.layout, x.coordinates) != (y.layout, y.coordinates),
            x.mass != y.mass,
        ],
        _ => [true, true, false, true, true],
    };
    [
        (SettingName::Cells, x.cells != y.cells),
        (SettingName::Cfl, x.cfl != y.cfl),
        (SettingName::Ppc, x.per_cell != y.per_cell),
        (SettingName::Shape, shape),
        (SettingName::Integrator, integrator),
        (SettingName::Transfer, transfer),
        (SettingName::Layout, layout),
        (SettingName::Mass, mass),
        (SettingName::Precision, a.single != b.single),
        (SettingName::Threads, a.threads != b.threads),
    ]
    .into_iter()
    .filter_map(|(name, differs)| differs.then_some(name))
    .collect()
}

struct Family {
    setting: Setting,
    /// Plan of each rung of the ladder at the setting's own CFL number.
    plans: Vec<Option<Plan>>,
    cost: CostModel,
}

impl Family {
    fn plan(&self, rung: usize, cfl: f64) -> Option<Plan> {
        let plan = self.plans.get(rung).copied()??;
        let steps = (plan.steps as f64 * self.setting.case.cfl / cfl).ceil() as u64;
        Some(Plan { steps, ..plan })
    }
}

/// A run at another CFL number that this one is held against.
#[derive(Clone, Copy)]
struct Parent {
    error: f64,
    /// The ladder's CFL number over the parent's.
    factor: f64,
}

struct Ladder {
    family: usize,
    cfl: f64,
    next: usize,
    /// Cells and errors of the runs that ended well.
    known: Vec<(usize, f64)>,
    parent: Option<Parent>,
    /// How often the CFL number was halved since a run stopped.
    halvings: usize,
    open: bool,
}

/// The next run of a ladder.
struct Next {
    rung: usize,
    passed_over: usize,
    expected: Option<Cost>,
}

struct Sweep<'a, E> {
    machine: &'a Machine<'a, E>,
    goal: Goal<'a>,
    families: Vec<Family>,
    ladders: Vec<Ladder>,
    cases: Cases,
    found: Tradeoff,
}

/// Measures the families within the budget, and says what is worth its cost. `progress` is told what is run next.
///
/// # Errors
///
/// That of the machine: where a setting that was planned cannot be run after all.
pub fn tradeoff<E>(
    families: &[Setting],
    goal: &Goal<'_>,
    machine: &Machine<'_, E>,
    progress: &mut dyn FnMut(&Setting),
) -> Result<Tradeoff, E> {
    let mut sweep = Sweep::new(families, goal, machine, Cases::Chosen);
    sweep.climb(progress)?;
    sweep.compare_settings(progress)?;
    sweep.name_cheapest(progress)?;
    sweep.fill(progress)?;
    sweep.conclude(progress)
}

/// Measures each of `families` at each of `cases`, the pairs of cell count and CFL number, and says what is worth its cost.
/// Budgets count for nothing, and what does not fit the solution is left out.
///
/// # Errors
///
/// As [`tradeoff`].
pub fn listed<E>(
    families: &[Setting],
    cases: &[(usize, f64)],
    goal: &Goal<'_>,
    machine: &Machine<'_, E>,
    progress: &mut dyn FnMut(&Setting),
) -> Result<Tradeoff, E> {
    let goal = Goal { budget_s: f64::INFINITY, ..*goal };
    let mut sweep = Sweep::new(families, &goal, machine, Cases::Listed);
    for (family, setting) in list(families, cases, machine.plan) {
        if sweep.run(family, &setting, progress)?.is_none() {
            sweep.skip(Skip::Refused, 1);
        }
    }
    sweep.name_cheapest(progress)?;
    sweep.conclude(progress)
}

/// The settings of [`listed`] that fit the solution, each with the index of its family.
pub fn list(
    families: &[Setting],
    cases: &[(usize, f64)],
    plan: &dyn Fn(&Setting) -> Option<Plan>,
) -> Vec<(usize, Setting)> {
    let at = |family: &Setting, &(cells, cfl): &(usize, f64)| Setting {
        case: Case { cells, cfl, ..family.case },
        ..*family
    };
    let all = families
        .iter()
        .enumerate()
        .flat_map(|(index, family)| cases.iter().map(move |case| (index, at(family, case))));
    all.filter(|(_, setting)| plan(setting).is_some()).collect()
}

/// Where cases come from.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Cases {
    /// One follows from another, as long as the budget lasts.
    Chosen,
    /// They are stated, and may have been run elsewhere.
    Listed,
}

impl<'a, E> Sweep<'a, E> {
    fn new(
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
        let ladder = |(family, setting): (usize, &Setting)| Ladder {
            family,
            cfl: setting.case.cfl,
            next: 0,
            known: Vec::new(),
            parent: None,
            halvings: 0,
            open: true,
        };
        Self {
            machine,
            goal: *goal,
            families: families.iter().map(known).collect(),
            ladders: families.iter().enumerate().map(ladder).collect(),
            cases,
            found: Tradeoff { families: families.len(), ..Tradeoff::default() },
        }
    }

    /// Conclusions from all that was run.
    fn conclude(mut self, progress: &mut dyn FnMut(&Setting)) -> Result<Tradeoff, E> {
        self.found.for_tolerance = self.prove(self.cheapest_for_tolerance(), progress)?;
        self.found.for_time = self.prove(self.best_in_time(), progress)?;
        self.found.front = self.front();
        self.found.effects = self.effects();
        Ok(self.found)
    }
}

impl<E> Sweep<'_, E> {
    /// Seconds until a phase ends.
    fn left(&self, phase: usize) -> f64 {
        PHASES[phase] * self.goal.budget_s - (self.machine.clock)()
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

    fn expected_cost(&self, plan: &Plan, cost: &Cost, threads: usize) -> f64 {
        match self.goal.against {
            Against::Wall => cost.steps_s,
            Against::Cpu => cost.steps_s * threads as f64,
            Against::Steps => plan.steps as f64,
            Against::Memory => plan.bytes,
        }
    }

    fn skip(&mut self, reason: Skip, count: usize) {
        if count > 0 {
            *self.found.skipped.entry(reason).or_default() += count;
        }
    }

    /// Runs the ladders from cheap to dear.
    fn climb(&mut self, progress: &mut dyn FnMut(&Setting)) -> Result<(), E> {
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
                match self.next(&self.ladders[index], own, &front, left) {
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

    /// The next run of a ladder that may be worth it, or why there is none, with the number of grids that this is said of.
    fn next(
        &self,
        ladder: &Ladder,
        own: &[(f64, f64)],
        all: &[(f64, f64)],
        left: f64,
    ) -> Result<Next, (Skip, usize)> {
        let family = &self.families[ladder.family];
        if let [.., (_, a), (_, b)] = ladder.known.as_slice()
            && ladder.known.len() >= 4
            && b / a > 0.95
        {
            return Err((Skip::NoGain, 1));
        }
        let mut passed_over = 0;
        for rung in ladder.next..LADDER.len() {
            let Some(plan) = family.plan(rung, ladder.cfl) else { continue };
            if plan.bytes > self.goal.most_bytes {
                return Err((Skip::Memory, 1 + passed_over));
            }
            let Some(cost) = family.cost.predict(&plan) else {
                return match left > 0.0 {
                    true => Ok(Next { rung, passed_over, expected: None }),
                    false => Err((Skip::Budget, 1)),
                };
            };
            let most = left.min(LARGEST_RUN * self.goal.budget_s);
            if UNCERTAINTY * cost.total_s > most {
                // If all that can be paid for is dominated, that is why the ladder ends.
                let reason = if passed_over > 0 { Skip::Dominated } else { Skip::Budget };
                return Err((reason, 1.max(passed_over)));
            }
            let error = match (ladder.known.is_empty(), ladder.parent) {
                (true, Some(parent)) => Some(parent.error * parent.factor.powi(2).min(1.0)),
                _ => extrapolate(&ladder.known, LADDER[rung], hint(&family.setting)),
            };
            let price = self.expected_cost(&plan, &cost, family.setting.threads);
            let is_below = |points: &[(f64, f64)]| {
                error.is_some_and(|error| {
                    points.iter().any(|&(known, least)| known <= price && MARGIN * least <= error)
                })
            };
            let is_dear = cost.total_s > LARGEST_DOMINATED * self.goal.budget_s;
            let is_dominated = is_below(own) || is_dear && is_below(all);
            if !is_dominated {
                return Ok(Next { rung, passed_over, expected: Some(cost) });
            }
            passed_over += 1;
        }
        Err((Skip::Dominated, passed_over))
    }

    /// Runs one rung of a ladder, and decides how the ladder goes on.
    fn ascend(
        &mut self,
        index: usize,
        rung: usize,
        progress: &mut dyn FnMut(&Setting),
    ) -> Result<(), E> {
        let Ladder { family, cfl, parent, halvings, .. } = self.ladders[index];
        let cells = LADDER[rung];
        let setting = self.families[family].setting;
        let setting = Setting { case: Case { cells, cfl, ..setting.case }, ..setting };
        self.ladders[index].next = rung + 1;
        let Some(entry) = self.run(family, &setting, progress)? else {
            self.skip(Skip::Refused, 1);
            return Ok(());
        };
        let error = self.error(entry);
        let branch = |sweep: &mut Self, factor: f64, parent: Option<Parent>, halvings| {
            sweep.ladders.push(Ladder {
                family,
                cfl: factor * cfl,
                next: rung,
                known: Vec::new(),
                parent,
                halvings,
                open: true,
            });
        };
        if self.found.entries[entry].row.status != Status::Ok || !error.is_finite() {
            self.ladders[index].open = false;
            self.skip(Skip::Stopped, 1);
            if parent.is_none() && halvings < 2 {
                branch(self, 0.5, None, halvings + 1);
            }
            return Ok(());
        }
        self.ladders[index].known.push((cells, error));
        match (parent, self.ladders[index].known.len()) {
            (Some(Parent { error: before, factor }), 1) => {
                let worth = if factor < 1.0 { error < 0.8 * before } else { error < 1.5 * before };
                if worth {
                    branch(self, factor, Some(Parent { error, factor }), halvings);
                } else {
                    self.ladders[index].open = false;
                    self.skip(Skip::Cfl, 1);
                }
            }
            (None, 3) => {
                branch(self, 0.5, Some(Parent { error, factor: 0.5 }), halvings);
                if halvings == 0 {
                    branch(self, 2.0, Some(Parent { error, factor: 2.0 }), halvings);
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// The entry of a setting, run now if it was not yet; none where the solver refuses it.
    fn run(
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
    fn compare_settings(&mut self, progress: &mut dyn FnMut(&Setting)) -> Result<(), E> {
        let cheap = 0.004 * self.goal.budget_s;
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

    /// For each tolerance the cheapest setting that meets it, and whose neighbours do.
    fn name_cheapest(&mut self, progress: &mut dyn FnMut(&Setting)) -> Result<(), E> {
        let mut wanted: Vec<f64> = TOLERANCES.into_iter().chain(self.goal.tolerance).collect();
        wanted.sort_by(|a, b| b.total_cmp(a));
        wanted.dedup();
        // Neighbours that are run here are not candidates themselves, or their neighbours would have to be run in turn.
        let candidates = self.found.entries.len();
        for tolerance in wanted {
            let mut order: Vec<usize> =
                (0..candidates).filter(|&i| self.error(i) <= tolerance).collect();
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
            self.found.tolerances.push(named);
        }
        Ok(())
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
    fn fill(&mut self, progress: &mut dyn FnMut(&Setting)) -> Result<(), E> {
        let named: Vec<usize> = self.found.tolerances.iter().filter_map(|t| t.entry).collect();
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

    /// Effects of the change of each setting: of all pairs of runs that differ in it alone, the finest few whose time says
    /// something, or else the finest few, for each pair of values.
    fn effects(&self) -> Vec<Effect> {
        let entries = &self.found.entries;
        let Some(plain) = self.families.first().map(|family| family.setting) else {
            return Vec::new();
        };
        let mut changes: Vec<(Change, Vec<(usize, usize)>)> = Vec::new();
        for from in 0..entries.len() {
            for to in 0..entries.len() {
                let (a, b) = (&entries[from].setting, &entries[to].setting);
                let &[name] = differences(a, b).as_slice() else { continue };
                // Told of plain settings: with f32 or PIC, say, another setting's effect is another one.
                let is_plain = !a.single
                    && a.threads == plain.threads
                    && a.case.cfl <= plain.case.cfl
                    && a.case.scheme.updated().is_none_or(|updated| {
                        updated.transfer == Transfer::Flip
                            && (a.case.per_cell == 2 || name == SettingName::Ppc)
                    });
                let Some(change) = Change::of(name, a, b).filter(|_| is_plain) else { continue };
                let error = self.error(to) / self.error(from);
                if !(error.is_finite() && error > 0.0) {
                    continue;
                }
                match changes.iter_mut().find(|(known, _)| *known == change) {
                    Some((_, pairs)) => pairs.push((from, to)),
                    None => changes.push((change, vec![(from, to)])),
                }
            }
        }
        let mut effects: Vec<Effect> =
            changes.into_iter().filter_map(|(change, pairs)| self.effect(change, pairs)).collect();
        effects.sort_by_key(|effect| effect.setting);
        effects
    }

    fn effect(&self, change: Change, mut pairs: Vec<(usize, usize)>) -> Option<Effect> {
        let entries = &self.found.entries;
        let is_timed =
            |&(from, to): &(usize, usize)| lasts(&entries[from].walls) && lasts(&entries[to].walls);
        if pairs.iter().any(is_timed) {
            pairs.retain(is_timed);
        }
        pairs.sort_by_key(|&(from, _)| std::cmp::Reverse(entries[from].setting.case.cells));
        pairs.truncate(MOST_PAIRS);
        let walls: Vec<_> = pairs
            .iter()
            .map(|&(from, to)| (entries[from].walls.as_slice(), entries[to].walls.as_slice()))
            .collect();
        let errors = pairs.iter().map(|&(from, to)| self.error(to) / self.error(from));
        let &(from, to) = pairs.first()?;
        Some(Effect {
            setting: change.name(),
            from,
            to,
            pairs: pairs.len(),
            time: TimeEffect::of(&walls),
            error: Range::of(errors)?,
        })
    }
}

/// A scheme's weights alone: all else as usual.
fn basis(scheme: &Scheme) -> Scheme {
    match *scheme {
        Scheme::Updated(Updated { shape, .. }) => {
            Scheme::Updated(Updated { shape, ..Updated::default() })
        }
        Scheme::Total(total) => Scheme::Total(Total::of_degree(total.degree)),
    }
}

/// A scheme's weights, and how it goes on in time: all else as usual.
fn basis_in_time(scheme: &Scheme) -> Scheme {
    match *scheme {
        Scheme::Updated(Updated { shape, stepping, .. }) => {
            Scheme::Updated(Updated { shape, stepping, ..Updated::default() })
        }
        Scheme::Total(Total { degree, composition, .. }) => {
            Scheme::Total(Total { composition, ..Total::of_degree(degree) })
        }
    }
}

/// A change of one setting. Changes that are equal are told together, with the range of what they do.
#[derive(Clone, Copy, PartialEq)]
enum Change {
    Cells(Scheme),
    Cfl(Scheme),
    Ppc(Scheme, usize),
    Shape { from: Shape, to: Shape },
    Degree(usize),
    Integrator(Shape, Stepping),
    Composition { degree: usize, from: Composition },
    Transfer(Shape, Transfer),
    Layout(Scheme),
    Mass(usize),
    Precision(Shape),
    Threads(Shape),
}

impl Change {
    /// The change of the setting `name` from `a` to `b`; none for the other way round, and for what nobody asks for.
    fn of(name: SettingName, a: &Setting, b: &Setting) -> Option<Self> {
        let is_usual = |updated: &Updated| {
            updated.shape == Shape::Gimp || updated.placement == Placement::BodyFitted
        };
        match (name, &a.case.scheme, &b.case.scheme) {
            (SettingName::Cells, ..) => {
                (b.case.cells == 2 * a.case.cells).then(|| Self::Cells(weights(&a.case.scheme)))
            }
            (SettingName::Cfl, scheme, _) => (b.case.cfl == a.case.cfl / 2.0
                && scheme.updated().is_none_or(is_usual))
            .then(|| Self::Cfl(basis_in_time(scheme))),
            (SettingName::Ppc, scheme, _) => (b.case.per_cell == a.case.per_cell + 1)
                .then(|| Self::Ppc(basis(scheme), a.case.per_cell)),
            (SettingName::Shape, Scheme::Total(from), Scheme::Total(to)) => {
                (to.degree == from.degree + 1).then_some(Self::Degree(from.degree))
            }
            (SettingName::Shape, Scheme::Updated(from), Scheme::Updated(to)) => {
                is_usual(from).then_some(Self::Shape { from: from.shape, to: to.shape })
            }
            // From centred differences to another one; between compositions to the next order.
            (SettingName::Integrator, Scheme::Updated(from), Scheme::Updated(to)) => {
                matches!(from.stepping, Stepping::Cd(_))
                    .then_some(Self::Integrator(from.shape, to.stepping))
            }
            (SettingName::Integrator, Scheme::Total(from), Scheme::Total(to)) => {
                (to.composition.order() == from.composition.order() + 2)
                    .then_some(Self::Composition { degree: from.degree, from: from.composition })
            }
            (SettingName::Transfer, Scheme::Updated(from), Scheme::Updated(to)) => {
                (from.transfer == Transfer::Flip).then_some(Self::Transfer(from.shape, to.transfer))
            }
            (SettingName::Layout, Scheme::Updated(from), _) => {
                matches!(from.placement, Placement::Lattice { .. })
                    .then(|| Self::Layout(basis(&a.case.scheme)))
            }
            (SettingName::Layout, Scheme::Total(from), _) => {
                (from.layout == Layout::Lattice).then(|| Self::Layout(basis(&a.case.scheme)))
            }
            (SettingName::Mass, Scheme::Total(from), _) => {
                (from.mass == MassMatrix::Lumped).then_some(Self::Mass(from.degree))
            }
            (SettingName::Precision, Scheme::Updated(from), _) => {
                (!a.single).then_some(Self::Precision(from.shape))
            }
            (SettingName::Threads, Scheme::Updated(from), _) => {
                (b.threads > a.threads).then_some(Self::Threads(from.shape))
            }
            // Frames are no setting that is compared.
            _ => None,
        }
    }

    fn name(self) -> SettingName {
        match self {
            Self::Cells(_) => SettingName::Cells,
            Self::Cfl(..) => SettingName::Cfl,
            Self::Ppc(..) => SettingName::Ppc,
            Self::Shape { .. } | Self::Degree(_) => SettingName::Shape,
            Self::Integrator(..) | Self::Composition { .. } => SettingName::Integrator,
            Self::Transfer(..) => SettingName::Transfer,
            Self::Layout(_) => SettingName::Layout,
            Self::Mass(_) => SettingName::Mass,
            Self::Precision(_) => SettingName::Precision,
            Self::Threads(_) => SettingName::Threads,
        }
    }
}

/// The setting on the next coarser and the next finer grid that fit.
fn neighbours(setting: &Setting, plan: &dyn Fn(&Setting) -> Option<Plan>) -> Vec<Setting> {
    let cells = setting.case.cells;
    let at = |cells| Setting { case: Case { cells, ..setting.case }, ..*setting };
    let fits = |&cells: &usize| plan(&at(cells)).is_some();
    let coarser = (1..cells).rev().take(32).find(fits);
    let finer = (cells + 1..cells + 33).find(fits);
    coarser.into_iter().chain(finer).map(at).collect()
}

/// The median; of an even number the mean of the middle two.
#[must_use]
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    match sorted.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => sorted[middle],
        _ => f64::midpoint(sorted[middle - 1], sorted[middle]),
    }
}

#[cfg(test)]
mod tests;
