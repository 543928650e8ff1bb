//! Coordinate systems: orthogonal coordinates, their unit vectors, and the way to Cartesian components.

use mmsmith_expr::{Expr, Function, Graph};
use std::collections::BTreeMap;

/// The coordinates in which a solution is stated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coordinates {
    /// `X`, `Y`, `Z`, as many as there are dimensions.
    Cartesian,
    /// `R`, `theta` in the plane: `X = R cos(theta)`, `Y = R sin(theta)`.
    Polar,
}

impl Coordinates {
    const NAMES: [(&'static str, Coordinates); 2] =
        [("cartesian", Coordinates::Cartesian), ("polar", Coordinates::Polar)];

    /// The name that specifications use.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(_, c)| *c == self).map_or("", |(name, _)| name)
    }

    pub(crate) fn from_name(name: &str) -> Option<Self> {
        Self::NAMES.iter().find(|(n, _)| *n == name).map(|&(_, c)| c)
    }

    pub(crate) fn known() -> String {
        Self::NAMES.map(|(name, _)| format!("'{name}'")).join(" or ")
    }

    pub(crate) fn allows_dimension(self, dimension: usize) -> bool {
        match self {
            Coordinates::Cartesian => (1..=3).contains(&dimension),
            Coordinates::Polar => dimension == 2,
        }
    }

    /// The names of the coordinates, in order.
    #[must_use]
    pub fn coordinate_names(self, dimension: usize) -> &'static [&'static str] {
        match self {
            Coordinates::Cartesian => &CARTESIAN[..dimension.min(3)],
            Coordinates::Polar => &["R", "theta"],
        }
    }
}

/// The names of the Cartesian coordinates.
pub(crate) const CARTESIAN: [&str; 3] = ["X", "Y", "Z"];

/// The geometry of orthogonal coordinates `q_k` with unit vectors `e_k`, in the symbols of one graph.
pub(crate) struct Geometry {
    /// The coordinates `q_k`.
    pub(crate) coordinates: Vec<Expr>,
    /// The scale factors `h_k`: the length of a step is `h_k dq_k`.
    pub(crate) scale: Vec<Expr>,
    /// `turning[k][m][i]`: component `i` of `d e_m / d q_k`.
    pub(crate) turning: Vec<Vec<Vec<Expr>>>,
    /// `rotation[i][a]`: Cartesian component `i` of `e_a`, in Cartesian symbols.
    pub(crate) rotation: Vec<Vec<Expr>>,
    /// The Cartesian coordinates.
    pub(crate) cartesian: Vec<Expr>,
    /// What the symbols `q_k` mean in Cartesian symbols; empty where they are the same.
    pub(crate) definitions: Vec<(Expr, Expr)>,
    /// Expressions in `q_k` that have a shorter form in Cartesian symbols.
    pub(crate) shorter: BTreeMap<Expr, Expr>,
}

impl Geometry {
    pub(crate) fn new(graph: &mut Graph, coordinates: Coordinates, dimension: usize) -> Self {
        let cartesian: Vec<Expr> =
            CARTESIAN[..dimension].iter().map(|name| graph.symbol(name)).collect();
        let zeros = vec![vec![vec![Graph::ZERO; dimension]; dimension]; dimension];
        match coordinates {
            Coordinates::Cartesian => Geometry {
                coordinates: cartesian.clone(),
                scale: vec![Graph::ONE; dimension],
                turning: zeros,
                rotation: identity(dimension),
                cartesian,
                definitions: Vec::new(),
                shorter: BTreeMap::new(),
            },
            Coordinates::Polar => {
                let (R, theta) = (graph.symbol("R"), graph.symbol("theta"));
                let (X, Y) = (cartesian[0], cartesian[1]);
                // d e_R / d theta = e_theta, d e_theta / d theta = -e_R.
                let mut turning = zeros;
                turning[1][0][1] = Graph::ONE;
                turning[1][1][0] = graph.integer(-1);
                let (XX, YY) = (graph.powi(X, 2), graph.powi(Y, 2));
                let RR = graph.add(XX, YY);
                let radius = graph.sqrt(RR);
                let angle = graph.call(Function::Atan2, &[Y, X]);
                let (cosine, sine) = (graph.div(X, R), graph.div(Y, R));
                let minus_sine = graph.neg(sine);
                let cos_theta = graph.call(Function::Cos, &[theta]);
                let sin_theta = graph.call(Function::Sin, &[theta]);
                Geometry {
                    coordinates: vec![R, theta],
                    scale: vec![Graph::ONE, R],
                    turning,
                    rotation: vec![vec![cosine, minus_sine], vec![sine, cosine]],
                    cartesian,
                    definitions: vec![(R, radius), (theta, angle)],
                    shorter: BTreeMap::from([(cos_theta, cosine), (sin_theta, sine)]),
                }
            }
        }
    }

    pub(crate) fn dimension(&self) -> usize {
        self.coordinates.len()
    }
}

/// The unit matrix.
pub(crate) fn identity(dimension: usize) -> Vec<Vec<Expr>> {
    let entry = |i, j| if i == j { Graph::ONE } else { Graph::ZERO };
    (0..dimension).map(|i| (0..dimension).map(|j| entry(i, j)).collect()).collect()
}
