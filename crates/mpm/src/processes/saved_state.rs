//! The state of a simulation between two steps, as bytes, and simulations that go on from it.
//!
//! A process saves the particles that it holds. Any number of processes goes on with them: first each particle goes to a process that
//! follows from its number, where its state is put in place, then to the process of the tile that it was sorted into before the state was
//! saved. The order of all sums is that of the last sort, so the bits of what follows are those of a run that was never saved.

use std::slice;

use bytemuck::{Pod, bytes_of, cast_slice, cast_slice_mut};
use mmsmith_lanes::simd::Lanes;
use mmsmith_particles::columns::{EachColumn, MovingColumns, Shares};
use mmsmith_particles::mesh::Mesh;
use mmsmith_particles::{SavedState, SavedStateError};
use mmsmith_ranks::total;
use nalgebra::SVector;

use crate::domain::corners::Corners;
use crate::every_scheme::EVERY_SCHEME;
use crate::grid::state::GridState;
use crate::simulation::Simulation;
use crate::step::state::State;
use mmsmith_ranks::Move;
use mmsmith_ranks::{Answers, Directory};

/// The state of some particles, each array in the same order.
struct Saved<T, const D: usize> {
    kind: Kind,
    steps_done: usize,
    ids: Vec<u64>,
    /// The tile of each at the last sort.
    keys: Vec<u32>,
    columns: MovingColumns<T, D>,
    /// Shared corners: the numbers of those that have the keys.
    corner_ids: Vec<u64>,
    /// Their positions.
    corner_x: Vec<SVector<T, D>>,
}

/// The columns of a scheme's particles.
#[derive(Clone, Copy)]
struct Kind {
    shares: Shares,
    /// Whether they share corners. Keys are theirs then: those of the first ones, which one process alone has.
    has_corners: bool,
}

/// The elements of a saved array, which are as many as `count`.
fn elements<E: Pod>(bytes: Vec<u8>, count: usize) -> Result<Vec<E>, SavedStateError> {
    let (found, expected) = (bytes.len(), count * size_of::<E>());
    if found != expected {
        return Err(SavedStateError::Length { found, expected });
    }
    let mut elements = vec![E::zeroed(); count];
    cast_slice_mut(&mut elements).copy_from_slice(&bytes);
    Ok(elements)
}

impl<T: Lanes, const D: usize> Saved<T, D> {
    fn of_parts(parts: Vec<SavedState>, kind: Kind) -> Result<Self, SavedStateError> {
        let mut saved = Self {
            kind,
            steps_done: 0,
            ids: Vec::new(),
            keys: Vec::new(),
            columns: MovingColumns::none(),
            corner_ids: Vec::new(),
            corner_x: Vec::new(),
        };
        parts.into_iter().try_for_each(|part| saved.add(part))?;
        Ok(saved)
    }

    fn add(&mut self, part: SavedState) -> Result<(), SavedStateError> {
        let Kind { shares, has_corners } = self.kind;
        let of_particles = 3 + MovingColumns::<T, D>::COUNT;
        let (found, expected) = (part.len(), of_particles + if has_corners { 2 } else { 0 });
        if found != expected {
            return Err(SavedStateError::Arrays { found, expected });
        }
        let mut arrays = part.into_iter();
        let mut next = || arrays.next().unwrap_or_default();
        self.steps_done = elements(next(), 1)?[0];
        let (ids, keys) = (next(), next());
        let count = arrays.as_slice().first().map_or(0, |x| x.len() / size_of::<SVector<T, D>>());
        // Where one process had all, numbers are places.
        let numbers = |ids: Vec<u8>, count: usize| {
            if ids.is_empty() { Ok((0..count as u64).collect()) } else { elements(ids, count) }
        };
        self.ids.extend(numbers(ids, count)?);
        let mut saved = Append { count, arrays: &mut arrays, found: Ok(()) };
        self.columns.each(&shares, &mut saved);
        saved.found?;
        let mut next = || arrays.next().unwrap_or_default();
        let keyed = if has_corners { keys.len() / size_of::<u32>() } else { count };
        self.keys.extend(elements::<u32>(keys, keyed)?);
        if has_corners {
            let (x, ids) = (next(), next());
            let corners = x.len() / size_of::<SVector<T, D>>();
            let (x, ids) = (elements::<SVector<T, D>>(x, corners)?, numbers(ids, corners)?);
            if keyed > corners {
                return Err(SavedStateError::Place);
            }
            self.corner_x.extend(&x[..keyed]);
            self.corner_ids.extend(&ids[..keyed]);
        }
        Ok(())
    }

    /// Replaces the elements by those of the particles that are here after a move.
    fn follow(&mut self, moved: &Move) {
        moved.replace(&mut self.keys);
        self.columns.each(&self.kind.shares, &mut &*moved);
    }
}

/// Appends a saved array of so many particles to each column, in turn.
struct Append<'a, A> {
    count: usize,
    arrays: &'a mut A,
    found: Result<(), SavedStateError>,
}

impl<A: Iterator<Item = Vec<u8>>> EachColumn for Append<'_, A> {
    fn column<E: Pod>(&mut self, share: usize, column: &mut Vec<E>) {
        match elements(self.arrays.next().unwrap_or_default(), self.count * share) {
            Ok(elements) => column.extend::<Vec<E>>(elements),
            Err(error) => self.found = self.found.and(Err(error)),
        }
    }
}

/// Puts the elements that were asked for in the place of each column.
struct Fetch<'a>(&'a Answers);

impl EachColumn for Fetch<'_> {
    fn column<E: Pod>(&mut self, share: usize, column: &mut Vec<E>) {
        *column = self.0.fetch_shares(share, column);
    }
}

impl<T: Lanes, const D: usize> State<T, D> {
    /// The arrays of the particles here, but for the number of steps.
    fn arrays(&self) -> Vec<&[u8]> {
        let Self { particles, corners, grid, part, .. } = self;
        let GridState { bins, .. } = grid;
        let ids = part.as_ref().map_or(&[][..], |part| part.ids.as_slice());
        let mut arrays = vec![cast_slice(ids), cast_slice(bins.keys())];
        arrays.extend(particles.moving_bytes());
        if let Some(corners) = corners {
            let Mesh { x, numbers, .. } = &corners.shared.mesh;
            let numbers = numbers.as_ref().map_or(&[][..], |numbers| &numbers.corners);
            arrays.extend([cast_slice(x), cast_slice(numbers)]);
        }
        arrays
    }

    /// Whether this holds, for all processes.
    fn agreed<R>(&self, here: Result<R, SavedStateError>) -> Result<R, SavedStateError> {
        let is_elsewhere =
            self.part.as_ref().is_some_and(|part| part.ranks.largest(here.is_err().into()) > 0);
        here.and_then(|here| if is_elsewhere { Err(SavedStateError::Elsewhere) } else { Ok(here) })
    }

    /// Puts the saved state of all particles in place, of which this process has read some parts. Gives the number of steps.
    fn take_up(&mut self, parts: Vec<SavedState>) -> Result<usize, SavedStateError> {
        let kind = Kind { shares: self.shares, has_corners: self.corners.is_some() };
        let saved = self.agreed(Saved::of_parts(parts, kind))?;
        let is_grid = saved.keys.iter().all(|&key| self.grid.bins.tiles().has(key));
        self.agreed(if is_grid { Ok(()) } else { Err(SavedStateError::Place) })?;
        let steps_done = saved.steps_done as u64;
        // Those that have read no part do not know it.
        let ranks = self.part.as_ref().map(|part| part.ranks.clone());
        let steps_done = ranks.as_ref().map_or(steps_done, |ranks| ranks.largest(steps_done));
        let keys = match self.corners {
            Some(_) => self.put_mesh(saved)?,
            None => self.put_particles(saved)?,
        };
        self.sort_as(keys);
        Ok(steps_done as usize)
    }

    /// Puts particles in place that do not share corners, at processes that follow from their numbers. Gives their keys.
    fn put_particles(&mut self, mut saved: Saved<T, D>) -> Result<Vec<u32>, SavedStateError> {
        // No process knows where another one keeps a particle, and all know where it goes for the time being.
        let ranks = self.part.as_ref().map(|part| part.ranks.clone());
        let here = self.particles.len() as u64;
        let (processes, all) =
            ranks.as_ref().map_or((1, here), |ranks| (ranks.count(), total(&**ranks, here)));
        let is_known = saved.ids.iter().all(|&id| id < all);
        self.agreed(if is_known { Ok(()) } else { Err(SavedStateError::Particles) })?;
        let per_process = all.div_ceil(processes as u64).max(1);
        let home = |id: &u64| (id / per_process) as usize;
        if let Some(part) = &self.part {
            let homes: Vec<usize> = part.ids.iter().map(home).collect();
            self.give(&|p| slice::from_ref(&homes[p]));
        }
        let homes: Vec<usize> = saved.ids.iter().map(home).collect();
        let (moved, ids) = Move::new(ranks.as_ref(), &saved.ids, &|p| slice::from_ref(&homes[p]));
        saved.follow(&moved);
        let is_whole = match &self.part {
            Some(part) => ids == *part.ids,
            None => ids.iter().copied().eq(0..all),
        };
        self.agreed(if is_whole { Ok(()) } else { Err(SavedStateError::Particles) })?;

        self.particles.replace_moving(saved.columns);
        Ok(saved.keys)
    }

    /// Puts particles that share corners in place, where they are. Gives the keys of their corners.
    fn put_mesh(&mut self, mut saved: Saved<T, D>) -> Result<Vec<u32>, SavedStateError> {
        let Some(Corners { shared, .. }) = self.corners.as_deref() else { return Ok(Vec::new()) };
        let ranks = self.part.as_ref().map(|part| part.ranks.clone());
        let ids = match &self.part {
            Some(part) => part.ids.to_vec(),
            None => (0..self.particles.len() as u64).collect(),
        };
        let numbers: Vec<u64> =
            (0..shared.count()).map(|corner| shared.mesh.number(corner)).collect();
        let particles = Directory::new(ranks.as_ref(), &saved.ids).ask(&ids);
        let points = Directory::new(ranks.as_ref(), &saved.corner_ids).ask(&numbers);
        // All processes ask before one of them gives up.
        let is_whole = particles.is_whole && points.is_whole && points.is_unique;
        self.agreed(if is_whole { Ok(()) } else { Err(SavedStateError::Particles) })?;
        saved.columns.each(&self.shares, &mut Fetch(&particles));
        self.particles.replace_moving(saved.columns);
        let (x, keys) = (points.fetch(&saved.corner_x), points.fetch(&saved.keys));
        if let Some(corners) = &mut self.corners {
            corners.shared.positions_mut().copy_from_slice(&x);
        }
        Ok(keys)
    }
}

impl<T: Lanes, const D: usize> Simulation<T, D> {
    /// The state between two steps of the particles here: arrays as bytes in this machine's order.
    pub fn state(&self) -> Vec<&[u8]> {
        let mut state = vec![bytes_of(&self.steps_done)];
        state.extend(self.state.arrays());
        state
    }

    /// See [`take_up`](Self::take_up).
    pub(crate) fn put(&mut self, parts: Vec<SavedState>) -> Result<(), SavedStateError> {
        if !EVERY_SCHEME {
            return Err(SavedStateError::LeftOut);
        }
        // The grid no longer belongs to the particles.
        self.state.grid.is_ahead = false;
        self.steps_done = self.state.take_up(parts)?;
        self.failed = None;
        Ok(())
    }
}
