//! Specifications of manufactured solutions: from a TOML file to every derived field, in symbols.
//!
//! [`Spec::parse`] reads and checks the text; [`Spec::derive`] derives the displacement gradient, the stresses
//! and the body force from the displacement and the material. Errors in the text are [`Diagnostic`]s, which
//! show the line, mark the place and say what would be right.
//!
//! The derivation works in the specification's own coordinates, on physical components, and turns to Cartesian
//! components last: see [`Fields`].

mod boundary;
mod coordinates;
mod cross_check;
mod derivation;
mod derive;
mod diagnostic;
mod document;
mod law;
mod limits;
mod memory;
mod polynomial;
mod read;
mod rotation;
mod scope;
mod sense;
mod solve;
mod solver_law;
mod source;
mod spec;
mod surface;
mod tensor;
mod tube;
mod variation;

pub use coordinates::Coordinates;
pub use cross_check::{CrossCheck, InlineText, ListingText};
pub use derive::{DeriveError, Fields, HistoryFields};
pub use diagnostic::{Diagnostic, Looks, nearest};
pub use memory::{Given, InternalVariable};
pub use mmsmith_vocabulary::{Boundary, ComponentCondition, Condition, Form, Mixed, Surface};
pub use read::{LONGEST_FILE, ReadError, read_text};
pub use rotation::Rotation;
pub use solve::{Solved, SolvedCondition};
pub use spec::{Around, Bound, Domain, Law, Parameter, Relation, Requirement, Spec};
pub use surface::{Claim, ClaimKind, SurfaceFields};
pub use variation::Variation;
