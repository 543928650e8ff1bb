//! A hint to the processor that numbers will be needed soon.
//!
//! Particles are read and written block after block, each block a few pages in several arrays: too short for the processor
//! to see by itself what comes next. Without the hint a step takes a tenth longer.

#![allow(unsafe_code, reason = "the instruction is declared so, as it takes a pointer")]

/// Prefetches the memory `ahead` elements after `element`; any address is allowed.
#[inline(always)]
pub(crate) fn prefetch<T>(element: &T, ahead: usize) {
    #[cfg(all(target_arch = "x86_64", not(miri)))]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let place = std::ptr::from_ref(element).wrapping_add(ahead);
        // SAFETY: the instruction neither reads nor writes as far as a program can tell, and any address will do: where
        // nothing is mapped it does nothing.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(place.cast()) };
    }
    #[cfg(not(all(target_arch = "x86_64", not(miri))))]
    let _ = (element, ahead);
}
