//! `cargo xtask page`: the page where anyone tries mmsmith, as a folder that any web server shows.

use crate::read;
use anyhow::{Context, bail};
use mmsmith_spec::Spec;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The module where the compiler leaves it, below the folder of builds.
const BUILT: &str = "wasm32-unknown-unknown/page/mmsmith_page.wasm";
/// Folders of the library, and what the page calls them.
const GROUPS: &[(&str, &str)] = &[
    ("", "Elastic"),
    ("with-memory", "With memory, or different from place to place"),
    ("incompressible", "Without a change of volume"),
    ("revolution", "Bodies of revolution"),
];

/// Builds the modules, and writes all files of the page into `out`.
///
/// Without the solver the page has all but checks and orders.
pub(crate) fn run(repository: &Path, out: &Path, with_solver: bool) -> anyhow::Result<Vec<String>> {
    std::fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))?;
    let mut lines = Vec::new();
    let mut modules = vec![("mmsmith.wasm", false)];
    if with_solver {
        modules.push(("mmsmith-solver.wasm", true));
    }
    for (name, has_solver) in modules {
        let built = compile(repository, has_solver)?;
        let bytes = std::fs::read(&built).with_context(|| built.display().to_string())?;
        let module = without_names(&bytes).with_context(|| built.display().to_string())?;
        keep(&out.join(name), &module)?;
        lines.push(format!("{}: {} bytes", out.join(name).display(), module.len()));
    }
    for path in files(&repository.join("page/web"))? {
        let Some(name) = path.file_name() else { continue };
        let bytes = std::fs::read(&path).with_context(|| path.display().to_string())?;
        keep(&out.join(name), &bytes)?;
    }
    keep(&out.join("library.json"), library(repository)?.to_string().as_bytes())?;
    lines.push(format!("{}: any web server shows it", out.join("index.html").display()));
    Ok(lines)
}

/// The compiled module.
fn compile(repository: &Path, has_solver: bool) -> anyhow::Result<PathBuf> {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.current_dir(repository).args(["build", "--quiet", "--package", "mmsmith-page"]);
    cargo.args(["--profile", "page", "--target", "wasm32-unknown-unknown"]);
    if has_solver {
        cargo.args(["--features", "solver"]);
    }
    if !cargo.status().context("cannot run cargo")?.success() {
        bail!(
            "the page could not be compiled; where the target is what lacks: rustup target add wasm32-unknown-unknown"
        );
    }
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or("target".into(), PathBuf::from);
    Ok(repository.join(target).join(BUILT))
}

/// A module without its custom sections: names for debuggers, and who made it.
fn without_names(module: &[u8]) -> Option<Vec<u8>> {
    /// The magic number and the version.
    const HEAD: usize = 8;
    let mut kept = module.get(..HEAD)?.to_vec();
    let mut rest = &module[HEAD..];
    while let Some((&kind, after)) = rest.split_first() {
        let (mut length, mut digits) = (0_usize, 0);
        loop {
            let byte = *after.get(digits)?;
            length |= usize::from(byte & 0x7f) << (7 * digits);
            digits += 1;
            if byte < 0x80 {
                break;
            }
        }
        let whole = rest.get(..1 + digits + length)?;
        if kind != 0 {
            kept.extend_from_slice(whole);
        }
        rest = &rest[whole.len()..];
    }
    Some(kept)
}

/// The specifications of the library, in groups.
fn library(repository: &Path) -> anyhow::Result<Value> {
    let mut all = Vec::new();
    for (folder, group) in GROUPS {
        for path in files(&repository.join("mms-specs").join(folder))? {
            if path.extension().is_none_or(|ending| ending != "toml") {
                continue;
            }
            let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let text = read(&path)?;
            let spec = Spec::parse(&text, &file)?;
            all.push(json!({
                "name": spec.name, "title": spec.title, "group": group, "file": file, "text": text,
            }));
        }
    }
    Ok(Value::Array(all))
}

/// The files that lie in a folder itself, in order.
fn files(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let context = || format!("cannot read {}", folder.display());
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(context)? {
        let path = entry.with_context(context)?.path();
        if path.is_file() {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

fn keep(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    std::fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}
