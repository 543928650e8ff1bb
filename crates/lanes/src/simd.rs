//! Instances of a loop for the vector instructions of the processor, chosen at run time.
//!
//! The instances differ in the width of registers alone. No sum is reordered, and only explicit `mul_add` is fused, by many
//! instructions where the processor has no single one. All instances thus give the same bits.

use std::hint::black_box;
use std::ops::{Add, Mul, Sub};
use std::sync::atomic::{AtomicU8, Ordering};

use bytemuck::Pod;
use nalgebra::RealField;
#[cfg(target_arch = "x86_64")]
use pulp::Arch;
use pulp::{Scalar, Simd, WithSimd};

use crate::tensor::real;

/// A loop for vector instructions. `run` and all functions that it calls have to be `#[inline(always)]`.
pub trait Loop {
    /// Whether there is an instance for registers of 512 bits, which takes time to compile.
    const IS_WIDE: bool = false;

    /// The loop, with the operations of the registers.
    fn run<V: Vectors>(self, vectors: V);
}

/// Whether kernels for numbers of this type in so many dimensions have an instance for registers of 512 bits: those of long runs have.
pub const fn is_wide<T, const D: usize>() -> bool {
    size_of::<T>() == size_of::<f64>() && D > 1
}

/// Four numbers in the lanes of one register.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct Lane4<T>(pub [T; 4]);

/// Eight numbers in the lanes of one register in single precision, and in double precision where registers have 512 bits; of two registers elsewhere.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Lane8<T>(pub [T; 8]);

impl<T: RealField + Copy> Lane4<T> {
    #[inline(always)]
    /// Four zeros.
    pub fn zero() -> Self {
        Self([T::zero(); 4])
    }
}

impl<T: RealField + Copy> Lane8<T> {
    #[inline(always)]
    /// Eight zeros.
    pub fn zero() -> Self {
        Self([T::zero(); 8])
    }
}

/// Operations on [`Lane4`] and [`Lane8`]. The compiler vectorises loops over many particles by itself, but not always the four numbers of
/// one particle.
pub trait Vectors: Copy {
    /// Four times the same.
    fn splat<T: Lanes>(self, value: T) -> Lane4<T>;
    /// Four numbers from memory in one load; the compiler may split a plain copy into smaller loads.
    fn load<T: Lanes>(self, values: &[T; 4]) -> Lane4<T>;
    /// `a + b`.
    fn add<T: Lanes>(self, a: Lane4<T>, b: Lane4<T>) -> Lane4<T>;
    /// `a - b`.
    fn sub<T: Lanes>(self, a: Lane4<T>, b: Lane4<T>) -> Lane4<T>;
    /// `a b`.
    fn mul<T: Lanes>(self, a: Lane4<T>, b: Lane4<T>) -> Lane4<T>;
    /// `a b + c`, rounded once.
    fn mul_add<T: Lanes>(self, a: Lane4<T>, b: Lane4<T>, c: Lane4<T>) -> Lane4<T>;
    /// `a b - c`, rounded once.
    fn mul_sub<T: Lanes>(self, a: Lane4<T>, b: Lane4<T>, c: Lane4<T>) -> Lane4<T>;
    /// `[a0, a0, a2, a2]`.
    fn even<T: Lanes>(self, a: Lane4<T>) -> Lane4<T>;
    /// `[a1, a1, a3, a3]`.
    fn odd<T: Lanes>(self, a: Lane4<T>) -> Lane4<T>;
    /// `[a0, a1, a0, a1]`.
    fn low_twice<T: Lanes>(self, a: Lane4<T>) -> Lane4<T>;
    /// `[0, 0, a0, a1]`.
    fn low_to_high<T: Lanes>(self, a: Lane4<T>) -> Lane4<T>;
    /// `[0, 0, a2, a3]`.
    fn high_alone<T: Lanes>(self, a: Lane4<T>) -> Lane4<T>;
    /// `[a2, a3, b0, b1]`.
    fn high_and_low<T: Lanes>(self, a: Lane4<T>, b: Lane4<T>) -> Lane4<T>;
    /// `[a0, a1, b2, b3]`.
    fn low_and_high<T: Lanes>(self, a: Lane4<T>, b: Lane4<T>) -> Lane4<T>;
    /// Eight times the same.
    fn splat8<T: Lanes>(self, value: T) -> Lane8<T>;
    /// Eight numbers from memory in one load.
    fn load8<T: Lanes>(self, values: &[T; 8]) -> Lane8<T>;
    /// `a + b`.
    fn add8<T: Lanes>(self, a: Lane8<T>, b: Lane8<T>) -> Lane8<T>;
    /// `a - b`.
    fn sub8<T: Lanes>(self, a: Lane8<T>, b: Lane8<T>) -> Lane8<T>;
    /// `a b`.
    fn mul8<T: Lanes>(self, a: Lane8<T>, b: Lane8<T>) -> Lane8<T>;
    /// `a / b`.
    fn div8<T: Lanes>(self, a: Lane8<T>, b: Lane8<T>) -> Lane8<T>;
    /// `a b + c`, rounded once.
    fn mul_add8<T: Lanes>(self, a: Lane8<T>, b: Lane8<T>, c: Lane8<T>) -> Lane8<T>;
    /// `a b` in the lower four lanes. The upper lanes have no defined value, but zeros of `a` stay zeros, of either sign. Where registers have 256 bits
    /// this is half the work.
    fn mul_low<T: Lanes>(self, a: Lane8<T>, b: Lane8<T>) -> Lane8<T>;
    /// `a b` in the upper four lanes; the lower ones are as the upper ones of [`mul_low`](Self::mul_low).
    fn mul_high<T: Lanes>(self, a: Lane8<T>, b: Lane8<T>) -> Lane8<T>;
    /// `a b + c` in the lower four lanes, rounded once. The upper lanes have no defined value, but keep `c` where `a` is zero; a zero may change its
    /// sign.
    fn mul_add_low<T: Lanes>(self, a: Lane8<T>, b: Lane8<T>, c: Lane8<T>) -> Lane8<T>;
    /// `a b + c` in the upper four lanes, rounded once; the lower ones are as the upper ones of [`mul_add_low`](Self::mul_add_low).
    fn mul_add_high<T: Lanes>(self, a: Lane8<T>, b: Lane8<T>, c: Lane8<T>) -> Lane8<T>;
    /// The smaller of both; `b` where one is not a number.
    fn min8<T: Lanes>(self, a: Lane8<T>, b: Lane8<T>) -> Lane8<T>;
    /// The larger of both; `b` where one is not a number.
    fn max8<T: Lanes>(self, a: Lane8<T>, b: Lane8<T>) -> Lane8<T>;
    /// Asks for the memory of a value that will be read soon.
    fn prefetch<A>(self, value: &A);
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
            fn splat<T: Lanes>(self, value: T) -> Lane4<T> {
                Lane4([value; 4])
            }

            #[inline(always)]
            fn load<T: Lanes>(self, values: &[T; 4]) -> Lane4<T> {
                Lane4(*values)
            }

            #[inline(always)]
            fn splat8<T: Lanes>(self, value: T) -> Lane8<T> {
                Lane8([value; 8])
            }

            #[inline(always)]
            fn load8<T: Lanes>(self, values: &[T; 8]) -> Lane8<T> {
                Lane8(*values)
            }

            #[inline(always)]
            fn prefetch<A>(self, _: &A) {}

            $(
                #[cfg_attr(target_arch = "x86_64", inline(never))]
                #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
                fn $name<T: Lanes>(self, $($a: $of<T>),+) -> $of<T> {
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
                fn $move<T: Lanes>(self, $(Lane4($b): Lane4<T>),+) -> Lane4<T> {
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
    fn mul_low(a, b; q of Lane8) { if q < 4 { a[q] * b[q] } else { a[q] } }
    fn mul_high(a, b; q of Lane8) { if q < 4 { a[q] } else { a[q] * b[q] } }
    fn mul_add_low(a, b, c; q of Lane8) { if q < 4 { a[q].mul_add(b[q], c[q]) } else { c[q] } }
    fn mul_add_high(a, b, c; q of Lane8) { if q < 4 { c[q] } else { a[q].mul_add(b[q], c[q]) } }
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

/// Numbers with the operations that formulas for one particle need, so that these hold for eight at once as well.
pub trait Number: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// The quotient.
    fn divided_by(self, divisor: Self) -> Self;
    /// A constant like this number.
    fn constant(self, value: f64) -> Self;
}

/// One number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct One<T>(pub T);

/// A number of each of eight particles.
#[derive(Clone, Copy, Debug)]
pub struct Eight<T, V> {
    /// The numbers.
    pub lanes: Lane8<T>,
    /// The operations of the registers.
    pub vectors: V,
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

        impl<T: Lanes, V: Vectors> $trait for Eight<T, V> {
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

impl<T: Lanes, V: Vectors> Number for Eight<T, V> {
    #[inline(always)]
    fn divided_by(self, divisor: Self) -> Self {
        Self { lanes: self.vectors.div8(self.lanes, divisor.lanes), ..self }
    }

    #[inline(always)]
    fn constant(self, value: f64) -> Self {
        Self { lanes: self.vectors.splat8(real(value)), ..self }
    }
}

/// A number that registers hold several of: `f64` or `f32`.
///
/// The operations are functions of the number's type, not questions for it: a kernel calls them some thousand times, and each
/// question would have to be answered for each call before anything else is compiled.
#[cfg(target_arch = "x86_64")]
pub trait Lanes: RealField + Pod + x86::WideInstructions {}

/// A number that registers hold several of: `f64` or `f32`.
#[cfg(not(target_arch = "x86_64"))]
pub trait Lanes: RealField + Pod {}

impl Lanes for f64 {}
impl Lanes for f32 {}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Lane4, Lane8, Lanes, Vectors};
    use bytemuck::{bytes_of, must_cast, pod_read_unaligned};
    use pulp::x86::{V3, V4};
    use std::arch::x86_64::{__m128, __m256, __m256d, __m512d, _MM_HINT_T0};

    /// Bytes that pass from memory at once.
    const CACHE_LINE: usize = 64;

    /// The instructions for an operation on four numbers and for one on eight, in double and in single precision.
    macro_rules! instructions {
        (
            $(fn $four:ident($vectors:ident, $($a:ident),*) { $double:expr, $single:expr })*
            eight:
            $(fn $eight:ident($vectors8:ident, $($a8:ident),*) {
                each half $half:expr, whole $whole:expr, $single8:expr
            })*
            one_half:
            $(fn $one_half:ident($vectors1:ident, $($a1:ident),*) {
                half $of_one:tt of $other:ident, $of_half:expr, like $whole_op:ident
            })*
        ) => {
            /// The operations of [`Vectors`] in registers of up to 256 bits.
            pub trait Instructions: Sized {
                $(fn $four(vectors: V3, $($a: Lane4<Self>),*) -> Lane4<Self>;)*
                $(fn $eight(vectors: V3, $($a8: Lane8<Self>),*) -> Lane8<Self>;)*
                $(fn $one_half(vectors: V3, $($a1: Lane8<Self>),*) -> Lane8<Self>;)*
                fn splat(vectors: V3, value: Self) -> Lane4<Self>;
                fn splat8(vectors: V3, value: Self) -> Lane8<Self>;
                fn load(vectors: V3, values: &[Self; 4]) -> Lane4<Self>;
                fn load8(vectors: V3, values: &[Self; 8]) -> Lane8<Self>;
            }

            /// The operations on eight numbers where registers have 512 bits. Default: those of narrower registers, which hold eight numbers in
            /// single precision.
            pub trait WideInstructions: Instructions {
                $(#[inline(always)]
                fn $eight(vectors: V4, $($a8: Lane8<Self>),*) -> Lane8<Self> {
                    <Self as Instructions>::$eight(*vectors, $($a8),*)
                })*

                $(#[inline(always)]
                fn $one_half(vectors: V4, $($a1: Lane8<Self>),*) -> Lane8<Self> {
                    <Self as WideInstructions>::$whole_op(vectors, $($a1),*)
                })*

                #[inline(always)]
                fn splat8(vectors: V4, value: Self) -> Lane8<Self> {
                    <Self as Instructions>::splat8(*vectors, value)
                }

                #[inline(always)]
                fn load8(vectors: V4, values: &[Self; 8]) -> Lane8<Self> {
                    <Self as Instructions>::load8(*vectors, values)
                }
            }

            impl WideInstructions for f32 {}

            impl WideInstructions for f64 {
                $(#[inline(always)]
                fn $eight($vectors8: V4, $($a8: Lane8<Self>),*) -> Lane8<Self> {
                    $(let $a8: __m512d = must_cast($a8.0);)*
                    Lane8(must_cast($whole))
                })*

                #[inline(always)]
                fn splat8(vectors: V4, value: Self) -> Lane8<Self> {
                    Lane8(must_cast(vectors.avx512f._mm512_set1_pd(value)))
                }

                #[inline(always)]
                fn load8(_: V4, values: &[Self; 8]) -> Lane8<Self> {
                    Lane8(must_cast(pod_read_unaligned::<__m512d>(bytes_of(values))))
                }
            }

            impl Instructions for f64 {
                $(#[inline(always)]
                fn $four($vectors: V3, $($a: Lane4<Self>),*) -> Lane4<Self> {
                    $(let $a: __m256d = must_cast($a.0);)*
                    Lane4(must_cast($double))
                })*

                $(#[inline(always)]
                fn $eight($vectors8: V3, $($a8: Lane8<Self>),*) -> Lane8<Self> {
                    $(let $a8: [__m256d; 2] = must_cast($a8.0);)*
                    let low = {
                        $(let $a8 = $a8[0];)*
                        $half
                    };
                    let high = {
                        $(let $a8 = $a8[1];)*
                        $half
                    };
                    Lane8(must_cast([low, high]))
                })*

                $(#[inline(always)]
                fn $one_half($vectors1: V3, $($a1: Lane8<Self>),*) -> Lane8<Self> {
                    $(let $a1: [__m256d; 2] = must_cast($a1.0);)*
                    let mut halves = $other;
                    $(let $a1 = $a1[$of_one];)*
                    halves[$of_one] = $of_half;
                    Lane8(must_cast(halves))
                })*

                #[inline(always)]
                fn splat(vectors: V3, value: Self) -> Lane4<Self> {
                    Lane4(must_cast(vectors.avx._mm256_set1_pd(value)))
                }

                #[inline(always)]
                fn splat8(vectors: V3, value: Self) -> Lane8<Self> {
                    Lane8(must_cast([vectors.avx._mm256_set1_pd(value); 2]))
                }

                #[inline(always)]
                fn load(_: V3, values: &[Self; 4]) -> Lane4<Self> {
                    Lane4(must_cast(pod_read_unaligned::<__m256d>(bytes_of(values))))
                }

                #[inline(always)]
                fn load8(_: V3, values: &[Self; 8]) -> Lane8<Self> {
                    Lane8(must_cast(pod_read_unaligned::<[__m256d; 2]>(bytes_of(values))))
                }
            }

            impl Instructions for f32 {
                $(#[inline(always)]
                fn $four($vectors: V3, $($a: Lane4<Self>),*) -> Lane4<Self> {
                    $(let $a: __m128 = must_cast($a.0);)*
                    Lane4(must_cast($single))
                })*

                $(#[inline(always)]
                fn $eight($vectors8: V3, $($a8: Lane8<Self>),*) -> Lane8<Self> {
                    $(let $a8: __m256 = must_cast($a8.0);)*
                    Lane8(must_cast($single8))
                })*

                $(#[inline(always)]
                fn $one_half(vectors: V3, $($a1: Lane8<Self>),*) -> Lane8<Self> {
                    <Self as Instructions>::$whole_op(vectors, $($a1),*)
                })*

                #[inline(always)]
                fn splat(vectors: V3, value: Self) -> Lane4<Self> {
                    Lane4(must_cast(vectors.sse._mm_set1_ps(value)))
                }

                #[inline(always)]
                fn splat8(vectors: V3, value: Self) -> Lane8<Self> {
                    Lane8(must_cast(vectors.avx._mm256_set1_ps(value)))
                }

                #[inline(always)]
                fn load(_: V3, values: &[Self; 4]) -> Lane4<Self> {
                    Lane4(must_cast(pod_read_unaligned::<__m128>(bytes_of(values))))
                }

                #[inline(always)]
                fn load8(_: V3, values: &[Self; 8]) -> Lane8<Self> {
                    Lane8(must_cast(pod_read_unaligned::<__m256>(bytes_of(values))))
                }
            }

            impl Vectors for V4 {
                $(#[inline(always)]
                fn $four<T: Lanes>(self, $($a: Lane4<T>),*) -> Lane4<T> {
                    <T as Instructions>::$four(*self, $($a),*)
                })*

                $(#[inline(always)]
                fn $eight<T: Lanes>(self, $($a8: Lane8<T>),*) -> Lane8<T> {
                    <T as WideInstructions>::$eight(self, $($a8),*)
                })*

                $(#[inline(always)]
                fn $one_half<T: Lanes>(self, $($a1: Lane8<T>),*) -> Lane8<T> {
                    <T as WideInstructions>::$one_half(self, $($a1),*)
                })*

                #[inline(always)]
                fn splat<T: Lanes>(self, value: T) -> Lane4<T> {
                    <T as Instructions>::splat(*self, value)
                }

                #[inline(always)]
                fn splat8<T: Lanes>(self, value: T) -> Lane8<T> {
                    <T as WideInstructions>::splat8(self, value)
                }

                #[inline(always)]
                fn load<T: Lanes>(self, values: &[T; 4]) -> Lane4<T> {
                    <T as Instructions>::load(*self, values)
                }

                #[inline(always)]
                fn load8<T: Lanes>(self, values: &[T; 8]) -> Lane8<T> {
                    <T as WideInstructions>::load8(self, values)
                }

                #[inline(always)]
                fn prefetch<A>(self, value: &A) {
                    (*self).prefetch(value);
                }
            }

            impl Vectors for V3 {
                $(#[inline(always)]
                fn $four<T: Lanes>(self, $($a: Lane4<T>),*) -> Lane4<T> {
                    <T as Instructions>::$four(self, $($a),*)
                })*

                $(#[inline(always)]
                fn $eight<T: Lanes>(self, $($a8: Lane8<T>),*) -> Lane8<T> {
                    <T as Instructions>::$eight(self, $($a8),*)
                })*

                $(#[inline(always)]
                fn $one_half<T: Lanes>(self, $($a1: Lane8<T>),*) -> Lane8<T> {
                    <T as Instructions>::$one_half(self, $($a1),*)
                })*

                #[inline(always)]
                fn splat<T: Lanes>(self, value: T) -> Lane4<T> {
                    <T as Instructions>::splat(self, value)
                }

                #[inline(always)]
                fn splat8<T: Lanes>(self, value: T) -> Lane8<T> {
                    <T as Instructions>::splat8(self, value)
                }

                #[inline(always)]
                fn load<T: Lanes>(self, values: &[T; 4]) -> Lane4<T> {
                    <T as Instructions>::load(self, values)
                }

                #[inline(always)]
                fn load8<T: Lanes>(self, values: &[T; 8]) -> Lane8<T> {
                    <T as Instructions>::load8(self, values)
                }

                #[inline(always)]
                fn prefetch<A>(self, value: &A) {
                    let first = std::ptr::from_ref(value).cast::<i8>();
                    for line in (0..size_of::<A>()).step_by(CACHE_LINE) {
                        self.sse._mm_prefetch::<_MM_HINT_T0>(first.wrapping_add(line));
                    }
                }
            }
        };
    }

    instructions! {
        fn add(vectors, a, b) { vectors.avx._mm256_add_pd(a, b), vectors.sse._mm_add_ps(a, b) }
        fn sub(vectors, a, b) { vectors.avx._mm256_sub_pd(a, b), vectors.sse._mm_sub_ps(a, b) }
        fn mul(vectors, a, b) { vectors.avx._mm256_mul_pd(a, b), vectors.sse._mm_mul_ps(a, b) }
        fn mul_add(vectors, a, b, c) { vectors.fma._mm256_fmadd_pd(a, b, c), vectors.fma._mm_fmadd_ps(a, b, c) }
        fn mul_sub(vectors, a, b, c) { vectors.fma._mm256_fmsub_pd(a, b, c), vectors.fma._mm_fmsub_ps(a, b, c) }
        fn even(vectors, a) { vectors.avx._mm256_movedup_pd(a), vectors.sse3._mm_moveldup_ps(a) }
        fn odd(vectors, a) { vectors.avx._mm256_permute_pd::<0b1111>(a), vectors.sse3._mm_movehdup_ps(a) }
        fn low_twice(vectors, a) {
            vectors.avx._mm256_permute2f128_pd::<0x00>(a, a), vectors.sse._mm_movelh_ps(a, a)
        }
        fn low_to_high(vectors, a) {
            vectors.avx._mm256_permute2f128_pd::<0x08>(a, a),
            vectors.sse._mm_movelh_ps(vectors.sse._mm_setzero_ps(), a)
        }
        fn high_alone(vectors, a) {
            vectors.avx._mm256_permute2f128_pd::<0x18>(a, a),
            vectors.sse._mm_shuffle_ps::<0b11_10_01_00>(vectors.sse._mm_setzero_ps(), a)
        }
        fn high_and_low(vectors, a, b) {
            vectors.avx._mm256_permute2f128_pd::<0x21>(a, b),
            vectors.sse._mm_shuffle_ps::<0b01_00_11_10>(a, b)
        }
        fn low_and_high(vectors, a, b) {
            vectors.avx._mm256_blend_pd::<0b1100>(a, b), vectors.sse4_1._mm_blend_ps::<0b1100>(a, b)
        }
        eight:
        fn add8(vectors, a, b) {
            each half vectors.avx._mm256_add_pd(a, b),
            whole vectors.avx512f._mm512_add_pd(a, b),
            vectors.avx._mm256_add_ps(a, b)
        }
        fn mul8(vectors, a, b) {
            each half vectors.avx._mm256_mul_pd(a, b),
            whole vectors.avx512f._mm512_mul_pd(a, b),
            vectors.avx._mm256_mul_ps(a, b)
        }
        fn sub8(vectors, a, b) {
            each half vectors.avx._mm256_sub_pd(a, b),
            whole vectors.avx512f._mm512_sub_pd(a, b),
            vectors.avx._mm256_sub_ps(a, b)
        }
        fn div8(vectors, a, b) {
            each half vectors.avx._mm256_div_pd(a, b),
            whole vectors.avx512f._mm512_div_pd(a, b),
            vectors.avx._mm256_div_ps(a, b)
        }
        fn min8(vectors, a, b) {
            each half vectors.avx._mm256_min_pd(a, b),
            whole vectors.avx512f._mm512_min_pd(a, b),
            vectors.avx._mm256_min_ps(a, b)
        }
        fn max8(vectors, a, b) {
            each half vectors.avx._mm256_max_pd(a, b),
            whole vectors.avx512f._mm512_max_pd(a, b),
            vectors.avx._mm256_max_ps(a, b)
        }
        fn mul_add8(vectors, a, b, c) {
            each half vectors.fma._mm256_fmadd_pd(a, b, c),
            whole vectors.avx512f._mm512_fmadd_pd(a, b, c),
            vectors.fma._mm256_fmadd_ps(a, b, c)
        }
        one_half:
        fn mul_low(vectors, a, b) { half 0 of a, vectors.avx._mm256_mul_pd(a, b), like mul8 }
        fn mul_high(vectors, a, b) { half 1 of a, vectors.avx._mm256_mul_pd(a, b), like mul8 }
        fn mul_add_low(vectors, a, b, c) {
            half 0 of c, vectors.fma._mm256_fmadd_pd(a, b, c), like mul_add8
        }
        fn mul_add_high(vectors, a, b, c) {
            half 1 of c, vectors.fma._mm256_fmadd_pd(a, b, c), like mul_add8
        }
    }
}

struct Instance<L, V>(L, V);

impl<L: Loop, V: Vectors> WithSimd for Instance<L, V> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        // A local variable that has to begin at a cache line makes the compiler align the whole frame. Else registers that the compiler spills lie across
        // cache lines, and in some frames across pages of memory, where a load waits some 40 cycles for its store.
        let mut at_whole_lines = Lane8([0.0_f64; 8]);
        black_box(&mut at_whole_lines);
        self.0.run(self.1);
    }
}

/// Vector registers, the narrowest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Registers {
    /// None: one number after the other.
    Scalar,
    /// Registers of four doubles (AVX2 with fused multiply-adds).
    Avx2,
    /// Registers of eight doubles (AVX-512).
    Avx512,
}

/// The widest registers that kernels may use.
static ALLOWED: AtomicU8 = AtomicU8::new(Registers::WIDEST as u8);

impl Registers {
    /// The widest that kernels know.
    pub const WIDEST: Self = Self::Avx512;

    /// The registers that this processor has.
    pub fn present() -> Vec<Self> {
        #[cfg(target_arch = "x86_64")]
        match Arch::new() {
            Arch::V4(_) => return vec![Self::Scalar, Self::Avx2, Self::Avx512],
            Arch::V3(_) => return vec![Self::Scalar, Self::Avx2],
            _ => {}
        }
        vec![Self::Scalar]
    }

    /// Keeps all kernels of this process from wider registers than these. No result depends on it.
    pub fn use_at_most(self) {
        ALLOWED.store(self as u8, Ordering::Relaxed);
    }
}

/// Runs the widest instance that this processor supports and that is [allowed](Registers::use_at_most).
#[inline(never)]
pub fn dispatch<L: Loop>(work: L) {
    #[cfg(target_arch = "x86_64")]
    {
        let (arch, allowed) = (Arch::new(), ALLOWED.load(Ordering::Relaxed));
        if L::IS_WIDE
            && let Arch::V4(simd) = arch
            && allowed > Registers::Avx2 as u8
        {
            return Simd::vectorize(simd, Instance(work, simd));
        }
        let avx2 = match arch {
            Arch::V4(simd) => Some(*simd),
            Arch::V3(simd) => Some(simd),
            _ => None,
        };
        match avx2.filter(|_| allowed > Registers::Scalar as u8) {
            Some(simd) => Simd::vectorize(simd, Instance(work, simd)),
            None => Scalar::new().vectorize(Instance(work, Scalar::new())),
        }
    }
    // Elsewhere there are no registers to choose: those that the target has are compiled in.
    #[cfg(not(target_arch = "x86_64"))]
    Scalar::new().vectorize(Instance(work, Scalar::new()));
}

/// Runs the widest instance of a loop over plain arrays that this processor supports.
///
/// A module of WebAssembly cannot ask which instructions its browser has, and has the instance for one number after the other alone.
#[inline(always)]
pub fn widest<W: WithSimd>(work: W) -> W::Output {
    #[cfg(target_family = "wasm")]
    let found = Scalar::new().vectorize(work);
    #[cfg(not(target_family = "wasm"))]
    let found = pulp::Arch::new().dispatch(work);
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ops::Range;

    /// All operations on some numbers, one after the other.
    fn operations<T: Lanes>(vectors: impl Vectors) -> Vec<[T; 4]> {
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

    /// All operations on eight lanes, one after the other.
    fn operations8<T: Lanes>(vectors: impl Vectors) -> Vec<[T; 8]> {
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

    /// The operations on half of eight lanes, one after the other: where the other half of `a` is zero, what is left of it and of `c`.
    fn operations_of_halves<T: Lanes>(vectors: impl Vectors) -> Vec<[T; 8]> {
        let lanes = |from: f64, of: Range<usize>| {
            let value = |q: usize| if of.contains(&q) { (from + q as f64).sqrt() } else { 0.0 };
            Lane8(std::array::from_fn(|q| nalgebra::convert::<f64, T>(value(q))))
        };
        let (low, high) = (lanes(2.0, 0..4), lanes(3.0, 4..8));
        let (b, c) = (lanes(11.0, 0..8), lanes(20.0, 0..8));
        [
            vectors.mul_low(low, b),
            vectors.mul_high(high, b),
            vectors.mul_add_low(low, b, c),
            vectors.mul_add_high(high, b, c),
        ]
        .map(|Lane8(values)| values)
        .into()
    }

    #[cfg(target_arch = "x86_64")]
    fn check(simd: impl Vectors) {
        assert_eq!(operations::<f64>(simd), operations::<f64>(Scalar::new()));
        assert_eq!(operations::<f32>(simd), operations::<f32>(Scalar::new()));
        assert_eq!(operations8::<f64>(simd), operations8::<f64>(Scalar::new()));
        assert_eq!(operations_of_halves::<f64>(simd), operations_of_halves(Scalar::new()));
        assert_eq!(operations_of_halves::<f32>(simd), operations_of_halves(Scalar::new()));
        assert_eq!(operations8::<f32>(simd), operations8::<f32>(Scalar::new()));
    }

    #[cfg(target_arch = "x86_64")]
    #[test]
    fn instructions_do_what_is_written_out_for_processors_without_them() {
        pulp::x86::V3::try_new().into_iter().for_each(check);
        pulp::x86::V4::try_new().into_iter().for_each(check);
    }
}
