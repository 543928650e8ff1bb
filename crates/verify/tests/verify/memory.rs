//! Runs of laws with memory against closed forms, in both formulations: a law of a user's own, stated in text with an internal variable,
//! a given field or a rate; plastic flow; masses that differ from place to place.

use mmsmith_ranks::in_process;
use mmsmith_solutions::{
    AnySolution, Boundary, Condition, Domain, Fields, Law, Material, Solution, Surface,
};
use mmsmith_solutions::{Components, Flow, Internal, Memory, Response, Stated, WithMemory};
use mmsmith_verify::{
    Arithmetic, Case, CflSpeed, Composition, Layout, MassMatrix, Outputs, ReturnMap, Row, Scheme,
    Status, Study, Sweep, Total, Transfer, Updated, check, converge, run,
};
use nalgebra::{SMatrix, SVector};
use std::f64::consts::PI;

/// A solution on a line.
trait Line: Send + Sync + 'static {
    /// Displacement, velocity, acceleration.
    fn motion(&self, X: f64, t: f64) -> [f64; 3];
    fn gradient(&self, X: f64, t: f64) -> f64;
    /// The stress and its slope.
    fn stress(&self, X: f64, t: f64) -> [f64; 2];
    fn law(&self) -> Law<f64>;
    fn internal(&self, X: f64, t: f64) -> Vec<(&'static str, f64)>;
    fn condition(&self) -> Condition;
    fn density(&self, _X: f64) -> f64 {
        1.0
    }
}

/// A solution along the first axis of `D` dimensions, in a unit box.
struct AlongAxis<S, const D: usize> {
    own: S,
    boundaries: Vec<Boundary>,
}

fn along_axis<S: Line, const D: usize>(own: S) -> AlongAxis<S, D> {
    let condition = own.condition();
    let surfaces = (0..D).flat_map(|axis| [Surface::Lower(axis), Surface::Upper(axis)]);
    let boundaries = surfaces.map(|surface| Boundary { surface, condition }).collect();
    AlongAxis { own, boundaries }
}

fn on_line<S: Line>(own: S) -> AnySolution<f64> {
    AnySolution::One(Box::new(along_axis::<S, 1>(own)))
}

fn first<const D: usize, const C: usize>(value: f64) -> SMatrix<f64, D, C> {
    let mut all = SMatrix::zeros();
    all[(0, 0)] = value;
    all
}

impl<S: Line, const D: usize> Solution<f64, D> for AlongAxis<S, D> {
    fn displacement(&self, X: &SVector<f64, D>, t: f64) -> SVector<f64, D> {
        first(self.own.motion(X[0], t)[0])
    }
    fn velocity(&self, X: &SVector<f64, D>, t: f64) -> SVector<f64, D> {
        first(self.own.motion(X[0], t)[1])
    }
    fn acceleration(&self, X: &SVector<f64, D>, t: f64) -> SVector<f64, D> {
        first(self.own.motion(X[0], t)[2])
    }
    fn displacement_gradient(&self, X: &SVector<f64, D>, t: f64) -> SMatrix<f64, D, D> {
        first(self.own.gradient(X[0], t))
    }
    fn deformation_gradient(&self, X: &SVector<f64, D>, t: f64) -> SMatrix<f64, D, D> {
        SMatrix::identity() + first(self.own.gradient(X[0], t))
    }
    fn jacobian(&self, X: &SVector<f64, D>, t: f64) -> f64 {
        1.0 + self.own.gradient(X[0], t)
    }
    fn first_piola_kirchhoff(&self, X: &SVector<f64, D>, t: f64) -> SMatrix<f64, D, D> {
        first(self.own.stress(X[0], t)[0])
    }
    fn body_force(&self, X: &SVector<f64, D>, t: f64) -> SVector<f64, D> {
        let [.., a] = self.own.motion(X[0], t);
        first(a - self.own.stress(X[0], t)[1] / self.own.density(X[0]))
    }
    fn fields(&self, X: &SVector<f64, D>, t: f64) -> Fields<f64, D> {
        Fields {
            u: self.displacement(X, t),
            v: self.velocity(X, t),
            a: self.acceleration(X, t),
            H: self.displacement_gradient(X, t),
            F: self.deformation_gradient(X, t),
            J: self.jacobian(X, t),
            P: self.first_piola_kirchhoff(X, t),
            b: self.body_force(X, t),
        }
    }
    fn domain(&self) -> Domain<f64, D> {
        Domain::Box { lower: SVector::zeros(), upper: SVector::repeat(1.0) }
    }
    fn boundaries(&self) -> &[Boundary] {
        &self.boundaries
    }
    fn cell_length(&self) -> f64 {
        1.0
    }
    fn law(&self) -> Law<f64> {
        let mut law = self.own.law();
        if let Law::Stated(Stated { response: Response::Stress(rows), .. }) = &mut law {
            rows.iter_mut().for_each(|row| row.resize(D, "0".to_owned()));
            rows.resize(D, vec!["0".to_owned(); D]);
        }
        law
    }
    fn density(&self) -> f64 {
        self.own.density(0.5)
    }
    fn density_at(&self, X: &SVector<f64, D>) -> f64 {
        self.own.density(X[0])
    }
    fn internal_variables(&self) -> Vec<String> {
        self.own.internal(0.5, 0.0).iter().map(|(name, _)| (*name).to_owned()).collect()
    }
    fn internal(&self, X: &SVector<f64, D>, t: f64) -> Vec<f64> {
        self.own.internal(X[0], t).iter().map(|(_, value)| *value).collect()
    }
    fn wave_speed(&self) -> f64 {
        1.5
    }
    fn period(&self) -> f64 {
        1.0
    }
}

const AMPLITUDE: f64 = 0.02;
const FREQUENCY: f64 = 2.0;

/// `A sin(Pi X) sin(w t)` with its rates.
fn standing_wave(X: f64, t: f64) -> [f64; 3] {
    let (sin, cos) = (FREQUENCY * t).sin_cos();
    let shape = AMPLITUDE * (PI * X).sin();
    [shape * sin, FREQUENCY * shape * cos, -FREQUENCY * FREQUENCY * shape * sin]
}

/// The slope of the shape, and its slope.
fn slopes(X: f64) -> [f64; 2] {
    let (sin, cos) = (PI * X).sin_cos();
    [AMPLITUDE * PI * cos, -AMPLITUDE * PI * PI * sin]
}

fn stated(stress: &str, constants: &[(&str, f64)], given: &[(&str, &str)]) -> Stated<f64> {
    let owned = |&(name, text): &(&str, &str)| (name.to_owned(), text.to_owned());
    Stated {
        response: Response::Stress(vec![vec![stress.to_owned()]]),
        components: Components::Cartesian,
        constants: constants.iter().map(|&(name, value)| (name.to_owned(), value)).collect(),
        given: given.iter().map(owned).collect(),
        internal: Vec::new(),
        across: None,
    }
}

/// Springs beside each other, one of them behind a dashpot, the other with a stiffness that a given field of position and time states.
struct Springs;

impl Springs {
    const TIME: f64 = 0.3;

    /// The factor of `q` in time.
    fn memory(t: f64) -> f64 {
        let (w, tau) = (FREQUENCY, Self::TIME);
        ((w * t).sin() - w * tau * (w * t).cos() + w * tau * (-t / tau).exp())
            / (1.0 + w * w * tau * tau)
    }
}

impl Line for Springs {
    fn motion(&self, X: f64, t: f64) -> [f64; 3] {
        standing_wave(X, t)
    }
    fn gradient(&self, X: f64, t: f64) -> f64 {
        slopes(X)[0] * (FREQUENCY * t).sin()
    }
    fn stress(&self, X: f64, t: f64) -> [f64; 2] {
        let (in_time, stiff) = ((FREQUENCY * t).sin(), 1.0 + 0.5 * X * t);
        let behind = 0.8 * (in_time - Self::memory(t));
        let [slope, curvature] = slopes(X);
        let factor = stiff * in_time + behind;
        [factor * slope, factor * curvature + 0.5 * t * in_time * slope]
    }
    fn law(&self) -> Law<f64> {
        let stress = "stiff*(F11 - 1) + g*(F11 - 1 - q)";
        let constants = [("k", 1.0), ("g", 0.8), ("tau", Self::TIME)];
        let mut law = stated(stress, &constants, &[("slope", "t/2"), ("stiff", "k*(1 + slope*X)")]);
        law.internal = vec![Internal {
            name: "q".into(),
            rate: "(F11 - 1 - q)/tau".into(),
            initial: "0*X".into(),
        }];
        Law::Stated(law)
    }
    fn internal(&self, X: f64, t: f64) -> Vec<(&'static str, f64)> {
        vec![("q", slopes(X)[0] * Self::memory(t))]
    }
    fn condition(&self) -> Condition {
        Condition::Sliding
    }
}

/// A spring beside a dashpot, `P = k (F - 1) + eta F'`.
struct KelvinVoigt;

impl Line for KelvinVoigt {
    fn motion(&self, X: f64, t: f64) -> [f64; 3] {
        standing_wave(X, t)
    }
    fn gradient(&self, X: f64, t: f64) -> f64 {
        slopes(X)[0] * (FREQUENCY * t).sin()
    }
    fn stress(&self, X: f64, t: f64) -> [f64; 2] {
        let (sin, cos) = (FREQUENCY * t).sin_cos();
        slopes(X).map(|slope| (sin + 0.01 * FREQUENCY * cos) * slope)
    }
    fn law(&self) -> Law<f64> {
        Law::Stated(stated("k*(F11 - 1) + eta*Jdot", &[("k", 1.0), ("eta", 0.01)], &[]))
    }
    fn internal(&self, _: f64, _: f64) -> Vec<(&'static str, f64)> {
        Vec::new()
    }
    fn condition(&self) -> Condition {
        Condition::Sliding
    }
}

/// A neo-Hookean bar whose density grows along it.
struct Heavy;

impl Line for Heavy {
    fn motion(&self, X: f64, t: f64) -> [f64; 3] {
        standing_wave(X, t)
    }
    fn gradient(&self, X: f64, t: f64) -> f64 {
        slopes(X)[0] * (FREQUENCY * t).sin()
    }
    fn stress(&self, X: f64, t: f64) -> [f64; 2] {
        let sin = (FREQUENCY * t).sin();
        let [slope, curvature] = slopes(X).map(|slope| slope * sin);
        let F = 1.0 + slope;
        [F - 1.0 / F, curvature * (1.0 + 1.0 / (F * F))]
    }
    fn law(&self) -> Law<f64> {
        Law::Library(Material::NeoHookean { lambda: 0.0, mu: 1.0 })
    }
    fn internal(&self, _: f64, _: f64) -> Vec<(&'static str, f64)> {
        Vec::new()
    }
    fn condition(&self) -> Condition {
        Condition::Sliding
    }
    fn density(&self, X: f64) -> f64 {
        1.0 + 0.5 * X
    }
}

/// A bar that flows from the start: `alpha = 2 mu ln F / (3 mu + H)`, as the elastic stretch at the start is along the bar.
struct PlasticBar;

impl PlasticBar {
    const LAMBDA: f64 = 1.2;
    const MU: f64 = 0.8;
    const YIELD: f64 = 0.02;
    const MODULUS: f64 = 0.3;

    fn alpha(F: f64) -> f64 {
        2.0 * Self::MU * F.ln() / (3.0 * Self::MU + Self::MODULUS)
    }

    /// `u = r(t) (X + sin(2 X)/4)`.
    fn ramp(t: f64) -> [f64; 3] {
        [0.05 * (t + t * t), 0.05 * (1.0 + 2.0 * t), 0.1]
    }
}

impl Line for PlasticBar {
    fn motion(&self, X: f64, t: f64) -> [f64; 3] {
        Self::ramp(t).map(|r| r * (X + 0.25 * (2.0 * X).sin()))
    }
    fn gradient(&self, X: f64, t: f64) -> f64 {
        Self::ramp(t)[0] * (1.0 + 0.5 * (2.0 * X).cos())
    }
    fn stress(&self, X: f64, t: f64) -> [f64; 2] {
        let F = 1.0 + self.gradient(X, t);
        let slope = -Self::ramp(t)[0] * (2.0 * X).sin();
        let (lambda, mu) = (Self::LAMBDA, Self::MU);
        let of_logarithm = lambda + 2.0 * mu - 4.0 * mu * mu / (3.0 * mu + Self::MODULUS);
        let tau = of_logarithm * F.ln() + 2.0 / 3.0 * Self::YIELD;
        [tau / F, slope * (of_logarithm - tau) / (F * F)]
    }
    fn law(&self) -> Law<f64> {
        let flow = Flow {
            yield_stress: Self::YIELD,
            modulus: Self::MODULUS,
            exponent: 1.0,
            overstress: None,
            is_on_yield: true,
        };
        let elastic = Material::Hencky { lambda: Self::LAMBDA, mu: Self::MU };
        Law::WithMemory(WithMemory { elastic, memory: Memory::Flow(flow) })
    }
    fn internal(&self, X: f64, t: f64) -> Vec<(&'static str, f64)> {
        let (F, e0) = (1.0 + self.gradient(X, t), Self::YIELD / (3.0 * Self::MU));
        let alpha = Self::alpha(F);
        let along = (2.0 * (e0 - alpha)).exp();
        let across = (alpha - e0).exp();
        vec![
            ("G11", along),
            ("G22", across),
            ("G33", across),
            ("G12", 0.0),
            ("G13", 0.0),
            ("G23", 0.0),
            ("alpha", alpha),
        ]
    }
    fn condition(&self) -> Condition {
        Condition::PrescribedMotion
    }
}

fn total(degree: usize) -> Scheme {
    Scheme::Total(Total {
        degree,
        mass: MassMatrix::Consistent,
        composition: Composition::Order2,
        layout: Layout::Gauss,
        ..Total::of_degree(degree)
    })
}

/// The orders of internal variables are those of their errors.
fn assert_orders_of_internal(study: &Study, sweep: &Sweep) {
    let all = study.internal_orders(sweep);
    for (k, (name, first)) in study.rows[0].internal.iter().enumerate() {
        let own = &all[name].l2;
        let expected = (first.l2 / study.rows[1].internal[k].1.l2).log2();
        assert!(own.local[0].is_some_and(|order| (order - expected).abs() < 1e-9), "{own:?}");
    }
}

fn study(solution: &AnySolution<f64>, case: &Case, cells: &[usize]) -> Vec<Row> {
    let sweep = Sweep::Cells(cells.to_vec());
    let found = converge(solution, Arithmetic::Double, case, &sweep, &mut |_| ())
        .expect("cases that can be run");
    assert_orders_of_internal(&found, &sweep);
    let rows = found.rows;
    for row in &rows {
        assert_eq!(row.status, Status::Ok, "{row:?}");
    }
    rows
}

/// The orders of the largest errors of u, P and internal variables on the last two grids.
fn orders(rows: &[Row]) -> Vec<f64> {
    let [.., coarse, fine] = rows else { panic!("two rows") };
    let order = |a: f64, b: f64| (a / b).log2();
    let internal = coarse.internal.iter().zip(&fine.internal);
    let internal = internal.map(|((_, a), (_, b))| order(a.l2, b.l2));
    let fields =
        [order(coarse.errors.u.l2, fine.errors.u.l2), order(coarse.errors.P.l2, fine.errors.P.l2)];
    fields.into_iter().chain(internal).collect()
}

#[test]
fn a_law_of_a_user_with_an_internal_variable_and_a_given_field_runs_without_code() {
    let solution = on_line(Springs);
    let found = check(&solution, 200).expect("a solution that can be checked");
    assert!(found.passed(), "{found:?}");
    for scheme in [Scheme::Updated(Updated::default()), total(2)] {
        let case = Case { scheme, cfl: 0.3, ..Case::default() };
        let rows = study(&solution, &case, &[16, 32]);
        assert_eq!(rows[0].internal[0].0, "q");
        let found = orders(&rows);
        assert!(found.iter().all(|order| *order > 1.85), "{scheme:?}: {found:?} {rows:?}");
        let written = serde_json::to_value(&rows[0]).expect("JSON");
        assert_eq!(written["errors"]["internal"]["q"]["l2"], rows[0].internal[0].1.l2);
        assert_eq!(written["errors"]["u"]["l2"], rows[0].errors.u.l2);
    }
}

#[test]
fn a_stress_of_the_rate_of_deformation_has_second_order() {
    let solution = on_line(KelvinVoigt);
    for scheme in [Scheme::Updated(Updated::default()), total(2)] {
        let case = Case { scheme, cfl: 0.3, ..Case::default() };
        let rows = study(&solution, &case, &[16, 32]);
        let found = orders(&rows);
        assert!(found.iter().all(|order| *order > 1.85), "{scheme:?}: {found:?} {rows:?}");
        assert!(rows[0].internal.is_empty());
        let written = serde_json::to_value(&rows[0]).expect("JSON");
        assert!(written["errors"].get("internal").is_none());
    }
}

#[test]
fn a_density_that_grows_along_a_bar_has_second_order() {
    let solution = on_line(Heavy);
    let case = Case { cfl: 0.3, ..Case::default() };
    let found = orders(&study(&solution, &case, &[16, 32]));
    assert!(found.iter().all(|order| *order > 1.85), "{found:?}");
    let case = Case { scheme: total(2), ..case };
    let progress = &mut |_| ();
    let refused = run(&solution, Arithmetic::Double, &case, &mut Outputs::new(progress));
    let message = refused.unwrap_err().to_string();
    assert!(message.contains("updated-lagrangian where both ends slide"), "{message}");
}

#[test]
fn plastic_flow_in_a_bar_has_the_orders_of_splines() {
    let solution = on_line(PlasticBar);
    let found = check(&solution, 200).expect("a solution that can be checked");
    assert!(found.passed(), "{found:?}");
    for map in [None, Some(ReturnMap::Midpoint)] {
        let case = Case { scheme: total(2), cfl: 0.3, return_map: map, ..Case::default() };
        let rows = study(&solution, &case, &[16, 32, 64]);
        assert_eq!(rows[0].internal.len(), 1);
        assert_eq!(rows[0].internal[0].0, "alpha");
        let found = orders(&rows);
        // At two Gauss points a cell gradients of quadratic splines gain an order; on a line return maps have no error of their own.
        assert!(found.iter().all(|order| (order - 3.0).abs() < 0.1), "{map:?}: {found:?}");
    }
}

#[test]
fn several_processes_measure_internal_variables_to_the_bit() {
    let case = Case {
        scheme: Scheme::Updated(Updated { transfer: Transfer::Apic, ..Updated::default() }),
        cells: 40,
        cfl_speed: CflSpeed::PWave,
        periods: 0.2,
        ..Case::default()
    };
    let timeless = |row: Row| Row { wall_s: 0.0, cpu_s: 0.0, particle_steps_per_s: 0.0, ..row };
    let measured = |ranks| {
        let progress = &mut |_| ();
        let mut outputs = Outputs { ranks, ..Outputs::new(progress) };
        let solution = AnySolution::Two(Box::new(along_axis::<_, 2>(Springs)));
        timeless(run(&solution, Arithmetic::Double, &case, &mut outputs).expect("a case"))
    };
    let alone = measured(None);
    assert!(alone.internal[0].1.l2 > 0.0);
    for row in in_process(2, |ranks| measured(Some(ranks))) {
        assert_eq!(row, alone);
    }
}
