//! `mms check --thorough`: how large do the rounding errors of the field code become?

mod state;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow, bail};
use mmsmith_oracle::{
    Accuracy, Class, ClassAccuracy, Found, Judged, JudgedCode, LARGEST_FACTOR, LARGEST_UNITS,
    Search, Worst,
};
use mmsmith_solutions::build;
use mmsmith_spec::Spec;
use serde_json::{Value, json};

use crate::arguments::CheckOptions;
use crate::json::{Output, prepare_folder};
use crate::library::{locate, names};
use crate::progress::Bar;
use crate::table::Table;
use crate::terminal;
use state::State;

/// Points that are drawn in each class where the caller does not say, and where the search has a time to itself.
const POINTS: usize = 300;
const POINTS_BEFORE_TIMED_SEARCH: usize = 30;
/// So many points drawn give the search one round, where it has no time to itself.
const POINTS_OF_ROUND: usize = 4;
/// Points between two moves of the bar.
const STRIDE: usize = 16;
/// A kept state is never older than this.
const KEPT_EVERY: Duration = Duration::from_secs(10);
/// As many of the worst points are shown with all of their inputs.
const SHOWN: usize = 4;

/// How much is searched in each solution.
#[derive(Clone, Copy)]
enum Budget {
    Rounds(usize),
    Time(Duration),
}

pub(crate) fn thorough(options: &CheckOptions) -> Result<bool> {
    let output = Output::prepare_if(options.json.as_ref())?;
    let usual = if options.seconds.is_some() { POINTS_BEFORE_TIMED_SEARCH } else { POINTS };
    let points = options.points.unwrap_or(usual);
    let budget = match options.seconds {
        Some(seconds) => Budget::Time(Duration::from_secs_f64(seconds)),
        None => Budget::Rounds(points.div_ceil(POINTS_OF_ROUND)),
    };
    if let Some(folder) = &options.state {
        prepare_folder(folder).context("--state")?;
    }
    let names = if options.solutions.is_empty() { names() } else { options.solutions.clone() };
    if names.is_empty() {
        bail!("there is no solution to check");
    }
    // All names are judged before the first check.
    let specs = names
        .iter()
        .map(|name| {
            let origin = locate(name)?;
            Ok((name.as_str(), origin.specification()?, origin.is_generated()))
        })
        .collect::<Result<Vec<(&str, Spec, bool)>>>()?;
    let mut results = Vec::new();
    let mut all: Vec<Shown> = Vec::new();
    let mut passed = true;
    for (name, spec, is_generated) in &specs {
        let fields = spec.derive().with_context(|| (*name).to_owned())?;
        let accuracy = Accuracy::new(spec, fields);
        let begun = Instant::now();
        let subject =
            Subject { name, is_generated: *is_generated, spec, folder: options.state.as_deref() };
        let Measured { classes, beyond } = subject.measure(&accuracy, points, budget, begun)?;
        all.extend(shown(&spec.name, &accuracy, &classes));
        let good = beyond.is_empty();
        terminal::say(&text(&spec.name, &beyond, &accuracy, &classes))?;
        passed &= good;
        results.push(json!({
            "solution": spec.name,
            "code": if *is_generated { "generated" } else { "interpreted" },
            "points": classes.iter().map(|c| (c.class.name(), c.points)).collect::<BTreeMap<_, _>>(),
            "searched": classes.iter().map(|c| (c.class.name(), c.searched)).collect::<BTreeMap<_, _>>(),
            "at_switch": classes.iter().map(|c| (c.class.name(), c.at_switch)).collect::<BTreeMap<_, _>>(),
            "remarks": classes
                .iter()
                .filter_map(|c| Some((c.class.name(), c.remark?)))
                .collect::<BTreeMap<_, _>>(),
            "accuracy": rows(&spec.name, &accuracy, &classes),
            "passed": good,
        }));
    }
    terminal::say(&worst_of_all(all))?;
    terminal::say(&format!(
        "K is the least factor in |result - exact| <= K 2^-53 (sens + |exact|), sens the sum of |q dy/dq| over all inputs q; units \
         are those of 2^-53 of the field's size there. Allowed: K = {LARGEST_FACTOR} at drawn points, {LARGEST_UNITS} units in the body; \
         what the search finds is told and decides nothing.\n"
    ))?;
    if let Some(output) = output {
        output.write(&json!({
            "schema": "mmsmith.check/1",
            "settings": {
                "version": env!("CARGO_PKG_VERSION"),
                "solutions": names,
                "thorough": true,
                "points": points,
                "seconds": options.seconds,
                "largest_factor": LARGEST_FACTOR,
                "largest_units": LARGEST_UNITS,
            },
            "results": results,
            "passed": passed,
        }))?;
    }
    Ok(passed)
}

/// The rounding errors of one solution.
struct Measured {
    /// The worst of each field in each class, those included that the search found.
    classes: Vec<ClassAccuracy>,
    /// Drawn points beyond the factor that is allowed, which decide.
    beyond: Vec<(Class, Worst)>,
}

/// The code whose rounding errors are measured.
struct Subject<'a> {
    name: &'a str,
    is_generated: bool,
    spec: &'a Spec,
    /// Where the state of the search is kept, if anywhere.
    folder: Option<&'a Path>,
}

impl Subject<'_> {
    /// Every class: the generated functions of a solution of the library, the interpreted programs of a file.
    fn measure(
        &self,
        accuracy: &Accuracy<'_>,
        points: usize,
        budget: Budget,
        begun: Instant,
    ) -> Result<Measured> {
        let n = accuracy.dimension();
        let name = self.name;
        let programs = if self.is_generated { Vec::new() } else { accuracy.programs() };
        let judged = |inputs: &[f64]| -> Result<Judged, String> {
            if !programs.is_empty() {
                let values = programs.iter().map(|(letter, p)| (*letter, p.evaluate(inputs)));
                return Ok(values.collect());
            }
            let solution = build::<f64>(name, &inputs[n + 1..])
                .ok_or_else(|| format!("there is no solution '{name}'"))?
                .map_err(|error| error.to_string())?;
            solution
                .each_field(&inputs[..n], inputs[n])
                .ok_or_else(|| format!("the solution '{name}' does not have {n} dimensions"))
        };
        // Whether it can go on is known before any work.
        let state = match self.folder {
            Some(folder) => State::read(folder, self.spec, accuracy, self.is_generated, &judged)?,
            None => None,
        };
        let bar = Bar::new(&self.spec.name);
        let drawn = self.draw(accuracy, points, &judged, &bar.part(0.0, 0.3))?;
        let worst = drawn.iter().flat_map(|class| class.worst.iter().map(|w| (class.class, w)));
        let beyond = worst.filter(|(_, worst)| worst.factor > LARGEST_FACTOR);
        let beyond = beyond.map(|(class, worst)| (class, worst.clone())).collect();
        let mut search = state.unwrap_or_else(|| Search::new(accuracy));
        for class in &drawn {
            search.begin_at(accuracy, class);
        }
        self.search(accuracy, &mut search, budget, begun, &judged, &bar.part(0.3, 1.0))?;
        let worst = drawn.into_iter().map(|class| search.worst(accuracy, class, &judged));
        let classes = worst.collect::<Result<_, _>>().with_context(|| self.spec.name.clone())?;
        Ok(Measured { classes, beyond })
    }

    fn draw(
        &self,
        accuracy: &Accuracy<'_>,
        points: usize,
        judged: JudgedCode<'_>,
        bar: &Bar,
    ) -> Result<Vec<ClassAccuracy>> {
        let classes = Class::ALL.into_iter().enumerate();
        classes
            .map(|(number, class)| {
                let done = AtomicUsize::new(0);
                let step = || {
                    let step = 1 + done.fetch_add(1, Ordering::Relaxed);
                    if step.is_multiple_of(STRIDE) {
                        let what = || format!("{}, {}", self.spec.name, class.name());
                        let share = number as f64 + step as f64 / points as f64;
                        bar.show_share(what, share / Class::ALL.len() as f64);
                    }
                };
                accuracy
                    .measure(class, points, judged, &step)
                    .map_err(|error| anyhow!("{}: {}: {error}", self.spec.name, class.name()))
            })
            .collect()
    }

    /// Searches as long as the budget says, a round at least, and keeps the state.
    fn search(
        &self,
        accuracy: &Accuracy<'_>,
        search: &mut Search,
        budget: Budget,
        begun: Instant,
        judged: JudgedCode<'_>,
        bar: &Bar,
    ) -> Result<()> {
        let first = search.rounds();
        let keep = |search: &Search| match self.folder {
            Some(folder) => State::write(folder, self.spec, self.is_generated, search),
            None => Ok(()),
        };
        let mut kept = Instant::now();
        loop {
            search.advance(accuracy, judged).with_context(|| self.spec.name.clone())?;
            let share = match budget {
                Budget::Rounds(rounds) => (search.rounds() - first) as f64 / rounds as f64,
                Budget::Time(time) => begun.elapsed().as_secs_f64() / time.as_secs_f64(),
            };
            if share >= 1.0 {
                return keep(search);
            }
            if kept.elapsed() > KEPT_EVERY {
                keep(search)?;
                kept = Instant::now();
            }
            let what = || format!("{}, {} searched", self.spec.name, search.evaluations());
            bar.show_share(what, share);
        }
    }
}

/// One of the worst points, as it is printed.
struct Shown {
    factor: f64,
    text: String,
}

impl Shown {
    fn new(accuracy: &Accuracy<'_>, class: Class, worst: &Worst) -> Self {
        let Worst { field, entry, result, factor, units, exact, .. } = worst;
        let of = |number: f64| match number < 1e6 {
            true => format!("{number:.3}"),
            false => format!("{number:.3e}"),
        };
        Shown {
            factor: worst.factor,
            text: format!(
                "{}{}: {field}[{entry}] = {result:?} has K = {}, {} units, exact {exact}, found by {}, at {}",
                class.name(),
                if worst.outside { ", outside of the body" } else { "" },
                of(*factor),
                of(*units),
                found(worst.found),
                accuracy.place(&worst.inputs)
            ),
        }
    }
}

fn shown(name: &str, accuracy: &Accuracy<'_>, classes: &[ClassAccuracy]) -> Vec<Shown> {
    let all = classes.iter().flat_map(|class| class.worst.iter().map(move |worst| (class, worst)));
    let mut all: Vec<_> = all.collect();
    all.sort_by(|a, b| b.1.factor.total_cmp(&a.1.factor));
    // Stages and single calls often give the same bits at the same place, which are one point.
    let mut distinct: Vec<(&ClassAccuracy, &Worst)> = Vec::new();
    for (class, worst) in all {
        let is_known = |known: &&(&ClassAccuracy, &Worst)| {
            known.1.inputs == worst.inputs && known.1.result.to_bits() == worst.result.to_bits()
        };
        if distinct.iter().find(is_known).is_none() {
            distinct.push((class, worst));
        }
    }
    distinct
        .into_iter()
        .take(SHOWN)
        .map(|(class, worst)| {
            let Shown { factor, text } = Shown::new(accuracy, class.class, worst);
            Shown { factor, text: format!("{name}, {text}") }
        })
        .collect()
}

fn worst_of_all(mut all: Vec<Shown>) -> String {
    all.sort_by(|a, b| b.factor.total_cmp(&a.factor));
    let mut text = "The worst of all:\n".to_owned();
    for shown in all.into_iter().take(SHOWN) {
        text += &format!("  {}\n", shown.text);
    }
    text
}

fn found(found: Found) -> &'static str {
    match found {
        Found::Draw => "draw",
        Found::Search => "search",
    }
}

fn text(
    name: &str,
    beyond: &[(Class, Worst)],
    accuracy: &Accuracy<'_>,
    classes: &[ClassAccuracy],
) -> String {
    let verdict = if beyond.is_empty() { "passed" } else { "FAILED" };
    let mut text = format!("{name}: {verdict}\n");
    let letters: Vec<&str> = classes
        .iter()
        .max_by_key(|c| c.worst.len())
        .map(|c| c.worst.iter().map(|w| w.field).collect())
        .unwrap_or_default();
    let mut table = Table::new(1, ["class", "drawn", "searched"].into_iter().chain(letters));
    for class in classes {
        let factors = class.worst.iter().map(|worst| factor(worst.factor));
        let counts = [class.points.to_string(), class.searched.to_string()];
        let row = [class.class.name().to_owned()].into_iter().chain(counts);
        table.row(row.chain(factors));
    }
    text += &table.text();
    for class in classes {
        if let Some(remark) = class.remark {
            text += &format!("  {}: {remark}\n", class.class.name());
        }
        if class.at_switch > 0 {
            text += &format!(
                "  {}: {} points within rounding of a switch were left out\n",
                class.class.name(),
                class.at_switch
            );
        }
    }
    for (class, worst) in beyond {
        text += &format!(
            "  beyond K = {LARGEST_FACTOR}, {}\n",
            Shown::new(accuracy, *class, worst).text
        );
    }
    let all = classes.iter().flat_map(|class| class.worst.iter().map(move |worst| (class, worst)));
    if let Some((class, worst)) = all.max_by(|a, b| a.1.factor.total_cmp(&b.1.factor)) {
        text += &format!("  worst, {}\n", Shown::new(accuracy, class.class, worst).text);
    }
    text.push('\n');
    text
}

fn factor(K: f64) -> String {
    if K < 1e4 { format!("{K:.2}") } else { format!("{K:.1e}") }
}

fn rows(solution: &str, accuracy: &Accuracy<'_>, classes: &[ClassAccuracy]) -> Vec<Value> {
    let n = accuracy.dimension();
    let names = accuracy.input_names();
    let mut rows = Vec::new();
    for class in classes {
        for worst in &class.worst {
            let parameters: BTreeMap<&str, f64> =
                names[n + 1..].iter().copied().zip(worst.inputs[n + 1..].iter().copied()).collect();
            rows.push(json!({
                "solution": solution,
                "class": class.class.name(),
                "field": worst.field,
                "entry": worst.entry,
                "K": worst.factor,
                "units": worst.units,
                "found": found(worst.found),
                "outside": worst.outside,
                "drawn": class.points,
                "searched": class.searched,
                "worst": {
                    "X": worst.inputs[..n],
                    "t": worst.inputs[n],
                    "par": parameters,
                    "result": worst.result,
                    "exact": worst.exact,
                    "sens": worst.sensitivity,
                },
            }));
        }
    }
    rows
}
