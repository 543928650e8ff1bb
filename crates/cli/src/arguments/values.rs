//! Values of options, read from text; every refusal says which values are right.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use mmsmith_ledger::ShardName;
use mmsmith_verify::{self as verify, Named};

/// One of the choices that the library names.
pub(super) fn one_of<N: Named>() -> impl TypedValueParser<Value = N> {
    let value = |one: &N| PossibleValue::new(one.name()).help(one.about()).aliases(one.aliases());
    PossibleValuesParser::new(N::ALL.iter().map(value)).try_map(|name| {
        N::named(&name).ok_or_else(|| format!("it must be one of {}", verify::names::<N>()))
    })
}

pub(super) fn positive_count(text: &str) -> Result<usize, String> {
    match text.trim().parse() {
        Ok(0) | Err(_) => Err("it must be a whole number, at least 1".into()),
        Ok(count) => Ok(count),
    }
}

pub(super) fn sample_count(text: &str) -> Result<usize, String> {
    positive_count(text)
        .ok()
        .filter(|count| *count <= 10_000_000)
        .ok_or_else(|| "it must be a whole number from 1 to 10000000".into())
}

pub(super) fn thread_count(text: &str) -> Result<usize, String> {
    positive_count(text)
        .ok()
        .filter(|count| *count <= 1024)
        .ok_or_else(|| "it must be a whole number from 1 to 1024".into())
}

/// Processes along each axis.
#[derive(Clone, Debug)]
pub(crate) struct ProcessGrid(pub(crate) Vec<usize>);

pub(super) fn process_grid(text: &str) -> Result<ProcessGrid, String> {
    let along_axes: Result<Vec<usize>, _> = text.split('x').map(positive_count).collect();
    along_axes
        .ok()
        .filter(|along_axes| along_axes.len() <= 3)
        .map(ProcessGrid)
        .ok_or_else(|| "it must be numbers of processes along each axis, such as 2x4".into())
}

/// A number of cells of one run.
pub(super) fn cell_count(text: &str) -> Result<usize, String> {
    positive_count(text).map_err(|error| match text.split(',').count() {
        0 | 1 => error,
        _ => format!("it must be one whole number; mms converge takes several, as --cells {text}"),
    })
}

/// A shard of a study, as `3/8`.
pub(super) fn shard(text: &str) -> Result<ShardName, String> {
    let parts = text.trim().split_once('/').and_then(|(index, count)| {
        Some(ShardName::new(index.parse().ok()?, thread_count(count).ok()?))
    });
    parts.flatten().ok_or_else(|| "it must be one shard of at most 1024, from 1/8 to 8/8".into())
}

pub(super) fn positive_number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("it must be a positive number, such as 0.4".into()),
    }
}

/// A time from the start of a run on.
pub(super) fn time(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value >= 0.0 && value.is_finite() => Ok(value),
        _ => Err("it must be a number from 0 on, such as 0.5".into()),
    }
}

/// A time: seconds, or with a unit.
pub(super) fn seconds(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let units = [("ms", 1e-3), ("s", 1.0), ("m", 60.0), ("h", 3600.0)];
    let (number, unit) = units
        .into_iter()
        .find_map(|(unit, factor)| Some((text.strip_suffix(unit)?, factor)))
        .unwrap_or((text, 1.0));
    positive_number(number)
        .map(|number| number * unit)
        .map_err(|_| "it must be a positive time, such as 90s, 2m or 1h".into())
}

pub(super) fn finite_number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err("it must be a finite number, such as 0.01".into()),
    }
}

pub(super) fn axis(text: &str) -> Result<usize, String> {
    ["x", "y", "z"]
        .iter()
        .position(|axis| text.eq_ignore_ascii_case(axis))
        .ok_or_else(|| "expected x, y or z, such as --axes x,z".into())
}

pub(super) fn role(text: &str) -> Result<(verify::Role, String), String> {
    let roles = || verify::Role::ALL.map(verify::Role::name).join(", ");
    let form = || format!("expected ROLE=NAME, such as displacement=disp; roles: {}", roles());
    let (role, name) = text.split_once('=').ok_or_else(form)?;
    let known = verify::Role::ALL.into_iter().find(|known| known.name() == role.trim());
    match known {
        Some(known) if !name.is_empty() => Ok((known, name.to_owned())),
        _ => Err(form()),
    }
}

/// A scheme of the solver here to hold a recording against: its weights and its time integrator.
pub(super) fn peer(text: &str) -> Result<(verify::Shape, verify::Integrator), String> {
    let form = || "expected mms:SHAPE,INTEGRATOR, such as mms:linear,usl".to_owned();
    let (shape, integrator) =
        text.strip_prefix("mms:").and_then(|pair| pair.split_once(',')).ok_or_else(form)?;
    let shape: verify::Shape =
        shape.trim().parse().map_err(|cause| format!("{}; {cause}", form()))?;
    let integrator: verify::Integrator =
        integrator.trim().parse().map_err(|cause| format!("{}; {cause}", form()))?;
    Ok((shape, integrator))
}

pub(super) fn variation(text: &str) -> Result<(String, Vec<String>), String> {
    let form = || "expected NAME=VALUE,VALUE,..., such as nu=0,0.3,0.49".to_owned();
    let (name, values) = text.split_once('=').ok_or_else(form)?;
    let values: Vec<_> = values.split(',').map(|value| value.trim().to_owned()).collect();
    if name.trim().is_empty() || values.iter().any(String::is_empty) {
        return Err(form());
    }
    Ok((name.trim().to_owned(), values))
}

pub(super) fn assignment(text: &str) -> Result<(String, f64), String> {
    let form = "expected NAME=VALUE, such as A=0.05";
    let (name, value) = text.split_once('=').ok_or(form)?;
    let name = name.trim();
    if name.is_empty() {
        return Err(form.into());
    }
    match value.trim().parse::<f64>() {
        Ok(number) if number.is_finite() => Ok((name.to_owned(), number)),
        _ => Err(format!("'{value}' is not a finite number; {form}")),
    }
}

/// A range of an input.
pub(super) fn range(text: &str) -> Result<(String, f64, f64), String> {
    let form = "expected NAME=FROM:TO, such as A=-0.05:0.05";
    let (name, range) = text.split_once('=').ok_or(form)?;
    let (from, to) = range.split_once(':').ok_or(form)?;
    let (from, to) = (finite_number(from)?, finite_number(to)?);
    if name.trim().is_empty() || from > to {
        return Err(form.into());
    }
    Ok((name.trim().to_owned(), from, to))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_that_make_no_sense_are_refused() {
        for text in ["0", "-1", "2.5", "", "x", "99999999999999999999999"] {
            assert!(positive_count(text).is_err(), "{text}");
        }
        for text in ["0", "-0.4", "nan", "inf", "1e999", "", "0,4"] {
            assert!(positive_number(text).is_err(), "{text}");
        }
        for text in ["A", "=1", "A=", "A=x", "A=nan", "A=inf"] {
            assert!(assignment(text).is_err(), "{text}");
        }
        for text in ["A", "A=1", "=0:1", "A=1:0", "A=0:nan", "A=0:", "A=0:1:2"] {
            assert!(range(text).is_err(), "{text}");
        }
        assert_eq!(range("A=-0.5:1e-1"), Ok(("A".into(), -0.5, 0.1)));
        assert_eq!(assignment("A = 5e-2"), Ok(("A".into(), 0.05)));
    }
}
