//! One component of the motion: its coefficients, what they are at the particles, and the forces on them.
//!
//! Components meet in the stress only. Between two stresses each is worked on by itself, all of them side by side: threads wait
//! for each other once, and not after every loop over an array.

use std::mem;

use mmsmith_particles::SetupError;
use mmsmith_threads::{each, each_chunk};

use super::basis::{Basis, ValueOrSlope};
use super::boundary::Face;
use super::fit::Fit;
use super::mass::{Band, Mass};
use super::piece;

/// The linear operators along the axes: splines of the components across each axis and of the one along it, matrices of each component.
#[derive(Clone, Debug)]
pub(super) struct Operators<const D: usize> {
    pub(super) bases: [[Basis; 2]; D],
    /// Solves for accelerations.
    pub(super) mass: [[Mass; D]; D],
    /// Fits coefficients to values; or why the particles do not determine them.
    pub(super) fits: Result<[[Fit; D]; D], SetupError>,
}

/// The entry of `pairs` for a component along axis `k`: the second where it is the component along this axis, else the first.
pub(super) fn along<T, const D: usize>(pairs: &[[T; 2]; D], k: usize, component: usize) -> &T {
    &pairs[k][usize::from(k == component)]
}

/// A component of displacement, velocity and acceleration, and the arrays that its forces are computed in.
#[derive(Clone, Debug)]
pub(super) struct Component<const D: usize> {
    pub(super) index: usize,
    /// Coefficients, axis 0 fastest.
    pub(super) u: Vec<f64>,
    pub(super) v: Vec<f64>,
    /// Accelerations at the current state, from the first step on; forces before the solution.
    pub(super) a: Vec<f64>,
    /// Coefficients of the acceleration on moved sides, and zero elsewhere.
    pub(super) given: Vec<f64>,
    /// Values at the particles; then the factors of the functions' values in the forces.
    pub(super) values: Vec<f64>,
    /// Slopes at the particles, by axis; then the factors of the functions' slopes.
    pub(super) slopes: [Vec<f64>; D],
    /// For each axis but the last, values and slopes along axes so far, between the axes: particles up to that axis,
    /// coefficients after it.
    pub(super) partial: Vec<Vec<Vec<f64>>>,
    /// Products of the mass matrix.
    pub(super) product: [Vec<f64>; 2],
}

/// A field that coefficients stand for.
#[derive(Clone, Copy)]
pub(super) enum Field {
    Displacement,
    Velocity,
}

/// The factors of an integrand: of values of the functions, of their slopes, or of both.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Factors {
    Values,
    Slopes,
    Both,
}

impl<const D: usize> Component<D> {
    /// The component at rest.
    pub(super) fn new(index: usize, bases: &[[Basis; 2]; D]) -> Self {
        let of = |k: usize| along(bases, k, index);
        let particles = || vec![0.0; (0..D).map(|k| of(k).points).product()];
        let coefficients = || vec![0.0; (0..D).map(|k| of(k).functions).product()];
        let layer = |k: usize, last: usize| if k <= last { of(k).points } else { of(k).functions };
        let partial = |last: usize| {
            let size = (0..D).map(|k| layer(k, last)).product();
            vec![vec![0.0; size]; last + 2]
        };
        Self {
            index,
            u: coefficients(),
            v: coefficients(),
            a: coefficients(),
            given: coefficients(),
            values: particles(),
            slopes: std::array::from_fn(|_| particles()),
            partial: (0..D - 1).map(partial).collect(),
            product: [Vec::new(), Vec::new()],
        }
    }

    /// The number of coefficients along each axis.
    pub(super) fn functions(&self, bases: &[[Basis; 2]; D]) -> [usize; D] {
        std::array::from_fn(|k| along(bases, k, self.index).functions)
    }

    /// Evaluates a field and its slopes at the particles; its values only if they are needed.
    pub(super) fn evaluate(&mut self, bases: &[[Basis; 2]; D], field: Field, with_values: bool) {
        let Self { values, slopes, partial, .. } = self;
        let coefficients = match field {
            Field::Displacement => &self.u,
            Field::Velocity => &self.v,
        };
        let mut inner = 1;
        for k in 0..D {
            let basis = along(bases, k, self.index);
            let (before, after) = partial.split_at_mut(k);
            let source = |part: usize| match before.last() {
                Some(arrays) => &arrays[part][..],
                None => &coefficients[..],
            };
            match after.first_mut() {
                Some(arrays) => {
                    for (part, array) in arrays[..=k].iter_mut().enumerate() {
                        basis.evaluate(ValueOrSlope::Value, inner, source(part), array);
                    }
                    basis.evaluate(ValueOrSlope::Slope, inner, source(0), &mut arrays[k + 1]);
                }
                None => {
                    if with_values {
                        basis.evaluate(ValueOrSlope::Value, inner, source(0), values);
                    }
                    for (j, slopes) in slopes[..k].iter_mut().enumerate() {
                        basis.evaluate(ValueOrSlope::Value, inner, source(j + 1), slopes);
                    }
                    basis.evaluate(ValueOrSlope::Slope, inner, source(0), &mut slopes[k]);
                }
            }
            inner *= basis.points;
        }
    }

    /// Integrates what stands at the particles, as factors of values or of slopes or of both, against the functions.
    pub(super) fn integrate(
        &mut self,
        bases: &[[Basis; 2]; D],
        of: Factors,
        coefficients: &mut [f64],
    ) {
        let Self { values, slopes, partial, .. } = self;
        let mut inner = values.len();
        for k in (0..D).rev() {
            let basis = along(bases, k, self.index);
            inner /= basis.points;
            let (before, after) = partial.split_at_mut(k);
            let is_first = k == D - 1;
            // Values come first, then slopes by axis.
            let source = |part: usize| match after.first() {
                Some(arrays) => &arrays[part][..],
                None if part == 0 => &values[..],
                None => &slopes[part - 1][..],
            };
            let mut target = |part: usize, terms: &[(ValueOrSlope, usize)]| {
                let array = match before.last_mut() {
                    Some(arrays) => &mut arrays[part][..],
                    None => &mut *coefficients,
                };
                array.fill(0.0);
                for &(weights, part) in terms {
                    basis.integrate(weights, inner, source(part), array);
                }
            };
            let (of_values, of_slopes) = ((ValueOrSlope::Value, 0), (ValueOrSlope::Slope, k + 1));
            match of {
                Factors::Values => target(0, &[of_values]),
                Factors::Slopes if is_first => target(0, &[of_slopes]),
                Factors::Slopes | Factors::Both => target(0, &[of_values, of_slopes]),
            }
            if of != Factors::Values {
                for j in 1..=k {
                    target(j, &[(ValueOrSlope::Value, j)]);
                }
            }
        }
    }

    /// From the factors of the forces at the particles to accelerations, of which those on moved sides are given. `coupling` is
    /// the density where the given ones act on the others by their inertia.
    pub(super) fn accelerate(
        &mut self,
        Operators { bases, mass, fits }: &Operators<D>,
        of: Factors,
        faces: &[Face<D>],
        coupling: Option<f64>,
    ) {
        let (index, functions) = (self.index, self.functions(bases));
        let mut a = mem::take(&mut self.a);
        self.integrate(bases, of, &mut a);
        for face in faces.iter().filter(|face| face.loads(index)) {
            let forces = face.load(index, |k| along(bases, k, index));
            face.add(&functions, &forces, &mut a);
        }
        if let (Some(density), Ok(fits)) = (coupling, fits) {
            let given = mem::take(&mut self.given);
            let matrix = |k: usize| &fits[k][index].matrix;
            self.subtract_product(&functions, matrix, density, &given, &mut a);
            self.given = given;
        }
        solve(&functions, |k| &mass[k][index], &mut a);
        for face in faces.iter().filter(|face| face.moves(index)) {
            face.copy(&functions, &self.given, &mut a);
        }
        self.a = a;
    }

    /// `sums -= factor * M * given`, `M` being the product of one matrix for each axis.
    pub(super) fn subtract_product<'a>(
        &mut self,
        functions: &[usize; D],
        matrix: impl Fn(usize) -> &'a Band,
        factor: f64,
        given: &[f64],
        sums: &mut [f64],
    ) {
        let [product, next] = &mut self.product;
        product.clear();
        product.extend_from_slice(given);
        next.resize(given.len(), 0.0);
        let mut inner = 1;
        for (k, count) in functions.iter().enumerate() {
            matrix(k).multiply(inner, product, next);
            mem::swap(product, next);
            inner *= count;
        }
        sums.iter_mut().zip(product).for_each(|(sum, part)| *sum -= factor * *part);
    }

    /// `v += time a`.
    pub(super) fn kick(&mut self, time: f64) {
        add(&mut self.v, time, &self.a);
    }

    /// `u += time v`.
    pub(super) fn drift(&mut self, time: f64) {
        add(&mut self.u, time, &self.v);
    }
}

/// Calls `work` with each of the components.
pub(super) fn each_component<const D: usize>(
    components: &mut [Component<D>; D],
    work: &(dyn Fn(&mut Component<D>) + Sync),
) {
    each(components.iter_mut().collect(), work);
}

/// Solves in place for coefficients, `functions` by axis, with one mass matrix for each axis.
pub(super) fn solve<'a, const D: usize>(
    functions: &[usize; D],
    mass: impl Fn(usize) -> &'a Mass,
    coefficients: &mut [f64],
) {
    let mut inner = 1;
    for (k, count) in functions.iter().enumerate() {
        mass(k).solve(inner, coefficients);
        inner *= count;
    }
}

/// `target += factor * source`.
fn add(target: &mut [f64], factor: f64, source: &[f64]) {
    let size = piece(target.len());
    each_chunk(target, size, &|piece, target| {
        let source = &source[piece * size..];
        target.iter_mut().zip(source).for_each(|(x, y)| *x += factor * y);
    });
}
