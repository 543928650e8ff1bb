//! [Exact expressions](mmsmith_expr) evaluated in arbitrary precision: the truth that double-precision results are held
//! against.
//!
//! - [`Oracle::evaluate`] computes expressions of a [`Graph`](mmsmith_expr::Graph) at exact inputs in a stated
//!   number of bits; [`Oracle::settle`] raises the number of bits until the digits asked for stand still.
//! - [`Sensitivity`] says how far a result moves when its inputs move: `sum over inputs q of |q dy/dq|`.
//! - [`worst_factor`] is the factor `K` of the acceptance rule `|r - g| <= K 2^-53 (sens + |g|)` for a
//!   double-precision result `r` of the exact value `g`.
//! - [`Accuracy`] measures the largest such factor over many points of a specification, by field and by [`Class`] of
//!   inputs; a [`Search`] goes from the worst of them to worse ones.
//!
//! Inputs and results are exact rationals; every finite double is one ([`exact`]).
//!
//! ```
//! use mmsmith_expr::{Ast, Graph};
//! use mmsmith_oracle::{Oracle, Point, exact, scientific, worst_factor};
//!
//! let mut graph = Graph::new();
//! let x = graph.symbol("x");
//! let y = graph.build(&Ast::parse("sin(Pi*x)").unwrap(), &mut |_, _| Ok(x)).unwrap();
//! let values = [(x, exact(0.1).unwrap())];
//! let point = Point { graph: &graph, definitions: &[], values: &values };
//! let mut oracle = Oracle::new(Oracle::USUAL_BITS).unwrap();
//! let truth = oracle.settle(&point, &[y], 30).unwrap().remove(0);
//! assert_eq!(scientific(&truth, 25), "3.090169943749474406880937e-1");
//! assert!(worst_factor((std::f64::consts::PI * 0.1).sin(), &truth, &truth) < 2.0);
//! ```

mod ablation;
mod acceptance;
mod accuracy;
mod convert;
mod double_double;
mod evaluate;
mod sample;
mod scientific;
mod search;
mod sensitivity;

pub use ablation::{Effect, Exam, Lines, Loss, Mark, ablated};
pub use acceptance::{units, worst_factor};
pub use accuracy::{
    Accuracy, AccuracyError, ClassAccuracy, Found, Judged, JudgedCode, LARGEST_FACTOR,
    LARGEST_UNITS, Worst, programs,
};
pub use convert::exact;
pub use evaluate::{Oracle, OracleError, Point};
pub use sample::{Class, Sampler};
pub use scientific::scientific;
pub use search::{ROUND, Search};
pub use sensitivity::Sensitivity;
