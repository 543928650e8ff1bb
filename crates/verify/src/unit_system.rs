//! Whether two solutions are one motion, stated in other units.

use mmsmith_runtime::{AnySolution, Solution};

use crate::points;

/// Places and times that are looked at.
const PLACES: usize = 8;
/// Differences that are rounding, as shares.
const ROUNDING: f64 = 1e-9;

/// Powers of two by which numbers of one quantity change between two systems of units.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnitPowers {
    /// The power of masses.
    pub mass: i32,
    /// The power of lengths.
    pub length: i32,
    /// The power of times.
    pub time: i32,
}

impl UnitPowers {
    /// Powers of stresses.
    #[must_use]
    pub fn stress(self) -> i32 {
        self.mass - self.length - 2 * self.time
    }

    /// Powers of masses per volume.
    #[must_use]
    pub fn density(self) -> i32 {
        self.mass - 3 * self.length
    }

    /// Whether `other` is the motion of `one` with numbers that have changed by these powers: body, density, period, displacement,
    /// stress and body force, at some places and times.
    #[must_use]
    pub fn relate(self, one: &AnySolution<f64>, other: &AnySolution<f64>) -> bool {
        match (one, other) {
            (AnySolution::One(one), AnySolution::One(other)) => self.between(&**one, &**other),
            (AnySolution::Two(one), AnySolution::Two(other)) => self.between(&**one, &**other),
            (AnySolution::Three(one), AnySolution::Three(other)) => self.between(&**one, &**other),
            _ => false,
        }
    }

    fn between<const D: usize>(
        self,
        one: &dyn Solution<f64, D>,
        other: &dyn Solution<f64, D>,
    ) -> bool {
        let power = |exponent: i32| 2.0_f64.powi(exponent);
        let [length, time] = [self.length, self.time].map(power);
        let is_same = |one: f64, other: f64| (one - other).abs() <= ROUNDING * one.abs();
        let measures = [
            (one.density() * power(self.density()), other.density()),
            (one.period() * time, other.period()),
            (one.cell_length() * length, other.cell_length()),
        ];
        if !measures.into_iter().all(|(one, other)| is_same(one, other)) {
            return false;
        }
        let domain = one.domain();
        let [size, other_size] = [points::size(&domain), points::size(&other.domain())];
        let (Some(size), Some(other_size)) = (size, other_size) else { return false };
        let acceleration = length / (time * time);
        let modulus = one.density() * one.wave_speed().powi(2);
        let force = modulus / (one.density() * size);
        is_same(size * length, other_size)
            && (0..PLACES).filter_map(|n| points::interior(&domain, one.period(), n)).all(
                |(X, t)| {
                    let (Y, s) = (X * length, t * time);
                    let apart = [
                        (one.displacement(&X, t) - other.displacement(&Y, s) / length).norm()
                            / size,
                        (one.first_piola_kirchhoff(&X, t)
                            - other.first_piola_kirchhoff(&Y, s) / power(self.stress()))
                        .norm()
                            / modulus,
                        (one.body_force(&X, t) - other.body_force(&Y, s) / acceleration).norm()
                            / force,
                    ];
                    let sizes = [
                        one.displacement(&X, t).norm() / size,
                        one.first_piola_kirchhoff(&X, t).norm() / modulus,
                        one.body_force(&X, t).norm() / force,
                    ];
                    apart.into_iter().zip(sizes).all(|(apart, own)| apart <= ROUNDING * (1.0 + own))
                },
            )
    }
}
