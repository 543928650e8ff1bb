//! Particles that fill a body for the eye: a place each, and the edges of the piece of the body around it.

use mmsmith_runtime::nalgebra::{SMatrix, SVector};
use mmsmith_runtime::{Around, Domain};
use std::f64::consts::TAU;

/// A piece of the body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piece<const D: usize> {
    /// The middle.
    pub(crate) X: SVector<f64, D>,
    /// The edges, a column each.
    pub(crate) edges: SMatrix<f64, D, D>,
}

/// Pieces of about the same size, about `count` of them; none for a shape that is not known here.
pub(crate) fn fill<const D: usize>(domain: &Domain<f64, D>, count: usize) -> Vec<Piece<D>> {
    let count = count.max(1);
    match domain {
        Domain::Box { lower, upper } => in_box(*lower, *upper, count),
        Domain::Annulus { inner, outer } => in_shell(*inner, *outer, count),
        Domain::Tube { inner, outer, lower, upper, around } => {
            let [from, to] = around.angles().unwrap_or([0.0, TAU]);
            in_tube([*inner, *outer], [*lower, *upper], [from, to], count)
        }
        _ => Vec::new(),
    }
}

/// How many steps of about `step` a length has, and how long each is.
fn steps(length: f64, step: f64) -> (usize, f64) {
    // As a float the count is bounded; not a number counts as one.
    let count = (length / step).round().clamp(1.0, 1e4) as usize;
    (count.max(1), length / count.max(1) as f64)
}

fn in_box<const D: usize>(
    lower: SVector<f64, D>,
    upper: SVector<f64, D>,
    count: usize,
) -> Vec<Piece<D>> {
    let size = upper - lower;
    let step = (size.product() / count as f64).powf(1.0 / D as f64);
    let layers: [(usize, f64); D] = std::array::from_fn(|i| steps(size[i], step));
    let edges = SMatrix::from_fn(|i, j| if i == j { layers[i].1 } else { 0.0 });
    let all: usize = layers.iter().map(|(count, _)| count).product();
    let piece = |mut index: usize| {
        let X = SVector::from_fn(|i, _| {
            let (count, width) = layers[i];
            let layer = index % count;
            index /= count;
            lower[i] + width * (layer as f64 + 0.5)
        });
        Piece { X, edges }
    };
    (0..all.min(4 * count)).map(piece).collect()
}

/// An annulus in the plane, half a spherical shell in space.
fn in_shell<const D: usize>(inner: f64, outer: f64, count: usize) -> Vec<Piece<D>> {
    if D == 2 {
        let area = 0.5 * TAU * (outer * outer - inner * inner);
        let step = (area / count as f64).sqrt();
        return rings([inner, outer], [0.0, TAU], step)
            .into_iter()
            .map(|(X, edges)| Piece {
                X: SVector::from_fn(|i, _| X[i]),
                edges: SMatrix::from_fn(|i, j| edges[i][j]),
            })
            .collect();
    }
    let volume = TAU / 3.0 * (outer.powi(3) - inner.powi(3));
    let step = (volume / count as f64).cbrt();
    let (layers, thickness) = steps(outer - inner, step);
    let mut pieces = Vec::new();
    for layer in 0..layers {
        let radius = inner + thickness * (layer as f64 + 0.5);
        let (parallels, height) = steps(0.5 * TAU, step / radius);
        for parallel in 0..parallels {
            let polar = height * (parallel as f64 + 0.5);
            // The half that is cut open towards the eye.
            let (meridians, width) = steps(0.5 * TAU, step / (radius * polar.sin()));
            for meridian in 0..meridians {
                let around = width * (meridian as f64 + 0.5);
                let [sp, cp, sa, ca] = [polar.sin(), polar.cos(), around.sin(), around.cos()];
                let frame = [[sp * ca, sp * sa, cp], [cp * ca, cp * sa, -sp], [-sa, ca, 0.0]];
                let length = [thickness, radius * height, radius * sp * width];
                pieces.push(Piece {
                    X: SVector::from_fn(|i, _| radius * frame[0][i % 3]),
                    edges: SMatrix::from_fn(|i, j| frame[j % 3][i % 3] * length[j % 3]),
                });
            }
        }
    }
    pieces
}

/// Pieces of an annulus or of a sector of it: places, and edges as columns.
fn rings(
    [inner, outer]: [f64; 2],
    [from, to]: [f64; 2],
    step: f64,
) -> Vec<([f64; 2], [[f64; 2]; 2])> {
    let (layers, thickness) = steps(outer - inner, step);
    let mut pieces = Vec::new();
    for layer in 0..layers {
        let radius = inner + thickness * (layer as f64 + 0.5);
        let (count, angle) = steps(to - from, step / radius);
        for n in 0..count {
            let (sine, cosine) = (from + angle * (n as f64 + 0.5)).sin_cos();
            let across = radius * angle;
            pieces.push((
                [radius * cosine, radius * sine],
                [[thickness * cosine, -across * sine], [thickness * sine, across * cosine]],
            ));
        }
    }
    pieces
}

fn in_tube<const D: usize>(
    radii: [f64; 2],
    [lower, upper]: [f64; 2],
    angles: [f64; 2],
    count: usize,
) -> Vec<Piece<D>> {
    let area = 0.5 * (angles[1] - angles[0]) * (radii[1] * radii[1] - radii[0] * radii[0]);
    let step = (area * (upper - lower) / count as f64).cbrt();
    let (layers, height) = steps(upper - lower, step);
    let flat = rings(radii, angles, step);
    let mut pieces = Vec::new();
    for layer in 0..layers {
        let Z = lower + height * (layer as f64 + 0.5);
        for (X, edges) in &flat {
            let place = [X[0], X[1], Z];
            let of = |i: usize, j: usize| match (i, j) {
                (0..2, 0..2) => edges[i][j],
                (2, 2) => height,
                _ => 0.0,
            };
            pieces.push(Piece {
                X: SVector::from_fn(|i, _| place[i % 3]),
                edges: SMatrix::from_fn(of),
            });
        }
    }
    pieces
}

/// Where nothing but the angles of a sector matters.
trait Angles {
    fn angles(&self) -> Option<[f64; 2]>;
}

impl Angles for Around<f64> {
    fn angles(&self) -> Option<[f64; 2]> {
        match self {
            Around::Axisymmetric | Around::Whole => None,
            Around::Sector { from, to } => Some([*from, *to]),
        }
    }
}
