//! Laws that specifications state, as the solver runs them.

use mmsmith_mpm::fault::{Fault, Planted};
use mmsmith_mpm::{BLOCK, ConstitutiveLaw, Law};
use mmsmith_runtime::{Components, Real, Stated};
use mmsmith_stated_law::{Compiled, StatedLaw};
use nalgebra::SMatrix;

use crate::error::SceneError;

/// The law that a specification states.
///
/// # Errors
///
/// Where it is stated along directions that turn from place to place, or is no law.
pub(crate) fn read<T: Real + Compiled<D>, const D: usize>(
    stated: Stated<T>,
) -> Result<Law<T, D>, SceneError> {
    let Stated { response, components, constants, .. } = stated;
    if components == Components::Curvilinear {
        return Err(SceneError::CurvilinearComponents);
    }
    let constants: Vec<(String, f64)> =
        constants.into_iter().map(|(name, value)| (name, value.to_f64())).collect();
    let law = StatedLaw::new(D, &response, &constants)?;
    Ok(Law::from_constitutive(OfText { law, planted: Planted::here() }))
}

#[derive(Debug)]
struct OfText<T> {
    law: StatedLaw<T>,
    planted: Planted,
}

impl<T: Real + Compiled<D>, const D: usize> ConstitutiveLaw<T, D> for OfText<T> {
    fn first_piola_kirchhoff(&self, F: &[[[T; BLOCK]; D]; D], P: &mut [[[T; BLOCK]; D]; D]) {
        T::stress_of_block(&self.law, F, P);
        if self.planted.is(Fault::StatedFactor) {
            for i in 0..D {
                for j in (0..D).filter(|j| *j != i) {
                    P[i][j].iter_mut().for_each(|shear| *shear *= T::nearest(0.5));
                }
            }
        }
        if self.planted.is(Fault::StatedSign) {
            P[0][0].iter_mut().for_each(|normal| *normal = -*normal);
        }
    }

    fn strain_energy(&self, F: &SMatrix<T, D, D>) -> Option<T> {
        T::energy(&self.law, F)
    }

    fn kirchhoff_across(&self, F: &SMatrix<T, D, D>) -> Option<T> {
        T::across(&self.law, F)
    }
}
