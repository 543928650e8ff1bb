//! The bytes of the files are fixed: a change of them, wanted or not, shows here first.

use std::fs;

use mmsmith_vtk::{Array, Frame, Series, Values, read, to_bytes};

const VTU: &[u8] = include_bytes!("../data/two-particles.vtu");
const PVD: &[u8] = include_bytes!("../data/two-particles.pvd");

fn two_particles() -> Frame {
    let array = |name: &str, values| Array { name: name.into(), values };
    let row = |k: f64| [1.0 + k, k, 0.0, -k, 1.0 - k, 0.0, 0.0, -0.0, 1.0];
    Frame {
        time: 0.1 + 0.2,
        step: 12,
        velocity_time: None,
        provenance: None,
        points: vec![[0.25, -0.0, 0.0], [0.75, 5e-324, f64::MAX]],
        arrays: vec![
            array(
                "displacement",
                Values::Vector(vec![[0.1, 0.0, -0.0], [-1.0 / 3.0, 1e-103, 2.0]]),
            ),
            array("deformation_gradient", Values::Tensor(vec![row(0.125), row(1e-9)])),
            array("volume", Values::Scalar(vec![-0.0, 0.0])),
            array("particle_id", Values::Id(vec![(1 << 53) + 1, u64::MAX])),
        ],
    }
}

#[test]
fn a_frame_gives_the_committed_bytes() {
    let bytes = to_bytes(&two_particles()).unwrap();
    if bytes != VTU {
        let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR"));
        fs::write(folder.join("two-particles.vtu"), bytes).unwrap();
        panic!(
            "the bytes differ from tests/data/two-particles.vtu; the new ones are in {folder:?}"
        );
    }
}

#[test]
fn a_series_gives_the_committed_files() {
    let folder = tempfile::tempdir().unwrap();
    let mut series = Series::create(folder.path(), "two-particles & <more>").unwrap();
    let path = series.write(&two_particles()).unwrap();
    assert_eq!(path, folder.path().join("two-particles & <more>-000000.vtu"));
    series.write(&Frame { time: 1e-7, ..two_particles() }).unwrap();
    assert!(fs::read(path).unwrap() == VTU);
    assert_eq!(fs::read_to_string(series.pvd()).unwrap(), String::from_utf8_lossy(PVD),);
}

#[test]
fn the_committed_bytes_give_the_frame() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/two-particles.vtu");
    assert_eq!(read(path.as_ref()).unwrap(), two_particles());
}
