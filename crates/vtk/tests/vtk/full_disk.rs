//! A disk that fills up in the middle of a frame: the frames so far stay whole and nothing half-written remains.
//!
//! The disk is played by a child process that may not write files beyond a given size.

use std::fs;
use std::path::Path;
use std::process::Command;

use mmsmith_vtk::{Array, Frame, Series, Values, read};

const FOLDER: &str = "MMSMITH_FULL_DISK_FOLDER";

fn frame(time: f64, particles: usize) -> Frame {
    Frame {
        time,
        step: 1,
        velocity_time: None,
        provenance: None,
        points: vec![[time; 3]; particles],
        arrays: vec![Array {
            name: "stress".into(),
            values: Values::Tensor(vec![[time; 9]; particles]),
        }],
    }
}

/// Runs in the child only: a frame that fits, and one that does not.
#[test]
#[ignore = "is started by the other test, in a process of its own"]
fn child() {
    let Some(folder) = std::env::var_os(FOLDER) else { return };
    let mut series = Series::create(Path::new(&folder), "run").unwrap();
    series.write(&frame(10.0, 2)).unwrap();
    let message = series.write(&frame(20.0, 5000)).unwrap_err().to_string();
    assert!(message.contains("run-000001.vtu: "), "{message}");
    series.write(&frame(30.0, 2)).unwrap();
    // As soon as the list no longer fits, the frame that it would name is not counted either.
    let mut error = None;
    for k in 0..1000 {
        error = series.write(&frame(40.0 + f64::from(k), 2)).err();
        if error.is_some() {
            break;
        }
    }
    let message = error.unwrap().to_string();
    assert!(message.contains("run.pvd: "), "{message}");
}

#[test]
fn a_frame_that_does_not_fit_replaces_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let mut older = Series::create(folder.path(), "run").unwrap();
    for time in [1.0, 2.0, 3.0] {
        older.write(&frame(time, 5000)).unwrap();
    }

    // The signal would end the process; ignored, the limit becomes an error of the write, as a full disk is.
    // The unit of ulimit is 512 or 1024 bytes: above either, a frame of two particles fits and one of 5000 does not.
    let output = Command::new("sh")
        .args(["-c", r#"trap '' XFSZ; ulimit -f 8; exec "$0" --exact full_disk::child --ignored"#])
        .arg(std::env::current_exe().unwrap())
        .env(FOLDER, folder.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && said.contains("1 passed"), "{said}");

    let list = fs::read_to_string(folder.path().join("run.pvd")).unwrap();
    assert!(list.ends_with("</VTKFile>\n"), "{list}");
    let listed = list.matches("<DataSet").count();
    let time = |k: usize| read(&folder.path().join(format!("run-{k:06}.vtu"))).unwrap().time;
    assert_eq!([time(0), time(1)], [10.0, 30.0]);
    for k in 2..listed {
        assert_eq!(time(k), 38.0 + k as f64);
    }
    for entry in fs::read_dir(folder.path()).unwrap() {
        let path = entry.unwrap().path();
        assert!(path.extension().is_none_or(|extension| extension != "tmp"), "{path:?} is left");
    }
}

/// A child with the frame that does not fit as the last word of the process.
#[test]
#[ignore = "is started by the other test, in a process of its own"]
fn child_that_stops() {
    let Some(folder) = std::env::var_os(FOLDER) else { return };
    let mut series = Series::create(Path::new(&folder), "run").unwrap();
    series.write(&frame(20.0, 5000)).unwrap_err();
}

#[test]
fn an_older_series_survives_a_first_frame_that_does_not_fit() {
    let folder = tempfile::tempdir().unwrap();
    let mut older = Series::create(folder.path(), "run").unwrap();
    let path = older.write(&frame(1.0, 5000)).unwrap();
    let before = (fs::read(&path).unwrap(), fs::read(older.pvd()).unwrap());

    let output = Command::new("sh")
        .args([
            "-c",
            r#"trap '' XFSZ; ulimit -f 8; exec "$0" --exact full_disk::child_that_stops --ignored"#,
        ])
        .arg(std::env::current_exe().unwrap())
        .env(FOLDER, folder.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && said.contains("1 passed"), "{said}");
    assert!(before == (fs::read(&path).unwrap(), fs::read(older.pvd()).unwrap()));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
}
