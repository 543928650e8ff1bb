//! The generated functions and the interpreted programs of every specification, against the oracle.
//!
//! A few points of each class; `mms check --thorough` takes as many as you like. Prints a table of the worst factor `K` of
//! the acceptance rule, by field and class of inputs.
#![allow(clippy::print_stdout, clippy::unwrap_used)]

use mmsmith_oracle::{Accuracy, Class, Judged, LARGEST_FACTOR};
use mmsmith_solutions::build;
use mmsmith_spec::Spec;
use std::path::Path;

/// In each class, for the library's solutions and for the further specifications.
const POINTS: usize = 60;
const POINTS_OF_FURTHER: usize = 6;

fn judge(
    spec: &Spec,
    way: &str,
    accuracy: &Accuracy<'_>,
    (classes, points): (&[Class], usize),
    judged: &(dyn Fn(&[f64]) -> Result<Judged, String> + Sync),
    failures: &mut Vec<String>,
) {
    for &class in classes {
        let found = accuracy.measure(class, points, judged, &|| ()).unwrap();
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

/// What goes beyond the bound in one specification of the library.
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
    judge(&spec, "generated", &accuracy, (&Class::ALL, POINTS), &generated, &mut failures);
    let programs = accuracy.programs();
    let interpreted = |inputs: &[f64]| -> Result<Judged, String> {
        Ok(programs.iter().map(|(letter, p)| (*letter, p.evaluate(inputs))).collect())
    };
    judge(&spec, "program", &accuracy, (&Class::ALL, POINTS / 4), &interpreted, &mut failures);
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
fn sums_of_coordinates_keep_their_digits_far_from_the_body() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../mms-specs/skew-3d.toml");
    let spec = Spec::parse(&std::fs::read_to_string(file).unwrap(), "skew-3d.toml").unwrap();
    let accuracy = Accuracy::new(&spec, spec.derive().unwrap());
    let generated = |inputs: &[f64]| -> Result<Judged, String> {
        let solution = build(&spec.name, &inputs[4..]).ok_or("not in the library")?;
        let solution = solution.map_err(|error| error.to_string())?;
        solution.each_field(&inputs[..3], inputs[3]).ok_or("wrong dimension".into())
    };
    let mut failures = Vec::new();
    judge(&spec, "generated", &accuracy, (&[Class::Far], 150), &generated, &mut failures);
    assert!(failures.is_empty(), "beyond K = {LARGEST_FACTOR}:\n{}", failures.join("\n"));
}

/// What goes beyond the bound in the specifications of a folder, by the programs alone.
fn by_programs(folder: &str, classes: &[Class]) -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/specs").join(folder);
    let mut files: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|file| file.unwrap().path())
        .filter(|f| f.extension().is_some_and(|e| e == "toml"))
        .collect();
    files.sort();
    assert!(files.len() > 3, "{files:?}");
    let mut failures = Vec::new();
    for file in files {
        let text = std::fs::read_to_string(&file).unwrap();
        let spec = Spec::parse(&text, &file.display().to_string()).unwrap();
        let accuracy = Accuracy::new(&spec, spec.derive().unwrap());
        let programs = accuracy.programs();
        let interpreted = |inputs: &[f64]| -> Result<Judged, String> {
            Ok(programs.iter().map(|(letter, p)| (*letter, p.evaluate(inputs))).collect())
        };
        let drawn = (classes, POINTS_OF_FURTHER);
        judge(&spec, "program", &accuracy, drawn, &interpreted, &mut failures);
    }
    failures
}

/// Laws that no solution of the library has.
#[test]
fn further_specifications() {
    // Next to the origin these fields are subnormal numbers, with few digits to judge.
    let classes: Vec<Class> =
        Class::ALL.iter().copied().filter(|class| *class != Class::NearOrigin).collect();
    let failures = by_programs("materials", &classes);
    assert!(failures.is_empty(), "beyond K = {LARGEST_FACTOR}:\n{}", failures.join("\n"));
}

/// Fronts that have passed, and volumes that do not change: K was 1e14 and 400 before the derivation knew of them.
#[test]
fn specifications_whose_terms_nearly_cancel() {
    let failures = by_programs("digits", &Class::ALL);
    assert!(failures.is_empty(), "beyond K = {LARGEST_FACTOR}:\n{}", failures.join("\n"));
}

/// The points of a class are what the class says.
#[test]
fn points_are_of_their_class() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../mms-specs");
    for (name, class) in [("axis-aligned", Class::NearInversion), ("ring", Class::NearInversion)] {
        let text = std::fs::read_to_string(folder.join(name).with_extension("toml")).unwrap();
        let spec = Spec::parse(&text, name).unwrap();
        let mut fields = spec.derive().unwrap();
        let jacobian = fields.program(&[fields.J]);
        let sampler = mmsmith_oracle::Sampler::new(&spec, &mut fields);
        let J: Vec<f64> = (0..40)
            .map(|index| jacobian.evaluate(&sampler.draw(class, index).unwrap())[0])
            .collect();
        assert!(J.iter().all(|&J| J > 0.0 && J < 0.2), "{name}: {J:?}");
        assert!(J.iter().any(|&J| J < 1e-5), "{name}: {J:?}");
    }
}
