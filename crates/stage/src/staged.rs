//! The pipeline from derived fields to one program in stages.

use crate::block::{Block, Stage, is_computed, needed, numbered};
use crate::field::{Field, FieldName};
use crate::outputs::{Group, Outputs, Single};
use mmsmith_expr::{
    Dependence, Expr, MOST_KEPT_OF_STATES, OperationCount, OperationsByStage, Program, Slot,
};
use mmsmith_spec::{Around, Domain, Fields, HistoryFields, Spec, Surface};
use mmsmith_vocabulary::Law;
use std::collections::BTreeMap;

/// The fields of a solution as one program, and which of its values are kept when.
#[derive(Clone, Debug)]
pub struct Staged {
    program: Program,
    dimension: usize,
    /// The values that are kept for given parameters.
    fixed: Vec<Slot>,
    /// Every field for single evaluations, in the order of [`FieldName::ALL`].
    pub fields: Vec<Field>,
    /// The body force, arranged for evaluation in stages.
    pub body_force: Stages,
    /// The body force at the points of a lattice, where that has a form of its own.
    pub lattice: Option<Lattice>,
    /// Displacement, deformation gradient and stress, in this order; what is kept of a point serves [`Staged::velocity`] too.
    pub state: Stages,
    /// The velocity, which may belong to another time than the state.
    pub velocity: Stages,
    /// The scalars that depend on parameters only.
    pub constants: Constants,
    /// The density at a place, where it depends on it; [`Constants::density`] is that in the middle of the body then.
    pub density_here: Option<Slot>,
    /// The strain energy, where the material is given by one.
    pub energy: Option<Slot>,
    /// The stretch along the directions left out, where there is no stress along them.
    pub across: Option<Slot>,
    /// The derivatives of the stress with respect to each component of the deformation gradient, where they were asked for.
    pub tangent: Vec<Slope>,
    /// The traction on each surface.
    pub tractions: Vec<Traction>,
    /// The two sides of each requirement of the specification.
    pub requirements: Vec<Sides>,
    /// The motion as histories of internal variables need it, where the law has some; then there is no stress and no body force.
    pub history: Option<History>,
}

/// The motion as histories of internal variables need it, see [`HistoryFields`], as a program of its own.
#[derive(Clone, Debug)]
pub struct History {
    /// The values that histories need at each time: the deformation gradient, its rate, and the derivatives of both along each
    /// direction, row by row.
    pub motion: Program,
    /// The acceleration in the same frame, and the frame: `[i][a]`, Cartesian component `i` of its unit vector `a`.
    pub inertia: Program,
    /// The coordinates of the specification that the motion depends on.
    pub coordinates: Vec<bool>,
}

impl History {
    fn new(spec: &Spec, fields: &mut Fields) -> Option<Self> {
        let HistoryFields { a, F, rate, slopes, slopes_of_rate, frame } = fields.history.take()?;
        let all = [F, rate].into_iter().chain(slopes).chain(slopes_of_rate);
        let motion: Vec<Expr> = all.flat_map(|matrix| matrix.concat()).collect();
        let symbols =
            fields.graph.symbols_in(&motion.iter().chain(&a).copied().collect::<Vec<_>>());
        let names = spec.coordinates.coordinate_names(spec.dimension);
        let coordinates = names
            .iter()
            .map(|name| symbols.iter().any(|s| fields.graph.symbol_name(*s) == Some(name)))
            .collect();
        let inertia: Vec<Expr> = a.into_iter().chain(frame.concat()).collect();
        Some(History {
            motion: fields.program(&motion),
            inertia: fields.program(&inertia),
            coordinates,
        })
    }
}

/// Values that are computed in stages, and which values are kept for them.
#[derive(Clone, Debug)]
pub struct Stages {
    outputs: Vec<Slot>,
    time: Vec<Slot>,
    point: Vec<Slot>,
}

/// Values at the points of a lattice, from values of its layers, in stages.
#[derive(Clone, Debug)]
pub struct Lattice {
    outputs: Vec<Slot>,
    /// For each axis the values of a layer, from what is kept of its coordinate and from values of the time, which are those
    /// of all layers.
    layers: Vec<Stages>,
}

/// The scalars that depend on parameters only.
#[derive(Clone, Debug)]
pub struct Constants {
    /// The length that a number of cells divides.
    pub cell_length: Slot,
    /// Mass per reference volume.
    pub density: Slot,
    /// The speed that CFL numbers refer to.
    pub wave_speed: Slot,
    /// The time in which the motion repeats.
    pub period: Slot,
    /// The law with its constants, or the parameters in one that the specification states.
    pub law: Law<Slot>,
    /// The measures of the body.
    pub domain: Measures,
}

/// The measures of the body.
#[derive(Clone, Debug)]
pub enum Measures {
    /// The two corners of a box.
    Box {
        /// The corner of smallest coordinates.
        lower: Vec<Slot>,
        /// The corner of largest coordinates.
        upper: Vec<Slot>,
    },
    /// The two radii of an annulus.
    Annulus {
        /// The smaller.
        inner: Slot,
        /// The larger.
        outer: Slot,
    },
    /// The measures of a tube.
    Tube(TubeMeasures<Slot>),
}

/// The measures of a tube: radii, heights, and where it is a sector angles.
#[derive(Clone, Debug)]
pub struct TubeMeasures<E> {
    /// The inner radius.
    pub inner: E,
    /// The outer radius.
    pub outer: E,
    /// The smallest height.
    pub lower: E,
    /// The largest height.
    pub upper: E,
    /// How far the body reaches around its axis.
    pub around: Around<E>,
}

impl<E> TubeMeasures<E> {
    /// These with `change` applied to each.
    #[must_use]
    pub fn map<S>(self, mut change: impl FnMut(E) -> S) -> TubeMeasures<S> {
        let Self { inner, outer, lower, upper, around } = self;
        TubeMeasures {
            inner: change(inner),
            outer: change(outer),
            lower: change(lower),
            upper: change(upper),
            around: around.map(&mut change),
        }
    }

    /// The measures in the order of the fields.
    #[must_use]
    pub fn list(self) -> Vec<E> {
        let mut list = vec![self.inner, self.outer, self.lower, self.upper];
        list.extend(self.around.angles().into_iter().flatten());
        list
    }
}

/// The traction on a surface.
#[derive(Clone, Debug)]
pub struct Traction {
    /// The surface.
    pub surface: Surface,
    /// Force per reference area, by component.
    pub outputs: Vec<Slot>,
}

/// The derivative of the stress with respect to a component of the deformation gradient.
#[derive(Clone, Debug)]
pub struct Slope {
    /// Row and column of the component.
    pub component: [usize; 2],
    /// Entries of the derivative, row by row.
    pub outputs: Vec<Slot>,
}

/// The sides of a relation between parameters.
#[derive(Clone, Copy, Debug)]
pub struct Sides {
    /// The side before the sign.
    pub left: Slot,
    /// The side after it.
    pub right: Slot,
}

/// How many operations the staged body force takes, by how often they are done.
#[derive(Clone, Copy, Debug)]
pub struct BodyForceOperations {
    /// At points in any order.
    pub stages: OperationsByStage,
    /// In a lattice: for each layer of an axis at each time, and for each point at each time.
    pub lattice: Option<[OperationCount; 2]>,
    /// The values that are kept for each point.
    pub kept: usize,
}

impl BodyForceOperations {
    /// A rough cost of a point at a time, in additions: alone, and in a lattice where there is a form for it.
    #[must_use]
    pub fn work(&self) -> usize {
        let alone = self.stages.both.cost();
        let in_lattice = self.lattice.map_or(alone, |[_, of_point]| of_point.cost());
        alone + in_lattice + self.kept
    }
}

/// The constants among the outputs.
struct ConstantOutputs {
    cell_length: Single,
    density: Single,
    wave_speed: Single,
    period: Single,
    law: Law<Single>,
    domain: DomainOutputs,
}

/// The measures of the body among the outputs.
enum DomainOutputs {
    Box { lower: Group, upper: Group },
    Annulus { inner: Single, outer: Single },
    Tube(TubeMeasures<Single>),
}

impl Staged {
    /// Stages `fields`, which are those of `spec`, or others on a graph that has grown from the specification's own.
    #[must_use]
    pub fn of(spec: &Spec, mut fields: Fields) -> Self {
        let dimension = spec.dimension;
        let history = History::new(spec, &mut fields);
        let mut outputs = Outputs::default();
        let parts = FieldName::ALL.map(|name| (name, outputs.add(name.derived(&fields))));
        // Solvers sample the body force at the same points in every step; a single call does all the work each time.
        let staged = outputs.add(fields.b.iter().copied());
        let density = spec.in_the_middle(&mut fields.graph, spec.density);
        let density_here = (density != spec.density).then(|| outputs.add_one(spec.density));
        let constants = ConstantOutputs::new(spec, density, &mut outputs);
        let energy = fields.W.map(|energy| outputs.add_one(energy));
        let across = fields.across.map(|stretch| outputs.add_one(stretch));
        let tangent: Vec<([usize; 2], Group)> = fields
            .tangent
            .iter()
            .enumerate()
            .flat_map(|(k, row)| row.iter().enumerate().map(move |(L, A)| ([k, L], A)))
            .map(|(component, A)| (component, outputs.add(A.concat())))
            .collect();
        let requirements: Vec<(Single, Single)> = spec
            .requirements
            .iter()
            .map(|r| (outputs.add_one(r.left), outputs.add_one(r.right)))
            .collect();
        let surfaces = std::mem::take(&mut fields.surfaces);
        let tractions: Vec<(Surface, Group)> =
            surfaces.iter().map(|s| (s.surface, outputs.add(s.traction.iter().copied()))).collect();

        let program = fields.program(outputs.expressions()).with_gathered_factors(staged.places());
        let separated = program.with_separated_coordinates(staged.places(), dimension);
        let program = separated.unwrap_or(program);
        let separated = program.outputs()[outputs.expressions().len()..].to_vec();

        let fields = parts.map(|(name, group)| Field { name, outputs: group.slots(&program) });
        let fixed = fixed_slots(&program);
        let stages = |outputs: Vec<Slot>, point| {
            let time = time_slots(&program, &fixed, &outputs);
            Stages { outputs, time, point }
        };
        let staged = staged.slots(&program);
        let at_points = program.kept_at_points(&staged, usize::MAX);
        let body_force = stages(staged, at_points);
        let lattice =
            (!separated.is_empty()).then(|| Lattice::new(&program, &fixed, separated, dimension));
        let of = |names: &[FieldName]| -> Vec<Slot> {
            let fields = fields.iter().filter(|field| names.contains(&field.name));
            fields.flat_map(|field| field.outputs.clone()).collect()
        };
        let state = of(&[
            FieldName::Displacement,
            FieldName::DeformationGradient,
            FieldName::FirstPiolaKirchhoff,
        ]);
        let velocity = of(&[FieldName::Velocity]);
        let mut both: Vec<Slot> = state.iter().chain(&velocity).copied().collect();
        both.sort_unstable();
        let at_points = program.kept_at_points(&both, MOST_KEPT_OF_STATES);
        Staged {
            state: stages(state, at_points.clone()),
            velocity: stages(velocity, at_points),
            body_force,
            lattice,
            constants: constants.slots(&program),
            density_here: density_here.map(|density| density.slot(&program)),
            energy: energy.map(|energy| energy.slot(&program)),
            across: across.map(|stretch| stretch.slot(&program)),
            tangent: tangent
                .into_iter()
                .map(|(component, group)| Slope { component, outputs: group.slots(&program) })
                .collect(),
            requirements: requirements
                .into_iter()
                .map(|(left, right)| Sides {
                    left: left.slot(&program),
                    right: right.slot(&program),
                })
                .collect(),
            tractions: tractions
                .into_iter()
                .map(|(surface, group)| Traction { surface, outputs: group.slots(&program) })
                .collect(),
            history,
            fields: fields.into(),
            fixed,
            program,
            dimension,
        }
    }

    /// All operations.
    #[must_use]
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// The entries of a field for single evaluations, row by row.
    #[must_use]
    pub fn field(&self, name: FieldName) -> &[Slot] {
        let field = self.fields.iter().find(|field| field.name == name);
        field.map_or(&[], |field| &field.outputs)
    }

    /// The values that the stage of the parameters keeps.
    #[must_use]
    pub fn fixed(&self) -> &[Slot] {
        &self.fixed
    }

    /// How many values the stage of the parameters keeps.
    #[must_use]
    pub fn fixed_count(&self) -> usize {
        self.fixed.len()
    }

    /// The values that the stage of the parameters keeps, after the two sides of each requirement.
    #[must_use]
    pub fn fixed_stage(&self) -> Block<'_> {
        let sides = self.requirements.iter().flat_map(|sides| [sides.left, sides.right]);
        self.block(&[], sides.chain(self.fixed.iter().copied()).collect())
    }

    /// Values of the time that `stages` keep.
    #[must_use]
    pub fn time_stage(&self, stages: &Stages) -> Block<'_> {
        self.after_parameters(&stages.time)
    }

    /// Values of a point that `stages` keep.
    #[must_use]
    pub fn point_stage(&self, stages: &Stages) -> Block<'_> {
        self.after_parameters(&stages.point)
    }

    /// The values of `stages` from what all of them keep.
    #[must_use]
    pub fn staged(&self, stages: &Stages) -> Block<'_> {
        let kept = [
            (Stage::Fixed, self.fixed.as_slice()),
            (Stage::Time, &stages.time),
            (Stage::Point, &stages.point),
        ];
        self.block(&kept, stages.outputs.clone())
    }

    /// The body force at a point of a lattice from the values of its layers.
    #[must_use]
    pub fn of_layers(&self, lattice: &Lattice) -> Block<'_> {
        let layers = lattice.layers.iter().enumerate();
        let layers = layers.map(|(axis, stages)| (Stage::Layer(axis), stages.outputs.as_slice()));
        let uniform = [(Stage::Fixed, self.fixed.as_slice()), (Stage::Time, lattice.time())];
        let kept: Vec<_> = uniform.into_iter().chain(layers).collect();
        self.block(&kept, lattice.outputs.clone())
    }

    /// `outputs` from the coordinates, the time, and what the stage of the parameters keeps.
    #[must_use]
    pub fn after_parameters(&self, outputs: &[Slot]) -> Block<'_> {
        self.block(&[(Stage::Fixed, &self.fixed)], outputs.to_vec())
    }

    /// All fields, in their order.
    #[must_use]
    pub fn all_fields(&self) -> Block<'_> {
        let outputs: Vec<Slot> = self.fields.iter().flat_map(|f| f.outputs.clone()).collect();
        self.after_parameters(&outputs)
    }

    /// How many operations the staged body force takes.
    #[must_use]
    pub fn body_force_operations(&self) -> BodyForceOperations {
        let Stages { outputs, point, .. } = &self.body_force;
        let lattice = self.lattice.as_ref();
        BodyForceOperations {
            stages: self.program.operations_with_kept(outputs, point),
            lattice: lattice
                .map(|l| self.program.operations_in_lattice(&l.outputs, self.dimension)),
            kept: point.len(),
        }
    }

    fn block(&self, stages: &[(Stage, &[Slot])], outputs: Vec<Slot>) -> Block<'_> {
        let kept = stages.iter().flat_map(|&(stage, slots)| numbered(stage, slots)).collect();
        Block::new(&self.program, self.dimension, kept, outputs)
    }
}

impl Lattice {
    fn new(program: &Program, fixed: &[Slot], outputs: Vec<Slot>, dimension: usize) -> Self {
        let layers = program.layers(&outputs, dimension);
        let all: Vec<Slot> = layers.concat().into_iter().chain(outputs.iter().copied()).collect();
        let time = time_slots(program, fixed, &all);
        let of_axis = |outputs: Vec<Slot>| {
            let point = program.kept_at_points(&outputs, usize::MAX);
            Stages { outputs, time: time.clone(), point }
        };
        Lattice { outputs, layers: layers.into_iter().map(of_axis).collect() }
    }

    /// How the values of a layer are computed, for each axis.
    #[must_use]
    pub fn layers(&self) -> &[Stages] {
        &self.layers
    }

    /// The body force at a point.
    #[must_use]
    pub fn outputs(&self) -> &[Slot] {
        &self.outputs
    }

    fn time(&self) -> &[Slot] {
        self.layers.first().map_or(&[], |layer| &layer.time)
    }
}

impl Stages {
    /// The values that are computed.
    #[must_use]
    pub fn outputs(&self) -> &[Slot] {
        &self.outputs
    }

    /// The values that are kept of a point.
    #[must_use]
    pub fn point(&self) -> &[Slot] {
        &self.point
    }

    /// How many values are computed.
    #[must_use]
    pub fn output_count(&self) -> usize {
        self.outputs.len()
    }

    /// How many values are kept of the time.
    #[must_use]
    pub fn time_count(&self) -> usize {
        self.time.len()
    }

    /// How many values are kept of a point.
    #[must_use]
    pub fn point_count(&self) -> usize {
        self.point.len()
    }
}

impl ConstantOutputs {
    fn new(spec: &Spec, density: Expr, outputs: &mut Outputs) -> Self {
        ConstantOutputs {
            cell_length: outputs.add_one(spec.cell_length),
            density: outputs.add_one(density),
            wave_speed: outputs.add_one(spec.wave_speed),
            period: outputs.add_one(spec.period),
            law: spec.law_for_solver().map(|value| outputs.add_one(value)),
            domain: match &spec.domain {
                Domain::Box { lower, upper } => DomainOutputs::Box {
                    lower: outputs.add(lower.iter().copied()),
                    upper: outputs.add(upper.iter().copied()),
                },
                Domain::Annulus { inner, outer } => DomainOutputs::Annulus {
                    inner: outputs.add_one(*inner),
                    outer: outputs.add_one(*outer),
                },
                &Domain::Tube { inner, outer, lower, upper, around } => {
                    let measures = TubeMeasures { inner, outer, lower, upper, around };
                    DomainOutputs::Tube(measures.map(|expr| outputs.add_one(expr)))
                }
            },
        }
    }

    fn slots(self, program: &Program) -> Constants {
        Constants {
            cell_length: self.cell_length.slot(program),
            density: self.density.slot(program),
            wave_speed: self.wave_speed.slot(program),
            period: self.period.slot(program),
            law: self.law.map(|of| of.slot(program)),
            domain: match self.domain {
                DomainOutputs::Box { lower, upper } => {
                    Measures::Box { lower: lower.slots(program), upper: upper.slots(program) }
                }
                DomainOutputs::Annulus { inner, outer } => {
                    Measures::Annulus { inner: inner.slot(program), outer: outer.slot(program) }
                }
                DomainOutputs::Tube(measures) => {
                    Measures::Tube(measures.map(|of| of.slot(program)))
                }
            },
        }
    }
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

/// Values of the time alone that `outputs` need beside the values in `fixed`: those read where time and position come together, and
/// results.
fn time_slots(program: &Program, fixed: &[Slot], outputs: &[Slot]) -> Vec<Slot> {
    let fixed: BTreeMap<Slot, ()> = fixed.iter().map(|&slot| (slot, ())).collect();
    let needed = needed(program, &fixed, outputs);
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
