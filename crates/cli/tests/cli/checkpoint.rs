//! `mms run --checkpoint` and `mms resume`: a run that is killed at any moment goes on to the same bits.

#![allow(clippy::unwrap_used)]

use crate::command::{UnderWay, mms, names, read_json, refuses};
use serde_json::Value;
use std::path::Path;

/// How far the checkpoint in a folder is; nowhere without one.
fn reached(folder: &Path) -> u64 {
    let Ok(bytes) = std::fs::read(folder.join("checkpoint")) else { return 0 };
    // Behind how it begins, what run it is of, and two counts.
    let step = bytes[72..80].try_into().expect("a number");
    u64::from_le_bytes(step)
}

/// The result without its times.
fn result(path: &Path) -> Value {
    let mut result = read_json(path)["result"].take();
    for key in ["wall_s", "cpu_s", "particle_steps_per_s"] {
        result.as_object_mut().expect("a row").remove(key).expect("a time");
    }
    result
}

/// Thirteen schemes, each killed three times: once its first checkpoint is there, in the middle, and at its last one.
#[cfg(unix)]
#[test]
fn a_killed_run_goes_on_to_the_same_bits() {
    let file = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/data/specs/revolution/ring-in-walls.toml --cells 8 --periods 0.3 --threads 2"
    );
    // In the half plane: on a lattice, clipped, and with a law that has internal variables of its own.
    let with_memory = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/data/specs/revolution/tube-maxwell.toml --shape cpdi2 --layout clipped --cells 8 --periods 0.1 --threads 2"
    );
    let turning = "twisting-cylinder --formulation updated-lagrangian --shape gimp --cells 8 --periods 0.2 --threads 2";
    let of_half_plane = [
        file.to_owned(),
        format!("{file} --shape cpdi2 --layout clipped"),
        with_memory.into(),
        turning.into(),
    ];
    for scheme in of_half_plane.iter().map(String::as_str).chain([
        "thick-cylinder --cells 8 --formulation total-lagrangian --shape bspline2 --periods 0.3",
        "axis-aligned --cells 16 --vtk frames --frames 9 --history history.csv",
        "axis-aligned --cells 16 --precision f32 --threads 2 --integrator musl",
        "ring --cells 16 --shape ugimp --integrator usf --threads 2",
        "ring --cells 12 --shape cpdi2 --layout body-fitted --start data",
        "ring-nu --cells 8 --layout clipped --grid-angle 20 --threads 2",
        "axis-aligned --cells 10 --transfer apic --integrator usavg",
        "axis-aligned --cells 24 --frame total --shape bspline3",
        "axis-aligned-3d --cells 4 --shape linear --integrator usl --history history.csv",
    ]) {
        is_killed_and_goes_on(scheme, &|steps| vec![3, steps / 2, steps - steps % 3]);
    }
}

/// Every shape function with every integrator and transfer, in turns of dimension, precision and threads, and the splines of the
/// total Lagrangian formulation; each killed once.
#[cfg(unix)]
#[test]
#[ignore = "minutes: .ci/long runs it"]
fn a_killed_run_of_any_scheme_goes_on_to_the_same_bits() {
    let solutions =
        ["axis-aligned --cells 6", "axis-aligned-1d --cells 12", "axis-aligned-3d --cells 3"];
    let mut schemes = Vec::new();
    for shape in ["linear", "ugimp", "gimp", "bspline2", "bspline3", "cpdi", "cpdi2"] {
        for integrator in ["usf", "usavg", "usl", "musl", "cd"] {
            for transfer in ["flip", "pic", "apic", "xpic2", "xpic3"] {
                let turn = schemes.len();
                let solution = solutions[turn % 3];
                let precision = ["f64", "f32"][turn / 3 % 2];
                let threads = 1 + turn % 2;
                schemes.push(format!(
                    "{solution} --shape {shape} --integrator {integrator} --transfer {transfer} --precision {precision} \
                     --threads {threads} --periods 0.5 --cfl 0.1"
                ));
            }
        }
    }
    for degree in 2..=5 {
        for mass in ["lumped", "consistent"] {
            schemes.push(format!(
                "axis-aligned --cells 8 --formulation total-lagrangian --shape bspline{degree} --mass {mass} --cfl 0.1"
            ));
        }
    }
    for scheme in schemes {
        is_killed_and_goes_on(&scheme, &|steps| vec![steps / 2]);
    }
}

/// Runs a scheme whole, and killed where its checkpoint has come to the given steps; both have to end alike.
#[cfg(unix)]
fn is_killed_and_goes_on(scheme: &str, kills: &dyn Fn(u64) -> Vec<u64>) {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let called = mms(place, &format!("run {scheme} --json whole.json"));
    // An error that is larger than the motion, as of PIC on a coarse grid, ends with status 1.
    let status = called.status;
    assert!([0, 1].contains(&status), "{scheme}: {}", called.stderr);
    let whole = read_json(&place.join("whole.json"));
    let frames = place.join("frames");
    let files = |folder: &Path| -> Vec<(String, Vec<u8>)> {
        let read = |name: String| (name.clone(), std::fs::read(folder.join(name)).unwrap());
        names(folder).into_iter().map(read).collect()
    };
    let expected = frames.exists().then(|| files(&frames));
    if expected.is_some() {
        std::fs::remove_dir_all(&frames).unwrap();
    }

    // The result goes to a pipe that nobody reads, so that the run cannot end before it is killed.
    let parts = place.join("parts.json");
    crate::command::pipe(&parts);
    let kept = place.join("kept");
    let steps = whole["result"]["steps"].as_u64().expect("a number");
    let run = format!("run {scheme} --json parts.json --checkpoint kept --every 3");
    let mut call = run.as_str();
    for step in kills(steps) {
        let mut run = UnderWay::start(place, call);
        run.wait_for(|| reached(&kept) >= step);
        run.kill();
        call = "resume kept";
    }
    std::fs::remove_file(&parts).unwrap();
    let called = mms(place, "resume kept --threads 1");
    assert_eq!(called.status, status, "{scheme}: {}", called.stderr);
    assert_eq!(result(&parts), result(&place.join("whole.json")), "{scheme}");
    assert_eq!(read_json(&parts)["history"], whole["history"], "{scheme}");
    if let Some(expected) = expected {
        let left: Vec<_> =
            files(&frames).into_iter().filter(|(name, _)| !name.ends_with(".tmp")).collect();
        assert!(left == expected, "{scheme}: other particle files");
    }
    assert_eq!(names(&kept), ["checkpoint", "lock", "run.json"], "{scheme}");
}

/// Long before its first checkpoint is due, and again after it goes on; a run of days, so that it cannot end before.
#[cfg(unix)]
#[test]
fn an_interrupted_run_leaves_a_checkpoint_and_goes_on() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let kept = place.join("kept");
    let run = "run bar --cells 8 --periods 1000000 --vtk frames --frames 1000000 --checkpoint kept --every 1000000";
    let mut steps = 0;
    for call in [run, "resume kept"] {
        let frames = place.join("frames");
        let written = || std::fs::read_dir(&frames).map_or(0, Iterator::count);
        let before = written();
        let mut run = UnderWay::start(place, call);
        run.wait_for(|| written() > before + 2);
        let (status, said) = run.interrupt();
        assert_eq!(status, 130, "{said}");
        assert!(reached(&kept) > steps, "{said}");
        steps = reached(&kept);
        let message = format!("kept goes on from there: interrupted after step {steps}, t = ");
        assert!(said.contains(&message), "{said}");
        assert_eq!(names(&kept), ["checkpoint", "lock", "run.json"]);
    }
}

#[cfg(unix)]
#[test]
fn a_study_and_what_steps_nothing_can_be_interrupted() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let mut study =
        UnderWay::start(place, "converge bar --cells 8,16 --periods 1000000 --out kept");
    study.wait_for(|| place.join("kept").exists());
    assert_eq!(study.interrupt().0, 130);
    // The result goes to a pipe that nobody reads.
    crate::command::pipe(&place.join("result.json"));
    let mut check = UnderWay::start(place, "run bar --cells 8 --json result.json --plot drift.svg");
    check.wait_for(|| place.join("drift.svg").exists());
    assert_eq!(check.interrupt().0, 130);
}

#[cfg(unix)]
#[test]
fn a_folder_belongs_to_its_run_while_that_lives() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    crate::command::pipe(&place.join("result.json"));
    let mut run =
        UnderWay::start(place, "run bar --cells 8 --json result.json --checkpoint kept --every 1");
    run.wait_for(|| reached(&place.join("kept")) > 0);
    refuses(place, "resume kept", &["kept: a process is at work on the run of this folder"]);
    run.kill();
    std::fs::remove_file(place.join("result.json")).unwrap();
    let called = mms(place, "resume kept");
    assert_eq!(called.status, 0, "{}", called.stderr);
}

/// A link at the name that was given to checkpoints under way leads nowhere else.
#[cfg(unix)]
#[test]
fn links_in_the_folder_are_not_followed() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    std::fs::write(place.join("mine"), "mine").unwrap();
    std::fs::create_dir(place.join("kept")).unwrap();
    std::os::unix::fs::symlink("../mine", place.join("kept/checkpoint.tmp")).unwrap();
    let called = mms(place, "run bar --cells 8 --checkpoint kept --every 1");
    assert_eq!(called.status, 0, "{}", called.stderr);
    assert_eq!(std::fs::read_to_string(place.join("mine")).unwrap(), "mine");
}

/// A full disk is met before the work, and told once. The limit on the size of files stands for it.
#[cfg(unix)]
#[test]
fn a_full_disk_is_noticed_at_the_door() {
    let place = tempfile::tempdir().unwrap();
    for arguments in [
        "reproduce --out report",
        "run ring --cells 64 --json a.json",
        "run ring --cells 64 --vtk frames",
        "tradeoff ring --csv a.csv",
        "stability ring --out study",
        "converge ring --cells 8,16 --plot a.svg",
    ] {
        // The signal would end the process; ignored, the limit becomes an error of the write, as a full disk is.
        let limited = r#"trap '' XFSZ; ulimit -f 8; exec "$0" "$@""#;
        let output = std::process::Command::new("sh")
            .args(["-c", limited, env!("CARGO_BIN_EXE_mms")])
            .args(arguments.split_whitespace())
            .current_dir(place.path())
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {said}");
        assert!(said.contains("no room for"), "{arguments}: {said}");
        assert_eq!(said.matches("os error").count(), 1, "{arguments}: {said}");
        assert!(output.stdout.is_empty(), "{arguments}: it has begun");
    }
}

#[test]
fn folders_that_cannot_be_gone_on_with_are_named() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    refuses(place, "resume nowhere", &["nowhere", "mms run --checkpoint nowhere writes"]);
    refuses(place, "run bar --every 3", &["--checkpoint"]);
    refuses(place, "run bar --process-grid 2x3", &["one process runs", "mpirun -n 6"]);
    refuses(place, "run bar --process-grid 2,3", &["--process-grid", "2x4"]);
    refuses(place, "run bars --checkpoint kept", &["did you mean 'bar'"]);

    let called = mms(place, "run bar --cells 8 --checkpoint kept --every 1");
    assert_eq!(called.status, 0, "{}", called.stderr);
    assert!(called.stderr.contains("mms resume kept goes on with it"), "{}", called.stderr);
    refuses(
        place,
        "run bar --cells 8 --checkpoint kept",
        &["holds a run already", "mms resume kept"],
    );

    // A run that is at its end prints its result again.
    let called = mms(place, "resume kept");
    assert_eq!(called.status, 0, "{}", called.stderr);
    assert!(called.stdout.contains("status: ok"), "{}", called.stdout);

    let checkpoint = place.join("kept/checkpoint");
    let whole = std::fs::read(&checkpoint).unwrap();
    std::fs::write(&checkpoint, &whole[..whole.len() / 2]).unwrap();
    refuses(place, "resume kept", &["kept/checkpoint", "damaged", "delete it"]);
    std::fs::write(&checkpoint, &whole).unwrap();

    let start = place.join("kept/run.json");
    let text = std::fs::read_to_string(&start).unwrap();
    for damaged in [text.replace("\"8\"", "\"9\""), "{}".into(), String::new()] {
        std::fs::write(&start, damaged).unwrap();
        refuses(
            place,
            "resume kept",
            &["kept/run.json is not what", "its checksum does not match"],
        );
    }
    std::fs::remove_file(&start).unwrap();
    let called = mms(place, "run bar --cells 9 --checkpoint other --every 1");
    assert_eq!(called.status, 0, "{}", called.stderr);
    std::fs::copy(place.join("other/run.json"), &start).unwrap();
    refuses(place, "resume kept", &["belongs to another run"]);
}
