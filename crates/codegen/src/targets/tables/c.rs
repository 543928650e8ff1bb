//! C: the reader of tables, and functions that take values from them.

use crate::code::Code;
use crate::table::{BODY_FORCE, FIRST_INTERNAL, Normal, OfTable, STRESS, Tabulated};
use crate::text::c_string;

/// The reader; it has a guard of its own, as a program may include several files.
pub(in crate::targets) const TABLE: &str = include_str!("table.h");

/// How many values of a time and of a point the body force needs: a piece in time with polynomials, and coefficients; or the time itself,
/// and the number of a point.
pub(in crate::targets) fn kept_of_series(table: &Tabulated, dimension: usize) -> [usize; 2] {
    match table.in_time {
        None => [1, 1],
        Some([pieces, in_time]) => [1 + in_time, dimension * pieces * in_time],
    }
}

impl Code<'_> {
    /// The function that reads the table of a solution, and the one that frees it.
    pub(in crate::targets) fn c_read_table(&self, name: &str) -> String {
        let Some(table) = &self.table else { return String::new() };
        let messages = self.table_messages().map(|message| c_string(&message)).join(",\n        ");
        format!(
            "/* Reads the table of the fields that follow from histories, after {name}_prepare and before any of these fields. Returns a null
   pointer, or a message that says what is wrong. On a graphics processor {name}_b_staged serves; the table stays on the host. */
static inline const char *{name}_read_table({name}_solution *s, const char *path)
{{
    static const char *const messages[3] = {{
        {messages}}};
    mmsmith_table_free(&s->table);
    return mmsmith_table_read(&s->table, path, \"{digest}\", messages);
}}

/* Gives the table's memory back. */
static inline void {name}_free_table({name}_solution *s)
{{
    mmsmith_table_free(&s->table);
}}

",
            digest = table.digest,
        )
    }

    /// The lines of a function that takes its values from the table.
    pub(in crate::targets) fn c_of_table(&self, of_table: OfTable, name: &str) -> String {
        let d = self.spec.dimension;
        let field = |number: usize, size: usize, out: &str| {
            format!("    mmsmith_field(&s->table, X, t, {number}, {size}, {out});\n")
        };
        match of_table {
            OfTable::BodyForce => field(BODY_FORCE, d, "b"),
            OfTable::Stress => field(STRESS, d * d, "P"),
            OfTable::Internal => {
                let mut first = 0;
                let sizes = self.table.iter().flat_map(|table| table.sizes.iter().enumerate());
                sizes
                    .map(|(number, &size)| {
                        let out = format!("internal + {first}");
                        first += size;
                        field(FIRST_INTERNAL + number, size, &out)
                    })
                    .collect()
            }
            OfTable::Variable { field: number, size, entry } => format!(
                "    double values[{size}];\n{}    return values[{entry}];\n",
                field(number, size, "values")
            ),
            OfTable::Traction(surface) => {
                let stress =
                    format!("    double P[{}];\n    int i;\n    {name}_P(s, X, t, P);\n", d * d);
                let terms = |factor: &str, components: usize| {
                    let term = |j: usize| format!("P[{d} * i + {j}] * X[{j}]");
                    let sum: Vec<String> = (0..components).map(term).collect();
                    format!("{factor} * ({}) / r", sum.join(" + "))
                };
                let (before, value) = match Normal::of(surface, self.spec, self.is_of_half_plane) {
                    Normal::Axis(axis, sign) => {
                        let sign = if sign < 0.0 { "-" } else { "" };
                        (String::new(), format!("{sign}P[{d} * i + {axis}]"))
                    }
                    Normal::Around(sign) => {
                        let sign = if sign < 0.0 { "-" } else { "" };
                        (
                            "    const double r = sqrt(X[0] * X[0] + X[1] * X[1]);\n".to_owned(),
                            format!("{sign}(P[{d} * i + 1] * X[0] - P[{d} * i] * X[1]) / r"),
                        )
                    }
                    Normal::Radial { sign, components } => {
                        let squares: Vec<String> =
                            (0..components).map(|j| format!("X[{j}] * X[{j}]")).collect();
                        let r = format!("    const double r = sqrt({});\n", squares.join(" + "));
                        (r, terms(if sign < 0.0 { "-1.0" } else { "1.0" }, components))
                    }
                };
                format!(
                    "{before}{stress}    for (i = 0; i < {d}; ++i) {{\n        traction[i] = {value};\n    }}\n"
                )
            }
        }
    }

    /// The lines of a stage of the body force.
    pub(in crate::targets) fn c_stage(&self, stage: &str) -> String {
        let Some(table) = &self.table else { return String::new() };
        let d = self.spec.dimension;
        match (stage, table.in_time) {
            ("at_time", None) => "    (void)s;\n    time.values[0] = t;\n".into(),
            ("at_point", None) => "    point[0] = (double)mmsmith_point_of(&s->table, X);\n".into(),
            (_, None) => format!(
                "    (void)stride;\n    mmsmith_field_of_point(&s->table, (long)point[0], time->values[0], {BODY_FORCE}, {d}, b);\n"
            ),
            ("at_time", Some([pieces, in_time])) => format!(
                "    mmsmith_moment(s->table.knots, s->table.coefficients ? {pieces} : 0, {in_time}, t, time.values);\n"
            ),
            ("at_point", Some([pieces, in_time])) => format!(
                "    mmsmith_series(&s->table, X, {BODY_FORCE}, {d}, {}, point);\n",
                pieces * in_time
            ),
            (_, Some([pieces, in_time])) => {
                let entry = |i: usize| {
                    format!(
                        "    b[{i}] = mmsmith_of_series({pieces}, {in_time}, time->values, point, stride, {i});\n"
                    )
                };
                "    (void)s;\n".to_owned() + &(0..d).map(entry).collect::<String>()
            }
        }
    }

    /// Functions on the series of all fields at a point, or on points by their numbers.
    pub(in crate::targets) fn c_series(&self, name: &str) -> String {
        let Some(table) = &self.table else { return String::new() };
        let d = self.spec.dimension;
        let sizes: Vec<usize> = [d, d * d].into_iter().chain(table.sizes.iter().copied()).collect();
        let variables = table.variables.len();
        let mut text = String::new();
        let Some([pieces, in_time]) = table.in_time else {
            for (letter, field, size) in [("b", BODY_FORCE, d), ("P", STRESS, d * d)] {
                text += &format!(
                    "/* {letter} at point n, counted from 0, of those that the table was written for. */
MMSMITH_FN void {name}_{letter}_of_point(const {name}_solution *s, long n, double t, double {letter}[{size}])
{{
    mmsmith_field_of_point(&s->table, n, t, {field}, {size}, {letter});
}}

"
                );
            }
            return text;
        };
        let steps = pieces * in_time;
        let count: usize = sizes.iter().sum();
        text += &format!(
            "/* The fields at a position as series in time, from which they follow at any time by short sums. */
enum {{
    {name}_series_length = {}
}};

MMSMITH_FN void {name}_series(const {name}_solution *s, const double X[{d}], double series[{name}_series_length])
{{
",
            count * steps
        );
        let mut first = 0;
        for (field, size) in sizes.iter().enumerate() {
            text += &format!(
                "    mmsmith_series(&s->table, X, {field}, {size}, {steps}, series + {});\n",
                first * steps
            );
            first += size;
        }
        text += "}\n\n";
        let groups = [("b", 0, d), ("P", d, d * d), ("internal", d + d * d, variables)];
        for (letter, first, size) in groups.into_iter().filter(|(.., size)| *size > 0) {
            text += &format!(
                "/* {letter} from the series of a position and from the values of a time. */
MMSMITH_FN void {name}_{letter}_of_series(const {name}_time_values *time, const double *series, double {letter}[{size}])
{{
    int i;
    for (i = 0; i < {size}; ++i) {{
        {letter}[i] = mmsmith_of_series({pieces}, {in_time}, time->values, series, 1, {first} + i);
    }}
}}

"
            );
        }
        text
    }
}
