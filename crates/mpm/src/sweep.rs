//! Stress last, in one pass over the particles a step: while a particle lies in the cache it takes over what the grid
//! tells of this step and gives to the grid of the next one.
//!
//! Reading and writing particles is what limits a step's speed; two passes, one from and one to the grid, would read them
//! twice. The sums are those of two passes, in the same order, so that a run may be taken up between any two steps: what
//! the grid holds by then is formed anew from the particles.

use nalgebra::{RealField, SMatrix, SVector};

use crate::block::{BLOCK, Block, Run};
use crate::body_force::BodyForce;
use crate::fault::Fault;
use crate::material::Law;
use crate::particles::Particles;
use crate::partition::Share;
use crate::simd::{Quad, Vectors, dispatch};
use crate::step::{Check, Constants, Forcing, Found, Outcome, State, fold_ghosts};
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
        s.deposit(rule, law, body_force, t);
    }
    s.solve(scale);
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
        let Self { particles, constants: c, layout, bands, nodes, next, .. } = self;
        let Particles { X, x, v, F, mass, volume, .. } = particles;
        let forcing = Forcing::new(body_force, X, t_next, c);
        let step = Sweep { c, rule, law, nodes, mass, volume, forcing };
        let found = Found::default();
        let clear = |nodes: &mut [Node<T, D>]| nodes.fill(Node::zero());
        bands.sweep(layout, next, &clear, (x, v, F), &|piece, first, band, elements| {
            found.add(step.band(piece, first, band, elements));
        });
        std::mem::swap(nodes, next);
        fold_ghosts(layout, c, nodes);
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
        let &Self { c, rule, law, nodes, mass, volume, ref forcing } = self;
        let mut outcome = Outcome::default();
        let mut run = Run::new();
        let mut block = Block::<T, D, W>::new();
        let mut deposits = Deposits::zero();
        for (index, ids) in elements.numbers().chunks(BLOCK).enumerate() {
            let place = index * BLOCK;
            deposits.take(ids, mass, volume);
            for k in 0..ids.len() {
                let (x, v, F) = elements.get(place + k);
                let ahead = c.planted.is(Fault::WeightsOfNewPosition);
                run.x[k] = if ahead { *x + *v * c.time_step } else { *x };
                run.F[k] = *F;
            }
            block.weigh(c, rule, &run);
            forcing.evaluate(ids, &run, &mut deposits.b);
            let follow = Follow {
                c,
                time_step: c.time_step,
                per_cell: c.time_step * c.inverse_spacing,
                run: &mut run,
                elements: &mut elements,
                place,
                deposits: &mut deposits,
            };
            block.gather(&c.strides, nodes, ids.len(), follow);
            block.weigh(c, rule, &run);
            let mut all_well = true;
            let home = std::iter::repeat(band);
            let Run { x, F } = &run;
            dispatch(Check { c, rule, home, x, F, all_well: &mut all_well });
            if !all_well {
                for (k, &p) in ids.iter().enumerate() {
                    let (x, _, F) = elements.get(place + k);
                    outcome = outcome.merge(c.judge(rule, band, x, F, p as usize));
                }
            }
            // A particle that has left its band would give to nodes that are another's.
            if !outcome.is_nothing() {
                continue;
            }
            if c.planted.is(Fault::LastNodeSkipped) {
                block.skip_last_node(&c.upper_in_cells());
            }
            run.stress(c, law, &mut deposits);
            block.scatter(&c.strides, piece, first, &deposits, ids.len());
        }
        outcome
    }
}

/// Moves and stretches particles as the grid tells, and states what mass, momentum and body force they give to it next.
struct Follow<'a, 'b, T, const D: usize> {
    c: &'a Constants<T, D>,
    time_step: T,
    /// Time step over the edge of a cell.
    per_cell: T,
    run: &'a mut Run<T, D>,
    elements: &'a mut Elements<'b, T, D>,
    /// Of the first particle within the band.
    place: usize,
    /// With the forces per mass, which are turned into forces.
    deposits: &'a mut Deposits<T, D, BLOCK>,
}

impl<T: RealField + Copy, const D: usize> Receive<T, D> for Follow<'_, '_, T, D> {
    #[inline(always)]
    fn receive(&mut self, k: usize, gathered: &Gathered<T, D>) {
        let Self { c, run, elements, place, deposits, .. } = self;
        let (x, v, F) = elements.get(*place + k);
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
        (run.x[k], run.F[k]) = (*x, *F);
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
        let Self { time_step, per_cell, run, elements, place, deposits, .. } = self;
        let (x, v, F) = elements.get(*place + k);
        let (Some(x), Some(v), Some(F)) = (
            x.as_mut_slice().first_chunk_mut::<2>(),
            v.as_mut_slice().first_chunk_mut::<2>(),
            F.as_mut_slice().first_chunk_mut::<4>(),
        ) else {
            return;
        };
        let xv = vectors
            .add(Quad([x[0], x[1], v[0], v[1]]), vectors.mul(level, vectors.splat(*time_step)));
        *x = [xv.0[0], xv.0[1]];
        *v = [xv.0[2], xv.0[3]];
        let factor = vectors.splat(*per_cell);
        let old = Quad(*F);
        let along = vectors.mul(vectors.low_twice(slope[0]), factor);
        let across = vectors.mul(vectors.low_twice(slope[D - 1]), factor);
        let stretch = vectors
            .add(vectors.mul(along, vectors.even(old)), vectors.mul(across, vectors.odd(old)));
        let new = vectors.add(old, stretch);
        *F = new.0;
        run.x[k].as_mut_slice().copy_from_slice(&[xv.0[0], xv.0[1]]);
        run.F[k].as_mut_slice().copy_from_slice(&new.0);
        deposits.set_level_in_plane(vectors, k, xv);
    }
}
