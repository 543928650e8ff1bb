//! A second derivation of every field, by automatic differentiation and without any of this project's symbols.
//!
//! Each motion of the library is written out by hand, in Cartesian coordinates, as a function of dual numbers; so is
//! the neo-Hookean law `P(F) = lambda ln J F^-T + mu (F - F^-T)`. From these follow `F = I + du/dX`, `a = d2u/dt2` and
//! `b = a - Div P / rho0`, where `Div P` differentiates `P(F(X))` along `X` and contracts the second index. The
//! fields that the specification gives are compared with them.

#![allow(clippy::unwrap_used)]

use mmsmith_interpret::interpret;
use mmsmith_solutions::nalgebra::{SMatrix, SVector};
use mmsmith_solutions::{AnySolution, Domain, Solution};
use mmsmith_spec::Spec;
use mmsmith_tests::workspace;
use num_dual::{Dual, Dual2, DualNum};
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// The largest difference allowed, relative to the scale of the field.
const TOLERANCE: f64 = 1e-12;
/// Points for each set of parameters.
const POINTS: usize = 30;

/// A number to differentiate with.
trait Number: DualNum<Primitive = f64> + Copy {}
impl<D: DualNum<Primitive = f64> + Copy> Number for D {}

type Vector<D> = [D; 3];
type Matrix<D> = [[D; 3]; 3];
type Parameters = BTreeMap<String, f64>;

/// The displacement of the library's solution `name`; `None` where it is not written out here.
fn displacement<D: Number>(
    name: &str,
    parameters: &Parameters,
    [x, y, z]: Vector<D>,
    t: D,
) -> Option<Vector<D>> {
    let p = |name: &str| parameters[name];
    let A = p("A");
    let c = (p("E") / p("rho0")).sqrt();
    let zero = D::from(0.0);
    let turned = |alpha: D| {
        let (sine, cosine) = alpha.sin_cos();
        [x * cosine - y * sine, x * sine + y * cosine]
    };
    Some(match name {
        "axis-aligned-1d" => [(x * PI).sin() * (t * (c * PI)).cos() * A, zero, zero],
        "axis-aligned" => [
            (x * PI).sin() * (t * (c * PI)).cos() * A,
            (y * PI).sin() * (t * (c * PI)).sin() * A,
            zero,
        ],
        "axis-aligned-3d" => {
            let wave = |x: D, i: f64| (x * PI).sin() * ((t * c + i * 2.0 / 3.0) * PI).sin() * A;
            [wave(x, 0.0), wave(y, 1.0), wave(z, 2.0)]
        }
        "bar" => {
            let L = p("L");
            [(x * (2.0 * PI / L)).sin() * (t * (c * PI / L)).cos() * A, zero, zero]
        }
        "rigid-motion" => {
            let phase = (t * (c * PI)).sin();
            let [turned_x, turned_y] = turned(phase * A);
            [turned_x - x + phase * p("U"), turned_y - y, zero]
        }
        "ring" | "ring-nu" => {
            let (Ri, Ro) = (p("Ri"), p("Ro"));
            let d = Ro * Ro * (3.0 * Ri - Ro);
            let R = (x * x + y * y).sqrt();
            let radial = (R * R * (2.0 / d) - R * (3.0 * (Ro + Ri) / d) + 6.0 * Ri * Ro / d)
                * (t * (c * PI)).cos()
                * A;
            [radial * x, radial * y, zero]
        }
        "shear-wave" => {
            let mu = p("E") / (2.0 * (1.0 + p("nu")));
            let k = 2.0 * PI / p("L");
            let w = k * (mu / p("rho0")).sqrt();
            [(y * k).sin() * (t * w).sin() * A, zero, zero]
        }
        "skew-2d" => {
            let (sine, cosine) = (t * (c * PI)).sin_cos();
            [
                (x * 3.0 + y).sin() * cosine * A,
                ((x * 2.0).cos() * (y * (PI / 2.0)).sin() + x * y * y * 0.5)
                    * (sine * 0.8 + cosine * 0.6)
                    * A,
                zero,
            ]
        }
        "skew-2d-rotating" => {
            // What turns is the current position.
            let u = displacement("skew-2d", parameters, [x, y, z], t)?;
            let (sine, cosine) = (t * p("Omega")).sin_cos();
            let (current_x, current_y) = (x + u[0], y + u[1]);
            [
                current_x * cosine - current_y * sine - x,
                current_x * sine + current_y * cosine - y,
                zero,
            ]
        }
        "skew-3d" => {
            let (sine, cosine) = (t * (c * PI)).sin_cos();
            [
                (x * 3.0 + y - z * 0.5).sin() * cosine * A,
                ((x * 2.0).cos() * (y * (PI / 2.0)).sin() + x * z * z)
                    * (sine * 0.8 + cosine * 0.6)
                    * A,
                (x * 0.5).exp()
                    * (y + z * 2.0).cos()
                    * (cosine * (5.0 / 13.0) - sine * (12.0 / 13.0))
                    * A,
            ]
        }
        "sphere-shell" => {
            let Ro = p("Ro");
            let R = (x * x + y * y + z * z).sqrt();
            let factor = R * (R * (-2.0 / Ro) + 3.0) / (Ro * Ro) * (t * (c * PI)).cos() * A;
            [factor * x, factor * y, factor * z]
        }
        "swirl" => {
            let alpha = (x * PI).sin().powi(4) * (y * PI).sin().powi(4) * (t * (c * PI)).sin() * A;
            let (sine, cosine) = alpha.sin_cos();
            let (from_x, from_y) = (x - 0.5, y - 0.5);
            [
                from_x * cosine - from_y * sine - from_x,
                from_x * sine + from_y * cosine - from_y,
                zero,
            ]
        }
        "torsion" => {
            let [turned_x, turned_y] = turned(z * (t * (c * PI)).sin() * A);
            [turned_x - x, turned_y - y, zero]
        }
        "vortex" => {
            let R = (x * x + y * y).sqrt();
            let from_middle = R - 1.0;
            let alpha = (t * (c * PI)).sin()
                * (from_middle.powi(4) * 256.0 - from_middle.powi(2) * 32.0 + 1.0)
                * A;
            let [turned_x, turned_y] = turned(alpha);
            [turned_x - x, turned_y - y, zero]
        }
        _ => return None,
    })
}

/// The material, with a vanishing Poisson's ratio where the solution has none.
struct Law {
    lambda: f64,
    mu: f64,
    density: f64,
}

impl Law {
    fn new(parameters: &Parameters) -> Self {
        let (E, nu) = (parameters["E"], parameters.get("nu").copied().unwrap_or(0.0));
        Law {
            lambda: E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)),
            mu: E / (2.0 * (1.0 + nu)),
            density: parameters["rho0"],
        }
    }

    /// First Piola-Kirchhoff stress.
    fn stress<D: Number>(&self, F: &Matrix<D>) -> Matrix<D> {
        let J = determinant(F);
        std::array::from_fn(|i| {
            std::array::from_fn(|k| {
                // The cofactor of (i, k), cyclic: no signs.
                let at = |row: usize, column: usize| F[(i + row) % 3][(k + column) % 3];
                let cofactor = at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1);
                let inverse_transpose = cofactor / J;
                inverse_transpose * J.ln() * self.lambda + (F[i][k] - inverse_transpose) * self.mu
            })
        })
    }
}

fn determinant<D: Number>(F: &Matrix<D>) -> D {
    (0..3)
        .map(|k| {
            let at = |row: usize, column: usize| F[row][(k + column) % 3];
            at(0, 0) * (at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1))
        })
        .fold(D::from(0.0), |sum, term| sum + term)
}

/// The fields of a motion, in three dimensions: what is missing to three stands still.
struct Motion<'a> {
    name: &'a str,
    parameters: &'a Parameters,
    law: Law,
}

impl Motion<'_> {
    fn displacement<D: Number>(&self, X: Vector<D>, t: D) -> Vector<D> {
        displacement(self.name, self.parameters, X, t).unwrap()
    }

    fn gradient<D: Number>(&self, X: Vector<D>, t: D) -> Matrix<D> {
        let columns: [Vector<D>; 3] = std::array::from_fn(|k| {
            let moved = std::array::from_fn(|i| {
                let rate = if i == k { D::from(1.0) } else { D::from(0.0) };
                Dual::new(X[i], rate)
            });
            self.displacement::<Dual<D>>(moved, Dual::from_re(t)).map(|u| u.eps)
        });
        std::array::from_fn(|i| std::array::from_fn(|k| columns[k][i]))
    }

    fn deformation<D: Number>(&self, X: Vector<D>, t: D) -> Matrix<D> {
        let mut F = self.gradient(X, t);
        for i in 0..3 {
            F[i][i] += D::from(1.0);
        }
        F
    }

    /// `Div P`, over the second index.
    fn divergence(&self, X: Vector<f64>, t: f64) -> Vector<f64> {
        let mut divergence = [0.0; 3];
        for k in 0..3 {
            let moved = std::array::from_fn(|i| Dual::new(X[i], if i == k { 1.0 } else { 0.0 }));
            let F = self.deformation::<Dual<f64>>(moved, Dual::from_re(t));
            let P = self.law.stress(&F);
            for i in 0..3 {
                divergence[i] += P[i][k].eps;
            }
        }
        divergence
    }
}

/// The largest size and the largest difference of one field over many points.
#[derive(Clone, Copy, Default)]
struct Comparison {
    scale: f64,
    difference: f64,
}

impl Comparison {
    fn add(&mut self, found: &[f64], expected: &[f64], scale: f64) {
        self.scale = self.scale.max(scale);
        for (a, b) in found.iter().zip(expected) {
            let difference = (a - b).abs();
            // A value that is not a number is infinitely wrong.
            self.difference =
                self.difference.max(if difference.is_nan() { f64::INFINITY } else { difference });
        }
    }
}

fn size(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |a, &b| a.max(b.abs()))
}

/// Numbers between 0 and 1 that fill the unit cube evenly, and never fall on its corners.
fn even(index: usize, axis: usize) -> f64 {
    // Powers of the inverse of the root of x^5 = x + 1.
    let step = 0.856_674_883_854_502_9_f64.powi(axis as i32 + 1);
    (0.5 + step * (index + 1) as f64).fract()
}

/// Reference points of the body.
fn point<const D: usize>(domain: &Domain<f64, D>, index: usize) -> SVector<f64, D> {
    match domain {
        Domain::Box { lower, upper } => {
            SVector::from_fn(|i, _| lower[i] + (upper[i] - lower[i]) * even(index, i))
        }
        Domain::Annulus { inner, outer } => {
            let R = inner + (outer - inner) * even(index, 0);
            let around = 2.0 * PI * even(index, 1);
            let height = if D == 3 { 2.0 * even(index, 2) - 1.0 } else { 0.0 };
            let flat = (1.0 - height * height).sqrt();
            let direction = [flat * around.cos(), flat * around.sin(), height];
            SVector::from_fn(|i, _| R * direction[i])
        }
        _ => panic!("a shape that this test does not know"),
    }
}

fn compare<const D: usize>(
    solution: &dyn Solution<f64, D>,
    motion: &Motion<'_>,
    worst: &mut BTreeMap<&'static str, Comparison>,
) {
    let rows = |A: &SMatrix<f64, D, D>| A.transpose().as_slice().to_vec();
    let corner =
        |A: &Matrix<f64>| A[..D].iter().flat_map(|row| row[..D].to_vec()).collect::<Vec<_>>();
    let domain = solution.domain();
    for index in 0..POINTS {
        let point = point(&domain, index);
        let X: Vector<f64> = std::array::from_fn(|i| if i < D { point[i] } else { 0.0 });
        let t = 2.0 * solution.period() * even(index, 3);

        let at_time = motion.displacement(X.map(Dual2::from_re), Dual2::from_re(t).derivative());
        let (u, v, a) = (at_time.map(|u| u.re), at_time.map(|u| u.v1), at_time.map(|u| u.v2));
        let H = motion.gradient(X, t);
        let F = motion.deformation(X, t);
        let J = determinant(&F);
        assert!(J > 0.0, "{} is inverted at {X:?}", motion.name);
        let P = motion.law.stress(&F);
        let force = motion.divergence(X, t).map(|f| f / motion.law.density);
        let b: Vector<f64> = std::array::from_fn(|i| a[i] - force[i]);

        let mut field = |name, found: &[f64], expected: &[f64], scale: f64| {
            worst.entry(name).or_default().add(found, expected, scale);
        };
        let fields = solution.fields(&point, t);
        let H_size = size(&corner(&H));
        field("u", solution.displacement(&point, t).as_slice(), &u[..D], size(&u));
        field("v", solution.velocity(&point, t).as_slice(), &v[..D], size(&v));
        field("a", solution.acceleration(&point, t).as_slice(), &a[..D], size(&a));
        field("H", &rows(&solution.displacement_gradient(&point, t)), &corner(&H), H_size);
        field("F", &rows(&solution.deformation_gradient(&point, t)), &corner(&F), 1.0);
        field("J", &[solution.jacobian(&point, t)], &[J], 1.0);
        // Where stress or body force vanish, what they are made of gives the scale.
        let P_scale = size(&corner(&P)).max(motion.law.mu * H_size);
        field("P", &rows(&solution.first_piola_kirchhoff(&point, t)), &corner(&P), P_scale);
        let b_scale = size(&a).max(size(&force));
        field("b", solution.body_force(&point, t).as_slice(), &b[..D], b_scale);
        field("b", fields.b.as_slice(), &b[..D], b_scale);
        field("P", &rows(&fields.P), &corner(&P), P_scale);
    }
}

/// Values that differ from the defaults by the given set; the zeroth set is the defaults.
fn parameters(spec: &Spec, set: usize) -> Parameters {
    let factor = |name: &str| -> f64 {
        let factors = match name {
            "A" => [1.0, -1.2, 0.3, 0.01],
            "E" => [1.0, 0.021, 3.0, 1e5],
            "rho0" => [1.0, 2.5, 0.1, 7800.0],
            "Ri" => [1.0, 1.1, 1.3, 0.9],
            "Ro" => [1.0, 1.2, 0.9, 1.05],
            _ => [1.0, 1.7, 0.4, 1.1],
        };
        factors[set]
    };
    let value = |name: &str, default: f64| match (name, set) {
        ("nu", 1) => -0.35,
        ("nu", 2) => 0.47,
        ("nu", 3) => 0.0,
        _ => default * factor(name),
    };
    spec.parameters.iter().map(|p| (p.name.clone(), value(&p.name, p.default))).collect()
}

#[test]
fn fields_agree_with_automatic_differentiation() {
    let folder = workspace().join("mms-specs");
    let mut files: Vec<_> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|file| file.extension().is_some_and(|e| e == "toml"));
    files.sort();
    assert!(!files.is_empty());
    let mut report = String::new();
    let mut failed = Vec::new();
    for file in files {
        let text = std::fs::read_to_string(&file).unwrap();
        let spec = Spec::parse(&text, &file.display().to_string()).unwrap();
        let mut worst = BTreeMap::<&str, f64>::new();
        for set in 0..4 {
            let parameters = parameters(&spec, set);
            assert!(
                displacement(&spec.name, &parameters, [1.0, 0.0, 0.0], 0.0).is_some(),
                "write the motion '{}' out by hand in this file",
                spec.name
            );
            let law = Law::new(&parameters);
            let motion = Motion { name: &spec.name, parameters: &parameters, law };
            let overrides = parameters.iter().map(|(name, value)| (name.as_str(), *value));
            let mut found = BTreeMap::new();
            match interpret(&spec, overrides).unwrap() {
                AnySolution::One(s) => compare(&*s, &motion, &mut found),
                AnySolution::Two(s) => compare(&*s, &motion, &mut found),
                AnySolution::Three(s) => compare(&*s, &motion, &mut found),
                _ => panic!("a dimension that this test does not know"),
            }
            for (field, Comparison { scale, difference }) in found {
                let relative = difference / scale;
                let entry = worst.entry(field).or_default();
                *entry = entry.max(relative);
                // A scale of zero makes this not a number, or infinite.
                if relative.is_nan() || relative > TOLERANCE {
                    failed.push(format!(
                        "{}, set {set}: {field} is off by {relative:.1e}",
                        spec.name
                    ));
                }
            }
        }
        report += &format!("{:16}", spec.name);
        for (field, relative) in worst {
            report += &format!(" {field} {relative:.1e}");
        }
        report.push('\n');
    }
    assert!(failed.is_empty(), "{}\n{report}", failed.join("\n"));
    if std::env::var_os("SHOW_DIFFERENCES").is_some() {
        std::io::Write::write_all(&mut std::io::stderr(), report.as_bytes()).unwrap();
    }
}
