//! The program whose outputs are judged, and the box of its inputs.

use crate::interval::Interval;
use crate::propagate::Judgement;
use crate::scaling::{Scaling, scalings};
use crate::{CertifyError, Roundings};
use mmsmith_expr::{Program, Slot};
use mmsmith_spec::{Domain, Fields, Relation, Spec};
use mmsmith_stage::{Measures, Staged};

/// Parameters without bounds on both sides vary by this share of their defaults, as points of `mms check --thorough` do.
const SHARE_OF_DEFAULT: f64 = 0.4;
/// Parameters with bounds on both sides vary over this share of their admissible range, around its middle.
const SHARE_OF_ADMITTED: f64 = 0.8;

/// An output of the program.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judged {
    /// The letter of the field.
    pub field: &'static str,
    /// The entry, row by row from 0.
    pub entry: usize,
    /// Its place in the program.
    pub slot: Slot,
}

/// A program, its outputs, and the range of each input.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The name of the solution.
    pub solution: String,
    /// The operations that the fields have in generated code.
    pub program: Program,
    /// The outputs to judge.
    pub judged: Vec<Judged>,
    /// The names of the inputs: coordinates, time, parameters.
    pub inputs: Vec<String>,
    /// The inputs that are taken as one.
    pub scalings: Vec<Scaling>,
    /// The range of each input; inputs that are scaled out have the range one.
    pub bounds: Vec<Interval>,
}

impl Subject {
    /// The fields of `spec` over its body, a period, and ranges of its parameters: those of `ranges` by name, else 40 % around
    /// the default, on both sides of zero for an amplitude `A`, and of a parameter that is bounded on both sides the middle four
    /// fifths. Where units allow, positive parameters are taken as one (see [`Scaling`]).
    ///
    /// # Errors
    ///
    /// [`CertifyError`] where a field is nowhere defined, or a range is empty.
    pub fn new(spec: &Spec, ranges: &[(String, f64, f64)]) -> Result<Self, CertifyError> {
        let fields = spec.derive().map_err(|error| CertifyError::Derive(error.to_string()))?;
        let (program, judged, measures) = program(spec, fields.clone());
        let inputs: Vec<String> = fields
            .inputs
            .iter()
            .map(|(input, _)| fields.graph.symbol_name(*input).unwrap_or("?").to_owned())
            .collect();
        if let Some((name, ..)) = ranges.iter().find(|(name, ..)| !inputs.contains(name)) {
            return Err(CertifyError::Range(format!(
                "there is no input {name}; there are {}",
                inputs.join(", ")
            )));
        }
        if let Some((name, from, to)) =
            ranges.iter().find(|(_, from, to)| !(from.is_finite() && to.is_finite() && from <= to))
        {
            return Err(CertifyError::Range(format!("{name}: {from}:{to} is no range")));
        }
        let first = spec.dimension + 1;
        let chosen = |index: usize| ranges.iter().find(|(name, ..)| *name == inputs[index]);
        let positive: Vec<usize> = spec
            .parameters
            .iter()
            .enumerate()
            .filter(|(n, p)| {
                chosen(first + n).is_none()
                    && p.bounds.len() == 1
                    && p.bounds.iter().all(|b| b.relation == Relation::Greater && b.limit >= 0.0)
            })
            .map(|(n, _)| first + n)
            .collect();
        let scalings = scalings(&program, inputs.len(), &positive);
        let mut bounds = vec![Interval::ZERO; inputs.len()];
        for (n, parameter) in spec.parameters.iter().enumerate() {
            let scaled = scalings.iter().any(|scaling| scaling.input == first + n);
            bounds[first + n] = if scaled { Interval::ONE } else { usual_range(parameter) };
        }
        let override_with = |bounds: &mut [Interval], indices: std::ops::Range<usize>| {
            for index in indices {
                if let Some((_, from, to)) = chosen(index) {
                    bounds[index] = Interval::new(*from, *to);
                }
            }
        };
        override_with(&mut bounds, first..inputs.len());
        // The period and the measures of the body, for all of these parameters.
        let roundings = Roundings::default();
        let mut ends = Vec::new();
        for &slot in measures.outputs() {
            let range = Judgement::new(&measures, slot, &roundings)?.range(&bounds);
            ends.push(range.unwrap_or(Interval::ZERO));
        }
        let around = |low: Interval, high: Interval| Interval::new(low.low, high.high);
        bounds[spec.dimension] = around(Interval::ZERO, ends[0]);
        for axis in 0..spec.dimension {
            bounds[axis] = match &spec.domain {
                Domain::Box { .. } => around(ends[1 + axis], ends[1 + spec.dimension + axis]),
                Domain::Annulus { .. } => around(Interval::ZERO, ends[2]),
                Domain::Tube { .. } if axis < 2 => around(Interval::ZERO, ends[2]),
                Domain::Tube { .. } => around(ends[3], ends[4]),
            };
        }
        override_with(&mut bounds, 0..first);
        Ok(Self { solution: spec.name.clone(), program, judged, inputs, scalings, bounds })
    }

    /// An input in units of the inputs that are taken as one, as `t E^0.5 L^-1`.
    #[must_use]
    pub fn scaled_name(&self, input: usize) -> String {
        let mut name = self.inputs[input].clone();
        for scaling in self.scalings.iter().filter(|scaling| scaling.input != input) {
            let exponent = -scaling.exponents[input];
            if exponent != 0.0 {
                name += &format!(" {}^{exponent}", self.inputs[scaling.input]);
            }
        }
        name
    }

    /// Ranges of the inputs in words, without the inputs that are taken as one.
    #[must_use]
    pub fn place(&self, bounds: &[Interval]) -> String {
        let words = bounds.iter().enumerate().filter_map(|(input, bounds)| {
            let scaled = self.scalings.iter().any(|scaling| scaling.input == input);
            let name = self.scaled_name(input);
            let (low, high) = (bounds.low, bounds.high);
            match (scaled, low == high) {
                (true, _) => None,
                (false, true) => Some(format!("{name} = {low}")),
                (false, false) => Some(format!("{name} in [{low}, {high}]")),
            }
        });
        words.collect::<Vec<_>>().join(", ")
    }
}

/// The program of all fields in the form that a single evaluation has in generated code, its outputs by name, and the program
/// of the period and the measures of the body.
fn program(spec: &Spec, fields: Fields) -> (Program, Vec<Judged>, Program) {
    let staged = Staged::of(spec, fields);
    let slots: Vec<Slot> = staged.fields.iter().flat_map(|f| f.outputs.clone()).collect();
    let program = staged.program().part(&slots);
    let names = staged
        .fields
        .iter()
        .flat_map(|field| (0..field.outputs.len()).map(|entry| (field.name.letter(), entry)));
    let judged = names
        .zip(program.outputs())
        .map(|((field, entry), &slot)| Judged { field, entry, slot })
        .collect();
    let mut measures = vec![staged.constants.period];
    match &staged.constants.domain {
        Measures::Box { lower, upper } => measures.extend(lower.iter().chain(upper)),
        Measures::Annulus { inner, outer } => measures.extend([inner, outer]),
        Measures::Tube(of) => measures.extend(of.clone().list()),
    }
    (program, judged, staged.program().part(&measures))
}

fn usual_range(parameter: &mmsmith_spec::Parameter) -> Interval {
    let limit = |below: bool| {
        parameter
            .bounds
            .iter()
            .find(|b| matches!(b.relation, Relation::Less | Relation::LessOrEqual) != below)
            .map(|bound| bound.limit)
    };
    if let (Some(low), Some(high)) = (limit(true), limit(false)) {
        let (middle, half) = (0.5 * (low + high), 0.5 * SHARE_OF_ADMITTED * (high - low));
        return Interval::new(middle - half, middle + half);
    }
    let default = parameter.default;
    let (low, high) = ((1.0 - SHARE_OF_DEFAULT) * default, (1.0 + SHARE_OF_DEFAULT) * default);
    if parameter.name == "A" {
        Interval::new(-high.abs(), high.abs())
    } else {
        Interval::new(low.min(high), low.max(high))
    }
}
