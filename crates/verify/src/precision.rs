//! The numbers of runs.

use mmsmith_measure::Compared;
use mmsmith_mpm::{Scalar, Stressed};
use mmsmith_runtime::Real;
use mmsmith_stated_law::Compiled;

/// The numbers of runs in `D` dimensions: `f64` or `f32`. Files have stresses in space.
pub(crate) trait Precision<const D: usize>:
    Real + Scalar<D> + Stressed<3> + Compared<D> + Compiled<D>
{
}

impl<T: Real + Scalar<D> + Stressed<3> + Compared<D> + Compiled<D>, const D: usize> Precision<D>
    for T
{
}
