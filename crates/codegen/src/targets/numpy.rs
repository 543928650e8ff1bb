//! NumPy source.

use super::python::{Arrays, Python, own_call};
use crate::code::Code;
use crate::runtime::Primitive;
use crate::target::{Called, Unwritable};
use std::borrow::Cow;

const NUMPY: Python = Python {
    function,
    primitive,
    remarks: "\
Python with NumPy alone. s = Solution(A=0.1) has u, v, a, H, F, J, P, b, rho0_b, static_force, sigma, S and tractions as s.u(X, t), and constants as s.density().
X has the shape (..., dimension) and t is a number or an array of the shape (...); results have the shapes (..., dimension), (..., dimension, \
dimension) or (...). Hosts that give points as columns, such as scikit-fem and dolfinx, take lambda x: s.u(x.T, t).T for a table of points.
NumPy's functions differ from the C library's in last bits.",
    half_plane: "    if X.shape[-1:] == (2,):\n        return [X[..., 0], 0.0, X[..., 1]]\n",
    preamble: "
import math

import numpy as np


def _position(X, dimension):
    X = np.asarray(X, dtype=float)
    if X.shape[-1:] != (dimension,):
        raise ValueError(f\"X has the shape {X.shape}; its last axis must have {dimension} entries, a point a row\")
    return [X[..., i] for i in range(dimension)]


def _scalar(x, t, entry):
    return np.broadcast_to(entry, np.broadcast_shapes(np.shape(x), np.shape(t))).copy()


def _vector(x, t, entries):
    return np.stack([_scalar(x, t, entry) for entry in entries], axis=-1)


def _matrix(x, t, rows):
    return np.stack([_vector(x, t, row) for row in rows], axis=-2)
",
    // NumPy computes both values of a choice.
    decorator: "@np.errstate(all=\"ignore\")\n",
    demands: "",
    cauchy: "        return np.einsum(\"...ik,...jk->...ij\", P, F) / J[..., None, None]\n",
    second: "        return np.linalg.solve(F, P)\n",
    arrays: Some(Arrays {
        name: "np",
        portions: "        X, t = [np.broadcast_to(x, shape).ravel() for x in X], np.broadcast_to(t, shape).ravel()
        portion = max(1, 2**22 // self.nodes)
        begins = range(0, max(t.size, 1), portion)
        parts = [self.at(self.series([x[k : k + portion] for x in X], field), t[k : k + portion]) for k in begins]
        return np.concatenate(parts).reshape(*shape, -1)
",
    }),
};

fn function(called: Called) -> Cow<'static, str> {
    let name = match called.or_library() {
        Called::Support(name) => return own_call(called, name),
        Called::Library("pow") => return "np.power(#, #)".into(),
        Called::Library("atan2") => return "np.arctan2(#, #)".into(),
        Called::Library("erf") => return "np.vectorize(math.erf, otypes=[float])(#)".into(),
        Called::Library("asin") => "arcsin",
        Called::Library("acos") => "arccos",
        Called::Library("atan") => "arctan",
        Called::Library("asinh") => "arcsinh",
        Called::Library("acosh") => "arccosh",
        Called::Library("atanh") => "arctanh",
        Called::Library(name) => name,
    };
    format!("np.{name}(#)").into()
}

fn primitive(primitive: Primitive) -> &'static str {
    match primitive {
        Primitive::Choose => "np.where(#, #, #)",
        Primitive::Less => "(# < #)",
        Primitive::AtMost => "(# <= #)",
        Primitive::Equal => "(# == #)",
        Primitive::Abs => "np.abs(#)",
        Primitive::Nearest => "np.rint(#)",
        Primitive::Exponent => "np.asarray(np.frexp(#)[1], dtype=float)",
        Primitive::Scaled => "np.ldexp(#, np.asarray(#, dtype=int))",
    }
}

pub(crate) fn source(code: &Code<'_>) -> Result<String, Unwritable> {
    Ok(NUMPY.source(code))
}
