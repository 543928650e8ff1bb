//! Maple's C listings: read, and built where they read.
#![no_main]

use libfuzzer_sys::fuzz_target;
use mmsmith_expr::Graph;
use mmsmith_claims::maple::Listing;

const NAMES: [&str; 9] = ["R", "H", "T", "E", "rho", "c1", "c2", "c3", "x"];

fuzz_target!(|text: &str| {
    match Listing::parse(text) {
        Ok(listing) => {
            let mut graph = Graph::new();
            let names = NAMES.map(|name| (name.to_owned(), graph.symbol(name))).into();
            if let Err(error) = listing.build(&mut graph, &names) {
                assert!(text.get(error.span.clone()).is_some(), "{error}");
            }
        }
        Err(error) => assert!(text.get(error.span.clone()).is_some(), "{error}"),
    }
});
