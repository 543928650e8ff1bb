//! Fields of position and time as tables: tensor products of Chebyshev polynomials in the coordinates, and pieces of them in time.
//!
//! The value at a point is a sum over the coefficients of all axes. A particle stays at its position, so that its sums over the axes are
//! formed once ([`AtPoint`]); a time then costs one short sum for each quantity.
//!
//! Source: L. N. Trefethen, "Approximation Theory and Approximation Practice", SIAM (2013), chapters 3 to 8.

use std::f64::consts::PI;

use rayon::prelude::*;

/// Values of several quantities at a position, at each of some times: `values[quantity][time]`.
pub type Series = Vec<Vec<f64>>;

/// Where a field is tabulated, and how finely.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid<const D: usize> {
    /// The range of each coordinate.
    pub range: [[f64; 2]; D],
    /// Where pieces in time begin and end, ascending.
    pub knots: Vec<f64>,
    /// Polynomials along each coordinate.
    pub in_space: usize,
    /// Polynomials in time in each piece.
    pub in_time: usize,
}

/// Roots of the Chebyshev polynomial of degree `n`, ascending, from -1 to 1.
fn roots(n: usize) -> Vec<f64> {
    (0..n).map(|k| -(PI * (k as f64 + 0.5) / n as f64).cos()).collect()
}

/// The Chebyshev polynomials at a place between -1 and 1.
fn polynomials(x: f64, n: usize) -> Vec<f64> {
    let mut values = vec![1.0; n];
    if n > 1 {
        values[1] = x;
    }
    for k in 2..n {
        values[k] = 2.0 * x * values[k - 1] - values[k - 2];
    }
    values
}

/// From values at the roots to coefficients.
fn coefficients(values: &[f64]) -> Vec<f64> {
    let n = values.len();
    let of = |k: usize| {
        let at = |j: usize| (PI * k as f64 * (j as f64 + 0.5) / n as f64).cos();
        // The roots ascend, their angles descend.
        let sum: f64 = values.iter().rev().enumerate().map(|(j, value)| value * at(j)).sum();
        sum * if k == 0 { 1.0 } else { 2.0 } / n as f64
    };
    (0..n).map(of).collect()
}

/// Clenshaw's sum of a series at a place between -1 and 1.
fn sum(coefficients: &[f64], x: f64) -> f64 {
    let (mut next, mut after) = (0.0, 0.0);
    for &c in coefficients.iter().skip(1).rev() {
        (next, after) = (c + 2.0 * x * next - after, next);
    }
    coefficients.first().map_or(0.0, |first| first + x * next - after)
}

fn within([low, high]: [f64; 2], x: f64) -> f64 {
    (2.0 * x - low - high) / (high - low)
}

impl<const D: usize> Grid<D> {
    /// The times at which values are needed, ascending.
    #[must_use]
    pub fn times(&self) -> Vec<f64> {
        let of_piece = |piece: usize| {
            let [low, high] = [self.knots[piece], self.knots[piece + 1]];
            let middle = 0.5 * (low + high);
            roots(self.in_time).into_iter().map(move |x| middle + 0.5 * (high - low) * x)
        };
        (0..self.pieces()).flat_map(of_piece).collect()
    }

    fn pieces(&self) -> usize {
        self.knots.len().saturating_sub(1)
    }

    /// The coordinates of a node by its number, axis 0 fastest.
    fn node(&self, number: usize, roots: &[f64]) -> [f64; D] {
        let mut rest = number;
        std::array::from_fn(|axis| {
            let [low, high] = self.range[axis];
            let at = roots[rest % self.in_space];
            rest /= self.in_space;
            0.5 * (low + high) + 0.5 * (high - low) * at
        })
    }
}

/// Tabulated fields.
#[derive(Clone, Debug, PartialEq)]
pub struct Table<const D: usize> {
    grid: Grid<D>,
    quantities: usize,
    /// For each quantity and polynomial in time the coefficients of the nodes, axis 0 fastest.
    coefficients: Vec<Vec<f64>>,
    /// The largest value of each quantity at the nodes.
    largest: Vec<f64>,
}

/// The fields at one position, as series in time.
#[derive(Clone, Debug, PartialEq)]
pub struct AtPoint {
    knots: Vec<f64>,
    in_time: usize,
    /// For each quantity the coefficients of each piece, one piece after the other.
    coefficients: Vec<Vec<f64>>,
}

impl<const D: usize> Table<D> {
    /// Tabulates quantities whose values at a position, at all [times](Grid::times) of the grid, `of` gives.
    ///
    /// # Errors
    ///
    /// The first error of `of`, in the order of the nodes.
    pub fn new<E: Send>(
        grid: Grid<D>,
        of: impl Fn([f64; D]) -> Result<Series, E> + Sync,
    ) -> Result<Self, E> {
        let at = roots(grid.in_space);
        let nodes = grid.in_space.pow(D as u32);
        let series: Vec<Result<Series, E>> =
            (0..nodes).into_par_iter().map(|number| of(grid.node(number, &at))).collect();
        let series = series.into_iter().collect::<Result<Vec<_>, E>>()?;
        let quantities = series.first().map_or(0, Vec::len);
        let steps = grid.pieces() * grid.in_time;
        let mut columns = vec![vec![0.0; nodes]; quantities * steps];
        let mut largest = vec![0.0_f64; quantities];
        for (node, of_node) in series.iter().enumerate() {
            for (quantity, values) in of_node.iter().enumerate() {
                for (piece, values) in values.chunks_exact(grid.in_time).enumerate() {
                    let most = values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
                    largest[quantity] = largest[quantity].max(most);
                    for (k, c) in coefficients(values).into_iter().enumerate() {
                        columns[quantity * steps + piece * grid.in_time + k][node] = c;
                    }
                }
            }
        }
        columns.par_iter_mut().for_each(|column| transform::<D>(column, grid.in_space));
        Ok(Self { grid, quantities, coefficients: columns, largest })
    }

    /// Tabulates quantities as finely as an error asks for, a share of each quantity's largest value. `of` gives their values at a
    /// position, at ascending times. Pieces in time are halved where series at some positions are too short, then polynomials are added
    /// in space. Gives the table, and the largest error that random positions and times show; it is above `tolerance` where the fields
    /// are too rough for it.
    ///
    /// # Errors
    ///
    /// The first error of `of`.
    pub fn fine<E: Send>(
        range: [[f64; 2]; D],
        end: f64,
        tolerance: f64,
        of: impl Fn([f64; D], &[f64]) -> Result<Series, E> + Sync,
    ) -> Result<(Self, f64), E> {
        const IN_TIME: usize = 24;
        const IN_SPACE: [usize; 6] = [8, 12, 16, 24, 32, 40];
        const PROBES: u32 = 3 * 3;
        let knots = knots::<D, E>(range, end, tolerance, IN_TIME, &of)?;
        let grid = |in_space| Grid { range, knots: knots.clone(), in_space, in_time: IN_TIME };
        let mut best = None;
        for in_space in IN_SPACE {
            let grid = grid(in_space);
            let times = grid.times();
            let table = Self::new(grid, |X| of(X, &times))?;
            let is_fine = table.tails()[0] <= tolerance;
            best = Some(table);
            if is_fine {
                break;
            }
        }
        let Some(table) = best else { unreachable!("there are numbers of polynomials") };
        let mut error = 0.0_f64;
        for probe in 0..PROBES {
            let X = place(&range, probe);
            let share = |k: u32| fraction(0.37 + 0.618_033_988_75 * f64::from(3 * probe + k));
            let mut times: Vec<f64> = (0..3).map(|k| end * share(k)).collect();
            times.sort_by(f64::total_cmp);
            let (at, exact) = (table.at(&X), of(X, &times)?);
            for (quantity, exact) in exact.iter().enumerate() {
                let largest = table.largest[quantity].max(f64::MIN_POSITIVE);
                for (time, exact) in times.iter().zip(exact) {
                    error = error.max((at.value(quantity, *time) - exact).abs() / largest);
                }
            }
        }
        Ok((table, error))
    }

    /// The fields at a position.
    #[must_use]
    pub fn at(&self, X: &[f64; D]) -> AtPoint {
        let Grid { range, ref knots, in_space, in_time } = self.grid;
        let along: [Vec<f64>; D] =
            std::array::from_fn(|axis| polynomials(within(range[axis], X[axis]), in_space));
        let steps = self.grid.pieces() * in_time;
        let contract = |column: &Vec<f64>| {
            let mut rest = column.clone();
            for polynomials in &along {
                rest = rest
                    .chunks_exact(in_space)
                    .map(|row| row.iter().zip(polynomials).map(|(c, value)| c * value).sum())
                    .collect();
            }
            rest[0]
        };
        let of_quantity = |quantity: usize| {
            self.coefficients[quantity * steps..][..steps].iter().map(contract).collect()
        };
        let coefficients = (0..self.quantities).map(of_quantity).collect();
        AtPoint { knots: knots.clone(), in_time, coefficients }
    }

    /// The largest value of a quantity at the nodes.
    #[must_use]
    pub fn largest(&self, quantity: usize) -> f64 {
        self.largest[quantity]
    }

    /// The largest coefficient among the last two polynomials of an axis or of a piece in time, as a share of the quantity's largest
    /// value: how much the series leaves out, in space and in time.
    #[must_use]
    pub fn tails(&self) -> [f64; 2] {
        let Grid { in_space, in_time, .. } = self.grid;
        let pieces = self.grid.pieces();
        let (mut in_the_last, mut late) = (0.0_f64, 0.0_f64);
        for (number, column) in self.coefficients.iter().enumerate() {
            let largest = self.largest[number / (pieces * in_time)].max(f64::MIN_POSITIVE);
            let is_late = number % in_time + 2 >= in_time;
            for (node, c) in column.iter().enumerate() {
                let share = c.abs() / largest;
                let mut rest = node;
                for _ in 0..D {
                    if rest % in_space + 2 >= in_space {
                        in_the_last = in_the_last.max(share);
                    }
                    rest /= in_space;
                }
                if is_late {
                    late = late.max(share);
                }
            }
        }
        [in_the_last, late]
    }
}

fn fraction(x: f64) -> f64 {
    x - x.floor()
}

/// Positions that fill a range evenly, by their number (additive recurrence).
fn place<const D: usize>(range: &[[f64; 2]; D], number: u32) -> [f64; D] {
    const STEPS: [f64; 3] =
        [0.819_172_513_396_164_4, 0.671_043_606_703_789_3, 0.549_700_477_901_970_2];
    std::array::from_fn(|axis| {
        let [low, high] = range[axis];
        low + (high - low) * fraction(0.5 + STEPS[axis % 3] * f64::from(number + 1))
    })
}

/// Knots between which series of so many polynomials in time leave out less than a share of each quantity's largest value, at some positions.
fn knots<const D: usize, E>(
    range: [[f64; 2]; D],
    end: f64,
    tolerance: f64,
    in_time: usize,
    of: &impl Fn([f64; D], &[f64]) -> Result<Series, E>,
) -> Result<Vec<f64>, E> {
    const POSITIONS: u32 = 5;
    const MOST_PIECES: usize = 64;
    let mut knots = vec![0.0, end];
    loop {
        let grid = Grid { range, knots: knots.clone(), in_space: 1, in_time };
        let times = grid.times();
        let mut is_rough = vec![false; grid.pieces()];
        for number in 0..POSITIONS {
            for values in of(place(&range, number), &times)? {
                let largest =
                    values.iter().fold(f64::MIN_POSITIVE, |most, value| most.max(value.abs()));
                for (piece, values) in values.chunks_exact(in_time).enumerate() {
                    let tail = coefficients(values)
                        .iter()
                        .rev()
                        .take(2)
                        .fold(0.0_f64, |most, c| most.max(c.abs()));
                    is_rough[piece] |= tail > tolerance * largest;
                }
            }
        }
        if !is_rough.contains(&true) || knots.len() > MOST_PIECES {
            return Ok(knots);
        }
        let mut finer = vec![knots[0]];
        for (piece, ends) in knots.windows(2).enumerate() {
            if is_rough[piece] {
                finer.push(0.5 * (ends[0] + ends[1]));
            }
            finer.push(ends[1]);
        }
        knots = finer;
    }
}

/// From values at the nodes to coefficients, along each axis.
fn transform<const D: usize>(column: &mut [f64], n: usize) {
    let mut stride = 1;
    for _ in 0..D {
        for start in (0..column.len()).filter(|k| k / stride % n == 0) {
            let line: Vec<f64> = (0..n).map(|k| column[start + k * stride]).collect();
            for (k, c) in coefficients(&line).into_iter().enumerate() {
                column[start + k * stride] = c;
            }
        }
        stride *= n;
    }
}

impl AtPoint {
    /// A quantity at a time.
    #[must_use]
    pub fn value(&self, quantity: usize, time: f64) -> f64 {
        let last = self.knots.len().saturating_sub(2);
        let piece = self.knots.partition_point(|knot| *knot <= time).saturating_sub(1).min(last);
        let x = within([self.knots[piece], self.knots[piece + 1]], time);
        sum(&self.coefficients[quantity][piece * self.in_time..][..self.in_time], x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smooth_fields_have_all_digits_and_tails_tell_of_coarse_ones() {
        let field = |[x, y]: [f64; 2], t: f64| [(x * y + 0.3 * t).sin() + 2.0, (x - t).exp() * y];
        let table = |in_space, in_time| {
            let grid = Grid {
                range: [[0.5, 2.0], [-1.0, 1.0]],
                knots: vec![0.0, 1.5, 3.0],
                in_space,
                in_time,
            };
            let times = grid.times();
            Table::<2>::new(grid, |X| {
                let of = |q: usize| times.iter().map(|&t| field(X, t)[q]).collect();
                Ok::<_, ()>((0..2).map(of).collect())
            })
            .unwrap()
        };
        let fine = table(18, 16);
        let [in_space, in_time] = fine.tails();
        assert!(in_space < 1e-12 && in_time < 1e-12, "{in_space:e} {in_time:e}");
        for k in 0..50 {
            let X = [0.5 + 1.5 * (k as f64 * 0.37).fract(), 2.0 * (k as f64 * 0.71).fract() - 1.0];
            let at = fine.at(&X);
            for t in [0.0, 0.4, 1.5, 1.500001, 2.7, 3.0] {
                for q in 0..2 {
                    let off = (at.value(q, t) - field(X, t)[q]).abs() / fine.largest(q);
                    assert!(off < 3e-14, "{X:?} {t} {q} {off:e}");
                }
            }
        }
        let coarse = table(5, 16).tails();
        assert!(coarse[0] > 1e-4 && coarse[1] < 1e-12);
        assert!(table(18, 5).tails()[1] > 1e-5);
    }
}
