//! A progress bar for long work, on standard error, and only where a person sees it; or reports to a program that called for the work.

use std::cell::{Cell, RefCell};
use std::fmt;
use std::io::{IsTerminal, stderr};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{
    HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle, WeakProgressBar,
};
use mmsmith_interpret::histories_followed;
use mmsmith_verify::Progress;

use crate::terminal;

/// The bar counts thousandths, since work is known as a share.
const LENGTH: u64 = 1000;

/// How far a piece of work is, for the thread that waits for it.
#[derive(Debug, Default)]
pub struct Watch {
    latest: Mutex<Latest>,
}

/// The last report, and when it was made.
#[derive(Debug, Default)]
struct Latest {
    report: Option<Report>,
    made: Option<Instant>,
}

/// How far a piece of work is.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// The share that is done, from zero to one.
    pub share: f64,
    /// The case under way.
    pub what: String,
}

/// Between two reports so much time passes: to form them costs more than some steps do.
const BETWEEN_REPORTS: Duration = Duration::from_millis(100);

thread_local! {
    /// The watch of the work that this thread does.
    static WATCH: RefCell<Option<Arc<Watch>>> = const { RefCell::new(None) };
}

impl Watch {
    /// The last report, unless it has been taken before.
    #[must_use]
    pub fn take(&self) -> Option<Report> {
        self.latest().report.take()
    }

    /// Does work whose bars report to this watch.
    pub(crate) fn over<R>(self: &Arc<Self>, work: impl FnOnce() -> R) -> R {
        watched(Some(Arc::clone(self)), work)
    }

    fn is_due(&self) -> bool {
        self.latest().made.is_none_or(|made| made.elapsed() >= BETWEEN_REPORTS)
    }

    fn report(&self, share: f64, what: String) {
        *self.latest() =
            Latest { report: Some(Report { share, what }), made: Some(Instant::now()) };
    }

    fn latest(&self) -> std::sync::MutexGuard<'_, Latest> {
        self.latest.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Work for another thread, watched as that of this thread is.
pub(crate) fn watched_as_here<R>(work: impl FnOnce() -> R) -> impl FnOnce() -> R {
    let watch = WATCH.with_borrow(Option::clone);
    move || watched(watch, work)
}

fn watched<R>(watch: Option<Arc<Watch>>, work: impl FnOnce() -> R) -> R {
    let before = WATCH.replace(watch);
    let result = work();
    WATCH.replace(before);
    result
}

/// A bar that nobody sees unless standard error is a terminal; or, of such a bar, the stretch that a part of the work fills.
pub(crate) struct Bar {
    line: Arc<Line>,
    /// The share of the whole at which this part begins and at which it ends.
    stretch: (f64, f64),
}

/// Bars that may be on the terminal.
static SHOWN: Mutex<Vec<WeakProgressBar>> = Mutex::new(Vec::new());

/// Takes all bars off the terminal, for a process that is about to end.
pub(crate) fn clear() {
    // A thread that is just adding a bar keeps the list; its bar has drawn nothing yet.
    for bar in SHOWN.try_lock().map(|mut bars| std::mem::take(&mut *bars)).unwrap_or_default() {
        if let Some(bar) = bar.upgrade() {
            bar.finish_and_clear();
        }
    }
}

/// The line on the terminal.
struct Line {
    bar: ProgressBar,
    watch: Option<Arc<Watch>>,
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
        // Before it is first drawn.
        let mut shown = SHOWN.lock().unwrap_or_else(PoisonError::into_inner);
        shown.retain(|bar| bar.upgrade().is_some());
        shown.push(bar.downgrade());
        drop(shown);
        if terminal::is_quiet() || !stderr().is_terminal() {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        if let Ok(style) =
            ProgressStyle::with_template("{wide_msg}{histories} [{bar:20}] {percent:>3}%, {prefix}")
        {
            let before = histories_followed();
            let told = move |_: &ProgressState, text: &mut dyn fmt::Write| {
                // What cannot be shown is left out.
                let _ = text.write_str(&histories(histories_followed() - before));
            };
            bar.set_style(style.progress_chars("=> ").with_key("histories", told));
        }
        let watch = WATCH.with_borrow(Option::clone);
        let line = Line { bar, watch, begun: Instant::now(), predicted_s, first: OnceLock::new() };
        line.bar.set_message(name.to_owned());
        line.bar.set_prefix(in_words(left(Duration::ZERO, predicted_s, 0.0)));
        // What the bar says is complete before it is first drawn.
        line.bar.enable_steady_tick(Duration::from_millis(500));
        Self { line: Arc::new(line), stretch: (0.0, 1.0) }
    }

    /// This bar for a part of its work, from one share of it to another.
    pub(crate) fn part(&self, from: f64, to: f64) -> Self {
        Self { line: Arc::clone(&self.line), stretch: (self.at(from), self.at(to)) }
    }

    /// The share of the whole bar at a share of this part.
    fn at(&self, share: f64) -> f64 {
        let (from, to) = self.stretch;
        from + share.clamp(0.0, 1.0) * (to - from)
    }

    /// Whether no terminal shows it.
    fn is_hidden(&self) -> bool {
        self.line.bar.is_hidden()
    }

    /// Does something with the bar out of the way, such as saying what was found.
    pub(crate) fn aside<R>(&self, work: impl FnOnce() -> R) -> R {
        self.line.bar.suspend(work)
    }

    /// Shows how far the work is; `what` names the case under way.
    pub(crate) fn show(&self, what: &str, progress: Progress) {
        let steps = || format!("{what}, step {}/{}", progress.step, progress.steps);
        self.show_share(steps, progress.share);
    }

    /// Shows the share of the work that is done, with the message that `what` gives.
    pub(crate) fn show_share(&self, what: impl FnOnce() -> String, share: f64) {
        let (line, share) = (&self.line, self.at(share));
        if let Some(watch) = line.watch.as_deref().filter(|watch| watch.is_due()) {
            return watch.report(share, what());
        }
        // Formatting a message costs more than some steps do.
        if self.is_hidden() {
            return;
        }
        let elapsed = line.begun.elapsed();
        let (since, before) = *line.first.get_or_init(|| (elapsed, share));
        let time = match line.predicted_s {
            Some(_) => left(elapsed, line.predicted_s, share),
            None if before < 1.0 => {
                let done = (share - before) / (1.0 - before);
                left(elapsed.saturating_sub(since), None, done)
            }
            None => None,
        };
        line.bar.set_prefix(in_words(time));
        line.bar.set_message(what());
        line.bar.set_position((share * LENGTH as f64) as u64);
    }
}

/// How many histories of particles were followed meanwhile, which bodies with memory need before they move; nothing of none.
fn histories(followed: u64) -> String {
    if followed == 0 { String::new() } else { format!(", {followed} histories of particles") }
}

impl Drop for Line {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// One bar over works that follow each other, each of which is predicted to take some seconds.
pub(crate) struct Agenda {
    whole: Bar,
    total_s: f64,
    begun_s: Cell<f64>,
}

impl Agenda {
    /// A bar over all of the work.
    pub(crate) fn new(total_s: f64) -> Self {
        Self {
            whole: Bar::expecting("the report", Some(total_s)),
            total_s,
            begun_s: Cell::new(0.0),
        }
    }

    /// The next work's part of the bar; it begins where the last one ends.
    pub(crate) fn next(&self, seconds: f64) -> Bar {
        let from = self.begun_s.get();
        self.begun_s.set(from + seconds);
        let share = |seconds: f64| if self.total_s > 0.0 { seconds / self.total_s } else { 0.0 };
        self.whole.part(share(from), share(from + seconds))
    }

    /// Does something with the bar out of the way.
    pub(crate) fn aside<R>(&self, work: impl FnOnce() -> R) -> R {
        self.whole.aside(work)
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
        // Never none while there is work.
        Some(left) => format!("{} left", HumanDuration(left.max(Duration::from_secs(1)))),
        None => "estimating".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seconds(elapsed_s: u64, predicted_s: Option<f64>, share: f64) -> Option<f64> {
        left(Duration::from_secs(elapsed_s), predicted_s, share).map(|left| left.as_secs_f64())
    }

    #[test]
    fn histories_are_told_where_there_are_any() {
        assert_eq!(histories(0), "");
        assert_eq!(histories(576), ", 576 histories of particles");
    }

    #[test]
    fn a_watch_is_told_of_the_work_under_it_alone_and_of_each_state_once() {
        let watch = Arc::new(Watch::default());
        watch.over(|| {
            let bar = Bar::new("two parts");
            bar.part(0.5, 1.0).show_share(|| "the second".into(), 0.5);
            // Too soon to be worth a message.
            bar.show_share(|| panic!("no message is formed"), 0.9);
            let elsewhere = watched_as_here(|| Bar::new("a part").line.watch.is_some());
            assert!(std::thread::scope(|scope| scope.spawn(elsewhere).join().is_ok_and(|is| is)));
        });
        assert_eq!(watch.take(), Some(Report { share: 0.75, what: "the second".into() }));
        assert_eq!(watch.take(), None);
        Bar::new("other work").show_share(|| "elsewhere".into(), 0.1);
        assert_eq!(watch.take(), None);
    }

    #[test]
    fn works_that_follow_each_other_fill_one_bar_by_their_predicted_times() {
        let agenda = Agenda::new(40.0);
        let [first, second, third] = [10.0, 25.0, 5.0].map(|seconds| agenda.next(seconds));
        assert_eq!((first.at(0.0), first.at(0.5), first.at(1.0)), (0.0, 0.125, 0.25));
        assert_eq!((second.at(0.0), second.at(1.0)), (0.25, 0.875));
        assert_eq!((third.at(0.0), third.at(1.0), third.at(7.0)), (0.875, 1.0, 1.0));
        // More work than was predicted stays at the end, and a part has parts of its own.
        assert_eq!(agenda.next(100.0).at(1.0), 1.0);
        assert_eq!(second.part(0.0, 0.5).at(1.0), 0.5625);
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
        assert_eq!(in_words(None), "estimating");
        assert_eq!(in_words(Some(Duration::from_secs(30))), "30 seconds left");
        assert_eq!(in_words(Some(Duration::ZERO)), "1 second left");
    }
}
