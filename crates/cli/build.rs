//! The checksum that tells this build from all that may compute other bits.

use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;

fn main() -> io::Result<()> {
    let crates = Path::new("..").canonicalize()?;
    let mut files = Vec::new();
    for package in fs::read_dir(&crates)? {
        let source = package?.path().join("src");
        if source.is_dir() {
            println!("cargo::rerun-if-changed={}", source.display());
            collect(&source, &mut files)?;
        }
    }
    // Versions of dependencies, and the levels of optimisation.
    for name in ["Cargo.lock", "Cargo.toml"] {
        let file = crates.join("..").join(name);
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
    Ok(())
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
