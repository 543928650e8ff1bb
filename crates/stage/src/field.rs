//! The fields of a solution by name.

use mmsmith_expr::{Expr, Slot};
use mmsmith_spec::Fields;

/// A field that every solution has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FieldName {
    /// `u`, a length.
    Displacement,
    /// `v = du/dt`.
    Velocity,
    /// `a = d2u/dt2`.
    Acceleration,
    /// `H = F - I`.
    DisplacementGradient,
    /// `F`.
    DeformationGradient,
    /// `J = det F`.
    Jacobian,
    /// `P`, force per reference area.
    FirstPiolaKirchhoff,
    /// `b`, force per mass.
    BodyForce,
}

/// How many entries a field has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// One.
    Scalar,
    /// One for each dimension.
    Vector,
    /// A row for each dimension.
    Matrix,
}

impl Shape {
    /// The entries in so many dimensions.
    #[must_use]
    pub fn entries(self, dimension: usize) -> usize {
        match self {
            Self::Scalar => 1,
            Self::Vector => dimension,
            Self::Matrix => dimension * dimension,
        }
    }
}

/// A field of a solution, and where its entries are, row by row.
#[derive(Clone, Debug)]
pub struct Field {
    /// Which field it is.
    pub name: FieldName,
    /// The entries.
    pub outputs: Vec<Slot>,
}

impl FieldName {
    /// Every field, in the order in which files list them.
    pub const ALL: [FieldName; 8] = [
        FieldName::Displacement,
        FieldName::Velocity,
        FieldName::Acceleration,
        FieldName::DisplacementGradient,
        FieldName::DeformationGradient,
        FieldName::Jacobian,
        FieldName::FirstPiolaKirchhoff,
        FieldName::BodyForce,
    ];

    /// The name in code.
    #[must_use]
    pub fn in_code(self) -> &'static str {
        match self {
            FieldName::Displacement => "displacement",
            FieldName::Velocity => "velocity",
            FieldName::Acceleration => "acceleration",
            FieldName::DisplacementGradient => "displacement_gradient",
            FieldName::DeformationGradient => "deformation_gradient",
            FieldName::Jacobian => "jacobian",
            FieldName::FirstPiolaKirchhoff => "first_piola_kirchhoff",
            FieldName::BodyForce => "body_force",
        }
    }

    /// The name in words.
    #[must_use]
    pub fn in_words(self) -> &'static str {
        match self {
            FieldName::Displacement => "displacement",
            FieldName::Velocity => "velocity",
            FieldName::Acceleration => "acceleration",
            FieldName::DisplacementGradient => "displacement gradient, F - I",
            FieldName::DeformationGradient => "deformation gradient",
            FieldName::Jacobian => "det F, current by reference volume",
            FieldName::FirstPiolaKirchhoff => "first Piola-Kirchhoff stress",
            FieldName::BodyForce => "body force per unit mass",
        }
    }

    /// The letter that the literature uses.
    #[must_use]
    pub fn letter(self) -> &'static str {
        match self {
            FieldName::Displacement => "u",
            FieldName::Velocity => "v",
            FieldName::Acceleration => "a",
            FieldName::DisplacementGradient => "H",
            FieldName::DeformationGradient => "F",
            FieldName::Jacobian => "J",
            FieldName::FirstPiolaKirchhoff => "P",
            FieldName::BodyForce => "b",
        }
    }

    /// How many entries it has.
    #[must_use]
    pub fn shape(self) -> Shape {
        match self {
            FieldName::Displacement
            | FieldName::Velocity
            | FieldName::Acceleration
            | FieldName::BodyForce => Shape::Vector,
            FieldName::Jacobian => Shape::Scalar,
            FieldName::DisplacementGradient
            | FieldName::DeformationGradient
            | FieldName::FirstPiolaKirchhoff => Shape::Matrix,
        }
    }

    /// The entries as derived, row by row.
    #[must_use]
    pub fn derived(self, fields: &Fields) -> Vec<Expr> {
        match self {
            FieldName::Displacement => fields.u.clone(),
            FieldName::Velocity => fields.v.clone(),
            FieldName::Acceleration => fields.a.clone(),
            FieldName::DisplacementGradient => fields.H.concat(),
            FieldName::DeformationGradient => fields.F.concat(),
            FieldName::Jacobian => vec![fields.J],
            FieldName::FirstPiolaKirchhoff => fields.P.concat(),
            FieldName::BodyForce => fields.b.clone(),
        }
    }
}
