//! Tensors across the solution's plane or line: around the axis of a body of revolution, along the third direction of plane strain and
//! plane stress, along the two directions that a line leaves out.
//!
//! What an array of six or nine components has there is compared as a field of its own, so that the errors of `F` and `P` stay those of a
//! run. Parts that the solution does not have, such as shear out of the plane, have to vanish.

use std::collections::BTreeMap;

use mmsmith_measure::norms::PerNorm;
use mmsmith_mpm::Law;
use mmsmith_runtime::Solution;
use nalgebra::{Matrix3, SMatrix, SVector};

use crate::case::law;
use crate::points;
use crate::precision::Precision;

use super::arrays::Chosen;
use super::findings::Remarks;
use super::quantity::Quantity;

/// Particles of a frame at which the exact values are looked at, to tell whether there are any.
const SAMPLES: usize = 16;
/// Places at which the law is held against the solution.
const PLACES: usize = 4;
/// Shares of the stress, and of the stiffness, by which the two may differ.
const SAME_LAW: [f64; 2] = [1e-6, 1e-9];
/// Stretches, and stresses over the stiffness, that are rounding.
const ROUNDING: f64 = 1e-12;

/// The tensors that a recording may hold, in the order of [`FrameData`](super::data::FrameData).
pub(super) const TENSORS: [Quantity; 4] = [
    Quantity::DeformationGradient,
    Quantity::FirstPiolaKirchhoff,
    Quantity::Cauchy,
    Quantity::Kirchhoff,
];

/// Exact values across, as far as they are known.
pub(super) struct Directions<const D: usize> {
    /// The law that gives the stress; none where it is not the solution's.
    law: Option<Law<f64, D>>,
    is_half_plane: bool,
    stiffness: f64,
}

impl<const D: usize> Directions<D>
where
    f64: Precision<D>,
{
    pub(super) fn new(exact: &dyn Solution<f64, D>) -> Self {
        let is_half_plane = exact.is_half_plane();
        let law = if is_half_plane || D == 3 { None } else { law::<f64, D>(exact.law()).ok() };
        let speed = exact.wave_speed();
        let stiffness = exact.density() * speed * speed;
        let law = law.filter(|law| is_of(law, exact, stiffness));
        Self { law, is_half_plane, stiffness }
    }

    /// Where it is, in words.
    pub(super) fn words(&self) -> &'static str {
        match (self.is_half_plane, D) {
            (true, _) => "around the axis",
            (false, 1) => "across the line",
            (false, _) => "across the plane",
        }
    }

    /// Collects what has to be known of a frame's particles beforehand.
    pub(super) fn of_frame(
        &self,
        exact: &dyn Solution<f64, D>,
        X: &[SVector<f64, D>],
        time: f64,
    ) -> OfFrame {
        if let Some(around) = exact.around_axis(X, time) {
            return OfFrame::Around(around);
        }
        match &self.law {
            Some(law) if !law.variables().is_empty() => {
                OfFrame::Internal(exact.internal_at(X).evaluate(time, 0..X.len()))
            }
            _ => OfFrame::Internal(vec![]),
        }
    }

    /// The exact stretch and first Piola-Kirchhoff stress across at a particle of a frame; a stress that is not known is not a number.
    pub(super) fn at(
        &self,
        of_frame: &OfFrame,
        p: usize,
        exact: &dyn Solution<f64, D>,
        (X, F, time): (&SVector<f64, D>, &SMatrix<f64, D, D>, f64),
    ) -> [f64; 2] {
        match of_frame {
            OfFrame::Around(around) => around[p],
            OfFrame::Internal(internal) => {
                let stretch = exact.stretch_across(X, time);
                let q = internal.get(p).map_or(&[][..], Vec::as_slice);
                let tau = self.law.as_ref().and_then(|law| kirchhoff_across(law, F, q));
                [stretch, tau.map_or(f64::NAN, |tau| tau / stretch)]
            }
        }
    }

    /// The largest exact `|stretch - 1|` and stress across at some particles of a frame; not a number where it is not known.
    pub(super) fn sizes(
        &self,
        exact: &dyn Solution<f64, D>,
        X: &[SVector<f64, D>],
        time: f64,
    ) -> [f64; 2] {
        let is_finite = |X: &&SVector<f64, D>| X.iter().all(|value| value.is_finite());
        let step = X.len().div_ceil(SAMPLES).max(1);
        let some: Vec<_> = X.iter().step_by(step).filter(is_finite).copied().collect();
        let of_frame = self.of_frame(exact, &some, time);
        let mut largest = [0.0; 2];
        for (p, X) in some.iter().enumerate() {
            let F = exact.deformation_gradient(X, time);
            let [stretch, stress] = self.at(&of_frame, p, exact, (X, &F, time));
            largest = [larger(largest[0], (stretch - 1.0).abs()), larger(largest[1], stress.abs())];
        }
        largest
    }
}

/// The larger one, and not a number where either is none.
fn larger(one: f64, other: f64) -> f64 {
    if one.is_nan() || other <= one { one } else { other }
}

/// Knowledge of a frame's particles.
pub(super) enum OfFrame {
    /// The stretch and the stress around the axis.
    Around(Vec<[f64; 2]>),
    /// The internal variables of the law; nothing of elastic laws.
    Internal(Vec<Vec<f64>>),
}

/// Whether the law gives the solution's stress: a stress at rest, and constants that change from place to place, are not in it.
fn is_of<const D: usize>(law: &Law<f64, D>, exact: &dyn Solution<f64, D>, stiffness: f64) -> bool
where
    f64: Precision<D>,
{
    let domain = exact.domain();
    let places = (0..PLACES).filter_map(|n| points::interior(&domain, exact.period(), n));
    places.into_iter().all(|(X, t)| {
        let q = exact.internal(&X, t);
        if q.len() != law.variables().len() {
            return false;
        }
        let P = exact.first_piola_kirchhoff(&X, t);
        let own = law.with_variables(&q).first_piola_kirchhoff(&exact.deformation_gradient(&X, t));
        let allowed = SAME_LAW[0] * P.norm() + SAME_LAW[1] * stiffness;
        own.is_some_and(|own| (own - P).norm() <= allowed)
    })
}

/// The Kirchhoff stress of a law across, where it tells one.
fn kirchhoff_across<const D: usize>(
    law: &Law<f64, D>,
    F: &SMatrix<f64, D, D>,
    q: &[f64],
) -> Option<f64>
where
    f64: Precision<D>,
{
    match law.with_variables(q) {
        Law::Library(material) => {
            Some(Law::<f64, D>::from(material).kirchhoff_in_space(F)?[(2, 2)])
        }
        Law::Own(own) => own.kirchhoff_across(F),
        Law::WithMemory(_) => None,
    }
}

/// How far a tensor in space, its solution's directions first, is from one that has `expected` along the others, without the part in the
/// plane.
pub(super) fn off<const D: usize>(given: &Matrix3<f64>, expected: f64) -> f64 {
    let entry = |i: usize, j: usize| match (i.max(j) < D, i == j) {
        (true, _) => 0.0,
        (false, true) => given[(i, j)] - expected,
        (false, false) => given[(i, j)],
    };
    Matrix3::from_fn(entry).norm()
}

/// Whether a tensor has anything across.
fn is_there<const D: usize>(given: &Matrix3<f64>, at_rest: f64) -> bool {
    (0..9).map(|k| (k / 3, k % 3)).any(|(i, j)| {
        let of_rest = if i == j { at_rest } else { 0.0 };
        i.max(j) >= D && given[(i, j)] != of_rest
    })
}

/// Errors across of the frames of a recording.
#[derive(Default)]
pub(super) struct Found {
    errors: [PerNorm<f64>; 4],
    /// Whether any frame has an array with these components.
    has_array: [bool; 4],
    /// Whether they are more than zeros that fill the array.
    is_there: [bool; 4],
    sizes: [f64; 2],
}

impl Found {
    /// Takes the arrays and the errors of a frame; `is_less_one` of a displacement gradient.
    pub(super) fn add<const D: usize>(
        &mut self,
        whole: &[Option<Vec<Matrix3<f64>>>; 4],
        errors: &[PerNorm<f64>; 4],
        sizes: [f64; 2],
        is_less_one: bool,
    ) {
        for (n, whole) in whole.iter().enumerate() {
            let Some(whole) = whole else { continue };
            let at_rest = if n == 0 && is_less_one { 1.0 } else { 0.0 };
            self.has_array[n] = true;
            self.is_there[n] |= whole.iter().any(|given| is_there::<D>(given, at_rest));
            self.errors[n] = self.errors[n].larger(&errors[n]);
        }
        self.sizes = std::array::from_fn(|k| larger(self.sizes[k], sizes[k]));
    }

    /// The errors of what is compared; tells of what is not.
    pub(super) fn told<const D: usize>(
        &self,
        directions: &Directions<D>,
        chosen: &Chosen,
        remarks: &mut Remarks,
    ) -> BTreeMap<Quantity, PerNorm<f64>>
    where
        f64: Precision<D>,
    {
        let words = directions.words();
        let mut compared = BTreeMap::new();
        for (n, field) in TENSORS.into_iter().enumerate() {
            let Some(name) = chosen.name(field.role()).filter(|_| D < 3) else { continue };
            let is_stress = n > 0;
            let size = self.sizes[usize::from(is_stress)];
            let scale = if is_stress { directions.stiffness } else { 1.0 };
            let is_trivial = size <= ROUNDING * scale;
            let what = if is_stress { "stress" } else { "stretch" };
            if self.is_there[n] && !size.is_nan() {
                compared.insert(field, self.errors[n]);
            } else if size.is_nan() && self.has_array[n] {
                remarks.note(
                    "no-zz",
                    false,
                    format!(
                        "the {what} {words} of array `{name}` is not compared: that of the solution is not known here"
                    ),
                );
            } else if !is_trivial && self.has_array[n] {
                let is_plane_strain = is_stress && D == 2 && words == "across the plane";
                let hint = if is_plane_strain { "; is plane stress computed?" } else { "" };
                remarks.note(
                    "no-zz",
                    false,
                    format!(
                        "array `{name}` has zeros {words}, where the solution has a {what}: it is not compared{hint}"
                    ),
                );
            } else if !is_trivial && !size.is_nan() {
                remarks.note(
                    "no-zz",
                    false,
                    format!(
                        "array `{name}` has no component {words}, where the solution has a {what}: it is not compared"
                    ),
                );
            }
        }
        compared
    }
}
