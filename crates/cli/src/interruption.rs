//! Ctrl-C, and what a batch system sends before it kills: what is under way ends in order.

use anyhow::Error;
use mmsmith_verify::{CaseError, StudyError};

use crate::{processes, progress, terminal};

/// The exit status of an interrupted command, as of any program that a shell interrupts.
pub(crate) const INTERRUPTED: u8 = 130;

/// From here on a signal that asks the process to end lets the simulations under way end after their step, with a checkpoint where
/// they keep any. Where none is, and at the second signal, the process ends at once.
///
/// For programs that handle no signals themselves; others call [`mmsmith_verify::interrupt`].
pub fn end_on_signals() {
    let mut asked = false;
    let handled = ctrlc::set_handler(move || {
        if std::mem::replace(&mut asked, true) || !mmsmith_verify::interrupt() {
            progress::clear();
            terminal::error("interrupted");
            std::process::exit(INTERRUPTED.into());
        }
        processes::tell_last_checkpoint();
    });
    // A process without a handler is ended by the signal itself, as ever.
    drop(handled);
}

/// Whether it is because of an interruption that a command failed.
pub(crate) fn is_interrupted(error: &Error) -> bool {
    let cause = |study: &StudyError| matches!(study.cause, CaseError::Interrupted { .. });
    error.chain().any(|error| {
        matches!(error.downcast_ref(), Some(CaseError::Interrupted { .. }))
            || error.downcast_ref().is_some_and(cause)
    })
}
