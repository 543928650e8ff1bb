//! Instances of a loop for the vector instructions that the processor has, chosen when the program runs.
//!
//! Only the width of the registers differs between them. Sums and products stay what is written (nothing is contracted or
//! reordered), so that all give the same bits.

use pulp::{Arch, Simd, WithSimd};

/// A loop that is worth vector instructions. `run` and whatever it calls has to be `#[inline(always)]`.
pub(crate) trait Loop {
    fn run(self);
}

struct Instance<L>(L);

impl<L: Loop> WithSimd for Instance<L> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.0.run();
    }
}

/// Runs the widest instance that this processor supports.
#[inline(never)]
pub(crate) fn dispatch(work: impl Loop) {
    Arch::new().dispatch(Instance(work));
}
