//! `mms doctor`: whether this machine gives the published bits, and what it lacks for fast runs.

mod folder;
mod limits;

use anyhow::{Context, Result};
use mmsmith_digest::{Compared, published, repeat, whole};
use mmsmith_verify::Registers;
use serde_json::{Value, json};

use crate::arguments::DoctorOptions;
use crate::json::Output;
use crate::progress::Bar;
use crate::{machine, memory, terminal};

const GIB: f64 = 1024.0 * 1024.0 * 1024.0;

pub(crate) fn doctor(options: &DoctorOptions) -> Result<bool> {
    let output = Output::prepare_if(options.json.as_ref())?;
    let bar = Bar::new("doctor");
    let runs = repeat(&mut |name, share| bar.show_share(|| name.to_owned(), share));
    drop(bar);
    let runs = runs.context("the runs that every machine repeats")?;
    let found = Findings {
        digest: Digest::of(runs),
        folder: folder::Folder::probe(&options.folder),
        registers: registers(),
        cores: machine::cores(),
        present: limits::cores_present(),
        memory: memory::told(),
        slow: slow(),
    };
    terminal::say(&found.text())?;
    if let Some(output) = output {
        output.write(&found.document())?;
    }
    Ok(found.passed())
}

/// The runs that every machine repeats.
struct Digest {
    runs: Vec<Compared>,
    found: String,
    expected: String,
}

impl Digest {
    fn of(runs: Vec<Compared>) -> Self {
        let found = whole(runs.iter().map(|run| (run.name.as_str(), run.found.as_str())));
        Self { runs, found, expected: whole(published()) }
    }

    fn is_same(&self) -> bool {
        self.found == self.expected
    }

    fn text(&self) -> String {
        let (count, found) = (self.runs.len(), &self.found);
        if self.is_same() {
            return format!("{count} runs have the published bits: digest {found}\n");
        }
        let differing = self.runs.iter().filter(|run| !run.is_same()).map(|run| &run.name);
        let differing: Vec<_> = differing.map(String::as_str).collect();
        format!(
            "{} of {count} runs have other bits than published: {}\ndigest {found}, published {}\n",
            differing.len(),
            differing.join(", "),
            self.expected
        )
    }

    fn document(&self) -> Value {
        let run = |run: &Compared| json!({ "name": run.name, "digest": run.found, "published": run.expected });
        json!({
            "found": self.found,
            "published": self.expected,
            "runs": self.runs.iter().map(run).collect::<Vec<_>>(),
        })
    }
}

/// All that was looked at.
struct Findings {
    digest: Digest,
    folder: folder::Folder,
    registers: &'static str,
    cores: usize,
    present: Option<usize>,
    memory: Option<f64>,
    slow: Vec<String>,
}

impl Findings {
    fn passed(&self) -> bool {
        self.digest.is_same() && self.folder.problems.is_empty()
    }

    fn text(&self) -> String {
        let Self { digest, folder, registers, cores, present, memory, slow } = self;
        let of_present = present.map(|present| format!(" of {present}")).unwrap_or_default();
        let memory = match memory {
            Some(bytes) => format!("{:.1} GiB available", bytes / GIB),
            None => "the system does not tell".into(),
        };
        let slow = match slow.is_empty() {
            true => "Nothing found that makes runs slow.\n".into(),
            false => slow.iter().map(|cause| format!("Slow: {cause}\n")).collect::<String>(),
        };
        format!(
            "mms {}, {} for {}\n\
             processor: {}\n\
             cores: {cores}{of_present}\n\
             registers: {registers}\n\
             memory: {memory}\n\
             MPI: {}\n\
             {}{}{slow}",
            env!("MMS_VERSION"),
            build(),
            std::env::consts::ARCH,
            machine::processor(),
            mpi(),
            folder.text(),
            digest.text(),
        )
    }

    fn document(&self) -> Value {
        json!({
            "schema": "mmsmith.doctor/1",
            "settings": {
                "version": env!("CARGO_PKG_VERSION"),
                "folder": self.folder.path.display().to_string(),
            },
            "passed": self.passed(),
            "build": env!("MMS_VERSION"),
            "profile": if cfg!(debug_assertions) { "debug" } else { "release" },
            "mpi": cfg!(feature = "mpi"),
            "architecture": std::env::consts::ARCH,
            "processor": machine::processor(),
            "cores": self.cores,
            "cores_present": self.present,
            "registers": self.registers,
            "memory_available_bytes": self.memory,
            "digest": self.digest.document(),
            "folder_problems": self.folder.problems,
            "slow": self.slow,
        })
    }
}

fn build() -> &'static str {
    if cfg!(debug_assertions) { "a debug build" } else { "a release build" }
}

fn mpi() -> &'static str {
    if cfg!(feature = "mpi") { "built in" } else { "not built in; a run has one process" }
}

/// The vector registers that kernels use here.
fn registers() -> &'static str {
    match Registers::present().last() {
        Some(Registers::Avx512) => "AVX-512",
        Some(Registers::Avx2) => "AVX2 with fused multiply-adds",
        _ if cfg!(target_arch = "x86_64") => "those of every x86-64 processor",
        _ => "those that the compiler takes for granted",
    }
}

/// Causes that make runs slow here, a line each with what to do about it.
fn slow() -> Vec<String> {
    let mut all = Vec::new();
    if cfg!(debug_assertions) {
        all.push(
            "this is a debug build; cargo build --release -p mmsmith-cli makes the fast one".into(),
        );
    }
    if cfg!(target_arch = "x86_64") && Registers::present().last() == Some(&Registers::Scalar) {
        all.push(
            "the processor, or the virtual machine, has no AVX2 with fused multiply-adds; kernels take some five times as long"
                .into(),
        );
    }
    all.extend(limits::of_cores());
    all
}
