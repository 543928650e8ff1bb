//! Processes in a grid that the user asks for.

use std::sync::Arc;

use crate::Ranks;

struct Arranged {
    ranks: Arc<dyn Ranks>,
    along_axes: Vec<usize>,
}

/// The processes, so many of them along each axis.
#[must_use]
pub fn arranged(ranks: Arc<dyn Ranks>, along_axes: Vec<usize>) -> Arc<dyn Ranks> {
    Arc::new(Arranged { ranks, along_axes })
}

impl Ranks for Arranged {
    fn rank(&self) -> usize {
        self.ranks.rank()
    }

    fn count(&self) -> usize {
        self.ranks.count()
    }

    fn along_axes(&self) -> Option<&[usize]> {
        Some(&self.along_axes)
    }

    fn send(&self, to: usize, bytes: &[u8]) {
        self.ranks.send(to, bytes);
    }

    fn receive(&self, from: usize, bytes: &mut [u8]) {
        self.ranks.receive(from, bytes);
    }

    fn has_arrived(&self, from: usize) -> bool {
        self.ranks.has_arrived(from)
    }

    fn largest(&self, value: u64) -> u64 {
        self.ranks.largest(value)
    }
}
