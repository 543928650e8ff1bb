//! C++: the reader of tables is that of C.

use crate::code::Code;
use crate::listing::Item;
use crate::table::{BODY_FORCE, FIRST_INTERNAL, Normal, OfTable, STRESS};
use crate::text::c_string;
use mmsmith_stage::Shape;

/// Headers and the reader, before the namespace.
pub(in crate::targets) fn reader(code: &Code<'_>) -> String {
    if code.table.is_none() {
        return String::new();
    }
    format!(
        "
#include <math.h>
#include <stddef.h>

#include <memory>
#include <string>
#include <vector>

#ifndef MMSMITH_FN
#if defined(__CUDACC__) || defined(__HIPCC__)
#define MMSMITH_FN static inline __host__ __device__
#else
#define MMSMITH_FN static inline
#endif
#endif

{}",
        super::c::TABLE
    )
}

/// The numbers of the fields with their sizes: `b`, `P`, and the internal variables.
fn groups(code: &Code<'_>) -> Vec<(&'static str, usize, Vec<usize>)> {
    let d = code.spec.dimension;
    let internal = code.table.as_ref().map_or_else(Vec::new, |table| table.sizes.clone());
    let all = [
        ("b", BODY_FORCE, vec![d]),
        ("P", STRESS, vec![d * d]),
        ("internal", FIRST_INTERNAL, internal),
    ];
    all.into_iter().filter(|(.., sizes)| !sizes.is_empty()).collect()
}

/// The members of a solution that read its table, and its series.
pub(in crate::targets) fn members(code: &Code<'_>) -> String {
    let Some(table) = &code.table else { return String::new() };
    let messages = code.table_messages().map(|message| c_string(&message)).join(",\n            ");
    let mut text = format!(
        "
    // Reads the table of the fields that follow from histories: b, P, tractions and internal variables.
    void read_table(const std::string &path = {file})
    {{
        static const char *const messages[3] = {{
            {messages}}};
        std::shared_ptr<mmsmith_table> read(new mmsmith_table(), [](mmsmith_table *own) {{
            mmsmith_table_free(own);
            delete own;
        }});
        if (const char *message = mmsmith_table_read(read.get(), path.c_str(), \"{digest}\", messages)) {{
            throw std::runtime_error(path + \": \" + message);
        }}
        table = read;
    }}

    // The last time of the table.
    double end_of_table() const
    {{
        return table->end;
    }}

    // Fields at a position as series in time, from which they follow at any time by short sums.
    class Series {{
    public:
",
        file = c_string(&code.table_file()),
        digest = table.digest,
    );
    let mut first = 0;
    for (name, field, sizes) in groups(code) {
        let size: usize = sizes.iter().sum();
        let of_points: String = sizes
            .iter()
            .enumerate()
            .scan(0, |place, (k, size)| {
                let at = *place;
                *place += size;
                Some((field + k, size, at))
            })
            .map(|(field, size, at)| {
                format!(
                    "            mmsmith_field_of_point(table.get(), number, t, {field}, {size}, result.data() + {at});\n"
                )
            })
            .collect();
        text += &match table.in_time {
            None => format!(
                "        std::array<double, {size}> {name}(double t) const
        {{
            std::array<double, {size}> result;
{of_points}            return result;
        }}
"
            ),
            Some([pieces, in_time]) => format!(
                "        std::array<double, {size}> {name}(double t) const
        {{
            double moment[1 + mmsmith_most_polynomials];
            std::array<double, {size}> result;
            mmsmith_moment(table->knots, table->coefficients ? {pieces} : 0, {in_time}, t, moment);
            for (int i = 0; i < {size}; ++i) {{
                result[static_cast<std::size_t>(i)] = mmsmith_of_series({pieces}, {in_time}, moment, values.data(), 1, {first} + i);
            }}
            return result;
        }}
"
            ),
        };
        first += size;
    }
    text += &series_end(code, first);
    text
}

/// The rest of the class of series, and the function that makes one.
fn series_end(code: &Code<'_>, count: usize) -> String {
    let d = code.spec.dimension;
    let Some(table) = &code.table else { return String::new() };
    let (kept, formed) = match table.in_time {
        None => (
            "        long number = -1;\n".to_owned(),
            "        own.number = mmsmith_point_of(table.get(), place);\n".to_owned(),
        ),
        Some([pieces, in_time]) => {
            let steps = pieces * in_time;
            let sizes = [d, d * d].into_iter().chain(table.sizes.iter().copied()).enumerate();
            let calls = sizes.scan(0, |place, (field, size)| {
                let at = *place * steps;
                *place += size;
                Some(format!(
                    "        mmsmith_series(table.get(), place, {field}, {size}, {steps}, own.values.data() + {at});\n"
                ))
            });
            let resized = format!("        own.values.resize({});\n", count * steps);
            (
                "        std::vector<double> values;\n".to_owned(),
                resized + &calls.collect::<String>(),
            )
        }
    };
    format!(
        "
    private:
        friend class Solution;
        std::shared_ptr<const mmsmith_table> table;
{kept}    }};

    template <class Point>
    Series series(const Point &X) const
    {{
        double place[{d}];
        for (int i = 0; i < {d}; ++i) {{
            place[i] = support::plain(X[i]);
        }}
        Series own;
        own.table = table;
{formed}        return own;
    }}
"
    )
}

/// The private member that holds the table.
pub(in crate::targets) fn private_members(code: &Code<'_>) -> &'static str {
    match code.table {
        None => "",
        Some(_) => {
            "    std::shared_ptr<const mmsmith_table> table = std::make_shared<mmsmith_table>();\n"
        }
    }
}

/// A function that takes its values from the table. Of dual numbers it has the values without derivatives.
pub(in crate::targets) fn item(code: &Code<'_>, item: &Item, of_table: OfTable) -> String {
    let d = code.spec.dimension;
    let scalar = "support::Scalar<Point>";
    let count = match of_table {
        OfTable::Internal => code.variable_count(),
        _ => item.shape.entries(d),
    };
    let returned = match item.shape {
        Shape::Scalar => scalar.to_owned(),
        Shape::Vector => format!("std::array<{scalar}, {count}>"),
        Shape::Matrix => format!("std::array<std::array<{scalar}, {d}>, {d}>"),
    };
    let head = format!(
        "
    // {}
    template <class Point>
    {returned} {}(const Point &X, double t) const
    {{
",
        item.about, item.name
    );
    let place = format!(
        "        double place[{d}];\n        for (int i = 0; i < {d}; ++i) {{\n            place[i] = support::plain(X[i]);\n        }}\n"
    );
    let field = |number: usize, size: usize, at: usize| {
        format!("        mmsmith_field(table.get(), place, t, {number}, {size}, values + {at});\n")
    };
    let made = |index: String| format!("support::make<{scalar}>(values[{index}])");
    let body = match of_table {
        OfTable::BodyForce | OfTable::Internal => {
            let sizes = match (of_table, &code.table) {
                (OfTable::Internal, Some(table)) => table.sizes.clone(),
                _ => vec![d],
            };
            let first = if of_table == OfTable::Internal { FIRST_INTERNAL } else { BODY_FORCE };
            let mut at = 0;
            let mut calls = String::new();
            for (k, size) in sizes.iter().enumerate() {
                calls += &field(first + k, *size, at);
                at += size;
            }
            format!(
                "{place}        double values[{count}];\n{calls}        {returned} result;\n        for (std::size_t i = 0; i < {count}; ++i) {{\n            result[i] = {};\n        }}\n        return result;\n",
                made("i".into())
            )
        }
        OfTable::Stress => format!(
            "{place}        double values[{count}];\n{}        {returned} result;\n        for (std::size_t i = 0; i < {d}; ++i) {{\n            for (std::size_t j = 0; j < {d}; ++j) {{\n                result[i][j] = {};\n            }}\n        }}\n        return result;\n",
            field(STRESS, count, 0),
            made(format!("{d} * i + j"))
        ),
        OfTable::Variable { field: number, size, entry } => format!(
            "{place}        double values[{size}];\n{}        return {};\n",
            field(number, size, 0),
            made(entry.to_string())
        ),
        OfTable::Traction(surface) => {
            let (before, value) = match Normal::of(surface, code.spec, code.is_of_half_plane) {
                Normal::Axis(axis, sign) => {
                    let sign = if sign < 0.0 { "-" } else { "" };
                    (String::new(), format!("{sign}stress[i][{axis}]"))
                }
                Normal::Around(sign) => {
                    let sign = if sign < 0.0 { "-" } else { "" };
                    (
                        "        const auto r = sqrt(X[0] * X[0] + X[1] * X[1]);\n".to_owned(),
                        format!("{sign}(stress[i][1] * X[0] - stress[i][0] * X[1]) / r"),
                    )
                }
                Normal::Radial { sign, components } => {
                    let sum = |of: &dyn Fn(usize) -> String| {
                        (0..components).map(of).collect::<Vec<_>>().join(" + ")
                    };
                    let squares = sum(&|j| format!("X[{j}] * X[{j}]"));
                    let product = sum(&|j| format!("stress[i][{j}] * X[{j}]"));
                    let sign = if sign < 0.0 { "-" } else { "" };
                    (
                        format!("        const auto r = sqrt({squares});\n"),
                        format!("{sign}({product}) / r"),
                    )
                }
            };
            format!(
                "        const auto stress = P(X, t);\n{before}        {returned} traction;\n        for (std::size_t i = 0; i < {d}; ++i) {{\n            traction[i] = {value};\n        }}\n        return traction;\n"
            )
        }
    };
    head + &body + "    }\n"
}
