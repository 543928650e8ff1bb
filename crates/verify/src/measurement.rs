//! The errors of a solver's particles, whichever process holds them.

use std::sync::Arc;

use mmsmith_measure::norms::{PerField, PerNorm};
use mmsmith_measure::{Comparison, Homes, each_group, norms_of};
use mmsmith_mpm::{Arrangement, Particles, Solver};
use mmsmith_ranks::Ranks;
use mmsmith_runtime::{InternalAtPoints, Real, Solution};

use crate::precision::Precision;

/// Comparison of particles with the exact solution.
pub(crate) struct Measurement<'a, const D: usize> {
    exact: &'a dyn Solution<f64, D>,
    comparison: Comparison<'a, D>,
    exact_internal: Box<dyn InternalAtPoints<f64> + 'a>,
    /// Internal variables whose errors are measured.
    internal: Vec<Compared>,
    /// Where several processes hold the particles.
    shared: Option<Shared>,
}

/// An internal variable that is compared with its exact values.
struct Compared {
    name: String,
    /// Its place among the exact variables, and among those of the solver's law.
    place: usize,
    of_law: usize,
}

/// Particles in a group that one thread works on.
const GROUP: usize = 256;

/// The internal variables that tell of all: the plastic strain where there is one; of Maxwell elements a stress of the first; of a law that
/// a specification states all.
fn compared(exact: &[String], of_law: &[String]) -> Vec<Compared> {
    let is_told = |name: &str| match exact.iter().any(|name| name == "alpha") {
        true => name == "alpha",
        false => !name.starts_with('Q') || name == "Q1_11" || !exact.contains(&"Q1_11".to_owned()),
    };
    let of = |(place, name): (usize, &String)| {
        let of_law = of_law.iter().position(|own| own == name)?;
        is_told(name).then(|| Compared { name: name.clone(), place, of_law })
    };
    exact.iter().enumerate().filter_map(of).collect()
}

/// The particles that one of several processes holds.
#[derive(Clone, Copy)]
pub(crate) struct Held<'a> {
    pub(crate) ranks: &'a dyn Ranks,
    /// Their numbers in the whole body.
    pub(crate) ids: &'a [u64],
}

struct Shared {
    ranks: Arc<dyn Ranks>,
    homes: Homes,
    ids: Arc<Vec<u64>>,
    version: u64,
}

impl Shared {
    fn new(ranks: Arc<dyn Ranks>, arrangement: Arrangement<'_>) -> Self {
        let Arrangement { ids, version } = arrangement;
        Self { homes: Homes::new(ranks.clone(), ids), ranks, ids: ids.clone(), version }
    }
}

/// The exact internal variables at the reference positions of particles; of no point where the law has none.
fn exact_internal<'a, T: Precision<D>, const D: usize>(
    exact: &'a dyn Solution<f64, D>,
    particles: &Particles<T, D>,
) -> Box<dyn InternalAtPoints<f64> + 'a> {
    let X: Vec<_> = match exact.internal_variables().is_empty() {
        true => Vec::new(),
        false => particles.X.iter().map(|X| X.map(Real::to_f64)).collect(),
    };
    exact.internal_at(&X)
}

impl<'a, const D: usize> Measurement<'a, D> {
    /// For the particles that a solver has now.
    pub(crate) fn new<T: Precision<D>>(
        exact: &'a dyn Solution<f64, D>,
        solver: &mut (dyn Solver<T, D> + '_),
        ranks: Option<&Arc<dyn Ranks>>,
    ) -> Self {
        let (particles, law) = solver.observe();
        let comparison = Comparison::new(exact, &particles.X);
        let of_law: Vec<String> = law.variables().into_iter().map(|own| own.name).collect();
        let internal = compared(&exact.internal_variables(), &of_law);
        let exact_internal = exact_internal(exact, particles);
        let shared = ranks.zip(solver.arrangement());
        let shared = shared.map(|(ranks, found)| Shared::new(ranks.clone(), found));
        Self { exact, comparison, exact_internal, internal, shared }
    }

    /// Takes note of particles that have moved from process to process.
    pub(crate) fn follow<T: Precision<D>>(&mut self, solver: &mut (dyn Solver<T, D> + '_)) {
        let Some(shared) = &mut self.shared else { return };
        let Some(found) = solver.arrangement().filter(|found| found.version != shared.version)
        else {
            return;
        };
        *shared = Shared::new(shared.ranks.clone(), found);
        let particles = solver.observe().0;
        self.comparison = Comparison::new(self.exact, &particles.X);
        self.exact_internal = exact_internal(self.exact, particles);
    }

    /// Number of particles of all processes.
    pub(crate) fn count<T: Precision<D>>(&self, solver: &mut (dyn Solver<T, D> + '_)) -> usize {
        self.shared.as_ref().map_or_else(|| solver.observe().0.len(), |shared| shared.homes.count())
    }

    /// The errors at `time`, those of the velocity `lag` earlier; the same at all processes.
    pub(crate) fn errors<T: Precision<D>>(
        &self,
        solver: &mut (dyn Solver<T, D> + '_),
        time: f64,
        lag: f64,
    ) -> PerField<PerNorm<f64>> {
        match &self.shared {
            None => self.comparison.measure(solver.observe(), time, lag),
            Some(shared) => self.comparison.measure_all(&shared.homes, solver.observe(), time, lag),
        }
    }

    /// The errors of internal variables at `time`, by name; the same at all processes.
    pub(crate) fn internal_errors<T: Precision<D>>(
        &self,
        solver: &mut (dyn Solver<T, D> + '_),
        time: f64,
    ) -> Vec<(String, PerNorm<f64>)> {
        let Self { exact_internal, internal, .. } = self;
        if internal.is_empty() {
            return Vec::new();
        }
        let (particles, law) = solver.observe();
        let count = law.variables().len();
        let group = |g: usize| {
            let places = g * GROUP..particles.len().min((g + 1) * GROUP);
            let exact = exact_internal.evaluate(time, places.clone());
            let of_particle = |(p, exact): (usize, Vec<f64>)| {
                let own = &particles.internal[p * count..];
                let off = |of: &Compared| (own[of.of_law].to_f64() - exact[of.place]).abs();
                internal.iter().map(off).collect::<Vec<f64>>()
            };
            places.zip(exact).map(of_particle).collect::<Vec<_>>()
        };
        let magnitudes = each_group(particles.len().div_ceil(GROUP), &group).concat();
        let norms = |(k, of): (usize, &Compared)| {
            let own: Vec<f64> = magnitudes.iter().map(|of_particle| of_particle[k]).collect();
            (of.name.clone(), norms_of(self.homes(), &own))
        };
        internal.iter().enumerate().map(norms).collect()
    }

    /// The particle of largest position error at `time`.
    pub(crate) fn worst_particle<T: Precision<D>>(
        &self,
        solver: &mut (dyn Solver<T, D> + '_),
        time: f64,
    ) -> usize {
        match &self.shared {
            None => self.comparison.worst_particle(solver.observe(), time),
            Some(Shared { homes, ids, .. }) => {
                self.comparison.worst_of_all(homes, ids, solver.observe(), time)
            }
        }
    }

    /// Whether this or any other process is to stop.
    pub(crate) fn any(&self, own: bool) -> bool {
        self.shared.as_ref().map_or(own, |shared| shared.ranks.largest(own.into()) > 0)
    }

    /// The processes and the numbers of the particles here, where there are several.
    pub(crate) fn held(&self) -> Option<Held<'_>> {
        self.shared.as_ref().map(|Shared { ranks, ids, .. }| Held { ranks: &**ranks, ids })
    }

    /// Where sums over particles are formed, where several processes hold them.
    pub(crate) fn homes(&self) -> Option<&Homes> {
        self.shared.as_ref().map(|shared| &shared.homes)
    }
}
