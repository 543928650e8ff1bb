//! Laws with internal variables: orders against an exact solution, and the same bits after sorts, resumes and with any number of threads.

#![allow(clippy::unwrap_used)]

use std::f64::consts::PI;

use mmsmith_mpm::{
    BLOCK, Body, Grid, Increment, Integrator, InternalVariable, Law, LawWithMemory, Settings,
    Shape, Simulation, Transfer,
};
use nalgebra::{SVector, Vector1};

const STIFF: f64 = 1.0;
const VISCOUS: f64 = 0.8;
const RELAXATION: f64 = 0.3;
const AMPLITUDE: f64 = 0.02;
const FREQUENCY: f64 = 2.0;

/// Springs side by side, one of them behind a dashpot: `P = k (F - I) + g (F - I - q)` and `dq/dt = (F - I - q) / tau`, entry by entry. It
/// is not objective, which no test here asks for.
#[derive(Debug)]
struct Maxwell;

impl<const D: usize> LawWithMemory<f64, D> for Maxwell {
    fn variables(&self) -> Vec<InternalVariable> {
        (0..D * D).map(|k| InternalVariable { name: format!("q{k}"), at_rest: 0.0 }).collect()
    }

    fn first_piola_kirchhoff(
        &self,
        F: &[[[f64; BLOCK]; D]; D],
        q: &[[f64; BLOCK]],
        P: &mut [[[f64; BLOCK]; D]; D],
    ) {
        for (i, j) in (0..D * D).map(|k| (k / D, k % D)) {
            for n in 0..BLOCK {
                let H = F[i][j][n] - f64::from(u8::from(i == j));
                P[i][j][n] = STIFF * H + VISCOUS * (H - q[i * D + j][n]);
            }
        }
    }

    fn evolve(&self, increment: &Increment<'_, f64, D>, q: &mut [[f64; BLOCK]]) {
        let Increment { start, end, time } = *increment;
        let share = 0.5 * time / RELAXATION;
        for (i, j) in (0..D * D).map(|k| (k / D, k % D)) {
            for (n, q) in q[i * D + j].iter_mut().enumerate() {
                let mean = 0.5 * (start[i][j][n] + end[i][j][n]) - f64::from(u8::from(i == j));
                *q = (*q * (1.0 - share) + 2.0 * share * mean) / (1.0 + share);
            }
        }
    }
}

/// The factor of q in time, and its derivative, where that of the strain is `sin(w t)`.
fn memory(t: f64) -> f64 {
    let (w, tau) = (FREQUENCY, RELAXATION);
    ((w * t).sin() - w * tau * (w * t).cos() + w * tau * (-t / tau).exp())
        / (1.0 + w * w * tau * tau)
}

/// `u = A sin(Pi X) sin(w t)` in a bar of density 1 between two walls.
fn body_force(X: &[Vector1<f64>], t: f64, b: &mut [Vector1<f64>]) {
    for (b, X) in b.iter_mut().zip(X) {
        let sine = (PI * X[0]).sin();
        let in_time = (FREQUENCY * t).sin();
        let stress = STIFF * in_time + VISCOUS * (in_time - memory(t));
        b[0] = AMPLITUDE * sine * (PI * PI * stress - FREQUENCY * FREQUENCY * in_time);
    }
}

fn bar(cells: usize, settings: Settings<f64>) -> Simulation<f64, 1> {
    let spacing = 1.0 / cells as f64;
    let grid = Grid { lower: Vector1::new(0.0), spacing, cells: [cells], walls: [[true, true]] };
    let mut body = Body::lattice(&grid, 2, 1.0, |_| true);
    for (v, X) in body.particles.v.iter_mut().zip(&body.particles.X) {
        v[0] = AMPLITUDE * FREQUENCY * (PI * X[0]).sin();
    }
    Simulation::new(grid, body, Law::with_memory(Maxwell), settings).unwrap()
}

fn schemes() -> impl Iterator<Item = Settings<f64>> {
    let integrators = Integrator::ALL.iter().copied();
    integrators.flat_map(|integrator| {
        let pairs = [(Shape::Gimp, Transfer::Flip), (Shape::Cpdi2, Transfer::Apic)];
        pairs.into_iter().map(move |(shape, transfer)| Settings {
            shape,
            integrator,
            transfer,
            time_step: 0.0,
            halve_first_acceleration: integrator == Integrator::Cd,
        })
    })
}

/// Every integrator advances the variables once for each change of F: an update that is left out, or done twice, costs the order.
#[test]
fn displacements_and_internal_variables_converge_to_the_exact_ones() {
    for settings in schemes() {
        // Steps as the square of the spacing: the first order in time of most integrators is the second one in space.
        let errors = |cells: usize| {
            let steps = cells * cells / 2;
            let settings = Settings { time_step: 1.0 / steps as f64, ..settings };
            let mut bar = bar(cells, settings);
            for _ in 0..steps {
                bar.step(&body_force).unwrap();
            }
            let t = bar.time();
            let p = bar.particles();
            let mut errors = [0.0_f64; 2];
            for k in 0..p.len() {
                let angle = PI * p.X[k][0];
                let u = AMPLITUDE * angle.sin() * (FREQUENCY * t).sin();
                let q = AMPLITUDE * PI * angle.cos() * memory(t);
                errors[0] = errors[0].max((p.x[k][0] - p.X[k][0] - u).abs());
                errors[1] = errors[1].max((p.internal[k] - q).abs());
            }
            errors
        };
        let (coarse, fine) = (errors(16), errors(32));
        for (k, what) in ["u", "q"].into_iter().enumerate() {
            let order = (coarse[k] / fine[k]).log2();
            assert!(order > 1.7, "{what}: {order:.2}, {coarse:?} {fine:?}, {settings:?}");
        }
    }
}

/// A square that moves on, so that particles change bins.
fn square(settings: Settings<f64>) -> Simulation<f64, 2> {
    let grid = Grid {
        lower: SVector::zeros(),
        spacing: 1.0 / 24.0,
        cells: [24; 2],
        walls: [[false; 2]; 2],
    };
    let inside = |X: &SVector<f64, 2>| (0.2..0.6).contains(&X[0]) && (0.1..0.5).contains(&X[1]);
    let mut body = Body::lattice(&grid, 2, 1.0, inside);
    for (v, X) in body.particles.v.iter_mut().zip(&body.particles.X) {
        *v = SVector::from([0.1 * X[1], 0.6 + 0.2 * X[0]]);
    }
    let settings = Settings { time_step: 4e-3, ..settings };
    Simulation::new(grid, body, Law::with_memory(Maxwell), settings).unwrap()
}

#[test]
fn internal_variables_have_the_same_bits_after_resumes_and_for_any_number_of_threads() {
    let none = |_: &[SVector<f64, 2>], _: f64, b: &mut [SVector<f64, 2>]| b.fill(SVector::zeros());
    for settings in schemes() {
        let run = |threads: usize, resumes: bool| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut body = square(settings);
                for step in 0..60 {
                    if resumes && step % 25 == 24 {
                        let saved = body.state().into_iter().map(<[u8]>::to_vec).collect();
                        body = square(settings);
                        body.take_up(vec![saved]).unwrap();
                    }
                    body.step(&none).unwrap();
                }
                let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
                let p = body.particles();
                assert!(p.internal.iter().any(|q| q.abs() > 1e-4), "{settings:?}");
                (bits(&p.internal), p.x.iter().flatten().map(|x| x.to_bits()).collect::<Vec<_>>())
            })
        };
        let once = run(1, false);
        assert!(once == run(3, false), "threads: {settings:?}");
        assert!(once == run(1, true), "resumed: {settings:?}");
    }
}
