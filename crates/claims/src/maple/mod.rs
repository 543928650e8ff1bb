//! C listings as Maple's `CodeGeneration[C]` prints them, read into expressions, and compared with derived fields in high
//! precision.
//!
//! Authors of manufactured solutions publish the body force as such a listing: assignments to temporaries `t1`,
//! `t2`, ... and to the entries of an array, as `b[0] = -t4*t11*t12;`.
//!
//! 1. [`Listing::parse`] reads the text. Line breaks may stand between any two tokens; one inside of a number or a
//!    name, as slides and papers have them, is reported with the joined text.
//! 2. [`cross_check`] evaluates entries of the listing and the derived expressions in high precision at given
//!    points ([`sample`] draws some), and reports for each component the digits to which the two agree, or the worst
//!    point with both values.
//!
//! Agreement to 40 digits at random points verifies a listing, without a proof in symbols: two different closed forms
//! of this kind agree so at one random point with a probability that is nil. Numbers are exact as printed; a listing with pi as
//! `0.3141592653589793e1` agrees to 16 digits, and the report says so.
//!
//! ```
//! use mmsmith_expr::{Ast, Graph};
//! use mmsmith_claims::maple::{CrossCheck, Listing, Target, cross_check, sample};
//! use std::collections::BTreeMap;
//!
//! let mut graph = Graph::new();
//! let x = graph.symbol("X");
//! let derived = graph.build(&Ast::parse("sin(2*X)").unwrap(), &mut |_, _| Ok(x)).unwrap();
//! let listing = Listing::parse("t1 = sin(x); b[0] = 2.0*t1*cos(x);").unwrap();
//! let check = CrossCheck {
//!     graph: &graph,
//!     definitions: &[],
//!     listing: &listing,
//!     names: &BTreeMap::from([("x".into(), x)]),
//!     targets: &[Target { entry: "b[0]".into(), derived }],
//! };
//! let report = cross_check(&check, sample(&[(x, [0.0, 1.0])], 20, 1)).unwrap();
//! assert_eq!(report.to_string(), "b[0] verified to 60 digits at 20 points\n");
//! ```
//!
//! # The table of a specification
//!
//! A specification names its listings so that `mms check` can go through them:
//!
//! ```toml
//! [[cross-check]]
//! source = 'slides, closing listing'     # for messages
//! file = 'expanding-ring.c'              # beside the specification, or listing = '''t1 = pi*pi; ...'''
//! [cross-check.names]                    # names of the listing, as expressions of this specification
//! H = 'theta'
//! T = 'A*cos(c*Pi*t)'
//! rho = 'rho0'
//! ```
//!
//! Names that the table leaves out mean what they mean in the specification: parameters, `[let]` and coordinates.
//! Entries are `u[i]`, `v[i]`, `a[i]` and `b[i]`, Cartesian components, and `H`, `F` and `P` as `F[i][j]` or
//! `F[n*i + j]`. The check reports a line for each component, [`Component`]'s `Display`: `b[1] verified to 60 digits at 20 points`, or
//! `b[1] differs at X = ..., t = ...: the listing gives ..., the derivation ...`; a refuted component makes the check
//! fail. The call is [`cross_check`] with the names built by the specification's scope and the field's entries as
//! targets, made by this crate.

mod build;
mod cross_check;
mod error;
mod listing;
mod sample;
mod token;

pub use build::BuildError;
pub use cross_check::{
    Component, CrossCheck, CrossCheckError, Report, Target, Verdict, cross_check,
};
pub use error::{ListingError, Problem};
pub use listing::{Assignment, Listing};
pub use sample::sample;
