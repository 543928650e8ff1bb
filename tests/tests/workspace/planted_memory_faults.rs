//! Faults planted in laws with memory, one at a time: histories along a motion, which share no formula with the solver's laws, must catch
//! each of them at a material point.

#![allow(clippy::unwrap_used)]

use mmsmith_history::{AnyLaw, Dual, Kinematics, Number, Trajectory, divergence};
use mmsmith_laws::{
    BLOCK, Element, Flow, Increment, Law, Material, Memory, Overstress, ReturnMap, Volumetric,
    WithMemory, with_memory,
};
use mmsmith_mpm::fault::{self, Fault};
use nalgebra::Matrix3;

const LAMBDA: f64 = 5769.0;
const MU: f64 = 3846.0;
const STEPS: usize = 200;

/// A shear and a stretch in the plane.
fn motion(t: f64) -> Kinematics<Dual<f64, 1>> {
    let along = Matrix3::new(0.05, 0.06, 0.0, 0.02, -0.04, 0.0, 0.0, 0.0, 0.0);
    let of = |A: Matrix3<f64>| -> [[Dual<f64, 1>; 3]; 3] {
        std::array::from_fn(|i| std::array::from_fn(|j| Dual { value: A[(i, j)], slopes: [0.0] }))
    };
    let (r, rate) = (t + 0.4 * t * t, 1.0 + 0.8 * t);
    Kinematics { F: of(Matrix3::identity() + along * r), rate: of(along * rate) }
}

/// The exact stress at time one.
fn exact(law: &WithMemory<f64>) -> [f64; 4] {
    let own = AnyLaw::with_memory(law, 2).unwrap();
    let constants = law.named_values().into_iter().map(|(_, value)| Dual::constant(value));
    let along = (motion, constants.collect::<Vec<Dual<f64, 1>>>());
    let found = Trajectory::new(&own, &along, &[1.0], 1e-12).unwrap();
    let (_, P) = divergence(&own, &motion(1.0), &along.1, &found.states[0]);
    [P[0][0], P[0][1], P[1][0], P[1][1]]
}

/// The error of the solver's stress, in the largest of the exact one.
fn error(law: WithMemory<f64>, exact: [f64; 4]) -> f64 {
    let Law::WithMemory(law) = with_memory::<f64, 2>(law, ReturnMap::Midpoint).unwrap() else {
        panic!("no memory")
    };
    let F = |t: f64| {
        let at = motion(t);
        [0, 1].map(|i| [0, 1].map(|j| [at.F[i][j].value; BLOCK]))
    };
    let mut q: Vec<[f64; BLOCK]> = law.variables().iter().map(|q| [q.at_rest; BLOCK]).collect();
    for step in 0..STEPS {
        let [start, end] = [step, step + 1].map(|k| F(k as f64 / STEPS as f64));
        let increment = Increment { start: &start, end: &end, time: 1.0 / STEPS as f64 };
        law.evolve(&increment, &mut q);
    }
    let mut P = [[[0.0; BLOCK]; 2]; 2];
    law.first_piola_kirchhoff(&F(1.0), &q, &mut P);
    let found = [P[0][0][0], P[0][1][0], P[1][0][0], P[1][1][0]];
    let size = exact.iter().fold(0.0_f64, |most, P| most.max(P.abs()));
    // A stress that is no number is as wrong as can be.
    let off = |(a, b): (&f64, f64)| if a.is_nan() { f64::INFINITY } else { (a - b).abs() / size };
    found.iter().zip(exact).map(off).fold(0.0, f64::max)
}

/// Each fault is caught where the sound law passes.
fn all_are_caught(faults: &[Fault], law: &WithMemory<f64>) {
    let exact = exact(law);
    let sound = error(law.clone(), exact);
    assert!(sound < 1e-5, "{law:?}: {sound:e}");
    for &fault in faults {
        let found = fault::with(fault, || error(law.clone(), exact));
        assert!(found > 1e-3, "{fault:?} is not caught: {found:e} beside {sound:e}");
    }
}

#[test]
fn faults_of_plastic_flow_are_caught() {
    let flow = Flow {
        yield_stress: 50.0,
        modulus: 500.0,
        exponent: 1.0,
        overstress: None,
        is_on_yield: false,
    };
    let law = WithMemory {
        elastic: Material::Hencky { lambda: LAMBDA, mu: MU },
        memory: Memory::Flow(flow),
    };
    let faults = [
        Fault::YieldRootDropped,
        Fault::HardeningSign,
        Fault::PlasticStrainStays,
        Fault::AcrossDropped,
        Fault::ElasticPartAlone,
        Fault::PlasticStrainRoot,
        Fault::MultiplierWithoutHardening,
        Fault::TrialShearDropped,
    ];
    all_are_caught(&faults, &law);
}

#[test]
fn faults_of_hardening_by_a_power_and_of_viscous_flow_are_caught() {
    let flow = Flow {
        yield_stress: 50.0,
        modulus: 300.0,
        exponent: 0.5,
        overstress: None,
        is_on_yield: false,
    };
    let viscous = Flow {
        overstress: Some(Overstress { drag: 40.0, exponent: 2.0, time: 0.3 }),
        exponent: 1.0,
        ..flow
    };
    let law = |flow| WithMemory {
        elastic: Material::Hencky { lambda: LAMBDA, mu: MU },
        memory: Memory::Flow(flow),
    };
    all_are_caught(&[Fault::HardeningExponent], &law(flow));
    let faults = [Fault::OverstressTime, Fault::OverstressExponent, Fault::OverstressDrag];
    all_are_caught(&faults, &law(viscous));
}

#[test]
fn faults_of_maxwell_elements_are_caught() {
    let elements = [(0.4, 0.5), (0.2, 2.0)].map(|(share, time)| Element { share, time });
    let law = WithMemory {
        elastic: Material::Yeoh {
            c1: 0.5 * MU,
            c2: 0.0,
            c3: 0.0,
            kappa: LAMBDA,
            volumetric: Volumetric::Logarithmic,
        },
        memory: Memory::Maxwell(elements.to_vec()),
    };
    let faults = [
        Fault::RelaxationTime,
        Fault::ShareDropped,
        Fault::ElasticPartAlone,
        Fault::LastElementsDropped,
        Fault::ShareOfPressure,
        Fault::DecayDropped,
        Fault::ShareTwice,
        Fault::PushForwardDropped,
    ];
    all_are_caught(&faults, &law);
}
