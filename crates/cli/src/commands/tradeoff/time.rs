//! The time of a sweep.

use std::time::{Duration, Instant};

use mmsmith_verify::{Repeat, Row, Setting};

/// The machine's clock, or one that a test holds.
pub(super) enum Time {
    /// Since then.
    Real(Instant),
    /// The work that runs have done.
    #[cfg(test)]
    Counted(super::tests::Counted),
}

impl Time {
    /// Seconds since the start.
    pub(super) fn now(&self) -> f64 {
        match self {
            Self::Real(started) => started.elapsed().as_secs_f64(),
            #[cfg(test)]
            Self::Counted(counted) => counted.now(),
        }
    }

    /// The end of a run that is given so many seconds.
    pub(super) fn until(&self, most_s: f64) -> Option<Instant> {
        match self {
            // Longer than any study: no limit.
            Self::Real(_) => Duration::try_from_secs_f64(most_s.max(0.0))
                .ok()
                .and_then(|duration| Instant::now().checked_add(duration)),
            #[cfg(test)]
            Self::Counted(_) => None,
        }
    }

    /// Looks on at a run that has ended.
    pub(super) fn ran(&self, _setting: &Setting, _row: &mut Row) {
        #[cfg(test)]
        if let Self::Counted(counted) = self {
            counted.ran(_setting, _row);
        }
    }

    /// Times of one more run, where they are known without it.
    pub(super) fn repeated(&self, _setting: &Setting) -> Option<Repeat> {
        match self {
            Self::Real(_) => None,
            #[cfg(test)]
            Self::Counted(counted) => Some(counted.repeated(_setting)),
        }
    }
}
