//! Source for manufactured solutions from their specifications, in the language of each host.
//!
//! Specifications are read by [`mmsmith_spec`], and [`mmsmith_stage`] decides which values are computed in which stage. A [`Code`] is a
//! solution with its fields in stages. [`HOSTS`] lists the languages and hosts for which it can be written; the Rust module and the C
//! header of the library are among them. All files compute the same values in the same order. The commands `cargo xtask gen` and `mms
//! gen` write files; the macro `manufactured_solution!` puts the Rust items where it stands.
//!
//! A language spells operations, literals, calls and operands (`target.rs`). The content and the head of a file are the same for all
//! languages (`listing.rs`), and so are the functions that hosts lack (`runtime.txt`).
//!
//! The output is deterministic to the byte. Text from a specification reaches it only as checked identifiers, as
//! numbers, and as string literals and comments, never as code.

mod c_names;
mod cause;
mod code;
mod fault;
mod listing;
mod names;
mod registry;
mod runtime;
mod rust;
mod table;
mod tabulated;
mod target;
mod targets;
mod text;

pub use cause::{CAUSES, Cause, Counter, Moved, Placed, Steps, Timed, Unused};
pub use code::{Code, Origin};
pub use fault::{Fault, NoEffect, UnknownFault};
pub use names::Names;
pub use registry::{NameClash, registry_source};
pub use rust::items;
pub use table::Tabulated;
pub use target::{Host, Unwritable};
pub use targets::HOSTS;
