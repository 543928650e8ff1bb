//! Rigid motions that the sides leave free, and the coefficients that hold the body.
//!
//! A body on whose sides tractions alone are given moves as a whole without a force, and its stiffness matrix has no inverse. Loads that are
//! those of an exact solution are in equilibrium, so that the body may be held at as many coefficients as it has such motions: at the values
//! of the exact displacement, without a force in the limit of fine cells.

use std::array;

use nalgebra::{Matrix6, SVector, Vector6};

use crate::axis::{Axis, End};
use crate::basis::Basis;
use crate::boundary::{Face, Side};
use crate::component::along;
use crate::fit::Line;
use crate::set_up::{Given, Grid, face, products};
use crate::statics::numbering::Coefficient;

/// A coefficient that is given, so that the body cannot move as a whole.
pub(super) struct Pin<const D: usize> {
    pub(super) coefficient: Coefficient<D>,
    /// The side on which it lies; its motion is asked for as if it were given.
    pub(super) face: Face<D>,
    /// The place next to it, Cartesian.
    pub(super) X: SVector<f64, D>,
}

/// Displacements and infinitesimal rotations about the centre of a body.
struct RigidMotions<'a, const D: usize> {
    grid: &'a Grid<D>,
    centre: SVector<f64, D>,
    size: f64,
}

impl<'a, const D: usize> RigidMotions<'a, D> {
    /// Translations along the axes, and rotations in the planes of two of them.
    const COUNT: usize = D * (D + 1) / 2;

    fn new(grid: &'a Grid<D>) -> Self {
        let places = places(grid).map(|place| grid.coordinates.place(&place));
        let mut low = SVector::<f64, D>::repeat(f64::INFINITY);
        let mut high = -low;
        for X in places {
            (low, high) = (low.inf(&X), high.sup(&X));
        }
        Self { grid, centre: (low + high) * 0.5, size: (high - low).amax() }
    }

    /// A component of each of the motions at a place in the grid's coordinates.
    fn component(&self, c: usize, place: &SVector<f64, D>) -> Vector6<f64> {
        let coordinates = self.grid.coordinates;
        let e = match coordinates.frame(place) {
            Some(frame) => frame.column(c).into_owned(),
            None => SVector::from_fn(|i, _| f64::from(u8::from(i == c))),
        };
        let x = (coordinates.place(place) - self.centre) / self.size;
        let pairs = (0..D).flat_map(|i| (i + 1..D).map(move |j| (i, j)));
        let rotations = pairs.map(|(i, j)| e[i] * x[j] - e[j] * x[i]);
        let mut all = Vector6::zeros();
        for (own, value) in all.iter_mut().zip(e.iter().copied().chain(rotations)) {
            *own = value;
        }
        all
    }

    /// Combinations of the motions that have to vanish at the ends of the axes.
    fn conditions(&self) -> Vec<Vector6<f64>> {
        let mut all = Vec::new();
        for (k, axis) in self.grid.axes.iter().enumerate() {
            for place in places(self.grid) {
                let at = |coordinate: f64| {
                    let mut at = place;
                    at[k] = coordinate;
                    at
                };
                let apart = match axis.ends[0] {
                    End::Periodic => Some(axis.upper),
                    // Any other coordinate.
                    End::Uniform => Some(axis.lower + 0.37 * (axis.upper - axis.lower)),
                    End::Open(_) | End::Wall => None,
                };
                if let Some(other) = apart {
                    let both =
                        |c| self.component(c, &at(axis.lower)) - self.component(c, &at(other));
                    all.extend((0..D).map(both));
                }
                for (end, coordinate) in axis.ends.iter().zip([axis.lower, axis.upper]) {
                    let is_held = |c: usize| match end {
                        End::Wall => c == k,
                        _ => axis.moved(c)[usize::from(coordinate == axis.upper)],
                    };
                    let held = (0..D).filter(|c| is_held(*c));
                    all.extend(held.map(|c| self.component(c, &at(coordinate))));
                }
            }
        }
        all
    }
}

/// The ends of all axes, and places between them, of which no two lie across from each other on a circle.
fn places<const D: usize>(grid: &Grid<D>) -> impl Iterator<Item = SVector<f64, D>> {
    const PARTS: [f64; 4] = [0.0, 0.37, 0.71, 1.0];
    let of = |axis: &Axis| PARTS.map(|part| axis.lower + part * (axis.upper - axis.lower));
    let along = grid.axes.each_ref().map(of);
    products([PARTS.len(); D]).map(move |index| SVector::from_fn(|k, _| along[k][index[k]]))
}

/// Coefficients that hold the body against the rigid motions that its sides leave free; none where they leave none. Fewer than there are
/// such motions where no end of an axis is a surface.
pub(super) fn pins<const D: usize>(
    grid: &Grid<D>,
    bases: &[[Basis; 2]; D],
    lines: &[Line; D],
) -> Vec<Pin<D>> {
    /// A motion is none whose sum of squares is below this, where a whole one has one.
    const NONE: f64 = 1e-9;
    let motions = RigidMotions::new(grid);
    // Numbers without a motion are no motions.
    let mut sums =
        Matrix6::from_fn(|i, j| f64::from(u8::from(i == j && i >= RigidMotions::<D>::COUNT)));
    for condition in motions.conditions() {
        sums += condition * condition.transpose();
    }
    let candidates = candidates(grid, bases);
    let mut pins = Vec::new();
    loop {
        let found = sums.symmetric_eigen();
        let free: Vec<Vector6<f64>> = found
            .eigenvalues
            .iter()
            .zip(found.eigenvectors.column_iter())
            .filter(|(value, _)| **value < NONE)
            .map(|(_, motion)| motion.into_owned())
            .collect();
        let mut best: Option<(f64, &Candidate<D>)> = None;
        for candidate in &candidates {
            let own = motions.component(candidate.component, &candidate.place);
            let moved: f64 = free.iter().map(|motion| motion.dot(&own).powi(2)).sum();
            if moved > NONE.max(best.map_or(0.0, |(most, _)| most * (1.0 + NONE))) {
                best = Some((moved, candidate));
            }
        }
        let Some((_, Candidate { side, component, index, place })) = best else { return pins };
        let own = motions.component(*component, place);
        sums += own * own.transpose();
        let of_side = Given::of(&grid.axes, *side, *component, true);
        pins.push(Pin {
            coefficient: Coefficient { component: *component, index: *index },
            face: face(grid, lines, *side, &of_side),
            X: grid.coordinates.place(place),
        });
    }
}

/// A coefficient on a surface.
struct Candidate<const D: usize> {
    side: Side,
    component: usize,
    index: [usize; D],
    /// The place next to it, in the grid's coordinates.
    place: SVector<f64, D>,
}

/// Some coefficients on all surfaces.
fn candidates<const D: usize>(grid: &Grid<D>, bases: &[[Basis; 2]; D]) -> Vec<Candidate<D>> {
    let mut all = Vec::new();
    let sides = (0..D).flat_map(|axis| [true, false].map(|upper| Side { axis, upper }));
    for side in sides {
        let axis = &grid.axes[side.axis];
        let end = axis.ends[usize::from(side.upper)];
        for component in (0..D).filter(|_| end.is_clamped()) {
            let counts: [usize; D] = array::from_fn(|k| match grid.axes[k].ends[0] {
                End::Periodic => grid.axes[k].cells,
                _ => along(bases, k, component).functions,
            });
            for parts in products::<D>(array::from_fn(|k| if k == side.axis { 1 } else { 3 })) {
                let index = array::from_fn(|k| {
                    let last = counts[k] - 1;
                    match (k == side.axis, grid.axes[k].ends[0]) {
                        (true, _) => last * usize::from(side.upper),
                        (false, End::Periodic) => parts[k] * counts[k] / 4,
                        (false, _) => parts[k] * last / 2,
                    }
                });
                let place = SVector::from_fn(|k, _| {
                    let own: &Axis = &grid.axes[k];
                    let all = match own.ends[0] {
                        End::Periodic => counts[k],
                        _ => (counts[k] - 1).max(1),
                    };
                    own.lower + (own.upper - own.lower) * index[k] as f64 / all as f64
                });
                // On the axis of rotation coordinates are no places.
                let mut far: SVector<f64, D> = place;
                far[0] = grid.axes[0].upper;
                let [here, there] = [place, far].map(|place| grid.coordinates.scales(&place).min());
                if here > 1e-9 * there {
                    all.push(Candidate { side, component, index, place });
                }
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::Layout;
    use crate::coordinates::Coordinates;
    use crate::set_up::{bases, line};
    use mmsmith_vocabulary::ComponentCondition::{PrescribedMotion, PrescribedTraction};
    use std::f64::consts::{FRAC_PI_2, TAU};

    const LOADED: [End; 2] = [End::LOADED; 2];
    const WALLS: [End; 2] = [End::Wall; 2];

    /// The number of pins of a body with axes of these lower and upper ends and conditions.
    fn held<const D: usize>(coordinates: Coordinates, axes: [(f64, f64, [End; 2]); D]) -> usize {
        let axes = axes.map(|(lower, upper, ends)| {
            let cells = if ends == [End::Uniform; 2] { 1 } else { 4 };
            Axis { lower, upper, cells, ends }
        });
        let grid = Grid { axes, coordinates, per_cell: 3, layout: Layout::Gauss };
        let lines = array::from_fn(|k| line(&grid, k));
        let bases = bases(&grid, 2, &lines).unwrap();
        let pins = pins(&grid, &bases, &lines);
        // No coefficient is given twice.
        for (n, pin) in pins.iter().enumerate() {
            let is_other = |other: &Pin<D>| other.coefficient != pin.coefficient;
            assert!(pins[n + 1..].iter().all(is_other));
        }
        pins.len()
    }

    #[test]
    fn as_many_coefficients_hold_a_body_as_its_sides_leave_rigid_motions() {
        use Coordinates::{Cartesian, Cylindrical, Polar, Spherical};
        let mixed = |first| End::Open([first, PrescribedTraction, PrescribedTraction]);
        let roller = |axis: usize| {
            let mut of = [PrescribedTraction; 3];
            of[axis] = PrescribedMotion;
            End::Open(of)
        };
        let moved = [End::MOVED, End::LOADED];
        let wall = [End::Wall, End::LOADED];
        let x = |ends| (-1.0, 3.0, ends);
        assert_eq!(held(Cartesian, [x(LOADED)]), 1);
        assert_eq!(held(Cartesian, [x(moved)]), 0);
        assert_eq!(held(Cartesian, [x(WALLS)]), 0);
        assert_eq!(held(Cartesian, [x(LOADED), x(LOADED)]), 3);
        assert_eq!(held(Cartesian, [x(LOADED), x(wall)]), 1);
        assert_eq!(held(Cartesian, [x(wall), x(wall)]), 0);
        assert_eq!(held(Cartesian, [x(LOADED), x([roller(1), End::LOADED])]), 1);
        // A side that may not slide, and moves away as it likes: a motion across it and no turn.
        assert_eq!(held(Cartesian, [x([roller(1), End::LOADED]), x(LOADED)]), 2);
        assert_eq!(held(Cartesian, [x([mixed(PrescribedMotion), End::LOADED]), x(moved)]), 0);
        assert_eq!(held(Cartesian, [x(LOADED); 3]), 6);
        assert_eq!(held(Cartesian, [x(LOADED), x(wall), x(LOADED)]), 3);
        assert_eq!(held(Cartesian, [x(wall), x(wall), x(LOADED)]), 1);
        assert_eq!(held(Cartesian, [x(moved), x(LOADED), x(LOADED)]), 0);
        let radius = |ends| (0.5, 2.0, ends);
        let ring = (0.0, TAU, [End::Periodic; 2]);
        assert_eq!(held(Polar, [radius(LOADED), ring]), 3);
        assert_eq!(held(Polar, [radius(moved), ring]), 0);
        assert_eq!(held(Polar, [radius([roller(0), End::LOADED]), ring]), 1);
        assert_eq!(held(Polar, [radius(LOADED), (0.0, FRAC_PI_2, WALLS)]), 0);
        // Axisymmetric: along the axis and around it.
        let around = (0.0, TAU, [End::Uniform; 2]);
        assert_eq!(held(Cylindrical, [radius(LOADED), around, x(LOADED)]), 2);
        assert_eq!(held(Cylindrical, [(0.0, 2.0, LOADED), around, x(wall)]), 1);
        assert_eq!(held(Cylindrical, [radius(LOADED), ring, x(LOADED)]), 6);
        let octant = (0.0, FRAC_PI_2, WALLS);
        let down = (0.4, FRAC_PI_2, [End::LOADED, End::Wall]);
        assert_eq!(held(Spherical, [radius(LOADED), down, octant]), 0);
    }
}
