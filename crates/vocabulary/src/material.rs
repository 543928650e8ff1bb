//! The laws of the library, a row each.
//!
//! To add a law: a row here, and the solver's own implementation, a file in `mmsmith-mpm` and its line in the table there. The
//! symbolic side follows from the energy in the row; the two share no formula.

use std::fmt;

/// A constant of a law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Constant {
    /// The key in specifications, and the name in formulas.
    pub name: &'static str,
    /// The meaning, in words.
    pub meaning: &'static str,
    /// The usual expression where a specification does not give it; empty where it has to.
    pub usual: &'static str,
}

/// All that is known of a law but the values of its constants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Row {
    /// The name that specifications use.
    pub name: &'static str,
    /// The variant of [`Material`].
    pub variant: &'static str,
    /// The law in a line for people.
    pub formula: &'static str,
    /// The constants, in the order of the variant's fields.
    pub constants: &'static [Constant],
    /// The constant that is the modulus of a change of volume alone, if one is.
    pub volume: Option<&'static str>,
    /// Whether specifications choose the volumetric part, see [`Volumetric`].
    pub chooses_volumetric: bool,
    /// Whether the stress turns with the body.
    pub is_objective: bool,
    /// Whether no direction of the reference configuration differs from another.
    pub is_isotropic: bool,
}

/// The stored energy of a change of volume, per bulk modulus; `U''(1) = 1` for each.
///
/// Sources: Holzapfel, "Nonlinear Solid Mechanics" (2000), section 6.5; Doll & Schweizerhof, J. Appl. Mech. 67 (2000) 17-21.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Volumetric {
    /// `U = (ln J)^2/2`.
    #[default]
    Logarithmic,
    /// `U = (J - 1)^2/2`.
    Quadratic,
    /// `U = (J^2 - 1 - 2 ln J)/4`.
    Mixed,
}

impl Volumetric {
    /// Each by the name that specifications use.
    pub const NAMES: [(&'static str, Self); 3] = [
        ("logarithmic", Self::Logarithmic),
        ("quadratic", Self::Quadratic),
        ("mixed", Self::Mixed),
    ];

    /// The energy as an expression of `J`.
    #[must_use]
    pub fn formula(self) -> &'static str {
        match self {
            Self::Logarithmic => "ln(J)^2/2",
            Self::Quadratic => "(J - 1)^2/2",
            Self::Mixed => "(J^2 - 1 - 2*ln(J))/4",
        }
    }

    /// A measure of the change of volume, `J - 1` to first order, and what `J U'`, the pressure of unit bulk modulus, is beside it:
    /// both as expressions of `J`.
    #[must_use]
    pub fn pressure_parts(self) -> [&'static str; 2] {
        match self {
            Self::Logarithmic => ["ln(J)", "0"],
            Self::Quadratic => ["J - 1", "(J - 1)^2"],
            Self::Mixed => ["J - 1", "(J - 1)^2/2"],
        }
    }

    /// The name of the variant.
    #[must_use]
    pub fn variant(self) -> &'static str {
        match self {
            Self::Logarithmic => "Logarithmic",
            Self::Quadratic => "Quadratic",
            Self::Mixed => "Mixed",
        }
    }
}

/// How the fields of a specification with a law are derived.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Derivation<T> {
    /// From the strain energy but for the volumetric part that is chosen, in `J`, `I1`, `I2`, `C11`, ... and the constants by their
    /// names. Components are those in space: along directions that are left out nothing stretches.
    Energy {
        /// The energy per reference volume.
        W: &'static str,
    },
    /// From an isochoric energy, the volumetric part that is chosen, and what further energy there is.
    Isochoric {
        /// The isochoric energy, in `excess`, `J^(-2/3) I1 - 3`.
        W: &'static str,
        /// Further energy, as [`Derivation::Energy`] has it.
        others: &'static str,
    },
    /// From formulas of the neo-Hookean law.
    NeoHookean {
        /// First Lame constant.
        lambda: T,
        /// Shear modulus.
        mu: T,
    },
    /// From formulas of St. Venant and Kirchhoff's law.
    StVenantKirchhoff {
        /// First Lame constant.
        lambda: T,
        /// Shear modulus.
        mu: T,
    },
    /// From formulas of linear elasticity.
    LinearElastic {
        /// First Lame constant.
        lambda: T,
        /// Shear modulus.
        mu: T,
    },
    /// From the strain energy in principal stretches, where these have a closed form.
    PrincipalStretches(InStretches),
}

/// A strain energy in principal stretches: a sum of a part in `J`, and of parts for principal directions that are known and for
/// a plane of two that are not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InStretches {
    /// The part in `J`; a chosen volumetric part comes to it.
    pub volume: &'static str,
    /// The part of a direction that is known, in `stretch` and `J`.
    pub alone: &'static str,
    /// The part of two directions in a plane with the stretches `a` and `b`, in `J`, in `area`, `a b`, and in `ratio`,
    /// `(a - b)^2/(2 a b)`.
    pub pair: &'static str,
}

impl<T> Derivation<T> {
    const fn energy(W: &'static str) -> Self {
        Self::Energy { W }
    }

    const fn isochoric(W: &'static str) -> Self {
        Self::Isochoric { W, others: "0" }
    }
}

/// A rational number times powers of constants.
#[derive(Clone, Debug, PartialEq)]
pub struct Term<T> {
    /// The numerator and the denominator of the number.
    pub factor: [i64; 2],
    /// The constants with their exponents.
    pub powers: Vec<(T, i32)>,
}

/// The Lame constants of a law at small strain, as sums of terms.
#[derive(Clone, Debug, PartialEq)]
pub struct Moduli<T> {
    /// First Lame constant.
    pub lambda: Vec<Term<T>>,
    /// Shear modulus.
    pub mu: Vec<Term<T>>,
}

/// A name that no law of the library has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownLaw {
    /// The name.
    pub name: String,
}

impl fmt::Display for UnknownLaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<&str> = ROWS.iter().map(|row| row.name).collect();
        write!(f, "the law '{}' is not one of {}", self.name, names.join(", "))
    }
}

impl std::error::Error for UnknownLaw {}

macro_rules! materials {
    ($(
        $(#[$about:meta])*
        $Variant:ident as $name:literal {
            $($constant:ident: $meaning:literal $(or $usual:literal)?,)*
            $([$volumetric:ident])?
        }
        stress: $formula:literal,
        volume: [$($modulus:ident)?],
        derivation: $derivation:expr,
        objective: $objective:literal,
        at_rest: [$(
            lambda: $(($n:literal $(/ $d:literal)? $(, $c:ident ^ $p:literal)*))+,
            mu: $(($n2:literal $(/ $d2:literal)? $(, $c2:ident ^ $p2:literal)*))+
        )?],
    )*) => {
        /// An elastic material: a law of the library with its constants.
        ///
        /// In two dimensions the deformation is plane strain, in one uniaxial strain. Formulas are those of Bonet & Wood,
        /// "Nonlinear Continuum Mechanics for Finite Element Analysis", 2nd ed. (2008), chapter 6, of Ciarlet, "Mathematical
        /// Elasticity" I (1988), chapter 4, and of the sources named with the laws.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum Material<T> {
            $(
                $(#[$about])*
                $Variant {
                    $(
                        #[doc = $meaning]
                        $constant: T,
                    )*
                    $(
                        /// The stored energy of a change of volume.
                        $volumetric: Volumetric,
                    )?
                },
            )*
        }

        /// Every law of the library.
        const ROWS: &[Row] = &[$(
            Row {
                name: $name,
                variant: stringify!($Variant),
                formula: $formula,
                constants: &[$(Constant {
                    name: stringify!($constant),
                    meaning: $meaning,
                    usual: concat!($($usual)?),
                },)*],
                volume: {
                    let modulus: &[&str] = &[$(stringify!($modulus))?];
                    match modulus {
                        [] => None,
                        [name, ..] => Some(name),
                    }
                },
                chooses_volumetric: {
                    let chosen: &[&str] = &[$(stringify!($volumetric),)?];
                    !chosen.is_empty()
                },
                is_objective: $objective,
                is_isotropic: {
                    let moduli: &[&str] = &[$($(stringify!($n),)+)?];
                    !moduli.is_empty()
                },
            },
        )*];

        impl<T> Material<T> {
            /// Every law of the library.
            pub const ROWS: &'static [Row] = ROWS;

            /// The law of a name, each constant as `value` gives it.
            ///
            /// # Errors
            ///
            /// Errors of `value`, and [`UnknownLaw`].
            pub fn from_constants<E: From<UnknownLaw>>(
                name: &str,
                volumetric: Volumetric,
                mut value: impl FnMut(&'static Constant) -> Result<T, E>,
            ) -> Result<Self, E> {
                let unknown = || UnknownLaw { name: name.to_owned() };
                let row = ROWS.iter().find(|row| row.name == name).ok_or_else(unknown)?;
                let mut constants = row.constants.iter();
                let mut next = || match constants.next() {
                    Some(constant) => value(constant),
                    None => Err(unknown().into()),
                };
                match name {
                    $($name => Ok(Self::$Variant {
                        $($constant: next()?,)*
                        $($volumetric: volumetric,)?
                    }),)*
                    _ => Err(unknown().into()),
                }
            }

            /// This law with `change` applied to each constant.
            #[must_use]
            pub fn map<U>(self, mut change: impl FnMut(T) -> U) -> Material<U> {
                self.map_named(|_, value| change(value))
            }

            /// This law with `change` applied to each constant, by its name.
            #[must_use]
            pub fn map_named<U>(
                self,
                mut change: impl FnMut(&'static str, T) -> U,
            ) -> Material<U> {
                match self {
                    $(Self::$Variant { $($constant,)* $($volumetric,)? } => Material::$Variant {
                        $($constant: change(stringify!($constant), $constant),)*
                        $($volumetric,)?
                    },)*
                }
            }

            /// Properties of the law but for the values of its constants.
            #[must_use]
            pub fn row(&self) -> &'static Row {
                let name = match self {
                    $(Self::$Variant { .. } => $name,)*
                };
                // Every variant has its row.
                ROWS.iter().find(|row| row.name == name).unwrap_or(&ROWS[0])
            }

            /// The volumetric part, where it is chosen.
            #[must_use]
            pub fn volumetric(&self) -> Option<Volumetric> {
                match self {
                    $(Self::$Variant { $($volumetric,)? .. } => {
                        let chosen: &[Volumetric] = &[$(*$volumetric,)?];
                        chosen.first().copied()
                    })*
                }
            }
        }

        impl<T: Copy> Material<T> {
            /// The values of the constants, in the order of their [rows](Row::constants).
            #[must_use]
            pub fn values(&self) -> Vec<T> {
                match *self {
                    $(Self::$Variant { $($constant,)* .. } => vec![$($constant,)*],)*
                }
            }

            /// How the fields of a specification with this law are derived.
            #[must_use]
            #[allow(unused_variables, reason = "energies name the constants themselves")]
            pub fn derivation(&self) -> Derivation<T> {
                match *self {
                    $(Self::$Variant { $($constant,)* .. } => $derivation,)*
                }
            }

            /// The Lame constants at small strain; none for a law that is not isotropic.
            #[must_use]
            #[allow(unused_variables, reason = "not every constant counts at small strain")]
            pub fn moduli(&self) -> Option<Moduli<T>> {
                match *self {
                    $(Self::$Variant { $($constant,)* .. } => {
                        let moduli: &[Moduli<T>] = &[$(Moduli {
                            lambda: vec![$(Term {
                                factor: [$n, [$($d,)? 1][0]],
                                powers: vec![$(($c, $p)),*],
                            }),+],
                            mu: vec![$(Term {
                                factor: [$n2, [$($d2,)? 1][0]],
                                powers: vec![$(($c2, $p2)),*],
                            }),+],
                        })?];
                        moduli.first().cloned()
                    })*
                }
            }
        }
    };
}

materials! {
    /// Compressible neo-Hookean solid.
    ///
    /// With `lambda == 0` the solver uses a law that computes no logarithm.
    NeoHookean as "neo-hookean" {
        lambda: "first Lame constant" or "E*nu/((1 + nu)*(1 - 2*nu))",
        mu: "shear modulus" or "E/(2*(1 + nu))",
    }
    stress: "tau = lambda ln(J) I + mu (F F^T - I)",
    volume: [lambda],
    derivation: Derivation::NeoHookean { lambda, mu },
    objective: true,
    at_rest: [lambda: (1, lambda ^ 1), mu: (1, mu ^ 1)],

    /// St. Venant-Kirchhoff solid.
    ///
    /// It softens without limit in compression; for small and moderate strain.
    StVenantKirchhoff as "st-venant-kirchhoff" {
        lambda: "first Lame constant" or "E*nu/((1 + nu)*(1 - 2*nu))",
        mu: "shear modulus" or "E/(2*(1 + nu))",
    }
    stress: "P = F (lambda tr(E) I + 2 mu E), E = (F^T F - I)/2",
    volume: [lambda],
    derivation: Derivation::StVenantKirchhoff { lambda, mu },
    objective: true,
    at_rest: [lambda: (1, lambda ^ 1), mu: (1, mu ^ 1)],

    /// Hencky's solid, with the left stretch `V = sqrt(F F^T)`.
    Hencky as "hencky" {
        lambda: "first Lame constant" or "E*nu/((1 + nu)*(1 - 2*nu))",
        mu: "shear modulus" or "E/(2*(1 + nu))",
    }
    stress: "tau = lambda ln(J) I + 2 mu ln V",
    volume: [lambda],
    derivation: Derivation::PrincipalStretches(InStretches {
        volume: "lambda/2*ln(J)^2",
        alone: "mu*ln(stretch)^2",
        pair: "mu/2*(ln(area)^2 + lnratio2(ratio))",
    }),
    objective: true,
    at_rest: [lambda: (1, lambda ^ 1), mu: (1, mu ^ 1)],

    /// Linear elasticity, `H = F - I`: linear in displacements of any size, and not invariant under rotation. Its Kirchhoff
    /// stress `P F^T` is symmetric to first order only.
    LinearElastic as "linear-elastic" {
        lambda: "first Lame constant" or "E*nu/((1 + nu)*(1 - 2*nu))",
        mu: "shear modulus" or "E/(2*(1 + nu))",
    }
    stress: "P = lambda tr(H) I + mu (H + H^T)",
    volume: [lambda],
    derivation: Derivation::LinearElastic { lambda, mu },
    objective: false,
    at_rest: [lambda: (1, lambda ^ 1), mu: (1, mu ^ 1)],

    /// Compressible Mooney-Rivlin solid, with the invariants of the three-dimensional `C = F^T F`.
    MooneyRivlin as "mooney-rivlin" {
        c1: "the factor of I1 in the strain energy",
        c2: "the factor of I2 in the strain energy",
        lambda: "the factor of (ln J)^2/2",
    }
    stress: "W = c1 (I1 - 3 - 2 ln J) + c2 (I2 - 3 - 4 ln J) + lambda/2 (ln J)^2",
    volume: [lambda],
    derivation: Derivation::energy("c1*(I1-3-2*ln(J)) + c2*(I2-3-4*ln(J)) + lambda/2*ln(J)^2"),
    objective: true,
    at_rest: [lambda: (1, lambda ^ 1) (4, c2 ^ 1), mu: (2, c1 ^ 1) (2, c2 ^ 1)],

    /// Yeoh's solid: rubber in moderate and large strain, `I1b = J^(-2/3) I1`.
    ///
    /// Source: Yeoh, Rubber Chem. Technol. 66 (1993) 754-771.
    Yeoh as "yeoh" {
        c1: "the factor of I1b - 3 in the strain energy",
        c2: "the factor of (I1b - 3)^2",
        c3: "the factor of (I1b - 3)^3" or "0",
        kappa: "bulk modulus",
        [volumetric]
    }
    stress: "W = c1 (I1b - 3) + c2 (I1b - 3)^2 + c3 (I1b - 3)^3 + kappa U(J), I1b = J^(-2/3) I1",
    volume: [kappa],
    derivation: Derivation::isochoric("c1*excess + c2*excess^2 + c3*excess^3"),
    objective: true,
    at_rest: [lambda: (1, kappa ^ 1) (-4 / 3, c1 ^ 1), mu: (2, c1 ^ 1)],

    /// Gent's solid, whose chains have a largest stretch: `I1b - 3` stays below `Jm`.
    ///
    /// Source: Gent, Rubber Chem. Technol. 69 (1996) 59-61.
    Gent as "gent" {
        mu: "shear modulus" or "E/(2*(1 + nu))",
        Jm: "the limit of I1b - 3",
        kappa: "bulk modulus" or "E/(3*(1 - 2*nu))",
        [volumetric]
    }
    stress: "W = -mu Jm/2 ln(1 - (I1b - 3)/Jm) + kappa U(J), I1b = J^(-2/3) I1",
    volume: [kappa],
    derivation: Derivation::isochoric("-mu*Jm/2*log1p(-excess/Jm)"),
    objective: true,
    at_rest: [lambda: (1, kappa ^ 1) (-2 / 3, mu ^ 1), mu: (1, mu ^ 1)],

    /// Arruda and Boyce's solid of eight chains, five terms of its series; `N` is the square of the locking stretch.
    ///
    /// Source: Arruda & Boyce, J. Mech. Phys. Solids 41 (1993) 389-412.
    ArrudaBoyce as "arruda-boyce" {
        mu: "rubbery modulus",
        N: "links of a chain",
        kappa: "bulk modulus",
        [volumetric]
    }
    stress: "W = mu (1/2 (I1b - 3) + 1/(20 N) (I1b^2 - 9) + 11/(1050 N^2) (I1b^3 - 27) + 19/(7000 N^3) (I1b^4 - 81) \
             + 519/(673750 N^4) (I1b^5 - 243)) + kappa U(J), I1b = J^(-2/3) I1",
    volume: [kappa],
    derivation: Derivation::isochoric(
        "mu*(excess/2 + ((3 + excess)^2 - 9)/(20*N) + 11*((3 + excess)^3 - 27)/(1050*N^2) \
         + 19*((3 + excess)^4 - 81)/(7000*N^3) + 519*((3 + excess)^5 - 243)/(673750*N^4))"
    ),
    objective: true,
    at_rest: [
        lambda: (1, kappa ^ 1) (-2 / 3, mu ^ 1) (-2 / 5, mu ^ 1, N ^ -1) (-66 / 175, mu ^ 1, N ^ -2)
            (-342 / 875, mu ^ 1, N ^ -3) (-28026 / 67375, mu ^ 1, N ^ -4),
        mu: (1, mu ^ 1) (3 / 5, mu ^ 1, N ^ -1) (99 / 175, mu ^ 1, N ^ -2)
            (513 / 875, mu ^ 1, N ^ -3) (42039 / 67375, mu ^ 1, N ^ -4)
    ],

    /// Orthotropic elasticity in Green's strain `E`, along Cartesian axes: linear elasticity where strains are small, and it turns
    /// with the body. Moduli in Voigt's notation, 4 for 23, 5 for 13, 6 for 12.
    ///
    /// Source: Bonet & Burton, Comput. Methods Appl. Mech. Engrg. 162 (1998) 151-164, section 2.
    Orthotropic as "orthotropic" {
        c11: "modulus of S11 for E11",
        c22: "modulus of S22 for E22",
        c33: "modulus of S33 for E33" or "c22",
        c12: "modulus of S11 for E22",
        c13: "modulus of S11 for E33" or "c12",
        c23: "modulus of S22 for E33" or "c12",
        c44: "modulus of S23 for 2 E23" or "c66",
        c55: "modulus of S13 for 2 E13" or "c66",
        c66: "modulus of S12 for 2 E12",
    }
    stress: "P = F S, S11 = c11 E11 + c12 E22 + c13 E33, ..., S12 = 2 c66 E12, ..., E = (F^T F - I)/2",
    volume: [],
    derivation: Derivation::energy(
        "c11*(C11 - 1)^2/8 + c22*(C22 - 1)^2/8 + c33*(C33 - 1)^2/8 + c12*(C11 - 1)*(C22 - 1)/4 \
         + c13*(C11 - 1)*(C33 - 1)/4 + c23*(C22 - 1)*(C33 - 1)/4 + c44*C23^2/2 + c55*C13^2/2 + c66*C12^2/2"
    ),
    objective: true,
    at_rest: [],

    /// Ogden's solid, a sum over powers of the isochoric principal stretches `lb = J^(-1/3) lambda`.
    ///
    /// Source: Ogden, Proc. R. Soc. Lond. A 328 (1972) 567-583.
    Ogden as "ogden" {
        mu1: "the modulus of the first power",
        alpha1: "the first power of isochoric stretches",
        mu2: "the modulus of the second power" or "0",
        alpha2: "the second power" or "2",
        mu3: "the modulus of the third power" or "0",
        alpha3: "the third power" or "2",
        kappa: "bulk modulus",
        [volumetric]
    }
    stress: "W = sum mu_p/alpha_p (lb1^alpha_p + lb2^alpha_p + lb3^alpha_p - 3) + kappa U(J), lb = J^(-1/3) lambda",
    volume: [kappa],
    derivation: Derivation::PrincipalStretches(InStretches {
        volume: "0",
        alone: "mu1/alpha1*expm1(alpha1*(ln(stretch) - ln(J)/3)) + mu2/alpha2*expm1(alpha2*(ln(stretch) - ln(J)/3)) \
                + mu3/alpha3*expm1(alpha3*(ln(stretch) - ln(J)/3))",
        pair: "2*mu1/alpha1*(exp(alpha1*(ln(area)/2 - ln(J)/3))*(1 + cosh_sqrt_m1(alpha1^2/4*lnratio2(ratio))) - 1) \
               + 2*mu2/alpha2*(exp(alpha2*(ln(area)/2 - ln(J)/3))*(1 + cosh_sqrt_m1(alpha2^2/4*lnratio2(ratio))) - 1) \
               + 2*mu3/alpha3*(exp(alpha3*(ln(area)/2 - ln(J)/3))*(1 + cosh_sqrt_m1(alpha3^2/4*lnratio2(ratio))) - 1)",
    }),
    objective: true,
    at_rest: [
        lambda: (1, kappa ^ 1) (-1 / 3, mu1 ^ 1, alpha1 ^ 1) (-1 / 3, mu2 ^ 1, alpha2 ^ 1)
            (-1 / 3, mu3 ^ 1, alpha3 ^ 1),
        mu: (1 / 2, mu1 ^ 1, alpha1 ^ 1) (1 / 2, mu2 ^ 1, alpha2 ^ 1) (1 / 2, mu3 ^ 1, alpha3 ^ 1)
    ],

    /// Soft tissue with one family of fibres along `a = (cos angle, sin angle, 0)`, which carry tension alone:
    /// `I4 = a . C a`, and the positive part of `I4 - 1`.
    ///
    /// Sources: Holzapfel, Gasser & Ogden, J. Elasticity 61 (2000) 1-48; Nolan et al., J. Mech. Behav. Biomed. Mater. 39 (2014)
    /// 48-60, who leave the volume in `I4`.
    HolzapfelGasserOgden as "holzapfel-gasser-ogden" {
        mu: "shear modulus of the matrix",
        k1: "modulus of the fibres",
        k2: "the factor of (I4 - 1)^2 in the exponential",
        angle: "angle of the fibres to the first axis, in radians" or "0",
        kappa: "bulk modulus",
        [volumetric]
    }
    stress: "W = mu/2 (I1b - 3) + k1/(2 k2) (exp(k2 <I4 - 1>^2) - 1) + kappa U(J), I1b = J^(-2/3) I1, I4 = a . C a",
    volume: [kappa],
    derivation: Derivation::Isochoric {
        W: "mu/2*excess",
        others: "k1/(2*k2)*expm1(k2*positive_part(cos(angle)^2*(C11 - 1) \
                 + 2*cos(angle)*sin(angle)*C12 + sin(angle)^2*(C22 - 1))^2)",
    },
    objective: true,
    at_rest: [],
}
