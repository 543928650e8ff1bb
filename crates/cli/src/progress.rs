//! A progress bar for long work, on standard error, and only where a person sees it.

use std::io::{IsTerminal, stderr};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use mmsmith_verify::Progress;

/// The bar counts thousandths, since work is known as a share.
const LENGTH: u64 = 1000;

/// A bar that nobody sees unless standard error is a terminal.
pub(crate) struct Bar(ProgressBar);

impl Bar {
    pub(crate) fn new() -> Self {
        let bar = ProgressBar::new(LENGTH);
        if !stderr().is_terminal() {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        let template = "{msg} [{bar:30}] {percent}%, {eta} left";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.enable_steady_tick(Duration::from_millis(500));
        Self(bar)
    }

    /// Shows how far the work is; `what` names the case under way.
    pub(crate) fn show(&self, what: &str, progress: Progress) {
        let steps = || format!("{what}, step {}/{}", progress.step, progress.steps);
        self.show_share(steps, progress.share);
    }

    /// Shows the share of the work that is done, with the message that `what` gives.
    pub(crate) fn show_share(&self, what: impl FnOnce() -> String, share: f64) {
        // Formatting a message costs more than some steps do.
        if self.0.is_hidden() {
            return;
        }
        self.0.set_message(what());
        self.0.set_position((share * LENGTH as f64) as u64);
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
