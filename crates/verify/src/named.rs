//! Names of choices: one list for options, captions and JSON.

use mmsmith_measure::norms::Norm;
use mmsmith_mpm::{Integrator, Shape};

/// A choice among few, each with its name.
pub trait Named: Copy + Send + Sync + Sized + 'static {
    /// All there are.
    const ALL: &'static [Self];

    /// The name that options, captions and JSON have for it.
    fn name(self) -> &'static str;

    /// A line about it.
    fn about(self) -> &'static str;

    /// Other names that are read.
    fn aliases(self) -> &'static [&'static str] {
        &[]
    }

    /// The choice of this name, in letters of either case.
    #[must_use]
    fn named(name: &str) -> Option<Self> {
        let is_it = |known: &&str| known.eq_ignore_ascii_case(name);
        let has_it = |one: &Self| is_it(&one.name()) || one.aliases().iter().any(&is_it);
        Self::ALL.iter().copied().find(has_it)
    }
}

/// The names of all choices, for those who have missed them.
#[must_use]
pub fn names<N: Named>() -> String {
    N::ALL.iter().map(|one| one.name()).collect::<Vec<_>>().join(", ")
}

macro_rules! named {
    ($($Enum:ident { $($Value:ident = $name:literal $(, $alias:literal)*: $about:literal;)+ })+) => {$(
        impl $crate::named::Named for $Enum {
            const ALL: &'static [Self] = &[$(Self::$Value),+];

            fn name(self) -> &'static str {
                match self { $(Self::$Value => $name,)+ }
            }

            fn about(self) -> &'static str {
                match self { $(Self::$Value => $about,)+ }
            }

            fn aliases(self) -> &'static [&'static str] {
                match self { $(Self::$Value => &[$($alias),*],)+ }
            }
        }
    )+};
}

pub(crate) use named;

named! {
    Norm {
        Linf = "linf": "Largest over particles";
        L2 = "l2": "Root of the mean square";
        L1 = "l1": "Mean";
    }
}

impl Named for Shape {
    const ALL: &'static [Self] = &Self::ALL;

    fn name(self) -> &'static str {
        self.name()
    }

    fn about(self) -> &'static str {
        self.about()
    }
}

impl Named for Integrator {
    const ALL: &'static [Self] = &Self::ALL;

    fn name(self) -> &'static str {
        self.name()
    }

    fn about(self) -> &'static str {
        self.about()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scheme::{Formulation, Start};

    #[test]
    fn old_names_and_capitals_are_read() {
        for name in ["updated-lagrangian", "Updated", "ul", "UL"] {
            assert_eq!(Formulation::named(name), Some(Formulation::Updated), "{name}");
        }
        assert_eq!(Start::named("halve"), None);
        assert_eq!(names::<Norm>(), "linf, l2, l1");
        assert_eq!(Shape::named("GIMP"), Some(Shape::Gimp));
    }
}
