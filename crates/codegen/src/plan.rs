//! What is computed when, before any language comes in.
//!
//! A plan sorts the operations of a solution's fields into stages: once for given parameters, once a time, once a
//! point, and for each point at each time. It alone decides which values are kept between the stages and in which
//! order; the Rust module and the C header are two renderings of the same plan, so that their results agree.

use mmsmith_expr::{
    Dependence, Drafts, Expr, Function, MOST_KEPT_OF_STATES, Operation, Program, Rational, Slot,
    arrange, reuse,
};
use mmsmith_spec::{DeriveError, Domain, Fields, Spec, Surface};
use std::collections::BTreeMap;

/// A solution whose fields are derived and staged, ready to be written down in Rust or in C.
pub struct Plan<'a> {
    pub(crate) spec: &'a Spec,
    program: Program,
    pub(crate) fields: Vec<Field>,
    /// The body force, arranged for evaluation in stages.
    pub(crate) body_force: Stages,
    /// The body force at the points of a lattice, where that has a form of its own.
    pub(crate) lattice: Option<Lattice>,
    /// Displacement, deformation gradient and stress, and the velocity, which may belong to another time: both from what
    /// one stage keeps of a point.
    pub(crate) state: Stages,
    pub(crate) velocity: Stages,
    pub(crate) constants: Constants,
    /// The strain energy, where the material is given by one.
    pub(crate) energy: Option<Slot>,
    /// The traction on each surface.
    pub(crate) tractions: Vec<(Surface, Vec<Slot>)>,
    /// The two sides of each requirement.
    requirements: Vec<(Slot, Slot)>,
    /// The displacement and the law, a line each, for people.
    pub(crate) formulas: Vec<String>,
    fixed: Vec<Slot>,
}

/// Values that are computed in stages, and what is kept for them.
pub(crate) struct Stages {
    outputs: Vec<Slot>,
    time: Vec<Slot>,
    point: Vec<Slot>,
}

/// Values at the points of a lattice, from values of its layers, in stages.
pub(crate) struct Lattice {
    outputs: Vec<Slot>,
    /// For each axis the values of a layer, from what is kept of its coordinate and from values of the time, which are those
    /// of all layers.
    layers: Vec<Stages>,
}

/// A field of the solution.
pub(crate) struct Field {
    /// Its name in code.
    pub(crate) name: &'static str,
    /// Its name in words.
    pub(crate) title: &'static str,
    /// The letter that the literature uses.
    pub(crate) letter: &'static str,
    pub(crate) shape: Shape,
    pub(crate) outputs: Vec<Slot>,
}

#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Shape {
    Scalar,
    Vector,
    Matrix,
}

/// The scalars that depend on parameters only.
pub(crate) struct Constants {
    pub(crate) cell_length: Slot,
    pub(crate) density: Slot,
    pub(crate) wave_speed: Slot,
    pub(crate) period: Slot,
    /// Those of the law, by name.
    pub(crate) material: Vec<(&'static str, Slot)>,
    pub(crate) domain: Measures,
}

/// The measures of the body.
pub(crate) enum Measures {
    Box { lower: Vec<Slot>, upper: Vec<Slot> },
    Annulus { inner: Slot, outer: Slot },
}

/// When a kept value is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stage {
    /// Once for given parameters.
    Fixed,
    /// Once a time.
    Time,
    /// Once a point.
    Point,
    /// Once a time for each layer of a lattice along this axis.
    Layer(usize),
}

/// Where an operation finds a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Operand<'a> {
    /// Computed in the same block, by the operation of this index.
    Temporary(usize),
    Number(&'a Rational),
    Pi,
    /// Coordinate number `i`.
    Coordinate(usize),
    /// The time.
    Time,
    /// Parameter number `i`.
    Parameter(usize),
    /// Kept by an earlier stage, as its value number `i`.
    Kept(Stage, usize),
}

/// Straight-line code: the operations that some outputs need, in order, given what earlier stages keep.
pub(crate) struct Block<'a> {
    program: &'a Program,
    dimension: usize,
    kept: BTreeMap<Slot, (Stage, usize)>,
    steps: Vec<Slot>,
    outputs: Vec<Slot>,
}

impl<'a> Plan<'a> {
    /// Derives the fields of a specification and sorts their operations.
    ///
    /// # Errors
    ///
    /// [`DeriveError`] where a field is nowhere defined.
    pub fn new(spec: &'a Spec) -> Result<Self, DeriveError> {
        let mut fields = spec.derive()?;
        let formulas = formulas(spec, &fields);
        // Solvers sample the body force at the same points in every step; a single call does all the work each time.
        let (inputs, definitions, b) = (&fields.inputs, &fields.definitions, &fields.b);
        let drafts = &mut Drafts::default();
        let single = reuse(&mut fields.graph, inputs, definitions, drafts, b);
        let staged = arrange(&mut fields.graph, inputs, definitions, drafts, b);
        let matrix = |A: &Vec<Vec<Expr>>| A.concat();
        let parts = [
            ("displacement", "u", "displacement", Shape::Vector, fields.u.clone()),
            ("velocity", "v", "velocity", Shape::Vector, fields.v.clone()),
            ("acceleration", "a", "acceleration", Shape::Vector, fields.a.clone()),
            (
                "displacement_gradient",
                "H",
                "displacement gradient, F - I",
                Shape::Matrix,
                matrix(&fields.H),
            ),
            ("deformation_gradient", "F", "deformation gradient", Shape::Matrix, matrix(&fields.F)),
            ("jacobian", "J", "det F, current by reference volume", Shape::Scalar, vec![fields.J]),
            (
                "first_piola_kirchhoff",
                "P",
                "first Piola-Kirchhoff stress",
                Shape::Matrix,
                matrix(&fields.P),
            ),
            ("body_force", "b", "body force per unit mass", Shape::Vector, single),
        ];
        let constants = spec.constants();
        let mut outputs: Vec<Expr> = parts.iter().flat_map(|(.., part)| part.clone()).collect();
        let staged_places = outputs.len()..outputs.len() + staged.len();
        outputs.extend(&staged);
        outputs.extend(&constants);
        let energy = fields.W;
        outputs.extend(energy);
        outputs.extend(spec.requirements.iter().flat_map(|r| [r.left, r.right]));
        let surfaces = std::mem::take(&mut fields.surfaces);
        outputs.extend(surfaces.iter().flat_map(|s| &s.traction));
        let program = fields.program(&outputs).with_gathered_factors(staged_places.clone());
        let separated = program.with_separated_coordinates(staged_places, spec.dimension);
        let program = separated.unwrap_or(program);

        let mut slots = program.outputs().iter().copied();
        let mut take = |n: usize| slots.by_ref().take(n).collect::<Vec<Slot>>();
        let fields: Vec<Field> = parts
            .into_iter()
            .map(|(name, letter, title, shape, part)| Field {
                name,
                title,
                letter,
                shape,
                outputs: take(part.len()),
            })
            .collect();
        let staged = take(staged.len());
        let constants = Constants::new(spec, &take(constants.len()));
        let energy = energy.and_then(|_| take(1).first().copied());
        let requirements =
            spec.requirements.iter().map(|_| take(2)).map(|sides| (sides[0], sides[1])).collect();
        let tractions = surfaces.iter().map(|s| (s.surface, take(s.traction.len()))).collect();

        let fixed = fixed_slots(&program);
        let kept = numbered(Stage::Fixed, &fixed).collect();
        let stages = |outputs: Vec<Slot>, point| {
            let time = time_slots(&program, &kept, &outputs);
            Stages { outputs, time, point }
        };
        let at_points = program.kept_at_points(&staged, usize::MAX);
        let body_force = stages(staged, at_points);
        let separated = &program.outputs()[outputs.len()..];
        let lattice = (!separated.is_empty())
            .then(|| Lattice::new(&program, &kept, separated.to_vec(), spec.dimension));
        let of = |letters: &[&str]| -> Vec<Slot> {
            let fields = fields.iter().filter(|field| letters.contains(&field.letter));
            fields.flat_map(|field| field.outputs.clone()).collect()
        };
        let at_points = program.kept_at_points(&of(&["u", "v", "F", "P"]), MOST_KEPT_OF_STATES);
        let state = stages(of(&["u", "F", "P"]), at_points.clone());
        let velocity = stages(of(&["v"]), at_points);
        Ok(Plan {
            spec,
            program,
            fields,
            body_force,
            lattice,
            state,
            velocity,
            constants,
            energy,
            tractions,
            requirements,
            formulas,
            fixed,
        })
    }

    /// Whether any operation calls such a function.
    pub(crate) fn calls(&self, such: impl Fn(Function) -> bool) -> bool {
        let mut operations = self.program.operations().iter();
        operations.any(|operation| match operation {
            Operation::Call(function, _) => such(*function),
            Operation::LnOfBoth(..) => such(Function::LnOfBoth),
            _ => false,
        })
    }

    /// Whether any operation asks for what rounding takes from a sum or a product.
    pub(crate) fn forms_rounding_errors(&self) -> bool {
        let mut operations = self.program.operations().iter();
        operations.any(|o| matches!(o, Operation::SumError(..) | Operation::ProductError(..)))
    }

    /// How many values the stage of the parameters keeps.
    pub(crate) fn fixed_count(&self) -> usize {
        self.fixed.len()
    }

    /// The values that the stage of the parameters keeps, after the two sides of each requirement.
    pub(crate) fn fixed_stage(&self) -> Block<'_> {
        let sides = self.requirements.iter().flat_map(|&(left, right)| [left, right]);
        self.block(&[], sides.chain(self.fixed.iter().copied()).collect())
    }

    /// What `stages` keep of the time.
    pub(crate) fn time_stage(&self, stages: &Stages) -> Block<'_> {
        self.after_parameters(&stages.time)
    }

    /// What `stages` keep of a point.
    pub(crate) fn point_stage(&self, stages: &Stages) -> Block<'_> {
        self.after_parameters(&stages.point)
    }

    /// The values of `stages` from what all of them keep.
    pub(crate) fn staged(&self, stages: &Stages) -> Block<'_> {
        let kept = [
            (Stage::Fixed, self.fixed.as_slice()),
            (Stage::Time, &stages.time),
            (Stage::Point, &stages.point),
        ];
        self.block(&kept, stages.outputs.clone())
    }

    /// The body force at a point of a lattice from the values of its layers.
    pub(crate) fn of_layers(&self, lattice: &Lattice) -> Block<'_> {
        let layers = lattice.layers.iter().enumerate();
        let layers = layers.map(|(axis, stages)| (Stage::Layer(axis), stages.outputs.as_slice()));
        let uniform = [(Stage::Fixed, self.fixed.as_slice()), (Stage::Time, lattice.time())];
        let kept: Vec<_> = uniform.into_iter().chain(layers).collect();
        self.block(&kept, lattice.outputs.clone())
    }

    /// `outputs` from the coordinates, the time, and what the stage of the parameters keeps.
    pub(crate) fn after_parameters(&self, outputs: &[Slot]) -> Block<'_> {
        self.block(&[(Stage::Fixed, &self.fixed)], outputs.to_vec())
    }

    /// All fields, in their order.
    pub(crate) fn all_fields(&self) -> Block<'_> {
        let outputs: Vec<Slot> = self.fields.iter().flat_map(|f| f.outputs.clone()).collect();
        self.after_parameters(&outputs)
    }

    fn block(&self, stages: &[(Stage, &[Slot])], outputs: Vec<Slot>) -> Block<'_> {
        let kept: BTreeMap<_, _> =
            stages.iter().flat_map(|&(stage, slots)| numbered(stage, slots)).collect();
        let needed = needed(&self.program, &kept, &outputs);
        let steps = self
            .program
            .slots()
            .filter(|slot| needed[slot.index()])
            .filter(|slot| is_computed(&self.program, *slot))
            .collect();
        Block { program: &self.program, dimension: self.spec.dimension, kept, steps, outputs }
    }
}

impl Lattice {
    fn new(
        program: &Program,
        kept: &BTreeMap<Slot, (Stage, usize)>,
        outputs: Vec<Slot>,
        dimension: usize,
    ) -> Self {
        let layers = program.layers(&outputs, dimension);
        let all: Vec<Slot> = layers.concat().into_iter().chain(outputs.iter().copied()).collect();
        let time = time_slots(program, kept, &all);
        let of_axis = |outputs: Vec<Slot>| {
            let point = program.kept_at_points(&outputs, usize::MAX);
            Stages { outputs, time: time.clone(), point }
        };
        Lattice { outputs, layers: layers.into_iter().map(of_axis).collect() }
    }

    /// How the values of a layer are computed, for each axis.
    pub(crate) fn layers(&self) -> &[Stages] {
        &self.layers
    }

    fn time(&self) -> &[Slot] {
        self.layers.first().map_or(&[], |layer| &layer.time)
    }
}

impl Stages {
    /// How many values are computed.
    pub(crate) fn output_count(&self) -> usize {
        self.outputs.len()
    }

    /// How many values are kept of the time.
    pub(crate) fn time_count(&self) -> usize {
        self.time.len()
    }

    /// How many values are kept of a point.
    pub(crate) fn point_count(&self) -> usize {
        self.point.len()
    }
}

impl Constants {
    /// From the slots of [`Spec::constants`].
    fn new(spec: &Spec, slots: &[Slot]) -> Self {
        let names = spec.material.constants();
        let (material, measures) = slots[4..].split_at(names.len());
        let material = names.iter().zip(material).map(|(&(name, _), &slot)| (name, slot)).collect();
        let domain = match &spec.domain {
            Domain::Box { lower, .. } => {
                let (lower, upper) = measures.split_at(lower.len());
                Measures::Box { lower: lower.to_vec(), upper: upper.to_vec() }
            }
            Domain::Annulus { .. } => Measures::Annulus { inner: measures[0], outer: measures[1] },
        };
        Constants {
            cell_length: slots[0],
            density: slots[1],
            wave_speed: slots[2],
            period: slots[3],
            material,
            domain,
        }
    }
}

impl<'a> Block<'a> {
    /// The operations, with the index that names the result of each.
    pub(crate) fn steps(&self) -> impl Iterator<Item = (usize, &'a Operation)> {
        self.steps.iter().map(|slot| (slot.index(), &self.program.operations()[slot.index()]))
    }

    pub(crate) fn outputs(&self) -> impl Iterator<Item = Operand<'a>> {
        self.outputs.iter().map(|slot| self.operand(*slot))
    }

    pub(crate) fn operand(&self, slot: Slot) -> Operand<'a> {
        if let Some(&(stage, index)) = self.kept.get(&slot) {
            return Operand::Kept(stage, index);
        }
        match &self.program.operations()[slot.index()] {
            Operation::Number(value) => Operand::Number(value),
            Operation::Pi => Operand::Pi,
            // The inputs are the coordinates, the time and the parameters, in this order.
            Operation::Input(index) if *index < self.dimension => Operand::Coordinate(*index),
            Operation::Input(index) if *index == self.dimension => Operand::Time,
            Operation::Input(index) => Operand::Parameter(index - self.dimension - 1),
            _ => Operand::Temporary(slot.index()),
        }
    }

    /// Whether any operation or output reads such an operand.
    pub(crate) fn reads(&self, such: impl Fn(Operand<'a>) -> bool) -> bool {
        self.steps().flat_map(|(_, step)| step.operands()).any(|slot| such(self.operand(slot)))
            || self.outputs().any(such)
    }
}

fn numbered(stage: Stage, slots: &[Slot]) -> impl Iterator<Item = (Slot, (Stage, usize))> {
    slots.iter().enumerate().map(move |(index, &slot)| (slot, (stage, index)))
}

/// Whether the value in `slot` takes an operation.
fn is_computed(program: &Program, slot: Slot) -> bool {
    let operation = &program.operations()[slot.index()];
    !matches!(operation, Operation::Number(_) | Operation::Pi | Operation::Input(_))
}

/// The values of the parameters that are worth keeping: they cost something, and are read by an operation that depends
/// on more, or are results themselves.
fn fixed_slots(program: &Program) -> Vec<Slot> {
    let read_later = program
        .slots()
        .filter(|&slot| !program.dependence(slot).is_fixed())
        .flat_map(|slot| program.operations()[slot.index()].operands());
    let mut slots: Vec<Slot> = read_later
        .chain(program.outputs().iter().copied())
        .filter(|&slot| program.dependence(slot).is_fixed() && is_computed(program, slot))
        .collect();
    slots.sort_unstable();
    slots.dedup();
    slots
}

/// What `outputs` need of the time alone: the values that are read where time and position come together, or are results.
fn time_slots(
    program: &Program,
    kept: &BTreeMap<Slot, (Stage, usize)>,
    outputs: &[Slot],
) -> Vec<Slot> {
    let needed = needed(program, kept, outputs);
    let of_time = |slot: &Slot| {
        let Dependence { position, time } = program.dependence(*slot);
        time && !position
    };
    let mut time: Vec<Slot> = program
        .slots()
        .filter(|slot| needed[slot.index()] && !of_time(slot))
        .flat_map(|slot| program.operations()[slot.index()].operands())
        .chain(outputs.iter().copied())
        .filter(of_time)
        .collect();
    time.sort_unstable();
    time.dedup();
    time
}

/// Which operations `outputs` need, where kept values need none.
fn needed(program: &Program, kept: &BTreeMap<Slot, (Stage, usize)>, outputs: &[Slot]) -> Vec<bool> {
    let mut needed = vec![false; program.operations().len()];
    let mut stack = outputs.to_vec();
    while let Some(slot) = stack.pop() {
        if !kept.contains_key(&slot) && !needed[slot.index()] {
            needed[slot.index()] = true;
            stack.extend(program.operations()[slot.index()].operands());
        }
    }
    needed
}

/// The displacement and the law, a line each.
fn formulas(spec: &Spec, fields: &Fields) -> Vec<String> {
    let names = spec.coordinates.coordinate_names(spec.dimension);
    let mut lines: Vec<String> = names
        .iter()
        .zip(&spec.displacement)
        .map(|(name, component)| format!("u_{name} = {}", fields.graph.print(*component)))
        .collect();
    lines.extend(spec.rotation.map(|rotation| rotation.formula(&spec.graph)));
    lines.extend(spec.material.formulas(&spec.graph));
    lines
}
