//! Newton's method: load steps, cut-backs, halved steps, and when to be content.

use mmsmith_lanes::tensor::determinant;
use mmsmith_laws::{Differentiated, Stressed};
use mmsmith_sparse::{Factors, SparseError};

use super::stiffness::Stiffness;
use super::{Equilibrium, LoadStep, Obstacle, Statics, StaticsError};

/// Steps of Newton's in a load step.
const MOST_ITERATIONS: usize = 30;

/// The shortest load step, as a share of the usual one.
const SHORTEST: f64 = 1.0 / 4096.0;

/// How often a step of Newton's is halved.
const MOST_HALVINGS: usize = 8;

/// A load step that failed: why, and the residuals until then.
struct Failure {
    cause: Obstacle,
    residuals: Vec<f64>,
}

/// A step of Newton's by component, and what it does to the energy.
struct Direction<const D: usize> {
    change: [Vec<f64>; D],
    /// The changes of the unknowns, and their product with the residual before.
    solution: Vec<f64>,
    product: f64,
}

impl<const D: usize> Statics<D>
where
    f64: Stressed<D> + Differentiated<D>,
{
    /// Goes from the place that the body has to the whole load.
    pub(super) fn follow(
        &mut self,
        steps: usize,
        seen: &mut dyn FnMut(f64, &[f64]),
    ) -> Result<Equilibrium, StaticsError> {
        let usual = 1.0 / steps.max(1) as f64;
        let (mut reached, mut length) = (0.0, usual);
        let mut found = Equilibrium { steps: Vec::new(), cut_backs: 0 };
        while reached < 1.0 {
            // A remainder that is rounding alone is no step of its own.
            let next = if reached + length > 1.0 - 1e-9 { 1.0 } else { reached + length };
            let before = self.components.each_ref().map(|component| component.u.clone());
            match self.load_step(reached, next, seen) {
                Ok(step) => {
                    found.steps.push(step);
                    reached = next;
                    length = usual.min(2.0 * length);
                }
                Err(Failure { cause, residuals }) => {
                    let components = self.components.iter_mut().zip(before);
                    components.for_each(|(component, u)| component.u = u);
                    if length <= SHORTEST * usual {
                        return Err(StaticsError::NotReached {
                            factor: next,
                            reached,
                            cut_backs: found.cut_backs,
                            residuals,
                            cause,
                        });
                    }
                    length *= 0.5;
                    found.cut_backs += 1;
                }
            }
        }
        Ok(found)
    }

    /// A load step, from the equilibrium at a load factor to that at another one.
    fn load_step(
        &mut self,
        from: f64,
        to: f64,
        seen: &mut dyn FnMut(f64, &[f64]),
    ) -> Result<LoadStep, Failure> {
        let mut step = LoadStep {
            factor: to,
            residuals: Vec::new(),
            rounding: 0.0,
            halvings: 0,
            factors: Factors::Cholesky,
        };
        match self.iterate(from, &mut step, seen) {
            Ok(()) => Ok(step),
            Err(cause) => Err(Failure { cause, residuals: step.residuals }),
        }
    }

    fn iterate(
        &mut self,
        from: f64,
        step: &mut LoadStep,
        seen: &mut dyn FnMut(f64, &[f64]),
    ) -> Result<(), Obstacle> {
        let to = step.factor;
        let mut residual = self.residual(to).map_err(|point| self.inverted(point))?;
        let mut stiffness = self.stiffness();
        // The sides move with all the rest.
        let moves: [Vec<f64>; D] = std::array::from_fn(|c| {
            let both = self.start.given[c].iter().zip(&self.whole.given[c]);
            both.map(|(start, whole)| (to - from) * (whole - start)).collect()
        });
        if moves.iter().flatten().any(|value| *value != 0.0) {
            let forces = self.product(&moves);
            for (sums, forces) in residual.iter_mut().zip(&forces) {
                sums.iter_mut().zip(forces).for_each(|(sum, force)| *sum += force);
            }
        }
        let mut right = self.unknowns_of(&residual);
        step.residuals.push(norm(&right));
        let mut direction = self.direction(&stiffness, right, step)?;
        for (change, moves) in direction.change.iter_mut().zip(&moves) {
            change.iter_mut().zip(moves).for_each(|(change, given)| *change += given);
        }
        self.move_by(1.0, &direction);
        residual = self.residual(to).map_err(|point| self.inverted(point))?;
        loop {
            right = self.unknowns_of(&residual);
            step.residuals.push(norm(&right));
            seen(to, &step.residuals);
            // What rounding leaves is known from the sums of the matrix alone.
            stiffness = self.stiffness();
            step.rounding = f64::EPSILON * self.magnitude(&stiffness, to);
            if is_done(step) {
                return Ok(());
            }
            if step.residuals.len() > MOST_ITERATIONS {
                return Err(stalled(step));
            }
            direction = self.direction(&stiffness, right, step)?;
            residual = self.search(&direction, step)?;
        }
    }

    /// Moves by a step of Newton's, or by a part of it; the residual there.
    fn search(
        &mut self,
        direction: &Direction<D>,
        step: &mut LoadStep,
    ) -> Result<[Vec<f64>; D], Obstacle> {
        let before = *step.residuals.last().unwrap_or(&f64::INFINITY);
        let mut part = 1.0;
        let mut inverted = None;
        for halving in 0..=MOST_HALVINGS {
            self.move_by(part, direction);
            match self.residual(step.factor) {
                Ok(residual) => {
                    let right = self.unknowns_of(&residual);
                    let both = direction.solution.iter().zip(&right);
                    let product: f64 = both.map(|(x, y)| x * y).sum();
                    // Next to rounding neither tells anything.
                    let is_small = before <= 1e6 * step.rounding;
                    let falls =
                        norm(&right) <= before || product.abs() <= 0.5 * direction.product.abs();
                    if falls || is_small {
                        step.halvings += halving;
                        return Ok(residual);
                    }
                }
                Err(point) => inverted = Some(self.inverted(point)),
            }
            self.move_by(-part, direction);
            part *= 0.5;
        }
        Err(inverted.unwrap_or_else(|| stalled(step)))
    }

    /// The step that a right-hand side asks for.
    fn direction(
        &mut self,
        stiffness: &Stiffness,
        right: Vec<f64>,
        step: &mut LoadStep,
    ) -> Result<Direction<D>, Obstacle> {
        let mut solution = right.clone();
        let solved = self.pattern.solve(&stiffness.values, stiffness.is_symmetric, &mut solution);
        step.factors = solved.map_err(|error| match error {
            SparseError::Memory => Obstacle::Memory,
            _ => Obstacle::Singular,
        })?;
        let product = solution.iter().zip(&right).map(|(x, y)| x * y).sum();
        let change = self.numbering.unknown.each_ref().map(|unknown| {
            unknown.iter().map(|own| own.map_or(0.0, |own| solution[own])).collect()
        });
        Ok(Direction { change, solution, product })
    }

    fn move_by(&mut self, part: f64, direction: &Direction<D>) {
        for (component, change) in self.components.iter_mut().zip(&direction.change) {
            component.u.iter_mut().zip(change).for_each(|(u, change)| *u += part * change);
        }
    }

    /// The sums over coefficients that are the same unknown; what belongs to given ones is left out.
    fn unknowns_of(&self, sums: &[Vec<f64>; D]) -> Vec<f64> {
        let mut all = vec![0.0; self.numbering.count];
        for (unknown, sums) in self.numbering.unknown.iter().zip(sums) {
            for (unknown, sum) in unknown.iter().zip(sums) {
                if let Some(unknown) = unknown {
                    all[*unknown] += sum;
                }
            }
        }
        all
    }

    /// The size of all that is rounded in the residual: its terms, and the displacements times the stiffness. What is left of a load that is
    /// taken back has the rounding of that load.
    fn magnitude(&self, stiffness: &Stiffness, factor: f64) -> f64 {
        let mut u = vec![0.0; self.numbering.count];
        for (c, unknown) in self.numbering.unknown.iter().enumerate() {
            let both = self.components[c].u.iter().zip(&self.start_u[c]);
            for (unknown, (value, start)) in unknown.iter().zip(both) {
                if let Some(unknown) = unknown {
                    u[*unknown] = value.abs() + start.abs();
                }
            }
        }
        let of_displacements = norm(&self.pattern.magnitudes(&stiffness.values, &u));
        let of_forces = norm(&self.unknowns_of(&self.start.forces))
            + factor * norm(&self.unknowns_of(&self.whole.forces));
        stiffness.magnitude + of_displacements + of_forces
    }

    /// The obstacle of a point that is turned inside out.
    fn inverted(&self, point: usize) -> Obstacle {
        let X = self.at.X[point].iter().copied().collect();
        Obstacle::Inverted { point, X, J: determinant(&self.F[point]) }
    }
}

fn norm(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum::<f64>().sqrt()
}

/// Whether the residual is rounding, or does not fall any more and is next to it.
fn is_done(step: &LoadStep) -> bool {
    /// Rounding errors of displacements, which forces show as well, are some of these.
    const NEXT_TO: f64 = 1e5;
    let [.., before, last] = step.residuals[..] else { return false };
    last <= step.rounding || (last <= NEXT_TO * step.rounding && last > 0.25 * before)
}

fn stalled(step: &LoadStep) -> Obstacle {
    let residual = step.residuals.last().copied().unwrap_or(f64::NAN);
    Obstacle::Stalled { residual, rounding: step.rounding }
}
