//! Text that is made to hurt: it gets a value or a message, for a limited amount of work that is counted and not timed, on a
//! small stack, and never a panic.

#![allow(clippy::unwrap_used)]

use mmsmith_expr::{Ast, Dependence, Derivatives, Function, Graph, Program};
use proptest::prelude::*;

/// Runs on the stack that threads get by default, whatever stack the test itself has.
fn on_small_stack<T: Send + 'static>(run: impl FnOnce() -> T + Send + 'static) -> T {
    std::thread::Builder::new().stack_size(2 << 20).spawn(run).unwrap().join().unwrap()
}

/// The most that a graph may have done for one text, by [`Graph::work`]: twice what building may do before it is refused,
/// since a derivative and the lowering of both come on top.
const MOST_WORK: usize = 6 << 20;
/// The most operations of a program for one text: those of a sum of a mebibyte of text, and its derivative.
const MOST_OPERATIONS: usize = 1 << 20;

/// Takes `text` all the way to a derivative and a value. The message, where there is no value. The work is counted in
/// either case.
fn evaluate(text: &str) -> Result<f64, String> {
    let ast = Ast::parse(text).map_err(|e| {
        assert!(e.span.start <= e.span.end && e.span.end <= text.len(), "{:?}", e.span);
        assert!(text.get(e.span.clone()).is_some(), "the place splits a character");
        e.message
    })?;
    let mut graph = Graph::new();
    let value = value(&mut graph, text, &ast);
    let shown: String = text.chars().take(60).collect();
    assert!(graph.work() < MOST_WORK, "{shown}... took {} steps: {value:?}", graph.work());
    value
}

fn value(graph: &mut Graph, text: &str, ast: &Ast) -> Result<f64, String> {
    let names = ["x", "y", "t"];
    let symbols = names.map(|name| graph.symbol(name));
    let expr = graph
        .build(ast, &mut |graph, name| {
            if names.contains(&name) { Ok(graph.symbol(name)) } else { Err("unknown".into()) }
        })
        .map_err(|e| {
            assert!(text.get(e.span.clone()).is_some(), "{:?} is no place", e.span);
            e.message
        })?;
    let _ = graph.print(expr);
    let derivative = Derivatives::default().of(graph, expr, symbols[0]);
    if graph.divides_by_zero(expr) || graph.divides_by_zero(derivative) {
        return Err("division by zero".into());
    }
    let inputs = symbols.map(|symbol| (symbol, Dependence::default()));
    let program = Program::lower(graph, &inputs, &[], &[expr, derivative]);
    let operations = program.operations().len();
    assert!(operations < MOST_OPERATIONS, "{operations} operations");
    Ok(program.evaluate(&[0.3, 0.7, 1.1])[0])
}

/// As [`evaluate`], on a small stack.
fn evaluate_on_small_stack(text: String) -> Result<f64, String> {
    on_small_stack(move || evaluate(&text))
}

fn refused(text: impl Into<String>, message: &str) {
    let text = text.into();
    let shown: String = text.chars().take(60).collect();
    let found = evaluate_on_small_stack(text);
    assert!(found.as_ref().is_err_and(|m| m.contains(message)), "{shown}: {found:?}");
}

fn accepted(text: impl Into<String>, value: f64) {
    let text = text.into();
    let shown: String = text.chars().take(60).collect();
    let found = evaluate_on_small_stack(text).unwrap_or_else(|m| panic!("{shown}: {m}"));
    assert!(found == value || (found - value).abs() <= 1e-9 * value.abs(), "{shown}: {found}");
}

#[test]
fn nesting() {
    let million = 1_000_000;
    refused("(".repeat(million), "nested deeper");
    refused("(".repeat(million / 2) + "x" + &")".repeat(million / 2), "nested deeper");
    refused("(".repeat(million) + "x" + &")".repeat(million), "bytes");
    refused(")".repeat(million), "value is expected");
    refused("sin(".repeat(100_000) + "x" + &")".repeat(100_000), "nested deeper");
    refused("-(".repeat(100_000) + "x" + &")".repeat(100_000), "nested deeper");
    refused("x^(".repeat(100_000) + "x" + &")".repeat(100_000), "nested deeper");
    refused("diff(".repeat(100_000) + "x" + &",x)".repeat(100_000), "nested deeper");
    accepted("(".repeat(99) + "x" + &")".repeat(99), 0.3);
    accepted("-".repeat(million) + "x", 0.3);
    accepted("+".repeat(million) + "x", 0.3);
    accepted("-".repeat(million - 1) + "x", -0.3);
    refused("x^".repeat(million / 2) + "x", "ambiguous");
    refused("x*-".repeat(100_000) + "x", "value is expected");
}

#[test]
fn long_flat_text() {
    accepted("x+".repeat(100_000) + "x", 0.3 * 100_001.0);
    accepted("x*x-".repeat(100_000) + "x", 0.09 * (1.0 - 99_999.0) - 0.3);
    accepted("x*".repeat(100_000) + "x", 0.0);
    accepted("x/".repeat(100_000) + "x", f64::INFINITY);
    // Ones have no size.
    accepted("1*".repeat(100_000) + "x", 0.3);
    let different: Vec<String> = (1..=100_000).map(|i| format!("{i}")).collect();
    accepted(different.join("+"), 5_000_050_000.0);
    accepted(different.join("-"), 2.0 - 5_000_050_000.0);
    refused("y, ".repeat(100_000), "out of place");
    refused("atan2(".to_owned() + &"y, ".repeat(100_000) + "y)", "takes 2 argument(s)");
    refused("a".repeat(1 << 20), "unknown");
    refused(" ".repeat(1 << 20), "value is expected");
    refused(" ".repeat((1 << 20) + 1), "bytes");
}

/// Every term is a node of its own, which no rule may meet with a search through all others.
#[test]
fn many_different_terms() {
    let terms: Vec<String> = (1..=5_000).map(|i| format!("sin({i}*x)")).collect();
    assert!(evaluate_on_small_stack(terms.join("+")).is_ok());
    let terms: Vec<String> = (1..=5_000).map(|i| format!("(x+{i})*(y+{i})*x")).collect();
    assert!(evaluate_on_small_stack(terms.join("+")).is_ok());
}

/// Expressions of large parts, repeated many times, are too long, though text and result are short; expressions of deep parts are too deep.
#[test]
fn short_text_of_large_parts() {
    let mut graph = Graph::new();
    let symbols: Vec<_> = (0..1_000).map(|n| graph.symbol(&format!("x{n}"))).collect();
    let sum = graph.sum_of(symbols.iter().copied());
    let product = graph.product_of(symbols.iter().copied());
    let deep = |levels: usize| {
        move |graph: &mut Graph| {
            let x = graph.symbol("x");
            (0..levels).fold(x, |inner, _| graph.call(Function::Sin, &[inner]))
        }
    };
    let (below, above) = (deep(398)(&mut graph), deep(399)(&mut graph));
    let found = |text: String| {
        let mut graph = graph.clone();
        let ast = Ast::parse(&text).unwrap();
        let built = graph.build(&ast, &mut |_, name| match name {
            "sum" => Ok(sum),
            "product" => Ok(product),
            "below" => Ok(below),
            "above" => Ok(above),
            _ => Err("unknown".into()),
        });
        built.map(|_| ()).map_err(|error| error.message)
    };
    for (part, sign) in [("sum", "+"), ("sum", "-"), ("product", "*"), ("product", "/")] {
        let many = |count: usize| vec![part; count].join(sign);
        assert_eq!(found(many(200)), Ok(()), "{part} {sign}");
        assert!(found(many(2_000)).unwrap_err().contains("too long"), "{part} {sign}");
    }
    assert_eq!(found("sin(below)".into()), Ok(()));
    assert!(found("sin(above)".into()).unwrap_err().contains("nested deeper than 400"));
}

#[test]
fn sizes_of_numbers_and_exponents() {
    for exponent in ["1000000000", "1e9", "-1e9", "(10^9)", "9".repeat(300).as_str(), "1/1000003"] {
        let exponent =
            if exponent.contains('/') { format!("({exponent})") } else { exponent.into() };
        refused(format!("x^{exponent}"), "exponent");
        refused(format!("2^{exponent}"), "exponent");
        refused(format!("(x + y)^{exponent}"), "exponent");
    }
    refused("9".repeat(1_000_000), "are the limit");
    refused("1e1000000000", "exponent");
    refused("1e-99999999999999999999", "exponent");
    refused("0.".to_owned() + &"0".repeat(100_000) + "1", "are the limit");
    refused("1/0", "zero");
    refused("0^0", "zero");
    refused("1/(x - x)", "zero");
    refused("ln(0)", "logarithm");
    refused("sqrt(-1)", "negative");
    // Numbers that keep growing, by squares and by products.
    let mut tower = "9".repeat(300);
    for _ in 0..90 {
        tower = format!("({tower})^1000");
    }
    assert!(evaluate_on_small_stack(tower).is_ok());
    let product = vec!["9".repeat(300); 3_000].join("*");
    refused(product.clone(), "bits");
    refused(format!("x*{product}"), "bits");
    let primes: Vec<String> = (0..3_000).map(|i| format!("1/{}", 1_000_003 + 2 * i)).collect();
    refused(primes.join("+"), "bits");
    refused(vec!["1e399"; 10_000].join("*"), "bits");
    refused(format!("diff(exp(1e300*x){})", ", x".repeat(1_000)), "bits");
}

#[test]
fn derivatives_of_high_order() {
    for inner in ["tan(x)", "exp(sin(x))", "1/(1 + x^2)", "ln(x)*tan(x*y)", "sqrt(1 + sin(x)^2)"] {
        let many = format!("diff({inner}{})", ", x".repeat(50));
        let nested = "diff(".repeat(50) + inner + &", x)".repeat(50);
        for text in [many, nested] {
            match evaluate_on_small_stack(text) {
                Ok(_) => {}
                Err(message) => assert!(
                    ["subexpressions", "nested deeper", "too long", "bits"]
                        .iter()
                        .any(|limit| message.contains(limit)),
                    "{inner}: {message}"
                ),
            }
        }
    }
    accepted(format!("diff(sin(x){})", ", x".repeat(52)), 0.3_f64.sin());
    accepted(
        format!("diff(x^60{})", ", x".repeat(59)),
        (1..=60).map(f64::from).product::<f64>() * 0.3,
    );
    accepted(format!("diff(exp(2*x){})", ", x".repeat(1_000)), 2.0_f64.powi(1_000) * 0.6_f64.exp());
    refused("diff(x)", "at least one variable");
    refused("diff(x, 2)", "not an expression");
    refused("diff(x, x^2)", "not an expression");
    refused("diff()", "value is expected");
}

#[test]
fn characters() {
    for character in ['\0', '\u{1}', '\u{7f}', '\u{202e}', '\u{feff}', '\u{200b}', '"', '\\', ';'] {
        let (shown, message) = (character.escape_debug(), "no meaning");
        refused(format!("x + {character}"), message);
        refused(format!("{character}"), message);
        let found = evaluate(&format!("x{character}y")).unwrap_err();
        assert!(found.contains(&shown.to_string()), "{found}");
    }
    refused("\u{fc}", "not allowed in a name");
    refused("x\u{301}", "");
    refused("\u{ff11}", "");
    refused("\u{1d7d9}", "");
    accepted("x \u{2212} y", 0.3 - 0.7);
    accepted("x\u{b7}y", 0.21);
}

/// Pieces of expressions, so that most of what is made of them is nearly right.
const PIECES: [&str; 40] = [
    "x", "y", "t", "Pi", "0", "1", "2", "1/2", "3.5e3", "1e-300", "(", ")", "(", ")", "+", "-",
    "*", "/", "^", "**", ",", " ", "sin(", "cos(", "tan(", "exp(", "ln(", "log1p(", "sqrt(",
    "atan2(", "diff(", ", x)", ", t, t)", "(-2)", "(1/3)", "tanh(", "arcsin(", "x^2", "(x+y)",
    "\u{3c0}",
];

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn arbitrary_text(text in any::<String>()) {
        let _ = evaluate_on_small_stack(text);
    }

    #[test]
    fn nearly_expressions(pieces in prop::collection::vec(prop::sample::select(&PIECES[..]), 0..40)) {
        let _ = evaluate_on_small_stack(pieces.concat());
    }

    #[test]
    fn expressions(text in expression()) {
        let _ = evaluate_on_small_stack(text);
    }
}

/// Text that parses, with operations of every kind nested in each other.
fn expression() -> impl Strategy<Value = String> {
    let leaf =
        prop::sample::select(&["x", "y", "t", "Pi", "0", "1", "2", "7/3", "1e20", "0.1"][..])
            .prop_map(str::to_owned);
    leaf.prop_recursive(6, 40, 3, |inner| {
        let function =
            prop::sample::select(&["sin", "tan", "exp", "ln", "sqrt", "arctan", "cosh"][..]);
        let exponent = prop::sample::select(&["2", "-1", "(1/2)", "(-3/2)", "7", "x"][..]);
        prop_oneof![
            (inner.clone(), inner.clone()).prop_map(|(a, b)| format!("({a}) + ({b})")),
            (inner.clone(), inner.clone()).prop_map(|(a, b)| format!("({a}) - ({b})")),
            (inner.clone(), inner.clone()).prop_map(|(a, b)| format!("({a})*({b})")),
            (inner.clone(), inner.clone()).prop_map(|(a, b)| format!("({a})/({b})")),
            (inner.clone(), exponent).prop_map(|(a, n)| format!("({a})^{n}")),
            (function, inner.clone()).prop_map(|(f, a)| format!("{f}({a})")),
            (inner.clone(), inner.clone()).prop_map(|(a, b)| format!("atan2({a}, {b})")),
            inner.prop_map(|a| format!("diff({a}, x)")),
        ]
    })
}
