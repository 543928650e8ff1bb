//! The body force at points that stay while time goes on.
//!
//! A solver samples `b` at the same reference positions in every step. What depends on the position alone, such as the
//! sines of `pi X` or the profile of a displacement over the radius, is computed once and kept; what depends on the time
//! alone is computed once a call; what is left for each point and time is short, and many points go through it at once.

use crate::{Real, Solution};
use nalgebra::SVector;
use pulp::{Arch, Simd, WithSimd};
use std::array;

/// The body force at many fixed points, as [`Solution::body_force_at`] prepares it.
pub trait BodyForceAtPoints<T: Real, const D: usize>: Send + Sync {
    /// Writes into `b` the body force of the points `first .. first + b.len()` at time `t`.
    ///
    /// The values are those of [`Solution::body_force`] but for rounding: what is done once a point is arranged in
    /// another way than in a single call. Long runs are fastest where `first` is a multiple of [`BLOCK`]; any other split
    /// gives the same values, to the last bit.
    ///
    /// # Panics
    ///
    /// Panics where there are fewer than `first + b.len()` points.
    fn evaluate(&self, t: T, first: usize, b: &mut [SVector<T, D>]);

    /// The number of points.
    fn len(&self) -> usize;

    /// Whether there are no points.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The memory that each point takes, in bytes.
    fn bytes_per_point(&self) -> usize;
}

/// The body force in three stages: what `TIME` values it needs of the time alone, what `POINT` values of the point
/// alone, and how it follows from both. Every generated solution has them.
///
/// ```
/// use mmsmith_solutions::{BodyForceStages, Ring, RingParameters, Solution};
///
/// let ring = Ring::<f64>::new(RingParameters::default())?;
/// let X = [0.6, 0.3].into();
/// let (time, point) = (ring.body_force_time(1e-3), ring.body_force_point(&X));
/// let (staged, single) = (ring.body_force_staged(&time, &point), ring.body_force(&X, 1e-3));
/// assert!((staged - single).norm() < 1e-14 * single.norm());
/// # Ok::<(), mmsmith_solutions::ParameterError>(())
/// ```
pub trait BodyForceStages<T: Real, const D: usize, const TIME: usize, const POINT: usize>:
    Solution<T, D>
{
    /// What depends on the time alone.
    fn body_force_time(&self, t: T) -> [T; TIME];
    /// What depends on the reference position alone.
    fn body_force_point(&self, X: &SVector<T, D>) -> [T; POINT];
    /// The body force per unit mass, from the values of one time and of one point; equal to
    /// [`Solution::body_force`] but for rounding.
    fn body_force_staged(&self, time: &[T; TIME], point: &[T; POINT]) -> SVector<T, D>;
}

/// Points that are evaluated together. Each of the values kept for them is one run of this length, so that a run of
/// points fills the vector registers of any processor, and is no longer than the two cache lines that are read at once:
/// blocks come from memory in the order in which they lie there.
pub const BLOCK: usize = 16;

/// The values kept for the points of a generated solution, in blocks.
pub struct StagedPoints<S, T, const TIME: usize, const POINT: usize> {
    solution: S,
    /// `blocks[n][m][i]`: value `m` of point `n BLOCK + i`. What a last block has to spare repeats its last point.
    blocks: Vec<[[T; BLOCK]; POINT]>,
    len: usize,
}

impl<S, T: Real, const TIME: usize, const POINT: usize> StagedPoints<S, T, TIME, POINT> {
    /// Computes what depends on the points `X` alone.
    #[must_use]
    pub fn new<const D: usize>(solution: S, X: &[SVector<T, D>]) -> Self
    where
        S: BodyForceStages<T, D, TIME, POINT>,
    {
        let blocks = X
            .chunks(BLOCK)
            .map(|points| {
                let mut block = [[T::zero(); BLOCK]; POINT];
                for (i, X) in points.iter().enumerate() {
                    let values = solution.body_force_point(X);
                    block.iter_mut().zip(values).for_each(|(run, value)| run[i] = value);
                }
                for run in &mut block {
                    let last = run[points.len() - 1];
                    run[points.len()..].fill(last);
                }
                block
            })
            .collect();
        StagedPoints { solution, blocks, len: X.len() }
    }
}

/// Point `i` of a block.
#[inline(always)]
fn point<T: Real, const POINT: usize>(block: &[[T; BLOCK]; POINT], i: usize) -> [T; POINT] {
    array::from_fn(|m| block[m][i])
}

/// Blocks of points as loops of fixed length over separate runs. There is an instance of it for each kind of vector
/// registers, and the processor's own is chosen when the program runs; all give the same bits, since nothing is
/// contracted or reordered.
struct WholeBlocks<'a, S, T: Real, const D: usize, const TIME: usize, const POINT: usize> {
    solution: &'a S,
    time: &'a [T; TIME],
    blocks: &'a [[[T; BLOCK]; POINT]],
    b: &'a mut [SVector<T, D>],
}

impl<S, T: Real, const D: usize, const TIME: usize, const POINT: usize> WithSimd
    for WholeBlocks<'_, S, T, D, TIME, POINT>
where
    S: BodyForceStages<T, D, TIME, POINT>,
{
    type Output = ();

    #[inline(always)]
    fn with_simd<I: Simd>(self, _: I) {
        let Self { solution, time, blocks, b } = self;
        for (block, b) in blocks.iter().zip(b.chunks_exact_mut(BLOCK)) {
            let mut components = [[T::zero(); BLOCK]; D];
            for i in 0..BLOCK {
                let value = solution.body_force_staged(time, &point(block, i));
                for d in 0..D {
                    components[d][i] = value[d];
                }
            }
            for (i, b) in b.iter_mut().enumerate() {
                *b = SVector::from_fn(|d, _| components[d][i]);
            }
        }
    }
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
        let time = self.solution.body_force_time(t);
        let one_by_one = |first: usize, b: &mut [SVector<T, D>]| {
            for (n, b) in (first..).zip(b) {
                let point = point(&self.blocks[n / BLOCK], n % BLOCK);
                *b = self.solution.body_force_staged(&time, &point);
            }
        };
        let (before, rest) = b.split_at_mut(b.len().min(first.next_multiple_of(BLOCK) - first));
        let start = first + before.len();
        let (whole, after) = rest.split_at_mut(rest.len() / BLOCK * BLOCK);
        let end = start + whole.len();
        one_by_one(first, before);
        if !whole.is_empty() {
            let blocks = &self.blocks[start / BLOCK..end / BLOCK];
            Arch::new().dispatch(WholeBlocks {
                solution: &self.solution,
                time: &time,
                blocks,
                b: whole,
            });
        }
        one_by_one(end, after);
    }

    fn len(&self) -> usize {
        self.len
    }

    fn bytes_per_point(&self) -> usize {
        POINT * size_of::<T>()
    }
}

/// The positions of points, for solutions that keep nothing else.
pub(crate) struct PlainPoints<'a, S: ?Sized, T, const D: usize> {
    pub(crate) solution: &'a S,
    pub(crate) X: Vec<SVector<T, D>>,
}

impl<S, T: Real, const D: usize> BodyForceAtPoints<T, D> for PlainPoints<'_, S, T, D>
where
    S: Solution<T, D> + ?Sized,
{
    fn evaluate(&self, t: T, first: usize, b: &mut [SVector<T, D>]) {
        let X = &self.X[first..first + b.len()];
        b.iter_mut().zip(X).for_each(|(b, X)| *b = self.solution.body_force(X, t));
    }

    fn len(&self) -> usize {
        self.X.len()
    }

    fn bytes_per_point(&self) -> usize {
        size_of::<SVector<T, D>>()
    }
}
