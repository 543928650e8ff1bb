//! Reading `[[boundary]]`: a surface, and the condition on all of its components or on each.

use crate::coordinates::CARTESIAN;
use crate::document::BoundaryTable;
use crate::spec::Reader;
use crate::{Boundary, ComponentCondition, Condition, Diagnostic, Domain, Surface};
use std::ops::Range;
use toml::Spanned;

/// Keys of conditions by direction.
const DIRECTIONS: [&str; 2] = ["normal", "tangential"];

/// An example of conditions by direction, for messages.
const BY_DIRECTION: &str =
    "for example normal = 'prescribed-motion' and tangential = 'traction-free'";

impl BoundaryTable {
    /// The conditions that are stated by direction or component, with their keys.
    fn parts(&self) -> Vec<(&'static str, &Spanned<String>)> {
        let words = [&self.normal, &self.tangential, &self.X, &self.Y, &self.Z];
        let keys = DIRECTIONS.into_iter().chain(CARTESIAN);
        keys.zip(words).filter_map(|(key, word)| Some((key, word.as_ref()?))).collect()
    }

    /// Where its condition is stated.
    pub(crate) fn condition_span(&self) -> Range<usize> {
        let of_parts = || self.parts().first().map(|(_, word)| word.span());
        let of_all = self.condition.as_ref().map(|word| word.0.span());
        of_all.or_else(of_parts).unwrap_or_else(|| self.surface.span())
    }
}

impl Reader<'_> {
    pub(crate) fn boundary(
        &mut self,
        table: &BoundaryTable,
        domain: &Domain,
    ) -> Result<Boundary, Diagnostic> {
        let mut surfaces: Vec<(String, Surface)> = Vec::new();
        for (axis, name) in CARTESIAN[..self.dimension].iter().enumerate() {
            surfaces.push((format!("{name}-lower"), Surface::Lower(axis)));
            if matches!(domain, Domain::Box { .. }) {
                surfaces.push((format!("{name}-upper"), Surface::Upper(axis)));
            }
        }
        if matches!(domain, Domain::Annulus { .. }) {
            surfaces.push(("inner".into(), Surface::Inner));
            surfaces.push(("outer".into(), Surface::Outer));
        }
        if let Domain::Tube { inner, around, .. } = domain {
            let of_tube = Self::surfaces_of_tube(*inner, *around);
            surfaces = of_tube.into_iter().map(|(name, surface)| (name.into(), surface)).collect();
        }
        let known = surfaces.iter().map(|(name, surface)| (name.as_str(), *surface));
        self.refuse_radial_planes(&table.surface, domain)?;
        let surface = self.choice(&table.surface, "surface", known)?;
        let axis = surface.axis().filter(|_| matches!(domain, Domain::Box { .. }));
        let condition = self.condition(table, surface, axis)?;
        let cut = matches!(domain, Domain::Annulus { .. }) && matches!(surface, Surface::Lower(_));
        if cut && condition != Condition::Symmetry {
            let message = "a plane through the middle of an annulus can only be one of symmetry";
            return self.refuse(message, table.condition_span(), "condition = 'symmetry'");
        }
        Ok(Boundary { surface, condition })
    }

    /// The condition on a surface: one word for all components, or one for each. `axis` is what the surface of a box is normal to; on
    /// others Cartesian components have no condition of their own.
    fn condition(
        &self,
        table: &BoundaryTable,
        surface: Surface,
        axis: Option<usize>,
    ) -> Result<Condition, Diagnostic> {
        let parts = table.parts();
        if let Some(component) = &table.component {
            let word =
                table.condition.as_ref().map_or("prescribed-motion", |word| word.0.get_ref());
            let message = format!(
                "a condition on the component {} alone leaves open what holds for the others",
                component.get_ref()
            );
            let own = |name: &str| name == component.get_ref();
            let line =
                self.line(axis.is_some(), |name| if own(name) { word } else { "traction-free" });
            let help = format!(
                "write {line}, or another condition for the others, in place of condition and component"
            );
            return self.refuse(message, component.span(), help);
        }
        match (&table.condition, parts.first()) {
            (Some(word), None) => self.choice(&word.0, "condition", Condition::NAMES),
            (Some(word), Some((key, part))) => {
                let message = format!(
                    "condition = '{}' is for all components, and here is one for {key}",
                    word.0.get_ref()
                );
                let help = format!("write either condition = '...' alone, or {BY_DIRECTION}");
                self.refuse(message, part.span(), help)
            }
            (None, None) => {
                let message = format!("there is no condition on {surface}");
                let names = Condition::NAMES.map(|(name, _)| name).join("', '");
                let help = format!(
                    "write condition = '...', which is one of '{names}'; or {BY_DIRECTION}"
                );
                self.refuse(message, table.surface.span(), help)
            }
            (None, Some((first, _))) => {
                let is_direction = |key: &str| DIRECTIONS.contains(&key);
                let other = parts.iter().find(|(key, _)| is_direction(key) != is_direction(first));
                if let Some((other, word)) = other {
                    let message = format!("{first} and {other} speak of the same components");
                    let help = "write either normal and tangential, or X, Y and, in space, Z";
                    return self.refuse(message, word.span(), help);
                }
                match axis {
                    _ if is_direction(first) => self.by_direction(table),
                    Some(axis) => self.by_component(table, axis),
                    None => {
                        let message = format!(
                            "{first} is no direction of {surface}: those of a round body turn from place to place"
                        );
                        let help = format!("write {BY_DIRECTION}");
                        self.refuse(message, parts[0].1.span(), help)
                    }
                }
            }
        }
    }

    fn by_direction(&self, table: &BoundaryTable) -> Result<Condition, Diagnostic> {
        let of = |key: &str, word| self.choice(word, key, ComponentCondition::NAMES);
        match (&table.normal, &table.tangential) {
            (Some(normal), None) if self.dimension == 1 => {
                Ok(Condition::of_all(of("normal", normal)?))
            }
            (_, Some(word)) if self.dimension == 1 => {
                let message = "in one dimension there is no direction along a surface";
                self.refuse(message, word.span(), "write normal = '...' alone")
            }
            (Some(normal), Some(tangential)) => {
                Ok(Condition::by_direction(of("normal", normal)?, of("tangential", tangential)?))
            }
            (Some(one), None) => self.refuse_missing("tangential", one),
            (None, Some(one)) => self.refuse_missing("normal", one),
            (None, None) => Ok(Condition::TractionFree),
        }
    }

    fn by_component(&self, table: &BoundaryTable, axis: usize) -> Result<Condition, Diagnostic> {
        let mut all = [ComponentCondition::TractionFree; 3];
        let words = [&table.X, &table.Y, &table.Z];
        let first = words.into_iter().flatten().next();
        for (c, (key, word)) in CARTESIAN.into_iter().zip(words).enumerate() {
            match (word, first) {
                (Some(word), _) if c >= self.dimension => {
                    let message =
                        format!("there is no component {key} in {} dimension(s)", self.dimension);
                    let names = CARTESIAN[..self.dimension].join(" and ");
                    return self.refuse(message, word.span(), format!("components are {names}"));
                }
                (Some(word), _) => all[c] = self.choice(word, key, ComponentCondition::NAMES)?,
                (None, Some(first)) if c < self.dimension => {
                    return self.refuse_missing(key, first);
                }
                (None, _) => {}
            }
        }
        Ok(Condition::by_component(axis, self.dimension, all))
    }

    fn refuse_missing(&self, key: &str, beside: &Spanned<String>) -> Result<Condition, Diagnostic> {
        let message = format!("there is no condition for {key} beside this one");
        let names = ComponentCondition::NAMES.map(|(name, _)| format!("'{name}'")).join(", ");
        self.refuse(
            message,
            beside.span(),
            format!("write {key} = '...' too, which is one of {names}"),
        )
    }

    /// The line that states the conditions on a surface by component.
    fn line<'b>(&self, has_axes: bool, word: impl Fn(&str) -> &'b str) -> String {
        let keys: &[&str] = match has_axes {
            _ if self.dimension == 1 => &DIRECTIONS[..1],
            true => &CARTESIAN[..self.dimension],
            false => &DIRECTIONS,
        };
        let each = keys.iter().map(|key| format!("{key} = '{}'", word(key)));
        each.collect::<Vec<_>>().join(", ")
    }

    fn refuse<T>(
        &self,
        message: impl Into<String>,
        span: Range<usize>,
        help: impl Into<String>,
    ) -> Result<T, Diagnostic> {
        Err(self.scope.source.error(message, span, Some(help.into())))
    }

    /// Refuses `R-lower` and the like, for which the nearest name would be another surface.
    fn refuse_radial_planes(
        &self,
        surface: &Spanned<String>,
        domain: &Domain,
    ) -> Result<(), Diagnostic> {
        let of_coordinate =
            surface.get_ref().strip_suffix("-lower").or(surface.get_ref().strip_suffix("-upper"));
        let Some(coordinate @ ("R" | "theta" | "phi")) = of_coordinate else { return Ok(()) };
        if matches!(domain, Domain::Tube { .. }) {
            return Ok(());
        }
        let message =
            format!("there is no surface of constant {coordinate} called '{}'", surface.get_ref());
        let help = match (domain, coordinate) {
            (Domain::Annulus { .. }, "R") => {
                "the surfaces between the radii are 'inner' and 'outer'"
            }
            (Domain::Annulus { .. }, _) => {
                "planes of symmetry are X-lower, Y-lower and, in space, Z-lower"
            }
            (Domain::Box { .. }, _) => {
                "the surfaces of a box are planes, X-lower, X-upper, ...; for a body between two radii write shape = 'annulus' \
                 (dimension = 2), 'tube' (dimension = 3, cylindrical coordinates) or 'shell' (dimension = 3, spherical ones) with inner \
                 and outer"
            }
            (Domain::Tube { .. }, _) => "",
        };
        Err(self.scope.source.error(message, surface.span(), Some(help.into())))
    }
}
