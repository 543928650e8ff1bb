//! Tangent moduli `A = dP/dF` at any deformation.
//!
//! A law of the library is evaluated with dual numbers in place of its numbers: what is differentiated is the stress that solvers form, and
//! no difference cancels. A law that a caller brings tells its own tangent, or has it by differences of
//! fourth order, good to about twelve digits; so has a law with memory, whose internal variables stay as they are.
//!
//! Source: A. Griewank and A. Walther, "Evaluating Derivatives", 2nd ed. (2008), chapter 3 (dual numbers).

use mmsmith_vocabulary::Material;
use nalgebra::SMatrix;
use num_dual::Dual64;

use crate::memory::{BlockWithMemory, InternalVariable};
use crate::{AnyLaw, BLOCK, BlockOfStresses, ConstitutiveLaw, Law, LibraryLaw, in_stresses};

/// `A[k][L]` is the derivative of P with respect to `F_kL`.
pub type Tangent<const D: usize> = [[SMatrix<f64, D, D>; D]; D];

/// Numbers whose tangents are compiled with this crate.
pub trait Differentiated<const D: usize> {
    /// Writes the tangents at deformation gradients, with the internal variables of each, those of a particle one after the other. They are
    /// not numbers where F is no deformation.
    fn tangents(law: &Law<f64, D>, F: &[SMatrix<f64, D, D>], q: &[f64], A: &mut [Tangent<D>]);
}

macro_rules! differentiated {
    ($($D:literal)*) => {
        $(impl Differentiated<$D> for f64 {
            fn tangents(
                law: &Law<f64, $D>,
                F: &[SMatrix<f64, $D, $D>],
                q: &[f64],
                A: &mut [Tangent<$D>],
            ) {
                match law {
                    Law::Library(material) => {
                        let material = in_stresses(material);
                        let both = F.iter().zip(A);
                        both.for_each(|(F, A)| *A = of_library(&material, F));
                    }
                    Law::Own(law) => of_caller(law.as_ref(), F, A),
                    Law::WithMemory(law) => {
                        let variables = law.variables();
                        let stresses = |p: usize, F: &[SMatrix<f64, $D, $D>]| {
                            let own = q[p * variables.len()..][..variables.len()].repeat(F.len());
                            with_memory(&variables, |block| {
                                block.first_piola_kirchhoff(law.as_ref(), F, &own);
                            })
                        };
                        by_differences(F, A, &stresses);
                    }
                }
            }
        })*
    };
}

differentiated! { 1 2 3 }

/// The tangent of a law of the library.
fn of_library<const D: usize>(material: &Material<f64>, F: &SMatrix<f64, D, D>) -> Tangent<D> {
    let law = AnyLaw(material.map(Dual64::from_re));
    let mut A = [[SMatrix::repeat(f64::NAN); D]; D];
    if crate::jacobian(F).is_none() {
        return A;
    }
    for (k, l) in (0..D * D).map(|m| (m / D, m % D)) {
        let mut along = F.map(Dual64::from_re);
        along[(k, l)] = along[(k, l)].derivative();
        A[k][l] = law.first_piola_kirchhoff(&along).map(|stress| stress.eps);
    }
    A
}

/// The tangent of a law that the caller brings: its own, or by differences.
fn of_caller<const D: usize>(
    law: &dyn ConstitutiveLaw<f64, D>,
    F: &[SMatrix<f64, D, D>],
    A: &mut [Tangent<D>],
) {
    let mut is_told = true;
    for (F, A) in F.chunks(BLOCK).zip(A.chunks_mut(BLOCK)) {
        let mut block = BlockOfStresses::at_rest();
        F.iter().enumerate().for_each(|(n, F)| block.set(n, F));
        for (k, l) in (0..D * D).map(|m| (m / D, m % D)) {
            is_told = is_told && block.evaluate_slope(law, [k, l]);
            for (n, A) in A.iter_mut().enumerate() {
                A[k][l] = block.stress(n);
            }
        }
    }
    if is_told {
        return;
    }
    by_differences(F, A, &|_, F| {
        let mut block = BlockOfStresses::at_rest();
        F.iter().enumerate().for_each(|(n, F)| block.set(n, F));
        block.evaluate(law);
        (0..F.len()).map(|n| block.stress(n)).collect()
    });
}

/// The stresses of a block with memory, as `work` computes them.
fn with_memory<const D: usize>(
    variables: &[InternalVariable],
    work: impl FnOnce(&mut BlockWithMemory<f64, D>),
) -> Vec<SMatrix<f64, D, D>> {
    let mut block = BlockWithMemory::at_rest(variables);
    work(&mut block);
    (0..BLOCK).map(|n| block.stress(n)).collect()
}

/// Stresses of a particle at deformations, of which there are no more than a block has.
type Stresses<'a, const D: usize> =
    &'a dyn Fn(usize, &[SMatrix<f64, D, D>]) -> Vec<SMatrix<f64, D, D>>;

/// Tangents by differences of fourth order.
fn by_differences<const D: usize>(
    F: &[SMatrix<f64, D, D>],
    A: &mut [Tangent<D>],
    stresses: Stresses<'_, D>,
) {
    /// Truncation and rounding leave about 1e-12 each.
    const STEP: f64 = 1e-3;
    const PLACES: [f64; 4] = [STEP, -STEP, 2.0 * STEP, -2.0 * STEP];
    for (p, (F, A)) in F.iter().zip(A).enumerate() {
        let mut moved = Vec::with_capacity(4 * D * D);
        for (k, l) in (0..D * D).map(|m| (m / D, m % D)) {
            moved.extend(PLACES.map(|by| {
                let mut moved = *F;
                moved[(k, l)] += by;
                moved
            }));
        }
        let found = stresses(p, &moved);
        for (m, P) in found.chunks_exact(PLACES.len()).take(D * D).enumerate() {
            let slope = ((P[0] - P[1]) * 8.0 - (P[2] - P[3])) / (12.0 * STEP);
            A[m / D][m % D] = slope;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Volumetric;

    /// The laws of the library, once each or with each volumetric energy that matters.
    fn laws() -> Vec<Material<f64>> {
        let (kappa, volumetric) = (7.0, Volumetric::Mixed);
        vec![
            Material::NeoHookean { lambda: 5.0, mu: 3.0 },
            Material::NeoHookean { lambda: 0.0, mu: 3.0 },
            Material::StVenantKirchhoff { lambda: 5.0, mu: 3.0 },
            Material::Hencky { lambda: 5.0, mu: 3.0 },
            Material::MooneyRivlin { c1: 1.2, c2: 0.6, lambda: 5.0 },
            Material::LinearElastic { lambda: 5.0, mu: 3.0 },
            Material::Yeoh { c1: 1.2, c2: 0.3, c3: 0.1, kappa, volumetric },
            Material::Gent { mu: 3.0, Jm: 9.0, kappa, volumetric: Volumetric::Quadratic },
            Material::ArrudaBoyce { mu: 3.0, N: 5.0, kappa, volumetric: Volumetric::Logarithmic },
            Material::Orthotropic {
                c11: 9.0,
                c22: 8.0,
                c33: 7.0,
                c12: 3.0,
                c13: 2.5,
                c23: 2.0,
                c44: 1.5,
                c55: 1.8,
                c66: 2.2,
            },
            Material::Ogden {
                mu1: 2.0,
                alpha1: 1.3,
                mu2: 0.4,
                alpha2: 4.0,
                mu3: -0.2,
                alpha3: -2.0,
                kappa,
                volumetric,
            },
            Material::HolzapfelGasserOgden {
                mu: 3.0,
                k1: 2.0,
                k2: 0.7,
                angle: 0.6,
                kappa,
                volumetric,
            },
        ]
    }

    fn tangent<const D: usize>(law: &Law<f64, D>, F: SMatrix<f64, D, D>) -> Tangent<D>
    where
        f64: Differentiated<D>,
    {
        let mut A = [[[SMatrix::zeros(); D]; D]];
        f64::tangents(law, &[F], &[], &mut A);
        A[0]
    }

    /// The deformation gradients at which tangents are looked at: at rest, with two equal stretches, and without symmetry.
    fn deformations<const D: usize>() -> Vec<SMatrix<f64, D, D>> {
        let entry = |i: usize, j: usize, n: f64| 0.25 * (1.7 * i as f64 + 0.9 * j as f64 + n).sin();
        let full = |n: f64| SMatrix::identity() + SMatrix::from_fn(|i, j| entry(i, j, n));
        let uniaxial = SMatrix::from_fn(|i, j| {
            if i != j {
                0.0
            } else if i == 0 {
                1.3
            } else {
                0.9
            }
        });
        let nearly = SMatrix::identity() + SMatrix::from_fn(|i, j| 1e-7 * entry(i, j, 0.3));
        vec![SMatrix::identity(), uniaxial, nearly, full(0.4), full(2.5)]
    }

    fn check<const D: usize>()
    where
        f64: Differentiated<D> + crate::Stressed<D>,
    {
        for material in laws() {
            let law = Law::<f64, D>::from(material);
            for F in deformations::<D>() {
                // Fibres at rest are at a kink of their tension.
                let kink = matches!(material, Material::HolzapfelGasserOgden { .. });
                if kink && (F - SMatrix::identity()).norm() < 1e-5 {
                    continue;
                }
                let A = tangent(&law, F);
                let mut expected = [[[SMatrix::zeros(); D]; D]];
                by_differences(&[F], &mut expected, &|_, F| {
                    F.iter().map(|F| law.first_piola_kirchhoff(F).unwrap()).collect()
                });
                for (k, l) in (0..D * D).map(|m| (m / D, m % D)) {
                    let off = (A[k][l] - expected[0][k][l]).amax();
                    // The differences' own errors: far below those that are asked for.
                    assert!(off < 1e-8, "{material:?} {F} {k} {l}: {off:e}");
                    for (i, j) in (0..D * D).map(|m| (m / D, m % D)) {
                        let transposed = A[i][j][(k, l)];
                        assert!((A[k][l][(i, j)] - transposed).abs() < 1e-11, "{material:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn tangents_are_the_differences_of_stresses_and_symmetric() {
        check::<1>();
        check::<2>();
        check::<3>();
    }

    #[test]
    fn what_is_no_deformation_has_no_tangent() {
        let law = Law::<f64, 2>::from(Material::NeoHookean { lambda: 5.0, mu: 3.0 });
        let turned_over = SMatrix::from_diagonal(&nalgebra::vector![1.0, -1.0]);
        assert!(tangent(&law, turned_over)[0][0][(0, 0)].is_nan());
    }
}
