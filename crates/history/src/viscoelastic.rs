//! Finite linear viscoelasticity.

use crate::law::{Branch, Kinematics, LawWithHistory, Variable};
use crate::number::{Dual, Number};
use crate::tensor::{
    ENTRIES, Tensor, determinant, identity, inverse, product, scaled, sum, tensor, trace, transpose,
};

/// Finite linear viscoelasticity: `S = S_vol(J) + (1 - sum g_i) S_iso(C) + sum Q_i` with `Q_i' + Q_i/tau_i = g_i d/dt S_iso`, for the
/// neo-Hookean body `S_iso = mu J^(-2/3) (I - tr(C)/3 C^-1)`, `S_vol = lambda ln(J) C^-1`.
///
/// Source: J. C. Simo, "On a fully three-dimensional finite-strain viscoelastic damage model", CMAME 60 (1987) 153-173.
#[derive(Clone, Debug, PartialEq)]
pub struct Viscoelastic {
    /// Lamé's first parameter.
    pub lambda: f64,
    /// The shear modulus of the instantaneous response.
    pub mu: f64,
    /// The share of the shear modulus and the relaxation time of each Maxwell element.
    pub elements: Vec<Maxwell>,
}

/// A Maxwell element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Maxwell {
    /// Its share of the instantaneous shear modulus.
    pub share: f64,
    /// Its relaxation time.
    pub time: f64,
}

impl Viscoelastic {
    /// `S_iso`, and `C^-1`.
    fn isochoric<N: Number>(&self, F: &Tensor<N>) -> (Tensor<N>, Tensor<N>, N) {
        let C = product(&transpose(F), F);
        let to_reference = inverse(&C);
        let J = determinant(F);
        let factor = J.powf(-2.0 / 3.0).times(self.mu);
        let third = trace(&C).times(1.0 / 3.0);
        let one = identity::<N>();
        let S = tensor(|i, j| (one[i][j] - third * to_reference[i][j]) * factor);
        (S, to_reference, J)
    }
}

impl LawWithHistory for Viscoelastic {
    fn variables(&self) -> Vec<Variable> {
        let of_element = |k: usize| {
            ENTRIES.iter().map(move |&(i, j)| Variable {
                name: format!("Q{}_{}{}", k + 1, i + 1, j + 1),
                initial: 0.0,
            })
        };
        (0..self.elements.len()).flat_map(of_element).collect()
    }

    fn rate<N: Number>(&self, at: &Kinematics<N>, z: &[N], _: Branch, rates: &mut [N]) {
        // Along the rate of deformation.
        let F = tensor(|i, j| Dual { value: at.F[i][j], slopes: [at.rate[i][j]] });
        let (S, ..) = self.isochoric(&F);
        for (k, Maxwell { share, time }) in self.elements.iter().enumerate() {
            for (entry, &(i, j)) in ENTRIES.iter().enumerate() {
                let place = 6 * k + entry;
                rates[place] = S[i][j].slopes[0].times(*share) - z[place].times(1.0 / time);
            }
        }
    }

    fn first_piola_kirchhoff<N: Number>(&self, at: &Kinematics<N>, z: &[N]) -> Tensor<N> {
        let (S, to_reference, J) = self.isochoric(&at.F);
        let long_term = 1.0 - self.elements.iter().map(|element| element.share).sum::<f64>();
        let volumetric = scaled(&to_reference, J.ln().times(self.lambda));
        let mut all = tensor(|i, j| volumetric[i][j] + S[i][j].times(long_term));
        for Q in z.chunks_exact(6) {
            let mut of_element = identity();
            for (&(i, j), &value) in ENTRIES.iter().zip(Q) {
                (of_element[i][j], of_element[j][i]) = (value, value);
            }
            all = sum(&all, &of_element);
        }
        product(&at.F, &all)
    }
}
