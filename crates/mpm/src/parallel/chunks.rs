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

/// A chunk of each of four arrays.
pub(crate) struct ChunkOfFour<'a, A, B, C, E> {
    pub(crate) number: usize,
    pub(crate) a: &'a mut [A],
    pub(crate) b: &'a mut [B],
    pub(crate) c: &'a mut [C],
    /// Empty where the whole array is.
    pub(crate) e: &'a mut [E],
}

/// The body of a loop over chunks of four arrays.
type OfFour<'a, A, B, C, E> = dyn Fn(ChunkOfFour<'_, A, B, C, E>) + Sync + 'a;

/// As [`each_chunk`] for four arrays of one length, chunk by chunk together; the last one may be empty.
pub(crate) fn each_chunk_of_four<A: Send, B: Send, C: Send, E: Send>(
    (a, b, c, e): (&mut [A], &mut [B], &mut [C], &mut [E]),
    size: usize,
    work: &OfFour<'_, A, B, C, E>,
) {
    let mut of_e = e.chunks_mut(size);
    let chunks = a.chunks_mut(size).zip(b.chunks_mut(size)).zip(c.chunks_mut(size)).enumerate();
    let chunks: Vec<_> = chunks
        .map(|(number, ((a, b), c))| ChunkOfFour {
            number,
            a,
            b,
            c,
            e: of_e.next().unwrap_or_default(),
        })
        .collect();
    each(chunks, &|chunk| work(chunk));
}

/// Calls `work` with `(i, n)` for i from 0 to n - 1, for as many threads as the pool has, on those that have time.
pub(crate) fn on_all_threads(work: &(dyn Fn((usize, usize)) + Sync)) {
    let threads = rayon::current_num_threads();
    (0..threads).into_par_iter().with_max_len(1).for_each(|thread| work((thread, threads)));
}
