//! Fields at many points, in flat arrays as hosts hold them.

use crate::staged::{PerPoint, Stage, coordinate};
use crate::{InterpretError, resolve};
use mmsmith_expr::{Program, Slot};
use mmsmith_runtime::nalgebra::SVector;
use mmsmith_runtime::{AnySolution, BLOCK, Solution, Surface};
use mmsmith_spec::Spec;
use mmsmith_stage::{FieldName, Staged};
use mmsmith_threads::parallel::*;
use std::sync::{Arc, OnceLock};

/// Points that one thread does at a time: long against what starts it, and many such pieces for each thread.
const PIECE: usize = 128 * BLOCK;

/// A solution's fields at many points. Each value has the bits that the function of [`Solution`](mmsmith_runtime::Solution)
/// gives at one point; threads share the points.
///
/// Positions are `dimension` numbers a point. Values are written point by point, the entries of matrices row by row.
pub struct Arrays {
    dimension: usize,
    parameters: Vec<f64>,
    /// The coordinates that anything reads.
    axes: Vec<usize>,
    fields: Vec<(Quantity, Stage)>,
    body_force: FromKept,
    state: FromKept,
    /// Where the law has internal variables, stresses and forces follow from histories.
    history: Option<Remembering>,
}

/// A solution whose stresses and body forces follow from histories.
struct Remembering {
    solution: AnySolution<f64>,
    surfaces: Vec<Surface>,
    variables: Vec<String>,
}

/// More points than these are worth tables.
const ENOUGH_FOR_TABLES: usize = 256;

impl Remembering {
    fn new<'a>(
        spec: &Spec,
        staged: &Staged,
        overrides: impl IntoIterator<Item = (&'a str, f64)>,
    ) -> Result<Self, InterpretError> {
        let solution = crate::interpret_staged(spec, staged, overrides)?;
        let variables = match &solution {
            AnySolution::One(solution) => solution.internal_variables(),
            AnySolution::Two(solution) => solution.internal_variables(),
            AnySolution::Three(solution) => solution.internal_variables(),
            _ => Vec::new(),
        };
        let surfaces = spec.domain.surfaces(spec.dimension);
        Ok(Self { solution, surfaces, variables })
    }

    /// The numbers that a quantity has at a point; `None` for quantities that do not follow from histories.
    fn entries(&self, quantity: Quantity, dimension: usize) -> Option<usize> {
        match quantity {
            Quantity::Field(FieldName::FirstPiolaKirchhoff) => Some(dimension * dimension),
            Quantity::Field(FieldName::BodyForce) => Some(dimension),
            Quantity::Field(_) => None,
            Quantity::Traction(surface) => self.surfaces.contains(&surface).then_some(dimension),
            Quantity::Internal => Some(self.variables.len()),
        }
    }

    fn evaluate(&self, quantity: Quantity, X: &[f64], t: f64, values: &mut [f64]) {
        match &self.solution {
            AnySolution::One(solution) => evaluate_histories(&**solution, quantity, X, t, values),
            AnySolution::Two(solution) => evaluate_histories(&**solution, quantity, X, t, values),
            AnySolution::Three(solution) => {
                evaluate_histories(&**solution, quantity, X, t, values);
            }
            _ => values.fill(f64::NAN),
        }
    }
}

fn evaluate_histories<const D: usize>(
    solution: &dyn Solution<f64, D>,
    quantity: Quantity,
    X: &[f64],
    t: f64,
    values: &mut [f64],
) {
    let points: Vec<SVector<f64, D>> = X.chunks_exact(D).map(SVector::from_row_slice).collect();
    if points.is_empty() {
        return;
    }
    let entries = values.len() / points.len();
    // Where a history cannot be followed, values are not numbers.
    let has_tables = points.len() > ENOUGH_FOR_TABLES
        && solution.prepare_until(t.max(solution.period())).is_ok();
    if has_tables && quantity == Quantity::Field(FieldName::BodyForce) {
        let mut b = vec![SVector::zeros(); points.len()];
        solution.body_force_at(&points).evaluate(t, 0, &mut b);
        let components = b.iter().flat_map(|b| b.iter());
        values.iter_mut().zip(components).for_each(|(value, own)| *value = *own);
        return;
    }
    values.par_chunks_mut(entries.max(1)).zip(&points).for_each(|(values, X)| {
        let own: Vec<f64> = match quantity {
            Quantity::Field(FieldName::BodyForce) => {
                solution.body_force(X, t).iter().copied().collect()
            }
            Quantity::Field(_) => {
                let P = solution.first_piola_kirchhoff(X, t);
                P.transpose().iter().copied().collect()
            }
            Quantity::Traction(surface) => {
                let traction = solution.traction(surface, X, t);
                traction.unwrap_or(SVector::repeat(f64::NAN)).iter().copied().collect()
            }
            Quantity::Internal => solution.internal(X, t),
        };
        values.iter_mut().zip(own).for_each(|(value, own)| *value = own);
    });
}

/// A quantity to compute at points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// A field.
    Field(FieldName),
    /// The traction `P N` on a surface, force per reference area, at points of that surface.
    Traction(Surface),
    /// The internal variables of the law, in the order of [`Arrays::internal_variables`].
    Internal,
}

/// Fields from values that are kept of each point.
struct FromKept {
    /// How many values of a point are kept, and how they follow from its coordinates.
    kept: usize,
    at_points: Stage,
    fields: Vec<(FieldName, Stage)>,
}

impl FromKept {
    fn new(
        program: &Program,
        coordinates: &[Slot],
        kept: &[Slot],
        fields: &[(FieldName, &[Slot])],
    ) -> Self {
        let stage =
            |&(name, outputs): &(FieldName, &[Slot])| (name, Stage::new(program, outputs, kept));
        FromKept {
            kept: kept.len(),
            at_points: Stage::new(program, kept, coordinates),
            fields: fields.iter().map(stage).collect(),
        }
    }
}

impl Arrays {
    /// The fields of `spec` as `staged` has them, with the defaults of its parameters but for `overrides`.
    ///
    /// # Errors
    ///
    /// [`InterpretError`] where a parameter is unknown or out of its range. What the specification requires of several
    /// parameters is not looked at here; [`interpret_staged`](crate::interpret_staged) does so.
    pub fn new<'a>(
        spec: &Spec,
        staged: &Staged,
        overrides: impl IntoIterator<Item = (&'a str, f64)>,
    ) -> Result<Self, InterpretError> {
        let program = staged.program();
        let n = spec.dimension;
        let overrides: Vec<(&str, f64)> = overrides.into_iter().collect();
        let history = match &staged.history {
            None => None,
            Some(_) => Some(Remembering::new(spec, staged, overrides.iter().copied())?),
        };
        let (axes, coordinates): (Vec<usize>, Vec<Slot>) =
            (0..n).filter_map(|axis| Some((axis, coordinate(program, axis)?))).unzip();
        let fields = FieldName::ALL.map(|name| (Quantity::Field(name), staged.field(name)));
        let tractions = staged
            .tractions
            .iter()
            .map(|traction| (Quantity::Traction(traction.surface), &traction.outputs[..]));
        let (u, rest) = staged.state.outputs().split_at(n);
        let (F, P) = rest.split_at(n * n);
        let state = [
            (FieldName::Displacement, u),
            (FieldName::DeformationGradient, F),
            (FieldName::FirstPiolaKirchhoff, P),
            (FieldName::Velocity, staged.velocity.outputs()),
        ];
        let body_force = [(FieldName::BodyForce, staged.body_force.outputs())];
        Ok(Arrays {
            history,
            dimension: n,
            parameters: resolve(spec, overrides)?,
            axes,
            fields: fields
                .into_iter()
                .chain(tractions)
                .map(|(quantity, outputs)| (quantity, Stage::new(program, outputs, &coordinates)))
                .collect(),
            body_force: FromKept::new(
                program,
                &coordinates,
                staged.body_force.point(),
                &body_force,
            ),
            state: FromKept::new(program, &coordinates, staged.state.point(), &state),
        })
    }

    /// The number of space dimensions.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// The numbers that a quantity has at a point; `None` for a surface that the body does not have.
    #[must_use]
    pub fn entries(&self, quantity: Quantity) -> Option<usize> {
        let of_history = self.history.as_ref();
        if let Some(entries) = of_history.and_then(|own| own.entries(quantity, self.dimension)) {
            return Some(entries);
        }
        self.stage(quantity).map(|stage| stage.section.output_count())
    }

    /// The names of the law's internal variables.
    #[must_use]
    pub fn internal_variables(&self) -> &[String] {
        self.history.as_ref().map_or(&[], |own| &own.variables)
    }

    fn stage(&self, quantity: Quantity) -> Option<&Stage> {
        self.fields.iter().find(|(known, _)| *known == quantity).map(|(_, stage)| stage)
    }

    /// Writes the quantity at the points `X` and time `t` into `values`.
    ///
    /// # Panics
    ///
    /// Panics where the lengths do not belong together, or there is no such surface.
    pub fn evaluate(&self, quantity: Quantity, X: &[f64], t: f64, values: &mut [f64]) {
        let of_history = self.history.as_ref();
        if let Some(own) = of_history.filter(|own| own.entries(quantity, self.dimension).is_some())
        {
            return own.evaluate(quantity, X, t, values);
        }
        let Some(stage) = self.stage(quantity) else { panic!("there is no {quantity:?}") };
        self.of_coordinates(stage, X, t, values);
    }

    fn of_coordinates(&self, stage: &Stage, X: &[f64], t: f64, values: &mut [f64]) {
        let n = self.dimension;
        let count = X.len() / n;
        let uniform = stage.uniform(n, t, &self.parameters);
        fill(stage, &uniform, count, values, |first, given| {
            let last = (first + BLOCK).min(count) - 1;
            // What a last block has to spare repeats its last point.
            let row = |&axis: &usize| -> PerPoint<f64> {
                std::array::from_fn(|i| X[(first + i).min(last) * n + axis])
            };
            given.extend(self.axes.iter().map(row));
        });
    }

    /// The fields at the points `X`, which are copied.
    #[must_use]
    pub fn at(self: &Arc<Self>, X: &[f64]) -> ArraysAtPoints {
        let (body_force, state) = (OnceLock::new(), OnceLock::new());
        ArraysAtPoints { arrays: Arc::clone(self), X: X.to_vec(), body_force, state }
    }

    /// Block by block the values that are kept of points.
    fn kept(&self, of: &FromKept, X: &[f64]) -> Vec<PerPoint<f64>> {
        let mut flat = vec![0.0; X.len() / self.dimension * of.kept];
        self.of_coordinates(&of.at_points, X, f64::NAN, &mut flat);
        let mut rows = Vec::with_capacity(flat.len().div_ceil(BLOCK));
        for block in flat.chunks(BLOCK * of.kept.max(1)) {
            let last = block.len() / of.kept - 1;
            let row = |m: usize| std::array::from_fn(|i| block[i.min(last) * of.kept + m]);
            rows.extend((0..of.kept).map(row));
        }
        rows
    }
}

/// [`Arrays`] at points that stay: what depends on these alone is computed once, with the first value that needs it.
///
/// The body force equals that of [`Arrays`] but for rounding; the other fields have the same bits.
pub struct ArraysAtPoints {
    arrays: Arc<Arrays>,
    X: Vec<f64>,
    body_force: OnceLock<Vec<PerPoint<f64>>>,
    state: OnceLock<Vec<PerPoint<f64>>>,
}

impl ArraysAtPoints {
    /// The number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.X.len() / self.arrays.dimension
    }

    /// Whether there are no points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.X.is_empty()
    }

    /// The numbers that a field has at a point.
    #[must_use]
    pub fn entries(&self, field: FieldName) -> usize {
        self.arrays.entries(Quantity::Field(field)).unwrap_or_default()
    }

    /// Writes the field at time `t` into `values`.
    ///
    /// # Panics
    ///
    /// Panics where `values` has not as many numbers as the field has at these points.
    pub fn evaluate(&self, field: FieldName, t: f64, values: &mut [f64]) {
        let Self { arrays, X, .. } = self;
        if let Some(own) = &arrays.history
            && own.entries(Quantity::Field(field), arrays.dimension).is_some()
        {
            return own.evaluate(Quantity::Field(field), X, t, values);
        }
        for (of, rows) in [(&arrays.body_force, &self.body_force), (&arrays.state, &self.state)] {
            let Some((_, stage)) = of.fields.iter().find(|(name, _)| *name == field) else {
                continue;
            };
            let rows = rows.get_or_init(|| arrays.kept(of, X));
            let uniform = stage.uniform(arrays.dimension, t, &arrays.parameters);
            return fill(stage, &uniform, self.len(), values, |first, given| {
                given.extend_from_slice(&rows[first / BLOCK * of.kept..][..of.kept]);
            });
        }
        arrays.evaluate(Quantity::Field(field), X, t, values);
    }
}

/// Runs a stage over `count` points; `give` appends what is given of the block that begins with a point.
fn fill(
    stage: &Stage,
    uniform: &[f64],
    count: usize,
    values: &mut [f64],
    give: impl Fn(usize, &mut Vec<PerPoint<f64>>) + Sync,
) {
    let entries = stage.section.output_count();
    assert_eq!(values.len(), count * entries, "{entries} values for each of {count} points");
    if values.is_empty() {
        return;
    }
    values.par_chunks_mut(PIECE * entries).enumerate().for_each(|(piece, values)| {
        let (mut given, mut rows) = (Vec::new(), Vec::new());
        for (block, values) in values.chunks_mut(BLOCK * entries).enumerate() {
            given.clear();
            give(piece * PIECE + block * BLOCK, &mut given);
            for (entry, row) in stage.section.run(uniform, &given, &mut rows).enumerate() {
                values[entry..]
                    .iter_mut()
                    .step_by(entries)
                    .zip(row)
                    .for_each(|(to, from)| *to = *from);
            }
        }
    });
}
