//! Polygons on shared corners: domains of particles that fill a body of any shape, whose corners the grid moves.
//!
//! A particle is a list of polygons. Each is divided into the triangles between its edges and the mean of its corners. Where a function
//! is replaced by its interpolation between the corners, with the mean of their values at the mean of the corners, its mean over a
//! particle is `sum_c w_c N(x_c)`, and the mean of its gradient, by the divergence theorem, a sum over edges of length L and outward normal
//! n:
//!
//! ```text
//! w_c = sum of (T_- + T_+)/3 + A/(3 k) over the particle's polygons at c, over V
//! mean of grad N = (1/V) sum over edges of (N(x_a) + N(x_b))/2 L n
//! ```
//!
//! `T_-` and `T_+` are the triangles on either side of the corner, A the area of the polygon, k the number of its corners, V the area of the
//! particle. An edge between two particles has opposite normals in both: in `sum_p V_p grad N` it cancels, and the integral of `N n` over
//! the boundary remains. That is the condition under which a constant stress gives no force inside (Chen, Wu, Yoon & You, IJNME 50
//! (2001) 435-466).

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

    /// Writes the shares of a particle's corners at the positions `x`, as many as it has [places](Self::places), and returns its area.
    pub(crate) fn shares(&self, x: &[SVector<T, D>], p: usize, shares: &mut [Share<T, D>]) -> T {
        let first = self.places(p).start;
        // Twice the area.
        let mut whole = T::zero();
        for polygon in self.polygons(p) {
            let own = start(&self.ends, polygon)..self.ends[polygon] as usize;
            let corners = &self.corners[own.clone()];
            let shares = &mut shares[own.start - first..own.end - first];
            let count: T = real(corners.len() as f64);
            let mut mean = SVector::zeros();
            for &corner in corners {
                mean += x[corner as usize];
            }
            mean /= count;
            let mut area = T::zero();
            let mut last = corners.len().saturating_sub(1);
            for share in &mut *shares {
                share.w = T::zero();
            }
            for k in 0..corners.len() {
                let (from, to) = (x[corners[last] as usize], x[corners[k] as usize]);
                let triangle = cross(&(from - mean), &(to - mean));
                area += triangle;
                shares[last].w += triangle;
                shares[k].w += triangle;
                last = k;
            }
            let of_mean = area / count;
            for k in 0..corners.len() {
                let next = if k + 1 < corners.len() { k + 1 } else { 0 };
                let before = if k > 0 { k - 1 } else { corners.len() - 1 };
                let across = x[corners[next] as usize] - x[corners[before] as usize];
                let share = &mut shares[k];
                share.corner = corners[k];
                share.w += of_mean;
                share.g[0] = across[D - 1];
                share.g[D - 1] = -across[0];
            }
            whole += area;
        }
        let inverse = whole.recip();
        let third = inverse * real(1.0 / 3.0);
        for share in shares {
            share.w *= third;
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
