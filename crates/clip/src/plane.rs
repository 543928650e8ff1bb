//! Bodies in the plane: polygons.

use mmsmith_scalar_functions::ScalarFunctions;
use std::collections::HashMap;
use std::ops::Range;

use mmsmith_lanes::tensor::real;
use mmsmith_particles::{Body, Grid};
use nalgebra::{Matrix2, RealField, SVector, Vector2, vector};

use super::boxes::{Division, Lattice, Survey};
use super::{Clip, Contact, Facet, Made, ON, Side, join};

/// The key by which corners are told apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Key {
    /// A corner of boxes.
    Lattice([i64; 2]),
    /// A side crosses the line of the lattice that goes from a corner along an axis.
    Crossing { from: [i64; 2], axis: usize, side: usize },
    /// Two sides meet in a box.
    Meeting { of_box: [i64; 2], sides: [usize; 2] },
}

/// The line or circle on which an edge of a polygon lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Line {
    /// The line of the lattice from a corner of boxes along an axis.
    Lattice {
        from: [i64; 2],
        axis: usize,
    },
    Side(usize),
}

/// Corners and the lines of the edges that begin there, counter-clockwise.
type Polygon = Vec<(u32, Line)>;

/// The corners of polygons.
struct Corners<'a> {
    sides: &'a [Side<2>],
    lattice: Lattice<2>,
    known: HashMap<Key, u32>,
    X: Vec<Vector2<f64>>,
    /// Distances from all sides, corner after corner; zero on a side.
    distances: Vec<f64>,
}

impl Corners<'_> {
    /// The corner of this key; `on` are sides on which it lies however it is rounded.
    fn corner(&mut self, key: Key, on: &[usize], place: impl FnOnce(&Self) -> Vector2<f64>) -> u32 {
        if let Some(&known) = self.known.get(&key) {
            return known;
        }
        let corner = self.X.len() as u32;
        let X = place(self);
        for (k, side) in self.sides.iter().enumerate() {
            let distance = side.distance(&X);
            let is_on = on.contains(&k) || distance.abs() < ON * self.lattice.spacing;
            self.distances.push(if is_on { 0.0 } else { distance });
        }
        self.X.push(X);
        self.known.insert(key, corner);
        corner
    }

    fn distance(&self, corner: u32, side: usize) -> f64 {
        self.distances[corner as usize * self.sides.len() + side]
    }

    fn at(&self, corner: u32) -> Vector2<f64> {
        self.X[corner as usize]
    }

    /// Where a side crosses an edge of a polygon of a box.
    fn crossing(&mut self, of_box: [i64; 2], line: Line, (a, b): (u32, u32), side: usize) -> u32 {
        let own = self.sides[side];
        match line {
            Line::Lattice { from, axis } => {
                let key = Key::Crossing { from, axis, side };
                self.corner(key, &[side], |corners| {
                    let mut to = from;
                    to[axis] += 1;
                    let [a, b] = [from, to].map(|index| corners.lattice.place(index));
                    own.crossing((a, own.distance(&a)), (b, own.distance(&b)))
                })
            }
            Line::Side(other) => {
                let sides = [side.min(other), side.max(other)];
                self.corner(Key::Meeting { of_box, sides }, &[side, other], |corners| {
                    let [a, b] = [a, b].map(|corner| corners.at(corner));
                    let mut X = own.crossing((a, own.distance(&a)), (b, own.distance(&b)));
                    let other = corners.sides[other];
                    // Newton's method; two straight sides need one step.
                    for _ in 0..8 {
                        let rows = [own.gradient(&X).transpose(), other.gradient(&X).transpose()];
                        let misses = vector![own.distance(&X), other.distance(&X)];
                        let Some(step) = Matrix2::from_rows(&rows).lu().solve(&misses) else {
                            break;
                        };
                        X -= step;
                    }
                    X
                })
            }
        }
    }

    /// A whole box: corners and the lines of the edges that begin there, counter-clockwise.
    fn whole(&mut self, of_box: [i64; 2]) -> Polygon {
        let [i, j] = of_box;
        let around = [
            ([i, j], Line::Lattice { from: [i, j], axis: 0 }),
            ([i + 1, j], Line::Lattice { from: [i + 1, j], axis: 1 }),
            ([i + 1, j + 1], Line::Lattice { from: [i, j + 1], axis: 0 }),
            ([i, j + 1], Line::Lattice { from: [i, j], axis: 1 }),
        ];
        let polygon = around.map(|(index, line)| {
            (self.corner(Key::Lattice(index), &[], |corners| corners.lattice.place(index)), line)
        });
        polygon.to_vec()
    }

    /// The polygon that is left of a box inside the sides.
    fn clipped(&mut self, of_box: [i64; 2]) -> Option<Polygon> {
        let mut polygon = self.whole(of_box);
        for side in 0..self.sides.len() {
            let outside = |corners: &Self, corner: u32| corners.distance(corner, side) < 0.0;
            if !polygon.iter().any(|(corner, _)| outside(self, *corner)) {
                continue;
            }
            let mut kept = Vec::with_capacity(polygon.len() + 2);
            for (k, &(from, line)) in polygon.iter().enumerate() {
                let (to, _) = polygon[(k + 1) % polygon.len()];
                let (here, there) = (self.distance(from, side), self.distance(to, side));
                if here > 0.0 || (here == 0.0 && there >= 0.0) {
                    kept.push((from, line));
                } else if here == 0.0 {
                    kept.push((from, Line::Side(side)));
                }
                if here > 0.0 && there < 0.0 {
                    kept.push((self.crossing(of_box, line, (from, to), side), Line::Side(side)));
                } else if here < 0.0 && there > 0.0 {
                    kept.push((self.crossing(of_box, line, (from, to), side), line));
                }
            }
            polygon = kept;
        }
        // Sides that meet on a line of the lattice may leave a corner twice.
        let mut corners: Vec<_> = polygon.iter().map(|(corner, _)| *corner).collect();
        let repeated = (0..corners.len()).map(|k| corners[k] == corners[(k + 1) % corners.len()]);
        let repeated: Vec<_> = repeated.collect();
        let mut next = repeated.iter();
        polygon.retain(|_| !next.next().copied().unwrap_or(false));
        corners.sort_unstable();
        corners.dedup();
        (corners.len() >= 3).then_some(polygon)
    }

    /// Twice the area of a polygon, and six times its first moment.
    fn moments(&self, polygon: &[(u32, Line)]) -> (f64, Vector2<f64>) {
        let about = self.at(polygon[0].0);
        let (mut area, mut moment) = (0.0, Vector2::zeros());
        for (k, (corner, _)) in polygon.iter().enumerate() {
            let next = polygon[(k + 1) % polygon.len()].0;
            let (a, b) = (self.at(*corner) - about, self.at(next) - about);
            let triangle = a.perp(&b);
            area += triangle;
            moment += (a + b) * triangle;
        }
        (area, moment + about * (3.0 * area))
    }
}

/// The segment between a circle and its chord from `a` to `b`, an area, positive where it belongs to the body.
fn segment(side: Side<2>, a: &Vector2<f64>, b: &Vector2<f64>) -> f64 {
    let (radius, sign) = match side {
        Side::Straight { .. } => return 0.0,
        Side::Outer { radius } => (radius, 1.0),
        Side::Inner { radius } => (radius, -1.0),
    };
    let half = libm::asin((0.5 * (b - a).norm() / radius).min(1.0));
    // half - sin(half) cos(half), without cancellation where the angle is small.
    let area = if half < 0.1 {
        let s = half * half;
        half * s * (2.0 / 3.0 - s * (2.0 / 15.0 - s * (4.0 / 315.0 - s * 2.0 / 2835.0)))
    } else {
        half - half.sine() * half.cosine()
    };
    sign * radius * radius * area
}

impl Line {
    /// The box on the other side of a line of the lattice than a box with an edge there.
    fn other_box(self, of_box: [i64; 2]) -> Option<[i64; 2]> {
        let Self::Lattice { from, axis } = self else { return None };
        let mut below = from;
        below[1 - axis] -= 1;
        Some(if of_box == from { below } else { from })
    }
}

/// The edges of a polygon, the lower corner first.
fn edges(polygon: &[(u32, Line)]) -> impl Iterator<Item = [u32; 2]> {
    polygon.iter().enumerate().map(|(k, &(corner, _))| {
        let next = polygon[(k + 1) % polygon.len()].0;
        [corner.min(next), corner.max(next)]
    })
}

/// The particles `own(count)` of a body, and their boundary.
pub(super) fn part<T: RealField + Copy, const D: usize>(
    grid: &Grid<f64, D>,
    per_cell: usize,
    density: f64,
    clip: &Clip<D>,
    own: &dyn Fn(usize) -> Range<usize>,
) -> (Body<T, D>, Vec<Facet<D>>) {
    let spacing = grid.spacing / per_cell as f64;
    let lower = vector![grid.lower[0], grid.lower[D - 1]];
    let sides: Vec<Side<2>> = clip.sides.iter().map(|side| side.carried()).collect();
    let lattice = Lattice {
        origin: lower.add_scalar(clip.offset * spacing),
        spacing,
        turn: clip.turn,
        in_cell: per_cell as i64,
        // A shifted lattice begins in the cell beside the grid.
        first_cell: -1,
        cells: [0, D - 1].map(|a| grid.cells[a] as i64 + 2),
    };
    let (known, X, distances) = (HashMap::new(), Vec::new(), Vec::new());
    let mut corners = Corners { sides: &sides, lattice, known, X, distances };
    let survey = Survey::new(&lattice, &sides, &mut |_, of_box| corners.clipped(of_box));
    let areas: Vec<(u64, f64)> =
        survey.cut.iter().map(|(number, own)| (*number, 0.5 * corners.moments(own).0)).collect();
    // The cut boxes at each edge; beside them there may be a whole one.
    let mut on_edge: HashMap<[u32; 2], Vec<u64>> = HashMap::new();
    for (number, polygon) in &survey.cut {
        edges(polygon).for_each(|edge| on_edge.entry(edge).or_default().push(*number));
    }
    let groups = join(&areas, spacing * spacing, |number| {
        let (of_box, Some(polygon)) = (lattice.at(number), survey.of(number)) else {
            return Vec::new();
        };
        let of_edge = |(edge, &(_, line)): ([u32; 2], &(u32, Line))| {
            let measure = (corners.at(edge[0]) - corners.at(edge[1])).norm();
            let others = on_edge[&edge].iter().copied().filter(move |other| *other != number);
            let whole = line.other_box(of_box).filter(|other| lattice.is_whole(&sides, *other));
            let whole = whole.and_then(|other| lattice.number(other));
            others.chain(whole).map(move |with| Contact { with, measure })
        };
        edges(polygon).zip(polygon).flat_map(of_edge).collect()
    });
    let division = Division { lattice, sides: &sides, survey: &survey, groups };
    let own = own(division.particles());
    let mut made = Made::new(clip.turn);
    division.each(&own, &mut |particle, boxes| {
        let is_own = own.contains(&particle);
        let mut of_particle = Vec::new();
        let (mut area, mut moment, mut segments) = (0.0, Vector2::zeros(), 0.0);
        for &(number, of_box) in boxes {
            let polygon = survey.of(number).cloned().unwrap_or_else(|| corners.whole(of_box));
            of_particle.extend(polygon.iter().map(|(corner, _)| *corner));
            if !is_own {
                continue;
            }
            let (twice, six_fold) = corners.moments(&polygon);
            area += 0.5 * twice;
            moment += six_fold / 6.0;
            for (k, &(corner, line)) in polygon.iter().enumerate() {
                made.mesh.corners.push(corner);
                let next = polygon[(k + 1) % polygon.len()].0;
                let at_edge = on_edge.get(&[corner.min(next), corner.max(next)]);
                let is_between = at_edge.is_some_and(|at| at.iter().any(|other| *other != number))
                    || line.other_box(of_box).is_some_and(|other| lattice.is_whole(&sides, other));
                if is_between {
                    continue;
                }
                let on_both = |side: &usize| {
                    [corner, next].iter().all(|at| corners.distance(*at, *side) == 0.0)
                };
                let side = match line {
                    Line::Side(side) => Some(side),
                    Line::Lattice { .. } => (0..sides.len()).find(on_both),
                };
                // Edges without a side lie where the grid ends.
                let Some(side) = side else { continue };
                segments += segment(sides[side], &corners.at(corner), &corners.at(next));
                let ends = std::array::from_fn(|k| [corner, next][k.min(1)]);
                made.add_facet(particle, side, ends);
            }
            made.mesh.ends.push(made.mesh.corners.len() as u32);
        }
        made.meet(particle, of_particle.into_iter());
        if is_own {
            made.add_particle(vector_of(moment / area), area, density * (area + segments));
        }
    });
    made.at_rest(spacing, |corner| vector_of(corners.at(corner)))
}

fn vector_of<T: RealField + Copy, const D: usize>(X: Vector2<f64>) -> SVector<T, D> {
    SVector::from_fn(|a, _| real(X[a]))
}
