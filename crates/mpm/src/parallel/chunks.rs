//! Loops over chunks of arrays, in parallel on the threads of the pool.
//!
//! The body of a loop is called through a reference: the machinery of the pool is then compiled once for each kind of
//! element, not once for each scheme. Every chunk is a task of its own. By default the pool would hand out runs of chunks; once a
//! slow thread has begun such a run nobody takes over the rest, and all threads wait for it.

use rayon::prelude::*;

/// Calls `work` with the number of each chunk of `size` elements, and the chunk.
pub(crate) fn each_chunk<A: Send>(
    array: &mut [A],
    size: usize,
    work: &(dyn Fn(usize, &mut [A]) + Sync),
) {
    let chunks = array.par_chunks_mut(size).enumerate().with_max_len(1);
    chunks.for_each(|(number, chunk)| work(number, chunk));
}

/// The body of a loop over chunks of three arrays: the chunk's number, and the chunks.
type OfThree<'a, A, B, C> = dyn Fn(usize, &mut [A], &mut [B], &mut [C]) + Sync + 'a;

/// As [`each_chunk`] for three arrays of one length, chunk by chunk together.
pub(crate) fn each_chunk_of_three<A: Send, B: Send, C: Send>(
    (a, b, c): (&mut [A], &mut [B], &mut [C]),
    size: usize,
    work: &OfThree<'_, A, B, C>,
) {
    let chunks = a.par_chunks_mut(size).zip(b.par_chunks_mut(size)).zip(c.par_chunks_mut(size));
    let chunks = chunks.enumerate().with_max_len(1);
    chunks.for_each(|(number, ((a, b), c))| work(number, a, b, c));
}

/// Calls `work` with `(i, n)` for i from 0 to n - 1, for as many threads as the pool has, on those that have time.
pub(crate) fn on_all_threads(work: &(dyn Fn((usize, usize)) + Sync)) {
    let threads = rayon::current_num_threads();
    (0..threads).into_par_iter().with_max_len(1).for_each(|thread| work((thread, threads)));
}
