//! Rust source for manufactured solutions, from their specifications.
//!
//! [`items`] makes the items of one solution: a struct for its parameters, a struct for the solution and the
//! implementation of the trait `Solution`. The command `cargo xtask gen` writes them to files, through
//! [`module_source`] and [`registry_source`]; the macro `manufactured_solution!` puts them where it stands.
//! Both come from the same call, so they cannot differ.
//!
//! The output is deterministic to the byte. Text from a specification reaches it only as checked identifiers, as
//! numbers, and as string and doc literals, never as code.

mod function;
mod module;
mod plan;
mod text;

pub use module::{Names, items, module_source, registry_source};
pub use plan::Plan;
