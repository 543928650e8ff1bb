//! Another place, other units or another parameter that explain a gross error, each with the option that mends it.

use mmsmith_solutions::AnySolution;
use mmsmith_verify::{
    Exchange, Input, Norm, Placing, Points, Quantity, RecordedMotion, Remark, Score,
    ScoreOptions as Reading, ScoreRow, score as measure,
};

use crate::library::Selection;
use crate::number;

/// A relative error that a solver that converges does not have on any grid worth scoring.
const SUSPICIOUS: f64 = 0.1;
/// The share of the error that is left where another reading explains it, on coarse grids too.
const EXPLAINED: f64 = 0.25;
/// The share that is left of the errors of other recorded fields: coarse grids leave more of those of F and P.
const SUPPORTED: f64 = 0.5;
/// The relative error of u that may be left, on coarse grids too.
const MOST_LEFT: f64 = 0.2;
/// Below this order the grid is not what the error is from.
const NO_ORDER: f64 = 0.5;
/// By how many times an error may be larger than the least one where both explain as much.
const AS_GOOD: f64 = 1.1;
/// Steps by which the place of a body is found.
const SHIFTS: usize = 4;
/// More than one by what sums in another order may differ.
const ROUNDED: f64 = 1.0 + 1e-9;
/// More numbers than are read anew for every trial.
const MOST_TRIED: usize = 50_000;
/// Octaves up and down from the value of a parameter in which another one is looked for.
const OCTAVES: i32 = 7;

/// Something that would explain an error.
struct Hypothesis {
    /// The option that mends it.
    option: String,
    /// In words, to follow "the error is explained by".
    words: String,
    reading: Reading,
    parameter: Option<(String, f64)>,
}

/// A recording with a gross error, and how it is read.
struct Case<'a> {
    selection: &'a Selection,
    exact: &'a AnySolution<f64>,
    input: &'a [Input],
    how: &'a Reading,
    row: &'a ScoreRow,
}

/// The finding about the row with the smallest recording where the error of u is large, no smaller on finer grids, and another reading
/// explains it in every recorded field.
pub(super) fn suggestion(
    selection: &Selection,
    exact: &AnySolution<f64>,
    set: &[(String, f64)],
    inputs: &[Input],
    how: &Reading,
    score: &Score,
) -> Option<(usize, Remark)> {
    let (index, row) = suspect(score)?;
    let case = Case { selection, exact, input: &inputs[index..=index], how, row };
    let explaining = |all: Vec<Hypothesis>| -> Vec<(f64, Hypothesis)> {
        all.into_iter().filter_map(|one| Some((case.error(&one)?, one))).collect()
    };
    let mut tried = explaining(case.places());
    if tried.is_empty() {
        tried = explaining(case.parameters());
    }
    if tried.is_empty() {
        tried = explaining(case.places_at_density_one(set));
    }
    let (least, words) = tried
        .iter()
        .min_by(|one, other| one.0.total_cmp(&other.0))
        .map(|(e, one)| (*e, one.words.clone()))?;
    // Of places that are as good, the one with the fewest digits, which comes first.
    let is_as_good =
        |(error, one): &(f64, Hypothesis)| one.words == words && *error <= AS_GOOD * least;
    let (error, found) = tried.into_iter().find(is_as_good)?;
    let message = format!(
        "{} explains the error: {} % of u with {}, in place of {} %",
        found.words,
        number::rounded(100.0 * error, 2),
        found.option,
        number::rounded(100.0 * relative(row), 2)
    );
    let is_place = found.reading.placing != how.placing || found.reading.exchange.is_some();
    let kind = if is_place { "other-place" } else { "other-parameter" };
    Some((index, Remark { kind, is_problem: false, count: 1, frames: 0, message }))
}

/// The parameter that is the density and was not set, where density one explains every field of a recording with a gross error: the
/// density of many codes, and the library's until 0.1.
pub(super) fn density_one(
    selection: &Selection,
    exact: &AnySolution<f64>,
    set: &[(String, f64)],
    inputs: &[Input],
    how: &Reading,
    score: &Score,
) -> Option<String> {
    let (index, row) = suspect(score)?;
    let name = unset_density(selection, exact, set)?;
    let case = Case { selection, exact, input: &inputs[index..=index], how, row };
    let hypothesis = case.parameter(&name, 1.0);
    case.error(&hypothesis).map(|_| name)
}

/// The parameter that is the density, where it is not one and was not set.
fn unset_density(
    selection: &Selection,
    exact: &AnySolution<f64>,
    set: &[(String, f64)],
) -> Option<String> {
    let density = density(exact).filter(|density| *density != 1.0)?;
    let is_density = |(name, value): &(&String, &f64)| {
        **value == density && set.iter().all(|(given, _)| given != *name)
    };
    selection.parameters().iter().find(is_density).map(|(name, _)| name.clone())
}

fn density(exact: &AnySolution<f64>) -> Option<f64> {
    match exact {
        AnySolution::One(exact) => Some(exact.density()),
        AnySolution::Two(exact) => Some(exact.density()),
        AnySolution::Three(exact) => Some(exact.density()),
        _ => None,
    }
}

/// The smallest recording, where its error is gross.
fn suspect(score: &Score) -> Option<(usize, &ScoreRow)> {
    let size = |row: &ScoreRow| row.particles * row.frames;
    let (index, row) = score.rows.iter().enumerate().min_by_key(|(_, row)| size(row))?;
    let order =
        score.orders.as_ref().and_then(|orders| orders.get(&Quantity::Displacement)?.l2.fit);
    let is_gross = row.is_whole() && u(row) > SUSPICIOUS * row.exact_displacement;
    let falls = order.is_some_and(|order| order > NO_ORDER);
    (is_gross && !falls && size(row) <= MOST_TRIED).then_some((index, row))
}

/// The error of u over the exact displacements at the same places: another reading may move these to where nothing moves.
fn relative(row: &ScoreRow) -> f64 {
    u(row) / row.exact_displacement
}

fn u(row: &ScoreRow) -> f64 {
    row.errors.get(&Quantity::Displacement).map_or(f64::NAN, |norms| norms.l2)
}

impl Case<'_> {
    /// The relative error of u where a hypothesis explains every recorded field.
    fn error(&self, hypothesis: &Hypothesis) -> Option<f64> {
        let other = match &hypothesis.parameter {
            Some(parameter) => {
                Some(self.selection.with(std::slice::from_ref(parameter)).ok()?.build().ok()?)
            }
            None => None,
        };
        let exact = other.as_ref().unwrap_or(self.exact);
        // Most explain nothing, which the displacements alone tell.
        if let Some(motion) =
            RecordedMotion::read(exact, &self.input[0], &hypothesis.reading).ok()?
            && motion.misfit(exact) > ROUNDED * EXPLAINED * u(self.row)
        {
            return None;
        }
        let row = measure(exact, self.input, &hypothesis.reading).ok()?.rows.pop()?;
        let explains = |field: &Quantity| {
            let error = |row: &ScoreRow| row.errors.get(field).map(|norms| norms[Norm::L2]);
            let share = if *field == Quantity::Displacement { EXPLAINED } else { SUPPORTED };
            error(&row).zip(error(self.row)).is_some_and(|(after, before)| after <= share * before)
        };
        let is_small = relative(&row) <= MOST_LEFT.min(SUPPORTED * relative(self.row));
        (row.is_whole() && is_small && self.row.fields.iter().all(explains)).then(|| relative(&row))
    }

    fn reading(&self, change: impl FnOnce(&mut Placing)) -> Reading {
        let mut reading = self.how.clone();
        change(&mut reading.placing);
        reading
    }

    fn place(&self, words: &str, option: String, change: impl FnOnce(&mut Placing)) -> Hypothesis {
        Hypothesis { option, words: words.into(), reading: self.reading(change), parameter: None }
    }

    fn parameter(&self, name: &str, value: f64) -> Hypothesis {
        Hypothesis {
            option: format!("--set {name}={}", number::rounded(value, 3)),
            words: "another value of a parameter".into(),
            reading: self.how.clone(),
            parameter: Some((name.to_owned(), value)),
        }
    }

    /// Other places and units of a recording with density one.
    fn places_at_density_one(&self, set: &[(String, f64)]) -> Vec<Hypothesis> {
        let Some(name) = unset_density(self.selection, self.exact, set) else { return vec![] };
        let at_one = |hypothesis: Hypothesis| Hypothesis {
            option: format!("{} --set {name}=1", hypothesis.option),
            parameter: Some((name.clone(), 1.0)),
            ..hypothesis
        };
        self.places().into_iter().map(at_one).collect()
    }

    /// Other places and units.
    fn places(&self) -> Vec<Hypothesis> {
        let mut all = self.shifts(self.how, "");
        all.extend(self.exchanges());
        for (unit, words) in [
            (0.001, "a unit of length of a thousandth"),
            (0.01, "a unit of length of a hundredth"),
            (1000.0, "a unit of length of a thousand"),
        ] {
            all.push(self.place(words, format!("--length-unit {unit}"), |placing| {
                placing.length_unit = unit
            }));
            let scaled = self.reading(|placing| placing.length_unit = unit);
            all.extend(self.shifts(&scaled, &format!("--length-unit {unit} ")));
            for time_unit in [0.001, 1e-6] {
                let option =
                    format!("--length-unit {unit} --time-unit {}", number::exact(time_unit));
                all.push(self.place("units of length and time", option, |placing| {
                    placing.length_unit = unit;
                    placing.time_unit = time_unit;
                }));
            }
        }
        let period = match self.exact {
            AnySolution::One(exact) => exact.period(),
            AnySolution::Two(exact) => exact.period(),
            AnySolution::Three(exact) => exact.period(),
            _ => return all,
        };
        for (unit, words) in [
            (0.001, "a unit of time of a thousandth"),
            (1e-6, "a unit of time of a millionth"),
            (period, "the period as the unit of time"),
            (period / std::f64::consts::TAU, "the period over 2 pi as the unit of time"),
            (1.0 / std::f64::consts::TAU, "a factor of 2 pi in the time"),
        ] {
            let option = format!("--time-unit {}", number::exact(unit));
            all.push(self.place(words, option, |placing| placing.time_unit = unit));
        }
        let dimension = self.selection.dimension();
        // The usual order comes first where another one was asked for: files without a third axis are read so too.
        let usual = (!self.how.placing.axes.is_empty()).then(|| (0..dimension).collect());
        for axes in usual.into_iter().chain(axes(dimension)) {
            let names: Vec<_> = axes.iter().map(|axis| ["x", "y", "z"][*axis]).collect();
            let option = format!("--axes {}", names.join(","));
            all.push(
                self.place("another order of the axes", option, |placing| placing.axes = axes),
            );
        }
        all.push(self.place("leaving out points outside the body", "--inside".into(), |placing| {
            placing.inside = true
        }));
        all
    }

    /// Columns that were written one for the other.
    fn exchanges(&self) -> Vec<Hypothesis> {
        const AXES: [&str; 3] = ["x", "y", "z"];
        let dimension = self.selection.dimension();
        let one = |exchange, columns: String| Hypothesis {
            option: format!("the columns {columns} written the other way round"),
            words: "an exchange of columns".into(),
            reading: Reading { exchange: Some(exchange), ..self.how.clone() },
            parameter: None,
        };
        let mut all = vec![];
        for j in 0..dimension {
            for i in 0..j {
                let [a, b] = [AXES[i], AXES[j]];
                all.push(one(Exchange::Displacement(i, j), format!("u{a} and u{b}")));
                let both = format!("u{a} and u{b}, v{a} and v{b}");
                all.push(one(Exchange::Motion(i, j), both));
            }
        }
        for (i, a) in AXES[..dimension].iter().enumerate() {
            all.push(one(Exchange::Component(i), format!("{} and u{a}", a.to_uppercase())));
        }
        if dimension > 1 {
            all.push(one(Exchange::Both, "of reference positions and of displacements".into()));
        }
        all
    }

    /// Shifts of the body: by its own middle, in as few digits as come near it. The middle is that of reference positions, whichever the
    /// points are.
    fn shifts(&self, how: &Reading, before: &str) -> Vec<Hypothesis> {
        let of = |points| {
            let mut reading = Reading { points, ..how.clone() };
            let mut total: Option<Vec<f64>> = None;
            // Positions that are traced back from a wrong place tell its shift only nearly.
            for _ in 0..SHIFTS {
                let shift = measure(self.exact, self.input, &reading).ok()?.rows.pop()?.shift?;
                let before = total.take().unwrap_or_else(|| vec![0.0; shift.len()]);
                let sum: Vec<f64> =
                    before.iter().zip(&shift).map(|(one, other)| one + other).collect();
                reading.placing.origin.clone_from(&sum);
                total = Some(sum);
            }
            total
        };
        let found = [of(Points::Reference), of(Points::Current)].into_iter().flatten();
        let mut all = vec![];
        for shift in found {
            self.add_shifts(how, before, &shift, &mut all);
        }
        all
    }

    fn add_shifts(&self, how: &Reading, before: &str, shift: &[f64], all: &mut Vec<Hypothesis>) {
        let to = |digits: i32| -> Vec<f64> {
            let scale = 10.0_f64.powi(digits);
            shift.iter().map(|value| (value * scale).round() / scale).collect()
        };
        for origin in [to(1), to(2), to(3), shift.to_vec()] {
            let told: Vec<_> = origin.iter().map(|value| number::exact(*value)).collect();
            let option = format!("{before}--origin {}", told.join(","));
            let is_new = all.iter().all(|other: &Hypothesis| other.option != option);
            if origin.iter().any(|value| *value != 0.0) && is_new {
                let mut reading = how.clone();
                reading.placing.origin = origin;
                let words = "a body that stands elsewhere".into();
                all.push(Hypothesis { option, words, reading, parameter: None });
            }
        }
    }

    /// Other values of single parameters.
    fn parameters(&self) -> Vec<Hypothesis> {
        let Ok(motion) = RecordedMotion::read(self.exact, &self.input[0], self.how) else {
            return vec![];
        };
        let misfit = |name: &str, value: f64| -> Option<f64> {
            let exact = self.selection.with(&[(name.to_owned(), value)]).ok()?.build().ok()?;
            match &motion {
                Some(motion) => Some(motion.misfit(&exact)).filter(|error| !error.is_nan()),
                None => Some(u(&measure(&exact, self.input, self.how).ok()?.rows[0])),
            }
        };
        let best = |(name, value): (&String, &f64)| {
            let (factor, _) = least(|factor| misfit(name, factor * value))?;
            Some(self.parameter(name, factor * value))
        };
        self.selection
            .parameters()
            .iter()
            .filter(|(_, value)| **value != 0.0)
            .filter_map(best)
            .collect()
    }
}

/// Other orders of axes, and other planes.
fn axes(dimension: usize) -> Vec<Vec<usize>> {
    match dimension {
        2 => vec![vec![1, 0], vec![0, 2], vec![2, 0], vec![1, 2], vec![2, 1]],
        3 => vec![vec![0, 2, 1], vec![1, 0, 2], vec![1, 2, 0], vec![2, 0, 1], vec![2, 1, 0]],
        _ => vec![vec![1], vec![2]],
    }
}

/// The factor, and its value, where a function is least: among half octaves and minus one, then by bisection between the
/// neighbours of the best.
fn least(function: impl Fn(f64) -> Option<f64>) -> Option<(f64, f64)> {
    let at = |factor: f64| function(factor).map(|value| (factor, value));
    let steps = (-2 * OCTAVES..=2 * OCTAVES).map(|step| 2.0_f64.powf(f64::from(step) / 2.0));
    let less = |one: &(f64, f64), other: &(f64, f64)| one.1.total_cmp(&other.1);
    let mut best = steps.chain([-1.0]).filter_map(at).min_by(less)?;
    let mut width = 2.0_f64.powf(0.25);
    for _ in 0..10 {
        let beside = [best.0 / width, best.0 * width].into_iter().filter_map(at);
        best = beside.chain([best]).min_by(less)?;
        width = width.sqrt();
    }
    Some(best)
}
