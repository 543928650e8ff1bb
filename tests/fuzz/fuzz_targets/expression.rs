//! Expressions: read, built, printed, differentiated and lowered to a program.
//!
//! Every part of the input between quotation marks is one, so that specifications can seed the corpus.
#![no_main]

use libfuzzer_sys::fuzz_target;
use mmsmith_expr::{Ast, Dependence, Derivatives, Expr, Graph, Program};

const NAMES: [&str; 8] = ["X", "Y", "R", "theta", "t", "A", "E", "rho0"];

fn build(graph: &mut Graph, text: &str) -> Option<Expr> {
    let ast = Ast::parse(text)
        .inspect_err(|error| assert!(text.get(error.span.clone()).is_some(), "{error}"))
        .ok()?;
    graph
        .build(&ast, &mut |graph, name| {
            if NAMES.contains(&name) { Ok(graph.symbol(name)) } else { Err("unknown".into()) }
        })
        .inspect_err(|error| assert!(text.get(error.span.clone()).is_some(), "{error}"))
        .ok()
}

fuzz_target!(|text: &str| {
    for text in text.split(['\'', '"']) {
        let mut graph = Graph::new();
        let Some(expr) = build(&mut graph, text) else { continue };
        let printed = graph.print(expr);
        // What is printed can be read again.
        if let Some(again) = build(&mut graph, &printed) {
            let _ = graph.print(again);
        }
        let symbols = NAMES.map(|name| graph.symbol(name));
        let mut derivatives = Derivatives::limited();
        let first = derivatives.of(&mut graph, expr, symbols[0]);
        let second = derivatives.of(&mut graph, first, symbols[4]);
        if graph.is_overgrown() {
            continue;
        }
        let divides =
            [expr, first, second].into_iter().any(|expr| graph.divides_by_zero(expr));
        if !divides {
            let inputs = symbols.map(|symbol| (symbol, Dependence::default()));
            let program = Program::lower(&mut graph, &inputs, &[], &[expr, first, second]);
            let _ = program.evaluate(&[0.3, 0.7, 1.1, 0.2, 0.5, 0.1, 1e4, 1.0]);
        }
    }
});
