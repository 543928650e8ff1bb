//! Finite linear viscoelasticity: Maxwell elements beside each other.

use mmsmith_vocabulary::Volumetric;

use crate::law::{Branch, Kinematics, LawWithHistory};
use crate::number::{Dual, Number};
use crate::tensor::{
    ENTRIES, Space, Tensor, identity, symmetric, symmetric_product, tensor, trace,
};

/// The elastic part of a law with Maxwell elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ElasticPart {
    /// `sigma = lambda tr(e) I + 2 mu e` with `e = sym(F) - I`, and `P = sigma`.
    LinearElastic,
    /// `W = c1 x + c2 x^2 + c3 x^3`, `x = J^(-2/3) tr(C) - 3`.
    Yeoh(Volumetric),
    /// `W = -mu Jm/2 ln(1 - x/Jm)`.
    Gent(Volumetric),
    /// The series of Arruda and Boyce.
    ArrudaBoyce(Volumetric),
}

impl ElasticPart {
    fn constants(self) -> &'static [&'static str] {
        match self {
            Self::LinearElastic => &["lambda", "mu"],
            Self::Yeoh(_) => &["c1", "c2", "c3", "kappa"],
            Self::Gent(_) => &["mu", "Jm", "kappa"],
            Self::ArrudaBoyce(_) => &["mu", "N", "kappa"],
        }
    }

    /// `dW/dx` of an isochoric energy, at `x`.
    fn slope<N: Number>(self, constants: &[N], x: N) -> N {
        let number = N::constant;
        match (self, constants) {
            (Self::Yeoh(_), &[c1, c2, c3, ..]) => c1 + x * (c2.times(2.0) + x * c3.times(3.0)),
            (Self::Gent(_), &[mu, Jm, ..]) => mu.times(0.5) / (number(1.0) - x / Jm),
            (Self::ArrudaBoyce(_), &[mu, N, ..]) => {
                let ratio = (x + number(3.0)) / N;
                let series = number(0.5)
                    + ratio
                        * (number(1.0 / 10.0)
                            + ratio
                                * (number(11.0 / 350.0)
                                    + ratio
                                        * (number(19.0 / 1750.0)
                                            + ratio.times(519.0 / 134_750.0))));
                mu * series
            }
            _ => unreachable!("a law gets the constants that it names"),
        }
    }
}

/// `J U'(J)`.
fn pressure<N: Number>(volumetric: Volumetric, J: N) -> N {
    let one = N::constant(1.0);
    match volumetric {
        Volumetric::Logarithmic => J.ln(),
        Volumetric::Quadratic => (J - one) * J,
        Volumetric::Mixed => ((J - one) * (J + one)).times(0.5),
    }
}

/// `S = S_vol + (1 - sum g_i) S_iso + sum Q_i` with `Q_i' + Q_i/tau_i = g_i d/dt S_iso`; in linear elasticity the same of the deviator of
/// the stress. The constants are those of the elastic part, then `share1`, `time1`, `share2`, ...
///
/// Source: J. C. Simo, "On a fully three-dimensional finite-strain viscoelastic damage model", CMAME 60 (1987) 153-173.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Maxwell {
    /// The number of dimensions. Below three there is no shear out of the plane.
    pub dimension: usize,
    /// The elastic part.
    pub elastic: ElasticPart,
    /// The number of elements.
    pub elements: usize,
}

impl Maxwell {
    fn space(&self) -> Space {
        if self.dimension < 3 { Space::Plane } else { Space::Whole }
    }

    /// The number of entries of `Q` of an element.
    fn entries(&self) -> usize {
        if self.dimension < 3 { 4 } else { 6 }
    }

    /// The share and the time of each element.
    fn elements<'a, N: Number>(&self, constants: &'a [N]) -> impl Iterator<Item = [N; 2]> + 'a {
        constants[self.elastic.constants().len()..].as_chunks::<2>().0.iter().copied()
    }

    fn names(&self, entries: usize) -> Vec<String> {
        let of_element = |k: usize| {
            ENTRIES[..entries].iter().map(move |&(i, j)| format!("Q{}_{}{}", k + 1, i + 1, j + 1))
        };
        (0..self.elements).flat_map(of_element).collect()
    }

    /// The part of the stress that relaxes: `S_iso`, in linear elasticity the deviator of `sigma`. And the rest: `S_vol`, or the pressure.
    fn stresses<N: Number>(&self, F: &Tensor<N>, constants: &[N]) -> [Tensor<N>; 2] {
        let space = self.space();
        let volumetric = match self.elastic {
            ElasticPart::LinearElastic => {
                let one = identity::<N>();
                let e = symmetric(&tensor(|i, j| F[i][j] - one[i][j]));
                let sum = trace(&e);
                let mean = sum.times(1.0 / 3.0);
                let twice = constants[1].times(2.0);
                let s = tensor(|i, j| (e[i][j] - one[i][j] * mean) * twice);
                let pressure = (constants[0] + constants[1].times(2.0 / 3.0)) * sum;
                return [s, tensor(|i, j| one[i][j] * pressure)];
            }
            ElasticPart::Yeoh(volumetric)
            | ElasticPart::Gent(volumetric)
            | ElasticPart::ArrudaBoyce(volumetric) => volumetric,
        };
        let C = symmetric_product(space, F);
        let to_reference = space.inverse(&C);
        let J = space.determinant(F);
        let factor = J.powf(-2.0 / 3.0);
        let of_C = trace(&C);
        let third = of_C.times(1.0 / 3.0);
        let excess = factor * of_C - N::constant(3.0);
        let factor = factor * self.elastic.slope(constants, excess).times(2.0);
        let S = space.tensor(|i, j| {
            let lateral = -(third * to_reference[i][j]);
            (if i == j { lateral + N::constant(1.0) } else { lateral }) * factor
        });
        let kappa = constants[self.elastic.constants().len() - 1];
        let pressure = kappa * pressure(volumetric, J);
        [S, space.map(&to_reference, |entry| entry * pressure)]
    }
}

impl LawWithHistory for Maxwell {
    fn constants(&self) -> Vec<String> {
        let elastic = self.elastic.constants().iter().map(|&name| name.to_owned());
        let of_element = |k: usize| [format!("share{k}"), format!("time{k}")];
        elastic.chain((1..=self.elements).flat_map(of_element)).collect()
    }

    fn variables(&self) -> Vec<String> {
        self.names(self.entries())
    }

    fn initial<N: Number>(&self, _: &[N], _: &Tensor<f64>) -> Vec<N> {
        vec![N::constant(0.0); self.elements * self.entries()]
    }

    #[inline]
    fn rate<N: Number>(
        &self,
        at: &Kinematics<N>,
        constants: &[N],
        z: &[N],
        _: Branch,
        rates: &mut [N],
    ) {
        // Along the rate of deformation.
        let F = tensor(|i, j| Dual { value: at.F[i][j], slopes: [at.rate[i][j]] });
        let own = self.elastic.constants().len();
        let mut steady = [Dual::<N, 1>::constant(0.0); 4];
        for (steady, &value) in steady.iter_mut().zip(&constants[..own]) {
            steady.value = value;
        }
        let [S, _] = self.stresses(&F, &steady[..own]);
        let entries = self.entries();
        for (k, [share, time]) in self.elements(constants).enumerate() {
            let places = k * entries..(k + 1) * entries;
            let of_element = rates[places.clone()].iter_mut().zip(&z[places]);
            for ((rate, &Q), &(i, j)) in of_element.zip(&ENTRIES) {
                *rate = S[i][j].slopes[0] * share - Q / time;
            }
        }
    }

    fn first_piola_kirchhoff<N: Number>(
        &self,
        at: &Kinematics<N>,
        constants: &[N],
        z: &[N],
    ) -> Tensor<N> {
        let [S, rest] = self.stresses(&at.F, constants);
        let mut long_term = N::constant(1.0);
        for [share, _] in self.elements(constants) {
            long_term = long_term - share;
        }
        let mut all = tensor(|i, j| rest[i][j] + S[i][j] * long_term);
        for Q in z.chunks_exact(self.entries()) {
            for (&(i, j), &value) in ENTRIES.iter().zip(Q) {
                all[i][j] = all[i][j] + value;
                if i != j {
                    all[j][i] = all[j][i] + value;
                }
            }
        }
        match self.elastic {
            ElasticPart::LinearElastic => all,
            _ => self.space().product(&at.F, &all),
        }
    }

    fn observable_names(&self) -> Vec<String> {
        self.names(6)
    }

    fn observables<N: Number>(&self, _: &[N], z: &[N]) -> Vec<N> {
        let mut all = Vec::with_capacity(6 * self.elements);
        for Q in z.chunks_exact(self.entries()) {
            all.extend_from_slice(Q);
            all.resize(all.len().next_multiple_of(6), N::constant(0.0));
        }
        all
    }
}
