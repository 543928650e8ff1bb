//! Expressions for FEBio, as XML.

use super::strings::{Field, Strings, head};
use crate::code::Code;
use crate::target::Unwritable;

const REMARKS: &str = "\
Expressions for FEBio in X, Y, Z (the REFERENCE position) and t. In two dimensions the third component is zero.
The body load's force is MINUS b: FEBio takes a force per mass, multiplies it by the density and the reference volume, and SUBTRACTS it \
(seen in FEBio 4). `b` and `rho0_b` are given beside it with their own signs.
FEBio 4 copies an expression into 512 characters without asking: where one here is longer, build it with a larger `szcopy` in FECore/MObjBuilder.cpp.";

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
    let component = |index: usize| {
        let entry = load.and_then(|field| field.entries.get(index));
        entry.map_or("0".to_owned(), |entry| format!("0-{}", entry.text))
    };
    text += &format!(
        "  <body_load type=\"body force\">\n    <force type=\"math\">{}</force>\n  </body_load>\n",
        [0, 1, 2].map(component).join(",")
    );
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
