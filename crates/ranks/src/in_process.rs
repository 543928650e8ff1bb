//! Ranks that are threads of one process.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};

use crate::Ranks;

type Message = Vec<u8>;

struct InProcess {
    rank: usize,
    to: Vec<Mutex<Sender<Message>>>,
    from: Vec<Mutex<Incoming>>,
}

/// The messages of one rank.
struct Incoming {
    receiver: Receiver<Message>,
    /// A message that was looked at and not taken yet.
    next: Option<Message>,
}

/// Calls `work` on `count` threads, a thread for each rank, and returns the results in the order of the ranks.
///
/// # Panics
///
/// Where `work` panics, and where a rank waits for a message of another length or of a rank that has ended.
pub fn in_process<R: Send>(count: usize, work: impl Fn(Arc<dyn Ranks>) -> R + Sync) -> Vec<R> {
    let mut to: Vec<Vec<_>> = (0..count).map(|_| Vec::new()).collect();
    let mut from: Vec<Vec<_>> = (0..count).map(|_| Vec::new()).collect();
    for sender in &mut to {
        for receivers in &mut from {
            let (send, receive) = channel();
            sender.push(Mutex::new(send));
            receivers.push(Mutex::new(Incoming { receiver: receive, next: None }));
        }
    }
    let ranks = to.into_iter().zip(from).enumerate();
    let ranks = ranks.map(|(rank, (to, from))| InProcess { rank, to, from });
    let work = &work;
    std::thread::scope(|scope| {
        let threads: Vec<_> =
            ranks.map(|ranks| scope.spawn(move || work(Arc::new(ranks)))).collect();
        let ends = threads.into_iter().map(|thread| thread.join());
        ends.map(|end| end.unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
    })
}

impl Ranks for InProcess {
    fn rank(&self) -> usize {
        self.rank
    }

    fn count(&self) -> usize {
        self.to.len()
    }

    fn send(&self, to: usize, bytes: &[u8]) {
        let sender = self.to[to].lock().unwrap_or_else(PoisonError::into_inner);
        // A receiver that no longer listens has panicked, which its thread reports.
        let _ = sender.send(bytes.to_vec());
    }

    fn receive(&self, from: usize, bytes: &mut [u8]) {
        let mut from_it = self.from[from].lock().unwrap_or_else(PoisonError::into_inner);
        let Some(message) = from_it.next.take().or_else(|| from_it.receiver.recv().ok()) else {
            panic!("rank {from} has ended")
        };
        bytes.copy_from_slice(&message);
    }

    fn has_arrived(&self, from: usize) -> bool {
        let mut from_it = self.from[from].lock().unwrap_or_else(PoisonError::into_inner);
        if from_it.next.is_none() {
            from_it.next = from_it.receiver.try_recv().ok();
        }
        from_it.next.is_some()
    }

    fn largest(&self, value: u64) -> u64 {
        for to in 0..self.count() {
            self.send(to, &value.to_le_bytes());
        }
        let each = (0..self.count()).map(|from| {
            let mut value = [0; 8];
            self.receive(from, &mut value);
            u64::from_le_bytes(value)
        });
        each.fold(0, u64::max)
    }
}
