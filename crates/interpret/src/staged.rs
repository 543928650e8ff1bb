//! The body force, and what a simulation is compared with, at points that stay.

use crate::{Interpretable, inputs};
use mmsmith_expr::{Operation, Program, Section, Slot};
use mmsmith_runtime::nalgebra::SVector;
use mmsmith_runtime::{BLOCK, BodyForceAtPoints, StateAtPoints, StateRun};
use mmsmith_stage::Stages;

/// One number for each point of a block.
pub(crate) type PerPoint<T> = [T; BLOCK];

/// A section with the program of what is the same at all points.
pub(crate) struct Stage {
    pub(crate) section: Section,
    uniform: Program,
}

impl Stage {
    pub(crate) fn new(program: &Program, outputs: &[Slot], given: &[Slot]) -> Self {
        let (section, uniform) = program.section(outputs, given);
        Stage { section, uniform }
    }

    /// The values of the program of what is the same at all points, of which none reads a position.
    pub(crate) fn uniform<T: Interpretable>(
        &self,
        dimension: usize,
        t: T,
        parameters: &[T],
    ) -> Vec<T> {
        self.uniform.evaluate_in(&inputs(&[T::zero(); 3][..dimension], t, parameters))
    }
}

/// Where a program reads a coordinate; `None` where nothing does.
pub(crate) fn coordinate(program: &Program, axis: usize) -> Option<Slot> {
    let operations = program.operations();
    program.slots().find(|slot| operations[slot.index()] == Operation::Input(axis))
}

/// How outputs are computed at points that stay: what is kept of a point once, and `N` groups of outputs from it, each
/// group at a time of its own.
pub(crate) struct PointStages<const N: usize> {
    /// The coordinates that anything reads.
    axes: Vec<usize>,
    at_points: Stage,
    kept: usize,
    at_times: [Stage; N],
}

impl<const N: usize> PointStages<N> {
    /// All groups keep the same values of a point.
    pub(crate) fn new<const D: usize>(program: &Program, groups: [&Stages; N]) -> Self {
        let kept = groups.first().map_or(&[][..], |stages| stages.point());
        let (axes, coordinates): (Vec<usize>, Vec<Slot>) =
            (0..D).filter_map(|axis| Some((axis, coordinate(program, axis)?))).unzip();
        PointStages {
            axes,
            at_points: Stage::new(program, kept, &coordinates),
            kept: kept.len(),
            at_times: groups.map(|stages| Stage::new(program, stages.outputs(), kept)),
        }
    }

    /// With what is kept of the points `X`.
    pub(crate) fn at<'a, T: Interpretable, const D: usize>(
        &'a self,
        X: &[SVector<T, D>],
        parameters: &'a [T],
    ) -> Points<'a, T, N> {
        let uniform = self.at_points.uniform(D, T::rounded(f64::NAN), parameters);
        let mut rows = Vec::new();
        let mut blocks = Vec::with_capacity(X.len().div_ceil(BLOCK) * self.kept);
        for X in X.chunks(BLOCK) {
            // What a last block has to spare repeats its last point.
            let coordinate = |axis: usize| -> PerPoint<T> {
                std::array::from_fn(|n| X[n.min(X.len() - 1)][axis])
            };
            let given: Vec<PerPoint<T>> = self.axes.iter().map(|&axis| coordinate(axis)).collect();
            blocks.extend(self.at_points.section.run(&uniform, &given, &mut rows));
        }
        Points { stages: self, parameters, blocks, len: X.len() }
    }
}

/// Values kept of points.
pub(crate) struct Points<'a, T, const N: usize> {
    stages: &'a PointStages<N>,
    parameters: &'a [T],
    /// Value `m` of point `n BLOCK + i` is number `i` of row `n kept + m`.
    blocks: Vec<PerPoint<T>>,
    len: usize,
}

impl<T: Interpretable, const N: usize> Points<'_, T, N> {
    /// The rows of a block.
    fn block(&self, number: usize) -> &[PerPoint<T>] {
        let kept = self.stages.kept;
        &self.blocks[number * kept..(number + 1) * kept]
    }

    fn bytes(&self) -> usize {
        self.stages.kept * size_of::<T>()
    }
}

impl<T: Interpretable, const D: usize> BodyForceAtPoints<T, D> for Points<'_, T, 1> {
    fn evaluate(&self, t: T, first: usize, b: &mut [SVector<T, D>]) {
        assert!(
            first.checked_add(b.len()).is_some_and(|end| end <= self.len),
            "{} points from number {first} on were asked for; there are {}",
            b.len(),
            self.len
        );
        let time = self.stages.at_times[0].uniform(D, t, self.parameters);
        self.of_numbers(&time, b, |n| first + n);
    }

    fn of_time(&self, t: T, values: &mut Vec<T>) {
        values.extend(self.stages.at_times[0].uniform(D, t, self.parameters));
    }

    fn evaluate_of(&self, time: &[T], points: &[u32], b: &mut [SVector<T, D>]) {
        assert_eq!(points.len(), b.len(), "one body force a point");
        if let Some(&n) = points.iter().find(|&&n| n as usize >= self.len) {
            panic!("point {n} was asked for; there are {}", self.len);
        }
        self.of_numbers(time, b, |n| points[n] as usize);
    }

    fn len(&self) -> usize {
        self.len
    }

    fn bytes_per_point(&self) -> usize {
        self.bytes()
    }
}

impl<T: Interpretable> Points<'_, T, 1> {
    /// The body force of the points that `number` tells for each place in `b`.
    fn of_numbers<const D: usize>(
        &self,
        uniform: &[T],
        b: &mut [SVector<T, D>],
        number: impl Fn(usize) -> usize,
    ) {
        let [stage] = &self.stages.at_times;
        let mut rows = Vec::new();
        let mut given = vec![[T::zero(); BLOCK]; self.stages.kept];
        for (chunk, b) in b.chunks_mut(BLOCK).enumerate() {
            for i in 0..b.len() {
                let n = number(chunk * BLOCK + i);
                let kept = self.block(n / BLOCK);
                given.iter_mut().zip(kept).for_each(|(row, kept)| row[i] = kept[n % BLOCK]);
            }
            for (d, row) in stage.section.run(uniform, &given, &mut rows).enumerate() {
                b.iter_mut().zip(row).for_each(|(b, value)| b[d] = *value);
            }
        }
    }
}

/// The first group is `u`, `F` and `P`, the second `v`.
impl<T: Interpretable, const D: usize> StateAtPoints<T, D> for Points<'_, T, 2> {
    fn evaluate(&self, t: T, velocity_time: T, first: usize, runs: &mut [StateRun<T, D>]) {
        let [state, velocity] = &self.stages.at_times;
        let uniform = state.uniform(D, t, self.parameters);
        let of_velocity = velocity.uniform(D, velocity_time, self.parameters);
        let mut rows = Vec::new();
        for (number, run) in (first..).zip(runs) {
            assert!(number * BLOCK < self.len, "there are {} points", self.len);
            let kept = self.block(number);
            let StateRun { u, v, F, P } = run;
            let places = u.iter_mut().chain(F.as_flattened_mut()).chain(P.as_flattened_mut());
            let values = state.section.run(&uniform, kept, &mut rows);
            places.zip(values).for_each(|(place, value)| *place = *value);
            let values = velocity.section.run(&of_velocity, kept, &mut rows);
            v.iter_mut().zip(values).for_each(|(place, value)| *place = *value);
        }
    }

    fn bytes_per_point(&self) -> usize {
        self.bytes()
    }
}
