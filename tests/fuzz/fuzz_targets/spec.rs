//! Specifications: read, and derived where they read.
#![no_main]

use libfuzzer_sys::fuzz_target;
use mmsmith_spec::Spec;

fuzz_target!(|text: &str| {
    match Spec::parse(text, "fuzzed.toml") {
        Ok(spec) => {
            let _ = spec.derive();
        }
        Err(diagnostic) => {
            assert!(text.get(diagnostic.span.clone()).is_some(), "{}", diagnostic.message);
            // The message must also be possible to show.
            let _ = (diagnostic.line_and_column(), diagnostic.to_string());
        }
    }
});
