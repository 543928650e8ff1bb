//! The checksum that tells this build from all that may compute other bits, and the commit of its sources.

use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;

#[path = "build/commit.rs"]
mod commit;

fn main() -> io::Result<()> {
    // A published package lies beside strangers; its own Cargo.lock tells the versions of all others.
    let in_repository = Path::new("../../crates/cli/Cargo.toml").is_file();
    let crates = Path::new(if in_repository { ".." } else { "." }).canonicalize()?;
    let packages = if in_repository {
        fs::read_dir(&crates)?.map(|package| Ok(package?.path())).collect::<io::Result<Vec<_>>>()?
    } else {
        vec![crates.clone()]
    };
    let mut files = Vec::new();
    for source in packages.iter().map(|package| package.join("src")) {
        if source.is_dir() {
            println!("cargo::rerun-if-changed={}", source.display());
            collect(&source, &mut files)?;
        }
    }
    // Versions of dependencies, and the levels of optimisation.
    let root = if in_repository { crates.join("..") } else { crates.clone() };
    for name in ["Cargo.lock", "Cargo.toml"] {
        let file = root.join(name);
        if file.is_file() {
            println!("cargo::rerun-if-changed={}", file.display());
            files.push(file);
        }
    }
    files.sort();
    // Without random keys: the same for the same sources. Another release of the compiler may have another hash, and is another
    // build anyway.
    let mut sum = DefaultHasher::new();
    for file in files {
        let name = file.strip_prefix(&crates).unwrap_or(&file);
        name.hash(&mut sum);
        fs::read(&file)?.hash(&mut sum);
    }
    let compiler = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".into());
    Command::new(compiler).arg("--version").output()?.stdout.hash(&mut sum);
    for name in ["TARGET", "PROFILE", "OPT_LEVEL", "CARGO_ENCODED_RUSTFLAGS"] {
        println!("cargo::rerun-if-env-changed={name}");
        std::env::var(name).unwrap_or_default().hash(&mut sum);
    }
    println!("cargo::rustc-env=MMS_BUILD={:016x}", sum.finish());
    let commit = if in_repository { commit::of(&root) } else { packaged_commit() };
    let commit = commit.map(|commit| format!(" ({commit})")).unwrap_or_default();
    let version = std::env::var("CARGO_PKG_VERSION").unwrap_or_default();
    println!("cargo::rustc-env=MMS_VERSION={version}{commit}");
    Ok(())
}

/// The commit from which `cargo package` took this package.
fn packaged_commit() -> Option<String> {
    let text = fs::read_to_string(".cargo_vcs_info.json").ok()?;
    let (_, rest) = text.split_once("\"sha1\"")?;
    let commit: String = rest
        .chars()
        .skip_while(|c| !c.is_ascii_hexdigit())
        .take_while(char::is_ascii_hexdigit)
        .take(10)
        .collect();
    (!commit.is_empty()).then_some(commit)
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            collect(&path, files)?;
        } else {
            files.push(path);
        }
    }
    Ok(())
}
