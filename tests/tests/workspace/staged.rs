//! Fields at kept points, generated and interpreted. The body force is the same to the last bit in whatever runs it is evaluated, and that of single
//! calls but for rounding; states are those of single calls to the last bit.

#![allow(clippy::unwrap_used)]

use mmsmith_interpret::{interpret, interpret_staged_single};
use mmsmith_solutions::nalgebra::SVector;
use mmsmith_solutions::{
    AnySolution, BLOCK, CATALOGUE, Description, Precision, Real, Solution, State, StateRun, build,
};
use mmsmith_spec::Spec;
use mmsmith_stage::Staged;

/// Points in the unit cube, off its faces; a body force is defined there for every solution.
fn points<T: Real, const D: usize>(count: usize) -> Vec<SVector<T, D>> {
    (0..count)
        .map(|n| {
            SVector::from_fn(|d, _| {
                let turns = 0.618_033_988_749_894_9 * n as f64 + 0.324_717_957_244_746 * d as f64;
                T::nearest(0.05 + 0.9 * turns.fract())
            })
        })
        .collect()
}

/// The points of a lattice in the unit cube, off its faces, of which enough share each coordinate.
fn lattice<T: Real, const D: usize>() -> Vec<SVector<T, D>> {
    const LAYERS: [usize; 3] = [36, 40, 9];
    let layers = |axis: usize| if D == 3 { 9 } else { LAYERS[axis] };
    // Lines need points of the same coordinate.
    let count = if D == 1 { 16 * layers(0) } else { (0..D).map(layers).product() };
    let point = |mut n: usize| {
        SVector::from_fn(|axis, _| {
            let layer = n % layers(axis);
            n /= layers(axis);
            T::nearest(0.05 + 0.9 * (layer as f64 + 0.3) / layers(axis) as f64)
        })
    };
    (0..count).map(point).collect()
}

/// Whether only the numbers of layers are kept of points.
fn has_form_for_lattices<T: Real, const D: usize>(
    solution: &dyn Solution<T, D>,
    X: &[SVector<T, D>],
) -> bool {
    solution.body_force_at(X).bytes_per_point() == size_of::<[u16; D]>()
}

/// Equal to the last bit; not-a-number counts as equal to itself.
fn same<T: Real, const D: usize>(a: &SVector<T, D>, b: &SVector<T, D>) -> bool {
    a.iter().zip(b.iter()).all(|(a, b)| a.to_f64().to_bits() == b.to_f64().to_bits())
}

/// The largest difference between body forces and those in double precision, at the same points and time.
fn error<T: Real, const D: usize>(
    found: &[SVector<T, D>],
    exact: &dyn Solution<f64, D>,
    X: &[SVector<T, D>],
    t: T,
) -> f64 {
    let errors = found.iter().zip(X).map(|(b, X)| {
        let difference =
            b.map(|b| b.to_f64()) - exact.body_force(&X.map(|X| X.to_f64()), t.to_f64());
        // Not-a-number where both are is no error.
        difference.iter().fold(0.0, |error: f64, d| error.max(d.abs()))
    });
    errors.fold(0.0, f64::max)
}

/// `exact` is the same solution in double precision.
fn compare<T: Real, const D: usize>(
    name: &str,
    solution: &dyn Solution<T, D>,
    exact: &dyn Solution<f64, D>,
) {
    let counts = [0, 1, BLOCK - 1, BLOCK, BLOCK + 1, 5 * BLOCK + 7];
    let on_lattice = Some(lattice()).filter(|X| has_form_for_lattices(solution, X));
    for X in counts.map(points::<T, D>).into_iter().chain(on_lattice) {
        let count = X.len();
        let kept = solution.body_force_at(&X);
        assert_eq!((kept.len(), kept.is_empty()), (count, count == 0), "{name}");
        let period = solution.period().to_f64();
        let times = [0.0, 0.25, 0.3217, 1.0, 1e6].map(|turns| T::nearest(turns * period));
        for t in times {
            let single: Vec<_> = X.iter().map(|X| solution.body_force(X, t)).collect();
            let mut whole = vec![SVector::zeros(); count];
            kept.evaluate(t, 0, &mut whole);
            let largest =
                single.iter().flat_map(|b| b.iter()).fold(0.0, |m: f64, b| m.max(b.to_f64().abs()));
            // Both are worked out from numbers that are rounded, which in single precision may change them by more than
            // what tells one from the other: then the errors of single calls are the measure.
            let errors = error(&single, exact, &X, t);
            let bound = 64.0 * T::default_epsilon().to_f64() * largest + 2.0 * errors;
            assert!(error(&whole, exact, &X, t) <= bound, "{name}, t = {t}: {errors}");
            for (found, expected) in whole.iter().zip(&single) {
                let close = found.iter().zip(expected.iter()).all(|(a, b)| {
                    let (a, b) = (a.to_f64(), b.to_f64());
                    (a.is_nan() && b.is_nan()) || (a - b).abs() <= bound
                });
                assert!(close, "{name}, t = {t}: {found}, not {expected}");
            }
            let numbers: Vec<u32> = (0..count as u32).rev().collect();
            let mut backwards = vec![SVector::zeros(); count];
            let mut time = Vec::new();
            kept.of_time(t, &mut time);
            kept.evaluate_of(&time, &numbers, &mut backwards);
            for (found, expected) in backwards.iter().rev().zip(&whole) {
                assert!(same(found, expected), "{name}, t = {t}: {found}, not {expected}");
            }
            let middle = count / 2;
            for (first, end) in [(middle, count), (0, middle), (middle / 2, count - middle / 2)] {
                let mut b = vec![SVector::zeros(); end.saturating_sub(first)];
                kept.evaluate(t, first, &mut b);
                for (found, expected) in b.iter().zip(&whole[first..]) {
                    assert!(same(found, expected), "{name}, t = {t}: {found}, not {expected}");
                }
            }
        }
    }
}

fn compare_states<T: Real, const D: usize>(name: &str, solution: &dyn Solution<T, D>) {
    let bits = |values: &[T]| values.iter().map(|x| x.to_f64().to_bits()).collect::<Vec<_>>();
    for count in [1, BLOCK, 3 * BLOCK + 5] {
        let X = points::<T, D>(count);
        let (kept, blocks) = (solution.state_at(&X), count.div_ceil(BLOCK));
        let times = [0.0, 0.3217, 1.0, 1e6].map(|turns| turns * solution.period().to_f64());
        for (t, lag) in times.into_iter().flat_map(|t| [(t, 0.0), (t, 1e-3 * t)]) {
            let (t, velocity_time) = (T::nearest(t), T::nearest(t - lag));
            let mut runs = vec![StateRun::zero(); blocks];
            kept.evaluate(t, velocity_time, 0, &mut runs);
            for n in 0..blocks * BLOCK {
                let X = &X[n.min(count - 1)];
                let State { u, v, F, P } = runs[n / BLOCK].get(n % BLOCK);
                for (letter, found, expected) in [
                    ("u", u.as_slice(), solution.displacement(X, t).as_slice()),
                    ("v", v.as_slice(), solution.velocity(X, velocity_time).as_slice()),
                    ("F", F.as_slice(), solution.deformation_gradient(X, t).as_slice()),
                    ("P", P.as_slice(), solution.first_piola_kirchhoff(X, t).as_slice()),
                ] {
                    assert_eq!(bits(found), bits(expected), "{letter} of {name} at {X}, t = {t}");
                }
            }
            let mut last = [StateRun::zero()];
            kept.evaluate(t, velocity_time, blocks - 1, &mut last);
            assert_eq!(bits(last[0].u.as_flattened()), bits(runs[blocks - 1].u.as_flattened()));
        }
    }
}

fn compare_both<T: Real>(name: &str, solution: AnySolution<T>, exact: AnySolution<f64>) {
    match (solution, exact) {
        (AnySolution::One(solution), AnySolution::One(exact)) => {
            compare(name, &*solution, &*exact);
            compare_states(name, &*solution);
        }
        (AnySolution::Two(solution), AnySolution::Two(exact)) => {
            compare(name, &*solution, &*exact);
            compare_states(name, &*solution);
        }
        (AnySolution::Three(solution), AnySolution::Three(exact)) => {
            compare(name, &*solution, &*exact);
            compare_states(name, &*solution);
        }
        _ => panic!("{name} has an unknown dimension"),
    }
}

fn compare_all<T: Precision>() {
    for Description { name, .. } in CATALOGUE {
        let exact = build::<f64>(name, &[]).unwrap().unwrap();
        compare_both(name, build::<T>(name, &[]).unwrap().unwrap(), exact);
    }
}

/// Where each coordinate moves along itself only, and in a few others, points of a lattice take their layers' numbers only.
#[test]
fn solutions_with_a_form_for_lattices() {
    let mut found = Vec::new();
    for Description { name, specification, .. } in CATALOGUE {
        let spec = Spec::parse(specification, name).unwrap();
        let has_form = |solution: AnySolution<f64>| match solution {
            AnySolution::One(solution) => has_form_for_lattices(&*solution, &lattice()),
            AnySolution::Two(solution) => has_form_for_lattices(&*solution, &lattice()),
            AnySolution::Three(solution) => has_form_for_lattices(&*solution, &lattice()),
            _ => panic!("{name} has an unknown dimension"),
        };
        let generated = has_form(build(name, &[]).unwrap().unwrap());
        assert_eq!(generated, has_form(interpret(&spec, []).unwrap()), "{name}");
        if generated {
            found.push(*name);
        }
    }
    assert_eq!(found, ["axis-aligned", "axis-aligned-3d", "rigid-motion", "torsion"]);
}

mod inverting {
    mmsmith_macros::manufactured_solution!("../../data/specs/inverting.toml");
}

mod three_on_a_face {
    mmsmith_macros::manufactured_solution!("../../data/specs/conditions/three-on-a-face.toml");
}

/// Generated code and the interpreter have the conditions of the file, by component.
#[test]
fn conditions_by_component_are_those_of_the_file() {
    let text = include_str!("../../data/specs/conditions/three-on-a-face.toml");
    let spec = Spec::parse(text, "three-on-a-face.toml").unwrap();
    let generated = three_on_a_face::ThreeOnAFace::<f64>::new(Default::default()).unwrap();
    for solution in [interpret(&spec, []).unwrap(), generated.into()] {
        let AnySolution::Three(solution) = solution else { panic!("in space") };
        assert_eq!(solution.boundaries(), spec.boundaries);
    }
}

/// Two stretches may be negative together: then `J` has a logarithm though they have none.
#[test]
fn bodies_turned_over_twice() {
    let text = include_str!("../../data/specs/inverting.toml");
    let spec = Spec::parse(text, "inverting.toml").unwrap();
    let [mut right, mut twice, mut never] = [0; 3];
    let parameters = inverting::InvertingParameters { A: 0.9, ..Default::default() };
    let generated = inverting::Inverting::<f64>::new(parameters).unwrap();
    for solution in [interpret(&spec, [("A", 0.9)]).unwrap(), generated.into()] {
        let AnySolution::Two(solution) = solution else { panic!("in the plane") };
        let t = 0.13 * solution.period();
        let X = lattice();
        let kept = solution.body_force_at(&X);
        assert!(has_form_for_lattices(&*solution, &X));
        let mut b = vec![SVector::zeros(); X.len()];
        kept.evaluate(t, 0, &mut b);
        for (X, b) in X.iter().zip(&b) {
            let F = solution.deformation_gradient(X, t);
            let single = solution.body_force(X, t);
            if F[(0, 0)] * F[(1, 1)] < 0.0 {
                never += 1;
                assert!(b.iter().all(|b| b.is_nan()), "{b} at {X}");
                continue;
            }
            if F[(0, 0)] < 0.0 {
                twice += 1
            } else {
                right += 1
            }
            assert!((b - single).norm() <= 1e-12 * single.norm(), "{b}, not {single}, at {X}");
        }
    }
    assert!(right > 100 && twice > 100 && never > 100, "{right}, {twice}, {never}");
}

#[test]
fn double_precision() {
    compare_all::<f64>();
}

#[test]
fn single_precision() {
    compare_all::<f32>();
}

#[test]
fn interpreted() {
    for Description { name, specification, .. } in CATALOGUE {
        let spec = Spec::parse(specification, name).unwrap();
        let exact = build::<f64>(name, &[]).unwrap().unwrap();
        compare_both(name, interpret(&spec, []).unwrap(), exact);
    }
}

/// Every value that a solution gives at points and times, as bits.
fn all_bits<T: Real, const D: usize>(solution: &dyn Solution<T, D>) -> Vec<(String, Vec<u64>)> {
    let bits = |values: &[T]| values.iter().map(|x| x.to_f64().to_bits()).collect::<Vec<_>>();
    let mut all = vec![
        ("wave speed".to_owned(), bits(&[solution.wave_speed()])),
        ("period".to_owned(), bits(&[solution.period()])),
        ("density".to_owned(), bits(&[solution.density()])),
        ("cell length".to_owned(), bits(&[solution.cell_length()])),
    ];
    let period = solution.period().to_f64();
    for t in [0.0, 0.3217, 1.0, 12.4, 1e6].map(|turns| T::nearest(turns * period)) {
        for X in points::<T, D>(5 * BLOCK) {
            let at = |letter: &str| format!("{letter} at {X}, t = {t}");
            let fields = solution.fields(&X, t);
            all.extend([
                (at("u"), bits(solution.displacement(&X, t).as_slice())),
                (at("v"), bits(solution.velocity(&X, t).as_slice())),
                (at("a"), bits(solution.acceleration(&X, t).as_slice())),
                (at("H"), bits(solution.displacement_gradient(&X, t).as_slice())),
                (at("F"), bits(solution.deformation_gradient(&X, t).as_slice())),
                (at("J"), bits(&[solution.jacobian(&X, t)])),
                (at("P"), bits(solution.first_piola_kirchhoff(&X, t).as_slice())),
                (at("b"), bits(solution.body_force(&X, t).as_slice())),
                (at("b of all"), bits(fields.b.as_slice())),
                (at("P of all"), bits(fields.P.as_slice())),
                (at("W"), bits(&solution.strain_energy(&X, t).into_iter().collect::<Vec<_>>())),
            ]);
            for boundary in solution.boundaries() {
                let traction = solution.traction(boundary.surface, &X, t);
                let traction: Vec<T> = traction.iter().flatten().copied().collect();
                all.push((at(&format!("traction on {:?}", boundary.surface)), bits(&traction)));
            }
        }
        for (way, X) in [("points", points::<T, D>(7 * BLOCK + 3)), ("lattice", lattice())] {
            let mut b = vec![SVector::zeros(); X.len()];
            solution.body_force_at(&X).evaluate(t, 0, &mut b);
            let b: Vec<T> = b.iter().flatten().copied().collect();
            all.push((format!("b of {way}, t = {t}"), bits(&b)));
        }
        let X = points::<T, D>(BLOCK);
        let mut run = [StateRun::zero()];
        solution.state_at(&X).evaluate(t, t, 0, &mut run);
        all.push((format!("u, t = {t}"), bits(run[0].u.as_flattened())));
        all.push((format!("v, t = {t}"), bits(run[0].v.as_flattened())));
        all.push((format!("F, t = {t}"), bits(run[0].F.as_flattened().as_flattened())));
        all.push((format!("P, t = {t}"), bits(run[0].P.as_flattened().as_flattened())));
    }
    all
}

fn bits_of<T: Real>(solution: &AnySolution<T>) -> Vec<(String, Vec<u64>)> {
    match solution {
        AnySolution::One(solution) => all_bits(&**solution),
        AnySolution::Two(solution) => all_bits(&**solution),
        AnySolution::Three(solution) => all_bits(&**solution),
        _ => panic!("an unknown dimension"),
    }
}

/// One pipeline makes both, and both call the same functions.
#[test]
fn generated_and_interpreted_have_the_same_bits() {
    fn compare(name: &str, generated: &[(String, Vec<u64>)], interpreted: &[(String, Vec<u64>)]) {
        assert_eq!(generated.len(), interpreted.len());
        for ((what, generated), (_, interpreted)) in generated.iter().zip(interpreted) {
            assert_eq!(generated, interpreted, "{name}: {what}");
        }
    }
    for Description { name, specification, .. } in CATALOGUE {
        let spec = Spec::parse(specification, name).unwrap();
        let generated = bits_of(&build::<f64>(name, &[]).unwrap().unwrap());
        compare(name, &generated, &bits_of(&interpret(&spec, []).unwrap()));
        let generated = bits_of(&build::<f32>(name, &[]).unwrap().unwrap());
        let staged = Staged::of(&spec, spec.derive().unwrap());
        let interpreted = interpret_staged_single(&spec, &staged, []).unwrap();
        compare(name, &generated, &bits_of(&interpreted));
    }
}

#[test]
#[should_panic(expected = "were asked for; there are 3")]
fn points_beyond_the_last() {
    let AnySolution::Two(ring) = build::<f64>("ring", &[]).unwrap().unwrap() else { return };
    ring.body_force_at(&points(3)).evaluate(0.0, 1, &mut [SVector::zeros(); 3]);
}
