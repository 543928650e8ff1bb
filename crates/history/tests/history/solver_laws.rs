//! The solver's laws, which share no formula with the rate equations, against histories at a material point.

use mmsmith_history::Motion;
use mmsmith_history::{
    AnyLaw, Dual, Kinematics, LawWithHistory, Number, Tensor, Trajectory, divergence,
};
use mmsmith_laws::{
    BLOCK, Element, Flow, Increment, Law, LawWithMemory, Material, Memory, Overstress, ReturnMap,
    Stressed, Volumetric, WithMemory, with_memory,
};
use mmsmith_stated_law::StatedMemory;
use mmsmith_vocabulary::{Components, Internal, Law as Stating, Response, Stated};
use nalgebra::{Matrix3, SMatrix, SVector};
use std::sync::Arc;

const LAMBDA: f64 = 5769.0;
const MU: f64 = 3846.0;
const YIELD: f64 = 50.0;

/// Shear and stretch, in space or in the plane, from a state at rest.
fn motion(dimension: usize) -> impl Fn(f64) -> Kinematics<Dual<f64, 1>> + Sync {
    let mut along = match dimension {
        1 => Matrix3::from_diagonal(&[0.08, 0.0, 0.0].into()),
        2 => Matrix3::new(0.06, 0.05, 0.0, 0.02, -0.05, 0.0, 0.0, 0.0, 0.0),
        _ => Matrix3::new(0.06, 0.05, 0.03, 0.02, -0.05, -0.04, 0.01, 0.03, 0.02),
    };
    let mut across = along * along;
    if dimension == 1 {
        across = along;
    }
    along *= 0.9;
    move |t| {
        let ramp = |A: f64, B: f64| along * A + across * B;
        let F = Matrix3::identity() + ramp(t + 0.3 * t * t, 8.0 * t * t * t);
        let rate = ramp(1.0 + 0.6 * t, 24.0 * t * t);
        let of = |A: Matrix3<f64>| -> Tensor<Dual<f64, 1>> {
            std::array::from_fn(|i| {
                std::array::from_fn(|j| Dual { value: A[(i, j)], slopes: [0.0] })
            })
        };
        Kinematics { F: of(F), rate: of(rate) }
    }
}

/// The internal variables and the stress at time one.
struct State {
    variables: Vec<f64>,
    P: Vec<f64>,
}

impl State {
    /// The largest differences of variables and of stresses, over the largest of each.
    fn off(&self, exact: &Self) -> [f64; 2] {
        let largest = |a: &[f64], b: &[f64]| {
            let size = b.iter().fold(0.0_f64, |most, b| most.max(b.abs()));
            a.iter().zip(b).map(|(a, b)| (a - b).abs() / size).fold(0.0, f64::max)
        };
        [largest(&self.variables, &exact.variables), largest(&self.P, &exact.P)]
    }
}

/// By the solver's law in so many steps.
fn by_steps<const D: usize>(law: &Law<f64, D>, steps: usize) -> State {
    let Law::WithMemory(law) = law else { panic!("{law:?}") };
    let law: &Arc<dyn LawWithMemory<f64, D>> = law;
    let motion = motion(D);
    let F = |t: f64| -> [[[f64; BLOCK]; D]; D] {
        let at = motion(t);
        std::array::from_fn(|i| std::array::from_fn(|j| [at.F[i][j].value; BLOCK]))
    };
    let mut q: Vec<[f64; BLOCK]> = law.variables().iter().map(|q| [q.at_rest; BLOCK]).collect();
    for step in 0..steps {
        let [start, end] = [step, step + 1].map(|k| F(k as f64 / steps as f64));
        let increment = Increment { start: &start, end: &end, time: 1.0 / steps as f64 };
        law.evolve(&increment, &mut q);
    }
    let mut P = [[[0.0; BLOCK]; D]; D];
    law.first_piola_kirchhoff(&F(1.0), &q, &mut P);
    for stress in P.iter().flatten() {
        assert!(stress.iter().all(|value| value.to_bits() == stress[0].to_bits()));
    }
    State {
        variables: q.iter().map(|q| q[0]).collect(),
        P: P.iter().flatten().map(|stress| stress[0]).collect(),
    }
}

/// By the rate equations.
fn exact<const D: usize>(law: &WithMemory<f64>) -> State
where
    f64: Stressed<D>,
{
    let own = AnyLaw::with_memory(law, D).unwrap();
    let constants = law.named_values().into_iter().map(|(_, value)| Dual::constant(value));
    let along = (motion(D), constants.collect::<Vec<Dual<f64, 1>>>());
    let found = Trajectory::new(&own, &along, &[1.0], 1e-13).unwrap();
    let z = &found.states[0];
    let (_, P) = divergence(&own, &along.0(1.0), &along.1, z);
    let of_solver: Vec<String> =
        of_solver::<D>(law, ReturnMap::default()).variables().into_iter().map(|q| q.name).collect();
    assert_eq!(own.observable_names(), of_solver);
    let variables = own.observables(&along.1, z).iter().map(|z| z.value).collect();
    State { variables, P: (0..D * D).map(|k| P[k / D][k % D]).collect() }
}

fn of_solver<const D: usize>(law: &WithMemory<f64>, map: ReturnMap) -> Law<f64, D>
where
    f64: Stressed<D>,
{
    with_memory(law.clone(), map).unwrap()
}

/// The orders of a law in the step, of variables and stresses.
fn assert_order<const D: usize>(law: &Law<f64, D>, exact: &State, order: f64, what: &str) {
    let errors = [100, 200, 400].map(|steps| by_steps(law, steps).off(exact));
    for k in 0..2 {
        for pair in errors.windows(2) {
            let found = (pair[0][k] / pair[1][k]).log2();
            assert!((found - order).abs() < 0.15, "{what} {D}D {k}: {errors:?} {found}");
        }
    }
}

fn flow_of(flow: Flow<f64>) -> WithMemory<f64> {
    let elastic = Material::Hencky { lambda: LAMBDA, mu: MU };
    WithMemory { elastic, memory: Memory::Flow(flow) }
}

fn check_flow<const D: usize>(flow: Flow<f64>, what: &str)
where
    f64: Stressed<D>,
{
    let law = flow_of(flow);
    let exact = exact::<D>(&law);
    assert!(exact.variables[6] > 0.02, "{what} {D}D: {:?}", exact.variables);
    for (map, order) in [(ReturnMap::Exponential, 1.0), (ReturnMap::Midpoint, 2.0)] {
        // On a line the direction of flow does not change, and backward Euler has no error in it.
        if D == 1 && flow.overstress.is_none() {
            let off = by_steps(&of_solver::<D>(&law, map), 50).off(&exact);
            assert!(off.iter().all(|off| *off < 1e-10), "{what}: {off:?}");
            continue;
        }
        assert_order(&of_solver::<D>(&law, map), &exact, order, &format!("{what} {map:?}"));
    }
}

const PLASTIC: Flow<f64> = Flow {
    yield_stress: YIELD,
    modulus: 500.0,
    exponent: 1.0,
    overstress: None,
    is_on_yield: true,
};

#[test]
fn plastic_flow_has_its_orders() {
    for (flow, what) in [
        (PLASTIC, "linear"),
        (Flow { modulus: 0.0, ..PLASTIC }, "perfect"),
        (Flow { modulus: 80.0, exponent: 1.0 / 3.0, ..PLASTIC }, "power"),
    ] {
        check_flow::<1>(flow, what);
        check_flow::<2>(flow, what);
        check_flow::<3>(flow, what);
    }
}

#[test]
fn viscous_flow_has_its_orders() {
    let over = |drag, exponent, time| Some(Overstress { drag, exponent, time });
    let creep = Flow {
        yield_stress: 0.0,
        modulus: 0.0,
        exponent: 1.0,
        overstress: over(100.0, 2.0, 2.0),
        is_on_yield: false,
    };
    for (flow, what) in [
        (Flow { overstress: over(40.0, 1.0, 3.0), ..PLASTIC }, "perzyna 1"),
        (Flow { overstress: over(60.0, 3.0, 3.0), ..PLASTIC }, "perzyna 3"),
        (creep, "norton"),
    ] {
        check_flow::<1>(flow, what);
        check_flow::<2>(flow, what);
        check_flow::<3>(flow, what);
    }
}

#[test]
fn maxwell_elements_have_second_order() {
    fn check<const D: usize>(elastic: Material<f64>)
    where
        f64: Stressed<D>,
    {
        let elements = vec![Element { share: 0.3, time: 0.2 }, Element { share: 0.2, time: 0.7 }];
        let law = WithMemory { elastic, memory: Memory::Maxwell(elements) };
        let solver = of_solver::<D>(&law, ReturnMap::default());
        assert_order(&solver, &exact::<D>(&law), 2.0, elastic.row().name);
    }
    let volumetric = Volumetric::Mixed;
    for elastic in [
        Material::Yeoh { c1: 0.5 * MU, c2: 0.1 * MU, c3: 0.03 * MU, kappa: LAMBDA, volumetric },
        Material::Gent { mu: MU, Jm: 2.3, kappa: LAMBDA, volumetric },
        Material::ArrudaBoyce { mu: MU, N: 5.0, kappa: LAMBDA, volumetric },
        Material::LinearElastic { lambda: LAMBDA, mu: MU },
    ] {
        check::<1>(elastic);
        check::<2>(elastic);
        check::<3>(elastic);
    }
}

/// Linear elasticity with elements: the deviator of the stress relaxes, `s' + s/tau = 2 mu g e'` each.
#[test]
fn prony_series_of_linear_elasticity_have_second_order() {
    let (share, time) = (0.4, 0.3);
    let law = WithMemory {
        elastic: Material::LinearElastic { lambda: LAMBDA, mu: MU },
        memory: Memory::Maxwell(vec![Element { share, time }]),
    };
    let law: Law<f64, 2> = with_memory(law, ReturnMap::default()).unwrap();
    let motion = motion(2);
    let strain = |t: f64| {
        let F = Matrix3::from_fn(|i, j| motion(t).F[i][j].value);
        (F + F.transpose()) * 0.5 - Matrix3::identity()
    };
    let rate = |t: f64| {
        let rate = Matrix3::from_fn(|i, j| motion(t).rate[i][j].value);
        let d = (rate + rate.transpose()) * 0.5;
        (d - Matrix3::identity() * (d.trace() / 3.0)) * (2.0 * MU)
    };
    // The integral of exp(-(1 - s)/tau) g s_el'(s) by Simpson's rule.
    let count = 2000;
    let Q: Matrix3<f64> = (0..=count)
        .map(|k| {
            let s = f64::from(k) / f64::from(count);
            let weight = if k == 0 || k == count { 1.0 } else { f64::from(2 + 2 * (k % 2)) };
            rate(s) * (share * (-(1.0 - s) / time).exp() * weight / (3.0 * f64::from(count)))
        })
        .sum();
    let e = strain(1.0);
    let deviator = (e - Matrix3::identity() * (e.trace() / 3.0)) * (2.0 * MU);
    let bulk = LAMBDA + 2.0 * MU / 3.0;
    let P = Matrix3::identity() * (bulk * e.trace()) + deviator * (1.0 - share) + Q;
    let variables = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].map(|at| Q[at]).to_vec();
    let exact = State { variables, P: (0..4).map(|k| P[(k / 2, k % 2)]).collect() };
    assert_order(&law, &exact, 2.0, "prony");
}

/// The place at which laws of text are looked at.
const PLACE: [f64; 2] = [0.3, 0.7];

/// A motion, with constants, coordinates and the time in the order that a law of text names them in.
struct WithPlaces {
    constants: Vec<(String, f64)>,
    names: Vec<String>,
}

impl Motion<1> for WithPlaces {
    fn at(&self, time: f64) -> Kinematics<Dual<f64, 1>> {
        motion(2)(time)
    }

    fn constants(&self, time: f64, constants: &mut Vec<Dual<f64, 1>>) {
        constants.extend(self.names.iter().map(|name| {
            let known = self.constants.iter().find(|(own, _)| own == name);
            Dual::constant(match name.as_str() {
                "X" => PLACE[0],
                "Y" => PLACE[1],
                "t" => time,
                name => known.unwrap_or_else(|| panic!("{name}")).1,
            })
        }));
    }
}

/// A law of text in so many steps.
fn text_by_steps(law: &Stated<f64>, steps: usize) -> State {
    let Stated { response, constants, given, internal, .. } = law;
    let own = StatedMemory::<f64>::new(2, response, constants, given, internal).unwrap();
    let motion = motion(2);
    let F = |t: f64| {
        let at = motion(t);
        [0, 1].map(|i| [0, 1].map(|j| [at.F[i][j].value; 2]))
    };
    let rate = SMatrix::<f64, 2, 2>::from_fn(|i, j| motion(0.0).rate[i][j].value);
    let mut start = own.initial(&SVector::<f64, 2>::from(PLACE));
    own.start_at_rate(&rate, &mut start);
    let mut q: Vec<[f64; 2]> = start.iter().map(|&value| [value; 2]).collect();
    for step in 0..steps {
        let [start, end] = [step, step + 1].map(|k| F(k as f64 / steps as f64));
        own.evolve(&start, &end, 1.0 / steps as f64, &mut q);
    }
    let mut P = [[[0.0; 2]; 2]; 2];
    own.first_piola_kirchhoff(&F(1.0), &q, &mut P);
    State {
        variables: q[..internal.len()].iter().map(|q| q[0]).collect(),
        P: P.iter().flatten().map(|stress| stress[0]).collect(),
    }
}

/// Laws that are stated in text, with internal variables, given fields and rates.
#[test]
fn laws_of_text_have_second_order() {
    let internal = |name: &str, rate: &str, initial: &str| Internal {
        name: name.into(),
        rate: rate.into(),
        initial: initial.into(),
    };
    let stated = |response, internal| Stated {
        response,
        components: Components::Cartesian,
        constants: [("lambda", LAMBDA), ("mu", MU), ("tau", 0.4), ("eta", 200.0)]
            .map(|(name, value)| (name.to_owned(), value))
            .to_vec(),
        given: vec![
            ("theta".into(), "20 + 5*X*cos(t)".into()),
            ("soft".into(), "theta/(20 + Y)".into()),
        ],
        internal,
        across: None,
    };
    let energy = "soft*(1 - q/3 - r)*mu/2*(I1 - 3 - 2*ln(J)) + lambda/2*ln(J)^2";
    let by_energy = stated(
        Response::Energy(energy.into()),
        vec![
            internal("q", "(C12 + J*Jdot/10 + d12 - q)/tau", "X*Y/10"),
            internal("r", "q*Fdot11*theta/20", "0"),
        ],
    );
    let rows = [
        ["mu*(F11 - 1/F11) + eta*d11*soft", "mu*F12 + eta*Fdot12"],
        ["mu*F21 + eta*d12 - q", "mu*(F22 - 1) + eta*Jdot"],
    ];
    let rows = rows.map(|row| row.map(String::from).to_vec()).to_vec();
    let by_stress = stated(Response::Stress(rows), vec![internal("q", "mu*d12 - q/tau", "theta")]);
    for law in [by_energy, by_stress] {
        let own = AnyLaw::new(&Stating::Stated(law.clone()), 2).unwrap();
        let along = WithPlaces { constants: law.constants.clone(), names: own.constants() };
        let found = Trajectory::new(&own, &along, &[1.0], 1e-13).unwrap();
        let mut constants = Vec::new();
        along.constants(1.0, &mut constants);
        let (_, P) = divergence(&own, &along.at(1.0), &constants, &found.states[0]);
        let exact = State {
            variables: found.states[0].iter().map(|z| z.value).collect(),
            P: (0..4).map(|k| P[k / 2][k % 2]).collect(),
        };
        let errors = [100, 200, 400].map(|steps| text_by_steps(&law, steps).off(&exact));
        for k in 0..2 {
            for pair in errors.windows(2) {
                let order = (pair[0][k] / pair[1][k]).log2();
                assert!((order - 2.0).abs() < 0.15, "{law:?} {k}: {errors:?} {order}");
            }
        }
    }
}

/// A step that ends with stresses has the bits of its two halves, whether particles of the block flow or not.
#[test]
fn steps_to_stresses_have_the_bits_of_steps_and_stresses() {
    fn check<const D: usize>(law: &WithMemory<f64>, map: ReturnMap)
    where
        f64: Stressed<D>,
    {
        let law = of_solver::<D>(law, map);
        let Law::WithMemory(law) = &law else { panic!("{law:?}") };
        let motion = motion(D);
        let F = |t: f64| -> [[[f64; BLOCK]; D]; D] {
            std::array::from_fn(|i| {
                std::array::from_fn(|j| {
                    std::array::from_fn(|n| motion(t * n as f64 / BLOCK as f64).F[i][j].value)
                })
            })
        };
        let bits = |rows: &[[f64; BLOCK]]| -> Vec<u64> {
            rows.iter().flatten().map(|value| value.to_bits()).collect()
        };
        let start: Vec<[f64; BLOCK]> = law.variables().iter().map(|q| [q.at_rest; BLOCK]).collect();
        let (mut together, mut apart) = (start.clone(), start);
        let mut tau = [F(0.0); 2];
        let mut before = F(0.0);
        // Elastic at first, then some flow.
        for step in 1..=40 {
            let end = F(f64::from(step).powi(2) / 1600.0);
            let increment = Increment { start: &before, end: &end, time: 0.05 };
            law.evolve_to_kirchhoff(&increment, &mut together, &mut tau[0]);
            law.evolve(&increment, &mut apart);
            law.kirchhoff(&end, &apart, &mut tau[1]);
            assert_eq!(bits(&together), bits(&apart), "{law:?} {D}D step {step}");
            let [first, second] = tau.map(|tau| bits(tau.as_flattened()));
            assert_eq!(first, second, "{law:?} {D}D step {step}");
            before = end;
        }
    }
    for law in [
        flow_of(Flow { is_on_yield: false, ..PLASTIC }),
        flow_of(Flow { yield_stress: 1e6, is_on_yield: false, ..PLASTIC }),
    ] {
        for map in [ReturnMap::Exponential, ReturnMap::Midpoint] {
            check::<1>(&law, map);
            check::<2>(&law, map);
            check::<3>(&law, map);
        }
    }
}
