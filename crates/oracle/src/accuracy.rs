//! The worst factor of the acceptance rule, by field and class of inputs.

use crate::double_double::QuickTruth;
use crate::{
    Class, Oracle, OracleError, Point, Sampler, Sensitivity, exact, scientific, units, worst_factor,
};
use mmsmith_expr::{Expr, Function, Node, Program, Rational, Slot, nearest_f64};
use mmsmith_spec::{Fields, Spec};
use mmsmith_stage::{FieldName, Staged};
use num_traits::Signed;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use thiserror::Error;

/// The factor `K` that every entry of every field keeps at points that are drawn.
pub const LARGEST_FACTOR: f64 = 8.0;
/// The error that every field keeps at every point of the body, in units of `2^-53` of its size there.
///
/// The size of a field is its largest entry, and the largest answer of an entry to its inputs. Where the factor of 8 is kept so are these
/// units; they also hold where an entry almost vanishes with its slopes.
pub const LARGEST_UNITS: f64 = 16.0;

/// Digits that the truth has at a place that is reported or doubtful.
const DIGITS: usize = 40;
/// Digits of the truth that are enough for two digits of the factor.
const QUICK_DIGITS: usize = 20;
/// The precision of the first look at a point.
const QUICK_BITS: usize = 192;
/// From this factor on the first look is not believed.
pub(crate) const DOUBTFUL_FACTOR: f64 = 3.0;

/// Where amplitudes are tiny, so that squares of them are next to the smallest doubles, and far from the body, where
/// exponentials are, what is smaller than this is not judged: its parts have lost their digits to the range of the format,
/// whatever the formula. Elsewhere it is judged where the result is larger.
const SMALLEST_JUDGED: f64 = 1e-280;

/// Where so many draws in a row find nothing that suits, a class is given up.
const FIRST_DRAWS: u64 = 8;

/// The fields that are judged: each with its letter and its entries, row by row.
pub type Judged = Vec<(&'static str, Vec<f64>)>;

/// The code under test: the fields at inputs.
pub type JudgedCode<'a> = &'a (dyn Fn(&[f64]) -> Result<Judged, String> + Sync);

/// Why accuracy could not be measured.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum AccuracyError {
    /// The oracle has no value at a point.
    #[error("there is no exact value at {place}: {error}")]
    Oracle {
        /// The inputs.
        place: String,
        /// The reason.
        error: OracleError,
    },
    /// The code under test gave no fields, or other ones.
    #[error("the fields could not be evaluated at {place}: {reason}")]
    Evaluation {
        /// The inputs.
        place: String,
        /// The reason.
        reason: String,
    },
}

/// How a point came to be judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Found {
    /// Drawn at random.
    Draw,
    /// By a [`Search`](crate::Search) for the largest factor.
    Search,
}

/// The worst factor of one field in one class.
#[derive(Clone, Debug, PartialEq)]
pub struct Worst {
    /// The letter of the field; `b staged` and the like for those by way of stages, `b lattice` for points of a lattice.
    pub field: &'static str,
    /// The entry, row by row from 0.
    pub entry: usize,
    /// The factor `K`; infinite where the result is not finite.
    pub factor: f64,
    /// The error in units of `2^-53` of the field's size at the point, see [`LARGEST_UNITS`].
    pub units: f64,
    /// The inputs: position, time, parameters.
    pub inputs: Vec<f64>,
    /// How the point was found.
    pub found: Found,
    /// Whether the point is outside of the body.
    pub outside: bool,
    /// The result of the code.
    pub result: f64,
    /// The exact value, to 20 digits.
    pub exact: String,
    /// The sum of `|q dy/dq|` over the inputs, to 4 digits.
    pub sensitivity: String,
}

/// The accuracy of all fields in one class.
#[derive(Clone, Debug, PartialEq)]
pub struct ClassAccuracy {
    /// The class.
    pub class: Class,
    /// The points that were drawn and judged.
    pub points: usize,
    /// The evaluations of a search.
    pub searched: u64,
    /// The points that were drawn or searched and left out, as they lie within rounding of the switch of a positive part, where
    /// its slope jumps and nothing tells which side is meant.
    pub at_switch: u64,
    /// Why there are none, or fewer than were asked for.
    pub remark: Option<&'static str>,
    /// The worst of each field.
    pub worst: Vec<Worst>,
}

/// Judges code against exact values.
///
/// The truth at a point comes from one evaluation in some 60 digits, and sensitivities from double precision, which is
/// enough for two digits of `K`. Wherever `K` comes out above 3, and at the worst point of each field, both are computed
/// anew in arbitrary precision, the truth until 40 digits stand still.
pub struct Accuracy<'a> {
    fields: Fields,
    sampler: Sampler<'a>,
    spec: &'a Spec,
    /// Letter and expressions of each field.
    expressions: Vec<(&'static str, Vec<Expr>)>,
    /// All expressions, field after field.
    flat: Vec<Expr>,
    inputs: Vec<Expr>,
    sensitivity: Sensitivity,
    quick_sensitivity: Program,
    quick_truth: QuickTruth,
    /// Arguments of positive parts, and the products of [`Sensitivity`] for them with their number.
    switches: (Program, Program, Vec<usize>),
    /// How many products [`Sensitivity`] has for each expression.
    products: Vec<usize>,
    /// Why there are no points of each class, once it is known.
    not_applicable: [OnceLock<Option<&'static str>>; Class::ALL.len()],
}

/// One entry at one point.
pub(crate) struct Finding {
    pub(crate) field: usize,
    pub(crate) entry: usize,
    pub(crate) factor: f64,
}

impl<'a> Accuracy<'a> {
    /// Prepares the judgement of `spec`, whose fields are `fields`.
    #[must_use]
    pub fn new(spec: &'a Spec, mut fields: Fields) -> Self {
        let expressions = by_letter(&fields);
        let flat: Vec<Expr> = expressions.iter().flat_map(|(_, e)| e.clone()).collect();
        let inputs: Vec<Expr> = fields.inputs.iter().map(|(e, _)| *e).collect();
        let sampler = Sampler::new(spec, &mut fields);
        let sensitivity = Sensitivity::new(&fields.graph, &fields.definitions, &inputs, &flat);
        let (quick_sensitivity, products) = sensitivity.in_doubles(&inputs);
        let quick_truth = QuickTruth::new(fields.program(&flat));
        let parts = fields.graph.reachable(&flat);
        let switched: BTreeSet<Expr> = parts
            .into_iter()
            .filter_map(|part| match fields.graph.node(part) {
                Node::Call(Function::PositivePart | Function::PositivePartSlope, x) => Some(x[0]),
                _ => None,
            })
            .collect();
        let switched: Vec<Expr> = switched.into_iter().collect();
        let of_switches = Sensitivity::new(&fields.graph, &fields.definitions, &inputs, &switched);
        let (of_switches, counts) = of_switches.in_doubles(&inputs);
        let switches = (fields.program(&switched), of_switches, counts);
        Accuracy {
            fields,
            sampler,
            spec,
            expressions,
            flat,
            inputs,
            sensitivity,
            quick_sensitivity,
            quick_truth,
            switches,
            products,
            not_applicable: Default::default(),
        }
    }

    /// The programs of which generated code is made, in the form that [`Accuracy::measure`] judges.
    #[must_use]
    pub fn programs(&self) -> Vec<(&'static str, Program)> {
        programs(&Staged::of(self.spec, self.fields.clone()))
    }

    /// Exact values of every entry of every field, field after field.
    pub(crate) fn truth(
        &self,
        oracle: &mut Oracle,
        inputs: &[f64],
    ) -> Result<Vec<Rational>, AccuracyError> {
        let values = self.exact_inputs(inputs);
        let truth = oracle.evaluate(&self.point(&values), &self.flat);
        truth.map_err(|error| self.no_value(inputs, error))
    }

    /// The answer of one entry to the inputs, in arbitrary precision.
    pub(crate) fn answer(&self, inputs: &[f64], place: usize) -> Option<f64> {
        let mut oracle = Oracle::new(128).ok()?;
        let values = self.exact_inputs(inputs);
        let answer = self.sensitivity.evaluate_one(&mut oracle, &values, place).ok()?;
        Some(nearest_f64(&answer))
    }

    /// The letters of the fields that are judged.
    pub(crate) fn letters(&self) -> impl Iterator<Item = &'static str> {
        self.expressions.iter().map(|(letter, _)| *letter)
    }

    /// Judges `points` points of `class`; `judged` gives the fields at inputs, and `step` is called after each point.
    ///
    /// The result does not depend on the number of threads.
    ///
    /// # Errors
    ///
    /// [`AccuracyError`] at the first point, by number, where `judged` or the oracle fails.
    pub fn measure(
        &self,
        class: Class,
        points: usize,
        judged: JudgedCode<'_>,
        step: &(dyn Fn() + Sync),
    ) -> Result<ClassAccuracy, AccuracyError> {
        let none = |remark| ClassAccuracy {
            class,
            points: 0,
            searched: 0,
            at_switch: 0,
            remark: Some(remark),
            worst: Vec::new(),
        };
        if let Some(remark) = self.not_applicable(class) {
            return Ok(none(remark));
        }
        let at_switch = AtomicU64::new(0);
        let found: Vec<Result<Option<Vec<Finding>>, AccuracyError>> = (0..points as u64)
            .into_par_iter()
            .map_init(
                || Oracle::new(QUICK_BITS),
                |oracle, index| {
                    let Some(inputs) = self.sampler.draw(class, index) else { return Ok(None) };
                    if self.is_at_switch(&inputs) {
                        at_switch.fetch_add(1, Ordering::Relaxed);
                        return Ok(None);
                    }
                    let oracle = oracle.as_mut().map_err(|e| self.no_value(&inputs, e.clone()))?;
                    let findings = self.look(class, oracle, &inputs, judged);
                    step();
                    match findings {
                        // Outside of the body, and late in a motion that does not repeat, a function such as exp may leave
                        // every range.
                        Err(AccuracyError::Oracle { error: OracleError::Range { .. }, .. })
                            if matches!(class, Class::Far | Class::Late) =>
                        {
                            Ok(None)
                        }
                        // Where two stretches pass zero together, J stays positive in an inverted body, in which
                        // a law need not have a value; nor far from the body, nor on a face where a slope is infinite.
                        Err(AccuracyError::Oracle {
                            error: OracleError::Domain { .. }, ..
                        }) if matches!(
                            class,
                            Class::NearInversion | Class::Far | Class::Boundary
                        ) =>
                        {
                            Ok(None)
                        }
                        findings => findings.map(Some),
                    }
                },
            )
            .collect();
        let mut worst: Vec<Option<(u64, Finding)>> =
            self.expressions.iter().map(|_| None).collect();
        let mut count = 0;
        for (index, findings) in found.into_iter().enumerate() {
            let Some(findings) = findings? else { continue };
            count += 1;
            for finding in findings {
                let known = &mut worst[finding.field];
                if known.as_ref().is_none_or(|(_, known)| finding.factor > known.factor) {
                    *known = Some((index as u64, finding));
                }
            }
        }
        let remark = (count < points).then_some("draws that do not suit were left out");
        let mut confirmed: Vec<Worst> = Vec::new();
        for (index, finding) in worst.into_iter().flatten() {
            let inputs = self.sampler.draw(class, index).unwrap_or_default();
            let worst = self.confirm(&inputs, &finding, Found::Draw, &confirmed, judged)?;
            confirmed.push(worst);
        }
        let at_switch = at_switch.into_inner();
        Ok(ClassAccuracy { class, points: count, searched: 0, at_switch, remark, worst: confirmed })
    }

    /// Judges one point: the worst entry of each field there, in arbitrary precision.
    ///
    /// # Errors
    ///
    /// As [`Accuracy::measure`].
    pub fn at(&self, inputs: &[f64], judged: JudgedCode<'_>) -> Result<Vec<Worst>, AccuracyError> {
        let results = self.results(inputs, judged)?;
        let mut all: Vec<Worst> = Vec::new();
        for (field, results) in results.iter().enumerate() {
            let mut entries = Vec::new();
            for entry in 0..results.len() {
                let finding = Finding { field, entry, factor: 0.0 };
                entries.push(self.confirm(inputs, &finding, Found::Draw, &all, judged)?);
            }
            all.extend(entries.into_iter().max_by(|a, b| a.factor.total_cmp(&b.factor)));
        }
        Ok(all)
    }

    /// The worst entry of each field at one point.
    fn look(
        &self,
        class: Class,
        oracle: &mut Oracle,
        inputs: &[f64],
        judged: JudgedCode<'_>,
    ) -> Result<Vec<Finding>, AccuracyError> {
        let results = self.results(inputs, judged)?;
        let values = self.exact_inputs(inputs);
        let point = self.point(&values);
        let truth =
            oracle.evaluate(&point, &self.flat).map_err(|error| self.no_value(inputs, error))?;
        let terms = self.quick_sensitivity.evaluate(inputs);
        let mut terms = terms.iter();
        let mut truth = truth.iter();
        let mut products = self.products.iter();
        let may_underflow = class.may_underflow();
        let mut findings = Vec::new();
        // What was judged before at this point: stages often give a single call's bits.
        let mut seen: Vec<(Expr, u64, f64)> = Vec::new();
        let mut expressions = self.flat.iter();
        for (field, results) in results.iter().enumerate() {
            let mut worst = Finding { field, entry: 0, factor: -1.0 };
            for (entry, &result) in results.iter().enumerate() {
                let (Some(truth), Some(&count), Some(&expression)) =
                    (truth.next(), products.next(), expressions.next())
                else {
                    break;
                };
                let sens: f64 = terms.by_ref().take(count).map(|term| term.abs()).sum();
                let quick = exact(sens).map(|sens| worst_factor(result, truth, &sens));
                let known = seen.iter().find(|s| (s.0, s.1) == (expression, result.to_bits()));
                let factor = match quick {
                    _ if known.is_some() => known.map_or(f64::NAN, |known| known.2),
                    _ if sens < SMALLEST_JUDGED
                        && (may_underflow || result.abs() < SMALLEST_JUDGED) =>
                    {
                        0.0
                    }
                    Some(factor) if factor < DOUBTFUL_FACTOR => factor,
                    _ => self.settled(inputs, field, entry, result)?.0,
                };
                seen.push((expression, result.to_bits(), factor));
                if factor > worst.factor {
                    worst = Finding { field, entry, factor };
                }
            }
            findings.push(worst);
        }
        Ok(findings)
    }

    /// Whether what a positive part is taken of is no larger than the rounding that the acceptance rule allows it.
    pub(crate) fn is_at_switch(&self, inputs: &[f64]) -> bool {
        let (values, sensitivities, counts) = &self.switches;
        let (values, terms) = (values.evaluate(inputs), sensitivities.evaluate(inputs));
        let mut terms = terms.iter();
        values.iter().zip(counts).any(|(value, &count)| {
            let sens: f64 = terms.by_ref().take(count).map(|term| term.abs()).sum();
            value.abs() < LARGEST_FACTOR * 0.5 * f64::EPSILON * (sens + value.abs())
        })
    }

    /// The sum `|q dy/dq|` for every entry of every field, in double precision.
    pub(crate) fn quick_sensitivities(&self, inputs: &[f64]) -> Vec<f64> {
        let terms = self.quick_sensitivity.evaluate(inputs);
        let mut terms = terms.iter();
        let sum = |&count: &usize| terms.by_ref().take(count).map(|term| term.abs()).sum();
        self.products.iter().map(sum).collect()
    }

    /// The worst entry of each field at one point, in some 100 bits, with sensitivities that were computed there or within a few
    /// units in the last place. The factor is infinite where nothing can be said without the oracle.
    pub(crate) fn quick_look(
        &self,
        class: Class,
        inputs: &[f64],
        sensitivities: &[f64],
        judged: JudgedCode<'_>,
    ) -> Result<Vec<Finding>, AccuracyError> {
        let results = self.results(inputs, judged)?;
        let truth = self.quick_truth.evaluate(inputs);
        let mut all = truth.iter().zip(sensitivities);
        let mut findings = Vec::with_capacity(results.len());
        for (field, results) in results.iter().enumerate() {
            let mut worst = Finding { field, entry: 0, factor: -1.0 };
            for (entry, (&result, (truth, &sens))) in results.iter().zip(&mut all).enumerate() {
                let error = ((result - truth.high) - truth.low).abs();
                let bound = 0.5 * f64::EPSILON * (sens + truth.high.abs());
                let is_small = class.may_underflow() || result.abs() < SMALLEST_JUDGED;
                let factor = if is_small && sens < SMALLEST_JUDGED || error == 0.0 {
                    0.0
                } else if bound.is_finite() && !error.is_nan() {
                    error / bound.max(f64::from_bits(1))
                } else if class.may_underflow() {
                    // What left the range of the format on the way is the commonest cause there.
                    0.0
                } else {
                    f64::INFINITY
                };
                if factor > worst.factor {
                    worst = Finding { field, entry, factor };
                }
            }
            findings.push(worst);
        }
        Ok(findings)
    }

    /// Why there are no points of this class; `None` where there are some.
    #[must_use]
    pub fn not_applicable(&self, class: Class) -> Option<&'static str> {
        let find = || {
            let remark = self.sampler.not_applicable(class);
            if remark.is_some() {
                return remark;
            }
            let fails = |index| self.sampler.draw(class, index).is_none();
            (0..FIRST_DRAWS).into_par_iter().all(fails).then_some(match class {
                Class::NearInversion => {
                    "the bounds of the parameters keep the smallest stretch above 1e-2"
                }
                _ => "the body would be inverted there",
            })
        };
        // Draws that fail take long.
        *self.not_applicable[class as usize].get_or_init(find)
    }

    /// The factor of one entry with enough digits of the truth for it and the sensitivity in double precision; `None` where there is
    /// no value.
    pub(crate) fn looked_up(
        &self,
        inputs: &[f64],
        finding: &Finding,
        judged: JudgedCode<'_>,
    ) -> Result<Option<f64>, AccuracyError> {
        let result = self.results(inputs, judged)?[finding.field][finding.entry];
        let before: usize = self.expressions[..finding.field].iter().map(|(_, e)| e.len()).sum();
        let place = before + finding.entry;
        let values = self.exact_inputs(inputs);
        let truth = Oracle::new(QUICK_BITS).and_then(|mut oracle| {
            oracle.settle(&self.point(&values), &self.flat[place..=place], QUICK_DIGITS)
        });
        // Far from the body, late, and in an inverted body a function may have no value.
        let Ok(truth) = truth else { return Ok(None) };
        let sens = self.quick_sensitivities(inputs)[place];
        Ok(match exact(sens) {
            Some(sens) => Some(worst_factor(result, &truth[0], &sens)),
            None => match self.settled(inputs, finding.field, finding.entry, result) {
                Ok((factor, ..)) => Some(factor),
                Err(_) => None,
            },
        })
    }

    /// The sampler that points are drawn from.
    pub(crate) fn sampler(&self) -> &Sampler<'a> {
        &self.sampler
    }

    /// The number of fields that are judged, each in one form.
    pub(crate) fn field_count(&self) -> usize {
        self.expressions.len()
    }

    /// The place of a field among those that are judged.
    pub(crate) fn field_index(&self, letter: &str) -> Option<usize> {
        self.expressions.iter().position(|(known, _)| *known == letter)
    }

    /// The factor of one entry, its exact value and its sensitivity, in arbitrary precision.
    pub(crate) fn settled(
        &self,
        inputs: &[f64],
        field: usize,
        entry: usize,
        result: f64,
    ) -> Result<(f64, Rational, Rational), AccuracyError> {
        let values = self.exact_inputs(inputs);
        let place: usize =
            self.expressions[..field].iter().map(|(_, e)| e.len()).sum::<usize>() + entry;
        let settle = || -> Result<(Rational, Rational), OracleError> {
            let truth = Oracle::new(Oracle::USUAL_BITS)?.settle(
                &self.point(&values),
                &self.flat[place..=place],
                DIGITS,
            )?;
            let sens = self.sensitivity.evaluate_one(&mut Oracle::new(128)?, &values, place)?;
            Ok((truth.into_iter().next().unwrap_or_default(), sens))
        };
        let (truth, sens) = settle().map_err(|error| self.no_value(inputs, error))?;
        Ok((worst_factor(result, &truth, &sens), truth, sens))
    }

    /// The finding in arbitrary precision, unless one of those `known` is the same number at the same place.
    pub(crate) fn confirm(
        &self,
        inputs: &[f64],
        finding: &Finding,
        found: Found,
        known: &[Worst],
        judged: JudgedCode<'_>,
    ) -> Result<Worst, AccuracyError> {
        let result = self.results(inputs, judged)?[finding.field][finding.entry];
        let (field, entries) = &self.expressions[finding.field];
        let expression_of = |worst: &Worst| {
            let (_, entries) =
                self.expressions.iter().find(|(letter, _)| *letter == worst.field)?;
            entries.get(worst.entry)
        };
        let same = known.iter().find(|worst| {
            worst.inputs == inputs
                && worst.result.to_bits() == result.to_bits()
                && expression_of(worst) == entries.get(finding.entry)
        });
        if let Some(same) = same {
            return Ok(Worst { field, entry: finding.entry, ..same.clone() });
        }
        let (factor, truth, sens) = self.settled(inputs, finding.field, finding.entry, result)?;
        let size = self.size(inputs, finding.field)?;
        let units = units(result, &truth, &size.max(&sens + truth.abs()));
        Ok(Worst {
            field,
            entry: finding.entry,
            factor,
            units,
            inputs: inputs.to_vec(),
            found,
            outside: self.sampler.is_outside(inputs),
            result,
            exact: scientific(&truth, 20),
            sensitivity: scientific(&sens, 4),
        })
    }

    /// The size of a field at a point: its largest entry, and the largest answer of an entry to the inputs.
    fn size(&self, inputs: &[f64], field: usize) -> Result<Rational, AccuracyError> {
        let before: usize = self.expressions[..field].iter().map(|(_, e)| e.len()).sum();
        let entries = before..before + self.expressions[field].1.len();
        let values = self.exact_inputs(inputs);
        let truth = Oracle::new(QUICK_BITS)
            .and_then(|mut oracle| {
                oracle.evaluate(&self.point(&values), &self.flat[entries.clone()])
            })
            .map_err(|error| self.no_value(inputs, error))?;
        let largest = truth.iter().map(Signed::abs).max().unwrap_or_default();
        let answers = &self.quick_sensitivities(inputs)[entries];
        let answer = answers.iter().filter_map(|&answer| exact(answer)).max();
        Ok(largest + answer.unwrap_or_default())
    }

    /// Results of the code under test, in the order of the fields and of the size that they have.
    pub(crate) fn results(
        &self,
        inputs: &[f64],
        judged: JudgedCode<'_>,
    ) -> Result<Vec<Vec<f64>>, AccuracyError> {
        let fail = |reason: String| AccuracyError::Evaluation { place: self.place(inputs), reason };
        let given = judged(inputs).map_err(fail)?;
        let results: Result<Vec<Vec<f64>>, _> = self
            .expressions
            .iter()
            .map(|(letter, expressions)| {
                given
                    .iter()
                    .find(|(known, entries)| known == letter && entries.len() == expressions.len())
                    .map(|(_, entries)| entries.clone())
                    .ok_or_else(|| {
                        fail(format!("there is no field {letter} of {} entries", expressions.len()))
                    })
            })
            .collect();
        let mut results = results?;
        // The body force of a lattice's point that is not a number is evaluated anew by itself.
        let of_way = |is_it: fn(&Way) -> bool| {
            JUDGED
                .iter()
                .position(|judged| judged.name == FieldName::BodyForce && is_it(&judged.way))
        };
        let single = of_way(|way| matches!(way, Way::Single)).map(|place| results[place].clone());
        let lattice = of_way(|way| matches!(way, Way::Lattice)).map(|place| &mut results[place]);
        if let (Some(single), Some(lattice)) = (single, lattice)
            && lattice.iter().any(|b| b.is_nan())
        {
            *lattice = single;
        }
        Ok(results)
    }

    fn exact_inputs(&self, inputs: &[f64]) -> Vec<(Expr, Rational)> {
        let values = inputs.iter().map(|&x| exact(x).unwrap_or_default());
        self.inputs.iter().copied().zip(values).collect()
    }

    fn point<'b>(&'b self, values: &'b [(Expr, Rational)]) -> Point<'b> {
        Point { graph: &self.fields.graph, definitions: &self.fields.definitions, values }
    }

    fn no_value(&self, inputs: &[f64], error: OracleError) -> AccuracyError {
        AccuracyError::Oracle { place: self.place(inputs), error }
    }

    /// The inputs with their names.
    #[must_use]
    pub fn place(&self, inputs: &[f64]) -> String {
        let named: Vec<String> = self
            .inputs
            .iter()
            .zip(inputs)
            .map(|(e, x)| format!("{} = {x:?}", self.fields.graph.symbol_name(*e).unwrap_or("?")))
            .collect();
        named.join(", ")
    }

    /// The names of the inputs: coordinates, time, parameters.
    #[must_use]
    pub fn input_names(&self) -> Vec<&str> {
        let name = |e: &Expr| self.fields.graph.symbol_name(*e).unwrap_or("?");
        self.inputs.iter().map(name).collect()
    }

    /// The solution's number of coordinates.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.spec.dimension
    }
}

/// A field in one of the ways in which it is evaluated.
struct JudgedField {
    letter: &'static str,
    name: FieldName,
    way: Way,
}

/// How a field is evaluated.
enum Way {
    /// By a function of its own.
    Single,
    /// From values that are kept of times and points.
    Staged,
    /// From values of the layers of a lattice.
    Lattice,
}

const JUDGED: [JudgedField; 14] = [
    JudgedField { letter: "u", name: FieldName::Displacement, way: Way::Single },
    JudgedField { letter: "v", name: FieldName::Velocity, way: Way::Single },
    JudgedField { letter: "a", name: FieldName::Acceleration, way: Way::Single },
    JudgedField { letter: "H", name: FieldName::DisplacementGradient, way: Way::Single },
    JudgedField { letter: "F", name: FieldName::DeformationGradient, way: Way::Single },
    JudgedField { letter: "J", name: FieldName::Jacobian, way: Way::Single },
    JudgedField { letter: "P", name: FieldName::FirstPiolaKirchhoff, way: Way::Single },
    JudgedField { letter: "b", name: FieldName::BodyForce, way: Way::Single },
    JudgedField { letter: "b staged", name: FieldName::BodyForce, way: Way::Staged },
    JudgedField { letter: "b lattice", name: FieldName::BodyForce, way: Way::Lattice },
    JudgedField { letter: "u staged", name: FieldName::Displacement, way: Way::Staged },
    JudgedField { letter: "v staged", name: FieldName::Velocity, way: Way::Staged },
    JudgedField { letter: "F staged", name: FieldName::DeformationGradient, way: Way::Staged },
    JudgedField { letter: "P staged", name: FieldName::FirstPiolaKirchhoff, way: Way::Staged },
];

impl JudgedField {
    /// Where its entries are.
    fn slots<'a>(&self, staged: &'a Staged) -> &'a [Slot] {
        match (&self.way, self.name) {
            (Way::Staged, FieldName::BodyForce) => staged.body_force.outputs(),
            // Where there is no form for lattices, points in them are evaluated as others.
            (Way::Lattice, _) => {
                staged.lattice.as_ref().map_or(staged.body_force.outputs(), |l| l.outputs())
            }
            // Other stages keep values of single evaluations, and lead to the same bits.
            (Way::Single | Way::Staged, name) => staged.field(name),
        }
    }
}

/// The programs of the fields that are judged, each with its letter.
#[must_use]
pub fn programs(staged: &Staged) -> Vec<(&'static str, Program)> {
    let part = |judged: &JudgedField| staged.program().part(judged.slots(staged));
    JUDGED.iter().map(|judged| (judged.letter, part(judged))).collect()
}

fn by_letter(fields: &Fields) -> Vec<(&'static str, Vec<Expr>)> {
    JUDGED.iter().map(|judged| (judged.letter, judged.name.derived(fields))).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// A bar whose strain `A (2 X - 1) cos(t)` changes its sign at `X = 1/2`.
    const SLACK: &str = "
name = 'slack'
title = 'A bar that carries tension alone'
coordinates = 'cartesian'
dimension = 1

[parameters]
A = { default = 0.1, range = '> -1, < 1', description = 'amplitude' }

[displacement]
X = 'A*(X^2 - X)*cos(t)'

[material]
law = 'energy'
W = 'positive_part(F11 - 1)^2/2'
density = '1'

[domain]
shape = 'box'
lower = [0]
upper = [1]

[[boundary]]
surface = 'X-lower'
condition = 'prescribed-motion'

[[boundary]]
surface = 'X-upper'
condition = 'prescribed-motion'

[time]
period = '2*Pi'
wave-speed = '1'
";

    #[test]
    fn points_within_rounding_of_a_switch_are_told() {
        let spec = Spec::parse(SLACK, "slack").unwrap();
        let accuracy = Accuracy::new(&spec, spec.derive().unwrap());
        for (X, t, A, expected) in [
            (0.5, 0.0, 0.1, true),
            (0.5 + 2.0 * f64::EPSILON, 0.3, 0.1, true),
            (0.5 + 20.0 * f64::EPSILON, 0.3, 0.1, false),
            (0.6, 0.3, 0.1, false),
            (0.6, 0.3, 1e-200, false),
            // No motion at all, and nothing that rounding could change.
            (0.6, 0.3, 0.0, false),
        ] {
            assert_eq!(accuracy.is_at_switch(&[X, t, A]), expected, "{X} {t} {A}");
        }
    }
}
