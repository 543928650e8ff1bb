//! Conditions under which the crates can be published.

use crate::read;
use anyhow::{Context, bail};
use serde_json::Value;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// Keys that each published package states.
const KEYS: [&str; 5] = ["description", "license", "readme", "documentation", "rust_version"];

/// A line for each fault, or one that says that there is none, and whether there is one. What takes time is told meanwhile.
pub(crate) fn check(
    repository: &Path,
    no_build: bool,
    say: impl Fn(&str),
) -> anyhow::Result<(Vec<String>, bool)> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let described = Command::new(&cargo)
        .args(["metadata", "--no-deps", "--format-version", "1"])
        .current_dir(repository)
        .output()
        .context("cannot start cargo metadata")?;
    if !described.status.success() {
        bail!("cargo metadata fails:\n{}", String::from_utf8_lossy(&described.stderr));
    }
    let described: Value =
        serde_json::from_slice(&described.stdout).context("cargo metadata writes no JSON")?;
    let packages = described["packages"].as_array().context("cargo metadata lists no packages")?;
    let mut lines: Vec<String> = packages.iter().flat_map(manifest_faults).collect();
    let (published, others): (Vec<&Value>, Vec<&Value>) =
        packages.iter().partition(|package| is_published(package));
    for package in &published {
        lines.extend(leaving(package)?);
    }
    if !lines.is_empty() {
        return Ok((lines, true));
    }
    // In the order of their dependencies, which stand in for those that the registry does not have yet.
    say("packing");
    let mut pack = Command::new(&cargo);
    pack.current_dir(repository).args(["package", "--workspace", "--no-verify", "--allow-dirty"]);
    for package in others {
        pack.args(["--exclude", text(package, "name")]);
    }
    lines = faults(&mut pack)?;
    if lines.is_empty() && !no_build {
        let target = Path::new(text(&described, "target_directory"));
        let place = target.join("package/unpacked");
        let names: Vec<&str> = published.iter().map(|package| text(package, "name")).collect();
        unpack(&published, &target.join("package"), &place)?;
        std::fs::copy(repository.join("Cargo.lock"), place.join("Cargo.lock"))
            .context("cannot copy Cargo.lock")?;
        lines = compile(&cargo, repository, &place, target, &names, say)?;
    }
    let failed = !lines.is_empty();
    if !failed {
        lines.push(format!(
            "{} packages can be published, in the order of cargo publish --workspace",
            published.len()
        ));
    }
    Ok((lines, failed))
}

/// Unpacks the files of `packages` from the folder `packed` into a workspace of their own at `place`, in which they are the packages of the
/// registry to each other.
fn unpack(packages: &[&Value], packed: &Path, place: &Path) -> anyhow::Result<()> {
    if place.exists() {
        std::fs::remove_dir_all(place)
            .with_context(|| format!("cannot remove {}", place.display()))?;
    }
    let mut members = String::new();
    let mut patches = String::new();
    for package in packages {
        let name = text(package, "name");
        let folder = format!("{name}-{}", text(package, "version"));
        members += &format!("    \"{folder}\",\n");
        patches += &format!("{name} = {{ path = \"{folder}\" }}\n");
    }
    let manifest = format!(
        "[workspace]\nresolver = \"3\"\nmembers = [\n{members}]\n\n[patch.crates-io]\n{patches}"
    );
    crate::write(&place.join("Cargo.toml"), &manifest)?;
    for package in packages {
        let file = format!("{}-{}.crate", text(package, "name"), text(package, "version"));
        let mut tar = Command::new("tar");
        // All files in it have one and the same time, from which Cargo would take changed ones for those that it has compiled.
        tar.args(["--extract", "--gzip", "--touch", "--directory"]).arg(place);
        let done =
            tar.arg("--file").arg(packed.join(&file)).output().context("cannot start tar")?;
        if !done.status.success() {
            bail!("{file} cannot be unpacked:\n{}", String::from_utf8_lossy(&done.stderr));
        }
    }
    Ok(())
}

/// Compiles each package by itself, with the features that it asks of the others and no more, up to the first fault.
///
/// `cargo publish --dry-run` would keep the sources of all packages in Cargo's home by name and version, and compile these when it is called
/// again after a change.
fn compile(
    cargo: &OsStr,
    repository: &Path,
    place: &Path,
    target: &Path,
    names: &[&str],
    say: impl Fn(&str),
) -> anyhow::Result<Vec<String>> {
    for (number, name) in names.iter().enumerate() {
        say(&format!("{name}, {} of {}", number + 1, names.len()));
        let start = Instant::now();
        let mut check = Command::new(cargo);
        // With the compiler that the repository names, also where the target lies elsewhere.
        check.current_dir(repository).args(["check", "--package", name, "--manifest-path"]);
        check.arg(place.join("Cargo.toml")).arg("--target-dir").arg(target);
        // Whoever builds the package has no lints of this repository.
        check.env_remove("RUSTC_WRAPPER").env_remove("CLIPPY_ARGS");
        let lines = faults(&mut check)?;
        if !lines.is_empty() {
            return Ok(lines);
        }
        say(&format!("{name}: {:.0} s", start.elapsed().as_secs_f64()));
    }
    Ok(Vec::new())
}

/// Warnings of a call of Cargo, and all that it says where it fails.
fn faults(cargo: &mut Command) -> anyhow::Result<Vec<String>> {
    let done = cargo.output().context("cannot start cargo")?;
    let said = String::from_utf8_lossy(&done.stderr);
    let warnings = said.lines().filter(|line| line.starts_with("warning:"));
    let mut lines: Vec<String> = warnings.map(str::to_owned).collect();
    if !done.status.success() {
        lines.push(format!("cargo ends with {}:\n{said}", done.status));
    }
    Ok(lines)
}

/// A text in what Cargo tells of a package, or an empty one.
fn text<'a>(package: &'a Value, key: &str) -> &'a str {
    package[key].as_str().unwrap_or_default()
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
    use std::fs;

    /// Packs a package as Cargo does: all files are of one time.
    fn pack(place: &Path, name: &str, dependencies: &str, code: &str) {
        let folder = place.join(format!("{name}-0.1.0"));
        fs::create_dir_all(folder.join("src")).unwrap();
        let manifest = format!(
            "[package]\nname = \"{name}\"\nversion = \"0.1.0\"\nedition = \"2024\"\n\n[dependencies]\n{dependencies}"
        );
        fs::write(folder.join("Cargo.toml"), manifest).unwrap();
        fs::write(folder.join("src/lib.rs"), code).unwrap();
        let mut tar = Command::new("tar");
        tar.args(["--create", "--gzip", "--mtime=@1000000000", "--directory"]).arg(place);
        tar.arg("--file").arg(place.join(format!("{name}-0.1.0.crate")));
        assert!(tar.arg(format!("{name}-0.1.0")).status().unwrap().success());
    }

    #[test]
    fn packages_are_compiled_with_each_other_as_they_are_now() {
        let folder = tempfile::tempdir().unwrap();
        let (packed, target) = (folder.path().join("packed"), folder.path().join("target"));
        let names = ["mmsmith-small", "mmsmith-user"];
        let packages = names.map(|name| json!({"name": name, "version": "0.1.0"}));
        let compiled = || {
            let place = folder.path().join("unpacked");
            unpack(&packages.each_ref(), &packed, &place).unwrap();
            compile(OsStr::new("cargo"), folder.path(), &place, &target, &names, |_| ()).unwrap()
        };
        let user = "pub fn g() -> u8 { mmsmith_small::";
        pack(&packed, names[0], "", "pub fn first() -> u8 { 1 }");
        pack(&packed, names[1], "mmsmith-small = \"0.1.0\"", &format!("{user}first() }}"));
        assert_eq!(compiled(), [""; 0]);
        pack(&packed, names[0], "", "pub fn other() -> u8 { 1 }");
        let faults = compiled().join("\n");
        assert!(faults.contains("cannot find function `first`"), "{faults}");
        pack(&packed, names[1], "mmsmith-small = \"0.1.0\"", &format!("{user}other() }}"));
        assert_eq!(compiled(), [""; 0]);
        pack(&packed, names[0], "", "pub fn other() -> u8 { let unused = 2; 1 }");
        let faults = compiled().join("\n");
        assert!(faults.contains("warning: unused variable"), "{faults}");
    }

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
