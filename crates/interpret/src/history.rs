//! Stress, body force and internal variables of laws with memory, from the history of each particle.

use mmsmith_expr::Program;
use mmsmith_history::{
    AnyLaw, AtPoint, AtTime, Dual, ENTRIES, HistoryError, Kinematics, LawWithHistory, Motion,
    Number, Table, Tensor, Trajectory, UnsupportedLaw, divergence, kinds_of, place,
};
use mmsmith_runtime::{Around, Domain, HistoryReport, Law, Real, ScalarFunctions, Smoothness};
use mmsmith_stage::History;
use mmsmith_threads::parallel::*;
use std::f64::consts::{PI, TAU};
use std::ops::Range;
use std::sync::{Arc, RwLock};

mod packed;
mod prepared;

use packed::Packing;
pub(crate) use prepared::{Moment, Prepared, Quantities};

/// The relative tolerance of trajectories of laws with flow.
const TOLERANCE: f64 = 1e-13;
/// That of smooth ones, whose steps are longer, and with them the errors of values between steps.
const TOLERANCE_OF_SMOOTH: f64 = 1e-15;
/// Where tables have larger errors each particle has series of its own.
pub(crate) const LARGEST_ERROR: f64 = 1e-11;
/// The part that a table may leave out, as a share of each quantity's largest value.
const TABLE_TOLERANCE: f64 = 1e-12;

/// The shape of the body as tables have it: the range of each coordinate, and the way from these to the place.
#[derive(Clone, Debug)]
pub(crate) enum Chart<const D: usize> {
    /// A box in Cartesian coordinates.
    Box { lower: [f64; D], upper: [f64; D] },
    /// A body between two radii.
    Annulus { inner: f64, outer: f64 },
    /// A body between two radii about the axis `Z`, two angles and two heights.
    Tube { radii: [f64; 2], angles: [f64; 2], heights: [f64; 2] },
}

/// Why histories cannot be formed.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
pub enum HistoryProblem {
    /// The law has none.
    #[error(transparent)]
    Law(#[from] UnsupportedLaw),
    /// Bodies that have no tables.
    #[error(
        "particles of a law with memory are followed in boxes, between two radii, and in tubes, sectors and cylinders; this body is none of these. \
         Write one of these shapes, or leave [material.flow], [[material.maxwell]] or [internal] out"
    )]
    Shape,
    /// A name in the law without a value.
    #[error(
        "the law has no value for '{name}': in [internal] and [given] positions are Cartesian, X, Y and Z"
    )]
    NoValue {
        /// The name.
        name: String,
    },
}

impl<const D: usize> Chart<D> {
    pub(crate) fn of<T: Real>(domain: &Domain<T, D>) -> Option<Self> {
        Some(match domain {
            Domain::Annulus { inner, outer } => {
                Self::Annulus { inner: inner.to_f64(), outer: outer.to_f64() }
            }
            Domain::Box { lower, upper } => Self::Box {
                lower: std::array::from_fn(|i| lower[i].to_f64()),
                upper: std::array::from_fn(|i| upper[i].to_f64()),
            },
            Domain::Tube { inner, outer, lower, upper, around } => Self::Tube {
                radii: [*inner, *outer].map(Real::to_f64),
                angles: match around {
                    Around::Sector { from, to } => [*from, *to].map(Real::to_f64),
                    Around::Axisymmetric | Around::Whole => [0.0, TAU],
                },
                heights: [*lower, *upper].map(Real::to_f64),
            },
            _ => return None,
        })
    }

    /// The range of a coordinate.
    pub(crate) fn range(&self, axis: usize) -> [f64; 2] {
        match self {
            Self::Box { lower, upper } => [lower[axis], upper[axis]],
            Self::Tube { radii, angles, heights } => [*radii, *angles, *heights][axis],
            Self::Annulus { inner, outer } => match (axis, D) {
                (0, _) => [*inner, *outer],
                (1, 3) => [0.0, PI],
                _ => [0.0, TAU],
            },
        }
    }

    /// The place of coordinates.
    fn place(&self, q: [f64; D]) -> [f64; D] {
        match self {
            Self::Box { .. } => q,
            Self::Tube { .. } => {
                std::array::from_fn(|i| [q[0] * q[1].cosine(), q[0] * q[1].sine(), q[2]][i])
            }
            Self::Annulus { .. } => match D {
                1 => q,
                2 => std::array::from_fn(|i| q[0] * [q[1].cosine(), q[1].sine()][i]),
                _ => std::array::from_fn(|i| {
                    let (sine, cosine) = (q[1].sine(), q[1].cosine());
                    q[0] * [sine * q[2].cosine(), sine * q[2].sine(), cosine][i]
                }),
            },
        }
    }

    /// The coordinates of a place.
    fn coordinates(&self, X: &[f64; D]) -> [f64; D] {
        let norm =
            |of: &[f64]| of.iter().fold(0.0, |norm: f64, x| mmsmith_runtime::libm::hypot(norm, *x));
        let angle = || X[1].polar_angle(X[0]);
        match self {
            Self::Box { .. } => *X,
            Self::Tube { angles: [first, last], .. } => {
                // Next to the middle of the angles, so that rounding at an end is no whole turn.
                let turns = ((0.5 * (first + last) - angle()) / TAU).round();
                std::array::from_fn(|i| [norm(&X[..2]), angle() + turns * TAU, X[2]][i])
            }
            Self::Annulus { .. } => {
                let around = if D > 1 { angle().rem_euclid(TAU) } else { 0.0 };
                match D {
                    1 => *X,
                    2 => std::array::from_fn(|i| [norm(X), around][i]),
                    _ => {
                        let down = norm(&X[..2]).polar_angle(X[2]);
                        std::array::from_fn(|i| [norm(X), down, around][i])
                    }
                }
            }
        }
    }
}

/// The stress of a particle and the body force that balances it, in Cartesian components.
#[derive(Clone, Debug)]
pub(crate) struct Response<const D: usize> {
    pub(crate) P: [[f64; D]; D],
    pub(crate) b: [f64; D],
}

/// The stress of a particle and its internal variables, in Cartesian components.
#[derive(Clone, Debug)]
pub(crate) struct Stressed<const D: usize> {
    pub(crate) P: [[f64; D]; D],
    pub(crate) internal: Vec<f64>,
}

/// The law of a solution, and the motion that its histories follow.
pub(crate) struct Histories<const D: usize> {
    law: AnyLaw,
    /// The names of the internal variables as the solver's law has them.
    pub(crate) names: Vec<String>,
    /// The places of the first entries of tensors among them.
    tensors: Vec<usize>,
    /// Constants of the law, each a number or a coordinate.
    constants: Vec<Constant>,
    motion: Program,
    inertia: Program,
    parameters: Vec<f64>,
    density: f64,
    density_here: Option<Program>,
    pub(crate) chart: Chart<D>,
    /// The coordinates of the chart that fields depend on.
    pub(crate) axes: Vec<usize>,
    tables: RwLock<Option<Arc<Tables<D>>>>,
}

#[derive(Clone, Copy, Debug)]
enum Constant {
    Number(f64),
    Coordinate(usize),
    Time,
}

/// A particle that stays at its place.
struct Particle<'a, const D: usize> {
    histories: &'a Histories<D>,
    X: [f64; D],
    /// Cartesian components of the unit vectors of its frame, `[i][a]`.
    frame: [[f64; D]; D],
}

impl<const D: usize> Particle<'_, D> {
    /// Coordinates, time and parameters, as programs have them.
    fn inputs(&self, t: f64) -> Vec<f64> {
        self.X.iter().copied().chain([t]).chain(self.histories.parameters.iter().copied()).collect()
    }

    fn kinematics(&self, time: f64) -> Kinematics<Dual<f64, D>> {
        let values = self.histories.motion.evaluate_in(&self.inputs(time));
        let entry = |block: usize, i: usize, j: usize| values[block * D * D + i * D + j];
        // F, dF/dt, then the slopes of either.
        let tensor = |block: usize, first_slope: usize| -> Tensor<Dual<f64, D>> {
            std::array::from_fn(|i| {
                std::array::from_fn(|j| match i < D && j < D {
                    true => Dual {
                        value: entry(block, i, j),
                        slopes: std::array::from_fn(|J| entry(first_slope + J, i, j)),
                    },
                    false => Dual::constant(if i == j && block == 0 { 1.0 } else { 0.0 }),
                })
            })
        };
        Kinematics { F: tensor(0, 2), rate: tensor(1, 2 + D) }
    }

    fn all_constants(&self, time: f64) -> Vec<Dual<f64, D>> {
        let of = |constant: &Constant| match *constant {
            Constant::Number(value) => Dual::constant(value),
            Constant::Time => Dual::constant(time),
            Constant::Coordinate(axis) => {
                Dual { value: self.X[axis], slopes: std::array::from_fn(|J| self.frame[axis][J]) }
            }
        };
        self.histories.constants.iter().map(of).collect()
    }
}

impl<const D: usize> Motion<D> for Particle<'_, D> {
    fn at(&self, time: f64) -> Kinematics<Dual<f64, D>> {
        self.kinematics(time)
    }

    fn frame(&self) -> Tensor<f64> {
        in_space(&self.frame)
    }

    fn constants(&self, time: f64, constants: &mut Vec<Dual<f64, D>>) {
        constants.extend(self.all_constants(time));
    }
}

/// A particle whose stress is asked for alone: without slopes its trajectory takes a third of the time.
struct WithoutSlopes<'a, const D: usize>(&'a Particle<'a, D>);

impl<const D: usize> Motion<0> for WithoutSlopes<'_, D> {
    fn frame(&self) -> Tensor<f64> {
        in_space(&self.0.frame)
    }

    fn at(&self, time: f64) -> Kinematics<Dual<f64, 0>> {
        let Kinematics { F, rate } = self.0.kinematics(time);
        let of =
            |A: Tensor<Dual<f64, D>>| A.map(|row| row.map(|entry| Dual::constant(entry.value)));
        Kinematics { F: of(F), rate: of(rate) }
    }

    fn constants(&self, time: f64, constants: &mut Vec<Dual<f64, 0>>) {
        constants.extend(self.0.all_constants(time).iter().map(|c| Dual::constant(c.value)));
    }
}

impl<const D: usize> Histories<D> {
    /// Histories of a law that has some.
    pub(crate) fn new(
        law: &Law<f64>,
        history: &History,
        parameters: Vec<f64>,
        chart: Chart<D>,
        is_cartesian: bool,
        (density, density_here): (f64, Option<Program>),
    ) -> Result<Self, HistoryProblem> {
        let any = AnyLaw::new(law, D)?;
        let known: Vec<(String, f64)> = match law {
            Law::WithMemory(law) => law.named_values(),
            Law::Stated(stated) => stated.constants.clone(),
            Law::Library(_) => Vec::new(),
        };
        let constants = any
            .constants()
            .iter()
            .map(|name| match known.iter().find(|(own, _)| own == name) {
                Some((_, value)) => Ok(Constant::Number(*value)),
                None => match ["X", "Y", "Z"].iter().position(|axis| axis == name) {
                    Some(axis) if axis < D => Ok(Constant::Coordinate(axis)),
                    None if name == "t" => Ok(Constant::Time),
                    _ => Err(HistoryProblem::NoValue { name: name.clone() }),
                },
            })
            .collect::<Result<Vec<_>, _>>()?;
        // A start along X and Y is another one for each angle.
        let uses_places = constants.iter().any(|c| matches!(c, Constant::Coordinate(_)))
            || any.begins_along_axes() && !is_cartesian;
        // Coordinates of the specification that nothing depends on are those of the chart, or none is left out.
        let fits = match chart {
            Chart::Box { .. } => is_cartesian,
            Chart::Annulus { .. } | Chart::Tube { .. } => !is_cartesian,
        };
        let is_used = |axis: &usize| {
            !fits || uses_places || density_here.is_some() || history.coordinates[*axis]
        };
        let axes: Vec<usize> = (0..D).filter(is_used).collect();
        let names = any.observable_names();
        let tensors = first_entries(&names);
        let (motion, inertia) = (history.motion.clone(), history.inertia.clone());
        Ok(Self {
            law: any,
            names,
            tensors,
            constants,
            motion,
            inertia,
            parameters,
            density,
            density_here,
            chart,
            axes: if axes.is_empty() { vec![0] } else { axes },
            tables: RwLock::new(None),
        })
    }

    fn tolerance(&self) -> f64 {
        match self.law {
            AnyLaw::Flow(_) => TOLERANCE,
            AnyLaw::Maxwell(_) | AnyLaw::Stated(_) => TOLERANCE_OF_SMOOTH,
        }
    }

    /// The part that a table in a file may leave out: with less the values are no closer, since trajectories have errors as well.
    pub(crate) fn tolerance_of_files(&self) -> f64 {
        match self.law {
            AnyLaw::Flow(_) => TABLE_TOLERANCE,
            AnyLaw::Maxwell(_) | AnyLaw::Stated(_) => TABLE_TOLERANCE / 5.0,
        }
    }

    /// The kind of each quantity, in the order of [`in_frame`](Self::in_frame): components of one tensor are of one kind.
    fn kinds(&self) -> Vec<usize> {
        let of_variables = kinds_of(&self.names).into_iter().map(|kind| 2 + kind).collect();
        [vec![0; D], vec![1; D * D], of_variables].concat()
    }

    /// The series of a particle alone, for bodies whose fields no table has well.
    fn own_series(&self, X: [f64; D], end: f64, range: &Range<usize>) -> Option<AtPoint> {
        self.own_series_and_tail(X, end, range).map(|(series, _)| series)
    }

    /// The series of a particle alone in Cartesian components, with the part that it leaves out.
    pub(crate) fn cartesian_series(&self, X: [f64; D], end: f64) -> Option<(AtPoint, f64)> {
        let count = D + D * D + self.names.len();
        let (series, tail) = self.own_series_and_tail(X, end, &(0..count))?;
        let particle = self.particle(X);
        let mut turned = vec![Vec::new(); count];
        for term in 0..series.coefficients(0).len() {
            let own: Vec<f64> = (0..count).map(|q| series.coefficients(q)[term]).collect();
            let Response { P, b } = self.turned(&particle, &own);
            let mut internal = own[D + D * D..].to_vec();
            turn_tensors(&self.tensors, &particle.frame, &mut internal);
            let all = b.into_iter().chain(P.into_iter().flatten()).chain(internal);
            turned.iter_mut().zip(all).for_each(|(turned, value)| turned.push(value));
        }
        Some((AtPoint::new(series.knots().to_vec(), series.in_time(), turned), tail))
    }

    /// As [`own_series`](Self::own_series), with the part that it leaves out.
    fn own_series_and_tail(
        &self,
        X: [f64; D],
        end: f64,
        range: &Range<usize>,
    ) -> Option<(AtPoint, f64)> {
        let particle = self.particle(X);
        let trajectory =
            Trajectory::<D>::new(&self.law, &particle, &[end], self.tolerance()).ok()?;
        let breaks: Vec<f64> = trajectory.changes.iter().map(|change| change.time).collect();
        let kinds = &self.kinds()[range.clone()];
        let of = |times: &[f64]| {
            let mut all = self.in_frame(&particle, times)?;
            Ok::<_, HistoryError>(all.drain(range.clone()).collect())
        };
        AtPoint::fine(end, &breaks, TABLE_TOLERANCE, kinds, of).ok()
    }

    fn particle(&self, X: [f64; D]) -> Particle<'_, D> {
        let mut particle = Particle { histories: self, X, frame: [[0.0; D]; D] };
        let values = self.inertia.evaluate_in(&particle.inputs(0.0));
        particle.frame = std::array::from_fn(|i| std::array::from_fn(|a| values[D + i * D + a]));
        particle
    }

    fn density_at(&self, particle: &Particle<'_, D>) -> f64 {
        let here = self.density_here.as_ref();
        here.map_or(self.density, |program| program.evaluate_in(&particle.inputs(0.0))[0])
    }

    /// Stress, body force and internal variables in the frame of a particle at some times, quantity by quantity.
    fn in_frame(
        &self,
        particle: &Particle<'_, D>,
        times: &[f64],
    ) -> Result<Vec<Vec<f64>>, HistoryError> {
        let trajectory = Trajectory::<D>::new(&self.law, particle, times, self.tolerance())?;
        let density = self.density_at(particle);
        let mut all = vec![Vec::with_capacity(times.len()); D * D + D + self.names.len()];
        for (&time, z) in times.iter().zip(&trajectory.states) {
            let constants = particle.all_constants(time);
            let (div, P) = divergence(&self.law, &particle.kinematics(time), &constants, z);
            let a = self.inertia.evaluate_in(&particle.inputs(time));
            let stresses = (0..D * D).map(|k| P[k / D][k % D]);
            let force = (0..D).map(|i| a[i] - div[i] / density);
            let of_constants: Vec<f64> = constants.iter().map(|c| c.value).collect();
            let of_z: Vec<f64> = z.iter().map(|z| z.value).collect();
            let internal = self.law.observables(&of_constants, &of_z);
            for (own, value) in all.iter_mut().zip(force.chain(stresses).chain(internal)) {
                own.push(value);
            }
        }
        Ok(all)
    }

    /// From the frame of a particle to Cartesian components; `values` as [`in_frame`](Self::in_frame) orders them.
    fn turned(&self, particle: &Particle<'_, D>, values: &[f64]) -> Response<D> {
        let Q = &particle.frame;
        let (force, stress) = values.split_at(D);
        Response { b: turn_vector(Q, |a| force[a]), P: turn_tensor(Q, |k| stress[k]) }
    }

    /// At one place and time, by the trajectory of this particle.
    pub(crate) fn response(&self, X: [f64; D], t: f64) -> Result<Response<D>, HistoryError> {
        let particle = self.particle(X);
        let all = self.in_frame(&particle, &[t])?;
        let values: Vec<f64> = all.iter().map(|values| values[0]).collect();
        Ok(self.turned(&particle, &values))
    }

    /// The stress and the internal variables at one place and time.
    pub(crate) fn stressed(&self, X: [f64; D], t: f64) -> Result<Stressed<D>, HistoryError> {
        let particle = self.particle(X);
        let motion = WithoutSlopes(&particle);
        let trajectory = Trajectory::<0>::new(&self.law, &motion, &[t], self.tolerance())?;
        let values = |numbers: &[Dual<f64, 0>]| numbers.iter().map(|z| z.value).collect();
        let z: Vec<f64> = trajectory.states.first().map_or_else(Vec::new, |z| values(z));
        let Kinematics { F, rate } = particle.kinematics(t);
        let of = |A: Tensor<Dual<f64, D>>| A.map(|row| row.map(|entry| entry.value));
        let at = Kinematics { F: of(F), rate: of(rate) };
        let constants: Vec<f64> = particle.all_constants(t).iter().map(|c| c.value).collect();
        let P = self.law.first_piola_kirchhoff(&at, &constants, &z);
        let mut internal = self.law.observables(&constants, &z);
        turn_tensors(&self.tensors, &particle.frame, &mut internal);
        Ok(Stressed { P: turn_tensor(&particle.frame, |k| P[k / D][k % D]), internal })
    }

    /// Whether particles begin to flow, or stop, after the start and before a time, as some of them show.
    fn has_front(&self, end: f64) -> Result<bool, HistoryError> {
        const PLACES: u32 = 24;
        if !matches!(self.law, AnyLaw::Flow(_)) {
            return Ok(false);
        }
        let range = std::array::from_fn(|axis| self.chart.range(axis));
        let changes = |n: u32| {
            let q = place(&range, n);
            let particle = self.particle(self.chart.place(q));
            let found = Trajectory::<D>::new(&self.law, &particle, &[end], self.tolerance())?;
            Ok::<_, HistoryError>(!found.changes.is_empty())
        };
        let all: Vec<_> = (0..PLACES).into_par_iter().map(changes).collect();
        all.into_iter().try_fold(false, |any, one| Ok(any || one?))
    }

    /// How the histories of some particles go until a time.
    pub(crate) fn report(
        &self,
        places: &[[f64; D]],
        end: f64,
    ) -> Result<HistoryReport, HistoryError> {
        let times: Vec<f64> = (1..=32).map(|k| end * f64::from(k) / 32.0).collect();
        let follow = |X: &[f64; D]| {
            let particle = self.particle(*X);
            Trajectory::<D>::new(&self.law, &particle, &times, self.tolerance())
        };
        let all: Vec<_> = places.par_iter().map(follow).collect();
        let tables = self.tables_until(end)?;
        let mut report = HistoryReport {
            table_error: if tables.table.is_some() { tables.error } else { f64::NAN },
            least_margin: f64::INFINITY,
            flows: matches!(self.law, AnyLaw::Flow(_)),
            particles: places.len(),
            always: 0,
            onsets: 0,
            unloadings: 0,
            smoothness: Smoothness::Smooth,
            yield_condition: 0.0,
            volume: 0.0,
        };
        for trajectory in all {
            let trajectory = trajectory?;
            let begins = |branch| trajectory.changes.iter().any(|change| change.branch == branch);
            let flows = trajectory.least_margin.is_finite();
            report.least_margin = report.least_margin.min(trajectory.least_margin);
            report.always += usize::from(flows && trajectory.changes.is_empty());
            report.onsets += usize::from(begins(mmsmith_history::Branch::Flowing));
            report.unloadings += usize::from(begins(mmsmith_history::Branch::Elastic));
            report.smoothness = report.smoothness.min(trajectory.smoothness());
            report.yield_condition =
                report.yield_condition.max(trajectory.residuals.yield_condition);
            report.volume = report.volume.max(trajectory.residuals.volume);
        }
        Ok(report)
    }

    /// Tables of all fields until a time, made where there are none yet.
    pub(crate) fn tables_until(&self, end: f64) -> Result<Arc<Tables<D>>, HistoryError> {
        let known = || self.tables.read().ok().and_then(|tables| tables.clone());
        if let Some(tables) = known().filter(|tables| tables.end >= end) {
            return Ok(tables);
        }
        let tables = Arc::new(Tables::new(self, end, TABLE_TOLERANCE)?);
        if let Ok(mut own) = self.tables.write() {
            *own = Some(Arc::clone(&tables));
        }
        Ok(tables)
    }

    /// The tables that there are.
    pub(crate) fn tables(&self) -> Option<Arc<Tables<D>>> {
        self.tables.read().ok().and_then(|tables| tables.clone())
    }
}

/// The Cartesian components of a vector from those in a frame.
#[inline]
fn turn_vector<const D: usize>(Q: &[[f64; D]; D], own: impl Fn(usize) -> f64) -> [f64; D] {
    std::array::from_fn(|i| (0..D).map(|a| Q[i][a] * own(a)).sum())
}

/// The Cartesian components of a tensor from those in a frame, row by row.
#[inline]
fn turn_tensor<const D: usize>(Q: &[[f64; D]; D], own: impl Fn(usize) -> f64) -> [[f64; D]; D] {
    let entry = |i: usize, j: usize| (0..D * D).map(|k| Q[i][k / D] * own(k) * Q[j][k % D]).sum();
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

/// The places of the first entries of symmetric tensors among internal variables: six names with the indices 11, 22, 33, 12, 13, 23.
pub(crate) fn first_entries(names: &[String]) -> Vec<usize> {
    let is_tensor = |names: &[String]| {
        let stem = names[0].strip_suffix("11");
        let stems = names
            .iter()
            .zip(ENTRIES)
            .map(|(name, (i, j))| name.strip_suffix(format!("{}{}", i + 1, j + 1).as_str()));
        stem.is_some() && stems.into_iter().all(|own| own == stem)
    };
    let firsts = names.windows(ENTRIES.len()).enumerate();
    firsts.filter(|(_, names)| is_tensor(names)).map(|(first, _)| first).collect()
}

/// Unit vectors of a frame with those of the axes that it leaves out.
fn in_space<const D: usize>(frame: &[[f64; D]; D]) -> Tensor<f64> {
    std::array::from_fn(|i| {
        std::array::from_fn(|a| match i < D && a < D {
            true => frame[i][a],
            false => f64::from(u8::from(i == a)),
        })
    })
}

fn is_identity<const D: usize>(Q: &[[f64; D]; D]) -> bool {
    (0..D).all(|i| (0..D).all(|a| Q[i][a] == f64::from(u8::from(i == a))))
}

/// Turns the symmetric tensors among internal variables, whose first entries are known, from a frame to Cartesian axes.
fn turn_tensors<const D: usize>(firsts: &[usize], Q: &[[f64; D]; D], values: &mut [f64]) {
    if is_identity(Q) {
        return;
    }
    let rotation = in_space(Q);
    for own in firsts.iter().map(|first| *first..first + ENTRIES.len()) {
        let own = &mut values[own];
        let in_frame: Tensor<f64> = of_entries(own);
        let in_space = turn_tensor(&rotation, |k| in_frame[k / 3][k % 3]);
        for (value, (i, j)) in own.iter_mut().zip(ENTRIES) {
            *value = in_space[i][j];
        }
    }
}

/// The symmetric tensor of six entries.
fn of_entries(entries: &[f64]) -> Tensor<f64> {
    let mut all = [[0.0; 3]; 3];
    for (&entry, (i, j)) in entries.iter().zip(ENTRIES) {
        (all[i][j], all[j][i]) = (entry, entry);
    }
    all
}

/// Fields of a body in the frames of its particles, as tables over the coordinates that they depend on.
pub(crate) struct Tables<const D: usize> {
    /// None where particles begin or stop to flow on the way: no polynomial follows such a front well, and each particle has series of its
    /// own.
    pub(crate) table: Option<OverAxes>,
    pub(crate) end: f64,
    /// The largest error that random places and times showed, as a share of each quantity's largest value; not a number without a table.
    pub(crate) error: f64,
}

/// A table over as many coordinates as fields depend on.
pub(crate) enum OverAxes {
    One(Table<1>),
    Two(Table<2>),
    Three(Table<3>),
}

impl<const D: usize> Tables<D> {
    /// Tables until a time that leave out no more than a share of each quantity's largest value.
    pub(crate) fn new(
        histories: &Histories<D>,
        end: f64,
        tolerance: f64,
    ) -> Result<Self, HistoryError> {
        if histories.has_front(end)? {
            return Ok(Self { table: None, end, error: f64::NAN });
        }
        match histories.axes.len() {
            1 => Self::over::<1>(histories, [end, tolerance], OverAxes::One),
            2 => Self::over::<2>(histories, [end, tolerance], OverAxes::Two),
            _ => Self::over::<3>(histories, [end, tolerance], OverAxes::Three),
        }
    }

    fn over<const K: usize>(
        histories: &Histories<D>,
        [end, tolerance]: [f64; 2],
        any: impl Fn(Table<K>) -> OverAxes,
    ) -> Result<Self, HistoryError> {
        let Histories { chart, axes, .. } = histories;
        let range = std::array::from_fn(|k| chart.range(axes[k]));
        let of = |own: [f64; K], times: &[f64]| {
            // Nothing depends on the other coordinates.
            let mut q = std::array::from_fn(|axis| {
                let [low, high] = chart.range(axis);
                low + 0.37 * (high - low)
            });
            axes.iter().zip(own).for_each(|(&axis, own)| q[axis] = own);
            histories.in_frame(&histories.particle(chart.place(q)), times)
        };
        let kinds = histories.kinds();
        let (table, error) = Table::<K>::fine_by_kinds(range, end, tolerance, &kinds, of)?;
        Ok(Self { table: (error <= LARGEST_ERROR).then(|| any(table)), end, error })
    }

    /// The series of some fields at places.
    fn at_all(
        &self,
        histories: &Histories<D>,
        X: &[[f64; D]],
        fields: &Range<usize>,
    ) -> Vec<AtPoint> {
        let q: Vec<[f64; D]> = X.iter().map(|X| histories.chart.coordinates(X)).collect();
        fn own<const K: usize, const D: usize>(axes: &[usize], q: &[[f64; D]]) -> Vec<[f64; K]> {
            q.iter().map(|q| std::array::from_fn(|k| q[axes[k]])).collect()
        }
        let axes = &histories.axes;
        match &self.table {
            None => Vec::new(),
            Some(OverAxes::One(table)) => table.at_all_of(&own(axes, &q), fields.clone()),
            Some(OverAxes::Two(table)) => table.at_all_of(&own(axes, &q), fields.clone()),
            Some(OverAxes::Three(table)) => table.at_all_of(&own(axes, &q), fields.clone()),
        }
    }

    /// How series of some quantities are packed, whose kinds are known.
    fn packing(&self, kinds: &[usize], quantities: &Range<usize>) -> Option<Packing> {
        Some(match self.table.as_ref()? {
            OverAxes::One(table) => Packing::new(table, self.error, kinds, quantities),
            OverAxes::Two(table) => Packing::new(table, self.error, kinds, quantities),
            OverAxes::Three(table) => Packing::new(table, self.error, kinds, quantities),
        })
    }

    /// Where a time is among the pieces of the table.
    fn at_time(&self, t: f64) -> AtTime {
        match &self.table {
            None => AtTime { piece: 0, x: 0.0 },
            Some(OverAxes::One(table)) => table.grid().at_time(t),
            Some(OverAxes::Two(table)) => table.grid().at_time(t),
            Some(OverAxes::Three(table)) => table.grid().at_time(t),
        }
    }
}
