//! Bodies of any shape: the boxes of a lattice, clipped with the body's boundary, in the plane by `plane`, in space by `space`.
//!
//! 1. Each box is clipped with one side of the body after another. A curved side becomes the chords, or the flat parts, between the places
//!    where it crosses the lines of the lattice. A crossing is computed once, from the line and the side alone, so that the boxes at the
//!    line share it.
//! 2. What is left of a box, if it is a sliver, joins the neighbour with which it has most of its boundary in common, so that no particle
//!    is much lighter than the others and the largest stable step stays that of whole boxes.
//! 3. A particle lies at the centroid of its parts. Its mass is that of its part of the body, with what lies between chords and arcs: the
//!    mass of the body is exact.

mod plane;
mod space;

use std::collections::BTreeMap;

use mmsmith_lanes::tensor::real;
use mmsmith_particles::{Body, Grid, Mesh, Particles, SetupError};
use mmsmith_rare_states::{RareState, met};
use nalgebra::{RealField, SMatrix, SVector};

/// A clipped box with less than this share of its whole volume is a sliver.
const SLIVER: f64 = 0.2;

/// Places closer to a side than this, in units of the particles' distance, lie on it.
const ON: f64 = 1e-9;

/// A side of a body, in the axes of the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Side<const D: usize> {
    /// A straight side: the points with `X . normal <= distance` are inside.
    Straight {
        /// The outward unit normal.
        normal: [f64; D],
        /// Its distance from the origin, along the normal.
        distance: f64,
    },
    /// A circle or a sphere about the origin around the body.
    Outer {
        /// Its radius.
        radius: f64,
    },
    /// A circle or a sphere about the origin, inside of which there is nothing.
    Inner {
        /// Its radius.
        radius: f64,
    },
}

impl<const D: usize> Side<D> {
    /// The distance from the side, positive inside.
    fn distance(&self, X: &SVector<f64, D>) -> f64 {
        match *self {
            Self::Straight { normal, distance } => distance - SVector::from(normal).dot(X),
            Self::Outer { radius } => radius - X.norm(),
            Self::Inner { radius } => X.norm() - radius,
        }
    }

    /// The gradient of the distance.
    fn gradient(&self, X: &SVector<f64, D>) -> SVector<f64, D> {
        match *self {
            Self::Straight { normal, .. } => -SVector::from(normal),
            Self::Outer { .. } => -X.normalize(),
            Self::Inner { .. } => X.normalize(),
        }
    }

    /// Where the side crosses the segment from `a`, at distance `da` from it, to `b`, at `db` on its other side.
    fn crossing(
        &self,
        (a, da): (SVector<f64, D>, f64),
        (b, db): (SVector<f64, D>, f64),
    ) -> SVector<f64, D> {
        let along = b - a;
        let straight = da / (da - db);
        let share = match *self {
            Self::Straight { .. } => straight,
            Self::Outer { radius } | Self::Inner { radius } => {
                // |a + s along|^2 = radius^2
                let (half, square) = (a.dot(&along), along.norm_squared());
                let rest = (a.norm() - radius) * (a.norm() + radius);
                let root = (half * half - square * rest).max(0.0).sqrt();
                let far = if half > 0.0 { -half - root } else { root - half };
                // One of the two lies between the ends, wherever the straight line through the distances is zero.
                let beside = |s: f64| (s - s.clamp(0.0, 1.0)).abs();
                [far / square, rest / far]
                    .into_iter()
                    .filter(|s| s.is_finite())
                    .min_by(|s, t| beside(*s).total_cmp(&beside(*t)))
                    .unwrap_or(straight)
            }
        };
        a + along * share.clamp(0.0, 1.0)
    }

    /// This side in the dimension of a body.
    fn carried<const E: usize>(self) -> Side<E> {
        match self {
            Self::Straight { normal, distance } => {
                let normal = std::array::from_fn(|a| normal.get(a).copied().unwrap_or(0.0));
                Side::Straight { normal, distance }
            }
            Self::Outer { radius } => Side::Outer { radius },
            Self::Inner { radius } => Side::Inner { radius },
        }
    }
}

/// A part of the boundary between as many corners as there are dimensions: an edge with the body on the left of the way from the first
/// to the second, or a triangle, counter-clockwise as seen from outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facet<const D: usize> {
    /// The index of the side that it belongs to.
    pub side: usize,
    /// Its corners.
    pub corners: [u32; D],
}

/// A lattice of boxes and the body that it is clipped with.
#[derive(Clone, Debug, PartialEq)]
pub struct Clip<const D: usize> {
    /// The sides of the body.
    pub sides: Vec<Side<D>>,
    /// Cosine and sine of the angle by which the first two axes of the grid are turned against those of the body, counter-clockwise.
    pub turn: [f64; 2],
    /// By how much the lattice is shifted along every axis of the grid, in units of the particles' distance.
    pub offset: f64,
}

/// The corners of boxes.
struct Lattice<const D: usize> {
    /// Where it begins, in the axes of the grid.
    origin: SVector<f64, D>,
    /// The distance of particles.
    spacing: f64,
    turn: [f64; 2],
}

impl<const D: usize> Lattice<D> {
    /// A corner in the axes of the body.
    fn place(&self, index: [i64; D]) -> SVector<f64, D> {
        let at = self.origin + SVector::from_fn(|a, _| index[a] as f64) * self.spacing;
        let [cos, sin] = self.turn;
        SVector::from_fn(|a, _| match a {
            0 => cos * at[0] - sin * at[1],
            1 => sin * at[0] + cos * at[1],
            _ => at[a],
        })
    }
}

/// The boundary that two clipped boxes share.
struct Contact {
    with: usize,
    /// A length or an area.
    measure: f64,
}

/// Joins slivers to the neighbours with which they have most in common: the members of each particle, parts of boxes by number, where
/// `volumes` are those of the parts and `whole` that of a box.
fn join(volumes: &[f64], whole: f64, contacts: impl Fn(usize) -> Vec<Contact>) -> Vec<Vec<usize>> {
    struct Group {
        members: Vec<usize>,
        volume: f64,
    }
    let mut group_of: Vec<usize> = (0..volumes.len()).collect();
    let of_one = |(index, &volume)| Group { members: vec![index], volume };
    let mut groups: Vec<Group> = volumes.iter().enumerate().map(of_one).collect();
    let is_sliver = |volume: f64| volume < SLIVER * whole;
    let mut slivers: Vec<_> = (0..volumes.len()).filter(|k| is_sliver(volumes[*k])).collect();
    slivers.sort_by(|a, b| volumes[*a].total_cmp(&volumes[*b]).then(a.cmp(b)));
    for sliver in slivers {
        let own = group_of[sliver];
        if !is_sliver(groups[own].volume) {
            continue;
        }
        let mut common: BTreeMap<usize, f64> = BTreeMap::new();
        for Contact { with, measure } in groups[own].members.iter().flat_map(|k| contacts(*k)) {
            if group_of[with] != own {
                *common.entry(group_of[with]).or_insert(0.0) += measure;
            }
        }
        let most = common.iter().max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(a.0)));
        let Some((&to, _)) = most else { continue };
        met(RareState::SliverJoined);
        let Group { members, volume } =
            std::mem::replace(&mut groups[own], Group { members: Vec::new(), volume: 0.0 });
        members.iter().for_each(|member| group_of[*member] = to);
        groups[to].members.extend(members);
        groups[to].volume += volume;
    }
    groups.into_iter().map(|group| group.members).filter(|members| !members.is_empty()).collect()
}

/// From the axes of the body to those of the grid; none where they are the same.
fn turn_of<T: RealField + Copy, const D: usize>([cos, sin]: [f64; 2]) -> Option<SMatrix<T, D, D>> {
    let turned = SMatrix::from_fn(|i, j| {
        real(match (i, j) {
            (0, 0) | (1, 1) => cos,
            (0, 1) => sin,
            (1, 0) => -sin,
            _ if i == j => 1.0,
            _ => 0.0,
        })
    });
    ([cos, sin] != [1.0, 0.0]).then_some(turned)
}

/// A body of particles at rest, with their centroids, volumes and masses.
fn at_rest<T: RealField + Copy, const D: usize>(
    mut mesh: Mesh<T, D>,
    X: Vec<SVector<T, D>>,
    volume: Vec<T>,
    mass: Vec<T>,
    spacing: f64,
) -> Body<T, D> {
    mesh.x.clone_from(&mesh.X);
    let count = X.len();
    let particles = Particles {
        x: X.clone(),
        X,
        v: vec![SVector::zeros(); count],
        F: vec![SMatrix::identity(); count],
        mass,
        volume,
        half_size: SVector::repeat(real(0.5 * spacing)),
        ..Particles::default()
    };
    Body { half_edges: Vec::new(), mesh: Some(mesh), ..particles.into() }
}

/// A body in the plane or in space at rest, of the boxes of a lattice with `per_cell` of them in a cell of the grid and direction,
/// clipped with its sides; and its boundary, facet by facet, but for facets on the walls of the grid. `grid` is in its own axes.
///
/// # Errors
///
/// [`SetupError::PolygonDimension`] in one dimension.
pub fn body<T: RealField + Copy, const D: usize>(
    grid: &Grid<f64, D>,
    per_cell: usize,
    density: f64,
    clip: &Clip<D>,
) -> Result<(Body<T, D>, Vec<Facet<D>>), SetupError> {
    match D {
        2 => Ok(plane::body(grid, per_cell.max(1), density, clip)),
        3 => Ok(space::body(grid, per_cell.max(1), density, clip)),
        _ => Err(SetupError::PolygonDimension { dimension: D }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::vector;

    /// Also where the segment first goes on in the direction from which it comes back.
    #[test]
    fn a_crossing_lies_on_its_circle() {
        for side in [Side::<2>::Outer { radius: 1.0 }, Side::Inner { radius: 1.0 }] {
            for k in 0..400 {
                let angle = 0.9 + 1e-2 * f64::from(k);
                let away = [1e-9, 1e-4, 0.3][k as usize % 3];
                let a = vector![0.6, 0.8] * (1.0 - away);
                let b = a + vector![angle.cos(), angle.sin()] * 1.7;
                let (da, db) = (side.distance(&a), side.distance(&b));
                if da * db < 0.0 {
                    let X = side.crossing((a, da), (b, db));
                    assert!(side.distance(&X).abs() < 1e-14, "{side:?} {angle} {away}: {X}");
                }
            }
        }
    }
}
