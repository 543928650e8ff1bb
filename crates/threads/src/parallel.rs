//! Iterators that share their work out among the threads of the pool: those of `rayon`, for `use mmsmith_threads::parallel::*`.
//!
//! Modules of WebAssembly have one thread. The same names there stand for plain iterators, and nothing of the pool is compiled.

#[cfg(target_family = "wasm")]
pub use one_thread::*;
#[cfg(not(target_family = "wasm"))]
pub use rayon::{current_num_threads, prelude::*};

#[cfg(target_family = "wasm")]
mod one_thread {
    use std::iter::FlatMap;
    use std::slice::{Chunks, ChunksMut, Iter, IterMut};

    /// How many threads there are.
    #[must_use]
    pub fn current_num_threads() -> usize {
        1
    }

    /// Collections with elements of their own.
    pub trait IntoParallelIterator: IntoIterator + Sized {
        /// The elements.
        fn into_par_iter(self) -> Self::IntoIter {
            self.into_iter()
        }
    }

    impl<I: IntoIterator> IntoParallelIterator for I {}

    /// The names that iterators of the pool have beside those of the standard library.
    pub trait ParallelIterator: Iterator + Sized {
        /// The elements; all are of one thread.
        fn with_max_len(self, _most: usize) -> Self {
            self
        }

        /// The elements of the iterators that `of` gives.
        fn flat_map_iter<U: IntoIterator, F: FnMut(Self::Item) -> U>(
            self,
            of: F,
        ) -> FlatMap<Self, U, F> {
            self.flat_map(of)
        }
    }

    impl<I: Iterator> ParallelIterator for I {}

    /// Slices whose elements are read.
    pub trait ParallelSlice<A> {
        /// The elements.
        fn par_iter(&self) -> Iter<'_, A>;
        /// Runs of so many elements.
        fn par_chunks(&self, size: usize) -> Chunks<'_, A>;
    }

    impl<A> ParallelSlice<A> for [A] {
        fn par_iter(&self) -> Iter<'_, A> {
            self.iter()
        }

        fn par_chunks(&self, size: usize) -> Chunks<'_, A> {
            self.chunks(size)
        }
    }

    /// Slices whose elements are changed.
    pub trait ParallelSliceMut<A> {
        /// The elements.
        fn par_iter_mut(&mut self) -> IterMut<'_, A>;
        /// Runs of so many elements.
        fn par_chunks_mut(&mut self, size: usize) -> ChunksMut<'_, A>;
    }

    impl<A> ParallelSliceMut<A> for [A] {
        fn par_iter_mut(&mut self) -> IterMut<'_, A> {
            self.iter_mut()
        }

        fn par_chunks_mut(&mut self, size: usize) -> ChunksMut<'_, A> {
            self.chunks_mut(size)
        }
    }
}
