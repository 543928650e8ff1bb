//! `cargo xtask gen`: specifications to Rust modules.

use crate::{read, write};
use anyhow::{Context, anyhow, bail};
use mmsmith_codegen::{Names, module_source, registry_source};
use mmsmith_spec::Spec;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What was done, in lines for people.
pub(crate) struct Outcome {
    pub(crate) lines: Vec<String>,
    pub(crate) stale: bool,
}

/// Generates from `given`, or from every specification of the repository.
///
/// Every specification is read and derived before anything is written.
pub(crate) fn run(
    repository: &Path,
    given: &[PathBuf],
    out: Option<&Path>,
    check: bool,
) -> anyhow::Result<Outcome> {
    let library = repository.join("mms-specs");
    let generated = repository.join("crates/solutions/src/generated");
    let all = library_specs(&library)?;
    let chosen = match given {
        [] => all.clone(),
        _ => given.iter().map(|path| locate(&library, path)).collect::<anyhow::Result<_>>()?,
    };

    let mut modules: BTreeMap<String, String> = BTreeMap::new();
    for path in &chosen {
        let (name, text) = generate(repository, path)?;
        if modules.insert(name.clone(), text).is_some() {
            bail!("two specifications are called '{name}'; the second is {}", path.display());
        }
    }
    let folder = out.unwrap_or(&generated);
    let mut files: BTreeMap<PathBuf, Option<String>> = modules
        .iter()
        .map(|(name, text)| {
            (folder.join(Names::of(name).module).with_extension("rs"), Some(text.clone()))
        })
        .collect();
    if out.is_none() {
        let mut names: Vec<String> =
            all.iter().filter_map(|path| Some(path.file_stem()?.to_str()?.to_owned())).collect();
        names.extend(modules.keys().cloned());
        let orphans = orphans(&generated, &names)?;
        if given.is_empty() {
            // A module without a specification cannot be kept up to date.
            files.extend(orphans.into_iter().map(|(path, _)| (path, None)));
        } else {
            names.extend(orphans.into_iter().map(|(_, name)| name));
        }
        names.sort_unstable();
        names.dedup();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        files.insert(generated.join("mod.rs"), Some(registry_source(&names)));
    }
    if check { compare(repository, &files) } else { update(repository, &files) }
}

fn library_specs(library: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let context = || format!("cannot list {}", library.display());
    let mut specs = Vec::new();
    for entry in std::fs::read_dir(library).with_context(context)? {
        let path = entry.with_context(context)?.path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            specs.push(path);
        }
    }
    specs.sort();
    Ok(specs)
}

/// The file that the user means: a path, or the name of a specification of the library.
fn locate(library: &Path, given: &Path) -> anyhow::Result<PathBuf> {
    if given.is_file() {
        return Ok(given.to_path_buf());
    }
    let named = library.join(given).with_extension("toml");
    if named.is_file() {
        return Ok(named);
    }
    bail!("there is no specification {}, nor {}", given.display(), named.display())
}

fn generate(repository: &Path, path: &Path) -> anyhow::Result<(String, String)> {
    let shown = path.strip_prefix(repository).unwrap_or(path).display().to_string();
    let spec = Spec::parse(&read(path)?, &shown).map_err(|e| anyhow!("{e}"))?;
    if path.file_stem().and_then(|stem| stem.to_str()) != Some(&spec.name) {
        bail!("{shown} holds a solution called '{0}'; the file must be called {0}.toml", spec.name);
    }
    let text =
        module_source(&spec).with_context(|| format!("cannot derive the fields of {shown}"))?;
    Ok((spec.name, text))
}

/// Generated modules that belong to none of `names`, with the names that they stand for.
fn orphans(generated: &Path, names: &[String]) -> anyhow::Result<Vec<(PathBuf, String)>> {
    let known: Vec<String> = names.iter().map(|name| Names::of(name).module).collect();
    let context = || format!("cannot list {}", generated.display());
    let mut orphans = Vec::new();
    if !generated.exists() {
        return Ok(orphans);
    }
    for entry in std::fs::read_dir(generated).with_context(context)? {
        let path = entry.with_context(context)?.path();
        let Some(stem) = path.file_stem().and_then(|stem| stem.to_str()) else { continue };
        let is_module = path.extension().is_some_and(|extension| extension == "rs");
        if is_module && stem != "mod" && !known.iter().any(|module| module == stem) {
            orphans.push((path.clone(), stem.replace('_', "-")));
        }
    }
    orphans.sort();
    Ok(orphans)
}

fn compare(
    repository: &Path,
    files: &BTreeMap<PathBuf, Option<String>>,
) -> anyhow::Result<Outcome> {
    let mut lines = Vec::new();
    for (path, wanted) in files {
        let shown = path.strip_prefix(repository).unwrap_or(path).display();
        let present = if path.is_file() { Some(read(path)?) } else { None };
        match (wanted, present) {
            (Some(_), None) => lines.push(format!("missing: {shown}")),
            (Some(wanted), Some(present)) if *wanted != present => {
                let line = wanted.lines().zip(present.lines()).take_while(|(a, b)| a == b).count();
                lines.push(format!("stale: {shown}, from line {}", line + 1));
            }
            (None, Some(_)) => lines.push(format!("without a specification: {shown}")),
            _ => {}
        }
    }
    let stale = !lines.is_empty();
    if stale {
        lines.push("bring them up to date with: cargo xtask gen".into());
    } else {
        lines.push(format!("{} generated files are up to date", files.len()));
    }
    Ok(Outcome { lines, stale })
}

fn update(repository: &Path, files: &BTreeMap<PathBuf, Option<String>>) -> anyhow::Result<Outcome> {
    let mut lines = Vec::new();
    for (path, wanted) in files {
        let shown = path.strip_prefix(repository).unwrap_or(path).display();
        match wanted {
            Some(text) if path.is_file() && read(path)? == *text => {}
            Some(text) => {
                write(path, text)?;
                lines.push(format!("wrote {shown}"));
            }
            None => {
                std::fs::remove_file(path).with_context(|| format!("cannot remove {shown}"))?;
                lines.push(format!("removed {shown}"));
            }
        }
    }
    if lines.is_empty() {
        lines.push(format!("{} generated files were up to date", files.len()));
    }
    Ok(Outcome { lines, stale: false })
}
