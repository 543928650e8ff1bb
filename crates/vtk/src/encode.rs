//! A frame as the bytes of a `.vtu` file.

use vtkio::IOBuffer;
use vtkio::model::{
    Attribute, Attributes, ByteOrder, CellType, Cells, DataSet, FieldArray, UnstructuredGridPiece,
    Version, VertexNumbers, Vtk,
};
use vtkio::xml::{Compressor, Data, DataArray, EncodingInfo, ScalarType, VTKFile};

use crate::{Error, Frame, Provenance, Values};

/// The beginning of every file. The variant of the format is the variant that every reader reads without loss.
pub(crate) const HEADER: &str = r#"<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64">"#;

/// The element that encloses the data; data of the whole frame come right behind it.
const GRID: &str = "<UnstructuredGrid>";

/// The tag that is followed by the frame's time.
pub(crate) const TIME: &str =
    r#"<DataArray type="Float64" Name="TimeValue" NumberOfTuples="1" format="binary">"#;

/// The tag that is followed by the frame's step.
pub(crate) const CYCLE: &str =
    r#"<DataArray type="Int64" Name="Cycle" NumberOfTuples="1" format="binary">"#;

/// The tag that is followed by the time of the velocities, in frames that tell it.
pub(crate) const VELOCITY_TIME: &str =
    r#"<DataArray type="Float64" Name="VelocityTime" NumberOfTuples="1" format="binary">"#;

/// The beginning of the tag of a parameter; the parameter's name follows.
pub(crate) const PARAMETER: &str = r#"<DataArray type="Float64" Name="parameter_"#;

/// The end of the tag of a parameter.
pub(crate) const PARAMETER_END: &str = r#"" NumberOfTuples="1" format="binary">"#;

/// The beginning of the tag of the solution's name; the number of its bytes follows.
pub(crate) const SOLUTION: &str = r#"<DataArray type="UInt8" Name="solution" NumberOfTuples=""#;

/// The form of numbers in the text.
pub(crate) const ENCODING: EncodingInfo = EncodingInfo {
    byte_order: ByteOrder::LittleEndian,
    header_type: ScalarType::UInt64,
    compressor: Compressor::None,
    compression_level: 0,
};

/// The frame as a `.vtu` file. The same frame gives the same bytes.
///
/// # Errors
///
/// Where [`Frame::check`] finds fault with the frame.
pub fn to_bytes(frame: &Frame) -> Result<Vec<u8>, Error> {
    frame.check()?;

    let file = VTKFile::try_from(grid(frame)).map_err(encode_error)?;
    let mut xml = Vec::new();
    file.write(&mut xml).map_err(encode_error)?;
    let xml = String::from_utf8(xml).map_err(encode_error)?;
    if !xml.starts_with(HEADER) {
        return Err(Error::Encode { cause: format!("the file does not begin with {HEADER}") });
    }
    let xml = without_ranges(&xml)?;
    Ok(insert_field_data(xml, frame)?.into_bytes())
}

fn grid(frame: &Frame) -> Vtk {
    let particles = frame.points.len() as u64;
    let attribute = |array: &crate::Array| {
        let (components, values) = match &array.values {
            Values::Scalar(values) => (1, IOBuffer::F64(values.clone())),
            Values::Vector(values) => (3, IOBuffer::F64(values.as_flattened().to_vec())),
            Values::Tensor(values) => (9, IOBuffer::F64(values.as_flattened().to_vec())),
            Values::Id(values) => (1, IOBuffer::U64(values.clone())),
        };
        Attribute::generic(&array.name, components).with_data(values)
    };
    Vtk {
        version: Version::new_xml(1, 0),
        byte_order: ENCODING.byte_order,
        title: String::new(),
        file_path: None,
        data: DataSet::inline(UnstructuredGridPiece {
            points: IOBuffer::F64(frame.points.as_flattened().to_vec()),
            // Each particle is a vertex cell of its own: meshio drops the shorter form, in which a single cell has all particles.
            cells: Cells {
                cell_verts: VertexNumbers::XML {
                    connectivity: (0..particles).collect(),
                    offsets: (1..=particles).collect(),
                },
                types: vec![CellType::Vertex; frame.points.len()],
            },
            data: Attributes { point: frame.arrays.iter().map(attribute).collect(), cell: vec![] },
        }),
    }
}

/// Removes the attributes `RangeMin` and `RangeMax`, which readers do not need.
///
/// vtkio takes them over all components of an array. The sign of a zero among them depends on the machine, so that one frame could give
/// two files.
fn without_ranges(xml: &str) -> Result<String, Error> {
    let mut parts = xml.split(r#" RangeMin=""#);
    let mut kept = String::with_capacity(xml.len() + 512);
    kept.extend(parts.next());
    for part in parts {
        let (_, rest) = part
            .split_once(r#"" RangeMax=""#)
            .and_then(|(_, after)| after.split_once('"'))
            .ok_or_else(|| Error::Encode { cause: "a RangeMin without RangeMax".into() })?;
        kept.push_str(rest);
    }
    Ok(kept)
}

/// Adds time and step, which vtkio has no place for.
fn insert_field_data(mut xml: String, frame: &Frame) -> Result<String, Error> {
    let marks: Vec<usize> = xml.match_indices(GRID).map(|(at, _)| at).collect();
    let [mark] = marks[..] else {
        let cause = format!("{GRID} occurs {} times instead of once", marks.len());
        return Err(Error::Encode { cause });
    };
    let time = encode_number("TimeValue", IOBuffer::F64(vec![frame.time]))?;
    let cycle = encode_number("Cycle", IOBuffer::I64(vec![frame.cycle()?]))?;
    let velocity_time = match frame.velocity_time {
        None => String::new(),
        Some(time) => {
            let number = encode_number("VelocityTime", IOBuffer::F64(vec![time]))?;
            format!("{VELOCITY_TIME}{number}</DataArray>")
        }
    };
    let provenance = frame.provenance.as_ref().map_or(Ok(String::new()), encode_provenance)?;
    let field_data = format!(
        "<FieldData>{TIME}{time}</DataArray>{CYCLE}{cycle}</DataArray>{velocity_time}{provenance}</FieldData>"
    );
    xml.insert_str(mark + GRID.len(), &field_data);
    Ok(xml)
}

fn encode_provenance(provenance: &Provenance) -> Result<String, Error> {
    let name = provenance.solution.as_bytes();
    let count = name.len();
    let letters = encode_number("solution", IOBuffer::U8(name.to_vec()))?;
    let mut arrays = format!(r#"{SOLUTION}{count}" format="binary">{letters}</DataArray>"#);
    for (name, value) in &provenance.parameters {
        let number = encode_number(name, IOBuffer::F64(vec![*value]))?;
        arrays += &format!("{PARAMETER}{name}{PARAMETER_END}{number}</DataArray>");
    }
    Ok(arrays)
}

fn encode_number(name: &str, number: IOBuffer) -> Result<String, Error> {
    let array = FieldArray::new(name, 1).with_data(number);
    let array = DataArray::from_field_array(array, ENCODING).map_err(encode_error)?;
    match array.data.into_iter().next() {
        Some(Data::Data(text)) => Ok(text),
        _ => Err(Error::Encode { cause: format!("{name} has no text") }),
    }
}

fn encode_error(cause: impl ToString) -> Error {
    Error::Encode { cause: cause.to_string() }
}
