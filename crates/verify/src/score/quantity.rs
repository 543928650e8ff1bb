//! The fields in which a recording is compared.

use std::fmt;

use serde::Serialize;

use super::Role;

/// A field in which a recording is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub enum Quantity {
    /// Displacement, a length.
    #[serde(rename = "u")]
    Displacement,
    /// Velocity.
    #[serde(rename = "v")]
    Velocity,
    /// Deformation gradient, dimensionless.
    #[serde(rename = "F")]
    DeformationGradient,
    /// First Piola-Kirchhoff stress.
    #[serde(rename = "P")]
    FirstPiolaKirchhoff,
    /// Cauchy stress.
    #[serde(rename = "cauchy")]
    Cauchy,
    /// Kirchhoff stress.
    #[serde(rename = "kirchhoff")]
    Kirchhoff,
    /// `J = det F`, dimensionless.
    #[serde(rename = "J")]
    VolumeRatio,
    /// Mass per current volume.
    #[serde(rename = "density")]
    Density,
}

impl Quantity {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Displacement,
        Self::Velocity,
        Self::DeformationGradient,
        Self::FirstPiolaKirchhoff,
        Self::Cauchy,
        Self::Kirchhoff,
        Self::VolumeRatio,
        Self::Density,
    ];

    /// The fields that a run is compared in; the others belong to a row where the files hold them.
    pub(super) const OF_RUNS: [Self; 4] =
        [Self::Displacement, Self::Velocity, Self::DeformationGradient, Self::FirstPiolaKirchhoff];

    /// The role of the array that holds it.
    pub(super) fn role(self) -> Role {
        match self {
            Self::Displacement => Role::Displacement,
            Self::Velocity => Role::Velocity,
            Self::DeformationGradient => Role::DeformationGradient,
            Self::FirstPiolaKirchhoff => Role::FirstPiolaKirchhoff,
            Self::Cauchy => Role::Cauchy,
            Self::Kirchhoff => Role::Kirchhoff,
            Self::VolumeRatio => Role::VolumeRatio,
            Self::Density => Role::Density,
        }
    }
}

/// As tables and JSON call it.
impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Displacement => "u",
            Self::Velocity => "v",
            Self::DeformationGradient => "F",
            Self::FirstPiolaKirchhoff => "P",
            Self::Cauchy => "cauchy",
            Self::Kirchhoff => "kirchhoff",
            Self::VolumeRatio => "J",
            Self::Density => "density",
        })
    }
}
