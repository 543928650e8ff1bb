//! The body force at the points of a lattice, from values of its layers.

use crate::Interpretable;
use crate::staged::{PerPoint, Stage, coordinate};
use mmsmith_expr::{Program, Slot};
use mmsmith_runtime::nalgebra::SVector;
use mmsmith_runtime::{BLOCK, BodyForceAtPoints, Lattice, Solution};
use mmsmith_stage as stage;

/// How the body force of points follows from their layers, and that of layers from their coordinates.
pub(crate) struct LatticeStages {
    /// For each axis the values of a layer, where there are any.
    layers: Vec<LayerStage>,
    points: Stage,
}

/// The values of the layers along an axis.
struct LayerStage {
    axis: usize,
    count: usize,
    stage: Stage,
}

impl LatticeStages {
    /// Stages of the form that `lattice` states.
    pub(crate) fn new(program: &Program, lattice: &stage::Lattice) -> Self {
        let layers = lattice.layers();
        let layer = |(axis, stages): (usize, &stage::Stages)| {
            let coordinate = coordinate(program, axis)?;
            let stage = Stage::new(program, stages.outputs(), &[coordinate]);
            Some(LayerStage { axis, count: stages.output_count(), stage })
        };
        let of_layers: Vec<Slot> =
            layers.iter().flat_map(|stages| stages.outputs()).copied().collect();
        LatticeStages {
            layers: layers.iter().enumerate().filter_map(layer).collect(),
            points: Stage::new(program, lattice.outputs(), &of_layers),
        }
    }

    /// At the points of a lattice.
    pub(crate) fn at<'a, T: Interpretable, const D: usize>(
        &'a self,
        lattice: Lattice<T, D>,
        parameters: &'a [T],
        solution: &'a dyn Solution<T, D>,
    ) -> LatticePoints<'a, T, D> {
        LatticePoints { stages: self, lattice, parameters, solution }
    }
}

/// The points of a lattice, by their layers.
pub(crate) struct LatticePoints<'a, T: Interpretable, const D: usize> {
    stages: &'a LatticeStages,
    lattice: Lattice<T, D>,
    parameters: &'a [T],
    /// For points where the values of layers lead to no number.
    solution: &'a dyn Solution<T, D>,
}

impl<T: Interpretable, const D: usize> LatticePoints<'_, T, D> {
    /// The body force of the points that `number` tells for each place in `b`, from the values of a time.
    fn of_numbers(&self, values: &[T], b: &mut [SVector<T, D>], number: impl Fn(usize) -> usize) {
        let LatticeStages { layers, points } = self.stages;
        // First the time, then the values of the layers, axis by axis and layer by layer, then what all points share.
        let Some((&t, mut rest)) = values.split_first() else {
            panic!("the values of a time are needed");
        };
        let mut tables = Vec::with_capacity(layers.len());
        for layer in layers {
            let length = layer.count * self.lattice.coordinates(layer.axis).len();
            let Some((table, others)) = rest.split_at_checked(length) else {
                panic!("{length} values of layers are needed, not {}", rest.len());
            };
            tables.push((layer, table));
            rest = others;
        }
        let mut rows = Vec::new();
        let mut given = Vec::new();
        for (chunk, b) in b.chunks_mut(BLOCK).enumerate() {
            given.clear();
            let number = |i: usize| number(chunk * BLOCK + i);
            for &(&LayerStage { axis, count, .. }, table) in &tables {
                let first = given.len();
                given.resize(first + count, [T::zero(); BLOCK]);
                for i in 0..b.len() {
                    let layer = usize::from(self.lattice.layers()[number(i)][axis]);
                    let values = &table[layer * count..(layer + 1) * count];
                    given[first..].iter_mut().zip(values).for_each(|(row, value)| row[i] = *value);
                }
            }
            for (d, row) in points.section.run(rest, &given, &mut rows).enumerate() {
                b.iter_mut().zip(row).for_each(|(b, value)| b[d] = *value);
            }
            for (i, b) in b.iter_mut().enumerate() {
                if b.iter().any(|value| !value.is_number()) {
                    *b = self.solution.body_force(&self.lattice.point(number(i)), t);
                }
            }
        }
    }
}

impl<T: Interpretable, const D: usize> BodyForceAtPoints<T, D> for LatticePoints<'_, T, D> {
    fn evaluate(&self, t: T, first: usize, b: &mut [SVector<T, D>]) {
        let mut values = Vec::new();
        self.of_time(t, &mut values);
        self.of_numbers(&values, b, |n| first + n);
    }

    fn of_time(&self, t: T, values: &mut Vec<T>) {
        let LatticeStages { layers, points } = self.stages;
        values.push(t);
        let mut rows = Vec::new();
        for LayerStage { axis, count, stage } in layers {
            let uniform = stage.uniform(D, t, self.parameters);
            for coordinates in self.lattice.coordinates(*axis).chunks(BLOCK) {
                let mut row: PerPoint<T> = [T::zero(); BLOCK];
                row[..coordinates.len()].copy_from_slice(coordinates);
                let first = values.len();
                values.resize(first + coordinates.len() * count, T::zero());
                for (m, row) in stage.section.run(&uniform, &[row], &mut rows).enumerate() {
                    let places = values[first..].iter_mut().skip(m).step_by(*count);
                    places.zip(row).for_each(|(place, value)| *place = *value);
                }
            }
        }
        values.extend(points.uniform(D, t, self.parameters));
    }

    fn evaluate_of(&self, time: &[T], points: &[u32], b: &mut [SVector<T, D>]) {
        assert_eq!(points.len(), b.len(), "one body force a point");
        self.of_numbers(time, b, |n| points[n] as usize);
    }

    fn len(&self) -> usize {
        self.lattice.layers().len()
    }

    fn bytes_per_point(&self) -> usize {
        size_of::<[u16; D]>()
    }
}
