//! Instances of a loop for the vector instructions that the processor has, chosen when the program runs.
//!
//! Only the width of the registers differs between them. Sums and products stay what is written: nothing is reordered, and
//! fused are those that are written as such, which a processor without the instruction works out in many. So all give the
//! same bits.

use pulp::{Arch, Simd, WithSimd};

/// A loop that is worth vector instructions. `run` and whatever it calls has to be `#[inline(always)]`.
pub(crate) trait Loop {
    fn run(self);
}

struct Instance<L>(L);

impl<L: Loop> WithSimd for Instance<L> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.0.run();
    }
}

/// Runs the widest instance that this processor supports.
#[inline(never)]
pub(crate) fn dispatch(work: impl Loop) {
    #[cfg(test)]
    if let Some(level) = tests::LEVEL.get() {
        return level.run(work);
    }
    Arch::new().dispatch(Instance(work));
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use nalgebra::{Vector2, vector};
    use pulp::Scalar;

    use super::*;
    use crate::{Grid, Integrator, Material, NoBodyForce, Particles, Settings, Shape, Simulation};

    thread_local! {
        /// The instance that this thread has to take instead of the widest one.
        pub(super) static LEVEL: Cell<Option<Level>> = const { Cell::new(None) };
    }

    #[derive(Clone, Copy, Debug)]
    pub(super) enum Level {
        Scalar,
        #[cfg(target_arch = "x86_64")]
        V3(pulp::x86::V3),
        #[cfg(target_arch = "x86_64")]
        V4(pulp::x86::V4),
    }

    impl Level {
        pub(super) fn run(self, work: impl Loop) {
            match self {
                Self::Scalar => Scalar::new().vectorize(Instance(work)),
                #[cfg(target_arch = "x86_64")]
                Self::V3(simd) => Simd::vectorize(simd, Instance(work)),
                #[cfg(target_arch = "x86_64")]
                Self::V4(simd) => Simd::vectorize(simd, Instance(work)),
            }
        }

        /// Those that this processor has.
        fn all() -> Vec<Self> {
            let mut all = vec![Self::Scalar];
            #[cfg(target_arch = "x86_64")]
            {
                all.extend(pulp::x86::V3::try_new().map(Self::V3));
                all.extend(pulp::x86::V4::try_new().map(Self::V4));
            }
            all
        }
    }

    /// The state of a square after some steps, as bits.
    fn bits(level: Level, shape: Shape, integrator: Integrator) -> Vec<u64> {
        let spacing = 1.0 / 12.0;
        let grid = Grid { lower: Vector2::zeros(), spacing, cells: [12; 2], walls: [[true; 2]; 2] };
        let mut particles = Particles::lattice(&grid, 2, 1.0, |_| true);
        for (v, X) in particles.v.iter_mut().zip(&particles.X) {
            let angle = X * std::f64::consts::PI;
            *v = vector![angle[0].sin() * angle[1].cos(), angle[1].sin()] * 20.0;
        }
        let material = Material::NeoHookean { lambda: 5769.0, mu: 3846.0 };
        let settings =
            Settings { shape, integrator, time_step: 2e-4, halve_first_acceleration: false };
        let run = || {
            LEVEL.set(Some(level));
            let mut simulation = Simulation::new(grid, particles, material, settings).unwrap();
            (0..30).for_each(|_| simulation.step(&NoBodyForce).unwrap());
            LEVEL.set(None);
            let Particles { x, v, F, .. } = simulation.particles();
            let numbers = x.iter().chain(v).flatten().chain(F.iter().flatten());
            numbers.map(|value| value.to_bits()).collect()
        };
        // All of it on the one thread whose level is set.
        rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(run)
    }

    #[test]
    fn all_widths_of_registers_give_the_same_bits() {
        for (shape, integrator) in [
            (Shape::Gimp, Integrator::Cd),
            (Shape::Ugimp, Integrator::Usl),
            (Shape::Linear, Integrator::Musl),
            (Shape::Gimp, Integrator::Usf),
        ] {
            let plain = bits(Level::Scalar, shape, integrator);
            for level in Level::all() {
                assert!(
                    bits(level, shape, integrator) == plain,
                    "{shape:?} {integrator:?} {level:?}"
                );
            }
        }
    }
}
