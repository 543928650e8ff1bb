//! The boundary of a body: its surfaces, and the conditions on them.

use std::fmt;

/// The names of the Cartesian axes.
const AXES: [&str; 3] = ["X", "Y", "Z"];

/// A part of the body's boundary, or a plane that cuts the body in halves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Surface {
    /// The face of smallest Cartesian coordinate along an axis; for an annulus or a shell, the plane of symmetry through the origin normal
    /// to it.
    Lower(usize),
    /// The face of largest Cartesian coordinate along an axis.
    Upper(usize),
    /// The inner rim.
    Inner,
    /// The outer rim.
    Outer,
    /// The plane through the axis at the smallest angle of a sector.
    FirstAngle,
    /// The plane through the axis at the largest angle of a sector.
    LastAngle,
}

impl Surface {
    /// Every surface that a body in so many dimensions may have: rims and planes of angles first, then the ends of each axis.
    pub fn all(dimension: usize) -> impl Iterator<Item = Self> + Clone {
        let ends = (0..dimension).flat_map(|axis| [Self::Lower(axis), Self::Upper(axis)]);
        [Self::Inner, Self::Outer, Self::FirstAngle, Self::LastAngle].into_iter().chain(ends)
    }

    /// The Cartesian axis that a plane surface is normal to; none of a rim, or of a plane through an axis.
    #[must_use]
    pub fn axis(self) -> Option<usize> {
        match self {
            Self::Lower(axis) | Self::Upper(axis) => Some(axis),
            Self::Inner | Self::Outer | Self::FirstAngle | Self::LastAngle => None,
        }
    }
}

/// The name that specifications have for it, such as `X-lower`.
impl fmt::Display for Surface {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let axis = |axis: usize| AXES.get(axis).copied().unwrap_or("?");
        match self {
            Self::Lower(index) => f.pad(&format!("{}-lower", axis(*index))),
            Self::Upper(index) => f.pad(&format!("{}-upper", axis(*index))),
            Self::Inner => f.pad("inner"),
            Self::Outer => f.pad("outer"),
            Self::FirstAngle => f.pad("theta-lower"),
            Self::LastAngle => f.pad("theta-upper"),
        }
    }
}

/// A condition on one component at a surface: of the displacement or of the traction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ComponentCondition {
    /// The component of the displacement is that of the solution.
    PrescribedMotion,
    /// The component of the traction `P N` is that of the solution.
    PrescribedTraction,
    /// The component of the traction is zero.
    TractionFree,
}

impl ComponentCondition {
    /// The names that specifications have for them.
    pub const NAMES: [(&'static str, Self); 3] = [
        ("prescribed-motion", Self::PrescribedMotion),
        ("prescribed-traction", Self::PrescribedTraction),
        ("traction-free", Self::TractionFree),
    ];

    const fn is(self, other: Self) -> bool {
        self as u8 == other as u8
    }
}

impl fmt::Display for ComponentCondition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(Self::NAMES.iter().find(|(_, known)| known == self).map_or("", |(name, _)| name))
    }
}

/// Condition on a surface: a name for the conditions on all components, or conditions that differ from component to component.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Condition {
    /// No displacement along the normal, no shear traction.
    Sliding,
    /// The body is cut along a plane of symmetry: half of it is modelled, and the cut behaves as a sliding wall.
    Symmetry,
    /// No traction.
    TractionFree,
    /// The traction `P N` of the solution.
    PrescribedTraction,
    /// The displacement of the solution.
    PrescribedMotion,
    /// One condition for some components and another for others.
    Mixed(Mixed),
}

/// Conditions of which at least two differ.
///
/// Only [`Condition::by_direction`] and [`Condition::by_component`] make it, so that no two values say the same: conditions that are alike
/// have one name, and those that are alike along a surface are stated by direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mixed(Form);

/// The form in which conditions differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// A condition across the surface, and one along it.
    ByDirection {
        /// The condition on the component along the normal.
        normal: ComponentCondition,
        /// The condition on all others.
        tangential: ComponentCondition,
    },
    /// Conditions on the three Cartesian components on a plane surface in space; those along it differ.
    ByComponent([ComponentCondition; 3]),
}

impl Mixed {
    /// The form in which they differ.
    #[must_use]
    pub const fn form(self) -> Form {
        self.0
    }
}

impl Condition {
    /// The names that specifications have for conditions on all components.
    pub const NAMES: [(&'static str, Self); 5] = [
        ("sliding", Self::Sliding),
        ("symmetry", Self::Symmetry),
        ("traction-free", Self::TractionFree),
        ("prescribed-traction", Self::PrescribedTraction),
        ("prescribed-motion", Self::PrescribedMotion),
    ];

    /// One condition on all components.
    #[must_use]
    pub const fn of_all(one: ComponentCondition) -> Self {
        match one {
            ComponentCondition::PrescribedMotion => Self::PrescribedMotion,
            ComponentCondition::PrescribedTraction => Self::PrescribedTraction,
            ComponentCondition::TractionFree => Self::TractionFree,
        }
    }

    /// A condition on the component along the normal of a surface, and one on all others.
    #[must_use]
    pub const fn by_direction(normal: ComponentCondition, tangential: ComponentCondition) -> Self {
        if normal.is(tangential) {
            return Self::of_all(normal);
        }
        Self::Mixed(Mixed(Form::ByDirection { normal, tangential }))
    }

    /// Conditions on the Cartesian components at a plane surface normal to an axis, of which the first `dimension` count.
    #[must_use]
    pub const fn by_component(axis: usize, dimension: usize, of: [ComponentCondition; 3]) -> Self {
        let (one, other) = ((axis + 1) % 3, (axis + 2) % 3);
        match dimension {
            1 => Self::of_all(of[0]),
            2 => Self::by_direction(of[axis % 2], of[1 - axis % 2]),
            _ if of[one].is(of[other]) => Self::by_direction(of[axis % 3], of[one]),
            _ => Self::Mixed(Mixed(Form::ByComponent(of))),
        }
    }

    /// The condition on a component at a surface across an axis, components being along the axes of the same coordinates.
    #[must_use]
    pub fn of(self, axis: usize, component: usize) -> ComponentCondition {
        let by_direction = |normal, tangential| if component == axis { normal } else { tangential };
        match self {
            Self::Sliding | Self::Symmetry => {
                by_direction(ComponentCondition::PrescribedMotion, ComponentCondition::TractionFree)
            }
            Self::TractionFree => ComponentCondition::TractionFree,
            Self::PrescribedTraction => ComponentCondition::PrescribedTraction,
            Self::PrescribedMotion => ComponentCondition::PrescribedMotion,
            Self::Mixed(Mixed(Form::ByDirection { normal, tangential })) => {
                by_direction(normal, tangential)
            }
            Self::Mixed(Mixed(Form::ByComponent(of))) => of[component % 3],
        }
    }

    /// Whether it is a wall, along which the body slides.
    #[must_use]
    pub fn is_wall(self) -> bool {
        matches!(self, Self::Sliding | Self::Symmetry)
    }

    /// Whether some component of a surface has this condition; of a wall, none does.
    #[must_use]
    pub fn gives(self, one: ComponentCondition) -> bool {
        match self {
            Self::Sliding | Self::Symmetry => false,
            Self::Mixed(Mixed(Form::ByComponent(of))) => of.contains(&one),
            Self::TractionFree
            | Self::PrescribedTraction
            | Self::PrescribedMotion
            | Self::Mixed(Mixed(Form::ByDirection { .. })) => {
                self.of(0, 0) == one || self.of(0, 1) == one
            }
        }
    }
}

/// The name that specifications have for it, such as `sliding`; of mixed ones `normal prescribed-motion, tangential traction-free`.
impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mixed(Mixed(Form::ByDirection { normal, tangential })) => {
                f.pad(&format!("normal {normal}, tangential {tangential}"))
            }
            Self::Mixed(Mixed(Form::ByComponent(of))) => {
                let each = AXES.iter().zip(of).map(|(axis, one)| format!("{axis} {one}"));
                f.pad(&each.collect::<Vec<_>>().join(", "))
            }
            _ => {
                f.pad(Self::NAMES.iter().find(|(_, own)| own == self).map_or("", |(name, _)| name))
            }
        }
    }
}

/// A boundary condition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Boundary {
    /// Where.
    pub surface: Surface,
    /// The condition on the surface.
    pub condition: Condition,
}
