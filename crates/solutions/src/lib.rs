//! The library of manufactured solutions: one generated module for each file in `mms-specs/`, and all of [`mmsmith_runtime`], which
//! they are built on.
//!
//! The functions of all solutions are compiled in this crate, in both precisions, and not again by those who call them.

// Formatted by the generator; the formatter would differ in small things.
#[rustfmt::skip]
mod generated;

pub use generated::*;
pub use mmsmith_runtime::*;
