//! Properties of the algebra: whatever the expression, printing reads back, canonical form keeps the value, and
//! derivatives agree with differences.

use mmsmith_expr::{Ast, Dependence, Derivatives, Expr, Graph, Program, Rational};
use proptest::prelude::*;

/// Expressions in `x` and `y` that are defined for `x` and `y` in [0.6, 1.4].
fn expression() -> impl Strategy<Value = String> {
    let leaf = prop_oneof![
        Just("x".to_owned()),
        Just("y".to_owned()),
        Just("Pi".to_owned()),
        (1..9_u32).prop_map(|n| n.to_string()),
        (1..9_u32, 2..9_u32).prop_map(|(n, d)| format!("{n}/{d}")),
        (1..99_u32).prop_map(|n| format!("0.{n}")),
    ];
    leaf.prop_recursive(5, 40, 4, |inner| {
        let pair = (inner.clone(), inner.clone());
        prop_oneof![
            pair.clone().prop_map(|(a, b)| format!("({a}) + ({b})")),
            pair.clone().prop_map(|(a, b)| format!("({a}) - ({b})")),
            pair.clone().prop_map(|(a, b)| format!("({a})*({b})")),
            pair.prop_map(|(a, b)| format!("({a})/(2 + ({b})^2)")),
            (inner.clone(), 1..5_i32).prop_map(|(a, n)| format!("({a})^{n}")),
            inner.clone().prop_map(|a| format!("sqrt(1 + ({a})^2)")),
            inner.clone().prop_map(|a| format!("sin({a})")),
            inner.clone().prop_map(|a| format!("cos(Pi*({a}))")),
            inner.clone().prop_map(|a| format!("exp(-({a})^2)")),
            inner.clone().prop_map(|a| format!("ln(1 + ({a})^2)")),
            inner.prop_map(|a| format!("arctan({a})")),
        ]
    })
}

fn build(graph: &mut Graph, text: &str) -> Expr {
    let ast = Ast::parse(text).unwrap_or_else(|e| panic!("{text}: {e} at {:?}", e.span));
    graph.build(&ast, &mut |g, name| Ok(g.symbol(name))).unwrap_or_else(|e| panic!("{text}: {e}"))
}

fn value(graph: &mut Graph, expr: Expr, x: f64, y: f64) -> f64 {
    let free = Dependence::default();
    let inputs = [(graph.symbol("x"), free), (graph.symbol("y"), free)];
    Program::lower(graph, &inputs, &[], &[expr]).evaluate(&[x, y])[0]
}

/// The value of the text, computed operation by operation as it is written, and the size of the largest
/// intermediate value, which scales the rounding error.
fn plain_value(ast: &Ast, x: f64, y: f64) -> (f64, f64) {
    use mmsmith_expr::AstKind;
    let sub = |ast: &Ast| plain_value(ast, x, y);
    let (value, size) = match &ast.kind {
        AstKind::Number(value) => (mmsmith_expr::nearest_f64(value), 0.0),
        AstKind::Name(name) => match name.as_str() {
            "x" => (x, 0.0),
            "y" => (y, 0.0),
            _ => (std::f64::consts::PI, 0.0),
        },
        AstKind::Sum(terms) => terms.iter().fold((0.0, 0.0), |(total, size), (minus, term)| {
            let (value, inner) = sub(term);
            (if *minus { total - value } else { total + value }, f64::max(size, inner))
        }),
        AstKind::Product(factors) => factors.iter().fold((1.0, 0.0), |(total, size), (over, f)| {
            let (value, inner) = sub(f);
            (if *over { total / value } else { total * value }, f64::max(size, inner))
        }),
        AstKind::Power(base, exponent) => {
            let ((base, a), (exponent, b)) = (sub(base), sub(exponent));
            (base.powf(exponent), a.max(b))
        }
        AstKind::Call(name, arguments) => {
            let (x, size) = sub(&arguments[0]);
            let value = match name.as_str() {
                "sin" => x.sin(),
                "cos" => x.cos(),
                "exp" => x.exp(),
                "ln" => x.ln(),
                "sqrt" => x.sqrt(),
                _ => x.atan(),
            };
            (value, size)
        }
    };
    (value, size.max(value.abs()))
}

proptest! {
    #[test]
    fn printing_reads_back_as_the_same_expression(text in expression()) {
        let mut graph = Graph::new();
        let expr = build(&mut graph, &text);
        let printed = graph.print(expr);
        prop_assert_eq!(build(&mut graph, &printed), expr, "{} printed as {}", text, printed);
    }

    #[test]
    fn canonical_form_keeps_the_value(text in expression(), x in 0.6..1.4, y in 0.6..1.4) {
        let mut graph = Graph::new();
        let expr = build(&mut graph, &text);
        let (expected, size) = plain_value(&Ast::parse(&text).unwrap(), x, y);
        prop_assume!(size < 1e6);
        let found = value(&mut graph, expr, x, y);
        prop_assert!((found - expected).abs() <= 1e-10 * (1.0 + size * size), "{} gives {} and {}", text, found, expected);
    }

    #[test]
    fn derivatives_agree_with_differences(text in expression(), x in 0.6..1.4, y in 0.6..1.4) {
        let mut graph = Graph::new();
        let expr = build(&mut graph, &text);
        let symbol = graph.symbol("x");
        let derivative = Derivatives::default().of(&mut graph, expr, symbol);
        let exact = value(&mut graph, derivative, x, y);
        // Central differences with two steps: the error of the larger one is estimated by the smaller one.
        let mut difference = |h: f64| {
            (value(&mut graph, expr, x + h, y) - value(&mut graph, expr, x - h, y)) / (2.0 * h)
        };
        let (coarse, fine) = (difference(2e-5), difference(1e-5));
        let size = plain_value(&Ast::parse(&text).unwrap(), x, y).1;
        prop_assume!(size < 1e4 && (coarse - fine).abs() < 1e-4 * (1.0 + exact.abs()));
        let tolerance = 4.0 * (coarse - fine).abs() + 1e-9 * (1.0 + size);
        prop_assert!((exact - fine).abs() <= tolerance, "d/dx {} = {}, not {}", text, fine, exact);
    }

    #[test]
    fn derivative_rules(a in expression(), b in expression()) {
        let mut graph = Graph::new();
        let (f, g) = (build(&mut graph, &a), build(&mut graph, &b));
        let x = graph.symbol("x");
        let mut derivatives = Derivatives::default();
        let (df, dg) = (derivatives.of(&mut graph, f, x), derivatives.of(&mut graph, g, x));
        let sum = graph.add(f, g);
        let product = graph.mul(f, g);
        let d_sum = derivatives.of(&mut graph, sum, x);
        let d_product = derivatives.of(&mut graph, product, x);
        let rule = { let (l, r) = (graph.mul(df, g), graph.mul(f, dg)); graph.add(l, r) };
        let sum_rule = graph.add(df, dg);
        for (expected, found) in [(sum_rule, d_sum), (rule, d_product)] {
            let (e, f) = (value(&mut graph, expected, 0.9, 1.1), value(&mut graph, found, 0.9, 1.1));
            prop_assume!(e.abs() < 1e6);
            prop_assert!((e - f).abs() <= 1e-7 * (1.0 + e.abs()), "{} and {}", e, f);
        }
    }

    #[test]
    fn any_text_is_answered_without_a_panic(text in "[ -~\u{3b1}-\u{3c9}]{0,60}") {
        if let Ok(ast) = Ast::parse(&text) {
            let mut graph = Graph::new();
            let _ = graph.build(&ast, &mut |g, name| Ok(g.symbol(name)));
        }
    }
}

/// Texts that are one expression in exact arithmetic are one in the canonical form, which never multiplies out.
#[test]
fn texts_that_are_the_same_expression() {
    let mut differ = Vec::new();
    for (a, b) in [
        // Like terms, content, common factors and terms that differ in one factor.
        ("2*x + 3*y - x - 3*y", "x"),
        ("6*x + 4*y", "2*(3*x + 2*y)"),
        ("x/6 - y/4", "-(3*y - 2*x)/12"),
        ("x*y + x*sin(y)", "x*(y + sin(y))"),
        ("x^2*y + x^3", "x^2*(y + x)"),
        ("sqrt(x)*y + x", "sqrt(x)*(y + sqrt(x))"),
        ("y/x + y^2/x^3", "y/x*(1 + y/x^2)"),
        ("sin(y)*(1 + x) + sin(y)*(2 - y)", "sin(y)*(3 + x - y)"),
        ("x*(1 + y) - x", "x*y"),
        ("5 + sin(y)*(1 + x) + sin(y)*(2 - y)", "5 + sin(y)*(3 + x - y)"),
        ("5 + x*(1 + y) - x", "5 + x*y"),
        ("5 - sqrt(x)*(1 + y) + 2*sqrt(x)", "5 + sqrt(x)*(1 - y)"),
        // Powers that are whole together, and roots that are exact.
        ("sqrt(x*y)*sqrt(x*y)", "x*y"),
        ("(x*y)^(1/3)*(x*y)^(2/3)", "x*y"),
        ("sqrt(2)*sqrt(2)*x", "2*x"),
        ("sqrt(3*x)^2", "3*x"),
        ("(8/27)^(1/3)", "2/3"),
        ("(4*x)^(-1/2)", "1/(2*sqrt(x))"),
        ("(x^2*y)^3/x^6", "y^3"),
        ("sqrt(sqrt(x))", "x^(1/4)"),
        ("(x^(1/3))^(1/2)", "x^(1/6)"),
        ("x^3/x^3*y", "y"),
        ("sqrt(x)^2", "x"),
        // Values that are known, and functions of what has a sign.
        ("sin(0) + tan(0) + arcsin(0) + arctan(0) + sinh(0) + tanh(0)", "0"),
        ("cos(0) + cosh(0) + exp(0)", "3"),
        ("ln(1) + log1p(0) + log1pmx(0) + expm1(0)", "0"),
        ("exp(ln(x*y))", "x*y"),
        ("ln(exp(x - y))", "x - y"),
        ("sin(-2*x) + tan(-x)", "-sin(2*x) - tan(x)"),
        (
            "arcsin(-x) + arctan(-3) + sinh(-x/2) + tanh(-x)",
            "-arcsin(x) - arctan(3) - sinh(x/2) - tanh(x)",
        ),
        ("cos(-2*x)*cosh(-y)", "cos(2*x)*cosh(y)"),
        ("sin(Pi/2) + sin(Pi) + sin(3*Pi/2) + sin(5*Pi/2)", "1"),
        ("cos(Pi/2) + cos(Pi) + cos(2*Pi) + cos(-7*Pi)", "-1"),
        ("lnratio2(0) + lnratio2_slope(0) - 3*lnratio2_curvature(0)", "1"),
        ("cosh_sqrt_m1(0) + cosh_sqrt_m1_slope(0) + 6*cosh_sqrt_m1_curvature(0)", "1"),
        ("positive_part(0) + positive_part_slope(0)", "0"),
        ("x^0", "1"),
        ("0^2*x", "0"),
    ] {
        let mut graph = Graph::new();
        let (first, second) = (build(&mut graph, a), build(&mut graph, b));
        if first != second {
            differ.push(format!("{a} = {}, {b} = {}", graph.print(first), graph.print(second)));
        }
    }
    assert!(differ.is_empty(), "{}", differ.join("\n"));
}

/// Texts that are equal for positive values only, or of which one has no value at zero, are two expressions.
#[test]
fn texts_that_are_not_the_same_expression() {
    for (a, b) in [
        ("sqrt(x^2)", "x"),
        ("sqrt(x*y)", "sqrt(x)*sqrt(y)"),
        ("sqrt(sqrt(x)*y)", "x^(1/4)*sqrt(y)"),
        ("sqrt(x^2*y)", "x*sqrt(y)"),
        ("(x^2)^(3/2)", "x^3"),
        ("arcsin(sin(x))", "x"),
        ("ln(x*y)", "ln(x) + ln(y)"),
        ("ln(x^2)", "2*ln(x)"),
    ] {
        let mut graph = Graph::new();
        let (first, second) = (build(&mut graph, a), build(&mut graph, b));
        assert_ne!(first, second, "{a} and {b}");
    }
}

/// Sums and products collect few operands in another way than many: the order in which they come must not matter to either,
/// nor to what goes over from one way to the other and back.
#[test]
fn many_operands_in_any_order() {
    let mut graph = Graph::new();
    let symbols: Vec<Expr> = (0..300).map(|n| graph.symbol(&format!("x{n}"))).collect();
    let one = || Rational::from_integer(1.into());
    for count in [3, 63, 64, 65, 66, 300] {
        let forth: Vec<Expr> = symbols[..count].to_vec();
        let back: Vec<Expr> = forth.iter().rev().copied().collect();
        let mixed: Vec<Expr> = (0..count).map(|n| symbols[n * 7 % count]).collect();
        let sum = graph.sum_of(forth.clone());
        assert_eq!(graph.sum_of(back.clone()), sum, "{count}");
        // No time anything is nothing, before the others and after.
        let zero = (one() - one(), symbols[299]);
        let terms = || forth[..count - 1].iter().map(|x| (one(), *x));
        let without = graph.sum(terms());
        assert_eq!(graph.sum([zero.clone()].into_iter().chain(terms())), without, "{count}");
        assert_eq!(graph.sum(terms().chain([zero])), without, "{count}");
        let product = graph.product_of(forth.clone());
        assert_eq!(graph.product_of(back), product, "{count}");
        if count % 7 != 0 {
            assert_eq!(graph.sum_of(mixed.clone()), sum, "{count}");
            assert_eq!(graph.product_of(mixed.clone()), product, "{count}");
        }
        // All but the first are taken away again, one by one.
        let terms =
            forth.iter().map(|x| (one(), *x)).chain(forth[1..].iter().map(|x| (-one(), *x)));
        assert_eq!(graph.sum(terms.collect::<Vec<_>>()), forth[0]);
        let factors =
            forth.iter().map(|x| (*x, one())).chain(forth[1..].iter().map(|x| (*x, -one())));
        assert_eq!(graph.product(factors.collect::<Vec<_>>()), forth[0]);
    }
}

/// Powers of numbers are numbers up to a size that may be reached and not be passed; what is no power has no such limit.
#[test]
fn sizes_of_powers() {
    let mut graph = Graph::new();
    let (x, two, half) = (graph.symbol("x"), graph.integer(2), graph.number(rational(1, 2)));
    for base in [two, half] {
        for (exponent, is_number) in [(8192, true), (-8192, true), (8193, false), (-8193, false)] {
            let power = graph.powi(base, exponent);
            assert_eq!(graph.as_number(power).is_some(), is_number, "{exponent}");
        }
    }
    let three_halves = graph.number(rational(3, 2));
    let power = graph.powi(three_halves, 8192);
    assert!(graph.as_number(power).is_some());
    // 4 has one bit more, and a root of 4 one less.
    let four = graph.integer(4);
    for (exponent, is_number) in [(rational(4096, 1), true), (rational(4097, 1), false)] {
        let power = graph.product([(four, exponent)]);
        assert_eq!(graph.as_number(power).is_some(), is_number);
    }
    let root = graph.product([(four, rational(8191, 2))]);
    assert!(graph.as_number(root).is_some());
    // One is one, and a factor is a coefficient.
    assert_eq!(graph.powi(Graph::ONE, i64::MAX), Graph::ONE);
    let large = Rational::from_integer(num_traits::pow(3.into(), 10_000));
    let number = graph.number(large.clone());
    let product = graph.mul(number, x);
    assert_eq!(product, graph.sum([(large, x)]));
    let quotient = graph.div(product, x);
    assert_eq!(quotient, number);
}

fn rational(numerator: i64, denominator: i64) -> Rational {
    Rational::new(numerator.into(), denominator.into())
}

#[test]
fn only_what_divides_by_zero_says_so_and_every_node_counts() {
    let mut graph = Graph::new();
    let (x, zero) = (graph.symbol("x"), graph.integer(0));
    let before = graph.len();
    let undefined = graph.div(x, zero);
    assert_eq!(graph.len(), before + 1);
    let sum = graph.add(undefined, x);
    assert!(graph.divides_by_zero(undefined) && graph.divides_by_zero(sum));
    let square = graph.powi(x, 2);
    assert!(!graph.divides_by_zero(x) && !graph.divides_by_zero(square));
    // A factor of both terms that cannot be set apart.
    let (y, minus_two) = (graph.symbol("y"), Rational::from(-2));
    let other = graph.product([(y, Rational::from(1)), (zero, minus_two)]);
    let both = graph.add(undefined, other);
    assert!(graph.divides_by_zero(both));
}
