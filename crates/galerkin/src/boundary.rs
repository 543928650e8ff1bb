//! Boundary data on the sides of a body: prescribed motion or traction.
//!
//! What is given may differ from component to component of the grid's coordinates: all of what follows holds for each component by itself.
//!
//! # Sides whose motion is given
//!
//! Splines are clamped there, so that the functions of one side alone do not vanish on it, and their coefficients are the
//! motion of the side. They follow the given displacement, velocity and acceleration; the others, with index I beside B
//! for the given ones, obey what is left of the balance of momentum,
//!
//! ```text
//! M_II a_I = f_I - M_IB a_B
//! ```
//!
//! Coefficients are numbered along each axis, and which of them are given is decided along each axis, so that `M_II` is the
//! Kronecker product of the matrices of the axes without their given rows and columns, and is solved axis after axis as
//! before. `M_IB a_B` is the whole product, applied to coefficients that are zero but for the given ones.
//!
//! Along one axis, let `Q` take the values of a function at the particles and at the ends to coefficients: at ends whose motion
//! is given the value itself, and the others by least squares given those, `c_I = M_II^-1 (N_I^T W s - M_IB c_B)`. On a side,
//! the coefficients are the product of the `Q` of all other axes, applied to the motion at the products of their points. Two
//! sides with a common edge so give the same coefficients on it. The product of all `Q`, multiplied out, is also the least
//! squares fit in the whole body given its sides, by which a simulation starts.
//!
//! `Q` does not depend on time, so that the coefficients of the acceleration are the second derivatives of those of the
//! displacement, and for the coefficients that are integrated both are a force that depends on time. Within a step the
//! coefficients on the sides are integrated from their accelerations as all others are, and are set to the given motion at its
//! end. Set at each stage, they would lack the errors of the stages, of third order in the step, that the motion beside them
//! has: such a step in the displacement, over a cell, is a force that leaves a layer with velocities of second order.
//! Integrated, they differ from the given motion by what the whole composition does.
//!
//! # Sides with a given traction
//!
//! The forces gain `sum T N_i dA` over the products of the other axes' points. The traction belongs to the exact motion,
//! the stress inside to that of the stage, which is what limits the order of the velocities beside such a side: with a
//! composition of fourth order and steps in proportion to the cells they have an error of third order in a layer that is
//! one cell wide.

use std::ops::Range;

use nalgebra::{SMatrix, SVector};

use super::basis::{Basis, ValueOrSlope};
use super::fit::Fit;

/// The side of a body at an end of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Side {
    /// The axis that ends there.
    pub axis: usize,
    /// Whether it is the axis's upper end.
    pub upper: bool,
}

/// The kind of boundary data on a side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// The displacement, a length.
    Displacement,
    /// The velocity.
    Velocity,
    /// The acceleration: the second derivative of the displacement that is given.
    Acceleration,
    /// The traction `P N`, a force per reference area.
    Traction,
}

/// Boundary data of a body: the motion of sides where that of a component is given, and the traction where one of that is (see
/// [`End::Open`](super::End::Open)).
pub trait BoundaryData<const D: usize> {
    /// Writes a quantity at the reference positions `X` on a side at time `t`, in Cartesian components; both slices have
    /// the same length. The contents of `values` on entry are unspecified.
    fn evaluate(
        &self,
        quantity: Quantity,
        side: Side,
        X: &[SVector<f64, D>],
        t: f64,
        values: &mut [SVector<f64, D>],
    );
}

impl<const D: usize, B> BoundaryData<D> for B
where
    B: Fn(Quantity, Side, &[SVector<f64, D>], f64, &mut [SVector<f64, D>]),
{
    fn evaluate(
        &self,
        quantity: Quantity,
        side: Side,
        X: &[SVector<f64, D>],
        t: f64,
        values: &mut [SVector<f64, D>],
    ) {
        self(quantity, side, X, t, values);
    }
}

/// Sides that are held where they are, and no traction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HeldBoundary;

impl<const D: usize> BoundaryData<D> for HeldBoundary {
    fn evaluate(
        &self,
        _: Quantity,
        _: Side,
        _: &[SVector<f64, D>],
        _: f64,
        values: &mut [SVector<f64, D>],
    ) {
        values.fill(SVector::zeros());
    }
}

/// The places on a side where something is given, the same of some components.
#[derive(Clone, Debug)]
pub(crate) struct Face<const D: usize> {
    pub(crate) side: Side,
    /// Whether their motion is given, not the traction.
    pub(crate) moved: bool,
    /// The components that it is given of.
    pub(crate) given: [bool; D],
    /// Reference positions, Cartesian, at the products of the other axes' points, the lowest axis fastest. Where the motion
    /// is given, ends of other axes whose motion is given belong to their points.
    pub(crate) X: Vec<SVector<f64, D>>,
    /// Columns are the unit vectors of the components there; empty where these are Cartesian.
    pub(crate) frames: Vec<SMatrix<f64, D, D>>,
    /// Areas that the points stand for, where the traction is given.
    pub(crate) areas: Vec<f64>,
    /// The given values, in the grid's components.
    pub(crate) values: Vec<SVector<f64, D>>,
}

impl<const D: usize> Face<D> {
    /// Whether the motion of a component is given.
    pub(crate) fn moves(&self, component: usize) -> bool {
        self.moved && self.given[component]
    }

    /// Whether the traction along a component is given.
    pub(crate) fn loads(&self, component: usize) -> bool {
        !self.moved && self.given[component]
    }

    /// Asks for a quantity in the components that the unknowns stand for.
    pub(crate) fn ask(&mut self, data: &dyn BoundaryData<D>, quantity: Quantity, t: f64) {
        data.evaluate(quantity, self.side, &self.X, t, &mut self.values);
        for (value, frame) in self.values.iter_mut().zip(&self.frames) {
            *value = frame.tr_mul(value);
        }
    }

    /// The side's coefficients of a component that moves as was asked for last; `axis(k)` is what belongs to the component
    /// along an axis.
    pub(crate) fn fit<'a>(
        &self,
        component: usize,
        axis: impl Fn(usize) -> (&'a Fit, &'a Basis),
    ) -> Vec<f64> {
        let mut values: Vec<f64> = self.values.iter().map(|value| value[component]).collect();
        let mut inner = 1;
        for (fit, basis) in self.others().map(axis) {
            values = fit.apply(basis, inner, &values);
            inner *= basis.functions;
        }
        values
    }

    /// The forces on the side's coefficients of a component under the traction that was asked for last.
    pub(crate) fn load<'a>(
        &self,
        component: usize,
        basis: impl Fn(usize) -> &'a Basis,
    ) -> Vec<f64> {
        let forces = self.values.iter().zip(&self.areas).map(|(T, area)| T[component] * area);
        let mut forces: Vec<f64> = forces.collect();
        let mut inner = 1;
        for basis in self.others().map(basis) {
            let mut sums = vec![0.0; forces.len() / basis.points * basis.functions];
            basis.integrate(ValueOrSlope::Value, inner, &forces, &mut sums);
            forces = sums;
            inner *= basis.functions;
        }
        forces
    }

    fn others(&self) -> impl Iterator<Item = usize> {
        let own = self.side.axis;
        (0..D).filter(move |k| *k != own)
    }

    /// Writes the side's coefficients over those of the body.
    pub(crate) fn set(&self, functions: &[usize; D], of_side: &[f64], of_body: &mut [f64]) {
        let (inner, lines) = self.lines(functions);
        for (range, of_side) in lines.zip(of_side.chunks_exact(inner)) {
            of_body[range].copy_from_slice(of_side);
        }
    }

    /// Adds to the coefficients of the body.
    pub(crate) fn add(&self, functions: &[usize; D], of_side: &[f64], of_body: &mut [f64]) {
        let (inner, lines) = self.lines(functions);
        for (range, of_side) in lines.zip(of_side.chunks_exact(inner)) {
            of_body[range].iter_mut().zip(of_side).for_each(|(sum, part)| *sum += part);
        }
    }

    /// Copies the side's coefficients from one array of the body's to another.
    pub(crate) fn copy(&self, functions: &[usize; D], from: &[f64], to: &mut [f64]) {
        for range in self.lines(functions).1 {
            to[range.clone()].copy_from_slice(&from[range]);
        }
    }

    /// Where the side's coefficients lie in an array of the body's, `functions` by axis: in runs of equal length.
    fn lines(&self, functions: &[usize; D]) -> (usize, impl Iterator<Item = Range<usize>>) {
        let axis = self.side.axis;
        let inner: usize = functions[..axis].iter().product();
        let outer: usize = functions[axis + 1..].iter().product();
        let (count, index) =
            (functions[axis], if self.side.upper { functions[axis] - 1 } else { 0 });
        let start = move |block: usize| (block * count + index) * inner;
        (inner, (0..outer).map(move |block| start(block)..start(block) + inner))
    }
}
