//! Laws that depend on more than the deformation: on its rate, on fields of position and time, and on internal variables with rates of their
//! own.
//!
//! A particle has columns of numbers besides its deformation: the internal variables that the law states; its reference position and the
//! time, where there are given fields; and the rate of the deformation gradient, where a text names one. An increment goes by the explicit
//! midpoint rule, of second order; its steps have to be shorter than twice the shortest time that the rates decay in. Within an increment the
//! rate is the change over the time; at its end, where stresses are wanted, it is that of the parabola through the last two increments.

use std::marker::PhantomData;

use mmsmith_vocabulary::Internal;
use nalgebra::{RealField, SMatrix, SVector};

use crate::program::{Given, Portion, Program};
use crate::stress::Kinematics;
use crate::tape::{Tape, Value};
use crate::text::Names;
use crate::{Response, StatedLawError};

/// Names of the coordinates.
const COORDINATES: [&str; 3] = ["X", "Y", "Z"];

/// A law with memory that is stated as text, for a number type `T` of `f64` or `f32`.
#[derive(Clone, Debug)]
pub struct StatedMemory<T> {
    dimension: usize,
    /// The names of the columns, those of stated variables first. Others are in parentheses.
    columns: Vec<String>,
    stated: usize,
    has_rates: bool,
    stress: Program,
    rates: Program,
    initial: Program,
    number: PhantomData<fn() -> T>,
}

impl<T: RealField + Copy> StatedMemory<T> {
    /// The law of `response` in a dimension, with the values of its constants, fields of position and time, and internal variables.
    ///
    /// # Errors
    ///
    /// [`StatedLawError`] where a text is no law.
    pub fn new(
        dimension: usize,
        response: &Response,
        constants: &[(String, f64)],
        given: &[(String, String)],
        internal: &[Internal],
    ) -> Result<Self, StatedLawError> {
        if !(1..=3).contains(&dimension) {
            return Err(StatedLawError::Dimension(dimension));
        }
        let mut tape = Tape::default();
        let mut kinematics = Kinematics::new(&mut tape, dimension);
        let mut places = Names::default();
        for (name, value) in constants {
            kinematics.names.add(name, *value)?;
            places.add(name, *value)?;
        }
        let first = internal.len();
        let coordinates = COORDINATES[..dimension].iter().chain(&["t"]);
        for (k, name) in coordinates.enumerate() {
            let value = tape.input(first + k);
            places.add_value(name, value)?;
        }
        for (name, text) in given {
            let value = places.read(&mut tape, text)?;
            places.add_value(name, value)?;
            kinematics.names.add_value(name, value)?;
        }
        for (k, variable) in internal.iter().enumerate() {
            let value = tape.input(k);
            kinematics.names.add_value(&variable.name, value)?;
        }
        kinematics.add_rates(&mut tape, first + dimension + 1);
        let read = |tape: &mut Tape, names: &Names, text: &str| names.read(tape, text);
        let stress: Vec<Value> = match response {
            Response::Energy(text) => {
                let energy = kinematics.names.read(&mut tape, text)?;
                let P = kinematics.stress(&mut tape, energy);
                P[..dimension].iter().flat_map(|row| &row[..dimension]).copied().collect()
            }
            Response::Stress(rows) => {
                let is_square = rows.len() == dimension;
                if !is_square || rows.iter().any(|row| row.len() != dimension) {
                    return Err(StatedLawError::Shape { dimension });
                }
                let texts = rows.iter().flatten();
                texts
                    .map(|text| read(&mut tape, &kinematics.names, text))
                    .collect::<Result<_, _>>()?
            }
        };
        let mut rates = Vec::with_capacity(first);
        let mut initial = Vec::with_capacity(first);
        for Internal { rate, initial: start, .. } in internal {
            rates.push(read(&mut tape, &kinematics.names, rate)?);
            initial.push(read(&mut tape, &places, start)?);
        }
        let [stress, rates, initial] =
            [&stress, &rates, &initial].map(|results| Program::new(&tape, results));
        let first_rate = first + dimension + 1;
        let of_rates = first_rate..first_rate + dimension * dimension;
        let has_rates = [&stress, &rates].iter().any(|program| program.takes(&of_rates));
        let mut columns: Vec<String> = internal.iter().map(|own| own.name.clone()).collect();
        columns.extend((1..=dimension).map(|k| format!("(X{k})")));
        columns.push("(t)".into());
        if has_rates {
            let entries =
                || (0..dimension * dimension).map(|m| (m / dimension + 1, m % dimension + 1));
            columns.extend(entries().map(|(i, j)| format!("(Fdot{i}{j})")));
            columns.extend(entries().map(|(i, j)| format!("(Fdot{i}{j} of the last increment)")));
            columns.push("(time since its middle)".into());
        }
        let number = PhantomData;
        Ok(Self { dimension, columns, stated: first, has_rates, stress, rates, initial, number })
    }

    /// The number of dimensions.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// The names of the columns of a particle: those of the stated variables, and then in parentheses what else the law has to know.
    #[must_use]
    pub fn columns(&self) -> &[String] {
        &self.columns
    }

    /// The columns of a particle at time zero. Its rate is unknown.
    pub fn initial<const D: usize>(&self, X: &SVector<T, D>) -> Vec<T> {
        self.assert_dimension(D);
        let first = self.stated;
        let mut columns = vec![T::zero(); self.columns.len()];
        columns[first..first + D].copy_from_slice(X.as_slice());
        if let Some(last) = columns.last_mut().filter(|_| self.has_rates) {
            *last = -T::one();
        }
        let identity: [[[T; 1]; D]; D] =
            crate::matrix(|i, j| [if i == j { T::one() } else { T::zero() }]);
        let inputs: Vec<[T; 1]> = columns.iter().map(|&value| [value]).collect();
        let mut own = vec![[T::zero()]; first];
        let given = Given::Deformation(&identity);
        self.initial.run_with(given, &inputs, Portion::Whole, own.iter_mut());
        for (column, [value]) in columns.iter_mut().zip(own) {
            *column = value;
        }
        columns
    }

    /// Tells the rate of a particle's deformation gradient at time zero.
    pub fn start_at_rate<const D: usize>(&self, rate: &SMatrix<T, D, D>, q: &mut [T]) {
        if !self.has_rates {
            return;
        }
        let first = self.first_rate();
        for (i, j) in (0..D * D).map(|m| (m / D, m % D)) {
            q[first + i * D + j] = rate[(i, j)];
            q[first + D * D + i * D + j] = rate[(i, j)];
        }
        q[first + 2 * D * D] = T::zero();
    }

    /// First Piola-Kirchhoff stresses of particles side by side, as of a [`StatedLaw`](crate::StatedLaw); `q[k][n]` is column `k` of
    /// particle `n`.
    ///
    /// # Panics
    ///
    /// Panics where `D` is not the [dimension](Self::dimension) of the law.
    pub fn first_piola_kirchhoff<const D: usize, const N: usize>(
        &self,
        F: &[[[T; N]; D]; D],
        q: &[[T; N]],
        P: &mut [[[T; N]; D]; D],
    ) {
        self.assert_dimension(D);
        let results = P.iter_mut().flatten();
        self.stress.run_with(Given::Deformation(F), q, Portion::Whole, results);
    }

    /// Advances the columns by an increment of the deformation gradient.
    ///
    /// # Panics
    ///
    /// Panics where `D` is not the [dimension](Self::dimension) of the law.
    pub fn evolve<const D: usize, const N: usize>(
        &self,
        start: &[[[T; N]; D]; D],
        end: &[[[T; N]; D]; D],
        time: T,
        q: &mut [[T; N]],
    ) {
        self.assert_dimension(D);
        let (half, of_time) = (nalgebra::convert::<f64, T>(0.5), self.stated + D);
        let mut mean: [[[T; N]; D]; D] = *start;
        let mut middle = *start;
        for (i, j) in (0..D * D).map(|m| (m / D, m % D)) {
            for n in 0..N {
                mean[i][j][n] = (end[i][j][n] - start[i][j][n]) / time;
                middle[i][j][n] = (end[i][j][n] + start[i][j][n]) * half;
            }
        }
        if self.stated > 0 {
            let mut at = q.to_vec();
            if self.has_rates {
                for (column, rate) in at[self.first_rate()..].iter_mut().zip(mean.iter().flatten())
                {
                    *column = *rate;
                }
            }
            let mut rates = vec![[T::zero(); N]; self.stated];
            let given = Given::Deformation(start);
            self.rates.run_with(given, &at, Portion::Whole, rates.iter_mut());
            for ((at, q), rate) in at.iter_mut().zip(&*q).zip(&rates) {
                for n in 0..N {
                    at[n] = q[n] + half * time * rate[n];
                }
            }
            at[of_time].iter_mut().for_each(|t| *t += half * time);
            let given = Given::Deformation(&middle);
            self.rates.run_with(given, &at, Portion::Whole, rates.iter_mut());
            for (q, rate) in q.iter_mut().zip(&rates) {
                for n in 0..N {
                    q[n] += time * rate[n];
                }
            }
        }
        q[of_time].iter_mut().for_each(|t| *t += time);
        if self.has_rates {
            self.advance_rates(&mean, time, q);
        }
    }

    fn advance_rates<const D: usize, const N: usize>(
        &self,
        mean: &[[[T; N]; D]; D],
        time: T,
        q: &mut [[T; N]],
    ) {
        let half = nalgebra::convert::<f64, T>(0.5) * time;
        let (at_end, rest) = q[self.first_rate()..].split_at_mut(D * D);
        let (last, since) = rest.split_at_mut(D * D);
        let since = &mut since[0];
        for ((at_end, last), mean) in at_end.iter_mut().zip(last).zip(mean.iter().flatten()) {
            for n in 0..N {
                // Without a rate before, that of the increment.
                let is_known = since[n] >= T::zero();
                let slope = (mean[n] - last[n]) / (since[n] + half);
                at_end[n] = if is_known { mean[n] + slope * half } else { mean[n] };
                last[n] = mean[n];
            }
        }
        since.fill(half);
    }

    /// The column of the first component of the rate.
    fn first_rate(&self) -> usize {
        self.stated + self.dimension + 1
    }

    fn assert_dimension(&self, D: usize) {
        assert_eq!(D, self.dimension, "a law in {} dimension(s)", self.dimension);
    }
}
