//! Fields that follow from the history of each particle, from the tables that `mms gen` writes beside a source.

use crate::{BodyForceAtPoints, Real};
use mmsmith_scalar_functions::ScalarFunctions;
use nalgebra::{SMatrix, SVector};
use std::fs;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a table cannot be used.
#[derive(Debug, Error)]
pub enum TableError {
    /// The file cannot be read.
    #[error("the table {path} cannot be read; it lies beside the source, give its path: {error}")]
    Missing {
        /// The file.
        path: PathBuf,
        /// The reason.
        error: std::io::Error,
    },
    /// It belongs to another source.
    #[error("{0} is the table of another source; write both anew by one call of mms gen")]
    Another(PathBuf),
    /// It is not one, or not whole.
    #[error("{0} is no whole table of mms gen; write it anew")]
    Broken(PathBuf),
}

/// The shape of a field.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    Scalar,
    Vector,
    Matrix,
    Symmetric,
}

/// The unit vectors in which fields have their components in the table.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Frame {
    Cartesian,
    Polar,
    Spherical,
}

/// A coordinate of the body.
#[derive(Clone, Debug, PartialEq)]
struct Axis {
    number: usize,
    range: [f64; 2],
    count: usize,
}

/// The fields at one position as series in time, in Cartesian components.
#[derive(Clone, Debug, PartialEq)]
pub struct PointSeries<const D: usize> {
    knots: Vec<f64>,
    in_time: usize,
    /// For each quantity and each piece the coefficients of its polynomials.
    coefficients: Vec<f64>,
}

/// The coordinates of a body that its axes count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Chart {
    /// Cartesian ones.
    Box,
    /// Polar or spherical ones.
    Annulus,
    /// Cylindrical ones.
    Tube,
}

/// Body force, stress and internal variables of a body as Chebyshev series in its coordinates, and in pieces of the time; or series of some
/// points.
#[derive(Clone, Debug, PartialEq)]
pub struct HistoryTable<const D: usize> {
    shapes: Vec<Shape>,
    chart: Chart,
    frame: Frame,
    axes: Vec<Axis>,
    /// Over the body; the coefficients of a node are side by side with those of others.
    body: PointSeries<D>,
    points: Vec<([f64; D], PointSeries<D>)>,
}

/// The words of a table.
struct Words<'a>(std::str::SplitWhitespace<'a>);

impl Words<'_> {
    fn word(&mut self) -> Option<&str> {
        self.0.next()
    }

    fn after(&mut self, name: &str) -> Option<()> {
        (self.0.next()? == name).then_some(())
    }

    fn count(&mut self) -> Option<usize> {
        self.0.next()?.parse().ok()
    }

    fn number(&mut self) -> Option<f64> {
        self.0.next()?.parse().ok()
    }

    fn numbers(&mut self, count: usize) -> Option<Vec<f64>> {
        (0..count).map(|_| self.number()).collect()
    }
}

fn polynomials(x: f64, count: usize) -> Vec<f64> {
    let mut pair = [1.0, x];
    let mut next = || {
        let [now, after] = pair;
        pair = [after, 2.0 * x * after - now];
        now
    };
    (0..count).map(|_| next()).collect()
}

impl Shape {
    fn size(self, dimension: usize) -> usize {
        match self {
            Shape::Scalar => 1,
            Shape::Vector => dimension,
            Shape::Matrix => dimension * dimension,
            Shape::Symmetric => 6,
        }
    }
}

impl<const D: usize> PointSeries<D> {
    /// Quantity `number` at a time; not a number before the start and after the end.
    fn value(&self, number: usize, t: f64) -> f64 {
        let pieces = self.knots.len().saturating_sub(1);
        let end = self.knots.last().copied().unwrap_or(f64::NAN);
        if !(t >= -1e-12 * end && t <= end * (1.0 + 1e-12)) {
            return f64::NAN;
        }
        let after = self.knots.partition_point(|knot| *knot <= t);
        let piece = after.saturating_sub(1).min(pieces.saturating_sub(1));
        let [low, high] = [self.knots[piece], self.knots[piece + 1]];
        let x = (2.0 * t - low - high) / (high - low);
        let own = &self.coefficients[(number * pieces + piece) * self.in_time..][..self.in_time];
        let (mut now, mut next, mut sum) = (1.0, x, 0.0);
        for c in own {
            sum += c * now;
            (now, next) = (next, 2.0 * x * next - now);
        }
        sum
    }

    fn quantities(&self) -> usize {
        let steps = self.knots.len().saturating_sub(1) * self.in_time;
        self.coefficients.len() / steps.max(1)
    }

    /// The body force, force per mass.
    #[must_use]
    pub fn body_force<T: Real>(&self, t: T) -> SVector<T, D> {
        SVector::from_fn(|i, _| T::nearest(self.value(i, t.to_f64())))
    }

    /// The first Piola-Kirchhoff stress.
    #[must_use]
    pub fn stress<T: Real>(&self, t: T) -> SMatrix<T, D, D> {
        SMatrix::from_fn(|i, j| T::nearest(self.value(D + i * D + j, t.to_f64())))
    }

    /// All internal variables.
    #[must_use]
    pub fn internal<T: Real>(&self, t: T) -> Vec<T> {
        let all = D + D * D..self.quantities();
        all.map(|number| T::nearest(self.value(number, t.to_f64()))).collect()
    }
}

impl<const D: usize> HistoryTable<D> {
    /// Reads the table that has this digest.
    ///
    /// # Errors
    ///
    /// [`TableError`] where the file cannot be read, or is another table.
    pub fn read(path: &Path, digest: &str) -> Result<Self, TableError> {
        let own = || path.to_owned();
        let text =
            fs::read_to_string(path).map_err(|error| TableError::Missing { path: own(), error })?;
        let mut words = Words(text.split_whitespace());
        let broken = || TableError::Broken(own());
        words.after("mmsmith-table").and_then(|()| words.after("1")).ok_or_else(broken)?;
        words.after("digest").ok_or_else(broken)?;
        if words.word() != Some(digest) {
            return Err(TableError::Another(own()));
        }
        Self::content(&mut words).ok_or_else(broken)
    }

    fn content(words: &mut Words<'_>) -> Option<Self> {
        words.after("solution")?;
        words.word()?;
        words.after("parameters")?;
        for _ in 0..2 * words.count()? {
            words.word()?;
        }
        words.after("end")?;
        words.number()?;
        words.after("error")?;
        words.number()?;
        words.after("dimension")?;
        (words.count()? == D).then_some(())?;
        words.after("fields")?;
        let mut shapes = Vec::new();
        for _ in 0..words.count()? {
            words.word()?;
            shapes.push(match words.word()? {
                "scalar" => Shape::Scalar,
                "vector" => Shape::Vector,
                "matrix" => Shape::Matrix,
                "symmetric" => Shape::Symmetric,
                _ => return None,
            });
        }
        words.after("chart")?;
        let word = words.word()?.to_owned();
        words.after("frame")?;
        let frame = match words.word()? {
            "cartesian" => Frame::Cartesian,
            "polar" => Frame::Polar,
            "spherical" => Frame::Spherical,
            _ => return None,
        };
        let none = PointSeries { knots: Vec::new(), in_time: 0, coefficients: Vec::new() };
        let chart = match word.as_str() {
            "annulus" => Chart::Annulus,
            "tube" if D == 3 => Chart::Tube,
            "box" | "points" => Chart::Box,
            _ => return None,
        };
        let mut table =
            Self { shapes, chart, frame, axes: Vec::new(), body: none, points: Vec::new() };
        match word.as_str() {
            "points" => table.read_points(words)?,
            _ => table.read_body(words)?,
        }
        Some(table)
    }

    fn quantities(&self) -> usize {
        self.shapes.iter().map(|shape| shape.size(D)).sum()
    }

    fn read_points(&mut self, words: &mut Words<'_>) -> Option<()> {
        words.after("points")?;
        for _ in 0..words.count()? {
            let place = <[f64; D]>::try_from(words.numbers(D)?).ok()?;
            let (pieces, in_time) = (words.count()?, words.count()?);
            let knots = words.numbers(pieces + 1)?;
            let coefficients = words.numbers(self.quantities() * pieces * in_time)?;
            self.points.push((place, PointSeries { knots, in_time, coefficients }));
        }
        Some(())
    }

    fn read_body(&mut self, words: &mut Words<'_>) -> Option<()> {
        words.after("axes")?;
        for _ in 0..words.count()? {
            let number = words.count()?;
            let range = [words.number()?, words.number()?];
            (number < D).then_some(())?;
            self.axes.push(Axis { number, range, count: words.count()? });
        }
        words.after("pieces")?;
        let (pieces, in_time) = (words.count()?, words.count()?);
        let knots = words.numbers(pieces + 1)?;
        words.after("coefficients")?;
        let count = words.count()?;
        let nodes: usize = self.axes.iter().map(|axis| axis.count).product();
        (count == self.quantities() * pieces * in_time * nodes).then_some(())?;
        self.body = PointSeries { knots, in_time, coefficients: words.numbers(count)? };
        Some(())
    }

    /// The products of the polynomials of all axes at a position, for each node; not numbers far from the body.
    fn along(&self, X: &[f64; D]) -> Vec<f64> {
        let mut q = *X;
        if self.chart == Chart::Tube {
            [q[0], q[1 % D]] = [libm::hypot(X[0], X[1 % D]), X[1 % D].polar_angle(X[0])];
        }
        if self.chart == Chart::Annulus && D > 1 {
            let angle = X[1].polar_angle(X[0]).rem_euclid(std::f64::consts::TAU);
            let from_axis = libm::hypot(X[0], X[1]);
            q[0] = if D == 2 { from_axis } else { libm::hypot(from_axis, X[D - 1]) };
            q[1] = from_axis.polar_angle(X[D - 1]);
            q[D - 1] = angle;
        }
        let mut products = vec![1.0];
        for Axis { number, range: [low, high], count } in &self.axes {
            if self.chart == Chart::Tube && *number == 1 {
                let turns = (0.5 * (low + high) - q[1 % D]) / std::f64::consts::TAU;
                q[1 % D] += turns.round() * std::f64::consts::TAU;
            }
            let x = (2.0 * q[*number] - low - high) / (high - low);
            let own = polynomials(if x.abs() <= 1.1 { x } else { f64::NAN }, *count);
            products =
                own.iter().flat_map(|own| products.iter().map(move |rest| own * rest)).collect();
        }
        products
    }

    /// The fields at a position as series; none at points that the table does not have.
    #[must_use]
    pub fn series(&self, X: &[f64; D]) -> Option<PointSeries<D>> {
        if self.axes.is_empty() {
            let coordinates = self.points.iter().flat_map(|(place, _)| place);
            let farthest = coordinates.fold(0.0_f64, |most, x| most.max(x.abs()));
            let is_here = |(place, _): &&([f64; D], PointSeries<D>)| {
                let is_near =
                    |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-9 * a.abs() + 1e-12 * farthest;
                place.iter().zip(X).all(is_near)
            };
            return self.points.iter().find(is_here).map(|(_, series)| series.clone());
        }
        let along = self.along(X);
        let sum = |column: &[f64]| column.iter().zip(&along).map(|(c, p)| c * p).sum();
        let columns = self.body.coefficients.chunks_exact(along.len());
        let mut coefficients: Vec<f64> = columns.map(sum).collect();
        let steps = (self.body.knots.len() - 1) * self.body.in_time;
        let mut first = 0;
        for shape in &self.shapes {
            let size = shape.size(D) * steps;
            self.turn(X, *shape, &mut coefficients[first..first + size], steps);
            first += size;
        }
        let (knots, in_time) = (self.body.knots.clone(), self.body.in_time);
        Some(PointSeries { knots, in_time, coefficients })
    }

    /// The unit vectors of the frame at a position, `[i][a]`.
    fn frame_at(&self, X: &[f64; D]) -> [[f64; 3]; 3] {
        let [x, y, z] = std::array::from_fn(|i| X.get(i).copied().unwrap_or(0.0));
        let (s, r) = (x.hypot(y), x.hypot(y).hypot(z));
        match self.frame {
            Frame::Cartesian => [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            Frame::Polar => [[x / s, -y / s, 0.0], [y / s, x / s, 0.0], [0.0, 0.0, 1.0]],
            Frame::Spherical => [
                [x / r, z / r * (x / s), -y / s],
                [y / r, z / r * (y / s), x / s],
                [z / r, -s / r, 0.0],
            ],
        }
    }

    /// Turns a field whose entries are `steps` apart to Cartesian components.
    fn turn(&self, X: &[f64; D], shape: Shape, values: &mut [f64], steps: usize) {
        const ENTRIES: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];
        if self.frame == Frame::Cartesian || shape == Shape::Scalar {
            return;
        }
        let Q = self.frame_at(X);
        let entries: Vec<(usize, usize)> = match shape {
            Shape::Symmetric => ENTRIES.to_vec(),
            Shape::Vector => (0..D).map(|i| (i, 0)).collect(),
            _ => (0..D * D).map(|k| (k / D, k % D)).collect(),
        };
        for step in 0..steps {
            let mut own = [[0.0; 3]; 3];
            for (k, &(i, j)) in entries.iter().enumerate() {
                own[i][j] = values[k * steps + step];
                if shape == Shape::Symmetric {
                    own[j][i] = own[i][j];
                }
            }
            for (k, &(i, j)) in entries.iter().enumerate() {
                let term = |a: usize, b: usize| match shape {
                    Shape::Vector => Q[i][a] * own[a][b] * f64::from(u8::from(b == 0)),
                    _ => Q[i][a] * own[a][b] * Q[j][b],
                };
                values[k * steps + step] = (0..9).map(|ab| term(ab / 3, ab % 3)).sum();
            }
        }
    }
}

/// The body force at points that stay, from the series of each.
pub struct TabulatedPoints<const D: usize> {
    series: Vec<Option<PointSeries<D>>>,
}

impl<const D: usize> TabulatedPoints<D> {
    /// The points of a table; without a table, or outside of it, values are not numbers.
    #[must_use]
    pub fn new<T: Real>(table: Option<&HistoryTable<D>>, X: &[SVector<T, D>]) -> Self {
        let of = |X: &SVector<T, D>| table?.series(&std::array::from_fn(|i| X[i].to_f64()));
        Self { series: X.iter().map(of).collect() }
    }

    fn at<T: Real>(&self, n: usize, t: T) -> SVector<T, D> {
        let nan = SVector::repeat(T::nearest(f64::NAN));
        self.series[n].as_ref().map_or(nan, |series| series.body_force(t))
    }
}

impl<T: Real, const D: usize> BodyForceAtPoints<T, D> for TabulatedPoints<D> {
    fn evaluate(&self, t: T, first: usize, b: &mut [SVector<T, D>]) {
        for (n, b) in (first..).zip(b) {
            *b = self.at(n, t);
        }
    }

    fn of_time(&self, t: T, values: &mut Vec<T>) {
        values.push(t);
    }

    fn evaluate_of(&self, time: &[T], points: &[u32], b: &mut [SVector<T, D>]) {
        let &[t] = time else { panic!("one value of the time is needed, not {}", time.len()) };
        for (n, b) in points.iter().zip(b) {
            *b = self.at(*n as usize, t);
        }
    }

    fn len(&self) -> usize {
        self.series.len()
    }

    fn bytes_per_point(&self) -> usize {
        let first = self.series.iter().flatten().next();
        first.map_or(0, |series| size_of_val(&series.coefficients[..]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of bodies of any size are told apart, and found again after rounding.
    #[test]
    fn points_are_found_by_positions_of_any_size() {
        for size in [1e-12, 1e-6, 1.0, 1e6] {
            let places = [[0.25 * size, 0.0], [0.25 * size, 1e-3 * size], [0.5 * size, 0.0]];
            let series =
                |knot: f64| PointSeries { knots: vec![knot], in_time: 1, coefficients: Vec::new() };
            let table = HistoryTable::<2> {
                shapes: Vec::new(),
                chart: Chart::Box,
                frame: Frame::Cartesian,
                axes: Vec::new(),
                body: series(-1.0),
                points: places.iter().enumerate().map(|(k, X)| (*X, series(k as f64))).collect(),
            };
            for (k, [x, y]) in places.into_iter().enumerate() {
                let rounded = [x * (1.0 + 1e-15), y + 1e-16 * size];
                assert_eq!(table.series(&rounded), Some(series(k as f64)), "{size:e}, point {k}");
            }
            assert_eq!(table.series(&[0.3 * size, 0.0]), None, "{size:e}");
        }
    }
}
