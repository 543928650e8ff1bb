//! The fields of a specification as one straight-line program in stages: what is computed when, before any language comes in.
//!
//! [`Staged::of`] is the only way from derived fields to what is computed. Generated code, of whatever language, is a rendering of its
//! result, the interpreter evaluates it, `mms check --thorough` judges it and `mms explain` counts it; so what is judged is
//! what is generated.
//!
//! # Passes
//!
//! | pass | before | after | when | rounding |
//! |---|---|---|---|---|
//! | [`Program::lower`](mmsmith_expr::Program::lower) | expressions | operations, equal ones once | all outputs together, in one program | constants of sums last, powers as products, `sin(Pi x)` as one operation, sums of coordinates with what rounding takes from them |
//! | [`with_gathered_factors`](mmsmith_expr::Program::with_gathered_factors) | operations | factors of one rate are multiplied first | the staged `b` | one rounding a factor, as before, in another order; taken only within error bounds |
//! | [`with_separated_coordinates`](mmsmith_expr::Program::with_separated_coordinates) | the staged `b` | sums of products of values of one coordinate each | where points lie in a lattice and it halves the work | the same bound; not a number where a form does not hold, and then the staged form serves |
//! | [`kept_at_points`](mmsmith_expr::Program::kept_at_points) | operations | which values are kept for each point | body force, and state with velocity | none: a kept value has the bits of a computed one |
//!
//! Values of the parameters alone are kept once for given parameters, values of the time alone once a time.

mod block;
mod field;
mod outputs;
mod staged;

pub use block::{Block, Operand, Stage};
pub use field::{Field, FieldName, Shape};
pub use staged::{
    BodyForceOperations, Constants, History, Lattice, Measures, Sides, Slope, Staged, Stages,
    Traction, TubeMeasures,
};
