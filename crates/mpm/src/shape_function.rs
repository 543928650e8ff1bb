//! Shape functions on one axis: hat functions, uGIMP, GIMP and quadratic splines. A weight `S_ip` is their product over the axes.
//!
//! All lengths are in cells (`h = 1`). Positions count from the lower corner of the grid, `xi = (x - lower) / h`; half-sizes `l`
//! of particle boxes and gradients are per cell too.
//!
//! To add a shape function with three nodes along each axis: implement [`ShapeFunction`] here, add it to [`ThreeNodes`], and
//! choose it in [`Simulation::new`](crate::Simulation::new).

use nalgebra::{RealField, SVector};

use crate::grid::PAD_BELOW;
use crate::tensor::real;

/// Largest supported half-size of a particle's box, in cells.
pub(crate) const HALF_SIZE_LIMIT: f64 = 2.0;
/// Nodes along each axis of the extended support, which the largest box needs.
pub(crate) const EXTENDED: usize = 6;

/// Weights and gradients at `W` successive nodes of one axis: entry `k` of each array belongs to node `base + k`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AxisWeights<T, const W: usize> {
    /// Index of the first node in the padded grid: a whole number, stored as a double for the sake of vector instructions.
    pub(crate) base: f64,
    pub(crate) S: [T; W],
    pub(crate) G: [T; W],
}

/// The weights along all axes of a box with extended support.
pub(crate) fn extended_axes<T: RealField + Copy, const D: usize>(
    xi: &[T; D],
    l: &[T; D],
) -> [AxisWeights<T, EXTENDED>; D] {
    std::array::from_fn(|a| extended_axis(xi[a], l[a]))
}

/// A shape function that a simulation was set up with; `W` is the number of nodes along each axis, except for a box with
/// [extended](is_extended) support.
///
/// Steps are compiled once for all that have the same `W`. Loops over a block of particles are compiled for each of them:
/// [`with`](Self::with) says which one it is, once a block.
pub(crate) trait ShapeChoice<T: RealField + Copy, const D: usize, const W: usize>:
    Copy + Send + Sync + 'static
{
    /// Half-size of a particle's box along an axis, in cells, for the diagonal entry `F_aa` of the deformation gradient.
    fn half_size(&self, axis: usize, F_aa: T) -> T;

    /// Does work that is compiled for the shape function itself.
    fn with<K: ShapeWork<T, D, W>>(self, work: K) -> K::Output;
}

/// Work on a block of particles that is compiled for each shape function.
pub(crate) trait ShapeWork<T: RealField + Copy, const D: usize, const W: usize> {
    type Output;

    fn run<R: ShapeFunction<T, D, W>>(self, shape: R) -> Self::Output;
}

/// A shape function that is known where code is compiled.
pub(crate) trait ShapeFunction<T: RealField + Copy, const D: usize, const W: usize>:
    ShapeChoice<T, D, W>
{
    /// The weights along one axis, for a half-size without [extended](is_extended) support.
    fn axis_weights(xi: T, l: T) -> AxisWeights<T, W>;
}

/// One of the shape functions with three nodes along each axis.
#[derive(Clone, Copy, Debug)]
pub(crate) enum ThreeNodes<T, const D: usize> {
    FixedBox(FixedBox<T, D>),
    StretchingBox(StretchingBox<T, D>),
    Quadratic(QuadraticSpline),
}

impl<T: RealField + Copy, const D: usize> ShapeChoice<T, D, 3> for ThreeNodes<T, D> {
    #[inline(always)]
    fn half_size(&self, axis: usize, F_aa: T) -> T {
        match self {
            Self::FixedBox(shape) => shape.half_size(axis, F_aa),
            Self::StretchingBox(shape) => shape.half_size(axis, F_aa),
            Self::Quadratic(shape) => <_ as ShapeChoice<T, D, 3>>::half_size(shape, axis, F_aa),
        }
    }

    #[inline(always)]
    fn with<K: ShapeWork<T, D, 3>>(self, work: K) -> K::Output {
        match self {
            Self::FixedBox(shape) => work.run(shape),
            Self::StretchingBox(shape) => work.run(shape),
            Self::Quadratic(shape) => work.run(shape),
        }
    }
}

/// Hat functions at the particle's centre.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hat;

impl<T: RealField + Copy, const D: usize> ShapeChoice<T, D, 2> for Hat {
    #[inline(always)]
    fn half_size(&self, _axis: usize, _F_aa: T) -> T {
        T::zero()
    }

    #[inline(always)]
    fn with<K: ShapeWork<T, D, 2>>(self, work: K) -> K::Output {
        work.run(self)
    }
}

impl<T: RealField + Copy, const D: usize> ShapeFunction<T, D, 2> for Hat {
    #[inline(always)]
    fn axis_weights(xi: T, _l: T) -> AxisWeights<T, 2> {
        let (base, node) = node_below(xi);
        let r = xi - node;
        AxisWeights { base, S: [T::one() - r, r], G: [-T::one(), T::one()] }
    }
}

/// GIMP weights for boxes of fixed size, half-sizes in cells ("uGIMP").
#[derive(Clone, Copy, Debug)]
pub(crate) struct FixedBox<T, const D: usize>(pub(crate) SVector<T, D>);

impl<T: RealField + Copy, const D: usize> ShapeChoice<T, D, 3> for FixedBox<T, D> {
    #[inline(always)]
    fn half_size(&self, axis: usize, _F_aa: T) -> T {
        self.0[axis]
    }

    #[inline(always)]
    fn with<K: ShapeWork<T, D, 3>>(self, work: K) -> K::Output {
        work.run(self)
    }
}

impl<T: RealField + Copy, const D: usize> ShapeFunction<T, D, 3> for FixedBox<T, D> {
    #[inline(always)]
    fn axis_weights(xi: T, l: T) -> AxisWeights<T, 3> {
        gimp_axis(xi, l)
    }
}

/// GIMP weights for boxes that stretch with the diagonal of F, reference half-sizes in cells (contiguous particles).
#[derive(Clone, Copy, Debug)]
pub(crate) struct StretchingBox<T, const D: usize>(pub(crate) SVector<T, D>);

impl<T: RealField + Copy, const D: usize> ShapeChoice<T, D, 3> for StretchingBox<T, D> {
    #[inline(always)]
    fn half_size(&self, axis: usize, F_aa: T) -> T {
        // A quarter turn makes F_aa zero, and the weights divide by l.
        let (l, smallest) = ((self.0[axis] * F_aa).abs(), real(1e-6));
        if l > smallest { l } else { smallest }
    }

    #[inline(always)]
    fn with<K: ShapeWork<T, D, 3>>(self, work: K) -> K::Output {
        work.run(self)
    }
}

impl<T: RealField + Copy, const D: usize> ShapeFunction<T, D, 3> for StretchingBox<T, D> {
    #[inline(always)]
    fn axis_weights(xi: T, l: T) -> AxisWeights<T, 3> {
        gimp_axis(xi, l)
    }
}

/// Quadratic B-splines at the particle's centre, over three cells.
///
/// Steffen, Kirby and Berzins, Analysis and reduction of quadrature errors in the material point method, 2008.
#[derive(Clone, Copy, Debug)]
pub(crate) struct QuadraticSpline;

impl<T: RealField + Copy, const D: usize> ShapeChoice<T, D, 3> for QuadraticSpline {
    /// As of a box over one cell: the first node is the one below its lower edge.
    #[inline(always)]
    fn half_size(&self, _axis: usize, _F_aa: T) -> T {
        real(0.5)
    }

    #[inline(always)]
    fn with<K: ShapeWork<T, D, 3>>(self, work: K) -> K::Output {
        work.run(self)
    }
}

impl<T: RealField + Copy, const D: usize> ShapeFunction<T, D, 3> for QuadraticSpline {
    #[inline(always)]
    fn axis_weights(xi: T, l: T) -> AxisWeights<T, 3> {
        let one = T::one();
        let (base, node) = node_below(xi - l);
        // From the middle of the first cell, between 0 and 1.
        let r = xi - l - node;
        let s = one - r;
        let (S0, S2) = (s * s * real(0.5), r * r * real(0.5));
        AxisWeights { base, S: [S0, one - S0 - S2, S2], G: [-s, s - r, r] }
    }
}

/// Whether a box of this half-size has extended support: it may touch more than three nodes.
#[inline(always)]
pub(crate) fn is_extended<T: RealField + Copy>(l: T) -> bool {
    l > real(0.5)
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
fn node_below<T: RealField + Copy>(s: T) -> (f64, T) {
    let padded = nalgebra::convert_unchecked::<T, f64>(s + real(PAD_BELOW as f64));
    let nearest = (padded + WHOLE) - WHOLE;
    let below = if nearest > padded { nearest - 1.0 } else { nearest };
    (below, real(below - PAD_BELOW as f64))
}

/// Index of the first node along an axis, as in the weights.
#[inline(always)]
pub(crate) fn first_layer<T: RealField + Copy>(xi: T, l: T) -> usize {
    index(node_below(xi - l).0)
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
    let scale = real::<T>(0.5) / l;
    let hat = |s: T| (one - s.abs()).max(T::zero());
    // The hat's antiderivative that vanishes at the centre.
    let integral = |s: T| {
        let s = s.clamp(-one, one);
        s - s * s.abs() * real(0.5)
    };
    let from = |k: usize| edge - real(k as f64);
    AxisWeights {
        base,
        S: std::array::from_fn(|k| (integral(from(k) + l + l) - integral(from(k))) * scale),
        G: std::array::from_fn(|k| (hat(from(k) + l + l) - hat(from(k))) * scale),
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

    fn check<const W: usize>(w: &AxisWeights<f64, W>, xi: f64) -> Result<(), TestCaseError> {
        let nodes = spread(w);
        prop_assert!((nodes.iter().map(|n| n.1).sum::<f64>() - 1.0).abs() < 1e-14);
        prop_assert!(nodes.iter().map(|n| n.2).sum::<f64>().abs() < 1e-14);
        prop_assert!((nodes.iter().map(|n| n.0 * n.1).sum::<f64>() - xi).abs() < 1e-12);
        prop_assert!((nodes.iter().map(|n| n.0 * n.2).sum::<f64>() - 1.0).abs() < 1e-12);
        prop_assert!(nodes.iter().all(|n| n.1 >= 0.0));
        Ok(())
    }

    fn hat(xi: f64) -> AxisWeights<f64, 2> {
        <Hat as ShapeFunction<f64, 1, 2>>::axis_weights(xi, 0.0)
    }

    fn quadratic(xi: f64) -> AxisWeights<f64, 3> {
        <QuadraticSpline as ShapeFunction<f64, 1, 3>>::axis_weights(xi, 0.5)
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
                assert_eq!(first_layer(s, 0.0), (below as i32 + PAD_BELOW as i32) as usize);
                let s = s as f32;
                let below = s.floor();
                assert_eq!(node_below(s), (f64::from(below) + PAD_BELOW as f64, below), "{s:e}");
            }
        }
    }

    proptest! {
        #[test]
        fn linear_fields_are_reproduced(xi in 0.0..20.0_f64, l in 1e-3..0.5_f64, wide in 1e-2..2.0_f64) {
            check(&hat(xi), xi)?;
            check(&gimp_axis(xi, l), xi)?;
            check(&quadratic(xi), xi)?;
            check(&extended_axis(xi, wide), xi)?;
        }

        /// Particles are sorted by the bin of the first node of their weights.
        #[test]
        fn the_first_layer_is_that_of_the_weights(xi in 0.0..20.0_f64, l in 1e-3..0.5_f64) {
            prop_assert_eq!(first_layer(xi, l) as f64, gimp_axis(xi, l).base);
            prop_assert_eq!(first_layer(xi, 0.0) as f64, hat(xi).base);
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

        #[test]
        fn weights_are_continuous_where_the_formula_changes(xi in 0.0..20.0_f64) {
            let (below, above) = (spread(&gimp_axis(xi, 0.5)), spread(&extended_axis(xi, 0.5 + 1e-12)));
            for &(node, S, G) in &above {
                let (S1, G1) = at(&below, node);
                prop_assert!((S - S1).abs() < 1e-11 && (G - G1).abs() < 1e-11);
            }
        }

        #[test]
        fn gradients_are_derivatives(xi in 0.0..20.0_f64, l in 1e-2..0.5_f64, wide in 0.5..2.0_f64) {
            let d = 1e-7;
            for (minus, here, plus) in [
                (spread(&gimp_axis(xi - d, l)), spread(&gimp_axis(xi, l)), spread(&gimp_axis(xi + d, l))),
                (spread(&quadratic(xi - d)), spread(&quadratic(xi)), spread(&quadratic(xi + d))),
                (spread(&extended_axis(xi - d, wide)), spread(&extended_axis(xi, wide)), spread(&extended_axis(xi + d, wide))),
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
        let shape = StretchingBox(SVector::<f64, 2>::new(0.25, 0.125));
        assert_eq!(shape.half_size(0, 1.5), 0.375);
        assert_eq!(shape.half_size(1, -1.5), 0.1875);
        assert_eq!(shape.half_size(1, 0.0), 1e-6);
    }
}
