//! Builds of the usual scheme alone.
//!
//! Without the feature `every-scheme` the crate runs the usual scheme alone, on one process and from the start, and refuses every other:
//! boxes that stretch (`gimp`), centred differences, FLIP, the change of volume at each particle. The module of the page is compiled so.
//! What other schemes have besides lies [beyond](Beyond) it: there is no such value then, and the compiler leaves out all that is done
//! with one.

/// Whether the crate is compiled for every scheme.
pub const EVERY_SCHEME: bool = cfg!(feature = "every-scheme");

#[cfg(feature = "every-scheme")]
mod beyond {
    /// Parts that only other schemes than the usual one have.
    pub(crate) type Beyond<A> = Box<A>;

    /// A value, where there are other schemes.
    pub(crate) fn beyond<A>(value: A) -> Option<Beyond<A>> {
        Some(Box::new(value))
    }
}

#[cfg(not(feature = "every-scheme"))]
mod beyond {
    use std::convert::Infallible;
    use std::marker::PhantomData;
    use std::ops::{Deref, DerefMut};

    /// Parts that only other schemes than the usual one have: no value has this type.
    pub(crate) struct Beyond<A>(Infallible, PhantomData<A>);

    /// A value, where there are other schemes.
    pub(crate) fn beyond<A>(_value: A) -> Option<Beyond<A>> {
        None
    }

    impl<A> Deref for Beyond<A> {
        type Target = A;

        fn deref(&self) -> &A {
            match self.0 {}
        }
    }

    impl<A> DerefMut for Beyond<A> {
        fn deref_mut(&mut self) -> &mut A {
            match self.0 {}
        }
    }
}

pub(crate) use beyond::{Beyond, beyond};
