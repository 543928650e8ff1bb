//! Buffers that threads take for a while and give back: to set them up for each bin would cost some hundredths of a step.

use std::sync::{Mutex, PoisonError};

/// Buffers that no thread uses at present; at most one for each thread comes about.
pub(crate) struct Pool<B>(Mutex<Vec<Box<B>>>);

impl<B> Pool<B> {
    pub(crate) fn new() -> Self {
        Self(Mutex::new(Vec::new()))
    }

    /// A buffer as its last user left it, or a new one.
    pub(crate) fn take(&self, new: impl FnOnce() -> B) -> Box<B> {
        let left = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop();
        left.unwrap_or_else(|| Box::new(new()))
    }

    pub(crate) fn give_back(&self, buffer: Box<B>) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(buffer);
    }
}
