use mmsmith_galerkin::Layout;
use mmsmith_solutions::build;

use super::*;

fn solution(name: &str) -> AnySolution<f64> {
    build(name, &[]).unwrap().unwrap()
}

fn case(exact: &AnySolution<f64>, degree: usize, cells: usize) -> StaticCase {
    let total = Total {
        layout: Layout::Gauss,
        coordinates: Total::coordinates_for(exact),
        ..Total::of_degree(degree)
    };
    let case = Case { cells, per_cell: degree + 1, ..Case::default() };
    StaticCase { case, total, load_steps: 1, moment: usual_moment(exact) }
}

fn solve_one(exact: &AnySolution<f64>, case: &StaticCase) -> StaticRow {
    StaticProblem::new(exact, case).unwrap().solve(&mut |_, _| {}).unwrap()
}

/// The verdicts on a series of grids, and the exponents of Newton's method.
fn study(name: &str, degree: usize, cells: &[usize]) -> (StaticStudy, Vec<f64>) {
    let exact = solution(name);
    let case = case(&exact, degree, cells[0]);
    let on = |cells: &usize| {
        let case = StaticCase { case: Case { cells: *cells, ..case.case }, ..case };
        solve_one(&exact, &case)
    };
    let rows: Vec<StaticRow> = cells.iter().map(on).collect();
    let exponents = rows.iter().map(|row| row.exponent().unwrap()).collect();
    let expected = expected_of_statics(&exact, &case.total);
    (StaticStudy::new(rows, &expected, 0.1, &[]), exponents)
}

/// Orders of `u` in the mean of squares are those of the splines plus one, on both sides, and those of gradients those of the splines.
fn check(name: &str, degree: usize, cells: &[usize]) {
    let (study, exponents) = study(name, degree, cells);
    for (field, norms) in study.verdicts.iter() {
        let (finest, expected) = (norms.l2.finest.unwrap(), norms.l2.expected.unwrap());
        let is_met = match field {
            "u" => (finest - expected).abs() <= 0.1,
            _ => finest >= expected - 0.1,
        };
        assert!(is_met, "{name}, degree {degree}, {field}: {finest} for {expected}");
    }
    assert!(exponents.iter().all(|exponent| *exponent >= 1.8), "{name}, {degree}: {exponents:?}");
}

#[test]
fn orders_are_those_of_the_splines_between_sliding_walls() {
    for (degree, cells) in [(1, [16, 32]), (2, [8, 16]), (3, [8, 16]), (4, [8, 16]), (5, [8, 16])] {
        check("skew-2d", degree, &cells);
    }
    check("axis-aligned-1d", 3, &[16, 32]);
    check("skew-3d", 1, &[4, 8]);
    check("skew-3d", 2, &[3, 6]);
}

#[test]
fn a_ring_on_a_polar_grid_has_the_orders_as_well() {
    // The motion is a polynomial of third degree along the radius: splines of that degree have it.
    for degree in [1, 2] {
        check("ring-nu", degree, &[16, 32]);
    }
}

#[test]
fn the_bits_are_the_same_for_any_number_of_threads() {
    let exact = solution("skew-2d");
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let row = pool.install(|| solve_one(&exact, &case(&exact, 3, 12)));
        StaticRow { wall_s: 0.0, ..row }
    };
    let one = on(1);
    assert_eq!(one, on(2));
    assert_eq!(one, on(3));
}

#[test]
fn load_steps_end_in_the_same_state() {
    let exact = solution("skew-2d");
    let at_once = case(&exact, 2, 8);
    let in_steps = StaticCase { load_steps: 4, ..at_once };
    let (first, second) = (solve_one(&exact, &at_once), solve_one(&exact, &in_steps));
    assert_eq!((first.load_steps.len(), second.load_steps.len()), (1, 4));
    let [a, b] = [first, second].map(|row| row.errors.unwrap().u.l2);
    assert!((a / b - 1.0).abs() < 1e-6, "{a} {b}");
}

#[test]
fn what_has_no_equilibrium_here_is_refused_by_its_name() {
    let exact = solution("skew-2d");
    let usual = case(&exact, 3, 8);
    let refused = |case: StaticCase| StaticProblem::new(&exact, &case).err().unwrap().to_string();
    assert!(refused(StaticCase { load_steps: 0, ..usual }).starts_with("load-steps = 0"));
    assert!(refused(StaticCase { moment: f64::NAN, ..usual }).starts_with("moment = NaN"));
    let projected = Case { volume: mmsmith_laws::Volume::Projected, ..usual.case };
    assert!(refused(StaticCase { case: projected, ..usual }).starts_with("volume = projected"));
}

#[test]
fn exponents_are_those_of_the_last_residuals_above_rounding() {
    let step = |residuals: &[f64]| mmsmith_galerkin::LoadStep {
        factor: 1.0,
        residuals: residuals.to_vec(),
        rounding: 1e-14,
        halvings: 0,
        factors: Factors::Cholesky,
    };
    let exponent = |residuals: &[f64]| step(residuals).exponent();
    assert_eq!(exponent(&[1.0, 1e-15]), None);
    assert!((exponent(&[7.0, 1e-1, 1e-2, 1e-4]).unwrap() - 2.0).abs() < 1e-12);
    assert!((exponent(&[7.0, 1e-1, 1e-2, 1e-3]).unwrap() - 1.0).abs() < 1e-12);
    // The residual before any step is not one of the method.
    assert_eq!(exponent(&[1e3, 1e-2, 1e-8]), None);
    // What has reached rounding would have fallen further, and says no less than it fell.
    assert!((exponent(&[7.0, 1e-2, 1e-4, 1e-8, 1e-15]).unwrap() - 2.0).abs() < 1e-12);
    assert!((exponent(&[7.0, 1.0, 1e-3, 1e-15]).unwrap() - 4.0).abs() < 1e-12);
    assert_eq!(exponent(&[7.0, 1e-3, 1e-8, 1e-13]), None);
}

/// Slopes of stated laws are those of their stress, for energies of invariants and of components, and for a stress.
#[test]
fn slopes_of_stated_laws_are_the_differences_of_their_stresses() {
    use mmsmith_stated_law::{Response, StatedLaw};
    const STEP: f64 = 1e-3;
    let texts = |rows: [[&str; 2]; 2]| rows.map(|row| row.map(String::from).to_vec()).to_vec();
    let laws = [
        Response::Energy("mu/2*(I1 - 3 - 2*ln(J)) + lambda/2*ln(J)^2 + mu*(I2 - 3)^2".into()),
        Response::Energy("mu*(exp(C11 - 1) - C11) + lambda/2*(C12^2 + C21^2 + (C22 - 1)^2)".into()),
        Response::Stress(texts([
            ["mu*(F11 - 1/F11)", "mu*F12*J"],
            ["mu*sin(F21)", "lambda*(F22 - 1)"],
        ])),
    ];
    let constants = [("lambda".to_owned(), 3.0), ("mu".to_owned(), 2.0)];
    let at = [[1.15, 0.2], [-0.1, 0.9]];
    for response in laws {
        let law = StatedLaw::<f64>::new(2, &response, &constants).unwrap();
        let stress = |F: [[f64; 2]; 2]| {
            let F = F.map(|row| row.map(|entry| [entry]));
            let mut P = [[[0.0]; 2]; 2];
            law.first_piola_kirchhoff(&F, &mut P);
            P
        };
        for (k, l) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let mut A = [[[0.0]; 2]; 2];
            law.slope(&at.map(|row| row.map(|entry| [entry])), [k, l], &mut A);
            let moved = |by: f64| {
                let mut F = at;
                F[k][l] += by;
                stress(F)
            };
            let [above, below, far, near] = [STEP, -STEP, 2.0 * STEP, -2.0 * STEP].map(moved);
            for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let first = above[i][j][0] - below[i][j][0];
                let second = far[i][j][0] - near[i][j][0];
                let expected = (8.0 * first - second) / (12.0 * STEP);
                let off = (A[i][j][0] - expected).abs();
                assert!(off < 1e-8, "{response:?} {i} {j} {k} {l}: {off:e}");
            }
        }
    }
}
