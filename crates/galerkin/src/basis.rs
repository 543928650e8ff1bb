//! B-splines along one axis, and the operators that evaluate them at the particles and integrate against them.
//!
//! Piegl & Tiller, "The NURBS Book", 2nd ed. (1997), chapter 2: recurrence and derivative.

use std::ops::Range;

use mmsmith_laws::fault::{Fault, Planted};
use mmsmith_threads::each_chunk;

use super::axis::{Axis, End};
use super::piece;

/// The largest degree.
pub(crate) const MOST_DEGREE: usize = 5;

/// The functions of one component along one axis, at the particles along it.
///
/// Spline j (0 to cells + degree - 1) lies around cells `j - degree` to `j`. At a wall those beyond it are folded on their
/// mirror images; at a clamped end the knots are repeated. Along a periodic axis the last `degree` splines are copies of
/// the first ones: coefficients have to agree, and what is integrated against both belongs together (see
/// [`Mass::solve`](super::mass::Mass::solve)).
#[derive(Clone, Debug)]
pub(crate) struct Basis {
    /// Number of coefficients.
    pub(crate) functions: usize,
    /// Number of particles along the axis.
    pub(crate) points: usize,
    /// Functions that may differ from zero at a particle.
    pub(crate) width: usize,
    /// The first of them, for each particle.
    first: Vec<usize>,
    /// `width` values for each particle.
    value: Vec<f64>,
    /// `width` derivatives for each particle.
    slope: Vec<f64>,
    /// Particles that are integrated together, and for each function the range of those in which it is.
    together: Vec<Together>,
    together_of: Vec<Range<usize>>,
}

/// One particle, or two successive ones with the same functions: for half of the loads and stores.
#[derive(Clone, Copy, Debug)]
struct Together {
    start: usize,
    are_two: bool,
}

/// The part of the functions that an operator takes: value or derivative.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ValueOrSlope {
    Value,
    Slope,
}

impl Basis {
    /// The basis of splines at `points`, which are the same number in each cell, cell after cell. `normal` says whether
    /// the component is the one that vanishes on the walls of this axis. `None` where no function is left.
    pub(crate) fn new(axis: &Axis, degree: usize, normal: bool, points: &[f64]) -> Option<Self> {
        if axis.is_uniform() {
            return Some(Self::uniform(points.len()));
        }
        let p = degree;
        let n = axis.cells;
        let knots = knots(axis, p);
        let wall = axis.ends.map(|end| end == End::Wall);
        // Twice the centre of a spline, in cells from the lower end, is 2 j + 1 - p.
        let centre = |j: usize| 2 * j as i64 + 1 - p as i64;
        let ends = [0, 2 * n as i64];
        let kept = |j: usize| {
            let inside = |end: usize, distance: i64| {
                !wall[end] || distance > 0 || (distance == 0 && !normal)
            };
            inside(0, centre(j) - ends[0]) && inside(1, ends[1] - centre(j))
        };
        let lowest = (0..n + p).find(|&j| kept(j))?;
        let functions = (lowest..n + p).take_while(|&j| kept(j)).count();
        let width = functions.min(p + 1);
        // The coefficient that spline j belongs to, and its sign.
        let image = |mut j: usize| {
            let mut sign = 1.0;
            loop {
                let (below, above) = (centre(j) < ends[0], centre(j) > ends[1]);
                j = if wall[0] && below {
                    p - 1 - j
                } else if wall[1] && above {
                    2 * n + p - 1 - j
                } else {
                    break;
                };
                let odd = normal && !Planted::here().is(Fault::MirrorSign);
                sign = if odd { -sign } else { sign };
            }
            kept(j).then(|| (j - lowest, sign))
        };
        let mut basis = Self {
            functions,
            points: points.len(),
            width,
            first: Vec::with_capacity(points.len()),
            value: vec![0.0; points.len() * width],
            slope: vec![0.0; points.len() * width],
            together: Vec::new(),
            together_of: Vec::new(),
        };
        let per_cell = points.len() / n;
        for (q, &x) in points.iter().enumerate() {
            let cell = q / per_cell;
            let (value, slope) = splines(&knots, p, cell + p, x);
            let images: [Option<(usize, f64)>; MOST_DEGREE + 1] =
                std::array::from_fn(|k| if k <= p { image(cell + k) } else { None });
            let lowest = images.iter().flatten().map(|(j, _)| *j).min().unwrap_or(0);
            let first = lowest.min(functions - width);
            for k in 0..=p {
                if let Some((j, sign)) = images[k] {
                    basis.value[q * width + j - first] += sign * value[k];
                    basis.slope[q * width + j - first] += sign * slope[k];
                }
            }
            basis.first.push(first);
        }
        basis.put_together();
        Some(basis)
    }

    /// The one function that is one everywhere.
    fn uniform(points: usize) -> Self {
        let mut basis = Self {
            functions: 1,
            points,
            width: 1,
            first: vec![0; points],
            value: vec![1.0; points],
            slope: vec![0.0; points],
            together: Vec::new(),
            together_of: Vec::new(),
        };
        basis.put_together();
        basis
    }

    fn put_together(&mut self) {
        let mut start = 0;
        while start < self.points {
            let are_two = self.first.get(start + 1) == Some(&self.first[start]);
            self.together.push(Together { start, are_two });
            start += if are_two { 2 } else { 1 };
        }
        let mut ranges = vec![self.together.len()..0; self.functions];
        for (place, Together { start, .. }) in self.together.iter().enumerate() {
            for range in &mut ranges[self.first[*start]..][..self.width] {
                *range = range.start.min(place)..place + 1;
            }
        }
        self.together_of = ranges;
    }

    /// The row of particle `q`: its first function, and the values from there on.
    pub(crate) fn row(&self, q: usize, part: ValueOrSlope) -> (usize, &[f64]) {
        let range = q * self.width..(q + 1) * self.width;
        (self.first[q], &self.weights(part)[range])
    }

    fn weights(&self, part: ValueOrSlope) -> &[f64] {
        match part {
            ValueOrSlope::Value => &self.value,
            ValueOrSlope::Slope => &self.slope,
        }
    }

    /// Evaluates along one axis of an array: `output[o][q][i] = sum_j S_qj input[o][j][i]`, `i < inner`.
    pub(crate) fn evaluate(
        &self,
        part: ValueOrSlope,
        inner: usize,
        input: &[f64],
        output: &mut [f64],
    ) {
        match self.width {
            1 => self.evaluate_of::<1>(part, inner, input, output),
            2 => self.evaluate_of::<2>(part, inner, input, output),
            3 => self.evaluate_of::<3>(part, inner, input, output),
            4 => self.evaluate_of::<4>(part, inner, input, output),
            5 => self.evaluate_of::<5>(part, inner, input, output),
            _ => self.evaluate_of::<6>(part, inner, input, output),
        }
    }

    /// The transposed operator: `output[o][j][i] += sum_q S_qj input[o][q][i]`.
    pub(crate) fn integrate(
        &self,
        part: ValueOrSlope,
        inner: usize,
        input: &[f64],
        output: &mut [f64],
    ) {
        match self.width {
            1 => self.integrate_of::<1>(part, inner, input, output),
            2 => self.integrate_of::<2>(part, inner, input, output),
            3 => self.integrate_of::<3>(part, inner, input, output),
            4 => self.integrate_of::<4>(part, inner, input, output),
            5 => self.integrate_of::<5>(part, inner, input, output),
            _ => self.integrate_of::<6>(part, inner, input, output),
        }
    }

    fn evaluate_of<const W: usize>(
        &self,
        part: ValueOrSlope,
        inner: usize,
        input: &[f64],
        output: &mut [f64],
    ) {
        let (rows, _) = self.weights(part).as_chunks::<W>();
        if inner == 1 {
            let blocks = piece(output.len()).div_ceil(self.points);
            each_chunk(output, blocks * self.points, &|piece, output| {
                let input = input[piece * blocks * self.functions..].chunks_exact(self.functions);
                for (input, output) in input.zip(output.chunks_exact_mut(self.points)) {
                    for ((&first, row), output) in self.first.iter().zip(rows).zip(output) {
                        let window = &input[first..first + W];
                        let mut sum = row[0] * window[0];
                        for k in 1..W {
                            sum += row[k] * window[k];
                        }
                        *output = sum;
                    }
                }
            });
            return;
        }
        let lines = piece(output.len()).div_ceil(inner);
        each_chunk(output, lines * inner, &|piece, output| {
            for (line, output) in output.chunks_exact_mut(inner).enumerate() {
                let (block, q) = divided(piece * lines + line, self.points);
                let first = block * self.functions + self.first[q];
                let row = &rows[q];
                let lines: [&[f64]; W] =
                    std::array::from_fn(|k| &input[(first + k) * inner..][..inner]);
                for i in 0..inner {
                    let mut sum = row[0] * lines[0][i];
                    for k in 1..W {
                        sum += row[k] * lines[k][i];
                    }
                    output[i] = sum;
                }
            }
        });
    }

    fn integrate_of<const W: usize>(
        &self,
        part: ValueOrSlope,
        inner: usize,
        input: &[f64],
        output: &mut [f64],
    ) {
        let (rows, _) = self.weights(part).as_chunks::<W>();
        if inner == 1 {
            let blocks = piece(output.len()).div_ceil(self.functions);
            each_chunk(output, blocks * self.functions, &|piece, output| {
                let input = input[piece * blocks * self.points..].chunks_exact(self.points);
                for (input, output) in input.zip(output.chunks_exact_mut(self.functions)) {
                    self.integrate_line(rows, input, output);
                }
            });
            return;
        }
        // Function by function, so that no two threads write to one; the order of its sum is that of the particles.
        let lines = piece(output.len()).div_ceil(inner);
        each_chunk(output, lines * inner, &|piece, output| {
            for (line, output) in output.chunks_exact_mut(inner).enumerate() {
                let (block, j) = divided(piece * lines + line, self.functions);
                let line = |q: usize| &input[(block * self.points + q) * inner..][..inner];
                for &Together { start: q, are_two } in &self.together[self.together_of[j].clone()] {
                    let Some(k) = j.checked_sub(self.first[q]).filter(|k| *k < W) else { continue };
                    if are_two {
                        let (a, b) = (line(q), line(q + 1));
                        let (of_a, of_b) = (rows[q][k], rows[q + 1][k]);
                        for i in 0..inner {
                            output[i] += of_a * a[i] + of_b * b[i];
                        }
                    } else {
                        let (a, of_a) = (line(q), rows[q][k]);
                        for i in 0..inner {
                            output[i] += of_a * a[i];
                        }
                    }
                }
            }
        });
    }

    fn integrate_line<const W: usize>(&self, rows: &[[f64; W]], input: &[f64], output: &mut [f64]) {
        // The particles of a cell share their window, which is written once.
        let mut window = (0, [0.0; W]);
        let mut flush = |(first, sums): (usize, [f64; W])| {
            let window = &mut output[first..first + W];
            for k in 0..W {
                window[k] += sums[k];
            }
        };
        for ((&first, row), &input) in self.first.iter().zip(rows).zip(input) {
            if first != window.0 {
                flush(window);
                window = (first, [0.0; W]);
            }
            for k in 0..W {
                window.1[k] += row[k] * input;
            }
        }
        flush(window);
    }
}

/// Quotient and remainder.
fn divided(number: usize, divisor: usize) -> (usize, usize) {
    (number / divisor, number % divisor)
}

/// The knots: repeated at ends that are clamped, equally spaced beyond the others.
fn knots(axis: &Axis, p: usize) -> Vec<f64> {
    let h = axis.spacing();
    let n = axis.cells as i64;
    let p = p as i64;
    let knot = |index: i64| {
        let index = if axis.ends[0].is_clamped() { index.max(0) } else { index };
        let index = if axis.ends[1].is_clamped() { index.min(n) } else { index };
        axis.lower + index as f64 * h
    };
    (-p..=n + p).map(knot).collect()
}

/// The `p + 1` splines that do not vanish between knots `span` and `span + 1`, and their derivatives, at `x`.
fn splines(
    knots: &[f64],
    p: usize,
    span: usize,
    x: f64,
) -> ([f64; MOST_DEGREE + 1], [f64; MOST_DEGREE + 1]) {
    let mut value = [0.0; MOST_DEGREE + 1];
    let mut slope = [0.0; MOST_DEGREE + 1];
    value[0] = 1.0;
    for degree in 1..=p {
        let lower = value;
        value = [0.0; MOST_DEGREE + 1];
        slope = [0.0; MOST_DEGREE + 1];
        for r in 0..degree {
            let (left, right) = (knots[span + 1 + r - degree], knots[span + 1 + r]);
            let width = right - left;
            let weighted = lower[r] / width;
            value[r] += (right - x) * weighted;
            value[r + 1] += (x - left) * weighted;
            slope[r] -= degree as f64 * weighted;
            slope[r + 1] += degree as f64 * weighted;
        }
    }
    (value, slope)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Layout;

    const ENDS: [[End; 2]; 6] = [
        [End::FREE, End::FREE],
        [End::Wall, End::Wall],
        [End::FREE, End::Wall],
        [End::Wall, End::FREE],
        [End::MOVED, End::LOADED],
        [End::Periodic, End::Periodic],
    ];

    fn axis(ends: [End; 2]) -> Axis {
        Axis { lower: 0.3, upper: 1.7, cells: 7, ends }
    }

    #[test]
    fn what_integrates_is_the_transpose_of_what_evaluates_at_every_width() {
        let mut met = [false; MOST_DEGREE + 2];
        for degree in 2..=MOST_DEGREE {
            for cells in 1..=6 {
                let axis = Axis { cells, ..axis([End::Wall; 2]) };
                let (points, _) = axis.points(2, Layout::Gauss);
                let basis = Basis::new(&axis, degree, false, &points).unwrap();
                met[basis.width] = true;
                for part in [ValueOrSlope::Value, ValueOrSlope::Slope] {
                    for inner in [1, 2] {
                        let unit = |size: usize, at: usize| {
                            let mut unit = vec![0.0; size * inner];
                            unit[at * inner] = 1.0;
                            unit
                        };
                        for j in 0..basis.functions {
                            for q in 0..basis.points {
                                let mut values = vec![0.0; basis.points * inner];
                                basis.evaluate(part, inner, &unit(basis.functions, j), &mut values);
                                let mut sums = vec![0.0; basis.functions * inner];
                                basis.integrate(part, inner, &unit(basis.points, q), &mut sums);
                                assert_eq!(values[q * inner], sums[j * inner], "{degree} {cells}");
                                let (first, row) = basis.row(q, part);
                                let entry = j.checked_sub(first).and_then(|k| row.get(k));
                                assert_eq!(sums[j * inner], entry.copied().unwrap_or(0.0));
                            }
                        }
                    }
                }
            }
        }
        assert_eq!(met, [false, true, true, true, true, true, true]);
    }

    fn sum(basis: &Basis, part: ValueOrSlope, coefficients: &[f64]) -> Vec<f64> {
        let mut values = vec![0.0; basis.points];
        basis.evaluate(part, 1, coefficients, &mut values);
        values
    }

    #[test]
    fn the_functions_add_up_to_one() {
        for ends in ENDS {
            for p in 2..=MOST_DEGREE {
                let axis = axis(ends);
                let (points, _) = axis.points(3, Layout::Gauss);
                let basis = Basis::new(&axis, p, false, &points).unwrap();
                let ones = vec![1.0; basis.functions];
                for (value, slope) in sum(&basis, ValueOrSlope::Value, &ones).iter().zip(sum(
                    &basis,
                    ValueOrSlope::Slope,
                    &ones,
                )) {
                    assert!((value - 1.0).abs() < 1e-14 && slope.abs() < 1e-12, "{ends:?} {p}");
                }
            }
        }
    }

    #[test]
    fn between_free_ends_linear_fields_are_reproduced() {
        for p in 2..=MOST_DEGREE {
            let axis = axis([End::FREE; 2]);
            let (points, _) = axis.points(2, Layout::Lattice);
            let basis = Basis::new(&axis, p, false, &points).unwrap();
            let knots = knots(&axis, p);
            // Greville's abscissae.
            let mean = |j: usize| knots[j + 1..=j + p].iter().sum::<f64>() / p as f64;
            let linear: Vec<f64> = (0..basis.functions).map(mean).collect();
            for ((x, value), slope) in points
                .iter()
                .zip(sum(&basis, ValueOrSlope::Value, &linear))
                .zip(sum(&basis, ValueOrSlope::Slope, &linear))
            {
                assert!((value - x).abs() < 1e-14 && (slope - 1.0).abs() < 1e-13, "{p}");
            }
        }
    }

    #[test]
    fn a_component_across_a_wall_vanishes_on_it_and_another_has_no_slope_there() {
        for cells in 2..8 {
            for p in 2..=MOST_DEGREE {
                let axis = Axis { cells, ..axis([End::Wall; 2]) };
                let mut points: Vec<f64> =
                    (0..cells).map(|c| axis.lower + (c as f64 + 0.3) * axis.spacing()).collect();
                (points[0], points[cells - 1]) = (axis.lower, axis.upper);
                for normal in [false, true] {
                    let basis = Basis::new(&axis, p, normal, &points).unwrap();
                    let some: Vec<f64> =
                        (0..basis.functions).map(|j| 1.0 + (j as f64 * 1.3).sin()).collect();
                    let part = if normal { ValueOrSlope::Value } else { ValueOrSlope::Slope };
                    let values = sum(&basis, part, &some);
                    assert!(values[0].abs() < 1e-12, "{cells} {p} {normal} {values:?}");
                    assert!(values[cells - 1].abs() < 1e-12, "{cells} {p} {normal} {values:?}");
                }
            }
        }
    }

    #[test]
    fn slopes_are_the_derivatives_of_the_values() {
        for ends in ENDS {
            for p in 2..=MOST_DEGREE {
                for normal in [false, true] {
                    let axis = axis(ends);
                    let step = 1e-5;
                    let (points, _) = axis.points(2, Layout::Lattice);
                    let moved = |by: f64| -> Vec<f64> { points.iter().map(|x| x + by).collect() };
                    let basis = |points: &[f64]| Basis::new(&axis, p, normal, points).unwrap();
                    let here = basis(&points);
                    let some: Vec<f64> =
                        (0..here.functions).map(|j| (j as f64 * 0.7).cos()).collect();
                    let (above, below) = (basis(&moved(step)), basis(&moved(-step)));
                    let above = sum(&above, ValueOrSlope::Value, &some);
                    let below = sum(&below, ValueOrSlope::Value, &some);
                    for (q, slope) in sum(&here, ValueOrSlope::Slope, &some).iter().enumerate() {
                        let difference = (above[q] - below[q]) / (2.0 * step);
                        assert!((slope - difference).abs() < 1e-6, "{ends:?} {p} {normal}");
                    }
                }
            }
        }
    }

    #[test]
    fn integration_is_the_transpose_of_evaluation_along_any_axis() {
        for p in 2..=MOST_DEGREE {
            let axis = axis([End::FREE, End::Wall]);
            let (points, _) = axis.points(2, Layout::Lattice);
            let basis = Basis::new(&axis, p, true, &points).unwrap();
            for (outer, inner) in [(1, 1), (3, 1), (1, 5), (2, 3)] {
                let wave = |count: usize, k: f64| -> Vec<f64> {
                    (0..count).map(|i| (i as f64 * k).sin()).collect()
                };
                let a = wave(outer * basis.functions * inner, 0.9);
                let b = wave(outer * basis.points * inner, 1.7);
                for part in [ValueOrSlope::Value, ValueOrSlope::Slope] {
                    let mut forth = vec![0.0; b.len()];
                    basis.evaluate(part, inner, &a, &mut forth);
                    let mut back = vec![0.0; a.len()];
                    basis.integrate(part, inner, &b, &mut back);
                    let dot =
                        |x: &[f64], y: &[f64]| -> f64 { x.iter().zip(y).map(|(x, y)| x * y).sum() };
                    let (left, right) = (dot(&forth, &b), dot(&a, &back));
                    assert!((left - right).abs() < 1e-11 * left.abs().max(1.0), "{left} {right}");
                }
            }
        }
    }
}
