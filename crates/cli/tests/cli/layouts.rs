//! Hundreds of layouts of recordings whose order is known to be two: each is read as it is, or refused with the remedy.
//!
//! Each layout is drawn from formats, places, names, orders of particles, frames and options; the recordings have exact fields with an
//! error of `c h^2`. An order other than two that nobody doubts is the one outcome that must not be.

#![allow(clippy::unwrap_used)]

mod writers;

use self::writers::{Array, Format, Frame, Series, recording};
use crate::command::{mms, read_json};
use mmsmith_solutions::nalgebra::{SVector, Vector2};
use mmsmith_solutions::{AnySolution, Solution, build};
use serde_json::Value;
use std::path::Path;

/// Where the points are, and what tells the displacement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    Reference,
    Current,
    /// Current points and an array of reference positions.
    Both,
    /// Current points alone; particles are found again by identity.
    Traced,
    /// Reference points of a body that stands elsewhere: it needs `--origin`.
    Shifted,
    /// Reference points in millimetres: it needs `--length-unit`.
    Millimetres,
    /// Nodes of quadrilaterals.
    Mesh,
    /// Displacements of cells, at their centres.
    Cells,
}

/// Names of components.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Naming {
    Vector(&'static str),
    Scalars([&'static str; 2]),
}

/// The order of particles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Order {
    Kept,
    Named(&'static str),
    Shuffled(&'static str),
}

#[derive(Clone, Copy, Debug)]
struct Layout {
    format: Format,
    place: Place,
    naming: Naming,
    order: Order,
    series: Series,
    frames: usize,
    /// Whether the option that the place or the time needs is given.
    is_told: bool,
    has_parameters: bool,
}

const PLACES: [Place; 8] = [
    Place::Reference,
    Place::Current,
    Place::Both,
    Place::Traced,
    Place::Shifted,
    Place::Millimetres,
    Place::Mesh,
    Place::Cells,
];
const NAMINGS: [Naming; 7] = [
    Naming::Vector("displacement"),
    Naming::Vector("u"),
    Naming::Vector("DISPLACEMENT"),
    Naming::Scalars(["disp_x", "disp_y"]),
    Naming::Scalars(["u_x", "u_y"]),
    Naming::Scalars(["DISPLACEMENT_X", "DISPLACEMENT_Y"]),
    Naming::Scalars(["ux", "uy"]),
];
const ORDERS: [Order; 6] = [
    Order::Kept,
    Order::Named("id"),
    Order::Shuffled("particleID"),
    Order::Shuffled("GlobalNodeId"),
    Order::Shuffled("vtkOriginalPointIds"),
    Order::Shuffled("tag"),
];
const CELLS: [usize; 2] = [6, 12];
/// Layouts that are drawn.
const DRAWN: u64 = 180;
/// Share that is to be read at least of the layouts that are told all.
const READ: f64 = 0.9;

/// Numbers that look random, always the same (SplitMix64).
struct Draw(u64);

impl Draw {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    fn of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[(self.next() % choices.len() as u64) as usize]
    }
}

impl Layout {
    fn draw(seed: u64) -> Self {
        let draw = &mut Draw(seed);
        let place = draw.of(&PLACES);
        let format = draw.of(&Format::ALL);
        // Tables hold points alone; elements have no identity of their own.
        let has_cells = matches!(place, Place::Mesh | Place::Cells);
        let format = match format.is_table() && has_cells {
            true => Format::VtuAscii,
            false => format,
        };
        let order = match place {
            Place::Traced => draw.of(&ORDERS[1..]),
            Place::Mesh | Place::Cells => Order::Kept,
            _ => draw.of(&ORDERS),
        };
        Self {
            format,
            place,
            naming: draw.of(&NAMINGS),
            order,
            series: draw.of(&[Series::Timed, Series::Timed, Series::Folder]),
            frames: if place == Place::Traced { 4 } else { draw.of(&[1, 4]) },
            is_told: draw.of(&[true, true, true, false]),
            has_parameters: draw.of(&[true, false]),
        }
    }

    /// The options that tell what the files do not, each with whether it is needed.
    fn options(&self, times: &[f64]) -> Vec<(String, bool)> {
        let mut options = vec![];
        let has_times = self.series == Series::Timed && self.format != Format::Lammps;
        if !has_times {
            let times: Vec<_> = times.iter().map(|time| format!("{time:?}")).collect();
            options.push((format!("--times {}", times.join(",")), true));
        }
        match self.place {
            Place::Shifted => options.push(("--origin 0.5,0.25".into(), true)),
            Place::Millimetres => options.push(("--length-unit 0.001".into(), true)),
            _ => (),
        }
        options
    }
}

/// The displacement with its error, `c h^2` with a `c` that depends on place and time.
fn recorded(
    exact: &dyn Solution<f64, 2>,
    X: &SVector<f64, 2>,
    share: f64,
    t: f64,
    h: f64,
) -> SVector<f64, 2> {
    let c = Vector2::new(0.5 + 0.3 * X[0], -0.4 + 0.2 * X[1]);
    exact.displacement(X, t) + c * (0.02 * share * h * h)
}

/// The frames of a layout on a grid.
fn frames(
    exact: &dyn Solution<f64, 2>,
    layout: &Layout,
    cells: usize,
    times: &[f64],
) -> Vec<Frame> {
    let h = 1.0 / cells as f64;
    let is_mesh = matches!(layout.place, Place::Mesh | Place::Cells);
    let side = if is_mesh { cells + 1 } else { cells };
    let offset = if is_mesh { 0.0 } else { 0.5 * h };
    let nodes: Vec<_> = (0..side * side)
        .map(|n| Vector2::new((n % side) as f64 * h + offset, (n / side) as f64 * h + offset))
        .collect();
    let corner = |n: usize| n % cells + side * (n / cells);
    let quadrilateral = |n| [corner(n), corner(n) + 1, corner(n) + side + 1, corner(n) + side];
    let quadrilaterals: Vec<_> = (0..cells * cells).map(quadrilateral).collect();
    let draw = &mut Draw(cells as u64);
    let end = times[times.len() - 1];
    times
        .iter()
        .map(|&time| {
            let mut order: Vec<usize> = (0..nodes.len()).collect();
            if let Order::Shuffled(_) = layout.order {
                for n in (1..order.len()).rev() {
                    order.swap(n, (draw.next() % (n as u64 + 1)) as usize);
                }
            }
            let X: Vec<_> = order.iter().map(|n| nodes[*n]).collect();
            let u = |X: &_| recorded(exact, X, time / end, time, h);
            let of_cell = |cell: &[usize; 4]| {
                let centre = cell.iter().map(|n| nodes[*n]).sum::<SVector<f64, 2>>() * 0.25;
                u(&centre)
            };
            let places: Vec<_> = X.iter().map(|X| shown(layout.place, X, &u(X))).collect();
            let displacements: Vec<_> = match layout.place {
                Place::Cells => quadrilaterals.iter().map(of_cell).collect(),
                Place::Millimetres => X.iter().map(|X| u(X) * 1000.0).collect(),
                _ => X.iter().map(u).collect(),
            };
            let mut arrays = match layout.place {
                Place::Traced => vec![],
                _ => named(layout, &displacements),
            };
            if layout.place == Place::Both {
                let name = if layout.format.is_table() { "X" } else { "reference_position" };
                arrays.extend(match layout.format {
                    Format::Lammps => reference(["x0", "y0"], &X),
                    format if format.is_table() => reference(["X", "Y"], &X),
                    _ => vec![vector(name, &X)],
                });
            }
            let ids = order.iter().map(|n| *n as i64 + 1).collect();
            Frame {
                time,
                points: places,
                arrays,
                ids: match layout.order {
                    Order::Kept => None,
                    Order::Named(name) | Order::Shuffled(name) => Some((name.to_owned(), ids)),
                },
                cells: if is_mesh { quadrilaterals.clone() } else { vec![] },
                of_cells: layout.place == Place::Cells,
            }
        })
        .collect()
}

/// A point as the file has it.
fn shown(place: Place, X: &SVector<f64, 2>, u: &SVector<f64, 2>) -> [f64; 3] {
    let point = match place {
        Place::Reference | Place::Mesh | Place::Cells => *X,
        Place::Current | Place::Both | Place::Traced => X + u,
        Place::Shifted => X + Vector2::new(0.5, 0.25),
        Place::Millimetres => X * 1000.0,
    };
    [point[0], point[1], 0.0]
}

fn vector(name: &str, values: &[SVector<f64, 2>]) -> Array {
    let values = values.iter().flat_map(|v| [v[0], v[1], 0.0]).collect();
    Array { name: name.to_owned(), components: 3, values }
}

fn reference(names: [&str; 2], values: &[SVector<f64, 2>]) -> Vec<Array> {
    let scalar = |axis: usize| {
        let values = values.iter().map(|value| value[axis]).collect();
        Array { name: names[axis].to_owned(), components: 1, values }
    };
    vec![scalar(0), scalar(1)]
}

/// Displacements as the layout calls them.
fn named(layout: &Layout, values: &[SVector<f64, 2>]) -> Vec<Array> {
    match layout.naming {
        // Columns have one name for each component.
        Naming::Vector(_) if layout.format.is_table() => reference(["ux", "uy"], values),
        Naming::Vector(name) => vec![vector(name, values)],
        Naming::Scalars(names) => reference(names, values),
    }
}

/// Result for a layout.
#[derive(Debug, PartialEq)]
enum Outcome {
    /// The order is two.
    Read,
    /// It is said to be refused or doubtful, with the remedy.
    Remedy,
    Wrong(String),
}

fn outcome(folder: &Path, arguments: &str, needed: &[&str]) -> Outcome {
    let called = mms(folder, arguments);
    let names_remedy = |text: &str| match needed {
        [] => text.contains("--") || text.contains("column") || text.contains("expected"),
        needed => needed.iter().any(|option| text.contains(option)),
    };
    if called.status == 2 {
        return match names_remedy(&called.stderr) {
            true => Outcome::Remedy,
            false => Outcome::Wrong(format!("no remedy: {}", called.stderr)),
        };
    }
    let score = read_json(&folder.join("score.json"));
    let order = score["orders"]["u"]["l2"]["fit"].as_f64();
    let is_two = order.is_some_and(|order| (order - 2.0).abs() < 0.1);
    let is_ok = score["rows"].as_array().unwrap().iter().all(|row| row["status"] == "ok");
    match (is_two, is_ok) {
        (true, true) if score["passed"] == Value::Bool(true) && called.status == 0 => Outcome::Read,
        // An order that nobody is told to doubt.
        (false, true) if score["passed"] == Value::Bool(true) => {
            Outcome::Wrong(format!("passed with order {order:?}"))
        }
        _ if names_remedy(&called.stdout) => Outcome::Remedy,
        _ => {
            Outcome::Wrong(format!("order {order:?}, status {}, {}", called.status, called.stdout))
        }
    }
}

#[test]
fn hundreds_of_layouts_are_read_or_refused_with_the_remedy() {
    let Some(Ok(AnySolution::Two(exact))) = build::<f64>("skew-2d", &[0.1, 1e4, 0.3, 1.0]) else {
        panic!("it is of two dimensions")
    };
    let period = exact.period();
    let (mut told, mut read, mut wrong) = (0, 0, vec![]);
    let failed: Vec<u64> = std::env::var("LAYOUTS")
        .map(|seeds| seeds.split(',').filter_map(|seed| seed.parse().ok()).collect())
        .unwrap_or_default();
    for seed in 0..DRAWN {
        if !failed.is_empty() && !failed.contains(&seed) {
            continue;
        }
        let layout = Layout::draw(seed);
        let shares: &[f64] = if layout.frames == 1 { &[0.3] } else { &[0.0, 0.1, 0.2, 0.3] };
        let times: Vec<_> = shares.iter().map(|share| share * period).collect();
        let folder = tempfile::tempdir().unwrap();
        let grid = |cells: &usize| {
            let frames = frames(exact.as_ref(), &layout, *cells, &times);
            recording(folder.path(), &format!("n{cells}"), layout.format, layout.series, &frames)
        };
        let files: Vec<_> = CELLS.iter().map(grid).collect();
        let options = layout.options(&times);
        let is_told = layout.is_told || options.is_empty();
        let needed: Vec<_> = match is_told {
            true => vec![],
            false => options.iter().filter_map(|(option, _)| option.split(' ').next()).collect(),
        };
        let given = options.iter().filter(|_| layout.is_told).map(|(option, _)| option.as_str());
        let arguments = format!(
            "score skew-2d {} --set rho0=1 --cells 6,12 --json score.json --expect u=2 {}{}",
            files.join(" "),
            given.collect::<Vec<_>>().join(" "),
            if layout.has_parameters { " --set A=0.1" } else { "" },
        );
        let found = outcome(folder.path(), &arguments, &needed);
        told += usize::from(is_told);
        read += usize::from(is_told && found == Outcome::Read);
        if std::env::var("LAYOUTS").is_ok() {
            println!("{seed} {} {layout:?}: {found:?}", arguments);
        }
        if let Outcome::Wrong(why) = found {
            wrong.push(format!("{seed}: mms {arguments}\n{layout:?}\n{why}"));
        }
    }
    assert!(wrong.is_empty(), "{} of {DRAWN}:\n{}", wrong.len(), wrong.join("\n\n"));
    assert!(read as f64 >= READ * told as f64, "{read} of {told} layouts are read");
}
