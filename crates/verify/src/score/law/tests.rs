//! Mistakes written out by hand, and each found from what a file would hold of it.

use mmsmith_runtime::{AnySolution, Solution};
use mmsmith_solutions::build;
use nalgebra::{Matrix2, Matrix3, SMatrix, SVector};

use super::*;

const DENSITY: f64 = 3.0;
const E: f64 = 1.0e4;
const NU: f64 = 0.3;
const LAMBDA: f64 = E * NU / ((1.0 + NU) * (1.0 - 2.0 * NU));
const MU: f64 = E / (2.0 * (1.0 + NU));

/// The neo-Hookean stress, as textbooks have it.
fn neo_hookean<const D: usize>(F: &SMatrix<f64, D, D>, lambda: f64, mu: f64) -> SMatrix<f64, D, D> {
    let K = crate::inverse::inverse(F).unwrap().transpose();
    (F - K) * mu + K * (lambda * crate::inverse::determinant(F).ln())
}

fn plane() -> Box<dyn Solution<f64, 2>> {
    match build::<f64>("skew-2d", &[0.1, E, NU, DENSITY]).unwrap().unwrap() {
        AnySolution::Two(exact) => exact,
        _ => panic!("it is of two dimensions"),
    }
}

/// Places of a body, and deformation gradients of a solver there, which are not the exact ones.
fn recorded<const D: usize>(
    exact: &dyn Solution<f64, D>,
) -> (Vec<SVector<f64, D>>, Vec<SMatrix<f64, D, D>>) {
    let X: Vec<_> = (1..60)
        .map(|n| {
            SVector::from_fn(|axis, _| (f64::from(n) * (0.618_034 + 0.131 * axis as f64)).fract())
        })
        .collect();
    let F = X.iter().map(|X| {
        let off =
            SMatrix::from_fn(|i, j| 1e-2 * ((i + 2 * j) as f64 + 3.0 * X[0] - X[D - 1]).sin());
        exact.deformation_gradient(X, TIME) + off
    });
    let F = F.collect();
    (X, F)
}

const TIME: f64 = 0.004;

/// Rows and remarks for files that hold these fields.
fn found<const D: usize>(
    exact: &dyn Solution<f64, D>,
    X: &[SVector<f64, D>],
    F: Vec<SMatrix<f64, D, D>>,
    (field, stress): (usize, Vec<SMatrix<f64, D, D>>),
    scalars: [Option<Vec<f64>>; 2],
    rounding: f64,
) -> (Vec<LawRow>, Vec<String>)
where
    f64: Precision<D>,
{
    let mut tensors = [Some(F), None, None, None];
    tensors[1 + field] = Some(stress);
    let u = X.iter().map(|X| exact.displacement(X, TIME)).collect();
    let data = FrameData {
        ids: None,
        X: X.to_vec(),
        u,
        v: None,
        tensors,
        whole: Default::default(),
        scalars,
    };
    let mut witnesses = Witnesses::new(1);
    witnesses.add(&data, TIME);
    let mut remarks = Remarks::default();
    let rows = compare(exact, &witnesses, &|_| rounding, &mut remarks);
    let lines =
        remarks.list().into_iter().map(|remark| format!("{} {}", remark.kind, remark.message));
    (rows, lines.collect())
}

type Mistake = fn(&Matrix2<f64>) -> Matrix2<f64>;

#[test]
fn mistakes_in_the_stress_are_named_on_one_grid() {
    const P: usize = 0;
    const CAUCHY: usize = 1;
    let exact = plane();
    let mistakes: [(&str, usize, Mistake); 16] = [
        ("right", P, |F| neo_hookean(F, LAMBDA, MU)),
        ("right", CAUCHY, |F| neo_hookean(F, LAMBDA, MU) * F.transpose() / F.determinant()),
        ("transposed", P, |F| neo_hookean(F, LAMBDA, MU).transpose()),
        ("kirchhoff", P, |F| neo_hookean(F, LAMBDA, MU) * F.transpose()),
        ("cauchy", P, |F| neo_hookean(F, LAMBDA, MU) * F.transpose() / F.determinant()),
        ("second-piola-kirchhoff", P, |F| F.try_inverse().unwrap() * neo_hookean(F, LAMBDA, MU)),
        ("first-piola-kirchhoff", CAUCHY, |F| neo_hookean(F, LAMBDA, MU)),
        ("kirchhoff", CAUCHY, |F| neo_hookean(F, LAMBDA, MU) * F.transpose()),
        ("sign", P, |F| -neo_hookean(F, LAMBDA, MU)),
        ("times-density", P, |F| neo_hookean(F, LAMBDA, MU) * DENSITY),
        ("lame-exchanged", P, |F| neo_hookean(F, MU, LAMBDA)),
        ("young-poisson", P, |F| neo_hookean(F, E, NU)),
        ("plane-stress", P, |F| neo_hookean(F, E * NU / (1.0 - NU * NU), MU)),
        ("small-strain", P, |F| {
            let H = F - Matrix2::identity();
            (H + H.transpose()) * MU + Matrix2::identity() * (LAMBDA * H.trace())
        }),
        ("st-venant-kirchhoff", P, |F| {
            let G = (F.transpose() * F - Matrix2::identity()) * 0.5;
            F * (G * (2.0 * MU) + Matrix2::identity() * (LAMBDA * G.trace()))
        }),
        ("pressure-j-times", P, |F| {
            let (K, J) = (F.try_inverse().unwrap().transpose(), F.determinant());
            (F - K) * MU + K * (LAMBDA * J * (J - 1.0))
        }),
    ];
    for (name, field, mistake) in mistakes {
        for (rounding, cut) in [(f64::EPSILON, false), (f64::from(f32::EPSILON), true)] {
            let written = |value: f64| if cut { f64::from(value as f32) } else { value };
            let (X, F) = recorded(exact.as_ref());
            let stress = F.iter().map(|F| mistake(F).map(written)).collect();
            let F = F.into_iter().map(|F| F.map(written)).collect();
            let (rows, lines) =
                found(exact.as_ref(), &X, F, (field, stress), [None, None], rounding);
            let row = &rows[0];
            assert_eq!(row.hypothesis, Some(name), "{lines:?}");
            assert!(row.error <= if cut { 1e-5 } else { 1e-13 }, "{name} {row:?}");
            let is_right = name == "right";
            assert_eq!(row.verdict == LawVerdict::Agrees, is_right, "{name}");
            assert!(is_right || row.right > 1e-3, "{name}: {}", row.right);
            let kind = if is_right { "law-agrees " } else { &format!("law-{name} ") };
            assert!(lines[0].starts_with(kind), "{lines:?}");
        }
    }
}

#[test]
fn a_wrong_gradient_is_told_from_a_wrong_stress() {
    let exact = plane();
    let (X, F) = recorded(exact.as_ref());
    let stress: Vec<_> = F.iter().map(|F| neo_hookean(F, LAMBDA, MU)).collect();
    for (name, wrong) in [
        ("f-transposed", F.iter().map(Matrix2::transpose).collect::<Vec<_>>()),
        ("h-for-f", F.iter().map(|F| F - Matrix2::identity()).collect()),
        ("f-inverse", F.iter().map(|F| F.try_inverse().unwrap()).collect()),
    ] {
        let (rows, lines) =
            found(exact.as_ref(), &X, wrong, (0, stress.clone()), [None, None], f64::EPSILON);
        assert_eq!(rows[0].hypothesis, Some(name), "{lines:?}");
    }
}

#[test]
fn what_the_data_cannot_tell_apart_is_said() {
    let exact = plane();
    let (X, F) = recorded(exact.as_ref());
    let symmetric: Vec<_> = F.iter().map(|F| (F + F.transpose()) * 0.5).collect();
    let stress = symmetric.iter().map(|F| neo_hookean(F, LAMBDA, MU)).collect();
    let (rows, lines) =
        found(exact.as_ref(), &X, symmetric, (0, stress), [None, None], f64::EPSILON);
    assert_eq!(rows[0].verdict, LawVerdict::Agrees);
    assert!(rows[0].alike.contains(&"transposed"), "{rows:?}");
    assert!(lines[0].contains("hides a transposed stress"), "{lines:?}");
}

#[test]
fn other_parameters_are_fitted_and_other_places_are_no_mistake_with_a_name() {
    let exact = plane();
    let (X, F) = recorded(exact.as_ref());
    let stress = F.iter().map(|F| neo_hookean(F, 1.7 * LAMBDA, 0.4 * MU)).collect();
    let (rows, lines) =
        found(exact.as_ref(), &X, F.clone(), (0, stress), [None, None], f64::EPSILON);
    assert_eq!(rows[0].verdict, LawVerdict::Unexplained);
    let (lambda, mu) = (1.7 * LAMBDA, 0.4 * MU);
    assert!(lines[0].contains(&format!("lambda = {lambda:.4e} and mu = {mu:.4e}")), "{lines:?}");
    // The stress of the exact F, beside the F of a solver.
    let elsewhere = X.iter().map(|X| exact.first_piola_kirchhoff(X, TIME)).collect();
    let (rows, lines) = found(exact.as_ref(), &X, F, (0, elsewhere), [None, None], f64::EPSILON);
    assert_eq!((rows[0].verdict, rows[0].hypothesis), (LawVerdict::Unexplained, None));
    assert!(lines[0].starts_with("law-differs "), "{lines:?}");
}

#[test]
fn volume_ratios_and_densities_are_held_against_the_deformation() {
    let exact = plane();
    let (X, F) = recorded(exact.as_ref());
    let J: Vec<_> = F.iter().map(Matrix2::determinant).collect();
    let each = |of: fn(f64) -> f64| Some(J.iter().map(|J| of(*J)).collect::<Vec<_>>());
    for (scalars, expected) in [
        ([each(|J| J), each(|J| DENSITY / J)], ["right", "right"]),
        ([each(|J| J - 1.0), each(|_| DENSITY)], ["volume-change", "reference-density"]),
        ([each(|J| 1.0 / J), each(|J| DENSITY * J)], ["over-j", "times-j"]),
        ([each(f64::ln), each(|J| 1.0 / J)], ["logarithm", "unit-density"]),
    ] {
        let stress = F.iter().map(|F| neo_hookean(F, LAMBDA, MU)).collect();
        let (rows, lines) =
            found(exact.as_ref(), &X, F.clone(), (0, stress), scalars, f64::EPSILON);
        let names: Vec<_> = rows[1..].iter().filter_map(|row| row.hypothesis).collect();
        assert_eq!(names, expected, "{lines:?}");
    }
}

#[test]
fn every_row_has_a_stress_of_its_own_in_space() {
    let Some(Ok(AnySolution::Three(exact))) = build::<f64>("skew-3d", &[0.05, E, NU, DENSITY])
    else {
        panic!("it is of three dimensions")
    };
    let (X, F) = recorded::<3>(exact.as_ref());
    let known = Known::<3>::new(exact.law()).unwrap();
    let variants = known.variants();
    for (n, quantity) in STRESSES.into_iter().enumerate() {
        let values = Values { known: &known, variants: &variants, quantity, density: DENSITY };
        // A transposed F is told from a transposed stress by the exact F, which these have.
        for row in ALL.iter().filter(|row| row.kind != "law-f-transposed") {
            let stress: Option<Vec<Matrix3<f64>>> =
                F.iter().map(|F| values.of(row.kind, F)).collect();
            let Some(stress) = stress else { continue };
            let (rows, lines) =
                found(exact.as_ref(), &X, F.clone(), (n, stress), [None, None], f64::EPSILON);
            let Some(found) = rows.first() else { continue };
            let is_told = found.hypothesis == Some(row.name()) || found.alike.contains(&row.name());
            assert!(is_told, "{quantity} {}: {lines:?}", row.kind);
        }
    }
    let of = |kind: &&Hypothesis| {
        STRESSES.iter().any(|quantity| {
            let values = Values {
                known: &known,
                variants: &variants,
                quantity: *quantity,
                density: DENSITY,
            };
            F.iter().any(|F| values.of(kind.kind, F).is_some())
        })
    };
    let without: Vec<_> = ALL.iter().filter(|row| !of(row)).map(|row| row.kind).collect();
    // That of plane stress is of the plane; the law itself is no other one.
    assert_eq!(without, ["law-plane-stress", "law-neo-hookean"]);
}
