//! The solutions of the library: found by name, built with parameters.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result, bail};
use mmsmith_interpret::interpret;
use mmsmith_solutions::{AnySolution, CATALOGUE, Description, Real, build};
use mmsmith_spec::{Spec, nearest};

/// A solution's description with its parameter values, in its own order.
#[derive(Clone)]
pub(crate) struct Selection {
    pub(crate) description: &'static Description,
    pub(crate) values: Vec<f64>,
}

impl Selection {
    /// Finds `name` and puts `overrides` in place of its parameters' defaults.
    pub(crate) fn new(name: &str, overrides: &[(String, f64)]) -> Result<Self> {
        let description = find(name)?;
        for (index, (name, _)) in overrides.iter().enumerate() {
            if overrides[..index].iter().any(|(earlier, _)| earlier == name) {
                bail!("--set {name}=... is given twice");
            }
        }
        let overrides = overrides.iter().map(|(name, value)| (name.as_str(), *value));
        let values = description.resolve(overrides).context("--set")?;
        Ok(Self { description, values })
    }

    /// The solution in the precision asked for.
    pub(crate) fn build<T: Real>(&self) -> Result<AnySolution<T>> {
        let name = self.description.name;
        match build(name, &self.values) {
            Some(solution) => Ok(solution?),
            None => bail!("the solution '{name}' is listed but cannot be built"),
        }
    }

    /// Parameter values by name.
    pub(crate) fn parameters(&self) -> BTreeMap<&'static str, f64> {
        let names = self.description.parameters.iter().map(|parameter| parameter.name);
        names.zip(self.values.iter().copied()).collect()
    }
}

/// A solution to check, wherever it comes from.
pub(crate) struct Subject {
    pub(crate) name: String,
    pub(crate) solution: AnySolution<f64>,
    pub(crate) parameters: BTreeMap<String, f64>,
}

impl Subject {
    /// The solution called `name`, or the one that the specification file `name` describes.
    pub(crate) fn new(name: &str, overrides: &[(String, f64)]) -> Result<Self> {
        if is_file(name) {
            return Self::interpreted(name, overrides);
        }
        let selection = Selection::new(name, overrides)?;
        let parameters = selection.parameters();
        Ok(Self {
            name: name.to_owned(),
            solution: selection.build()?,
            parameters: parameters.into_iter().map(|(name, v)| (name.to_owned(), v)).collect(),
        })
    }

    /// Evaluates the specification itself: nothing needs to have been generated from it.
    fn interpreted(file: &str, overrides: &[(String, f64)]) -> Result<Self> {
        let spec = specification(file)?;
        let values = overrides.iter().map(|(name, value)| (name.as_str(), *value));
        let solution = interpret(&spec, values).with_context(|| file.to_owned())?;
        let mut parameters: BTreeMap<String, f64> =
            spec.parameters.iter().map(|p| (p.name.clone(), p.default)).collect();
        parameters.extend(overrides.iter().cloned());
        Ok(Self { name: spec.name, solution, parameters })
    }
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
