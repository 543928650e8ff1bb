//! Units: where lengths, stiffness and density are multiplied by powers of two (of four, so that velocities and times go by powers of two
//! as well), every result is multiplied by the power of its own unit, to the bit.
//!
//! Whatever in a solver has a size of its own shows here: a tolerance, a smallest number, a step of a difference.

#![allow(clippy::unwrap_used)]

mod problems;

use mmsmith_solutions::AnySolution;
use mmsmith_verify::{
    Arithmetic, Case, CaseError, CflSpeed, Composition, Coordinates, Extent, GridPose, Integrator,
    Layout, MassMatrix, Moment, Outputs, Placement, ReturnMap, Row, Scheme, Shape, Snapshot, Start,
    StaticCase, StaticProblem, Status, Sums, Total, Transfer, Updated, Volume, evaluate, run,
};
use mmsmith_vtk::Values;
use problems::{
    ACCELERATION, Body, LAWS, LENGTH, MEMORY, PURE, Problem, STRESS, Scaling, TIME, Unit, VELOCITY,
};

/// As it is.
const SAME: Scaling = Scaling { length: 0, stiffness: 0, density: 0 };

/// Other units: small and large, one by one and together.
const SCALINGS: [Scaling; 4] = [
    Scaling { length: -13, stiffness: 0, density: 0 },
    Scaling { length: 4, stiffness: 9, density: -6 },
    Scaling { length: -30, stiffness: -16, density: 11 },
    Scaling { length: 21, stiffness: 30, density: 25 },
];

/// Units whose forces keep all digits of single precision.
const IN_SINGLE: [Scaling; 2] = [
    Scaling { length: -5, stiffness: 1, density: -2 },
    Scaling { length: 6, stiffness: -2, density: 3 },
];

const TRANSFERS: [Transfer; 4] = [Transfer::Flip, Transfer::Pic, Transfer::Apic, Transfer::Xpic(3)];

/// Results of a run.
struct Found {
    row: Row,
    moments: Vec<Moment>,
    snapshot: Snapshot,
}

fn found(
    exact: &AnySolution<f64>,
    arithmetic: Arithmetic<'_>,
    case: &Case,
) -> Result<Found, CaseError> {
    let (mut moments, mut snapshot) = (Vec::new(), Snapshot { share: 1.0, frame: None });
    let mut progress = |_| ();
    let mut outputs = Outputs::new(&mut progress);
    outputs.history = Some(&mut moments);
    outputs.snapshot = Some(&mut snapshot);
    let row = run(exact, arithmetic, case, &mut outputs)?;
    Ok(Found { row, moments, snapshot })
}

/// The first result that does not scale; none where all do. `axes` are the lengths in a volume.
fn differing(scaling: Scaling, axes: i32, a: &Found, b: &Found) -> Option<String> {
    let check = |what: &str, unit: Unit, a: f64, b: f64| {
        let scaled = a * 2.0_f64.powi(scaling.exponent(unit));
        (!scaling.holds(unit, a, b)).then(|| format!("{what}: {scaled:e} expected, {b:e} found"))
    };
    let (one, other) = (&a.row, &b.row);
    if (one.steps, one.particles, one.cells) != (other.steps, other.particles, other.cells) {
        return Some(format!("{one:?} and {other:?}"));
    }
    if std::mem::discriminant(&one.status) != std::mem::discriminant(&other.status) {
        return Some(format!("{} and {}", one.status, other.status));
    }
    let numbers = [
        check("h", LENGTH, one.h, other.h),
        check("dt", TIME, one.dt, other.dt),
        check("cfl", PURE, one.cfl, other.cfl),
    ];
    let of_errors = one.errors.iter().zip(other.errors.iter()).flat_map(|((field, a), (_, b))| {
        let unit = [("u", LENGTH), ("v", VELOCITY), ("F", PURE), ("P", STRESS)];
        let name = field.to_string();
        let unit = unit.into_iter().find(|(own, _)| *own == name).unwrap().1;
        a.iter()
            .zip(b.iter())
            .map(move |((norm, a), (_, b))| check(&format!("{norm:?} of {name}"), unit, *a, *b))
    });
    let of_sums = |at: u64, a: &Sums, b: &Sums| {
        let momenta = a.momentum.iter().zip(&b.momentum);
        let momenta = momenta.map(|(a, b)| check("momentum", [axes, 1, 1], *a, *b));
        let energies = [
            check("kinetic energy", [axes, 2, 0], a.kinetic_energy, b.kinetic_energy),
            check("strain energy", [axes, 2, 0], a.strain_energy, b.strain_energy),
        ];
        let all: Vec<_> = energies.into_iter().chain(momenta).flatten().collect();
        all.into_iter().map(move |told| format!("step {at}: {told}")).map(Some).next().flatten()
    };
    let of_moments = a.moments.iter().zip(&b.moments).flat_map(|(a, b)| {
        let u = a.u.iter().zip(b.u.iter());
        let u: Vec<_> = u.map(|((_, a), (_, b))| check("u", LENGTH, *a, *b)).collect();
        let sums = [of_sums(a.step, &a.computed, &b.computed), of_sums(a.step, &a.exact, &b.exact)];
        u.into_iter().chain(sums)
    });
    let before = numbers.into_iter().chain(of_moments).chain(of_errors).flatten().next();
    before.or_else(|| differing_particles(scaling, axes, a, b))
}

fn differing_particles(scaling: Scaling, axes: i32, a: &Found, b: &Found) -> Option<String> {
    let (one, other) = match (&a.snapshot.frame, &b.snapshot.frame) {
        (Some(one), Some(other)) => (one, other),
        (None, None) => return None,
        _ => return Some("particles inside out in one of two".into()),
    };
    let all = |unit: Unit, a: &[f64], b: &[f64]| {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| scaling.holds(unit, *a, *b))
    };
    if !all(LENGTH, one.points.as_flattened(), other.points.as_flattened()) {
        return Some("positions".into());
    }
    // Internal variables are pure numbers or stresses.
    let units = |name: &str| match name {
        "displacement" | "exact_displacement" | "error" | "error_magnitude" => vec![LENGTH],
        "reference_position" => vec![LENGTH],
        "velocity" => vec![VELOCITY],
        "deformation_gradient" => vec![PURE],
        "stress" | "first_piola_kirchhoff" | "von_mises" => vec![STRESS],
        "volume" => vec![[axes, 0, 0]],
        _ => vec![PURE, STRESS],
    };
    let scales = |name: &str, a: &Values, b: &Values| match (a, b) {
        (Values::Scalar(a), Values::Scalar(b)) => units(name).into_iter().any(|u| all(u, a, b)),
        (Values::Vector(a), Values::Vector(b)) => {
            units(name).into_iter().any(|u| all(u, a.as_flattened(), b.as_flattened()))
        }
        (Values::Tensor(a), Values::Tensor(b)) => {
            units(name).into_iter().any(|u| all(u, a.as_flattened(), b.as_flattened()))
        }
        _ => a == b,
    };
    let arrays = one.arrays.iter().zip(&other.arrays);
    let mut wrong = arrays.filter(|(a, b)| !scales(&a.name, &a.values, &b.values));
    wrong.next().map(|(a, _)| a.name.clone())
}

/// Runs that scaled, and what did not.
#[derive(Default)]
struct Tally {
    runs: usize,
    refused: usize,
    unfinished: usize,
    wrong: Vec<String>,
}

impl Tally {
    /// A case in some units; `turn` chooses them where not all are taken.
    fn compare(&mut self, problem: &Problem, body: Body, case: &Case, turn: Option<usize>) {
        let axes = body.axes() as i32;
        let plain = problem.in_double(SAME);
        let Ok(a) = found(&plain, Arithmetic::Double, case) else {
            self.refused += 1;
            return;
        };
        self.unfinished += usize::from(a.row.status != Status::Ok);
        let all =
            |count: usize| (0..count).filter(move |k| turn.is_none_or(|turn| turn % count == *k));
        for scaling in all(SCALINGS.len()).map(|k| SCALINGS[k]) {
            self.runs += 1;
            let b = found(&problem.in_double(scaling), Arithmetic::Double, case);
            self.note(problem, case, scaling, b.map(|b| differing(scaling, axes, &a, &b)));
        }
        let single = problem.in_single(SAME);
        // The total formulation is one of doubles, as histories are.
        let Ok(a) = found(&plain, Arithmetic::Single(&single), case) else { return };
        for scaling in all(IN_SINGLE.len()).map(|k| IN_SINGLE[k]) {
            self.runs += 1;
            let (exact, model) = (problem.in_double(scaling), problem.in_single(scaling));
            let b = found(&exact, Arithmetic::Single(&model), case);
            self.note(problem, case, scaling, b.map(|b| differing(scaling, axes, &a, &b)));
        }
    }

    fn note(
        &mut self,
        problem: &Problem,
        case: &Case,
        scaling: Scaling,
        told: Result<Option<String>, CaseError>,
    ) {
        let told = told.unwrap_or_else(|error| Some(format!("refused: {error}")));
        if let Some(told) = told {
            self.wrong
                .push(format!("{}: {:?} of {scaling:?}\n    {told}", problem.told, case.scheme));
        }
    }

    fn judge(self, least: usize) {
        let some = &self.wrong[..self.wrong.len().min(12)];
        assert!(some.is_empty(), "{} of {}:\n{}", self.wrong.len(), self.runs, some.join("\n"));
        let Self { runs, refused, unfinished, .. } = self;
        assert!(runs >= least, "{runs} runs, {refused} refused, {unfinished} unfinished");
    }
}

fn updated(shape: Shape, transfer: Transfer, integrator: Integrator) -> Updated {
    Updated { shape, transfer, integrator, ..Updated::default() }
}

/// A case of few cells and steps.
fn short(scheme: Scheme, body: Body) -> Case {
    let (cells, periods) = match body {
        Body::Line => (7, 0.3),
        Body::Square | Body::Loaded | Body::Moved => (5, 0.25),
        Body::Ring | Body::FreeRing => (8, 0.15),
        Body::Cube | Body::LoadedCube | Body::Shell => (3, 0.25),
        Body::Cylinder | Body::Sleeve => (6, 0.2),
    };
    Case { scheme, cells, periods, ..Case::default() }
}

/// Every shape, transfer and integrator, on bodies that lattices fit.
fn schemes(all: bool) -> Tally {
    let mut tally = Tally::default();
    for body in [Body::Line, Body::Square, Body::Cube, Body::FreeRing, Body::Sleeve] {
        let problem = Problem::neo_hookean(body);
        let mut turn = 0;
        for (i, shape) in Shape::ALL.into_iter().enumerate() {
            for (j, transfer) in TRANSFERS.into_iter().enumerate() {
                for (k, integrator) in Integrator::ALL.into_iter().enumerate() {
                    // All pairs of a shape and a transfer; integrators take turns.
                    if !all && k != (i + 2 * j) % Integrator::ALL.len() {
                        continue;
                    }
                    turn += 1;
                    let scheme = Scheme::Updated(updated(shape, transfer, integrator));
                    let case = short(scheme, body);
                    tally.compare(&problem, body, &case, (!all).then_some(turn));
                }
            }
        }
    }
    tally
}

/// Layouts other than the usual lattice, and what else places particles and chooses steps.
fn layouts(all: bool) -> Tally {
    let mut tally = Tally::default();
    let pose = |angle, shift| GridPose { angle, shift };
    let clipped = |offset, pose| Placement::Clipped { offset, pose };
    let on_corners = [Shape::Cpdi2, Shape::Bspline2, Shape::Bspline3];
    let mut cases: Vec<(Body, Updated, Case)> = Vec::new();
    let mut add = |body: Body, own: Updated, change: &dyn Fn(Case) -> Case| {
        cases.push((body, own, change(short(Scheme::Updated(own), body))));
    };
    let usual = Updated::default();
    let extents = |extent| move |case: Case| Case { extent, ..case };
    for shape in on_corners {
        for (body, placement) in [
            (Body::Loaded, clipped(0.0, pose(0.0, 0.0))),
            (Body::Loaded, clipped(0.3, pose(31.0, 0.4))),
            (Body::Square, clipped(0.25, pose(0.0, 0.0))),
            (Body::Ring, clipped(0.1, pose(0.0, 0.0))),
            (Body::LoadedCube, clipped(0.0, pose(20.0, 0.3))),
            (Body::Shell, clipped(0.0, pose(0.0, 0.0))),
            // With slivers, in the half plane.
            (Body::Cylinder, clipped(0.0, pose(0.0, 0.01))),
        ] {
            for transfer in [Transfer::Flip, Transfer::Apic] {
                add(body, Updated { shape, placement, transfer, ..usual }, &|case| case);
            }
        }
        let placement = clipped(0.0, pose(12.0, 0.2));
        add(Body::Ring, Updated { shape, placement, ..usual }, &extents(Some(Extent::Full)));
    }
    for shape in [Shape::Cpdi2, Shape::Cpdi, Shape::Linear, Shape::Bspline2, Shape::Bspline3] {
        let placement = Placement::BodyFitted;
        for extent in [Extent::Quarter, Extent::Full] {
            let own = Updated { shape, placement, ..usual };
            add(Body::FreeRing, own, &extents(Some(extent)));
        }
    }
    for shape in Shape::ALL {
        let placement = Placement::Lattice { offset: 0.5 };
        add(Body::Square, Updated { shape, placement, ..usual }, &|case| case);
    }
    for start in [Start::Exact, Start::Data] {
        for cfl_speed in [CflSpeed::PWave, CflSpeed::Viscous] {
            let change = |case: Case| Case { cfl_speed, cfl: 0.37, per_cell: 3, ..case };
            add(Body::Square, Updated { start, ..usual }, &change);
        }
    }
    add(Body::Square, usual, &|case| Case { volume: Volume::Projected, ..case });
    for (turn, (body, _, case)) in cases.into_iter().enumerate() {
        tally.compare(&Problem::neo_hookean(body), body, &case, (!all).then_some(turn));
    }
    tally
}

/// The total formulation.
fn total(all: bool) -> Tally {
    let mut tally = Tally::default();
    let mut turn = 0_usize;
    for (body, coordinates) in [
        (Body::Line, Coordinates::Cartesian),
        (Body::Square, Coordinates::Cartesian),
        (Body::Moved, Coordinates::Cartesian),
        (Body::Loaded, Coordinates::Cartesian),
        (Body::Cube, Coordinates::Cartesian),
        (Body::Ring, Coordinates::Polar),
        (Body::Shell, Coordinates::Spherical),
        (Body::Cylinder, Coordinates::Cylindrical),
    ] {
        let problem = Problem::neo_hookean(body);
        for degree in 2..=5 {
            for (mass, composition) in [
                (MassMatrix::Consistent, Composition::Order4),
                (MassMatrix::Consistent, Composition::Order6),
                (MassMatrix::Lumped, Composition::Order2),
            ] {
                for layout in [Layout::Gauss, Layout::Lattice] {
                    turn += 1;
                    if !all && !turn.is_multiple_of(5) {
                        continue;
                    }
                    let scheme =
                        Scheme::Total(Total { degree, mass, composition, layout, coordinates });
                    let case = Case { per_cell: degree + 1, cfl: 0.1, ..short(scheme, body) };
                    let case = Case { periods: 0.2 * case.periods, cells: case.cells + 3, ..case };
                    tally.compare(&problem, body, &case, (!all).then_some(turn));
                }
            }
        }
    }
    tally
}

/// Every law, in both formulations; laws that remember on a ring, whose histories depend on the radius alone, or in all the plane.
fn laws(all: bool) -> Tally {
    let mut tally = Tally::default();
    let of = |coordinates| {
        Scheme::Total(Total { layout: Layout::Gauss, coordinates, ..Total::of_degree(3) })
    };
    let short = |scheme, body| Case { periods: 0.1, cfl: 0.2, ..short(scheme, body) };
    let lattice = Scheme::Updated(Updated::default());
    for (turn, (_, law)) in LAWS.iter().enumerate() {
        let problem = Problem::new(Body::Square, law);
        for scheme in [lattice, of(Coordinates::Cartesian)] {
            let case = short(scheme, Body::Square);
            tally.compare(&problem, Body::Square, &case, (!all).then_some(turn));
        }
    }
    let maps = [ReturnMap::Exponential, ReturnMap::Midpoint].map(Some);
    for (turn, (name, parameters, law)) in MEMORY.iter().enumerate() {
        // Their histories take seconds.
        if !all && matches!(*name, "j2" | "simo") {
            continue;
        }
        for (body, scheme) in [
            (Body::Line, lattice),
            (Body::Line, Scheme::Updated(updated(Shape::Cpdi, Transfer::Apic, Integrator::Usf))),
            (Body::Ring, of(Coordinates::Polar)),
            (Body::Square, lattice),
        ] {
            // Stated components are those of Cartesian axes in the plane.
            let is_stated = law.contains("'stress'");
            if (is_stated && body != Body::Square) || (!is_stated && !all && body != Body::Line) {
                continue;
            }
            let problem = Problem::with(body, parameters, law);
            for map in maps.into_iter().filter(|_| law.contains("flow")).chain([None]) {
                let case = Case { return_map: map, ..short(scheme, body) };
                tally.compare(&problem, body, &case, (!all).then_some(turn));
            }
        }
    }
    tally
}

#[test]
fn pairs_of_every_shape_and_transfer_scale_to_the_bit() {
    schemes(false).judge(250);
}

#[test]
fn layouts_and_starts_scale_to_the_bit() {
    layouts(false).judge(100);
}

#[test]
fn the_total_formulation_scales_to_the_bit() {
    total(false).judge(30);
}

#[test]
fn laws_scale_to_the_bit() {
    laws(false).judge(35);
}

#[test]
#[ignore = "takes minutes"]
fn every_scheme_layout_and_law_scales_to_the_bit_in_all_units() {
    schemes(true).judge(4000);
    layouts(true).judge(300);
    total(true).judge(700);
    laws(true).judge(150);
}

/// Fields at points, and equilibria with the residuals of Newton's method.
#[test]
fn fields_and_equilibria_scale_to_the_bit() {
    let mut wrong = Vec::new();
    for body in [Body::Square, Body::Moved, Body::Ring, Body::Shell, Body::Cylinder] {
        let problem = Problem::neo_hookean(body);
        let plain = problem.in_double(SAME);
        for scaling in SCALINGS {
            let scaled = problem.in_double(scaling);
            let axes = body.axes();
            let [a, b] = [(&plain, SAME), (&scaled, scaling)].map(|(exact, units)| {
                let [length, time] = [LENGTH, TIME].map(|unit| 2.0_f64.powi(units.exponent(unit)));
                let X: Vec<f64> = [0.61, 0.23, 0.31][..axes].iter().map(|x| x * length).collect();
                evaluate(exact, &X, 0.003 * time).unwrap()
            });
            for (name, unit, a, b) in [
                ("u", LENGTH, a.u, b.u),
                ("v", VELOCITY, a.v, b.v),
                ("a", ACCELERATION, a.a, b.a),
                ("H", PURE, a.H.concat(), b.H.concat()),
                ("P", STRESS, a.P.concat(), b.P.concat()),
                ("b", ACCELERATION, a.b, b.b),
            ] {
                if !a.iter().zip(&b).all(|(a, b)| scaling.holds(unit, *a, *b)) {
                    wrong.push(format!("{}: {name} of {scaling:?}: {a:?} {b:?}", problem.told));
                }
            }
            for degree in [1, 3] {
                wrong.extend(differing_equilibrium(&problem, [&plain, &scaled], scaling, degree));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

fn differing_equilibrium(
    problem: &Problem,
    exact: [&AnySolution<f64>; 2],
    scaling: Scaling,
    degree: usize,
) -> Option<String> {
    let [a, b] = exact.map(|exact| {
        let coordinates = Total::coordinates_for(exact);
        let total = Total { degree, layout: Layout::Gauss, coordinates, ..Total::of_degree(3) };
        let case = Case { cells: 4, per_cell: degree + 1, ..Case::default() };
        let case = StaticCase { case, total, load_steps: 2, moment: 0.25 };
        StaticProblem::new(exact, &case).unwrap().solve(&mut |_, _| ()).unwrap()
    });
    let told =
        |what: &str| Some(format!("{}, degree {degree}: {what} of {scaling:?}", problem.told));
    let [Some(one), Some(other)] = [a.errors, b.errors] else { return told("stopped") };
    for ((name, a), (_, b)) in one.iter().zip(other.iter()) {
        let unit =
            [("u", LENGTH), ("F", PURE), ("P", STRESS)].into_iter().find(|(own, _)| *own == name);
        let unit = unit.unwrap().1;
        if !a.iter().zip(b.iter()).all(|((_, a), (_, b))| scaling.holds(unit, *a, *b)) {
            return told(&format!("{name} {a:?} {b:?}"));
        }
    }
    if (a.load_steps.len(), a.cut_backs) != (b.load_steps.len(), b.cut_backs) {
        return told("load steps");
    }
    // A force, or one per length or area.
    let is_same = |axes: i32| {
        a.load_steps.iter().zip(&b.load_steps).all(|(a, b)| {
            let unit = [axes, 2, 0];
            a.residuals.len() == b.residuals.len()
                && a.residuals.iter().zip(&b.residuals).all(|(a, b)| scaling.holds(unit, *a, *b))
                && scaling.holds(unit, a.rounding, b.rounding)
        })
    };
    if (0..=3).any(is_same) { None } else { told("residuals") }
}
