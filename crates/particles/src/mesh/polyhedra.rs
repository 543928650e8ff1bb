//! Shares of polyhedra on shared corners.
//!
//! A face is divided into the triangles between its edges and the mean of its corners, a polyhedron into the tetrahedra between these
//! triangles and the mean of its own. With the means of values at both, the mean of a function over a particle and that of its gradient
//! are, for corners `a` and `b` of an edge, the face's mean `m`, and the area vector `s` of their triangle:
//!
//! ```text
//! mean of N       sum over tetrahedra of volume (N(x_a) + N(x_b) + N(m) + N(mean of the polyhedron))/4, over V
//! mean of grad N  (1/V) sum over triangles of (N(x_a) + N(x_b) + N(m))/3 s
//! ```
//!
//! A face between two particles has opposite area vectors in both.

use mmsmith_lanes::tensor::real;
use nalgebra::{RealField, SVector};

use super::{CornerShare, Mesh, start};

/// As [`Mesh::means`].
pub(super) fn means<T: RealField + Copy, const D: usize>(
    own: &Mesh<T, D>,
    p: usize,
    shares: &mut [CornerShare<T, D>],
) {
    let first = own.places(p).start;
    // Six times the volume.
    let mut whole = T::zero();
    for polyhedron in own.polygons(p) {
        let places = start(&own.ends, polyhedron)..own.ends[polyhedron] as usize;
        let corners = &own.corners[places.clone()];
        let shares = &mut shares[places.start - first..places.end - first];
        let at = |place: u32| own.X[corners[place as usize] as usize];
        let count: T = real(corners.len() as f64);
        let mut centre = SVector::zeros();
        for (share, &corner) in shares.iter_mut().zip(corners) {
            centre += own.X[corner as usize];
            share.w = T::zero();
        }
        centre /= count;
        let mut volume = T::zero();
        for face in own.faces.of(polyhedron) {
            let mean = mean_of(face, at);
            let mut of_face = T::zero();
            for (k, &from) in face.iter().enumerate() {
                let to = face[(k + 1) % face.len()];
                let tetrahedron = (mean - centre).dot(&area(&at(from), &at(to), &mean));
                of_face += tetrahedron;
                shares[from as usize].w += tetrahedron;
                shares[to as usize].w += tetrahedron;
            }
            let each = of_face / real(face.len() as f64);
            face.iter().for_each(|&place| shares[place as usize].w += each);
            volume += of_face;
        }
        shares.iter_mut().for_each(|share| share.w += volume / count);
        whole += volume;
    }
    let quarter = whole.recip() * real(0.25);
    shares.iter_mut().for_each(|share| share.w *= quarter);
}

/// As [`Mesh::slopes`].
pub(super) fn slopes<T: RealField + Copy, const D: usize>(
    own: &Mesh<T, D>,
    x: &[SVector<T, D>],
    p: usize,
    shares: &mut [CornerShare<T, D>],
) -> T {
    let first = own.places(p).start;
    shares.iter_mut().for_each(|share| share.g = [T::zero(); D]);
    // 18 times the volume.
    let mut whole = T::zero();
    for polyhedron in own.polygons(p) {
        let places = start(&own.ends, polyhedron)..own.ends[polyhedron] as usize;
        let corners = &own.corners[places.clone()];
        let shares = &mut shares[places.start - first..places.end - first];
        let at = |place: u32| x[corners[place as usize] as usize];
        let about = at(0);
        for face in own.faces.of(polyhedron) {
            let mean = mean_of(face, at);
            let mut of_face = SVector::<T, D>::zeros();
            for (k, &from) in face.iter().enumerate() {
                let to = face[(k + 1) % face.len()];
                let (a, b) = (at(from), at(to));
                let area = area(&a, &b, &mean);
                for a in 0..D {
                    shares[from as usize].g[a] += area[a];
                    shares[to as usize].g[a] += area[a];
                }
                whole += ((a - about) + (b - about) + (mean - about)).dot(&area);
                of_face += area;
            }
            let each = of_face / real::<T>(face.len() as f64);
            for &place in face {
                (0..D).for_each(|a| shares[place as usize].g[a] += each[a]);
            }
        }
    }
    let volume = whole * real(1.0 / 18.0);
    let inverse = (volume * real(6.0)).recip();
    for share in shares {
        (0..D).for_each(|a| share.g[a] *= inverse);
    }
    volume
}

fn mean_of<T: RealField + Copy, const D: usize>(
    face: &[u32],
    at: impl Fn(u32) -> SVector<T, D>,
) -> SVector<T, D> {
    let sum = face.iter().fold(SVector::zeros(), |sum, &place| sum + at(place));
    sum / real::<T>(face.len() as f64)
}

/// Twice the area vector of a triangle, counter-clockwise as seen from where it points to.
fn area<T: RealField + Copy, const D: usize>(
    a: &SVector<T, D>,
    b: &SVector<T, D>,
    c: &SVector<T, D>,
) -> SVector<T, D> {
    (a - c).cross(&(b - c))
}
