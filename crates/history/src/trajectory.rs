//! The history of one particle along an exact motion.

use std::cell::Cell;

use thiserror::Error;

use crate::extrapolation::{Stop, integrate};
use crate::law::{Branch, Kinematics, LawWithHistory};
use crate::number::{Dual, Number};
use crate::tensor::{Tensor, tensor};

/// Why a history could not be followed.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum HistoryError {
    /// Times must not go back.
    #[error("times of a history must ascend: {after} comes after {before}")]
    Order {
        /// A time.
        before: f64,
        /// The time that follows it.
        after: f64,
    },
    /// The integrator gave up.
    #[error(
        "the rates of the internal variables are too large or too rough to go on from the time {time}"
    )]
    Rough {
        /// The time.
        time: f64,
    },
    /// A value that is not finite.
    #[error("an internal variable is not finite at the time {time}")]
    NotFinite {
        /// The time.
        time: f64,
    },
}

/// A particle begins to flow, or ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// The time at which.
    pub time: f64,
    /// The branch that follows.
    pub branch: Branch,
}

/// The internal variables of a particle at some times, with their slopes in `K` directions.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory<const K: usize> {
    /// For each time the variables.
    pub states: Vec<Vec<Dual<f64, K>>>,
    /// Where the set of rate equations changed.
    pub changes: Vec<Change>,
    /// The least margin of the flow at the times: how fast the stress would grow, as a share of the rate of deformation; infinite where
    /// the particle never flows.
    pub least_margin: f64,
}

/// The deformation gradient of a particle and its rate at a time, with their slopes along the particle's position.
pub trait Motion<const K: usize>: Sync {
    /// At a time.
    fn at(&self, time: f64) -> Kinematics<Dual<f64, K>>;
}

impl<const K: usize, M: Fn(f64) -> Kinematics<Dual<f64, K>> + Sync> Motion<K> for M {
    fn at(&self, time: f64) -> Kinematics<Dual<f64, K>> {
        self(time)
    }
}

/// The kinematics without slopes.
fn values<const K: usize>(at: &Kinematics<Dual<f64, K>>) -> Kinematics<f64> {
    let of = |A: &Tensor<Dual<f64, K>>| A.map(|row| row.map(|entry| entry.value));
    Kinematics { F: of(&at.F), rate: of(&at.rate) }
}

/// Variables and slopes side by side, each variable with its slopes.
fn pack<const K: usize>(z: &[Dual<f64, K>], numbers: &mut [f64]) {
    for (z, own) in z.iter().zip(numbers.chunks_exact_mut(K + 1)) {
        own[0] = z.value;
        own[1..].copy_from_slice(&z.slopes);
    }
}

fn unpacked<const K: usize>(numbers: &[f64]) -> Vec<Dual<f64, K>> {
    let of = |own: &[f64]| Dual { value: own[0], slopes: std::array::from_fn(|k| own[k + 1]) };
    numbers.chunks_exact(K + 1).map(of).collect()
}

/// A particle on its way.
struct Particle<'a, L, M, const K: usize> {
    law: &'a L,
    motion: &'a M,
    tolerance: f64,
    branch: Branch,
    time: f64,
    z: Vec<Dual<f64, K>>,
    /// The last step of the integrator, with which the next one begins.
    step: Cell<f64>,
}

impl<L: LawWithHistory, M: Motion<K>, const K: usize> Particle<'_, L, M, K> {
    fn margin(&self, time: f64, z: &[Dual<f64, K>]) -> Dual<f64, K> {
        self.law.margin(&self.motion.at(time), z, self.branch)
    }

    /// The variables at a later time, on the same branch.
    fn on_branch(&self, end: f64) -> Result<Vec<Dual<f64, K>>, HistoryError> {
        if self.branch == Branch::Elastic || end <= self.time {
            return Ok(self.z.clone());
        }
        let rate = |time: f64, numbers: &[f64], rates: &mut [f64]| {
            let z = unpacked::<K>(numbers);
            let mut of_z = vec![Dual::<f64, K>::constant(0.0); z.len()];
            self.law.rate(&self.motion.at(time), &z, self.branch, &mut of_z);
            pack(&of_z, rates);
        };
        let mut numbers = vec![0.0; self.z.len() * (K + 1)];
        pack(&self.z, &mut numbers);
        let mut step = self.step.get();
        let found = integrate(&rate, (self.time, end), &mut numbers, self.tolerance, &mut step);
        self.step.set(step);
        found.map_err(|stop| match stop {
            Stop::StepTooSmall => HistoryError::Rough { time: self.time },
            Stop::NotFinite => HistoryError::NotFinite { time: end },
        })?;
        Ok(unpacked(&numbers))
    }

    /// The time up to `end` to which the branch lasts, the variables then, and whether the branch ends there.
    fn to_end_of_branch(&self, end: f64) -> Result<(f64, Vec<Dual<f64, K>>, bool), HistoryError> {
        let at_end = self.on_branch(end)?;
        if self.margin(end, &at_end).value > 0.0 {
            return Ok((end, at_end, false));
        }
        let (mut low, mut high, mut found) = (self.time, end, at_end);
        // By halves: the margin may have a kink where a particle has flown.
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            let at_middle = self.on_branch(middle)?;
            if self.margin(middle, &at_middle).value > 0.0 {
                low = middle;
            } else {
                (high, found) = (middle, at_middle);
            }
        }
        Ok((high, found, true))
    }

    /// Goes on to a time; tells the changes of the branch on the way.
    fn advance(&mut self, end: f64, changes: &mut Vec<Change>) -> Result<(), HistoryError> {
        while self.time < end {
            let is_changed;
            (self.time, self.z, is_changed) = self.to_end_of_branch(end)?;
            if !is_changed {
                return Ok(());
            }
            self.branch = match self.branch {
                Branch::Elastic => {
                    self.onset();
                    Branch::Flowing
                }
                Branch::Flowing => Branch::Elastic,
            };
            changes.push(Change { time: self.time, branch: self.branch });
        }
        Ok(())
    }

    /// The slopes right after the onset of the flow: particles next to this one begin at another time,
    /// `t_y,J = -f_,J / f'`, so that `z_,J` jumps by `-z' t_y,J`.
    fn onset(&mut self) {
        let at = self.motion.at(self.time);
        let margin = self.law.margin(&at, &self.z, Branch::Elastic);
        // The rate of the margin along the motion while the variables stay; it depends on F alone.
        let along = Kinematics {
            F: tensor(|i, j| Dual { value: at.F[i][j].value, slopes: [at.rate[i][j].value] }),
            rate: tensor(|i, j| Dual::constant(at.rate[i][j].value)),
        };
        let at_rest: Vec<Dual<f64, 1>> = self.z.iter().map(|z| Dual::constant(z.value)).collect();
        let [rate] = self.law.margin(&along, &at_rest, Branch::Elastic).slopes;
        let mut rates = vec![Dual::<f64, K>::constant(0.0); self.z.len()];
        self.law.rate(&at, &self.z, Branch::Flowing, &mut rates);
        for (z, rate_of_z) in self.z.iter_mut().zip(rates) {
            for k in 0..K {
                z.slopes[k] += rate_of_z.value * margin.slopes[k] / rate;
            }
        }
    }
}

impl<const K: usize> Trajectory<K> {
    /// Follows a particle from the time 0, where its variables are `start`, through ascending `times`, with the given relative tolerance of
    /// the integrator.
    ///
    /// # Errors
    ///
    /// [`HistoryError`] where times do not ascend, or the rates cannot be integrated.
    pub fn new<L: LawWithHistory>(
        law: &L,
        motion: &impl Motion<K>,
        start: &[f64],
        times: &[f64],
        tolerance: f64,
    ) -> Result<Self, HistoryError> {
        let z: Vec<_> = start.iter().map(|&value| Dual::constant(value)).collect();
        let branch = law.first_branch(&values(&motion.at(0.0)), start);
        let mut particle =
            Particle { law, motion, tolerance, branch, time: 0.0, z, step: Cell::new(0.0) };
        let mut own = Self { states: Vec::new(), changes: Vec::new(), least_margin: f64::INFINITY };
        for &time in times {
            if time.is_nan() || time < particle.time {
                return Err(HistoryError::Order { before: particle.time, after: time });
            }
            particle.advance(time, &mut own.changes)?;
            if particle.branch == Branch::Flowing {
                let margin = particle.margin(time, &particle.z).value;
                own.least_margin = own.least_margin.min(margin);
            }
            own.states.push(particle.z.clone());
        }
        Ok(own)
    }
}

/// The divergence of the first Piola-Kirchhoff stress of a particle, and the stress itself, from variables with slopes along the
/// coordinates.
pub fn divergence<L: LawWithHistory, const K: usize>(
    law: &L,
    at: &Kinematics<Dual<f64, K>>,
    z: &[Dual<f64, K>],
) -> ([f64; K], Tensor<f64>) {
    let P = law.first_piola_kirchhoff(at, z);
    let divergence =
        std::array::from_fn(|i| (0..K).map(|axis| P[i][axis].slopes[axis]).sum::<f64>());
    (divergence, P.map(|row| row.map(|entry| entry.value)))
}
