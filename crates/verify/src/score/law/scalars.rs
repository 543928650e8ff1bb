//! Volume ratios and densities against the recorded deformation.

use mmsmith_runtime::Solution;
use nalgebra::SMatrix;

use super::hypotheses::Hypothesis;
use super::judge::{Judged, judge};
use super::{LawRow, LawVerdict, Place, ROUNDINGS, Rounding, Sums, row};
use crate::inverse::determinant;
use crate::score::findings::Remarks;
use crate::score::quantity::Quantity;

/// A number that a file may hold in place of the right one: of `J`, `tr H` and the density at rest.
struct Number {
    hypothesis: Hypothesis,
    value: Value,
}

const fn number(kind: &'static str, words: &'static str, value: Value) -> Number {
    Number { hypothesis: Hypothesis { kind, words }, value }
}

/// A number from `J`, `tr H` and the density at rest.
type Value = fn([f64; 3]) -> f64;

/// Numbers that a file may hold in place of `J`.
const VOLUME_RATIOS: &[Number] = &[
    number("law-over-j", "1/det F", |[J, ..]| 1.0 / J),
    number("law-volume-change", "det F - 1", |[J, ..]| J - 1.0),
    number("law-small-strain", "1 + tr H, for small strains", |[_, trace, _]| 1.0 + trace),
    number("law-trace", "tr H, for small strains", |[_, trace, _]| trace),
    number("law-logarithm", "ln det F", |[J, ..]| J.ln()),
    number("law-j-squared", "(det F)^2", |[J, ..]| J * J),
];

/// Numbers that a file may hold in place of the density.
const DENSITIES: &[Number] = &[
    number("law-reference-density", "rho0, that at rest", |[.., density]| density),
    number("law-times-j", "rho0 det F", |[J, _, density]| density * J),
    number("law-unit-density", "1/det F, of a density of one at rest", |[J, ..]| 1.0 / J),
    number("law-density-squared", "rho0^2/det F", |[J, _, density]| density * density / J),
];

/// The comparisons of J and density, where they are recorded.
pub(super) fn rows<const D: usize>(
    exact: &dyn Solution<f64, D>,
    places: &[Place<D>],
    rounding: Rounding<'_>,
    remarks: &mut Remarks,
) -> Vec<LawRow> {
    let is_half_plane = exact.is_half_plane();
    let fields: [(_, _, Value, _); 2] = [
        (Quantity::VolumeRatio, "det F", |[J, ..]| J, VOLUME_RATIOS),
        (Quantity::Density, "rho0/det F", |[J, _, density]| density / J, DENSITIES),
    ];
    let mut rows = vec![];
    for (n, (quantity, words, right, numbers)) in fields.into_iter().enumerate() {
        let recorded: Vec<_> = places
            .iter()
            .filter_map(|place| {
                // Volumes of a half plane change with the stretch around the axis too, where it is recorded.
                let around = if is_half_plane { place.around? } else { 1.0 };
                let J = determinant(&place.F) * around;
                let trace = (place.F - SMatrix::identity()).trace() + (around - 1.0);
                Some((place.scalars[n]?, [J, trace, exact.density_at(&place.X)]))
            })
            .filter(|(_, [J, ..])| *J > 0.0)
            .collect();
        if recorded.is_empty() {
            continue;
        }
        let error = |value: Value| {
            let mut sums = Sums::default();
            for (recorded, at) in &recorded {
                let expected = value(*at);
                sums.add((recorded - expected).powi(2), recorded.powi(2), expected.powi(2));
            }
            sums.error(recorded.len())
        };
        let right = error(right).unwrap_or(f64::INFINITY);
        let errors: Vec<_> = numbers.iter().map(|number| error(number.value)).collect();
        let least = ROUNDINGS * (rounding(quantity) + rounding(Quantity::DeformationGradient));
        let judged = judge(right, &errors, least);
        let hypotheses: Vec<_> = numbers.iter().map(|number| number.hypothesis).collect();
        let found = row(quantity, recorded.len(), right, (&hypotheses, &errors), &judged);
        tell(&found, words, (&hypotheses, &judged), remarks);
        rows.push(found);
    }
    rows
}

/// A line where the number is not the right one; agreement goes without saying.
fn tell(
    found: &LawRow,
    words: &str,
    (hypotheses, judged): (&[Hypothesis], &Judged),
    remarks: &mut Remarks,
) {
    let LawRow { quantity, error, right, verdict, .. } = found;
    match judged {
        Judged::Other { named } => {
            let other = hypotheses[named[0]];
            let what = format!(
                "{quantity} is not {words} of the recorded F (off by {right:.1e} of it) but {}, to {error:.1e}",
                other.words
            );
            remarks.note(other.kind, false, what);
        }
        Judged::Unexplained if *verdict == LawVerdict::Unexplained => {
            let what =
                format!("{quantity} is not {words} of the recorded F, off by {right:.1e} of it");
            remarks.note("law-differs", false, what);
        }
        _ => (),
    }
}
