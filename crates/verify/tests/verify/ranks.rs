//! Several processes measure what one does, to the bit.

use crate::hand_coded;

use hand_coded::{AxisAligned, Coded, FreeSheet, Plane, Ring};
use mmsmith_ranks::in_process;
use mmsmith_solutions::AnySolution;
use mmsmith_verify::{
    Arithmetic, Case, Extent, GridPose, Integrator, Outputs, Placement, Row, Scheme, Shape,
    Snapshot, Status, Total, Transfer, Updated, run,
};

/// A row without what differs from run to run.
pub(crate) fn timeless(row: Row) -> Row {
    Row { wall_s: 0.0, cpu_s: 0.0, particle_steps_per_s: 0.0, ..row }
}

fn agrees<S: Plane + Clone>(solution: &S, case: &Case, counts: &[usize]) -> Row {
    let exact = AnySolution::Two(Box::new(Coded(solution.clone())));
    let what = |count: usize| format!("{count} processes, {case:?}");
    let (mut history, mut expected) = (Vec::new(), Snapshot { share: 0.5, frame: None });
    let progress = &mut |_| ();
    let mut outputs = Outputs {
        history: Some(&mut history),
        snapshot: Some(&mut expected),
        ..Outputs::new(progress)
    };
    let alone =
        run(&exact, Arithmetic::Double, case, &mut outputs).expect("a case that can be run");
    for &count in counts {
        let found = in_process(count, |ranks| {
            let (mut history, mut snapshot) = (Vec::new(), Snapshot { share: 0.5, frame: None });
            let progress = &mut |_| ();
            let mut outputs = Outputs {
                history: Some(&mut history),
                snapshot: Some(&mut snapshot),
                ranks: Some(ranks),
                ..Outputs::new(progress)
            };
            let row = run(&exact, Arithmetic::Double, case, &mut outputs);
            (timeless(row.expect("a case that can be run")), history, snapshot.frame)
        });
        // The first one has the particles of all.
        assert_eq!(found[0].2, expected.frame, "{}", what(count));
        assert!(found[1..].iter().all(|(.., frame)| frame.is_none()), "{}", what(count));
        for (row, own, _) in found {
            assert_eq!(row, timeless(alone.clone()), "{}", what(count));
            // As text: what is not a number equals itself.
            assert_eq!(format!("{own:?}"), format!("{history:?}"), "{}", what(count));
        }
    }
    alone
}

fn updated(shape: Shape, integrator: Integrator, transfer: Transfer) -> Scheme {
    let placement = Updated::default().placement;
    Scheme::Updated(Updated { shape, integrator, transfer, placement, ..Updated::default() })
}

const CD: Integrator = Integrator::Cd;

#[test]
fn errors_and_histories_have_the_bits_of_one_process() {
    let transfers = [Transfer::Flip, Transfer::Apic, Transfer::Xpic(2)];
    let shapes = [Shape::Gimp, Shape::Bspline2, Shape::Cpdi, Shape::Cpdi2, Shape::Linear];
    let integrators = [CD, Integrator::Usl, Integrator::Usf, Integrator::Musl];
    for (n, shape) in shapes.into_iter().enumerate() {
        for (m, transfer) in transfers.into_iter().enumerate() {
            let scheme = updated(shape, integrators[(n + m) % 4], transfer);
            // 64 cells are 9 bins.
            let case = Case { scheme, cells: 64, periods: 0.03, ..Case::default() };
            agrees(&AxisAligned::default(), &case, &[2, 4]);
            let is_fitted = matches!(shape, Shape::Cpdi | Shape::Cpdi2);
            let fitted =
                Updated { placement: Placement::BodyFitted, ..*scheme.updated().expect("it is") };
            let scheme = if is_fitted { Scheme::Updated(fitted) } else { scheme };
            let row = agrees(&Ring::default(), &Case { scheme, ..case }, &[3]);
            assert!(row.errors.u.linf > 0.0, "{row:?}");
        }
    }
    let scheme = updated(Shape::Gimp, CD, Transfer::Flip);
    let case =
        Case { scheme, cells: 64, periods: 0.1, extent: Some(Extent::Full), ..Case::default() };
    agrees(&Ring::default(), &case, &[1, 7]);
    agrees(&AxisAligned::default(), &Case { extent: None, ..case }, &[5]);
}

/// The grid reaches beyond the sides that move outward, and with it the rows that processes share out.
#[test]
fn a_body_with_free_sides_has_the_bits_of_one_process() {
    for (n, shape) in Shape::ALL.into_iter().enumerate() {
        let integrator = [CD, Integrator::Usl, Integrator::Usf, Integrator::Musl][n % 4];
        let scheme = updated(shape, integrator, Transfer::Flip);
        let case = Case { scheme, cells: 48, periods: 0.3, cfl: 0.3, ..Case::default() };
        let row = agrees(&FreeSheet { A: 0.1 }, &case, &[2, 5]);
        assert!(row.status == Status::Ok && row.errors.u.linf < 2e-2, "{row:?}");
    }
}

#[test]
fn a_run_that_fails_is_told_alike_by_all() {
    let scheme = updated(Shape::Linear, Integrator::Usl, Transfer::Flip);
    let case = Case { scheme, cells: 64, cfl: 1.9, ..Case::default() };
    let row = agrees(&AxisAligned::default(), &case, &[2, 6]);
    assert!(matches!(row.status, Status::Stopped(_) | Status::Unstable { .. }), "{row:?}");
}

#[test]
fn clipped_particles_have_the_bits_of_one_process() {
    let transfers = [Transfer::Flip, Transfer::Apic, Transfer::Xpic(2)];
    for (n, integrator) in
        [CD, Integrator::Usl, Integrator::Usf, Integrator::Musl].into_iter().enumerate()
    {
        let moved = GridPose { angle: 17.0, shift: 0.3 };
        for (m, pose) in [GridPose::default(), moved].into_iter().enumerate() {
            let updated = Updated {
                shape: [Shape::Cpdi2, Shape::Bspline2, Shape::Bspline3][(n + m) % 3],
                integrator,
                transfer: transfers[(n + 2 * m) % 3],
                placement: Placement::Clipped { offset: 0.29, pose },
                ..Updated::default()
            };
            let scheme = Scheme::Updated(updated);
            let case = Case { scheme, cells: 64, periods: 0.02, ..Case::default() };
            agrees(&AxisAligned::default(), &case, &[2, 3]);
            let row = agrees(&Ring::default(), &case, &[4]);
            assert!(row.errors.u.linf > 0.0, "{row:?}");
        }
    }
}

#[test]
fn what_one_process_alone_can_do_is_refused_with_what_to_use() {
    let refusals = in_process(2, |ranks| {
        let progress = &mut |_| ();
        let mut outputs = Outputs { ranks: Some(ranks), ..Outputs::new(progress) };
        let exact = AnySolution::Two(Box::new(Coded(AxisAligned::default())));
        let case =
            Case { scheme: Scheme::Total(Total::of_degree(3)), cells: 64, ..Case::default() };
        run(&exact, Arithmetic::Double, &case, &mut outputs).map(timeless)
    });
    for refusal in refusals {
        let error = refusal.expect_err("one process alone can do that").to_string();
        assert!(error.contains("start one process"), "{error}");
    }
}
