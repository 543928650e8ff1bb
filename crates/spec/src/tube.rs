//! Bodies of revolution: tubes, solid cylinders, sectors of them, and boxes in the half plane of an axisymmetric body.

use mmsmith_expr::{Expr, Graph};
use toml::Spanned;

use crate::document::{DomainTable, List, Measure};
use crate::spec::Reader;
use crate::{Around, Coordinates, Diagnostic, Domain, Surface};

/// A shape of revolution as files call it, and the keys that it takes beside `outer`, `lower` and `upper`.
struct Shape {
    name: &'static str,
    has_inner: bool,
    has_angles: bool,
}

const SHAPES: [Shape; 3] = [
    Shape { name: "tube", has_inner: true, has_angles: false },
    Shape { name: "solid-cylinder", has_inner: false, has_angles: false },
    Shape { name: "sector", has_inner: true, has_angles: true },
];

impl Reader<'_> {
    /// Names of shapes of revolution, for messages.
    pub(crate) const TUBES: &'static str = "'tube', 'solid-cylinder' or 'sector'";

    /// A shape of revolution by its name; `None` where the name is that of another shape.
    pub(crate) fn tube(
        &mut self,
        table: &Spanned<DomainTable>,
    ) -> Result<Option<Domain>, Diagnostic> {
        let keys = table.get_ref();
        let Some(shape) = SHAPES.iter().find(|shape| shape.name == keys.shape.get_ref()) else {
            return Ok(None);
        };
        self.check_coordinates_of_tube(keys, shape)?;
        let given = [
            ("inner", keys.inner.is_some(), shape.has_inner),
            ("outer", keys.outer.is_some(), true),
            ("lower", keys.lower.is_some(), true),
            ("upper", keys.upper.is_some(), true),
            ("from", keys.from.is_some(), shape.has_angles),
            ("to", keys.to.is_some(), shape.has_angles),
        ];
        for (key, is_given, is_needed) in given {
            if is_given != is_needed {
                let verb = if is_given { "has no" } else { "needs" };
                let message = format!("a domain of shape '{}' {verb} '{key}'", shape.name);
                let help = format!(
                    "shape = '{}', {}outer = '1', lower = 0, upper = 1{}: radii, heights{}",
                    shape.name,
                    if shape.has_inner { "inner = '1/2', " } else { "" },
                    if shape.has_angles { ", from = 0, to = 'Pi/2'" } else { "" },
                    if shape.has_angles { " and angles in radians" } else { "" },
                );
                return Err(self.scope.source.error(message, table.span(), Some(help)));
            }
        }
        let around = match (&keys.from, &keys.to) {
            (Some(from), Some(to)) => Around::Sector {
                from: self.scope.constant(from, "from")?,
                to: self.scope.constant(to, "to")?,
            },
            _ if self.coordinates == Coordinates::Axisymmetric => Around::Axisymmetric,
            _ => Around::Whole,
        };
        let inner = match &keys.inner {
            Some(text) => self.scope.constant(text, "inner")?,
            None => Graph::ZERO,
        };
        let outer = match &keys.outer {
            Some(text) => self.scope.constant(text, "outer")?,
            None => Graph::ONE,
        };
        let (lower, upper) = (self.height(&keys.lower)?, self.height(&keys.upper)?);
        Ok(Some(Domain::Tube { inner, outer, lower, upper, around }))
    }

    fn check_coordinates_of_tube(
        &self,
        keys: &DomainTable,
        shape: &Shape,
    ) -> Result<(), Diagnostic> {
        let allowed: &[Coordinates] = match shape.has_angles {
            true => &[Coordinates::Cylindrical],
            false => &[Coordinates::Cylindrical, Coordinates::Axisymmetric, Coordinates::Cartesian],
        };
        if self.dimension == 3 && allowed.contains(&self.coordinates) {
            return Ok(());
        }
        let message = format!("a {} lies about the axis Z of space", shape.name);
        let help = match shape.has_angles {
            true => "coordinates = 'cylindrical' with dimension = 3",
            false => {
                "coordinates = 'axisymmetric' with dimension = 2, or 'cylindrical' or 'cartesian' with dimension = 3"
            }
        };
        Err(self.scope.source.error(message, keys.shape.span(), Some(help.into())))
    }

    /// A height of the body, which files may also write as a corner with one entry.
    fn height(&mut self, texts: &Option<Spanned<List<Measure>>>) -> Result<Expr, Diagnostic> {
        let Some(texts) = texts else { return Ok(Graph::ZERO) };
        match List::texts(texts).as_slice() {
            [text] => self.scope.constant(text, "a height"),
            others => {
                let message = format!("{} numbers given for a height", others.len());
                let help =
                    "a tube has radii inner and outer, and its heights are lower = 0, upper = 1";
                Err(self.scope.source.error(message, texts.span(), Some(help.into())))
            }
        }
    }

    /// The body of revolution whose half plane, `R` and `Z`, is a box.
    pub(crate) fn turned_box(&mut self, keys: &DomainTable) -> Result<Domain, Diagnostic> {
        let mut corner = |texts: &Option<Spanned<List<Measure>>>| -> Result<[Expr; 2], Diagnostic> {
            let Some(texts) = texts else { return Ok([Graph::ZERO; 2]) };
            match List::texts(texts).as_slice() {
                [R, Z] => {
                    Ok([self.scope.constant(R, "a corner")?, self.scope.constant(Z, "a corner")?])
                }
                others => {
                    let message =
                        format!("{} coordinate(s) given for a corner of R and Z", others.len());
                    let help =
                        "lower = [0, 0], upper = [1, 1]: the smallest and the largest R and Z";
                    Err(self.scope.source.error(message, texts.span(), Some(help.into())))
                }
            }
        };
        let ([inner, lower], [outer, upper]) = (corner(&keys.lower)?, corner(&keys.upper)?);
        Ok(Domain::Tube { inner, outer, lower, upper, around: Around::Axisymmetric })
    }

    /// Surfaces of a body of revolution by the names that files have for them.
    pub(crate) fn surfaces_of_tube(
        inner: Expr,
        around: Around<Expr>,
    ) -> Vec<(&'static str, Surface)> {
        let mut surfaces = vec![
            ("R-upper", Surface::Outer),
            ("outer", Surface::Outer),
            ("Z-lower", Surface::Lower(2)),
            ("Z-upper", Surface::Upper(2)),
        ];
        if inner != Graph::ZERO {
            surfaces.extend([("R-lower", Surface::Inner), ("inner", Surface::Inner)]);
        }
        if matches!(around, Around::Sector { .. }) {
            surfaces.extend([
                ("theta-lower", Surface::FirstAngle),
                ("theta-upper", Surface::LastAngle),
            ]);
        }
        surfaces
    }
}
