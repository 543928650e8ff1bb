//! `mms batch`: job scripts for clusters.

use std::path::Path;

use anyhow::{Result, bail};
use clap::FromArgMatches;

use crate::arguments::{Arguments, BatchOptions, BatchSystem, Command, KeepOptions, line};
use crate::terminal;

/// Options that write files of a whole study, which its shards do not have.
const OUTPUTS: [&str; 10] = [
    "--json",
    "--csv",
    "--plot",
    "--markdown",
    "--latex",
    "--advice",
    "--expect",
    "--tolerance",
    "--time",
    "--threads",
];

/// Says the script of the job.
pub(crate) fn batch(options: &BatchOptions) -> Result<bool> {
    let words = match options.command.as_slice() {
        [first, rest @ ..] if first == "mms" => rest,
        words => words,
    };
    let whole = std::iter::once("mms").chain(words.iter().map(String::as_str));
    let command = line()
        .try_get_matches_from(whole)
        .and_then(|matches| Arguments::from_arg_matches(&matches))
        .unwrap_or_else(|refusal| refusal.exit())
        .command;
    let name = match &command {
        Command::Converge(options) => format!("converge-{}", options.name),
        Command::Stability(options) => format!("stability-{}", options.name),
        Command::Tradeoff(options) => format!("tradeoff-{}", options.name),
        Command::Run(options) => format!("run-{}", options.name),
        _ => bail!(
            "mms {}: studies and runs are made into jobs, as in mms batch slurm -- converge ring --cells 16,32 --out study",
            words.join(" ")
        ),
    };
    let is_word = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
    let job = Job {
        name: format!("mms-{}", name.chars().map(is_word).collect::<String>()),
        words,
        cores: options.cores,
    };
    let ranks = options.ranks;
    let kept = match &command {
        Command::Converge(options) => Some(&options.kept),
        Command::Stability(options) => Some(&options.kept),
        Command::Tradeoff(options) => Some(&options.kept),
        _ => None,
    };
    let BatchSystem::Slurm = options.system;
    let script = match kept {
        None => {
            let folder = match &command {
                Command::Run(run) => run.checkpoint.as_deref(),
                _ => None,
            };
            job.run(ranks, folder)
        }
        Some(_) if ranks > 1 => bail!(
            "--ranks {ranks}: several processes do one run together; a study is shared out with --shards {ranks}"
        ),
        Some(KeepOptions { out: Some(_), shard: None }) => {
            if let Command::Tradeoff(tradeoff) = &command
                && tradeoff.cells.is_empty()
            {
                bail!(
                    "tradeoff {}: a sweep within a budget chooses its cases as it goes; state them, as in --cells 16,32,64",
                    tradeoff.name
                );
            }
            job.study(options.shards)
        }
        Some(KeepOptions { shard: Some(shard), .. }) => {
            bail!("--shard {shard}: the script gives each task its shard; leave --shard out")
        }
        Some(KeepOptions { out: None, .. }) => {
            bail!(
                "mms {}: shards meet in a folder that all machines see; name it, as in --out study",
                words.join(" ")
            )
        }
    };
    terminal::say(&script)?;
    Ok(true)
}

struct Job<'a> {
    name: String,
    /// The command line without the program.
    words: &'a [String],
    cores: usize,
}

impl Job<'_> {
    /// One run by some processes, which goes on where it keeps checkpoints in a folder.
    fn run(&self, ranks: usize, folder: Option<&Path>) -> String {
        let Self { name, words, cores } = self;
        let start = if ranks > 1 { "exec mpirun -n \"$SLURM_NTASKS\" mms" } else { "exec mms" };
        let threads = "--threads \"$SLURM_CPUS_PER_TASK\"";
        let mut note = String::new();
        let mut resume = String::new();
        if let Some(folder) = folder {
            let kept = quoted(&[&folder.to_string_lossy()]);
            note = "# Submitted again, it goes on from its last checkpoint, on as many processes as it then has.\n".into();
            resume = format!(
                "if [ -e {kept}/run.json ]; then\n    {start} resume {kept} {threads}\nfi\n"
            );
        }
        format!(
            "#!/bin/bash\n\
             # One run. Submit it with sbatch; limits such as --time and --partition may stand on that line.\n\
             {note}\
             #SBATCH --job-name={name}\n\
             #SBATCH --ntasks={ranks}\n\
             #SBATCH --cpus-per-task={cores}\n\
             set -eu\n\
             {resume}\
             {start} {} {threads}\n",
            quoted(&without(words, &["--threads"]))
        )
    }

    /// An array of shards, and the table.
    fn study(&self, shards: usize) -> String {
        let Self { name, words, cores } = self;
        format!(
            "#!/bin/bash\n\
             # A study in {shards} shards. Submit this script twice, as study.sh, say: once for the shards, and once for the table, which\n\
             # waits for them and computes what one of them left:\n\
             #   sbatch study.sh\n\
             #   sbatch --array=0 --dependency=singleton study.sh\n\
             # Limits such as --time and --partition may stand on those lines. A shard that was killed goes on where it stopped.\n\
             #SBATCH --job-name={name}\n\
             #SBATCH --array=1-{shards}\n\
             #SBATCH --ntasks=1\n\
             #SBATCH --cpus-per-task={cores}\n\
             set -eu\n\
             if [ \"$SLURM_ARRAY_TASK_ID\" -eq 0 ]; then\n    \
                 exec mms {} --threads \"$SLURM_CPUS_PER_TASK\"\n\
             fi\n\
             exec mms {} --threads \"$SLURM_CPUS_PER_TASK\" --shard \"$SLURM_ARRAY_TASK_ID/{shards}\"\n",
            quoted(&without(words, &["--threads"])),
            quoted(&without(words, &OUTPUTS))
        )
    }
}

/// `words` without some options and their values.
fn without<'a>(words: &'a [String], options: &[&str]) -> Vec<&'a str> {
    let mut kept = Vec::new();
    let mut words = words.iter().map(String::as_str);
    while let Some(word) = words.next() {
        let option = word.split_once('=').map_or(word, |(option, _)| option);
        if !options.contains(&option) {
            kept.push(word);
        } else if option == word {
            words.next();
        }
    }
    kept
}

/// Words as a shell reads them.
fn quoted(words: &[&str]) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "_-./=,:+%@".contains(c);
    let quote = |word: &&str| match !word.is_empty() && word.chars().all(is_plain) {
        true => (*word).to_owned(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    };
    words.iter().map(quote).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_go_with_their_values() {
        let words = ["converge", "ring", "--json", "a.json", "--csv=b", "--cells", "8,16"]
            .map(str::to_owned);
        assert_eq!(without(&words, &OUTPUTS), ["converge", "ring", "--cells", "8,16"]);
    }

    #[test]
    fn a_shell_reads_what_was_said() {
        let words = ["a b", "", "it's", "x=1,2", "$HOME"];
        let script = format!("printf '%s\\n' {}", quoted(&words));
        let output = std::process::Command::new("sh").args(["-c", &script]).output();
        let stdout = output.expect("a shell").stdout;
        let lines = String::from_utf8(stdout).expect("text");
        assert_eq!(lines.lines().collect::<Vec<_>>(), words);
    }
}
