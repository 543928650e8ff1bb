//! Laws that a solver may have computed in place of the right one: other moduli, other formulas of the same moduli.

use mmsmith_mpm::{Law, Material};
use mmsmith_runtime::Law as Declared;
use mmsmith_runtime::{Stated, Volumetric};
use nalgebra::SMatrix;

use crate::case::law;
use crate::inverse::{determinant, inverse};
use crate::precision::Precision;

/// Differences of a stress leave this much of moduli at rest.
const ROUNDING: f64 = 1e-6;

/// The Lame constants of a law at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lame {
    pub(super) lambda: f64,
    pub(super) mu: f64,
}

impl Lame {
    /// Young's modulus and Poisson's ratio.
    pub(super) fn young(self) -> (f64, f64) {
        let Self { lambda, mu } = self;
        (mu * (3.0 * lambda + 2.0 * mu) / (lambda + mu), 0.5 * lambda / (lambda + mu))
    }

    /// The constants of these names that a law states, where they are these values but for rounding.
    fn exact_of(self, declared: &Declared<f64>) -> Self {
        let Declared::Stated(Stated { constants, .. }) = declared else { return self };
        let named = |wanted: &str, known: f64| {
            let mut named = constants.iter().filter(|(name, _)| name == wanted);
            let value = named.next().map_or(known, |(_, value)| *value);
            if (value - known).abs() <= ROUNDING * self.mu.abs() { value } else { known }
        };
        Self { lambda: named("lambda", self.lambda), mu: named("mu", self.mu) }
    }
}

/// The law of a solution, and how it is declared, so that it can be had with other constants.
pub(super) struct Known<const D: usize> {
    declared: Declared<f64>,
    pub(super) law: Law<f64, D>,
    /// Nothing for a law that is not isotropic at rest.
    pub(super) lame: Option<Lame>,
    pub(super) stiffness: f64,
}

impl<const D: usize> Known<D>
where
    f64: Precision<D>,
{
    /// Nothing for a law whose directions turn from place to place.
    pub(super) fn new(declared: Declared<f64>) -> Option<Self> {
        let law = law::<f64, D>(declared.clone()).ok()?;
        let lame = law.lame_constants().map(|(lambda, mu)| Lame { lambda, mu });
        let lame = lame.or_else(|| Some(at_rest(&law)?.exact_of(&declared)));
        let stiffness = law.p_wave_modulus().abs();
        Some(Self { declared, law, lame, stiffness })
    }

    /// All of it with other constants.
    pub(super) fn at(&self, lame: Lame) -> Option<Self> {
        let (law, declared) = (self.with_lame(lame)?, self.declared.clone());
        Some(Self { declared, law, lame: Some(lame), stiffness: self.stiffness })
    }

    /// The law with other constants, where it has such by these names.
    pub(super) fn with_lame(&self, other: Lame) -> Option<Law<f64, D>> {
        let mut found = 0;
        let mut change = |name: &str, value: f64| match name {
            "lambda" => {
                found += 1;
                other.lambda
            }
            "mu" => {
                found += 1;
                other.mu
            }
            _ => value,
        };
        let changed = match self.declared.clone() {
            Declared::Library(material) => Declared::Library(material.map_named(&mut change)),
            Declared::Stated(stated) => {
                let constants = stated.constants.into_iter();
                let constants =
                    constants.map(|(name, value)| (name.clone(), change(&name, value))).collect();
                Declared::Stated(Stated { constants, ..stated })
            }
            Declared::WithMemory(_) => return None,
        };
        if found == 2 { law(changed).ok() } else { None }
    }

    /// Whether stresses are linear in both Lame constants.
    pub(super) fn is_linear_in_lame(&self) -> bool {
        use Material::{Hencky, LinearElastic, NeoHookean, StVenantKirchhoff};
        let Declared::Library(material) = &self.declared else { return false };
        matches!(
            material,
            NeoHookean { .. } | StVenantKirchhoff { .. } | Hencky { .. } | LinearElastic { .. }
        )
    }

    fn has_name(&self, name: &str) -> bool {
        matches!(&self.declared, Declared::Library(material) if material.row().name == name)
    }

    /// The laws that may stand in place of this one, by their kinds.
    pub(super) fn variants(&self) -> Vec<(&'static str, Variant<D>)> {
        let Some(own) = self.lame else { return vec![] };
        let Lame { lambda, mu } = own;
        let (E, nu) = own.young();
        let moduli = [
            ("law-lame-exchanged", Lame { lambda: mu, mu: lambda }),
            ("law-young-poisson", Lame { lambda: E, mu: nu }),
            ("law-plane-stress", Lame { lambda: 2.0 * lambda * mu / (lambda + 2.0 * mu), mu }),
            ("law-bulk-modulus", Lame { lambda: lambda + 2.0 / 3.0 * mu, mu }),
            ("law-twice-mu", Lame { lambda, mu: 2.0 * mu }),
            ("law-half-mu", Lame { lambda, mu: 0.5 * mu }),
        ];
        let moduli = moduli.into_iter().filter(|(kind, _)| *kind != "law-plane-stress" || D == 2);
        let of_moduli =
            moduli.filter_map(|(kind, moduli)| Some((kind, Variant::Law(self.with_lame(moduli)?))));
        let kappa = lambda + 2.0 / 3.0 * mu;
        let isochoric =
            |volumetric| Material::Yeoh { c1: 0.5 * mu, c2: 0.0, c3: 0.0, kappa, volumetric };
        let laws = [
            ("law-neo-hookean", Material::NeoHookean { lambda, mu }),
            ("law-st-venant-kirchhoff", Material::StVenantKirchhoff { lambda, mu }),
            ("law-hencky", Material::Hencky { lambda, mu }),
            ("law-isochoric-logarithmic", isochoric(Volumetric::Logarithmic)),
            ("law-isochoric-quadratic", isochoric(Volumetric::Quadratic)),
            ("law-isochoric-mixed", isochoric(Volumetric::Mixed)),
        ];
        let of_laws = laws.into_iter().filter(|(kind, _)| !self.has_name(&kind["law-".len()..]));
        let of_laws = of_laws.map(|(kind, material)| (kind, Variant::Law(Law::from(material))));
        let pressures: [(_, OfVolume); 3] = [
            ("law-pressure-j-squared", |J| 0.5 * (J * J - 1.0)),
            ("law-pressure-j-times", |J| J * (J - 1.0)),
            ("law-pressure-linear", |J| J - 1.0),
        ];
        let of_pressures =
            pressures.map(|(kind, of_J)| (kind, Variant::NeoHookean { own, of_J, at_rest: 1.0 }));
        let unbalanced = Variant::NeoHookean { own, of_J: f64::ln, at_rest: 0.0 };
        let unbalanced =
            (!self.has_name("linear-elastic")).then_some(("law-stress-at-rest", unbalanced));
        let small = (!self.has_name("linear-elastic"))
            .then_some(("law-small-strain", Variant::SmallStrain));
        of_moduli.chain(small).chain(of_laws).chain(of_pressures).chain(unbalanced).collect()
    }

    /// The first Piola-Kirchhoff stress of a variant; nothing where F is no deformation.
    pub(super) fn stress(
        &self,
        variant: &Variant<D>,
        F: &SMatrix<f64, D, D>,
    ) -> Option<SMatrix<f64, D, D>> {
        match variant {
            Variant::Law(law) => law.first_piola_kirchhoff(F),
            Variant::SmallStrain => {
                Some(self.law.stress_at_small_strain(&(F - SMatrix::identity())))
            }
            Variant::NeoHookean { own, of_J, at_rest } => {
                let K = inverse(F)?.transpose();
                let J = determinant(F);
                (J > 0.0).then(|| (F - K * *at_rest) * own.mu + K * (own.lambda * of_J(J)))
            }
        }
    }
}

/// The factor of `lambda` in a pressure, from J.
type OfVolume = fn(f64) -> f64;

/// A law in place of the right one.
pub(super) enum Variant<const D: usize> {
    Law(Law<f64, D>),
    /// The moduli at rest times `F - I`.
    SmallStrain,
    /// `P = mu (F - at_rest F^-T) + lambda of_J(J) F^-T`.
    NeoHookean {
        own: Lame,
        of_J: OfVolume,
        at_rest: f64,
    },
}

/// The Lame constants of a stated law, where its stress at rest is that of an isotropic one.
fn at_rest<const D: usize>(law: &Law<f64, D>) -> Option<Lame>
where
    f64: Precision<D>,
{
    if D == 1 {
        return None;
    }
    let unit = |i: usize, j: usize| {
        let mut H = SMatrix::<f64, D, D>::zeros();
        H[(i, j)] = 1.0;
        law.stress_at_small_strain(&H)
    };
    let (normal, shear) = (unit(0, 0), unit(0, 1));
    let found = Lame { lambda: normal[(1, 1)], mu: shear[(0, 1)] };
    let size = normal.amax();
    let other = unit(1, 1);
    let is_close = |one: f64, other: f64| (one - other).abs() <= ROUNDING * size;
    let is_isotropic = is_close(normal[(0, 0)], found.lambda + 2.0 * found.mu)
        && is_close(other[(1, 1)], normal[(0, 0)])
        && is_close(other[(0, 0)], found.lambda);
    is_isotropic.then_some(found)
}
