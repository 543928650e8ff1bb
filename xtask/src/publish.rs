//! Conditions under which the crates can be published.

use crate::read;
use anyhow::{Context, bail};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Keys that each published package states.
const KEYS: [&str; 5] = ["description", "license", "readme", "documentation", "rust_version"];

/// A line for each fault, or one that says that there is none, and whether there is one.
pub(crate) fn check(repository: &Path, no_build: bool) -> anyhow::Result<(Vec<String>, bool)> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let described = Command::new(&cargo)
        .args(["metadata", "--no-deps", "--format-version", "1"])
        .current_dir(repository)
        .output()
        .context("cannot start cargo metadata")?;
    if !described.status.success() {
        bail!("cargo metadata fails:\n{}", String::from_utf8_lossy(&described.stderr));
    }
    let packages: Value =
        serde_json::from_slice(&described.stdout).context("cargo metadata writes no JSON")?;
    let packages = packages["packages"].as_array().context("cargo metadata lists no packages")?;
    let mut lines: Vec<String> = packages.iter().flat_map(manifest_faults).collect();
    let mut published = 0;
    for package in packages.iter().filter(|package| is_published(package)) {
        published += 1;
        lines.extend(leaving(package)?);
    }
    if !lines.is_empty() {
        return Ok((lines, true));
    }
    // In the order of their dependencies, which stand in for those that the registry does not have yet.
    let mut order = Command::new(&cargo);
    order.current_dir(repository);
    if no_build {
        order.args(["package", "--workspace", "--no-verify", "--allow-dirty"]);
        for package in packages.iter().filter(|package| !is_published(package)) {
            order.args(["--exclude", package["name"].as_str().unwrap_or_default()]);
        }
    } else {
        order.args(["publish", "--workspace", "--dry-run", "--allow-dirty"]);
    }
    let done = order.output().context("cannot start cargo")?;
    let said = String::from_utf8_lossy(&done.stderr);
    let warnings =
        said.lines().filter(|line| line.starts_with("warning:") && !line.contains("dry run"));
    lines.extend(warnings.map(str::to_owned));
    if !done.status.success() {
        lines.push(format!("cargo ends with {}:\n{said}", done.status));
    }
    let failed = !lines.is_empty();
    if !failed {
        lines.push(format!(
            "{published} packages can be published, in the order of cargo publish --workspace"
        ));
    }
    Ok((lines, failed))
}

/// Whether a package goes to the registry: `publish = false` is an empty list.
fn is_published(package: &Value) -> bool {
    package["publish"].as_array().is_none_or(|registries| !registries.is_empty())
}

/// Faults of the manifest of a package.
fn manifest_faults(package: &Value) -> Vec<String> {
    let name = package["name"].as_str().unwrap_or("a package without a name");
    let manifest = Path::new(package["manifest_path"].as_str().unwrap_or_default());
    let in_crates = manifest.ancestors().nth(2).is_some_and(|folder| folder.ends_with("crates"));
    let mut faults = Vec::new();
    match (in_crates, is_published(package)) {
        (true, false) => faults.push(format!("{name} lies in crates and is not published")),
        (false, true) => faults.push(format!(
            "{name} is for the repository alone: write publish = false into its [package]"
        )),
        (false, false) => return faults,
        (true, true) => {}
    }
    let missing = KEYS.iter().filter(|key| package[**key].as_str().is_none_or(str::is_empty));
    faults
        .extend(missing.map(|key| format!("{name} states no {key}; write {key}.workspace = true")));
    if package["metadata"]["docs"]["rs"].is_null() {
        faults.push(format!("{name} has no [package.metadata.docs.rs]"));
    }
    for dependency in
        package["dependencies"].as_array().into_iter().flatten().filter(|d| d["path"].is_string())
    {
        let other = dependency["name"].as_str().unwrap_or_default();
        let is_for_tests = dependency["kind"] == "dev";
        // Tests may use crates that depend on this one, which the registry gets later: without a version they are left out.
        match (is_for_tests, dependency["req"] == "*") {
            (false, true) => faults.push(format!("{name} needs {other} without a version; write {other}.workspace = true")),
            (true, false) => faults.push(format!(
                "tests of {name} need {other} with a version; write {other} = {{ path = \"../{}\" }}",
                other.trim_start_matches("mmsmith-")
            )),
            _ => {}
        }
    }
    faults
}

/// Files outside of the package that its code includes: they would be missing there. Code of tests is not in the package's build.
fn leaving(package: &Value) -> anyhow::Result<Vec<String>> {
    let manifest = PathBuf::from(package["manifest_path"].as_str().unwrap_or_default());
    let Some(folder) = manifest.parent() else { return Ok(Vec::new()) };
    let mut faults = Vec::new();
    for path in crate::docs::files(&folder.join("src"), "rs")? {
        let text = read(&path)?;
        let code = text.split("#[cfg(test)]").next().unwrap_or_default();
        for (number, line) in code.lines().enumerate() {
            let included = ["include_str!(\"", "include_bytes!(\"", "include!(\""]
                .iter()
                .find_map(|call| line.split_once(call).and_then(|(_, rest)| rest.split_once('"')));
            let Some((name, _)) = included else { continue };
            let depth = path
                .parent()
                .and_then(|own| own.strip_prefix(folder).ok())
                .map_or(0, |own| own.components().count());
            let up = Path::new(name).components().filter(|part| part.as_os_str() == "..").count();
            if up > depth {
                faults.push(format!(
                    "{}:{}: {name} lies outside of the package",
                    path.display(),
                    number + 1
                ));
            }
        }
    }
    Ok(faults)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_package_of_crates_states_all_that_the_registry_asks() {
        let mut package = json!({
            "name": "mmsmith-a", "manifest_path": "/r/crates/a/Cargo.toml", "publish": null, "description": "a", "license": "MIT",
            "readme": "../README.md", "documentation": "d", "rust_version": "1.95", "metadata": {"docs": {"rs": {}}},
            "dependencies": [
                {"name": "mmsmith-b", "path": "/r/crates/b", "kind": null, "req": "^0.2.0"},
                {"name": "mmsmith-c", "path": "/r/crates/c", "kind": "dev", "req": "*"},
                {"name": "libm", "kind": null, "req": "*"},
            ],
        });
        assert_eq!(manifest_faults(&package), [""; 0]);
        package["dependencies"][0]["req"] = json!("*");
        package["dependencies"][1]["req"] = json!("^0.2.0");
        package["readme"] = json!(null);
        let faults = manifest_faults(&package).join("\n");
        for part in ["no readme", "needs mmsmith-b without", "mmsmith-c = { path = \"../c\" }"] {
            assert!(faults.contains(part), "{faults}");
        }
        package["publish"] = json!([]);
        assert!(manifest_faults(&package)[0].contains("is not published"));
        package["manifest_path"] = json!("/r/xtask/Cargo.toml");
        assert_eq!(manifest_faults(&package), [""; 0]);
        package["publish"] = json!(null);
        assert!(manifest_faults(&package)[0].contains("publish = false"));
    }

    #[test]
    fn packages_of_this_repository_include_none_but_their_own_files() {
        let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates");
        for folder in std::fs::read_dir(crates).unwrap() {
            let manifest = folder.unwrap().path().join("Cargo.toml");
            let package = json!({ "manifest_path": manifest });
            if manifest.is_file() {
                assert_eq!(leaving(&package).unwrap(), [""; 0]);
            }
        }
    }
}
