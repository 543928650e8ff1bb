//! Bodies without stress across their plane, or their line: the stretch across, and the stress of the law in space at it.

use mmsmith_runtime::{Components, Law, Response, Stated};
use mmsmith_stated_law::StatedLaw;
use nalgebra::{Matrix3, SMatrix};

/// Whether the law has no stress across, so that the body stretches there.
pub(crate) fn has_stretch_across(law: &Law<f64>) -> bool {
    matches!(law, Law::Stated(Stated { across: Some(_), .. }))
}

/// A law without stress across, as formulas tell it, and the law in space that it comes from.
pub(crate) struct Across<const D: usize> {
    /// A number in the place of an energy: above one as that is above rest.
    stretch: StatedLaw<f64>,
    in_space: StatedLaw<f64>,
    /// Whether components of the law are along axes that stay.
    pub(crate) is_cartesian: bool,
}

impl<const D: usize> Across<D> {
    /// None where nothing stretches across, and where the law cannot be read.
    pub(crate) fn of(law: Law<f64>) -> Option<Self> {
        let Law::Stated(Stated { across: Some(across), constants, components, .. }) = law else {
            return None;
        };
        let energy = |text: String, dimension: usize| {
            StatedLaw::new(dimension, &Response::Energy(text), &constants).ok()
        };
        Some(Self {
            stretch: energy(across.stretch, D)?,
            in_space: energy(across.in_space, 3)?,
            is_cartesian: components == Components::Cartesian,
        })
    }

    /// The stretch across.
    pub(crate) fn stretch(&self, F: &SMatrix<f64, D, D>) -> Option<f64> {
        Some(1.0 + self.stretch.strain_energy(F)?)
    }

    /// The first Piola-Kirchhoff stress of the law in space where `F` is that of the plane and the stretch across is this one.
    pub(crate) fn stress(&self, F: &SMatrix<f64, D, D>, stretch: f64) -> Matrix3<f64> {
        let entry = |i: usize, j: usize| match (i.max(j) < D, i == j) {
            (true, _) => F[(i, j)],
            (false, true) => stretch,
            (false, false) => 0.0,
        };
        let F = std::array::from_fn(|i| std::array::from_fn(|j| [entry(i, j)]));
        let mut P = [[[f64::NAN]; 3]; 3];
        self.in_space.first_piola_kirchhoff(&F, &mut P);
        Matrix3::from_fn(|i, j| P[i][j][0])
    }

    /// The modulus of a stretch across at rest.
    pub(crate) fn stiffness(&self) -> f64 {
        const STEP: f64 = 1e-6;
        let at = |stretch: f64| self.stress(&SMatrix::identity(), stretch)[(2, 2)];
        ((at(1.0 + STEP) - at(1.0 - STEP)) / (2.0 * STEP)).abs()
    }
}
