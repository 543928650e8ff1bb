//! A new solution is one file: checked before anything is generated, generated, expanded by the macro, compiled and
//! evaluated.

#![allow(clippy::unwrap_used)]

use mmsmith_tests::{cargo, mms, outcome, workspace, xtask};
use std::path::Path;

/// The specification that the README shows: F is not symmetric, and J differs from 1.
fn readme_specification() -> String {
    let readme = std::fs::read_to_string(workspace().join("README.md")).unwrap();
    let (_, rest) = readme.split_once("```toml\n").unwrap();
    rest.split_once("```").unwrap().0.to_owned()
}

/// Writes a package that uses the macro on a specification beside it, and runs it.
fn run_package(folder: &Path, main: &str) -> String {
    let crates = workspace().join("crates");
    let manifest = format!(
        "[package]\nname = 'user'\nversion = '0.0.0'\nedition = '2024'\n[workspace]\n[dependencies]\n\
         mmsmith-macros = {{ path = '{0}/macros' }}\nmmsmith-solutions = {{ path = '{0}/solutions' }}\n\
         [profile.dev]\nopt-level = 1\ndebug = 'line-tables-only'\n",
        crates.display()
    );
    std::fs::write(folder.join("Cargo.toml"), manifest).unwrap();
    // The same versions as the workspace's: they are there already, and need no network.
    std::fs::copy(workspace().join("Cargo.lock"), folder.join("Cargo.lock")).unwrap();
    std::fs::create_dir(folder.join("src")).unwrap();
    std::fs::write(folder.join("src/main.rs"), main).unwrap();
    let mut command = cargo();
    command.current_dir(folder).args(["run", "--quiet", "--offline"]);
    // Next to the workspace's own, so that what has the same features and profile is compiled once.
    command.env("CARGO_TARGET_DIR", workspace().join("target"));
    let (status, out, errors) = outcome(&mut command);
    assert_eq!(status, Some(0), "{errors}");
    out
}

#[test]
#[ignore = "compiles a package of its own, with other features: a minute; .ci/long runs it"]
fn a_new_solution_is_one_file() {
    let folder = tempfile::tempdir().unwrap();
    let spec = folder.path().join("my-shear.toml");
    std::fs::write(&spec, readme_specification()).unwrap();

    let (status, out, errors) = outcome(mms().arg("check").arg(&spec));
    assert_eq!(status, Some(0), "{out}{errors}");

    let generated = folder.path().join("generated");
    let (status, _, errors) = outcome(xtask().arg("gen").arg(&spec).arg("--out").arg(&generated));
    assert_eq!(status, Some(0), "{errors}");
    assert!(generated.join("my_shear.rs").is_file());

    let main = r#"
        mmsmith_macros::manufactured_solution!("../my-shear.toml");
        use mmsmith_solutions::{Solution, nalgebra::SVector};
        fn main() {
            let solution = MyShear::new(MyShearParameters { A: 0.05, ..Default::default() }).unwrap();
            let X = SVector::<f64, 2>::new(0.3, 0.6);
            let u = solution.displacement(&X, 0.01);
            println!("{:?} {:?}", u[0], u[1]);
            let single = MyShear::<f32>::new(Default::default()).unwrap();
            assert!(single.jacobian(&SVector::<f32, 2>::new(0.3, 0.6), 0.01) > 0.0);
            assert!(MyShear::new(MyShearParameters { A: 0.5, ..Default::default() }).is_err());
        }"#;
    let out = run_package(folder.path(), main);
    let u: Vec<f64> = out.split_whitespace().map(|word| word.parse().unwrap()).collect();
    let c = (1000.0_f64 / 2.0).sqrt();
    let pi = std::f64::consts::PI;
    let expected = [
        0.05 * (pi * 0.3).sin() * (pi * 0.3).cos() * (c * pi * 0.01).cos(),
        0.05 * 0.09 * 0.6 * (c * pi * 0.01).sin(),
    ];
    for (found, expected) in u.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-15, "{found} is not {expected}");
    }
}
