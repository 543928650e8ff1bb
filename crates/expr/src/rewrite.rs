//! Expressions of the same value in other forms: shorter ones, such that keep digits, and such that leave less to compute.

pub(crate) mod accuracy;
mod cancel;
pub(crate) mod constant;
mod exponential;
mod multiples;
mod near_zero;
mod polynomial;
mod pythagoras;
mod residue;
mod vanishing;

pub use cancel::Term;
pub use multiples::CosineAndSine;
