//! Julia: the reader of tables, and functions that take values from them.

use crate::code::Code;
use crate::listing::Item;
use crate::table::{BODY_FORCE, FIRST_INTERNAL, Normal, OfTable, STRESS};
use crate::text::julia_string;

const TABLE: &str = include_str!("table.jl");

/// The reader, and functions of series.
pub(in crate::targets) fn reader(code: &Code<'_>) -> String {
    let Some(table) = &code.table else { return String::new() };
    let [missing, another, broken] = code.table_messages().map(|message| julia_string(&message));
    let d = code.spec.dimension;
    let names: Vec<String> = table.variables.iter().map(|name| julia_string(name)).collect();
    let mut text = format!(
        "
# The place of the table, which can be set: TABLE[] = \"...\".
const TABLE = Ref(joinpath(@__DIR__, {}))
const DIGEST = {}
const MISSING = {missing}
const ANOTHER = {another}
const BROKEN = {broken}
# The internal variables, in the order of internal(s, X, t).
const INTERNAL = String[{}]
",
        julia_string(&code.table_file()),
        julia_string(&table.digest),
        names.join(", ")
    );
    text += TABLE;
    let first = d + d * d;
    text += &format!(
        "
# body force of a series at a time
b_of_series(own, t) = Tuple(mmsmith_sum(own, t, 1:{d}))

# first Piola-Kirchhoff stress of a series at a time
P_of_series(own, t) = mmsmith_rows(mmsmith_sum(own, t, {}:{first}))

# all internal variables of a series at a time
internal_of_series(own, t) = Tuple(mmsmith_sum(own, t, {}:{}))

mmsmith_rows(flat) = ntuple(i -> ntuple(j -> flat[(i-1)*{d}+j], {d}), {d})
",
        d + 1,
        first + 1,
        first + table.variables.len()
    );
    text
}

/// A function that takes its values from the table.
pub(in crate::targets) fn item(code: &Code<'_>, item: &Item, of_table: OfTable) -> String {
    // Fields count from one.
    let field = |number: usize| format!("mmsmith_field(table_of(s), X, t, {})", number + 1);
    let value = match of_table {
        OfTable::BodyForce => format!("Tuple({})", field(BODY_FORCE)),
        OfTable::Stress => format!("mmsmith_rows({})", field(STRESS)),
        OfTable::Internal => {
            let count = code.table.as_ref().map_or(0, |table| table.sizes.len());
            format!(
                "Tuple(reduce(vcat, [mmsmith_field(table_of(s), X, t, field) for field in {}:{}]))",
                FIRST_INTERNAL + 1,
                FIRST_INTERNAL + count
            )
        }
        OfTable::Variable { field: number, entry, .. } => {
            format!("{}[{}]", field(number), entry + 1)
        }
        OfTable::Traction(surface) => {
            let (sign, value) = match Normal::of(surface, code.spec, code.is_of_half_plane) {
                Normal::Axis(axis, sign) => (sign, format!("row[{}]", axis + 1)),
                Normal::Radial { sign, components: n } => (
                    sign,
                    format!("sum(row[j] * X[j] for j in 1:{n}) / sqrt(sum(X[j]^2 for j in 1:{n}))"),
                ),
                Normal::Around(sign) => {
                    (sign, "(row[2] * X[1] - row[1] * X[2]) / sqrt(X[1]^2 + X[2]^2)".to_owned())
                }
            };
            let sign = if sign < 0.0 { "-" } else { "" };
            format!("map(row -> {sign}{value}, P(s, X, t))")
        }
    };
    format!("\n# {}\nfunction {}(s, X, t)\n    return {value}\nend\n", item.about, item.name)
}
