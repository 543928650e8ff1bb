//! Exact symbolic expressions, from Maple-style text to straight-line programs.
//!
//! The way of an expression through this crate:
//!
//! 1. [`Ast::parse`] reads text into a syntax tree that knows where each part stands in the text.
//! 2. [`Graph::build`] turns the tree into an [`Expr`] of a hash-consed [`Graph`]: equal expressions are one
//!    node, numbers are exact rationals, and sums and products have a canonical form.
//! 3. [`Derivatives::of`] differentiates.
//! 4. [`Program::lower`] turns expressions into a list of floating-point operations in which every common
//!    subexpression is computed once. [`Program::evaluate`] runs it; code generators translate it.
//! 5. [`Program::with_gathered_factors`] leaves less of it to do for each point at each time, and
//!    [`Program::with_separated_coordinates`] for each point of a lattice, where asked to.
//!
//! The canonical form never expands a product of sums, since that loses digits: it collects like terms,
//! takes out factors that all terms share, and merges terms that differ in one factor only. Where an author
//! wants a quantity to stay in one piece, for example a strain that is small while one plus it is not,
//! [`Graph::whole`] keeps the algebra out.
//!
//! ```
//! use mmsmith_expr::{Ast, Dependence, Derivatives, Graph, Program};
//!
//! let mut graph = Graph::new();
//! let x = graph.symbol("x");
//! let ast = Ast::parse("x*sin(Pi*x)").unwrap();
//! let f = graph.build(&ast, &mut |_, name| (name == "x").then_some(x).ok_or("no such name".into())).unwrap();
//! let df = Derivatives::default().of(&mut graph, f, x);
//! assert_eq!(graph.print(df), "sin(x*Pi) + x*Pi*cos(x*Pi)");
//!
//! let program = Program::lower(&mut graph, &[(x, Dependence::default())], &[], &[df]);
//! assert_eq!(program.evaluate(&[0.5]), [1.0]);
//! ```

mod graph;
mod program;
mod rewrite;
pub mod rules;

pub use graph::{
    Ast, AstKind, BuildError, Derivatives, Expr, Function, Graph, Node, ParseError, Rational,
    Replacement, RustCall, nearest_f64,
};
pub use program::{
    Dependence, MOST_KEPT_OF_STATES, Operation, OperationCount, OperationsByStage, Program,
    RangeOfInputs, Scalar, Section, Slot,
};
pub use rewrite::{CosineAndSine, Term};
pub use rules::Rule;
