//! Reading of listings: accepted listings, and the message for each mistake.
#![allow(clippy::unwrap_used)]

use mmsmith_claims::maple::Listing;
use mmsmith_expr::{Function, Graph};
use proptest::prelude::*;
use std::collections::BTreeMap;

const PRINTED: &str = include_str!("../data/expanding-ring-as-printed.c");
const JOINED: &str = include_str!("../data/expanding-ring.c");
/// Blocks `name | listing | message | marked text`, one a line; `\n` in a listing is a line break, and `{functions}` in a
/// message stands for those of `math.h`.
const MISTAKES: &str = include_str!("../data/mistakes.txt");

fn built(text: &str, target: &str) -> String {
    let listing = Listing::parse(text).unwrap();
    let mut graph = Graph::new();
    let names: BTreeMap<_, _> =
        ["x", "y"].iter().map(|name| ((*name).to_owned(), graph.symbol(name))).collect();
    let built = listing.build(&mut graph, &names).unwrap();
    graph.print(built[target])
}

#[test]
fn what_is_accepted() {
    assert_eq!(built("t1 = x*x;\nb[0] = 12.0*t1/2.0;", "b[0]"), "6*x^2");
    assert_eq!(built("double t1 = pow(x, 0.5e1), t2;\n t2 = -t1; ;", "t2"), "-x^5");
    assert_eq!(built("const double t1 = sqrt(x)*asin(y); // root", "t1"), "sqrt(x)*arcsin(y)");
    assert_eq!(built("/* a\n b */ F[1][0] = x\n*\n-y;", "F[1][0]"), "-x*y");
    assert_eq!(built("double b[2]; b[0]=pi+0.1; b[1] = b[0]-Pi-M_PI+pi;", "b[1]"), "1/10");
    assert_eq!(built("t1 = x - -y - 2*0.0 + 1/3.0*3;", "t1"), "1 + x + y");
}

#[test]
fn mistakes_are_named_and_placed() {
    let functions: Vec<&str> = Function::ALL.iter().filter_map(|f| f.math_h()).collect();
    for block in MISTAKES.lines().filter(|line| !line.is_empty()) {
        let [name, text, message, marked] =
            <[&str; 4]>::try_from(block.split(" | ").collect::<Vec<_>>()).unwrap();
        let text = text.replace("\\n", "\n");
        let message = message.replace("{functions}", &functions.join(", "));
        let error = Listing::parse(&text).expect_err(name);
        assert_eq!(error.to_string(), message, "{name}");
        assert_eq!(&text[error.span], marked.replace("\\n", "\n"), "{name}");
    }
}

#[test]
fn slides_break_a_number() {
    let error = Listing::parse(PRINTED).unwrap_err();
    assert_eq!(
        error.to_string(),
        "a number seems to be broken across lines 29 and 30: join 6 and 8.0 to 68.0"
    );
    assert_eq!(&PRINTED[error.span], "6\n8.0");
}

/// Each message says what to join; doing that, again and again, leads to a listing that reads.
#[test]
fn messages_lead_to_the_joined_listing() {
    let mut text = PRINTED.to_owned();
    let mut joined = 0;
    while let Err(error) = Listing::parse(&text) {
        assert!(error.to_string().contains("seems to be broken across lines"), "{error}");
        let whole: String = text[error.span.clone()].split_whitespace().collect();
        text.replace_range(error.span, &whole);
        joined += 1;
        assert!(joined < 20);
    }
    assert_eq!(joined, 8);
    let value = |text: &str| Listing::parse(text).unwrap().assignments.len();
    assert_eq!(value(&text), value(JOINED));
}

#[test]
fn deep_nesting_and_length_are_refused() {
    for (open, close) in [("(", ")"), ("sin(", ")"), ("-", ""), ("-(", ")"), ("b[", "]")] {
        let n = 100_000 / open.len();
        let text = format!("t1 = {}x{};", open.repeat(n), close.repeat(n));
        let result = Listing::parse(&text);
        assert_eq!(result.is_ok(), open == "-");
    }
    let text = format!("t1 = {};", "(".repeat(1_000_000));
    assert_eq!(
        Listing::parse(&text).unwrap_err().to_string(),
        "a listing of 1000006 bytes; 262144 are the limit"
    );
    let text = format!("t1 = {};", "(".repeat(200_000));
    assert_eq!(Listing::parse(&text).unwrap_err().to_string(), "nested deeper than 100 levels");
}

#[test]
fn large_exponents_and_nested_derivatives_are_refused() {
    for exponent in ["1000000000", "1e9", "-1e9", "1000000000.5", "1e400"] {
        let text = format!("t1 = pow(x, {exponent});");
        let mut graph = Graph::new();
        let names = BTreeMap::from([("x".to_owned(), graph.symbol("x"))]);
        let message = match Listing::parse(&text) {
            Ok(listing) => listing.build(&mut graph, &names).unwrap_err().to_string(),
            Err(error) => error.to_string(),
        };
        assert!(message.contains("exponent") || message.contains("large"), "{text} {message}");
    }
    // A listing has no derivatives; the message says what it may have.
    let text = format!("t1 = {}x{};", "diff(".repeat(50), ", x)".repeat(50));
    let message = Listing::parse(&text).unwrap_err().to_string();
    assert!(message.contains("diff") && message.contains("pow"), "{message}");
}

/// Long chains of every operator: reading takes time in proportion to the length.
#[test]
fn long_listings_are_read_at_once() {
    for link in ["x/", "x*", "x+", "-", "2.0/", "+-x/", "x;t2=", "(x)*"] {
        let text = format!("t1 = {}x;", link.repeat(250_000 / link.len()));
        let _ = Listing::parse(&text);
    }
    let text = format!("t1 = {}{}1.0;", "-".repeat(100_000), "x/".repeat(70_000));
    assert!(Listing::parse(&text).is_ok());
}

/// Squares of squares: the text is short, the number is not.
#[test]
fn chains_of_temporaries_end_in_errors_or_finish() {
    for step in ["t@*t@", "t@+t@", "sin(t@)", "pow(t@, 3.0)", "1.0/(1.0+t@)", "t@/7.0+t@*t@"] {
        for start in ["3.0", "x"] {
            let mut text = format!("t0 = {start};\n");
            for i in 0..300 {
                text += &format!("t{} = {};\n", i + 1, step.replace('@', &i.to_string()));
            }
            let listing = Listing::parse(&text).unwrap();
            let mut graph = Graph::new();
            let names = BTreeMap::from([("x".to_owned(), graph.symbol("x"))]);
            // Either is right, as long as it comes soon.
            let _ = listing.build(&mut graph, &names);
        }
    }
}

fn read_and_build(text: &str) {
    match Listing::parse(text) {
        Ok(listing) => {
            let mut graph = Graph::new();
            let names = ["R", "H", "T", "E", "rho", "c1", "c2", "c3", "x"];
            let names = names.iter().map(|name| ((*name).to_owned(), graph.symbol(name))).collect();
            if let Err(error) = listing.build(&mut graph, &names) {
                assert!(text.get(error.span).is_some());
            }
        }
        Err(error) => assert!(text.get(error.span).is_some()),
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 2000,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn any_text(text in any::<String>()) {
        read_and_build(&text);
    }

    #[test]
    fn text_of_the_right_characters(text in r"[tbx0-9.eE+*/()\[\],;= \n-]{0,80}") {
        read_and_build(&text);
        read_and_build(&format!("t1 = {text};"));
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 200,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn mutated_listings(at in 0..JOINED.len(), length in 0..40_usize, inserted in r"[0-9a-z.+*/();=\n-]{0,6}") {
        let mut text = JOINED.to_owned();
        text.replace_range(at..(at + length).min(JOINED.len()), &inserted);
        read_and_build(&text);
    }
}
