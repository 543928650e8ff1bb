//! Fields on the surfaces of the body: tractions, and what the declared conditions say must be zero there.
//!
//! On a rim of a body stated in polar or spherical coordinates the normal is `-e_R` or `e_R`, and the traction is the
//! first column of the stress in those coordinates with `R` put at the rim: where the rim is free of traction it
//! simplifies to zero, in symbols.

use crate::coordinates::{Geometry, turn_vector};
use crate::{
    Around, Boundary, ComponentCondition, Condition, Coordinates, Domain, Form, Mixed, Spec,
    Surface,
};
use mmsmith_expr::{Expr, Graph, Replacement};

/// Fields on one surface of the body.
#[derive(Clone, Debug)]
pub struct SurfaceFields {
    /// Which surface.
    pub surface: Surface,
    /// The traction `P N`, force per reference area with the outward reference normal `N`, in Cartesian components.
    /// Its position is on the surface: the coordinate that is fixed there has been put in.
    pub traction: Vec<Expr>,
    /// The claims of the conditions declared on this surface.
    pub claims: Vec<Claim>,
}

/// Quantities that are zero on a surface if its condition is right.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Claim {
    /// The kind of quantities.
    pub what: ClaimKind,
    /// The quantities: [`Graph::ZERO`] where that could be shown in symbols.
    pub quantities: Vec<Expr>,
}

/// Quantities that a condition claims are zero on a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClaimKind {
    /// No traction.
    Traction,
    /// No traction along the surface.
    Shear,
    /// No traction along the normal.
    NormalTraction,
    /// No traction along a Cartesian axis.
    TractionComponent(usize),
    /// No displacement along the normal.
    NormalDisplacement,
}

impl Domain {
    /// Every surface of the body in `dimension` dimensions; for an annulus or a shell also the planes of symmetry that
    /// may cut it.
    #[must_use]
    pub fn surfaces(&self, dimension: usize) -> Vec<Surface> {
        let planes = (0..dimension).map(Surface::Lower);
        match self {
            Domain::Box { .. } => planes.flat_map(|lower| [lower, opposite(lower)]).collect(),
            Domain::Annulus { .. } => {
                [Surface::Inner, Surface::Outer].into_iter().chain(planes).collect()
            }
            Domain::Tube { inner, around, .. } => {
                let inner = (*inner != Graph::ZERO).then_some(Surface::Inner);
                let angles = match around {
                    Around::Axisymmetric | Around::Whole => [None, None],
                    Around::Sector { .. } => [Some(Surface::FirstAngle), Some(Surface::LastAngle)],
                };
                let ends = [Surface::Outer, Surface::Lower(2), Surface::Upper(2)];
                inner.into_iter().chain(ends).chain(angles.into_iter().flatten()).collect()
            }
        }
    }
}

fn opposite(surface: Surface) -> Surface {
    match surface {
        Surface::Lower(axis) => Surface::Upper(axis),
        Surface::Upper(axis) => Surface::Lower(axis),
        Surface::Inner => Surface::Outer,
        Surface::Outer => Surface::Inner,
        Surface::FirstAngle => Surface::LastAngle,
        Surface::LastAngle => Surface::FirstAngle,
    }
}

/// Displacement and stress, in the specification's own physical components and in Cartesian ones.
pub(crate) struct Components<'a> {
    pub(crate) own_u: &'a [Expr],
    pub(crate) own_P: &'a [Vec<Expr>],
    pub(crate) u: &'a [Expr],
    pub(crate) P: &'a [Vec<Expr>],
}

/// The fields on every surface of the body.
pub(crate) fn surface_fields(
    graph: &mut Graph,
    geometry: &Geometry,
    spec: &Spec,
    fields: &Components<'_>,
) -> Vec<SurfaceFields> {
    let surfaces = spec.domain.surfaces(spec.dimension).into_iter();
    surfaces
        .map(|surface| {
            let placing = Replacement::new(fixed_coordinate(geometry, spec, surface));
            OnSurface { graph, geometry, spec, fields, surface, placing }.derive()
        })
        .collect()
}

struct OnSurface<'a, 'b> {
    graph: &'a mut Graph,
    geometry: &'a Geometry,
    spec: &'a Spec,
    fields: &'a Components<'b>,
    surface: Surface,
    /// The coordinate that is fixed on the surface, replaced by its value.
    placing: Replacement,
}

/// The coordinate that is fixed on a surface, and its value.
fn fixed_coordinate(geometry: &Geometry, spec: &Spec, surface: Surface) -> Option<(Expr, Expr)> {
    match plane(spec, surface) {
        Some((axis, value)) => Some((geometry.cartesian[axis], value)),
        None => {
            let own = own_axis(spec, surface)?;
            Some((geometry.coordinates[own], own_value(spec, surface)))
        }
    }
}

/// The axis and the place of a plane surface.
fn plane(spec: &Spec, surface: Surface) -> Option<(usize, Expr)> {
    match (surface, &spec.domain) {
        (Surface::Lower(axis), Domain::Tube { lower, .. }) => Some((axis, *lower)),
        (Surface::Upper(axis), Domain::Tube { upper, .. }) => Some((axis, *upper)),
        (Surface::Lower(axis), Domain::Box { lower, .. }) => Some((axis, lower[axis])),
        (Surface::Upper(axis), Domain::Box { upper, .. }) => Some((axis, upper[axis])),
        (Surface::Lower(axis) | Surface::Upper(axis), _) => Some((axis, Graph::ZERO)),
        _ => None,
    }
}

/// The coordinate of the specification that is fixed on a surface which is no plane of a Cartesian coordinate, if one is.
fn own_axis(spec: &Spec, surface: Surface) -> Option<usize> {
    use Coordinates::{Axisymmetric, Cylindrical, Polar, Spherical};
    match (surface, &spec.domain, spec.coordinates) {
        (Surface::Inner | Surface::Outer, Domain::Annulus { .. }, Polar | Spherical)
        | (Surface::Inner | Surface::Outer, Domain::Tube { .. }, Cylindrical | Axisymmetric) => {
            Some(0)
        }
        (Surface::FirstAngle | Surface::LastAngle, Domain::Tube { .. }, Cylindrical) => Some(1),
        _ => None,
    }
}

/// The radius or the angle of a surface.
fn own_value(spec: &Spec, surface: Surface) -> Expr {
    let radii = match &spec.domain {
        Domain::Annulus { inner, outer } | Domain::Tube { inner, outer, .. } => [*inner, *outer],
        Domain::Box { .. } => [Graph::ONE; 2],
    };
    match (surface, &spec.domain) {
        (Surface::Inner, _) => radii[0],
        (Surface::FirstAngle, Domain::Tube { around: Around::Sector { from, .. }, .. }) => *from,
        (Surface::LastAngle, Domain::Tube { around: Around::Sector { to, .. }, .. }) => *to,
        _ => radii[1],
    }
}

impl OnSurface<'_, '_> {
    fn derive(&mut self) -> SurfaceFields {
        // The traction and the displacement in components of which one is along the normal, where there are such.
        let own = own_axis(self.spec, self.surface);
        let (traction, displacement, normal) = match (plane(self.spec, self.surface), own) {
            (Some((axis, _)), _) => (self.column(self.fields.P, axis), self.fields.u, Some(axis)),
            (None, Some(axis)) => {
                (self.column(self.fields.own_P, axis), self.fields.own_u, Some(axis))
            }
            (None, None) => {
                let radius = own_value(self.spec, self.surface);
                (self.across(radius), self.fields.u, None)
            }
        };
        let mut traction: Vec<Expr> = traction.into_iter().map(|t| self.placed(t)).collect();
        let mut claims = Vec::new();
        let declared: Vec<Condition> = self.conditions();
        for condition in declared {
            match condition {
                Condition::TractionFree => {
                    traction.iter_mut().for_each(|t| *t = self.zero_if_vanishing(*t));
                    let (what, quantities) = (ClaimKind::Traction, traction.clone());
                    claims.push(Claim { what, quantities });
                }
                Condition::Sliding | Condition::Symmetry => {
                    let Some(normal) = normal else { continue };
                    let mut quantities = Vec::new();
                    for i in (0..traction.len()).filter(|&i| i != normal) {
                        traction[i] = self.zero_if_vanishing(traction[i]);
                        quantities.push(traction[i]);
                    }
                    claims.push(Claim { what: ClaimKind::Shear, quantities });
                    let along = self.placed(displacement[normal]);
                    let along = self.zero_if_vanishing(along);
                    let what = ClaimKind::NormalDisplacement;
                    claims.push(Claim { what, quantities: vec![along] });
                }
                Condition::Mixed(mixed) => {
                    self.claim_free(mixed, normal, &mut traction, &mut claims)
                }
                Condition::PrescribedTraction | Condition::PrescribedMotion => {}
            }
        }
        if plane(self.spec, self.surface).is_none() && own.is_some() {
            traction = turn_vector(self.graph, self.geometry, &traction);
            traction = traction.into_iter().map(|t| self.placed(t)).collect();
        }
        SurfaceFields { surface: self.surface, traction, claims }
    }

    /// Claims that the components of the traction vanish which are stated to be free. `normal` is the component along the normal, where
    /// there is one.
    fn claim_free(
        &mut self,
        mixed: Mixed,
        normal: Option<usize>,
        traction: &mut [Expr],
        claims: &mut Vec<Claim>,
    ) {
        let free = ComponentCondition::TractionFree;
        let all = 0..traction.len();
        let mut claim = |what, of: Vec<usize>| {
            of.iter().for_each(|&i| traction[i] = self.zero_if_vanishing(traction[i]));
            claims.push(Claim { what, quantities: of.into_iter().map(|i| traction[i]).collect() });
        };
        match (mixed.form(), normal) {
            (Form::ByComponent(of), _) => {
                let is_free = |i: &usize| of.get(*i) == Some(&free);
                all.filter(is_free).for_each(|i| claim(ClaimKind::TractionComponent(i), vec![i]));
            }
            (Form::ByDirection { normal: across, .. }, Some(normal)) if across == free => {
                claim(ClaimKind::NormalTraction, vec![normal]);
            }
            (Form::ByDirection { tangential, .. }, Some(normal)) if tangential == free => {
                claim(ClaimKind::Shear, all.filter(|&i| i != normal).collect());
            }
            (Form::ByDirection { normal: across, tangential }, None) => {
                let [along, shear] = self.split(own_value(self.spec, self.surface), traction);
                if across == free {
                    claims.push(Claim { what: ClaimKind::NormalTraction, quantities: along });
                }
                if tangential == free {
                    claims.push(Claim { what: ClaimKind::Shear, quantities: shear });
                }
            }
            (Form::ByDirection { .. }, Some(_)) => {}
        }
    }

    /// The component of a traction along `X/R` on a rim, and what is left of the traction.
    fn split(&mut self, radius: Expr, traction: &[Expr]) -> [Vec<Expr>; 2] {
        let X = self.round();
        let terms: Vec<Expr> =
            traction.iter().zip(&X).map(|(&t, &x)| self.graph.mul(t, x)).collect();
        let sum = self.graph.sum_of(terms);
        let along = self.graph.div(sum, radius);
        let share = self.graph.div(along, radius);
        let mut shear = traction.to_vec();
        for (t, &x) in shear.iter_mut().zip(&X) {
            let part = self.graph.mul(share, x);
            *t = self.graph.sub(*t, part);
        }
        [vec![along], shear]
    }

    fn conditions(&self) -> Vec<Condition> {
        let here = |boundary: &&Boundary| boundary.surface == self.surface;
        self.spec.boundaries.iter().filter(here).map(|boundary| boundary.condition).collect()
    }

    /// Whether the outward normal points the way of the coordinate.
    fn outward(&self) -> bool {
        matches!(self.surface, Surface::Upper(_) | Surface::Outer | Surface::LastAngle)
    }

    fn column(&mut self, P: &[Vec<Expr>], j: usize) -> Vec<Expr> {
        let outward = self.outward();
        P.iter().map(|row| if outward { row[j] } else { self.graph.neg(row[j]) }).collect()
    }

    /// The Cartesian coordinates that a rim is round in: about an axis the normal has no component along it.
    fn round(&self) -> Vec<Expr> {
        let count = match &self.spec.domain {
            Domain::Tube { .. } => 2,
            Domain::Box { .. } | Domain::Annulus { .. } => self.geometry.cartesian.len(),
        };
        self.geometry.cartesian[..count].to_vec()
    }

    /// `P N` on a rim with `N = X/R` or `-X/R`, in Cartesian components.
    fn across(&mut self, radius: Expr) -> Vec<Expr> {
        let outward = self.outward();
        let P = self.fields.P;
        let X = self.round();
        P.iter()
            .map(|row| {
                let terms: Vec<Expr> =
                    row.iter().zip(&X).map(|(&entry, &x)| self.graph.mul(entry, x)).collect();
                let sum = self.graph.sum_of(terms);
                let quotient = self.graph.div(sum, radius);
                if outward { quotient } else { self.graph.neg(quotient) }
            })
            .collect()
    }

    /// The expression with the coordinate that is fixed on the surface put in, where that does not divide by zero.
    fn placed(&mut self, expr: Expr) -> Expr {
        let placed = self.placing.of(self.graph, expr);
        if self.graph.divides_by_zero(placed) { expr } else { placed }
    }

    fn zero_if_vanishing(&mut self, expr: Expr) -> Expr {
        if self.graph.vanishes(expr) { Graph::ZERO } else { expr }
    }
}
