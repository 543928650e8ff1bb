//! Instances of a loop for the vector instructions of the processor, chosen at run time.
//!
//! The instances differ in the width of registers alone. No sum is reordered, and only explicit `mul_add` is fused, by many
//! instructions where the processor has no single one. All instances thus give the same bits.

use std::any::Any;
use std::ops::{Add, Mul, Sub};

use nalgebra::RealField;
use pulp::{Arch, Scalar, Simd, WithSimd};

use crate::tensor::real;

/// A loop for vector instructions. `run` and all functions that it calls have to be `#[inline(always)]`.
pub(crate) trait Loop {
    fn run<V: Vectors>(self, vectors: V);
}

/// Four numbers in the lanes of one register.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct Lane4<T>(pub(crate) [T; 4]);

/// Eight numbers in the lanes of one register, or of two where registers are shorter.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Lane8<T>(pub(crate) [T; 8]);

impl<T: RealField + Copy> Lane4<T> {
    #[inline(always)]
    pub(crate) fn zero() -> Self {
        Self([T::zero(); 4])
    }
}

impl<T: RealField + Copy> Lane8<T> {
    #[inline(always)]
    pub(crate) fn zero() -> Self {
        Self([T::zero(); 8])
    }
}

/// Operations on [`Lane4`] and [`Lane8`]. The compiler vectorises loops over many particles by itself, but not always the four numbers of
/// one particle.
pub(crate) trait Vectors: Copy {
    /// Four times the same.
    fn splat<T: RealField + Copy>(self, value: T) -> Lane4<T>;
    /// Four numbers from memory in one load; the compiler may split a plain copy into smaller loads.
    fn load<T: RealField + Copy>(self, values: &[T; 4]) -> Lane4<T>;
    fn add<T: RealField + Copy>(self, a: Lane4<T>, b: Lane4<T>) -> Lane4<T>;
    fn sub<T: RealField + Copy>(self, a: Lane4<T>, b: Lane4<T>) -> Lane4<T>;
    fn mul<T: RealField + Copy>(self, a: Lane4<T>, b: Lane4<T>) -> Lane4<T>;
    /// `a b + c`, rounded once.
    fn mul_add<T: RealField + Copy>(self, a: Lane4<T>, b: Lane4<T>, c: Lane4<T>) -> Lane4<T>;
    /// `a b - c`, rounded once.
    fn mul_sub<T: RealField + Copy>(self, a: Lane4<T>, b: Lane4<T>, c: Lane4<T>) -> Lane4<T>;
    /// `[a0, a0, a2, a2]`.
    fn even<T: RealField + Copy>(self, a: Lane4<T>) -> Lane4<T>;
    /// `[a1, a1, a3, a3]`.
    fn odd<T: RealField + Copy>(self, a: Lane4<T>) -> Lane4<T>;
    /// `[a0, a1, a0, a1]`.
    fn low_twice<T: RealField + Copy>(self, a: Lane4<T>) -> Lane4<T>;
    /// `[0, 0, a0, a1]`.
    fn low_to_high<T: RealField + Copy>(self, a: Lane4<T>) -> Lane4<T>;
    /// `[0, 0, a2, a3]`.
    fn high_alone<T: RealField + Copy>(self, a: Lane4<T>) -> Lane4<T>;
    /// `[a2, a3, b0, b1]`.
    fn high_and_low<T: RealField + Copy>(self, a: Lane4<T>, b: Lane4<T>) -> Lane4<T>;
    /// `[a0, a1, b2, b3]`.
    fn low_and_high<T: RealField + Copy>(self, a: Lane4<T>, b: Lane4<T>) -> Lane4<T>;
    /// Eight times the same.
    fn splat8<T: RealField + Copy>(self, value: T) -> Lane8<T>;
    /// Eight numbers from memory in one load.
    fn load8<T: RealField + Copy>(self, values: &[T; 8]) -> Lane8<T>;
    fn add8<T: RealField + Copy>(self, a: Lane8<T>, b: Lane8<T>) -> Lane8<T>;
    fn sub8<T: RealField + Copy>(self, a: Lane8<T>, b: Lane8<T>) -> Lane8<T>;
    fn mul8<T: RealField + Copy>(self, a: Lane8<T>, b: Lane8<T>) -> Lane8<T>;
    fn div8<T: RealField + Copy>(self, a: Lane8<T>, b: Lane8<T>) -> Lane8<T>;
    /// `a b + c`, rounded once.
    fn mul_add8<T: RealField + Copy>(self, a: Lane8<T>, b: Lane8<T>, c: Lane8<T>) -> Lane8<T>;
    /// The smaller of both; `b` where one is not a number.
    fn min8<T: RealField + Copy>(self, a: Lane8<T>, b: Lane8<T>) -> Lane8<T>;
    /// The larger of both; `b` where one is not a number.
    fn max8<T: RealField + Copy>(self, a: Lane8<T>, b: Lane8<T>) -> Lane8<T>;
}

/// Operations lane by lane, and moves between lanes.
///
/// On x86 this is for processors without fused multiply-adds, which take a call for each number: in line the operations would make
/// half of the code.
macro_rules! lane_by_lane {
    (
        $(fn $name:ident($($a:ident),+; $q:ident of $of:ident) { $term:expr })*
        moves: $(fn $move:ident($($b:ident),+) { [$($lane:expr),+] })*
    ) => {
        impl Vectors for Scalar {
            #[inline(always)]
            fn splat<T: RealField + Copy>(self, value: T) -> Lane4<T> {
                Lane4([value; 4])
            }

            #[inline(always)]
            fn load<T: RealField + Copy>(self, values: &[T; 4]) -> Lane4<T> {
                Lane4(*values)
            }

            #[inline(always)]
            fn splat8<T: RealField + Copy>(self, value: T) -> Lane8<T> {
                Lane8([value; 8])
            }

            #[inline(always)]
            fn load8<T: RealField + Copy>(self, values: &[T; 8]) -> Lane8<T> {
                Lane8(*values)
            }

            $(
                #[cfg_attr(target_arch = "x86_64", inline(never))]
                #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
                fn $name<T: RealField + Copy>(self, $($a: $of<T>),+) -> $of<T> {
                    $(let $of($a) = $a;)+
                    let mut result = $of::zero();
                    for ($q, lane) in result.0.iter_mut().enumerate() {
                        *lane = $term;
                    }
                    result
                }
            )*

            $(
                #[inline(always)]
                fn $move<T: RealField + Copy>(self, $(Lane4($b): Lane4<T>),+) -> Lane4<T> {
                    Lane4([$($lane),+])
                }
            )*
        }
    };
}

lane_by_lane! {
    fn add(a, b; q of Lane4) { a[q] + b[q] }
    fn sub(a, b; q of Lane4) { a[q] - b[q] }
    fn mul(a, b; q of Lane4) { a[q] * b[q] }
    fn mul_add(a, b, c; q of Lane4) { a[q].mul_add(b[q], c[q]) }
    fn mul_sub(a, b, c; q of Lane4) { a[q].mul_add(b[q], -c[q]) }
    fn add8(a, b; q of Lane8) { a[q] + b[q] }
    fn sub8(a, b; q of Lane8) { a[q] - b[q] }
    fn mul8(a, b; q of Lane8) { a[q] * b[q] }
    fn div8(a, b; q of Lane8) { a[q] / b[q] }
    fn mul_add8(a, b, c; q of Lane8) { a[q].mul_add(b[q], c[q]) }
    fn min8(a, b; q of Lane8) { if a[q] < b[q] { a[q] } else { b[q] } }
    fn max8(a, b; q of Lane8) { if a[q] > b[q] { a[q] } else { b[q] } }
    moves:
    fn even(a) { [a[0], a[0], a[2], a[2]] }
    fn odd(a) { [a[1], a[1], a[3], a[3]] }
    fn low_twice(a) { [a[0], a[1], a[0], a[1]] }
    fn low_to_high(a) { [T::zero(), T::zero(), a[0], a[1]] }
    fn high_alone(a) { [T::zero(), T::zero(), a[2], a[3]] }
    fn high_and_low(a, b) { [a[2], a[3], b[0], b[1]] }
    fn low_and_high(a, b) { [a[0], a[1], b[2], b[3]] }
}

/// What formulas for one particle need of numbers, so that they hold for eight at once as well.
pub(crate) trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self>
{
    fn divided_by(self, divisor: Self) -> Self;
    /// A constant like this number.
    fn constant(self, value: f64) -> Self;
}

/// One number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct One<T>(pub(crate) T);

/// A number of each of eight particles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Eight<T, V> {
    pub(crate) lanes: Lane8<T>,
    pub(crate) vectors: V,
}

macro_rules! operators {
    ($($trait:ident $method:ident $eight:ident;)*) => {
        $(impl<T: RealField + Copy> $trait for One<T> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.0.$method(other.0))
            }
        }

        impl<T: RealField + Copy, V: Vectors> $trait for Eight<T, V> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self { lanes: self.vectors.$eight(self.lanes, other.lanes), ..self }
            }
        })*
    };
}

operators! {
    Add add add8;
    Sub sub sub8;
    Mul mul mul8;
}

impl<T: RealField + Copy> Number for One<T> {
    #[inline(always)]
    fn divided_by(self, divisor: Self) -> Self {
        Self(self.0 / divisor.0)
    }

    #[inline(always)]
    fn constant(self, value: f64) -> Self {
        Self(real(value))
    }
}

impl<T: RealField + Copy, V: Vectors> Number for Eight<T, V> {
    #[inline(always)]
    fn divided_by(self, divisor: Self) -> Self {
        Self { lanes: self.vectors.div8(self.lanes, divisor.lanes), ..self }
    }

    #[inline(always)]
    fn constant(self, value: f64) -> Self {
        Self { lanes: self.vectors.splat8(real(value)), ..self }
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Any, Lane4, Lane8, RealField, Scalar, Vectors, same};
    use bytemuck::{AnyBitPattern, NoUninit, bytes_of, must_cast, pod_read_unaligned};
    use pulp::x86::{V3, V4};
    use std::arch::x86_64::{__m128, __m256, __m256d, __m512d};

    /// The instructions for an operation on four numbers and for one on eight, in double and in single precision, if `T` is
    /// one of them. Registers of 512 bits hold eight numbers in double precision, others half of them.
    macro_rules! instructions {
        (
            $(fn $four:ident($self:ident, $($a:ident),*) { $double:expr, $single:expr })*
            eight:
            $(fn $eight:ident($self8:ident, $($a8:ident),*) {
                $wide:expr, each half $half:expr, $single8:expr
            })*
        ) => {
            impl Vectors for V3 {
                $(#[inline(always)]
                fn $four<T: RealField + Copy>($self, $($a: Lane4<T>),*) -> Lane4<T> {
                    if let ($(Some($a),)*) = ($(double($a),)*) {
                        return from_double($double).unwrap_or_else(Lane4::zero);
                    }
                    if let ($(Some($a),)*) = ($(single($a),)*) {
                        return from_single($single).unwrap_or_else(Lane4::zero);
                    }
                    Scalar::new().$four($($a),*)
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

                $(#[inline(always)]
                fn $eight<T: RealField + Copy>($self8, $($a8: Lane8<T>),*) -> Lane8<T> {
                    if let ($(Some($a8),)*) = ($(halves($a8),)*) {
                        let half = |half: usize| {
                            let ($($a8,)*) = ($($a8[half],)*);
                            $half
                        };
                        return from_halves([half(0), half(1)]).unwrap_or_else(Lane8::zero);
                    }
                    if let ($(Some($a8),)*) = ($(single8($a8),)*) {
                        return from_single8($single8).unwrap_or_else(Lane8::zero);
                    }
                    Scalar::new().$eight($($a8),*)
                })*

                #[inline(always)]
                fn load8<T: RealField + Copy>(self, values: &[T; 8]) -> Lane8<T> {
                    let double = at::<_, [f64; 8], [__m256d; 2]>(values).and_then(from_halves);
                    let single = at::<_, [f32; 8], __m256>(values).and_then(from_single8);
                    double.or(single).unwrap_or(Lane8(*values))
                }

                #[inline(always)]
                fn splat8<T: RealField + Copy>(self, value: T) -> Lane8<T> {
                    let double =
                        same(value).and_then(|x: f64| from_halves([self.avx._mm256_set1_pd(x); 2]));
                    let single =
                        same(value).and_then(|x: f32| from_single8(self.avx._mm256_set1_ps(x)));
                    double.or(single).unwrap_or(Lane8([value; 8]))
                }
            }

            impl Vectors for V4 {
                $(#[inline(always)]
                fn $four<T: RealField + Copy>($self, $($a: Lane4<T>),*) -> Lane4<T> {
                    V3::$four(*$self, $($a),*)
                })*

                #[inline(always)]
                fn load<T: RealField + Copy>(self, values: &[T; 4]) -> Lane4<T> {
                    V3::load(*self, values)
                }

                #[inline(always)]
                fn splat<T: RealField + Copy>(self, value: T) -> Lane4<T> {
                    V3::splat(*self, value)
                }

                $(#[inline(always)]
                fn $eight<T: RealField + Copy>($self8, $($a8: Lane8<T>),*) -> Lane8<T> {
                    if let ($(Some($a8),)*) = ($(whole($a8),)*) {
                        return from_whole($wide).unwrap_or_else(Lane8::zero);
                    }
                    V3::$eight(*$self8, $($a8),*)
                })*

                #[inline(always)]
                fn load8<T: RealField + Copy>(self, values: &[T; 8]) -> Lane8<T> {
                    at::<_, [f64; 8], __m512d>(values)
                        .and_then(from_whole)
                        .unwrap_or_else(|| V3::load8(*self, values))
                }

                #[inline(always)]
                fn splat8<T: RealField + Copy>(self, value: T) -> Lane8<T> {
                    same(value)
                        .and_then(|x: f64| from_whole(self.avx512f._mm512_set1_pd(x)))
                        .unwrap_or_else(|| V3::splat8(*self, value))
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
        fn low_and_high(self, a, b) {
            self.avx._mm256_blend_pd::<0b1100>(a, b), self.sse4_1._mm_blend_ps::<0b1100>(a, b)
        }
        eight:
        fn add8(self, a, b) {
            self.avx512f._mm512_add_pd(a, b),
            each half self.avx._mm256_add_pd(a, b),
            self.avx._mm256_add_ps(a, b)
        }
        fn mul8(self, a, b) {
            self.avx512f._mm512_mul_pd(a, b),
            each half self.avx._mm256_mul_pd(a, b),
            self.avx._mm256_mul_ps(a, b)
        }
        fn sub8(self, a, b) {
            self.avx512f._mm512_sub_pd(a, b),
            each half self.avx._mm256_sub_pd(a, b),
            self.avx._mm256_sub_ps(a, b)
        }
        fn div8(self, a, b) {
            self.avx512f._mm512_div_pd(a, b),
            each half self.avx._mm256_div_pd(a, b),
            self.avx._mm256_div_ps(a, b)
        }
        fn min8(self, a, b) {
            self.avx512f._mm512_min_pd(a, b),
            each half self.avx._mm256_min_pd(a, b),
            self.avx._mm256_min_ps(a, b)
        }
        fn max8(self, a, b) {
            self.avx512f._mm512_max_pd(a, b),
            each half self.avx._mm256_max_pd(a, b),
            self.avx._mm256_max_ps(a, b)
        }
        fn mul_add8(self, a, b, c) {
            self.avx512f._mm512_fmadd_pd(a, b, c),
            each half self.fma._mm256_fmadd_pd(a, b, c),
            self.fma._mm256_fmadd_ps(a, b, c)
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

    #[inline(always)]
    fn whole<T: RealField + Copy>(a: Lane8<T>) -> Option<__m512d> {
        same::<_, Lane8<f64>>(a).map(|Lane8(a)| must_cast(a))
    }

    #[inline(always)]
    fn halves<T: RealField + Copy>(a: Lane8<T>) -> Option<[__m256d; 2]> {
        same::<_, Lane8<f64>>(a).map(|Lane8(a)| must_cast(a))
    }

    #[inline(always)]
    fn single8<T: RealField + Copy>(a: Lane8<T>) -> Option<__m256> {
        same::<_, Lane8<f32>>(a).map(|Lane8(a)| must_cast(a))
    }

    #[inline(always)]
    fn from_whole<T: RealField + Copy>(a: __m512d) -> Option<Lane8<T>> {
        same(Lane8::<f64>(must_cast(a)))
    }

    #[inline(always)]
    fn from_halves<T: RealField + Copy>(a: [__m256d; 2]) -> Option<Lane8<T>> {
        same(Lane8::<f64>(must_cast(a)))
    }

    #[inline(always)]
    fn from_single8<T: RealField + Copy>(a: __m256) -> Option<Lane8<T>> {
        same(Lane8::<f32>(must_cast(a)))
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
#[cfg(not(test))]
#[inline(never)]
pub(crate) fn dispatch(work: impl Loop) {
    match Arch::new() {
        #[cfg(target_arch = "x86_64")]
        Arch::V4(simd) => Simd::vectorize(simd, Instance(work, simd)),
        #[cfg(target_arch = "x86_64")]
        Arch::V3(simd) => Simd::vectorize(simd, Instance(work, simd)),
        arch => arch.dispatch(Instance(work, Scalar::new())),
    }
}

/// Runs the instance that a test chose on this thread, or else the widest one. One set of instances serves both, so that no
/// kernel is compiled twice.
#[cfg(test)]
#[inline(never)]
pub(crate) fn dispatch(work: impl Loop) {
    tests::LEVEL.get().unwrap_or_else(tests::Level::widest).run(work);
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use nalgebra::SVector;
    use pulp::Scalar;

    use super::*;
    use crate::{
        Body, Grid, Integrator, Material, NoBodyForce, Particles, Settings, Shape, Simulation,
        Transfer,
    };

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

        pub(super) fn widest() -> Self {
            match Arch::new() {
                #[cfg(target_arch = "x86_64")]
                Arch::V4(simd) => Self::V4(simd),
                #[cfg(target_arch = "x86_64")]
                Arch::V3(simd) => Self::V3(simd),
                _ => Self::Scalar,
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

    /// The state of a square or a cube after some steps, as bits, computed by some threads that all have the same instance.
    fn bits<T: RealField + Copy, const D: usize>(
        level: Level,
        threads: usize,
        (shape, integrator, transfer): (Shape, Integrator, Transfer),
    ) -> Vec<u64> {
        let number = nalgebra::convert::<f64, T>;
        // Of three bins in the plane, of two in space.
        let cells = if D == 3 { 7 } else { 21 };
        let spacing = number(1.0 / cells as f64);
        let walls = [[true; 2]; D];
        let grid = Grid { lower: SVector::zeros(), spacing, cells: [cells; D], walls };
        let mut body = Body::lattice(&grid, 2, number(1.0), |_| true);
        for (v, X) in body.particles.v.iter_mut().zip(&body.particles.X) {
            let angle: SVector<T, D> = X * T::pi();
            // Along each axis it changes with the next one too, for gradients off the diagonal.
            *v = SVector::from_fn(|a, _| number(20.0) * angle[a].sin() * angle[(a + 1) % D].cos());
        }
        let material = Material::NeoHookean { lambda: number(5769.0), mu: number(3846.0) };
        let time_step = number(2e-4);
        let settings =
            Settings { shape, integrator, transfer, time_step, halve_first_acceleration: false };
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .start_handler(move |_| LEVEL.set(Some(level)))
            .build()
            .unwrap();
        pool.install(|| {
            let mut simulation = Simulation::new(grid, body, material, settings).unwrap();
            let steps = if D == 3 { 2 } else { 5 };
            (0..steps).for_each(|_| simulation.step(&NoBodyForce).unwrap());
            let Particles { x, v, F, .. } = simulation.particles();
            let numbers = x.iter().chain(v).flatten().chain(F.iter().flatten());
            numbers.map(|&value| nalgebra::convert_unchecked::<T, f64>(value).to_bits()).collect()
        })
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
            vectors.low_and_high(a, b),
        ]
        .map(|Lane4(values)| values)
        .into()
    }

    /// The same for eight numbers.
    fn operations8<T: RealField + Copy>(vectors: impl Vectors) -> Vec<[T; 8]> {
        let lanes = |from: f64| {
            Lane8(std::array::from_fn(|q| nalgebra::convert::<f64, T>((from + q as f64).sqrt())))
        };
        let (a, b, c) = (lanes(2.0), lanes(11.0), lanes(20.0));
        [
            vectors.splat8(a.0[1]),
            vectors.load8(&b.0),
            vectors.add8(a, b),
            vectors.mul8(a, b),
            vectors.sub8(a, b),
            vectors.div8(a, b),
            vectors.min8(a, vectors.splat8(a.0[2])),
            vectors.max8(a, vectors.splat8(a.0[2])),
            vectors.mul_add8(a, b, c),
        ]
        .map(|Lane8(values)| values)
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
            let (double8, single8): (Vec<[f64; 8]>, Vec<[f32; 8]>) = match level {
                Level::Scalar => continue,
                #[cfg(target_arch = "x86_64")]
                Level::V3(simd) => (operations8(simd), operations8(simd)),
                #[cfg(target_arch = "x86_64")]
                Level::V4(simd) => (operations8(simd), operations8(simd)),
            };
            assert_eq!(double8, operations8(Scalar::new()), "{level:?}");
            assert_eq!(single8, operations8(Scalar::new()), "{level:?}");
            assert_eq!(double, operations(Scalar::new()), "{level:?}");
            assert_eq!(single, operations(Scalar::new()), "{level:?}");
        }
    }

    /// Every shape function with every transfer; integrators take turns, so that each meets each shape and each transfer.
    fn schemes() -> impl Iterator<Item = (Shape, Integrator, Transfer)> {
        const SHAPES: [Shape; 7] = [
            Shape::Linear,
            Shape::Ugimp,
            Shape::Gimp,
            Shape::Bspline2,
            Shape::Bspline3,
            Shape::Cpdi,
            Shape::Cpdi2,
        ];
        const TRANSFERS: [Transfer; 4] =
            [Transfer::Flip, Transfer::Pic, Transfer::Apic, Transfer::Xpic(3)];
        const INTEGRATORS: [Integrator; 5] =
            [Integrator::Usf, Integrator::Usl, Integrator::Musl, Integrator::Usavg, Integrator::Cd];
        let pairs = SHAPES.into_iter().enumerate().flat_map(|(i, shape)| {
            TRANSFERS.into_iter().enumerate().map(move |(j, transfer)| (i + 2 * j, shape, transfer))
        });
        pairs.map(|(turn, shape, transfer)| (shape, INTEGRATORS[turn % 5], transfer))
    }

    fn check_bits<T: RealField + Copy, const D: usize>() {
        for scheme in schemes() {
            let plain = bits::<T, D>(Level::Scalar, 1, scheme);
            for (turn, level) in Level::all().into_iter().rev().enumerate() {
                // The widest registers with every number of threads, the others with some.
                for threads in [1, 2, 3].into_iter().filter(|&n| turn == 0 || n == turn + 1) {
                    let same = bits::<T, D>(level, threads, scheme) == plain;
                    assert!(same, "{D} {scheme:?} {level:?} {threads} threads");
                }
            }
        }
    }

    #[test]
    fn all_registers_and_numbers_of_threads_give_the_same_bits() {
        check_bits::<f64, 1>();
        check_bits::<f64, 2>();
        check_bits::<f64, 3>();
        check_bits::<f32, 1>();
        check_bits::<f32, 2>();
        check_bits::<f32, 3>();
    }
}
