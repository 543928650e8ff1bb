//! `mms check` on specifications that nothing was generated from, and on the library.

#![allow(clippy::unwrap_used)]

use mmsmith_tests::{mms, outcome, workspace};

/// Motions without any symmetry, in each kind of coordinates: a mistake in the geometry shows in H, P or b.
#[test]
fn motions_without_symmetry_pass_in_all_coordinates() {
    all_pass("tests/data/specs");
}

/// Each law against the solver's own, and energies and stresses of the specification's own against their differences.
#[test]
fn every_material_passes() {
    all_pass("tests/data/specs/materials");
}

fn all_pass(folder: &str) {
    let mut files: Vec<_> = std::fs::read_dir(workspace().join(folder))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "toml"))
        .collect();
    files.sort();
    assert!(!files.is_empty());
    let (status, out, errors) = outcome(mms().arg("check").args(&files));
    assert_eq!(status, Some(0), "{out}{errors}");
}

#[test]
fn the_whole_library_passes() {
    let (status, out, errors) = outcome(mms().arg("check"));
    assert_eq!(status, Some(0), "{out}{errors}");
    let specs = std::fs::read_dir(workspace().join("mms-specs")).unwrap().count();
    assert_eq!(out.matches(": passed at").count(), specs, "{out}");
}

#[test]
fn a_wrong_declaration_fails_with_the_place() {
    let folder = tempfile::tempdir().unwrap();
    let spec = folder.path().join("ring.toml");
    let text = std::fs::read_to_string(workspace().join("mms-specs/ring.toml")).unwrap();
    // With another factor the inner rim is no longer free of traction.
    std::fs::write(&spec, text.replace("2*R + Ro", "2.001*R + Ro")).unwrap();
    let (status, out, _) = outcome(mms().arg("check").arg(&spec));
    assert_eq!(status, Some(1), "{out}");
    assert!(out.contains("P N on Inner is worst at X = ["), "{out}");
}
