//! Polygons on shared corners: domains of particles that fill a body of any shape, whose corners the grid moves.
//!
//! A particle is a list of polygons. Each is divided into the triangles between its edges and the mean of its corners. Where a function
//! is replaced by its interpolation between the corners, with the mean of their values at the mean of the corners, its mean over a
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

use nalgebra::{RealField, SMatrix, SVector};

use crate::error::SetupError;
use crate::tensor::real;

/// Particles' domains as polygons on shared corners; the body has two dimensions.
#[derive(Clone, Debug, PartialEq)]
pub struct Polygons<T, const D: usize> {
    /// Reference positions of the corners.
    pub X: Vec<SVector<T, D>>,
    /// Current positions of the corners.
    pub x: Vec<SVector<T, D>>,
    /// The corners of all polygons, polygon after polygon, each counter-clockwise.
    pub corners: Vec<u32>,
    /// For each polygon where its corners end in `corners`.
    pub ends: Vec<u32>,
    /// For each particle where its polygons end in `ends`.
    pub of_particles: Vec<u32>,
    /// Points of the boundary where a traction acts, see [`BodyForce::boundary_stress`](crate::BodyForce::boundary_stress).
    pub loads: Vec<Load<T>>,
    /// From the axes of the body to those of the grid, which is given in the latter; none where they are the same.
    pub turn: Option<SMatrix<T, D, D>>,
}

/// A point of the boundary with a given Cauchy stress, whose traction follows the edge: the force is that stress times the edge's
/// current normal and length.
///
/// The dead load `P N` of the reference configuration has the same value as long as the motion is the exact one. Under pressure of the
/// order of the shear modulus it makes short waves of the surface grow, however fine the grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load<T> {
    /// The ends of the edge on which it lies, with the body on the left of the way from the first to the second.
    pub corners: [u32; 2],
    /// The share of the edge with which it acts on each end.
    pub shares: [T; 2],
}

/// The shares `w` of a mean and `g` of a mean gradient, per length, that a corner of one of a particle's polygons has.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Share<T, const D: usize> {
    pub(crate) corner: u32,
    pub(crate) w: T,
    pub(crate) g: [T; D],
}

impl<T: RealField + Copy, const D: usize> Polygons<T, D> {
    /// Whether indices are in range, and every corner belongs to a particle.
    pub(crate) fn check(&self, particles: usize) -> Result<(), SetupError> {
        if D != 2 {
            return Err(SetupError::PolygonDimension { dimension: D });
        }
        let Self { X, x, corners, ends, of_particles, loads, .. } = self;
        let is_rising = |ends: &[u32], last: usize| {
            ends.is_sorted() && ends.last().map_or(0, |end| *end as usize) == last
        };
        for (array, found, expected) in [
            ("x of the corners", x.len(), X.len()),
            ("of_particles", of_particles.len(), particles),
            ("ends", ends.len() * usize::from(is_rising(of_particles, ends.len())), ends.len()),
            ("corners", corners.len() * usize::from(is_rising(ends, corners.len())), corners.len()),
        ] {
            if found != expected {
                return Err(SetupError::LengthMismatch { array, found, expected });
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

    /// The places in `corners` of a particle.
    pub(crate) fn places(&self, p: usize) -> std::ops::Range<usize> {
        let polygons = self.polygons(p);
        start(&self.ends, polygons.start)..start(&self.ends, polygons.end)
    }

    fn polygons(&self, p: usize) -> std::ops::Range<usize> {
        start(&self.of_particles, p)..self.of_particles[p] as usize
    }

    /// Writes the shares of means over a particle in the reference configuration, as many as it has [places](Self::places).
    pub(crate) fn means(&self, p: usize, shares: &mut [Share<T, D>]) {
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
                (share.corner, share.w) = (corner, T::zero());
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

    /// Writes the shares of mean gradients over a particle at the present positions, and returns its area.
    pub(crate) fn slopes(&self, p: usize, shares: &mut [Share<T, D>]) -> T {
        let (x, first) = (&self.x, self.places(p).start);
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

/// Where entry `index` of a list begins whose entries end at `ends`.
fn start(ends: &[u32], index: usize) -> usize {
    if index == 0 { 0 } else { ends[index - 1] as usize }
}

/// `a x b` in the plane.
pub(crate) fn cross<T: RealField + Copy, const D: usize>(
    a: &SVector<T, D>,
    b: &SVector<T, D>,
) -> T {
    a[0] * b[D - 1] - a[D - 1] * b[0]
}
