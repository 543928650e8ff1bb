//! Laws that specifications state, against laws of the library and against differences.

use crate::bodies::{BULK, MU, along, block, elements, flow, number, times};
use mmsmith_history::{
    AnyLaw, Dual, ElasticPart, Kinematics, LawWithHistory, Motion, Number, StatedHistory,
    StatedHistoryError, Tensor, Trajectory, UnsupportedLaw, divergence,
};
use mmsmith_vocabulary::{Components, Internal, Law, Response, Stated};
use nalgebra::Matrix3;

fn internal(name: &str, rate: &str, initial: &str) -> Internal {
    Internal { name: name.into(), rate: rate.into(), initial: initial.into() }
}

fn stress(rows: &[[&str; 2]; 2]) -> Response {
    Response::Stress(rows.iter().map(|row| row.map(String::from).to_vec()).collect())
}

fn stated(response: Response, constants: &[&str], given: &[[&str; 2]]) -> Stated<()> {
    Stated {
        response,
        components: Components::Cartesian,
        constants: constants.iter().map(|&name| (name.to_owned(), ())).collect(),
        given: given.iter().map(|[name, text]| (name.to_string(), text.to_string())).collect(),
        internal: Vec::new(),
        across: None,
    }
}

/// Linear elasticity with two Maxwell elements, as text.
fn linear_elements() -> Stated<()> {
    let long = "(1 - g1 - g2)*2*mu";
    let pressure = "(lambda + 2*mu/3)*(F11 + F22 - 2)";
    let mean = "(F11 + F22 - 2)/3";
    let entry = |element: usize, i: usize, j: usize, rate: &str| {
        let text = format!("g{element}*2*mu*({rate}) - Q{element}_{i}{j}/tau{element}");
        internal(&format!("Q{element}_{i}{j}"), &text, "0")
    };
    let of_element = |element: usize| {
        [
            entry(element, 1, 1, "Fdot11 - (Fdot11 + Fdot22)/3"),
            entry(element, 2, 2, "Fdot22 - (Fdot11 + Fdot22)/3"),
            entry(element, 3, 3, "-(Fdot11 + Fdot22)/3"),
            entry(element, 1, 2, "(Fdot12 + Fdot21)/2"),
        ]
    };
    let normal =
        |i: usize| format!("{pressure} + {long}*(F{i}{i} - 1 - {mean}) + Q1_{i}{i} + Q2_{i}{i}");
    let shear = format!("{long}*(F12 + F21)/2 + Q1_12 + Q2_12");
    let response = stress(&[[&normal(1), &shear], [&shear, &normal(2)]]);
    let constants = ["lambda", "mu", "g1", "tau1", "g2", "tau2"];
    let internal = [of_element(1), of_element(2)].concat();
    Stated { internal, ..stated(response, &constants, &[]) }
}

#[test]
fn a_law_of_the_library_as_text_gives_the_same() {
    let (library, constants) = elements(ElasticPart::LinearElastic);
    let law = AnyLaw::new(&Law::Stated(linear_elements()), 2).unwrap();
    assert_eq!(law.variables(), library.variables());
    assert_eq!(law.constants(), ["lambda", "mu", "g1", "tau1", "g2", "tau2"]);
    let motion = block([0.37, 0.61], &constants);
    let own = Trajectory::new(&law, &motion, &times(5), 1e-14).unwrap();
    let expected = Trajectory::new(&library, &motion, &times(5), 1e-14).unwrap();
    for ((t, own), expected) in times(5).into_iter().zip(&own.states).zip(&expected.states) {
        for (own, expected) in own.iter().zip(expected) {
            assert!((own.value - expected.value).abs() < 1e-13 * MU);
            for k in 0..2 {
                assert!((own.slopes[k] - expected.slopes[k]).abs() < 1e-13 * MU);
            }
        }
        let (b, P) = divergence(&law, &motion.at(t), &motion.1, own);
        let (b2, P2) = divergence(&library, &motion.at(t), &motion.1, expected);
        for i in 0..2 {
            assert!((b[i] - b2[i]).abs() < 1e-13 * MU);
            for j in 0..2 {
                assert!((P[i][j] - P2[i][j]).abs() < 1e-13 * MU);
            }
        }
    }
}

/// A motion with the coordinates and the time behind some constants.
struct WithPlaces<M> {
    at: M,
    X: [f64; 2],
    constants: Vec<f64>,
    names: Vec<String>,
}

impl<M: Fn(f64) -> Kinematics<Dual<f64, 2>> + Sync> Motion<2> for WithPlaces<M> {
    fn at(&self, time: f64) -> Kinematics<Dual<f64, 2>> {
        (self.at)(time)
    }

    fn constants(&self, time: f64, constants: &mut Vec<Dual<f64, 2>>) {
        constants.extend(self.constants.iter().map(|&value| Dual::<f64, 2>::constant(value)));
        for name in &self.names[self.constants.len()..] {
            constants.push(match name.as_str() {
                "X" => number(self.X[0], [1.0, 0.0]),
                "Y" => number(self.X[1], [0.0, 1.0]),
                "t" => Dual::constant(time),
                other => panic!("{other}"),
            });
        }
    }
}

/// The divergence against differences of the stress of neighbours, at one time.
fn check(law: &AnyLaw, constants: &[f64]) {
    let of = |X: [f64; 2]| {
        let motion = WithPlaces {
            at: block(X, &[]).0,
            X,
            constants: constants.to_vec(),
            names: law.constants(),
        };
        let found = Trajectory::new(law, &motion, &[0.7], 1e-13).unwrap();
        let mut own = Vec::new();
        motion.constants(0.7, &mut own);
        divergence(law, &motion.at(0.7), &own, &found.states[0])
    };
    let (X, h) = ([0.37, 0.61], 1e-3);
    let (found, P) = of(X);
    assert!(P.iter().flatten().all(|entry| entry.is_finite()));
    for i in 0..2 {
        let mut difference = 0.0;
        for axis in 0..2 {
            let at =
                |by: f64| of(std::array::from_fn(|a| X[a] + if a == axis { by } else { 0.0 })).1;
            let [a, b, c, d] = [h, -h, 2.0 * h, -2.0 * h].map(|by| at(by)[i][axis]);
            difference += (8.0 * (a - b) - (c - d)) / (12.0 * h);
        }
        let size = P.iter().flatten().fold(0.0_f64, |most, entry| most.max(entry.abs()));
        assert!((found[i] - difference).abs() < 1e-8 * size, "{i}: {} {difference}", found[i]);
    }
}

/// Texts with all kinds of functions, places, given fields and internal variables.
#[test]
fn slopes_of_stated_laws_are_those_of_neighbours() {
    let energy = "soft*mu/2*(I1 - 3 - 2*ln(J)) + lambda/2*log1p(J - 1)^2 + mu*exp(C12^2)*cosh(C11 - C22) \
                  + mu*damage*(sin(Pi*F12) + erf(F21) + tanh(I2 - 3) + atan2(F12, F11) + sqrt(J)*J^(7/5))";
    let law = Stated {
        internal: vec![internal(
            "damage",
            "soft*(I1 - 3 + d12^2 + Jdot/10)*(1 - damage)",
            "X*Y/10",
        )],
        ..stated(
            Response::Energy(energy.into()),
            &["lambda", "mu"],
            &[["wave", "cos(Pi*X)*t"], ["soft", "1 + wave/5 + X*Y + arctan(Y)"]],
        )
    };
    let law = AnyLaw::stated(&law, 2).unwrap();
    assert_eq!(law.constants(), ["lambda", "mu", "X", "Y", "t"]);
    check(&law, &[BULK, MU]);
    // A fluid: no internal variables, rates alone.
    let normal = ["J*(2*eta*(d11 + t*d22))", "J*2*eta*d22"];
    let response = stress(&[
        [
            &format!("({})*F22/J - J*2*eta*d12*F12/J", normal[0]),
            &format!("-({})*F21/J + J*2*eta*d12*F11/J", normal[0]),
        ],
        [
            &format!("J*2*eta*d12*F22/J - ({})*F12/J", normal[1]),
            &format!("-J*2*eta*d12*F21/J + ({})*F11/J", normal[1]),
        ],
    ]);
    let law =
        AnyLaw::stated(&stated(response, &["eta0"], &[["eta", "eta0*(1 + X^2)"]]), 2).unwrap();
    assert_eq!(law.constants(), ["eta0", "X", "t"]);
    assert!(law.variables().is_empty());
    check(&law, &[3.0]);
    let (_, constants) = flow(2, 0.0, 1.0, false);
    let motion = along(&constants, |_| (Matrix3::identity(), Matrix3::zeros()));
    let found = Trajectory::new(&law, &motion, &times(3), 1e-13).unwrap();
    assert_eq!((found.states.len(), found.evaluations), (3, 0));
}

/// The stress of an energy in space against differences of the energy, by the dual numbers that are there.
#[test]
fn stresses_of_energies_are_their_slopes() {
    let text = "c*(I2 - 3)^2 + c*I1*C13 + c*J^3 + c*F23*F31";
    for dimension in 1..=3 {
        let text = match dimension {
            1 => "c*(I2 - 3)^2 + c*I1*C11 + c*J^3",
            2 => "c*(I2 - 3)^2 + c*I1*C12 + c*J^3 + c*F12*F21",
            _ => text,
        };
        let law = stated(Response::Energy(text.into()), &["c"], &[]);
        let law = StatedHistory::new(&law, dimension).unwrap();
        let F: Tensor<f64> = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let own = [[1.1, 0.2, -0.1], [0.15, 0.9, 0.05], [0.02, -0.3, 1.2]][i][j];
                let rest = if i == j { 1.0 } else { 0.0 };
                if i.max(j) < dimension { own } else { rest }
            })
        });
        let W = |F: &Tensor<f64>| {
            let C = |i: usize, j: usize| (0..3).map(|k| F[k][i] * F[k][j]).sum::<f64>();
            let I1 = C(0, 0) + C(1, 1) + C(2, 2);
            let square: f64 = (0..9).map(|k| C(k / 3, k % 3).powi(2)).sum();
            let I2 = 0.5 * (I1 * I1 - square);
            let J = Matrix3::from_fn(|i, j| F[i][j]).determinant();
            let rest = match dimension {
                1 => I1 * C(0, 0),
                2 => I1 * C(0, 1) + F[0][1] * F[1][0],
                _ => I1 * C(0, 2) + F[1][2] * F[2][0],
            };
            2.5 * ((I2 - 3.0).powi(2) + rest + J.powi(3))
        };
        let at = Kinematics { F, rate: [[0.0; 3]; 3] };
        let P = law.first_piola_kirchhoff(&at, &[2.5], &[]);
        for (i, j) in (0..9).map(|k| (k / 3, k % 3)) {
            let shifted = |by: f64| {
                let mut F = F;
                F[i][j] += by;
                W(&F)
            };
            let slope = (shifted(1e-5) - shifted(-1e-5)) / 2e-5;
            let expected = if i.max(j) < dimension { slope } else { 0.0 };
            assert!((P[i][j] - expected).abs() < 1e-7, "{dimension} {i} {j}: {} {slope}", P[i][j]);
        }
    }
}

#[test]
fn texts_that_are_no_laws_are_told() {
    let one = |text: &str| stated(Response::Energy(text.into()), &["mu"], &[]);
    let fails = |law: &Stated<()>| match AnyLaw::stated(law, 2) {
        Err(UnsupportedLaw::Stated(error)) => error,
        other => panic!("{other:?}"),
    };
    let message = |law: &Stated<()>| fails(law).to_string();
    assert!(message(&one("mu*lambda")).contains("'lambda' is not one of J, I1"));
    assert!(message(&one("mu*I1 +")).starts_with("the energy, 'mu*I1 +'"));
    assert!(message(&one("mu*d11^2")).contains("state the stress instead"));
    assert!(message(&one("mu*diff(X^2, X)*I1")).contains("write the derivative out"));
    assert!(matches!(
        fails(&one("mu*lnratio2_slope(I1 - 3)")),
        StatedHistoryError::NoSlope { function: "lnratio2_slope", .. }
    ));
    let with = |own: Internal| Stated { internal: vec![own], ..one("mu*I1") };
    assert!(message(&with(internal("k", "q", "0"))).starts_with("the rate of 'k', 'q'"));
    assert!(message(&with(internal("k", "1", "I1"))).contains("changes with the deformation"));
    assert!(matches!(
        fails(&with(internal("mu", "1", "0"))),
        StatedHistoryError::TakenName { name } if name == "mu"
    ));
    assert!(matches!(
        fails(&with(internal("F11", "1", "0"))),
        StatedHistoryError::TakenName { .. }
    ));
    let step = internal("k", "positive_part_slope(I1 - 3)", "0");
    assert!(matches!(fails(&with(step)), StatedHistoryError::NoSlope { .. }));
    let curved = Stated { components: Components::Curvilinear, ..one("mu*I1") };
    assert_eq!(fails(&curved), StatedHistoryError::Curvilinear);
    let square = stress(&[["F11", "F12"], ["F21", "F22"]]);
    let law = stated(square, &[], &[]);
    assert!(AnyLaw::stated(&law, 2).is_ok());
    assert!(matches!(AnyLaw::stated(&law, 3), Err(UnsupportedLaw::Stated(_))));
    assert!(matches!(AnyLaw::stated(&law, 4), Err(UnsupportedLaw::Dimension(4))));
}

/// From rest strains are so small at first that `ln F` has few digits: that is rounding, not a rough law.
#[test]
fn variables_of_tiny_strains_are_followed_from_rest() {
    let stated = Stated {
        internal: vec![internal("q", "(ln(F11) - q)/tau", "0")],
        ..stated(stress(&[["E*(ln(F11) - q)/F11", "0"], ["0", "0"]]), &["E", "tau"], &[])
    };
    let law = AnyLaw::new(&Law::Stated(stated), 2).unwrap();
    let tau = 0.005;
    for rate in [1e-3, 4.0, 300.0] {
        let at = move |time: f64| {
            let mut at = Kinematics {
                F: std::array::from_fn(|i| {
                    std::array::from_fn(|j| number(f64::from(i == j), [0.0; 2]))
                }),
                rate: [[number(0.0, [0.0; 2]); 3]; 3],
            };
            let (sine, cosine) = (600.0 * time).sin_cos();
            at.F[0][0] = number(1.0 + rate * sine / 600.0, [rate * sine / 600.0, 0.0]);
            at.rate[0][0] = number(rate * cosine, [rate * cosine, 0.0]);
            at
        };
        let names = law.constants();
        for end in [1e-14, 1e-9, 1e-6, 4.8e-5, 1e-3] {
            let motion =
                WithPlaces { at, X: [0.0; 2], constants: vec![1e4, tau], names: names.clone() };
            let found = Trajectory::new(&law, &motion, &[0.5 * end, end], 1e-13)
                .unwrap_or_else(|error| panic!("{rate} {end}: {error}"));
            // Of second order in the time, where that is short beside tau.
            let q = found.states[1][0];
            let expected = 0.5 * rate * end * end / tau;
            // F is known to 2.2e-16: half of it by itself, half by its series in time.
            let room = 2.0 * end / tau * expected + f64::EPSILON * end / tau;
            assert!(
                (q.value - expected).abs() < room.max(3.0 * rate * end * expected),
                "{rate} {end}: {q:?} {expected:e}"
            );
        }
    }
}

/// The estimate of the error of one variable passes through zero now and then. A step after that must not be as long as it allows.
#[test]
fn a_lone_variable_is_followed_to_every_time_alike() {
    let stated = Stated {
        internal: vec![internal("q", "(ln(F11) - q)/tau", "0")],
        ..stated(stress(&[["E*(ln(F11) - q)/F11", "0"], ["0", "0"]]), &["E", "tau"], &[])
    };
    let law = AnyLaw::new(&Law::Stated(stated), 2).unwrap();
    let at = |time: f64| {
        let (sine, cosine) = (314.16 * time).sin_cos();
        let of = |unit: f64, own: f64| -> Tensor<Dual<f64, 2>> {
            std::array::from_fn(|i| {
                std::array::from_fn(|j| {
                    let unit = if i == j { unit } else { 0.0 };
                    number(if i + j == 0 { unit + own } else { unit }, [0.0; 2])
                })
            })
        };
        Kinematics { F: of(1.0, 0.0257 * sine), rate: of(0.0, 0.0257 * 314.16 * cosine) }
    };
    let names = law.constants();
    let motion = WithPlaces { at, X: [0.0; 2], constants: vec![1e4, 0.005], names };
    let mut worst = 0.0_f64;
    for n in 0..2000 {
        let end = 0.02 * (0.1 + 0.9 * f64::from(n) / 2000.0);
        let [found, closer] = [1e-15, 1e-16].map(|tolerance| {
            Trajectory::new(&law, &motion, &[end], tolerance).unwrap().states[0][0].value
        });
        worst = worst.max((found - closer).abs());
    }
    println!("steps to a time: {worst:e}");
    assert!(worst < 1e-15, "{worst:e}");
}

/// A strain that follows within a hundredth of the time, and a stress of 1e9 times its size: each keeps its own digits. With
/// `F11 = 1 + a t`, `q = a (t - tau (1 - exp(-t/tau)))`, `s = G2 a tau2 (1 - exp(-t/tau2))`.
#[test]
fn variables_of_other_units_keep_their_digits() {
    let rows = [["q + 0*s", "0"], ["0", "0"]];
    let law = Stated {
        internal: vec![
            internal("q", "(F11 - 1 - q)/tau", "0"),
            internal("s", "G2*Fdot11 - s/tau2", "0"),
        ],
        ..stated(stress(&rows), &["tau", "G2", "tau2"], &[])
    };
    let law = AnyLaw::new(&Law::Stated(law), 2).unwrap();
    let (a, tau, big, tau2) = (0.013, 0.01, 1e11, 2.5);
    let constants = [tau, big, tau2].map(Dual::<f64, 2>::constant).to_vec();
    let stretch = move |t: f64| {
        let of = |value: f64| {
            std::array::from_fn(|i| {
                std::array::from_fn(|j| match (i, j) {
                    (0, 0) => Dual::constant(value),
                    _ => Dual::constant(
                        f64::from(u8::from(i == j)) * f64::from(u8::from(value != a)),
                    ),
                })
            })
        };
        Kinematics { F: of(1.0 + a * t), rate: of(a) }
    };
    let times: Vec<f64> = (1..=40).map(|k| 0.025 * f64::from(k)).collect();
    let found = Trajectory::new(&law, &(stretch, constants), &times, 1e-15).unwrap();
    for (t, state) in times.iter().zip(&found.states) {
        let q = a * (t + tau * (-t / tau).exp_m1());
        let s = -big * a * tau2 * (-t / tau2).exp_m1();
        // The strain is known to the rounding of `F`; between steps as long as stability allows errors are some hundred times the tolerance.
        for (found, exact, largest) in [(state[0].value, q, a), (state[1].value, s, big * a)] {
            assert!((found - exact).abs() < 1e-11 * largest, "{t}: {found} {exact}");
        }
    }
}
