//! The law of a simulation: one of the library, or one that the caller brings.

use std::sync::Arc;
use std::{array, fmt};

use mmsmith_lanes::tensor::{product, real};
use mmsmith_vocabulary::{Material, Moduli, Term};
use nalgebra::{Matrix3, RealField, SMatrix};

use super::memory::{Frozen, InternalVariable, LawWithMemory, set};
use super::{BLOCK, SIDE_BY_SIDE, Stressed, jacobian};

/// The stress of a law that the caller brings, for particles in blocks.
///
/// A law is a function of the deformation gradient alone, with P = 0 where F = I. To keep the digits of small strains, form
/// stresses from `F - I`. In 2D the deformation is plane strain (`F_zz = 1`), in 1D uniaxial strain, unless the law tells another
/// [stretch across](Self::stretch_across).
/// [`Law::check`](Law::check) compares an implementation with itself: energy, objectivity, symmetry.
pub trait ConstitutiveLaw<T, const D: usize>: fmt::Debug + Send + Sync {
    /// First Piola-Kirchhoff stresses of particles side by side: `F[i][J][n]` is `F_iJ` of particle `n`, and so it is with the
    /// stresses `P`. Stresses of particles whose F is no deformation (J <= 0) are not looked at.
    ///
    /// The stress of a particle must not depend on its place in the block, nor on the others.
    fn first_piola_kirchhoff(&self, F: &[[[T; BLOCK]; D]; D], P: &mut [[[T; BLOCK]; D]; D]);

    /// Derivatives of the stresses along one component of the deformation gradient, `A_iJkL = dP_iJ/dF_kL` for `kL = component`, in the
    /// form of the stresses; false where the law does not tell them. Default: they are formed by differences of the stress.
    fn slope(
        &self,
        _F: &[[[T; BLOCK]; D]; D],
        _component: [usize; 2],
        _A: &mut [[[T; BLOCK]; D]; D],
    ) -> bool {
        false
    }

    /// Strain energy per reference volume, zero at rest; `None` where there is none or it is not known.
    fn strain_energy(&self, _F: &SMatrix<T, D, D>) -> Option<T> {
        None
    }

    /// The normal Kirchhoff stress along the axes that F leaves out; `None` where it is not known.
    fn kirchhoff_across(&self, _F: &SMatrix<T, D, D>) -> Option<T> {
        None
    }

    /// The stretch along the axes that F leaves out; `None` where nothing stretches along them.
    fn stretch_across(&self, _F: &SMatrix<T, D, D>) -> Option<T> {
        None
    }
}

/// A constitutive law.
#[derive(Clone, Debug)]
pub enum Law<T, const D: usize> {
    /// A law of the library.
    Library(Material<T>),
    /// A law that the caller brings.
    Own(Arc<dyn ConstitutiveLaw<T, D>>),
    /// A law with internal variables. Functions of F alone tell its response to a sudden change from rest.
    WithMemory(Arc<dyn LawWithMemory<T, D>>),
}

impl<T, const D: usize> From<Material<T>> for Law<T, D> {
    fn from(material: Material<T>) -> Self {
        Self::Library(material)
    }
}

impl<T, const D: usize> Law<T, D> {
    /// A law that the caller brings.
    pub fn from_constitutive(law: impl ConstitutiveLaw<T, D> + 'static) -> Self {
        Self::Own(Arc::new(law))
    }

    /// A law with internal variables.
    pub fn with_memory(law: impl LawWithMemory<T, D> + 'static) -> Self {
        Self::WithMemory(Arc::new(law))
    }

    /// The internal variables of a particle; none for elastic laws.
    #[must_use]
    pub fn variables(&self) -> Vec<InternalVariable> {
        match self {
            Self::WithMemory(law) => law.variables(),
            Self::Library(_) | Self::Own(_) => Vec::new(),
        }
    }
}

/// Every function takes the deformation gradient F and returns `None` where it is not a deformation: J <= 0, or an entry that is
/// not finite.
impl<T: Stressed<D>, const D: usize> Law<T, D> {
    /// The law of a particle with these internal variables, as they are; an elastic law is itself.
    #[must_use]
    pub fn with_variables(&self, q: &[T]) -> Self {
        match self {
            Self::WithMemory(law) => Self::from_constitutive(Frozen::new(law.clone(), q)),
            elastic => elastic.clone(),
        }
    }

    /// `work` with a law that is not one of the library.
    fn of_caller<R>(&self, work: impl FnOnce(&dyn ConstitutiveLaw<T, D>) -> R) -> Option<R> {
        match self {
            Self::Library(_) => None,
            Self::Own(law) => Some(work(law.as_ref())),
            Self::WithMemory(law) => Some(work(&Frozen::at_rest(law.clone()))),
        }
    }

    /// Kirchhoff stress `tau = J sigma = P F^T`.
    pub fn kirchhoff(&self, F: &SMatrix<T, D, D>) -> Option<SMatrix<T, D, D>> {
        match self {
            Self::Library(material) => T::kirchhoff(material, F),
            _ => Some(product(&self.first_piola_kirchhoff(F)?, &F.transpose())),
        }
    }

    /// First Piola-Kirchhoff stress `P = tau F^-T`: force per reference area, traction `P N`.
    pub fn first_piola_kirchhoff(&self, F: &SMatrix<T, D, D>) -> Option<SMatrix<T, D, D>> {
        match self {
            Self::Library(material) => T::first_piola_kirchhoff(material, F),
            _ => self.of_caller(|law| {
                jacobian(F)?;
                let block = array::from_fn(|i| array::from_fn(|j| [F[(i, j)]; BLOCK]));
                let mut P = [[[T::zero(); BLOCK]; D]; D];
                law.first_piola_kirchhoff(&block, &mut P);
                Some(SMatrix::from_fn(|i, j| P[i][j][0]))
            })?,
        }
    }

    /// First Piola-Kirchhoff stresses of particles side by side: `F[i][J][n]` is `F_iJ` of particle `n`, and so it is with
    /// the stresses `P`. They are those of [`Law::first_piola_kirchhoff`] to the last bit, and not a number where F is no
    /// deformation.
    pub fn first_piola_kirchhoff_side_by_side(
        &self,
        F: &[[[T; SIDE_BY_SIDE]; D]; D],
        P: &mut [[[T; SIDE_BY_SIDE]; D]; D],
    ) {
        match self {
            Self::Library(material) => T::first_piola_kirchhoff_side_by_side(material, F, P),
            _ => self
                .of_caller(|law| {
                    let mut block = BlockOfStresses::at_rest();
                    for n in 0..SIDE_BY_SIDE {
                        block.set(n, &SMatrix::from_fn(|i, j| F[i][j][n]));
                    }
                    block.evaluate(law);
                    for n in 0..SIDE_BY_SIDE {
                        let stress = block.stress(n);
                        for i in 0..D {
                            for j in 0..D {
                                P[i][j][n] = stress[(i, j)];
                            }
                        }
                    }
                })
                .unwrap_or_default(),
        }
    }

    /// Cauchy (true) stress `sigma = tau / J`.
    pub fn cauchy(&self, F: &SMatrix<T, D, D>) -> Option<SMatrix<T, D, D>> {
        let J = jacobian(F)?;
        Some(self.kirchhoff(F)? / J)
    }

    /// Von Mises stress of the symmetric part of the Cauchy stress, with the normal stresses that act out of the plane
    /// in 2D and across the axis in 1D; without these where the law does not tell them.
    pub fn von_mises(&self, F: &SMatrix<T, D, D>) -> Option<T> {
        let sigma = self.cauchy_in_space(F)?;
        let mut sum = T::zero();
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            let difference = sigma[(i, i)] - sigma[(j, j)];
            let shear = (sigma[(i, j)] + sigma[(j, i)]) * real(0.5);
            sum += difference * difference * real(0.5) + shear * shear * real(3.0);
        }
        Some(sum.sqrt())
    }

    /// Kirchhoff stress in three dimensions, with the components that act out of the plane in 2D and across the axis in 1D; zero in
    /// their place where the law does not tell them.
    pub fn kirchhoff_in_space(&self, F: &SMatrix<T, D, D>) -> Option<Matrix3<T>> {
        jacobian(F)?;
        match self {
            Self::Library(material) => Some(T::kirchhoff_in_space(material, F)),
            _ => self.of_caller(|law| {
                let across = law.kirchhoff_across(F).unwrap_or_else(T::zero);
                let mut in_space = Matrix3::from_diagonal_element(across);
                in_space.fixed_view_mut::<D, D>(0, 0).copy_from(&self.kirchhoff(F)?);
                Some(in_space)
            })?,
        }
    }

    /// Cauchy stress in three dimensions, see [`kirchhoff_in_space`](Self::kirchhoff_in_space).
    pub fn cauchy_in_space(&self, F: &SMatrix<T, D, D>) -> Option<Matrix3<T>> {
        let mut volume = jacobian(F)?;
        for _ in D..3 {
            volume *= self.stretch_across(F);
        }
        Some(self.kirchhoff_in_space(F)? / volume)
    }

    /// The stretch along the axes that F leaves out: one in plane and uniaxial strain.
    pub fn stretch_across(&self, F: &SMatrix<T, D, D>) -> T {
        self.of_caller(|law| law.stretch_across(F)).flatten().unwrap_or_else(T::one)
    }

    /// Strain energy per reference volume; zero where F is the identity, and `None` where it is no deformation or the law tells no
    /// energy.
    ///
    /// At small strain `H = F - I` it is of second order, and rounded to about `eps/|H|` of itself.
    pub fn strain_energy(&self, F: &SMatrix<T, D, D>) -> Option<T> {
        match self {
            Self::Library(material) => T::strain_energy(material, F),
            _ => self.of_caller(|law| {
                jacobian(F)?;
                law.strain_energy(F)
            })?,
        }
    }

    /// The tangent moduli at rest applied to a displacement gradient, `A_iJkL H_kL` with `A = dP/dF` at `F = I`: exact for an
    /// isotropic law of the library, by differences of the stress for others. Fibres that carry tension alone have another stress for
    /// `-H`.
    pub fn stress_at_small_strain(&self, H: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        if let Some((lambda, mu)) = self.lame_constants() {
            return super::plus_diagonal((H + H.transpose()) * mu, lambda * H.trace());
        }
        let size = H.norm();
        if size == T::zero() {
            return SMatrix::zeros();
        }
        // One-sided, since fibres carry tension alone. The truncation of the difference is of second order, its rounding of eps
        // over the step.
        let step = T::default_epsilon().cbrt() / size;
        let P = |times: f64| {
            let F = SMatrix::identity() + H * (step * real(times));
            self.first_piola_kirchhoff(&F).unwrap_or_else(|| SMatrix::repeat(real(f64::NAN)))
        };
        let change = P(1.0) * real::<T>(4.0) - P(2.0);
        // A body with memory may be under stress at rest.
        let at_rest = match self {
            Self::Library(_) => SMatrix::zeros(),
            Self::Own(_) | Self::WithMemory(_) => P(0.0) * real::<T>(3.0),
        };
        (change - at_rest) / (step * real(2.0))
    }

    /// The Lame constants at small strain, where the law is isotropic and tells them.
    pub fn lame_constants(&self) -> Option<(T, T)> {
        match self {
            Self::Library(material) => material.moduli().map(values),
            Self::WithMemory(law) => law.elastic()?.moduli().map(values),
            Self::Own(_) => None,
        }
    }

    /// The largest modulus `A_iiii` of waves along the axes at rest, in tension or compression: their speed is the root of its quotient by the density. It is
    /// `lambda + 2 mu` for isotropic laws.
    pub fn p_wave_modulus(&self) -> T {
        if let Some((lambda, mu)) = self.lame_constants() {
            return lambda + mu * real(2.0);
        }
        if let Self::WithMemory(law) = self
            && let Some(elastic) = law.elastic()
        {
            return Self::Library(elastic).p_wave_modulus();
        }
        let moduli = (0..D).flat_map(|i| [(i, T::one()), (i, -T::one())]).map(|(i, sign)| {
            let mut H = SMatrix::zeros();
            H[(i, i)] = sign;
            self.stress_at_small_strain(&H)[(i, i)] * sign
        });
        moduli.fold(T::zero(), |largest, modulus| largest.max(modulus))
    }
}

/// How far a law is from having the properties that every elastic law has: see [`Law::check`]. Numbers are relative to the largest
/// stress, and not numbers where the law gives none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LawCheck<T> {
    /// The stress where `F = I`.
    pub stress_at_rest: T,
    /// The difference of `tau = P F^T` from its transpose, which the balance of angular momentum forbids.
    pub asymmetry: T,
    /// The difference of `P(Q F)` from `Q P(F)` for a rotation Q, which objectivity forbids; zero in one dimension.
    pub turned: T,
    /// The difference of P from `dW/dF`, by differences of the strain energy; `None` where the law tells no energy.
    pub energy: Option<T>,
}

impl<T: RealField + Copy> LawCheck<T> {
    /// Whether all that was found is rounding: no more than the root of the precision, 1.5e-8 for `f64`.
    pub fn passed(&self) -> bool {
        let allowed = T::default_epsilon().sqrt();
        let energy = self.energy.unwrap_or_else(T::zero);
        // Written so that what is not a number fails.
        [self.stress_at_rest, self.asymmetry, self.turned, energy]
            .iter()
            .all(|found| *found <= allowed)
    }
}

/// Deformations at which a law is checked.
const CHECKED: u8 = 24;

impl<T: Stressed<D>, const D: usize> Law<T, D> {
    /// Compares the law with itself at two dozen deformations, always the same, whose `F - I` has entries of up to `strain`: the
    /// stress at rest, the symmetry of `tau`, objectivity, and the stress with differences of the strain energy.
    ///
    /// In single precision the differences of the energy take steps of a twentieth, over which the energy has to be smooth: where fibres go
    /// slack within a step, they do not agree.
    ///
    /// A law needs no code of its own for it. Linear elasticity does not pass, as its stress does not turn with the body. Source of
    /// the conditions: Truesdell & Noll, "The Non-Linear Field Theories of Mechanics", 3rd ed. (2004), sections 19 and 82.
    ///
    /// ```
    /// use mmsmith_laws::{Law, Material};
    ///
    /// let rubber = Law::<f64, 3>::from(Material::MooneyRivlin { c1: 1.3, c2: 0.6, lambda: 3.3 });
    /// assert!(rubber.check(0.2).passed());
    /// let linear = Law::<f64, 3>::from(Material::LinearElastic { lambda: 5.8, mu: 3.8 });
    /// let found = linear.check(0.2);
    /// assert!(!found.passed() && found.turned > 0.1);
    /// // Its stress is the derivative of its energy all the same.
    /// assert!(found.energy.is_some_and(|difference| difference < 1e-8));
    /// ```
    #[must_use]
    pub fn check(&self, strain: T) -> LawCheck<T> {
        let identity = SMatrix::<T, D, D>::identity();
        let nan = real::<T>(f64::NAN);
        let turn = rotation::<T, D>();
        let norm = |P: Option<SMatrix<T, D, D>>| P.map_or(nan, |P| P.norm());
        let stress_at_rest = norm(self.first_piola_kirchhoff(&identity));
        let (mut largest, mut asymmetry, mut turned) = (T::zero(), T::zero(), T::zero());
        let mut energy = None;
        for n in 1..=CHECKED {
            let F = SMatrix::from_fn(|i, j| {
                // Irrational multiples are spread evenly between 0 and 1.
                let multiple = 0.618_034 + 0.324_718 * (i * D + j) as f64;
                let share = (f64::from(n) * multiple).fract();
                identity[(i, j)] + strain * real(2.0 * share - 1.0)
            });
            let Some(P) = self.first_piola_kirchhoff(&F) else { continue };
            largest = larger(largest, P.norm());
            let tau = product(&P, &F.transpose());
            asymmetry = larger(asymmetry, (tau - tau.transpose()).norm());
            let of_turned = self.first_piola_kirchhoff(&product(&turn, &F));
            turned = larger(turned, norm(of_turned.map(|found| found - product(&turn, &P))));
            if self.strain_energy(&F).is_some() {
                let difference = (P - self.slope_of_energy(&F)).norm();
                energy = Some(larger(energy.unwrap_or_else(T::zero), difference));
            }
        }
        LawCheck {
            stress_at_rest: stress_at_rest / largest,
            asymmetry: asymmetry / largest,
            turned: turned / largest,
            energy: energy.map(|energy: T| energy / largest),
        }
    }

    /// `dW/dF` by central differences of fourth order, not a number where there is no energy.
    fn slope_of_energy(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        // Of this step the truncation and the rounding are about the same.
        let step = T::default_epsilon().powf(real(0.2));
        SMatrix::from_fn(|i, j| {
            let energy = |steps: f64| {
                let mut moved = *F;
                moved[(i, j)] += step * real(steps);
                self.strain_energy(&moved).unwrap_or_else(|| real(f64::NAN))
            };
            let (near, far) = (energy(1.0) - energy(-1.0), energy(2.0) - energy(-2.0));
            (near * real(8.0) - far) / (step * real(12.0))
        })
    }
}

/// The larger of two numbers; not a number where one of them is none.
fn larger<T: RealField + Copy>(a: T, b: T) -> T {
    if a >= b {
        a
    } else if b > a {
        b
    } else {
        real(f64::NAN)
    }
}

/// A rotation in the planes of neighbouring axes.
fn rotation<T: RealField + Copy, const D: usize>() -> SMatrix<T, D, D> {
    (1..D).fold(SMatrix::identity(), |rotation, axis| {
        let (sine, cosine) = (0.7 * axis as f64).sin_cos();
        let mut turn = SMatrix::<T, D, D>::identity();
        turn[(axis - 1, axis - 1)] = real(cosine);
        turn[(axis, axis)] = real(cosine);
        turn[(axis - 1, axis)] = real(-sine);
        turn[(axis, axis - 1)] = real(sine);
        product(&turn, &rotation)
    })
}

/// Deformation gradients of a block of particles, and their stresses by a law that the caller brings.
pub struct BlockOfStresses<T, const D: usize> {
    F: [[[T; BLOCK]; D]; D],
    P: [[[T; BLOCK]; D]; D],
    is_deformation: [bool; BLOCK],
}

impl<T: RealField + Copy, const D: usize> BlockOfStresses<T, D> {
    /// All particles at rest.
    pub fn at_rest() -> Self {
        let of = |value: T| [value; BLOCK];
        let identity = |i, j| if i == j { of(T::one()) } else { of(T::zero()) };
        Self {
            F: array::from_fn(|i| array::from_fn(|j| identity(i, j))),
            P: [[of(T::zero()); D]; D],
            is_deformation: [true; BLOCK],
        }
    }

    /// Sets the deformation gradient of particle `n` of the block. Laws are asked for deformations alone.
    #[inline(always)]
    pub fn set(&mut self, n: usize, F: &SMatrix<T, D, D>) {
        self.is_deformation[n] = set(&mut self.F, n, F);
    }

    /// Computes the stresses of the block.
    pub fn evaluate(&mut self, law: &dyn ConstitutiveLaw<T, D>) {
        law.first_piola_kirchhoff(&self.F, &mut self.P);
    }

    /// Computes derivatives of the stresses along a component of F in their place; false where the law does not tell them.
    pub fn evaluate_slope(
        &mut self,
        law: &dyn ConstitutiveLaw<T, D>,
        component: [usize; 2],
    ) -> bool {
        law.slope(&self.F, component, &mut self.P)
    }

    /// The stress of particle `n` of the block, not a number where F is no deformation.
    #[inline(always)]
    pub fn stress(&self, n: usize) -> SMatrix<T, D, D> {
        match self.is_deformation[n] {
            true => SMatrix::from_fn(|i, j| self.P[i][j][n]),
            false => SMatrix::repeat(real(f64::NAN)),
        }
    }
}

/// The values of Lame constants.
fn values<T: RealField + Copy>(Moduli { lambda, mu }: Moduli<T>) -> (T, T) {
    let sum = |terms: Vec<Term<T>>| {
        terms.into_iter().fold(
            T::zero(),
            |sum, Term { factor: [numerator, denominator], powers }| {
                let factor = real::<T>(numerator as f64) / real(denominator as f64);
                sum + powers.into_iter().fold(factor, |product, (constant, exponent)| {
                    product * power(constant, exponent)
                })
            },
        )
    };
    (sum(lambda), sum(mu))
}

/// A whole power by squaring, as the compiler's own, which is not what nalgebra has for it without the standard library.
fn power<T: RealField + Copy>(base: T, exponent: i32) -> T {
    let (mut square, mut left, mut product) = (base, exponent.unsigned_abs(), T::one());
    while left > 0 {
        if left % 2 == 1 {
            product *= square;
        }
        square *= square;
        left /= 2;
    }
    if exponent < 0 { T::one() / product } else { product }
}
