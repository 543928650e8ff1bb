//! Histories against closed forms, differences and the conditions that they have to keep.

use crate::bodies::{BULK, MU, YIELD, along, block, creep, elements, flow, number, times};
use mmsmith_history::{
    AnyLaw, AtPoint, Branch, Dual, ElasticPart, Flow, HistoryError, Kinematics, LawWithHistory,
    Maxwell, Motion, Number, Table, Tensor, Trajectory, divergence, identity,
};
use mmsmith_vocabulary::{Smoothness, Volumetric};
use nalgebra::{Matrix3, SymmetricEigen};

/// Uniaxial strain from the yield point on: `alpha = (2 mu (e0 + ln F) - sy)/(3 mu + H)`, `2 mu e0 = sy`, with the lateral part of the
/// prestretch.
#[test]
fn a_bar_has_the_plastic_strain_of_its_closed_form() {
    let (law, constants) = flow(1, 500.0, 1.0, true);
    let stretch = |t: f64| 1.0 + 0.3 * t + 0.1 * (2.0 * t).sin();
    let motion = along(&constants, |t| {
        let rate = 0.3 + 0.2 * (2.0 * t).cos();
        let mut F = Matrix3::identity();
        F[(0, 0)] = stretch(t);
        let mut dF = Matrix3::zeros();
        dF[(0, 0)] = rate;
        (F, dF)
    });
    let found = Trajectory::new(&law, &motion, &times(10), 1e-13).unwrap();
    assert!(found.changes.is_empty() && found.least_margin > 0.7, "{found:?}");
    let mut worst = 0.0_f64;
    for (t, z) in times(10).into_iter().zip(&found.states) {
        let alpha = 2.0 * MU * stretch(t).ln() / (3.0 * MU + 500.0);
        let own = law.observables(&motion.1, z);
        worst = worst.max((own[6].value - alpha).abs());
    }
    assert!(worst < 1e-13, "{worst:e}");
}

/// Perfect plasticity under a constant rate of strain that is not along the stress: the angle `psi` between them follows
/// `tan(psi/2) = tan(psi_0/2) exp(-2 mu |d| t / R)` (R. D. Krieg and D. B. Krieg, J. Press. Vess. Technol. 99 (1977) 510-515), here in the
/// logarithmic strains of fixed axes. The stress at the start is along the stretch onto the yield surface.
#[test]
fn constant_rates_have_the_angle_of_krieg_and_krieg() {
    let R = (2.0_f64 / 3.0).sqrt() * YIELD;
    // Two directions of unit length in the plane of deviators; the start is along the first.
    let first = nalgebra::vector![1.0, -1.0, 0.0] / 2.0_f64.sqrt();
    let second = nalgebra::vector![1.0, 1.0, -2.0] / 6.0_f64.sqrt();
    let (speed, first_angle) = (0.02, 1.2_f64);
    let direction = first * first_angle.cos() + second * first_angle.sin();
    let across = first * first_angle.sin() - second * first_angle.cos();
    for dimension in [2, 3] {
        let (law, constants) = flow(dimension, 0.0, 1.0, true);
        let motion = along(&constants, |t| {
            let F = Matrix3::from_diagonal(&(direction * (speed * t)).map(f64::exp));
            (F, F * Matrix3::from_diagonal(&(direction * speed)))
        });
        let times: Vec<f64> = times(8).iter().map(|t| 0.4 * t).collect();
        let found = Trajectory::new(&law, &motion, &times, 1e-15).unwrap();
        assert!(found.changes.is_empty());
        let mut worst = 0.0_f64;
        for (&t, z) in times.iter().zip(&found.states) {
            let at = motion.at(t);
            let (_, P) = divergence(&law, &at, &motion.1, z);
            let F = Matrix3::from_fn(|i, j| at.F[i][j].value);
            let tau = Matrix3::from_fn(|i, j| P[i][j]) * F.transpose();
            let s = (tau - Matrix3::identity() * (tau.trace() / 3.0)).diagonal();
            let psi = s.dot(&across).atan2(s.dot(&direction));
            let half = (0.5 * first_angle).tan() * (-2.0 * MU * speed * t / R).exp();
            worst = worst.max((psi - 2.0 * half.atan()).abs()).max((s.norm() / R - 1.0).abs());
        }
        println!("Krieg and Krieg in {dimension} dimensions: {worst:e}");
        assert!(worst < 1e-13, "{worst:e}");
    }
}

#[test]
fn flow_keeps_the_yield_condition_and_the_volume() {
    for dimension in [2, 3] {
        for (modulus, exponent) in [(500.0, 1.0), (0.0, 1.0), (80.0, 1.0 / 3.0)] {
            let (law, constants) = flow(dimension, modulus, exponent, true);
            let motion = block([0.37, 0.61], &constants);
            let found = Trajectory::new(&law, &motion, &times(20), 1e-13).unwrap();
            assert!(found.changes.is_empty(), "{:?}", found.changes);
            let residuals = found.residuals;
            assert!(residuals.yield_condition > 0.0, "{residuals:?}");
            assert!(residuals.yield_condition < 1e-12 && residuals.volume < 1e-12, "{residuals:?}");
            // By another way than the law's own.
            let z: Vec<f64> = found.states[19].iter().map(|z| z.value).collect();
            let q = law.observables(&constants, &z);
            let G = Matrix3::new(q[0], q[3], q[4], q[3], q[1], q[5], q[4], q[5], q[2]);
            let F = Matrix3::from_fn(|i, j| motion.at(1.0).F[i][j].value);
            let logs = SymmetricEigen::new(F * G * F.transpose()).eigenvalues.map(f64::ln);
            let s = logs.add_scalar(-logs.mean()) * MU;
            let allowed = YIELD + modulus * q[6].powf(exponent);
            assert!((s.norm() - (2.0_f64 / 3.0).sqrt() * allowed).abs() < 1e-12 * YIELD);
            assert!((G.determinant() - 1.0).abs() < 1e-12);
            // The margin is n : d/|d|.
            let SymmetricEigen { eigenvalues, eigenvectors: Q } =
                SymmetricEigen::new(F * G * F.transpose());
            let logs = eigenvalues.map(f64::ln);
            let s = Q * Matrix3::from_diagonal(&logs.add_scalar(-logs.mean())) * Q.transpose();
            let rate = Matrix3::from_fn(|i, j| motion.at(1.0).rate[i][j].value);
            let l = rate * F.try_inverse().unwrap();
            let d = (l + l.transpose()) * 0.5;
            let expected = s.dot(&d) / (s.norm() * d.norm());
            let of = |A: Matrix3<f64>| -> Tensor<f64> {
                std::array::from_fn(|i| std::array::from_fn(|j| A[(i, j)]))
            };
            let at = Kinematics { F: of(F), rate: of(rate) };
            let margin = law.margin(&at, &constants, &z, Branch::Flowing);
            assert!((margin - expected).abs() < 1e-11, "{margin} {expected}");
        }
    }
}

/// In a plane motion the law of the plane and that of space agree.
#[test]
fn the_plane_is_a_part_of_space() {
    let of = |dimension| {
        let (law, constants) = flow(dimension, 80.0, 1.0 / 3.0, true);
        let motion = block([0.37, 0.61], &constants);
        let found = Trajectory::new(&law, &motion, &[0.3, 1.0], 1e-13).unwrap();
        let (b, P) = divergence(&law, &motion.at(1.0), &motion.1, &found.states[1]);
        (law.observables(&motion.1, &found.states[1]), b, P)
    };
    let (plane, space) = (of(2), of(3));
    for (plane, space) in plane.0.iter().zip(&space.0) {
        assert!((plane.value - space.value).abs() < 1e-14, "{plane:?} {space:?}");
    }
    for k in 0..2 {
        assert!((plane.1[k] - space.1[k]).abs() < 1e-11 * space.1[k].abs(), "{plane:?} {space:?}");
    }
}

/// Slopes along positions against differences of neighbours: in flow from the start, after an onset, and with constants that depend on
/// the position.
#[test]
fn slopes_of_variables_are_those_of_neighbours() {
    let h = 1e-5;
    for (modulus, exponent, is_on_yield, graded, overstress) in [
        (500.0, 1.0, true, 0.0, None),
        (500.0, 1.0, true, 0.2, None),
        (80.0, 1.0 / 3.0, false, 0.0, None),
        (500.0, 1.0, false, 0.0, None),
        (500.0, 0.5, false, 0.3, None),
        (500.0, 1.0, false, 0.1, Some([100.0, 1.0, 0.5])),
        (500.0, 1.0, false, 0.1, Some([100.0, 3.0, 0.5])),
    ] {
        let law = Flow { dimension: 2, has_overstress: overstress.is_some(), is_on_yield };
        let at = |X: [f64; 2]| {
            let (x, y) = (number(X[0], [1.0, 0.0]), number(X[1], [0.0, 1.0]));
            let plain = [BULK - 2.0 * MU / 3.0, MU, YIELD, modulus, exponent];
            let rest = overstress.into_iter().flatten();
            let constants = plain.into_iter().chain(rest).enumerate().map(|(k, value)| {
                // The exponent of hardening as well.
                let change = if k % 2 == 0 { x * y } else { x - y };
                Dual::constant(value) * (Dual::constant(1.0) + change.times(graded))
            });
            let constants: Vec<_> = constants.collect();
            let motion = (block(X, &[]).0, constants);
            Trajectory::new(&law, &motion, &times(4), 1e-13).unwrap()
        };
        let own = at([0.37, 0.61]);
        assert_eq!(own.changes.len(), usize::from(!is_on_yield), "{:?}", own.changes);
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
                    assert!(
                        off < 2e-8,
                        "{modulus} {exponent} {graded} {overstress:?} {axis} {k} {n}: {} {difference}",
                        z.slopes[axis]
                    );
                }
            }
        }
    }
}

/// The divergence by slopes against differences of stresses.
#[test]
fn the_divergence_of_the_stress_is_that_of_neighbours() {
    let laws: [(AnyLaw, Vec<f64>); 6] = [
        {
            let (law, c) = flow(2, 500.0, 1.0, true);
            (AnyLaw::Flow(law), c)
        },
        {
            let (law, c) = creep(2, 3.0);
            (AnyLaw::Flow(law), c)
        },
        elements(ElasticPart::LinearElastic),
        elements(ElasticPart::Yeoh(Volumetric::Logarithmic)),
        elements(ElasticPart::Gent(Volumetric::Quadratic)),
        elements(ElasticPart::ArrudaBoyce(Volumetric::Mixed)),
    ];
    for (law, constants) in laws {
        let P = |X: [f64; 2]| {
            let motion = block(X, &constants);
            let found = Trajectory::new(&law, &motion, &[0.8], 1e-13).unwrap();
            divergence(&law, &motion.at(0.8), &motion.1, &found.states[0])
        };
        let (X, h) = ([0.37, 0.61], 1e-3);
        let (found, _) = P(X);
        for i in 0..2 {
            let difference: f64 = (0..2)
                .map(|axis| {
                    let at = |by: f64| {
                        P(std::array::from_fn(|a| X[a] + if a == axis { by } else { 0.0 })).1[i]
                            [axis]
                    };
                    (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h)
                })
                .sum();
            assert!(
                (found[i] - difference).abs() < 1e-7 * difference.abs(),
                "{law:?} {} {difference}",
                found[i]
            );
        }
    }
}

/// A shear that swings.
fn swing(t: f64) -> (Matrix3<f64>, Matrix3<f64>) {
    let mut F = Matrix3::identity();
    F[(0, 1)] = 0.02 * (7.0 * t).sin();
    let mut dF = Matrix3::zeros();
    dF[(0, 1)] = 0.14 * (7.0 * t).cos();
    (F, dF)
}

#[test]
fn unloading_is_elastic_and_flow_goes_on_behind_it() {
    for count in [1, 3, 100] {
        let (law, constants) = flow(2, 500.0, 1.0, false);
        let motion = along(&constants, swing);
        let found = Trajectory::new(&law, &motion, &times(count), 1e-12).unwrap();
        let branches: Vec<Branch> = found.changes.iter().map(|change| change.branch).collect();
        use Branch::{Elastic, Flowing};
        assert_eq!(branches, [Flowing, Elastic, Flowing, Elastic, Flowing], "{:?}", found.changes);
        // The shear turns where its rate is zero, up to the rotation that comes with it.
        let turn = found.changes[1].time - std::f64::consts::FRAC_PI_2 / 7.0;
        assert!(turn.abs() < 1e-9, "{turn:e}");
        assert_eq!(found.smoothness(), Smoothness::Jump);
        if count == 100 {
            let alphas: Vec<f64> = found.states.iter().map(|z| z[4].value).collect();
            assert!(alphas.is_sorted() && alphas[99] > 2.0 * alphas[24]);
        }
    }
}

/// A shear that swings, by another size and phase at each position.
fn swings(X: [f64; 2]) -> impl Fn(f64) -> Kinematics<Dual<f64, 2>> + Sync {
    move |t: f64| {
        let (x, y) = (number(X[0], [1.0, 0.0]), number(X[1], [0.0, 1.0]));
        let size = (x.times(0.3) + Dual::constant(1.0)).times(0.02);
        let (phase, phase_of_y) = (7.0 * t + 0.4 * y.value, y.slopes.map(|slope| 0.4 * slope));
        let sine = number(phase.sin(), phase_of_y.map(|s| s * phase.cos()));
        let cosine = number(phase.cos(), phase_of_y.map(|s| -s * phase.sin()));
        let start = number((0.4 * y.value).sin(), phase_of_y.map(|s| s * (0.4 * y.value).cos()));
        let zero = Dual::constant(0.0);
        let one = Dual::constant(1.0);
        let F = [[one, size * (sine - start), zero], [zero, one, zero], [zero, zero, one]];
        let mut rate = [[zero; 3]; 3];
        rate[0][1] = size * cosine.times(7.0);
        Kinematics { F, rate }
    }
}

/// Slopes go on through the end of flow and its next beginning, and series of one particle have all digits between these.
#[test]
fn slopes_and_series_hold_through_all_changes() {
    for overstress in [None, Some([40.0, 2.0, 0.3])] {
        let (_, mut constants) = flow(2, 500.0, 1.0, false);
        constants.extend(overstress.into_iter().flatten());
        let law = Flow { dimension: 2, has_overstress: overstress.is_some(), is_on_yield: false };
        let steady: Vec<Dual<f64, 2>> = constants.iter().map(|&c| Dual::constant(c)).collect();
        let at = |X: [f64; 2], times: &[f64]| {
            Trajectory::new(&law, &(swings(X), steady.clone()), times, 1e-13).unwrap()
        };
        let (X, h) = ([0.37, 0.61], 1e-5);
        let own = at(X, &times(12));
        assert!(own.changes.len() >= 3, "{:?}", own.changes);
        for axis in 0..2 {
            let shifted = |by: f64| {
                at(std::array::from_fn(|a| X[a] + if a == axis { by } else { 0.0 }), &times(12))
            };
            let (above, below) = (shifted(h), shifted(-h));
            for (k, z) in own.states.iter().enumerate() {
                for (n, z) in z.iter().enumerate() {
                    let difference =
                        (above.states[k][n].value - below.states[k][n].value) / (2.0 * h);
                    let off = (z.slopes[axis] - difference).abs();
                    assert!(off < 1e-8, "{axis} {k} {n}: {} {difference}", z.slopes[axis]);
                }
            }
        }
        let breaks: Vec<f64> = own.changes.iter().map(|change| change.time).collect();
        let of = |times: &[f64]| {
            let motion = (swings(X), steady.clone());
            let found = at(X, times);
            let of = |(&t, z): (&f64, &Vec<Dual<f64, 2>>)| {
                let ([x, y], _) = divergence(&law, &motion.at(t), &steady, z);
                [x, y, z[4].value]
            };
            let rows: Vec<[f64; 3]> = times.iter().zip(&found.states).map(of).collect();
            let of = |quantity: usize| rows.iter().map(|row| row[quantity]).collect();
            Ok::<_, HistoryError>((0..3).map(of).collect())
        };
        let (series, told) = AtPoint::fine(1.0, &breaks, 1e-12, &[0, 0], of).unwrap();
        assert!(told <= 1e-12);
        let times: Vec<f64> = (1..40).map(|k| f64::from(k) / 40.0).collect();
        let exact = of(&times).unwrap();
        let most = exact[..2].iter().flatten().fold(0.0_f64, |most, value| most.max(value.abs()));
        for (quantity, scale) in [(0, most), (1, most), (2, 0.1)] {
            for (&t, exact) in times.iter().zip(&exact[quantity]) {
                let off = (series.value(quantity, t) - exact).abs() / scale;
                assert!(off < 1e-11, "{quantity} {t}: {off:e}");
            }
        }
    }
}

/// The first flow of soft hardening is smooth, the second is not.
#[test]
fn onsets_tell_how_smooth_the_body_force_is() {
    let first = |exponent: f64| {
        let (law, constants) = flow(2, 80.0, exponent, false);
        let found = Trajectory::new(&law, &along(&constants, swing), &[0.2], 1e-12).unwrap();
        assert_eq!(found.changes.len(), 1);
        found.smoothness()
    };
    assert_eq!(first(1.0), Smoothness::Jump);
    assert_eq!(first(0.5), Smoothness::Kink);
    assert_eq!(first(1.0 / 3.0), Smoothness::Smooth);
    assert_eq!(first(0.25), Smoothness::Smooth);
    let (law, constants) = flow(2, 80.0, 0.25, false);
    let found = Trajectory::new(&law, &along(&constants, swing), &[1.0], 1e-12).unwrap();
    let all: Vec<Smoothness> = found.changes.iter().map(|change| change.smoothness).collect();
    use Smoothness::{Jump, Kink, Smooth};
    assert_eq!(all, [Smooth, Kink, Jump, Kink, Jump]);
}

/// A stress that passes the yield stress for a short while between two times is found.
#[test]
fn short_flows_are_found() {
    let (law, constants) = flow(2, 500.0, 1.0, false);
    let least = YIELD / (3.0_f64.sqrt() * MU);
    for beyond in [1e-2, 1e-4] {
        let motion = along(&constants, |t| {
            let mut F = Matrix3::identity();
            F[(0, 1)] = least * (1.0 + beyond) * (2.7 * t).sin();
            let mut dF = Matrix3::zeros();
            dF[(0, 1)] = least * (1.0 + beyond) * 2.7 * (2.7 * t).cos();
            (F, dF)
        });
        let found = Trajectory::new(&law, &motion, &[1.0], 1e-12).unwrap();
        assert_eq!(found.changes.len(), 2, "{beyond}: {:?}", found.changes);
    }
}

/// A body on the yield surface that begins to move from rest flows from the start, without an onset.
#[test]
fn a_start_from_rest_on_the_yield_surface_flows() {
    let (law, constants) = flow(2, 500.0, 1.0, true);
    let motion = along(&constants, |t| {
        let mut F = Matrix3::identity();
        F[(0, 0)] = 1.0 + 0.1 * t * t;
        F[(1, 1)] = 1.0 - 0.05 * t * t;
        let mut dF = Matrix3::zeros();
        dF[(0, 0)] = 0.2 * t;
        dF[(1, 1)] = -0.1 * t;
        (F, dF)
    });
    let found = Trajectory::new(&law, &motion, &times(10), 1e-13).unwrap();
    assert!(found.changes.is_empty(), "{:?}", found.changes);
    assert!(found.states[0][4].value > 1e-5 && found.residuals.yield_condition < 1e-12);
    let beyond = along(&constants, |_| {
        (
            Matrix3::identity() * 1.0 + Matrix3::new(0.1, 0.0, 0.0, 0.0, -0.1, 0.0, 0.0, 0.0, 0.0),
            Matrix3::zeros(),
        )
    });
    let error = Trajectory::new(&law, &beyond, &[1.0], 1e-12).unwrap_err();
    assert!(matches!(error, HistoryError::BeyondYield { .. }), "{error}");
}

/// Shear flow by pure stretch along fixed axes at a constant rate: for linear rates of flow the stress goes to its limit by an exponential
/// function.
#[test]
fn creep_and_overstress_have_their_closed_forms() {
    let speed = 0.05;
    let direction = nalgebra::vector![1.0, -1.0, 0.0] / 2.0_f64.sqrt();
    let stretched = move |t: f64| {
        let F = Matrix3::from_diagonal(&(direction * (speed * t)).map(f64::exp));
        (F, F * Matrix3::from_diagonal(&(direction * speed)))
    };
    let size = |law: &Flow, constants: &[f64], t: f64, z: &[Dual<f64, 1>]| {
        let q: Vec<f64> =
            law.observables(constants, &z.iter().map(|z| z.value).collect::<Vec<_>>());
        let F = stretched(t).0;
        let G = Matrix3::new(q[0], q[3], q[4], q[3], q[1], q[5], q[4], q[5], q[2]);
        let logs = (F * G * F.transpose()).diagonal().map(f64::ln);
        (logs.add_scalar(-logs.mean()) * MU).norm()
    };
    let mut worst = 0.0_f64;
    // s' = 2 mu (d - s/(drag time)).
    let (law, constants) = creep(3, 1.0);
    let rate = 2.0 * MU / (constants[5] * constants[7]);
    let motion = along(&constants, stretched);
    let found = Trajectory::new(&law, &motion, &times(10), 1e-14).unwrap();
    assert!(found.changes.is_empty());
    for (t, z) in times(10).into_iter().zip(&found.states) {
        let expected = 2.0 * MU * speed / rate * -(-rate * t).exp_m1();
        worst = worst.max((size(&law, &constants, t, z) / expected - 1.0).abs());
        // alpha' = sqrt(2/3) |s|/(drag time).
        let flown = speed * t - expected / (2.0 * MU);
        let alpha = law.observables(&motion.1, z)[6].value;
        worst = worst.max((alpha / ((2.0_f64 / 3.0).sqrt() * flown) - 1.0).abs());
    }
    println!("linear creep: {worst:e}");
    assert!(worst < 1e-12, "{worst:e}");
    // With the exponent 2 by the hyperbolic tangent: s' = 2 mu d (1 - (s/limit)^2).
    let (law, constants) = creep(3, 2.0);
    let limit = constants[5] * (speed * constants[7]).sqrt();
    let motion = along(&constants, stretched);
    let found = Trajectory::new(&law, &motion, &times(10), 1e-14).unwrap();
    let mut worst = 0.0_f64;
    for (t, z) in times(10).into_iter().zip(&found.states) {
        let expected = limit * (2.0 * MU * speed * t / limit).tanh();
        worst = worst.max((size(&law, &constants, t, z) / expected - 1.0).abs());
    }
    println!("quadratic creep: {worst:e}");
    assert!(worst < 1e-12, "{worst:e}");
    // Perzyna without hardening: the same beyond the yield stress, from the time when it is reached.
    let constants = [BULK - 2.0 * MU / 3.0, MU, YIELD, 0.0, 1.0, 80.0, 1.0, 1.1];
    let law = Flow { dimension: 2, has_overstress: true, is_on_yield: false };
    let motion = along(&constants, stretched);
    let found = Trajectory::new(&law, &motion, &times(10), 1e-14).unwrap();
    let allowed = (2.0_f64 / 3.0).sqrt() * YIELD;
    let onset = allowed / (2.0 * MU * speed);
    assert!((found.changes[0].time / onset - 1.0).abs() < 1e-13, "{:?}", found.changes);
    assert_eq!(found.changes.len(), 1);
    let mut worst = 0.0_f64;
    let rate = 2.0 * MU / (80.0 * 1.1);
    for (t, z) in times(10).into_iter().zip(&found.states) {
        let since = (t - onset).max(0.0);
        let expected =
            allowed.min(2.0 * MU * speed * t) + 2.0 * MU * speed / rate * -(-rate * since).exp_m1();
        worst = worst.max((size(&law, &constants, t, z) / expected - 1.0).abs());
    }
    println!("Perzyna: {worst:e}");
    assert!(worst < 1e-12, "{worst:e}");
}

/// After the deformation stops, stresses of elements decay by their times.
#[test]
fn stresses_of_maxwell_elements_relax() {
    // A cubic ramp up to the time 1/2.
    let ramp = |t: f64| {
        let (r, rate) = if t < 0.5 {
            (1.0 - (1.0 - 2.0 * t).powi(3), 6.0 * (1.0 - 2.0 * t).powi(2))
        } else {
            (1.0, 0.0)
        };
        let along = Matrix3::new(0.2, 0.1, 0.0, -0.05, 0.1, 0.0, 0.0, 0.0, 0.0);
        (Matrix3::identity() + along * r, along * rate)
    };
    let (law, constants) = elements(ElasticPart::Yeoh(Volumetric::Logarithmic));
    let motion = along(&constants, ramp);
    let found = Trajectory::new(&law, &motion, &[0.5, 0.8, 1.0], 1e-13).unwrap();
    for (element, time) in [0.2_f64, 0.7].into_iter().enumerate() {
        for entry in 4 * element..4 * element + 4 {
            let [first, second, third] = [0, 1, 2].map(|k| found.states[k][entry].value);
            let size = first.abs().max(1.0);
            assert!((second - first * (-0.3 / time).exp()).abs() < 1e-11 * size);
            assert!((third - first * (-0.5 / time).exp()).abs() < 1e-11 * size);
        }
    }
    // Fast deformations have the instantaneous modulus.
    let elastic = ElasticPart::Yeoh(Volumetric::Logarithmic);
    let fast = Maxwell { dimension: 2, elastic, elements: 1 };
    let slow = [constants[..4].to_vec(), vec![0.5, 1e9]].concat();
    let motion = along(&slow, ramp);
    let z = Trajectory::new(&fast, &motion, &[0.5], 1e-13).unwrap();
    let (_, with) = divergence(&fast, &motion.at(0.5), &motion.1, &z.states[0]);
    let without = Maxwell { elements: 0, ..fast };
    let (_, without) = divergence(&without, &motion.at(0.5), &motion.1[..4], &[]);
    for k in 0..9 {
        assert!((with[k / 3][k % 3] - without[k / 3][k % 3]).abs() < 1e-6);
    }
}

/// Linear elements under a strain `sin(w t)`: `Q' + Q/tau = g s0 w cos(w t)` has the solution
/// `Q = g s0 w tau (cos(w t) + w tau sin(w t) - exp(-t/tau))/(1 + (w tau)^2)`.
#[test]
fn linear_elements_answer_harmonic_strains_by_their_closed_form() {
    let (law, constants) = elements(ElasticPart::LinearElastic);
    let (w, amplitude) = (7.0_f64, 0.03);
    let motion = along(&constants, |t| {
        let mut F = Matrix3::identity();
        F[(0, 1)] = amplitude * (w * t).sin();
        let mut dF = Matrix3::zeros();
        dF[(0, 1)] = amplitude * w * (w * t).cos();
        (F, dF)
    });
    let found = Trajectory::new(&law, &motion, &times(20), 1e-15).unwrap();
    let mut worst = 0.0_f64;
    for (t, z) in times(20).into_iter().zip(&found.states) {
        let mut shear = MU * amplitude * (w * t).sin();
        for (k, pair) in constants[2..].chunks_exact(2).enumerate() {
            let (share, tau) = (pair[0], pair[1]);
            let size = share * MU * amplitude * w * tau / (1.0 + (w * tau).powi(2));
            let sum = (w * t).cos() + w * tau * (w * t).sin() - (-t / tau).exp();
            worst = worst.max((z[4 * k + 3].value - size * sum).abs() / (MU * amplitude));
            shear += size * sum - share * MU * amplitude * (w * t).sin();
        }
        let (_, P) = divergence(&law, &motion.at(t), &motion.1, z);
        worst = worst.max((P[0][1] - shear).abs() / (MU * amplitude));
    }
    println!("harmonic strain: {worst:e}");
    assert!(worst < 1e-13, "{worst:e}");
}

/// The divergence of the stress and the plastic strain of a block that flows from the start, at some times.
fn fields(X: [f64; 2], times: &[f64]) -> Result<Vec<Vec<f64>>, HistoryError> {
    let (law, constants) = flow(2, 500.0, 1.0, true);
    let motion = block(X, &constants);
    let found = Trajectory::new(&law, &motion, times, 1e-13)?;
    let of = |(&t, z): (&f64, &Vec<Dual<f64, 2>>)| {
        let ([x, y], _) = divergence(&law, &motion.at(t), &motion.1, z);
        [x, y, z[4].value]
    };
    let rows: Vec<[f64; 3]> = times.iter().zip(&found.states).map(of).collect();
    Ok((0..3).map(|quantity| rows.iter().map(|row| row[quantity]).collect()).collect())
}

#[test]
fn a_table_has_the_fields_of_trajectories_at_all_positions_and_times() {
    let (table, told) = Table::fine([[0.0, 1.0]; 2], 1.0, 1e-12, fields).unwrap();
    println!("told {told:e}, tails {:?}, {:?}", table.tails(), table.grid());
    assert!(told < 1e-11, "{told:e}");
    for k in 0..12 {
        let X = [(0.17 + 0.618 * f64::from(k)).fract(), (0.53 + 0.755 * f64::from(k)).fract()];
        let at = table.at(&X);
        let times = [0.1, 0.45, 0.77, 1.0];
        let exact = fields(X, &times).unwrap();
        for (quantity, exact) in exact.iter().enumerate() {
            for (t, exact) in times.into_iter().zip(exact) {
                let off = (at.value(quantity, t) - exact).abs() / table.largest(quantity);
                assert!(off < 1e-11, "{X:?} {t} {quantity}: {off:e}");
            }
        }
    }
}

/// A second form of the equations, in `F^p` itself and with principal values: `F^p' = gamma' F_e^-1 n F_e F^p` with `F_e = F F^p^-1`, by
/// the classical method of order four with halved steps, extrapolated.
#[test]
fn rates_of_the_plastic_part_of_the_deformation_give_the_same() {
    let (law, constants) = flow(3, 500.0, 1.0, true);
    let motion = block([0.37, 0.61], &constants);
    let found = Trajectory::new(&law, &motion, &[1.0], 1e-13).unwrap();
    let exact = law.observables(&motion.1, &found.states[0]);
    let of = |t: f64| {
        let at = motion.at(t);
        let of = |A: &Tensor<Dual<f64, 2>>| Matrix3::from_fn(|i, j| A[i][j].value);
        (of(&at.F), of(&at.rate))
    };
    let rate = |t: f64, Fp: &Matrix3<f64>| -> (Matrix3<f64>, f64) {
        let (F, dF) = of(t);
        let Fe = F * Fp.try_inverse().unwrap();
        let SymmetricEigen { eigenvalues, eigenvectors: Q } =
            SymmetricEigen::new(Fe * Fe.transpose());
        let e = eigenvalues.map(|value| 0.5 * value.ln());
        let s = e.add_scalar(-e.mean());
        let n = Q * Matrix3::from_diagonal(&(s / s.norm())) * Q.transpose();
        let d = dF * F.try_inverse().unwrap();
        let gamma =
            (n.component_mul(&((d + d.transpose()) * 0.5))).sum() / (1.0 + 500.0 / (3.0 * MU));
        (Fe.try_inverse().unwrap() * n * Fe * Fp * gamma, (2.0_f64 / 3.0).sqrt() * gamma)
    };
    let solve = |steps: usize| {
        let z: Vec<f64> = law.observables(&constants, &law.initial(&constants, &identity()));
        let mut Fp =
            Matrix3::from_diagonal(&nalgebra::vector![z[0], z[1], z[2]].map(|g| g.powf(-0.5)));
        let (mut alpha, h) = (0.0, 1.0 / steps as f64);
        for step in 0..steps {
            let t = step as f64 * h;
            let a = rate(t, &Fp);
            let b = rate(t + 0.5 * h, &(Fp + a.0 * (0.5 * h)));
            let c = rate(t + 0.5 * h, &(Fp + b.0 * (0.5 * h)));
            let d = rate(t + h, &(Fp + c.0 * h));
            Fp += (a.0 + (b.0 + c.0) * 2.0 + d.0) * (h / 6.0);
            alpha += (a.1 + 2.0 * (b.1 + c.1) + d.1) * (h / 6.0);
        }
        let G = (Fp.transpose() * Fp).try_inverse().unwrap();
        [G[(0, 0)], G[(1, 1)], G[(2, 2)], G[(0, 1)], G[(0, 2)], G[(1, 2)], alpha]
    };
    let (coarse, fine) = (solve(1000), solve(2000));
    let mut worst = 0.0_f64;
    for (k, exact) in exact.iter().enumerate() {
        let own = fine[k] + (fine[k] - coarse[k]) / 15.0;
        worst = worst.max((own - exact.value).abs());
    }
    println!("by F^p: {worst:e}");
    assert!(worst < 1e-11, "{worst:e}");
}

/// Where slopes are nothing but rounding no step is short enough for them, and none has to be.
#[test]
fn slopes_that_are_rounding_are_no_hindrance() {
    let (law, constants) = flow(2, 500.0, 1.0, true);
    let clean = block([0.37, 0.61], &constants);
    let noisy = |t: f64| {
        let mut at = clean.at(t);
        for (k, entry) in at.F.iter_mut().flatten().enumerate() {
            let noise = ((1e9 + k as f64) * (1.0 + t)).sin();
            entry.slopes = [1e-17 * noise, -1e-17 * noise];
        }
        at.rate.iter_mut().flatten().for_each(|entry| entry.slopes = [0.0; 2]);
        at
    };
    let found = Trajectory::new(&law, &(noisy, clean.1.clone()), &times(5), 1e-13).unwrap();
    let smooth = Trajectory::new(&law, &clean, &times(5), 1e-13).unwrap();
    assert!(found.evaluations < 3 * smooth.evaluations, "{}", found.evaluations);
    for (found, smooth) in found.states.iter().zip(&smooth.states) {
        for (found, smooth) in found.iter().zip(smooth) {
            assert!((found.value - smooth.value).abs() < 1e-14);
            assert!(found.slopes.iter().all(|slope| slope.abs() < 1e-12));
        }
    }
}

/// All exponents of hardening and of rates can be followed through an onset.
#[test]
fn onsets_of_all_exponents_are_passed() {
    for exponent in [0.2, 0.35, 0.6, 0.8, 0.95] {
        let (law, constants) = flow(2, 80.0, exponent, false);
        let motion = block([0.37, 0.61], &constants);
        let found = Trajectory::new(&law, &motion, &times(20), 1e-12).unwrap();
        println!("exponent {exponent}: {} evaluations", found.evaluations);
        assert_eq!(found.changes.len(), 1);
        assert!(found.residuals.yield_condition < 1e-11, "{exponent}: {:?}", found.residuals);
    }
    for exponent in [1.0, 1.5, 4.0, 10.0] {
        let law = Flow { dimension: 2, has_overstress: true, is_on_yield: false };
        let (_, mut constants) = flow(2, 80.0, 0.5, false);
        constants.extend([100.0, exponent, 0.2]);
        let motion = block([0.37, 0.61], &constants);
        let found = Trajectory::new(&law, &motion, &times(20), 1e-12).unwrap();
        println!("rate exponent {exponent}: {} evaluations", found.evaluations);
        assert_eq!(found.changes.len(), 1);
    }
    // Faster than any step.
    let law = Flow { dimension: 2, has_overstress: true, is_on_yield: false };
    let (_, mut constants) = flow(2, 80.0, 1.0, false);
    constants.extend([100.0, 1.0, 1e-9]);
    let error = Trajectory::new(&law, &block([0.37, 0.61], &constants), &[1.0], 1e-12).unwrap_err();
    assert!(matches!(error, HistoryError::Stiff { .. }), "{error}");
}

#[test]
fn times_have_to_ascend() {
    let (law, constants) = flow(2, 500.0, 1.0, true);
    let motion = block([0.3, 0.4], &constants);
    let error = Trajectory::new(&law, &motion, &[0.5, 0.4], 1e-12).unwrap_err();
    assert_eq!(error, HistoryError::Order { before: 0.5, after: 0.4 });
    let found = Trajectory::new(&law, &motion, &[0.0, 0.0, 0.5, 0.5], 1e-12).unwrap();
    assert_eq!(found.states.len(), 4);
    assert_eq!(found.states[2], found.states[3]);
    assert_eq!(found.states[0], law.initial(&motion.1, &identity()));
    let _: Kinematics<Dual<f64, 2>> = motion.at(0.0);
}
