//! The generated C headers: the same bits as the Rust functions, in C and in C++, without a warning.

#![allow(clippy::unwrap_used)]

use mmsmith_codegen::{Code, Names};
use mmsmith_solutions::nalgebra::{SMatrix, SVector};
use mmsmith_solutions::{
    AnySolution, CATALOGUE, Description, Domain, Fields, Law, Parameter, ParameterError, Ring,
    RingParameters, Solution, Surface, build,
};
use mmsmith_spec::Spec;
use mmsmith_tests::{c_compiler, cpp_compiler, outcome, workspace};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

/// Solutions with what those of the library lack: the other laws, energies, stresses, curved coordinates in space.
mod others {
    mmsmith_macros::manufactured_solution!("../../data/specs/materials/ring-hencky.toml");
    mmsmith_macros::manufactured_solution!("../../data/specs/materials/shell-hencky.toml");
    mmsmith_macros::manufactured_solution!("../../data/specs/materials/skew-2d-energy.toml");
    mmsmith_macros::manufactured_solution!("../../data/specs/materials/skew-2d-hencky.toml");
    mmsmith_macros::manufactured_solution!(
        "../../data/specs/materials/skew-2d-linear-elastic.toml"
    );
    mmsmith_macros::manufactured_solution!("../../data/specs/materials/skew-2d-mooney-rivlin.toml");
    mmsmith_macros::manufactured_solution!(
        "../../data/specs/materials/skew-2d-st-venant-kirchhoff.toml"
    );
    mmsmith_macros::manufactured_solution!("../../data/specs/materials/skew-2d-stress.toml");
    mmsmith_macros::manufactured_solution!("../../data/specs/materials/tube-hencky.toml");
    mmsmith_macros::manufactured_solution!("../../data/specs/materials/axis-aligned-3d-ogden.toml");
    mmsmith_macros::manufactured_solution!("../../data/specs/materials/skew-2d-arruda-boyce.toml");
    mmsmith_macros::manufactured_solution!("../../data/specs/materials/skew-2d-gent.toml");
    mmsmith_macros::manufactured_solution!(
        "../../data/specs/materials/skew-2d-holzapfel-gasser-ogden.toml"
    );
    mmsmith_macros::manufactured_solution!("../../data/specs/materials/skew-2d-ogden.toml");
    mmsmith_macros::manufactured_solution!("../../data/specs/materials/skew-2d-orthotropic.toml");
    mmsmith_macros::manufactured_solution!("../../data/specs/materials/skew-2d-yeoh.toml");
    mmsmith_macros::manufactured_solution!(
        "../../data/specs/materials/skew-3d-holzapfel-gasser-ogden.toml"
    );
}

type Build = Box<dyn Fn(&[f64]) -> Result<AnySolution<f64>, ParameterError>>;

/// Every solution, with a function that builds it from parameter values.
fn solutions() -> Vec<(&'static Description, Build)> {
    let mut solutions: Vec<(&'static Description, Build)> = Vec::new();
    for &description in CATALOGUE {
        let from_values = |values: &[f64]| build::<f64>(description.name, values).unwrap();
        solutions.push((description, Box::new(from_values)));
    }
    macro_rules! add {
        ($($name:ident)*) => {$(
            solutions.push((
                &others::$name::<f64>::DESCRIPTION,
                Box::new(|values| others::$name::from_values(values).map(AnySolution::from)),
            ));
        )*};
    }
    add!(RingHencky ShellHencky Skew2dEnergy Skew2dHencky Skew2dLinearElastic Skew2dMooneyRivlin);
    add!(Skew2dStVenantKirchhoff Skew2dStress TubeHencky AxisAligned3dOgden Skew2dArrudaBoyce Skew2dGent);
    add!(Skew2dHolzapfelGasserOgden Skew2dOgden Skew2dOrthotropic Skew2dYeoh Skew3dHolzapfelGasserOgden);
    solutions
}

/// The surfaces, and how the headers call them.
const SURFACES: [(Surface, &str); 8] = [
    (Surface::Lower(0), "X_lower"),
    (Surface::Lower(1), "Y_lower"),
    (Surface::Lower(2), "Z_lower"),
    (Surface::Upper(0), "X_upper"),
    (Surface::Upper(1), "Y_upper"),
    (Surface::Upper(2), "Z_upper"),
    (Surface::Inner, "inner"),
    (Surface::Outer, "outer"),
];

/// Numbers that are the same in every run.
struct Random(SplitMix64);

impl Random {
    /// Between 0 and 1.
    fn number(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// A case to evaluate: parameters, a time and points, and the values by Rust.
struct Case {
    name: &'static str,
    values: Vec<f64>,
    t: f64,
    /// Coordinates, point by point.
    X: Vec<f64>,
    points: usize,
    /// With what it is, each value; `None` where the parameters are refused.
    expected: Option<Vec<(String, f64)>>,
}

fn cases() -> Vec<Case> {
    let mut random = Random(SplitMix64::seed_from_u64(1));
    let mut cases = Vec::new();
    for (description, build) in solutions() {
        let defaults: Vec<f64> = description.parameters.iter().map(|p| p.default).collect();
        // As they are, at random, with tiny amplitudes, and with one that nothing admits.
        let mut sets = vec![defaults.clone()];
        while sets.len() < 5 {
            let values: Vec<f64> =
                defaults.iter().map(|x| x * (0.7 + 0.6 * random.number())).collect();
            if build(&values).is_ok() {
                sets.push(values);
            }
        }
        let small = |scale: f64| -> Vec<f64> {
            let scaled = |p: &Parameter| match p.name {
                "A" => p.default * scale,
                _ => p.default,
            };
            description.parameters.iter().map(scaled).collect()
        };
        sets.extend([small(1e-8), small(1e-150), small(-1.0)]);
        for index in 0..defaults.len() {
            for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0, 0.0, 0.5, 1e3] {
                let mut values = defaults.clone();
                values[index] = wrong;
                sets.push(values);
            }
        }
        for values in sets {
            match build(&values) {
                Err(_) => cases.push(Case {
                    name: description.name,
                    values,
                    t: 0.0,
                    X: Vec::new(),
                    points: 0,
                    expected: None,
                }),
                Ok(solution) => {
                    for phase in [0.0, random.number(), 3.0 * random.number(), 1e6 + 0.3, -0.25] {
                        cases.push(match &solution {
                            AnySolution::One(s) => {
                                case(description, s.as_ref(), &values, phase, &mut random)
                            }
                            AnySolution::Two(s) => {
                                case(description, s.as_ref(), &values, phase, &mut random)
                            }
                            AnySolution::Three(s) => {
                                case(description, s.as_ref(), &values, phase, &mut random)
                            }
                            _ => panic!("no points of {}", description.name),
                        });
                    }
                }
            }
        }
    }
    cases
}

fn case<const D: usize>(
    description: &Description,
    solution: &dyn Solution<f64, D>,
    values: &[f64],
    periods: f64,
    random: &mut Random,
) -> Case {
    let t = periods * solution.period();
    let points: Vec<SVector<f64, D>> =
        (0..23).map(|n| point(&solution.domain(), n, random)).collect();
    let mut expected: Vec<(String, f64)> = Vec::new();
    let mut add = |what: &str, values: &[f64]| {
        expected.extend(values.iter().enumerate().map(|(i, x)| (format!("{what}[{i}]"), *x)));
    };
    let defaults: Vec<f64> = description.parameters.iter().map(|p| p.default).collect();
    add("defaults", &defaults);
    add("cell length", &[solution.cell_length()]);
    add("density", &[solution.density()]);
    add("wave speed", &[solution.wave_speed()]);
    add("period", &[solution.period()]);
    if let Law::Library(material) = solution.law() {
        add("moduli", &material.values());
    }
    match solution.domain() {
        Domain::Box { lower, upper } => {
            add("lower", lower.as_slice());
            add("upper", upper.as_slice());
        }
        Domain::Annulus { inner, outer } => add("radii", &[inner, outer]),
        other => panic!("the headers offer no measures of {other:?}"),
    }
    let mut b = vec![SVector::zeros(); points.len()];
    solution.body_force_at(&points).evaluate(t, 0, &mut b);
    for (n, X) in points.iter().enumerate() {
        let rows = |A: SMatrix<f64, D, D>| A.transpose().as_slice().to_vec();
        let single = Fields {
            u: solution.displacement(X, t),
            v: solution.velocity(X, t),
            a: solution.acceleration(X, t),
            H: solution.displacement_gradient(X, t),
            F: solution.deformation_gradient(X, t),
            J: solution.jacobian(X, t),
            P: solution.first_piola_kirchhoff(X, t),
            b: solution.body_force(X, t),
        };
        for (way, fields) in [("alone", single), ("together", solution.fields(X, t))] {
            let Fields { u, v, a, H, F, J, P, b } = fields;
            for (letter, vector) in [("u", u), ("v", v), ("a", a)] {
                add(&format!("point {n}, {letter} {way}"), vector.as_slice());
            }
            add(&format!("point {n}, H {way}"), &rows(H));
            add(&format!("point {n}, F {way}"), &rows(F));
            add(&format!("point {n}, J {way}"), &[J]);
            add(&format!("point {n}, P {way}"), &rows(P));
            add(&format!("point {n}, b {way}"), b.as_slice());
        }
        if let Some(W) = solution.strain_energy(X, t) {
            add(&format!("point {n}, W"), &[W]);
        }
        for (surface, name) in SURFACES {
            if let Some(traction) = solution.traction(surface, X, t) {
                add(&format!("point {n}, traction on {name}"), traction.as_slice());
            }
        }
        for way in ["in stages", "in stages with a stride", "in an array"] {
            add(&format!("point {n}, b {way}"), b[n].as_slice());
        }
    }
    Case {
        name: description.name,
        values: values.to_vec(),
        t,
        X: points.iter().flat_map(|X| X.iter().copied()).collect(),
        points: points.len(),
        expected: Some(expected),
    }
}

/// Point number `n`: first corners or poles, then any.
fn point<const D: usize>(
    domain: &Domain<f64, D>,
    n: usize,
    random: &mut Random,
) -> SVector<f64, D> {
    let mut place = |axis: usize| match n {
        0..4 => f64::from(u8::from(n >> axis & 1 == 1)),
        _ => random.number(),
    };
    match domain {
        Domain::Box { lower, upper } => {
            SVector::from_fn(|i, _| lower[i] + place(i) * (upper[i] - lower[i]))
        }
        Domain::Annulus { inner, outer } => {
            let radius = inner + place(0) * (outer - inner);
            // Also on the axes.
            let direction: SVector<f64, D> =
                SVector::from_fn(|i, _| if n == i + 1 { 1.0 } else { 2.0 * place(i) - 1.0 });
            direction * (radius / direction.norm())
        }
        other => panic!("no points of {other:?}"),
    }
}

/// Writes the list that `compare.c` includes, and the headers of specifications beside the library.
fn write_list(folder: &Path) {
    let mut text = String::new();
    let mut list = String::from("#define SOLUTIONS");
    std::fs::create_dir(folder.join("mmsmith")).unwrap();
    for (description, _) in solutions() {
        let name = Names::of(description.name).module;
        let file = Path::new("mmsmith").join(&name).with_extension("h");
        let spec = Spec::parse(description.specification, description.name).unwrap();
        let header = std::fs::read_to_string(headers().join(&file)).unwrap_or_else(|_| {
            let header = Code::new(&spec).unwrap().header_source();
            std::fs::write(folder.join(&file), &header).unwrap();
            header
        });
        let offers = |what: &str| header.contains(&format!(" {name}_{what}(const"));
        let domain = if offers("inner") { "ANNULUS" } else { "BOX" };
        let energy = if offers("W") { "ENERGY" } else { "NO_ENERGY" };
        writeln!(text, "#include \"mmsmith/{name}.h\"").unwrap();
        write!(text, "#define CONSTANTS_{name}").unwrap();
        if let mmsmith_spec::Law::Library(material) = &spec.material {
            for constant in material.row().constants {
                write!(text, " WRITE_CONSTANT({name}, {})", constant.name).unwrap();
            }
        }
        write!(text, "\n#define TRACTIONS_{name}").unwrap();
        for (_, surface) in SURFACES {
            if offers(&format!("{surface}_traction")) {
                write!(text, " WRITE_TRACTION({name}, {surface})").unwrap();
            }
        }
        text.push('\n');
        write!(list, " SOLUTION({name}, {domain}, {energy})").unwrap();
    }
    assert!(list.contains("BOX, ENERGY") && list.contains("ANNULUS, NO_ENERGY"), "{list}");
    assert!(text.contains("_gent, Jm)") && text.contains("_ogden, alpha3)"), "{text}");
    assert!(text.contains("(ring, inner)") && text.contains("(bar, X_upper)"), "{text}");
    std::fs::write(folder.join("headers.h"), text + &list + "\n").unwrap();
}

/// A folder with `mmsmith/NAME.h` for each solution of the library. The headers lie in a folder of their own, so that none of them hides a
/// header of the system, as `math.h`.
fn headers() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("headers");
        std::fs::create_dir_all(folder.join("mmsmith")).unwrap();
        for description in CATALOGUE {
            let spec = Spec::parse(description.specification, description.name).unwrap();
            let file = Path::new("mmsmith").join(Names::of(description.name).module);
            let header = Code::new(&spec).unwrap().header_source();
            std::fs::write(folder.join(file).with_extension("h"), header).unwrap();
        }
        folder
    })
}

/// Options under which generated code must compile without a warning.
fn strict(command: &mut Command) -> &mut Command {
    command.args(["-pedantic", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off"])
}

/// Compiles `compare.c`, runs it on the cases and compares every value.
fn compare(compiler: &mut Command, cases: &[Case]) {
    let folder = tempfile::tempdir().unwrap();
    write_list(folder.path());
    let program = folder.path().join("compare");
    let source = workspace().join("tests/c/compare.c");
    let compile = strict(compiler).arg("-I").arg(folder.path()).arg("-I").arg(headers());
    let (status, _, errors) = outcome(compile.arg(source).arg("-o").arg(&program).arg("-lm"));
    assert_eq!(status, Some(0), "{errors}");

    let mut input = String::new();
    for Case { name, values, t, X, points, .. } in cases {
        write!(input, "{}", Names::of(name).module).unwrap();
        for x in values.iter().chain([t]) {
            write!(input, " {:x}", x.to_bits()).unwrap();
        }
        write!(input, " {points}").unwrap();
        for x in X {
            write!(input, " {:x}", x.to_bits()).unwrap();
        }
        input.push('\n');
    }
    let mut child =
        Command::new(&program).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let writer = std::thread::spawn(move || stdin.write_all(input.as_bytes()).unwrap());
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap();
    assert!(output.status.success());

    let text = String::from_utf8(output.stdout).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), cases.len());
    let (mut compared, mut refused) = (0, 0);
    for (Case { name, values, t, expected, .. }, line) in cases.iter().zip(lines) {
        let about = format!("{name} with {values:?} at t = {t}");
        let Some(expected) = expected else {
            let message =
                line.strip_prefix("refused ").unwrap_or_else(|| panic!("{about}: {line}"));
            assert!(message.contains(name) && message.contains("must"), "{about}: {message}");
            refused += 1;
            continue;
        };
        let found = line.strip_prefix("values ").unwrap_or_else(|| panic!("{about}: {line}"));
        let found: Vec<u64> =
            found.split(' ').map(|bits| u64::from_str_radix(bits, 16).unwrap()).collect();
        assert_eq!(found.len(), expected.len(), "{about}");
        for ((what, wanted), found) in expected.iter().zip(found) {
            let found = f64::from_bits(found);
            let same = found.to_bits() == wanted.to_bits() || found.is_nan() && wanted.is_nan();
            assert!(same, "{about}, {what}: C gives {found:?}, Rust {wanted:?}");
            compared += 1;
        }
    }
    assert!(compared > 500_000 && refused > 100, "{compared} {refused}");
}

#[test]
fn c_and_cpp_give_the_bits_of_the_rust_functions() {
    let cases = cases();
    // With all optimisation, and with none.
    compare(c_compiler().args(["-std=c99", "-O3"]), &cases);
    if let Some(mut compiler) = cpp_compiler() {
        compare(compiler.args(["-x", "c++", "-std=c++17", "-O0"]), &cases);
    }
}

/// Names that the headers declare would clash where what follows the name of one solution begins with a part of
/// another's, as `ring_at` + `time` and `ring` + `at_time`.
#[test]
fn names_of_different_solutions_cannot_clash() {
    for description in CATALOGUE {
        let name = Names::of(description.name).module;
        let header = headers().join("mmsmith").join(&name).with_extension("h");
        let header = std::fs::read_to_string(header).unwrap();
        let mut ends: Vec<&str> = header
            .split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'))
            .filter_map(|word| word.strip_prefix(&name)?.strip_prefix('_'))
            .collect();
        ends.sort_unstable();
        ends.dedup();
        assert!(ends.len() > 25, "{ends:?}");
        for end in &ends {
            for other in &ends {
                assert!(!other.ends_with(&format!("_{end}")), "{name}_{end}, {name}_{other}");
            }
        }
    }
}

#[test]
fn the_example_of_the_book_compiles_and_gives_the_body_force() {
    let page = std::fs::read_to_string(workspace().join("docs/src/guide/code.md")).unwrap();
    let (_, rest) = page.split_once("```c\n").expect("the page has an example in C");
    let (example, _) = rest.split_once("```").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let (source, program) = (folder.path().join("example.c"), folder.path().join("example"));
    std::fs::write(&source, example).unwrap();
    let mut compiler = c_compiler();
    let compile = strict(compiler.args(["-std=c99", "-O2"])).arg("-I").arg(headers());
    let (status, _, errors) = outcome(compile.arg(source).arg("-o").arg(&program).arg("-lm"));
    assert_eq!(status, Some(0), "{errors}");
    let (status, out, errors) = outcome(&mut Command::new(program));
    assert_eq!(status, Some(0), "{errors}");
    let found: Vec<f64> = out.split_whitespace().filter_map(|word| word.parse().ok()).collect();

    let ring = Ring::new(RingParameters { A: 0.05, ..RingParameters::default() }).unwrap();
    // By the same stages; a single call rounds differently.
    let points = [[0.6, 0.0], [0.5, 0.5], [0.0, 0.9]].map(SVector::from);
    let mut b = [SVector::zeros(); 3];
    ring.body_force_at(&points).evaluate(1e-3, 0, &mut b);
    let expected: Vec<f64> = b.iter().flat_map(|b| b.as_slice().to_vec()).collect();
    assert_eq!(found, expected, "{out}");
}
