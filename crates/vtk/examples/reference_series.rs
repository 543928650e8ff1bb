//! Writes a series of awkward frames and, beside it, what they hold as JSON, for readers in other languages to compare:
//! `cargo run -p mmsmith-vtk --example reference_series -- FOLDER`, then
//! `python tests/python/read_back.py FOLDER/awkward.pvd FOLDER/REFERENCE.json`.

use std::error::Error;
use std::fs;
use std::path::PathBuf;

use mmsmith_vtk::{Array, Frame, Series, Values};
use serde_json::{Map, Value, json};

#[path = "../tests/awkward/mod.rs"]
mod awkward;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args_os().nth(1).ok_or("usage: reference_series FOLDER")?);
    let mut series = Series::create(&folder, "awkward")?;
    let mut frames = Vec::new();
    for frame in awkward::frames() {
        let path = series.write(&frame)?;
        let file = path.file_name().ok_or("a frame without a file name")?.to_string_lossy();
        frames.push(reference(&frame, &file));
    }
    fs::write(folder.join("REFERENCE.json"), serde_json::to_vec(&json!({ "frames": frames }))?)?;
    Ok(())
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
