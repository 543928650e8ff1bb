//! Faults planted in the fields, one at a time: the check of the fields must catch every one, and none where there is
//! none. Each is a mistake of the kind that published codes carry.

#![allow(clippy::unwrap_used)]

use mmsmith_codegen::Fault;
use mmsmith_expr::{Derivatives, Expr, Function, Graph, Node, Rational};
use mmsmith_interpret::interpret_fields;
use mmsmith_spec::{Fields, Spec};
use mmsmith_tests::workspace;
use mmsmith_verify::{CheckReport, Verdict, check};
use std::collections::BTreeMap;

const POINTS: usize = 40;

const LAW: &str = "law = 'neo-hookean'";

type Plant = fn(&Spec, &mut Fields);

/// The name, the solution that it is planted in, and how.
const FAULTS: &[(&str, &str, Plant)] = &[
    ("b with the sign flipped", "skew-2d", |s, f| published(Fault::BodyForceSign, s, f)),
    ("one component of b with the sign flipped", "skew-3d", |_, f| f.b[2] = f.graph.neg(f.b[2])),
    ("components of b exchanged", "skew-2d", |s, f| published(Fault::BodyForceExchanged, s, f)),
    ("b without inertia", "skew-2d", |s, f| published(Fault::BodyForceWithoutInertia, s, f)),
    ("b without the stress", "skew-2d", |s, f| published(Fault::BodyForceWithoutStress, s, f)),
    ("b never applied", "skew-2d", |_, f| f.b = vec![Graph::ZERO; 2]),
    ("b per volume instead of mass", "skew-2d", |s, f| published(Fault::BodyForcePerVolume, s, f)),
    ("b per current volume", "skew-2d", |s, f| published(Fault::BodyForcePerCurrentVolume, s, f)),
    ("b a millionth too large", "skew-3d", |_, f| {
        for i in 0..3 {
            f.b[i] = scaled(&mut f.graph, f.b[i], (1_000_001, 1_000_000));
        }
    }),
    ("b at another time by a thousandth of a second", "skew-2d", |_, f| {
        for i in 0..2 {
            f.b[i] = later(&mut f.graph, f.b[i], (1, 1000));
        }
    }),
    ("b at the current position instead of X", "skew-2d", |s, f| {
        published(Fault::BodyForceAtCurrentPosition, s, f)
    }),
    ("the divergence over the first index of P", "skew-2d", wrong_divergence),
    ("one term of the divergence with the wrong derivative", "skew-3d", |spec, f| {
        let term = derivative(f, f.P[0][1], "Y");
        let wrong = derivative(f, f.P[0][1], "Z");
        let difference = f.graph.sub(term, wrong);
        let difference = f.graph.div(difference, spec.density);
        f.b[0] = f.graph.add(f.b[0], difference);
    }),
    ("one term of the divergence dropped", "skew-3d", |spec, f| {
        let term = derivative(f, f.P[1][2], "Z");
        let term = f.graph.div(term, spec.density);
        f.b[1] = f.graph.add(f.b[1], term);
    }),
    ("the hoop stress left out of the radial balance", "ring-nu", |spec, f| {
        // (P_RR - P_TT)/R, on the line where R = X.
        let (X, Y) = (f.graph.symbol("X"), f.graph.symbol("Y"));
        let R = f.graph.symbol("R");
        let difference = f.graph.sub(f.P[0][0], f.P[1][1]);
        for (i, coordinate) in [X, Y].into_iter().enumerate() {
            let factors = [difference, coordinate];
            let product = f.graph.product_of(factors);
            let lower = f.graph.product_of([R, R, spec.density]);
            let term = f.graph.div(product, lower);
            f.b[i] = f.graph.add(f.b[i], term);
        }
    }),
    ("b of P transposed", "skew-2d", |s, f| published(Fault::BodyForceOfTransposedStress, s, f)),
    ("b of the Kirchhoff stress", "ring-nu", |s, f| {
        published(Fault::BodyForceOfKirchhoffStress, s, f)
    }),
    ("b of density one", "ring-nu", |s, f| published(Fault::BodyForceOfDensityOne, s, f)),
    ("lambda for mu", "vortex", |s, f| published(Fault::LameExchanged, s, f)),
    ("lambda of plane stress", "skew-2d", |s, f| published(Fault::LameOfPlaneStress, s, f)),
    ("P transposed", "skew-2d", |s, f| published(Fault::StressTransposed, s, f)),
    ("P transposed in space", "skew-3d", |s, f| published(Fault::StressTransposed, s, f)),
    ("P with the sign flipped", "axis-aligned", |s, f| published(Fault::StressSign, s, f)),
    ("Kirchhoff stress for P", "skew-2d", |s, f| published(Fault::StressKirchhoff, s, f)),
    ("Cauchy stress for P", "skew-2d", |s, f| published(Fault::StressCauchy, s, f)),
    ("an entry of P dropped", "skew-3d", |_, f| f.P[2][0] = Graph::ZERO),
    ("J - 1 for ln J", "axis-aligned", |_, f| {
        for entry in f.P.iter_mut().flatten() {
            let calls: Vec<(Expr, Expr)> = f
                .graph
                .reachable(&[*entry])
                .into_iter()
                .filter_map(|e| match f.graph.node(e) {
                    // ln J, from J - 1 alone or from both.
                    Node::Call(Function::Ln1p | Function::LnOfBoth, arguments) => {
                        Some((e, arguments[0]))
                    }
                    _ => None,
                })
                .collect();
            *entry = f.graph.replace(*entry, &calls.into_iter().collect());
        }
    }),
    ("lambda for mu", "skew-2d", |spec, f| {
        rederive(spec, f, LAW, "law = 'neo-hookean'\nmu = 'E*nu/((1 + nu)*(1 - 2*nu))'")
    }),
    ("mu without its half", "skew-2d", |spec, f| {
        rederive(spec, f, LAW, "law = 'neo-hookean'\nmu = 'E/(1 + nu)'")
    }),
    ("lambda with a sign wrong", "skew-2d", |spec, f| {
        rederive(spec, f, LAW, "law = 'neo-hookean'\nlambda = 'E*nu/((1 + nu)*(1 + 2*nu))'")
    }),
    ("mu a millionth too large", "skew-2d", |spec, f| {
        rederive(spec, f, LAW, "law = 'neo-hookean'\nmu = '1.000001*E/(2*(1 + nu))'")
    }),
    ("plane stress for plane strain", "skew-2d", |spec, f| {
        rederive(spec, f, LAW, "law = 'neo-hookean'\nlambda = 'E*nu/(1 - nu^2)'")
    }),
    ("the density a millionth off", "skew-2d", |spec, f| {
        rederive(spec, f, LAW, "law = 'neo-hookean'\ndensity = '1.000001*rho0'")
    }),
    ("another law of the same moduli", "skew-2d", |spec, f| {
        rederive(spec, f, LAW, "law = 'hencky'")
    }),
    ("another amplitude in the stresses", "skew-2d", |spec, f| {
        let (u, v, a) = (f.u.clone(), f.v.clone(), f.a.clone());
        rederive(spec, f, "X = 'A*sin(3*X", "X = '1.0000001*A*sin(3*X");
        (f.u, f.v, f.a) = (u, v, a);
    }),
    ("a constant cut to single precision", "axis-aligned", |_, f| {
        let pi = f.graph.pi();
        let cut = f.graph.number(Rational::new(13_176_795.into(), 4_194_304.into()));
        for i in 0..2 {
            f.b[i] = f.graph.replace(f.b[i], &BTreeMap::from([(pi, cut)]));
        }
    }),
    ("u for v", "skew-2d", |_, f| f.v = f.u.clone()),
    ("v for a", "skew-2d", |_, f| f.a = f.v.clone()),
    ("a with the sign flipped", "axis-aligned-3d", |s, f| published(Fault::AccelerationSign, s, f)),
    ("v without the factor of the chain rule", "bar", |spec, f| {
        f.v[0] = f.graph.div(f.v[0], spec.wave_speed)
    }),
    ("v a millisecond late", "skew-2d", |_, f| {
        for i in 0..2 {
            f.v[i] = later(&mut f.graph, f.v[i], (1, 1000));
        }
    }),
    ("the other phase of the motion", "axis-aligned", |_, f| f.u.swap(0, 1)),
    ("H transposed", "skew-2d", |_, f| {
        let (xy, yx) = (f.H[0][1], f.H[1][0]);
        (f.H[0][1], f.H[1][0]) = (yx, xy);
    }),
    ("H without its shear", "skew-2d", |_, f| f.H[0][1] = Graph::ZERO),
    ("H symmetrised", "skew-2d", |_, f| {
        let sum = f.graph.add(f.H[0][1], f.H[1][0]);
        let half = scaled(&mut f.graph, sum, (1, 2));
        (f.H[0][1], f.H[1][0]) = (half, half);
    }),
    ("F = I - H", "axis-aligned", |_, f| {
        for i in 0..2 {
            f.F[i][i] = f.graph.sub(Graph::ONE, f.H[i][i]);
        }
    }),
    ("F transposed", "skew-3d", |_, f| {
        let (xz, zx) = (f.F[0][2], f.F[2][0]);
        (f.F[0][2], f.F[2][0]) = (zx, xz);
    }),
    ("J linearised", "axis-aligned", |s, f| published(Fault::JacobianLinear, s, f)),
    ("J without the shear", "skew-2d", |_, f| f.J = f.graph.mul(f.F[0][0], f.F[1][1])),
    ("b late by a hundredth of the period", "ring", |s, f| published(Fault::BodyForceLate, s, f)),
    ("v late by a hundredth of the period", "bar", |s, f| published(Fault::VelocityLate, s, f)),
    ("F and H transposed", "skew-3d", |s, f| published(Fault::GradientTransposed, s, f)),
    ("tractions dropped", "skew-2d", |s, f| published(Fault::TractionDropped, s, f)),
    ("tractions with the sign flipped", "skew-2d", |s, f| published(Fault::TractionSign, s, f)),
    ("a rim that is not free", "ring", |spec, f| {
        rederive(spec, f, "2*R + Ro - 3*Ri", "2.000001*R + Ro - 3*Ri")
    }),
    ("a wall that moves", "axis-aligned", |spec, f| {
        rederive(spec, f, "A*sin(Pi*X)", "A*sin(Pi*X + A/100)")
    }),
];

/// One of the faults that `mms gen` plants for users.
fn published(fault: Fault, spec: &Spec, fields: &mut Fields) {
    fault.plant(spec, fields).unwrap();
}

fn scaled(graph: &mut Graph, expr: Expr, (p, q): (i64, i64)) -> Expr {
    let factor = graph.number(Rational::new(p.into(), q.into()));
    graph.mul(factor, expr)
}

/// `expr` at a time later by `(p, q)`, a fraction of a second.
fn later(graph: &mut Graph, expr: Expr, (p, q): (i64, i64)) -> Expr {
    let t = graph.symbol("t");
    let delay = graph.number(Rational::new(p.into(), q.into()));
    let late = graph.add(t, delay);
    graph.replace(expr, &BTreeMap::from([(t, late)]))
}

fn derivative(fields: &mut Fields, expr: Expr, coordinate: &str) -> Expr {
    let X = fields.graph.symbol(coordinate);
    Derivatives::default().of(&mut fields.graph, expr, X)
}

/// Puts the divergence over the first index of `P` in place of that over the second, in two dimensions.
fn wrong_divergence(spec: &Spec, fields: &mut Fields) {
    for (i, J) in [(0, 1), (1, 0)] {
        let coordinate = ["X", "Y"][J];
        let right = derivative(fields, fields.P[i][J], coordinate);
        let wrong = derivative(fields, fields.P[J][i], coordinate);
        let difference = fields.graph.sub(right, wrong);
        let difference = fields.graph.div(difference, spec.density);
        fields.b[i] = fields.graph.add(fields.b[i], difference);
    }
}

/// The fields of a specification that says something else, in the graph of the right one, whose symbols and constants
/// the solution goes on to use.
fn rederive(spec: &Spec, fields: &mut Fields, right: &str, wrong: &str) {
    assert!(spec.source.contains(right), "{right}");
    let text = spec.source.replace(right, wrong);
    let wrong = Spec::parse(&text, "planted").unwrap().derive().unwrap();
    let graph = &mut fields.graph;
    let mut vector =
        |x: &[Expr]| -> Vec<Expr> { x.iter().map(|&e| moved(&wrong.graph, e, graph)).collect() };
    (fields.u, fields.v, fields.a) = (vector(&wrong.u), vector(&wrong.v), vector(&wrong.a));
    fields.b = vector(&wrong.b);
    fields.J = vector(&[wrong.J])[0];
    let mut matrix =
        |A: &[Vec<Expr>]| -> Vec<Vec<Expr>> { A.iter().map(|row| vector(row)).collect() };
    (fields.H, fields.F, fields.P) = (matrix(&wrong.H), matrix(&wrong.F), matrix(&wrong.P));
}

/// The expression in another graph.
fn moved(from: &Graph, expr: Expr, to: &mut Graph) -> Expr {
    let ast = mmsmith_expr::Ast::parse(&from.print(expr)).unwrap();
    to.build(&ast, &mut |graph, name| Ok(graph.symbol(name))).unwrap()
}

fn specification(name: &str) -> Spec {
    let path = workspace().join("mms-specs").join(name).with_extension("toml");
    Spec::parse(&std::fs::read_to_string(path).unwrap(), name).unwrap()
}

/// The worse report of `mms check`, of one with the defaults and one with other parameters.
fn judged(spec: &Spec, fields: &Fields) -> CheckReport {
    let usual: Vec<(&str, f64)> = Vec::new();
    let other: Vec<(&str, f64)> = spec
        .parameters
        .iter()
        .enumerate()
        .map(|(i, p)| (p.name.as_str(), p.default * (0.9 + 0.04 * i as f64)))
        .collect();
    let reports = [usual, other].map(|set| {
        let solution = interpret_fields(spec, fields.clone(), set).unwrap();
        check(&solution, POINTS).unwrap()
    });
    CheckReport::worst_of(reports.into())
}

#[test]
fn every_fault_in_the_fields_is_caught() {
    let mut missed = Vec::new();
    for (fault, name, plant) in FAULTS {
        let spec = specification(name);
        let mut fields = spec.derive().unwrap();
        plant(&spec, &mut fields);
        let report = judged(&spec, &fields);
        let caught: Vec<String> = report
            .findings
            .iter()
            .filter(|finding| finding.verdict == Verdict::Failed)
            .map(|finding| format!("{} against {}", finding.what, finding.against))
            .collect();
        println!("{fault} ({name}): {}", caught.join("; "));
        if caught.is_empty() {
            missed.push(*fault);
        }
    }
    assert!(missed.is_empty(), "not caught: {missed:?}");
}

#[test]
fn without_a_fault_nothing_fails() {
    let mut names: Vec<&str> = FAULTS.iter().map(|(_, name, _)| *name).collect();
    names.sort_unstable();
    names.dedup();
    for name in names {
        let spec = specification(name);
        let report = judged(&spec, &spec.derive().unwrap());
        let not_passed: Vec<_> =
            report.findings.iter().filter(|f| f.verdict != Verdict::Passed).collect();
        assert!(not_passed.is_empty(), "{name}: {not_passed:?}");
    }
}
