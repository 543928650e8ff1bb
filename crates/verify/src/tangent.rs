//! Tangents of other solvers beside that of the solver's own law, and the mistakes that their differences are.
//!
//! A mistake changes the tangent by a formula in the right tangent, the stress and F, so that it holds for every law; a few mistakes
//! are of laws with the constants lambda and mu alone.

use mmsmith_laws::{Differentiated, Law, Material, Tangent};
use mmsmith_runtime::{AnySolution, Solution};
use nalgebra::{SMatrix, SVector};
use serde::Serialize;
use thiserror::Error;

use crate::case::law_of_body;
use crate::check::at_point;
use crate::dimension::in_dimension;
use crate::error::SceneError;
use crate::inverse::{determinant, inverse};
use crate::precision::Precision;

/// Up to this share of its size a tangent is right: Newton's method is quadratic for all that can be seen of it.
const RIGHT: f64 = 1e-6;
/// A mistake explains a difference of which less than this share is left.
const EXPLAINED: f64 = 1e-3;
/// So much of the difference that the best mistake leaves another one may leave and is named beside it.
const LIKE_THE_BEST: f64 = 10.0;

/// A position with the wrong number of coordinates.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("X has {given} coordinates, but the solution is {dimension}-dimensional")]
pub struct WrongLength {
    /// The number of coordinates given.
    pub given: usize,
    /// The number needed.
    pub dimension: usize,
}

/// Why a law has no tangent at a point.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum TangentError {
    /// A position with the wrong number of coordinates.
    #[error(transparent)]
    Length(#[from] WrongLength),
    /// The solver does not have the law.
    #[error(transparent)]
    Law(#[from] SceneError),
    /// The stress is no function of the deformation.
    #[error(
        "the stress depends on the history of the deformation, so that its tangent is that of the step by which a solver follows it"
    )]
    History,
    /// A matrix or a tangent with the wrong number of entries.
    #[error("{given} entries stand where {needed} belong")]
    Entries {
        /// The number of entries given.
        given: usize,
        /// The number needed.
        needed: usize,
    },
}

/// The tangent of another solver at a place.
#[derive(Clone, Debug, PartialEq)]
pub struct TangentSample {
    /// The reference position.
    pub X: Vec<f64>,
    /// The time.
    pub t: f64,
    /// The deformation gradient that the tangent belongs to, row by row; none for the exact one.
    pub F: Option<Vec<f64>>,
    /// `dP_iJ/dF_kL`, with the last index running fastest.
    pub dPdF: Vec<f64>,
}

/// A mistake in a tangent.
#[derive(Debug)]
pub struct TangentMistake {
    /// Its name.
    pub name: &'static str,
    /// In words.
    pub mistake: &'static str,
    /// The line to write instead.
    pub write: &'static str,
    form: Form,
}

/// The change of a tangent by a mistake.
#[derive(Clone, Copy, Debug)]
enum Form {
    /// The right tangent with this multiple of `delta_ik S_JL` on it.
    Geometric(i8),
    /// The material part times a number of quarters.
    MaterialQuarters(u8),
    AtRest,
    OfLaw(fn(f64, f64) -> Material<f64>),
    /// Other constants lambda and mu in the same law.
    Constants(fn(f64, f64) -> [f64; 2]),
    /// Other constants in the plane alone.
    ConstantsOfPlane(fn(f64, f64) -> [f64; 2]),
    /// The entries of other indices, as positions of i, J, k and L.
    Indices([usize; 4]),
    MinorSymmetries,
    /// Times this power of J.
    PowerOfJ(i8),
    /// Pushed forward, over this power of J.
    Spatial(i8),
    /// A neo-Hookean tangent in which `mu - lambda ln J` is `mu`.
    NoLogarithm,
    /// A neo-Hookean tangent without the derivative of `ln J`.
    HeldLogarithm,
    /// A neo-Hookean tangent with `F^-T dF F^-T` for `F^-T dF^T F^-T`.
    VariationNotTransposed,
    /// Times a number that is fitted.
    Factor,
    /// By one-sided differences with a step that is fitted.
    Differences,
}

macro_rules! mistakes {
    ($($name:literal ($form:expr): $mistake:literal, $write:literal;)*) => {
        &[$(TangentMistake { name: $name, mistake: $mistake, write: $write, form: $form }),*]
    };
}

/// The mistakes in tangents that are looked for. Of those that explain a difference equally well the first is named first.
pub const TANGENT_MISTAKES: &[TangentMistake] = mistakes! {
    "geometric-stiffness-dropped" (Form::Geometric(-1)):
        "the part of the stress is left out, as if S did not turn with the body",
        "dPdF[i][J][k][L] += (i == k)*S[J][L], with S = F^-1 P";
    "geometric-stiffness-sign" (Form::Geometric(-2)):
        "the part of the stress is subtracted",
        "dPdF[i][J][k][L] += (i == k)*S[J][L] for -=, with S = F^-1 P";
    "geometric-stiffness-doubled" (Form::Geometric(1)):
        "the part of the stress is there twice",
        "(i == k)*S[J][L] once: in the law or where elements are assembled";
    "material-part-halved" (Form::MaterialQuarters(2)):
        "dS/dC stands where dS/dE belongs",
        "C = 2 dS/dC, then dPdF[i][J][k][L] = F[i][I] C[I][J][K][L] F[k][K] + (i == k)*S[J][L]";
    "material-part-doubled" (Form::MaterialQuarters(8)):
        "a factor 2 of dS/dE = 2 dS/dC is there twice",
        "dPdF[i][J][k][L] = F[i][I] C[I][J][K][L] F[k][K] + (i == k)*S[J][L], with C = dS/dE";
    "material-part-quartered" (Form::MaterialQuarters(1)):
        "d2W/dC2 stands where 4 d2W/dC2 belongs",
        "C = 4 d2W/dC2, then dPdF[i][J][k][L] = F[i][I] C[I][J][K][L] F[k][K] + (i == k)*S[J][L]";
    "tangent-at-rest" (Form::AtRest):
        "it is the tangent of the undeformed body, or of linear elasticity, at every deformation",
        "dP/dF at the F of this iteration, not at F = I";
    "law-st-venant-kirchhoff" (Form::OfLaw(|lambda, mu| Material::StVenantKirchhoff { lambda, mu })):
        "it is the tangent of St. Venant and Kirchhoff's law, and the stress is not",
        "the derivative of the stress that the residual has";
    "law-neo-hookean" (Form::OfLaw(|lambda, mu| Material::NeoHookean { lambda, mu })):
        "it is the tangent of the neo-Hookean law, and the stress is not",
        "the derivative of the stress that the residual has";
    "law-hencky" (Form::OfLaw(|lambda, mu| Material::Hencky { lambda, mu })):
        "it is the tangent of Hencky's law, and the stress is not",
        "the derivative of the stress that the residual has";
    "moduli-exchanged" (Form::Constants(|lambda, mu| [mu, lambda])):
        "lambda and mu are exchanged",
        "lambda where the tangent has mu, and mu where it has lambda";
    "plane-stress" (Form::ConstantsOfPlane(|lambda, mu| [2.0 * lambda * mu / (lambda + 2.0 * mu), mu])):
        "lambda is that of plane stress, 2 lambda mu/(lambda + 2 mu)",
        "lambda itself: the strain is plane";
    "bulk-modulus-for-lambda" (Form::Constants(|lambda, mu| [lambda + 2.0 * mu / 3.0, mu])):
        "the bulk modulus stands for lambda",
        "lambda = K - 2 mu/3";
    "lambda-missing" (Form::Constants(|_, mu| [0.0, mu])):
        "all that lambda multiplies is left out",
        "the derivative of the pressure too";
    "mu-doubled" (Form::Constants(|lambda, mu| [lambda, 2.0 * mu])):
        "mu is there twice",
        "mu, not 2 mu";
    "indices-exchanged" (Form::Indices([0, 3, 2, 1])):
        "J and L are exchanged: of F^-1 at J k and L i stands F^-1 at J i and L k",
        "d(F^-1)_Ji/dF_kL = -F^-1[J][k]*F^-1[L][i]";
    "transposed" (Form::Indices([1, 0, 3, 2])):
        "i and J are exchanged, and k and L: it is the tangent of P transposed by F transposed",
        "dPdF[i][J][k][L] with the direction in space first";
    "stress-transposed" (Form::Indices([1, 0, 2, 3])):
        "i and J are exchanged: P is transposed, or its components are in the order of columns",
        "dPdF[i][J][k][L] = dP_iJ/dF_kL";
    "columns-transposed" (Form::Indices([0, 1, 3, 2])):
        "k and L are exchanged: F is transposed, or its components are in the order of columns",
        "dPdF[i][J][k][L] = dP_iJ/dF_kL";
    "minor-symmetries" (Form::MinorSymmetries):
        "it is made symmetric in i and J and in k and L, as a tangent of strains is",
        "all entries: dPdF[1][2][1][2] and dPdF[1][2][2][1] differ";
    "times-J" (Form::PowerOfJ(1)):
        "it is multiplied by J",
        "dP/dF without J: P is a force per area at rest";
    "over-J" (Form::PowerOfJ(-1)):
        "it is divided by J",
        "dP/dF without 1/J: P is a force per area at rest";
    "spatial" (Form::Spatial(1)):
        "it is the tangent pushed forward, F F dP/dF/J, which goes with gradients at x",
        "dPdF[i][J][k][L] = J a[i][j][k][l] F^-1[J][j] F^-1[L][l], or gradients at x and volumes at x";
    "spatial-times-J" (Form::Spatial(0)):
        "it is the tangent of Kirchhoff's stress, which goes with gradients at x and volumes at rest",
        "dPdF[i][J][k][L] = a[i][j][k][l] F^-1[J][j] F^-1[L][l]";
    "logarithm-missing" (Form::NoLogarithm):
        "lambda ln J is left out beside mu in (mu - lambda ln J) d(F^-T)",
        "(mu - lambda*log(J))*F^-1[J][k]*F^-1[L][i]";
    "logarithm-held" (Form::HeldLogarithm):
        "ln J is held: lambda F^-T F^-T is left out",
        "dPdF[i][J][k][L] += lambda*F^-1[J][i]*F^-1[L][k]";
    "variation-not-transposed" (Form::VariationNotTransposed):
        "dF stands for its transpose in d(F^-T) = -F^-T dF^T F^-T",
        "-F^-1[J][k]*F^-1[L][i], not -F^-1[k][i]*F^-1[J][L]";
    "factor" (Form::Factor):
        "every entry is the right one times a number",
        "no factor: another unit, a weight or a thickness belongs elsewhere";
    "differences" (Form::Differences):
        "it is by one-sided differences with too large a step",
        "(P(F + h E) - P(F - h E))/(2 h), with h some 1e-5";
};

/// A mistake that explains a tangent.
#[derive(Debug)]
pub struct NamedTangentMistake {
    /// The mistake.
    pub mistake: &'static TangentMistake,
    /// The difference that it leaves, as a share of the tangent.
    pub error: f64,
    /// The factor or the step that was fitted.
    pub fitted: Option<f64>,
}

/// An entry of a tangent that is not right.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WrongEntry {
    /// The number of the point, from zero.
    pub point: usize,
    /// Its name, such as `dP11dF22`.
    pub entry: String,
    /// The other solver's value.
    pub given: f64,
    /// The right value.
    pub right: f64,
}

/// A judgement on the tangent of another solver.
#[derive(Debug)]
pub struct JudgedTangent {
    /// The difference to the right one as a share of it, in the mean square of all entries at all points.
    pub error: f64,
    /// Whether it is right.
    pub passed: bool,
    /// The largest difference at each place in the tangent, the largest of all first.
    pub entries: Vec<WrongEntry>,
    /// Mistakes that explain it, the best first; none where it is right.
    pub named: Vec<NamedTangentMistake>,
    /// Mistakes that these points do not show.
    pub unseen: Vec<&'static TangentMistake>,
}

/// Compares a tangent with that of the solver's own law, and names the mistake that makes the difference.
///
/// # Errors
///
/// `TangentError` where the law has no tangent, or a sample does not fit.
pub fn judge_tangent(
    solution: &AnySolution<f64>,
    samples: &[TangentSample],
) -> Result<JudgedTangent, TangentError> {
    let none = || Err(WrongLength { given: 0, dimension: 0 }.into());
    in_dimension!(solution, |s| judge(s, samples), else none())
}

/// The tangent of the solver's own law at the exact deformation.
pub(crate) fn exact_tangent<const D: usize>(
    solution: &dyn Solution<f64, D>,
    X: &[f64],
    t: f64,
) -> Result<Vec<Vec<Vec<Vec<f64>>>>, TangentError>
where
    f64: Precision<D> + Differentiated<D>,
{
    let A = State::new(solution, X, t, None)?.A;
    let of = |i: usize, J: usize| -> Vec<Vec<f64>> {
        A.iter().map(|row| row.iter().map(|along| along[(i, J)]).collect()).collect()
    };
    Ok((0..D).map(|i| (0..D).map(|J| of(i, J)).collect()).collect())
}

/// The law at a place and a deformation, with its stress and its right tangent.
struct State<const D: usize> {
    law: Law<f64, D>,
    F: SMatrix<f64, D, D>,
    P: SMatrix<f64, D, D>,
    A: Tangent<D>,
}

/// A tangent by its entries.
fn by_entries<const D: usize>(entry: impl Fn([usize; 4]) -> f64) -> Tangent<D> {
    let along = |k: usize, L: usize| SMatrix::from_fn(|i, J| entry([i, J, k, L]));
    std::array::from_fn(|k| std::array::from_fn(|L| along(k, L)))
}

fn tangent_of<const D: usize>(law: &Law<f64, D>, F: SMatrix<f64, D, D>) -> Tangent<D>
where
    f64: Differentiated<D>,
{
    let mut A: [Tangent<D>; 1] = [[[SMatrix::zeros(); D]; D]];
    f64::tangents(law, &[F], &[], &mut A);
    let [A] = A;
    A
}

impl<const D: usize> State<D>
where
    f64: Precision<D> + Differentiated<D>,
{
    fn new(
        solution: &dyn Solution<f64, D>,
        X: &[f64],
        t: f64,
        F: Option<&[f64]>,
    ) -> Result<Self, TangentError> {
        let place: [f64; D] =
            X.try_into().map_err(|_| WrongLength { given: X.len(), dimension: D })?;
        let X = SVector::from(place);
        if !solution.internal_variables().is_empty() {
            return Err(TangentError::History);
        }
        let law = law_of_body::<f64, D>(solution)?;
        let law = at_point(&law, solution, &X, t).ok_or(TangentError::History)?;
        let F = match F {
            Some(F) if F.len() == D * D => SMatrix::from_row_slice(F),
            Some(F) => return Err(TangentError::Entries { given: F.len(), needed: D * D }),
            None => solution.deformation_gradient(&X, t),
        };
        let nowhere = || SMatrix::repeat(f64::NAN);
        let P = law.first_piola_kirchhoff(&F).unwrap_or_else(nowhere);
        let A = tangent_of(&law, F);
        Ok(Self { law, F, P, A })
    }

    /// The entry `dP_iJ/dF_kL` that is right.
    fn right(&self, [i, J, k, L]: [usize; 4]) -> f64 {
        self.A[k][L][(i, J)]
    }

    /// The law with other constants lambda and mu; none where it has others.
    fn with_constants(&self, change: fn(f64, f64) -> [f64; 2]) -> Option<Law<f64, D>> {
        let Law::Library(material) = &self.law else { return None };
        Some(Law::Library(match *material {
            Material::NeoHookean { lambda, mu } => {
                let [lambda, mu] = change(lambda, mu);
                Material::NeoHookean { lambda, mu }
            }
            Material::StVenantKirchhoff { lambda, mu } => {
                let [lambda, mu] = change(lambda, mu);
                Material::StVenantKirchhoff { lambda, mu }
            }
            Material::Hencky { lambda, mu } => {
                let [lambda, mu] = change(lambda, mu);
                Material::Hencky { lambda, mu }
            }
            _ => return None,
        }))
    }

    /// The tangent with a mistake that needs no fit; none where this law or this body cannot have it.
    fn mistaken(&self, form: Form) -> Option<Tangent<D>> {
        let Self { law, F, P, A, .. } = self;
        let own = inverse(F)?;
        let S = own * P;
        let of_stress = |[i, J, k, L]: [usize; 4]| if i == k { S[(J, L)] } else { 0.0 };
        let J = determinant(F);
        let right = |index: [usize; 4]| self.right(index);
        Some(match form {
            Form::Geometric(times) => by_entries(|at| right(at) + f64::from(times) * of_stress(at)),
            Form::MaterialQuarters(quarters) => by_entries(|at| {
                let material = right(at) - of_stress(at);
                of_stress(at) + 0.25 * f64::from(quarters) * material
            }),
            Form::AtRest => tangent_of(law, SMatrix::identity()),
            Form::OfLaw(of) => {
                let (lambda, mu) = law.lame_constants()?;
                tangent_of(&Law::Library(of(lambda, mu)), *F)
            }
            Form::Constants(change) => tangent_of(&self.with_constants(change)?, *F),
            Form::ConstantsOfPlane(change) if D < 3 => {
                tangent_of(&self.with_constants(change)?, *F)
            }
            Form::ConstantsOfPlane(_) => return None,
            Form::Indices(order) => by_entries(|at| right(order.map(|place| at[place]))),
            Form::MinorSymmetries => by_entries(|[i, J, k, L]| {
                let both = |k, L| right([i, J, k, L]) + right([J, i, k, L]);
                0.25 * (both(k, L) + both(L, k))
            }),
            Form::PowerOfJ(power) => by_entries(|at| right(at) * J.powi(i32::from(power))),
            Form::Spatial(power) => {
                let over = J.powi(i32::from(power));
                by_entries(|[i, j, k, l]| {
                    let pairs = (0..D).flat_map(|J| (0..D).map(move |L| (J, L)));
                    pairs.map(|(J, L)| F[(j, J)] * F[(l, L)] * A[k][L][(i, J)]).sum::<f64>() / over
                })
            }
            Form::NoLogarithm | Form::HeldLogarithm | Form::VariationNotTransposed => {
                let Law::Library(Material::NeoHookean { lambda, mu }) = law else { return None };
                let logarithm = determinant(F).ln();
                let turned = |[i, J, k, L]: [usize; 4]| own[(J, k)] * own[(L, i)];
                let of = |at @ [i, J, k, L]: [usize; 4]| match form {
                    Form::NoLogarithm => lambda * logarithm * turned(at),
                    Form::HeldLogarithm => -lambda * own[(J, i)] * own[(L, k)],
                    _ => (mu - lambda * logarithm) * (own[(k, i)] * own[(J, L)] - turned(at)),
                };
                by_entries(|at| right(at) + of(at))
            }
            Form::Factor | Form::Differences => return None,
        })
    }

    /// The tangent by one-sided differences with a step; none beyond deformations.
    fn by_differences(&self, step: f64) -> Option<Tangent<D>> {
        let mut A = [[SMatrix::zeros(); D]; D];
        for (k, L) in (0..D * D).map(|at| (at / D, at % D)) {
            let mut beside = self.F;
            beside[(k, L)] += step;
            A[k][L] = (self.law.first_piola_kirchhoff(&beside)? - self.P) / step;
        }
        Some(A)
    }
}

/// The indices `iJkL` of an entry, of which the last runs fastest; entries of further points follow.
fn index<const D: usize>(entry: usize) -> [usize; 4] {
    [3, 2, 1, 0].map(|place| entry / D.pow(place) % D)
}

/// The entries of tangents at all points, in the order of the samples.
fn entries<const D: usize>(tangents: impl IntoIterator<Item = Tangent<D>>) -> Vec<f64> {
    let of = |A: Tangent<D>| -> Vec<f64> {
        (0..D.pow(4)).map(index::<D>).map(|[i, J, k, L]| A[k][L][(i, J)]).collect()
    };
    tangents.into_iter().flat_map(of).collect()
}

fn product(one: &[f64], other: &[f64]) -> f64 {
    one.iter().zip(other).map(|(one, other)| one * other).sum()
}

fn minus(one: &[f64], other: &[f64]) -> Vec<f64> {
    one.iter().zip(other).map(|(one, other)| one - other).collect()
}

/// Tangents of all points with a mistake.
struct Mistaken {
    entries: Vec<f64>,
    fitted: Option<f64>,
}

/// All points, with the tangents that are given and those that are right.
struct Points<const D: usize> {
    states: Vec<State<D>>,
    given: Vec<f64>,
    right: Vec<f64>,
}

impl<const D: usize> Points<D>
where
    f64: Precision<D> + Differentiated<D>,
{
    fn mistaken(&self, form: Form) -> Option<Mistaken> {
        match form {
            Form::Factor => {
                let factor = product(&self.given, &self.right) / product(&self.right, &self.right);
                let entries = self.right.iter().map(|right| factor * right).collect();
                Some(Mistaken { entries, fitted: Some(factor) })
            }
            Form::Differences => self.by_differences(),
            _ => {
                let tangents: Option<Vec<_>> =
                    self.states.iter().map(|state| state.mistaken(form)).collect();
                Some(Mistaken { entries: entries(tangents?), fitted: None })
            }
        }
    }

    /// The tangents by differences with the step that fits best: their errors are almost in proportion to it.
    fn by_differences(&self) -> Option<Mistaken> {
        const ROUNDS: usize = 8;
        let with = |step: f64| -> Option<Vec<f64>> {
            let all: Option<Vec<_>> =
                self.states.iter().map(|state| state.by_differences(step)).collect();
            Some(entries(all?))
        };
        let difference = minus(&self.given, &self.right);
        let mut step = 1e-5;
        for _ in 0..ROUNDS {
            let error = minus(&with(step)?, &self.right);
            let factor = product(&difference, &error) / product(&error, &error);
            step *= factor;
            if !step.is_normal() {
                return None;
            }
        }
        Some(Mistaken { entries: with(step)?, fitted: Some(step) })
    }

    /// The largest difference of each entry, those that matter.
    fn wrong_entries(&self) -> Vec<WrongEntry> {
        let square = D.pow(4);
        let size = |n: &usize| (self.given[*n] - self.right[*n]).abs();
        let largest = self.right.iter().fold(0.0_f64, |largest, entry| largest.max(entry.abs()));
        let of = |place: usize| {
            let points = (0..self.states.len()).map(|point| point * square + place);
            points.max_by(|one, other| size(one).total_cmp(&size(other)))
        };
        let mut worst: Vec<usize> = (0..square).filter_map(of).collect();
        worst.retain(|n| size(n).is_nan() || size(n) > RIGHT * largest);
        worst.sort_by(|one, other| size(other).total_cmp(&size(one)));
        let named = |n: usize| {
            let [i, J, k, L] = index::<D>(n).map(|axis| axis + 1);
            WrongEntry {
                point: n / square,
                entry: format!("dP{i}{J}dF{k}{L}"),
                given: self.given[n],
                right: self.right[n],
            }
        };
        worst.into_iter().map(named).collect()
    }
}

fn judge<const D: usize>(
    solution: &dyn Solution<f64, D>,
    samples: &[TangentSample],
) -> Result<JudgedTangent, TangentError>
where
    f64: Precision<D> + Differentiated<D>,
{
    let needed = D.pow(4);
    if let Some(short) = samples.iter().find(|sample| sample.dPdF.len() != needed) {
        return Err(TangentError::Entries { given: short.dPdF.len(), needed });
    }
    let state =
        |sample: &TangentSample| State::new(solution, &sample.X, sample.t, sample.F.as_deref());
    let states = samples.iter().map(state).collect::<Result<Vec<_>, _>>()?;
    let given = samples.iter().flat_map(|sample| sample.dPdF.iter().copied()).collect();
    let right = entries(states.iter().map(|state| state.A));
    let points = Points { states, given, right };
    let size = product(&points.right, &points.right).sqrt();
    let distance = |one: &[f64], other: &[f64]| {
        let difference = minus(one, other);
        product(&difference, &difference).sqrt() / size
    };
    let error = distance(&points.given, &points.right);
    let passed = error <= RIGHT;
    let (mut named, mut unseen) = (Vec::new(), Vec::new());
    for mistake in TANGENT_MISTAKES {
        let Some(Mistaken { entries, fitted }) = points.mistaken(mistake.form) else { continue };
        // A fit to a right tangent is right.
        if fitted.is_none() && distance(&entries, &points.right) <= RIGHT {
            unseen.push(mistake);
            continue;
        }
        let left = distance(&entries, &points.given);
        if !passed && left <= (EXPLAINED * error).max(RIGHT.min(0.1 * error)) {
            named.push(NamedTangentMistake { mistake, error: left, fitted });
        }
    }
    named.sort_by(|one, other| one.error.total_cmp(&other.error));
    let best = named.first().map_or(0.0, |best| best.error).max(f64::EPSILON);
    named.retain(|own| own.error <= LIKE_THE_BEST * best);
    Ok(JudgedTangent { error, passed, entries: points.wrong_entries(), named, unseen })
}

#[cfg(test)]
mod tests;
