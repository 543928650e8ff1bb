//! Expressions for Kratos, as JSON.

use super::strings::{Entry, Field, Strings, head};
use crate::code::Code;
use crate::target::Unwritable;
use crate::text::one_line;

const REMARKS: &str = "\
Expressions for assign_vector_variable_process and GenericFunctionUtility of Kratos, in X, Y, Z (the REFERENCE position, which Kratos passes beside the \
current x, y, z) and t. Take `b` for VOLUME_ACCELERATION, which elements multiply by the density; `rho0_b` for loads per volume; and set the density to \
that of `constants`. `u` and `v` are for boundary and initial conditions.";

const KRATOS: Strings = Strings {
    host: "kratos",
    coordinates: ["X", "Y", "Z"],
    functions: &[
        ("sin", "sin"),
        ("cos", "cos"),
        ("tan", "tan"),
        ("asin", "asin"),
        ("acos", "acos"),
        ("atan", "atan"),
        ("atan2", "atan2"),
        ("sinh", "sinh"),
        ("cosh", "cosh"),
        ("tanh", "tanh"),
        ("exp", "exp"),
        ("log", "ln"),
        ("sqrt", "sqrt"),
    ],
    names_values: false,
};

/// A JSON string.
fn string(text: &str) -> String {
    let mut literal = String::from("\"");
    for c in one_line(text).chars() {
        match c {
            '"' | '\\' => literal.extend(['\\', c]),
            ' '..='~' => literal.push(c),
            _ => c
                .encode_utf16(&mut [0; 2])
                .iter()
                .for_each(|unit| literal += &format!("\\u{unit:04x}")),
        }
    }
    literal + "\""
}

fn list(entries: &[String]) -> String {
    format!("[\n    {}\n  ]", entries.join(",\n    "))
}

pub(crate) fn source(code: &Code<'_>) -> Result<String, Unwritable> {
    let about: Vec<String> = head(code, REMARKS).iter().map(|line| string(line)).collect();
    let mut text = format!("{{\n  \"about\": {}", list(&about));
    for Field { name, about, entries } in KRATOS.fields(code)? {
        let expressions: Vec<String> =
            entries.iter().map(|Entry { text, .. }| string(text)).collect();
        text += &format!(",\n  {}: {}", string(&format!("about {name}")), string(&about));
        text += &format!(",\n  {}: {}", string(&name), list(&expressions));
    }
    text += ",\n  \"constants\": {";
    let names = ["density", "period", "wave_speed", "cell_length"];
    let values =
        names.map(|name| format!("\n    {}: {}", string(name), KRATOS.constant(code, name)));
    Ok(text + &values.join(",") + "\n  }\n}\n")
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
