//! UFL source.

use super::python::{Python, own_call};
use crate::code::Code;
use crate::runtime::Primitive;
use crate::target::{Called, Unwritable};
use std::borrow::Cow;

const UFL: Python = Python {
    function,
    primitive,
    remarks: "\
Python with UFL alone. s = Solution(A=0.1) has u, v, a, H, F, J, P, b, rho0_b, static_force, sigma, S and tractions as expressions, s.u(X, t) with \
X = ufl.SpatialCoordinate(mesh) on the REFERENCE mesh and t a number or a Constant, and constants as s.density().
P[i, J] is what inner(P, grad(v)) takes with UFL's grad, whose last index is that of the derivative: no transpose. The form of the body force is \
inner(s.rho0_b(X, t), v)*dx. Raise the quadrature degree: expressions have an estimated degree that is large.
UFL has neither rounding to whole numbers nor ln(1 + x): sin(pi x) is formed as it stands, which costs some units in the last place.",
    half_plane: "    if ufl.as_ufl(X).ufl_shape == (2,):\n        return [X[0], 0.0, X[1]]\n",
    preamble: "
import math

import ufl


def _position(X, dimension):
    if ufl.as_ufl(X).ufl_shape != (dimension,):
        raise ValueError(f\"X has the shape {ufl.as_ufl(X).ufl_shape}; it must be ({dimension},)\")
    return [X[i] for i in range(dimension)]


def _scalar(x, t, entry):
    return ufl.as_ufl(entry)


def _vector(x, t, entries):
    return ufl.as_vector(entries)


def _matrix(x, t, rows):
    return ufl.as_matrix(rows)
",
    decorator: "",
    demands: "",
    cauchy: "        return P * ufl.transpose(F) / J\n",
    second: "        return ufl.inv(F) * P\n",
    arrays: None,
};

fn function(called: Called) -> Cow<'static, str> {
    let name = match called.or_library() {
        Called::Support("sin_pi") => return "ufl.sin(ufl.pi * (#))".into(),
        Called::Support("cos_pi") => return "ufl.cos(ufl.pi * (#))".into(),
        Called::Support("far_logarithm") => return "ufl.ln(#)".into(),
        Called::Support(name) => return own_call(called, name),
        Called::Library("pow") => return "(#)**#".into(),
        Called::Library("log1p") => return "_log_1p(#)".into(),
        // UFL lacks these functions. They are formed by functions of half the argument, so that small arguments keep their digits.
        Called::Library("expm1") => {
            return "(lambda x: 2.0 * ufl.sinh(x / 2.0) * ufl.exp(x / 2.0))(#)".into();
        }
        Called::Library("asinh") => {
            return "(lambda x: ufl.sign(x) * ufl.ln(abs(x) + ufl.sqrt(x * x + 1.0)))(#)".into();
        }
        Called::Library("acosh") => {
            return "(lambda x: ufl.ln(x + ufl.sqrt(x * x - 1.0)))(#)".into();
        }
        Called::Library("atanh") => {
            return "(lambda x: ufl.ln((1.0 + x) / (1.0 - x)) / 2.0)(#)".into();
        }
        Called::Library("log") => "ln",
        Called::Library("atan2") => return "ufl.atan2(#, #)".into(),
        Called::Library(name) => name,
    };
    format!("ufl.{name}(#)").into()
}

fn primitive(primitive: Primitive) -> &'static str {
    match primitive {
        Primitive::Choose => "ufl.conditional(#, #, #)",
        Primitive::Less => "ufl.lt(#, #)",
        Primitive::AtMost => "ufl.le(#, #)",
        Primitive::Equal => "ufl.eq(#, #)",
        Primitive::Abs => "abs(#)",
        // Never called: UFL has the functions that would call these primitives.
        Primitive::Nearest | Primitive::Exponent | Primitive::Scaled => "",
    }
}

pub(crate) fn source(code: &Code<'_>) -> Result<String, Unwritable> {
    Ok(UFL.source(code))
}
