//! Coordinate systems: orthogonal coordinates, their unit vectors, and the way to Cartesian components.

use mmsmith_expr::{CosineAndSine, Expr, Function, Graph, Node, Rational};
use std::collections::{BTreeMap, BTreeSet};

/// The coordinates in which a solution is stated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coordinates {
    /// `X`, `Y`, `Z`, as many as there are dimensions.
    Cartesian,
    /// `R`, `theta` in the plane: `X = R cos(theta)`, `Y = R sin(theta)`.
    Polar,
    /// `R`, `theta`, `Z`: polar coordinates in the plane of `X` and `Y`, and the height.
    Cylindrical,
    /// `R` and `Z` of a body of revolution about the axis `Z`: cylindrical coordinates where nothing depends on `theta`. The body turns as
    /// it deforms where the displacement has a component `theta`.
    Axisymmetric,
    /// `R`, `theta`, `phi`: the distance from the origin, the angle from the axis `Z`, and the angle around it,
    /// `X = R sin(theta) cos(phi)`, `Y = R sin(theta) sin(phi)`, `Z = R cos(theta)`.
    Spherical,
}

impl Coordinates {
    const NAMES: [(&'static str, Coordinates); 5] = [
        ("cartesian", Coordinates::Cartesian),
        ("polar", Coordinates::Polar),
        ("cylindrical", Coordinates::Cylindrical),
        ("axisymmetric", Coordinates::Axisymmetric),
        ("spherical", Coordinates::Spherical),
    ];

    /// The name that specifications use.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(_, c)| *c == self).map_or("", |(name, _)| name)
    }

    pub(crate) fn from_name(name: &str) -> Option<Self> {
        Self::NAMES.iter().find(|(n, _)| *n == name).map(|&(_, c)| c)
    }

    pub(crate) fn names() -> impl Iterator<Item = &'static str> {
        Self::NAMES.iter().map(|(name, _)| *name)
    }

    pub(crate) fn known() -> String {
        Self::NAMES.map(|(name, _)| format!("'{name}'")).join(" or ")
    }

    /// Whether components may be so many.
    pub(crate) fn allows_dimension(self, dimension: usize) -> bool {
        match self {
            Coordinates::Cartesian => (1..=3).contains(&dimension),
            Coordinates::Polar => dimension == 2,
            Coordinates::Cylindrical | Coordinates::Axisymmetric | Coordinates::Spherical => {
                dimension == 3
            }
        }
    }

    /// The dimensions that it comes in, for messages.
    pub(crate) fn dimensions(self) -> &'static str {
        match self {
            Coordinates::Cartesian => "1, 2 or 3",
            Coordinates::Polar | Coordinates::Axisymmetric => "2",
            Coordinates::Cylindrical | Coordinates::Spherical => "3",
        }
    }

    /// The names of the coordinates that fields may depend on.
    pub(crate) fn place_names(self, dimension: usize) -> Vec<&'static str> {
        let names = self.coordinate_names(dimension).iter().copied();
        names.filter(|name| self != Coordinates::Axisymmetric || *name != "theta").collect()
    }

    /// The names of the coordinates, in order, and so of the components of vectors.
    #[must_use]
    pub fn coordinate_names(self, dimension: usize) -> &'static [&'static str] {
        match self {
            Coordinates::Cartesian => &CARTESIAN[..dimension.min(3)],
            Coordinates::Polar => &["R", "theta"],
            Coordinates::Cylindrical | Coordinates::Axisymmetric => &["R", "theta", "Z"],
            Coordinates::Spherical => &["R", "theta", "phi"],
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
    /// Definitions of the symbols `q_k` in Cartesian symbols; empty where they are the same.
    pub(crate) definitions: Vec<(Expr, Expr)>,
    /// The angles among the `q_k`.
    angles: Vec<Angle>,
    /// Spherical coordinates: `e_theta e_theta^T + e_phi e_phi^T` without the angles, which are not defined on the axis.
    pub(crate) transverse: Option<Vec<Vec<Expr>>>,
}

impl Geometry {
    /// Whether the unit vectors are the Cartesian ones.
    pub(crate) fn is_cartesian(&self) -> bool {
        self.definitions.is_empty()
    }

    pub(crate) fn new(graph: &mut Graph, coordinates: Coordinates, dimension: usize) -> Self {
        let cartesian: Vec<Expr> =
            CARTESIAN[..dimension].iter().map(|name| graph.symbol(name)).collect();
        match coordinates {
            Coordinates::Cartesian => Geometry {
                coordinates: cartesian.clone(),
                scale: vec![Graph::ONE; dimension],
                turning: no_turning(dimension),
                rotation: identity(dimension),
                cartesian,
                definitions: Vec::new(),
                angles: Vec::new(),
                transverse: None,
            },
            Coordinates::Polar | Coordinates::Cylindrical | Coordinates::Axisymmetric => {
                Self::around_axis(graph, cartesian)
            }
            Coordinates::Spherical => Self::around_origin(graph, cartesian),
        }
    }

    /// Polar coordinates, and cylindrical ones where there is a third dimension.
    fn around_axis(graph: &mut Graph, cartesian: Vec<Expr>) -> Self {
        let dimension = cartesian.len();
        let (R, theta) = (graph.symbol("R"), graph.symbol("theta"));
        let (X, Y) = (cartesian[0], cartesian[1]);
        // d e_R / d theta = e_theta, d e_theta / d theta = -e_R.
        let mut turning = no_turning(dimension);
        turning[1][0][1] = Graph::ONE;
        turning[1][1][0] = graph.integer(-1);
        let radius = distance(graph, &[X, Y]);
        let angle = graph.call(Function::Atan2, &[Y, X]);
        let (cosine, sine) = (graph.div(X, R), graph.div(Y, R));
        let mut rotation = identity(dimension);
        rotation[0][0] = cosine;
        rotation[0][1] = graph.neg(sine);
        rotation[1][0] = sine;
        rotation[1][1] = cosine;
        let mut coordinates = vec![R, theta];
        coordinates.extend(cartesian.get(2));
        let mut scale = vec![Graph::ONE; dimension];
        scale[1] = R;
        Geometry {
            coordinates,
            scale,
            turning,
            rotation,
            cartesian,
            definitions: vec![(R, radius), (theta, angle)],
            angles: vec![Angle { symbol: theta, values: CosineAndSine { cosine, sine } }],
            transverse: None,
        }
    }

    /// The half plane of an axisymmetric body: positions are `R`, the angle, on which nothing depends, and `Z`, and components are along the
    /// unit vectors of these.
    pub(crate) fn of_half_plane(graph: &mut Graph) -> Self {
        let cartesian: Vec<Expr> = CARTESIAN.iter().map(|name| graph.symbol(name)).collect();
        let X = cartesian[0];
        let around = Self::around_axis(graph, cartesian);
        let R = around.coordinates[0];
        Geometry { rotation: identity(3), definitions: vec![(R, X)], angles: Vec::new(), ..around }
    }

    /// Spherical coordinates.
    fn around_origin(graph: &mut Graph, cartesian: Vec<Expr>) -> Self {
        let (R, theta, phi) = (graph.symbol("R"), graph.symbol("theta"), graph.symbol("phi"));
        // The distance from the axis; no specification can have a name like this.
        let s = graph.symbol("sqrt(X^2+Y^2)");
        let (X, Y, Z) = (cartesian[0], cartesian[1], cartesian[2]);
        let cos_theta = graph.call(Function::Cos, &[theta]);
        let sin_theta = graph.call(Function::Sin, &[theta]);
        let (minus_cos, minus_sin) = (graph.neg(cos_theta), graph.neg(sin_theta));
        // d e_R / d theta = e_theta, d e_theta / d theta = -e_R; d e_R / d phi = sin(theta) e_phi,
        // d e_theta / d phi = cos(theta) e_phi, d e_phi / d phi = -sin(theta) e_R - cos(theta) e_theta.
        let mut turning = no_turning(3);
        turning[1][0][1] = Graph::ONE;
        turning[1][1][0] = graph.integer(-1);
        turning[2][0][2] = sin_theta;
        turning[2][1][2] = cos_theta;
        turning[2][2][0] = minus_sin;
        turning[2][2][1] = minus_cos;
        let (Z_over_R, s_over_R) = (graph.div(Z, R), graph.div(s, R));
        let (cos_phi, sin_phi) = (graph.div(X, s), graph.div(Y, s));
        let minus_sin_phi = graph.neg(sin_phi);
        let rotation = vec![
            vec![graph.div(X, R), graph.mul(Z_over_R, cos_phi), minus_sin_phi],
            vec![graph.div(Y, R), graph.mul(Z_over_R, sin_phi), cos_phi],
            vec![Z_over_R, graph.neg(s_over_R), Graph::ZERO],
        ];
        // I - e_R e_R^T, with sums of squares on the diagonal.
        let mut transverse = identity(3);
        for i in 0..3 {
            for j in 0..3 {
                let numerator = if i == j {
                    let squares: Vec<Expr> =
                        (0..3).filter(|&k| k != i).map(|k| graph.powi(cartesian[k], 2)).collect();
                    graph.sum_of(squares)
                } else {
                    let product = graph.mul(cartesian[i], cartesian[j]);
                    graph.neg(product)
                };
                let RR = graph.powi(R, 2);
                transverse[i][j] = graph.div(numerator, RR);
            }
        }
        let (radius, from_axis) = (distance(graph, &[X, Y, Z]), distance(graph, &[X, Y]));
        let colatitude = graph.call(Function::Atan2, &[s, Z]);
        let longitude = graph.call(Function::Atan2, &[Y, X]);
        let scale = vec![Graph::ONE, R, graph.mul(R, sin_theta)];
        Geometry {
            coordinates: vec![R, theta, phi],
            scale,
            turning,
            rotation,
            cartesian,
            definitions: vec![(R, radius), (s, from_axis), (theta, colatitude), (phi, longitude)],
            angles: vec![
                Angle { symbol: theta, values: CosineAndSine { cosine: Z_over_R, sine: s_over_R } },
                Angle { symbol: phi, values: CosineAndSine { cosine: cos_phi, sine: sin_phi } },
            ],
            transverse: Some(transverse),
        }
    }

    pub(crate) fn dimension(&self) -> usize {
        self.coordinates.len()
    }

    /// The coordinates, without an order.
    pub(crate) fn places(&self) -> BTreeSet<Expr> {
        self.coordinates.iter().copied().collect()
    }

    /// `expr` with the cosines, sines and tangents of whole multiples of the angles, and of sums with such a multiple, in
    /// Cartesian symbols.
    ///
    /// An angle is rounded: near an axis the sine of twice the angle would be lost, while `2 X Y/R^2` keeps its digits.
    pub(crate) fn without_angles(&self, graph: &mut Graph, expr: Expr) -> Expr {
        if self.angles.is_empty() {
            return expr;
        }
        let mut known = BTreeMap::new();
        for call in graph.reachable(&[expr]) {
            let Node::Call(function @ (Function::Cos | Function::Sin | Function::Tan), arguments) =
                graph.node(call)
            else {
                continue;
            };
            let (function, argument) = (*function, arguments[0]);
            if let Some(CosineAndSine { cosine, sine }) = self.multiple(graph, argument) {
                let value = match function {
                    Function::Cos => cosine,
                    Function::Sin => sine,
                    _ => graph.div(sine, cosine),
                };
                known.insert(call, value);
            }
        }
        graph.replace(expr, &known)
    }

    /// The cosine and the sine of a whole multiple of an angle, or of a sum with one.
    fn multiple(&self, graph: &mut Graph, argument: Expr) -> Option<CosineAndSine> {
        self.angles.iter().find_map(|angle| {
            let multiple = match graph.node(argument) {
                Node::Sum { terms, .. } => {
                    let (_, multiple) = terms.iter().find(|(term, _)| *term == angle.symbol)?;
                    multiple.clone()
                }
                _ => (argument == angle.symbol).then(|| Rational::from_integer(1.into()))?,
            };
            let times = multiple.is_integer().then(|| multiple.to_integer().try_into().ok())?;
            let times = times.filter(|times: &i64| times.unsigned_abs() <= MULTIPLES)?;
            let own = graph.sum([(multiple, angle.symbol)]);
            let rest = graph.sub(argument, own);
            let own = angle.values.times(graph, times);
            if rest == Graph::ZERO {
                return Some(own);
            }
            let rest = self.multiple(graph, rest).unwrap_or_else(|| CosineAndSine {
                cosine: graph.call(Function::Cos, &[rest]),
                sine: graph.call(Function::Sin, &[rest]),
            });
            Some(own.plus(graph, rest))
        })
    }
}

/// The largest multiple of an angle that is written in Cartesian symbols, which takes as many terms.
const MULTIPLES: u64 = 32;

/// An angle among the coordinates, with its cosine and sine in Cartesian symbols.
struct Angle {
    symbol: Expr,
    values: CosineAndSine,
}

/// Unit vectors that do not turn.
fn no_turning(dimension: usize) -> Vec<Vec<Vec<Expr>>> {
    vec![vec![vec![Graph::ZERO; dimension]; dimension]; dimension]
}

/// The distance of a point from the origin.
fn distance(graph: &mut Graph, components: &[Expr]) -> Expr {
    let squares: Vec<Expr> = components.iter().map(|&x| graph.powi(x, 2)).collect();
    let sum = graph.sum_of(squares);
    graph.sqrt(sum)
}

/// The unit matrix.
pub(crate) fn identity(dimension: usize) -> Vec<Vec<Expr>> {
    let entry = |i, j| if i == j { Graph::ONE } else { Graph::ZERO };
    (0..dimension).map(|i| (0..dimension).map(|j| entry(i, j)).collect()).collect()
}

/// Physical components to Cartesian ones: `x_i = sum_a Q_ia x_a`.
pub(crate) fn turn_vector(graph: &mut Graph, geometry: &Geometry, vector: &[Expr]) -> Vec<Expr> {
    (0..geometry.dimension())
        .map(|i| {
            let terms: Vec<Expr> = (0..geometry.dimension())
                .map(|a| graph.mul(geometry.rotation[i][a], vector[a]))
                .collect();
            let component = graph.sum_of(terms);
            geometry.without_angles(graph, component)
        })
        .collect()
}
