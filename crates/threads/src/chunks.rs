//! Loops over chunks of arrays, in parallel on the threads of the pool.
//!
//! The body of a loop is called through a reference: the machinery of the pool is then compiled once for each kind of
//! element, not once for each scheme. Every chunk is a task of its own. By default the pool would hand out runs of chunks; once a
//! slow thread has begun such a run nobody takes over the rest, and all threads wait for it.

use rayon::prelude::*;

/// Calls `work` with the number of each chunk of `size` elements, and the chunk.
pub fn each_chunk<A: Send>(array: &mut [A], size: usize, work: &(dyn Fn(usize, &mut [A]) + Sync)) {
    if array.len() <= size {
        work(0, array);
        return;
    }
    let chunks = array.par_chunks_mut(size).enumerate().with_max_len(1);
    chunks.for_each(|(number, chunk)| work(number, chunk));
}

/// Calls `work` with each of several pieces of work.
pub fn each<A: Send>(pieces: Vec<A>, work: &(dyn Fn(A) + Sync)) {
    if pieces.len() <= 1 {
        pieces.into_iter().for_each(work);
        return;
    }
    pieces.into_par_iter().with_max_len(1).for_each(work);
}

/// Calls `work` with `(i, n)` for i from 0 to n - 1, for as many threads as the pool has, on those that have time.
pub fn on_all_threads(work: &(dyn Fn((usize, usize)) + Sync)) {
    let threads = rayon::current_num_threads();
    (0..threads).into_par_iter().with_max_len(1).for_each(|thread| work((thread, threads)));
}
