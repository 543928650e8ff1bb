//! Arranging expressions in stages keeps their values and saves divisions.

use mmsmith_expr::{Ast, Dependence, Drafts, Expr, Graph, Operation, Program, Slot, arrange};
use proptest::prelude::*;

const POSITION: Dependence = Dependence { position: true, time: false };
const TIME: Dependence = Dependence { position: false, time: true };

struct Case {
    graph: Graph,
    inputs: Vec<(Expr, Dependence)>,
    expr: Expr,
}

/// An expression in the position `x`, the time `t` and the parameter `a`.
fn case(text: &str) -> Case {
    let mut graph = Graph::new();
    let inputs = [("x", POSITION), ("t", TIME), ("a", Dependence::default())]
        .map(|(name, dependence)| (graph.symbol(name), dependence))
        .to_vec();
    let ast = Ast::parse(text).unwrap_or_else(|e| panic!("{text}: {e}"));
    let expr = graph
        .build(&ast, &mut |graph, name| Ok(graph.symbol(name)))
        .unwrap_or_else(|e| panic!("{text}: {e}"));
    Case { graph, inputs, expr }
}

impl Case {
    fn programs(&mut self) -> (Program, Program) {
        let arranged =
            arrange(&mut self.graph, &self.inputs, &[], &mut Drafts::default(), &[self.expr]);
        (
            Program::lower(&mut self.graph, &self.inputs, &[], &[self.expr]),
            Program::lower(&mut self.graph, &self.inputs, &[], &arranged),
        )
    }
}

/// Expressions that are defined for inputs in [0.6, 1.4].
fn expression() -> impl Strategy<Value = String> {
    let leaf = prop_oneof![
        Just("x".to_owned()),
        Just("t".to_owned()),
        Just("a".to_owned()),
        Just("x*t".to_owned()),
        Just("cos(t)".to_owned()),
        (1..9_u32).prop_map(|n| n.to_string()),
    ];
    leaf.prop_recursive(4, 24, 3, |inner| {
        let pair = (inner.clone(), inner.clone());
        let roots = prop::sample::select(&["1/2", "-1/2", "3/2", "-7/3", "-2", "3"][..]);
        prop_oneof![
            pair.clone().prop_map(|(a, b)| format!("({a}) + ({b})")),
            pair.clone().prop_map(|(a, b)| format!("({a}) - ({b})")),
            pair.clone().prop_map(|(a, b)| format!("({a})*({b})")),
            pair.clone().prop_map(|(a, b)| format!("({a})/(2 + ({b})^2)")),
            pair.prop_map(|(a, b)| format!("({a})/(1 + ({b})^2) + ({b})/(1 + ({a})^2)")),
            (inner.clone(), roots).prop_map(|(a, n)| format!("(1 + ({a})^2)^({n})")),
            inner.prop_map(|a| format!("ln(1 + ({a})^2)")),
        ]
    })
}

proptest! {
    #[test]
    fn values_stay_and_no_division_is_added(
        text in expression(), x in 0.6..1.4, t in 0.6..1.4, a in 0.6..1.4,
    ) {
        let (before, after) = case(&text).programs();
        let (old, new) = (before.evaluate(&[x, t, a])[0], after.evaluate(&[x, t, a])[0]);
        prop_assume!(old.abs() < 1e6);
        prop_assert!((old - new).abs() <= 1e-9 * (1.0 + old.abs()), "{} gives {} and {}", text, old, new);
        let inner = |program: &Program| program.operations_by_stage(program.outputs()).both;
        prop_assert!(inner(&after).divisions <= inner(&before).divisions, "{}", text);
        prop_assert!(inner(&after).calls <= inner(&before).calls, "{}", text);
    }
}

proptest! {
    #[test]
    fn points_side_by_side_give_the_bits_of_each_alone(
        text in expression(), x in prop::array::uniform4(0.6..1.4), t in 0.6..1.4, a in 0.6..1.4,
    ) {
        let (program, _) = case(&text).programs();
        let position = |slot: &Slot| program.operations()[slot.index()] == Operation::Input(0);
        let x_alone: Vec<Slot> = program.slots().find(position).into_iter().collect();
        let kept = program.kept_at_points(program.outputs(), usize::MAX);
        let (at_points, of_parameters) = program.section(&kept, &x_alone);
        let (at_times, of_times) = program.section(program.outputs(), &kept);
        let mut rows = Vec::new();
        let uniform = of_parameters.evaluate(&[f64::NAN, f64::NAN, a]);
        let given = vec![x; x_alone.len()];
        let known: Vec<[f64; 4]> = at_points.run(&uniform, &given, &mut rows).copied().collect();
        let uniform = of_times.evaluate(&[f64::NAN, t, a]);
        let found: Vec<[f64; 4]> = at_times.run(&uniform, &known, &mut rows).copied().collect();
        for (n, &x) in x.iter().enumerate() {
            let alone = program.evaluate(&[x, t, a])[0];
            prop_assert_eq!(found[0][n].to_bits(), alone.to_bits(), "{} at {}", text, x);
        }
    }
}

/// As above, with roots and quotients of each rate of change beside fractions, and powers up to what is multiplied out and beyond.
#[test]
fn values_stay_with_powers_of_every_rate() {
    let at = [0.7, 1.2, 0.4];
    for base in ["(1 + x)", "(1 + t)", "(1 + a)", "(1 + x*t)", "(1 + a*x*t)"] {
        for exponent in ["1/2", "-1/2", "3/2", "-2", "2", "6", "7", "-7"] {
            for text in [
                format!("x*t/(1 + x*t) + {base}^({exponent})"),
                format!("x*t/(1 + x*t)*{base}^({exponent}) - t/(1 + x*t)^2 + a*x*t"),
                format!("(t + x/(1 + x*t))*(2*x + {base}^({exponent}))/(1 + x*t) + t"),
            ] {
                let (before, after) = case(&text).programs();
                let (old, new) = (before.evaluate(&at)[0], after.evaluate(&at)[0]);
                assert!((old - new).abs() <= 1e-12 * old.abs(), "{text} gives {old} and {new}");
            }
        }
    }
}

/// What does not depend on position and time is not computed where they meet.
#[test]
fn what_is_of_one_stage_stays_as_it_is() {
    for text in [
        "a*sin(t)/(1 + t) - t/(2 + a*t)",
        "2*t*(1 + a)",
        "a*x^2/(1 + x) + a*x/(1 + a*x)^2",
        "3*a*x",
        "a/(1 + a) - a^2",
    ] {
        let mut case = case(text);
        let outputs = [case.expr];
        let arranged =
            arrange(&mut case.graph, &case.inputs, &[], &mut Drafts::default(), &outputs);
        assert_eq!(arranged, outputs, "{text}");
    }
}

#[test]
fn fractions_share_one_denominator() {
    let mut case = case("x*cos(t) + a*cos(t)*x^3/(1 + x*cos(t)) - cos(t)*x^2/(1 + a*x*cos(t))^2");
    let (before, after) = case.programs();
    let (before, after) =
        (before.operations_by_stage(before.outputs()), after.operations_by_stage(after.outputs()));
    assert_eq!((before.both.divisions, after.both.divisions), (2, 1));
    assert_eq!(after.time.calls, 1);
    assert_eq!(after.both.calls, 0);
}

/// Below a quotient the factors are multiplied out where that saves operations.
#[test]
fn factors_over_a_quotient_are_one_polynomial() {
    let mut case = case("(1 + x*t)*(1 - x*t)/(2 + x*t)");
    let (before, after) = case.programs();
    let count = |program: &Program| program.operations_by_stage(program.outputs()).both;
    assert_eq!((count(&before).additions, count(&before).multiplications), (3, 2));
    assert_eq!((count(&after).additions, count(&after).multiplications), (2, 2));
    assert_eq!((count(&before).divisions, count(&after).divisions), (1, 1));
}

#[test]
fn what_cancels_identically_is_gone() {
    // 1 - h/(1 + h) = 1/(1 + h)
    let mut case = case("a*x - a*x*(x*t)/(1 + x*t) + a*x/(1 + x*t)");
    let (before, after) = case.programs();
    let count = |program: &Program| program.operations_by_stage(program.outputs()).both;
    assert_eq!(count(&after).divisions, 1);
    assert!(count(&after).total() <= count(&before).total());
}

#[test]
fn even_powers_of_a_defined_root_need_no_root() {
    let mut graph = Graph::new();
    let (x, y, r) = (graph.symbol("x"), graph.symbol("y"), graph.symbol("r"));
    let (xx, yy) = (graph.powi(x, 2), graph.powi(y, 2));
    let square = graph.add(xx, yy);
    let root = graph.sqrt(square);
    let fourth = graph.powi(r, 4);
    let program =
        Program::lower(&mut graph, &[(x, POSITION), (y, POSITION)], &[(r, root)], &[fourth]);
    let count = program.operations_by_stage(program.outputs());
    assert_eq!((count.point.square_roots, count.point.multiplications), (0, 3));
    assert_eq!(program.evaluate(&[1.0, 2.0]), [25.0]);
}

/// Quotients of one denominator and of its powers cost one division in all, by `R = sqrt(x^2 + 1)` not even after the root.
#[test]
fn several_quotients_share_a_reciprocal() {
    for (text, divisions, value) in [
        (
            "sin(x)/(1+x*t) + cos(x)/(1+x*t)^2 + x",
            1,
            (0.5_f64.sin() / 1.125) + 0.5_f64.cos() / (1.125 * 1.125) + 0.5,
        ),
        ("a*cos(t)/x^2 + sin(t)/x^4", 1, 0.75 * 0.25_f64.cos() / 0.25 + 0.25_f64.sin() / 0.0625),
        (
            "sin(t)/sqrt(x^2+1) + cos(t)/(x^2+1)",
            1,
            0.25_f64.sin() / 1.25_f64.sqrt() + 0.25_f64.cos() / 1.25,
        ),
        ("sin(t)/(x+1)", 1, 0.25_f64.sin() / 1.5),
    ] {
        let mut case = case(text);
        let program = Program::lower(&mut case.graph, &case.inputs, &[], &[case.expr]);
        let count = program.operations_by_stage(program.outputs());
        let found = count.time.divisions + count.point.divisions + count.both.divisions;
        assert_eq!(found, divisions, "{text}: {:?}", program.operations());
        let result = program.evaluate(&[0.5, 0.25, 0.75])[0];
        assert!((result - value).abs() <= 1e-15 * value.abs(), "{text}: {result}, not {value}");
    }
}

/// Whatever the powers, one reciprocal serves all of them, and the values are those of the quotients.
#[test]
fn any_powers_share_a_reciprocal() {
    let (x, t) = (1.3_f64, 0.7_f64);
    for (base, value) in [("x", x), ("(x + t)", x + t), ("sqrt(x^2 + 1)", (x * x + 1.0).sqrt())] {
        for (m, n) in (1..8).flat_map(|n| (1..n).map(move |m| (m, n))) {
            let text = format!("sin(t)/{base}^{m} + cos(t)*exp(x)/{base}^{n}");
            let mut case = case(&text);
            let program = Program::lower(&mut case.graph, &case.inputs, &[], &[case.expr]);
            let count = program.operations_by_stage(program.outputs());
            let found = count.time.divisions + count.point.divisions + count.both.divisions;
            assert_eq!(found, 1, "{text}: {:?}", program.operations());
            let expected = t.sin() / value.powi(m) + t.cos() * x.exp() / value.powi(n);
            let result = program.evaluate(&[x, t, 0.0])[0];
            assert!((result / expected - 1.0).abs() < 1e-14, "{text}: {result}, not {expected}");
        }
    }
}

/// Where all denominators are powers of a square that is at hand, the reciprocal is that of the square: two products for its
/// powers and two for the numerators, beside the square itself.
#[test]
fn the_reciprocal_is_of_the_greatest_common_power() {
    let mut case = case("t + sin(t)/x^4 + cos(t)/x^6");
    let program = Program::lower(&mut case.graph, &case.inputs, &[], &[case.expr]);
    let count = program.operations_by_stage(program.outputs());
    assert_eq!((count.point.divisions, count.both.divisions), (1, 0));
    assert_eq!((count.point.multiplications, count.both.multiplications), (3, 2));
}

/// A factor of some terms of a sum is multiplied once.
#[test]
fn terms_with_a_common_factor_are_gathered() {
    let mut case = case("a*sin(x) + a*cos(x) + x*t*sin(t) + x*t*cos(x)");
    let program = Program::lower(&mut case.graph, &case.inputs, &[], &[case.expr]);
    let count = program.operations_by_stage(program.outputs());
    let products =
        count.point.multiplications + count.both.multiplications + count.time.multiplications;
    assert_eq!(products, 3, "{:?}", program.operations());
}

/// `h^2/(1+h)/x` is formed from `h`, which is computed anyway.
#[test]
fn products_within_products_are_used() {
    let mut case = case("a*sin(t)*x^3");
    let h = case.expr;
    let one_more = case.graph.add(Graph::ONE, h);
    let x = case.inputs[0].0;
    let square = case.graph.mul(h, h);
    let over = case.graph.mul(one_more, x);
    let quotient = case.graph.div(square, over);
    let outputs = [quotient, one_more];
    let reused =
        mmsmith_expr::reuse(&mut case.graph, &case.inputs, &[], &mut Drafts::default(), &outputs);
    assert_ne!(reused, outputs);
    let total = |graph: &mut Graph, outputs: &[Expr]| {
        let program = Program::lower(graph, &case.inputs, &[], outputs);
        let count = program.operations_by_stage(program.outputs());
        let total =
            count.fixed.total() + count.time.total() + count.point.total() + count.both.total();
        (total, program.evaluate(&[0.5, 0.25, 0.75]))
    };
    let (before, values) = total(&mut case.graph, &outputs);
    let (after, same) = total(&mut case.graph, &reused);
    assert!(after < before, "{after} operations, {before} before");
    for (a, b) in values.iter().zip(&same) {
        assert!((a - b).abs() <= 1e-15 * a.abs(), "{same:?}, not {values:?}");
    }
}

/// The reciprocals of the factors of a product whose logarithm is taken come from that of the product, unless one of
/// them has another rate, or a factor depends on a quotient by another.
#[test]
fn factors_of_a_product_whose_logarithm_is_taken_share_its_reciprocal() {
    let (x, t) = (0.5_f64, 0.25_f64);
    let (f, g, h) = (1.0 + x * t, 2.0 + x * t, 3.0 + x * t);
    let (F, G, H) = ("(1 + x*t)", "(2 + x*t)", "(3 + x*t)");
    for (text, divisions, value) in [
        (format!("lnboth(x, {F}*{G}) + x/{F} + t/{G}"), 1, x / f + t / g),
        (format!("lnboth(x, {F}*{G}*{H}) + x/{F} + t/{G} + 1/{H}"), 1, x / f + t / g + 1.0 / h),
        (format!("lnboth(x, {F}*{G}*{H}) + x/{F} + 1/{H}"), 1, x / f + 1.0 / h),
        // A product without a logarithm may be as small as it likes.
        (format!("{F}*{G} + x/{F} + t/{G}"), 2, f * g + x / f + t / g),
        (format!("lnboth(x, {F}*{G}) + x/{F} + t/{H}"), 2, x / f + t / h),
        (format!("lnboth(x, {F}*{G}) + x/{F}"), 1, x / f),
        (format!("lnboth(x, {F}*(1 + t)) + x/{F} + t/(1 + t)"), 2, x / f + t / (1.0 + t)),
        (format!("lnboth(x, {F}*({G} + x/{F})) + t/({G} + x/{F})"), 2, t / (g + x / f)),
    ] {
        let mut case = case(&text);
        let program = Program::lower(&mut case.graph, &case.inputs, &[], &[case.expr]);
        let count = program.operations_by_stage(program.outputs());
        let found = count.time.divisions + count.point.divisions + count.both.divisions;
        assert_eq!(found, divisions, "{text}: {:?}", program.operations());
        let logarithm = if text.starts_with("lnboth") { x.ln_1p() } else { 0.0 };
        let (result, expected) = (program.evaluate(&[x, t, 0.0])[0], value + logarithm);
        assert!((result / expected - 1.0).abs() < 1e-14, "{text}: {result}, not {expected}");
    }
}
