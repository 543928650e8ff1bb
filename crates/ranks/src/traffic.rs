//! How much goes over the wire.

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
    /// The number of messages, and of bytes in them.
    pub fn sent(&self) -> (u64, u64) {
        (self.messages.load(Ordering::Relaxed), self.bytes.load(Ordering::Relaxed))
    }
}

struct Counted {
    ranks: Arc<dyn Ranks>,
    traffic: Arc<Traffic>,
}

/// The same rank, with a count of what it sends.
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

    fn send(&self, to: usize, bytes: &[u8]) {
        self.traffic.messages.fetch_add(1, Ordering::Relaxed);
        self.traffic.bytes.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        self.ranks.send(to, bytes);
    }

    fn receive(&self, from: usize, bytes: &mut [u8]) {
        self.ranks.receive(from, bytes);
    }

    fn largest(&self, value: u64) -> u64 {
        self.ranks.largest(value)
    }
}
