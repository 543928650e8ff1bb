//! The errors of a solver's particles, whichever process holds them.

use std::sync::Arc;

use mmsmith_measure::norms::{PerField, PerNorm};
use mmsmith_measure::{Comparison, Homes};
use mmsmith_mpm::{Arrangement, Solver};
use mmsmith_ranks::Ranks;
use mmsmith_runtime::Solution;

use crate::precision::Precision;

/// Comparison of particles with the exact solution.
pub(crate) struct Measurement<'a, const D: usize> {
    exact: &'a dyn Solution<f64, D>,
    comparison: Comparison<'a, D>,
    /// Where several processes hold the particles.
    shared: Option<Shared>,
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

impl<'a, const D: usize> Measurement<'a, D> {
    /// For the particles that a solver has now.
    pub(crate) fn new<T: Precision<D>>(
        exact: &'a dyn Solution<f64, D>,
        solver: &mut (dyn Solver<T, D> + '_),
        ranks: Option<&Arc<dyn Ranks>>,
    ) -> Self {
        let comparison = Comparison::new(exact, &solver.observe().0.X);
        let shared = ranks.zip(solver.arrangement());
        let shared = shared.map(|(ranks, found)| Shared::new(ranks.clone(), found));
        Self { exact, comparison, shared }
    }

    /// Takes note of particles that have moved from process to process.
    pub(crate) fn follow<T: Precision<D>>(&mut self, solver: &mut (dyn Solver<T, D> + '_)) {
        let Some(shared) = &mut self.shared else { return };
        let Some(found) = solver.arrangement().filter(|found| found.version != shared.version)
        else {
            return;
        };
        *shared = Shared::new(shared.ranks.clone(), found);
        self.comparison = Comparison::new(self.exact, &solver.observe().0.X);
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
