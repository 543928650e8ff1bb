//! Domains of particles between corners that they share and that the grid moves: the cells of CPDI2, and polygons that fill a body of any
//! shape. In space these are polyhedra, with faces in place of edges: see `polyhedra`.
//!
//! The means over a cell are in the solver's shape functions. Any other particle is a list of polygons. Each is divided into the triangles
//! between its edges and the mean of its corners. Where a function is replaced by its interpolation between the corners, with the mean of their values at the mean of the corners, its mean over a
//! particle is `sum_c w_c N(x_c)`, and the mean of its gradient, by the divergence theorem, a sum over edges of length L and outward normal
//! n:
//!
//! ```text
//! w_c = sum of (T_- + T_+)/3 + A/(3 k) over the particle's polygons at c, over V     in the reference configuration
//! mean of grad N = (1/V) sum over edges of (N(x_a) + N(x_b))/2 L n                   in the current one
//! ```
//!
//! `T_-` and `T_+` are the triangles on either side of the corner, A the area of the polygon, k the number of its corners, V the area of the
//! particle. The mean goes by mass, which is spread evenly over the reference configuration. An edge between two particles has opposite
//! normals in both: in `sum_p V_p grad N` it cancels, and the integral of `N n` over the boundary remains. That is the condition under
//! which a constant stress gives no force inside (Chen, Wu, Yoon & You, IJNME 50 (2001) 435-466).

pub mod part;
mod polyhedra;

use mmsmith_lanes::tensor::real;
use nalgebra::{RealField, SMatrix, SVector};

use crate::error::SetupError;

/// How a function is interpolated between the corners of a particle's domain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// Over the triangles of polygons, the tetrahedra of polyhedra, that are around the mean of their corners.
    Triangles,
    /// Over one cell with `2^D` corners, in as many variables: CPDI2 (Sadeghirad, Brannon & Guilkey, IJNME 95 (2013) 928-952). Means are
    /// those in the current configuration. The corners of a segment go from left to right, those of a quadrilateral counter-clockwise;
    /// those of a hexahedron are those of its lower face, counter-clockwise as seen from above, and then those above them.
    Cell,
}

/// Particles' domains between shared corners: segments on a line, polygons in the plane, polyhedra or hexahedra in space.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh<T, const D: usize> {
    /// How functions are interpolated between corners.
    pub interpolation: Interpolation,
    /// Reference positions of the corners.
    pub X: Vec<SVector<T, D>>,
    /// Current positions of the corners.
    pub x: Vec<SVector<T, D>>,
    /// The corners of all polygons, polygon after polygon, each counter-clockwise; of all polyhedra, in any order; of all cells, in the
    /// order of [`Interpolation::Cell`].
    pub corners: Vec<u32>,
    /// For each polygon or polyhedron where its corners end in `corners`.
    pub ends: Vec<u32>,
    /// For each particle where its polygons or polyhedra end in `ends`.
    pub of_particles: Vec<u32>,
    /// The faces of polyhedra; none in the plane, and none of cells.
    pub faces: Faces,
    /// Points of the boundary where a traction acts, see [`BodyForce::boundary_stress`](crate::BodyForce::boundary_stress).
    pub loads: Vec<Load<T, D>>,
    /// From the axes of the body to those of the grid, which is given in the latter; none where they are the same.
    pub turn: Option<SMatrix<T, D, D>>,
    /// Where these are of some particles of a larger body: the numbers there.
    pub numbers: Option<Numbers>,
}

/// The numbers that corners and loads of a part have in the whole body.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Numbers {
    /// Numbers of the corners.
    pub corners: Vec<u64>,
    /// Numbers of the loads, ascending.
    pub loads: Vec<u64>,
}

/// The faces of polyhedra.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Faces {
    /// The corners of all faces, face after face, counter-clockwise as seen from outside: places among the polyhedron's own corners.
    pub corners: Vec<u32>,
    /// For each face where its corners end in `corners`.
    pub ends: Vec<u32>,
    /// For each polyhedron where its faces end in `ends`.
    pub of_polyhedra: Vec<u32>,
}

/// A point of the boundary with a given Cauchy stress, whose traction follows the edge or the triangle: the force is that stress times
/// its current normal and length or area.
///
/// The dead load `P N` of the reference configuration has the same value as long as the motion is the exact one. Under pressure of the
/// order of the shear modulus it makes short waves of the surface grow, however fine the grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load<T, const D: usize> {
    /// The ends of the edge on which it lies, with the body on the left of the way from the first to the second; or the corners of the
    /// triangle, counter-clockwise as seen from outside.
    pub corners: [u32; D],
    /// The share of the edge or triangle with which it acts on each of these corners.
    pub shares: [T; D],
    /// Its reference position.
    pub X: SVector<T, D>,
}

impl<T: RealField + Copy, const D: usize> Load<T, D> {
    /// The normal of its edge or triangle, as long as that is long or large, between corners at `x`.
    pub fn normal(&self, x: &[SVector<T, D>]) -> SVector<T, D> {
        let at = self.corners.map(|corner| x[corner as usize]);
        let mut normal = SVector::zeros();
        match at[..] {
            [from, to] => {
                let edge = to - from;
                (normal[0], normal[D - 1]) = (edge[D - 1], -edge[0]);
                normal
            }
            [a, b, c] => (b - a).cross(&(c - a)) * real::<T>(0.5),
            _ => normal,
        }
    }
}

/// The shares `w` of a mean and `g` of a mean gradient, per length, that a corner of one of a particle's polygons has.
#[derive(Clone, Copy, Debug)]
pub struct CornerShare<T, const D: usize> {
    /// Share of a mean.
    pub w: T,
    /// Share of a mean gradient, per length.
    pub g: [T; D],
}

impl<T: RealField + Copy, const D: usize> Mesh<T, D> {
    /// Cells with these corners, `2^D` a particle, at rest.
    #[must_use]
    pub fn cells(X: Vec<SVector<T, D>>, corners: Vec<u32>) -> Self {
        let cells = (corners.len() >> D) as u32;
        Self {
            x: X.clone(),
            X,
            corners,
            ends: (1..=cells).map(|cell| cell << D).collect(),
            of_particles: (1..=cells).collect(),
            ..Self::empty(Interpolation::Cell, None)
        }
    }

    /// An empty mesh.
    pub fn empty(interpolation: Interpolation, turn: Option<SMatrix<T, D, D>>) -> Self {
        Self {
            interpolation,
            X: Vec::new(),
            x: Vec::new(),
            corners: Vec::new(),
            ends: Vec::new(),
            of_particles: Vec::new(),
            faces: Faces::default(),
            loads: Vec::new(),
            turn,
            numbers: None,
        }
    }

    /// Whether indices are in range, and every corner belongs to a particle.
    pub fn check(&self, particles: usize) -> Result<(), SetupError> {
        let Self { X, x, corners, ends, of_particles, faces, loads, numbers, .. } = self;
        let of_cells = self.is_of_cells();
        if D == 1 && !of_cells {
            return Err(SetupError::PolygonDimension { dimension: D });
        }
        let is_rising = |ends: &[u32], last: usize| {
            ends.is_sorted() && ends.last().map_or(0, |end| *end as usize) == last
        };
        let numbers = numbers.as_ref();
        // None where the ends of the parts do not fit.
        let parts = |ends: &[u32], parts: usize| parts * usize::from(is_rising(ends, parts));
        let polyhedra = if D == 3 && !of_cells { ends.len() } else { 0 };
        for (array, found, expected) in [
            ("x of the corners", x.len(), X.len()),
            ("of_particles", of_particles.len(), particles),
            ("ends", parts(of_particles, ends.len()), ends.len()),
            ("corners", parts(ends, corners.len()), corners.len()),
            ("of_polyhedra", faces.of_polyhedra.len(), polyhedra),
            ("ends of faces", parts(&faces.of_polyhedra, faces.ends.len()), faces.ends.len()),
            ("corners of faces", parts(&faces.ends, faces.corners.len()), faces.corners.len()),
            ("numbers of the corners", numbers.map_or(X.len(), |own| own.corners.len()), X.len()),
            (
                "numbers of the loads",
                numbers.map_or(loads.len(), |own| own.loads.len()),
                loads.len(),
            ),
        ] {
            if found != expected {
                return Err(SetupError::LengthMismatch { array, found, expected });
            }
        }
        let is_cell = |p: usize| {
            of_particles[p] as usize == p + 1
                && ends.get(p).is_some_and(|end| *end == (p as u32 + 1) << D)
        };
        if of_cells && !(0..particles).all(is_cell) {
            let (found, expected) = (corners.len(), particles << D);
            return Err(SetupError::LengthMismatch { array: "corners of cells", found, expected });
        }
        for polyhedron in 0..polyhedra {
            let count = ends[polyhedron] as usize - start(ends, polyhedron);
            let places = faces.of(polyhedron).flatten();
            if let Some(&corner) = places.into_iter().find(|place| **place as usize >= count) {
                let corner = corner as usize;
                return Err(SetupError::NoSuchCorner { corner, corners: count });
            }
        }
        let mut idle = vec![true; X.len()];
        for &corner in corners.iter().chain(loads.iter().flat_map(|load| &load.corners)) {
            let corner = corner as usize;
            let none = SetupError::NoSuchCorner { corner, corners: X.len() };
            *idle.get_mut(corner).ok_or(none)? = false;
        }
        match idle.iter().position(|idle| *idle) {
            Some(corner) => Err(SetupError::IdleCorner { corner }),
            None => Ok(()),
        }
    }

    /// Whether each particle is one cell.
    pub fn is_of_cells(&self) -> bool {
        self.interpolation == Interpolation::Cell
    }

    /// The corners of a particle's domain.
    pub fn of_particle(&self, p: usize) -> &[u32] {
        &self.corners[self.places(p)]
    }

    /// The places in `corners` of a particle.
    #[inline]
    pub fn places(&self, p: usize) -> std::ops::Range<usize> {
        if self.is_of_cells() {
            return p << D..(p + 1) << D;
        }
        let polygons = self.polygons(p);
        start(&self.ends, polygons.start)..start(&self.ends, polygons.end)
    }

    /// The numbers of a particle's polygons or polyhedra.
    fn polygons(&self, p: usize) -> std::ops::Range<usize> {
        start(&self.of_particles, p)..self.of_particles[p] as usize
    }

    /// Writes the shares of means over a particle's polygons in the reference configuration, as many as it has
    /// [places](Self::places).
    pub fn means(&self, p: usize, shares: &mut [CornerShare<T, D>]) {
        if D == 3 {
            return polyhedra::means(self, p, shares);
        }
        let (X, first) = (&self.X, self.places(p).start);
        // Twice the area.
        let mut whole = T::zero();
        for polygon in self.polygons(p) {
            let own = start(&self.ends, polygon)..self.ends[polygon] as usize;
            let corners = &self.corners[own.clone()];
            let shares = &mut shares[own.start - first..own.end - first];
            let count: T = real(corners.len() as f64);
            let mut mean = SVector::zeros();
            for (share, &corner) in shares.iter_mut().zip(corners) {
                mean += X[corner as usize];
                share.w = T::zero();
            }
            mean /= count;
            let (mut area, mut last) = (T::zero(), corners.len().saturating_sub(1));
            for k in 0..corners.len() {
                let (from, to) = (X[corners[last] as usize], X[corners[k] as usize]);
                let triangle = cross(&(from - mean), &(to - mean));
                area += triangle;
                shares[last].w += triangle;
                shares[k].w += triangle;
                last = k;
            }
            for share in shares {
                share.w += area / count;
            }
            whole += area;
        }
        let third = whole.recip() * real(1.0 / 3.0);
        shares.iter_mut().for_each(|share| share.w *= third);
    }

    /// Writes the shares of mean gradients over a particle's polygons between corners at `x`, and returns their area or volume.
    pub fn slopes(&self, x: &[SVector<T, D>], p: usize, shares: &mut [CornerShare<T, D>]) -> T {
        if D == 3 {
            return polyhedra::slopes(self, x, p, shares);
        }
        let first = self.places(p).start;
        // Twice the area.
        let mut whole = T::zero();
        for polygon in self.polygons(p) {
            let own = start(&self.ends, polygon)..self.ends[polygon] as usize;
            let corners = &self.corners[own.clone()];
            let shares = &mut shares[own.start - first..own.end - first];
            let [.., before, last] = *corners else { continue };
            let about = x[last as usize];
            let (mut before, mut here) = (x[before as usize], about);
            let mut index = corners.len() - 1;
            for (k, &next) in corners.iter().enumerate() {
                let next = x[next as usize];
                let across = next - before;
                let g = &mut shares[index].g;
                (g[0], g[D - 1]) = (across[D - 1], -across[0]);
                whole += cross(&(here - about), &(next - about));
                (before, here, index) = (here, next, k);
            }
        }
        let inverse = whole.recip();
        for share in shares {
            share.g[0] *= inverse;
            share.g[D - 1] *= inverse;
        }
        whole * real(0.5)
    }
}

impl Faces {
    /// The faces of a polyhedron.
    fn of(&self, polyhedron: usize) -> impl Iterator<Item = &[u32]> {
        let faces = start(&self.of_polyhedra, polyhedron)..self.of_polyhedra[polyhedron] as usize;
        faces.map(|face| &self.corners[start(&self.ends, face)..self.ends[face] as usize])
    }
}

/// Where entry `index` of a list begins whose entries end at `ends`.
fn start(ends: &[u32], index: usize) -> usize {
    if index == 0 { 0 } else { ends[index - 1] as usize }
}

/// `a x b` in the plane.
pub fn cross<T: RealField + Copy, const D: usize>(a: &SVector<T, D>, b: &SVector<T, D>) -> T {
    a[0] * b[D - 1] - a[D - 1] * b[0]
}
