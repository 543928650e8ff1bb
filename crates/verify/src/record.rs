//! Rows as they are kept on disk, to be read back to the bit.
//!
//! Output for people has a status in words, and `null` for numbers that JSON does not know. A record has every field of
//! the status by itself, and the bits of such numbers.

use mmsmith_measure::norms::{Field, PerField, PerNorm};
use mmsmith_mpm::StepError;
use serde::de::{Error, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::run::{Row, Status};
use crate::temporal::{Temporal, TemporalRow};

/// A [`Row`] to be kept: written and read, it gives the same row to the bit.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Record {
    cells: usize,
    h: Exact,
    dt: Exact,
    cfl: Exact,
    steps: u64,
    particles: usize,
    wall_s: Exact,
    cpu_s: Exact,
    particle_steps_per_s: Exact,
    /// As in the row; who keeps it may know better.
    pub timed_alone: bool,
    status: End,
    errors: Norms,
    /// Errors of internal variables, by name.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    internal: Vec<(String, PerNorm<Exact>)>,
}

/// A [`Temporal`] to be kept, as [`Record`] is.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TemporalRecord {
    times: Vec<Exact>,
    rows: Vec<DifferenceRecord>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct DifferenceRecord {
    cells: usize,
    h: Exact,
    dt: Exact,
    cfl: Exact,
    steps: u64,
    status: End,
    differences: Norms,
}

type Norms = PerField<PerNorm<Exact>>;

impl From<&Row> for Record {
    fn from(row: &Row) -> Self {
        Self {
            cells: row.cells,
            h: Exact(row.h),
            dt: Exact(row.dt),
            cfl: Exact(row.cfl),
            steps: row.steps,
            particles: row.particles,
            wall_s: Exact(row.wall_s),
            cpu_s: Exact(row.cpu_s),
            particle_steps_per_s: Exact(row.particle_steps_per_s),
            timed_alone: row.timed_alone,
            status: (&row.status).into(),
            errors: row.errors.map(|norms| norms.map(|value| Exact(*value))),
            internal: row
                .internal
                .iter()
                .map(|(name, norms)| (name.clone(), norms.map(|value| Exact(*value))))
                .collect(),
        }
    }
}

impl From<Record> for Row {
    fn from(record: Record) -> Self {
        Self {
            cells: record.cells,
            h: record.h.0,
            dt: record.dt.0,
            cfl: record.cfl.0,
            steps: record.steps,
            particles: record.particles,
            wall_s: record.wall_s.0,
            cpu_s: record.cpu_s.0,
            particle_steps_per_s: record.particle_steps_per_s.0,
            timed_alone: record.timed_alone,
            status: record.status.into(),
            errors: record.errors.map(|norms| norms.map(|value| value.0)),
            internal: record
                .internal
                .into_iter()
                .map(|(name, norms)| (name, norms.map(|value| value.0)))
                .collect(),
        }
    }
}

impl From<&Temporal> for TemporalRecord {
    fn from(temporal: &Temporal) -> Self {
        let rows = temporal.rows.iter().map(|row| DifferenceRecord {
            cells: row.cells,
            h: Exact(row.h),
            dt: Exact(row.dt),
            cfl: Exact(row.cfl),
            steps: row.steps,
            status: (&row.status).into(),
            differences: row.differences.map(|norms| norms.map(|value| Exact(*value))),
        });
        Self {
            times: temporal.times.iter().map(|time| Exact(*time)).collect(),
            rows: rows.collect(),
        }
    }
}

impl From<TemporalRecord> for Temporal {
    fn from(record: TemporalRecord) -> Self {
        let rows = record.rows.into_iter().map(|row| TemporalRow {
            cells: row.cells,
            h: row.h.0,
            dt: row.dt.0,
            cfl: row.cfl.0,
            steps: row.steps,
            status: row.status.into(),
            differences: row.differences.map(|norms| norms.map(|value| value.0)),
        });
        Self::new(record.times.into_iter().map(|time| time.0).collect(), rows.collect())
    }
}

/// How a run ended, every figure by itself.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
enum End {
    Ok,
    Unstable {
        step: u64,
        time: Exact,
        particle: usize,
        error: Exact,
        size: Exact,
    },
    Unresolved {
        displacement: Exact,
        resolution: Exact,
    },
    NotFiniteError {
        field: Field,
    },
    Exceeds {
        error: Exact,
        displacement: Exact,
    },
    Cut {
        step: u64,
        time: Exact,
    },
    Inverted {
        step: usize,
        time: Exact,
        particle: usize,
        J: Exact,
    },
    NotFinite {
        step: usize,
        time: Exact,
        particle: usize,
        position: Vec<Exact>,
        J: Exact,
    },
    LeftGrid {
        step: usize,
        time: Exact,
        particle: usize,
        position: Vec<Exact>,
        axis: usize,
        lower: Exact,
        upper: Exact,
    },
    TooLarge {
        step: usize,
        time: Exact,
        particle: usize,
        axis: usize,
        half_size: Exact,
        limit: Exact,
    },
}

impl From<&Status> for End {
    fn from(status: &Status) -> Self {
        let each = |position: &[f64]| position.iter().map(|x| Exact(*x)).collect();
        match status {
            Status::Ok => Self::Ok,
            &Status::Unstable { step, time, particle, error, size } => {
                let (time, error, size) = (Exact(time), Exact(error), Exact(size));
                Self::Unstable { step, time, particle, error, size }
            }
            &Status::Unresolved { displacement, resolution } => Self::Unresolved {
                displacement: Exact(displacement),
                resolution: Exact(resolution),
            },
            &Status::NotFinite { field } => Self::NotFiniteError { field },
            &Status::Exceeds { error, displacement } => {
                Self::Exceeds { error: Exact(error), displacement: Exact(displacement) }
            }
            &Status::Cut { step, time } => Self::Cut { step, time: Exact(time) },
            Status::Stopped(error) => match *error {
                StepError::Inverted { step, time, particle, J } => {
                    Self::Inverted { step, time: Exact(time), particle, J: Exact(J) }
                }
                StepError::NotFinite { step, time, particle, ref position, J } => {
                    let (time, position, J) = (Exact(time), each(position), Exact(J));
                    Self::NotFinite { step, time, particle, position, J }
                }
                StepError::LeftGrid { step, time, particle, ref position, axis, lower, upper } => {
                    let (time, position) = (Exact(time), each(position));
                    let (lower, upper) = (Exact(lower), Exact(upper));
                    Self::LeftGrid { step, time, particle, position, axis, lower, upper }
                }
                StepError::TooLarge { step, time, particle, axis, half_size, limit } => {
                    let (time, half_size, limit) = (Exact(time), Exact(half_size), Exact(limit));
                    Self::TooLarge { step, time, particle, axis, half_size, limit }
                }
            },
        }
    }
}

impl From<End> for Status {
    fn from(end: End) -> Self {
        let each = |position: Vec<Exact>| position.into_iter().map(|x| x.0).collect();
        Self::Stopped(match end {
            End::Ok => return Self::Ok,
            End::Unstable { step, time, particle, error, size } => {
                let (time, error, size) = (time.0, error.0, size.0);
                return Self::Unstable { step, time, particle, error, size };
            }
            End::Unresolved { displacement, resolution } => {
                let (displacement, resolution) = (displacement.0, resolution.0);
                return Self::Unresolved { displacement, resolution };
            }
            End::NotFiniteError { field } => return Self::NotFinite { field },
            End::Exceeds { error, displacement } => {
                return Self::Exceeds { error: error.0, displacement: displacement.0 };
            }
            End::Cut { step, time } => return Self::Cut { step, time: time.0 },
            End::Inverted { step, time, particle, J } => {
                StepError::Inverted { step, time: time.0, particle, J: J.0 }
            }
            End::NotFinite { step, time, particle, position, J } => {
                let (time, position, J) = (time.0, each(position), J.0);
                StepError::NotFinite { step, time, particle, position, J }
            }
            End::LeftGrid { step, time, particle, position, axis, lower, upper } => {
                let (time, position, lower, upper) = (time.0, each(position), lower.0, upper.0);
                StepError::LeftGrid { step, time, particle, position, axis, lower, upper }
            }
            End::TooLarge { step, time, particle, axis, half_size, limit } => {
                let (time, half_size, limit) = (time.0, half_size.0, limit.0);
                StepError::TooLarge { step, time, particle, axis, half_size, limit }
            }
        })
    }
}

/// A number that JSON gives back to the bit: one that is not finite is written as the text of its bits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Exact(pub(crate) f64);

impl Serialize for Exact {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.0.is_finite() {
            return serializer.serialize_f64(self.0);
        }
        serializer.collect_str(&format_args!("{:#018x}", self.0.to_bits()))
    }
}

impl<'de> Deserialize<'de> for Exact {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Number;
        impl Visitor<'_> for Number {
            type Value = Exact;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a number, or the bits of one as text, such as \"0x7ff0000000000000\"")
            }

            fn visit_f64<E: Error>(self, value: f64) -> Result<Exact, E> {
                Ok(Exact(value))
            }

            fn visit_u64<E: Error>(self, value: u64) -> Result<Exact, E> {
                Ok(Exact(value as f64))
            }

            fn visit_i64<E: Error>(self, value: i64) -> Result<Exact, E> {
                Ok(Exact(value as f64))
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Exact, E> {
                let bits = text.strip_prefix("0x").and_then(|n| u64::from_str_radix(n, 16).ok());
                bits.map(|bits| Exact(f64::from_bits(bits)))
                    .ok_or_else(|| E::invalid_value(serde::de::Unexpected::Str(text), &self))
            }
        }
        deserializer.deserialize_any(Number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(status: Status, error: f64) -> Row {
        let norms = PerNorm { linf: error, l2: 0.1 + 0.2, l1: -0.0 };
        Row {
            cells: 32,
            h: 1.0 / 3.0,
            dt: 1e-300,
            cfl: 0.4,
            steps: u64::MAX,
            particles: 7,
            wall_s: 5e-324,
            cpu_s: 0.25,
            particle_steps_per_s: f64::MAX,
            timed_alone: false,
            status,
            errors: PerField { u: norms, v: norms, F: norms, P: norms },
            internal: vec![("alpha".to_owned(), norms)],
        }
    }

    #[test]
    fn rows_come_back_to_the_bit() {
        let position = vec![f64::NAN, f64::NEG_INFINITY];
        let (step, time, particle, J) = (3, 0.1, 5, f64::NAN);
        let stops = [
            StepError::Inverted { step, time, particle, J: -1e-3 },
            StepError::NotFinite { step, time, particle, position: position.clone(), J },
            StepError::LeftGrid {
                step,
                time,
                particle,
                position,
                axis: 1,
                lower: 0.0,
                upper: f64::INFINITY,
            },
            StepError::TooLarge { step, time, particle, axis: 1, half_size: 2.0, limit: 1.0 },
        ];
        let unstable =
            Status::Unstable { step: 1, time, particle, error: f64::INFINITY, size: 1.0 };
        let cut = Status::Cut { step: 7, time };
        let unresolved = Status::Unresolved { displacement: 1e-200, resolution: 1e-16 };
        let not_finite = Status::NotFinite { field: Field::Stress };
        let statuses = stops.into_iter().map(Status::Stopped).chain([
            Status::Ok,
            unstable,
            cut,
            unresolved,
            not_finite,
            Status::Exceeds { error: 2.0, displacement: 0.1 },
        ]);
        let odd_nan = f64::from_bits(0xfff8_0000_0000_0123);
        for status in statuses {
            for error in [1.6e-2, f64::NAN, f64::INFINITY, odd_nan] {
                let row = row(status.clone(), error);
                let text = serde_json::to_string(&Record::from(&row)).unwrap();
                let back = Row::from(serde_json::from_str::<Record>(&text).unwrap());
                // NaN equals nothing; the debug form shows what it holds, and the bits of one are compared.
                assert_eq!(format!("{back:?}"), format!("{row:?}"), "{text}");
                assert_eq!(back.errors.u.linf.to_bits(), error.to_bits());
                assert_eq!(back.errors.u.l1.to_bits(), (-0.0_f64).to_bits());
            }
        }
    }

    #[test]
    fn text_that_is_no_number_is_refused() {
        for text in ["\"12\"", "\"0x\"", "\"0xg\"", "null", "true"] {
            assert!(serde_json::from_str::<Exact>(text).is_err(), "{text}");
        }
    }
}
