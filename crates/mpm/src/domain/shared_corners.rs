//! The corners that domains of particles share, with their shares of means and mean gradients at the current positions.

use std::array;
use std::ops::Range;

use mmsmith_lanes::simd::{Lanes, One};
use mmsmith_lanes::tensor::determinant;
use mmsmith_laws::fault::Fault;
use mmsmith_particles::mesh::{CornerShare, Interpolation, Mesh};
use nalgebra::{SMatrix, SVector};

use crate::domain::of_particles::Domain;
use crate::grid::geometry::Constants;
use crate::grid::node::Node;
use crate::processes::corner_halo::CornerHalo;
use crate::shape::cells::{PAIRS, volume_of_cell};
use crate::shape::one_axis::ProductShape;
use crate::step::health::Invalid;
use mmsmith_threads::each;

/// Corners handed to a thread at a time; fixed, so that nothing depends on the number of threads.
pub(crate) const CHUNK: usize = 1024;

/// Particles whose contributions are summed together, by their numbers in the whole body; fixed, so that no sum depends on the number of
/// threads or processes. In space a plane of a lattice has many, and as many corners.
const fn per_chunk(dimension: usize) -> u64 {
    if dimension < 3 { 1024 } else { 4096 }
}

/// Domains, with the shares of their corners at the current positions.
#[derive(Debug)]
pub(crate) struct SharedCorners<T, const D: usize> {
    pub(crate) mesh: Mesh<T, D>,
    /// Positions at the end of a step.
    pub(crate) next: Vec<SVector<T, D>>,
    /// Polygons: whether shares and areas are those of the positions.
    are_shares_current: bool,
    pub(crate) measured: Measured<T, D>,
    /// Cells: whether a particle begins with the corners with which the one before it ends.
    pub(crate) shares_face_with_previous: Vec<bool>,
    /// Particles whose contributions are summed together.
    pub(crate) chunks: Vec<Chunk>,
    /// For each place in the list of corners which of its chunk's sums is that of its corner.
    pub(crate) sum_at: Vec<u32>,
    /// The sums of each corner, corner after corner, each in the order of chunks.
    sums: Vec<u32>,
    /// Where those of each corner end.
    ends: Vec<u32>,
    /// The shape function at a corner, by which it reaches nodes.
    pub(crate) at_corner: ProductShape<T, D>,
    /// How many corners this process sorts: the first ones.
    own: usize,
    /// Where the others are.
    pub(crate) halo: Option<CornerHalo>,
}

/// Polygons: shares and areas. Those of cells are computed where they are used, which takes less time than to read them from memory.
#[derive(Debug)]
pub(crate) struct Measured<T, const D: usize> {
    /// For each place in the list of corners.
    pub(crate) shares: Vec<CornerShare<T, D>>,
    /// The area of each particle.
    volumes: Vec<T>,
}

/// Shares of some successive particles.
pub(crate) struct MeasuredPart<'a, T, const D: usize> {
    shares: &'a mut [CornerShare<T, D>],
    volumes: &'a mut [T],
}

impl<T: Lanes, const D: usize> Measured<T, D> {
    pub(crate) fn none() -> Self {
        Self { shares: Vec::new(), volumes: Vec::new() }
    }

    fn new(mesh: &Mesh<T, D>) -> Self {
        let (mut shares, mut volumes) = (Vec::new(), Vec::new());
        if !mesh.is_of_cells() {
            let particles = mesh.of_particles.len();
            shares.resize(mesh.corners.len(), CornerShare { w: T::zero(), g: [T::zero(); D] });
            volumes.resize(particles, T::zero());
            (0..particles).for_each(|p| mesh.means(p, &mut shares[mesh.places(p)]));
        }
        Self { shares, volumes }
    }

    /// The shares of a particle and of the particles after it.
    pub(crate) fn from(&self, mesh: &Mesh<T, D>, first: usize) -> &[CornerShare<T, D>] {
        self.shares.get(mesh.places(first).start..).unwrap_or_default()
    }

    /// Split among successive particles, which are all.
    pub(crate) fn split(
        &mut self,
        mesh: &Mesh<T, D>,
        particles: impl Iterator<Item = Range<usize>>,
    ) -> Vec<MeasuredPart<'_, T, D>> {
        let (mut shares, mut volumes) = (&mut self.shares[..], &mut self.volumes[..]);
        let of_particles = particles.map(|particles| {
            let (start, end) =
                (mesh.places(particles.start).start, mesh.places(particles.end - 1).end);
            let of_shares = shares.len().min(end - start);
            let own = shares.split_off_mut(..of_shares).unwrap_or_default();
            let of_volumes = volumes.len().min(particles.len());
            let volumes = volumes.split_off_mut(..of_volumes).unwrap_or_default();
            MeasuredPart { shares: own, volumes }
        });
        of_particles.collect()
    }
}

impl<T: Lanes, const D: usize> MeasuredPart<'_, T, D> {
    /// The shares of a particle and the ones after it, where the first one of all is `of_all`.
    pub(crate) fn from(
        &self,
        mesh: &Mesh<T, D>,
        (of_all, first): (usize, usize),
    ) -> &[CornerShare<T, D>] {
        let start = mesh.places(first).start - mesh.places(of_all).start;
        self.shares.get(start..).unwrap_or_default()
    }

    /// Computes those of some particles between corners at `x`, where the first one of all is `of_all`; tells whether all have an area.
    pub(crate) fn at(
        &mut self,
        mesh: &Mesh<T, D>,
        x: &[SVector<T, D>],
        (of_all, particles): (usize, Range<usize>),
    ) -> bool {
        let before = mesh.places(of_all).start;
        let volumes = self.volumes.get_mut(particles.start - of_all..).unwrap_or_default();
        let mut have_area = true;
        for (p, volume) in particles.zip(volumes) {
            let places = mesh.places(p);
            let own = &mut self.shares[places.start - before..places.end - before];
            *volume = mesh.slopes(x, p, own);
            have_area &= *volume > T::zero();
        }
        have_area
    }
}

/// Successive particles, and their sums: one for each corner at which one of them is.
#[derive(Clone, Debug)]
pub(crate) struct Chunk {
    pub(crate) particles: Range<usize>,
    pub(crate) sums: Range<usize>,
}

impl<T: Lanes, const D: usize> SharedCorners<T, D> {
    pub(crate) fn new(mesh: Mesh<T, D>, at_corner: ProductShape<T, D>) -> Self {
        let ids: Vec<u64> = (0..mesh.of_particles.len() as u64).collect();
        let own = mesh.X.len();
        Self::of_part(mesh, at_corner, &ids, (own, None))
    }

    /// Corners of the particles with these numbers in the whole body, ascending, where this process sorts the first `own` corners, and others do the
    /// rest.
    pub(crate) fn of_part(
        mesh: Mesh<T, D>,
        at_corner: ProductShape<T, D>,
        ids: &[u64],
        (own, halo): (usize, Option<CornerHalo>),
    ) -> Self {
        let count = mesh.X.len();
        let mut chunks: Vec<Chunk> = Vec::new();
        let mut sum_at = Vec::with_capacity(mesh.corners.len());
        // The corner of each sum.
        let mut corners: Vec<u32> = Vec::new();
        let mut first = 0;
        let of_one = |a: &u64, b: &u64| a / per_chunk(D) == b / per_chunk(D);
        for ids in ids.chunk_by(of_one) {
            let end = first + ids.len();
            let of_chunk = &mesh.corners[mesh.places(first).start..mesh.places(end - 1).end];
            let mut touched = of_chunk.to_vec();
            touched.sort_unstable();
            touched.dedup();
            let sum_of = |corner| touched.partition_point(|known| known < corner) as u32;
            sum_at.extend(of_chunk.iter().map(sum_of));
            let start = corners.len();
            corners.extend(&touched);
            chunks.push(Chunk { particles: first..end, sums: start..corners.len() });
            first = end;
        }
        let mut ends = vec![0; count + 1];
        for &corner in &corners {
            ends[corner as usize + 1] += 1;
        }
        for corner in 1..ends.len() {
            ends[corner] += ends[corner - 1];
        }
        let mut sums = vec![0; corners.len()];
        for (sum, &corner) in corners.iter().enumerate() {
            let next = &mut ends[corner as usize];
            sums[*next as usize] = sum as u32;
            *next += 1;
        }
        ends.pop();
        let mut all = Self {
            next: mesh.x.clone(),
            are_shares_current: false,
            measured: Measured::new(&mesh),
            shares_face_with_previous: continuations(&mesh),
            chunks,
            sum_at,
            sums,
            ends,
            at_corner,
            mesh,
            own,
            halo,
        };
        all.recompute_shares();
        all
    }

    /// The positions, which the caller may overwrite.
    pub(crate) fn positions_mut(&mut self) -> &mut [SVector<T, D>] {
        self.are_shares_current = false;
        &mut self.mesh.x
    }

    /// Polygons: computes shares and areas at the current positions, if they are of others.
    pub(crate) fn recompute_shares(&mut self) {
        let Self { mesh, measured, are_shares_current, .. } = self;
        if std::mem::replace(are_shares_current, true) {
            return;
        }
        let particles = mesh.of_particles.len();
        let firsts = (0..particles).step_by(CHUNK);
        let pieces = firsts.map(|first| first..particles.min(first + CHUNK));
        let pieces: Vec<_> = pieces.clone().zip(measured.split(mesh, pieces)).collect();
        let mesh = &*mesh;
        each(pieces, &|(particles, mut measured)| {
            let of_all = particles.start;
            measured.at(mesh, &mesh.x, (of_all, particles));
        });
    }

    /// The length, area or volume of a particle's domain.
    pub(crate) fn volume(&self, p: usize) -> T {
        let Mesh { interpolation, x, .. } = &self.mesh;
        match interpolation {
            Interpolation::Triangles => self.measured.volumes[p],
            Interpolation::Cell => {
                let own = self.mesh.of_particle(p);
                let at = |corner: usize, a: usize| One(x[own[corner % own.len()] as usize][a]);
                let x = array::from_fn(|corner| array::from_fn(|a| at(corner, a)));
                volume_of_cell::<_, D>(&x).0
            }
        }
    }

    /// Whether particles with these positions and deformation gradients are inside the grid and have a volume, whatever that of their
    /// domains. Polygons may have axes of their own; their corners are looked at themselves.
    pub(crate) fn are_inside(
        &self,
        c: &Constants<T, D>,
        x: &[SVector<T, D>],
        F: &[SMatrix<T, D, D>],
    ) -> bool {
        // No particle is the last one to be looked at, so that several are at once.
        let mut inside = true;
        for F in F {
            inside &= determinant(F) > T::zero();
        }
        if self.mesh.is_of_cells() {
            for x in x {
                for a in 0..D {
                    inside &= (x[a] >= c.lower[a]) & (x[a] <= c.upper[a]);
                }
            }
        }
        inside
    }

    /// The reason why a particle is invalid, if it is.
    pub(crate) fn invalidity(
        &self,
        c: &Constants<T, D>,
        p: usize,
        x: &SVector<T, D>,
        F: &SMatrix<T, D, D>,
    ) -> Option<Invalid> {
        if let Some(invalid) = Invalid::of_deformation(x, F) {
            return Some(invalid);
        }
        // Polygons may have axes of their own; their corners are looked at themselves.
        if self.mesh.is_of_cells() && c.axis_outside(x).is_some() {
            return Some(Invalid::LeftGrid);
        }
        let volume = self.volume(p);
        if volume <= T::zero() {
            return Some(Invalid::Inverted);
        }
        (!volume.is_finite()).then_some(Invalid::NotFinite)
    }

    /// The lower edges of what a corner reaches along all axes, in cells.
    pub(crate) fn edges(&self, c: &Constants<T, D>, corner: usize) -> [f64; D] {
        self.at_corner.edges(c, corner, &self.at(corner), &SMatrix::identity())
    }

    /// Number of corners.
    pub(crate) fn count(&self) -> usize {
        self.mesh.x.len()
    }

    /// Number of corners that this process sorts: the first ones.
    pub(crate) fn own(&self) -> usize {
        self.own
    }

    /// A corner's position along the axes of the grid.
    pub(crate) fn at(&self, corner: usize) -> SVector<T, D> {
        let x = self.mesh.x[corner];
        match &self.mesh.turn {
            Some(turn) => turn * x,
            None => x,
        }
    }

    /// The sums of a corner, in the order in which they are added.
    #[inline]
    pub(crate) fn sums_of(&self, corner: usize) -> &[u32] {
        let start = if corner == 0 { 0 } else { self.ends[corner - 1] };
        &self.sums[start as usize..self.ends[corner] as usize]
    }

    /// Number of sums.
    pub(crate) fn sums(&self) -> usize {
        self.sums.len()
    }

    /// The first particle at a corner.
    pub(crate) fn particle_at(&self, corner: usize) -> usize {
        let place = self.mesh.corners.iter().position(|own| *own as usize == corner);
        let place = place.unwrap_or(0);
        (0..self.mesh.of_particles.len()).find(|&p| self.mesh.places(p).end > place).unwrap_or(0)
    }

    /// Writes the positions after a step of corners from `first` on, which have these velocities.
    pub(crate) fn advect(
        &self,
        c: &Constants<T, D>,
        first: usize,
        velocities: &[Node<T, D>],
        next: &mut [SVector<T, D>],
    ) {
        let Mesh { x, turn, .. } = &self.mesh;
        let x = &x[first..][..next.len()];
        if c.planted.is(Fault::CornersStay) {
            next.copy_from_slice(x);
            return;
        }
        let is_turned = turn.is_some();
        for ((next, x), velocity) in next.iter_mut().zip(x).zip(velocities) {
            for a in 0..D {
                let moved = x[a] + velocity.values[a] * c.time_step;
                // What rounding leaves of the velocity across a wall would take a corner off the grid.
                next[a] = if is_turned || !c.is_on_wall(x, a) { moved } else { x[a] };
            }
        }
    }

    /// Puts the corners at their new places, at which shares are known or not.
    pub(crate) fn commit_positions(&mut self, are_shares_current: bool) {
        std::mem::swap(&mut self.mesh.x, &mut self.next);
        self.are_shares_current = are_shares_current;
        self.recompute_shares();
    }
}

/// For each cell whether it goes on with the corners of the one before it.
fn continuations<T: Lanes, const D: usize>(mesh: &Mesh<T, D>) -> Vec<bool> {
    if !mesh.is_of_cells() {
        return Vec::new();
    }
    let cells = || mesh.corners.chunks(1 << D);
    let of_pairs =
        cells().zip(cells().skip(1)).map(|(before, own)| shares_face_with_previous(before, own));
    std::iter::once(false).chain(of_pairs).collect()
}

/// Whether a cell begins with the corners with which the one before it ends, and no corner is among them twice.
fn shares_face_with_previous(before: &[u32], own: &[u32]) -> bool {
    let pairs = &PAIRS[..own.len() / 2];
    let mut all: Vec<u32> = before.to_vec();
    all.extend(pairs.iter().map(|[_, last]| own[*last]));
    let count = all.len();
    all.sort_unstable();
    all.dedup();
    all.len() == count && pairs.iter().all(|[first, last]| own[*first] == before[*last])
}
