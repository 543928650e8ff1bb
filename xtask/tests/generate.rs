//! `cargo xtask gen` through its binary: the committed code is current, output is deterministic, and bad input
//! changes nothing.

#![allow(clippy::unwrap_used)]

use mmsmith_codegen::HOSTS;
use sha2::{Digest, Sha256};
use std::path::Path;
use std::process::Command;

fn workspace() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

fn xtask() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_xtask"));
    command.current_dir(workspace());
    command
}

/// The exit status, standard output and standard error.
fn outcome(command: &mut Command) -> (Option<i32>, String, String) {
    let output = command.output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

/// A small specification.
const SPEC: &str = r"name = 'small'
title = 'Small'
coordinates = 'cartesian'
dimension = 1

[parameters]
A = { default = 0.1, range = '> -1/4, < 1/4' }
E = { default = 1000, range = '> 0' }
rho0 = { default = 2, range = '> 0' }

[let]
c = 'sqrt(E/rho0)'

[displacement]
X = 'A*sin(Pi*X)*cos(c*Pi*t)'

[material]
law = 'neo-hookean'
lambda = 0
mu = 'E/2'

[domain]
shape = 'box'
lower = [0]
upper = [1]

[time]
period = '2/c'
";

#[test]
fn committed_code_is_what_the_specifications_generate() {
    let (status, out, errors) = outcome(xtask().args(["gen", "--check"]));
    assert_eq!(status, Some(0), "{out}{errors}");
}

#[test]
fn a_stale_module_fails_the_check_and_names_the_command() {
    // A copy of the parts that generation touches, with one specification changed.
    let folder = tempfile::tempdir().unwrap();
    let spec = workspace().join("mms-specs/ring.toml");
    let text = std::fs::read_to_string(&spec).unwrap().replace("Ro - 3*Ri", "Ro - 4*Ri");
    let changed = folder.path().join("ring.toml");
    std::fs::write(&changed, text).unwrap();
    let (status, out, _) = outcome(xtask().args(["gen", "--check"]).arg(&changed));
    assert_eq!(status, Some(1), "{out}");
    assert!(out.contains("stale: crates/solutions/src/generated/ring.rs"), "{out}");
    assert!(out.contains("stale: crates/solutions/headers.sha256, ring.h"), "{out}");
    assert!(out.contains("cargo xtask gen"), "{out}");
}

#[test]
fn generation_is_deterministic_to_the_byte() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["axis-aligned", "ring"] {
        let (status, _, errors) = outcome(xtask().args(["gen", name, "--out"]).arg(folder.path()));
        assert_eq!(status, Some(0), "{errors}");
        let module = name.replace('-', "_");
        let written = |file: &str| std::fs::read(folder.path().join(file)).unwrap();
        let file = format!("{module}.rs");
        let committed = workspace().join("crates/solutions/src/generated").join(&file);
        assert_eq!(written(&file), std::fs::read(committed).unwrap(), "{file}");
        let file = format!("{module}.h");
        let digest: String =
            Sha256::digest(written(&file)).iter().map(|byte| format!("{byte:02x}")).collect();
        let list = std::fs::read_to_string(workspace().join("crates/solutions/headers.sha256"));
        assert!(list.unwrap().lines().any(|line| line == format!("{digest}  {file}")), "{file}");
    }
}

#[test]
fn one_target_leaves_the_other_alone() {
    for (target, written, left) in [("rust", "ring.rs", "ring.h"), ("c", "ring.h", "ring.rs")] {
        let folder = tempfile::tempdir().unwrap();
        let mut command = xtask();
        command.args(["gen", "ring", "--target", target, "--out"]).arg(folder.path());
        let (status, out, errors) = outcome(&mut command);
        assert_eq!(status, Some(0), "{errors}");
        assert!(out.contains(written) && !out.contains(left), "{out}");
        assert!(folder.path().join(written).is_file() && !folder.path().join(left).exists());
        // With --check nothing is written, and the committed files of that target are current.
        let (status, out, _) = outcome(xtask().args(["gen", "--check", "--target", target]));
        assert_eq!(status, Some(0), "{out}");
    }
    let (status, _, errors) = outcome(xtask().args(["gen", "--target", "cobol"]));
    assert_eq!(status, Some(2));
    for host in HOSTS {
        assert!(errors.contains(host.name), "{}: {errors}", host.name);
    }
}

/// The files of other hosts go where the caller says, and are checked there.
#[test]
fn hosts_without_files_in_the_repository_need_a_folder() {
    for host in HOSTS.iter().filter(|host| !["rust", "c"].contains(&host.name)) {
        let (status, _, errors) = outcome(xtask().args(["gen", "--target", host.name]));
        assert_eq!(status, Some(2), "{}", host.name);
        let line = format!("cargo xtask gen --target {} --out code", host.name);
        assert!(errors.contains(&line), "{errors}");
        let folder = tempfile::tempdir().unwrap();
        let run = |check: &[&str]| {
            let mut command = xtask();
            command.args(["gen", "ring", "skew-3d", "--target", host.name]).args(check);
            outcome(command.arg("--out").arg(folder.path()))
        };
        assert_eq!(run(&["--check"]).0, Some(1), "{}", host.name);
        assert_eq!(run(&[]).0, Some(0), "{}", host.name);
        assert_eq!(run(&["--check"]).0, Some(0), "{}", host.name);
        assert!(folder.path().join(host.file_name("skew_3d")).is_file(), "{}", host.name);
    }
}

#[test]
fn check_compares_with_another_folder_and_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let check =
        |folder: &Path| outcome(xtask().args(["gen", "ring", "--check", "--out"]).arg(folder));
    let (status, out, _) = check(folder.path());
    assert_eq!(status, Some(1), "{out}");
    assert!(out.contains("ring.h") && out.contains("ring.rs"), "{out}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    let (status, ..) = outcome(xtask().args(["gen", "ring", "--out"]).arg(folder.path()));
    assert_eq!(status, Some(0));
    assert_eq!(check(folder.path()).0, Some(0));
    let header = folder.path().join("ring.h");
    let changed =
        std::fs::read_to_string(&header).unwrap().replacen("const double t", "const double  t", 1);
    std::fs::write(&header, changed).unwrap();
    let (status, out, _) = check(folder.path());
    assert_eq!(status, Some(1));
    assert!(out.contains("ring.h, from line") && !out.contains("ring.rs"), "{out}");
}

#[test]
fn solutions_whose_names_differ_by_hyphens_only_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    // The library has `skew-2d`.
    let spec = folder.path().join("skew2d.toml");
    std::fs::write(&spec, SPEC.replace("small", "skew2d")).unwrap();
    for arguments in [&["--check"][..], &["--target", "c"], &[]] {
        let (status, out, errors) = outcome(xtask().arg("gen").args(arguments).arg(&spec));
        assert_eq!(status, Some(2), "{out}");
        assert!(errors.contains("'skew-2d'") && errors.contains("'skew2d'"), "{errors}");
        assert!(errors.contains("type Skew2d") && errors.contains("rename"), "{errors}");
    }
    // Nothing was written.
    let (status, out, _) = outcome(xtask().args(["gen", "--check"]));
    assert_eq!(status, Some(0), "{out}");
}

#[test]
fn a_mistake_in_one_specification_keeps_all_from_being_written() {
    let folder = tempfile::tempdir().unwrap();
    let generated = folder.path().join("generated");
    let good = folder.path().join("small.toml");
    let bad = folder.path().join("bad.toml");
    std::fs::write(&good, SPEC).unwrap();
    std::fs::write(&bad, SPEC.replace("small", "bad").replace("A*sin", "A*(sin")).unwrap();
    let (status, out, errors) =
        outcome(xtask().arg("gen").arg(&good).arg(&bad).arg("--out").arg(&generated));
    assert_eq!(status, Some(2), "{out}");
    assert!(errors.contains("bad.toml:15:8") && errors.contains("never closed"), "{errors}");
    assert!(errors.contains('^'), "{errors}");
    assert!(
        !generated.exists(),
        "the good specification was written although the other one is bad"
    );
}

#[test]
fn a_file_must_be_called_as_its_solution() {
    let folder = tempfile::tempdir().unwrap();
    let spec = folder.path().join("other.toml");
    std::fs::write(&spec, SPEC).unwrap();
    let (status, _, errors) =
        outcome(xtask().arg("gen").arg(&spec).arg("--out").arg(folder.path()));
    assert_eq!(status, Some(2));
    assert!(errors.contains("must be called small.toml"), "{errors}");
}

#[test]
fn a_missing_specification_and_an_unwritable_folder_are_named() {
    let (status, _, errors) = outcome(xtask().args(["gen", "nowhere"]));
    assert_eq!(status, Some(2));
    assert!(errors.contains("there is no specification nowhere"), "{errors}");

    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    let (status, _, errors) = outcome(xtask().args(["gen", "ring", "--out"]).arg(&file));
    assert_eq!(status, Some(2));
    assert!(errors.contains("cannot write"), "{errors}");
}
