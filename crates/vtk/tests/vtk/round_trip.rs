//! A frame comes back from its file bit for bit, through this crate's reader and through vtkio's own.

use crate::awkward::frames;
use mmsmith_vtk::{Array, Frame, Provenance, Series, Values, read, to_bytes};
use vtkio::IOBuffer;
use vtkio::model::{Attribute, DataSet, Piece, VertexNumbers, Vtk};

/// All numbers of a frame as bits, since -0.0 == 0.0.
fn bits(frame: &Frame) -> Vec<(String, Vec<u64>)> {
    let float_bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect();
    let mut all = vec![
        ("time and step".to_owned(), vec![frame.time.to_bits(), frame.step]),
        ("points".to_owned(), float_bits(frame.points.as_flattened())),
    ];
    for Array { name, values } in &frame.arrays {
        let (kind, values) = match values {
            Values::Scalar(values) => ("scalar", float_bits(values)),
            Values::Vector(values) => ("vector", float_bits(values.as_flattened())),
            Values::Tensor(values) => ("tensor", float_bits(values.as_flattened())),
            Values::Id(values) => ("id", values.clone()),
        };
        all.push((format!("{kind} {name}"), values));
    }
    all
}

#[test]
fn a_series_reads_back_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let mut series = Series::create(folder.path(), "awkward").unwrap();
    for frame in frames() {
        let path = series.write(&frame).unwrap();
        assert!(bits(&read(&path).unwrap()) == bits(&frame), "{} particles", frame.points.len());
    }
}

#[test]
fn a_frame_without_arrays_reads_back() {
    let folder = tempfile::tempdir().unwrap();
    let frame = Frame {
        time: 0.0,
        step: 0,
        velocity_time: Some(-0.125),
        provenance: None,
        points: vec![[1.0, 2.0, 3.0]],
        arrays: vec![],
    };
    let path = Series::create(folder.path(), "bare").unwrap().write(&frame).unwrap();
    assert_eq!(read(&path).unwrap(), frame);
}

fn of_solution() -> Provenance {
    let parameters = [("A", 0.1), ("parameter_A", -0.0), ("Cycle", 5e-324), ("lambda", 1e308)];
    Provenance {
        solution: "skew-2d".into(),
        parameters: parameters.map(|(name, value)| (name.to_owned(), value)).into(),
    }
}

#[test]
fn other_programs_read_the_solution_and_its_parameters() {
    let folder = tempfile::tempdir().unwrap();
    let frame = Frame {
        time: 0.0,
        step: 0,
        velocity_time: None,
        provenance: Some(of_solution()),
        points: vec![[1.0, 2.0, 3.0]],
        arrays: vec![],
    };
    Series::create(folder.path(), "told").unwrap().write(&frame).unwrap();
    let files = mmsmith_vtk::foreign::frames(folder.path()).unwrap();
    let snapshot = mmsmith_vtk::foreign::Snapshot::open(&files[0]).unwrap();
    assert_eq!(snapshot.provenance(), Some(of_solution()));
}

/// An array may bear a name that means something elsewhere in the file.
#[test]
fn names_of_the_format_are_harmless() {
    let folder = tempfile::tempdir().unwrap();
    let names = ["DataArray", "TimeValue", "Cycle", "Points", "connectivity", "UnstructuredGrid"];
    let array = |(number, name): (usize, &&str)| Array {
        name: name.to_string(),
        values: Values::Scalar(vec![number as f64]),
    };
    let frame = Frame {
        time: 1.5,
        step: 7,
        velocity_time: Some(1.25),
        provenance: Some(of_solution()),
        points: vec![[1.0, 2.0, 3.0]],
        arrays: names.iter().enumerate().map(array).collect(),
    };
    let path = Series::create(folder.path(), "names").unwrap().write(&frame).unwrap();
    assert_eq!(read(&path).unwrap(), frame);
}

#[test]
fn vtkio_reads_the_same_bits_and_one_vertex_a_particle() {
    for frame in frames() {
        let particles = frame.points.len();
        let vtk = Vtk::parse_xml(to_bytes(&frame).unwrap().as_slice()).unwrap();
        let DataSet::UnstructuredGrid { pieces, .. } = vtk.data else {
            panic!("not an unstructured grid");
        };
        let [Piece::Inline(piece)] = &pieces[..] else { panic!("not one piece") };
        assert!(piece.cells.types.iter().all(|&cell| cell as u8 == 1));
        let VertexNumbers::XML { connectivity, offsets } = &piece.cells.cell_verts else {
            panic!("cells of the legacy format")
        };
        assert!(connectivity.iter().copied().eq(0..particles as u64));
        assert!(offsets.iter().copied().eq(1..=particles as u64));

        let mut found = Vec::new();
        let mut buffer = |buffer: &IOBuffer| {
            found.push(match buffer {
                IOBuffer::F64(values) => values.iter().map(|value| value.to_bits()).collect(),
                IOBuffer::U64(values) => values.clone(),
                other => panic!("unexpected {:?}", other.scalar_type()),
            });
        };
        buffer(&piece.points);
        for attribute in &piece.data.point {
            let Attribute::DataArray(array) = attribute else { panic!("a field") };
            buffer(&array.data);
        }
        let expected: Vec<Vec<u64>> =
            bits(&frame).into_iter().skip(1).map(|(_, values)| values).collect();
        assert!(found == expected, "{particles} particles");
    }
}
