//! Series in time of many particles, in few bytes: a body of many particles takes them from memory at each step, and the time for that is
//! in proportion to their bytes.
//!
//! Each piece in time of a table is halved, so that half as many polynomials follow the fields there, and those of high degree, whose
//! coefficients are small, have them in single precision. Which polynomials these are follows from the table alone, so that it is the
//! same for any part of a body.

use mmsmith_history::{AtPoint, AtTime, Table, polynomials_into};
use std::ops::Range;

/// Terms of a series that are summed side by side.
const SIDE_BY_SIDE: usize = 4;

/// Polynomials in time of a series, at most, with zeros up to a multiple of [`SIDE_BY_SIDE`].
pub(super) const MOST_TERMS: usize = 32;

/// The part of a table's error that packing may add.
const SHARE_OF_ERROR: f64 = 0.05;

/// The largest relative error of a number in single precision.
const SINGLE: f64 = 1.0 / (1 << 24) as f64;

/// The polynomials at a time.
pub(super) struct PackedTime {
    /// The half of a piece that has the time, counted from the first.
    pub(super) half: usize,
    pub(super) polynomials: [f64; MOST_TERMS],
}

impl PackedTime {
    pub(super) fn of(time: AtTime) -> Self {
        let is_late = time.x > 0.0;
        let x = if is_late { 2.0 * time.x - 1.0 } else { 2.0 * time.x + 1.0 };
        let mut polynomials = [0.0; MOST_TERMS];
        polynomials_into(x, &mut polynomials);
        Self { half: 2 * time.piece + usize::from(is_late), polynomials }
    }

    #[inline(always)]
    fn groups(&self) -> &[[f64; SIDE_BY_SIDE]] {
        self.polynomials.as_chunks().0
    }
}

/// The coefficients over both halves of a piece for those over the piece, `[half][over the piece][over the half]`.
struct Halves([Vec<Vec<f64>>; 2]);

impl Halves {
    fn new(in_time: usize) -> Self {
        // T_(j+1)(y) = 2 y T_j(y) - T_(j-1)(y) with y = (x - 1) / 2 or (x + 1) / 2, and x T_i = (T_(i+1) + T_|i-1|) / 2.
        let of_half = |shift: f64| {
            let times_y = |own: &[f64]| {
                let mut product: Vec<f64> = own.iter().map(|c| shift * c).collect();
                for (i, c) in own.iter().enumerate().filter(|(_, c)| **c != 0.0) {
                    product[i.abs_diff(1)] += 0.25 * c;
                    if let Some(upper) = product.get_mut(i + 1) {
                        *upper += 0.25 * c;
                    }
                }
                product
            };
            let mut rows: Vec<Vec<f64>> = Vec::new();
            for j in 0..in_time {
                let row = match j {
                    0 => (0..in_time.max(2)).map(|i| f64::from(u8::from(i == 0))).collect(),
                    1 => times_y(&rows[0]),
                    _ => {
                        let product = times_y(&rows[j - 1]);
                        product.iter().zip(&rows[j - 2]).map(|(p, c)| 2.0 * p - c).collect()
                    }
                };
                rows.push(row);
            }
            rows
        };
        Self([of_half(-0.5), of_half(0.5)])
    }

    /// The coefficients over a half.
    fn coefficients<'a>(&'a self, half: usize, over_piece: &'a [f64]) -> impl Iterator<Item = f64> {
        (0..over_piece.len())
            .map(move |i| self.0[half].iter().zip(over_piece).map(|(row, c)| row[i] * c).sum())
    }

    /// Bounds of the magnitudes of coefficients over a half.
    fn bounds(&self, half: usize, over_piece: &[f64]) -> Vec<f64> {
        let of =
            |i: usize| self.0[half].iter().zip(over_piece).map(move |(row, c)| row[i].abs() * c);
        (0..over_piece.len()).map(|i| of(i).sum()).collect()
    }
}

/// How the series of some quantities of a table are packed.
pub(super) struct Packing {
    quantities: usize,
    pieces: usize,
    in_time: usize,
    /// Groups of [`SIDE_BY_SIDE`] coefficients in double precision.
    doubles: usize,
    /// Groups after these, in single precision.
    singles: usize,
    halves: Halves,
}

impl Packing {
    /// For quantities of a table with an error; `kinds` has the kind of each quantity of the table, as components of one tensor are of
    /// one kind.
    pub(super) fn new<const K: usize>(
        table: &Table<K>,
        error: f64,
        kinds: &[usize],
        quantities: &Range<usize>,
    ) -> Self {
        let (pieces, in_time) = (table.grid().pieces(), table.grid().in_time);
        let halves = Halves::new(in_time);
        let scale = |quantity: usize| {
            let of_kind = quantities.clone().filter(|own| kinds[*own] == kinds[quantity]);
            of_kind.map(|own| table.largest(own)).fold(0.0, f64::max)
        };
        // Polynomials in space are at most one: a bound of each coefficient in time, at any place.
        let bound = |column: &[f64]| column.iter().map(|c| c.abs()).sum();
        let steps = pieces * in_time;
        let columns = table.columns().skip(quantities.start * steps).take(quantities.len() * steps);
        let bounds: Vec<f64> = columns.map(bound).collect();
        // The sums of the bounds from each degree on as shares of the scale, the largest of all series.
        let mut rests = vec![0.0_f64; in_time];
        for (quantity, own) in quantities.clone().zip(bounds.chunks_exact(steps)) {
            let scale = scale(quantity);
            if scale == 0.0 {
                continue;
            }
            for (piece, half) in
                own.chunks_exact(in_time).flat_map(|piece| [(piece, 0), (piece, 1)])
            {
                let mut rest = 0.0;
                for (most, bound) in rests.iter_mut().zip(halves.bounds(half, piece)).rev() {
                    rest += bound / scale;
                    *most = most.max(rest);
                }
            }
        }
        let until = |most: f64| {
            let count = rests.iter().position(|rest| *rest <= most).unwrap_or(in_time);
            count.max(1).div_ceil(SIDE_BY_SIDE)
        };
        let added = 0.5 * SHARE_OF_ERROR * error;
        let doubles = until(added / SINGLE);
        let singles = until(added).saturating_sub(doubles);
        Self { quantities: quantities.len(), pieces, in_time, doubles, singles, halves }
    }
}

/// Series of several quantities of particles.
///
/// At a time those of all particles are next to each other: coefficients are ordered by the half of a piece, by particle, by groups of
/// [`SIDE_BY_SIDE`] polynomials, by quantity.
pub(super) struct Packed {
    packing: Packing,
    particles: usize,
    doubles: Vec<[f64; SIDE_BY_SIDE]>,
    singles: Vec<[f32; SIDE_BY_SIDE]>,
}

impl Packed {
    /// For so many particles, whose series follow by [`set`](Self::set).
    pub(super) fn new(packing: Packing, particles: usize) -> Self {
        let series = 2 * packing.pieces * particles * packing.quantities;
        let doubles = vec![[0.0; SIDE_BY_SIDE]; series * packing.doubles];
        let singles = vec![[0.0; SIDE_BY_SIDE]; series * packing.singles];
        Self { packing, particles, doubles, singles }
    }

    /// Sets the series of a particle.
    pub(super) fn set(&mut self, n: usize, series: &AtPoint) {
        let Packing { in_time, quantities, doubles, singles, .. } = self.packing;
        for quantity in 0..quantities {
            for (piece, own) in series.coefficients(quantity).chunks_exact(in_time).enumerate() {
                for half in 0..2 {
                    let places = self.ranges(2 * piece + half, n);
                    let [of_doubles, of_singles] = places.map(|range| range.start + quantity);
                    for (i, c) in self.packing.halves.coefficients(half, own).enumerate() {
                        let (group, m) = (i / SIDE_BY_SIDE, i % SIDE_BY_SIDE);
                        if group < doubles {
                            self.doubles[of_doubles + group * quantities][m] = c;
                        } else if group < doubles + singles {
                            let place = of_singles + (group - doubles) * quantities;
                            self.singles[place][m] = c as f32;
                        }
                    }
                }
            }
        }
    }

    /// Where the coefficients of a particle are: the doubles, the singles.
    #[inline(always)]
    fn ranges(&self, half: usize, n: usize) -> [Range<usize>; 2] {
        let Packing { quantities, doubles, singles, .. } = self.packing;
        [doubles, singles].map(|groups| {
            let groups = quantities * groups;
            let first = (half * self.particles + n) * groups;
            first..first + groups
        })
    }

    /// The values of all quantities of a particle, of which there are `N`.
    #[inline(always)]
    pub(super) fn values<const N: usize>(&self, n: usize, time: &PackedTime) -> [f64; N] {
        let [doubles, singles] = self.ranges(time.half, n);
        let (first, rest) = time.groups().split_at(self.packing.doubles);
        let mut sums = [[0.0; SIDE_BY_SIDE]; N];
        for (own, p) in self.doubles[doubles].as_chunks::<N>().0.iter().zip(first) {
            sums.iter_mut().zip(own).for_each(|(sums, own)| add(sums, *own, p));
        }
        for (own, p) in self.singles[singles].as_chunks::<N>().0.iter().zip(rest) {
            sums.iter_mut().zip(own).for_each(|(sums, own)| add(sums, own.map(f64::from), p));
        }
        sums.map(total)
    }

    /// The value of a quantity of a particle.
    pub(super) fn value(&self, n: usize, quantity: usize, time: &PackedTime) -> f64 {
        let [doubles, singles] = self.ranges(time.half, n);
        let quantities = self.packing.quantities;
        let of_doubles = self.doubles[doubles].iter().skip(quantity).step_by(quantities);
        let of_singles = self.singles[singles].iter().skip(quantity).step_by(quantities);
        let all = of_doubles.copied().chain(of_singles.map(|own| own.map(f64::from)));
        let mut sums = [0.0; SIDE_BY_SIDE];
        all.zip(time.groups()).for_each(|(own, p)| add(&mut sums, own, p));
        total(sums)
    }

    /// How many polynomials each series has.
    pub(super) fn terms(&self) -> usize {
        SIDE_BY_SIDE * (self.packing.doubles + self.packing.singles)
    }

    pub(super) fn bytes_per_particle(&self) -> usize {
        let Packing { pieces, quantities, doubles, singles, .. } = self.packing;
        let of_series =
            size_of::<[f64; SIDE_BY_SIDE]>() * doubles + size_of::<[f32; SIDE_BY_SIDE]>() * singles;
        2 * pieces * quantities * of_series
    }
}

/// Adds terms to sums that are formed side by side.
#[inline(always)]
fn add(sums: &mut [f64; SIDE_BY_SIDE], own: [f64; SIDE_BY_SIDE], p: &[f64; SIDE_BY_SIDE]) {
    for m in 0..SIDE_BY_SIDE {
        sums[m] += own[m] * p[m];
    }
}

#[inline(always)]
fn total([a, b, c, d]: [f64; SIDE_BY_SIDE]) -> f64 {
    (a + b) + (c + d)
}

#[cfg(test)]
mod tests {
    use super::*;
    use mmsmith_history::place;

    #[test]
    fn packed_series_have_the_values_of_the_table_in_fewer_bytes() {
        const QUANTITIES: Range<usize> = 1..3;
        let range = [[0.0, 1.0]; 2];
        // Components of one kind, of which one is small, and another quantity before them.
        let field = |[x, y]: [f64; 2], t: f64| {
            let wave = (2.0 * x + t).sin() * (y - 3.0 * t).cos();
            [1e6 * wave, wave.exp(), 1e-5 * (x * y + 9.0 * t).cos()]
        };
        let of = |X: [f64; 2], times: &[f64]| {
            let all: Vec<[f64; 3]> = times.iter().map(|t| field(X, *t)).collect();
            Ok::<_, ()>((0..3).map(|k| all.iter().map(|own| own[k]).collect()).collect())
        };
        let kinds = [0, 1, 1];
        let Ok((table, error)) = Table::fine_by_kinds(range, 2.0, 1e-13, &kinds, of) else {
            panic!("fields have values everywhere")
        };
        let packing = Packing::new(&table, error, &kinds, &QUANTITIES);
        let padded = table.grid().in_time.div_ceil(SIDE_BY_SIDE);
        assert!(2 * packing.doubles + packing.singles <= 3 * padded / 2);
        let places: Vec<[f64; 2]> = (0..50).map(|number| place(&range, number)).collect();
        let mut packed = Packed::new(packing, places.len());
        let all = table.at_all_of(&places, QUANTITIES);
        all.iter().enumerate().for_each(|(n, series)| packed.set(n, series));
        let most = (SHARE_OF_ERROR * error + 4.0 * f64::EPSILON) * table.largest(1);
        // The first and the last time, and where pieces and halves meet, as well.
        for t in (0..=160).map(|k| 2.0 * f64::from(k) / 160.0) {
            let time = PackedTime::of(table.grid().at_time(t));
            for (n, series) in all.iter().enumerate() {
                for quantity in 0..QUANTITIES.len() {
                    let differ = packed.value(n, quantity, &time) - series.value(quantity, t);
                    assert!(differ.abs() <= most, "{differ:e} at {t}, {most:e} allowed");
                }
            }
        }
    }
}
