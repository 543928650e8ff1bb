//! Fields at points that stay while time goes on.
//!
//! A solver samples `b` at the same reference positions in every step, and is compared with `u`, `v`, `F` and `P` there.
//! Values that depend on the position alone, such as the sines of `pi X` or the profile of a displacement over the radius, are
//! computed once and kept; values that depend on the time alone are computed once a call; the work left for each point and
//! time is short, and many points go through it at once.

use crate::{Real, Solution};
use mmsmith_lanes::simd::widest;
use nalgebra::{SMatrix, SVector};
use pulp::{Simd, WithSimd};
use std::array;
use std::ops::Range;

/// The body force at many fixed points, prepared by [`Solution::body_force_at`].
pub trait BodyForceAtPoints<T: Real, const D: usize>: Send + Sync {
    /// Writes into `b` the body force of the points `first .. first + b.len()` at time `t`.
    ///
    /// The values are those of [`Solution::body_force`] but for rounding: values that are computed once a point are arranged in another
    /// way than in a single call. Long runs are fastest where `first` is a multiple of [`BLOCK`]; any other split gives the same
    /// values, to the last bit.
    ///
    /// # Panics
    ///
    /// Panics where there are fewer than `first + b.len()` points.
    fn evaluate(&self, t: T, first: usize, b: &mut [SVector<T, D>]);

    /// Appends to `values` the values of the time `t` that [`evaluate_of`](Self::evaluate_of) needs.
    fn of_time(&self, t: T, values: &mut Vec<T>);

    /// As [`evaluate`](Self::evaluate) for the points with the given numbers, in any order. [`of_time`](Self::of_time) made `time`; `b`
    /// is as long as `points`.
    ///
    /// # Panics
    ///
    /// Panics where a number does not belong to a point, or another solution made `time`.
    fn evaluate_of(&self, time: &[T], points: &[u32], b: &mut [SVector<T, D>]);

    /// The number of points.
    fn len(&self) -> usize;

    /// Whether there are no points.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The memory that each point takes, in bytes.
    fn bytes_per_point(&self) -> usize;
}

/// The exact state at many fixed points, to compare a simulation with, prepared by [`Solution::state_at`].
pub trait StateAtPoints<T: Real, const D: usize>: Send + Sync {
    /// Writes `u`, `F` and `P` at time `t`, and `v` at `velocity_time`, of the points from `BLOCK first` on. The last point fills the
    /// rest of the last run.
    ///
    /// The values are those of the functions of [`Solution`], to the last bit.
    ///
    /// # Panics
    ///
    /// Panics where there are fewer than `first + runs.len()` runs of [`BLOCK`] points, an incomplete run included.
    fn evaluate(&self, t: T, velocity_time: T, first: usize, runs: &mut [StateRun<T, D>]);

    /// The memory that each point takes, in bytes.
    fn bytes_per_point(&self) -> usize;
}

/// The exact internal variables at many fixed points, prepared by [`Solution::internal_at`].
pub trait InternalAtPoints<T: Real>: Send + Sync {
    /// The internal variables of some points at time `t`, each in the order of [`Solution::internal_variables`].
    ///
    /// # Panics
    ///
    /// Panics where there are fewer points.
    fn evaluate(&self, t: T, points: Range<usize>) -> Vec<Vec<T>>;
}

/// The exact state at one point, to compare a simulation with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State<T: Real, const D: usize> {
    /// Displacement, a length.
    pub u: SVector<T, D>,
    /// Velocity, which schemes may store for a time of its own.
    pub v: SVector<T, D>,
    /// Deformation gradient.
    pub F: SMatrix<T, D, D>,
    /// First Piola-Kirchhoff stress.
    pub P: SMatrix<T, D, D>,
}

/// The [`State`]s of [`BLOCK`] points, each component in one run: `F[i][J][n]` is `F_iJ` of point `n`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateRun<T, const D: usize> {
    /// Displacements.
    pub u: [[T; BLOCK]; D],
    /// Velocities.
    pub v: [[T; BLOCK]; D],
    /// Deformation gradients.
    pub F: [[[T; BLOCK]; D]; D],
    /// First Piola-Kirchhoff stresses.
    pub P: [[[T; BLOCK]; D]; D],
}

impl<T: Real, const D: usize> StateRun<T, D> {
    /// All components zero.
    #[must_use]
    #[inline(always)]
    pub fn zero() -> Self {
        let (vector, matrix) = ([[T::zero(); BLOCK]; D], [[[T::zero(); BLOCK]; D]; D]);
        Self { u: vector, v: vector, F: matrix, P: matrix }
    }

    /// This run with `change` applied to each component.
    #[must_use]
    pub fn map<U>(self, change: impl Fn(T) -> U) -> StateRun<U, D> {
        let row = |row: [T; BLOCK]| row.map(&change);
        StateRun {
            u: self.u.map(row),
            v: self.v.map(row),
            F: self.F.map(|rows| rows.map(row)),
            P: self.P.map(|rows| rows.map(row)),
        }
    }

    /// The state of point `n` of the run.
    #[must_use]
    pub fn get(&self, n: usize) -> State<T, D> {
        State {
            u: SVector::from_fn(|i, _| self.u[i][n]),
            v: SVector::from_fn(|i, _| self.v[i][n]),
            F: SMatrix::from_fn(|i, j| self.F[i][j][n]),
            P: SMatrix::from_fn(|i, j| self.P[i][j][n]),
        }
    }

    #[inline(always)]
    fn put(&mut self, n: usize, state: &State<T, D>) {
        for i in 0..D {
            self.u[i][n] = state.u[i];
            self.v[i][n] = state.v[i];
            for j in 0..D {
                self.F[i][j][n] = state.F[(i, j)];
                self.P[i][j][n] = state.P[(i, j)];
            }
        }
    }
}

/// The body force in three stages: `TIME` values that depend on the time alone, `POINT` values that depend on the point alone, and the
/// body force from both. Every generated solution has these stages.
///
/// ```
/// use mmsmith_solutions::{BodyForceStages, Ring, RingParameters, Solution};
///
/// let ring = Ring::<f64>::new(RingParameters::default())?;
/// let X = [0.6, 0.3].into();
/// let (time, point) = (ring.body_force_time(1e-3), ring.body_force_point(&X));
/// let (staged, single) = (ring.body_force_staged::<false>(&time, &point), ring.body_force(&X, 1e-3));
/// assert!((staged - single).norm() < 1e-14 * single.norm());
/// # Ok::<(), mmsmith_solutions::ParameterError>(())
/// ```
pub trait BodyForceStages<T: Real, const D: usize, const TIME: usize, const POINT: usize>:
    Solution<T, D>
{
    /// Values that depend on the time alone.
    fn body_force_time(&self, t: T) -> [T; TIME];
    /// Values that depend on the reference position alone.
    fn body_force_point(&self, X: &SVector<T, D>) -> [T; POINT];
    /// The body force per unit mass, from the values of one time and of one point; equal to
    /// [`Solution::body_force`] but for rounding.
    ///
    /// If `NEAR`, logarithms of ratios take the form near one (`Real::ln_near_one`), and sines and cosines the form of angles up to a million
    /// (`Real::sine_in_range`): the result is the same to the last bit, or NaN.
    fn body_force_staged<const NEAR: bool>(
        &self,
        time: &[T; TIME],
        point: &[T; POINT],
    ) -> SVector<T, D>;
}

/// The exact state in stages, to compare a simulation with: `TIME` values that depend on the time alone, `VELOCITY_TIME` values that
/// depend on the velocity's own time, `POINT` values that depend on the point alone, and the state from all of them. Every generated
/// solution has these stages.
pub trait StateStages<
    T: Real,
    const D: usize,
    const TIME: usize,
    const VELOCITY_TIME: usize,
    const POINT: usize,
>: Solution<T, D>
{
    /// Values that depend on the time alone, for displacement, deformation gradient and stress.
    fn state_time(&self, t: T) -> [T; TIME];
    /// Values that depend on the time alone, for the velocity.
    fn velocity_time(&self, t: T) -> [T; VELOCITY_TIME];
    /// Values that depend on the reference position alone.
    fn state_point(&self, X: &SVector<T, D>) -> [T; POINT];
    /// The fields from the values of their times and of a point, equal to the results of [`Solution`]'s functions to the last bit.
    /// `NEAR` is as in [`BodyForceStages::body_force_staged`].
    fn state_staged<const NEAR: bool>(
        &self,
        time: &[T; TIME],
        velocity_time: &[T; VELOCITY_TIME],
        point: &[T; POINT],
    ) -> State<T, D>;
}

/// Number of points that are evaluated together. Each value kept for them is a run of this length. A run fills the vector registers of
/// any processor, and is no longer than the two cache lines that are read at once: blocks come from memory in the order in which they
/// lie there.
pub const BLOCK: usize = 16;

/// Number of points whose body force is computed in one loop. The loop is long against the work before and after it.
const RUN: usize = 4 * BLOCK;

/// The values kept for points, in blocks: `blocks[n][m][i]` is value `m` of point `n BLOCK + i`. The last point fills the rest of the
/// last block.
type Blocks<T, const POINT: usize> = Vec<[[T; BLOCK]; POINT]>;

/// Results of `values` for each of the points `X`.
fn blocks<T: Real, const D: usize, const POINT: usize>(
    X: &[SVector<T, D>],
    values: impl Fn(&SVector<T, D>) -> [T; POINT],
) -> Blocks<T, POINT> {
    let block = |points: &[SVector<T, D>]| {
        let mut block = [[T::zero(); BLOCK]; POINT];
        for (i, X) in points.iter().enumerate() {
            block.iter_mut().zip(values(X)).for_each(|(run, value)| run[i] = value);
        }
        for run in &mut block {
            let last = run[points.len() - 1];
            run[points.len()..].fill(last);
        }
        block
    };
    X.chunks(BLOCK).map(block).collect()
}

/// Values that the body force of a generated solution keeps of points.
pub struct StagedPoints<S, T, const TIME: usize, const POINT: usize> {
    solution: S,
    /// For each value an array over all points, so that a run of points may begin anywhere. The last point is repeated for the runs
    /// that end beyond it.
    values: [Vec<T>; POINT],
    len: usize,
}

impl<S, T: Real, const TIME: usize, const POINT: usize> StagedPoints<S, T, TIME, POINT> {
    /// Computes the values that depend on the points `X` alone.
    #[must_use]
    pub fn new<const D: usize>(solution: S, X: &[SVector<T, D>]) -> Self
    where
        S: BodyForceStages<T, D, TIME, POINT>,
    {
        let mut values = array::from_fn(|_| Vec::with_capacity(X.len() + RUN));
        for X in X {
            let of_point = solution.body_force_point(X);
            values.iter_mut().zip(of_point).for_each(|(run, value)| run.push(value));
        }
        for run in &mut values {
            let last = run.last().copied().unwrap_or(T::zero());
            run.resize(X.len() + RUN, last);
        }
        StagedPoints { solution, values, len: X.len() }
    }
}

/// Values that the states of a generated solution keep of points.
pub struct StagedStates<S, T, const TIME: usize, const VELOCITY_TIME: usize, const POINT: usize> {
    solution: S,
    blocks: Blocks<T, POINT>,
}

impl<S, T: Real, const TIME: usize, const VELOCITY_TIME: usize, const POINT: usize>
    StagedStates<S, T, TIME, VELOCITY_TIME, POINT>
{
    /// Computes the values that depend on the points `X` alone.
    #[must_use]
    pub fn new<const D: usize>(solution: S, X: &[SVector<T, D>]) -> Self
    where
        S: StateStages<T, D, TIME, VELOCITY_TIME, POINT>,
    {
        let blocks = blocks(X, |X| solution.state_point(X));
        StagedStates { solution, blocks }
    }
}

/// Point `i` of a block.
#[inline(always)]
fn point<T: Real, const POINT: usize>(block: &[[T; BLOCK]; POINT], i: usize) -> [T; POINT] {
    array::from_fn(|m| block[m][i])
}

/// Some points by their numbers.
#[derive(Clone, Copy)]
enum Numbers<'a> {
    /// Successive points from this number on.
    From(usize),
    Of(&'a [u32]),
}

/// Points as loops of fixed length over separate runs. The loops are compiled for each kind of vector registers, and the processor's
/// kind is chosen when the program runs. All give the same bits, since nothing is contracted or reordered.
struct Runs<'a, S, T: Real, const D: usize, const TIME: usize, const POINT: usize> {
    solution: &'a S,
    time: &'a [T; TIME],
    values: &'a [Vec<T>; POINT],
    /// The number of points.
    len: usize,
    numbers: Numbers<'a>,
    b: &'a mut [SVector<T, D>],
}

impl<S, T: Real, const D: usize, const TIME: usize, const POINT: usize> WithSimd
    for Runs<'_, S, T, D, TIME, POINT>
where
    S: BodyForceStages<T, D, TIME, POINT>,
{
    type Output = ();

    #[inline(always)]
    fn with_simd<I: Simd>(self, _: I) {
        let Self { solution, time, values, len, numbers, b } = self;
        for (index, b) in b.chunks_mut(RUN).enumerate() {
            let place = index * RUN;
            let picked;
            let run = match numbers {
                Numbers::From(first) => run(values, first + place),
                Numbers::Of(points) => {
                    let points = &points[place..place + b.len()];
                    if let Some(first) = successive(points)
                        && first + points.len() <= len
                    {
                        run(values, first)
                    } else {
                        if let Some(n) = points.iter().find(|&&n| n as usize >= len) {
                            panic!("point {n} was asked for; there are {len}");
                        }
                        picked = pick(values, points);
                        array::from_fn(|m| &picked[m])
                    }
                }
            };
            body_forces(solution, time, &run, b);
        }
    }
}

/// The first of successive numbers; `None` for numbers that are not successive.
#[inline(always)]
fn successive(points: &[u32]) -> Option<usize> {
    let &first = points.first()?;
    let mut apart = 0;
    for (i, &n) in points.iter().enumerate() {
        apart |= n ^ first.wrapping_add(i as u32);
    }
    (apart == 0).then_some(first as usize)
}

/// The values of a run of points from number `first` on, which is the number of a point.
#[inline(always)]
fn run<T, const POINT: usize>(values: &[Vec<T>; POINT], first: usize) -> [&[T; RUN]; POINT] {
    array::from_fn(|m| match values[m][first..].first_chunk() {
        Some(run) => run,
        // There is room for a run after each point.
        None => panic!("{} values are kept from point {first} on", values[m].len() - first),
    })
}

/// The values of a run that begins with these points. Some of them usually have successive numbers.
#[inline(always)]
fn pick<T: Real, const POINT: usize>(
    values: &[Vec<T>; POINT],
    points: &[u32],
) -> [[T; RUN]; POINT] {
    const TOGETHER: usize = BLOCK / 2;
    let mut picked = [[T::zero(); RUN]; POINT];
    for (index, points) in points.chunks(TOGETHER).enumerate() {
        let place = index * TOGETHER;
        let first = successive(points);
        for (picked, values) in picked.iter_mut().zip(values) {
            if let Some(first) = first
                && let Some(from) = values[first..].first_chunk::<TOGETHER>()
            {
                picked[place..place + TOGETHER].copy_from_slice(from);
            } else {
                for (i, &n) in points.iter().enumerate() {
                    picked[place + i] = values[n as usize];
                }
            }
        }
    }
    picked
}

/// The body force on the first points of a run.
#[inline(always)]
fn body_forces<S, T: Real, const D: usize, const TIME: usize, const POINT: usize>(
    solution: &S,
    time: &[T; TIME],
    run: &[&[T; RUN]; POINT],
    b: &mut [SVector<T, D>],
) where
    S: BodyForceStages<T, D, TIME, POINT>,
{
    // A whole run as a loop of fixed length, which needs no steps of single points.
    if let Some(whole) = b.first_chunk_mut::<RUN>() {
        if !spread::<true, _, _, D, TIME, POINT>(solution, time, run, whole) {
            spread::<false, _, _, D, TIME, POINT>(solution, time, run, whole);
        }
    } else if !spread::<true, _, _, D, TIME, POINT>(solution, time, run, b) {
        spread::<false, _, _, D, TIME, POINT>(solution, time, run, b);
    }
}

/// Returns whether all values are numbers. If not, a ratio was not near one, an angle too large, or there is no force. A function of its own tells the
/// compiler that the arrays do not overlap. It is generic instead of taking a closure, which is not always inlined: the loop would then
/// go point by point.
#[inline(always)]
fn spread<const NEAR: bool, S, T: Real, const D: usize, const TIME: usize, const POINT: usize>(
    solution: &S,
    time: &[T; TIME],
    run: &[&[T; RUN]; POINT],
    b: &mut [SVector<T, D>],
) -> bool
where
    S: BodyForceStages<T, D, TIME, POINT>,
{
    let mut numbers = true;
    for (i, b) in b.iter_mut().enumerate() {
        *b = solution.body_force_staged::<NEAR>(time, &array::from_fn(|m| run[m][i]));
        numbers &= b.iter().fold(true, |all, value| all & value.is_number());
    }
    numbers
}

impl<S, T: Real, const D: usize, const TIME: usize, const POINT: usize> BodyForceAtPoints<T, D>
    for StagedPoints<S, T, TIME, POINT>
where
    S: BodyForceStages<T, D, TIME, POINT>,
{
    fn evaluate(&self, t: T, first: usize, b: &mut [SVector<T, D>]) {
        assert!(
            first.checked_add(b.len()).is_some_and(|end| end <= self.len),
            "{} points from number {first} on were asked for; there are {}",
            b.len(),
            self.len
        );
        self.runs(&self.solution.body_force_time(t), Numbers::From(first), b);
    }

    fn of_time(&self, t: T, values: &mut Vec<T>) {
        values.extend(self.solution.body_force_time(t));
    }

    fn evaluate_of(&self, time: &[T], points: &[u32], b: &mut [SVector<T, D>]) {
        assert_eq!(points.len(), b.len(), "one body force a point");
        let Ok(time) = time.try_into() else {
            panic!("{TIME} values of the time are needed, not {}", time.len());
        };
        self.runs(time, Numbers::Of(points), b);
    }

    fn len(&self) -> usize {
        self.len
    }

    fn bytes_per_point(&self) -> usize {
        POINT * size_of::<T>()
    }
}

impl<S, T: Real, const TIME: usize, const POINT: usize> StagedPoints<S, T, TIME, POINT> {
    fn runs<const D: usize>(&self, time: &[T; TIME], numbers: Numbers<'_>, b: &mut [SVector<T, D>])
    where
        S: BodyForceStages<T, D, TIME, POINT>,
    {
        let Self { solution, values, len, .. } = self;
        widest(Runs { solution, time, values, len: *len, numbers, b });
    }
}

/// Blocks of points as loops of fixed length, as [`Runs`].
struct BlocksOfStates<
    'a,
    S,
    T: Real,
    const D: usize,
    const TIME: usize,
    const VELOCITY_TIME: usize,
    const POINT: usize,
> {
    solution: &'a S,
    time: &'a [T; TIME],
    velocity_time: &'a [T; VELOCITY_TIME],
    blocks: &'a [[[T; BLOCK]; POINT]],
    runs: &'a mut [StateRun<T, D>],
}

impl<S, T: Real, const D: usize, const TIME: usize, const VELOCITY_TIME: usize, const POINT: usize>
    WithSimd for BlocksOfStates<'_, S, T, D, TIME, VELOCITY_TIME, POINT>
where
    S: StateStages<T, D, TIME, VELOCITY_TIME, POINT>,
{
    type Output = ();

    #[inline(always)]
    fn with_simd<I: Simd>(self, _: I) {
        let Self { solution, time, velocity_time, blocks, runs } = self;
        let times = (time, velocity_time);
        for (block, run) in blocks.iter().zip(runs) {
            if !fill::<true, _, _, D, TIME, VELOCITY_TIME, POINT>(solution, times, block, run) {
                fill::<false, _, _, D, TIME, VELOCITY_TIME, POINT>(solution, times, block, run);
            }
        }
    }
}

impl<S, T: Real, const D: usize, const TIME: usize, const VELOCITY_TIME: usize, const POINT: usize>
    StateAtPoints<T, D> for StagedStates<S, T, TIME, VELOCITY_TIME, POINT>
where
    S: StateStages<T, D, TIME, VELOCITY_TIME, POINT>,
{
    fn evaluate(&self, t: T, velocity_time: T, first: usize, runs: &mut [StateRun<T, D>]) {
        let blocks = &self.blocks[first..first + runs.len()];
        let time = self.solution.state_time(t);
        let velocity_time = self.solution.velocity_time(velocity_time);
        let (time, velocity_time) = (&time, &velocity_time);
        let solution = &self.solution;
        widest(BlocksOfStates { solution, time, velocity_time, blocks, runs });
    }

    fn bytes_per_point(&self) -> usize {
        POINT * size_of::<T>()
    }
}

/// Returns whether all stresses are numbers. A function of its own tells the compiler that `block` and `run` do not overlap.
#[inline(always)]
fn fill<
    const NEAR: bool,
    S,
    T: Real,
    const D: usize,
    const TIME: usize,
    const VELOCITY_TIME: usize,
    const POINT: usize,
>(
    solution: &S,
    (time, velocity_time): (&[T; TIME], &[T; VELOCITY_TIME]),
    block: &[[T; BLOCK]; POINT],
    run: &mut StateRun<T, D>,
) -> bool
where
    S: StateStages<T, D, TIME, VELOCITY_TIME, POINT>,
{
    let mut numbers = true;
    for n in 0..BLOCK {
        let state = solution.state_staged::<NEAR>(time, velocity_time, &point(block, n));
        run.put(n, &state);
        numbers &= state.P.iter().fold(true, |all, value| all & value.is_number());
    }
    numbers
}

/// The positions of points, for solutions that keep no other values.
pub struct PlainPoints<'a, S: ?Sized, T, const D: usize> {
    /// The solution.
    pub solution: &'a S,
    /// The points.
    pub X: Vec<SVector<T, D>>,
}

impl<S, T: Real, const D: usize> BodyForceAtPoints<T, D> for PlainPoints<'_, S, T, D>
where
    S: Solution<T, D> + ?Sized,
{
    fn evaluate(&self, t: T, first: usize, b: &mut [SVector<T, D>]) {
        let X = &self.X[first..first + b.len()];
        b.iter_mut().zip(X).for_each(|(b, X)| *b = self.solution.body_force(X, t));
    }

    fn of_time(&self, t: T, values: &mut Vec<T>) {
        values.push(t);
    }

    fn evaluate_of(&self, time: &[T], points: &[u32], b: &mut [SVector<T, D>]) {
        let &[t] = time else { panic!("one value of the time is needed, not {}", time.len()) };
        for (&n, b) in points.iter().zip(b) {
            *b = self.solution.body_force(&self.X[n as usize], t);
        }
    }

    fn len(&self) -> usize {
        self.X.len()
    }

    fn bytes_per_point(&self) -> usize {
        size_of::<SVector<T, D>>()
    }
}

impl<S, T: Real, const D: usize> StateAtPoints<T, D> for PlainPoints<'_, S, T, D>
where
    S: Solution<T, D> + ?Sized,
{
    fn evaluate(&self, t: T, velocity_time: T, first: usize, runs: &mut [StateRun<T, D>]) {
        let blocks = self.X.chunks(BLOCK).skip(first);
        assert!(blocks.len() >= runs.len(), "there are {} points", self.X.len());
        for (X, run) in blocks.zip(runs) {
            for n in 0..BLOCK {
                let X = &X[n.min(X.len() - 1)];
                let state = State {
                    u: self.solution.displacement(X, t),
                    v: self.solution.velocity(X, velocity_time),
                    F: self.solution.deformation_gradient(X, t),
                    P: self.solution.first_piola_kirchhoff(X, t),
                };
                run.put(n, &state);
            }
        }
    }

    fn bytes_per_point(&self) -> usize {
        size_of::<SVector<T, D>>()
    }
}

impl<S, T: Real, const D: usize> InternalAtPoints<T> for PlainPoints<'_, S, T, D>
where
    S: Solution<T, D> + ?Sized,
{
    fn evaluate(&self, t: T, points: Range<usize>) -> Vec<Vec<T>> {
        self.X[points].iter().map(|X| self.solution.internal(X, t)).collect()
    }
}
