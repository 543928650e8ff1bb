//! The field check passes right solutions and catches planted faults.

use crate::hand_coded;

use hand_coded::{AxisAligned, Coded, CrossedShear, Plane, Ring};
use mmsmith_solutions::{AnySolution, Boundary, Condition, Domain, Surface};
use mmsmith_verify::{CheckReport, Verdict, check};
use nalgebra::{SMatrix, SVector, matrix};

type Vector = SVector<f64, 2>;
type Tensor = SMatrix<f64, 2, 2>;

fn report(plane: impl Plane) -> CheckReport {
    check(&AnySolution::Two(Box::new(Coded(plane))), 200).expect("a body that can be checked")
}

fn failed(report: &CheckReport) -> Vec<&str> {
    let failures = report.findings.iter().filter(|f| f.verdict == Verdict::Failed);
    failures.map(|f| f.what.as_str()).collect()
}

#[test]
fn right_solutions_pass_with_a_sharp_check() {
    let reports = [
        report(AxisAligned::default()),
        report(AxisAligned { A: 1e-3, nu: 0.0, ..AxisAligned::default() }),
        report(AxisAligned { A: -0.05, nu: 0.45, E: 3e11, rho0: 7800.0 }),
        report(CrossedShear::default()),
        report(Ring::default()),
    ];
    for report in &reports {
        for finding in &report.findings {
            assert_eq!(finding.verdict, Verdict::Passed, "{finding:#?}");
            assert!(finding.own_error <= 1e-10 * finding.scale, "{finding:#?}");
        }
    }
}

#[test]
fn a_motionless_body_passes() {
    let report = report(AxisAligned { A: 0.0, ..AxisAligned::default() });
    assert!(report.passed(), "{report:#?}");
}

/// Fault of the shear below.
#[derive(Clone, Copy, Debug)]
enum Fault {
    AccelerationSign,
    VelocityFactor,
    GradientTransposed,
    StressTransposed,
    StressConstant,
    ForceConstant,
    ForceTermDropped,
    ForceSign,
    StressNotANumber,
}

#[derive(Clone)]
struct Faulty(CrossedShear, Fault);

impl Plane for Faulty {
    fn motion(&self, X: &Vector, t: f64) -> [Vector; 3] {
        let [u, v, a] = self.0.motion(X, t);
        match self.1 {
            Fault::AccelerationSign => [u, v, -a],
            Fault::VelocityFactor => [u, v * (1.0 + 1e-6), a],
            _ => [u, v, a],
        }
    }
    fn gradient(&self, X: &Vector, t: f64) -> Tensor {
        let H = self.0.gradient(X, t);
        if matches!(self.1, Fault::GradientTransposed) { H.transpose() } else { H }
    }
    fn stress(&self, X: &Vector, t: f64) -> Tensor {
        let P = self.0.stress(X, t);
        match self.1 {
            Fault::StressTransposed => P.transpose(),
            Fault::StressConstant => P + matrix![0.0, 1e-6; 0.0, 0.0] * P[(0, 1)],
            Fault::StressNotANumber => P.map(|p| if X[0] > 0.9 { f64::NAN } else { p }),
            _ => P,
        }
    }
    fn force(&self, X: &Vector, t: f64) -> Vector {
        let [one, two, three] = self.0.divergence_terms(X, t);
        let a = self.0.motion(X, t)[2];
        match self.1 {
            Fault::ForceConstant => a - one - two * (1.0 + 1e-6) - three,
            Fault::ForceTermDropped => a - one - two,
            Fault::ForceSign => a - one - two + three,
            _ => a - one - two - three,
        }
    }
    fn shape(&self) -> Domain<f64, 2> {
        self.0.shape()
    }
    fn conditions(&self) -> &'static [Boundary] {
        self.0.conditions()
    }
    fn constants(&self) -> [f64; 3] {
        self.0.constants()
    }
}

#[test]
fn planted_faults_are_caught_in_the_right_field() {
    for (fault, expected) in [
        (Fault::AccelerationSign, &["a", "b"][..]),
        (Fault::VelocityFactor, &["v", "a"]),
        (Fault::GradientTransposed, &["H", "F", "P"]),
        (Fault::StressTransposed, &["P", "b"]),
        (Fault::StressConstant, &["P", "b"]),
        (Fault::ForceConstant, &["b"]),
        (Fault::ForceTermDropped, &["b"]),
        (Fault::ForceSign, &["b"]),
        (Fault::StressNotANumber, &["P", "b", "all at once"]),
    ] {
        let report = report(Faulty(CrossedShear::default(), fault));
        // Tractions are made of P: what is not a number is none on the surfaces, either.
        let fields: Vec<_> =
            failed(&report).into_iter().filter(|what| !what.starts_with("traction")).collect();
        assert_eq!(fields, expected, "{fault:?}: {report:#?}");
    }
}

#[test]
fn a_declared_condition_that_does_not_hold_is_caught() {
    const WRONG: &[Boundary] = &[
        Boundary { surface: Surface::Inner, condition: Condition::TractionFree },
        Boundary { surface: Surface::Outer, condition: Condition::Sliding },
    ];
    let report = report(Ring { conditions: WRONG, ..Ring::default() });
    assert_eq!(failed(&report), ["u.N on outer"]);
}

#[test]
fn a_condition_on_a_surface_that_is_not_there_is_an_error() {
    const MISPLACED: &[Boundary] =
        &[Boundary { surface: Surface::Upper(0), condition: Condition::Sliding }];
    let ring = Ring { conditions: MISPLACED, ..Ring::default() };
    let error = check(&AnySolution::Two(Box::new(Coded(ring))), 10).unwrap_err();
    assert!(error.to_string().contains("Upper(0)"), "{error}");
}
