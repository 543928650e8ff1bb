//! The stress at the start as a specification writes it.

use super::{Entries, Text};
use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};
use std::fmt;

/// A stress at the start as it is written; one without components is met with the line to write.
pub(crate) enum PrestressEntry {
    Components(Entries<Text>),
    Bare(String),
}

impl<'de> Deserialize<'de> for PrestressEntry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct EntryVisitor;
        impl<'de> Visitor<'de> for EntryVisitor {
            type Value = PrestressEntry;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table of components, as in prestress = { 11 = 's0', 12 = '0' }")
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<PrestressEntry, A::Error> {
                let table = serde::de::value::MapAccessDeserializer::new(map);
                Entries::deserialize(table).map(PrestressEntry::Components)
            }

            fn visit_str<E>(self, value: &str) -> Result<PrestressEntry, E> {
                Ok(PrestressEntry::Bare(value.to_owned()))
            }

            fn visit_i64<E>(self, value: i64) -> Result<PrestressEntry, E> {
                Ok(PrestressEntry::Bare(value.to_string()))
            }

            fn visit_f64<E>(self, value: f64) -> Result<PrestressEntry, E> {
                Ok(PrestressEntry::Bare(format!("{value:?}")))
            }
        }
        deserializer.deserialize_any(EntryVisitor)
    }
}
