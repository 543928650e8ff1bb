//! The boxes of a lattice in their order, and which of them make each particle.
//!
//! Most boxes are whole or lie outside of the body. Those are told from their corners and not kept, so that a part of a body takes the memory of that part, and
//! that of the boxes along the sides.

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::SVector;

use super::{ON, Side};

/// The boxes of a lattice, in the order of their numbers: box by box in a cell, cell by cell, along axis 0 first.
#[derive(Clone, Copy)]
pub(super) struct Lattice<const D: usize> {
    /// Where box 0 begins, in the axes of the grid.
    pub(super) origin: SVector<f64, D>,
    /// The distance of particles.
    pub(super) spacing: f64,
    pub(super) turn: [f64; 2],
    /// Boxes along an edge of a cell.
    pub(super) in_cell: i64,
    /// The lowest cell along each axis.
    pub(super) first_cell: i64,
    /// How many cells there are along each axis.
    pub(super) cells: [i64; D],
}

/// How much of a box lies inside the sides.
pub(super) enum Left {
    Nothing,
    All,
    /// A part, or nothing: a side cuts it.
    Cut,
}

impl<const D: usize> Lattice<D> {
    /// A corner in the axes of the body.
    pub(super) fn place(&self, index: [i64; D]) -> SVector<f64, D> {
        let at = self.origin + SVector::from_fn(|a, _| index[a] as f64) * self.spacing;
        let [cos, sin] = self.turn;
        SVector::from_fn(|a, _| match a {
            0 => cos * at[0] - sin * at[1],
            1 => sin * at[0] + cos * at[1],
            _ => at[a],
        })
    }

    /// The index of a corner of a box, upper along the axes whose bits are set.
    pub(super) fn corner(of_box: [i64; D], bits: usize) -> [i64; D] {
        std::array::from_fn(|a| of_box[a] + (bits >> a & 1) as i64)
    }

    /// How many boxes there are in all cells with the same index along the last axis.
    fn in_a_row(&self) -> u64 {
        let cells: i64 = self.cells[..D - 1].iter().product();
        (cells * self.in_cell.pow(D as u32)) as u64
    }

    fn rows(&self) -> u64 {
        self.cells[D - 1] as u64
    }

    /// The box of a number.
    pub(super) fn at(&self, number: u64) -> [i64; D] {
        let in_cell = self.in_cell.pow(D as u32);
        let (mut cell, mut within) = (number as i64 / in_cell, number as i64 % in_cell);
        std::array::from_fn(|a| {
            let own =
                (self.first_cell + cell % self.cells[a]) * self.in_cell + within % self.in_cell;
            (cell, within) = (cell / self.cells[a], within / self.in_cell);
            own
        })
    }

    /// The number of a box, if the lattice has it.
    pub(super) fn number(&self, of_box: [i64; D]) -> Option<u64> {
        let (mut cell, mut within) = (0, 0);
        for a in (0..D).rev() {
            let own = of_box[a].div_euclid(self.in_cell) - self.first_cell;
            if own < 0 || own >= self.cells[a] {
                return None;
            }
            cell = cell * self.cells[a] + own;
            within = within * self.in_cell + of_box[a].rem_euclid(self.in_cell);
        }
        Some((cell * self.in_cell.pow(D as u32) + within) as u64)
    }

    /// How much of a box these sides leave.
    pub(super) fn left(&self, sides: &[Side<D>], of_box: [i64; D]) -> Left {
        let near = ON * self.spacing;
        let mut middle = SVector::zeros();
        for bits in [0, (1 << D) - 1] {
            middle += self.place(Self::corner(of_box, bits)) * 0.5;
        }
        // Distances differ by no more than places do; most sides are farther away than corners from the middle.
        let reach = 0.5 * self.spacing * (D as f64).sqrt() + 2.0 * near;
        let mut is_whole = true;
        for side in sides {
            let at_middle = side.distance(&middle);
            if at_middle > reach {
                continue;
            }
            if at_middle < -reach {
                return Left::Nothing;
            }
            let mut is_outside = true;
            for bits in 0..1 << D {
                let distance = side.distance(&self.place(Self::corner(of_box, bits)));
                is_outside &= distance < near;
                is_whole &= distance > -near;
            }
            if is_outside {
                return Left::Nothing;
            }
        }
        if is_whole { Left::All } else { Left::Cut }
    }

    /// Whether the lattice has a box that lies wholly inside these sides.
    pub(super) fn is_whole(&self, sides: &[Side<D>], of_box: [i64; D]) -> bool {
        self.number(of_box).is_some() && matches!(self.left(sides, of_box), Left::All)
    }
}

/// The boxes of which something is left.
pub(super) struct Survey<S> {
    /// The parts of those that sides cut, by number.
    pub(super) cut: Vec<(u64, S)>,
    /// How many boxes there are before each row of cells, and in all.
    before_row: Vec<u64>,
}

impl<S> Survey<S> {
    /// Goes through all boxes; `clip(number, box)` gives the part that is left of one that a side cuts.
    pub(super) fn new<const D: usize>(
        lattice: &Lattice<D>,
        sides: &[Side<D>],
        clip: &mut dyn FnMut(u64, [i64; D]) -> Option<S>,
    ) -> Self {
        let (mut cut, mut before_row, mut count) = (Vec::new(), vec![0], 0);
        for row in 0..lattice.rows() {
            for number in row * lattice.in_a_row()..(row + 1) * lattice.in_a_row() {
                let of_box = lattice.at(number);
                let left = match lattice.left(sides, of_box) {
                    Left::Nothing => None,
                    Left::All => Some(None),
                    Left::Cut => clip(number, of_box).map(Some),
                };
                count += u64::from(left.is_some());
                cut.extend(left.flatten().map(|left| (number, left)));
            }
            before_row.push(count);
        }
        Self { cut, before_row }
    }

    /// The part that is left of a box that sides cut.
    pub(super) fn of(&self, number: u64) -> Option<&S> {
        let place = self.cut.binary_search_by_key(&number, |(number, _)| *number).ok()?;
        Some(&self.cut[place].1)
    }
}

/// The boxes that joined others.
pub(super) struct Groups {
    /// Their numbers, ascending.
    pub(super) joined: Vec<u64>,
    /// The boxes of each particle that has several, by the number of the first of them, which they joined.
    pub(super) members: BTreeMap<u64, Vec<u64>>,
}

/// Work on a particle and its boxes, each with its number.
type EachParticle<'a, const D: usize> = dyn FnMut(usize, &[(u64, [i64; D])]) + 'a;

/// The boxes of all particles, which have the order of their first boxes.
pub(super) struct Division<'a, S, const D: usize> {
    pub(super) lattice: Lattice<D>,
    pub(super) sides: &'a [Side<D>],
    pub(super) survey: &'a Survey<S>,
    pub(super) groups: Groups,
}

impl<S, const D: usize> Division<'_, S, D> {
    /// How many particles there are before a row of cells.
    fn before_row(&self, row: u64) -> usize {
        let first = row * self.lattice.in_a_row();
        let joined = self.groups.joined.partition_point(|&number| number < first);
        self.survey.before_row[row as usize] as usize - joined
    }

    /// How many particles there are.
    pub(super) fn particles(&self) -> usize {
        self.before_row(self.lattice.rows())
    }

    /// Calls `work(particle, boxes)`, each box with its number, for the particles `own`, and before these for all of lower number that share a corner with them.
    pub(super) fn each(&self, own: &Range<usize>, work: &mut EachParticle<'_, D>) {
        if own.is_empty() {
            return;
        }
        let row_of = |number: &u64| number / self.lattice.in_a_row();
        let rows: Vec<usize> = (0..self.lattice.rows()).map(|row| self.before_row(row)).collect();
        let first = rows.partition_point(|&before| before <= own.start) as u64 - 1;
        let last = rows.partition_point(|&before| before < own.end) as u64 - 1;
        // The rows of own particles, and of boxes that share corners with them.
        let (mut low, mut high) = (first, last);
        for boxes in self.groups.members.values() {
            if (first..=last).contains(&row_of(&boxes[0])) {
                low = boxes.iter().map(row_of).fold(low, u64::min);
                high = boxes.iter().map(row_of).fold(high, u64::max);
            }
        }
        (low, high) = (low.saturating_sub(1), high + 1);
        // Particles begin with boxes that others joined.
        let mut start = low;
        for boxes in self.groups.members.values() {
            if boxes.iter().any(|number| (low..=high).contains(&row_of(number))) {
                start = start.min(row_of(&boxes[0]));
            }
        }
        let mut particle = self.before_row(start);
        let mut members = Vec::new();
        for number in start * self.lattice.in_a_row()..self.lattice.rows() * self.lattice.in_a_row()
        {
            if particle >= own.end {
                return;
            }
            let of_box = self.lattice.at(number);
            let is_left = match self.lattice.left(self.sides, of_box) {
                Left::Nothing => false,
                Left::All => true,
                Left::Cut => self.survey.of(number).is_some(),
            };
            if !is_left || self.groups.joined.binary_search(&number).is_ok() {
                continue;
            }
            members.clear();
            match self.groups.members.get(&number) {
                Some(boxes) => {
                    members.extend(boxes.iter().map(|&number| (number, self.lattice.at(number))));
                }
                None => members.push((number, of_box)),
            }
            work(particle, &members);
            particle += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_have_their_numbers() {
        fn check<const D: usize>(in_cell: i64, first_cell: i64, cells: [i64; D]) {
            let origin = SVector::zeros();
            let lattice =
                Lattice { origin, spacing: 1.0, turn: [1.0, 0.0], in_cell, first_cell, cells };
            for number in 0..lattice.rows() * lattice.in_a_row() {
                let of_box = lattice.at(number);
                assert_eq!(lattice.number(of_box), Some(number), "{of_box:?}");
                let row = of_box[D - 1].div_euclid(in_cell) - first_cell;
                assert_eq!(number / lattice.in_a_row(), row as u64);
            }
            let mut beyond = lattice.at(0);
            beyond[0] -= 1;
            assert_eq!(lattice.number(beyond), None);
        }
        check(1, -3, [7, 5, 4]);
        check(3, -1, [4, 2]);
        check(2, -1, [3, 2, 5]);
    }
}
