//! Fields of position and time as tables: tensor products of Chebyshev polynomials in the coordinates, and pieces of them in time.
//!
//! The value at a point is a sum over the coefficients of all axes. A particle stays at its position, so that its sums over the axes are
//! formed once ([`AtPoint`]); a time then costs one short sum for each quantity.
//!
//! Source: L. N. Trefethen, "Approximation Theory and Approximation Practice", SIAM (2013), chapters 3 to 8.

use mmsmith_scalar_functions::ScalarFunctions;
use std::ops::Range;

use mmsmith_threads::parallel::*;

/// Values of several quantities at a position, at each of some times: `values[quantity][time]`.
pub type Series = Vec<Vec<f64>>;

/// Where a field is tabulated, and how finely. There may be fewer coordinates than dimensions, as where a field depends on a radius alone.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid<const D: usize> {
    /// The range of each coordinate.
    pub range: [[f64; 2]; D],
    /// Where pieces in time begin and end, ascending.
    pub knots: Vec<f64>,
    /// Polynomials along each coordinate.
    pub in_space: [usize; D],
    /// Polynomials in time in each piece.
    pub in_time: usize,
}

/// Roots of the Chebyshev polynomial of degree `n`, ascending, from -1 to 1.
pub(crate) fn roots(n: usize) -> Vec<f64> {
    (0..n).map(|k| -cosine(2 * k + 1, n)).collect()
}

/// `cos(pi k / 2n)`, from angles up to a quarter of a turn: whole ones are left out before there is any rounding.
fn cosine(k: usize, n: usize) -> f64 {
    let within = k % (4 * n);
    let within = within.min(4 * n - within);
    match within <= n {
        true => (within as f64 / (2 * n) as f64).cos_pi(),
        false => -((2 * n - within) as f64 / (2 * n) as f64).cos_pi(),
    }
}

/// The Chebyshev polynomials at a place between -1 and 1.
fn polynomials(x: f64, n: usize) -> Vec<f64> {
    let mut values = vec![0.0; n];
    polynomials_into(x, &mut values);
    values
}

/// The Chebyshev polynomials at a place between -1 and 1, as many as there is room for.
pub fn polynomials_into(x: f64, values: &mut [f64]) {
    let (mut last, mut next) = (1.0, x);
    for value in values {
        *value = last;
        (last, next) = (next, 2.0 * x * next - last);
    }
}

/// From values at the roots to coefficients.
pub(crate) struct Transform {
    n: usize,
    /// Row by row.
    matrix: Vec<f64>,
}

impl Transform {
    pub(crate) fn new(n: usize) -> Self {
        let entry = |k: usize, j: usize| {
            // The roots ascend, their angles descend.
            let cosine = cosine(k * (2 * (n - 1 - j) + 1), n);
            cosine * if k == 0 { 1.0 } else { 2.0 } / n as f64
        };
        let matrix = (0..n * n).map(|place| entry(place / n, place % n)).collect();
        Self { n, matrix }
    }

    pub(crate) fn coefficients(&self, values: &[f64]) -> impl Iterator<Item = f64> {
        self.matrix
            .chunks_exact(self.n)
            .map(move |row| row.iter().zip(values).map(|(weight, value)| weight * value).sum())
    }
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

    /// Pieces in time.
    #[must_use]
    pub fn pieces(&self) -> usize {
        self.knots.len().saturating_sub(1)
    }

    /// The coordinates of a node by its number, axis 0 fastest.
    fn node(&self, number: usize, roots: &[Vec<f64>; D]) -> [f64; D] {
        let mut rest = number;
        std::array::from_fn(|axis| {
            let [low, high] = self.range[axis];
            let at = roots[axis][rest % self.in_space[axis]];
            rest /= self.in_space[axis];
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
    /// The scale of the errors of each quantity.
    scales: Vec<f64>,
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
        let at = grid.in_space.map(roots);
        let nodes = grid.in_space.iter().product();
        let series: Vec<Result<Series, E>> =
            (0..nodes).into_par_iter().map(|number| of(grid.node(number, &at))).collect();
        let series = series.into_iter().collect::<Result<Vec<_>, E>>()?;
        let quantities = series.first().map_or(0, Vec::len);
        let steps = grid.pieces() * grid.in_time;
        let mut columns = vec![vec![0.0; nodes]; quantities * steps];
        let mut largest = vec![0.0_f64; quantities];
        let in_time = Transform::new(grid.in_time);
        for (node, of_node) in series.iter().enumerate() {
            for (quantity, values) in of_node.iter().enumerate() {
                largest[quantity] = largest_of(values).max(largest[quantity]);
                for (piece, values) in values.chunks_exact(grid.in_time).enumerate() {
                    for (k, c) in in_time.coefficients(values).enumerate() {
                        columns[quantity * steps + piece * grid.in_time + k][node] = c;
                    }
                }
            }
        }
        let along = grid.in_space.map(Transform::new);
        columns.par_iter_mut().for_each(|column| transform(column, &along));
        let scales = largest.clone();
        Ok(Self { grid, quantities, coefficients: columns, largest, scales })
    }

    /// As [`fine_by_kinds`](Self::fine_by_kinds), with each quantity a kind of its own.
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
        Self::fine_by_kinds(range, end, tolerance, &[], of)
    }

    /// Tabulates quantities as finely as an error asks for, and no finer. Errors are shares of the largest value of the quantity's kind:
    /// quantities of the same number in `kinds`, as components of one tensor, are of one kind; those that it does not number have a kind
    /// of their own. A kind that is nothing but rounding counts for nothing. `of` gives the values at a position, at ascending times.
    /// Pieces in time are halved where series at some positions are too short; polynomials in space are counted along lines.
    ///
    /// Gives the table, and an error that random positions and times keep; it is above `tolerance` where the fields are too rough for it.
    ///
    /// # Errors
    ///
    /// The first error of `of`.
    pub fn fine_by_kinds<E: Send>(
        range: [[f64; 2]; D],
        end: f64,
        tolerance: f64,
        kinds: &[usize],
        of: impl Fn([f64; D], &[f64]) -> Result<Series, E> + Sync,
    ) -> Result<(Self, f64), E> {
        const PROBES: u32 = 64;
        const TIMES: u32 = 5;
        // Where series are long enough, errors are those of the trajectories, whose largest at many thousand places was 2.5 times that of a
        // hundred.
        const FOR_OTHER_PLACES: f64 = 3.0;
        const MOST_RAISES: usize = 1;
        // Some lines and positions do not show all: a half is for the others.
        let half = 0.5 * tolerance;
        let (knots, in_time, kinds) = in_time(range, end, half, kinds, &of)?;
        let mut grid = Grid { range, knots, in_space: [1; D], in_time };
        let mut times = grid.times();
        for axis in 0..D {
            grid.in_space[axis] = along_lines(range, axis, half, &times, &kinds, &of)?;
        }
        let new = |grid: &Grid<D>, times: &[f64]| {
            let mut table = Self::new(grid.clone(), |X| of(X, times))?;
            table.scales = kinds.scales(&table.largest);
            Ok(table)
        };
        let mut table = new(&grid, &times)?;
        for _ in 0..MOST_RAISES {
            let (tails, late) = table.all_tails();
            // Another table takes its time, and rough fields do not become smooth by some more nodes.
            let is_short = |tail: f64| tail > 8.0 * tolerance && tail < 1e3 * tolerance;
            if !tails.iter().chain([&late]).any(|&tail| is_short(tail)) {
                break;
            }
            if is_short(late) {
                grid.in_time += 2;
                times = grid.times();
            }
            for (count, tail) in grid.in_space.iter_mut().zip(tails) {
                *count += if is_short(tail) { 4 } else { 0 };
            }
            table = new(&grid, &times)?;
        }
        let probe = |probe: u32| -> Result<f64, E> {
            let X = place(&range, probe);
            // Series are worst next to the ends of the ranges.
            let X = if probe % 2 == 1 { outwards(&range, X) } else { X };
            let share = |k: u32| fraction(0.37 + 0.618_033_988_75 * f64::from(TIMES * probe + k));
            let mut times: Vec<f64> = (0..TIMES).map(|k| end * share(k)).collect();
            times.sort_by(f64::total_cmp);
            let (at, exact) = (table.at(&X), of(X, &times)?);
            let mut error = 0.0_f64;
            for (quantity, exact) in exact.iter().enumerate() {
                let largest = table.scales[quantity].max(f64::MIN_POSITIVE);
                for (time, exact) in times.iter().zip(exact) {
                    error = error.max((at.value(quantity, *time) - exact).abs() / largest);
                }
            }
            Ok(error)
        };
        let errors: Vec<Result<f64, E>> = (0..PROBES).into_par_iter().map(probe).collect();
        let mut error = table.tails().into_iter().sum::<f64>();
        for found in errors {
            error = error.max(FOR_OTHER_PLACES * found?);
        }
        Ok((table, error))
    }

    /// The fields at a position.
    #[must_use]
    pub fn at(&self, X: &[f64; D]) -> AtPoint {
        self.at_some(std::slice::from_ref(X), 0..self.quantities).swap_remove(0)
    }

    /// The fields at many positions. Those in a row that share their last coordinates, as points of a lattice do, share sums.
    #[must_use]
    pub fn at_all(&self, points: &[[f64; D]]) -> Vec<AtPoint> {
        self.at_all_of(points, 0..self.quantities)
    }

    /// As [`at_all`](Self::at_all), of some of the quantities, which count from zero at the points: the time that this takes is in proportion
    /// to their number. Those beyond the last are left out.
    #[must_use]
    pub fn at_all_of(&self, points: &[[f64; D]], quantities: Range<usize>) -> Vec<AtPoint> {
        const CHUNK: usize = 256;
        let of = |chunk| self.at_some(chunk, quantities.clone());
        let chunks: Vec<Vec<AtPoint>> = points.par_chunks(CHUNK).map(of).collect();
        chunks.into_iter().flatten().collect()
    }

    fn at_some(&self, points: &[[f64; D]], quantities: Range<usize>) -> Vec<AtPoint> {
        let end = quantities.end.min(self.quantities);
        let quantities = quantities.start.min(end)..end;
        let Grid { range, ref knots, in_space, in_time } = self.grid;
        let steps = self.grid.pieces() * in_time;
        // The axis from which on, downwards, sums differ from those of the point before, and the polynomials of the point.
        let mut before: Option<&[f64; D]> = None;
        let of_point = |X| {
            let first = match before.replace(X) {
                None => D,
                Some(before) => (0..D).rev().find(|&k| before[k] != X[k]).map_or(1, |k| k + 1),
            };
            let along: [Vec<f64>; D] = std::array::from_fn(|axis| {
                polynomials(within(range[axis], X[axis]), in_space[axis])
            });
            (first, along)
        };
        let plan: Vec<(usize, [Vec<f64>; D])> = points.iter().map(of_point).collect();
        let empty = || AtPoint {
            knots: knots.clone(),
            in_time,
            coefficients: vec![vec![0.0; steps]; quantities.len()],
        };
        let mut all: Vec<AtPoint> = points.iter().map(|_| empty()).collect();
        // Sums over the axes from each on.
        let mut sums: [Vec<f64>; D] = std::array::from_fn(|_| Vec::new());
        let columns = &self.coefficients[quantities.start * steps..quantities.end * steps];
        for (number, column) in columns.iter().enumerate() {
            for ((first, along), point) in plan.iter().zip(&mut all) {
                // The slowest axis first: sums run along what is side by side.
                for axis in (0..*first).rev() {
                    let (lower, upper) = sums.split_at_mut(axis + 1);
                    let rest = upper.first().unwrap_or(column);
                    let own = &mut lower[axis];
                    let stride = rest.len() / in_space[axis];
                    own.clear();
                    own.resize(stride, 0.0);
                    for (&factor, row) in along[axis].iter().zip(rest.chunks_exact(stride)) {
                        own.iter_mut().zip(row).for_each(|(sum, c)| *sum += factor * c);
                    }
                }
                point.coefficients[number / steps][number % steps] = sums[0][0];
            }
        }
        all
    }

    /// Where it is tabulated.
    #[must_use]
    pub fn grid(&self) -> &Grid<D> {
        &self.grid
    }

    /// The largest value of a quantity at the nodes.
    #[must_use]
    pub fn largest(&self, quantity: usize) -> f64 {
        self.largest[quantity]
    }

    /// The coefficients of the nodes, axis 0 fastest, for each polynomial in time of each piece, and for each quantity in turn.
    pub fn columns(&self) -> impl Iterator<Item = &[f64]> {
        self.coefficients.iter().map(Vec::as_slice)
    }

    /// The largest coefficient among the last two polynomials of an axis or of a piece in time, as a share of the quantity's largest
    /// value: how much the series leaves out, in space and in time.
    #[must_use]
    pub fn tails(&self) -> [f64; 2] {
        let (in_space, in_time) = self.all_tails();
        [in_space.into_iter().fold(0.0, f64::max), in_time]
    }

    /// As [`tails`](Self::tails), for each coordinate.
    fn all_tails(&self) -> ([f64; D], f64) {
        let Grid { in_space, in_time, .. } = self.grid;
        let steps = self.grid.pieces() * in_time;
        let (mut tails, mut late) = ([0.0_f64; D], 0.0_f64);
        for (number, column) in self.coefficients.iter().enumerate() {
            let largest = self.scales[number / steps].max(f64::MIN_POSITIVE);
            let is_late = number % in_time + 2 >= in_time;
            for (node, c) in column.iter().enumerate() {
                let share = c.abs() / largest;
                let mut rest = node;
                for (tail, count) in tails.iter_mut().zip(in_space) {
                    if rest % count + 2 >= count && count > 1 {
                        *tail = tail.max(share);
                    }
                    rest /= count;
                }
                if is_late {
                    late = late.max(share);
                }
            }
        }
        (tails, late)
    }
}

/// Kinds of quantities.
#[derive(Clone)]
struct Kinds {
    /// The kind of each quantity.
    of: Vec<usize>,
    /// For each quantity whether its kind is nothing but rounding.
    is_rounding: Vec<bool>,
}

impl Kinds {
    /// From samples of series at some positions.
    fn new(kinds: &[usize], samples: &[Series], transform: &Transform) -> Self {
        /// Series whose later half is this share of the largest coefficient do not fall.
        const FLAT: f64 = 0.2;
        /// And beside other quantities they are this small.
        const SMALL: f64 = 1e-11;
        let quantities = samples.first().map_or(0, Vec::len);
        let others = kinds.iter().max().map_or(0, |most| most + 1);
        let own = |quantity: usize| others + quantity;
        let of: Vec<usize> = (0..quantities)
            .map(|quantity| kinds.get(quantity).copied().unwrap_or_else(|| own(quantity)))
            .collect();
        let mut all = Self { is_rounding: vec![false; quantities], of };
        let largest = all.scales(&largest_in(samples));
        let most = largest_of(&largest);
        let mut halves = vec![[0.0_f64; 2]; quantities];
        for sample in samples {
            for (halves, values) in halves.iter_mut().zip(sample) {
                let pieces = values.chunks_exact(transform.n);
                let all = pieces.flat_map(|own| transform.coefficients(own).enumerate());
                for (k, c) in all {
                    let half = &mut halves[usize::from(2 * k >= transform.n)];
                    *half = half.max(c.abs());
                }
            }
        }
        let early = all.scales(&halves.iter().map(|half| half[0]).collect::<Vec<_>>());
        let late = all.scales(&halves.iter().map(|half| half[1]).collect::<Vec<_>>());
        all.is_rounding = (0..quantities)
            .map(|quantity| {
                let is_flat = late[quantity] > FLAT * early[quantity].max(late[quantity]);
                is_flat && largest[quantity] < SMALL * most
            })
            .collect();
        all
    }

    /// The scale of the errors of each quantity, from its largest values.
    fn scales(&self, largest: &[f64]) -> Vec<f64> {
        let of = |quantity: usize| {
            if self.is_rounding[quantity] {
                return f64::INFINITY;
            }
            let same = largest.iter().zip(&self.of).filter(|pair| *pair.1 == self.of[quantity]);
            same.fold(0.0, |most: f64, pair| most.max(*pair.0))
        };
        (0..largest.len()).map(of).collect()
    }
}

/// The largest value of each quantity.
fn largest_in(samples: &[Series]) -> Vec<f64> {
    let mut largest = vec![0.0_f64; samples.first().map_or(0, Vec::len)];
    for sample in samples {
        for (largest, values) in largest.iter_mut().zip(sample) {
            *largest = largest.max(largest_of(values));
        }
    }
    largest
}

fn largest_of(values: &[f64]) -> f64 {
    values.iter().fold(0.0_f64, |most, value| most.max(value.abs()))
}

fn fraction(x: f64) -> f64 {
    x - x.floor()
}

/// Positions that fill a range evenly, by their number (additive recurrence).
#[must_use]
pub fn place<const D: usize>(range: &[[f64; 2]; D], number: u32) -> [f64; D] {
    const STEPS: [f64; 3] =
        [0.819_172_513_396_164_4, 0.671_043_606_703_789_3, 0.549_700_477_901_970_2];
    std::array::from_fn(|axis| {
        let [low, high] = range[axis];
        low + (high - low) * fraction(0.5 + STEPS[axis % 3] * f64::from(number + 1))
    })
}

/// The largest of the coefficients from each number on, over the largest value.
fn rests(values: &[f64], transform: &Transform, largest: f64) -> Vec<f64> {
    let mut rests: Vec<f64> =
        transform.coefficients(values).map(|c| c.abs() / largest.max(f64::MIN_POSITIVE)).collect();
    for k in (1..rests.len()).rev() {
        rests[k - 1] = rests[k - 1].max(rests[k]);
    }
    rests
}

/// The least number of polynomials from which on coefficients are below a share, with two of those, which are the series' tail; all where there are none.
fn enough(rests: &[f64], tolerance: f64) -> usize {
    let first = rests.iter().position(|rest| *rest <= tolerance);
    first.map_or(rests.len(), |first| (first + 2).min(rests.len()))
}

/// A position moved to the ends of the range, as nodes are.
fn outwards<const D: usize>(range: &[[f64; 2]; D], X: [f64; D]) -> [f64; D] {
    std::array::from_fn(|axis| {
        let [low, high] = range[axis];
        let share = (X[axis] - low) / (high - low);
        low + (high - low) * 0.5 * (1.0 - share.cos_pi())
    })
}

/// Knots between which series of polynomials in time leave out less than a share of each quantity's largest value, at some positions, and
/// the number of polynomials; and the kinds of the quantities.
fn in_time<const D: usize, E: Send>(
    range: [[f64; 2]; D],
    end: f64,
    tolerance: f64,
    kinds: &[usize],
    of: &(impl Fn([f64; D], &[f64]) -> Result<Series, E> + Sync),
) -> Result<(Vec<f64>, usize, Kinds), E> {
    const POSITIONS: u32 = 8;
    const MOST: usize = 24;
    const LEAST: usize = 6;
    const MOST_PIECES: usize = 12;
    let mut knots = vec![0.0, end];
    let transform = Transform::new(MOST);
    let mut worst_before = [f64::INFINITY; 2];
    let mut known: Option<Kinds> = None;
    loop {
        let grid = Grid { range, knots: knots.clone(), in_space: [1; D], in_time: MOST };
        let times = grid.times();
        let samples: Vec<Result<Series, E>> = (0..POSITIONS)
            .into_par_iter()
            .map(|number| of(place(&range, number), &times))
            .collect();
        let samples = samples.into_iter().collect::<Result<Vec<Series>, E>>()?;
        // By the whole, in one piece.
        let kinds = known.get_or_insert_with(|| Kinds::new(kinds, &samples, &transform));
        let largest = kinds.scales(&largest_in(&samples));
        let mut of_pieces = vec![vec![0.0_f64; MOST]; grid.pieces()];
        for sample in &samples {
            for (&largest, values) in largest.iter().zip(sample) {
                for (own, values) in of_pieces.iter_mut().zip(values.chunks_exact(MOST)) {
                    for (own, rest) in own.iter_mut().zip(rests(values, &transform, largest)) {
                        *own = own.max(rest);
                    }
                }
            }
        }
        let is_rough = |rests: &Vec<f64>| rests[MOST - 2] > tolerance;
        let worst = of_pieces.iter().fold(0.0_f64, |most, rests| most.max(rests[MOST - 2]));
        // Halves do not help where fields are not smooth.
        let stalls = worst > 0.25 * worst_before[0];
        worst_before = [worst_before[1], worst];
        if !of_pieces.iter().any(is_rough) || knots.len() > MOST_PIECES || stalls {
            let counts = of_pieces.iter().map(|rests| enough(rests, tolerance)).max();
            let kinds = kinds.clone();
            return Ok((knots, counts.unwrap_or(MOST).clamp(LEAST, MOST), kinds));
        }
        let mut finer = vec![knots[0]];
        for (rests, ends) in of_pieces.iter().zip(knots.windows(2)) {
            if is_rough(rests) {
                finer.push(0.5 * (ends[0] + ends[1]));
            }
            finer.push(ends[1]);
        }
        knots = finer;
    }
}

/// The number of polynomials along an axis after which series leave out less than a share of each quantity's largest value, along some lines.
fn along_lines<const D: usize, E: Send>(
    range: [[f64; 2]; D],
    axis: usize,
    tolerance: f64,
    times: &[f64],
    kinds: &Kinds,
    of: &(impl Fn([f64; D], &[f64]) -> Result<Series, E> + Sync),
) -> Result<usize, E> {
    const LINES: usize = 6;
    /// The last one is for lines around a body in the plane, on which a motion has waves; files for hosts have room for no more.
    const MOST: [usize; 4] = [16, 28, 40, 64];
    const LEAST: usize = 4;
    /// Where so many more polynomials leave out more than this share of what fewer do, the field is not smooth.
    const STALLED: f64 = 0.1;
    /// The number of polynomials for a field that is not smooth.
    const ROUGH: usize = 24;
    let mut rough = 1.0;
    let counts = if D < 3 { &MOST[..] } else { &MOST[..3] };
    let mut most = counts[0];
    for &count in counts {
        let before = std::mem::replace(&mut rough, 0.0);
        most = count;
        let (at, transform) = (roots(count), Transform::new(count));
        let [low, high] = range[axis];
        let samples: Vec<Result<Series, E>> = (0..LINES * count)
            .into_par_iter()
            .map(|number| {
                let line = number / count;
                let mut X = place(&range, 31 + line as u32);
                if line % 2 == 1 {
                    X = outwards(&range, outwards(&range, X));
                }
                X[axis] = 0.5 * (low + high) + 0.5 * (high - low) * at[number % count];
                of(X, times)
            })
            .collect();
        let samples = samples.into_iter().collect::<Result<Vec<Series>, E>>()?;
        let quantities = samples.first().map_or(0, Vec::len);
        let mut needed = LEAST;
        let largest = kinds.scales(&largest_in(&samples));
        for quantity in 0..quantities {
            let largest = largest[quantity];
            for line in samples.chunks_exact(count) {
                for time in 0..times.len() {
                    let values: Vec<f64> =
                        line.iter().map(|sample| sample[quantity][time]).collect();
                    let rests = rests(&values, &transform, largest);
                    needed = needed.max(enough(&rests, tolerance));
                    rough = f64::max(rough, rests[count - 2]);
                }
            }
        }
        if rough <= tolerance {
            return Ok(needed);
        }
        if count >= MOST[2] && rough > STALLED * before {
            break;
        }
    }
    Ok(if rough < 1e-9 { most } else { ROUGH })
}

/// From values at the nodes to coefficients, along each axis.
fn transform<const D: usize>(column: &mut [f64], along: &[Transform; D]) {
    let mut stride = 1;
    for transform in along {
        let n = transform.n;
        let mut line = vec![0.0; n];
        for start in (0..column.len()).filter(|k| k / stride % n == 0) {
            for (k, value) in line.iter_mut().enumerate() {
                *value = column[start + k * stride];
            }
            for (k, c) in transform.coefficients(&line).enumerate() {
                column[start + k * stride] = c;
            }
        }
        stride *= n;
    }
}

/// Where a time is among the pieces of series.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtTime {
    /// The piece.
    pub piece: usize,
    /// The place in the piece, from -1 to 1.
    pub x: f64,
}

impl<const D: usize> Grid<D> {
    /// Where a time is.
    #[must_use]
    pub fn at_time(&self, time: f64) -> AtTime {
        let piece = piece_of(&self.knots, time);
        AtTime { piece, x: within([self.knots[piece], self.knots[piece + 1]], time) }
    }
}

/// The piece that has a time; those before and after all are in the first and in the last.
fn piece_of(knots: &[f64], time: f64) -> usize {
    let last = knots.len().saturating_sub(2);
    knots.partition_point(|knot| *knot <= time).saturating_sub(1).min(last)
}

impl AtPoint {
    /// Series with these pieces, of coefficients piece by piece for each quantity.
    #[must_use]
    pub fn new(knots: Vec<f64>, in_time: usize, coefficients: Vec<Vec<f64>>) -> Self {
        Self { knots, in_time, coefficients }
    }

    /// Where pieces begin and end.
    #[must_use]
    pub fn knots(&self) -> &[f64] {
        &self.knots
    }

    /// Polynomials in each piece.
    #[must_use]
    pub fn in_time(&self) -> usize {
        self.in_time
    }

    /// The coefficients of a quantity, piece by piece.
    #[must_use]
    pub fn coefficients(&self, quantity: usize) -> &[f64] {
        &self.coefficients[quantity]
    }

    /// The fields at one position by their own series, for fields that no table has well: where particles begin to flow, each at its own
    /// time, fields are smooth in time but for the changes, which `breaks` tells. `of` gives the values at ascending times, none of them a
    /// break. Errors are as in [`Table::fine_by_kinds`]; gives the largest tail as well.
    ///
    /// # Errors
    ///
    /// The first error of `of`.
    pub fn fine<E>(
        end: f64,
        breaks: &[f64],
        tolerance: f64,
        kinds: &[usize],
        of: impl Fn(&[f64]) -> Result<Series, E>,
    ) -> Result<(Self, f64), E> {
        const MOST: usize = 20;
        const MOST_PIECES: usize = 64;
        let transform = Transform::new(MOST);
        let inside = breaks.iter().copied().filter(|time| *time > 0.0 && *time < end);
        let mut knots: Vec<f64> = [0.0].into_iter().chain(inside).chain([end]).collect();
        let mut known: Option<Kinds> = None;
        loop {
            let grid = Grid::<0> { range: [], knots: knots.clone(), in_space: [], in_time: MOST };
            let samples = [of(&grid.times())?];
            let kinds = known.get_or_insert_with(|| Kinds::new(kinds, &samples, &transform));
            let largest = kinds.scales(&largest_in(&samples));
            let mut tails = vec![0.0_f64; grid.pieces()];
            let mut coefficients = Vec::with_capacity(largest.len());
            for (values, &largest) in samples[0].iter().zip(&largest) {
                for (tail, values) in tails.iter_mut().zip(values.chunks_exact(MOST)) {
                    *tail = tail.max(rests(values, &transform, largest)[MOST - 2]);
                }
                let pieces = values.chunks_exact(MOST);
                coefficients.push(pieces.flat_map(|own| transform.coefficients(own)).collect());
            }
            let tail = largest_of(&tails);
            if tail <= tolerance || knots.len() > MOST_PIECES {
                return Ok((Self { knots, in_time: MOST, coefficients }, tail));
            }
            let mut finer = vec![knots[0]];
            for (tail, ends) in tails.iter().zip(knots.windows(2)) {
                if *tail > tolerance {
                    finer.push(0.5 * (ends[0] + ends[1]));
                }
                finer.push(ends[1]);
            }
            knots = finer;
        }
    }

    /// A quantity at a time.
    #[must_use]
    pub fn value(&self, quantity: usize, time: f64) -> f64 {
        let piece = piece_of(&self.knots, time);
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
                in_space: [in_space; 2],
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

    /// The error told holds at random places and times, in one to three coordinates, and grids are no finer than it takes.
    fn told_error_holds<const D: usize>(
        field: impl Fn([f64; D], f64) -> f64 + Sync,
        most: f64,
        counts: [usize; 2],
    ) {
        let range = [[0.5, 2.0]; D];
        let of = |X: [f64; D], times: &[f64]| {
            Ok::<_, ()>(vec![times.iter().map(|&t| field(X, t)).collect::<Vec<f64>>()])
        };
        let (table, told) = Table::fine(range, 3.0, 1e-12, of).unwrap();
        assert!(told <= most, "{told:e}");
        let Grid { in_space, in_time, ref knots, .. } = table.grid;
        let [in_all, in_each] = counts;
        assert!(in_time * (knots.len() - 1) <= in_all, "{in_time} {knots:?}");
        assert!(in_space.iter().all(|count| *count <= in_each), "{in_space:?}");
        for k in 0..200_u32 {
            let X = std::array::from_fn(|axis| {
                0.5 + 1.5 * fraction((0.37 + 0.21 * axis as f64) * f64::from(k))
            });
            let t = 3.0 * fraction(0.618 * f64::from(k));
            let off = (table.at(&X).value(0, t) - field(X, t)).abs() / table.largest(0);
            assert!(off <= told, "{X:?} {t}: {off:e}, told {told:e}");
        }
        // Points of a lattice share sums, and have the same bits.
        let lattice = |k: usize| -> [f64; D] {
            std::array::from_fn(|axis| 0.6 + 0.3 * (k / 4_usize.pow(axis as u32) % 4) as f64)
        };
        let points: Vec<[f64; D]> = (0..4_usize.pow(D as u32)).map(lattice).collect();
        for (point, X) in table.at_all(&points).into_iter().zip(&points) {
            assert_eq!(point, table.at(X));
        }
    }

    #[test]
    fn told_errors_hold() {
        told_error_holds(|[x], t| (x * t).sin() + x, 1e-11, [48, 24]);
        told_error_holds(|[x, y], t| (x * y + t).sin() + y * y, 1e-11, [48, 24]);
        told_error_holds(|[x, y, z], t| (x * y + t).sin() + y * z, 1e-11, [48, 24]);
        // One axis asks for more than the others.
        told_error_holds(|[x, y], t| (8.0 * x).sin() * t + y, 1e-11, [24, 32]);
        // A kink: the error is told.
        told_error_holds(|[x, y], t| (x - 0.3 * t - 0.6).abs() + y, 0.1, [800, 24]);
    }

    /// Components that are small beside others of their tensor, or nothing but rounding, ask for no more polynomials.
    #[test]
    fn rounding_is_not_tabulated_finely() {
        let noise = |x: f64| (1e9 * x).sin();
        let of = |[x, y]: [f64; 2], times: &[f64]| {
            let of = |field: &dyn Fn(f64) -> f64| times.iter().map(|&t| field(t)).collect();
            Ok::<_, ()>(vec![
                of(&|t| 1e3 * (x * y + t).sin()),
                of(&|t| 1e-9 * (x + t).cos() + 1e-13 * noise(x + y + t)),
                of(&|t| 1e-13 * noise(x * y + t)),
                of(&|_| 0.0),
                of(&|t| 1e-3 * (x + y * t)),
            ])
        };
        let (table, told) = Table::fine_by_kinds([[0.0, 1.0]; 2], 1.0, 1e-12, &[0, 0], of).unwrap();
        assert!(told < 3e-12, "{told:e}");
        let Grid { in_space, in_time, ref knots, .. } = table.grid;
        assert!(in_space.iter().all(|count| *count < 18), "{in_space:?}");
        assert!(in_time * (knots.len() - 1) <= 24, "{in_time} {knots:?}");
        // Of a kind of its own the second has no more digits.
        let (_, told) = Table::fine([[0.0, 1.0]; 2], 1.0, 1e-12, of).unwrap();
        assert!(told > 1e-6, "{told:e}");
    }
}
