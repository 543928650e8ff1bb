//! Expressions for FEBio, as XML.

use super::strings::{Field, Strings, head};
use crate::code::Code;
use crate::target::Unwritable;

const REMARKS: &str = "\
Expressions for FEBio in X, Y, Z (the REFERENCE position) and t. In two dimensions the third component is zero.
The body load's force is MINUS b: FEBio takes a force per mass, multiplies it by the density and the reference volume, and SUBTRACTS it \
(as read in its source; try a constant force first). `b` and `rho0_b` are given beside it with their own signs.
Some versions of FEBio copy an expression into 512 characters without asking: build it with a longer copy where an expression here is longer.";

const FEBIO: Strings = Strings {
    host: "febio",
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
        ("erf", "erf"),
    ],
    names_values: false,
};

/// Text for an element or a comment.
fn escaped(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    // Two hyphens would end a comment.
    text.replace("--", "- -").replace("--", "- -")
}

pub(crate) fn source(code: &Code<'_>) -> Result<String, Unwritable> {
    let about: Vec<String> =
        head(code, REMARKS).iter().map(|line| format!("  {}\n", escaped(line))).collect();
    let fields = FEBIO.fields(code)?;
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<!--\n{}-->\n<mmsmith>\n",
        about.concat()
    );
    let load = fields.iter().find(|field| field.name == "b");
    text += "  <body_load type=\"non-const\">\n";
    for (index, axis) in ["x", "y", "z"].iter().enumerate() {
        let component = load.and_then(|field| field.entries.get(index));
        let force = component.map_or("0".to_owned(), |entry| format!("0-{}", entry.text));
        text += &format!("    <{axis}>{force}</{axis}>\n");
    }
    text += "  </body_load>\n";
    for Field { name, about, entries } in &fields {
        text += &format!("  <field name=\"{name}\"> <!-- {} -->\n", escaped(about));
        for entry in entries {
            text += &format!("    <entry name=\"{}\">{}</entry>\n", entry.name, entry.text);
        }
        text += "  </field>\n";
    }
    for name in ["density", "period", "wave_speed", "cell_length"] {
        text += &format!("  <constant name=\"{name}\">{}</constant>\n", FEBIO.constant(code, name));
    }
    Ok(text + "</mmsmith>\n")
}
