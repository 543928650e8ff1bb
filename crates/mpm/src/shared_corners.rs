//! The corners that polygons share, with their shares of means and mean gradients at the current positions.

use nalgebra::SVector;

use crate::corner_halo::CornerHalo;
use crate::fault::Fault;
use crate::geometry::Constants;
use crate::node::Node;
use crate::parallel::chunks::{each, each_chunk};
use crate::polygons::{Polygons, Share};
use crate::shape_function::ProductShape;
use crate::simd::Lanes;

/// Corners or particles handed to a thread at a time; fixed, so that nothing depends on the number of threads.
pub(crate) const CHUNK: usize = 1024;

/// Polygons, with the shares of their corners at the current positions.
#[derive(Debug)]
pub(crate) struct SharedCorners<T, const D: usize> {
    pub(crate) polygons: Polygons<T, D>,
    /// Positions at the end of a step.
    next: Vec<SVector<T, D>>,
    /// Whether shares and areas are those of the positions.
    is_measured: bool,
    /// For each place in the list of corners.
    pub(crate) shares: Vec<Share<T, D>>,
    /// The area of each particle.
    volumes: Vec<T>,
    /// The places of each corner, corner after corner.
    places: Vec<Place>,
    /// Where those of each corner end.
    ends: Vec<u32>,
    /// The shape function at a corner, by which it reaches nodes.
    pub(crate) at_corner: ProductShape<T, D>,
    /// How many corners this process sorts: the first ones.
    own: usize,
    /// Where the others are.
    pub(crate) halo: Option<CornerHalo>,
}

/// A place in the list of corners, and the particle that it belongs to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub(crate) share: u32,
    pub(crate) particle: u32,
}

impl<T: Lanes, const D: usize> SharedCorners<T, D> {
    pub(crate) fn new(polygons: Polygons<T, D>, at_corner: ProductShape<T, D>) -> Self {
        let own = polygons.X.len();
        Self::of_part(polygons, at_corner, (own, None))
    }

    /// Where this process sorts the first `own` corners, and others do the rest.
    pub(crate) fn of_part(
        polygons: Polygons<T, D>,
        at_corner: ProductShape<T, D>,
        (own, halo): (usize, Option<CornerHalo>),
    ) -> Self {
        let mut places = vec![Place { share: 0, particle: 0 }; polygons.corners.len()];
        let mut ends = vec![0; polygons.X.len() + 1];
        for &corner in &polygons.corners {
            ends[corner as usize + 1] += 1;
        }
        for corner in 1..ends.len() {
            ends[corner] += ends[corner - 1];
        }
        let particles = polygons.of_particles.len();
        for p in 0..particles {
            for share in polygons.places(p) {
                let next = &mut ends[polygons.corners[share] as usize];
                places[*next as usize] = Place { share: share as u32, particle: p as u32 };
                *next += 1;
            }
        }
        ends.pop();
        let share = Share { corner: 0, w: T::zero(), g: [T::zero(); D] };
        let mut shares = vec![share; polygons.corners.len()];
        (0..particles).for_each(|p| polygons.means(p, &mut shares[polygons.places(p)]));
        let mut all = Self {
            next: polygons.x.clone(),
            is_measured: false,
            shares,
            volumes: vec![T::zero(); particles],
            places,
            ends,
            at_corner,
            polygons,
            own,
            halo,
        };
        all.measure();
        all
    }

    /// The positions, which the caller may overwrite.
    pub(crate) fn positions(&mut self) -> &mut [SVector<T, D>] {
        self.is_measured = false;
        &mut self.polygons.x
    }

    /// Computes shares and areas at the current positions, if they are of others.
    pub(crate) fn measure(&mut self) {
        let Self { polygons, shares, volumes, is_measured, .. } = self;
        if std::mem::replace(is_measured, true) {
            return;
        }
        let mut rest = &mut shares[..];
        let mut pieces = Vec::new();
        let mut done = 0;
        for (number, volumes) in volumes.chunks_mut(CHUNK).enumerate() {
            let first = number * CHUNK;
            let end = polygons.places(first + volumes.len() - 1).end;
            let (own, others) = std::mem::take(&mut rest).split_at_mut(end - done);
            (rest, done) = (others, end);
            pieces.push((first, volumes, own));
        }
        let polygons = &*polygons;
        each(pieces, &|(first, volumes, shares)| {
            let before = polygons.places(first).start;
            for (k, volume) in volumes.iter_mut().enumerate() {
                let places = polygons.places(first + k);
                let own = &mut shares[places.start - before..places.end - before];
                *volume = polygons.slopes(first + k, own);
            }
        });
    }

    /// The area of a particle.
    pub(crate) fn volume(&self, p: usize) -> T {
        self.volumes[p]
    }

    /// The shares of a particle's corners.
    pub(crate) fn of_particle(&self, p: usize) -> &[Share<T, D>] {
        &self.shares[self.polygons.places(p)]
    }

    /// The mean of a particle's polygons.
    pub(crate) fn centre(&self, p: usize) -> SVector<T, D> {
        let mut centre = SVector::zeros();
        for Share { corner, w, .. } in self.of_particle(p) {
            centre += self.polygons.x[*corner as usize] * *w;
        }
        centre
    }

    /// Number of corners.
    pub(crate) fn count(&self) -> usize {
        self.polygons.x.len()
    }

    /// Number of corners that this process sorts: the first ones.
    pub(crate) fn own(&self) -> usize {
        self.own
    }

    /// A corner's position along the axes of the grid.
    pub(crate) fn at(&self, corner: usize) -> SVector<T, D> {
        let x = self.polygons.x[corner];
        match &self.polygons.turn {
            Some(turn) => turn * x,
            None => x,
        }
    }

    /// The places of a corner.
    pub(crate) fn places_of(&self, corner: usize) -> &[Place] {
        let start = if corner == 0 { 0 } else { self.ends[corner - 1] };
        &self.places[start as usize..self.ends[corner] as usize]
    }

    /// A particle at a corner.
    pub(crate) fn particle_at(&self, corner: usize) -> usize {
        self.places_of(corner).first().map_or(0, |place| place.particle as usize)
    }

    /// Stores the positions after a step with the velocities `values` of the corners.
    pub(crate) fn follow(&mut self, c: &Constants<T, D>, values: &[Node<T, D>]) {
        let Self { polygons, next, .. } = self;
        let x = &polygons.x[..];
        // What wide splines leave of the velocity across a wall, which is zero but for rounding, would take a corner off the grid.
        let is_on_wall = |x: &SVector<T, D>, a: usize| {
            let (lower, upper) = c.range(a);
            polygons.turn.is_none() && (x[a] == lower || x[a] == upper)
        };
        each_chunk(next, CHUNK, &|chunk, next| {
            let first = chunk * CHUNK;
            for ((next, x), value) in next.iter_mut().zip(&x[first..]).zip(&values[first..]) {
                *next = *x;
                if !c.planted.is(Fault::CornersStay) {
                    for a in (0..D).filter(|a| !is_on_wall(x, *a)) {
                        next[a] += value.values[a] * c.time_step;
                    }
                }
            }
        });
    }

    /// Puts the corners at their new places.
    pub(crate) fn arrive(&mut self) {
        std::mem::swap(&mut self.polygons.x, &mut self.next);
        self.is_measured = false;
        self.measure();
    }
}
