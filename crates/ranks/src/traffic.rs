//! How much goes over the wire.

use std::ops::Sub;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::Ranks;

/// The messages that a rank has sent, and their bytes.
#[derive(Debug, Default)]
pub struct Traffic {
    messages: AtomicU64,
    bytes: AtomicU64,
}

impl Traffic {
    /// Messages and bytes sent until now.
    pub fn sent(&self) -> Sent {
        Sent {
            messages: self.messages.load(Ordering::Relaxed),
            bytes: self.bytes.load(Ordering::Relaxed),
        }
    }
}

/// The number of messages and of bytes in them. Calls of [`Ranks::largest`] are not counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sent {
    /// Number of messages.
    pub messages: u64,
    /// Number of bytes in all of them.
    pub bytes: u64,
}

impl Sub for Sent {
    type Output = Self;

    fn sub(self, before: Self) -> Self {
        Self { messages: self.messages - before.messages, bytes: self.bytes - before.bytes }
    }
}

struct Counted {
    ranks: Arc<dyn Ranks>,
    traffic: Arc<Traffic>,
}

/// The given rank, with a count of the messages that it sends.
pub fn counted(ranks: Arc<dyn Ranks>) -> (Arc<dyn Ranks>, Arc<Traffic>) {
    let traffic = Arc::new(Traffic::default());
    (Arc::new(Counted { ranks, traffic: traffic.clone() }), traffic)
}

impl Ranks for Counted {
    fn rank(&self) -> usize {
        self.ranks.rank()
    }

    fn count(&self) -> usize {
        self.ranks.count()
    }

    fn along_axes(&self) -> Option<&[usize]> {
        self.ranks.along_axes()
    }

    fn send(&self, to: usize, bytes: &[u8]) {
        self.traffic.messages.fetch_add(1, Ordering::Relaxed);
        self.traffic.bytes.fetch_add(bytes.len() as u64, Ordering::Relaxed);
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
