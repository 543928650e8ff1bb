//! The words that specifications, solutions and the solver share.
//!
//! [`Material`] is generic over its constants: expressions in a specification, numbers in a solution and in the solver. A law of
//! the library is one row of the table in the module `material`; from it follow the names in files and messages, the
//! constants with their meaning, and the moduli at small strain. A [`Condition`] is what holds on a [`Surface`] of a body.

#![forbid(unsafe_code)]

mod boundary;
mod law;
mod material;

pub use boundary::{Boundary, ComponentCondition, Condition, Form, Mixed, Surface};
pub use law::{
    Across, Components, Element, Flow, Internal, Law, Memory, Overstress, Response, Smoothness,
    Stated, WithMemory,
};
pub use material::{
    Constant, Derivation, InStretches, Material, Moduli, Row, Term, UnknownLaw, Volumetric,
};
