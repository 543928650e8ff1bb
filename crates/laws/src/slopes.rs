//! Numbers that carry slopes: dual numbers in place of the numbers of a solver.

use nalgebra::RealField;

/// Whether numbers carry slopes: dual numbers are wider than those that solvers compute with.
pub(crate) const fn carries_slopes<T>() -> bool {
    size_of::<T>() > size_of::<f64>()
}

/// A value in place of a number, with no slopes.
pub(crate) fn without_slopes<T: RealField + Copy>(number: T) -> T {
    nalgebra::convert(nalgebra::convert_unchecked::<T, f64>(number))
}
