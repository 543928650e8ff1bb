//! Proofs that the fields of a solution keep the factor `K` of the acceptance rule over a whole box of inputs.
//!
//! A result `r` in double precision is accepted where `|r - g| <= K 2^-53 (s + |g|)`, with `g` the exact value and `s` the sum
//! of `|q dg/dq|` over the inputs. [`propagate`] bounds both sides over a box, [`search`] halves boxes until the bound holds on
//! each, and a [`Certificate`] keeps the halvings, with the program that was judged. An independent checker
//! (`mmsmith-certificate-checker`) evaluates each box anew.

mod certificate;
mod interval;
mod listing;
mod monomial;
pub mod propagate;
mod rounding;
mod scaling;
pub mod search;
mod subject;

pub use certificate::{Certificate, EntryProof, InputRange, certify};
pub use interval::Interval;
pub use rounding::Roundings;
pub use scaling::{Scaling, scalings};
pub use search::{STEPS_OF_FACTOR, letter};
pub use subject::{Judged, Subject};

use mmsmith_expr::Operation;
use thiserror::Error;

/// The reason why there is no certificate.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CertifyError {
    /// An operation that has no enclosure.
    #[error("the operation {0} has no enclosure in intervals yet")]
    Unsupported(String),
    /// The proof does not close.
    #[error("the bound of K is {} on the worst of the boxes that are left", .0.factor)]
    Open(search::Open),
    /// The fields could not be derived.
    #[error("{0}")]
    Derive(String),
    /// A range that is empty, or of an unknown input.
    #[error("{0}")]
    Range(String),
}

impl CertifyError {
    fn unsupported(operation: &Operation) -> Self {
        Self::Unsupported(listing::name(operation).into())
    }
}
