//! Frames that cannot become a whole file are refused by name, and nothing is overwritten.

use std::fs;
use std::path::Path;

use mmsmith_vtk::{Array, Error, Frame, Provenance, Series, Values, read, to_bytes};

fn frame(arrays: Vec<Array>) -> Frame {
    Frame {
        time: 0.5,
        step: 3,
        velocity_time: None,
        provenance: None,
        points: vec![[0.0; 3], [1.0; 3]],
        arrays,
    }
}

fn array(name: &str, values: Values) -> Array {
    Array { name: name.into(), values }
}

#[track_caller]
fn refused(frame: &Frame) -> String {
    to_bytes(frame).expect_err("the frame is accepted").to_string()
}

#[test]
fn a_frame_without_particles() {
    let empty = Frame { points: vec![], ..frame(vec![]) };
    assert_eq!(refused(&empty), "the frame has no particle");
}

#[test]
fn an_array_of_the_wrong_length() {
    let short = frame(vec![array("stress", Values::Tensor(vec![[0.0; 9]]))]);
    assert_eq!(refused(&short), "array `stress` has 1 entries for 2 particles");
    let long = frame(vec![array("id", Values::Id(vec![1, 2, 3]))]);
    assert_eq!(refused(&long), "array `id` has 3 entries for 2 particles");
}

#[test]
fn names_that_some_reader_loses() {
    for name in ["", "von mises", "σ", "a\"b", "a<b", "a\nb", "a.b", "a-b"] {
        let bad = frame(vec![array(name, Values::Scalar(vec![0.0; 2]))]);
        let message = refused(&bad);
        assert!(message.starts_with(&format!("array name {name:?}: use letters")), "{message}");
    }
}

#[test]
fn a_repeated_name() {
    let twice = frame(vec![
        array("volume", Values::Scalar(vec![0.0; 2])),
        array("volume", Values::Id(vec![0; 2])),
    ]);
    assert_eq!(refused(&twice), "two arrays of the frame are named `volume`");
}

#[test]
fn a_solution_that_no_file_can_tell() {
    let of = |solution: &str, parameter: &str, value| Frame {
        provenance: Some(Provenance {
            solution: solution.into(),
            parameters: [(parameter.to_owned(), value)].into(),
        }),
        ..frame(vec![])
    };
    assert!(
        refused(&of("my ring", "A", 1.0)).starts_with("solution name \"my ring\": use letters")
    );
    assert!(refused(&of("ring", "A.1", 1.0)).starts_with("array name \"A.1\": use letters"));
    assert_eq!(
        refused(&of("ring", "A", f64::NAN)),
        "parameter A of the solution is NaN; it must be finite"
    );
}

#[test]
fn values_that_are_not_finite() {
    let vectors = vec![[0.0; 3], [0.0, 0.0, f64::NEG_INFINITY]];
    assert_eq!(
        refused(&frame(vec![array("velocity", Values::Vector(vectors))])),
        "array `velocity`, particle 1, component 2: -inf is not finite"
    );
    assert_eq!(
        refused(&frame(vec![array("volume", Values::Scalar(vec![f64::NAN, 0.0]))])),
        "array `volume`, particle 0, component 0: NaN is not finite"
    );
    let mut tensors = vec![[0.0; 9]; 2];
    tensors[1][8] = f64::INFINITY;
    assert_eq!(
        refused(&frame(vec![array("stress", Values::Tensor(tensors))])),
        "array `stress`, particle 1, component 8: inf is not finite"
    );
    let points = vec![[0.0; 3], [0.0, f64::NAN, 0.0]];
    assert_eq!(
        refused(&Frame { points, ..frame(vec![]) }),
        "array `points`, particle 1, component 1: NaN is not finite"
    );
    assert_eq!(
        refused(&Frame { velocity_time: Some(f64::NAN), ..frame(vec![]) }),
        "the frame's time is NaN; it must be finite"
    );
    assert_eq!(
        refused(&Frame { time: f64::NAN, ..frame(vec![]) }),
        "the frame's time is NaN; it must be finite"
    );
}

#[test]
fn a_step_beyond_the_format() {
    let late = Frame { step: 1 << 63, ..frame(vec![]) };
    assert_eq!(
        refused(&late),
        "the frame's step is 9223372036854775808; a file holds at most 9223372036854775807"
    );
}

#[test]
fn a_refused_frame_leaves_the_series_whole() {
    let folder = tempfile::tempdir().unwrap();
    let mut series = Series::create(folder.path(), "run").unwrap();
    series.write(&frame(vec![])).unwrap();
    let before = contents(folder.path());
    series.write(&Frame { time: f64::NAN, ..frame(vec![]) }).unwrap_err();
    assert_eq!(contents(folder.path()), before);
    let next = series.write(&frame(vec![])).unwrap();
    assert_eq!(next, folder.path().join("run-000001.vtu"));
}

#[test]
fn names_that_cannot_begin_a_file_name() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["", ".", "..", ".hidden", "a/b", "../a", "a\\b", "a\nb", "a\0b"] {
        let error = Series::create(&folder.path().join("new"), name).unwrap_err();
        assert!(matches!(error, Error::SeriesName { .. }), "{error}");
    }
    assert!(contents(folder.path()).is_empty());
}

#[test]
fn folders_that_cannot_be_written() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    fs::write(&file, "mine").unwrap();
    for path in [file.clone(), file.join("below")] {
        let message = Series::create(&path, "run").unwrap_err().to_string();
        let beginning = format!("cannot create the folder {}: ", path.display());
        assert!(message.starts_with(&beginning), "{message}");
    }
    assert_eq!(fs::read(file).unwrap(), b"mine");
}

/// The folder is there, but nobody may create a file in it, not even the administrator.
#[cfg(target_os = "linux")]
#[test]
fn a_folder_that_takes_no_files() {
    let message = Series::create(Path::new("/proc"), "run").unwrap_err().to_string();
    assert!(message.starts_with("cannot write /proc/run.pvd: "), "{message}");
}

#[test]
fn a_folder_in_the_place_of_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("run-000000.vtu");
    fs::create_dir(&place).unwrap();
    fs::write(place.join("inside"), "mine").unwrap();
    let mut series = Series::create(folder.path(), "run").unwrap();
    let message = series.write(&frame(vec![])).unwrap_err().to_string();
    assert!(message.starts_with(&format!("cannot write {}: ", place.display())), "{message}");
    assert_eq!(fs::read(place.join("inside")).unwrap(), b"mine");
    assert_eq!(contents(folder.path()), ["run-000000.vtu"]);
}

#[test]
fn a_new_series_lists_only_its_own_frames() {
    let folder = tempfile::tempdir().unwrap();
    let parents = folder.path().join("some/where");
    let mut older = Series::create(&parents, "run").unwrap();
    for time in [0.0, 1.0, 2.0] {
        older.write(&Frame { time, ..frame(vec![]) }).unwrap();
    }
    let list = fs::read_to_string(older.pvd()).unwrap();

    let mut newer = Series::create(&parents, "run").unwrap();
    assert_eq!(fs::read_to_string(newer.pvd()).unwrap(), list);
    // What a killed run leaves behind is no obstacle.
    fs::write(parents.join("run-000000.vtu.tmp"), "half a fra").unwrap();
    let path = newer.write(&Frame { time: 7.5, ..frame(vec![]) }).unwrap();
    assert_eq!(read(&path).unwrap().time, 7.5);
    let list = fs::read_to_string(newer.pvd()).unwrap();
    assert_eq!(list.matches("<DataSet").count(), 1);
    assert!(list.contains(r#"timestep="7.5" part="0" file="run-000000.vtu""#), "{list}");
    assert_eq!(
        contents(&parents),
        ["run-000000.vtu", "run-000001.vtu", "run-000002.vtu", "run.pvd"]
    );
}

#[test]
fn files_of_others_are_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.vtu");
    let message = read(&path).unwrap_err().to_string();
    assert!(message.starts_with(&format!("cannot read {}: ", path.display())), "{message}");

    let whole = to_bytes(&frame(vec![array("volume", Values::Scalar(vec![1.0, 2.0]))])).unwrap();
    let text = String::from_utf8(whole).unwrap();
    let empty_as = |tag: &str| {
        let array =
            format!(r#"{tag} type="Float64" Name="volume" format="binary"></{}>"#, tag[1..].trim());
        text.replace("<PointData>", &format!("<PointData>{array}"))
    };
    let altered = [
        (String::new(), "does not begin with"),
        (text.replace("LittleEndian", "BigEndian"), "does not begin with"),
        (text.replace("TimeValue", "Time"), "is missing"),
        (text.replace(r#"NumberOfPoints="2""#, r#"NumberOfPoints="3""#), "Points"),
        (text.replace(r#"Name="volume""#, r#"Name="volume" NumberOfComponents="2""#), "0 of 1"),
        (text.replace(r#"Name="volume""#, r#"Name="a b""#), "use letters"),
        (text.replace(r#"type="Float64" Name="volume""#, r#"type="Int64" Name="volume""#), "I64"),
        (text.replace("DataArray", "x:DataArray"), "namespace"),
        (empty_as("<x:DataArray"), "namespace"),
        (empty_as("<DataArray\t"), "base64"),
    ];
    for (text, cause) in altered {
        fs::write(&path, text).unwrap();
        let message = read(&path).unwrap_err().to_string();
        let beginning = format!("{} is no frame as mmsmith writes it: ", path.display());
        assert!(message.starts_with(&beginning) && message.contains(cause), "{message}");
    }
}

/// Reading a damaged file may give an error or other numbers, but never a panic.
#[test]
fn damaged_files_do_not_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.vtu");
    let arrays =
        vec![array("a", Values::Id(vec![1, 2])), array("b", Values::Vector(vec![[0.1; 3]; 2]))];
    let whole = to_bytes(&frame(arrays)).unwrap();
    let bytes = *b"<>\"'&=/ A9\0\xff";
    let lengths = [1, 2, 7, 24, 60];
    for at in 0..whole.len() {
        fs::write(&path, &whole[..at]).unwrap();
        read(&path).unwrap_err();

        let mut replaced = whole.clone();
        replaced[at] = bytes[at % bytes.len()];
        fs::write(&path, &replaced).unwrap();
        let _ = read(&path);

        let mut shortened = whole.clone();
        shortened.drain(at..whole.len().min(at + lengths[at % lengths.len()]));
        fs::write(&path, &shortened).unwrap();
        let _ = read(&path);
    }
}

/// The names of the files in a folder, sorted.
fn contents(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .expect("the folder can be read")
        .map(|entry| entry.expect("the folder can be read").file_name())
        .map(|name| name.to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}
