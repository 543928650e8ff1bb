//! Why there is no answer.

use serde_json::{Value, json};

/// A message, with its place where it is about one.
#[derive(Debug)]
pub(crate) struct Refusal(pub(crate) Value);

impl<E: std::fmt::Display> From<E> for Refusal {
    fn from(error: E) -> Self {
        Refusal(json!({ "message": error.to_string() }))
    }
}
