//! JAX source.

use super::python::{Arrays, Python, own_call};
use crate::code::Code;
use crate::runtime::Primitive;
use crate::target::{Called, Unwritable};
use std::borrow::Cow;

const JAX: Python = Python {
    function,
    primitive,
    remarks: "\
Python with JAX alone, in double precision: call jax.config.update(\"jax_enable_x64\", True) first. s = Solution(A=0.1) has u, v, a, H, F, J, P, b, \
rho0_b, static_force, sigma, S and tractions as s.u(X, t), and constants as s.density(). X has the shape (..., dimension); results have the shapes (..., dimension), \
(..., dimension, dimension) or (...). All of them can be traced, mapped and differentiated: jax.jacfwd(s.u)(X, t) at a point is s.H(X, t).
JAX's functions differ from the C library's in last bits, and XLA may fuse a product with a sum.",
    half_plane: "    if X.shape[-1:] == (2,):\n        return [X[..., 0], 0.0, X[..., 1]]\n",
    preamble: "
import math

import jax
import jax.numpy as jnp


def _position(X, dimension):
    X = jnp.asarray(X)
    if X.shape[-1:] != (dimension,):
        raise ValueError(f\"X has the shape {X.shape}; its last axis must have {dimension} entries, a point a row\")
    return [X[..., i] for i in range(dimension)]


def _scalar(x, t, entry):
    return jnp.broadcast_to(entry, jnp.broadcast_shapes(jnp.shape(x), jnp.shape(t)))


def _vector(x, t, entries):
    return jnp.stack([_scalar(x, t, entry) for entry in entries], axis=-1)


def _matrix(x, t, rows):
    return jnp.stack([_vector(x, t, row) for row in rows], axis=-2)
",
    decorator: "",
    demands: "        if not jax.config.jax_enable_x64:
            raise RuntimeError('JAX computes in single precision; call jax.config.update(\"jax_enable_x64\", True) first')\n",
    cauchy: "        return jnp.einsum(\"...ik,...jk->...ij\", P, F) / J[..., None, None]\n",
    second: "        return jnp.linalg.solve(F, P)\n",
    arrays: Some(Arrays {
        name: "jnp",
        portions: "        return self.at(self.series([jnp.broadcast_to(x, shape) for x in X], field), t)
",
    }),
};

fn function(called: Called) -> Cow<'static, str> {
    let name = match called.or_library() {
        // The reduction by powers of two has no derivative in JAX; its own logarithm has.
        Called::Support("far_logarithm") => return "jnp.log(#)".into(),
        Called::Support(name) => return own_call(called, name),
        Called::Library("pow") => return "jnp.power(#, #)".into(),
        Called::Library("atan2") => return "jnp.arctan2(#, #)".into(),
        Called::Library("erf") => return "jax.scipy.special.erf(#)".into(),
        Called::Library("asin") => "arcsin",
        Called::Library("acos") => "arccos",
        Called::Library("atan") => "arctan",
        Called::Library("asinh") => "arcsinh",
        Called::Library("acosh") => "arccosh",
        Called::Library("atanh") => "arctanh",
        Called::Library(name) => name,
    };
    format!("jnp.{name}(#)").into()
}

fn primitive(primitive: Primitive) -> &'static str {
    match primitive {
        Primitive::Choose => "jnp.where(#, #, #)",
        Primitive::Less => "(# < #)",
        Primitive::AtMost => "(# <= #)",
        Primitive::Equal => "(# == #)",
        Primitive::Abs => "jnp.abs(#)",
        Primitive::Nearest => "jnp.round(#)",
        Primitive::Exponent => "jnp.frexp(#)[1]",
        Primitive::Scaled => "jnp.ldexp(#, #)",
    }
}

pub(crate) fn source(code: &Code<'_>) -> Result<String, Unwritable> {
    Ok(JAX.source(code))
}
