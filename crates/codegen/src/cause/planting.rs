//! Fields with the opposite of a mistake: a solver that makes the mistake becomes right with them.

use crate::fault::{balance, second_of, swap_first_two};
use mmsmith_expr::{Expr, Function, Graph, Rational};
use mmsmith_spec::{Domain, Fields, Law, Spec, Surface};
use std::collections::BTreeMap;

type Matrix = Vec<Vec<Expr>>;

/// A factor: a quotient of whole numbers times a power of the density.
pub(super) type Factor = [i64; 3];

/// The fields of a solution, to be changed.
pub struct Planting<'a> {
    spec: &'a Spec,
    fields: &'a mut Fields,
}

/// A law with Lame's constants at one deformation, and the quantities from which stresses are made.
pub(super) struct Deformed<'a> {
    graph: &'a mut Graph,
    pub(super) F: Matrix,
    pub(super) H: Matrix,
    pub(super) J: Expr,
    pub(super) P: Matrix,
}

impl<'a> Planting<'a> {
    pub(super) fn new(spec: &'a Spec, fields: &'a mut Fields) -> Self {
        Planting { spec, fields }
    }

    fn factor(&mut self, [numerator, denominator, power]: Factor) -> Expr {
        let graph = &mut self.fields.graph;
        let number = graph.number(Rational::new(numerator.into(), denominator.into()));
        let density = graph.powi(self.spec.density, power);
        graph.mul(number, density)
    }

    /// `b = inertia a - stress Div P/rho0`.
    pub(super) fn balance(&mut self, inertia: Factor, stress: Factor) {
        let (inertia, stress) = (self.factor(inertia), self.factor(stress));
        let Fields { graph, a, b, .. } = &mut *self.fields;
        // Div P/rho0 = a - b
        let of_a = graph.sub(inertia, stress);
        for (b, &a) in b.iter_mut().zip(&*a) {
            let terms = [graph.mul(of_a, a), graph.mul(stress, *b)];
            *b = graph.sum_of(terms);
        }
    }

    /// `b` times a factor and a power of `J`.
    pub(super) fn scale_force(&mut self, factor: Factor, power: i64) {
        let factor = self.factor(factor);
        let Fields { graph, J, b, .. } = &mut *self.fields;
        let volume = graph.powi(*J, power);
        b.iter_mut().for_each(|b| *b = graph.product_of([factor, volume, *b]));
    }

    /// One component of `b` with the sign turned.
    pub(super) fn turn_force(&mut self, component: usize) {
        if let Some(b) = self.fields.b.get_mut(component) {
            *b = self.fields.graph.neg(*b);
        }
    }

    /// The first two components of `b` exchanged.
    pub(super) fn exchange_force(&mut self) {
        swap_first_two(self.spec, &mut self.fields.b);
    }

    /// `b` at the point whose first two coordinates are exchanged.
    pub(super) fn exchange_coordinates(&mut self) {
        if self.spec.dimension > 1 {
            let [X, Y] = [0, second_of(self.spec)].map(|axis| self.fields.inputs[axis].0);
            self.place_force(&BTreeMap::from([(X, Y), (Y, X)]));
        }
    }

    /// `b` at the time times a number.
    pub(super) fn scale_time_of_force(&mut self, numerator: i64, denominator: i64) {
        let Fields { graph, b, .. } = &mut *self.fields;
        let t = graph.symbol("t");
        let number = graph.number(Rational::new(numerator.into(), denominator.into()));
        let other = graph.mul(number, t);
        let times = BTreeMap::from([(t, other)]);
        b.iter_mut().for_each(|b| *b = graph.replace(*b, &times));
    }

    /// The last component of `b` with a number added.
    pub(super) fn add_to_force(&mut self, numerator: i64, denominator: i64) {
        let Fields { graph, b, .. } = &mut *self.fields;
        let number = graph.number(Rational::new(numerator.into(), denominator.into()));
        if let Some(last) = b.last_mut() {
            *last = graph.add(*last, number);
        }
    }

    fn place_force(&mut self, place: &BTreeMap<Expr, Expr>) {
        let Fields { graph, definitions, b, .. } = &mut *self.fields;
        // First the meanings of other symbols, such as the radius, so that they move with the coordinates.
        let definitions: BTreeMap<Expr, Expr> = definitions.iter().copied().collect();
        for b in b {
            let explicit = graph.replace(*b, &definitions);
            *b = graph.replace(explicit, place);
        }
    }

    /// `v` times a number.
    pub(super) fn scale_velocity(&mut self, numerator: i64, denominator: i64) {
        let Fields { graph, v, .. } = &mut *self.fields;
        let number = graph.number(Rational::new(numerator.into(), denominator.into()));
        v.iter_mut().for_each(|v| *v = graph.mul(number, *v));
    }

    /// The first two components of `v` exchanged.
    pub(super) fn exchange_velocity(&mut self) {
        swap_first_two(self.spec, &mut self.fields.v);
    }

    /// Replaces the stress at the same deformation, and with it `b`, `P` and tractions.
    pub(super) fn stress(&mut self, of: impl Fn(&mut Deformed<'_>) -> Matrix) {
        let Fields { graph, H, F, J, P, .. } = &mut *self.fields;
        let mut deformed = Deformed { F: F.clone(), H: H.clone(), J: *J, P: P.clone(), graph };
        let stress = of(&mut deformed);
        self.take(stress);
    }

    /// As [`Planting::stress`], for a stress in Lame's constants; a law without them stays.
    pub(super) fn law(&mut self, of: impl Fn(&mut Deformed<'_>, Expr, Expr) -> Matrix) {
        if let Some([lambda, mu]) = lame(self.spec) {
            self.stress(|deformed| of(deformed, lambda, mu));
        }
    }

    /// As [`Planting::stress`], for the neo-Hookean law at another deformation gradient; other laws stay.
    pub(super) fn neo_hookean_of(&mut self, other: impl Fn(&mut Deformed<'_>) -> Matrix) {
        if self.spec.material.name() == "neo-hookean" {
            self.law(|deformed, lambda, mu| {
                deformed.F = other(deformed);
                deformed.J = deformed.determinant();
                let f = deformed.inverse_transposed();
                let log = deformed.log_J();
                let pressure = deformed.product(&[lambda, log]);
                deformed.neo_hookean(mu, pressure, &f)
            });
        }
    }

    /// As [`Planting::stress`], by the same law with other constants.
    pub(super) fn constants(&mut self, change: impl Fn(&mut Graph, Expr, Expr) -> (Expr, Expr)) {
        let Some(constants) = lame(self.spec) else { return };
        let Law::Library(material) = self.spec.material else { return };
        let mut changed = Spec { graph: self.fields.graph.clone(), ..self.spec.clone() };
        let (lambda, mu) = change(&mut changed.graph, constants[0], constants[1]);
        changed.material = Law::Library(material.map_named(|name, value| match name {
            "lambda" => lambda,
            "mu" => mu,
            _ => value,
        }));
        self.derive_from(changed);
    }

    /// As [`Planting::stress`], for the motion whose displacement is multiplied by a number.
    pub(super) fn gradient(&mut self, numerator: i64, denominator: i64) {
        let mut changed = Spec { graph: self.fields.graph.clone(), ..self.spec.clone() };
        let number = changed.graph.number(Rational::new(numerator.into(), denominator.into()));
        let larger = |u: &Expr| changed.graph.mul(number, *u);
        changed.displacement = self.spec.displacement.iter().map(larger).collect();
        self.derive_from(changed);
    }

    fn derive_from(&mut self, changed: Spec) {
        if let Ok(derived) = changed.derive() {
            let Fields { graph, P, .. } = derived;
            self.fields.graph = graph;
            self.take(P);
        }
    }

    fn take(&mut self, stress: Matrix) {
        balance(self.fields, &stress, self.spec.density);
        self.fields.P = stress;
        for index in 0..self.fields.surfaces.len() {
            let traction = self.traction_of(self.fields.surfaces[index].surface);
            self.fields.surfaces[index].traction = traction;
        }
    }

    fn traction_of(&mut self, surface: Surface) -> Vec<Expr> {
        let normal = self.normal(surface);
        let Fields { graph, P, .. } = &mut *self.fields;
        P.iter()
            .map(|row| {
                let terms: Vec<Expr> =
                    row.iter().zip(&normal).map(|(&P, &N)| graph.mul(P, N)).collect();
                graph.sum_of(terms)
            })
            .collect()
    }

    /// The outward normal in the reference configuration.
    fn normal(&mut self, surface: Surface) -> Vec<Expr> {
        let n = self.spec.dimension;
        let Fields { graph, inputs, .. } = &mut *self.fields;
        let radius = match (surface, &self.spec.domain) {
            (Surface::Inner, Domain::Annulus { inner, .. } | Domain::Tube { inner, .. }) => {
                graph.neg(*inner)
            }
            (Surface::Outer, Domain::Annulus { outer, .. } | Domain::Tube { outer, .. }) => *outer,
            _ => Graph::ONE,
        };
        // About an axis the normal has no component along it.
        let round = if matches!(self.spec.domain, Domain::Tube { .. }) { 2 } else { n };
        let angles = match &self.spec.domain {
            Domain::Tube { around, .. } => around.angles(),
            Domain::Box { .. } | Domain::Annulus { .. } => None,
        };
        let across = angles.filter(|_| matches!(surface, Surface::FirstAngle | Surface::LastAngle));
        if let Some([from, to]) = across {
            let last = surface == Surface::LastAngle;
            let angle = if last { to } else { from };
            let (cos, sin) =
                (graph.call(Function::Cos, &[angle]), graph.call(Function::Sin, &[angle]));
            let normal = if last { [graph.neg(sin), cos] } else { [sin, graph.neg(cos)] };
            return [normal[0], normal[1], Graph::ZERO][..n].to_vec();
        }
        let entry = |i: usize| match surface {
            Surface::Lower(axis) if axis == i => graph.integer(-1),
            Surface::Upper(axis) if axis == i => Graph::ONE,
            Surface::Inner | Surface::Outer if i < round => graph.div(inputs[i].0, radius),
            _ => Graph::ZERO,
        };
        (0..n).map(entry).collect()
    }

    /// All tractions times a number.
    pub(super) fn scale_tractions(&mut self, numerator: i64, denominator: i64) {
        let Fields { graph, surfaces, .. } = &mut *self.fields;
        let number = graph.number(Rational::new(numerator.into(), denominator.into()));
        for entry in surfaces.iter_mut().flat_map(|surface| &mut surface.traction) {
            *entry = graph.mul(number, *entry);
        }
    }

    /// All tractions times a power of the density.
    pub(super) fn scale_tractions_by_density(&mut self, power: i64) {
        let density = self.factor([1, 1, power]);
        let Fields { graph, surfaces, .. } = &mut *self.fields;
        for entry in surfaces.iter_mut().flat_map(|surface| &mut surface.traction) {
            *entry = graph.mul(density, *entry);
        }
    }

    /// The first two components of all tractions exchanged.
    pub(super) fn exchange_tractions(&mut self) {
        let Self { spec, fields, .. } = self;
        fields.surfaces.iter_mut().for_each(|surface| swap_first_two(spec, &mut surface.traction));
    }

    /// All tractions times a power of the current area over the reference area, `J |F^-T N|`.
    pub(super) fn by_area(&mut self, power: i64) {
        let surfaces: Vec<Surface> = self.fields.surfaces.iter().map(|own| own.surface).collect();
        for (index, surface) in surfaces.into_iter().enumerate() {
            let normal = self.normal(surface);
            let Fields { graph, F, J, P, H, surfaces, .. } = &mut *self.fields;
            let mut deformed = Deformed { F: F.clone(), H: H.clone(), J: *J, P: P.clone(), graph };
            let inverse = deformed.inverse();
            let entries = (0..normal.len()).map(|j| {
                let terms: Vec<Expr> = (0..normal.len())
                    .map(|i| deformed.graph.mul(inverse[i][j], normal[i]))
                    .collect();
                let entry = deformed.graph.sum_of(terms);
                deformed.graph.powi(entry, 2)
            });
            let entries: Vec<Expr> = entries.collect();
            let square = graph.sum_of(entries);
            let length = graph.sqrt(square);
            let area = graph.mul(*J, length);
            let factor = graph.powi(area, power);
            for entry in &mut surfaces[index].traction {
                *entry = graph.mul(factor, *entry);
            }
        }
    }
}

/// Lame's constants of the law, if it has them.
fn lame(spec: &Spec) -> Option<[Expr; 2]> {
    let constants = spec.material.constants();
    let named =
        |name: &str| constants.iter().find(|(own, _)| own.name == name).map(|(_, value)| *value);
    Some([named("lambda")?, named("mu")?])
}

impl Deformed<'_> {
    fn n(&self) -> usize {
        self.F.len()
    }

    fn filled(&mut self, entry: impl Fn(&mut Graph, usize, usize) -> Expr) -> Matrix {
        let n = self.n();
        (0..n).map(|i| (0..n).map(|j| entry(self.graph, i, j)).collect()).collect()
    }

    pub(super) fn identity(&mut self) -> Matrix {
        self.filled(|_, i, j| if i == j { Graph::ONE } else { Graph::ZERO })
    }

    pub(super) fn transposed(&mut self, A: &Matrix) -> Matrix {
        self.filled(|_, i, j| A[j][i])
    }

    pub(super) fn times(&mut self, A: &Matrix, B: &Matrix) -> Matrix {
        let n = self.n();
        self.filled(|graph, i, j| {
            let terms: Vec<Expr> = (0..n).map(|k| graph.mul(A[i][k], B[k][j])).collect();
            graph.sum_of(terms)
        })
    }

    pub(super) fn scaled(&mut self, factor: Expr, A: &Matrix) -> Matrix {
        self.filled(|graph, i, j| graph.mul(factor, A[i][j]))
    }

    pub(super) fn plus(&mut self, A: &Matrix, B: &Matrix) -> Matrix {
        self.filled(|graph, i, j| graph.add(A[i][j], B[i][j]))
    }

    pub(super) fn minus(&mut self, A: &Matrix, B: &Matrix) -> Matrix {
        self.filled(|graph, i, j| graph.sub(A[i][j], B[i][j]))
    }

    pub(super) fn number(&mut self, numerator: i64, denominator: i64) -> Expr {
        self.graph.number(Rational::new(numerator.into(), denominator.into()))
    }

    /// The matrix with its entries beside the diagonal multiplied by a number.
    pub(super) fn shear_scaled(&mut self, A: &Matrix, numerator: i64, denominator: i64) -> Matrix {
        let number = self.number(numerator, denominator);
        self.filled(|graph, i, j| if i == j { A[i][j] } else { graph.mul(number, A[i][j]) })
    }

    /// The determinant of the present `F`.
    fn determinant(&mut self) -> Expr {
        let F = self.F.clone();
        let mut minor = |[i, j]: [usize; 2], [k, l]: [usize; 2]| {
            let down = self.graph.mul(F[i][k], F[j][l]);
            let up = self.graph.mul(F[i][l], F[j][k]);
            self.graph.sub(down, up)
        };
        match F.len() {
            1 => F[0][0],
            2 => minor([0, 1], [0, 1]),
            _ => {
                let minors = [minor([1, 2], [1, 2]), minor([1, 2], [2, 0]), minor([1, 2], [0, 1])];
                let terms: Vec<Expr> =
                    F[0].iter().zip(minors).map(|(&F, minor)| self.graph.mul(F, minor)).collect();
                self.graph.sum_of(terms)
            }
        }
    }

    /// `F^-1`, by cofactors.
    pub(super) fn inverse(&mut self) -> Matrix {
        let (F, J, n) = (self.F.clone(), self.J, self.n());
        self.filled(|graph, i, j| {
            // The cofactor of the entry j, i.
            let others = |left: usize| (0..n).filter(move |&k| k != left);
            let minor: Vec<Vec<Expr>> =
                others(j).map(|r| others(i).map(|c| F[r][c]).collect()).collect();
            let minor = match &minor[..] {
                [] => Graph::ONE,
                [row] => row[0],
                [top, bottom, ..] => {
                    let [down, up] = [graph.mul(top[0], bottom[1]), graph.mul(top[1], bottom[0])];
                    graph.sub(down, up)
                }
            };
            let signed = if (i + j) % 2 == 0 { minor } else { graph.neg(minor) };
            graph.div(signed, J)
        })
    }

    /// `F^-T`.
    pub(super) fn inverse_transposed(&mut self) -> Matrix {
        let inverse = self.inverse();
        self.transposed(&inverse)
    }

    pub(super) fn log_J(&mut self) -> Expr {
        self.log(self.J)
    }

    pub(super) fn log(&mut self, a: Expr) -> Expr {
        self.graph.call(Function::Ln, &[a])
    }

    pub(super) fn quotient(&mut self, a: Expr, b: Expr) -> Expr {
        self.graph.div(a, b)
    }

    pub(super) fn J_to(&mut self, power: i64) -> Expr {
        self.graph.powi(self.J, power)
    }

    pub(super) fn product(&mut self, factors: &[Expr]) -> Expr {
        self.graph.product_of(factors.iter().copied())
    }

    pub(super) fn difference(&mut self, a: Expr, b: Expr) -> Expr {
        self.graph.sub(a, b)
    }

    /// `mu (F - A) + pressure A`, the neo-Hookean form with `A` for `F^-T`.
    pub(super) fn neo_hookean(&mut self, mu: Expr, pressure: Expr, A: &Matrix) -> Matrix {
        let F = self.F.clone();
        let shear = self.minus(&F, A);
        let shear = self.scaled(mu, &shear);
        let volume = self.scaled(pressure, A);
        self.plus(&shear, &volume)
    }

    /// `lambda tr(E) I + 2 mu E`.
    pub(super) fn hooke(&mut self, lambda: Expr, mu: Expr, E: &Matrix) -> Matrix {
        let trace = self.graph.sum_of((0..E.len()).map(|i| E[i][i]));
        let volume = self.graph.mul(lambda, trace);
        let identity = self.identity();
        let volume = self.scaled(volume, &identity);
        let twice = self.graph.sum_of([mu, mu]);
        let shear = self.scaled(twice, E);
        self.plus(&volume, &shear)
    }

    /// `(H + H^T)/2`.
    pub(super) fn small_strain(&mut self) -> Matrix {
        let H = self.H.clone();
        let transposed = self.transposed(&H);
        let sum = self.plus(&H, &transposed);
        let half = self.number(1, 2);
        self.scaled(half, &sum)
    }

    /// `(F^T F - I)/2`.
    pub(super) fn green_strain(&mut self) -> Matrix {
        let H = self.H.clone();
        let transposed = self.transposed(&H);
        let square = self.times(&transposed, &H);
        let half = self.number(1, 2);
        let square = self.scaled(half, &square);
        let linear = self.small_strain();
        self.plus(&linear, &square)
    }
}
