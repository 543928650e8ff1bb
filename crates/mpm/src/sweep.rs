//! Stress last, in one pass over the particles a step: while a particle lies in the cache it takes over what the grid
//! tells of this step and gives to the grid of the next one.
//!
//! Reading and writing particles is what limits a step's speed; two passes, one from and one to the grid, would read them
//! twice. The sums are those of two passes, in the same order, so that a run may be taken up between any two steps: what
//! the grid holds by then is formed anew from the particles.

use nalgebra::{RealField, SMatrix, SVector};

use crate::block::{BLOCK, Block, Copies, Run};
use crate::body_force::BodyForce;
use crate::fault::Fault;
use crate::material::Law;
use crate::particles::Particles;
use crate::partition::Share;
use crate::prefetch::prefetch;
use crate::simd::{Quad, Vectors, dispatch};
use crate::solution::{Solution, VelocityAndAcceleration};
use crate::step::{Check, Constants, Forcing, Found, Outcome, State};
use crate::transfer::{Deposits, Gathered, Node, Receive};
use crate::weights::Rule;

/// What a particle's share of the arrays gives: position, velocity and deformation gradient.
type Elements<'a, T, const D: usize> = Share<'a, SVector<T, D>, SVector<T, D>, SMatrix<T, D, D>>;

/// USL, and with it centred differences: stress from `F^n`, F updated with the end-of-step grid velocity.
pub(crate) fn step_usl<T, R, L, const D: usize, const W: usize>(
    s: &mut State<T, D>,
    (rule, law): (R, L),
    body_force: &dyn BodyForce<T, D>,
    (t, t_next): (T, T),
    scale: T,
) -> Outcome
where
    T: RealField + Copy,
    R: Rule<T, D, W>,
    L: Law<T>,
{
    if !s.is_ahead {
        if !s.bands.is_sorted() {
            s.sort(rule);
        }
        s.deposit(rule, law, body_force, (t, scale));
    }
    let outcome = s.sweep(rule, law, body_force, t_next);
    // Where particles change their bands or stop, what they gave in part is of no use.
    s.is_ahead = outcome.is_nothing();
    s.resort_if(outcome, rule)
}

impl<T: RealField + Copy, const D: usize> State<T, D> {
    /// Grid to particles, and particles to the grid of the next step, which is `nodes` from then on.
    #[inline(never)]
    fn sweep<R, L, const W: usize>(
        &mut self,
        rule: R,
        law: L,
        body_force: &dyn BodyForce<T, D>,
        t_next: T,
    ) -> Outcome
    where
        R: Rule<T, D, W>,
        L: Law<T>,
    {
        let Self { particles, constants: c, layout, bands, nodes, next, alike, of_time, .. } = self;
        let Particles { X, x, v, F, mass, volume, .. } = particles;
        let forcing = Forcing::new(body_force, X, t_next, c, of_time);
        let step = Sweep { c, rule, law, nodes, mass, volume, alike: *alike, forcing };
        let found = Found::default();
        let solution = Solution::new(layout, c, VelocityAndAcceleration { scale: T::one() });
        solution.sweep(bands, next, (x, v, F), &|piece, first, band, elements| {
            found.add(step.band(piece, first, band, elements));
        });
        std::mem::swap(nodes, next);
        found.all()
    }
}

/// What all bands read.
struct Sweep<'a, T, R, L, const D: usize> {
    c: &'a Constants<T, D>,
    rule: R,
    law: L,
    /// The grid of this step, solved.
    nodes: &'a [Node<T, D>],
    mass: &'a [T],
    volume: &'a [T],
    alike: Option<(T, T)>,
    /// The body force at the start of the next step.
    forcing: Forcing<'a, T, D>,
}

impl<T: RealField + Copy, R, L: Law<T>, const D: usize> Sweep<'_, T, R, L, D> {
    /// Moves the particles of a band and adds what they then give to its piece of the next step's grid, which starts at
    /// node `first`.
    fn band<const W: usize>(
        &self,
        piece: &mut [Node<T, D>],
        first: usize,
        band: u32,
        mut elements: Elements<'_, T, D>,
    ) -> Outcome
    where
        R: Rule<T, D, W>,
    {
        let mut outcome = Outcome::default();
        let mut copies = Copies::new();
        let deposits = match self.alike {
            Some((mass, volume)) => Deposits::alike(mass, volume),
            None => Deposits::zero(),
        };
        let mut scratch = (Block::new(), deposits);
        for (index, ids) in elements.numbers().chunks(BLOCK).enumerate() {
            let place = index * BLOCK;
            if self.alike.is_none() {
                scratch.1.take(ids, self.mass, self.volume);
            }
            if let Some((x, v, F)) = elements.successive::<BLOCK>(place) {
                let found = self.block(&mut scratch, piece, (first, band), ids, (x, v, F));
                outcome = outcome.merge(found);
                continue;
            }
            for k in 0..ids.len() {
                let (x, v, F) = elements.get(place + k);
                (copies.x[k], copies.v[k], copies.F[k]) = (*x, *v, *F);
            }
            let Copies { x, v, F } = &mut copies;
            let found = self.block(&mut scratch, piece, (first, band), ids, (x, v, F));
            outcome = outcome.merge(found);
            for k in 0..ids.len() {
                let (x, v, F) = elements.get(place + k);
                (*x, *v, *F) = (copies.x[k], copies.v[k], copies.F[k]);
            }
        }
        outcome
    }

    /// The same for a block of particles.
    fn block<const W: usize>(
        &self,
        (block, deposits): &mut (Block<T, D, W>, Deposits<T, D, BLOCK>),
        piece: &mut [Node<T, D>],
        (first, band): (usize, u32),
        ids: &[u32],
        (x, v, F): Lying<'_, T, D>,
    ) -> Outcome
    where
        R: Rule<T, D, W>,
    {
        let &Self { c, rule, law, nodes, ref forcing, .. } = self;
        if c.planted.is(Fault::WeightsOfNewPosition) {
            let ahead = std::array::from_fn(|k| x[k] + v[k] * c.time_step);
            block.weigh(c, rule, Run { x: &ahead, F });
        } else {
            block.weigh(c, rule, Run { x, F });
        }
        forcing.evaluate(ids, x, &mut deposits.b);
        let follow = Follow {
            c,
            time_step: c.time_step,
            per_cell: c.time_step * c.inverse_spacing,
            x,
            v,
            F,
            deposits,
        };
        block.gather(&c.strides, nodes, ids.len(), follow);
        block.weigh(c, rule, Run { x, F });
        let mut all_well = true;
        let home = std::iter::repeat(band);
        dispatch(Check { c, rule, home, x: &x[..ids.len()], F, all_well: &mut all_well });
        if !all_well {
            let mut outcome = Outcome::default();
            for (k, &p) in ids.iter().enumerate() {
                outcome = outcome.merge(c.judge(rule, band, &x[k], &F[k], p as usize));
            }
            // A particle that has left its band would give to nodes that are another's.
            if !outcome.is_nothing() {
                return outcome;
            }
        }
        if c.planted.is(Fault::LastNodeSkipped) {
            block.skip_last_node(c, x);
        }
        Run { x, F }.stress(c, law, deposits);
        block.scatter(&c.strides, piece, first, deposits, ids.len());
        Outcome::default()
    }
}

/// Positions, velocities and deformation gradients of the particles of a block, one after the other.
type Lying<'a, T, const D: usize> = (
    &'a mut [SVector<T, D>; BLOCK],
    &'a mut [SVector<T, D>; BLOCK],
    &'a mut [SMatrix<T, D, D>; BLOCK],
);

/// Moves and stretches particles as the grid tells, and states what mass, momentum and body force they give to it next.
struct Follow<'a, T, const D: usize> {
    c: &'a Constants<T, D>,
    time_step: T,
    /// Time step over the edge of a cell.
    per_cell: T,
    x: &'a mut [SVector<T, D>; BLOCK],
    v: &'a mut [SVector<T, D>; BLOCK],
    F: &'a mut [SMatrix<T, D, D>; BLOCK],
    /// With the forces per mass, which are turned into forces.
    deposits: &'a mut Deposits<T, D, BLOCK>,
}

impl<T: RealField + Copy, const D: usize> Receive<T, D> for Follow<'_, T, D> {
    #[inline(always)]
    fn receive(&mut self, k: usize, gathered: &Gathered<T, D>) {
        let Self { c, deposits, .. } = self;
        let (x, v, F) = (&mut self.x[k], &mut self.v[k], &mut self.F[k]);
        *v += gathered.acceleration * c.time_step;
        let mut velocity = gathered.velocity;
        if c.planted.is(Fault::PicForFlip) {
            *v = velocity;
        }
        if c.planted.is(Fault::OwnVelocity) {
            velocity = *v;
        }
        *x += c.planted.change(velocity * c.time_step);
        *F = c.stretch(&gathered.velocity_gradient, F);
        deposits.set_level(c, k, v);
    }

    #[inline(always)]
    fn receive_quads(
        &mut self,
        vectors: impl Vectors,
        k: usize,
        level: Quad<T>,
        slope: [Quad<T>; D],
    ) {
        // Faults are planted in what is written for all dimensions.
        if D != 2 || self.c.planted.is_any() {
            self.receive(k, &Gathered::new(&level.0, &slope.map(|slope| slope.0)));
            return;
        }
        prefetch(&self.x[k], BLOCK);
        prefetch(&self.v[k], BLOCK);
        prefetch(&self.F[k], BLOCK);
        let Self { time_step, per_cell, deposits, .. } = self;
        let (Some(x), Some(v), Some(F)) = (
            self.x[k].as_mut_slice().first_chunk_mut::<2>(),
            self.v[k].as_mut_slice().first_chunk_mut::<2>(),
            self.F[k].as_mut_slice().first_chunk_mut::<4>(),
        ) else {
            return;
        };
        let xv = vectors
            .add(Quad([x[0], x[1], v[0], v[1]]), vectors.mul(level, vectors.splat(*time_step)));
        *x = [xv.0[0], xv.0[1]];
        *v = [xv.0[2], xv.0[3]];
        let factor = vectors.splat(*per_cell);
        let old = vectors.load(F);
        let along = vectors.mul(vectors.low_twice(slope[0]), factor);
        let across = vectors.mul(vectors.low_twice(slope[D - 1]), factor);
        let stretch = vectors
            .add(vectors.mul(along, vectors.even(old)), vectors.mul(across, vectors.odd(old)));
        *F = vectors.add(old, stretch).0;
        deposits.set_level_in_plane(vectors, k, xv);
    }
}
