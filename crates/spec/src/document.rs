//! The TOML document as it stands: tables, keys and strings with their places, no meaning yet.

mod prestress;

use crate::Diagnostic;
use crate::source::Source;
use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use std::fmt;
use std::marker::PhantomData;
use std::ops::Range;
use toml::Spanned;

pub(crate) use prestress::PrestressEntry;

#[derive(serde::Deserialize)]
#[serde(
    deny_unknown_fields,
    rename_all = "kebab-case",
    expecting = "a specification, with name = '...' in its first line"
)]
pub(crate) struct Document {
    pub(crate) name: Spanned<String>,
    pub(crate) title: Spanned<String>,
    #[serde(default = "no_text")]
    pub(crate) reference: Spanned<String>,
    pub(crate) coordinates: Spanned<String>,
    pub(crate) dimension: Spanned<Dimension>,
    pub(crate) range_of_inputs: Option<Spanned<String>>,
    #[serde(default)]
    pub(crate) parameters: Entries<ParameterEntry>,
    #[serde(default, rename = "let")]
    pub(crate) lets: Entries<Text>,
    #[serde(default)]
    pub(crate) require: List<Text>,
    pub(crate) displacement: Entries<Text>,
    pub(crate) material: Spanned<MaterialTable>,
    pub(crate) domain: Spanned<DomainTable>,
    #[serde(default)]
    pub(crate) boundary: List<BoundaryTable>,
    pub(crate) solve: Option<Spanned<SolveTable>>,
    pub(crate) with_rotation: Option<Spanned<RotationTable>>,
    #[serde(default)]
    pub(crate) cross_check: List<Spanned<CrossCheckTable>>,
    pub(crate) time: Option<Spanned<TimeTable>>,
    #[serde(default)]
    pub(crate) given: Entries<Text>,
    #[serde(default)]
    pub(crate) internal: Entries<InternalTable>,
    pub(crate) start: Option<Spanned<StartTable>>,
}

/// The most parameters; each costs every evaluation of every field.
const MOST_PARAMETERS: usize = 1_000;
/// The most entries of `[let]`.
const MOST_LETS: usize = 20_000;
/// The most entries of any other list or table.
const MOST_ENTRIES: usize = 1_000;

fn no_text() -> Spanned<String> {
    Spanned::new(0..0, String::new())
}

impl Document {
    /// The time of the motion's period, where it is written.
    pub(crate) fn period(&self) -> Option<&Text> {
        self.time.as_ref()?.get_ref().period.as_ref()
    }

    /// The speed of waves, where it is written.
    pub(crate) fn wave_speed(&self) -> Option<&Text> {
        self.time.as_ref()?.get_ref().wave_speed.as_ref()
    }

    /// Place where entries of the table of times are to be written: that table, or the law where there is none.
    pub(crate) fn time_span(&self) -> Range<usize> {
        self.time.as_ref().map_or_else(|| self.material.span(), Spanned::span)
    }

    /// Refuses more entries than can be worked through soon.
    pub(crate) fn check_sizes(&self, source: &Source<'_>) -> Result<(), Diagnostic> {
        let solve = self.solve.as_ref().map(Spanned::get_ref);
        let sizes = [
            ("[parameters]", self.parameters.0.len(), MOST_PARAMETERS),
            ("[let]", self.lets.0.len(), MOST_LETS),
            ("require", self.require.0.len(), MOST_ENTRIES),
            ("[displacement]", self.displacement.0.len(), MOST_ENTRIES),
            ("[given]", self.given.0.len(), MOST_ENTRIES),
            ("[internal]", self.internal.0.len(), MOST_ENTRIES),
            ("[[material.maxwell]]", self.material.get_ref().maxwell.0.len(), MOST_ENTRIES),
            ("[[boundary]]", self.boundary.0.len(), MOST_ENTRIES),
            ("[[cross-check]]", self.cross_check.0.len(), MOST_ENTRIES),
            ("unknowns", solve.map_or(0, |s| s.unknowns.0.len()), MOST_ENTRIES),
            ("conditions", solve.map_or(0, |s| s.conditions.0.len()), MOST_ENTRIES),
        ];
        for (what, count, most) in sizes {
            if count > most {
                let message = format!("{count} entries of {what}; {most} are the limit");
                return Err(source.error(message, 0..0, None));
            }
        }
        Ok(())
    }

    /// Text for people, each with the place of what it belongs to.
    pub(crate) fn free_text(&self) -> impl Iterator<Item = (&str, Range<usize>)> {
        let parameters = self.parameters.0.iter().filter_map(|(name, entry)| match entry {
            ParameterEntry::Table(table) => Some((name.span(), table)),
            ParameterEntry::Bare(_) => None,
        });
        let parameters = parameters.flat_map(|(span, table)| {
            [(table.unit.as_str(), span.clone()), (table.description.as_str(), span)]
        });
        let head =
            [&self.title, &self.reference].map(|text| (text.get_ref().as_str(), text.span()));
        let listings = self.cross_check.0.iter().map(|table| &table.get_ref().source);
        let listings = listings.map(|source| (source.get_ref().as_str(), source.span()));
        head.into_iter().chain(parameters).chain(listings)
    }
}

#[derive(serde::Deserialize)]
#[serde(
    deny_unknown_fields,
    rename_all = "kebab-case",
    expecting = "a table, as in A = { default = 0.1 }"
)]
pub(crate) struct ParameterTable {
    pub(crate) default: Spanned<Number>,
    #[serde(default)]
    pub(crate) range: Option<Text>,
    #[serde(default)]
    pub(crate) unit: String,
    #[serde(default)]
    pub(crate) description: String,
}

pub(crate) struct MaterialTable {
    pub(crate) law: Spanned<String>,
    /// Constants of laws of the library.
    pub(crate) constants: Entries<Text>,
    pub(crate) volumetric: Option<Spanned<String>>,
    pub(crate) assumption: Option<Spanned<String>>,
    pub(crate) prestress: Option<Spanned<PrestressEntry>>,
    pub(crate) W: Option<Text>,
    pub(crate) P: Option<Entries<Text>>,
    pub(crate) density: Option<Text>,
    pub(crate) flow: Option<Spanned<FlowTable>>,
    pub(crate) maxwell: List<Spanned<MaxwellTable>>,
}

#[derive(serde::Deserialize)]
#[serde(
    deny_unknown_fields,
    rename_all = "kebab-case",
    expecting = "a table, as in [material.flow] and below it kind = 'j2', yield = 'sy + K*alpha'"
)]
pub(crate) struct FlowTable {
    pub(crate) kind: Spanned<String>,
    pub(crate) r#yield: Option<Text>,
    pub(crate) drag: Option<Text>,
    pub(crate) exponent: Option<Text>,
    pub(crate) time: Option<Text>,
}

#[derive(serde::Deserialize)]
#[serde(
    deny_unknown_fields,
    rename_all = "kebab-case",
    expecting = "a table, as in [[material.maxwell]] and below it share = 'g1', time = 'tau1'"
)]
pub(crate) struct MaxwellTable {
    pub(crate) share: Text,
    pub(crate) time: Text,
}

#[derive(serde::Deserialize)]
#[serde(
    deny_unknown_fields,
    rename_all = "kebab-case",
    expecting = "a table, as in q = { rate = '(J - 1 - q)/tau', initial = '0' }"
)]
pub(crate) struct InternalTable {
    pub(crate) rate: Text,
    pub(crate) initial: Option<Text>,
}

#[derive(serde::Deserialize)]
#[serde(
    deny_unknown_fields,
    rename_all = "kebab-case",
    expecting = "a table, as in [start] and below it on-yield = true"
)]
pub(crate) struct StartTable {
    pub(crate) on_yield: bool,
}

#[derive(serde::Deserialize)]
#[serde(
    deny_unknown_fields,
    rename_all = "kebab-case",
    expecting = "a table, as in [domain] and below it shape = 'box', lower = [0, 0], upper = [1, 1]"
)]
pub(crate) struct DomainTable {
    pub(crate) shape: Spanned<String>,
    pub(crate) lower: Option<Spanned<List<Measure>>>,
    pub(crate) upper: Option<Spanned<List<Measure>>>,
    pub(crate) inner: Option<Text>,
    pub(crate) outer: Option<Text>,
    pub(crate) from: Option<Text>,
    pub(crate) to: Option<Text>,
    pub(crate) corners: Option<Spanned<String>>,
    pub(crate) cell_length: Option<Text>,
}

#[derive(serde::Deserialize)]
#[serde(
    deny_unknown_fields,
    rename_all = "kebab-case",
    expecting = "a table, as in [[boundary]] and below it surface = 'X-lower', condition = 'sliding'"
)]
pub(crate) struct BoundaryTable {
    pub(crate) surface: Spanned<String>,
    pub(crate) condition: Option<ConditionWord>,
    pub(crate) normal: Option<Spanned<String>>,
    pub(crate) tangential: Option<Spanned<String>>,
    pub(crate) X: Option<Spanned<String>>,
    pub(crate) Y: Option<Spanned<String>>,
    pub(crate) Z: Option<Spanned<String>>,
    /// No way to state a condition, but one that is tried.
    pub(crate) component: Option<Spanned<String>>,
}

/// A condition on all components.
pub(crate) struct ConditionWord(pub(crate) Spanned<String>);

impl<'de> Deserialize<'de> for ConditionWord {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Word(String);
        struct WordVisitor;
        impl Visitor<'_> for WordVisitor {
            type Value = Word;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(
                    "a word, as in condition = 'sliding'; by component write in its place normal = 'prescribed-motion', \
                     tangential = 'traction-free'",
                )
            }

            fn visit_str<E>(self, value: &str) -> Result<Word, E> {
                Ok(Word(value.to_owned()))
            }
        }
        impl<'de> Deserialize<'de> for Word {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                deserializer.deserialize_any(WordVisitor)
            }
        }
        let spanned = Spanned::<Word>::deserialize(deserializer)?;
        let span = spanned.span();
        Ok(ConditionWord(Spanned::new(span, spanned.into_inner().0)))
    }
}

#[derive(serde::Deserialize)]
#[serde(
    deny_unknown_fields,
    rename_all = "kebab-case",
    expecting = "a table, as in [solve] and below it unknowns = ['a'], conditions = ['P_RR(Ri) = 0']"
)]
pub(crate) struct SolveTable {
    pub(crate) unknowns: List<Spanned<String>>,
    pub(crate) conditions: List<Text>,
}

#[derive(serde::Deserialize)]
#[serde(
    deny_unknown_fields,
    rename_all = "kebab-case",
    expecting = "a table, as in [with-rotation] and below it angle = 'omega*t'"
)]
pub(crate) struct RotationTable {
    pub(crate) angle: Text,
    pub(crate) axis: Option<Spanned<String>>,
}

#[derive(serde::Deserialize)]
#[serde(
    deny_unknown_fields,
    rename_all = "kebab-case",
    expecting = "a table, as in [[cross-check]] and below it source = '...', file = 'listing.txt'"
)]
pub(crate) struct CrossCheckTable {
    pub(crate) source: Spanned<String>,
    pub(crate) listing: Option<Text>,
    pub(crate) file: Option<Spanned<String>>,
    #[serde(default)]
    pub(crate) names: Entries<Text>,
}

#[derive(serde::Deserialize)]
#[serde(
    deny_unknown_fields,
    rename_all = "kebab-case",
    expecting = "a table, as in [time] and below it period = '2/c'"
)]
pub(crate) struct TimeTable {
    pub(crate) period: Option<Text>,
    pub(crate) wave_speed: Option<Text>,
}

/// A parameter as it is written; one without a table is met with the line to write.
pub(crate) enum ParameterEntry {
    Table(ParameterTable),
    Bare(Text),
}

impl<'de> Deserialize<'de> for ParameterEntry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        enum Entry {
            Table(ParameterTable),
            Bare(String),
        }
        struct EntryVisitor;
        impl<'de> Visitor<'de> for EntryVisitor {
            type Value = Entry;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table, as in A = { default = 0.1 }")
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Entry, A::Error> {
                let table = serde::de::value::MapAccessDeserializer::new(map);
                ParameterTable::deserialize(table).map(Entry::Table)
            }

            fn visit_i64<E>(self, value: i64) -> Result<Entry, E> {
                Ok(Entry::Bare(value.to_string()))
            }

            fn visit_f64<E>(self, value: f64) -> Result<Entry, E> {
                Ok(Entry::Bare(format!("{value:?}")))
            }
        }
        impl<'de> Deserialize<'de> for Entry {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                deserializer.deserialize_any(EntryVisitor)
            }
        }
        let spanned = Spanned::<Entry>::deserialize(deserializer)?;
        let span = spanned.span();
        Ok(match spanned.into_inner() {
            Entry::Table(table) => ParameterEntry::Table(table),
            Entry::Bare(value) => ParameterEntry::Bare(Text { value, span }),
        })
    }
}

/// A number as a specification writes it, whole or not.
pub(crate) struct Number(pub(crate) f64);

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NumberVisitor;
        impl Visitor<'_> for NumberVisitor {
            type Value = Number;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number without quotes, as in 0.1")
            }

            fn visit_i64<E>(self, value: i64) -> Result<Number, E> {
                Ok(Number(value as f64))
            }

            fn visit_f64<E>(self, value: f64) -> Result<Number, E> {
                Ok(Number(value))
            }
        }
        deserializer.deserialize_any(NumberVisitor)
    }
}

/// The number of space dimensions as it is written.
pub(crate) struct Dimension(pub(crate) usize);

impl<'de> Deserialize<'de> for Dimension {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct DimensionVisitor;
        impl Visitor<'_> for DimensionVisitor {
            type Value = Dimension;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("1, 2 or 3, without quotes")
            }

            fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<Dimension, E> {
                let whole = usize::try_from(value).map(Dimension);
                let unexpected = serde::de::Unexpected::Signed(value);
                whole.map_err(|_| E::invalid_value(unexpected, &self))
            }
        }
        deserializer.deserialize_any(DimensionVisitor)
    }
}

/// Entry of a list, and how such a list is written.
pub(crate) trait Listed: Sized {
    /// For messages where there is something else.
    const FORM: &'static str;

    /// The entry that a text or number alone stands for, where it may be a list of one entry.
    fn alone(_text: &str) -> Option<Self> {
        None
    }
}

impl Listed for Text {
    const FORM: &'static str = "a list in brackets, as in ['...', '...']";
}

/// A coordinate of a corner; one alone needs no brackets.
pub(crate) struct Measure(Text);

impl<'de> Deserialize<'de> for Measure {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Text::deserialize(deserializer).map(Measure)
    }
}

impl Listed for Measure {
    const FORM: &'static str = Text::FORM;

    fn alone(text: &str) -> Option<Self> {
        Some(Measure(Text { value: text.to_owned(), span: 0..0 }))
    }
}

impl Listed for Spanned<String> {
    const FORM: &'static str = "a list of names in brackets, as in ['a', 'b']";
}

impl Listed for BoundaryTable {
    const FORM: &'static str =
        "[[boundary]] in two pairs of brackets, once for each surface, with surface and condition";
}

impl Listed for Spanned<MaxwellTable> {
    const FORM: &'static str =
        "[[material.maxwell]] in two pairs of brackets, once for each element, with share and time";
}

impl Listed for Spanned<CrossCheckTable> {
    const FORM: &'static str =
        "[[cross-check]] in two pairs of brackets, once for each listing, with source and listing";
}

/// A list, or tables of one name.
pub(crate) struct List<V>(pub(crate) Vec<V>);

impl<V> std::ops::Deref for List<V> {
    type Target = [V];

    fn deref(&self) -> &[V] {
        &self.0
    }
}

impl<V> Default for List<V> {
    fn default() -> Self {
        List(Vec::new())
    }
}

impl<'de, V: Deserialize<'de> + Listed> Deserialize<'de> for List<V> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ListVisitor<V>(PhantomData<V>);
        impl<'de, V: Deserialize<'de> + Listed> Visitor<'de> for ListVisitor<V> {
            type Value = List<V>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(V::FORM)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<List<V>, A::Error> {
                let mut values = Vec::new();
                while let Some(value) = list.next_element()? {
                    values.push(value);
                }
                Ok(List(values))
            }

            fn visit_str<E: serde::de::Error>(self, value: &str) -> Result<List<V>, E> {
                let unexpected = serde::de::Unexpected::Str(value);
                let alone = V::alone(value).ok_or_else(|| E::invalid_type(unexpected, &self))?;
                Ok(List(vec![alone]))
            }

            fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<List<V>, E> {
                self.visit_str(&value.to_string())
            }

            fn visit_f64<E: serde::de::Error>(self, value: f64) -> Result<List<V>, E> {
                self.visit_str(&format!("{value:?}"))
            }
        }
        deserializer.deserialize_any(ListVisitor(PhantomData))
    }
}

impl List<Measure> {
    /// The entries of a list that stands at a place; an entry without brackets has the place of the list.
    pub(crate) fn texts(list: &Spanned<Self>) -> Vec<Text> {
        let placed = |Measure(text): &Measure| match text.span.is_empty() {
            true => Text { value: text.value.clone(), span: list.span() },
            false => text.clone(),
        };
        list.get_ref().0.iter().map(placed).collect()
    }
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

impl<V> Entries<V> {
    pub(crate) fn get(&self, key: &str) -> Option<&V> {
        self.0.iter().find(|(name, _)| name.get_ref() == key).map(|(_, value)| value)
    }
}

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
                f.write_str("a table of lines such as name = '...'")
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

impl<'de> Deserialize<'de> for MaterialTable {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct MaterialVisitor;
        impl<'de> Visitor<'de> for MaterialVisitor {
            type Value = MaterialTable;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table, as in [material] and below it law = 'neo-hookean'")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<MaterialTable, A::Error> {
                let mut law = None;
                let mut constants = Entries::default();
                let (mut volumetric, mut W, mut P, mut density) = (None, None, None, None);
                let (mut assumption, mut prestress) = (None, None);
                let (mut flow, mut maxwell) = (None, List::default());
                while let Some(key) = map.next_key::<Spanned<String>>()? {
                    match key.get_ref().as_str() {
                        "law" => law = Some(map.next_value()?),
                        "volumetric" => volumetric = Some(map.next_value()?),
                        "assumption" => assumption = Some(map.next_value()?),
                        "prestress" => prestress = Some(map.next_value()?),
                        "W" => W = Some(map.next_value()?),
                        "P" => P = Some(map.next_value()?),
                        "density" => density = Some(map.next_value()?),
                        "flow" => flow = Some(map.next_value()?),
                        "maxwell" => maxwell = map.next_value()?,
                        _ => constants.0.push((key, map.next_value()?)),
                    }
                }
                constants.0.sort_by_key(|(key, _)| key.span().start);
                let law = law.ok_or_else(|| serde::de::Error::missing_field("law"))?;
                Ok(MaterialTable {
                    law,
                    constants,
                    volumetric,
                    assumption,
                    prestress,
                    W,
                    P,
                    density,
                    flow,
                    maxwell,
                })
            }
        }
        deserializer.deserialize_map(MaterialVisitor)
    }
}
