//! The published listing of the ring's body force against the derived one, and against itself with errors planted.
#![allow(clippy::unwrap_used)]

use mmsmith_claims::maple::{
    CrossCheck, CrossCheckError, Listing, Report, Target, Verdict, cross_check, sample,
};
use mmsmith_expr::{Ast, Expr, Rational};
use mmsmith_spec::{Fields, Spec};
use std::collections::BTreeMap;
use std::path::Path;

const LISTING: &str = include_str!("../data/expanding-ring.c");
/// Names of the listing and what they are in the specification.
const NAMES: &[(&str, &str)] = &[
    ("R", "R"),
    ("H", "theta"),
    ("T", "A*cos(sqrt(E/rho0)*Pi*t)"),
    ("E", "E"),
    ("rho", "rho0"),
    ("c1", "6*Ri*Ro/(Ro^2*(3*Ri - Ro))"),
    ("c2", "-3*(Ro + Ri)/(Ro^2*(3*Ri - Ro))"),
    ("c3", "2/(Ro^2*(3*Ri - Ro))"),
];
/// Planted errors: what is changed to what, and the components that it spoils.
const ERRORS: &[(&str, &str, &str)] = &[
    ("195.0*", "196.0*", "01"),
    ("30.0*t101", "-30.0*t101", "01"),
    ("+112.0*t94\n*t6*c1", "", "01"),
    ("b[1] = -t4*t11*t156-", "b[1] = -t4*t11*t156+", "1"),
    ("t3*E*T*t12*t125*t151/2.0", "t3*E*T*t12*t125*t151/2.0000000000000000000000000000000001", "0"),
    ("t3*E*T*t12*t125*t151/2.0", "t3*E*T*t12*t125*t151/2.0*0.0", "0"),
    ("b[2] = 0.0", "b[2] = 1.0e-300", "2"),
    ("t156 = sin(H)", "t156 = cos(H)", "1"),
];

struct Ring {
    fields: Fields,
    names: BTreeMap<String, Expr>,
    targets: Vec<Target>,
    points: Vec<Vec<(Expr, Rational)>>,
}

fn ring() -> Ring {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../mms-specs/ring.toml");
    let spec = Spec::parse(&std::fs::read_to_string(path).unwrap(), "ring.toml").unwrap();
    let mut fields = spec.derive().unwrap();
    let names = NAMES
        .iter()
        .map(|(name, text)| {
            let ast = Ast::parse(text).unwrap();
            let meaning = fields.graph.build(&ast, &mut |graph, name| Ok(graph.symbol(name)));
            ((*name).to_owned(), meaning.unwrap())
        })
        .collect();
    let b = fields.b.iter().copied().chain([mmsmith_expr::Graph::ZERO]);
    let targets =
        b.enumerate().map(|(i, derived)| Target { entry: format!("b[{i}]"), derived }).collect();
    let bounds = |name: &str| match name {
        "X" | "Y" => [0.4, 0.7],
        "t" => [0.0, 3.0],
        "A" => [0.05, 0.15],
        "E" => [0.5, 2.0],
        "rho0" => [0.5, 2.0],
        "Ri" => [0.45, 0.55],
        "Ro" => [0.9, 1.1],
        other => panic!("{other} has no bounds"),
    };
    let bounds: Vec<(Expr, [f64; 2])> = fields
        .inputs
        .iter()
        .map(|(e, _)| (*e, bounds(fields.graph.symbol_name(*e).unwrap())))
        .collect();
    let points = sample(&bounds, 12, 1).collect();
    Ring { fields, names, targets, points }
}

impl Ring {
    fn check(&self, text: &str) -> Result<Report, CrossCheckError> {
        let listing = Listing::parse(text).unwrap();
        let check = CrossCheck {
            graph: &self.fields.graph,
            definitions: &self.fields.definitions,
            listing: &listing,
            names: &self.names,
            targets: &self.targets,
        };
        cross_check(&check, self.points.clone())
    }
}

#[test]
fn the_specification_has_this_listing() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../mms-specs/ring.toml");
    let text = std::fs::read_to_string(path).unwrap();
    let (_, code) = LISTING.split_once("*/\n").unwrap();
    assert!(text.contains(&format!("listing = '''\n{code}'''")));
}

#[test]
fn published_listing_is_verified() {
    let report = ring().check(LISTING).unwrap();
    println!("{report}");
    assert!(report.verified(), "{report}");
    assert_eq!(report.unchecked, Vec::<String>::new());
    for component in &report.components {
        let Verdict::Verified { digits } = component.verdict else { panic!("{component}") };
        assert!(digits >= 59.0, "{component}");
    }
}

#[test]
fn planted_errors_are_refuted() {
    let ring = ring();
    for (right, wrong, spoilt) in ERRORS {
        assert_eq!(LISTING.matches(right).count(), 1, "{right}");
        let report = ring.check(&LISTING.replace(right, wrong)).unwrap();
        let refuted: String = report
            .components
            .iter()
            .filter(|c| matches!(c.verdict, Verdict::Refuted { .. }))
            .map(|c| c.entry.chars().nth(2).unwrap())
            .collect();
        assert_eq!(&refuted, spoilt, "{wrong}:\n{report}");
        println!("{wrong}:\n{report}");
    }
}

#[test]
fn a_missing_entry_and_an_unknown_name_are_named() {
    let ring = ring();
    let error = ring.check(&LISTING.replace("b[1]", "b[4]")).unwrap_err();
    assert_eq!(error.to_string(), "the listing assigns no b[1]; it assigns b[0], b[4], b[2]");
    let error = ring.check(&LISTING.replace("t3 = 1/rho", "t3 = 1/density")).unwrap_err();
    let names = "E, H, R, T, c1, c2, c3, rho";
    let message = format!("nothing says what 'density' is; the names given are {names}");
    assert_eq!(error.to_string(), message);
}
