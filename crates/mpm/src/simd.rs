//! Instances of a loop for the vector instructions of the processor, chosen at run time.
//!
//! The instances differ in the width of registers alone. No sum is reordered, and only explicit `mul_add` is fused, by many
//! instructions where the processor has no single one. All instances thus give the same bits.

use std::any::Any;

use nalgebra::RealField;
use pulp::{Arch, Scalar, Simd, WithSimd};

/// A loop for vector instructions. `run` and all functions that it calls have to be `#[inline(always)]`.
pub(crate) trait Loop {
    fn run<V: Vectors>(self, vectors: V);
}

/// Four numbers in the lanes of one register.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct Lane4<T>(pub(crate) [T; 4]);

/// Operations on [`Lane4`]. The compiler vectorises loops over many particles by itself, but not always the four numbers of
/// one particle.
pub(crate) trait Vectors: Copy {
    /// Four times the same.
    #[inline(always)]
    fn splat<T: RealField + Copy>(self, value: T) -> Lane4<T> {
        Lane4([value; 4])
    }

    /// Four numbers from memory in one load; the compiler may split a plain copy into smaller loads.
    #[inline(always)]
    fn load<T: RealField + Copy>(self, values: &[T; 4]) -> Lane4<T> {
        Lane4(*values)
    }

    #[inline(always)]
    fn add<T: RealField + Copy>(self, Lane4(a): Lane4<T>, Lane4(b): Lane4<T>) -> Lane4<T> {
        Lane4([a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]])
    }

    #[inline(always)]
    fn mul<T: RealField + Copy>(self, Lane4(a): Lane4<T>, Lane4(b): Lane4<T>) -> Lane4<T> {
        Lane4([a[0] * b[0], a[1] * b[1], a[2] * b[2], a[3] * b[3]])
    }

    #[inline(always)]
    fn sub<T: RealField + Copy>(self, Lane4(a): Lane4<T>, Lane4(b): Lane4<T>) -> Lane4<T> {
        Lane4([a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]])
    }

    /// `a b - c`, rounded once.
    #[inline(always)]
    fn mul_sub<T: RealField + Copy>(
        self,
        Lane4(a): Lane4<T>,
        Lane4(b): Lane4<T>,
        Lane4(c): Lane4<T>,
    ) -> Lane4<T> {
        Lane4(std::array::from_fn(|q| a[q].mul_add(b[q], -c[q])))
    }

    /// `a b + c`, rounded once.
    #[inline(always)]
    fn mul_add<T: RealField + Copy>(
        self,
        Lane4(a): Lane4<T>,
        Lane4(b): Lane4<T>,
        Lane4(c): Lane4<T>,
    ) -> Lane4<T> {
        Lane4(std::array::from_fn(|q| a[q].mul_add(b[q], c[q])))
    }

    /// `[a0, a0, a2, a2]`.
    #[inline(always)]
    fn even<T: RealField + Copy>(self, Lane4(a): Lane4<T>) -> Lane4<T> {
        Lane4([a[0], a[0], a[2], a[2]])
    }

    /// `[a1, a1, a3, a3]`.
    #[inline(always)]
    fn odd<T: RealField + Copy>(self, Lane4(a): Lane4<T>) -> Lane4<T> {
        Lane4([a[1], a[1], a[3], a[3]])
    }

    /// `[a0, a1, a0, a1]`.
    #[inline(always)]
    fn low_twice<T: RealField + Copy>(self, Lane4(a): Lane4<T>) -> Lane4<T> {
        Lane4([a[0], a[1], a[0], a[1]])
    }

    /// `[0, 0, a0, a1]`.
    #[inline(always)]
    fn low_to_high<T: RealField + Copy>(self, Lane4(a): Lane4<T>) -> Lane4<T> {
        Lane4([T::zero(), T::zero(), a[0], a[1]])
    }

    /// `[0, 0, a2, a3]`.
    #[inline(always)]
    fn high_alone<T: RealField + Copy>(self, Lane4(a): Lane4<T>) -> Lane4<T> {
        Lane4([T::zero(), T::zero(), a[2], a[3]])
    }

    /// `[a2, a3, b0, b1]`.
    #[inline(always)]
    fn high_and_low<T: RealField + Copy>(self, Lane4(a): Lane4<T>, Lane4(b): Lane4<T>) -> Lane4<T> {
        Lane4([a[2], a[3], b[0], b[1]])
    }
}

impl Vectors for Scalar {}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Any, Lane4, RealField, Scalar, Vectors, same};
    use bytemuck::{AnyBitPattern, NoUninit, bytes_of, must_cast, pod_read_unaligned};
    use pulp::x86::{V3, V4};
    use std::arch::x86_64::{__m128, __m256d};

    /// The instructions for an operation in double and in single precision, if `T` is one of them.
    macro_rules! instructions {
        ($(fn $name:ident($self:ident, $($a:ident),*) { $double:expr, $single:expr })*) => {
            impl Vectors for V3 {
                $(#[inline(always)]
                fn $name<T: RealField + Copy>($self, $($a: Lane4<T>),*) -> Lane4<T> {
                    if let ($(Some($a),)*) = ($(double($a),)*) {
                        return from_double($double).unwrap_or_else(zero);
                    }
                    if let ($(Some($a),)*) = ($(single($a),)*) {
                        return from_single($single).unwrap_or_else(zero);
                    }
                    Scalar::new().$name($($a),*)
                })*

                #[inline(always)]
                fn load<T: RealField + Copy>(self, values: &[T; 4]) -> Lane4<T> {
                    let double = at::<_, [f64; 4], __m256d>(values).and_then(from_double);
                    let single = at::<_, [f32; 4], __m128>(values).and_then(from_single);
                    double.or(single).unwrap_or(Lane4(*values))
                }

                #[inline(always)]
                fn splat<T: RealField + Copy>(self, value: T) -> Lane4<T> {
                    let double = same(value).and_then(|x: f64| from_double(self.avx._mm256_set1_pd(x)));
                    let single = same(value).and_then(|x: f32| from_single(self.sse._mm_set1_ps(x)));
                    double.or(single).unwrap_or(Lane4([value; 4]))
                }
            }

            impl Vectors for V4 {
                $(#[inline(always)]
                fn $name<T: RealField + Copy>(self, $($a: Lane4<T>),*) -> Lane4<T> {
                    V3::$name(*self, $($a),*)
                })*

                #[inline(always)]
                fn load<T: RealField + Copy>(self, values: &[T; 4]) -> Lane4<T> {
                    V3::load(*self, values)
                }

                #[inline(always)]
                fn splat<T: RealField + Copy>(self, value: T) -> Lane4<T> {
                    V3::splat(*self, value)
                }
            }
        };
    }

    instructions! {
        fn add(self, a, b) { self.avx._mm256_add_pd(a, b), self.sse._mm_add_ps(a, b) }
        fn sub(self, a, b) { self.avx._mm256_sub_pd(a, b), self.sse._mm_sub_ps(a, b) }
        fn mul(self, a, b) { self.avx._mm256_mul_pd(a, b), self.sse._mm_mul_ps(a, b) }
        fn mul_add(self, a, b, c) { self.fma._mm256_fmadd_pd(a, b, c), self.fma._mm_fmadd_ps(a, b, c) }
        fn mul_sub(self, a, b, c) { self.fma._mm256_fmsub_pd(a, b, c), self.fma._mm_fmsub_ps(a, b, c) }
        fn even(self, a) { self.avx._mm256_movedup_pd(a), self.sse3._mm_moveldup_ps(a) }
        fn odd(self, a) { self.avx._mm256_permute_pd::<0b1111>(a), self.sse3._mm_movehdup_ps(a) }
        fn low_twice(self, a) {
            self.avx._mm256_permute2f128_pd::<0x00>(a, a), self.sse._mm_movelh_ps(a, a)
        }
        fn low_to_high(self, a) {
            self.avx._mm256_permute2f128_pd::<0x08>(a, a),
            self.sse._mm_movelh_ps(self.sse._mm_setzero_ps(), a)
        }
        fn high_alone(self, a) {
            self.avx._mm256_permute2f128_pd::<0x18>(a, a),
            self.sse._mm_shuffle_ps::<0b11_10_01_00>(self.sse._mm_setzero_ps(), a)
        }
        fn high_and_low(self, a, b) {
            self.avx._mm256_permute2f128_pd::<0x21>(a, b),
            self.sse._mm_shuffle_ps::<0b01_00_11_10>(a, b)
        }
    }

    /// Loads a register from `a`, if `A` is `B`.
    #[inline(always)]
    fn at<A: 'static, B: NoUninit + 'static, R: AnyBitPattern>(a: &A) -> Option<R> {
        (a as &dyn Any).downcast_ref::<B>().map(|b| pod_read_unaligned(bytes_of(b)))
    }

    #[inline(always)]
    fn double<T: RealField + Copy>(a: Lane4<T>) -> Option<__m256d> {
        same::<_, Lane4<f64>>(a).map(|Lane4(a)| must_cast(a))
    }

    #[inline(always)]
    fn single<T: RealField + Copy>(a: Lane4<T>) -> Option<__m128> {
        same::<_, Lane4<f32>>(a).map(|Lane4(a)| must_cast(a))
    }

    #[inline(always)]
    fn from_double<T: RealField + Copy>(a: __m256d) -> Option<Lane4<T>> {
        same(Lane4::<f64>(must_cast(a)))
    }

    #[inline(always)]
    fn from_single<T: RealField + Copy>(a: __m128) -> Option<Lane4<T>> {
        same(Lane4::<f32>(must_cast(a)))
    }

    /// Unreachable: `T` is f32 or f64.
    #[inline(always)]
    fn zero<T: RealField + Copy>() -> Lane4<T> {
        Lane4([T::zero(); 4])
    }
}

/// The value, if `A` is `B`; resolved at compile time.
#[inline(always)]
fn same<A: Copy + 'static, B: Copy + 'static>(a: A) -> Option<B> {
    (&a as &dyn Any).downcast_ref().copied()
}

struct Instance<L, V>(L, V);

impl<L: Loop, V: Vectors> WithSimd for Instance<L, V> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.0.run(self.1);
    }
}

/// Runs the widest instance that this processor supports.
#[inline(never)]
pub(crate) fn dispatch(work: impl Loop) {
    #[cfg(test)]
    if let Some(level) = tests::LEVEL.get() {
        return level.run(work);
    }
    match Arch::new() {
        #[cfg(target_arch = "x86_64")]
        Arch::V4(simd) => Simd::vectorize(simd, Instance(work, simd)),
        #[cfg(target_arch = "x86_64")]
        Arch::V3(simd) => Simd::vectorize(simd, Instance(work, simd)),
        arch => arch.dispatch(Instance(work, Scalar::new())),
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use nalgebra::SVector;
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
                Self::Scalar => Scalar::new().vectorize(Instance(work, Scalar::new())),
                #[cfg(target_arch = "x86_64")]
                Self::V3(simd) => Simd::vectorize(simd, Instance(work, simd)),
                #[cfg(target_arch = "x86_64")]
                Self::V4(simd) => Simd::vectorize(simd, Instance(work, simd)),
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

    /// The state of a square or a cube after some steps, as bits.
    fn bits<const D: usize>(level: Level, shape: Shape, integrator: Integrator) -> Vec<u64> {
        let cells = if D == 3 { 6 } else { 12 };
        let spacing = 1.0 / cells as f64;
        let walls = [[true; 2]; D];
        let grid = Grid { lower: SVector::zeros(), spacing, cells: [cells; D], walls };
        let mut particles = Particles::lattice(&grid, 2, 1.0, |_| true);
        for (v, X) in particles.v.iter_mut().zip(&particles.X) {
            let angle: SVector<f64, D> = X * std::f64::consts::PI;
            // Along each axis it changes with the next one too, for gradients off the diagonal.
            *v = SVector::from_fn(|a, _| 20.0 * angle[a].sin() * angle[(a + 1) % D].cos());
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

    /// All operations on some numbers, one after the other.
    fn operations<T: RealField + Copy>(vectors: impl Vectors) -> Vec<[T; 4]> {
        let lanes = |from: f64| {
            Lane4(std::array::from_fn(|q| nalgebra::convert::<f64, T>((from + q as f64).sqrt())))
        };
        let (a, b, c) = (lanes(2.0), lanes(11.0), lanes(20.0));
        [
            vectors.splat(a.0[1]),
            vectors.load(&b.0),
            vectors.add(a, b),
            vectors.sub(a, b),
            vectors.mul(a, b),
            vectors.mul_add(a, b, c),
            vectors.mul_sub(a, b, c),
            vectors.even(a),
            vectors.odd(a),
            vectors.low_twice(a),
            vectors.low_to_high(a),
            vectors.high_alone(a),
            vectors.high_and_low(a, b),
        ]
        .map(|Lane4(values)| values)
        .into()
    }

    #[test]
    fn instructions_do_what_is_written_out_for_processors_without_them() {
        for level in Level::all() {
            let (double, single): (Vec<[f64; 4]>, Vec<[f32; 4]>) = match level {
                Level::Scalar => continue,
                #[cfg(target_arch = "x86_64")]
                Level::V3(simd) => (operations(simd), operations(simd)),
                #[cfg(target_arch = "x86_64")]
                Level::V4(simd) => (operations(simd), operations(simd)),
            };
            assert_eq!(double, operations(Scalar::new()), "{level:?}");
            assert_eq!(single, operations(Scalar::new()), "{level:?}");
        }
    }

    #[test]
    fn all_widths_of_registers_give_the_same_bits() {
        for (shape, integrator) in [
            (Shape::Gimp, Integrator::Cd),
            (Shape::Ugimp, Integrator::Usl),
            (Shape::Linear, Integrator::Musl),
            (Shape::Gimp, Integrator::Usf),
            (Shape::Bspline2, Integrator::Cd),
        ] {
            fn check<const D: usize>(shape: Shape, integrator: Integrator) {
                let plain = bits::<D>(Level::Scalar, shape, integrator);
                for level in Level::all() {
                    let same = bits::<D>(level, shape, integrator) == plain;
                    assert!(same, "{D} {shape:?} {integrator:?} {level:?}");
                }
            }
            check::<2>(shape, integrator);
            check::<3>(shape, integrator);
        }
    }
}
