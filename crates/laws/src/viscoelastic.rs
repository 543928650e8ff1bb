//! Maxwell elements beside an elastic law, by a recurrence.
//!
//! Each element has a second Piola-Kirchhoff stress `Q` with `Q' + Q/tau = g S_iso'`, whose solution over a step is
//! `Q <- exp(-dt/tau) Q + g int exp(-(t - s)/tau) S_iso' ds`. With the middle of the step for `s` in the exponential the integral is the
//! change of `S_iso`: second order. In linear elasticity the stresses are deviators of the one stress that there is.
//!
//! Source: J. C. Simo, CMAME 60 (1987) 153-173; R. L. Taylor, K. S. Pister and G. L. Goudreau, IJNME 2 (1970) 45-59.

use mmsmith_lanes::tensor::{determinant, inverse_transpose, product, real};
use mmsmith_vocabulary::{Element, Material};
use nalgebra::{Matrix3, SMatrix};

use crate::fault::{Fault, Planted};
use crate::memory::{ENTRIES, Increment, InternalVariable, LawWithMemory, of_particle, set_stress};
use crate::{BLOCK, Stressed};

/// An elastic law with Maxwell elements.
#[derive(Clone, Debug)]
pub(crate) struct Viscoelastic<T> {
    elastic: Material<T>,
    /// The part of it that changes of volume do not strain.
    isochoric: Material<T>,
    is_linear: bool,
    elements: Vec<Element<T>>,
    planted: Planted,
}

impl<T: Copy + nalgebra::RealField> Viscoelastic<T> {
    /// `None` where the elastic law has no isochoric part.
    pub(crate) fn new(elastic: Material<T>, elements: Vec<Element<T>>) -> Option<Self> {
        let (isochoric, is_linear) = match elastic {
            // The trace of the stress is then zero.
            Material::LinearElastic { mu, .. } => {
                (Material::LinearElastic { lambda: mu * real(-2.0 / 3.0), mu }, true)
            }
            _ if elastic.volumetric().is_some() => {
                let without =
                    |name: &str, value: T| if name == "kappa" { T::zero() } else { value };
                (elastic.map_named(without), false)
            }
            _ => return None,
        };
        let planted = Planted::here();
        let mut elements = elements;
        if planted.is(Fault::LastElementsDropped) {
            elements.truncate(1);
        }
        let isochoric = if planted.is(Fault::ShareOfPressure) { elastic } else { isochoric };
        Some(Self { elastic, isochoric, is_linear, elements, planted })
    }

    /// The sum of the elements' shares.
    fn share(&self) -> T {
        self.elements.iter().fold(T::zero(), |sum, element| sum + element.share)
    }

    /// The stress in space that elements share in, second Piola-Kirchhoff or that of linear elasticity.
    fn shared<const D: usize>(&self, F: &SMatrix<T, D, D>) -> Matrix3<T>
    where
        T: Stressed<D> + Stressed<3>,
    {
        let mut in_space = Matrix3::identity();
        in_space.fixed_view_mut::<D, D>(0, 0).copy_from(F);
        let P = stress(&self.isochoric, &in_space);
        if self.is_linear {
            return P;
        }
        // `F^-1 P`, which is symmetric.
        product(&inverse_transpose(&in_space, determinant(&in_space)).transpose(), &P)
    }

    /// The part that the elements add to the stress of the elastic law, of which they take their shares.
    fn of_elements<const D: usize>(
        &self,
        F: &SMatrix<T, D, D>,
        q: impl Fn(usize) -> T,
    ) -> SMatrix<T, D, D> {
        let mut sum = SMatrix::zeros();
        for first in (0..self.elements.len()).map(|element| 6 * element) {
            for (entry, &(i, j)) in ENTRIES.iter().enumerate().filter(|(_, (_, j))| *j < D) {
                sum[(i, j)] += q(first + entry);
                if i != j {
                    sum[(j, i)] += q(first + entry);
                }
            }
        }
        let is_pushed = !self.is_linear && !self.planted.is(Fault::PushForwardDropped);
        if is_pushed { product(F, &sum) } else { sum }
    }
}

/// A stress of the library; not a number where `F` is no deformation.
fn stress<T: Stressed<D>, const D: usize>(
    material: &Material<T>,
    F: &SMatrix<T, D, D>,
) -> SMatrix<T, D, D> {
    T::first_piola_kirchhoff(material, F).unwrap_or_else(|| SMatrix::repeat(real(f64::NAN)))
}

impl<T: Stressed<D> + Stressed<3>, const D: usize> LawWithMemory<T, D> for Viscoelastic<T> {
    fn variables(&self) -> Vec<InternalVariable> {
        let of_element = |k: usize| {
            ENTRIES.iter().map(move |&(i, j)| InternalVariable {
                name: format!("Q{k}_{}{}", i + 1, j + 1),
                at_rest: 0.0,
            })
        };
        (1..=self.elements.len()).flat_map(of_element).collect()
    }

    fn elastic(&self) -> Option<Material<T>> {
        Some(self.elastic)
    }

    fn kirchhoff_across(&self, F: &SMatrix<T, D, D>, q: &[T]) -> Option<T> {
        let mut in_space = Matrix3::identity();
        in_space.fixed_view_mut::<D, D>(0, 0).copy_from(F);
        let P = stress(&self.elastic, &in_space)
            - stress(&self.isochoric, &in_space) * self.share()
            + self.of_elements(&in_space, |k| q[k]);
        (D < 3).then_some(P[(2, 2)])
    }

    fn first_piola_kirchhoff(
        &self,
        F: &[[[T; BLOCK]; D]; D],
        q: &[[T; BLOCK]],
        P: &mut [[[T; BLOCK]; D]; D],
    ) {
        let share = self.share();
        for n in 0..BLOCK {
            let F = of_particle(F, n);
            let mut sum = stress(&self.elastic, &F);
            if !self.planted.is(Fault::ElasticPartAlone) {
                if !self.planted.is(Fault::ShareTwice) {
                    sum -= stress(&self.isochoric, &F) * share;
                }
                sum += self.of_elements(&F, |k| q[k][n]);
            }
            set_stress(P, n, &sum);
        }
    }

    fn evolve(&self, increment: &Increment<'_, T, D>, q: &mut [[T; BLOCK]]) {
        let Increment { start, end, time } = *increment;
        let hurry = if self.planted.is(Fault::RelaxationTime) { 2.0 } else { 1.0 };
        let factors: Vec<[T; 2]> = self
            .elements
            .iter()
            .map(|element| {
                let half = (-time * real(0.5 * hurry) / element.time).exp();
                let share =
                    if self.planted.is(Fault::ShareDropped) { T::zero() } else { element.share };
                let decay =
                    if self.planted.is(Fault::DecayDropped) { T::one() } else { half * half };
                [decay, half * share]
            })
            .collect();
        for n in 0..BLOCK {
            let change = self.shared(&of_particle(end, n)) - self.shared(&of_particle(start, n));
            for ([decay, share], q) in factors.iter().zip(q.chunks_exact_mut(6)) {
                for (&(i, j), q) in ENTRIES.iter().zip(q) {
                    q[n] = q[n] * *decay + change[(i, j)] * *share;
                }
            }
        }
    }
}
