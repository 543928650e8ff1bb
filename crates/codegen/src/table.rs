//! The table beside a file, as the file knows it.

use mmsmith_spec::{Domain, Spec, Surface};

/// The table beside a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Tabulated {
    /// The sign that a file and its table have in common.
    pub digest: String,
    /// The last time that it has.
    pub end: f64,
    /// The error of the table, as a share of the largest value of each field.
    pub error: f64,
    /// How many numbers the fields after `b` and `P` have, in their order.
    pub sizes: Vec<usize>,
    /// The names of internal variables: the entries of these fields, one after the other.
    pub variables: Vec<String>,
    /// Pieces in time and polynomials in each; none where the table has series of some points alone.
    pub in_time: Option<[usize; 2]>,
}

/// The part of the table that a function takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OfTable {
    /// The body force.
    BodyForce,
    /// The stress.
    Stress,
    /// All internal variables.
    Internal,
    /// One internal variable: its field, the number of this field's entries, and its place among them.
    Variable { field: usize, size: usize, entry: usize },
    /// The stress times the outward normal of a surface.
    Traction(Surface),
}

/// The numbers of the fields `b` and `P` in a table, and of the first internal variable.
pub(crate) const BODY_FORCE: usize = 0;
pub(crate) const STRESS: usize = 1;
pub(crate) const FIRST_INTERNAL: usize = 2;

/// The outward normal of a surface.
pub(crate) enum Normal {
    /// Along an axis, in this sense.
    Axis(usize, f64),
    /// Along the first components of the position, in this sense.
    Radial { sign: f64, components: usize },
    /// Around the third axis, in this sense of the growing angle.
    Around(f64),
}

impl Normal {
    pub(crate) fn of(surface: Surface, spec: &Spec, is_of_half_plane: bool) -> Self {
        let components = match spec.domain {
            Domain::Tube { .. } => 2,
            Domain::Box { .. } | Domain::Annulus { .. } => spec.dimension,
        };
        // There the radius is a coordinate.
        match surface {
            Surface::Inner if is_of_half_plane => return Normal::Axis(0, -1.0),
            Surface::Outer if is_of_half_plane => return Normal::Axis(0, 1.0),
            _ => {}
        }
        match surface {
            Surface::Lower(axis) => Normal::Axis(axis, -1.0),
            Surface::Upper(axis) => Normal::Axis(axis, 1.0),
            Surface::Inner => Normal::Radial { sign: -1.0, components },
            Surface::Outer => Normal::Radial { sign: 1.0, components },
            Surface::FirstAngle => Normal::Around(-1.0),
            Surface::LastAngle => Normal::Around(1.0),
        }
    }
}

impl Tabulated {
    /// Each internal variable with the number of its field, the size of this field, and its place there.
    pub(crate) fn places(&self) -> impl Iterator<Item = (&String, OfTable)> {
        let entries = self.sizes.iter().enumerate().flat_map(|(number, &size)| {
            let field = FIRST_INTERNAL + number;
            (0..size).map(move |entry| OfTable::Variable { field, size, entry })
        });
        self.variables.iter().zip(entries)
    }
}
