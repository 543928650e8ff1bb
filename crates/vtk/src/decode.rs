//! A frame from a `.vtu` file that this crate wrote.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use vtkio::IOBuffer;
use vtkio::model::{Attribute, DataSet, Piece, Vtk};
use vtkio::xml::{Data, DataArray, ScalarType};

use crate::encode::{
    CYCLE, ENCODING, HEADER, PARAMETER, PARAMETER_END, SOLUTION, TIME, VELOCITY_TIME,
};
use crate::{Array, Error, Frame, Provenance, Values};

/// Text that introduces an array in the file.
const ARRAY: &str = "<DataArray";

/// The number of arrays in every file beside the quantities of particles: time, step, points and three arrays of the cells. The time of
/// the velocities adds one array, the solution one array, and each of its parameters one array.
const FIXED_ARRAYS: usize = 6;

/// Reads a `.vtu` file that [`to_bytes`](crate::to_bytes) or [`Series`](crate::Series) wrote; the frame equals the
/// written one bit for bit. Files of other programs are refused. The whole file is held in memory.
///
/// # Errors
///
/// Where the file cannot be read, is not in the layout that this crate writes, or holds what [`Frame::check`] refuses.
pub fn read(path: &Path) -> Result<Frame, Error> {
    let text = fs::read_to_string(path).map_err(|cause| Error::FileSystem {
        action: "read",
        path: path.to_owned(),
        cause,
    })?;
    let frame = decode(&text).map_err(|cause| Error::Foreign { path: path.to_owned(), cause })?;
    frame
        .check()
        .map_err(|cause| Error::Foreign { path: path.to_owned(), cause: cause.to_string() })?;
    Ok(frame)
}

/// The frame, or a message with the expected content.
fn decode(text: &str) -> Result<Frame, String> {
    if !text.starts_with(HEADER) {
        return Err(format!("it does not begin with {HEADER}"));
    }
    let array_count = check_array_texts(text)?;

    let time = match decode_number(text, TIME, ScalarType::Float64)? {
        IOBuffer::F64(time) => time[0],
        _ => return Err("TimeValue is not f64".into()),
    };
    let cycle = match decode_number(text, CYCLE, ScalarType::Int64)? {
        IOBuffer::I64(cycle) => cycle[0],
        _ => return Err("Cycle is not i64".into()),
    };
    let step = u64::try_from(cycle).map_err(|_| format!("Cycle is {cycle}"))?;

    let velocity_time = match text.contains(VELOCITY_TIME) {
        false => None,
        true => match decode_number(text, VELOCITY_TIME, ScalarType::Float64)? {
            IOBuffer::F64(time) => Some(time[0]),
            _ => return Err("VelocityTime is not f64".into()),
        },
    };
    let provenance = provenance(text)?;
    let of_provenance = provenance.as_ref().map_or(0, |provenance| 1 + provenance.parameters.len());
    let fixed_arrays = FIXED_ARRAYS + usize::from(velocity_time.is_some()) + of_provenance;

    let vtk = Vtk::parse_xml(text.as_bytes()).map_err(|cause| cause.to_string())?;
    let DataSet::UnstructuredGrid { pieces, .. } = vtk.data else {
        return Err("it holds no unstructured grid".into());
    };
    let Ok([Piece::Inline(piece)]) = <[_; 1]>::try_from(pieces) else {
        return Err("it does not hold exactly one piece".into());
    };
    let IOBuffer::F64(points) = piece.points else {
        return Err("the points are not f64".into());
    };
    let arrays: Vec<Array> =
        piece.data.point.into_iter().map(array).collect::<Result<_, String>>()?;
    // vtkio leaves out, without a message, the arrays that it cannot read.
    if arrays.len() + fixed_arrays != array_count {
        let (expected, found) = (array_count.saturating_sub(fixed_arrays), arrays.len());
        return Err(format!("{found} of {expected} arrays over the particles can be read"));
    }
    Ok(Frame { time, step, velocity_time, provenance, points: rows(&points), arrays })
}

/// Makes sure that every array holds base64 for at least the eight bytes of its length, without which vtkio would
/// panic, and returns how many arrays there are.
fn check_array_texts(text: &str) -> Result<usize, String> {
    // vtkio would take such elements for arrays, too.
    if text.contains(":DataArray") {
        return Err("an array's tag has a namespace".into());
    }
    let mut count = 0;
    for part in text.split(ARRAY).skip(1) {
        count += 1;
        let (tag, after) = part.split_once('>').ok_or("an array's tag has no end")?;
        let content = after.split_once('<').map_or(after, |(content, _)| content);
        let digits = content.trim_end_matches('=');
        let is_base64 = |b: u8| b.is_ascii_alphanumeric() || b == b'+' || b == b'/';
        if !tag.ends_with(r#" format="binary""#)
            || digits.len() < 11
            || !digits.bytes().all(is_base64)
        {
            return Err(format!("array number {count} of the file holds no base64"));
        }
    }
    Ok(count)
}

/// The solution and its parameters, where the file tells them.
fn provenance(text: &str) -> Result<Option<Provenance>, String> {
    let Some((_, after)) = text.split_once(SOLUTION) else { return Ok(None) };
    let (count, _) = after.split_once('"').ok_or("the tag of the solution has no end")?;
    let letters = count.parse().map_err(|_| format!("the solution has {count:?} letters"))?;
    let tag = format!(r#"{SOLUTION}{count}" format="binary">"#);
    let IOBuffer::U8(name) = decode_numbers(text, &tag, ScalarType::UInt8, letters)? else {
        return Err("solution is not u8".into());
    };
    let solution = String::from_utf8(name).map_err(|_| "the solution's name is no text")?;
    let mut parameters = BTreeMap::new();
    for part in after.split(PARAMETER).skip(1) {
        let (name, _) = part.split_once('"').ok_or("the tag of a parameter has no end")?;
        let tag = format!("{PARAMETER}{name}{PARAMETER_END}");
        let IOBuffer::F64(value) = decode_number(text, &tag, ScalarType::Float64)? else {
            return Err(format!("parameter_{name} is not f64"));
        };
        parameters.insert(name.to_owned(), value[0]);
    }
    Ok(Some(Provenance { solution, parameters }))
}

/// The single number behind `tag`.
fn decode_number(text: &str, tag: &str, scalar_type: ScalarType) -> Result<IOBuffer, String> {
    decode_numbers(text, tag, scalar_type, 1)
}

/// The numbers behind `tag`.
fn decode_numbers(
    text: &str,
    tag: &str,
    scalar_type: ScalarType,
    count: usize,
) -> Result<IOBuffer, String> {
    let (_, after) = text.split_once(tag).ok_or_else(|| format!("{tag} is missing"))?;
    let (content, _) = after.split_once('<').ok_or_else(|| format!("{tag} has no end"))?;
    DataArray { scalar_type, data: vec![Data::Data(content.to_owned())], ..DataArray::default() }
        .into_io_buffer(count, None, ENCODING)
        .map_err(|cause| format!("{tag}: {cause}"))
}

fn array(attribute: Attribute) -> Result<Array, String> {
    let Attribute::DataArray(array) = attribute else {
        return Err("a field array among the arrays over the particles".into());
    };
    let values = match (array.num_comp(), array.data) {
        (1, IOBuffer::F64(values)) => Values::Scalar(values),
        (3, IOBuffer::F64(values)) => Values::Vector(rows(&values)),
        (9, IOBuffer::F64(values)) => Values::Tensor(rows(&values)),
        (1, IOBuffer::U64(values)) => Values::Id(values),
        (components, values) => {
            let scalar_type = values.scalar_type();
            return Err(format!("array `{}` has {components} x {scalar_type:?}", array.name));
        }
    };
    Ok(Array { name: array.name, values })
}

fn rows<const N: usize>(flat: &[f64]) -> Vec<[f64; N]> {
    flat.as_chunks().0.to_vec()
}
