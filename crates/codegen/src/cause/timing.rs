//! Fields at other times and places.

use super::{Moved, Placed, Steps, Timed, Unused};
use crate::fault::swap_first_two;
use mmsmith_expr::{Expr, Function, Graph, Rational};
use mmsmith_spec::{Fields, Spec};
use std::collections::BTreeMap;

/// The number of iterations towards a reference position. Each multiplies the error by the displacement gradient; the text of the field
/// grows with their number.
const SOUGHT: usize = 6;
/// The steepness of the switch at the start: so large that the switch is zero or one to the last bit at every time step.
const SHARP: i64 = 1000;

fn number(graph: &mut Graph, value: f64) -> Expr {
    let value = Rational::from_float(value).unwrap_or_else(|| Rational::from_integer(0.into()));
    graph.number(value)
}

/// Zero before the time `start`, one after it.
fn later(graph: &mut Graph, start: f64) -> Expr {
    let t = graph.symbol("t");
    let start = number(graph, start);
    let in_starts = graph.div(t, start);
    let beyond = graph.sub(in_starts, Graph::ONE);
    let sharp = graph.integer(SHARP);
    let steep = graph.mul(sharp, beyond);
    let tanh = graph.call(Function::Tanh, &[steep]);
    let half = graph.number(Rational::new(1.into(), 2.into()));
    let sum = graph.add(Graph::ONE, tanh);
    graph.mul(half, sum)
}

/// One before the time `start`, zero after it.
fn earlier(graph: &mut Graph, start: f64) -> Expr {
    let later = later(graph, start);
    graph.sub(Graph::ONE, later)
}

/// A field at a time that is later by `by`.
pub(super) fn shift(fields: &mut Fields, of: Timed, by: f64, start: f64) {
    let graph = &mut fields.graph;
    let t = graph.symbol("t");
    let by = number(graph, by);
    let by = match of {
        Timed::Force | Timed::Inertia | Timed::Traction | Timed::Everything => by,
        Timed::Boundary | Timed::BoundaryVelocity => {
            let later = later(graph, start);
            graph.mul(by, later)
        }
        Timed::InitialVelocity => {
            let earlier = earlier(graph, start);
            graph.mul(by, earlier)
        }
    };
    let shifted = graph.add(t, by);
    let times = BTreeMap::from([(t, shifted)]);
    let mut move_all = |vector: &mut [Expr]| {
        vector.iter_mut().for_each(|entry| *entry = graph.replace(*entry, &times));
    };
    match of {
        Timed::Force => move_all(&mut fields.b),
        Timed::Traction => {
            fields.surfaces.iter_mut().for_each(|surface| move_all(&mut surface.traction));
        }
        Timed::Boundary => move_all(&mut fields.u),
        Timed::Everything => {
            let Fields { u, v, a, b, J, H, F, P, surfaces, .. } = fields;
            [u, v, a, b].into_iter().for_each(|vector| move_all(vector));
            [H, F, P].into_iter().flatten().for_each(|row| move_all(row));
            move_all(std::slice::from_mut(J));
            surfaces.iter_mut().for_each(|surface| move_all(&mut surface.traction));
        }
        Timed::BoundaryVelocity | Timed::InitialVelocity => move_all(&mut fields.v),
        Timed::Inertia => {
            let mut moved = fields.a.clone();
            move_all(&mut moved);
            for ((b, &a), moved) in fields.b.iter_mut().zip(&fields.a).zip(moved) {
                let difference = graph.sub(moved, a);
                *b = graph.add(*b, difference);
            }
        }
    }
}

/// Another motion after the start.
pub(super) fn moves(spec: &Spec, fields: &mut Fields, moved: Moved, start: f64) {
    let Fields { graph, u, v, .. } = fields;
    let later = later(graph, start);
    let mut others = match moved {
        Moved::Velocity => u.clone(),
        Moved::Exchanged => {
            let mut exchanged = u.clone();
            swap_first_two(spec, &mut exchanged);
            exchanged
        }
        Moved::Sign | Moved::Halved | Moved::Doubled => {
            let factor = match moved {
                Moved::Sign => Rational::from_integer((-1).into()),
                Moved::Halved => Rational::from_integer(2.into()),
                _ => Rational::new(1.into(), 2.into()),
            };
            let factor = graph.number(factor);
            u.iter().map(|&u| graph.mul(factor, u)).collect()
        }
    };
    let changed = if moved == Moved::Velocity { v } else { u };
    for (own, other) in changed.iter_mut().zip(&mut others) {
        let difference = graph.sub(*other, *own);
        let change = graph.mul(later, difference);
        *own = graph.add(*own, change);
    }
}

/// A body force that within the first step pushes a body at rest to its velocity; the push is so many steps long.
pub(super) fn push(fields: &mut Fields, length: f64, Steps { dt, start, .. }: Steps) {
    let graph = &mut fields.graph;
    let at_start = earlier(graph, start);
    let duration = number(graph, length * dt);
    let rate = graph.div(at_start, duration);
    // The first velocity of a staggered scheme belongs to half a step before t = 0.
    let t = graph.symbol("t");
    let back = number(graph, if length < 1.0 { 0.0 } else { -dt / 2.0 });
    let before = graph.add(t, back);
    let times = BTreeMap::from([(t, before)]);
    for (b, &v) in fields.b.iter_mut().zip(&fields.v) {
        let velocity = graph.replace(v, &times);
        let push = graph.mul(rate, velocity);
        *b = graph.add(*b, push);
    }
}

/// A field at the reference position that the motion takes to the given position, found by iterations that are written out.
pub(super) fn seek(fields: &mut Fields, placed: Placed) {
    let n = fields.u.len();
    let definitions: BTreeMap<Expr, Expr> = fields.definitions.iter().copied().collect();
    let coordinates: Vec<Expr> = fields.inputs[..n].iter().map(|(X, _)| *X).collect();
    let graph = &mut fields.graph;
    let u: Vec<Expr> = fields.u.iter().map(|&u| graph.replace(u, &definitions)).collect();
    let mut found = coordinates.clone();
    for _ in 0..SOUGHT {
        let places: BTreeMap<Expr, Expr> =
            coordinates.iter().copied().zip(found.iter().copied()).collect();
        // X <- x - u(X)
        found = (0..n)
            .map(|i| {
                let moved = graph.replace(u[i], &places);
                graph.sub(coordinates[i], moved)
            })
            .collect();
    }
    let places: BTreeMap<Expr, Expr> =
        coordinates.iter().copied().zip(found.iter().copied()).collect();
    let mut place_all = |vector: &mut [Expr]| {
        for entry in vector {
            let explicit = graph.replace(*entry, &definitions);
            *entry = graph.replace(explicit, &places);
        }
    };
    match placed {
        Placed::Force => place_all(&mut fields.b),
        Placed::Traction => {
            fields.surfaces.iter_mut().for_each(|surface| place_all(&mut surface.traction));
        }
        Placed::Boundary => place_all(&mut fields.u),
    }
}

/// The body force at points that are shifted by a distance along every axis.
pub(super) fn beside(fields: &mut Fields, by: f64) {
    let n = fields.u.len();
    let definitions: BTreeMap<Expr, Expr> = fields.definitions.iter().copied().collect();
    let Fields { graph, inputs, b, .. } = fields;
    let by = number(graph, by);
    let places: BTreeMap<Expr, Expr> =
        inputs[..n].iter().map(|&(X, _)| (X, graph.add(X, by))).collect();
    for entry in b {
        let explicit = graph.replace(*entry, &definitions);
        *entry = graph.replace(explicit, &places);
    }
}

/// A field larger by a hundredth.
pub(super) fn nudge(fields: &mut Fields, unused: Unused, start: f64) {
    let graph = &mut fields.graph;
    let hundredth = graph.number(Rational::new(1.into(), 100.into()));
    let share = match unused {
        Unused::Force | Unused::ForceComponent | Unused::Traction => hundredth,
        Unused::ForceLater | Unused::TractionLater | Unused::Boundary => {
            let later = later(graph, start);
            graph.mul(hundredth, later)
        }
        Unused::InitialDisplacement => {
            let earlier = earlier(graph, start);
            graph.mul(hundredth, earlier)
        }
        // The field may be zero, which no factor changes.
        Unused::InitialVelocity => return shift(fields, Timed::InitialVelocity, start, start),
    };
    let factor = graph.add(Graph::ONE, share);
    let mut scale = |vector: &mut [Expr]| {
        vector.iter_mut().for_each(|entry| *entry = graph.mul(factor, *entry));
    };
    match unused {
        Unused::Force | Unused::ForceLater => scale(&mut fields.b),
        Unused::ForceComponent => {
            let last = fields.b.len() - 1;
            scale(&mut fields.b[last..]);
        }
        Unused::Traction | Unused::TractionLater => {
            fields.surfaces.iter_mut().for_each(|surface| scale(&mut surface.traction));
        }
        // A solver that is given velocities on its boundary does not ask for u there.
        Unused::Boundary => {
            scale(&mut fields.u);
            scale(&mut fields.v);
        }
        Unused::InitialDisplacement => scale(&mut fields.u),
        Unused::InitialVelocity => {}
    }
}
