//! Writers of the layouts that programs have: each by hand, so that none shares code with the reader.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// One array of a frame: a name, numbers for each point, and the numbers.
#[derive(Clone)]
pub(crate) struct Array {
    pub(crate) name: String,
    pub(crate) components: usize,
    pub(crate) values: Vec<f64>,
}

/// One frame: points in space, arrays, ids, cells.
#[derive(Clone)]
pub(crate) struct Frame {
    pub(crate) time: f64,
    pub(crate) points: Vec<[f64; 3]>,
    pub(crate) arrays: Vec<Array>,
    pub(crate) ids: Option<(String, Vec<i64>)>,
    /// Quadrilaterals; none for particles.
    pub(crate) cells: Vec<[usize; 4]>,
    /// Whether arrays belong to cells.
    pub(crate) of_cells: bool,
}

/// How a frame, or many, are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    CsvComma,
    CsvSemicolon,
    CsvTab,
    CsvNumpy,
    LegacyLower,
    LegacyUpper,
    VtuAscii,
    VtuBase64,
    Vtp,
    Pvtu,
    Lammps,
}

impl Format {
    pub(crate) const ALL: [Self; 11] = [
        Self::CsvComma,
        Self::CsvSemicolon,
        Self::CsvTab,
        Self::CsvNumpy,
        Self::LegacyLower,
        Self::LegacyUpper,
        Self::VtuAscii,
        Self::VtuBase64,
        Self::Vtp,
        Self::Pvtu,
        Self::Lammps,
    ];

    pub(crate) fn is_table(self) -> bool {
        self.separator().is_some() || self == Self::Lammps
    }

    /// Whether one file holds all frames, with a column of times.
    pub(crate) fn separator(self) -> Option<&'static str> {
        match self {
            Self::CsvComma | Self::CsvNumpy => Some(","),
            Self::CsvSemicolon => Some(";"),
            Self::CsvTab => Some("\t"),
            _ => None,
        }
    }

    fn extension(self) -> &'static str {
        match self {
            Self::CsvComma | Self::CsvSemicolon | Self::CsvTab | Self::CsvNumpy => "csv",
            Self::LegacyLower | Self::LegacyUpper => "vtk",
            Self::VtuAscii | Self::VtuBase64 => "vtu",
            Self::Vtp => "vtp",
            Self::Pvtu => "pvtu",
            Self::Lammps => "dump",
        }
    }

    fn frame(self, folder: &Path, index: usize, frame: &Frame) -> String {
        let name = format!("frame-{index}");
        let file = format!("{name}.{}", self.extension());
        let text = match self {
            Self::LegacyLower => legacy(frame, false),
            Self::LegacyUpper => legacy(frame, true),
            Self::VtuAscii => xml(frame, "UnstructuredGrid", false),
            Self::VtuBase64 => xml(frame, "UnstructuredGrid", true),
            Self::Vtp => xml(frame, "PolyData", false),
            Self::Pvtu => {
                let piece = format!("{name}_0.vtu");
                let folder_of_pieces = folder.join("pieces");
                fs::create_dir_all(&folder_of_pieces).unwrap();
                fs::write(folder_of_pieces.join(&piece), xml(frame, "UnstructuredGrid", false))
                    .unwrap();
                parallel(frame, &format!("pieces/{piece}"))
            }
            Self::Lammps => dump(frame, 100 * index),
            _ => table(std::slice::from_ref(frame), self, false),
        };
        fs::write(folder.join(&file), text).unwrap();
        file
    }
}

/// How the frames of a recording come together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Series {
    /// A list with times; for tables a column of times.
    Timed,
    /// A folder of frames without times.
    Folder,
}

/// Writes a recording into a folder of its own; the answer is what `mms score` is given.
pub(crate) fn recording(
    place: &Path,
    name: &str,
    format: Format,
    series: Series,
    frames: &[Frame],
) -> String {
    let folder = place.join(name);
    fs::create_dir_all(&folder).unwrap();
    if series == Series::Timed && format.separator().is_some() {
        let file = format!("{name}.csv");
        fs::write(place.join(&file), table(frames, format, true)).unwrap();
        return file;
    }
    let files: Vec<_> = frames
        .iter()
        .enumerate()
        .map(|(n, frame)| (frame.time, format.frame(&folder, n, frame)))
        .collect();
    if series == Series::Timed && format != Format::Lammps {
        let sets: String = files
            .iter()
            .map(|(time, file)| {
                format!("<DataSet timestep=\"{time:?}\" part=\"0\" file=\"{file}\"/>\n")
            })
            .collect();
        let list = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n{sets}</Collection>\n</VTKFile>\n"
        );
        fs::write(folder.join("all.pvd"), list).unwrap();
        return format!("{name}/all.pvd");
    }
    name.to_owned()
}

/// A table of comma-separated values or its kin.
fn table(frames: &[Frame], format: Format, with_times: bool) -> String {
    let separator = format.separator().unwrap_or(",");
    let mut names: Vec<String> = if with_times { vec!["t".into()] } else { vec![] };
    let frame = &frames[0];
    names.extend(frame.ids.as_ref().map(|(name, _)| name.clone()));
    names.extend(["x", "y"].map(String::from));
    for array in &frame.arrays {
        match array.components {
            1 => names.push(array.name.clone()),
            _ => names.extend((0..2).map(|n| format!("{}{}", array.name, ["x", "y"][n]))),
        }
    }
    let mut text = if format == Format::CsvNumpy { "# ".to_owned() } else { String::new() };
    text += &(names.join(separator) + "\n");
    for frame in frames {
        for p in 0..frame.points.len() {
            let mut row = if with_times { vec![format!("{:?}", frame.time)] } else { vec![] };
            row.extend(frame.ids.as_ref().map(|(_, ids)| ids[p].to_string()));
            row.extend(frame.points[p][..2].iter().map(|x| format!("{x:?}")));
            for array in &frame.arrays {
                let of = &array.values[p * array.components..(p + 1) * array.components];
                row.extend(of.iter().take(2).map(|value| format!("{value:?}")));
            }
            text += &(row.join(separator) + "\n");
        }
    }
    text
}

/// A text dump of LAMMPS.
fn dump(frame: &Frame, step: usize) -> String {
    let count = frame.points.len();
    let mut names: Vec<String> = vec![];
    for array in &frame.arrays {
        match array.components {
            1 => names.push(array.name.clone()),
            _ => names.extend(["x", "y", "z"].map(|axis| format!("{}{axis}", array.name))),
        }
    }
    let mut text = format!(
        "ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ATOMS\n{count}\nITEM: BOX BOUNDS sm sm sm\n0 1\n0 1\n0 1\n\
         ITEM: ATOMS id type x y z {}\n",
        names.join(" ")
    );
    for p in 0..count {
        let id = frame.ids.as_ref().map_or(p as i64 + 1, |(_, ids)| ids[p]);
        let [x, y, z] = frame.points[p];
        write!(text, "{id} 1 {x:?} {y:?} {z:?}").unwrap();
        for array in &frame.arrays {
            for value in &array.values[p * array.components..(p + 1) * array.components] {
                write!(text, " {value:?}").unwrap();
            }
        }
        text.push('\n');
    }
    text
}

/// Numbers in lines.
fn lines(values: &[f64], columns: usize) -> String {
    let row =
        |row: &[f64]| row.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(" ") + "\n";
    values.chunks(columns).map(row).collect()
}

/// The old form of VTK's files, in text.
fn legacy(frame: &Frame, is_upper: bool) -> String {
    let double = if is_upper { "DOUBLE" } else { "double" };
    let int = if is_upper { "INT" } else { "int" };
    let count = frame.points.len();
    let mut text =
        "# vtk DataFile Version 3.0\nfields\nASCII\nDATASET UNSTRUCTURED_GRID\n".to_owned();
    write!(text, "POINTS {count} {double}\n{}", lines(frame.points.as_flattened(), 3)).unwrap();
    let cells: Vec<Vec<usize>> = cells(frame);
    let size: usize = cells.iter().map(|cell| cell.len() + 1).sum();
    writeln!(text, "CELLS {} {size}", cells.len()).unwrap();
    for cell in &cells {
        let nodes: Vec<_> = cell.iter().map(usize::to_string).collect();
        writeln!(text, "{} {}", cell.len(), nodes.join(" ")).unwrap();
    }
    writeln!(text, "CELL_TYPES {}", cells.len()).unwrap();
    let kind = if frame.cells.is_empty() { "1\n" } else { "9\n" };
    text += &kind.repeat(cells.len());
    match frame.of_cells {
        true => writeln!(text, "CELL_DATA {}", cells.len()).unwrap(),
        false => writeln!(text, "POINT_DATA {count}").unwrap(),
    }
    if let Some((name, ids)) = &frame.ids {
        let ids: String = ids.iter().map(|id| format!("{id}\n")).collect();
        write!(text, "SCALARS {name} {int} 1\nLOOKUP_TABLE default\n{ids}").unwrap();
    }
    for Array { name, components, values } in &frame.arrays {
        let head = match components {
            1 => format!("SCALARS {name} {double} 1\nLOOKUP_TABLE default"),
            _ => format!("VECTORS {name} {double}"),
        };
        write!(text, "{head}\n{}", lines(values, *components)).unwrap();
    }
    text
}

/// The cells, or a vertex for each particle.
fn cells(frame: &Frame) -> Vec<Vec<usize>> {
    match frame.cells.is_empty() {
        true => (0..frame.points.len()).map(|point| vec![point]).collect(),
        false => frame.cells.iter().map(|cell| cell.to_vec()).collect(),
    }
}

/// An array in XML, in text or in base64 with its length before it.
fn data(kind: &str, name: &str, components: usize, values: &[f64], is_base64: bool) -> String {
    let head =
        format!("<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\"");
    if !is_base64 {
        let text: Vec<_> = values
            .iter()
            .map(|x| if kind == "Float64" { format!("{x:?}") } else { format!("{x}") })
            .collect();
        return format!("{head} format=\"ascii\">\n{}\n</DataArray>\n", text.join(" "));
    }
    let bytes: Vec<u8> = values
        .iter()
        .flat_map(|x| match kind {
            "Float64" => x.to_le_bytes().to_vec(),
            "UInt8" => vec![*x as u8],
            _ => (*x as i64).to_le_bytes().to_vec(),
        })
        .collect();
    let length = u32::try_from(bytes.len()).unwrap().to_le_bytes();
    let all: Vec<u8> = length.into_iter().chain(bytes).collect();
    format!("{head} format=\"binary\">\n{}\n</DataArray>\n", base64(&all))
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for group in bytes.chunks(3) {
        let number = (0..3).fold(0_u32, |n, k| n << 8 | u32::from(*group.get(k).unwrap_or(&0)));
        for k in 0..4 {
            let digit = DIGITS[(number >> (18 - 6 * k) & 63) as usize];
            text.push(if k <= group.len() { digit as char } else { '=' });
        }
    }
    text
}

/// VTK's XML.
fn xml(frame: &Frame, kind: &str, is_base64: bool) -> String {
    let count = frame.points.len();
    let cells = cells(frame);
    let numbers = |values: &[usize]| values.iter().map(|n| *n as f64).collect::<Vec<_>>();
    let nodes = numbers(&cells.concat());
    let mut end = 0;
    let offsets: Vec<_> = cells
        .iter()
        .map(|cell| {
            end += cell.len();
            end
        })
        .collect();
    let int = |name: &str, values: &[f64]| data("Int64", name, 1, values, is_base64);
    let of_cells = int("connectivity", &nodes) + &int("offsets", &numbers(&offsets));
    let is_mesh = !frame.cells.is_empty();
    let (cells_text, counts) = match (kind, is_mesh) {
        ("PolyData", true) => {
            (format!("<Polys>\n{of_cells}</Polys>\n"), format!("NumberOfPolys=\"{}\"", cells.len()))
        }
        ("PolyData", false) => {
            (format!("<Verts>\n{of_cells}</Verts>\n"), format!("NumberOfVerts=\"{}\"", cells.len()))
        }
        _ => {
            let types = vec![if is_mesh { 9.0 } else { 1.0 }; cells.len()];
            let types = data("UInt8", "types", 1, &types, is_base64);
            (
                format!("<Cells>\n{of_cells}{types}</Cells>\n"),
                format!("NumberOfCells=\"{}\"", cells.len()),
            )
        }
    };
    let mut arrays = String::new();
    if let Some((name, ids)) = &frame.ids {
        arrays += &int(name, &ids.iter().map(|id| *id as f64).collect::<Vec<_>>());
    }
    for Array { name, components, values } in &frame.arrays {
        arrays += &data("Float64", name, *components, values, is_base64);
    }
    let section = if frame.of_cells { "CellData" } else { "PointData" };
    let points = data("Float64", "Points", 3, frame.points.as_flattened(), is_base64);
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"{kind}\" version=\"0.1\" byte_order=\"LittleEndian\">\n<{kind}>\n\
         <Piece NumberOfPoints=\"{count}\" {counts}>\n<Points>\n{points}</Points>\n{cells_text}<{section}>\n{arrays}</{section}>\n\
         </Piece>\n</{kind}>\n</VTKFile>\n"
    )
}

/// The head file of pieces; here of one.
fn parallel(frame: &Frame, piece: &str) -> String {
    let mut arrays = String::new();
    if let Some((name, _)) = &frame.ids {
        arrays +=
            &format!("<PDataArray type=\"Int64\" Name=\"{name}\" NumberOfComponents=\"1\"/>\n");
    }
    for Array { name, components, .. } in &frame.arrays {
        arrays += &format!(
            "<PDataArray type=\"Float64\" Name=\"{name}\" NumberOfComponents=\"{components}\"/>\n"
        );
    }
    let section = if frame.of_cells { "PCellData" } else { "PPointData" };
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"PUnstructuredGrid\" version=\"0.1\" byte_order=\"LittleEndian\">\n\
         <PUnstructuredGrid GhostLevel=\"0\">\n<{section}>\n{arrays}</{section}>\n<PPoints>\n\
         <PDataArray type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\"/>\n</PPoints>\n<Piece Source=\"{piece}\"/>\n\
         </PUnstructuredGrid>\n</VTKFile>\n"
    )
}
