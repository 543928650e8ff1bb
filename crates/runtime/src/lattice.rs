//! The body force at points that share coordinates.
//!
//! In a lattice of `n x m` points there are `n m` points and `n + m` coordinates. A layer is the set of points with the same value of
//! one coordinate. Where each coordinate moves along itself only, the body force is a short sum of products of functions of one
//! coordinate and the time. These functions are then evaluated once a layer, and a point takes a few products.

use crate::{BodyForceAtPoints, Real, Solution};
use nalgebra::SVector;
use std::collections::HashMap;

/// The least number of points a layer that makes a lattice worthwhile: a layer costs as much as some tens of points without a lattice.
pub(crate) const POINTS_A_LAYER: usize = 16;
/// The most layers that 16-bit numbers can tell apart.
const MOST_LAYERS: usize = 1 << 16;

/// Points that share their coordinates with many others.
#[derive(Clone, Debug, PartialEq)]
pub struct Lattice<T, const D: usize> {
    /// For each axis the coordinates of its layers.
    coordinates: [Vec<T>; D],
    /// The layers of each point, one for each axis. 16-bit numbers, since a solver reads them in every step.
    layers: Vec<[u16; D]>,
}

impl<T: Real, const D: usize> Lattice<T, D> {
    /// The points `X` by their layers; `None` where there are fewer than sixteen points a layer, or more than 65536 layers.
    #[must_use]
    pub fn of(X: &[SVector<T, D>]) -> Option<Self> {
        let most = Self::most_layers(X.len());
        Self::within(X, most).filter(|_| most > 0)
    }

    /// The points `X` by their layers, where they are a part of a body that is a lattice; `None` for more than 65536 layers.
    #[must_use]
    pub fn of_part(X: &[SVector<T, D>]) -> Option<Self> {
        Self::within(X, MOST_LAYERS)
    }

    /// The largest number of layers that a lattice of so many points may have.
    #[must_use]
    pub fn most_layers(points: usize) -> usize {
        (points / POINTS_A_LAYER).min(MOST_LAYERS)
    }

    fn within(X: &[SVector<T, D>], most: usize) -> Option<Self> {
        let mut coordinates: [Vec<T>; D] = std::array::from_fn(|_| Vec::new());
        let mut known: [HashMap<u64, u16>; D] = std::array::from_fn(|_| HashMap::new());
        let mut layers = Vec::new();
        for X in X {
            let mut own = [0; D];
            for axis in 0..D {
                // Equal to the last bit: -0 and 0 are different layers.
                let bits = X[axis].to_f64().to_bits();
                own[axis] = *known[axis].entry(bits).or_insert_with(|| {
                    coordinates[axis].push(X[axis]);
                    (coordinates[axis].len() - 1) as u16
                });
            }
            if coordinates.iter().map(Vec::len).sum::<usize>() > most {
                return None;
            }
            layers.push(own);
        }
        Some(Lattice { coordinates, layers })
    }

    /// The coordinates of the layers along an axis, in the order of the points that had them first.
    ///
    /// # Panics
    ///
    /// Panics where there is no such axis.
    #[must_use]
    pub fn coordinates(&self, axis: usize) -> &[T] {
        &self.coordinates[axis]
    }

    /// For each point the numbers of its layers, one for each axis.
    #[must_use]
    pub fn layers(&self) -> &[[u16; D]] {
        &self.layers
    }

    /// Point number `n`.
    ///
    /// # Panics
    ///
    /// Panics where there is no such point.
    #[must_use]
    pub fn point(&self, n: usize) -> SVector<T, D> {
        let layers = &self.layers[n];
        SVector::from_fn(|axis, _| self.coordinates[axis][usize::from(layers[axis])])
    }
}

/// The body force at the points of a lattice: `TIME` values of the time, `POINT` values of a coordinate, `LAYER` values of a layer that
/// follow from both, and the body force from the layers of a point. Generated solutions have this form where it makes points cheap.
pub trait BodyForceOnLattice<
    T: Real,
    const D: usize,
    const TIME: usize,
    const POINT: usize,
    const LAYER: usize,
>: Solution<T, D>
{
    /// Values that depend on the time alone.
    fn lattice_time(&self, t: T) -> [T; TIME];
    /// Values that depend on one coordinate of `X` alone, that of the axis.
    fn lattice_coordinate(&self, axis: usize, X: &SVector<T, D>) -> [T; POINT];
    /// Values that depend on the time and on one coordinate.
    fn lattice_layer(&self, axis: usize, time: &[T; TIME], point: &[T; POINT]) -> [T; LAYER];
    /// The body force per unit mass, from the values of one time and of a point's layers: equal to [`Solution::body_force`] but for
    /// rounding, or NaN.
    fn lattice_body_force(&self, time: &[T; TIME], layers: [&[T; LAYER]; D]) -> SVector<T, D>;
}

/// Values that the body force of a generated solution keeps of the points of a lattice.
pub struct LatticePoints<
    S,
    T,
    const D: usize,
    const TIME: usize,
    const POINT: usize,
    const LAYER: usize,
> {
    solution: S,
    lattice: Lattice<T, D>,
    /// For each axis the values kept of each coordinate.
    coordinates: [Vec<[T; POINT]>; D],
}

impl<S, T: Real, const D: usize, const TIME: usize, const POINT: usize, const LAYER: usize>
    LatticePoints<S, T, D, TIME, POINT, LAYER>
where
    S: BodyForceOnLattice<T, D, TIME, POINT, LAYER>,
{
    /// Computes the values that depend on the coordinates alone.
    #[must_use]
    pub fn new(solution: S, lattice: Lattice<T, D>) -> Self {
        let coordinates = std::array::from_fn(|axis| {
            let of_coordinate = |&coordinate: &T| {
                let mut X = SVector::zeros();
                X[axis] = coordinate;
                solution.lattice_coordinate(axis, &X)
            };
            lattice.coordinates(axis).iter().map(of_coordinate).collect()
        });
        LatticePoints { solution, lattice, coordinates }
    }

    /// The number of all layers.
    fn layers(&self) -> usize {
        self.coordinates.iter().map(Vec::len).sum()
    }

    /// The body force of the points with these numbers, at one time; `values` are those of the time and of the layers.
    fn of_points<'a>(
        &self,
        values: &[T],
        points: impl Iterator<Item = (usize, &'a mut SVector<T, D>)>,
    ) where
        T: 'a,
    {
        let Some((&[t], values)) = values.split_first_chunk::<1>() else {
            panic!("the values of a time are needed");
        };
        let Some((time, layers)) = values.split_first_chunk::<TIME>() else {
            panic!("{TIME} values of the time are needed, not {}", values.len());
        };
        let (mut rest, _) = layers.as_chunks::<LAYER>();
        assert_eq!(rest.len(), self.layers(), "the values of a time are those of each layer");
        let tables: [&[[T; LAYER]]; D] = std::array::from_fn(|axis| {
            let (table, others) = rest.split_at(self.coordinates[axis].len());
            rest = others;
            table
        });
        for (n, b) in points {
            let own = self.lattice.layers()[n];
            let layers = std::array::from_fn(|axis| &tables[axis][usize::from(own[axis])]);
            *b = self.solution.lattice_body_force(time, layers);
            if !b.iter().fold(true, |all, value| all & value.is_number()) {
                *b = self.solution.body_force(&self.lattice.point(n), t);
            }
        }
    }
}

impl<S, T: Real, const D: usize, const TIME: usize, const POINT: usize, const LAYER: usize>
    BodyForceAtPoints<T, D> for LatticePoints<S, T, D, TIME, POINT, LAYER>
where
    S: BodyForceOnLattice<T, D, TIME, POINT, LAYER>,
{
    fn evaluate(&self, t: T, first: usize, b: &mut [SVector<T, D>]) {
        let mut values = Vec::new();
        self.of_time(t, &mut values);
        self.of_points(&values, (first..).zip(b));
    }

    fn of_time(&self, t: T, values: &mut Vec<T>) {
        values.reserve(1 + TIME + LAYER * self.layers());
        let time = self.solution.lattice_time(t);
        values.push(t);
        values.extend(time);
        for (axis, coordinates) in self.coordinates.iter().enumerate() {
            for point in coordinates {
                values.extend(self.solution.lattice_layer(axis, &time, point));
            }
        }
    }

    fn evaluate_of(&self, time: &[T], points: &[u32], b: &mut [SVector<T, D>]) {
        assert_eq!(points.len(), b.len(), "one body force a point");
        self.of_points(time, points.iter().map(|&n| n as usize).zip(b));
    }

    fn len(&self) -> usize {
        self.lattice.layers().len()
    }

    fn bytes_per_point(&self) -> usize {
        size_of::<[u16; D]>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lattice(columns: usize, rows: usize) -> Vec<SVector<f64, 2>> {
        let point = |n: usize| [(n % columns) as f64, 0.5 * (n / columns) as f64].into();
        (0..columns * rows).map(point).collect()
    }

    #[test]
    fn points_by_their_layers() {
        let X = lattice(40, 30);
        let found = Lattice::of(&X).unwrap();
        assert_eq!((found.coordinates(0).len(), found.coordinates(1).len()), (40, 30));
        assert_eq!((found.coordinates(1)[3], found.layers()[85]), (1.5, [5, 2]));
        for (n, X) in X.iter().enumerate() {
            assert_eq!(found.point(n), *X);
        }
        // In any order, and with holes.
        let some: Vec<_> =
            X.iter().rev().enumerate().filter(|(n, _)| n % 20 > 0).map(|(_, X)| *X).collect();
        let found = Lattice::of(&some).unwrap();
        assert_eq!((0..some.len()).map(|n| found.point(n)).collect::<Vec<_>>(), some);
    }

    #[test]
    fn too_many_layers() {
        // 32 and 32 layers of 16 points each, and one more.
        let X = lattice(32, 32);
        assert!(Lattice::of(&X).is_some());
        assert!(Lattice::of(&X[1..]).is_none());
        let mut other = X.clone();
        other[500].x = -0.0;
        assert!(Lattice::of(&other).is_none(), "zero with a sign is a coordinate of its own");
        assert!(Lattice::<f64, 2>::of(&[]).is_none());
        let line = |n: usize| -> Vec<SVector<f64, 1>> {
            (0..16 * n).map(|i| [(i % n) as f64].into()).collect()
        };
        let longest = Lattice::of(&line(MOST_LAYERS)).unwrap();
        assert_eq!(longest.point(MOST_LAYERS - 1), [(MOST_LAYERS - 1) as f64].into());
        assert!(Lattice::of(&line(MOST_LAYERS + 1)).is_none());
    }
}
