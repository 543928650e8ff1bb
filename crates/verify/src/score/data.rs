//! The fields of one frame and their errors.

use mmsmith_measure::norms::PerNorm;
use mmsmith_measure::{RUNS, Row, over_particles};
use mmsmith_runtime::{BLOCK, Solution, State, StateRun};
use nalgebra::{Matrix3, SMatrix, SVector};

use crate::across::Across;
use crate::inverse::determinant;
use crate::precision::Precision;

use super::across::{Directions, off};

/// Data of one frame for the comparison.
pub(super) struct FrameData<const D: usize> {
    pub(super) ids: Option<Vec<i64>>,
    pub(super) X: Vec<SVector<f64, D>>,
    pub(super) u: Vec<SVector<f64, D>>,
    /// With the time to which they belong.
    pub(super) v: Option<(Vec<SVector<f64, D>>, f64)>,
    /// F, P, Cauchy and Kirchhoff stress.
    pub(super) tensors: [Option<Vec<SMatrix<f64, D, D>>>; 4],
    /// Tensors in space, the solution's directions first, where arrays have components across its plane or line.
    pub(super) whole: [Option<Vec<Matrix3<f64>>>; 4],
    /// J and density.
    pub(super) scalars: [Option<Vec<f64>>; 2],
}

/// The error norms of a frame.
pub(super) struct FrameErrors {
    /// In the order of [`Quantity::ALL`]; zero for what the frame lacks.
    pub(super) errors: [PerNorm<f64>; 8],
    /// Errors of F and P if they were transposed.
    pub(super) transposed: [PerNorm<f64>; 2],
    /// Errors of the tensors across the solution's plane or line.
    pub(super) across: [PerNorm<f64>; 4],
    /// The difference of the given density from that at rest.
    pub(super) density_from_rest: PerNorm<f64>,
    /// The norms of the exact displacement.
    pub(super) displacement: PerNorm<f64>,
}

impl<const D: usize> FrameData<D> {
    /// Which fields the frame has, in the order of [`Quantity::ALL`].
    pub(super) fn fields(&self) -> [bool; 8] {
        let [F, P, cauchy, kirchhoff] = self.tensors.each_ref().map(Option::is_some);
        let [J, density] = self.scalars.each_ref().map(Option::is_some);
        [true, self.v.is_some(), F, P, cauchy, kirchhoff, J, density]
    }

    /// The particles for which `kept` is true.
    pub(super) fn only(self, kept: &[bool]) -> Self {
        fn some<T>(all: Vec<T>, kept: &[bool]) -> Vec<T> {
            all.into_iter().zip(kept).filter(|(_, kept)| **kept).map(|(one, _)| one).collect()
        }
        Self {
            ids: self.ids.map(|ids| some(ids, kept)),
            X: some(self.X, kept),
            u: some(self.u, kept),
            v: self.v.map(|(v, time)| (some(v, kept), time)),
            tensors: self.tensors.map(|tensor| tensor.map(|all| some(all, kept))),
            whole: self.whole.map(|whole| whole.map(|all| some(all, kept))),
            scalars: self.scalars.map(|scalar| scalar.map(|all| some(all, kept))),
        }
    }

    /// The error norms of the frame.
    pub(super) fn errors(
        &self,
        exact: &dyn Solution<f64, D>,
        directions: &Directions<D>,
        time: f64,
    ) -> FrameErrors
    where
        f64: Precision<D>,
    {
        let magnitude = self.magnitudes(exact, directions, time);
        let velocity_time = self.velocity_time(time);
        let room = || [StateRun::zero(); RUNS];
        let magnitudes = |runs: &mut [_; RUNS], first: usize, magnitudes: &mut [[Row<f64>; 16]]| {
            let runs = &mut runs[..magnitudes.len()];
            let count = (runs.len() * BLOCK).min(self.X.len() - first);
            // Other frames may have their particles in another order, or others: nothing is worth keeping.
            let X = &self.X[first..first + count];
            exact.state_at(X).evaluate(time, velocity_time, 0, runs);
            for n in 0..count {
                let own = magnitude(first + n, &runs[n / BLOCK].get(n % BLOCK));
                for (row, magnitude) in magnitudes[n / BLOCK].iter_mut().zip(own) {
                    row[n % BLOCK] = magnitude;
                }
            }
        };
        let [
            u,
            v,
            F,
            P,
            cauchy,
            kirchhoff,
            J,
            of_density,
            F_turned,
            P_turned,
            from_rest,
            size,
            across @ ..,
        ] = over_particles(self.X.len(), room, magnitudes);
        FrameErrors {
            errors: [u, v, F, P, cauchy, kirchhoff, J, of_density],
            transposed: [F_turned, P_turned],
            across,
            density_from_rest: from_rest,
            displacement: size,
        }
    }

    fn velocity_time(&self, time: f64) -> f64 {
        self.v.as_ref().map_or(time, |(_, time)| *time)
    }

    /// The errors of a particle from its exact state: of all fields, of F and P if transposed, of the density from that at rest, the size
    /// of the exact displacement, and the errors of tensors across.
    fn magnitudes<'a>(
        &'a self,
        exact: &'a dyn Solution<f64, D>,
        directions: &'a Directions<D>,
        time: f64,
    ) -> impl Fn(usize, &State<f64, D>) -> [f64; 16] + Sync + 'a
    where
        f64: Precision<D>,
    {
        let law = Across::<D>::of(exact.law());
        let has_whole = self.whole.iter().any(Option::is_some);
        let is_needed = has_whole || exact.is_half_plane();
        let of_frame = is_needed.then(|| directions.of_frame(exact, &self.X, time));
        let stretch = move |F: &SMatrix<f64, D, D>| {
            let stretch = law.as_ref().map_or(Some(1.0), |law| law.stretch(F));
            stretch.unwrap_or(f64::NAN)
        };
        move |p: usize, state: &State<f64, D>| {
            let v = self.v.as_ref().map_or(0.0, |(v, _)| (v[p] - state.v).norm());
            let density = exact.density_at(&self.X[p]);
            let at = (&self.X[p], &state.F, time);
            let beyond = of_frame.as_ref().map(|known| directions.at(known, p, exact, at));
            // Around an axis volumes change with the radius too.
            let around = beyond.filter(|_| exact.is_half_plane()).map_or(1.0, |[hoop, _]| hoop);
            let J = determinant(&state.F) * around;
            let across = match exact.is_half_plane() {
                true => 1.0,
                false => stretch(&state.F).powi(3 - D as i32),
            };
            let kirchhoff = state.P * state.F.transpose();
            let tensor = |n: usize, exact: SMatrix<f64, D, D>| {
                self.tensors[n].as_ref().map_or(0.0, |given| (given[p] - exact).norm())
            };
            let scalar = |n: usize, exact: f64| {
                self.scalars[n].as_ref().map_or(0.0, |given| (given[p] - exact).abs())
            };
            let [F_across, P_across] = beyond.unwrap_or([1.0, 0.0]);
            let tau_across = P_across * F_across;
            let whole = |n: usize, exact: f64| {
                self.whole[n].as_ref().map_or(0.0, |given| off::<D>(&given[p], exact))
            };
            [
                (self.u[p] - state.u).norm(),
                v,
                tensor(0, state.F),
                tensor(1, state.P),
                tensor(2, kirchhoff / (J * across)),
                tensor(3, kirchhoff),
                scalar(0, J),
                scalar(1, density / (J * across)),
                tensor(0, state.F.transpose()),
                tensor(1, state.P.transpose()),
                scalar(1, density),
                state.u.norm(),
                whole(0, F_across),
                whole(1, P_across),
                whole(2, tau_across / (J * across)),
                whole(3, tau_across),
            ]
        }
    }

    /// The particle with the largest error of a field, with its error; none where no error is a number.
    pub(super) fn worst(
        &self,
        exact: &dyn Solution<f64, D>,
        directions: &Directions<D>,
        field: usize,
        time: f64,
    ) -> Option<(usize, f64)>
    where
        f64: Precision<D>,
    {
        let magnitude = self.magnitudes(exact, directions, time);
        let mut runs = vec![StateRun::zero(); self.X.len().div_ceil(BLOCK)];
        exact.state_at(&self.X).evaluate(time, self.velocity_time(time), 0, &mut runs);
        let of_particle = |p: usize| magnitude(p, &runs[p / BLOCK].get(p % BLOCK))[field];
        let all = (0..self.X.len()).map(|p| (p, of_particle(p)));
        all.filter(|(_, error)| error.is_finite()).max_by(|one, other| one.1.total_cmp(&other.1))
    }
}
