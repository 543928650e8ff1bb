//! Names of choices: one list for options, captions and JSON.

use mmsmith_galerkin::{Composition, Coordinates, Layout, MassMatrix};
use mmsmith_measure::norms::Norm;
use mmsmith_mpm::{Integrator, Shape};

use crate::case::{CflSpeed, Extent};
use crate::scheme::{Formulation, Start};
use crate::score::Points;
use crate::tradeoff::Against;

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
        let has_it = |one: &Self| is_it(&one.name()) || one.aliases().iter().any(|own| is_it(own));
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
        impl Named for $Enum {
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

named! {
    Formulation {
        Updated = "updated-lagrangian", "updated", "ul":
            "Updated Lagrangian: weights anew in each step, from the current configuration";
        Total = "total-lagrangian", "total", "tl":
            "Total Lagrangian: weights once, from the reference configuration";
    }
    Composition {
        Order2 = "2": "Leapfrog";
        Order4 = "4": "Five stages";
        Order6 = "6": "Nine stages";
    }
    Start {
        Exact = "exact": "The exact velocity half a step before time zero";
        Data = "data": "Velocity and acceleration at time zero";
        Halved = "halved": "Velocity at time zero, first acceleration halved";
    }
    MassMatrix {
        Lumped = "lumped": "Row sums on the diagonal";
        Consistent = "consistent": "Integrated over the particles";
    }
    Coordinates {
        Cartesian = "cartesian": "Cartesian";
        Polar = "polar": "Radius and angle";
        Spherical = "spherical":
            "Radius, polar angle and azimuth, without a cone of 45 degrees about the third axis";
    }
    Layout {
        Lattice = "lattice": "Centres of equal parts of a cell";
        Gauss = "gauss": "Gauss-Legendre points";
    }
    CflSpeed {
        Bar = "bar":
            "Speed of waves in a bar, sqrt(E/rho0), unless the specification states a wave speed";
        PWave = "p-wave":
            "Speed of P-waves in the undeformed solid, sqrt((lambda + 2 mu)/rho0)";
    }
    Extent {
        Quarter = "quarter":
            "The part between the planes of symmetry: a quarter of a ring, an eighth of a shell";
        Full = "full": "All of it";
    }
    Norm {
        Linf = "linf": "Largest over particles";
        L2 = "l2": "Root of the mean square";
        L1 = "l1": "Mean";
    }
    Against {
        Wall = "wall": "Wall-clock time of the steps";
        Cpu = "cpu": "Processor time of the steps";
        Steps = "steps": "Number of steps";
        Memory = "memory": "Memory, estimated";
    }
    Points {
        Auto = "auto": "Reference positions if they stay while displacements change, else current ones";
        Current = "current": "Current positions";
        Reference = "reference": "Reference positions";
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

    #[test]
    fn old_names_and_capitals_are_read() {
        for name in ["updated-lagrangian", "Updated", "ul", "UL"] {
            assert_eq!(Formulation::named(name), Some(Formulation::Updated), "{name}");
        }
        assert_eq!(Start::named("halve"), None);
        assert_eq!(names::<MassMatrix>(), "lumped, consistent");
        assert_eq!(Shape::named("GIMP"), Some(Shape::Gimp));
    }
}
