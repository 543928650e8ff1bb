//! `mms score` of recordings that are written in unusual ways, or wrongly: what is right is read, what is wrong is named.
//!
//! All have the exact fields of one motion with an error of `c h^p`; each test changes one thing.

#![allow(clippy::unwrap_used)]

use crate::command::{mms, read_json, refuses};
use mmsmith_solutions::nalgebra::{Matrix2, SVector, Vector2};
use mmsmith_solutions::{AnySolution, Solution, build};
use serde_json::Value;
use std::fmt::Write;
use std::fs;
use std::path::Path;

const CELLS: [usize; 2] = [6, 12];
const DENSITY: f64 = 2.0;

type Exact = Box<dyn Solution<f64, 2>>;

fn exact() -> Exact {
    match build::<f64>("skew-2d", &[0.1, 1e4, 0.3, DENSITY]) {
        Some(Ok(AnySolution::Two(exact))) => exact,
        _ => panic!("it is of two dimensions"),
    }
}

/// A particle in a frame.
struct Particle {
    number: usize,
    t: f64,
    X: Vector2<f64>,
    u: Vector2<f64>,
    v: Vector2<f64>,
}

/// Particles of all frames, frame by frame.
fn particles(exact: &Exact, cells: usize, order: i32) -> Vec<Vec<Particle>> {
    let error = 0.2 * (cells as f64).recip().powi(order);
    let of_frame = |frame: usize| {
        let t = 0.15 * exact.period() * frame as f64;
        let particle = |number: usize| {
            let at = |k: usize| (k as f64 + 0.5) / cells as f64;
            let X = Vector2::new(at(number % cells), at(number / cells));
            let wave = Vector2::new((3.0 * X.y).cos(), (2.0 * X.x).sin());
            let u = exact.displacement(&X, t) + 0.1 * error * wave;
            Particle { number, t, X, u, v: exact.velocity(&X, t) }
        };
        (0..cells * cells).map(particle).collect()
    };
    (0..4).map(of_frame).collect()
}

/// A line for each of them.
fn table(
    header: &str,
    particles: &[Vec<Particle>],
    line: impl Fn(&Particle) -> Vec<f64>,
) -> String {
    let mut text = format!("{header}\n");
    for particle in particles.iter().flatten() {
        let words: Vec<_> = line(particle).iter().map(|value| format!("{value:?}")).collect();
        writeln!(text, "{}", words.join(",")).unwrap();
    }
    text
}

/// The score of both files, which `write` gives by their cells; the exit status is held against it.
fn score(place: &Path, options: &str, write: impl Fn(usize) -> String) -> Value {
    for cells in CELLS {
        fs::write(place.join(format!("n{cells}.csv")), write(cells)).unwrap();
    }
    let [coarse, fine] = CELLS;
    let call = format!(
        "score skew-2d n{coarse}.csv n{fine}.csv --cells {coarse},{fine} --set rho0=2 {options} --json score.json"
    );
    let called = mms(place, &call);
    let score = read_json(&place.join("score.json"));
    assert_eq!(called.status, i32::from(score["passed"] == false), "{call}: {}", called.stderr);
    score
}

fn order(score: &Value, field: &str) -> f64 {
    score["orders"][field]["l2"]["fit"].as_f64().unwrap()
}

fn verdict(score: &Value) -> &str {
    score["verdict"]["message"].as_str().unwrap()
}

/// The message of the first finding of a kind.
fn finding<'a>(score: &'a Value, kind: &str) -> Option<&'a str> {
    let all = score["findings"].as_array().unwrap();
    all.iter().find(|finding| finding["kind"] == kind)?["message"].as_str()
}

/// Numbers in an order that looks random.
fn mixed<T>(mut all: Vec<T>, seed: usize) -> Vec<T> {
    for n in (1..all.len()).rev() {
        all.swap(n, (n * 7919 + seed * 104_729) % (n + 1));
    }
    all
}

#[test]
fn velocities_half_a_step_behind_are_named_with_the_lag_of_each_grid() {
    let (place, exact) = (tempfile::tempdir().unwrap(), exact());
    let step = |cells: usize| exact.period() / (20.0 * cells as f64);
    let write = |cells: usize, late: f64| {
        table("t,X,Y,ux,uy,vx,vy", &particles(&exact, cells, 2), |p| {
            let v = exact.velocity(&p.X, p.t - late * step(cells));
            let wave = 0.02 * (cells as f64).powi(-2) * exact.velocity(&p.X, 0.0).norm();
            vec![p.t, p.X.x, p.X.y, p.u.x, p.u.y, v.x + wave, v.y]
        })
    };
    let behind = score(place.path(), "", |cells| write(cells, 0.5));
    assert!(order(&behind, "v") < 1.3, "{}", order(&behind, "v"));
    let message = finding(&behind, "velocity-lag").unwrap();
    let option = message.split("--velocity-lag ").nth(1).unwrap().split(' ').next().unwrap();
    let lags: Vec<f64> = option.split(',').map(|lag| lag.parse().unwrap()).collect();
    for (lag, cells) in lags.iter().zip(CELLS) {
        assert!((lag / (0.5 * step(cells)) - 1.0).abs() < 0.1, "{message}");
    }
    let mended =
        score(place.path(), &format!("--velocity-lag {option}"), |cells| write(cells, 0.5));
    assert!(order(&mended, "v") > 1.7, "{}", order(&mended, "v"));
    // Velocities with an error of another kind have none.
    let right = score(place.path(), "", |cells| write(cells, 0.0));
    assert_eq!(finding(&right, "velocity-lag"), None);
    let rough = score(place.path(), "", |cells| {
        table("t,X,Y,ux,uy,vx,vy", &particles(&exact, cells, 2), |p| {
            let wrong = p.v * (1.0 + (cells as f64).recip());
            vec![p.t, p.X.x, p.X.y, p.u.x, p.u.y, wrong.x, wrong.y]
        })
    });
    assert_eq!(finding(&rough, "velocity-lag"), None);
    let called =
        mms(place.path(), "score skew-2d n6.csv n12.csv --cells 6,12 --velocity-lag 1,2,3");
    assert!(called.stderr.contains("--velocity-lag has 3 value(s)"), "{}", called.stderr);
}

#[test]
fn exchanged_columns_are_named() {
    let (place, exact) = (tempfile::tempdir().unwrap(), exact());
    for (header, columns) in [
        ("t,X,Y,uy,ux,vx,vy", "ux and uy"),
        ("t,X,Y,uy,ux,vy,vx", "ux and uy, vx and vy"),
        ("t,ux,Y,X,uy,vx,vy", "X and ux"),
        ("t,ux,uy,X,Y,vx,vy", "of reference positions and of displacements"),
    ] {
        let score = score(place.path(), "", |cells| {
            table(header, &particles(&exact, cells, 2), |p| {
                vec![p.t, p.X.x, p.X.y, p.u.x, p.u.y, p.v.x, p.v.y]
            })
        });
        assert_eq!(score["passed"], false, "{header}");
        let message = finding(&score, "other-place").unwrap_or_default();
        assert!(message.contains(&format!("the columns {columns} written")), "{header}: {message}");
    }
}

#[test]
fn shuffled_particles_without_identities_are_a_problem_that_names_them() {
    let (place, exact) = (tempfile::tempdir().unwrap(), exact());
    let write = |cells: usize, order: i32, with_number: bool| {
        let frames = particles(&exact, cells, order).into_iter().enumerate();
        let frames: Vec<_> = frames.map(|(seed, frame)| mixed(frame, seed)).collect();
        let header = if with_number { "t,x,y,serial" } else { "t,x,y" };
        table(header, &frames, |p| {
            let x = p.X + p.u;
            let mut line = vec![p.t, x.x, x.y];
            line.extend(with_number.then_some(p.number as f64));
            line
        })
    };
    let without = score(place.path(), "", |cells| write(cells, 2, false));
    assert_eq!(without["passed"], false);
    assert!(finding(&without, "shuffled").unwrap().contains("write an array id"));
    let with = score(place.path(), "", |cells| write(cells, 2, true));
    assert!(finding(&with, "shuffled").unwrap().contains("--map id=serial"));
    for found in 0..=2 {
        let mapped = score(place.path(), "--map id=serial", |cells| write(cells, found, true));
        assert!((order(&mapped, "u") - f64::from(found)).abs() < 0.1, "{}", order(&mapped, "u"));
        assert_eq!(finding(&mapped, "shuffled"), None);
    }
    // A wrong motion is no other order.
    let wrong = score(place.path(), "", |cells| {
        table("t,x,y", &particles(&exact, cells, 2), |p| vec![p.t, p.X.x - p.u.x, p.X.y - p.u.y])
    });
    assert_eq!(finding(&wrong, "shuffled"), None);
}

#[test]
fn rows_that_stand_particle_by_particle_are_read() {
    let (place, exact) = (tempfile::tempdir().unwrap(), exact());
    for found in 0..=2 {
        let score = score(place.path(), "", |cells| {
            let frames = particles(&exact, cells, found);
            let mut all: Vec<Particle> = frames.into_iter().flatten().collect();
            all.sort_by_key(|particle| particle.number);
            table("t,id,x,y", &[all], |p| vec![p.t, p.number as f64, p.X.x + p.u.x, p.X.y + p.u.y])
        });
        assert!((order(&score, "u") - f64::from(found)).abs() < 0.1, "{}", order(&score, "u"));
        assert_eq!(score["passed"], found > 0);
    }
}

#[test]
fn a_stress_that_alone_is_written_wrongly_is_told_from_a_wrong_motion() {
    let (place, exact) = (tempfile::tempdir().unwrap(), exact());
    let header = "t,X,Y,ux,uy,vx,vy,P11,P12,P21,P22";
    let of_order = |found: i32| {
        score(place.path(), "", |cells| {
            table(header, &particles(&exact, cells, found), |p| {
                let P = 1.3 * exact.first_piola_kirchhoff(&p.X, p.t);
                let mut line = vec![p.t, p.X.x, p.X.y, p.u.x, p.u.y, p.v.x, p.v.y];
                line.extend(P.transpose().iter());
                line
            })
        })
    };
    let stress = of_order(2);
    assert_eq!(stress["passed"], false);
    assert!(verdict(&stress).starts_with("u converges with order 2.0"), "{}", verdict(&stress));
    assert!(verdict(&stress).contains("wrong is the stress that is written: P has order"));
    assert!(verdict(&of_order(0)).starts_with("does not converge: u has order"));
}

#[test]
fn a_displacement_gradient_is_read_where_there_is_no_deformation_gradient() {
    let (place, exact) = (tempfile::tempdir().unwrap(), exact());
    let header = "t,X,Y,ux,uy,H11,H12,H21,H22,P11,P12,P21,P22";
    let of_law = |factor: f64| {
        score(place.path(), "", |cells| {
            table(header, &particles(&exact, cells, 2), |p| {
                let mut line = vec![p.t, p.X.x, p.X.y, p.u.x, p.u.y];
                line.extend(exact.displacement_gradient(&p.X, p.t).transpose().iter());
                line.extend((factor * exact.first_piola_kirchhoff(&p.X, p.t)).transpose().iter());
                line
            })
        })
    };
    let right = of_law(1.0);
    assert!(finding(&right, "law-agrees").unwrap().starts_with("P agrees with the law"));
    assert!(finding(&right, "of-displacement-gradient").unwrap().contains("array `H`"));
    assert_eq!(of_law(1.7)["rows"][0]["law"][0]["verdict"], "unexplained");
}

/// Errors of shear fall faster than those of volume, which the stress has more of: F converges, and the stress of the law at that F does not.
#[test]
fn a_stress_that_has_the_error_of_the_recorded_deformation_is_not_said_to_be_written_wrongly() {
    let (place, exact) = (tempfile::tempdir().unwrap(), exact());
    let header = "t,X,Y,ux,uy,F11,F12,F21,F22,P11,P12,P21,P22";
    let (lambda, mu) = (0.3 * 1e4 / (1.3 * 0.4), 0.5 * 1e4 / 1.3);
    let scored = score(place.path(), "", |cells| {
        let h = (cells as f64).recip();
        let (shear, volume) = (0.03 * h.powf(0.9), 0.01 * h.powf(0.3));
        let error = Matrix2::new(volume, shear, shear, volume);
        table(header, &particles(&exact, cells, 2), |p| {
            let F = exact.deformation_gradient(&p.X, p.t) + error;
            let across = F.try_inverse().unwrap().transpose();
            let P = (F - across) * mu + across * (lambda * F.determinant().ln());
            let mut line = vec![p.t, p.X.x, p.X.y, p.u.x, p.u.y];
            line.extend(F.transpose().iter().chain(P.transpose().iter()));
            line
        })
    });
    assert!(finding(&scored, "law-agrees").unwrap().starts_with("P agrees with the law"));
    let verdict = verdict(&scored);
    assert!(verdict.contains("not all fields do: P has order 0."), "{verdict}");
    assert!(verdict.contains("at the recorded F, whose error it has"), "{verdict}");
}

#[test]
fn densities_and_masses_of_another_density_at_rest_are_told() {
    let (place, exact) = (tempfile::tempdir().unwrap(), exact());
    let of_density = |density: f64| {
        score(place.path(), "", |cells| {
            table("t,X,Y,ux,uy,J,density,mass", &particles(&exact, cells, 2), |p| {
                let J = exact.deformation_gradient(&p.X, p.t).determinant();
                let mass = density / (cells * cells) as f64;
                vec![p.t, p.X.x, p.X.y, p.u.x, p.u.y, J, density / J, mass]
            })
        })
    };
    let right = of_density(DENSITY);
    assert_eq!((finding(&right, "density-and-j"), finding(&right, "other-mass")), (None, None));
    let wrong = of_density(2.5);
    assert!(finding(&wrong, "density-and-j").unwrap().contains("2.500000e0 at all particles"));
    assert!(finding(&wrong, "other-mass").unwrap().contains("1.2500 times as much"));
}

/// A frame of quadrilaterals, with vectors of the nodes.
fn mesh(cells: usize, points: &[SVector<f64, 2>], u: &[SVector<f64, 2>]) -> String {
    let flat = |all: &[SVector<f64, 2>]| -> String {
        all.iter().map(|one| format!("{:?} {:?} 0 ", one.x, one.y)).collect()
    };
    let corner = |cell: usize| cell / cells * (cells + 1) + cell % cells;
    let nodes: String = (0..cells * cells)
        .map(corner)
        .map(|n| format!("{n} {} {} {} ", n + 1, n + cells + 2, n + cells + 1))
        .collect();
    let offsets: String = (1..=cells * cells).map(|n| format!("{} ", 4 * n)).collect();
    let array = |name: &str, kind: &str, count: usize, text: &str| {
        format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{count}\" format=\"ascii\">{text}</DataArray>"
        )
    };
    format!(
        "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid><Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\"><Points>{}</Points>\
         <Cells>{}{}{}</Cells><PointData>{}</PointData></Piece></UnstructuredGrid></VTKFile>",
        points.len(),
        cells * cells,
        array("Points", "Float64", 3, &flat(points)),
        array("connectivity", "Int64", 1, &nodes),
        array("offsets", "Int64", 1, &offsets),
        array("types", "UInt8", 1, &"9 ".repeat(cells * cells)),
        array("displacement", "Float64", 3, &flat(u)),
    )
}

/// The score of meshes at one time; `nodes` gives points and displacements of a node from X and the exact u.
fn score_mesh(
    place: &Path,
    exact: &Exact,
    nodes: impl Fn(usize, Vector2<f64>, Vector2<f64>) -> (Vector2<f64>, Vector2<f64>),
) -> Value {
    let t = 0.35 * exact.period();
    for cells in CELLS {
        let at = |k: usize| k as f64 / cells as f64;
        let all = (0..(cells + 1).pow(2)).map(|n| {
            let X = Vector2::new(at(n % (cells + 1)), at(n / (cells + 1)));
            nodes(cells, X, exact.displacement(&X, t))
        });
        let (points, u): (Vec<_>, Vec<_>) = all.unzip();
        fs::write(place.join(format!("m{cells}.vtu")), mesh(cells, &points, &u)).unwrap();
    }
    let [coarse, fine] = CELLS;
    let call = format!(
        "score skew-2d m{coarse}.vtu m{fine}.vtu --cells {coarse},{fine} --set rho0=2 --time {t:?} --json score.json"
    );
    mms(place, &call);
    read_json(&place.join("score.json"))
}

#[test]
fn a_deformed_mesh_with_errors_nearly_as_large_as_its_motion_is_read_by_the_body() {
    let (place, exact) = (tempfile::tempdir().unwrap(), exact());
    for found in 0..=2 {
        let score = score_mesh(place.path(), &exact, |cells, X, u| {
            let u = u + Vector2::new(1.0, -0.5)
                * (cells as f64).recip().powi(found)
                * 0.02
                * 36.0_f64.powi(found / 2);
            (X + u, u)
        });
        assert!(
            (order(&score, "u") - f64::from(found)).abs() < 0.1,
            "{found}: {}",
            verdict(&score)
        );
        assert_eq!(score["passed"], found > 0);
    }
}

#[test]
fn errors_that_fall_at_the_nodes_alone_do_not_pass() {
    let (place, exact) = (tempfile::tempdir().unwrap(), exact());
    let score = score_mesh(place.path(), &exact, |cells, X, u| {
        // A checkerboard whose slopes stay as they are.
        let sign = if ((X.x + X.y) * cells as f64).round() as i64 % 2 == 0 { 1.0 } else { -1.0 };
        (X, u + Vector2::repeat(0.05 * sign / cells as f64))
    });
    assert_eq!(score["passed"], false);
    assert!(verdict(&score).contains("not between them"), "{}", verdict(&score));
    let right = score_mesh(place.path(), &exact, |cells, X, u| {
        (X, u + Vector2::repeat(0.05 * X.x / (cells * cells) as f64))
    });
    assert_eq!(right["passed"], true, "{}", verdict(&right));
}

/// The reason why there is no order is the true one.
#[test]
fn the_reason_for_no_order_is_the_one() {
    let place = tempfile::tempdir().unwrap();
    for cells in CELLS {
        let mut text = "t,X,Y,ux,uy\n".to_owned();
        for number in 0..cells * cells {
            let at = |k: usize| (k as f64 + 0.5) / cells as f64;
            let [X, Y] = [number % cells, number / cells].map(at);
            writeln!(text, "0.0,{X:?},{Y:?},0.0,0.0").unwrap();
        }
        fs::write(place.path().join(format!("n{cells}.csv")), text).unwrap();
    }
    let [coarse, fine] = CELLS;
    let call =
        format!("score axis-aligned n{coarse}.csv n{fine}.csv --cells {coarse},{fine} --set A=0");
    let said = mms(place.path(), &call).stdout;
    assert!(said.contains("its errors are zero, and all frames are at t = 0"), "{said}");
    assert!(!said.contains("their h is the same"), "{said}");
}

/// Advice holds: an order of axes that the file has, and nothing of numbers that count particles.
#[test]
fn advice_fits_the_columns_that_there_are() {
    let (place, exact) = (tempfile::tempdir().unwrap(), exact());
    let write = |cells: usize| {
        table("id,t,X,Y,ux,uy", &particles(&exact, cells, 2), |p| {
            vec![p.number as f64, p.t, p.X.x, p.X.y, p.u.x, p.u.y]
        })
    };
    let told = score(place.path(), "--axes y,x", write);
    let message = finding(&told, "other-place").unwrap();
    assert!(message.contains("with --axes x,y"), "{message}");
    let told = score(place.path(), "--axes x,y", write);
    assert!(order(&told, "u") > 1.7, "{told}");
    assert_eq!(finding(&told, "few-digits"), None);
}

#[test]
fn a_run_beside_recordings_advises_no_option_that_score_has_not() {
    let place = tempfile::tempdir().unwrap();
    let called = mms(place.path(), "run bar-j2 --cells 4 --periods 0.05 --vtk own --frames 2");
    assert_eq!(called.status, 0, "{}", called.stderr);
    let call = "score bar-j2 own --cells 4 --periods 0.05 --against mms:gimp,cd";
    refuses(place.path(), call, &["--against runs the updated", "mms converge"]);
    assert!(!mms(place.path(), call).stderr.contains("--formulation"));
}
