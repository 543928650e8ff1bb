//! Reads the frames of a recording.

use std::collections::HashSet;

use mmsmith_runtime::{Domain, Solution};
use mmsmith_vtk::foreign::{ArrayHead, Snapshot};
use nalgebra::{Matrix3, SMatrix, SVector};

use crate::points;

use super::across::TENSORS;
use super::arrays::{Chosen, Role, matrices, vectors};
use super::data::FrameData;
use super::error::ScoreError;
use super::findings::Remarks;
use super::options::{Exchange, ScoreOptions};
use super::place::Place;
use super::reference::{Scheme, Traced};
use super::vectors::{
    Positions, count_not_finite, judged, particle as of_particle, positions, sheets,
};

/// Share of the body's size by which a reference position may lie outside before it is told.
const OUTSIDE: f64 = 1e-6;

/// Share of a coordinate across the plane by which it may change, as rounding.
const SAME_PLACE: f64 = 1e-9;

/// One vector a particle.
type Vectors<const D: usize> = Vec<SVector<f64, D>>;

/// One tensor a particle, and the same in space where they are known across.
type Tensors<const D: usize> = (Vec<SMatrix<f64, D, D>>, Option<Vec<Matrix3<f64>>>);

/// The particles of the first frame, by which later frames are judged.
#[derive(Default)]
pub(super) struct Identities {
    particles: usize,
    ids: Option<HashSet<i64>>,
    /// Their coordinates across the solution's plane or line.
    across: Vec<f64>,
}

/// Reads frame after frame.
pub(super) struct FrameReader<'a, const D: usize> {
    pub(super) exact: &'a dyn Solution<f64, D>,
    pub(super) chosen: &'a Chosen,
    pub(super) scheme: &'a Scheme<D>,
    pub(super) place: Place<D>,
    pub(super) options: &'a ScoreOptions,
    pub(super) has_velocity_times: bool,
    pub(super) velocity_lag: f64,
    pub(super) remarks: &'a mut Remarks,
    pub(super) first: Identities,
}

impl<const D: usize> FrameReader<'_, D> {
    pub(super) fn frame(
        &mut self,
        snapshot: &Snapshot,
        time: f64,
        index: usize,
    ) -> Result<FrameData<D>, ScoreError> {
        let ids = match self.head(Role::Id, snapshot)? {
            Some(head) => snapshot.integers(&head.name)?,
            None => None,
        };
        self.identify(snapshot, index, ids.as_deref());
        let (mut X, mut u) = self.places(snapshot, index, ids.as_deref())?;
        let mut v = self.velocities(snapshot, time)?;
        if let Some(exchange) = self.options.exchange {
            exchange_columns(exchange, &mut X, &mut u, v.as_mut().map(|(v, _)| v));
        }
        let (mut tensors, mut whole) = ([const { None }; 4], [const { None }; 4]);
        for (n, field) in TENSORS.into_iter().enumerate() {
            (tensors[n], whole[n]) = self.tensor(field.role(), snapshot)?.unzip();
        }
        let data = FrameData {
            v,
            tensors,
            whole: whole.map(Option::flatten),
            scalars: [
                self.scalar(Role::VolumeRatio, snapshot)?,
                self.scalar(Role::Density, snapshot)?,
            ],
            ids,
            X,
            u,
        };
        if self.options.placing.inside {
            return self.inside_only(data, snapshot);
        }
        self.judge_places(&data.X, snapshot);
        Ok(data)
    }

    /// Reference positions and displacements.
    fn places(
        &mut self,
        snapshot: &Snapshot,
        index: usize,
        ids: Option<&[i64]>,
    ) -> Result<(Vectors<D>, Vectors<D>), ScoreError> {
        let missing = |role| ScoreError::Missing {
            path: snapshot.path().to_owned(),
            name: self.chosen.name(role).unwrap_or_default().to_owned(),
        };
        let [no_X, no_u] = [Role::ReferencePosition, Role::Displacement].map(missing);
        Ok(match self.scheme {
            Scheme::Given { displacement } => {
                let X = self.vector(Role::ReferencePosition, snapshot)?.ok_or(no_X)?;
                if *displacement {
                    let u = self.vector(Role::Displacement, snapshot)?.ok_or(no_u)?;
                    self.hold_against_points(&X, &u, snapshot)?;
                    return Ok((X, u));
                }
                let x = self.points(snapshot, index)?;
                let u = x.iter().zip(&X).map(|(x, X)| x - X).collect();
                (X, u)
            }
            Scheme::PointsAtRest => {
                let u = self.vector(Role::Displacement, snapshot)?.ok_or(no_u)?;
                (self.points(snapshot, index)?, u)
            }
            Scheme::Recovered => {
                let u = self.vector(Role::Displacement, snapshot)?.ok_or(no_u)?;
                let x = self.points(snapshot, index)?;
                (x.iter().zip(&u).map(|(x, u)| x - u).collect(), u)
            }
            Scheme::Traced(traced) => {
                let x = self.points(snapshot, index)?;
                let X = self.traced(traced, snapshot, ids)?;
                let u = x.iter().zip(&X).map(|(x, X)| x - X).collect();
                (X, u)
            }
        })
    }

    /// The points; those of particles that move across the solution's plane are told of.
    fn points(
        &mut self,
        snapshot: &Snapshot,
        index: usize,
    ) -> Result<Vec<SVector<f64, D>>, ScoreError> {
        let Positions { all, across } = positions(snapshot, &self.place, self.remarks)?;
        if index == 0 {
            self.first.across.clone_from(&across);
        }
        let first = &self.first.across;
        let is_same = |one: f64, other: f64| (one - other).abs() <= SAME_PLACE * one.abs();
        let moved = first.len().abs_diff(across.len())
            + first.iter().zip(&across).filter(|(one, other)| !is_same(**one, **other)).count();
        if first.len() != across.len() && snapshot.particles() != self.first.particles {
            // Told as another number of particles.
            return Ok(all);
        }
        let what = format!(
            "particle(s) move across the solution's {D} dimension(s); --axes names the plane of the motion, such as --axes x,z"
        );
        let path = || snapshot.path().display().to_string();
        self.remarks.met("out-of-plane", true, moved, what, path);
        if index == 0 && !across.is_empty() {
            let what = format!(
                "particles have coordinates across the solution's {D} dimension(s), which are left out: {}",
                sheets(&across)
            );
            self.remarks.note("sheets", false, what);
        }
        Ok(all)
    }

    /// Velocities with the time to which they belong.
    fn velocities(
        &mut self,
        snapshot: &Snapshot,
        time: f64,
    ) -> Result<Option<(Vectors<D>, f64)>, ScoreError> {
        let own = match (snapshot.field("VelocityTime"), self.has_velocity_times) {
            (Some(own), _) => {
                let what = "frame(s) tell a time for their velocities that is not finite";
                let first = || snapshot.path().display().to_string();
                let count = usize::from(!own.is_finite());
                self.remarks.met("time-not-finite", true, count, what, first);
                own * self.options.placing.time_unit
            }
            (None, true) => {
                self.remarks.met(
                    "velocity-without-time",
                    false,
                    1,
                    "frame(s) do not tell the time of their velocities, as others do; those are not compared",
                    || snapshot.path().display().to_string(),
                );
                return Ok(None);
            }
            (None, false) => time - self.velocity_lag,
        };
        Ok(self.vector(Role::Velocity, snapshot)?.map(|v| (v, own)))
    }

    /// The particles that the body has.
    fn inside_only(
        &mut self,
        data: FrameData<D>,
        snapshot: &Snapshot,
    ) -> Result<FrameData<D>, ScoreError> {
        let domain = self.exact.domain();
        let is_traced = matches!(self.scheme, Scheme::Traced(_));
        let is_inside = |X: &SVector<f64, D>| {
            if X.iter().any(|value| !value.is_finite()) {
                // Of a particle that the exact motion does not have; others are told of as not finite.
                return !is_traced;
            }
            points::outside(&domain, X).is_none_or(|share| share <= OUTSIDE)
        };
        let kept: Vec<bool> = data.X.iter().map(is_inside).collect();
        let left_out = kept.iter().filter(|kept| !**kept).count();
        if left_out == kept.len() {
            return Err(ScoreError::NoneInside { path: snapshot.path().to_owned() });
        }
        let what = "particle(s) outside of the body are left out";
        let path = || snapshot.path().display().to_string();
        self.remarks.met("left-out", false, left_out, what, path);
        Ok(data.only(&kept))
    }

    /// Holds the particles against those of the first frame.
    fn identify(&mut self, snapshot: &Snapshot, index: usize, ids: Option<&[i64]>) {
        let particles = snapshot.particles();
        let path = || snapshot.path().display().to_string();
        let known: Option<HashSet<i64>> = ids.map(|ids| ids.iter().copied().collect());
        if let Some(known) = &known {
            let what = "particle(s) have an identity that another one of their frame has";
            let repeated = ids.map_or(0, <[i64]>::len) - known.len();
            self.remarks.met("repeated-id", true, repeated, what, path);
        }
        if index == 0 {
            self.first = Identities { particles, ids: known, across: vec![] };
            return;
        }
        if particles != self.first.particles {
            let what = format!(
                "frame(s) hold another number of particles than the first one's {}",
                self.first.particles
            );
            let first = || format!("{} holds {particles}", snapshot.path().display());
            self.remarks.met("unequal-particles", true, 1, what, first);
        }
        if let (Some(known), Some(first)) = (&known, &self.first.ids) {
            for (kind, what, one, other) in [
                ("missing-particles", "particle(s) of the first frame are missing", first, known),
                ("new-particles", "particle(s) are not in the first frame", known, first),
            ] {
                let odd = || one.difference(other);
                let place = || {
                    let id = odd().min().copied().unwrap_or(0);
                    format!("id {id} of {}", snapshot.path().display())
                };
                self.remarks.met(kind, true, odd().count(), what, place);
            }
        }
    }

    /// The reference positions of the frame's particles.
    fn traced(
        &mut self,
        traced: &Traced<D>,
        snapshot: &Snapshot,
        ids: Option<&[i64]>,
    ) -> Result<Vec<SVector<f64, D>>, ScoreError> {
        match (&traced.places, ids) {
            // Particles that the first frame lacks have no reference position; `identify` has told of them.
            (Some(places), Some(ids)) => Ok(ids
                .iter()
                .map(|id| places.get(id).map_or(SVector::repeat(f64::NAN), |p| traced.X[*p]))
                .collect()),
            _ if snapshot.particles() == traced.X.len() => Ok(traced.X.clone()),
            _ => Err(ScoreError::Unmatched {
                path: snapshot.path().to_owned(),
                found: snapshot.particles(),
                expected: traced.X.len(),
            }),
        }
    }

    /// Tells of displacements that are not those of the points, where there are points that are neither `X` nor `X + u`.
    fn hold_against_points(
        &mut self,
        X: &[SVector<f64, D>],
        u: &[SVector<f64, D>],
        snapshot: &Snapshot,
    ) -> Result<(), ScoreError> {
        let Some(head) = snapshot.points().filter(|head| (D..=3).contains(&head.components)) else {
            return Ok(());
        };
        let flat = snapshot.positions()?;
        let (mut x, _) = vectors::<D>(&flat, head.components, self.place.axes_of(head.components));
        x.iter_mut().for_each(|x| *x = self.place.position(*x));
        let size = X.iter().map(|X| X.amax()).fold(0.0, f64::max);
        let far = |distance: f64| distance > OUTSIDE * size;
        let distances = |u: &dyn Fn(usize) -> SVector<f64, D>| -> Vec<f64> {
            x.iter().zip(X).enumerate().map(|(p, (x, X))| (x - X - u(p)).amax()).collect()
        };
        if !distances(&|_| SVector::zeros()).into_iter().any(far) {
            return Ok(());
        }
        let apart = distances(&|p| u[p]);
        let count = apart.iter().filter(|distance| far(**distance)).count();
        let worst = apart.iter().enumerate().max_by(|one, other| one.1.total_cmp(other.1));
        let what = "particle(s) whose displacement is not the difference of their point and reference position; the array \
                    of displacements is compared";
        let first = || {
            let (particle, distance) =
                worst.map_or((0, 0.0), |(particle, distance)| (particle, *distance));
            format!("by {distance:.3e} at {}", of_particle(particle, snapshot))
        };
        self.remarks.met("displacement-not-of-points", false, count, what, first);
        Ok(())
    }

    /// Tells of reference positions that no part of the body has.
    fn judge_places(&mut self, X: &[SVector<f64, D>], snapshot: &Snapshot) {
        let domain = self.exact.domain();
        let (count, furthest) = outside(&domain, X);
        let what = "reference position(s) lie outside the body (--inside leaves them out)";
        let first = || format!("the furthest by {furthest:.3e} in {}", snapshot.path().display());
        self.remarks.met("outside-body", false, count, what, first);
    }

    fn vector(
        &mut self,
        role: Role,
        snapshot: &Snapshot,
    ) -> Result<Option<Vec<SVector<f64, D>>>, ScoreError> {
        let Some((flat, components)) = self.array(role, snapshot)? else { return Ok(None) };
        let mut all = match role {
            // What they have across the plane is that of points.
            Role::ReferencePosition => {
                count_not_finite(&flat, components, role.name(), snapshot, self.remarks);
                vectors(&flat, components, self.place.axes_of(components)).0
            }
            _ => judged(&flat, components, role.name(), &self.place, snapshot, self.remarks),
        };
        for vector in &mut all {
            *vector = match role {
                Role::ReferencePosition => self.place.position(*vector),
                Role::Velocity => *vector * self.place.velocity,
                _ => *vector * self.place.length,
            };
        }
        Ok(Some(all))
    }

    /// A tensor in the solution's directions, and in space where the array has components across.
    fn tensor(
        &mut self,
        role: Role,
        snapshot: &Snapshot,
    ) -> Result<Option<Tensors<D>>, ScoreError> {
        let Some((flat, components)) = self.array(role, snapshot)? else { return Ok(None) };
        count_not_finite(&flat, components, role.name(), snapshot, self.remarks);
        let is_of_space = [6, 9].contains(&components);
        let axes = self.place.axes_of(if is_of_space { 3 } else { D });
        let mut all = matrices(&flat, components, axes);
        let others = (0..3).filter(|axis| !axes.contains(axis));
        let order: Vec<usize> = axes.into_iter().chain(others).collect();
        let mut whole = (is_of_space && D < 3)
            .then(|| matrices::<3>(&flat, components, std::array::from_fn(|i| order[i])));
        if role == Role::DeformationGradient && self.chosen.is_less_one {
            all.iter_mut().for_each(|F| *F += SMatrix::identity());
            whole.iter_mut().flatten().for_each(|F| *F += Matrix3::identity());
        }
        Ok(Some((all, whole)))
    }

    fn scalar(&mut self, role: Role, snapshot: &Snapshot) -> Result<Option<Vec<f64>>, ScoreError> {
        let Some((flat, components)) = self.array(role, snapshot)? else { return Ok(None) };
        count_not_finite(&flat, components, role.name(), snapshot, self.remarks);
        Ok(Some(flat))
    }

    /// The numbers of an array and how many a particle has.
    fn array(
        &self,
        role: Role,
        snapshot: &Snapshot,
    ) -> Result<Option<(Vec<f64>, usize)>, ScoreError> {
        let Some(head) = self.head(role, snapshot)? else { return Ok(None) };
        Ok(snapshot.floats(&head.name)?.map(|flat| (flat, head.components)))
    }

    /// The array for a role, whose shape may have changed since the first frame.
    fn head<'s>(
        &self,
        role: Role,
        snapshot: &'s Snapshot,
    ) -> Result<Option<&'s ArrayHead>, ScoreError> {
        let Some(name) = self.chosen.name(role) else { return Ok(None) };
        let Some(head) = snapshot.array(name) else { return Ok(None) };
        if role.admits::<D>(head.components) {
            return Ok(Some(head));
        }
        Err(ScoreError::Components {
            path: snapshot.path().to_owned(),
            role,
            name: name.to_owned(),
            components: head.components,
            admissible: role.admissible::<D>(),
        })
    }
}

/// Takes columns one for the other.
fn exchange_columns<const D: usize>(
    exchange: Exchange,
    X: &mut Vectors<D>,
    u: &mut Vectors<D>,
    v: Option<&mut Vectors<D>>,
) {
    let swap = |all: &mut Vectors<D>, i, j| all.iter_mut().for_each(|one| one.swap_rows(i, j));
    match exchange {
        Exchange::Displacement(i, j) => swap(u, i, j),
        Exchange::Motion(i, j) => {
            swap(u, i, j);
            if let Some(v) = v {
                swap(v, i, j);
            }
        }
        Exchange::Component(i) => {
            for (X, u) in X.iter_mut().zip(u) {
                std::mem::swap(&mut X[i], &mut u[i]);
            }
        }
        Exchange::Both => std::mem::swap(X, u),
    }
}

/// How many places lie outside of the body, and the furthest of them, a length.
pub(super) fn outside<const D: usize>(
    domain: &Domain<f64, D>,
    X: &[SVector<f64, D>],
) -> (usize, f64) {
    let size = match domain {
        Domain::Box { lower, upper } => (upper - lower).amax(),
        Domain::Annulus { outer, .. } => *outer,
        Domain::Tube { outer, lower, upper, .. } => outer.max(upper - lower),
        _ => return (0, 0.0),
    };
    let shares =
        X.iter().filter_map(|X| points::outside(domain, X)).filter(|share| *share > OUTSIDE);
    shares.fold((0, 0.0), |(count, furthest), share| (count + 1, furthest.max(share * size)))
}
