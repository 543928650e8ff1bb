//! The commit of the sources, for the build script; a file of its own, so that the tests of the command have it too.

use std::path::Path;
use std::process::Command;

/// The commit that is checked out, and whether sources differ from it. This runs anew where sources change, so that it is the state
/// from which the command was built, also after that state has been committed.
pub(crate) fn of(root: &Path) -> Option<String> {
    // Sources without a history of their own, such as those for Python, may lie in the repository of somebody else.
    if !root.join(".git").exists() {
        return None;
    }
    let git = |arguments: &[&str]| {
        let done = Command::new("git").arg("-C").arg(root).args(arguments).output().ok()?;
        done.status.success().then(|| String::from_utf8_lossy(&done.stdout).trim().to_owned())
    };
    let commit = git(&["rev-parse", "--short=10", "HEAD"]).filter(|commit| !commit.is_empty())?;
    let changes =
        git(&["status", "--porcelain", "--", "crates", "mms-specs", "Cargo.toml", "Cargo.lock"])?;
    Some(if changes.is_empty() { commit } else { format!("{commit} with changes") })
}
