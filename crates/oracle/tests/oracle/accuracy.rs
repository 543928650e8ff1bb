//! The generated functions and the interpreted programs of every specification, against the oracle.
//!
//! A few points of each class, and a short search from the worst of them; `mms check --thorough` takes as many as you like. Prints a table of the worst factor `K` of
//! the acceptance rule, by field and class of inputs.
#![allow(clippy::print_stdout, clippy::unwrap_used)]

use mmsmith_oracle::{
    Accuracy, Class, Judged, JudgedCode, LARGEST_FACTOR, LARGEST_UNITS, ROUND, Search, Worst,
};
use mmsmith_solutions::build;
use mmsmith_spec::Spec;
use std::path::Path;

/// In each class, for the further specifications.
const POINTS_OF_FURTHER: usize = 6;

/// Points in each class for the library's solutions, of which programs are judged at a quarter: the first ones of those that `.ci/long`
/// asks for by a variable of the environment.
fn points() -> usize {
    let asked = std::env::var("MMSMITH_POINTS");
    asked.map_or(12, |count| count.parse().expect("MMSMITH_POINTS is a number of points"))
}

/// How much is judged, and in which classes.
#[derive(Clone, Copy)]
struct Extent<'a> {
    classes: &'a [Class],
    points: usize,
    /// Rounds of a search that begins at the worst of the points.
    rounds: usize,
}

fn judge(
    spec: &Spec,
    way: &str,
    accuracy: &Accuracy<'_>,
    extent: Extent<'_>,
    judged: JudgedCode<'_>,
    failures: &mut Vec<String>,
) {
    let drawn: Vec<_> = extent
        .classes
        .iter()
        .map(|&class| accuracy.measure(class, extent.points, judged, &|| ()).unwrap())
        .collect();
    let mut search = Search::new(accuracy);
    for class in &drawn {
        search.begin_at(accuracy, class);
    }
    for _ in 0..extent.rounds {
        search.advance(accuracy, judged).unwrap();
    }
    for drawn in drawn {
        let class = drawn.class;
        let found =
            if extent.rounds > 0 { search.worst(accuracy, drawn, judged).unwrap() } else { drawn };
        let row: Vec<String> =
            found.worst.iter().map(|worst| format!("{:5.2e}", worst.factor)).collect();
        let remark = found.remark.unwrap_or_default();
        println!("{:<16} {way:<9} {:<14} {} {remark}", spec.name, class.name(), row.join(" "));
        assert!(found.points > 0 || found.remark.is_some(), "{}: {class:?}", spec.name);
        for worst in found.worst.iter().filter(|worst| worst.factor > LARGEST_FACTOR) {
            failures.push(format!(
                "{} ({way}): {class:?}: {}[{}] = {:?} has K = {:.3e}, not {} (sens {}), at {}",
                spec.name,
                worst.field,
                worst.entry,
                worst.result,
                worst.factor,
                worst.exact,
                worst.sensitivity,
                accuracy.place(&worst.inputs)
            ));
        }
    }
}

/// Failures beyond the bound in one specification of the library.
fn in_every_class(file: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(file).unwrap();
    let spec = match Spec::parse(&text, &file.display().to_string()) {
        Ok(spec) => spec,
        Err(error) => return vec![error.to_string()],
    };
    let mut failures = Vec::new();
    let accuracy = Accuracy::new(&spec, spec.derive().unwrap());
    let n = accuracy.dimension();
    let generated = |inputs: &[f64]| -> Result<Judged, String> {
        let solution = build(&spec.name, &inputs[n + 1..]).ok_or("not in the library")?;
        let solution = solution.map_err(|error| error.to_string())?;
        solution.each_field(&inputs[..n], inputs[n]).ok_or("wrong dimension".into())
    };
    let extent = Extent { classes: &Class::ALL, points: points(), rounds: 1 };
    judge(&spec, "generated", &accuracy, extent, &generated, &mut failures);
    let programs = accuracy.programs();
    let interpreted = |inputs: &[f64]| -> Result<Judged, String> {
        Ok(programs.iter().map(|(letter, p)| (*letter, p.evaluate(inputs))).collect())
    };
    let extent = Extent { classes: &Class::ALL, points: points() / 4, rounds: 0 };
    judge(&spec, "program", &accuracy, extent, &interpreted, &mut failures);
    failures
}

#[test]
fn every_specification_in_every_class() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../mms-specs");
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().path()).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "toml"));
    files.sort();
    println!(
        "specification, way, class: K of u, v, a, H, F, J, P, b, and of b, u, v, F, P in stages"
    );
    let failures = std::thread::scope(|scope| {
        let files: Vec<_> = files.iter().map(|file| scope.spawn(|| in_every_class(file))).collect();
        files.into_iter().flat_map(|file| file.join().unwrap()).collect::<Vec<_>>()
    });
    assert!(failures.is_empty(), "beyond K = {LARGEST_FACTOR}:\n{}", failures.join("\n"));
}

/// Far from the body functions of `3 X + Y - Z/2` and of other sums of the same coordinates nearly cancel in their answers
/// to each, and the rounding of the sums must not remain: without its correction `K` is 24 at these points.
#[test]
fn sums_of_coordinates_keep_their_digits_far_from_the_body_where_asked_for() {
    let spec = far_as_well(&of_library("skew-3d"));
    let accuracy = Accuracy::new(&spec, spec.derive().unwrap());
    let programs = accuracy.programs();
    let interpreted = |inputs: &[f64]| -> Result<Judged, String> {
        Ok(programs.iter().map(|(letter, p)| (*letter, p.evaluate(inputs))).collect())
    };
    let mut failures = Vec::new();
    let extent = Extent { classes: &[Class::Far], points: 150, rounds: 0 };
    judge(&spec, "program", &accuracy, extent, &interpreted, &mut failures);
    assert!(failures.is_empty(), "beyond K = {LARGEST_FACTOR}:\n{}", failures.join("\n"));
    let near = of_library("skew-3d");
    let accuracy = Accuracy::new(&near, near.derive().unwrap());
    assert!(accuracy.not_applicable(Class::Far).is_some());
}

/// The specification with digits for places far outside of its body.
fn far_as_well(spec: &Spec) -> Spec {
    let text = format!("range-of-inputs = 'wide'\n{}", spec.source);
    Spec::parse(&text, &spec.name).unwrap()
}

/// Where a specification loses digits until it is mended. K is 16 of the stress along the axis of the tube, beside a stretch of 1e-5 in a
/// sheared plane, of which the law takes the logarithm by the ratio of both.
const OPEN: [(&str, Class); 1] = [("tube-hencky", Class::NearInversion)];

/// Failures beyond the bound in the specifications of a folder, by the programs alone.
fn by_programs(folder: &str, classes: &[Class], rounds: usize) -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/specs").join(folder);
    let mut files: Vec<_> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|file| file.unwrap().path())
        .filter(|f| f.extension().is_some_and(|e| e == "toml"))
        .collect();
    files.sort();
    assert!(!files.is_empty(), "{folder:?}");
    let mut failures = Vec::new();
    for file in files {
        let text = std::fs::read_to_string(&file).unwrap();
        let spec = Spec::parse(&text, &file.display().to_string()).unwrap();
        let accuracy = Accuracy::new(&spec, spec.derive().unwrap());
        let programs = accuracy.programs();
        let interpreted = |inputs: &[f64]| -> Result<Judged, String> {
            Ok(programs.iter().map(|(letter, p)| (*letter, p.evaluate(inputs))).collect())
        };
        let is_open = |class: &Class| OPEN.contains(&(spec.name.as_str(), *class));
        let classes: Vec<Class> = classes.iter().copied().filter(|class| !is_open(class)).collect();
        let extent = Extent { classes: &classes, points: POINTS_OF_FURTHER, rounds };
        judge(&spec, "program", &accuracy, extent, &interpreted, &mut failures);
    }
    failures
}

/// Laws that no solution of the library has.
#[test]
#[ignore = "takes a quarter of a minute; .ci/long has it"]
fn further_specifications() {
    let failures = by_programs("materials", &Class::ALL, 0);
    assert!(failures.is_empty(), "beyond K = {LARGEST_FACTOR}:\n{}", failures.join("\n"));
}

/// Fronts that have passed, and volumes that do not change: K was 1e14 and 400 before the derivation knew of them.
#[test]
fn specifications_whose_terms_nearly_cancel() {
    let failures = by_programs("digits", &Class::ALL, 0);
    assert!(failures.is_empty(), "beyond K = {LARGEST_FACTOR}:\n{}", failures.join("\n"));
}

/// Every function, law and kind of coordinates, with Poisson's ratio as a parameter. Those that lose digits are in the folder `open`
/// until they are mended.
#[test]
fn specifications_for_the_search() {
    let failures = by_programs("attack", &Class::ALL, 1);
    assert!(failures.is_empty(), "beyond K = {LARGEST_FACTOR}:\n{}", failures.join("\n"));
}

/// The code of a solution of the library.
fn generated(spec: &Spec) -> impl Fn(&[f64]) -> Result<Judged, String> + Sync + use<'_> {
    |inputs: &[f64]| {
        let (place, parameters) = inputs.split_at(spec.dimension + 1);
        let solution = build(&spec.name, parameters).ok_or("not in the library")?;
        let solution = solution.map_err(|error| error.to_string())?;
        let (X, t) = place.split_at(spec.dimension);
        solution.each_field(X, t[0]).ok_or("wrong dimension".into())
    }
}

fn of_library(name: &str) -> Spec {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../mms-specs");
    let text = std::fs::read_to_string(folder.join(name).with_extension("toml")).unwrap();
    Spec::parse(&text, name).unwrap()
}

/// Where `J = 1` for every motion, the pressure of a body that is nearly incompressible is no part of any sum: K was 400.
#[test]
fn the_vortex_keeps_its_digits_next_to_incompressibility() {
    let spec = of_library("vortex");
    let accuracy = Accuracy::new(&spec, spec.derive().unwrap());
    let code = generated(&spec);
    for nu in [0.4999, 0.499_999_99] {
        for step in 0..40 {
            let angle = 0.03 * f64::from(step) + 0.1;
            let (X, Y) = (1.017 * angle.cos(), 1.017 * angle.sin());
            let t = 0.013 * f64::from(step) + 0.02;
            for worst in accuracy.at(&[X, Y, t, 1.0, 1e3, nu, 1e3], &code).unwrap() {
                assert!(worst.factor <= LARGEST_FACTOR, "{worst:?}");
                assert!(!worst.outside);
            }
        }
    }
}

/// Values computed once a point and once a step leave the digits that a single call has: over one denominator `K` was 1365 where two
/// stretches are negative, and 16 to 27 in a body that is as large.
#[test]
fn staged_body_forces_keep_the_digits_of_single_ones() {
    for (name, places) in
        [("sphere-shell", SHELL_INSIDE_OUT.as_slice()), ("skew-2d", SKEW_FAR_DEFORMED.as_slice())]
    {
        let spec = of_library(name);
        let accuracy = Accuracy::new(&spec, spec.derive().unwrap());
        let code = generated(&spec);
        for inputs in places {
            let worst = accuracy.at(inputs, &code).unwrap();
            let forces: Vec<_> =
                worst.iter().filter(|worst| worst.field.starts_with('b')).collect();
            assert!(forces.len() >= 2, "{worst:?}");
            assert!(forces.iter().all(|b| b.factor <= LARGEST_FACTOR), "{name}: {forces:?}");
        }
    }
}

/// X, Y, Z, t, A, E, nu, rho0, Ri, Ro.
#[rustfmt::skip]
const SHELL_INSIDE_OUT: [&[f64]; 2] = [
    &[0.3615497100248878, 0.5649123178247096, 0.17676387439553073, 8.898962896995728e-6, -0.7920844856136773,
        10458.46719979632, -0.034613569944378295, 0.44662284781105827, 0.5653757966525182, 0.8858943686157971],
    &[5.697855606088449e-10, 2.7956088065963783e-9, 0.23746325518639205, 0.0019181953663209121, -0.43543499094341587,
        4284.4288185325695, -0.18933864985464846, 0.2696416746623665, 0.06961721600772251, 0.237463255190614],
];
/// X, Y, t, A, E, nu, rho0.
#[rustfmt::skip]
const SKEW_FAR_DEFORMED: [&[f64]; 3] = [
    &[0.002500853656466203, 8.498404538173673e-11, 0.0016907489903001834, -0.24997621527753286, 4425.488353082493,
        -0.24595779439274082, 0.4335833964925357],
    &[6.563513151816065e-11, 0.07790756860660288, 0.003462356201145755, -0.2499999173535852, 6630.609114087148,
        -0.1880724183738453, 1.94881338085364],
    &[0.09903641797577986, -0.2490877755116878, 0.0011437183740678634, -0.24986879467349016, 9999.999999999993,
        -0.4041794154409535, 1.4009024715804879],
];

/// Shear stresses next to places where the shear strain vanishes with its slope, the stress of a direction that moves alone, and a body
/// force next to incompressibility: `K` was 1e11 and more at
/// the first, and at the others what is said with them.
#[test]
fn stresses_keep_the_digits_of_what_cancels() {
    let specs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/specs");
    let of_file =
        |name: &str| std::fs::read_to_string(specs.join(name).with_extension("toml")).unwrap();
    let with_law = |law: &str| {
        of_file("digits/shear-of-waves").replace("law = 'neo-hookean'", &format!("law = '{law}'"))
    };
    let in_plane: &[f64] = &[0.0, 0.0, 0.0427, 1e-12, 1235.0, 0.2, 1.3];
    let in_space: &[f64] = &[0.0, 0.0, 0.25, 0.0427, 1e-12, 1235.0, 0.2, 1.3];
    let cases = [
        (with_law("neo-hookean"), in_plane),
        (with_law("st-venant-kirchhoff"), in_plane),
        (with_law("linear-elastic"), &[1e-9, 0.0, 0.0427, 1e-3, 1235.0, 0.2, 1.3]),
        (with_law("hencky"), in_plane),
        (of_file("digits/one-direction-alone"), in_space),
        (of_file("digits/one-direction-alone"), PLANE_AND_DIRECTION),
        (of_file("digits/triangular"), LARGE_STRETCHES),
        (of_file("digits/tube-of-constant-area"), STIFF_TUBE),
        // K of u and H was 1e12 and more so early, K of v and a 930 and more so late.
        (of_file("digits/start-from-rest"), &[0.3, 0.6, 4e-8, 0.05, 1200.0, 0.3, 1.7]),
        (of_file("digits/start-from-rest"), &[0.7, 0.2, 4e-4, 0.05, 1200.0, 0.3, 1.7]),
        (of_file("digits/saturating-ramps"), &[0.3, 0.6, 4.0, 0.05, 1200.0, 0.3, 1.7]),
        (of_file("digits/saturating-ramps"), &[0.3, 0.6, 400.0, 0.05, 1200.0, 0.3, 1.7]),
    ];
    for (text, inputs) in cases {
        let (name, worst) = at(&text, inputs);
        assert!(worst.iter().all(|field| field.factor <= LARGEST_FACTOR), "{name}: {worst:?}");
    }
    // Entries beside which others of the field are large: the field keeps its digits, and these have lost theirs.
    for (text, inputs) in [
        (of_file("digits/shear-of-waves-orthotropic"), in_plane),
        (of_file("attack/open/shear-of-waves-mooney-rivlin"), in_space),
        (of_file("digits/waves-of-one-size"), TWO_WAVES_NEARLY_INCOMPRESSIBLE),
    ] {
        let (name, worst) = at(&text, inputs);
        assert!(worst.iter().all(|field| field.units <= LARGEST_UNITS), "{name}: {worst:?}");
    }
}

/// The worst entry of each field at one place, by the programs of a specification.
fn at(text: &str, inputs: &[f64]) -> (String, Vec<Worst>) {
    let spec = Spec::parse(text, "a case").unwrap();
    let accuracy = Accuracy::new(&spec, spec.derive().unwrap());
    let programs = accuracy.programs();
    let judged = |inputs: &[f64]| {
        Ok(programs.iter().map(|(letter, program)| (*letter, program.evaluate(inputs))).collect())
    };
    let worst = accuracy.at(inputs, &judged).unwrap();
    (spec.name.clone(), worst)
}

/// A cube root less the radius, at a tiny amplitude: `u` had no digit.
#[test]
fn displacements_keep_the_digits_of_roots() {
    let file = "../../tests/data/specs/attack/open/cavity.toml";
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(file)).unwrap();
    let spec = Spec::parse(&text, file).unwrap();
    let accuracy = Accuracy::new(&spec, spec.derive().unwrap());
    let programs = accuracy.programs();
    let judged = |inputs: &[f64]| {
        Ok(programs.iter().map(|(letter, program)| (*letter, program.evaluate(inputs))).collect())
    };
    // X, Y, Z, t, A, E, nu, rho0, Ri, Ro.
    let worst =
        accuracy.at(&[0.2, 0.3, 0.4, 0.02, 1e-20, 1e3, 0.3, 1.3, 0.4, 1.0], &judged).unwrap();
    let of_motion: Vec<_> =
        worst.iter().filter(|worst| ["u", "v", "a", "H", "F"].contains(&worst.field)).collect();
    assert_eq!(of_motion.len(), 5);
    assert!(of_motion.iter().all(|field| field.factor <= LARGEST_FACTOR), "{of_motion:?}");
}

/// X, Y, t, A, E, nu, rho0; `K` of `b` is 654.
#[rustfmt::skip]
const TWO_WAVES_NEARLY_INCOMPRESSIBLE: &[f64] = &[
    0.4121128738063652, 0.0, 0.00972098422190009, -4.786801959956153e-11, 1194.2104412986896, 0.4999267692573062, 1.8055990731086549,
];
/// X, Y, Z, t, A, E, nu, rho0; `K` of `P` was 534, of `b` 221.
#[rustfmt::skip]
const PLANE_AND_DIRECTION: &[f64] = &[
    0.6107453693404187, 0.04869929523324742, 0.7931761868448093, 0.0647568951270023, 0.48822104590255655, 982.6244353488844,
    -0.04233786355029113, 1.4180183319165744,
];
/// X, Y, t, A, E, nu, rho0, Ri, Ro; `K` of `b` was 1e5.
#[rustfmt::skip]
const STIFF_TUBE: &[f64] = &[
    0.5019618375027151, 0.0, 0.06206126361709265, 4.78680188994553e-11, 1193.1512917658697, -0.999981282872775, 1.80559907310866,
    0.3798167489560368, 0.7104921380374318,
];
/// X, Y, Z, t, A, E, nu, rho0; `K` of `P` was 46.
#[rustfmt::skip]
const LARGE_STRETCHES: &[f64] = &[
    0.5901485613459356, 0.1785482531420035, 0.24794417460485374, 0.04398709176664889, -74.54070291472605, 3166.433511046547,
    -1.606041361665594e-11, 10.692302587954472,
];

/// A state that is written and read goes on as if it had never been, on any number of threads, and no place becomes better.
#[test]
fn a_search_goes_on_where_it_was() {
    let spec = of_library("axis-aligned-1d");
    let accuracy = Accuracy::new(&spec, spec.derive().unwrap());
    let code = generated(&spec);
    let drawn = |search: &mut Search| {
        for class in Class::ALL {
            search.begin_at(&accuracy, &accuracy.measure(class, 4, &code, &|| ()).unwrap());
        }
    };
    let mut whole = Search::new(&accuracy);
    drawn(&mut whole);
    let mut halves = whole.clone();
    let mut earlier = whole.clone();
    for _ in 0..4 {
        whole.advance(&accuracy, &code).unwrap();
    }
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    one.install(|| {
        for round in 0..4 {
            halves.advance(&accuracy, &code).unwrap();
            if round == 1 {
                let text = serde_json::to_string(&halves).unwrap();
                halves = serde_json::from_str(&text).unwrap();
                earlier = halves.clone();
                assert!(halves.suits(&accuracy));
            }
        }
    });
    assert_eq!(halves, whole);
    assert_eq!(whole.rounds(), 4);
    assert!(whole.evaluations() > 4 * ROUND, "{}", whole.evaluations());
    for class in [Class::Ordinary, Class::Late] {
        let few = accuracy.measure(class, 4, &code, &|| ()).unwrap();
        let worst = |search: &Search| search.worst(&accuracy, few.clone(), &code).unwrap();
        for (before, after) in worst(&earlier).worst.iter().zip(&worst(&whole).worst) {
            // The factors of the first look have two digits.
            assert!(after.factor >= 0.99 * before.factor, "{before:?} {after:?}");
        }
    }
    let other = of_library("bar");
    let other = Accuracy::new(&other, other.derive().unwrap());
    assert!(!whole.suits(&other));
}

/// Code that loses digits in one corner of the body only, which draws do not meet.
#[test]
fn a_search_finds_what_draws_do_not() {
    let text = include_str!("../../../../mms-specs/bar.toml");
    let spec = Spec::parse(text, "bar.toml").unwrap();
    let accuracy = Accuracy::new(&spec, spec.derive().unwrap());
    let code = generated(&spec);
    // Rounding that is 1e3 times as large within a thousandth of the bar's length from one place.
    let careless = |inputs: &[f64]| -> Result<Judged, String> {
        let mut fields = code(inputs)?;
        let near = 1.0 + 1e3 * (-((inputs[0] / inputs[6] - 0.37) / 1e-3).powi(2)).exp();
        let units = (inputs[0].to_bits() % 16) as f64 / 16.0 - 0.5;
        for (letter, entries) in &mut fields {
            if *letter == "v" {
                entries[0] += entries[0] * units * near * f64::EPSILON;
            }
        }
        Ok(fields)
    };
    let drawn = accuracy.measure(Class::Ordinary, 30, &careless, &|| ()).unwrap();
    let factor = |worst: &[mmsmith_oracle::Worst]| {
        worst.iter().find(|worst| worst.field == "v").map_or(0.0, |worst| worst.factor)
    };
    assert!(factor(&drawn.worst) < 20.0, "{drawn:?}");
    let mut search = Search::new(&accuracy);
    search.begin_at(&accuracy, &drawn);
    for _ in 0..40 {
        search.advance(&accuracy, &careless).unwrap();
    }
    let found = search.worst(&accuracy, drawn, &careless).unwrap();
    assert!(factor(&found.worst) > 60.0, "{found:?}");
}

/// The points of a class are what the class says.
#[test]
fn points_are_of_their_class() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../mms-specs");
    for (name, class) in [("axis-aligned", Class::NearInversion), ("ring", Class::NearInversion)] {
        let text = std::fs::read_to_string(folder.join(name).with_extension("toml")).unwrap();
        let spec = Spec::parse(&text, name).unwrap();
        let mut fields = spec.derive().unwrap();
        let gradient = fields.program(&fields.F.concat());
        let sampler = mmsmith_oracle::Sampler::new(&spec, &mut fields);
        // In the plane: s1 s2 = J and s1^2 + s2^2 = F : F.
        let smallest_stretch = |index| {
            let F = gradient.evaluate(&sampler.draw(class, index).unwrap());
            let J = F[0] * F[3] - F[1] * F[2];
            let square: f64 = F.iter().map(|entry| entry * entry).sum();
            J / (0.5 * (square + (square * square - 4.0 * J * J).max(0.0).sqrt())).sqrt()
        };
        let stretches: Vec<f64> = (0..40).map(smallest_stretch).collect();
        assert!(stretches.iter().all(|&s| s > 0.0 && s < 2e-2), "{name}: {stretches:?}");
        assert!(stretches.iter().any(|&s| s < 1e-5), "{name}: {stretches:?}");
    }
}

/// A quarter of the draws is far from the defaults, in every class; those outside of the body are said to be.
#[test]
fn draws_reach_the_ends_of_what_is_admitted() {
    for name in ["vortex", "ring-nu", "sphere-shell", "skew-2d"] {
        let spec = far_as_well(&of_library(name));
        let mut fields = spec.derive().unwrap();
        let sampler = mmsmith_oracle::Sampler::new(&spec, &mut fields);
        let n = spec.dimension;
        let place =
            |name: &str| n + 1 + spec.parameters.iter().position(|p| p.name == name).unwrap();
        let (nu, E, A) = (place("nu"), place("E"), place("A"));
        let default = spec.parameters[E - n - 1].default;
        for class in
            [Class::Ordinary, Class::TinyAmplitude, Class::Late, Class::Boundary, Class::Far]
        {
            let drawn: Vec<Vec<f64>> =
                (0..300).filter_map(|index| sampler.draw(class, index)).collect();
            let some = |holds: &dyn Fn(&Vec<f64>) -> bool| {
                assert!(drawn.iter().any(holds), "{name}, {class:?}");
            };
            some(&|inputs| inputs[nu] > 0.5 - 1e-6);
            some(&|inputs| inputs[nu] < 0.0);
            some(&|inputs| inputs[nu] == 0.0);
            some(&|inputs| inputs[E] > 5.0 * default);
            some(&|inputs| inputs[E] < default / 5.0);
            some(&|inputs| inputs[A] < 0.0);
            assert!(drawn.iter().all(|inputs| inputs[nu] <= 0.5 - 0.99e-8), "{name}, {class:?}");
            let outside = drawn.iter().filter(|inputs| sampler.is_outside(inputs)).count();
            if class == Class::Far {
                // Where displacements grow fast, only those next to the body suit.
                assert!(outside > drawn.len() / 5, "{name}: {outside} of {}", drawn.len());
            } else {
                assert_eq!(outside, 0, "{name}, {class:?}");
            }
        }
    }
}
