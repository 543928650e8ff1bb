//! Faults planted in laws, one at a time: in the solver's law, which `mms check` must catch by name, and in the stress that fields
//! derive from an energy, which a run with the solver's own law must catch. Each is a mistake of the kind that published codes carry.

#![allow(clippy::unwrap_used)]

use mmsmith_expr::{Ast, Expr, Graph};
use mmsmith_interpret::interpret_fields;
use mmsmith_mpm::fault::{self, Fault};
use mmsmith_solutions::AnySolution;
use mmsmith_spec::{Fields, Law, Spec};
use mmsmith_tests::workspace;
use mmsmith_verify::{
    Arithmetic, Case, CflSpeed, Composition, Layout, Scheme, Status, Sweep, Total, Verdict, check,
    converge,
};

const YEOH: &str = "law = 'yeoh'\nc1 = 'E/6'\nc2 = 'E/2'\nc3 = 'E'\nkappa = 'E'";
const GENT: &str = "law = 'gent'\nJm = '10'";
const ARRUDA_BOYCE: &str = "law = 'arruda-boyce'\nmu = 'E/3'\nN = '5'\nkappa = 'E'";
const ORTHOTROPIC: &str = "law = 'orthotropic'\nc11 = '5/4*E'\nc22 = 'E'\nc12 = 'E/3'\nc66 = 'E/3'";
const OGDEN: &str =
    "law = 'ogden'\nmu1 = 'E/5'\nalpha1 = '3'\nmu2 = '-E/20'\nalpha2 = '-2'\nkappa = 'E'";
const HOLZAPFEL_GASSER_OGDEN: &str = "law = 'holzapfel-gasser-ogden'\nmu = 'E/3'\nk1 = 'E/10'\nk2 = '1/2'\n\
     angle = 'Pi/6'\nkappa = 'E'";
const COUPLED: &str = "law = 'energy'\n\
     W = 'E/6*(I1 - 3 - 2*ln(J)) + E/4*ln(J)^2 + E/10*(F11 - 1)^2*(1 + C12) + E/12*C12^2'";
const BY_COMPONENT: &str = "law = 'stress'\n\
     P = { 11 = 'E/2*(F11 - 1/F11) + E/4*(J - 1)', 12 = 'E/3*(F12 + F21) + E/10*F12*F22', 21 = 'E/3*(F12 + F21)', \
     22 = 'E/2*(F22 - 1/F22) + E/4*ln(J)/F22' }";

/// Faults in the solver's law, and the material of the specification that shows them.
const FAULTS: &[(Fault, &str)] = &[
    (Fault::YeohFactor, YEOH),
    (Fault::YeohSign, YEOH),
    (Fault::GentFactor, GENT),
    (Fault::GentSign, GENT),
    (Fault::ArrudaBoyceFactor, ARRUDA_BOYCE),
    (Fault::ArrudaBoyceSign, ARRUDA_BOYCE),
    (Fault::OrthotropicFactor, ORTHOTROPIC),
    (Fault::OrthotropicSign, ORTHOTROPIC),
    (Fault::OgdenFactor, OGDEN),
    (Fault::OgdenSign, OGDEN),
    (Fault::HolzapfelGasserOgdenFactor, HOLZAPFEL_GASSER_OGDEN),
    (Fault::HolzapfelGasserOgdenSign, HOLZAPFEL_GASSER_OGDEN),
    (Fault::StatedFactor, COUPLED),
    (Fault::StatedSign, COUPLED),
    (Fault::StatedFactor, BY_COMPONENT),
    (Fault::StatedSign, BY_COMPONENT),
];

/// Puts another material in the place of a specification's.
type Plant = fn(&mut Spec);

/// Faults in the stress that is derived from an energy: the material, and what the stress is derived from in its place.
const IN_DERIVATIONS: &[(&str, &str, Plant)] = &[
    ("the 2 of a square dropped", YEOH, |spec| constant(spec, "c2", "E/4")),
    ("the sign of a cube", YEOH, |spec| constant(spec, "c3", "-E")),
    ("the limit of I1b for that of I1b - 3", GENT, |spec| constant(spec, "Jm", "7")),
    ("the locking stretch for its square", ARRUDA_BOYCE, |spec| constant(spec, "N", "sqrt(5)")),
    ("shears of the strain for those of engineers", ORTHOTROPIC, |spec| {
        constant(spec, "c66", "E/6");
    }),
    ("the sign of a power", OGDEN, |spec| constant(spec, "alpha1", "-3")),
    ("fibres at the opposite angle", HOLZAPFEL_GASSER_OGDEN, |spec| {
        constant(spec, "angle", "-Pi/6");
    }),
    ("the derivative by C12 halved", COUPLED, |spec| {
        response(
            spec,
            "E/6*(I1 - 3 - 2*ln(J)) + E/4*ln(J)^2 + E/10*(F11 - 1)^2*(1 + C12) + E/24*C12^2",
        );
    }),
    ("the derivative of a product by C12 dropped", COUPLED, |spec| {
        response(spec, "E/6*(I1 - 3 - 2*ln(J)) + E/4*ln(J)^2 + E/10*(F11 - 1)^2 + E/12*C12^2");
    }),
    ("the sign of a derivative by F11", COUPLED, |spec| {
        response(
            spec,
            "E/6*(I1 - 3 - 2*ln(J)) + E/4*ln(J)^2 - E/10*(F11 - 1)^2*(1 + C12) + E/12*C12^2",
        );
    }),
    ("a component for that across", BY_COMPONENT, |spec| {
        response(spec, "E/3*(F12 + F21) + E/10*F21*F22");
    }),
];

/// The expression of a text in the graph of a specification.
fn expression(graph: &mut Graph, text: &str) -> Expr {
    let ast = Ast::parse(text).unwrap();
    graph.build(&ast, &mut |graph, name| Ok(graph.symbol(name))).unwrap()
}

/// Another value of a constant of the library's law.
fn constant(spec: &mut Spec, of: &str, text: &str) {
    let planted = expression(&mut spec.graph, text);
    let Law::Library(material) = &spec.material else { panic!("no law of the library") };
    let changed = material.map_named(|name, value| if name == of { planted } else { value });
    assert_ne!(&changed, material, "{of}");
    spec.material = Law::Library(changed);
}

/// Another energy, or another first shear component of the stress.
fn response(spec: &mut Spec, text: &str) {
    let planted = expression(&mut spec.graph, text);
    match &mut spec.material {
        Law::Library(_) => panic!("a law of the library"),
        Law::Energy { W } => *W = planted,
        Law::Stress { P } => P[0][1] = planted,
    }
}

/// The body of a motion, of a material.
fn specification(motion: &str, material: &str) -> Spec {
    let path = workspace().join("tests/data/specs/motions").join(motion).with_extension("toml");
    let motion = std::fs::read_to_string(path).unwrap();
    let text = format!("{motion}\n[material]\n{material}\ndensity = 'rho0'\n");
    Spec::parse(&text, "motion").unwrap_or_else(|error| panic!("{error}\n{material}"))
}

fn solution(spec: &Spec, fields: Fields) -> AnySolution<f64> {
    interpret_fields(spec, fields, []).unwrap()
}

/// Findings of `mms check` that have not passed.
fn wrong(solution: &AnySolution<f64>) -> Vec<String> {
    let report = check(solution, 40).unwrap();
    let failed = report.findings.iter().filter(|finding| finding.verdict != Verdict::Passed);
    failed.map(|finding| format!("{} against {}", finding.what, finding.against)).collect()
}

/// A run that shows whether the solver's law is that of the fields.
struct Run {
    frame: &'static str,
    /// A file in `tests/data/specs/motions`.
    motion: &'static str,
    case: fn() -> Case,
    cells: [usize; 2],
    /// Bounds of the order: above `least_order` where the law is that of the fields, below `order_with_fault` where it is not.
    least_order: f64,
    order_with_fault: f64,
}

const RUNS: [Run; 1] = [Run {
    frame: "total",
    motion: "skew-2d",
    case: || Case {
        scheme: Scheme::Total(Total {
            composition: Composition::Order4,
            layout: Layout::Gauss,
            ..Total::of_degree(3)
        }),
        cfl_speed: CflSpeed::PWave,
        cfl: 0.3,
        per_cell: 4,
        periods: 0.25,
        ..Case::default()
    },
    cells: [4, 8],
    least_order: 3.5,
    order_with_fault: 2.0,
}];

/// The order of the displacement; `None` where a run fails.
fn order(exact: &AnySolution<f64>, run: &Run) -> Option<f64> {
    let sweep = Sweep::Cells(run.cells.to_vec());
    let study = converge(exact, Arithmetic::Double, &(run.case)(), &sweep, &mut |_| ()).unwrap();
    let runs = study.rows.iter().all(|row| row.status == Status::Ok);
    study.orders.u.l2.local[0].filter(|_| runs)
}

const OF_LAW: &str = "P against solver's law of F";
const OF_ENERGY: &str = "W against solver's energy of F";

/// Fails unless the error does not shrink with the grid as it does without a fault.
fn assert_shown(exact: &AnySolution<f64>, run: &Run, about: &str) {
    let (order, frame) = (order(exact, run), run.frame);
    assert!(
        order.is_none_or(|order| order < run.order_with_fault),
        "{about}, {frame}: {order:.2?}"
    );
}

#[test]
fn every_fault_in_the_law_of_the_solver_is_caught_by_name_and_by_a_run() {
    for run in &RUNS {
        for (fault, material) in FAULTS {
            let spec = specification(run.motion, material);
            let exact = solution(&spec, spec.derive().unwrap());
            let found = fault::with(*fault, || wrong(&exact));
            // By that comparison alone: the fields agree with each other and with the energy.
            assert_eq!(found, [OF_LAW], "{fault:?}");
            fault::with(*fault, || assert_shown(&exact, run, &format!("{fault:?}")));
        }
    }
}

#[test]
fn every_fault_in_the_derivation_of_the_stress_is_caught_by_a_run_and_by_name() {
    for run in &RUNS {
        for (fault, material, plant) in IN_DERIVATIONS {
            let spec = specification(run.motion, material);
            // In the graph of the right one, whose constants the solution goes on to use.
            let mut planted = spec.clone();
            plant(&mut planted);
            let exact = solution(&spec, planted.derive().unwrap());
            assert_shown(&exact, run, fault);
            // The energy that the stress follows from is another, where there is one.
            let of_energy = (*material != BY_COMPONENT).then_some(OF_ENERGY);
            let expected: Vec<&str> = [OF_LAW].into_iter().chain(of_energy).collect();
            assert_eq!(wrong(&exact), expected, "{fault}");
        }
    }
}

#[test]
fn without_a_fault_every_law_passes_and_converges() {
    let mut materials: Vec<&str> = FAULTS.iter().map(|(_, material)| *material).collect();
    materials.dedup();
    for run in &RUNS {
        for material in &materials {
            let spec = specification(run.motion, material);
            let exact = solution(&spec, spec.derive().unwrap());
            assert_eq!(wrong(&exact), Vec::<String>::new(), "{material}");
            let (order, frame) = (order(&exact, run), run.frame);
            println!("{material}, {frame}: order {order:.2?}");
            assert!(
                order.is_some_and(|order| order > run.least_order),
                "{material}, {frame}: {order:.2?}"
            );
        }
    }
}

#[test]
fn every_fault_in_a_law_is_listed() {
    let first = Fault::XpicSign as usize + 1;
    let mut listed: Vec<usize> = FAULTS.iter().map(|(fault, _)| *fault as usize).collect();
    listed.sort_unstable();
    listed.dedup();
    let all: Vec<usize> = (first..=Fault::StatedSign as usize).collect();
    assert_eq!(listed, all, "the last fault is the last of the list");
}
