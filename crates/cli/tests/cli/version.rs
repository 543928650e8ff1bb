//! The commit that the build script puts beside the version.

#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;
use std::process::Command;

#[path = "../../build/commit.rs"]
mod commit;

/// The output of git in `folder`, which has to succeed.
fn git(folder: &Path, arguments: &[&str]) -> String {
    let done = Command::new("git").arg("-C").arg(folder).args(arguments).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    String::from_utf8(done.stdout).unwrap().trim().to_owned()
}

/// Makes `folder` a repository, with all that it holds in one commit, and tells that commit.
fn commit_all(folder: &Path) -> String {
    git(folder, &["init", "--quiet"]);
    git(folder, &["config", "user.name", "nobody"]);
    git(folder, &["config", "user.email", "nobody@example.org"]);
    git(folder, &["config", "commit.gpgsign", "false"]);
    git(folder, &["add", "."]);
    git(folder, &["commit", "--quiet", "--message", folder.to_str().unwrap()]);
    git(folder, &["rev-parse", "--short=10", "HEAD"])
}

#[test]
fn sources_tell_a_commit_of_their_own_repository_alone() {
    let place = tempfile::tempdir().unwrap();
    let sources = place.path().join("vendored/mmsmith");
    fs::create_dir_all(sources.join("crates")).unwrap();
    fs::write(sources.join("Cargo.toml"), "[workspace]\n").unwrap();
    fs::write(sources.join("crates/lib.rs"), "").unwrap();
    assert_eq!(commit::of(&sources), None, "without a repository");
    let foreign = commit_all(place.path());
    assert_eq!(commit::of(&sources), None, "in the repository of somebody else, at {foreign}");

    let own = commit_all(&sources);
    assert_ne!(own, foreign);
    assert_eq!(commit::of(&sources), Some(own.clone()));
    fs::write(sources.join("crates/lib.rs"), "// Other.\n").unwrap();
    assert_eq!(commit::of(&sources), Some(format!("{own} with changes")));
}
