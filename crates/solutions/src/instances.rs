//! The library in double and in single precision, compiled with this crate.
//!
//! Builds that are hardly optimised share instances of generic code between crates: with these here, no command and no test
//! compiles all solutions once more. Optimised builds share none, and would only compile them twice.

use std::hint::black_box;

use crate::build;

#[used]
static INSTANCES: fn() = instances;

fn instances() {
    black_box(build::<f64> as fn(_, _) -> _);
    black_box(build::<f32> as fn(_, _) -> _);
}
