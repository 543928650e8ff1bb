//! Uniform B-splines about the nodes of one axis, in cells as [`shape_function`](crate::shape_function).

use crate::grid::PAD_BELOW;
use crate::shape_function::AxisWeights;

/// Quadratic splines: knots halfway between nodes.
pub(crate) fn quadratic(xi: f64) -> AxisWeights<f64, 3> {
    let node = (xi + 0.5).floor();
    let r = xi - node;
    let (left, right) = (0.5 - r, 0.5 + r);
    AxisWeights {
        base: first(node - 1.0),
        S: [0.5 * left * left, 0.75 - r * r, 0.5 * right * right],
        G: [-left, -2.0 * r, right],
    }
}

/// Cubic splines: knots at the nodes.
pub(crate) fn cubic(xi: f64) -> AxisWeights<f64, 4> {
    let node = xi.floor();
    let r = xi - node;
    let q = 1.0 - r;
    AxisWeights {
        base: first(node - 1.0),
        S: [
            q * q * q / 6.0,
            2.0 / 3.0 - r * r * (1.0 - 0.5 * r),
            2.0 / 3.0 - q * q * (1.0 - 0.5 * q),
            r * r * r / 6.0,
        ],
        G: [-0.5 * q * q, r * (1.5 * r - 2.0), q * (2.0 - 1.5 * q), 0.5 * r * r],
    }
}

fn first(node: f64) -> f64 {
    node + PAD_BELOW as f64
}
