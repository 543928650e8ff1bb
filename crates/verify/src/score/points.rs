//! Whether points are reference or current positions, decided once for all recordings of a call.

use mmsmith_runtime::Solution;
use mmsmith_vtk::foreign::Snapshot;
use nalgebra::SVector;

use super::arrays::{Role, vectors};
use super::error::ScoreError;
use super::findings::{Remark, Remarks};
use super::found::Found;
use super::frame::outside;
use super::options::{Input, Points, ScoreOptions};
use super::place::Place;
use super::times::{Timed, open};
use super::vectors::are_same_places;

/// By how many times one error is larger than the other where it decides.
const FAR_LARGER: f64 = 3.0;
/// Errors that differ by a smaller share are taken as equal: the motion is too small to matter.
const ALIKE: f64 = 1e-3;
/// Share of the largest displacement by which points have to lie outside the body to tell something.
const BEYOND: f64 = 0.1;
/// Particles at which the two errors are measured.
const MOST_MEASURED: usize = 20_000;

/// How the points of a recording are taken.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Taken {
    /// Whether they are reference positions.
    pub(super) at_rest: bool,
    /// The remark on this choice, if any.
    pub(super) told: Option<Remark>,
}

/// How points are taken.
pub(super) struct Decision {
    /// In each recording.
    pub(super) taken: Vec<Taken>,
    /// The other choice, where nothing decides between them.
    pub(super) other: Option<Points>,
}

/// Evidence of a recording about its points.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Evidence {
    /// Reference positions or displacements do not come from points and displacements together.
    None,
    /// Points stay where they are while displacements change.
    AtRest,
    /// Points move as displacements change.
    Moving,
    /// Neither: the errors of `u` both ways.
    Measured(Measured),
}

/// The errors of `u` in one frame, root mean squares.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Measured {
    /// If points are reference positions.
    reference: f64,
    /// If they are current positions.
    current: f64,
    /// Whether the frame has cells that are not single points.
    is_mesh: bool,
    /// The choice that leaves no point outside of the body, where the other choice leaves some outside.
    by_body: Option<Points>,
}

impl Measured {
    fn least(self) -> f64 {
        self.reference.min(self.current)
    }

    /// The choice that the errors decide, or else the body, if one of them does.
    fn decided(self) -> Option<Points> {
        if self.current > FAR_LARGER * self.reference {
            Some(Points::Reference)
        } else if self.reference > FAR_LARGER * self.current {
            Some(Points::Current)
        } else {
            self.by_body
        }
    }

    fn is_alike(self) -> bool {
        let apart = (self.reference - self.current).abs();
        apart.is_nan() || self.least().is_nan() || apart <= ALIKE * self.least()
    }

    /// The choice where errors do not decide.
    fn usual(self) -> Points {
        if self.is_mesh { Points::Reference } else { Points::Current }
    }

    /// The choice, and what is to be said of it.
    fn judged(self) -> (Points, Option<Remark>, Option<Points>) {
        let of = |points| match points {
            Points::Reference => ("reference", self.reference, "current", self.current),
            _ => ("current", self.current, "reference", self.reference),
        };
        if let Some(points) = self.decided() {
            let (taken, error, other, larger) = of(points);
            let message = if error * FAR_LARGER < larger {
                format!(
                    "the points are taken as {taken} positions: the error of u is {error:.2e}, against {larger:.2e} if they were \
                     {other} positions (--points {other})"
                )
            } else {
                format!(
                    "the points are taken as {taken} positions: as {other} positions some would lie outside the body \
                     (--points {other})"
                )
            };
            return (points, Some(remark("points-decided", message)), None);
        }
        let points = self.usual();
        if self.is_alike() {
            return (points, None, None);
        }
        let (taken, error, other, of_other) = of(points);
        let why = if self.is_mesh { ", as usual for a mesh" } else { "" };
        let message = format!(
            "whether the points are reference or current positions cannot be told from errors of u of {error:.2e} and \
             {of_other:.2e}: they are taken as {taken} positions{why} (--points {taken} or --points {other} tells it)"
        );
        let other = match points {
            Points::Reference => Points::Current,
            _ => Points::Reference,
        };
        (points, Some(remark("points-undecided", message)), Some(other))
    }
}

fn remark(kind: &'static str, message: String) -> Remark {
    Remark { kind, is_problem: false, count: 1, frames: 0, message }
}

/// Decides for all recordings: by points that stay or move while displacements change, else by which gives the far smaller
/// error where that is smallest, else as usual for a mesh or particles.
pub(super) fn decide<const D: usize>(
    exact: &dyn Solution<f64, D>,
    inputs: &[Input],
    options: &ScoreOptions,
) -> Result<Decision, ScoreError> {
    let all = |at_rest| Taken { at_rest, told: None };
    let of_all = |at_rest| Decision { taken: vec![all(at_rest); inputs.len()], other: None };
    match options.points {
        Points::Reference => return Ok(of_all(true)),
        Points::Current => return Ok(of_all(false)),
        Points::Auto => (),
    }
    let mut found = vec![];
    for input in inputs {
        found.push(evidence(exact, input, options)?);
    }
    let (points, told, other) = weigh(&found);
    let taken = |evidence: &Evidence| match evidence {
        Evidence::AtRest => Taken { at_rest: true, told: Some(at_rest()) },
        Evidence::Moving => all(false),
        _ => all(points == Points::Reference),
    };
    let mut taken: Vec<_> = found.iter().map(taken).collect();
    if let Some((index, remark)) = told {
        taken[index].told = Some(remark);
    }
    Ok(Decision { taken, other })
}

fn at_rest() -> Remark {
    let what =
        "the points do not move while displacements change: they are taken as reference positions";
    remark("points-at-rest", what.into())
}

/// The choice for recordings that do not decide by themselves, with what is to be said, and the other choice where nothing
/// decides.
fn weigh(found: &[Evidence]) -> (Points, Option<(usize, Remark)>, Option<Points>) {
    if found.contains(&Evidence::AtRest) {
        return (Points::Reference, None, None);
    }
    if found.contains(&Evidence::Moving) {
        return (Points::Current, None, None);
    }
    let measured = found.iter().enumerate().filter_map(|(index, evidence)| match evidence {
        Evidence::Measured(measured) => Some((index, *measured)),
        _ => None,
    });
    // The most accurate recording tells most.
    let Some((index, measured)) = measured.min_by(|a, b| a.1.least().total_cmp(&b.1.least()))
    else {
        return (Points::Current, None, None);
    };
    let (points, told, other) = measured.judged();
    (points, told.map(|remark| (index, remark)), other)
}

fn evidence<const D: usize>(
    exact: &dyn Solution<f64, D>,
    input: &Input,
    options: &ScoreOptions,
) -> Result<Evidence, ScoreError> {
    let found = Found::new(exact, input, options, &mut Remarks::default())?;
    let Some(name) = found.chosen.name(Role::Displacement) else { return Ok(Evidence::None) };
    if found.chosen.name(Role::ReferencePosition).is_some() || found.first.points().is_none() {
        return Ok(Evidence::None);
    }
    if let Some(is_at_rest) = points_are_at_rest(&found.timed, &found.first, name)? {
        return Ok(if is_at_rest { Evidence::AtRest } else { Evidence::Moving });
    }
    let place = Place::new(&options.placing, exact.is_half_plane())?;
    let [first, .., last] = &found.timed[..] else {
        return measured(exact, &found, &found.first, name, found.timed[0].time, &place)
            .map(Evidence::Measured);
    };
    let frame = if last.time > first.time { last } else { first };
    measured(exact, &found, &open(&frame.file)?, name, frame.time, &place).map(Evidence::Measured)
}

/// Whether points stay where they are, to the bit, while displacements change; `None` where these do not.
fn points_are_at_rest(
    timed: &[Timed],
    first: &Snapshot,
    displacement: &str,
) -> Result<Option<bool>, ScoreError> {
    let positions = first.positions()?;
    let at_first = first.floats(displacement)?;
    for frame in &timed[1..] {
        let snapshot = open(&frame.file)?;
        if snapshot.floats(displacement)? != at_first {
            let components = first.points().map_or(3, |head| head.components);
            return Ok(Some(are_same_places(&snapshot.positions()?, &positions, components)));
        }
    }
    Ok(None)
}

/// The reference position of a point with a displacement.
type Reference<'a, const D: usize> =
    &'a dyn Fn(&SVector<f64, D>, &SVector<f64, D>) -> SVector<f64, D>;

/// Measures both ways.
fn measured<const D: usize>(
    exact: &dyn Solution<f64, D>,
    found: &Found,
    snapshot: &Snapshot,
    displacement: &str,
    time: f64,
    place: &Place<D>,
) -> Result<Measured, ScoreError> {
    let read = |flat: Vec<f64>, components: usize| -> Vec<SVector<f64, D>> {
        let axes = place.axes_of(components);
        if components < D { vec![] } else { vectors::<D>(&flat, components, axes).0 }
    };
    let components = |head: Option<usize>| head.unwrap_or_default();
    let x = read(snapshot.positions()?, components(snapshot.points().map(|head| head.components)));
    let u = read(
        snapshot.floats(displacement)?.unwrap_or_default(),
        components(snapshot.array(displacement).map(|head| head.components)),
    );
    let stride = x.len().div_ceil(MOST_MEASURED).max(1);
    let rms = |reference: Reference<'_, D>| {
        let pairs = x.iter().zip(&u).step_by(stride);
        let error = |(x, u): (&SVector<f64, D>, &SVector<f64, D>)| {
            let (x, u) = (place.position(*x), u * place.length);
            (exact.displacement(&reference(&x, &u), time) - u).norm_squared()
        };
        let errors = pairs.map(error);
        let (sum, count) = errors
            .filter(|error| error.is_finite())
            .fold((0.0, 0.0), |(sum, count), error| (sum + error, count + 1.0));
        (sum / count).sqrt()
    };
    // Cells that cannot be decoded tell nothing.
    let is_mesh = found.is_of_cells || snapshot.mesh().is_ok_and(|mesh| mesh.is_some());
    let domain = exact.domain();
    let beyond = |reference: Reference<'_, D>| {
        let pairs = x.iter().zip(&u).step_by(stride);
        let places: Vec<_> =
            pairs.map(|(x, u)| reference(&place.position(*x), &(u * place.length))).collect();
        outside(&domain, &places).1
    };
    // Less than this is rounding of positions.
    let far = BEYOND * u.iter().map(|u| u.amax() * place.length).fold(0.0, f64::max);
    let by_body = match (beyond(&|x, _| *x), beyond(&|x, u| x - u)) {
        (0.0, current) if current > far => Some(Points::Reference),
        (reference, 0.0) if reference > far => Some(Points::Current),
        _ => None,
    };
    Ok(Measured { reference: rms(&|x, _| *x), current: rms(&|x, u| x - u), is_mesh, by_body })
}
