//! `cargo xtask gen`: specifications to Rust modules, C headers and the files of other hosts.

use crate::{read, write};
use anyhow::{Context, anyhow, bail};
use mmsmith_codegen::{Code, HOSTS, Host, Names, Origin, Unwritable, registry_source};
use mmsmith_spec::{Coordinates, Spec};
use rayon::prelude::*;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Result of a generation, in lines for people.
pub(crate) struct Outcome {
    pub(crate) lines: Vec<String>,
    pub(crate) stale: bool,
}

/// The trace of a host's files in the repository.
enum Kept {
    /// The files themselves, in a folder.
    Files(&'static str),
    /// Their SHA-256 alone, a line each: `mms gen` writes the files.
    Digests(&'static str),
}

fn kept_of(host: &Host) -> Option<Kept> {
    match host.name {
        "rust" => Some(Kept::Files("crates/solutions/src/generated")),
        "c" => Some(Kept::Digests("crates/solutions/headers.sha256")),
        _ => None,
    }
}

/// The hosts whose files the repository keeps a trace of.
pub(crate) fn kept() -> Vec<&'static Host> {
    HOSTS.iter().filter(|host| kept_of(host).is_some()).collect()
}

/// The text of a file; a module is one of the crate of the solutions.
fn source(host: &Host, code: &Code<'_>) -> Result<String, Unwritable> {
    if host.name == "rust" { Ok(code.module_source()) } else { host.source(code) }
}

/// How the generator is run.
#[derive(Clone, Copy)]
pub(crate) struct Options {
    /// Change nothing, and tell what is stale.
    pub(crate) check: bool,
    /// Tell how long each specification took.
    pub(crate) times: bool,
}

/// Generates from `given`, or from every specification of the repository.
///
/// Every specification is read and derived before anything is written.
pub(crate) fn run(
    repository: &Path,
    given: &[PathBuf],
    hosts: &[&Host],
    out: Option<&Path>,
    Options { check, times: tell_times }: Options,
) -> anyhow::Result<Outcome> {
    let of_library = |host: &&&Host| kept_of(host).is_none() && out.is_none();
    if let Some(host) = hosts.iter().find(of_library) {
        bail!(
            "the repository keeps no files for --target {0}: add --out DIR, as in `cargo xtask gen --target {0} --out code`",
            host.name
        );
    }
    let library = repository.join("mms-specs");
    let all = library_specs(&library)?;
    let chosen = match given {
        [] => all.clone(),
        _ => given.iter().map(|path| locate(&library, path)).collect::<anyhow::Result<_>>()?,
    };

    let mut sources: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut times = vec!["milliseconds: read, derive and stage, write down (Rust, C)".to_owned()];
    let generated: Vec<_> =
        chosen.par_iter().map(|path| generate(repository, path, hosts)).collect();
    for (path, generated) in chosen.iter().zip(generated) {
        let Generated { name, texts, times: spent } = generated?;
        let spent: Vec<String> = spent.iter().map(|t| format!("{:7.1}", 1e3 * t)).collect();
        times.push(format!("{name:<18} {}", spent.join(" ")));
        if sources.insert(name.clone(), texts).is_some() {
            bail!("two specifications are called '{name}'; the second is {}", path.display());
        }
    }
    let mut files: BTreeMap<PathBuf, Option<String>> = BTreeMap::new();
    for (k, host) in hosts.iter().enumerate() {
        let texts = sources
            .iter()
            .map(|(name, texts)| (host.file_name(&Names::of(name).module), texts[k].as_str()));
        match (out, kept_of(host)) {
            (None, Some(Kept::Digests(list))) => {
                let list = repository.join(list);
                let names: Vec<String> = all
                    .iter()
                    .filter_map(|path| Some(path.file_stem()?.to_str()?.to_owned()))
                    .chain(sources.keys().cloned())
                    .map(|name| host.file_name(&Names::of(&name).module))
                    .collect();
                let text = digests(&list, texts, &names)?;
                files.insert(list, Some(text));
            }
            (Some(folder), _) => {
                files.extend(texts.map(|(file, text)| (folder.join(file), Some(text.to_owned()))));
            }
            (None, Some(Kept::Files(folder))) => {
                let own = repository.join(folder);
                files.extend(texts.map(|(file, text)| (own.join(file), Some(text.to_owned()))));
            }
            (None, None) => {}
        }
    }
    if out.is_none() {
        let mut names: Vec<String> =
            all.iter().filter_map(|path| Some(path.file_stem()?.to_str()?.to_owned())).collect();
        names.extend(sources.keys().cloned());
        let mut listed = names.clone();
        for host in hosts {
            let Some(Kept::Files(folder)) = kept_of(host) else { continue };
            let orphans = orphans(&repository.join(folder), host.ending, &names)?;
            if given.is_empty() {
                // A file without a specification cannot be kept up to date.
                files.extend(orphans.into_iter().map(|(path, _)| (path, None)));
            } else if host.name == "rust" {
                listed.extend(orphans.into_iter().map(|(_, name)| name));
            }
        }
        listed.sort_unstable();
        listed.dedup();
        let listed: Vec<&str> = listed.iter().map(String::as_str).collect();
        let registry = registry_source(&listed)?;
        let own = hosts.iter().find(|host| host.name == "rust").and_then(|host| kept_of(host));
        if let Some(Kept::Files(own)) = own {
            files.insert(repository.join(own).join("mod.rs"), Some(registry));
        }
    }
    let mut outcome =
        if check { compare(repository, &files)? } else { update(repository, &files)? };
    if tell_times {
        outcome.lines.extend(times);
    }
    Ok(outcome)
}

/// The list of the digests of a host's files as `sha256sum --check` reads it: `texts` anew, the other files of `names` as they are listed.
fn digests<'a>(
    list: &Path,
    texts: impl Iterator<Item = (String, &'a str)>,
    names: &[String],
) -> anyhow::Result<String> {
    let listed = if list.is_file() { read(list)? } else { String::new() };
    let listed = listed.lines().filter_map(|line| line.split_once("  "));
    let mut digests: BTreeMap<String, String> = listed
        .filter(|(_, file)| names.iter().any(|name| name == file))
        .map(|(digest, file)| (file.to_owned(), digest.to_owned()))
        .collect();
    for (file, text) in texts {
        let digest = Sha256::digest(text).iter().map(|byte| format!("{byte:02x}")).collect();
        digests.insert(file, digest);
    }
    Ok(digests.into_iter().map(|(file, digest)| format!("{digest}  {file}\n")).collect())
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

/// The code of one specification.
struct Generated {
    name: String,
    /// For each host.
    texts: Vec<String>,
    /// Seconds for reading, for deriving and staging, and for each text.
    times: Vec<f64>,
}

fn generate(repository: &Path, path: &Path, hosts: &[&Host]) -> anyhow::Result<Generated> {
    let shown = path.strip_prefix(repository).unwrap_or(path).display().to_string();
    let mut started = Instant::now();
    let mut times = Vec::new();
    let mut lap = || {
        times.push(started.elapsed().as_secs_f64());
        started = Instant::now();
    };
    let spec = Spec::parse(&read(path)?, &shown).map_err(|e| anyhow!("{e}"))?;
    if path.file_stem().and_then(|stem| stem.to_str()) != Some(&spec.name) {
        bail!("{shown} holds a solution called '{0}'; the file must be called {0}.toml", spec.name);
    }
    lap();
    let code = Code::new(&spec).with_context(|| format!("cannot derive the fields of {shown}"))?;
    lap();
    let mut texts = Vec::new();
    for host in hosts {
        let own = match spec.coordinates {
            Coordinates::Axisymmetric if host.in_half_plane => {
                Some(Code::for_host(&spec, Origin::library(&spec), true)?)
            }
            _ => None,
        };
        texts.push(source(host, own.as_ref().unwrap_or(&code))?);
        lap();
    }
    Ok(Generated { name: spec.name.clone(), texts, times })
}

/// Generated files that belong to none of `names`, with the names that they stand for.
fn orphans(
    folder: &Path,
    ending: &str,
    names: &[String],
) -> anyhow::Result<Vec<(PathBuf, String)>> {
    let known: Vec<String> = names.iter().map(|name| Names::of(name).module).collect();
    let context = || format!("cannot list {}", folder.display());
    let mut orphans = Vec::new();
    if !folder.exists() {
        return Ok(orphans);
    }
    for entry in std::fs::read_dir(folder).with_context(context)? {
        let path = entry.with_context(context)?.path();
        let file = path.file_name().and_then(|name| name.to_str());
        let Some(stem) = file.and_then(|name| name.strip_suffix(ending)) else { continue };
        if stem != "mod" && !known.iter().any(|module| module == stem) {
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
                let same = wanted.lines().zip(present.lines()).take_while(|(a, b)| a == b).count();
                // A list of digests tells the file, other files the line.
                let listed = wanted.lines().nth(same).and_then(|line| line.split_once("  "));
                let place = match listed {
                    Some((_, file)) if path.extension().is_some_and(|e| e == "sha256") => {
                        file.to_owned()
                    }
                    _ => format!("from line {}", same + 1),
                };
                lines.push(format!("stale: {shown}, {place}"));
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
