//! Loops over chunks of arrays, in parallel on the threads of the pool.
//!
//! The body of a loop is called through a reference, and pieces of work are handed out by their numbers: the machinery of the pool is
//! then compiled once, not once for each scheme and kind of element. Every chunk is a task of its own. By default the pool would hand out
//! runs of chunks; once a slow thread has begun such a run nobody takes over the rest, and all threads wait for it.

use std::sync::{Mutex, PoisonError};

use crate::parallel::*;

/// Calls `work` with the number of each chunk of `size` elements, and the chunk.
pub fn each_chunk<A: Send>(array: &mut [A], size: usize, work: &(dyn Fn(usize, &mut [A]) + Sync)) {
    if array.len() <= size {
        work(0, array);
        return;
    }
    let chunks = array.chunks_mut(size).enumerate();
    each(chunks.collect(), &|(number, chunk)| work(number, chunk));
}

/// Calls `work` with each of several pieces of work.
pub fn each<A: Send>(pieces: Vec<A>, work: &(dyn Fn(A) + Sync)) {
    if pieces.len() <= 1 {
        pieces.into_iter().for_each(work);
        return;
    }
    let pieces: Vec<Mutex<Option<A>>> =
        pieces.into_iter().map(|piece| Mutex::new(Some(piece))).collect();
    numbers(pieces.len(), &|number| {
        let piece = pieces.get(number);
        if let Some(piece) =
            piece.and_then(|piece| piece.lock().unwrap_or_else(PoisonError::into_inner).take())
        {
            work(piece);
        }
    });
}

/// Calls `work` with each number below `count`.
fn numbers(count: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().with_max_len(1).for_each(work);
}

/// Calls `work` with `(i, n)` for i from 0 to n - 1, for as many threads as the pool has, on those that have time.
pub fn on_all_threads(work: &(dyn Fn((usize, usize)) + Sync)) {
    let threads = current_num_threads();
    numbers(threads, &|thread| work((thread, threads)));
}
