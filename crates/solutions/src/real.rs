//! The scalars that generated code is generic over.

use nalgebra::RealField;

/// A floating-point scalar: `f32` or `f64`.
///
/// Beyond nalgebra's field it has the two functions that generated code needs and nalgebra lacks: sine and
/// cosine of a multiple of pi. The argument is reduced *before* it is multiplied by pi, which is exact, so that
/// `sin_pi(1)` is zero and a phase of a million periods loses no digits to the rounding of pi.
pub trait Real: RealField + Copy {
    /// The nearest value of this type.
    fn nearest(value: f64) -> Self;
    /// The value in double precision; exact for both types.
    fn to_f64(self) -> f64;
    /// `sin(pi x)`.
    fn sin_pi(self) -> Self;
    /// `cos(pi x)`.
    fn cos_pi(self) -> Self;
}

macro_rules! implement_real {
    ($float:ty, $pi:expr, $shift:expr) => {
        impl Real for $float {
            #[inline]
            fn nearest(value: f64) -> Self {
                value as $float
            }

            #[inline]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }

            #[inline]
            fn sin_pi(self) -> Self {
                let (quadrant, r) = reduced(self);
                match quadrant {
                    0 => r.sin(),
                    1 => r.cos(),
                    2 => -r.sin(),
                    _ => -r.cos(),
                }
            }

            #[inline]
            fn cos_pi(self) -> Self {
                let (quadrant, r) = reduced(self);
                match quadrant {
                    0 => r.cos(),
                    1 => -r.sin(),
                    2 => -r.cos(),
                    _ => r.sin(),
                }
            }
        }

        /// `x = n/2 + r/pi` with `|r| <= pi/4`: the remainder of `n` by four, and `r`.
        #[inline]
        fn reduced(x: $float) -> (u8, $float) {
            // One and a half times the power of two from which on floats are whole numbers: adding it rounds, and the
            // last two bits of the sum are those of the whole number.
            const SHIFT: $float = $shift;
            let halves = 2.0 * x;
            let (n, quadrant) = if halves.abs() < SHIFT / 3.0 {
                let shifted = halves + SHIFT;
                (shifted - SHIFT, (shifted.to_bits() & 3) as u8)
            } else {
                // A whole number or not a number; both are rare.
                let n = halves.round();
                (n, n.rem_euclid(4.0) as u8)
            };
            // All but the product is exact.
            (quadrant, (x - n * 0.5) * $pi)
        }
    };
}

mod single {
    use super::Real;
    implement_real!(f32, std::f32::consts::PI, 12_582_912.0);
}
mod double {
    use super::Real;
    implement_real!(f64, std::f64::consts::PI, 6_755_399_441_055_744.0);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_at_multiples_of_a_half() {
        for n in -8..=8_i32 {
            let x = f64::from(n) / 2.0;
            let sine = [0.0, 1.0, 0.0, -1.0][n.rem_euclid(4) as usize];
            let cosine = [1.0, 0.0, -1.0, 0.0][n.rem_euclid(4) as usize];
            assert_eq!((x.sin_pi(), x.cos_pi()), (sine, cosine), "x = {x}");
        }
    }

    #[test]
    fn agrees_with_the_plain_functions_and_keeps_the_phase_of_large_arguments() {
        for k in 0..1000 {
            let x = f64::from(k) * 0.00731 - 3.0;
            let phase = x * std::f64::consts::PI;
            assert!((x.sin_pi() - phase.sin()).abs() < 2e-15, "sin_pi({x})");
            assert!((x.cos_pi() - phase.cos()).abs() < 2e-15, "cos_pi({x})");
        }
        let far = 2.0 * 1e6 + 0.25;
        assert_eq!(far.sin_pi(), 0.25_f64.sin_pi());
        assert_eq!(far.cos_pi(), 0.25_f64.cos_pi());
    }

    #[test]
    fn not_a_number_stays_so() {
        assert!(f64::NAN.sin_pi().is_nan());
        assert!(f64::INFINITY.cos_pi().is_nan());
    }
}
