//! Input blocks for MOOSE.

use super::strings::{Field, Strings, head};
use crate::code::Code;
use crate::listing::commented;
use crate::names::Names;
use crate::target::Unwritable;

const REMARKS: &str = "\
Input blocks for MOOSE: a ParsedFunction for each entry of each field, a BodyForce for each component, and an ElementL2Error for each component of u. \
Merge them with an input whose variables are disp_x, disp_y and disp_z; x, y, z are the REFERENCE position as long as the kernel and the mesh are \
undisplaced (use_displaced_mesh = false, a total Lagrangian formulation). BodyForce takes a force per volume, with the sign of the residual in mind: it \
adds minus (f, test), so that rho0_b goes in as it is. Inertia is that of InertialForce with the density below.
In the half plane of a body of revolution (coord_type = RZ) x is the reference radius and y the height, the variables are disp_r and disp_z, and \
entries 0, 1, 2 are those along R, the angle and Z.
An expression names its values before it uses them (t5 := ...;), which the parser of MOOSE, fparser, calls inline variables.";

const MOOSE: Strings = Strings {
    host: "moose",
    coordinates: ["x", "y", "z"],
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
        ("asinh", "asinh"),
        ("acosh", "acosh"),
        ("atanh", "atanh"),
        ("exp", "exp"),
        ("log", "log"),
        ("sqrt", "sqrt"),
    ],
    names_values: true,
};

/// The statements of an expression in lines.
fn lines(expression: &str) -> String {
    let mut text = String::new();
    let mut length = 0;
    for statement in expression.split_inclusive("; ") {
        if length + statement.len() > 100 {
            text = text.trim_end().to_owned() + "\n      ";
            length = 0;
        }
        text += statement;
        length += statement.len();
    }
    text
}

pub(crate) fn source(code: &Code<'_>) -> Result<String, Unwritable> {
    let prefix = format!("mms_{}", Names::of(&code.spec.name).module);
    // In the half plane of a body of revolution x is the radius, and y the height.
    let (strings, axes) = match code.is_of_half_plane {
        true => (Strings { coordinates: ["x", "0", "y"], ..MOOSE }, vec![(0, "r"), (2, "z")]),
        false => {
            let axes = ["x", "y", "z"].into_iter().enumerate().take(code.spec.dimension);
            (MOOSE, axes.collect())
        }
    };
    let mut text = commented(&head(code, REMARKS), "#", 118);
    for name in ["density", "period", "wave_speed", "cell_length"] {
        text += &format!("{prefix}_{name} = {}\n", strings.constant(code, name));
    }
    text += "\n[Functions]\n";
    for Field { about, entries, .. } in strings.fields(code)? {
        text += &format!("  # {about}\n");
        for entry in entries {
            text += &format!(
                "  [{prefix}_{}]\n    type = ParsedFunction\n    expression = '{}'\n  []\n",
                entry.name,
                lines(&entry.text)
            );
        }
    }
    text += "[]\n\n[Kernels]\n";
    for (i, axis) in &axes {
        text += &format!(
            "  [{prefix}_force_{axis}]\n    type = BodyForce\n    variable = disp_{axis}\n    function = {prefix}_rho0_b_{i}\n  []\n"
        );
    }
    text += "[]\n\n[Postprocessors]\n";
    for (i, axis) in &axes {
        text += &format!(
            "  [{prefix}_error_{axis}]\n    type = ElementL2Error\n    variable = disp_{axis}\n    function = {prefix}_u_{i}\n  []\n"
        );
    }
    Ok(text + "[]\n")
}
