//! Stresses that a recording may hold in place of the right one: rows of a table.

use nalgebra::SMatrix;

use super::moduli::{Known, Variant};
use crate::inverse::{determinant, inverse};
use crate::precision::Precision;
use crate::score::quantity::Quantity;

/// A stress as the law has it for a deformation, and all that mistakes make of it.
pub(super) struct At<const D: usize> {
    /// The field that the file has it under.
    pub(super) quantity: Quantity,
    F: SMatrix<f64, D, D>,
    inverse: SMatrix<f64, D, D>,
    /// The ratio of volumes.
    J: f64,
    P: SMatrix<f64, D, D>,
    density: f64,
}

impl<const D: usize> At<D>
where
    f64: Precision<D>,
{
    /// Nothing where F is no deformation.
    pub(super) fn new(
        known: &Known<D>,
        quantity: Quantity,
        F: &SMatrix<f64, D, D>,
        density: f64,
    ) -> Option<Self> {
        let P = known.law.first_piola_kirchhoff(F)?;
        Self::with_stress(known, quantity, F, P, density)
    }

    fn with_stress(
        known: &Known<D>,
        quantity: Quantity,
        F: &SMatrix<f64, D, D>,
        P: SMatrix<f64, D, D>,
        density: f64,
    ) -> Option<Self> {
        let across = known.law.stretch_across(F).powi(3 - D as i32);
        let (inverse, J) = (inverse(F)?, determinant(F) * across);
        Some(Self { quantity, F: *F, inverse, J, P, density })
    }

    fn kirchhoff(&self) -> SMatrix<f64, D, D> {
        self.P * self.F.transpose()
    }

    fn second(&self) -> SMatrix<f64, D, D> {
        self.inverse * self.P
    }

    /// The stress that the field is named for.
    pub(super) fn right(&self) -> SMatrix<f64, D, D> {
        match self.quantity {
            Quantity::Cauchy => self.kirchhoff() / self.J,
            Quantity::Kirchhoff => self.kirchhoff(),
            _ => self.P,
        }
    }

    fn is(&self, quantity: Quantity) -> bool {
        self.quantity == quantity
    }
}

/// A stress that a file may hold in place of the right one.
#[derive(Clone, Copy)]
pub(super) struct Hypothesis {
    /// The kind of its finding; the part after `law-` is its name in JSON.
    pub(super) kind: &'static str,
    /// In words, as they follow "the file's P is".
    pub(super) words: &'static str,
}

impl Hypothesis {
    pub(super) fn name(&self) -> &'static str {
        self.kind.strip_prefix("law-").unwrap_or(self.kind)
    }
}

const fn row(kind: &'static str, words: &'static str) -> Hypothesis {
    Hypothesis { kind, words }
}

/// All of them, the likeliest of those that give the same first.
pub(super) const ALL: &[Hypothesis] = &[
    row("law-transposed", "its transpose (indices exchanged)"),
    row("law-kirchhoff", "the Kirchhoff stress P F^T"),
    row("law-cauchy", "the Cauchy stress P F^T/J"),
    row("law-second-piola-kirchhoff", "the second Piola-Kirchhoff stress F^-1 P"),
    row("law-first-piola-kirchhoff", "the first Piola-Kirchhoff stress P"),
    row("law-times-j", "J times it"),
    row("law-over-j", "it over J"),
    row("law-wrong-inverse", "tau F^-1 in place of tau F^-T"),
    row("law-wrong-push", "F^T S F in place of F S F^T (F transposed in pushing S forward)"),
    row("law-times-f", "P F"),
    row("law-deviatoric", "its deviator, without the pressure"),
    row("law-sign", "it with the other sign"),
    row("law-twice", "twice it"),
    row("law-half", "half of it"),
    row("law-times-density", "rho0 times it"),
    row("law-over-density", "it over rho0"),
    row("law-zero", "zero"),
    row("law-lame-exchanged", "that of the law with lambda and mu exchanged"),
    row("law-young-poisson", "that of the law with E and nu taken for lambda and mu"),
    row(
        "law-plane-stress",
        "that of the law with the lambda of plane stress, 2 lambda mu/(lambda + 2 mu)",
    ),
    row(
        "law-bulk-modulus",
        "that of the law with the bulk modulus lambda + 2/3 mu taken for lambda",
    ),
    row("law-twice-mu", "that of the law with 2 mu, E/(1 + nu), taken for mu"),
    row("law-half-mu", "that of the law with mu/2 taken for mu"),
    row("law-small-strain", "that of small strains, lambda tr(H) I + mu (H + H^T)"),
    row("law-neo-hookean", "that of the neo-Hookean law with lambda ln J"),
    row("law-st-venant-kirchhoff", "that of St. Venant and Kirchhoff's law"),
    row("law-hencky", "that of Hencky's law"),
    row("law-isochoric-logarithmic", "that of the neo-Hookean law in J^(-2/3) I1 with kappa ln J"),
    row(
        "law-isochoric-quadratic",
        "that of the neo-Hookean law in J^(-2/3) I1 with kappa/2 (J - 1)^2",
    ),
    row(
        "law-isochoric-mixed",
        "that of the neo-Hookean law in J^(-2/3) I1 with kappa/4 (J^2 - 1 - 2 ln J)",
    ),
    row(
        "law-pressure-j-squared",
        "that of the neo-Hookean law with lambda (J^2 - 1)/2 in place of lambda ln J",
    ),
    row(
        "law-pressure-j-times",
        "that of the neo-Hookean law with lambda J (J - 1) in place of lambda ln J",
    ),
    row(
        "law-pressure-linear",
        "that of the neo-Hookean law with lambda (J - 1) in place of lambda ln J",
    ),
    row(
        "law-stress-at-rest",
        "that of the neo-Hookean law without -mu F^-T, with a stress at rest",
    ),
    row("law-f-transposed", "the law's at the transpose of the file's F"),
    row("law-h-for-f", "the law's at I + F: the file's F is the displacement gradient"),
    row("law-f-inverse", "the law's at F^-1: the file's F is the inverse"),
];

/// The stresses of all hypotheses that have a meaning for a recorded F, by the places of [`ALL`].
pub(super) struct Values<'a, const D: usize> {
    pub(super) known: &'a Known<D>,
    pub(super) variants: &'a [(&'static str, Variant<D>)],
    pub(super) quantity: Quantity,
    pub(super) density: f64,
}

impl<const D: usize> Values<'_, D>
where
    f64: Precision<D>,
{
    /// The right stress at a recorded F; nothing where that is no deformation.
    pub(super) fn right(&self, F: &SMatrix<f64, D, D>) -> Option<SMatrix<f64, D, D>> {
        Some(At::new(self.known, self.quantity, F, self.density)?.right())
    }

    /// The stress of a hypothesis; nothing where it has no meaning for the field, or F is no deformation.
    pub(super) fn of(&self, kind: &str, F: &SMatrix<f64, D, D>) -> Option<SMatrix<f64, D, D>> {
        match kind {
            "law-f-transposed" => self.right(&F.transpose()),
            "law-h-for-f" => self.right(&(F + SMatrix::identity())),
            "law-f-inverse" => self.right(&inverse(F)?),
            _ => match self.variants.iter().find(|(known, _)| *known == kind) {
                Some((_, variant)) => {
                    let P = self.known.stress(variant, F)?;
                    Some(At::with_stress(self.known, self.quantity, F, P, self.density)?.right())
                }
                None => form(kind, &At::new(self.known, self.quantity, F, self.density)?),
            },
        }
    }
}

/// The stress that a mistake of form makes of the right one.
fn form<const D: usize>(kind: &str, at: &At<D>) -> Option<SMatrix<f64, D, D>>
where
    f64: Precision<D>,
{
    use Quantity::{Cauchy, FirstPiolaKirchhoff, Kirchhoff};
    let right = at.right();
    let (is_first, is_cauchy, is_kirchhoff) =
        (at.is(FirstPiolaKirchhoff), at.is(Cauchy), at.is(Kirchhoff));
    let push = || at.F.transpose() * at.second() * at.F;
    Some(match kind {
        "law-transposed" => right.transpose(),
        "law-kirchhoff" if !is_kirchhoff => at.kirchhoff(),
        "law-cauchy" if !is_cauchy => at.kirchhoff() / at.J,
        "law-second-piola-kirchhoff" => at.second(),
        "law-first-piola-kirchhoff" if !is_first => at.P,
        // Of Cauchy and Kirchhoff stress, each is the other by these.
        "law-times-j" if !is_cauchy => right * at.J,
        "law-over-j" if !is_kirchhoff => right / at.J,
        "law-wrong-inverse" if is_first => at.kirchhoff() * at.inverse,
        "law-wrong-push" if is_kirchhoff => push(),
        "law-wrong-push" if is_cauchy => push() / at.J,
        "law-times-f" if is_first => at.P * at.F,
        "law-deviatoric" if D == 3 => right - SMatrix::identity() * (right.trace() / 3.0),
        "law-sign" => -right,
        "law-twice" => right * 2.0,
        "law-half" => right * 0.5,
        "law-times-density" => right * at.density,
        "law-over-density" => right / at.density,
        "law-zero" => SMatrix::zeros(),
        _ => return None,
    })
}
