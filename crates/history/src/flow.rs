//! Plastic flow by von Mises at finite strain: elasticity of logarithmic strains, multiplicative split, isotropic hardening.
//!
//! With `G = (F^p^T F^p)^-1` and `b_e = F G F^T` the equations are
//!
//! ```text
//! tau = lambda tr(e) I + 2 mu e,  e = ln(b_e)/2;   s = dev tau,  n = s/|s|;   f = |s| - sqrt(2/3) k(alpha)
//! G' = -2 gamma' F^-1 n b_e F^-T,   alpha' = sqrt(2/3) gamma'
//! rate-independent:  gamma' = (n : d) / (1 + k'(alpha)/(3 mu))  while f = 0 and n : d > 0;    Perzyna:  gamma' = <f/drag>^m / time
//! ```
//!
//! They are evaluated with `A = F^-1 b_e F = G C`, whose functions are those of `b_e` pulled back: `F^-1 n b_e F^-T = n(A) G`.
//!
//! Source: J. C. Simo, "A framework for finite strain elastoplasticity based on maximum plastic dissipation and the multiplicative
//! decomposition", CMAME 66 (1988) 199-219; P. Perzyna, "Fundamental problems in viscoplasticity", Adv. Appl. Mech. 9 (1966) 243-377.

use mmsmith_vocabulary::Smoothness;

use crate::law::{Branch, Kinematics, LawWithHistory, Residuals};
use crate::number::{Dual, Number, power};
use crate::tensor::{
    ENTRIES, Logarithm, Space, Tensor, determinant, identity, symmetric_product, tensor,
};

/// `sqrt(2/3)`.
const ROOT: f64 = 0.816_496_580_927_726;
/// A share of the yield stress that counts as nothing.
const ON_SURFACE: f64 = 1e-12;

/// Flow by von Mises of Hencky's elastic law. The constants are `lambda`, `mu`, `yield-stress`, `modulus`, `exponent`, and where flow
/// depends on its rate `drag`, `rate-exponent` and `time`.
///
/// The last variable is `w = alpha^exponent` where flow does not depend on the rate: its rate is finite where a particle begins to flow,
/// that of the equivalent plastic strain `alpha` tells nothing there. Otherwise it is `alpha`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Flow {
    /// The number of dimensions. Below three there is no shear out of the plane.
    pub dimension: usize,
    /// Whether the flow depends on its rate.
    pub has_overstress: bool,
    /// Whether the body is on the yield surface at the start.
    pub is_on_yield: bool,
}

/// The constants by their names.
struct Constants<N> {
    lambda: N,
    mu: N,
    yield_stress: N,
    modulus: N,
    exponent: N,
}

impl<N: Number> Constants<N> {
    #[inline]
    fn of(all: &[N]) -> Self {
        let &[lambda, mu, yield_stress, modulus, exponent, ..] = all else {
            unreachable!("a law gets the constants that it names")
        };
        Self { lambda, mu, yield_stress, modulus, exponent }
    }

    /// The yield stress at a plastic strain.
    #[inline]
    fn allowed(&self, alpha: N) -> N {
        self.yield_stress + self.modulus * power(alpha, self.exponent)
    }

    /// The plastic strain of the variable `w`, and `d alpha / dw`; zero at zero.
    #[inline]
    fn alpha(&self, w: N) -> (N, N) {
        if self.exponent.value() == 1.0 && !self.exponent.has_slopes() {
            return (w, N::constant(1.0));
        }
        let inverse = N::constant(1.0) / self.exponent;
        (power(w, inverse), power(w, inverse - N::constant(1.0)) * inverse)
    }

    /// The unit of stresses: the yield stress of the virgin material, or where there is none the shear modulus.
    fn unit(&self) -> N {
        if self.yield_stress.value() > 0.0 { self.yield_stress } else { self.mu }
    }
}

/// The stress of a particle, pulled back.
struct State<N> {
    /// `C = F^T F`.
    G: Tensor<N>,
    /// `(A - m I)/m` and the function of it that `ln(A)/2` is.
    logarithm: Logarithm<N>,
    /// `F^-1 s F`.
    s: Tensor<N>,
    /// `|s|^2`.
    square: N,
}

impl Flow {
    fn space(&self) -> Space {
        if self.dimension < 3 { Space::Plane } else { Space::Whole }
    }

    /// The number of entries of `G` that are integrated.
    fn entries(&self) -> usize {
        if self.dimension < 3 { 4 } else { 6 }
    }

    /// `G` as a tensor.
    #[inline]
    fn inverse_of_plastic<N: Number>(&self, z: &[N]) -> Tensor<N> {
        let mut G = identity();
        for (&(i, j), &value) in ENTRIES.iter().zip(&z[..self.entries()]) {
            (G[i][j], G[j][i]) = (value, value);
        }
        G
    }

    #[inline]
    fn state<N: Number>(&self, F: &Tensor<N>, mu: N, z: &[N]) -> State<N> {
        let space = self.space();
        let G = self.inverse_of_plastic(z);
        let C = symmetric_product(space, F);
        let A = space.product(&G, &C);
        // ln(A)/2, half of the logarithm.
        let logarithm = Logarithm::of(space, &A);
        let dev = logarithm.deviator(space);
        let s = space.map(&dev, |entry| entry * mu);
        // tr(s^2) does not depend on the frame.
        let square = space.contraction_with_transpose(&s, &s);
        State { G, logarithm, s, square }
    }

    /// `|s| - sqrt(2/3) k`.
    #[inline]
    fn beyond<N: Number>(&self, constants: &Constants<N>, square: N, last: N) -> N {
        let allowed = if self.has_overstress {
            constants.allowed(last)
        } else {
            constants.yield_stress + constants.modulus * last
        };
        let size = if square.value() > 0.0 { square.sqrt() } else { N::constant(0.0) };
        size - allowed.times(ROOT)
    }

    /// Whether flow needs no stress to begin, so that there is no yield surface.
    fn creeps(&self, constants: &Constants<f64>) -> bool {
        self.has_overstress && constants.yield_stress == 0.0 && constants.modulus == 0.0
    }

    /// The equivalent plastic strain.
    #[must_use]
    pub fn plastic_strain<N: Number>(&self, constants: &[N], z: &[N]) -> N {
        let last = z[self.entries()];
        if self.has_overstress { last } else { Constants::of(constants).alpha(last).0 }
    }

    /// The elastic stretch along the first axis by which a body is on the yield surface.
    fn stretch_to_yield<N: Number>(&self, constants: &Constants<N>) -> N {
        // |s| = 2 mu sqrt(2) ln(l), in one dimension 2 mu sqrt(3/2) ln(l).
        let share = if self.dimension == 1 { 1.0 / 3.0 } else { 1.0 / (2.0 * 3.0_f64.sqrt()) };
        ((constants.yield_stress / constants.mu).times(share)).exp()
    }
}

fn values<N: Number>(constants: &Constants<N>) -> Constants<f64> {
    Constants {
        lambda: constants.lambda.value(),
        mu: constants.mu.value(),
        yield_stress: constants.yield_stress.value(),
        modulus: constants.modulus.value(),
        exponent: constants.exponent.value(),
    }
}

impl LawWithHistory for Flow {
    fn constants(&self) -> Vec<String> {
        let always = ["lambda", "mu", "yield-stress", "modulus", "exponent"];
        let of_rates = ["drag", "rate-exponent", "time"];
        let of_rates = if self.has_overstress { &of_rates[..] } else { &[] };
        always.iter().chain(of_rates).map(|&name| name.to_owned()).collect()
    }

    fn variables(&self) -> Vec<String> {
        let of_G = ENTRIES[..self.entries()].iter().map(|&(i, j)| format!("G{}{}", i + 1, j + 1));
        let last = if self.has_overstress { "alpha" } else { "w" };
        of_G.chain([last.into()]).collect()
    }

    fn initial<N: Number>(&self, constants: &[N], frame: &Tensor<f64>) -> Vec<N> {
        let one = N::constant(1.0);
        let mut along_axes = [one; 3];
        if self.is_on_yield {
            let stretch = self.stretch_to_yield(&Constants::of(constants));
            let square = stretch * stretch;
            along_axes = match self.dimension {
                1 => [square, one / stretch, one / stretch],
                _ => [square, one / square, one],
            };
        }
        let is_turned = self.is_on_yield && *frame != identity();
        let entry = |(a, b): (usize, usize)| match is_turned {
            true => (0..3).fold(N::constant(0.0), |sum, i| {
                sum + along_axes[i].times(frame[i][a] * frame[i][b])
            }),
            false => {
                if a == b {
                    along_axes[a]
                } else {
                    N::constant(0.0)
                }
            }
        };
        let of_G = ENTRIES[..self.entries()].iter().map(|&indices| entry(indices));
        of_G.chain([N::constant(0.0)]).collect()
    }

    #[inline]
    fn rate<N: Number>(
        &self,
        at: &Kinematics<N>,
        constants: &[N],
        z: &[N],
        branch: Branch,
        rates: &mut [N],
    ) {
        if branch == Branch::Elastic {
            rates.fill(N::constant(0.0));
            return;
        }
        let space = self.space();
        let own = Constants::of(constants);
        let State { G, s, square, .. } = self.state(&at.F, own.mu, z);
        let last = z[self.entries()];
        // `gamma' n = factor s`, and the rate of the last variable.
        let (factor, rate_of_last) = if self.has_overstress {
            let (drag, exponent, time) = (constants[5], constants[6], constants[7]);
            if self.creeps(&values(&own)) {
                // gamma' n = (|s|/drag)^m/(time |s|) s without the quotient, which has no value at rest.
                let ratio = square / (drag * drag);
                let half = N::constant(0.5);
                let factor = power(ratio, (exponent - N::constant(1.0)) * half) / (time * drag);
                (factor, power(ratio, exponent * half) / time)
            } else {
                let over = self.beyond(&own, square, last) / drag;
                let gamma = power(over, exponent) / time;
                let is_moving = square.value() > 0.0 && over.value() > 0.0;
                let size = if is_moving { square.sqrt() } else { N::constant(1.0) };
                if is_moving { (gamma / size, gamma) } else { (N::constant(0.0), N::constant(0.0)) }
            }
        } else {
            // n : d = |s|^-1 tr(s F' F^-1), in the pulled back frame tr(F^-1 s F . F^-1 F').
            let along = space.contraction_with_transpose(&s, &space.solved(&at.F, &at.rate));
            let (_, alpha_slope) = own.alpha(last);
            // (n : d) / (1 + k'(alpha)/(3 mu)) with k' = modulus / alpha_slope.
            let stiffness = own.modulus / own.mu.times(3.0);
            let size = square.sqrt();
            let rate_of_w = along / ((alpha_slope + stiffness) * size);
            (rate_of_w * alpha_slope / size, rate_of_w)
        };
        let flow = space.product(&s, &G);
        let factor = factor.times(-1.0);
        for (rate, &(i, j)) in rates.iter_mut().zip(&ENTRIES[..self.entries()]) {
            *rate = if i == j {
                flow[i][i].times(2.0) * factor
            } else {
                (flow[i][j] + flow[j][i]) * factor
            };
        }
        rates[self.entries()] = rate_of_last.times(ROOT);
    }

    fn first_piola_kirchhoff<N: Number>(
        &self,
        at: &Kinematics<N>,
        constants: &[N],
        z: &[N],
    ) -> Tensor<N> {
        let space = self.space();
        let own = Constants::of(constants);
        let State { logarithm, s, .. } = self.state(&at.F, own.mu, z);
        // tau = lambda tr(e) I + 2 mu e with e = ln(A)/2.
        let mean = logarithm.trace * (own.lambda.times(0.5) + own.mu.times(1.0 / 3.0));
        // P = tau F^-T = F (F^-1 tau F) F^-1 F^-T = F tau(A) C^-1, with C^-1 = F^-1 F^-T.
        let pulled = tensor(|i, j| if i == j { s[i][i] + mean } else { s[i][j] });
        let to_reference = space.inverse(&at.F);
        let spatial = space.product(&space.product(&at.F, &pulled), &to_reference);
        space.product(&spatial, &space.transpose(&to_reference))
    }

    fn has_branches(&self) -> bool {
        true
    }

    fn first_branch(&self, at: &Kinematics<f64>, constants: &[f64], z: &[f64]) -> Branch {
        if self.creeps(&Constants::of(constants)) {
            return Branch::Flowing;
        }
        let left = self.margin(at, constants, z, Branch::Elastic);
        let grows = if self.has_overstress {
            // Some share of the yield stress beyond the surface.
            left < -ON_SURFACE
        } else {
            left <= ON_SURFACE && self.margin(at, constants, z, Branch::Flowing) > 0.0
        };
        if grows { Branch::Flowing } else { Branch::Elastic }
    }

    fn resolution(&self, constants: &[f64]) -> f64 {
        let own = Constants::of(constants);
        let stress = if own.yield_stress > 0.0 || !self.has_overstress {
            own.yield_stress
        } else {
            constants[5]
        };
        ROOT * stress / (2.0 * own.mu)
    }

    fn excess(&self, at: &Kinematics<f64>, constants: &[f64], z: &[f64]) -> f64 {
        if self.has_overstress {
            return 0.0;
        }
        -self.margin(at, constants, z, Branch::Elastic)
    }

    fn margin<N: Number>(&self, at: &Kinematics<N>, constants: &[N], z: &[N], branch: Branch) -> N {
        let own = Constants::of(constants);
        if self.creeps(&values(&own)) {
            return N::constant(1.0);
        }
        let space = self.space();
        let State { s, square, .. } = self.state(&at.F, own.mu, z);
        let beyond = self.beyond(&own, square, z[self.entries()]) / own.unit();
        match branch {
            Branch::Elastic => -beyond,
            Branch::Flowing if self.has_overstress => beyond,
            Branch::Flowing => {
                let to_reference = space.inverse(&at.F);
                let l = space.product(&at.rate, &to_reference);
                let d = tensor(|i, j| (l[i][j] + l[j][i]).times(0.5));
                let of_d = space.contraction_with_transpose(&d, &d);
                // Nothing moves: nothing changes.
                if of_d.value() == 0.0 || square.value() == 0.0 {
                    return N::constant(1.0);
                }
                let pulled = space.product(&to_reference, &at.rate);
                space.contraction_with_transpose(&s, &pulled) / (square * of_d).sqrt()
            }
        }
    }

    fn halving_time(
        &self,
        at: &Kinematics<f64>,
        constants: &[f64],
        z: &[f64],
        rates: &[f64],
    ) -> f64 {
        let own = Constants::of(constants);
        // Elsewhere flow ends before the stress does.
        if !self.creeps(&own) {
            return f64::INFINITY;
        }
        let along = |value: f64, rate: f64| Dual { value, slopes: [rate] };
        let F = tensor(|i, j| along(at.F[i][j], at.rate[i][j]));
        let z: Vec<_> = z.iter().zip(rates).map(|(&z, &rate)| along(z, rate)).collect();
        let State { s, square, .. } = self.state(&F, Dual::constant(own.mu), &z);
        let rate = tensor(|i, j| s[i][j].slopes[0]);
        let of_rate = self.space().contraction_with_transpose(&rate, &rate).abs();
        if of_rate == 0.0 {
            return f64::INFINITY;
        }
        let share = if square.slopes[0] < 0.0 { 0.5 } else { 1.0 };
        share * (square.value / of_rate).sqrt()
    }

    fn smoothness(&self, constants: &[f64], z: &[f64], begins: Branch) -> Smoothness {
        let own = Constants::of(constants);
        if self.has_overstress {
            // The rate of flow begins with the power of the overstress, and the body force has its slope.
            return match constants[6] {
                exponent if exponent >= 2.0 => Smoothness::Smooth,
                _ => Smoothness::Kink,
            };
        }
        match begins {
            Branch::Elastic => Smoothness::Kink,
            // Where the material has flown before, hardening has a finite slope.
            Branch::Flowing if own.modulus == 0.0 || z[self.entries()] > 0.0 => Smoothness::Jump,
            Branch::Flowing if own.exponent >= 1.0 => Smoothness::Jump,
            // alpha grows as the power 1/exponent of the distance behind the front; the body force as that less one.
            Branch::Flowing if own.exponent <= (1.0 / 3.0) * (1.0 + 1e-12) => Smoothness::Smooth,
            Branch::Flowing => Smoothness::Kink,
        }
    }

    fn residuals(
        &self,
        at: &Kinematics<f64>,
        constants: &[f64],
        z: &[f64],
        branch: Branch,
    ) -> Residuals {
        let is_on_surface = branch == Branch::Flowing && !self.has_overstress;
        let yield_condition =
            if is_on_surface { self.margin(at, constants, z, Branch::Elastic).abs() } else { 0.0 };
        let volume = (determinant(&self.inverse_of_plastic(z)) - 1.0).abs();
        Residuals { yield_condition, volume }
    }

    fn observable_names(&self) -> Vec<String> {
        let of_G = ENTRIES.iter().map(|&(i, j)| format!("G{}{}", i + 1, j + 1));
        of_G.chain(["alpha".into()]).collect()
    }

    fn observables<N: Number>(&self, constants: &[N], z: &[N]) -> Vec<N> {
        let mut all = z[..self.entries()].to_vec();
        all.resize(6, N::constant(0.0));
        all.push(self.plastic_strain(constants, z));
        all
    }
}
