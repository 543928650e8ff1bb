//! One time step: the kernels, one instance for every combination of dimension, weights, integrator and law.

use std::array;
use std::sync::{Mutex, PoisonError};

use nalgebra::{RealField, SMatrix, SVector};

use crate::bands::{Bands, Cut};
use crate::block::{BLOCK, Block, Copies};
use crate::body_force::{AtTime, BodyForce};
use crate::fault::{Fault, Planted};
use crate::grid::{Grid, Layout};
use crate::material::Law;
use crate::parallel::{each_chunk, each_chunk_of_three};
use crate::particles::Particles;
use crate::simd::{Loop, Vectors, dispatch};
use crate::solution::{Acceleration, Reprojection, Solution, Velocity, VelocityAndAcceleration};
use crate::tensor::{determinant, product, real};
use crate::transfer::{Deposits, Gathered, Node};
use crate::weights::{HALF_SIZE_LIMIT, Rule, WIDE, first_layer, is_wide};

/// Particles handed to a thread at a time; fixed, so that nothing depends on the number of threads.
const CHUNK: usize = 1024;

/// What the kernels know of the grid and of time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Constants<T, const D: usize> {
    lower: SVector<T, D>,
    upper: SVector<T, D>,
    pub(crate) inverse_spacing: T,
    pub(crate) strides: [usize; D],
    bands: Cut,
    pub(crate) time_step: T,
    /// Nodes with less mass than this are taken to be empty.
    least_mass: T,
    pub(crate) planted: Planted,
}

impl<T: RealField + Copy, const D: usize> Constants<T, D> {
    pub(crate) fn new(
        grid: &Grid<T, D>,
        layout: &Layout<D>,
        bands: &Bands,
        time_step: T,
        least_particle_mass: T,
    ) -> Self {
        Self {
            lower: grid.lower,
            upper: grid.upper(),
            inverse_spacing: grid.spacing.recip(),
            strides: layout.strides,
            bands: bands.cut(),
            time_step,
            // Weights below the square of the rounding error only come about by rounding.
            least_mass: least_particle_mass * T::default_epsilon() * T::default_epsilon(),
            planted: Planted::here(),
        }
    }

    /// Position in cells, from the lower corner.
    #[inline(always)]
    pub(crate) fn in_cells(&self, x: &SVector<T, D>) -> [T; D] {
        array::from_fn(|a| (x[a] - self.lower[a]) * self.inverse_spacing)
    }

    /// `(I + dt L) F`, for `L` per cell.
    #[inline(always)]
    pub(crate) fn stretch(&self, L: &SMatrix<T, D, D>, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        let change = L * (self.time_step * self.inverse_spacing);
        if self.planted.is(Fault::AdditiveStretch) {
            return F + change;
        }
        if self.planted.is(Fault::GradientTransposed) {
            return F + product(&change.transpose(), F);
        }
        F + product(&change, F)
    }

    /// The reciprocal of a node's mass, or zero for a node that no particle reaches.
    #[inline(always)]
    pub(crate) fn inverse_mass(&self, node: &Node<T, D>) -> T {
        if node.mass() > self.least_mass { node.mass().recip() } else { T::zero() }
    }

    /// Whether a particle is a deformed body within the grid that may stay in its band; nearly all are, and it takes one
    /// branch to know.
    #[inline(always)]
    pub(crate) fn is_well<R, const W: usize>(
        &self,
        rule: R,
        home: u32,
        x: &SVector<T, D>,
        F: &SMatrix<T, D, D>,
    ) -> bool
    where
        R: Rule<T, D, W>,
    {
        let l: [T; D] = array::from_fn(|a| rule.half_size(a, F[(a, a)]));
        let mut well = determinant(F) > T::zero();
        let mut wide = false;
        for a in 0..D {
            well &=
                (x[a] >= self.lower[a]) & (x[a] <= self.upper[a]) & (l[a] <= real(HALF_SIZE_LIMIT));
            wide |= is_wide(l[a]);
        }
        let edge = (x[D - 1] - self.lower[D - 1]) * self.inverse_spacing - l[D - 1];
        let width = if wide { WIDE } else { W };
        let (first, end) = self.bands.range(home, width);
        well & (edge >= real(first)) & (edge < real(end))
    }

    /// What comes to light at a particle that may not be [well](Self::is_well).
    pub(crate) fn judge<R, const W: usize>(
        &self,
        rule: R,
        home: u32,
        x: &SVector<T, D>,
        F: &SMatrix<T, D, D>,
        particle: usize,
    ) -> Outcome
    where
        R: Rule<T, D, W>,
    {
        if self.is_well(rule, home, x, F) {
            return Outcome::default();
        }
        let failure = trouble(&rule, self, x, F).map(|trouble| (trouble, particle));
        Outcome { failure, resort: failure.is_none() }
    }

    /// Adds to the piece of the grid that starts at node `first` what `state(run, ids, deposits)` states for each block of
    /// particles.
    #[expect(clippy::too_many_arguments, reason = "the arrays of a band's particles")]
    fn scatter<R, const W: usize>(
        &self,
        rule: R,
        x: &[SVector<T, D>],
        F: &[SMatrix<T, D, D>],
        piece: &mut [Node<T, D>],
        first: usize,
        ids: &[u32],
        state: impl Fn(&mut Copies<T, D>, &[u32], &mut Deposits<T, D, BLOCK>),
    ) where
        R: Rule<T, D, W>,
    {
        let mut copies = Copies::new();
        let mut block = Block::new();
        let mut deposits = Deposits::zero();
        for ids in ids.chunks(BLOCK) {
            copies.pick(ids, x, F);
            block.weigh(self, rule, copies.run());
            if self.planted.is(Fault::LastNodeSkipped) {
                block.skip_last_node(self, &copies.x);
            }
            state(&mut copies, ids, &mut deposits);
            block.scatter(&self.strides, piece, first, &deposits, ids.len());
        }
    }

    /// What a node beyond a wall gives to its mirror image.
    #[inline(always)]
    pub(crate) fn ghost(&self, mut ghost: Node<T, D>) -> Node<T, D> {
        if self.planted.is(Fault::GhostMassLost) {
            ghost.values[2 * D] = T::zero();
        }
        ghost
    }

    /// What a wall across `axis` does to a node on it.
    #[inline(always)]
    pub(crate) fn clear(&self, node: &mut Node<T, D>, axis: usize) {
        let kept = *node;
        node.clear(axis);
        if self.planted.is(Fault::WallsKeepVelocity) {
            node.values[axis] = kept.values[axis];
        }
        if self.planted.is(Fault::WallsKeepAcceleration) {
            node.values[D + axis] = kept.values[D + axis];
        }
    }

    /// Number of cells along each axis.
    pub(crate) fn upper_in_cells(&self) -> [T; D] {
        self.in_cells(&self.upper)
    }

    /// Edge of a cell.
    pub(crate) fn spacing(&self) -> T {
        self.inverse_spacing.recip()
    }

    /// Ends of the grid along an axis.
    pub(crate) fn range(&self, axis: usize) -> (T, T) {
        (self.lower[axis], self.upper[axis])
    }

    /// The first axis along which `x` is not within the grid.
    pub(crate) fn axis_outside(&self, x: &SVector<T, D>) -> Option<usize> {
        (0..D).find(|&a| !(x[a] >= self.lower[a] && x[a] <= self.upper[a]))
    }
}

/// What is wrong with a particle, worst first: where one particle is inverted, others may follow in the same step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Trouble {
    Inverted,
    NotFinite,
    LeftGrid,
    TooLarge,
}

/// What came to light in a pass over the particles.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Outcome {
    /// The worst trouble, and the first particle that is in it.
    pub(crate) failure: Option<(Trouble, usize)>,
    /// Whether a particle no longer fits its band.
    resort: bool,
}

impl Outcome {
    /// Whether nothing came to light.
    pub(crate) fn is_nothing(self) -> bool {
        self.failure.is_none() && !self.resort
    }

    pub(crate) fn merge(self, other: Self) -> Self {
        let failure = match (self.failure, other.failure) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        };
        Self { failure, resort: self.resort || other.resort }
    }
}

/// What came to light on several threads; in which order does not matter.
#[derive(Debug, Default)]
pub(crate) struct Found(Mutex<Outcome>);

impl Found {
    pub(crate) fn add(&self, outcome: Outcome) {
        if !outcome.is_nothing() {
            let mut found = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            *found = found.merge(outcome);
        }
    }

    pub(crate) fn all(self) -> Outcome {
        self.0.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Everything that a step reads and changes.
#[derive(Debug)]
pub(crate) struct State<T, const D: usize> {
    pub(crate) particles: Particles<T, D>,
    /// Mass and volume of every particle, where all have the same.
    pub(crate) alike: Option<(T, T)>,
    pub(crate) constants: Constants<T, D>,
    pub(crate) layout: Layout<D>,
    pub(crate) bands: Bands,
    pub(crate) nodes: Vec<Node<T, D>>,
    /// USF: F at the end of the step, while the weights still need F at its start.
    pub(crate) F_next: Vec<SMatrix<T, D, D>>,
    /// MUSL: velocities projected from the updated particles, one per node.
    pub(crate) reprojected: Vec<Node<T, D>>,
    /// USL: the grid of the step to come while particles add to it.
    pub(crate) next: Vec<Node<T, D>>,
    /// USL: whether `nodes` has velocities and accelerations of the step to come, with no factor on the latter.
    pub(crate) is_ahead: bool,
    /// Room for what the body force needs of the time.
    pub(crate) of_time: Vec<T>,
}

/// A kernel: takes the state, the body force, the times at the start of the step and at its end, and a factor on all
/// accelerations of this step.
pub(crate) type Kernel<T, const D: usize> =
    Box<dyn Fn(&mut State<T, D>, &dyn BodyForce<T, D>, (T, T), T) -> Outcome + Send + Sync>;

/// MUSL: as USL, but F updated with velocities projected anew from the updated particles.
pub(crate) fn step_musl<T, R, L, const D: usize, const W: usize>(
    s: &mut State<T, D>,
    (rule, law): (R, L),
    body_force: &dyn BodyForce<T, D>,
    (t, _): (T, T),
    scale: T,
) -> Outcome
where
    T: RealField + Copy,
    R: Rule<T, D, W>,
    L: Law<T>,
{
    s.deposit(rule, law, body_force, (t, scale));
    finish_musl(s, rule)
}

/// MUSL after the solution on the grid.
#[inline(never)]
fn finish_musl<T, R, const D: usize, const W: usize>(s: &mut State<T, D>, rule: R) -> Outcome
where
    T: RealField + Copy,
    R: Rule<T, D, W>,
{
    let State { particles, constants, nodes, bands, layout, reprojected, .. } = s;
    let (nodes, c) = (&nodes[..], *constants);
    let Particles { x, v, F, mass, .. } = particles;
    each_chunk(v, CHUNK, &|chunk, v| {
        let (mut copies, mut block) = (Copies::new(), Block::new());
        let (x, F) = (&x[chunk * CHUNK..], &F[chunk * CHUNK..]);
        for ((v, x), F) in v.chunks_mut(BLOCK).zip(x.chunks(BLOCK)).zip(F.chunks(BLOCK)) {
            copies.copy(x, F);
            block.weigh(&c, rule, copies.run());
            let gathered = &mut [Gathered::zero(); BLOCK][..x.len()];
            block.gather(&c.strides, nodes, x.len(), &mut *gathered);
            for (v, gathered) in v.iter_mut().zip(gathered) {
                *v += gathered.acceleration * c.time_step;
            }
        }
    });
    let solution = Solution::new(layout, &c, Reprojection { nodes });
    solution.scatter(bands, reprojected, &|piece, first, ids| {
        c.scatter(rule, x, F, piece, first, ids, |_, ids, deposits| {
            deposits.take_momenta(ids, mass, v);
        });
    });
    let reprojected = if c.planted.is(Fault::NoReprojection) { nodes } else { &reprojected[..] };
    let outcome = advance(particles, bands, c, rule, |block, gathered, _, x, _, F| {
        block.gather(&c.strides, nodes, x.len(), &mut *gathered);
        for (x, gathered) in x.iter_mut().zip(&*gathered) {
            *x += gathered.velocity * c.time_step;
        }
        block.gather(&c.strides, reprojected, x.len(), &mut *gathered);
        for (F, gathered) in F.iter_mut().zip(gathered) {
            *F = c.stretch(&gathered.velocity_gradient, F);
        }
    });
    s.resort_if(outcome, rule)
}

/// USF: F updated first, with the start-of-step grid velocity, and stress from the updated F.
pub(crate) fn step_usf<T, R, L, const D: usize, const W: usize>(
    s: &mut State<T, D>,
    (rule, law): (R, L),
    body_force: &dyn BodyForce<T, D>,
    (t, _): (T, T),
    scale: T,
) -> Outcome
where
    T: RealField + Copy,
    R: Rule<T, D, W>,
    L: Law<T>,
{
    s.deposit_momentum(rule);
    let outcome = s.stretch_first(rule);
    if outcome.failure.is_some() {
        std::mem::swap(&mut s.particles.F, &mut s.F_next);
        return outcome;
    }
    s.deposit_force(rule, law, body_force, (t, scale));
    finish_usf(s, rule)
}

/// USF after the solution on the grid.
#[inline(never)]
fn finish_usf<T, R, const D: usize, const W: usize>(s: &mut State<T, D>, rule: R) -> Outcome
where
    T: RealField + Copy,
    R: Rule<T, D, W>,
{
    let State { particles, constants, nodes, bands, F_next, .. } = s;
    let (nodes, c) = (&nodes[..], *constants);
    let outcome = advance(particles, bands, c, rule, |block, gathered, first, x, v, F| {
        block.gather(&c.strides, nodes, x.len(), &mut *gathered);
        for ((x, v), gathered) in x.iter_mut().zip(v).zip(gathered) {
            *v += gathered.acceleration * c.time_step;
            *x += gathered.velocity * c.time_step;
        }
        F.copy_from_slice(&F_next[first..first + F.len()]);
    });
    s.resort_if(outcome, rule)
}

/// Calls `update(weights, room for what is gathered, first id, x, v, F)` for every block of particles, then looks whether each is well and still
/// fits its band.
fn advance<T, R, const D: usize, const W: usize>(
    particles: &mut Particles<T, D>,
    bands: &Bands,
    c: Constants<T, D>,
    rule: R,
    update: impl Fn(
        &Block<T, D, W>,
        &mut [Gathered<T, D>],
        usize,
        &mut [SVector<T, D>],
        &mut [SVector<T, D>],
        &mut [SMatrix<T, D, D>],
    ) + Sync,
) -> Outcome
where
    T: RealField + Copy,
    R: Rule<T, D, W>,
{
    let Particles { x, v, F, .. } = particles;
    let (home, found) = (bands.home(), Found::default());
    each_chunk_of_three((x, v, F), CHUNK, &|chunk, x, v, F| {
        let mut outcome = Outcome::default();
        let (mut copies, mut block) = (Copies::new(), Block::new());
        let mut gathered = [Gathered::zero(); BLOCK];
        let blocks = x
            .chunks_mut(BLOCK)
            .zip(v.chunks_mut(BLOCK))
            .zip(F.chunks_mut(BLOCK))
            .zip(home[chunk * CHUNK..].chunks(BLOCK));
        for (index, (((x, v), F), home)) in blocks.enumerate() {
            let first = chunk * CHUNK + index * BLOCK;
            copies.copy(x, F);
            if c.planted.is(Fault::WeightsOfNewPosition) {
                for (x, v) in copies.x.iter_mut().zip(&*v) {
                    *x += v * c.time_step;
                }
            }
            block.weigh(&c, rule, copies.run());
            update(&block, &mut gathered[..x.len()], first, x, v, F);
            let mut all_well = true;
            let home_of = home.iter().copied();
            dispatch(Check { c: &c, rule, home: home_of, x, F, all_well: &mut all_well });
            if all_well {
                continue;
            }
            for (k, ((x, F), &home)) in x.iter().zip(F).zip(home).enumerate() {
                outcome = outcome.merge(c.judge(rule, home, x, F, first + k));
            }
        }
        found.add(outcome);
    });
    found.all()
}

/// What is wrong with a particle, if anything.
#[inline(always)]
pub(crate) fn trouble<T, R, const D: usize, const W: usize>(
    rule: &R,
    c: &Constants<T, D>,
    x: &SVector<T, D>,
    F: &SMatrix<T, D, D>,
) -> Option<Trouble>
where
    T: RealField + Copy,
    R: Rule<T, D, W>,
{
    let J = determinant(F);
    let l = SVector::<T, D>::from_fn(|a, _| rule.half_size(a, F[(a, a)]));
    let is_deformation = J > T::zero() && J.is_finite();
    if is_deformation && c.axis_outside(x).is_none() && axis_too_large(&l).is_none() {
        return None;
    }
    Some(if J <= T::zero() {
        Trouble::Inverted
    } else if !J.is_finite() || x.iter().any(|x| !x.is_finite()) {
        Trouble::NotFinite
    } else if c.axis_outside(x).is_some() {
        Trouble::LeftGrid
    } else {
        Trouble::TooLarge
    })
}

/// The first axis along which a half-size, in cells, is beyond what the weights support.
#[inline(always)]
pub(crate) fn axis_too_large<T: RealField + Copy, const D: usize>(
    l: &SVector<T, D>,
) -> Option<usize> {
    (0..D).find(|&a| l[a] > real(HALF_SIZE_LIMIT))
}

impl<T: RealField + Copy, const D: usize> State<T, D> {
    /// Sorts the particles into bands, if the last pass found that to be due.
    pub(crate) fn resort_if<R, const W: usize>(&mut self, outcome: Outcome, rule: R) -> Outcome
    where
        R: Rule<T, D, W>,
    {
        if outcome.resort && outcome.failure.is_none() {
            self.sort(rule);
        }
        outcome
    }

    /// Sorts the particles into bands.
    #[inline(never)]
    pub(crate) fn sort<R, const W: usize>(&mut self, rule: R)
    where
        R: Rule<T, D, W>,
    {
        let (c, Particles { x, F, .. }) = (self.constants, &self.particles);
        self.bands.sort(&self.layout, &|p| {
            let xi = c.in_cells(&x[p]);
            let layer = |a| first_layer(xi[a], rule.half_size(a, F[p][(a, a)]));
            (0..D).map(|a| layer(a) * c.strides[a]).sum()
        });
    }

    /// Particles to grid: mass, momentum and force, and from them velocities and accelerations.
    #[inline(never)]
    pub(crate) fn deposit<R, L, const W: usize>(
        &mut self,
        rule: R,
        law: L,
        body_force: &dyn BodyForce<T, D>,
        (t, scale): (T, T),
    ) where
        R: Rule<T, D, W>,
        L: Law<T>,
    {
        let Self { particles, constants, layout, bands, nodes, of_time, .. } = self;
        let Particles { X, x, v, F, mass, volume, .. } = &*particles;
        let c = *constants;
        let forcing = Forcing::new(body_force, X, t, &c, of_time);
        let solution = Solution::new(layout, &c, VelocityAndAcceleration { scale });
        solution.scatter(bands, nodes, &|piece, first, ids| {
            c.scatter(rule, x, F, piece, first, ids, |copies, ids, deposits| {
                forcing.evaluate(ids, &copies.x, &mut deposits.b);
                deposits.take(ids, mass, volume);
                for (k, &p) in ids.iter().enumerate() {
                    deposits.set_level(&c, k, &v[p as usize]);
                }
                copies.run().stress(&c, law, deposits);
            });
        });
    }

    /// USF, first pass: velocities at the start of the step on the grid.
    #[inline(never)]
    fn deposit_momentum<R, const W: usize>(&mut self, rule: R)
    where
        R: Rule<T, D, W>,
    {
        let Self { particles, constants, layout, bands, nodes, .. } = self;
        let Particles { x, v, F, mass, .. } = &*particles;
        let c = *constants;
        let solution = Solution::new(layout, &c, Velocity);
        solution.scatter(bands, nodes, &|piece, first, ids| {
            c.scatter(rule, x, F, piece, first, ids, |_, ids, deposits| {
                deposits.take_momenta(ids, mass, v);
            });
        });
    }

    /// USF, second pass: F at the end of the step, kept beside the old one.
    #[inline(never)]
    fn stretch_first<R, const W: usize>(&mut self, rule: R) -> Outcome
    where
        R: Rule<T, D, W>,
    {
        let Self { particles, constants, nodes, F_next, .. } = self;
        let (nodes, c) = (&nodes[..], *constants);
        let Particles { x, F, .. } = &*particles;
        let found = Found::default();
        each_chunk(F_next, CHUNK, &|chunk, F_next| {
            let mut outcome = Outcome::default();
            let (mut copies, mut block) = (Copies::new(), Block::new());
            let (x, F) = (&x[chunk * CHUNK..], &F[chunk * CHUNK..]);
            let blocks = F_next.chunks_mut(BLOCK).zip(x.chunks(BLOCK)).zip(F.chunks(BLOCK));
            for (index, ((F_next, x), F)) in blocks.enumerate() {
                copies.copy(x, F);
                block.weigh(&c, rule, copies.run());
                let gathered = &mut [Gathered::zero(); BLOCK][..x.len()];
                block.gather(&c.strides, nodes, x.len(), &mut *gathered);
                let first = chunk * CHUNK + index * BLOCK;
                for (k, (((F_next, gathered), x), F)) in
                    F_next.iter_mut().zip(gathered).zip(x).zip(F).enumerate()
                {
                    *F_next = c.stretch(&gathered.velocity_gradient, F);
                    if let Some(trouble) = trouble(&rule, &c, x, F_next) {
                        let failure = Some((trouble, first + k));
                        outcome = outcome.merge(Outcome { failure, ..Outcome::default() });
                    }
                }
            }
            found.add(outcome);
        });
        found.all()
    }

    /// USF, third pass: force on the grid, from the updated F with the weights of the old one, and from that accelerations and
    /// the velocities at the end of the step.
    #[inline(never)]
    fn deposit_force<R, L, const W: usize>(
        &mut self,
        rule: R,
        law: L,
        body_force: &dyn BodyForce<T, D>,
        (t, scale): (T, T),
    ) where
        R: Rule<T, D, W>,
        L: Law<T>,
    {
        let Self { particles, constants, layout, bands, nodes, F_next, of_time, .. } = self;
        let Particles { X, x, F, mass, volume, .. } = &*particles;
        let (c, F_next) = (*constants, &F_next[..]);
        let forcing = Forcing::new(body_force, X, t, &c, of_time);
        let solution = Solution::new(layout, &c, Acceleration { scale });
        solution.scatter(bands, nodes, &|piece, first, ids| {
            c.scatter(rule, x, F, piece, first, ids, |copies, ids, deposits| {
                forcing.evaluate(ids, &copies.x, &mut deposits.b);
                deposits.take(ids, mass, volume);
                (0..ids.len()).for_each(|k| deposits.set_force(&c, k));
                if !c.planted.is(Fault::StressOfOldStretch) {
                    copies.pick_F(ids, F_next);
                }
                copies.run().stress(&c, law, deposits);
            });
        });
    }
}

/// The body force on all particles at one time.
pub(crate) struct Forcing<'a, T, const D: usize> {
    /// `None` where there is nothing to evaluate.
    body_force: Option<&'a dyn BodyForce<T, D>>,
    X: &'a [SVector<T, D>],
    time: AtTime<'a, T>,
    at_current: bool,
}

impl<'a, T: RealField + Copy, const D: usize> Forcing<'a, T, D> {
    /// At the reference positions `X`; `values` is room for what is needed of the time.
    pub(crate) fn new(
        body_force: &'a dyn BodyForce<T, D>,
        X: &'a [SVector<T, D>],
        t: T,
        c: &Constants<T, D>,
        values: &'a mut Vec<T>,
    ) -> Self {
        let absent = body_force.is_absent() || c.planted.is(Fault::NoBodyForce);
        let t = if c.planted.is(Fault::LateBodyForce) { t + c.time_step } else { t };
        values.clear();
        if !absent {
            body_force.of_time(t, values);
        }
        Self {
            body_force: (!absent).then_some(body_force),
            X,
            time: AtTime { t, values },
            at_current: c.planted.is(Fault::BodyForceAtCurrentPosition),
        }
    }

    /// Writes into `b` the force per unit mass on the particles `ids`, and nothing where there is none. The particles of the
    /// block are the same.
    pub(crate) fn evaluate(
        &self,
        ids: &[u32],
        x: &[SVector<T, D>; BLOCK],
        b: &mut [SVector<T, D>; BLOCK],
    ) {
        let Some(body_force) = self.body_force else {
            return;
        };
        let b = &mut b[..ids.len()];
        if self.at_current {
            body_force.evaluate(0, &x[..ids.len()], self.time.t, b);
        } else {
            body_force.evaluate_of(ids, self.X, self.time, b);
        }
    }
}

/// Looks whether all of a run of particles are [well](Constants::is_well), each in the band that `home` tells.
pub(crate) struct Check<'a, T, R, H, const D: usize, const W: usize> {
    pub(crate) c: &'a Constants<T, D>,
    pub(crate) rule: R,
    pub(crate) home: H,
    pub(crate) x: &'a [SVector<T, D>],
    pub(crate) F: &'a [SMatrix<T, D, D>],
    pub(crate) all_well: &'a mut bool,
}

impl<T, R, H, const D: usize, const W: usize> Loop for Check<'_, T, R, H, D, W>
where
    T: RealField + Copy,
    R: Rule<T, D, W>,
    H: Iterator<Item = u32>,
{
    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self { c, rule, home, x, F, all_well } = self;
        let mut well = true;
        for ((x, F), home) in x.iter().zip(F).zip(home) {
            well &= c.is_well(rule, home, x, F);
        }
        *all_well = well;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::weights::{FixedBox, Hat, StretchingBox};
    use nalgebra::{Matrix2, Vector2, vector};

    fn constants() -> Constants<f64, 2> {
        let grid =
            Grid { lower: Vector2::zeros(), spacing: 0.5, cells: [6, 60], walls: [[false; 2]; 2] };
        let layout = Layout::new(&grid, 8).unwrap();
        let bands = Bands::new(&layout, 1);
        Constants::new(&grid, &layout, &bands, 0.1, 1.0)
    }

    /// `check(x, F, well)` has to find what is expected, with the band of rows from 13 cells above the lower corner on.
    fn for_all_limits(
        rule: &str,
        F: Matrix2<f64>,
        half_size: f64,
        end: f64,
        check: &dyn Fn(Vector2<f64>, Matrix2<f64>) -> bool,
    ) {
        let at = |edge: f64| 0.5 * (edge + half_size);
        for (y, well) in [
            (at(13.0), true),
            (at(13.0).next_down(), false),
            (at(end), false),
            (at(end).next_down(), true),
        ] {
            assert_eq!(check(vector![1.2, y], F), well, "{rule} {F} {y}");
        }
        for (x, well) in [
            (0.0, true),
            (-5e-324, false),
            (3.0, true),
            (3.0_f64.next_up(), false),
            (f64::NAN, false),
        ] {
            assert_eq!(check(vector![x, 9.0], F), well, "{rule} {F} {x}");
        }
        for bad in [Matrix2::zeros(), Matrix2::from_diagonal(&vector![1.0, -1.0])] {
            assert!(!check(vector![1.2, 9.0], bad), "{rule}");
        }
    }

    #[test]
    fn particles_are_well_up_to_the_limits_of_grid_band_and_box() {
        let c = constants();
        let with = |a: f64, b: f64| Matrix2::from_diagonal(&vector![a, b]);
        let one = with(1.0, 1.0);
        for_all_limits("hat", one, 0.0, 28.0, &|x, F| c.is_well(Hat, 2, &x, &F));
        let fixed = FixedBox(Vector2::repeat(0.25));
        for_all_limits("fixed", one, 0.25, 27.0, &|x, F| c.is_well(fixed, 2, &x, &F));
        let stretching = StretchingBox(Vector2::repeat(0.25));
        let of_box = |x: Vector2<f64>, F: Matrix2<f64>| c.is_well(stretching, 2, &x, &F);
        for (F, half_size, end) in [
            (one, 0.25, 27.0),
            (with(1.0, 2.0), 0.5, 27.0),
            // Along whichever axis it is wide, the stencil has six rows.
            (with(1.0, 3.0), 0.75, 24.0),
            (with(3.0, 1.0), 0.25, 24.0),
            (with(1.0, 8.0), 2.0, 24.0),
            (with(8.0, 1.0), 0.25, 24.0),
        ] {
            for_all_limits("stretching", F, half_size, end, &of_box);
        }
        for F in [with(8.125, 1.0), with(1.0, 8.125)] {
            assert!(!of_box(vector![1.2, 9.0], F));
        }
        // The lowest and the highest band reach over the ends of the grid.
        for (home, y, well) in
            [(0, 0.0, true), (0, -5e-324, false), (7, 30.0, true), (7, 30.0_f64.next_up(), false)]
        {
            assert_eq!(c.is_well(Hat, home, &vector![1.2, y], &one), well, "{home} {y}");
        }
    }

    #[test]
    fn a_particle_that_left_its_band_is_sorted_anew_and_one_in_trouble_stops_the_run() {
        let c = constants();
        let one = Matrix2::identity();
        let judge = |y: f64, F: &Matrix2<f64>| c.judge(Hat, 2, &vector![1.2, y], F, 41);
        assert!(judge(9.0, &one).is_nothing());
        let moved = judge(15.0, &one);
        assert!(moved.resort && moved.failure.is_none() && !moved.is_nothing());
        let gone = judge(31.0, &one);
        assert_eq!((gone.failure, gone.resort), (Some((Trouble::LeftGrid, 41)), false));
        let inverted = judge(9.0, &-Matrix2::from_diagonal(&vector![1.0, -1.0]));
        assert_eq!(inverted.failure, Some((Trouble::Inverted, 41)));
        assert!(!gone.is_nothing());

        // Whatever the order, the worst is kept, of those alike the first, and that something is to be sorted.
        let other = Outcome { failure: Some((Trouble::LeftGrid, 7)), resort: false };
        for outcomes in [[moved, gone, inverted, other], [other, inverted, gone, moved]] {
            let merged = outcomes.into_iter().fold(Outcome::default(), Outcome::merge);
            assert_eq!((merged.failure, merged.resort), (inverted.failure, true));
            let found = Found::default();
            outcomes.into_iter().for_each(|outcome| found.add(outcome));
            let all = found.all();
            assert_eq!((all.failure, all.resort), (inverted.failure, true));
        }
        assert_eq!(gone.merge(other).failure, other.failure);
        assert!(!gone.merge(other).resort && moved.merge(Outcome::default()).resort);
        assert!(Found::default().all().is_nothing());
    }
}
