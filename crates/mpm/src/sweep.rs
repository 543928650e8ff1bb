//! Stress last, in one pass over the particles a step: while a particle lies in the cache it takes over what the grid
//! tells of this step and gives to the grid of the next one.
//!
//! Reading and writing particles is what limits a step's speed; two passes, one from and one to the grid, would read them
//! twice. The sums are those of two passes, in the same order, so that a run may be taken up between any two steps: what
//! the grid holds by then is formed anew from the particles.

use nalgebra::{RealField, SMatrix, SVector};

use crate::block::{BLOCK, Block};
use crate::body_force::BodyForce;
use crate::fault::Fault;
use crate::material::Law;
use crate::particles::Particles;
use crate::partition::Share;
use crate::simd::{Loop, dispatch};
use crate::step::{Constants, Forcing, Found, GiveSlope, Outcome, State, fold_ghosts};
use crate::transfer::{Deposit, Gathered, Node};
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
        let mut block = Block::<T, D, W>::new(c.planted);
        let mut gathered = [Gathered::zero(); BLOCK];
        let mut deposits = [Deposit::zero(); BLOCK];
        let mut b = [SVector::zeros(); BLOCK];
        for (index, ids) in elements.numbers().chunks(BLOCK).enumerate() {
            let place = index * BLOCK;
            dispatch(Take { c, block: &mut block, elements: &mut elements, place, ids });
            block.weigh(c, rule);
            block.gather(&c.strides, nodes, &mut gathered[..ids.len()]);
            forcing.evaluate(ids, &block, &mut b);
            dispatch(Follow {
                c,
                block: &mut block,
                elements: &mut elements,
                place,
                ids,
                gathered: &gathered,
                mass,
                volume,
                b: &b,
                deposits: &mut deposits,
            });
            block.weigh(c, rule);
            let mut all_well = true;
            dispatch(Check { c, rule, band, block: &block, all_well: &mut all_well });
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
            block.stress(c, law);
            dispatch(GiveSlope { c, block: &block, ids, volume, deposits: &mut deposits });
            block.scatter(&c.strides, piece, first, &deposits[..ids.len()]);
        }
        outcome
    }
}

/// Takes a run of a band's particles.
struct Take<'a, 'b, T, const D: usize, const W: usize> {
    c: &'a Constants<T, D>,
    block: &'a mut Block<T, D, W>,
    elements: &'a mut Elements<'b, T, D>,
    /// Of the first particle within the band.
    place: usize,
    ids: &'a [u32],
}

impl<T: RealField + Copy, const D: usize, const W: usize> Loop for Take<'_, '_, T, D, W> {
    #[inline(always)]
    fn run(self) {
        let Self { c, block, elements, place, ids } = self;
        for k in 0..ids.len().min(BLOCK) {
            let (x, v, F) = elements.get(place + k);
            let ahead = c.planted.is(Fault::WeightsOfNewPosition);
            block.put(k, &if ahead { *x + *v * c.time_step } else { *x }, F);
        }
    }
}

/// Moves and stretches particles as the grid tells, and states what mass, momentum and body force they give to it next.
struct Follow<'a, 'b, T, const D: usize, const W: usize> {
    c: &'a Constants<T, D>,
    block: &'a mut Block<T, D, W>,
    elements: &'a mut Elements<'b, T, D>,
    place: usize,
    ids: &'a [u32],
    gathered: &'a [Gathered<T, D>; BLOCK],
    mass: &'a [T],
    volume: &'a [T],
    b: &'a [SVector<T, D>; BLOCK],
    deposits: &'a mut [Deposit<T, D>; BLOCK],
}

impl<T: RealField + Copy, const D: usize, const W: usize> Loop for Follow<'_, '_, T, D, W> {
    #[inline(always)]
    fn run(self) {
        let Self { c, block, elements, place, ids, gathered, mass, volume, b, deposits } = self;
        let per_volume = c.planted.is(Fault::BodyForcePerVolume);
        for (k, &p) in ids.iter().take(BLOCK).enumerate() {
            let (x, v, F) = elements.get(place + k);
            let gathered = &gathered[k];
            *v += gathered.acceleration() * c.time_step;
            let mut velocity = gathered.velocity();
            if c.planted.is(Fault::PicForFlip) {
                *v = velocity;
            }
            if c.planted.is(Fault::OwnVelocity) {
                velocity = *v;
            }
            *x += c.planted.change(velocity * c.time_step);
            *F = c.stretch(&gathered.velocity_gradient(), F);
            block.put(k, x, F);
            let m = mass[p as usize];
            let factor = if per_volume { volume[p as usize] } else { m };
            deposits[k].level = Node::new(&(*v * m), &(b[k] * factor), m);
        }
    }
}

/// Looks whether all particles of a block are [well](Constants::is_well).
struct Check<'a, T, R, const D: usize, const W: usize> {
    c: &'a Constants<T, D>,
    rule: R,
    band: u32,
    block: &'a Block<T, D, W>,
    all_well: &'a mut bool,
}

impl<T, R, const D: usize, const W: usize> Loop for Check<'_, T, R, D, W>
where
    T: RealField + Copy,
    R: Rule<T, D, W>,
{
    #[inline(always)]
    fn run(self) {
        let Self { c, rule, band, block, all_well } = self;
        let mut well = true;
        for k in 0..BLOCK {
            well &= c.is_well(rule, band, &block.position(k), &block.tensor(k));
        }
        *all_well = well;
    }
}
