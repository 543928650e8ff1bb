//! Python: the reader of tables, and functions that take values from them.

use crate::code::Code;
use crate::listing::Item;
use crate::table::{BODY_FORCE, FIRST_INTERNAL, Normal, OfTable, STRESS};
use crate::targets::python::{Arrays, Python, string};

const TABLE: &str = include_str!("table.py");

impl Python {
    /// The class that reads a table.
    pub(in crate::targets) fn table_reader(&self, code: &Code<'_>) -> String {
        let Some((Arrays { name, portions }, _)) = self.arrays.as_ref().zip(code.table.as_ref())
        else {
            return String::new();
        };
        TABLE.replace("XP", name).replace("CHUNKS\n", portions)
    }

    /// The members of a solution that read its table when they are needed first.
    pub(in crate::targets) fn table_of_solution(&self, code: &Code<'_>) -> String {
        let Some(table) = &code.table else { return String::new() };
        let messages =
            code.table_messages().map(|message| string(&message)).join(",\n                ");
        let names: Vec<String> = table.variables.iter().map(|name| string(name)).collect();
        format!(
            "
    # The place of the table, which can be set.
    TABLE = os.path.join(os.path.dirname(os.path.abspath(__file__)), {})
    # The internal variables, in the order of internal(X, t).
    INTERNAL = [{}]
    _table = None

    @property
    def table(self):
        # the table of the fields that follow from histories
        if self._table is None:
            self._table = _Table(
                self.TABLE,
                {},
                {messages},
            )
        return self._table

    def points(self, X):
        # positions that stay: s.points(X).b(t), P(t) and internal(t) take short sums at each time
        return _Points(self, X)
",
            string(&code.table_file()),
            names.join(", "),
            string(&table.digest),
        )
    }

    /// A function that takes its values from the table.
    pub(in crate::targets) fn item_of_table(
        &self,
        code: &Code<'_>,
        item: &Item,
        of_table: OfTable,
    ) -> String {
        let d = code.spec.dimension;
        let arrays = self.arrays.as_ref().map_or("", |arrays| arrays.name);
        let mut text = format!("\n    def {}(self, X, t):\n        # {}\n", item.name, item.about);
        let field = |number: usize| format!("self.table.field(_position(X, {d}), t, {number})");
        text += &match of_table {
            OfTable::BodyForce => format!("        return {}\n", field(BODY_FORCE)),
            OfTable::Stress => format!(
                "        flat = {}\n        return flat.reshape(*flat.shape[:-1], {d}, {d})\n",
                field(STRESS)
            ),
            OfTable::Internal => {
                let count = code.table.as_ref().map_or(0, |table| table.sizes.len());
                format!(
                    "        X = _position(X, {d})\n        fields = [self.table.field(X, t, field) for field in range({FIRST_INTERNAL}, {})]\n        return \
                     {arrays}.concatenate(fields, axis=-1)\n",
                    FIRST_INTERNAL + count
                )
            }
            OfTable::Variable { field: number, entry, .. } => {
                format!("        return {}[..., {entry}]\n", field(number))
            }
            OfTable::Traction(surface) => {
                match Normal::of(surface, code.spec, code.is_of_half_plane) {
                    Normal::Axis(axis, sign) => {
                        let sign = if sign < 0.0 { "-" } else { "" };
                        format!("        return {sign}self.P(X, t)[..., :, {axis}]\n")
                    }
                    Normal::Around(sign) => {
                        let sign = if sign < 0.0 { "-" } else { "" };
                        format!(
                            "        X, P = _position(X, {d}), self.P(X, t)\n        r = {arrays}.hypot(X[0], X[1])[..., None]\n        return {sign}(P[..., :, 1] * \
                         X[0][..., None] - P[..., :, 0] * X[1][..., None]) / r\n"
                        )
                    }
                    Normal::Radial { sign, components } => {
                        let sign = if sign < 0.0 { "-" } else { "" };
                        // Components along other axes are zero.
                        let first =
                            if components < d { format!("[:{components}]") } else { String::new() };
                        let of_P = if components < d {
                            format!("[..., :{components}]")
                        } else {
                            String::new()
                        };
                        format!(
                            "        place = {arrays}.stack(_position(X, {d}){first}, axis=-1)\n        normal = {sign}place / \
                         {arrays}.linalg.norm(place, axis=-1)[..., None]\n        return {arrays}.einsum(\"...ij,...j->...i\", self.P(X, t){of_P}, normal)\n"
                        )
                    }
                }
            }
        };
        text
    }
}
