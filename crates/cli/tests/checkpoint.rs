//! `mms run --checkpoint` and `mms resume`: a run that is killed at any moment goes on to the same bits.

mod command;

use command::{mms, names, read_json, refuses};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Starts `mms`, and kills it after a while unless it has ended.
fn killed(place: &Path, arguments: &str, after: Duration) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_mms"))
        .current_dir(place)
        .args(arguments.split_whitespace())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the binary starts");
    std::thread::sleep(after);
    // It may have ended already.
    let _ = child.kill();
    child.wait().expect("it has ended");
}

/// The result without its times.
fn result(path: &Path) -> Value {
    let mut result = read_json(path)["result"].take();
    for key in ["wall_s", "cpu_s", "particle_steps_per_s"] {
        result.as_object_mut().expect("a row").remove(key).expect("a time");
    }
    result
}

/// Seven schemes, each killed three times: 21 moments in all.
#[test]
fn a_killed_run_goes_on_to_the_same_bits() {
    let mut random = 12345_u32;
    for scheme in [
        "axis-aligned --cells 16 --vtk frames --frames 9",
        "axis-aligned --cells 16 --precision f32 --threads 2 --integrator musl",
        "ring --cells 16 --shape ugimp --integrator usf --threads 2",
        "ring --cells 12 --shape cpdi2 --layout body-fitted --start data",
        "axis-aligned --cells 10 --transfer apic --integrator usavg",
        "axis-aligned --cells 24 --frame total --shape bspline3",
        "axis-aligned-3d --cells 4 --shape linear --integrator usl",
    ] {
        let place = tempfile::tempdir().unwrap();
        let place = place.path();
        let started = Instant::now();
        let called = mms(place, &format!("run {scheme} --json whole.json"));
        let whole = started.elapsed();
        assert_eq!(called.status, 0, "{scheme}: {}", called.stderr);
        let frames = place.join("frames");
        let files = |folder: &Path| -> Vec<(String, Vec<u8>)> {
            let read = |name: String| (name.clone(), std::fs::read(folder.join(name)).unwrap());
            names(folder).into_iter().map(read).collect()
        };
        let expected = frames.exists().then(|| files(&frames));
        if expected.is_some() {
            std::fs::remove_dir_all(&frames).unwrap();
        }

        let mut moment = || {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            whole.mul_f64(f64::from(random) / f64::from(u32::MAX))
        };
        let run = format!("run {scheme} --json parts.json --checkpoint kept --every 3");
        killed(place, &run, moment());
        if !place.join("kept/run.json").exists() {
            // Killed before it began.
            killed(place, &run, moment().max(whole / 4));
        }
        killed(place, "resume kept", moment());
        killed(place, "resume kept", moment());
        let called = mms(place, "resume kept --threads 1");
        assert_eq!(called.status, 0, "{scheme}: {}", called.stderr);
        assert_eq!(
            result(&place.join("parts.json")),
            result(&place.join("whole.json")),
            "{scheme}"
        );
        if let Some(expected) = expected {
            let left: Vec<_> =
                files(&frames).into_iter().filter(|(name, _)| !name.ends_with(".tmp")).collect();
            assert!(left == expected, "{scheme}: other particle files");
        }
    }
}

#[test]
fn folders_that_cannot_be_gone_on_with_are_named() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    refuses(place, "resume nowhere", &["nowhere", "mms run --checkpoint nowhere writes"]);
    refuses(place, "run bar --every 3", &["--checkpoint"]);

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
    std::fs::write(&start, text.replace("\"8\"", "\"9\"")).unwrap();
    refuses(place, "resume kept", &["belongs to another run"]);
    std::fs::write(&start, "{}").unwrap();
    refuses(place, "resume kept", &["run.json is not what mms run --checkpoint writes"]);
}
