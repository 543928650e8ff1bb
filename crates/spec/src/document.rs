//! The TOML document as it stands: tables, keys and strings with their places, no meaning yet.

use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};
use std::fmt;
use std::marker::PhantomData;
use std::ops::Range;
use toml::Spanned;

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct Document {
    pub(crate) name: Spanned<String>,
    pub(crate) title: Spanned<String>,
    #[serde(default = "no_text")]
    pub(crate) reference: Spanned<String>,
    pub(crate) coordinates: Spanned<String>,
    pub(crate) dimension: Spanned<usize>,
    #[serde(default)]
    pub(crate) parameters: Entries<Spanned<ParameterTable>>,
    #[serde(default, rename = "let")]
    pub(crate) lets: Entries<Text>,
    #[serde(default)]
    pub(crate) require: Vec<Text>,
    pub(crate) displacement: Entries<Text>,
    pub(crate) material: Spanned<MaterialTable>,
    pub(crate) domain: Spanned<DomainTable>,
    #[serde(default)]
    pub(crate) boundary: Vec<BoundaryTable>,
    pub(crate) solve: Option<Spanned<SolveTable>>,
    pub(crate) with_rotation: Option<Spanned<RotationTable>>,
    #[serde(default)]
    pub(crate) cross_check: Vec<Spanned<CrossCheckTable>>,
    pub(crate) time: Spanned<TimeTable>,
}

fn no_text() -> Spanned<String> {
    Spanned::new(0..0, String::new())
}

impl Document {
    /// Text for people, each with the place of what it belongs to.
    pub(crate) fn free_text(&self) -> impl Iterator<Item = (&str, Range<usize>)> {
        let parameters = self.parameters.0.iter().flat_map(|(name, table)| {
            let (span, table) = (name.span(), table.get_ref());
            [(table.unit.as_str(), span.clone()), (table.description.as_str(), span)]
        });
        let head =
            [&self.title, &self.reference].map(|text| (text.get_ref().as_str(), text.span()));
        let listings = self.cross_check.iter().map(|table| &table.get_ref().source);
        let listings = listings.map(|source| (source.get_ref().as_str(), source.span()));
        head.into_iter().chain(parameters).chain(listings)
    }
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct ParameterTable {
    pub(crate) default: Spanned<f64>,
    #[serde(default)]
    pub(crate) range: Option<Text>,
    #[serde(default)]
    pub(crate) unit: String,
    #[serde(default)]
    pub(crate) description: String,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct MaterialTable {
    pub(crate) law: Spanned<String>,
    pub(crate) lambda: Option<Text>,
    pub(crate) mu: Option<Text>,
    pub(crate) c1: Option<Text>,
    pub(crate) c2: Option<Text>,
    #[serde(rename = "W")]
    pub(crate) W: Option<Text>,
    #[serde(rename = "P")]
    pub(crate) P: Option<Entries<Text>>,
    pub(crate) density: Option<Text>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct DomainTable {
    pub(crate) shape: Spanned<String>,
    pub(crate) lower: Option<Spanned<Vec<Text>>>,
    pub(crate) upper: Option<Spanned<Vec<Text>>>,
    pub(crate) inner: Option<Text>,
    pub(crate) outer: Option<Text>,
    pub(crate) cell_length: Option<Text>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct BoundaryTable {
    pub(crate) surface: Spanned<String>,
    pub(crate) condition: Spanned<String>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct SolveTable {
    pub(crate) unknowns: Vec<Spanned<String>>,
    pub(crate) conditions: Vec<Text>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct RotationTable {
    pub(crate) angle: Text,
    pub(crate) axis: Option<Spanned<String>>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct CrossCheckTable {
    pub(crate) source: Spanned<String>,
    pub(crate) listing: Option<Text>,
    pub(crate) file: Option<Spanned<String>>,
    #[serde(default)]
    pub(crate) names: Entries<Text>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct TimeTable {
    pub(crate) period: Text,
    pub(crate) wave_speed: Option<Text>,
}

/// The text of an expression and its place; a bare number counts as text.
#[derive(Clone, Debug)]
pub(crate) struct Text {
    pub(crate) value: String,
    pub(crate) span: Range<usize>,
}

impl Text {
    /// The place in the file of a place in the text.
    pub(crate) fn locate(&self, source: &str, inner: &Range<usize>) -> Range<usize> {
        let raw = source.get(self.span.clone()).unwrap_or_default();
        let content = raw.trim_start_matches(['"', '\'']);
        // The end of a line right after the quotes is no part of the text.
        let content = content.strip_prefix('\n').unwrap_or(content);
        // Escapes move what follows them; then only the whole string is certain.
        if !content.starts_with(&self.value) {
            return self.span.clone();
        }
        let offset = self.span.end - content.len();
        offset + inner.start..offset + inner.end
    }
}

impl<'de> Deserialize<'de> for Text {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let spanned = Spanned::<Scalar>::deserialize(deserializer)?;
        let span = spanned.span();
        Ok(Text { value: spanned.into_inner().0, span })
    }
}

struct Scalar(String);

impl<'de> Deserialize<'de> for Scalar {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ScalarVisitor;
        impl Visitor<'_> for ScalarVisitor {
            type Value = Scalar;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an expression in quotes, or a number")
            }

            fn visit_str<E>(self, value: &str) -> Result<Scalar, E> {
                Ok(Scalar(value.to_owned()))
            }

            fn visit_i64<E>(self, value: i64) -> Result<Scalar, E> {
                Ok(Scalar(value.to_string()))
            }

            fn visit_f64<E>(self, value: f64) -> Result<Scalar, E> {
                Ok(Scalar(format!("{value:?}")))
            }
        }
        deserializer.deserialize_any(ScalarVisitor)
    }
}

/// A table with free keys, in the order of the file.
pub(crate) struct Entries<V>(pub(crate) Vec<(Spanned<String>, V)>);

impl<V> Default for Entries<V> {
    fn default() -> Self {
        Entries(Vec::new())
    }
}

impl<'de, V: Deserialize<'de>> Deserialize<'de> for Entries<V> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct EntriesVisitor<V>(PhantomData<V>);
        impl<'de, V: Deserialize<'de>> Visitor<'de> for EntriesVisitor<V> {
            type Value = Entries<V>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Entries<V>, A::Error> {
                let mut entries = Vec::new();
                while let Some(entry) = map.next_entry::<Spanned<String>, V>()? {
                    entries.push(entry);
                }
                entries.sort_by_key(|(key, _)| key.span().start);
                Ok(Entries(entries))
            }
        }
        deserializer.deserialize_map(EntriesVisitor(PhantomData))
    }
}
