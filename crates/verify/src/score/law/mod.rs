//! Recorded stresses, volume ratios and densities against the law at the recorded deformation.
//!
//! No discretisation error enters: a solver evaluates its law at the deformation gradient that it writes beside the stress, so
//! that both agree to rounding on any grid. Where they do not, rows of [`hypotheses`] say what the file may hold instead.

mod hypotheses;
mod judge;
mod moduli;
mod scalars;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use mmsmith_runtime::Solution;
use nalgebra::{SMatrix, SVector};
use serde::Serialize;

use self::hypotheses::{ALL, Hypothesis, Values};
use self::judge::{Judged, judge};
use self::moduli::{Known, Lame};
use super::data::FrameData;
use super::findings::Remarks;
use super::quantity::Quantity;
use crate::flow::is_of_memory;
use crate::precision::Precision;

/// Particles of all frames that are looked at, spread evenly; at most about as many.
const MOST_PLACES: usize = 20_000;
/// The part of a deformation's error that rounding is taken for, in units of its own.
const ROUNDINGS: f64 = 32.0;

/// How a recorded field compares with what the law, or the balance of mass, gives for the recorded deformation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LawRow {
    /// The field.
    pub quantity: Quantity,
    /// Where the deformation gradient is from.
    pub from: Deformation,
    /// Particles that were compared, over all frames.
    pub places: usize,
    /// The outcome.
    pub verdict: LawVerdict,
    /// The name of what the file holds: `right`, another one's, or nothing where none fits.
    pub hypothesis: Option<&'static str>,
    /// The root of the mean square of the difference from that, over the root of the mean square of the field; of the right one where
    /// none fits.
    pub error: f64,
    /// The error, computed likewise, of the hypothesis `right`.
    pub right: f64,
    /// Names that the file cannot tell from `hypothesis`.
    pub alike: Vec<&'static str>,
    /// The error of each other one that has a meaning here.
    pub others: BTreeMap<&'static str, f64>,
}

/// Where a deformation gradient is from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Deformation {
    /// An array of the file.
    F,
}

/// Outcome of a comparison with the law.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum LawVerdict {
    /// The field is the right one.
    Agrees,
    /// The field is another one, which is named.
    Another,
    /// The field is not the right one, and none that is known.
    Unexplained,
}

/// Fields of a file at one particle.
struct Place<const D: usize> {
    X: SVector<f64, D>,
    time: f64,
    F: SMatrix<f64, D, D>,
    /// P, Cauchy and Kirchhoff stress.
    stresses: [Option<SMatrix<f64, D, D>>; 3],
    /// J and density.
    scalars: [Option<f64>; 2],
    /// The recorded stretch around the axis of a body of revolution in its half plane.
    around: Option<f64>,
}

const STRESSES: [Quantity; 3] =
    [Quantity::FirstPiolaKirchhoff, Quantity::Cauchy, Quantity::Kirchhoff];

/// Relative rounding of the numbers of a file, by field.
pub(super) type Rounding<'a> = &'a dyn Fn(Quantity) -> f64;

/// The particles of a recording that are compared with the law.
pub(super) struct Witnesses<const D: usize> {
    places: Vec<Place<D>>,
    of_frame: usize,
}

impl<const D: usize> Witnesses<D> {
    pub(super) fn new(frames: usize) -> Self {
        Self { places: vec![], of_frame: (MOST_PLACES / frames.max(1)).max(16) }
    }

    /// Takes particles of a frame, evenly spread; those with a number that is none are left out.
    pub(super) fn add(&mut self, data: &FrameData<D>, time: f64) {
        let [Some(F), stresses @ ..] = &data.tensors else { return };
        let step = F.len().div_ceil(self.of_frame).max(1);
        for p in (0..F.len()).step_by(step) {
            let place = Place {
                X: data.X[p],
                time,
                F: F[p],
                stresses: stresses.each_ref().map(|stress| Some(stress.as_ref()?[p])),
                scalars: data.scalars.each_ref().map(|scalar| Some(scalar.as_ref()?[p])),
                around: data.whole[0].as_ref().filter(|_| D == 2).map(|F| F[p][(2, 2)]),
            };
            if place.is_finite() {
                self.places.push(place);
            }
        }
    }
}

impl<const D: usize> Place<D> {
    fn is_finite(&self) -> bool {
        let stresses = self.stresses.iter().flatten().flat_map(|stress| stress.iter());
        let scalars = self.scalars.iter().flatten();
        self.F.iter().chain(stresses).chain(scalars).all(|value| value.is_finite())
    }
}

/// A sum of squares of differences, and of what they are relative to.
#[derive(Clone, Copy, Default)]
struct Sums {
    difference: f64,
    recorded: f64,
    expected: f64,
    places: usize,
}

impl Sums {
    fn add(&mut self, difference: f64, recorded: f64, expected: f64) {
        self.difference += difference;
        self.recorded += recorded;
        self.expected += expected;
        self.places += 1;
    }

    /// The relative error, where half of the places or more have a meaning.
    fn error(&self, places: usize) -> Option<f64> {
        let size = if self.recorded > 0.0 { self.recorded } else { self.expected };
        let error = if self.difference == 0.0 { 0.0 } else { (self.difference / size).sqrt() };
        (2 * self.places >= places && self.places > 0).then_some(error)
    }
}

/// Compares all that a recording holds with the law, and tells what was found.
pub(super) fn compare<const D: usize>(
    exact: &dyn Solution<f64, D>,
    witnesses: &Witnesses<D>,
    rounding: Rounding<'_>,
    remarks: &mut Remarks,
) -> Vec<LawRow>
where
    f64: Precision<D>,
{
    let places = &witnesses.places;
    let mut rows = vec![];
    // A recording of a half plane does not hold the stretch around the axis that the law needs, and none what internal variables went through.
    let is_left_out = exact.is_half_plane() || is_of_memory(&exact.law());
    if exact.is_half_plane()
        && places.iter().any(|place| place.stresses.iter().any(Option::is_some))
    {
        let what = "stresses are not held against the law at the recorded F, which is done of bodies in space and in the plane alone";
        remarks.note("law-not-compared", false, what);
    }
    let known = (!is_left_out).then(|| Known::new(exact.law())).flatten();
    if let Some(known) = known {
        let of_field = STRESSES.into_iter().enumerate();
        rows.extend(of_field.filter_map(|(n, quantity)| {
            let recorded = recorded(places, n);
            stress_row(exact, &known, quantity, &recorded, rounding, remarks)
        }));
    }
    tell_agreement::<D>(&rows, remarks);
    rows.extend(scalars::rows(exact, places, rounding, remarks));
    rows
}

/// Tells which stresses are the law's: one line.
fn tell_agreement<const D: usize>(rows: &[LawRow], remarks: &mut Remarks) {
    let right = || rows.iter().filter(|row| row.verdict == LawVerdict::Agrees);
    let names: Vec<_> = right().map(|row| row.quantity.to_string()).collect();
    if names.is_empty() {
        return;
    }
    let is_hidden = |row: &LawRow| {
        D > 1 && row.quantity == Quantity::FirstPiolaKirchhoff && row.alike.contains(&"transposed")
    };
    let what = format!(
        "{} {} with the law at the recorded F, to {:.1e}{}",
        names.join(" and "),
        if names.len() > 1 { "agree" } else { "agrees" },
        right().map(|row| row.error).fold(0.0, f64::max),
        if right().any(is_hidden) {
            "; F is symmetric here, which hides a transposed stress"
        } else {
            ""
        },
    );
    remarks.note("law-agrees", false, what);
}

/// The places that have a stress, with it.
fn recorded<const D: usize>(places: &[Place<D>], n: usize) -> Vec<(&Place<D>, SMatrix<f64, D, D>)> {
    places.iter().filter_map(|place| Some((place, place.stresses[n]?))).collect()
}

fn stress_row<const D: usize>(
    exact: &dyn Solution<f64, D>,
    known: &Known<D>,
    quantity: Quantity,
    recorded: &[(&Place<D>, SMatrix<f64, D, D>)],
    rounding: Rounding<'_>,
    remarks: &mut Remarks,
) -> Option<LawRow>
where
    f64: Precision<D>,
{
    let variants = known.variants();
    let values = Values { known, variants: &variants, quantity, density: exact.density() };
    let error = |value: &dyn Fn(&SMatrix<f64, D, D>) -> Option<SMatrix<f64, D, D>>| {
        let mut sums = Sums::default();
        for (place, recorded) in recorded {
            if let Some(expected) = value(&place.F) {
                let difference = (recorded - expected).norm_squared();
                sums.add(difference, recorded.norm_squared(), expected.norm_squared());
            }
        }
        (sums, sums.error(recorded.len()))
    };
    let (sums, right) = error(&|F| values.right(F));
    if sums.expected == 0.0 && sums.recorded == 0.0 {
        return None;
    }
    let right = right.unwrap_or(f64::INFINITY);
    let errors: Vec<_> = ALL.iter().map(|row| error(&|F| values.of(row.kind, F)).1).collect();
    let size = |sum: f64| (sum / recorded.len() as f64).sqrt();
    let strain = size(recorded.iter().map(|(place, _)| place.F.norm_squared()).sum());
    let of_stress = rounding(quantity)
        + rounding(Quantity::DeformationGradient) * known.stiffness * strain
            / size(sums.recorded.max(f64::MIN_POSITIVE));
    let mut judged = judge(right, &errors, ROUNDINGS * of_stress);
    if let Judged::Other { named } = &mut judged {
        settle_transposed(exact, recorded, named);
    }
    let row = row(quantity, recorded.len(), right, (ALL, &errors), &judged);
    let fit = matches!(judged, Judged::Unexplained)
        .then(|| fitted(known, quantity, recorded, exact.density()))
        .flatten();
    tell(&row, (ALL, &judged), fit, remarks);
    Some(row)
}

/// The row of what was judged.
fn row(
    quantity: Quantity,
    places: usize,
    right: f64,
    (hypotheses, errors): (&[Hypothesis], &[Option<f64>]),
    judged: &Judged,
) -> LawRow {
    let names = |places: &[usize]| places.iter().map(|n| hypotheses[*n].name()).collect::<Vec<_>>();
    let (verdict, hypothesis, error, alike) = match judged {
        Judged::Right { alike } => (LawVerdict::Agrees, Some("right"), right, names(alike)),
        Judged::Other { named } => {
            let first = named[0];
            let error = errors[first].unwrap_or(f64::NAN);
            let name = hypotheses[first].name();
            (LawVerdict::Another, Some(name), error, names(&named[1..]))
        }
        Judged::Unexplained => (LawVerdict::Unexplained, None, right, vec![]),
    };
    let others = hypotheses.iter().zip(errors);
    let others = others.filter_map(|(row, error)| Some((row.name(), (*error)?))).collect();
    LawRow {
        quantity,
        from: Deformation::F,
        places,
        verdict,
        hypothesis,
        error,
        right,
        alike,
        others,
    }
}

/// Says which of F and the stress is transposed, which is the same to an isotropic law, by the exact F.
fn settle_transposed<const D: usize>(
    exact: &dyn Solution<f64, D>,
    recorded: &[(&Place<D>, SMatrix<f64, D, D>)],
    named: &mut Vec<usize>,
) {
    /// One of them is this many times closer.
    const CLEARLY: f64 = 2.0;
    let of_F = ALL.iter().position(|row| row.kind == "law-f-transposed");
    let Some(at) = named.iter().position(|n| Some(*n) == of_F) else { return };
    let (mut given, mut turned) = (0.0, 0.0);
    for (place, _) in recorded {
        let F = exact.deformation_gradient(&place.X, place.time);
        given += (place.F - F).norm_squared();
        turned += (place.F.transpose() - F).norm_squared();
    }
    let square = CLEARLY * CLEARLY;
    if named.len() > 1 && given * square < turned {
        named.remove(at);
    } else if turned * square < given {
        *named = vec![named[at]];
    }
}

/// A multiple of the law, or the Lame constants with which it is the recorded stress, in words.
fn fitted<const D: usize>(
    known: &Known<D>,
    quantity: Quantity,
    recorded: &[(&Place<D>, SMatrix<f64, D, D>)],
    density: f64,
) -> Option<String>
where
    f64: Precision<D>,
{
    /// The largest relative error of a fit.
    const FITS: f64 = 1e-6;
    let part = |lambda: f64, mu: f64| {
        let part = known.at(Lame { lambda, mu })?;
        recorded
            .iter()
            .map(|(place, _)| {
                Some(hypotheses::At::new(&part, quantity, &place.F, density)?.right())
            })
            .collect::<Option<Vec<_>>>()
    };
    let lame = known.lame.filter(|_| known.is_linear_in_lame())?;
    let parts = [part(1.0, 0.0)?, part(0.0, 1.0)?];
    let dot = |one: &[SMatrix<f64, D, D>], other: &[SMatrix<f64, D, D>]| -> f64 {
        one.iter().zip(other).map(|(one, other)| one.dot(other)).sum()
    };
    let stress: Vec<_> = recorded.iter().map(|(_, stress)| *stress).collect();
    let [[a, b], [_, d]] =
        parts.each_ref().map(|one| parts.each_ref().map(|other| dot(one, other)));
    let [e, f] = parts.each_ref().map(|one| dot(one, &stress));
    let determinant = a * d - b * b;
    let found = Lame { lambda: (d * e - b * f) / determinant, mu: (a * f - b * e) / determinant };
    let rest = (0..stress.len())
        .map(|n| stress[n] - parts[0][n] * found.lambda - parts[1][n] * found.mu)
        .map(|rest| rest.norm_squared());
    let error = (rest.sum::<f64>() / dot(&stress, &stress)).sqrt();
    let (E, nu) = found.young();
    let (own_E, own_nu) = lame.young();
    (error <= FITS).then(|| {
        format!(
            "is that of the law with lambda = {:.4e} and mu = {:.4e} (E = {E:.4e}, nu = {nu:.4}) in place of {:.4e} and {:.4e} \
             (E = {own_E:.4e}, nu = {own_nu:.4}), to {error:.1e}: other parameters?",
            found.lambda, found.mu, lame.lambda, lame.mu
        )
    })
}

/// Tells what was judged: a line.
fn tell(
    row: &LawRow,
    (hypotheses, judged): (&[Hypothesis], &Judged),
    fit: Option<String>,
    remarks: &mut Remarks,
) {
    let LawRow { quantity, error, right, .. } = row;
    match judged {
        Judged::Right { .. } => (),
        Judged::Other { named } => {
            let words: Vec<_> = named.iter().take(3).map(|n| hypotheses[*n].words).collect();
            let apart = if named.len() > 1 { " (these data cannot tell them apart)" } else { "" };
            let what = format!(
                "{quantity} is not the law's at the recorded F (off by {right:.1e} of it) but {}, to {error:.1e}{apart}",
                words.join(", or ")
            );
            remarks.note(hypotheses[named[0]].kind, false, what);
        }
        Judged::Unexplained => {
            let what = match fit {
                Some(fit) => format!("{quantity} at the recorded F {fit}"),
                None => format!(
                    "{quantity} is not the law's at the recorded F, off by {right:.1e} of it, and no usual mistake explains it: \
                     is it recorded at another place or time than F, or of another law?"
                ),
            };
            remarks.note("law-differs", false, what);
        }
    }
}
