//! Histories against closed forms, differences and the conditions that they have to keep.

#![allow(non_snake_case, clippy::unwrap_used)]

use mmsmith_history::{
    Branch, Dual, Hardening, HistoryError, J2, Kinematics, LawWithHistory, Maxwell, Table, Tensor,
    Trajectory, Viscoelastic, divergence,
};
use mmsmith_laws::{BLOCK, Increment, LawWithMemory, Plastic, ReturnMap};
use nalgebra::{Matrix3, SymmetricEigen};

const MU: f64 = 3846.0;
const YIELD: f64 = 50.0;

fn law(modulus: f64, exponent: f64) -> J2 {
    let hardening = Hardening { yield_stress: YIELD, modulus, exponent };
    J2 { lambda: 5769.0, mu: MU, hardening, overstress: None }
}

fn start(law: &impl LawWithHistory) -> Vec<f64> {
    law.variables().iter().map(|variable| variable.initial).collect()
}

/// Times from 0 to 1.
fn times(count: usize) -> Vec<f64> {
    (1..=count).map(|k| k as f64 / count as f64).collect()
}

/// A motion without slopes from the deformation gradient and its rate.
fn along(
    motion: impl Fn(f64) -> (Matrix3<f64>, Matrix3<f64>) + Sync,
) -> impl Fn(f64) -> Kinematics<Dual<f64, 1>> + Sync {
    move |t| {
        let (F, rate) = motion(t);
        let of = |A: Matrix3<f64>| -> Tensor<Dual<f64, 1>> {
            std::array::from_fn(|i| {
                std::array::from_fn(|j| Dual { value: A[(i, j)], slopes: [0.0] })
            })
        };
        Kinematics { F: of(F), rate: of(rate) }
    }
}

/// Uniaxial strain from the yield point on: `alpha = (2 mu ln F - sy)/(3 mu + H)`.
#[test]
fn a_bar_has_the_plastic_strain_of_its_closed_form() {
    let law = law(500.0, 1.0);
    let e0 = YIELD / (2.0 * MU);
    let stretch = |t: f64| e0.exp() * (1.0 + 0.3 * t + 0.1 * (2.0 * t).sin());
    let motion = along(|t| {
        let rate = e0.exp() * (0.3 + 0.2 * (2.0 * t).cos());
        let one = Matrix3::identity();
        let mut F = one;
        F[(0, 0)] = stretch(t);
        let mut dF = Matrix3::zeros();
        dF[(0, 0)] = rate;
        (F, dF)
    });
    let found = Trajectory::new(&law, &motion, &start(&law), &times(10), 1e-13).unwrap();
    assert!(found.changes.is_empty() && found.least_margin > 0.7, "{found:?}");
    for (t, z) in times(10).into_iter().zip(&found.states) {
        let alpha = (2.0 * MU * stretch(t).ln() - YIELD) / (3.0 * MU + 500.0);
        assert!((z[6].value - alpha).abs() < 1e-13, "{t}: {} {alpha}", z[6].value);
    }
}

/// Perfect plasticity under a constant rate of strain that is not along the stress: the angle `psi` between them follows
/// `tan(psi/2) = tan(psi_0/2) exp(-2 mu |d| t / R)` (R. D. Krieg and D. B. Krieg, J. Press. Vess. Technol. 99 (1977) 510-515), here in the
/// logarithmic strains of fixed axes.
#[test]
fn constant_rates_have_the_angle_of_krieg_and_krieg() {
    let law = law(0.0, 1.0);
    let R = (2.0_f64 / 3.0).sqrt() * YIELD;
    // Two directions of unit length in the plane of deviators.
    let first = nalgebra::vector![1.0, -1.0, 0.0] / 2.0_f64.sqrt();
    let second = nalgebra::vector![1.0, 1.0, -2.0] / 6.0_f64.sqrt();
    let speed = 0.02;
    let first_angle = 1.2_f64;
    let of_stress = second * first_angle.cos() + first * first_angle.sin();
    let motion = along(|t| {
        let e = of_stress * (R / (2.0 * MU)) + second * (speed * t);
        let F = Matrix3::from_diagonal(&e.map(f64::exp));
        (F, F * Matrix3::from_diagonal(&(second * speed)))
    });
    let times: Vec<f64> = times(8).iter().map(|t| 0.4 * t).collect();
    let found = Trajectory::new(&law, &motion, &start(&law), &times, 1e-14).unwrap();
    assert!(found.changes.is_empty());
    for (&t, z) in times.iter().zip(&found.states) {
        let values: Vec<f64> = z.iter().map(|z| z.value).collect();
        let at = motion(t);
        let F = Matrix3::from_fn(|i, j| at.F[i][j].value);
        let plain: Tensor<f64> = std::array::from_fn(|i| std::array::from_fn(|j| F[(i, j)]));
        let P = law.first_piola_kirchhoff(&Kinematics { F: plain, rate: plain }, &values);
        let tau = Matrix3::from_fn(|i, j| P[i][j]) * F.transpose();
        let s = (tau - Matrix3::identity() * (tau.trace() / 3.0)).diagonal();
        let psi = s.dot(&first).atan2(s.dot(&second));
        let half = (0.5 * first_angle).tan() * (-2.0 * MU * speed * t / R).exp();
        let expected = 2.0 * half.atan();
        assert!((psi - expected).abs() < 1e-12, "{t}: {psi} {expected}");
        assert!((s.norm() / R - 1.0).abs() < 1e-12);
    }
}

/// Displacements of a block with shear and stretch, with slopes along two coordinates.
fn block(X: [f64; 2], base: f64) -> impl Fn(f64) -> Kinematics<Dual<f64, 2>> + Sync {
    move |t: f64| {
        let (x, y) =
            (Dual { value: X[0], slopes: [1.0, 0.0] }, Dual { value: X[1], slopes: [0.0, 1.0] });
        let number = |value: f64| Dual { value, slopes: [0.0; 2] };
        let ramp = |r: f64| {
            let (r, stretch) = (number(r), number(0.1));
            let bend = number(0.04);
            [
                [r * (stretch + bend * x * y), r * number(0.05) * x * x],
                [r * bend * y * x, r * (number(-0.08) + number(0.02) * x)],
            ]
        };
        let of = |entries: [[Dual<f64, 2>; 2]; 2], diagonal: [f64; 3]| -> Tensor<Dual<f64, 2>> {
            std::array::from_fn(|i| {
                std::array::from_fn(|j| {
                    let at = if i < 2 && j < 2 { entries[i][j] } else { number(0.0) };
                    if i == j { at + number(diagonal[i]) } else { at }
                })
            })
        };
        let diagonal = [base, 1.0 / base, 1.0];
        Kinematics {
            F: of(ramp(t + 0.3 * t * t), diagonal),
            rate: of(ramp(1.0 + 0.6 * t), [0.0; 3]),
        }
    }
}

/// `|f|` over the yield stress, and `det G - 1`.
fn residuals(law: &J2, at: &Kinematics<Dual<f64, 2>>, z: &[Dual<f64, 2>]) -> [f64; 2] {
    let F = Matrix3::from_fn(|i, j| at.F[i][j].value);
    let [a, b, c, d, e, f] = std::array::from_fn(|k| z[k].value);
    let G = Matrix3::new(a, d, e, d, b, f, e, f, c);
    let be = F * G * F.transpose();
    let eigen = SymmetricEigen::new(be);
    let logs = eigen.eigenvalues.map(|value| value.ln());
    let s = logs.add_scalar(-logs.mean()) * law.mu;
    let allowed = (2.0_f64 / 3.0).sqrt() * law.hardening.stress(law.plastic_strain(z).value);
    [(s.norm() - allowed).abs() / YIELD, (G.determinant() - 1.0).abs()]
}

#[test]
fn flow_keeps_the_yield_condition_and_the_volume() {
    for law in [law(500.0, 1.0), law(0.0, 1.0), law(80.0, 1.0 / 3.0)] {
        let motion = block([0.37, 0.61], law.stretch_to_yield());
        let found = Trajectory::new(&law, &motion, &start(&law), &times(20), 2e-15).unwrap();
        assert!(found.changes.is_empty(), "{:?}", found.changes);
        for (t, z) in times(20).into_iter().zip(&found.states) {
            for residual in residuals(&law, &motion(t), z) {
                assert!(residual < 1e-12, "{t}: {residual:e}");
            }
        }
    }
}

/// Slopes along positions against differences of neighbours, in flow from the start and after an onset.
#[test]
fn slopes_of_variables_are_those_of_neighbours() {
    let h = 1e-5;
    for (law, base) in
        [(law(500.0, 1.0), None), (law(80.0, 1.0 / 3.0), Some(1.0)), (law(500.0, 1.0), Some(1.0))]
    {
        let base = base.unwrap_or_else(|| law.stretch_to_yield());
        let at = |X: [f64; 2]| {
            Trajectory::new(&law, &block(X, base), &start(&law), &times(4), 1e-13).unwrap()
        };
        let own = at([0.37, 0.61]);
        assert_eq!(own.changes.len(), usize::from(base == 1.0), "{:?}", own.changes);
        for axis in 0..2 {
            let shifted = |by: f64| {
                at(std::array::from_fn(|a| [0.37, 0.61][a] + if a == axis { by } else { 0.0 }))
            };
            let (above, below) = (shifted(h), shifted(-h));
            for (k, z) in own.states.iter().enumerate() {
                for (n, z) in z.iter().enumerate() {
                    let difference =
                        (above.states[k][n].value - below.states[k][n].value) / (2.0 * h);
                    let off = (z.slopes[axis] - difference).abs();
                    assert!(off < 2e-8, "{law:?} {axis} {k} {n}: {} {difference}", z.slopes[axis]);
                }
            }
        }
    }
}

/// The divergence by slopes against differences of stresses.
#[test]
fn the_divergence_of_the_stress_is_that_of_neighbours() {
    let law = law(500.0, 1.0);
    let base = law.stretch_to_yield();
    let P = |X: [f64; 2]| {
        let motion = block(X, base);
        let found = Trajectory::new(&law, &motion, &start(&law), &[0.8], 1e-13).unwrap();
        divergence(&law, &motion(0.8), &found.states[0])
    };
    let (X, h) = ([0.37, 0.61], 1e-4);
    let (found, _) = P(X);
    for i in 0..2 {
        let difference: f64 = (0..2)
            .map(|axis| {
                let at = |by: f64| {
                    P(std::array::from_fn(|a| X[a] + if a == axis { by } else { 0.0 })).1[i][axis]
                };
                (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h)
            })
            .sum();
        assert!(
            (found[i] - difference).abs() < 1e-6 * difference.abs(),
            "{} {difference}",
            found[i]
        );
    }
}

#[test]
fn unloading_is_elastic_and_flow_goes_on_behind_it() {
    let law = law(500.0, 1.0);
    let motion = along(|t| {
        let (e, rate) = (0.02 * (7.0 * t).sin(), 0.14 * (7.0 * t).cos());
        let mut F = Matrix3::identity();
        F[(0, 1)] = e;
        let mut dF = Matrix3::zeros();
        dF[(0, 1)] = rate;
        (F, dF)
    });
    let found = Trajectory::new(&law, &motion, &start(&law), &times(100), 1e-12).unwrap();
    let branches: Vec<Branch> = found.changes.iter().map(|change| change.branch).collect();
    use Branch::{Elastic, Flowing};
    assert_eq!(branches, [Flowing, Elastic, Flowing, Elastic, Flowing], "{:?}", found.changes);
    let alphas: Vec<f64> = found.states.iter().map(|z| z[6].value).collect();
    assert!(alphas.is_sorted() && alphas[99] > 2.0 * alphas[24]);
}

/// After the deformation stops, stresses of elements decay by their times.
#[test]
fn stresses_of_maxwell_elements_relax() {
    let elements = vec![Maxwell { share: 0.3, time: 0.2 }, Maxwell { share: 0.2, time: 0.7 }];
    let law = Viscoelastic { lambda: 5769.0, mu: MU, elements };
    // A cubic ramp up to the time 1/2.
    let motion = along(|t| {
        let (r, rate) = if t < 0.5 {
            (1.0 - (1.0 - 2.0 * t).powi(3), 6.0 * (1.0 - 2.0 * t).powi(2))
        } else {
            (1.0, 0.0)
        };
        let along = Matrix3::new(0.2, 0.1, 0.0, -0.05, 0.1, 0.0, 0.0, 0.0, 0.0);
        (Matrix3::identity() + along * r, along * rate)
    });
    let found = Trajectory::new(&law, &motion, &start(&law), &[0.5, 0.8, 1.0], 1e-13).unwrap();
    for (element, time) in [0.2_f64, 0.7].into_iter().enumerate() {
        for entry in 6 * element..6 * element + 6 {
            let [first, second, third] = [0, 1, 2].map(|k| found.states[k][entry].value);
            let size = first.abs().max(1.0);
            assert!((second - first * (-0.3 / time).exp()).abs() < 1e-11 * size);
            assert!((third - first * (-0.5 / time).exp()).abs() < 1e-11 * size);
        }
    }
    // Fast deformations have the instantaneous modulus.
    let fast = Viscoelastic { elements: vec![Maxwell { share: 0.5, time: 1e9 }], ..law.clone() };
    let elastic = Viscoelastic { elements: Vec::new(), ..law };
    let z = Trajectory::new(&fast, &motion, &start(&fast), &[0.5], 1e-13).unwrap();
    let (_, with) = divergence(&fast, &motion(0.5), &z.states[0]);
    let (_, without) = divergence(&elastic, &motion(0.5), &[]);
    for k in 0..9 {
        assert!((with[k / 3][k % 3] - without[k / 3][k % 3]).abs() < 1e-6);
    }
}

/// The divergence of the stress and the plastic strain of a block that flows from the start, at some times.
fn fields(law: &J2, X: [f64; 2], times: &[f64]) -> Result<Vec<Vec<f64>>, HistoryError> {
    let motion = block(X, law.stretch_to_yield());
    let found = Trajectory::new(law, &motion, &start(law), times, 1e-14)?;
    let of = |(&t, z): (&f64, &Vec<Dual<f64, 2>>)| {
        let ([x, y], _) = divergence(law, &motion(t), z);
        [x, y, z[6].value]
    };
    let rows: Vec<[f64; 3]> = times.iter().zip(&found.states).map(of).collect();
    Ok((0..3).map(|quantity| rows.iter().map(|row| row[quantity]).collect()).collect())
}

#[test]
fn a_table_has_the_fields_of_trajectories_at_all_positions_and_times() {
    let law = law(500.0, 1.0);
    let (table, told) =
        Table::fine([[0.0, 1.0]; 2], 1.0, 3e-13, |X, times| fields(&law, X, times)).unwrap();
    println!("told {told:e}, tails {:?}", table.tails());
    assert!(told < 1e-11, "{told:e}");
    for k in 0..12 {
        let X = [(0.17 + 0.618 * f64::from(k)).fract(), (0.53 + 0.755 * f64::from(k)).fract()];
        let at = table.at(&X);
        let times = [0.1, 0.45, 0.77, 1.0];
        let exact = fields(&law, X, &times).unwrap();
        for (quantity, exact) in exact.iter().enumerate() {
            for (t, exact) in times.into_iter().zip(exact) {
                let off = (at.value(quantity, t) - exact).abs() / table.largest(quantity);
                assert!(off < 1e-11, "{X:?} {t} {quantity}: {off:e}");
            }
        }
    }
}

/// The solver's law at the end of a block's motion in so many steps: `G` and the plastic strain.
fn by_return_maps(law: &J2, map: ReturnMap, X: [f64; 2], steps: usize) -> [f64; 7] {
    let J2 { lambda, mu, hardening: Hardening { yield_stress, modulus, exponent }, .. } = *law;
    let law_of_solver = Plastic { lambda, mu, yield_stress, modulus, exponent, map };
    let motion = block(X, law.stretch_to_yield());
    let F = |t: f64| {
        let at = motion(t);
        [0, 1].map(|i| [0, 1].map(|j| [at.F[i][j].value; BLOCK]))
    };
    let mut q: Vec<[f64; BLOCK]> = LawWithMemory::<f64, 2>::variables(&law_of_solver)
        .iter()
        .map(|q| [q.at_rest; BLOCK])
        .collect();
    for step in 0..steps {
        let [start, end] = [step, step + 1].map(|k| F(k as f64 / steps as f64));
        let increment = Increment { start: &start, end: &end, time: 1.0 / steps as f64 };
        law_of_solver.evolve(&increment, &mut q);
    }
    std::array::from_fn(|k| q[k][0])
}

/// Return maps share no formula with the rate equations.
#[test]
fn return_maps_of_the_solver_have_their_orders() {
    for law in [law(500.0, 1.0), law(80.0, 1.0 / 3.0)] {
        let X = [0.37, 0.61];
        let motion = block(X, law.stretch_to_yield());
        let exact = Trajectory::new(&law, &motion, &start(&law), &[1.0], 1e-14).unwrap();
        let mut exact: Vec<f64> = exact.states[0].iter().map(|z| z.value).collect();
        exact[6] = law.plastic_strain(&exact);
        assert!(exact[6] > 0.05, "{exact:?}");
        for (map, order) in [(ReturnMap::Exponential, 1.0), (ReturnMap::Midpoint, 2.0)] {
            let error = |steps: usize| {
                let found = by_return_maps(&law, map, X, steps);
                found.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
            };
            let errors = [200, 400, 800].map(error);
            for pair in errors.windows(2) {
                let found = (pair[0] / pair[1]).log2();
                assert!((found - order).abs() < 0.15, "{law:?} {map:?}: {errors:?} {found}");
            }
        }
    }
}
