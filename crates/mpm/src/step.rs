//! One time step: the kernels, one instance for every combination of dimension, weights, integrator and law.

use nalgebra::{RealField, SMatrix, SVector};
use rayon::prelude::*;

use crate::bands::Bands;
use crate::body_force::BodyForce;
use crate::grid::{Grid, Layout};
use crate::material::Law;
use crate::particles::Particles;
use crate::tensor::{determinant, product, real};
use crate::transfer::Node;
use crate::weights::{HALF_SIZE_LIMIT, Rule, WIDE, first_layer, wide_stencil};

/// Particles handed to a thread at a time; fixed, so that nothing depends on the number of threads.
const CHUNK: usize = 1024;

/// What the kernels know of the grid and of time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Constants<T, const D: usize> {
    lower: SVector<T, D>,
    upper: SVector<T, D>,
    inverse_spacing: T,
    strides: [usize; D],
    band_height: usize,
    time_step: T,
    /// Nodes with less mass than this are taken to be empty.
    least_mass: T,
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
            band_height: bands.height(),
            time_step,
            // Weights below the square of the rounding error only come about by rounding.
            least_mass: least_particle_mass * T::default_epsilon() * T::default_epsilon(),
        }
    }

    /// Position in cells, from the lower corner.
    #[inline(always)]
    fn in_cells(&self, x: &SVector<T, D>) -> SVector<T, D> {
        (x - self.lower) * self.inverse_spacing
    }

    /// `(I + dt L) F`, for `L` per cell.
    #[inline(always)]
    fn stretch(&self, L: &SMatrix<T, D, D>, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        F + product(&(L * (self.time_step * self.inverse_spacing)), F)
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
    fn merge(self, other: Self) -> Self {
        let failure = match (self.failure, other.failure) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        };
        Self { failure, resort: self.resort || other.resort }
    }
}

/// Everything that a step reads and changes.
#[derive(Debug)]
pub(crate) struct State<T, const D: usize> {
    pub(crate) particles: Particles<T, D>,
    pub(crate) constants: Constants<T, D>,
    pub(crate) layout: Layout<D>,
    pub(crate) bands: Bands,
    pub(crate) nodes: Vec<Node<T, D>>,
    /// Body force of every particle in this step; empty until a scene has one.
    pub(crate) b: Vec<SVector<T, D>>,
    /// USF: F at the end of the step, while the weights still need F at its start.
    pub(crate) F_next: Vec<SMatrix<T, D, D>>,
    /// MUSL: velocities projected from the updated particles, one per node.
    pub(crate) reprojected: Vec<SVector<T, D>>,
}

/// A kernel: takes the state, the body force, the time at the start of the step and a factor on all accelerations.
pub(crate) type Kernel<T, const D: usize> =
    Box<dyn Fn(&mut State<T, D>, &dyn BodyForce<T, D>, T, T) -> Outcome + Send + Sync>;

/// Evaluates `$body` with `$stencil` bound to the weights of a particle, whichever their number.
macro_rules! with_stencil {
    ($rule:expr, $constants:expr, $x:expr, $F:expr, |$stencil:ident| $body:expr) => {{
        let (xi, l) = ($constants.in_cells($x), $rule.half_size($F));
        if $rule.is_wide(&l) {
            let $stencil = wide_stencil(&xi, &l);
            $body
        } else {
            let $stencil = $rule.stencil(&xi, &l);
            $body
        }
    }};
}

/// USL, and with it centred differences: stress from `F^n`, F updated with the end-of-step grid velocity.
pub(crate) fn step_usl<T, R, L, const D: usize, const W: usize>(
    s: &mut State<T, D>,
    (rule, law): (R, L),
    body_force: &dyn BodyForce<T, D>,
    t: T,
    scale: T,
) -> Outcome
where
    T: RealField + Copy,
    R: Rule<T, D, W>,
    L: Law<T>,
{
    s.evaluate(body_force, t);
    s.deposit(rule, law, body_force.is_absent());
    s.solve(scale);
    finish_usl(s, rule)
}

/// USL after the solution on the grid. A function of its own, since it is the same for every law.
#[inline(never)]
fn finish_usl<T, R, const D: usize, const W: usize>(s: &mut State<T, D>, rule: R) -> Outcome
where
    T: RealField + Copy,
    R: Rule<T, D, W>,
{
    let State { particles, constants, nodes, bands, .. } = s;
    let (nodes, c) = (&nodes[..], *constants);
    let outcome = advance(particles, bands, c, rule, |_, x, v, F| {
        let (velocity, L, a) = with_stencil!(rule, c, x, F, |stencil| {
            stencil.gather(&c.strides, nodes, |n| (n.velocity, n.acceleration))
        });
        *v += a * c.time_step;
        *x += velocity * c.time_step;
        *F = c.stretch(&L, F);
    });
    s.resort_if(outcome, rule)
}

/// MUSL: as USL, but F updated with velocities projected anew from the updated particles.
pub(crate) fn step_musl<T, R, L, const D: usize, const W: usize>(
    s: &mut State<T, D>,
    (rule, law): (R, L),
    body_force: &dyn BodyForce<T, D>,
    t: T,
    scale: T,
) -> Outcome
where
    T: RealField + Copy,
    R: Rule<T, D, W>,
    L: Law<T>,
{
    s.evaluate(body_force, t);
    s.deposit(rule, law, body_force.is_absent());
    s.solve(scale);
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
    v.par_chunks_mut(CHUNK).zip(x.par_chunks(CHUNK)).zip(F.par_chunks(CHUNK)).for_each(
        |((v, x), F)| {
            for ((v, x), F) in v.iter_mut().zip(x).zip(F) {
                let (_, _, a) = with_stencil!(rule, c, x, F, |stencil| {
                    stencil.gather(&c.strides, nodes, |n| (SVector::zeros(), n.acceleration))
                });
                *v += a * c.time_step;
            }
        },
    );
    let add = |piece: &mut [SVector<T, D>], first: usize, p: usize| {
        let momentum = v[p] * mass[p];
        with_stencil!(rule, c, &x[p], &F[p], |stencil| {
            stencil.scatter(
                &c.strides,
                piece,
                first,
                |S, _| momentum * S,
                |node, S, _, along| *node += along * S,
            )
        });
    };
    bands.scatter(layout, reprojected, |node| *node = SVector::zeros(), add);
    layout.fold(reprojected, |image, ghost, flip| *image += flipped(ghost, flip));
    reprojected.par_chunks_mut(CHUNK).zip(nodes.par_chunks(CHUNK)).for_each(|(v, nodes)| {
        for (v, node) in v.iter_mut().zip(nodes) {
            *v *= if node.mass > c.least_mass { node.mass.recip() } else { T::zero() };
        }
    });
    layout.on_walls(reprojected, |v, axis| v[axis] = T::zero());
    layout.unfold(reprojected, flipped);
    let reprojected = &reprojected[..];
    let outcome = advance(particles, bands, c, rule, |_, x, _, F| {
        let (velocity, L) = with_stencil!(rule, c, x, F, |stencil| {
            let (velocity, ..) =
                stencil.gather(&c.strides, nodes, |n| (n.velocity, SVector::zeros()));
            let (_, L, _) = stencil.gather(&c.strides, reprojected, |&v| (v, SVector::zeros()));
            (velocity, L)
        });
        *x += velocity * c.time_step;
        *F = c.stretch(&L, F);
    });
    s.resort_if(outcome, rule)
}

/// USF: F updated first, with the start-of-step grid velocity, and stress from the updated F.
pub(crate) fn step_usf<T, R, L, const D: usize, const W: usize>(
    s: &mut State<T, D>,
    (rule, law): (R, L),
    body_force: &dyn BodyForce<T, D>,
    t: T,
    scale: T,
) -> Outcome
where
    T: RealField + Copy,
    R: Rule<T, D, W>,
    L: Law<T>,
{
    s.evaluate(body_force, t);
    s.deposit_momentum(rule);
    let outcome = s.stretch_first(rule);
    if outcome.failure.is_some() {
        std::mem::swap(&mut s.particles.F, &mut s.F_next);
        return outcome;
    }
    s.deposit_force(rule, law, body_force.is_absent());
    s.solve_acceleration(scale);
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
    let outcome = advance(particles, bands, c, rule, |p, x, v, F| {
        let (velocity, _, a) = with_stencil!(rule, c, x, F, |stencil| {
            stencil.gather(&c.strides, nodes, |n| (n.velocity, n.acceleration))
        });
        *v += a * c.time_step;
        *x += velocity * c.time_step;
        *F = F_next[p];
    });
    s.resort_if(outcome, rule)
}

/// The vector, with one component's sign changed.
#[inline(always)]
fn flipped<T: RealField + Copy, const D: usize>(
    mut v: SVector<T, D>,
    axis: Option<usize>,
) -> SVector<T, D> {
    if let Some(a) = axis {
        v[a] = -v[a];
    }
    v
}

/// Calls `update(id, x, v, F)` for every particle, then looks whether it is well and still fits its band.
fn advance<T, R, const D: usize, const W: usize>(
    particles: &mut Particles<T, D>,
    bands: &Bands,
    c: Constants<T, D>,
    rule: R,
    update: impl Fn(usize, &mut SVector<T, D>, &mut SVector<T, D>, &mut SMatrix<T, D, D>) + Sync,
) -> Outcome
where
    T: RealField + Copy,
    R: Rule<T, D, W>,
{
    let Particles { x, v, F, .. } = particles;
    let chunks = x
        .par_chunks_mut(CHUNK)
        .zip(v.par_chunks_mut(CHUNK))
        .zip(F.par_chunks_mut(CHUNK))
        .zip(bands.home().par_chunks(CHUNK));
    chunks
        .enumerate()
        .map(|(chunk, (((x, v), F), home))| {
            let mut outcome = Outcome::default();
            let particles = x.iter_mut().zip(v).zip(F).zip(home);
            for (k, (((x, v), F), &home)) in particles.enumerate() {
                let p = chunk * CHUNK + k;
                update(p, x, v, F);
                if let Some(trouble) = trouble(&rule, &c, x, F) {
                    let failure = Some((trouble, p));
                    outcome = outcome.merge(Outcome { failure, ..Outcome::default() });
                } else {
                    let l = rule.half_size(F);
                    let xi = c.in_cells(x);
                    let width = if rule.is_wide(&l) { WIDE } else { W };
                    let row = first_layer(xi[D - 1], l[D - 1]);
                    outcome.resort |= !Bands::fits(home, c.band_height, row, width);
                }
            }
            outcome
        })
        .reduce(Outcome::default, Outcome::merge)
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
    if J > T::zero() && c.axis_outside(x).is_none() && axis_too_large(&rule.half_size(F)).is_none()
    {
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
    fn resort_if<R, const W: usize>(&mut self, outcome: Outcome, rule: R) -> Outcome
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
        self.bands.sort(&self.layout, |p| {
            let (xi, l) = (c.in_cells(&x[p]), rule.half_size(&F[p]));
            (0..D).map(|a| first_layer(xi[a], l[a]) * c.strides[a]).sum()
        });
    }

    /// Evaluates the body force at the reference positions.
    fn evaluate(&mut self, body_force: &dyn BodyForce<T, D>, t: T) {
        if body_force.is_absent() {
            return;
        }
        let X = &self.particles.X;
        self.b.resize(X.len(), SVector::zeros());
        self.b
            .par_chunks_mut(CHUNK)
            .zip(X.par_chunks(CHUNK))
            .enumerate()
            .for_each(|(chunk, (b, X))| body_force.evaluate(chunk * CHUNK, X, t, b));
    }

    /// Particles to grid: mass, momentum and force, folded at walls.
    #[inline(never)]
    fn deposit<R, L, const W: usize>(&mut self, rule: R, law: L, no_body_force: bool)
    where
        R: Rule<T, D, W>,
        L: Law<T>,
    {
        let Self { particles, constants, layout, bands, nodes, b, .. } = self;
        let Particles { x, v, F, mass, volume, .. } = &*particles;
        let c = *constants;
        let add = |piece: &mut [Node<T, D>], first: usize, p: usize| {
            let m = mass[p];
            let momentum = v[p] * m;
            let traction = law.kirchhoff(&F[p]) * -(volume[p] * c.inverse_spacing);
            let weight = if no_body_force { SVector::zeros() } else { b[p] * m };
            with_stencil!(rule, c, &x[p], &F[p], |stencil| {
                stencil.scatter(
                    &c.strides,
                    piece,
                    first,
                    |S, G| {
                        let (along, across) = force_factors(&traction, S, G);
                        (m * S, momentum * S, along, across + weight * S)
                    },
                    |node, S, G, (mass, momentum, along, across)| {
                        node.mass += *mass * S;
                        node.velocity += momentum * S;
                        node.acceleration += along * G + across * S;
                    },
                )
            });
        };
        bands.scatter(layout, nodes, |node| *node = Node::zero(), add);
        layout.fold(nodes, |image, ghost, flip| {
            image.mass += ghost.mass;
            image.velocity += flipped(ghost.velocity, flip);
            image.acceleration += flipped(ghost.acceleration, flip);
        });
    }

    /// On the grid: momentum and force to velocity at the end of the step and acceleration.
    fn solve(&mut self, scale: T) {
        let Self { constants: c, nodes, .. } = self;
        nodes.par_chunks_mut(CHUNK).for_each(|nodes| {
            for node in nodes {
                let inverse = if node.mass > c.least_mass { node.mass.recip() } else { T::zero() };
                node.acceleration *= inverse * scale;
                node.velocity = node.velocity * inverse + node.acceleration * c.time_step;
            }
        });
        self.apply_walls();
    }

    /// Clears what is normal to walls, and gives nodes beyond them the mirrored values.
    fn apply_walls(&mut self) {
        let Self { layout, nodes, .. } = self;
        layout.on_walls(nodes, |node, axis| {
            node.velocity[axis] = T::zero();
            node.acceleration[axis] = T::zero();
        });
        layout.unfold(nodes, |image, flip| Node {
            mass: image.mass,
            velocity: flipped(image.velocity, flip),
            acceleration: flipped(image.acceleration, flip),
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
        let add = |piece: &mut [Node<T, D>], first: usize, p: usize| {
            let m = mass[p];
            let momentum = v[p] * m;
            with_stencil!(rule, c, &x[p], &F[p], |stencil| {
                stencil.scatter(
                    &c.strides,
                    piece,
                    first,
                    |S, _| (m * S, momentum * S),
                    |node, S, _, (mass, momentum)| {
                        node.mass += *mass * S;
                        node.velocity += momentum * S;
                    },
                )
            });
        };
        bands.scatter(layout, nodes, |node| *node = Node::zero(), add);
        layout.fold(nodes, |image, ghost, flip| {
            image.mass += ghost.mass;
            image.velocity += flipped(ghost.velocity, flip);
        });
        nodes.par_chunks_mut(CHUNK).for_each(|nodes| {
            for node in nodes {
                node.velocity *=
                    if node.mass > c.least_mass { node.mass.recip() } else { T::zero() };
            }
        });
        self.apply_walls();
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
        let chunks = F_next.par_chunks_mut(CHUNK).zip(x.par_chunks(CHUNK)).zip(F.par_chunks(CHUNK));
        chunks
            .enumerate()
            .map(|(chunk, ((F_next, x), F))| {
                let mut outcome = Outcome::default();
                for (k, ((F_next, x), F)) in F_next.iter_mut().zip(x).zip(F).enumerate() {
                    let (_, L, _) = with_stencil!(rule, c, x, F, |stencil| {
                        stencil.gather(&c.strides, nodes, |n| (n.velocity, SVector::zeros()))
                    });
                    *F_next = c.stretch(&L, F);
                    if let Some(trouble) = trouble(&rule, &c, x, F_next) {
                        let failure = Some((trouble, chunk * CHUNK + k));
                        outcome = outcome.merge(Outcome { failure, ..Outcome::default() });
                    }
                }
                outcome
            })
            .reduce(Outcome::default, Outcome::merge)
    }

    /// USF, third pass: force on the grid, from the updated F with the weights of the old one.
    #[inline(never)]
    fn deposit_force<R, L, const W: usize>(&mut self, rule: R, law: L, no_body_force: bool)
    where
        R: Rule<T, D, W>,
        L: Law<T>,
    {
        let Self { particles, constants, layout, bands, nodes, b, F_next, .. } = self;
        let Particles { x, F, mass, volume, .. } = &*particles;
        let (c, F_next) = (*constants, &F_next[..]);
        let add = |piece: &mut [Node<T, D>], first: usize, p: usize| {
            let traction = law.kirchhoff(&F_next[p]) * -(volume[p] * c.inverse_spacing);
            let weight = if no_body_force { SVector::zeros() } else { b[p] * mass[p] };
            with_stencil!(rule, c, &x[p], &F[p], |stencil| {
                stencil.scatter(
                    &c.strides,
                    piece,
                    first,
                    |S, G| {
                        let (along, across) = force_factors(&traction, S, G);
                        (along, across + weight * S)
                    },
                    |node, S, G, (along, across)| node.acceleration += along * G + across * S,
                )
            });
        };
        bands.scatter(layout, nodes, |node| node.acceleration = SVector::zeros(), add);
        layout.fold(nodes, |image, ghost, flip| {
            image.acceleration += flipped(ghost.acceleration, flip);
        });
    }

    /// USF, on the grid: force to acceleration, velocity to that at the end of the step.
    fn solve_acceleration(&mut self, scale: T) {
        let Self { constants: c, nodes, .. } = self;
        nodes.par_chunks_mut(CHUNK).for_each(|nodes| {
            for node in nodes {
                let inverse = if node.mass > c.least_mass { node.mass.recip() } else { T::zero() };
                node.acceleration *= inverse * scale;
                node.velocity += node.acceleration * c.time_step;
            }
        });
        self.apply_walls();
    }
}

/// The pair (A, B) with which a row's node of weight `S_0` and gradient `G_0` receives the force `A G_0 + B S_0`.
#[inline(always)]
fn force_factors<T: RealField + Copy, const D: usize>(
    traction: &SMatrix<T, D, D>,
    S: T,
    G: &[T; D],
) -> (SVector<T, D>, SVector<T, D>) {
    let along = SVector::from_fn(|i, _| traction[(i, 0)] * S);
    let across =
        SVector::from_fn(|i, _| (1..D).fold(T::zero(), |sum, j| sum + traction[(i, j)] * G[j]));
    (along, across)
}
