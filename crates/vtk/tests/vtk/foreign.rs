//! Files of other programs: what is in them, and that no damage makes the reader panic, hang or take memory.

#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};

use mmsmith_vtk::foreign::{FrameFile, Snapshot, frames};
use mmsmith_vtk::{Array, Frame, Series, Values};

fn recordings() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/score/ok")
}

/// All files of the recordings.
fn files() -> Vec<PathBuf> {
    let mut files = vec![];
    for entry in fs::read_dir(recordings()).unwrap() {
        let path = entry.unwrap().path();
        if path.is_file() {
            files.push(path);
        } else {
            files.extend(fs::read_dir(path).unwrap().map(|file| file.unwrap().path()));
        }
    }
    files.sort();
    assert!(files.len() > 40);
    files
}

/// Decodes all arrays, and returns how many numbers they have.
fn decode(frame: &FrameFile) -> Result<usize, String> {
    let words = |error: mmsmith_vtk::foreign::ReadError| error.to_string();
    let snapshot = Snapshot::open(frame).map_err(words)?;
    let mut count = snapshot.positions().map_err(words)?.len();
    for array in snapshot.arrays() {
        count += snapshot.floats(&array.name).map_err(words)?.unwrap().len();
        // Most arrays hold no whole numbers; they must say so and not more.
        let _ = snapshot.integers(&array.name);
    }
    let _ = snapshot.field("TimeValue");
    Ok(count)
}

#[test]
fn every_variant_has_all_arrays() {
    for file in files() {
        for frame in frames(&file).unwrap() {
            let count = decode(&frame).unwrap();
            // Six particles: a position, three vectors of three, two tensors of nine, an identity. In CSV: 18 columns, of
            // which two are asked for twice, as positions and as an array.
            let expected = if file.ends_with("columns.csv") { 6 * 20 } else { 6 * 31 };
            assert_eq!(count, expected, "{}", file.display());
        }
    }
}

#[test]
fn damage_is_refused_or_harmless() {
    let folder = tempfile::tempdir().unwrap();
    // A generator of Lehmer's kind; the test does the same every time.
    let mut state = 0x2545_f491_u64;
    let mut random = |below: usize| {
        state = state * 48271 % 0x7fff_ffff;
        state as usize % below
    };
    let (mut refused, mut accepted) = (0, 0);
    for file in files() {
        let bytes = fs::read(&file).unwrap();
        let path = folder.path().join(file.file_name().unwrap());
        for round in 0..60 {
            let mut damaged = bytes.clone();
            match round % 4 {
                0 => damaged.truncate(random(bytes.len())),
                1 => damaged[random(bytes.len())] = random(256) as u8,
                2 => {
                    // A repeated digit makes another valid file.
                    let digits: Vec<_> =
                        (0..bytes.len()).filter(|at| bytes[*at].is_ascii_digit()).collect();
                    damaged[digits[random(digits.len())]] = b'0' + random(10) as u8;
                }
                _ => {
                    let (from, to) = (random(bytes.len()), random(bytes.len()));
                    damaged.drain(from.min(to)..from.max(to));
                }
            }
            fs::write(&path, damaged).unwrap();
            let outcome = frames(&path)
                .map_err(|error| error.to_string())
                .and_then(|frames| frames.iter().map(decode).collect::<Result<Vec<_>, _>>());
            match outcome {
                Ok(_) => accepted += 1,
                Err(message) => {
                    refused += 1;
                    let name = path.file_name().unwrap().to_string_lossy().into_owned();
                    let other = folder.path().to_string_lossy().into_owned();
                    assert!(message.contains(&name) || message.contains(&other), "{message}");
                }
            }
        }
        fs::remove_file(&path).unwrap();
    }
    assert!(refused > 500 && accepted > 100, "{refused} refused, {accepted} accepted");
}

#[test]
fn own_frames_are_read_with_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let mut series = Series::create(folder.path(), "own").unwrap();
    let vectors = vec![[0.1, -0.0, 1e-300], [f64::MAX, 5e-324, 3.0]];
    let frame = Frame {
        time: 0.1 + 0.2,
        step: 3,
        velocity_time: Some(0.25),
        provenance: None,
        points: vectors.clone(),
        arrays: vec![
            Array { name: "u".into(), values: Values::Vector(vectors.clone()) },
            Array { name: "id".into(), values: Values::Id(vec![1 << 40, 7]) },
        ],
    };
    series.write(&frame).unwrap();
    for path in [series.pvd(), folder.path()] {
        let found = frames(path).unwrap();
        assert_eq!(found[0].time.map(f64::to_bits), Some((0.1_f64 + 0.2).to_bits()));
        let snapshot = Snapshot::open(&found[0]).unwrap();
        let bits = |flat: &[f64]| flat.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&snapshot.positions().unwrap()), bits(vectors.as_flattened()));
        let u = snapshot.floats("u").unwrap().unwrap();
        assert_eq!(bits(&u), bits(vectors.as_flattened()));
        assert_eq!(snapshot.integers("id").unwrap(), Some(vec![1 << 40, 7]));
        assert_eq!(snapshot.field("VelocityTime"), Some(0.25));
        assert_eq!(snapshot.field("TimeValue"), Some(0.1 + 0.2));
        assert_eq!(snapshot.floats("v").unwrap(), None);
    }
}

#[test]
fn pieces_are_put_one_behind_the_other() {
    let folder = tempfile::tempdir().unwrap();
    let piece = |points: &str, mass: &str, more: &str, count: usize| {
        format!(
            r#"<Piece NumberOfPoints="{count}"><PointData>
               <DataArray type="Float64" Name="mass" format="ascii">{mass}</DataArray>{more}</PointData>
               <Points><DataArray type="Float32" NumberOfComponents="3" format="ascii">{points}
               <InformationKey name="L2_NORM_RANGE" location="vtkDataArray" length="2"><Value index="0">0</Value>
               </InformationKey></DataArray></Points></Piece>"#
        )
    };
    let more = r#"<DataArray type="Int8" Name="only_here" format="ascii">1</DataArray>"#;
    let text = format!(
        r#"<VTKFile type="PolyData"><PolyData><!-- a comment -->{}{}<Piece NumberOfPoints="0"/></PolyData></VTKFile>"#,
        piece("1 2 3", "0.5", more, 1),
        piece("4 5 6 7 8 9", "1.5 2.5", "", 2)
    );
    let path = folder.path().join("pieces.vtp");
    fs::write(&path, text).unwrap();
    let snapshot = Snapshot::open(&frames(&path).unwrap()[0]).unwrap();
    assert_eq!(snapshot.particles(), 3);
    assert_eq!(snapshot.positions().unwrap(), (1..10).map(f64::from).collect::<Vec<_>>());
    assert_eq!(snapshot.floats("mass").unwrap(), Some(vec![0.5, 1.5, 2.5]));
    assert_eq!(snapshot.arrays().len(), 1);
    assert!(snapshot.points().unwrap().is_single);
}
