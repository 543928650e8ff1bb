//! The passes of a step by name, and the time that each takes.

use std::time::Instant;

use mmsmith_particles::{Pass, PassTime};

/// The times of passes, where they are wanted: some machines have no clock.
#[derive(Debug, Default)]
pub(crate) struct Passes(Option<Vec<PassTime>>);

impl Passes {
    /// Begins to take times.
    pub(crate) fn begin(&mut self) {
        self.0 = Some(Vec::new());
    }

    /// Before a pass.
    pub(crate) fn before(&self) -> Option<Instant> {
        self.0.is_some().then(Instant::now)
    }

    /// After a pass.
    pub(crate) fn after(&mut self, pass: Pass, begun: Option<Instant>) {
        if let (Some(times), Some(begun)) = (&mut self.0, begun) {
            let place = times.iter().position(|time| time.pass == pass).unwrap_or_else(|| {
                times.push(PassTime { pass, seconds: 0.0, calls: 0 });
                times.len() - 1
            });
            times[place].seconds += begun.elapsed().as_secs_f64();
            times[place].calls += 1;
        }
    }

    /// The passes that were done since then, in the order of a step.
    pub(crate) fn times(&self) -> Vec<PassTime> {
        let known = self.0.as_deref().unwrap_or_default();
        let of = |pass| known.iter().find(|time| time.pass == pass).copied();
        Pass::ALL.into_iter().filter_map(of).collect()
    }
}
