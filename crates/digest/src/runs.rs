//! The runs.

use mmsmith_interpret::{interpret_staged, interpret_staged_single};
use mmsmith_spec::Spec;
use mmsmith_stage::Staged;
use mmsmith_verify::{
    Arithmetic, Case, Composition, Coordinates, GridPose, Integrator, Layout, MassMatrix, Outputs,
    Placement, Scheme, Shape, Snapshot, Status, Total, Transfer, Updated, Volume,
};

use crate::RunError;
use crate::bits::digest;

/// A run: a solution, and the case that is simulated.
#[derive(Clone, Debug)]
pub struct Run {
    /// Its name: a word.
    pub name: &'static str,
    /// The specification of its solution.
    pub specification: &'static str,
    /// The settings.
    pub case: Case,
    /// Whether the solver computes in single precision.
    pub is_single: bool,
}

const BAR: &str = include_str!("specs/bar.toml");
const BLOCK: &str = include_str!("specs/block.toml");
const CUBE: &str = include_str!("specs/cube.toml");
const RING: &str = include_str!("specs/ring.toml");
const SHELL: &str = include_str!("specs/shell.toml");
const CYLINDER: &str = include_str!("specs/cylinder.toml");
const OWN_BAR: &str = include_str!("specs/own-bar.toml");
const OWN_BLOCK: &str = include_str!("specs/own-block.toml");
const DAMPED: &str = include_str!("specs/damped.toml");

impl Run {
    /// The digest of its results on this machine.
    ///
    /// # Errors
    ///
    /// [`RunError`] where it cannot be done.
    pub fn digest(&self) -> Result<String, RunError> {
        let refused = |reason: String| RunError { run: self.name.to_owned(), reason };
        let spec =
            Spec::parse(self.specification, self.name).map_err(|e| refused(e.to_string()))?;
        let fields = spec.derive().map_err(|error| refused(error.to_string()))?;
        let staged = Staged::of(&spec, fields);
        let exact =
            interpret_staged(&spec, &staged, []).map_err(|error| refused(error.to_string()))?;
        let single = match self.is_single {
            true => Some(
                interpret_staged_single(&spec, &staged, [])
                    .map_err(|error| refused(error.to_string()))?,
            ),
            false => None,
        };
        let arithmetic = single.as_ref().map_or(Arithmetic::Double, Arithmetic::Single);
        let mut snapshot = Snapshot { share: 1.0, frame: None };
        let mut progress = |_| ();
        let mut outputs = Outputs::new(&mut progress);
        outputs.snapshot = Some(&mut snapshot);
        let row = mmsmith_verify::run(&exact, arithmetic, &self.case, &mut outputs)
            .map_err(|error| refused(error.to_string()))?;
        match row.status {
            Status::Ok => Ok(digest(&row, snapshot.frame.as_ref())),
            status => Err(refused(status.to_string())),
        }
    }
}

/// A scheme of the updated formulation on a lattice.
fn updated(shape: Shape, transfer: Transfer, integrator: Integrator) -> Updated {
    Updated { shape, transfer, integrator, ..Updated::default() }
}

/// A scheme of the total formulation at Gauss points.
fn total(degree: usize, coordinates: Coordinates) -> Scheme {
    Scheme::Total(Total { layout: Layout::Gauss, coordinates, ..Total::of_degree(degree) })
}

/// Every run. None calls a function of the system's mathematical library, which rounds otherwise on other machines: bodies that are
/// fitted to rings, polar grids and clipped shells do. Every shape, transfer and integrator is in one at least, and every dimension.
#[must_use]
pub fn runs() -> Vec<Run> {
    let case = |scheme: Scheme, cells: usize, periods: f64| Case {
        scheme,
        cells,
        periods,
        cfl: 0.3,
        ..Case::default()
    };
    let run = |name, specification, case| Run { name, specification, case, is_single: false };
    let in_single = |run: Run| Run { is_single: true, ..run };
    let on_lattice = |name, specification, shape, transfer, integrator, cells: usize, periods| {
        let scheme = Scheme::Updated(updated(shape, transfer, integrator));
        run(name, specification, case(scheme, cells, periods))
    };
    let placed = |name, specification, shape, transfer, placement, cells: usize, periods| {
        let own = Updated { placement, ..updated(shape, transfer, Integrator::Cd) };
        run(name, specification, case(Scheme::Updated(own), cells, periods))
    };
    let in_total = |name, specification, degree: usize, coordinates, cells: usize, periods| {
        let own = case(total(degree, coordinates), cells, periods);
        run(name, specification, Case { per_cell: degree + 1, cfl: 0.1, ..own })
    };
    let clipped =
        |angle, shift| Placement::Clipped { offset: 0.0, pose: GridPose { angle, shift } };
    let lumped =
        Total { mass: MassMatrix::Lumped, composition: Composition::Order2, ..Total::of_degree(2) };
    let projected = on_lattice(
        "block-projected-volume",
        BLOCK,
        Shape::Gimp,
        Transfer::Flip,
        Integrator::Usl,
        16,
        0.3,
    );
    let (flip, pic, apic, xpic) =
        (Transfer::Flip, Transfer::Pic, Transfer::Apic, Transfer::Xpic(3));
    vec![
        on_lattice("bar-gimp-flip-cd", BAR, Shape::Gimp, flip, Integrator::Cd, 32, 1.0),
        on_lattice("bar-cpdi2-apic-usf", BAR, Shape::Cpdi2, apic, Integrator::Usf, 24, 0.5),
        on_lattice("block-gimp-flip-cd", BLOCK, Shape::Gimp, flip, Integrator::Cd, 24, 0.5),
        on_lattice("block-linear-pic-usl", BLOCK, Shape::Linear, pic, Integrator::Usl, 16, 0.2),
        on_lattice("block-ugimp-xpic-musl", BLOCK, Shape::Ugimp, xpic, Integrator::Musl, 16, 0.3),
        on_lattice(
            "block-bspline2-apic-usl",
            BLOCK,
            Shape::Bspline2,
            apic,
            Integrator::Usl,
            24,
            0.4,
        ),
        on_lattice(
            "block-bspline3-flip-usf",
            BLOCK,
            Shape::Bspline3,
            flip,
            Integrator::Usf,
            16,
            0.3,
        ),
        on_lattice(
            "block-gimp-bspline2-xpic-usavg",
            BLOCK,
            Shape::GimpBspline2,
            xpic,
            Integrator::Usavg,
            16,
            0.3,
        ),
        on_lattice("block-cpdi-apic-musl", BLOCK, Shape::Cpdi, apic, Integrator::Musl, 16, 0.3),
        on_lattice("block-cpdi2-flip-cd", BLOCK, Shape::Cpdi2, flip, Integrator::Cd, 16, 0.3),
        Run { case: Case { volume: Volume::Projected, ..projected.case }, ..projected },
        in_single(on_lattice("block-single", BLOCK, Shape::Gimp, apic, Integrator::Cd, 16, 0.3)),
        on_lattice("cube-gimp-flip-cd", CUBE, Shape::Gimp, flip, Integrator::Cd, 8, 0.2),
        on_lattice("cube-bspline2-apic-usl", CUBE, Shape::Bspline2, apic, Integrator::Usl, 6, 0.15),
        on_lattice("cube-cpdi2-xpic-usavg", CUBE, Shape::Cpdi2, xpic, Integrator::Usavg, 4, 0.15),
        in_single(on_lattice("cube-single", CUBE, Shape::Linear, flip, Integrator::Musl, 6, 0.1)),
        placed("ring-clipped", RING, Shape::Bspline2, flip, clipped(17.0, 0.3), 12, 0.15),
        placed("cube-clipped", CUBE, Shape::Cpdi2, flip, clipped(20.0, 0.2), 4, 0.1),
        on_lattice("cylinder-gimp", CYLINDER, Shape::Gimp, flip, Integrator::Cd, 16, 0.2),
        in_total("block-total", BLOCK, 4, Coordinates::Cartesian, 6, 0.1),
        run("block-total-lumped", BLOCK, case(Scheme::Total(lumped), 12, 0.2)),
        in_total("shell-total", SHELL, 2, Coordinates::Spherical, 3, 0.05),
        on_lattice("own-bar", OWN_BAR, Shape::Gimp, flip, Integrator::Usavg, 24, 0.5),
        in_total("own-total", OWN_BLOCK, 3, Coordinates::Cartesian, 5, 0.1),
        on_lattice("damped-cpdi", DAMPED, Shape::Cpdi, flip, Integrator::Usl, 12, 0.3),
    ]
}
