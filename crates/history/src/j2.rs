//! Plastic flow by von Mises at finite strain: elasticity of logarithmic strains, multiplicative split, isotropic hardening.
//!
//! With `G = (F^p^T F^p)^-1` and `b_e = F G F^T` the equations are
//!
//! ```text
//! tau = lambda tr(e) I + 2 mu e,  e = ln(b_e)/2;   s = dev tau,  n = s/|s|;   f = |s| - sqrt(2/3) k(alpha)
//! G' = -2 gamma' F^-1 n b_e F^-T,   alpha' = sqrt(2/3) gamma'
//! rate-independent:  gamma' = (n : d) / (1 + k'(alpha)/(3 mu))  while f = 0 and n : d > 0;    Perzyna:  gamma' = <f/s0>^m / eta
//! ```
//!
//! Source: J. C. Simo, "A framework for finite strain elastoplasticity based on maximum plastic dissipation and the multiplicative
//! decomposition", CMAME 66 (1988) 199-219; P. Perzyna, "Fundamental problems in viscoplasticity", Adv. Appl. Mech. 9 (1966) 243-377.

use crate::law::{Branch, Kinematics, LawWithHistory, Variable};
use crate::number::Number;
use crate::tensor::{
    ENTRIES, Tensor, contraction, deviator, identity, inverse, logarithm, product, scaled,
    symmetric, tensor, trace, transpose,
};

/// The yield stress as a function of the equivalent plastic strain: `yield_stress + modulus w`, `w = alpha^exponent`. The variable is `w`
/// where flow does not depend on the rate: its rate is finite where a particle begins to flow, that of `alpha` tells nothing there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hardening {
    /// The yield stress of the virgin material.
    pub yield_stress: f64,
    /// The modulus of the hardening, a stress.
    pub modulus: f64,
    /// The exponent, above zero and at most 1: linear hardening.
    pub exponent: f64,
}

impl Hardening {
    /// The yield stress at a plastic strain.
    #[must_use]
    pub fn stress(&self, alpha: f64) -> f64 {
        self.yield_stress + self.modulus * alpha.powf(self.exponent)
    }

    /// The plastic strain for the variable `w`.
    fn alpha<N: Number>(&self, w: N) -> N {
        power(w, 1.0 / self.exponent)
    }

    /// `d alpha / dw`, zero at zero.
    fn alpha_slope<N: Number>(&self, w: N) -> N {
        power(w, 1.0 / self.exponent - 1.0).times(1.0 / self.exponent)
    }
}

/// A power of a number that is not negative; zero has no slopes.
fn power<N: Number>(x: N, exponent: f64) -> N {
    match exponent {
        0.0 => N::constant(1.0),
        1.0 => x,
        _ if x.value() <= 0.0 => N::constant(0.0),
        exponent => x.powf(exponent),
    }
}

/// The rate at which a material flows beyond its yield stress.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overstress {
    /// The stress that the overstress is measured in.
    pub drag: f64,
    /// The exponent.
    pub exponent: f64,
    /// The time of the flow.
    pub time: f64,
}

/// Plastic flow by von Mises.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct J2 {
    /// Lamé's first parameter.
    pub lambda: f64,
    /// The shear modulus.
    pub mu: f64,
    /// The yield stress as a function of the plastic strain.
    pub hardening: Hardening,
    /// By Perzyna; none where the flow does not depend on the rate.
    pub overstress: Option<Overstress>,
}

/// The stress of a particle, and the direction of its flow.
struct State<N> {
    be: Tensor<N>,
    tau: Tensor<N>,
    /// `|s|`.
    size: N,
    /// `s/|s|`.
    n: Tensor<N>,
}

impl J2 {
    fn state<N: Number>(&self, F: &Tensor<N>, z: &[N]) -> State<N> {
        let mut G = identity();
        for (&(i, j), &value) in ENTRIES.iter().zip(z) {
            (G[i][j], G[j][i]) = (value, value);
        }
        let be = symmetric(&product(&product(F, &G), &transpose(F)));
        let twice = logarithm(&be);
        let e = tensor(|i, j| twice[i][j].times(0.5));
        let volumetric = trace(&e).times(self.lambda);
        let one = identity::<N>();
        let tau = tensor(|i, j| one[i][j] * volumetric + e[i][j].times(2.0 * self.mu));
        let s = deviator(&tau);
        let square = contraction(&s, &s);
        // Without a stress there is no direction, and no flow.
        if square.value() == 0.0 {
            return State { be, tau, size: N::constant(0.0), n: scaled(&s, N::constant(0.0)) };
        }
        let size = square.sqrt();
        State { be, tau, size, n: scaled(&s, N::constant(1.0) / size) }
    }

    /// `f` over the yield stress of the virgin material.
    fn overstress<N: Number>(&self, size: N, w: N) -> N {
        let Hardening { yield_stress, modulus, exponent } = self.hardening;
        let w = if self.overstress.is_some() { power(w, exponent) } else { w };
        let allowed = N::constant(yield_stress) + w.times(modulus);
        (size - allowed.times((2.0_f64 / 3.0).sqrt())).times(1.0 / self.hardening.yield_stress)
    }

    /// The equivalent plastic strain.
    #[must_use]
    pub fn plastic_strain<N: Number>(&self, z: &[N]) -> N {
        if self.overstress.is_some() { z[6] } else { self.hardening.alpha(z[6]) }
    }

    /// The start value of `G` by which a body at rest is on the yield surface: an elastic stretch along axis 0 and a shortening along
    /// axis 1 at constant volume. Gives the stretch.
    pub fn stretch_to_yield(&self) -> f64 {
        (self.hardening.yield_stress / (2.0 * 3.0_f64.sqrt() * self.mu)).exp()
    }
}

impl LawWithHistory for J2 {
    fn variables(&self) -> Vec<Variable> {
        let of_G = ENTRIES.iter().map(|&(i, j)| Variable {
            name: format!("G{}{}", i + 1, j + 1),
            initial: if i == j { 1.0 } else { 0.0 },
        });
        of_G.chain([Variable { name: "w".into(), initial: 0.0 }]).collect()
    }

    fn rate<N: Number>(&self, at: &Kinematics<N>, z: &[N], branch: Branch, rates: &mut [N]) {
        let zero = N::constant(0.0);
        rates.fill(zero);
        if branch == Branch::Elastic {
            return;
        }
        let State { be, size, n, .. } = self.state(&at.F, z);
        let to_reference = inverse(&at.F);
        let w = z[6];
        // `gamma' = slope along`, `alpha' = sqrt(2/3) gamma'` and `alpha' = alpha_slope w'`.
        let alpha_slope = self.hardening.alpha_slope(w);
        let (gamma, rate_of_w) = match self.overstress {
            Some(Overstress { drag, exponent, time }) => {
                let over = self.overstress(size, w).times(self.hardening.yield_stress / drag);
                let gamma = power(over, exponent).times(1.0 / time);
                (gamma, gamma)
            }
            None => {
                let d = symmetric(&product(&at.rate, &to_reference));
                let along = contraction(&n, &d);
                // (n : d) / (1 + k'(alpha)/(3 mu)) with k' = modulus / alpha_slope.
                let stiffness = N::constant(self.hardening.modulus / (3.0 * self.mu));
                let rate_of_w = along / (alpha_slope + stiffness);
                (rate_of_w * alpha_slope, rate_of_w)
            }
        };
        let flow = product(&n, &be);
        let pulled = product(&product(&to_reference, &flow), &transpose(&to_reference));
        for (rate, &(i, j)) in rates.iter_mut().zip(&ENTRIES) {
            *rate = (pulled[i][j] + pulled[j][i]).times(-1.0) * gamma;
        }
        rates[6] = rate_of_w.times((2.0_f64 / 3.0).sqrt());
    }

    fn first_piola_kirchhoff<N: Number>(&self, at: &Kinematics<N>, z: &[N]) -> Tensor<N> {
        product(&self.state(&at.F, z).tau, &transpose(&inverse(&at.F)))
    }

    fn first_branch(&self, at: &Kinematics<f64>, z: &[f64]) -> Branch {
        if self.overstress.is_some() {
            return Branch::Flowing;
        }
        let is_on_surface = self.margin(at, z, Branch::Elastic) <= 1e-12;
        let grows = self.margin(at, z, Branch::Flowing) > 0.0;
        if is_on_surface && grows { Branch::Flowing } else { Branch::Elastic }
    }

    fn margin<N: Number>(&self, at: &Kinematics<N>, z: &[N], branch: Branch) -> N {
        if self.overstress.is_some() {
            return N::constant(1.0);
        }
        let State { size, n, .. } = self.state(&at.F, z);
        match branch {
            Branch::Elastic => -self.overstress(size, z[6]),
            Branch::Flowing => {
                let d = symmetric(&product(&at.rate, &inverse(&at.F)));
                let square = contraction(&d, &d);
                if square.value() == 0.0 {
                    return N::constant(0.0);
                }
                contraction(&n, &d) / square.sqrt()
            }
        }
    }
}
