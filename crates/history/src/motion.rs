//! Exact motions of particles.

use crate::law::Kinematics;
use crate::number::Dual;
use crate::tensor::{Tensor, identity};

/// The motion of a particle, with slopes along the particle's position.
pub trait Motion<const K: usize>: Sync {
    /// The deformation gradient and its rate at a time.
    fn at(&self, time: f64) -> Kinematics<Dual<f64, K>>;

    /// Cartesian components of the unit vectors of the frame whose components the motion has, `[i][a]`. Default: the axes.
    fn frame(&self) -> Tensor<f64> {
        identity()
    }

    /// Writes the constants of the law at a time, in the order of its [names](crate::LawWithHistory::constants). `constants` is empty before.
    fn constants(&self, time: f64, constants: &mut Vec<Dual<f64, K>>);
}

/// Kinematics as a function of time, and constants that do not change.
impl<const K: usize, M: Fn(f64) -> Kinematics<Dual<f64, K>> + Sync> Motion<K>
    for (M, Vec<Dual<f64, K>>)
{
    fn at(&self, time: f64) -> Kinematics<Dual<f64, K>> {
        self.0(time)
    }

    fn constants(&self, _: f64, constants: &mut Vec<Dual<f64, K>>) {
        constants.extend_from_slice(&self.1);
    }
}
