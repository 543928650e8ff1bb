//! Studies in shards, through the real binary: any number, in any order, some twice, some killed, give the table of one process.

use std::path::Path;
use std::process::{Command, Stdio};

use crate::command::{mms, mms_with, names, read_json};
use mmsmith_ledger::{Shard, ShardName};
use serde_json::{Value, json};

const CONVERGE: &str = "converge ring --cells 8,12,16,20 --shape gimp --periods 0.25";
const IN_TIME: &str = "converge axis-aligned --cells 8 --cfls 0.1,0.2,0.4 --periods 0.25";
const STABILITY: &str = "stability axis-aligned --cells 8 --over amplitude=0.01,0.05,0.1 --over nu=0,0.3 --width 0.1 --periods 0.1";
const RANDOM: &str =
    "stability axis-aligned --search random --samples 9 --cells 8 --cfl 0.4 --periods 0.1";
const TRADEOFF: &str = "tradeoff bar --cells 8,16 --periods 0.05";

/// Entries of a document that no machine changes.
fn lasting(document: &Value) -> Value {
    match document {
        Value::Object(members) => {
            let is_lasting = |name: &str| {
                !(name.contains("wall")
                    || name.contains("cpu")
                    || name.ends_with("_s")
                    || name == "timed_alone"
                    || [
                        "threads",
                        "timings",
                        "front",
                        "tolerances",
                        "tolerances_by_formulation",
                        "effects",
                        "knobs",
                    ]
                    .contains(&name))
            };
            let kept = members.iter().filter(|(name, _)| is_lasting(name));
            Value::Object(kept.map(|(name, value)| (name.clone(), lasting(value))).collect())
        }
        Value::Array(entries) => entries.iter().map(lasting).collect(),
        other => other.clone(),
    }
}

/// The finished cases of the folder `study`: in the ledger, and in the shards' files.
fn finished(place: &Path) -> (usize, usize) {
    let (mut ledger, mut shards) = (0, 0);
    for name in names(&place.join("study")).iter().filter(|name| name.ends_with(".jsonl")) {
        let text = std::fs::read_to_string(place.join("study").join(name)).expect("cases");
        let count = text.lines().filter(|line| line.contains("\"settings\"")).count();
        if name == "cases.jsonl" { ledger += count } else { shards += count }
    }
    (ledger, shards)
}

/// The shards of `call` in an odd order, each started twice, then its table, which must be that of one process; neither the second start nor
/// the table computes anything.
fn agrees(call: &str, count: usize, cases: usize) {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let alone = mms(place, &format!("{call} --json alone.json"));
    assert_eq!(alone.status, 0, "{}{}", alone.stdout, alone.stderr);
    let mut own = 0;
    for index in (1..=count).rev().step_by(2).chain((1..=count).rev().skip(1).step_by(2)) {
        let called = mms(place, &format!("{call} --out study --shard {index}/{count}"));
        assert_eq!(called.status, 0, "{}", called.stderr);
        let said = called.stdout;
        assert!(said.starts_with(&format!("shard {index}/{count}: its ")), "{said}");
        let words: Vec<&str> = said.split_whitespace().collect();
        own += words[3].parse::<usize>().expect("a number");
        assert_eq!(words[5].parse::<usize>().expect("a number"), cases);
        let (known, again) =
            (finished(place), mms(place, &format!("{call} --out study --shard {index}/{count}")));
        assert_eq!((again.status, again.stdout), (0, said), "a finished shard says the same");
        assert_eq!(finished(place), known, "a finished shard computes nothing");
    }
    assert_eq!((own, finished(place)), (cases, (0, cases)));
    let table = mms(place, &format!("{call} --out study --json table.json"));
    assert_eq!((table.status, table.stderr.as_str()), (0, ""));
    assert_eq!(finished(place), (0, cases), "nothing is computed again");
    let [alone, table] = ["alone.json", "table.json"].map(|name| read_json(&place.join(name)));
    assert_eq!(lasting(&alone), lasting(&table));
}

#[test]
fn shards_of_every_study_give_the_table_of_one_process() {
    agrees(CONVERGE, 8, 4);
    agrees(IN_TIME, 3, 4);
    agrees(STABILITY, 4, 6);
    agrees(RANDOM, 2, 9);
}

#[test]
fn a_stated_list_of_the_tradeoff_is_shared_out() {
    let place = tempfile::tempdir().expect("a folder");
    let alone = mms(place.path(), &format!("{TRADEOFF} --json alone.json"));
    assert_eq!(alone.status, 0, "{}", alone.stderr);
    let cases = read_json(&place.path().join("alone.json"))["rows"].as_array().expect("rows").len();
    assert!(cases > 20, "{cases}");
    agrees(TRADEOFF, 3, cases);
}

#[test]
fn shards_that_run_at_once_twice_and_are_killed_give_the_same() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let call = format!("{CONVERGE} --out study");
    let alone = mms(place, &format!("{CONVERGE} --json alone.json"));
    assert_eq!(alone.status, 0, "{}", alone.stderr);
    let start = |index: usize| {
        Command::new(env!("CARGO_BIN_EXE_mms"))
            .current_dir(place)
            .args(format!("{call} --shard {index}/8").split_whitespace())
            .stdout(Stdio::null())
            .spawn()
            .expect("the binary starts")
    };
    let killed: Vec<_> = (1..=8).map(start).collect();
    for (after, mut shard) in killed.into_iter().enumerate() {
        std::thread::sleep(std::time::Duration::from_millis(3 * after as u64));
        // It may have ended.
        let _ = shard.kill();
        shard.wait().expect("it ends");
    }
    let again: Vec<_> = [8, 3, 5, 1, 2, 4, 6, 7, 3, 1].into_iter().map(start).collect();
    for mut shard in again {
        assert!(shard.wait().expect("it ends").success());
    }
    let before = finished(place).1;
    let table = mms(place, &format!("{call} --json table.json"));
    assert_eq!(table.status, 0, "{}", table.stderr);
    assert_eq!(finished(place), (0, before), "nothing is computed again");
    let [alone, table] = ["alone.json", "table.json"].map(|name| read_json(&place.join(name)));
    assert_eq!(lasting(&alone), lasting(&table));
}

#[test]
fn a_shard_of_another_specification_is_refused_by_name() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let specification = include_str!("../../../../mms-specs/axis-aligned.toml");
    std::fs::write(place.join("own.toml"), specification).expect("a file");
    let call = "converge ./own.toml --cells 8,12 --periods 0.1 --out study";
    assert_eq!(mms(place, &format!("{call} --shard 1/2")).status, 0);
    std::fs::write(place.join("own.toml"), format!("{specification}\n# changed\n"))
        .expect("a file");
    for last in [" --shard 2/2", ""] {
        let refused = mms(place, &format!("{call}{last}"));
        assert_eq!((refused.status, refused.stdout.as_str()), (2, ""));
        for part in
            ["study/cases-1-of-2.jsonl", "another text of the specification", "--out study-2"]
        {
            assert!(refused.stderr.contains(part), "{}", refused.stderr);
        }
    }
}

#[test]
fn a_shard_of_another_build_is_refused_by_name() {
    let place = tempfile::tempdir().expect("a folder");
    let name = ShardName::new(1, 2).expect("the first of two");
    let origin = json!({ "build": "0123456789abcdef", "specification": null });
    Shard::open(&place.path().join("study"), name, &origin).expect("a shard");
    for last in [" --shard 2/2", ""] {
        let refused = mms(place.path(), &format!("{CONVERGE} --out study{last}"));
        assert_eq!((refused.status, refused.stdout.as_str()), (2, ""));
        for part in ["study/cases-1-of-2.jsonl", "another build of mms (0123456789abcdef)"] {
            assert!(refused.stderr.contains(part), "{}", refused.stderr);
        }
    }
}

#[test]
fn what_no_shard_can_do_is_refused_with_the_line_to_use() {
    let place = tempfile::tempdir().expect("a folder");
    let refused =
        |arguments: &str, parts: &[&str]| crate::command::refuses(place.path(), arguments, parts);
    refused(&format!("{CONVERGE} --shard 1/2"), &["--out"]);
    refused(&format!("{CONVERGE} --out study --shard 0/2"), &["from 1/8 to 8/8"]);
    refused(
        &format!("{CONVERGE} --out study --shard 1/2 --json a.json"),
        &["--shard 1/2 --json", "without --shard"],
    );
    refused(&format!("{CONVERGE} --out study --shard 1/2 --expect u=2"), &["--expect"]);
    refused("tradeoff bar --out study --shard 1/2", &["--cells 16,32,64 --shard 1/2"]);
    refused("tradeoff bar --cells 8 --budget 5s", &["--budget"]);
    refused("stability bar --at 0.4 --out study --shard 1/2", &["--at --shard 1/2"]);
    refused("batch slurm -- converge ring --cells 8", &["--out study"]);
    refused(
        "batch slurm -- converge ring --cells 8 --out study --shard 1/2",
        &["leave --shard out"],
    );
    refused("batch slurm -- check ring", &["mms batch slurm -- converge"]);
    refused("batch slurm -- tradeoff ring --out study", &["--cells 16,32,64"]);
    refused("batch slurm -- converge ring --cell 8", &["--cells"]);
    refused("batch slurm --ranks 4 -- converge ring --cells 8 --out study", &["--shards 4"]);
}

/// Writes the script that `mms batch slurm` prints, which must have these lines.
fn write_script(place: &Path, arguments: &str, lines: &[&str]) {
    let script = mms(place, &format!("batch slurm {arguments}"));
    assert_eq!((script.status, script.stderr.as_str()), (0, ""));
    for line in lines {
        assert!(script.stdout.lines().any(|known| known == *line), "{}", script.stdout);
    }
    std::fs::write(place.join("job.sh"), &script.stdout).expect("a file");
}

/// Runs that script as Slurm does, with its variables. Programs in the folder come first.
fn run_script(place: &Path, variables: &[(&str, &str)]) {
    let folder = Path::new(env!("CARGO_BIN_EXE_mms")).parent().expect("a folder");
    let path = std::env::var("PATH").unwrap_or_default();
    let path = format!("{}:{}:{path}", place.display(), folder.display());
    let status = Command::new("bash")
        .current_dir(place)
        .arg("job.sh")
        .envs(variables.iter().copied())
        .env("PATH", path)
        .stdout(Stdio::null())
        .status();
    assert!(status.expect("a shell").success(), "{variables:?}");
}

#[test]
fn the_script_of_an_array_prints_the_table_of_one_process() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let lines = [
        "#SBATCH --array=1-3",
        "#SBATCH --job-name=mms-converge-axis-aligned",
        "#SBATCH --cpus-per-task=1",
    ];
    let study = format!("--shards 3 -- mms {IN_TIME} --out study --json table.json");
    write_script(place, &study, &lines);
    for task in ["2", "1", "3", "0"] {
        run_script(place, &[("SLURM_ARRAY_TASK_ID", task), ("SLURM_CPUS_PER_TASK", "1")]);
    }
    assert_eq!(finished(place), (0, 4));
    let alone = mms_with(place, &format!("{IN_TIME} --json alone.json"), &[], "");
    assert_eq!(alone.status, 0, "{}", alone.stderr);
    let [alone, table] = ["alone.json", "table.json"].map(|name| read_json(&place.join(name)));
    assert_eq!(lasting(&alone), lasting(&table));
}

/// The launcher is a script that says how it was called and starts one process.
#[test]
fn the_script_of_a_run_goes_on_from_its_checkpoint() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let run = "--ranks 4 --cores 2 -- run bar --cells 8 --checkpoint kept --every 1 --json a.json";
    write_script(place, run, &["#SBATCH --ntasks=4", "#SBATCH --cpus-per-task=2"]);
    let launcher = "#!/bin/sh\necho \"$1 $2 $4\" >> started\nshift 2\nexec \"$@\"\n";
    std::fs::write(place.join("mpirun"), launcher).expect("a file");
    let executable = Command::new("chmod").args(["+x", "mpirun"]).current_dir(place).status();
    assert!(executable.expect("a program").success());
    for _ in 0..2 {
        run_script(place, &[("SLURM_NTASKS", "4"), ("SLURM_CPUS_PER_TASK", "2")]);
    }
    let started = std::fs::read_to_string(place.join("started")).expect("a file");
    assert_eq!(started, "-n 4 run\n-n 4 resume\n");
}
