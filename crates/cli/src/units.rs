//! The units of a solution's fields, as far as the units of its parameters tell them.

use mmsmith_verify::{Field, Quantity};

use crate::library::Selection;

/// Units that belong together: no factor stands in the momentum balance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Units {
    stress: &'static str,
    density: &'static str,
    length: &'static str,
    time: &'static str,
}

/// Systems of units; of two with one unit of stress the first is taken where nothing tells them apart.
const SYSTEMS: [Units; 5] = [
    Units { stress: "Pa", density: "kg/m^3", length: "m", time: "s" },
    Units { stress: "kPa", density: "t/m^3", length: "m", time: "s" },
    Units { stress: "MPa", density: "t/mm^3", length: "mm", time: "s" },
    Units { stress: "MPa", density: "g/mm^3", length: "mm", time: "ms" },
    Units { stress: "GPa", density: "kg/mm^3", length: "mm", time: "ms" },
];

impl Units {
    /// The International System.
    pub(crate) const SI: Self = SYSTEMS[0];

    /// The units of a solution; none where its parameters do not tell them, or contradict each other.
    pub(crate) fn of(selection: &Selection) -> Option<Self> {
        Self::that_fit(&selection.units().into_values().collect::<Vec<_>>())
    }

    /// The system that has all of these units; what belongs to no system is left aside.
    fn that_fit(units: &[String]) -> Option<Self> {
        let is_any = |part: fn(&Self) -> &'static str| {
            move |unit: &&String| SYSTEMS.iter().any(|system| part(system) == unit.as_str())
        };
        let fits = |system: &Self, part: fn(&Self) -> &'static str| {
            units.iter().filter(is_any(part)).all(|unit| unit == part(system))
        };
        if !units.iter().any(|unit| is_any(|system| system.stress)(&unit)) {
            return None;
        }
        SYSTEMS.into_iter().find(|system| {
            fits(system, |system| system.stress)
                && fits(system, |system| system.density)
                && fits(system, |system| system.length)
        })
    }

    pub(crate) fn stress(self) -> &'static str {
        self.stress
    }

    pub(crate) fn length(self) -> &'static str {
        self.length
    }

    pub(crate) fn time(self) -> &'static str {
        self.time
    }

    /// The unit of a recorded field's errors; none for a pure number.
    pub(crate) fn of_quantity(self, quantity: Quantity) -> Option<String> {
        match quantity {
            Quantity::Displacement => self.of_field(Field::Displacement),
            Quantity::Velocity => self.of_field(Field::Velocity),
            Quantity::FirstPiolaKirchhoff | Quantity::Cauchy | Quantity::Kirchhoff => {
                self.of_field(Field::Stress)
            }
            Quantity::Density => Some(self.density.into()),
            Quantity::DeformationGradient | Quantity::VolumeRatio => None,
        }
    }

    /// The unit of a field's errors; none for a pure number.
    pub(crate) fn of_field(self, field: Field) -> Option<String> {
        match field {
            Field::Displacement => Some(self.length.into()),
            Field::Velocity => Some(format!("{}/{}", self.length, self.time)),
            Field::Stress => Some(self.stress.into()),
            Field::DeformationGradient => None,
        }
    }
}

/// A name with its unit, as `u [m]`; without a unit where none is known.
pub(crate) fn with_unit(name: &str, unit: Option<impl AsRef<str>>) -> String {
    match unit {
        Some(unit) => format!("{name} [{}]", unit.as_ref()),
        None => name.to_owned(),
    }
}

/// A field with the unit of its errors.
pub(crate) fn named(field: Field, units: Option<Units>) -> String {
    with_unit(&field.to_string(), units.and_then(|units| units.of_field(field)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_those_of_one_system_or_none() {
        for (units, expected) in [
            (&["Pa", "kg/m^3", "m", ""][..], Some("m/s")),
            (&["Pa"], Some("m/s")),
            (&["MPa", "t/mm^3"], Some("mm/s")),
            (&["MPa", "g/mm^3", "mm"], Some("mm/ms")),
            (&["GPa", "kg/mm^3", "1/s"], Some("mm/ms")),
            (&["Pa", "mm"], None),
            (&["MPa", "kg/m^3"], None),
            (&["m", "kg/m^3"], None),
            (&[], None),
        ] {
            let owned: Vec<String> = units.iter().map(|unit| (*unit).to_owned()).collect();
            let found = Units::that_fit(&owned).and_then(|units| units.of_field(Field::Velocity));
            assert_eq!(found.as_deref(), expected, "{units:?}");
        }
    }

    #[test]
    fn fields_are_named_with_their_units() {
        let told = Field::ALL.map(|field| named(field, Some(Units::SI)));
        assert_eq!(told, ["u [m]", "v [m/s]", "F", "P [Pa]"]);
        assert_eq!(named(Field::Stress, None), "P");
    }
}
