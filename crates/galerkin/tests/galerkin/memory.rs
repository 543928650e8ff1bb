//! Laws with internal variables: orders against an exact solution, the same bits after resumes and with any number of threads, and in
//! curvilinear coordinates what is found in Cartesian ones.

#![allow(clippy::unwrap_used)]

use std::f64::consts::PI;

use mmsmith_galerkin::{
    Axis, Composition, Coordinates, End, Grid, Layout, MassMatrix, Scheme, TotalLagrangian,
};
use mmsmith_laws::Material;
use mmsmith_laws::{
    BLOCK, Element, Flow, Increment, InternalVariable, Law, LawWithMemory, Memory, ReturnMap,
    WithMemory, with_memory,
};
use mmsmith_particles::NoBodyForce;
use nalgebra::{SVector, Vector1};

const STIFF: f64 = 1.0;
const VISCOUS: f64 = 0.8;
const RELAXATION: f64 = 0.3;
const AMPLITUDE: f64 = 0.02;
const FREQUENCY: f64 = 2.0;

/// Springs side by side, one of them behind a dashpot: `P = k (F - 1) + g (F - 1 - q)` and `dq/dt = (F - 1 - q) / tau`.
#[derive(Debug)]
struct Springs;

impl LawWithMemory<f64, 1> for Springs {
    fn variables(&self) -> Vec<InternalVariable> {
        vec![InternalVariable { name: "q".into(), at_rest: 0.0 }]
    }

    fn first_piola_kirchhoff(
        &self,
        F: &[[[f64; BLOCK]; 1]; 1],
        q: &[[f64; BLOCK]],
        P: &mut [[[f64; BLOCK]; 1]; 1],
    ) {
        for n in 0..BLOCK {
            let H = F[0][0][n] - 1.0;
            P[0][0][n] = STIFF * H + VISCOUS * (H - q[0][n]);
        }
    }

    fn evolve(&self, increment: &Increment<'_, f64, 1>, q: &mut [[f64; BLOCK]]) {
        let Increment { start, end, time } = *increment;
        let share = 0.5 * time / RELAXATION;
        for (n, q) in q[0].iter_mut().enumerate() {
            let mean = 0.5 * (start[0][0][n] + end[0][0][n]) - 1.0;
            *q = (*q * (1.0 - share) + 2.0 * share * mean) / (1.0 + share);
        }
    }
}

/// The factor of q in time where that of the strain is `sin(w t)`.
fn memory(t: f64) -> f64 {
    let (w, tau) = (FREQUENCY, RELAXATION);
    ((w * t).sin() - w * tau * (w * t).cos() + w * tau * (-t / tau).exp())
        / (1.0 + w * w * tau * tau)
}

/// `u = A sin(Pi X) sin(w t)` in a bar of density 1 between two walls.
fn body_force(X: &[Vector1<f64>], t: f64, b: &mut [Vector1<f64>]) {
    for (b, X) in b.iter_mut().zip(X) {
        let in_time = (FREQUENCY * t).sin();
        let stress = STIFF * in_time + VISCOUS * (in_time - memory(t));
        b[0] = AMPLITUDE * (PI * X[0]).sin() * (PI * PI * stress - FREQUENCY * FREQUENCY * in_time);
    }
}

/// The largest errors of `u` and `q` at time one.
fn errors(degree: usize, cells: usize, steps: usize) -> [f64; 2] {
    let grid = Grid {
        axes: [Axis { lower: 0.0, upper: 1.0, cells, ends: [End::Wall; 2] }],
        coordinates: Coordinates::Cartesian,
        per_cell: 4,
        layout: Layout::Lattice,
    };
    let scheme = Scheme { degree, mass: MassMatrix::Consistent, composition: Composition::Order4 };
    let dt = 1.0 / steps as f64;
    let mut bar = TotalLagrangian::new(grid, scheme, Law::with_memory(Springs), 1.0, dt).unwrap();
    // Stages that go back in time are not for laws with memory.
    assert_eq!(bar.scheme().composition, Composition::Order2);
    let X = bar.positions().to_vec();
    let v: Vec<_> =
        X.iter().map(|X| Vector1::new(AMPLITUDE * FREQUENCY * (PI * X[0]).sin())).collect();
    bar.start(&vec![SVector::zeros(); X.len()], &v).unwrap();
    for _ in 0..steps {
        bar.step(&body_force).unwrap();
    }
    let t = bar.time();
    let p = bar.observe();
    let mut errors = [0.0_f64; 2];
    for k in 0..p.len() {
        let angle = PI * p.X[k][0];
        let u = AMPLITUDE * angle.sin() * (FREQUENCY * t).sin();
        let q = AMPLITUDE * PI * angle.cos() * memory(t);
        errors[0] = errors[0].max((p.x[k][0] - p.X[k][0] - u).abs());
        errors[1] = errors[1].max((p.internal[k] - q).abs());
    }
    errors
}

#[test]
fn displacements_and_internal_variables_converge_to_the_exact_ones() {
    // Steps as the cell, and as its square. A memory of gradients is an order behind displacements by cubic splines.
    for (degree, power, expected) in [(2, 1, [1.95; 2]), (3, 2, [3.8, 2.9])] {
        let [coarse, fine] =
            [8, 16].map(|cells: usize| errors(degree, cells, 4 * cells.pow(power)));
        for (k, what) in ["u", "q"].into_iter().enumerate() {
            let order = (coarse[k] / fine[k]).log2();
            assert!(order > expected[k], "{what} {degree}: {order:.2}, {coarse:?} {fine:?}");
        }
        println!("{degree}: {coarse:?} {fine:?}");
    }
}

/// Flow that depends on its rate, and Maxwell elements.
fn laws() -> [Law<f64, 2>; 2] {
    let overstress = Some(mmsmith_laws::Overstress { drag: 3.0, exponent: 2.0, time: 0.5 });
    let flow =
        Flow { yield_stress: 1.0, modulus: 4.0, exponent: 1.0, overstress, is_on_yield: false };
    let of_flow = WithMemory {
        elastic: Material::Hencky { lambda: 60.0, mu: 40.0 },
        memory: Memory::Flow(flow),
    };
    let elements = vec![Element { share: 0.3, time: 0.05 }, Element { share: 0.2, time: 0.4 }];
    let of_elements = WithMemory {
        elastic: Material::Gent {
            mu: 40.0,
            Jm: 20.0,
            kappa: 80.0,
            volumetric: mmsmith_laws::Volumetric::Logarithmic,
        },
        memory: Memory::Maxwell(elements),
    };
    [of_flow, of_elements].map(|law| with_memory(law, ReturnMap::Midpoint).unwrap())
}

/// A body that is set in motion by waves, in a part of a ring or a square.
fn moving(coordinates: Coordinates, law: Law<f64, 2>) -> TotalLagrangian<2> {
    let ends = [End::FREE; 2];
    let (lower, upper) = match coordinates {
        Coordinates::Polar => ([0.5, 0.2], [1.0, 1.4]),
        _ => ([0.0; 2], [1.0; 2]),
    };
    let axes = [0, 1].map(|k| Axis { lower: lower[k], upper: upper[k], cells: 6, ends });
    let grid = Grid { axes, coordinates, per_cell: 4, layout: Layout::Gauss };
    let scheme =
        Scheme { degree: 2, mass: MassMatrix::Consistent, composition: Composition::Order2 };
    let mut body = TotalLagrangian::new(grid, scheme, law, 2.0, 2e-3).unwrap();
    let X = body.positions().to_vec();
    let v: Vec<_> =
        X.iter().map(|X| SVector::from([(2.0 * X[1]).sin(), (1.5 * X[0]).cos()])).collect();
    body.start(&vec![SVector::zeros(); X.len()], &v).unwrap();
    body
}

#[test]
fn internal_variables_have_the_same_bits_after_resumes_and_for_any_number_of_threads() {
    for law in laws() {
        for coordinates in [Coordinates::Cartesian, Coordinates::Polar] {
            let run = |threads: usize, resumes: bool| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| {
                    let mut body = moving(coordinates, law.clone());
                    for step in 0..30 {
                        if resumes && step % 12 == 7 {
                            let saved = body.state().into_iter().map(<[u8]>::to_vec).collect();
                            body = moving(coordinates, law.clone());
                            body.take_up(&[saved]).unwrap();
                        }
                        body.step(&NoBodyForce).unwrap();
                    }
                    let p = body.observe();
                    let bits: Vec<u64> = p.internal.iter().map(|q| q.to_bits()).collect();
                    let x: Vec<u64> = p.x.iter().flatten().map(|x| x.to_bits()).collect();
                    let alpha =
                        p.internal.iter().skip(6).step_by(7).fold(0.0_f64, |a, b| a.max(*b));
                    assert!(alpha > 1e-4, "{alpha}");
                    (bits, x)
                })
            };
            let once = run(1, false);
            assert!(once == run(3, false), "threads: {law:?}");
            assert!(once == run(1, true), "resumed: {law:?}");
        }
    }
}

/// One field of motion at one place: stresses and internal variables are Cartesian in both.
#[test]
fn internal_variables_are_cartesian_in_curvilinear_coordinates() {
    for law in laws() {
        let mut body = moving(Coordinates::Polar, law.clone());
        for _ in 0..20 {
            body.step(&NoBodyForce).unwrap();
        }
        let p = body.observe();
        let variables = law.variables().len();
        // By the observed deformation gradients, which are Cartesian: stresses with a symmetric `P F^T`, and `G` that turns with nothing.
        let mut largest = 0.0_f64;
        for (F, q) in p.F.iter().zip(p.internal.chunks(variables)) {
            let tau = law.with_variables(q).kirchhoff(F).unwrap();
            let off = (tau[(0, 1)] - tau[(1, 0)]).abs();
            assert!(off < 1e-12 * tau.norm(), "{law:?}: {tau}");
            largest = largest.max(tau.norm());
        }
        assert!(largest > 1.0, "{largest}");
    }
}
