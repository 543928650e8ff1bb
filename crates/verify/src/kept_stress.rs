//! The exact stress at points that a solver asks for step after step.

use std::sync::{Mutex, PoisonError};

use mmsmith_runtime::{BLOCK, Real, Solution, StateAtPoints, StateRun};
use nalgebra::{SMatrix, SVector};

/// Sets of points that are kept at a time: as many as a body has sides, for each of two kinds of data.
const MOST: usize = 12;

/// Stresses of a material with memory: the history of each point is followed once, and not again in each step.
pub(crate) struct KeptStress<'a, T: Real, const D: usize> {
    model: &'a dyn Solution<T, D>,
    has_memory: bool,
    kept: Mutex<Vec<Kept<'a, T, D>>>,
}

struct Kept<'a, T: Real, const D: usize> {
    X: Vec<SVector<T, D>>,
    state: Box<dyn StateAtPoints<T, D> + 'a>,
}

impl<'a, T: Real, const D: usize> KeptStress<'a, T, D> {
    pub(crate) fn new(model: &'a dyn Solution<T, D>) -> Self {
        let has_memory = !model.internal_variables().is_empty();
        Self { model, has_memory, kept: Mutex::new(Vec::new()) }
    }

    /// The first Piola-Kirchhoff stress at reference positions. None of a material without memory, whose functions take no longer.
    pub(crate) fn at(
        &self,
        X: impl Iterator<Item = SVector<T, D>> + Clone,
        t: T,
    ) -> Option<Vec<SMatrix<T, D, D>>> {
        if !self.has_memory {
            return None;
        }
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let found = kept.iter().position(|kept| kept.X.iter().copied().eq(X.clone()));
        let place = match found {
            Some(place) => place,
            None => {
                if kept.len() >= MOST {
                    kept.remove(0);
                }
                let X: Vec<_> = X.collect();
                let state = self.model.state_at(&X);
                kept.push(Kept { X, state });
                kept.len() - 1
            }
        };
        let Kept { X, state } = &kept[place];
        let mut runs = vec![StateRun::zero(); X.len().div_ceil(BLOCK)];
        state.evaluate(t, t, 0, &mut runs);
        Some((0..X.len()).map(|n| runs[n / BLOCK].get(n % BLOCK).P).collect())
    }
}
