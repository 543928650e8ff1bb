//! The checksum that tells this build from all that may compute other bits.

use std::fs;
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
    let lock = crates.join("../Cargo.lock");
    if lock.is_file() {
        println!("cargo::rerun-if-changed={}", lock.display());
        files.push(lock);
    }
    files.sort();
    let mut sum = Fnv(0xcbf2_9ce4_8422_2325);
    for file in files {
        let name = file.strip_prefix(&crates).unwrap_or(&file);
        // The same on systems with other separators.
        name.components().for_each(|part| sum.add(part.as_os_str().as_encoded_bytes()));
        sum.add(&fs::read(&file)?);
    }
    let compiler = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".into());
    sum.add(&Command::new(compiler).arg("--version").output()?.stdout);
    for name in ["TARGET", "PROFILE", "OPT_LEVEL", "CARGO_ENCODED_RUSTFLAGS"] {
        println!("cargo::rerun-if-env-changed={name}");
        sum.add(std::env::var(name).unwrap_or_default().as_bytes());
    }
    println!("cargo::rustc-env=MMS_BUILD={:016x}", sum.0);
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

/// The checksum FNV-1a of 64 bits: against mistakes, not against attacks.
struct Fnv(u64);

impl Fnv {
    fn add(&mut self, bytes: &[u8]) {
        let length = (bytes.len() as u64).to_le_bytes();
        for byte in length.iter().chain(bytes) {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}
