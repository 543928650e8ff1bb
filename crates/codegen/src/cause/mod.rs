//! Mistakes that solvers make, each with fields that have the opposite mistake.
//!
//! A solver that makes the mistake becomes right when it is given these fields, and its errors fall with the order of its method. The
//! mistake is thus found without a look at the code.

mod memory;
mod planting;
mod table;
mod timing;

pub use table::CAUSES;

use crate::fault::{NoEffect, has_effect};
use mmsmith_expr::Expr;
use mmsmith_spec::{Fields, Spec};
use planting::Planting;

/// A mistake in a solver.
#[derive(Clone, Copy, Debug)]
pub struct Cause {
    /// The name on command lines and in JSON.
    pub name: &'static str,
    /// The mistake in a line.
    pub mistake: &'static str,
    /// The place to look at in the code.
    pub look: &'static str,
    /// The fields that show the mistake.
    pub counter: Counter,
}

/// The fields that a solver is given to find out whether it makes a mistake.
#[derive(Clone, Copy, Debug)]
pub enum Counter {
    /// Changed fields.
    Fields(fn(&mut Planting<'_>)),
    /// Fields of a specification whose material makes the mistake in its memory.
    Memory(fn(&mut Spec)),
    /// A field at another time.
    Time {
        /// The field.
        of: Timed,
        /// How much later, in time steps.
        steps: f64,
    },
    /// A field at the reference position that the exact motion takes to the point asked for.
    Place(Placed),
    /// Another motion where it is prescribed, after the start.
    Motion(Moved),
    /// A field at a point that lies some cells away along every axis.
    Cell {
        /// The number of cells.
        cells: f64,
    },
    /// A body force that gives a body at rest, in the first time step, the velocity that it should have had at the start.
    Impulse {
        /// The duration of the push, in time steps.
        steps: f64,
    },
    /// A field on which the result does not depend, though it should.
    Unused(Unused),
}

/// A field that a solver may ask for at a wrong time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Timed {
    /// The body force.
    Force,
    /// The acceleration within the body force.
    Inertia,
    /// Tractions.
    Traction,
    /// The displacement after the start.
    Boundary,
    /// The velocity after the start.
    BoundaryVelocity,
    /// The velocity at the start.
    InitialVelocity,
    /// All fields: the result then belongs to another time than it states.
    Everything,
}

/// Motion that a solver may take for the given one after the start, where the motion is prescribed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moved {
    /// The displacement with the wrong sign.
    Sign,
    /// Half of the displacement.
    Halved,
    /// Twice the displacement.
    Doubled,
    /// The displacement with its first two components exchanged.
    Exchanged,
    /// The velocity as a displacement.
    Velocity,
}

/// A field that a solver may ask for at current positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Placed {
    /// The body force.
    Force,
    /// Tractions.
    Traction,
    /// The displacement after the start.
    Boundary,
}

/// A field that a solver should have used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unused {
    /// The body force.
    Force,
    /// A component of the body force.
    ForceComponent,
    /// The body force after the start.
    ForceLater,
    /// Tractions.
    Traction,
    /// Tractions after the start.
    TractionLater,
    /// The displacement after the start, on surfaces where it is prescribed.
    Boundary,
    /// The velocity at the start.
    InitialVelocity,
    /// The displacement at the start.
    InitialDisplacement,
}

macro_rules! words {
    ($name:ident { $($variant:ident => $word:literal,)+ }) => {
        impl $name {
            /// The word in JSON, and for the part in Python.
            #[must_use]
            pub fn word(self) -> &'static str {
                match self {
                    $($name::$variant => $word,)+
                }
            }
        }
    };
}

words!(Timed {
    Force => "force",
    Inertia => "inertia",
    Traction => "traction",
    Boundary => "boundary",
    BoundaryVelocity => "boundary-velocity",
    InitialVelocity => "initial-velocity",
    Everything => "everything",
});
words!(Moved {
    Sign => "sign",
    Halved => "halved",
    Doubled => "doubled",
    Exchanged => "exchanged",
    Velocity => "velocity",
});
words!(Placed {
    Force => "force",
    Traction => "traction",
    Boundary => "boundary",
});
words!(Unused {
    Force => "force",
    ForceComponent => "force-component",
    ForceLater => "force-later",
    Traction => "traction",
    TractionLater => "traction-later",
    Boundary => "boundary",
    InitialVelocity => "initial-velocity",
    InitialDisplacement => "initial-displacement",
});

/// Steps of a solver in time and space.
#[derive(Clone, Copy, Debug)]
pub struct Steps {
    /// The time step.
    pub dt: f64,
    /// Values for times up to this one are initial values; between half a time step and a whole one.
    pub start: f64,
    /// The length of a cell.
    pub h: f64,
}

impl Steps {
    /// Steps of which the time step is known.
    #[must_use]
    pub fn of(dt: f64, h: f64) -> Self {
        Steps { dt, start: 0.75 * dt, h }
    }
}

impl Cause {
    /// The cause with this name.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Cause> {
        CAUSES.iter().find(|cause| cause.name == name)
    }

    /// The rank of the change among several changes: first the law, its constants and the strain, then the stress, then quantities of
    /// the momentum balance.
    fn rank(&self) -> usize {
        let rank = |starts: &[&str]| starts.iter().any(|start| self.name.starts_with(start));
        match self.counter {
            Counter::Fields(_) if rank(&["stress-"]) => 1,
            Counter::Fields(_) if rank(&["internal-force-", "mass-", "inertia-"]) => 2,
            Counter::Fields(_) if rank(&["force-", "traction-", "initial-"]) => 3,
            Counter::Fields(_) => 0,
            _ => 4,
        }
    }

    /// Whether the mistake shows in the first time step alone.
    fn shows_at_start_alone(&self) -> bool {
        matches!(
            self.counter,
            Counter::Impulse { .. }
                | Counter::Time { of: Timed::InitialVelocity, .. }
                | Counter::Unused(Unused::InitialVelocity | Unused::InitialDisplacement)
        )
    }

    /// As [`Cause::plant`], for several mistakes at once.
    ///
    /// # Errors
    ///
    /// As [`Cause::plant`], for each of them.
    pub fn plant_all(
        causes: &[&Cause],
        spec: &Spec,
        fields: &mut Fields,
        steps: Steps,
    ) -> Result<(), NoEffect> {
        let mut causes = causes.to_vec();
        causes.sort_by_key(|cause| cause.rank());
        causes.into_iter().try_for_each(|cause| cause.plant(spec, fields, steps))
    }

    /// The specification whose material makes the mistake, for mistakes in its memory.
    ///
    /// # Errors
    ///
    /// [`NoEffect`] where the material has no such memory.
    pub fn specification(&self, spec: &Spec) -> Result<Spec, NoEffect> {
        let mut mistaken = spec.clone();
        if let Counter::Memory(change) = self.counter {
            change(&mut mistaken);
        }
        let is_other = mistaken.memory != spec.memory || mistaken.internal != spec.internal;
        is_other.then_some(mistaken).ok_or_else(|| self.no_effect(spec))
    }

    /// Whether the mistake is one in the memory of a material, which shows by [another specification](Self::specification).
    #[must_use]
    pub fn is_of_memory(&self) -> bool {
        matches!(self.counter, Counter::Memory(_))
    }

    fn no_effect(&self, spec: &Spec) -> NoEffect {
        NoEffect { fault: self.name.to_owned(), solution: spec.name.clone() }
    }

    /// Changes the fields of `spec` to fields with the opposite mistake. To find out whether a solver uses a field at all, the field
    /// becomes larger by a hundredth.
    ///
    /// # Errors
    ///
    /// [`NoEffect`] where all fields stay as they are: this solution then cannot show the mistake. Mistakes in the memory of a material
    /// change none of these fields.
    pub fn plant(&self, spec: &Spec, fields: &mut Fields, steps: Steps) -> Result<(), NoEffect> {
        let change = |fields: &mut Fields| match self.counter {
            Counter::Fields(change) => change(&mut Planting::new(spec, fields)),
            Counter::Memory(_) => {}
            Counter::Time { of, steps: by } => {
                timing::shift(fields, of, by * steps.dt, steps.start)
            }
            Counter::Place(placed) => timing::seek(fields, placed),
            Counter::Motion(moved) => timing::moves(spec, fields, moved, steps.start),
            Counter::Impulse { steps: length } => timing::push(fields, length, steps),
            Counter::Cell { cells } => timing::beside(fields, cells * steps.h),
            Counter::Unused(unused) => timing::nudge(fields, unused, steps.start),
        };
        let changed = if self.shows_at_start_alone() {
            let before = fields.clone();
            change(fields);
            let [before, after] = handed(&before, fields);
            before != after
        } else {
            has_effect(spec, fields, handed, change)
        };
        changed.then_some(()).ok_or_else(|| self.no_effect(spec))
    }
}

/// The changed fields that a solver is given, before and after: fields inside the body, or tractions where these alone change.
fn handed(before: &Fields, after: &Fields) -> [Vec<Expr>; 2] {
    let inside = |fields: &Fields| [&fields.u[..], &fields.v, &fields.b].concat();
    let tractions = |fields: &Fields| {
        fields.surfaces.iter().flat_map(|surface| surface.traction.clone()).collect()
    };
    match inside(before) == inside(after) {
        true => [tractions(before), tractions(after)],
        false => [inside(before), inside(after)],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use std::fs;
    use std::path::Path;

    fn spec(name: &str) -> Spec {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../mms-specs");
        let text = fs::read_to_string(folder.join(name).with_extension("toml")).unwrap();
        Spec::parse(&text, name).unwrap()
    }

    #[test]
    fn every_cause_has_a_name_of_its_own_and_words() {
        let names: BTreeSet<_> = CAUSES.iter().map(|cause| cause.name).collect();
        assert_eq!(names.len(), CAUSES.len());
        for cause in CAUSES {
            assert!(cause.mistake.len() > 5 && cause.look.len() > 15, "{}", cause.name);
            assert!(!cause.look.ends_with('.') && !cause.mistake.ends_with('.'), "{}", cause.name);
        }
    }

    /// With a density that is not one, a stress that is not symmetric and tractions, every change shows but that to the own law.
    #[test]
    fn every_counter_changes_fields() {
        let spec = spec("skew-2d");
        let fields = spec.derive().unwrap();
        let own = ["law-neo-hookean"];
        for cause in CAUSES.iter().filter(|cause| !cause.is_of_memory()) {
            let planted = cause.plant(&spec, &mut fields.clone(), Steps::of(1e-3, 0.1));
            assert_eq!(planted.is_ok(), !own.contains(&cause.name), "{}", cause.name);
        }
    }

    /// Between them these materials show every mistake in a memory.
    #[test]
    fn every_mistake_in_a_memory_changes_a_material() {
        let names = [
            "bar-j2",
            "block-j2",
            "ring-j2",
            "block-perzyna",
            "block-maxwell",
            "ring-simo",
            "bar-own-law",
        ];
        let specs = names.map(|name| spec(&format!("with-memory/{name}")));
        for cause in CAUSES.iter().filter(|cause| cause.is_of_memory()) {
            assert!(specs.iter().any(|spec| cause.specification(spec).is_ok()), "{}", cause.name);
            assert!(cause.specification(&super::tests::spec("skew-2d")).is_err(), "{}", cause.name);
        }
    }

    /// In one dimension there is nothing to transpose or to exchange.
    #[test]
    fn what_changes_nothing_is_told() {
        let spec = spec("bar");
        let fields = spec.derive().unwrap();
        for name in ["stress-transposed", "force-components-exchanged", "lambda-doubled"] {
            let none =
                Cause::named(name).unwrap().plant(&spec, &mut fields.clone(), Steps::of(1e-3, 0.1));
            assert!(none.unwrap_err().to_string().contains(name), "{name}");
        }
    }
}
