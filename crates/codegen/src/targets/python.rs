//! Python source; its hosts differ in the library that they compute with.

use crate::code::Code;
use crate::listing::{Given, Item, Refusal, commented};
use crate::runtime::{Primitive, Routine, WithRuntime};
use crate::target::{Called, Target, Written};
use crate::text::{digits, one_line, push_index};
use mmsmith_stage::{Operand, Shape, Stage};
use std::borrow::Cow;

/// Python with an array library.
pub(crate) struct Python {
    /// Calls of functions, with `#` for each argument.
    pub(crate) function: fn(Called) -> Cow<'static, str>,
    pub(crate) primitive: fn(Primitive) -> &'static str,
    /// Remarks for the host's user.
    pub(crate) remarks: &'static str,
    /// Imports, and the functions `_position`, `_scalar`, `_vector` and `_matrix`, which shape results.
    pub(crate) preamble: &'static str,
    /// Statements of `_position` for places that are radius and height.
    pub(crate) half_plane: &'static str,
    /// The decorator before a function of the runtime.
    pub(crate) decorator: &'static str,
    /// The first statements of the constructor.
    pub(crate) demands: &'static str,
    /// The Cauchy stress from `F`, `J` and `P`.
    pub(crate) cauchy: &'static str,
    /// The second Piola-Kirchhoff stress from `F` and `P`.
    pub(crate) second: &'static str,
    /// How tables of fields are read and evaluated, where the host can.
    pub(crate) arrays: Option<Arrays>,
}

/// The array library that evaluates tables.
pub(crate) struct Arrays {
    /// Its name in the file.
    pub(crate) name: &'static str,
    /// The last statements of the function that evaluates a field at positions `X` and times `t` which have the shape `shape` together.
    pub(crate) portions: &'static str,
}

impl Target for Python {
    type Places = ();

    const STATEMENT: [&'static str; 2] = ["", "\n"];

    fn literal(&self, value: f64) -> String {
        let sign = if value.is_sign_negative() { "-" } else { "" };
        let size = value.abs();
        if size.is_infinite() {
            format!("{sign}math.inf")
        } else {
            format!("{sign}{}", digits(size))
        }
    }

    fn function(&self, function: Called) -> Cow<'static, str> {
        (self.function)(function)
    }

    fn operand(&self, text: &mut String, operand: Operand<'_>, (): ()) {
        let (name, index, after) = match operand {
            Operand::Time => return text.push('t'),
            Operand::Coordinate(index) => ("X", index, ""),
            Operand::Parameter(index) => ("par[", index, "]"),
            Operand::Kept(_, index) => ("fixed[", index, "]"),
            _ => return,
        };
        text.push_str(name);
        push_index(text, index);
        text.push_str(after);
    }
}

impl WithRuntime for Python {
    fn primitive(&self, primitive: Primitive) -> &'static str {
        (self.primitive)(primitive)
    }
}

/// A call of a function that the file defines.
pub(crate) fn own_call(function: Called, name: &str) -> Cow<'static, str> {
    format!("_{name}({})", if function.takes_two() { "#, #" } else { "#" }).into()
}

/// A string literal.
pub(super) fn string(text: &str) -> String {
    let mut literal = String::from("\"");
    for c in one_line(text).chars() {
        match c {
            '"' | '\\' => literal.extend(['\\', c]),
            ' '..='~' => literal.push(c),
            _ => literal += &format!("\\U{:08x}", u32::from(c)),
        }
    }
    literal + "\""
}

const REFUSAL: Refusal = Refusal {
    finite: "math.isfinite(#)",
    and: "and",
    side: "float(#)",
    lines: "        if not (#):\n            raise ValueError(#)\n",
    string,
};

impl Python {
    /// The text of a module.
    pub(crate) fn source(&self, code: &Code<'_>) -> String {
        let spec = code.spec;
        // A first line without text of the specification: one of the first two lines may name another encoding.
        let mut text = String::from("# -*- coding: utf-8 -*-\n");
        text += &commented(&code.head_for_host(self.remarks), "#", 118);
        // A mesh of the half plane has the radius and the height alone.
        let (checks, of_half_plane) = (self.preamble.find("    return [X["), self.half_plane);
        match checks.filter(|_| code.is_of_half_plane) {
            Some(place) => {
                let (before, after) = self.preamble.split_at(place);
                let checks = before.rfind("    if ").unwrap_or(place);
                text += &before[..checks];
                // Tables take positions of one shape.
                text += &match code.table {
                    Some(_) => {
                        of_half_plane.replace("X[..., 0], 0.0,", "X[..., 0], 0.0 * X[..., 0],")
                    }
                    None => of_half_plane.to_owned(),
                };
                text += &before[checks..];
                text += after;
            }
            None => text += self.preamble,
        }
        text += &self.table_reader(code);
        for routine in code.routines(self) {
            text += &self.routine(&routine);
        }
        text += "\n\nclass Solution:\n    # The fields for given parameters:\n";
        text += &commented(&code.parameter_lines(), "    #", 118);
        let defaults: Vec<String> = spec
            .parameters
            .iter()
            .map(|p| format!("{}: {}", string(&p.name), self.literal(p.default)))
            .collect();
        text += &format!(
            "    NAME = {}\n{}    DIMENSION = {}\n    DEFAULTS = {{{}}}\n\n    def __init__(self, **parameters):\n{}",
            string(&spec.name),
            match code.is_of_half_plane {
                true => "    COORDINATES = (\"R\", \"theta\", \"Z\")\n",
                false => "",
            },
            spec.dimension,
            defaults.join(", "),
            self.demands,
        );
        text += "        for name in parameters:
            if name not in self.DEFAULTS:
                raise TypeError(f\"{self.NAME} has no parameter {name!r}; it has {', '.join(self.DEFAULTS)}\")
        par = [float(x) for x in {**self.DEFAULTS, **parameters}.values()]
        self.par, self.fixed = par, []\n";
        let Written { lines, outputs: fixed } =
            code.admitted(self, "        ", (), &REFUSAL, |index| format!("par[{index}]"));
        text += &lines;
        text += &format!("        self.fixed = [float(x) for x in [{}]]\n", fixed.join(", "));
        text += &self.table_of_solution(code);
        for item in code.functions() {
            text += &match item.of_table {
                None => self.item(code, &item),
                Some(of_table) => self.item_of_table(code, &item, of_table),
            };
        }
        let density = match (code.has_graded_density(), &self.arrays) {
            (false, _) => "self.density()",
            (true, None) => "self.rho0(X)",
            (true, Some(_)) => "self.rho0(X)[..., None]",
        };
        text += &format!(
            "\n    def rho0_b(self, X, t):\n        # body force per unit reference volume\n        return {density} * self.b(X, t)\n"
        );
        text += &format!(
            "\n    def static_force(self, X, t):\n        # -Div P, the force per reference volume that holds the \
                 deformation of time t at rest\n        return {density} * (self.b(X, t) - self.a(X, t))\n"
        );
        let volume = code.volume_by(["self.J(X, t)", "self.F_zz(X, t)"]);
        text += &format!(
            "\n    def sigma(self, X, t):\n        # Cauchy stress\n        F, J, P = self.F(X, t), {volume}, self.P(X, t)\n"
        );
        text += self.cauchy;
        text += "\n    def S(self, X, t):\n        # second Piola-Kirchhoff stress\n        F, P = self.F(X, t), self.P(X, t)\n";
        text + self.second
    }

    fn routine(&self, routine: &Routine) -> String {
        let mut text = format!(
            "\n\n{}def _{}({}):\n    # {}\n",
            self.decorator,
            routine.name,
            routine.arguments.join(", "),
            routine.about
        );
        for step in &routine.steps {
            text += &format!("    {} = {}\n", step.name, step.value);
        }
        text + &format!("    return {}\n", routine.result)
    }

    fn item(&self, code: &Code<'_>, item: &Item) -> String {
        // `lambda` is a word of Python.
        let name = if item.name == "lambda" { "lambda_" } else { &item.name };
        let given = match item.given {
            Given::Nothing => "self",
            Given::Position => "self, X",
            Given::PositionAndTime => "self, X, t",
        };
        let mut text = format!("\n    def {name}({given}):\n        # {}\n", item.about);
        let block = item.block(code);
        let reads = |such: fn(&Operand<'_>) -> bool| block.reads(|operand| such(&operand));
        if reads(|o| matches!(o, Operand::Parameter(_))) {
            text += "        par = self.par\n";
        }
        if reads(|o| matches!(o, Operand::Kept(Stage::Fixed, _))) {
            text += "        fixed = self.fixed\n";
        }
        if item.given != Given::Nothing {
            let names: Vec<String> = (0..code.spec.dimension).map(|i| format!("X{i}")).collect();
            text += &format!("        {}, = _position(X, {})\n", names.join(", "), names.len());
        }
        let Written { lines, outputs } = self.block(&block, "        ", ());
        text += &lines;
        let entries = outputs.join(", ");
        text + &match (item.given, item.shape) {
            (Given::Nothing, Shape::Scalar) => format!("        return {entries}\n"),
            (Given::Nothing, _) => format!("        return [{entries}]\n"),
            (Given::Position, _) => format!("        return _scalar(X0, 0.0, {entries})\n"),
            (_, Shape::Scalar) => format!("        return _scalar(X0, t, {entries})\n"),
            (_, Shape::Vector) => format!("        return _vector(X0, t, [{entries}])\n"),
            (_, Shape::Matrix) => {
                let rows: Vec<String> = outputs
                    .chunks(code.spec.dimension)
                    .map(|row| format!("[{}]", row.join(", ")))
                    .collect();
                format!("        return _matrix(X0, t, [{}])\n", rows.join(", "))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_text_ends_a_string(text in r#"(["\\\n\r $%'&]|\PC){0,200}"#) {
            let literal = string(&text);
            let inner = &literal[1..literal.len() - 1];
            prop_assert!(inner.is_ascii() && !inner.contains('\n'));
            let mut characters = inner.chars();
            while let Some(c) = characters.next() {
                // Quotation marks are escaped, and the last backslash escapes something.
                prop_assert!(!['"'].contains(&c), "{literal}");
                if c == '\\' {
                    prop_assert!(characters.next().is_some(), "{literal}");
                }
            }
        }
    }
}
