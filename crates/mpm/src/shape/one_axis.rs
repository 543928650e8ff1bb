//! Shape functions on one axis: hat functions, GIMP, quadratic and cubic splines. A weight `S_ip` is their product over the axes.
//!
//! All lengths are in cells (`h = 1`). Positions count from the lower corner of the grid, `xi = (x - lower) / h`; half-sizes `l`
//! of particle boxes and gradients are per cell too.
//!
//! To add one: name it in [`Shape`](crate::Shape), implement [`ShapeFunction`] here and add it to [`OnAxis`]. The compiler tells of the rest, which is
//! in this file, in `kernel/product.rs` and beside its name.

use mmsmith_lanes::tensor::real;
use nalgebra::{RealField, SVector};

use crate::every_scheme::EVERY_SCHEME;
use crate::grid::PAD_BELOW;

/// Largest supported half-size of a particle's box, in cells.
pub(crate) const HALF_SIZE_LIMIT: f64 = 2.0;

/// Least half-size of a stretching box, in cells: a quarter turn makes `F_aa` zero, and the weights divide by the half-size.
pub(crate) const LEAST_HALF_SIZE: f64 = 1e-6;
/// Nodes along each axis of the extended support, which the largest box needs.
pub(crate) const EXTENDED: usize = 6;

/// Nodes along an axis of a box of at most two cells.
pub(crate) const OF_TWO_CELLS: usize = 4;
/// How far a quadratic spline reaches beyond a hat function, in cells.
const HALF_A_CELL: f64 = 0.5;

/// Weights and gradients at `W` successive nodes of one axis: entry `k` of each array belongs to node `base + k`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AxisWeights<T, const W: usize> {
    /// Index of the first node in the padded grid: a whole number, stored as a double for the sake of vector instructions.
    pub(crate) base: f64,
    pub(crate) S: [T; W],
    pub(crate) G: [T; W],
}

impl<T: RealField + Copy, const W: usize> AxisWeights<T, W> {
    /// A position `xi` counted from the first node.
    #[inline(always)]
    pub(crate) fn after_first(&self, xi: T) -> T {
        xi - real(self.base - PAD_BELOW as f64)
    }
}

/// The inertia along an axis, `sum S arm^2` in cells squared, of weights about a position counted from the first node.
#[inline(always)]
pub(crate) fn moment<T: RealField + Copy, const W: usize>(S: &[T; W], after_first: T) -> T {
    let mut sum = T::zero();
    for (i, S) in S.iter().enumerate() {
        let arm = real::<T>(i as f64) - after_first;
        sum += *S * arm * arm;
    }
    sum
}

/// The weights along all axes of a box with extended support.
pub(crate) fn extended_axes<T: RealField + Copy, const D: usize>(
    on_axis: OnAxis,
    xi: &[T; D],
    l: &[T; D],
) -> [AxisWeights<T, EXTENDED>; D] {
    std::array::from_fn(|a| match on_axis {
        OnAxis::QuadraticMean => extended_spline(xi[a], l[a]),
        _ => extended_axis(xi[a], l[a]),
    })
}

/// A shape function along one axis, with `W` nodes.
pub(crate) trait ShapeFunction<const W: usize>: Copy + Send + Sync + 'static {
    /// By how much a half-size exceeds that of the particle's own box.
    const BEYOND_BOX: f64 = 0.0;

    /// The weights at `xi` for a half-size without extended support.
    fn axis_weights<T: RealField + Copy>(xi: T, l: T) -> AxisWeights<T, W>;
}

/// Hat functions at the particle's centre.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hat;

impl ShapeFunction<2> for Hat {
    #[inline(always)]
    fn axis_weights<T: RealField + Copy>(xi: T, _l: T) -> AxisWeights<T, 2> {
        let (base, node) = node_below(xi);
        let r = xi - node;
        AxisWeights { base, S: [T::one() - r, r], G: [-T::one(), T::one()] }
    }
}

/// Means of hat functions over a box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gimp;

impl ShapeFunction<3> for Gimp {
    #[inline(always)]
    fn axis_weights<T: RealField + Copy>(xi: T, l: T) -> AxisWeights<T, 3> {
        gimp_axis(xi, l)
    }
}

/// Quadratic B-splines at the particle's centre, over three cells.
///
/// Steffen, Kirby and Berzins, Analysis and reduction of quadrature errors in the material point method, 2008.
#[derive(Clone, Copy, Debug)]
pub(crate) struct QuadraticSpline;

impl ShapeFunction<3> for QuadraticSpline {
    /// As of a box over one cell: the first node is the one below its lower edge, and `l` is 1/2.
    #[inline(always)]
    fn axis_weights<T: RealField + Copy>(xi: T, l: T) -> AxisWeights<T, 3> {
        let one = T::one();
        let (base, node) = node_below(xi - l);
        // From the middle of the first cell, between 0 and 1.
        let r = xi - l - node;
        let s = one - r;
        let (S0, S2) = (s * s * real(0.5), r * r * real(0.5));
        AxisWeights { base, S: [S0, one - S0 - S2, S2], G: [-s, s - r, r] }
    }
}

/// Cubic B-splines at the particle's centre, over four cells; source as of [`QuadraticSpline`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct CubicSpline;

impl ShapeFunction<4> for CubicSpline {
    /// As of a box over two cells: the first node is the one below its lower edge, and `l` is 1.
    #[inline(always)]
    fn axis_weights<T: RealField + Copy>(xi: T, l: T) -> AxisWeights<T, 4> {
        let one = T::one();
        let (base, node) = node_below(xi - l);
        // From the second node, between 0 and 1.
        let r = xi - l - node;
        let q = one - r;
        let (sixth, half, two_thirds) =
            (real::<T>(1.0 / 6.0), real::<T>(0.5), real::<T>(2.0 / 3.0));
        let (two, three_halves) = (real::<T>(2.0), real::<T>(1.5));
        AxisWeights {
            base,
            S: [
                q * q * q * sixth,
                two_thirds - r * r * (one - half * r),
                two_thirds - q * q * (one - half * q),
                r * r * r * sixth,
            ],
            G: [
                -half * q * q,
                r * (three_halves * r - two),
                q * (two - three_halves * q),
                half * r * r,
            ],
        }
    }
}

/// Means of quadratic B-splines over a box.
///
/// A quadratic spline is itself the mean of hat functions over one cell: half-sizes count half a cell more than the particle's box has, so
/// that nodes are found as for hat functions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct QuadraticMean;

impl ShapeFunction<4> for QuadraticMean {
    const BEYOND_BOX: f64 = HALF_A_CELL;

    /// For a box of at most one cell, which has at most one joint of the splines in it: the middle of the cell below the third node.
    #[inline(always)]
    fn axis_weights<T: RealField + Copy>(xi: T, l: T) -> AxisWeights<T, 4> {
        let (one, two, half) = (T::one(), real::<T>(2.0), real::<T>(0.5));
        let (base, node) = node_below(xi - l);
        let l = l - half;
        // From the second node.
        let r = xi - node - one;
        // The part of the box below the joint: from how far below it, to how far.
        let (from, to) = ((half - r) + l, (half - r) - l);
        let to = if to > T::zero() { to } else { T::zero() };
        // The same, from the joint before.
        let (low, high) = ((half + r) - l, (half + r) + l);
        let high = if high < one { high } else { one };
        // The lengths of the parts beyond the joint and below it.
        let (all, beyond) = (l + l, (r + l) - half);
        let far = if beyond > T::zero() { beyond } else { T::zero() };
        let far = if far < all { far } else { all };
        let near = all - far;
        let (quarter, twelfth) = (real::<T>(0.25) / l, real::<T>(1.0 / 12.0) / l);
        let squares = |a: T, b: T| (a * a + b * b) + a * b;
        let rest = far * (real::<T>(3.0) + far * (real::<T>(3.0) - two * far));
        let S0 = near * squares(from, to) * twelfth;
        let S2 = (near * squares(low, high) + rest) * twelfth;
        let S3 = far * far * far * twelfth;
        let G0 = -near * (from + to) * quarter;
        let G2 = (near * (low + high) + two * far * (one - far)) * quarter;
        let G3 = far * far * quarter;
        AxisWeights { base, S: [S0, one - S0 - S2 - S3, S2, S3], G: [G0, -G0 - G2 - G3, G2, G3] }
    }
}

/// Shape functions on one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OnAxis {
    Hat,
    /// Means over boxes that keep their sizes.
    FixedBox,
    /// Means over boxes that the diagonal of F stretches.
    StretchingBox,
    Quadratic,
    Cubic,
    /// Means of quadratic splines over boxes that the diagonal of F stretches.
    QuadraticMean,
}

impl OnAxis {
    /// Whether boxes stretch with the diagonal of F.
    pub(crate) fn stretches(self) -> bool {
        matches!(self, Self::StretchingBox | Self::QuadraticMean)
    }

    /// By how much a half-size exceeds that of the particle's own box.
    pub(crate) fn beyond_box(self) -> f64 {
        match self {
            Self::QuadraticMean => QuadraticMean::BEYOND_BOX,
            _ => 0.0,
        }
    }
}

/// A shape function whose weights are products over the axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ProductShape<T, const D: usize> {
    pub(crate) on_axis: OnAxis,
    /// Half-sizes of the particles' boxes in the reference configuration, in cells.
    pub(crate) l: SVector<T, D>,
}

impl<T: RealField + Copy, const D: usize> ProductShape<T, D> {
    /// The shape function on an axis; a constant in builds of the usual scheme alone.
    #[inline(always)]
    pub(crate) fn on_axis(&self) -> OnAxis {
        if EVERY_SCHEME { self.on_axis } else { OnAxis::StretchingBox }
    }

    /// Half-size of a box along an axis, in cells, for the diagonal entry `F_aa` of the deformation gradient.
    pub(crate) fn half_size(&self, axis: usize, F_aa: T) -> T {
        let of_box = match self.on_axis().stretches() {
            true => half_size::<_, true>(self.l[axis], F_aa),
            false => half_size::<_, false>(self.l[axis], F_aa),
        };
        of_box + real(self.on_axis().beyond_box())
    }

    /// Nodes along each axis, except for a box with extended support.
    pub(crate) fn width(&self) -> usize {
        match self.on_axis() {
            OnAxis::Hat => 2,
            OnAxis::FixedBox | OnAxis::StretchingBox | OnAxis::Quadratic => 3,
            OnAxis::Cubic | OnAxis::QuadraticMean => 4,
        }
    }

    /// Nodes along each axis of a box with these half-sizes, in cells.
    pub(crate) fn width_of<const N: usize>(&self, l: &SVector<T, N>) -> usize {
        let is_extended = l.iter().any(|&l| l > self.extended_above());
        if is_extended { EXTENDED } else { self.width() }
    }

    /// Half-size beyond which the support is extended.
    pub(crate) fn extended_above(&self) -> T {
        match self.on_axis() {
            OnAxis::FixedBox | OnAxis::StretchingBox => real(0.5),
            OnAxis::QuadraticMean => real(1.0),
            OnAxis::Hat | OnAxis::Quadratic | OnAxis::Cubic => real(HALF_SIZE_LIMIT),
        }
    }
}

/// Half-size of a box with the reference half-size `l`, for the diagonal entry `F_aa` of the deformation gradient where boxes stretch.
#[inline(always)]
pub(crate) fn half_size<T: RealField + Copy, const STRETCHING: bool>(l: T, F_aa: T) -> T {
    if !STRETCHING {
        return l;
    }
    let (l, least): (T, T) = ((l * F_aa).abs(), real(LEAST_HALF_SIZE));
    if l > least { l } else { least }
}

/// 2^52: a double of this size is a whole number, stored in its last 52 bits.
const WHOLE: f64 = 4_503_599_627_370_496.0;

/// Converts a whole number from zero up to [`WHOLE`] to an index.
///
/// This form needs no instruction for integers of 64 bits, so that it vectorises on processors without them.
#[inline(always)]
pub(crate) fn index(whole: f64) -> usize {
    ((whole + WHOLE).to_bits() & (WHOLE as u64 - 1)) as usize
}

/// Index in the padded grid of the node below `s`, and that node's position, for `s >= -PAD_BELOW`.
///
/// Made of sums alone, which vectorise on all processors; rounding down does not.
#[inline(always)]
pub(crate) fn node_below<T: RealField + Copy>(s: T) -> (f64, T) {
    let padded = nalgebra::convert_unchecked::<T, f64>(s + real(PAD_BELOW as f64));
    let nearest = (padded + WHOLE) - WHOLE;
    let below = if nearest > padded { nearest - 1.0 } else { nearest };
    (below, real(below - PAD_BELOW as f64))
}

/// GIMP weights along one axis for `0 < l <= 1/2`.
///
/// For r = |xi - node|: `1 - (r^2 + l^2) / (2 l)` up to l, `1 - r` up to `1 - l`, `(1 + l - r)^2 / (4 l)` up to `1 + l`.
/// The middle node gets one less the outer two, which is the same and keeps the sum at one.
#[inline(always)]
fn gimp_axis<T: RealField + Copy>(xi: T, l: T) -> AxisWeights<T, 3> {
    let one = T::one();
    let (base, node) = node_below(xi - l);
    let r = xi - node;
    let half = real::<T>(0.5) / l;
    let quarter = half * real(0.5);
    // Overlap of the box with the cells on either side of the middle node; at most its whole width 2 l in the first.
    let (all, first, last) = (l + l, one + l - r, r + l - one);
    let near = if first < all { first } else { all };
    let far = if last > T::zero() { last } else { T::zero() };
    let (S0, G0) = (near * near * quarter + (first - near), -near * half);
    let (S2, G2) = (far * far * quarter, far * half);
    AxisWeights { base, S: [S0, one - S0 - S2, S2], G: [G0, -G0 - G2, G2] }
}

/// Exact mean of the hat functions over the box, for any `0 < l <= HALF_SIZE_LIMIT`.
#[inline]
fn extended_axis<T: RealField + Copy>(xi: T, l: T) -> AxisWeights<T, EXTENDED> {
    let one = T::one();
    let (base, node) = node_below(xi - l);
    let edge = xi - l - node;
    let hat = |s: T| (one - s.abs()).max(T::zero());
    // The hat's antiderivative that vanishes at the centre.
    let integral = |s: T| {
        let s = s.clamp(-one, one);
        s - s * s.abs() * real(0.5)
    };
    means_between(base, edge, l, integral, hat)
}

/// Exact mean of the quadratic splines over the box, for any `l` up to `HALF_SIZE_LIMIT`, which counts half a cell more than the box has.
#[inline]
fn extended_spline<T: RealField + Copy>(xi: T, l: T) -> AxisWeights<T, EXTENDED> {
    let (half, third) = (real::<T>(0.5), real::<T>(1.0 / 3.0));
    let (base, node) = node_below(xi - l);
    let l = l - half;
    let edge = xi - l - node;
    let (end, three_quarters) = (real::<T>(1.5), real::<T>(0.75));
    let spline = |s: T| {
        let r = s.abs();
        let q = (end - r).max(T::zero());
        if r < half { three_quarters - s * s } else { q * q * half }
    };
    // The spline's antiderivative that vanishes at the centre.
    let integral = |s: T| {
        let s = s.clamp(-end, end);
        let q = end - s.abs();
        let outer = half - q * q * q * (half * third);
        if s.abs() < half {
            s * (three_quarters - s * s * third)
        } else if s > T::zero() {
            outer
        } else {
            -outer
        }
    };
    means_between(base, edge, l, integral, spline)
}

/// Means over a box of half-size `l` whose lower edge is at `edge`, counted from the first node, of a function about each node; by the
/// antiderivative that vanishes at the centre.
#[inline(always)]
fn means_between<T: RealField + Copy>(
    base: f64,
    edge: T,
    l: T,
    integral: impl Fn(T) -> T,
    function: impl Fn(T) -> T,
) -> AxisWeights<T, EXTENDED> {
    let scale = real::<T>(0.5) / l;
    let from = |k: usize| edge - real(k as f64);
    AxisWeights {
        base,
        S: std::array::from_fn(|k| (integral(from(k) + l + l) - integral(from(k))) * scale),
        G: std::array::from_fn(|k| (function(from(k) + l + l) - function(from(k))) * scale),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Weight and gradient of every node of one axis, by its position.
    fn spread<const W: usize>(w: &AxisWeights<f64, W>) -> Vec<(f64, f64, f64)> {
        (0..W).map(|k| (w.base + k as f64 - PAD_BELOW as f64, w.S[k], w.G[k])).collect()
    }

    fn at(spread: &[(f64, f64, f64)], node: f64) -> (f64, f64) {
        spread.iter().find(|s| s.0 == node).map_or((0.0, 0.0), |s| (s.1, s.2))
    }

    /// Weights at a place, with the half-size by which differences are divided.
    fn check<const W: usize>(
        w: &AxisWeights<f64, W>,
        xi: f64,
        half_size: f64,
    ) -> Result<(), TestCaseError> {
        let nodes = spread(w);
        // Sums of weights are one but for rounding at both ends of the box.
        let of_slopes = 1e-14_f64.max(8.0 * f64::EPSILON / half_size);
        prop_assert!((nodes.iter().map(|n| n.1).sum::<f64>() - 1.0).abs() < 1e-14);
        prop_assert!(nodes.iter().map(|n| n.2).sum::<f64>().abs() < of_slopes);
        prop_assert!((nodes.iter().map(|n| n.0 * n.1).sum::<f64>() - xi).abs() < 1e-12);
        prop_assert!((nodes.iter().map(|n| n.0 * n.2).sum::<f64>() - 1.0).abs() < 1e-12);
        prop_assert!(nodes.iter().all(|n| n.1 >= 0.0));
        Ok(())
    }

    fn hat(xi: f64) -> AxisWeights<f64, 2> {
        Hat::axis_weights(xi, 0.0)
    }

    fn quadratic(xi: f64) -> AxisWeights<f64, 3> {
        QuadraticSpline::axis_weights(xi, 0.5)
    }

    fn cubic(xi: f64) -> AxisWeights<f64, 4> {
        CubicSpline::axis_weights(xi, 1.0)
    }

    fn mean(xi: f64, l: f64) -> AxisWeights<f64, 4> {
        QuadraticMean::axis_weights(xi, l + HALF_A_CELL)
    }

    fn extended_mean(xi: f64, l: f64) -> AxisWeights<f64, EXTENDED> {
        extended_spline(xi, l + HALF_A_CELL)
    }

    /// The formula as printed in the source.
    fn printed(r: f64, l: f64) -> f64 {
        let r = r.abs();
        if r < l {
            1.0 - (r * r + l * l) / (2.0 * l)
        } else if r < 1.0 - l {
            1.0 - r
        } else if r < 1.0 + l {
            (1.0 + l - r).powi(2) / (4.0 * l)
        } else {
            0.0
        }
    }

    #[test]
    fn the_node_below_a_place_is_the_largest_not_beyond_it() {
        for node in -2..40_i32 {
            let at = f64::from(node);
            for away in [0.0, -1e-4, 1e-4, 0.499, 0.5, 0.501] {
                let s: f64 = at + away;
                let below = s.floor();
                assert_eq!(node_below(s), (below + PAD_BELOW as f64, below), "{s:e}");
                let s = s as f32;
                let below = s.floor();
                assert_eq!(node_below(s), (f64::from(below) + PAD_BELOW as f64, below), "{s:e}");
            }
        }
    }

    proptest! {
        #[test]
        fn linear_fields_are_reproduced(xi in 0.0..20.0_f64, l in 1e-3..0.5_f64, wide in 1e-2..2.0_f64) {
            check(&hat(xi), xi, 0.5)?;
            check(&gimp_axis(xi, l), xi, l)?;
            check(&quadratic(xi), xi, 0.5)?;
            check(&cubic(xi), xi, 0.5)?;
            check(&extended_axis(xi, wide), xi, wide)?;
            check(&mean(xi, l), xi, l)?;
            check(&extended_mean(xi, 0.75 * wide), xi, 0.75 * wide)?;
        }

        /// Particles are sorted by the lower edges of their weights.
        #[test]
        fn the_first_node_is_the_one_below_the_lower_edge(xi in 0.0..20.0_f64, l in 1e-3..0.5_f64) {
            prop_assert_eq!(node_below(xi - l).0, gimp_axis(xi, l).base);
            prop_assert_eq!(node_below(xi).0, hat(xi).base);
            prop_assert_eq!(node_below(xi - (l + HALF_A_CELL)).0, mean(xi, l).base);
        }

        #[test]
        fn the_formula_is_the_exact_integral(xi in 0.0..20.0_f64, l in 1e-2..0.5_f64) {
            let (formula, exact) = (spread(&gimp_axis(xi, l)), spread(&extended_axis(xi, l)));
            for &(node, S, G) in &exact {
                let (S1, G1) = at(&formula, node);
                prop_assert!((S - S1).abs() < 1e-13 && (G - G1).abs() < 1e-12);
                prop_assert!((S - printed(xi - node, l)).abs() < 1e-13);
            }
        }

        /// Three Gauss points between the splines' joints are exact.
        #[test]
        fn means_of_splines_are_exact(xi in 0.0..20.0_f64, l in 1e-2..0.5_f64, wide in 1e-2..1.5_f64) {
            let (formula, exact) = (spread(&mean(xi, l)), spread(&extended_mean(xi, l)));
            for &(node, S, G) in &exact {
                let (S1, G1) = at(&formula, node);
                prop_assert!((S - S1).abs() < 1e-13 && (G - G1).abs() < 1e-12);
            }
            let (low, high) = (xi - wide, xi + wide);
            let joints = (-4..24).map(|k| f64::from(k) + 0.5).filter(|joint| (low..high).contains(joint));
            let ends: Vec<f64> = [low].into_iter().chain(joints).chain([high]).collect();
            for (node, S, G) in spread(&extended_mean(xi, wide)) {
                let (mut S1, mut G1) = (0.0, 0.0);
                for ends in ends.windows(2) {
                    let (middle, half) = (0.5 * (ends[0] + ends[1]), 0.5 * (ends[1] - ends[0]));
                    for (s, w) in [(-0.6_f64.sqrt(), 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.6_f64.sqrt(), 5.0 / 9.0)] {
                        let (S, G) = at(&spread(&quadratic(middle + half * s)), node);
                        (S1, G1) = (S1 + S * w * half, G1 + G * w * half);
                    }
                }
                prop_assert!((S - S1 / (2.0 * wide)).abs() < 1e-13, "{} {}", S, S1 / (2.0 * wide));
                prop_assert!((G - G1 / (2.0 * wide)).abs() < 1e-12);
            }
        }

        #[test]
        fn weights_are_continuous_where_the_formula_changes(xi in 0.0..20.0_f64) {
            let (below, above) = (spread(&gimp_axis(xi, 0.5)), spread(&extended_axis(xi, 0.5 + 1e-12)));
            let splines = (spread(&mean(xi, 0.5)), spread(&extended_mean(xi, 0.5 + 1e-12)));
            for (below, above) in [(below, above), splines] {
                for &(node, S, G) in &above {
                    let (S1, G1) = at(&below, node);
                    prop_assert!((S - S1).abs() < 1e-11 && (G - G1).abs() < 1e-11);
                }
            }
        }

        #[test]
        fn gradients_are_derivatives(xi in 0.0..20.0_f64, l in 1e-2..0.5_f64, wide in 0.5..2.0_f64) {
            let d = 1e-7;
            for (minus, here, plus) in [
                (spread(&gimp_axis(xi - d, l)), spread(&gimp_axis(xi, l)), spread(&gimp_axis(xi + d, l))),
                (spread(&quadratic(xi - d)), spread(&quadratic(xi)), spread(&quadratic(xi + d))),
                (spread(&cubic(xi - d)), spread(&cubic(xi)), spread(&cubic(xi + d))),
                (spread(&extended_axis(xi - d, wide)), spread(&extended_axis(xi, wide)), spread(&extended_axis(xi + d, wide))),
                (spread(&mean(xi - d, l)), spread(&mean(xi, l)), spread(&mean(xi + d, l))),
            ] {
                for &(node, _, G) in &here {
                    let slope = (at(&plus, node).0 - at(&minus, node).0) / (2.0 * d);
                    prop_assert!((G - slope).abs() < 1e-4, "{} {}", G, slope);
                }
            }
        }
    }

    #[test]
    fn a_stretching_box_follows_the_diagonal_of_F() {
        assert_eq!(half_size::<_, true>(0.25, 1.5), 0.375);
        assert_eq!(half_size::<_, true>(0.125, -1.5), 0.1875);
        assert_eq!(half_size::<_, true>(0.125, 0.0), 1e-6);
        assert_eq!(half_size::<_, false>(0.125, 1.5), 0.125);
    }
}
