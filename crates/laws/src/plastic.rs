//! Plastic and viscous flow by von Mises, by return maps: logarithmic elastic strains, isotropic hardening, Perzyna's overstress.
//!
//! The internal variables are `G = (F^p^T F^p)^-1` and the equivalent plastic strain `alpha`. A step from `F_n` to `F` tries an elastic
//! one, `b = F G_n F^T`, and returns along the deviator of the stress:
//!
//! ```text
//! e = ln(b)/2,  s = 2 mu dev e,  n = s/|s|;   e <- e - D n,   |s| - 2 mu D = sqrt(2/3) k(alpha_n + sqrt(2/3) D) + drag (D time/dt)^(1/m)
//! ```
//!
//! without the last term where flow does not depend on its rate. This is backward Euler for the multiplier and the exponential map for the
//! flow, of first order in the step. The midpoint rule takes the direction of the flow from half a step, and is of second order; so is the
//! multiplier of a rate, which it takes from there as well.
//!
//! Source: J. C. Simo, "Algorithms for static and dynamic multiplicative plasticity that preserve the classical return mapping schemes of
//! the infinitesimal theory", CMAME 99 (1992) 61-112; M. Ortiz and E. P. Popov, IJNME 21 (1985) 1561-1576, for the midpoint rule;
//! P. Perzyna, Adv. Appl. Mech. 9 (1966) 243-377.

mod multiplier;
mod plane;
mod space;

use mmsmith_lanes::simd::{Loop, Vectors, dispatch};
use mmsmith_scalar_functions::ScalarFunctions;
use mmsmith_vocabulary::{Flow, Material};
use nalgebra::{Matrix3, RealField, SMatrix};

use crate::BLOCK;
use crate::fault::{Fault, Planted};
use crate::memory::{ENTRIES, Increment, InternalVariable, LawWithMemory, in_space};
use multiplier::Yield;
use plane::{Elastic, Elastics, F2, Sym};

/// How a step of a flow finds its direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ReturnMap {
    /// At its end: first order.
    #[default]
    Exponential,
    /// At its middle: second order.
    Midpoint,
}

/// Flow by von Mises of a body with Hencky's elastic law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plastic {
    lambda: f64,
    law: Yield,
    map: ReturnMap,
}

impl Plastic {
    /// With Lame's constants of the elastic part, which are pressures.
    #[must_use]
    pub fn new(lambda: f64, mu: f64, flow: Flow<f64>, map: ReturnMap) -> Self {
        let planted = Planted::here();
        Self { lambda, law: Yield { mu, flow: planted.flow(flow), planted }, map }
    }

    /// `G` at the start: the identity, or that of the elastic stretch that brings the body onto the yield surface.
    fn start(&self, dimension: usize) -> [f64; 3] {
        let Yield { mu, flow, .. } = self.law;
        if !flow.is_on_yield {
            return [1.0; 3];
        }
        // Logarithms of elastic stretches along the axes, for which the size of 2 mu e is sqrt(2/3) times the yield stress.
        let along: [f64; 3] = match dimension {
            1 => [1.0, -0.5, -0.5].map(|part| part * flow.yield_stress / (3.0 * mu)),
            _ => {
                [1.0, -1.0, 0.0].map(|part| part * flow.yield_stress / (2.0 * 3.0_f64.sqrt() * mu))
            }
        };
        along.map(|e| (2.0 * e).exponential())
    }

    /// `G` as stresses take it.
    #[inline(always)]
    fn of_stress(&self, G: Sym) -> Sym {
        if self.law.planted.is(Fault::ElasticPartAlone) {
            return Sym { a: [1.0; 2], shear: 0.0, across: 1.0 };
        }
        let across = if self.law.planted.is(Fault::AcrossDropped) { 1.0 } else { G.across };
        Sym { across, ..G }
    }

    fn evolve_in_space<T: RealField + Copy, const D: usize>(
        &self,
        increment: &Increment<'_, T, D>,
        q: &mut [[T; BLOCK]],
    ) {
        let Self { law, map, .. } = self;
        let time = double(increment.time);
        for n in 0..BLOCK {
            let (G, alpha) = (in_rows(q, n), double(q[6][n]));
            let end = in_space(increment.end, n);
            let (G, multiplier) = match map {
                ReturnMap::Exponential => space::exponential(law, &end, (&G, alpha), time),
                // An elastic step needs no search.
                ReturnMap::Midpoint
                    if law.flow.overstress.is_none()
                        && !law.flows(space::size(law, &end, &G), alpha) =>
                {
                    continue;
                }
                ReturnMap::Midpoint => {
                    let start = in_space(increment.start, n);
                    space::midpoint(law, &start, &end, (&G, alpha), time)
                }
            };
            if multiplier > 0.0 {
                for (&(i, j), column) in ENTRIES.iter().zip(&mut *q) {
                    column[n] = nalgebra::convert(G[(i, j)]);
                }
                q[6][n] = nalgebra::convert(law.advanced(alpha, multiplier));
            }
        }
    }

    /// The elastic deformations at the end where no particle of the block has flown.
    fn evolve_in_plane<T: RealField + Copy, const D: usize>(
        &self,
        increment: &Increment<'_, T, D>,
        q: &mut [[T; BLOCK]],
    ) -> Option<Elastics> {
        let Self { law, map, .. } = *self;
        let Increment { start, end, time } = *increment;
        let time = double(time);
        let (mut elastic, mut flows) = (Elastics::AT_REST, false);
        dispatch(Trials { F: end, q, planted: law.planted, elastic: &mut elastic });
        if map == ReturnMap::Exponential {
            let (mut multipliers, mut kept) = ([0.0; BLOCK], [1.0; BLOCK]);
            for n in 0..BLOCK {
                let size = law.mu * elastic.size[n];
                let multiplier = law.multiplier(size, double(q[6][n]), time);
                if multiplier > 0.0 {
                    multipliers[n] = multiplier;
                    kept[n] = 1.0 - 2.0 * law.mu * multiplier / size;
                    flows = true;
                }
            }
            if flows {
                dispatch(Returns { F: end, q, elastic: &elastic, kept: &kept });
                for (alpha, multiplier) in q[6].iter_mut().zip(multipliers) {
                    *alpha = nalgebra::convert(law.advanced(double(*alpha), multiplier));
                }
            }
            return (!flows).then_some(elastic);
        }
        for n in 0..BLOCK {
            let (size, alpha) = (law.mu * elastic.size[n], double(q[6][n]));
            if law.flow.overstress.is_none() && !law.flows(size, alpha) {
                continue;
            }
            let (G, F) = (in_plane(q, n), row(end, n));
            let (G, multiplier) = plane::midpoint(&law, &row(start, n), &F, (&G, alpha), time);
            if multiplier > 0.0 {
                set_in_plane(q, n, &G);
                q[6][n] = nalgebra::convert(law.advanced(alpha, multiplier));
                flows = true;
            }
        }
        (!flows).then_some(elastic)
    }
}

#[inline(always)]
fn double<T: RealField + Copy>(value: T) -> f64 {
    nalgebra::convert_unchecked(value)
}

/// The deformation gradient of particle `n`, with the identity along the second axis on a line.
#[inline(always)]
fn row<T: RealField + Copy, const D: usize>(F: &[[[T; BLOCK]; D]; D], n: usize) -> F2 {
    let entry = |i: usize, j: usize| match i < D && j < D {
        true => double(F[i][j][n]),
        false if i == j => 1.0,
        false => 0.0,
    };
    [[entry(0, 0), entry(0, 1)], [entry(1, 0), entry(1, 1)]]
}

#[inline(always)]
fn in_plane<T: RealField + Copy>(q: &[[T; BLOCK]], n: usize) -> Sym {
    Sym { a: [double(q[0][n]), double(q[1][n])], shear: double(q[3][n]), across: double(q[2][n]) }
}

#[inline(always)]
fn set_in_plane<T: RealField + Copy>(q: &mut [[T; BLOCK]], n: usize, G: &Sym) {
    q[0][n] = nalgebra::convert(G.a[0]);
    q[1][n] = nalgebra::convert(G.a[1]);
    q[2][n] = nalgebra::convert(G.across);
    q[3][n] = nalgebra::convert(G.shear);
}

fn in_rows<T: RealField + Copy>(q: &[[T; BLOCK]], n: usize) -> Matrix3<f64> {
    let mut G = Matrix3::zeros();
    for (&(i, j), column) in ENTRIES.iter().zip(q) {
        let value = double(column[n]);
        (G[(i, j)], G[(j, i)]) = (value, value);
    }
    G
}

/// Elastic deformations of a block in the plane.
struct Trials<'a, T, const D: usize> {
    F: &'a [[[T; BLOCK]; D]; D],
    q: &'a [[T; BLOCK]],
    planted: Planted,
    elastic: &'a mut Elastics,
}

impl<T: RealField + Copy, const D: usize> Loop for Trials<'_, T, D> {
    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self { F, q, planted, elastic } = self;
        let [g11, g22, g33, g12, ..] = q else { return };
        trials(F, [g11, g22, g33, g12], planted, elastic);
    }
}

/// A function of its own tells the compiler that input and output do not overlap.
#[inline(always)]
fn trials<T: RealField + Copy, const D: usize>(
    F: &[[[T; BLOCK]; D]; D],
    [g11, g22, g33, g12]: [&[T; BLOCK]; 4],
    planted: Planted,
    elastic: &mut Elastics,
) {
    for n in 0..BLOCK {
        let across = if planted.is(Fault::AcrossDropped) { 1.0 } else { double(g33[n]) };
        let shear = if planted.is(Fault::TrialShearDropped) { 0.0 } else { double(g12[n]) };
        let G = Sym { a: [double(g11[n]), double(g22[n])], shear, across };
        elastic.set(n, &Elastic::new(&row(F, n), &G));
    }
}

/// Returns of a block in the plane, each of which keeps a share of its deviator.
struct Returns<'a, T, const D: usize> {
    F: &'a [[[T; BLOCK]; D]; D],
    q: &'a mut [[T; BLOCK]],
    elastic: &'a Elastics,
    kept: &'a [f64; BLOCK],
}

impl<T: RealField + Copy, const D: usize> Loop for Returns<'_, T, D> {
    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self { F, q, elastic, kept } = self;
        if elastic.are_small() {
            returns::<true, T, D>(F, q, elastic, kept);
        } else {
            returns::<false, T, D>(F, q, elastic, kept);
        }
    }
}

#[inline(always)]
fn returns<const SMALL: bool, T: RealField + Copy, const D: usize>(
    F: &[[[T; BLOCK]; D]; D],
    q: &mut [[T; BLOCK]],
    elastic: &Elastics,
    kept: &[f64; BLOCK],
) {
    let [g11, g22, g33, g12, ..] = q else { return };
    for n in 0..BLOCK {
        let G = Sym {
            a: [double(g11[n]), double(g22[n])],
            shear: double(g12[n]),
            across: double(g33[n]),
        };
        let new = plane::returned::<SMALL>(&row(F, n), &G, &elastic.get(n), kept[n]);
        // Whoever does not flow keeps the bits.
        let flows = kept[n] < 1.0;
        g11[n] = if flows { nalgebra::convert(new.a[0]) } else { g11[n] };
        g22[n] = if flows { nalgebra::convert(new.a[1]) } else { g22[n] };
        g33[n] = if flows { nalgebra::convert(new.across) } else { g33[n] };
        g12[n] = if flows { nalgebra::convert(new.shear) } else { g12[n] };
    }
}

/// Kirchhoff stresses of elastic deformations that are known.
struct OfElastic<'a, T, const D: usize> {
    law: &'a Plastic,
    elastic: &'a Elastics,
    tau: &'a mut [[[T; BLOCK]; D]; D],
}

impl<T: RealField + Copy, const D: usize> Loop for OfElastic<'_, T, D> {
    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self { law, elastic, tau } = self;
        of_elastic(law, elastic, tau);
    }
}

#[inline(always)]
fn of_elastic<T: RealField + Copy, const D: usize>(
    law: &Plastic,
    elastic: &Elastics,
    tau: &mut [[[T; BLOCK]; D]; D],
) {
    let (lambda, mu) = (law.lambda, law.law.mu);
    for n in 0..BLOCK {
        let Sym { a, shear, .. } = elastic.get(n).kirchhoff(lambda, mu);
        for i in 0..D {
            for j in 0..D {
                tau[i][j][n] = nalgebra::convert(if i == j { a[i] } else { shear });
            }
        }
    }
}

/// Kirchhoff stresses of a block in the plane.
struct Stresses<'a, T, const D: usize> {
    law: &'a Plastic,
    F: &'a [[[T; BLOCK]; D]; D],
    q: &'a [[T; BLOCK]],
    tau: &'a mut [[[T; BLOCK]; D]; D],
}

impl<T: RealField + Copy, const D: usize> Loop for Stresses<'_, T, D> {
    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self { law, F, q, tau } = self;
        let [g11, g22, g33, g12, ..] = q else { return };
        stresses(law, F, [g11, g22, g33, g12], tau);
    }
}

#[inline(always)]
fn stresses<T: RealField + Copy, const D: usize>(
    law: &Plastic,
    F: &[[[T; BLOCK]; D]; D],
    [g11, g22, g33, g12]: [&[T; BLOCK]; 4],
    tau: &mut [[[T; BLOCK]; D]; D],
) {
    let (lambda, mu) = (law.lambda, law.law.mu);
    for n in 0..BLOCK {
        let G = Sym {
            a: [double(g11[n]), double(g22[n])],
            shear: double(g12[n]),
            across: double(g33[n]),
        };
        let elastic = Elastic::new(&row(F, n), &law.of_stress(G));
        let Sym { a, shear, .. } = elastic.kirchhoff(lambda, mu);
        for i in 0..D {
            for j in 0..D {
                tau[i][j][n] = nalgebra::convert(if i == j { a[i] } else { shear });
            }
        }
    }
}

impl<T: RealField + Copy, const D: usize> LawWithMemory<T, D> for Plastic {
    fn variables(&self) -> Vec<InternalVariable> {
        let start = self.start(D);
        let of_G = ENTRIES.iter().map(|&(i, j)| InternalVariable {
            name: format!("G{}{}", i + 1, j + 1),
            at_rest: if i == j { start[i] } else { 0.0 },
        });
        of_G.chain([InternalVariable { name: "alpha".into(), at_rest: 0.0 }]).collect()
    }

    fn elastic(&self) -> Option<Material<T>> {
        let [lambda, mu] = [self.lambda, self.law.mu].map(nalgebra::convert);
        Some(Material::Hencky { lambda, mu })
    }

    fn kirchhoff_across(&self, F: &SMatrix<T, D, D>, q: &[T]) -> Option<T> {
        if D > 2 {
            return None;
        }
        let block = std::array::from_fn(|i| std::array::from_fn(|j| [F[(i, j)]; BLOCK]));
        let q: Vec<[T; BLOCK]> = q.iter().map(|&value| [value; BLOCK]).collect();
        let elastic = Elastic::new(&row::<T, D>(&block, 0), &self.of_stress(in_plane(&q, 0)));
        Some(nalgebra::convert(elastic.kirchhoff(self.lambda, self.law.mu).across))
    }

    fn kirchhoff(
        &self,
        F: &[[[T; BLOCK]; D]; D],
        q: &[[T; BLOCK]],
        tau: &mut [[[T; BLOCK]; D]; D],
    ) {
        if D < 3 {
            dispatch(Stresses { law: self, F, q, tau });
            return;
        }
        for n in 0..BLOCK {
            let G = match self.law.planted.is(Fault::ElasticPartAlone) {
                true => Matrix3::identity(),
                false => in_rows(q, n),
            };
            let stress = space::kirchhoff(&in_space(F, n), &G, self.lambda, self.law.mu);
            for i in 0..D {
                for j in 0..D {
                    tau[i][j][n] = nalgebra::convert(stress[(i, j)]);
                }
            }
        }
    }

    fn first_piola_kirchhoff(
        &self,
        F: &[[[T; BLOCK]; D]; D],
        q: &[[T; BLOCK]],
        P: &mut [[[T; BLOCK]; D]; D],
    ) {
        self.kirchhoff(F, q, P);
        crate::memory::pull_back(F, P);
    }

    fn evolve(&self, increment: &Increment<'_, T, D>, q: &mut [[T; BLOCK]]) {
        if D < 3 {
            self.evolve_in_plane(increment, q);
        } else {
            self.evolve_in_space(increment, q);
        }
    }

    fn evolve_to_kirchhoff(
        &self,
        increment: &Increment<'_, T, D>,
        q: &mut [[T; BLOCK]],
        tau: &mut [[[T; BLOCK]; D]; D],
    ) {
        if D > 2 {
            self.evolve_in_space(increment, q);
            self.kirchhoff(increment.end, q, tau);
            return;
        }
        match self.evolve_in_plane(increment, q) {
            Some(elastic) if !self.law.planted.is_any() => {
                dispatch(OfElastic { law: self, elastic: &elastic, tau });
            }
            _ => self.kirchhoff(increment.end, q, tau),
        }
    }
}
