//! Simulations of hand-coded solutions: known errors, orders, reproducibility, and runs that go wrong.

use crate::hand_coded;

use hand_coded::{AxisAligned, Coded, CrossedShear, Ring};
use mmsmith_solutions::AnySolution;
use mmsmith_verify::{
    Arithmetic, Case, Extent, FrameOutput, Integrator, Outputs, Row, Scheme, Shape, Snapshot,
    Start, Status, Sweep, Updated, converge, run,
};

fn axis_aligned() -> AnySolution<f64> {
    AnySolution::Two(Box::new(Coded(AxisAligned::default())))
}

fn ring() -> AnySolution<f64> {
    AnySolution::Two(Box::new(Coded(Ring::default())))
}

fn run_quietly(solution: &AnySolution<f64>, case: &Case) -> Row {
    let mut outputs = Outputs {
        progress: &mut |_| (),
        frames: None,
        snapshot: None,
        checkpoints: None,
        history: None,
        ranks: None,
        traffic: None,
        profile: None,
        until: None,
    };
    run(solution, Arithmetic::Double, case, &mut outputs).expect("a case that can be run")
}

fn from(start: Start) -> Scheme {
    Scheme::Updated(Updated { start, ..Updated::default() })
}

/// A row without what differs from run to run.
fn timeless(row: Row) -> Row {
    Row { wall_s: 0.0, cpu_s: 0.0, particle_steps_per_s: 0.0, ..row }
}

#[test]
fn gimp_with_centred_differences_has_the_known_errors_and_second_order() {
    let sweep = Sweep::Cells(vec![8, 16, 32]);
    let study =
        converge(&axis_aligned(), Arithmetic::Double, &Case::default(), &sweep, &mut |_| ())
            .unwrap();
    for (row, expected) in study.rows[1..].iter().zip([4.08e-3, 1.01e-3]) {
        assert_eq!((&row.status, row.cfl, row.dt * row.steps as f64), (&Status::Ok, 0.4, 0.02));
        let error = row.errors.u.linf;
        assert!((error / expected - 1.0).abs() < 0.05, "{} cells: {error:e}", row.cells);
    }
    let order = &study.orders.u.linf;
    assert!((order.local[1].unwrap() - 2.0).abs() < 0.05, "{order:?}");
    for (name, field) in study.orders.iter() {
        assert!(field.l2.fit.unwrap() > 1.5, "{name}: {:?}", field.l2);
    }
}

#[test]
fn the_three_starts_of_centred_differences_agree_to_second_order() {
    let error = |start| {
        let case = Case { scheme: from(start), cells: 16, ..Case::default() };
        run_quietly(&axis_aligned(), &case).errors.u.linf
    };
    let [exact, data, halved] = [Start::Exact, Start::Data, Start::Halved].map(error);
    assert!((data / exact - 1.0).abs() < 0.2, "{data:e} {exact:e}");
    assert!((halved / exact - 1.0).abs() < 0.2, "{halved:e} {exact:e}");
}

#[test]
fn the_first_state_is_the_exact_one() {
    // One step, so short that all errors are those of the start.
    let case = Case { periods: 1e-9, scheme: from(Start::Exact), cells: 16, ..Case::default() };
    let row = run_quietly(&ring(), &case);
    assert_eq!(row.steps, 1);
    assert!(row.errors.u.linf < 1e-12 && row.errors.F.linf < 1e-9, "{row:?}");
    assert!(row.errors.v.linf < 1e-6 && row.errors.P.linf < 1e-5, "{row:?}");
}

#[test]
fn every_pair_of_shape_and_integrator_gives_a_row_on_both_problems() {
    for solution in [axis_aligned(), ring()] {
        for shape in [Shape::Linear, Shape::Ugimp, Shape::Gimp] {
            for integrator in [Integrator::Usf, Integrator::Usl, Integrator::Musl, Integrator::Cd] {
                let scheme = Updated { shape, integrator, ..Updated::default() };
                let case = Case { scheme: Scheme::Updated(scheme), cells: 8, ..Case::default() };
                let row = run_quietly(&solution, &case);
                assert!(row.errors.u.linf > 0.0 && row.errors.u.linf.is_finite(), "{row:?}");
            }
        }
    }
}

#[test]
fn rows_are_bitwise_the_same_for_any_number_of_threads() {
    for (solution, cells) in [(axis_aligned(), 24), (ring(), 24)] {
        let rows = [1, 2, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let case = Case { cells, ..Case::default() };
            timeless(pool.install(|| run_quietly(&solution, &case)))
        });
        assert_eq!(rows[0], rows[1]);
        assert_eq!(rows[0], rows[2]);
    }
}

#[test]
fn the_full_ring_has_four_quarters_and_the_same_error() {
    let case = |extent| Case { extent: Some(extent), cells: 16, ..Case::default() };
    let quarter = run_quietly(&ring(), &case(Extent::Quarter));
    let full = run_quietly(&ring(), &case(Extent::Full));
    assert_eq!(full.particles, 4 * quarter.particles);
    assert_eq!(quarter.status, Status::Ok);
    let ratio = full.errors.u.linf / quarter.errors.u.linf;
    assert!((ratio - 1.0).abs() < 1e-6, "{ratio}");
}

#[test]
fn single_precision_has_the_same_particles_and_nearly_the_same_error() {
    for (double, single) in [
        (axis_aligned(), AnySolution::<f32>::Two(Box::new(Coded(AxisAligned::default())))),
        (ring(), AnySolution::<f32>::Two(Box::new(Coded(Ring::default())))),
    ] {
        let case = Case { cells: 16, ..Case::default() };
        let mut outputs = Outputs {
            progress: &mut |_| (),
            frames: None,
            snapshot: None,
            checkpoints: None,
            history: None,
            ranks: None,
            traffic: None,
            profile: None,
            until: None,
        };
        let coarse = run(&double, Arithmetic::Single(&single), &case, &mut outputs).unwrap();
        let fine = run_quietly(&double, &case);
        assert_eq!(coarse.particles, fine.particles);
        let ratio = coarse.errors.u.linf / fine.errors.u.linf;
        assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
    }
}

#[test]
fn an_unstable_run_ends_as_a_row_that_says_so() {
    let row = run_quietly(&axis_aligned(), &Case { cfl: 2.0, ..Case::default() });
    assert_ne!(row.status, Status::Ok);
    let status = row.status.to_string();
    assert!(status.contains("step") && status.contains("particle"), "{status}");
    assert!(row.errors.u.linf.is_finite());
}

#[test]
fn conditions_that_the_solver_does_not_model_are_named() {
    let shear = AnySolution::Two(Box::new(Coded(CrossedShear::default())));
    let mut outputs = Outputs {
        progress: &mut |_| (),
        frames: None,
        snapshot: None,
        checkpoints: None,
        history: None,
        ranks: None,
        traffic: None,
        profile: None,
        until: None,
    };
    let error =
        run(&shear, Arithmetic::Double, &Case::default(), &mut outputs).unwrap_err().to_string();
    assert!(error.contains("prescribed-motion on X-lower"), "{error}");
}

#[test]
fn an_extent_is_for_rings_only() {
    let case = Case { extent: Some(Extent::Full), ..Case::default() };
    let mut outputs = Outputs {
        progress: &mut |_| (),
        frames: None,
        snapshot: None,
        checkpoints: None,
        history: None,
        ranks: None,
        traffic: None,
        profile: None,
        until: None,
    };
    let error = run(&axis_aligned(), Arithmetic::Double, &case, &mut outputs).unwrap_err();
    assert!(error.to_string().contains("a ring or a shell"), "{error}");
}

#[test]
fn frames_hold_what_the_row_measured() {
    let folder = tempfile::tempdir().unwrap();
    let output = FrameOutput {
        folder: folder.path().to_owned(),
        name: "box".into(),
        count: 5,
        provenance: None,
    };
    let mut snapshot = Snapshot { share: 0.75, frame: None };
    let case = Case { cells: 8, ..Case::default() };
    let mut outputs = Outputs {
        progress: &mut |_| (),
        frames: Some(&output),
        snapshot: Some(&mut snapshot),
        checkpoints: None,
        history: None,
        ranks: None,
        traffic: None,
        profile: None,
        until: None,
    };
    let row = run(&axis_aligned(), Arithmetic::Double, &case, &mut outputs).unwrap();
    let frame =
        |n: usize| mmsmith_vtk::read(&folder.path().join(format!("box-{n:06}.vtu"))).unwrap();
    let last = frame(4);
    assert_eq!((last.step, last.time, last.points.len()), (row.steps, 0.02, row.particles));
    assert_eq!((frame(0).step, frame(0).time), (0, 0.0));
    let kept = snapshot.frame.expect("the run came to its end");
    assert_eq!((kept.step, &kept.points), (frame(3).step, &frame(3).points));
    let values = |name: &str| &last.arrays.iter().find(|a| a.name == name).unwrap().values;
    let mmsmith_vtk::Values::Scalar(errors) = values("error_magnitude") else { panic!() };
    let largest = errors.iter().copied().fold(0.0, f64::max);
    assert!(largest > 0.0 && largest <= row.errors.u.linf);
    let mmsmith_vtk::Values::Tensor(stress) = values("stress") else { panic!() };
    assert!(stress.iter().any(|s| s[8] != 0.0), "plane strain has a stress normal to the plane");
    let mmsmith_vtk::Values::Scalar(volume) = values("volume") else { panic!() };
    assert!((volume.iter().sum::<f64>() - 1.0).abs() < 0.01);
    assert!(folder.path().join("box.pvd").exists());
}
