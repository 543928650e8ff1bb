//! Small disturbances of a given motion: the balance of momentum, linearised about it.
//!
//! Two motions of a body under one dead load differ by a field `w`. While that is small it obeys
//!
//! ```text
//! rho0 w'' = Div(A : grad w),  A = dP/dF at the deformation gradient F(X, t) of the given motion
//! ```
//!
//! with `w = 0` on sides whose motion is given, and no traction on sides whose traction is given. The discretisation is that of
//! [`TotalLagrangian`](super::TotalLagrangian) with consistent mass and leapfrog. `A : grad w` is a difference of the law's own stress along
//! `grad w`, of second order with a strain of 1e-5 at most: good to nine digits of the moduli, and for any law.
//!
//! Kick, drift and kick are the transposes of each other, so that the steps backwards are the adjoint of the steps forwards to rounding: what
//! grows most is found by powers of one after the other.
//!
//! Source: Ogden, "Non-Linear Elastic Deformations" (1984), section 6.2 (small deformations superposed on finite ones).

use std::array;

use mmsmith_laws::{BLOCK, Law, Stressed};
use mmsmith_particles::SetupError;
use nalgebra::{SMatrix, SVector};

use super::boundary::Face;
use super::component::{Component, Factors, Field, Operators, each_component, solve};
use super::composition::Composition;
use super::fit::Line;
use super::quadrature::Quadrature;
use super::set_up::{Grid, MassMatrix, Scheme, bases, check, faces, fits, line, masses};

/// The largest strain of the difference that stands for the tangent.
const STRAIN: f64 = 1e-5;

/// A disturbance of a motion, and its velocity.
pub trait Disturbed<const D: usize> {
    /// Reference positions of the quadrature points, Cartesian.
    fn positions(&self) -> &[SVector<f64, D>];

    /// Starts without displacement, from the velocity nearest to that given at the [positions](Self::positions), Cartesian, in the mean of
    /// squares.
    fn start(&mut self, velocity: &[SVector<f64, D>]);

    /// Starts anew without displacement, from a velocity that is the displacement now times `factor`.
    fn start_from_displacement(&mut self, factor: f64);

    /// The largest angular frequency of waves on the grid about a motion with deformation gradients `F`, by so many powers of the operator, from
    /// the displacement that an earlier call has left: leapfrog is stable with steps of up to two over it. It is found from below.
    fn largest_frequency(&mut self, F: &[SMatrix<f64, D, D>], powers: usize) -> f64;

    /// Follows the disturbance over steps of equal length, `F` writing the deformation gradients of the motion at the
    /// [positions](Self::positions) at the end of a step, of step 0 those before the first one; `seen` is called after each step and says whether to go on.
    fn advance(
        &mut self,
        time_step: f64,
        steps: usize,
        F: &mut dyn FnMut(usize, &mut Vec<SMatrix<f64, D, D>>),
        seen: &mut dyn FnMut(usize, &mut dyn Disturbed<D>) -> bool,
    );

    /// How large the displacement is.
    fn displacement(&mut self) -> Magnitude;

    /// How large the velocity is.
    fn velocity(&mut self) -> Magnitude;
}

/// Not generic, so that it is compiled with this crate.
macro_rules! disturbed {
    ($($D:literal)*) => {
        $(
            impl Grid<$D> {
                /// No disturbance, of a body on this grid with the law and the reference density, by splines of a degree.
                ///
                /// Internal variables of a law stay what they are at time zero: where they follow the motion, the result has no meaning.
                ///
                /// # Errors
                ///
                /// As [`TotalLagrangian::new`](super::TotalLagrangian::new).
                pub fn undisturbed(
                    &self,
                    degree: usize,
                    law: Law<f64, $D>,
                    density: f64,
                ) -> Result<Box<dyn Disturbed<$D>>, SetupError> {
                    Ok(Box::new(Disturbance::<$D>::new(self, degree, law, density)?))
                }
            }

            impl Disturbed<$D> for Disturbance<$D> {
                fn positions(&self) -> &[SVector<f64, $D>] {
                    &self.at.X
                }

                fn start(&mut self, velocity: &[SVector<f64, $D>]) {
                    self.fit(velocity);
                }

                fn start_from_displacement(&mut self, factor: f64) {
                    for Component { u, v, .. } in &mut self.components {
                        v.iter_mut().zip(&*u).for_each(|(v, u)| *v = factor * u);
                        u.fill(0.0);
                    }
                }

                fn largest_frequency(
                    &mut self,
                    F: &[SMatrix<f64, $D, $D>],
                    powers: usize,
                ) -> f64 {
                    (0..powers).map(|_| self.power(F)).fold(0.0, f64::max).sqrt()
                }

                fn advance(
                    &mut self,
                    time_step: f64,
                    steps: usize,
                    F: &mut dyn FnMut(usize, &mut Vec<SMatrix<f64, $D, $D>>),
                    seen: &mut dyn FnMut(usize, &mut dyn Disturbed<$D>) -> bool,
                ) {
                    let mut now = vec![SMatrix::identity(); self.at.X.len()];
                    F(0, &mut now);
                    self.accelerate(&now);
                    for step in 1..=steps {
                        self.kick_and_drift(time_step);
                        F(step, &mut now);
                        self.accelerate(&now);
                        self.kick(time_step);
                        if !seen(step, self) {
                            break;
                        }
                    }
                }

                fn displacement(&mut self) -> Magnitude {
                    self.magnitude(Field::Displacement)
                }

                fn velocity(&mut self) -> Magnitude {
                    self.magnitude(Field::Velocity)
                }
            }
        )*
    };
}

disturbed! { 1 2 3 }

/// A disturbance on a grid.
#[derive(Clone, Debug)]
struct Disturbance<const D: usize> {
    operators: Operators<D>,
    components: [Component<D>; D],
    /// Sides whose motion is given.
    held: Vec<Face<D>>,
    at: Quadrature<D>,
}

/// How large a field is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Magnitude {
    /// The largest magnitude at the quadrature points.
    pub largest: f64,
    /// The root of the mean square over the volume.
    pub mean: f64,
}

impl<const D: usize> Disturbance<D>
where
    f64: Stressed<D>,
{
    fn new(
        grid: &Grid<D>,
        degree: usize,
        law: Law<f64, D>,
        density: f64,
    ) -> Result<Self, SetupError> {
        const { assert!(1 <= D && D <= 3, "one, two or three dimensions") };
        let (mass, composition) = (MassMatrix::Consistent, Composition::Order2);
        let scheme = Scheme { degree, mass, composition };
        check(grid, &scheme, density, 1.0)?;
        let lines: [Line; D] = array::from_fn(|k| line(grid, k));
        let singular = |axis: usize| SetupError::SingularMass { axis, per_cell: grid.per_cell };
        let bases = bases(grid, degree, &lines)?;
        let mass = masses(grid, &scheme, &bases, &lines, density)?;
        let fits = Ok(fits(grid, &bases, &lines).map_err(singular)?);
        Ok(Self {
            held: faces(grid, &lines).into_iter().filter(|face| face.moved).collect(),
            components: array::from_fn(|index| Component::new(index, &bases)),
            operators: Operators { bases, mass, fits },
            at: Quadrature::new(grid, &lines, law),
        })
    }

    /// See [`Disturbed::start`].
    fn fit(&mut self, velocity: &[SVector<f64, D>]) {
        for (p, value) in velocity.iter().enumerate() {
            let value = self.at.in_frame(p, value);
            for component in &mut self.components {
                component.values[p] = value[component.index] * self.at.volume[p];
            }
        }
        let Self { operators: Operators { bases, fits, .. }, held, components, .. } = self;
        let Ok(fits) = fits else { return };
        for component in components {
            let index = component.index;
            let functions = component.functions(bases);
            let mut v = vec![0.0; component.v.len()];
            component.integrate(bases, Factors::Values, &mut v);
            solve(&functions, |k| &fits[k][index].mass, &mut v);
            for face in held.iter().filter(|face| face.moves(index)) {
                face.copy(&functions, &component.given, &mut v);
            }
            component.v = v;
            component.u.fill(0.0);
        }
    }

    /// Replaces the displacement by its acceleration, scaled to one; how much larger that was.
    fn power(&mut self, F: &[SMatrix<f64, D, D>]) -> f64 {
        let all = |of: fn(&Component<D>) -> &Vec<f64>, components: &[Component<D>; D]| -> f64 {
            components.iter().flat_map(of).map(|x| x * x).sum::<f64>().sqrt()
        };
        if all(|of| &of.u, &self.components) == 0.0 {
            // A part of every wave.
            let mut state = 1_u32;
            for u in self.components.iter_mut().flat_map(|of| &mut of.u) {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                *u = f64::from(state) / f64::from(u32::MAX) - 0.5;
            }
        }
        let before = all(|of| &of.u, &self.components);
        self.accelerate(F);
        let after = all(|of| &of.a, &self.components);
        for Component { u, a, .. } in &mut self.components {
            u.iter_mut().zip(&*a).for_each(|(u, a)| *u = a / after);
        }
        after / before
    }

    fn kick_and_drift(&mut self, time_step: f64) {
        for component in &mut self.components {
            component.kick(0.5 * time_step);
            component.drift(time_step);
        }
    }

    fn kick(&mut self, time_step: f64) {
        self.components.iter_mut().for_each(|component| component.kick(0.5 * time_step));
    }

    fn magnitude(&mut self, field: Field) -> Magnitude {
        let Self { components, operators, at: Quadrature { volume, .. }, .. } = self;
        each_component(components, &|component| {
            component.evaluate(&operators.bases, field, true);
        });
        let (mut largest, mut sum, mut whole) = (0.0_f64, 0.0, 0.0);
        for (p, volume) in volume.iter().enumerate() {
            let square: f64 = components.iter().map(|c| c.values[p] * c.values[p]).sum();
            largest = if square.is_nan() { f64::NAN } else { largest.max(square) };
            sum += volume * square;
            whole += volume;
        }
        Magnitude { largest: largest.sqrt(), mean: (sum / whole).sqrt() }
    }

    /// The accelerations of the displacement, with the motion's deformation gradients.
    fn accelerate(&mut self, F: &[SMatrix<f64, D, D>]) {
        let curvilinear = self.at.coordinates.are_curvilinear();
        let Self { components, operators, .. } = self;
        each_component(components, &|component| {
            component.evaluate(&operators.bases, Field::Displacement, curvilinear);
        });
        let gradients = self.gradients();
        let changes = self.changes_of_stress(F, &gradients);
        self.at.set_forces(&mut self.components, &changes);
        let factors = if curvilinear { Factors::Both } else { Factors::Slopes };
        let Self { components, operators, held, .. } = self;
        let held = &held[..];
        each_component(components, &|component| {
            component.accelerate(operators, factors, held, None);
        });
    }

    /// Gradients of what stands at the points, Cartesian.
    fn gradients(&self) -> Vec<SMatrix<f64, D, D>> {
        let at = self.at.of(&self.components);
        (0..self.at.X.len()).map(|p| at.at(p)).collect()
    }

    /// `A : grad w` at the points.
    fn changes_of_stress(
        &self,
        F: &[SMatrix<f64, D, D>],
        gradients: &[SMatrix<f64, D, D>],
    ) -> Vec<SMatrix<f64, D, D>> {
        let largest = gradients.iter().fold(0.0_f64, |largest, H| largest.max(H.amax()));
        if largest == 0.0 {
            return vec![SMatrix::zeros(); F.len()];
        }
        let step = STRAIN / largest;
        let mut changes = Vec::with_capacity(F.len());
        for first in (0..F.len()).step_by(BLOCK) {
            let range = first..(first + BLOCK).min(F.len());
            let moved = |by: f64| -> Vec<SMatrix<f64, D, D>> {
                let both = F[range.clone()].iter().zip(&gradients[range.clone()]);
                both.map(|(F, H)| F + H * by).collect()
            };
            let above = self.at.stresses(first, &moved(step));
            let below = self.at.stresses(first, &moved(-step));
            changes.extend(above.iter().zip(&below).map(|(a, b)| (a - b) / (2.0 * step)));
        }
        changes
    }
}
