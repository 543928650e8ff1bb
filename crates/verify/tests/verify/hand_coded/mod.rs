//! Solutions written by hand from the formulas of the literature: a cross-check of what is generated, and a place
//! for planted faults.
#![allow(dead_code)] // Each test file uses some of them.

use mmsmith_solutions::{
    Boundary, Condition, Domain, Fields, Law, Material, Real, Solution, Surface,
};
use nalgebra::{SMatrix, SVector, matrix, vector};
use std::f64::consts::PI;

type Vector = SVector<f64, 2>;
type Tensor = SMatrix<f64, 2, 2>;

/// A plane solution in double precision, told by its fields; single precision is rounded from it.
pub(crate) trait Plane: Clone + Send + Sync + 'static {
    fn motion(&self, X: &Vector, t: f64) -> [Vector; 3];
    fn gradient(&self, X: &Vector, t: f64) -> Tensor;
    fn stress(&self, X: &Vector, t: f64) -> Tensor;
    fn force(&self, X: &Vector, t: f64) -> Vector;
    fn shape(&self) -> Domain<f64, 2>;
    fn conditions(&self) -> &'static [Boundary];
    /// Young's modulus, Poisson's ratio, density.
    fn constants(&self) -> [f64; 3];
}

pub(crate) fn lame(E: f64, nu: f64) -> (f64, f64) {
    (E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), E / (2.0 * (1.0 + nu)))
}

/// Makes a [`Plane`] a solution in either precision.
#[derive(Clone)]
pub(crate) struct Coded<S>(pub(crate) S);

fn wide<T: Real>(X: &SVector<T, 2>) -> Vector {
    X.map(Real::to_f64)
}

fn narrow<T: Real, const C: usize>(value: SMatrix<f64, 2, C>) -> SMatrix<T, 2, C> {
    value.map(Real::nearest)
}

impl<T: Real, S: Plane> Solution<T, 2> for Coded<S> {
    fn displacement(&self, X: &SVector<T, 2>, t: T) -> SVector<T, 2> {
        narrow(self.0.motion(&wide(X), Real::to_f64(t))[0])
    }
    fn velocity(&self, X: &SVector<T, 2>, t: T) -> SVector<T, 2> {
        narrow(self.0.motion(&wide(X), Real::to_f64(t))[1])
    }
    fn acceleration(&self, X: &SVector<T, 2>, t: T) -> SVector<T, 2> {
        narrow(self.0.motion(&wide(X), Real::to_f64(t))[2])
    }
    fn displacement_gradient(&self, X: &SVector<T, 2>, t: T) -> SMatrix<T, 2, 2> {
        narrow(self.0.gradient(&wide(X), Real::to_f64(t)))
    }
    fn deformation_gradient(&self, X: &SVector<T, 2>, t: T) -> SMatrix<T, 2, 2> {
        narrow(Tensor::identity() + self.0.gradient(&wide(X), Real::to_f64(t)))
    }
    fn jacobian(&self, X: &SVector<T, 2>, t: T) -> T {
        self.deformation_gradient(X, t).determinant()
    }
    fn first_piola_kirchhoff(&self, X: &SVector<T, 2>, t: T) -> SMatrix<T, 2, 2> {
        narrow(self.0.stress(&wide(X), Real::to_f64(t)))
    }
    fn body_force(&self, X: &SVector<T, 2>, t: T) -> SVector<T, 2> {
        narrow(self.0.force(&wide(X), Real::to_f64(t)))
    }
    fn fields(&self, X: &SVector<T, 2>, t: T) -> Fields<T, 2> {
        Fields {
            u: self.displacement(X, t),
            v: self.velocity(X, t),
            a: self.acceleration(X, t),
            H: self.displacement_gradient(X, t),
            F: self.deformation_gradient(X, t),
            J: self.jacobian(X, t),
            P: self.first_piola_kirchhoff(X, t),
            b: self.body_force(X, t),
        }
    }
    fn domain(&self) -> Domain<T, 2> {
        match self.0.shape() {
            Domain::Box { lower, upper } => {
                Domain::Box { lower: narrow(lower), upper: narrow(upper) }
            }
            Domain::Annulus { inner, outer } => {
                Domain::Annulus { inner: Real::nearest(inner), outer: Real::nearest(outer) }
            }
            _ => unreachable!("the shapes of this file"),
        }
    }
    fn boundaries(&self) -> &[Boundary] {
        self.0.conditions()
    }
    fn cell_length(&self) -> T {
        T::one()
    }
    fn law(&self) -> Law<T> {
        let [E, nu, _] = self.0.constants();
        let (lambda, mu) = lame(E, nu);
        Law::Library(Material::NeoHookean { lambda: Real::nearest(lambda), mu: Real::nearest(mu) })
    }
    fn density(&self) -> T {
        Real::nearest(self.0.constants()[2])
    }
    fn wave_speed(&self) -> T {
        let [E, _, rho0] = self.0.constants();
        Real::nearest((E / rho0).sqrt())
    }
    fn period(&self) -> T {
        T::one() / <Self as Solution<T, 2>>::wave_speed(self) * Real::nearest(2.0)
    }
}

const fn boundary(surface: Surface, condition: Condition) -> Boundary {
    Boundary { surface, condition }
}

/// All four sides of a box.
const fn sides(condition: Condition) -> [Boundary; 4] {
    [
        boundary(Surface::Lower(0), condition),
        boundary(Surface::Upper(0), condition),
        boundary(Surface::Lower(1), condition),
        boundary(Surface::Upper(1), condition),
    ]
}

fn square() -> Domain<f64, 2> {
    Domain::Box { lower: vector![0.0, 0.0], upper: vector![1.0, 1.0] }
}

/// The deck's axis-aligned displacement in a unit square.
#[derive(Clone)]
pub(crate) struct AxisAligned {
    pub(crate) A: f64,
    pub(crate) E: f64,
    pub(crate) nu: f64,
    pub(crate) rho0: f64,
}

impl Default for AxisAligned {
    fn default() -> Self {
        Self { A: 0.1, E: 1e4, nu: 0.3, rho0: 1.0 }
    }
}

impl Plane for AxisAligned {
    fn motion(&self, X: &Vector, t: f64) -> [Vector; 3] {
        let w = PI * (self.E / self.rho0).sqrt();
        let (sin, cos) = (w * t).sin_cos();
        let amplitude = X.map(|x| self.A * (PI * x).sin());
        let u = amplitude.component_mul(&vector![cos, sin]);
        [u, amplitude.component_mul(&vector![-w * sin, w * cos]), u * (-w * w)]
    }
    fn gradient(&self, X: &Vector, t: f64) -> Tensor {
        let w = PI * (self.E / self.rho0).sqrt();
        let (sin, cos) = (w * t).sin_cos();
        let slope = X.map(|x| self.A * PI * (PI * x).cos());
        Tensor::from_diagonal(&slope.component_mul(&vector![cos, sin]))
    }
    fn stress(&self, X: &Vector, t: f64) -> Tensor {
        let F = Tensor::identity() + self.gradient(X, t);
        let (lambda, mu) = lame(self.E, self.nu);
        let log = F.determinant().ln();
        Tensor::from_diagonal(&F.diagonal().map(|f| lambda * log / f + mu * (f - 1.0 / f)))
    }
    fn force(&self, X: &Vector, t: f64) -> Vector {
        let F = Tensor::identity() + self.gradient(X, t);
        let (lambda, mu) = lame(self.E, self.nu);
        let log = F.determinant().ln();
        let u = self.motion(X, t)[0];
        Vector::from_fn(|i, _| {
            let square = F[(i, i)].powi(-2);
            let bracket = lambda * (1.0 - log) * square + mu * (1.0 + square) - self.E;
            PI * PI / self.rho0 * u[i] * bracket
        })
    }
    fn shape(&self) -> Domain<f64, 2> {
        square()
    }
    fn conditions(&self) -> &'static [Boundary] {
        const { &sides(Condition::Sliding) }
    }
    fn constants(&self) -> [f64; 3] {
        [self.E, self.nu, self.rho0]
    }
}

/// A sheet of density 1 that stretches between two walls and two free sides, one of which starts beyond its place at rest:
/// `u = (A sin(pi X/2) sin(w t), -A cos(pi Y/2) cos(w t))`, without lateral contraction.
#[derive(Clone)]
pub(crate) struct FreeSheet {
    pub(crate) A: f64,
}

impl FreeSheet {
    const E: f64 = 1e4;
    const SIDES: &'static [Boundary] = &[
        boundary(Surface::Lower(0), Condition::Sliding),
        boundary(Surface::Upper(0), Condition::TractionFree),
        boundary(Surface::Lower(1), Condition::TractionFree),
        boundary(Surface::Upper(1), Condition::Sliding),
    ];

    fn stretches(&self, X: &Vector, t: f64) -> Vector {
        Vector::repeat(1.0) + self.gradient(X, t).diagonal()
    }
}

impl Plane for FreeSheet {
    fn motion(&self, X: &Vector, t: f64) -> [Vector; 3] {
        let w = PI / 2.0 * Self::E.sqrt();
        let (sin, cos) = (w * t).sin_cos();
        let amplitude = vector![(PI / 2.0 * X[0]).sin(), -(PI / 2.0 * X[1]).cos()] * self.A;
        let u = amplitude.component_mul(&vector![sin, cos]);
        [u, amplitude.component_mul(&vector![w * cos, -w * sin]), u * (-w * w)]
    }
    fn gradient(&self, X: &Vector, t: f64) -> Tensor {
        let (sin, cos) = (PI / 2.0 * Self::E.sqrt() * t).sin_cos();
        let slope = vector![(PI / 2.0 * X[0]).cos(), (PI / 2.0 * X[1]).sin()];
        Tensor::from_diagonal(&(slope.component_mul(&vector![sin, cos]) * (self.A * PI / 2.0)))
    }
    fn stress(&self, X: &Vector, t: f64) -> Tensor {
        Tensor::from_diagonal(&self.stretches(X, t).map(|f| Self::E / 2.0 * (f - 1.0 / f)))
    }
    fn force(&self, X: &Vector, t: f64) -> Vector {
        let [u, _, a] = self.motion(X, t);
        let curvature = u * (-PI * PI / 4.0);
        let slope = self.stretches(X, t).map(|f| Self::E / 2.0 * (1.0 + f.powi(-2)));
        a - slope.component_mul(&curvature)
    }
    fn shape(&self) -> Domain<f64, 2> {
        square()
    }
    fn conditions(&self) -> &'static [Boundary] {
        Self::SIDES
    }
    fn constants(&self) -> [f64; 3] {
        [Self::E, 0.0, 1.0]
    }
}

/// Two shears across each other, `u = (g sin(pi Y) cos(w t), k sin(pi X) sin(w t))`: `F` and `P` are not symmetric.
#[derive(Clone)]
pub(crate) struct CrossedShear {
    pub(crate) g: f64,
    pub(crate) k: f64,
}

impl Default for CrossedShear {
    fn default() -> Self {
        Self { g: 0.1, k: 0.06 }
    }
}

impl CrossedShear {
    /// `dq/dJ` for the factor `q` of `P = mu F + q cof F`.
    fn slope_of_q(&self, J: f64) -> f64 {
        let (lambda, mu) = lame(1e4, 0.3);
        (lambda + mu - lambda * J.ln()) / (J * J)
    }

    /// The terms of `Div P`, one a column.
    pub(crate) fn divergence_terms(&self, X: &Vector, t: f64) -> [Vector; 3] {
        let H = self.gradient(X, t);
        let (G, K) = (H[(0, 1)], H[(1, 0)]);
        let (_, mu) = lame(1e4, 0.3);
        let (sin, cos) = (100.0 * PI * t).sin_cos();
        let G_Y = -self.g * cos * PI * PI * (PI * X[1]).sin();
        let K_X = -self.k * sin * PI * PI * (PI * X[0]).sin();
        let q_J = self.slope_of_q(1.0 - G * K);
        [
            vector![mu * G_Y, mu * K_X],
            vector![-q_J * G * K_X, -q_J * G_Y * K],
            vector![q_J * G_Y * K * K, q_J * G * G * K_X],
        ]
    }
}

impl Plane for CrossedShear {
    fn motion(&self, X: &Vector, t: f64) -> [Vector; 3] {
        let w = 100.0 * PI;
        let (sin, cos) = (w * t).sin_cos();
        let amplitude = vector![self.g * (PI * X[1]).sin(), self.k * (PI * X[0]).sin()];
        let u = amplitude.component_mul(&vector![cos, sin]);
        [u, amplitude.component_mul(&vector![-w * sin, w * cos]), u * (-w * w)]
    }
    fn gradient(&self, X: &Vector, t: f64) -> Tensor {
        let (sin, cos) = (100.0 * PI * t).sin_cos();
        let G = self.g * cos * PI * (PI * X[1]).cos();
        let K = self.k * sin * PI * (PI * X[0]).cos();
        matrix![0.0, G; K, 0.0]
    }
    fn stress(&self, X: &Vector, t: f64) -> Tensor {
        let F = Tensor::identity() + self.gradient(X, t);
        let J = F.determinant();
        let (lambda, mu) = lame(1e4, 0.3);
        let cofactor = matrix![F[(1, 1)], -F[(1, 0)]; -F[(0, 1)], F[(0, 0)]];
        F * mu + cofactor * ((lambda * J.ln() - mu) / J)
    }
    fn force(&self, X: &Vector, t: f64) -> Vector {
        self.motion(X, t)[2] - self.divergence_terms(X, t).into_iter().sum::<Vector>()
    }
    fn shape(&self) -> Domain<f64, 2> {
        square()
    }
    fn conditions(&self) -> &'static [Boundary] {
        const { &sides(Condition::PrescribedMotion) }
    }
    fn constants(&self) -> [f64; 3] {
        [1e4, 0.3, 1.0]
    }
}

/// The deck's expanding ring with the parameters of its figures, in radial components turned to Cartesian ones.
#[derive(Clone)]
pub(crate) struct Ring {
    /// Amplitude of the outer rim.
    pub(crate) A: f64,
    /// The conditions, which a test may want to be others.
    pub(crate) conditions: &'static [Boundary],
}

impl Ring {
    pub(crate) const FREE: &'static [Boundary] = &[
        boundary(Surface::Inner, Condition::TractionFree),
        boundary(Surface::Outer, Condition::TractionFree),
        boundary(Surface::Lower(0), Condition::Symmetry),
        boundary(Surface::Lower(1), Condition::Symmetry),
    ];

    /// `u/R`, `u'` and `u''` at unit time factor.
    fn radial(R: f64) -> [f64; 3] {
        let d = 3.0 * 0.5 - 1.0;
        let (c1, c2, c3) = (6.0 * 0.5 / d, -3.0 * 1.5 / d, 2.0 / d);
        [(c3 * R + c2) * R + c1, (3.0 * c3 * R + 2.0 * c2) * R + c1, 6.0 * c3 * R + 2.0 * c2]
    }

    /// The tensor of radial and hoop components at `X`.
    fn turned(X: &Vector, radial: f64, hoop: f64) -> Tensor {
        let n = X.normalize();
        let outer = n * n.transpose();
        outer * radial + (Tensor::identity() - outer) * hoop
    }
}

impl Default for Ring {
    fn default() -> Self {
        Self { A: 0.1, conditions: Self::FREE }
    }
}

impl Plane for Ring {
    fn motion(&self, X: &Vector, t: f64) -> [Vector; 3] {
        let w = 100.0 * PI;
        let shape = X * (self.A * Self::radial(X.norm())[0]);
        let (sin, cos) = (w * t).sin_cos();
        [shape * cos, shape * (-w * sin), shape * (-w * w * cos)]
    }
    fn gradient(&self, X: &Vector, t: f64) -> Tensor {
        let T = self.A * (100.0 * PI * t).cos();
        let [hoop, radial, _] = Self::radial(X.norm());
        Self::turned(X, T * radial, T * hoop)
    }
    fn stress(&self, X: &Vector, t: f64) -> Tensor {
        let T = self.A * (100.0 * PI * t).cos();
        let [hoop, radial, _] = Self::radial(X.norm());
        let stress = |stretch: f64| 5e3 * (stretch - 1.0 / stretch);
        Self::turned(X, stress(1.0 + T * radial), stress(1.0 + T * hoop))
    }
    fn force(&self, X: &Vector, t: f64) -> Vector {
        let T = self.A * (100.0 * PI * t).cos();
        let R = X.norm();
        let [hoop, radial, curvature] = Self::radial(R);
        let (radial, hoop) = (1.0 + T * radial, 1.0 + T * hoop);
        let stress = |stretch: f64| 5e3 * (stretch - 1.0 / stretch);
        let slope = 5e3 * T * curvature * (1.0 + radial.powi(-2));
        let divergence = slope + (stress(radial) - stress(hoop)) / R;
        self.motion(X, t)[2] - X * (divergence / R)
    }
    fn shape(&self) -> Domain<f64, 2> {
        Domain::Annulus { inner: 0.5, outer: 1.0 }
    }
    fn conditions(&self) -> &'static [Boundary] {
        self.conditions
    }
    fn constants(&self) -> [f64; 3] {
        [1e4, 0.0, 1.0]
    }
}
