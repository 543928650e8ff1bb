//! Effects of single settings on time and error.

use mmsmith_galerkin::{Composition, Layout, MassMatrix};
use mmsmith_mpm::{Integrator, Shape, Transfer};
use serde::Serialize;

use super::policy::weights;
use super::{Entry, Setting, median};
use crate::scheme::{Placement, Scheme, Total, Updated};

/// Shorter runs are not compared by their time.
pub(super) const LEAST_TIMED_S: f64 = 0.05;
/// Times that differ by no more than this share may do so by chance, however few timings there are.
const SCATTER: f64 = 0.05;
/// The most pairs of runs that an effect is told of, the finest ones.
pub(super) const MOST_PAIRS: usize = 3;
/// Effects below this factor are not worth telling.
const LEAST_EFFECT: f64 = 1.1;

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

/// Which settings differ.
#[must_use]
pub fn differences(a: &Setting, b: &Setting) -> Vec<SettingName> {
    let (x, y) = (&a.case, &b.case);
    let [shape, integrator, transfer, layout, mass] = match (&x.scheme, &y.scheme) {
        (Scheme::Updated(x), Scheme::Updated(y)) => [
            x.shape != y.shape,
            (x.integrator, x.start) != (y.integrator, y.start),
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

/// Entries whose effects are compared.
pub(super) struct Compared<'a> {
    pub(super) entries: &'a [Entry],
    /// The error of each entry, not a number for a run that stopped.
    pub(super) errors: &'a [f64],
    /// The first family that was tried.
    pub(super) plain: Setting,
}

impl Compared<'_> {
    /// Effects of the change of each setting: of all pairs of runs that differ in it alone, the finest few whose time says
    /// something, or else the finest few, for each pair of values.
    pub(super) fn effects(&self) -> Vec<Effect> {
        let Self { entries, errors, plain } = self;
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
                let error = errors[to] / errors[from];
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
        let Self { entries, errors, .. } = self;
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
        let errors = pairs.iter().map(|&(from, to)| errors[to] / errors[from]);
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
        Scheme::Updated(Updated { shape, integrator, start, .. }) => {
            Scheme::Updated(Updated { shape, integrator, start, ..Updated::default() })
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
    Integrator(Shape, Integrator),
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
                (from.integrator == Integrator::Cd)
                    .then_some(Self::Integrator(from.shape, to.integrator))
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
