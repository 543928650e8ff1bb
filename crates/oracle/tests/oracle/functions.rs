//! Functions of the language in generated code: fields that have them, in Rust, in both precisions, and in C, against the
//! oracle.
#![allow(clippy::unwrap_used)]

use mmsmith_codegen::Code;
use mmsmith_expr::{Ast, Expr, Graph, nearest_f64};
use mmsmith_oracle::{
    Accuracy, Class, Judged, LARGEST_FACTOR, Oracle, OracleError, Point, Sampler, Sensitivity,
    exact, scientific,
};
use mmsmith_solutions::nalgebra::SVector;
use mmsmith_solutions::{AnySolution, Description, Solution};
use mmsmith_spec::{Domain, Fields, Spec};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// In each class.
const POINTS: usize = 12;

/// A field that has the function in its displacement, as generated code.
struct Field {
    description: &'static Description,
    double: fn(&[f64]) -> Option<AnySolution<f64>>,
    single: fn(&[f64]) -> Option<AnySolution<f32>>,
}

macro_rules! fields {
    ($($file:tt is $name:ident,)*) => {
        mod generated {
            $(mmsmith_macros::manufactured_solution!($file);)*
        }

        const FIELDS: &[Field] = &[$(Field {
            description: &generated::$name::<f64>::DESCRIPTION,
            double: |values| generated::$name::from_values(values).ok().map(AnySolution::from),
            single: |values| generated::$name::from_values(values).ok().map(AnySolution::from),
        },)*];
    };
}

fields! {
    "../../../../tests/data/specs/digits/front-tanh.toml" is FrontTanh,
    "../../../../tests/data/specs/digits/front-arctan.toml" is FrontArctan,
    "../../../../tests/data/specs/digits/front-erf.toml" is FrontErf,
    "../../../../tests/data/specs/digits/front-positive-part.toml" is FrontPositivePart,
    "../../../../tests/data/specs/digits/hyperbolic-of-root.toml" is HyperbolicOfRoot,
}

/// Values of functions to 40 digits, by another library of arbitrary precision (mpmath, in 80 digits).
const VALUES: &[(&str, &str, &str)] = &[
    ("erf(x)", "1/10", "1.124629160182848922032750717439683832217e-1"),
    ("erf(x)", "1/2", "5.204998778130465376827466538919645287365e-1"),
    ("erf(x)", "-1", "-8.427007929497148693412206350826092592961e-1"),
    ("erf(x)", "2", "9.953222650189527341620692563672529286109e-1"),
    ("erf(x)", "7/2", "9.999992569016276585872544763162439043643e-1"),
    ("erf(x)", "1e-200", "1.128379167095512573896158903121545171688e-200"),
    ("1 - erf(x)", "6", "2.151973671249891311659335039918738463048e-17"),
    ("1 - erf(x)", "10", "2.088487583762544757000786294957788611561e-45"),
    ("1 - erf(x)", "25", "8.300172571196522752044012769513722768714e-274"),
    ("log1pmx(x)", "1e-200", "-5.000000000000000000000000000000000000000e-401"),
    ("log1pmx(x)", "-1/10", "-5.360515657826301227500980839312798306120e-3"),
    ("log1pmx(x)", "7/2", "-1.995922603223725926626741647613125158781"),
    ("log1pmx(x)", "-99/100", "-3.615170185988091368035982909368728415202"),
    ("cosh_sqrt_m1(x)", "1e-200", "5.000000000000000000000000000000000000000e-201"),
    ("cosh_sqrt_m1(x)", "1/10", "5.041805803847210645993575390026090905939e-2"),
    ("cosh_sqrt_m1(x)", "7/2", "2.323835714772931182982033072392835211924"),
    ("cosh_sqrt_m1(x)", "10000", "1.344058570908067724206312775790006793681e43"),
    ("cosh_sqrt_m1_slope(x)", "1e-200", "1.666666666666666666666666666666666666667e-201"),
    ("cosh_sqrt_m1_slope(x)", "1/10", "1.675019868852228668906415045550266752471e-2"),
    ("cosh_sqrt_m1_slope(x)", "7/2", "6.943506011617449130062442597002153738687e-1"),
    ("cosh_sqrt_m1_slope(x)", "10000", "1.344058570908067724206312775790006793681e41"),
    ("cosh_sqrt_m1_curvature(x)", "1e-200", "1.666666666666666666666666666666666666667e-1"),
    ("cosh_sqrt_m1_curvature(x)", "1/10", "1.683392967497490988543580172237912076734e-1"),
    ("cosh_sqrt_m1_curvature(x)", "7/2", "2.327835876587408957108269732418028340079e-1"),
    ("cosh_sqrt_m1_curvature(x)", "10000", "6.653089925994935234821248240160533628719e38"),
    ("positive_part(x)", "7/2", "3.500000000000000000000000000000000000000"),
    ("1 + positive_part(x)", "-1/3", "1.000000000000000000000000000000000000000"),
    ("positive_part_slope(x)", "1e-200", "1.000000000000000000000000000000000000000"),
    ("1 + positive_part_slope(x)", "-1/3", "1.000000000000000000000000000000000000000"),
];

#[test]
fn the_oracle_has_the_values_of_another_library() {
    for (text, at, expected) in VALUES {
        let mut graph = Graph::new();
        let [expr, at] = [text, at].map(|text| {
            graph.build(&Ast::parse(text).unwrap(), &mut |g, name| Ok(g.symbol(name))).unwrap()
        });
        let values = [(graph.symbol("x"), graph.as_number(at).unwrap().clone())];
        let point = Point { graph: &graph, definitions: &[], values: &values };
        let mut oracle = Oracle::new(Oracle::LEAST_BITS).unwrap();
        let found = oracle.settle(&point, &[expr], 45).unwrap().remove(0);
        assert_eq!(scientific(&found, 40), *expected, "{text} at {}", graph.print(at));
    }
}

fn parse(description: &Description) -> Spec {
    Spec::parse(description.specification, description.name)
        .unwrap_or_else(|error| panic!("{error}"))
}

/// Failures beyond the bound in any class.
fn beyond(
    field: &Field,
    way: &str,
    judged: &(dyn Fn(&[f64]) -> Result<Judged, String> + Sync),
) -> Vec<String> {
    let spec = parse(field.description);
    let accuracy = Accuracy::new(&spec, spec.derive().unwrap());
    let mut failures = Vec::new();
    for class in Class::ALL {
        let found = accuracy.measure(class, POINTS, judged, &|| ()).unwrap();
        assert!(found.points > 0 || found.remark.is_some(), "{}: {class:?}", spec.name);
        for worst in found.worst {
            let Some(expected) = (worst.factor > LARGEST_FACTOR).then_some(&worst.exact) else {
                continue;
            };
            failures.push(format!(
                "{} ({way}), {}: {} = {:?} has K = {:.2e}, not {expected}, at {}",
                spec.name,
                class.name(),
                worst.field,
                worst.result,
                worst.factor,
                accuracy.place(&worst.inputs)
            ));
        }
    }
    failures
}

#[test]
fn generated_rust_keeps_the_digits() {
    for field in FIELDS {
        let n = field.description.dimension;
        let judged = |inputs: &[f64]| -> Result<Judged, String> {
            let solution = (field.double)(&inputs[n + 1..]).ok_or("inadmissible")?;
            solution.each_field(&inputs[..n], inputs[n]).ok_or("wrong dimension".into())
        };
        let failures = beyond(field, "Rust", &judged);
        assert!(failures.is_empty(), "{}", failures.join("\n"));
    }
}

/// The program that evaluates the header of a field, compiled without a warning.
fn compiled(description: &Description) -> PathBuf {
    let module = description.name.replace('-', "_");
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(&module);
    std::fs::create_dir_all(&folder).unwrap();
    let spec = parse(description);
    assert!(matches!(spec.domain, Domain::Box { .. }), "{module}");
    let header = Code::new(&spec).unwrap().header_source();
    let energy =
        if header.contains(&format!(" {module}_W(const")) { "ENERGY" } else { "NO_ENERGY" };
    std::fs::write(folder.join(format!("{module}.h")), header).unwrap();
    let list = format!(
        "#include \"{module}.h\"\n#define TRACTIONS_{module}\n\
         #define CONSTANTS_{module} WRITE_CONSTANT({module}, lambda) WRITE_CONSTANT({module}, mu)\n\
         #define SOLUTIONS SOLUTION({module}, BOX, {energy})\n"
    );
    std::fs::write(folder.join("headers.h"), list).unwrap();
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/c/compare.c");
    let program = folder.join("compare");
    let compiler = std::env::var_os("CC").unwrap_or_else(|| "cc".into());
    let output = Command::new(compiler)
        .args(["-std=c99", "-O2", "-pedantic", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off"])
        .arg("-I")
        .args([&folder, &source])
        .arg("-o")
        .arg(&program)
        .arg("-lm")
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    program
}

/// The fields that the header gives, of which those by way of stages are the body force alone.
fn by_header(program: &Path, field: &Description, inputs: &[f64]) -> Result<Judged, String> {
    let n = field.dimension;
    let (X, t, parameters) = (&inputs[..n], inputs[n], &inputs[n + 1..]);
    let mut question = field.name.replace('-', "_");
    for x in parameters.iter().chain([&t]) {
        write!(question, " {:x}", x.to_bits()).unwrap();
    }
    question += " 1";
    for x in X {
        write!(question, " {:x}", x.to_bits()).unwrap();
    }
    question.push('\n');
    let mut command = Command::new(program);
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(question.as_bytes()).unwrap();
    let answer = String::from_utf8(child.wait_with_output().unwrap().stdout).unwrap();
    let numbers = answer.trim().strip_prefix("values ").ok_or(answer.clone())?;
    let read = |bits: &str| f64::from_bits(u64::from_str_radix(bits, 16).unwrap());
    let numbers: Vec<f64> = numbers.split(' ').map(read).collect();
    // First the defaults, four constants, the moduli and two corners of the body; at the end the body force in stages.
    let mut rest = &numbers[parameters.len() + 6 + 2 * n..];
    let mut take = |letter: &'static str, count: usize| {
        let (taken, others) = rest.split_at(count);
        rest = others;
        (letter, taken.to_vec())
    };
    let letters = ["u", "v", "a", "H", "F", "J", "P", "b"];
    let sizes = [n, n, n, n * n, n * n, 1, n * n, n];
    let mut fields: Judged =
        letters.into_iter().zip(sizes).map(|(l, size)| take(l, size)).collect();
    let together = ["u staged", "v staged", "a", "H", "F staged", "J", "P staged", "b"];
    let together: Vec<_> = together.into_iter().zip(sizes).map(|(l, size)| take(l, size)).collect();
    fields.extend(together.into_iter().filter(|(letter, _)| letter.ends_with("staged")));
    let staged = &numbers[numbers.len() - n..];
    fields.extend(["b staged", "b lattice"].map(|letter| (letter, staged.to_vec())));
    Ok(fields)
}

#[test]
fn generated_c_keeps_the_digits() {
    for field in FIELDS {
        let program = compiled(field.description);
        let judged = |inputs: &[f64]| by_header(&program, field.description, inputs);
        let failures = beyond(field, "C", &judged);
        assert!(failures.is_empty(), "{}", failures.join("\n"));
    }
}

/// Below this, single precision has lost digits to its range, whatever the formula.
const SMALLEST_JUDGED_IN_SINGLE: f64 = 1e-30;

/// The fields in single precision, in the order of [`exact_fields`].
fn in_single(solution: &AnySolution<f32>, X: &[f32], t: f32) -> Vec<f32> {
    fn of<const D: usize>(solution: &dyn Solution<f32, D>, X: &[f32], t: f32) -> Vec<f32> {
        let X = &SVector::from_column_slice(X);
        let vectors =
            [solution.displacement(X, t), solution.velocity(X, t), solution.acceleration(X, t)];
        let matrices = [
            solution.displacement_gradient(X, t),
            solution.deformation_gradient(X, t),
            solution.first_piola_kirchhoff(X, t),
        ];
        let mut all: Vec<f32> = vectors.iter().flat_map(|v| v.iter().copied()).collect();
        all.extend(matrices.iter().flat_map(|A| A.transpose().as_slice().to_vec()));
        all.extend(solution.body_force(X, t).iter());
        all.push(solution.jacobian(X, t));
        all
    }
    match solution {
        AnySolution::One(solution) => of(&**solution, X, t),
        AnySolution::Two(solution) => of(&**solution, X, t),
        AnySolution::Three(solution) => of(&**solution, X, t),
        _ => panic!("no fields"),
    }
}

fn exact_fields(fields: &Fields) -> Vec<Expr> {
    let vectors = [&fields.u, &fields.v, &fields.a].into_iter().flatten();
    let matrices = [&fields.H, &fields.F, &fields.P].into_iter().flatten().flatten();
    vectors.chain(matrices).chain(&fields.b).chain([&fields.J]).copied().collect()
}

/// The acceptance rule with the rounding of single precision.
#[test]
fn generated_rust_keeps_the_digits_of_single_precision() {
    for field in FIELDS {
        let n = field.description.dimension;
        let spec = parse(field.description);
        let mut fields = spec.derive().unwrap();
        let sampler = Sampler::new(&spec, &mut fields);
        let inputs: Vec<Expr> = fields.inputs.iter().map(|(e, _)| *e).collect();
        let expressions = exact_fields(&fields);
        let (graph, definitions) = (&fields.graph, fields.definitions.as_slice());
        let sensitivity = Sensitivity::new(graph, definitions, &inputs, &expressions);
        let mut oracle = Oracle::new(Oracle::USUAL_BITS).unwrap();
        let mut judged = 0;
        for class in [Class::Ordinary, Class::Late, Class::Boundary, Class::Far] {
            for draw in (0..POINTS as u64).filter_map(|index| sampler.draw(class, index)) {
                let single: Vec<f32> = draw.iter().map(|&x| x as f32).collect();
                let rounded: Vec<f64> = single.iter().map(|&x| f64::from(x)).collect();
                let exact = rounded.iter().map(|&x| exact(x).unwrap());
                let values: Vec<_> = inputs.iter().copied().zip(exact).collect();
                let point = Point { graph, definitions, values: &values };
                let exact = oracle.settle(&point, &expressions, 20);
                let exact =
                    exact.and_then(|y| Ok((y, sensitivity.evaluate(&mut oracle, &values)?)));
                let (truth, sens) = match exact {
                    // Far or long behind a front its slope leaves every range.
                    Err(OracleError::Range { .. }) if matches!(class, Class::Far | Class::Late) => {
                        continue;
                    }
                    exact => exact.unwrap(),
                };
                let Some(solution) = (field.single)(&rounded[n + 1..]) else { continue };
                let found = in_single(&solution, &single[..n], single[n]);
                for (index, found) in found.into_iter().enumerate() {
                    let [truth, sens] = [&truth[index], &sens[index]].map(nearest_f64);
                    if sens + truth.abs() < SMALLEST_JUDGED_IN_SINGLE {
                        continue;
                    }
                    let unit = 0.5 * f64::from(f32::EPSILON) * (sens + truth.abs());
                    let factor = (f64::from(found) - truth).abs() / unit;
                    assert!(
                        factor <= LARGEST_FACTOR,
                        "{}, {}: number {index} = {found:?} has K = {factor:.2e}, not {truth:e}, at {single:?}",
                        spec.name,
                        class.name()
                    );
                    judged += 1;
                }
            }
        }
        assert!(judged > 100, "{}: {judged}", spec.name);
    }
}
