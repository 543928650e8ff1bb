//! An end from outside: what is stepping ends after its step.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

static ASKED: AtomicBool = AtomicBool::new(false);
/// Loops over steps that are under way.
static UNDER_WAY: AtomicUsize = AtomicUsize::new(0);

/// Asks all runs and studies of this process that are stepping to end: each does so after its step, with
/// [`CaseError::Interrupted`](crate::CaseError::Interrupted), and with a checkpoint where it keeps any. So does whatever begins
/// later, until [`allow`] is called. True where one is stepping; otherwise nothing is asked.
///
/// It may be called from any thread, such as one that handles signals.
pub fn interrupt() -> bool {
    let is_stepping = UNDER_WAY.load(Ordering::SeqCst) > 0;
    ASKED.fetch_or(is_stepping, Ordering::SeqCst);
    is_stepping
}

/// Takes [`interrupt`] back, for a process that goes on with other work.
pub fn allow() {
    ASKED.store(false, Ordering::SeqCst);
}

/// A loop over steps, for as long as it lives.
pub(crate) struct StepLoop;

impl StepLoop {
    pub(crate) fn begin() -> Self {
        UNDER_WAY.fetch_add(1, Ordering::SeqCst);
        Self
    }

    /// Whether it was asked to end.
    pub(crate) fn is_interrupted(&self) -> bool {
        ASKED.load(Ordering::Relaxed)
    }
}

impl Drop for StepLoop {
    fn drop(&mut self) {
        UNDER_WAY.fetch_sub(1, Ordering::SeqCst);
    }
}
