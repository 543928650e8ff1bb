//! The points of a line or map.

use anyhow::{Context, Error, Result, bail};
use clap::ValueEnum;
use mmsmith_verify::{Named, UnitPowers, names};

use super::Point;
use crate::arguments::{Precision, SchemeOptions, StabilityOptions};
use crate::library::Selection;

/// Draft of a point, while settings are put into it.
struct Draft {
    selection: Selection,
    scheme: SchemeOptions,
    cells: usize,
}

/// Every combination of the varied settings' values, the last setting changing fastest.
pub(super) fn points(
    options: &StabilityOptions,
    scheme: &SchemeOptions,
    selection: &Selection,
) -> Result<Vec<Point>> {
    if options.over.len() > 2 {
        bail!("--over: one makes a line and two make a map; {} were given", options.over.len());
    }
    for (index, (name, _)) in options.over.iter().enumerate() {
        if options.over[..index].iter().any(|(earlier, _)| earlier == name) {
            bail!("--over {name}=... is given twice");
        }
    }
    let mut combinations: Vec<Vec<String>> = vec![Vec::new()];
    for (_, values) in &options.over {
        combinations = combinations
            .iter()
            .flat_map(|so_far| {
                values.iter().map(|value| [so_far.as_slice(), std::slice::from_ref(value)].concat())
            })
            .collect();
    }
    combinations
        .into_iter()
        .map(|values| {
            let (scheme, cells) = (scheme.clone(), options.grid_cells());
            let mut draft = Draft { selection: selection.clone(), scheme, cells };
            let mut place = String::new();
            for ((name, _), value) in options.over.iter().zip(&values) {
                put(&mut draft, name, value).with_context(|| format!("--over {name}={value}"))?;
                place += &format!("{}{name}={value}", if place.is_empty() { "" } else { ", " });
            }
            let Draft { selection, scheme, cells } = draft;
            let point = Point::new(values, selection, &scheme, cells);
            if place.is_empty() { point } else { point.with_context(|| format!("--over {place}")) }
        })
        .collect()
}

/// Puts one setting in its place.
fn put(draft: &mut Draft, name: &str, text: &str) -> Result<()> {
    let number = || match text.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => bail!("'{text}' is not a finite number"),
    };
    let count = || match text.parse::<usize>() {
        Ok(value) if value > 0 => Ok(value),
        _ => bail!("'{text}' is not a whole number, at least 1"),
    };
    let scheme = &mut draft.scheme;
    match name {
        "cells" => draft.cells = count()?,
        "ppc" => scheme.ppc = Some(count()?),
        "offset" => scheme.offset = number()?,
        "grid-angle" => scheme.grid_angle = number()?,
        "grid-shift" => scheme.grid_shift = number()?,
        "periods" => scheme.periods = number()?,
        "precision" => scheme.precision = word::<Precision>(text)?,
        "shape" => scheme.shape = Some(text.parse().map_err(Error::msg)?),
        "integrator" => scheme.integrator = text.parse()?,
        "start" => scheme.start = named(text)?,
        "units" => {
            let power = text.parse::<i32>().ok().filter(|power| power.abs() <= 100);
            let power =
                power.context("it must be a whole number from -100 to 100: powers of two")?;
            draft.selection = in_units(&draft.selection, power)?;
        }
        _ => {
            let parameter = if name == "amplitude" { "A" } else { name };
            draft.selection = draft.selection.with(&[(parameter.to_owned(), number()?)])?;
        }
    }
    Ok(())
}

fn named<N: Named>(text: &str) -> Result<N> {
    N::named(text).with_context(|| format!("'{text}' is none of {}", names::<N>()))
}

fn word<V: ValueEnum>(text: &str) -> Result<V> {
    let known = || {
        let values = V::value_variants().iter().filter_map(ValueEnum::to_possible_value);
        values.map(|value| value.get_name().to_owned()).collect::<Vec<_>>().join(", ")
    };
    match V::from_str(text, false) {
        Ok(value) => Ok(value),
        Err(_) => bail!("'{text}' is none of {}", known()),
    }
}

/// The problem in other units: times are `2^power` as large, masses `2^(5 power)`, and lengths `2^power` where the length that a cell count
/// divides is among the parameters, as L.
fn in_units(selection: &Selection, power: i32) -> Result<Selection> {
    let units = selection.units();
    let is_length = |unit: &String| matches!(kind(unit), Some(Kind::Length));
    let length = if units.get("L").is_some_and(is_length) { power } else { 0 };
    let powers = UnitPowers { mass: 5 * power, length, time: power };
    let mut values = Vec::new();
    for (name, value) in selection.parameters() {
        let unit = units.get(name).map_or("", String::as_str);
        let exponent = match kind(unit) {
            Some(Kind::Number) => 0,
            Some(Kind::Length) => length,
            Some(Kind::PerLength) => -length,
            Some(Kind::Time) => power,
            Some(Kind::PerTime) => -power,
            Some(Kind::Stress) => powers.stress(),
            Some(Kind::Density) => powers.density(),
            None => bail!("the unit '{unit}' of {name} is not known here"),
        };
        values.push((name.clone(), value * 2.0_f64.powi(exponent)));
    }
    let changed = selection.with(&values)?;
    if powers.relate(&selection.build()?, &changed.build()?) {
        return Ok(changed);
    }
    let without = selection
        .parameters()
        .iter()
        .filter(|(name, _)| units.get(*name).is_none_or(String::is_empty));
    let without: Vec<_> = without.collect();
    let Some((name, value)) = without.first() else {
        bail!(
            "the motion is another one in other units: its specification has numbers that are lengths, times or stresses; make parameters of \
             them, with their units"
        );
    };
    let names: Vec<_> = without.iter().map(|(name, _)| name.as_str()).collect();
    bail!(
        "the motion is another one in other units: of the parameters without a unit, {}, not all are pure numbers; write in the \
         specification the unit of each that is none, one of 'm', '1/m', 's', '1/s', 'Pa' and 'kg/m^3', as\n\n{name} = {{ default = {value:?}, unit = '{}' }}",
        names.join(", "),
        usual_unit(name),
    )
}

/// The unit that a parameter of this name mostly has.
fn usual_unit(name: &str) -> &'static str {
    match name {
        "E" | "K" | "G" | "mu" | "lambda" | "kappa" => "Pa",
        name if name.starts_with("rho") => "kg/m^3",
        _ => "m",
    }
}

/// Kinds of units that are known here.
enum Kind {
    Number,
    Length,
    PerLength,
    Time,
    PerTime,
    Stress,
    Density,
}

/// The kind of a unit, whatever its size.
fn kind(unit: &str) -> Option<Kind> {
    Some(match unit {
        "" | "1" | "rad" => Kind::Number,
        "m" | "mm" => Kind::Length,
        "1/m" | "1/mm" => Kind::PerLength,
        "s" | "ms" => Kind::Time,
        "1/s" | "1/ms" => Kind::PerTime,
        "Pa" | "kPa" | "MPa" | "GPa" => Kind::Stress,
        "kg/m^3" | "t/m^3" | "t/mm^3" | "g/mm^3" | "kg/mm^3" => Kind::Density,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use mmsmith_solutions::CATALOGUE;

    /// The parameters of the library without a unit are pure numbers.
    #[test]
    fn every_solution_of_the_library_is_the_same_motion_in_other_units_or_has_one_that_is_not_known()
     {
        let mut refused = Vec::new();
        for description in CATALOGUE {
            let selection = Selection::new(description.name, &[]).expect("a solution");
            if let Err(error) = in_units(&selection, 3) {
                refused.push(format!("{}: {error}", description.name));
            }
        }
        assert_eq!(refused, Vec::<String>::new());
    }
}
