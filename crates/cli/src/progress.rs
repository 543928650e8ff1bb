//! A progress bar for long work, on standard error, and only where a person sees it.

use std::io::{IsTerminal, stderr};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};
use mmsmith_verify::Progress;

use crate::terminal;

/// The bar counts thousandths, since work is known as a share.
const LENGTH: u64 = 1000;

/// A bar that nobody sees unless standard error is a terminal.
pub(crate) struct Bar {
    bar: ProgressBar,
    begun: Instant,
    /// The seconds that the work will take, where that is known from the start.
    predicted_s: Option<f64>,
    /// The share that was done when the bar was first told of one, and when: what was kept from before took no time now.
    first: OnceLock<(Duration, f64)>,
}

/// Until this share of the work is done, the prediction says how much time is left, if there is one; then the work itself
/// does.
const EARLY: f64 = 0.05;
/// From this share on the work tells the time left where nothing predicts it.
const TELLING: f64 = 0.005;

impl Bar {
    /// A bar over work called `name`.
    pub(crate) fn new(name: &str) -> Self {
        Self::expecting(name, None)
    }

    /// A bar that tells the time left from the start, for work that is predicted to take so many seconds.
    pub(crate) fn expecting(name: &str, predicted_s: Option<f64>) -> Self {
        let bar = ProgressBar::new(LENGTH);
        if terminal::is_quiet() || !stderr().is_terminal() {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        if let Ok(style) = ProgressStyle::with_template("{msg} [{bar:30}] {percent}%, {prefix}") {
            bar.set_style(style.progress_chars("=> "));
        }
        let bar = Self { bar, begun: Instant::now(), predicted_s, first: OnceLock::new() };
        bar.bar.set_message(name.to_owned());
        bar.bar.set_prefix(in_words(left(Duration::ZERO, predicted_s, 0.0)));
        // What the bar says is complete before it is first drawn.
        bar.bar.enable_steady_tick(Duration::from_millis(500));
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
        let elapsed = self.begun.elapsed();
        let (since, before) = *self.first.get_or_init(|| (elapsed, share));
        let time = match self.predicted_s {
            Some(_) => left(elapsed, self.predicted_s, share),
            None if before < 1.0 => {
                let done = (share - before) / (1.0 - before);
                left(elapsed.saturating_sub(since), None, done)
            }
            None => None,
        };
        self.bar.set_prefix(in_words(time));
        self.bar.set_message(what());
        self.bar.set_position((share * LENGTH as f64) as u64);
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// The time left; `None` where neither a prediction nor the share that is done can tell it.
fn left(elapsed: Duration, predicted_s: Option<f64>, share: f64) -> Option<Duration> {
    let elapsed_s = elapsed.as_secs_f64();
    let total_s = match predicted_s {
        Some(predicted_s) if share < EARLY => predicted_s.max(elapsed_s),
        None if share < TELLING => return None,
        _ => elapsed_s / share,
    };
    Some(Duration::try_from_secs_f64(total_s * (1.0 - share)).unwrap_or(Duration::MAX))
}

fn in_words(left: Option<Duration>) -> String {
    match left {
        Some(left) => format!("{} left", HumanDuration(left)),
        None => "estimating the time left".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seconds(elapsed_s: u64, predicted_s: Option<f64>, share: f64) -> Option<f64> {
        left(Duration::from_secs(elapsed_s), predicted_s, share).map(|left| left.as_secs_f64())
    }

    #[test]
    fn the_time_left_is_predicted_first_and_measured_then() {
        let predicted = |elapsed, share| seconds(elapsed, Some(100.0), share);
        assert_eq!((predicted(0, 0.0), predicted(9, 0.04)), (Some(100.0), Some(96.0)));
        assert_eq!((predicted(50, 0.25), predicted(80, 1.0)), (Some(150.0), Some(0.0)));
    }

    #[test]
    fn nothing_is_said_of_the_time_left_until_something_tells_it() {
        assert_eq!((seconds(0, None, 0.0), seconds(60, None, 0.001)), (None, None));
        assert_eq!(seconds(10, None, 0.25), Some(30.0));
        assert_eq!(in_words(None), "estimating the time left");
        assert_eq!(in_words(Some(Duration::from_secs(30))), "30 seconds left");
    }
}
