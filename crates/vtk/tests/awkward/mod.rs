//! Frames whose values are easy to lose on the way through a file.

use mmsmith_vtk::{Array, Frame, Values};

/// Zeros of both signs, the ends of the subnormal and of the normal range, and numbers that need all 17 digits.
pub(crate) const FLOATS: [f64; 16] = [
    0.0,
    -0.0,
    5e-324,
    -5e-324,
    2.225073858507201e-308,
    f64::MIN_POSITIVE,
    f64::MAX,
    f64::MIN,
    f64::EPSILON,
    1.0 + f64::EPSILON,
    0.1,
    0.1 + 0.2,
    -1.0 / 3.0,
    std::f64::consts::PI,
    9007199254740993e3,
    -1e-103,
];

/// Whole numbers that do not survive as a 32-bit, signed or floating-point number.
pub(crate) const IDS: [u64; 6] =
    [0, u32::MAX as u64 + 1, (1 << 53) + 1, i64::MAX as u64, i64::MAX as u64 + 1, u64::MAX];

/// One particle, a few, as many as fill blocks of 32 KiB exactly, and 5000.
pub(crate) fn frames() -> Vec<Frame> {
    vec![
        frame(-0.25, 0, 1),
        frame(0.0, 1, 16),
        frame(1e-7, (1 << 53) + 1, 4096),
        frame(0.1 + 0.2, i64::MAX as u64, 5000),
    ]
}

/// Arrays of all four kinds; no two entries of neighbouring particles agree.
fn frame(time: f64, step: u64, particles: usize) -> Frame {
    // Odd strides, since the number of values is a power of two: every value meets every component.
    let float = |particle: usize, component: usize| match particle / FLOATS.len() {
        0 => FLOATS[(particle + 3 * component) % FLOATS.len()],
        _ => ((particle * 9 + component) as f64 * 0.7).sin(),
    };
    let row3 = |particle: usize| std::array::from_fn(|component| float(particle, component));
    let row9 = |particle: usize| std::array::from_fn(|component| float(particle, component + 1));
    let array = |name: &str, values| Array { name: name.into(), values };
    Frame {
        time,
        step,
        velocity_time: None,
        provenance: None,
        points: (0..particles).map(row3).collect(),
        arrays: vec![
            array("displacement", Values::Vector((0..particles).map(|p| row3(p + 5)).collect())),
            array("deformation_gradient", Values::Tensor((0..particles).map(row9).collect())),
            array("von_mises", Values::Scalar((0..particles).map(|p| float(p, 2)).collect())),
            array(
                "particle_id",
                Values::Id(
                    (0..particles).map(|p| IDS[p % IDS.len()] ^ (p / IDS.len()) as u64).collect(),
                ),
            ),
        ],
    }
}
