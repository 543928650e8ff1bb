//! The solutions of the library: found by name, built with parameters.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result, bail};
use mmsmith_interpret::interpret_fields;
use mmsmith_solutions::{AnySolution, CATALOGUE, Description, Real, build};
use mmsmith_spec::{Fields, Spec, nearest};

use crate::number;

/// A solution with its parameter values.
#[derive(Clone)]
pub(crate) struct Selection {
    source: Source,
    parameters: BTreeMap<String, f64>,
}

/// Where a solution's fields come from.
#[derive(Clone)]
enum Source {
    /// Code generated from the library's specifications.
    Library(&'static Description),
    /// A specification that is interpreted; nothing needs to have been generated from it.
    File(Arc<(Spec, Fields)>),
}

impl Selection {
    /// Finds `name`, a solution of the library or a specification file, and puts `overrides` in place of its
    /// parameters' defaults.
    pub(crate) fn new(name: &str, overrides: &[(String, f64)]) -> Result<Self> {
        for (index, (name, _)) in overrides.iter().enumerate() {
            if overrides[..index].iter().any(|(earlier, _)| earlier == name) {
                bail!("--set {name}=... is given twice");
            }
        }
        let (source, defaults): (Source, BTreeMap<String, f64>) = if is_file(name) {
            let spec = specification(name)?;
            let fields = spec.derive().with_context(|| name.to_owned())?;
            let defaults = spec.parameters.iter().map(|p| (p.name.clone(), p.default)).collect();
            (Source::File(Arc::new((spec, fields))), defaults)
        } else {
            let description = find(name)?;
            let parameters = description.parameters.iter();
            let defaults = parameters.map(|p| (p.name.to_owned(), p.default)).collect();
            (Source::Library(description), defaults)
        };
        Self { source, parameters: defaults }.with(overrides).context("--set")
    }

    /// The same solution with other values of the parameters named; of two values for one name the later one holds.
    pub(crate) fn with(&self, values: &[(String, f64)]) -> Result<Self> {
        let mut changed = self.clone();
        changed.parameters.extend(values.iter().cloned());
        let pairs = changed.parameters.iter().map(|(name, value)| (name.as_str(), *value));
        // Unknown names and values that are not admissible come to light here.
        match &changed.source {
            Source::Library(description) => {
                build::<f64>(description.name, &description.resolve(pairs)?).transpose()?;
            }
            Source::File(source) => {
                interpret_fields(&source.0, source.1.clone(), pairs)?;
            }
        }
        Ok(changed)
    }

    /// The solution's name.
    pub(crate) fn name(&self) -> &str {
        match &self.source {
            Source::Library(description) => description.name,
            Source::File(source) => &source.0.name,
        }
    }

    /// The solution in double precision.
    pub(crate) fn build(&self) -> Result<AnySolution<f64>> {
        match &self.source {
            Source::Library(description) => self.generated(description),
            Source::File(source) => {
                let pairs = self.parameters.iter().map(|(name, value)| (name.as_str(), *value));
                Ok(interpret_fields(&source.0, source.1.clone(), pairs)?)
            }
        }
    }

    /// The solution in single precision, for solvers that compute in it.
    pub(crate) fn build_single(&self) -> Result<AnySolution<f32>> {
        match &self.source {
            Source::Library(description) => self.generated(description),
            Source::File(source) => bail!(
                "'{}' is interpreted from its specification, in double precision only; generate code from it with \
                 cargo xtask gen, or use --precision f64",
                source.0.name
            ),
        }
    }

    fn generated<T: Real>(&self, description: &Description) -> Result<AnySolution<T>> {
        let pairs = self.parameters.iter().map(|(name, value)| (name.as_str(), *value));
        match build(description.name, &description.resolve(pairs)?) {
            Some(solution) => Ok(solution?),
            None => bail!("the solution '{}' is listed but cannot be built", description.name),
        }
    }

    /// The unit of each parameter, empty for a pure number.
    pub(crate) fn units(&self) -> BTreeMap<String, String> {
        match &self.source {
            Source::Library(description) => {
                description.parameters.iter().map(|p| (p.name.into(), p.unit.into())).collect()
            }
            Source::File(source) => {
                source.0.parameters.iter().map(|p| (p.name.clone(), p.unit.clone())).collect()
            }
        }
    }

    /// Parameter values by name.
    pub(crate) fn parameters(&self) -> &BTreeMap<String, f64> {
        &self.parameters
    }

    /// The values of all parameters in words: `A = 0.1, E = 10000`.
    pub(crate) fn told_parameters(&self) -> String {
        let told = |(name, value): (&String, &f64)| format!("{name} = {}", number::exact(*value));
        self.parameters.iter().map(told).collect::<Vec<_>>().join(", ")
    }
}

/// A solution to check, wherever it comes from.
pub(crate) struct Subject {
    pub(crate) name: String,
    /// With the parameters asked for, then with others: a mistake may hide at particular values.
    pub(crate) solutions: Vec<AnySolution<f64>>,
    pub(crate) parameters: Vec<BTreeMap<String, f64>>,
    pub(crate) spec: Spec,
    /// What messages call the specification.
    pub(crate) file: String,
    /// Where other files of the specification are, if it is a file itself.
    pub(crate) folder: Option<PathBuf>,
}

impl Subject {
    /// The solution called `name`, or the one that the specification file `name` describes.
    pub(crate) fn new(name: &str, overrides: &[(String, f64)]) -> Result<Self> {
        let selection = Selection::new(name, overrides)?;
        let spec = specification(name)?;
        let mut solutions = vec![selection.build()?];
        let mut parameters = vec![selection.parameters().clone()];
        // What the user set stays; the rest varies, where the specification admits it.
        for attempt in 1..=MOST_ATTEMPTS {
            let set: Vec<(String, f64)> = spec
                .parameters
                .iter()
                .enumerate()
                .filter(|(_, p)| overrides.iter().all(|(name, _)| *name != p.name))
                .map(|(index, p)| (p.name.clone(), p.default * variation(attempt, index)))
                .collect();
            if let Ok(varied) = selection.with(&set) {
                solutions.push(varied.build()?);
                parameters.push(varied.parameters().clone());
            }
            if solutions.len() > VARIATIONS {
                break;
            }
        }
        let folder = Path::new(name).parent().unwrap_or(Path::new("")).to_owned();
        let (file, folder) = if is_file(name) {
            (name.to_owned(), Some(folder))
        } else {
            (format!("{name}.toml"), None)
        };
        Ok(Self { name: selection.name().to_owned(), solutions, parameters, spec, file, folder })
    }
}

/// Sets of parameters that are checked beside the one asked for.
const VARIATIONS: usize = 2;
/// As many sets are tried for that; the specification may refuse some.
const MOST_ATTEMPTS: usize = 50;

/// A factor between 0.75 and 1.25 that repeats for no two parameters.
fn variation(attempt: usize, parameter: usize) -> f64 {
    // Multiples of the golden ratio, spread evenly over the unit interval.
    0.75 + 0.5 * ((attempt * 17 + parameter) as f64 * 0.618_033_988_749_894_9).fract()
}

/// The specification of the library's solution `name`, or the one in the file `name`.
pub(crate) fn specification(name: &str) -> Result<Spec> {
    if is_file(name) {
        let text = std::fs::read_to_string(name).with_context(|| format!("cannot read {name}"))?;
        return Ok(Spec::parse(&text, name)?);
    }
    let description = find(name)?;
    Ok(Spec::parse(description.specification, &format!("{name}.toml"))?)
}

/// Whether the user means a specification file.
pub(crate) fn is_file(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|extension| extension == "toml")
}

/// The description of the solution `name`; an unknown one is met with those there are.
fn find(name: &str) -> Result<&'static Description> {
    if let Some(description) = CATALOGUE.iter().find(|known| known.name == name) {
        return Ok(description);
    }
    let names: Vec<_> = CATALOGUE.iter().map(|known| known.name).collect();
    let nearest = nearest(name, names.iter().copied())
        .map(|known| format!("; did you mean '{known}'?"))
        .unwrap_or_default();
    bail!("there is no solution '{name}'{nearest} (there are: {})", names.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_far_from_one_are_told_with_an_exponent() {
        let selection = Selection::new("axis-aligned-1d", &[("A".to_owned(), 1e-300)]);
        let told = selection.expect("the library has it").told_parameters();
        assert!(told.starts_with("A = 1e-300, E = 10000,"), "{told}");
    }
}
