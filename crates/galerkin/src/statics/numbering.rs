//! The unknowns among the coefficients, and the places of their matrix.

use std::array;

use mmsmith_sparse::{Pattern, SparseError};

use crate::axis::{Axis, End};
use crate::basis::{Basis, ValueOrSlope};
use crate::boundary::Face;
use crate::component::along;
use crate::set_up::split;

/// The functions of one kind of component along an axis that do not vanish in its cells.
#[derive(Clone, Debug)]
struct Window {
    /// The first of them, by cell.
    first: Vec<usize>,
    width: usize,
    /// Coefficients that are no copies of others, as the last ones along a periodic axis are.
    own: usize,
}

impl Window {
    fn new(axis: &Axis, basis: &Basis) -> Self {
        let per_cell = basis.points / axis.cells;
        let first = |cell: usize| basis.row(cell * per_cell, ValueOrSlope::Value).0;
        let is_periodic = axis.ends[0] == End::Periodic;
        Self {
            first: (0..axis.cells).map(first).collect(),
            width: basis.width,
            own: if is_periodic { axis.cells } else { basis.functions },
        }
    }

    /// For each coefficient of this window those of another that share a cell with it, in ascending order.
    fn neighbours(&self, other: &Self) -> Vec<Vec<usize>> {
        let mut all = vec![Vec::new(); self.own];
        for (own, others) in self.first.iter().zip(&other.first) {
            for j in *own..own + self.width {
                all[j % self.own].extend((*others..others + other.width).map(|i| i % other.own));
            }
        }
        for found in &mut all {
            found.sort_unstable();
            found.dedup();
        }
        all
    }
}

/// A coefficient of a component, by its index along each axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Coefficient<const D: usize> {
    pub(super) component: usize,
    pub(super) index: [usize; D],
}

/// The unknowns among the coefficients.
#[derive(Clone, Debug)]
pub(super) struct Numbering<const D: usize> {
    /// The unknown that each coefficient of a component is; none where it is given.
    pub(super) unknown: [Vec<Option<usize>>; D],
    pub(super) count: usize,
    /// By axis and kind of component.
    windows: [[Window; 2]; D],
    /// Coefficients along each axis, by component.
    functions: [[usize; D]; D],
}

impl<const D: usize> Numbering<D> {
    pub(super) fn new(
        axes: &[Axis; D],
        bases: &[[Basis; 2]; D],
        faces: &[Face<D>],
        pinned: &[Coefficient<D>],
    ) -> Self {
        let windows: [[Window; 2]; D] =
            array::from_fn(|k| array::from_fn(|kind| Window::new(&axes[k], &bases[k][kind])));
        let functions: [[usize; D]; D] =
            array::from_fn(|c| array::from_fn(|k| along(bases, k, c).functions));
        let mut count = 0;
        let unknown = array::from_fn(|c| {
            let functions = functions[c];
            let own: [usize; D] = array::from_fn(|k| along(&windows, k, c).own);
            let is_given = |index: &[usize; D]| {
                let own = Coefficient { component: c, index: *index };
                let on_faces = || {
                    faces.iter().filter(|face| face.moves(c)).any(|face| {
                        let axis = face.side.axis;
                        let end = if face.side.upper { functions[axis] - 1 } else { 0 };
                        index[axis] == end
                    })
                };
                pinned.contains(&own) || on_faces()
            };
            let mut unknown: Vec<Option<usize>> = Vec::with_capacity(functions.iter().product());
            for place in 0..functions.iter().product() {
                let index = split(place, &functions);
                let first = array::from_fn(|k| index[k] % own[k]);
                let known = if first == index && !is_given(&index) {
                    count += 1;
                    Some(count - 1)
                } else if first == index {
                    None
                } else {
                    unknown[joined(&first, &functions)]
                };
                unknown.push(known);
            }
            unknown
        });
        Self { unknown, count, windows, functions }
    }

    /// The places of a coefficient and of its copies.
    pub(super) fn copies(&self, coefficient: &Coefficient<D>) -> Vec<usize> {
        let &Coefficient { component: c, index } = coefficient;
        let own: [usize; D] = array::from_fn(|k| along(&self.windows, k, c).own);
        let functions = &self.functions[c];
        let is_copy = |place: &usize| {
            let other = split(*place, functions);
            (0..D).all(|k| other[k] % own[k] == index[k])
        };
        (0..functions.iter().product()).filter(is_copy).collect()
    }

    /// The matrix that has a place for all coefficients that share a cell.
    pub(super) fn pattern(&self) -> Result<Pattern, SparseError> {
        let Self { windows, functions, .. } = self;
        // By axis, and by the kinds of both components.
        let neighbours: [[[Vec<Vec<usize>>; 2]; 2]; D] = array::from_fn(|k| {
            array::from_fn(|a| array::from_fn(|b| windows[k][a].neighbours(&windows[k][b])))
        });
        let (mut starts, mut rows) = (vec![0], Vec::new());
        for (c, unknown) in self.unknown.iter().enumerate() {
            let own: [usize; D] = array::from_fn(|k| along(windows, k, c).own);
            for (place, unknown) in unknown.iter().enumerate() {
                let index = split(place, &functions[c]);
                if unknown.is_none() || (0..D).any(|k| index[k] >= own[k]) {
                    continue;
                }
                for d in 0..D {
                    let lists: [&[usize]; D] = array::from_fn(|k| {
                        let kinds = (usize::from(c == k), usize::from(d == k));
                        &neighbours[k][kinds.0][kinds.1][index[k]][..]
                    });
                    let counts = lists.map(<[usize]>::len);
                    for n in 0..counts.iter().product() {
                        let at = split(n, &counts);
                        let other = array::from_fn(|k| lists[k][at[k]]);
                        rows.extend(self.unknown[d][joined(&other, &functions[d])]);
                    }
                }
                starts.push(rows.len());
            }
        }
        Pattern::new(starts, rows)
    }

    /// Appends the coefficients of a component whose functions do not vanish in a cell.
    pub(super) fn in_cell(&self, c: usize, cell: &[usize; D], places: &mut Vec<usize>) {
        let windows: [&Window; D] = array::from_fn(|k| along(&self.windows, k, c));
        let widths = windows.map(|window| window.width);
        for n in 0..widths.iter().product() {
            let at = split(n, &widths);
            let index = array::from_fn(|k| windows[k].first[cell[k]] + at[k]);
            places.push(joined(&index, &self.functions[c]));
        }
    }
}

/// The place of an index tuple.
pub(super) fn joined<const D: usize>(index: &[usize; D], counts: &[usize; D]) -> usize {
    (0..D).rev().fold(0, |place, k| place * counts[k] + index[k])
}
