//! Which terms of the momentum balance a solution exercises, and how much.
//!
//! A mistake in a term that vanishes in a solution cannot be seen with it. The share of a part is measured over sample
//! points and times: root mean squares, relative to those of what the part is a part of.

use mmsmith_runtime::Law;
use mmsmith_runtime::{AnySolution, ComponentCondition, Condition, Solution};
use nalgebra::{SMatrix, SVector};
use serde::Serialize;
use std::fmt;

use crate::across::Across;
use crate::case::law;
use crate::check::{CheckError, with};
use crate::difference::slope;
use crate::dimension::in_dimension;
use crate::error::SceneError;
use crate::points;
use crate::precision::Precision;

/// A part of the balance, or of what a solver must model, in which a mistake may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    /// `rho0 a`.
    Inertia,
    /// `dP_ii/dX_i` along an axis, in the balance of that axis.
    NormalStress(usize),
    /// `dP_iJ/dX_J` for two different axes, in the balance of the first.
    ShearStress(usize, usize),
    /// `rho0 b`.
    BodyForce,
    /// The part of the stress from the first Lame constant, or from the factor of `ln J`.
    Lambda,
    /// The difference of the stress from that of linear elasticity, which grows with rotation.
    NonlinearStress,
    /// `J - 1`, in units of `H`.
    VolumeChange,
    /// The rotation in `F`: its skew part, in units of `H`.
    Rotation,
    /// The skew part of `P`, which a transposed stress gets wrong.
    SkewStress,
    /// The traction on surfaces that are loaded, in units of the stress in the body.
    LoadedSurface,
    /// Whether a surface is free of traction.
    FreeSurface,
    /// Whether there are walls on which the body slides, or planes of symmetry.
    Wall,
}

impl Part {
    /// Every part, in three dimensions.
    #[must_use]
    pub fn all() -> Vec<Part> {
        let pairs = (0..3).flat_map(|i| (0..3).map(move |J| (i, J))).filter(|(i, J)| i != J);
        let mut parts = vec![Part::Inertia];
        parts.extend((0..3).map(Part::NormalStress));
        parts.extend(pairs.map(|(i, J)| Part::ShearStress(i, J)));
        parts.extend([
            Part::BodyForce,
            Part::Lambda,
            Part::NonlinearStress,
            Part::VolumeChange,
            Part::Rotation,
            Part::SkewStress,
            Part::LoadedSurface,
            Part::FreeSurface,
            Part::Wall,
        ]);
        parts
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let axis = |i: usize| ["X", "Y", "Z"].get(i).copied().unwrap_or("?");
        match *self {
            Part::Inertia => f.write_str("inertia"),
            Part::NormalStress(i) => write!(f, "normal stress, dP_{0}{0}/d{0}", axis(i)),
            Part::ShearStress(i, J) => {
                write!(f, "shear stress, dP_{}{1}/d{1}", axis(i), axis(J))
            }
            Part::BodyForce => f.write_str("body force"),
            Part::Lambda => f.write_str("lambda"),
            Part::NonlinearStress => f.write_str("nonlinear stress"),
            Part::VolumeChange => f.write_str("change of volume"),
            Part::Rotation => f.write_str("rotation, F not symmetric"),
            Part::SkewStress => f.write_str("P not symmetric"),
            Part::LoadedSurface => f.write_str("loaded surface"),
            Part::FreeSurface => f.write_str("free surface"),
            Part::Wall => f.write_str("sliding wall or symmetry plane"),
        }
    }
}

/// How much of a part there is in a solution.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Share {
    /// The part.
    pub part: Part,
    /// Between 0, not there at all, and about 1; of a loaded surface it is above 1 where stresses are largest there.
    pub share: f64,
}

/// The share of each of [`Part::all`], from `count` sample points and times; zero for axes that the solution lacks.
///
/// # Errors
///
/// [`CheckError`] for a shape or a dimension that is not known here, or no points.
pub fn coverage(solution: &AnySolution<f64>, count: usize) -> Result<Vec<Share>, CheckError> {
    in_dimension!(solution, |s| coverage_in(s, count), else Err(CheckError::Dimension))
}

/// Sums of squares over the samples.
#[derive(Default)]
struct Squares {
    inertia: f64,
    /// `dP_iJ/dX_J` over the density.
    stress: [[f64; 3]; 3],
    body_force: f64,
    strain: f64,
    volume_change: f64,
    skew_strain: f64,
    P: f64,
    skew_P: f64,
    lambda: f64,
    nonlinear: f64,
    /// The stress of linear elasticity.
    linear: f64,
}

fn coverage_in<const D: usize>(
    solution: &dyn Solution<f64, D>,
    count: usize,
) -> Result<Vec<Share>, CheckError>
where
    f64: Precision<D>,
{
    if count == 0 {
        return Err(CheckError::NoPoints);
    }
    let domain = solution.domain();
    if points::size(&domain).is_none() {
        return Err(SceneError::Unknown { what: "shape", value: format!("{domain:?}") }.into());
    }
    let exact = solution.law();
    let pressure = Pressure::of(exact.clone());
    // Of a law with memory the response to sudden changes.
    let (law, has_memory) = match law::<f64, D>(exact).ok() {
        Some(mmsmith_mpm::Law::WithMemory(own)) => {
            (own.elastic().map(mmsmith_mpm::Law::Library), true)
        }
        law => (law, false),
    };
    let density = solution.density();
    let mut squares = Squares::default();
    for n in 0..count {
        let Some((X, t)) = points::interior(&domain, solution.period(), n) else { continue };
        let fields = solution.fields(&X, t);
        squares.inertia += fields.a.norm_squared();
        squares.body_force += fields.b.norm_squared();
        squares.strain += fields.H.norm_squared();
        squares.volume_change += (fields.J - 1.0).powi(2);
        squares.skew_strain += skew(&fields.H);
        squares.P += fields.P.norm_squared();
        squares.skew_P += skew(&fields.P);
        for J in 0..D {
            let column = |s| -> SVector<f64, D> {
                solution.first_piola_kirchhoff(&with(&X, J, s), t).column(J).into_owned()
            };
            let slope = slope(column, X[J], points::reach(&domain, &X, J)) / density;
            for i in 0..D {
                squares.stress[i][J] += slope[i] * slope[i];
            }
        }
        if let Some(P) = pressure.as_ref().and_then(|part| part.stress(solution, &X, t, &fields.F))
        {
            squares.lambda += P.norm_squared();
        }
        if let Some(law) = &law {
            let P = law.stress_at_small_strain(&fields.H);
            let own = match has_memory {
                true => law.first_piola_kirchhoff(&fields.F).unwrap_or(P),
                false => fields.P,
            };
            squares.nonlinear += (own - P).norm_squared();
            squares.linear += P.norm_squared();
        }
    }
    let share = |part: f64, of: f64| if part == 0.0 { 0.0 } else { (part / of).sqrt() };
    let balance = |i: usize| squares.stress[i].iter().sum::<f64>();
    let whole = squares.inertia + squares.body_force + (0..3).map(balance).sum::<f64>();
    // In a rigid motion there is no stress, but linear elasticity has some.
    let stress = squares.P.max(squares.linear);
    let has = |is_meant: &dyn Fn(Condition) -> bool| {
        f64::from(u8::from(solution.boundaries().iter().any(|b| is_meant(b.condition))))
    };
    let shares = Part::all().into_iter().map(|part| {
        let share = match part {
            Part::Inertia => share(squares.inertia, whole),
            Part::NormalStress(i) => share(squares.stress[i][i], whole),
            Part::ShearStress(i, J) => share(squares.stress[i][J], whole),
            Part::BodyForce => share(squares.body_force, whole),
            Part::Lambda => share(squares.lambda, stress),
            Part::NonlinearStress => share(squares.nonlinear, stress),
            Part::VolumeChange => share(squares.volume_change, squares.strain),
            Part::Rotation => share(squares.skew_strain, squares.strain),
            Part::SkewStress => share(squares.skew_P, squares.P),
            Part::LoadedSurface => share(loads(solution, count), squares.P),
            Part::FreeSurface => {
                has(&|condition| condition.gives(ComponentCondition::TractionFree))
            }
            Part::Wall => has(&Condition::is_wall),
        };
        // Round-off is no share: where something vanishes but for it, nothing is exercised. Nor is a share of fields that are no numbers.
        Share { part, share: if share >= ROUND_OFF { share } else { 0.0 } }
    });
    Ok(shares.collect())
}

/// Differences leave as much of what vanishes.
const ROUND_OFF: f64 = 1e-9;

/// The squared norm of the skew part.
fn skew<const D: usize>(A: &SMatrix<f64, D, D>) -> f64 {
    ((A - A.transpose()) * 0.5).norm_squared()
}

/// The part of a law's stress from the modulus of a change of volume: that of the law less that of the law without it.
enum Pressure<const D: usize> {
    /// A law of the deformation and, where it has memory, of internal variables.
    Of { law: mmsmith_mpm::Law<f64, D>, without: mmsmith_mpm::Law<f64, D> },
    /// A law without stress across: that in space at the stretch there.
    InSpace { law: Box<Across<D>>, without: Box<Across<D>> },
}

impl<const D: usize> Pressure<D>
where
    f64: Precision<D>,
{
    /// None where the law cannot be read.
    fn of(declared: Law<f64>) -> Option<Self> {
        // Elements and flow change the shape alone: the pressure is that of the elastic law.
        let declared = match declared {
            Law::WithMemory(law) => Law::Library(law.elastic),
            law => law,
        };
        let without = without_pressure(declared.clone());
        if let (Some(law), Some(without)) =
            (Across::of(declared.clone()), Across::of(without.clone()))
        {
            let (law, without) = (Box::new(law), Box::new(without));
            return Some(Self::InSpace { law, without });
        }
        Some(Self::Of { law: law(declared).ok()?, without: law(without).ok()? })
    }

    fn stress(
        &self,
        solution: &dyn Solution<f64, D>,
        X: &SVector<f64, D>,
        t: f64,
        F: &SMatrix<f64, D, D>,
    ) -> Option<SMatrix<f64, D, D>> {
        match self {
            Self::Of { law, without } => {
                let q = match law.variables().is_empty() {
                    true => Vec::new(),
                    false => solution.internal(X, t),
                };
                let of = |law: &mmsmith_mpm::Law<f64, D>| {
                    law.with_variables(&q).first_piola_kirchhoff(F)
                };
                Some(of(law)? - of(without)?)
            }
            Self::InSpace { law, without } if law.is_cartesian => {
                let stretch = solution.stretch_across(X, t);
                let difference = law.stress(F, stretch) - without.stress(F, stretch);
                Some(difference.fixed_view::<D, D>(0, 0).into_owned())
            }
            Self::InSpace { .. } => None,
        }
    }
}

/// The law without the modulus of a change of volume, where it has one of its own.
fn without_pressure(law: Law<f64>) -> Law<f64> {
    match law {
        Law::Library(material) => {
            let modulus = material.row().volume;
            let keep = |name, value| if modulus == Some(name) { 0.0 } else { value };
            Law::Library(material.map_named(keep))
        }
        Law::Stated(mut stated) => {
            let moduli = stated.constants.iter_mut().filter(|(name, _)| VOLUME.contains(&&**name));
            moduli.for_each(|(_, value)| *value = 0.0);
            Law::Stated(stated)
        }
        law @ Law::WithMemory(_) => law,
    }
}

/// The moduli of a change of volume in the laws of the library, which formulas made of these have too.
const VOLUME: [&str; 2] = ["lambda", "kappa"];

/// The sum of the squared tractions on the surface that is loaded most; as many points as in the body.
fn loads<const D: usize>(solution: &dyn Solution<f64, D>, count: usize) -> f64 {
    let domain = solution.domain();
    let loaded = solution.boundaries().iter().filter(|b| {
        let given = [ComponentCondition::PrescribedTraction, ComponentCondition::PrescribedMotion];
        given.into_iter().any(|one| b.condition.gives(one))
    });
    loaded
        .map(|boundary| {
            (0..count)
                .filter_map(|n| {
                    let (X, N) = points::surface(&domain, boundary.surface, n)?;
                    let t = solution.period() * points::quasirandom(n, D, D + 1);
                    Some((solution.first_piola_kirchhoff(&X, t) * N).norm_squared())
                })
                .sum()
        })
        .fold(0.0, f64::max)
}

/// The fewest of `solutions` that together exercise every part that any of them does to at least `threshold`; the first
/// such set in their order.
///
/// Each entry holds the shares of [`Part::all`].
#[must_use]
pub fn smallest_set(solutions: &[Vec<Share>], threshold: f64) -> Vec<usize> {
    let exercised: Vec<u64> = solutions
        .iter()
        .map(|shares| {
            let bits = shares.iter().enumerate().filter(|(_, s)| s.share >= threshold);
            bits.fold(0, |set, (index, _)| set | 1 << index)
        })
        .collect();
    let all = exercised.iter().fold(0, |union, set| union | set);
    for size in 0..=exercised.len() {
        let mut chosen: Vec<usize> = (0..size).collect();
        loop {
            if chosen.iter().fold(0, |union, &i| union | exercised[i]) == all {
                return chosen;
            }
            // The next combination in lexicographic order.
            let Some(place) = (0..size).rev().find(|&k| chosen[k] + (size - k) < exercised.len())
            else {
                break;
            };
            chosen[place] += 1;
            for k in place + 1..size {
                chosen[k] = chosen[k - 1] + 1;
            }
        }
    }
    Vec::new()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_set_covers_everything() {
        let shares = |parts: &[f64]| -> Vec<Share> {
            parts.iter().map(|&share| Share { part: Part::Inertia, share }).collect()
        };
        let solutions =
            [shares(&[0.5, 0.0, 0.0]), shares(&[0.5, 0.2, 0.001]), shares(&[0.0, 0.1, 0.9])];
        assert_eq!(smallest_set(&solutions, 0.01), [0, 2]);
        assert_eq!(smallest_set(&solutions, 0.15), [1, 2]);
        assert_eq!(smallest_set(&solutions, 1.0), Vec::<usize>::new());
        assert_eq!(smallest_set(&[], 0.1), Vec::<usize>::new());
    }
}
