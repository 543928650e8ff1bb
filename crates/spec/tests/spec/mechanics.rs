//! The derived fields against mechanics written down a second time: kinematics and the balance of momentum by differences of
//! their values, stresses by each law's formula in three dimensions, for every specification of the library and of
//! the tests. The traction on a surface is the stress there on its normal.

#![allow(clippy::unwrap_used)]

use mmsmith_expr::{Expr, Program};
use mmsmith_spec::{Around, Coordinates, Domain, Fields, Law, Spec, Surface};
use mmsmith_vocabulary::{Derivation, Material};
use std::path::{Path, PathBuf};

type Tensor = [[f64; 3]; 3];

fn tensor(entry: impl Fn(usize, usize) -> f64) -> Tensor {
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

fn times(a: &Tensor, b: &Tensor) -> Tensor {
    tensor(|i, j| (0..3).map(|k| a[i][k] * b[k][j]).sum())
}

fn transposed(a: &Tensor) -> Tensor {
    tensor(|i, j| a[j][i])
}

fn trace(a: &Tensor) -> f64 {
    a[0][0] + a[1][1] + a[2][2]
}

fn identity(i: usize, j: usize) -> f64 {
    f64::from(u8::from(i == j))
}

fn determinant(a: &Tensor) -> f64 {
    (0..3).map(|i| a[0][i] * cofactor(a, 0, i)).sum()
}

fn cofactor(a: &Tensor, i: usize, j: usize) -> f64 {
    let at = |m: usize, n: usize| a[(i + m) % 3][(j + n) % 3];
    at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1)
}

/// The logarithm of a symmetric tensor of positive eigenvalues, by Jacobi's rotations.
fn logarithm(a: &Tensor) -> Tensor {
    let (mut a, mut axes) = (*a, tensor(identity));
    for _ in 0..20 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let angle = 0.5 * (2.0 * a[p][q]).atan2(a[q][q] - a[p][p]);
            let (s, c) = angle.sin_cos();
            let mut turn = tensor(identity);
            (turn[p][p], turn[p][q], turn[q][p], turn[q][q]) = (c, s, -s, c);
            a = times(&transposed(&turn), &times(&a, &turn));
            axes = times(&axes, &turn);
        }
    }
    tensor(|i, j| (0..3).map(|k| axes[i][k] * a[k][k].ln() * axes[j][k]).sum())
}

/// The first Piola-Kirchhoff stress of a law with these constants; `None` for a law that is stated by its energy alone.
fn stress(law: &Law, constants: &[f64], F: &Tensor) -> Option<Tensor> {
    let Law::Library(material) = law else { return None };
    let mut values = constants.iter();
    let material = material.map(|_| *values.next().unwrap());
    let J = determinant(F);
    let inverse_transposed = tensor(|i, j| cofactor(F, i, j) / J);
    let C = times(&transposed(F), F);
    let of_kirchhoff = |tau: Tensor| Some(times(&tau, &inverse_transposed));
    if let Material::Hencky { lambda, mu } = material {
        let doubled = logarithm(&times(F, &transposed(F)));
        return of_kirchhoff(tensor(|i, j| lambda * J.ln() * identity(i, j) + mu * doubled[i][j]));
    }
    if let Material::MooneyRivlin { c1, c2, lambda } = material {
        let FC = times(F, &C);
        return Some(tensor(|i, j| {
            2.0 * c1 * (F[i][j] - inverse_transposed[i][j])
                + 2.0 * c2 * (trace(&C) * F[i][j] - FC[i][j] - 2.0 * inverse_transposed[i][j])
                + lambda * J.ln() * inverse_transposed[i][j]
        }));
    }
    match material.derivation() {
        Derivation::NeoHookean { lambda, mu } => {
            let b = times(F, &transposed(F));
            of_kirchhoff(tensor(|i, j| {
                lambda * J.ln() * identity(i, j) + mu * (b[i][j] - identity(i, j))
            }))
        }
        Derivation::StVenantKirchhoff { lambda, mu } => {
            let strain = tensor(|i, j| 0.5 * (C[i][j] - identity(i, j)));
            let second =
                tensor(|i, j| lambda * trace(&strain) * identity(i, j) + 2.0 * mu * strain[i][j]);
            Some(times(F, &second))
        }
        Derivation::LinearElastic { lambda, mu } => {
            let H = tensor(|i, j| F[i][j] - identity(i, j));
            Some(tensor(|i, j| lambda * trace(&H) * identity(i, j) + mu * (H[i][j] + H[j][i])))
        }
        // The other laws that are stated by their energies are compared with these in `mmsmith-mpm`, in 77 digits.
        Derivation::Energy { .. }
        | Derivation::Isochoric { .. }
        | Derivation::PrincipalStretches(_) => None,
    }
}

/// The deformation in space whose stretch across leaves no stress there, by Newton's method on the law in space, and the stress: of a law
/// that the specification makes of one of the library.
fn free_across(spec: &Spec, law: &str, constants: &[f64], F: &Tensor) -> [Tensor; 2] {
    let n = spec.dimension;
    let (lambda, mu) = (constants[0], constants[1]);
    let in_space = |stretch: f64| {
        let F = tensor(|i, j| if i.max(j) < n { F[i][j] } else { stretch * identity(i, j) });
        let material = match law {
            "linear-elastic" => Material::LinearElastic { lambda, mu },
            "st-venant-kirchhoff" => Material::StVenantKirchhoff { lambda, mu },
            "hencky" => Material::Hencky { lambda, mu },
            _ => {
                let J = determinant(&F);
                let pressure = match spec.source.contains("'mixed'") {
                    true => 0.5 * (J * J - 1.0),
                    false => J * (J - 1.0),
                };
                let b = times(&F, &transposed(&F));
                let tau = tensor(|i, j| {
                    lambda * pressure * identity(i, j) + mu * (b[i][j] - identity(i, j))
                });
                return [F, times(&tau, &tensor(|i, j| cofactor(&F, i, j) / J))];
            }
        };
        let law = Law::Library(material.map(|_| spec.density));
        [F, stress(&law, &[lambda, mu], &F).unwrap()]
    };
    let is_free = spec.variation.as_ref().is_some_and(|variation| variation.assumption.is_some());
    let mut stretch = 1.0;
    for _ in 0..if is_free { 40 } else { 0 } {
        let across = |stretch: f64| in_space(stretch)[1][2][2];
        let slope = (across(stretch + 1e-6) - across(stretch - 1e-6)) / 2e-6;
        stretch -= across(stretch) / slope;
    }
    in_space(stretch)
}

/// The coordinates' own unit vectors, a column each.
fn unit_vectors(spec: &Spec, X: &[f64]) -> Tensor {
    match spec.coordinates {
        Coordinates::Polar => {
            let (sin, cos) = X[1].atan2(X[0]).sin_cos();
            [[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]
        }
        _ => tensor(identity),
    }
}

/// The values of all fields at a place and time.
struct Values {
    u: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
    b: Vec<f64>,
    /// By rows.
    H: Vec<f64>,
    F: Vec<f64>,
    P: Vec<f64>,
    J: f64,
    density: f64,
    constants: Vec<f64>,
    /// By rows; empty where the body has no stress at the start.
    prestress: Vec<f64>,
}

struct Solution {
    n: usize,
    program: Program,
    parameters: Vec<f64>,
    constants: usize,
    prestress: usize,
}

impl Solution {
    fn new(spec: &Spec, fields: &mut Fields) -> Self {
        let mut outputs: Vec<Expr> =
            [&fields.u, &fields.v, &fields.a, &fields.b].map(|x| &x[..]).concat();
        outputs.extend([&fields.H, &fields.F, &fields.P].iter().flat_map(|A| A.concat()));
        outputs.extend([fields.J, spec.density]);
        let constants = match &spec.variation {
            Some(variation) => variation.constants.clone(),
            None => spec.material.constants(),
        };
        outputs.extend(constants.iter().map(|(_, value)| *value));
        let prestress = spec.prestress.as_ref().map(|S| S.concat()).unwrap_or_default();
        outputs.extend(&prestress);
        Solution {
            n: spec.dimension,
            program: fields.program(&outputs),
            parameters: spec.parameters.iter().map(|p| p.default).collect(),
            constants: constants.len(),
            prestress: prestress.len(),
        }
    }

    fn at(&self, X: &[f64], t: f64) -> Values {
        let values = self.program.evaluate(&[X, &[t], &self.parameters].concat());
        let mut values = values.into_iter();
        let mut take = |count: usize| values.by_ref().take(count).collect::<Vec<f64>>();
        let (n, square) = (self.n, self.n * self.n);
        Values {
            u: take(n),
            v: take(n),
            a: take(n),
            b: take(n),
            H: take(square),
            F: take(square),
            P: take(square),
            J: take(1)[0],
            density: take(1)[0],
            constants: take(self.constants),
            prestress: take(self.prestress),
        }
    }
}

/// The chain rule `dP/dX = A : dF/dX` for the derivatives of the stress, of every law that has them.
#[test]
fn tangents_are_the_derivatives_of_stresses() {
    let mut judged = 0;
    for path in specifications() {
        let file = path.file_name().unwrap().to_str().unwrap();
        let spec = Spec::parse(&std::fs::read_to_string(&path).unwrap(), file).unwrap();
        let Ok(mut fields) = spec.derive_with_tangent() else { continue };
        let (n, square) = (spec.dimension, spec.dimension * spec.dimension);
        let tangent: Vec<Expr> = fields.tangent.iter().flatten().flat_map(|A| A.concat()).collect();
        let outputs = [fields.P.concat(), fields.F.concat(), tangent].concat();
        let program = fields.program(&outputs);
        let parameters: Vec<f64> = spec.parameters.iter().map(|p| p.default).collect();
        let t = 0.23
            * fields
                .program(&[spec.period])
                .evaluate(&[vec![0.0; n + 1], parameters.clone()].concat())[0];
        for X in places(&spec, &mut fields) {
            let at = |X: &[f64]| program.evaluate(&[X, &[t], &parameters].concat());
            let A = at(&X)[2 * square..].to_vec();
            for axis in 0..n {
                let moved = |by: f64| {
                    let mut X = X.clone();
                    X[axis] += by;
                    at(&X)[..2 * square].to_vec()
                };
                let slopes = derivative(moved, 1e-3);
                let (of_P, of_F) = slopes.split_at(square);
                for (entry, of_P) in of_P.iter().enumerate() {
                    let terms: Vec<f64> =
                        (0..square).map(|kL| A[kL * square + entry] * of_F[kL]).collect();
                    let scale = A.iter().fold(of_P.abs(), |m, a| m.max(a.abs()));
                    let sum: f64 = terms.iter().sum();
                    assert!((sum - of_P).abs() < 1e-7 * scale, "{file}: {of_P:e} is not {sum:e}");
                }
            }
        }
        judged += 1;
    }
    assert!(judged > 40, "{judged}");
}

/// The derivative of values that are a function of one number, at zero; the error is of the fourth order in `h`.
fn derivative(values: impl Fn(f64) -> Vec<f64>, h: f64) -> Vec<f64> {
    let slope = |h: f64| -> Vec<f64> {
        values(h).iter().zip(values(-h)).map(|(above, below)| (above - below) / (2.0 * h)).collect()
    };
    slope(h).iter().zip(slope(2.0 * h)).map(|(fine, coarse)| (4.0 * fine - coarse) / 3.0).collect()
}

/// Where a surface is: the place on it that is nearest to `X`, and the outward normal there.
fn on_surface(spec: &Spec, fields: &mut Fields, surface: Surface, X: &[f64]) -> [Vec<f64>; 2] {
    let parameters: Vec<f64> = spec.parameters.iter().map(|p| p.default).collect();
    let inputs = [vec![0.0; spec.dimension + 1], parameters].concat();
    let mut value = |measure: Expr| fields.program(&[measure]).evaluate(&inputs)[0];
    let plane = |axis: usize, at: f64, sign: f64| {
        let (mut place, mut normal) = (X.to_vec(), vec![0.0; X.len()]);
        (place[axis], normal[axis]) = (at, sign);
        [place, normal]
    };
    let rim = |radius: f64, sign: f64| {
        let length = X.iter().map(|x| x * x).sum::<f64>().sqrt();
        [radius, sign].map(|factor| X.iter().map(|x| factor * x / length).collect())
    };
    let about_axis = |radius: f64, sign: f64| {
        let share = radius / X[0].hypot(X[1]);
        let normal = [X[0], X[1], 0.0].map(|x| sign * share * x / radius);
        [vec![share * X[0], share * X[1], X[2]], normal.to_vec()]
    };
    match (surface, &spec.domain) {
        (Surface::Lower(axis), Domain::Box { lower, .. }) => plane(axis, value(lower[axis]), -1.0),
        (Surface::Upper(axis), Domain::Box { upper, .. }) => plane(axis, value(upper[axis]), 1.0),
        (Surface::Lower(axis), Domain::Annulus { .. }) => plane(axis, 0.0, -1.0),
        (Surface::Inner, Domain::Annulus { inner, .. }) => rim(value(*inner), -1.0),
        (Surface::Outer, Domain::Annulus { outer, .. }) => rim(value(*outer), 1.0),
        (Surface::Inner, Domain::Tube { inner, .. }) => about_axis(value(*inner), -1.0),
        (Surface::Outer, Domain::Tube { outer, .. }) => about_axis(value(*outer), 1.0),
        (Surface::Lower(axis), Domain::Tube { lower, .. }) => plane(axis, value(*lower), -1.0),
        (Surface::Upper(axis), Domain::Tube { upper, .. }) => plane(axis, value(*upper), 1.0),
        (
            Surface::FirstAngle | Surface::LastAngle,
            Domain::Tube { around: Around::Sector { from, to }, .. },
        ) => {
            let last = surface == Surface::LastAngle;
            let (sin, cos) = value(if last { *to } else { *from }).sin_cos();
            let sign = if last { 1.0 } else { -1.0 };
            let distance = X[0].hypot(X[1]);
            [vec![distance * cos, distance * sin, X[2]], vec![-sin * sign, cos * sign, 0.0]]
        }
        _ => panic!("{surface:?} of {:?}", spec.domain),
    }
}

/// Places within the body, none of them on an axis or a plane of symmetry.
fn places(spec: &Spec, fields: &mut Fields) -> Vec<Vec<f64>> {
    let parameters: Vec<f64> = spec.parameters.iter().map(|p| p.default).collect();
    let inputs = [vec![0.0; spec.dimension + 1], parameters].concat();
    let mut values = |measures: &[Expr]| fields.program(measures).evaluate(&inputs);
    let fractions = [[0.31, 0.62, 0.17], [0.83, 0.24, 0.55], [0.47, 0.91, 0.72]];
    match &spec.domain {
        Domain::Box { lower, upper } => {
            let (lower, upper) = (values(lower), values(upper));
            fractions
                .iter()
                .map(|f| {
                    (0..lower.len()).map(|i| lower[i] + f[i] * (upper[i] - lower[i])).collect()
                })
                .collect()
        }
        Domain::Tube { inner, outer, lower, upper, around } => {
            let ends = values(&[*inner, *outer, *lower, *upper]);
            let angles = around.angles().map_or(vec![0.0, 1.5], |angles| values(&angles));
            let between = |ends: &[f64], share: f64| ends[0] + share * (ends[1] - ends[0]);
            fractions
                .iter()
                .map(|f| {
                    let (sin, cos) = between(&angles, f[1]).sin_cos();
                    let radius = between(&ends[..2], f[0]);
                    vec![radius * cos, radius * sin, between(&ends[2..], f[2])]
                })
                .collect()
        }
        Domain::Annulus { inner, outer } => {
            let radii = values(&[*inner, *outer]);
            fractions
                .iter()
                .map(|f| {
                    let radius = radii[0] + f[0] * (radii[1] - radii[0]);
                    let direction: Vec<f64> = (0..spec.dimension).map(|i| 0.2 + f[2 - i]).collect();
                    let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
                    direction.iter().map(|x| radius * x / length).collect()
                })
                .collect()
        }
    }
}

fn specifications() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let folders = [
        "mms-specs",
        "tests/data/specs",
        "tests/data/specs/materials",
        "tests/data/specs/across",
        "crates/spec/tests/data/ok",
    ];
    let mut found: Vec<PathBuf> = folders
        .iter()
        .flat_map(|folder| std::fs::read_dir(root.join(folder)).unwrap())
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "toml"))
        .collect();
    found.sort();
    found
}

#[test]
fn fields_obey_mechanics() {
    for path in specifications() {
        let file = path.file_name().unwrap().to_str().unwrap();
        let spec = Spec::parse(&std::fs::read_to_string(&path).unwrap(), file)
            .unwrap_or_else(|diagnostic| panic!("{diagnostic}"));
        let law = format!("law = '{}'", spec.law_name());
        assert!(spec.source.contains(&law), "{file}: {law}");
        // Where the stress is no function of the deformation alone.
        let has_memory = match spec.law_for_solver() {
            mmsmith_vocabulary::Law::Stated(stated) => stated.has_memory(),
            mmsmith_vocabulary::Law::WithMemory(_) => true,
            mmsmith_vocabulary::Law::Library(_) => false,
        };
        if has_memory {
            continue;
        }
        let mut fields = spec.derive().unwrap();
        let solution = Solution::new(&spec, &mut fields);
        let n = spec.dimension;
        let period = {
            let inputs: Vec<f64> = [vec![0.0; n + 1], solution.parameters.clone()].concat();
            fields.program(&[spec.period]).evaluate(&inputs)[0]
        };
        let surfaces = fields.surfaces.clone();
        let tractions: Vec<(Surface, Program)> =
            surfaces.iter().map(|on| (on.surface, fields.program(&on.traction))).collect();
        for X in places(&spec, &mut fields) {
            let t = 0.23 * period;
            let here = solution.at(&X, t);
            let close = |found: &[f64], expected: &[f64], scale: f64, what: &str| {
                assert_eq!(found.len(), expected.len());
                for (found, expected) in found.iter().zip(expected) {
                    assert!(
                        (found - expected).abs() <= 1e-7 * scale,
                        "{file}: {what} is {found:e}, not {expected:e}, at {X:?}"
                    );
                }
            };
            let largest = |values: &[f64]| values.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            let moved = |axis: usize, by: f64| {
                let mut X = X.clone();
                X[axis] += by;
                solution.at(&X, t)
            };

            // Kinematics.
            let h = 1e-3 * period;
            let of_time =
                |part: fn(Values) -> Vec<f64>| derivative(|by| part(solution.at(&X, t + by)), h);
            let speed = largest(&here.v).max(largest(&here.u) / period);
            close(&here.v, &of_time(|values| values.u), speed, "v");
            close(&here.a, &of_time(|values| values.v), largest(&here.a).max(speed / period), "a");
            let by_axis = |part: fn(Values) -> Vec<f64>| -> Vec<Vec<f64>> {
                (0..n).map(|axis| derivative(|by| part(moved(axis, by)), 1e-3)).collect()
            };
            let columns = by_axis(|values| values.u);
            let H: Vec<f64> = (0..n * n).map(|k| columns[k % n][k / n]).collect();
            close(&here.H, &H, 1.0, "H");
            let plane = |values: &[f64], i: usize, j: usize| {
                if i < n && j < n { values[i * n + j] } else { identity(i, j) }
            };
            let F: Vec<f64> = (0..n * n).map(|k| here.H[k] + identity(k / n, k % n)).collect();
            close(&here.F, &F, 1e-6, "F");
            // Out of the plane nothing is stretched.
            let F = tensor(|i, j| plane(&F, i, j));
            close(&[here.J], &[determinant(&F)], 1e-6, "J");

            // The law, and the balance of momentum: rho0 a = Div P + rho0 b.
            let modulus = largest(&here.constants).max(largest(&here.P));
            let P = match &spec.variation {
                Some(variation) => Some(free_across(&spec, variation.law, &here.constants, &F)[1]),
                None => stress(&spec.material, &here.constants, &F),
            };
            if let Some(P) = P {
                let mut start = tensor(|_, _| 0.0);
                if !here.prestress.is_empty() {
                    let own = tensor(|i, j| match i.max(j) < n {
                        true => here.prestress[i * n + j],
                        false => 0.0,
                    });
                    let frame = unit_vectors(&spec, &X);
                    start = times(&F, &times(&frame, &times(&own, &transposed(&frame))));
                }
                let P: Vec<f64> =
                    (0..n * n).map(|k| P[k / n][k % n] + start[k / n][k % n]).collect();
                close(&here.P, &P, 1e-4 * modulus, "P");
            }
            let columns = by_axis(|values| values.P);
            let b: Vec<f64> = (0..n)
                .map(|i| {
                    let divergence: f64 = (0..n).map(|axis| columns[axis][i * n + axis]).sum();
                    here.a[i] - divergence / here.density
                })
                .collect();
            close(&here.b, &b, modulus / here.density, "b");
            for (surface, traction) in &tractions {
                let [place, normal] = on_surface(&spec, &mut fields, *surface, &X);
                let P = solution.at(&place, t).P;
                let expected: Vec<f64> =
                    (0..n).map(|i| (0..n).map(|j| P[i * n + j] * normal[j]).sum()).collect();
                let found = traction.evaluate(&[&place[..], &[t], &solution.parameters].concat());
                close(&found, &expected, 1e-6 * modulus, &format!("traction on {surface:?}"));
            }
        }
    }
}
