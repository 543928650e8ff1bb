//! An interpreted solution for solvers in single precision: evaluated in double, then rounded once.

use std::sync::{Arc, Mutex, PoisonError};

use mmsmith_runtime::nalgebra::{SMatrix, SVector};
use mmsmith_runtime::{
    BodyForceAtPoints, Boundary, Domain, Fields, Material, Real, Solution, StateAtPoints, StateRun,
    Surface,
};

/// The values of `exact` in single precision, each the nearest to that in double.
///
/// Positions, times and parameters that a single-precision solver hands in are exact in double. Generated code computes in
/// single precision from start to end instead, and has the rounding errors of that; both are right to what the solver's own
/// arithmetic can tell.
pub(crate) struct Rounded<S> {
    pub(crate) exact: S,
}

fn single(value: f64) -> f32 {
    f32::nearest(value)
}

fn double_vector<const D: usize>(v: &SVector<f32, D>) -> SVector<f64, D> {
    v.map(f64::from)
}

impl<const D: usize, S: Solution<f64, D>> Solution<f32, D> for Rounded<S> {
    fn displacement(&self, X: &SVector<f32, D>, t: f32) -> SVector<f32, D> {
        self.exact.displacement(&double_vector(X), t.into()).map(single)
    }

    fn velocity(&self, X: &SVector<f32, D>, t: f32) -> SVector<f32, D> {
        self.exact.velocity(&double_vector(X), t.into()).map(single)
    }

    fn acceleration(&self, X: &SVector<f32, D>, t: f32) -> SVector<f32, D> {
        self.exact.acceleration(&double_vector(X), t.into()).map(single)
    }

    fn displacement_gradient(&self, X: &SVector<f32, D>, t: f32) -> SMatrix<f32, D, D> {
        self.exact.displacement_gradient(&double_vector(X), t.into()).map(single)
    }

    fn deformation_gradient(&self, X: &SVector<f32, D>, t: f32) -> SMatrix<f32, D, D> {
        self.exact.deformation_gradient(&double_vector(X), t.into()).map(single)
    }

    fn jacobian(&self, X: &SVector<f32, D>, t: f32) -> f32 {
        single(self.exact.jacobian(&double_vector(X), t.into()))
    }

    fn first_piola_kirchhoff(&self, X: &SVector<f32, D>, t: f32) -> SMatrix<f32, D, D> {
        self.exact.first_piola_kirchhoff(&double_vector(X), t.into()).map(single)
    }

    fn body_force(&self, X: &SVector<f32, D>, t: f32) -> SVector<f32, D> {
        self.exact.body_force(&double_vector(X), t.into()).map(single)
    }

    fn body_force_at(&self, X: &[SVector<f32, D>]) -> Box<dyn BodyForceAtPoints<f32, D> + '_> {
        let X: Vec<_> = X.iter().map(double_vector).collect();
        Box::new(RoundedForce { exact: self.exact.body_force_at(&X), last: Mutex::default() })
    }

    fn state_at(&self, X: &[SVector<f32, D>]) -> Box<dyn StateAtPoints<f32, D> + '_> {
        let X: Vec<_> = X.iter().map(double_vector).collect();
        Box::new(RoundedState { exact: self.exact.state_at(&X) })
    }

    fn strain_energy(&self, X: &SVector<f32, D>, t: f32) -> Option<f32> {
        self.exact.strain_energy(&double_vector(X), t.into()).map(single)
    }

    fn traction(&self, surface: Surface, X: &SVector<f32, D>, t: f32) -> Option<SVector<f32, D>> {
        Some(self.exact.traction(surface, &double_vector(X), t.into())?.map(single))
    }

    fn fields(&self, X: &SVector<f32, D>, t: f32) -> Fields<f32, D> {
        let Fields { u, v, a, H, F, J, P, b } = self.exact.fields(&double_vector(X), t.into());
        Fields {
            u: u.map(single),
            v: v.map(single),
            a: a.map(single),
            H: H.map(single),
            F: F.map(single),
            J: single(J),
            P: P.map(single),
            b: b.map(single),
        }
    }

    fn domain(&self) -> Domain<f32, D> {
        self.exact.domain().map(single)
    }

    fn boundaries(&self) -> &[Boundary] {
        self.exact.boundaries()
    }

    fn cell_length(&self) -> f32 {
        single(self.exact.cell_length())
    }

    fn material(&self) -> Material<f32> {
        self.exact.material().map(single)
    }

    fn density(&self) -> f32 {
        single(self.exact.density())
    }

    fn wave_speed(&self) -> f32 {
        single(self.exact.wave_speed())
    }

    fn period(&self) -> f32 {
        single(self.exact.period())
    }
}

/// The body force at points that stay.
struct RoundedForce<'a, const D: usize> {
    exact: Box<dyn BodyForceAtPoints<f64, D> + 'a>,
    /// The last time, and what the points need of it: values that single precision does not hold, so that the solver, which
    /// passes them on, is given the time alone.
    last: Mutex<Option<(f32, Arc<[f64]>)>>,
}

impl<const D: usize> RoundedForce<'_, D> {
    fn values_of(&self, t: f32) -> Arc<[f64]> {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        match &*last {
            Some((time, values)) if time.to_bits() == t.to_bits() => values.clone(),
            _ => {
                let mut values = Vec::new();
                self.exact.of_time(t.into(), &mut values);
                let values: Arc<[f64]> = values.into();
                *last = Some((t, values.clone()));
                values
            }
        }
    }
}

impl<const D: usize> BodyForceAtPoints<f32, D> for RoundedForce<'_, D> {
    fn evaluate(&self, t: f32, first: usize, b: &mut [SVector<f32, D>]) {
        let mut exact = vec![SVector::zeros(); b.len()];
        self.exact.evaluate(t.into(), first, &mut exact);
        b.iter_mut().zip(exact).for_each(|(b, exact)| *b = exact.map(single));
    }

    fn of_time(&self, t: f32, values: &mut Vec<f32>) {
        values.push(t);
    }

    fn evaluate_of(&self, time: &[f32], points: &[u32], b: &mut [SVector<f32, D>]) {
        let &[t] = time else { panic!("one value of the time is needed, not {}", time.len()) };
        let mut exact = vec![SVector::zeros(); b.len()];
        self.exact.evaluate_of(&self.values_of(t), points, &mut exact);
        b.iter_mut().zip(exact).for_each(|(b, exact)| *b = exact.map(single));
    }

    fn len(&self) -> usize {
        self.exact.len()
    }

    fn bytes_per_point(&self) -> usize {
        self.exact.bytes_per_point()
    }
}

/// What a simulation is compared with.
struct RoundedState<'a, const D: usize> {
    exact: Box<dyn StateAtPoints<f64, D> + 'a>,
}

impl<const D: usize> StateAtPoints<f32, D> for RoundedState<'_, D> {
    fn evaluate(&self, t: f32, velocity_time: f32, first: usize, runs: &mut [StateRun<f32, D>]) {
        let mut exact = vec![StateRun::zero(); runs.len()];
        self.exact.evaluate(t.into(), velocity_time.into(), first, &mut exact);
        for (run, exact) in runs.iter_mut().zip(exact) {
            *run = exact.map(single);
        }
    }

    fn bytes_per_point(&self) -> usize {
        self.exact.bytes_per_point()
    }
}
