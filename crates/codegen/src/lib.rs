//! Rust and C source for manufactured solutions, from their specifications.
//!
//! Specifications are read by [`mmsmith_spec`], and [`mmsmith_stage`] decides what is computed when. A [`Code`] is a solution
//! with its fields in stages, ready to be written down as the items of a Rust module, a struct for the parameters, a struct for the solution and the implementation of the trait
//! `Solution`, or as a C header with the same values in the same order. The command `cargo xtask gen` writes both to
//! files; the macro `manufactured_solution!` puts the Rust items where it stands.
//!
//! The output is deterministic to the byte. Text from a specification reaches it only as checked identifiers, as
//! numbers, and as string literals and comments, never as code.

mod code;
mod fault;
mod function;
mod header;
mod listing;
mod module;
mod runtime;
mod target;
mod targets;
mod text;

pub use code::{Code, Origin};
pub use fault::{Fault, NoEffect, UnknownFault};
pub use module::{NameClash, Names, items, registry_source};
pub use target::{Host, Unwritable};
pub use targets::HOSTS;
