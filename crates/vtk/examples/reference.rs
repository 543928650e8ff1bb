//! Writes what a series of frames holds as JSON, for readers in other languages to compare.
//!
//! `cargo run -p mmsmith-vtk --example reference -- FOLDER` makes a series of awkward frames, `FOLDER/awkward.pvd`, and
//! `FOLDER/REFERENCE.json` beside it. With the path of a `.pvd` file instead it takes the frames that are there. Then:
//! `python tests/python/read_back.py FOLDER/NAME.pvd FOLDER/REFERENCE.json`.

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use mmsmith_vtk::{Array, Frame, Series, Values};
use serde_json::{Map, Value, json};

#[path = "../tests/awkward/mod.rs"]
mod awkward;

fn main() -> Result<(), Box<dyn Error>> {
    let given =
        PathBuf::from(std::env::args_os().nth(1).ok_or("usage: reference FOLDER|SERIES.pvd")?);
    let (folder, frames) = match given.parent() {
        Some(folder) if given.extension().is_some_and(|e| e == "pvd") => {
            (folder.to_path_buf(), existing(&given)?)
        }
        _ => (given.clone(), awkward_series(&given)?),
    };
    fs::write(folder.join("REFERENCE.json"), serde_json::to_vec(&json!({ "frames": frames }))?)?;
    Ok(())
}

fn awkward_series(folder: &Path) -> Result<Vec<Value>, Box<dyn Error>> {
    let mut series = Series::create(folder, "awkward")?;
    let mut frames = Vec::new();
    for frame in awkward::frames() {
        let path = series.write(&frame)?;
        let file = path.file_name().ok_or("a frame without a file name")?.to_string_lossy();
        frames.push(reference(&frame, &file));
    }
    Ok(frames)
}

/// The frames that a `.pvd` file lists.
fn existing(pvd: &Path) -> Result<Vec<Value>, Box<dyn Error>> {
    let folder = pvd.parent().ok_or("a series without a folder")?;
    let list = fs::read_to_string(pvd)?;
    let files = list.split("file=\"").skip(1).filter_map(|rest| rest.split('"').next());
    files.map(|file| Ok(reference(&mmsmith_vtk::read(&folder.join(file))?, file))).collect()
}

fn reference(frame: &Frame, file: &str) -> Value {
    let arrays: Map<String, Value> = frame.arrays.iter().map(array).collect();
    json!({
        "file": file,
        "time": frame.time,
        "step": frame.step,
        "points": frame.points,
        "arrays": arrays,
    })
}

fn array(array: &Array) -> (String, Value) {
    let reference = match &array.values {
        Values::Scalar(values) => json!({ "kind": "scalar", "values": values }),
        Values::Vector(values) => json!({ "kind": "vector", "values": values }),
        Values::Tensor(values) => json!({ "kind": "tensor", "values": values }),
        Values::Id(values) => json!({ "kind": "id", "values": values }),
    };
    (array.name.clone(), reference)
}
