//! The ring's body force by four ways: the generated code at kept points and in single calls, the listing that Maple
//! printed for the original study, and automatic differentiation at run time.
//!
//! Each run evaluates [`POINTS`] points at one time; the time of a run over that number is the cost of one evaluation.

#![allow(clippy::unwrap_used)]

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use mmsmith_solutions::nalgebra::{Const, SVector};
use mmsmith_solutions::{Ring, RingParameters, Solution};
use num_dual::{Derivative, Dual2_64, Dual2SVec64, DualNum, DualSVec64};
use std::f64::consts::PI;

const POINTS: usize = 8000;
const TIME: f64 = 0.0123;

type Vector = SVector<f64, 2>;

/// The parameters of the ring and the coefficients of its profile.
#[derive(Clone, Copy)]
struct Case {
    A: f64,
    E: f64,
    rho: f64,
    c1: f64,
    c2: f64,
    c3: f64,
}

impl Case {
    fn new(parameters: RingParameters<f64>) -> Self {
        let RingParameters { A, E, rho0: rho, Ri, Ro } = parameters;
        let d = Ro * Ro * (3.0 * Ri - Ro);
        Case { A, E, rho, c1: 6.0 * Ri * Ro / d, c2: -3.0 * (Ro + Ri) / d, c3: 2.0 / d }
    }

    /// The listing at the end of the original study, with the numbers joined that its lines break.
    fn listing(&self, X: &Vector, t: f64) -> Vector {
        let Case { A, E, rho, c1, c2, c3 } = *self;
        let T = A * ((E / rho).sqrt() * PI * t).cos();
        let R = (X[0] * X[0] + X[1] * X[1]).sqrt();
        let H = X[1].atan2(X[0]);
        let t1 = PI * PI;
        let t3 = 1.0 / rho;
        let t4 = t1 * E * t3;
        let t5 = R * R;
        let t6 = t5 * R;
        let t8 = c2 * t5;
        let t9 = c1 * R;
        let t11 = T * (c3 * t6 + t8 + t9);
        let t12 = H.cos();
        let t17 = T * T;
        let t18 = t17 * T;
        let t19 = c2 * c2;
        let t20 = t19 * t19;
        let t27 = c3 * c3;
        let t31 = T * c2;
        let t34 = t17 * c2;
        let t35 = c1 * c1;
        let t39 = t35 * c1;
        let t42 = t27 * t27;
        let t44 = t5 * t5;
        let t48 = t19 * c2;
        let t52 = t27 * c3;
        let t54 = t44 * R;
        let t57 = t18 * t27;
        let t61 = t18 * t52;
        let t66 = t18 * c3;
        let t77 = t5 * c1;
        let t80 = 12.0 * t18 * t20 * t6
            + 19.0 * T * t19 * R
            + 68.0 * T * t27 * t6
            + 12.0 * t31 * c1
            + 9.0 * t34 * t35
            + 3.0 * t18 * c2 * t39
            + 72.0 * t18 * t42 * t44 * t6
            + 24.0 * t17 * t48 * t5
            + 120.0 * t17 * t52 * t54
            + 191.0 * t57 * t54 * t19
            + 195.0 * t61 * t44 * t5 * c2
            + 8.0 * t66 * R * t39
            + 56.0 * t57 * t6 * t35
            + 80.0 * t66 * t44 * t48
            + 24.0 * t18 * t48 * t77;
        let t82 = R * t35;
        let t88 = t17 * c3;
        let t89 = t6 * t19;
        let t94 = t17 * t27;
        let t98 = t44 * c2;
        let t101 = t17 * t19;
        let t104 = T * c3;
        let t124 = 15.0 * t18 * t19 * t82
            + 120.0 * t61 * t54 * c1
            + 130.0 * t88 * t89
            + 24.0 * t88 * t82
            + 112.0 * t94 * t6 * c1
            + 221.0 * t94 * t98
            + 30.0 * t101 * t9
            + 32.0 * t104 * t9
            + 76.0 * t104 * t8
            + 6.0 * c2
            + 122.0 * t88 * t8 * c1
            + 61.0 * t66 * t8 * t35
            + 130.0 * t66 * t89 * c1
            + 221.0 * t57 * t98 * c1
            + 16.0 * c3 * R;
        let t125 = t80 + t124;
        let t127 = t104 * t5;
        let t129 = t31 * R;
        let t131 = T * c1;
        let t151 = 1.0
            / (3.0 * t127 + 2.0 * t129 + 1.0 + t131)
            / (1.0
                + 3.0 * t94 * t44
                + 5.0 * t88 * t6 * c2
                + 4.0 * t88 * t77
                + 3.0 * t34 * t9
                + t17 * t35
                + 2.0 * t131
                + 2.0 * t101 * t5
                + 3.0 * t129
                + 4.0 * t127);
        let t156 = H.sin();
        Vector::new(
            -t4 * t11 * t12 - t3 * E * T * t12 * t125 * t151 / 2.0,
            -t4 * t11 * t156 - t3 * t125 * E * T * t156 * t151 / 2.0,
        )
    }

    /// The displacement of any kind of number.
    fn displacement<N: DualNum<Primitive = f64> + Copy>(&self, X: [N; 2], t: N) -> [N; 2] {
        let T = (t * ((self.E / self.rho).sqrt() * PI)).cos() * self.A;
        let R = (X[0] * X[0] + X[1] * X[1]).sqrt();
        let profile = T * ((R * self.c3 + self.c2) * R + self.c1);
        [X[0] * profile, X[1] * profile]
    }

    /// `P = mu (F - F^-T)` for `nu = 0`, of any kind of number.
    fn stress<N: DualNum<Primitive = f64> + Copy>(&self, F: [[N; 2]; 2]) -> [[N; 2]; 2] {
        let over_J = (F[0][0] * F[1][1] - F[0][1] * F[1][0]).recip();
        let mu = 0.5 * self.E;
        [
            [(F[0][0] - F[1][1] * over_J) * mu, (F[0][1] + F[1][0] * over_J) * mu],
            [(F[1][0] + F[0][1] * over_J) * mu, (F[1][1] - F[0][0] * over_J) * mu],
        ]
    }

    /// Derivatives of the displacement and of the law at run time.
    fn automatic(&self, X: &Vector, t: f64) -> Vector {
        let fixed = X.map(Dual2_64::from_re);
        let moving = self.displacement([fixed[0], fixed[1]], Dual2_64::from_re(t).derivative());
        let variable = |i: usize| Dual2SVec64::<2>::from_re(X[i]).derivative(i);
        let u = self.displacement([variable(0), variable(1)], Dual2SVec64::from_re(t));
        // F with its gradient, which the Hessian of u holds.
        let mut F = [[DualSVec64::<2>::from_re(0.0); 2]; 2];
        for i in 0..2 {
            let gradient = u[i].v1.unwrap_generic(Const::<1>, Const::<2>);
            let hessian = u[i].v2.unwrap_generic(Const::<2>, Const::<2>);
            for J in 0..2 {
                let unit = if i == J { 1.0 } else { 0.0 };
                let slope = Derivative::some(hessian.column(J).into_owned());
                F[i][J] = DualSVec64::new(unit + gradient[J], slope);
            }
        }
        let P = self.stress(F);
        Vector::from_fn(|i, _| {
            let divergence: f64 =
                (0..2).map(|J| P[i][J].eps.unwrap_generic(Const::<2>, Const::<1>)[J]).sum();
            moving[i].v2 - divergence / self.rho
        })
    }
}

fn ring() -> Ring<f64> {
    Ring::new(RingParameters::default()).unwrap()
}

/// Points throughout the ring, the same in every run.
fn points() -> Vec<Vector> {
    (0..POINTS)
        .map(|n| {
            let R = 0.5 + 0.5 * (n as f64 + 0.5) / POINTS as f64;
            let theta = 2.0 * PI * (0.618_033_988_749_894_9 * n as f64).fract();
            Vector::new(R * theta.cos(), R * theta.sin())
        })
        .collect()
}

#[divan::bench]
fn generated_at_kept_points(bencher: Bencher<'_, '_>) {
    let ring = ring();
    let kept = ring.body_force_at(&points());
    let mut b = vec![Vector::zeros(); POINTS];
    bencher.counter(ItemsCount::new(POINTS)).bench_local(|| {
        kept.evaluate(black_box(TIME), 0, &mut b);
        black_box(&mut b);
    });
}

/// Evaluates each point by itself; the time is hidden from the compiler, so that nothing is shared between calls.
fn each(bencher: Bencher<'_, '_>, body_force: impl Fn(&Vector, f64) -> Vector) {
    let X = points();
    let mut b = vec![Vector::zeros(); POINTS];
    bencher.counter(ItemsCount::new(POINTS)).bench_local(|| {
        for (b, X) in b.iter_mut().zip(&X) {
            *b = body_force(X, black_box(TIME));
        }
        black_box(&mut b);
    });
}

#[divan::bench]
fn generated_single_call(bencher: Bencher<'_, '_>) {
    let ring = ring();
    each(bencher, |X, t| ring.body_force(X, t));
}

#[divan::bench]
fn maple_listing(bencher: Bencher<'_, '_>) {
    let case = Case::new(RingParameters::default());
    each(bencher, |X, t| case.listing(X, t));
}

#[divan::bench]
fn num_dual_at_run_time(bencher: Bencher<'_, '_>) {
    let case = Case::new(RingParameters::default());
    each(bencher, |X, t| case.automatic(X, t));
}

/// All four give the same values, to a tolerance that leaves room for the listing's rounding.
fn check() {
    let (ring, case, X) = (ring(), Case::new(RingParameters::default()), points());
    let mut kept = vec![Vector::zeros(); POINTS];
    ring.body_force_at(&X).evaluate(TIME, 0, &mut kept);
    for (X, kept) in X.iter().zip(&kept) {
        let single = ring.body_force(X, TIME);
        for (way, other) in [
            ("at kept points", *kept),
            ("listing", case.listing(X, TIME)),
            ("num-dual", case.automatic(X, TIME)),
        ] {
            let difference = (other - single).norm() / single.norm();
            assert!(difference < 1e-12, "{way} at {X}: {difference:e}");
        }
    }
}

fn main() {
    check();
    divan::main();
}
