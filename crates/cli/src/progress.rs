//! A progress bar for long work, on standard error, and only where a person sees it.

use std::io::{IsTerminal, stderr};
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};
use mmsmith_verify::Progress;

use crate::terminal;

/// The bar counts thousandths, since work is known as a share.
const LENGTH: u64 = 1000;

/// A bar that nobody sees unless standard error is a terminal.
pub(crate) struct Bar {
    bar: ProgressBar,
    /// When it began, and the seconds that the work will take, where that is known from the start.
    expected: Option<(Instant, f64)>,
}

/// Until this share of the work is done, the prediction says how much time is left; then the work itself does.
const EARLY: f64 = 0.05;

impl Bar {
    pub(crate) fn new() -> Self {
        Self::expecting(None)
    }

    /// A bar that tells the time left from the start, for work that is predicted to take so many seconds.
    pub(crate) fn expecting(seconds: Option<f64>) -> Self {
        let bar = ProgressBar::new(LENGTH);
        if terminal::is_quiet() || !stderr().is_terminal() {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        let template = match seconds {
            None => "{msg} [{bar:30}] {percent}%, {eta} left",
            Some(_) => "{msg} [{bar:30}] {percent}%, {prefix} left",
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.enable_steady_tick(Duration::from_millis(500));
        let bar = Self { bar, expected: seconds.map(|seconds| (Instant::now(), seconds)) };
        if bar.expected.is_some() {
            bar.show_share(|| "starting".into(), 0.0);
        }
        bar
    }

    /// Shows how far the work is; `what` names the case under way.
    pub(crate) fn show(&self, what: &str, progress: Progress) {
        let steps = || format!("{what}, step {}/{}", progress.step, progress.steps);
        self.show_share(steps, progress.share);
    }

    /// Shows the share of the work that is done, with the message that `what` gives.
    pub(crate) fn show_share(&self, what: impl FnOnce() -> String, share: f64) {
        // Formatting a message costs more than some steps do.
        if self.bar.is_hidden() {
            return;
        }
        if let Some((begun, seconds)) = self.expected {
            let left = left(begun.elapsed().as_secs_f64(), seconds, share);
            self.bar.set_prefix(HumanDuration(left).to_string());
        }
        self.bar.set_message(what());
        self.bar.set_position((share * LENGTH as f64) as u64);
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// The time left.
fn left(elapsed_s: f64, predicted_s: f64, share: f64) -> Duration {
    let total = if share < EARLY { predicted_s.max(elapsed_s) } else { elapsed_s / share };
    Duration::try_from_secs_f64(total * (1.0 - share)).unwrap_or(Duration::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_predicted_first_and_measured_then() {
        let seconds = |elapsed, share| left(elapsed, 100.0, share).as_secs_f64();
        assert_eq!((seconds(0.0, 0.0), seconds(9.0, 0.04)), (100.0, 96.0));
        assert_eq!((seconds(50.0, 0.25), seconds(80.0, 1.0)), (150.0, 0.0));
    }
}
