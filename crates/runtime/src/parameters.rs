//! Names, defaults and admissible values of a solution's parameters.

use thiserror::Error;

/// A parameter of a solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Its name in the specification.
    pub name: &'static str,
    /// Its value where the user gives none.
    pub default: f64,
    /// Its unit; empty for a pure number.
    pub unit: &'static str,
    /// The admissible values, as the specification states them; empty where every finite number is admissible.
    pub admissible: &'static str,
    /// The meaning of the parameter.
    pub description: &'static str,
}

/// Description of a solution by its generated module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Description {
    /// The name, which is also that of the specification file.
    pub name: &'static str,
    /// One line for people.
    pub title: &'static str,
    /// Where the solution comes from.
    pub reference: &'static str,
    /// The coordinates in which it is stated.
    pub coordinates: &'static str,
    /// The number of space dimensions.
    pub dimension: usize,
    /// The parameters, in the order in which values are passed.
    pub parameters: &'static [Parameter],
    /// The text of the specification that it was generated from.
    pub specification: &'static str,
}

/// Why a set of parameter values was refused.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ParameterError {
    /// A name that the solution does not have.
    #[error("{solution} has no parameter '{name}'; it has {}", known.join(", "))]
    Unknown {
        /// The solution.
        solution: String,
        /// The name asked for.
        name: String,
        /// The names it has.
        known: Vec<String>,
    },
    /// A value outside the admissible ones.
    #[error(
        "parameter {name} = {value:?} of {solution} is not admissible: it must be {admissible}"
    )]
    OutOfRange {
        /// The solution.
        solution: String,
        /// The parameter.
        name: String,
        /// The value given.
        value: f64,
        /// The admissible values.
        admissible: String,
    },
    /// Values that are admissible one by one but not together.
    #[error(
        "the parameters of {solution} must satisfy {requirement}, which does not hold for {values}"
    )]
    Requirement {
        /// The solution.
        solution: String,
        /// The condition, as the specification states it.
        requirement: String,
        /// The values given, as `name = value` pairs.
        values: String,
    },
}

impl Description {
    /// The default values with `overrides` put in their places.
    ///
    /// # Errors
    ///
    /// [`ParameterError::Unknown`] for a name that is not a parameter. Whether the values are admissible is
    /// decided where the solution is built.
    pub fn resolve<'a>(
        &self,
        overrides: impl IntoIterator<Item = (&'a str, f64)>,
    ) -> Result<Vec<f64>, ParameterError> {
        let mut values: Vec<f64> = self.parameters.iter().map(|p| p.default).collect();
        for (name, value) in overrides {
            match self.parameters.iter().position(|p| p.name == name) {
                Some(index) => values[index] = value,
                None => {
                    return Err(ParameterError::Unknown {
                        solution: self.name.to_owned(),
                        name: name.to_owned(),
                        known: self.parameters.iter().map(|p| p.name.to_owned()).collect(),
                    });
                }
            }
        }
        Ok(values)
    }

    /// The error for parameter number `index` with an inadmissible `value`; used by generated code.
    #[must_use]
    pub fn out_of_range(&self, index: usize, value: f64) -> ParameterError {
        let Parameter { name, admissible, .. } = self.parameters[index];
        let admissible = if admissible.is_empty() { "a finite number" } else { admissible };
        ParameterError::OutOfRange {
            solution: self.name.to_owned(),
            name: name.to_owned(),
            value,
            admissible: admissible.to_owned(),
        }
    }

    /// The error for `values` that break `requirement`; used by generated code.
    #[must_use]
    pub fn requirement_broken(&self, requirement: &'static str, values: &[f64]) -> ParameterError {
        let values = self
            .parameters
            .iter()
            .zip(values)
            .map(|(p, v)| format!("{} = {v:?}", p.name))
            .collect::<Vec<_>>()
            .join(", ");
        ParameterError::Requirement {
            solution: self.name.to_owned(),
            requirement: requirement.to_owned(),
            values,
        }
    }
}
