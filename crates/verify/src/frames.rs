//! Particle frames of a run for viewers.

use std::path::PathBuf;

use bytemuck::Pod;
use mmsmith_mpm::{Law, Particles};
use mmsmith_ranks::{Ranks, gather};
use mmsmith_runtime::{Real, Solution};
use mmsmith_vtk::{Array, Error, Frame, Provenance, Series, Values};
use nalgebra::{Matrix3, SMatrix, SVector};

use crate::inverse::inverse;
use crate::measurement::Held;
use crate::precision::Precision;

/// Where and how often particle files are written.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameOutput {
    /// The folder.
    pub folder: PathBuf,
    /// The name that the files begin with.
    pub name: String,
    /// How many frames, spread evenly over the steps; the first and the last state are always among them.
    pub count: u64,
    /// The solution that is run, for whoever reads the files later.
    pub provenance: Option<Provenance>,
}

/// The particles at one moment of a run, kept in memory.
#[derive(Debug, Default)]
pub struct Snapshot {
    /// The moment: a share of the time from the start, 0, to the end, 1. The step nearest to it is taken.
    pub share: f64,
    /// The particles, once the run has been there; none where it stopped before, or where a particle is inside out then. Of several
    /// processes the first one has them, in the order of their numbers.
    pub frame: Option<Frame>,
}

impl Snapshot {
    /// Keeps the state after a step, told with the number of all steps, if it is the one wanted; a call of all processes.
    pub(crate) fn take<T: Precision<D>, const D: usize>(
        &mut self,
        state: (&Particles<T, D>, &Law<T, D>),
        held: Option<Held<'_>>,
        exact: &dyn Solution<f64, D>,
        (step, steps): (u64, u64),
        time: f64,
    ) {
        if step != (self.share.clamp(0.0, 1.0) * steps as f64).round() as u64 {
            return;
        }
        let own = frame(state, exact, step, time);
        self.frame = match held {
            None => own,
            Some(held) => whole(held, own),
        };
    }
}

/// The frame of all processes, in the order of the particles' numbers, at the first one; a call of all.
fn whole(Held { ranks, ids }: Held<'_>, own: Option<Frame>) -> Option<Frame> {
    fn all<E: Pod>(ranks: &dyn Ranks, order: &[usize], values: &mut Vec<E>) {
        let found = gather(ranks, values);
        *values = order.iter().map(|&p| found[p]).collect();
    }
    let is_any_inside_out = ranks.largest(own.is_none().into()) > 0;
    let mut frame = own.filter(|_| !is_any_inside_out)?;
    let ids = gather(ranks, ids);
    let mut order: Vec<usize> = (0..ids.len()).collect();
    order.sort_unstable_by_key(|&p| ids[p]);
    all(ranks, &order, &mut frame.points);
    for Array { values, .. } in &mut frame.arrays {
        match values {
            Values::Scalar(values) => all(ranks, &order, values),
            Values::Vector(values) => all(ranks, &order, values),
            Values::Tensor(values) => all(ranks, &order, values),
            Values::Id(values) => *values = (0..ids.len() as u64).collect(),
        }
    }
    (ranks.rank() == 0).then_some(frame)
}

/// Writes one state alone, of a body at rest: without velocities.
pub(crate) fn write_at_rest<T: Precision<D>, const D: usize>(
    output: &FrameOutput,
    state: (&Particles<T, D>, &Law<T, D>),
    exact: &dyn Solution<f64, D>,
    time: f64,
) -> Result<(), Error> {
    let mut series = Series::create(&output.folder, &output.name)?;
    let Some(mut frame) = frame(state, exact, 0, time) else { return Ok(()) };
    frame.arrays.retain(|array| array.name != "velocity");
    series.write(&Frame { provenance: output.provenance.clone(), ..frame }).map(|_| ())
}

/// Writes the frames of one run. Frames tell the time of their velocities, but for the first state, whose velocity belongs to
/// no time of the scheme yet.
pub(crate) struct FrameWriter {
    series: Series,
    provenance: Option<Provenance>,
    count: u64,
    steps: u64,
    /// How far velocities lag behind positions.
    velocity_lag: f64,
    /// The number of the next frame.
    next: u64,
}

impl FrameWriter {
    /// `is_first` is said by the process that starts the series, where there are several.
    pub(crate) fn new(
        output: &FrameOutput,
        steps: u64,
        velocity_lag: f64,
        is_first: bool,
    ) -> Result<Self, Error> {
        let series = match is_first {
            true => Series::create(&output.folder, &output.name)?,
            false => Series::of_pieces(&output.folder, &output.name)?,
        };
        // More frames than states there are would repeat some.
        let count = output.count.clamp(2, steps + 1);
        let provenance = output.provenance.clone();
        Ok(Self { series, provenance, count, steps, velocity_lag, next: 0 })
    }

    /// Goes on after `step` of a run with steps of `dt`, whose earlier frames are on the disk.
    pub(crate) fn take_up(&mut self, step: u64, dt: f64) -> Result<(), Error> {
        let steps = (0..self.count).map(|frame| step_of_frame(frame, self.count, self.steps));
        let times: Vec<f64> = steps.take_while(|&s| s <= step).map(|s| s as f64 * dt).collect();
        self.next = times.len() as u64;
        self.series.take_up(&times)
    }

    /// Writes the state after `step` if it is one of those wanted: where several processes hold the particles, a piece each, and a
    /// file that joins the pieces.
    pub(crate) fn write<T: Precision<D>, const D: usize>(
        &mut self,
        state: (&Particles<T, D>, &Law<T, D>),
        held: Option<Held<'_>>,
        exact: &dyn Solution<f64, D>,
        (step, time): (u64, f64),
    ) -> Result<(), Error> {
        if step < step_of_frame(self.next, self.count, self.steps) {
            return Ok(());
        }
        self.next += 1;
        let velocity_time = (step > 0).then_some(time - self.velocity_lag);
        let provenance = self.provenance.clone();
        let frame = frame(state, exact, step, time);
        let frame = frame.map(|frame| Frame { velocity_time, provenance, ..frame });
        match held {
            None => frame.map_or(Ok(()), |frame| self.series.write(&frame).map(|_| ())),
            Some(held) => self.write_pieces(held, frame),
        }
    }

    fn write_pieces(
        &mut self,
        Held { ranks, ids }: Held<'_>,
        frame: Option<Frame>,
    ) -> Result<(), Error> {
        let is_any_inside_out = ranks.largest(frame.is_none().into()) > 0;
        let Some(mut frame) = frame.filter(|_| !is_any_inside_out) else { return Ok(()) };
        for Array { values, .. } in &mut frame.arrays {
            if let Values::Id(values) = values {
                *values = ids.to_vec();
            }
        }
        let is_empty = frame.points.is_empty();
        if !is_empty {
            // Whoever fails here ends all processes.
            self.series.write_piece(self.next as usize - 1, &frame, ranks.rank())?;
        }
        // A piece is listed once it is whole.
        let written = gather(ranks, &[u64::from(!is_empty)]);
        if ranks.rank() == 0 {
            let pieces: Vec<usize> = (0..ranks.count()).filter(|&rank| written[rank] > 0).collect();
            self.series.join(&frame, &pieces)?;
        }
        Ok(())
    }
}

/// The step at which frame `index` of `count` is written.
pub(crate) fn step_of_frame(index: u64, count: u64, steps: u64) -> u64 {
    // In 128 bits, since a long run's steps times frames may not fit into 64.
    let (index, last, steps) = (u128::from(index), u128::from(count - 1), u128::from(steps));
    ((2 * index * steps + last) / (2 * last)) as u64
}

/// The particles with what the solver holds and what is exact.
///
/// The velocity is the stored one, which centred differences hold half a step earlier. `stress` is Cauchy's. Both stresses are from the
/// solver's law, with the component normal to the plane in two dimensions. `None` if a particle has no stress because it
/// is inside out: no viewer reads numbers that are none.
fn frame<T: Precision<D>, const D: usize>(
    (particles, law): (&Particles<T, D>, &Law<T, D>),
    exact: &dyn Solution<f64, D>,
    step: u64,
    time: f64,
) -> Option<Frame> {
    let count = particles.len();
    let mut points = Vec::with_capacity(count);
    let mut displacement = Vec::with_capacity(count);
    let mut velocity = Vec::with_capacity(count);
    let mut gradient = Vec::with_capacity(count);
    let mut stress = Vec::with_capacity(count);
    let mut first_piola_kirchhoff = Vec::with_capacity(count);
    let mut von_mises = Vec::with_capacity(count);
    let mut reference_position = Vec::with_capacity(count);
    let mut exact_displacement = Vec::with_capacity(count);
    let mut error = Vec::with_capacity(count);
    let mut error_magnitude = Vec::with_capacity(count);
    let mut volume = Vec::with_capacity(count);
    let variables = law.variables();
    for p in 0..count {
        let X = particles.X[p].map(Real::to_f64);
        let x = particles.x[p].map(Real::to_f64);
        let F = particles.F[p].map(Real::to_f64);
        // As its internal variables are.
        let q = &particles.internal[p * variables.len()..(p + 1) * variables.len()];
        let law = &law.with_variables(q);
        let u = exact.displacement(&X, time);
        let delta = (x - X) - u;
        points.push(padded(&x));
        displacement.push(padded(&(x - X)));
        velocity.push(padded(&particles.v[p].map(Real::to_f64)));
        let mut F_3D = in_space(&F);
        let across = law.stretch_across(&particles.F[p]).to_f64();
        (D..3).for_each(|axis| F_3D[(axis, axis)] = across);
        gradient.push(by_rows(&F_3D));
        stress.push(by_rows(&law.cauchy_in_space(&particles.F[p])?.map(Real::to_f64)));
        let mut P = law.kirchhoff_in_space(&particles.F[p])?.map(Real::to_f64)
            * inverse(&F_3D)?.transpose();
        // As errors are measured; only the rest is taken from three dimensions.
        let in_plane = law.first_piola_kirchhoff(&particles.F[p])?.map(Real::to_f64);
        P.fixed_view_mut::<D, D>(0, 0).copy_from(&in_plane);
        first_piola_kirchhoff.push(by_rows(&P));
        reference_position.push(padded(&X));
        von_mises.push(law.von_mises(&particles.F[p])?.to_f64());
        exact_displacement.push(padded(&u));
        error.push(padded(&delta));
        error_magnitude.push(delta.norm());
        volume.push(F_3D.determinant() * particles.volume[p].to_f64());
    }
    let array = |name: &str, values| Array { name: name.into(), values };
    let is_written = |name: &str| !name.starts_with('(');
    let written = variables.iter().enumerate().filter(|(_, own)| is_written(&own.name));
    let internal = written.map(|(k, variable)| {
        let of_particles = particles.internal.iter().skip(k).step_by(variables.len());
        array(&variable.name, Values::Scalar(of_particles.map(|q| q.to_f64()).collect()))
    });
    let arrays = vec![
        array("displacement", Values::Vector(displacement)),
        array("velocity", Values::Vector(velocity)),
        array("deformation_gradient", Values::Tensor(gradient)),
        array("stress", Values::Tensor(stress)),
        array("first_piola_kirchhoff", Values::Tensor(first_piola_kirchhoff)),
        array("von_mises", Values::Scalar(von_mises)),
        array("exact_displacement", Values::Vector(exact_displacement)),
        array("error", Values::Vector(error)),
        array("error_magnitude", Values::Scalar(error_magnitude)),
        array("volume", Values::Scalar(volume)),
        array("reference_position", Values::Vector(reference_position)),
        array("id", Values::Id((0..count as u64).collect())),
    ];
    Some(Frame {
        time,
        step,
        velocity_time: None,
        provenance: None,
        points,
        arrays: arrays.into_iter().chain(internal).collect(),
    })
}

/// Three components, those that do not exist zero.
fn padded<const D: usize>(vector: &SVector<f64, D>) -> [f64; 3] {
    std::array::from_fn(|i| if i < D { vector[i] } else { 0.0 })
}

/// The deformation gradient in space: what does not exist in the plane is not stretched.
fn in_space<const D: usize>(F: &SMatrix<f64, D, D>) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| match (i, j) {
        _ if i < D && j < D => F[(i, j)],
        _ if i == j => 1.0,
        _ => 0.0,
    })
}

/// Nine components row by row.
fn by_rows(tensor: &Matrix3<f64>) -> [f64; 9] {
    std::array::from_fn(|k| tensor[(k / 3, k % 3)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{matrix, vector};

    #[test]
    fn frames_are_spread_evenly_with_first_and_last() {
        let steps = |count, total| -> Vec<u64> {
            (0..count).map(|index| step_of_frame(index, count, total)).collect()
        };
        assert_eq!(steps(5, 80), [0, 20, 40, 60, 80]);
        assert_eq!(steps(2, 7), [0, 7]);
        assert_eq!(steps(4, 3), [0, 1, 2, 3]);
        assert_eq!(step_of_frame(19, 20, u64::MAX), u64::MAX);
    }

    #[test]
    fn plane_quantities_are_padded_row_by_row() {
        let F = in_space(&matrix![1.0, 2.0; 3.0, 4.0]);
        assert_eq!(by_rows(&F), [1.0, 2.0, 0.0, 3.0, 4.0, 0.0, 0.0, 0.0, 1.0]);
        assert_eq!(padded(&vector![1.0, 2.0]), [1.0, 2.0, 0.0]);
    }
}
